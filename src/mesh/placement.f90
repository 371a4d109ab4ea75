!> Placement of a body: a rotation about the origin of its mesh, then a translation.
module dotyk_mesh_placement
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  !> Rigid motion x -> rotation x + shift.
  type, public :: placement_t
    !> Rotation matrix; in two dimensions about z (3, 3) [].
    real(dp) :: rotation(3, 3) = &
      reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3])
    !> Translation (3) [length].
    real(dp) :: shift(3) = 0
    !> Whether the rotation differs from the identity.
    logical :: rotated = .false.
  contains
    procedure :: init => placement_init
    procedure :: apply => placement_apply
  end type placement_t

contains

  !> Set up from the input.
  subroutine placement_init(self, axis, angle, shift)
    class(placement_t), intent(out) :: self
    !> Axis of rotation, of any length but 0 (3) [].
    real(dp), intent(in) :: axis(3)
    !> Angle of rotation [degrees].
    real(dp), intent(in) :: angle
    !> Translation (3) [length].
    real(dp), intent(in) :: shift(3)
    real(dp) :: unit(3), c, s, basis(3)
    integer :: k
    self%shift = shift
    call cosine_and_sine(angle, c, s)
    self%rotated = .not. c >= 1
    if (.not. self%rotated) return
    unit = axis/maxval(abs(axis))
    unit = unit/norm2(unit)
    ! Rodrigues' formula, column by column.
    do k = 1, 3
      basis = 0
      basis(k) = 1
      self%rotation(:, k) = c*basis + s*cross(unit, basis) + (1 - c)*unit(k)*unit
    end do
  end subroutine placement_init

  !> Cosine and sine of an angle in degrees; exact for multiples of 90 degrees, so that axis-parallel lines stay
  !> axis-parallel.
  pure subroutine cosine_and_sine(angle, c, s)
    !> Angle [degrees].
    real(dp), intent(in) :: angle
    !> Cosine [].
    real(dp), intent(out) :: c
    !> Sine [].
    real(dp), intent(out) :: s
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

  !> Move points.
  pure subroutine placement_apply(self, x)
    class(placement_t), intent(in) :: self
    !> Positions (dimension, n) [length].
    real(dp), intent(inout) :: x(:, :)
    integer :: i, d
    d = size(x, 1)
    do i = 1, size(x, 2)
      if (self%rotated) x(:, i) = matmul(self%rotation(:d, :d), x(:, i))
      x(:, i) = x(:, i) + self%shift(:d)
    end do
  end subroutine placement_apply
end module dotyk_mesh_placement
