!> Integration points of the slave side of a contact pair, and their projections on the master side.
module dotyk_contact_slave_points
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_mortar, geometry_smooth, quadrature_segments
  use dotyk_base_thresholds, only: of_mesh, pi
  use dotyk_contact_broad_phase, only: candidate_facets, facets_near_candidates
  use dotyk_contact_facet_set, only: facet_position_and_normal
  use dotyk_contact_gap_interpolation, only: add_vertices, interpolate_gaps
  use dotyk_contact_local_depth, only: is_false_overlap
  use dotyk_contact_mortar_segments, only: build_segment_rules
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_contact_projection, only: master_surface_t, project_point, projection_found, projection_not_facing, &
    projection_outside, projection_t, projection_too_far
  use dotyk_contact_segment_quadrature, only: quadrature_rule_t
  use dotyk_contact_smooth_projection, only: smooth_projections
  use dotyk_contact_smooth_sheets, only: sheet_numbers
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds, quadrature_rule
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_division, only: distant_cost, division_t
  implicit none
  private
  public :: project_slave_points

  !> Degree of rules on whole facets for dual mortar rows. The edges of the master surface cut the slave facets, which
  !> the rule has to resolve: with this degree the errors of columns of non-matching blocks are a third to a tenth of
  !> those with twice the order of the elements, and integration points that are not rows cost little. (On mortar
  !> segments the integrals are exact, see mortar_segments.f90.)
  integer, parameter :: mortar_degree = 8

  !> Round-off of a gap, relative to the greatest coordinate: a few units in the last place.
  real(dp), parameter :: gap_round_off = 8*epsilon(1.0_dp)
  !> Fraction of the slave surface below which what mortar segments leave out is rounding of the rules [].
  real(dp), parameter :: nothing_left = 1.0e-6_dp
  integer, parameter :: point_length = 17  !! Numbers that ranks exchange of a point.

contains

  !> Integration points of the slave facets that have a projection on the master surface.
  subroutine project_slave_points(mesh_a, surface_a, slave, mesh_b, surface_b, master, settings, radius, x, pair)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body, relative to a local origin.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(master_surface_t), intent(in) :: slave  !! Slave surface, prepared for projections.
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body, relative to the same origin.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    type(pair_settings_t), intent(in) :: settings  !! Settings of the pair.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    !> Positions of all integration points, also of those without a projection (3, n) [length].
    real(dp), allocatable, intent(out) :: x(:, :)
    type(contact_pair_t), intent(inout) :: pair  !! Pair; its points are set.
    type(quadrature_rule_t) :: kind_rule(n_element_kinds)
    type(quadrature_rule_t), allocatable :: facet_rule(:)
    type(projection_t), allocatable :: projection(:)
    real(dp), allocatable :: weight(:), xi(:, :)
    integer, allocatable :: offset(:)
    integer :: sheet_b(surface_b%n_facets)
    logical, dimension(surface_a%n_facets) :: candidate, examined
    logical :: interpolates
    integer :: f, n, first, last
    call candidate_facets(settings%division, slave%set, master%tree, radius, candidate)
    call settings%division%portion(merge(1.0_dp, distant_cost, candidate), first, last)
    examined = candidate
    examined(:first - 1) = .false.
    examined(last + 1:) = .false.
    call whole_facet_rules(surface_a%kind(1:surface_a%n_facets), &
                           settings%discretization == discretization_mortar, settings%axisymmetric, kind_rule)
    allocate (offset(surface_a%n_facets + 1))
    if (settings%quadrature == quadrature_segments) then
      call build_segment_rules(mesh_a, surface_a, slave%set, examined, mesh_b, surface_b, master, radius, &
                               settings%discretization == discretization_mortar, settings%axisymmetric, kind_rule, &
                               facet_rule)
    else
      allocate (facet_rule(surface_a%n_facets))
    end if
    offset(1) = 0
    do f = first, last
      if (.not. allocated(facet_rule(f)%weight)) facet_rule(f) = kind_rule(surface_a%kind(f))
    end do
    interpolates = settings%geometry == geometry_smooth .and. settings%discretization == discretization_mortar
    if (interpolates) call add_vertices(surface_a, facet_rule)
    do f = 1, surface_a%n_facets
      ! Facets of other ranks have no points here.
      if (.not. allocated(facet_rule(f)%weight)) &
        allocate (facet_rule(f)%xi(mesh_a%dimension - 1, 0), facet_rule(f)%weight(0))
      offset(f + 1) = offset(f) + size(facet_rule(f)%weight)
    end do
    n = offset(surface_a%n_facets + 1)
    allocate (projection(n), x(3, n), weight(n), xi(2, n))
    call project_points(mesh_a, surface_a, facet_rule, offset, settings%axisymmetric, master, candidate, radius, &
                        slave%set%depth, x, xi, weight, projection)
    if (.not. settings%division%any_holds(any(projection%status == projection_found))) then
      ! Project all points, for the reasons in the message.
      candidate = .true.
      call project_points(mesh_a, surface_a, facet_rule, offset, settings%axisymmetric, master, candidate, radius, &
                          slave%set%depth, x, xi, weight, projection)
    end if
    if (settings%geometry == geometry_smooth) then
      call smooth_projections(settings%division, mesh_a%x, surface_a, candidate, mesh_b%x, surface_b, &
                              facets_near_candidates(master%set, slave%set, candidate, radius), slave%set%depth, &
                              master%set%depth, radius, offset, x, xi, projection)
    end if
    call drop_projections_through_bodies(slave, master, x, projection)
    sheet_b = 1
    if (settings%discretization == discretization_mortar .and. .not. settings%is_tie) &
      call sheet_numbers(mesh_b%x, surface_b, master%adjacency, sheet_b)
    if (interpolates) call interpolate_gaps(surface_a, offset, sheet_b, x, xi, weight, projection)
    if (settings%division%is_divided) &
      call collect_points(settings%division, first, last, offset, x, xi, weight, projection)
    call keep_projected(mesh_a%dimension, surface_area(mesh_a, surface_a, kind_rule, settings%axisymmetric), offset, &
                        x, xi, weight, projection, sheet_b, pair)
  end subroutine project_slave_points

  !> Drop the projections that lie deep in a body where the way there leaves it: they are on the wrong side.
  subroutine drop_projections_through_bodies(slave, master, x, projection)
    type(master_surface_t), intent(in) :: slave  !! Slave surface, prepared for projections.
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    real(dp), intent(in) :: x(:, :)  !! Positions of the points (3, n) [length].
    type(projection_t), intent(inout) :: projection(:)  !! Projections of the points (n).
    real(dp) :: foot(3), normal(3), xu(3), xv(3)
    integer :: i
    !$omp parallel do default(none) schedule(dynamic, 256) private(foot, normal, xu, xv) &
    !$omp shared(slave, master, x, projection)
    do i = 1, size(projection)
      if (projection(i)%status /= projection_found) cycle
      ! The elements overlap, whatever the smooth surfaces do.
      call facet_position_and_normal(master%set, projection(i)%facet, projection(i)%xi, foot, normal, xu, xv)
      if (dot_product(x(:, i) - foot, projection(i)%normal) < of_mesh*master%set%size(projection(i)%facet)) cycle
      if (is_false_overlap(slave, master, x(:, i), foot)) projection(i)%status = projection_outside
    end do
    !$omp end parallel do
  end subroutine drop_projections_through_bodies

  !> Points of the facets of all ranks.
  subroutine collect_points(division, first, last, offset, x, xi, weight, projection)
    type(division_t), intent(in) :: division  !! How ranks divide the facets.
    integer, intent(in) :: first  !! First facet of this rank.
    integer, intent(in) :: last  !! Its last facet.
    !> Points of slave facet f are offset(f)+1 .. offset(f+1); of this rank in, of all out (n_facets+1).
    integer, intent(inout) :: offset(:)
    real(dp), allocatable, intent(inout) :: x(:, :)  !! Positions, likewise (3, n) [length].
    real(dp), allocatable, intent(inout) :: xi(:, :)  !! Reference coordinates, likewise (2, n) [].
    real(dp), allocatable, intent(inout) :: weight(:)  !! Weights, likewise (n) [length^2; length in two dimensions].
    !> Projections, likewise; of other ranks without positions, which follow from the facets (n).
    type(projection_t), allocatable, intent(inout) :: projection(:)
    real(dp), allocatable :: list(:, :)
    integer, allocatable :: n_of(:)
    integer :: f, i, n
    n_of = offset(2:) - offset(:size(offset) - 1)
    call division%fill(n_of, first, last)
    do f = 1, size(n_of)
      offset(f + 1) = offset(f) + n_of(f)
    end do
    allocate (list(point_length, size(weight)))
    do i = 1, size(weight)
      list(:, i) = numbers_of(x(:, i), xi(:, i), weight(i), projection(i))
    end do
    call division%append(list)
    n = size(list, 2)
    x = list(1:3, :)
    xi = list(4:5, :)
    weight = list(6, :)
    deallocate (projection)
    allocate (projection(n))
    do i = 1, n
      projection(i)%xi = list(7:8, i)
      projection(i)%normal = list(9:11, i)
      projection(i)%distance = list(12, i)
      projection(i)%status = nint(list(13, i))
      projection(i)%facet = nint(list(14, i))
      projection(i)%bend = list(15, i)
      projection(i)%curved = list(16, i)
      projection(i)%uncertainty = list(17, i)
    end do
  end subroutine collect_points

  !> All numbers of a point: another one does not compile before `point_length` is as great.
  pure function numbers_of(x, xi, weight, projection) result(list)
    real(dp), intent(in) :: x(3)  !! Position (3) [length].
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) [].
    real(dp), intent(in) :: weight  !! Weight [length^2; length in two dimensions].
    type(projection_t), intent(in) :: projection  !! Its projection.
    real(dp) :: list(point_length)
    associate (p => projection)
      list = [x, xi, weight, p%xi, p%normal, p%distance, real(p%status, dp), real(p%facet, dp), p%bend, p%curved, &
              p%uncertainty]
    end associate
  end function numbers_of

  !> Keep the integration points that have a projection and count the others.
  pure subroutine keep_projected(d, whole, offset, x, xi, weight, projection, sheet_b, pair)
    integer, intent(in) :: d  !! Dimension of space.
    real(dp), intent(in) :: whole  !! Area of the slave surface [length^2; length in two dimensions].
    integer, intent(in) :: offset(:)  !! Points of slave facet f are offset(f)+1 .. offset(f+1) (n_facets+1).
    real(dp), intent(in) :: x(:, :)  !! Positions of all points (3, n) [length].
    real(dp), intent(in) :: xi(:, :)  !! Reference coordinates of all points (2, n) [].
    real(dp), intent(in) :: weight(:)  !! Weights of all points (n) [length^2; length in two dimensions].
    type(projection_t), intent(in) :: projection(:)  !! Projections of all points (n).
    integer, intent(in) :: sheet_b(:)  !! Sheets of the master facets (n_facets).
    type(contact_pair_t), intent(inout) :: pair  !! Pair; its points are set.
    integer, allocatable :: list(:)
    real(dp) :: area, left_out
    integer :: f, i, j, k, n, sheet
    n = count(projection%status == projection_found)
    pair%dimension = d
    pair%n_points = n
    pair%n_unprojected = size(projection) - n
    pair%n_not_facing = count(projection%status == projection_not_facing)
    pair%n_outside = count(projection%status == projection_outside)
    pair%n_too_far = count(projection%status == projection_too_far)
    area = max(sum(weight), whole, tiny(1.0_dp))
    ! Rules on mortar segments have points on the covered part of a facet only.
    left_out = max(0.0_dp, area - sum(weight))/area
    if (left_out < nothing_left) left_out = 0
    pair%lost_not_facing = sum(weight, mask=projection%status == projection_not_facing)/area
    pair%lost_outside = sum(weight, mask=projection%status == projection_outside)/area + left_out
    pair%lost_too_far = sum(weight, mask=projection%status == projection_too_far)/area
    allocate (pair%position(d, n), pair%normal(d, n), pair%weight(n), pair%gap(n), pair%bend(n), pair%curved(n), &
              pair%uncertainty(n), pair%facet_a(n), pair%xi_a(d - 1, n), pair%facet_b(n), pair%xi_b(d - 1, n), &
              pair%sheet_b(n))
    k = 0
    do f = 1, size(offset) - 1
      list = pack([(i, i=offset(f) + 1, offset(f + 1))], &
                  projection(offset(f) + 1:offset(f + 1))%status == projection_found)
      do while (size(list) > 0)
        sheet = minval(sheet_b(projection(list)%facet))
        do j = 1, size(list)
          i = list(j)
          if (sheet_b(projection(i)%facet) /= sheet) cycle
          k = k + 1
          pair%position(:, k) = x(1:d, i)
          pair%normal(:, k) = projection(i)%normal(1:d)
          pair%weight(k) = weight(i)
          pair%gap(k) = projection(i)%distance
          pair%bend(k) = projection(i)%bend
          pair%curved(k) = projection(i)%curved
          pair%uncertainty(k) = projection(i)%uncertainty
          pair%facet_a(k) = f
          pair%xi_a(:, k) = xi(1:d - 1, i)
          pair%facet_b(k) = projection(i)%facet
          pair%xi_b(:, k) = projection(i)%xi(1:d - 1)
          pair%sheet_b(k) = sheet
        end do
        list = pack(list, sheet_b(projection(list)%facet) > sheet)
      end do
    end do
    ! Surfaces that touch have a gap of 0, not of the round-off of the coordinates.
    where (abs(pair%gap) <= gap_round_off*maxval(abs(x))) pair%gap = 0
  end subroutine keep_projected

  !> Quadrature rules on whole facets of the kinds in use. Where integration points are rows: twice the order of the
  !> element, one degree more with the radius in the weights.
  subroutine whole_facet_rules(kinds, mortar, axisymmetric, rule)
    integer, intent(in) :: kinds(:)  !! Element kinds of the facets (n_facets).
    logical, intent(in) :: mortar  !! The rows are dual mortar rows; otherwise the integration points are rows.
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(quadrature_rule_t), intent(inout) :: rule(:)  !! Rules, by element kind (n_element_kinds).
    type(element_kind_t) :: kind
    integer :: k, degree
    do k = 1, n_element_kinds
      if (.not. any(kinds == k)) cycle
      kind = element_kind(k)
      degree = 2*kind%order + merge(1, 0, axisymmetric)
      if (mortar) degree = mortar_degree
      call quadrature_rule(k, degree, rule(k)%xi, rule(k)%weight)
    end do
  end subroutine whole_facet_rules

  !> Integration points of one slave facet and their projections.
  pure subroutine points_of_facet(kind, d, x_nodes, points, weights, axisymmetric, master, candidate, radius, &
                                  max_depth, x, xi, weight, projection)
    integer, intent(in) :: kind  !! Element kind of the facet.
    integer, intent(in) :: d  !! Dimension of space, 2 or 3.
    real(dp), intent(in) :: x_nodes(:, :)  !! Coordinates of the nodes of the facet (d, n_nodes) [length].
    real(dp), intent(in) :: points(:, :)  !! Points of the rule (d-1, n) [].
    real(dp), intent(in) :: weights(:)  !! Weights of the rule (n) [].
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(master_surface_t), intent(in) :: master  !! The other surface.
    !> The facet is within the search radius of the master surface, from the broad phase.
    logical, intent(in) :: candidate
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    real(dp), intent(in) :: max_depth  !! Thickness of the slave body at the facet [length].
    real(dp), intent(out) :: x(:, :)  !! Positions (3, n) [length].
    real(dp), intent(out) :: xi(:, :)  !! Reference coordinates (2, n) [].
    real(dp), intent(out) :: weight(:)  !! Weights: areas of the points (n) [length^2; length in two dimensions].
    type(projection_t), intent(out) :: projection(:)  !! Projections on the master surface (n).
    real(dp) :: normal(3), jacobian
    integer :: i, hint
    hint = 0
    x = 0
    xi = 0
    do i = 1, size(weights)
      normal = 0
      call facet_geometry(kind, d, x_nodes, points(:, i), x(1:d, i), normal(1:d), jacobian)
      xi(1:d - 1, i) = points(:, i)
      weight(i) = weights(i)*jacobian
      if (axisymmetric) weight(i) = weight(i)*2*pi*x(1, i)
      if (candidate) then
        call project_point(master, x(:, i), normal, hint, radius, max_depth, projection(i))
      else
        projection(i)%status = projection_too_far
      end if
    end do
  end subroutine points_of_facet

  !> Integration points of all slave facets and their closest-point projections on the master surface.
  subroutine project_points(mesh_a, surface_a, rule, offset, axisymmetric, master, candidate, radius, depth, x, xi, &
                            weight, projection)
    type(body_mesh_t), intent(in) :: mesh_a  !! Body of the slave surface.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(quadrature_rule_t), intent(in) :: rule(:)  !! Quadrature rules of the facets (n_facets).
    integer, intent(in) :: offset(:)  !! Points of facet f are offset(f)+1 .. offset(f+1) (n_facets+1).
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    !> Facets within the search radius of the master surface, from the broad phase (n_facets).
    logical, intent(in) :: candidate(:)
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    real(dp), intent(in) :: depth(:)  !! Thickness of the slave body at the facets (n_facets) [length].
    real(dp), intent(out) :: x(:, :)  !! Positions (3, n) [length].
    real(dp), intent(out) :: xi(:, :)  !! Reference coordinates (2, n) [].
    real(dp), intent(out) :: weight(:)  !! Weights: areas of the points (n) [length^2; length in two dimensions].
    type(projection_t), intent(out) :: projection(:)  !! Projections on the master surface (n).
    integer :: f
    !$omp parallel do default(none) schedule(dynamic, 64) &
    !$omp shared(surface_a, mesh_a, rule, offset, axisymmetric, master, candidate, radius, depth, x, xi, weight) &
    !$omp shared(projection)
    do f = 1, surface_a%n_facets
      associate (first => offset(f) + 1, last => offset(f + 1), kind => surface_a%kind(f))
        call points_of_facet(kind, mesh_a%dimension, mesh_a%x(:, surface_a%node(1:kind_nodes(kind), f)), rule(f)%xi, &
                             rule(f)%weight, axisymmetric, master, candidate(f), radius, depth(f), &
                             x(:, first:last), xi(:, first:last), weight(first:last), projection(first:last))
      end associate
    end do
    !$omp end parallel do
  end subroutine project_points

  !> Area of a surface [length^2; length in two dimensions, with 2 pi r in axisymmetry length^2].
  real(dp) function surface_area(mesh, surface, rule, axisymmetric) result(area)
    type(body_mesh_t), intent(in) :: mesh  !! Body of the surface.
    type(surface_t), intent(in) :: surface  !! The surface.
    type(quadrature_rule_t), intent(in) :: rule(:)  !! Rules on whole facets, by element kind (n_element_kinds).
    logical, intent(in) :: axisymmetric  !! Whether areas include the circumference 2 pi r.
    real(dp) :: x(mesh%dimension), normal(mesh%dimension), jacobian
    integer :: f, i
    area = 0
    do f = 1, surface%n_facets
      associate (kind => surface%kind(f), r => rule(surface%kind(f)))
        do i = 1, size(r%weight)
          call facet_geometry(kind, mesh%dimension, mesh%x(:, surface%node(1:kind_nodes(kind), f)), r%xi(:, i), x, &
                              normal, jacobian)
          area = area + r%weight(i)*jacobian*merge(2*pi*x(1), 1.0_dp, axisymmetric)
        end do
      end associate
    end do
  end function surface_area
end module dotyk_contact_slave_points
