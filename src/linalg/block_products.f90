!> Products of sparse matrices of 2x2 or 3x3 blocks: the loops of `dotyk_linalg_block_rows` on plain arrays.
!>
!> Rows are independent and each is summed in the order of its blocks, so that results have the same digits on any
!> number of threads. Entry (i, j) of a block is at i + dim (j - 1). The matrix is read once; vectors come from the
!> caches where rows are numbered along a space-filling curve. The loops are in block_products.c; they read beyond the
!> last block, for which matrices have one block more. An entry is high + low: `leading` and `trailing` have the upper
!> and lower 16 bits of high, a number in single precision. The leading bits alone are the entry to 2^-7 of it.
module dotyk_linalg_block_products
  use, intrinsic :: iso_c_binding, only: c_double, c_float, c_int16_t, c_int32_t, c_int64_t
  use dotyk_base_kinds, only: sp
  implicit none
  private
  public :: product_rows, residual_rows, subtract_product_rows, smooth_rows, smoothing_step, limit_vectors

  interface
    !> y = (high + low) x.
    subroutine product_rows(dim, n, start, column, leading, trailing, low, x, y) bind(c, name='dotyk_product_rows')
      import :: c_double, c_float, c_int16_t, c_int32_t, c_int64_t
      integer(c_int32_t), value :: dim  !! Order of the blocks, 2 or 3.
      integer(c_int32_t), value :: n  !! Number of block rows.
      integer(c_int64_t), intent(in) :: start(*)  !! First block of each row (n + 1).
      integer(c_int32_t), intent(in) :: column(*)  !! Block column of each block (n_blocks).
      integer(c_int16_t), intent(in) :: leading(*)  !! Upper halves of the entries (dim*dim*(n_blocks + 1)) [any].
      integer(c_int16_t), intent(in) :: trailing(*)  !! Lower halves of the entries (dim*dim*(n_blocks + 1)) [any].
      real(c_float), intent(in) :: low(*)  !! Remainders of the entries (dim*dim*(n_blocks + 1)) [any].
      real(c_double), intent(in) :: x(*)  !! Vector x (dim*n) [any].
      real(c_double), intent(inout) :: y(*)  !! Product y (dim*n) [matrix times x].
    end subroutine product_rows

    !> r = b - high x in single precision.
    subroutine residual_rows(dim, n, start, column, leading, trailing, whole, b, x, r) &
      bind(c, name='dotyk_residual_rows')
      import :: c_float, c_int16_t, c_int32_t, c_int64_t
      integer(c_int32_t), value :: dim, n  !! As in `product_rows`.
      integer(c_int64_t), intent(in) :: start(*)  !! As in `product_rows`.
      integer(c_int32_t), intent(in) :: column(*)  !! As in `product_rows`.
      integer(c_int16_t), intent(in) :: leading(*), trailing(*)  !! As in `product_rows`.
      integer(c_int32_t), value :: whole  !! 0: with the upper halves of high alone.
      real(c_float), intent(in) :: b(*)  !! Right-hand side b (dim*n) [matrix times x].
      real(c_float), intent(in) :: x(*)  !! Vector x (dim*n) [any].
      real(c_float), intent(inout) :: r(*)  !! Residual r (dim*n) [as b].
    end subroutine residual_rows

    !> r := r - high x with a vector x in double precision: the product is small where x is large and smooth.
    subroutine subtract_product_rows(dim, n, start, column, leading, trailing, x, r) &
      bind(c, name='dotyk_subtract_product_rows')
      import :: c_double, c_float, c_int16_t, c_int32_t, c_int64_t
      integer(c_int32_t), value :: dim, n  !! As in `product_rows`.
      integer(c_int64_t), intent(in) :: start(*)  !! As in `product_rows`.
      integer(c_int32_t), intent(in) :: column(*)  !! As in `product_rows`.
      integer(c_int16_t), intent(in) :: leading(*), trailing(*)  !! As in `product_rows`.
      real(c_double), intent(in) :: x(*)  !! Vector x (dim*n) [any].
      real(c_float), intent(inout) :: r(*)  !! Residual r (dim*n) [matrix times x].
    end subroutine subtract_product_rows

    !> A step of a polynomial smoother: p := c p + d D^{-1} (b - A x), next = x + p, with the upper halves of high as A.
    subroutine smooth_rows(dim, n, start, column, leading, inverse, c, d, b, x, p, next) &
      bind(c, name='dotyk_smooth_rows')
      import :: c_float, c_int16_t, c_int32_t, c_int64_t
      integer(c_int32_t), value :: dim, n  !! As in `product_rows`.
      integer(c_int64_t), intent(in) :: start(*)  !! As in `product_rows`.
      integer(c_int32_t), intent(in) :: column(*)  !! As in `product_rows`.
      integer(c_int16_t), intent(in) :: leading(*)  !! As in `product_rows`.
      real(c_float), intent(in) :: inverse(*)  !! Inverse diagonal blocks D^{-1} (dim*dim*n) [1/matrix].
      real(c_float), value :: c, d  !! Factors c and d [].
      real(c_float), intent(in) :: b(*)  !! Right-hand side b (dim*n) [matrix times x].
      real(c_float), intent(in) :: x(*)  !! Vector x (dim*n) [any].
      real(c_float), intent(inout) :: p(*)  !! Step p (dim*n) [as x].
      real(c_float), intent(inout) :: next(*)  !! Next iterate (dim*n) [as x].
    end subroutine smooth_rows

    !> Do without wide vectors, for tests: digits are the same.
    subroutine limit_vectors(limit) bind(c, name='dotyk_limit_vectors')
      import :: c_int32_t
      integer(c_int32_t), value :: limit  !! 0: none; 1: AVX2 at most; 2: any.
    end subroutine limit_vectors
  end interface

contains

  !> A step of a polynomial smoother: p := c p + d D^{-1} r, x := x + p.
  subroutine smoothing_step(dim, n, inverse, c, d, r, p, x)
    integer, intent(in) :: dim  !! Order of the blocks, 2 or 3.
    integer, intent(in) :: n  !! Number of block rows.
    real(sp), intent(in) :: inverse(dim, dim, n)  !! Inverse diagonal blocks D^{-1} (dim, dim, n) [1/matrix].
    real(sp), intent(in) :: c  !! Factor c; with 0, p need not be defined [].
    real(sp), intent(in) :: d  !! Factor d [].
    real(sp), intent(in) :: r(dim, n)  !! Residual r (dim, n) [matrix times x].
    real(sp), intent(inout) :: p(dim, n)  !! Step p (dim, n) [as x].
    real(sp), intent(inout) :: x(dim, n)  !! Iterate x (dim, n) [any].
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
