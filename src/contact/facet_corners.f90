!> Corners and edges of facets: reference coordinates and positions. Edge i goes from corner i to the next one.
module dotyk_contact_facet_corners
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: corner_position, corner_coordinates, corner_normal, edge_coordinates

contains

  !> Position of a corner of a facet [length].
  pure function corner_position(set, f, corner) result(x)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: f  !! Facet number.
    integer, intent(in) :: corner  !! Corner number.
    real(dp) :: x(3)  !! Position (3) [length].
    real(dp) :: xi(2)
    xi = corner_coordinates(set%corners(f), corner)
    associate (c => set%coefficient(:, :, f), u => xi(1), v => xi(2))
      x = set%origin(:, f) + c(:, 1) + u*(c(:, 2) + u*c(:, 3)) + &
          v*(c(:, 4) + u*(c(:, 5) + u*c(:, 6)) + v*(c(:, 7) + u*(c(:, 8) + u*c(:, 9))))
    end associate
  end function corner_position

  !> Reference coordinates of a corner (2) [].
  pure function corner_coordinates(corners, corner) result(xi)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    integer, intent(in) :: corner  !! Corner number.
    real(dp) :: xi(2)  !! Coordinates (2) [].
    if (corners == 2) then
      xi = [real(2*corner - 3, dp), 0.0_dp]
    else
      xi = edge_coordinates(corners, corner, 0.0_dp)
    end if
  end function corner_coordinates

  !> Reference coordinates of a point of an edge of a triangle or quadrilateral (2) [].
  pure function edge_coordinates(corners, edge, s) result(xi)
    integer, intent(in) :: corners  !! Number of corners of the facet: 3 triangle, 4 quadrilateral.
    integer, intent(in) :: edge  !! Edge number.
    real(dp), intent(in) :: s  !! Fraction of the edge from its first corner [].
    real(dp) :: xi(2)  !! Coordinates (2) [].
    real(dp), parameter :: triangle(2, 3) = reshape([0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [2, 3])
    real(dp), parameter :: square(2, 4) = &
      reshape([-1.0_dp, -1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp, 1.0_dp, -1.0_dp, 1.0_dp], [2, 4])
    if (corners == 3) then
      xi = (1 - s)*triangle(:, edge) + s*triangle(:, modulo(edge, 3) + 1)
    else
      xi = (1 - s)*square(:, edge) + s*square(:, modulo(edge, 4) + 1)
    end if
  end function edge_coordinates

  !> Unit normal of the plane, or chord, of the corners of a facet (3) []; zero where they are collinear.
  pure function corner_normal(x) result(normal)
    real(dp), intent(in) :: x(:, :)  !! Corners (3, 2 to 4) [length].
    real(dp) :: normal(3)
    select case (size(x, 2))
    case (2)
      normal = [x(2, 2) - x(2, 1), x(1, 1) - x(1, 2), 0.0_dp]
    case (3)
      normal = cross(x(:, 2) - x(:, 1), x(:, 3) - x(:, 1))
    case default
      normal = cross(x(:, 3) - x(:, 1), x(:, 4) - x(:, 2))
    end select
    normal = normal/max(norm2(normal), tiny(1.0_dp))
  end function corner_normal
end module dotyk_contact_facet_corners
