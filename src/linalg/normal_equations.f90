!> Small least-squares problems by their normal equations, for many matrices A of which only G = A^T A is formed.
!>
!> The rank is that of a QR factorization with column pivoting and incremental condition estimation, as in LAPACK's
!> dgelsy: R of a pivoted Cholesky factorization of A^T A is R of that of A. The smallest entries of R have errors of
!> sqrt(epsilon), so condition numbers are told up to about 1e6. Solutions have errors of epsilon times the square of
!> the condition number; where that matters, add a step of refinement. Faster than dgelsy for the thousands of small
!> fits of an error estimate.
module dotyk_linalg_normal_equations
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dtrsm
  use dotyk_linalg_lapack, only: dlaic1
  implicit none
  private
  public :: factorize_gram, solve_gram

contains

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
end module dotyk_linalg_normal_equations
