!> Faces of the elements of a body: the element behind each, and the faces of the boundary.
module dotyk_elasticity_face_table
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_dimension, max_facet_nodes, reference_nodes, &
    shape_functions
  use dotyk_mesh_element_kind, only: max_faces
  implicit none
  private

  type, public :: face_table_t  !! The table.
    integer, allocatable :: neighbour(:, :)  !! Element behind each face; 0 on the boundary (max_faces, n_elements).
    integer, allocatable :: boundary(:, :)  !! Index of each face on the boundary, or 0 (max_faces, n_elements).
    integer, allocatable :: interior(:, :)  !! Index of each face among the inner ones, or 0 (max_faces, n_elements).
    integer :: n_interior = 0  !! Number of faces between two elements.
    integer :: n_boundary = 0  !! Number of faces of the boundary.
    integer, allocatable :: before(:)  !! First element of each block minus one, then all elements (n_blocks + 1).
    integer, allocatable :: block(:)  !! Block of each element (n_elements).
  contains
    procedure :: init => face_table_init
  end type face_table_t

  public :: local_face, point_of_element

contains

  !> Find the neighbours of all elements.
  subroutine face_table_init(self, mesh)
    class(face_table_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(corner_table_t) :: table
    type(element_kind_t) :: kind, face
    integer, allocatable :: owner(:, :)
    integer :: b, e, f, i, n, entry, room
    allocate (self%before(size(mesh%block) + 1), source=0)
    room = 0
    do b = 1, size(mesh%block)
      n = size(mesh%block(b)%node, 2)
      kind = element_kind(mesh%block(b)%kind)
      self%before(b + 1) = self%before(b) + n
      room = room + n*kind%n_faces
    end do
    n = self%before(size(self%before))
    allocate (self%neighbour(max_faces, n), self%boundary(max_faces, n), self%interior(max_faces, n), source=0)
    allocate (self%block(n), owner(2, room))
    call table%init(4, room)
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      self%block(self%before(b) + 1:self%before(b + 1)) = b
      do i = 1, size(mesh%block(b)%node, 2)
        e = self%before(b) + i
        do f = 1, kind%n_faces
          face = element_kind(kind%face_kind(f))
          n = table%n
          call table%add(mesh%block(b)%node(kind%face_node(:face%n_corners, f), i), entry)
          if (entry > n) then
            owner(:, entry) = [e, f]
          else
            self%neighbour(f, e) = owner(1, entry)
            self%neighbour(owner(2, entry), owner(1, entry)) = e
            self%n_interior = self%n_interior + 1
            self%interior(f, e) = self%n_interior
            self%interior(owner(2, entry), owner(1, entry)) = self%n_interior
          end if
        end do
      end do
    end do
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      do e = self%before(b) + 1, self%before(b + 1)
        do f = 1, kind%n_faces
          if (self%neighbour(f, e) > 0) cycle
          self%n_boundary = self%n_boundary + 1
          self%boundary(f, e) = self%n_boundary
        end do
      end do
    end do
  end subroutine face_table_init

  !> Face of an element that has given nodes; 0 for none.
  pure integer function local_face(mesh, block, element, node) result(face)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: block  !! Block of the element.
    integer, intent(in) :: element  !! Number of the element in its block.
    integer, intent(in) :: node(max_facet_nodes)  !! Nodes of the face, padded with 0 (max_facet_nodes).
    type(element_kind_t) :: kind, of_face
    integer :: i
    kind = element_kind(mesh%block(block)%kind)
    do face = 1, kind%n_faces
      of_face = element_kind(kind%face_kind(face))
      associate (mine => mesh%block(block)%node(kind%face_node(:of_face%n_corners, face), element))
        if (all([(any(mine == node(i)), i=1, of_face%n_corners)])) return
      end associate
    end do
    face = 0
  end function local_face

  !> Reference coordinates in an element of a point of a facet whose corners are nodes of the element.
  pure function point_of_element(kind, node, corner_kind, corner, xi_facet) result(xi)
    integer, intent(in) :: kind  !! Kind of the element.
    integer, intent(in) :: node(:)  !! Nodes of the element (n_nodes).
    integer, intent(in) :: corner_kind  !! Linear kind of the facet.
    integer, intent(in) :: corner(:)  !! Nodes at the corners of the facet (n_corners).
    real(dp), intent(in) :: xi_facet(:)  !! Reference coordinates on the facet (dim - 1) [].
    real(dp) :: xi(kind_dimension(kind))
    real(dp) :: place(kind_dimension(kind), size(node)), weight(size(corner))
    integer :: i
    call reference_nodes(kind, place)
    call shape_functions(corner_kind, xi_facet, weight)
    xi = 0
    do i = 1, size(corner)
      xi = xi + weight(i)*place(:, findloc(node, corner(i), dim=1))
    end do
  end function point_of_element
end module dotyk_elasticity_face_table
