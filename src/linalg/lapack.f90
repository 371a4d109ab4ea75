!> Interfaces of LAPACK, declared here and nowhere else. Names and arguments are those of LAPACK's manual pages.
module dotyk_linalg_lapack
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: dgelsy, dgesv, dgesvd, dlaic1, dpotrf, dstevx, dsyev

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
end module dotyk_linalg_lapack
