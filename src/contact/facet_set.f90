!> The facets of a surface as polynomials on their reference domains, with the bounds that search and projection need.
!>
!> Every facet kind is a biquadratic polynomial x(u,v) = origin + sum_ij c_ij u^i v^j, i,j = 0..2, on the unit triangle
!> or on [-1,1]^2; a line is a quadratic polynomial in u on [-1,1]. One form serves all kinds, with first and second
!> derivatives. Two dimensions are three with z = 0.
!>
!> Convex hulls of facets give lower bounds of their distances to points, at a fraction of the costs of closest points.
!> The hull is a prism: a layer along a normal and half planes along the edges of the corners. It contains the Bernstein
!> control points of the facet and with them the facet.
module dotyk_contact_facet_set
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding, same_number
  use dotyk_contact_facet_polynomial, only: bounding_box, control_points, convexity, evaluate_facet, max_controls, &
    normal_cone
  use dotyk_mesh_element, only: element_kind, element_kind_t, max_element_nodes, n_element_kinds, shape_functions
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: facet_position_and_normal, corner_position, corner_coordinates, corner_normal, edge_coordinates

  type :: facet_hull_t  !! Hull of one facet, relative to the origin of its polynomial.
    integer :: n_sides = 0  !! Number of sides of the prism.
    real(dp) :: normal(3) = 0  !! Unit normal of the layer (3) [].
    real(dp) :: low = 0, high = 0  !! Bounds of the layer [length].
    real(dp) :: side(3, 4) = 0  !! Unit outward normals of the sides, in the plane of the layer (3, 4) [].
    real(dp) :: limit(4) = 0  !! Distances of the sides from the origin (4) [length].
  contains
    procedure :: init => hull_init
    procedure :: is_beyond => hull_is_beyond
  end type facet_hull_t

  type, public :: facet_set_t  !! Facets of one surface.
    integer :: n = 0  !! Number of facets.
    integer :: dimension = 0  !! Dimension of space, 2 or 3.
    integer, allocatable :: corners(:)  !! Number of corners: 2 line, 3 triangle, 4 quadrilateral (n).
    integer, allocatable :: corner_node(:, :)  !! Body-local node numbers of the corners, padded with 0 (4, n).
    !> First node (3, n) [length]. The polynomial is relative to it, so that scenes far from the global origin lose no
    !> digits.
    real(dp), allocatable :: origin(:, :)
    !> Coefficient of u^i v^j is coefficient(:, 1+i+3j, facet) (3, 9, n) [length].
    real(dp), allocatable :: coefficient(:, :, :)
    real(dp), allocatable :: lo(:, :)  !! Lower corner of the bounding box (3, n) [length].
    real(dp), allocatable :: hi(:, :)  !! Upper corner of the bounding box (3, n) [length].
    real(dp), allocatable :: axis(:, :)  !! Axis of a cone that contains all normals of the facet (3, n) [].
    real(dp), allocatable :: half_angle(:)  !! Half angle of that cone, pi if unknown (n) [rad].
    !> Diagonal of the box of the nodes: the size of the facet in tolerances (n) [length].
    real(dp), allocatable :: size(:)
    !> Convexity radius: the squared distance to a point is convex on the facet if no part of the facet is farther away
    !> than this (n) [length].
    real(dp), allocatable :: reach(:)
    !> Thickness of the body behind each facet as far as the surface has both of its sides, huge if not: no body
    !> overlaps deeper (n) [length]. Set by `find_depths`.
    real(dp), allocatable :: depth(:)
    logical, allocatable :: affine(:)  !! The map is affine (n).
    type(facet_hull_t), allocatable :: hull(:)  !! Convex hulls (n).
  contains
    procedure :: init => facet_set_init
    procedure :: init_polynomials => facet_set_init_polynomials
  end type facet_set_t

contains

  !> Set up from a surface and the nodes of its body.
  subroutine facet_set_init(self, x, surface)
    class(facet_set_t), intent(out) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    integer :: f, n
    call self%init_polynomials(x, surface)
    n = self%n
    allocate (self%lo(3, n), self%hi(3, n), self%axis(3, n), self%half_angle(n), self%reach(n), self%affine(n), &
              self%hull(n), self%depth(n))
    self%depth = huge(1.0_dp)
    do f = 1, n
      associate (corners => self%corners(f), c => self%coefficient(:, :, f))
        call bounding_box(corners, c, self%lo(:, f), self%hi(:, f))
        self%lo(:, f) = self%lo(:, f) + self%origin(:, f)
        self%hi(:, f) = self%hi(:, f) + self%origin(:, f)
        call normal_cone(corners, c, self%axis(:, f), self%half_angle(f))
        call convexity(corners, c, self%affine(f), self%reach(f))
        call self%hull(f)%init(corners, c, self%axis(:, f), self%size(f))
      end associate
    end do
  end subroutine facet_set_init

  !> Set up the polynomials alone, without the bounds for searches.
  subroutine facet_set_init_polynomials(self, x, surface)
    class(facet_set_t), intent(out) :: self
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), allocatable :: basis(:, :, :)
    integer, allocatable :: n_nodes(:), corners(:)
    integer :: f, k, n, d
    n = surface%n_facets
    d = size(x, 1)
    self%n = n
    self%dimension = d
    call monomial_bases(basis, n_nodes, corners)
    allocate (self%corners(n), self%corner_node(4, n), self%origin(3, n), self%coefficient(3, 9, n), self%size(n))
    self%origin = 0
    self%corner_node = 0
    do f = 1, n
      k = surface%kind(f)
      self%corners(f) = corners(k)
      self%corner_node(1:corners(k), f) = surface%node(1:corners(k), f)
      self%origin(1:d, f) = x(:, surface%node(1, f))
      call facet_polynomial(d, n_nodes(k), basis(:, :, k), x(:, surface%node(1:n_nodes(k), f)), &
                            self%coefficient(:, :, f), self%size(f))
    end do
  end subroutine facet_set_init_polynomials

  !> Coefficients of the shape functions of every facet kind in monomials u^i v^j, by interpolation at {-1,0,1}^2, which
  !> determines a biquadratic polynomial: exact, and coefficients of higher order vanish exactly for linear functions.
  subroutine monomial_bases(basis, n_nodes, corners)
    real(dp), allocatable, intent(out) :: basis(:, :, :)  !! Coefficients (9, max_element_nodes, n_element_kinds) [].
    !> Number of nodes of each kind; 0 for kinds that are not facets (n_element_kinds).
    integer, allocatable, intent(out) :: n_nodes(:)
    integer, allocatable, intent(out) :: corners(:)  !! Number of corners of each kind, likewise (n_element_kinds).
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
    real(dp), intent(in) :: minus  !! Value at -1 [].
    real(dp), intent(in) :: centre  !! Value at 0 [].
    real(dp), intent(in) :: plus  !! Value at 1 [].
    real(dp), intent(out) :: c0  !! Coefficient of 1 [].
    real(dp), intent(out) :: c1  !! Coefficient of t [].
    real(dp), intent(out) :: c2  !! Coefficient of t^2 [].
    c0 = centre
    c1 = (plus - minus)/2
    c2 = (plus + minus)/2 - centre
  end subroutine to_monomials

  !> Polynomial of one facet relative to its first node, and its size.
  pure subroutine facet_polynomial(d, n, basis, x, c, size)
    integer, intent(in) :: d  !! Dimension of space, 2 or 3.
    integer, intent(in) :: n  !! Number of nodes.
    real(dp), intent(in) :: basis(:, :)  !! Monomial coefficients of the shape functions (9, at least n) [].
    real(dp), intent(in) :: x(d, n)  !! Node coordinates (d, n) [length].
    real(dp), intent(out) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(out) :: size  !! Diagonal of the box of the nodes [length].
    integer :: j, m
    c = 0
    do j = 2, n
      do m = 1, 9
        c(1:d, m) = c(1:d, m) + basis(m, j)*(x(:, j) - x(:, 1))
      end do
    end do
    size = norm2(maxval(x, dim=2) - minval(x, dim=2))
  end subroutine facet_polynomial

  !> Position, unit outward normal and tangents at a point of a facet; the normal is zero where the map is singular.
  pure subroutine facet_position_and_normal(self, facet, xi, position, normal, xu, xv)
    type(facet_set_t), intent(in) :: self  !! Facets of the surface.
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) []; the second is 0 for lines.
    real(dp), intent(out) :: position(3)  !! Position (3) [length].
    real(dp), intent(out) :: normal(3)  !! Unit outward normal (3) [].
    !> Derivative of the position with respect to the first reference coordinate (3) [length].
    real(dp), intent(out) :: xu(3)
    real(dp), intent(out) :: xv(3)  !! Derivative with respect to the second reference coordinate (3) [length].
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

  !> Set up from the polynomial of a facet.
  subroutine hull_init(self, corners, c, normal, size)
    class(facet_hull_t), intent(out) :: self
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: normal(3)  !! Unit vector, about normal to the facet (3) [].
    real(dp), intent(in) :: size  !! Size of the facet [length].
    real(dp) :: control(3, max_controls), corner(3, 4), along(3)
    integer :: k, n
    call control_points(corners, c, n, control)
    self%normal = normal
    self%low = minval(matmul(normal, control(:, :n))) - rounding*size
    self%high = maxval(matmul(normal, control(:, :n))) + rounding*size
    self%n_sides = corners
    select case (corners)
    case (2)
      self%side(:, 1) = [normal(2), -normal(1), 0.0_dp]
      self%side(:, 2) = -self%side(:, 1)
    case (3)
      corner(:, 1:3) = control(:, 1:3)
    case default
      ! Control points are numbered row by row.
      corner(:, 1:4) = control(:, [1, 3, 9, 7])
    end select
    if (corners > 2) then
      do k = 1, corners
        along = cross(corner(:, mod(k, corners) + 1) - corner(:, k), normal)
        if (norm2(along) > 0) self%side(:, k) = along/norm2(along)
      end do
    end if
    do k = 1, corners
      self%limit(k) = maxval(matmul(self%side(:, k), control(:, :n))) + rounding*size
    end do
  end subroutine hull_init

  !> Whether no point of the facet is as near to a point as a distance.
  pure logical function hull_is_beyond(self, x, square) result(beyond)
    class(facet_hull_t), intent(in) :: self
    real(dp), intent(in) :: x(3)  !! The point, relative to the origin of the facet (3) [length].
    real(dp), intent(in) :: square  !! Square of the distance [length^2].
    real(dp) :: above, beside
    integer :: k
    above = dot_product(self%normal, x)
    above = max(above - self%high, self%low - above, 0.0_dp)
    beside = 0
    do k = 1, self%n_sides
      beside = max(beside, dot_product(self%side(:, k), x) - self%limit(k))
    end do
    beyond = (1 - same_number)*(above**2 + beside**2) > square
  end function hull_is_beyond

  !> Position of a corner of a facet [length].
  pure function corner_position(set, f, corner) result(x)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: f  !! Facet number.
    integer, intent(in) :: corner  !! Corner number.
    real(dp) :: x(3)  !! Position (3) [length].
    real(dp) :: xi(2)
    xi = corner_coordinates(set%corners(f), corner)
    associate (c => set%coefficient(:, :, f), u => xi(1), v => xi(2))
      x = set%origin(:, f) + c(:, 1) + u*(c(:, 2) + u*c(:, 3)) + &
          v*(c(:, 4) + u*(c(:, 5) + u*c(:, 6)) + v*(c(:, 7) + u*(c(:, 8) + u*c(:, 9))))
    end associate
  end function corner_position

  !> Reference coordinates of a corner (2) [].
  pure function corner_coordinates(corners, corner) result(xi)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    integer, intent(in) :: corner  !! Corner number.
    real(dp) :: xi(2)  !! Coordinates (2) [].
    if (corners == 2) then
      xi = [real(2*corner - 3, dp), 0.0_dp]
    else
      xi = edge_coordinates(corners, corner, 0.0_dp)
    end if
  end function corner_coordinates

  !> Reference coordinates of a point of an edge of a triangle or quadrilateral (2) [].
  pure function edge_coordinates(corners, edge, s) result(xi)
    integer, intent(in) :: corners  !! Number of corners of the facet: 3 triangle, 4 quadrilateral.
    integer, intent(in) :: edge  !! Edge number.
    real(dp), intent(in) :: s  !! Fraction of the edge from its first corner [].
    real(dp) :: xi(2)  !! Coordinates (2) [].
    real(dp), parameter :: triangle(2, 3) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [2, 3])
    real(dp), parameter :: square(2, 4) = &
      reshape([-1.0_dp, -1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp], [2, 4])
    if (corners == 3) then
      xi = (1 - s)*triangle(:, edge) + s*triangle(:, modulo(edge, 3) + 1)
    else
      xi = (1 - s)*square(:, edge) + s*square(:, modulo(edge, 4) + 1)
    end if
  end function edge_coordinates

  !> Unit normal of the plane, or chord, of the corners of a facet (3) []; zero where they are collinear.
  pure function corner_normal(x) result(normal)
    real(dp), intent(in) :: x(:, :)  !! Corners (3, 2 to 4) [length].
    real(dp) :: normal(3)
    select case (size(x, 2))
    case (2)
      normal = [x(2, 2) - x(2, 1), x(1, 1) - x(1, 2), 0.0_dp]
    case (3)
      normal = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))
    case default
      normal = cross(x(:, 3) - x(:, 1), x(:, 4) - x(:, 2))
    end select
    normal = normal/max(norm2(normal), tiny(1.0_dp))
  end function corner_normal
end module dotyk_contact_facet_set
