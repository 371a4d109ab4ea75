!> Sub-facets: facets of quadratic elements divided at their mid-side nodes, lines into two, triangles and
!> quadrilaterals into four.
!>
!> The corners of sub-facets are nodes of the surface (in quad8 also its centre). Facets of linear elements are one
!> sub-facet, also after order elevation (`dotyk_mesh_order_elevation`) and where a mesh generator put the mid-side
!> nodes on the chords: such nodes carry no information about the shape.
module dotyk_contact_sub_facets
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_line3, element_quad8, element_quad9, &
    element_tri6, kind_nodes, max_facet_nodes, reference_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: sub_facets_t  !! Sub-facets of a surface.
    integer, allocatable :: first(:)  !! Sub-facets of facet f are first(f) .. first(f+1)-1 (n_facets+1).
    integer, allocatable :: parent(:)  !! Facet of each sub-facet (n).
    !> Offset of the reference coordinates: xi of the facet = base + factor * xi of the sub-facet (2, n) [].
    real(dp), allocatable :: base(:, :)
    real(dp), allocatable :: factor(:)  !! Factor of the reference coordinates (n) [].
    type(surface_t) :: surface  !! The sub-facets as linear facets.
    real(dp), allocatable :: x(:, :)  !! Coordinates of their corners (dimension, n_nodes) [length].
    !> The element geometry restricted to the sub-facets, exactly: facets of the same order, each with nodes of its own.
    type(surface_t) :: element
    !> Nodes of `element`: node j of sub-facet f is element_x(:, max_facet_nodes*(f-1)+j) (dimension, max_facet_nodes*n)
    !> [length].
    real(dp), allocatable :: element_x(:, :)
    logical, allocatable :: flat(:)  !! Sub-facets of quadratic facets all of whose nodes are coplanar (n).
  contains
    procedure :: locate
  end type sub_facets_t

  public :: split_facets

  !> Nodes of the facet that are the corners of its sub-facets; node 9 is the centre of a quadrilateral.
  integer, parameter :: line_corner(2, 2) = reshape([1, 3, 3, 2], [2, 2])
  integer, parameter :: triangle_corner(3, 4) = reshape([1, 4, 6, 4, 2, 5, 6, 5, 3, 5, 6, 4], [3, 4])
  integer, parameter :: quadrilateral_corner(4, 4) = reshape([1, 5, 9, 8, 5, 2, 6, 9, 9, 6, 3, 7, 8, 9, 7, 4], [4, 4])
  !> Offsets of the reference coordinates of the sub-facets.
  real(dp), parameter :: triangle_base(2, 4) = &
    reshape([0.0_dp, 0.0_dp, 0.5_dp, 0.0_dp, 0.0_dp, 0.5_dp, 0.5_dp, 0.5_dp], [2, 4])
  real(dp), parameter :: quadrilateral_base(2, 4) = &
    reshape([-0.5_dp, -0.5_dp, 0.5_dp, -0.5_dp, 0.5_dp, 0.5_dp, -0.5_dp, 0.5_dp], [2, 4])
  !> Nodes are coplanar where their distance from the plane is below this fraction of their distance from the first
  !> node.
  real(dp), parameter :: flat_tolerance = 1.0e-8_dp

contains

  !> Divide the facets of a surface into sub-facets.
  subroutine split_facets(x, surface, on_chords, sub_facets)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    logical, intent(in) :: on_chords(:)  !! Facets whose mid-side nodes carry no information about the shape (n_facets).
    type(sub_facets_t), intent(out) :: sub_facets  !! Sub-facets.
    type(element_kind_t) :: kind
    real(dp) :: shape(max_facet_nodes)
    integer :: f, k, n, n_extra, node(max_facet_nodes), count_of(surface%n_facets), corners
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      count_of(f) = merge(merge(2, 4, kind%n_corners == 2), 1, kind%order == 2 .and. .not. on_chords(f))
    end do
    n = sum(count_of)
    allocate (sub_facets%first(surface%n_facets + 1), sub_facets%parent(n), sub_facets%base(2, n), &
              sub_facets%factor(n), sub_facets%flat(n))
    allocate (sub_facets%x(size(x, 1), size(x, 2) + count(surface%kind == element_quad8)))
    allocate (sub_facets%element_x(size(x, 1), max_facet_nodes*n))
    call allocate_surface(surface%dimension, n, sub_facets%surface)
    call allocate_surface(surface%dimension, n, sub_facets%element)
    sub_facets%x(:, :size(x, 2)) = x
    sub_facets%x(:, size(x, 2) + 1:) = 0
    sub_facets%base = 0
    sub_facets%factor = 1
    sub_facets%flat = .false.
    sub_facets%element_x = 0
    n_extra = size(x, 2)
    sub_facets%first(1) = 1
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      corners = kind%n_corners
      sub_facets%first(f + 1) = sub_facets%first(f) + count_of(f)
      associate (first => sub_facets%first(f), last => sub_facets%first(f + 1) - 1)
        sub_facets%parent(first:last) = f
        sub_facets%surface%kind(first:last) = kind%corner_kind
        node = surface%node(:, f)
        if (count_of(f) == 1) then
          sub_facets%surface%node(1:corners, first) = node(1:corners)
        else
          if (surface%kind(f) == element_quad8) then
            n_extra = n_extra + 1
            call shape_functions(element_quad8, [0.0_dp, 0.0_dp], shape(1:8))
            sub_facets%x(:, n_extra) = matmul(x(:, node(1:8)), shape(1:8))
            node(9) = n_extra
          end if
          sub_facets%factor(first:last) = 0.5_dp
          select case (corners)
          case (2)
            sub_facets%base(1, first:last) = [-0.5_dp, 0.5_dp]
            sub_facets%surface%node(1:2, first:last) = reshape(node(reshape(line_corner, [4])), [2, 2])
          case (3)
            sub_facets%base(:, first:last) = triangle_base
            sub_facets%factor(last) = -0.5_dp
            sub_facets%surface%node(1:3, first:last) = reshape(node(reshape(triangle_corner, [12])), [3, 4])
          case default
            sub_facets%base(:, first:last) = quadrilateral_base
            sub_facets%surface%node(1:4, first:last) = reshape(node(reshape(quadrilateral_corner, [16])), [4, 4])
          end select
          sub_facets%flat(first:last) = is_planar(x(:, node(1:kind%n_nodes)))
        end if
        do k = first, last
          call restrict_element(surface%kind(f), count_of(f), x(:, node(1:kind%n_nodes)), k, sub_facets)
        end do
      end associate
    end do
  end subroutine split_facets

  !> Surface without facets yet.
  subroutine allocate_surface(dimension, n, surface)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    integer, intent(in) :: n  !! Number of facets.
    type(surface_t), intent(out) :: surface  !! Surface.
    surface%dimension = dimension
    surface%n_facets = n
    allocate (surface%kind(n), surface%node(max_facet_nodes, n))
    surface%node = 0
  end subroutine allocate_surface

  !> Restrict the element geometry to one sub-facet.
  subroutine restrict_element(kind, n_sub_facets, x, sub_facet, sub_facets)
    integer, intent(in) :: kind  !! Element kind of the facet.
    integer, intent(in) :: n_sub_facets  !! Number of sub-facets of the facet.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the facet (dimension, n_nodes) [length].
    integer, intent(in) :: sub_facet  !! Sub-facet number.
    type(sub_facets_t), intent(inout) :: sub_facets  !! Sub-facets; `element` is set for this one.
    real(dp) :: xi(2, max_facet_nodes), shape(max_facet_nodes)
    integer :: n, d, i, j
    j = max_facet_nodes*(sub_facet - 1)
    n = size(x, 2)
    sub_facets%element%kind(sub_facet) = kind
    if (n_sub_facets == 1) then
      sub_facets%element_x(:, j + 1:j + n) = x
    else
      d = size(x, 1) - 1
      ! A quad8 restricted to a quarter needs all nine functions.
      if (kind == element_quad8) sub_facets%element%kind(sub_facet) = element_quad9
      n = kind_nodes(sub_facets%element%kind(sub_facet))
      call reference_nodes(sub_facets%element%kind(sub_facet), xi(1:d, 1:n))
      do i = 1, n
        call shape_functions(kind, sub_facets%base(1:d, sub_facet) + sub_facets%factor(sub_facet)*xi(1:d, i), &
                             shape(1:size(x, 2)))
        sub_facets%element_x(:, j + i) = matmul(x, shape(1:size(x, 2)))
      end do
    end if
    sub_facets%element%node(1:n, sub_facet) = [(j + i, i=1, n)]
  end subroutine restrict_element

  !> Whether points are coplanar (in two dimensions: collinear).
  pure logical function is_planar(x)
    real(dp), intent(in) :: x(:, :)  !! Points, corners of the facet first (dimension, n) [length].
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
    is_planar = .true.
    do i = 2, size(x, 2)
      r = 0
      r(1:size(x, 1)) = x(:, i) - x(:, 1)
      is_planar = is_planar .and. abs(dot_product(normal, r)) <= flat_tolerance*norm2(r)
    end do
  end function is_planar

  !> Sub-facet of a point of a facet.
  pure subroutine locate(self, facet, xi, sub_facet, xi_sub_facet)
    class(sub_facets_t), intent(in) :: self
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) []; the second is 0 for lines.
    integer, intent(out) :: sub_facet  !! Sub-facet number.
    real(dp), intent(out) :: xi_sub_facet(2)  !! Reference coordinates on the sub-facet (2) [].
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
    sub_facet = self%first(facet)
    if (self%first(facet + 1) - self%first(facet) > 1) sub_facet = sub_facet + k - 1
    xi_sub_facet = (xi - self%base(:, sub_facet))/self%factor(sub_facet)
  end subroutine locate
end module dotyk_contact_sub_facets
