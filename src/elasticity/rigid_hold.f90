!> A rigid body: all its displacements are those of one rigid motion, u(x) = a + w x (x - p), about a point p.
!>
!> Components of a and w are held, with given values, or free. No unknown of its nodes is left to the stiffness: the
!> held motions give their displacements, and the free motions are its rigid body modes, which contact must balance.
module dotyk_elasticity_rigid_hold
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  !> How a rigid body is held.
  type, public :: rigid_hold_t
    !> Whether the body is rigid.
    logical :: is_set = .false.
    !> Whether each component of a and w is held (6).
    logical :: held(6) = .false.
    !> a and w along held components, 0 along others (6) [length, radian].
    real(dp) :: motion(6) = 0
    !> p (3) [length].
    real(dp) :: point(3) = 0
  contains
    procedure :: displacement => rigid_hold_displacement
    procedure :: add_rows => rigid_hold_add_rows
    procedure :: reaction => rigid_hold_reaction
    procedure :: carry => rigid_hold_carry
  end type rigid_hold_t

contains

  !> Displacement of the held motions at a point (dim) [length].
  pure function rigid_hold_displacement(self, x) result(u)
    class(rigid_hold_t), intent(in) :: self
    !> The point, two or three coordinates (dim) [length].
    real(dp), intent(in) :: x(:)
    real(dp) :: u(size(x)), arm(3), moved(3)
    arm = 0
    arm(:size(x)) = x - self%point(:size(x))
    moved = self%motion(1:3) + cross(self%motion(4:6), arm)
    u = moved(:size(x))
  end function rigid_hold_displacement

  !> Rows of the held components over motions of a body: those of a, and of w times the radius.
  pure subroutine rigid_hold_add_rows(self, centre, radius, exists, row)
    class(rigid_hold_t), intent(in) :: self
    !> Centre of the body, to which the motions refer (3) [length].
    real(dp), intent(in) :: centre(3)
    !> Its radius: motions are a translation, and a rotation times the radius [length].
    real(dp), intent(in) :: radius
    !> Motions that exist in the analysis (n).
    integer, intent(in) :: exists(:)
    !> The rows (n_held, n) [].
    real(dp), allocatable, intent(out) :: row(:, :)
    real(dp) :: all(6), axis(3)
    integer :: k, m
    allocate (row(count(self%held(exists)), size(exists)))
    m = 0
    do k = 1, 6
      if (.not. self%held(k) .or. .not. any(exists == k)) cycle
      axis = 0
      axis(merge(k, k - 3, k <= 3)) = 1
      all = [0*axis, axis]
      if (k <= 3) all = [axis, cross((self%point - centre)/radius, axis)]
      m = m + 1
      row(m, :) = all(exists)
    end do
  end subroutine rigid_hold_add_rows

  !> Reaction of the held components to forces, and its moment about the origin (6) [force, force length].
  pure function rigid_hold_reaction(self, sums) result(reaction)
    class(rigid_hold_t), intent(in) :: self
    !> What would balance all forces on the body, with its moment about the origin (6) [force, force length].
    real(dp), intent(in) :: sums(6)
    real(dp) :: reaction(6)
    reaction = [sums(1:3), sums(4:6) - cross(self%point, sums(1:3))]
    where (.not. self%held) reaction = 0
    reaction(4:6) = reaction(4:6) + cross(self%point, reaction(1:3))
  end function rigid_hold_reaction

  !> Put it into a parcel, or take it out.
  subroutine rigid_hold_carry(self, parcel)
    class(rigid_hold_t), intent(inout) :: self
    !> The parcel.
    type(parcel_t), intent(inout) :: parcel
    integer :: k
    call parcel%carry(self%is_set)
    do k = 1, 6
      call parcel%carry(self%held(k))
    end do
    call parcel%carry_fixed(6, self%motion)
    call parcel%carry_fixed(3, self%point)
  end subroutine rigid_hold_carry
end module dotyk_elasticity_rigid_hold
