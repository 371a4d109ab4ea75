!> Facets cut through their mid nodes: a line into two pieces, a triangle or quadrilateral into four. The corners of the
!> pieces are nodes of the surface (in the middle of quad8, its point). Facets of linear elements are one piece, also where they were made
!> quadratic (`dotyk_mesh_order_elevation`): their mid nodes tell nothing of the shape.
module dotyk_contact_sub_facets
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_line3, element_quad8, element_quad9, element_tri6, &
    kind_nodes, max_facet_nodes, reference_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> The pieces of a surface.
  type, public :: sub_facets_t
    !> Pieces of facet f are first(f) .. first(f+1)-1 (n_facets+1).
    integer, allocatable :: first(:)
    !> Facet of each piece (n).
    integer, allocatable :: parent(:)
    !> The facet's reference coordinates are base + factor times those of the piece (2, n), (n).
    real(dp), allocatable :: base(:, :), factor(:)
    !> The pieces as linear facets, and their corners (dimension, n_nodes) [length].
    type(surface_t) :: surface
    real(dp), allocatable :: x(:, :)
    !> The elements' geometry on the pieces, exactly: facets of elements of the same order, each with its own nodes; node j
    !> of piece f is element_x(:, max_facet_nodes*(f-1)+j) [length].
    type(surface_t) :: element
    real(dp), allocatable :: element_x(:, :)
    !> Piece of a quadratic facet all of whose nodes lie in a plane (n).
    logical, allocatable :: flat(:)
  contains
    procedure :: locate
  end type sub_facets_t

  public :: split_facets

  !> Nodes of the facet that are corners of its pieces; node 9 is the middle of a quadrilateral.
  integer, parameter :: line_corner(2, 2) = reshape([1, 3, 3, 2], [2, 2])
  integer, parameter :: triangle_corner(3, 4) = reshape([1, 4, 6, 4, 2, 5, 6, 5, 3, 5, 6, 4], [3, 4])
  integer, parameter :: quadrilateral_corner(4, 4) = reshape([1, 5, 9, 8, 5, 2, 6, 9, 9, 6, 3, 7, 8, 9, 7, 4], [4, 4])
  !> Places of the pieces.
  real(dp), parameter :: triangle_base(2, 4) = reshape([0.0_dp, 0.0_dp, 0.5_dp, 0.0_dp, 0.0_dp, 0.5_dp, 0.5_dp, 0.5_dp], [2, 4])
  real(dp), parameter :: quadrilateral_base(2, 4) = &
    reshape([-0.5_dp, -0.5_dp, 0.5_dp, -0.5_dp, 0.5_dp, 0.5_dp, -0.5_dp, 0.5_dp], [2, 4])
  !> Nodes lie in a plane when farther from it by no more than this, relative to the facet's size.
  real(dp), parameter :: flat_tolerance = 1e-8_dp

contains

  !> Cut the facets of a surface.
  subroutine split_facets(x, surface, pieces)
    !> Nodal coordinates of the body (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    type(surface_t), intent(in) :: surface
    type(sub_facets_t), intent(out) :: pieces
    type(element_kind_t) :: kind
    real(dp) :: shape(max_facet_nodes)
    integer :: f, k, n, n_extra, node(max_facet_nodes), count_of(surface%n_facets), corners
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      count_of(f) = merge(merge(2, 4, kind%n_corners == 2), 1, kind%order == 2 .and. .not. surface%order_elevated)
    end do
    n = sum(count_of)
    allocate (pieces%first(surface%n_facets + 1), pieces%parent(n), pieces%base(2, n), pieces%factor(n), pieces%flat(n))
    allocate (pieces%x(size(x, 1), size(x, 2) + count(surface%kind == element_quad8)))
    allocate (pieces%element_x(size(x, 1), max_facet_nodes*n))
    call prepare(surface%dimension, n, pieces%surface)
    call prepare(surface%dimension, n, pieces%element)
    pieces%x(:, :size(x, 2)) = x
    pieces%x(:, size(x, 2) + 1:) = 0
    pieces%base = 0
    pieces%factor = 1
    pieces%flat = .false.
    pieces%element_x = 0
    n_extra = size(x, 2)
    pieces%first(1) = 1
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      corners = kind%n_corners
      pieces%first(f + 1) = pieces%first(f) + count_of(f)
      associate (first => pieces%first(f), last => pieces%first(f + 1) - 1)
        pieces%parent(first:last) = f
        pieces%surface%kind(first:last) = kind%corner_kind
        node = surface%node(:, f)
        if (count_of(f) == 1) then
          pieces%surface%node(1:corners, first) = node(1:corners)
        else
          if (surface%kind(f) == element_quad8) then
            n_extra = n_extra + 1
            call shape_functions(element_quad8, [0.0_dp, 0.0_dp], shape(1:8))
            pieces%x(:, n_extra) = matmul(x(:, node(1:8)), shape(1:8))
            node(9) = n_extra
          end if
          pieces%factor(first:last) = 0.5_dp
          select case (corners)
          case (2)
            pieces%base(1, first:last) = [-0.5_dp, 0.5_dp]
            pieces%surface%node(1:2, first:last) = reshape(node(reshape(line_corner, [4])), [2, 2])
          case (3)
            pieces%base(:, first:last) = triangle_base
            pieces%factor(last) = -0.5_dp
            pieces%surface%node(1:3, first:last) = reshape(node(reshape(triangle_corner, [12])), [3, 4])
          case default
            pieces%base(:, first:last) = quadrilateral_base
            pieces%surface%node(1:4, first:last) = reshape(node(reshape(quadrilateral_corner, [16])), [4, 4])
          end select
          pieces%flat(first:last) = lie_in_a_plane(x(:, node(1:kind%n_nodes)))
        end if
        do k = first, last
          call restrict(surface%kind(f), count_of(f), x(:, node(1:kind%n_nodes)), k, pieces)
        end do
      end associate
    end do
  end subroutine split_facets

  !> An empty surface.
  subroutine prepare(dimension, n, surface)
    !> Dimension of space and number of facets.
    integer, intent(in) :: dimension, n
    type(surface_t), intent(out) :: surface
    surface%dimension = dimension
    surface%n_facets = n
    allocate (surface%kind(n), surface%node(max_facet_nodes, n))
    surface%node = 0
  end subroutine prepare

  !> The element on one of its pieces.
  subroutine restrict(kind, n_pieces, x, piece, pieces)
    !> Kind of the facet, and number of its pieces.
    integer, intent(in) :: kind, n_pieces
    !> Its nodes (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    integer, intent(in) :: piece
    type(sub_facets_t), intent(inout) :: pieces
    real(dp) :: xi(2, max_facet_nodes), shape(max_facet_nodes)
    integer :: n, d, i, j
    j = max_facet_nodes*(piece - 1)
    n = size(x, 2)
    pieces%element%kind(piece) = kind
    if (n_pieces == 1) then
      pieces%element_x(:, j + 1:j + n) = x
    else
      d = size(x, 1) - 1
      ! The element on a quarter of a quad8 has all nine functions.
      if (kind == element_quad8) pieces%element%kind(piece) = element_quad9
      n = kind_nodes(pieces%element%kind(piece))
      call reference_nodes(pieces%element%kind(piece), xi(1:d, 1:n))
      do i = 1, n
        call shape_functions(kind, pieces%base(1:d, piece) + pieces%factor(piece)*xi(1:d, i), shape(1:size(x, 2)))
        pieces%element_x(:, j + i) = matmul(x, shape(1:size(x, 2)))
      end do
    end if
    pieces%element%node(1:n, piece) = [(j + i, i=1, n)]
  end subroutine restrict

  !> Do points lie in a plane (in two dimensions, on a line)?
  pure logical function lie_in_a_plane(x)
    !> Corners first (dimension, n).
    real(dp), intent(in) :: x(:, :)
    real(dp) :: normal(3), a(3), b(3), r(3)
    integer :: i
    if (size(x, 1) == 2) then
      normal = [x(2, 2) - x(2, 1), x(1, 1) - x(1, 2), 0.0_dp]
    else
      a = x(:, 2) - x(:, 1)
      b = x(:, 3) - x(:, 1)
      normal = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
    end if
    normal = normal/max(norm2(normal), tiny(1.0_dp))
    lie_in_a_plane = .true.
    do i = 2, size(x, 2)
      r = 0
      r(1:size(x, 1)) = x(:, i) - x(:, 1)
      lie_in_a_plane = lie_in_a_plane .and. abs(dot_product(normal, r)) <= flat_tolerance*norm2(r)
    end do
  end function lie_in_a_plane

  !> The piece of a point of a facet, and its reference coordinates there.
  pure subroutine locate(self, facet, xi, piece, xi_piece)
    class(sub_facets_t), intent(in) :: self
    integer, intent(in) :: facet
    !> Reference coordinates (2).
    real(dp), intent(in) :: xi(2)
    integer, intent(out) :: piece
    !> (2).
    real(dp), intent(out) :: xi_piece(2)
    integer :: k
    k = 1
    select case (self%element%kind(self%first(facet)))
    case (element_line3)
      if (xi(1) > 0) k = 2
    case (element_tri6)
      k = 4
      if (sum(xi) <= 0.5_dp) k = 1
      if (xi(1) >= 0.5_dp) k = 2
      if (xi(2) >= 0.5_dp) k = 3
    case (element_quad9)
      if (xi(2) > 0) then
        k = merge(3, 4, xi(1) > 0)
      else
        k = merge(2, 1, xi(1) > 0)
      end if
    end select
    piece = self%first(facet)
    if (self%first(facet + 1) - self%first(facet) > 1) piece = piece + k - 1
    xi_piece = (xi - self%base(:, piece))/self%factor(piece)
  end subroutine locate
end module dotyk_contact_sub_facets
