!> Discretizes the contact pairs of the input, and makes those of the points at which bodies met beside their contact
!> rows in an earlier solution.
module dotyk_model_pairs
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_error, only: error_slot_t, error_t, exit_bad_input, problem_list_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gap_geometry
  use dotyk_base_progress, only: add_progress, expect_progress
  use dotyk_base_sort, only: sort_order
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_contact_pair, only: contact_pair_t, share_pairs
  use dotyk_contact_pair_report, only: pair_report_t
  use dotyk_contact_smooth_sheets, only: split_sheets
  use dotyk_control_contact_problem, only: tied_surfaces_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_input_case, only: case_t, contact_input_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_pair_finder, only: form_pairs
  use dotyk_model_pair_list, only: exclusion_of
  use dotyk_model_pair_search, only: search_pair
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_division, only: deal_out, division_t
  use dotyk_ranks_exchange, only: all_ranks, share_errors
  implicit none
  private
  public :: find_pairs, foundation_compliance, add_met_pairs

  integer, parameter :: max_corners = 4  !! Greatest number of corners of a facet.

  !> Depth of the Winkler foundation that approximates the compliance of a body, relative to the size of the body: about
  !> that of a contact zone [].
  real(dp), parameter :: foundation_depth = 0.1_dp
  integer, parameter :: many = 8  !! From this number of pairs per thread on, pairs are searched in parallel.
  !> From this number of facets of a pair on, ranks divide its search: below, the exchanges take as long.
  real(dp), parameter :: least_divided = 200

contains

  !> Form and discretize all contact pairs; all problems are reported together.
  subroutine find_pairs(case, body, surfaces, surface_a, surface_b, pair, found, error)
    type(case_t), intent(inout) :: case  !! The case; `contact` has one entry for each pair on return.
    type(body_t), intent(in) :: body(:)  !! Assembled bodies (n_bodies).
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Their surfaces that pairs may need (n_bodies).
    type(surface_t), allocatable, intent(out) :: surface_a(:)  !! Slave surfaces in smooth sheets (n_pairs).
    type(surface_t), allocatable, intent(out) :: surface_b(:)  !! Master surface of each pair, likewise (n_pairs).
    type(contact_pair_t), allocatable, intent(out) :: pair(:)  !! Contact pairs (n_pairs).
    type(pair_report_t), intent(out) :: found  !! What the search for pairs found.
    type(error_t), allocatable, intent(out) :: error  !! Where pairs cannot be discretized: all problems.
    type(problem_list_t) :: problems
    type(error_slot_t), allocatable :: failed(:)
    integer, allocatable :: owner(:)
    logical :: is_dealt
    integer :: b, k
    ! Once for each named surface, not for each of its pairs.
    !$omp parallel do default(none) shared(body, surfaces) private(k) schedule(dynamic, 1)
    do b = 1, size(body)
      do k = 1, surfaces(b)%n
        call split_sheets(body(b)%mesh%x, surfaces(b)%surface(k))
      end do
    end do
    !$omp end parallel do
    call form_pairs(case, body, surfaces, surface_a, surface_b, found, error)
    if (allocated(error)) return
    do k = 1, size(case%contact)
      associate (given => case%contact(k))
        if (body(given%body_a)%constraint%rigid%is_set .and. body(given%body_b)%constraint%rigid%is_set) &
          call problems%add(case%file//':'//to_text(given%line)//': contact pair '//quoted(given%name)// &
                            ': both bodies are rigid: no stiffness determines the forces between them; exclude '// &
                            'the pair', &
                            exit_bad_input)
      end associate
    end do
    call problems%raise(error)
    if (allocated(error)) return
    allocate (pair(size(case%contact)), failed(size(case%contact)))
    ! Bodies in parts have properties that are sums over ranks: all ranks come to each of their pairs.
    is_dealt = n_ranks() > 1 .and. .not. any([(body(b)%mesh%is_in_parts(), b=1, size(body))])
    if (is_dealt) then
      owner = deal_out(real(surface_a%n_facets + surface_b%n_facets, dp), least_divided)
    else
      owner = merge(all_ranks, this_rank(), surface_a%n_facets + surface_b%n_facets >= least_divided .and. &
                    n_ranks() > 1)
    end if
    call expect_progress(real(sum(surface_a%n_facets + surface_b%n_facets), dp))
    ! Few pairs: threads share the points of each. Many pairs: threads share the pairs.
    !$omp parallel do default(none) shared(case, body, surface_a, surface_b, pair, owner, failed) &
    !$omp& schedule(dynamic, 1) if (size(pair) >= many*omp_get_max_threads())
    do k = 1, size(pair)
      associate (given => case%contact(k))
        if (.not. allocated(surface_a(k)%sheet)) call split_sheets(body(given%body_a)%mesh%x, surface_a(k))
        if (.not. allocated(surface_b(k)%sheet)) call split_sheets(body(given%body_b)%mesh%x, surface_b(k))
        if (owner(k) == this_rank()) &
          call search_pair(case, given, body(given%body_a), surface_a(k), body(given%body_b), surface_b(k), &
                           division_t(), pair(k), failed(k)%error)
      end associate
      if (owner(k) == this_rank()) call add_progress(real(surface_a(k)%n_facets + surface_b(k)%n_facets, dp))
    end do
    !$omp end parallel do
    ! Ranks divide the points of large pairs.
    do k = 1, size(pair)
      if (owner(k) /= all_ranks) cycle
      associate (given => case%contact(k))
        call search_pair(case, given, body(given%body_a), surface_a(k), body(given%body_b), surface_b(k), &
                         division_t(.true.), pair(k), failed(k)%error)
      end associate
      call add_progress(real(surface_a(k)%n_facets + surface_b(k)%n_facets, dp))
    end do
    if (is_dealt) call share_searched(owner, pair, failed)
    do k = 1, size(pair)
      call problems%add_error(failed(k)%error, case%file//':'//to_text(case%contact(k)%line)//': ')
    end do
    if (problems%count == 0) then
      call drop_empty_pairs(case, surface_a, surface_b, pair, found%n_empty)
      call refuse_double_faces(case, surface_a, surface_b, pair, problems)
    end if
    call problems%raise(error)
  end subroutine find_pairs

  !> Make the pairs that one rank each has searched known to all ranks.
  subroutine share_searched(owner, pair, failed)
    integer, intent(in) :: owner(:)  !! Rank of each pair, or `all_ranks` (n_pairs).
    type(contact_pair_t), intent(inout) :: pair(:)  !! The pairs; those of other ranks are set (n_pairs).
    type(error_slot_t), intent(inout) :: failed(:)  !! Their errors, likewise (n_pairs).
    type(error_slot_t), allocatable :: of_dealt(:)
    integer, allocatable :: dealt(:)
    integer :: k
    dealt = pack([(k, k=1, size(owner))], owner /= all_ranks)
    if (size(dealt) == 0) return
    call share_pairs(owner, pair)
    allocate (of_dealt(size(dealt)))
    of_dealt = failed(dealt)
    call share_errors(owner(dealt), of_dealt)
    failed(dealt) = of_dealt
  end subroutine share_searched

  !> Compliance of a Winkler foundation for each row of the operator, the initial guess of a scheme.
  subroutine foundation_compliance(body, pair, foundation, tie)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    real(dp), allocatable, intent(out) :: foundation(:)  !! Compliance of each row (n_rows) [length/pressure].
    !> Ties, whose rows follow those of the pairs; none if absent (n_ties).
    type(tied_surfaces_t), intent(in), optional :: tie(:)
    real(dp) :: compliance(size(body))
    logical :: is_paired(size(body))
    integer :: b, k, c, n_ties
    n_ties = 0
    if (present(tie)) n_ties = size(tie)
    is_paired = .false.
    do k = 1, n_ties
      is_paired([tie(k)%component(1)%body_a, tie(k)%component(1)%body_b]) = .true.
    end do
    is_paired(pair%body_a) = .true.
    is_paired(pair%body_b) = .true.
    ! By a size that does not depend on the axes; once for each body, not for each of its pairs.
    compliance = 0
    do b = 1, size(body)
      if (is_paired(b)) compliance(b) = foundation_depth*shortest_extent(body(b)%mesh)/body(b)%young()
    end do
    allocate (foundation(0))
    do k = 1, size(pair)
      call append(pair(k))
    end do
    do k = 1, n_ties
      do c = 1, size(tie(k)%component)
        call append(tie(k)%component(c))
      end do
    end do

  contains

    !> Append the rows of one pair.
    subroutine append(rows)
      type(contact_pair_t), intent(in) :: rows  !! The pair.
      foundation = [foundation, spread(compliance(rows%body_a) + compliance(rows%body_b), 1, rows%n_rows)]
    end subroutine append
  end subroutine foundation_compliance

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

  !> Append a pair for each two bodies that met, with the penalty parameter of a pair that they have, or of the first.
  subroutine add_met_pairs(case, met, body, surface_a, surface_b, pair, error)
    type(case_t), intent(inout) :: case  !! The case; its contacts get those of the new pairs.
    type(met_point_t), intent(in) :: met(:)  !! The points (n).
    type(body_t), intent(in) :: body(:)  !! Assembled bodies (n_bodies).
    type(surface_t), allocatable, intent(inout) :: surface_a(:)  !! Slave surface of each pair (n_pairs).
    type(surface_t), allocatable, intent(inout) :: surface_b(:)  !! Master surface of each pair (n_pairs).
    type(contact_pair_t), allocatable, intent(inout) :: pair(:)  !! Contact pairs (n_pairs).
    type(error_t), allocatable, intent(out) :: error  !! As in `search_pair`.
    type(contact_input_t) :: given
    type(contact_pair_t) :: new
    type(surface_t) :: of_a, of_b
    logical :: of_couple(size(met)), is_left(size(met))
    integer :: i, k, a, b
    is_left = .true.
    do i = 1, size(met)
      if (.not. is_left(i)) cycle
      a = met(i)%body_a
      b = met(i)%body_b
      of_couple = met%body_a == a .and. met%body_b == b
      is_left = is_left .and. .not. of_couple
      k = max(1, findloc(min(pair%body_a, pair%body_b) == min(a, b) .and. max(pair%body_a, pair%body_b) == max(a, b), &
                         .true., dim=1))
      given = case%contact(k)
      if (allocated(given%exclude)) then
        if (exclusion_of(given%exclude, case%body(a), case%body(b)) > 0) cycle
      end if
      given%name = case%body(a)%name//' - '//case%body(b)%name//' (corners)'
      given%found = .true.
      given%body_a = a
      given%body_b = b
      given%gap_kind = gap_geometry
      given%is_layer = .false.
      call extract_boundary(body(a)%mesh, of_a)
      call extract_boundary(body(b)%mesh, of_b)
      call search_pair(case, given, body(a), of_a, body(b), of_b, division_t(), new, error, pack(met, of_couple))
      if (allocated(error)) return
      case%contact = [case%contact, given]
      surface_a = [surface_a, of_a]
      surface_b = [surface_b, of_b]
      pair = [pair, new]
    end do
  end subroutine add_met_pairs
end module dotyk_model_pairs
