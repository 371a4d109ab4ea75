!> Dirichlet conditions of a body: equations of the free unknowns, prescribed displacements, and nodal axes. The free
!> unknowns alone are the displacements with supports at rest, equation (10), the space V_0.
!>
!> A node has the global axes or local axes (columns of a frame, "rotated unknowns"); its unknowns are the
!> displacements along them. Free unknowns are numbered node by node, along the axes of each node. Vectors outside of
!> this module are in global axes.
!>
!> A rigid body: all its displacements are those of one rigid motion, u(x) = a + w x (x - p), about a point p.
!>
!> Components of a and w are held, with given values, or free. No unknown of its nodes is left to the stiffness: the
!> held motions give their displacements, and the free motions are its rigid body modes, which contact must balance.
module dotyk_elasticity_constraint
  use dotyk_base_kinds, only: dp, qp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_elasticity_foundation, only: foundation_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  type, public :: rigid_hold_t  !! How a rigid body is held.
    logical :: is_set = .false.  !! Whether the body is rigid.
    logical :: held(6) = .false.  !! Whether each component of a and w is held (6).
    real(dp) :: motion(6) = 0  !! a and w along held components, 0 along others (6) [length, radian].
    real(dp) :: point(3) = 0  !! p (3) [length].
  contains
    procedure :: displacement => rigid_hold_displacement
    procedure :: motion_of => rigid_hold_motion_of
    procedure :: free_motions => rigid_hold_free_motions
    procedure :: reaction => rigid_hold_reaction
    procedure :: carry => rigid_hold_carry
  end type rigid_hold_t

  type, public :: constraint_t  !! Equations and prescribed displacements of the nodes of a body.
    integer, allocatable :: equation(:, :)  !! Equation of each nodal unknown, or `held` (0) (dim, n_nodes).
    integer :: n_equations = 0  !! Number of free equations.
    real(dp), allocatable :: prescribed(:, :)  !! Prescribed along the nodal axes, 0 where free (dim, n_nodes) [length].
    integer, allocatable :: frame_of(:)  !! Index in `frame` of the axes of each node, 0: global axes (n_nodes).
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
    logical, intent(in) :: with_prescribed  !! Whether prescribed displacements are inserted; else zero.
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
    logical, intent(in) :: with_prescribed  !! Whether prescribed displacements are inserted; else zero.
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

  !> Displacement of the held motions at a point (dim) [length].
  pure function rigid_hold_displacement(self, x) result(u)
    class(rigid_hold_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! The point, two or three coordinates (dim) [length].
    real(dp) :: u(size(x)), arm(3), moved(3)
    arm = 0
    arm(:size(x)) = x - self%point(:size(x))
    moved = self%motion(1:3) + cross(self%motion(4:6), arm)
    u = moved(:size(x))
  end function rigid_hold_displacement

  !> Motion of the body: a and w of its displacements, free components included (6) [length, radian].
  pure function rigid_hold_motion_of(self, x, u) result(motion)
    class(rigid_hold_t), intent(in) :: self
    real(dp), intent(in) :: x(:, :)  !! Its nodes (dim, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)  !! Their displacements (dim, n_nodes) [length].
    real(dp) :: motion(6), centre(3), mean(3), arm(3), moved(3), inertia(3, 3), moment(3), cofactor(3, 3), determinant
    integer :: i, n
    n = size(x, 2)
    centre = 0
    mean = 0
    centre(:size(x, 1)) = sum(x, 2)/n
    mean(:size(x, 1)) = sum(u, 2)/n
    inertia = 0
    moment = 0
    arm = 0
    moved = 0
    do i = 1, n
      arm(:size(x, 1)) = x(:, i) - centre(:size(x, 1))
      moved(:size(x, 1)) = u(:, i) - mean(:size(x, 1))
      moment = moment + cross(arm, moved)
      inertia = inertia - spread(arm, 2, 3)*spread(arm, 1, 3)
      inertia(1, 1) = inertia(1, 1) + dot_product(arm, arm)
      inertia(2, 2) = inertia(2, 2) + dot_product(arm, arm)
      inertia(3, 3) = inertia(3, 3) + dot_product(arm, arm)
    end do
    motion = 0
    if (size(x, 1) == 2) then
      motion(6) = moment(3)/inertia(3, 3)
    else
      cofactor(:, 1) = cross(inertia(:, 2), inertia(:, 3))
      cofactor(:, 2) = cross(inertia(:, 3), inertia(:, 1))
      cofactor(:, 3) = cross(inertia(:, 1), inertia(:, 2))
      determinant = dot_product(inertia(:, 1), cofactor(:, 1))
      motion(4:6) = matmul(moment, cofactor)/determinant
    end if
    where (self%held(4:6)) motion(4:6) = self%motion(4:6)
    motion(1:3) = mean + cross(motion(4:6), self%point - centre)
    where (self%held) motion = self%motion
  end function rigid_hold_motion_of

  !> Motions of the body that are not held: translations, and rotations about axes through the point. They are named one
  !> by one: a null space of what is held would lose motions about a point far away to rounding.
  pure subroutine rigid_hold_free_motions(self, centre, radius, exists, free, n)
    class(rigid_hold_t), intent(in) :: self
    real(dp), intent(in) :: centre(3)  !! Centre of the body (3) [length].
    real(dp), intent(in) :: radius  !! Its radius [length].
    integer, intent(in) :: exists(:)  !! Motions that exist in the analysis (n_motions).
    !> Orthonormal motions in the first n columns: translation of the centre, and rotation times the radius (6, 6) [].
    real(dp), intent(out) :: free(6, 6)
    integer, intent(out) :: n  !! Number of motions.
    real(dp) :: axis(3)
    integer :: i, k, pass
    n = 0
    free = 0
    do k = 1, 6
      if (self%held(k) .or. .not. any(exists == k)) cycle
      axis = 0
      axis(merge(k, k - 3, k <= 3)) = 1
      n = n + 1
      if (k <= 3) then
        free(1:3, n) = axis
      else
        free(1:3, n) = cross(axis, centre - self%point)
        free(4:6, n) = axis*radius
      end if
      do pass = 1, 2
        do i = 1, n - 1
          free(:, n) = free(:, n) - dot_product(free(:, i), free(:, n))*free(:, i)
        end do
        free(:, n) = free(:, n)/norm2(free(:, n))
      end do
    end do
  end subroutine rigid_hold_free_motions

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
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    integer :: k
    call parcel%carry(self%is_set)
    do k = 1, 6
      call parcel%carry(self%held(k))
    end do
    call parcel%carry_fixed(6, self%motion)
    call parcel%carry_fixed(3, self%point)
  end subroutine rigid_hold_carry
end module dotyk_elasticity_constraint
