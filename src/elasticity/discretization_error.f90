!> Error of a displacement that comes from the mesh: the energy of the difference between recovered and computed strains.
!>
!> The recovered gradient is the mean of the gradients of the polynomials of an element's vertices
!> (`dotyk_elasticity_patch_fit`), weighted with the linear shape functions. Asymptotically exact where the displacement is
!> smooth and the mesh not too irregular; at corners and edges of contact it sees most of the error, if not all. Of a nearly
!> incompressible body what counts of the dilatation is mostly its projection (`dotyk_elasticity_dilatation`), and the recovered one is a
!> fit to its means (`dotyk_elasticity_dilatation_fit`).
module dotyk_elasticity_discretization_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_analysis, only: analysis_plane_stress, gradient_slots
  use dotyk_elasticity_assembly, only: apply_factor, read_factor
  use dotyk_elasticity_dilatation, only: kept_bulk, n_projections, project
  use dotyk_elasticity_dilatation_fit, only: dilatation_fit_t, mean_dilatations
  use dotyk_elasticity_element_table, only: element_table_t
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_field, only: field_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_patch_fit, only: mean_strains, patch_fit_t
  use dotyk_elasticity_point_map, only: interpolate, map_points, point_table_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_prism6, element_tet4, element_tri3
  implicit none
  private
  public :: estimate_discretization_error

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
    type(patch_fit_t) :: fit
    type(dilatation_fit_t) :: dilatation
    type(field_t) :: factor
    real(dp), allocatable :: of_element(:), of_rounding(:)
    integer :: b, first, last
    square = 0
    norm_square = 0
    call read_factor(material, factor, error)
    if (allocated(error)) return
    call fit%init(mesh, u)
    if (is_projected(mesh, analysis, material)) call fit_dilatation(mesh, analysis, fit, u, dilatation)
    allocate (of_element(size(square)), of_rounding(size(square)), source=0.0_dp)
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      call estimate_block(mesh, b, analysis, material, factor, fit, dilatation, u, square(first:last), &
                          of_element(first:last), of_rounding(first:last), error)
      if (allocated(error)) exit
    end do
    call factor%destroy()
    ! In the order of the elements: the same digits on any number of threads.
    norm_square = sum(of_element)
    ! Bodies that move and have no strain have no error either.
    if (norm_square <= sum(of_rounding)) then
      square = 0
      norm_square = 0
    end if
  end subroutine estimate_discretization_error

  !> Whether a part of the dilatation is projected on some element.
  pure logical function is_projected(mesh, analysis, material)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    integer :: b
    is_projected = .false.
    if (analysis == analysis_plane_stress) return
    do b = 1, size(mesh%block)
      if (material%incompressibility > kept_bulk(mesh%block(b)%kind, material%incompressibility)) is_projected = .true.
    end do
  end function is_projected

  !> A continuous dilatation from the means of the elements.
  subroutine fit_dilatation(mesh, analysis, fit, u, dilatation)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: analysis
    type(patch_fit_t), intent(in) :: fit
    real(dp), intent(in), contiguous :: u(:, :)
    type(dilatation_fit_t), intent(out) :: dilatation
    real(dp), allocatable :: mean(:), centre(:, :), volume(:)
    integer :: b, first, last
    allocate (mean(mesh%n_elements()), centre(mesh%dimension, mesh%n_elements()), volume(mesh%n_elements()))
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      call mean_dilatations(mesh, b, analysis, rule_degree(element_kind(mesh%block(b)%kind)), u, mean(first:last), &
                            centre(:, first:last), volume(first:last))
    end do
    call dilatation%init(mesh, fit, mean, centre, volume)
  end subroutine fit_dilatation

  !> The elements of one block.
  subroutine estimate_block(mesh, i_block, analysis, material, factor, fit, dilatation, u, square, norm_square, rounding_square, &
      error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(field_t), intent(in) :: factor
    type(patch_fit_t), intent(in) :: fit
    type(dilatation_fit_t), intent(in) :: dilatation
    real(dp), intent(in) :: u(:, :)
    !> Squared errors, squared norms of the displacement, and what of these may be rounding (n_elements).
    real(dp), intent(out) :: square(:), norm_square(:), rounding_square(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: of_element
    type(element_table_t) :: table
    type(point_table_t) :: rule, corners
    type(element_kind_t) :: kind
    type(energy_form_t) :: form
    real(dp) :: matrix(6, 6), lambda, bulk
    integer :: e
    kind = element_kind(mesh%block(i_block)%kind)
    call material%split(analysis, kept_bulk(mesh%block(i_block)%kind, material%incompressibility), matrix, lambda, bulk)
    call form%init(analysis, matrix)
    call table%init(kind%corner_kind, rule_degree(kind))
    call corners%init(table)
    call table%init(mesh%block(i_block)%kind, rule_degree(kind))
    call rule%init(table)
    ! One formula serves one thread.
    !$omp parallel do default(none) schedule(static) if (factor%constant) private(of_element) &
    !$omp& shared(mesh, i_block, analysis, form, bulk, factor, fit, dilatation, kind, table, rule, corners, u, square, &
    !$omp& norm_square, rounding_square, error)
    do e = 1, size(square)
      associate (node => mesh%block(i_block)%node(:, e))
        call estimate_element(kind%n_nodes, kind%n_corners, mesh%dimension, gradient_slots(analysis), rule%n_points, &
                              n_projections(mesh%block(i_block)%kind, mesh%dimension), form, bulk, factor, table, rule, &
                              corners%shape, fit, dilatation, mesh%block(i_block)%tag(e), node, mesh%x, u, square(e), &
                              norm_square(e), rounding_square(e), of_element)
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
  subroutine estimate_element(n, n_corners, dim, slots, n_points, n_functions, form, bulk, factor, table, rule, corner_shape, &
      fit, dilatation, tag, node, all_x, all_u, square, norm_square, rounding_square, error)
    !> Number of nodes and corners of the element; dimension; gradient slots; points; functions that the dilatation is projected on.
    integer, intent(in) :: n, n_corners, dim, slots, n_points, n_functions
    type(energy_form_t), intent(in) :: form
    !> Bulk modulus of the projected dilatation [pressure].
    real(dp), intent(in) :: bulk
    type(field_t), intent(in) :: factor
    !> Shape functions at the points, in two forms, and the linear ones.
    type(element_table_t), intent(in) :: table
    type(point_table_t), intent(in) :: rule
    real(dp), intent(in) :: corner_shape(n_points, n_corners)
    type(patch_fit_t), intent(in) :: fit
    type(dilatation_fit_t), intent(in) :: dilatation
    !> For messages.
    integer(int64), intent(in) :: tag
    !> Its nodes, and coordinates and displacements of all nodes of the body [length].
    integer, intent(in) :: node(n)
    real(dp), intent(in) :: all_x(dim, *), all_u(dim, *)
    real(dp), intent(out) :: square, norm_square, rounding_square
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: x(dim, n), u(dim, n), stiffness(n_points), g_square(n_points), place(n_points, dim), slope(n_points, dim, slots)
    real(dp) :: strain(n_points, form%n_strains), recovered(n_points, fit%n_strains), worst
    real(dp) :: projected(n_points), fitted(n_points)
    integer :: i
    do i = 1, n
      x(:, i) = all_x(:, node(i))
      u(:, i) = all_u(:, node(i))
    end do
    square = 0
    norm_square = 0
    rounding_square = 0
    call map_points(n, dim, slots, n_points, rule%shape, rule%shape_square, rule%gradient, rule%products, rule%weight, x, u, &
                    slope, g_square, stiffness, worst)
    ! Elements that are inverted at a point of this rule, of a higher degree than that of the stiffness, tell nothing.
    if (.not. worst > 0) return
    if (.not. factor%constant) call apply_factor(factor, table%shape, x, tag, stiffness(:table%n_points), error)
    if (allocated(error)) return
    call form%strains(n_points, slope, strain)
    norm_square = form%energy(stiffness, strain)
    rounding_square = (form%largest + bulk)*rounding**2*sum(u**2)*dot_product(stiffness, g_square)
    call interpolate(n, dim, n_points, rule%shape, x, place)
    call mean_strains(dim, fit%monomials%n_lower, fit%n_strains, n_corners, n_points, fit%vertex(node(:n_corners)), &
                      fit%monomials%parent, fit%monomials%axis, fit%centre, fit%axes, fit%strain, corner_shape, place, recovered)
    ! The strain zz of axisymmetric analyses is that of the displacement itself, which is of a higher order.
    strain(:, fit%n_strains + 1:) = 0
    strain(:, :fit%n_strains) = strain(:, :fit%n_strains) - recovered
    square = form%energy(stiffness, strain)
    if (.not. bulk > 0) return
    projected = slope(:, 1, 1) + slope(:, 2, 2)
    if (slots > 2) projected = projected + slope(:, merge(3, 1, dim == 3), 3)
    call project(dim, n_points, n_functions, place, stiffness, projected)
    call dilatation%values(fit, fit%vertex(node(:n_corners)), corner_shape, place, fitted)
    norm_square = norm_square + bulk*dot_product(stiffness, projected**2)
    square = square + bulk*dot_product(stiffness, (fitted - projected)**2)
  end subroutine estimate_element

  !> Degree of the quadrature: more than that of the stiffness, whose points are those where computed strains are best.
  pure integer function rule_degree(kind) result(degree)
    type(element_kind_t), intent(in) :: kind
    degree = 2*kind%order + 1
    if (any(kind%corner_kind == [element_tri3, element_tet4, element_prism6])) degree = 2*kind%order
  end function rule_degree
end module dotyk_elasticity_discretization_error
