!> The boundary of the mesh of one body: the faces that belong to one element only, as flat facets on their corners; and
!> the pieces of the body whose elements are joined by whole faces.
module dotyk_mesh_boundary_facets
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, max_faces
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
    type(corner_table_t) :: table
    ! Of each face: its first element and that one's block and face, the number of its elements.
    integer, allocatable :: owner(:), owner_block(:), owner_face(:), times(:), parent(:)
    type(element_kind_t) :: kind(size(mesh%block))
    integer :: b, e, f, n, m, entry, offset(size(mesh%block) + 1), n_corners(max_faces, size(mesh%block))
    n = 0
    offset(1) = 0
    do b = 1, size(mesh%block)
      kind(b) = element_kind(mesh%block(b)%kind)
      do f = 1, kind(b)%n_faces
        n_corners(f, b) = corners_of_kind(kind(b)%face_kind(f))
      end do
      offset(b + 1) = offset(b) + size(mesh%block(b)%tag)
      n = n + kind(b)%n_faces*size(mesh%block(b)%tag)
    end do
    call table%init(max_corners, n)
    allocate (owner(n), owner_block(n), owner_face(n), times(n))
    parent = [(e, e=1, offset(size(offset)))]
    do b = 1, size(mesh%block)
      do e = 1, size(mesh%block(b)%tag)
        do f = 1, kind(b)%n_faces
          n = table%n
          m = n_corners(f, b)
          call table%add(mesh%block(b)%node(kind(b)%face_node(:m, f), e), entry)
          if (entry > n) then
            owner(entry) = offset(b) + e
            owner_block(entry) = b
            owner_face(entry) = f
            times(entry) = 1
          else
            times(entry) = times(entry) + 1
            call join(parent, owner(entry), offset(b) + e)
            if (times(entry) == 3) self%n_shared = self%n_shared + 1
            if (times(entry) == 3 .and. self%n_shared == 1) &
              self%shared_node = mesh%block(b)%node(kind(b)%face_node(1, f), e)
            if (owner_block(entry) /= b) then
              associate (other => kind(owner_block(entry)))
                if (other%face_kind(owner_face(entry)) /= kind(b)%face_kind(f)) self%n_mixed = self%n_mixed + 1
              end associate
              if (self%n_mixed == 1 .and. self%mixed_node == 0) then
                self%mixed_node = mesh%block(b)%node(kind(b)%face_node(1, f), e)
                self%mixed = [mesh%block(owner_block(entry))%tag(owner(entry) - offset(owner_block(entry))), &
                              mesh%block(b)%tag(e)]
              end if
            end if
          end if
        end do
      end do
    end do
    do e = 1, size(parent)
      if (parent(e) == e) self%n_pieces = self%n_pieces + 1
    end do
    self%n = count(times(:table%n) == 1)
    allocate (self%n_corners(self%n), self%corner(max_corners, self%n), self%element(self%n), &
              self%centre(3, self%n), self%normal(3, self%n), self%area(self%n))
    n = 0
    do entry = 1, table%n
      if (times(entry) > 1) cycle
      n = n + 1
      self%element(n) = owner(entry)
      b = owner_block(entry)
      f = owner_face(entry)
      m = n_corners(f, b)
      self%n_corners(n) = m
      self%corner(:, n) = 0
      self%corner(:m, n) = mesh%block(b)%node(kind(b)%face_node(:m, f), owner(entry) - offset(b))
      call set_geometry(self, mesh, n)
    end do
  end subroutine facets_find

  !> Number of corners of an element kind.
  pure integer function corners_of_kind(id)
    !> One of the element kinds.
    integer, intent(in) :: id
    type(element_kind_t) :: kind
    kind = element_kind(id)
    corners_of_kind = kind%n_corners
  end function corners_of_kind

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
