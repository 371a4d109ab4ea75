!> Projection of forces and displacements on the complement of the rigid body modes R of a body: `P = I - R R^T`.
module dotyk_response_mode_projection
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: remove_modes

contains

  !> x := P x.
  pure subroutine remove_modes(mode, x)
    real(dp), intent(in) :: mode(:, :)  !! Orthonormal modes over the equations (n_equations, n_modes) [].
    real(dp), intent(inout) :: x(:)  !! A force or a displacement (n_equations) [force or length].
    real(dp) :: amplitude(size(mode, 2))
    integer :: k
    do k = 1, size(mode, 2)
      amplitude(k) = dot_product(mode(:, k), x)
    end do
    do k = 1, size(mode, 2)
      x = x - amplitude(k)*mode(:, k)
    end do
  end subroutine remove_modes
end module dotyk_response_mode_projection
