!> Error of a displacement that comes from the mesh: the energy of the difference between recovered and computed strains.
!>
!> The recovered gradient is the mean of the gradients of the polynomials of an element's vertices
!> (`dotyk_elasticity_patch_fit`), weighted with the linear shape functions. Asymptotically exact where the displacement is
!> smooth and the mesh not too irregular; at corners and edges of contact it sees most of the error, if not all.
module dotyk_elasticity_discretization_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_analysis, only: gradient_slots, strain_index
  use dotyk_elasticity_assembly, only: apply_factor, read_factor
  use dotyk_elasticity_element_table, only: element_table_t, map_element
  use dotyk_elasticity_field, only: field_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_patch_fit, only: patch_fit_t
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
    real(dp), intent(in) :: u(:, :)
    !> Elements in the order of the blocks (n_elements) [force length].
    real(dp), intent(out) :: square(:)
    !> [force length].
    real(dp), intent(out) :: norm_square
    !> Allocated where an element or the factor on the stiffness is wrong; assembly finds that first.
    type(error_t), allocatable, intent(out) :: error
    type(patch_fit_t) :: fit
    type(field_t) :: factor
    real(dp), allocatable :: of_element(:), of_rounding(:)
    integer :: b, first, last
    square = 0
    norm_square = 0
    call read_factor(material, factor, error)
    if (allocated(error)) return
    call fit%init(mesh, u)
    allocate (of_element(size(square)), of_rounding(size(square)), source=0.0_dp)
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      call estimate_block(mesh, b, analysis, material, factor, fit, u, square(first:last), of_element(first:last), &
                          of_rounding(first:last), error)
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

  !> The elements of one block.
  subroutine estimate_block(mesh, i_block, analysis, material, factor, fit, u, square, norm_square, rounding_square, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(field_t), intent(in) :: factor
    type(patch_fit_t), intent(in) :: fit
    real(dp), intent(in) :: u(:, :)
    !> Squared errors, squared norms of the displacement, and what of these may be rounding (n_elements).
    real(dp), intent(out) :: square(:), norm_square(:), rounding_square(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: of_element
    type(element_table_t) :: table, corners
    type(element_kind_t) :: kind
    real(dp) :: matrix(6, 6)
    integer :: e
    kind = element_kind(mesh%block(i_block)%kind)
    matrix = material%plane_matrix(analysis)
    call table%init(mesh%block(i_block)%kind, rule_degree(kind))
    call corners%init(kind%corner_kind, rule_degree(kind))
    ! One formula serves one thread.
    !$omp parallel do default(none) schedule(static) if (factor%constant) private(of_element) &
    !$omp& shared(mesh, i_block, analysis, matrix, factor, fit, kind, table, corners, u, square, norm_square, rounding_square, &
    !$omp& error)
    do e = 1, size(square)
      associate (node => mesh%block(i_block)%node(:, e))
        call estimate_element(kind%n_nodes, kind%n_corners, mesh%dimension, analysis, matrix, factor, table, corners, fit, &
                              mesh%block(i_block)%tag(e), node, mesh%x, u, square(e), norm_square(e), &
                              rounding_square(e), of_element)
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
  subroutine estimate_element(n, n_corners, dim, analysis, matrix, factor, table, corners, fit, tag, node, all_x, all_u, square, &
      norm_square, rounding_square, error)
    !> Number of nodes and corners of the element; dimension.
    integer, intent(in) :: n, n_corners, dim, analysis
    !> From strains to stresses [pressure].
    real(dp), intent(in) :: matrix(6, 6)
    type(field_t), intent(in) :: factor
    !> Shape functions, and the linear ones, at the points.
    type(element_table_t), intent(in) :: table, corners
    type(patch_fit_t), intent(in) :: fit
    !> For messages.
    integer(int64), intent(in) :: tag
    !> Its nodes (n), and coordinates and displacements of all nodes of the body [length].
    integer, intent(in) :: node(n)
    real(dp), intent(in) :: all_x(:, :), all_u(:, :)
    real(dp), intent(out) :: square, norm_square, rounding_square
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: x(dim, n), u(dim, n), g(n, gradient_slots(analysis), table%n_points), w(table%n_points), stiffness(table%n_points)
    real(dp) :: gradient(dim, gradient_slots(analysis)), own(dim, dim), worst, computed(6), difference(6)
    integer :: strain(dim, gradient_slots(analysis)), slots, q, i, s, c
    slots = gradient_slots(analysis)
    do s = 1, slots
      do i = 1, dim
        strain(i, s) = strain_index(analysis, i, s)
      end do
    end do
    do i = 1, n
      x(:, i) = all_x(:, node(i))
      u(:, i) = all_u(:, node(i))
    end do
    square = 0
    norm_square = 0
    rounding_square = 0
    call map_element(n, dim, slots, table%n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
    ! Elements that are inverted at a point of this rule, of a higher degree than that of the stiffness, tell nothing.
    if (.not. worst > 0) return
    stiffness = w
    if (.not. factor%constant) call apply_factor(factor, table%shape, x, tag, stiffness, error)
    if (allocated(error)) return
    do q = 1, table%n_points
      gradient = matmul(u, g(:, :, q))
      computed = strain_of(dim, slots, strain, gradient)
      norm_square = norm_square + stiffness(q)*dot_product(computed, matmul(matrix, computed))
      rounding_square = rounding_square + stiffness(q)*maxval(abs(matrix))*(rounding*norm2(u)*norm2(g(:, :, q)))**2
      ! Recovered minus computed; the third slot, u/r, is that of the displacement itself, which is of a higher order.
      if (slots > dim) gradient(:, slots) = 0
      gradient = -gradient
      do c = 1, n_corners
        call fit%gradient(fit%vertex(node(c)), matmul(x, table%shape(:, q)), own)
        gradient(:, :dim) = gradient(:, :dim) + corners%shape(c, q)*own
      end do
      difference = strain_of(dim, slots, strain, gradient)
      square = square + stiffness(q)*dot_product(difference, matmul(matrix, difference))
    end do
  end subroutine estimate_element

  !> Strains of a displacement gradient.
  pure function strain_of(dim, slots, index, gradient) result(strain)
    integer, intent(in) :: dim, slots
    !> Strain of each component and slot, 0 for none (dim, slots).
    integer, intent(in) :: index(dim, slots)
    real(dp), intent(in) :: gradient(dim, slots)
    real(dp) :: strain(6)
    integer :: i, s
    strain = 0
    do s = 1, slots
      do i = 1, dim
        if (index(i, s) > 0) strain(index(i, s)) = strain(index(i, s)) + gradient(i, s)
      end do
    end do
  end function strain_of

  !> Degree of the quadrature: more than that of the stiffness, whose points are those where computed strains are best.
  pure integer function rule_degree(kind) result(degree)
    type(element_kind_t), intent(in) :: kind
    degree = 2*kind%order + 1
    if (any(kind%corner_kind == [element_tri3, element_tet4, element_prism6])) degree = 2*kind%order
  end function rule_degree
end module dotyk_elasticity_discretization_error
