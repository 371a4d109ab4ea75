!> A mesh as in the file: nodes, elements in blocks of one kind, physical groups.
!>
!> Bodies extract their own part of it (`dotyk_mesh_body_mesh`); this module does not know bodies.
module dotyk_mesh_mesh
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private

  !> Elements of one kind that belong to the same physical groups.
  type, public :: element_block_t
    !> Element kind, one of the named integers of `dotyk_mesh_element`.
    integer :: kind = 0
    !> Nodes of the elements in the order of gmsh, indices of nodes of the mesh (n_nodes of the kind, n_elements).
    integer, allocatable :: node(:, :)
    !> Element tags in the file (n_elements).
    integer(int64), allocatable :: tag(:)
    !> Number of their material among those of the body; of no meaning in a mesh as in the file.
    integer :: material = 1
    !> Geometric entity (curve, surface or volume of the geometry) of each element, 0 if unknown (n_elements); not
    !> allocated in parts of a mesh.
    integer, allocatable :: entity(:)
    !> Physical groups to which all these elements belong, indices of `group` of the mesh (n_groups of the block, may be
    !> 0).
    integer, allocatable :: group(:)
    !> Number of each element among those of the block in the file, ascending (n_elements); not allocated where all were
    !> read.
    integer, allocatable :: place(:)
    !> Number of elements of the block in the file, where not all were read.
    integer :: n_in_file = 0
  end type element_block_t

  !> Named set of elements of one dimension.
  type, public :: physical_group_t
    !> Name; the digits of the tag if the file has no name.
    character(:), allocatable :: name
    !> Dimension of the elements: 0 points, 1 curves, 2 surfaces, 3 volumes.
    integer :: dimension = 0
    !> Tag in the file, unique among groups of one dimension.
    integer :: tag = 0
    !> Groups whose union it is, the volumes of one body (`dotyk_mesh_volume_union`); not allocated where the group is
    !> in the file (n_members).
    integer, allocatable :: member(:)
    !> Number of the material of each of these among those of the body (n_members).
    integer, allocatable :: material(:)
    !> What is wrong with such a union; empty where nothing is.
    character(:), allocatable :: fault
  end type physical_group_t

  !> Mesh as read from a file.
  type, public :: mesh_t
    !> File name, for messages.
    character(:), allocatable :: file
    !> Nodal coordinates (3, n_nodes) [length]; z is 0 in a plane mesh. Nodes without elements are allowed.
    real(dp), allocatable :: x(:, :)
    !> Node tags in the file (n_nodes).
    integer(int64), allocatable :: node_tag(:)
    !> Number of each node among those of the file, ascending (n_nodes); not allocated where all were read.
    integer, allocatable :: file_node(:)
    !> Number of nodes of the file, where not all were read.
    integer :: n_file_nodes = 0
    !> Elements (n_blocks).
    type(element_block_t), allocatable :: block(:)
    !> Physical groups (n_groups). Groups of different dimension, and of the same one, may share a name.
    type(physical_group_t), allocatable :: group(:)
  end type mesh_t
end module dotyk_mesh_mesh
