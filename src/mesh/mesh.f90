!> A mesh as in the file: nodes, elements in blocks of one kind, physical groups; all of the file, or volumes of some
!> names with all surfaces, so that no process need hold the volumes of all bodies.
!>
!> Bodies extract their own part of it (`dotyk_mesh_body_mesh`); this module does not know bodies.
module dotyk_mesh_mesh
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: text_t
  implicit none
  private

  type, public :: element_block_t  !! Elements of one kind that belong to the same physical groups.
    integer :: kind = 0  !! Element kind, one of the named integers of `dotyk_mesh_element`.
    !> Nodes of the elements in the order of gmsh, indices of nodes of the mesh (n_nodes of the kind, n_elements).
    integer, allocatable :: node(:, :)
    integer(int64), allocatable :: tag(:)  !! Element tags in the file (n_elements).
    integer :: material = 1  !! Number of their material among those of the body; unused in a mesh as in the file.
    !> Geometric entity (curve, surface or volume of the geometry) of each element, 0 if unknown (n_elements); not
    !> allocated in parts of a mesh.
    integer, allocatable :: entity(:)
    !> Physical groups to which all these elements belong, indices of `group` of the mesh (n_groups of the block, may be
    !> 0).
    integer, allocatable :: group(:)
    integer :: n_in_file = 0  !! Number of elements of the block in the file, where they are counted only.
  end type element_block_t

  type, public :: physical_group_t  !! Named set of elements of one dimension.
    character(:), allocatable :: name  !! Name; the digits of the tag if the file has no name.
    integer :: dimension = 0  !! Dimension of the elements: 0 points, 1 curves, 2 surfaces, 3 volumes.
    integer :: tag = 0  !! Tag in the file, unique among groups of one dimension.
    !> Groups whose union it is, the volumes of one body (`dotyk_mesh_volume_union`); not allocated where the group is
    !> in the file (n_members).
    integer, allocatable :: member(:)
    integer, allocatable :: material(:)  !! Number of the material of each of these among those of the body (n_members).
    character(:), allocatable :: fault  !! What is wrong with such a union; empty where nothing is.
  end type physical_group_t

  type, public :: mesh_t  !! Mesh as read from a file.
    character(:), allocatable :: file  !! File name, for messages.
    !> Nodal coordinates (3, n_nodes) [length]; z is 0 in a plane mesh. Nodes without elements are allowed.
    real(dp), allocatable :: x(:, :)
    integer(int64), allocatable :: node_tag(:)  !! Node tags in the file (n_nodes).
    type(element_block_t), allocatable :: block(:)  !! Elements (n_blocks).
    !> Physical groups (n_groups). Groups of different dimension, and of the same one, may share a name.
    type(physical_group_t), allocatable :: group(:)
  contains
    procedure :: forget_repeated_entities => mesh_forget_repeated_entities
  end type mesh_t

  type, public :: mesh_selection_t  !! What is read of a mesh file.
    logical :: everything = .true.  !! Whether all is read; the other components have no meaning then.
    integer :: dimension = 3  !! Dimension of the volumes: that of space. Elements below surfaces are not read.
    !> Names of physical groups: their elements are read, and all elements of surfaces (n_names).
    type(text_t), allocatable :: volume(:)
    !> Whether the elements of the volumes are counted only (`n_in_file` of their blocks): nothing else is read.
    logical :: counts_only = .false.
  contains
    procedure :: has_volume => selection_has_volume
  end type mesh_selection_t

contains

  !> Forget geometric entities that only repeat the tags of the physical groups, as scripts write them that know of no
  !> faces: they say nothing about the geometry. In meshes of geometries the tags may be equal by chance.
  pure subroutine mesh_forget_repeated_entities(self)
    class(mesh_t), intent(inout) :: self
    integer :: i
    do i = 1, size(self%block)
      associate (block => self%block(i))
        if (size(block%group) /= 1) return
        if (any(block%entity /= self%group(block%group(1))%tag)) return
      end associate
    end do
    do i = 1, size(self%block)
      self%block(i)%entity = 0
    end do
  end subroutine mesh_forget_repeated_entities

  !> Whether the elements of a physical group of the dimension of space are read.
  pure logical function selection_has_volume(self, name) result(has)
    class(mesh_selection_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the group.
    integer :: i
    has = .false.
    do i = 1, size(self%volume)
      has = has .or. self%volume(i)%s == name
    end do
  end function selection_has_volume
end module dotyk_mesh_mesh
