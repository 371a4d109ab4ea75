!> Reads `&support` and `&load` from checked groups.
module dotyk_input_boundary
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, load_acceleration, load_angular_velocity, load_force_density, &
    load_local_traction, load_names, load_pressure, load_total
  use dotyk_base_text, only: join, shown, split_words, text_t, to_text
  use dotyk_input_case, only: body_input_t, load_input_t, material_input_t, support_input_t
  use dotyk_input_groups, only: group_t
  use dotyk_input_references, only: input_t, names_several
  implicit none
  private
  public :: check_densities, read_support, read_load, read_vector

contains

  !> Read `&support`.
  subroutine read_support(group, input, support, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    !> The support, without a body; incomplete where the group has mistakes.
    type(support_input_t), intent(out) :: support
    !> Bodies that the group names, ascending; none where the name is unknown (n_matched).
    integer, allocatable, intent(out) :: matched(:)
    character(:), allocatable :: message
    support%line = group%line
    call input%refer_to_bodies(group, 'body', group%text_of('body'), matched)
    support%any_body = names_several(group%text_of('body'), input%bodies)
    support%surface = group%text_of('surface')
    allocate (support%value_formula(0))
    if (group%is_given('value') .and. group%is_given('value_formula')) &
      call input%report(group, 'value', 'value and value_formula are both given: only one can be meant')
    if (group%is_given('case') .and. .not. (group%is_given('value') .or. group%is_given('value_formula'))) &
      call input%report(group, 'case', 'case is that of value, which is missing: what is held is the same in all '// &
                        'load cases (for value = 0 in this one and another value elsewhere, give value)')
    if (.not. group%is_usable('fix')) return
    call support%fix%parse(group%text_of('fix'), input%scene%dimension, message)
    if (len(message) > 0) then
      call input%report(group, 'fix', 'fix: '//message)
      return
    end if
    call read_vector(group, input, 'value', support%fix%local, support%value)
    call read_formulas(group, input, 'value_formula', support%fix%local, support%value_formula)
    call refuse_values_not_fixed(group, input, support)
  end subroutine read_support

  !> Report values in directions without prescribed displacement.
  subroutine refuse_values_not_fixed(group, input, support)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(support_input_t), intent(in) :: support  !! The support, with directions and values.
    character(:), allocatable :: name
    integer :: i
    do i = 1, 3
      if (support%fix%fixed(i)) cycle
      name = support%fix%name(i)
      if (abs(support%value(i)) > 0) &
        call input%report(group, 'value', 'value has '//name//' = '//to_text(support%value(i))// &
                          ', but fix does not name '//name)
      if (size(support%value_formula) == 0) cycle
      if (support%value_formula(i)%s /= '0') &
        call input%report(group, 'value_formula', 'value_formula has '//name//' = '// &
                          shown(support%value_formula(i)%s)//', but fix does not name '//name//' (write ''0'')')
    end do
  end subroutine refuse_values_not_fixed

  !> Read `&load`.
  subroutine read_load(group, input, load, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(out) :: load  !! The load, without a body; incomplete where the group has mistakes.
    !> Bodies that the group names, ascending; none where the name is unknown (n_matched).
    integer, allocatable, intent(out) :: matched(:)
    type(text_t), allocatable :: kinds(:)
    character(:), allocatable :: given, key
    logical :: is_constant, is_formula
    integer :: k, n
    load%line = group%line
    call input%refer_to_bodies(group, 'body', group%text_of('body'), matched)
    load%any_body = names_several(group%text_of('body'), input%bodies)
    load%surface = group%text_of('surface')
    allocate (load%formula(0))
    call split_words(load_names, kinds)
    given = ''
    n = 0
    do k = 1, size(kinds)
      is_constant = group%is_given(kinds(k)%s)
      is_formula = group%is_given(kinds(k)%s//'_formula')
      if (.not. (is_constant .or. is_formula)) cycle
      if (is_constant .and. is_formula) &
        call input%report(group, kinds(k)%s, kinds(k)%s//' and '//kinds(k)%s//'_formula are both given: only one '// &
                          'can be meant')
      n = n + 1
      given = given//', '//kinds(k)%s
      load%kind = k
    end do
    if (group%is_given('force') .or. group%is_given('moment')) then
      n = n + 1
      given = given//', force and moment'
      load%kind = load_total
    else if (group%is_given('point')) then
      call input%report(group, 'point', 'point goes together with force and moment only')
    end if
    if (n /= 1) then
      if (n == 0) given = ', none of them'
      call input%add(group%line, '&load: exactly one of '//join(kinds, ', ')//' (or its formula), or force and '// &
                     'moment, is needed, got '//given(3:))
      return
    end if
    key = 'force'
    if (load%kind <= size(kinds)) key = kinds(load%kind)%s
    if (any(load%kind == [load_force_density, load_angular_velocity, load_acceleration])) then
      if (group%is_given('surface')) call input%report(group, 'surface', 'surface does not go together with '//key)
    else if (.not. group%is_given('surface')) then
      call input%add(group%line, '&load: ''surface'' is missing')
    end if
    if (group%is_given('centre') .and. load%kind /= load_angular_velocity) &
      call input%report(group, 'centre', 'centre means nothing without angular_velocity')
    if (load%kind == load_angular_velocity) then
      call read_rotation(group, input, load)
    else if (load%kind == load_total) then
      call read_total(group, input, load)
    else if (load%kind == load_pressure) then
      load%value(1) = group%real_of(key)
      call group%texts_of(key//'_formula', load%formula)
    else
      call read_vector(group, input, key, load%kind == load_local_traction, load%value)
      call read_formulas(group, input, key//'_formula', load%kind == load_local_traction, load%formula)
      if (load%kind == load_acceleration .and. input%scene%analysis == analysis_axisymmetric .and. &
          abs(load%value(1)) > 0) call input%report(group, key, 'acceleration: in axisymmetric analyses only that '// &
          'along the axis y exists')
    end if
  end subroutine read_load

  !> Read angular velocity and centre.
  subroutine read_rotation(group, input, load)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(inout) :: load  !! Gets both.
    character, parameter :: name(3) = ['x', 'y', 'z']
    real(dp), allocatable :: numbers(:)
    integer :: axis
    axis = merge(2, 3, input%scene%analysis == analysis_axisymmetric)
    call group%reals_of('angular_velocity', numbers)
    if (size(numbers) == 3) then
      load%value = numbers
      load%value(axis) = 0
      if (input%scene%dimension == 2 .and. any(abs(load%value) > 0)) &
        call input%report(group, 'angular_velocity', 'angular_velocity must be about '//name(axis)// &
                          ' in this analysis: its other components are 0')
      load%value = numbers
    else if (size(numbers) == 1 .and. input%scene%dimension == 2) then
      load%value(axis) = numbers(1)
    else if (group%is_usable('angular_velocity')) then
      call input%report(group, 'angular_velocity', 'angular_velocity needs '// &
                        trim(merge('1 or 3 values                ', '3 values in three dimensions ', &
                        input%scene%dimension == 2))//', got '//to_text(size(numbers)))
    end if
    call read_vector(group, input, 'centre', .false., load%centre)
    if (group%is_given('centre') .and. input%scene%analysis == analysis_axisymmetric) &
      call input%report(group, 'centre', 'axisymmetric bodies rotate about their axis: remove centre')
  end subroutine read_rotation

  !> Report bodies without a density that a load needs; those with point masses may have none at all.
  subroutine check_densities(input, load, body, material)
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(in) :: load(:)  !! Loads of bodies (n_loads).
    type(body_input_t), intent(in) :: body(:)  !! The bodies (n_bodies).
    type(material_input_t), intent(in) :: material(:)  !! The materials (n_materials).
    integer :: i, k
    do i = 1, size(load)
      if (.not. any(load(i)%kind == [load_angular_velocity, load_acceleration]) .or. load(i)%body == 0) cycle
      if (body(load(i)%body)%is_surface) cycle
      if (any(load%of_mass .and. load%body == load(i)%body) .and. &
          .not. any([(has_density(body(load(i)%body)%material(k)), k=1, size(body(load(i)%body)%material))])) cycle
      do k = 1, size(body(load(i)%body)%material)
        associate (m => body(load(i)%body)%material(k))
          if (m == 0) cycle
          if (.not. has_density(m)) &
            call input%add(load(i)%line, '&load: the material '//shown(material(m)%name)//' of body '// &
                           shown(body(load(i)%body)%name)//' has no density')
        end associate
      end do
    end do

  contains

    !> Whether a material has a density.
    pure logical function has_density(m)
      integer, intent(in) :: m  !! The material; 0 for none.
      has_density = .false.
      if (m > 0) has_density = material(m)%density > 0 .or. len(material(m)%density_formula) > 0
    end function has_density
  end subroutine check_densities

  !> Read force, moment and point of a total load.
  subroutine read_total(group, input, load)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(load_input_t), intent(inout) :: load  !! Gets them.
    real(dp), allocatable :: moment(:)
    call read_vector(group, input, 'force', .false., load%value)
    call read_vector(group, input, 'point', .false., load%point)
    load%has_point = group%is_given('point')
    call group%reals_of('moment', moment)
    if (size(moment) == 3) then
      load%moment = moment
      if (input%scene%dimension == 2 .and. any(abs(moment(1:2)) > 0)) &
        call input%report(group, 'moment', 'moment: the x and y components must be 0 in two dimensions')
    else if (size(moment) == 1 .and. input%scene%dimension /= 3) then
      load%moment(3) = moment(1)
    else if (size(moment) > 0) then
      call input%report(group, 'moment', 'moment needs 3 values'//trim(merge('             ', ' or that of z', &
                        input%scene%dimension == 3))//', got '//to_text(group%count_of('moment')))
    end if
  end subroutine read_total

  !> Read a vector with three components from two or three numbers.
  subroutine read_vector(group, input, key, local, vector)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the vector is in the axes of a surface: xi, eta, n.
    real(dp), intent(out) :: vector(3)  !! The vector (3) [unit of the key]; 0 where it is not given.
    real(dp), allocatable :: numbers(:)
    integer :: across
    vector = 0
    call group%reals_of(key, numbers)
    if (.not. right_count(group, input, key, size(numbers))) return
    across = merge(2, 3, local)
    if (size(numbers) == 3) then
      vector = numbers
      if (input%scene%dimension == 2 .and. abs(vector(across)) > 0) call report_across(group, input, key, local)
    else
      vector(1) = numbers(1)
      vector(merge(3, 2, local)) = numbers(2)
    end if
  end subroutine read_vector

  !> Read a vector of formulas from two or three texts.
  subroutine read_formulas(group, input, key, local, formulas)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the formulas are in the axes of a surface: xi, eta, n.
    type(text_t), allocatable, intent(out) :: formulas(:)  !! Formulas of the components (3), or none.
    type(text_t), allocatable :: texts(:)
    integer :: i, across
    call group%texts_of(key, texts)
    if (.not. right_count(group, input, key, size(texts))) then
      allocate (formulas(0))
      return
    end if
    across = merge(2, 3, local)
    allocate (formulas(3))
    if (size(texts) == 3) then
      do i = 1, 3
        formulas(i)%s = texts(i)%s
      end do
      if (input%scene%dimension == 2 .and. formulas(across)%s /= '0') call report_across(group, input, key, local)
    else
      formulas(1)%s = texts(1)%s
      formulas(across)%s = '0'
      formulas(merge(3, 2, local))%s = texts(2)%s
    end if
  end subroutine read_formulas

  !> Whether a vector is given with as many values as the space has dimensions; too few are reported.
  logical function right_count(group, input, key, n) result(right)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    integer, intent(in) :: n  !! Number of its values; 0 where it is not given or not usable.
    right = n > 0
    if (n /= 2 .or. input%scene%dimension /= 3) return
    call input%report(group, key, key//' needs 3 values in three dimensions, got '//to_text(group%count_of(key)))
    right = .false.
  end function right_count

  !> Report a component across the plane in two dimensions.
  subroutine report_across(group, input, key, local)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! Name of the key.
    logical, intent(in) :: local  !! Whether the vector is in the axes of a surface: xi, eta, n.
    call input%report(group, key, key//': the '//trim(merge('eta', 'z  ', local))//' component must be 0 in two '// &
                      'dimensions')
  end subroutine report_across
end module dotyk_input_boundary
