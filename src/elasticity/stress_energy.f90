!> Mean stresses of elements and strain energy of a displacement, with the quadrature of the stiffness.
module dotyk_elasticity_stress_energy
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_initial_stress, only: add_mean_initial_stress, initial_state_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: stresses_and_energy

contains

  !> Mean stress of each element, and the strain energy.
  subroutine stresses_and_energy(mesh, analysis, material, u, stress, energy, error, mean_modulus_factor, volume, &
                                 initial)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(out) :: stress(:, :)  !! Mean stresses, order xx yy zz yz xz xy (6, n_elements) [pressure].
    !> Strain energy A(u,u)/2, whatever the initial state; of the own elements where the rank holds a part of the body
    !> [energy].
    real(dp), intent(out) :: energy
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    real(dp), intent(out), optional :: mean_modulus_factor(:)  !! Means of the modulus field (n_elements) [].
    real(dp), intent(out), optional :: volume(:)  !! Volume of each element (n_elements) [volume].
    type(initial_state_t), intent(in), optional :: initial  !! Temperature and initial stress; none if absent.
    type(initial_state_t) :: state
    type(error_t), allocatable :: failed
    real(dp), allocatable :: element_energy(:), factor(:), element_volume(:)
    integer :: b, before, n, n_parts, s
    stress = 0
    if (present(initial)) state = initial
    allocate (element_energy(size(stress, 2)), factor(size(stress, 2)), element_volume(size(stress, 2)), source=0.0_dp)
    before = 0
    do b = 1, size(mesh%block)
      n = size(mesh%block(b)%node, 2)
      n_parts = merge(1, min(n, omp_get_max_threads()), omp_in_parallel())
      !$omp parallel do default(none) schedule(static, 1) private(failed) shared(error, n, n_parts)
      do s = 1, n_parts
        call evaluate_elements((n*(s - 1))/n_parts + 1, (n*s)/n_parts, failed)
        if (.not. allocated(failed)) cycle
        !$omp critical(dotyk_recovery)
        if (.not. allocated(error)) call move_alloc(failed, error)
        !$omp end critical(dotyk_recovery)
      end do
      !$omp end parallel do
      if (allocated(error)) exit
      before = before + n
    end do
    ! Summed in the order of the elements: the same rounding on any number of threads.
    if (allocated(mesh%whole)) then
      energy = sum(element_energy, mask=mesh%whole%own_element)
    else
      energy = sum(element_energy)
    end if
    if (present(mean_modulus_factor)) mean_modulus_factor = factor
    if (present(volume)) volume = element_volume

  contains

    !> Evaluate some elements of block b: the work of one thread.
    subroutine evaluate_elements(first, last, failed)
      integer, intent(in) :: first, last  !! The first and the last of them.
      type(error_t), allocatable, intent(out) :: failed  !! Where an element is inverted or the modulus not positive.
      type(element_quadrature_t) :: points
      real(dp), allocatable :: ue(:, :), amplitude(:)
      integer :: e, i
      call points%init(mesh, b, analysis, material, failed)
      if (allocated(failed)) return
      associate (n => points%n, dim => points%dim, m => points%n_points)
        allocate (ue(dim, n), amplitude(points%n_functions))
        do i = first, last
          call points%move_to(mesh, b, i, failed)
          if (allocated(failed)) exit
          e = before + i
          ue(:, :) = u(:, points%node)
          call element_stress_energy(n, dim, points%slots, m, points%g, points%w, points%stiffness, points%strain, &
                                     points%n_matrices, points%matrix, ue, stress(:, e), element_energy(e))
          element_volume(e) = sum(points%w(:m))
          factor(e) = sum(points%stiffness(:m))/element_volume(e)
          if (points%bulk > 0) then
            amplitude = matmul(reshape(transpose(ue), [n*dim]), reshape(points%dilatation, [n*dim, size(amplitude)]))
            element_energy(e) = element_energy(e) + 0.5_dp*points%bulk*sum(amplitude**2)
            stress(1:3, e) = stress(1:3, e) + points%bulk*points%pressure_integral(amplitude)/element_volume(e)
          end if
          if (state%is_set()) call add_mean_initial_stress(points, state, stress(:, e))
        end do
      end associate
      call points%destroy()
    end subroutine evaluate_elements
  end subroutine stresses_and_energy

  !> Mean stress of an element, and its energy.
  pure subroutine element_stress_energy(n, dim, slots, n_points, g, w, stiffness, strain_of, n_matrices, matrix, u, &
                                        stress, energy)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    real(dp), intent(in) :: g(n, slots, n_points)  !! Gradients of the shape functions (n, slots, n_points) [1/length].
    real(dp), intent(in) :: w(n_points)  !! Quadrature weights (n_points) [volume].
    real(dp), intent(in) :: stiffness(n_points)  !! Weights times the modulus field (n_points) [volume].
    integer, intent(in) :: strain_of(dim, slots)  !! Strain index of each component and slot, 0 for none (dim, slots).
    integer, intent(in) :: n_matrices  !! Number of matrices: 1, or one for each point.
    real(dp), intent(in) :: matrix(6, 6, n_matrices)  !! Unprojected, from strains to stresses [pressure].
    real(dp), intent(in) :: u(dim, n)  !! Displacements (dim, n) [length].
    real(dp), intent(out) :: stress(6)  !! Mean stress (6) [pressure].
    real(dp), intent(out) :: energy  !! Strain energy [energy].
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
      stress = matmul(matrix(:, :, min(q, n_matrices)), strain)
      energy = energy + 0.5_dp*stiffness(q)*dot_product(strain, stress)
      total = total + stiffness(q)*stress
    end do
    stress = total/sum(w)
  end subroutine element_stress_energy
end module dotyk_elasticity_stress_energy
