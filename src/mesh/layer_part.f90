!> The part of a body that a rank goes on with, from own elements, ghosts and the surface layer: as `hold_part` of
!> `dotyk_mesh_held_part` leaves it of a whole body.
module dotyk_mesh_layer_part
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_body_part, only: body_part_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  implicit none
  private
  public :: hold_layer_part, held_surface_of_layer

contains

  !> What the rank goes on with.
  subroutine hold_layer_part(body_part, component, layer, part)
    type(body_part_t), intent(inout) :: body_part  !! Own elements, ghosts, samples, and all nodes of the boundary.
    integer, intent(in) :: component(:)  !! Connected part of the body of each node (n_nodes).
    type(surface_layer_t), intent(in) :: layer  !! The surface.
    type(body_mesh_t), intent(out) :: part  !! The same.
    type(surface_t) :: boundary
    integer :: b
    part = body_part%mesh
    allocate (part%whole)
    associate (whole => part%whole)
      whole%in_parts = .true.
      whole%n_nodes = body_part%n_whole_nodes
      whole%n_file_nodes = whole%n_nodes
      whole%n_of_block = body_part%elements%n_whole
      whole%node = body_part%whole_node
      whole%element = [(body_part%elements(b)%whole, b=1, size(body_part%elements))]
      whole%own_element = [(body_part%elements(b)%own, b=1, size(body_part%elements))]
      whole%own_node = body_part%node_rank == body_part%rank
      whole%component = component
      whole%n_components = layer%n_components
      boundary = layer%boundary
      call held_surface_of_layer(layer, part, boundary)
      call move_alloc(boundary%kind, whole%facet_kind)
      call move_alloc(boundary%node, whole%facet_node)
    end associate
  end subroutine hold_layer_part

  !> A surface in the numbers of the part; parents that are not held become 0.
  pure subroutine held_surface_of_layer(layer, part, surface)
    type(surface_layer_t), intent(in) :: layer  !! The surface of the volume.
    type(body_mesh_t), intent(in) :: part  !! The part.
    type(surface_t), intent(inout) :: surface  !! Surface in the numbers of the layer in, of the part out.
    integer, allocatable :: held(:)
    integer :: b, f, i, before, place
    held = places_in(part%whole%node, layer%whole%node)
    do f = 1, surface%n_facets
      do i = 1, size(surface%node, 1)
        if (surface%node(i, f) > 0) surface%node(i, f) = held(surface%node(i, f))
      end do
    end do
    before = 0
    do b = 1, size(part%block)
      associate (n => size(part%block(b)%tag))
        held = places_in(part%whole%element(before + 1:before + n), layer%whole%block(b)%element)
        before = before + n
      end associate
      do f = 1, surface%n_facets
        if (surface%block(f) /= b) cycle
        place = held(surface%element(f))
        surface%element(f) = place
      end do
    end do
  end subroutine held_surface_of_layer

  !> Place of each number of a list in another one; 0 where that does not have it.
  pure function places_in(list, wanted) result(place)
    integer, intent(in) :: list(:)  !! Ascending (n).
    integer, intent(in) :: wanted(:)  !! Ascending (m).
    integer :: place(size(wanted)), i, k
    place = 0
    k = 1
    do i = 1, size(wanted)
      do while (k <= size(list))
        if (list(k) >= wanted(i)) exit
        k = k + 1
      end do
      if (k > size(list)) return
      if (list(k) == wanted(i)) place(i) = k
    end do
  end function places_in
end module dotyk_mesh_layer_part
