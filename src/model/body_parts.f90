!> What each rank goes on to hold of bodies that other ranks compute: their surfaces.
module dotyk_model_body_parts
  use dotyk_base_kinds, only: dp
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_mesh_held_part, only: held_surface, hold_part, surface_part
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: hold_surfaces

contains

  !> Give up the volumes of bodies that this rank neither solves nor factorizes. Their rigid body modes are found before.
  subroutine hold_surfaces(classes, ranks, body, surfaces, modes)
    !> Congruence classes of the bodies.
    type(congruence_classes_t), intent(in) :: classes
    !> Which rank computes which bodies.
    type(body_ranks_t), intent(in) :: ranks
    !> Bodies with supports and loads, not assembled; those of other ranks are reduced to their surfaces (n_bodies).
    type(body_t), intent(inout) :: body(:)
    !> Their surfaces; in the numbers of the held nodes on return (n_bodies).
    type(body_surfaces_t), intent(inout) :: surfaces(:)
    !> Rigid body modes that supports leave; found for bodies of other ranks, at the held nodes (n_bodies).
    type(body_modes_t), allocatable, intent(out) :: modes(:)
    logical :: holds(size(body))
    logical, allocatable :: sample(:)
    integer :: b, c
    allocate (modes(size(body)))
    if (n_ranks() == 1) return
    holds = ranks%factorizes .or. ranks%is_own([(b, b=1, size(body))])
    do b = 1, size(body)
      if (.not. classes%is_representative(b) .or. all(holds .or. classes%first /= b)) cycle
      call modes(b)%find(body(b))
      do c = b + 1, size(body)
        if (classes%first(c) /= b .or. holds(c)) cycle
        call modes(c)%move(modes(b), classes%motion(c), body(c))
        call hold_surface(body(c), surfaces(c), modes(c))
      end do
      if (.not. holds(b)) call hold_surface(body(b), surfaces(b), modes(b))
    end do
    do b = 1, size(body)
      if (holds(b)) call surface_part(body(b)%mesh, sample, body(b)%shared_node)
    end do
  end subroutine hold_surfaces

  !> Reduce a body to its surface.
  subroutine hold_surface(body, surfaces, modes)
    !> The body.
    type(body_t), intent(inout) :: body
    !> Its surfaces.
    type(body_surfaces_t), intent(inout) :: surfaces
    !> Its rigid body modes.
    type(body_modes_t), intent(inout) :: modes
    logical, allocatable :: holds(:)
    integer, allocatable :: node(:), number(:)
    real(dp) :: extent
    integer :: k
    call surface_part(body%mesh, holds, node)
    extent = shortest_extent(body%mesh)
    call hold_part(body%mesh, holds, spread(.false., 1, size(holds)), spread(.false., 1, body%mesh%n_nodes()), extent, &
                   number)
    call body%hold_nodes(body%mesh%whole%node)
    call modes%hold_nodes(body%mesh%whole%node)
    if (surfaces%boundary%n_facets > 0) call held_surface(body%mesh, number, surfaces%boundary)
    do k = 1, surfaces%n
      call held_surface(body%mesh, number, surfaces%surface(k))
    end do
  end subroutine hold_surface
end module dotyk_model_body_parts
