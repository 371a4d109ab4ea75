!> Rigid body modes of distributed bodies that the active rows do not restrain.
module dotyk_distributed_indeterminate_modes
  use petscmat, only: MatNullSpaceCreate, MatNullSpaceDestroy, MatSetNullSpace, PETSC_COMM_WORLD, PETSC_FALSE, tMat, &
    tMatNullSpace
  use petscvec, only: tVec, VecDestroy, VecGetArrayF90, VecRestoreArrayF90
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_distributed_petsc, only: has_failed
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_linalg_dense, only: symmetric_eigen
  implicit none
  private
  public :: all_modes, find_indeterminate, set_null_space

  !> Eigenvalues of G^T W G, relative, below which there is no restraint [].
  real(dp), parameter :: rank = 1.0e-10_dp

contains

  !> The null space of G^T W G.
  subroutine find_indeterminate(row_mode, row_stiffness, mode, error)
    !> G, displacements of the rows by the rigid body modes (n_rows, n_modes) [].
    real(dp), intent(in) :: row_mode(:, :)
    !> W, zero where a row is not active (n_rows) [force/length].
    real(dp), intent(in) :: row_stiffness(:)
    !> Amplitudes of the indeterminate modes as columns, orthonormal (n_modes, n) [].
    real(dp), allocatable, intent(inout) :: mode(:, :)
    !> Allocated where a number is not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: restraint(:, :), values(:), vectors(:, :)
    integer :: n, i, j
    n = size(row_mode, 2)
    if (n == 0) return
    allocate (restraint(n, n), values(n), vectors(n, n))
    do j = 1, n
      do i = 1, n
        restraint(i, j) = sum(row_stiffness*row_mode(:, i)*row_mode(:, j))
      end do
    end do
    call symmetric_eigen(restraint, values, vectors, error)
    if (allocated(error)) return
    mode = vectors(:, :count(.not. values > rank*sum(row_stiffness)*maxval(row_mode**2)))
  end subroutine find_indeterminate

  !> Make modes the null space of an operator: solvers take them out of residuals and iterates.
  subroutine set_null_space(stiffness, mode, matrix, error)
    !> With the rigid body modes.
    type(distributed_stiffness_t), intent(in) :: stiffness
    !> Amplitudes of the indeterminate modes as columns, orthonormal (n_modes, n) [].
    real(dp), intent(in) :: mode(:, :)
    !> The operator.
    type(tMat), intent(in) :: matrix
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    type(tMatNullSpace) :: space
    type(tVec) :: vector(size(mode, 2))
    real(dp), pointer :: x(:)
    integer :: k, code
    do k = 1, size(vector)
      call stiffness%make_vector(vector(k))
      call VecGetArrayF90(vector(k), x, code)
      x = matmul(stiffness%mode, mode(:, k))
      call VecRestoreArrayF90(vector(k), x, code)
    end do
    call MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, size(vector), vector, space, code)
    call MatSetNullSpace(matrix, space, code)
    call MatNullSpaceDestroy(space, code)
    do k = 1, size(vector)
      call VecDestroy(vector(k), code)
    end do
    if (has_failed(code, 'null space', error)) return
  end subroutine set_null_space

  !> All modes: the identity.
  subroutine all_modes(n, modes)
    !> Order.
    integer, intent(in) :: n
    !> (n, n) []
    real(dp), allocatable, intent(out) :: modes(:, :)
    integer :: i
    allocate (modes(n, n), source=0.0_dp)
    do i = 1, n
      modes(i, i) = 1
    end do
  end subroutine all_modes
end module dotyk_distributed_indeterminate_modes
