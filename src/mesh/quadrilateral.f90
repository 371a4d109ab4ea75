!> Quadrilaterals: quad4, quad8 (serendipity) and quad9. Reference domain [-1,1]^2.
module dotyk_mesh_quadrilateral
  use dotyk_mesh_element_kind, only: element_kind_t, element_line2, element_line3, element_quad4, element_quad8, &
    element_quad9, kind_nodes
  implicit none
  private
  public :: quadrilateral_kind

  !> Coordinates of the nodes.
  integer, parameter, public :: quadrilateral_node(2, 9) = reshape([ &
    -1, -1, 1, -1, 1, 1, -1, 1, &
    0, -1, 1, 0, 0, 1, -1, 0, 0, 0], [2, 9])
  integer, parameter :: face(3, 4) = reshape([1, 2, 5, 2, 3, 6, 3, 4, 7, 4, 1, 8], [3, 4])  !! Edges, counter-clockwise.

contains

  !> Properties of a quadrilateral.
  pure function quadrilateral_kind(id) result(kind)
    integer, intent(in) :: id  !! `element_quad4`, `element_quad8` or `element_quad9`.
    type(element_kind_t) :: kind
    integer :: i
    kind%dimension = 2
    kind%n_nodes = kind_nodes(id)
    kind%n_corners = 4
    kind%corner_kind = element_quad4
    kind%n_faces = 4
    kind%vtk_order(:kind%n_nodes) = [(i, i=1, kind%n_nodes)]
    select case (id)
    case (element_quad4)
      kind%name = 'quad4'
      kind%gmsh_type = 3
      kind%vtk_type = 9
      kind%order = 1
    case (element_quad8)
      kind%name = 'quad8'
      kind%gmsh_type = 16
      kind%vtk_type = 23
      kind%order = 2
    case (element_quad9)
      kind%name = 'quad9'
      kind%gmsh_type = 10
      kind%vtk_type = 28
      kind%order = 2
    end select
    if (kind%order == 1) then
      kind%face_kind(:4) = element_line2
      kind%face_node(:2, :4) = face(:2, :)
    else
      kind%face_kind(:4) = element_line3
      kind%face_node(:3, :4) = face
    end if
  end function quadrilateral_kind
end module dotyk_mesh_quadrilateral
