!> Shape functions from the coordinates of the nodes.
!>
!> On [-1,1]^d (lines, quadrilaterals, hexahedra) nodes have integer coordinates -1, 0, 1. Two families: tensor products
!> of Lagrange polynomials, and the quadratic serendipity functions (nodes at corners and mid-sides only). On the unit
!> simplex (triangles, tetrahedra) barycentric coordinates are L_1 = 1 - sum(xi), L_(k+1) = xi_k. Quadratic functions
!> are L (2 L - 1) at corners and 4 L_i L_j at the middle of the edge i-j.
!>
!> Prisms: prism6, prism15 (serendipity) and prism18. Reference domain: unit triangle x [-1,1].
!>
!> Pyramids: pyramid5, pyramid13 (serendipity base) and pyramid14. Reference domain: base [-1,1]^2 at height 0, apex
!> (0,0,1).
!>
!> In the collapsed coordinates t = 1 - xi_3, a = xi_1/t, b = xi_2/t the pyramid is [-1,1]^2 x [0,1]. Its functions of
!> order r are t^k a^i b^j with i, j <= k <= r: rational in xi, complete to the order r, and those of quadrilaterals on
!> the base, of simplices on the triangles, so that elements conform with hexahedra, prisms and tetrahedra (Bedrosian,
!> Int. J. Numer. Methods Eng. 35, 1992; Bergot, Cohen and Durufle, J. Sci. Comput. 42, 2010). pyramid13 lacks t^2 a^2
!> b^2. All gradients are polynomials of a, b and t. At the apex a and b have no limit: they are 0, as on the axis.
module dotyk_mesh_shape_functions
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element_kind, only: triangle_edge, triangle_node
  implicit none
  private
  public :: lagrange_values, lagrange_gradients, serendipity_values, serendipity_gradients, simplex_values, &
    simplex_gradients, prism_node, prism_values, prism_gradients, collapsed_coordinates, pyramid_node, pyramid_values, &
    pyramid_gradients

  !> Node of the triangle (tri6) below or above each node: corners; edges 12 13 14 23 25 36 45 46 56; faces 1254 1463
  !> 2365.
  integer, parameter :: base(18) = [1, 2, 3, 1, 2, 3, 4, 6, 1, 5, 2, 3, 4, 6, 5, 4, 6, 5]
  integer, parameter :: height(18) = [-1, -1, -1, 1, 1, 1, -1, -1, 0, -1, 0, 0, 1, 1, 1, 0, 0, 0]  !! Of each node.

  integer, parameter :: apex = 5  !! The node at the apex.
  !> Coordinates a and b of the nodes, and twice their height: corners, apex; edges 12 14 15 23 25 34 35 45; base.
  integer, parameter :: place(3, 14) = reshape([ &
    -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0, 0, 0, 2, &
    0, -1, 0, -1, 0, 0, -1, -1, 1, 1, 0, 0, 1, -1, 1, 0, 1, 0, 1, 1, 1, -1, 1, 1, 0, 0, 0], [3, 14])

contains

  !> Lagrange polynomials of one variable and their derivatives; the index is the coordinate of the node.
  pure subroutine lagrange_line(order, x, value, derivative)
    integer, intent(in) :: order  !! Order, 1 (nodes -1 and 1; entry 0 is zero) or 2.
    real(dp), intent(in) :: x  !! Coordinate in [-1,1] [].
    real(dp), intent(out) :: value(-1:1)  !! Values (-1:1) [].
    real(dp), intent(out) :: derivative(-1:1)  !! Derivatives (-1:1) [].
    if (order == 1) then
      value = [0.5_dp*(1 - x), 0.0_dp, 0.5_dp*(1 + x)]
      derivative = [-0.5_dp, 0.0_dp, 0.5_dp]
    else
      value = [0.5_dp*x*(x - 1), (1 - x)*(1 + x), 0.5_dp*x*(x + 1)]
      derivative = [x - 0.5_dp, -2*x, x + 0.5_dp]
    end if
  end subroutine lagrange_line

  !> Tensor products of Lagrange polynomials.
  pure subroutine lagrange_values(order, d, n, node, xi, values)
    integer, intent(in) :: order  !! Order of the polynomials, 1 or 2.
    integer, intent(in) :: d  !! Dimension.
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: node(d, n)  !! Coordinates of the nodes (d, n).
    real(dp), intent(in) :: xi(d)  !! Reference coordinates (d) [].
    real(dp), intent(out) :: values(n)  !! Values of the shape functions (n) [].
    real(dp) :: value(-1:1), derivative(-1:1)
    integer :: k
    values = 1
    do k = 1, d
      call lagrange_line(order, xi(k), value, derivative)
      values = values*value(node(k, :))
    end do
  end subroutine lagrange_values

  !> Gradients of tensor products of Lagrange polynomials.
  pure subroutine lagrange_gradients(order, d, n, node, xi, gradients)
    integer, intent(in) :: order  !! Order of the polynomials, 1 or 2.
    integer, intent(in) :: d  !! Dimension.
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: node(d, n)  !! Coordinates of the nodes (d, n).
    real(dp), intent(in) :: xi(d)  !! Reference coordinates (d) [].
    real(dp), intent(out) :: gradients(d, n)  !! Gradients of the shape functions (d, n) [].
    real(dp) :: value(-1:1), derivative(-1:1)
    integer :: k, j
    gradients = 1
    do k = 1, d
      call lagrange_line(order, xi(k), value, derivative)
      do j = 1, d
        if (j == k) then
          gradients(j, :) = gradients(j, :)*derivative(node(k, :))
        else
          gradients(j, :) = gradients(j, :)*value(node(k, :))
        end if
      end do
    end do
  end subroutine lagrange_gradients

  !> Quadratic serendipity functions.
  pure subroutine serendipity_values(d, n, node, xi, values)
    integer, intent(in) :: d  !! Dimension, 2 or 3.
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: node(d, n)  !! Coordinates of the nodes: corners, then mid-sides (d, n).
    real(dp), intent(in) :: xi(d)  !! Reference coordinates (d) [].
    real(dp), intent(out) :: values(n)  !! Values of the shape functions (n) [].
    real(dp) :: factor, total
    integer :: i, k
    do i = 1, n
      factor = 1
      total = 1 - d
      do k = 1, d
        if (node(k, i) == 0) then
          factor = factor*(1 - xi(k))*(1 + xi(k))
          total = 1
        else
          factor = 0.5_dp*factor*(1 + node(k, i)*xi(k))
        end if
      end do
      if (all(node(:, i) /= 0)) total = total + sum(node(:, i)*xi)
      values(i) = factor*total
    end do
  end subroutine serendipity_values

  !> Gradients of the quadratic serendipity functions.
  pure subroutine serendipity_gradients(d, n, node, xi, gradients)
    integer, intent(in) :: d  !! Dimension, 2 or 3.
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: node(d, n)  !! Coordinates of the nodes: corners, then mid-sides (d, n).
    real(dp), intent(in) :: xi(d)  !! Reference coordinates (d) [].
    real(dp), intent(out) :: gradients(d, n)  !! Gradients of the shape functions (d, n) [].
    real(dp) :: others
    integer :: i, j, k
    logical :: corner
    do i = 1, n
      corner = all(node(:, i) /= 0)
      do j = 1, d
        others = 1
        do k = 1, d
          if (k == j) cycle
          if (node(k, i) == 0) then
            others = others*(1 - xi(k))*(1 + xi(k))
          else
            others = 0.5_dp*others*(1 + node(k, i)*xi(k))
          end if
        end do
        if (node(j, i) == 0) then
          gradients(j, i) = -2*xi(j)*others
        else if (corner) then
          ! d/dx [(1 + a x)(a x + rest)] / 2 with a = +-1, a**2 = 1.
          gradients(j, i) = 0.5_dp*others*node(j, i)*(node(j, i)*xi(j) + sum(node(:, i)*xi) + 2 - d)
        else
          gradients(j, i) = 0.5_dp*others*node(j, i)
        end if
      end do
    end do
  end subroutine serendipity_gradients

  !> Linear or quadratic functions on the simplex.
  pure subroutine simplex_values(d, n_edges, edge, xi, values)
    integer, intent(in) :: d  !! Dimension.
    integer, intent(in) :: n_edges  !! Number of edges that have a node: none for linear functions.
    integer, intent(in) :: edge(2, n_edges)  !! Corners of each edge (2, n_edges).
    real(dp), intent(in) :: xi(d)  !! Reference coordinates (d) [].
    real(dp), intent(out) :: values(d + 1 + n_edges)  !! Values of the shape functions (d+1+n_edges) [].
    real(dp) :: l(d + 1)
    integer :: i
    l(1) = 1 - sum(xi)
    l(2:) = xi
    if (n_edges == 0) then
      values(:d + 1) = l
      return
    end if
    values(:d + 1) = l*(2*l - 1)
    do i = 1, n_edges
      values(d + 1 + i) = 4*l(edge(1, i))*l(edge(2, i))
    end do
  end subroutine simplex_values

  !> Gradients of linear or quadratic functions on the simplex.
  pure subroutine simplex_gradients(d, n_edges, edge, xi, gradients)
    integer, intent(in) :: d  !! Dimension.
    integer, intent(in) :: n_edges  !! Number of edges that have a node: none for linear functions.
    integer, intent(in) :: edge(2, n_edges)  !! Corners of each edge (2, n_edges).
    real(dp), intent(in) :: xi(d)  !! Reference coordinates (d) [].
    real(dp), intent(out) :: gradients(d, d + 1 + n_edges)  !! Gradients of the shape functions (d, d+1+n_edges) [].
    real(dp) :: l(d + 1), slope(d, d + 1)
    integer :: i
    slope(:, 1) = -1
    slope(:, 2:) = 0
    do i = 1, d
      slope(i, i + 1) = 1
    end do
    if (n_edges == 0) then
      gradients(:, :d + 1) = slope
      return
    end if
    l(1) = 1 - sum(xi)
    l(2:) = xi
    do i = 1, d + 1
      gradients(:, i) = (4*l(i) - 1)*slope(:, i)
    end do
    do i = 1, n_edges
      gradients(:, d + 1 + i) = 4*(l(edge(1, i))*slope(:, edge(2, i)) + l(edge(2, i))*slope(:, edge(1, i)))
    end do
  end subroutine simplex_gradients

  !> Reference coordinates of a node.
  pure function prism_node(i) result(xi)
    integer, intent(in) :: i  !! Node number, 1..18.
    real(dp) :: xi(3)  !! Reference coordinates (3) [].
    xi = [triangle_node(:, base(i)), real(height(i), dp)]
  end function prism_node

  !> Shape functions of a prism.
  pure subroutine prism_values(n, xi, values)
    integer, intent(in) :: n  !! Number of nodes: 6, 15 or 18.
    real(dp), intent(in) :: xi(3)  !! Reference coordinates (3) [].
    real(dp), intent(out) :: values(n)  !! Values of the shape functions (n) [].
    real(dp) :: flat(6), line(-1:1), slope(-1:1), l(3), z
    integer :: i, b
    select case (n)
    case (6)
      call simplex_values(2, 0, triangle_edge, xi, flat)
      call lagrange_line(1, xi(3), line, slope)
      values = flat(base(:6))*line(height(:6))
    case (18)
      call simplex_values(2, 3, triangle_edge, xi, flat)
      call lagrange_line(2, xi(3), line, slope)
      values = flat(base)*line(height)
    case default
      l = [1 - xi(1) - xi(2), xi(1), xi(2)]
      do i = 1, n
        b = base(i)
        z = height(i)*xi(3)
        if (b > 3) then
          values(i) = 2*l(triangle_edge(1, b - 3))*l(triangle_edge(2, b - 3))*(1 + z)
        else if (height(i) == 0) then
          values(i) = l(b)*(1 - xi(3))*(1 + xi(3))
        else
          values(i) = 0.5_dp*l(b)*(1 + z)*(2*l(b) - 2 + z)
        end if
      end do
    end select
  end subroutine prism_values

  !> Gradients of the shape functions of a prism.
  pure subroutine prism_gradients(n, xi, gradients)
    integer, intent(in) :: n  !! Number of nodes: 6, 15 or 18.
    real(dp), intent(in) :: xi(3)  !! Reference coordinates (3) [].
    real(dp), intent(out) :: gradients(3, n)  !! Gradients of the shape functions (3, n) [].
    real(dp) :: flat(6), flat_slope(2, 6), line(-1:1), slope(-1:1)
    integer :: i, edges, order
    if (n == 15) then
      call prism15_gradients(xi, gradients)
      return
    end if
    order = merge(1, 2, n == 6)
    edges = merge(0, 3, n == 6)
    call simplex_values(2, edges, triangle_edge, xi, flat)
    call simplex_gradients(2, edges, triangle_edge, xi, flat_slope)
    call lagrange_line(order, xi(3), line, slope)
    do i = 1, n
      gradients(:2, i) = flat_slope(:, base(i))*line(height(i))
      gradients(3, i) = flat(base(i))*slope(height(i))
    end do
  end subroutine prism_gradients

  !> Gradients of the shape functions of prism15.
  pure subroutine prism15_gradients(xi, gradients)
    real(dp), intent(in) :: xi(3)  !! Reference coordinates (3) [].
    real(dp), intent(out) :: gradients(3, 15)  !! Gradients of the shape functions (3, 15) [].
    real(dp) :: l(3), l_slope(2, 3), z
    integer :: i, b, p, q
    l = [1 - xi(1) - xi(2), xi(1), xi(2)]
    l_slope = reshape([-1.0_dp, -1.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [2, 3])
    do i = 1, 15
      b = base(i)
      z = height(i)*xi(3)
      if (b > 3) then
        p = triangle_edge(1, b - 3)
        q = triangle_edge(2, b - 3)
        gradients(:2, i) = 2*(1 + z)*(l(p)*l_slope(:, q) + l(q)*l_slope(:, p))
        gradients(3, i) = 2*l(p)*l(q)*height(i)
      else if (height(i) == 0) then
        gradients(:2, i) = (1 - xi(3))*(1 + xi(3))*l_slope(:, b)
        gradients(3, i) = -2*l(b)*xi(3)
      else
        gradients(:2, i) = 0.5_dp*(1 + z)*(4*l(b) - 2 + z)*l_slope(:, b)
        gradients(3, i) = 0.5_dp*l(b)*(2*l(b) - 1 + 2*z)*height(i)
      end if
    end do
  end subroutine prism15_gradients

  !> Reference coordinates of a node.
  pure function pyramid_node(i) result(xi)
    integer, intent(in) :: i  !! Node number, 1..14.
    real(dp) :: xi(3)  !! Reference coordinates (3) [].
    xi(3) = 0.5_dp*place(3, i)
    xi(:2) = (1 - xi(3))*place(:2, i)
  end function pyramid_node

  !> The coordinates a, b and t of a point; a = b = 0 at the apex.
  pure function collapsed_coordinates(xi) result(abt)
    real(dp), intent(in) :: xi(3)  !! Reference coordinates (3) [].
    real(dp) :: abt(3)  !! Collapsed coordinates (3) [].
    abt = [0.0_dp, 0.0_dp, 1 - xi(3)]
    if (abs(abt(3)) > 0) abt(:2) = xi(:2)/abt(3)
  end function collapsed_coordinates

  !> Shape functions of a pyramid.
  pure subroutine pyramid_values(n, xi, values)
    integer, intent(in) :: n  !! Number of nodes: 5, 13 or 14.
    real(dp), intent(in) :: xi(3)  !! Reference coordinates (3) [].
    real(dp), intent(out) :: values(n)  !! Values of the shape functions (n) [].
    real(dp) :: abt(3), first(3, n), second(3, n)
    abt = collapsed_coordinates(xi)
    call factors(n, abt(1), abt(2), first, second)
    values = abt(3)*(first(1, :) + abt(3)*second(1, :))
    values(apex) = merge(xi(3), xi(3)*(2*xi(3) - 1), n == 5)
  end subroutine pyramid_values

  !> Gradients of the shape functions of a pyramid.
  pure subroutine pyramid_gradients(n, xi, gradients)
    integer, intent(in) :: n  !! Number of nodes: 5, 13 or 14.
    real(dp), intent(in) :: xi(3)  !! Reference coordinates (3) [].
    real(dp), intent(out) :: gradients(3, n)  !! Gradients of the shape functions (3, n) [].
    real(dp) :: abt(3), first(3, n), second(3, n)
    integer :: i
    abt = collapsed_coordinates(xi)
    call factors(n, abt(1), abt(2), first, second)
    do i = 1, n
      gradients(:2, i) = first(2:, i) + abt(3)*second(2:, i)
      ! With t, a and b also depend on the height.
      gradients(3, i) = dot_product(abt(:2), gradients(:2, i)) - first(1, i) - 2*abt(3)*second(1, i)
    end do
    gradients(:, apex) = [0.0_dp, 0.0_dp, merge(1.0_dp, 4*xi(3) - 1, n == 5)]
  end subroutine pyramid_gradients

  !> Factors of t and of t^2 in the shape functions of all nodes but the apex: values, derivatives by a and by b.
  pure subroutine factors(n, a, b, first, second)
    integer, intent(in) :: n  !! Number of nodes: 5, 13 or 14.
    real(dp), intent(in) :: a, b  !! Collapsed coordinates [].
    real(dp), intent(out) :: first(3, n)  !! Factor of t (3, n) [].
    real(dp), intent(out) :: second(3, n)  !! Factor of t^2 (3, n) [].
    real(dp) :: f(2), g(2), flat(3), sum_ab, bubble(3)
    integer :: i
    first = 0
    second = 0
    bubble = [(1 - a)*(1 + a)*(1 - b)*(1 + b), -2*a*(1 - b)*(1 + b), -2*b*(1 - a)*(1 + a)]
    do i = 1, n
      if (i == apex) cycle
      f = line(place(1, i), a)
      g = line(place(2, i), b)
      flat = [f(1)*g(1), f(2)*g(1), f(1)*g(2)]
      if (n == 5) then
        first(:, i) = flat
      else if (place(3, i) == 1) then
        first(:, i) = 4*flat
        second(:, i) = -4*flat
      else if (any(place(:2, i) == 0)) then
        second(:, i) = flat
        if (n == 14 .and. i < n) second(:, i) = flat - 0.5_dp*bubble
      else
        sum_ab = place(1, i)*a + place(2, i)*b
        first(:, i) = -flat
        second(:, i) = sum_ab*flat + [0.0_dp, place(1, i)*flat(1), place(2, i)*flat(1)]
        if (n == 14) second(:, i) = second(:, i) + 0.25_dp*bubble
      end if
    end do
  end subroutine factors

  !> A polynomial of one coordinate and its derivative: linear for a node at the end, quadratic for one in the middle.
  pure function line(node, x) result(f)
    integer, intent(in) :: node  !! Coordinate of the node: -1, 0 or 1.
    real(dp), intent(in) :: x  !! Coordinate [].
    real(dp) :: f(2)  !! Value and derivative (2) [].
    if (node == 0) then
      f = [(1 - x)*(1 + x), -2*x]
    else
      f = 0.5_dp*[1 + node*x, real(node, dp)]
    end if
  end function line
end module dotyk_mesh_shape_functions
