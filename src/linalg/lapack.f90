!> Interfaces of LAPACK, declared here and nowhere else. Names and arguments are those of LAPACK's manual pages.
module dotyk_linalg_lapack
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: dgelsy, dgesv, dgesvd, dlaic1, dpotrf, dstevx, dsyev

  interface
    !> Eigenvalues and eigenvectors of a symmetric matrix by the QR algorithm.
    subroutine dsyev(jobz, uplo, n, a, lda, w, work, lwork, info)
      import :: dp
      character(1), intent(in) :: jobz, uplo
      integer, intent(in) :: n, lda, lwork
      real(dp), intent(inout) :: a(lda, *)
      real(dp), intent(out) :: w(*), work(*)
      integer, intent(out) :: info
    end subroutine dsyev

    !> Singular value decomposition by the QR algorithm.
    subroutine dgesvd(jobu, jobvt, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info)
      import :: dp
      character(1), intent(in) :: jobu, jobvt
      integer, intent(in) :: m, n, lda, ldu, ldvt, lwork
      real(dp), intent(inout) :: a(lda, *)
      real(dp), intent(out) :: s(*), u(ldu, *), vt(ldvt, *), work(*)
      integer, intent(out) :: info
    end subroutine dgesvd

    !> Linear equations by LU factorization with partial pivoting.
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: dp
      integer, intent(in) :: n, nrhs, lda, ldb
      real(dp), intent(inout) :: a(lda, *), b(ldb, *)
      integer, intent(out) :: ipiv(*), info
    end subroutine dgesv

    !> Least squares of minimum norm by QR factorization with column pivoting.
    subroutine dgelsy(m, n, nrhs, a, lda, b, ldb, jpvt, rcond, rank, work, lwork, info)
      import :: dp
      integer, intent(in) :: m, n, nrhs, lda, ldb, lwork
      real(dp), intent(inout) :: a(lda, *), b(ldb, *)
      integer, intent(inout) :: jpvt(*)
      real(dp), intent(in) :: rcond
      integer, intent(out) :: rank, info
      real(dp), intent(out) :: work(*)
    end subroutine dgelsy

    !> Selected eigenvalues and eigenvectors of a symmetric tridiagonal matrix.
    subroutine dstevx(jobz, range, n, d, e, vl, vu, il, iu, abstol, m, w, z, ldz, work, iwork, ifail, info)
      import :: dp
      character(1), intent(in) :: jobz, range
      integer, intent(in) :: n, il, iu, ldz
      real(dp), intent(inout) :: d(*), e(*)
      real(dp), intent(in) :: vl, vu, abstol
      integer, intent(out) :: m, iwork(*), ifail(*), info
      real(dp), intent(out) :: w(*), z(ldz, *), work(*)
    end subroutine dstevx

    !> Cholesky factorization.
    subroutine dpotrf(uplo, n, a, lda, info)
      import :: dp
      character(1), intent(in) :: uplo
      integer, intent(in) :: n, lda
      real(dp), intent(inout) :: a(lda, *)
      integer, intent(out) :: info
    end subroutine dpotrf

    !> One step of incremental condition estimation.
    subroutine dlaic1(job, j, x, sest, w, gamma, sestpr, s, c)
      import :: dp
      integer, intent(in) :: job, j
      real(dp), intent(in) :: x(*), sest, w(*), gamma
      real(dp), intent(out) :: sestpr, s, c
    end subroutine dlaic1
  end interface
end module dotyk_linalg_lapack
