!> Largest eigenvalue of a symmetric positive semidefinite operator by the Lanczos method with full reorthogonalization
!> (Y. Saad, Numerical Methods for Large Eigenvalue Problems, chapter 6).
!>
!> Condition number of a stiffness matrix, and its near-null-space modes.
!>
!> Both refer to the matrix with unit diagonal, `D^{-1/2} K D^{-1/2}`: units and element sizes play no part then, as
!> they play none in the rounding errors of Cholesky's method (A. van der Sluis, Numer. Math. 14, 1969). Its eigenvalues
!> are the stationary values of `x^T K x/x^T D x`. The smallest ones come from inverse subspace iteration, at the low
!> cost per vector of block solves. They tell a few near-null-space modes from a stiffness that is ill-conditioned in
!> many ways.
module dotyk_linalg_spectrum
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: sum_rounding
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_dense, only: largest_tridiagonal_eigenpair, symmetric_eigen
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: largest_eigenvalue, fixed_start, scaled_norm, smallest_eigenpairs

  type, abstract, public :: linear_operator_t  !! A linear operator that is known by its action only.
  contains
    procedure(apply_operator), deferred :: apply
  end type linear_operator_t

  abstract interface
    !> y = A x.
    subroutine apply_operator(self, x, y)
      import :: linear_operator_t, dp
      class(linear_operator_t), intent(inout) :: self
      real(dp), intent(in) :: x(:)  !! Vector x (n) [any].
      real(dp), intent(out) :: y(:)  !! Product y (n) [operator times x].
    end subroutine apply_operator
  end interface

  integer, parameter :: group_size = 16  !! Basis vectors in an allocation: most runs need one or two groups.

  type :: group_t  !! A group of basis vectors.
    real(dp), allocatable :: v(:, :)  !! The vectors as columns (n, group_size).
  end type group_t

  !> Steps of inverse iteration. Each reduces the error of a mode by the ratio of its eigenvalue to the first one left
  !> out: 100 and more for the near-null-space modes that are deflated.
  integer, parameter :: n_steps = 3

contains

  !> The result is a lower bound of the largest eigenvalue, up to rounding. Some eigenvalue lies within the residual of
  !> it: as a rule the largest one. The start vector is the same on every machine. An interrupt ends the iteration with
  !> the result so far.
  subroutine largest_eigenvalue(operator, n, tolerance, most_steps, value, residual, steps)
    class(linear_operator_t), intent(inout) :: operator  !! The operator, symmetric and positive semidefinite.
    integer, intent(in) :: n  !! Order of the operator.
    real(dp), intent(in) :: tolerance  !! Relative residual to stop at: residual <= tolerance*value [].
    integer, intent(in) :: most_steps  !! Greatest number of applications of the operator.
    real(dp), intent(out) :: value  !! Largest Ritz value [of the operator].
    real(dp), intent(out) :: residual  !! Norm of its residual [of the operator].
    integer, intent(out) :: steps  !! Applications of the operator.
    type(group_t), allocatable :: basis(:)
    real(dp), allocatable :: alpha(:), beta(:), w(:), v(:), top(:)
    real(dp) :: scale, length
    integer :: most, slot
    value = 0
    residual = 0
    steps = 0
    most = min(n, most_steps)
    if (most <= 0) return
    allocate (basis((most - 1)/group_size + 1), alpha(most), beta(most), w(n), v(n), top(most))
    call fixed_start(v)
    scale = 0
    do while (steps < most)
      slot = modulo(steps, group_size) + 1
      steps = steps + 1
      if (slot == 1) allocate (basis((steps - 1)/group_size + 1)%v(n, group_size))
      basis((steps - 1)/group_size + 1)%v(:, slot) = v
      call operator%apply(v, w)
      alpha(steps) = dot(v, w)
      scale = max(scale, norm(w))
      call orthogonalize(basis, steps, w)
      length = norm(w)
      ! The basis spans an invariant subspace: the remainder is rounding.
      if (length <= sum_rounding*scale .or. steps == n) length = 0
      beta(steps) = length
      call largest_tridiagonal_eigenpair(alpha(:steps), beta(:steps - 1), value, top(:steps))
      residual = length*abs(top(steps))
      if (residual <= tolerance*value .or. .not. length > 0) exit
      if (interrupted()) exit
      v = w/length
    end do
    value = max(value, 0.0_dp)
  end subroutine largest_eigenvalue

  !> Pseudo-random vector of norm 1 by Lehmer's congruential generator, 48271 modulo 2^31-1 (S. K. Park and K. W.
  !> Miller, Comm. ACM 31, 1988).
  subroutine fixed_start(v)
    real(dp), intent(out), contiguous :: v(:)  !! The vector (n) [].
    integer(int64), parameter :: modulus = 2147483647_int64, factor = 48271_int64
    integer(int64) :: state
    integer :: i
    state = 20240229_int64
    do i = 1, size(v)
      state = modulo(factor*state, modulus)
      ! Of absolute value 1/2 to 3/2: no component is small.
      v(i) = 0.5_dp + real(state, dp)/real(modulus, dp)
      state = modulo(factor*state, modulus)
      if (2*state > modulus) v(i) = -v(i)
    end do
    v = v/norm(v)
  end subroutine fixed_start

  !> Make a vector orthogonal to the basis, by Gram-Schmidt twice.
  subroutine orthogonalize(basis, n_vectors, w)
    type(group_t), intent(in) :: basis(:)  !! Orthonormal vectors (number of groups).
    integer, intent(in) :: n_vectors  !! Number of vectors.
    real(dp), intent(inout), contiguous :: w(:)  !! The vector (n) [any].
    integer :: pass, group, n
    do pass = 1, 2
      do group = 1, (n_vectors - 1)/group_size + 1
        n = min(group_size, n_vectors - (group - 1)*group_size)
        call take_out(size(w), n, basis(group)%v, w)
      end do
    end do
  end subroutine orthogonalize

  !> w <- w - V V^T w, summed in one order whatever the number of threads.
  pure subroutine take_out(n, m, v, w)
    integer, intent(in) :: n  !! Length of the vectors.
    integer, intent(in) :: m  !! Number of vectors.
    real(dp), intent(in) :: v(n, m)  !! Orthonormal vectors V (n, m) [].
    real(dp), intent(inout) :: w(n)  !! The vector (n) [any].
    real(dp) :: c(m)
    integer :: j
    do j = 1, m
      c(j) = dot(v(:, j), w)
    end do
    do j = 1, m
      w = w - c(j)*v(:, j)
    end do
  end subroutine take_out

  !> Scalar product, summed in eight strands that the compiler vectorizes, always in the same order.
  pure real(dp) function dot(x, y)
    real(dp), intent(in), contiguous :: x(:)  !! The one vector (n) [any].
    real(dp), intent(in), contiguous :: y(:)  !! The other vector (n) [any].
    real(dp) :: strand(8)
    integer :: i, n
    n = size(x)
    strand = 0
    do i = 1, n - 7, 8
      strand = strand + x(i:i + 7)*y(i:i + 7)
    end do
    do i = n - modulo(n, 8) + 1, n
      strand(1) = strand(1) + x(i)*y(i)
    end do
    dot = ((strand(1) + strand(2)) + (strand(3) + strand(4))) + ((strand(5) + strand(6)) + (strand(7) + strand(8)))
  end function dot

  !> Euclidean norm.
  pure real(dp) function norm(x)
    real(dp), intent(in), contiguous :: x(:)  !! The vector (n) [any].
    norm = sqrt(dot(x, x))
  end function norm

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
end module dotyk_linalg_spectrum
