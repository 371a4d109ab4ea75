!> Integration points on slave facets and their projections on the master surface.
module dotyk_contact_integration_points
  use dotyk_base_kinds, only: dp
  use dotyk_contact_projection, only: project_point, projection_t, projection_too_far, master_surface_t
  use dotyk_contact_segment_quadrature, only: quadrature_rule_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds, quadrature_rule
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: whole_facet_rules, project_points, surface_area

  !> Degree of rules on whole facets for dual mortar rows. The edges of the master surface cut the slave facets, which
  !> the rule has to resolve: with this degree the errors of columns of non-matching blocks are a third to a tenth of
  !> those with twice the order of the elements, and integration points that are not rows cost little. (On mortar
  !> segments the integrals are exact, see mortar_segments.f90.)
  integer, parameter :: mortar_degree = 8
  real(dp), parameter :: pi = acos(-1.0_dp)

contains

  !> Quadrature rules on whole facets of the kinds in use. Where integration points are rows: twice the order of the
  !> element, one degree more with the radius in the weights.
  subroutine whole_facet_rules(kinds, mortar, axisymmetric, rule)
    integer, intent(in) :: kinds(:)  !! Element kinds of the facets (n_facets).
    logical, intent(in) :: mortar  !! The rows are dual mortar rows; otherwise the integration points are rows.
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(quadrature_rule_t), intent(inout) :: rule(:)  !! Rules, by element kind (n_element_kinds).
    type(element_kind_t) :: kind
    integer :: k, degree
    do k = 1, n_element_kinds
      if (.not. any(kinds == k)) cycle
      kind = element_kind(k)
      degree = 2*kind%order + merge(1, 0, axisymmetric)
      if (mortar) degree = mortar_degree
      call quadrature_rule(k, degree, rule(k)%xi, rule(k)%weight)
    end do
  end subroutine whole_facet_rules

  !> Integration points of one slave facet and their projections.
  pure subroutine points_of_facet(kind, d, x_nodes, points, weights, axisymmetric, master, candidate, radius, &
                                  max_depth, x, xi, weight, projection)
    integer, intent(in) :: kind  !! Element kind of the facet.
    integer, intent(in) :: d  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: x_nodes(:, :)  !! Coordinates of the nodes of the facet (d, n_nodes) [length].
    real(dp), intent(in) :: points(:, :)  !! Points of the rule (d-1, n) [].
    real(dp), intent(in) :: weights(:)  !! Weights of the rule (n) [].
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(master_surface_t), intent(in) :: master  !! The other surface.
    !> The facet is within the search radius of the master surface, from the broad phase.
    logical, intent(in) :: candidate
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    real(dp), intent(in) :: max_depth  !! Thickness of the slave body at the facet [length].
    real(dp), intent(out) :: x(:, :)  !! Positions (3, n) [length].
    real(dp), intent(out) :: xi(:, :)  !! Reference coordinates (2, n) [].
    real(dp), intent(out) :: weight(:)  !! Weights: areas of the points (n) [length^2; length in two dimensions].
    type(projection_t), intent(out) :: projection(:)  !! Projections on the master surface (n).
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
      if (candidate) then
        call project_point(master, x(:, i), normal, hint, radius, max_depth, projection(i))
      else
        projection(i)%status = projection_too_far
      end if
    end do
  end subroutine points_of_facet

  !> Integration points of all slave facets and their closest-point projections on the master surface.
  subroutine project_points(mesh_a, surface_a, rule, offset, axisymmetric, master, candidate, radius, depth, x, xi, &
                            weight, projection)
    type(body_mesh_t), intent(in) :: mesh_a  !! Body of the slave surface.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(quadrature_rule_t), intent(in) :: rule(:)  !! Quadrature rules of the facets (n_facets).
    integer, intent(in) :: offset(:)  !! Points of facet f are offset(f)+1 .. offset(f+1) (n_facets+1).
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    !> Facets within the search radius of the master surface, from the broad phase (n_facets).
    logical, intent(in) :: candidate(:)
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    real(dp), intent(in) :: depth(:)  !! Thickness of the slave body at the facets (n_facets) [length].
    real(dp), intent(out) :: x(:, :)  !! Positions (3, n) [length].
    real(dp), intent(out) :: xi(:, :)  !! Reference coordinates (2, n) [].
    real(dp), intent(out) :: weight(:)  !! Weights: areas of the points (n) [length^2; length in two dimensions].
    type(projection_t), intent(out) :: projection(:)  !! Projections on the master surface (n).
    integer :: f
    !$omp parallel do default(none) schedule(dynamic, 64) &
    !$omp shared(surface_a, mesh_a, rule, offset, axisymmetric, master, candidate, radius, depth, x, xi, weight) &
    !$omp shared(projection)
    do f = 1, surface_a%n_facets
      associate (first => offset(f) + 1, last => offset(f + 1), kind => surface_a%kind(f))
        call points_of_facet(kind, mesh_a%dimension, mesh_a%x(:, surface_a%node(1:kind_nodes(kind), f)), rule(f)%xi, &
                             rule(f)%weight, axisymmetric, master, candidate(f), radius, depth(f), &
                             x(:, first:last), xi(:, first:last), weight(first:last), projection(first:last))
      end associate
    end do
    !$omp end parallel do
  end subroutine project_points

  !> Area of a surface [length^2; length in two dimensions, with 2 pi r in axisymmetry length^2].
  real(dp) function surface_area(mesh, surface, rule, axisymmetric) result(area)
    type(body_mesh_t), intent(in) :: mesh  !! Body of the surface.
    type(surface_t), intent(in) :: surface  !! The surface.
    type(quadrature_rule_t), intent(in) :: rule(:)  !! Rules on whole facets, by element kind (n_element_kinds).
    logical, intent(in) :: axisymmetric  !! Whether areas include the circumference 2 pi r.
    real(dp) :: x(mesh%dimension), normal(mesh%dimension), jacobian
    integer :: f, i
    area = 0
    do f = 1, surface%n_facets
      associate (kind => surface%kind(f), r => rule(surface%kind(f)))
        do i = 1, size(r%weight)
          call facet_geometry(kind, mesh%dimension, mesh%x(:, surface%node(1:kind_nodes(kind), f)), r%xi(:, i), x, &
                              normal, jacobian)
          area = area + r%weight(i)*jacobian*merge(2*pi*x(1), 1.0_dp, axisymmetric)
        end do
      end associate
    end do
  end function surface_area
end module dotyk_contact_integration_points
