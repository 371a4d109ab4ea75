!> Convex hulls of facets: lower bounds of their distances to points, at a fraction of the costs of closest points.
!>
!> The hull is a prism: a layer along a normal and half planes along the edges of the corners. It contains the Bernstein
!> control points of the facet and with them the facet.
module dotyk_contact_facet_hull
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_polynomial, only: control_points, max_controls
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  type, public :: facet_hull_t  !! Hull of one facet, relative to the origin of its polynomial.
    integer :: n_sides = 0  !! Number of sides of the prism.
    real(dp) :: normal(3) = 0  !! Unit normal of the layer (3) [].
    real(dp) :: low = 0, high = 0  !! Bounds of the layer [length].
    real(dp) :: side(3, 4) = 0  !! Unit outward normals of the sides, in the plane of the layer (3, 4) [].
    real(dp) :: limit(4) = 0  !! Distances of the sides from the origin (4) [length].
  contains
    procedure :: init => hull_init
    procedure :: is_beyond => hull_is_beyond
  end type facet_hull_t

  !> Margin for round-off of the control points, relative to the size of the facet.
  real(dp), parameter :: margin = 1.0e-12_dp
  real(dp), parameter :: square_margin = 1.0e-9_dp  !! Margin for round-off of squared distances, relative to them.

contains

  !> Set up from the polynomial of a facet.
  subroutine hull_init(self, corners, c, normal, size)
    class(facet_hull_t), intent(out) :: self
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: c(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    real(dp), intent(in) :: normal(3)  !! Unit vector, about normal to the facet (3) [].
    real(dp), intent(in) :: size  !! Size of the facet [length].
    real(dp) :: control(3, max_controls), corner(3, 4), along(3)
    integer :: k, n
    call control_points(corners, c, n, control)
    self%normal = normal
    self%low = minval(matmul(normal, control(:, :n))) - margin*size
    self%high = maxval(matmul(normal, control(:, :n))) + margin*size
    self%n_sides = corners
    select case (corners)
    case (2)
      self%side(:, 1) = [normal(2), -normal(1), 0.0_dp]
      self%side(:, 2) = -self%side(:, 1)
    case (3)
      corner(:, 1:3) = control(:, 1:3)
    case default
      ! Control points are numbered row by row.
      corner(:, 1:4) = control(:, [1, 3, 9, 7])
    end select
    if (corners > 2) then
      do k = 1, corners
        along = cross(corner(:, mod(k, corners) + 1) - corner(:, k), normal)
        if (norm2(along) > 0) self%side(:, k) = along/norm2(along)
      end do
    end if
    do k = 1, corners
      self%limit(k) = maxval(matmul(self%side(:, k), control(:, :n))) + margin*size
    end do
  end subroutine hull_init

  !> Whether no point of the facet is as near to a point as a distance.
  pure logical function hull_is_beyond(self, x, square) result(beyond)
    class(facet_hull_t), intent(in) :: self
    real(dp), intent(in) :: x(3)  !! The point, relative to the origin of the facet (3) [length].
    real(dp), intent(in) :: square  !! Square of the distance [length^2].
    real(dp) :: above, beside
    integer :: k
    above = dot_product(self%normal, x)
    above = max(above - self%high, self%low - above, 0.0_dp)
    beside = 0
    do k = 1, self%n_sides
      beside = max(beside, dot_product(self%side(:, k), x) - self%limit(k))
    end do
    beyond = (1 - square_margin)*(above**2 + beside**2) > square
  end function hull_is_beyond
end module dotyk_contact_facet_hull
