!> Prisms: prism6, prism15 (serendipity) and prism18. Reference domain: unit triangle x [-1,1].
module dotyk_mesh_prism
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element_kind, only: triangle_edge, triangle_node
  use dotyk_mesh_shape_functions, only: lagrange_line, simplex_gradients, simplex_values
  implicit none
  private
  public :: prism_node, prism_values, prism_gradients

  !> Node of the triangle (tri6) below or above each node: corners; edges 12 13 14 23 25 36 45 46 56; faces 1254 1463
  !> 2365.
  integer, parameter :: base(18) = [1, 2, 3, 1, 2, 3, 4, 6, 1, 5, 2, 3, 4, 6, 5, 4, 6, 5]
  integer, parameter :: height(18) = [-1, -1, -1, 1, 1, 1, -1, -1, 0, -1, 0, 0, 1, 1, 1, 0, 0, 0]  !! Of each node.

contains

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
      call serendipity_gradients(xi, gradients)
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
  pure subroutine serendipity_gradients(xi, gradients)
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
  end subroutine serendipity_gradients
end module dotyk_mesh_prism
