!> Vectors over the equations of a body, and over all unknowns of its nodes, zero where they are held.
module dotyk_response_free_unknowns
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: to_equations, to_unknowns

contains

  !> Values of equations at their unknowns; zero where held.
  pure subroutine to_unknowns(n, equation, x, y)
    integer, intent(in) :: n  !! Number of unknowns.
    integer, intent(in) :: equation(n)  !! Their equations, 0 or less where held (n).
    real(dp), intent(in) :: x(:)  !! Over the equations (n_equations) [any].
    real(dp), intent(out) :: y(:)  !! Over the unknowns (n) [as x].
    integer :: i
    do i = 1, n
      y(i) = 0
      if (equation(i) > 0) y(i) = x(equation(i))
    end do
  end subroutine to_unknowns

  !> Values of unknowns at their equations.
  pure subroutine to_equations(n, equation, y, x)
    integer, intent(in) :: n  !! Number of unknowns.
    integer, intent(in) :: equation(n)  !! Their equations, 0 or less where held (n).
    real(dp), intent(in) :: y(:)  !! Over the unknowns (n) [any].
    real(dp), intent(inout) :: x(:)  !! Over the equations (n_equations) [as y].
    integer :: i
    do i = 1, n
      if (equation(i) > 0) x(equation(i)) = y(i)
    end do
  end subroutine to_equations
end module dotyk_response_free_unknowns
