!> The boundary of the mesh of one body: the faces that belong to one element only, as flat facets on their corners; and
!> the pieces of the body whose elements are joined by whole faces.
module dotyk_mesh_boundary_facets
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds
  use dotyk_mesh_element_faces, only: corners_of, element_faces_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_union_find, only: join
  implicit none
  private

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
    !> Nodes of the face that are no corners, (any).
    integer, intent(in) :: inner_node(:)
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
end module dotyk_mesh_boundary_facets
