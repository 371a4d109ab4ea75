!> Dirichlet conditions of a body: equations of the free unknowns, prescribed displacements, and nodal axes. The free
!> unknowns alone are the displacements with supports at rest, equation (10), the space V_0.
!>
!> A node has the global axes or local axes (columns of a frame, "rotated unknowns"); its unknowns are the
!> displacements along them. Free unknowns are numbered node by node, along the axes of each node. Vectors outside of
!> this module are in global axes.
module dotyk_elasticity_constraint
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_elasticity_foundation, only: foundation_t
  use dotyk_elasticity_rigid_hold, only: rigid_hold_t
  implicit none
  private

  type, public :: constraint_t  !! Equations and prescribed displacements of the nodes of a body.
    !> Equation of each nodal unknown, `held` (0) where its displacement is prescribed (dim, n_nodes).
    integer, allocatable :: equation(:, :)
    integer :: n_equations = 0  !! Number of free equations.
    !> Prescribed displacement along the nodal axes, 0 where free (dim, n_nodes) [length].
    real(dp), allocatable :: prescribed(:, :)
    !> Index in `frame` of the local axes of each node, 0 for the global axes (n_nodes).
    integer, allocatable :: frame_of(:)
    real(dp), allocatable :: frame(:, :, :)  !! Local axes as columns (dim, dim, n_frames) [].
    type(foundation_t) :: foundation  !! Springs on surfaces: elastic supports.
    type(rigid_hold_t) :: rigid  !! How the body is held where it is rigid: then no equation is left.
  contains
    procedure :: init => constraint_init
    procedure :: number_equations => constraint_number_equations
    procedure :: reduce => constraint_reduce
    procedure :: expand => constraint_expand
    procedure :: expand_long => constraint_expand_long
    procedure :: carry => constraint_carry
  end type constraint_t

  integer, parameter, public :: held = 0  !! Value of `equation` for a prescribed unknown.

contains

  !> Create a constraint without supports: all unknowns free, in global axes.
  subroutine constraint_init(self, dim, n_nodes)
    class(constraint_t), intent(out) :: self
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n_nodes  !! Number of nodes.
    allocate (self%equation(dim, n_nodes), source=1)
    allocate (self%prescribed(dim, n_nodes), source=0.0_dp)
    allocate (self%frame_of(n_nodes), source=0)
    allocate (self%frame(dim, dim, 0))
    call self%number_equations()
  end subroutine constraint_init

  !> Number the unknowns that are not held.
  pure subroutine constraint_number_equations(self)
    class(constraint_t), intent(inout) :: self
    integer :: i, k, n
    n = 0
    do i = 1, size(self%equation, 2)
      do k = 1, size(self%equation, 1)
        if (self%equation(k, i) == held) cycle
        n = n + 1
        self%equation(k, i) = n
      end do
    end do
    self%n_equations = n
  end subroutine constraint_number_equations

  !> Restrict nodal forces to the free equations.
  pure subroutine constraint_reduce(self, force, rhs)
    class(constraint_t), intent(in) :: self
    real(dp), intent(in) :: force(:, :)  !! Forces in global axes (dim, n_nodes) [force].
    real(dp), intent(out) :: rhs(:)  !! Forces along the free unknowns (n_equations) [force].
    real(dp) :: local(size(force, 1))
    integer :: i, k
    do i = 1, size(force, 2)
      local = force(:, i)
      if (self%frame_of(i) > 0) local = matmul(local, self%frame(:, :, self%frame_of(i)))
      do k = 1, size(local)
        if (self%equation(k, i) > 0) rhs(self%equation(k, i)) = local(k)
      end do
    end do
  end subroutine constraint_reduce

  !> Expand free unknowns to nodal displacements.
  pure subroutine constraint_expand(self, x, u, with_prescribed)
    class(constraint_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Free unknowns (n_equations) [length].
    real(dp), intent(out) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    !> Whether prescribed displacements are inserted; otherwise these unknowns are zero.
    logical, intent(in) :: with_prescribed
    real(dp) :: local(size(u, 1))
    integer :: i, k
    do i = 1, size(u, 2)
      do k = 1, size(local)
        if (self%equation(k, i) > 0) then
          local(k) = x(self%equation(k, i))
        else if (with_prescribed) then
          local(k) = self%prescribed(k, i)
        else
          local(k) = 0
        end if
      end do
      if (self%frame_of(i) > 0) local = matmul(self%frame(:, :, self%frame_of(i)), local)
      u(:, i) = local
    end do
  end subroutine constraint_expand

  !> Expand free unknowns to nodal displacements in quadruple precision.
  pure subroutine constraint_expand_long(self, x, u, with_prescribed)
    class(constraint_t), intent(in) :: self
    real(qp), intent(in) :: x(:)  !! Free unknowns (n_equations) [length].
    real(qp), intent(out) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    !> Whether prescribed displacements are inserted; otherwise these unknowns are zero.
    logical, intent(in) :: with_prescribed
    integer :: i, k
    do i = 1, size(u, 2)
      do k = 1, size(u, 1)
        u(k, i) = 0
        if (with_prescribed) u(k, i) = self%prescribed(k, i)
        if (self%equation(k, i) > 0) u(k, i) = x(self%equation(k, i))
      end do
      if (self%frame_of(i) > 0) u(:, i) = matmul(real(self%frame(:, :, self%frame_of(i)), qp), u(:, i))
    end do
  end subroutine constraint_expand_long

  !> Put it into a parcel, or take it out.
  subroutine constraint_carry(self, parcel)
    class(constraint_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%equation)
    call parcel%carry(self%n_equations)
    call parcel%carry(self%prescribed)
    call parcel%carry(self%frame_of)
    call parcel%carry(self%frame)
    call self%foundation%carry(parcel)
    call self%rigid%carry(parcel)
  end subroutine constraint_carry
end module dotyk_elasticity_constraint
