!> Condition number of a stiffness matrix, and its near-null-space modes.
!>
!> Both refer to the matrix with unit diagonal, `D^{-1/2} K D^{-1/2}`: units and element sizes play no part then, as
!> they play none in the rounding errors of Cholesky's method (A. van der Sluis, Numer. Math. 14, 1969). Its eigenvalues
!> are the stationary values of `x^T K x/x^T D x`. The smallest ones come from inverse subspace iteration, at the low
!> cost per vector of block solves. They tell a few near-null-space modes from a stiffness that is ill-conditioned in
!> many ways.
module dotyk_linalg_condition
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: scaled_norm, smallest_eigenpairs

  !> Steps of inverse iteration. Each reduces the error of a mode by the ratio of its eigenvalue to the first one left
  !> out: 100 and more for the near-null-space modes that are deflated.
  integer, parameter :: n_steps = 3

contains

  !> 1-norm of the scaled matrix: an upper bound of its largest eigenvalue, at most the entries of a column [].
  pure real(dp) function scaled_norm(matrix) result(norm)
    type(sparse_symmetric_t), intent(in) :: matrix  !! K, with a positive diagonal.
    real(dp), allocatable :: column(:), scale(:)
    real(dp) :: entry
    integer(int64) :: k
    integer :: i, j
    allocate (column(matrix%n), source=0.0_dp)
    scale = [(1/sqrt(matrix%value(matrix%column_start(j) + 1)), j=1, matrix%n)]
    do j = 1, matrix%n
      do k = matrix%column_start(j) + 1, matrix%column_start(j + 1)
        i = int(matrix%row(k)) + 1
        entry = abs(matrix%value(k))*scale(i)*scale(j)
        column(j) = column(j) + entry
        if (i /= j) column(i) = column(i) + entry
      end do
    end do
    norm = 1
    if (matrix%n > 0) norm = maxval(column)
  end function scaled_norm

  !> Smallest eigenvalues of the scaled matrix, and their modes.
  subroutine smallest_eigenpairs(factor, diagonal, values, modes, error)
    type(cholesky_t), intent(in) :: factor  !! Factor of K.
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of K (n) [as K].
    real(dp), intent(out) :: values(:)  !! Eigenvalues, ascending; at most the order of the matrix (m) [].
    real(dp), intent(out) :: modes(:, :)  !! Modes x, unscaled and with `x^T D x = 1` (n, m) [1/sqrt(K)].
    type(error_t), allocatable, intent(out) :: error  !! Not finite, or LAPACK's iteration has not converged.
    real(dp), allocatable :: solution(:, :), projected(:, :), inverse(:), vectors(:, :)
    integer :: m, i, j, step
    m = size(values)
    allocate (solution, mold=modes)
    allocate (projected(m, m), vectors(m, m), inverse(m))
    ! A pseudo-random start, the same on every machine.
    do j = 1, m
      do i = 1, size(modes, 1)
        modes(i, j) = (mod(i*int(7919 + 104729*j, int64) + int(i, int64)**2, 10007_int64) - 5003)/sqrt(diagonal(i))
      end do
    end do
    call make_orthonormal(diagonal, modes)
    do step = 1, n_steps
      do j = 1, m
        solution(:, j) = diagonal*modes(:, j)
      end do
      call factor%solve_block(solution)
      do j = 1, m
        do i = 1, m
          projected(i, j) = sum(modes(:, i)*diagonal*solution(:, j))
        end do
      end do
      call symmetric_eigen(projected, inverse, vectors, error)
      if (allocated(error)) return
      modes = matmul(solution, vectors(:, m:1:-1))
      call make_orthonormal(diagonal, modes)
    end do
    values = 1/inverse(m:1:-1)
  end subroutine smallest_eigenpairs

  !> Make columns orthonormal in the inner product of D, by Gram-Schmidt twice.
  pure subroutine make_orthonormal(diagonal, x)
    real(dp), intent(in) :: diagonal(:)  !! Diagonal D (n) [any].
    real(dp), intent(inout) :: x(:, :)  !! Independent columns (n, m) [any]; orthonormal on return [1/sqrt(D)].
    integer :: j, k, pass
    do j = 1, size(x, 2)
      do pass = 1, 2
        do k = 1, j - 1
          x(:, j) = x(:, j) - sum(x(:, k)*diagonal*x(:, j))*x(:, k)
        end do
        x(:, j) = x(:, j)/sqrt(max(tiny(1.0_dp), sum(diagonal*x(:, j)**2)))
      end do
    end do
  end subroutine make_orthonormal
end module dotyk_linalg_condition
