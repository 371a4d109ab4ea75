!> What each rank goes on to hold of bodies that have one rank each: those that it computes; of others their surfaces.
module dotyk_model_body_parts
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t, hold_surface
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_mesh_held_part, only: held_surface, surface_part
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: hold_parts, keep_surface

contains

  !> Give up what this rank does not need. Rigid body modes are found before where other ranks compute the body, and
  !> after it, by all ranks together, where each has a part.
  subroutine hold_parts(classes, ranks, body, surfaces, modes)
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(body_t), intent(inout) :: body(:)  !! Bodies with supports and loads, not assembled (n_bodies).
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! Their surfaces; by held nodes on return (n_bodies).
    !> Rigid body modes that supports leave; found for bodies that are not held wholly, at the held nodes (n_bodies).
    type(body_modes_t), allocatable, intent(out) :: modes(:)
    integer :: b
    allocate (modes(size(body)))
    if (n_ranks() == 1) return
    if (.not. ranks%are_split()) then
      call hold_surfaces(classes, ranks, body, surfaces, modes)
      return
    end if
    do b = 1, size(body)
      call modes(b)%find(body(b))
    end do
  end subroutine hold_parts

  !> Give up the volumes of bodies that this rank neither solves nor factorizes.
  subroutine hold_surfaces(classes, ranks, body, surfaces, modes)
    type(congruence_classes_t), intent(in) :: classes  !! As in `hold_parts`.
    type(body_ranks_t), intent(in) :: ranks  !! As in `hold_parts`.
    type(body_t), intent(inout) :: body(:)  !! As in `hold_parts`.
    type(body_surfaces_t), intent(inout) :: surfaces(:)  !! As in `hold_parts`.
    type(body_modes_t), intent(inout) :: modes(:)  !! As in `hold_parts`.
    logical :: holds(size(body))
    logical, allocatable :: sample(:)
    integer :: b, c
    holds = ranks%factorizes .or. ranks%is_own([(b, b=1, size(body))])
    do b = 1, size(body)
      if (.not. classes%is_representative(b) .or. all(holds .or. classes%first /= b)) cycle
      call modes(b)%find(body(b))
      do c = b + 1, size(body)
        if (classes%first(c) /= b .or. holds(c)) cycle
        call modes(c)%move(modes(b), classes%motion(c), body(c))
        call keep_surface(body(c), surfaces(c), modes(c))
      end do
      if (holds(b)) cycle
      call keep_surface(body(b), surfaces(b), modes(b))
    end do
    do b = 1, size(body)
      if (holds(b)) call surface_part(body(b)%mesh, sample, body(b)%shared_node)
    end do
  end subroutine hold_surfaces

  !> Give up the volume of a body.
  subroutine keep_surface(body, surfaces, modes)
    type(body_t), intent(inout) :: body  !! The body.
    type(body_surfaces_t), intent(inout) :: surfaces  !! Its surfaces.
    type(body_modes_t), intent(inout) :: modes  !! Its rigid body modes.
    integer, allocatable :: number(:)
    call hold_surface(body, number)
    call follow(body, number, surfaces)
    call modes%hold_nodes(body%mesh%whole%node)
  end subroutine keep_surface

  !> Reduce surfaces to what is held of their body.
  subroutine follow(body, number, surfaces)
    type(body_t), intent(in) :: body  !! Reduced.
    integer, intent(in) :: number(:)  !! Number of each node of the whole body in it (n_nodes).
    type(body_surfaces_t), intent(inout) :: surfaces  !! Surfaces of the body.
    integer :: k
    if (surfaces%boundary%n_facets > 0) call held_surface(body%mesh, number, surfaces%boundary)
    do k = 1, surfaces%n
      call held_surface(body%mesh, number, surfaces%surface(k))
    end do
  end subroutine follow
end module dotyk_model_body_parts
