!> The diagonal blocks of the distributed stiffness, by nodes, for smoothers.
module dotyk_distributed_diagonal_blocks
  use petscmat, only: INSERT_VALUES, MatCreate, MatGetValues, MatSetSizes, MatSetType, MatSetValues, PETSC_COMM_WORLD, &
    PETSC_DETERMINE, PETSC_NULL_INTEGER, tMat
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_distributed_assembly, only: finish_matrix
  use dotyk_distributed_petsc, only: has_failed
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  implicit none
  private
  public :: inverse_blocks, make_blocks

contains

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
end module dotyk_distributed_diagonal_blocks
