!> Hexahedra: hex8, hex20 (serendipity) and hex27. Reference domain [-1,1]^3.
module dotyk_mesh_hexahedron
  use dotyk_mesh_element_kind, only: element_hex20, element_hex27, element_hex8, element_kind_t, element_quad4, &
    element_quad8, element_quad9, kind_nodes
  implicit none
  private
  public :: hexahedron_kind

  !> Coordinates of the nodes: corners; edges 12 14 15 23 26 34 37 48 56 58 67 78; faces 1432 1265 1584 2376 3487 5678;
  !> centre.
  integer, parameter, public :: hexahedron_node(3, 27) = reshape([ &
    -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1, &
    0, -1, -1, -1, 0, -1, -1, -1, 0, 1, 0, -1, 1, -1, 0, 0, 1, -1, &
    1, 1, 0, -1, 1, 0, 0, -1, 1, -1, 0, 1, 1, 0, 1, 0, 1, 1, &
    0, 0, -1, 0, -1, 0, -1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], [3, 27])
  !> Faces, outward.
  integer, parameter :: face(9, 6) = reshape([ &
    1, 4, 3, 2, 10, 14, 12, 9, 21, &
    1, 2, 6, 5, 9, 13, 17, 11, 22, &
    1, 5, 8, 4, 11, 18, 16, 10, 23, &
    2, 3, 7, 6, 12, 15, 19, 13, 24, &
    3, 4, 8, 7, 14, 16, 20, 15, 25, &
    5, 6, 7, 8, 17, 19, 20, 18, 26], [9, 6])

contains

  !> Properties of a hexahedron.
  pure function hexahedron_kind(id) result(kind)
    integer, intent(in) :: id  !! `element_hex8`, `element_hex20` or `element_hex27`.
    type(element_kind_t) :: kind
    integer :: n
    kind%dimension = 3
    kind%n_nodes = kind_nodes(id)
    kind%n_corners = 8
    kind%corner_kind = element_hex8
    kind%n_faces = 6
    select case (id)
    case (element_hex8)
      kind%name = 'hex8'
      kind%gmsh_type = 5
      kind%vtk_type = 12
      kind%order = 1
      kind%face_kind = element_quad4
    case (element_hex20)
      kind%name = 'hex20'
      kind%gmsh_type = 17
      kind%vtk_type = 25
      kind%order = 2
      kind%face_kind = element_quad8
    case (element_hex27)
      kind%name = 'hex27'
      kind%gmsh_type = 12
      kind%vtk_type = 29
      kind%order = 2
      kind%face_kind = element_quad9
    end select
    n = kind_nodes(kind%face_kind(1))
    kind%face_node(:n, :) = face(:n, :)
    kind%vtk_order = [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 14, 10, 17, 19, 20, 18, 11, 13, 15, 16, 23, 24, 22, 25, 21, 26, 27]
    kind%vtk_order(kind%n_nodes + 1:) = 0
  end function hexahedron_kind
end module dotyk_mesh_hexahedron
