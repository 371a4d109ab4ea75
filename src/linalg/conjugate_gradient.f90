!> Preconditioned conjugate gradients (M. R. Hestenes and E. Stiefel, J. Res. Natl. Bur. Stand. 49, 1952; Y. Saad,
!> Iterative Methods for Sparse Linear Systems, 2003, algorithm 9.1 and section 6.7.3), with the same digits on any
!> number of threads.
!>
!> The coefficients of the steps are those of the Lanczos method for the preconditioned matrix: their tridiagonal
!> matrix gives its extreme Ritz values at no cost.
module dotyk_linalg_conjugate_gradient
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: largest_tridiagonal_eigenpair
  use dotyk_linalg_fixed_sum, only: add_multiple, multiply_and_add, scalar_product
  implicit none
  private
  public :: conjugate_gradient

  !> A symmetric positive (semi)definite matrix A and its preconditioner M, both known by their action.
  type, abstract, public :: preconditioned_system_t
  contains
    procedure(apply_matrix), deferred :: multiply  !! y = A x.
    procedure(apply_preconditioner), deferred :: precondition  !! z = M r, M symmetric and near the inverse of A.
  end type preconditioned_system_t

  abstract interface
    !> y = A x.
    subroutine apply_matrix(self, x, y)
      import :: preconditioned_system_t, dp
      class(preconditioned_system_t), intent(in) :: self
      real(dp), intent(in), contiguous :: x(:)  !! Vector x (n) [any].
      real(dp), intent(out), contiguous :: y(:)  !! Product y (n) [A times x].
    end subroutine apply_matrix

    !> z = M r.
    subroutine apply_preconditioner(self, r, z)
      import :: preconditioned_system_t, dp
      class(preconditioned_system_t), intent(in) :: self
      real(dp), intent(in), contiguous :: r(:)  !! Residual r (n) [A times x].
      real(dp), intent(out), contiguous :: z(:)  !! Preconditioned residual z (n) [as x].
    end subroutine apply_preconditioner
  end interface

  type, public :: cg_outcome_t  !! How an iteration went.
    integer :: steps = 0  !! Steps.
    logical :: converged = .false.  !! Whether the tolerance was reached.
    real(dp) :: reduction = 1  !! Last residual over the first one, in the norm of the preconditioner, sqrt(r^T M r) [].
    real(dp) :: first_norm = 0  !! The first residual in this norm [sqrt(A) times x].
    real(dp), allocatable :: diagonal(:)  !! Diagonal of the Lanczos matrix (steps) [].
    real(dp), allocatable :: off_diagonal(:)  !! Entries beside its diagonal (steps) [].
  contains
    procedure :: ritz_values => outcome_ritz_values
    procedure :: eigenvalue_bound => outcome_eigenvalue_bound
  end type cg_outcome_t

contains

  !> Solve A x = b from x = 0. The residual is that of the recurrence. An interrupt ends the iteration.
  subroutine conjugate_gradient(system, b, x, tolerance, most_steps, outcome, small)
    class(preconditioned_system_t), intent(in) :: system  !! The matrix and its preconditioner.
    real(dp), intent(in), contiguous :: b(:)  !! Right-hand side b (n) [A times x], in the range of a singular matrix.
    real(dp), intent(out), contiguous :: x(:)  !! Solution x (n) [any].
    real(dp), intent(in) :: tolerance  !! Reduction of the residual in the norm of the preconditioner to stop at [].
    integer, intent(in) :: most_steps  !! Greatest number of steps.
    type(cg_outcome_t), intent(out) :: outcome  !! Steps, convergence and Lanczos matrix.
    !> A residual, in the norm of the preconditioner, that is small enough in any case; 0 if absent [sqrt(A) times x].
    real(dp), intent(in), optional :: small
    real(dp), allocatable :: r(:), z(:), p(:), q(:)
    real(dp) :: square, last, curvature, alpha, beta, enough
    integer :: n
    enough = 0
    if (present(small)) enough = small
    n = size(b)
    allocate (outcome%diagonal(most_steps), outcome%off_diagonal(most_steps), source=0.0_dp)
    allocate (r(n), z(n), p(n), q(n))
    x = 0
    r(:) = b
    call system%precondition(r, z)
    p(:) = z
    square = scalar_product(n, r, z)
    outcome%first_norm = sqrt(max(square, 0.0_dp))
    ! False for NaN, too.
    outcome%converged = square <= enough**2
    do while (outcome%steps < most_steps .and. square > enough**2)
      call system%multiply(p, q)
      curvature = scalar_product(n, p, q)
      ! Rounding, or a matrix that is not definite.
      if (.not. curvature > 0) exit
      outcome%steps = outcome%steps + 1
      alpha = square/curvature
      call add_multiple(n, alpha, p, x)
      call add_multiple(n, -alpha, q, r)
      call system%precondition(r, z)
      last = square
      square = scalar_product(n, r, z)
      beta = max(square, 0.0_dp)/last
      associate (k => outcome%steps)
        outcome%diagonal(k) = outcome%diagonal(k) + 1/alpha
        outcome%off_diagonal(k) = sqrt(beta)/alpha
        if (k < most_steps) outcome%diagonal(k + 1) = beta/alpha
      end associate
      outcome%reduction = sqrt(max(square, 0.0_dp))/outcome%first_norm
      outcome%converged = outcome%reduction <= tolerance .or. outcome%reduction*outcome%first_norm <= enough
      if (outcome%converged) exit
      if (interrupted()) exit
      call multiply_and_add(n, beta, z, p)
    end do
  end subroutine conjugate_gradient

  !> Extreme Ritz values of the preconditioned matrix: within its spectrum, up to rounding.
  subroutine outcome_ritz_values(self, least, greatest)
    class(cg_outcome_t), intent(in) :: self
    real(dp), intent(out) :: least  !! Least Ritz value; 0 without steps [].
    real(dp), intent(out) :: greatest  !! Greatest Ritz value; 0 without steps [].
    real(dp) :: vector(self%steps)
    least = 0
    greatest = 0
    if (self%steps == 0) return
    associate (n => self%steps)
      call largest_tridiagonal_eigenpair(self%diagonal(:n), self%off_diagonal(:n), greatest, vector)
      call largest_tridiagonal_eigenpair(-self%diagonal(:n), -self%off_diagonal(:n), least, vector)
    end associate
    least = -least
  end subroutine outcome_ritz_values

  !> A lower bound of the eigenvalues of M A along whose eigenvectors the first residual has at least a share of its
  !> norm: those of a start without order.
  !>
  !> The residual after k steps is p(M A) times the first one, p(x) the product of 1 - x/theta_j over the Ritz values.
  !> An eigenvalue x below them all leaves p(x) of its share, so that p(x) times the share is at most the reduction of
  !> the norm. p decreases from 1 at zero to 0 at the least Ritz value.
  real(dp) function outcome_eigenvalue_bound(self, share) result(bound)
    class(cg_outcome_t), intent(in) :: self
    real(dp), intent(in) :: share  !! The share, in the norm of the preconditioner [].
    integer, parameter :: halvings = 50  !! Halvings of the interval.
    real(dp) :: low, high
    integer :: k
    low = 0
    call self%ritz_values(high, bound)
    do k = 1, halvings
      bound = (low + high)/2
      if (residual_polynomial(self, bound)*share > self%reduction) then
        low = bound
      else
        high = bound
      end if
    end do
    bound = low
  end function outcome_eigenvalue_bound

  !> p(x), by the pivots of the Lanczos matrix less x; 0 where x is not below the Ritz values.
  pure real(dp) function residual_polynomial(outcome, x) result(p)
    type(cg_outcome_t), intent(in) :: outcome  !! The iteration.
    real(dp), intent(in) :: x  !! x, not negative [].
    real(dp) :: pivot, first
    integer :: j
    p = 1
    pivot = 1
    first = 1
    do j = 1, outcome%steps
      associate (square => merge(outcome%off_diagonal(max(1, j - 1))**2, 0.0_dp, j > 1))
        pivot = outcome%diagonal(j) - x - square/pivot
        first = outcome%diagonal(j) - square/first
      end associate
      p = p*max(0.0_dp, pivot/first)
      if (.not. p > 0) return
    end do
  end function residual_polynomial

end module dotyk_linalg_conjugate_gradient
