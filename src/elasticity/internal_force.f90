!> The forces of a displacement on the nodes, K u, without the loss of digits that the assembled matrix has.
!>
!> K u is small where u is nearly rigid, and then it is what rounding leaves of products that cancel. Here every element first gives up its own
!> translation and rotation, in more digits than doubles have; what is left is strain, and its forces are as good as the strain is. Forces
!> of an element balance each other to rounding of their own size, so that those of a soft support are not lost beside a stiff body.
module dotyk_elasticity_internal_force
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: internal_force

contains

  !> Forces on all nodes, supports included.
  subroutine internal_force(mesh, analysis, material, u, force, energy, error)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Displacements in global axes (dim, n_nodes) [length].
    real(qp), intent(in) :: u(:, :)
    !> (dim, n_nodes) [force].
    real(dp), intent(out) :: force(:, :)
    !> A(u,u) [force length].
    real(dp), intent(out) :: energy
    !> As of assembly, which finds it first.
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    force = 0
    energy = 0
    do i = 1, size(mesh%block)
      call add_block(mesh, i, analysis, material, u, force, energy, error)
      if (allocated(error)) return
    end do
  end subroutine internal_force

  !> The elements of one block.
  subroutine add_block(mesh, i_block, analysis, material, u, force, energy, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    real(qp), intent(in) :: u(:, :)
    real(dp), intent(inout) :: force(:, :), energy
    type(error_t), allocatable, intent(out) :: error
    type(element_quadrature_t) :: points
    real(dp), allocatable :: rest(:, :), element_force(:, :)
    integer :: e, a
    call points%init(mesh, i_block, analysis, material, error)
    if (allocated(error)) return
    associate (n => points%n, dim => points%dim, slots => points%slots)
      allocate (rest(dim, n), element_force(dim, n))
      do e = 1, size(mesh%block(i_block)%node, 2)
        call points%move_to(mesh, i_block, e, error)
        if (allocated(error)) exit
        call take_rigid_part(n, dim, slots, analysis == analysis_axisymmetric, points%g, points%x, u(:, points%node), rest)
        call forces_of_strain(n, dim, slots, points%n_points, points%g, points%stiffness, points%strain, points%matrix, rest, &
                              element_force, energy)
        if (points%bulk > 0) call add_dilatation(n, dim, points%n_functions, points%bulk, points%dilatation, rest, &
                                                 element_force, energy)
        do a = 1, n
          force(:, points%node(a)) = force(:, points%node(a)) + element_force(:, a)
        end do
      end do
    end associate
    call points%destroy()
  end subroutine add_block

  !> Displacements of an element's nodes without the translation of the first one, and without the rotation at the first point.
  pure subroutine take_rigid_part(n, dim, slots, axisymmetric, g, x, u, rest)
    !> Numbers of nodes, components and gradient slots.
    integer, intent(in) :: n, dim, slots
    !> Only the translation along the axis, y, is rigid then.
    logical, intent(in) :: axisymmetric
    !> Gradients of the shape functions at the first point [1/length].
    real(dp), intent(in) :: g(n, slots)
    !> Nodes [length].
    real(dp), intent(in) :: x(dim, n)
    !> Displacements [length].
    real(qp), intent(in) :: u(dim, n)
    real(dp), intent(out) :: rest(dim, n)
    real(qp) :: v(dim, n)
    real(dp) :: slope(dim, dim), rotation
    integer :: a, i, j
    v = u
    do i = merge(2, 1, axisymmetric), dim
      v(i, :) = v(i, :) - u(i, 1)
    end do
    rest = real(v, dp)
    if (axisymmetric) return
    slope = matmul(rest, g(:, :dim))
    do j = 1, dim
      do i = 1, dim
        if (i == j) cycle
        rotation = (slope(i, j) - slope(j, i))/2
        do a = 2, n
          v(i, a) = v(i, a) - rotation*(real(x(j, a), qp) - x(j, 1))
        end do
      end do
    end do
    rest = real(v, dp)
  end subroutine take_rigid_part

  !> Forces of an element, and its part of the energy.
  pure subroutine forces_of_strain(n, dim, slots, n_points, g, w, strain_of, matrix, u, force, energy)
    !> Numbers of nodes, displacement components, gradient slots, quadrature points.
    integer, intent(in) :: n, dim, slots, n_points
    !> Gradients of the shape functions [1/length].
    real(dp), intent(in) :: g(n, slots, n_points)
    !> Weights times the factor on the stiffness [volume].
    real(dp), intent(in) :: w(n_points)
    !> Strain of each component and slot, 0 for none.
    integer, intent(in) :: strain_of(dim, slots)
    !> From strains to stresses [pressure].
    real(dp), intent(in) :: matrix(6, 6)
    !> Displacements [length].
    real(dp), intent(in) :: u(dim, n)
    !> [force].
    real(dp), intent(out) :: force(dim, n)
    !> Grows [force length].
    real(dp), intent(inout) :: energy
    real(dp) :: strain(6), stress(6)
    integer :: q, i, s
    force = 0
    do q = 1, n_points
      strain = 0
      do s = 1, slots
        do i = 1, dim
          if (strain_of(i, s) > 0) strain(strain_of(i, s)) = strain(strain_of(i, s)) + dot_product(u(i, :), g(:, s, q))
        end do
      end do
      stress = w(q)*matmul(matrix, strain)
      energy = energy + dot_product(strain, stress)
      do s = 1, slots
        do i = 1, dim
          if (strain_of(i, s) > 0) force(i, :) = force(i, :) + stress(strain_of(i, s))*g(:, s, q)
        end do
      end do
    end do
  end subroutine forces_of_strain

  !> Add what the projected dilatation gives.
  pure subroutine add_dilatation(n, dim, n_functions, bulk, d, u, force, energy)
    !> Numbers of nodes, displacement components, functions.
    integer, intent(in) :: n, dim, n_functions
    !> Projected part of the bulk modulus [pressure].
    real(dp), intent(in) :: bulk
    !> From `projected_dilatations`.
    real(dp), intent(in) :: d(n, dim, n_functions)
    !> Displacements [length].
    real(dp), intent(in) :: u(dim, n)
    !> Grow [force], [force length].
    real(dp), intent(inout) :: force(dim, n), energy
    real(dp) :: amplitude
    integer :: j
    do j = 1, n_functions
      amplitude = sum(transpose(u)*d(:, :, j))
      force = force + bulk*amplitude*transpose(d(:, :, j))
      energy = energy + bulk*amplitude**2
    end do
  end subroutine add_dilatation
end module dotyk_elasticity_internal_force
