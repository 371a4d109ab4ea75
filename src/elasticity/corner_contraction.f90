!> Element matrices on the way to the corner space: without held components, and P_e^T K_e P_e.
module dotyk_elasticity_corner_contraction
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_constraint, only: held
  implicit none
  private
  public :: clear_held, contract

contains

  !> Set the rows and columns of held components to zero.
  pure subroutine clear_held(n, dim, equation, k)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: equation(dim, n)  !! Equations of the nodes of the element (dim, n).
    real(dp), intent(inout) :: k(n, n, dim, dim)  !! Element stiffness in nodal axes (n, n, dim, dim) [force/length].
    integer :: a, i
    do i = 1, dim
      do a = 1, n
        if (equation(i, a) /= held) cycle
        k(a, :, i, :) = 0
        k(:, a, :, i) = 0
      end do
    end do
  end subroutine clear_held

  !> P_e^T K_e P_e for a symmetric element matrix K_e.
  pure subroutine contract(n, nc, dim, m, node, corner, weight, k, corner_k)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: nc  !! Number of its corners.
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: m  !! Number of weights of the interpolation.
    integer, intent(in) :: node(m)  !! Node of each weight (m).
    integer, intent(in) :: corner(m)  !! Corner of each weight (m).
    real(dp), intent(in) :: weight(m)  !! Weights (m) [].
    real(dp), intent(in) :: k(n, n, dim, dim)  !! K_e in global axes (n, n, dim, dim) [force/length].
    real(dp), intent(out) :: corner_k(nc, nc, dim, dim)  !! P_e^T K_e P_e (nc, nc, dim, dim) [force/length].
    real(dp) :: half(n, nc)
    integer :: i, j, c, q
    do j = 1, dim
      do i = j, dim
        half = 0
        do q = 1, m
          half(:, corner(q)) = half(:, corner(q)) + weight(q)*k(:, node(q), i, j)
        end do
        do c = 1, nc
          corner_k(:, c, i, j) = 0
          do q = 1, m
            corner_k(corner(q), c, i, j) = corner_k(corner(q), c, i, j) + weight(q)*half(node(q), c)
          end do
        end do
        if (i > j) corner_k(:, :, j, i) = transpose(corner_k(:, :, i, j))
      end do
    end do
  end subroutine contract
end module dotyk_elasticity_corner_contraction
