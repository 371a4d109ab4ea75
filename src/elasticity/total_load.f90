!> A total force F and moment M on a surface, spread as a traction that is linear in the position,
!>
!>     t(x) = a + b x (x - c),   a = F/A,   b = J^-1 (M + (p - c) x F),
!>
!> the distributing coupling with area weights: A is the area, c the centroid, J = int |r|^2 I - r r^T dA, r = x - c,
!> and p the point that F and M refer to. Area, centroid and J have the quadrature of the load: the resultants of the
!> nodal forces are F and M to rounding on any mesh, curved facets included. A force in the plane of the surface through
!> its centroid is a uniform shear traction; a moment about an axis in the plane of a flat surface is the linear normal
!> traction of beam theory.
module dotyk_elasticity_total_load
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_elasticity_analysis, only: two_pi
  use dotyk_elasticity_shape_table, only: load_degree
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_linalg_dense, only: right_singular_vectors
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, quadrature_rule
  use dotyk_mesh_facet, only: cross, facet_geometry
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: spread_total_load

  !> A surface whose second moments about some axis are below this fraction of the largest one is a line: it takes no
  !> moment about itself [].
  real(dp), parameter :: least_breadth = 1.0e-10_dp

contains

  !> Traction of a total load.
  subroutine spread_total_load(mesh, analysis, surface, force, moment, point, traction, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(surface_t), intent(in) :: surface  !! The surface.
    !> F; in axisymmetric analyses along the axis, on the full circumference (3) [force].
    real(dp), intent(in) :: force(3)
    real(dp), intent(in) :: moment(3)  !! M; 0 in axisymmetric analyses (3) [force length].
    real(dp), allocatable, intent(in) :: point(:)  !! p; the centroid where not allocated (3) [length].
    type(vector_field_t), intent(inout) :: traction  !! The traction [pressure].
    !> Allocated where such a load has no meaning, or the surface cannot take it.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: area, centre(3), second(3, 3), about_centre(3), spin(3), values(3), axes(3, 3), inverse(3)
    if (analysis == analysis_axisymmetric) then
      if (abs(force(1)) > 0 .or. any(abs(moment) > 0)) then
        call set_error(error, 'force and moment: in axisymmetric analyses only a force along the axis y is a '// &
                       'resultant, force = 0,fy without moment', exit_bad_input)
        return
      end if
    end if
    call area_moments(mesh, analysis == analysis_axisymmetric, surface, area, centre, second)
    call traction%init(force/area, error)
    if (allocated(error) .or. analysis == analysis_axisymmetric) return
    about_centre = moment
    if (allocated(point)) about_centre = moment + cross(point - centre, force)
    if (mesh%dimension == 2) then
      ! The only one in the plane is the polar one.
      spin = [0.0_dp, 0.0_dp, about_centre(3)/second(3, 3)]
    else
      call right_singular_vectors(second, values, axes, error)
      if (allocated(error)) return
      inverse = 0
      where (values > least_breadth*values(1)) inverse = 1/values
      spin = matmul(about_centre, axes)
      if (any(inverse <= 0 .and. abs(spin) > least_breadth*norm2(about_centre))) then
        call set_error(error, 'moment: the surface is a line and takes no moment about itself', exit_bad_input)
        return
      end if
      spin = matmul(axes, inverse*spin)
    end if
    ! b x r as a matrix by r.
    call traction%init_affine(reshape([0.0_dp, spin(3), -spin(2), -spin(3), 0.0_dp, spin(1), spin(2), -spin(1), &
                                       0.0_dp], [3, 3]), centre)
    traction%value = force/area
  end subroutine spread_total_load

  !> Area, centroid and second moments J of a surface.
  subroutine area_moments(mesh, axisymmetric, surface, area, centre, second)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    logical, intent(in) :: axisymmetric  !! Whether areas are those of the full circumference.
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(out) :: area  !! Area [length^2; length in plane analyses].
    real(dp), intent(out) :: centre(3)  !! Centroid (3) [length].
    real(dp), intent(out) :: second(3, 3)  !! J about the centroid (3, 3) [area length^2].
    real(dp), allocatable :: xi(:, :), weight(:)
    type(element_kind_t) :: kind
    real(dp) :: x(mesh%dimension), normal(mesh%dimension), r(3), w
    integer :: pass, f, q, i, last
    area = 0
    centre = 0
    second = 0
    last = 0
    do pass = 1, 2
      do f = 1, surface%n_facets
        if (surface%kind(f) /= last) then
          kind = element_kind(surface%kind(f))
          call quadrature_rule(surface%kind(f), load_degree(kind%order), xi, weight)
          last = surface%kind(f)
        end if
        associate (node => surface%node(:kind%n_nodes, f))
          do q = 1, size(weight)
            call facet_geometry(surface%kind(f), mesh%dimension, mesh%x(:, node), xi(:, q), x, normal, w)
            w = w*weight(q)
            if (axisymmetric) w = w*two_pi*x(1)
            r = 0
            r(:mesh%dimension) = x
            if (pass == 1) then
              area = area + w
              centre = centre + w*r
              cycle
            end if
            r = r - centre
            second = second - w*spread(r, 1, 3)*spread(r, 2, 3)
            do i = 1, 3
              second(i, i) = second(i, i) + w*dot_product(r, r)
            end do
          end do
        end associate
      end do
      if (pass == 1) centre = centre/area
    end do
  end subroutine area_moments
end module dotyk_elasticity_total_load
