!> Products of dense matrices by BLAS, the threads of OpenBLAS, and LAPACK. They are declared here and nowhere else;
!> names and arguments are those of their manuals.
module dotyk_linalg_blas
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_int, c_null_char, c_ptr
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: reserve_blas, set_blas_threads, blas_threads, blas_name, transposed_product, dgemm, dgemv, dsyrk, dtpsv, &
    dtrsm, dtrsv, dgelsy, dgesv, dgesvd, dlaic1, dpotrf, dstevx, dsyev

  interface
    !> C <- alpha op(A) op(B) + beta C.
    subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: dp
      character(1), intent(in) :: transa, transb  !! op: 'N' none, 'T' transpose.
      integer, intent(in) :: m, n, k, lda, ldb, ldc  !! Rows of C, columns of C, columns of op(A); leading dimensions.
      real(dp), intent(in) :: alpha  !! Factor of the product [any].
      real(dp), intent(in) :: beta  !! Factor of the old C []; with 0 C is not read.
      real(dp), intent(in) :: a(lda, *)  !! A (lda, *) [any].
      real(dp), intent(in) :: b(ldb, *)  !! B (ldb, *) [any].
      real(dp), intent(inout) :: c(ldc, *)  !! C (ldc, n) [alpha A B].
    end subroutine dgemm

    !> y <- alpha op(A) x + beta y.
    subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
      import :: dp
      character(1), intent(in) :: trans  !! op: 'N' none, 'T' transpose.
      integer, intent(in) :: m, n, lda, incx, incy  !! Rows and columns of A, leading dimension, strides.
      real(dp), intent(in) :: alpha  !! Factor of the product [any].
      real(dp), intent(in) :: beta  !! Factor of the old y []; with 0 y is not read.
      real(dp), intent(in) :: a(lda, *)  !! A (lda, n) [any].
      real(dp), intent(in) :: x(*)  !! Vector x (*) [any].
      real(dp), intent(inout) :: y(*)  !! Vector y (*) [alpha A x].
    end subroutine dgemv

    !> Solve op(A) x = b with a triangular matrix.
    subroutine dtrsv(uplo, trans, diag, n, a, lda, x, incx)
      import :: dp
      character(1), intent(in) :: uplo, trans, diag  !! Triangle 'L' or 'U'; op 'N' or 'T'; diagonal 'N' or unit 'U'.
      integer, intent(in) :: n, lda, incx  !! Order, leading dimension, stride.
      real(dp), intent(in) :: a(lda, *)  !! A (lda, n) [any].
      real(dp), intent(inout) :: x(*)  !! b [any], then x (*) [b/A].
    end subroutine dtrsv

    !> C <- alpha A A^T + beta C or alpha A^T A + beta C, one triangle.
    subroutine dsyrk(uplo, trans, n, k, alpha, a, lda, beta, c, ldc)
      import :: dp
      character(1), intent(in) :: uplo, trans  !! Triangle 'L' or 'U'; 'N' for A A^T, 'T' for A^T A.
      integer, intent(in) :: n, k, lda, ldc  !! Order of C, terms of the sums, leading dimensions.
      real(dp), intent(in) :: alpha  !! Factor of the product [any].
      real(dp), intent(in) :: beta  !! Factor of the old C []; with 0 C is not read.
      real(dp), intent(in) :: a(lda, *)  !! A (lda, *) [any].
      real(dp), intent(inout) :: c(ldc, *)  !! C (ldc, n) [alpha A^2].
    end subroutine dsyrk

    !> Solve op(A) X = alpha B or X op(A) = alpha B with a triangular matrix.
    subroutine dtrsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
      import :: dp
      !> Side 'L' or 'R' of A; triangle 'L' or 'U'; op 'N' or 'T'; diagonal 'N' or unit 'U'.
      character(1), intent(in) :: side, uplo, transa, diag
      integer, intent(in) :: m, n, lda, ldb  !! Rows and columns of B, leading dimensions.
      real(dp), intent(in) :: alpha  !! Factor of B [any].
      real(dp), intent(in) :: a(lda, *)  !! A (lda, *) [any].
      real(dp), intent(inout) :: b(ldb, *)  !! B [any], then X (ldb, n) [alpha B/A].
    end subroutine dtrsm

    !> Solve op(A) x = b with a packed triangular matrix.
    subroutine dtpsv(uplo, trans, diag, n, ap, x, incx)
      import :: dp
      character(1), intent(in) :: uplo, trans, diag  !! Triangle 'L' or 'U'; op 'N' or 'T'; diagonal 'N' or unit 'U'.
      integer, intent(in) :: n, incx  !! Order and stride.
      real(dp), intent(in) :: ap(*)  !! The triangle, column by column (n*(n+1)/2) [any].
      real(dp), intent(inout) :: x(*)  !! b [any], then x [b/A].
    end subroutine dtpsv

    !> Allocate OpenBLAS's buffers for n concurrent calls, see blas_memory.c.
    subroutine c_reserve_blas(n) bind(c, name='dotyk_reserve_blas')
      import :: c_int
      integer(c_int), value :: n  !! Number of concurrent calls.
    end subroutine c_reserve_blas

    !> Set the number of threads of all later calls.
    subroutine openblas_set_num_threads(n) bind(c, name='openblas_set_num_threads')
      import :: c_int
      integer(c_int), value :: n  !! Number of threads.
    end subroutine openblas_set_num_threads

    !> Number of threads of a call.
    integer(c_int) function openblas_get_num_threads() bind(c, name='openblas_get_num_threads')
      import :: c_int
    end function openblas_get_num_threads

    !> Name, version and options of the library.
    type(c_ptr) function openblas_get_config() bind(c, name='openblas_get_config')
      import :: c_ptr
    end function openblas_get_config

    !> Processor that the kernels are made for.
    type(c_ptr) function openblas_get_corename() bind(c, name='openblas_get_corename')
      import :: c_ptr
    end function openblas_get_corename
  end interface

  interface
    !> Cholesky factorization.
    subroutine dpotrf(uplo, n, a, lda, info)
      import :: dp
      character(1), intent(in) :: uplo  !! Triangle 'L' or 'U'.
      integer, intent(in) :: n, lda  !! Order, leading dimension.
      real(dp), intent(inout) :: a(lda, *)  !! The matrix [any], then its factor (lda, n) [sqrt(A)].
      integer, intent(out) :: info  !! First column whose pivot is not positive; 0 if there is none.
    end subroutine dpotrf

    !> Linear equations by LU factorization with partial pivoting.
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: dp
      integer, intent(in) :: n, nrhs, lda, ldb  !! Order, right-hand sides, leading dimensions.
      real(dp), intent(inout) :: a(lda, *)  !! The matrix, then its factors (lda, n) [any].
      real(dp), intent(inout) :: b(ldb, *)  !! Right-hand sides [any], then solutions (ldb, nrhs) [b/A].
      integer, intent(out) :: ipiv(*), info  !! Row exchanges (n); first pivot that is zero, or 0.
    end subroutine dgesv

    !> Least squares of minimum norm by QR factorization with column pivoting.
    subroutine dgelsy(m, n, nrhs, a, lda, b, ldb, jpvt, rcond, rank, work, lwork, info)
      import :: dp
      integer, intent(in) :: m, n, nrhs, lda, ldb, lwork  !! Rows, columns, sides, leading dimensions, length of `work`.
      real(dp), intent(inout) :: a(lda, *)  !! The matrix, then its factors (lda, n) [any].
      real(dp), intent(inout) :: b(ldb, *)  !! Right-hand sides [any], then solutions (ldb, nrhs) [b/A].
      integer, intent(inout) :: jpvt(*)  !! Columns to keep in front, then the order of the columns (n).
      real(dp), intent(in) :: rcond  !! Reciprocal of the greatest condition number of the part that counts [].
      integer, intent(out) :: rank, info  !! Order of that part; 0 for success.
      real(dp), intent(out) :: work(*)  !! Workspace (lwork) [any].
    end subroutine dgelsy

    !> Eigenvalues and eigenvectors of a symmetric matrix by the QR algorithm.
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: dp
      character(1), intent(in) :: jobz, uplo  !! 'V' for eigenvectors, 'N' for none; triangle 'L' or 'U'.
      integer, intent(in) :: n, lda, lwork  !! Order, leading dimension, length of `work`.
      real(dp), intent(inout) :: a(lda, *)  !! The matrix [any], then its eigenvectors (lda, n) [].
      real(dp), intent(out) :: w(*)  !! Eigenvalues, ascending (n) [as `a`].
      real(dp), intent(out) :: work(*)  !! Workspace (lwork) [any].
      integer, intent(out) :: info  !! 0 for success.
    end subroutine dsyev

    !> Selected eigenvalues and eigenvectors of a symmetric tridiagonal matrix by bisection and inverse iteration.
    subroutine dstevx(jobz, range, n, d, e, vl, vu, il, iu, abstol, m, w, z, ldz, work, iwork, ifail, info)
      import :: dp
      !> 'V' for eigenvectors, 'N' for none; 'A' for all, 'V' for those in (vl, vu], 'I' for the il-th to the iu-th.
      character(1), intent(in) :: jobz, range
      integer, intent(in) :: n  !! Order.
      integer, intent(in) :: il  !! First eigenvalue.
      integer, intent(in) :: iu  !! Last eigenvalue.
      integer, intent(in) :: ldz  !! Leading dimension.
      real(dp), intent(inout) :: d(*)  !! Diagonal (n) [any].
      real(dp), intent(inout) :: e(*)  !! Entries beside the diagonal (n-1) [as `d`].
      real(dp), intent(in) :: vl  !! Lower end of the interval [as `d`].
      real(dp), intent(in) :: vu  !! Upper end of the interval [as `d`].
      real(dp), intent(in) :: abstol  !! Tolerance of the eigenvalues [as `d`].
      integer, intent(out) :: m  !! Eigenvalues found.
      integer, intent(out) :: iwork(*)  !! Workspace (5 n).
      integer, intent(out) :: ifail(*)  !! Eigenvectors that failed (n).
      integer, intent(out) :: info  !! 0 for success.
      real(dp), intent(out) :: w(*)  !! Eigenvalues, ascending (n) [as `d`].
      real(dp), intent(out) :: z(ldz, *)  !! Eigenvectors (ldz, m) [].
      real(dp), intent(out) :: work(*)  !! Workspace (5 n) [any].
    end subroutine dstevx

    !> Singular value decomposition by the QR algorithm.
    subroutine dgesvd(jobu, jobvt, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info)
      import :: dp
      character(1), intent(in) :: jobu, jobvt  !! 'A' for all singular vectors, 'N' for none.
      integer, intent(in) :: m, n, lda, ldu, ldvt, lwork  !! Rows, columns, leading dimensions, length of `work`.
      real(dp), intent(inout) :: a(lda, *)  !! The matrix, destroyed (lda, n) [any].
      real(dp), intent(out) :: s(*)  !! Singular values, falling (min(m, n)) [as `a`].
      real(dp), intent(out) :: u(ldu, *)  !! Left singular vectors as columns (ldu, m) [].
      real(dp), intent(out) :: vt(ldvt, *)  !! Right singular vectors as rows (ldvt, n) [].
      real(dp), intent(out) :: work(*)  !! Workspace (lwork) [any].
      integer, intent(out) :: info  !! 0 for success.
    end subroutine dgesvd

    !> One step of incremental condition estimation.
    subroutine dlaic1(job, j, x, sest, w, gamma, sestpr, s, c)
      import :: dp
      integer, intent(in) :: job, j  !! 1: largest, 2: smallest singular value; order of the triangle so far.
      real(dp), intent(in) :: x(*)  !! Approximate singular vector of the triangle so far (j) [].
      real(dp), intent(in) :: sest  !! Estimate of its singular value [any].
      real(dp), intent(in) :: w(*)  !! New row: entries before the diagonal (j) [as `sest`].
      real(dp), intent(in) :: gamma  !! New row: diagonal entry [as `sest`].
      real(dp), intent(out) :: sestpr  !! Estimate of the singular value of the larger triangle [as `sest`].
      real(dp), intent(out) :: s  !! Factor of x in the singular vector of the larger triangle [].
      real(dp), intent(out) :: c  !! Last component of that vector [].
    end subroutine dlaic1
  end interface

contains

  !> Allocate OpenBLAS's buffers for concurrent calls. Without memory for a buffer later, OpenBLAS retries for ever.
  subroutine reserve_blas(n)
    integer, intent(in) :: n  !! Number of concurrent calls.
    call c_reserve_blas(int(n, c_int))
  end subroutine reserve_blas

  !> C = A^T B.
  subroutine transposed_product(a, b, c)
    real(dp), intent(in), contiguous :: a(:, :)  !! A (n, r) [any].
    real(dp), intent(in), contiguous :: b(:, :)  !! B (n, m) [any].
    real(dp), intent(out), contiguous :: c(:, :)  !! C (r, m) [A B].
    c = 0
    if (size(a) == 0 .or. size(b) == 0) return
    call dgemm('T', 'N', size(a, 2), size(b, 2), size(a, 1), 1.0_dp, a, size(a, 1), b, size(b, 1), 0.0_dp, &
               c, size(c, 1))
  end subroutine transposed_product

  !> Set the number of threads of all BLAS calls of the process. Not inside parallel regions.
  subroutine set_blas_threads(n)
    integer, intent(in) :: n  !! Number of threads, at least 1.
    call openblas_set_num_threads(int(max(1, n), c_int))
  end subroutine set_blas_threads

  !> Number of threads of a BLAS call.
  integer function blas_threads()
    blas_threads = int(openblas_get_num_threads())
  end function blas_threads

  !> Name, version and options of the BLAS library, and the processor that its kernels are made for.
  function blas_name() result(name)
    character(:), allocatable :: name
    name = text_of_c(openblas_get_config())//' ['//text_of_c(openblas_get_corename())//']'
  end function blas_name

  !> A C string as text.
  function text_of_c(string) result(text)
    type(c_ptr), intent(in) :: string  !! Ends with a null character.
    character(:), allocatable :: text
    ! OpenBLAS's texts have about 100 letters.
    integer, parameter :: most = 256
    character(kind=c_char), pointer :: letter(:)
    integer :: i
    text = ''
    if (.not. c_associated(string)) return
    call c_f_pointer(string, letter, [most])
    do i = 1, most
      if (letter(i) == c_null_char) exit
      text = text//letter(i)
    end do
    text = trim(text)
  end function text_of_c

end module dotyk_linalg_blas
