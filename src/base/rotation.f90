!> Rotations about an axis, by angles in degrees.
module dotyk_base_rotation
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: cosine_and_sine, rotation_matrix

contains

  !> Cosine and sine of an angle in degrees; exact for multiples of 90 degrees, so that axis-parallel lines stay
  !> axis-parallel.
  pure subroutine cosine_and_sine(angle, c, s)
    real(dp), intent(in) :: angle  !! Angle [degrees].
    real(dp), intent(out) :: c  !! Cosine [].
    real(dp), intent(out) :: s  !! Sine [].
    real(dp), parameter :: degree = acos(-1.0_dp)/180
    real(dp), parameter :: quarter_cosine(0:3) = [1, 0, -1, 0], quarter_sine(0:3) = [0, 1, 0, -1]
    real(dp) :: reduced, remainder
    integer :: quarter
    reduced = modulo(angle, 360.0_dp)
    quarter = modulo(nint(reduced/90), 4)
    remainder = (reduced - 90*nint(reduced/90))*degree
    c = quarter_cosine(quarter)*cos(remainder) - quarter_sine(quarter)*sin(remainder)
    s = quarter_sine(quarter)*cos(remainder) + quarter_cosine(quarter)*sin(remainder)
  end subroutine cosine_and_sine

  !> Rotation about an axis (Rodrigues' formula).
  pure function rotation_matrix(axis, angle) result(rotation)
    real(dp), intent(in) :: axis(3)  !! Axis of rotation, of any length but 0 (3) [].
    real(dp), intent(in) :: angle  !! Angle of rotation, right-handed about the axis [degrees].
    real(dp) :: rotation(3, 3)
    real(dp) :: unit(3), c, s, basis(3)
    integer :: k
    call cosine_and_sine(angle, c, s)
    unit = axis/maxval(abs(axis))
    unit = unit/norm2(unit)
    do k = 1, 3
      basis = 0
      basis(k) = 1
      rotation(:, k) = c*basis + s*cross(unit, basis) + (1 - c)*unit(k)*unit
    end do
  end function rotation_matrix

  !> Vector product.
  pure function cross(a, b) result(c)
    real(dp), intent(in) :: a(3)  !! First vector (3) [].
    real(dp), intent(in) :: b(3)  !! Second vector (3) [].
    real(dp) :: c(3)  !! Product (3) [].
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross
end module dotyk_base_rotation
