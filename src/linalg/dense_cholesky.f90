!> Cholesky factors of dense matrices that are factorized again and again: one array holds matrix and factor, and stays
!> for the next one. The tiles depend on the matrix alone, and each is one call of BLAS on one thread: the digits are
!> the same on any number of threads.
module dotyk_linalg_dense_cholesky
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_blas, only: blas_threads, dgemm, dgemv, dpotrf, dsyrk, dtrsm, dtrsv, set_blas_threads
  implicit none
  private

  type, public :: dense_cholesky_t  !! The matrix A, then its factor L.
    integer :: n = 0  !! Order.
    real(dp), allocatable :: value(:)  !! A, then L in the lower triangle; the rest is unused (at least n**2) [any].
    integer, allocatable, private :: last(:)  !! Last row of each panel of columns that has entries.
  contains
    procedure :: resize => dense_resize
    procedure :: factorize => dense_factorize
    procedure :: solve => dense_solve
    procedure :: solve_lower => dense_solve_lower
  end type dense_cholesky_t

  integer, parameter :: worth_threads = 400  !! Order from which on threads share a factorization.
  integer, parameter :: panel = 256  !! Columns of a panel, and rows and columns of a task.

contains

  !> A matrix of zeros. Its memory grows, and does not shrink.
  subroutine dense_resize(self, n)
    class(dense_cholesky_t), intent(inout) :: self
    integer, intent(in) :: n  !! Order.
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
  subroutine dense_factorize(self, failed, last)
    class(dense_cholesky_t), intent(inout) :: self
    integer, intent(out) :: failed  !! First column whose pivot is not positive: no factor then; 0 if none.
    !> Last row with an entry of each column, at least the column: entries beyond stay zero; all rows if absent (n).
    integer, intent(in), optional :: last(:)
    integer :: threads, k, n_panels, far
    logical :: shared_out
    failed = 0
    n_panels = (self%n + panel - 1)/panel
    if (allocated(self%last)) deallocate (self%last)
    allocate (self%last(n_panels), source=self%n)
    if (self%n == 0) return
    if (present(last)) then
      far = 0
      do k = 1, n_panels
        far = max(far, maxval(last((k - 1)*panel + 1:min(k*panel, self%n))))
        self%last(k) = far
      end do
    end if
    shared_out = .not. omp_in_parallel() .and. self%n >= worth_threads
    if (shared_out) shared_out = omp_get_max_threads() > 1
    threads = 1
    if (shared_out) then
      threads = blas_threads()
      call set_blas_threads(1)
    end if
    !$omp parallel default(none) shared(self, failed) if (shared_out)
    !$omp single
    call factor_envelope(self%n, self%last, self%value, failed)
    !$omp end single
    !$omp end parallel
    if (shared_out) call set_blas_threads(threads)
  end subroutine dense_factorize

  !> Factorize within the envelope, panel by panel; the tiles are tasks.
  subroutine factor_envelope(n, last, a, failed)
    integer, intent(in) :: n  !! Order.
    integer, intent(in) :: last(:)  !! Last row of each panel that has entries, ascending.
    real(dp), intent(inout) :: a(n, *)  !! The matrix, then its factor (n, n) [any], [its root].
    integer, intent(out) :: failed  !! As in `factorize`.
    integer :: k, first, end, m, row, rows, column, columns
    failed = 0
    do k = 1, size(last)
      first = (k - 1)*panel + 1
      end = min(k*panel, n)
      m = end - first + 1
      call dpotrf('L', m, a(first, first), n, failed)
      if (failed > 0) then
        failed = first + failed - 1
        return
      end if
      do row = end + 1, last(k), panel
        rows = min(panel, last(k) - row + 1)
        !$omp task default(none) shared(a) firstprivate(rows, row, m, first, n)
        call dtrsm('R', 'L', 'T', 'N', rows, m, 1.0_dp, a(first, first), n, a(row, first), n)
        !$omp end task
      end do
      !$omp taskwait
      do column = end + 1, last(k), panel
        columns = min(panel, last(k) - column + 1)
        !$omp task default(none) shared(a) firstprivate(columns, column, m, first, n)
        call dsyrk('L', 'N', columns, m, -1.0_dp, a(column, first), n, 1.0_dp, a(column, column), n)
        !$omp end task
        do row = column + columns, last(k), panel
          rows = min(panel, last(k) - row + 1)
          !$omp task default(none) shared(a) firstprivate(rows, row, columns, column, m, first, n)
          call dgemm('N', 'T', rows, columns, m, -1.0_dp, a(row, first), n, a(column, first), n, 1.0_dp, &
                     a(row, column), n)
          !$omp end task
        end do
      end do
      !$omp taskwait
    end do
  end subroutine factor_envelope

  !> x := (L L^T)^{-1} x.
  subroutine dense_solve(self, x)
    class(dense_cholesky_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:)  !! Right-hand side in [any], solution out (n) [x/A].
    call solve_envelope(self%n, self%last, self%value, x)
  end subroutine dense_solve

  !> x := (L L^T)^{-1} x, panel by panel.
  subroutine solve_envelope(n, last, a, x)
    integer, intent(in) :: n  !! Order.
    integer, intent(in) :: last(:)  !! Last row of each panel that has entries, ascending.
    real(dp), intent(in) :: a(n, *)  !! The factor (n, n) [any].
    real(dp), intent(inout) :: x(n)  !! Right-hand side in, solution out (n) [any].
    integer :: k, first, end, m
    do k = 1, size(last)
      first = (k - 1)*panel + 1
      end = min(k*panel, n)
      m = end - first + 1
      call dtrsv('L', 'N', 'N', m, a(first, first), n, x(first), 1)
      if (last(k) > end) &
        call dgemv('N', last(k) - end, m, -1.0_dp, a(end + 1, first), n, x(first), 1, 1.0_dp, x(end + 1), 1)
    end do
    do k = size(last), 1, -1
      first = (k - 1)*panel + 1
      end = min(k*panel, n)
      m = end - first + 1
      if (last(k) > end) &
        call dgemv('T', last(k) - end, m, -1.0_dp, a(end + 1, first), n, x(end + 1), 1, 1.0_dp, x(first), 1)
      call dtrsv('L', 'T', 'N', m, a(first, first), n, x(first), 1)
    end do
  end subroutine solve_envelope

  !> X := L^{-1} X.
  subroutine dense_solve_lower(self, x)
    class(dense_cholesky_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:, :)  !! Right-hand sides in [any], solutions out (n, m) [X/sqrt(A)].
    if (size(x) == 0) return
    call dtrsm('L', 'L', 'N', 'N', self%n, size(x, 2), 1.0_dp, self%value, self%n, x, self%n)
  end subroutine dense_solve_lower
end module dotyk_linalg_dense_cholesky
