!> Error of a displacement that comes from the mesh: the energy of the difference between recovered and computed strains.
!>
!> The recovered gradient is the mean of the gradients of the polynomials of an element's vertices
!> (`dotyk_elasticity_patch_fit`), weighted with the linear shape functions. Asymptotically exact where the displacement is
!> smooth and the mesh not too irregular; at corners and edges of contact it sees most of the error, if not all.
module dotyk_elasticity_discretization_error
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_assembly, only: apply_factor, read_factor
  use dotyk_elasticity_element_table, only: element_table_t, map_element
  use dotyk_elasticity_energy_form, only: energy_form_t
  use dotyk_elasticity_field, only: field_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_patch_fit, only: add_strains, patch_fit_t
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
    type(energy_form_t) :: form
    real(dp), allocatable :: corner_shape(:, :)
    integer :: e
    kind = element_kind(mesh%block(i_block)%kind)
    call form%init(analysis, material%plane_matrix(analysis))
    call table%init(mesh%block(i_block)%kind, rule_degree(kind))
    call corners%init(kind%corner_kind, rule_degree(kind))
    corner_shape = transpose(corners%shape)
    ! One formula serves one thread.
    !$omp parallel do default(none) schedule(static) if (factor%constant) private(of_element) &
    !$omp& shared(mesh, i_block, analysis, form, factor, fit, kind, table, corner_shape, u, square, norm_square, rounding_square, &
    !$omp& error)
    do e = 1, size(square)
      associate (node => mesh%block(i_block)%node(:, e))
        call estimate_element(kind%n_nodes, kind%n_corners, mesh%dimension, gradient_slots(analysis), form, factor, table, &
                              corner_shape, fit, mesh%block(i_block)%tag(e), node, mesh%x, u, square(e), norm_square(e), &
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
  subroutine estimate_element(n, n_corners, dim, slots, form, factor, table, corner_shape, fit, tag, node, all_x, all_u, square, &
      norm_square, rounding_square, error)
    !> Number of nodes and corners of the element; dimension; gradient slots.
    integer, intent(in) :: n, n_corners, dim, slots
    type(energy_form_t), intent(in) :: form
    type(field_t), intent(in) :: factor
    !> Shape functions at the points, and the linear ones (n_points, n_corners).
    type(element_table_t), intent(in) :: table
    real(dp), intent(in) :: corner_shape(:, :)
    type(patch_fit_t), intent(in) :: fit
    !> For messages.
    integer(int64), intent(in) :: tag
    !> Its nodes (n), and coordinates and displacements of all nodes of the body [length].
    integer, intent(in) :: node(n)
    real(dp), intent(in) :: all_x(:, :), all_u(:, :)
    real(dp), intent(out) :: square, norm_square, rounding_square
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: x(dim, n), u(dim, n), g(n, slots, table%n_points), w(table%n_points), stiffness(table%n_points)
    real(dp) :: strain(table%n_points, form%n_strains), place(table%n_points, dim), g_square(table%n_points)
    real(dp) :: worst
    integer :: q, i, c, s
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
    call computed_strains(n, dim, slots, table%n_points, form%n_strains, form%place, g, u, strain, g_square)
    norm_square = form%energy(stiffness, strain)
    rounding_square = form%largest*rounding**2*sum(u**2)*dot_product(stiffness, g_square)
    ! Recovered minus computed; the third slot, u/r, is that of the displacement itself, which is of a higher order.
    strain(:, fit%n_strains + 1:) = 0
    strain = -strain
    do q = 1, table%n_points
      do i = 1, dim
        place(q, i) = 0
        do c = 1, n
          place(q, i) = place(q, i) + x(i, c)*table%shape(c, q)
        end do
      end do
    end do
    do c = 1, n_corners
      s = fit%vertex(node(c))
      call add_strains(dim, fit%monomials%n_lower, fit%n_strains, table%n_points, fit%monomials%parent, fit%monomials%axis, &
                       fit%centre(:, s), fit%axes(:, :, s), fit%strain(:, :, s), corner_shape(:, c), place, strain)
    end do
    square = form%energy(stiffness, strain)
  end subroutine estimate_element

  !> Strains of the displacement of an element at its points.
  pure subroutine computed_strains(n, dim, slots, n_points, n_strains, strain_of, g, u, strain, g_square)
    integer, intent(in) :: n, dim, slots, n_points, n_strains
    !> The strain to which a slot of a component belongs, 0 for none.
    integer, intent(in) :: strain_of(dim, slots)
    !> Gradients of the shape functions [1/length], and displacements [length].
    real(dp), intent(in) :: g(n, slots, n_points), u(dim, n)
    real(dp), intent(out) :: strain(n_points, n_strains)
    !> Squared norms of the gradients [1/length^2].
    real(dp), intent(out) :: g_square(n_points)
    real(dp) :: slope(dim), square
    integer :: q, s, i, a
    strain = 0
    g_square = 0
    do q = 1, n_points
      do s = 1, slots
        slope = 0
        square = 0
        do a = 1, n
          slope = slope + u(:, a)*g(a, s, q)
          square = square + g(a, s, q)**2
        end do
        g_square(q) = g_square(q) + square
        do i = 1, dim
          if (strain_of(i, s) > 0) strain(q, strain_of(i, s)) = strain(q, strain_of(i, s)) + slope(i)
        end do
      end do
    end do
  end subroutine computed_strains

  !> Degree of the quadrature: more than that of the stiffness, whose points are those where computed strains are best.
  pure integer function rule_degree(kind) result(degree)
    type(element_kind_t), intent(in) :: kind
    degree = 2*kind%order + 1
    if (any(kind%corner_kind == [element_tri3, element_tet4, element_prism6])) degree = 2*kind%order
  end function rule_degree
end module dotyk_elasticity_discretization_error
