!> Dense kernels of the numeric factorization: fronts by columns, cut into tiles that are OpenMP tasks.
!>
!> The tiles depend on the size of a front alone, and each is one call of BLAS on one thread: the results are the same
!> to the bit on any number of threads.
module dotyk_linalg_fronts
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm
  use dotyk_linalg_lapack, only: dpotrf
  implicit none
  private
  public :: factor_panel, must_stop, subtract_square, product_tile, tile_rows, tile_columns

  !> Columns that LAPACK factorizes at a time: its diagonal block fits the second cache (128 KiB).
  integer, parameter :: leaf_columns = 128
  !> Rows of a task that solves for the rows below the diagonal block of a leaf: two blocks of DTRSM's kernel.
  integer, parameter :: leaf_rows = 256
  !> Rows of the tile of a product. DGEMM copies both factors before it multiplies: at 512 x 256 the copies take 15 % of
  !> the time.
  integer, parameter :: tile_rows = 512
  !> Columns of the tile of a product.
  integer, parameter :: tile_columns = 256

contains

  !> Cholesky factorization of the first columns of a symmetric matrix, by recursive halving of the columns.
  subroutine factor_panel(m, n, a, shared_out, may_stop, failed)
    !> Rows.
    integer, intent(in) :: m
    !> Columns, n <= m.
    integer, intent(in) :: n
    !> Lower trapezoid of the matrix [any], then of the factor (m, n) [its root]; entries above the diagonal are not
    !> touched.
    real(dp), intent(inout) :: a(m, n)
    !> Whether rows are cut too and all tiles are tasks.
    logical, intent(in) :: shared_out
    !> Whether an interrupt ends the factorization, with values that mean nothing.
    logical, intent(in) :: may_stop
    !> First column whose pivot is not positive, 0 if there is none.
    integer, intent(out) :: failed
    failed = 0
    call factor_columns(1, n)
  contains
    !> Factorize some columns; all columns before them are eliminated.
    recursive subroutine factor_columns(first, last)
      !> First column.
      integer, intent(in) :: first
      !> Last column.
      integer, intent(in) :: last
      integer :: middle
      if (must_stop(may_stop)) return
      if (last - first < leaf_columns) then
        call factor_leaf(m, first, last, a, shared_out, failed)
        return
      end if
      middle = first + 8*((last - first + 1)/16) - 1
      call factor_columns(first, middle)
      if (failed > 0) return
      call eliminate(m, first, middle, last, a, shared_out, may_stop)
      call factor_columns(middle + 1, last)
    end subroutine factor_columns
  end subroutine factor_panel

  !> Factorize a few columns: the diagonal block by LAPACK, then the rows below it.
  subroutine factor_leaf(m, first, last, a, shared_out, failed)
    !> Rows of the front.
    integer, intent(in) :: m
    !> First column.
    integer, intent(in) :: first
    !> Last column.
    integer, intent(in) :: last
    !> The front (m, at least last) [any], then the factor [its root] in the columns eliminated.
    real(dp), intent(inout) :: a(m, *)
    !> As in `factor_panel`.
    logical, intent(in) :: shared_out
    !> As in `factor_panel`.
    integer, intent(out) :: failed
    integer :: n, row, rows
    n = last - first + 1
    call dpotrf('L', n, a(first, first), m, failed)
    if (failed > 0) then
      failed = first + failed - 1
      return
    end if
    if (last == m) return
    if (.not. shared_out) then
      call dtrsm('R', 'L', 'T', 'N', m - last, n, 1.0_dp, a(first, first), m, a(last + 1, first), m)
      return
    end if
    do row = last + 1, m, leaf_rows
      rows = min(leaf_rows, m - row + 1)
      !$omp task default(none) shared(a) firstprivate(rows, row, n, m, first)
      call dtrsm('R', 'L', 'T', 'N', rows, n, 1.0_dp, a(first, first), m, a(row, first), m)
      !$omp end task
    end do
    !$omp taskwait
  end subroutine factor_leaf

  !> Eliminate columns: A(middle+1:m, middle+1:last) <- itself - A(middle+1:m, first:middle) A(middle+1:last,
  !> first:middle)^T.
  subroutine eliminate(m, first, middle, last, a, shared_out, may_stop)
    !> Rows of the front.
    integer, intent(in) :: m
    !> First column to eliminate.
    integer, intent(in) :: first
    !> Last column to eliminate.
    integer, intent(in) :: middle
    !> Last column to change.
    integer, intent(in) :: last
    !> The front (m, at least last) [any], then the factor [its root] in the columns eliminated.
    real(dp), intent(inout) :: a(m, *)
    !> As in `factor_panel`.
    logical, intent(in) :: shared_out
    !> As in `factor_panel`.
    logical, intent(in) :: may_stop
    integer :: column, columns, row, rows, k
    k = middle - first + 1
    do column = middle + 1, last, tile_columns
      columns = min(tile_columns, last - column + 1)
      !$omp task default(none) shared(a) firstprivate(columns, column, k, m, first, may_stop) if(shared_out)
      if (.not. must_stop(may_stop)) then
        call dsyrk('L', 'N', columns, k, -1.0_dp, a(column, first), m, 1.0_dp, a(column, column), m)
      end if
      !$omp end task
      do row = column + columns, m, tile_rows
        rows = min(tile_rows, m - row + 1)
        !$omp task default(none) shared(a) firstprivate(rows, row, columns, column, k, m, first, may_stop) &
        !$omp& if(shared_out)
        if (.not. must_stop(may_stop)) then
          call dgemm('N', 'T', rows, columns, k, -1.0_dp, a(row, first), m, a(column, first), m, 1.0_dp, &
                     a(row, column), m)
        end if
        !$omp end task
      end do
    end do
    if (shared_out) then
      !$omp taskwait
    end if
  end subroutine eliminate

  !> Whether an interrupt has come that ends the factorization.
  logical function must_stop(may_stop)
    !> Whether it may.
    logical, intent(in) :: may_stop
    must_stop = may_stop
    if (must_stop) must_stop = interrupted()
  end function must_stop

  !> C <- C - A A^T, lower triangle.
  subroutine subtract_square(n, k, a, m, c)
    !> Order of C.
    integer, intent(in) :: n
    !> Columns of A.
    integer, intent(in) :: k
    !> Rows of the array that holds A.
    integer, intent(in) :: m
    !> A in the first n rows (m, k) [any].
    real(dp), intent(in) :: a(m, *)
    !> C (n, n) [A^2].
    real(dp), intent(inout) :: c(n, n)
    call dsyrk('L', 'N', n, k, -1.0_dp, a, m, 1.0_dp, c, n)
  end subroutine subtract_square

  !> C = - A B^T, or the lower triangle of C = - A A^T.
  subroutine product_tile(rows, columns, k, a, b, m, same, c)
    !> Rows of A.
    integer, intent(in) :: rows
    !> Rows of B.
    integer, intent(in) :: columns
    !> Columns of A and B.
    integer, intent(in) :: k
    !> Rows of the array that holds A and B.
    integer, intent(in) :: m
    !> A in the first rows (m, k) [any].
    real(dp), intent(in) :: a(m, *)
    !> B in the first rows (m, k) [any].
    real(dp), intent(in) :: b(m, *)
    !> Whether B is A.
    logical, intent(in) :: same
    !> C (rows, columns) [A B].
    real(dp), intent(out) :: c(rows, columns)
    if (same) then
      call dsyrk('L', 'N', rows, k, -1.0_dp, a, m, 0.0_dp, c, rows)
    else
      call dgemm('N', 'T', rows, columns, k, -1.0_dp, a, m, b, m, 0.0_dp, c, rows)
    end if
  end subroutine product_tile
end module dotyk_linalg_fronts
