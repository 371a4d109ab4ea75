!> Cholesky factors of dense matrices that are factorized again and again: one array holds matrix and factor, and stays
!> for the next one. The tiles of `dotyk_linalg_fronts` give the same digits on any number of threads.
module dotyk_linalg_dense_cholesky
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_blas, only: blas_threads, dtrsm, dtrsv, set_blas_threads
  use dotyk_linalg_fronts, only: factor_panel
  implicit none
  private

  !> The matrix A, then its factor L.
  type, public :: dense_cholesky_t
    !> Order.
    integer :: n = 0
    !> A, then L in the lower triangle; the entries above the diagonal mean nothing (at least n**2) [any].
    real(dp), allocatable :: value(:)
  contains
    procedure :: resize => dense_resize
    procedure :: factorize => dense_factorize
    procedure :: solve => dense_solve
    procedure :: solve_lower => dense_solve_lower
    procedure :: least_pivot => dense_least_pivot
  end type dense_cholesky_t

  !> Order from which on threads share a factorization.
  integer, parameter :: worth_threads = 400

contains

  !> A matrix of zeros. Its memory grows, and does not shrink.
  subroutine dense_resize(self, n)
    class(dense_cholesky_t), intent(inout) :: self
    !> Order.
    integer, intent(in) :: n
    integer(int64) :: length
    length = int(n, int64)**2
    if (allocated(self%value)) then
      if (size(self%value, kind=int64) < length) deallocate (self%value)
    end if
    if (.not. allocated(self%value)) allocate (self%value(length))
    self%n = n
    self%value(:length) = 0
  end subroutine dense_resize

  !> Factorize the matrix, whose lower triangle is read.
  subroutine dense_factorize(self, failed)
    class(dense_cholesky_t), intent(inout) :: self
    !> First column whose pivot is not positive: there is no factor then; 0 if there is none.
    integer, intent(out) :: failed
    integer :: threads
    failed = 0
    if (self%n == 0) return
    if (omp_in_parallel() .or. self%n < worth_threads .or. omp_get_max_threads() == 1) then
      call factor_panel(self%n, self%n, self%value, .false., .false., failed)
      return
    end if
    threads = blas_threads()
    call set_blas_threads(1)
    !$omp parallel default(none) shared(self, failed)
    !$omp single
    call factor_panel(self%n, self%n, self%value, .true., .false., failed)
    !$omp end single
    !$omp end parallel
    call set_blas_threads(threads)
  end subroutine dense_factorize

  !> x := (L L^T)^{-1} x.
  subroutine dense_solve(self, x)
    class(dense_cholesky_t), intent(in) :: self
    !> Right-hand side in [any], solution out (n) [x/A].
    real(dp), intent(inout), contiguous :: x(:)
    if (self%n == 0) return
    call dtrsv('L', 'N', 'N', self%n, self%value, self%n, x, 1)
    call dtrsv('L', 'T', 'N', self%n, self%value, self%n, x, 1)
  end subroutine dense_solve

  !> X := L^{-1} X.
  subroutine dense_solve_lower(self, x)
    class(dense_cholesky_t), intent(in) :: self
    !> Right-hand sides in [any], solutions out (n, m) [X/sqrt(A)].
    real(dp), intent(inout), contiguous :: x(:, :)
    if (size(x) == 0) return
    call dtrsm('L', 'L', 'N', 'N', self%n, size(x, 2), 1.0_dp, self%value, self%n, x, self%n)
  end subroutine dense_solve_lower

  !> The least pivot of the factor, the square of its diagonal entry; huge for order 0 [A].
  pure real(dp) function dense_least_pivot(self) result(least)
    class(dense_cholesky_t), intent(in) :: self
    integer :: i
    least = huge(least)
    do i = 1, self%n
      least = min(least, self%value(int(i - 1, int64)*(self%n + 1) + 1)**2)
    end do
  end function dense_least_pivot
end module dotyk_linalg_dense_cholesky
