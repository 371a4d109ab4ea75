!> Discretization error of a displacement: the Zienkiewicz-Zhu estimate, the energy norm of the difference between
!> recovered and computed strains.
!>
!> The recovered gradient is that of the polynomials of the vertices of an element
!> (`dotyk_elasticity_gradient_recovery`: polynomial-preserving recovery), weighted with the linear shape functions.
!> The estimate (Zienkiewicz and Zhu, Int. J. Numer. Methods Eng. 24, 1987) is asymptotically exact where the
!> displacement is smooth and the mesh not too irregular; at corners and at edges of contact it sees most of the
!> error, if not all. In nearly incompressible bodies the projected part of the dilatation
!> (`dotyk_elasticity_projected_dilatation`) is compared with a fit to its element means
!> (`dotyk_elasticity_dilatation_fit`). Thermal strains are the same in both and cancel, but for the dilatation, whose
!> fit is that of the elastic one: times a great bulk modulus, the thermal one would need a better fit.
!>
!> Several bodies of one mesh and material are estimated together: quantities that depend on the mesh are computed
!> once.
module dotyk_elasticity_discretization_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_dilatation_fit, only: dilatation_fit_t, fit_dilatations
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_gradient_recovery, only: gradient_recovery_t, vertex_functions
  use dotyk_elasticity_isoparametric_map, only: interpolate, map_points, point_shape_table_t, physical_gradients
  use dotyk_elasticity_material, only: elements_of_material, material_t, mesh_of_material
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_elasticity_projected_dilatation, only: unprojected_bulk_ratio, n_projection_functions, &
    limit_projected_part, project_onto_functions
  use dotyk_elasticity_shape_table, only: shape_table_t
  use dotyk_linalg_blas, only: dgemm
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_prism6, element_tet4, element_tri3
  implicit none
  private
  public :: estimate_discretization_errors

  !> Strains below this fraction of the sum of their absolute terms are rounding errors: displacements of an
  !> ill-conditioned system carry some hundred epsilon themselves.
  real(dp), parameter :: rounding = 1.0e3_dp*epsilon(1.0_dp)

contains

  !> Squared error of each element in the energy norm, A(e,e), and squared norms A(u,u) of the displacements, of several
  !> bodies of one mesh and material; of the own elements where the rank holds a part of the body.
  subroutine estimate_discretization_errors(mesh, analysis, material, u, recovery, square, norm_square, error, &
                                            thermal, partner, product)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    !> Recovered strains in each material, those of u on return; what is kept of the mesh is reused (n_materials).
    type(gradient_recovery_t), intent(inout) :: recovery(:)
    real(dp), intent(out) :: square(:, :)  !! Squared errors, by elements (n_bodies, n_elements) [energy].
    real(dp), intent(out) :: norm_square(:)  !! Squared energy norms of the displacements (n_bodies) [energy].
    !> Allocated where the modulus field is no formula or not positive; assembly finds this first.
    type(error_t), allocatable, intent(out) :: error
    !> Thermal dilatations of each material at the nodes; none where absent (n_bodies, n_nodes, n_materials) [].
    real(dp), intent(in), optional :: thermal(:, :, :)
    !> For each body an earlier one, or 0, by the error of which its own is multiplied (n_bodies).
    integer, intent(in), optional :: partner(:)
    !> These products A(e, e') over the elements; 0 without a partner (n_bodies, n_elements) [energy].
    real(dp), intent(out), optional :: product(:, :)
    real(dp), allocatable :: element_norm(:, :), element_rounding(:, :), expanded(:, :), products(:, :)
    integer, allocatable :: own(:)
    integer :: with(size(u, 1)), i, m
    with = 0
    if (present(partner)) with = partner
    allocate (products(size(square, 1), size(square, 2)), source=0.0_dp)
    square = 0
    norm_square = 0
    allocate (element_norm(size(square, 1), size(square, 2)), source=0.0_dp)
    allocate (element_rounding(size(square, 1), size(square, 2)), source=0.0_dp)
    ! Strains jump where materials meet: each material has polynomials of its own around the vertices.
    do m = 1, size(material)
      if (present(thermal)) expanded = thermal(:, :, m)
      if (size(material) == 1) then
        call estimate_material(mesh, analysis, material(m), u, expanded, recovery(m), with, square, element_norm, &
                               element_rounding, products, error)
      else
        own = elements_of_material(mesh, m)
        if (size(own) > 0) call estimate_some(material(m), mesh_of_material(mesh, m), recovery(m))
      end if
      if (allocated(error)) exit
    end do
    if (allocated(mesh%whole)) then
      do i = 1, size(norm_square)
        where (.not. mesh%whole%own_element)
          square(i, :) = 0
          element_norm(i, :) = 0
          element_rounding(i, :) = 0
          products(i, :) = 0
        end where
      end do
    end if
    if (present(product)) product = products
    do i = 1, size(norm_square)
      ! Summed in the order of the elements: the same rounding on any number of threads.
      norm_square(i) = sum(element_norm(i, :))
      ! A rigid motion has no strain, and no error.
      if (norm_square(i) > sum(element_rounding(i, :))) cycle
      square(i, :) = 0
      norm_square(i) = 0
    end do

  contains

    !> Estimate the elements of one of several materials.
    subroutine estimate_some(of_material, part, fit)
      type(material_t), intent(in) :: of_material  !! The material.
      type(body_mesh_t), intent(in) :: part  !! Its elements.
      type(gradient_recovery_t), intent(inout) :: fit  !! Recovered strains.
      real(dp), dimension(size(square, 1), size(own)) :: of_part, norm, rounding, times
      of_part = 0
      norm = 0
      rounding = 0
      times = 0
      call estimate_material(part, analysis, of_material, u, expanded, fit, with, of_part, norm, rounding, times, error)
      square(:, own) = of_part
      products(:, own) = times
      element_norm(:, own) = norm
      element_rounding(:, own) = rounding
    end subroutine estimate_some
  end subroutine estimate_discretization_errors

  !> Estimate the elements of one material.
  subroutine estimate_material(mesh, analysis, material, u, expanded, fit, partner, square, norm_square, &
                               rounding_square, product, error)
    type(body_mesh_t), intent(in) :: mesh  !! Its elements, and the nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! The material.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), allocatable, intent(in) :: expanded(:, :)  !! Thermal; or not allocated (n_bodies, n_nodes) [].
    type(gradient_recovery_t), intent(inout) :: fit  !! Recovered strains.
    integer, intent(in) :: partner(:)  !! As in `estimate_discretization_errors` (n_bodies).
    !> Squared errors of the elements, squared energy norms of the displacement on them, bounds of the rounding errors
    !> of these norms, and products with the partners, in the order of the blocks (n_bodies, n_elements) [energy].
    real(dp), dimension(:, :), intent(inout) :: square, norm_square, rounding_square, product
    type(error_t), allocatable, intent(out) :: error  !! Where the modulus field is no formula or not positive.
    type(dilatation_fit_t), allocatable :: dilatation(:)  !! By bodies; empty where none is projected (n_bodies).
    type(material_field_t) :: field  ! The material in space.
    type(shape_table_t) :: table  ! Shape functions at the quadrature points, by nodes.
    type(point_shape_table_t) :: rule, corners  ! The same by points, and the linear ones.
    type(element_kind_t) :: kind
    type(energy_form_t) :: form  ! Strain energy of the unprojected part of the material.
    real(dp) :: bulk  ! Projected part of the bulk modulus.
    integer :: b, first, dim, slots, n_bodies, n_smooth, n_lower
    call field%init(material, error)
    if (allocated(error)) return
    call fit%init(mesh, u)
    call fit_dilatations(mesh, analysis, material, u, expanded, dilatation)
    dim = mesh%dimension
    slots = gradient_slots(analysis)
    n_bodies = fit%n_bodies
    n_smooth = fit%n_strains
    n_lower = fit%monomials%n_lower
    first = 1
    do b = 1, size(mesh%block)
      call estimate_block(mesh%block(b)%kind)
      if (allocated(error)) exit
      first = first + size(mesh%block(b)%node, 2)
    end do
    call field%destroy()

  contains

    !> Estimate the elements of block b.
    subroutine estimate_block(element)
      integer, intent(in) :: element  !! Their kind.
      type(error_t), allocatable :: failed
      real(dp) :: matrix(6, 6), lambda
      integer :: i
      kind = element_kind(element)
      call material%split(analysis, unprojected_bulk_ratio(element, material%incompressibility), matrix, lambda, bulk)
      call form%init(analysis, matrix)
      call table%init(kind%corner_kind, rule_degree(kind))
      call corners%init(table)
      call table%init(element, rule_degree(kind))
      call rule%init(table)
      ! A formula serves one thread: serial where the modulus varies.
      !$omp parallel do default(none) schedule(static) if (field%constant) private(failed) &
      !$omp& shared(mesh, b, kind, rule, element, dim, first, error)
      do i = 1, size(mesh%block(b)%node, 2)
        call estimate_element(kind%n_nodes, kind%n_corners, rule%n_points, n_projection_functions(element, dim), &
                              element, mesh%block(b)%node(:, i), mesh%block(b)%tag(i), first + i - 1, failed)
        if (allocated(failed)) then
          !$omp critical
          if (.not. allocated(error)) call move_alloc(failed, error)
          !$omp end critical
        end if
      end do
      !$omp end parallel do
    end subroutine estimate_block

    !> Estimate one element.
    subroutine estimate_element(n, n_corners, n_points, n_functions, element, node, tag, e, failed)
      integer, intent(in) :: n, n_corners  !! Numbers of nodes and corners of the element.
      integer, intent(in) :: n_points, n_functions  !! Numbers of quadrature points and projection functions.
      integer, intent(in) :: element  !! Its kind.
      integer, intent(in) :: node(n)  !! Its nodes (n).
      integer(int64), intent(in) :: tag  !! Its tag, for messages.
      integer, intent(in) :: e  !! Its number, in the order of the blocks.
      type(error_t), allocatable, intent(out) :: failed  !! Where the modulus field is not positive.
      real(dp) :: x(dim, n), u_e(n_bodies, dim, n), place(n_points, dim)
      real(dp), dimension(n_points) :: radius, g_square, stiffness, projected, fitted, heated, bulk_at, bulk_weight
      real(dp) :: inverse(n_points, dim, dim), by_reference(n_points, n_bodies, dim, dim)
      real(dp) :: displacement(n_points, n_bodies, dim), largest, scale, worst
      real(dp) :: functions(n_points, n_lower, n_corners), coefficient(n_bodies, n_smooth, n_lower, n_corners)
      real(dp) :: recovered(n_points, n_bodies, n_smooth), slope(n_points, dim, slots), strain(n_points, form%n_strains)
      real(dp), allocatable :: matrix(:, :, :), error_strain(:, :, :), error_dilatation(:, :)
      integer :: i, k, s
      square(:, e) = 0
      norm_square(:, e) = 0
      rounding_square(:, e) = 0
      product(:, e) = 0
      x = mesh%x(:, node)
      u_e = u(:, :, node)
      call map_points(n, dim, slots, n_points, rule%shape, rule%shape_square, rule%gradient, rule%products, &
                      rule%weight, x, inverse, radius, g_square, stiffness, worst)
      ! Skipped: elements that are inverted at a point of this rule, of a higher degree than that of the stiffness.
      if (.not. worst > 0) return
      bulk_at = merge(0.0_dp, bulk, field%varies)
      if (field%varies) allocate (matrix(6, 6, n_points), source=0.0_dp)
      if (.not. field%constant) &
        call field%apply(analysis, element, table%shape, x, tag, stiffness(:table%n_points), failed, matrix, bulk_at)
      if (allocated(failed)) return
      largest = form%largest + bulk
      scale = merge(1.0_dp, bulk, field%varies)
      bulk_weight = stiffness
      if (field%varies) then
        largest = maxval(abs(matrix)) + maxval(bulk_at)
        call limit_projected_part(table%n_points, bulk_at, matrix)
        ! Pressures in place of dilatations.
        if (bulk_at(1) > 0) bulk_weight(:table%n_points) = stiffness(:table%n_points)/bulk_at(:table%n_points)
      end if
      do i = 1, dim
        call values_at_points(n_points, n_bodies*dim, n, rule%gradient(:, :, i), u_e, by_reference(:, :, :, i))
      end do
      if (slots > dim) call values_at_points(n_points, n_bodies*dim, n, rule%shape, u_e, displacement)
      call interpolate(n, dim, n_points, rule%shape, x, place)
      call vertex_functions(dim, n_lower, n_corners, n_points, fit%vertex(node(:n_corners)), fit%monomials%parent, &
                            fit%monomials%axis, fit%centre, fit%axes, corners%shape, place, functions)
      do i = 1, n_corners
        coefficient(:, :, :, i) = fit%strain(:, :, :, fit%vertex(node(i)))
      end do
      call values_at_points(n_points, n_bodies*n_smooth, n_lower*n_corners, functions, coefficient, recovered)
      if (any(partner > 0)) &
        allocate (error_strain(n_points, form%n_strains, n_bodies), error_dilatation(n_points, n_bodies))
      do k = 1, n_bodies
        call physical_gradients(dim, slots, n_points, n_bodies, k, by_reference, inverse, displacement, radius, slope)
        call form%strains(n_points, slope, strain)
        norm_square(k, e) = form%energy(stiffness, strain, matrix)
        rounding_square(k, e) = largest*rounding**2*sum(u_e(k, :, :)**2)*dot_product(stiffness, g_square)
        do s = 1, n_smooth
          strain(:, s) = strain(:, s) - recovered(:, k, s)
        end do
        ! The hoop strain of axisymmetric analyses contains no derivative: its error is of a higher order.
        strain(:, n_smooth + 1:) = 0
        square(k, e) = form%energy(stiffness, strain, matrix)
        if (allocated(error_strain)) error_strain(:, :, k) = strain
        if (partner(k) > 0) product(k, e) = form%product(stiffness, strain, error_strain(:, :, partner(k)), matrix)
        if (.not. bulk_at(1) > 0) cycle
        projected = slope(:, 1, 1) + slope(:, 2, 2)
        if (slots > 2) projected = projected + slope(:, merge(3, 1, dim == 3), 3)
        if (field%varies) projected = bulk_at*projected
        call project_onto_functions(dim, n_points, n_functions, place, bulk_weight, projected)
        call dilatation(k)%values(x(:, :n_corners), node(:n_corners), corners%shape, place, fitted)
        if (field%varies) fitted = bulk_at*fitted
        norm_square(k, e) = norm_square(k, e) + scale*dot_product(bulk_weight, projected**2)
        if (allocated(expanded)) then
          heated = matmul(rule%shape, expanded(k, node))
          if (field%varies) heated = bulk_at*heated
          call project_onto_functions(dim, n_points, n_functions, place, bulk_weight, heated)
          projected = projected - heated
        end if
        square(k, e) = square(k, e) + scale*dot_product(bulk_weight, (fitted - projected)**2)
        if (allocated(error_dilatation)) error_dilatation(:, k) = projected - fitted
        if (partner(k) > 0) product(k, e) = product(k, e) + &
          scale*dot_product(bulk_weight, error_dilatation(:, k)*error_dilatation(:, partner(k)))
      end do
    end subroutine estimate_element
  end subroutine estimate_material

  !> Values at the points of an element of functions that are combinations of basis functions.
  subroutine values_at_points(n_points, n_functions, n, shape, f, values)
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: n_functions  !! Number of functions.
    integer, intent(in) :: n  !! Number of basis functions.
    real(dp), intent(in) :: shape(n_points, n)  !! Basis functions at the points (n_points, n) [].
    real(dp), intent(in) :: f(n_functions, n)  !! Coefficients of the functions (n_functions, n) [any].
    real(dp), intent(out) :: values(n_points, n_functions)  !! Values of the functions [unit of f].
    call dgemm('N', 'T', n_points, n_functions, n, 1.0_dp, shape, n_points, f, n_functions, 0.0_dp, values, n_points)
  end subroutine values_at_points

  !> Degree of the quadrature of the estimate: higher than that of the stiffness, whose points are the superconvergent
  !> ones.
  pure integer function rule_degree(kind) result(degree)
    type(element_kind_t), intent(in) :: kind  !! Properties of the element kind.
    degree = 2*kind%order + 1
    if (any(kind%corner_kind == [element_tri3, element_tet4, element_prism6])) degree = 2*kind%order
  end function rule_degree
end module dotyk_elasticity_discretization_error
