!> The boundary of the mesh of one body: the faces that belong to one element only, as flat facets on their corners; and
!> the pieces of the body whose elements are joined by whole faces.
module dotyk_mesh_boundary_facets
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_element_faces, only: corners_of, element_faces_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  !> Greatest number of corners of a facet.
  integer, parameter, public :: max_corners = 4

  !> Boundary facets in three components (z = 0 in two dimensions), and what is wrong with interior faces.
  type, public :: boundary_facets_t
    !> Number of facets.
    integer :: n = 0
    !> Number of corners of each facet (n).
    integer, allocatable :: n_corners(:)
    !> Nodes at the corners, padded with 0 (max_corners, n).
    integer, allocatable :: corner(:, :)
    !> Element of each facet, counted through all blocks (n).
    integer, allocatable :: element(:)
    !> Mean of the corners (3, n) [length].
    real(dp), allocatable :: centre(:, :)
    !> Unit outward normal (3, n) [].
    real(dp), allocatable :: normal(:, :)
    !> Area; length in two dimensions (n) [length^2; length].
    real(dp), allocatable :: area(:)
    !> Number of pieces of the body that no face joins.
    integer :: n_pieces = 0
    !> Number of faces whose two elements have another kind of face each, such as tri6 and tri3.
    integer :: n_mixed = 0
    !> Tags of the elements at the first of them.
    integer(int64) :: mixed(2) = 0
    !> Number of faces of more than two elements.
    integer :: n_shared = 0
    !> A node of the first face of more than two elements, and of the first mixed face; 0 where there is none.
    integer :: shared_node = 0, mixed_node = 0
  contains
    procedure :: find => facets_find
  end type boundary_facets_t

contains

  !> Find the facets.
  subroutine facets_find(self, mesh)
    class(boundary_facets_t), intent(out) :: self
    !> Mesh of the body; the volumes of its elements are positive.
    type(body_mesh_t), intent(in) :: mesh
    type(element_faces_t) :: faces
    type(element_kind_t) :: kind(size(mesh%block))
    ! Faces in the order of the elements; how often each was met so far; the elements before each block.
    integer, allocatable :: order(:), times(:), parent(:)
    integer :: b, e, f, i, k, m, n, offset(size(mesh%block) + 1)
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
      if (times(k) == 3) self%n_shared = self%n_shared + 1
      if (times(k) == 3 .and. self%n_shared == 1) self%shared_node = mesh%block(b)%node(kind(b)%face_node(1, f), e)
      if (faces%block(k) == b) cycle
      if (kind(faces%block(k))%face_kind(faces%face(k)) /= kind(b)%face_kind(f)) self%n_mixed = self%n_mixed + 1
      if (self%n_mixed == 1 .and. self%mixed_node == 0) then
        self%mixed_node = mesh%block(b)%node(kind(b)%face_node(1, f), e)
        self%mixed = [mesh%block(faces%block(k))%tag(faces%element(k)), mesh%block(b)%tag(e)]
      end if
    end do
    do e = 1, size(parent)
      if (parent(e) == e) self%n_pieces = self%n_pieces + 1
    end do
    self%n = count(faces%times == 1)
    allocate (self%n_corners(self%n), self%corner(max_corners, self%n), self%element(self%n), &
              self%centre(3, self%n), self%normal(3, self%n), self%area(self%n))
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
  end subroutine facets_find

  !> Faces in the order of the elements.
  subroutine order_by_element(mesh, faces, order)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Faces of all elements.
    type(element_faces_t), intent(in) :: faces
    !> Their order (n).
    integer, allocatable, intent(out) :: order(:)
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
    !> The facets; facet i is completed.
    type(boundary_facets_t), intent(inout) :: self
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Facet.
    integer, intent(in) :: i
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

  !> Join two elements of a union-find forest.
  pure subroutine join(parent, a, b)
    !> Parent of each element, itself at a root (n_elements); updated.
    integer, intent(inout) :: parent(:)
    !> First element.
    integer, intent(in) :: a
    !> Second element.
    integer, intent(in) :: b
    integer :: i, j
    i = a
    do while (parent(i) /= i)
      parent(i) = parent(parent(i))
      i = parent(i)
    end do
    j = b
    do while (parent(j) /= j)
      parent(j) = parent(parent(j))
      j = parent(j)
    end do
    parent(max(i, j)) = min(i, j)
  end subroutine join
end module dotyk_mesh_boundary_facets
