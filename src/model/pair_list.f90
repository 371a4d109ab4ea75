!> Contact pairs as they are formed from the groups of the input, with a quick way to those of two bodies; those that
!> are named twice (A-B and B-A, one pair twice, or by surfaces of which one is a part of the other); and those that
!> `exclude` leaves out.
module dotyk_model_pair_list
  use dotyk_base_error, only: exit_bad_input, problem_list_t
  use dotyk_base_text, only: matches, quoted, text_t, to_text
  use dotyk_contact_pair_report, only: merged_pair_t
  use dotyk_input_case, only: body_input_t, case_t, contact_input_t, exclusion_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  implicit none
  private
  public :: merge_double_pairs, are_tied, exclusion_of, exclusion_texts

  type, public :: pair_list_t  !! The pairs.
    integer :: n = 0  !! Number of pairs.
    !> Pairs as if the input named each of them; the first n are in use (n_allocated).
    type(contact_input_t), allocatable :: contact(:)
    type(surface_t), allocatable :: surface_a(:)  !! Their slave surfaces (n_allocated).
    type(surface_t), allocatable :: surface_b(:)  !! Their master surfaces (n_allocated).
    integer, allocatable :: group(:)  !! Groups of the input that they come from (n_allocated).
    !> Indices of the named slave surfaces of their bodies; 0 for parts of the boundary (n_allocated).
    integer, allocatable :: place_a(:)
    integer, allocatable :: place_b(:)  !! The same of the master surfaces (n_allocated).
    !> First pair of each body that has a higher number than its partner; 0 where there is none (n_bodies).
    integer, allocatable, private :: first(:)
    integer, allocatable, private :: next(:)  !! Next pair of this body; 0 at the end (n_allocated).
  contains
    procedure :: init => list_init
    procedure :: add => list_add
    procedure :: between => list_between
  end type pair_list_t

contains

  !> Empty list.
  subroutine list_init(self, n_bodies)
    class(pair_list_t), intent(out) :: self
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer, parameter :: room = 16
    allocate (self%contact(room), self%surface_a(room), self%surface_b(room), self%group(room), self%place_a(room), &
              self%place_b(room), self%next(room), self%first(n_bodies))
    self%first = 0
  end subroutine list_init

  !> Add a pair.
  subroutine list_add(self, contact, group, surface_a, place_a, surface_b, place_b)
    class(pair_list_t), intent(inout) :: self
    type(contact_input_t), intent(in) :: contact  !! The pair, its bodies set.
    integer, intent(in) :: group  !! Group of the input.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    integer, intent(in) :: place_a  !! Index among the named surfaces of its body, or 0.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    integer, intent(in) :: place_b  !! Index among the named surfaces of its body, or 0.
    integer :: b
    if (self%n == size(self%contact)) call enlarge(self)
    self%n = self%n + 1
    self%contact(self%n) = contact
    self%surface_a(self%n) = surface_a
    self%surface_b(self%n) = surface_b
    self%group(self%n) = group
    self%place_a(self%n) = place_a
    self%place_b(self%n) = place_b
    b = max(contact%body_a, contact%body_b)
    self%next(self%n) = self%first(b)
    self%first(b) = self%n
  end subroutine list_add

  !> Double the room.
  subroutine enlarge(self)
    type(pair_list_t), intent(inout) :: self  !! The list.
    type(contact_input_t), allocatable :: contact(:)
    type(surface_t), allocatable :: surface(:)
    integer :: n
    n = self%n
    allocate (contact(2*n))
    contact(:n) = self%contact
    call move_alloc(contact, self%contact)
    allocate (surface(2*n))
    surface(:n) = self%surface_a
    call move_alloc(surface, self%surface_a)
    allocate (surface(2*n))
    surface(:n) = self%surface_b
    call move_alloc(surface, self%surface_b)
    self%group = [self%group, self%group]
    self%place_a = [self%place_a, self%place_a]
    self%place_b = [self%place_b, self%place_b]
    self%next = [self%next, self%next]
  end subroutine enlarge

  !> The next pair of two bodies, the latest first; 0 at the end.
  pure integer function list_between(self, a, b, after) result(pair)
    class(pair_list_t), intent(in) :: self
    integer, intent(in) :: a  !! One body.
    integer, intent(in) :: b  !! The other body.
    integer, intent(in) :: after  !! The pair before; 0 to begin.
    if (after == 0) then
      pair = self%first(max(a, b))
    else
      pair = self%next(after)
    end if
    do while (pair > 0)
      if (min(self%contact(pair)%body_a, self%contact(pair)%body_b) == min(a, b)) return
      pair = self%next(pair)
    end do
  end function list_between

  !> Drop pairs that are contained in others with the same settings; refuse those with other settings.
  subroutine merge_double_pairs(file, surfaces, list, merged, problems)
    character(*), intent(in) :: file  !! The namelist file.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(pair_list_t), intent(inout) :: list  !! The pairs; those that are dropped have the group 0 on return.
    type(merged_pair_t), allocatable, intent(out) :: merged(:)  !! Pairs that were dropped (n_merged).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; mistakes are added.
    type(merged_pair_t) :: one
    logical :: overlap, first_in_second, second_in_first
    integer :: k, other, kept, dropped
    allocate (merged(0))
    do k = 1, list%n
      other = k
      do
        if (list%group(k) == 0) exit
        other = list%between(list%contact(k)%body_a, list%contact(k)%body_b, other)
        if (other == 0) exit
        if (list%group(other) == 0) cycle
        call compare(surfaces, list, other, k, overlap, first_in_second, second_in_first)
        if (.not. overlap .or. .not. (first_in_second .or. second_in_first)) cycle
        ! The pair that the user names himself remains, then the larger one, then the first.
        kept = other
        if (.not. second_in_first) kept = k
        if (list%contact(other)%found .neqv. list%contact(k)%found) kept = merge(k, other, list%contact(other)%found)
        dropped = other + k - kept
        if (.not. merge(second_in_first, first_in_second, kept == other)) then
          call problems%add(file//':'//to_text(list%contact(dropped)%line)//': &contact '// &
                            quoted(list%contact(dropped)%name)//' contains the faces of '// &
                            quoted(list%contact(kept)%name)//' (line '//to_text(list%contact(kept)%line)// &
                            "): name each face once, or leave these bodies out by exclude='body - body'", &
                            exit_bad_input)
          cycle
        end if
        if (.not. same_settings(list%contact(kept), list%contact(dropped))) then
          call problems%add(file//':'//to_text(list%contact(dropped)%line)//': &contact '// &
                            quoted(list%contact(dropped)%name)//' is the same contact as '// &
                            quoted(list%contact(kept)%name)//' (line '//to_text(list%contact(kept)%line)// &
                            '), with another gap or theta: remove one of them', exit_bad_input)
          cycle
        end if
        one%name = list%contact(dropped)%name
        one%line = list%contact(dropped)%line
        one%kept = list%contact(kept)%name
        one%kept_line = list%contact(kept)%line
        merged = [merged, one]
        list%group(dropped) = 0
      end do
    end do
  end subroutine merge_double_pairs

  !> Compare the faces of two pairs of the same bodies.
  subroutine compare(surfaces, list, first, second, overlap, first_in_second, second_in_first)
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Surfaces of the bodies (n_bodies).
    type(pair_list_t), intent(in) :: list  !! The pairs.
    integer, intent(in) :: first  !! A pair.
    integer, intent(in) :: second  !! Another pair of the same bodies, maybe the other way round.
    logical, intent(out) :: overlap  !! Whether they have common facets on both bodies.
    logical, intent(out) :: first_in_second  !! Whether the second pair has all facets of the first one.
    logical, intent(out) :: second_in_first  !! Whether the first pair has all facets of the second one.
    logical, allocatable :: one(:), other(:)
    integer :: side, place_one, place_other, b
    overlap = .true.
    first_in_second = .true.
    second_in_first = .true.
    do side = 1, 2
      b = merge(list%contact(first)%body_a, list%contact(first)%body_b, side == 1)
      place_one = merge(list%place_a(first), list%place_b(first), side == 1)
      place_other = merge(list%place_a(second), list%place_b(second), list%contact(second)%body_a == b)
      ! Parts of the boundary are in one pair only.
      if (place_one == 0 .or. place_other == 0) then
        overlap = .false.
        return
      end if
      associate (body => surfaces(b))
        call body%facets(place_one, one)
        call body%facets(place_other, other)
      end associate
      overlap = overlap .and. any(one .and. other)
      first_in_second = first_in_second .and. all(other .or. .not. one)
      second_in_first = second_in_first .and. all(one .or. .not. other)
      if (.not. overlap) return
    end do
  end subroutine compare

  !> Whether two pairs have the same gap and penalty parameter.
  pure logical function same_settings(a, b) result(same)
    type(contact_input_t), intent(in) :: a  !! A pair.
    type(contact_input_t), intent(in) :: b  !! Another pair.
    same = a%gap_kind == b%gap_kind .and. abs(a%gap - b%gap) <= 0 .and. a%gap_formula == b%gap_formula .and. &
           a%theta_kind == b%theta_kind .and. abs(a%theta - b%theta) <= 0 .and. a%theta_formula == b%theta_formula &
           .and. (a%is_layer .eqv. b%is_layer) .and. a%discretization == b%discretization
  end function same_settings

  !> Whether two bodies are tied to each other: no pair is searched between them.
  pure logical function are_tied(case, a, b)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: a  !! Index of a body.
    integer, intent(in) :: b  !! Index of the other body.
    are_tied = .false.
    if (.not. allocated(case%tie)) return
    associate (tie => case%tie)
      are_tied = any((tie%body_a == a .and. tie%body_b == b) .or. (tie%body_a == b .and. tie%body_b == a))
    end associate
  end function are_tied

  !> The first exclusion that means two bodies; 0 where none does.
  pure integer function exclusion_of(exclude, a, b) result(i)
    type(exclusion_t), intent(in) :: exclude(:)  !! Exclusions of a group (n_exclusions).
    type(body_input_t), intent(in) :: a  !! A body.
    type(body_input_t), intent(in) :: b  !! The other body.
    do i = 1, size(exclude)
      if (is_meant(exclude(i)%a, a) .and. is_meant(exclude(i)%b, b)) return
      if (is_meant(exclude(i)%a, b) .and. is_meant(exclude(i)%b, a)) return
    end do
    i = 0
  end function exclusion_of

  !> Whether a name with wildcards means a body, or the one of which it is a half.
  pure logical function is_meant(pattern, body)
    character(*), intent(in) :: pattern  !! Name, maybe with wildcards.
    type(body_input_t), intent(in) :: body  !! The body.
    is_meant = pattern == body%name .or. matches(pattern, body%name)
    if (is_meant .or. .not. body%cut%is_cut()) return
    is_meant = pattern == body%cut%whole .or. matches(pattern, body%cut%whole)
  end function is_meant

  !> Some exclusions as the user writes them.
  pure function exclusion_texts(exclude, chosen) result(texts)
    type(exclusion_t), intent(in) :: exclude(:)  !! Exclusions of a group (n_exclusions).
    logical, intent(in) :: chosen(:)  !! Which ones (n_exclusions).
    type(text_t), allocatable :: texts(:)
    integer :: i, n
    allocate (texts(count(chosen)))
    n = 0
    do i = 1, size(exclude)
      if (.not. chosen(i)) cycle
      n = n + 1
      texts(n)%s = exclude(i)%a
      if (exclude(i)%b /= '*') texts(n)%s = exclude(i)%a//' - '//exclude(i)%b
    end do
  end function exclusion_texts
end module dotyk_model_pair_list
