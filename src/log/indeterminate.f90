!> Rigid body motions that contact does not determine in the log: bodies that move alike share a line.
module dotyk_log_indeterminate
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_log_load_tables, only: vector_text
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  use dotyk_scheme_proximal_motion, only: largest_rest
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: note_undetermined, note_rest, names_in_short, without_places, kinds_of_motion

  !> Greatest number of names or lines; more are summed up.
  integer, parameter :: most_named = 20

contains

  !> Say which motions contact does not determine.
  subroutine note_undetermined(problem, amplitude, log)
    !> Bodies and their modes.
    type(contact_problem_t), intent(in) :: problem
    !> The motions as columns: amplitudes of the modes of all bodies, body after body [length].
    type(mode_columns_t), intent(in) :: amplitude
    !> The log.
    type(log_t), intent(inout) :: log
    type(text_t) :: motion(size(problem%body)), short(size(problem%body)), kinds(size(problem%body))
    type(mode_block_t), allocatable :: of_body(:)
    character(:), allocatable :: text
    logical :: is_open(size(problem%body)), alike(size(problem%body))
    integer :: b, n_lines, class(size(problem%body)), kind(size(problem%body))
    if (amplitude%n == 0) return
    call amplitude%by_bodies(first_mode(problem%modes, problem%tie), of_body)
    do b = 1, size(problem%body)
      motion(b)%s = ''
      associate (modes => problem%modes(b))
        if (modes%n > 0 .and. .not. modes%is_near_null()) &
          motion(b)%s = modes%span_text(of_body(b)%value(:modes%n, :))
      end associate
      short(b)%s = without_places(motion(b)%s)
      kinds(b)%s = kinds_of_motion(motion(b)%s)
    end do
    is_open = [(len(motion(b)%s) > 0, b=1, size(motion))]
    call find_classes(short, class)
    call find_classes(kinds, kind)
    n_lines = 0
    do b = 1, size(motion)
      if (.not. is_open(b)) cycle
      n_lines = n_lines + 1
      if (n_lines > most_named) exit
      alike = is_open .and. class == class(b)
      text = short(b)%s
      if (count(alike) == 1) then
        alike = is_open .and. kind == kind(b) .and. is_single()
        text = kinds(b)%s//' each'
        if (count(alike) == 1) text = motion(b)%s
      end if
      is_open = is_open .and. .not. alike
      call log%line('  undetermined     '//names_in_short(pack_names(alike))//': '//text// &
                    ' (not determined by contact; least motion taken)')
    end do
    if (any(is_open)) call log%line('  undetermined     motions of '//to_text(count(is_open))//' more')
  contains
    !> Bodies whose motion no other one shares.
    function is_single()
      logical :: is_single(size(motion))
      integer :: i, n_members(size(motion))
      n_members = 0
      do i = 1, size(motion)
        if (is_open(i)) n_members(class(i)) = n_members(class(i)) + 1
      end do
      is_single = is_open .and. n_members(class) == 1
    end function is_single

    !> Names of some bodies.
    function pack_names(chosen) result(name)
      !> Which bodies (n_bodies).
      logical, intent(in) :: chosen(:)
      type(text_t) :: name(count(chosen))
      integer :: i, n
      n = 0
      do i = 1, size(chosen)
        if (.not. chosen(i)) cycle
        n = n + 1
        name(n)%s = problem%body(i)%name
      end do
    end function pack_names
  end subroutine note_undetermined

  !> Say which forces rest on the weak springs of the scheme.
  subroutine note_rest(problem, state, log)
    !> Bodies and their modes.
    type(contact_problem_t), intent(in) :: problem
    !> How the scheme ended.
    type(solver_state_t), intent(in) :: state
    !> The log.
    type(log_t), intent(inout) :: log
    character(:), allocatable :: text
    real(dp) :: force(3)
    integer :: b, i, first(size(problem%body) + 1)
    if (.not. allocated(state%rest)) return
    if (.not. any(state%rest > 0)) return
    b = maxloc(state%rest, 1)
    if (any(state%excess > largest_rest)) b = maxloc(state%excess, 1)
    text = to_text(100*state%rest(b), 2)//' % of the forces on '//quoted(problem%body(b)%name)//' rest on weak springs'
    if (count(state%rest > 0) > 1) text = text//' (of '//to_text(count(state%rest > 0))//' bodies the largest)'
    if (state%excess(b) > largest_rest) then
      first = first_mode(problem%modes, problem%tie)
      associate (modes => problem%modes(b), along => state%imbalance(first(b):first(b) + problem%modes(b)%n - 1))
        force = 0
        do i = 1, size(modes%shape, 1)
          force(i) = sum(matmul(modes%shape(i, :, :), along))
        end do
        text = text//': '//vector_text(force)//' along '//modes%combination_text(along)// &
               ', which contact does not resist; constrain it with a &support or a &spring'
      end associate
    end if
    if (state%rest(b) > largest_rest .and. .not. state%excess(b) > largest_rest) &
      text = text//': facets resist these motions by no more than their normals are uncertain'
    call log%line('  '//merge('out of balance   ', 'on springs       ', state%excess(b) > largest_rest)//text)
  end subroutine note_rest

  !> Bodies with the same text: classes by their first members.
  pure subroutine find_classes(texts, class)
    !> Texts (n).
    type(text_t), intent(in) :: texts(:)
    !> First body of the class of each (n).
    integer, intent(out) :: class(:)
    integer :: member(size(texts)), i, k, n
    n = 0
    do i = 1, size(texts)
      class(i) = i
      do k = 1, n
        if (len(texts(member(k))%s) /= len(texts(i)%s)) cycle
        if (texts(member(k))%s /= texts(i)%s) cycle
        class(i) = member(k)
        exit
      end do
      if (class(i) < i) cycle
      n = n + 1
      member(n) = i
    end do
  end subroutine find_classes

  !> Names in quotes; those that differ by consecutive numbers at their ends as in 'bolt 1' to 'bolt 8'; both halves of
  !> a body that is cut by its name.
  function names_in_short(names) result(text)
    !> The names (n).
    type(text_t), intent(in) :: names(:)
    character(:), allocatable :: text
    type(text_t), allocatable :: name(:)
    integer :: i, j, n
    call join_halves(names, name)
    text = ''
    i = 1
    n = 0
    do while (i <= size(name))
      j = i
      do while (j < size(name))
        if (.not. follows(name(j)%s, name(j + 1)%s)) exit
        j = j + 1
      end do
      if (j < i + 2) j = i
      n = n + 1
      if (n > most_named) then
        text = text//' and '//to_text(size(name) - i + 1)//' more'
        return
      end if
      if (i > 1) text = text//', '
      text = text//quoted(name(i)%s)
      if (j > i) text = text//' to '//quoted(name(j)%s)
      i = j + 1
    end do
  end function names_in_short

  !> Replace 'bolt (1)' with 'bolt (2)' after it by 'bolt'.
  pure subroutine join_halves(names, name)
    !> The names (n).
    type(text_t), intent(in) :: names(:)
    !> At most as many (n).
    type(text_t), allocatable, intent(out) :: name(:)
    character(*), parameter :: half_1 = ' (1)', half_2 = ' (2)'
    integer :: i, n, length
    allocate (name(size(names)))
    i = 1
    n = 0
    do while (i <= size(names))
      n = n + 1
      name(n)%s = names(i)%s
      length = index(names(i)%s, half_1, back=.true.) - 1
      if (i < size(names) .and. length > 0 .and. length == len(names(i)%s) - len(half_1)) then
        if (names(i + 1)%s == names(i)%s(:length)//half_2) then
          name(n)%s = names(i)%s(:length)
          i = i + 1
        end if
      end if
      i = i + 1
    end do
    name = name(:n)
  end subroutine join_halves

  !> Whether two names differ by consecutive numbers at their ends.
  pure logical function follows(first, second)
    !> The names.
    character(*), intent(in) :: first, second
    integer :: i, k, l, number, next
    !> Digits that an integer has in any case.
    integer, parameter :: most_digits = 9
    follows = .false.
    k = verify(first, '0123456789', back=.true.)
    l = verify(second, '0123456789', back=.true.)
    if (k == len(first) .or. l == len(second) .or. k /= l) return
    if (first(:k) /= second(:l) .or. max(len(first), len(second)) - k > most_digits) return
    number = 0
    do i = k + 1, len(first)
      number = 10*number + iachar(first(i:i)) - iachar('0')
    end do
    next = 0
    do i = l + 1, len(second)
      next = 10*next + iachar(second(i:i)) - iachar('0')
    end do
    follows = next == number + 1
  end function follows

  !> A description of motions without the places of axes: "rotation about the axis (0, 0, 1) through (1, 2, 3)" becomes
  !> "rotation about the axis (0, 0, 1)", "rotation about (1, 2)" of two dimensions "rotation".
  pure function without_places(motion) result(text)
    !> Description.
    character(*), intent(in) :: motion
    character(:), allocatable :: text
    text = cut_all(cut_all(motion, ' through ('), ' about (')
  contains
    !> Cut texts in parentheses out.
    pure function cut_all(whole, opening) result(rest)
      !> The text.
      character(*), intent(in) :: whole
      !> How the parts to cut begin.
      character(*), intent(in) :: opening
      character(:), allocatable :: rest
      integer :: i
      rest = whole
      do
        i = index(rest, opening)
        if (i == 0) return
        rest = rest(:i - 1)//rest(i + index(rest(i:), ')'):)
      end do
    end function cut_all
  end function without_places

  !> What kinds of motions a description names: "2 translations and a rotation".
  pure function kinds_of_motion(motion) result(text)
    !> Description.
    character(*), intent(in) :: motion
    character(:), allocatable :: text
    integer :: n
    n = occurrences('per radian of rotation about')
    text = ''
    if (occurrences('translation along') > 0) text = several('translation', occurrences('translation along'))
    if (occurrences('rotation about') > 0) text = joined(several('rotation', occurrences('rotation about')))
    if (n > 0) text = joined(several('screw motion', n))
  contains
    !> With the parts before.
    pure function joined(part) result(whole)
      !> The new part.
      character(*), intent(in) :: part
      character(:), allocatable :: whole
      whole = part
      if (len(text) > 0) whole = text//' and '//part
    end function joined

    !> How often a text occurs.
    pure integer function occurrences(part)
      !> The text.
      character(*), intent(in) :: part
      integer :: i
      occurrences = count([(motion(i:i + len(part) - 1) == part, i=1, len(motion) - len(part) + 1)])
    end function occurrences

    !> "a rotation", "2 rotations".
    pure function several(noun, number) result(phrase)
      !> The noun.
      character(*), intent(in) :: noun
      !> How many.
      integer, intent(in) :: number
      character(:), allocatable :: phrase
      phrase = 'a '//noun
      if (number > 1) phrase = to_text(number)//' '//noun//'s'
    end function several
  end function kinds_of_motion
end module dotyk_log_indeterminate
