!> Placement of a body: a rotation about the origin of its mesh, then a translation; and the mean rotation of moving
!> points.
module dotyk_mesh_placement
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_rotation, only: cosine_and_sine, rotation_matrix
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: mean_rotation

  type, public :: placement_t  !! Rigid motion x -> rotation x + shift.
    !> Rotation matrix; in two dimensions about z (3, 3) [].
    real(dp) :: rotation(3, 3) = &
      reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3])
    real(dp) :: shift(3) = 0  !! Translation (3) [length].
    logical :: rotated = .false.  !! Whether the rotation differs from the identity.
  contains
    procedure :: init => placement_init
    procedure :: apply => placement_apply
    procedure :: carry => placement_carry
  end type placement_t

contains

  !> Set up from the input.
  subroutine placement_init(self, axis, angle, shift)
    class(placement_t), intent(out) :: self
    real(dp), intent(in) :: axis(3)  !! Axis of rotation, of any length but 0 (3) [].
    real(dp), intent(in) :: angle  !! Angle of rotation [degrees].
    real(dp), intent(in) :: shift(3)  !! Translation (3) [length].
    real(dp) :: c, s
    self%shift = shift
    call cosine_and_sine(angle, c, s)
    self%rotated = .not. c >= 1
    if (self%rotated) self%rotation = rotation_matrix(axis, angle)
  end subroutine placement_init

  !> Move points.
  pure subroutine placement_apply(self, x)
    class(placement_t), intent(in) :: self
    real(dp), intent(inout) :: x(:, :)  !! Positions (dimension, n) [length].
    integer :: i, d
    d = size(x, 1)
    do i = 1, size(x, 2)
      if (self%rotated) x(:, i) = matmul(self%rotation(:d, :d), x(:, i))
      x(:, i) = x(:, i) + self%shift(:d)
    end do
  end subroutine placement_apply

  !> Put it into a parcel, or take it out.
  subroutine placement_carry(self, parcel)
    class(placement_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry_fixed(size(self%rotation), self%rotation)
    call parcel%carry_fixed(size(self%shift), self%shift)
    call parcel%carry(self%rotated)
  end subroutine placement_carry

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
end module dotyk_mesh_placement
