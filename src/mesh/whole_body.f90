!> What is known of a whole body on a rank that holds a part of its mesh: its size, the numbers of the held nodes and
!> elements in it, its boundary, and what else depends on elements that are not there.
module dotyk_mesh_whole_body
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  implicit none
  private

  type, public :: whole_body_t  !! The whole body.
    !> Whether all ranks compute the body together, each its part; else others compute it, and this rank nothing of it.
    logical :: in_parts = .false.
    integer :: n_nodes = 0  !! Number of nodes.
    integer :: n_file_nodes = 0  !! Those of them that are in the mesh file, not from order elevation.
    integer, allocatable :: n_of_block(:)  !! Number of elements of each block (n_blocks).
    integer, allocatable :: node(:)  !! Number in the whole body of each held node, ascending (n_held_nodes).
    !> Number in its block of the whole body of each held element, one block after the other, ascending in each
    !> (n_held_elements).
    integer, allocatable :: element(:)
    logical, allocatable :: own_node(:)  !! Whether this rank computes a held node, or others (n_held_nodes).
    logical, allocatable :: own_element(:)  !! Whether this rank computes a held element (n_held_elements).
    integer, allocatable :: component(:)  !! Connected component of each held node (n_held_nodes).
    integer :: n_components = 0  !! Number of connected components.
    real(dp) :: diameter = 0  !! Greatest extent, `body_mesh_t%diameter` [length].
    real(dp) :: shortest_extent = 0  !! Shortest edge of the brick with the same moments, `shortest_extent` [length].
    integer, allocatable :: facet_kind(:)  !! The boundary, as in `surface_t`: kinds of the facets (n_facets).
    integer, allocatable :: facet_node(:, :)  !! Their nodes, in held numbers (max_facet_nodes, n_facets).
  contains
    procedure :: carry => whole_body_carry
  end type whole_body_t

contains

  !> Put it into a parcel, or take it out.
  subroutine whole_body_carry(self, parcel)
    class(whole_body_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%in_parts)
    call parcel%carry(self%n_nodes)
    call parcel%carry(self%n_file_nodes)
    call parcel%carry(self%n_of_block)
    call parcel%carry(self%node)
    call parcel%carry(self%element)
    call parcel%carry(self%own_node)
    call parcel%carry(self%own_element)
    call parcel%carry(self%component)
    call parcel%carry(self%n_components)
    call parcel%carry(self%diameter)
    call parcel%carry(self%shortest_extent)
    call parcel%carry(self%facet_kind)
    call parcel%carry(self%facet_node)
  end subroutine whole_body_carry
end module dotyk_mesh_whole_body
