!> What a rank goes on to hold of a body that it computes with others, or not at all.
module dotyk_elasticity_held_body
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_mesh_body_part, only: n_ghost_layers, node_owners
  use dotyk_mesh_held_part, only: add_neighbours, hold_part, surface_part
  implicit none
  private
  public :: hold_surface, hold_own_part

contains

  !> Reduce a body that other ranks compute to its surface.
  subroutine hold_surface(body, number)
    type(body_t), intent(inout) :: body  !! The body, with supports and loads, not assembled.
    !> Number of each node of the whole body in the held part, 0 where it is not held (n_nodes).
    integer, allocatable, intent(out) :: number(:)
    logical, allocatable :: holds(:), nothing(:)
    integer, allocatable :: node(:)
    call surface_part(body%mesh, holds, node)
    allocate (nothing(body%mesh%n_nodes()), source=.false.)
    call hold(body, holds, spread(.false., 1, size(holds)), nothing, number)
  end subroutine hold_surface

  !> Reduce a body that all ranks compute together to the part of one of them: its elements, those around them, and the
  !> surface. Equations are numbered in the part.
  subroutine hold_own_part(body, element_rank, rank, n_ranks, number)
    type(body_t), intent(inout) :: body  !! The body, with supports and loads, not assembled.
    integer, intent(in) :: element_rank(:)  !! Rank of each element, from 0, counted through all blocks (n_elements).
    integer, intent(in) :: rank  !! This rank, from 0.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    integer, allocatable, intent(out) :: number(:)  !! As in `hold_surface`.
    logical, allocatable :: holds(:), of_surface(:)
    integer, allocatable :: node(:), node_rank(:)
    integer :: layer
    holds = element_rank == rank
    do layer = 1, n_ghost_layers
      call add_neighbours(body%mesh, holds)
    end do
    call surface_part(body%mesh, of_surface, node)
    call node_owners(body%mesh, element_rank, n_ranks, node_rank)
    call hold(body, holds .or. of_surface, element_rank == rank, node_rank == rank, number)
    body%mesh%whole%in_parts = .true.
    call body%number_part(body%mesh%whole%own_node)
  end subroutine hold_own_part

  !> Reduce a body.
  subroutine hold(body, holds, own_element, own_node, number)
    type(body_t), intent(inout) :: body  !! The body.
    !> Whether each element is held, and whether this rank computes it (n_elements).
    logical, intent(in) :: holds(:), own_element(:)
    logical, intent(in) :: own_node(:)  !! Whether this rank computes each node (n_nodes).
    integer, allocatable, intent(out) :: number(:)  !! As in `hold_surface`.
    integer, allocatable :: of_element(:)
    integer :: e, n
    call hold_part(body%mesh, holds, own_element, own_node, shortest_extent(body%mesh), number)
    call body%hold_nodes(body%mesh%whole%node)
    allocate (of_element(size(holds)), source=0)
    n = 0
    do e = 1, size(holds)
      if (.not. holds(e)) cycle
      n = n + 1
      of_element(e) = n
    end do
    call body%applied%hold(of_element)
    if (.not. allocated(body%of_case)) return
    do n = 1, size(body%of_case)
      call body%of_case(n)%applied%hold(of_element)
    end do
  end subroutine hold
end module dotyk_elasticity_held_body
