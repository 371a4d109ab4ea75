!> Gauss-Jacobi quadrature rules on an interval, to full precision.
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
    integer, intent(in) :: n  !! Number of points.
    integer, intent(in) :: alpha  !! Exponent of the weight, 0 or above.
    real(dp), intent(out) :: x(n)  !! Points, ascending (n) [].
    real(dp), intent(out) :: w(n)  !! Weights, whose sum is 1/(alpha+1) (n) [].
    real(dp), parameter :: pi = acos(-1.0_dp)
    integer, parameter :: most_steps = 100
    real(dp) :: t, p, derivative, change, last
    integer :: i, step
    last = -1
    do i = 1, n
      t = -cos(pi*(2*i - 1)/(2*n))
      ! Start: Chebyshev point; from the second root on its mean with the previous root, as roots lie closer to -1.
      if (i > 1) t = 0.5_dp*(t + last)
      do step = 1, most_steps
        call jacobi(n, alpha, t, p, derivative)
        change = -p/(derivative - p*sum(1/(t - (2*x(:i - 1) - 1))))
        t = t + change
        if (abs(change) <= epsilon(t)) exit
      end do
      call jacobi(n, alpha, t, p, derivative)
      last = t
      x(i) = 0.5_dp*(1 + t)
      w(i) = 1/((1 - t)*(1 + t)*derivative**2)
    end do
    ! Removes the effect of the round-off of the roots on the weights.
    w = w/((alpha + 1)*sum(w))
  end subroutine gauss_jacobi

  !> Jacobi polynomial P_n^(alpha,0) and its derivative, by the three-term recurrence (Abramowitz and Stegun 22.7.1,
  !> 22.8.1).
  pure subroutine jacobi(n, alpha, t, p, derivative)
    integer, intent(in) :: n  !! Degree, 1 or above.
    integer, intent(in) :: alpha  !! Exponent alpha.
    real(dp), intent(in) :: t  !! Argument, inside (-1,1) [].
    real(dp), intent(out) :: p  !! Value [].
    real(dp), intent(out) :: derivative  !! Derivative [].
    real(dp) :: previous, next, a, two
    integer :: k
    a = alpha
    previous = 1
    p = 0.5_dp*(a + (a + 2)*t)
    do k = 2, n
      two = 2*k + a
      next = ((two - 1)*(two*(two - 2)*t + a**2)*p - 2*(k + a - 1)*(k - 1)*two*previous)/(2*k*(k + a)*(two - 2))
      previous = p
      p = next
    end do
    two = 2*n + a
    derivative = (n*(a - two*t)*p + 2*(n + a)*n*previous)/(two*(1 - t)*(1 + t))
  end subroutine jacobi
end module dotyk_mesh_gauss
