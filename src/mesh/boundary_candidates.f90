!> The boundary of a body whose elements are on several ranks.
!>
!> Faces that occur once in the elements of a rank are candidates: they are on the boundary of the body, or between two
!> ranks. The directories of the keys (`dotyk_mesh_face_keys`) tell which; no rank needs keys or elements of others.
!> Faces of more than two elements have a key also where two of them are on one rank: then all their corners are nodes
!> that ranks share.
!>
!> The way: `find` on each rank; each `key` to its directory; `keep_boundary` on each rank with the answers; what is
!> wrong with faces is told by `dotyk_mesh_share_faults`.
module dotyk_mesh_boundary_candidates
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds
  use dotyk_mesh_element_faces, only: corners_of, element_faces_t
  use dotyk_mesh_face_faults, only: face_signature
  use dotyk_mesh_face_keys, only: face_census_t, face_key, key_answers_t, key_length, max_corners, node_key
  use dotyk_mesh_union_find, only: join, root_of
  implicit none
  private
  public :: key_length

  type, public :: face_list_t  !! Some faces of the elements of a rank.
    integer :: n = 0  !! Number of faces; each counts once for each of its elements.
    integer, allocatable :: block(:)  !! Block of the element of each face (n).
    integer, allocatable :: element(:)  !! Element of each face in its block, of those on this rank (n).
    integer, allocatable :: face(:)  !! Number of each face in its element (n).
    !> Faces of one group have the same corners; 0 where other ranks have elements too (n).
    integer, allocatable :: group(:)
    logical, allocatable :: on_ranks(:)  !! Whether other ranks have elements at each face (n).
  end type face_list_t

  type, public :: boundary_candidates_t  !! Faces of one rank that may be on the boundary of the body.
    integer :: n = 0  !! Number of faces.
    integer, allocatable :: block(:)  !! Block of the element of each face (n).
    integer, allocatable :: element(:)  !! Element of each face in its block, of those on this rank (n).
    integer, allocatable :: face(:)  !! Number of each face in its element (n).
    integer, allocatable :: key(:, :)  !! What other ranks must know (key_length, any).
    !> Root of the connected part of each node: the lowest node of the part, by its number in the whole body; as far as
    !> the elements of this rank tell, and in the whole body after `keep_boundary` (n_nodes).
    integer, allocatable :: root(:)
    !> Parts and pieces of the body that are on this rank alone and have no key: their boundary is empty.
    integer :: n_closed_parts = 0, n_closed_pieces = 0
    integer :: n_parts = 0, n_pieces = 0  !! Parts and pieces of the body that have a key; known after `keep_boundary`.
    !> Faces of which this rank has several elements, where other ranks may have more or something is wrong; after
    !> `keep_boundary` also what is wrong with other faces on several ranks.
    type(face_list_t) :: inner
    !> Elements of this rank of which other ranks have all faces too: block, element (2, any); known after
    !> `keep_boundary`.
    integer, allocatable :: enclosed(:, :)
  contains
    procedure :: find => candidates_find
    procedure :: keep_boundary => candidates_keep_boundary
  end type boundary_candidates_t

contains

  !> Find the faces that occur once, and the keys.
  subroutine candidates_find(self, mesh, whole_node, n_sharers, rank)
    class(boundary_candidates_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements that the rank owns, and their nodes, maybe among others.
    integer, intent(in) :: whole_node(:)  !! Number of each node in the whole body, ascending (n_nodes).
    integer, intent(in) :: n_sharers(:)  !! Number of ranks whose elements have each node (n_nodes).
    integer, intent(in) :: rank  !! This rank, from 0.
    type(element_faces_t) :: faces
    integer, allocatable :: component(:), lowest(:), once(:), several(:), lone(:), piece(:), signature(:)
    logical, allocatable :: told(:), has_element(:), part_told(:), piece_told(:)
    integer :: i, k, n_components
    call faces%find(mesh)
    allocate (component(mesh%n_nodes()))
    call connected_components(mesh, component, n_components)
    allocate (lowest(n_components), source=huge(0))
    do i = 1, size(component)
      lowest(component(i)) = min(lowest(component(i)), whole_node(i))
    end do
    self%root = lowest(component)
    call find_pieces(mesh, faces, piece)
    call sign_faces(mesh, faces, whole_node, signature)
    once = pack([(i, i=1, faces%n)], faces%times == 1)
    self%n = size(once)
    self%block = faces%block(once)
    self%element = faces%element(once)
    self%face = faces%face(once)
    call find_inner_faces(mesh, faces, signature, n_sharers, several, self%inner)
    allocate (self%key(key_length, self%n + size(several)))
    allocate (told(mesh%n_nodes()), has_element(mesh%n_nodes()), part_told(n_components), source=.false.)
    allocate (piece_told(maxval([0, piece])), source=.false.)
    do k = 1, size(self%key, 2)
      if (k <= self%n) then
        i = once(k)
      else
        i = several(k - self%n)
      end if
      associate (node => nodes_of(mesh, faces%block(i), faces%element(i), faces%face(i)))
        associate (corner => node(:n_corners_of(mesh, faces%block(i), faces%face(i))))
          self%key(:, k) = face_key(whole_node(corner), self%root(corner(1)), piece(i), signature(i), rank, &
                                    faces%times(i))
          told(node) = .true.
          part_told(component(corner(1))) = .true.
          piece_told(piece(i)) = .true.
        end associate
      end associate
    end do
    do i = 1, size(mesh%block)
      do k = 1, size(mesh%block(i)%tag)
        has_element(mesh%block(i)%node(:, k)) = .true.
      end do
    end do
    ! Where elements overlap, ranks may share nodes around which each of them has a closed star of elements.
    lone = pack([(i, i=1, size(told))], has_element .and. n_sharers > 1 .and. .not. told)
    self%key = reshape([self%key, [(node_key(whole_node(lone(i)), self%root(lone(i))), i=1, size(lone))]], &
                       [key_length, size(self%key, 2) + size(lone)])
    part_told(component(lone)) = .true.
    self%n_closed_pieces = count(.not. piece_told)
    do i = 1, mesh%n_nodes()
      if (.not. has_element(i) .or. part_told(component(i))) cycle
      part_told(component(i)) = .true.
      self%n_closed_parts = self%n_closed_parts + 1
    end do
  end subroutine candidates_find

  !> Number of corners of a face.
  pure integer function n_corners_of(mesh, block, face) result(n)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the rank.
    integer, intent(in) :: block  !! Block of the element.
    integer, intent(in) :: face  !! Number of the face in the element.
    type(element_kind_t) :: kind
    kind = element_kind(mesh%block(block)%kind)
    n = corners_of(kind%face_kind(face))
  end function n_corners_of

  !> Nodes of a face, corners first (n_nodes of the face).
  pure function nodes_of(mesh, block, element, face) result(node)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the rank.
    integer, intent(in) :: block  !! Block of the element.
    integer, intent(in) :: element  !! The element in its block.
    integer, intent(in) :: face  !! Number of the face in the element.
    integer, allocatable :: node(:)
    type(element_kind_t) :: kind
    kind = element_kind(mesh%block(block)%kind)
    node = mesh%block(block)%node(kind%face_node(:kind_nodes(kind%face_kind(face)), face), element)
  end function nodes_of

  !> Piece of the element of each face: elements that whole faces join, as far as this rank knows.
  subroutine find_pieces(mesh, faces, piece)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the rank.
    type(element_faces_t), intent(in) :: faces  !! Their faces.
    integer, allocatable, intent(out) :: piece(:)  !! The pieces, numbered from 1 (n_faces).
    integer, allocatable :: parent(:), number(:)
    integer :: b, i, n, offset(size(mesh%block) + 1)
    offset(1) = 0
    do b = 1, size(mesh%block)
      offset(b + 1) = offset(b) + size(mesh%block(b)%tag)
    end do
    allocate (parent(offset(size(offset))))
    parent = [(i, i=1, size(parent))]
    do i = 1, faces%n
      if (faces%first(i) /= i) call join(parent, element_of(faces%first(i)), element_of(i))
    end do
    allocate (number(size(parent)), source=0)
    n = 0
    do i = 1, size(parent)
      if (parent(i) /= i) cycle
      n = n + 1
      number(i) = n
    end do
    allocate (piece(faces%n))
    do i = 1, faces%n
      piece(i) = number(root_of(parent, element_of(i)))
    end do

  contains

    !> Element of a face, counted through all blocks.
    pure integer function element_of(face)
      integer, intent(in) :: face  !! The face.
      element_of = offset(faces%block(face)) + faces%element(face)
    end function element_of
  end subroutine find_pieces

  !> Signatures of the nodes on all faces.
  subroutine sign_faces(mesh, faces, whole_node, signature)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the rank.
    type(element_faces_t), intent(in) :: faces  !! Their faces.
    integer, intent(in) :: whole_node(:)  !! Number of each node in the whole body (n_nodes).
    integer, allocatable, intent(out) :: signature(:)  !! The signatures (n_faces).
    type(element_kind_t) :: kind(size(mesh%block))
    integer :: b, i, m, id, corners(n_element_kinds)
    corners = [(corners_of(i), i=1, n_element_kinds)]
    do b = 1, size(mesh%block)
      kind(b) = element_kind(mesh%block(b)%kind)
    end do
    allocate (signature(faces%n))
    do i = 1, faces%n
      b = faces%block(i)
      id = kind(b)%face_kind(faces%face(i))
      m = corners(id)
      associate (inner => kind(b)%face_node(m + 1:kind_nodes(id), faces%face(i)))
        signature(i) = face_signature(id, whole_node(mesh%block(b)%node(inner, faces%element(i))))
      end associate
    end do
  end subroutine sign_faces

  !> Find the faces of several elements of this rank that other ranks may have, and those that are wrong.
  subroutine find_inner_faces(mesh, faces, signature, n_sharers, several, inner)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the rank.
    type(element_faces_t), intent(in) :: faces  !! Their faces.
    integer, intent(in) :: signature(:)  !! Signature of the nodes on each face (n_faces).
    integer, intent(in) :: n_sharers(:)  !! Number of ranks whose elements have each node (n_nodes).
    integer, allocatable, intent(out) :: several(:)  !! Those that other ranks may have, once each (any).
    type(face_list_t), intent(out) :: inner  !! All of them, for each of their elements.
    integer, allocatable :: chosen(:)
    type(element_kind_t) :: kind(size(mesh%block))
    logical, allocatable :: is_chosen(:), is_shared(:)
    integer :: b, i, corners(n_element_kinds)
    corners = [(corners_of(i), i=1, n_element_kinds)]
    do b = 1, size(mesh%block)
      kind(b) = element_kind(mesh%block(b)%kind)
    end do
    allocate (is_chosen(faces%n), is_shared(faces%n), source=.false.)
    do i = 1, faces%n
      if (faces%times(i) > 2) is_chosen(i) = .true.
      if (signature(i) /= signature(faces%first(i))) is_chosen(faces%first(i)) = .true.
      if (faces%times(i) < 2) cycle
      b = faces%block(i)
      associate (corner => kind(b)%face_node(:corners(kind(b)%face_kind(faces%face(i))), faces%face(i)))
        is_shared(i) = all(n_sharers(mesh%block(b)%node(corner, faces%element(i))) > 1)
      end associate
    end do
    several = pack([(i, i=1, faces%n)], is_shared)
    is_chosen = is_chosen .or. is_shared
    chosen = pack([(i, i=1, faces%n)], is_chosen(faces%first))
    inner%n = size(chosen)
    inner%block = faces%block(chosen)
    inner%element = faces%element(chosen)
    inner%face = faces%face(chosen)
    inner%group = faces%first(chosen)
    allocate (inner%on_ranks(inner%n), source=.false.)
  end subroutine find_inner_faces

  !> Keep the faces that are on the boundary of the body: those whose corners no other face has.
  subroutine candidates_keep_boundary(self, mesh, whole_node, answers)
    class(boundary_candidates_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements that the rank owns, and their nodes, maybe among others.
    integer, intent(in) :: whole_node(:)  !! Number of each node in the whole body, ascending (n_nodes).
    type(key_answers_t), intent(inout) :: answers  !! What the directories tell.
    type(face_census_t) :: census
    integer, allocatable :: kept(:), face(:)
    integer :: i
    call census%take(self%key, answers%face)
    face = [(census%find(self%key(:max_corners, i)), i=1, self%n)]
    call take_shared_faces(self, mesh, whole_node, census, face)
    kept = pack([(i, i=1, self%n)], census%times(face) == 1)
    self%n = size(kept)
    self%block = self%block(kept)
    self%element = self%element(kept)
    self%face = self%face(kept)
    deallocate (self%key)
    ! A part without keys is closed, and has no other rank at its nodes.
    self%root = [(int(answers%parts%lowest(int(self%root(i), int64))), i=1, size(self%root))]
    self%n_parts = answers%parts%n_sets()
    self%n_pieces = answers%pieces%n_sets()
  end subroutine candidates_keep_boundary

  !> Find the faces that are wrong on several ranks, and elements of which other ranks have all faces.
  subroutine take_shared_faces(self, mesh, whole_node, census, face)
    type(boundary_candidates_t), intent(inout) :: self  !! The candidates; `inner` and `enclosed` are completed.
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the rank.
    integer, intent(in) :: whole_node(:)  !! Number of each node in the whole body (n_nodes).
    type(face_census_t), intent(in) :: census  !! Faces of all ranks.
    integer, intent(in) :: face(:)  !! Number of each candidate there (n).
    type(element_kind_t) :: kind
    integer, allocatable :: n_shared(:, :), chosen(:)
    integer :: b, e, i, f, n_faces(size(mesh%block))
    allocate (n_shared(maxval([0, (size(mesh%block(b)%tag), b=1, size(mesh%block))]), size(mesh%block)), source=0)
    do i = 1, self%n
      if (.not. census%on_ranks(face(i))) cycle
      n_shared(self%element(i), self%block(i)) = n_shared(self%element(i), self%block(i)) + 1
    end do
    do i = 1, self%inner%n
      associate (node => nodes_of(mesh, self%inner%block(i), self%inner%element(i), self%inner%face(i)))
        f = census%find(whole_node(node(:n_corners_of(mesh, self%inner%block(i), self%inner%face(i)))))
      end associate
      if (f == 0) cycle
      if (.not. census%on_ranks(f)) cycle
      self%inner%on_ranks(i) = .true.
      n_shared(self%inner%element(i), self%inner%block(i)) = n_shared(self%inner%element(i), self%inner%block(i)) + 1
    end do
    chosen = pack([(i, i=1, self%n)], [(census%is_wrong(face(i)), i=1, self%n)])
    associate (inner => self%inner)
      inner%n = inner%n + size(chosen)
      inner%block = [inner%block, self%block(chosen)]
      inner%element = [inner%element, self%element(chosen)]
      inner%face = [inner%face, self%face(chosen)]
      inner%group = [inner%group, spread(0, 1, size(chosen))]
      inner%on_ranks = [inner%on_ranks, spread(.true., 1, size(chosen))]
    end associate
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      n_faces(b) = kind%n_faces
    end do
    allocate (self%enclosed(2, sum([(count(n_shared(:, b) == n_faces(b)), b=1, size(n_faces))])))
    i = 0
    do b = 1, size(mesh%block)
      do e = 1, size(mesh%block(b)%tag)
        if (n_shared(e, b) < n_faces(b)) cycle
        i = i + 1
        self%enclosed(:, i) = [b, e]
      end do
    end do
  end subroutine take_shared_faces
end module dotyk_mesh_boundary_candidates
