!> Isoparametric map and displacement gradients at all quadrature points of an element at once, without shape function
!> gradients in space.
!>
!> The same map as `map_element`, with the points as the first index of all arrays so that loops over points
!> vectorize: sums over nodes run over four points in step. The last group of four is filled with repetitions of the
!> last point, with weight 0.
module dotyk_elasticity_isoparametric_map
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_analysis, only: two_pi
  use dotyk_elasticity_shape_table, only: shape_table_t
  implicit none
  private

  integer, parameter, public :: points_in_row = 4  !! Number of points in a group: the length of the innermost loops.

  !> Shape functions of an element kind at the points of a quadrature rule, by points.
  type, public :: point_shape_table_t
    integer :: n_nodes = 0  !! Number of nodes.
    integer :: dimension = 0  !! Number of coordinates.
    integer :: n_points = 0  !! Number of points, with repetitions: a multiple of `points_in_row`.
    integer :: n_true = 0  !! Number of points without repetitions.
    real(dp), allocatable :: shape(:, :)  !! Shape functions (n_points, n_nodes) [].
    real(dp), allocatable :: gradient(:, :, :)  !! By reference coordinates (n_points, n_nodes, dimension) [].
    real(dp), allocatable :: products(:, :, :)  !! Sums of products of two (n_points, dimension, dimension) [].
    real(dp), allocatable :: shape_square(:)  !! Sums over the nodes of squares of shape functions (n_points) [].
    real(dp), allocatable :: weight(:)  !! Reference weights; 0 for repetitions (n_points) [].
  contains
    procedure :: init => point_shape_table_init
  end type point_shape_table_t

  public :: map_points, physical_gradients, interpolate

contains

  !> Rearrange a table by points.
  subroutine point_shape_table_init(self, table)
    class(point_shape_table_t), intent(out) :: self
    type(shape_table_t), intent(in) :: table  !! Shape functions by nodes.
    integer :: q, p, i, k
    self%n_nodes = table%n_nodes
    self%dimension = table%dimension
    self%n_true = table%n_points
    self%n_points = points_in_row*((table%n_points + points_in_row - 1)/points_in_row)
    allocate (self%shape(self%n_points, self%n_nodes), self%gradient(self%n_points, self%n_nodes, self%dimension))
    allocate (self%products(self%n_points, self%dimension, self%dimension), self%weight(self%n_points))
    do p = 1, self%n_points
      q = min(p, self%n_true)
      self%shape(p, :) = table%shape(:, q)
      self%gradient(p, :, :) = table%gradient(:, :, q)
      self%weight(p) = merge(table%weight(q), 0.0_dp, p <= self%n_true)
      do k = 1, self%dimension
        do i = 1, self%dimension
          self%products(p, i, k) = dot_product(table%gradient(:, i, q), table%gradient(:, k, q))
        end do
      end do
    end do
    self%shape_square = sum(self%shape**2, dim=2)
  end subroutine point_shape_table_init

  !> The isoparametric map at all points: inverse Jacobians, radii, weights.
  pure subroutine map_points(n, dim, slots, n_points, shape, shape_square, gradient, products, weight, x, inverse, &
                             radius, g_square, w, worst)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of points, a multiple of `points_in_row`.
    real(dp), intent(in) :: shape(n_points, n)  !! Shape functions (n_points, n) [].
    real(dp), intent(in) :: shape_square(n_points)  !! Sums of squares of shape functions (n_points) [].
    real(dp), intent(in) :: gradient(n_points, n, dim)  !! Derivatives by reference coordinates (n_points, n, dim) [].
    real(dp), intent(in) :: products(n_points, dim, dim)  !! Sums of products of two derivatives [].
    real(dp), intent(in) :: weight(n_points)  !! Reference weights (n_points) [].
    real(dp), intent(in) :: x(dim, n)  !! Nodes (dim, n) [length].
    real(dp), intent(out) :: inverse(n_points, dim, dim)  !! Inverse Jacobians: xi_m by x_k [1/length].
    real(dp), intent(out) :: radius(n_points)  !! Radius in axisymmetric analyses, 1 in others (n_points) [length].
    !> Sums over nodes and slots of the squares of the shape functions' gradients (n_points) [1/length^2].
    real(dp), intent(out) :: g_square(n_points)
    real(dp), intent(out) :: w(n_points)  !! Quadrature weights (n_points) [volume].
    !> Smallest Jacobian determinant, or radius in axisymmetric analyses; where it is not positive the other results
    !> are undefined [volume].
    real(dp), intent(out) :: worst
    real(dp) :: jacobian(n_points, dim, dim), determinant(n_points)
    integer :: k, m, l, q
    radius = 1
    call reference_slopes(n, dim, n_points, gradient, x, jacobian)
    call invert(dim, n_points, jacobian, inverse, determinant)
    worst = minval(determinant)
    if (.not. worst > 0) then
      worst = min(worst, 0.0_dp)
      return
    end if
    g_square = 0
    do k = 1, dim
      do m = 1, dim
        do l = 1, dim
          do q = 1, n_points
            g_square(q) = g_square(q) + inverse(q, m, k)*inverse(q, l, k)*products(q, m, l)
          end do
        end do
      end do
    end do
    w = weight*determinant
    if (slots == dim) return
    call interpolate(n, 1, n_points, shape, x(1:1, :), radius)
    worst = min(worst, minval(radius))
    if (.not. worst > 0) then
      worst = min(worst, 0.0_dp)
      return
    end if
    g_square = g_square + shape_square/radius**2
    w = w*two_pi*radius
  end subroutine map_points

  !> Displacement gradients in space of one of several bodies, from those by reference coordinates.
  pure subroutine physical_gradients(dim, slots, n_points, n_bodies, body, by_reference, inverse, displacement, &
                                     radius, slope)
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer, intent(in) :: body  !! Index of the body.
    !> Derivatives of displacement i of all bodies by reference coordinate m (n_points, n_bodies, dim, dim) [length].
    real(dp), intent(in) :: by_reference(n_points, n_bodies, dim, dim)
    real(dp), intent(in) :: inverse(n_points, dim, dim)  !! Inverse Jacobians from `map_points` [1/length].
    real(dp), intent(in) :: radius(n_points)  !! Radius in axisymmetric analyses (n_points) [length].
    real(dp), intent(in) :: displacement(n_points, n_bodies, dim)  !! Used in axisymmetric analyses only [length].
    !> Derivatives of displacement i by coordinate k; u_r/r in the third slot of the first component in axisymmetric
    !> analyses (n_points, dim, slots) [].
    real(dp), intent(out) :: slope(n_points, dim, slots)
    integer :: i, k, m, q
    slope = 0
    do k = 1, dim
      do m = 1, dim
        do i = 1, dim
          do q = 1, n_points
            slope(q, i, k) = slope(q, i, k) + by_reference(q, body, i, m)*inverse(q, m, k)
          end do
        end do
      end do
    end do
    if (slots > dim) slope(:, 1, 3) = displacement(:, body, 1)/radius
  end subroutine physical_gradients

  !> Derivatives of functions by reference coordinates.
  pure subroutine reference_slopes(n, dim, n_points, gradient, f, slope)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of functions and of coordinates.
    integer, intent(in) :: n_points  !! Number of points, a multiple of `points_in_row`.
    real(dp), intent(in) :: gradient(n_points, n, dim)  !! Shape function gradients by xi (n_points, n, dim) [].
    real(dp), intent(in) :: f(dim, n)  !! Values at the nodes (dim, n) [any].
    real(dp), intent(out) :: slope(n_points, dim, dim)  !! Derivative of function i by coordinate m [unit of f].
    integer :: m
    do m = 1, dim
      call interpolate(n, dim, n_points, gradient(:, :, m), f, slope(:, :, m))
    end do
  end subroutine reference_slopes

  !> Values of functions at the points.
  pure subroutine interpolate(n, n_functions, n_points, shape, f, values)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: n_functions  !! Number of functions.
    integer, intent(in) :: n_points  !! Number of points, a multiple of `points_in_row`.
    real(dp), intent(in) :: shape(n_points, n)  !! Shape functions or one of their derivatives (n_points, n) [].
    real(dp), intent(in) :: f(n_functions, n)  !! Values at the nodes (n_functions, n) [any].
    real(dp), intent(out) :: values(n_points, n_functions)  !! Values at the points (n_points, n_functions) [unit of f].
    real(dp), dimension(points_in_row) :: s1, s2, s3
    integer :: a, i, q
    do q = 0, n_points - points_in_row, points_in_row
      ! Three sums at a time: one alone waits for each of its additions.
      do i = 1, n_functions - 2, 3
        s1 = 0
        s2 = 0
        s3 = 0
        do a = 1, n
          s1 = s1 + f(i, a)*shape(q + 1:q + points_in_row, a)
          s2 = s2 + f(i + 1, a)*shape(q + 1:q + points_in_row, a)
          s3 = s3 + f(i + 2, a)*shape(q + 1:q + points_in_row, a)
        end do
        values(q + 1:q + points_in_row, i) = s1
        values(q + 1:q + points_in_row, i + 1) = s2
        values(q + 1:q + points_in_row, i + 2) = s3
      end do
      do i = n_functions - mod(n_functions, 3) + 1, n_functions
        s1 = 0
        do a = 1, n
          s1 = s1 + f(i, a)*shape(q + 1:q + points_in_row, a)
        end do
        values(q + 1:q + points_in_row, i) = s1
      end do
    end do
  end subroutine interpolate

  !> Determinants and inverses of Jacobians d x_k / d xi_m; the inverses of singular ones are zero.
  pure subroutine invert(dim, n_points, jacobian, inverse, determinant)
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n_points  !! Number of quadrature points.
    real(dp), intent(in) :: jacobian(n_points, dim, dim)  !! Jacobians (n_points, dim, dim) [length].
    real(dp), intent(out) :: inverse(n_points, dim, dim)  !! Inverses (n_points, dim, dim) [1/length].
    real(dp), intent(out) :: determinant(n_points)  !! Determinants (n_points) [volume].
    integer :: i, k, i1, i2, k1, k2, q
    real(dp) :: factor(n_points)
    if (dim == 2) then
      inverse(:, 1, 1) = jacobian(:, 2, 2)
      inverse(:, 2, 1) = -jacobian(:, 2, 1)
      inverse(:, 1, 2) = -jacobian(:, 1, 2)
      inverse(:, 2, 2) = jacobian(:, 1, 1)
      determinant = jacobian(:, 1, 1)*jacobian(:, 2, 2) - jacobian(:, 1, 2)*jacobian(:, 2, 1)
    else
      do k = 1, 3
        k1 = mod(k, 3) + 1
        k2 = mod(k + 1, 3) + 1
        do i = 1, 3
          i1 = mod(i, 3) + 1
          i2 = mod(i + 1, 3) + 1
          do q = 1, n_points
            inverse(q, i, k) = jacobian(q, k1, i1)*jacobian(q, k2, i2) - jacobian(q, k1, i2)*jacobian(q, k2, i1)
          end do
        end do
      end do
      determinant = jacobian(:, 1, 1)*inverse(:, 1, 1) + jacobian(:, 1, 2)*inverse(:, 2, 1) + &
                    jacobian(:, 1, 3)*inverse(:, 3, 1)
    end if
    where (abs(determinant) > 0)
      factor = 1/determinant
    else where
      factor = 0
    end where
    do k = 1, dim
      do i = 1, dim
        do q = 1, n_points
          inverse(q, i, k) = inverse(q, i, k)*factor(q)
        end do
      end do
    end do
  end subroutine invert
end module dotyk_elasticity_isoparametric_map
