!> Keys of faces: what ranks tell each other of the faces of their elements that other ranks may have too.
!>
!> Each key goes to a directory, one of the ranks, which gets the keys of a face from all ranks that have it, and
!> answers (`answer_keys`). The nodes of the keys go to directories likewise, which tell what parts have a node in
!> common (`link_nodes`). What then is on all ranks are parts and pieces with their links, as many as ranks that are
!> neighbours.
!>
!> Rows of a key: the corners by their numbers in the whole body, ascending and padded with 0 in front; the root of the
!> part of the body; the piece on the rank, whose elements are joined by whole faces; the signature of the nodes on the
!> face; the rank and the number of its elements there. A key of one corner stands for a node, and has no face.
module dotyk_mesh_face_keys
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_linked_tags, only: linked_tags_t, tag_links_t
  use dotyk_mesh_tag_map, only: growing_tag_map_t
  implicit none
  private

  !> Rows of a key.
  integer, parameter, public :: key_length = 8
  !> Greatest number of corners of a face.
  integer, parameter, public :: max_corners = 4

  !> What the keys of all ranks tell of each face of some of them.
  type, public :: face_census_t
    !> Faces by their corners.
    type(corner_table_t) :: table
    !> Number of elements at each face, 3 for more (n_faces).
    integer, allocatable :: times(:)
    !> Whether several ranks have elements at each face (n_faces).
    logical, allocatable :: on_ranks(:)
    !> Whether ranks have other nodes on each face (n_faces).
    logical, allocatable :: mixed(:)
  contains
    procedure :: count => census_count
    procedure :: take => census_take
    procedure :: find => census_find
    procedure :: is_wrong => census_is_wrong
  end type face_census_t

  !> What the directories tell a rank.
  type, public :: key_answers_t
    !> Answer to each key of the rank (n_keys).
    integer, allocatable :: face(:)
    !> Roots of the parts of the body that have a key, of all ranks.
    type(linked_tags_t) :: parts
    !> Pieces that have a face, of all ranks: those of two ranks are one where both have a face.
    type(linked_tags_t) :: pieces
  end type key_answers_t

  !> Weights of the properties of a face in an answer, after the number of elements.
  integer, parameter :: of_ranks = 4, of_mixed = 8

  public :: answer_keys, directory_of, face_key, link_nodes, list_nodes, list_tags, node_key

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

  !> Directory of a key or node: a number of 0 .. n_directories - 1.
  pure integer function directory_of(corner, n_directories) result(directory)
    !> Corners of the key, ascending, or the node (1 to 4).
    integer, intent(in) :: corner(:)
    !> Number of directories.
    integer, intent(in) :: n_directories
    directory = modulo(minval(corner, mask=corner > 0), n_directories)
  end function directory_of

  !> Tag of the piece of a key, among those of all ranks.
  pure integer(int64) function piece_tag(key) result(tag)
    !> The key (key_length).
    integer, intent(in) :: key(:)
    tag = ishft(int(key(8)/4, int64), 32) + key(6)
  end function piece_tag

  !> Answer the keys that a directory has got.
  subroutine answer_keys(keys, answer, links)
    !> The keys of its faces, of all ranks in any order; maybe some of nodes (key_length, n).
    integer, intent(in) :: keys(:, :)
    !> What the rank of each key must know (n).
    integer, allocatable, intent(out) :: answer(:)
    !> Pieces that have a face in common.
    type(tag_links_t), intent(out) :: links
    type(face_census_t) :: census
    integer(int64), allocatable :: piece_at(:)
    integer :: i, face
    call census%count(keys)
    allocate (answer(size(keys, 2)), source=0)
    allocate (piece_at(size(keys, 2)), source=-1_int64)
    do i = 1, size(keys, 2)
      if (n_corners(keys(:, i)) == 1) cycle
      face = census%find(keys(:max_corners, i))
      answer(i) = census%times(face) + merge(of_ranks, 0, census%on_ranks(face)) + &
                  merge(of_mixed, 0, census%mixed(face))
      if (piece_at(face) < 0) piece_at(face) = piece_tag(keys(:, i))
      call links%add(piece_at(face), piece_tag(keys(:, i)))
    end do
  end subroutine answer_keys

  !> Nodes of the keys of a rank, and the roots of their parts, once each.
  subroutine list_nodes(keys, node_root)
    !> The keys (key_length, any).
    integer, intent(in) :: keys(:, :)
    !> Node and root (2, n).
    integer, allocatable, intent(out) :: node_root(:, :)
    type(growing_tag_map_t) :: nodes
    integer, allocatable :: root(:)
    integer :: i, j, k
    allocate (root(max_corners*size(keys, 2)))
    do i = 1, size(keys, 2)
      do j = 1, max_corners
        if (keys(j, i) == 0) cycle
        call nodes%add(int(keys(j, i), int64), k)
        root(k) = keys(max_corners + 1, i)
      end do
    end do
    allocate (node_root(2, nodes%n))
    if (nodes%n > 0) node_root(1, :) = int(nodes%tag(:nodes%n))
    node_root(2, :) = root(:nodes%n)
  end subroutine list_nodes

  !> Parts that have a node in common, of the nodes that a directory has got.
  subroutine link_nodes(node_root, links)
    !> Nodes with the roots of their parts, from `list_nodes` of all ranks in any order (2, n).
    integer, intent(in) :: node_root(:, :)
    !> The roots.
    type(tag_links_t), intent(out) :: links
    type(growing_tag_map_t) :: nodes
    integer, allocatable :: root(:)
    integer :: i, k
    allocate (root(size(node_root, 2)), source=0)
    do i = 1, size(node_root, 2)
      call nodes%add(int(node_root(1, i), int64), k)
      if (root(k) == 0) root(k) = node_root(2, i)
      call links%add(int(root(k), int64), int(node_root(2, i), int64))
    end do
  end subroutine link_nodes

  !> Parts and pieces of the keys of a rank, once each.
  subroutine list_tags(keys, parts, pieces)
    !> The keys (key_length, any).
    integer, intent(in) :: keys(:, :)
    !> Roots of the parts (any).
    integer(int64), allocatable, intent(out) :: parts(:)
    !> Tags of the pieces that have a face (any).
    integer(int64), allocatable, intent(out) :: pieces(:)
    type(growing_tag_map_t) :: of_parts, of_pieces
    integer :: i, k
    do i = 1, size(keys, 2)
      call of_parts%add(int(keys(max_corners + 1, i), int64), k)
      if (n_corners(keys(:, i)) > 1) call of_pieces%add(piece_tag(keys(:, i)), k)
    end do
    allocate (parts(of_parts%n), pieces(of_pieces%n))
    if (size(parts) > 0) parts = of_parts%tag(:of_parts%n)
    if (size(pieces) > 0) pieces = of_pieces%tag(:of_pieces%n)
  end subroutine list_tags

  !> Count the elements at faces.
  subroutine census_count(self, keys)
    class(face_census_t), intent(out) :: self
    !> All keys of these faces, of all ranks (key_length, any).
    integer, intent(in) :: keys(:, :)
    integer, allocatable :: first(:)
    integer :: i, m, entry
    call make_room(self, size(keys, 2))
    allocate (first(size(keys, 2)), source=0)
    do i = 1, size(keys, 2)
      m = n_corners(keys(:, i))
      if (m == 1) cycle
      call self%table%add(keys(max_corners - m + 1:max_corners, i), entry)
      self%times(entry) = min(3, self%times(entry) + mod(keys(8, i), 4))
      if (first(entry) == 0) first(entry) = i
      self%on_ranks(entry) = self%on_ranks(entry) .or. keys(8, i)/4 /= keys(8, first(entry))/4
      self%mixed(entry) = self%mixed(entry) .or. keys(7, i) /= keys(7, first(entry))
    end do
  end subroutine census_count

  !> Take what the directories answer.
  subroutine census_take(self, keys, answer)
    class(face_census_t), intent(out) :: self
    !> Keys of a rank (key_length, n).
    integer, intent(in) :: keys(:, :)
    !> Answers (n).
    integer, intent(in) :: answer(:)
    integer :: i, m, entry
    call make_room(self, size(keys, 2))
    do i = 1, size(keys, 2)
      m = n_corners(keys(:, i))
      if (m == 1) cycle
      call self%table%add(keys(max_corners - m + 1:max_corners, i), entry)
      self%times(entry) = mod(answer(i), of_ranks)
      self%on_ranks(entry) = mod(answer(i), of_mixed) >= of_ranks
      self%mixed(entry) = answer(i) >= of_mixed
    end do
  end subroutine census_take

  !> Room for faces.
  subroutine make_room(census, n)
    !> Gets room.
    type(face_census_t), intent(inout) :: census
    !> Number of faces at most.
    integer, intent(in) :: n
    call census%table%init(max_corners, n)
    allocate (census%times(n), source=0)
    allocate (census%on_ranks(n), census%mixed(n), source=.false.)
  end subroutine make_room

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
end module dotyk_mesh_face_keys
