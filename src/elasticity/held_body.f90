!> What a rank goes on to hold of a body that it does not compute, or computes with others.
module dotyk_elasticity_held_body
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_shortest_extent, only: shortest_extent
  use dotyk_mesh_held_part, only: describe_whole, hold_part, surface_part
  use dotyk_mesh_body_mesh, only: whole_body_t
  implicit none
  private
  public :: hold_body, hold_surface

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
    call hold_body(body, holds, spread(.false., 1, size(holds)), nothing, number)
  end subroutine hold_surface

  !> Reduce a body to some of its elements, and its surface.
  subroutine hold_body(body, holds, own_element, own_node, number)
    type(body_t), intent(inout) :: body  !! The body, with supports and loads, not assembled.
    logical, intent(in) :: holds(:), own_element(:)  !! Whether each element is held, and of this rank (n_elements).
    logical, intent(in) :: own_node(:)  !! Whether this rank computes each node (n_nodes).
    integer, allocatable, intent(out) :: number(:)  !! As in `hold_surface`.
    type(whole_body_t) :: whole
    integer, allocatable :: of_element(:)
    integer :: e, n
    call describe_whole(body%mesh, shortest_extent(body%mesh), whole)
    call hold_part(body%mesh, whole, holds, own_element, own_node, number)
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
  end subroutine hold_body
end module dotyk_elasticity_held_body
