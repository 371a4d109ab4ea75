!> Integration points on facets of surface_a, and their partners on surface_b.
module dotyk_contact_integration_points
  use dotyk_base_kinds, only: dp
  use dotyk_contact_segment_quadrature, only: quadrature_rule_t
  use dotyk_contact_projection, only: project_point, projection_t, projection_too_far, master_surface_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds, quadrature_rule
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: whole_facet_rules, project_points

  !> Degree of the plain rule that means at vertices are made with. The edges of surface_b cut the facets, and the mean must
  !> see where: errors of columns of blocks that do not match are a third to a tenth of those with twice the order of the
  !> elements, and points that are not rows cost next to nothing. (On segments the mean is exact, see mortar_segments.f90.)
  integer, parameter :: mean_degree = 8
  real(dp), parameter :: pi = acos(-1.0_dp)

contains

  !> Quadrature rules of the facet kinds in use. Where the points are the rows: of twice the order of the element, one
  !> more with the radius in the weight.
  subroutine whole_facet_rules(kinds, for_means, axisymmetric, rule)
    !> Kinds of the facets.
    integer, intent(in) :: kinds(:)
    !> Whether the points are for means at vertices, not rows themselves.
    logical, intent(in) :: for_means
    !> Weights contain 2 pi r.
    logical, intent(in) :: axisymmetric
    !> Rules (n_element_kinds).
    type(quadrature_rule_t), intent(inout) :: rule(:)
    type(element_kind_t) :: kind
    integer :: k, degree
    do k = 1, n_element_kinds
      if (.not. any(kinds == k)) cycle
      kind = element_kind(k)
      degree = 2*kind%order + merge(1, 0, axisymmetric)
      if (for_means) degree = mean_degree
      call quadrature_rule(k, degree, rule(k)%xi, rule(k)%weight)
    end do
  end subroutine whole_facet_rules

  !> Points of one facet and their partners.
  pure subroutine facet_points(kind, d, x_nodes, points, weights, axisymmetric, target, near, radius, x, xi, &
                              weight, partner)
    !> Kind of the facet and dimension of space.
    integer, intent(in) :: kind, d
    !> Coordinates of its nodes (d, n_nodes) [length].
    real(dp), intent(in) :: x_nodes(:, :)
    !> The rule: (d-1, n), (n).
    real(dp), intent(in) :: points(:, :), weights(:)
    !> Weights contain 2 pi r.
    logical, intent(in) :: axisymmetric
    !> The other surface.
    type(master_surface_t), intent(in) :: target
    !> The facet may have partners within the greatest distance.
    logical, intent(in) :: near
    !> Greatest distance [length].
    real(dp), intent(in) :: radius
    !> Positions (3, n), reference coordinates (2, n), areas (n), partners (n).
    real(dp), intent(out) :: x(:, :), xi(:, :), weight(:)
    type(projection_t), intent(out) :: partner(:)
    real(dp) :: normal(3), jacobian
    integer :: i, hint
    hint = 0
    x = 0
    xi = 0
    do i = 1, size(weights)
      normal = 0
      call facet_geometry(kind, d, x_nodes, points(:, i), x(1:d, i), normal(1:d), jacobian)
      xi(1:d - 1, i) = points(:, i)
      weight(i) = weights(i)*jacobian
      if (axisymmetric) weight(i) = weight(i)*2*pi*x(1, i)
      if (near) then
        call project_point(target, x(:, i), normal, hint, radius, partner(i))
      else
        partner(i)%status = projection_too_far
      end if
    end do
  end subroutine facet_points

  !> Points of all facets and their partners by the elements' geometry.
  subroutine project_points(mesh_a, surface_a, rule, offset, axisymmetric, target, near, radius, x, xi, weight, partner)
    type(body_mesh_t), intent(in) :: mesh_a
    type(surface_t), intent(in) :: surface_a
    !> The facets' rules (n_facets); points of facet f are offset(f)+1 .. offset(f+1).
    type(quadrature_rule_t), intent(in) :: rule(:)
    integer, intent(in) :: offset(:)
    !> Weights contain 2 pi r.
    logical, intent(in) :: axisymmetric
    type(master_surface_t), intent(in) :: target
    !> Facets that may have partners (n_facets).
    logical, intent(in) :: near(:)
    !> Greatest distance [length].
    real(dp), intent(in) :: radius
    !> As in facet_points, for all facets.
    real(dp), intent(out) :: x(:, :), xi(:, :), weight(:)
    type(projection_t), intent(out) :: partner(:)
    integer :: f
    !$omp parallel do default(none) schedule(dynamic, 64) &
    !$omp shared(surface_a, mesh_a, rule, offset, axisymmetric, target, near, radius, x, xi, weight, partner)
    do f = 1, surface_a%n_facets
      associate (first => offset(f) + 1, last => offset(f + 1), kind => surface_a%kind(f))
        call facet_points(kind, mesh_a%dimension, mesh_a%x(:, surface_a%node(1:kind_nodes(kind), f)), rule(f)%xi, &
                          rule(f)%weight, axisymmetric, target, near(f), radius, x(:, first:last), &
                          xi(:, first:last), weight(first:last), partner(first:last))
      end associate
    end do
    !$omp end parallel do
  end subroutine project_points
end module dotyk_contact_integration_points
