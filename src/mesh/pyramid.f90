!> Pyramids: pyramid5, pyramid13 (serendipity base) and pyramid14. Reference domain: base [-1,1]^2 at height 0, apex
!> (0,0,1).
!>
!> In the collapsed coordinates t = 1 - xi_3, a = xi_1/t, b = xi_2/t the pyramid is [-1,1]^2 x [0,1]. Its functions of
!> order r are t^k a^i b^j with i, j <= k <= r: rational in xi, complete to the order r, and those of quadrilaterals on
!> the base, of simplices on the triangles, so that elements conform with hexahedra, prisms and tetrahedra (Bedrosian,
!> Int. J. Numer. Methods Eng. 35, 1992; Bergot, Cohen and Durufle, J. Sci. Comput. 42, 2010). pyramid13 lacks t^2 a^2
!> b^2. All gradients are polynomials of a, b and t. At the apex a and b have no limit: they are 0, as on the axis.
module dotyk_mesh_pyramid
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: collapsed_coordinates, pyramid_node, pyramid_values, pyramid_gradients

  integer, parameter :: apex = 5  !! The node at the apex.
  !> Coordinates a and b of the nodes, and twice their height: corners, apex; edges 12 14 15 23 25 34 35 45; base.
  integer, parameter :: place(3, 14) = reshape([ &
    -1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0, 0, 0, 2, &
    0, -1, 0, -1, 0, 0, -1, -1, 1, 1, 0, 0, 1, -1, 1, 0, 1, 0, 1, 1, 1, -1, 1, 1, 0, 0, 0], [3, 14])

contains

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
end module dotyk_mesh_pyramid
