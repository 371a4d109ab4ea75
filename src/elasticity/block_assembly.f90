!> Assembly of the stiffness of a body by block rows, and of its Galerkin matrix P^T K P on the corner space, in one
!> pass over the elements.
!>
!> As in `dotyk_elasticity_assembly`, elements are visited along a Morton curve and distributed so that every sum has
!> the same order on any number of threads; no element matrix is kept. The interpolation P is local to elements, so that
!> P^T K P is the sum of the element matrices P_e^T K_e P_e: on straight simplices of constant modulus, those of the
!> linear elements. Held components are zero rows and columns of K.
module dotyk_elasticity_block_assembly
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_corner_space, only: corner_space_t, corner_weights
  use dotyk_elasticity_element_partition, only: element_partition_t
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_foundation, only: foundation_points_t
  use dotyk_elasticity_material, only: material_t, weight_moduli
  use dotyk_elasticity_projected_dilatation, only: add_projected_stiffness
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, scatter
  use dotyk_elasticity_stiffness_kernel, only: gradient_products, rotate_blocks, stiffness_general, &
    stiffness_isotropic, stiffness_varying
  use dotyk_linalg_block_rows, only: add_blocks, block_rows_t
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, max_facet_nodes
  use dotyk_mesh_element_ordering, only: morton_order
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  implicit none
  private
  public :: assemble_block_rows, clear_held, contract, element_stiffness, typical_stiffness

  type, public :: corner_matrix_t  !! The coarse matrix while it is assembled.
    type(constraint_t) :: constraint  !! Equations and nodal axes of the corners.
    type(block_positions_t) :: positions  !! Positions of the blocks of the corners in `matrix`.
    type(sparse_symmetric_t) :: matrix  !! P^T K P over the free equations of the corners [force/length].
    !> The same by block rows, in place of `positions` and `matrix` where it has a pattern [force/length].
    type(block_rows_t) :: rows
  end type corner_matrix_t

contains

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

  !> Add the stiffness of all elements to matrices of zeros.
  subroutine assemble_block_rows(mesh, analysis, material, constraint, space, rows, volume, mean_modulus_factor, &
                                 error, coarse)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    type(corner_space_t), intent(in) :: space  !! The corner space.
    !> Stiffness by block rows, in nodal axes, with its pattern; packed on return [force/length].
    type(block_rows_t), intent(inout) :: rows
    real(dp), intent(out) :: volume  !! Volume of the body [volume].
    real(dp), intent(out) :: mean_modulus_factor  !! Mean of the modulus field over the volume, see `weight_moduli` [].
    !> Allocated where an element is inverted or the modulus field is not positive at a quadrature point.
    type(error_t), allocatable, intent(out) :: error
    !> Stiffness on the corner space, with its pattern; absent where it is not needed.
    type(corner_matrix_t), intent(inout), optional :: coarse
    real(dp), allocatable :: element_volume(:), element_integral(:), axes(:, :, :)
    logical, allocatable :: special(:)
    integer :: i, first, last
    allocate (element_volume(mesh%n_elements()), element_integral(mesh%n_elements()), special(mesh%n_nodes()))
    special(:) = constraint%frame_of > 0 .or. any(constraint%equation == held, dim=1)
    ! The inverses of the nodal axes.
    allocate (axes, mold=constraint%frame)
    do i = 1, size(axes, 3)
      axes(:, :, i) = transpose(constraint%frame(:, :, i))
    end do
    volume = 0
    mean_modulus_factor = 0
    last = 0
    do i = 1, size(mesh%block)
      first = last + 1
      last = last + size(mesh%block(i)%node, 2)
      call assemble_block(mesh, i, analysis, material, constraint, axes, special, space, rows, &
                          element_volume(first:last), element_integral(first:last), error, coarse)
      if (allocated(error)) return
      call weight_moduli(material, mesh%block(i)%material, element_integral(first:last))
    end do
    call add_springs(mesh, analysis, constraint, axes, space, rows, coarse)
    call rows%hold(constraint%equation == held)
    call rows%pack()
    if (present(coarse)) then
      if (allocated(coarse%rows%column)) then
        call coarse%rows%hold(coarse%constraint%equation == held)
        call coarse%rows%pack()
      end if
    end if
    volume = sum(element_volume)
    mean_modulus_factor = sum(element_integral)/volume
  end subroutine assemble_block_rows

  !> Add the springs on surfaces: their nodes are neighbours in elements, and so are their corners.
  subroutine add_springs(mesh, analysis, constraint, axes, space, rows, coarse)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(constraint_t), intent(in) :: constraint  !! Equations, nodal axes and springs of the body.
    real(dp), intent(in) :: axes(:, :, :)  !! Inverses of the nodal axes (dim, dim, n_frames) [].
    type(corner_space_t), intent(in) :: space  !! The corner space.
    type(block_rows_t), intent(inout) :: rows  !! Stiffness by block rows [force/length].
    !> Stiffness on the corner space; absent where it is not needed.
    type(corner_matrix_t), intent(inout), optional :: coarse
    ! One part has all nodes and corners.
    integer, parameter :: part = 1
    type(foundation_points_t) :: points
    type(element_kind_t) :: kind
    real(dp), allocatable :: k(:), corner_k(:), weight(:)
    integer, allocatable :: owner(:), place(:), corner(:), frame_of(:)
    integer :: f, nc
    associate (springs => constraint%foundation, dim => mesh%dimension)
      if (springs%n == 0) return
      allocate (owner(max(mesh%n_nodes(), space%n)), source=part)
      allocate (k((max_facet_nodes*dim)**2), corner_k((max_facet_nodes*dim)**2))
      do f = 1, springs%n
        call springs%points_of(mesh%x, analysis, f, points)
        kind = element_kind(points%kind)
        nc = kind%n_corners
        associate (n => points%n_nodes, node => springs%node(:points%n_nodes, f))
          call points%matrix(n, dim, k)
          frame_of = constraint%frame_of(node)
          call rotate_blocks(n, dim, size(axes, 3), frame_of, constraint%frame, k)
          call clear_held(n, dim, constraint%equation(:, node), k)
          call add_blocks(n, dim, rows%n, node, k, part, owner(:rows%n), rows%start, rows%column, rows%scale, &
                          rows%high, rows%low)
          if (.not. present(coarse)) cycle
          call corner_weights(points%kind, place, corner, weight)
          call rotate_blocks(n, dim, size(axes, 3), frame_of, axes, k)
          call contract(n, nc, dim, size(weight), place, corner, weight, k, corner_k)
          call rotate_blocks(nc, dim, size(axes, 3), frame_of(:nc), constraint%frame, corner_k)
          call add_corner_element(nc, dim, space%number(node(:nc)), part, owner(:space%n), corner_k, coarse)
        end associate
      end do
    end associate
  end subroutine add_springs

  !> Assemble the elements of one block, distributed over the threads.
  subroutine assemble_block(mesh, i_block, analysis, material, constraint, axes, special, space, rows, volume, &
                            modulus_integral, error, coarse)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    real(dp), intent(in) :: axes(:, :, :)  !! Inverses of the nodal axes (dim, dim, n_frames) [].
    logical, intent(in) :: special(:)  !! Whether a node has local axes or held components (n_nodes).
    type(corner_space_t), intent(in) :: space  !! The corner space.
    type(block_rows_t), intent(inout) :: rows  !! Stiffness by block rows [force/length].
    real(dp), intent(inout) :: volume(:)  !! Volumes of the elements of the block (n_elements) [volume].
    !> Integrals of the modulus field over the elements (n_elements) [volume].
    real(dp), intent(inout) :: modulus_integral(:)
    !> Allocated where an element is inverted or the modulus field is not positive: the first one in the ordering.
    type(error_t), allocatable, intent(out) :: error
    !> Stiffness on the corner space; absent where it is not needed.
    type(corner_matrix_t), intent(inout), optional :: coarse
    type(element_partition_t) :: partition
    type(error_t), allocatable :: failed
    integer, allocatable :: order(:), corner_owner(:)
    integer :: s, position, first_failure
    allocate (order(size(mesh%block(i_block)%node, 2)))
    call morton_order(mesh%dimension, mesh%x, mesh%block(i_block)%node, order)
    call partition%init(mesh%n_nodes(), mesh%block(i_block)%node, order, &
                        merge(1, omp_get_max_threads(), omp_in_parallel()))
    corner_owner = partition%owner(space%node)
    first_failure = huge(first_failure)
    !$omp parallel do default(none) schedule(static, 1) private(failed, position) &
    !$omp& shared(mesh, i_block, analysis, material, constraint, axes, special, space, rows, coarse, volume) &
    !$omp& shared(modulus_integral, partition, corner_owner, order, first_failure, error)
    do s = 1, partition%n
      call assemble_part(mesh, i_block, analysis, material, constraint, axes, special, space, partition, &
                         corner_owner, s, order, rows, volume, modulus_integral, position, failed, coarse)
      if (.not. allocated(failed)) cycle
      ! The error of the first element in the ordering is reported, as on one thread.
      !$omp critical (dotyk_block_assembly)
      if (position < first_failure) then
        first_failure = position
        call move_alloc(failed, error)
      end if
      !$omp end critical (dotyk_block_assembly)
    end do
    !$omp end parallel do
  end subroutine assemble_block

  !> Assemble the elements of one part of a block: the work of one thread.
  subroutine assemble_part(mesh, i_block, analysis, material, constraint, axes, special, space, partition, &
                           corner_owner, part, order, rows, volume, modulus_integral, position, error, coarse)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    real(dp), intent(in) :: axes(:, :, :)  !! Inverses of the nodal axes (dim, dim, n_frames) [].
    logical, intent(in) :: special(:)  !! Whether a node has local axes or held components (n_nodes).
    type(corner_space_t), intent(in) :: space  !! The corner space.
    type(element_partition_t), intent(in) :: partition  !! Distribution of the elements of the block over the threads.
    integer, intent(in) :: corner_owner(:)  !! Part that owns each corner (n_corners).
    integer, intent(in) :: part  !! Index of the part.
    integer, intent(in) :: order(:)  !! Index of the k-th element of the ordering (n_elements).
    type(block_rows_t), intent(inout) :: rows  !! Stiffness by block rows [force/length].
    !> Volumes of the elements; those of this part's own elements are set (n_elements) [volume].
    real(dp), intent(inout) :: volume(:)
    !> Integrals of the modulus field over the same elements (n_elements) [volume].
    real(dp), intent(inout) :: modulus_integral(:)
    !> Position in the ordering of the element that was visited last; on failure, that of the failing element.
    integer, intent(out) :: position
    !> Allocated where an element is inverted, or where the modulus field is no formula or not positive.
    type(error_t), allocatable, intent(out) :: error
    !> Stiffness on the corner space; absent where it is not needed.
    type(corner_matrix_t), intent(inout), optional :: coarse
    type(element_quadrature_t) :: points
    type(element_kind_t) :: kind
    real(dp), allocatable :: k(:), corner_k(:), weight(:)
    integer, allocatable :: frame_of(:), node(:), corner(:)
    integer :: e, i, nc
    position = 0
    kind = element_kind(mesh%block(i_block)%kind)
    nc = kind%n_corners
    call corner_weights(mesh%block(i_block)%kind, node, corner, weight)
    call points%init(mesh, i_block, analysis, material, error)
    if (allocated(error)) return
    associate (n => points%n, dim => points%dim)
      allocate (k((n*dim)**2), corner_k((nc*dim)**2), frame_of(n))
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
        frame_of(:) = constraint%frame_of(points%node)
        if (any(special(points%node))) then
          call rotate_blocks(n, dim, size(axes, 3), frame_of, constraint%frame, k)
          call clear_held(n, dim, constraint%equation(:, points%node), k)
        end if
        call add_blocks(n, dim, rows%n, points%node, k, part, partition%owner, rows%start, rows%column, rows%scale, &
                        rows%high, rows%low)
        if (.not. present(coarse)) cycle
        if (any(frame_of > 0)) call rotate_blocks(n, dim, size(axes, 3), frame_of, axes, k)
        call contract(n, nc, dim, size(weight), node, corner, weight, k, corner_k)
        if (any(frame_of > 0)) call rotate_blocks(nc, dim, size(axes, 3), frame_of, constraint%frame, corner_k)
        call add_corner_element(nc, dim, space%number(points%node(:nc)), part, corner_owner, corner_k, coarse)
      end do
    end associate
    call points%destroy()
  end subroutine assemble_part

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
end module dotyk_elasticity_block_assembly
