!> Small dense problems, by LAPACK: eigenvalues, singular values, least squares, orthonormal bases, generalized
!> inverses.
!>
!> Small least-squares problems by their normal equations, for many matrices A of which only G = A^T A is formed.
!>
!> The rank is that of a QR factorization with column pivoting and incremental condition estimation, as in LAPACK's
!> dgelsy: R of a pivoted Cholesky factorization of A^T A is R of that of A. The smallest entries of R have errors of
!> sqrt(epsilon), so condition numbers are told up to about 1e6. Solutions have errors of epsilon times the square of
!> the condition number; where that matters, add a step of refinement. Faster than dgelsy for the thousands of small
!> fits of an error estimate.
module dotyk_linalg_dense
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: half_digits, rounding
  use dotyk_linalg_blas, only: dgelsy, dgesv, dgesvd, dlaic1, dpotrf, dstevx, dsyev, dtrsm
  implicit none
  private
  public :: symmetric_eigen, right_singular_vectors, solve_dense, least_squares, orthonormal_range, &
    largest_tridiagonal_eigenpair, cholesky_factor, solve_triangular, find_inverse_root, factorize_gram, solve_gram

  !> Work space that LAPACK asks for, per row of a matrix: its largest block of columns, 32 for the tridiagonal form and
  !> 64 for the QR factorization, and two or more vectors.
  integer, parameter :: work_of_dsyev = 34, work_of_dgelsy = 64

contains

  !> Eigenvalues and eigenvectors of a symmetric matrix.
  subroutine symmetric_eigen(a, values, vectors, error)
    real(dp), intent(in) :: a(:, :)  !! The matrix (n, n) [any]; its lower triangle is read.
    real(dp), intent(out) :: values(:)  !! Eigenvalues, ascending (n) [as `a`].
    real(dp), intent(out) :: vectors(:, :)  !! Orthonormal eigenvectors as columns (n, n) [].
    type(error_t), allocatable, intent(out) :: error  !! Not finite, or LAPACK's iteration has not converged.
    real(dp), allocatable :: v(:, :), w(:), work(:)
    integer :: n, info
    n = size(a, 1)
    if (n == 0) return
    allocate (v(n, n), w(n), work(max(1, work_of_dsyev*n)))
    v(:, :) = a
    info = 1
    ! LAPACK may iterate for ever on a matrix with a NaN or an infinity.
    if (all(abs(a) <= huge(1.0_dp))) call dsyev('V', 'L', n, v, n, w, work, size(work), info)
    if (info /= 0) then
      call set_error(error, 'the eigenvalues of a matrix of order '//to_text(n)//' cannot be computed', &
                     exit_not_solvable)
      return
    end if
    values(:) = w
    vectors(:, :) = v
  end subroutine symmetric_eigen

  !> Cholesky factor of a positive semidefinite matrix, shifted by as little of its largest diagonal entry as LAPACK
  !> needs: a multiple of the rounding of the entries.
  subroutine cholesky_factor(a, factor, error)
    real(dp), intent(in) :: a(:, :)  !! The matrix (n, n) [any]; its lower triangle is read.
    real(dp), allocatable, intent(out) :: factor(:, :)  !! L with A = L L^T, zero above the diagonal (n, n) [sqrt(A)].
    type(error_t), allocatable, intent(out) :: error  !! It is not positive semidefinite, or an entry not finite.
    real(dp) :: shift, largest
    integer :: i, n, failed
    n = size(a, 1)
    allocate (factor(n, n))
    if (n == 0) return
    largest = maxval([(a(i, i), i=1, n)])
    shift = n*epsilon(shift)
    failed = 1
    do while (shift < half_digits .and. failed /= 0)
      factor = a
      do i = 1, n
        factor(i, i) = factor(i, i) + shift*largest
        factor(:i - 1, i) = 0
      end do
      failed = 1
      if (all(abs(factor) <= huge(1.0_dp))) call dpotrf('L', n, factor, n, failed)
      shift = 10*shift
    end do
    if (failed == 0) return
    ! Called in threads, too.
    !$omp critical (message)
    call set_error(error, 'a matrix of order '//to_text(n)//' is not positive semidefinite', exit_not_solvable)
    !$omp end critical (message)
  end subroutine cholesky_factor

  !> B <- L^{-1} B.
  subroutine solve_triangular(l, b)
    real(dp), intent(in), contiguous :: l(:, :)  !! Lower triangular L (n, n) [any].
    real(dp), intent(inout), contiguous :: b(:, :)  !! B, then the solution (n, m) [any, then B/L].
    if (size(b) == 0) return
    call dtrsm('L', 'L', 'N', 'N', size(b, 1), size(b, 2), 1.0_dp, l, size(l, 1), b, size(b, 1))
  end subroutine solve_triangular

  !> Singular values and right singular vectors of a matrix with few columns, which give its null space to full
  !> accuracy.
  subroutine right_singular_vectors(a, values, vectors, error)
    real(dp), intent(in) :: a(:, :)  !! The matrix (m, n) [any]; m may be 0.
    real(dp), intent(out) :: values(:)  !! Singular values, descending; zero from the (m+1)-th on (n) [as `a`].
    real(dp), intent(out) :: vectors(:, :)  !! Orthonormal right singular vectors as columns (n, n) [].
    type(error_t), allocatable, intent(out) :: error  !! Not finite, or LAPACK's iteration has not converged.
    real(dp), allocatable :: b(:, :), s(:), vt(:, :), work(:)
    real(dp) :: none(1, 1)
    integer :: n, m, j, info
    n = size(a, 2)
    values = 0
    vectors = 0
    do j = 1, n
      vectors(j, j) = 1
    end do
    if (n == 0 .or. size(a, 1) == 0) return
    ! With rows of zeros appended LAPACK returns all n values.
    m = max(n, size(a, 1))
    allocate (b(m, n), source=0.0_dp)
    b(:size(a, 1), :) = a
    allocate (s(n), vt(n, n), work(max(3*n + m, 5*n)))
    info = 1
    if (all(abs(a) <= huge(1.0_dp))) call dgesvd('N', 'A', m, n, b, m, s, none, 1, vt, n, work, size(work), info)
    if (info /= 0) then
      call set_error(error, 'the singular values of a matrix with '//to_text(n)//' columns cannot be computed', &
                     exit_not_solvable)
      return
    end if
    values(:) = s
    vectors(:, :) = transpose(vt)
  end subroutine right_singular_vectors

  !> Solve A X = B, in place.
  subroutine solve_dense(a, x, error)
    real(dp), intent(in) :: a(:, :)  !! The matrix A (n, n) [any].
    real(dp), intent(inout) :: x(:, :)  !! Right-hand sides B [any], then solutions X (n, m) [B/A].
    type(error_t), allocatable, intent(out) :: error  !! A pivot is exactly zero: the matrix is singular.
    real(dp), allocatable :: lu(:, :), b(:, :)
    integer, allocatable :: pivot(:)
    integer :: n, info
    n = size(a, 1)
    if (n == 0) return
    allocate (lu(n, n), b(n, size(x, 2)), pivot(n))
    lu(:, :) = a
    b(:, :) = x
    call dgesv(n, size(b, 2), lu, n, pivot, b, n, info)
    if (info /= 0) then
      call set_error(error, 'a matrix of order '//to_text(n)//' is singular', exit_not_solvable)
      return
    end if
    x(:, :) = b
  end subroutine solve_dense

  !> Least squares: the X of minimum norm that minimizes the norm of A X - B, in place.
  subroutine least_squares(a, b, tolerance, rank, error)
    real(dp), intent(in) :: a(:, :)  !! The matrix A (m, n) [any].
    !> Right-hand sides B [any] in the first m rows, then solutions X [B/A] in the first n rows (at least max(m, n), k).
    real(dp), intent(inout) :: b(:, :)
    !> Reciprocal of the greatest condition number of the part of A that counts []; the rest is taken for zero.
    real(dp), intent(in) :: tolerance
    integer, intent(out) :: rank  !! Rank of A to that tolerance.
    type(error_t), allocatable, intent(out) :: error  !! An entry of A is not finite.
    real(dp), allocatable :: qr(:, :), x(:, :), work(:)
    integer, allocatable :: pivot(:)
    integer :: m, n, k, info
    m = size(a, 1)
    n = size(a, 2)
    k = size(b, 2)
    rank = 0
    allocate (qr(m, n), x(max(m, n), k), pivot(n), work(max(4*n + work_of_dgelsy*(n + 1), 2*n + work_of_dgelsy*k)))
    qr(:, :) = a
    x = 0
    x(:m, :) = b(:m, :)
    pivot = 0
    info = 1
    if (all(abs(a) <= huge(1.0_dp))) then
      call dgelsy(m, n, k, qr, m, x, max(m, n), pivot, tolerance, rank, work, size(work), info)
    end if
    if (info /= 0) then
      call set_error(error, 'least squares with '//to_text(n)//' unknowns cannot be computed', exit_not_solvable)
      return
    end if
    b(:n, :) = x(:n, :)
  end subroutine least_squares

  !> Orthonormal basis of the range of A by modified Gram-Schmidt with reorthogonalization. Columns are taken in their
  !> order: the first keeps its direction, and a column that is nearly in the span of its predecessors adds nothing.
  pure subroutine orthonormal_range(a, tolerance, q, rank)
    real(dp), intent(in) :: a(:, :)  !! A (n, m) [any].
    !> A column counts if its component normal to its predecessors exceeds this fraction of its norm [].
    real(dp), intent(in) :: tolerance
    real(dp), intent(out) :: q(:, :)  !! Basis as columns (n, at least min(n, m)) []; columns beyond `rank` are zero.
    integer, intent(out) :: rank  !! Number of columns of the basis.
    real(dp) :: v(size(a, 1)), length, remainder
    integer :: j, k, pass
    q = 0
    rank = 0
    do j = 1, size(a, 2)
      if (rank == min(size(a, 1), size(q, 2))) exit
      length = norm2(a(:, j))
      if (.not. length > 0) cycle
      v = a(:, j)/length
      do pass = 1, 2
        do k = 1, rank
          v = v - dot_product(q(:, k), v)*q(:, k)
        end do
      end do
      remainder = norm2(v)
      if (remainder <= tolerance) cycle
      rank = rank + 1
      ! Once more after scaling: cancellation has magnified the loss of orthogonality of a nearly dependent column.
      v = v/remainder
      do k = 1, rank - 1
        v = v - dot_product(q(:, k), v)*q(:, k)
      end do
      q(:, rank) = v/norm2(v)
    end do
  end subroutine orthonormal_range

  !> Largest eigenvalue of a symmetric tridiagonal matrix and its eigenvector.
  subroutine largest_tridiagonal_eigenpair(diagonal, off_diagonal, value, vector)
    real(dp), intent(in) :: diagonal(:)  !! Diagonal (n) [any].
    real(dp), intent(in) :: off_diagonal(:)  !! Entries beside the diagonal (at least n-1) [as `diagonal`].
    real(dp), intent(out) :: value  !! Largest eigenvalue [as `diagonal`].
    real(dp), intent(out) :: vector(:)  !! Its eigenvector of norm 1 (n) [].
    real(dp), allocatable :: d(:), e(:), w(:), z(:, :), work(:)
    integer, allocatable :: iwork(:), ifail(:)
    real(dp) :: scale
    integer :: n, found, info
    n = size(diagonal)
    value = diagonal(1)
    vector = 1
    if (n == 1) return
    allocate (d(n), e(n), w(n), z(n, 1), work(5*n), iwork(5*n), ifail(n))
    d(:) = diagonal
    e(:) = 0
    e(:n - 1) = off_diagonal(:n - 1)
    scale = max(maxval(abs(d)), maxval(abs(e)))
    if (scale > 0) then
      d(:) = d/scale
      e(:) = e/scale
    end if
    call dstevx('V', 'I', n, d, e, 0.0_dp, 0.0_dp, n, n, 0.0_dp, found, w, z, n, work, iwork, ifail, info)
    if (info == 0 .and. found == 1) then
      value = w(1)*scale
      vector = z(:, 1)
    else
      ! Inverse iteration failed: Gershgorin's bound, and a vector whose residual promises nothing.
      value = maxval(diagonal + abs(e)*scale + abs(eoshift(e, -1))*scale)
      vector = 1
    end if
  end subroutine largest_tridiagonal_eigenpair

  !> Root and null space. Without a reference A is regular and is factorized by elimination, which keeps directions of
  !> very different stiffness apart that an eigendecomposition would mix by rounding.
  subroutine find_inverse_root(a, reference, root, null_space, failed)
    real(dp), intent(in) :: a(:, :)  !! Lower triangle of A (n, n) [any].
    real(dp), intent(in) :: reference  !! Magnitude that eigenvalues of A are compared with [as `a`]; 0: A is regular.
    real(dp), allocatable, intent(out) :: root(:, :)  !! R (n, n) [1/sqrt(A)].
    real(dp), allocatable, intent(out) :: null_space(:, :)  !! Orthonormal null directions as columns (n, n_null) [].
    integer, intent(out) :: failed  !! 0, or 1 where A is not finite or the eigenvalues cannot be found.
    type(error_t), allocatable :: error
    real(dp) :: full(size(a, 1), size(a, 1)), values(size(a, 1))
    integer :: i, n
    n = size(a, 1)
    do i = 1, n
      full(i:, i) = a(i:, i)
      full(i, i:) = a(i:, i)
    end do
    allocate (root(n, n), null_space(n, 0))
    failed = 1
    if (.not. all(ieee_is_finite(full))) return
    if (.not. reference > 0) then
      call invert_by_elimination(full, root, failed)
      if (failed == 0) return
    end if
    call symmetric_eigen(full, values, root, error)
    if (allocated(error)) return
    failed = 0
    associate (is_null => .not. (values > rounding*reference .and. values > tiny(1.0_dp)))
      null_space = root(:, pack([(i, i=1, n)], is_null))
      do i = 1, n
        if (is_null(i)) then
          root(:, i) = 0
        else
          root(:, i) = root(:, i)/sqrt(values(i))
        end if
      end do
    end associate
  end subroutine find_inverse_root

  !> The root of the inverse of a positive definite matrix, `L^{-T}`.
  subroutine invert_by_elimination(a, root, failed)
    real(dp), intent(in) :: a(:, :)  !! Lower triangle of A (n, n) [any].
    real(dp), intent(out) :: root(:, :)  !! Root of the inverse (n, n) [1/sqrt(A)].
    integer, intent(out) :: failed  !! 0 if A is positive definite.
    real(dp) :: factor(size(a, 1), size(a, 1))
    integer :: i, n
    n = size(a, 1)
    factor = a
    call dpotrf('L', n, factor, n, failed)
    if (failed /= 0) return
    root = 0
    do i = 1, n
      root(i, i) = 1
    end do
    call dtrsm('L', 'L', 'T', 'N', n, n, 1.0_dp, factor, n, root, n)
  end subroutine invert_by_elimination

  !> Pivoted Cholesky factorization R^T R = P^T G P, up to the numerical rank.
  subroutine factorize_gram(n, gram, tolerance, r, pivot, rank)
    integer, intent(in) :: n  !! Order.
    real(dp), intent(in) :: gram(n, n)  !! G = A^T A (n, n) [any]; its lower triangle is read.
    !> Reciprocal of the greatest condition number of the part of A that counts []; the rest is taken for zero.
    real(dp), intent(in) :: tolerance
    real(dp), intent(out) :: r(n, n)  !! R^T in the lower triangle of the first `rank` columns (n, n) [sqrt(G)].
    integer, intent(out) :: pivot(n)  !! Column of A that is eliminated k-th (n).
    integer, intent(out) :: rank  !! Rank of A to that tolerance.
    real(dp) :: smallest_vector(n), largest_vector(n), row(n), smallest, largest, smaller, larger, s(2), c(2)
    integer :: i, j, k
    r = gram
    pivot = [(i, i=1, n)]
    rank = 0
    do i = 1, n
      k = i
      do j = i + 1, n
        if (r(j, j) > r(k, k)) k = j
      end do
      if (.not. r(k, k) > 0) return
      if (k > i) call swap(i, k)
      r(i, i) = sqrt(r(i, i))
      row(:i) = r(i, :i)
      if (i == 1) then
        smallest = r(1, 1)
        largest = smallest
        smallest_vector(1) = 1
        largest_vector(1) = 1
      else
        call dlaic1(2, rank, smallest_vector, smallest, row, r(i, i), smaller, s(1), c(1))
        call dlaic1(1, rank, largest_vector, largest, row, r(i, i), larger, s(2), c(2))
        if (larger*tolerance > smaller) return
        smallest_vector(:rank) = s(1)*smallest_vector(:rank)
        largest_vector(:rank) = s(2)*largest_vector(:rank)
        smallest_vector(i) = c(1)
        largest_vector(i) = c(2)
        smallest = smaller
        largest = larger
      end if
      rank = i
      r(i + 1:, i) = r(i + 1:, i)/r(i, i)
      do j = i + 1, n
        r(j:, j) = r(j:, j) - r(j, i)*r(j:, i)
      end do
    end do

  contains

    !> Exchange two rows and columns of the lower triangle.
    subroutine swap(a, b)
      integer, intent(in) :: a  !! The one, smaller.
      integer, intent(in) :: b  !! The other.
      real(dp) :: line(n), value
      line(:a - 1) = r(a, :a - 1)
      r(a, :a - 1) = r(b, :a - 1)
      r(b, :a - 1) = line(:a - 1)
      value = r(a, a)
      r(a, a) = r(b, b)
      r(b, b) = value
      line(a + 1:b - 1) = r(a + 1:b - 1, a)
      r(a + 1:b - 1, a) = r(b, a + 1:b - 1)
      r(b, a + 1:b - 1) = line(a + 1:b - 1)
      line(b + 1:) = r(b + 1:, a)
      r(b + 1:, a) = r(b + 1:, b)
      r(b + 1:, b) = line(b + 1:)
      pivot([a, b]) = pivot([b, a])
    end subroutine swap
  end subroutine factorize_gram

  !> Solve G x = b with a factor of full rank.
  subroutine solve_gram(n, m, r, pivot, b)
    integer, intent(in) :: n  !! Order.
    integer, intent(in) :: m  !! Number of right-hand sides.
    real(dp), intent(in) :: r(n, n)  !! Factor of `factorize_gram` (n, n) [sqrt(G)].
    integer, intent(in) :: pivot(n)  !! Pivots of `factorize_gram` (n).
    real(dp), intent(inout) :: b(m, n)  !! Right-hand sides as rows [any], then solutions (m, n) [those over G].
    real(dp) :: x(m, n)
    x = b(:, pivot)
    call dtrsm('R', 'L', 'T', 'N', m, n, 1.0_dp, r, n, x, m)
    call dtrsm('R', 'L', 'N', 'N', m, n, 1.0_dp, r, n, x, m)
    b(:, pivot) = x
  end subroutine solve_gram
end module dotyk_linalg_dense
