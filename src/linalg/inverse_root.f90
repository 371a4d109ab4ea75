!> The root R of the generalized inverse of a symmetric positive semidefinite matrix, `A^+ = R R^T`, and the null space
!> of A.
module dotyk_linalg_inverse_root
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_linalg_blas, only: dtrsm
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_linalg_lapack, only: dpotrf
  implicit none
  private
  public :: find_inverse_root

contains

  !> Root and null space. Without a reference A is regular and is factorized by elimination, which keeps directions of
  !> very different stiffness apart that an eigendecomposition would mix by rounding.
  subroutine find_inverse_root(a, reference, root, null_space, failed)
    real(dp), intent(in) :: a(:, :)  !! Lower triangle of A (n, n) [any].
    real(dp), intent(in) :: reference  !! Magnitude that eigenvalues of A are compared with [as `a`]; 0: A is regular.
    real(dp), allocatable, intent(out) :: root(:, :)  !! R (n, n) [1/sqrt(A)].
    real(dp), allocatable, intent(out) :: null_space(:, :)  !! Orthonormal null directions as columns (n, n_null) [].
    integer, intent(out) :: failed  !! 0, or 1 where A is not finite or the eigenvalues cannot be found.
    type(error_t), allocatable :: error
    real(dp) :: full(size(a, 1), size(a, 1)), values(size(a, 1))
    integer :: i, n
    n = size(a, 1)
    do i = 1, n
      full(i:, i) = a(i:, i)
      full(i, i:) = a(i:, i)
    end do
    allocate (root(n, n), null_space(n, 0))
    failed = 1
    if (.not. all(ieee_is_finite(full))) return
    if (.not. reference > 0) then
      call invert_by_elimination(full, root, failed)
      if (failed == 0) return
    end if
    call symmetric_eigen(full, values, root, error)
    if (allocated(error)) return
    failed = 0
    associate (is_null => .not. (values > rounding*reference .and. values > tiny(1.0_dp)))
      null_space = root(:, pack([(i, i=1, n)], is_null))
      do i = 1, n
        if (is_null(i)) then
          root(:, i) = 0
        else
          root(:, i) = root(:, i)/sqrt(values(i))
        end if
      end do
    end associate
  end subroutine find_inverse_root

  !> The root of the inverse of a positive definite matrix, `L^{-T}`.
  subroutine invert_by_elimination(a, root, failed)
    real(dp), intent(in) :: a(:, :)  !! Lower triangle of A (n, n) [any].
    real(dp), intent(out) :: root(:, :)  !! Root of the inverse (n, n) [1/sqrt(A)].
    integer, intent(out) :: failed  !! 0 if A is positive definite.
    real(dp) :: factor(size(a, 1), size(a, 1))
    integer :: i, n
    n = size(a, 1)
    factor = a
    call dpotrf('L', n, factor, n, failed)
    if (failed /= 0) return
    root = 0
    do i = 1, n
      root(i, i) = 1
    end do
    call dtrsm('L', 'L', 'T', 'N', n, n, 1.0_dp, factor, n, root, n)
  end subroutine invert_by_elimination
end module dotyk_linalg_inverse_root
