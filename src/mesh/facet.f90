!> Geometry of a facet, a face of an element seen in space: lines in two dimensions, triangles and quadrilaterals in
!> three.
!>
!> Facets are oriented as the face tables of the element kinds are: the normal points out of the body.
module dotyk_mesh_facet
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: kind_dimension, kind_nodes, max_facet_nodes, shape_functions, shape_gradients
  implicit none
  private
  public :: facet_geometry, facet_frame, frame_of_normal, facet_tangents, cross

  !> A projection of the x axis on the surface shorter than this counts as vanishing.
  real(dp), parameter :: least_projection = 1.0e-6_dp

contains

  !> Position, unit outward normal and area per reference area at a point of a facet.
  pure subroutine facet_geometry(kind, dimension, x, xi, position, normal, jacobian)
    !> Kind of the facet: its dimension is one less than that of space.
    integer, intent(in) :: kind
    !> Dimension of space.
    integer, intent(in) :: dimension
    !> Coordinates of the facet's nodes [length].
    real(dp), intent(in) :: x(dimension, kind_nodes(kind))
    !> Reference coordinates.
    real(dp), intent(in) :: xi(kind_dimension(kind))
    !> Position [length].
    real(dp), intent(out) :: position(dimension)
    !> Unit outward normal; zero where the facet is degenerate.
    real(dp), intent(out) :: normal(dimension)
    !> Area (length in two dimensions) per reference area.
    real(dp), intent(out) :: jacobian
    real(dp) :: a(3), b(3), n(3)
    call tangents(kind, dimension, x, xi, position, a, b)
    n = cross(a, b)
    jacobian = norm2(n)
    normal = n(:dimension)
    if (jacobian > 0) normal = normal/jacobian
  end subroutine facet_geometry

  !> Position and derivatives of the position with respect to the reference coordinates.
  pure subroutine facet_tangents(kind, dimension, x, xi, position, tangent)
    !> Kind of the facet.
    integer, intent(in) :: kind
    !> Dimension of space.
    integer, intent(in) :: dimension
    !> Coordinates of the facet's nodes [length].
    real(dp), intent(in) :: x(dimension, kind_nodes(kind))
    !> Reference coordinates.
    real(dp), intent(in) :: xi(kind_dimension(kind))
    !> Position [length].
    real(dp), intent(out) :: position(dimension)
    !> Column k is the derivative with respect to xi(k) [length].
    real(dp), intent(out) :: tangent(dimension, kind_dimension(kind))
    real(dp) :: a(3), b(3)
    call tangents(kind, dimension, x, xi, position, a, b)
    tangent(:, 1) = a(:dimension)
    if (dimension == 3) tangent(:, 2) = b(:dimension)
  end subroutine facet_tangents

  !> Position and tangents in three components: in two dimensions the second tangent is the z axis, so that a x b is the
  !> normal in both.
  pure subroutine tangents(kind, dimension, x, xi, position, a, b)
    !> As in `facet_geometry`.
    integer, intent(in) :: kind, dimension
    real(dp), intent(in) :: x(dimension, kind_nodes(kind)), xi(kind_dimension(kind))
    real(dp), intent(out) :: position(dimension)
    !> Derivatives with respect to xi(1) and xi(2) [length].
    real(dp), intent(out) :: a(3), b(3)
    real(dp) :: value(max_facet_nodes), slope(2*max_facet_nodes)
    integer :: i
    call shape_functions(kind, xi, value)
    call shape_gradients(kind, xi, slope)
    position = 0
    a = 0
    b = 0
    if (dimension == 2) then
      do i = 1, kind_nodes(kind)
        position = position + value(i)*x(:, i)
        a(:2) = a(:2) + slope(i)*x(:, i)
      end do
      b(3) = 1
    else
      do i = 1, kind_nodes(kind)
        position = position + value(i)*x(:, i)
        a = a + slope(2*i - 1)*x(:3, i)
        b = b + slope(2*i)*x(:3, i)
      end do
    end if
  end subroutine tangents

  !> Local axes of the surface at a point of a facet; see `frame_of_normal`.
  pure subroutine facet_frame(kind, dimension, x, xi, frame)
    !> Kind of the facet.
    integer, intent(in) :: kind
    !> Dimension of space.
    integer, intent(in) :: dimension
    !> Coordinates of the facet's nodes [length].
    real(dp), intent(in) :: x(dimension, kind_nodes(kind))
    !> Reference coordinates.
    real(dp), intent(in) :: xi(kind_dimension(kind))
    !> Columns are the axes.
    real(dp), intent(out) :: frame(dimension, dimension)
    real(dp) :: position(3), normal(3), jacobian
    call facet_geometry(kind, dimension, x, xi, position, normal, jacobian)
    call frame_of_normal(dimension, normal, frame)
  end subroutine facet_frame

  !> Local axes of a surface with a given outward normal n.
  !>
  !> xi is the global x axis projected on the surface, the y axis where that vanishes; in three dimensions eta = n x xi, so that
  !> (xi, eta, n) is right-handed. In two dimensions (xi, n) is right-handed on upper sides only.
  pure subroutine frame_of_normal(dimension, normal, frame)
    !> Dimension of space.
    integer, intent(in) :: dimension
    !> Unit outward normal.
    real(dp), intent(in) :: normal(dimension)
    !> Columns are the axes: xi, eta, n in three dimensions; xi, n in two.
    real(dp), intent(out) :: frame(dimension, dimension)
    real(dp) :: axis(dimension)
    frame(:, dimension) = normal
    axis = -normal(1)*normal
    axis(1) = axis(1) + 1
    if (norm2(axis) < least_projection) then
      axis = -normal(2)*normal
      axis(2) = axis(2) + 1
    end if
    frame(:, 1) = axis/norm2(axis)
    if (dimension == 3) frame(:, 2) = cross(normal, frame(:, 1))
  end subroutine frame_of_normal

  !> Vector product.
  pure function cross(a, b) result(c)
    real(dp), intent(in) :: a(3), b(3)
    real(dp) :: c(3)
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross
end module dotyk_mesh_facet
