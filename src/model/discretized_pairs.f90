!> Checks of discretized pairs: pairs that the search found and that have no constraint, and faces that two
!> pairs integrate.
module dotyk_model_discretized_pairs
  use dotyk_base_error, only: exit_bad_input, problem_list_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_input_case, only: case_t, contact_input_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: drop_empty_pairs, refuse_double_faces

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.

contains

  !> Drop pairs without integration points: surfaces that are near each other and nowhere lie opposite each other.
  subroutine drop_empty_pairs(case, surface_a, surface_b, pair, n_dropped)
    type(case_t), intent(inout) :: case  !! The case.
    type(surface_t), allocatable, intent(inout) :: surface_a(:)  !! Slave surfaces (n_pairs).
    type(surface_t), allocatable, intent(inout) :: surface_b(:)  !! Master surfaces (n_pairs).
    type(contact_pair_t), allocatable, intent(inout) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(out) :: n_dropped  !! Number of dropped pairs.
    type(contact_input_t), allocatable :: contacts(:)
    type(surface_t), allocatable :: surfaces_a(:), surfaces_b(:)
    type(contact_pair_t), allocatable :: pairs(:)
    integer :: k, n
    n_dropped = count(pair%n_points == 0)
    if (n_dropped == 0) return
    n = size(pair) - n_dropped
    allocate (contacts(n), surfaces_a(n), surfaces_b(n), pairs(n))
    n = 0
    do k = 1, size(pair)
      if (pair(k)%n_points == 0) cycle
      n = n + 1
      contacts(n) = case%contact(k)
      surfaces_a(n) = surface_a(k)
      surfaces_b(n) = surface_b(k)
      pairs(n) = pair(k)
    end do
    call move_alloc(contacts, case%contact)
    call move_alloc(surfaces_a, surface_a)
    call move_alloc(surfaces_b, surface_b)
    call move_alloc(pairs, pair)
  end subroutine drop_empty_pairs

  !> Refuse pairs of the same bodies with points on the same two facets: the contact would count twice.
  subroutine refuse_double_faces(case, surface_a, surface_b, pair, problems)
    type(case_t), intent(in) :: case  !! The case.
    type(surface_t), intent(in) :: surface_a(:)  !! Slave surfaces (n_pairs).
    type(surface_t), intent(in) :: surface_b(:)  !! Master surfaces (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; mistakes are added.
    real(dp) :: bodies(size(pair))
    integer :: order(size(pair)), first, last
    bodies = min(pair%body_a, pair%body_b)*real(size(case%body) + 1, dp) + max(pair%body_a, pair%body_b)
    call sort_order(bodies, order)
    first = 1
    do while (first <= size(pair))
      last = first
      do while (last < size(pair))
        if (bodies(order(last + 1)) > bodies(order(first))) exit
        last = last + 1
      end do
      if (last > first) call compare_pairs(case, order(first:last), surface_a, surface_b, pair, problems)
      first = last + 1
    end do
  end subroutine refuse_double_faces

  !> Compare the pairs of two bodies.
  subroutine compare_pairs(case, of_bodies, surface_a, surface_b, pair, problems)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: of_bodies(:)  !! Pairs of the two bodies, ascending (n).
    type(surface_t), intent(in) :: surface_a(:)  !! Slave surfaces (n_pairs).
    type(surface_t), intent(in) :: surface_b(:)  !! Master surfaces (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(problem_list_t), intent(inout) :: problems  !! Problems so far; mistakes are added.
    type(corner_table_t) :: low, high, both
    integer, allocatable :: owner(:), number_a(:), number_b(:)
    integer :: i, k, p, n, known, entry, other
    n = sum(surface_a(of_bodies)%n_facets) + sum(surface_b(of_bodies)%n_facets)
    call low%init(max_corners, n)
    call high%init(max_corners, n)
    call both%init(2, sum(pair(of_bodies)%n_points))
    allocate (owner(sum(pair(of_bodies)%n_points)))
    do i = 1, size(of_bodies)
      k = of_bodies(i)
      other = 0
      if (pair(k)%body_a < pair(k)%body_b) then
        call number_facets(low, surface_a(k), number_a)
        call number_facets(high, surface_b(k), number_b)
        number_b = number_b + n
      else
        call number_facets(high, surface_a(k), number_a)
        call number_facets(low, surface_b(k), number_b)
        number_a = number_a + n
      end if
      do p = 1, pair(k)%n_points
        known = both%n
        call both%add([number_a(pair(k)%facet_a(p)), number_b(pair(k)%facet_b(p))], entry)
        if (entry > known) owner(entry) = k
        if (owner(entry) /= k) other = owner(entry)
      end do
      if (other > 0) &
        call problems%add(case%file//':'//to_text(case%contact(k)%line)//': &contact '//quoted(case%contact(k)%name)// &
                          ' and '//quoted(case%contact(other)%name)//' (line '// &
                          to_text(case%contact(other)%line)//') are in part the same contact, which would count '// &
                          'twice: name each face of '//quoted(case%body(pair(k)%body_a)%name)//' and '// &
                          quoted(case%body(pair(k)%body_b)%name)//' in one pair only', exit_bad_input)
    end do
  end subroutine compare_pairs

  !> Number the facets of a surface in a table of the facets of its body.
  subroutine number_facets(table, surface, number)
    type(corner_table_t), intent(inout) :: table  !! Facets of the body so far; those of the surface are added.
    type(surface_t), intent(in) :: surface  !! The surface.
    integer, allocatable, intent(out) :: number(:)  !! Number of each facet (n_facets).
    type(element_kind_t) :: kind
    integer :: f
    allocate (number(surface%n_facets))
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      call table%add(surface%node(:kind%n_corners, f), number(f))
    end do
  end subroutine number_facets
end module dotyk_model_discretized_pairs
