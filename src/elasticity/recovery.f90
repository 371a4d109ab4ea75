!> From displacements to stresses and energy, with the quadrature of the stiffness.
module dotyk_elasticity_recovery
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_analysis, only: gradient_slots, strain_index
  use dotyk_elasticity_assembly, only: apply_factor, bad_element, read_factor
  use dotyk_elasticity_dilatation, only: kept_bulk, most_projections, n_projections, projected_dilatations, &
    projection_functions
  use dotyk_elasticity_element_table, only: element_table_t, map_element, table_pair_t
  use dotyk_elasticity_field, only: field_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: recover

contains

  !> Mean stress of each element, and the energy of all.
  subroutine recover(mesh, analysis, material, u, stress, energy, error, mean_factor)
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
    real(dp), intent(out), optional :: mean_factor(:)
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
    if (present(mean_factor)) mean_factor = factor
  end subroutine recover

  !> The elements of one block, shared out over the threads.
  subroutine recover_block(mesh, i_block, analysis, material, u, stress, energy, mean_factor, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    real(dp), intent(in) :: u(:, :)
    !> Of the elements of the block.
    real(dp), intent(inout) :: stress(:, :), energy(:), mean_factor(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: failed
    integer :: n, s, n_shares
    n = size(energy)
    n_shares = merge(1, min(n, omp_get_max_threads()), omp_in_parallel())
    !$omp parallel do default(none) schedule(static, 1) private(failed) &
    !$omp& shared(mesh, i_block, analysis, material, u, stress, energy, mean_factor, error, n, n_shares)
    do s = 1, n_shares
      call recover_elements(mesh, i_block, analysis, material, u, (n*(s - 1))/n_shares + 1, (n*s)/n_shares, stress, &
                            energy, mean_factor, failed)
      if (.not. allocated(failed)) cycle
      !$omp critical(dotyk_recovery)
      if (.not. allocated(error)) call move_alloc(failed, error)
      !$omp end critical(dotyk_recovery)
    end do
    !$omp end parallel do
  end subroutine recover_block

  !> Some elements of a block.
  subroutine recover_elements(mesh, i_block, analysis, material, u, first, last, stress, energy, mean_factor, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    real(dp), intent(in) :: u(:, :)
    !> From the first to the last of these.
    integer, intent(in) :: first, last
    !> Of all elements of the block.
    real(dp), intent(inout) :: stress(:, :), energy(:), mean_factor(:)
    type(error_t), allocatable, intent(out) :: error
    type(field_t) :: factor
    type(table_pair_t) :: tables
    type(element_kind_t) :: kind
    real(dp), allocatable :: x(:, :), ue(:, :), g(:), w(:), stiffness(:), value(:), dilatation(:)
    integer, allocatable :: node(:), strain(:, :)
    real(dp) :: matrix(6, 6), lambda, bulk, worst
    integer :: n, dim, slots, most_points, n_functions, e, i, s
    ! One formula serves one thread.
    call read_factor(material, factor, error)
    if (allocated(error)) return
    kind = element_kind(mesh%block(i_block)%kind)
    n = kind%n_nodes
    dim = mesh%dimension
    slots = gradient_slots(analysis)
    call material%split(analysis, kept_bulk(mesh%block(i_block)%kind, material%incompressibility), &
                        matrix, lambda, bulk)
    n_functions = n_projections(mesh%block(i_block)%kind, dim)
    strain = reshape([((strain_index(analysis, i, s), i=1, dim), s=1, slots)], [dim, slots])
    call tables%init_stiffness(mesh%block(i_block)%kind, analysis, .not. factor%constant)
    most_points = max(tables%straight%n_points, tables%curved%n_points)
    allocate (x(dim, n), ue(dim, n), node(n), g(n*slots*most_points), w(most_points), stiffness(most_points))
    allocate (value(most_points*most_projections), dilatation(n*dim*most_projections))
    do e = first, last
      node(:) = mesh%block(i_block)%node(:, e)
      x(:, :) = mesh%x(:, node)
      ue(:, :) = u(:, node)
      if (tables%is_curved(x)) then
        call recover_element(tables%curved)
      else
        call recover_element(tables%straight)
      end if
      if (allocated(error)) exit
    end do
    call factor%destroy()

  contains

    subroutine recover_element(table)
      type(element_table_t), intent(in) :: table
      integer :: n_points
      n_points = table%n_points
      call map_element(n, dim, slots, n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
      if (.not. worst > 0) then
        call bad_element(mesh, i_block, e, error)
        return
      end if
      stiffness(:n_points) = w(:n_points)
      if (.not. factor%constant) then
        call apply_factor(factor, table%shape, x, mesh%block(i_block)%tag(e), stiffness(:n_points), error)
        if (allocated(error)) return
      end if
      call element_stress_energy(n, dim, slots, n_points, g, w, stiffness, strain, matrix, ue, stress(:, e), &
                                 energy(e))
      mean_factor(e) = sum(stiffness(:n_points))/sum(w(:n_points))
      if (.not. bulk > 0) return
      call projection_functions(n, dim, n_points, n_functions, table%shape, x, stiffness, value)
      call projected_dilatations(n, dim, slots, n_points, n_functions, g, stiffness, value, dilatation)
      call add_dilatation(n, dim, n_functions, bulk, dilatation, sum(w(:n_points)), sum(stiffness(:n_points)), ue, &
                          stress(1:3, e), energy(e))
    end subroutine recover_element
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
end module dotyk_elasticity_recovery
