!> Assembly of the stiffness matrix of a body, element by element, directly into its sparsity pattern: the matrix of the
!> bilinear form A, in which equilibrium, equation (3), has its weak form; symmetric, continuous, and with enough
!> supports coercive, equations (13), (14), (15).
!>
!> Elements are visited along a Morton curve (`dotyk_mesh_element_ordering`) and distributed over threads so that every
!> sum has the same order on any number of threads (`dotyk_elasticity_element_partition`). Dirichlet conditions are
!> eliminated during assembly: with free unknowns f and prescribed unknowns c, the matrix is K_ff, and K_fc z is
!> subtracted from the right-hand side (Dirichlet lifting). Bodies that a congruent body's factor serves have no matrix:
!> their lifting comes from the elements next to prescribed displacements alone.
module dotyk_elasticity_assembly
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_block_assembly, only: element_stiffness
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_element_partition, only: element_partition_t
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_foundation, only: foundation_points_t
  use dotyk_elasticity_material, only: material_t, weight_moduli
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, build_pattern, scatter
  use dotyk_elasticity_stiffness_kernel, only: rotate_blocks
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: max_facet_nodes
  use dotyk_mesh_element_ordering, only: morton_order
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: assemble_stiffness, extract_elements, subtract_dirichlet_lift

contains

  !> Add the stiffness of all elements, and of springs, to a matrix of zeros, and subtract the forces of prescribed
  !> displacements from the right-hand side.
  subroutine assemble_stiffness(mesh, analysis, material, constraint, positions, matrix, rhs, volume, &
                                mean_modulus_factor, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    type(block_positions_t), intent(in) :: positions  !! Positions of the nodal blocks in the matrix.
    !> Matrix K_ff with its sparsity pattern; values are added to [force/length].
    type(sparse_symmetric_t), intent(inout) :: matrix
    real(dp), intent(inout) :: rhs(:)  !! Right-hand side, from which K_fc z is subtracted (n_equations) [force].
    real(dp), intent(out) :: volume  !! Volume of the body [volume].
    real(dp), intent(out) :: mean_modulus_factor  !! Mean of the modulus field over the volume, see `weight_moduli` [].
    !> Allocated where an element is inverted or the modulus field is not positive at a quadrature point.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: element_volume(:), element_integral(:)
    integer :: i, first, last
    allocate (element_volume(mesh%n_elements()), element_integral(mesh%n_elements()))
    volume = 0
    mean_modulus_factor = 0
    last = 0
    do i = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(i)%node, 2)
      call assemble_block(mesh, i, analysis, material, constraint, positions, matrix, rhs, &
                          element_volume(first:last), element_integral(first:last), error)
      if (allocated(error)) return
      call weight_moduli(material, mesh%block(i)%material, element_integral(first:last))
    end do
    volume = sum(element_volume)
    mean_modulus_factor = 1
    if (volume > 0) mean_modulus_factor = sum(element_integral)/volume
    call add_springs(mesh, analysis, constraint, positions, matrix, rhs)
  end subroutine assemble_stiffness

  !> Add the springs on surfaces: their nodes are neighbours in elements.
  subroutine add_springs(mesh, analysis, constraint, positions, matrix, rhs)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    !> Equations, prescribed displacements, nodal axes and springs of the body.
    type(constraint_t), intent(in) :: constraint
    type(block_positions_t), intent(in) :: positions  !! Positions of the nodal blocks in the matrix.
    type(sparse_symmetric_t), intent(inout) :: matrix  !! Matrix K_ff, added to [force/length].
    real(dp), intent(inout) :: rhs(:)  !! Right-hand side, from which K_fc z is subtracted (n_equations) [force].
    ! One part has all nodes.
    integer, parameter :: part = 1
    type(foundation_points_t) :: points
    real(dp), allocatable :: k(:)
    integer, allocatable :: owner(:)
    integer :: f
    associate (springs => constraint%foundation, dim => mesh%dimension)
      if (springs%n == 0) return
      allocate (owner(mesh%n_nodes()), source=part)
      allocate (k((max_facet_nodes*dim)**2))
      do f = 1, springs%n
        call springs%points_of(mesh%x, analysis, f, points)
        associate (n => points%n_nodes, node => springs%node(:points%n_nodes, f))
          call points%matrix(n, dim, k)
          call rotate_blocks(n, dim, size(constraint%frame, 3), constraint%frame_of(node), constraint%frame, k)
          call subtract_prescribed_forces(n, dim, size(owner), node, k, part, owner, constraint%equation, &
                                          constraint%prescribed, rhs)
          call scatter(n, dim, size(owner), node, k, part, owner, constraint%equation, positions%n_free, &
                       positions%first, positions%neighbour, positions%offset, matrix%column_start, matrix%value)
        end associate
      end do
    end associate
  end subroutine add_springs

  !> Assemble the elements of one block, distributed over the threads.
  subroutine assemble_block(mesh, i_block, analysis, material, constraint, positions, matrix, rhs, volume, &
                            modulus_integral, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    type(block_positions_t), intent(in) :: positions  !! Positions of the nodal blocks in the matrix.
    !> Matrix K_ff with its sparsity pattern; values are added to [force/length].
    type(sparse_symmetric_t), intent(inout) :: matrix
    real(dp), intent(inout) :: rhs(:)  !! Right-hand side, from which K_fc z is subtracted (n_equations) [force].
    real(dp), intent(inout) :: volume(:)  !! Volumes of the elements of the block (n_elements) [volume].
    !> Integrals of the modulus field over the elements (n_elements) [volume].
    real(dp), intent(inout) :: modulus_integral(:)
    !> Allocated as in `assemble_stiffness`: the first failing element of the ordering is named.
    type(error_t), allocatable, intent(out) :: error
    type(element_partition_t) :: partition
    type(error_t), allocatable :: failed
    logical, allocatable :: needs_transform(:)
    integer, allocatable :: order(:)
    integer :: i, s, position, first_failure
    ! Nodes with local axes or with a nonzero prescribed displacement.
    allocate (needs_transform(mesh%n_nodes()))
    needs_transform(:) = constraint%frame_of > 0
    do i = 1, size(needs_transform)
      if (any(abs(constraint%prescribed(:, i)) > 0)) needs_transform(i) = .true.
    end do
    allocate (order(size(mesh%block(i_block)%node, 2)))
    call morton_order(mesh%dimension, mesh%x, mesh%block(i_block)%node, order)
    call partition%init(mesh%n_nodes(), mesh%block(i_block)%node, order, &
                        merge(1, omp_get_max_threads(), omp_in_parallel()))
    first_failure = huge(first_failure)
    !$omp parallel do default(none) schedule(static, 1) private(failed, position) &
    !$omp& shared(mesh, i_block, analysis, material, constraint, positions, matrix, rhs, volume, modulus_integral) &
    !$omp& shared(partition, needs_transform, order, first_failure, error)
    do s = 1, partition%n
      call assemble_part(mesh, i_block, analysis, material, constraint, positions, partition, s, needs_transform, &
                         order, matrix, rhs, volume, modulus_integral, position, failed)
      if (.not. allocated(failed)) cycle
      ! The error of the first element in the ordering is reported, as on one thread.
      !$omp critical (dotyk_assembly)
      if (position < first_failure) then
        first_failure = position
        call move_alloc(failed, error)
      end if
      !$omp end critical (dotyk_assembly)
    end do
    !$omp end parallel do
  end subroutine assemble_block

  !> Assemble the elements of one part of a block: the work of one thread.
  subroutine assemble_part(mesh, i_block, analysis, material, constraint, positions, partition, part, needs_transform, &
                           order, matrix, rhs, volume, modulus_integral, position, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    type(block_positions_t), intent(in) :: positions  !! Positions of the nodal blocks in the matrix.
    type(element_partition_t), intent(in) :: partition  !! Distribution of the elements of the block over the threads.
    integer, intent(in) :: part  !! Index of the part.
    !> Whether a node has local axes or a nonzero prescribed displacement (n_nodes).
    logical, intent(in) :: needs_transform(:)
    integer, intent(in) :: order(:)  !! Index of the k-th element of the ordering (n_elements).
    !> Matrix K_ff with its sparsity pattern; values are added to [force/length].
    type(sparse_symmetric_t), intent(inout) :: matrix
    real(dp), intent(inout) :: rhs(:)  !! Right-hand side, from which K_fc z is subtracted (n_equations) [force].
    !> Volumes of the elements; those of this part's own elements are set (n_elements) [volume].
    real(dp), intent(inout) :: volume(:)
    !> Integrals of the modulus field over the same elements (n_elements) [volume].
    real(dp), intent(inout) :: modulus_integral(:)
    !> Position in the ordering of the element that was visited last; on failure, that of the failing element.
    integer, intent(out) :: position
    !> Allocated where an element is inverted, or where the modulus field is no formula or not positive.
    type(error_t), allocatable, intent(out) :: error
    type(element_quadrature_t) :: points
    real(dp), allocatable :: k(:)
    integer, allocatable :: frame_of(:)
    integer :: e, i
    position = 0
    call points%init(mesh, i_block, analysis, material, error)
    if (allocated(error)) return
    associate (n => points%n, dim => points%dim)
      allocate (k((n*dim)**2), frame_of(n))
      do i = partition%first(part), partition%first(part + 1) - 1
        position = partition%position(i)
        e = order(position)
        call points%move_to(mesh, i_block, e, error)
        if (allocated(error)) exit
        if (i <= partition%last_own(part)) then
          volume(e) = sum(points%w(:points%n_points))
          modulus_integral(e) = sum(points%stiffness(:points%n_points))
        end if
        call element_stiffness(points, k)
        if (any(needs_transform(points%node))) then
          frame_of(:) = constraint%frame_of(points%node)
          call rotate_blocks(n, dim, size(constraint%frame, 3), frame_of, constraint%frame, k)
          call subtract_prescribed_forces(n, dim, size(needs_transform), points%node, k, part, partition%owner, &
                                          constraint%equation, constraint%prescribed, rhs)
        end if
        call scatter(n, dim, size(needs_transform), points%node, k, part, partition%owner, constraint%equation, &
                     positions%n_free, positions%first, positions%neighbour, positions%offset, matrix%column_start, &
                     matrix%value)
      end do
    end associate
    call points%destroy()
  end subroutine assemble_part

  !> Subtract the forces K_fc z of prescribed displacements of one element from the right-hand side.
  pure subroutine subtract_prescribed_forces(n, dim, n_nodes, node, k, part, owner, equation, prescribed, rhs)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n_nodes  !! Number of nodes of the body.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    !> Element stiffness in nodal axes: node a, node b, component i, component j (n, n, dim, dim) [force/length].
    real(dp), intent(in) :: k(n, n, dim, dim)
    integer, intent(in) :: part  !! Index of the part.
    !> Part that owns each node (n_nodes); forces on nodes of other parts are left to their owners.
    integer, intent(in) :: owner(n_nodes)
    !> Equation of each nodal component, 0 where its displacement is prescribed (dim, n_nodes).
    integer, intent(in) :: equation(dim, n_nodes)
    !> Prescribed displacements in nodal axes, 0 where free (dim, n_nodes) [length].
    real(dp), intent(in) :: prescribed(dim, n_nodes)
    real(dp), intent(inout) :: rhs(*)  !! Right-hand side (n_equations) [force].
    integer :: a, b, i, j, row
    do b = 1, n
      do j = 1, dim
        if (.not. abs(prescribed(j, node(b))) > 0) cycle
        do i = 1, dim
          do a = 1, n
            if (owner(node(a)) /= part) cycle
            row = equation(i, node(a))
            if (row > 0) rhs(row) = rhs(row) - k(a, b, i, j)*prescribed(j, node(b))
          end do
        end do
      end do
    end do
  end subroutine subtract_prescribed_forces

  !> Subtract K_fc z from a right-hand side.
  subroutine subtract_dirichlet_lift(mesh, analysis, material, constraint, rhs, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    real(dp), intent(inout) :: rhs(:)  !! Right-hand side over the free equations (n_equations) [force].
    !> Allocated where an element next to a prescribed displacement is inverted, or the modulus field is not positive.
    type(error_t), allocatable, intent(out) :: error
    type(body_mesh_t) :: submesh
    type(constraint_t) :: of_submesh
    type(block_positions_t) :: positions
    type(sparse_symmetric_t) :: stiffness
    integer(int64), allocatable :: start(:)
    integer, allocatable :: neighbour(:)
    real(dp) :: volume, mean_modulus_factor
    if (size(rhs) == 0 .or. .not. any(abs(constraint%prescribed) > 0)) return
    call extract_elements(mesh, any(abs(constraint%prescribed) > 0, dim=1), submesh)
    call node_graph(submesh, start, neighbour)
    call build_pattern(mesh%dimension, constraint%equation, start, neighbour, positions, stiffness)
    of_submesh = constraint
    call of_submesh%foundation%choose(any(abs(constraint%prescribed) > 0, dim=1))
    call assemble_stiffness(submesh, analysis, material, of_submesh, positions, stiffness, rhs, volume, &
                            mean_modulus_factor, error)
    call stiffness%destroy()
  end subroutine subtract_dirichlet_lift

  !> Extract the elements that have at least one of the selected nodes.
  subroutine extract_elements(mesh, selected, submesh)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    logical, intent(in) :: selected(:)  !! Whether a node is selected (n_nodes).
    type(body_mesh_t), intent(out) :: submesh  !! These elements, with all nodes of the body.
    type(element_block_t), allocatable :: block(:)
    integer, allocatable :: chosen(:)
    integer :: b, e, n
    submesh%dimension = mesh%dimension
    submesh%x = mesh%x
    allocate (block(size(mesh%block)))
    n = 0
    do b = 1, size(mesh%block)
      chosen = pack([(e, e=1, size(mesh%block(b)%tag))], &
                    [(any(selected(mesh%block(b)%node(:, e))), e=1, size(mesh%block(b)%tag))])
      if (size(chosen) == 0) cycle
      n = n + 1
      block(n)%kind = mesh%block(b)%kind
      block(n)%material = mesh%block(b)%material
      block(n)%node = mesh%block(b)%node(:, chosen)
      block(n)%tag = mesh%block(b)%tag(chosen)
    end do
    allocate (submesh%block(n))
    do b = 1, n
      submesh%block(b) = block(b)
    end do
  end subroutine extract_elements
end module dotyk_elasticity_assembly
