!> The closest point of one facet to a given point, edges and corners included.
!>
!> The distance to an edge, a quadratic curve, is minimised exactly: its derivative is a cubic, whose roots are
!> isolated by those of its derivative. In the interior a safeguarded Newton method runs on the squared distance: from
!> one start where that is convex on the facet, from several where it is not. The least of all candidates is the
!> closest point.
module dotyk_contact_closest_point
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_set, only: evaluate_facet, facet_set_t
  implicit none
  private
  public :: closest_point_on_facet, edges_at

  !> Steps of Newton's method from one start; it needs 3 to 6.
  integer, parameter :: most_steps = 40

contains

  !> Closest point of a facet.
  pure subroutine closest_point_on_facet(set, facet, x, xi, square)
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: facet
    !> Given point (3) [length].
    real(dp), intent(in) :: x(3)
    !> Reference coordinates of the closest point (2).
    real(dp), intent(out) :: xi(2)
    !> Squared distance [length^2].
    real(dp), intent(out) :: square
    real(dp) :: q(3), farthest
    logical :: convex
    q = x - set%origin(:, facet)
    if (set%corners(facet) == 2) then
      call closest_on_curve(set%coefficient(:, 1, facet) - q, set%coefficient(:, 2, facet), &
                            set%coefficient(:, 3, facet), -1.0_dp, xi(1), square)
      xi(2) = 0
      return
    end if
    farthest = norm2(max(abs(x - set%lo(:, facet)), abs(x - set%hi(:, facet))))
    convex = farthest < set%reach(facet)
    call closest_on_patch(set%corners(facet), set%coefficient(:, :, facet), set%affine(facet), convex, q, xi, square)
  end subroutine closest_point_on_facet

  !> Closest point of a triangle or quadrilateral.
  pure subroutine closest_on_patch(corners, c, affine, convex, q, xi, square)
    integer, intent(in) :: corners
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    !> The map is affine.
    logical, intent(in) :: affine
    !> The squared distance is convex on the facet: one minimum.
    logical, intent(in) :: convex
    !> Given point relative to the facet's origin (3).
    real(dp), intent(in) :: q(3)
    real(dp), intent(out) :: xi(2)
    real(dp), intent(out) :: square
    real(dp) :: trial(2), value, centre(2)
    integer :: edge, best_edge, i, j
    logical :: inside
    centre = merge(1/3.0_dp, 0.0_dp, corners == 3)
    xi = centre
    call descend(corners, c, affine, q, xi, square, inside)
    if (inside .and. (convex .or. affine)) return
    best_edge = 0
    do edge = 1, corners
      call closest_on_edge(corners, edge, c, q, trial, value)
      if (value < square) then
        xi = trial
        square = value
        best_edge = edge
      end if
    end do
    if (affine) return
    if (best_edge > 0) then
      trial = xi
      call keep_better(corners, c, q, trial, xi, square)
    end if
    if (convex) return
    do j = -1, 1, 2
      do i = -1, 1, 2
        if (corners == 4) then
          trial = [0.6_dp*i, 0.6_dp*j]
        else if (i + j < 2) then
          trial = centre + 0.15_dp*[real(i, dp), real(j, dp)]
        else
          trial = [0.1_dp, 0.1_dp]
        end if
        call keep_better(corners, c, q, trial, xi, square)
      end do
    end do
  end subroutine closest_on_patch

  !> Descend from one more start and keep what is better.
  pure subroutine keep_better(corners, c, q, start, xi, square)
    integer, intent(in) :: corners
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    !> Given point relative to the facet's origin (3).
    real(dp), intent(in) :: q(3)
    !> Where to start (2).
    real(dp), intent(in) :: start(2)
    !> The best point so far (2) and its squared distance.
    real(dp), intent(inout) :: xi(2), square
    real(dp) :: its_square, point(2)
    logical :: inside
    point = start
    call descend(corners, c, .false., q, point, its_square, inside)
    if (its_square < square) then
      xi = point
      square = its_square
    end if
  end subroutine keep_better

  !> Newton's method on half the squared distance, inside the reference domain. Ends at a stationary point inside, or
  !> on the boundary where the step leads out (there the closest points of the edges take over). Never ends higher
  !> than it began.
  pure subroutine descend(corners, c, affine, q, xi, square, inside)
    integer, intent(in) :: corners
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    logical, intent(in) :: affine
    !> Given point relative to the facet's origin (3).
    real(dp), intent(in) :: q(3)
    !> Start on entry, last point on return (2).
    real(dp), intent(inout) :: xi(2)
    !> Squared distance there.
    real(dp), intent(out) :: square
    !> Ended at a stationary point.
    logical, intent(out) :: inside
    real(dp) :: x(3), xu(3), xv(3), xuu(3), xuv(3), xvv(3), g(2), a, b, d, a0, b0, d0, determinant, s(2), longest, part
    real(dp) :: trial(2), value
    integer :: step, halving, clipped
    inside = .false.
    clipped = 0
    call evaluate_facet(c, xi(1), xi(2), x, xu, xv, xuu, xuv, xvv)
    x = x - q
    square = dot_product(x, x)
    do step = 1, most_steps
      g = [dot_product(x, xu), dot_product(x, xv)]
      a0 = dot_product(xu, xu)
      b0 = dot_product(xu, xv)
      d0 = dot_product(xv, xv)
      a = a0 + dot_product(x, xuu)
      b = b0 + dot_product(x, xuv)
      d = d0 + dot_product(x, xvv)
      determinant = a*d - b*b
      if (.not. (a + d > 0 .and. determinant > 1e-3_dp*(a0*d0 - b0*b0))) then
        a = a0   ! Gauss-Newton, always downhill
        b = b0
        d = d0
        determinant = a*d - b*b
      end if
      if (.not. determinant > 0) return
      s = [b*g(2) - d*g(1), b*g(1) - a*g(2)]/determinant
      longest = most_step(corners, xi, s)
      if (affine) then
        ! The squared distance is a quadratic polynomial: one step is exact.
        inside = longest >= 1
        if (.not. inside) return
      end if
      if (longest < 1) then
        clipped = clipped + 1
        if (clipped > 4) return
        if (longest < 1e-12_dp) then
          s = -g/(a0 + d0)
          longest = most_step(corners, xi, s)
          if (longest < 1e-12_dp) return
        end if
      end if
      part = min(1.0_dp, longest)
      do halving = 1, 30
        trial = xi + part*s
        call evaluate_facet(c, trial(1), trial(2), x, xu, xv, xuu, xuv, xvv)
        x = x - q
        value = dot_product(x, x)
        if (value <= square*(1 + 4*epsilon(square))) exit
        part = part/2
      end do
      if (halving > 30) return
      xi = trial
      square = value
      if (affine) return
      if (part >= 1 .and. maxval(abs(s)) < 1e-9_dp) then
        inside = .true.
        return
      end if
    end do
  end subroutine descend

  !> The greatest part, at most 1, of a step that stays in the reference domain.
  pure real(dp) function most_step(corners, xi, s) result(part)
    integer, intent(in) :: corners
    real(dp), intent(in) :: xi(2), s(2)
    integer :: i
    part = 1
    if (corners == 3) then
      do i = 1, 2
        if (xi(i) + s(i) < 0) part = min(part, xi(i)/(-s(i)))
      end do
      if (sum(xi + s) > 1) part = min(part, (1 - sum(xi))/sum(s))
    else
      do i = 1, 2
        if (abs(xi(i) + s(i)) > 1) part = min(part, (sign(1.0_dp, s(i)) - xi(i))/s(i))
      end do
    end if
    part = max(part, 0.0_dp)
  end function most_step

  !> Closest point of an edge; edges are numbered as gmsh's, edge i from corner i to the next one.
  pure subroutine closest_on_edge(corners, edge, c, q, xi, square)
    integer, intent(in) :: corners, edge
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    !> Given point (3).
    real(dp), intent(in) :: q(3)
    real(dp), intent(out) :: xi(2)
    real(dp), intent(out) :: square
    real(dp) :: t
    integer :: s
    if (corners == 3) then
      select case (edge)
      case (1)
        call closest_on_curve(c(:, 1) - q, c(:, 2), c(:, 3), 0.0_dp, t, square)
        xi = [t, 0.0_dp]
      case (2)
        call closest_on_curve(c(:, 1) + c(:, 2) + c(:, 3) - q, c(:, 4) - c(:, 2) - 2*c(:, 3) + c(:, 5), &
                              c(:, 3) + c(:, 7) - c(:, 5), 0.0_dp, t, square)
        xi = [1 - t, t]
      case default
        call closest_on_curve(c(:, 1) - q, c(:, 4), c(:, 7), 0.0_dp, t, square)
        xi = [0.0_dp, t]
      end select
    else if (edge == 1 .or. edge == 3) then
      s = edge - 2
      call closest_on_curve(c(:, 1) + s*c(:, 4) + c(:, 7) - q, c(:, 2) + s*c(:, 5) + c(:, 8), &
                            c(:, 3) + s*c(:, 6) + c(:, 9), -1.0_dp, t, square)
      xi = [t, real(s, dp)]
    else
      s = 3 - edge
      call closest_on_curve(c(:, 1) + s*c(:, 2) + c(:, 3) - q, c(:, 4) + s*c(:, 5) + c(:, 6), &
                            c(:, 7) + s*c(:, 8) + c(:, 9), -1.0_dp, t, square)
      xi = [real(s, dp), t]
    end if
  end subroutine closest_on_edge

  !> The point of a0 + a1 t + a2 t^2, first <= t <= 1, that is closest to the origin.
  pure subroutine closest_on_curve(a0, a1, a2, first, t, square)
    !> Coefficients (3).
    real(dp), intent(in) :: a0(3), a1(3), a2(3)
    !> Lower end of t.
    real(dp), intent(in) :: first
    real(dp), intent(out) :: t
    real(dp), intent(out) :: square
    real(dp) :: b(0:3), ends(4), discriminant, root, q, low, high
    integer :: n, i
    b = [dot_product(a0, a1), dot_product(a1, a1) + 2*dot_product(a0, a2), 3*dot_product(a1, a2), 2*dot_product(a2, a2)]
    ! Where a2 is below round-off of a1 the edge is straight.
    if (b(3) <= 1e-29_dp*dot_product(a1, a1)) then
      t = first
      if (dot_product(a1, a1) > 0) t = max(first, min(1.0_dp, -b(0)/dot_product(a1, a1)))
      square = sum((a0 + t*a1)**2)
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
    call take_if_closer(a0, a1, a2, 1.0_dp, t, square)
    do i = 1, n
      if (.not. (cubic(b, ends(i)) < 0 .and. cubic(b, ends(i + 1)) > 0)) cycle
      root = root_between(b, ends(i), ends(i + 1))
      call take_if_closer(a0, a1, a2, root, t, square)
    end do
  end subroutine closest_on_curve

  !> Value of a cubic.
  pure real(dp) function cubic(b, t)
    !> Coefficients.
    real(dp), intent(in) :: b(0:3)
    real(dp), intent(in) :: t
    cubic = b(0) + t*(b(1) + t*(b(2) + t*b(3)))
  end function cubic

  !> Keep a point of a curve that is closer to the origin.
  pure subroutine take_if_closer(a0, a1, a2, at, t, square)
    !> Coefficients of the curve (3).
    real(dp), intent(in) :: a0(3), a1(3), a2(3)
    !> The point.
    real(dp), intent(in) :: at
    !> The best point so far and its squared distance.
    real(dp), intent(inout) :: t, square
    real(dp) :: value
    value = sum((a0 + at*(a1 + at*a2))**2)
    if (value < square) then
      square = value
      t = at
    end if
  end subroutine take_if_closer

  !> The root of a cubic that rises through zero between two points, monotone there: Newton's method kept in the
  !> bracket.
  pure real(dp) function root_between(b, first, last) result(t)
    !> Coefficients.
    real(dp), intent(in) :: b(0:3)
    real(dp), intent(in) :: first, last
    real(dp) :: low, high, value, derivative, previous
    integer :: step
    low = first
    high = last
    t = (low + high)/2
    do step = 1, 100
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

  !> Which edges of a facet (end points of a line: 1 first, 2 last) contain a point, to a tolerance.
  pure subroutine edges_at(corners, xi, tolerance, n, edges)
    integer, intent(in) :: corners
    !> Reference coordinates (2).
    real(dp), intent(in) :: xi(2)
    !> In reference coordinates.
    real(dp), intent(in) :: tolerance
    !> Number of such edges: 0 inside, 2 at a corner.
    integer, intent(out) :: n
    !> Their numbers, in the order of the numbers.
    integer, intent(out) :: edges(2)
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
end module dotyk_contact_closest_point
