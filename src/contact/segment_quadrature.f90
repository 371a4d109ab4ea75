!> Quadrature rules on mortar segments, the polygons in which facets of the slave and the master surface overlap.
module dotyk_contact_segment_quadrature
  use dotyk_base_kinds, only: dp
  use dotyk_contact_polygon, only: is_parallelogram, max_corners, polygon_t, triangulate
  use dotyk_mesh_element, only: element_line2, element_line3, element_quad4, element_quad8, element_quad9, &
    element_tri3, element_tri6, quadrature_rule
  implicit none
  private

  type, public :: quadrature_rule_t  !! Quadrature rule of a facet or of a reference domain.
    real(dp), allocatable :: xi(:, :)  !! Points (dimension-1, n) [].
    real(dp), allocatable :: weight(:)  !! Weights (n) [].
  end type quadrature_rule_t

  integer, parameter, public :: max_degree = 20  !! Greatest degree of the rules in the table.

  type, public :: rule_table_t  !! Rules on the reference domains, of the degrees that were asked for.
    type(quadrature_rule_t) :: line(0:max_degree)  !! On (0:max_degree) [-1,1], by degree.
    type(quadrature_rule_t) :: triangle(0:max_degree)  !! On the unit triangle, by degree (0:max_degree).
    type(quadrature_rule_t) :: square(0:max_degree)  !! On (0:max_degree) [-1,1]^2, by degree.
  contains
    procedure :: init => table_init
  end type rule_table_t

  public :: polygon_rule, append_points, shape_degree

contains

  !> Compute the rules.
  subroutine table_init(self, highest)
    class(rule_table_t), intent(out) :: self
    integer, intent(in) :: highest  !! Degree of the last one; at most `max_degree`.
    integer :: k
    do k = 0, highest
      call quadrature_rule(element_line2, k, self%line(k)%xi, self%line(k)%weight)
      call quadrature_rule(element_tri3, k, self%triangle(k)%xi, self%triangle(k)%weight)
      call quadrature_rule(element_quad4, k, self%square(k)%xi, self%square(k)%weight)
    end do
  end subroutine table_init

  !> Total degree of the shape functions of a facet kind.
  pure integer function shape_degree(kind) result(degree)
    integer, intent(in) :: kind  !! Element kind of the facet.
    select case (kind)
    case (element_line2, element_tri3)
      degree = 1
    case (element_line3, element_tri6, element_quad4)
      degree = 2
    case (element_quad8)
      degree = 3
    case (element_quad9)
      degree = 4
    case default
      degree = 1
    end select
  end function shape_degree

  !> Quadrature rule on a polygon: a tensor-product rule on a parallelogram, rules on triangles otherwise.
  pure subroutine polygon_rule(polygon, table, degree, n, points, weights, ok)
    type(polygon_t), intent(in) :: polygon  !! Polygon, counter-clockwise.
    type(rule_table_t), intent(in) :: table  !! Quadrature rules on reference domains, by degree.
    integer, intent(in) :: degree  !! Total degree that is integrated exactly.
    integer, intent(out) :: n  !! Number of points.
    real(dp), allocatable, intent(out) :: points(:, :)  !! Points (2, n) [as the polygon].
    !> Weights, whose sum is the area (n) [as the area of the polygon].
    real(dp), allocatable, intent(out) :: weights(:)
    logical, intent(out) :: ok  !! The polygon could be divided into triangles.
    real(dp) :: triangle(2, 3, max_corners), u(2), v(2), area
    integer :: n_triangles, i, k, m
    if (is_parallelogram(polygon)) then
      ok = .true.
      u = (polygon%x(:, 2) - polygon%x(:, 1))/2
      v = (polygon%x(:, 4) - polygon%x(:, 1))/2
      area = u(1)*v(2) - u(2)*v(1)
      n = size(table%square(degree)%weight)
      allocate (points(2, n), weights(n))
      do i = 1, n
        associate (xi => table%square(degree)%xi(:, i))
          points(:, i) = (polygon%x(:, 1) + polygon%x(:, 3))/2 + xi(1)*u + xi(2)*v
        end associate
        weights(i) = area*table%square(degree)%weight(i)
      end do
      return
    end if
    call triangulate(polygon, n_triangles, triangle, ok)
    m = size(table%triangle(degree)%weight)
    n = m*n_triangles
    allocate (points(2, n), weights(n))
    do k = 1, n_triangles
      u = triangle(:, 2, k) - triangle(:, 1, k)
      v = triangle(:, 3, k) - triangle(:, 1, k)
      area = u(1)*v(2) - u(2)*v(1)
      do i = 1, m
        associate (xi => table%triangle(degree)%xi(:, i))
          points(:, (k - 1)*m + i) = triangle(:, 1, k) + xi(1)*u + xi(2)*v
        end associate
        weights((k - 1)*m + i) = area*table%triangle(degree)%weight(i)
      end do
    end do
  end subroutine polygon_rule

  !> Append points to a rule that grows.
  pure subroutine append_points(points, weights, n, xi, weight)
    real(dp), intent(in) :: points(:, :)  !! New points (d, m) [].
    real(dp), intent(in) :: weights(:)  !! New weights (m) [].
    integer, intent(inout) :: n  !! Number of points in the buffers, before and after.
    real(dp), allocatable, intent(inout) :: xi(:, :)  !! Buffer of points (d, room) [].
    real(dp), allocatable, intent(inout) :: weight(:)  !! Buffer of weights (room) [].
    real(dp), allocatable :: more(:, :), more_weight(:)
    integer :: m
    m = size(weights)
    if (.not. allocated(weight)) allocate (xi(size(points, 1), 2*m), weight(2*m))
    if (n + m > size(weight)) then
      allocate (more(size(points, 1), 2*(n + m)), more_weight(2*(n + m)))
      more(:, 1:n) = xi(:, 1:n)
      more_weight(1:n) = weight(1:n)
      call move_alloc(more, xi)
      call move_alloc(more_weight, weight)
    end if
    xi(:, n + 1:n + m) = points
    weight(n + 1:n + m) = weights
    n = n + m
  end subroutine append_points
end module dotyk_contact_segment_quadrature
