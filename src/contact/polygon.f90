!> Polygons in the plane with few corners: clipping (Sutherland and Hodgman, Commun. ACM 17, 1974), removal of
!> degenerate corners, area, triangulation by ear clipping.
module dotyk_contact_polygon
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: given_rounding, rounding
  implicit none
  private
  public :: append_corner, clip_polygon, contains_point, is_parallelogram, remove_degenerate_corners, signed_area, &
    triangulate

  integer, parameter, public :: max_corners = 32  !! Greatest number of corners of a polygon.

  type, public :: polygon_t  !! Polygon.
    integer :: n = 0  !! Number of corners; above `max_corners` where the polygon did not fit.
    real(dp) :: x(2, max_corners) = 0  !! Corners, counter-clockwise where the area is positive (2, max_corners) [any].
  end type polygon_t

contains

  !> Append a corner. A corner for which there is no room is dropped, which `n` shows.
  pure subroutine append_corner(polygon, x)
    type(polygon_t), intent(inout) :: polygon  !! Polygon.
    real(dp), intent(in) :: x(2)  !! Corner (2) [any].
    polygon%n = polygon%n + 1
    if (polygon%n <= max_corners) polygon%x(:, polygon%n) = x
  end subroutine append_corner

  !> Area, negative where the corners run clockwise [length^2].
  pure real(dp) function signed_area(polygon) result(area)
    type(polygon_t), intent(in) :: polygon  !! Polygon.
    integer :: i
    area = 0
    do i = 2, polygon%n - 1
      area = area + cross(polygon%x(:, i) - polygon%x(:, 1), polygon%x(:, i + 1) - polygon%x(:, 1))/2
    end do
  end function signed_area

  !> Clip a polygon against a convex window (Sutherland and Hodgman). Corners within a tolerance of an edge of the
  !> window lie on it. A polygon that the window cuts into several parts stays connected by edges that are passed twice.
  pure subroutine clip_polygon(polygon, window, tolerance, ok)
    type(polygon_t), intent(inout) :: polygon  !! Polygon, clipped on return.
    type(polygon_t), intent(in) :: window  !! Convex window, counter-clockwise.
    real(dp), intent(in) :: tolerance  !! Distance that counts as zero [as the corners].
    logical, intent(out) :: ok  !! All corners fit.
    type(polygon_t) :: old
    real(dp) :: edge(2), side(max_corners)
    integer :: e, i, k
    ok = .true.
    do e = 1, window%n
      if (polygon%n < 3) exit
      edge = window%x(:, mod(e, window%n) + 1) - window%x(:, e)
      edge = edge/norm2(edge)
      old = polygon
      do i = 1, old%n
        side(i) = cross(edge, old%x(:, i) - window%x(:, e))
        if (abs(side(i)) <= tolerance) side(i) = 0
      end do
      if (all(side(1:old%n) >= 0)) cycle
      polygon%n = 0
      do i = 1, old%n
        k = mod(i, old%n) + 1
        if (side(i) >= 0) call append_corner(polygon, old%x(:, i))
        if ((side(i) > 0 .and. side(k) < 0) .or. (side(i) < 0 .and. side(k) > 0)) &
          call append_corner(polygon, (side(i)*old%x(:, k) - side(k)*old%x(:, i))/(side(i) - side(k)))
      end do
      ok = polygon%n <= max_corners
      if (.not. ok) return
    end do
  end subroutine clip_polygon

  !> Remove repeated corners and corners on the straight line between their neighbours.
  pure subroutine remove_degenerate_corners(polygon, tolerance)
    type(polygon_t), intent(inout) :: polygon  !! Polygon; empty on return if it degenerates.
    real(dp), intent(in) :: tolerance  !! Distance that counts as zero [as the corners].
    real(dp) :: previous(2), next(2)
    integer :: i, kept
    logical :: changed
    changed = .true.
    do while (changed .and. polygon%n >= 3)
      changed = .false.
      do i = 1, polygon%n
        previous = polygon%x(:, i) - polygon%x(:, modulo(i - 2, polygon%n) + 1)
        next = polygon%x(:, mod(i, polygon%n) + 1) - polygon%x(:, i)
        if (norm2(previous) > tolerance .and. norm2(next) > tolerance) then
          if (abs(cross(previous, next)) > tolerance*norm2(previous + next)) cycle
        end if
        do kept = i, polygon%n - 1
          polygon%x(:, kept) = polygon%x(:, kept + 1)
        end do
        polygon%n = polygon%n - 1
        changed = .true.
        exit
      end do
    end do
    if (polygon%n < 3) polygon%n = 0
  end subroutine remove_degenerate_corners

  !> Triangulate a polygon by ear clipping: the ear of best shape first, to avoid slivers.
  pure subroutine triangulate(polygon, n, triangle, ok)
    type(polygon_t), intent(in) :: polygon  !! Polygon, counter-clockwise, without repeated corners.
    integer, intent(out) :: n  !! Number of triangles.
    !> Corners of the triangles (2, 3, max_corners) [as the corners]; the first n triangles are set.
    real(dp), intent(out) :: triangle(2, 3, max_corners)
    logical, intent(out) :: ok  !! The triangles cover the polygon.
    type(polygon_t) :: remainder
    real(dp) :: shape, best
    integer :: i, k
    remainder = polygon
    n = 0
    ok = remainder%n >= 3
    do while (remainder%n >= 3)
      best = 0
      k = 0
      do i = 1, remainder%n
        shape = ear_quality(remainder, i)
        if (shape <= best) cycle
        best = shape
        k = i
      end do
      if (k == 0) then
        ok = abs(signed_area(remainder)) <= given_rounding*abs(signed_area(polygon))
        return
      end if
      n = n + 1
      triangle(:, 1, n) = remainder%x(:, modulo(k - 2, remainder%n) + 1)
      triangle(:, 2, n) = remainder%x(:, k)
      triangle(:, 3, n) = remainder%x(:, mod(k, remainder%n) + 1)
      do i = k, remainder%n - 1
        remainder%x(:, i) = remainder%x(:, i + 1)
      end do
      remainder%n = remainder%n - 1
    end do
  end subroutine triangulate

  !> Quality of a corner as an ear, twice the area over the square of the longest side; 0 where the corner is no ear
  !> [].
  pure real(dp) function ear_quality(polygon, i) result(shape)
    type(polygon_t), intent(in) :: polygon  !! Polygon.
    integer, intent(in) :: i  !! Corner.
    real(dp) :: a(2), b(2), c(2), p(2)
    integer :: previous, next, j
    shape = 0
    previous = modulo(i - 2, polygon%n) + 1
    next = mod(i, polygon%n) + 1
    a = polygon%x(:, previous)
    b = polygon%x(:, i)
    c = polygon%x(:, next)
    if (cross(b - a, c - b) <= 0) return
    do j = 1, polygon%n
      if (j == previous .or. j == i .or. j == next) cycle
      p = polygon%x(:, j)
      if (cross(b - a, p - a) > 0 .and. cross(c - b, p - b) > 0 .and. cross(a - c, p - c) > 0) return
    end do
    shape = cross(b - a, c - b)/max(sum((b - a)**2), sum((c - b)**2), sum((a - c)**2))
  end function ear_quality

  !> Whether a polygon is a parallelogram.
  pure logical function is_parallelogram(polygon)
    type(polygon_t), intent(in) :: polygon  !! Polygon.
    associate (x => polygon%x)
      is_parallelogram = polygon%n == 4
      if (is_parallelogram) &
        is_parallelogram = norm2(x(:, 1) - x(:, 2) + x(:, 3) - x(:, 4)) <= &
                           rounding*norm2(x(:, 3) - x(:, 1))
    end associate
  end function is_parallelogram

  !> Whether a point lies in a polygon or within a tolerance of its edges (even-odd rule).
  pure logical function contains_point(polygon, p, tolerance) result(inside)
    type(polygon_t), intent(in) :: polygon  !! Polygon.
    real(dp), intent(in) :: p(2)  !! Point (2) [as the corners].
    real(dp), intent(in) :: tolerance  !! Tolerance [as the corners].
    real(dp) :: a(2), b(2), t
    integer :: i
    inside = .false.
    do i = 1, polygon%n
      a = polygon%x(:, i) - p
      b = polygon%x(:, mod(i, polygon%n) + 1) - p
      t = max(0.0_dp, min(1.0_dp, -dot_product(a, b - a)/max(sum((b - a)**2), tiny(t))))
      if (norm2(a + t*(b - a)) <= tolerance) then
        inside = .true.
        return
      end if
      if ((a(2) > 0) .neqv. (b(2) > 0)) then
        if (a(1) - a(2)*(b(1) - a(1))/(b(2) - a(2)) > 0) inside = .not. inside
      end if
    end do
  end function contains_point

  !> Vector product in the plane [any].
  pure real(dp) function cross(a, b)
    real(dp), intent(in) :: a(2)  !! First vector (2) [any].
    real(dp), intent(in) :: b(2)  !! Second vector (2) [any].
    cross = a(1)*b(2) - a(2)*b(1)
  end function cross
end module dotyk_contact_polygon
