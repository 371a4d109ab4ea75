!> Narrow phase of the contact search: master facets are projected on a slave facet and clipped; the overlap polygons
!> (in two dimensions: intervals) are the mortar segments.
module dotyk_contact_clipping
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: few_roundings, given_rounding
  use dotyk_contact_auxiliary_plane, only: auxiliary_plane_t
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_polygon, only: append_corner, clip_polygon, max_corners, polygon_t, signed_area, &
    remove_degenerate_corners
  use dotyk_contact_projection, only: master_surface_t
  use dotyk_contact_tree_search, only: facets_in_region, facing_box_t, nearest_facet
  use dotyk_mesh_element, only: kind_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: segments_of_facet, segments_of_line

  type, public :: mortar_segment_t  !! Mortar segment: overlap of a master facet with a slave facet.
    integer :: facet = 0  !! Master facet.
    type(polygon_t) :: polygon  !! Overlap polygon in clip coordinates.
    real(dp) :: area = 0  !! Area of the polygon [as the square of the clip coordinates].
  end type mortar_segment_t

  !> Projected edges whose middle is off by less than this fraction of their length are taken as straight.
  real(dp), parameter :: straightness = 3.0e-3_dp
  !> Master facets are searched within this distance of the nearest one along the normal, in sizes of the slave facet:
  !> surfaces in contact are inclined by less than 60 degrees.
  real(dp), parameter :: search_depth = 2
  !> The search box is wider than the nodes by this fraction of its size: edges of curved facets may bulge beyond nodes.
  real(dp), parameter :: bulge = 0.1_dp
  !> Inverse maps are reliable within this distance of a curved slave facet, in sizes of the facet.
  real(dp), parameter :: reliable_distance = 0.2_dp
  !> A line folds back along its mean normal unless its linear coefficient is larger than twice the quadratic one, with
  !> a margin for round-off.
  real(dp), parameter :: no_fold = 2.001_dp

  integer, parameter :: half_edge = -1  !! Marks half of an edge with a mid-side node.

contains

  !> Mortar segments of a slave facet in three dimensions.
  subroutine segments_of_facet(set, f, plane, x, surface, master, n, segment, ok)
    type(facet_set_t), intent(in) :: set  !! Facets of the slave surface.
    integer, intent(in) :: f  !! Slave facet.
    type(auxiliary_plane_t), intent(in) :: plane  !! Its auxiliary plane.
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the master body (3, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Master surface.
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    integer, intent(out) :: n  !! Number of mortar segments.
    !> Mortar segments; the first n are set (number of opposite facets).
    type(mortar_segment_t), allocatable, intent(out) :: segment(:)
    logical, intent(out) :: ok  !! All opposite facets could be projected.
    integer, allocatable :: list(:)
    type(polygon_t) :: polygon
    real(dp) :: low(3), high(3), area
    integer :: i, k
    n = 0
    ok = .true.
    low = plane%low
    high = plane%high
    call opposite_facets(master, plane%origin, plane%axes, set%depth(f), low, high, list)
    allocate (segment(size(list)))
    do i = 1, size(list)
      k = surface%kind(list(i))
      call project_facet(set%coefficient(:, :, f), plane, master%set%corners(list(i)), &
                         x(:, surface%node(1:kind_nodes(k), list(i))), polygon, ok)
      if (.not. ok) return
      if (polygon%n < 3) cycle
      area = signed_area(polygon)
      if (area <= 0) cycle   ! seen from behind
      call clip_polygon(polygon, plane%clip_window, few_roundings*sqrt(plane%area), ok)
      if (.not. ok) return
      call remove_degenerate_corners(polygon, given_rounding*sqrt(plane%area))
      area = signed_area(polygon)
      if (area <= few_roundings*plane%area) cycle
      n = n + 1
      segment(n)%facet = list(i)
      segment(n)%polygon = polygon
      segment(n)%area = area
    end do
  end subroutine segments_of_facet

  !> Master facets above a box that lie near the one nearest to its centre, by the bounding-volume tree.
  subroutine opposite_facets(master, origin, axes, max_depth, low, high, list)
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    real(dp), intent(in) :: origin(3)  !! Origin of the box (3) [length].
    real(dp), intent(in) :: axes(3, 3)  !! Axes of the box, the third the outward normal of the slave facet (3, 3) [].
    real(dp), intent(in) :: max_depth  !! Thickness of the slave body [length].
    !> Lower corner of the box along the axes, relative to the origin; on return with the range of the search along the
    !> normal (3) [length].
    real(dp), intent(inout) :: low(3)
    real(dp), intent(inout) :: high(3)  !! Upper corner of the box, likewise (3) [length].
    integer, allocatable, intent(out) :: list(:)  !! Master facets, ascending (n).
    type(facing_box_t) :: box
    real(dp) :: size, centre(3), xi(2), square, z
    real(dp), dimension(3) :: position, normal, xu, xv
    integer :: facet
    size = norm2(high - low)
    centre = origin + matmul(axes, (low + high)/2)
    call nearest_facet(master%tree, master%set, centre, -axes(:, 3), .false., max_depth, 0, facet, xi, square)
    if (facet == 0) then
      allocate (list(0))
      return
    end if
    call facet_position_and_normal(master%set, facet, xi, position, normal, xu, xv)
    z = dot_product(position - origin, axes(:, 3))
    low(3) = z - search_depth*size
    high(3) = z + search_depth*size
    low(1:2) = low(1:2) - bulge*size
    high(1:2) = high(1:2) + bulge*size
    box = facing_box_t(origin, axes, low, high, -axes(:, 3))
    call facets_in_region(master%tree, box, list)
  end subroutine opposite_facets

  !> Project a master facet along the normal of the auxiliary plane; counter-clockwise where it faces the plane, empty
  !> where it lies beside the slave facet.
  !>
  !> The projection of an edge depends on the edge alone, so that its two facets share the same projected line.
  pure subroutine project_facet(coefficient, plane, corners, x, polygon, ok)
    real(dp), intent(in) :: coefficient(3, 9)  !! Polynomial of the slave facet (3, 9) [length].
    type(auxiliary_plane_t), intent(in) :: plane  !! Auxiliary plane of the slave facet.
    integer, intent(in) :: corners  !! Number of corners of the master facet.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the master facet (3, n_nodes) [length].
    type(polygon_t), intent(out) :: polygon  !! Projected facet in clip coordinates.
    logical, intent(out) :: ok  !! The projection is reliable.
    type(polygon_t) :: projected, unclipped, clip_window
    real(dp) :: low(2), high(2), current(2), next(2), middle(2), between(2)
    integer :: i, k, edge(max_corners)
    ok = .true.
    ! In the plane, corners in reverse order, as the facets face each other: edge k and its first corner.
    do i = 1, corners
      k = corners + 1 - i
      current = plane%to_plane(x(:, mod(k, corners) + 1))
      next = plane%to_plane(x(:, k))
      call append_corner(projected, current)
      edge(projected%n) = k
      if (size(x, 2) < 2*corners) cycle
      middle = plane%to_plane(x(:, corners + k))
      if (.not. is_bent(current, middle, next)) cycle
      edge(projected%n) = half_edge
      call append_corner(projected, middle)
      edge(projected%n) = half_edge
    end do
    if (plane%is_polygon) then
      polygon = projected
      return
    end if
    low = plane%low(1:2) - reliable_distance*plane%size
    high = plane%high(1:2) + reliable_distance*plane%size
    clip_window%n = 4
    clip_window%x(:, 1:4) = reshape([low(1), low(2), high(1), low(2), high(1), high(2), low(1), high(2)], [2, 4])
    unclipped = projected
    call clip_polygon(projected, clip_window, few_roundings*plane%size, ok)
    if (.not. ok .or. projected%n < 3) return
    call plane%to_clip_coordinates(coefficient, projected%x(:, 1), current, ok)
    do i = 1, projected%n
      if (.not. ok) return
      call append_corner(polygon, current)
      associate (first => projected%x(:, i), last => projected%x(:, mod(i, projected%n) + 1))
        call plane%to_clip_coordinates(coefficient, last, next, ok)
        if (.not. ok) return
        k = unclipped_edge(unclipped, edge, first, last)
        if (k == half_edge) then
          current = next
          cycle
        else if (k == 0) then
          middle = (first + last)/2
        else if (size(x, 2) >= 2*corners) then
          middle = plane%to_plane(x(:, corners + k))
        else
          middle = plane%to_plane((x(:, k) + x(:, mod(k, corners) + 1))/2)
        end if
      end associate
      call plane%to_clip_coordinates(coefficient, middle, between, ok)
      if (ok .and. is_bent(current, between, next)) call append_corner(polygon, between)
      current = next
    end do
    ok = ok .and. polygon%n <= max_corners
  end subroutine project_facet

  !> Edge between two consecutive corners if clipping left it whole, `half_edge` for half of one; otherwise 0.
  pure integer function unclipped_edge(polygon, edge, first, last)
    type(polygon_t), intent(in) :: polygon  !! Polygon before clipping.
    integer, intent(in) :: edge(:)  !! Edge that begins at each of its corners, `half_edge` for halves (polygon%n).
    real(dp), intent(in) :: first(2)  !! First corner (2) [length].
    real(dp), intent(in) :: last(2)  !! Second corner (2) [length].
    integer :: i
    unclipped_edge = 0
    do i = 1, polygon%n
      if (any(abs(polygon%x(:, i) - first) > 0)) cycle
      if (.not. any(abs(polygon%x(:, mod(i, polygon%n) + 1) - last) > 0)) unclipped_edge = edge(i)
    end do
  end function unclipped_edge

  !> Whether a projected edge is not straight.
  pure logical function is_bent(first, middle, last)
    real(dp), intent(in) :: first(2)  !! First end (2) [any].
    real(dp), intent(in) :: middle(2)  !! Point between the ends (2) [any].
    real(dp), intent(in) :: last(2)  !! Second end (2) [any].
    real(dp) :: along(2), off(2)
    along = last - first
    off = middle - (first + last)/2
    is_bent = abs(along(1)*off(2) - along(2)*off(1)) > straightness*sum(along**2)
  end function is_bent

  !> Mortar segments of a slave facet in two dimensions.
  subroutine segments_of_line(set, f, master, n, facet, first, last, ok)
    type(facet_set_t), intent(in) :: set  !! Facets of the slave surface.
    integer, intent(in) :: f  !! Slave facet.
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    integer, intent(out) :: n  !! Number of mortar segments.
    !> Master facet of each segment; the first n are set (number of opposite facets).
    integer, allocatable, intent(out) :: facet(:)
    !> Beginning of each segment in the reference domain [-1, 1] (number of opposite facets) [].
    real(dp), allocatable, intent(out) :: first(:)
    real(dp), allocatable, intent(out) :: last(:)  !! End of each segment (number of opposite facets) [].
    logical, intent(out) :: ok  !! The slave facet does not fold back along its mean normal.
    real(dp) :: axes(3, 3), c(0:2), low(3), high(3), ends(2), a, b
    real(dp), dimension(3) :: x, normal, xu, xv
    integer :: i, k
    n = 0
    axes = 0
    axes(:, 3) = set%axis(:, f)
    axes(1:2, 1) = [-axes(2, 3), axes(1, 3)]
    axes(3, 2) = 1
    c = matmul(axes(:, 1), set%coefficient(:, 1:3, f))
    ok = c(1) > no_fold*abs(c(2))
    if (.not. ok) return
    ends = [c(0) - c(1) + c(2), c(0) + c(1) + c(2)]
    a = dot_product(set%coefficient(:, 2, f), axes(:, 3))
    b = dot_product(set%coefficient(:, 1, f), axes(:, 3))
    low = [ends(1), 0.0_dp, b - abs(a)]
    high = [ends(2), 0.0_dp, b + abs(a)]
    call opposite_facets(master, set%origin(:, f), axes, set%depth(f), low, high, facet)
    allocate (first(size(facet)), last(size(facet)))
    do i = 1, size(facet)
      k = facet(i)
      call facet_position_and_normal(master%set, k, [1.0_dp, 0.0_dp], x, normal, xu, xv)
      a = inverse_line_map(c, ends, dot_product(x - set%origin(:, f), axes(:, 1)))
      call facet_position_and_normal(master%set, k, [-1.0_dp, 0.0_dp], x, normal, xu, xv)
      b = inverse_line_map(c, ends, dot_product(x - set%origin(:, f), axes(:, 1)))
      if (.not. b - a > 2*few_roundings) cycle
      n = n + 1
      facet(n) = k
      first(n) = a
      last(n) = b
    end do
  end subroutine segments_of_line

  !> Reference coordinate of the point of a line that is projected on p; its nearer end outside [].
  pure real(dp) function inverse_line_map(c, ends, p) result(xi)
    real(dp), intent(in) :: c(0:2)  !! Coefficients of the position along the plane (0:2) [length].
    real(dp), intent(in) :: ends(2)  !! Positions of the ends (2) [length].
    real(dp), intent(in) :: p  !! Position along the plane [length].
    real(dp) :: tolerance
    tolerance = few_roundings*(ends(2) - ends(1))
    if (p <= ends(1) + tolerance) then
      xi = -1
    else if (p >= ends(2) - tolerance) then
      xi = 1
    else
      xi = 2*(p - c(0))/(c(1) + sqrt(max(0.0_dp, c(1)**2 + 4*c(2)*(p - c(0)))))
      xi = max(-1.0_dp, min(1.0_dp, xi))
    end if
  end function inverse_line_map
end module dotyk_contact_clipping
