!> Smallest distance between two facets, taken as the polygons of their corners (Ericson, Real-time collision detection,
!> 2005, sections 5.1 and 5.3). A line, in two dimensions, is a polygon with two corners; a quadrilateral is two
!> triangles.
module dotyk_contact_facet_distance
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: of_mesh, same_number
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: polygon_distance, polygons_overlap, ray_meets_polygon

  !> Polygons that only touch each other, seen along their normals, do not overlap: they shrink by this fraction [].
  real(dp), parameter :: shrinkage = 0.01_dp

contains

  !> Smallest distance of two polygons, with a pair of closest points.
  pure subroutine polygon_distance(n_p, p, n_q, q, distance, at_p, at_q)
    integer, intent(in) :: n_p  !! Number of corners of the first polygon, 2 to 4.
    real(dp), intent(in) :: p(3, n_p)  !! Its corners (3, n_p) [length].
    integer, intent(in) :: n_q  !! Number of corners of the second polygon, 2 to 4.
    real(dp), intent(in) :: q(3, n_q)  !! Its corners (3, n_q) [length].
    real(dp), intent(out) :: distance  !! Distance; 0 where they intersect [length].
    real(dp), intent(out) :: at_p(3)  !! Closest point of the first polygon (3) [length].
    real(dp), intent(out) :: at_q(3)  !! Closest point of the second polygon (3) [length].
    real(dp) :: square, x(3), y(3), normal(3, 2)
    integer :: i, j
    square = huge(square)
    at_p = p(:, 1)
    at_q = q(:, 1)
    do i = 1, merge(1, n_p, n_p == 2)
      do j = 1, merge(1, n_q, n_q == 2)
        call closest_on_segments(p(:, i), p(:, mod(i, n_p) + 1), q(:, j), q(:, mod(j, n_q) + 1), x, y)
        call keep(x, y, square, at_p, at_q)
      end do
    end do
    if (n_p > 2 .and. n_q > 2) then
      do j = 2, n_q - 1
        normal(:, j - 1) = across(q(:, 1), q(:, j), q(:, j + 1))
      end do
      do i = 1, n_p
        do j = 2, n_q - 1
          call corner_and_edge(p(:, i), p(:, mod(i, n_p) + 1), q(:, 1), q(:, j), q(:, j + 1), normal(:, j - 1), &
                               square, x, y)
          if (y(1) < huge(y)) call keep(x, y, square, at_p, at_q)
        end do
      end do
      do i = 2, n_p - 1
        normal(:, i - 1) = across(p(:, 1), p(:, i), p(:, i + 1))
      end do
      do j = 1, n_q
        do i = 2, n_p - 1
          call corner_and_edge(q(:, j), q(:, mod(j, n_q) + 1), p(:, 1), p(:, i), p(:, i + 1), normal(:, i - 1), &
                               square, y, x)
          if (x(1) < huge(x)) call keep(x, y, square, at_p, at_q)
        end do
      end do
    end if
    distance = sqrt(square)
  end subroutine polygon_distance

  !> Keep two points if they are closer to each other than the best ones so far.
  pure subroutine keep(x, y, square, at_p, at_q)
    real(dp), intent(in) :: x(3)  !! Point of the first polygon (3) [length].
    real(dp), intent(in) :: y(3)  !! Point of the second polygon (3) [length].
    real(dp), intent(inout) :: square  !! Least squared distance so far [length^2].
    real(dp), intent(inout) :: at_p(3)  !! Closest point of the first polygon so far (3) [length].
    real(dp), intent(inout) :: at_q(3)  !! Closest point of the second polygon so far (3) [length].
    if (.not. sum((x - y)**2) < square) return
    square = sum((x - y)**2)
    at_p = x
    at_q = y
  end subroutine keep

  !> Closest points of a triangle and an edge in the triangle's interior: the projection of the first end, or the point
  !> where the edge pierces the triangle.
  pure subroutine corner_and_edge(first, second, a, b, c, normal, best, x, y)
    real(dp), intent(in) :: first(3)  !! First end of the edge (3) [length].
    real(dp), intent(in) :: second(3)  !! Second end (3) [length].
    real(dp), intent(in) :: a(3)  !! First corner of the triangle (3) [length].
    real(dp), intent(in) :: b(3)  !! Second corner (3) [length].
    real(dp), intent(in) :: c(3)  !! Third corner (3) [length].
    real(dp), intent(in) :: normal(3)  !! Normal (b - a) x (c - a) (3) [length^2].
    real(dp), intent(in) :: best  !! Squared distance from which on points do not count [length^2].
    real(dp), intent(out) :: x(3)  !! Point of the edge (3) [length].
    real(dp), intent(out) :: y(3)  !! Point of the triangle; huge where there is none, or none closer (3) [length].
    real(dp) :: square, height, other
    y = huge(y)
    x = first
    square = dot_product(normal, normal)
    if (.not. square > 0) return
    height = dot_product(first - a, normal)
    other = dot_product(second - a, normal)
    if (height*other < 0) then
      x = first + height/(height - other)*(second - first)
      if (in_triangle(x, a, b, c, normal, square)) then
        y = x
        return
      end if
      x = first
    end if
    if (height**2 > (1 + same_number)*best*square) return
    if (in_triangle(first - height/square*normal, a, b, c, normal, square)) y = first - height/square*normal
  end subroutine corner_and_edge

  !> Whether a point of the plane of a triangle is in the triangle.
  pure logical function in_triangle(x, a, b, c, normal, square)
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp), intent(in) :: a(3)  !! First corner (3) [length].
    real(dp), intent(in) :: b(3)  !! Second corner (3) [length].
    real(dp), intent(in) :: c(3)  !! Third corner (3) [length].
    real(dp), intent(in) :: normal(3)  !! Normal (b - a) x (c - a) (3) [length^2].
    real(dp), intent(in) :: square  !! Its squared length [length^4].
    real(dp) :: least
    least = -same_number*square
    in_triangle = dot_product(across(a, b, x), normal) >= least .and. &
                  dot_product(across(b, c, x), normal) >= least .and. &
                  dot_product(across(c, a, x), normal) >= least
  end function in_triangle

  !> Normal (b - a) x (c - a) [length^2].
  pure function across(a, b, c) result(normal)
    real(dp), intent(in) :: a(3)  !! A point (3) [length].
    real(dp), intent(in) :: b(3)  !! Another one (3) [length].
    real(dp), intent(in) :: c(3)  !! A third one (3) [length].
    real(dp) :: normal(3), u(3), v(3)
    u = b - a
    v = c - a
    normal(1) = u(2)*v(3) - u(3)*v(2)
    normal(2) = u(3)*v(1) - u(1)*v(3)
    normal(3) = u(1)*v(2) - u(2)*v(1)
  end function across

  !> Closest points of two segments.
  pure subroutine closest_on_segments(a, b, c, d, x, y)
    real(dp), intent(in) :: a(3)  !! First end of the first segment (3) [length].
    real(dp), intent(in) :: b(3)  !! Its second end (3) [length].
    real(dp), intent(in) :: c(3)  !! First end of the second segment (3) [length].
    real(dp), intent(in) :: d(3)  !! Its second end (3) [length].
    real(dp), intent(out) :: x(3)  !! Closest point of the first segment (3) [length].
    real(dp), intent(out) :: y(3)  !! Closest point of the second segment (3) [length].
    real(dp) :: u(3), v(3), r(3), uu, vv, uv, ur, vr, s, t, det
    u = b - a
    v = d - c
    r = a - c
    uu = dot_product(u, u)
    vv = dot_product(v, v)
    uv = dot_product(u, v)
    ur = dot_product(u, r)
    vr = dot_product(v, r)
    det = uu*vv - uv*uv
    s = 0
    ! Parallel segments: any point of the first one to begin with.
    if (det > 1.0e-12_dp*uu*vv) s = min(1.0_dp, max(0.0_dp, (uv*vr - ur*vv)/det))
    t = 0
    if (vv > 0) t = (uv*s + vr)/vv
    if (t < 0 .or. t > 1) then
      t = min(1.0_dp, max(0.0_dp, t))
      if (uu > 0) s = min(1.0_dp, max(0.0_dp, (uv*t - ur)/uu))
    end if
    x = a + s*u
    y = c + t*v
  end subroutine closest_on_segments

  !> Whether two polygons overlap, seen along a direction: no line separates their projections.
  pure logical function polygons_overlap(n_p, p, n_q, q, direction) result(overlap)
    integer, intent(in) :: n_p  !! Number of corners of the first polygon, 2 to 4.
    real(dp), intent(in) :: p(3, n_p)  !! Its corners (3, n_p) [length].
    integer, intent(in) :: n_q  !! Number of corners of the second polygon, 2 to 4.
    real(dp), intent(in) :: q(3, n_q)  !! Its corners (3, n_q) [length].
    real(dp), intent(in) :: direction(3)  !! Direction of sight (3) [].
    real(dp) :: a(3, n_p), b(3, n_q), axis(3)
    integer :: i
    a = p - shrinkage*(p - spread(sum(p, 2)/n_p, 2, n_p))
    b = q - shrinkage*(q - spread(sum(q, 2)/n_q, 2, n_q))
    overlap = .true.
    do i = 1, n_p + n_q
      if (n_p == 2) then
        ! In two dimensions the projections are parts of a line.
        axis = cross(direction, [0.0_dp, 0.0_dp, 1.0_dp])
      else if (i <= n_p) then
        axis = cross(direction, p(:, mod(i, n_p) + 1) - p(:, i))
      else
        axis = cross(direction, q(:, mod(i - n_p, n_q) + 1) - q(:, i - n_p))
      end if
      overlap = minval(matmul(axis, a)) < maxval(matmul(axis, b)) .and. &
                minval(matmul(axis, b)) < maxval(matmul(axis, a))
      if (.not. overlap) return
    end do
  end function polygons_overlap

  !> Where a line meets a polygon.
  pure subroutine ray_meets_polygon(origin, direction, n, p, normal, meets, t)
    real(dp), intent(in) :: origin(3)  !! A point of the line (3) [length].
    real(dp), intent(in) :: direction(3)  !! Its unit direction (3) [].
    integer, intent(in) :: n  !! Number of corners of the polygon, 2 to 4.
    real(dp), intent(in) :: p(3, n)  !! Corners (3, n) [length].
    real(dp), intent(in) :: normal(3)  !! Unit normal of the polygon (3) [].
    logical, intent(out) :: meets  !! Whether the line meets the polygon.
    real(dp), intent(out) :: t  !! Place on the line, from its origin [length].
    real(dp) :: x(3), s, own(3)
    integer :: j
    meets = .false.
    t = 0
    if (abs(dot_product(direction, normal)) < of_mesh) return
    t = dot_product(p(:, 1) - origin, normal)/dot_product(direction, normal)
    x = origin + t*direction
    if (n == 2) then
      s = dot_product(x - p(:, 1), p(:, 2) - p(:, 1))/sum((p(:, 2) - p(:, 1))**2)
      meets = s >= -same_number .and. s <= 1 + same_number
    else
      do j = 2, n - 1
        own = across(p(:, 1), p(:, j), p(:, j + 1))
        if (in_triangle(x, p(:, 1), p(:, j), p(:, j + 1), own, dot_product(own, own))) meets = .true.
      end do
    end if
  end subroutine ray_meets_polygon
end module dotyk_contact_facet_distance
