!> Assembly of the stiffness of a body, element by element: the matrix of the bilinear form A, in which equilibrium,
!> equation (3), has its weak form; symmetric, continuous, and with enough supports coercive, equations (13), (14),
!> (15). It goes directly into the sparsity pattern of the free equations; or into block rows, together with its
!> Galerkin matrix P^T K P on the corner space, in one pass over the elements.
!>
!> Elements are visited along a Morton curve (`dotyk_mesh_element_ordering`) and distributed over threads so that every
!> sum has the same order on any number of threads (`dotyk_elasticity_element_partition`); no element matrix is kept.
!>
!> In the sparse matrix Dirichlet conditions are eliminated during assembly: with free unknowns f and prescribed
!> unknowns c, the matrix is K_ff, and K_fc z is subtracted from the right-hand side (Dirichlet lifting). Bodies that a
!> congruent body's factor serves have no matrix: their lifting comes from the elements next to prescribed displacements
!> alone. In block rows held components are zero rows and columns of K. The interpolation P is local to elements, so
!> that P^T K P is the sum of the element matrices P_e^T K_e P_e: on straight simplices of constant modulus, those of
!> the linear elements.
module dotyk_elasticity_assembly
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_corner_space, only: corner_space_t, corner_weights
  use dotyk_elasticity_element_partition, only: element_partition_t
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_foundation, only: foundation_points_t
  use dotyk_elasticity_material, only: material_t, weight_moduli
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_projected_dilatation, only: add_projected_stiffness
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, build_pattern, scatter
  use dotyk_elasticity_stiffness_kernel, only: gradient_products, rotate_blocks, stiffness_general, &
    stiffness_isotropic, stiffness_varying
  use dotyk_linalg_block_rows, only: add_blocks, block_rows_t
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, max_facet_nodes
  use dotyk_mesh_element_ordering, only: morton_order
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: assemble_stiffness, assemble_block_rows, subtract_dirichlet_lift, extract_elements
  public :: clear_held, contract, element_stiffness, typical_stiffness

  type, public :: corner_matrix_t  !! The coarse matrix while it is assembled.
    type(constraint_t) :: constraint  !! Equations and nodal axes of the corners.
    type(block_positions_t) :: positions  !! Positions of the blocks of the corners in `matrix`.
    type(sparse_symmetric_t) :: matrix  !! P^T K P over the free equations of the corners [force/length].
    !> The same by block rows, in place of `positions` and `matrix` where it has a pattern [force/length].
    type(block_rows_t) :: rows
  end type corner_matrix_t

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
    type(sparse_symmetric_t), intent(inout) :: matrix  !! K_ff with its pattern; values are added to [force/length].
    real(dp), intent(inout) :: rhs(:)  !! Right-hand side, from which K_fc z is subtracted (n_equations) [force].
    real(dp), intent(out) :: volume  !! Volume of the body [volume].
    real(dp), intent(out) :: mean_modulus_factor  !! Mean of the modulus field over the volume, see `weight_moduli` [].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    call add_elements(mesh, analysis, material, constraint, volume, mean_modulus_factor, error, positions=positions, &
                      matrix=matrix, rhs=rhs)
  end subroutine assemble_stiffness

  !> Add the stiffness of all elements, and of springs, to block rows of zeros.
  subroutine assemble_block_rows(mesh, analysis, material, constraint, space, rows, volume, mean_modulus_factor, &
                                 error, coarse)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    type(corner_space_t), intent(in) :: space  !! The corner space.
    type(block_rows_t), intent(inout) :: rows  !! With its pattern, in nodal axes; packed on return [force/length].
    real(dp), intent(out) :: volume  !! Volume of the body [volume].
    real(dp), intent(out) :: mean_modulus_factor  !! Mean of the modulus field over the volume, see `weight_moduli` [].
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    !> Stiffness on the corner space, with its pattern; absent where it is not needed.
    type(corner_matrix_t), intent(inout), optional :: coarse
    call add_elements(mesh, analysis, material, constraint, volume, mean_modulus_factor, error, space=space, &
                      rows=rows, coarse=coarse)
    if (allocated(error)) return
    call rows%hold(constraint%equation == held)
    call rows%pack()
    if (.not. present(coarse)) return
    if (.not. allocated(coarse%rows%column)) return
    call coarse%rows%hold(coarse%constraint%equation == held)
    call coarse%rows%pack()
  end subroutine assemble_block_rows

  !> Add the stiffness of all elements and springs: to `matrix`, and the forces of prescribed displacements to `rhs`; or
  !> to `rows` and `coarse`.
  subroutine add_elements(mesh, analysis, material, constraint, volume, mean_modulus_factor, error, &
                          positions, matrix, rhs, space, rows, coarse)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements, nodal axes and springs.
    real(dp), intent(out) :: volume  !! Volume of the body [volume].
    real(dp), intent(out) :: mean_modulus_factor  !! Mean of the modulus field over the volume [].
    type(error_t), allocatable, intent(out) :: error  !! The first failing element of the ordering is named.
    type(block_positions_t), intent(in), optional :: positions  !! Positions of the nodal blocks in `matrix`.
    type(sparse_symmetric_t), intent(inout), optional :: matrix  !! K_ff [force/length].
    real(dp), intent(inout), optional :: rhs(:)  !! Right-hand side (n_equations) [force].
    type(corner_space_t), intent(in), optional :: space  !! The corner space.
    type(block_rows_t), intent(inout), optional :: rows  !! Stiffness by block rows [force/length].
    type(corner_matrix_t), intent(inout), optional :: coarse  !! Stiffness on the corner space.
    type(element_partition_t) :: partition
    !> Volumes of the elements, and integrals of the modulus field over them (n_elements) [volume].
    real(dp), allocatable :: element_volume(:), element_integral(:)
    real(dp), allocatable :: axes(:, :, :)  ! Inverses of the nodal axes.
    ! Whether nodes have local axes, held components in block rows, or else a nonzero prescribed displacement.
    logical, allocatable :: special(:)
    integer, allocatable :: order(:), corner_owner(:)
    integer :: b, first, i, dim
    dim = mesh%dimension
    allocate (element_volume(mesh%n_elements()), element_integral(mesh%n_elements()), special(mesh%n_nodes()))
    if (present(rhs)) then
      special(:) = constraint%frame_of > 0 .or. any(abs(constraint%prescribed) > 0, dim=1)
    else
      special(:) = constraint%frame_of > 0 .or. any(constraint%equation == held, dim=1)
    end if
    allocate (axes, mold=constraint%frame)
    do i = 1, size(axes, 3)
      axes(:, :, i) = transpose(constraint%frame(:, :, i))
    end do
    volume = 0
    mean_modulus_factor = 0
    first = 0
    do b = 1, size(mesh%block)
      call add_block()
      if (allocated(error)) return
      call weight_moduli(material, mesh%block(b)%material, element_integral(first + 1:first + size(order)))
      first = first + size(order)
    end do
    call add_springs()
    volume = sum(element_volume)
    mean_modulus_factor = 1
    if (volume > 0) mean_modulus_factor = sum(element_integral)/volume

  contains

    !> Add the elements of block b, distributed over the threads.
    subroutine add_block()
      type(error_t), allocatable :: failed
      integer :: s, position, first_failure
      if (allocated(order)) deallocate (order)
      allocate (order(size(mesh%block(b)%node, 2)))
      call morton_order(dim, mesh%x, mesh%block(b)%node, order)
      call partition%init(mesh%n_nodes(), mesh%block(b)%node, order, merge(1, omp_get_max_threads(), omp_in_parallel()))
      if (present(coarse)) corner_owner = partition%owner(space%node)
      first_failure = huge(first_failure)
      !$omp parallel do default(none) schedule(static, 1) private(failed, position) &
      !$omp& shared(partition, first_failure, error)
      do s = 1, partition%n
        call add_part(s, position, failed)
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
    end subroutine add_block

    !> Add the elements of one part of block b: the work of one thread.
    subroutine add_part(part, position, failed)
      integer, intent(in) :: part  !! Index of the part.
      integer, intent(out) :: position  !! Of the element visited last, in the ordering; on failure, the failing one.
      type(error_t), allocatable, intent(out) :: failed  !! Where an element is inverted or the modulus not positive.
      type(element_quadrature_t) :: points
      type(element_kind_t) :: kind
      real(dp), allocatable :: k(:), weight(:)
      integer, allocatable :: place(:), corner(:)
      integer :: e, j
      position = 0
      kind = element_kind(mesh%block(b)%kind)
      call corner_weights(mesh%block(b)%kind, place, corner, weight)
      call points%init(mesh, b, analysis, material, failed)
      if (allocated(failed)) return
      allocate (k((points%n*dim)**2))
      do j = partition%first(part), partition%first(part + 1) - 1
        position = partition%position(j)
        e = order(position)
        call points%move_to(mesh, b, e, failed)
        if (allocated(failed)) exit
        if (j <= partition%last_own(part)) then
          element_volume(first + e) = sum(points%w(:points%n_points))
          element_integral(first + e) = sum(points%stiffness(:points%n_points))
        end if
        call element_stiffness(points, k)
        call add_matrix(points%n, points%node, part, partition%owner, corner_owner, kind%n_corners, place, corner, &
                        weight, k)
      end do
      call points%destroy()
    end subroutine add_part

    !> Add the springs on surfaces: their nodes are neighbours in elements, and so are their corners.
    subroutine add_springs()
      integer, parameter :: part = 1  ! It has all nodes and corners.
      type(foundation_points_t) :: points
      type(element_kind_t) :: kind
      real(dp), allocatable :: k(:), weight(:)
      integer, allocatable :: owner(:), place(:), corner(:)
      integer :: f, n
      if (constraint%foundation%n == 0) return
      allocate (owner(mesh%n_nodes()), source=part)
      corner_owner = owner
      allocate (k((max_facet_nodes*dim)**2))
      do f = 1, constraint%foundation%n
        call constraint%foundation%points_of(mesh%x, analysis, f, points)
        n = points%n_nodes
        kind = element_kind(points%kind)
        call corner_weights(points%kind, place, corner, weight)
        call points%matrix(n, dim, k)
        call add_matrix(n, constraint%foundation%node(:n, f), part, owner, corner_owner, kind%n_corners, place, &
                        corner, weight, k)
      end do
    end subroutine add_springs

    !> Add an element matrix, where the part owns the nodes.
    subroutine add_matrix(n, node, part, owner, owner_of_corner, nc, place, corner, weight, k)
      integer, intent(in) :: n, nc  !! Numbers of nodes and corners of the element.
      integer, intent(in) :: node(n)  !! Nodes of the element (n).
      integer, intent(in) :: part  !! Index of the part.
      integer, contiguous, intent(in) :: owner(:)  !! Part that owns each node (n_nodes).
      integer, allocatable, intent(in) :: owner_of_corner(:)  !! The same of corners; used for `coarse` (n_corners).
      integer, intent(in) :: place(:), corner(:)  !! Node and corner of each weight of the interpolation (n_weights).
      real(dp), intent(in) :: weight(:)  !! The weights (n_weights) [].
      real(dp), contiguous, intent(inout) :: k(:)  !! In global axes, lost (at least (n*dim)**2) [force/length].
      real(dp) :: corner_k((nc*dim)**2)
      integer :: frame_of(n)
      frame_of = constraint%frame_of(node)
      if (any(special(node))) then
        call rotate_blocks(n, dim, size(axes, 3), frame_of, constraint%frame, k)
        if (present(rhs)) then
          call subtract_prescribed_forces(n, dim, size(owner), node, k, part, owner, constraint%equation, &
                                          constraint%prescribed, rhs)
        else
          call clear_held(n, dim, constraint%equation(:, node), k)
        end if
      end if
      if (present(rhs)) then
        call scatter(n, dim, size(owner), node, k, part, owner, constraint%equation, positions%n_free, &
                     positions%first, positions%neighbour, positions%offset, matrix%column_start, matrix%value)
        return
      end if
      call add_blocks(n, dim, rows%n, node, k, part, owner, rows%start, rows%column, rows%scale, rows%high, rows%low)
      if (.not. present(coarse)) return
      if (any(frame_of > 0)) call rotate_blocks(n, dim, size(axes, 3), frame_of, axes, k)
      call contract(n, nc, dim, size(weight), place, corner, weight, k, corner_k)
      if (any(frame_of > 0)) call rotate_blocks(nc, dim, size(axes, 3), frame_of(:nc), constraint%frame, corner_k)
      call add_corner_element(nc, dim, space%number(node(:nc)), part, owner_of_corner(:space%n), corner_k, coarse)
    end subroutine add_matrix
  end subroutine add_elements

  !> Subtract the forces K_fc z of prescribed displacements of one element from the right-hand side.
  pure subroutine subtract_prescribed_forces(n, dim, n_nodes, node, k, part, owner, equation, prescribed, rhs)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n_nodes  !! Number of nodes of the body.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    !> Element stiffness in nodal axes: node a, node b, component i, component j (n, n, dim, dim) [force/length].
    real(dp), intent(in) :: k(n, n, dim, dim)
    integer, intent(in) :: part  !! Index of the part.
    integer, intent(in) :: owner(n_nodes)  !! Owning part of each node; forces of others are left to them (n_nodes).
    integer, intent(in) :: equation(dim, n_nodes)  !! Equation of each nodal component, 0 where prescribed.
    real(dp), intent(in) :: prescribed(dim, n_nodes)  !! Prescribed displacements in nodal axes, 0 where free [length].
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

  !> Add an element matrix to the coarse matrix.
  subroutine add_corner_element(nc, dim, corner, part, owner, k, coarse)
    integer, intent(in) :: nc  !! Number of corners of the element.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: corner(nc)  !! Its corners (nc).
    integer, intent(in) :: part  !! Index of the part.
    integer, intent(in) :: owner(:)  !! Part that owns each corner (n_corners).
    !> Element matrix in nodal axes; rows and columns of held components are changed ((nc*dim)**2) [force/length].
    real(dp), intent(inout) :: k(:)
    type(corner_matrix_t), intent(inout) :: coarse  !! Gets it.
    if (allocated(coarse%rows%column)) then
      call clear_held(nc, dim, coarse%constraint%equation(:, corner), k)
      call add_blocks(nc, dim, coarse%rows%n, corner, k, part, owner, coarse%rows%start, coarse%rows%column, &
                      coarse%rows%scale, coarse%rows%high, coarse%rows%low)
    else
      call scatter(nc, dim, size(owner), corner, k, part, owner, coarse%constraint%equation, coarse%positions%n_free, &
                   coarse%positions%first, coarse%positions%neighbour, coarse%positions%offset, &
                   coarse%matrix%column_start, coarse%matrix%value)
    end if
  end subroutine add_corner_element

  !> Set the rows and columns of held components to zero.
  pure subroutine clear_held(n, dim, equation, k)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: equation(dim, n)  !! Equations of the nodes of the element (dim, n).
    real(dp), intent(inout) :: k(n, n, dim, dim)  !! Element stiffness in nodal axes (n, n, dim, dim) [force/length].
    integer :: a, i
    do i = 1, dim
      do a = 1, n
        if (equation(i, a) /= held) cycle
        k(a, :, i, :) = 0
        k(:, a, :, i) = 0
      end do
    end do
  end subroutine clear_held

  !> P_e^T K_e P_e for a symmetric element matrix K_e.
  pure subroutine contract(n, nc, dim, m, node, corner, weight, k, corner_k)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: nc  !! Number of its corners.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: m  !! Number of weights of the interpolation.
    integer, intent(in) :: node(m)  !! Node of each weight (m).
    integer, intent(in) :: corner(m)  !! Corner of each weight (m).
    real(dp), intent(in) :: weight(m)  !! Weights (m) [].
    real(dp), intent(in) :: k(n, n, dim, dim)  !! K_e in global axes (n, n, dim, dim) [force/length].
    real(dp), intent(out) :: corner_k(nc, nc, dim, dim)  !! P_e^T K_e P_e (nc, nc, dim, dim) [force/length].
    real(dp) :: half(n, nc)
    integer :: i, j, c, q
    do j = 1, dim
      do i = j, dim
        half = 0
        do q = 1, m
          half(:, corner(q)) = half(:, corner(q)) + weight(q)*k(:, node(q), i, j)
        end do
        do c = 1, nc
          corner_k(:, c, i, j) = 0
          do q = 1, m
            corner_k(corner(q), c, i, j) = corner_k(corner(q), c, i, j) + weight(q)*half(node(q), c)
          end do
        end do
        if (i > j) corner_k(:, :, j, i) = transpose(corner_k(:, :, i, j))
      end do
    end do
  end subroutine contract

  !> Stiffness of the current element, in global axes.
  subroutine element_stiffness(points, k)
    type(element_quadrature_t), intent(in) :: points  !! Quadrature data of the element.
    real(dp), intent(out) :: k(:)  !! Element stiffness: of shape (n, n, dim, dim) [force/length].
    real(dp) :: products((points%n*points%slots)**2)
    if (points%varies) then
      call stiffness_varying(points%n, points%dim, points%slots, points%n_points, points%strain, points%matrix, &
                             points%g, points%stiffness, k)
    else
      call gradient_products(points%n, points%slots, points%n_points, points%g, points%stiffness, products)
      if (points%is_isotropic) then
        call stiffness_isotropic(points%n, points%lambda, points%mu, products, k)
      else
        call stiffness_general(points%n, points%dim, points%slots, points%strain, points%matrix, products, k)
      end if
    end if
    if (points%bulk > 0) call add_projected_stiffness(points%n, points%dim, points%n_functions, points%bulk, &
      points%dilatation, k)
  end subroutine element_stiffness

  !> Magnitude of the stiffness: that of the largest entry of the first element [force/length].
  subroutine typical_stiffness(mesh, analysis, material, stiffness, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    real(dp), intent(out) :: stiffness  !! The magnitude [force/length].
    !> Allocated where the element is inverted, or the modulus field is no formula or not positive.
    type(error_t), allocatable, intent(out) :: error
    type(element_quadrature_t) :: points
    real(dp), allocatable :: k(:)
    stiffness = 0
    call points%init(mesh, 1, analysis, material, error)
    if (allocated(error)) return
    call points%move_to(mesh, 1, 1, error)
    if (.not. allocated(error)) then
      allocate (k((points%n*points%dim)**2))
      call element_stiffness(points, k)
      stiffness = maxval(abs(k))
    end if
    call points%destroy()
  end subroutine typical_stiffness

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
