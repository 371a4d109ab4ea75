!> From displacements to stresses and energy, with the quadrature of the stiffness.
module dotyk_elasticity_stress_energy
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: stresses_and_energy

contains

  !> Mean stress of each element, and the energy of all.
  subroutine stresses_and_energy(mesh, analysis, material, u, stress, energy, error, mean_modulus_factor)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    !> Stresses, order xx yy zz yz xz xy (6, n_elements) [pressure].
    real(dp), intent(out) :: stress(:, :)
    !> Strain energy [force length].
    real(dp), intent(out) :: energy
    !> Allocated where an element or the factor on the stiffness is wrong; assembly finds that first.
    type(error_t), allocatable, intent(out) :: error
    !> Mean of the factor on the stiffness over each element (n_elements).
    real(dp), intent(out), optional :: mean_modulus_factor(:)
    real(dp), allocatable :: of_element(:), factor(:)
    integer :: i, first, last
    stress = 0
    allocate (of_element(size(stress, 2)), factor(size(stress, 2)), source=0.0_dp)
    last = 0
    do i = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(i)%node, 2)
      call recover_block(mesh, i, analysis, material, u, stress(:, first:last), of_element(first:last), &
                         factor(first:last), error)
      if (allocated(error)) exit
    end do
    ! In the order of the elements: the same digits on any number of threads.
    energy = sum(of_element)
    if (present(mean_modulus_factor)) mean_modulus_factor = factor
  end subroutine stresses_and_energy

  !> The elements of one block, shared out over the threads.
  subroutine recover_block(mesh, i_block, analysis, material, u, stress, energy, mean_modulus_factor, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    real(dp), intent(in) :: u(:, :)
    !> Of the elements of the block.
    real(dp), intent(inout) :: stress(:, :), energy(:), mean_modulus_factor(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: failed
    integer :: n, s, n_shares
    n = size(energy)
    n_shares = merge(1, min(n, omp_get_max_threads()), omp_in_parallel())
    !$omp parallel do default(none) schedule(static, 1) private(failed) &
    !$omp& shared(mesh, i_block, analysis, material, u, stress, energy, mean_modulus_factor, error, n, n_shares)
    do s = 1, n_shares
      call recover_elements(mesh, i_block, analysis, material, u, (n*(s - 1))/n_shares + 1, (n*s)/n_shares, stress, &
                            energy, mean_modulus_factor, failed)
      if (.not. allocated(failed)) cycle
      !$omp critical(dotyk_recovery)
      if (.not. allocated(error)) call move_alloc(failed, error)
      !$omp end critical(dotyk_recovery)
    end do
    !$omp end parallel do
  end subroutine recover_block

  !> Some elements of a block.
  subroutine recover_elements(mesh, i_block, analysis, material, u, first, last, stress, energy, mean_modulus_factor, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    real(dp), intent(in) :: u(:, :)
    !> From the first to the last of these.
    integer, intent(in) :: first, last
    !> Of all elements of the block.
    real(dp), intent(inout) :: stress(:, :), energy(:), mean_modulus_factor(:)
    type(error_t), allocatable, intent(out) :: error
    type(element_quadrature_t) :: points
    real(dp), allocatable :: ue(:, :)
    real(dp) :: volume, stiffness
    integer :: e
    call points%init(mesh, i_block, analysis, material, error)
    if (allocated(error)) return
    associate (n => points%n, dim => points%dim, m => points%n_points)
      allocate (ue(dim, n))
      do e = first, last
        call points%move_to(mesh, i_block, e, error)
        if (allocated(error)) exit
        ue(:, :) = u(:, points%node)
        call element_stress_energy(n, dim, points%slots, m, points%g, points%w, points%stiffness, points%strain, points%matrix, &
                                   ue, stress(:, e), energy(e))
        volume = sum(points%w(:m))
        stiffness = sum(points%stiffness(:m))
        mean_modulus_factor(e) = stiffness/volume
        if (points%bulk > 0) call add_dilatation(n, dim, points%n_functions, points%bulk, points%dilatation, volume, stiffness, &
                                                 ue, stress(1:3, e), energy(e))
      end do
    end associate
    call points%destroy()
  end subroutine recover_elements

  !> Mean stress of an element, and its energy.
  pure subroutine element_stress_energy(n, dim, slots, n_points, g, w, stiffness, strain_of, matrix, u, stress, energy)
    !> Numbers of nodes, displacement components, gradient slots, quadrature points.
    integer, intent(in) :: n, dim, slots, n_points
    !> Gradients of the shape functions [1/length].
    real(dp), intent(in) :: g(n, slots, n_points)
    !> Weights, and weights times the factor on the stiffness [volume].
    real(dp), intent(in) :: w(n_points), stiffness(n_points)
    !> Strain of each component and slot, 0 for none.
    integer, intent(in) :: strain_of(dim, slots)
    !> From strains to stresses [pressure].
    real(dp), intent(in) :: matrix(6, 6)
    !> Displacements [length].
    real(dp), intent(in) :: u(dim, n)
    !> Mean stress [pressure].
    real(dp), intent(out) :: stress(6)
    !> [force length].
    real(dp), intent(out) :: energy
    real(dp) :: strain(6), total(6), slope
    integer :: q, i, s, a
    total = 0
    energy = 0
    do q = 1, n_points
      strain = 0
      do s = 1, slots
        do i = 1, dim
          if (strain_of(i, s) == 0) cycle
          slope = 0
          do a = 1, n
            slope = slope + u(i, a)*g(a, s, q)
          end do
          strain(strain_of(i, s)) = strain(strain_of(i, s)) + slope
        end do
      end do
      stress = matmul(matrix, strain)
      energy = energy + 0.5_dp*stiffness(q)*dot_product(strain, stress)
      total = total + stiffness(q)*stress
    end do
    stress = total/sum(w)
  end subroutine element_stress_energy

  !> Add the part of the projected dilatation to the mean stress of an element and its energy.
  pure subroutine add_dilatation(n, dim, n_functions, bulk, d, volume, stiffness, u, normal_stress, energy)
    !> Numbers of nodes, displacement components, functions.
    integer, intent(in) :: n, dim, n_functions
    !> Projected part of the bulk modulus [pressure].
    real(dp), intent(in) :: bulk
    !> From `projected_dilatations`.
    real(dp), intent(in) :: d(n*dim, n_functions)
    !> Volume, and the same weighted with the factor on the stiffness [volume].
    real(dp), intent(in) :: volume, stiffness
    !> Displacements [length].
    real(dp), intent(in) :: u(dim, n)
    !> Mean stresses xx, yy, zz [pressure].
    real(dp), intent(inout) :: normal_stress(3)
    !> [force length].
    real(dp), intent(inout) :: energy
    real(dp) :: amplitude(n_functions)
    amplitude = matmul(reshape(transpose(u), [n*dim]), d)
    ! The functions after the first, which is constant, have no mean.
    normal_stress = normal_stress + bulk*amplitude(1)*sqrt(stiffness)/volume
    energy = energy + 0.5_dp*bulk*sum(amplitude**2)
  end subroutine add_dilatation
end module dotyk_elasticity_stress_energy
