!> Element kinds: named integers, and the tables of their properties, reference coordinates of nodes, and faces.
!>
!> Reference domains: unit simplex, [-1,1]^d, unit triangle x [-1,1], pyramid on [-1,1]^2 (as gmsh). The node order is
!> that of gmsh. Other layers import all of this from `dotyk_mesh_element`.
module dotyk_mesh_element_kind
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: element_kind

  integer, parameter, public :: n_element_kinds = 18  !! Number of element kinds, but for the point.
  integer, parameter, public :: max_element_nodes = 27  !! Greatest number of nodes of an element.
  integer, parameter, public :: max_facet_nodes = 9  !! Greatest number of nodes of a face of an element.
  integer, parameter, public :: max_faces = 6  !! Greatest number of faces of an element.

  integer, parameter, public :: element_point = 0    !< a node
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
  integer, parameter, public :: kind_dimension(0:n_element_kinds) = [0, 1, 1, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3, 3, &
                                                                     3, 3, 3]
  !> Number of nodes of each kind.
  integer, parameter, public :: kind_nodes(0:n_element_kinds) = [1, 2, 3, 3, 6, 4, 8, 9, 4, 10, 8, 20, 27, 6, 15, 18, &
                                                                 5, 13, 14]

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

  ! Properties of each kind, in the order of the numbers above.
  character(*), parameter :: kind_name(0:n_element_kinds) = [character(9) :: 'point', 'line2', 'line3', 'tri3', &
    'tri6', 'quad4', 'quad8', 'quad9', 'tet4', 'tet10', 'hex8', 'hex20', 'hex27', 'prism6', 'prism15', 'prism18', &
    'pyramid5', 'pyramid13', 'pyramid14']  !! Names for messages.
  integer, parameter :: gmsh_type(0:n_element_kinds) = [15, 1, 8, 2, 9, 3, 16, 10, 4, 11, 5, 17, 12, 6, 18, 13, 7, 19, &
                                                        14]
  integer, parameter :: vtk_type(0:n_element_kinds) = [1, 3, 21, 5, 22, 9, 23, 28, 10, 24, 12, 25, 29, 13, 26, 32, 14, &
                                                       27, 27]
  integer, parameter :: corner_kind(0:n_element_kinds) = [ &
    element_point, element_line2, element_line2, element_tri3, element_tri3, element_quad4, element_quad4, &
    element_quad4, element_tet4, element_tet4, element_hex8, element_hex8, element_hex8, element_prism6, &
    element_prism6, element_prism6, element_pyramid5, element_pyramid5, &
    element_pyramid5]  !! The linear kind on the same corners.

  integer, parameter, public :: line_node(1, 3) = reshape([-1, 1, 0], [1, 3])  !! Coordinates of the nodes of lines.

  !> Corners of the edges, in the order of the mid-side nodes.
  integer, parameter, public :: triangle_edge(2, 3) = reshape([1, 2, 2, 3, 3, 1], [2, 3])
  real(dp), parameter, public :: triangle_node(2, 6) = &
    0.5_dp*reshape([0, 0, 2, 0, 0, 2, 1, 0, 1, 1, 0, 1], [2, 6])  !! Coordinates of the nodes.
  integer, parameter :: triangle_face(3, 3) = reshape([1, 2, 4, 2, 3, 5, 3, 1, 6], [3, 3])  !! Counter-clockwise.

  !> Coordinates of the nodes.
  integer, parameter, public :: quadrilateral_node(2, 9) = reshape([ &
    -1, -1, 1, -1, 1, 1, -1, 1, &
    0, -1, 1, 0, 0, 1, -1, 0, 0, 0], [2, 9])
  !> Edges, counter-clockwise.
  integer, parameter :: quadrilateral_face(3, 4) = reshape([1, 2, 5, 2, 3, 6, 3, 4, 7, 4, 1, 8], [3, 4])

  !> Corners of the edges, in the order of the mid-side nodes; in VTK the last two are exchanged.
  integer, parameter, public :: tetrahedron_edge(2, 6) = reshape([1, 2, 2, 3, 3, 1, 4, 1, 4, 3, 4, 2], [2, 6])
  !> Coordinates of the nodes.
  real(dp), parameter, public :: tetrahedron_node(3, 10) = 0.5_dp*reshape([ &
    0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2, &
    1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1, 0, 1], [3, 10])
  !> Faces, outward.
  integer, parameter :: tetrahedron_face(6, 4) = reshape([ &
    1, 3, 2, 7, 6, 5, &
    1, 2, 4, 5, 10, 8, &
    1, 4, 3, 8, 9, 7, &
    4, 2, 3, 10, 6, 9], [6, 4])

  !> Coordinates of the nodes: corners; edges 12 14 15 23 26 34 37 48 56 58 67 78; faces 1432 1265 1584 2376 3487 5678;
  !> centre.
  integer, parameter, public :: hexahedron_node(3, 27) = reshape([ &
    -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1, &
    0, -1, -1, -1, 0, -1, -1, -1, 0, 1, 0, -1, 1, -1, 0, 0, 1, -1, &
    1, 1, 0, -1, 1, 0, 0, -1, 1, -1, 0, 1, 1, 0, 1, 0, 1, 1, &
    0, 0, -1, 0, -1, 0, -1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], [3, 27])
  !> Faces, outward.
  integer, parameter :: hexahedron_face(9, 6) = reshape([ &
    1, 4, 3, 2, 10, 14, 12, 9, 21, &
    1, 2, 6, 5, 9, 13, 17, 11, 22, &
    1, 5, 8, 4, 11, 18, 16, 10, 23, &
    2, 3, 7, 6, 12, 15, 19, 13, 24, &
    3, 4, 8, 7, 14, 16, 20, 15, 25, &
    5, 6, 7, 8, 17, 19, 20, 18, 26], [9, 6])

  !> Triangular faces of prisms, outward.
  integer, parameter :: prism_triangle(6, 2) = reshape([1, 3, 2, 8, 10, 7, 4, 5, 6, 13, 15, 14], [6, 2])
  !> Quadrilateral faces of prisms, outward.
  integer, parameter :: prism_quadrilateral(9, 3) = reshape([ &
    1, 2, 5, 4, 7, 11, 13, 9, 16, &
    1, 4, 6, 3, 9, 14, 12, 8, 17, &
    2, 3, 6, 5, 10, 12, 15, 11, 18], [9, 3])

  !> Triangular faces of pyramids, outward.
  integer, parameter :: pyramid_triangle(6, 4) = reshape([ &
    1, 2, 5, 6, 10, 8, &
    2, 3, 5, 9, 12, 10, &
    3, 4, 5, 11, 13, 12, &
    4, 1, 5, 7, 8, 13], [6, 4])
  integer, parameter :: pyramid_base(9) = [1, 4, 3, 2, 7, 11, 9, 6, 14]  !! Base, outward.

contains

  !> Properties of an element kind.
  pure function element_kind(id) result(kind)
    integer, intent(in) :: id  !! One of `element_point` .. `element_pyramid14`.
    type(element_kind_t) :: kind
    !> Faces of the family with all nodes that any kind of it has: lines have 3, triangles 6, quadrilaterals 9.
    integer :: face(max_facet_nodes, max_faces)
    integer :: f, i, n
    logical :: is_linear
    kind%name = kind_name(id)
    kind%gmsh_type = gmsh_type(id)
    kind%vtk_type = vtk_type(id)
    kind%dimension = kind_dimension(id)
    kind%n_nodes = kind_nodes(id)
    kind%corner_kind = corner_kind(id)
    kind%n_corners = kind_nodes(kind%corner_kind)
    is_linear = id == kind%corner_kind
    kind%order = merge(1, 2, is_linear)
    kind%vtk_order(:kind%n_nodes) = [(i, i=1, kind%n_nodes)]
    face = 0
    select case (kind%corner_kind)
    case (element_tri3)
      face(:3, :3) = triangle_face
    case (element_quad4)
      face(:3, :4) = quadrilateral_face
    case (element_tet4)
      face(:6, :4) = tetrahedron_face
      if (.not. is_linear) kind%vtk_order(9:10) = [10, 9]
    case (element_hex8)
      face = hexahedron_face
      kind%vtk_order = [1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 14, 10, 17, 19, 20, 18, 11, 13, 15, 16, 23, 24, 22, 25, 21, 26, &
                        27]
    case (element_prism6)
      face(:6, :2) = prism_triangle
      face(:, 3:5) = prism_quadrilateral
      ! The wedge of VTK is reversed: the normal of its nodes 1 2 3 points away from 4 5 6. (Its parametric
      ! coordinates say the opposite; its faces, volumes and documentation do not.)
      kind%vtk_order(:18) = [1, 3, 2, 4, 6, 5, 8, 10, 7, 14, 15, 13, 9, 12, 11, 17, 18, 16]
    case (element_pyramid5)
      face(:, 1) = pyramid_base
      face(:6, 2:5) = pyramid_triangle
      ! VTK has no pyramid of 14 nodes: the node at the centre of the base belongs to no cell.
      kind%vtk_order(:14) = [1, 2, 3, 4, 5, 6, 9, 11, 7, 8, 10, 12, 13, 0]
    end select
    kind%vtk_order(kind%n_nodes + 1:) = 0
    kind%n_faces = count(face(1, :) > 0)
    do f = 1, kind%n_faces
      select case (count(face(:, f) > 0))
      case (3)
        kind%face_kind(f) = merge(element_line2, element_line3, is_linear)
      case (6)
        kind%face_kind(f) = merge(element_tri3, element_tri6, is_linear)
      case default
        kind%face_kind(f) = merge(element_quad4, element_quad8, is_linear)
        if (any(id == [element_hex27, element_prism18, element_pyramid14])) kind%face_kind(f) = element_quad9
      end select
      n = kind_nodes(kind%face_kind(f))
      kind%face_node(:n, f) = face(:n, f)
    end do
  end function element_kind
end module dotyk_mesh_element_kind
