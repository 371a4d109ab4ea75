!> The linear system of an active set, `K + B^T W B`, as an operator of PETSc, and its smoother's `(D + B^T W B)^{-1}`.
!>
!> Rigid body motions of floating bodies, which springs T hold where the rows hardly do, are deflated: conjugate
!> gradients see `P (K + B^T W B + R T R^T)`, P the projection along forces `A R` to those without resultants on
!> the modes R, and the amplitudes follow from `S = G^T W G + T`.
!>
!> The contact is not assembled into the fine matrix: that would be a second one. D are the diagonal blocks of K times
!> the greatest eigenvalue of D^{-1} K, so that `K + B^T W B <= D + B^T W B` however stiff the rows; its inverse is that
!> of D, PETSc's point-block Jacobi, by the identity of Woodbury with a sparse factor of the active rows, which one rank
!> of each node has and solves with. (`dotyk_scheme_contact_smoother` in one process.)
module dotyk_distributed_operator
  use petscksp, only: KSPComputeExtremeSingularValues, KSPCreate, KSPDestroy, KSPGetConvergedReason, KSPGetPC, &
    KSPSetComputeSingularValues, KSPSetNormType, KSPSetOperators, KSPSetTolerances, KSPSetType, KSPSolve, &
    KSP_DIVERGED_NANORINF, KSP_NORM_NATURAL, MATOP_MULT, MatDestroy, MatMult, PCApply, PCCreate, PCDestroy, &
    PCSetOperators, PCSetType, PCSetUp, PETSC_COMM_WORLD, PETSC_DEFAULT_REAL, PETSC_DETERMINE, PETSC_TRUE, tKSP, tMat, &
    tPC, tVec, VecDestroy, VecGetArrayF90, VecGetArrayReadF90, VecRestoreArrayF90, VecRestoreArrayReadF90, VecScale
  use petscmat, only: INSERT_VALUES, MatCreate, MatGetValues, MatSetSizes, MatSetType, MatSetValues, PETSC_COMM_WORLD, &
    PETSC_DETERMINE, PETSC_NULL_INTEGER, tMat
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: golden
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_distributed_assembly, only: finish_matrix
  use dotyk_distributed_contact_rows, only: contact_rows_t
  use dotyk_distributed_petsc, only: has_failed, sum_of_ranks
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_linalg_chebyshev, only: lanczos_margin, lanczos_steps
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_ranks_exchange, only: agree_on_error
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_gap_closing, only: factorize_rows, restrict_matrix
  use dotyk_scheme_proximal_system, only: mode_factor_t, multiply_springs
  implicit none
  private

  !> The operator. PETSc has its address: never copy or move it, destroy it in the end.
  type, public :: system_operator_t
    type(distributed_stiffness_t), pointer :: stiffness => null()  !! The stiffness.
    type(contact_rows_t) :: rows  !! The rows.
    real(dp), allocatable :: row_stiffness(:)  !! W; zero where not active (n_rows) [force/length].
    integer, allocatable :: active(:)  !! Active rows, ascending (n).
    !> `K + B^T W B`; and what conjugate gradients get, with the modes as its null space.
    type(tMat) :: matrix, singular
    real(dp), allocatable :: row_mode(:, :)  !! Displacements of the rows by the modes, G (n_rows, n_modes) [].
    type(mode_factor_t) :: modes  !! Factor of S.
    type(mode_block_t), allocatable :: spring(:)  !! T; not allocated without contact (n_bodies) [force/length].
    !> Estimate of the greatest eigenvalue of D^{-1} K with the diagonal blocks D, with a margin [].
    real(dp) :: greatest = 0
    integer :: n_products = 0, n_smoothings = 0  !! Products with K, and applications of D^{-1}, so far.
    type(tPC), private :: blocks  !! D^{-1}.
    logical, private :: is_borrowed = .false.  !! Whether it is that of another operator.
    !> Of W^{-1} + B D^{-1} B^T on the active rows; on the rank of each node that has the compliance of the rows.
    type(cholesky_t), private :: factor
  contains
    procedure :: init => operator_init
    procedure :: init_like => operator_init_like
    procedure :: set_active => operator_set_active
    procedure :: set_springs => operator_set_springs
    procedure :: subtract_modes => operator_subtract_modes
    procedure :: make_smoother => operator_make_smoother
    procedure :: destroy => operator_destroy
  end type system_operator_t

  !> Reduction of the residual at which Ritz values are exact: another step would divide zero by zero [].
  real(dp), parameter :: exact = 1.0e-10_dp

  interface
    !> Make an operator of an own procedure.
    subroutine MatCreateShell(comm, n_rows, n_columns, all_rows, all_columns, context, matrix, code)
      import :: system_operator_t, tMat
      integer, intent(in) :: comm  !! Communicator.
      integer, intent(in) :: n_rows, n_columns, all_rows, all_columns  !! Own and all rows and columns.
      type(system_operator_t), target :: context  !! What the procedure gets.
      type(tMat) :: matrix  !! The operator.
      integer, intent(out) :: code  !! PETSc's error code.
    end subroutine MatCreateShell

    !> What an own procedure gets.
    subroutine MatShellGetContext(matrix, context, code)
      import :: system_operator_t, tMat
      type(tMat), intent(in) :: matrix  !! The operator.
      type(system_operator_t), pointer, intent(out) :: context  !! As given to `MatCreateShell`.
      integer, intent(out) :: code  !! PETSc's error code.
    end subroutine MatShellGetContext

    !> Set what an own procedure gets.
    subroutine PCShellSetContext(pc, context, code)
      import :: system_operator_t, tPC
      type(tPC), intent(in) :: pc  !! The preconditioner.
      type(system_operator_t), target, intent(in) :: context  !! What the procedure gets.
      integer, intent(out) :: code  !! PETSc's error code.
    end subroutine PCShellSetContext

    !> What an own procedure gets.
    subroutine PCShellGetContext(pc, context, code)
      import :: system_operator_t, tPC
      type(tPC), intent(in) :: pc  !! The preconditioner.
      type(system_operator_t), pointer, intent(out) :: context  !! As given to `PCShellSetContext`.
      integer, intent(out) :: code  !! PETSc's error code.
    end subroutine PCShellGetContext
  end interface

contains

  !> Make the operator without active rows.
  subroutine operator_init(self, stiffness, n_rows, block, error)
    class(system_operator_t), target, intent(inout) :: self
    type(distributed_stiffness_t), target, intent(in) :: stiffness  !! The stiffness.
    integer, intent(in) :: n_rows  !! Number of rows.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B, body by body (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    real(dp), allocatable :: inverse(:, :, :)
    type(tMat) :: blocks
    integer :: k, code
    self%stiffness => stiffness
    call self%rows%init(n_rows, stiffness%dim, block, stiffness%part, stiffness%first)
    call PCCreate(PETSC_COMM_WORLD, self%blocks, code)
    call PCSetType(self%blocks, 'pbjacobi', code)
    call make_blocks(stiffness, blocks, error)
    if (allocated(error)) return
    call PCSetOperators(self%blocks, blocks, blocks, code)
    call PCSetUp(self%blocks, code)
    if (has_failed(code, 'diagonal blocks', error)) return
    call find_greatest(self, blocks, error)
    ! The preconditioner keeps a reference.
    call MatDestroy(blocks, code)
    if (allocated(error)) return
    call inverse_blocks(stiffness, self%rows%node, inverse, error)
    if (allocated(error)) return
    call self%rows%set_inverse(block, inverse/self%greatest)
    allocate (self%row_stiffness(n_rows), source=0.0_dp)
    allocate (self%active(0), self%row_mode(n_rows, size(stiffness%mode, 2)))
    do k = 1, size(stiffness%mode, 2)
      call self%rows%displacement(stiffness%mode(:, k), self%row_mode(:, k))
    end do
    call make_shell(self, multiply, self%matrix, error)
    if (.not. allocated(error)) call make_shell(self, multiply_deflated, self%singular, error)
  end subroutine operator_init

  !> Make an operator of the same stiffness that never has active rows.
  subroutine operator_init_like(self, other, error)
    class(system_operator_t), target, intent(inout) :: self
    class(system_operator_t), intent(in) :: other  !! An operator that lives longer.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    self%stiffness => other%stiffness
    self%greatest = other%greatest
    self%blocks = other%blocks
    self%is_borrowed = .true.
    allocate (self%row_stiffness(0), self%active(0))
    call make_shell(self, multiply, self%matrix, error)
    if (.not. allocated(error)) call make_shell(self, multiply, self%singular, error)
  end subroutine operator_init_like

  !> Make an operator of PETSc, which keeps the address.
  subroutine make_shell(context, product, matrix, error)
    type(system_operator_t), target, intent(in) :: context  !! The operator.
    procedure(multiply) :: product  !! Its product.
    type(tMat), intent(inout) :: matrix  !! As PETSc sees it.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer :: n, code
    external :: MatShellSetOperation
    n = context%stiffness%dim*context%stiffness%n_own
    call MatCreateShell(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, context, matrix, code)
    call MatShellSetOperation(matrix, MATOP_MULT, product, code)
    if (has_failed(code, 'operator', error)) return
  end subroutine make_shell

  !> Estimate the greatest eigenvalue of D^{-1} K by conjugate gradients.
  subroutine find_greatest(self, blocks, error)
    class(system_operator_t), intent(inout) :: self
    type(tMat), intent(in) :: blocks  !! D.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tKSP) :: solver
    type(tPC) :: pc
    type(tVec) :: b, x
    real(dp), allocatable, target :: start(:), found(:)
    real(dp) :: least
    integer :: i, n, reason, code
    n = self%stiffness%dim*self%stiffness%n_own
    allocate (start(n), found(n))
    ! The same on any number of ranks but for the numbering.
    start = [(modulo((self%stiffness%dim*self%stiffness%first + i)*golden, 1.0_dp) - 0.5_dp, i=1, n)]
    call VecCreateMPIWithArray(PETSC_COMM_WORLD, self%stiffness%dim, n, PETSC_DETERMINE, start, b, code)
    call VecCreateMPIWithArray(PETSC_COMM_WORLD, self%stiffness%dim, n, PETSC_DETERMINE, found, x, code)
    call KSPCreate(PETSC_COMM_WORLD, solver, code)
    call KSPSetType(solver, 'cg', code)
    call KSPSetOperators(solver, self%stiffness%matrix(), blocks, code)
    call KSPGetPC(solver, pc, code)
    call PCSetType(pc, 'pbjacobi', code)
    call KSPSetComputeSingularValues(solver, PETSC_TRUE, code)
    call KSPSetNormType(solver, KSP_NORM_NATURAL, code)
    call KSPSetTolerances(solver, exact, PETSC_DEFAULT_REAL, PETSC_DEFAULT_REAL, lanczos_steps, code)
    call KSPSolve(solver, b, x, code)
    if (has_failed(code, 'greatest eigenvalue', error)) return
    call KSPGetConvergedReason(solver, reason, code)
    if (reason /= KSP_DIVERGED_NANORINF) call KSPComputeExtremeSingularValues(solver, self%greatest, least, code)
    if (.not. (self%greatest > 0 .and. self%greatest <= huge(least))) &
      call set_error(error, 'the stiffness has numbers that are not finite', exit_not_solvable)
    self%greatest = lanczos_margin*self%greatest
    call KSPDestroy(solver, code)
    call VecDestroy(b, code)
    call VecDestroy(x, code)
  end subroutine find_greatest

  !> Choose the active rows and their stiffness.
  subroutine operator_set_active(self, row_stiffness, error)
    class(system_operator_t), intent(inout) :: self
    real(dp), intent(in) :: row_stiffness(:)  !! W; zero where not active (n_rows) [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or memory runs out.
    type(sparse_symmetric_t) :: part
    integer :: i
    self%row_stiffness(:) = row_stiffness
    self%active = pack([(i, i=1, size(row_stiffness))], row_stiffness > 0)
    if (size(self%active) == 0) return
    if (self%rows%keeper%keeps) then
      call self%factor%destroy()
      call restrict_matrix(self%rows%compliance, self%active, part)
      call factorize_rows(part, 1/row_stiffness(self%active), 0.0_dp, self%factor, error)
    end if
    call agree_on_error(error)
  end subroutine operator_set_active

  !> Choose the springs.
  subroutine operator_set_springs(self, spring, error)
    class(system_operator_t), intent(inout) :: self
    type(mode_block_t), intent(in) :: spring(:)  !! T; of size 0 for bodies without modes (n_bodies) [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite.
    self%spring = spring
    call self%modes%init(matmul(transpose(self%row_mode), spread(self%row_stiffness, 2, size(self%row_mode, 2))* &
                                self%row_mode), spring, error)
  end subroutine operator_set_springs

  !> y := y - (B^T W B + R T R^T) R alpha.
  subroutine operator_subtract_modes(self, alpha, y)
    class(system_operator_t), intent(in) :: self
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (n_modes) [length].
    real(dp), intent(inout), contiguous :: y(:)  !! (n) [force]
    call self%rows%subtract_force(self%row_stiffness*matmul(self%row_mode, alpha), y)
    y = y - matmul(self%stiffness%mode, multiply_springs(self%spring, alpha))
  end subroutine operator_subtract_modes

  !> y = P (K + B^T W B + R T R^T) x.
  subroutine multiply_deflated(matrix, x, y, code)
    type(tMat), intent(in) :: matrix  !! The operator.
    type(tVec), intent(in) :: x  !! Displacements [length].
    type(tVec), intent(inout) :: y  !! Forces [force].
    integer, intent(out) :: code  !! PETSc's error code.
    type(system_operator_t), pointer :: self
    real(dp), pointer :: from(:), to(:)
    real(dp), allocatable :: alpha(:)
    call multiply(matrix, x, y, code)
    call MatShellGetContext(matrix, self, code)
    if (size(self%row_mode, 2) == 0 .or. code /= 0) return
    call VecGetArrayReadF90(x, from, code)
    alpha = matmul(from, self%stiffness%mode)
    call VecRestoreArrayReadF90(x, from, code)
    call sum_of_ranks(alpha)
    call VecGetArrayF90(y, to, code)
    to = to + matmul(self%stiffness%mode, multiply_springs(self%spring, alpha))
    alpha = matmul(to, self%stiffness%mode)
    call sum_of_ranks(alpha)
    call self%modes%solve(alpha)
    call self%subtract_modes(alpha, to)
    call VecRestoreArrayF90(y, to, code)
  end subroutine multiply_deflated

  !> y = (K + B^T W B) x.
  subroutine multiply(matrix, x, y, code)
    type(tMat), intent(in) :: matrix  !! The operator.
    type(tVec), intent(in) :: x  !! Displacements [length].
    type(tVec), intent(inout) :: y  !! Forces [force].
    integer, intent(out) :: code  !! PETSc's error code.
    type(system_operator_t), pointer :: self
    real(dp), pointer :: from(:), to(:)
    real(dp), allocatable :: moved(:)
    call MatShellGetContext(matrix, self, code)
    call MatMult(self%stiffness%matrix(), x, y, code)
    self%n_products = self%n_products + 1
    if (size(self%active) == 0 .or. code /= 0) return
    allocate (moved(self%rows%n))
    call VecGetArrayReadF90(x, from, code)
    call self%rows%displacement(from, moved)
    call VecRestoreArrayReadF90(x, from, code)
    call VecGetArrayF90(y, to, code)
    call self%rows%subtract_force(-self%row_stiffness*moved, to)
    call VecRestoreArrayF90(y, to, code)
  end subroutine multiply

  !> Make a preconditioner an application of `(D + B^T W B)^{-1}`.
  subroutine operator_make_smoother(self, pc)
    class(system_operator_t), target, intent(in) :: self
    type(tPC), intent(inout) :: pc  !! The preconditioner.
    integer :: code
    external :: PCShellSetApply
    call PCSetType(pc, 'shell', code)
    call attach(self)
    call PCShellSetApply(pc, smooth, code)

  contains

    !> PETSc keeps the address.
    subroutine attach(context)
      type(system_operator_t), target, intent(in) :: context  !! The operator.
      call PCShellSetContext(pc, context, code)
    end subroutine attach
  end subroutine operator_make_smoother

  !> z = (D + B^T W B)^{-1} r.
  subroutine smooth(pc, r, z, code)
    type(tPC), intent(in) :: pc  !! The preconditioner.
    type(tVec), intent(in) :: r  !! Forces [force].
    type(tVec), intent(inout) :: z  !! Displacements [length].
    integer, intent(out) :: code  !! PETSc's error code.
    type(system_operator_t), pointer :: self
    real(dp), pointer :: to(:)
    real(dp), allocatable :: moved(:), lambda(:)
    call PCShellGetContext(pc, self, code)
    call PCApply(self%blocks, r, z, code)
    call VecScale(z, 1/self%greatest, code)
    self%n_smoothings = self%n_smoothings + 1
    if (size(self%active) == 0 .or. code /= 0) return
    allocate (moved(self%rows%n))
    call VecGetArrayF90(z, to, code)
    call self%rows%displacement(to, moved)
    lambda = moved(self%active)
    if (self%rows%keeper%keeps) call self%factor%solve(lambda)
    call self%rows%keeper%tell(lambda)
    moved(:) = 0
    moved(self%active) = lambda
    call self%rows%subtract_smoothed(moved, to)
    call VecRestoreArrayF90(z, to, code)
  end subroutine smooth

  !> Give back the memory; the stiffness remains.
  subroutine operator_destroy(self)
    class(system_operator_t), intent(inout) :: self
    integer :: code
    if (.not. allocated(self%active)) return
    call MatDestroy(self%matrix, code)
    call MatDestroy(self%singular, code)
    if (.not. self%is_borrowed) call PCDestroy(self%blocks, code)
    call self%factor%destroy()
    call self%rows%destroy()
    deallocate (self%active)
  end subroutine operator_destroy

  !> The diagonal blocks as a matrix.
  subroutine make_blocks(stiffness, blocks, error)
    type(distributed_stiffness_t), intent(in) :: stiffness  !! The stiffness.
    type(tMat), intent(out) :: blocks  !! Gets them; to be destroyed [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tMat) :: matrix
    real(dp) :: block(stiffness%dim**2)
    integer :: i, j, row(stiffness%dim), code
    external :: MatMPIBAIJSetPreallocation, MatSeqBAIJSetPreallocation
    matrix = stiffness%matrix()
    call MatCreate(PETSC_COMM_WORLD, blocks, code)
    call MatSetSizes(blocks, stiffness%dim*stiffness%n_own, stiffness%dim*stiffness%n_own, PETSC_DETERMINE, &
                     PETSC_DETERMINE, code)
    call MatSetType(blocks, 'baij', code)
    call MatSeqBAIJSetPreallocation(blocks, stiffness%dim, 1, PETSC_NULL_INTEGER, code)
    call MatMPIBAIJSetPreallocation(blocks, stiffness%dim, 1, PETSC_NULL_INTEGER, 0, PETSC_NULL_INTEGER, code)
    do i = 0, stiffness%n_own - 1
      row = stiffness%dim*(stiffness%first + i) + [(j, j=0, stiffness%dim - 1)]
      call MatGetValues(matrix, stiffness%dim, row, stiffness%dim, row, block, code)
      call MatSetValues(blocks, stiffness%dim, row, stiffness%dim, row, block, INSERT_VALUES, code)
      if (has_failed(code, 'diagonal blocks', error)) return
    end do
    call finish_matrix(blocks, error)
  end subroutine make_blocks

  !> Inverse diagonal blocks of own nodes.
  subroutine inverse_blocks(stiffness, node, inverse, error)
    type(distributed_stiffness_t), intent(in) :: stiffness  !! The stiffness.
    integer, intent(in) :: node(:)  !! Places among the own nodes (n).
    real(dp), allocatable, intent(out) :: inverse(:, :, :)  !! (dim, dim, n) [length/force]
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tMat) :: matrix
    real(dp) :: block(stiffness%dim**2)
    integer :: i, j, row(stiffness%dim), code
    allocate (inverse(stiffness%dim, stiffness%dim, size(node)))
    matrix = stiffness%matrix()
    do i = 1, size(node)
      row = stiffness%dim*(stiffness%first + node(i) - 1) + [(j, j=0, stiffness%dim - 1)]
      call MatGetValues(matrix, stiffness%dim, row, stiffness%dim, row, block, code)
      if (has_failed(code, 'diagonal blocks', error)) return
      call invert(stiffness%dim, reshape(block, [stiffness%dim, stiffness%dim]), inverse(:, :, i))
    end do
  end subroutine inverse_blocks

  !> The inverse of a small symmetric positive definite matrix, by elimination.
  pure subroutine invert(n, matrix, inverse)
    integer, intent(in) :: n  !! Order.
    real(dp), intent(in) :: matrix(n, n)  !! The matrix (n, n) [any].
    real(dp), intent(out) :: inverse(n, n)  !! Its inverse (n, n) [1/matrix].
    real(dp) :: rest(n, n), factor
    integer :: i, j
    rest = matrix
    inverse = 0
    do i = 1, n
      inverse(i, i) = 1
    end do
    do i = 1, n
      factor = 1/rest(i, i)
      rest(i, :) = factor*rest(i, :)
      inverse(i, :) = factor*inverse(i, :)
      do j = 1, n
        if (j == i) cycle
        factor = rest(j, i)
        rest(j, :) = rest(j, :) - factor*rest(i, :)
        inverse(j, :) = inverse(j, :) - factor*inverse(i, :)
      end do
    end do
    inverse = (inverse + transpose(inverse))/2
  end subroutine invert
end module dotyk_distributed_operator
