!> Geometry of facets, the faces of elements in space: lines in two dimensions, triangles and quadrilaterals in three.
!>
!> Facets are oriented as in the face tables of the element kinds: the normal points out of the body.
module dotyk_mesh_facet
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: same_place
  use dotyk_mesh_element, only: kind_dimension, kind_nodes, max_facet_nodes, shape_functions, shape_gradients
  implicit none
  private
  public :: area_vector, facet_geometry, frame_of_normal, cross

contains

  !> Position, unit outward normal and area per reference area at a point of a facet. Edges in space and nodes have no
  !> normal, and their length or number for area.
  pure subroutine facet_geometry(kind, dimension, x, xi, position, normal, jacobian)
    integer, intent(in) :: kind  !! Element kind of the facet, whose dimension is less than that of space.
    integer, intent(in) :: dimension  !! Dimension of space.
    real(dp), intent(in) :: x(dimension, kind_nodes(kind))  !! Coordinates of the nodes of the facet [length].
    real(dp), intent(in) :: xi(kind_dimension(kind))  !! Reference coordinates (kind_dimension(kind)) [].
    real(dp), intent(out) :: position(dimension)  !! Position (dimension) [length].
    real(dp), intent(out) :: normal(dimension)  !! Unit outward normal; zero where the facet has none [].
    real(dp), intent(out) :: jacobian  !! Area per reference area [length^kind_dimension(kind)].
    real(dp) :: a(3), b(3), n(3)
    call tangents(kind, dimension, x, xi, position, a, b)
    if (kind_dimension(kind) < dimension - 1) then
      normal = 0
      jacobian = merge(norm2(a), 1.0_dp, kind_dimension(kind) > 0)
      return
    end if
    n = cross(a, b)
    jacobian = norm2(n)
    normal = n(:dimension)
    if (jacobian > 0) normal = normal/jacobian
  end subroutine facet_geometry

  !> Position and tangents in three components: in two dimensions the second tangent is the unit vector z, so that a x b
  !> is a normal in both.
  pure subroutine tangents(kind, dimension, x, xi, position, a, b)
    integer, intent(in) :: kind  !! Element kind of the facet.
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: x(dimension, kind_nodes(kind))  !! Coordinates of the nodes of the facet [length].
    real(dp), intent(in) :: xi(kind_dimension(kind))  !! Reference coordinates (kind_dimension(kind)) [].
    real(dp), intent(out) :: position(dimension)  !! Position (dimension) [length].
    real(dp), intent(out) :: a(3)  !! Derivative with respect to xi(1) (3) [length].
    real(dp), intent(out) :: b(3)  !! Derivative with respect to xi(2) (3) [length].
    real(dp) :: value(max_facet_nodes), gradient(2*max_facet_nodes)
    integer :: i
    call shape_functions(kind, xi, value)
    call shape_gradients(kind, xi, gradient)
    position = 0
    a = 0
    b = 0
    if (kind_dimension(kind) < 2) then
      do i = 1, kind_nodes(kind)
        position = position + value(i)*x(:, i)
        if (kind_dimension(kind) > 0) a(:dimension) = a(:dimension) + gradient(i)*x(:, i)
      end do
      b(3) = 1
    else
      do i = 1, kind_nodes(kind)
        position = position + value(i)*x(:, i)
        a = a + gradient(2*i - 1)*x(:3, i)
        b = b + gradient(2*i)*x(:3, i)
      end do
    end if
  end subroutine tangents

  !> Local axes of a surface with a given outward normal n.
  !>
  !> xi is the global x axis projected on the surface, the y axis where that projection vanishes; in three dimensions
  !> eta = n x xi, so that (xi, eta, n) is right-handed. In two dimensions (xi, n) is right-handed on upper sides only.
  pure subroutine frame_of_normal(dimension, normal, frame)
    integer, intent(in) :: dimension  !! Dimension of space.
    real(dp), intent(in) :: normal(dimension)  !! Unit outward normal (dimension) [].
    !> Unit vectors as columns: xi, eta, n in three dimensions; xi, n in two (dimension, dimension) [].
    real(dp), intent(out) :: frame(dimension, dimension)
    real(dp) :: axis(dimension)
    frame(:, dimension) = normal
    axis = -normal(1)*normal
    axis(1) = axis(1) + 1
    if (norm2(axis) < same_place) then
      axis = -normal(2)*normal
      axis(2) = axis(2) + 1
    end if
    frame(:, 1) = axis/norm2(axis)
    if (dimension == 3) frame(:, 2) = cross(normal, frame(:, 1))
  end subroutine frame_of_normal

  !> Area of a polygon times its mean normal; in two dimensions length times normal of a segment [length^2].
  pure function area_vector(x) result(vector)
    real(dp), intent(in) :: x(:, :)  !! Corners, anticlockwise seen from outside (dimension, n) [length].
    real(dp) :: vector(size(x, 1))
    integer :: i
    vector = 0
    if (size(x, 1) == 2) then
      if (size(x, 2) > 1) vector = [x(2, size(x, 2)) - x(2, 1), x(1, 1) - x(1, size(x, 2))]
      return
    end if
    do i = 2, size(x, 2) - 1
      vector = vector + cross(x(:, i) - x(:, 1), x(:, i + 1) - x(:, 1))/2
    end do
  end function area_vector

  !> Vector product.
  pure function cross(a, b) result(c)
    real(dp), intent(in) :: a(3)  !! First vector (3) [any].
    real(dp), intent(in) :: b(3)  !! Second vector (3) [any].
    real(dp) :: c(3)  !! Product (3) [any].
    c = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
  end function cross
end module dotyk_mesh_facet
