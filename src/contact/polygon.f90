!> Polygons in the plane with few corners: clipping, clean-up, area, triangles.
module dotyk_contact_polygon
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: signed_area, clip_polygon, tidy_polygon, triangulate, is_parallelogram, contains_point, append_corner

  !> Most corners of a polygon.
  integer, parameter, public :: most_corners = 32

  !> A polygon.
  type, public :: polygon_t
    !> Number of corners.
    integer :: n = 0
    !> Corners, counter-clockwise where the area is positive (2, most_corners).
    real(dp) :: x(2, most_corners) = 0
  end type polygon_t

contains

  !> Add a corner at the end; what is too much is left out, and `n` tells.
  pure subroutine append_corner(polygon, x)
    type(polygon_t), intent(inout) :: polygon
    !> (2).
    real(dp), intent(in) :: x(2)
    polygon%n = polygon%n + 1
    if (polygon%n <= most_corners) polygon%x(:, polygon%n) = x
  end subroutine append_corner

  !> Area, negative where the corners run clockwise.
  pure real(dp) function signed_area(polygon) result(area)
    type(polygon_t), intent(in) :: polygon
    integer :: i
    area = 0
    do i = 2, polygon%n - 1
      area = area + cross(polygon%x(:, i) - polygon%x(:, 1), polygon%x(:, i + 1) - polygon%x(:, 1))/2
    end do
  end function signed_area

  !> Cut off what lies outside a convex window (Sutherland and Hodgman). Corners within round-off of an edge of the window
  !> lie on it. What the window parts into several pieces stays connected by edges that are run through twice.
  pure subroutine clip_polygon(polygon, window, tolerance, ok)
    type(polygon_t), intent(inout) :: polygon
    !> Convex, counter-clockwise.
    type(polygon_t), intent(in) :: window
    !> Distance that counts as none.
    real(dp), intent(in) :: tolerance
    !> There was room for all corners.
    logical, intent(out) :: ok
    type(polygon_t) :: old
    real(dp) :: edge(2), side(most_corners)
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
      ok = polygon%n <= most_corners
      if (.not. ok) return
    end do
  end subroutine clip_polygon

  !> Remove corners that repeat, and those on the straight line between their neighbours.
  pure subroutine tidy_polygon(polygon, tolerance)
    type(polygon_t), intent(inout) :: polygon
    !> Distance that counts as none.
    real(dp), intent(in) :: tolerance
    real(dp) :: before(2), after(2)
    integer :: i, kept
    logical :: again
    again = .true.
    do while (again .and. polygon%n >= 3)
      again = .false.
      do i = 1, polygon%n
        before = polygon%x(:, i) - polygon%x(:, modulo(i - 2, polygon%n) + 1)
        after = polygon%x(:, mod(i, polygon%n) + 1) - polygon%x(:, i)
        if (norm2(before) > tolerance .and. norm2(after) > tolerance) then
          if (abs(cross(before, after)) > tolerance*norm2(before + after)) cycle
        end if
        do kept = i, polygon%n - 1
          polygon%x(:, kept) = polygon%x(:, kept + 1)
        end do
        polygon%n = polygon%n - 1
        again = .true.
        exit
      end do
    end do
    if (polygon%n < 3) polygon%n = 0
  end subroutine tidy_polygon

  !> Triangles of a polygon by cutting off ears: of those there are, the one with the best shape, so that no needles arise
  !> where they can be helped.
  pure subroutine triangulate(polygon, n, triangle, ok)
    !> Counter-clockwise, without corners that repeat.
    type(polygon_t), intent(in) :: polygon
    !> Number of triangles.
    integer, intent(out) :: n
    !> Their corners (2, 3, n).
    real(dp), intent(out) :: triangle(2, 3, most_corners)
    !> They make up the whole polygon.
    logical, intent(out) :: ok
    type(polygon_t) :: rest
    real(dp) :: shape, best
    integer :: i, k
    rest = polygon
    n = 0
    ok = rest%n >= 3
    do while (rest%n >= 3)
      best = 0
      k = 0
      do i = 1, rest%n
        shape = ear(rest, i)
        if (shape <= best) cycle
        best = shape
        k = i
      end do
      if (k == 0) then
        ok = abs(signed_area(rest)) <= 1e-13_dp*abs(signed_area(polygon))
        return
      end if
      n = n + 1
      triangle(:, 1, n) = rest%x(:, modulo(k - 2, rest%n) + 1)
      triangle(:, 2, n) = rest%x(:, k)
      triangle(:, 3, n) = rest%x(:, mod(k, rest%n) + 1)
      do i = k, rest%n - 1
        rest%x(:, i) = rest%x(:, i + 1)
      end do
      rest%n = rest%n - 1
    end do
  end subroutine triangulate

  !> Quality of a corner as an ear: twice its area over the square of its longest side; 0 where it is none.
  pure real(dp) function ear(polygon, i) result(shape)
    type(polygon_t), intent(in) :: polygon
    integer, intent(in) :: i
    real(dp) :: a(2), b(2), c(2), p(2)
    integer :: before, after, j
    shape = 0
    before = modulo(i - 2, polygon%n) + 1
    after = mod(i, polygon%n) + 1
    a = polygon%x(:, before)
    b = polygon%x(:, i)
    c = polygon%x(:, after)
    if (cross(b - a, c - b) <= 0) return
    do j = 1, polygon%n
      if (j == before .or. j == i .or. j == after) cycle
      p = polygon%x(:, j)
      if (cross(b - a, p - a) > 0 .and. cross(c - b, p - b) > 0 .and. cross(a - c, p - c) > 0) return
    end do
    shape = cross(b - a, c - b)/max(sum((b - a)**2), sum((c - b)**2), sum((a - c)**2))
  end function ear

  !> Four corners, opposite sides parallel.
  pure logical function is_parallelogram(polygon)
    type(polygon_t), intent(in) :: polygon
    associate (x => polygon%x)
      is_parallelogram = polygon%n == 4
      if (is_parallelogram) is_parallelogram = norm2(x(:, 1) - x(:, 2) + x(:, 3) - x(:, 4)) &
                                               <= 1e-12_dp*norm2(x(:, 3) - x(:, 1))
    end associate
  end function is_parallelogram

  !> A point lies in a polygon or nearer to it than a tolerance (crossings of a ray; then the distance to the edges).
  pure logical function contains_point(polygon, p, tolerance) result(inside)
    type(polygon_t), intent(in) :: polygon
    !> (2).
    real(dp), intent(in) :: p(2)
    real(dp), intent(in) :: tolerance
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

  !> Vector product in the plane.
  pure real(dp) function cross(a, b)
    real(dp), intent(in) :: a(2), b(2)
    cross = a(1)*b(2) - a(2)*b(1)
  end function cross
end module dotyk_contact_polygon
