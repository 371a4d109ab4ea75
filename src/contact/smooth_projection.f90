!> Partners of contact points by another geometry than that of the elements.
!>
!> The direction n is the geometry's normal. The partner x' of a point x lies on the element, where the line through x along the
!> normal that belongs to x' meets it, so that x - x' is parallel to n: moments of the forces on the two sides cancel exactly,
!> as they do for closest points. The distance is that of the geometry: n . (y' - y), where y and y' have the reference
!> coordinates of x and x'.
module dotyk_contact_smooth_projection
  use dotyk_base_kinds, only: dp
  use dotyk_contact_closest_point, only: edges_at
  use dotyk_contact_facet_set, only: evaluate_facet, facet_set_t
  use dotyk_contact_smooth_surface, only: smooth_surface_t
  use dotyk_contact_projection, only: projection_found, projection_outside, projection_t, projection_too_far
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: smooth_projections

  !> Facets that are tried in turn, steps of Newton's method on each.
  integer, parameter :: most_facets = 12, most_steps = 25
  !> A point this near to an edge lies inside, in reference coordinates.
  real(dp), parameter :: edge_tolerance = 1e-8_dp
  !> Lines may meet a facet beyond its edge by so much, in reference coordinates: beyond a facet whose surface ends there, when
  !> the closest point lies inside; and where normals are not continuous.
  real(dp), parameter :: overhang = 0.1_dp

contains

  !> Correct the partners of all points for another geometry than that of the elements.
  subroutine smooth_projections(x_a, surface_a, near_a, x_b, surface_b, near_b, search_radius, offset, x, xi, partner)
    !> Nodal coordinates of body a (dimension, n_nodes) [length], its surface, and the facets that may have partners (n_facets).
    real(dp), intent(in) :: x_a(:, :)
    type(surface_t), intent(in) :: surface_a
    logical, intent(in) :: near_a(:)
    !> The same of body b.
    real(dp), intent(in) :: x_b(:, :)
    type(surface_t), intent(in) :: surface_b
    logical, intent(in) :: near_b(:)
    !> Greatest distance [length].
    real(dp), intent(in) :: search_radius
    !> Points of facet f are offset(f)+1 .. offset(f+1).
    integer, intent(in) :: offset(:)
    !> Positions (3, n) [length] and reference coordinates (2, n) of the points.
    real(dp), intent(in) :: x(:, :), xi(:, :)
    type(projection_t), intent(inout) :: partner(:)
    type(smooth_surface_t) :: geometry_a, geometry_b
    integer :: f, i
    call geometry_a%init(x_a, surface_a, near_a)
    call geometry_b%init(x_b, surface_b, near_b)
    if (.not. (geometry_a%active .or. geometry_b%active)) return
    !$omp parallel do default(none) schedule(dynamic, 64) private(i) &
    !$omp shared(surface_a, offset, geometry_a, geometry_b, search_radius, x, xi, partner)
    do f = 1, surface_a%n_facets
      do i = offset(f) + 1, offset(f + 1)
        call smooth_projection(geometry_a, f, xi(:, i), geometry_b, x(:, i), search_radius, partner(i))
      end do
    end do
    !$omp end parallel do
  end subroutine smooth_projections

  !> Correct the partner of a point for the geometries of the two surfaces.
  pure subroutine smooth_projection(geometry_a, facet_a, xi_a, geometry_b, x, search_radius, partner)
    !> The geometry of surface_a.
    type(smooth_surface_t), intent(in) :: geometry_a
    !> The point's facet and reference coordinates (2).
    integer, intent(in) :: facet_a
    real(dp), intent(in) :: xi_a(2)
    !> The geometry of surface_b.
    type(smooth_surface_t), intent(in) :: geometry_b
    !> The point (3) [length].
    real(dp), intent(in) :: x(3)
    !> Greatest distance [length].
    real(dp), intent(in) :: search_radius
    !> By the elements on entry, by the geometries on return.
    type(projection_t), intent(inout) :: partner
    real(dp) :: xi(2)
    integer :: piece
    if (all(partner%status /= [projection_found, projection_outside])) return
    if (geometry_b%active) call along_normals(geometry_b, x, partner)
    if (partner%status /= projection_found) return
    if (geometry_b%active) then
      call geometry_b%pieces%locate(partner%facet, partner%xi, piece, xi)
      partner%distance = partner%distance + dot_product(partner%normal, geometry_b%shift(piece, xi))
    end if
    if (geometry_a%active) then
      call geometry_a%pieces%locate(facet_a, xi_a, piece, xi)
      partner%distance = partner%distance - dot_product(partner%normal, geometry_a%shift(piece, xi))
    end if
    if (abs(partner%distance) > search_radius) partner%status = projection_too_far
  end subroutine smooth_projection

  !> Move the partner to where the line along its normal meets the point. Nothing happens where there is no such place: beside
  !> sharp edges.
  pure subroutine along_normals(geometry, x, partner)
    type(smooth_surface_t), intent(in) :: geometry
    real(dp), intent(in) :: x(3)
    type(projection_t), intent(inout) :: partner
    real(dp) :: xi(2), normal(3), distance, beyond, best_xi(2), best_normal(3), best_distance, least
    integer :: facet, best_facet, edge, n_edges, edges(2), i, k   ! facets are pieces here
    logical :: met, ends
    call geometry%pieces%locate(partner%facet, partner%xi, facet, xi)
    if (.not. geometry%changed(facet)) then
      ! The closest point inside a flat facet stays; on its edge, a curved one may begin.
      call edges_at(geometry%element%corners(facet), xi, 1e-6_dp, n_edges, edges)
      do k = 1, n_edges
        i = geometry%joined(edges(k), facet)
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
    ends = .false.
    do i = 1, most_facets
      call meet(geometry, geometry%element, facet, x, xi, normal, distance, met)
      if (.not. met) exit
      if (dot_product(normal, partner%normal) > -0.5_dp) exit
      call farthest_edge(geometry%element%corners(facet), xi, edge, beyond)
      if (beyond < least) then
        least = beyond
        best_facet = facet
        best_xi = xi
        best_normal = normal
        best_distance = distance
      end if
      if (beyond <= edge_tolerance) exit
      ends = geometry%rim(edge, facet)
      facet = geometry%joined(edge, facet)
      if (facet == 0) exit
      xi = merge(1/3.0_dp, 0.0_dp, geometry%element%corners(facet) == 3)
    end do
    if (best_facet == 0) return
    if (least > edge_tolerance) then
      if (partner%status /= projection_found .or. least > overhang) return
      ! beyond a sharp edge the direction of the closest point lies between the normals
      if (facet == 0 .and. .not. ends) return
    end if
    partner%status = projection_found
    partner%facet = geometry%pieces%parent(best_facet)
    partner%xi = geometry%pieces%base(:, best_facet) + geometry%pieces%factor(best_facet)*best_xi
    partner%normal = -best_normal
    partner%distance = best_distance
  end subroutine along_normals

  !> Where the line through x along the normal meets a facet, continued beyond its edges: x = x'(xi) + t m(xi), by Newton's
  !> method.
  pure subroutine meet(geometry, set, facet, x, xi, normal, distance, met)
    type(smooth_surface_t), intent(in) :: geometry
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: facet
    !> The point (3) [length].
    real(dp), intent(in) :: x(3)
    !> Reference coordinates: where to begin; the solution (2).
    real(dp), intent(inout) :: xi(2)
    !> Unit normal there (3), and the distance along it [length].
    real(dp), intent(out) :: normal(3), distance
    !> There is a solution.
    logical, intent(out) :: met
    real(dp) :: position(3), xu(3), xv(3), xuu(3), xuv(3), xvv(3), m(3), mu(3), mv(3), a(3, 3), step(3), r(3), t, length
    integer :: i
    met = .false.
    normal = 0
    distance = 0
    t = 0
    do i = 1, most_steps
      call evaluate_facet(set%coefficient(:, :, facet), xi(1), xi(2), position, xu, xv, xuu, xuv, xvv)
      call normal_between(set%corners(facet), geometry%corner_normal(:, :, facet), xi, m, mu, mv)
      r = x - set%origin(:, facet) - position
      if (i == 1) t = dot_product(r, m)/max(dot_product(m, m), tiny(1.0_dp))
      if (set%corners(facet) == 2) then
        xv = [0.0_dp, 0.0_dp, 1.0_dp]
        mv = 0
      end if
      a(:, 1) = xu + t*mu
      a(:, 2) = xv + t*mv
      a(:, 3) = m
      call solve(a, r - t*m, step, met)
      if (.not. met) return
      xi = xi + step(1:2)
      t = t + step(3)
      met = .false.
      if (.not. maxval(abs(xi)) < 4) return
      ! converges quadratically: after a step this small the error is round-off
      if (maxval(abs(step(1:2))) < 1e-9_dp) then
        met = .true.
        exit
      end if
    end do
    if (.not. met) return
    call normal_between(set%corners(facet), geometry%corner_normal(:, :, facet), xi, m, mu, mv)
    call evaluate_facet(set%coefficient(:, :, facet), xi(1), xi(2), position, xu, xv, xuu, xuv, xvv)
    length = norm2(m)
    normal = m/length
    distance = dot_product(normal, x - set%origin(:, facet) - position)
  end subroutine meet

  !> The normal between the corners of a facet, not of unit length, and its derivatives.
  pure subroutine normal_between(corners, at_corner, xi, m, mu, mv)
    integer, intent(in) :: corners
    !> (3, 4).
    real(dp), intent(in) :: at_corner(3, 4)
    real(dp), intent(in) :: xi(2)
    !> (3).
    real(dp), intent(out) :: m(3), mu(3), mv(3)
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
  end subroutine normal_between

  !> The edge that a point lies farthest beyond.
  pure subroutine farthest_edge(corners, xi, edge, beyond)
    integer, intent(in) :: corners
    real(dp), intent(in) :: xi(2)
    integer, intent(out) :: edge
    !> How far, in reference coordinates; negative inside.
    real(dp), intent(out) :: beyond
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
  pure subroutine solve(a, b, x, regular)
    !> (3,3), (3).
    real(dp), intent(in) :: a(3, 3), b(3)
    real(dp), intent(out) :: x(3)
    logical, intent(out) :: regular
    real(dp) :: determinant
    determinant = triple(a(:, 1), a(:, 2), a(:, 3))
    x = 0
    regular = abs(determinant) > 1e-10_dp*norm2(a(:, 1))*norm2(a(:, 2))*norm2(a(:, 3))
    if (.not. regular) return
    x = [triple(b, a(:, 2), a(:, 3)), triple(a(:, 1), b, a(:, 3)), triple(a(:, 1), a(:, 2), b)]/determinant
  end subroutine solve

  !> Triple product a . (b x c).
  pure real(dp) function triple(a, b, c)
    real(dp), intent(in) :: a(3), b(3), c(3)
    triple = a(1)*(b(2)*c(3) - b(3)*c(2)) + a(2)*(b(3)*c(1) - b(1)*c(3)) + a(3)*(b(1)*c(2) - b(2)*c(1))
  end function triple
end module dotyk_contact_smooth_projection
