!> Stiffness matrix of a body: element by element into the pattern, without intermediate lists.
module dotyk_elasticity_assembly
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_projected_dilatation, only: add_projected_stiffness
  use dotyk_elasticity_element_ordering, only: morton_order
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_element_partition, only: element_partition_t
  use dotyk_elasticity_stiffness_kernel, only: gradient_products, rotate_blocks, stiffness_general, stiffness_isotropic
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, scatter
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: assemble_stiffness

contains

  !> Add the stiffness of all elements to a matrix of zeros, and the forces of given displacements to the right-hand
  !> side.
  subroutine assemble_stiffness(mesh, analysis, material, constraint, places, matrix, rhs, volume, mean_modulus_factor, error)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    type(constraint_t), intent(in) :: constraint
    !> Places of the blocks.
    type(block_positions_t), intent(in) :: places
    !> The matrix with its pattern.
    type(sparse_symmetric_t), intent(inout) :: matrix
    !> Right-hand side, from which K_fc z is subtracted (n_equations) [force].
    real(dp), intent(inout) :: rhs(:)
    !> Volume of the body, that of the full turn in axisymmetric analyses [length^dim].
    real(dp), intent(out) :: volume
    !> Mean over the volume of the factor on the stiffness [1].
    real(dp), intent(out) :: mean_modulus_factor
    !> Allocated where an element is inverted or the factor is not positive.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: of_element(:), factor_of_element(:)
    integer :: i, first, last
    allocate (of_element(mesh%n_elements()), factor_of_element(mesh%n_elements()))
    volume = 0
    mean_modulus_factor = 0
    last = 0
    do i = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(i)%node, 2)
      call assemble_block(mesh, i, analysis, material, constraint, places, matrix, rhs, of_element(first:last), &
                          factor_of_element(first:last), error)
      if (allocated(error)) return
    end do
    volume = sum(of_element)
    mean_modulus_factor = sum(factor_of_element)/volume
  end subroutine assemble_stiffness

  !> The elements of one block, shared out over the threads.
  subroutine assemble_block(mesh, i_block, analysis, material, constraint, places, matrix, rhs, volume, factor_integral, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(constraint_t), intent(in) :: constraint
    type(block_positions_t), intent(in) :: places
    type(sparse_symmetric_t), intent(inout) :: matrix
    real(dp), intent(inout) :: rhs(:)
    !> Of the elements [length^dim].
    real(dp), intent(inout) :: volume(:), factor_integral(:)
    type(error_t), allocatable, intent(out) :: error
    type(element_partition_t) :: shares
    type(error_t), allocatable :: failed
    logical, allocatable :: special(:)
    integer, allocatable :: order(:)
    integer :: i, s, place, first_failed
    ! Nodes that are neither plainly free nor held at zero.
    allocate (special(mesh%n_nodes()))
    special(:) = constraint%frame_of > 0
    do i = 1, size(special)
      if (any(abs(constraint%prescribed(:, i)) > 0)) special(i) = .true.
    end do
    allocate (order(size(mesh%block(i_block)%node, 2)))
    call morton_order(mesh%dimension, mesh%x, mesh%block(i_block)%node, order)
    call shares%init(mesh%n_nodes(), mesh%block(i_block)%node, order, merge(1, omp_get_max_threads(), omp_in_parallel()))
    first_failed = huge(first_failed)
    !$omp parallel do default(none) schedule(static, 1) private(failed, place) &
    !$omp& shared(mesh, i_block, analysis, material, constraint, places, matrix, rhs, volume, factor_integral, shares, special, &
    !$omp& order, first_failed, error)
    do s = 1, shares%n
      call assemble_share(mesh, i_block, analysis, material, constraint, places, shares, s, special, order, matrix, rhs, &
                          volume, factor_integral, place, failed)
      if (.not. allocated(failed)) cycle
      ! The first one in the order, as with one thread.
      !$omp critical(dotyk_assembly)
      if (place < first_failed) then
        first_failed = place
        call move_alloc(failed, error)
      end if
      !$omp end critical(dotyk_assembly)
    end do
    !$omp end parallel do
  end subroutine assemble_block

  !> One thread's elements of a block.
  subroutine assemble_share(mesh, i_block, analysis, material, constraint, places, shares, share, special, order, matrix, rhs, &
      volume, factor_integral, place, error)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block, analysis
    type(material_t), intent(in) :: material
    type(constraint_t), intent(in) :: constraint
    type(block_positions_t), intent(in) :: places
    type(element_partition_t), intent(in) :: shares
    integer, intent(in) :: share
    !> Nodes that are neither plainly free nor held at zero (n_nodes).
    logical, intent(in) :: special(:)
    !> The element that comes k-th.
    integer, intent(in) :: order(:)
    type(sparse_symmetric_t), intent(inout) :: matrix
    real(dp), intent(inout) :: rhs(:), volume(:), factor_integral(:)
    !> Place of the element that is wrong.
    integer, intent(out) :: place
    type(error_t), allocatable, intent(out) :: error
    type(element_quadrature_t) :: points
    real(dp), allocatable :: products(:), k(:)
    integer, allocatable :: frame_of(:)
    integer :: e, i
    logical :: fast
    place = 0
    call points%init(mesh, i_block, analysis, material, error)
    if (allocated(error)) return
    fast = material%isotropic .and. analysis == analysis_3d
    associate (n => points%n, dim => points%dim)
      allocate (products((n*points%slots)**2), k((n*dim)**2), frame_of(n))
      do i = shares%first(share), shares%first(share + 1) - 1
        place = shares%place(i)
        e = order(place)
        call points%move_to(mesh, i_block, e, error)
        if (allocated(error)) exit
        if (i <= shares%own(share)) then
          volume(e) = sum(points%w(:points%n_points))
          factor_integral(e) = sum(points%stiffness(:points%n_points))
        end if
        call gradient_products(n, points%slots, points%n_points, points%g, points%stiffness, products)
        if (fast) then
          call stiffness_isotropic(n, points%lambda, material%mu, products, k)
        else
          call stiffness_general(n, dim, points%slots, points%strain, points%matrix, products, k)
        end if
        if (points%bulk > 0) call add_projected_stiffness(n, dim, points%n_functions, points%bulk, points%dilatation, k)
        if (any(special(points%node))) then
          frame_of(:) = constraint%frame_of(points%node)
          call rotate_blocks(n, dim, size(constraint%frame, 3), frame_of, constraint%frame, k)
          call move_prescribed(n, dim, size(special), points%node, k, share, shares%owner, constraint%equation, &
                               constraint%prescribed, rhs)
        end if
        call scatter(n, dim, size(special), points%node, k, share, shares%owner, constraint%equation, places%n_free, &
                     places%first, places%neighbour, places%offset, matrix%column_start, matrix%value)
      end do
    end associate
    call points%destroy()
  end subroutine assemble_share

  !> Subtract the forces of given displacements from the right-hand side.
  pure subroutine move_prescribed(n, dim, n_nodes, node, k, share, owner, equation, prescribed, rhs)
    integer, intent(in) :: n, dim, n_nodes
    !> Nodes of the element.
    integer, intent(in) :: node(n)
    !> Stiffness along the nodes' axes: node a, node b, component i, component j.
    real(dp), intent(in) :: k(n, n, dim, dim)
    !> A share, and the one that each node belongs to: forces on nodes of others are left to these.
    integer, intent(in) :: share, owner(n_nodes)
    integer, intent(in) :: equation(dim, n_nodes)
    !> Given displacements along the nodes' axes, zero where free.
    real(dp), intent(in) :: prescribed(dim, n_nodes)
    real(dp), intent(inout) :: rhs(*)
    integer :: a, b, i, j, row
    do b = 1, n
      do j = 1, dim
        if (.not. abs(prescribed(j, node(b))) > 0) cycle
        do i = 1, dim
          do a = 1, n
            if (owner(node(a)) /= share) cycle
            row = equation(i, node(a))
            if (row > 0) rhs(row) = rhs(row) - k(a, b, i, j)*prescribed(j, node(b))
          end do
        end do
      end do
    end do
  end subroutine move_prescribed
end module dotyk_elasticity_assembly
