!> Taking rigid motions R off forces and displacements over the equations of a body: `P = I - R R^T`.
module dotyk_response_motions
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: remove_motions, subtract_motions

contains

  !> x <- P x.
  pure subroutine remove_motions(rigid, x)
    !> Orthonormal motions (n, n_motions).
    real(dp), intent(in) :: rigid(:, :)
    real(dp), intent(inout) :: x(:)
    real(dp) :: amplitude(size(rigid, 2))
    integer :: k
    do k = 1, size(rigid, 2)
      amplitude(k) = dot_product(rigid(:, k), x)
    end do
    call subtract_motions(rigid, amplitude, x)
  end subroutine remove_motions

  !> x <- x - R amplitude.
  pure subroutine subtract_motions(rigid, amplitude, x)
    !> Motions (n, n_motions).
    real(dp), intent(in) :: rigid(:, :)
    !> Their amplitudes (n_motions).
    real(dp), intent(in) :: amplitude(:)
    real(dp), intent(inout) :: x(:)
    integer :: k
    do k = 1, size(rigid, 2)
      x = x - amplitude(k)*rigid(:, k)
    end do
  end subroutine subtract_motions
end module dotyk_response_motions
