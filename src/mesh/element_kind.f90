!> Element kinds: named integers, and the type of the properties of a kind.
!>
!> Other layers import these from `dotyk_mesh_element`; the families (one file each) fill in the properties.
module dotyk_mesh_element_kind
  implicit none
  private

  integer, parameter, public :: n_element_kinds = 18  !! Number of element kinds.
  integer, parameter, public :: max_element_nodes = 27  !! Greatest number of nodes of an element.
  integer, parameter, public :: max_facet_nodes = 9  !! Greatest number of nodes of a face of an element.
  integer, parameter, public :: max_faces = 6  !! Greatest number of faces of an element.

  integer, parameter, public :: element_line2 = 1    !< straight edge
  integer, parameter, public :: element_line3 = 2    !< quadratic edge
  integer, parameter, public :: element_tri3 = 3     !< linear triangle
  integer, parameter, public :: element_tri6 = 4     !< quadratic triangle
  integer, parameter, public :: element_quad4 = 5    !< bilinear quadrilateral
  integer, parameter, public :: element_quad8 = 6    !< quadratic quadrilateral, serendipity
  integer, parameter, public :: element_quad9 = 7    !< biquadratic quadrilateral
  integer, parameter, public :: element_tet4 = 8     !< linear tetrahedron
  integer, parameter, public :: element_tet10 = 9    !< quadratic tetrahedron
  integer, parameter, public :: element_hex8 = 10    !< trilinear hexahedron
  integer, parameter, public :: element_hex20 = 11   !< quadratic hexahedron, serendipity
  integer, parameter, public :: element_hex27 = 12   !< triquadratic hexahedron
  integer, parameter, public :: element_prism6 = 13  !< linear prism
  integer, parameter, public :: element_prism15 = 14 !< quadratic prism, serendipity
  integer, parameter, public :: element_prism18 = 15 !< biquadratic prism
  integer, parameter, public :: element_pyramid5 = 16  !< linear pyramid
  integer, parameter, public :: element_pyramid13 = 17 !< quadratic pyramid, serendipity base
  integer, parameter, public :: element_pyramid14 = 18 !< quadratic pyramid, biquadratic base

  !> Dimension of the reference domain of each kind; a constant, so that dummies can be declared with it.
  integer, parameter, public :: kind_dimension(n_element_kinds) = [1, 1, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 3]
  !> Number of nodes of each kind.
  integer, parameter, public :: kind_nodes(n_element_kinds) = [2, 3, 3, 6, 4, 8, 9, 4, 10, 8, 20, 27, 6, 15, 18, 5, &
                                                               13, 14]

  type, public :: element_kind_t  !! One element kind. The node order is that of gmsh: corners, edges, faces, interior.
    character(9) :: name = ''  !! Name for messages, as 'tet10'.
    integer :: gmsh_type = 0  !! Type number of gmsh.
    integer :: vtk_type = 0  !! Cell type of VTK.
    integer :: dimension = 0  !! Dimension of the reference domain.
    integer :: order = 0  !! Polynomial order, 1 or 2.
    integer :: n_nodes = 0  !! Number of nodes.
    integer :: n_corners = 0  !! Number of corners: nodes 1..n_corners.
    integer :: corner_kind = 0  !! The linear kind on the same corners.
    integer :: n_faces = 0  !! Number of faces (edges in two dimensions, none for lines).
    integer :: face_kind(max_faces) = 0  !! Kind of each face, 0 beyond n_faces (max_faces).
    !> Local node numbers of each face in the node order of its kind, padded with 0. Faces are oriented outward: the
    !> right-hand normal points out; in two dimensions edges run counter-clockwise, so that the outward normal of
    !> the tangent t is (t_y, -t_x).
    integer :: face_node(max_facet_nodes, max_faces) = 0
    !> Node i of the VTK cell is node vtk_order(i); padded with 0. The cell of pyramid14 lacks one node.
    integer :: vtk_order(max_element_nodes) = 0
  end type element_kind_t
end module dotyk_mesh_element_kind
