!> The boundary of a body: the faces of its elements that belong to one element only, as a surface of whole facets or as
!> flat facets on their corners; and the pieces of the body whose elements are joined by whole faces.
!>
!> Faces are sorted into buckets by their lowest corner and compared within each bucket: O(number of elements), without
!> hashing.
module dotyk_mesh_boundary
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, max_facet_nodes, n_element_kinds
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  use dotyk_mesh_union_find, only: join
  implicit none
  private
  public :: extract_boundary

  !> Faces of all elements, sorted by their lowest corners; those with the same lowest corner by their elements.
  type :: element_faces_t
    integer :: n = 0  !! Number of faces; each counts once for each of its elements.
    integer, allocatable :: block(:)  !! Block of the element of each face (n).
    integer, allocatable :: element(:)  !! Element of each face in its block (n).
    integer, allocatable :: face(:)  !! Number of each face in its element (n).
    integer, allocatable :: first(:)  !! The first of the faces with the same corners, the face itself included (n).
    integer, allocatable :: times(:)  !! At the first of equal faces their number, at the others 0 (n).
  contains
    procedure :: find => faces_find
  end type element_faces_t

  integer, parameter :: n_others = 3  !! Corners of a face beside the lowest one.

  integer, parameter, public :: max_corners = 4  !! Greatest number of corners of a facet.

  integer, parameter :: kind_bits = 5  !! Signatures end with the kind of the face in this many bits.

  type :: face_faults_t  !! Faults of faces; the first of each kind, in the order of the elements, is told.
    integer :: n_shared = 0  !! Number of faces of more than two elements.
    real(dp) :: shared_position(3) = 0  !! A node of the first of them (3) [length].
    integer :: n_mixed = 0  !! Number of faces on which two elements have other nodes.
    integer(int64) :: mixed(2) = 0  !! Tags of the elements of the first of them.
    logical :: mixed_kinds = .false.  !! Whether they have another kind of face each, such as tri6 and tri3.
    real(dp) :: mixed_position(3) = 0  !! A node of it (3) [length].
  end type face_faults_t

  !> Boundary facets in three components (z = 0 in two dimensions), and what is wrong with interior faces.
  type, public :: boundary_facets_t
    integer :: n = 0  !! Number of facets.
    integer, allocatable :: n_corners(:)  !! Number of corners of each facet (n).
    integer, allocatable :: corner(:, :)  !! Nodes at the corners, padded with 0 (max_corners, n).
    integer, allocatable :: element(:)  !! Element of each facet, counted through all blocks (n).
    real(dp), allocatable :: centre(:, :)  !! Mean of the corners (3, n) [length].
    real(dp), allocatable :: normal(:, :)  !! Unit outward normal (3, n) [].
    real(dp), allocatable :: area(:)  !! Area; length in two dimensions (n) [length^2; length].
    integer :: n_pieces = 0  !! Number of pieces of the body that no face joins.
    type(face_faults_t) :: faults  !! What is wrong with faces of several elements.
  contains
    procedure :: find => facets_find
  end type boundary_facets_t

contains

  !> All facets of the boundary of a body, oriented outward, sorted by their lowest corners.
  subroutine extract_boundary(mesh, surface)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    !> The boundary; it has no name and no tags, and no parent elements where the rank holds a part of the body.
    type(surface_t), intent(out) :: surface
    type(element_faces_t) :: faces
    type(element_kind_t) :: kind
    integer :: b, e, f, i, n, n_nodes
    surface%name = ''
    surface%dimension = mesh%dimension
    surface%order_elevated = mesh%order_elevated
    if (allocated(mesh%whole)) then
      surface%n_facets = size(mesh%whole%facet_kind)
      surface%kind = mesh%whole%facet_kind
      surface%node = mesh%whole%facet_node
      allocate (surface%block(surface%n_facets), surface%element(surface%n_facets), source=0)
      return
    end if
    if (allocated(mesh%face)) then
      call take_faces(mesh, surface)
      return
    end if
    call faces%find(mesh)
    n = count(faces%times == 1)
    surface%n_facets = n
    allocate (surface%kind(n), surface%node(max_facet_nodes, n), surface%block(n), surface%element(n))
    surface%node = 0
    n = 0
    b = 0
    do i = 1, faces%n
      if (faces%times(i) /= 1) cycle
      if (faces%block(i) /= b) kind = element_kind(mesh%block(faces%block(i))%kind)
      b = faces%block(i)
      e = faces%element(i)
      f = faces%face(i)
      n = n + 1
      n_nodes = kind_nodes(kind%face_kind(f))
      surface%kind(n) = kind%face_kind(f)
      surface%node(1:n_nodes, n) = mesh%block(b)%node(kind%face_node(1:n_nodes, f), e)
      surface%block(n) = b
      surface%element(n) = e
    end do
  end subroutine extract_boundary

  !> All faces of a body without volume; they have no parent elements.
  subroutine take_faces(mesh, surface)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(surface_t), intent(inout) :: surface  !! The boundary.
    integer :: b, first, n
    n = sum([(size(mesh%face(b)%tag), b=1, size(mesh%face))])
    surface%n_facets = n
    allocate (surface%kind(n), surface%node(max_facet_nodes, n), surface%block(n), surface%element(n), source=0)
    first = 0
    do b = 1, size(mesh%face)
      n = size(mesh%face(b)%tag)
      surface%kind(first + 1:first + n) = mesh%face(b)%kind
      surface%node(:size(mesh%face(b)%node, 1), first + 1:first + n) = mesh%face(b)%node
      first = first + n
    end do
  end subroutine take_faces

  !> Find the faces of a body.
  subroutine faces_find(self, mesh)
    class(element_faces_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    integer, allocatable :: start(:), key(:, :)
    call sort_faces(mesh, start, self%block, self%element, self%face, key)
    self%n = size(self%block)
    call compare_faces(start, key, self%first, self%times)
  end subroutine faces_find

  !> All faces of all elements, sorted by their lowest corners.
  subroutine sort_faces(mesh, start, block, element, face, key)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    integer, allocatable, intent(out) :: start(:)  !! Of lowest corner v: start(v) .. start(v+1)-1 (n_nodes + 1).
    integer, allocatable, intent(out) :: block(:)  !! Block of the element of each face (n_faces).
    integer, allocatable, intent(out) :: element(:)  !! Element of each face in its block (n_faces).
    integer, allocatable, intent(out) :: face(:)  !! Number of each face in its element (n_faces).
    integer, allocatable, intent(out) :: key(:, :)  !! Other corners, ascending, 0 in front (n_others, n_faces).
    type(element_kind_t) :: kind
    integer, allocatable :: next(:)
    integer :: b, e, f, v, n, pass, low, corners(6), corner(4, 6)
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      n = n + kind%n_faces*size(mesh%block(b)%tag)
    end do
    allocate (start(mesh%n_nodes() + 1), next(mesh%n_nodes()), block(n), element(n), face(n), key(n_others, n))
    next = 0
    do pass = 1, 2
      do b = 1, size(mesh%block)
        kind = element_kind(mesh%block(b)%kind)
        do f = 1, kind%n_faces
          corners(f) = corners_of(kind%face_kind(f))
          corner(1:corners(f), f) = kind%face_node(1:corners(f), f)
        end do
        associate (node => mesh%block(b)%node)
          do e = 1, size(node, 2)
            do f = 1, kind%n_faces
              low = minval(node(corner(1:corners(f), f), e))
              if (pass == 1) then
                next(low) = next(low) + 1
                cycle
              end if
              n = next(low)
              next(low) = n + 1
              block(n) = b
              element(n) = e
              face(n) = f
              call other_corners(node(corner(1:corners(f), f), e), low, key(:, n))
            end do
          end do
        end associate
      end do
      if (pass == 2) exit
      start(1) = 1
      do v = 1, size(next)
        start(v + 1) = start(v) + next(v)
        next(v) = start(v)
      end do
    end do
  end subroutine sort_faces

  !> Number of corners of a facet.
  pure integer function corners_of(facet_kind) result(n)
    integer, intent(in) :: facet_kind  !! Element kind of the facet.
    type(element_kind_t) :: kind
    kind = element_kind(facet_kind)
    n = kind%n_corners
  end function corners_of

  !> Corners of a face without the lowest one, ascending, padded with 0 in front.
  pure subroutine other_corners(corner, low, key)
    integer, intent(in) :: corner(:)  !! Corners (2 to 4).
    integer, intent(in) :: low  !! The lowest of them.
    integer, intent(out) :: key(n_others)  !! The others (n_others).
    integer :: i, j
    key = 0
    do i = 1, size(corner)
      if (corner(i) == low) cycle
      ! Insert from the left: zeros and smaller numbers move to the front.
      j = 1
      do while (j < n_others)
        if (key(j + 1) >= corner(i)) exit
        key(j) = key(j + 1)
        j = j + 1
      end do
      key(j) = corner(i)
    end do
  end subroutine other_corners

  !> Compare the faces of each bucket.
  subroutine compare_faces(start, key, first, times)
    integer, intent(in) :: start(:)  !! First face of each bucket (n_nodes + 1).
    integer, intent(in) :: key(:, :)  !! Other corners of each face (n_others, n_faces).
    integer, allocatable, intent(out) :: first(:)  !! The first of the faces with the same corners (n_faces).
    integer, allocatable, intent(out) :: times(:)  !! Their number there, 0 at the others (n_faces).
    integer :: v, i, j
    allocate (first(size(key, 2)), times(size(key, 2)), source=0)
    do v = 1, size(start) - 1
      do i = start(v), start(v + 1) - 1
        if (first(i) > 0) cycle
        first(i) = i
        times(i) = 1
        do j = i + 1, start(v + 1) - 1
          if (key(n_others, j) /= key(n_others, i)) cycle
          if (any(key(:, j) /= key(:, i))) cycle
          first(j) = i
          times(i) = times(i) + 1
        end do
      end do
    end do
  end subroutine compare_faces

  !> Find the facets.
  subroutine facets_find(self, mesh)
    class(boundary_facets_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body; the volumes of its elements are positive.
    type(element_faces_t) :: faces
    type(element_kind_t) :: kind(size(mesh%block))
    ! Faces in the order of the elements; how often each was met so far; the elements before each block.
    integer, allocatable :: order(:), times(:), parent(:)
    integer :: b, e, f, i, k, m, n, offset(size(mesh%block) + 1), corners(n_element_kinds)
    corners = [(corners_of(i), i=1, n_element_kinds)]
    call faces%find(mesh)
    offset(1) = 0
    do b = 1, size(mesh%block)
      kind(b) = element_kind(mesh%block(b)%kind)
      offset(b + 1) = offset(b) + size(mesh%block(b)%tag)
    end do
    call order_by_element(mesh, faces, order)
    allocate (times(faces%n), source=0)
    parent = [(e, e=1, offset(size(offset)))]
    do n = 1, faces%n
      i = order(n)
      k = faces%first(i)
      times(k) = times(k) + 1
      if (k == i) cycle
      b = faces%block(i)
      e = faces%element(i)
      f = faces%face(i)
      call join(parent, offset(faces%block(k)) + faces%element(k), offset(b) + e)
      if (times(k) == 3) self%faults%n_shared = self%faults%n_shared + 1
      if (times(k) == 3 .and. self%faults%n_shared == 1) self%faults%shared_position = first_node(i)
      if (signature(i) == signature(k)) cycle
      self%faults%n_mixed = self%faults%n_mixed + 1
      if (self%faults%n_mixed > 1) cycle
      self%faults%mixed = [mesh%block(faces%block(k))%tag(faces%element(k)), mesh%block(b)%tag(e)]
      self%faults%mixed_kinds = kind(faces%block(k))%face_kind(faces%face(k)) /= kind(b)%face_kind(f)
      self%faults%mixed_position = first_node(i)
    end do
    do e = 1, size(parent)
      if (parent(e) == e) self%n_pieces = self%n_pieces + 1
    end do
    call reserve(self, count(faces%times == 1))
    k = 0
    do n = 1, faces%n
      i = order(n)
      if (faces%times(i) /= 1) cycle
      k = k + 1
      b = faces%block(i)
      f = faces%face(i)
      m = corners_of(kind(b)%face_kind(f))
      self%element(k) = offset(b) + faces%element(i)
      self%n_corners(k) = m
      self%corner(:, k) = 0
      self%corner(:m, k) = mesh%block(b)%node(kind(b)%face_node(:m, f), faces%element(i))
      call set_geometry(self, mesh, k)
    end do

  contains

    !> Signature of the nodes on a face.
    pure integer function signature(i)
      integer, intent(in) :: i  !! The face.
      integer :: id
      id = kind(faces%block(i))%face_kind(faces%face(i))
      signature = id
      if (kind_nodes(id) == corners(id)) return
      associate (inner => kind(faces%block(i))%face_node(corners(id) + 1:kind_nodes(id), faces%face(i)))
        signature = face_signature(id, mesh%block(faces%block(i))%node(inner, faces%element(i)))
      end associate
    end function signature

    !> Position of the first node of a face.
    pure function first_node(i) result(x)
      integer, intent(in) :: i  !! The face.
      real(dp) :: x(3)
      x = 0
      associate (node => mesh%block(faces%block(i))%node(:, faces%element(i)), &
                 local => kind(faces%block(i))%face_node(1, faces%face(i)))
        x(:mesh%dimension) = mesh%x(:, node(local))
      end associate
    end function first_node
  end subroutine facets_find

  !> A number that tells the nodes on a face beside its corners: equal where kind and nodes are, in any order of nodes.
  pure integer function face_signature(kind, inner_node) result(signature)
    integer, intent(in) :: kind  !! Element kind of the face.
    integer, intent(in) :: inner_node(:)  !! Nodes of the face that are no corners, (any).
    integer(int64), parameter :: factor = 1327217885_int64
    integer(int64) :: hash
    integer :: i
    hash = 0
    do i = 1, size(inner_node)
      hash = hash + iand(ieor(inner_node(i)*factor, ishft(inner_node(i)*factor, -29)), int(z'7fffffff', int64))
    end do
    signature = int(ishft(ibits(hash, 0, 31 - kind_bits), kind_bits)) + kind
  end function face_signature

  !> Make room for facets.
  subroutine reserve(self, n)
    type(boundary_facets_t), intent(inout) :: self  !! The facets.
    integer, intent(in) :: n  !! Their number.
    self%n = n
    allocate (self%n_corners(n), self%corner(max_corners, n), self%element(n), self%centre(3, n), self%normal(3, n), &
              self%area(n))
  end subroutine reserve

  !> Faces in the order of the elements.
  subroutine order_by_element(mesh, faces, order)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    type(element_faces_t), intent(in) :: faces  !! Faces of all elements.
    integer, allocatable, intent(out) :: order(:)  !! Their order (n).
    type(element_kind_t) :: kind
    integer :: b, i, offset(size(mesh%block) + 1), n_faces(size(mesh%block))
    offset(1) = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      n_faces(b) = kind%n_faces
      offset(b + 1) = offset(b) + n_faces(b)*size(mesh%block(b)%tag)
    end do
    allocate (order(faces%n))
    do i = 1, faces%n
      b = faces%block(i)
      order(offset(b) + (faces%element(i) - 1)*n_faces(b) + faces%face(i)) = i
    end do
  end subroutine order_by_element

  !> Centre, normal and area of a facet.
  subroutine set_geometry(self, mesh, i)
    type(boundary_facets_t), intent(inout) :: self  !! The facets; facet i is completed.
    type(body_mesh_t), intent(in) :: mesh  !! Mesh with the nodes of the facets.
    integer, intent(in) :: i  !! Facet.
    real(dp) :: x(3, max_corners), n(3)
    integer :: m
    m = self%n_corners(i)
    x = 0
    x(:mesh%dimension, :m) = mesh%x(:, self%corner(:m, i))
    self%centre(:, i) = sum(x(:, :m), dim=2)/m
    select case (m)
    case (2)
      n = cross(x(:, 2) - x(:, 1), [0.0_dp, 0.0_dp, 1.0_dp])
    case (3)
      n = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))/2
    case default
      n = cross(x(:, 3) - x(:, 1), x(:, 4) - x(:, 2))/2
    end select
    self%area(i) = norm2(n)
    self%normal(:, i) = n/max(norm2(n), tiny(n))
  end subroutine set_geometry
end module dotyk_mesh_boundary
