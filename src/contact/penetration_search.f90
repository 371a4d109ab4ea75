!> Penetration of one part into another after deformation: nodes of the one below the boundary of the other, and edges
!> that pass through it without a node inside.
!>
!> A depth is explained up to the penetration that the penalty of a contact pair leaves, the depth that the facets of both
!> sides cannot resolve (facet_roughness.f90), terms of second order in the displacements, which small-displacement
!> theory omits, and rounding.
module dotyk_contact_penetration_search
  use dotyk_base_kinds, only: dp
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_crossing, only: crossings, max_crossings
  use dotyk_contact_facet_set, only: facet_position_and_normal
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_mesh_element, only: kind_nodes
  implicit none
  private

  !> The deepest point of one part below the boundary of another that nothing explains.
  type, public :: penetration_t
    !> Its depth; 0 where there is none [length].
    real(dp) :: depth = 0
    !> Its position after deformation (3) [length].
    real(dp) :: position(3) = 0
    !> Nodes of the part that are too deep, and edges that are without a node so deep.
    integer :: n_nodes = 0, n_edges = 0
  end type penetration_t

  public :: find_penetration

  !> Two faces are flush before deformation where the angle of their normals has at least this cosine, and the distance
  !> is below this fraction of the size of the facet.
  real(dp), parameter :: flush_cosine = 0.999_dp, flush_distance = 1.0e-6_dp
  !> Points along the part of an edge that is inside, and steps of the search for the deepest one.
  integer, parameter :: n_samples = 3, n_steps = 30
  !> Nodes or facets that a thread takes at once, and the number from which on threads share them.
  integer, parameter :: chunk = 256, least_shared = 1024
  !> Golden section.
  real(dp), parameter :: golden = 0.381966011250105_dp

contains

  !> Depth of a part below the boundary of another one.
  subroutine find_penetration(a, b, explained_a, explained_b, slack, depth, worst)
    !> The part.
    type(solid_t), intent(in) :: a
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Penetration that contact pairs of the two leave at the nodes of the part (a%n_nodes) [length].
    real(dp), intent(in) :: explained_a(:)
    !> The same at the nodes of the other one (b%n_nodes) [length].
    real(dp), intent(in) :: explained_b(:)
    !> Error of the displacements and of rounding [length].
    real(dp), intent(in) :: slack
    !> Depth of each node that is too deep, or at an edge that is; 0 elsewhere (a%n_nodes) [length].
    real(dp), allocatable, intent(out) :: depth(:)
    !> The deepest point.
    type(penetration_t), intent(out) :: worst
    logical, allocatable :: inside(:)
    integer :: i
    allocate (depth(a%n_nodes))
    !$omp parallel do default(none) shared(a, b, explained_a, explained_b, slack, depth) schedule(dynamic, chunk) &
    !$omp& if (a%n_nodes > least_shared)
    do i = 1, a%n_nodes
      depth(i) = node_depth(a, b, i, explained_a(i), explained_b, slack)
    end do
    !$omp end parallel do
    inside = depth > 0
    do i = 1, a%n_nodes
      if (.not. inside(i)) cycle
      worst%n_nodes = worst%n_nodes + 1
      if (depth(i) <= worst%depth) cycle
      worst%depth = depth(i)
      worst%position = a%x(:, i)
    end do
    call find_edges(a, b, explained_a, explained_b, slack, inside, depth, worst)
  end subroutine find_penetration

  !> Depth of a node that nothing explains; 0 where it is explained [length].
  pure real(dp) function node_depth(a, b, i, explained, explained_b, slack) result(depth)
    !> The part.
    type(solid_t), intent(in) :: a
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Node of the part.
    integer, intent(in) :: i
    !> Penetration that contact pairs leave at this node [length].
    real(dp), intent(in) :: explained
    !> The same at the nodes of the other part (b%n_nodes) [length].
    real(dp), intent(in) :: explained_b(:)
    !> Error of the displacements and of rounding [length].
    real(dp), intent(in) :: slack
    real(dp) :: xi(2)
    integer :: facet
    depth = 0
    if (is_outside_box(b, a%x(:, i), slack)) return
    call b%depth_of(a%x(:, i), 0, depth, facet, xi)
    if (depth < -slack) then
      depth = 0
      return
    end if
    if (is_flush(a, i, b, facet)) call depth_beside_flush(a, i, b, depth, facet, xi)
    if (.not. depth > slack + b%roughness(facet)) then
      depth = 0
    else if (.not. depth > slack + explained + b%roughness(facet) + a%node_roughness(i, -b%normal(:, facet)) + &
             most_explained(b, facet, explained_b) + &
             second_order(a, i, b, facet, xi, a%x(:, i) - a%x0(:, i))) then
      depth = 0
    end if
  end function node_depth

  !> Whether a point lies outside the box of a part.
  pure logical function is_outside_box(b, x, margin) result(outside)
    !> The part.
    type(solid_t), intent(in) :: b
    !> Point (3) [length].
    real(dp), intent(in) :: x(3)
    !> Distance by which the box is widened [length].
    real(dp), intent(in) :: margin
    outside = any(x < b%tree%volume(1)%lo - margin .or. x > b%tree%volume(1)%hi + margin)
  end function is_outside_box

  !> Penetration that contact pairs leave at the nodes of a facet [length].
  pure real(dp) function most_explained(b, facet, explained) result(most)
    !> The part.
    type(solid_t), intent(in) :: b
    !> Facet.
    integer, intent(in) :: facet
    !> Penetration at the nodes of the part (b%n_nodes) [length].
    real(dp), intent(in) :: explained(:)
    most = maxval(explained(b%surface%node(1:kind_nodes(b%surface%kind(facet)), facet)))
  end function most_explained

  !> Change of a gap by terms of second order: a relative displacement s along one of the surfaces, whose curvatures add
  !> up to k and whose normals turn by r together, changes the gap by s r + k s^2/2 [length].
  pure real(dp) function second_order(a, i, b, facet, xi, displacement) result(change)
    !> The part.
    type(solid_t), intent(in) :: a
    !> Its node that is nearest.
    integer, intent(in) :: i
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Facet of the closest point.
    integer, intent(in) :: facet
    !> Its reference coordinates (2) [].
    real(dp), intent(in) :: xi(2)
    !> Displacement of the point (3) [length].
    real(dp), intent(in) :: displacement(3)
    real(dp) :: s(3), slip, turn, curvature
    integer :: k
    s = displacement - b%displacement_at(facet, xi)
    slip = norm2(s - dot_product(s, b%normal0(:, facet))*b%normal0(:, facet))
    turn = 0
    curvature = 0
    do k = a%first(i), a%first(i + 1) - 1
      associate (f => a%around(k))
        slip = max(slip, norm2(s - dot_product(s, a%normal0(:, f))*a%normal0(:, f)))
        turn = max(turn, norm2(a%normal(:, f) - a%normal0(:, f)))
        curvature = max(curvature, a%curvature(f))
      end associate
    end do
    turn = turn + norm2(b%normal(:, facet) - b%normal0(:, facet))
    change = slip*turn + slip**2*(curvature + b%curvature(facet))/2
  end function second_order

  !> Whether a facet was flush with a face of a part at one of its nodes before deformation, as the sides of two stacked
  !> blocks are: the node has not come through this facet, however near it is.
  pure logical function is_flush(a, i, b, facet) result(flush)
    !> The part.
    type(solid_t), intent(in) :: a
    !> Its node.
    integer, intent(in) :: i
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Its facet.
    integer, intent(in) :: facet
    integer :: k
    flush = .false.
    if (abs(dot_product(b%normal0(:, facet), a%x0(:, i) - b%x0(:, b%surface%node(1, facet)))) > &
        flush_distance*b%set%size(facet)) return
    do k = a%first(i), a%first(i + 1) - 1
      flush = dot_product(a%normal0(:, a%around(k)), b%normal0(:, facet)) > flush_cosine
      if (flush) return
    end do
  end function is_flush

  !> Depth of a node below the facets that were not flush with it.
  pure subroutine depth_beside_flush(a, i, b, depth, facet, xi)
    !> The part.
    type(solid_t), intent(in) :: a
    !> Its node.
    integer, intent(in) :: i
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Depth; 0 outside [length].
    real(dp), intent(out) :: depth
    !> Facet of the closest point; left as it is where there is none.
    integer, intent(inout) :: facet
    !> Its reference coordinates (2) [].
    real(dp), intent(inout) :: xi(2)
    real(dp) :: square, trial, trial_xi(2), position(3), normal(3), xu(3), xv(3)
    integer :: f
    depth = 0
    square = huge(square)
    do f = 1, b%set%n
      if (sum(max(b%set%lo(:, f) - a%x(:, i), a%x(:, i) - b%set%hi(:, f), 0.0_dp)**2) >= square) cycle
      if (is_flush(a, i, b, f)) cycle
      call closest_point_on_facet(b%set, f, a%x(:, i), trial_xi, trial)
      if (trial >= square) cycle
      square = trial
      facet = f
      xi = trial_xi
    end do
    if (.not. square < huge(square)) return
    call facet_position_and_normal(b%set, facet, xi, position, normal, xu, xv)
    if (dot_product(a%x(:, i) - position, normal) < 0) depth = sqrt(square)
  end subroutine depth_beside_flush

  !> Edges that pass through another part.
  subroutine find_edges(a, b, explained_a, explained_b, slack, inside, depth, worst)
    !> The part.
    type(solid_t), intent(in) :: a
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Penetration that contact pairs leave at the nodes of the part (a%n_nodes) [length].
    real(dp), intent(in) :: explained_a(:)
    !> The same at the nodes of the other one (b%n_nodes) [length].
    real(dp), intent(in) :: explained_b(:)
    !> Error of the displacements and of rounding [length].
    real(dp), intent(in) :: slack
    !> Nodes that are too deep (a%n_nodes).
    logical, intent(in) :: inside(:)
    !> Depth of each node that is too deep, or at an edge that is (a%n_nodes) [length].
    real(dp), intent(inout) :: depth(:)
    !> The deepest point.
    type(penetration_t), intent(inout) :: worst
    integer :: f, e, n, other, corners, ends(3)
    n = a%set%n
    !$omp parallel do default(none) private(e, other, corners, ends) schedule(dynamic, chunk) &
    !$omp& shared(a, b, explained_a, explained_b, slack, inside, depth, worst, n) if (n > least_shared)
    do f = 1, n
      if (any(a%set%lo(:, f) > b%tree%volume(1)%hi .or. a%set%hi(:, f) < b%tree%volume(1)%lo)) cycle
      corners = a%set%corners(f)
      do e = 1, merge(1, corners, corners == 2)
        other = 0
        if (corners > 2) other = a%adjacency%neighbour(e, f)
        if (other > 0 .and. other < f) cycle
        ends(1) = a%surface%node(e, f)
        ends(2) = a%surface%node(modulo(e, corners) + 1, f)
        if (kind_nodes(a%surface%kind(f)) > corners) then
          ends(3) = a%surface%node(corners + e, f)
          call search_segment(ends([1, 3]))
          call search_segment(ends([3, 2]))
        else
          call search_segment(ends(1:2))
        end if
      end do
    end do
    !$omp end parallel do

  contains

    !> Find the deepest point of a straight segment between two nodes.
    subroutine search_segment(nodes)
      !> Its ends.
      integer, intent(in) :: nodes(2)
      real(dp) :: s(max_crossings), deepest, place, own, at
      integer :: k, n_crossings, facet, j
      call crossings(b, a%x(:, nodes(1)), a%x(:, nodes(2)), slack, n_crossings, s)
      if (n_crossings == 0) return
      deepest = 0
      do k = 0, n_crossings
        associate (low => merge(0.0_dp, s(max(k, 1)), k == 0), &
                   high => merge(1.0_dp, s(min(k + 1, size(s))), k == n_crossings))
          do j = 1, n_samples
            place = low + (high - low)*j/(n_samples + 1)
            call segment_depth(nodes, place, own, facet)
            if (.not. own > deepest) cycle
            call deepen(nodes, low, high, place, own, facet)
            deepest = own
            at = place
          end do
        end associate
      end do
      if (.not. deepest > 0) return
      !$omp critical (penetration)
      if (.not. any(inside(nodes))) worst%n_edges = worst%n_edges + 1
      depth(nodes) = max(depth(nodes), deepest)
      if (deepest > worst%depth) then
        worst%depth = deepest
        worst%position = (1 - at)*a%x(:, nodes(1)) + at*a%x(:, nodes(2))
      end if
      !$omp end critical (penetration)
    end subroutine search_segment

    !> Search for the deepest point near a point by golden section.
    subroutine deepen(nodes, low, high, place, own, facet)
      !> Ends of the segment.
      integer, intent(in) :: nodes(2)
      !> Bounds of the place [].
      real(dp), intent(in) :: low, high
      !> Place on the segment, from 0 to 1 [].
      real(dp), intent(inout) :: place
      !> Depth there that nothing explains [length].
      real(dp), intent(inout) :: own
      !> Facet of the closest point.
      integer, intent(inout) :: facet
      real(dp) :: left, right, trial, value
      integer :: step, hit
      left = low
      right = high
      do step = 1, n_steps
        trial = merge(place + golden*(right - place), place - golden*(place - left), right - place > place - left)
        call segment_depth(nodes, trial, value, hit)
        if (value > own) then
          if (trial > place) left = place
          if (trial < place) right = place
          place = trial
          own = value
          facet = hit
        else if (trial > place) then
          right = trial
        else
          left = trial
        end if
      end do
    end subroutine deepen

    !> Depth of a point of a segment that nothing explains; 0 where it is explained.
    subroutine segment_depth(nodes, place, own, facet)
      !> Ends of the segment.
      integer, intent(in) :: nodes(2)
      !> Place, from 0 to 1 [].
      real(dp), intent(in) :: place
      !> Depth [length].
      real(dp), intent(out) :: own
      !> Facet of the closest point.
      integer, intent(out) :: facet
      real(dp) :: x(3), u(3), xi(2), rough(2)
      integer :: k
      x = (1 - place)*a%x(:, nodes(1)) + place*a%x(:, nodes(2))
      u = x - (1 - place)*a%x0(:, nodes(1)) - place*a%x0(:, nodes(2))
      call b%depth_of(x, 0, own, facet, xi)
      if (.not. own > slack + b%roughness(facet)) then
        own = 0
        return
      end if
      rough = [(a%node_roughness(nodes(k), -b%normal(:, facet)), k=1, 2)]
      k = merge(nodes(1), nodes(2), rough(1) > rough(2))
      if (own > slack + maxval(explained_a(nodes)) + b%roughness(facet) + maxval(rough) + &
          most_explained(b, facet, explained_b) + &
          second_order(a, k, b, facet, xi, u)) return
      own = 0
    end subroutine segment_depth
  end subroutine find_edges
end module dotyk_contact_penetration_search
