!> Penetration of one part into another after deformation: nodes of the one below the boundary of the other, and edges
!> that pass through it without a node inside.
!>
!> A depth counts where it exceeds what is allowed (penetration_tolerance.f90).
module dotyk_contact_penetration_search
  use dotyk_base_kinds, only: dp
  use dotyk_contact_edge_penetration, only: find_edges
  use dotyk_contact_met_points, only: inside_point_t
  use dotyk_contact_passage_search, only: find_passage, passage_t, swept_facets_t
  use dotyk_contact_penetration, only: penetration_t, same_depth
  use dotyk_contact_penetration_tolerance, only: penetration_tolerance_t
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: find_penetration, find_passages

  !> Nodes that a thread takes at once, and the number from which on threads share them.
  integer, parameter :: chunk = 256, least_shared = 1024
  !> Work for a node far from the other part, relative to that for a near one [].
  real(dp), parameter :: distant_cost = 0.02_dp

contains

  !> Depth of a part below the boundary of another one.
  subroutine find_penetration(division, a, b, tolerance, depth, worst, clear, inside)
    type(division_t), intent(in) :: division  !! How ranks divide nodes and facets.
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    !> Depth of each node that is too deep, or at an edge that is; 0 elsewhere (a%n_nodes) [length].
    real(dp), allocatable, intent(out) :: depth(:)
    type(penetration_t), intent(out) :: worst  !! The deepest point.
    !> Least distance of each node from b, 0 where it is not outside (a%n_nodes) [length].
    real(dp), allocatable, intent(out) :: clear(:)
    type(inside_point_t), allocatable, intent(out) :: inside(:)  !! Points that are too deep (n).
    logical :: is_below(a%n_nodes)
    real(dp) :: between(a%n_nodes)
    integer :: near(a%n_nodes), i, hint, known, first, last
    allocate (depth(a%n_nodes), source=0.0_dp)
    allocate (inside(0))
    is_below = .false.
    between = 0
    near = 0
    allocate (clear(a%n_nodes), source=0.0_dp)
    associate (box => b%tree%volume(1))
      call division%portion([(merge(distant_cost, 1.0_dp, any(a%x(:, i) < box%lo .or. a%x(:, i) > box%hi)), &
                              i=1, a%n_nodes)], first, last)
    end associate
    !$omp parallel default(none) shared(a, b, tolerance, depth, between, is_below, near, clear, first, last) &
    !$omp& private(hint, known) if (a%n_nodes > least_shared)
    hint = 0
    known = 0
    !$omp do schedule(dynamic, chunk)
    do i = first, last
      ! A node that is nearer to another one than that to b is outside as well.
      if (known > 0) clear(i) = clear(known) - norm2(a%x(:, i) - a%x(:, known))
      if (clear(i) > tolerance%slack) cycle
      call find_node_depth(a, b, i, tolerance, hint, clear(i), is_below(i), depth(i), between(i))
      near(i) = hint
      known = i
    end do
    !$omp end do
    !$omp end parallel
    call division%fill(clear, first, last)
    call division%fill(between, first, last)
    i = maxloc(between, 1)
    if (between(i) > 0) then
      worst%between_rows = between(i)
      worst%between_at = a%x(:, i)
    end if
    if (division%is_divided) call share_depths(division, is_below, depth)
    do i = 1, a%n_nodes
      if (.not. depth(i) > 0) cycle
      worst%n_nodes = worst%n_nodes + 1
      inside = [inside, inside_point_t(a%around(a%first(i)), [i, i], 0, a%x(:, i))]
      if (depth(i) <= (1 + same_depth)*worst%depth) cycle
      worst%depth = depth(i)
      worst%position = a%x(:, i)
    end do
    call find_edges(division, a, b, tolerance, is_below, near, clear, depth, worst, inside)
  end subroutine find_penetration

  !> Make the depths of the nodes of all ranks known to all.
  subroutine share_depths(division, is_below, depth)
    type(division_t), intent(in) :: division  !! How ranks divide the nodes.
    logical, intent(inout) :: is_below(:)  !! Nodes below the boundary; of this rank in, of all out (n_nodes).
    real(dp), intent(inout) :: depth(:)  !! Depths that are not allowed, likewise (n_nodes) [length].
    real(dp), allocatable :: list(:, :)
    integer, allocatable :: node(:)
    integer :: i
    node = pack([(i, i=1, size(depth))], is_below .or. abs(depth) > 0)
    allocate (list(3, size(node)))
    list(1, :) = node
    list(2, :) = merge(1.0_dp, 0.0_dp, is_below(node))
    list(3, :) = depth(node)
    call division%append(list)
    node = nint(list(1, :))
    is_below(node) = list(2, :) > 0
    depth(node) = list(3, :)
  end subroutine share_depths

  !> Nodes of a part that have passed wholly through another one.
  subroutine find_passages(division, a, b, swept, tolerance, clear, depth, worst, inside)
    type(division_t), intent(in) :: division  !! How ranks divide the nodes.
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    type(swept_facets_t), intent(in) :: swept  !! Facets of the other part in motion.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    real(dp), intent(in) :: clear(:)  !! Least distance of each node from b after deformation (a%n_nodes) [length].
    !> Depth of each node; that of nodes that have passed through the other part is added, the distance from the face
    !> that they entered through (a%n_nodes) [length].
    real(dp), intent(inout) :: depth(:)
    type(penetration_t), intent(inout) :: worst  !! The deepest point; nodes are added.
    type(inside_point_t), allocatable, intent(inout) :: inside(:)  !! Points that have passed through are added (n).
    type(passage_t) :: passage
    real(dp) :: allowed, left, certain, centre(2), passed(a%n_nodes)
    integer :: entered(a%n_nodes), i, first, last
    passed = 0
    entered = 0
    call division%portion(a%n_nodes, first, last)
    !$omp parallel do default(none) private(passage, allowed, left, certain, centre) schedule(dynamic, chunk) &
    !$omp& shared(a, b, swept, tolerance, clear, depth, passed, entered, first, last) if (a%n_nodes > least_shared)
    do i = first, last
      if (depth(i) > 0) cycle
      ! Farther from b than the two have moved.
      if (clear(i) > norm2(a%x(:, i) - a%x0(:, i) - swept%shift) + swept%farthest) cycle
      call find_passage(a, i, b, swept, tolerance%slack, passage)
      if (passage%facet == 0) cycle
      centre = merge(1/3.0_dp, 0.0_dp, b%set%corners(passage%facet) == 3)
      call tolerance%find_allowed(a, [i], b, passage%facet, centre, &
                                  a%x(:, i), a%x(:, i) - a%x0(:, i), allowed, left, certain)
      ! Penalty moves nothing to the other side, a given gap may.
      if (.not. passage%through > allowed - left + max(tolerance%left_a%given, tolerance%left_b%given)) cycle
      passed(i) = -passage%depth
      entered(i) = passage%facet
    end do
    !$omp end parallel do
    call division%fill(passed, first, last)
    do i = 1, a%n_nodes
      if (abs(passed(i)) > 0) depth(i) = passed(i)
      if (.not. depth(i) < 0) cycle
      depth(i) = -depth(i)
      worst%n_passed = worst%n_passed + 1
      if (entered(i) > 0) inside = [inside, inside_point_t(a%around(a%first(i)), [i, i], entered(i), a%x(:, i))]
      if (depth(i) <= (1 + same_depth)*worst%depth) cycle
      worst%depth = depth(i)
      worst%position = a%x(:, i)
    end do
  end subroutine find_passages

  !> Depth of a node that is not allowed; 0 where it is [length].
  pure subroutine find_node_depth(a, b, i, tolerance, hint, clear, is_below, depth, between)
    type(solid_t), intent(in) :: a  !! The part.
    type(solid_t), intent(in) :: b  !! The other part.
    integer, intent(in) :: i  !! Node of the part.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! Depths that are allowed.
    integer, intent(inout) :: hint  !! Facet that is probably near, that of the last node; 0 for none.
    real(dp), intent(out) :: clear  !! Least distance from the other part, 0 where it is not outside [length].
    logical, intent(out) :: is_below  !! Whether the node is below the boundary, allowed or not.
    real(dp), intent(out) :: depth  !! Depth [length].
    real(dp), intent(out) :: between  !! As of `judge` [length].
    real(dp) :: xi(2), reach
    integer :: facet, other
    is_below = .false.
    depth = 0
    between = 0
    associate (box => b%tree%volume(1))
      clear = norm2(max(0.0_dp, box%lo - a%x(:, i), a%x(:, i) - box%hi))
    end associate
    if (clear > tolerance%slack) return
    call b%depth_of(a%x(:, i), hint, depth, facet, xi)
    hint = facet
    clear = max(0.0_dp, -depth)
    if (clear > tolerance%slack) then
      depth = 0
      return
    end if
    if (a%is_flush(i, b, facet)) then
      ! Farther and farther, until another facet is known to be the closest one.
      reach = max(tiny(reach), b%set%size(facet))
      do
        call b%depth_beside_flush(a%x(:, i), a, [i], .false., reach, depth, other, xi)
        if (other > 0 .or. reach > norm2(b%tree%volume(1)%hi - b%tree%volume(1)%lo)) exit
        reach = 2*reach
      end do
      if (other == 0) depth = 0
      if (other > 0) facet = other
    end if
    is_below = depth > tolerance%slack
    call tolerance%judge(a, [i], b, facet, xi, a%x(:, i), a%x(:, i) - a%x0(:, i), depth, between)
  end subroutine find_node_depth
end module dotyk_contact_penetration_search
