!> Load cases of a body: the stiffness is the same in all of them, what acts on the body is not.
module dotyk_elasticity_load_cases
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_congruence, only: adopt_congruent_constraint
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_mesh_placement, only: placement_t
  implicit none
  private
  public :: adopt_congruent_body, clear_actions, keep_case, take_case

contains

  !> Nothing acts on the body: the beginning of a load case.
  subroutine clear_actions(body)
    type(body_t), intent(inout) :: body  !! The body.
    if (allocated(body%load)) deallocate (body%load)
    if (allocated(body%resultant)) deallocate (body%resultant)
    if (allocated(body%unresolved)) deallocate (body%unresolved)
    if (allocated(body%initial%temperature)) deallocate (body%initial%temperature)
    if (allocated(body%initial%stress)) deallocate (body%initial%stress)
    body%initial%range = 0
    body%applied%n = 0
    if (allocated(body%density)) deallocate (body%density)
    allocate (body%load(body%dimension, body%mesh%n_nodes()), source=0.0_dp)
  end subroutine clear_actions

  !> Keep what acts on the body as that of a load case.
  subroutine keep_case(body, k)
    type(body_t), intent(inout) :: body  !! The body; `of_case` is allocated.
    integer, intent(in) :: k  !! The load case.
    associate (kept => body%of_case(k))
      ! What is zero takes no memory.
      if (any(abs(body%constraint%prescribed) > 0)) kept%prescribed = body%constraint%prescribed
      if (any(abs(body%load) > 0)) kept%load = body%load
      kept%rigid_motion = body%constraint%rigid%motion
      kept%initial = body%initial
      kept%applied = body%applied
      if (allocated(body%density)) kept%density = body%density
      if (allocated(body%resultant)) kept%resultant = body%resultant
      if (allocated(body%unresolved)) kept%unresolved = body%unresolved
    end associate
  end subroutine keep_case

  !> Let a load case act on the body, in place of another one; the right-hand side is to be assembled again.
  subroutine take_case(body, k)
    type(body_t), intent(inout) :: body  !! The body.
    integer, intent(in) :: k  !! The load case.
    if (.not. allocated(body%of_case)) return
    call clear_actions(body)
    associate (given => body%of_case(k))
      body%constraint%prescribed = 0
      if (allocated(given%prescribed)) body%constraint%prescribed = given%prescribed
      if (allocated(given%load)) body%load = given%load
      body%constraint%rigid%motion = given%rigid_motion
      body%initial = given%initial
      body%applied = given%applied
      if (allocated(given%density)) body%density = given%density
      if (allocated(given%resultant)) body%resultant = given%resultant
      if (allocated(given%unresolved)) body%unresolved = given%unresolved
      body%is_loaded_inside = given%is_loaded_inside
    end associate
  end subroutine take_case

  !> Give a body the equations and nodal axes of the representative of its congruence class, in all load cases.
  subroutine adopt_congruent_body(first, motion, body)
    type(body_t), intent(in) :: first  !! The representative.
    type(placement_t), intent(in) :: motion  !! Rigid motion from the representative to the body.
    type(body_t), intent(inout) :: body  !! The body; its prescribed displacements are transformed to the new axes.
    type(constraint_t) :: constraint
    integer :: k
    if (allocated(body%of_case)) then
      do k = 1, size(body%of_case)
        if (.not. allocated(body%of_case(k)%prescribed)) cycle
        constraint = body%constraint
        constraint%prescribed = body%of_case(k)%prescribed
        call adopt_congruent_constraint(first%constraint, motion, constraint)
        body%of_case(k)%prescribed = constraint%prescribed
      end do
    end if
    call adopt_congruent_constraint(first%constraint, motion, body%constraint)
  end subroutine adopt_congruent_body
end module dotyk_elasticity_load_cases
