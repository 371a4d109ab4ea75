!> Shape functions from the coordinates of the nodes.
!>
!> On [-1,1]^d (lines, quadrilaterals, hexahedra) nodes have integer coordinates -1, 0, 1. Two families: tensor products
!> of Lagrange polynomials, and the quadratic serendipity functions (nodes at corners and mid-sides only). On the unit
!> simplex (triangles, tetrahedra) barycentric coordinates are L_1 = 1 - sum(xi), L_(k+1) = xi_k. Quadratic functions
!> are L (2 L - 1) at corners and 4 L_i L_j at the middle of the edge i-j.
module dotyk_mesh_shape_functions
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: lagrange_line, lagrange_values, lagrange_gradients, serendipity_values, serendipity_gradients, &
    simplex_values, simplex_gradients

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
end module dotyk_mesh_shape_functions
