!> Lines: line2 and line3. Reference domain [-1,1].
module dotyk_mesh_line
  use dotyk_mesh_element_kind, only: element_kind_t, element_line2, element_line3, kind_nodes
  implicit none
  private
  public :: line_kind

  integer, parameter, public :: line_node(1, 3) = reshape([-1, 1, 0], [1, 3])  !! Coordinates of the nodes.

contains

  !> Properties of a line.
  pure function line_kind(id) result(kind)
    integer, intent(in) :: id  !! `element_line2` or `element_line3`.
    type(element_kind_t) :: kind
    kind%dimension = 1
    kind%n_nodes = kind_nodes(id)
    kind%n_corners = 2
    kind%corner_kind = element_line2
    kind%vtk_order(:3) = [1, 2, 3]
    select case (id)
    case (element_line2)
      kind%name = 'line2'
      kind%gmsh_type = 1
      kind%vtk_type = 3
      kind%order = 1
    case (element_line3)
      kind%name = 'line3'
      kind%gmsh_type = 8
      kind%vtk_type = 21
      kind%order = 2
    end select
    kind%vtk_order(kind%n_nodes + 1:) = 0
  end function line_kind
end module dotyk_mesh_line
