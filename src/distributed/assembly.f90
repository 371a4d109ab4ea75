!> Assembly of the stiffness of all bodies into PETSc's matrices: the fine one by blocks, and its Galerkin matrix
!> P^T K P on the corner space, element by element as in `dotyk_elasticity_assembly`.
!>
!> A rank visits all elements of its own nodes and fills their rows alone: elements between ranks are visited twice, and
!> no entry is sent. Held components are zero rows and columns with a diagonal entry.
module dotyk_distributed_assembly
  use petscmat, only: ADD_VALUES, INSERT_VALUES, MAT_FINAL_ASSEMBLY, MAT_IGNORE_LOWER_TRIANGULAR, MAT_SPD, &
    MatAssemblyBegin, MatAssemblyEnd, MatCreate, MatSetBlockSize, MatSetOption, MatSetSizes, MatSetType, MatSetUp, &
    MatSetValues, MatSetValuesBlocked, PETSC_COMM_WORLD, PETSC_DETERMINE, PETSC_NULL_INTEGER, PETSC_TRUE, tMat
  use dotyk_base_error, only: error_t, exit_machine, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_petsc, only: has_failed, largest_of_ranks
  use dotyk_elasticity_assembly, only: clear_held, contract, element_stiffness
  use dotyk_elasticity_constraint, only: held
  use dotyk_elasticity_corner_space, only: corner_weights
  use dotyk_elasticity_element_quadrature, only: element_quadrature_t
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_stiffness_kernel, only: rotate_blocks
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: add_elements, assemble_interpolation, finish_matrix, make_block_matrix, check_entries, check_unknowns

  integer(int64), parameter :: largest = huge(1)  !! Largest index: PETSc and the program count in default integers.

contains

  !> A matrix of zeros with the pattern of the nodes of all parts.
  subroutine make_block_matrix(by_blocks, dim, n_own, part, corners, matrix, error)
    logical, intent(in) :: by_blocks  !! Whether to store blocks.
    integer, intent(in) :: dim  !! Order of the blocks.
    integer, intent(in) :: n_own  !! Own block rows.
    type(part_t), intent(in) :: part(:)  !! Parts of this rank, numbered (n_parts).
    logical, intent(in) :: corners  !! Whether of the corners.
    type(tMat), intent(out) :: matrix  !! The matrix.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer(int64), allocatable :: start(:)
    integer, allocatable :: near(:), far(:), neighbour(:), row(:)
    logical, allocatable :: is_own(:), counted(:)
    type(body_mesh_t) :: corner_mesh
    integer :: p, i, first, code
    external :: MatMPISBAIJSetPreallocation, MatSeqSBAIJSetPreallocation, MatXAIJSetPreallocation
    allocate (near(n_own), far(n_own), source=0)
    first = huge(first)
    do p = 1, size(part)
      if (any(part(p)%is_own)) first = min(first, minval(pack(part(p)%row, part(p)%is_own)))
    end do
    if (corners) then
      first = huge(first)
      do p = 1, size(part)
        associate (own => pack(part(p)%corner_row, part(p)%is_own(part(p)%space%node)))
          if (size(own) > 0) first = min(first, minval(own))
        end associate
      end do
    end if
    do p = 1, size(part)
      if (corners) then
        call part(p)%space%make_mesh(part(p)%mesh, corner_mesh)
        call node_graph(corner_mesh, start, neighbour)
        row = part(p)%corner_row
        is_own = part(p)%is_own(part(p)%space%node)
      else
        call node_graph(part(p)%mesh, start, neighbour)
        row = part(p)%row
        is_own = part(p)%is_own
      end if
      do i = 1, size(row)
        if (.not. is_own(i)) cycle
        associate (others => neighbour(start(i):start(i + 1) - 1))
          ! Of symmetric blocks those right of the diagonal.
          counted = .not. by_blocks .or. row(others) > row(i)
          near(row(i) - first + 1) = 1 + count(is_own(others) .and. counted)
          far(row(i) - first + 1) = count(.not. is_own(others) .and. counted)
        end associate
      end do
    end do
    call check_entries(dim**2*(sum(int(near, int64)) + sum(int(far, int64))), error)
    if (allocated(error)) return
    call MatCreate(PETSC_COMM_WORLD, matrix, code)
    call MatSetSizes(matrix, dim*n_own, dim*n_own, PETSC_DETERMINE, PETSC_DETERMINE, code)
    call MatSetBlockSize(matrix, dim, code)
    if (by_blocks) then
      call MatSetType(matrix, 'sbaij', code)
      call MatSeqSBAIJSetPreallocation(matrix, dim, 0, near, code)
      call MatMPISBAIJSetPreallocation(matrix, dim, 0, near, 0, far, code)
      call MatSetOption(matrix, MAT_IGNORE_LOWER_TRIANGULAR, PETSC_TRUE, code)
    else
      call MatSetType(matrix, 'aij', code)
      call MatXAIJSetPreallocation(matrix, dim, near, far, PETSC_NULL_INTEGER, PETSC_NULL_INTEGER, code)
    end if
    if (has_failed(code, 'memory of the stiffness', error)) return
    ! PETSc 3.18 refuses it for blocks.
    if (.not. by_blocks) call MatSetOption(matrix, MAT_SPD, PETSC_TRUE, code)
  end subroutine make_block_matrix

  !> Add the elements of a part to the rows of its own nodes, and the forces of prescribed displacements to vectors.
  subroutine add_elements(part, with_fine, fine, coarse, lift, error)
    type(part_t), intent(in) :: part  !! The part, numbered.
    logical, intent(in) :: with_fine  !! Whether there is a fine matrix: not where all elements are linear.
    type(tMat), intent(inout) :: fine  !! Fine matrix [force/length].
    type(tMat), intent(inout) :: coarse  !! Galerkin matrix of the corner space [force/length].
    !> K z of prescribed displacements z, along the axes of the nodes; complete at own ones (dim, n_nodes) [force].
    real(dp), intent(inout) :: lift(:, :)
    !> Allocated where an element is inverted, the modulus field is not positive, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    type(element_quadrature_t) :: points
    type(element_kind_t) :: kind
    real(dp), allocatable :: k(:), corner_k(:), weight(:), back(:, :, :)
    integer, allocatable :: frame_of(:), from_node(:), to_corner(:), corner(:), row(:)
    logical, allocatable :: is_special(:)
    real(dp) :: scale
    integer :: b, e, i, nc, code
    allocate (back, mold=part%constraint%frame)
    do i = 1, size(back, 3)
      back(:, :, i) = transpose(part%constraint%frame(:, :, i))
    end do
    is_special = part%constraint%frame_of > 0 .or. any(part%constraint%equation == held, 1)
    scale = 0
    do b = 1, size(part%mesh%block)
      if (size(part%mesh%block(b)%tag) == 0) cycle
      kind = element_kind(part%mesh%block(b)%kind)
      nc = kind%n_corners
      call corner_weights(part%mesh%block(b)%kind, from_node, to_corner, weight)
      call points%init(part%mesh, b, part%analysis, part%material, error)
      if (allocated(error)) return
      associate (n => points%n, dim => points%dim, constraint => part%constraint, node => part%mesh%block(b)%node)
        if (allocated(k)) deallocate (k, corner_k)
        allocate (k((n*dim)**2), corner_k((nc*dim)**2))
        do e = 1, size(node, 2)
          if (.not. any(part%is_own(node(:, e)))) cycle
          call points%move_to(part%mesh, b, e, error)
          if (allocated(error)) exit
          call element_stiffness(points, k)
          scale = max(scale, maxval(abs(k)))
          frame_of = constraint%frame_of(node(:, e))
          if (any(is_special(node(:, e)))) then
            call rotate_blocks(n, dim, size(back, 3), frame_of, constraint%frame, k)
            call add_lift(n, dim, node(:, e), k, constraint%prescribed, lift)
            call clear_held(n, dim, constraint%equation(:, node(:, e)), k)
          end if
          row = merge(part%row(node(:, e)), -1, part%is_own(node(:, e)))
          if (with_fine) call add_blocks(n, dim, row, part%row(node(:, e)), k, fine, code)
          if (any(frame_of > 0)) call rotate_blocks(n, dim, size(back, 3), frame_of, back, k)
          call contract(n, nc, dim, size(weight), from_node, to_corner, weight, k, corner_k)
          if (any(frame_of > 0)) call rotate_blocks(nc, dim, size(back, 3), frame_of, constraint%frame, corner_k)
          call clear_held(nc, dim, constraint%equation(:, node(:nc, e)), corner_k)
          corner = part%corner_row(part%space%number(node(:nc, e)))
          row = merge(corner, -1, part%is_own(node(:nc, e)))
          call add_blocks(nc, dim, row, corner, corner_k, coarse, code)
          if (has_failed(code, 'assembly', error)) exit
        end do
      end associate
      call points%destroy()
      if (allocated(error)) return
    end do
    if (with_fine) call hold(part%row, part%is_own, part%constraint%equation == held, scale, fine)
    associate (corner_node => part%space%node)
      call hold(part%corner_row, part%is_own(corner_node), part%constraint%equation(:, corner_node) == held, scale, &
                coarse)
    end associate
  end subroutine add_elements

  !> Add an element matrix to rows.
  subroutine add_blocks(n, dim, row, column, k, matrix, code)
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: row(n)  !! Block rows, -1 where they belong to other ranks (n).
    integer, intent(in) :: column(n)  !! Block columns (n).
    real(dp), intent(in) :: k(n, n, dim, dim)  !! Element matrix (n, n, dim, dim) [force/length].
    type(tMat), intent(inout) :: matrix  !! Gets it.
    integer, intent(out) :: code  !! PETSc's error code.
    real(dp) :: blocks(dim*n*dim*n)
    integer :: a, b, i, j
    ! By rows or by columns alike: it is symmetric.
    do b = 1, n
      do j = 1, dim
        do a = 1, n
          do i = 1, dim
            blocks(i + dim*((a - 1) + n*((j - 1) + dim*(b - 1)))) = k(a, b, i, j)
          end do
        end do
      end do
    end do
    call MatSetValuesBlocked(matrix, n, row, n, column, blocks, ADD_VALUES, code)
  end subroutine add_blocks

  !> Add the forces of prescribed displacements of one element.
  pure subroutine add_lift(n, dim, node, k, prescribed, lift)
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    !> Element matrix along the axes of the nodes (n, n, dim, dim) [force/length].
    real(dp), intent(in) :: k(n, n, dim, dim)
    real(dp), intent(in) :: prescribed(:, :)  !! Prescribed displacements, 0 where free (dim, n_nodes) [length].
    real(dp), intent(inout) :: lift(:, :)  !! Gets them (dim, n_nodes) [force].
    integer :: a, b, i, j
    do b = 1, n
      do j = 1, dim
        if (.not. abs(prescribed(j, node(b))) > 0) cycle
        do i = 1, dim
          do a = 1, n
            lift(i, node(a)) = lift(i, node(a)) + k(a, b, i, j)*prescribed(j, node(b))
          end do
        end do
      end do
    end do
  end subroutine add_lift

  !> Diagonal entries of held components.
  subroutine hold(row, is_own, is_held, scale, matrix)
    integer, intent(in) :: row(:)  !! Block rows (n).
    logical, intent(in) :: is_own(:)  !! Whether they are this rank's (n).
    logical, intent(in) :: is_held(:, :)  !! (dim, n)
    real(dp), intent(in) :: scale  !! The entry [force/length].
    type(tMat), intent(inout) :: matrix  !! Gets them.
    integer :: i, j, code, at(1)
    do i = 1, size(row)
      if (.not. is_own(i)) cycle
      do j = 1, size(is_held, 1)
        if (.not. is_held(j, i)) cycle
        at = size(is_held, 1)*row(i) + j - 1
        call MatSetValues(matrix, 1, at, 1, at, [scale], ADD_VALUES, code)
      end do
    end do
  end subroutine hold

  !> The interpolation P from the corners, between displacements along the axes of the nodes.
  subroutine assemble_interpolation(dim, n_own, n_own_corners, part, matrix, error)
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n_own, n_own_corners  !! Own nodes, and own corners.
    type(part_t), intent(in) :: part(:)  !! Parts of this rank, numbered (n_parts).
    type(tMat), intent(out) :: matrix  !! P.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer, allocatable :: near(:), far(:)
    real(dp) :: block(dim, dim)
    integer :: p, i, c, k, j, n, row, pass, first, code
    external :: MatMPIAIJSetPreallocation, MatSeqAIJSetPreallocation
    allocate (near(dim*n_own), far(dim*n_own), source=0)
    call MatCreate(PETSC_COMM_WORLD, matrix, code)
    call MatSetSizes(matrix, dim*n_own, dim*n_own_corners, PETSC_DETERMINE, PETSC_DETERMINE, code)
    call MatSetType(matrix, 'aij', code)
    do pass = 1, 2
      first = huge(first)
      do p = 1, size(part)
        if (any(part(p)%is_own)) first = min(first, minval(pack(part(p)%row, part(p)%is_own)))
      end do
      do p = 1, size(part)
        associate (space => part(p)%space)
          do i = 1, size(part(p)%row)
            if (.not. part(p)%is_own(i)) cycle
            n = space%start(i + 1) - space%start(i)
            do k = space%start(i), space%start(i + 1) - 1
              c = space%corner(k)
              block = matmul(transpose(part(p)%axes(i)), part(p)%axes(space%node(c)))/n
              do j = 1, dim
                row = dim*(part(p)%row(i) - first) + j
                if (pass == 1 .and. part(p)%is_own(space%node(c))) then
                  near(row) = near(row) + count(abs(block(j, :)) > 0)
                else if (pass == 1) then
                  far(row) = far(row) + count(abs(block(j, :)) > 0)
                else
                  call set_row(dim*part(p)%row(i) + j - 1, dim*part(p)%corner_row(c), block(j, :), matrix, code)
                end if
              end do
            end do
          end do
        end associate
      end do
      if (pass == 2) exit
      call MatSeqAIJSetPreallocation(matrix, 0, near, code)
      call MatMPIAIJSetPreallocation(matrix, 0, near, 0, far, code)
      if (has_failed(code, 'memory of the interpolation', error)) return
    end do
    call finish_matrix(matrix, error)
  end subroutine assemble_interpolation

  !> Insert the nonzero entries of one row of a block.
  subroutine set_row(row, first_column, value, matrix, code)
    integer, intent(in) :: row  !! The row, from 0.
    integer, intent(in) :: first_column  !! First column of the block, from 0.
    real(dp), intent(in) :: value(:)  !! Entries (dim) [any].
    type(tMat), intent(inout) :: matrix  !! Gets them.
    integer, intent(out) :: code  !! PETSc's error code.
    integer :: j
    do j = 1, size(value)
      if (abs(value(j)) > 0) &
        call MatSetValues(matrix, 1, [row], 1, [first_column + j - 1], value(j:j), INSERT_VALUES, code)
    end do
  end subroutine set_row

  !> No entries are added any more.
  subroutine finish_matrix(matrix, error)
    type(tMat), intent(inout) :: matrix  !! The matrix.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer :: code
    call MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY, code)
    call MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY, code)
    if (has_failed(code, 'assembly', error)) return
  end subroutine finish_matrix

  !> Whether all unknowns have a number.
  subroutine check_unknowns(n, error)
    integer(int64), intent(in) :: n  !! Unknowns of all bodies, held ones included.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where they are too many; the same on all ranks.
    if (n <= largest) return
    call set_error(error, 'PETSc was built with 32-bit indices, which number '//to_text(largest)//' unknowns; '// &
                   'these bodies have '//to_text(n)//': make the meshes coarser', exit_machine)
  end subroutine check_unknowns

  !> Whether the entries of a matrix on each rank can be counted. All ranks ask together.
  subroutine check_entries(n, error)
    integer(int64), intent(in) :: n  !! Entries of this rank.
    !> Allocated where those of a rank are too many; the same on all ranks.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: most(1)
    most = real(n, dp)
    call largest_of_ranks(most)
    if (most(1) <= real(largest, dp)) return
    call set_error(error, 'PETSc was built with 32-bit indices, which number '//to_text(largest)// &
                   ' entries of the stiffness on a rank; one has '//to_text(nint(most(1), int64))// &
                   ': take more ranks', exit_machine)
  end subroutine check_entries
end module dotyk_distributed_assembly
