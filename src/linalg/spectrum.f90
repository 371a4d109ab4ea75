!> Largest eigenvalue of a symmetric positive semidefinite operator by the Lanczos method (Y. Saad, Numerical Methods
!> for Large Eigenvalue Problems, chapter 6), without reorthogonalization: orthogonality is lost to Ritz vectors that have
!> converged (C. C. Paige, J. Inst. Maths Applics 18, 1976), and the iteration ends with the first one.
module dotyk_linalg_spectrum
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_dense, only: largest_tridiagonal_eigenpair
  implicit none
  private
  public :: largest_eigenvalue, fixed_start

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

  !> A remainder below this fraction of the largest image is rounding of the products.
  real(dp), parameter, public :: rounding_of_products = 16*epsilon(1.0_dp)

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
    real(dp), allocatable :: alpha(:), beta(:), w(:), v(:), last(:), top(:)
    real(dp) :: scale, length
    integer :: most
    value = 0
    residual = 0
    steps = 0
    most = min(n, most_steps)
    if (most <= 0) return
    allocate (alpha(most), beta(most), w(n), v(n), top(most))
    allocate (last(n), source=0.0_dp)
    call fixed_start(v)
    scale = 0
    length = 0
    do while (steps < most)
      steps = steps + 1
      call operator%apply(v, w)
      scale = max(scale, norm(w))
      w = w - length*last
      alpha(steps) = dot(v, w)
      w = w - alpha(steps)*v
      length = norm(w)
      ! The vectors span an invariant subspace: the remainder is rounding.
      if (length <= rounding_of_products*scale .or. steps == n) length = 0
      beta(steps) = length
      call largest_tridiagonal_eigenpair(alpha(:steps), beta(:steps - 1), value, top(:steps))
      residual = length*abs(top(steps))
      if (residual <= tolerance*value .or. .not. length > 0) exit
      if (interrupted()) exit
      last = v
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
end module dotyk_linalg_spectrum
