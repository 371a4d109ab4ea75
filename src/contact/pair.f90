!> The contact points of one pair of surfaces. Integration points are quadrature points of surface_a, each with its
!> partner on surface_b. The rows, which the contact conditions are set up for, are weighted means of them: each point by
!> itself, or one row per vertex of surface_a.
!>
!> Sign conventions: n points from body a into body b; d = n.(x' - x), negative where the bodies overlap; a contact
!> pressure p >= 0 acts on body a as the traction -p n and on body b as p n.
module dotyk_contact_pair
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: is_too_large, size_rule
  use dotyk_base_options, only: default_discretization, default_gap, default_geometry, default_quadrature, &
    discretization_mortar, discretization_quadrature, gap_constant, gap_formula, geometry_smooth, &
    quadrature_segments
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_dual_mortar, only: dual_mortar_rows
  use dotyk_contact_segment_quadrature, only: quadrature_rule_t
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_integration_points, only: whole_facet_rules, project_points
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_local_origin, only: choose_origin, shift_origin
  use dotyk_contact_broad_phase, only: facets_near_candidates, candidate_facets
  use dotyk_contact_projection, only: projection_found, projection_not_facing, projection_outside, projection_t, &
    projection_too_far, master_surface_t
  use dotyk_contact_mortar_segments, only: build_segment_rules
  use dotyk_contact_smooth_projection, only: smooth_projections
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: n_element_kinds
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private


  !> What the user says of a pair.
  type, public :: pair_settings_t
    !> Name of the pair.
    character(:), allocatable :: name
    !> Indices of the two bodies.
    integer :: body_a = 0, body_b = 0
    !> Weights contain 2 pi r.
    logical :: axisymmetric = .false.
    !> One of `gap_*`.
    integer :: gap_kind = default_gap
    !> The given gap [length].
    real(dp) :: gap = 0
    !> Greatest distance of partners [length]; not positive: the size of the smaller body.
    real(dp) :: search_radius = 0
    !> Penalty parameter [length/pressure].
    real(dp) :: theta = 0
    !> One of `discretization_*`.
    integer :: discretization = default_discretization
    !> What gaps and normals are taken from, one of `geometry_*`.
    integer :: geometry = default_geometry
    !> One of `quadrature_*`.
    integer :: quadrature = default_quadrature
  end type pair_settings_t

  !> The contact points of a pair.
  type, public :: contact_pair_t
    !> Name of the pair.
    character(:), allocatable :: name
    !> Indices of the two bodies.
    integer :: body_a = 0, body_b = 0
    !> Dimension of space.
    integer :: dimension = 0
    !> What the rows are: one of `discretization_*`.
    integer :: discretization = default_discretization
    !> Number of integration points that have a partner.
    integer :: n_points = 0
    !> Number of points that have none, and why: not facing, beside the surface, too far.
    integer :: n_unprojected = 0, n_not_facing = 0, n_outside = 0, n_too_far = 0
    !> Penalty parameter, in the mean of the rows [length/pressure].
    real(dp) :: theta = 0
    !> Points x on surface_a (dimension, n_points) [length].
    real(dp), allocatable :: position(:, :)
    !> Unit vectors from a into b (dimension, n_points).
    real(dp), allocatable :: normal(:, :)
    !> Areas (n_points) [length^2; length in two dimensions, with 2 pi r in axisymmetry].
    real(dp), allocatable :: weight(:)
    !> Gaps d (n_points) [length].
    real(dp), allocatable :: gap(:)
    !> Facets of surface_a (n_points), ascending, and reference coordinates on them (dimension-1, n_points).
    integer, allocatable :: facet_a(:)
    real(dp), allocatable :: xi_a(:, :)
    !> Facets of surface_b (n_points) and reference coordinates of x' on them (dimension-1, n_points).
    integer, allocatable :: facet_b(:)
    real(dp), allocatable :: xi_b(:, :)
    !> Number of rows.
    integer :: n_rows = 0
    !> Means that make the rows of the points (n_rows x n_points); the sum of each row is 1.
    type(sparse_rows_t) :: average
    !> Body-local node number of each row's vertex (n_rows); not allocated where rows are points.
    integer, allocatable :: row_vertex(:)
    !> Where the rows are (dimension, n_rows) [length]: at the vertices or points.
    real(dp), allocatable :: row_position(:, :)
    !> Unit vectors from a into b, in the mean of the points (dimension, n_rows).
    real(dp), allocatable :: row_normal(:, :)
    !> Areas (n_rows), as `weight`, with the same sum.
    real(dp), allocatable :: row_weight(:)
    !> Gaps (n_rows) [length].
    real(dp), allocatable :: row_gap(:)
    !> Penalty parameters (n_rows), `theta` unless they are set otherwise [length/pressure].
    real(dp), allocatable :: row_theta(:)
  end type contact_pair_t

  public :: discretize_pair, pair_force

contains

  !> Find the contact points of a pair.
  subroutine discretize_pair(mesh_a, surface_a, mesh_b, surface_b, settings, formula, pair, error)
    !> Body a and its surface, which carries the points.
    type(body_mesh_t), intent(in) :: mesh_a
    type(surface_t), intent(in) :: surface_a
    !> Body b and its surface, which the points are projected on.
    type(body_mesh_t), intent(in) :: mesh_b
    type(surface_t), intent(in) :: surface_b
    !> What the user says.
    type(pair_settings_t), intent(in) :: settings
    !> The gap where settings%gap_kind is `gap_formula`.
    type(formula_t), intent(inout) :: formula
    !> The points.
    type(contact_pair_t), intent(out) :: pair
    !> No point has a partner.
    type(error_t), allocatable, intent(out) :: error
    type(body_mesh_t) :: near_a, near_b
    real(dp) :: origin(3)
    origin = 0
    call choose_origin(mesh_a%x, surface_a, origin(1:mesh_a%dimension))
    if (settings%axisymmetric) origin(1) = 0
    if (.not. any(abs(origin) > 0)) then
      call search_pair(mesh_a, surface_a, mesh_b, surface_b, origin, settings, formula, pair, error)
    else
      near_a = mesh_a
      near_b = mesh_b
      call shift_origin(near_a%x, origin)
      call shift_origin(near_b%x, origin)
      call search_pair(near_a, surface_a, near_b, surface_b, origin, settings, formula, pair, error)
    end if
  end subroutine discretize_pair

  !> Find the contact points of two bodies whose coordinates count from an origin.
  subroutine search_pair(mesh_a, surface_a, mesh_b, surface_b, origin, settings, formula, pair, error)
    type(body_mesh_t), intent(in) :: mesh_a
    type(surface_t), intent(in) :: surface_a
    type(body_mesh_t), intent(in) :: mesh_b
    type(surface_t), intent(in) :: surface_b
    !> Where they count from [length].
    real(dp), intent(in) :: origin(3)
    type(pair_settings_t), intent(in) :: settings
    type(formula_t), intent(inout) :: formula
    type(contact_pair_t), intent(out) :: pair
    type(error_t), allocatable, intent(out) :: error
    type(master_surface_t) :: target
    type(facet_set_t) :: set_a
    type(quadrature_rule_t) :: rule(n_element_kinds)
    type(quadrature_rule_t), allocatable :: own(:)
    type(projection_t), allocatable :: partner(:)
    real(dp), allocatable :: x(:, :), weight(:), xi(:, :)
    integer, allocatable :: offset(:)
    logical :: near(surface_a%n_facets)
    real(dp) :: radius
    integer :: f, n
    radius = settings%search_radius
    if (.not. radius > 0) radius = min(mesh_a%size(), mesh_b%size())
    call target%init(mesh_b%x, surface_b)
    call set_a%init(mesh_a%x, surface_a)
    near = candidate_facets(set_a, target%set, target%tree, radius)
    call whole_facet_rules(surface_a%kind(1:surface_a%n_facets), &
                           settings%discretization == discretization_mortar, settings%axisymmetric, rule)
    allocate (offset(surface_a%n_facets + 1))
    if (settings%quadrature == quadrature_segments) then
      call build_segment_rules(mesh_a, surface_a, set_a, near, mesh_b, surface_b, target, radius, &
                         settings%discretization == discretization_mortar, settings%axisymmetric, rule, own)
    else
      allocate (own(surface_a%n_facets))
    end if
    offset(1) = 0
    do f = 1, surface_a%n_facets
      if (.not. allocated(own(f)%weight)) own(f) = rule(surface_a%kind(f))
      offset(f + 1) = offset(f) + size(own(f)%weight)
    end do
    n = offset(surface_a%n_facets + 1)
    allocate (partner(n), x(3, n), weight(n), xi(2, n))
    call project_points(mesh_a, surface_a, own, offset, settings%axisymmetric, target, near, radius, x, xi, weight, partner)
    if (.not. any(partner%status == projection_found)) then
      ! To say why, look at all.
      near = .true.
      call project_points(mesh_a, surface_a, own, offset, settings%axisymmetric, target, near, radius, x, xi, weight, partner)
    end if
    if (settings%geometry == geometry_smooth) call smooth_projections(mesh_a%x, surface_a, near, mesh_b%x, &
      surface_b, facets_near_candidates(target%set, set_a, near, radius), radius, offset, x, xi, partner)
    call collect(mesh_a%dimension, offset, x, xi, weight, partner, pair)
    pair%name = settings%name
    pair%body_a = settings%body_a
    pair%body_b = settings%body_b
    pair%theta = settings%theta
    pair%discretization = settings%discretization
    if (pair%n_points == 0) then
      call explain_no_projection(pair, surface_a%name, surface_b%name, target, x, radius, error)
      return
    end if
    call shift_origin(pair%position, -origin)
    call given_gap(settings, formula, pair, error)
    if (allocated(error)) return
    call set_rows(mesh_a, surface_a, origin, pair)
    allocate (pair%row_theta(pair%n_rows), source=pair%theta)
  end subroutine search_pair

  !> Keep the points that have a partner and count the others.
  pure subroutine collect(d, offset, x, xi, weight, partner, pair)
    !> Dimension of space.
    integer, intent(in) :: d
    !> Points of facet f are offset(f)+1 .. offset(f+1).
    integer, intent(in) :: offset(:)
    !> As in facet_points, for all facets.
    real(dp), intent(in) :: x(:, :), xi(:, :), weight(:)
    type(projection_t), intent(in) :: partner(:)
    !> The points.
    type(contact_pair_t), intent(inout) :: pair
    integer :: f, i, k, n
    n = count(partner%status == projection_found)
    pair%dimension = d
    pair%n_points = n
    pair%n_unprojected = size(partner) - n
    pair%n_not_facing = count(partner%status == projection_not_facing)
    pair%n_outside = count(partner%status == projection_outside)
    pair%n_too_far = count(partner%status == projection_too_far)
    allocate (pair%position(d, n), pair%normal(d, n), pair%weight(n), pair%gap(n), pair%facet_a(n), &
              pair%xi_a(d - 1, n), pair%facet_b(n), pair%xi_b(d - 1, n))
    k = 0
    do f = 1, size(offset) - 1
      do i = offset(f) + 1, offset(f + 1)
        if (partner(i)%status /= projection_found) cycle
        k = k + 1
        pair%position(:, k) = x(1:d, i)
        pair%normal(:, k) = partner(i)%normal(1:d)
        pair%weight(k) = weight(i)
        pair%gap(k) = partner(i)%distance
        pair%facet_a(k) = f
        pair%xi_a(:, k) = xi(1:d - 1, i)
        pair%facet_b(k) = partner(i)%facet
        pair%xi_b(:, k) = partner(i)%xi(1:d - 1)
      end do
    end do
    ! Surfaces that touch have a gap of 0, not one of the coordinates' round-off.
    where (abs(pair%gap) <= 8*epsilon(1.0_dp)*maxval(abs(x))) pair%gap = 0
  end subroutine collect

  !> The rows of the points.
  subroutine set_rows(mesh_a, surface_a, origin, pair)
    type(body_mesh_t), intent(in) :: mesh_a
    type(surface_t), intent(in) :: surface_a
    !> Where coordinates of the mesh count from [length].
    real(dp), intent(in) :: origin(3)
    type(contact_pair_t), intent(inout) :: pair
    type(corner_interpolation_t) :: corners
    integer :: c, i
    if (pair%discretization == discretization_quadrature) then
      pair%n_rows = pair%n_points
      call pair%average%set_identity(pair%n_points)
      pair%row_position = pair%position
      pair%row_weight = pair%weight
      pair%row_normal = pair%normal
      pair%row_gap = pair%gap
      return
    end if
    call corners%init(surface_a, pair%facet_a, pair%xi_a)
    call dual_mortar_rows(corners, pair%facet_a, pair%weight, pair%row_vertex, pair%row_weight, pair%average)
    pair%n_rows = size(pair%row_vertex)
    pair%row_position = mesh_a%x(:, pair%row_vertex)
    call shift_origin(pair%row_position, -origin)
    allocate (pair%row_normal(pair%dimension, pair%n_rows), pair%row_gap(pair%n_rows))
    call pair%average%multiply(pair%gap, pair%row_gap)
    do c = 1, pair%dimension
      call pair%average%multiply(pair%normal(c, :), pair%row_normal(c, :))
    end do
    do i = 1, pair%n_rows
      pair%row_normal(:, i) = pair%row_normal(:, i)/max(norm2(pair%row_normal(:, i)), tiny(1.0_dp))
    end do
  end subroutine set_rows

  !> Replace the distance by a given gap.
  subroutine given_gap(settings, formula, pair, error)
    type(pair_settings_t), intent(in) :: settings
    type(formula_t), intent(inout) :: formula
    type(contact_pair_t), intent(inout) :: pair
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: x(3)
    integer :: i
    select case (settings%gap_kind)
    case (gap_constant)
      pair%gap = settings%gap
    case (gap_formula)
      x = 0
      do i = 1, pair%n_points
        x(1:pair%dimension) = pair%position(:, i)
        pair%gap(i) = formula%evaluate(x)
        if (.not. is_too_large(pair%gap(i))) cycle
        !$omp critical (message)
        call set_error(error, '&contact '//quoted(settings%name)//': gap_formula is '//to_text(pair%gap(i))//' at ('// &
                       to_text(x(1))//', '//to_text(x(2))//', '//to_text(x(3))//')', exit_bad_input)
        !$omp end critical (message)
        if (ieee_is_finite(pair%gap(i))) error%message = error%message//'; '//size_rule
        return
      end do
    end select
  end subroutine given_gap

  !> The error of a pair without any partner: which reason prevails and what to do.
  subroutine explain_no_projection(pair, name_a, name_b, target, x, radius, error)
    type(contact_pair_t), intent(in) :: pair
    !> Names of the surfaces.
    character(*), intent(in) :: name_a, name_b
    type(master_surface_t), intent(in) :: target
    !> All points (3, n) [length].
    real(dp), intent(in) :: x(:, :)
    !> Greatest distance allowed [length].
    real(dp), intent(in) :: radius
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: reason, advice
    real(dp) :: smallest
    integer :: i, most
    smallest = huge(smallest)
    do i = 1, size(x, 2)
      smallest = min(smallest, target%smallest_distance(x(:, i)))
    end do
    most = max(pair%n_not_facing, pair%n_outside, pair%n_too_far)
    !$omp critical (message)
    if (pair%n_too_far == most) then
      reason = to_text(most)//' are farther than search_radius = '//to_text(radius)
      advice = 'raise search_radius, or check that the bodies are where they should be'
    else if (pair%n_outside == most) then
      reason = to_text(most)//' project beside it'
      advice = 'check that the surfaces lie opposite each other, or extend surface_b'
    else
      reason = 'at '//to_text(most)//' no part of it faces them (n_a . n_b < -0.5)'
      advice = 'check that the two surfaces are the ones that look at each other'
    end if
    call set_error(error, '&contact '//quoted(pair%name)//': none of the '//to_text(pair%n_unprojected)// &
                   ' points of surface_a '//quoted(name_a)//' has a partner on surface_b '//quoted(name_b)//': '// &
                   reason//'; the smallest distance between the surfaces is '//to_text(smallest)//'; '//advice, &
                   exit_bad_input)
    !$omp end critical (message)
  end subroutine explain_no_projection

  !> Resultant of the contact pressure on body a: the forces of the rows, dealt out to their points, along the normals there.
  pure function pair_force(pair, pressure) result(force)
    type(contact_pair_t), intent(in) :: pair
    !> Pressure of the rows (n_rows).
    real(dp), intent(in) :: pressure(:)
    !> (3), z = 0 in two dimensions.
    real(dp) :: force(3)
    real(dp), allocatable :: at_points(:)
    allocate (at_points(pair%n_points))
    call pair%average%multiply_transposed(pair%row_weight*pressure, at_points)
    force = 0
    force(1:pair%dimension) = -matmul(pair%normal, at_points)
  end function pair_force
end module dotyk_contact_pair
