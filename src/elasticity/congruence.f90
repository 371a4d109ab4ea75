!> Bodies of one kind: they differ by a rigid motion, and have the same elements, material and supports in their own axes.
!>
!> Such bodies have one stiffness, over unknowns along axes that move with the body: `adopt_congruent_constraint` gives a body the equations and
!> the axes of the first of its kind. Loads and the values of given displacements may differ.
module dotyk_elasticity_congruence
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_material, only: material_t, rotate_stiffness
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private
  public :: are_congruent, adopt_congruent_constraint

  !> What bodies of one kind have in common and is seen at a glance.
  type, public :: congruence_invariants_t
    !> Whether the body can be one of a kind at all.
    logical :: usable = .false.
    integer :: dimension = 0, analysis = 0, n_nodes = 0, n_elements = 0, n_blocks = 0, n_equations = 0
    !> Root mean square distance of the nodes from their centre [length].
    real(dp) :: spread = 0
    !> The centre [length].
    real(dp) :: centre(3) = 0
  contains
    procedure :: init => congruence_invariants_init
    procedure :: matches => congruence_invariants_match
  end type congruence_invariants_t

  !> Places that differ by less than this, relative to the body, are the same; so are those that differ by round-off of coordinates.
  real(dp), parameter :: same_place = 1.0e-12_dp, round_off = 16*epsilon(1.0_dp)
  !> Spreads, directions of supports, and materials (relative) that differ by less are the same.
  real(dp), parameter :: same_spread = 1.0e-9_dp, same_direction = 1.0e-10_dp, same_material = 1.0e-13_dp
  !> The same for how nearly incompressible they are, which stiffnesses hardly tell.
  real(dp), parameter :: same_ratio = 1.0e-6_dp

contains

  !> The set of invariants of a body, with supports; it need not be assembled.
  subroutine congruence_invariants_init(self, body)
    class(congruence_invariants_t), intent(out) :: self
    type(body_t), intent(in) :: body
    integer :: i, d, n
    d = body%dimension
    n = body%mesh%n_nodes()
    self%usable = .not. body%material%has_modulus_field()
    self%dimension = d
    self%analysis = body%analysis
    self%n_nodes = n
    self%n_elements = body%mesh%n_elements()
    self%n_blocks = size(body%mesh%block)
    self%n_equations = body%constraint%n_equations
    associate (x => body%mesh%x)
      do i = 1, n
        self%centre(:d) = self%centre(:d) + (x(:, i) - x(:, 1))
      end do
      self%centre(:d) = x(:, 1) + self%centre(:d)/n
      do i = 1, n
        self%spread = self%spread + sum((x(:, i) - self%centre(:d))**2)
      end do
    end associate
    self%spread = sqrt(self%spread/n)
  end subroutine congruence_invariants_init

  !> Whether two bodies may be of one kind.
  pure logical function congruence_invariants_match(self, other) result(matches)
    class(congruence_invariants_t), intent(in) :: self
    type(congruence_invariants_t), intent(in) :: other
    matches = self%usable .and. other%usable .and. self%dimension == other%dimension .and. self%analysis == other%analysis &
              .and. self%n_nodes == other%n_nodes .and. self%n_elements == other%n_elements .and. &
              self%n_blocks == other%n_blocks .and. self%n_equations == other%n_equations .and. &
              abs(self%spread - other%spread) <= same_spread*self%spread
  end function congruence_invariants_match

  !> Whether a body is another one, moved.
  logical function are_congruent(first, first_invariants, other, other_invariants, motion) result(congruent)
    !> With supports; they need not be assembled.
    type(body_t), intent(in) :: first, other
    !> Their invariants, which match.
    type(congruence_invariants_t), intent(in) :: first_invariants, other_invariants
    !> The motion that takes the first to the other.
    type(placement_t), intent(out) :: motion
    integer :: d
    d = first%dimension
    associate (a => first%mesh%x, b => other%mesh%x, radius => first_invariants%spread)
      call motion%init([0.0_dp, 0.0_dp, 1.0_dp], 0.0_dp, other_invariants%centre - first_invariants%centre)
      congruent = is_moved(d, size(a, 2), a, b, radius, motion)
      if (first%analysis == analysis_axisymmetric) then
        congruent = congruent .and. abs(motion%shift(1)) <= same_place*radius
      else if (.not. congruent) then
        call find_rotation(d, size(a, 2), a, b, first_invariants%centre(:d), other_invariants%centre(:d), motion)
        congruent = is_moved(d, size(a, 2), a, b, radius, motion)
      end if
    end associate
    if (congruent) congruent = same_materials(first%material, other%material, motion)
    if (congruent) congruent = same_elements(first%mesh, other%mesh)
    if (congruent) congruent = same_supports(first%constraint, other%constraint, motion)
  end function are_congruent

  !> Whether points are where a motion takes others.
  pure logical function is_moved(d, n, from, to, radius, motion)
    integer, intent(in) :: d, n
    !> Points [length].
    real(dp), intent(in) :: from(d, n), to(d, n)
    !> Their size [length].
    real(dp), intent(in) :: radius
    type(placement_t), intent(in) :: motion
    real(dp) :: x(d), tolerance
    integer :: i, k
    tolerance = same_place*radius + round_off*max(maxval(abs(from)), maxval(abs(to)))
    is_moved = .false.
    do i = 1, n
      x = from(:, i)
      if (motion%rotated) then
        x = 0
        do k = 1, d
          x = x + motion%rotation(:d, k)*from(k, i)
        end do
      end if
      if (any(abs(x + motion%shift(:d) - to(:, i)) > tolerance)) return
    end do
    is_moved = .true.
  end function is_moved

  !> The rotation that takes the triad of two far nodes to that of the same nodes of another body, with the shift of the centres.
  pure subroutine find_rotation(d, n, from, to, from_centre, to_centre, motion)
    integer, intent(in) :: d, n
    !> Nodes [length].
    real(dp), intent(in) :: from(d, n), to(d, n)
    !> Their centres [length].
    real(dp), intent(in) :: from_centre(d), to_centre(d)
    type(placement_t), intent(inout) :: motion
    real(dp) :: axes(3, 3), u(3), now, best
    integer :: far, wide, i
    far = 1
    best = 0
    do i = 1, n
      now = sum((from(:, i) - from_centre)**2)
      if (now <= best) cycle
      best = now
      far = i
    end do
    wide = far
    if (d == 3) then
      u = (from(:, far) - from_centre)/sqrt(best)
      best = 0
      do i = 1, n
        now = norm2(cross(u, from(:, i) - from_centre))
        if (now <= best) cycle
        best = now
        wide = i
      end do
    end if
    axes = triad(d, to(:, far) - to_centre, to(:, wide) - to_centre)
    motion%rotation = matmul(axes, transpose(triad(d, from(:, far) - from_centre, from(:, wide) - from_centre)))
    motion%rotated = .true.
    motion%shift = 0
    motion%shift(:d) = to_centre - matmul(motion%rotation(:d, :d), from_centre)
  end subroutine find_rotation

  !> Right-handed axes: the first along a direction, the second in the plane of both; in two dimensions the third is z.
  pure function triad(d, along, beside) result(axes)
    integer, intent(in) :: d
    real(dp), intent(in) :: along(d), beside(d)
    real(dp) :: axes(3, 3)
    axes = 0
    axes(:d, 1) = along/norm2(along)
    if (d == 2) then
      axes(:2, 2) = [-axes(2, 1), axes(1, 1)]
      axes(3, 3) = 1
    else
      axes(:, 2) = beside - dot_product(beside, axes(:, 1))*axes(:, 1)
      axes(:, 2) = axes(:, 2)/norm2(axes(:, 2))
      axes(:, 3) = cross(axes(:, 1), axes(:, 2))
    end if
  end function triad

  !> Whether two materials are the same but for a rotation.
  pure logical function same_materials(first, other, motion) result(same)
    type(material_t), intent(in) :: first, other
    type(placement_t), intent(in) :: motion
    real(dp) :: moved(6, 6)
    moved = first%stiffness
    if (motion%rotated .and. .not. first%isotropic) moved = rotate_stiffness(moved, motion%rotation)
    same = (first%isotropic .eqv. other%isotropic) .and. &
           abs(first%incompressibility - other%incompressibility) <= same_ratio*first%incompressibility .and. &
           all(abs(moved - other%stiffness) <= same_material*maxval(abs(moved)))
  end function same_materials

  !> Whether two bodies have the same elements, in the same order.
  pure logical function same_elements(first, other) result(same)
    type(body_mesh_t), intent(in) :: first, other
    integer :: b
    same = .false.
    do b = 1, size(first%block)
      if (first%block(b)%kind /= other%block(b)%kind) return
      if (size(first%block(b)%node) /= size(other%block(b)%node)) return
      if (any(first%block(b)%node /= other%block(b)%node)) return
    end do
    same = .true.
  end function same_elements

  !> Whether supports hold the same directions but for a rotation.
  pure logical function same_supports(first, other, motion) result(same)
    type(constraint_t), intent(in) :: first, other
    type(placement_t), intent(in) :: motion
    real(dp), dimension(size(first%equation, 1), size(first%equation, 1)) :: a, b
    integer :: i, j, k, d
    d = size(first%equation, 1)
    same = .false.
    do i = 1, size(first%equation, 2)
      if (count(first%equation(:, i) == held) /= count(other%equation(:, i) == held)) return
      if (all(first%equation(:, i) == held) .or. .not. any(first%equation(:, i) == held)) cycle
      if (.not. motion%rotated .and. first%frame_of(i) == 0 .and. other%frame_of(i) == 0) then
        if (any((first%equation(:, i) == held) .neqv. (other%equation(:, i) == held))) return
        cycle
      end if
      ! What is free in one is across what is held in the other.
      a = matmul(motion%rotation(:d, :d), axes_of(d, first, i))
      b = axes_of(d, other, i)
      do k = 1, d
        if (first%equation(k, i) == held) cycle
        do j = 1, d
          if (other%equation(j, i) == held .and. abs(dot_product(a(:, k), b(:, j))) > same_direction) return
        end do
      end do
    end do
    same = .true.
  end function same_supports

  !> The axes of a node, as columns.
  pure function axes_of(d, constraint, i) result(axes)
    integer, intent(in) :: d
    type(constraint_t), intent(in) :: constraint
    integer, intent(in) :: i
    real(dp) :: axes(d, d)
    integer :: k
    if (constraint%frame_of(i) > 0) then
      axes = constraint%frame(:, :, constraint%frame_of(i))
    else
      axes = 0
      do k = 1, d
        axes(k, k) = 1
      end do
    end if
  end function axes_of

  !> Give a body the equations and, moved with it, the axes of another one of its kind.
  subroutine adopt_congruent_constraint(first, motion, constraint)
    type(constraint_t), intent(in) :: first
    !> From the first to this one.
    type(placement_t), intent(in) :: motion
    !> Its given displacements stay what they are.
    type(constraint_t), intent(inout) :: constraint
    real(dp), allocatable :: frame(:, :, :)
    real(dp) :: u(size(first%equation, 1)), axes(size(first%equation, 1), size(first%equation, 1))
    real(dp), parameter :: dust = 4*epsilon(1.0_dp)
    integer :: i, k, d, n
    if (.not. motion%rotated .and. size(first%frame, 3) == 0 .and. size(constraint%frame, 3) == 0) return
    d = size(first%equation, 1)
    n = size(first%frame, 3)
    allocate (frame(d, d, n + merge(1, 0, motion%rotated)))
    do k = 1, n
      frame(:, :, k) = matmul(motion%rotation(:d, :d), first%frame(:, :, k))
    end do
    if (motion%rotated) frame(:, :, n + 1) = motion%rotation(:d, :d)
    do i = 1, size(first%equation, 2)
      if (any(abs(constraint%prescribed(:, i)) > 0)) then
        u = matmul(axes_of(d, constraint, i), constraint%prescribed(:, i))
        axes = matmul(motion%rotation(:d, :d), axes_of(d, first, i))
        constraint%prescribed(:, i) = matmul(u, axes)
        where (first%equation(:, i) /= held .or. abs(constraint%prescribed(:, i)) <= dust*norm2(u)) constraint%prescribed(:, i) = 0
      end if
      constraint%frame_of(i) = first%frame_of(i)
      if (motion%rotated .and. first%frame_of(i) == 0) constraint%frame_of(i) = n + 1
    end do
    constraint%equation = first%equation
    call move_alloc(frame, constraint%frame)
  end subroutine adopt_congruent_constraint
end module dotyk_elasticity_congruence
