!> Exact line search on a convex, piecewise quadratic function.
module dotyk_scheme_line_search
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  implicit none
  private
  public :: line_minimum

contains

  !> The minimum t >= 0 of `t slope + t^2 curvature/2 + sum k max(0, position + t change)^2/2`; `huge` where there is
  !> none.
  !>
  !> The derivative is monotone, and linear between kinks, the zeros of the positions: bisection over the sorted kinks
  !> finds the interval, interpolation the zero of the derivative.
  pure real(dp) function line_minimum(slope, curvature, k, position, change) result(t)
    real(dp), intent(in) :: slope  !! Derivative of the smooth part at t = 0 [energy].
    real(dp), intent(in) :: curvature  !! Second derivative of the smooth part, not negative [energy].
    real(dp), intent(in) :: k(:)  !! Stiffnesses (n) [force/length].
    real(dp), intent(in) :: position(:)  !! Positions at t = 0 (n) [length].
    real(dp), intent(in) :: change(:)  !! Changes of the positions per t (n) [length].
    real(dp), allocatable :: kink(:)
    integer, allocatable :: order(:), moving(:)
    real(dp) :: low, high, d_low, d_high
    integer :: first, last, middle, i
    t = 0
    d_low = derivative(t)
    if (d_low >= 0) return
    moving = pack([(i, i=1, size(change))], position*change < 0)
    kink = -position(moving)/change(moving)
    allocate (order(size(kink)))
    call sort_order(kink, order)
    first = 0
    last = size(kink) + 1
    do while (last - first > 1)
      middle = (first + last)/2
      if (derivative(kink(order(middle))) >= 0) then
        last = middle
      else
        first = middle
      end if
    end do
    low = 0
    if (first > 0) low = kink(order(first))
    high = 2*low + 1
    if (last <= size(kink)) high = kink(order(last))
    d_low = derivative(low)
    d_high = derivative(high)
    t = huge(t)
    if (d_high > d_low) t = low - d_low*(high - low)/(d_high - d_low)
  contains
    !> Derivative along the line.
    pure real(dp) function derivative(t)
      real(dp), intent(in) :: t  !! Step length [].
      derivative = slope + t*curvature + sum(k*change*max(0.0_dp, position + t*change))
    end function derivative
  end function line_minimum
end module dotyk_scheme_line_search
