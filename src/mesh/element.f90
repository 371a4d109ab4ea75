!> Element kinds with their shape functions: the dispatch to the families.
module dotyk_mesh_element
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element_kind, only: element_hex20, element_hex27, element_hex8, element_kind, element_kind_t, &
    element_line2, element_line3, element_point, element_prism15, element_prism18, element_prism6, element_pyramid13, &
    element_pyramid14, element_pyramid5, element_quad4, element_quad8, element_quad9, element_tet10, element_tet4, &
    element_tri3, element_tri6, hexahedron_node, kind_dimension, kind_nodes, line_node, max_element_nodes, &
    max_facet_nodes, n_element_kinds, quadrilateral_node, tetrahedron_edge, tetrahedron_node, triangle_edge, &
    triangle_node
  use dotyk_mesh_quadrature, only: quadrature_rule
  use dotyk_mesh_shape_functions, only: lagrange_gradients, lagrange_values, prism_gradients, prism_node, &
    prism_values, pyramid_gradients, pyramid_node, pyramid_values, serendipity_gradients, serendipity_values, &
    simplex_gradients, simplex_values
  implicit none
  private

  public :: element_kind_t, n_element_kinds, max_element_nodes, max_facet_nodes, kind_dimension, kind_nodes
  public :: element_point, element_line2, element_line3, element_tri3, element_tri6, element_quad4, element_quad8
  public :: element_quad9
  public :: element_tet4, element_tet10, element_hex8, element_hex20, element_hex27
  public :: element_prism6, element_prism15, element_prism18, element_pyramid5, element_pyramid13, element_pyramid14
  public :: element_kind, kind_of_gmsh_type, shape_functions, shape_gradients, reference_nodes, quadrature_rule

contains

  !> Element kind of an element type of gmsh; 0 if the type is not supported, or a point.
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
    integer :: n
    n = kind_nodes(kind)
    select case (kind)
    case (element_point)
      values = 1
    case (element_line2, element_line3)
      call lagrange_values(n - 1, 1, n, line_node, xi, values)
    case (element_quad4, element_quad9)
      call lagrange_values(merge(1, 2, n == 4), 2, n, quadrilateral_node, xi, values)
    case (element_hex8, element_hex27)
      call lagrange_values(merge(1, 2, n == 8), 3, n, hexahedron_node, xi, values)
    case (element_quad8)
      call serendipity_values(2, n, quadrilateral_node, xi, values)
    case (element_hex20)
      call serendipity_values(3, n, hexahedron_node, xi, values)
    case (element_tri3, element_tri6)
      call simplex_values(2, n - 3, triangle_edge, xi, values)
    case (element_tet4, element_tet10)
      call simplex_values(3, n - 4, tetrahedron_edge, xi, values)
    case (element_prism6, element_prism15, element_prism18)
      call prism_values(n, xi, values)
    case (element_pyramid5, element_pyramid13, element_pyramid14)
      call pyramid_values(n, xi, values)
    end select
  end subroutine shape_functions

  !> Gradients of the shape functions at a point of the reference domain.
  pure subroutine shape_gradients(kind, xi, gradients)
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: xi(kind_dimension(kind))  !! Reference coordinates (kind_dimension(kind)) [].
    !> Derivatives with respect to xi (dimension, n_nodes) [].
    real(dp), intent(out) :: gradients(kind_dimension(kind), kind_nodes(kind))
    integer :: n
    n = kind_nodes(kind)
    select case (kind)
    case (element_line2, element_line3)
      call lagrange_gradients(n - 1, 1, n, line_node, xi, gradients)
    case (element_quad4, element_quad9)
      call lagrange_gradients(merge(1, 2, n == 4), 2, n, quadrilateral_node, xi, gradients)
    case (element_hex8, element_hex27)
      call lagrange_gradients(merge(1, 2, n == 8), 3, n, hexahedron_node, xi, gradients)
    case (element_quad8)
      call serendipity_gradients(2, n, quadrilateral_node, xi, gradients)
    case (element_hex20)
      call serendipity_gradients(3, n, hexahedron_node, xi, gradients)
    case (element_tri3, element_tri6)
      call simplex_gradients(2, n - 3, triangle_edge, xi, gradients)
    case (element_tet4, element_tet10)
      call simplex_gradients(3, n - 4, tetrahedron_edge, xi, gradients)
    case (element_prism6, element_prism15, element_prism18)
      call prism_gradients(n, xi, gradients)
    case (element_pyramid5, element_pyramid13, element_pyramid14)
      call pyramid_gradients(n, xi, gradients)
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
end module dotyk_mesh_element
