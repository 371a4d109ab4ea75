!> Depths of one part in another that are explained: by contact pairs, by facets that cannot resolve more, by terms of
!> second order in the displacements, which small-displacement theory omits, and by rounding.
module dotyk_contact_penetration_tolerance
  use dotyk_base_kinds, only: dp
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_set, only: facet_position_and_normal
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_mesh_element, only: kind_nodes
  implicit none
  private

  !> What is known of two parts, a and b.
  type, public :: penetration_tolerance_t
    !> Error of the displacements and of rounding [length].
    real(dp) :: slack = 0
    !> Penetration that contact pairs of the two leave at the nodes of a (a%n_nodes) [length].
    real(dp), allocatable :: explained_a(:)
    !> The same at the nodes of b (b%n_nodes) [length].
    real(dp), allocatable :: explained_b(:)
    !> Largest displacement of the two beside their common rigid motion [length].
    real(dp) :: moved = 0
  contains
    procedure :: swapped => tolerance_swapped
    procedure :: depth_allowed => tolerance_depth_allowed
    procedure :: keep_unexplained => tolerance_keep_unexplained
  end type penetration_tolerance_t

  !> Depths that the contact conditions leave are notable from this fraction of the displacements on [].
  real(dp), parameter, public :: notable_fraction = 0.25_dp
  !> Distances that differ by less are equal [].
  real(dp), parameter :: same = 1.0e-6_dp

contains

  !> The same for b and a.
  pure type(penetration_tolerance_t) function tolerance_swapped(self) result(swapped)
    class(penetration_tolerance_t), intent(in) :: self
    swapped%slack = self%slack
    swapped%moved = self%moved
    allocate (swapped%explained_a, source=self%explained_b)
    allocate (swapped%explained_b, source=self%explained_a)
  end function tolerance_swapped

  !> Depth of a point of a below a facet of b that is explained [length].
  pure real(dp) function tolerance_depth_allowed(self, a, nodes, b, facet, xi, displacement) result(allowed)
    class(penetration_tolerance_t), intent(in) :: self
    !> The part of the point.
    type(solid_t), intent(in) :: a
    !> The node, or the nodes that the point lies between (n).
    integer, intent(in) :: nodes(:)
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Its facet that is nearest.
    integer, intent(in) :: facet
    !> Reference coordinates of the closest point (2) [].
    real(dp), intent(in) :: xi(2)
    !> Displacement of the point (3) [length].
    real(dp), intent(in) :: displacement(3)
    real(dp) :: rough, trial
    integer :: k, roughest
    rough = -1
    roughest = nodes(1)
    do k = 1, size(nodes)
      trial = a%node_roughness(nodes(k), -b%normal(:, facet))
      if (trial > rough) roughest = nodes(k)
      rough = max(rough, trial)
    end do
    allowed = self%slack + rough + b%roughness(facet) + left_by_pairs(self, nodes, b, facet) + &
              second_order(a, roughest, b, facet, displacement - b%displacement_at(facet, xi))
  end function tolerance_depth_allowed

  !> Set a depth to 0 that is explained, but keep it where it is notable. At an edge, the facets beside the nearest one
  !> may explain it: those of a shank below its head, or of a bore below its rim.
  pure subroutine tolerance_keep_unexplained(self, a, nodes, b, facet, xi, x, displacement, depth, unresolved)
    class(penetration_tolerance_t), intent(in) :: self
    !> The part of the point.
    type(solid_t), intent(in) :: a
    !> The node, or the nodes that the point lies between (n).
    integer, intent(in) :: nodes(:)
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Its facet that is nearest.
    integer, intent(in) :: facet
    !> Reference coordinates of the closest point (2) [].
    real(dp), intent(in) :: xi(2)
    !> The point after deformation (3) [length].
    real(dp), intent(in) :: x(3)
    !> Its displacement (3) [length].
    real(dp), intent(in) :: displacement(3)
    !> Depth; 0 on return if it is explained [length].
    real(dp), intent(inout) :: depth
    !> Depth if it is explained, though notable; else 0 [length].
    real(dp), intent(out) :: unresolved
    real(dp) :: below, xi_g(2), square
    integer :: g, i, k, v
    logical :: is_explained
    unresolved = 0
    depth = max(0.0_dp, depth)
    if (.not. depth > 0) return
    is_explained = is_explained_by(facet, xi, depth)
    if (is_explained) then
      if (.not. is_notable(self, a, nodes, b, facet, xi, x, displacement, depth)) then
        depth = 0
        return
      end if
    end if
    do i = 1, b%set%corners(facet)
      v = b%adjacency%vertex(i, facet)
      do k = b%adjacency%start(v), b%adjacency%start(v + 1) - 1
        g = b%adjacency%facet(k)
        if (g == facet) cycle
        call closest_point_on_facet(b%set, g, x, xi_g, square)
        below = sqrt(square)
        ! A nearer one is flush with the first part, such as that on a plane of symmetry.
        if (below < (1 - same)*depth) cycle
        if (.not. is_explained_by(g, xi_g, below)) cycle
        is_explained = .true.
        if (is_notable(self, a, nodes, b, g, xi_g, x, displacement, below)) cycle
        depth = 0
        return
      end do
    end do
    if (.not. is_explained) return
    unresolved = depth
    depth = 0

  contains

    !> Whether a facet explains that the point is below it.
    pure logical function is_explained_by(other, at, distance)
      !> Facet of b.
      integer, intent(in) :: other
      !> Reference coordinates of its closest point (2) [].
      real(dp), intent(in) :: at(2)
      !> Distance [length].
      real(dp), intent(in) :: distance
      is_explained_by = .not. distance > self%slack + b%roughness(other)
      if (.not. is_explained_by) is_explained_by = &
        .not. distance > self%depth_allowed(a, nodes, b, other, at, displacement)
    end function is_explained_by
  end subroutine tolerance_keep_unexplained

  !> Whether a depth is a notable part of what the two bodies move and overlap, beside what contact pairs leave and
  !> what facets overlap before deformation: the mesh does not resolve the contact there.
  pure logical function is_notable(tolerance, a, nodes, b, facet, xi, x, displacement, depth) result(notable)
    !> Depths that are explained.
    type(penetration_tolerance_t), intent(in) :: tolerance
    !> The part of the point.
    type(solid_t), intent(in) :: a
    !> The node, or the nodes that the point lies between (n).
    integer, intent(in) :: nodes(:)
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Its facet that is nearest.
    integer, intent(in) :: facet
    !> Reference coordinates of the closest point (2) [].
    real(dp), intent(in) :: xi(2)
    !> The point after deformation (3) [length].
    real(dp), intent(in) :: x(3)
    !> Its displacement (3) [length].
    real(dp), intent(in) :: displacement(3)
    !> Its depth [length].
    real(dp), intent(in) :: depth
    real(dp) :: before, round, excess, position(3), normal(3), xu(3), xv(3)
    integer :: i, k
    excess = depth - tolerance%slack
    notable = .false.
    if (.not. excess > notable_fraction*tolerance%moved) return
    excess = excess - left_by_pairs(tolerance, nodes, b, facet)
    if (.not. excess > notable_fraction*tolerance%moved) return
    ! Facets of round bodies overlap where the bodies only touch.
    round = round_off(b, facet)
    do i = 1, size(nodes)
      do k = a%first(nodes(i)), a%first(nodes(i) + 1) - 1
        round = max(round, round_off(b, facet) + round_off(a, a%around(k)))
      end do
    end do
    call facet_position_and_normal(b%set, facet, xi, position, normal, xu, xv)
    position = position - b%displacement_at(facet, xi) - (x - displacement)
    before = max(0.0_dp, dot_product(position, b%normal0(:, facet)))
    notable = excess - min(before, round) > notable_fraction*(tolerance%moved + before)
  end function is_notable

  !> Twice the height of the arc over a facet before deformation [length].
  pure real(dp) function round_off(part, facet)
    !> The part.
    type(solid_t), intent(in) :: part
    !> Its facet.
    integer, intent(in) :: facet
    round_off = part%curvature(facet)*part%set%size(facet)**2/4
  end function round_off

  !> Penetration that contact pairs leave at nodes of one part and at a facet of the other [length].
  pure real(dp) function left_by_pairs(tolerance, nodes, b, facet) result(left)
    !> Depths that are explained.
    type(penetration_tolerance_t), intent(in) :: tolerance
    !> Nodes of the first part (n).
    integer, intent(in) :: nodes(:)
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Its facet.
    integer, intent(in) :: facet
    left = maxval(tolerance%explained_a(nodes)) + &
           maxval(tolerance%explained_b(b%surface%node(1:kind_nodes(b%surface%kind(facet)), facet)))
  end function left_by_pairs

  !> Change of a gap by terms of second order: a relative displacement s along one of the surfaces, whose curvatures add
  !> up to k and whose normals turn by r together, changes the gap by s r + k s^2/2 [length].
  pure real(dp) function second_order(a, i, b, facet, s) result(change)
    !> The part.
    type(solid_t), intent(in) :: a
    !> Its node that is nearest.
    integer, intent(in) :: i
    !> The other part.
    type(solid_t), intent(in) :: b
    !> Facet of the closest point.
    integer, intent(in) :: facet
    !> Relative displacement (3) [length].
    real(dp), intent(in) :: s(3)
    real(dp) :: slip, turn, curvature
    integer :: k
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
end module dotyk_contact_penetration_tolerance
