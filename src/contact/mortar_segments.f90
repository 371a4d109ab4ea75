!> Integration points on the cells that the facets of surface_b cut out of the facets of surface_a.
!>
!> The shape functions of b have kinks at the edges of its facets, and a rule for a whole facet of a does not see where
!> they are. Here every facet of a is divided: the facets of b are drawn on it along its mean normal, as polygons in its
!> chart (auxiliary_plane.f90), clipped to it, and each polygon gets a rule of its own. Along one direction the facets of b cover
!> their surface once, so the polygons neither overlap nor leave gaps, whatever the gap and the angle between the surfaces;
!> on flat parallel surfaces the cuts are exact and every integral of products of shape functions is, on curved ones they
!> lie near the kinks. Which point of b a point of a touches is still for the projection to say.
!>
!> Facets of a where this fails - b folds back or lies in several layers, or a point of the plain rule that lies in no
!> polygon has a partner - keep the plain rule. So do those that no facet of b covers, whose points are to be counted.
module dotyk_contact_mortar_segments
  use dotyk_base_kinds, only: dp
  use dotyk_contact_segment_quadrature, only: append_points, quadrature_rule_t, polygon_rule, rule_table_t, shape_degree
  use dotyk_contact_auxiliary_plane, only: is_affine, auxiliary_plane_t, is_plane_polygon, reference_centre, inverse_map
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_clipping, only: mortar_segment_t, segments_of_facet, segments_of_line
  use dotyk_contact_moment_fitting, only: fit_segment_weights
  use dotyk_contact_polygon, only: contains_point
  use dotyk_contact_projection, only: project_point, projection_found, projection_t, master_surface_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: build_segment_rules, segment_degree

  !> Areas that add up to more or less than the facet's by this part of it are more or less than the facet.
  real(dp), parameter :: area_tolerance = 1e-9_dp
  !> Greatest degree that is tried for weights that fit.
  integer, parameter :: most_fit_degree = 12

contains

  !> The rules of all facets of surface_a that are divided or covered by one facet of b; the others have none.
  subroutine build_segment_rules(mesh_a, surface_a, set, near, mesh_b, surface_b, target, radius, by_nodes, &
                                 axisymmetric, plain, rule)
    !> Body a and its surface.
    type(body_mesh_t), intent(in) :: mesh_a
    type(surface_t), intent(in) :: surface_a
    !> Its facets, and those that are looked at (n_facets).
    type(facet_set_t), intent(in) :: set
    logical, intent(in) :: near(:)
    !> Body b and its surface.
    type(body_mesh_t), intent(in) :: mesh_b
    type(surface_t), intent(in) :: surface_b
    !> Surface b for the projection.
    type(master_surface_t), intent(in) :: target
    !> Greatest distance of partners [length].
    real(dp), intent(in) :: radius
    !> The rows are means at the vertices.
    logical, intent(in) :: by_nodes
    !> Weights contain 2 pi r.
    logical, intent(in) :: axisymmetric
    !> Plain rules of the facet kinds (n_element_kinds).
    type(quadrature_rule_t), intent(in) :: plain(:)
    !> (n_facets).
    type(quadrature_rule_t), allocatable, intent(out) :: rule(:)
    type(rule_table_t) :: table
    integer :: f
    allocate (rule(surface_a%n_facets))
    call table%init()
    !$omp parallel do default(none) schedule(dynamic, 16) &
    !$omp shared(surface_a, mesh_a, surface_b, mesh_b, set, near, target, table, radius, by_nodes, axisymmetric, plain, rule)
    do f = 1, surface_a%n_facets
      if (.not. near(f)) cycle
      if (set%dimension == 2) then
        call divide_line(set, f, surface_a%kind(f), surface_b, target, table, radius, by_nodes, axisymmetric, &
                         plain(surface_a%kind(f)), rule(f))
      else
        call divide_facet(set, f, surface_a%kind(f), mesh_a%x(:, surface_a%node(1:kind_nodes(surface_a%kind(f)), f)), &
                          mesh_b, surface_b, target, table, radius, by_nodes, plain(surface_a%kind(f)), rule(f))
      end if
    end do
    !$omp end parallel do
  end subroutine build_segment_rules

  !> Degree of the rules on cells: of the shape functions of either side times the dual functions, which are linear; where
  !> points are rows, twice the order of the element and enough for the shape functions of b.
  pure integer function segment_degree(kind_a, kind_b, by_nodes) result(degree)
    integer, intent(in) :: kind_a, kind_b
    logical, intent(in) :: by_nodes
    type(element_kind_t) :: kind
    kind = element_kind(kind_a)
    degree = max(shape_degree(kind_a), shape_degree(kind_b))
    if (by_nodes) then
      degree = degree + shape_degree(kind%corner_kind)
    else
      degree = max(degree, 2*kind%order)
    end if
  end function segment_degree

  !> The rule of a facet in three dimensions.
  subroutine divide_facet(set, f, kind, x, mesh_b, surface_b, target, table, radius, by_nodes, plain, rule)
    type(facet_set_t), intent(in) :: set
    !> Facet and its kind.
    integer, intent(in) :: f, kind
    !> Coordinates of its nodes (3, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    type(body_mesh_t), intent(in) :: mesh_b
    type(surface_t), intent(in) :: surface_b
    type(master_surface_t), intent(in) :: target
    type(rule_table_t), intent(in) :: table
    real(dp), intent(in) :: radius
    logical, intent(in) :: by_nodes
    type(quadrature_rule_t), intent(in) :: plain
    type(quadrature_rule_t), intent(inout) :: rule
    type(auxiliary_plane_t) :: chart
    type(mortar_segment_t), allocatable :: cell(:)
    real(dp), allocatable :: points(:, :), weights(:)
    real(dp) :: covered
    integer :: n_cells, n, i, m, degree, kind_b
    logical :: ok, whole, fit, fits
    call chart%init(set, f, x)
    if (.not. chart%area > 0) return
    call segments_of_facet(set%coefficient(:, :, f), chart, mesh_b%x, surface_b, target, n_cells, cell, ok)
    if (.not. ok .or. n_cells == 0) return
    covered = sum([(cell(i)%area, i=1, n_cells)])
    if (covered > (1 + area_tolerance)*chart%area) return
    if (covered < (1 - area_tolerance)*chart%area) then
      if (partners_beside(set, f, chart, cell(1:n_cells), target, radius, plain)) return
    end if
    n = 0
    do i = 1, n_cells
      kind_b = surface_b%kind(cell(i)%facet)
      degree = segment_degree(kind, kind_b, by_nodes)
      if (by_nodes .and. .not. chart%straight) degree = max(degree, 5)
      whole = cell(i)%area >= (1 - 1e-13_dp)*chart%area
      if (whole .and. by_nodes) degree = max(degree, 4)
      ! Flat facets of which one is a quadrilateral that is no parallelogram.
      fit = chart%straight .and. .not. (chart%affine .and. is_affine(target%set%coefficient(:, :, cell(i)%facet)))
      if (fit) fit = is_plane_polygon(target%set%corners(cell(i)%facet), &
                                 mesh_b%x(:, surface_b%node(1:kind_nodes(kind_b), cell(i)%facet)), chart%axes(:, 3))
      do
        if (whole .and. chart%corners == 3) then
          points = table%triangle(degree)%xi
          weights = table%triangle(degree)%weight
        else if (whole) then
          points = table%square(degree)%xi
          weights = table%square(degree)%weight
        else
          call polygon_rule(cell(i)%polygon, table, degree, m, points, weights, ok)
          if (ok) call map_points(chart, set%coefficient(:, :, f), points, weights, ok)
        end if
        if (.not. ok .or. .not. fit) exit
        ! At least as many points as conditions: three functions of the plane are shared.
        if (size(weights) >= kind_nodes(kind) + kind_nodes(kind_b) - 3) then
          call fit_segment_weights(chart, set, f, kind, target%set, cell(i)%facet, kind_b, cell(i)%polygon, table, &
                                   points, weights, fits)
          if (fits .or. degree >= most_fit_degree) exit
        end if
        degree = degree + 1
      end do
      if (.not. ok) exit
      call append_points(points, weights, n, rule%xi, rule%weight)
    end do
    if (ok .and. n > 0) then
      rule%xi = rule%xi(:, 1:n)
      rule%weight = rule%weight(1:n)
    else
      if (allocated(rule%weight)) deallocate (rule%xi, rule%weight)
    end if
  end subroutine divide_facet

  !> From the chart to reference coordinates.
  pure subroutine map_points(chart, coefficient, points, weights, ok)
    type(auxiliary_plane_t), intent(in) :: chart
    !> The facet's polynomial (3, 9).
    real(dp), intent(in) :: coefficient(3, 9)
    !> Points (2, n) and weights (n).
    real(dp), intent(inout) :: points(:, :), weights(:)
    logical, intent(out) :: ok
    real(dp) :: xi(2), determinant
    integer :: i
    ok = .true.
    if (.not. chart%straight) return
    xi = reference_centre(chart%corners)
    do i = 1, size(weights)
      call inverse_map(coefficient, [0.0_dp, 0.0_dp], chart%axes, chart%size, points(:, i), xi, determinant, ok)
      if (.not. ok) return
      points(:, i) = xi
      weights(i) = weights(i)/determinant
    end do
  end subroutine map_points

  !> Do points of the plain rule that no cell contains have partners?
  pure logical function partners_beside(set, f, chart, cell, target, radius, plain) result(beside)
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: f
    type(auxiliary_plane_t), intent(in) :: chart
    type(mortar_segment_t), intent(in) :: cell(:)
    type(master_surface_t), intent(in) :: target
    real(dp), intent(in) :: radius
    type(quadrature_rule_t), intent(in) :: plain
    type(projection_t) :: partner
    real(dp), dimension(3) :: x, normal, xu, xv
    real(dp) :: s(2)
    integer :: i, k, hint
    logical :: inside
    beside = .false.
    hint = 0
    do i = 1, size(plain%weight)
      call facet_position_and_normal(set, f, plain%xi(:, i), x, normal, xu, xv)
      s = plain%xi(:, i)
      if (chart%straight) s = chart%to_plane(x)
      inside = .false.
      do k = 1, size(cell)
        inside = contains_point(cell(k)%polygon, s, 1e-6_dp*sqrt(chart%area))
        if (inside) exit
      end do
      if (inside) cycle
      call project_point(target, x, normal, hint, radius, partner)
      beside = partner%status == projection_found
      if (beside) return
    end do
  end function partners_beside

  !> The rule of a facet in two dimensions.
  subroutine divide_line(set, f, kind, surface_b, target, table, radius, by_nodes, axisymmetric, plain, rule)
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: f, kind
    type(surface_t), intent(in) :: surface_b
    type(master_surface_t), intent(in) :: target
    type(rule_table_t), intent(in) :: table
    real(dp), intent(in) :: radius
    logical, intent(in) :: by_nodes, axisymmetric
    type(quadrature_rule_t), intent(in) :: plain
    type(quadrature_rule_t), intent(inout) :: rule
    integer, allocatable :: facet(:)
    real(dp), allocatable :: first(:), last(:)
    real(dp), dimension(3) :: x, normal, xu, xv
    type(projection_t) :: partner
    real(dp) :: covered
    integer :: n_cells, n, i, degree, hint
    logical :: ok
    call segments_of_line(set, f, target, n_cells, facet, first, last, ok)
    if (.not. ok .or. n_cells == 0) return
    call reach_end(set, f, target, radius, facet(minloc(first(1:n_cells), 1)), -1.0_dp, first(minloc(first(1:n_cells), 1)))
    call reach_end(set, f, target, radius, facet(maxloc(last(1:n_cells), 1)), 1.0_dp, last(maxloc(last(1:n_cells), 1)))
    covered = sum(last(1:n_cells) - first(1:n_cells))
    if (covered > 2*(1 + area_tolerance)) return
    if (covered < 2*(1 - area_tolerance)) then
      hint = 0
      do i = 1, size(plain%weight)
        associate (xi => plain%xi(1, i))
          if (any(first(1:n_cells) - 1e-6_dp < xi .and. xi < last(1:n_cells) + 1e-6_dp)) cycle
          call facet_position_and_normal(set, f, [xi, 0.0_dp], x, normal, xu, xv)
        end associate
        call project_point(target, x, normal, hint, radius, partner)
        if (partner%status == projection_found) return
      end do
    end if
    n = 0
    do i = 1, n_cells
      degree = segment_degree(kind, surface_b%kind(facet(i)), by_nodes) + merge(1, 0, axisymmetric)
      ! Along a curve, or with the middle node out of the middle, the shape functions of b are no polynomials of a's degree.
      if (by_nodes) degree = max(degree, merge(8, 4, maxval(abs(set%coefficient(:, 3, f))) > 1e-10_dp*set%size(f)))
      associate (r => table%line(degree))
        call append_points((first(i) + last(i))/2 + (last(i) - first(i))/2*r%xi, (last(i) - first(i))/2*r%weight, n, &
                           rule%xi, rule%weight)
      end associate
    end do
    rule%xi = rule%xi(:, 1:n)
    rule%weight = rule%weight(1:n)
  end subroutine divide_line

  !> Where b ends above a facet along the facet's normal, it may still be met along its own: with a gap s and an angle h/(2R) the cells
  !> end too early by s h/(2R). They reach the end of the facet if what lies beyond has partners on the same facet of b.
  pure subroutine reach_end(set, f, target, radius, facet_b, end_of_facet, end_of_cell)
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: f
    type(master_surface_t), intent(in) :: target
    !> Greatest distance of partners [length].
    real(dp), intent(in) :: radius
    !> Facet of b of the cell next to the end.
    integer, intent(in) :: facet_b
    !> -1 or 1.
    real(dp), intent(in) :: end_of_facet
    real(dp), intent(inout) :: end_of_cell
    !> Places between the ends of the cell and the facet.
    real(dp), parameter :: place(3) = [0.05_dp, 0.5_dp, 0.95_dp]
    type(projection_t) :: partner
    real(dp), dimension(3) :: x, normal, xu, xv
    integer :: i, hint
    if (.not. abs(end_of_facet - end_of_cell) > area_tolerance) return
    hint = facet_b
    do i = 1, size(place)
      call facet_position_and_normal(set, f, [end_of_cell + place(i)*(end_of_facet - end_of_cell), 0.0_dp], x, normal, xu, xv)
      call project_point(target, x, normal, hint, radius, partner)
      if (partner%status /= projection_found .or. partner%facet /= facet_b) return
    end do
    end_of_cell = end_of_facet
  end subroutine reach_end
end module dotyk_contact_mortar_segments
