!> Gaps of curved surfaces, interpolated as the displacements of slave facets are.
!>
!> On a linear facet the displacement is the interpolation of its values at the vertices, the gap of smooth surfaces is
!> curved: d = sum_j d_j phi_j + r, where r vanishes at the vertices (r = -h^2/8R in the middle of a chord of a circle
!> of radius R). No displacement resembles r, and its weighted means, -h^2/12R at a vertex, would be an offset of all
!> rows: overlaps where round bodies merely touch, and an error of the approach where the contact is resolved. So r is
!> taken off, and the row of a vertex has the gap at the vertex, as the phi_j are biorthogonal to psi. Gaps by formula
!> are treated alike.
!>
!> Quadratic facets bend as the gap does where the contact spans them: their gaps keep r. Bodies that merely touch
!> somewhere on a facet do not bend it: there r is taken off, wholly where the least gap of the facet is 0, and in part
!> up to a least gap, or an overlap, as great as r. It goes back, or wholly off, where the contact turns out to span the
!> facet, or not (facet_bending.f90).
!>
!> r is a combination of the quadratic functions that vanish at the vertices, by least squares over the integration
!> points of the facet and those of its vertices that have a projection: so it is known on facets of which only a part
!> has one; there by ridge regression, or errors of patches would be taken for a steep r. Patches of the smooth surface
!> are quadratic, so that this is exact over a planar master surface; elsewhere the small rest is taken off as well. A
!> gap with kinks is no such combination, and stays as it is, unless it is least at a vertex: on the flank of a cone
!> beside a flat end rows have the gap at the rim.
module dotyk_contact_gap_interpolation
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: no_offset
  use dotyk_contact_facet_set, only: corner_coordinates
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_contact_projection, only: projection_found, projection_t
  use dotyk_contact_segment_quadrature, only: quadrature_rule_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_element, only: element_kind, element_kind_t, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: add_vertices, interpolate_formula, interpolate_gaps

  integer, parameter :: max_functions = 4  !! Quadratic functions on a facet at most, and its corners at most.
  !> Combinations of functions with a mean square below this are not determined by the points of a facet; a whole facet
  !> has about 0.1, a strip along an edge the fourth power of its relative width.
  real(dp), parameter, public :: min_mean_square = 1.0e-6_dp
  !> Weight of a vertex relative to that of all points of the facet: its gap is the one that counts.
  real(dp), parameter :: vertex_weight = 100
  !> The gap has a kink where the root mean square of what is neither linear nor r exceeds this fraction of that of r
  !> (a kink in the middle of a line: 0.1).
  real(dp), parameter :: max_rest = 0.05_dp

contains

  !> Add the vertices of facets to their integration points, as the last ones and without weight.
  pure subroutine add_vertices(surface, rule)
    type(surface_t), intent(in) :: surface  !! Slave surface (surface_a).
    !> Rules of the facets; not allocated for those that are not examined here (n_facets).
    type(quadrature_rule_t), intent(inout) :: rule(:)
    real(dp) :: vertex(2, max_functions)
    integer :: d, f, i, n, m
    do f = 1, size(rule)
      if (.not. allocated(rule(f)%weight)) cycle
      n = n_corners(surface%kind(f))
      do i = 1, n
        vertex(:, i) = corner_coordinates(n, i)
      end do
      d = size(rule(f)%xi, 1)
      m = size(rule(f)%weight)
      rule(f)%xi = reshape([rule(f)%xi, vertex(:d, :n)], [d, m + n])
      rule(f)%weight = [rule(f)%weight, [(0.0_dp, i=1, n)]]
    end do
  end subroutine add_vertices

  !> Take r off the distances, and remove the vertices from the points.
  subroutine interpolate_gaps(surface, offset, sheet_b, x, xi, weight, projection)
    type(surface_t), intent(in) :: surface  !! Slave surface (surface_a).
    !> Points of facet f, if any, are offset(f)+1 .. offset(f+1), the vertices last; on return without these
    !> (n_facets+1).
    integer, intent(inout) :: offset(:)
    integer, intent(in) :: sheet_b(:)  !! Sheets of the master facets: each has rows of its own (n_facets).
    real(dp), allocatable, intent(inout) :: x(:, :)  !! Positions of the points (3, n_points) [length].
    real(dp), allocatable, intent(inout) :: xi(:, :)  !! Reference coordinates of the points (2, n_points) [].
    !> Quadrature weights of the points (n_points) [length^2; length in two dimensions].
    real(dp), allocatable, intent(inout) :: weight(:)
    type(projection_t), allocatable, intent(inout) :: projection(:)  !! Projections of the points (n_points).
    integer, allocatable :: list(:)
    integer :: n_vertices(size(offset) - 1), f, i, n
    logical :: is_kept(size(weight))
    is_kept = .true.
    !$omp parallel do default(none) schedule(dynamic, 64) private(n) &
    !$omp shared(surface, offset, sheet_b, x, xi, weight, projection, is_kept, n_vertices)
    do f = 1, size(offset) - 1
      n = 0
      if (offset(f + 1) > offset(f)) n = n_corners(surface%kind(f))
      n_vertices(f) = n
      if (n == 0) cycle
      associate (first => offset(f) + 1, last => offset(f + 1))
        is_kept(last - n + 1:last) = .false.
        call straighten_projections(n, surface%kind(f), x(:, first:last), xi(:surface%dimension - 1, first:last), &
                                    weight(first:last), sheet_b, projection(first:last))
      end associate
    end do
    !$omp end parallel do
    list = pack([(i, i=1, size(weight))], is_kept)
    n = 0
    do f = 2, size(offset)
      n = n + n_vertices(f - 1)
      offset(f) = offset(f) - n
    end do
    x = x(:, list)
    xi = xi(:, list)
    weight = weight(list)
    projection = projection(list)
  end subroutine interpolate_gaps

  !> Number of corners of a facet.
  pure integer function n_corners(kind)
    integer, intent(in) :: kind  !! Element kind of the facet.
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    n_corners = properties%n_corners
  end function n_corners

  !> Take r off the distances on one facet, to each sheet of the master surface.
  subroutine straighten_projections(corners, kind, x, xi, area, sheet_b, projection)
    integer, intent(in) :: corners  !! Number of corners of the facet, the last points.
    integer, intent(in) :: kind  !! Element kind of the facet.
    real(dp), intent(in) :: x(:, :)  !! Positions of the points (3, n_points) [length].
    real(dp), intent(in) :: xi(:, :)  !! Reference coordinates of the points (dimension-1, n_points) [].
    !> Quadrature weights of the points (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: area(:)
    integer, intent(in) :: sheet_b(:)  !! Sheets of the master facets (n_facets).
    type(projection_t), intent(inout) :: projection(:)  !! Projections of the points (n_points).
    integer, allocatable :: list(:), rest(:)
    real(dp), allocatable :: gap(:), bend(:), curved(:)
    real(dp) :: uncertainty
    integer :: i, n
    n = size(area)
    rest = pack([(i, i=1, n)], projection%status == projection_found)
    do while (size(rest) > 0)
      associate (sheet => sheet_b(projection(rest)%facet))
        list = pack(rest, sheet == sheet(1))
        rest = pack(rest, sheet /= sheet(1))
      end associate
      if (.not. any(list <= n - corners)) cycle
      gap = projection(list)%distance
      call straighten(kind, extent(x(:, n - corners + 1:)), xi(:, list), area(list), count(list > n - corners), &
                      maxval(projection(list)%uncertainty), gap, bend, curved, uncertainty)
      ! Patches of uncertain curvature have kinks: what is noise of the one is no error of the other.
      projection(list)%uncertainty = max(projection(list)%uncertainty, uncertainty)
      projection(list)%distance = gap
      projection(list)%bend = bend
      projection(list)%curved = curved
    end do
  end subroutine straighten_projections

  !> Take r off the gaps by formula on the facets of the mortar points.
  subroutine interpolate_formula(surface, x, formula, n_mortar_points, pair)
    type(surface_t), intent(in) :: surface  !! Slave surface (surface_a).
    real(dp), intent(in) :: x(:, :)  !! Nodes of its body (dimension, n_nodes) [length].
    type(formula_t), intent(inout) :: formula  !! The gap formula.
    integer, intent(in) :: n_mortar_points  !! Number of points, the first ones, that rows average.
    type(contact_pair_t), intent(inout) :: pair  !! Pair with the gaps of the formula at its points.
    real(dp) :: vertex(2, max_functions), at(3)
    real(dp), allocatable :: gap(:), bend(:), curved(:)
    integer :: first, last, i, n
    first = 1
    at = 0
    do while (first <= n_mortar_points)
      associate (f => pair%facet_a(first))
        last = first - 1 + findloc(pair%facet_a(first:n_mortar_points) == f, .false., dim=1) - 1
        if (last < first) last = n_mortar_points
        n = n_corners(surface%kind(f))
        gap = [pair%gap(first:last), [(0.0_dp, i=1, n)]]
        do i = 1, n
          vertex(:, i) = corner_coordinates(n, i)
          at(:pair%dimension) = x(:, surface%node(i, f))
          gap(last - first + 1 + i) = formula%evaluate(at)
        end do
        if (all(abs(gap) <= huge(gap))) then
          call straighten(surface%kind(f), extent(x(:, surface%node(:n, f))), &
                          reshape([pair%xi_a(:, first:last), vertex(:pair%dimension - 1, :n)], &
                                  [pair%dimension - 1, size(gap)]), &
                          [pair%weight(first:last), [(0.0_dp, i=1, n)]], n, 0.0_dp, gap, bend, curved, &
                          pair%uncertainty(first))
          pair%uncertainty(first:last) = pair%uncertainty(first)
          pair%gap(first:last) = gap(:last - first + 1)
          pair%bend(first:last) = bend(:last - first + 1)
          pair%curved(first:last) = curved(:last - first + 1)
        end if
      end associate
      first = last + 1
    end do
  end subroutine interpolate_formula

  !> Greatest extent of points along the axes [length].
  pure real(dp) function extent(x)
    real(dp), intent(in) :: x(:, :)  !! Points (dimension, n) [length].
    extent = maxval(maxval(x, dim=2) - minval(x, dim=2))
  end function extent

  !> Take r off the gaps at points of one facet.
  subroutine straighten(kind, length, xi, area, n_vertices, noise, gap, bend, curved, uncertainty)
    integer, intent(in) :: kind  !! Element kind of the facet.
    real(dp), intent(in) :: length  !! Length of the facet [length].
    real(dp), intent(in) :: xi(:, :)  !! Reference coordinates of the points (dimension-1, n_points) [].
    !> Quadrature weights of the points (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: area(:)
    integer, intent(in) :: n_vertices  !! Number of vertices of the facet among the points, the last ones.
    real(dp), intent(in) :: noise  !! How uncertain the gaps at the points are [length].
    real(dp), intent(inout) :: gap(:)  !! Gaps at the points (n_points) [length].
    real(dp), allocatable, intent(out) :: bend(:)  !! What was taken off (n_points) [length].
    !> What of r is left where the facet can bend (n_points) [length].
    real(dp), allocatable, intent(out) :: curved(:)
    !> How uncertain the gaps are: bodies that touch between the vertices do so at the least gap, and rows have that of
    !> a linear function [length].
    real(dp), intent(out) :: uncertainty
    type(element_kind_t) :: properties
    real(dp), allocatable :: linear(:, :), bubble(:, :), without_linear(:, :), coefficient(:), rest(:), r(:)
    real(dp) :: weight(size(area)), greatest, least, ridge
    integer :: i, m, n
    m = size(area)
    allocate (bend(m), curved(m), source=0.0_dp)
    weight = abs(area)/max(sum(abs(area)), tiny(length))
    weight(m - n_vertices + 1:) = vertex_weight
    uncertainty = 0
    least = minval(gap)
    if (maxval(gap) - least <= no_offset*length) return
    properties = element_kind(kind)
    n = properties%n_corners
    allocate (linear(n, m), bubble(merge(1, n, n == 2), m))
    do i = 1, m
      call shape_functions(properties%corner_kind, xi(:, i), linear(:, i))
      call vanishing_functions(linear(:, i), bubble(:, i))
    end do
    rest = gap - matmul(at_corners(gap), linear)
    without_linear = bubble
    do i = 1, size(bubble, 1)
      without_linear(i, :) = bubble(i, :) - matmul(at_corners(bubble(i, :)), linear)
    end do
    ridge = 0
    if (n_vertices < n) ridge = (noise/(maxval(gap) - least))**2
    coefficient = fitted(without_linear, weight, rest, ridge)
    r = matmul(coefficient, bubble)
    greatest = maxval(abs(r))
    if (greatest <= no_offset*length) return
    rest = rest - matmul(coefficient, without_linear)
    if (sum(weight*rest**2) > max_rest**2*sum(weight*r**2) .and. .not. is_least_at_vertex()) then
      ! Where there are points only: vertices may lie beyond.
      weight(m - n_vertices + 1:) = 0
      associate (row => matmul(fitted(linear, weight, gap, 0.0_dp), linear))
        uncertainty = abs(minval(row(:m - n_vertices)) - minval(gap(:m - n_vertices)))
      end associate
      return
    end if
    r = r + rest
    if (properties%order > 1) then
      curved = r*min(1.0_dp, abs(least)/greatest)
      r = r - curved
    end if
    bend = r
    gap = gap - r
    if (.not. is_least_at_vertex()) uncertainty = abs(minval(gap) - least)

  contains

    !> Corner values of the linear part of a function, exact where all corners are among the points.
    function at_corners(value) result(corner)
      real(dp), intent(in) :: value(:)  !! Its values at the points (m) [any].
      real(dp) :: corner(n)  !! (n) [as `value`]
      if (n_vertices == n) then
        corner = value(m - n + 1:)
      else
        corner = fitted(linear, weight, value, 0.0_dp)
      end if
    end function at_corners

    !> Whether contact begins at a vertex, whatever the gap is between vertices: the facet is inclined by more than a
    !> parabola of the height of r, 4 times that at its ends.
    pure logical function is_least_at_vertex() result(is_least)
      is_least = n_vertices > 0
      if (.not. is_least) return
      associate (vertex => gap(m - n_vertices + 1:))
        is_least = maxval(vertex) - minval(vertex) > 4*greatest
      end associate
    end function is_least_at_vertex
  end subroutine straighten

  !> Coefficients of a least-squares approximation; 0 for combinations that the points do not determine.
  function fitted(functions, weight, value, ridge) result(coefficient)
    real(dp), intent(in) :: functions(:, :)  !! Functions at the points (n, n_points) [].
    real(dp), intent(in) :: weight(:)  !! Weights of the points (n_points) [].
    real(dp), intent(in) :: value(:)  !! Values to be approximated (n_points) [any].
    !> Parameter of ridge regression: combinations with a mean square far below it get next to nothing [].
    real(dp), intent(in) :: ridge
    real(dp) :: coefficient(size(functions, 1))  !! Coefficients (n) [as `value`].
    type(error_t), allocatable :: error
    real(dp) :: matrix(size(functions, 1), size(functions, 1)), vectors(size(functions, 1), size(functions, 1))
    real(dp) :: values(size(functions, 1)), right(size(functions, 1)), weighted(size(functions, 1), size(functions, 2))
    integer :: i, n
    n = size(functions, 1)
    weighted = functions*spread(weight, 1, n)
    right = matmul(weighted, value)
    matrix = matmul(functions, transpose(weighted))
    coefficient = 0
    call symmetric_eigen(matrix, values, vectors, error)
    if (allocated(error)) return
    do i = 1, n
      if (values(i) > min_mean_square) &
        coefficient = coefficient + vectors(:, i)*dot_product(vectors(:, i), right)/(values(i) + ridge)
    end do
  end function fitted

  !> Quadratic functions that vanish at the corners: those of the mid-side nodes of the quadratic facet.
  pure subroutine vanishing_functions(linear, curved)
    real(dp), intent(in) :: linear(:)  !! Linear shape functions (corners) [].
    real(dp), intent(out) :: curved(:)  !! Functions: one on a line, else as many as corners (n) [].
    integer :: i
    associate (n => size(linear), phi => linear)
      do i = 1, size(curved)
        if (n < 4) then
          curved(i) = 4*phi(i)*phi(modulo(i, n) + 1)
        else
          ! 4 (phi_1 + phi_4) (phi_2 + phi_3) = 1 - xi^2 along the first edge, times phi_1 + phi_2 = (1 - eta)/2.
          curved(i) = 4*(phi(i) + phi(modulo(i + 2, 4) + 1))*(phi(modulo(i, 4) + 1) + phi(modulo(i + 1, 4) + 1)) &
                      *(phi(i) + phi(modulo(i, 4) + 1))
        end if
      end do
    end associate
  end subroutine vanishing_functions
end module dotyk_contact_gap_interpolation
