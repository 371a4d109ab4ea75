!> Element kinds: one table, and the dispatch to the families.
!>
!> Reference domains: unit simplex, [-1,1]^d, unit triangle x [-1,1], pyramid on [-1,1]^2 (as gmsh). The node order is
!> that of gmsh.
module dotyk_mesh_element
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element_kind, only: element_hex20, element_hex27, element_hex8, element_kind_t, element_line2, &
    element_line3, element_prism15, element_prism18, element_prism6, element_pyramid13, element_pyramid14, &
    element_pyramid5, element_quad4, element_quad8, element_quad9, element_tet10, element_tet4, element_tri3, &
    element_tri6, kind_dimension, kind_nodes, max_element_nodes, max_faces, max_facet_nodes, n_element_kinds
  use dotyk_mesh_prism, only: prism_gradients, prism_kind, prism_node, prism_values
  use dotyk_mesh_pyramid, only: pyramid_gradients, pyramid_kind, pyramid_node, pyramid_values
  use dotyk_mesh_quadrature, only: quadrature_rule
  use dotyk_mesh_simplex, only: simplex_gradients, simplex_values
  use dotyk_mesh_tensor_product, only: lagrange_gradients, lagrange_values, serendipity_gradients, serendipity_values
  use dotyk_mesh_triangle, only: triangle_edge, triangle_kind, triangle_node
  implicit none
  private

  public :: element_kind_t, n_element_kinds, max_element_nodes, max_facet_nodes, max_faces, kind_dimension, kind_nodes
  public :: element_line2, element_line3, element_tri3, element_tri6, element_quad4, element_quad8, element_quad9
  public :: element_tet4, element_tet10, element_hex8, element_hex20, element_hex27
  public :: element_prism6, element_prism15, element_prism18, element_pyramid5, element_pyramid13, element_pyramid14
  public :: element_kind, kind_of_gmsh_type, shape_functions, shape_gradients, reference_nodes, quadrature_rule

  !> Coordinates of the nodes: corners; edges 12 14 15 23 26 34 37 48 56 58 67 78; faces 1432 1265 1584 2376 3487 5678;
  !> centre.
  integer, parameter :: hexahedron_node(3, 27) = reshape([ &
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

  !> Corners of the edges, in the order of the mid-side nodes; in VTK the last two are exchanged.
  integer, parameter :: tetrahedron_edge(2, 6) = reshape([1, 2, 2, 3, 3, 1, 4, 1, 4, 3, 4, 2], [2, 6])
  !> Twice the coordinates of the nodes.
  integer, parameter :: twice(3, 10) = reshape([ &
    0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2, &
    1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1, 0, 1], [3, 10])
  real(dp), parameter :: tetrahedron_node(3, 10) = 0.5_dp*twice  !! Coordinates of the nodes.
  !> Faces, outward.
  integer, parameter :: face(6, 4) = reshape([ &
    1, 3, 2, 7, 6, 5, &
    1, 2, 4, 5, 10, 8, &
    1, 4, 3, 8, 9, 7, &
    4, 2, 3, 10, 6, 9], [6, 4])

  !> Coordinates of the nodes.
  integer, parameter :: quadrilateral_node(2, 9) = reshape([ &
    -1, -1, 1, -1, 1, 1, -1, 1, &
    0, -1, 1, 0, 0, 1, -1, 0, 0, 0], [2, 9])
  integer, parameter :: face(3, 4) = reshape([1, 2, 5, 2, 3, 6, 3, 4, 7, 4, 1, 8], [3, 4])  !! Edges, counter-clockwise.

  integer, parameter :: line_node(1, 3) = reshape([-1, 1, 0], [1, 3])  !! Coordinates of the nodes.

contains

  !> Properties of an element kind.
  pure function element_kind(id) result(kind)
    integer, intent(in) :: id  !! One of `element_line2` .. `element_pyramid14`.
    type(element_kind_t) :: kind
    select case (id)
    case (element_line2, element_line3)
      kind = line_kind(id)
    case (element_tri3, element_tri6)
      kind = triangle_kind(id)
    case (element_quad4, element_quad8, element_quad9)
      kind = quadrilateral_kind(id)
    case (element_tet4, element_tet10)
      kind = tetrahedron_kind(id)
    case (element_hex8, element_hex20, element_hex27)
      kind = hexahedron_kind(id)
    case (element_prism6, element_prism15, element_prism18)
      kind = prism_kind(id)
    case (element_pyramid5, element_pyramid13, element_pyramid14)
      kind = pyramid_kind(id)
    end select
  end function element_kind

  !> Element kind of an element type of gmsh; 0 if the type is not supported.
  pure integer function kind_of_gmsh_type(gmsh_type) result(id)
    integer, intent(in) :: gmsh_type  !! Type number of gmsh.
    type(element_kind_t) :: kind
    do id = 1, n_element_kinds
      kind = element_kind(id)
      if (kind%gmsh_type == gmsh_type) return
    end do
    id = 0
  end function kind_of_gmsh_type

  !> Values of the shape functions at a point of the reference domain.
  pure subroutine shape_functions(kind, xi, values)
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: xi(kind_dimension(kind))  !! Reference coordinates (kind_dimension(kind)) [].
    real(dp), intent(out) :: values(kind_nodes(kind))  !! Values of the shape functions (n_nodes) [].
    select case (kind)
    case (element_line2)
      call lagrange_values(1, 1, 2, line_node, xi, values)
    case (element_line3)
      call lagrange_values(2, 1, 3, line_node, xi, values)
    case (element_tri3)
      call simplex_values(2, 0, triangle_edge, xi, values)
    case (element_tri6)
      call simplex_values(2, 3, triangle_edge, xi, values)
    case (element_quad4)
      call lagrange_values(1, 2, 4, quadrilateral_node, xi, values)
    case (element_quad8)
      call serendipity_values(2, 8, quadrilateral_node, xi, values)
    case (element_quad9)
      call lagrange_values(2, 2, 9, quadrilateral_node, xi, values)
    case (element_tet4)
      call simplex_values(3, 0, tetrahedron_edge, xi, values)
    case (element_tet10)
      call simplex_values(3, 6, tetrahedron_edge, xi, values)
    case (element_hex8)
      call lagrange_values(1, 3, 8, hexahedron_node, xi, values)
    case (element_hex20)
      call serendipity_values(3, 20, hexahedron_node, xi, values)
    case (element_hex27)
      call lagrange_values(2, 3, 27, hexahedron_node, xi, values)
    case (element_prism6, element_prism15, element_prism18)
      call prism_values(kind_nodes(kind), xi, values)
    case (element_pyramid5, element_pyramid13, element_pyramid14)
      call pyramid_values(kind_nodes(kind), xi, values)
    end select
  end subroutine shape_functions

  !> Gradients of the shape functions at a point of the reference domain.
  pure subroutine shape_gradients(kind, xi, gradients)
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: xi(kind_dimension(kind))  !! Reference coordinates (kind_dimension(kind)) [].
    !> Derivatives with respect to xi (dimension, n_nodes) [].
    real(dp), intent(out) :: gradients(kind_dimension(kind), kind_nodes(kind))
    select case (kind)
    case (element_line2)
      call lagrange_gradients(1, 1, 2, line_node, xi, gradients)
    case (element_line3)
      call lagrange_gradients(2, 1, 3, line_node, xi, gradients)
    case (element_tri3)
      call simplex_gradients(2, 0, triangle_edge, xi, gradients)
    case (element_tri6)
      call simplex_gradients(2, 3, triangle_edge, xi, gradients)
    case (element_quad4)
      call lagrange_gradients(1, 2, 4, quadrilateral_node, xi, gradients)
    case (element_quad8)
      call serendipity_gradients(2, 8, quadrilateral_node, xi, gradients)
    case (element_quad9)
      call lagrange_gradients(2, 2, 9, quadrilateral_node, xi, gradients)
    case (element_tet4)
      call simplex_gradients(3, 0, tetrahedron_edge, xi, gradients)
    case (element_tet10)
      call simplex_gradients(3, 6, tetrahedron_edge, xi, gradients)
    case (element_hex8)
      call lagrange_gradients(1, 3, 8, hexahedron_node, xi, gradients)
    case (element_hex20)
      call serendipity_gradients(3, 20, hexahedron_node, xi, gradients)
    case (element_hex27)
      call lagrange_gradients(2, 3, 27, hexahedron_node, xi, gradients)
    case (element_prism6, element_prism15, element_prism18)
      call prism_gradients(kind_nodes(kind), xi, gradients)
    case (element_pyramid5, element_pyramid13, element_pyramid14)
      call pyramid_gradients(kind_nodes(kind), xi, gradients)
    end select
  end subroutine shape_gradients

  !> Reference coordinates of the nodes.
  pure subroutine reference_nodes(kind, xi)
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(out) :: xi(kind_dimension(kind), kind_nodes(kind))  !! Coordinates (dimension, n_nodes) [].
    integer :: n, i
    n = kind_nodes(kind)
    select case (kind)
    case (element_line2, element_line3)
      xi = line_node(:, :n)
    case (element_tri3, element_tri6)
      xi = triangle_node(:, :n)
    case (element_quad4, element_quad8, element_quad9)
      xi = quadrilateral_node(:, :n)
    case (element_tet4, element_tet10)
      xi = tetrahedron_node(:, :n)
    case (element_hex8, element_hex20, element_hex27)
      xi = hexahedron_node(:, :n)
    case (element_prism6, element_prism15, element_prism18)
      do i = 1, n
        xi(:, i) = prism_node(i)
      end do
    case (element_pyramid5, element_pyramid13, element_pyramid14)
      do i = 1, n
        xi(:, i) = pyramid_node(i)
      end do
    end select
  end subroutine reference_nodes

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
end module dotyk_mesh_element
