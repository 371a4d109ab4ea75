!> The whole boundary of a body: the faces of its elements that belong to one element only.
module dotyk_mesh_boundary
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, max_facet_nodes
  use dotyk_mesh_element_faces, only: element_faces_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: extract_boundary

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
end module dotyk_mesh_boundary
