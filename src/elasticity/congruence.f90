!> Congruent bodies: bodies that a rigid motion maps onto each other, with the same elements, and with the same
!> material, supports and springs in axes that move with the body.
!>
!> Congruent bodies have one stiffness matrix over unknowns along axes that move with the body, so that one
!> factorization serves all. `adopt_congruent_constraint` gives a body the equations and the moved axes of the
!> representative of its class. Loads and the values of prescribed displacements may differ.
module dotyk_elasticity_congruence
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_thresholds, only: given_rounding, rounding, same_number, shape_rounding
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_stiffness_tensor, only: rotate_stiffness
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private
  public :: are_congruent, adopt_congruent_constraint

  type, public :: congruence_invariants_t  !! Properties that congruent bodies share and that cost little to compare.
    !> Whether the body can be congruent to another one at all: a modulus field in global coordinates excludes it.
    logical :: usable = .false.
    integer :: dimension = 0  !! Number of displacement components.
    integer :: analysis = 0  !! Type of analysis.
    integer :: n_nodes = 0  !! Number of nodes.
    integer :: n_elements = 0  !! Number of elements.
    integer :: n_blocks = 0  !! Number of element blocks.
    integer :: n_equations = 0  !! Number of free equations.
    real(dp) :: spread = 0  !! Root mean square distance of the nodes from their centroid [length].
    real(dp) :: centre(3) = 0  !! Centroid of the nodes; not compared (3) [length].
  contains
    procedure :: init => congruence_invariants_init
    procedure :: matches => congruence_invariants_match
    procedure :: carry => congruence_invariants_carry
  end type congruence_invariants_t

  !> Positions that differ by less than this fraction of the largest coordinate are equal: rounding of the coordinates.
  real(dp), parameter :: coordinate_rounding = 16*epsilon(1.0_dp)
  !> Relative tolerance for the ratio of bulk to shear modulus, a quotient of eigenvalues of the stiffness.
  real(dp), parameter :: bulk_ratio_tolerance = 1.0e-6_dp
  !> Prescribed displacements below this fraction of their vector are rounding errors of the change of axes.
  real(dp), parameter :: displacement_rounding = 4*epsilon(1.0_dp)

contains

  !> Put them into a parcel, or take them out.
  subroutine congruence_invariants_carry(self, parcel)
    class(congruence_invariants_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%usable)
    call parcel%carry(self%dimension)
    call parcel%carry(self%analysis)
    call parcel%carry(self%n_nodes)
    call parcel%carry(self%n_elements)
    call parcel%carry(self%n_blocks)
    call parcel%carry(self%n_equations)
    call parcel%carry(self%spread)
    call parcel%carry_fixed(size(self%centre), self%centre)
  end subroutine congruence_invariants_carry

  !> Compute the invariants of a body.
  subroutine congruence_invariants_init(self, body)
    class(congruence_invariants_t), intent(out) :: self
    type(body_t), intent(in) :: body  !! The body with its supports; it need not be assembled.
    integer :: i, d, n
    d = body%dimension
    n = body%mesh%n_nodes()
    ! Rigid bodies have no factor to share.
    self%usable = .not. (any([(body%material(i)%has_modulus_field(), i=1, size(body%material))]) .or. &
                         body%constraint%rigid%is_set)
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

  !> Whether two bodies may be congruent.
  pure logical function congruence_invariants_match(self, other) result(matches)
    class(congruence_invariants_t), intent(in) :: self
    type(congruence_invariants_t), intent(in) :: other  !! Invariants of the other body.
    matches = self%usable .and. other%usable .and. self%dimension == other%dimension .and. &
              self%analysis == other%analysis .and. self%n_nodes == other%n_nodes .and. &
              self%n_elements == other%n_elements .and. self%n_blocks == other%n_blocks .and. &
              self%n_equations == other%n_equations .and. &
              abs(self%spread - other%spread) <= same_number*self%spread
  end function congruence_invariants_match

  !> Whether two bodies are congruent, and the rigid motion between them.
  !>
  !> A pure translation is tried first, then the rotation that maps a triad of two distant nodes onto that of the same
  !> nodes of the other body; axisymmetric bodies can only move along their axis.
  logical function are_congruent(first, first_invariants, other, other_invariants, motion) result(congruent)
    type(body_t), intent(in) :: first  !! First body, with supports; it need not be assembled.
    type(body_t), intent(in) :: other  !! Other body, with supports; it need not be assembled.
    type(congruence_invariants_t), intent(in) :: first_invariants  !! Invariants of the first body.
    type(congruence_invariants_t), intent(in) :: other_invariants  !! Of the other body; they match the first.
    type(placement_t), intent(out) :: motion  !! Rigid motion that maps the first body onto the other.
    integer :: d, m
    d = first%dimension
    associate (a => first%mesh%x, b => other%mesh%x, radius => first_invariants%spread)
      call motion%init([0.0_dp, 0.0_dp, 1.0_dp], 0.0_dp, other_invariants%centre - first_invariants%centre)
      congruent = is_moved(d, size(a, 2), a, b, radius, motion)
      if (first%analysis == analysis_axisymmetric) then
        congruent = congruent .and. abs(motion%shift(1)) <= rounding*radius
      else if (.not. congruent) then
        call find_rotation(d, size(a, 2), a, b, first_invariants%centre(:d), other_invariants%centre(:d), motion)
        congruent = is_moved(d, size(a, 2), a, b, radius, motion)
      end if
    end associate
    if (congruent) congruent = size(first%material) == size(other%material)
    do m = 1, size(first%material)
      if (congruent) congruent = same_material(first%material(m), other%material(m), motion)
    end do
    if (congruent) congruent = same_elements(first%mesh, other%mesh)
    if (congruent) congruent = same_supports(first%constraint, other%constraint, motion)
    if (congruent) congruent = first%constraint%foundation%is_moved(other%constraint%foundation, d, motion)
  end function are_congruent

  !> Whether a rigid motion maps points onto others.
  pure logical function is_moved(d, n, from, to, radius, motion)
    integer, intent(in) :: d  !! Number of coordinates.
    integer, intent(in) :: n  !! Number of points.
    real(dp), intent(in) :: from(d, n)  !! Points before the motion (d, n) [length].
    real(dp), intent(in) :: to(d, n)  !! Points after the motion (d, n) [length].
    real(dp), intent(in) :: radius  !! Size of the body [length].
    type(placement_t), intent(in) :: motion  !! The rigid motion.
    real(dp) :: x(d), tolerance
    integer :: i, k
    tolerance = rounding*radius + coordinate_rounding*max(maxval(abs(from)), maxval(abs(to)))
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

  !> Find the rigid motion that maps the triad of two distant nodes onto that of the same nodes of another body.
  pure subroutine find_rotation(d, n, from, to, from_centre, to_centre, motion)
    integer, intent(in) :: d  !! Number of coordinates.
    integer, intent(in) :: n  !! Number of nodes.
    real(dp), intent(in) :: from(d, n)  !! Nodes of the first body (d, n) [length].
    real(dp), intent(in) :: to(d, n)  !! Nodes of the other body (d, n) [length].
    real(dp), intent(in) :: from_centre(d)  !! Centroid of the first body (d) [length].
    real(dp), intent(in) :: to_centre(d)  !! Centroid of the other body (d) [length].
    type(placement_t), intent(inout) :: motion  !! The rigid motion.
    real(dp) :: axes(3, 3), u(3), now, best
    integer :: farthest, off_axis, i
    farthest = 1
    best = 0
    do i = 1, n
      now = sum((from(:, i) - from_centre)**2)
      if (now <= best) cycle
      best = now
      farthest = i
    end do
    off_axis = farthest
    if (d == 3) then
      u = (from(:, farthest) - from_centre)/sqrt(best)
      best = 0
      do i = 1, n
        now = norm2(cross(u, from(:, i) - from_centre))
        if (now <= best) cycle
        best = now
        off_axis = i
      end do
    end if
    axes = triad(d, to(:, farthest) - to_centre, to(:, off_axis) - to_centre)
    motion%rotation = matmul(axes, transpose(triad(d, from(:, farthest) - from_centre, &
                                                   from(:, off_axis) - from_centre)))
    motion%rotated = .true.
    motion%shift = 0
    motion%shift(:d) = to_centre - matmul(motion%rotation(:d, :d), from_centre)
  end subroutine find_rotation

  !> Right-handed axes as columns: the first along a direction, the second in the plane of two; in two dimensions the
  !> third is z (3, 3) [].
  pure function triad(d, first, second) result(axes)
    integer, intent(in) :: d  !! Number of coordinates.
    real(dp), intent(in) :: first(d)  !! Direction of the first axis (d) [length].
    real(dp), intent(in) :: second(d)  !! Second direction; not used in two dimensions (d) [length].
    real(dp) :: axes(3, 3)
    axes = 0
    axes(:d, 1) = first/norm2(first)
    if (d == 2) then
      axes(:2, 2) = [-axes(2, 1), axes(1, 1)]
      axes(3, 3) = 1
    else
      axes(:, 2) = second - dot_product(second, axes(:, 1))*axes(:, 1)
      axes(:, 2) = axes(:, 2)/norm2(axes(:, 2))
      axes(:, 3) = cross(axes(:, 1), axes(:, 2))
    end if
  end function triad

  !> Whether two materials are equal but for a rotation.
  pure logical function same_material(first, other, motion) result(same)
    type(material_t), intent(in) :: first  !! Material of the first body.
    type(material_t), intent(in) :: other  !! Material of the other body.
    type(placement_t), intent(in) :: motion  !! Rigid motion from the first body to the other.
    real(dp) :: moved(6, 6)
    moved = first%stiffness
    if (motion%rotated .and. .not. first%isotropic) moved = rotate_stiffness(moved, motion%rotation)
    same = (first%isotropic .eqv. other%isotropic) .and. &
           abs(first%incompressibility - other%incompressibility) <= &
           bulk_ratio_tolerance*first%incompressibility .and. &
           all(abs(moved - other%stiffness) <= given_rounding*maxval(abs(moved)))
  end function same_material

  !> Whether two bodies have the same elements in the same order.
  pure logical function same_elements(first, other) result(same)
    type(body_mesh_t), intent(in) :: first  !! Mesh of the first body.
    type(body_mesh_t), intent(in) :: other  !! Mesh of the other body.
    integer :: b
    same = .false.
    do b = 1, size(first%block)
      if (first%block(b)%kind /= other%block(b)%kind) return
      if (first%block(b)%material /= other%block(b)%material) return
      if (size(first%block(b)%node) /= size(other%block(b)%node)) return
      if (any(first%block(b)%node /= other%block(b)%node)) return
    end do
    same = .true.
  end function same_elements

  !> Whether supports hold the same directions but for a rotation.
  pure logical function same_supports(first, other, motion) result(same)
    type(constraint_t), intent(in) :: first  !! Constraint of the first body.
    type(constraint_t), intent(in) :: other  !! Constraint of the other body.
    type(placement_t), intent(in) :: motion  !! Rigid motion from the first body to the other.
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
      ! Free directions of one body are perpendicular to the held directions of the other.
      a = matmul(motion%rotation(:d, :d), axes_of(d, first, i))
      b = axes_of(d, other, i)
      do k = 1, d
        if (first%equation(k, i) == held) cycle
        do j = 1, d
          if (other%equation(j, i) == held .and. abs(dot_product(a(:, k), b(:, j))) > shape_rounding) return
        end do
      end do
    end do
    same = .true.
  end function same_supports

  !> Axes of a node, as columns (d, d) [].
  pure function axes_of(d, constraint, i) result(axes)
    integer, intent(in) :: d  !! Number of displacement components.
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes.
    integer, intent(in) :: i  !! Index of the node.
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

  !> Give a body the equations and, moved with the body, the nodal axes of the representative of its congruence class.
  subroutine adopt_congruent_constraint(first, motion, constraint)
    type(constraint_t), intent(in) :: first  !! Constraint of the representative.
    type(placement_t), intent(in) :: motion  !! Rigid motion from the representative to the body.
    !> Constraint of the body; its prescribed displacements are transformed to the new axes.
    type(constraint_t), intent(inout) :: constraint
    real(dp), allocatable :: frame(:, :, :)
    real(dp) :: u(size(first%equation, 1)), axes(size(first%equation, 1), size(first%equation, 1))
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
        where (first%equation(:, i) /= held .or. abs(constraint%prescribed(:, i)) <= displacement_rounding*norm2(u))
          constraint%prescribed(:, i) = 0
        end where
      end if
      constraint%frame_of(i) = first%frame_of(i)
      if (motion%rotated .and. first%frame_of(i) == 0) constraint%frame_of(i) = n + 1
    end do
    constraint%equation = first%equation
    call move_alloc(frame, constraint%frame)
  end subroutine adopt_congruent_constraint
end module dotyk_elasticity_congruence
