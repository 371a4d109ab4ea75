!> What a factorization loses: the condition of a stiffness, and the shapes that it hardly resists.
!>
!> All is said of the matrix whose diagonal is scaled to 1, `D^{-1/2} K D^{-1/2}`: neither units nor sizes of elements count, as they do not
!> for Cholesky's method. Its eigenvalues are the stationary values of `x^T K x/x^T D x`; the least ones come from inverse iteration with
!> some vectors at a time, which is as cheap as solves in blocks are, and tells a few soft shapes apart from a stiffness that is soft in
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

  !> Inverse iterations: each makes the part of other shapes smaller by the ratio of their eigenvalues.
  integer, parameter :: n_steps = 3

contains

  !> Largest column sum of the scaled matrix: at least its largest eigenvalue, at most the entries of a column.
  pure real(dp) function scaled_norm(matrix) result(norm)
    !> With a positive diagonal.
    type(sparse_symmetric_t), intent(in) :: matrix
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

  !> The least eigenvalues of the scaled matrix, and their shapes.
  subroutine smallest_eigenpairs(factor, diagonal, values, shapes, error)
    !> Factor of K.
    type(cholesky_t), intent(in) :: factor
    !> Diagonal of K (n).
    real(dp), intent(in) :: diagonal(:)
    !> Eigenvalues, ascending; as many as the matrix has at most (m).
    real(dp), intent(out) :: values(:)
    !> Unscaled, `x^T D x = 1` (n, m).
    real(dp), intent(out) :: shapes(:, :)
    !> Not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: answer(:, :), projected(:, :), inverse(:), vectors(:, :)
    integer :: m, i, j, step
    m = size(values)
    allocate (answer, mold=shapes)
    allocate (projected(m, m), vectors(m, m), inverse(m))
    ! A start that is the same on every machine.
    do j = 1, m
      do i = 1, size(shapes, 1)
        shapes(i, j) = (mod(i*int(7919 + 104729*j, int64) + int(i, int64)**2, 10007_int64) - 5003)/sqrt(diagonal(i))
      end do
    end do
    call make_orthonormal(diagonal, shapes)
    do step = 1, n_steps
      do j = 1, m
        answer(:, j) = diagonal*shapes(:, j)
      end do
      call factor%solve_block(answer)
      do j = 1, m
        do i = 1, m
          projected(i, j) = sum(shapes(:, i)*diagonal*answer(:, j))
        end do
      end do
      call symmetric_eigen(projected, inverse, vectors, error)
      if (allocated(error)) return
      shapes = matmul(answer, vectors(:, m:1:-1))
      call make_orthonormal(diagonal, shapes)
    end do
    values = 1/inverse(m:1:-1)
  end subroutine smallest_eigenpairs

  !> Columns with x^T D x = 1, orthogonal in D: Gram and Schmidt, twice.
  pure subroutine make_orthonormal(diagonal, x)
    real(dp), intent(in) :: diagonal(:)
    real(dp), intent(inout) :: x(:, :)
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
