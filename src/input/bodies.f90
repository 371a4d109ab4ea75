!> Reads `&body` from a checked group.
!>
!> Arrays of placed bodies: one `&body` with `repeat` stands for many.
!>
!> Copy (i, j, k), counted from 0, is the first copy rotated about `axis` through `centre` by i angle(1) + j angle(2) +
!> k angle(3), and then shifted by i shift(1) + j shift(2) + k shift(3).
module dotyk_input_bodies
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_rotation, only: rotation_matrix
  use dotyk_base_text, only: counted, join, shown, text_t, to_text
  use dotyk_input_case, only: body_input_t
  use dotyk_input_groups, only: group_t
  use dotyk_input_references, only: find_name, input_t, read_vector, why_unknown
  use dotyk_input_settings, only: read_mesh_path
  implicit none
  private
  public :: read_body, repeat_body, append_bodies, name_copies

  integer, parameter :: max_levels = 3, most_copies = 200000  !! Most levels of an array, and of its copies.

contains

  !> Read `&body`.
  subroutine read_body(group, input, directory, mesh_expected, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: directory  !! Directory of the namelist file.
    !> Whether a body without a mesh is a mistake; not where the mesh of the scene has one itself.
    logical, intent(in) :: mesh_expected
    type(body_input_t), intent(out) :: body  !! The body; incomplete where the group has mistakes.
    body%line = group%line
    body%name = group%text_of('name')
    if (index(body%name, ':') > 0) &
      call input%report(group, 'name', 'name: '//shown(body%name)//' must not contain '':''')
    call read_volumes(group, input, body)
    if (group%is_given('mesh')) then
      call read_mesh_path(group, input, directory, body%mesh)
      if (len(body%mesh) > 0 .and. body%mesh == input%scene%output) &
        call input%report(group, 'mesh', 'mesh: '//shown(body%mesh)//' is the results file of &scene')
    else
      body%mesh = input%scene%mesh
      if (len(input%scene%mesh) == 0 .and. mesh_expected) &
        call input%add(group%line, '&body: ''mesh'' is missing, here and in &scene')
    end if
    call read_placement(group, input, body)
    body%crack = group%logical_of('crack')
  end subroutine read_body

  !> Read the volumes of a body and their materials.
  subroutine read_volumes(group, input, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(inout) :: body  !! The body; its volumes and materials are set.
    type(text_t), allocatable :: names(:)
    character(:), allocatable :: message
    integer, allocatable :: index_of(:)
    integer :: i, k
    call group%texts_of('volume', body%volumes)
    call group%texts_of('material', names)
    body%is_surface = group%is_given('surface')
    if (body%is_surface) then
      ! gfortran 12 leaks the text of an array constructor.
      if (allocated(body%volumes)) deallocate (body%volumes)
      allocate (body%volumes(1))
      body%volumes(1)%s = group%text_of('surface')
      call input%refuse(group, 'volume', 'surface')
      call input%refuse(group, 'material', 'surface')
      call input%refuse(group, 'crack', 'surface')
      body%has_facing = group%is_given('facing')
      call read_vector(group, input, 'facing', .false., body%facing)
      ! It has none: the first one stands in.
      body%material = [1]
      body%material_of = [1]
      body%volume = union_name(body)
      return
    end if
    if (.not. group%is_given('volume')) call input%add(group%line, "&body: 'volume' is missing")
    if (.not. group%is_given('material')) call input%add(group%line, "&body: 'material' is missing")
    if (group%is_given('facing')) &
      call input%report(group, 'facing', 'facing tells the side of a body without volume: it needs surface')
    do i = 2, size(body%volumes)
      if (any([(body%volumes(k)%s == body%volumes(i)%s, k=1, i - 1)])) &
        call input%report(group, 'volume', 'volume: '//shown(body%volumes(i)%s)//' is named twice')
    end do
    if (size(names) > 1 .and. size(body%volumes) > 0 .and. size(names) /= size(body%volumes)) &
      call input%report(group, 'material', 'material has '//counted(size(names), 'value')//', and volume has '// &
                        to_text(size(body%volumes))//': give one material for all volumes, or one for each')
    allocate (index_of(max(1, size(names))), source=0)
    do i = 1, size(names)
      index_of(i) = find_name(input%materials, names(i)%s)
      message = why_unknown(input%materials, names(i)%s)
      if (len(message) > 0 .and. .not. any([(names(k)%s == names(i)%s, k=1, i - 1)])) &
        call input%report(group, 'material', 'material: '//message)
    end do
    allocate (body%material(0), body%material_of(size(body%volumes)))
    do i = 1, size(index_of)
      if (.not. any(body%material == index_of(i))) body%material = [body%material, index_of(i)]
    end do
    do i = 1, size(body%volumes)
      body%material_of(i) = findloc(body%material, index_of(min(i, size(index_of))), dim=1)
    end do
    body%volume = union_name(body)
  end subroutine read_volumes

  !> Name of the volumes of a body together: its only one, or those of one material joined by `, `, the materials by
  !> `; `.
  pure function union_name(body) result(name)
    type(body_input_t), intent(in) :: body  !! The body, with its volumes and their materials.
    character(:), allocatable :: name
    integer :: m
    name = ''
    do m = 1, size(body%material)
      if (m > 1) name = name//'; '
      name = name//join(pack(body%volumes, body%material_of == m), ', ')
    end do
  end function union_name

  !> Read the position and rotation of a body.
  subroutine read_placement(group, input, body)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(inout) :: body  !! The body; its placement is set.
    if (group%is_given('at') .and. group%is_usable('at')) then
      if (input%scene%dimension == 3 .and. group%count_of('at') < 3) &
        call input%report(group, 'at', 'at needs 3 values in three dimensions, got '//to_text(group%count_of('at')))
      call group%read_numbers('at', body%at)
      if (input%scene%dimension == 2 .and. abs(body%at(3)) > 0) &
        call input%report(group, 'at', 'at has z = '//to_text(body%at(3))//', but there is no z in two dimensions')
      if (input%scene%analysis == analysis_axisymmetric .and. abs(body%at(1)) > 0) &
        call input%report(group, 'at', 'at has x = '//to_text(body%at(1))//', but axisymmetric bodies are shifted '// &
                          'along y only')
    end if
    if (group%is_given('axis') .and. .not. (group%is_given('angle') .or. group%is_given('first_angle'))) &
      call input%report(group, 'axis', 'axis is given without an angle')
    if (group%is_given('axis') .and. group%is_usable('axis')) then
      call group%read_numbers('axis', body%axis)
      if (.not. maxval(abs(body%axis)) > 0) then
        call input%report(group, 'axis', 'axis has no direction: all its components are 0')
      else if (input%scene%dimension == 2 .and. maxval(abs(body%axis(:2))) > 0) then
        call input%report(group, 'axis', 'in two dimensions bodies are rotated about z only')
      end if
    end if
    if (group%is_given('angle')) body%angle = group%real_of('angle')
    if (input%scene%analysis /= analysis_axisymmetric) return
    if (group%is_given('angle')) &
      call input%report(group, 'angle', 'axisymmetric bodies cannot be rotated: remove angle')
    if (group%is_given('first_angle')) &
      call input%report(group, 'first_angle', 'axisymmetric bodies cannot be rotated: remove first_angle')
  end subroutine read_placement

  !> The copies of a body; the body itself where it is not repeated.
  subroutine repeat_body(group, input, body, copies)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body  !! The body as placed by `at`, `axis` and, where not repeated, `angle`.
    type(body_input_t), allocatable, intent(out) :: copies(:)  !! The copies, the first index fastest (n_copies).
    integer, allocatable :: n(:)
    real(dp) :: angle(max_levels), shift(3, max_levels), centre(3), turned, moved(3)
    real(dp), allocatable :: numbers(:)
    integer :: i, k, rest, number(max_levels), before
    before = input%count
    call refuse_without_repeat(group, input)
    call group%integers_of('repeat', n)
    if (size(n) == 0 .or. input%count > before) then
      copies = [body]
      return
    end if
    if (product(real(n, dp)) > most_copies) &
      call input%report(group, 'repeat', 'repeat makes more than '//to_text(most_copies)//' bodies')
    call group%reals_of('angle', numbers)
    if (size(numbers) > 0 .and. size(numbers) /= size(n)) &
      call input%report(group, 'angle', 'angle has '//counted(size(numbers), 'value')//', and repeat has '// &
                        to_text(size(n))//': one angle for each number of copies, 0 for none')
    angle = 0
    rest = min(size(numbers), size(n))
    angle(:rest) = numbers(:rest)
    call read_shifts(group, input, size(n), shift)
    call read_centre(group, input, centre)
    call check_name(group, input, 'name', body%name, size(n))
    do k = 1, size(body%volumes)
      if (index(body%volumes(k)%s, '*') > 0) call check_name(group, input, 'volume', body%volumes(k)%s, size(n))
    end do
    do k = 1, size(n)
      if (input%count > before) exit
      ! Copies of different volumes may lie where they are drawn.
      if (n(k) == 1 .or. index(body%volume, '*') > 0) cycle
      if (.not. (abs(modulo(angle(k), 360.0_dp)) > 0 .or. maxval(abs(shift(:, k))) > 0)) &
        call input%report(group, 'repeat', 'the '//to_text(n(k))//' copies lie in one place: give an angle or a '// &
                          'shift'//volumes_hint(body))
    end do
    if (input%count > before) then
      copies = [body]
      return
    end if
    allocate (copies(product(n)))
    do i = 1, size(copies)
      rest = i - 1
      number = 0
      do k = 1, size(n)
        number(k) = mod(rest, n(k))
        rest = rest/n(k)
      end do
      copies(i) = body
      copies(i)%name = name_of_copy(body%name, number(:size(n)) + 1)
      do k = 1, size(body%volumes)
        copies(i)%volumes(k)%s = name_of_copy(body%volumes(k)%s, number(:size(n)) + 1)
      end do
      copies(i)%volume = union_name(copies(i))
      turned = dot_product(real(number, dp), angle)
      moved = matmul(shift, real(number, dp))
      copies(i)%angle = group%real_of('first_angle') + turned
      if (abs(turned) > 0) then
        copies(i)%at = matmul(rotation_matrix(body%axis, turned), body%at - centre) + centre + moved
      else
        copies(i)%at = body%at + moved
      end if
    end do
  end subroutine repeat_body

  !> A hint where several volumes are named: they may be meant as one copy each.
  pure function volumes_hint(body) result(hint)
    type(body_input_t), intent(in) :: body  !! The body.
    character(:), allocatable :: hint
    hint = ''
    if (size(body%volumes) > 1) &
      hint = '; each copy has all '//to_text(size(body%volumes))//' volumes, as one body: for one body a volume '// &
             'write one &body for each, or a * in place of numbers from 1, as in volume=''solid *'''
  end function volumes_hint

  !> Report keys that mean nothing without `repeat`.
  subroutine refuse_without_repeat(group, input)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(11), parameter :: keys(3) = [character(11) :: 'shift', 'centre', 'first_angle']
    integer :: k
    if (group%is_given('repeat')) return
    do k = 1, size(keys)
      if (group%is_given(trim(keys(k)))) &
        call input%report(group, trim(keys(k)), trim(keys(k))//' is for repeated bodies: add repeat, or place the '// &
                          'body by at, axis and angle')
    end do
    if (group%count_of('angle') > 1) &
      call input%report(group, 'angle', 'angle has '//to_text(group%count_of('angle'))//' values: more than one is '// &
                        'for repeated bodies')
  end subroutine refuse_without_repeat

  !> Read the shifts, a vector of two or three components for each number of copies.
  subroutine read_shifts(group, input, levels, shift)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    integer, intent(in) :: levels  !! Number of levels of the array.
    real(dp), intent(out) :: shift(3, max_levels)  !! Shifts; 0 where they are not given (3, max_levels) [length].
    real(dp), allocatable :: numbers(:)
    integer :: components
    shift = 0
    call group%reals_of('shift', numbers)
    if (size(numbers) == 0) return
    components = 3
    if (input%scene%dimension == 2 .and. size(numbers) == 2*levels) components = 2
    if (size(numbers) /= components*levels) then
      call input%report(group, 'shift', 'shift has '//counted(size(numbers), 'value')//', and repeat has '// &
                        to_text(levels)//': '//to_text(input%scene%dimension)//' values for each number of copies, '// &
                        '0 for none')
      return
    end if
    shift(:components, :levels) = reshape(numbers, [components, levels])
    if (input%scene%dimension == 2 .and. maxval(abs(shift(3, :))) > 0) &
      call input%report(group, 'shift', 'shift has a z component, but there is no z in two dimensions')
    if (input%scene%analysis == analysis_axisymmetric .and. maxval(abs(shift(1, :))) > 0) &
      call input%report(group, 'shift', 'shift has an x component, but axisymmetric bodies are shifted along y only')
  end subroutine read_shifts

  !> Read the point of the axis about which copies are rotated.
  subroutine read_centre(group, input, centre)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    real(dp), intent(out) :: centre(3)  !! The point; 0 where it is not given (3) [length].
    real(dp), allocatable :: numbers(:)
    centre = 0
    call group%reals_of('centre', numbers)
    if (size(numbers) == 0) return
    centre(:size(numbers)) = numbers
    if (.not. group%is_given('angle')) call input%report(group, 'centre', 'centre is given without an angle')
    if (input%scene%dimension == 3 .and. size(numbers) < 3) &
      call input%report(group, 'centre', 'centre needs 3 values in three dimensions, got '//to_text(size(numbers)))
  end subroutine read_centre

  !> The name of a repeated body needs a place for the number of the copy.
  subroutine check_name(group, input, key, name, levels)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    character(*), intent(in) :: key  !! The key: name or volume.
    character(*), intent(in) :: name  !! Its text.
    integer, intent(in) :: levels  !! Number of levels of the array.
    character(:), allocatable :: several
    integer :: i, stars
    if (.not. group%is_usable(key)) return
    stars = 0
    do i = 1, len(name)
      if (name(i:i) == '*') stars = stars + 1
    end do
    if (stars == 1 .or. stars == levels) return
    several = ''
    if (levels > 1) several = ', or '//to_text(levels)//','
    call input%report(group, key, key//': '//shown(name)//' needs one *'//several//' for the numbers of the copies')
  end subroutine check_name

  !> Name or volume of a copy: its numbers in place of the stars, all of them in place of a single one.
  function name_of_copy(name, number) result(text)
    character(*), intent(in) :: name  !! Name of the body, with stars.
    integer, intent(in) :: number(:)  !! Numbers of the copy (n_levels).
    character(:), allocatable :: text
    integer :: i, k
    text = ''
    k = 0
    do i = 1, len(name)
      if (name(i:i) /= '*') then
        text = text//name(i:i)
        cycle
      end if
      k = k + 1
      if (k <= size(number)) text = text//to_text(number(k))
    end do
    if (k == size(number) .or. k == 0) return
    i = index(name, '*')
    text = ''
    do k = 1, size(number)
      if (k > 1) text = text//' '
      text = text//to_text(number(k))
    end do
    text = name(:i - 1)//text//name(i + 1:)
  end function name_of_copy

  !> Names of all bodies, copies included; two bodies of one name are reported.
  subroutine name_copies(input, body)
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(body_input_t), intent(in) :: body(:)  !! All bodies (n_bodies).
    integer :: i, j
    deallocate (input%bodies%name, input%bodies%line)
    allocate (input%bodies%name(size(body)), input%bodies%line(size(body)))
    do i = 1, size(body)
      input%bodies%name(i)%s = body(i)%name
      input%bodies%line(i) = body(i)%line
    end do
    do i = 2, size(body)
      do j = 1, i - 1
        if (body(j)%line == body(i)%line .or. len(body(j)%name) /= len(body(i)%name)) cycle
        if (body(j)%name /= body(i)%name) cycle
        call input%add(body(i)%line, '&body: a second body '//shown(body(i)%name)//' (the first is in line '// &
                       to_text(body(j)%line)//')')
        return
      end do
    end do
  end subroutine name_copies

  !> Append bodies to a list.
  subroutine append_bodies(list, n, more)
    type(body_input_t), allocatable, intent(inout) :: list(:)  !! The list; the first n are in use (n_allocated).
    integer, intent(inout) :: n  !! Number of bodies in the list.
    type(body_input_t), intent(in) :: more(:)  !! Bodies to append (n_more).
    type(body_input_t), allocatable :: longer(:)
    if (n + size(more) > size(list)) then
      allocate (longer(2*(n + size(more))))
      longer(:n) = list(:n)
      call move_alloc(longer, list)
    end if
    list(n + 1:n + size(more)) = more
    n = n + size(more)
  end subroutine append_bodies
end module dotyk_input_bodies
