!> Tetrahedra: tet4 and tet10. Reference domain: the unit simplex.
module dotyk_mesh_tetrahedron
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element_kind, only: element_kind_t, element_tet10, element_tet4, element_tri3, element_tri6, kind_nodes
  implicit none
  private
  public :: tetrahedron_kind

  !> Corners of the edges, in the order of the mid-side nodes; in VTK the last two are exchanged.
  integer, parameter, public :: tetrahedron_edge(2, 6) = reshape([1, 2, 2, 3, 3, 1, 4, 1, 4, 3, 4, 2], [2, 6])
  !> Twice the coordinates of the nodes.
  integer, parameter :: twice(3, 10) = reshape([ &
    0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2, &
    1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1, 0, 1], [3, 10])
  real(dp), parameter, public :: tetrahedron_node(3, 10) = 0.5_dp*twice  !! Coordinates of the nodes.
  !> Faces, outward.
  integer, parameter :: face(6, 4) = reshape([ &
    1, 3, 2, 7, 6, 5, &
    1, 2, 4, 5, 10, 8, &
    1, 4, 3, 8, 9, 7, &
    4, 2, 3, 10, 6, 9], [6, 4])

contains

  !> Properties of a tetrahedron.
  pure function tetrahedron_kind(id) result(kind)
    integer, intent(in) :: id  !! `element_tet4` or `element_tet10`.
    type(element_kind_t) :: kind
    kind%dimension = 3
    kind%n_nodes = kind_nodes(id)
    kind%n_corners = 4
    kind%corner_kind = element_tet4
    kind%n_faces = 4
    kind%vtk_order(:4) = [1, 2, 3, 4]
    select case (id)
    case (element_tet4)
      kind%name = 'tet4'
      kind%gmsh_type = 4
      kind%vtk_type = 10
      kind%order = 1
      kind%face_kind(:4) = element_tri3
      kind%face_node(:3, :4) = face(:3, :)
    case (element_tet10)
      kind%name = 'tet10'
      kind%gmsh_type = 11
      kind%vtk_type = 24
      kind%order = 2
      kind%face_kind(:4) = element_tri6
      kind%face_node(:6, :4) = face
      kind%vtk_order(5:10) = [5, 6, 7, 8, 10, 9]
    end select
  end function tetrahedron_kind
end module dotyk_mesh_tetrahedron
