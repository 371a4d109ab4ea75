!> The facets of surface_b drawn on a facet of surface_a: polygons, or segments in two dimensions.
module dotyk_contact_clipping
  use dotyk_base_kinds, only: dp
  use dotyk_contact_auxiliary_plane, only: auxiliary_plane_t
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_polygon, only: append_corner, clip_polygon, most_corners, polygon_t, signed_area, tidy_polygon
  use dotyk_contact_projection, only: master_surface_t
  use dotyk_contact_bounding_volume_tree, only: facets_in_box, nearest_facet
  use dotyk_mesh_element, only: kind_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: segments_of_facet, segments_of_line

  !> What one facet of b covers of a facet of a.
  type, public :: mortar_segment_t
    !> Facet of b.
    integer :: facet = 0
    !> In the chart.
    type(polygon_t) :: polygon
    !> Its area there.
    real(dp) :: area = 0
  end type mortar_segment_t

  !> Cells below this part of the facet's area are left out.
  real(dp), parameter :: sliver = 1e-14_dp
  !> Edges that bend by less than this part of their length are drawn straight.
  real(dp), parameter :: bend = 3e-3_dp
  !> Facets of b are looked for this far from the nearest one along the normal, in sizes of the facet of a: surfaces that face
  !> each other lean by less than 60 degrees.
  real(dp), parameter :: depth = 2

  !> Stands for half of an edge.
  integer, parameter :: half = -1

contains

  !> Cells of a facet in three dimensions.
  subroutine segments_of_facet(coefficient, chart, x, surface, target, n, cell, ok)
    !> The facet's polynomial (3, 9).
    real(dp), intent(in) :: coefficient(3, 9)
    !> Its chart.
    type(auxiliary_plane_t), intent(in) :: chart
    !> Coordinates of the nodes of body b (3, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    !> Surface b, as it is and for the search.
    type(surface_t), intent(in) :: surface
    type(master_surface_t), intent(in) :: target
    !> Number of cells.
    integer, intent(out) :: n
    !> (>= n).
    type(mortar_segment_t), allocatable, intent(out) :: cell(:)
    !> All facets could be drawn.
    logical, intent(out) :: ok
    integer, allocatable :: list(:)
    type(polygon_t) :: polygon
    real(dp) :: low(3), high(3), area
    integer :: i, k
    n = 0
    ok = .true.
    low = chart%low
    high = chart%high
    call facets_near(target, chart%origin, chart%axes, low, high, list)
    allocate (cell(size(list)))
    do i = 1, size(list)
      k = surface%kind(list(i))
      call draw_facet(coefficient, chart, target%set%corners(list(i)), x(:, surface%node(1:kind_nodes(k), list(i))), &
                      polygon, ok)
      if (.not. ok) return
      if (polygon%n < 3) cycle
      area = signed_area(polygon)
      if (area <= 0) cycle   ! its back
      call clip_polygon(polygon, chart%window, 1e-14_dp*sqrt(chart%area), ok)
      if (.not. ok) return
      call tidy_polygon(polygon, 1e-13_dp*sqrt(chart%area))
      area = signed_area(polygon)
      if (area <= sliver*chart%area) cycle
      n = n + 1
      cell(n)%facet = list(i)
      cell(n)%polygon = polygon
      cell(n)%area = area
    end do
  end subroutine segments_of_facet

  !> Facets of b above a box, near the one that is nearest to its centre.
  subroutine facets_near(target, origin, axes, low, high, list)
    type(master_surface_t), intent(in) :: target
    !> Origin (3) and axes (3, 3) of the box, the third the outward normal of the facet of a.
    real(dp), intent(in) :: origin(3), axes(3, 3)
    !> The box along the axes, relative to the origin (3); along the normal, where the facets were looked for on return.
    real(dp), intent(inout) :: low(3), high(3)
    !> Facets, ascending.
    integer, allocatable, intent(out) :: list(:)
    real(dp) :: size, centre(3), xi(2), square, z
    real(dp), dimension(3) :: position, normal, xu, xv
    integer :: facet
    size = norm2(high - low)
    centre = origin + matmul(axes, (low + high)/2)
    call nearest_facet(target%tree, target%set, centre, -axes(:, 3), .false., 0, facet, xi, square)
    if (facet == 0) then
      allocate (list(0))
      return
    end if
    call facet_position_and_normal(target%set, facet, xi, position, normal, xu, xv)
    z = dot_product(position - origin, axes(:, 3))
    low(3) = z - depth*size
    high(3) = z + depth*size
    ! Edges of curved facets may bulge beyond their nodes.
    low(1:2) = low(1:2) - 0.1_dp*size
    high(1:2) = high(1:2) + 0.1_dp*size
    call facets_in_box(target%tree, target%set, -axes(:, 3), origin, axes, low, high, list)
  end subroutine facets_near

  !> A facet of b in a chart, counter-clockwise where it faces the chart; empty where it lies beside it.
  !>
  !> What is drawn of an edge depends on the edge alone, so that its two facets have the same line between them.
  pure subroutine draw_facet(coefficient, chart, corners, x, polygon, ok)
    real(dp), intent(in) :: coefficient(3, 9)
    type(auxiliary_plane_t), intent(in) :: chart
    !> Number of corners.
    integer, intent(in) :: corners
    !> Its nodes (3, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    type(polygon_t), intent(out) :: polygon
    logical, intent(out) :: ok
    type(polygon_t) :: plane, all, window
    real(dp) :: low(2), high(2), here(2), next(2), middle(2), between(2)
    integer :: i, k, edge(most_corners)
    ok = .true.
    ! In the plane, backwards, as the facet looks at the chart: edge k and its first corner.
    do i = 1, corners
      k = corners + 1 - i
      here = chart%to_plane(x(:, mod(k, corners) + 1))
      next = chart%to_plane(x(:, k))
      call append_corner(plane, here)
      edge(plane%n) = k
      if (size(x, 2) < 2*corners) cycle
      middle = chart%to_plane(x(:, corners + k))
      if (.not. bends(here, middle, next)) cycle
      edge(plane%n) = half
      call append_corner(plane, middle)
      edge(plane%n) = half
    end do
    if (chart%straight) then
      polygon = plane
      return
    end if
    ! Reference coordinates are to be trusted near the facet only.
    low = chart%low(1:2) - 0.2_dp*chart%size
    high = chart%high(1:2) + 0.2_dp*chart%size
    window%n = 4
    window%x(:, 1:4) = reshape([low(1), low(2), high(1), low(2), high(1), high(2), low(1), high(2)], [2, 4])
    all = plane
    call clip_polygon(plane, window, 1e-14_dp*chart%size, ok)
    if (.not. ok .or. plane%n < 3) return
    call chart%draw(coefficient, plane%x(:, 1), here, ok)
    do i = 1, plane%n
      if (.not. ok) return
      call append_corner(polygon, here)
      associate (first => plane%x(:, i), last => plane%x(:, mod(i, plane%n) + 1))
        call chart%draw(coefficient, last, next, ok)
        if (.not. ok) return
        k = whole_edge(all, edge, first, last)
        if (k == half) then
          here = next
          cycle
        else if (k == 0) then
          middle = (first + last)/2
        else if (size(x, 2) >= 2*corners) then
          middle = chart%to_plane(x(:, corners + k))
        else
          middle = chart%to_plane((x(:, k) + x(:, mod(k, corners) + 1))/2)
        end if
      end associate
      call chart%draw(coefficient, middle, between, ok)
      if (ok .and. bends(here, between, next)) call append_corner(polygon, between)
      here = next
    end do
    ok = ok .and. polygon%n <= most_corners
  end subroutine draw_facet

  !> The edge between two points, or that it is half of one, if it was not clipped; else 0.
  pure integer function whole_edge(polygon, edge, first, last)
    !> Before clipping.
    type(polygon_t), intent(in) :: polygon
    !> Edges that begin at its corners; `half` for halves.
    integer, intent(in) :: edge(:)
    !> (2).
    real(dp), intent(in) :: first(2), last(2)
    integer :: i
    whole_edge = 0
    do i = 1, polygon%n
      if (any(abs(polygon%x(:, i) - first) > 0)) cycle
      if (.not. any(abs(polygon%x(:, mod(i, polygon%n) + 1) - last) > 0)) whole_edge = edge(i)
    end do
  end function whole_edge

  !> An edge is not straight.
  pure logical function bends(first, middle, last)
    !> Its ends and a point between them (2).
    real(dp), intent(in) :: first(2), middle(2), last(2)
    real(dp) :: along(2), off(2)
    along = last - first
    off = middle - (first + last)/2
    bends = abs(along(1)*off(2) - along(2)*off(1)) > bend*sum(along**2)
  end function bends

  !> Cells of a facet in two dimensions.
  subroutine segments_of_line(set, f, target, n, facet, first, last, ok)
    !> Facets of a, and the one to divide.
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: f
    type(master_surface_t), intent(in) :: target
    !> Number of cells, their facets of b, and where they begin and end in the reference domain [-1, 1].
    integer, intent(out) :: n
    integer, allocatable, intent(out) :: facet(:)
    real(dp), allocatable, intent(out) :: first(:), last(:)
    !> The facet does not fold back along its mean normal.
    logical, intent(out) :: ok
    real(dp) :: axes(3, 3), c(0:2), low(3), high(3), ends(2), a, b
    real(dp), dimension(3) :: x, normal, xu, xv
    integer :: i, k
    n = 0
    axes = 0
    axes(:, 3) = set%axis(:, f)
    axes(1:2, 1) = [-axes(2, 3), axes(1, 3)]
    axes(3, 2) = 1
    c = matmul(axes(:, 1), set%coefficient(:, 1:3, f))
    ok = c(1) > 2.001_dp*abs(c(2))
    if (.not. ok) return
    ends = [c(0) - c(1) + c(2), c(0) + c(1) + c(2)]
    a = dot_product(set%coefficient(:, 2, f), axes(:, 3))
    b = dot_product(set%coefficient(:, 1, f), axes(:, 3))
    low = [ends(1), 0.0_dp, b - abs(a)]
    high = [ends(2), 0.0_dp, b + abs(a)]
    call facets_near(target, set%origin(:, f), axes, low, high, facet)
    allocate (first(size(facet)), last(size(facet)))
    do i = 1, size(facet)
      k = facet(i)
      call facet_position_and_normal(target%set, k, [1.0_dp, 0.0_dp], x, normal, xu, xv)
      a = line_point(c, ends, dot_product(x - set%origin(:, f), axes(:, 1)))
      call facet_position_and_normal(target%set, k, [-1.0_dp, 0.0_dp], x, normal, xu, xv)
      b = line_point(c, ends, dot_product(x - set%origin(:, f), axes(:, 1)))
      if (.not. b - a > 2*sliver) cycle
      n = n + 1
      facet(n) = k
      first(n) = a
      last(n) = b
    end do
  end subroutine segments_of_line

  !> The point of a line above p, or its nearer end.
  pure real(dp) function line_point(c, ends, p) result(xi)
    !> Its polynomial along the plane (3) and where it ends [length].
    real(dp), intent(in) :: c(0:2), ends(2), p
    real(dp) :: tolerance
    tolerance = 1e-14_dp*(ends(2) - ends(1))
    if (p <= ends(1) + tolerance) then
      xi = -1
    else if (p >= ends(2) - tolerance) then
      xi = 1
    else
      xi = 2*(p - c(0))/(c(1) + sqrt(max(0.0_dp, c(1)**2 + 4*c(2)*(p - c(0)))))
      xi = max(-1.0_dp, min(1.0_dp, xi))
    end if
  end function line_point
end module dotyk_contact_clipping
