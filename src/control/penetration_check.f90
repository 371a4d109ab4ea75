!> The check after the solution: whether the deformed bodies penetrate each other, in contact pairs or not.
!>
!> It depends neither on the contact search nor on contact rows: the whole boundary of each part of each body is held
!> against that of all others whose boxes it meets. Contact pairs only explain the penetration that their penalty and
!> their given gaps leave. Self contact of one part is not checked.
module dotyk_control_penetration_check
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_sort, only: sort_order
  use dotyk_base_thresholds, only: of_mesh
  use dotyk_contact_broad_phase, only: overlapping_boxes
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_couple_penetration, only: body_penetration_t, check_bodies, parts_t, split_parts
  use dotyk_control_explained_penetration, only: pairs_of_bodies_t
  use dotyk_control_pressures, only: nodal_field_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_division, only: deal_out, division_t, least_divided
  use dotyk_ranks_exchange, only: all_ranks, by_owner, is_own, share_parcel
  implicit none
  private

  type :: met_points_t  !! Those of one couple of bodies.
    type(met_point_t), allocatable :: of(:)  !! The points (n).
  end type met_points_t

  type, public :: penetration_check_t  !! Outcome of the check.
    logical :: is_done = .false.  !! Whether it was done: it needs displacements.
    type(body_penetration_t), allocatable :: found(:)  !! Pairs of bodies that penetrate each other, the deepest first.
    !> Bodies in each other between contact rows, where facets bend, by a part of what they move.
    type(body_penetration_t), allocatable :: between_rows(:)
    type(body_penetration_t), allocatable :: touching(:)  !! Pairs of bodies that touch, and are in no contact pair.
    !> Depth of the nodes that are too deep, or at an edge that is; 0 elsewhere (n_bodies) [length].
    type(nodal_field_t), allocatable :: depth(:)
    !> Points at which contact rows would keep the bodies out of each other; none where they would not keep out all, and
    !> with several ranks (n).
    type(met_point_t), allocatable :: met(:)
  contains
    procedure :: deepest => check_deepest
  end type penetration_check_t

  public :: body_penetration_t, check_penetration, find_initial_overlap

  !> From this number of couples of bodies per thread on, couples are checked in parallel.
  integer, parameter :: many = 4
  !> Couples that are checked before the boundaries of bodies are given up that no later ones need.
  integer, parameter :: most_at_once = 2048

contains

  !> The deepest penetration; 0 where there is none, NaN where the check was not done [length].
  pure real(dp) function check_deepest(self) result(depth)
    class(penetration_check_t), intent(in) :: self
    depth = 0
    if (.not. self%is_done) then
      depth = ieee_value(depth, ieee_quiet_nan)
    else if (size(self%found) > 0) then
      depth = self%found(1)%worst%depth
    end if
  end function check_deepest

  !> Find bodies in no contact pair that overlap before they are loaded: parts of an assembly in the wrong place.
  !>
  !> The search for pairs takes overlaps of a few percent of a body for interference; pairs show their smallest gap.
  subroutine find_initial_overlap(problem, found)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs, with what the search for pairs found.
    !> Couples of bodies, the deepest first, without those that the search names (n_found).
    type(body_penetration_t), allocatable, intent(out) :: found(:)
    type(body_solution_t) :: at_rest(size(problem%body))
    type(penetration_check_t) :: check
    integer :: b, k
    do b = 1, size(problem%body)
      allocate (at_rest(b)%displacement, mold=problem%body(b)%mesh%x)
      at_rest(b)%displacement = 0
    end do
    call check_penetration(problem, at_rest, [(1, k=0, size(problem%pair))], [real(dp) ::], &
                           [(0.0_dp, k=1, size(problem%pair))], 0.0_dp, check, &
                           beside_pairs=.true.)
    associate (of_body => check%found%body, other => check%found%other)
      found = pack(check%found, [(check%found(k)%worst%depth > of_mesh* &
                                  min(problem%body(of_body(k))%mesh%diameter(), &
                                      problem%body(other(k))%mesh%diameter()), k=1, size(check%found))])
    end associate
  end subroutine find_initial_overlap

  !> Check all bodies.
  subroutine check_penetration(problem, solution, first_row, penetration, uncertainty, error_bound, check, beside_pairs)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    !> That of the normal displacements of the two sides of each pair; NaN where unknown (n_pairs) [length].
    real(dp), intent(in) :: uncertainty(:)
    real(dp), intent(in) :: error_bound  !! Relative error of the iteration [].
    type(penetration_check_t), intent(out) :: check  !! Outcome.
    logical, intent(in), optional :: beside_pairs  !! Only different bodies that no contact pair has; not if absent.
    type(pairs_of_bodies_t) :: pairs
    integer, allocatable :: couple(:, :)
    real(dp) :: box(6, size(problem%body))
    integer :: b, k
    ! Lower corners, with the other sign, and upper corners.
    box = 0
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (x => problem%body(b)%mesh%x, u => solution(b)%displacement)
        box(1:size(x, 1), b) = -min(minval(x, dim=2), minval(x + u, dim=2))
        box(4:3 + size(x, 1), b) = max(maxval(x, dim=2), maxval(x + u, dim=2))
      end associate
    end do
    do k = 1, 6
      call problem%ranks%share_greatest(box(k, :))
    end do
    call overlapping_boxes(-box(:3, :), box(4:, :), couple)
    call pairs%init(problem%pair, size(problem%body))
    couple = couple(:, pack([(k, k=1, size(couple, 2))], [(counts(couple(1, k), couple(2, k)), k=1, size(couple, 2))]))
    call check_couples(problem, pairs, solution, first_row, penetration, uncertainty, error_bound, couple, check)

  contains

    !> Whether two bodies are checked.
    logical function counts(a, c)
      integer, intent(in) :: a  !! Index of a body.
      integer, intent(in) :: c  !! Index of the other body, not lower.
      ! Where meshes of a tied surface do not fit, they overlap for good.
      counts = .not. problem%are_tied(a, c)
      if (present(beside_pairs)) counts = counts .and. a /= c .and. size(pairs%between(problem%pair, a, c)) == 0
    end function counts
  end subroutine check_penetration

  !> Check some couples of bodies.
  subroutine check_couples(problem, pairs, solution, first_row, penetration, uncertainty, error_bound, couple, check)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(pairs_of_bodies_t), intent(in) :: pairs  !! The pairs of each body.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    !> That of the normal displacements of the two sides of each pair; NaN where unknown (n_pairs) [length].
    real(dp), intent(in) :: uncertainty(:)
    real(dp), intent(in) :: error_bound  !! Relative error of the iteration [].
    integer, intent(in) :: couple(:, :)  !! The couples; a body with itself for its parts (2, n_couples).
    type(penetration_check_t), intent(out) :: check  !! Outcome.
    type(parts_t), allocatable :: parts(:)
    type(body_penetration_t), allocatable :: found(:)
    type(met_points_t), allocatable :: met(:)
    integer, allocatable :: owner(:), order(:)
    integer :: last_use(size(problem%body)), b, k, n, first, last
    n = size(problem%body)
    allocate (check%depth(n))
    do b = 1, n
      allocate (check%depth(b)%value(problem%body(b)%mesh%n_nodes()), source=0.0_dp)
    end do
    check%is_done = .true.
    owner = owners_of(problem, couple)
    allocate (parts(n), found(size(couple, 2)), met(size(couple, 2)))
    do k = 1, size(found)
      last_use(couple(1, k)) = k
      last_use(couple(2, k)) = k
    end do
    ! Couples are listed along an axis: of many bodies, few are held at once.
    do first = 1, size(found), most_at_once
      last = min(size(found), first + most_at_once - 1)
      call split_bodies(problem, pairs, solution, couple(:, first:last), owner(first:last), parts)
      ! Few couples: threads share the nodes of each. Many couples: threads share the couples.
      !$omp parallel do default(none) schedule(dynamic, 1) if (size(found) >= many*omp_get_max_threads()) &
      !$omp& shared(owner, first, last)
      do k = first, last
        if (owner(k) == this_rank()) call check_couple(division_t(), k)
      end do
      !$omp end parallel do
      ! Ranks divide the nodes of large bodies.
      do k = first, last
        if (owner(k) == all_ranks) call check_couple(division_t(.true.), k)
      end do
      do k = first, last
        do b = 1, 2
          associate (of_body => parts(couple(b, k)))
            if (last_use(couple(b, k)) <= last .and. allocated(of_body%part)) deallocate (of_body%part, of_body%swept)
          end associate
        end do
      end do
    end do
    if (n_ranks() > 1) call share_findings(problem%body, owner, found, check%depth)
    allocate (check%met(0))
    ! Rows are of use where they keep out all bodies, in a scene of contact. Ranks know the points of their own couples.
    if (n_ranks() == 1 .and. size(problem%pair) > 0) then
      do k = 1, size(found)
        if (found(k)%worst%depth > 0) check%met = [check%met, met(k)%of]
      end do
      if (any([(found(k)%worst%depth > 0 .and. size(met(k)%of) == 0, k=1, size(found))])) check%met = check%met(:0)
    end if
    check%found = pack(found, found%worst%depth > 0)
    check%between_rows = pack(found, found%worst%between_rows > 0 .and. .not. found%worst%depth > 0)
    check%touching = pack(found, found%touch%n_facets > 0 .and. .not. found%worst%depth > 0)
    allocate (order(size(check%found)))
    call sort_order(-check%found%worst%depth, order)
    check%found = check%found(order)

  contains

    !> Check one couple.
    subroutine check_couple(division, k)
      type(division_t), intent(in) :: division  !! How ranks divide the nodes.
      integer, intent(in) :: k  !! The couple.
      associate (a => couple(1, k), c => couple(2, k))
        call check_bodies(division, problem, pairs, first_row, penetration, uncertainty, parts(a), parts(c), a, c, &
                          solution(a)%displacement, &
                          error_bound, check%depth, found(k), met(k)%of)
      end associate
    end subroutine check_couple
  end subroutine check_couples

  !> Rank of each couple, by its nodes: the larger ones are divided among all.
  function owners_of(problem, couple) result(owner)
    type(contact_problem_t), intent(in) :: problem  !! Bodies.
    integer, intent(in) :: couple(:, :)  !! The couples (2, n_couples).
    integer, allocatable :: owner(:)  !! Ranks, or `all_ranks` (n_couples).
    real(dp) :: n_nodes(size(problem%body)), n_parts(size(problem%body)), cost(size(couple, 2))
    integer, allocatable :: node(:), component(:)
    integer :: b, k, n
    if (n_ranks() == 1) then
      owner = [(this_rank(), k=1, size(couple, 2))]
      return
    end if
    n_nodes = 0
    n_parts = 0
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      associate (mesh => problem%body(b)%mesh)
        call boundary_nodes(mesh, node)
        n_nodes(b) = size(node)
        allocate (component(mesh%n_nodes()))
        call connected_components(mesh, component, n)
        n_parts(b) = n
        deallocate (component)
      end associate
    end do
    call problem%ranks%share_greatest(n_nodes)
    call problem%ranks%share_greatest(n_parts)
    do k = 1, size(cost)
      cost(k) = sum(n_nodes(couple(:, k)))
      ! A body of one part is not checked against itself.
      if (couple(1, k) == couple(2, k) .and. .not. n_parts(couple(1, k)) > 1) cost(k) = 0
    end do
    owner = deal_out(cost, least_divided)
  end function owners_of

  !> Boundaries of the bodies of couples that this rank checks, unless they are there.
  subroutine split_bodies(problem, pairs, solution, couple, owner, parts)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(pairs_of_bodies_t), intent(in) :: pairs  !! The pairs of each body.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    integer, intent(in) :: couple(:, :)  !! The couples (2, n_couples).
    integer, intent(in) :: owner(:)  !! Rank of each, or `all_ranks` (n_couples).
    type(parts_t), intent(inout) :: parts(:)  !! Gets the parts (n_bodies).
    logical :: needed(size(parts))
    integer :: b, k
    needed = .false.
    do k = 1, size(owner)
      if (.not. is_own(owner(k))) cycle
      needed(couple(1, k)) = .true.
      needed(couple(2, k)) = .true.
    end do
    !$omp parallel do default(none) shared(problem, pairs, solution, needed, parts) schedule(dynamic, 1)
    do b = 1, size(parts)
      if (needed(b) .and. .not. allocated(parts(b)%part)) &
        call split_parts(b, problem, pairs, solution(b)%displacement, parts(b))
    end do
    !$omp end parallel do
  end subroutine split_bodies

  !> Nodes on the boundary of a body, in an order that is the same on all ranks.
  subroutine boundary_nodes(mesh, node)
    type(body_mesh_t), intent(in) :: mesh  !! The body, or its boundary.
    integer, allocatable, intent(out) :: node(:)  !! Ascending (n).
    type(surface_t) :: boundary
    call extract_boundary(mesh, boundary)
    call surface_nodes(boundary, node)
  end subroutine boundary_nodes

  !> Make what the ranks have found in couples of their own known to all.
  subroutine share_findings(body, owner, found, depth)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    integer, intent(in) :: owner(:)  !! Rank of each couple, or `all_ranks` (n_couples).
    !> Penetration of each couple; of this rank in, of all out (n_couples).
    type(body_penetration_t), intent(inout) :: found(:)
    type(nodal_field_t), intent(inout) :: depth(:)  !! Depth at the nodes, likewise (n_bodies) [length].
    type(division_t) :: division
    type(parcel_t) :: parcel
    real(dp), allocatable :: list(:, :), all(:, :)
    integer, allocatable :: dealt(:), node(:), order(:)
    integer :: b, i, k
    dealt = pack([(k, k=1, size(owner))], owner /= all_ranks)
    if (size(dealt) == 0) return
    do k = 1, size(dealt)
      if (is_own(owner(dealt(k)))) call found(dealt(k))%carry(parcel)
    end do
    call share_parcel(owner(dealt), parcel)
    order = dealt(by_owner(owner(dealt)))
    if (.not. parcel%at_end()) then
      do k = 1, size(order)
        call found(order(k))%carry(parcel)
      end do
    end if
    if (.not. any(found(dealt)%worst%depth > 0)) return
    ! Body, place among its boundary nodes, and depth where there is one.
    allocate (all(3, 0))
    do b = 1, size(depth)
      if (.not. any(depth(b)%value > 0)) cycle
      call boundary_nodes(body(b)%mesh, node)
      associate (here => depth(b)%value(node))
        list = reshape([(real(b, dp), real(i, dp), here(i), i=1, size(node))], [3, size(node)])
        all = reshape([all, list(:, pack([(i, i=1, size(node))], here > 0))], [3, size(all, 2) + count(here > 0)])
      end associate
    end do
    division%is_divided = .true.
    call division%append(all)
    b = 0
    do k = 1, size(all, 2)
      if (nint(all(1, k)) /= b) then
        b = nint(all(1, k))
        call boundary_nodes(body(b)%mesh, node)
      end if
      associate (here => depth(b)%value(node(nint(all(2, k)))))
        here = max(here, all(3, k))
      end associate
    end do
  end subroutine share_findings
end module dotyk_control_penetration_check
