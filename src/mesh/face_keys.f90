!> Keys of faces: what ranks tell each other of the faces of their elements that other ranks may have too. The keys of
!> all ranks, gathered in any order, are on every rank; they have the size of surfaces.
!>
!> Rows of a key: the corners by their numbers in the whole body, ascending and padded with 0 in front; the root of the
!> part of the body; the piece on the rank, whose elements are joined by whole faces; the signature of the nodes on the
!> face; the rank and the number of its elements there. A key of one corner stands for a node, and has no face.
module dotyk_mesh_face_keys
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_tag_map, only: growing_tag_map_t
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private

  !> Rows of a key.
  integer, parameter, public :: key_length = 8
  !> Greatest number of corners of a face.
  integer, parameter, public :: max_corners = 4

  !> What the keys of all ranks tell of each face.
  type, public :: face_census_t
    !> Faces by their corners.
    type(corner_table_t) :: table
    !> Number of elements at each face; what is more than three is not counted in full (n_faces).
    integer, allocatable :: times(:)
    !> Whether several ranks have elements at each face (n_faces).
    logical, allocatable :: on_ranks(:)
    !> Whether ranks have other nodes on each face (n_faces).
    logical, allocatable :: mixed(:)
  contains
    procedure :: init => census_init
    procedure :: find => census_find
    procedure :: is_wrong => census_is_wrong
  end type face_census_t

  public :: face_key, node_key, join_parts, count_pieces

contains

  !> Key of a face.
  pure function face_key(corner, root, piece, signature, rank, times) result(key)
    !> Corners by their numbers in the whole body, in any order (2 to 4).
    integer, intent(in) :: corner(:)
    !> Root of the part of the body.
    integer, intent(in) :: root
    !> Piece on this rank.
    integer, intent(in) :: piece
    !> Signature of the nodes on the face, from `face_signature`.
    integer, intent(in) :: signature
    !> This rank, from 0.
    integer, intent(in) :: rank
    !> Number of elements of this rank at the face.
    integer, intent(in) :: times
    integer :: key(key_length), i
    key = 0
    do i = 1, size(corner)
      ! Its place among the corners, which differ.
      key(max_corners - size(corner) + count(corner <= corner(i))) = corner(i)
    end do
    key(max_corners + 1:) = [root, piece, signature, 4*rank + min(times, 3)]
  end function face_key

  !> Key of a node that ranks share although no face tells it.
  pure function node_key(node, root) result(key)
    !> Number of the node in the whole body.
    integer, intent(in) :: node
    !> Root of the part of the body.
    integer, intent(in) :: root
    integer :: key(key_length)
    key = 0
    key(max_corners:max_corners + 1) = [node, root]
  end function node_key

  !> Number of corners of a key.
  pure integer function n_corners(key)
    !> The key (key_length).
    integer, intent(in) :: key(:)
    n_corners = count(key(:max_corners) > 0)
  end function n_corners

  !> Count the elements at the faces of all ranks.
  subroutine census_init(self, all_keys)
    class(face_census_t), intent(out) :: self
    !> Keys of all ranks (key_length, any).
    integer, intent(in) :: all_keys(:, :)
    integer, allocatable :: first(:)
    integer :: i, m, entry
    call self%table%init(max_corners, size(all_keys, 2))
    allocate (self%times(size(all_keys, 2)), first(size(all_keys, 2)), source=0)
    allocate (self%on_ranks(size(first)), self%mixed(size(first)), source=.false.)
    do i = 1, size(all_keys, 2)
      m = n_corners(all_keys(:, i))
      if (m == 1) cycle
      call self%table%add(all_keys(max_corners - m + 1:max_corners, i), entry)
      self%times(entry) = self%times(entry) + mod(all_keys(8, i), 4)
      if (first(entry) == 0) first(entry) = i
      self%on_ranks(entry) = self%on_ranks(entry) .or. all_keys(8, i)/4 /= all_keys(8, first(entry))/4
      self%mixed(entry) = self%mixed(entry) .or. all_keys(7, i) /= all_keys(7, first(entry))
    end do
  end subroutine census_init

  !> Number of a face, from its key or corners; 0 where no rank has told it.
  pure integer function census_find(self, corner) result(face)
    class(face_census_t), intent(in) :: self
    !> Corners by their numbers in the whole body, in any order; maybe some 0 (any).
    integer, intent(in) :: corner(:)
    face = self%table%find(pack(corner, corner > 0))
  end function census_find

  !> Whether several ranks have a face, and something is wrong with it.
  pure logical function census_is_wrong(self, face) result(is_wrong)
    class(face_census_t), intent(in) :: self
    !> Number of the face.
    integer, intent(in) :: face
    is_wrong = self%on_ranks(face) .and. (self%times(face) > 2 .or. self%mixed(face))
  end function census_is_wrong

  !> Join the connected parts of all ranks: what has a common node belongs to one part.
  subroutine join_parts(all_keys, root, n_parts)
    !> Keys of all ranks (key_length, any).
    integer, intent(in) :: all_keys(:, :)
    !> Root of each node of this rank, as far as its elements tell; in the whole body on return (n_nodes).
    integer, intent(inout) :: root(:)
    !> Number of parts of the whole body that have a key.
    integer, intent(out) :: n_parts
    type(growing_tag_map_t) :: parts, corners
    integer, allocatable :: parent(:), part_of_corner(:)
    integer :: i, j, part, corner, a, b
    ! The keys have all roots that matter: a part without keys is closed, and has no other rank at its nodes.
    allocate (parent(size(all_keys, 2)), part_of_corner(max_corners*size(all_keys, 2)), source=0)
    do i = 1, size(all_keys, 2)
      call parts%add(int(all_keys(max_corners + 1, i), int64), part)
      if (parent(part) == 0) parent(part) = part
      do j = 1, max_corners
        if (all_keys(j, i) == 0) cycle
        call corners%add(int(all_keys(j, i), int64), corner)
        if (part_of_corner(corner) == 0) part_of_corner(corner) = part
        a = root_of(parent, part)
        b = root_of(parent, part_of_corner(corner))
        if (a == b) cycle
        ! The root of lower number stays.
        if (parts%tag(a) < parts%tag(b)) then
          parent(b) = a
        else
          parent(a) = b
        end if
      end do
    end do
    n_parts = count([(parent(i) == i, i=1, parts%n)])
    do i = 1, size(root)
      part = parts%find(int(root(i), int64))
      if (part > 0) root(i) = int(parts%tag(root_of(parent, part)))
    end do
  end subroutine join_parts

  !> Count the pieces of the whole body that have a key: those of two ranks are one where both have a face.
  subroutine count_pieces(all_keys, census, n_pieces)
    !> Keys of all ranks (key_length, any).
    integer, intent(in) :: all_keys(:, :)
    !> Their faces.
    type(face_census_t), intent(in) :: census
    !> Number of pieces.
    integer, intent(out) :: n_pieces
    type(growing_tag_map_t) :: pieces
    integer, allocatable :: parent(:), piece_at(:)
    integer :: i, piece, face
    allocate (parent(size(all_keys, 2)), piece_at(size(all_keys, 2)), source=0)
    do i = 1, size(all_keys, 2)
      if (n_corners(all_keys(:, i)) == 1) cycle
      face = census%find(all_keys(:max_corners, i))
      call pieces%add(ishft(int(all_keys(8, i)/4, int64), 32) + all_keys(6, i), piece)
      if (parent(piece) == 0) parent(piece) = piece
      if (piece_at(face) == 0) piece_at(face) = piece
      call join(parent, piece, piece_at(face))
    end do
    n_pieces = count([(parent(i) == i, i=1, pieces%n)])
  end subroutine count_pieces
end module dotyk_mesh_face_keys
