!> Rigid body motions that contact does not determine in the log: one line; bodies that move alike share a part of it.
module dotyk_log_indeterminate
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_base_thresholds, only: notable
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_log_case_tables, only: vector_text
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: note_undetermined, note_rest

  integer, parameter :: most_named = 20  !! Greatest number of names, or of parts of the line; more are summed up.
  !> Names that differ in numbers or in their last word alone become one with a wildcard where they are so many.
  integer, parameter :: many_alike = 3

contains

  !> Say which motions contact does not determine, and which part of the forces rests on the springs that hold them.
  subroutine note_undetermined(problem, amplitude, rest, log)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their modes.
    type(mode_columns_t), intent(in) :: amplitude  !! Motions as columns: amplitudes of modes, by bodies [length].
    !> Largest part of the forces on a body that the springs carry []; 0 where it is rounding, or told elsewhere.
    real(dp), intent(in) :: rest
    type(log_t), intent(inout) :: log  !! The log.
    type(text_t) :: motion(size(problem%body)), short(size(problem%body)), kinds(size(problem%body))
    type(text_t) :: all_names(size(problem%body))
    type(mode_block_t), allocatable :: of_body(:)
    type(mode_columns_t) :: columns
    character(:), allocatable :: line, text
    logical :: is_open(size(problem%body)), alike(size(problem%body))
    integer :: b, n_parts, class(size(problem%body)), kind(size(problem%body))
    if (amplitude%n == 0) return
    call columns_of_parts(problem, amplitude, columns)
    call columns%by_bodies(first_mode(problem%modes, problem%tie), of_body)
    do b = 1, size(problem%body)
      motion(b)%s = ''
      associate (modes => problem%modes(b))
        if (modes%n > 0 .and. .not. modes%is_near_null()) motion(b)%s = modes%span_text(of_body(b)%value(:modes%n, :))
      end associate
      short(b)%s = without_places(motion(b)%s)
      kinds(b)%s = kinds_of_motion(motion(b)%s)
      all_names(b)%s = problem%body(b)%name
    end do
    is_open = [(len(motion(b)%s) > 0, b=1, size(motion))]
    call find_classes(short, class)
    call find_classes(kinds, kind)
    line = ''
    n_parts = 0
    do b = 1, size(motion)
      if (.not. is_open(b)) cycle
      n_parts = n_parts + 1
      if (n_parts > most_named) exit
      alike = is_open .and. class == class(b)
      text = short(b)%s
      if (count(alike) == 1) then
        alike = is_open .and. kind == kind(b) .and. is_single()
        text = kinds(b)%s
        if (count(alike) == 1) text = motion(b)%s
        ! Screws and motions of several bodies take a line each.
        if (.not. log%verbose .and. index(text, 'per radian') > 0) text = kinds(b)%s
      end if
      is_open = is_open .and. .not. alike
      if (len(line) > 0) line = line//', '
      line = line//text//' of '//names_in_short(pack(all_names, alike), all_names)
    end do
    if (len(line) == 0) return
    if (any(is_open)) line = line//', motions of '//to_text(count(is_open))//' more'
    line = line//'; least motion taken'
    if (rest > 0) line = line//'; '//to_text(100*rest, 2)//' % of the loads rest on it'
    call log%line('  not determined by contact: '//line)
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
  end subroutine note_undetermined

  !> The motions without bodies that hardly take part in them: what moves a bolt in its hole moves the plate by 1e-4 of
  !> that.
  subroutine columns_of_parts(problem, amplitude, columns)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their modes.
    type(mode_columns_t), intent(in) :: amplitude  !! The motions, as in `note_undetermined`.
    type(mode_columns_t), intent(out) :: columns  !! The same.
    real(dp) :: part(size(problem%body)), least
    real(dp), allocatable :: x(:)
    integer :: b, k, first(size(problem%body) + 1)
    first = first_mode(problem%modes, problem%tie)
    allocate (x(first(size(first)) - 1))
    do k = 1, amplitude%n
      call amplitude%get(k, x)
      do b = 1, size(part)
        part(b) = norm2(x(first(b):first(b + 1) - 1))/sqrt(real(problem%body(b)%mesh%n_whole_nodes(), dp))
      end do
      least = notable*maxval(part)
      do b = 1, size(part)
        if (part(b) < least) x(first(b):first(b + 1) - 1) = 0
      end do
      call columns%add(x)
    end do
  end subroutine columns_of_parts

  !> Say which forces along motions that contact does not determine are too large to rest on weak springs, and where
  !> facets of round surfaces make moments that these do not have.
  subroutine note_rest(problem, state, max_unbalanced, log)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their modes.
    type(solver_state_t), intent(in) :: state  !! How the scheme ended.
    real(dp), intent(in) :: max_unbalanced  !! Greatest part of the forces on a body that may rest on them [].
    type(log_t), intent(inout) :: log  !! The log.
    character(:), allocatable :: text
    real(dp) :: force(3)
    integer :: b, i, first(size(problem%body) + 1)
    if (.not. allocated(state%rest)) return
    if (.not. any(state%rest > max_unbalanced)) return
    b = maxloc(state%rest, 1)
    if (any(state%excess > max_unbalanced)) b = maxloc(state%excess, 1)
    text = to_text(100*state%rest(b), 2)//' % of the forces on '//quoted(problem%body(b)%name)
    if (.not. state%excess(b) > max_unbalanced) then
      if (count(state%rest > max_unbalanced) > 1) &
        text = text//' (of '//to_text(count(state%rest > max_unbalanced))//' bodies the largest)'
      call log%line('  warning          the mesh turns '//text//' into a moment: facets press beside the '// &
                    'centre of a round surface; moments are off by as much, and the directions of forces; refine there')
      return
    end if
    if (count(state%excess > max_unbalanced) > 1) &
      text = text//' (of '//to_text(count(state%excess > max_unbalanced))//' bodies the largest)'
    first = first_mode(problem%modes, problem%tie)
    associate (modes => problem%modes(b), along => state%imbalance(first(b):first(b) + problem%modes(b)%n - 1))
      force = 0
      do i = 1, size(modes%shape, 1)
        force(i) = sum(matmul(modes%shape(i, :, :), along))
      end do
      text = text//': '//vector_text(force)//' along '//modes%combination_text(along)
    end associate
    call log%line('  out of balance   '//text//', which contact does not resist; hold the body along this motion '// &
                  'by a &support or a &spring (max_unbalanced of &solver: '//to_text(max_unbalanced)//')')
  end subroutine note_rest

  !> Bodies with the same text: classes by their first members.
  pure subroutine find_classes(texts, class)
    type(text_t), intent(in) :: texts(:)  !! Texts (n).
    integer, intent(out) :: class(:)  !! First body of the class of each (n).
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

  !> Names in quotes; those that differ in numbers or in the last word alone as 'bolt *' with their number, that of all
  !> such bodies with it where these are more; both halves of a body that is cut by its name.
  function names_in_short(names, all_names) result(text)
    type(text_t), intent(in) :: names(:)  !! The names (n).
    type(text_t), intent(in) :: all_names(:)  !! Those of all bodies (n_bodies).
    character(:), allocatable :: text
    type(text_t), allocatable :: name(:), whole(:)
    logical, allocatable :: is_open(:), alike(:)
    integer :: i, j, n
    call join_halves(names, name)
    call join_halves(all_names, whole)
    allocate (is_open(size(name)), source=.true.)
    text = ''
    n = 0
    do i = 1, size(name)
      if (.not. is_open(i)) cycle
      n = n + 1
      if (n > most_named) then
        text = text//' and '//to_text(count(is_open))//' more'
        return
      end if
      if (n > 1) text = text//', '
      alike = [(is_open(j) .and. pattern_of(name(j)%s) == pattern_of(name(i)%s), j=1, size(name))]
      if (count(alike) < many_alike) then
        text = text//quoted(name(i)%s)
        is_open(i) = .false.
      else
        text = text//quoted(pattern_of(name(i)%s))//' ('//to_text(count(alike))
        j = count([(pattern_of(whole(j)%s) == pattern_of(name(i)%s), j=1, size(whole))])
        if (j > count(alike)) text = text//' of '//to_text(j)
        text = text//' bodies)'
        is_open = is_open .and. .not. alike
      end if
    end do
  end function names_in_short

  !> A name with wildcards for its numbers; for its last word where it has none, 'nut *' of 'nut left'.
  pure function pattern_of(name) result(pattern)
    character(*), intent(in) :: name
    character(:), allocatable :: pattern
    integer :: i, k
    pattern = ''
    k = 0
    do i = 1, len(name)
      if (verify(name(i:i), '0123456789') > 0) then
        pattern = pattern//name(i:i)
      else if (k < i - 1 .or. k == 0) then
        pattern = pattern//'*'
      end if
      if (verify(name(i:i), '0123456789') == 0) k = i
    end do
    if (k > 0) return
    k = scan(name, ' _-', back=.true.)
    if (k > 1 .and. k < len(name)) pattern = name(:k)//'*'
  end function pattern_of

  !> Replace 'bolt (1)' with 'bolt (2)' after it by 'bolt'.
  pure subroutine join_halves(names, name)
    type(text_t), intent(in) :: names(:)  !! The names (n).
    type(text_t), allocatable, intent(out) :: name(:)  !! At most as many (n).
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

  !> A description of motions without the places of axes: "spin about the axis (0, 0, 1) through (1, 2, 3)" becomes
  !> "spin about the axis (0, 0, 1)", "spin about (1, 2)" of two dimensions "spin".
  pure function without_places(motion) result(text)
    character(*), intent(in) :: motion  !! Description.
    character(:), allocatable :: text
    text = cut_all(cut_all(motion, ' through ('), ' about (')
  contains
    !> Cut texts in parentheses out.
    pure function cut_all(whole, opening) result(rest)
      character(*), intent(in) :: whole  !! The text.
      character(*), intent(in) :: opening  !! How the parts to cut begin.
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

  !> What kinds of motions a description names: "sliding and spin".
  pure function kinds_of_motion(motion) result(text)
    character(*), intent(in) :: motion  !! Description.
    character(:), allocatable :: text
    text = ''
    if (index(motion, 'sliding along') > 0) call add('sliding')
    if (index(motion, 'per radian of rotation') > 0) call add('screw motion')
    if (index(motion, 'spin about') > 0) call add('spin')
    if (index(motion, 'rocking about') > 0) call add('rocking')
    if (len(text) == 0) text = motion
  contains
    !> Add a kind.
    pure subroutine add(kind)
      character(*), intent(in) :: kind
      if (len(text) > 0) text = text//' and '
      text = text//kind
    end subroutine add
  end function kinds_of_motion
end module dotyk_log_indeterminate
