!> The stiffness of all bodies as one distributed matrix, on two levels: fine block rows, and the Galerkin matrix of the
!> corner space with its near-null-space vectors. Bodies of linear elements alone have one level, the latter.
!>
!> Displacements are those along the axes of the nodes (`constraint_t`), zero where they are held; prescribed ones are
!> in the loads. Everything of a rank is of the size of its parts.
!>
!> Block rows of the matrices of all bodies: rank after rank, each rank's own nodes part by part along a space-filling
!> curve; those of the coarse matrix likewise, on the corners.
module dotyk_distributed_stiffness
  use petscmat, only: MatDestroy, MatGetDiagonal, MatNullSpaceCreate, MatNullSpaceDestroy, MatSetNearNullSpace, &
    PETSC_COMM_WORLD, PETSC_DETERMINE, PETSC_FALSE, tMat, tMatNullSpace
  use petscvec, only: INSERT_VALUES, ISCreateGeneral, ISCreateStride, ISDestroy, PETSC_COMM_SELF, PETSC_COMM_WORLD, &
    PETSC_COPY_VALUES, PETSC_DECIDE, PETSC_NULL_VEC, SCATTER_FORWARD, tIS, tVec, tVecScatter, VecAssemblyBegin, &
    VecAssemblyEnd, VecAXPY, VecCreateMPI, VecCreateSeq, VecDestroy, VecDot, VecDuplicate, VecGetArrayF90, &
    VecGetArrayReadF90, VecNormalize, VecRestoreArrayF90, VecRestoreArrayReadF90, VecSetValues
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_distributed_assembly, only: add_elements, assemble_interpolation, check_unknowns, finish_matrix, &
    make_block_matrix
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_petsc, only: first_of_rank, has_failed, largest_of_ranks, sum_of_ranks
  use dotyk_elasticity_constraint, only: held
  use dotyk_elasticity_rigid_body_modes, only: near_null_vectors
  use dotyk_mesh_element_ordering, only: morton_order
  use dotyk_ranks_exchange, only: agree_on_error
  implicit none
  private

  !> The stiffness. It owns objects of PETSc: never copy it, destroy it in the end.
  type, public :: distributed_stiffness_t
    integer :: dim = 0  !! Number of displacement components.
    type(part_t), allocatable :: part(:)  !! Parts of this rank, numbered, without elements (n_parts).
    integer :: n_own = 0, first = 0  !! Own nodes; block row of the first one, from 0.
    integer :: n_own_corners = 0, n_corners = 0  !! Own corners, and all of them.
    !> Whether all elements are linear: `coarse` is the stiffness then, and there is no other.
    logical :: is_linear = .false.
    type(tMat) :: fine  !! Stiffness by blocks; held components have a diagonal entry [force/length].
    type(tMat) :: coarse  !! P^T K P, likewise [force/length].
    type(tMat) :: interpolation  !! Interpolation P from the corners [].
    real(dp), allocatable :: load(:)  !! Loads minus the forces of prescribed displacements (dim*n_own) [force].
    !> Forces of prescribed displacements z, K z, along free components (dim*n_own) [force].
    real(dp), allocatable :: lift(:)
    real(dp) :: lift_energy = 0, lift_work = 0  !! A(z, z)/2 [energy], and the work of the loads on z [energy].
    !> Rigid body modes that the supports leave, body after body, orthonormal (dim*n_own, n_modes) [].
    real(dp), allocatable :: mode(:, :)
    integer, allocatable :: body_of_mode(:)  !! Body of each mode (n_modes).
  contains
    procedure :: init => stiffness_init
    procedure :: matrix => stiffness_matrix
    procedure :: make_vector => stiffness_make_vector
    procedure :: wrap => stiffness_wrap
    procedure :: diagonal => stiffness_diagonal
    procedure :: entries => stiffness_entries
    procedure :: nodal_displacement => stiffness_nodal_displacement
    procedure :: destroy => stiffness_destroy
  end type distributed_stiffness_t

contains

  !> Number, assemble.
  subroutine stiffness_init(self, part, n_of_body, error)
    class(distributed_stiffness_t), intent(out) :: self
    type(part_t), allocatable, intent(inout) :: part(:)  !! Parts of this rank; moved (n_parts).
    integer, intent(in) :: n_of_body(:)  !! Number of nodes of each body (n_bodies).
    !> Allocated where elements do not conform, or are inverted, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: load(:, :), lift(:, :)
    real(dp) :: energy(2)
    integer :: p, i, bad(1)
    logical :: conforming
    call move_alloc(part, self%part)
    self%dim = self%part(1)%mesh%dimension
    call check_unknowns(self%dim*sum(int(n_of_body, int64)), error)
    if (allocated(error)) return
    bad = 0
    do p = 1, size(self%part)
      call self%part(p)%space%init(self%part(p)%mesh, conforming)
      if (.not. conforming) bad = 1
    end do
    call sum_of_ranks(bad)
    if (bad(1) > 0) then
      call set_error(error, 'multigrid: the elements do not conform: a node has different corners in two elements', &
                     exit_not_solvable)
      return
    end if
    call number_rows(self%part, n_of_body, self%n_own, self%n_own_corners, error)
    if (allocated(error)) return
    self%first = first_of_rank(self%n_own)
    bad = self%n_own - self%n_own_corners
    call sum_of_ranks(bad)
    self%is_linear = bad(1) == 0
    bad = self%n_own_corners
    call sum_of_ranks(bad)
    self%n_corners = bad(1)
    if (.not. self%is_linear) call make_block_matrix(.true., self%dim, self%n_own, self%part, .false., self%fine, error)
    if (.not. allocated(error)) &
      call make_block_matrix(.false., self%dim, self%n_own_corners, self%part, .true., self%coarse, error)
    if (allocated(error)) return
    allocate (self%load(self%dim*self%n_own), self%lift(self%dim*self%n_own))
    energy = 0
    do p = 1, size(self%part)
      associate (of_part => self%part(p))
        load = of_part%load
        do i = 1, size(of_part%row)
          if (of_part%constraint%frame_of(i) > 0) &
            load(:, i) = matmul(load(:, i), of_part%constraint%frame(:, :, of_part%constraint%frame_of(i)))
        end do
        allocate (lift, mold=load)
        lift = 0
        call add_elements(of_part, .not. self%is_linear, self%fine, self%coarse, lift, error)
        if (allocated(error)) exit
        do i = 1, size(of_part%row)
          if (.not. of_part%is_own(i)) cycle
          associate (z => of_part%constraint%prescribed(:, i), is_free => of_part%constraint%equation(:, i) /= held, &
                     first => self%dim*(of_part%row(i) - self%first) + 1)
            energy = energy + [sum(z*lift(:, i))/2, sum(z*load(:, i))]
            self%lift(first:first + self%dim - 1) = merge(lift(:, i), 0.0_dp, is_free)
            self%load(first:first + self%dim - 1) = merge(load(:, i) - lift(:, i), 0.0_dp, is_free)
          end associate
        end do
        deallocate (lift)
      end associate
    end do
    call agree_on_error(error)
    if (allocated(error)) return
    call sum_of_ranks(energy)
    self%lift_energy = energy(1)
    self%lift_work = energy(2)
    if (.not. self%is_linear) call finish_matrix(self%fine, error)

    if (.not. allocated(error)) call finish_matrix(self%coarse, error)
    if (allocated(error)) return
    if (.not. self%is_linear) &
      call assemble_interpolation(self%dim, self%n_own, self%n_own_corners, self%part, self%interpolation, error)
    if (.not. allocated(error)) call set_near_null_space(self%dim, self%part, self%n_own_corners, self%coarse, error)
    call take_modes(self, size(n_of_body))
  end subroutine stiffness_init

  !> The matrix of all displacements.
  function stiffness_matrix(self) result(matrix)
    class(distributed_stiffness_t), intent(in) :: self
    type(tMat) :: matrix  !! Without a reference of its own.
    matrix = self%fine
    if (self%is_linear) matrix = self%coarse
  end function stiffness_matrix

  !> A vector over all unknowns.
  subroutine stiffness_make_vector(self, vector)
    class(distributed_stiffness_t), intent(in) :: self
    type(tVec), intent(inout) :: vector  !! The vector.
    integer :: code
    call MatCreateVecs(self%matrix(), vector, PETSC_NULL_VEC, code)
  end subroutine stiffness_make_vector

  !> An array as a vector of PETSc, which uses its memory.
  subroutine stiffness_wrap(self, x, vector)
    class(distributed_stiffness_t), intent(in) :: self
    real(dp), intent(inout), contiguous, target :: x(:)  !! Own unknowns (dim*n_own) [any].
    type(tVec), intent(inout) :: vector  !! The vector; to be destroyed before the array.
    integer :: code
    call VecCreateMPIWithArray(PETSC_COMM_WORLD, self%dim, size(x), PETSC_DETERMINE, x, vector, code)
  end subroutine stiffness_wrap

  !> The rigid body modes along the axes of the own nodes.
  subroutine take_modes(self, n_bodies)
    class(distributed_stiffness_t), intent(inout) :: self
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer :: n_of_body(n_bodies), p, i, k, j, first
    n_of_body = 0
    do p = 1, size(self%part)
      n_of_body(self%part(p)%body) = size(self%part(p)%mode, 3)
    end do
    self%body_of_mode = [(spread(k, 1, n_of_body(k)), k=1, n_bodies)]
    allocate (self%mode(self%dim*self%n_own, size(self%body_of_mode)), source=0.0_dp)
    do p = 1, size(self%part)
      associate (part => self%part(p))
        first = sum(n_of_body(:part%body - 1))
        do i = 1, size(part%row)
          if (.not. part%is_own(i)) cycle
          k = self%dim*(part%row(i) - self%first)
          do j = 1, size(part%mode, 3)
            self%mode(k + 1:k + self%dim, first + j) = matmul(part%mode(:, i, j), part%axes(i))
          end do
        end do
        deallocate (part%mode)
      end associate
    end do
  end subroutine take_modes

  !> Diagonal of the stiffness.
  subroutine stiffness_diagonal(self, diagonal)
    class(distributed_stiffness_t), intent(in) :: self
    real(dp), allocatable, intent(out) :: diagonal(:)  !! Of the own unknowns (dim*n_own) [force/length].
    type(tVec) :: vector
    real(dp), pointer :: x(:)
    integer :: code
    call self%make_vector(vector)
    call MatGetDiagonal(self%matrix(), vector, code)
    call VecGetArrayF90(vector, x, code)
    diagonal = x
    call VecRestoreArrayF90(vector, x, code)
    call VecDestroy(vector, code)
  end subroutine stiffness_diagonal

  !> Entries of a vector over all unknowns, wherever they are.
  subroutine stiffness_entries(self, own, entry, found, error)
    class(distributed_stiffness_t), intent(in) :: self
    real(dp), intent(in) :: own(:)  !! Own unknowns (dim*n_own) [any].
    integer, intent(in) :: entry(:)  !! Entries that this rank wants, from 0 (n).
    real(dp), allocatable, intent(out) :: found(:)  !! (n) [as own]
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tVec) :: all
    real(dp), allocatable, target :: x(:)
    integer :: code
    x = own
    call self%wrap(x, all)
    call gather_entries(all, entry, found, error)
    call VecDestroy(all, code)
  end subroutine stiffness_entries

  !> Displacements of all nodes of a part, ghosts included, in global axes, with prescribed ones.
  subroutine stiffness_nodal_displacement(self, p, x, u, error)
    class(distributed_stiffness_t), intent(in) :: self
    integer, intent(in) :: p  !! The part.
    real(dp), intent(in) :: x(:)  !! Displacements of the own nodes along their axes (dim*n_own) [length].
    real(dp), allocatable, intent(out) :: u(:, :)  !! (dim, n_nodes of the part) [length]
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    real(dp), allocatable :: found(:)
    integer :: i, j
    associate (part => self%part(p), constraint => self%part(p)%constraint)
      call self%entries(x, [((self%dim*part%row(i) + j, j=0, self%dim - 1), i=1, size(part%row))], found, error)
      if (allocated(error)) return
      u = reshape(found, [self%dim, size(part%row)])
      where (constraint%equation == held) u = constraint%prescribed
      do i = 1, size(part%row)
        if (constraint%frame_of(i) > 0) u(:, i) = matmul(constraint%frame(:, :, constraint%frame_of(i)), u(:, i))
      end do
    end associate
  end subroutine stiffness_nodal_displacement

  !> Give back the memory.
  subroutine stiffness_destroy(self)
    class(distributed_stiffness_t), intent(inout) :: self
    integer :: code
    if (.not. allocated(self%load)) return
    if (.not. self%is_linear) then
      call MatDestroy(self%fine, code)
      call MatDestroy(self%interpolation, code)
    end if
    call MatDestroy(self%coarse, code)
    deallocate (self%load)
  end subroutine stiffness_destroy

  !> Rigid motions as near-null-space vectors of the coarse matrix.
  subroutine set_near_null_space(dim, parts, n_own_corners, coarse, error)
    integer, intent(in) :: dim  !! Number of displacement components.
    type(part_t), intent(in) :: parts(:)  !! Parts of this rank, numbered (n_parts).
    integer, intent(in) :: n_own_corners  !! Own corners.
    type(tMat), intent(in) :: coarse  !! The matrix; gets the vectors [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tMatNullSpace) :: space
    type(tVec), allocatable :: vector(:)
    real(dp), allocatable, target :: value(:, :)
    real(dp), allocatable :: of_part(:, :)
    real(dp) :: box(dim, 2), extent(2*dim), product
    integer :: p, c, j, k, code, first
    first = dim*first_of_rank(n_own_corners)
    extent = -huge(extent)
    do p = 1, size(parts)
      if (size(parts(p)%mesh%x) == 0) cycle
      associate (x => parts(p)%mesh%x)
        extent = max(extent, [-minval(x, 2), maxval(x, 2)])
      end associate
    end do
    call largest_of_ranks(extent)
    box(:, 1) = -extent(:dim)
    box(:, 2) = extent(dim + 1:)
    allocate (value(dim*n_own_corners, merge(6, 3, dim == 3)), source=0.0_dp)
    do p = 1, size(parts)
      associate (part => parts(p))
        call near_null_vectors(part%mesh%x, part%constraint, of_part, box)
        do c = 1, part%space%n
          if (.not. part%is_own(part%space%node(c))) cycle
          j = dim*part%corner_row(c) - first
          k = dim*(part%space%node(c) - 1)
          value(j + 1:j + dim, :) = of_part(k + 1:k + dim, :)
        end do
      end associate
    end do
    allocate (vector(size(value, 2)))
    do j = 1, size(vector)
      call VecCreateMPIWithArray(PETSC_COMM_WORLD, dim, size(value, 1), PETSC_DETERMINE, value(:, j), vector(j), code)
      do k = 1, j - 1
        call VecDot(vector(j), vector(k), product, code)
        call VecAXPY(vector(j), -product, vector(k), code)
      end do
      call VecNormalize(vector(j), product, code)
    end do
    ! It refers to the vectors: they need memory of their own.
    do j = 1, size(vector)
      call own_copy(vector(j))
    end do
    call MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, size(vector), vector, space, code)
    if (has_failed(code, 'near null space', error)) return
    call MatSetNearNullSpace(coarse, space, code)
    call MatNullSpaceDestroy(space, code)
    do j = 1, size(vector)
      call VecDestroy(vector(j), code)
    end do
  end subroutine set_near_null_space

  !> A vector with memory of its own in place of one over an array.
  subroutine own_copy(vector)
    type(tVec), intent(inout) :: vector  !! The vector.
    type(tVec) :: copy
    real(dp), pointer :: from(:), to(:)
    integer :: code
    call VecDuplicate(vector, copy, code)
    call VecGetArrayF90(vector, from, code)
    call VecGetArrayF90(copy, to, code)
    to = from
    call VecRestoreArrayF90(copy, to, code)
    call VecRestoreArrayF90(vector, from, code)
    call VecDestroy(vector, code)
    vector = copy
  end subroutine own_copy

  !> Number the nodes and corners of all parts.
  subroutine number_rows(part, n_of_body, n_own, n_own_corners, error)
    type(part_t), intent(inout) :: part(:)  !! Parts of this rank; get `row` and `corner_row` (n_parts).
    integer, intent(in) :: n_of_body(:)  !! Number of nodes of each body (n_bodies).
    integer, intent(out) :: n_own, n_own_corners  !! Own nodes, and own corners.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer, allocatable :: order(:), id(:), first_id(:), own_id(:), wanted(:), row(:), corner_row(:)
    real(dp), allocatable :: found(:)
    integer :: p, i, k, n, first, first_corner
    allocate (first_id, source=[0, (sum(n_of_body(:k)), k=1, size(n_of_body))])
    n_own = sum([(count(part(p)%is_own), p=1, size(part))])
    n_own_corners = sum([(count(part(p)%is_own(part(p)%space%node)), p=1, size(part))])
    first = first_of_rank(n_own)
    first_corner = first_of_rank(n_own_corners)
    allocate (own_id(n_own), row(n_own), corner_row(n_own), wanted(0))
    n = 0
    k = 0
    do p = 1, size(part)
      associate (mesh => part(p)%mesh)
        allocate (order(mesh%n_nodes()))
        id = first_id(part(p)%body) + part(p)%whole_node - 1
        call morton_order(mesh%dimension, mesh%x, reshape([(i, i=1, size(order))], [1, size(order)]), order)
        do i = 1, size(order)
          if (.not. part(p)%is_own(order(i))) cycle
          n = n + 1
          own_id(n) = id(order(i))
          row(n) = first + n - 1
          corner_row(n) = -1
          if (part(p)%space%number(order(i)) == 0) cycle
          corner_row(n) = first_corner + k
          k = k + 1
        end do
        wanted = [wanted, id]
        deallocate (order)
      end associate
    end do
    call look_up(sum(n_of_body), own_id, row, wanted, found, error)
    if (allocated(error)) return
    n = 0
    do p = 1, size(part)
      part(p)%row = nint(found(n + 1:n + size(part(p)%whole_node)))
      n = n + size(part(p)%whole_node)
    end do
    call look_up(sum(n_of_body), own_id, corner_row, wanted, found, error)
    if (allocated(error)) return
    n = 0
    do p = 1, size(part)
      part(p)%corner_row = nint(found(n + part(p)%space%node))
      n = n + size(part(p)%whole_node)
    end do
  end subroutine number_rows

  !> Values that other ranks know.
  subroutine look_up(n, own, value, wanted, found, error)
    integer, intent(in) :: n  !! Number of entries in all.
    integer, intent(in) :: own(:)  !! Entries that this rank knows, from 0 (n_own).
    integer, intent(in) :: value(:)  !! Their values (n_own).
    integer, intent(in) :: wanted(:)  !! Entries that it wants to know, from 0 (n_wanted).
    real(dp), allocatable, intent(out) :: found(:)  !! Their values (n_wanted).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tVec) :: all
    integer :: code
    call VecCreateMPI(PETSC_COMM_WORLD, PETSC_DECIDE, n, all, code)
    call VecSetValues(all, size(own), own, real(value, dp), INSERT_VALUES, code)
    call VecAssemblyBegin(all, code)
    call VecAssemblyEnd(all, code)
    if (has_failed(code, 'numbering', error)) return
    call gather_entries(all, wanted, found, error)
    call VecDestroy(all, code)
  end subroutine look_up

  !> Entries of a distributed vector, wherever they are.
  subroutine gather_entries(all, wanted, found, error)
    type(tVec), intent(in) :: all  !! The vector.
    integer, intent(in) :: wanted(:)  !! Its entries that this rank wants, from 0 (n_wanted).
    real(dp), allocatable, intent(out) :: found(:)  !! (n_wanted) [as `all`]
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tVec) :: own
    type(tIS) :: from, to
    type(tVecScatter) :: exchange
    real(dp), pointer :: x(:)
    integer :: code
    call VecCreateSeq(PETSC_COMM_SELF, size(wanted), own, code)
    call ISCreateGeneral(PETSC_COMM_SELF, size(wanted), wanted, PETSC_COPY_VALUES, from, code)
    call ISCreateStride(PETSC_COMM_SELF, size(wanted), 0, 1, to, code)
    call VecScatterCreate(all, from, own, to, exchange, code)
    if (has_failed(code, 'exchange of nodes', error)) return
    call VecScatterBegin(exchange, all, own, INSERT_VALUES, SCATTER_FORWARD, code)
    call VecScatterEnd(exchange, all, own, INSERT_VALUES, SCATTER_FORWARD, code)
    if (has_failed(code, 'exchange of nodes', error)) return
    call VecGetArrayReadF90(own, x, code)
    found = x
    call VecRestoreArrayReadF90(own, x, code)
    call VecScatterDestroy(exchange, code)
    call ISDestroy(from, code)
    call ISDestroy(to, code)
    call VecDestroy(own, code)
  end subroutine gather_entries
end module dotyk_distributed_stiffness
