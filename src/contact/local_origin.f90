!> Local origin of the coordinates of a pair of surfaces, so that scenes far from the global origin keep their accuracy.
module dotyk_contact_local_origin
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: kind_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: choose_origin, shift_origin

  !> A surface is far from the origin where its distance exceeds this multiple of its size.
  real(dp), parameter :: far_ratio = 16

contains

  !> Local origin: zero, except for a surface that is far from the origin, where sums of coordinates would lose the
  !> significant digits of the gaps; differences of coordinates do not.
  pure subroutine choose_origin(x, surface, origin)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    real(dp), intent(out) :: origin(:)  !! A node of the surface, or zero (dimension) [length].
    real(dp) :: low(size(origin)), high(size(origin))
    integer :: f, i
    low = huge(1.0_dp)
    high = -huge(1.0_dp)
    do f = 1, surface%n_facets
      do i = 1, kind_nodes(surface%kind(f))
        low = min(low, x(:, surface%node(i, f)))
        high = max(high, x(:, surface%node(i, f)))
      end do
    end do
    origin = 0
    if (surface%n_facets == 0) return
    if (maxval(abs(low + high)/2) > far_ratio*maxval(high - low)) origin = x(:, surface%node(1, 1))
  end subroutine choose_origin

  !> Subtract an origin from coordinates.
  pure subroutine shift_origin(x, origin)
    real(dp), intent(inout) :: x(:, :)  !! Coordinates (dimension, n) [length].
    real(dp), intent(in) :: origin(3)  !! Origin (3) [length].
    integer :: i
    do i = 1, size(x, 2)
      x(:, i) = x(:, i) - origin(1:size(x, 1))
    end do
  end subroutine shift_origin
end module dotyk_contact_local_origin
