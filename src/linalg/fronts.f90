!> Dense blocks of a supernodal factorization by columns, cut into tiles that OpenMP tasks share out.
!>
!> The tiles depend on the sizes of a block only, and every tile is one call of a BLAS that uses one thread: results are
!> the same on any number of threads.
module dotyk_linalg_fronts
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm
  use dotyk_linalg_lapack, only: dpotrf
  implicit none
  private
  public :: factor_panel, subtract_square, product_tile, tile_rows, tile_columns

  !> Columns that LAPACK factorizes at a time.
  integer, parameter :: leaf_columns = 128
  !> Rows of a task that solves for a leaf's rows below the diagonal block.
  integer, parameter :: leaf_rows = 256
  !> Rows and columns of a tile of a product, at which DGEMM has reached its full rate.
  integer, parameter :: tile_rows = 512, tile_columns = 256

contains

  !> The first columns of a symmetric matrix, assembled, become those of its Cholesky factor.
  subroutine factor_panel(m, n, a, shared_out, failed)
    !> Rows and columns, n <= m.
    integer, intent(in) :: m, n
    !> Lower trapezoid (m,n); what is above the diagonal is not touched.
    real(dp), intent(inout) :: a(m, n)
    !> Cut the rows of leaves too, and share all tiles out as tasks to the threads of the team.
    logical, intent(in) :: shared_out
    !> Column whose pivot is not positive; 0 if there is none.
    integer, intent(out) :: failed
    failed = 0
    call factor_columns(1, n)
  contains
    !> Columns first..last, from whose rows first..m all columns before them have been eliminated.
    recursive subroutine factor_columns(first, last)
      integer, intent(in) :: first, last
      integer :: middle
      if (last - first < leaf_columns) then
        call factor_leaf(m, first, last, a, shared_out, failed)
        return
      end if
      middle = first + 8*((last - first + 1)/16) - 1
      call factor_columns(first, middle)
      if (failed > 0) return
      call eliminate(m, first, middle, last, a, shared_out)
      call factor_columns(middle + 1, last)
    end subroutine factor_columns
  end subroutine factor_panel

  !> A few columns: the diagonal block by LAPACK, then the rows below it.
  subroutine factor_leaf(m, first, last, a, shared_out, failed)
    integer, intent(in) :: m, first, last
    real(dp), intent(inout) :: a(m, *)
    logical, intent(in) :: shared_out
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

  !> Columns middle+1..last, rows middle+1..m, minus the product of columns first..middle with themselves.
  subroutine eliminate(m, first, middle, last, a, shared_out)
    integer, intent(in) :: m, first, middle, last
    real(dp), intent(inout) :: a(m, *)
    logical, intent(in) :: shared_out
    integer :: column, columns, row, rows, k
    k = middle - first + 1
    do column = middle + 1, last, tile_columns
      columns = min(tile_columns, last - column + 1)
      !$omp task default(none) shared(a) firstprivate(columns, column, k, m, first) if(shared_out)
      call dsyrk('L', 'N', columns, k, -1.0_dp, a(column, first), m, 1.0_dp, a(column, column), m)
      !$omp end task
      do row = column + columns, m, tile_rows
        rows = min(tile_rows, m - row + 1)
        !$omp task default(none) shared(a) firstprivate(rows, row, columns, column, k, m, first) if(shared_out)
        call dgemm('N', 'T', rows, columns, k, -1.0_dp, a(row, first), m, a(column, first), m, 1.0_dp, a(row, column), m)
        !$omp end task
      end do
    end do
    if (shared_out) then
      !$omp taskwait
    end if
  end subroutine eliminate

  !> C <- C - A A^T, lower triangle.
  subroutine subtract_square(n, k, a, m, c)
    !> Order, columns of A, rows of the block that A is the upper left part of.
    integer, intent(in) :: n, k, m
    real(dp), intent(in) :: a(m, *)
    real(dp), intent(inout) :: c(n, n)
    call dsyrk('L', 'N', n, k, -1.0_dp, a, m, 1.0_dp, c, n)
  end subroutine subtract_square

  !> C = - A B^T, of which only the lower triangle where A and B are the same rows.
  subroutine product_tile(rows, columns, k, a, b, m, same, c)
    !> Rows of A and of B, their columns, rows of the block that both are parts of.
    integer, intent(in) :: rows, columns, k, m
    real(dp), intent(in) :: a(m, *), b(m, *)
    logical, intent(in) :: same
    real(dp), intent(out) :: c(rows, columns)
    if (same) then
      call dsyrk('L', 'N', rows, k, -1.0_dp, a, m, 0.0_dp, c, rows)
    else
      call dgemm('N', 'T', rows, columns, k, -1.0_dp, a, m, b, m, 0.0_dp, c, rows)
    end if
  end subroutine product_tile
end module dotyk_linalg_fronts
