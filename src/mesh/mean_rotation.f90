!> The mean rotation of moving points.
module dotyk_mesh_mean_rotation
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: mean_rotation

contains

  !> Rotation vector of points about their centre, by least squares; 0 for points on a line, which have none (3) [rad].
  pure function mean_rotation(x, u) result(omega)
    real(dp), intent(in) :: x(:, :)  !! The points (dimension, n) [length].
    real(dp), intent(in) :: u(:, :)  !! Their displacements (dimension, n) [length].
    real(dp) :: omega(3), r(3), centre(3), moment(3), inertia(3, 3), determinant
    integer :: i, j, d
    d = size(x, 1)
    centre = 0
    centre(1:d) = sum(x, 2)/size(x, 2)
    r = 0
    omega = 0
    moment = 0
    inertia = 0
    do i = 1, size(x, 2)
      r(1:d) = x(:, i) - centre(1:d)
      omega(1:d) = u(:, i)
      moment = moment + cross(r, omega)
      do j = 1, 3
        inertia(:, j) = inertia(:, j) - r*r(j)
        inertia(j, j) = inertia(j, j) + dot_product(r, r)
      end do
    end do
    omega = 0
    determinant = dot_product(inertia(:, 1), cross(inertia(:, 2), inertia(:, 3)))
    if (.not. determinant > epsilon(determinant)*maxval(inertia)**3) return
    ! Cramer's rule.
    omega = [dot_product(moment, cross(inertia(:, 2), inertia(:, 3))), &
             dot_product(moment, cross(inertia(:, 3), inertia(:, 1))), &
             dot_product(moment, cross(inertia(:, 1), inertia(:, 2)))]/determinant
  end function mean_rotation
end module dotyk_mesh_mean_rotation
