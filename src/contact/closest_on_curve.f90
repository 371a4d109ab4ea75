!> Closest point of a quadratic curve to the origin.
!>
!> The derivative of the squared distance is a cubic, whose roots are isolated by those of its own derivative: the
!> minimum is exact.
module dotyk_contact_closest_on_curve
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: closest_on_curve

  !> A curve is straight where the square of its quadratic coefficient, relative to that of the linear one, is
  !> round-off.
  real(dp), parameter :: straight_round_off = 1.0e-29_dp
  !> Margin of the lower bound of the distance, relative to the length of the curve and to the distance.
  real(dp), parameter :: round_off = 1.0e-9_dp
  !> Newton steps, safeguarded by bisection; the method needs 3 to 6, bisection alone 60.
  integer, parameter :: max_steps = 100

contains

  !> Point of a0 + a1 t + a2 t^2, first <= t <= 1, that is closest to the origin.
  pure subroutine closest_on_curve(a0, a1, a2, first, bound, t, square)
    real(dp), intent(in) :: a0(3)  !! Coefficient of 1 (3) [length].
    real(dp), intent(in) :: a1(3)  !! Coefficient of t (3) [length].
    real(dp), intent(in) :: a2(3)  !! Coefficient of t^2 (3) [length].
    real(dp), intent(in) :: first  !! Lower end of t [].
    real(dp), intent(in) :: bound  !! Squared distance beyond which the closest point does not matter [length^2].
    real(dp), intent(out) :: t  !! Parameter of the closest point [].
    real(dp), intent(out) :: square  !! Squared distance; greater than `bound` where it does not matter [length^2].
    real(dp) :: b(0:3), ends(4), discriminant, root, q, low, high
    integer :: n, i
    b = [dot_product(a0, a1), dot_product(a1, a1) + 2*dot_product(a0, a2), 3*dot_product(a1, a2), 2*dot_product(a2, a2)]
    if (b(3) <= straight_round_off*dot_product(a1, a1)) then
      t = first
      if (dot_product(a1, a1) > 0) t = max(first, min(1.0_dp, -b(0)/dot_product(a1, a1)))
      square = sum((a0 + t*a1)**2)
      return
    end if
    if (is_beyond(a0 + first*(a1 + first*a2), a0 + a1 + a2, norm2(a2)*((1 - first)/2)**2, bound)) then
      t = first
      square = huge(square)
      return
    end if
    n = 1
    ends(1) = first
    discriminant = b(2)**2 - 3*b(1)*b(3)
    if (discriminant > 0) then
      ! Roots of b1 + 2 b2 t + 3 b3 t^2 without cancellation.
      q = -(b(2) + sign(sqrt(discriminant), b(2)))
      low = q/(3*b(3))
      high = low
      if (abs(q) > 0) high = b(1)/q
      do i = 1, 2
        root = merge(min(low, high), max(low, high), i == 1)
        if (root > ends(n) .and. root < 1) then
          n = n + 1
          ends(n) = root
        end if
      end do
    end if
    ends(n + 1) = 1
    t = first
    square = sum((a0 + t*(a1 + t*a2))**2)
    call keep_if_closer(a0, a1, a2, 1.0_dp, t, square)
    do i = 1, n
      if (.not. (cubic(b, ends(i)) < 0 .and. cubic(b, ends(i + 1)) > 0)) cycle
      root = root_between(b, ends(i), ends(i + 1))
      call keep_if_closer(a0, a1, a2, root, t, square)
    end do
  end subroutine closest_on_curve

  !> Whether no point of a curve is as near to the origin as a distance, by its chord.
  pure logical function is_beyond(first, last, height, square) result(beyond)
    real(dp), intent(in) :: first(3)  !! One end of the chord (3) [length].
    real(dp), intent(in) :: last(3)  !! The other end (3) [length].
    real(dp), intent(in) :: height  !! Greatest distance of the curve from the chord [length].
    real(dp), intent(in) :: square  !! Square of the distance [length^2].
    real(dp) :: along(3), length, distance, t
    along = last - first
    length = dot_product(along, along)
    t = 0
    if (length > 0) t = max(0.0_dp, min(1.0_dp, -dot_product(first, along)/length))
    distance = max(0.0_dp, norm2(first + t*along) - height - round_off*sqrt(length))
    beyond = (1 - round_off)*distance**2 > square
  end function is_beyond

  !> Value of a cubic polynomial [length^2].
  pure real(dp) function cubic(b, t)
    real(dp), intent(in) :: b(0:3)  !! Coefficients (0:3) [length^2].
    real(dp), intent(in) :: t  !! Argument [].
    cubic = b(0) + t*(b(1) + t*(b(2) + t*b(3)))
  end function cubic

  !> Keep a point of a curve that is closer to the origin than the best one so far.
  pure subroutine keep_if_closer(a0, a1, a2, at, t, square)
    real(dp), intent(in) :: a0(3)  !! Coefficient of 1 (3) [length].
    real(dp), intent(in) :: a1(3)  !! Coefficient of t (3) [length].
    real(dp), intent(in) :: a2(3)  !! Coefficient of t^2 (3) [length].
    real(dp), intent(in) :: at  !! Parameter of the candidate [].
    real(dp), intent(inout) :: t  !! Parameter of the best point so far [].
    real(dp), intent(inout) :: square  !! Its squared distance [length^2].
    real(dp) :: value
    value = sum((a0 + at*(a1 + at*a2))**2)
    if (value < square) then
      square = value
      t = at
    end if
  end subroutine keep_if_closer

  !> Root of a cubic that increases through zero between two points and is monotone there: Newton's method kept in the
  !> bracket [].
  pure real(dp) function root_between(b, first, last) result(t)
    real(dp), intent(in) :: b(0:3)  !! Coefficients (0:3) [length^2].
    real(dp), intent(in) :: first  !! Lower end of the bracket [].
    real(dp), intent(in) :: last  !! Upper end of the bracket [].
    real(dp) :: low, high, value, derivative, previous
    integer :: step
    low = first
    high = last
    t = (low + high)/2
    do step = 1, max_steps
      value = cubic(b, t)
      if (value < 0) then
        low = t
      else
        high = t
      end if
      derivative = b(1) + t*(2*b(2) + t*3*b(3))
      previous = t
      if (derivative > 0) t = t - value/derivative
      if (.not. (derivative > 0 .and. t > low .and. t < high)) t = (low + high)/2
      if (abs(t - previous) <= 2*epsilon(t)) exit
    end do
  end function root_between
end module dotyk_contact_closest_on_curve
