!> What a namelist file says that is allowed, but hardly meant, or has a meaning that is easily overlooked: lines for
!> the log.
module dotyk_input_remarks
  use dotyk_base_text, only: counted, shown, text_t, to_text
  use dotyk_input_case, only: case_t, load_input_t, share_a_case
  implicit none
  private
  public :: add_remarks, add_spared

  !> Greatest number of groups of loads that are compared with each other: far above any that are written by hand.
  integer, parameter :: most_compared = 2000
  integer, parameter :: most_lines = 10, most_names = 5  !! Most lines of one sort, and names in a line.

contains

  !> Add the lines that need the whole file.
  subroutine add_remarks(case)
    type(case_t), intent(inout) :: case  !! The case, complete; lines are added.
    if (.not. allocated(case%remark)) allocate (case%remark(0))
    call compare_loads(case)
    call look_at_bolts(case)
    call look_at_cases(case)
  end subroutine add_remarks

  !> Add a line.
  subroutine add(case, text)
    type(case_t), intent(inout) :: case  !! The case.
    character(*), intent(in) :: text  !! The line.
    type(text_t), allocatable :: more(:)
    integer :: i, n
    n = 0
    if (allocated(case%remark)) n = size(case%remark)
    allocate (more(n + 1))
    do i = 1, n
      call move_alloc(case%remark(i)%s, more(i)%s)
    end do
    more(n + 1)%s = text
    call move_alloc(more, case%remark)
  end subroutine add

  !> Warn of loads that act twice.
  subroutine compare_loads(case)
    type(case_t), intent(inout) :: case  !! The case.
    integer, allocatable :: first(:)
    integer :: i, j, n
    associate (load => case%load)
      first = pack([(i, i=1, size(load))], [(is_first(i), i=1, size(load))])
      if (size(first) > most_compared) return
    end associate
    n = 0
    do j = 2, size(first)
      do i = 1, j - 1
        associate (one => case%load(first(i)), other => case%load(first(j)))
          if (.not. (is_same(one, other) .and. n < most_lines)) cycle
          if (.not. share_a_case(one%in_case, other%in_case)) cycle
          if (.not. share_a_body(case%load(first(i):last_of(first(i)))%body, &
                                 case%load(first(j):last_of(first(j)))%body)) cycle
          n = n + 1
          call add(case, 'warning: the &load of line '//to_text(other%line)//' is that of line '// &
                   to_text(one%line)//' once more: it acts twice')
        end associate
        exit
      end do
    end do

  contains

    !> Whether a load is the first one of a &load.
    pure logical function is_first(i)
      integer, intent(in) :: i  !! The load.
      is_first = .not. case%load(i)%of_mass
      if (i > 1 .and. is_first) is_first = case%load(i)%line /= case%load(i - 1)%line
    end function is_first

    !> The last load of a &load: one for each of its bodies.
    pure integer function last_of(i) result(last)
      integer, intent(in) :: i  !! Its first load.
      last = i
      do while (last < size(case%load))
        if (case%load(last + 1)%line /= case%load(i)%line .or. case%load(last + 1)%of_mass) exit
        last = last + 1
      end do
    end function last_of

    !> Whether two lists of bodies have one in common.
    pure logical function share_a_body(one, other) result(share)
      integer, intent(in) :: one(:), other(:)  !! Bodies, ascending (n).
      integer :: a, b
      a = 1
      b = 1
      share = .false.
      do while (a <= size(one) .and. b <= size(other) .and. .not. share)
        share = one(a) == other(b)
        if (one(a) < other(b)) then
          a = a + 1
        else
          b = b + 1
        end if
      end do
    end function share_a_body
  end subroutine compare_loads

  !> Whether two loads are the same, but for body and load cases.
  pure logical function is_same(one, other) result(same)
    type(load_input_t), intent(in) :: one, other  !! The loads.
    integer :: i
    same = one%kind == other%kind .and. one%place%text(3) == other%place%text(3) .and. &
           size(one%formula) == size(other%formula)
    if (.not. same) return
    same = .not. any(abs([one%value - other%value, one%moment - other%moment, one%centre - other%centre, &
                          one%point - other%point]) > 0) .and. (one%has_point .eqv. other%has_point)
    if (same) same = all([(one%formula(i)%s == other%formula(i)%s, i=1, size(one%formula))])
  end function is_same

  !> Warn of bolts that push.
  subroutine look_at_bolts(case)
    type(case_t), intent(inout) :: case  !! The case.
    integer :: k
    do k = 1, size(case%tie)
      if (.not. case%tie(k)%shortening < 0) cycle
      if (any(case%tie(:k - 1)%line == case%tie(k)%line)) cycle
      call add(case, 'warning: the shortening of &bolt '//shown(case%tie(k)%name)//' (line '// &
               to_text(case%tie(k)%line)//') is negative: it pushes the halves apart; tension needs a positive one')
    end do
  end subroutine look_at_bolts

  !> Tell load cases that no group names, where others are named.
  subroutine look_at_cases(case)
    type(case_t), intent(inout) :: case  !! The case.
    logical, allocatable :: has_own(:)
    integer :: i, k
    if (.not. case%has_cases()) return
    allocate (has_own(case%n_cases()), source=.false.)
    do i = 1, size(case%load)
      call note(case%load(i)%in_case)
    end do
    do i = 1, size(case%support)
      call note(case%support(i)%in_case)
    end do
    do i = 1, size(case%temperature)
      call note(case%temperature(i)%in_case)
    end do
    do i = 1, size(case%initial_stress)
      call note(case%initial_stress(i)%in_case)
    end do
    do i = 1, size(case%rigid)
      call note(case%rigid(i)%in_case)
    end do
    do i = 1, size(case%tie)
      call note(case%tie(i)%in_case)
    end do
    do i = 1, size(case%contact_case)
      call note(case%contact_case(i)%in_case)
    end do
    if (.not. any(has_own)) return
    do k = 1, size(has_own)
      if (.not. has_own(k)) &
        call add(case, 'case '//shown(case%load_case(k)%name)//' (line '//to_text(case%load_case(k)%line)// &
                 ') has nothing of its own: no group names it, and what names no case acts in it')
    end do

  contains

    !> Note the cases of a group.
    subroutine note(in_case)
      logical, allocatable, intent(in) :: in_case(:)  !! Whether it belongs to each; not allocated: to all (n_cases).
      if (allocated(in_case)) has_own = has_own .or. in_case
    end subroutine note
  end subroutine look_at_cases

  !> Tell the rigid bodies that a group of several bodies leaves out.
  subroutine add_spared(case, group, line, body, is_spared)
    type(case_t), intent(inout) :: case  !! The case; lines are added.
    character(*), intent(in) :: group  !! Name of the groups.
    integer, intent(in) :: line(:), body(:)  !! Their lines and bodies; those of one group follow each other (n).
    logical, intent(in) :: is_spared(:)  !! Whether the body is left out (n).
    integer, allocatable :: of(:)
    character(:), allocatable :: names
    integer :: i, k
    do i = 1, size(line)
      if (.not. is_spared(i) .or. any(line(:i - 1) == line(i) .and. is_spared(:i - 1))) cycle
      of = pack(body, line == line(i) .and. is_spared)
      names = shown(case%body(of(1))%name)
      do k = 2, min(size(of), most_names)
        names = names//', '//shown(case%body(of(k))%name)
      end do
      if (size(of) > most_names) names = names//', ...'
      call add(case, group//' of line '//to_text(line(i))//' leaves out '// &
               counted(size(of), 'rigid body', 'rigid bodies')//': '//names)
    end do
  end subroutine add_spared
end module dotyk_input_remarks
