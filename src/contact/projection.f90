!> Closest-point projection of points of the slave surface on the master surface.
!>
!> The closest point x' is searched among the facets that face the point. Where it lies on an edge or at a corner, the
!> facets there that face the point count as one surface; at the boundary of that surface x has to project inside it.
!> The projection belongs to the facet that faces best, the lowest number of equal ones.
!>
!> Signs: `normal` n points from body a into body b, n = -n_b(x'), and the distance d = n.(x' - x) is negative where the
!> bodies overlap. On an edge between two facets n_b(x') is the direction between their normals in which x lies: x - x'
!> and n are parallel everywhere, and the moments of the forces on the two sides cancel exactly.
module dotyk_contact_projection
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: no_offset, same_place, shape_rounding
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t, facing_cosine
  use dotyk_contact_closest_point, only: closest_point_on_facet, edges_at
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_tree_search, only: nearest_facet
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: master_surface_t  !! Master surface, prepared for projections.
    type(facet_set_t) :: set  !! Facets.
    type(bounding_volume_tree_t) :: tree  !! Bounding-volume tree of the facets.
    type(adjacency_t) :: adjacency  !! Neighbours of the facets.
  contains
    procedure :: init => master_surface_init
    procedure :: smallest_distance
  end type master_surface_t

  integer, parameter, public :: projection_found = 0       !< the point has a projection
  integer, parameter, public :: projection_not_facing = 1  !< no facet faces the point
  integer, parameter, public :: projection_outside = 2     !< the point projects beside the surface
  integer, parameter, public :: projection_too_far = 3     !< the distance exceeds the search radius

  type, public :: projection_t  !! Projection of a point of the slave surface on the master surface.
    integer :: status = projection_not_facing  !! One of the constants `projection_*`.
    integer :: facet = 0  !! Master facet.
    real(dp) :: xi(2) = 0  !! Reference coordinates of x' on it (2) [].
    real(dp) :: position(3) = 0  !! Position of x' (3) [length].
    real(dp) :: normal(3) = 0  !! Unit normal n from body a into body b (3) [].
    real(dp) :: distance = 0  !! Signed distance n.(x' - x) [length].
    real(dp) :: bend = 0  !! What was taken off it, as nothing bends the facet [length].
    real(dp) :: curved = 0  !! What of that part it still has [length].
    real(dp) :: uncertainty = 0  !! How uncertain it is [length].
  end type projection_t

  public :: project_point

  integer, parameter :: max_around = 64  !! Greatest number of facets at one corner that are considered.
  !> Away from edges between facets the normal is corrected by no more than this angle [rad].
  real(dp), parameter :: max_correction = 1.0e-3_dp
  !> On an edge the normal is x - x' where its angle to the facet normal has a larger cosine than this.
  real(dp), parameter :: min_alignment = 0.3_dp

contains

  !> Prepare a surface.
  subroutine master_surface_init(self, x, surface)
    class(master_surface_t), intent(out) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    call self%set%init(x, surface)
    call self%tree%init(self%set)
    call self%adjacency%init(self%set)
  end subroutine master_surface_init

  !> Project a point.
  pure subroutine project_point(self, x, normal_a, hint, search_radius, max_depth, projection)
    type(master_surface_t), intent(in) :: self  !! The master surface.
    real(dp), intent(in) :: x(3)  !! Point of the slave surface (3) [length].
    real(dp), intent(in) :: normal_a(3)  !! Outward normal of body a there (3) [].
    integer, intent(inout) :: hint  !! A facet that is probably near, 0 if none; the nearest facet on return.
    real(dp), intent(in) :: search_radius  !! Search radius: greatest distance of a projection [length].
    real(dp), intent(in) :: max_depth  !! Thickness of body a there: greatest depth of an overlap [length].
    type(projection_t), intent(out) :: projection  !! Projection.
    real(dp) :: square, normal(3), r(3), xu(3), xv(3)
    integer :: facet, n_edges, edges(2)
    logical :: inside, ridge
    call nearest_facet(self%tree, self%set, x, -normal_a, .false., max_depth, hint, facet, projection%xi, square)
    if (facet == 0) return
    hint = facet
    call facet_position_and_normal(self%set, facet, projection%xi, projection%position, normal, xu, xv)
    inside = .true.
    ridge = .false.
    call edges_at(self%set%corners(facet), projection%xi, no_offset, n_edges, edges)
    if (n_edges > 0) &
      call resolve_edge(self, x, normal_a, n_edges, edges, facet, projection%xi, projection%position, normal, ridge, &
                        inside)
    projection%facet = facet
    r = x - projection%position
    call align_normal(r, self%set%size(facet), ridge, normal)
    projection%normal = -normal
    projection%distance = dot_product(normal, r)
    if (.not. inside) then
      projection%status = projection_outside
    else if (abs(projection%distance) > search_radius) then
      projection%status = projection_too_far
    else
      projection%status = projection_found
    end if
  end subroutine project_point

  !> Choose among the facets around a closest point on an edge or at a corner, and find out whether x projects inside
  !> their union.
  pure subroutine resolve_edge(self, x, normal_a, n_edges, edges, facet, xi, position, normal, ridge, inside)
    type(master_surface_t), intent(in) :: self  !! The master surface.
    real(dp), intent(in) :: x(3)  !! Point of the slave surface (3) [length].
    real(dp), intent(in) :: normal_a(3)  !! Outward normal of body a there (3) [].
    integer, intent(in) :: n_edges  !! Number of edges of the facet that contain the closest point, 1 or 2.
    integer, intent(in) :: edges(2)  !! These edges (2).
    integer, intent(inout) :: facet  !! Facet of the closest point, before and after.
    real(dp), intent(inout) :: xi(2)  !! Its reference coordinates (2) [].
    real(dp), intent(inout) :: position(3)  !! Closest point (3) [length].
    real(dp), intent(inout) :: normal(3)  !! Normal of the facet there (3) [].
    logical, intent(out) :: ridge  !! More than one facet at the closest point faces x.
    logical, intent(out) :: inside  !! x projects inside the union of the facets.
    integer, allocatable :: around(:)
    integer :: kept(max_around), vertex, n_kept, i, k, other, n_on, on(2), best
    real(dp) :: xi_at(2, max_around), position_at(3, max_around), normal_at(3, max_around), facing(max_around)
    real(dp) :: xu(3, max_around), xv(3, max_around), square
    real(dp), allocatable :: along(:)
    real(dp) :: closest_xi(2), closest(3), unused_normal(3), unused_u(3), unused_v(3)
    call self%adjacency%facets_at(self%set%corners(facet), facet, n_edges, edges, around, vertex)
    n_kept = 0
    inside = .true.
    do i = 1, min(max_around, size(around))
      k = n_kept + 1
      if (around(i) == facet) then
        xi_at(:, k) = xi
      else
        call closest_point_on_facet(self%set, around(i), position, xi_at(:, k), square)
        if (square > (no_offset*self%set%size(around(i)))**2) cycle
      end if
      call facet_position_and_normal(self%set, around(i), xi_at(:, k), position_at(:, k), normal_at(:, k), &
                                     xu(:, k), xv(:, k))
      facing(k) = -dot_product(normal_at(:, k), normal_a)
      if (.not. facing(k) > facing_cosine) cycle
      kept(k) = around(i)
      n_kept = k
      ! A curved facet may face x on its edge but not at its own closest point, where it was rejected: x projects beside
      ! it.
      if (around(i) == facet) cycle
      call closest_point_on_facet(self%set, around(i), x, closest_xi, square)
      call facet_position_and_normal(self%set, around(i), closest_xi, closest, unused_normal, unused_u, unused_v)
      if (norm2(closest - position) > same_place*self%set%size(around(i))) inside = .false.
    end do
    ridge = n_kept > 1
    best = 1
    do i = 1, n_kept
      if (facing(i) > facing(best) + shape_rounding) best = i   ! around(:) ascends: ties keep the lowest number
      call edges_at(self%set%corners(kept(i)), xi_at(:, i), 2*no_offset, n_on, on)
      do k = 1, n_on
        other = self%adjacency%neighbour(on(k), kept(i))
        if (other > 0) then
          if (any(kept(1:n_kept) == other)) cycle
        end if
        if (dot_product(x - position, &
                        conormal(self%set%corners(kept(i)), on(k), xu(:, i), xv(:, i), normal_at(:, i))) &
            > no_offset*self%set%size(kept(i))) inside = .false.
      end do
    end do
    if (n_kept == 0) return
    ! Beside a sharp edge x may be far along the facet that faces body a best: the other one tells the direction.
    along = abs(matmul(x - position, normal_at(:, :n_kept)))
    if (along(best) < min_alignment*norm2(x - position)) best = maxloc(along, 1)
    facet = kept(best)
    xi = xi_at(:, best)
    position = position_at(:, best)
    normal = normal_at(:, best)
  end subroutine resolve_edge

  !> Unit vector in the tangent plane that points out of a facet across an edge.
  pure function conormal(corners, edge, xu, xv, normal) result(m)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    integer, intent(in) :: edge  !! Edge number.
    !> Derivative of the position with respect to the first reference coordinate (3) [length].
    real(dp), intent(in) :: xu(3)
    real(dp), intent(in) :: xv(3)  !! Derivative with respect to the second one (3) [length].
    real(dp), intent(in) :: normal(3)  !! Unit normal (3) [].
    real(dp) :: m(3)  !! Conormal (3) [].
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
  end function conormal

  !> Rotate the normal at a point of an edge into the direction of x - x', which lies between the normals of the
  !> adjacent facets. The normal is unchanged where x - x' is already parallel to it, or too short to define a
  !> direction.
  pure subroutine align_normal(r, size, ridge, normal)
    real(dp), intent(in) :: r(3)  !! x - x' (3) [length].
    real(dp), intent(in) :: size  !! Size of the facet [length].
    !> The point lies on an edge between facets that face x; elsewhere only small corrections are made.
    logical, intent(in) :: ridge
    real(dp), intent(inout) :: normal(3)  !! Normal of body b (3) [].
    real(dp) :: along, across, length
    along = dot_product(r, normal)
    across = norm2(r - along*normal)
    if (across <= shape_rounding*size) return
    length = norm2(r)
    if (across > max_correction*length .and. .not. ridge) return
    if (abs(along) < min_alignment*length) return
    normal = sign(1.0_dp, along)*r/length
  end subroutine align_normal

  !> Distance of a point to the surface, whatever its normals [length].
  pure real(dp) function smallest_distance(self, x) result(distance)
    class(master_surface_t), intent(in) :: self
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp) :: xi(2), square
    integer :: facet
    call nearest_facet(self%tree, self%set, x, [0.0_dp, 0.0_dp, 1.0_dp], .true., 0.0_dp, 0, facet, xi, square)
    distance = sqrt(square)
  end function smallest_distance
end module dotyk_contact_projection
