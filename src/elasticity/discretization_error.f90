!> Error of a displacement that comes from the mesh: the energy of the difference between recovered and computed strains.
!>
!> The recovered gradient is the mean of the gradients of the polynomials of an element's vertices
!> (`dotyk_elasticity_gradient_recovery`), weighted with the linear shape functions. Asymptotically exact where the displacement is
!> smooth and the mesh not too irregular; at corners and edges of contact it sees most of the error, if not all. Of a nearly
!> incompressible body what counts of the dilatation is mostly its projection (`dotyk_elasticity_projected_dilatation`), and the recovered one is a
!> fit to its means (`dotyk_elasticity_dilatation_fit`).
!>
!> Several bodies of one mesh and material are looked at together: what depends on the mesh is made once.
module dotyk_elasticity_discretization_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio, n_projection_functions, project_onto_functions
  use dotyk_elasticity_dilatation_fit, only: dilatation_fit_t, fit_dilatations
  use dotyk_elasticity_shape_table, only: shape_table_t
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_gradient_recovery, only: gradient_recovery_t, vertex_functions
  use dotyk_elasticity_isoparametric_map, only: interpolate, map_points, point_shape_table_t, to_space
  use dotyk_elasticity_modulus_field, only: apply_modulus_field, read_modulus_field
  use dotyk_linalg_blas, only: dgemm
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_prism6, element_tet4, element_tri3
  implicit none
  private
  public :: estimate_discretization_error, estimate_discretization_errors

  !> Strains below this, relative to what displacements give without cancellation, are rounding errors.
  real(dp), parameter :: rounding = 1.0e3_dp*epsilon(1.0_dp)

contains

  !> Squared error of each element in the energy norm, A(e,e), and the squared norm A(u,u) of the displacement.
  subroutine estimate_discretization_error(mesh, analysis, material, u, square, norm_square, error)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :)
    !> Elements in the order of the blocks (n_elements) [force length].
    real(dp), intent(out) :: square(:)
    !> [force length].
    real(dp), intent(out) :: norm_square
    !> Allocated where an element or the factor on the stiffness is wrong; assembly finds that first.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: all_u(:, :, :), all_square(:, :)
    real(dp) :: all_norms(1)
    all_u = reshape(u, [1, size(u, 1), size(u, 2)])
    allocate (all_square(1, size(square)))
    call estimate_discretization_errors(mesh, analysis, material, all_u, all_square, all_norms, error)
    square = all_square(1, :)
    norm_square = all_norms(1)
  end subroutine estimate_discretization_error

  !> The same for several bodies of one mesh and material.
  subroutine estimate_discretization_errors(mesh, analysis, material, u, square, norm_square, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Displacements in the mesh's axes (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> (n_bodies, n_elements) [force length].
    real(dp), intent(out) :: square(:, :)
    !> (n_bodies) [force length].
    real(dp), intent(out) :: norm_square(:)
    type(error_t), allocatable, intent(out) :: error
    type(gradient_recovery_t) :: fit
    type(dilatation_fit_t), allocatable :: dilatation(:)
    type(vector_field_t) :: factor
    real(dp), allocatable :: of_element(:, :), of_rounding(:, :)
    integer :: b, i, first, last
    square = 0
    norm_square = 0
    call read_modulus_field(material, factor, error)
    if (allocated(error)) return
    call fit%init(mesh, u)
    call fit_dilatations(mesh, analysis, material, u, dilatation)
    allocate (of_element(size(square, 1), size(square, 2)), of_rounding(size(square, 1), size(square, 2)), source=0.0_dp)
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      call estimate_block(mesh, b, analysis, material, factor, fit, dilatation, u, square(:, first:last), &
                          of_element(:, first:last), of_rounding(:, first:last), error)
      if (allocated(error)) exit
    end do
    call factor%destroy()
    do i = 1, size(norm_square)
      ! In the order of the elements: the same digits on any number of threads.
      norm_square(i) = sum(of_element(i, :))
      ! Bodies that move and have no strain have no error either.
      if (norm_square(i) > sum(of_rounding(i, :))) cycle
      square(i, :) = 0
      norm_square(i) = 0
    end do
  end subroutine estimate_discretization_errors

  !> The elements of one block.
  subroutine estimate_block(mesh, i_block, analysis, material, factor, fit, dilatation, u, square, norm_square, rounding_square, &
      error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(vector_field_t), intent(in) :: factor
    type(gradient_recovery_t), intent(in) :: fit
    type(dilatation_fit_t), intent(in) :: dilatation(:)
    real(dp), intent(in), contiguous :: u(:, :, :)
    !> Squared errors, squared norms of the displacement, and what of these may be rounding (n_bodies, n_elements).
    real(dp), intent(out), contiguous :: square(:, :), norm_square(:, :), rounding_square(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: of_element
    type(shape_table_t) :: table
    type(point_shape_table_t) :: rule, corners
    type(element_kind_t) :: kind
    type(energy_form_t) :: form
    real(dp) :: matrix(6, 6), lambda, bulk
    integer :: e
    kind = element_kind(mesh%block(i_block)%kind)
    call material%split(analysis, unprojected_bulk_ratio(mesh%block(i_block)%kind, material%incompressibility), &
                        matrix, lambda, bulk)
    call form%init(analysis, matrix)
    call table%init(kind%corner_kind, rule_degree(kind))
    call corners%init(table)
    call table%init(mesh%block(i_block)%kind, rule_degree(kind))
    call rule%init(table)
    ! One formula serves one thread.
    !$omp parallel do default(none) schedule(static) if (factor%constant) private(of_element) &
    !$omp& shared(mesh, i_block, analysis, form, bulk, factor, fit, dilatation, kind, table, rule, corners, u, square, &
    !$omp& norm_square, rounding_square, error)
    do e = 1, size(square, 2)
      associate (node => mesh%block(i_block)%node(:, e))
        call estimate_element(kind%n_nodes, kind%n_corners, mesh%dimension, gradient_slots(analysis), rule%n_points, &
                              fit%n_bodies, fit%n_strains, fit%monomials%n_lower, &
                              n_projection_functions(mesh%block(i_block)%kind, mesh%dimension), form, bulk, factor, table, rule, &
                              corners%shape, fit, dilatation, mesh%block(i_block)%tag(e), node, mesh%x, u, square(:, e), &
                              norm_square(:, e), rounding_square(:, e), of_element)
      end associate
      if (allocated(of_element)) then
        !$omp critical
        if (.not. allocated(error)) call move_alloc(of_element, error)
        !$omp end critical
      end if
    end do
    !$omp end parallel do
  end subroutine estimate_block

  !> One element.
  subroutine estimate_element(n, n_corners, dim, slots, n_points, n_bodies, n_smooth, n_lower, n_functions, form, bulk, &
      factor, table, rule, corner_shape, fit, dilatation, tag, node, all_x, all_u, square, norm_square, rounding_square, error)
    !> Number of nodes and corners of the element; dimension; gradient slots; points; bodies; recovered strains; monomials of these;
    !> functions that the dilatation is projected on.
    integer, intent(in) :: n, n_corners, dim, slots, n_points, n_bodies, n_smooth, n_lower, n_functions
    type(energy_form_t), intent(in) :: form
    !> Bulk modulus of the projected dilatation [pressure].
    real(dp), intent(in) :: bulk
    type(vector_field_t), intent(in) :: factor
    !> Shape functions at the points, in two forms, and the linear ones.
    type(shape_table_t), intent(in) :: table
    type(point_shape_table_t), intent(in) :: rule
    real(dp), intent(in) :: corner_shape(n_points, n_corners)
    type(gradient_recovery_t), intent(in) :: fit
    type(dilatation_fit_t), intent(in) :: dilatation(:)
    !> For messages.
    integer(int64), intent(in) :: tag
    !> Its nodes, and coordinates and displacements of all nodes of the bodies [length].
    integer, intent(in) :: node(n)
    real(dp), intent(in) :: all_x(dim, *), all_u(n_bodies, dim, *)
    real(dp), intent(out) :: square(n_bodies), norm_square(n_bodies), rounding_square(n_bodies)
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: x(dim, n), u(n_bodies, dim, n), place(n_points, dim)
    real(dp), dimension(n_points) :: radius, g_square, stiffness
    real(dp) :: inverse(n_points, dim, dim), by_reference(n_points, n_bodies, dim, dim), displacement(n_points, n_bodies, dim)
    real(dp) :: functions(n_points, n_lower, n_corners), coefficient(n_bodies, n_smooth, n_lower, n_corners)
    real(dp) :: recovered(n_points, n_bodies, n_smooth), slope(n_points, dim, slots), strain(n_points, form%n_strains), worst
    real(dp) :: projected(n_points), fitted(n_points)
    integer :: b, i, s
    square = 0
    norm_square = 0
    rounding_square = 0
    do i = 1, n
      x(:, i) = all_x(:, node(i))
      u(:, :, i) = all_u(:, :, node(i))
    end do
    call map_points(n, dim, slots, n_points, rule%shape, rule%shape_square, rule%gradient, rule%products, rule%weight, x, inverse, &
                    radius, g_square, stiffness, worst)
    ! Elements that are inverted at a point of this rule, of a higher degree than that of the stiffness, tell nothing.
    if (.not. worst > 0) return
    if (.not. factor%constant) call apply_modulus_field(factor, table%shape, x, tag, stiffness(:table%n_points), error)
    if (allocated(error)) return
    do i = 1, dim
      call values_at_points(n_points, n_bodies*dim, n, rule%gradient(:, :, i), u, by_reference(:, :, :, i))
    end do
    if (slots > dim) call values_at_points(n_points, n_bodies*dim, n, rule%shape, u, displacement)
    call interpolate(n, dim, n_points, rule%shape, x, place)
    call vertex_functions(dim, n_lower, n_corners, n_points, fit%vertex(node(:n_corners)), fit%monomials%parent, &
                          fit%monomials%axis, fit%centre, fit%axes, corner_shape, place, functions)
    do i = 1, n_corners
      coefficient(:, :, :, i) = fit%strain(:, :, :, fit%vertex(node(i)))
    end do
    call values_at_points(n_points, n_bodies*n_smooth, n_lower*n_corners, functions, coefficient, recovered)
    do b = 1, n_bodies
      call to_space(dim, slots, n_points, n_bodies, b, by_reference, inverse, displacement, radius, slope)
      call form%strains(n_points, slope, strain)
      norm_square(b) = form%energy(stiffness, strain)
      rounding_square(b) = (form%largest + bulk)*rounding**2*sum(u(b, :, :)**2)*dot_product(stiffness, g_square)
      do s = 1, n_smooth
        strain(:, s) = strain(:, s) - recovered(:, b, s)
      end do
      ! The strain zz of axisymmetric analyses is that of the displacement itself, which is of a higher order.
      strain(:, n_smooth + 1:) = 0
      square(b) = form%energy(stiffness, strain)
      if (.not. bulk > 0) cycle
      projected = slope(:, 1, 1) + slope(:, 2, 2)
      if (slots > 2) projected = projected + slope(:, merge(3, 1, dim == 3), 3)
      call project_onto_functions(dim, n_points, n_functions, place, stiffness, projected)
      call dilatation(b)%values(x(:, :n_corners), node(:n_corners), corner_shape, place, fitted)
      norm_square(b) = norm_square(b) + bulk*dot_product(stiffness, projected**2)
      square(b) = square(b) + bulk*dot_product(stiffness, (fitted - projected)**2)
    end do
  end subroutine estimate_element

  !> Values of functions at the points of an element.
  subroutine values_at_points(n_points, n_functions, n, shape, f, values)
    integer, intent(in) :: n_points, n_functions, n
    !> What the functions are made of.
    real(dp), intent(in) :: shape(n_points, n)
    !> Coefficients of the functions.
    real(dp), intent(in) :: f(n_functions, n)
    real(dp), intent(out) :: values(n_points, n_functions)
    call dgemm('N', 'T', n_points, n_functions, n, 1.0_dp, shape, n_points, f, n_functions, 0.0_dp, values, n_points)
  end subroutine values_at_points

  !> Degree of the quadrature: more than that of the stiffness, whose points are those where computed strains are best.
  pure integer function rule_degree(kind) result(degree)
    type(element_kind_t), intent(in) :: kind
    degree = 2*kind%order + 1
    if (any(kind%corner_kind == [element_tri3, element_tet4, element_prism6])) degree = 2*kind%order
  end function rule_degree
end module dotyk_elasticity_discretization_error
