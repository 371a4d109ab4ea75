!> Penetration of one part into another after deformation: nodes of the one below the boundary of the other, and edges
!> that pass through it without a node inside.
!>
!> A depth counts where it exceeds what is explained (penetration_tolerance.f90). Of the depths that are explained, the
!> deepest that is a notable part of the displacements is kept.
module dotyk_contact_penetration_search
  use dotyk_base_kinds, only: dp
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_crossing, only: crossings, max_crossings
  use dotyk_contact_facet_set, only: facet_position_and_normal
  use dotyk_contact_passage_search, only: find_passage, passage_t, swept_facets_t
  use dotyk_contact_penetration_tolerance, only: notable_fraction, penetration_tolerance_t
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
    !> Nodes that have passed through the other part and are outside again.
    integer :: n_passed = 0
    !> Deepest point that is explained, though it is a notable part of the displacements; 0 if there is none [length].
    real(dp) :: unresolved = 0
    !> Its position after deformation (3) [length].
    real(dp) :: unresolved_position(3) = 0
  contains
    procedure :: keep_unresolved => penetration_keep_unresolved
    procedure :: outweighs => penetration_outweighs
  end type penetration_t

  public :: find_penetration, find_passages

  !> Two faces are flush before deformation where the angle of their normals has at least this cosine, and the distance
  !> is below this fraction of the size of the facet.
  real(dp), parameter :: flush_cosine = 0.999_dp, flush_distance = 1.0e-6_dp
  !> Points along the part of an edge that is inside, and steps of the search for the deepest one.
  integer, parameter :: n_samples = 3, n_steps = 30
  !> Nodes or facets that a thread takes at once, and the number from which on threads share them.
  integer, parameter :: chunk = 256, least_shared = 1024
  !> Depths that differ by less, relative to them, are the same.
  real(dp), parameter :: same_depth = 1.0e-9_dp
  !> Golden section.
  real(dp), parameter :: golden = 0.381966011250105_dp

contains

  !> Whether a penetration is deeper than another one, or as deep but for rounding, and with more nodes.
  pure logical function penetration_outweighs(self, other) result(outweighs)
    class(penetration_t), intent(in) :: self
    !> The other one.
    class(penetration_t), intent(in) :: other
    outweighs = self%depth > (1 + same_depth)*other%depth
    if (outweighs .or. self%depth < (1 - same_depth)*other%depth) return
    outweighs = self%n_nodes + self%n_passed > other%n_nodes + other%n_passed
  end function penetration_outweighs

  !> Keep the deeper one of the points that are explained.
  pure subroutine penetration_keep_unresolved(self, depth, position)
    class(penetration_t), intent(inout) :: self
    !> Depth of a point [length].
    real(dp), intent(in) :: depth
    !> Its position after deformation (3) [length].
    real(dp), intent(in) :: position(3)
    if (.not. depth > (1 + same_depth)*self%unresolved) return
    self%unresolved = depth
    self%unresolved_position = position
  end subroutine penetration_keep_unresolved

  !> Depth of a part below the boundary of another one.
  subroutine find_penetration(a, b, tolerance, depth, worst)
    !> The part.
    type(solid_t), intent(in) :: a
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Depths that are explained.
    type(penetration_tolerance_t), intent(in) :: tolerance
    !> Depth of each node that is too deep, or at an edge that is; 0 elsewhere (a%n_nodes) [length].
    real(dp), allocatable, intent(out) :: depth(:)
    !> The deepest point.
    type(penetration_t), intent(out) :: worst
    logical :: is_below(a%n_nodes)
    real(dp) :: unresolved(a%n_nodes)
    integer :: i, hint
    allocate (depth(a%n_nodes))
    !$omp parallel default(none) shared(a, b, tolerance, depth, is_below, unresolved) private(hint) &
    !$omp& if (a%n_nodes > least_shared)
    hint = 0
    !$omp do schedule(dynamic, chunk)
    do i = 1, a%n_nodes
      call find_node_depth(a, b, i, tolerance, hint, is_below(i), depth(i), unresolved(i))
    end do
    !$omp end do
    !$omp end parallel
    do i = 1, a%n_nodes
      if (unresolved(i) > 0) call worst%keep_unresolved(unresolved(i), a%x(:, i))
      if (.not. depth(i) > 0) cycle
      worst%n_nodes = worst%n_nodes + 1
      if (depth(i) <= (1 + same_depth)*worst%depth) cycle
      worst%depth = depth(i)
      worst%position = a%x(:, i)
    end do
    call find_edges(a, b, tolerance, is_below, depth > 0, depth, worst)
  end subroutine find_penetration

  !> Nodes of a part that have passed wholly through another one.
  subroutine find_passages(a, b, swept, tolerance, depth, worst)
    !> The part.
    type(solid_t), intent(in) :: a
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Facets of the other part in motion.
    type(swept_facets_t), intent(in) :: swept
    !> Depths that are explained.
    type(penetration_tolerance_t), intent(in) :: tolerance
    !> Depth of each node; that of nodes that have passed through the other part is added, the distance from the face
    !> that they entered through (a%n_nodes) [length].
    real(dp), intent(inout) :: depth(:)
    !> The deepest point; nodes are added.
    type(penetration_t), intent(inout) :: worst
    type(passage_t) :: passage
    real(dp) :: allowed, centre(2)
    integer :: i
    !$omp parallel do default(none) private(passage, allowed, centre) shared(a, b, swept, tolerance, depth) &
    !$omp& schedule(dynamic, chunk) if (a%n_nodes > least_shared)
    do i = 1, a%n_nodes
      if (depth(i) > 0) cycle
      call find_passage(b, swept, a%x0(:, i), a%x(:, i), tolerance%slack, passage)
      if (passage%facet == 0) cycle
      centre = merge(1/3.0_dp, 0.0_dp, b%set%corners(passage%facet) == 3)
      allowed = tolerance%depth_allowed(a, [i], b, passage%facet, centre, a%x(:, i) - a%x0(:, i))
      if (passage%through > allowed) depth(i) = -passage%depth
    end do
    !$omp end parallel do
    do i = 1, a%n_nodes
      if (.not. depth(i) < 0) cycle
      depth(i) = -depth(i)
      worst%n_passed = worst%n_passed + 1
      if (depth(i) <= (1 + same_depth)*worst%depth) cycle
      worst%depth = depth(i)
      worst%position = a%x(:, i)
    end do
  end subroutine find_passages

  !> Depth of a node that nothing explains; 0 where it is explained [length].
  pure subroutine find_node_depth(a, b, i, tolerance, hint, is_below, depth, unresolved)
    !> The part.
    type(solid_t), intent(in) :: a
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Node of the part.
    integer, intent(in) :: i
    !> Depths that are explained.
    type(penetration_tolerance_t), intent(in) :: tolerance
    !> Facet that is probably near, that of the last node; 0 for none.
    integer, intent(inout) :: hint
    !> Whether the node is below the boundary, explained or not.
    logical, intent(out) :: is_below
    !> Depth [length].
    real(dp), intent(out) :: depth
    !> Depth if it is explained, though notable; else 0 [length].
    real(dp), intent(out) :: unresolved
    real(dp) :: xi(2)
    integer :: facet
    is_below = .false.
    depth = 0
    unresolved = 0
    if (is_outside_box(b, a%x(:, i), tolerance%slack)) return
    call b%depth_of(a%x(:, i), hint, depth, facet, xi)
    hint = facet
    if (depth < -tolerance%slack) then
      depth = 0
      return
    end if
    if (is_flush(a, i, b, facet)) call depth_beside_flush(a, i, b, depth, facet, xi)
    is_below = depth > tolerance%slack
    call tolerance%keep_unexplained(a, [i], b, facet, xi, a%x(:, i), a%x(:, i) - a%x0(:, i), depth, unresolved)
  end subroutine find_node_depth

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

  !> Edges that pass through another part, or run inside it between two nodes that are explained.
  subroutine find_edges(a, b, tolerance, is_below, inside, depth, worst)
    !> The part.
    type(solid_t), intent(in) :: a
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Depths that are explained.
    type(penetration_tolerance_t), intent(in) :: tolerance
    !> Nodes below the boundary (a%n_nodes).
    logical, intent(in) :: is_below(:)
    !> Nodes that are too deep (a%n_nodes).
    logical, intent(in) :: inside(:)
    !> Depth of each node that is too deep, or at an edge that is (a%n_nodes) [length].
    real(dp), intent(inout) :: depth(:)
    !> The deepest point.
    type(penetration_t), intent(inout) :: worst
    integer :: f, e, n, other, corners, ends(3)
    n = a%set%n
    !$omp parallel do default(none) private(e, other, corners, ends) schedule(dynamic, chunk) &
    !$omp& shared(a, b, tolerance, is_below, inside, depth, worst, n) if (n > least_shared)
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
      real(dp) :: s(max_crossings), deepest, place, own, at, length, unresolved, coarse, coarse_at(3)
      integer :: k, n_crossings, facet, j
      logical :: enters(max_crossings), is_inside
      call crossings(b, a%x(:, nodes(1)), a%x(:, nodes(2)), tolerance%slack, n_crossings, s, enters)
      if (n_crossings == 0 .and. .not. all(is_below(nodes))) return
      length = norm2(a%x(:, nodes(2)) - a%x(:, nodes(1)))
      deepest = 0
      coarse = 0
      coarse_at = 0
      facet = 0
      do k = 0, n_crossings
        associate (low => merge(0.0_dp, s(max(k, 1)), k == 0), &
                   high => merge(1.0_dp, s(min(k + 1, size(s))), k == n_crossings))
          is_inside = n_crossings == 0
          if (k > 0) is_inside = enters(k)
          if (k < n_crossings) is_inside = is_inside .or. .not. enters(k + 1)
          ! No point is deeper than it is far from a crossing.
          if (.not. is_inside .or. (high - low)*length <= tolerance%slack) cycle
          do j = 1, n_samples
            place = low + (high - low)*j/(n_samples + 1)
            call segment_depth(nodes, place, own, unresolved, facet)
            if (unresolved > coarse) then
              coarse = unresolved
              coarse_at = (1 - place)*a%x(:, nodes(1)) + place*a%x(:, nodes(2))
            end if
            if (.not. own > deepest) cycle
            call deepen(nodes, low, high, place, own, facet)
            deepest = own
            at = place
          end do
        end associate
      end do
      ! Where both ends are explained, a small part of the displacements is left by the mesh.
      if (n_crossings == 0 .and. deepest <= notable_fraction*tolerance%moved) deepest = 0
      if (.not. max(deepest, coarse) > 0) return
      !$omp critical (penetration)
      call worst%keep_unresolved(coarse, coarse_at)
      ! A node inside says it already.
      if (deepest > 0 .and. .not. any(inside(nodes))) then
        worst%n_edges = worst%n_edges + 1
        depth(nodes) = max(depth(nodes), deepest)
      end if
      if (deepest > (1 + same_depth)*worst%depth) then
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
      real(dp) :: left, right, trial, value, unresolved
      integer :: step, hit
      hit = facet
      left = low
      right = high
      do step = 1, n_steps
        trial = merge(place + golden*(right - place), place - golden*(place - left), right - place > place - left)
        call segment_depth(nodes, trial, value, unresolved, hit)
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
    subroutine segment_depth(nodes, place, own, unresolved, facet)
      !> Ends of the segment.
      integer, intent(in) :: nodes(2)
      !> Place, from 0 to 1 [].
      real(dp), intent(in) :: place
      !> Depth [length].
      real(dp), intent(out) :: own
      !> Depth if it is explained, though notable; else 0 [length].
      real(dp), intent(out) :: unresolved
      !> Facet of the closest point; on entry one that is probably near, or 0.
      integer, intent(inout) :: facet
      real(dp) :: x(3), u(3), xi(2)
      integer :: hint
      x = (1 - place)*a%x(:, nodes(1)) + place*a%x(:, nodes(2))
      u = x - (1 - place)*a%x0(:, nodes(1)) - place*a%x0(:, nodes(2))
      hint = facet
      call b%depth_of(x, hint, own, facet, xi)
      call tolerance%keep_unexplained(a, nodes, b, facet, xi, x, u, own, unresolved)
    end subroutine segment_depth
  end subroutine find_edges
end module dotyk_contact_penetration_search
