!> Reads `&temperature` and `&initial_stress` from checked groups.
module dotyk_input_fields
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_base_text, only: shown, to_text
  use dotyk_input_case, only: body_input_t, field_input_t, material_input_t, share_a_case
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: append_places, input_t
  implicit none
  private
  public :: read_initial_stresses, read_temperatures

contains

  !> Read all `&temperature`.
  subroutine read_temperatures(groups, input, body, material, temperature)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! The bodies (n_bodies).
    type(material_input_t), intent(in) :: material(:)  !! The materials (n_materials).
    !> One for each body that a group names (n_temperatures).
    type(field_input_t), allocatable, intent(out) :: temperature(:)
    integer :: i, k
    call read_fields(groups, input, 'temperature', temperature)
    do i = 1, size(temperature)
      associate (b => temperature(i)%body)
        if (b == 0) cycle
        do k = 1, size(body(b)%material)
          associate (m => body(b)%material(k))
            if (m == 0) cycle
            if (.not. material(m)%expands) &
              call input%add(temperature(i)%line, '&temperature: the material '//shown(material(m)%name)// &
                             ' of body '//shown(body(b)%name)//' has no expansion')
          end associate
        end do
      end associate
    end do
  end subroutine read_temperatures

  !> Read all `&initial_stress`.
  subroutine read_initial_stresses(groups, input, initial_stress)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    !> One for each body that a group names (n_initial_stresses).
    type(field_input_t), allocatable, intent(out) :: initial_stress(:)
    character(2), parameter :: name(6) = ['xx', 'yy', 'zz', 'xy', 'yz', 'xz']
    logical :: is_zero
    integer :: i, k
    call read_fields(groups, input, 'initial_stress', initial_stress)
    if (input%scene%dimension /= 2) return
    do i = 1, size(initial_stress)
      if (i > 1) then
        if (initial_stress(i)%line == initial_stress(i - 1)%line) cycle
      end if
      do k = 3, 6
        if (k == 4 .or. (k == 3 .and. input%scene%analysis /= analysis_plane_stress)) cycle
        is_zero = .not. abs(initial_stress(i)%value(k)) > 0
        if (size(initial_stress(i)%formula) > 0) is_zero = initial_stress(i)%formula(k)%s == '0'
        if (.not. is_zero) &
          call input%add(initial_stress(i)%line, '&initial_stress: the component '//name(k)//' must be 0 in '// &
                         trim(merge('plane stress  ', 'two dimensions', k == 3)))
      end do
    end do
  end subroutine read_initial_stresses

  !> Read all groups of one name; a body that two of them name is reported.
  subroutine read_fields(groups, input, name, field)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: name  !! Name of the groups.
    type(field_input_t), allocatable, intent(out) :: field(:)  !! One for each body that a group names (n_fields).
    type(field_input_t), allocatable :: of_group(:)
    integer, allocatable :: picked(:), matched(:), group_of(:), body_of(:)
    integer :: i, j, k
    call pick_groups(groups, name, picked)
    allocate (of_group(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      associate (group => groups(picked(i)))
        call read_field(group, input, of_group(i), matched)
        twice: do k = 1, size(matched)
          do j = 1, size(body_of)
            if (body_of(j) /= matched(k)) cycle
            if (.not. share_a_case(of_group(i)%in_case, of_group(group_of(j))%in_case)) cycle
            call input%report(group, 'body', 'a second &'//name//' of body '//shown(input%bodies%name(matched(k))%s)// &
                              trim(merge(' in one load case', '                 ', size(input%cases%name) > 0))// &
                              ' (the first is in line '//to_text(of_group(group_of(j))%line)//')')
            exit twice
          end do
        end do twice
        call append_places(i, matched, group_of, body_of)
      end associate
    end do
    allocate (field(size(group_of)))
    do i = 1, size(group_of)
      field(i) = of_group(group_of(i))
      field(i)%body = body_of(i)
    end do
  end subroutine read_fields

  !> Read value or formula of one group.
  subroutine read_field(group, input, field, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(field_input_t), intent(out) :: field  !! The field, without a body; incomplete where the group has mistakes.
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that the group names, ascending (n_matched).
    call input%begin_action(group, field, matched)
    field%array = group%text_of('field')
    field%reference = group%real_of('reference')
    if (len(field%array) > 0) then
      call input%refuse(group, 'value', 'field')
      call input%refuse(group, 'formula', 'field')
    else if (group%is_given('reference')) then
      call input%report(group, 'reference', 'reference is for a field: value and formula are above that of the '// &
                        'unstressed body')
    end if
    call input%refuse_both(group, 'value', 'formula')
    if (.not. (group%is_given('value') .or. group%is_given('formula') .or. len(field%array) > 0)) &
      call input%add(group%line, '&'//group%name//': ''value'' or ''formula'' is missing')
    call group%read_numbers('value', field%value)
    call group%texts_of('formula', field%formula)
  end subroutine read_field
end module dotyk_input_fields
