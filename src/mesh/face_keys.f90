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

  integer, parameter, public :: key_length = 8  !! Rows of a key.
  integer, parameter, public :: max_corners = 4  !! Greatest number of corners of a face.

  type, public :: face_census_t  !! What the keys of all ranks tell of each face of some of them.
    type(corner_table_t) :: table  !! Faces by their corners.
    integer, allocatable :: times(:)  !! Number of elements at each face, 3 for more (n_faces).
    logical, allocatable :: on_ranks(:)  !! Whether several ranks have elements at each face (n_faces).
    logical, allocatable :: mixed(:)  !! Whether ranks have other nodes on each face (n_faces).
  contains
    procedure :: count => census_count
    procedure :: take => census_take
    procedure :: find => census_find
    procedure :: is_wrong => census_is_wrong
  end type face_census_t

  type, public :: key_answers_t  !! What the directories tell a rank.
    integer, allocatable :: face(:)  !! Answer to each key of the rank (n_keys).
    type(linked_tags_t) :: parts  !! Roots of the parts of the body that have a key, of all ranks.
    !> Pieces that have a face, of all ranks: those of two ranks are one where both have a face.
    type(linked_tags_t) :: pieces
  end type key_answers_t

  !> Weights of the properties of a face in an answer, after the number of elements.
  integer, parameter :: of_ranks = 4, of_mixed = 8

  public :: answer_keys, directory_of, face_key, link_nodes, list_nodes, list_tags, node_key

contains

  !> Key of a face.
  pure function face_key(corner, root, piece, signature, rank, times) result(key)
    integer, intent(in) :: corner(:)  !! Corners by their numbers in the whole body, in any order (2 to 4).
    integer, intent(in) :: root  !! Root of the part of the body.
    integer, intent(in) :: piece  !! Piece on this rank.
    integer, intent(in) :: signature  !! Signature of the nodes on the face, from `face_signature`.
    integer, intent(in) :: rank  !! This rank, from 0.
    integer, intent(in) :: times  !! Number of elements of this rank at the face.
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
    integer, intent(in) :: node  !! Number of the node in the whole body.
    integer, intent(in) :: root  !! Root of the part of the body.
    integer :: key(key_length)
    key = 0
    key(max_corners:max_corners + 1) = [node, root]
  end function node_key

  !> Number of corners of a key.
  pure integer function n_corners(key)
    integer, intent(in) :: key(:)  !! The key (key_length).
    n_corners = count(key(:max_corners) > 0)
  end function n_corners

  !> Directory of a key or node: a number of 0 .. n_directories - 1.
  pure integer function directory_of(corner, n_directories) result(directory)
    integer, intent(in) :: corner(:)  !! Corners of the key, ascending, or the node (1 to 4).
    integer, intent(in) :: n_directories  !! Number of directories.
    directory = modulo(minval(corner, mask=corner > 0), n_directories)
  end function directory_of

  !> Tag of the piece of a key, among those of all ranks.
  pure integer(int64) function piece_tag(key) result(tag)
    integer, intent(in) :: key(:)  !! The key (key_length).
    tag = ishft(int(key(8)/4, int64), 32) + key(6)
  end function piece_tag

  !> Answer the keys that a directory has got.
  subroutine answer_keys(keys, answer, links)
    !> The keys of its faces, of all ranks in any order; maybe some of nodes (key_length, n).
    integer, intent(in) :: keys(:, :)
    integer, allocatable, intent(out) :: answer(:)  !! What the rank of each key must know (n).
    type(tag_links_t), intent(out) :: links  !! Pieces that have a face in common.
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
    integer, intent(in) :: keys(:, :)  !! The keys (key_length, any).
    integer, allocatable, intent(out) :: node_root(:, :)  !! Node and root (2, n).
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
    type(tag_links_t), intent(out) :: links  !! The roots.
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
    integer, intent(in) :: keys(:, :)  !! The keys (key_length, any).
    integer(int64), allocatable, intent(out) :: parts(:)  !! Roots of the parts (any).
    integer(int64), allocatable, intent(out) :: pieces(:)  !! Tags of the pieces that have a face (any).
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
    integer, intent(in) :: keys(:, :)  !! All keys of these faces, of all ranks (key_length, any).
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
    integer, intent(in) :: keys(:, :)  !! Keys of a rank (key_length, n).
    integer, intent(in) :: answer(:)  !! Answers (n).
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
    type(face_census_t), intent(inout) :: census  !! Gets room.
    integer, intent(in) :: n  !! Number of faces at most.
    call census%table%init(max_corners, n)
    allocate (census%times(n), source=0)
    allocate (census%on_ranks(n), census%mixed(n), source=.false.)
  end subroutine make_room

  !> Number of a face, from its key or corners; 0 where no rank has told it.
  pure integer function census_find(self, corner) result(face)
    class(face_census_t), intent(in) :: self
    integer, intent(in) :: corner(:)  !! Corners by their numbers in the whole body, in any order; maybe some 0 (any).
    face = self%table%find(pack(corner, corner > 0))
  end function census_find

  !> Whether several ranks have a face, and something is wrong with it.
  pure logical function census_is_wrong(self, face) result(is_wrong)
    class(face_census_t), intent(in) :: self
    integer, intent(in) :: face  !! Number of the face.
    is_wrong = self%on_ranks(face) .and. (self%times(face) > 2 .or. self%mixed(face))
  end function census_is_wrong
end module dotyk_mesh_face_keys
