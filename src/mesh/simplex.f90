!> Shape functions on the unit simplex: common to triangles and tetrahedra.
!>
!> Barycentric coordinates L_1 = 1 - sum(xi), L_(k+1) = xi_k. Quadratic functions are L (2 L - 1) at corners and 4 L_i
!> L_j at the middle of the edge i-j.
module dotyk_mesh_simplex
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: simplex_values, simplex_gradients

contains

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
end module dotyk_mesh_simplex
