!> Gaps of curved surfaces, interpolated as the displacements of linear slave facets are.
!>
!> On a linear facet the displacement is the interpolation of its values at the vertices, the gap of smooth surfaces is
!> curved: d = sum_j d_j phi_j + r, where r vanishes at the vertices (r = -h^2/8R in the middle of a chord of a circle
!> of radius R). No displacement resembles r, and its weighted means, -h^2/12R at a vertex, would be an offset of all
!> rows: overlaps where round bodies merely touch, and an error of the approach where the contact is resolved. So r is
!> taken off, and the row of a vertex has the gap at the vertex, as the phi_j are biorthogonal to psi. Quadratic facets
!> bend as the gap does; their gaps keep r.
!>
!> r is a combination of the quadratic functions that vanish at the vertices, by least squares over the integration
!> points of the facet and those of its vertices that have a projection: so it is known on facets of which only a part
!> has one. Patches of the smooth surface are quadratic, so that r is exact over a planar master surface. A gap with
!> kinks is no such combination, and stays as it is.
module dotyk_contact_gap_interpolation
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_facet_corners, only: corner_coordinates
  use dotyk_contact_projection, only: projection_found, projection_t
  use dotyk_contact_segment_quadrature, only: quadrature_rule_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: add_vertices, interpolate_gaps

  integer, parameter :: max_functions = 4  !! Quadratic functions on a facet at most, and its corners at most.
  !> Combinations of functions with a mean square below this are not determined by the points of a facet; a whole facet
  !> has about 0.1, a strip along an edge the fourth power of its relative width.
  real(dp), parameter :: min_mean_square = 1.0e-6_dp
  !> Weight of a vertex relative to that of all points of the facet: its gap is the one that counts.
  real(dp), parameter :: vertex_weight = 100
  !> Where r is below this fraction of the length of the facet, the gap is not curved.
  real(dp), parameter :: min_curvature = 1.0e-8_dp
  !> The gap has a kink where the root mean square of what is neither linear nor r exceeds this fraction of that of r
  !> (a kink in the middle of a line: 0.1).
  real(dp), parameter :: max_rest = 0.05_dp

contains

  !> Add the vertices of linear facets to their integration points, as the last ones and without weight.
  pure subroutine add_vertices(surface, rule)
    type(surface_t), intent(in) :: surface  !! Slave surface (surface_a).
    !> Rules of the facets; not allocated for those that are not examined here (n_facets).
    type(quadrature_rule_t), intent(inout) :: rule(:)
    real(dp) :: vertex(2, max_functions)
    integer :: d, f, i, n, m
    do f = 1, size(rule)
      n = linear_corners(surface%kind(f))
      if (n == 0 .or. .not. allocated(rule(f)%weight)) cycle
      do i = 1, n
        vertex(:, i) = corner_coordinates(n, i)
      end do
      d = size(rule(f)%xi, 1)
      m = size(rule(f)%weight)
      rule(f)%xi = reshape([rule(f)%xi, vertex(:d, :n)], [d, m + n])
      rule(f)%weight = [rule(f)%weight, [(0.0_dp, i=1, n)]]
    end do
  end subroutine add_vertices

  !> Replace the distances on linear facets by the interpolation of their values at the vertices, and remove the
  !> vertices from the points.
  subroutine interpolate_gaps(surface, offset, x, xi, weight, projection)
    type(surface_t), intent(in) :: surface  !! Slave surface (surface_a).
    !> Points of facet f, if any, are offset(f)+1 .. offset(f+1), the vertices of linear facets last; on return without
    !> these (n_facets+1).
    integer, intent(inout) :: offset(:)
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
    !$omp shared(surface, offset, x, xi, weight, projection, is_kept, n_vertices)
    do f = 1, size(offset) - 1
      n = 0
      if (offset(f + 1) > offset(f)) n = linear_corners(surface%kind(f))
      n_vertices(f) = n
      if (n == 0) cycle
      associate (first => offset(f) + 1, last => offset(f + 1))
        is_kept(last - n + 1:last) = .false.
        call straighten(n, surface%kind(f), x(:, first:last), xi(:surface%dimension - 1, first:last), &
                        weight(first:last), projection(first:last))
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

  !> Number of corners of a linear facet; 0 for others.
  pure integer function linear_corners(kind)
    integer, intent(in) :: kind  !! Element kind of the facet.
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    linear_corners = merge(properties%n_corners, 0, kind_nodes(kind) == properties%n_corners)
  end function linear_corners

  !> Take r off the distances on one facet.
  subroutine straighten(corners, kind, x, xi, area, projection)
    integer, intent(in) :: corners  !! Number of corners of the facet, the last points.
    integer, intent(in) :: kind  !! Element kind of the facet.
    real(dp), intent(in) :: x(:, :)  !! Positions of the points (3, n_points) [length].
    real(dp), intent(in) :: xi(:, :)  !! Reference coordinates of the points (dimension-1, n_points) [].
    !> Quadrature weights of the points (n_points) [length^2; length in two dimensions].
    real(dp), intent(in) :: area(:)
    type(projection_t), intent(inout) :: projection(:)  !! Projections of the points (n_points).
    real(dp), allocatable :: linear(:, :), curved(:, :), without_linear(:, :)
    real(dp), allocatable :: coefficient(:), rest(:), r(:)
    real(dp) :: weight(size(area)), gap(size(area))
    integer, allocatable :: list(:)
    real(dp) :: length
    integer :: i, m, n
    n = size(area)
    length = maxval([(maxval(x(i, n - corners + 1:)) - minval(x(i, n - corners + 1:)), i=1, 3)])
    weight = abs(area)/max(sum(abs(area)), tiny(length))
    weight(n - corners + 1:) = vertex_weight
    list = pack([(i, i=1, n)], projection%status == projection_found)
    if (.not. any(list <= n - corners)) return
    m = size(list)
    weight(:m) = weight(list)
    gap(:m) = projection(list)%distance
    if (maxval(gap(:m)) - minval(gap(:m)) <= min_curvature*length) return
    allocate (linear(corners, m), curved(merge(1, corners, corners == 2), m))
    do i = 1, m
      call shape_functions(kind, xi(:, list(i)), linear(:, i))
      call vanishing_functions(linear(:, i), curved(:, i))
    end do
    rest = gap(:m) - matmul(fitted(linear, weight(:m), gap(:m)), linear)
    without_linear = curved
    do i = 1, size(curved, 1)
      without_linear(i, :) = curved(i, :) - matmul(fitted(linear, weight(:m), curved(i, :)), linear)
    end do
    coefficient = fitted(without_linear, weight(:m), rest)
    r = matmul(coefficient, curved)
    if (maxval(abs(r)) <= min_curvature*length) return
    rest = rest - matmul(coefficient, without_linear)
    if (sum(weight(:m)*rest**2) > max_rest**2*sum(weight(:m)*r**2)) return
    projection(list)%distance = gap(:m) - r
  end subroutine straighten

  !> Coefficients of a least-squares approximation; 0 for combinations that the points do not determine.
  function fitted(functions, weight, value) result(coefficient)
    real(dp), intent(in) :: functions(:, :)  !! Functions at the points (n, n_points) [].
    real(dp), intent(in) :: weight(:)  !! Weights of the points (n_points) [].
    real(dp), intent(in) :: value(:)  !! Values to be approximated (n_points) [any].
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
        coefficient = coefficient + vectors(:, i)*dot_product(vectors(:, i), right)/values(i)
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
