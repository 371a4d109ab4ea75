!> Facets as straight parts: lines and triangles between their nodes.
module dotyk_contact_facet_parts
  implicit none
  private

  !> Greatest number of parts of a facet.
  integer, parameter, public :: max_parts = 6

  public :: facet_parts

  !> Parts by local nodes, of facets of second order.
  integer, parameter :: lines(2, 2) = reshape([1, 3, 3, 2], [2, 2])
  integer, parameter :: triangles(3, 4) = reshape([1, 4, 6, 4, 2, 5, 6, 5, 3, 4, 5, 6], [3, 4])
  integer, parameter :: sixths(3, 6) = reshape([1, 5, 8, 5, 2, 6, 6, 3, 7, 7, 4, 8, 5, 6, 7, 5, 7, 8], [3, 6])
  !> Parts of a bilinear quadrilateral.
  integer, parameter :: halves(3, 2) = reshape([1, 2, 3, 1, 3, 4], [3, 2])

contains

  !> Nodes of the parts of a facet, oriented as the facet.
  pure subroutine facet_parts(node, corners, n, part)
    !> Nodes of the facet; those after its own are 0 (max_facet_nodes).
    integer, intent(in) :: node(:)
    !> Number of its corners.
    integer, intent(in) :: corners
    !> Number of parts.
    integer, intent(out) :: n
    !> Nodes of each part; the third is 0 for lines (3, max_parts).
    integer, intent(out) :: part(3, max_parts)
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
end module dotyk_contact_facet_parts
