!> Products of sparse matrices of 2x2 or 3x3 blocks by rows: the loops of `dotyk_linalg_block_rows` on plain arrays.
!>
!> Rows are independent and each is summed in the order of its blocks, so that results have the same digits on any
!> number of threads. Entry (i, j) of a block is at i + dim (j - 1). The matrix is read once; vectors come from the
!> caches where rows are numbered along a space-filling curve. The loops over 3x3 blocks are in block_products.c; they
!> read one entry beyond the last block.
module dotyk_linalg_block_products
  use, intrinsic :: iso_c_binding, only: c_double, c_float, c_int32_t, c_int64_t
  use dotyk_base_kinds, only: dp, int64, sp
  implicit none
  private
  public :: product_2, product_3, residual_2, residual_3, subtract_product_2, subtract_product_3, smoothing_step

  !> Rows that a thread takes at a time.
  integer, parameter :: rows_at_once = 256

  interface
    !> y = (high + low) x for some rows.
    subroutine dotyk_product_rows(first, last, start, column, high, low, x, y) bind(c)
      import :: c_double, c_float, c_int32_t, c_int64_t
      !> First row.
      integer(c_int32_t), value :: first
      !> Last row.
      integer(c_int32_t), value :: last
      !> First block of each row (n + 1).
      integer(c_int64_t), intent(in) :: start(*)
      !> Block column of each block (n_blocks).
      integer(c_int32_t), intent(in) :: column(*)
      !> Leading parts of the entries (9 n_blocks + 1) [any].
      real(c_float), intent(in) :: high(*)
      !> Remainders of the entries (9 n_blocks + 1) [as `high`].
      real(c_float), intent(in) :: low(*)
      !> Vector x (3 n) [any].
      real(c_double), intent(in) :: x(*)
      !> Product y (3 n) [matrix times x].
      real(c_double), intent(inout) :: y(*)
    end subroutine dotyk_product_rows

    !> r = b - high x for some rows.
    subroutine dotyk_residual_rows(first, last, start, column, high, b, x, r) bind(c)
      import :: c_float, c_int32_t, c_int64_t
      !> First row.
      integer(c_int32_t), value :: first
      !> Last row.
      integer(c_int32_t), value :: last
      !> First block of each row (n + 1).
      integer(c_int64_t), intent(in) :: start(*)
      !> Block column of each block (n_blocks).
      integer(c_int32_t), intent(in) :: column(*)
      !> Leading parts of the entries (9 n_blocks + 1) [any].
      real(c_float), intent(in) :: high(*)
      !> Right-hand side b (3 n) [matrix times x].
      real(c_float), intent(in) :: b(*)
      !> Vector x (3 n) [any].
      real(c_float), intent(in) :: x(*)
      !> Residual r (3 n) [as b].
      real(c_float), intent(inout) :: r(*)
    end subroutine dotyk_residual_rows

    !> r := r - high x, x in double precision, for some rows.
    subroutine dotyk_subtract_product_rows(first, last, start, column, high, x, r) bind(c)
      import :: c_double, c_float, c_int32_t, c_int64_t
      !> First row.
      integer(c_int32_t), value :: first
      !> Last row.
      integer(c_int32_t), value :: last
      !> First block of each row (n + 1).
      integer(c_int64_t), intent(in) :: start(*)
      !> Block column of each block (n_blocks).
      integer(c_int32_t), intent(in) :: column(*)
      !> Leading parts of the entries (9 n_blocks + 1) [any].
      real(c_float), intent(in) :: high(*)
      !> Vector x (3 n) [any].
      real(c_double), intent(in) :: x(*)
      !> Residual r (3 n) [matrix times x].
      real(c_float), intent(inout) :: r(*)
    end subroutine dotyk_subtract_product_rows
  end interface

contains

  !> y = A x in double precision, 3x3 blocks.
  subroutine product_3(n, start, column, high, low, x, y)
    !> Number of block rows.
    integer, intent(in) :: n
    !> First block of each row (n + 1).
    integer(int64), intent(in) :: start(n + 1)
    !> Block column of each block (n_blocks).
    integer, intent(in) :: column(*)
    !> Leading parts of the entries (9 n_blocks + 1) [any].
    real(sp), intent(in) :: high(*)
    !> Remainders of the entries (9 n_blocks + 1) [as `high`].
    real(sp), intent(in) :: low(*)
    !> Vector x (3, n) [any].
    real(dp), intent(in) :: x(3, n)
    !> Product y (3, n) [matrix times x].
    real(dp), intent(out) :: y(3, n)
    integer :: i
    !$omp parallel do default(none) shared(n, start, column, high, low, x, y) schedule(static)
    do i = 1, n, rows_at_once
      call dotyk_product_rows(i, min(n, i + rows_at_once - 1), start, column, high, low, x, y)
    end do
    !$omp end parallel do
  end subroutine product_3

  !> y = A x in double precision, 2x2 blocks.
  subroutine product_2(n, start, column, high, low, x, y)
    !> Number of block rows.
    integer, intent(in) :: n
    !> First block of each row (n + 1).
    integer(int64), intent(in) :: start(n + 1)
    !> Block column of each block (n_blocks).
    integer, intent(in) :: column(*)
    !> Leading parts of the entries (4, n_blocks) [any].
    real(sp), intent(in) :: high(4, *)
    !> Remainders of the entries (4, n_blocks) [as `high`].
    real(sp), intent(in) :: low(4, *)
    !> Vector x (2, n) [any].
    real(dp), intent(in) :: x(2, n)
    !> Product y (2, n) [matrix times x].
    real(dp), intent(out) :: y(2, n)
    real(dp) :: s1, s2, x1, x2
    integer(int64) :: k
    integer :: i
    !$omp parallel do default(none) shared(n, start, column, high, low, x, y) private(k, s1, s2, x1, x2) &
    !$omp& schedule(static)
    do i = 1, n
      s1 = 0
      s2 = 0
      do k = start(i), start(i + 1) - 1
        x1 = x(1, column(k))
        x2 = x(2, column(k))
        s1 = s1 + ((real(high(1, k), dp) + low(1, k))*x1 + (real(high(3, k), dp) + low(3, k))*x2)
        s2 = s2 + ((real(high(2, k), dp) + low(2, k))*x1 + (real(high(4, k), dp) + low(4, k))*x2)
      end do
      y(1, i) = s1
      y(2, i) = s2
    end do
    !$omp end parallel do
  end subroutine product_2

  !> r = b - A x in single precision, 3x3 blocks.
  subroutine residual_3(n, start, column, high, b, x, r)
    !> Number of block rows.
    integer, intent(in) :: n
    !> First block of each row (n + 1).
    integer(int64), intent(in) :: start(n + 1)
    !> Block column of each block (n_blocks).
    integer, intent(in) :: column(*)
    !> Leading parts of the entries (9 n_blocks + 1) [any].
    real(sp), intent(in) :: high(*)
    !> Right-hand side b (3, n) [matrix times x].
    real(sp), intent(in) :: b(3, n)
    !> Vector x (3, n) [any].
    real(sp), intent(in) :: x(3, n)
    !> Residual r (3, n) [as b].
    real(sp), intent(out) :: r(3, n)
    integer :: i
    !$omp parallel do default(none) shared(n, start, column, high, b, x, r) schedule(static)
    do i = 1, n, rows_at_once
      call dotyk_residual_rows(i, min(n, i + rows_at_once - 1), start, column, high, b, x, r)
    end do
    !$omp end parallel do
  end subroutine residual_3

  !> r = b - A x in single precision, 2x2 blocks.
  subroutine residual_2(n, start, column, high, b, x, r)
    !> Number of block rows.
    integer, intent(in) :: n
    !> First block of each row (n + 1).
    integer(int64), intent(in) :: start(n + 1)
    !> Block column of each block (n_blocks).
    integer, intent(in) :: column(*)
    !> Leading parts of the entries (4, n_blocks) [any].
    real(sp), intent(in) :: high(4, *)
    !> Right-hand side b (2, n) [matrix times x].
    real(sp), intent(in) :: b(2, n)
    !> Vector x (2, n) [any].
    real(sp), intent(in) :: x(2, n)
    !> Residual r (2, n) [as b].
    real(sp), intent(out) :: r(2, n)
    real(sp) :: s1, s2, x1, x2
    integer(int64) :: k
    integer :: i
    !$omp parallel do default(none) shared(n, start, column, high, b, x, r) private(k, s1, s2, x1, x2) schedule(static)
    do i = 1, n
      s1 = 0
      s2 = 0
      do k = start(i), start(i + 1) - 1
        x1 = x(1, column(k))
        x2 = x(2, column(k))
        s1 = s1 + (high(1, k)*x1 + high(3, k)*x2)
        s2 = s2 + (high(2, k)*x1 + high(4, k)*x2)
      end do
      r(1, i) = b(1, i) - s1
      r(2, i) = b(2, i) - s2
    end do
    !$omp end parallel do
  end subroutine residual_2

  !> r := r - A x with a vector x in double precision, 3x3 blocks: A x is small where x is large and smooth.
  subroutine subtract_product_3(n, start, column, high, x, r)
    !> Number of block rows.
    integer, intent(in) :: n
    !> First block of each row (n + 1).
    integer(int64), intent(in) :: start(n + 1)
    !> Block column of each block (n_blocks).
    integer, intent(in) :: column(*)
    !> Leading parts of the entries (9 n_blocks + 1) [any].
    real(sp), intent(in) :: high(*)
    !> Vector x (3, n) [any].
    real(dp), intent(in) :: x(3, n)
    !> Residual r (3, n) [matrix times x].
    real(sp), intent(inout) :: r(3, n)
    integer :: i
    !$omp parallel do default(none) shared(n, start, column, high, x, r) schedule(static)
    do i = 1, n, rows_at_once
      call dotyk_subtract_product_rows(i, min(n, i + rows_at_once - 1), start, column, high, x, r)
    end do
    !$omp end parallel do
  end subroutine subtract_product_3

  !> r := r - A x with a vector x in double precision, 2x2 blocks.
  subroutine subtract_product_2(n, start, column, high, x, r)
    !> Number of block rows.
    integer, intent(in) :: n
    !> First block of each row (n + 1).
    integer(int64), intent(in) :: start(n + 1)
    !> Block column of each block (n_blocks).
    integer, intent(in) :: column(*)
    !> Leading parts of the entries (4, n_blocks) [any].
    real(sp), intent(in) :: high(4, *)
    !> Vector x (2, n) [any].
    real(dp), intent(in) :: x(2, n)
    !> Residual r (2, n) [matrix times x].
    real(sp), intent(inout) :: r(2, n)
    real(dp) :: s1, s2, x1, x2
    integer(int64) :: k
    integer :: i
    !$omp parallel do default(none) shared(n, start, column, high, x, r) private(k, s1, s2, x1, x2) schedule(static)
    do i = 1, n
      s1 = 0
      s2 = 0
      do k = start(i), start(i + 1) - 1
        x1 = x(1, column(k))
        x2 = x(2, column(k))
        s1 = s1 + (high(1, k)*x1 + high(3, k)*x2)
        s2 = s2 + (high(2, k)*x1 + high(4, k)*x2)
      end do
      r(1, i) = real(r(1, i) - s1, sp)
      r(2, i) = real(r(2, i) - s2, sp)
    end do
    !$omp end parallel do
  end subroutine subtract_product_2

  !> A step of a polynomial smoother: p := c p + d D^{-1} r, x := x + p.
  subroutine smoothing_step(dim, n, inverse, c, d, r, p, x)
    !> Order of the blocks, 2 or 3.
    integer, intent(in) :: dim
    !> Number of block rows.
    integer, intent(in) :: n
    !> Inverse diagonal blocks D^{-1} (dim, dim, n) [1/matrix].
    real(sp), intent(in) :: inverse(dim, dim, n)
    !> Factor c; with 0, p need not be defined [].
    real(sp), intent(in) :: c
    !> Factor d [].
    real(sp), intent(in) :: d
    !> Residual r (dim, n) [matrix times x].
    real(sp), intent(in) :: r(dim, n)
    !> Step p (dim, n) [as x].
    real(sp), intent(inout) :: p(dim, n)
    !> Iterate x (dim, n) [any].
    real(sp), intent(inout) :: x(dim, n)
    real(sp) :: s
    integer :: i, j, m
    logical :: first
    first = .not. abs(c) > 0
    !$omp parallel do default(none) shared(dim, n, inverse, c, d, r, p, x, first) private(j, m, s) schedule(static)
    do i = 1, n
      do j = 1, dim
        s = 0
        do m = 1, dim
          s = s + inverse(j, m, i)*r(m, i)
        end do
        s = d*s
        if (.not. first) s = c*p(j, i) + s
        p(j, i) = s
        x(j, i) = x(j, i) + s
      end do
    end do
    !$omp end parallel do
  end subroutine smoothing_step
end module dotyk_linalg_block_products
