!> The boundary of a body whose elements are on several ranks.
!>
!> Faces that occur once in the elements of a rank are candidates: they are on the boundary of the body, or between two
!> ranks. The keys of the candidates of all ranks, gathered in any order, tell which. Keys have the size of surfaces; no
!> rank needs elements of others. The body may have faces of two elements at most.
!>
!> The way: `find` on each rank; `key` of all ranks side by side; `keep_boundary` on each rank with all keys.
module dotyk_mesh_boundary_candidates
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_element_faces, only: corners_of, element_faces_t
  use dotyk_mesh_tag_map, only: growing_tag_map_t
  implicit none
  private

  !> Rows of a key: the sorted corners, padded with 0 in front, and the root of the part of the body.
  integer, parameter, public :: key_length = 5
  !> Greatest number of corners of a face.
  integer, parameter :: max_corners = 4

  !> Faces of one rank that may be on the boundary of the body.
  type, public :: boundary_candidates_t
    !> Number of faces.
    integer :: n = 0
    !> Block of the element of each face (n).
    integer, allocatable :: block(:)
    !> Element of each face in its block, of those on this rank (n).
    integer, allocatable :: element(:)
    !> Number of each face in its element (n).
    integer, allocatable :: face(:)
    !> Corners of each face by their numbers in the whole body, and the root of its part (key_length, n).
    integer, allocatable :: key(:, :)
    !> Root of the connected part of each node: the lowest node of the part, by its number in the whole body; as far as
    !> the elements of this rank tell, and in the whole body after `keep_boundary` (n_nodes).
    integer, allocatable :: root(:)
  contains
    procedure :: find => candidates_find
    procedure :: keep_boundary => candidates_keep_boundary
  end type boundary_candidates_t

contains

  !> Find the faces that occur once.
  subroutine candidates_find(self, mesh, whole_node)
    class(boundary_candidates_t), intent(out) :: self
    !> Elements that the rank owns, and their nodes, maybe among others.
    type(body_mesh_t), intent(in) :: mesh
    !> Number of each node in the whole body, ascending (n_nodes).
    integer, intent(in) :: whole_node(:)
    type(element_faces_t) :: faces
    type(element_kind_t) :: kind
    integer, allocatable :: component(:), lowest(:), chosen(:)
    integer :: i, j, m, n_components
    call faces%find(mesh)
    chosen = pack([(i, i=1, faces%n)], faces%times == 1)
    self%n = size(chosen)
    self%block = faces%block(chosen)
    self%element = faces%element(chosen)
    self%face = faces%face(chosen)
    allocate (component(mesh%n_nodes()))
    call connected_components(mesh, component, n_components)
    allocate (lowest(n_components), source=huge(0))
    do i = 1, size(component)
      lowest(component(i)) = min(lowest(component(i)), whole_node(i))
    end do
    self%root = lowest(component)
    allocate (self%key(key_length, self%n), source=0)
    do i = 1, self%n
      kind = element_kind(mesh%block(self%block(i))%kind)
      m = corners_of(kind%face_kind(self%face(i)))
      associate (node => mesh%block(self%block(i))%node(kind%face_node(:m, self%face(i)), self%element(i)))
        do j = 1, m
          ! Its place among the corners, which differ.
          self%key(max_corners - m + count(node <= node(j)), i) = whole_node(node(j))
        end do
        self%key(key_length, i) = self%root(node(1))
      end associate
    end do
  end subroutine candidates_find

  !> Keep the faces that are on the boundary of the body: those whose corners no other candidate has.
  subroutine candidates_keep_boundary(self, all_keys)
    class(boundary_candidates_t), intent(inout) :: self
    !> Keys of the candidates of all ranks (key_length, any).
    integer, intent(in) :: all_keys(:, :)
    type(corner_table_t) :: table
    integer, allocatable :: times(:), kept(:)
    integer :: i, n, m, entry
    call table%init(max_corners, size(all_keys, 2))
    allocate (times(size(all_keys, 2)), source=0)
    do i = 1, size(all_keys, 2)
      m = count(all_keys(:max_corners, i) > 0)
      call table%add(all_keys(max_corners - m + 1:max_corners, i), entry)
      times(entry) = times(entry) + 1
    end do
    allocate (kept(self%n))
    n = 0
    do i = 1, self%n
      m = count(self%key(:max_corners, i) > 0)
      if (times(table%find(self%key(max_corners - m + 1:max_corners, i))) > 1) cycle
      n = n + 1
      kept(n) = i
    end do
    self%n = n
    self%block = self%block(kept(:n))
    self%element = self%element(kept(:n))
    self%face = self%face(kept(:n))
    self%key = self%key(:, kept(:n))
    call join_parts(all_keys, self%root)
  end subroutine candidates_keep_boundary

  !> Join the connected parts of all ranks: faces with a common corner belong to one part.
  subroutine join_parts(all_keys, root)
    !> Keys of the candidates of all ranks (key_length, any).
    integer, intent(in) :: all_keys(:, :)
    !> Root of each node of this rank, as far as its elements tell; in the whole body on return (n_nodes).
    integer, intent(inout) :: root(:)
    type(growing_tag_map_t) :: parts, corners
    integer, allocatable :: parent(:), part_of_corner(:)
    integer :: i, j, part, corner, a, b
    ! Numbers of the parts follow from the keys, which have all roots that matter: a part without candidates is closed,
    ! and has no other rank at its nodes.
    allocate (parent(size(all_keys, 2)), part_of_corner(max_corners*size(all_keys, 2)), source=0)
    do i = 1, size(all_keys, 2)
      call parts%add(int(all_keys(key_length, i), int64), part)
      if (parent(part) == 0) parent(part) = part
      do j = 1, max_corners
        if (all_keys(j, i) == 0) cycle
        call corners%add(int(all_keys(j, i), int64), corner)
        if (part_of_corner(corner) == 0) part_of_corner(corner) = part
        a = ancestor(part)
        b = ancestor(part_of_corner(corner))
        if (a == b) cycle
        ! The root of lower number stays.
        if (parts%tag(a) < parts%tag(b)) then
          parent(b) = a
        else
          parent(a) = b
        end if
      end do
    end do
    do i = 1, size(root)
      part = parts%find(int(root(i), int64))
      if (part > 0) root(i) = int(parts%tag(ancestor(part)))
    end do

  contains

    !> The part at the top of the tree of a part; paths are shortened by halving.
    integer function ancestor(of) result(top)
      !> The part.
      integer, intent(in) :: of
      top = of
      do while (parent(top) /= top)
        parent(top) = parent(parent(top))
        top = parent(top)
      end do
    end function ancestor
  end subroutine join_parts
end module dotyk_mesh_boundary_candidates
