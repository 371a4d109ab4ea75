!> Evaluation and bounds of facet polynomials.
!>
!> The bounds follow from the Bernstein form: values of a polynomial lie in the convex hull of its control points, and
!> normals in the cone of the products of the control vectors of the two derivatives.
module dotyk_contact_facet_polynomial
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: few_roundings, pi, rounding
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: bounding_box, control_points, convexity, evaluate_facet, normal_cone

  integer, parameter, public :: max_controls = 9  !! Greatest number of Bernstein control points of a facet.

  real(dp), parameter :: cone_margin = 1.0e-7_dp  !! Margin of a normal cone for the round-off of the arc cosine [rad].
  !> Cones whose half angle has a smaller cosine are nearly half spaces, which exclude nothing.
  real(dp), parameter :: min_cone_cosine = 0.01_dp

contains

  !> Position, relative to the origin, and derivatives of a facet.
  pure subroutine evaluate_facet(c, u, v, x, xu, xv, xuu, xuv, xvv)
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: u  !! First reference coordinate [].
    real(dp), intent(in) :: v  !! Second reference coordinate [].
    real(dp), intent(out) :: x(3)  !! Position (3) [length].
    real(dp), intent(out) :: xu(3)  !! Derivative with respect to u (3) [length].
    real(dp), intent(out) :: xv(3)  !! Derivative with respect to v (3) [length].
    real(dp), intent(out) :: xuu(3)  !! Second derivative with respect to u (3) [length].
    real(dp), intent(out) :: xuv(3)  !! Mixed derivative (3) [length].
    real(dp), intent(out) :: xvv(3)  !! Second derivative with respect to v (3) [length].
    real(dp) :: a0, a1, a2, b0, b1, b2
    integer :: i
    do i = 1, 3
      a0 = c(i, 1) + v*(c(i, 4) + v*c(i, 7))
      a1 = c(i, 2) + v*(c(i, 5) + v*c(i, 8))
      a2 = c(i, 3) + v*(c(i, 6) + v*c(i, 9))
      b0 = c(i, 4) + 2*v*c(i, 7)
      b1 = c(i, 5) + 2*v*c(i, 8)
      b2 = c(i, 6) + 2*v*c(i, 9)
      x(i) = a0 + u*(a1 + u*a2)
      xu(i) = a1 + 2*u*a2
      xv(i) = b0 + u*(b1 + u*b2)
      xuu(i) = 2*a2
      xuv(i) = b1 + 2*u*b2
      xvv(i) = 2*(c(i, 7) + u*(c(i, 8) + u*c(i, 9)))
    end do
  end subroutine evaluate_facet

  !> Box of the Bernstein control points, which contains the facet.
  pure subroutine bounding_box(corners, c, lo, hi)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(out) :: lo(3)  !! Lower corner, relative to the origin (3) [length].
    real(dp), intent(out) :: hi(3)  !! Upper corner, likewise (3) [length].
    real(dp) :: b(3, max_controls), margin
    integer :: n
    call control_points(corners, c, n, b)
    lo = minval(b(:, 1:n), dim=2)
    hi = maxval(b(:, 1:n), dim=2)
    margin = rounding*norm2(hi - lo)
    lo = lo - margin
    hi = hi + margin
  end subroutine bounding_box

  !> Bernstein control points: those of the ends of a line at 1 and 3, of the corners of a triangle at 1 to 3, of a
  !> quadrilateral row by row.
  pure subroutine control_points(corners, c, n, b)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    integer, intent(out) :: n  !! Number of control points.
    !> Control points, relative to the origin; the first n are set (3, max_controls) [length].
    real(dp), intent(out) :: b(3, max_controls)
    real(dp) :: r(3, 9)
    integer :: k
    b = 0
    select case (corners)
    case (2)
      n = 3
      call quadratic_controls(c(:, 1), c(:, 2), c(:, 3), b(:, 1), b(:, 2), b(:, 3))
    case (3)
      n = 6
      b(:, 1) = c(:, 1)
      b(:, 2) = c(:, 1) + c(:, 2) + c(:, 3)
      b(:, 3) = c(:, 1) + c(:, 4) + c(:, 7)
      b(:, 4) = c(:, 1) + c(:, 2)/2
      b(:, 5) = c(:, 1) + c(:, 4)/2
      b(:, 6) = c(:, 1) + (c(:, 2) + c(:, 4) + c(:, 5))/2
    case default
      n = 9
      do k = 1, 3
        call quadratic_controls(c(:, 3*k - 2), c(:, 3*k - 1), c(:, 3*k), r(:, k), r(:, k + 3), r(:, k + 6))
      end do
      do k = 0, 2
        call quadratic_controls(r(:, 3*k + 1), r(:, 3*k + 2), r(:, 3*k + 3), b(:, k + 1), b(:, k + 4), b(:, k + 7))
      end do
    end select
  end subroutine control_points

  !> Bernstein control values on [-1,1] of c0 + c1 t + c2 t^2.
  elemental subroutine quadratic_controls(c0, c1, c2, b1, b2, b3)
    real(dp), intent(in) :: c0  !! Coefficient of 1 [any].
    real(dp), intent(in) :: c1  !! Coefficient of t [any].
    real(dp), intent(in) :: c2  !! Coefficient of t^2 [any].
    real(dp), intent(out) :: b1  !! First control value [any].
    real(dp), intent(out) :: b2  !! Second control value [any].
    real(dp), intent(out) :: b3  !! Third control value [any].
    b1 = c0 - c1 + c2
    b2 = c0 - c2
    b3 = c0 + c1 + c2
  end subroutine quadratic_controls

  !> Cone that contains all normals: x_u lies in the convex hull of control vectors a_i, x_v in that of b_j, hence x_u x
  !> x_v is a combination of the products a_i x b_j with non-negative coefficients.
  pure subroutine normal_cone(corners, c, axis, half_angle)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(out) :: axis(3)  !! Axis of the cone, a unit vector (3) [].
    real(dp), intent(out) :: half_angle  !! Half angle, pi where no cone narrower than a half space was found [rad].
    real(dp) :: a(3, 6), b(3, 6), product(3, 36), length, least
    integer :: i, j, n, m
    select case (corners)
    case (2)
      n = 2
      a(:, 1) = c(:, 2) - 2*c(:, 3)
      a(:, 2) = c(:, 2) + 2*c(:, 3)
      do i = 1, 2
        product(:, i) = [a(2, i), -a(1, i), 0.0_dp]
      end do
    case (3)
      m = 3
      a(:, 1) = c(:, 2)
      a(:, 2) = c(:, 2) + 2*c(:, 3)
      a(:, 3) = c(:, 2) + c(:, 5)
      b(:, 1) = c(:, 4)
      b(:, 2) = c(:, 4) + c(:, 5)
      b(:, 3) = c(:, 4) + 2*c(:, 7)
    case default
      m = 6
      do i = 0, 1
        call quadratic_controls(c(:, 2) + (4*i - 2)*c(:, 3), c(:, 5) + (4*i - 2)*c(:, 6), c(:, 8) + (4*i - 2)*c(:, 9), &
                                a(:, 3*i + 1), a(:, 3*i + 2), a(:, 3*i + 3))
        call quadratic_controls(c(:, 4) + (4*i - 2)*c(:, 7), c(:, 5) + (4*i - 2)*c(:, 8), c(:, 6) + (4*i - 2)*c(:, 9), &
                                b(:, 3*i + 1), b(:, 3*i + 2), b(:, 3*i + 3))
      end do
    end select
    if (corners > 2) then
      n = 0
      do j = 1, m
        do i = 1, m
          n = n + 1
          product(:, n) = cross(a(:, i), b(:, j))
        end do
      end do
    end if
    axis = sum(product(:, 1:n), dim=2)
    half_angle = pi
    length = norm2(axis)
    if (.not. length > 0) then
      axis = [0.0_dp, 0.0_dp, 1.0_dp]
      return
    end if
    axis = axis/length
    least = 1
    do i = 1, n
      length = norm2(product(:, i))
      if (length > 0) least = min(least, dot_product(axis, product(:, i))/length)
    end do
    if (least > min_cone_cosine) half_angle = min(pi, acos(least) + cone_margin)
  end subroutine normal_cone

  !> Radius within which the squared distance is convex: its second derivative J^T J + (x - p).x'' is positive while
  !> abs(x - p) is below the least eigenvalue of J^T J over the greatest second derivative. The eigenvalue is sampled at
  !> nine points and halved.
  pure subroutine convexity(corners, c, affine, reach)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    logical, intent(out) :: affine  !! The map is affine.
    real(dp), intent(out) :: reach  !! Convexity radius [length].
    real(dp) :: x(3), xu(3), xv(3), xuu(3), xuv(3), xvv(3), least, second, u, v, a, b, g
    integer :: i, j
    affine = .false.
    reach = huge(reach)
    if (corners == 2) return
    least = huge(least)
    second = 0
    do j = 0, 2
      do i = 0, 2
        if (corners == 3) then
          u = 0.5_dp*i
          v = 0.5_dp*j
          if (i + j > 2) cycle
        else
          u = i - 1
          v = j - 1
        end if
        call evaluate_facet(c, u, v, x, xu, xv, xuu, xuv, xvv)
        a = dot_product(xu, xu)
        b = dot_product(xu, xv)
        g = dot_product(xv, xv)
        least = min(least, (a + g - sqrt((a - g)**2 + 4*b**2))/2)
        second = max(second, max(norm2(xuu), norm2(xvv)) + norm2(xuv))
      end do
    end do
    affine = second <= few_roundings*sqrt(max(least, 0.0_dp))
    if (.not. affine) reach = max(0.0_dp, least)/2/second
  end subroutine convexity
end module dotyk_contact_facet_polynomial
