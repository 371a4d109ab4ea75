!> A mesh as a file holds it: nodes, elements in blocks of one kind, physical groups.
!>
!> Bodies take their own part of it (dotyk_mesh_body_mesh); nothing here knows of bodies.
module dotyk_mesh_mesh
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private

  !> Elements of one kind that belong to the same physical groups.
  type, public :: element_block_t
    !> Element kind, one of the named integers of dotyk_mesh_element.
    integer :: kind = 0
    !> Nodes of the elements in gmsh's order, indices into the nodes of the mesh (n_nodes of the kind, n_elements).
    integer, allocatable :: node(:, :)
    !> Element tags of the file (n_elements).
    integer(int64), allocatable :: tag(:)
    !> Physical groups that all these elements belong to: indices into the mesh's `group`, maybe none (n_groups of the block).
    integer, allocatable :: group(:)
  end type element_block_t

  !> A named set of elements of one dimension.
  type, public :: physical_group_t
    !> Name; the tag's digits where the file gives none.
    character(:), allocatable :: name
    !> Dimension of its elements: 0 points, 1 curves, 2 surfaces, 3 volumes.
    integer :: dimension = 0
    !> Tag in the file, unique among groups of one dimension.
    integer :: tag = 0
  end type physical_group_t

  !> A mesh as read from a file.
  type, public :: mesh_t
    !> File that it was read from, for messages.
    character(:), allocatable :: file
    !> Coordinates of the nodes (3, n_nodes) [length]; z is 0 in a plane mesh. Nodes without elements are allowed.
    real(dp), allocatable :: x(:, :)
    !> Node tags of the file (n_nodes).
    integer(int64), allocatable :: node_tag(:)
    !> Elements (n_blocks).
    type(element_block_t), allocatable :: block(:)
    !> Physical groups (n_groups). Two groups of different dimension may share a name, and so may two of one dimension.
    type(physical_group_t), allocatable :: group(:)
  end type mesh_t
end module dotyk_mesh_mesh
