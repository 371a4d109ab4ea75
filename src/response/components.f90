!> Between Cartesian components at the contact nodes and the unknowns of a system.
module dotyk_response_components
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: scatter, gather

contains

  !> Forces at the contact nodes to a right-hand side.
  pure subroutine scatter(dim, n, equation, axes_of, axes, force, x)
    !> Numbers of displacement components and of contact nodes.
    integer, intent(in) :: dim, n
    !> Unknown of each component (0: none) and axes of each node (0: global), an index into `axes`.
    integer, intent(in) :: equation(dim, n), axes_of(n)
    real(dp), intent(in) :: axes(:, :, :)
    !> Forces [force].
    real(dp), intent(in) :: force(dim, n)
    !> Right-hand side (n_equations).
    real(dp), intent(out) :: x(:)
    real(dp) :: local(dim)
    integer :: i, k
    x = 0
    do i = 1, n
      local = force(:, i)
      if (axes_of(i) > 0) local = matmul(local, axes(:, :, axes_of(i)))
      do k = 1, dim
        if (equation(k, i) > 0) x(equation(k, i)) = local(k)
      end do
    end do
  end subroutine scatter

  !> A solution to displacements of the contact nodes.
  pure subroutine gather(dim, n, equation, axes_of, axes, x, displacement)
    !> As in `scatter`.
    integer, intent(in) :: dim, n
    integer, intent(in) :: equation(dim, n), axes_of(n)
    real(dp), intent(in) :: axes(:, :, :)
    !> Solution (n_equations).
    real(dp), intent(in) :: x(:)
    !> Displacements [length].
    real(dp), intent(out) :: displacement(dim, n)
    real(dp) :: local(dim)
    integer :: i, k
    do i = 1, n
      local = 0
      do k = 1, dim
        if (equation(k, i) > 0) local(k) = x(equation(k, i))
      end do
      if (axes_of(i) > 0) local = matmul(axes(:, :, axes_of(i)), local)
      displacement(:, i) = local
    end do
  end subroutine gather
end module dotyk_response_components
