!> Rigid body modes of distributed bodies as the null space of an operator.
module dotyk_distributed_null_space
  use petscmat, only: MatNullSpaceCreate, MatNullSpaceDestroy, MatSetNullSpace, PETSC_COMM_WORLD, PETSC_FALSE, tMat, &
    tMatNullSpace
  use petscvec, only: tVec, VecDestroy, VecGetArrayF90, VecRestoreArrayF90
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_distributed_petsc, only: has_failed
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  implicit none
  private
  public :: set_null_space

contains

  !> Make the rigid body modes the null space of an operator: solvers take them out of residuals and iterates.
  subroutine set_null_space(stiffness, matrix, error)
    type(distributed_stiffness_t), intent(in) :: stiffness  !! With the modes.
    type(tMat), intent(in) :: matrix  !! The operator.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tMatNullSpace) :: space
    type(tVec) :: vector(size(stiffness%mode, 2))
    real(dp), pointer :: x(:)
    integer :: k, code
    do k = 1, size(vector)
      call stiffness%make_vector(vector(k))
      call VecGetArrayF90(vector(k), x, code)
      x = stiffness%mode(:, k)
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
end module dotyk_distributed_null_space
