!> Lower bounds of the distances between points and curved triangles, by convexity.
!>
!> Where the squared distance F to a point is convex on the facet, F >= F(xi) + F'(xi) . (eta - xi) for all points eta
!> of the facet: the least value at the corners is a lower bound, which is exact where xi is the closest point. A few
!> steps of sequential quadratic programming lead near it.
module dotyk_contact_convex_bound
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_polynomial, only: control_points, max_controls
  implicit none
  private

  type, public :: convex_bound_t  !! What the convexity of the squared distance to one facet depends on.
    logical :: is_known = .false.  !! Whether there is a bound: for triangles that are not flat.
    real(dp) :: stiffness = 0  !! Lower bound of the eigenvalues of J^T J [length^2].
    !> Scalar products of the control points and the second derivatives x_uu, x_uv, x_vv, which are constant (6, 3)
    !> [length^2].
    real(dp) :: product(6, 3) = 0
  contains
    procedure :: init => bound_init
    procedure :: is_beyond => bound_is_beyond
  end type convex_bound_t

  integer, parameter :: max_steps = 4  !! Steps to the closest point.
  real(dp), parameter :: margin = 1.0e-9_dp  !! Margin for round-off, relative to the squared distance.

contains

  !> Set up from the polynomial of a facet.
  subroutine bound_init(self, corners, c, affine, reach)
    class(convex_bound_t), intent(out) :: self
    integer, intent(in) :: corners  !! Number of corners of the facet.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    logical, intent(in) :: affine  !! The map is affine.
    real(dp), intent(in) :: reach  !! Convexity radius, see `convexity` [length].
    real(dp) :: control(3, max_controls), second(3, 3)
    integer :: n
    self%is_known = corners == 3 .and. .not. affine
    if (.not. self%is_known) return
    call control_points(corners, c, n, control)
    second = reshape([2*c(:, 3), c(:, 5), 2*c(:, 7)], [3, 3])
    self%product = matmul(transpose(control(:, 1:6)), second)
    self%stiffness = reach*(max(norm2(second(:, 1)), norm2(second(:, 3))) + norm2(second(:, 2)))
  end subroutine bound_init

  !> Whether no point of the facet is as near to a point as a distance; false where it is not known.
  pure logical function bound_is_beyond(self, c, q, square) result(beyond)
    class(convex_bound_t), intent(in) :: self
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: q(3)  !! The point, relative to the origin of the facet (3) [length].
    real(dp), intent(in) :: square  !! Square of the distance [length^2].
    real(dp), dimension(3) :: x, xu, xv
    real(dp) :: xi(2), g(2), a, b, d, own(3), value, bound
    integer :: step
    beyond = .false.
    if (.not. self%is_known) return
    own = [2*dot_product(q, c(:, 3)), dot_product(q, c(:, 5)), 2*dot_product(q, c(:, 7))]
    if (.not. is_convex(self, own)) return
    xi = 1/3.0_dp
    do step = 1, max_steps
      x = c(:, 1) + xi(1)*(c(:, 2) + xi(1)*c(:, 3) + xi(2)*c(:, 5)) + xi(2)*(c(:, 4) + xi(2)*c(:, 7)) - q
      xu = c(:, 2) + 2*xi(1)*c(:, 3) + xi(2)*c(:, 5)
      xv = c(:, 4) + 2*xi(2)*c(:, 7) + xi(1)*c(:, 5)
      value = dot_product(x, x)
      if (value <= square) return
      g = [dot_product(x, xu), dot_product(x, xv)]
      bound = value + 2*(min(0.0_dp, g(1), g(2)) - dot_product(g, xi))
      beyond = bound - margin*value > square
      if (beyond) return
      a = dot_product(xu, xu) + 2*dot_product(x, c(:, 3))
      b = dot_product(xu, xv) + dot_product(x, c(:, 5))
      d = dot_product(xv, xv) + 2*dot_product(x, c(:, 7))
      call least_in_triangle(a, b, d, g, xi)
    end do
  end function bound_is_beyond

  !> Whether the squared distance is convex on the facet: J^T J + (x - q) . x'' is positive at all control points.
  pure logical function is_convex(self, own)
    class(convex_bound_t), intent(in) :: self
    real(dp), intent(in) :: own(3)  !! Scalar products of the point q and the second derivatives (3) [length^2].
    real(dp) :: a, b, d
    integer :: i
    is_convex = .true.
    do i = 1, size(self%product, 1)
      a = self%stiffness + self%product(i, 1) - own(1)
      b = self%product(i, 2) - own(2)
      d = self%stiffness + self%product(i, 3) - own(3)
      is_convex = is_convex .and. a > 0 .and. d > 0 .and. a*d > b*b
    end do
  end function is_convex

  !> Least point of the quadratic model of a convex function in the unit triangle.
  pure subroutine least_in_triangle(a, b, d, g, xi)
    real(dp), intent(in) :: a  !! Second derivatives: uu [any].
    real(dp), intent(in) :: b  !! uv [any].
    real(dp), intent(in) :: d  !! vv [any].
    real(dp), intent(in) :: g(2)  !! Gradient at the present point (2) [any].
    real(dp), intent(inout) :: xi(2)  !! Present point; least point of the model on return (2) [].
    real(dp), parameter :: start(2, 3) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp], [2, 3])
    real(dp), parameter :: along(2, 3) = reshape([1.0_dp, 0.0_dp, -1.0_dp, 1.0_dp, 0.0_dp, 1.0_dp], [2, 3])
    real(dp) :: s(2), slope(2), curvature, t, value, least, trial(2), determinant
    integer :: k
    determinant = a*d - b*b
    if (a > 0 .and. determinant > 0) then
      trial = xi + [b*g(2) - d*g(1), b*g(1) - a*g(2)]/determinant
      if (min(trial(1), trial(2), 1 - trial(1) - trial(2)) >= 0) then
        xi = trial
        return
      end if
    end if
    least = huge(least)
    s = xi
    do k = 1, 3
      trial = start(:, k) - xi
      slope = g + [a*trial(1) + b*trial(2), b*trial(1) + d*trial(2)]
      curvature = a*along(1, k)**2 + 2*b*along(1, k)*along(2, k) + d*along(2, k)**2
      t = 0
      if (curvature > 0) t = max(0.0_dp, min(1.0_dp, -dot_product(slope, along(:, k))/curvature))
      trial = trial + t*along(:, k)
      value = dot_product(g, trial) + (a*trial(1)**2 + 2*b*trial(1)*trial(2) + d*trial(2)**2)/2
      if (value < least) then
        least = value
        s = start(:, k) + t*along(:, k)
      end if
    end do
    xi = s
  end subroutine least_in_triangle
end module dotyk_contact_convex_bound
