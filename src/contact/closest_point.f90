!> Closest point of one facet to a given point, edges and corners included.
!>
!> The distance to an edge, a quadratic curve, is minimized exactly: its derivative is a cubic, whose roots are isolated
!> by those of its own derivative. In the interior a safeguarded Newton method minimizes the squared distance: from one
!> start where that is convex on the facet, from several where it is not. The least of all candidates is the closest
!> point.
module dotyk_contact_closest_point
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding, same_number
  use dotyk_contact_facet_polynomial, only: evaluate_facet
  use dotyk_contact_facet_set, only: facet_set_t
  implicit none
  private
  public :: closest_point_on_facet, edges_at

  !> A curve is straight where the square of its quadratic coefficient, relative to that of the linear one, is
  !> round-off.
  real(dp), parameter :: straight_round_off = 1.0e-29_dp
  !> Newton steps, safeguarded by bisection; the method needs 3 to 6, bisection alone 60.
  integer, parameter :: max_steps = 100

  integer, parameter :: newton_steps = 40  !! Newton steps from one start; the method needs 3 to 6.
  !> Halvings of one step in the line search, and steps that end at the boundary, before the edges take over.
  integer, parameter :: max_halvings = 30, max_clipped = 4
  !> The Hessian is positive definite enough for Newton's step where its determinant exceeds this fraction of the
  !> determinant of J^T J; otherwise Gauss-Newton's step is taken.
  real(dp), parameter :: min_determinant = 1.0e-3_dp
  !> More starts on facets that are not convex: corners of a square of this half width around the centre of a
  !> quadrilateral and of a triangle, and a point near the corner 1 of a triangle, where that square would leave it.
  real(dp), parameter :: quadrilateral_start = 0.6_dp, triangle_start = 0.15_dp, corner_start = 0.1_dp

contains

  !> Closest point of a facet to a given point.
  pure subroutine closest_point_on_facet(set, facet, x, xi, square)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: x(3)  !! Given point (3) [length].
    real(dp), intent(out) :: xi(2)  !! Reference coordinates of the closest point (2) [].
    real(dp), intent(out) :: square  !! Squared distance [length^2].
    real(dp) :: q(3), farthest
    logical :: convex
    q = x - set%origin(:, facet)
    if (set%corners(facet) == 2) then
      call closest_on_curve(set%coefficient(:, 1, facet) - q, set%coefficient(:, 2, facet), &
                            set%coefficient(:, 3, facet), -1.0_dp, huge(square), xi(1), square)
      xi(2) = 0
      return
    end if
    farthest = norm2(max(abs(x - set%lo(:, facet)), abs(x - set%hi(:, facet))))
    convex = farthest < set%reach(facet)
    call closest_on_face(set%corners(facet), set%coefficient(:, :, facet), set%affine(facet), convex, q, xi, square)
  end subroutine closest_point_on_facet

  !> Closest point of a triangle or quadrilateral.
  pure subroutine closest_on_face(corners, c, affine, convex, q, xi, square)
    integer, intent(in) :: corners  !! Number of corners, 3 or 4.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    logical, intent(in) :: affine  !! The map is affine.
    logical, intent(in) :: convex  !! The squared distance is convex on the facet: there is one minimum.
    real(dp), intent(in) :: q(3)  !! Given point relative to the origin of the facet (3) [length].
    real(dp), intent(out) :: xi(2)  !! Reference coordinates of the closest point (2) [].
    real(dp), intent(out) :: square  !! Squared distance [length^2].
    real(dp) :: trial(2), value, centre(2)
    integer :: edge, best_edge, i, j
    logical :: inside
    centre = merge(1/3.0_dp, 0.0_dp, corners == 3)
    xi = centre
    call descend(corners, c, affine, q, xi, square, inside)
    if (inside .and. (convex .or. affine)) return
    best_edge = 0
    do edge = 1, corners
      call closest_on_edge(corners, edge, c, q, square, trial, value)
      if (value < square) then
        xi = trial
        square = value
        best_edge = edge
      end if
    end do
    if (affine) return
    if (best_edge > 0) then
      trial = xi
      call descend_and_keep(corners, c, q, trial, xi, square)
    end if
    if (convex) return
    do j = -1, 1, 2
      do i = -1, 1, 2
        if (corners == 4) then
          trial = [quadrilateral_start*i, quadrilateral_start*j]
        else if (i + j < 2) then
          trial = centre + triangle_start*[real(i, dp), real(j, dp)]
        else
          trial = [corner_start, corner_start]
        end if
        call descend_and_keep(corners, c, q, trial, xi, square)
      end do
    end do
  end subroutine closest_on_face

  !> Descend from one more start and keep the result if it is closer.
  pure subroutine descend_and_keep(corners, c, q, start, xi, square)
    integer, intent(in) :: corners  !! Number of corners, 3 or 4.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: q(3)  !! Given point relative to the origin of the facet (3) [length].
    real(dp), intent(in) :: start(2)  !! Start in reference coordinates (2) [].
    real(dp), intent(inout) :: xi(2)  !! Closest point so far in reference coordinates (2) [].
    real(dp), intent(inout) :: square  !! Its squared distance [length^2].
    real(dp) :: trial_square, point(2)
    logical :: inside
    point = start
    call descend(corners, c, .false., q, point, trial_square, inside)
    if (trial_square < square) then
      xi = point
      square = trial_square
    end if
  end subroutine descend_and_keep

  !> Newton's method on half the squared distance, inside the reference domain. It ends at a stationary point inside, or
  !> at the boundary if the step leads out (the closest points of the edges take over there). The distance never
  !> increases.
  pure subroutine descend(corners, c, affine, q, xi, square, inside)
    integer, intent(in) :: corners  !! Number of corners, 3 or 4.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    logical, intent(in) :: affine  !! The map is affine: one step is exact.
    real(dp), intent(in) :: q(3)  !! Given point relative to the origin of the facet (3) [length].
    real(dp), intent(inout) :: xi(2)  !! Start on entry, last point on return, in reference coordinates (2) [].
    real(dp), intent(out) :: square  !! Squared distance of the last point [length^2].
    logical, intent(out) :: inside  !! The last point is a stationary point.
    real(dp) :: x(3), xu(3), xv(3), xuu(3), xuv(3), xvv(3), g(2), a, b, d, a0, b0, d0, determinant, s(2), trial(2)
    real(dp) :: longest, fraction, value
    integer :: step, halving, n_clipped
    inside = .false.
    n_clipped = 0
    call evaluate(corners, c, xi(1), xi(2), x, xu, xv, xuu, xuv, xvv)
    x = x - q
    square = dot_product(x, x)
    do step = 1, newton_steps
      g = [dot_product(x, xu), dot_product(x, xv)]
      a0 = dot_product(xu, xu)
      b0 = dot_product(xu, xv)
      d0 = dot_product(xv, xv)
      a = a0 + dot_product(x, xuu)
      b = b0 + dot_product(x, xuv)
      d = d0 + dot_product(x, xvv)
      determinant = a*d - b*b
      if (.not. (a + d > 0 .and. determinant > min_determinant*(a0*d0 - b0*b0))) then
        a = a0   ! Gauss-Newton: always a descent direction
        b = b0
        d = d0
        determinant = a*d - b*b
      end if
      if (.not. determinant > 0) return
      s = [b*g(2) - d*g(1), b*g(1) - a*g(2)]/determinant
      longest = longest_step(corners, xi, s)
      if (affine) then
        inside = longest >= 1
        if (.not. inside) return
      end if
      if (longest < 1) then
        n_clipped = n_clipped + 1
        if (n_clipped > max_clipped) return
        if (longest < rounding) then
          s = -g/(a0 + d0)
          longest = longest_step(corners, xi, s)
          if (longest < rounding) return
        end if
      end if
      fraction = min(1.0_dp, longest)
      do halving = 1, max_halvings
        trial = xi + fraction*s
        call evaluate(corners, c, trial(1), trial(2), x, xu, xv, xuu, xuv, xvv)
        x = x - q
        value = dot_product(x, x)
        if (value <= square*(1 + 4*epsilon(square))) exit
        fraction = fraction/2
      end do
      if (halving > max_halvings) return
      xi = trial
      square = value
      if (affine) return
      if (fraction >= 1 .and. maxval(abs(s)) < same_number) then
        inside = .true.
        return
      end if
    end do
  end subroutine descend

  !> As `evaluate_facet`, without the coefficients that vanish for triangles: searches spend most of their time here.
  pure subroutine evaluate(corners, c, u, v, x, xu, xv, xuu, xuv, xvv)
    integer, intent(in) :: corners  !! Number of corners, 3 or 4.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: u  !! First reference coordinate [].
    real(dp), intent(in) :: v  !! Second reference coordinate [].
    real(dp), intent(out) :: x(3)  !! Position (3) [length].
    real(dp), intent(out) :: xu(3)  !! Derivative with respect to u (3) [length].
    real(dp), intent(out) :: xv(3)  !! Derivative with respect to v (3) [length].
    real(dp), intent(out) :: xuu(3)  !! Second derivative with respect to u (3) [length].
    real(dp), intent(out) :: xuv(3)  !! Mixed derivative (3) [length].
    real(dp), intent(out) :: xvv(3)  !! Second derivative with respect to v (3) [length].
    if (corners == 3) then
      x = c(:, 1) + v*(c(:, 4) + v*c(:, 7)) + u*(c(:, 2) + v*c(:, 5) + u*c(:, 3))
      xu = c(:, 2) + v*c(:, 5) + 2*u*c(:, 3)
      xv = c(:, 4) + 2*v*c(:, 7) + u*c(:, 5)
      xuu = 2*c(:, 3)
      xuv = c(:, 5)
      xvv = 2*c(:, 7)
    else
      call evaluate_facet(c, u, v, x, xu, xv, xuu, xuv, xvv)
    end if
  end subroutine evaluate

  !> Greatest fraction, at most 1, of a step that stays in the reference domain [].
  pure real(dp) function longest_step(corners, xi, s) result(fraction)
    integer, intent(in) :: corners  !! Number of corners, 3 or 4.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) [].
    real(dp), intent(in) :: s(2)  !! Step (2) [].
    integer :: i
    fraction = 1
    if (corners == 3) then
      do i = 1, 2
        call stop_at(xi(i), -s(i))
      end do
      call stop_at(1 - sum(xi), sum(s))
    else
      do i = 1, 2
        call stop_at(1 - sign(1.0_dp, s(i))*xi(i), abs(s(i)))
      end do
    end if

  contains

    !> Stop at an edge. A point may be beyond it by rounding, and the step along it: only steps towards it count.
    pure subroutine stop_at(distance, approach)
      real(dp), intent(in) :: distance  !! Distance of the point from the edge, negative beyond it [].
      real(dp), intent(in) :: approach  !! Part of the step towards the edge [].
      if (approach > max(distance, 0.0_dp)) fraction = min(fraction, max(distance, 0.0_dp)/approach)
    end subroutine stop_at
  end function longest_step

  !> Closest point of an edge. Edges are numbered as by gmsh: edge i goes from corner i to the next one.
  pure subroutine closest_on_edge(corners, edge, c, q, bound, xi, square)
    integer, intent(in) :: corners  !! Number of corners, 3 or 4.
    integer, intent(in) :: edge  !! Edge number.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: q(3)  !! Given point relative to the origin of the facet (3) [length].
    real(dp), intent(in) :: bound  !! Squared distance beyond which the closest point does not matter [length^2].
    real(dp), intent(out) :: xi(2)  !! Reference coordinates of the closest point (2) [].
    real(dp), intent(out) :: square  !! Squared distance; greater than `bound` where it does not matter [length^2].
    real(dp) :: t
    integer :: s
    if (corners == 3) then
      select case (edge)
      case (1)
        call closest_on_curve(c(:, 1) - q, c(:, 2), c(:, 3), 0.0_dp, bound, t, square)
        xi = [t, 0.0_dp]
      case (2)
        call closest_on_curve(c(:, 1) + c(:, 2) + c(:, 3) - q, c(:, 4) - c(:, 2) - 2*c(:, 3) + c(:, 5), &
                              c(:, 3) + c(:, 7) - c(:, 5), 0.0_dp, bound, t, square)
        xi = [1 - t, t]
      case default
        call closest_on_curve(c(:, 1) - q, c(:, 4), c(:, 7), 0.0_dp, bound, t, square)
        xi = [0.0_dp, t]
      end select
    else if (edge == 1 .or. edge == 3) then
      s = edge - 2
      call closest_on_curve(c(:, 1) + s*c(:, 4) + c(:, 7) - q, c(:, 2) + s*c(:, 5) + c(:, 8), &
                            c(:, 3) + s*c(:, 6) + c(:, 9), -1.0_dp, bound, t, square)
      xi = [t, real(s, dp)]
    else
      s = 3 - edge
      call closest_on_curve(c(:, 1) + s*c(:, 2) + c(:, 3) - q, c(:, 4) + s*c(:, 5) + c(:, 6), &
                            c(:, 7) + s*c(:, 8) + c(:, 9), -1.0_dp, bound, t, square)
      xi = [real(s, dp), t]
    end if
  end subroutine closest_on_edge

  !> Edges of a facet (for a line: end points, 1 first, 2 last) that contain a point, up to a tolerance.
  pure subroutine edges_at(corners, xi, tolerance, n, edges)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) []; the second is 0 for lines.
    real(dp), intent(in) :: tolerance  !! Tolerance in reference coordinates [].
    integer, intent(out) :: n  !! Number of such edges: 0 inside, 2 at a corner.
    integer, intent(out) :: edges(2)  !! Edge numbers, ascending (2); the first n are set.
    logical :: on(4)
    integer :: i
    on = .false.
    select case (corners)
    case (2)
      on(1:2) = [xi(1) <= tolerance - 1, xi(1) >= 1 - tolerance]
    case (3)
      on(1:3) = [xi(2) <= tolerance, sum(xi) >= 1 - tolerance, xi(1) <= tolerance]
    case default
      on = [xi(2) <= tolerance - 1, xi(1) >= 1 - tolerance, xi(2) >= 1 - tolerance, xi(1) <= tolerance - 1]
    end select
    n = 0
    edges = 0
    do i = 1, corners
      if (.not. on(i) .or. n == 2) cycle
      n = n + 1
      edges(n) = i
    end do
  end subroutine edges_at

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
    distance = max(0.0_dp, norm2(first + t*along) - height - same_number*sqrt(length))
    beyond = (1 - same_number)*distance**2 > square
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
end module dotyk_contact_closest_point
