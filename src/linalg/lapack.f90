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
      !> Triangle 'L' or 'U'.
      character(1), intent(in) :: uplo
      !> Order, leading dimension.
      integer, intent(in) :: n, lda
      !> The matrix [any], then its factor (lda, n) [sqrt(A)].
      real(dp), intent(inout) :: a(lda, *)
      !> First column whose pivot is not positive; 0 if there is none.
      integer, intent(out) :: info
    end subroutine dpotrf

    !> Linear equations by LU factorization with partial pivoting.
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: dp
      !> Order, right-hand sides, leading dimensions.
      integer, intent(in) :: n, nrhs, lda, ldb
      !> The matrix, then its factors (lda, n) [any].
      real(dp), intent(inout) :: a(lda, *)
      !> Right-hand sides [any], then solutions (ldb, nrhs) [b/A].
      real(dp), intent(inout) :: b(ldb, *)
      !> Row exchanges (n); first pivot that is zero, or 0.
      integer, intent(out) :: ipiv(*), info
    end subroutine dgesv

    !> Least squares of minimum norm by QR factorization with column pivoting.
    subroutine dgelsy(m, n, nrhs, a, lda, b, ldb, jpvt, rcond, rank, work, lwork, info)
      import :: dp
      !> Rows, columns, right-hand sides, leading dimensions, length of `work`.
      integer, intent(in) :: m, n, nrhs, lda, ldb, lwork
      !> The matrix, then its factors (lda, n) [any].
      real(dp), intent(inout) :: a(lda, *)
      !> Right-hand sides [any], then solutions (ldb, nrhs) [b/A].
      real(dp), intent(inout) :: b(ldb, *)
      !> Columns to keep in front, then the order of the columns (n).
      integer, intent(inout) :: jpvt(*)
      !> Reciprocal of the greatest condition number of the part that counts [].
      real(dp), intent(in) :: rcond
      !> Order of that part; 0 for success.
      integer, intent(out) :: rank, info
      !> Workspace (lwork) [any].
      real(dp), intent(out) :: work(*)
    end subroutine dgelsy

    !> Eigenvalues and eigenvectors of a symmetric matrix by the QR algorithm.
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: dp
      !> 'V' for eigenvectors, 'N' for none; triangle 'L' or 'U'.
      character(1), intent(in) :: jobz, uplo
      !> Order, leading dimension, length of `work`.
      integer, intent(in) :: n, lda, lwork
      !> The matrix [any], then its eigenvectors (lda, n) [].
      real(dp), intent(inout) :: a(lda, *)
      !> Eigenvalues, ascending (n) [as `a`].
      real(dp), intent(out) :: w(*)
      !> Workspace (lwork) [any].
      real(dp), intent(out) :: work(*)
      !> 0 for success.
      integer, intent(out) :: info
    end subroutine dsyev

    !> Selected eigenvalues and eigenvectors of a symmetric tridiagonal matrix by bisection and inverse iteration.
    subroutine dstevx(jobz, range, n, d, e, vl, vu, il, iu, abstol, m, w, z, ldz, work, iwork, ifail, info)
      import :: dp
      !> 'V' for eigenvectors, 'N' for none; 'A' for all, 'V' for those in (vl, vu], 'I' for the il-th to the iu-th.
      character(1), intent(in) :: jobz, range
      !> Order.
      integer, intent(in) :: n
      !> First eigenvalue.
      integer, intent(in) :: il
      !> Last eigenvalue.
      integer, intent(in) :: iu
      !> Leading dimension.
      integer, intent(in) :: ldz
      !> Diagonal (n) [any].
      real(dp), intent(inout) :: d(*)
      !> Entries beside the diagonal (n-1) [as `d`].
      real(dp), intent(inout) :: e(*)
      !> Lower end of the interval [as `d`].
      real(dp), intent(in) :: vl
      !> Upper end of the interval [as `d`].
      real(dp), intent(in) :: vu
      !> Tolerance of the eigenvalues [as `d`].
      real(dp), intent(in) :: abstol
      !> Eigenvalues found.
      integer, intent(out) :: m
      !> Workspace (5 n).
      integer, intent(out) :: iwork(*)
      !> Eigenvectors that failed (n).
      integer, intent(out) :: ifail(*)
      !> 0 for success.
      integer, intent(out) :: info
      !> Eigenvalues, ascending (n) [as `d`].
      real(dp), intent(out) :: w(*)
      !> Eigenvectors (ldz, m) [].
      real(dp), intent(out) :: z(ldz, *)
      !> Workspace (5 n) [any].
      real(dp), intent(out) :: work(*)
    end subroutine dstevx

    !> Singular value decomposition by the QR algorithm.
    subroutine dgesvd(jobu, jobvt, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info)
      import :: dp
      !> 'A' for all singular vectors, 'N' for none.
      character(1), intent(in) :: jobu, jobvt
      !> Rows, columns, leading dimensions, length of `work`.
      integer, intent(in) :: m, n, lda, ldu, ldvt, lwork
      !> The matrix, destroyed (lda, n) [any].
      real(dp), intent(inout) :: a(lda, *)
      !> Singular values, falling (min(m, n)) [as `a`].
      real(dp), intent(out) :: s(*)
      !> Left singular vectors as columns (ldu, m) [].
      real(dp), intent(out) :: u(ldu, *)
      !> Right singular vectors as rows (ldvt, n) [].
      real(dp), intent(out) :: vt(ldvt, *)
      !> Workspace (lwork) [any].
      real(dp), intent(out) :: work(*)
      !> 0 for success.
      integer, intent(out) :: info
    end subroutine dgesvd

    !> One step of incremental condition estimation.
    subroutine dlaic1(job, j, x, sest, w, gamma, sestpr, s, c)
      import :: dp
      !> 1 for the largest, 2 for the smallest singular value; order of the triangle so far.
      integer, intent(in) :: job, j
      !> Approximate singular vector of the triangle so far (j) [].
      real(dp), intent(in) :: x(*)
      !> Estimate of its singular value [any].
      real(dp), intent(in) :: sest
      !> New row: entries before the diagonal (j) [as `sest`].
      real(dp), intent(in) :: w(*)
      !> New row: diagonal entry [as `sest`].
      real(dp), intent(in) :: gamma
      !> Estimate of the singular value of the larger triangle [as `sest`].
      real(dp), intent(out) :: sestpr
      !> Factor of x in the singular vector of the larger triangle [].
      real(dp), intent(out) :: s
      !> Last component of that vector [].
      real(dp), intent(out) :: c
    end subroutine dlaic1
  end interface
end module dotyk_linalg_lapack
