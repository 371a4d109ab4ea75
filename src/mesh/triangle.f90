!> Triangles: tri3 and tri6. Reference domain: the unit simplex.
module dotyk_mesh_triangle
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element_kind, only: element_kind_t, element_line2, element_line3, element_tri3, element_tri6, &
    kind_nodes
  implicit none
  private
  public :: triangle_kind

  !> Corners of the edges, in the order of the mid-side nodes.
  integer, parameter, public :: triangle_edge(2, 3) = reshape([1, 2, 2, 3, 3, 1], [2, 3])
  !> Twice the coordinates of the nodes.
  integer, parameter :: twice(2, 6) = reshape([0, 0, 2, 0, 0, 2, 1, 0, 1, 1, 0, 1], [2, 6])
  real(dp), parameter, public :: triangle_node(2, 6) = 0.5_dp*twice  !! Coordinates of the nodes.
  integer, parameter :: face(3, 3) = reshape([1, 2, 4, 2, 3, 5, 3, 1, 6], [3, 3])  !! Edges, counter-clockwise.

contains

  !> Properties of a triangle.
  pure function triangle_kind(id) result(kind)
    integer, intent(in) :: id  !! `element_tri3` or `element_tri6`.
    type(element_kind_t) :: kind
    integer :: i
    kind%dimension = 2
    kind%n_nodes = kind_nodes(id)
    kind%n_corners = 3
    kind%corner_kind = element_tri3
    kind%n_faces = 3
    kind%vtk_order(:kind%n_nodes) = [(i, i=1, kind%n_nodes)]
    select case (id)
    case (element_tri3)
      kind%name = 'tri3'
      kind%gmsh_type = 2
      kind%vtk_type = 5
      kind%order = 1
      kind%face_kind(:3) = element_line2
      kind%face_node(:2, :3) = face(:2, :)
    case (element_tri6)
      kind%name = 'tri6'
      kind%gmsh_type = 9
      kind%vtk_type = 22
      kind%order = 2
      kind%face_kind(:3) = element_line3
      kind%face_node(:3, :3) = face
    end select
  end function triangle_kind
end module dotyk_mesh_triangle
