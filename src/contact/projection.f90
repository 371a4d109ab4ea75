!> Projection on a surface: the partner of a contact point (DESIGN.md, section 4).
!>
!> The closest point x' is looked for among the facets that face the point. Where it lies on an edge or at a corner,
!> the facets there that face the point count as one surface; where that surface ends, x has to project inside it. The
!> facet is then the one that faces best, the lowest number of equal ones.
!>
!> Signs: `normal` n points from body a into body b, n = -n_b(x'), and the distance d = n.(x' - x) is negative where
!> the bodies overlap. On an edge between two facets n_b(x') is the direction between their normals that x lies in:
!> then x - x' and n are parallel everywhere, and the moments of the forces on the two sides cancel exactly.
module dotyk_contact_projection
  use dotyk_base_kinds, only: dp
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_closest_point, only: closest_point_on_facet, edges_at
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t, facing_cosine, nearest_facet
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> A surface that points are projected on.
  type, public :: master_surface_t
    !> Its facets.
    type(facet_set_t) :: set
    !> Their tree.
    type(bounding_volume_tree_t) :: tree
    !> Their neighbours.
    type(adjacency_t) :: adjacency
  contains
    procedure :: init => target_init
    procedure :: smallest_distance
  end type master_surface_t

  !> What became of a point.
  integer, parameter, public :: projection_found = 0       !< it has a partner
  integer, parameter, public :: projection_not_facing = 1  !< no facet faces it
  integer, parameter, public :: projection_outside = 2     !< it projects beside the surface
  integer, parameter, public :: projection_too_far = 3     !< farther than search_radius

  !> The partner of a point.
  type, public :: projection_t
    !> One of the constants above.
    integer :: status = projection_not_facing
    !> Facet of the surface.
    integer :: facet = 0
    !> Reference coordinates on it (2).
    real(dp) :: xi(2) = 0
    !> Position x' (3) [length].
    real(dp) :: position(3) = 0
    !> Unit vector from body a into body b (3).
    real(dp) :: normal(3) = 0
    !> Signed distance n.(x' - x) [length].
    real(dp) :: distance = 0
  end type projection_t

  public :: project_point

  !> A point this near to an edge lies on it, relative to the facet's size (DESIGN.md, section 4).
  real(dp), parameter :: edge_tolerance = 1e-8_dp
  !> Closest points of two facets that share an edge are the same when nearer than this, relative to the facet's size.
  real(dp), parameter :: same_point = 1e-6_dp
  !> Facets at one corner that are looked at.
  integer, parameter :: most_around = 64

contains

  !> Prepare a surface.
  subroutine target_init(self, x, surface)
    class(master_surface_t), intent(out) :: self
    !> Nodal coordinates of the body (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> The surface.
    type(surface_t), intent(in) :: surface
    call self%set%init(x, surface)
    call self%tree%init(self%set)
    call self%adjacency%init(self%set)
  end subroutine target_init

  !> Find the partner of a point.
  pure subroutine project_point(self, x, normal_a, hint, search_radius, partner)
    type(master_surface_t), intent(in) :: self
    !> The point (3) [length].
    real(dp), intent(in) :: x(3)
    !> Outward normal of body a there (3).
    real(dp), intent(in) :: normal_a(3)
    !> A facet that is probably near, 0 if none; the nearest facet on return.
    integer, intent(inout) :: hint
    !> Greatest distance [length].
    real(dp), intent(in) :: search_radius
    !> The partner.
    type(projection_t), intent(out) :: partner
    real(dp) :: square, normal(3), r(3), xu(3), xv(3)
    integer :: facet, n_edges, edges(2)
    logical :: inside, ridge
    call nearest_facet(self%tree, self%set, x, -normal_a, .false., hint, facet, partner%xi, square)
    if (facet == 0) return
    hint = facet
    call facet_position_and_normal(self%set, facet, partner%xi, partner%position, normal, xu, xv)
    inside = .true.
    ridge = .false.
    call edges_at(self%set%corners(facet), partner%xi, edge_tolerance, n_edges, edges)
    if (n_edges > 0) call settle_on_edge(self, x, normal_a, n_edges, edges, facet, partner%xi, &
                                         partner%position, normal, ridge, inside)
    partner%facet = facet
    r = x - partner%position
    call align(r, self%set%size(facet), ridge, normal)
    partner%normal = -normal
    partner%distance = dot_product(normal, r)
    if (.not. inside) then
      partner%status = projection_outside
    else if (abs(partner%distance) > search_radius) then
      partner%status = projection_too_far
    else
      partner%status = projection_found
    end if
  end subroutine project_point

  !> Choose among the facets around a point of an edge or corner, and find out whether x really projects inside their
  !> union.
  pure subroutine settle_on_edge(self, x, normal_a, n_edges, edges, facet, xi, position, normal, ridge, inside)
    type(master_surface_t), intent(in) :: self
    !> The point, and the normal of body a there (3).
    real(dp), intent(in) :: x(3), normal_a(3)
    !> The edges of the facet that its closest point lies on.
    integer, intent(in) :: n_edges, edges(2)
    !> Facet with reference coordinates, position and normal of the closest point, before and after.
    integer, intent(inout) :: facet
    real(dp), intent(inout) :: xi(2), position(3), normal(3)
    !> More than one facet faces x there.
    logical, intent(out) :: ridge
    !> x projects inside.
    logical, intent(out) :: inside
    integer :: around(most_around), kept(most_around), n_around, n_kept, i, k, other, n_on, on(2), best
    real(dp) :: its_xi(2, most_around), its_position(3, most_around), its_normal(3, most_around), facing(most_around)
    real(dp) :: xu(3, most_around), xv(3, most_around), square
    real(dp) :: its_closest(2), closest(3), dummy(3), dummy_u(3), dummy_v(3)
    call facets_around(self%adjacency, self%set%corners(facet), facet, n_edges, edges, n_around, around)
    n_kept = 0
    inside = .true.
    do i = 1, n_around
      k = n_kept + 1
      if (around(i) == facet) then
        its_xi(:, k) = xi
      else
        call closest_point_on_facet(self%set, around(i), position, its_xi(:, k), square)
        if (square > (edge_tolerance*self%set%size(around(i)))**2) cycle
      end if
      call facet_position_and_normal(self%set, around(i), its_xi(:, k), its_position(:, k), its_normal(:, k), &
                                     xu(:, k), xv(:, k))
      facing(k) = -dot_product(its_normal(:, k), normal_a)
      if (.not. facing(k) > facing_cosine) cycle
      kept(k) = around(i)
      n_kept = k
      ! A curved facet may face x on its edge and not at its closest point, where it was passed over: that is beside.
      if (around(i) == facet) cycle
      call closest_point_on_facet(self%set, around(i), x, its_closest, square)
      call facet_position_and_normal(self%set, around(i), its_closest, closest, dummy, dummy_u, dummy_v)
      if (norm2(closest - position) > same_point*self%set%size(around(i))) inside = .false.
    end do
    ridge = n_kept > 1
    best = 1
    do i = 1, n_kept
      if (facing(i) > facing(best) + 1e-10_dp) best = i   ! around(:) ascends: the lowest number of equal ones stays
      call edges_at(self%set%corners(kept(i)), its_xi(:, i), 2*edge_tolerance, n_on, on)
      do k = 1, n_on
        other = self%adjacency%neighbour(on(k), kept(i))
        if (other > 0) then
          if (any(kept(1:n_kept) == other)) cycle
        end if
        if (dot_product(x - position, outward(self%set%corners(kept(i)), on(k), xu(:, i), xv(:, i), its_normal(:, i))) &
            > edge_tolerance*self%set%size(kept(i))) inside = .false.
      end do
    end do
    if (n_kept == 0) return
    facet = kept(best)
    xi = its_xi(:, best)
    position = its_position(:, best)
    normal = its_normal(:, best)
  end subroutine settle_on_edge

  !> The facets that share the edge or the corner that a closest point lies on, ascending, the facet itself included.
  pure subroutine facets_around(adjacency, corners, facet, n_edges, edges, n, around)
    type(adjacency_t), intent(in) :: adjacency
    !> Corners of the facet, the facet, and its edges that contain the point.
    integer, intent(in) :: corners, facet, n_edges, edges(2)
    !> Number of facets.
    integer, intent(out) :: n
    integer, intent(out) :: around(most_around)
    integer :: corner, other, vertex
    around = 0
    if (n_edges == 1) then
      other = adjacency%neighbour(edges(1), facet)
      if (other == 0) then
        n = 1
        around(1) = facet
      else
        n = 2
        around(1:2) = [min(facet, other), max(facet, other)]
      end if
    else
      ! Edges i and i+1 meet at corner i+1, the first and the last one at corner 1.
      corner = edges(2)
      if (edges(1) == 1 .and. edges(2) == corners) corner = 1
      vertex = adjacency%vertex(corner, facet)
      n = min(most_around, adjacency%start(vertex + 1) - adjacency%start(vertex))
      around(1:n) = adjacency%facet(adjacency%start(vertex):adjacency%start(vertex) + n - 1)
    end if
  end subroutine facets_around

  !> Unit vector in the tangent plane that points out of a facet across an edge.
  pure function outward(corners, edge, xu, xv, normal) result(m)
    integer, intent(in) :: corners, edge
    !> Tangents and unit normal (3).
    real(dp), intent(in) :: xu(3), xv(3), normal(3)
    real(dp) :: m(3)
    real(dp) :: t(3)
    if (corners == 2) then
      m = merge(-xu, xu, edge == 1)
    else
      if (corners == 3) then
        if (edge == 1) then
          t = xu
        else if (edge == 2) then
          t = xv - xu
        else
          t = -xv
        end if
      else
        if (edge == 1) then
          t = xu
        else if (edge == 2) then
          t = xv
        else if (edge == 3) then
          t = -xu
        else
          t = -xv
        end if
      end if
      m = [t(2)*normal(3) - t(3)*normal(2), t(3)*normal(1) - t(1)*normal(3), t(1)*normal(2) - t(2)*normal(1)]
    end if
    m = m/max(norm2(m), tiny(1.0_dp))
  end function outward

  !> Turn the normal of a point on an edge into the direction of x - x', which lies between the normals of the facets
  !> there. Nothing happens where x - x' is parallel to the normal already, or too short to have a direction.
  pure subroutine align(r, size, ridge, normal)
    !> x - x' (3) [length].
    real(dp), intent(in) :: r(3)
    !> Size of the facet [length].
    real(dp), intent(in) :: size
    !> On an edge between facets that face x; elsewhere only small angles are taken.
    logical, intent(in) :: ridge
    !> Normal of body b (3).
    real(dp), intent(inout) :: normal(3)
    real(dp) :: along, across, length
    along = dot_product(r, normal)
    across = norm2(r - along*normal)
    if (across <= 1e-10_dp*size) return
    length = norm2(r)
    if (across > 1e-3_dp*length .and. .not. ridge) return
    if (abs(along) < 0.3_dp*length) return
    normal = sign(1.0_dp, along)*r/length
  end subroutine align

  !> Distance of a point to the surface, whatever its normals [length].
  pure real(dp) function smallest_distance(self, x) result(distance)
    class(master_surface_t), intent(in) :: self
    !> The point (3) [length].
    real(dp), intent(in) :: x(3)
    real(dp) :: xi(2), square
    integer :: facet
    call nearest_facet(self%tree, self%set, x, [0.0_dp, 0.0_dp, 1.0_dp], .true., 0, facet, xi, square)
    distance = sqrt(square)
  end function smallest_distance
end module dotyk_contact_projection
