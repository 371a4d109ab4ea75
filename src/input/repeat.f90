!> Arrays of placed bodies: one `&body` with `repeat` stands for many.
!>
!> Copy (i, j, k), counted from 0, is the first copy rotated about `axis` through `centre` by i angle(1) + j angle(2) +
!> k angle(3), and then shifted by i shift(1) + j shift(2) + k shift(3).
module dotyk_input_repeat
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_rotation, only: rotation_matrix
  use dotyk_base_text, only: counted, shown, to_text
  use dotyk_input_bodies, only: union_name
  use dotyk_input_case, only: body_input_t, scene_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_values, only: count_of, integers_of, is_given, is_usable, names_t, real_of, reals_of, report
  implicit none
  private
  public :: repeat_body, append_bodies, name_copies

  !> Greatest number of levels of an array, and of its copies.
  integer, parameter :: max_levels = 3, most_copies = 200000

contains

  !> The copies of a body; the body itself where it is not repeated.
  subroutine repeat_body(group, scene, problems, body, copies)
    type(group_t), intent(in) :: group  !! Checked group.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its dimension and analysis.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> The body as placed by `at`, `axis` and, where it is not repeated, `angle`.
    type(body_input_t), intent(in) :: body
    type(body_input_t), allocatable, intent(out) :: copies(:)  !! The copies, the first index fastest (n_copies).
    integer, allocatable :: n(:)
    real(dp) :: angle(max_levels), shift(3, max_levels), centre(3), turned, moved(3)
    real(dp), allocatable :: numbers(:)
    integer :: i, k, rest, number(max_levels), before
    before = problems%count
    call refuse_without_repeat(group, problems)
    call integers_of(group, 'repeat', n)
    if (size(n) == 0 .or. problems%count > before) then
      copies = [body]
      return
    end if
    if (product(real(n, dp)) > most_copies) &
      call report(problems, group, 'repeat', 'repeat makes more than '//to_text(most_copies)//' bodies')
    call reals_of(group, 'angle', numbers)
    if (size(numbers) > 0 .and. size(numbers) /= size(n)) &
      call report(problems, group, 'angle', 'angle has '//counted(size(numbers), 'value')//', and repeat has '// &
                  to_text(size(n))//': one angle for each number of copies, 0 for none')
    angle = 0
    rest = min(size(numbers), size(n))
    angle(:rest) = numbers(:rest)
    call read_shifts(group, scene, size(n), problems, shift)
    call read_centre(group, scene, problems, centre)
    call check_name(group, 'name', body%name, size(n), problems)
    do k = 1, size(body%volumes)
      if (index(body%volumes(k)%s, '*') > 0) call check_name(group, 'volume', body%volumes(k)%s, size(n), problems)
    end do
    do k = 1, size(n)
      if (problems%count > before) exit
      ! Copies of different volumes may lie where they are drawn.
      if (n(k) == 1 .or. index(body%volume, '*') > 0) cycle
      if (.not. (abs(modulo(angle(k), 360.0_dp)) > 0 .or. maxval(abs(shift(:, k))) > 0)) &
        call report(problems, group, 'repeat', 'the '//to_text(n(k))//' copies lie in one place: give '// &
                    'an angle or a shift'//volumes_hint(body))
    end do
    if (problems%count > before) then
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
      copies(i)%angle = real_of(group, 'first_angle') + turned
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
  subroutine refuse_without_repeat(group, problems)
    type(group_t), intent(in) :: group  !! Checked group.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    character(11), parameter :: keys(3) = [character(11) :: 'shift', 'centre', 'first_angle']
    integer :: k
    if (is_given(group, 'repeat')) return
    do k = 1, size(keys)
      if (is_given(group, trim(keys(k)))) &
        call report(problems, group, trim(keys(k)), trim(keys(k))//' is for repeated bodies: add repeat, or place '// &
                    'the body by at, axis and angle')
    end do
    if (count_of(group, 'angle') > 1) &
      call report(problems, group, 'angle', 'angle has '//to_text(count_of(group, 'angle'))// &
                  ' values: more than one is for repeated bodies')
  end subroutine refuse_without_repeat

  !> Read the shifts, a vector of two or three components for each number of copies.
  subroutine read_shifts(group, scene, levels, problems, shift)
    type(group_t), intent(in) :: group  !! Checked group.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its dimension and analysis.
    integer, intent(in) :: levels  !! Number of levels of the array.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    real(dp), intent(out) :: shift(3, max_levels)  !! Shifts; 0 where they are not given (3, max_levels) [length].
    real(dp), allocatable :: numbers(:)
    integer :: components
    shift = 0
    call reals_of(group, 'shift', numbers)
    if (size(numbers) == 0) return
    components = 3
    if (scene%dimension == 2 .and. size(numbers) == 2*levels) components = 2
    if (size(numbers) /= components*levels) then
      call report(problems, group, 'shift', 'shift has '//counted(size(numbers), 'value')//', and repeat has '// &
                  to_text(levels)//': '//to_text(scene%dimension)//' values for each number of copies, 0 for none')
      return
    end if
    shift(:components, :levels) = reshape(numbers, [components, levels])
    if (scene%dimension == 2 .and. maxval(abs(shift(3, :))) > 0) &
      call report(problems, group, 'shift', 'shift has a z component, but there is no z in two dimensions')
    if (scene%analysis == analysis_axisymmetric .and. maxval(abs(shift(1, :))) > 0) &
      call report(problems, group, 'shift', 'shift has an x component, but axisymmetric bodies are shifted '// &
                  'along y only')
  end subroutine read_shifts

  !> Read the point of the axis about which copies are rotated.
  subroutine read_centre(group, scene, problems, centre)
    type(group_t), intent(in) :: group  !! Checked group.
    type(scene_input_t), intent(in) :: scene  !! The scene, for its dimension.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    real(dp), intent(out) :: centre(3)  !! The point; 0 where it is not given (3) [length].
    real(dp), allocatable :: numbers(:)
    centre = 0
    call reals_of(group, 'centre', numbers)
    if (size(numbers) == 0) return
    centre(:size(numbers)) = numbers
    if (.not. is_given(group, 'angle')) call report(problems, group, 'centre', 'centre is given without an angle')
    if (scene%dimension == 3 .and. size(numbers) < 3) &
      call report(problems, group, 'centre', 'centre needs 3 values in three dimensions, got '//to_text(size(numbers)))
  end subroutine read_centre

  !> The name of a repeated body needs a place for the number of the copy.
  subroutine check_name(group, key, name, levels, problems)
    type(group_t), intent(in) :: group  !! Checked group.
    character(*), intent(in) :: key  !! The key: name or volume.
    character(*), intent(in) :: name  !! Its text.
    integer, intent(in) :: levels  !! Number of levels of the array.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    character(:), allocatable :: several
    integer :: i, stars
    if (.not. is_usable(group, key)) return
    stars = 0
    do i = 1, len(name)
      if (name(i:i) == '*') stars = stars + 1
    end do
    if (stars == 1 .or. stars == levels) return
    several = ''
    if (levels > 1) several = ', or '//to_text(levels)//','
    call report(problems, group, key, key//': '//shown(name)//' needs one *'//several// &
                ' for the numbers of the copies')
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
  subroutine name_copies(body, problems, names)
    type(body_input_t), intent(in) :: body(:)  !! All bodies (n_bodies).
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(names_t), intent(inout) :: names  !! Names of the groups; of all bodies on return.
    integer :: i, j
    deallocate (names%name, names%line)
    allocate (names%name(size(body)), names%line(size(body)))
    do i = 1, size(body)
      names%name(i)%s = body(i)%name
      names%line(i) = body(i)%line
    end do
    do i = 2, size(body)
      do j = 1, i - 1
        if (body(j)%line == body(i)%line .or. len(body(j)%name) /= len(body(i)%name)) cycle
        if (body(j)%name /= body(i)%name) cycle
        call problems%add(body(i)%line, '&body: a second body '//shown(body(i)%name)//' (the first is in line '// &
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
end module dotyk_input_repeat
