!> Facets as straight parts: lines and triangles between their nodes.
module dotyk_contact_facet_parts
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_facet, only: cross
  implicit none
  private

  integer, parameter, public :: max_parts = 6  !! Greatest number of parts of a facet.

  public :: facet_parts, part_corners, place_at_part

  integer, parameter :: lines(2, 2) = reshape([1, 3, 3, 2], [2, 2])  !! Parts by local nodes, of facets of second order.
  integer, parameter :: triangles(3, 4) = reshape([1, 4, 6, 4, 2, 5, 6, 5, 3, 4, 5, 6], [3, 4])
  integer, parameter :: sixths(3, 6) = reshape([1, 5, 8, 5, 2, 6, 6, 3, 7, 7, 4, 8, 5, 6, 7, 5, 7, 8], [3, 6])
  integer, parameter :: halves(3, 2) = reshape([1, 2, 3, 1, 3, 4], [3, 2])  !! Parts of a bilinear quadrilateral.

contains

  !> Nodes of the parts of a facet, oriented as the facet.
  pure subroutine facet_parts(node, corners, n, part)
    integer, intent(in) :: node(:)  !! Nodes of the facet; those after its own are 0 (max_facet_nodes).
    integer, intent(in) :: corners  !! Number of its corners.
    integer, intent(out) :: n  !! Number of parts.
    integer, intent(out) :: part(3, max_parts)  !! Nodes of each part; the third is 0 for lines (3, max_parts).
    part = 0
    select case (corners)
    case (2)
      n = merge(1, 2, node(3) == 0)
      if (n == 1) part(1:2, 1) = node(1:2)
      if (n == 2) part(1:2, 1:2) = reshape(node([lines]), [2, 2])
    case (3)
      n = merge(1, 4, node(4) == 0)
      if (n == 1) part(:, 1) = node(1:3)
      if (n == 4) part(:, 1:4) = reshape(node([triangles]), [3, 4])
    case default
      n = merge(2, 6, node(5) == 0)
      if (n == 2) part(:, 1:2) = reshape(node([halves]), [3, 2])
      if (n == 6) part(:, 1:6) = reshape(node([sixths]), [3, 6])
    end select
  end subroutine facet_parts

  !> Corners of a part; those of a line are followed by a point above the first one (3, 3) [length].
  pure function part_corners(x, node) result(corner)
    real(dp), intent(in) :: x(:, :)  !! Positions of the nodes (3, n_nodes) [length].
    integer, intent(in) :: node(3)  !! Nodes of the part; the third is 0 for lines.
    real(dp) :: corner(3, 3)
    corner(:, 1:2) = x(:, node(1:2))
    if (node(3) > 0) then
      corner(:, 3) = x(:, node(3))
    else
      ! The normal of a line (dx, dy) is (dy, -dx).
      corner(:, 3) = corner(:, 1) + [0.0_dp, 0.0_dp, norm2(corner(:, 2) - corner(:, 1))]
    end if
  end function part_corners

  !> Place of a point beside a part.
  pure subroutine place_at_part(corner, x, distance, inside)
    real(dp), intent(in) :: corner(3, 3)  !! Corners of the part (3, 3) [length].
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    !> Distance from its plane, negative behind it; 0 for parts without extent [length].
    real(dp), intent(out) :: distance
    !> Least of the barycentric coordinates of its projection, negative beside the part [].
    real(dp), intent(out) :: inside
    real(dp) :: e1(3), e2(3), r(3), normal(3), area, u, v
    e1 = corner(:, 2) - corner(:, 1)
    e2 = corner(:, 3) - corner(:, 1)
    r = x - corner(:, 1)
    normal = cross(e1, e2)
    area = norm2(normal)
    distance = 0
    inside = -1
    if (.not. area > 0) return
    distance = dot_product(normal, r)/area
    u = dot_product(cross(r, e2), normal)/area**2
    v = dot_product(cross(e1, r), normal)/area**2
    inside = min(u, v, 1 - u - v)
  end subroutine place_at_part
end module dotyk_contact_facet_parts
