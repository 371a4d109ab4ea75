!> Gauss-Jacobi rules on the line, computed to full precision.
module dotyk_mesh_gauss
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: gauss_jacobi

contains

  !> Gauss rule with n points on [0,1] for the weight (1-x)^alpha: exact for degree 2n-1. alpha = 0 is Gauss-Legendre.
  !>
  !> Newton's method on the Jacobi polynomial P_n^(alpha,0), deflated by the roots already found.
  pure subroutine gauss_jacobi(n, alpha, x, w)
    !> Number of points.
    integer, intent(in) :: n
    !> Exponent of the weight, 0 or above.
    integer, intent(in) :: alpha
    !> Points, ascending.
    real(dp), intent(out) :: x(n)
    !> Weights; their sum is 1/(alpha+1).
    real(dp), intent(out) :: w(n)
    real(dp), parameter :: pi = acos(-1.0_dp)
    integer, parameter :: most_steps = 100
    real(dp) :: t, p, slope, change, last
    integer :: i, step
    last = -1
    do i = 1, n
      t = -cos(pi*(2*i - 1)/(2*n))
      ! Chebyshev's point, and from the second on its mean with the root before, where the roots lie closer to -1.
      if (i > 1) t = 0.5_dp*(t + last)
      do step = 1, most_steps
        call jacobi(n, alpha, t, p, slope)
        change = -p/(slope - p*sum(1/(t - (2*x(:i - 1) - 1))))
        t = t + change
        if (abs(change) <= epsilon(t)) exit
      end do
      call jacobi(n, alpha, t, p, slope)
      last = t
      x(i) = 0.5_dp*(1 + t)
      w(i) = 1/((1 - t)*(1 + t)*slope**2)
    end do
    ! Takes away what the round-off of the roots did to the weights.
    w = w/((alpha + 1)*sum(w))
  end subroutine gauss_jacobi

  !> The Jacobi polynomial P_n^(alpha,0) and its derivative, by the recurrence of three terms (Abramowitz and Stegun
  !> 22.7.1, 22.8.1).
  pure subroutine jacobi(n, alpha, t, p, slope)
    !> Degree, 1 or above.
    integer, intent(in) :: n
    !> Exponent alpha.
    integer, intent(in) :: alpha
    !> Where to evaluate, inside (-1,1).
    real(dp), intent(in) :: t
    !> Value and derivative.
    real(dp), intent(out) :: p, slope
    real(dp) :: before, next, a, two
    integer :: k
    a = alpha
    before = 1
    p = 0.5_dp*(a + (a + 2)*t)
    do k = 2, n
      two = 2*k + a
      next = ((two - 1)*(two*(two - 2)*t + a**2)*p - 2*(k + a - 1)*(k - 1)*two*before)/(2*k*(k + a)*(two - 2))
      before = p
      p = next
    end do
    two = 2*n + a
    slope = (n*(a - two*t)*p + 2*(n + a)*n*before)/(two*(1 - t)*(1 + t))
  end subroutine jacobi
end module dotyk_mesh_gauss
