!> Error of a displacement that comes from the mesh: the energy of the difference between recovered and computed strains.
!>
!> The recovered gradient is the mean of the gradients of the polynomials of an element's vertices
!> (`dotyk_elasticity_patch_fit`), weighted with the linear shape functions. Asymptotically exact where the displacement is
!> smooth and the mesh not too irregular; at corners and edges of contact it sees most of the error, if not all.
module dotyk_elasticity_discretization_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
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
    real(dp) :: rounding_square
    integer :: b, first, last
    square = 0
    rounding_square = 0
    norm_square = 0
    call read_factor(material, factor, error)
    if (allocated(error)) return
    call fit%init(mesh, u)
    last = 0
    do b = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(b)%node, 2)
      call estimate_block(mesh, b, analysis, material, factor, fit, u, square(first:last), norm_square, &
                          rounding_square, error)
      if (allocated(error)) exit
    end do
    ! Bodies that move and have no strain have no error either.
    if (norm_square <= rounding_square) then
      square = 0
      norm_square = 0
    end if
    call factor%destroy()
  end subroutine estimate_discretization_error

  !> The elements of one block.
  subroutine estimate_block(mesh, i_block, analysis, material, factor, fit, u, square, norm_square, rounding_square, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(field_t), intent(in) :: factor
    type(patch_fit_t), intent(in) :: fit
    real(dp), intent(in) :: u(:, :)
    real(dp), intent(out) :: square(:)
    real(dp), intent(inout) :: norm_square
    !> What of it may be rounding [force length].
    real(dp), intent(inout) :: rounding_square
    type(error_t), allocatable, intent(out) :: error
    type(element_table_t) :: table, corners
    type(element_kind_t) :: kind
    real(dp), allocatable :: x(:, :), ue(:, :), g(:, :, :), w(:), stiffness(:)
    integer, allocatable :: node(:), strain(:, :)
    real(dp) :: matrix(6, 6), worst, part, computed(6), recovered(6), difference(6)
    integer :: n, dim, slots, e, q, i, s
    kind = element_kind(mesh%block(i_block)%kind)
    n = kind%n_nodes
    dim = mesh%dimension
    slots = gradient_slots(analysis)
    matrix = material%plane_matrix(analysis)
    strain = reshape([((strain_index(analysis, i, s), i=1, dim), s=1, slots)], [dim, slots])
    call table%init(mesh%block(i_block)%kind, rule_degree(kind))
    call corners%init(kind%corner_kind, rule_degree(kind))
    allocate (x(dim, n), ue(dim, n), node(n), g(n, slots, table%n_points), w(table%n_points), stiffness(table%n_points))
    do e = 1, size(square)
      node(:) = mesh%block(i_block)%node(:, e)
      x(:, :) = mesh%x(:, node)
      ue(:, :) = u(:, node)
      call map_element(n, dim, slots, table%n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
      square(e) = 0
      ! Elements that are inverted at a point of this rule, of a higher degree than that of the stiffness, tell nothing.
      if (.not. worst > 0) cycle
      stiffness = w
      if (.not. factor%constant) call apply_factor(factor, table%shape, x, mesh%block(i_block)%tag(e), stiffness, error)
      if (allocated(error)) return
      do q = 1, table%n_points
        computed = strain_of(dim, slots, strain, matmul(ue, g(:, :, q)))
        recovered = strain_of(dim, slots, strain, recovered_gradient(q))
        difference = recovered - computed
        part = stiffness(q)*dot_product(difference, matmul(matrix, difference))
        square(e) = square(e) + part
        norm_square = norm_square + stiffness(q)*dot_product(computed, matmul(matrix, computed))
        rounding_square = rounding_square + stiffness(q)*maxval(abs(matrix))*(rounding*norm2(ue)*norm2(g(:, :, q)))**2
      end do
    end do

  contains

    !> Mean of the gradients of the vertices' polynomials; the third slot, u/r, is that of the displacement itself, which is of a
    !> higher order.
    function recovered_gradient(q) result(gradient)
      integer, intent(in) :: q
      real(dp) :: gradient(dim, slots), place(dim), own(dim, dim)
      integer :: c
      gradient = 0
      if (slots > dim) gradient(:, slots) = matmul(ue, g(:, slots, q))
      place = matmul(x, table%shape(:, q))
      do c = 1, kind%n_corners
        call fit%gradient(fit%vertex(node(c)), place, own)
        gradient(:, :dim) = gradient(:, :dim) + corners%shape(c, q)*own
      end do
    end function recovered_gradient
  end subroutine estimate_block

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

  !> Degree of the quadrature. The points of the stiffness are those where computed strains are best, and would show too small an error.
  pure integer function rule_degree(kind) result(degree)
    type(element_kind_t), intent(in) :: kind
    degree = 2*kind%order + 1
    if (kind%corner_kind == element_tri3 .or. kind%corner_kind == element_tet4 .or. kind%corner_kind == element_prism6) &
      degree = 2*kind%order + 2
  end function rule_degree
end module dotyk_elasticity_discretization_error
