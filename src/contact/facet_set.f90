!> The facets of a surface as polynomials on their reference domains, with bounds: what search and projection work on.
!>
!> Every facet kind is a biquadratic polynomial x(u,v) = origin + sum_ij c_ij u^i v^j, i,j = 0..2, on the unit
!> triangle or on [-1,1]^2; a line is a quadratic in u on [-1,1]. One form serves all kinds, with first and second
!> derivatives. Two dimensions are three with z = 0. The bounds are proven by Bernstein's form: values of a polynomial
!> lie in the convex hull of its control points, and normals in the cone of the products of the control vectors of the
!> two derivatives.
module dotyk_contact_facet_set
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_kind, element_kind_t, max_element_nodes, n_element_kinds, shape_functions
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> Facets of one surface.
  type, public :: facet_set_t
    !> Number of facets.
    integer :: n = 0
    !> Dimension of space, 2 or 3.
    integer :: dimension = 0
    !> Number of corners (n): 2 line, 3 triangle, 4 quadrilateral.
    integer, allocatable :: corners(:)
    !> Body-local node numbers of the corners (4, n), 0 padded.
    integer, allocatable :: corner_node(:, :)
    !> First node (3, n) [length]; the polynomial is relative to it, so that far scenes lose no digits.
    real(dp), allocatable :: origin(:, :)
    !> Coefficient of u^i v^j is coefficient(:, 1+i+3j, facet) (3, 9, n) [length].
    real(dp), allocatable :: coefficient(:, :, :)
    !> Box that contains the facet (3, n) [length].
    real(dp), allocatable :: lo(:, :), hi(:, :)
    !> Axis of a cone that contains all normals of the facet (3, n).
    real(dp), allocatable :: axis(:, :)
    !> Half angle of that cone (n) [rad]; pi where nothing is known.
    real(dp), allocatable :: half_angle(:)
    !> Diagonal of the box of the nodes (n) [length]: the facet's size in tolerances.
    real(dp), allocatable :: size(:)
    !> The squared distance to a point is convex on the facet where no part of the facet is farther than this (n)
    !> [length].
    real(dp), allocatable :: reach(:)
    !> The map is affine (n).
    logical, allocatable :: affine(:)
  contains
    procedure :: init => facet_set_init
  end type facet_set_t

  public :: evaluate_facet, facet_position_and_normal

  real(dp), parameter :: pi = acos(-1.0_dp)

contains

  !> Set up from a surface and its body's nodes.
  subroutine facet_set_init(self, x, surface)
    class(facet_set_t), intent(out) :: self
    !> Nodal coordinates of the body (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> The surface.
    type(surface_t), intent(in) :: surface
    real(dp), allocatable :: basis(:, :, :)
    integer, allocatable :: n_nodes(:), corners(:)
    integer :: f, k, n, d
    n = surface%n_facets
    d = size(x, 1)
    self%n = n
    self%dimension = d
    call monomial_bases(basis, n_nodes, corners)
    allocate (self%corners(n), self%corner_node(4, n), self%origin(3, n), self%coefficient(3, 9, n), self%lo(3, n), &
              self%hi(3, n), self%axis(3, n), self%half_angle(n), self%size(n), self%reach(n), self%affine(n))
    self%origin = 0
    self%corner_node = 0
    do f = 1, n
      k = surface%kind(f)
      self%corners(f) = corners(k)
      self%corner_node(1:corners(k), f) = surface%node(1:corners(k), f)
      self%origin(1:d, f) = x(:, surface%node(1, f))
      call polynomial(d, n_nodes(k), basis(:, :, k), x(:, surface%node(1:n_nodes(k), f)), self%coefficient(:, :, f), &
                      self%size(f))
      call bounding_box(corners(k), self%coefficient(:, :, f), self%lo(:, f), self%hi(:, f))
      self%lo(:, f) = self%lo(:, f) + self%origin(:, f)
      self%hi(:, f) = self%hi(:, f) + self%origin(:, f)
      call normal_cone(corners(k), self%coefficient(:, :, f), self%axis(:, f), self%half_angle(f))
      call convexity(corners(k), self%coefficient(:, :, f), self%affine(f), self%reach(f))
    end do
  end subroutine facet_set_init

  !> Coefficients of the shape functions of every facet kind in monomials u^i v^j, by interpolation at {-1,0,1}^2,
  !> where a biquadratic polynomial is determined: exact, and the differences vanish exactly for linear functions.
  subroutine monomial_bases(basis, n_nodes, corners)
    !> (9, nodes, kinds).
    real(dp), allocatable, intent(out) :: basis(:, :, :)
    !> Number of nodes and of corners of each kind; 0 for kinds that are not facets.
    integer, allocatable, intent(out) :: n_nodes(:), corners(:)
    type(element_kind_t) :: kind
    real(dp) :: value(max_element_nodes, 3, 3), w(max_element_nodes, 3, 3)
    integer :: k, i, j, n
    allocate (basis(9, max_element_nodes, n_element_kinds), n_nodes(n_element_kinds), corners(n_element_kinds))
    basis = 0
    n_nodes = 0
    corners = 0
    do k = 1, n_element_kinds
      kind = element_kind(k)
      if (kind%dimension > 2) cycle
      n = kind%n_nodes
      n_nodes(k) = n
      corners(k) = kind%n_corners
      do j = 1, 3
        do i = 1, 3
          if (kind%dimension == 1) then
            call shape_functions(k, [real(i - 2, dp)], value(1:n, i, j))
          else
            call shape_functions(k, [real(i - 2, dp), real(j - 2, dp)], value(1:n, i, j))
          end if
        end do
      end do
      call to_monomials(value(1:n, 1, :), value(1:n, 2, :), value(1:n, 3, :), w(1:n, 1, :), w(1:n, 2, :), w(1:n, 3, :))
      call to_monomials(w(1:n, :, 1), w(1:n, :, 2), w(1:n, :, 3), value(1:n, :, 1), value(1:n, :, 2), value(1:n, :, 3))
      do j = 1, 3
        do i = 1, 3
          basis(i + 3*(j - 1), 1:n, k) = value(1:n, i, j)
        end do
      end do
    end do
  end subroutine monomial_bases

  !> Values at -1, 0, 1 to coefficients of 1, t, t^2.
  elemental subroutine to_monomials(minus, centre, plus, c0, c1, c2)
    real(dp), intent(in) :: minus, centre, plus
    real(dp), intent(out) :: c0, c1, c2
    c0 = centre
    c1 = (plus - minus)/2
    c2 = (plus + minus)/2 - centre
  end subroutine to_monomials

  !> Polynomial of one facet relative to its first node, and its size.
  pure subroutine polynomial(d, n, basis, x, c, size)
    !> Dimension of space and number of nodes.
    integer, intent(in) :: d, n
    !> Monomial coefficients of the shape functions (9, >= n).
    real(dp), intent(in) :: basis(:, :)
    !> Node coordinates (d, n).
    real(dp), intent(in) :: x(d, n)
    !> Coefficients (3, 9).
    real(dp), intent(out) :: c(3, 9)
    !> Diagonal of the box of the nodes.
    real(dp), intent(out) :: size
    integer :: j, m
    c = 0
    do j = 2, n
      do m = 1, 9
        c(1:d, m) = c(1:d, m) + basis(m, j)*(x(:, j) - x(:, 1))
      end do
    end do
    size = norm2(maxval(x, dim=2) - minval(x, dim=2))
  end subroutine polynomial

  !> Box of the Bernstein control points, which contains the facet.
  pure subroutine bounding_box(corners, c, lo, hi)
    integer, intent(in) :: corners
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    !> Corners of the box (3).
    real(dp), intent(out) :: lo(3), hi(3)
    real(dp) :: b(3, 9), r(3, 9), margin
    integer :: n, k
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
    lo = minval(b(:, 1:n), dim=2)
    hi = maxval(b(:, 1:n), dim=2)
    margin = 1e-12_dp*norm2(hi - lo)   ! round-off of the control points
    lo = lo - margin
    hi = hi + margin
  end subroutine bounding_box

  !> Bernstein control values on [-1,1] of c0 + c1 t + c2 t^2.
  elemental subroutine quadratic_controls(c0, c1, c2, b1, b2, b3)
    real(dp), intent(in) :: c0, c1, c2
    real(dp), intent(out) :: b1, b2, b3
    b1 = c0 - c1 + c2
    b2 = c0 - c2
    b3 = c0 + c1 + c2
  end subroutine quadratic_controls

  !> A cone that contains all normals: x_u lies in the convex hull of control vectors a_i, x_v in that of b_j, hence
  !> x_u x x_v is a combination of the products a_i x b_j with coefficients that are not negative.
  pure subroutine normal_cone(corners, c, axis, half_angle)
    integer, intent(in) :: corners
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    !> Unit vector (3).
    real(dp), intent(out) :: axis(3)
    !> Half angle [rad], pi where no cone narrower than a half space was found.
    real(dp), intent(out) :: half_angle
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
    if (least > 0.01_dp) half_angle = min(pi, acos(least) + 1e-7_dp)
  end subroutine normal_cone

  !> Where the squared distance is surely convex: its second derivative J^T J + (x - p).x'' is positive while abs(x -
  !> p) is below the least eigenvalue of J^T J over the greatest second derivative. The eigenvalue is sampled at nine
  !> points and halved.
  pure subroutine convexity(corners, c, affine, reach)
    integer, intent(in) :: corners
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    logical, intent(out) :: affine
    !> [length].
    real(dp), intent(out) :: reach
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
    affine = second <= 1e-14_dp*sqrt(max(least, 0.0_dp))
    if (.not. affine) reach = max(0.0_dp, least)/2/second
  end subroutine convexity

  !> Position (relative to the origin) and derivatives of a facet.
  pure subroutine evaluate_facet(c, u, v, x, xu, xv, xuu, xuv, xvv)
    !> Coefficients (3, 9).
    real(dp), intent(in) :: c(3, 9)
    !> Reference coordinates.
    real(dp), intent(in) :: u, v
    !> Position and derivatives (3).
    real(dp), intent(out) :: x(3), xu(3), xv(3), xuu(3), xuv(3), xvv(3)
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

  !> Position and unit outward normal at a point of a facet, with its two tangents; the normal is zero where the map
  !> is singular.
  pure subroutine facet_position_and_normal(self, facet, xi, position, normal, xu, xv)
    type(facet_set_t), intent(in) :: self
    integer, intent(in) :: facet
    !> Reference coordinates (2), the second one 0 for lines.
    real(dp), intent(in) :: xi(2)
    !> (3) [length].
    real(dp), intent(out) :: position(3)
    !> (3).
    real(dp), intent(out) :: normal(3)
    !> Derivatives of the position (3) [length].
    real(dp), intent(out) :: xu(3), xv(3)
    real(dp) :: xuu(3), xuv(3), xvv(3), length
    call evaluate_facet(self%coefficient(:, :, facet), xi(1), xi(2), position, xu, xv, xuu, xuv, xvv)
    position = position + self%origin(:, facet)
    if (self%corners(facet) == 2) then
      normal = [xu(2), -xu(1), 0.0_dp]
    else
      normal = cross(xu, xv)
    end if
    length = norm2(normal)
    if (length > 0) then
      normal = normal/length
    else
      normal = 0
    end if
  end subroutine facet_position_and_normal
end module dotyk_contact_facet_set
