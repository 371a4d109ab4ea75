!> Projection along the continuous normals of the smooth master surface.
!>
!> The direction n is the normal of the smooth surface. The projection x' of a point x lies on the element, where the
!> line through x along the interpolated normal at x' meets it: x - x' is parallel to n, so that the moments of the
!> forces on the two sides cancel exactly, as for closest points. The gap is that of the smooth surfaces where the line
!> meets them, to first order: patches have the reference coordinates of the elements.
module dotyk_contact_smooth_projection
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: no_offset, same_number, same_place, shape_rounding
  use dotyk_contact_bounding_volume_tree, only: facing_cosine
  use dotyk_contact_closest_point, only: edges_at
  use dotyk_contact_facet_polynomial, only: evaluate_facet
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_projection, only: projection_found, projection_outside, projection_t, projection_too_far
  use dotyk_contact_smooth_surface, only: smooth_surface_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: smooth_projections

  integer, parameter :: max_facets = 12, max_steps = 25  !! Sub-facets that are tried in turn, and Newton steps on each.
  !> Intersections beyond an edge by up to this, in reference coordinates, are accepted at the boundary of the surface,
  !> if the closest point lies inside, and where normals are discontinuous.
  real(dp), parameter :: overhang = 0.1_dp
  real(dp), parameter :: divergence_limit = 4  !! Newton's method diverges where a reference coordinate exceeds this.

contains

  !> Replace the projections of all points by those along the normals of the smooth surfaces.
  subroutine smooth_projections(division, x_a, surface_a, candidate_a, x_b, surface_b, candidate_b, depth_a, &
                                depth_b, search_radius, offset, x, xi, projection)
    type(division_t), intent(in) :: division  !! How ranks divide the work; each has points of its own.
    real(dp), intent(in) :: x_a(:, :)  !! Nodal coordinates of body a (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    logical, intent(in) :: candidate_a(:)  !! Facets of the slave surface near the master surface (n_facets).
    real(dp), intent(in) :: x_b(:, :)  !! Nodal coordinates of body b (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    logical, intent(in) :: candidate_b(:)  !! Facets of the master surface near the slave surface (n_facets).
    real(dp), intent(in) :: depth_a(:)  !! Thickness of body a behind its facets (n_facets) [length].
    real(dp), intent(in) :: depth_b(:)  !! Thickness of body b behind its facets (n_facets) [length].
    real(dp), intent(in) :: search_radius  !! Search radius: greatest distance of a projection [length].
    integer, intent(in) :: offset(:)  !! Points of slave facet f are offset(f)+1 .. offset(f+1) (n_facets+1).
    real(dp), intent(in) :: x(:, :)  !! Positions of the points (3, n) [length].
    real(dp), intent(in) :: xi(:, :)  !! Reference coordinates of the points (2, n) [].
    !> Closest-point projections on entry, smooth projections on return (n).
    type(projection_t), intent(inout) :: projection(:)
    type(smooth_surface_t) :: geometry_a, geometry_b
    type(projection_t) :: smooth
    integer :: f, i
    call geometry_a%init(division, x_a, surface_a, candidate_a)
    call geometry_b%init(division, x_b, surface_b, candidate_b)
    if (.not. (geometry_a%active .or. geometry_b%active)) return
    !$omp parallel do default(none) schedule(dynamic, 64) private(i, smooth) &
    !$omp shared(surface_a, offset, geometry_a, geometry_b, depth_a, depth_b, search_radius, x, xi, projection)
    do f = 1, surface_a%n_facets
      do i = offset(f) + 1, offset(f + 1)
        smooth = projection(i)
        call smooth_projection(geometry_a, f, xi(:, i), geometry_b, x(:, i), search_radius, smooth)
        ! The line along the normal may lead to the far side of a thin body.
        if (smooth%status == projection_found .and. projection(i)%status == projection_outside) then
          if (-smooth%distance > min(depth_a(f), depth_b(smooth%facet))) cycle
        end if
        projection(i) = smooth
      end do
    end do
    !$omp end parallel do
  end subroutine smooth_projections

  !> Replace the projection of a point.
  pure subroutine smooth_projection(geometry_a, facet_a, xi_a, geometry_b, x, search_radius, projection)
    type(smooth_surface_t), intent(in) :: geometry_a  !! Smooth slave surface.
    integer, intent(in) :: facet_a  !! Slave facet of the point.
    real(dp), intent(in) :: xi_a(2)  !! Its reference coordinates (2) [].
    type(smooth_surface_t), intent(in) :: geometry_b  !! Smooth master surface.
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp), intent(in) :: search_radius  !! Search radius: greatest distance of a projection [length].
    type(projection_t), intent(inout) :: projection  !! Closest-point projection on entry, smooth projection on return.
    real(dp) :: xi(2), shift(3)
    integer :: sub_facet
    if (all(projection%status /= [projection_found, projection_outside])) return
    if (geometry_b%active) call project_along_normal(geometry_b, x, projection)
    if (projection%status /= projection_found) return
    if (geometry_b%active) then
      call geometry_b%sub_facets%locate(projection%facet, projection%xi, sub_facet, xi)
      shift = geometry_b%shift(sub_facet, xi)
      projection%distance = projection%distance + dot_product(projection%normal, shift)
      ! The vertices of the slave surface, between which rows interpolate, are exact.
      projection%uncertainty = geometry_b%uncertainty(sub_facet, shift)
    end if
    if (geometry_a%active) then
      call geometry_a%sub_facets%locate(facet_a, xi_a, sub_facet, xi)
      projection%distance = projection%distance - geometry_a%height(sub_facet, xi, projection%normal)
    end if
    if (abs(projection%distance) > search_radius) projection%status = projection_too_far
  end subroutine smooth_projection

  !> Move a projection to where the line along the interpolated normal meets the point. It is unchanged where there is
  !> no such position: beside sharp edges.
  pure subroutine project_along_normal(geometry, x, projection)
    type(smooth_surface_t), intent(in) :: geometry  !! Smooth master surface.
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    type(projection_t), intent(inout) :: projection  !! Projection.
    real(dp) :: xi(2), normal(3), distance, beyond, best_xi(2), best_normal(3), best_distance, least
    integer :: facet, best_facet, edge, n_edges, edges(2), i, k   ! facets are sub-facets here
    logical :: found, at_boundary
    call geometry%sub_facets%locate(projection%facet, projection%xi, facet, xi)
    if (.not. geometry%changed(facet)) then
      ! A closest point inside a flat sub-facet is kept; at its edge a curved one may begin.
      call edges_at(geometry%element%corners(facet), xi, same_place, n_edges, edges)
      do k = 1, n_edges
        i = geometry%smooth_neighbour(edges(k), facet)
        if (i == 0) cycle
        if (.not. geometry%changed(i)) cycle
        facet = i
        xi = merge(1/3.0_dp, 0.0_dp, geometry%element%corners(i) == 3)
        exit
      end do
      if (.not. geometry%changed(facet)) return
    end if
    least = huge(least)
    best_facet = 0
    at_boundary = .false.
    do i = 1, max_facets
      call intersect_normal_line(geometry, geometry%element, facet, x, xi, normal, distance, found)
      if (.not. found) exit
      if (dot_product(normal, projection%normal) > -facing_cosine) exit
      call farthest_edge(geometry%element%corners(facet), xi, edge, beyond)
      if (beyond < least) then
        least = beyond
        best_facet = facet
        best_xi = xi
        best_normal = normal
        best_distance = distance
      end if
      if (beyond <= no_offset) exit
      at_boundary = geometry%boundary(edge, facet)
      facet = geometry%smooth_neighbour(edge, facet)
      if (facet == 0) exit
      xi = merge(1/3.0_dp, 0.0_dp, geometry%element%corners(facet) == 3)
    end do
    if (best_facet == 0) return
    if (least > no_offset) then
      if (projection%status /= projection_found .or. least > overhang) return
      ! Beyond a sharp edge the direction of the closest point lies between the normals.
      if (facet == 0 .and. .not. at_boundary) return
    end if
    projection%status = projection_found
    projection%facet = geometry%sub_facets%parent(best_facet)
    projection%xi = geometry%sub_facets%base(:, best_facet) + geometry%sub_facets%factor(best_facet)*best_xi
    projection%normal = -best_normal
    projection%distance = best_distance
  end subroutine project_along_normal

  !> Point of a sub-facet, continued beyond its edges, whose normal line passes through x: x = x'(xi) + t m(xi), by
  !> Newton's method.
  pure subroutine intersect_normal_line(geometry, set, facet, x, xi, normal, distance, found)
    type(smooth_surface_t), intent(in) :: geometry  !! Smooth master surface.
    type(facet_set_t), intent(in) :: set  !! Sub-facets with the element geometry.
    integer, intent(in) :: facet  !! Sub-facet number.
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp), intent(inout) :: xi(2)  !! Reference coordinates: start on entry, solution on return (2) [].
    real(dp), intent(out) :: normal(3)  !! Unit normal there (3) [].
    real(dp), intent(out) :: distance  !! Distance along it [length].
    logical, intent(out) :: found  !! There is a solution.
    real(dp) :: position(3), xu(3), xv(3), xuu(3), xuv(3), xvv(3), m(3), mu(3), mv(3), a(3, 3), step(3), r(3), t, length
    integer :: i
    found = .false.
    normal = 0
    distance = 0
    t = 0
    do i = 1, max_steps
      call evaluate_facet(set%coefficient(:, :, facet), xi(1), xi(2), position, xu, xv, xuu, xuv, xvv)
      call interpolate_normal(set%corners(facet), geometry%corner_normal(:, :, facet), xi, m, mu, mv)
      r = x - set%origin(:, facet) - position
      if (i == 1) t = dot_product(r, m)/max(dot_product(m, m), tiny(1.0_dp))
      if (set%corners(facet) == 2) then
        xv = [0.0_dp, 0.0_dp, 1.0_dp]
        mv = 0
      end if
      a(:, 1) = xu + t*mu
      a(:, 2) = xv + t*mv
      a(:, 3) = m
      call solve_3x3(a, r - t*m, step, found)
      if (.not. found) return
      xi = xi + step(1:2)
      t = t + step(3)
      found = .false.
      if (.not. maxval(abs(xi)) < divergence_limit) return
      if (maxval(abs(step(1:2))) < same_number) then
        found = .true.
        exit
      end if
    end do
    if (.not. found) return
    call interpolate_normal(set%corners(facet), geometry%corner_normal(:, :, facet), xi, m, mu, mv)
    call evaluate_facet(set%coefficient(:, :, facet), xi(1), xi(2), position, xu, xv, xuu, xuv, xvv)
    length = norm2(m)
    normal = m/length
    distance = dot_product(normal, x - set%origin(:, facet) - position)
  end subroutine intersect_normal_line

  !> Normal interpolated between the corners of a sub-facet, not of unit length, and its derivatives.
  pure subroutine interpolate_normal(corners, at_corner, xi, m, mu, mv)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: at_corner(3, 4)  !! Normals at the corners (3, 4) [].
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) []; the second is 0 for lines.
    real(dp), intent(out) :: m(3)  !! Interpolated normal (3) [].
    real(dp), intent(out) :: mu(3)  !! Derivative with respect to the first reference coordinate (3) [].
    real(dp), intent(out) :: mv(3)  !! Derivative with respect to the second one (3) [].
    associate (n => at_corner, u => xi(1), v => xi(2))
      select case (corners)
      case (2)
        mu = (n(:, 2) - n(:, 1))/2
        mv = 0
        m = (n(:, 1) + n(:, 2))/2 + u*mu
      case (3)
        mu = n(:, 2) - n(:, 1)
        mv = n(:, 3) - n(:, 1)
        m = n(:, 1) + u*mu + v*mv
      case default
        mu = ((1 - v)*(n(:, 2) - n(:, 1)) + (1 + v)*(n(:, 3) - n(:, 4)))/4
        mv = ((1 - u)*(n(:, 4) - n(:, 1)) + (1 + u)*(n(:, 3) - n(:, 2)))/4
        m = ((1 - u)*((1 - v)*n(:, 1) + (1 + v)*n(:, 4)) + (1 + u)*((1 - v)*n(:, 2) + (1 + v)*n(:, 3)))/4
      end select
    end associate
  end subroutine interpolate_normal

  !> The edge beyond which a point lies farthest.
  pure subroutine farthest_edge(corners, xi, edge, beyond)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) []; the second is 0 for lines.
    integer, intent(out) :: edge  !! Edge number.
    real(dp), intent(out) :: beyond  !! Distance beyond the edge in reference coordinates, negative inside [].
    select case (corners)
    case (2)
      edge = merge(1, 2, xi(1) < 0)
      beyond = abs(xi(1)) - 1
    case (3)
      edge = maxloc([-xi(2), sum(xi) - 1, -xi(1)], dim=1)
      beyond = max(-xi(2), sum(xi) - 1, -xi(1))
    case default
      edge = maxloc([-xi(2), xi(1), xi(2), -xi(1)], dim=1)
      beyond = maxval(abs(xi)) - 1
    end select
  end subroutine farthest_edge

  !> Solve three equations by Cramer's rule.
  pure subroutine solve_3x3(a, b, x, regular)
    real(dp), intent(in) :: a(3, 3)  !! Matrix (3, 3) [any].
    real(dp), intent(in) :: b(3)  !! Right-hand side (3) [any].
    real(dp), intent(out) :: x(3)  !! Solution, zero for a singular matrix (3) [any].
    logical, intent(out) :: regular  !! The matrix is regular.
    real(dp) :: determinant
    determinant = triple_product(a(:, 1), a(:, 2), a(:, 3))
    x = 0
    regular = abs(determinant) > shape_rounding*norm2(a(:, 1))*norm2(a(:, 2))*norm2(a(:, 3))
    if (.not. regular) return
    x = [triple_product(b, a(:, 2), a(:, 3)), triple_product(a(:, 1), b, a(:, 3)), &
         triple_product(a(:, 1), a(:, 2), b)]/determinant
  end subroutine solve_3x3

  !> Triple product a . (b x c) [any].
  pure real(dp) function triple_product(a, b, c)
    real(dp), intent(in) :: a(3)  !! First vector (3) [any].
    real(dp), intent(in) :: b(3)  !! Second vector (3) [any].
    real(dp), intent(in) :: c(3)  !! Third vector (3) [any].
    triple_product = a(1)*(b(2)*c(3) - b(3)*c(2)) + a(2)*(b(3)*c(1) - b(1)*c(3)) + a(3)*(b(1)*c(2) - b(2)*c(1))
  end function triple_product
end module dotyk_contact_smooth_projection
