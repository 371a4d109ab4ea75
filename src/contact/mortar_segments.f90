!> Quadrature on mortar segments: segment-to-segment integration of the coupling between slave and master surface (Puso
!> and Laursen, Comput. Methods Appl. Mech. Engrg. 193, 2004; Popp, Gitterle, Gee and Wall, Int. J. Numer. Methods
!> Engrg. 83, 2010).
!>
!> The master shape functions have kinks at facet edges, which a rule on a whole slave facet does not resolve. Here the
!> master facets are projected on each slave facet along its mean normal and clipped (clipping.f90), and each overlap
!> polygon gets a rule of its own. Along one direction the master facets cover their surface once: the segments neither
!> overlap nor leave gaps, whatever the gap and the angle between the surfaces. On flat parallel surfaces the
!> segmentation is exact and so is every integral of products of shape functions; on curved surfaces the segment
!> boundaries lie near the kinks. The master point of a quadrature point is found afterwards, by projection.
!>
!> Slave facets on which segmentation fails keep the rule on the whole facet: where the master surface folds back or has
!> several layers, or where a point of the rule on the whole facet outside all segments has a projection. So do slave
!> facets that no master facet covers; their points are counted as unprojected.
module dotyk_contact_mortar_segments
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: given_rounding, same_number, same_place, shape_rounding
  use dotyk_contact_auxiliary_plane, only: is_affine, auxiliary_plane_t, is_plane_polygon, reference_centre, inverse_map
  use dotyk_contact_clipping, only: mortar_segment_t, segments_of_facet, segments_of_line
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_polygon, only: contains_point
  use dotyk_contact_projection, only: project_point, projection_found, projection_t, master_surface_t
  use dotyk_contact_segment_quadrature, only: append_points, fit_segment_weights, max_degree, polygon_rule, &
    quadrature_rule_t, rule_table_t, shape_degree
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_tri3, kind_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: build_segment_rules

  integer, parameter :: max_fit_degree = 12  !! Greatest degree that is tried for moment fitting.
  !> Least degree of mortar rules on curved or distorted slave facets, whose map is not affine; and where one segment
  !> covers the whole slave facet.
  integer, parameter :: curved_degree = 5, whole_degree = 4
  !> Least degrees of mortar rules on lines: straight with the mid-side node in the middle, and other ones. There the
  !> shape functions of the master facet are not polynomials of the slave coordinate.
  integer, parameter :: line_degree = 4, curved_line_degree = 8

contains

  !> Quadrature rules of all slave facets that are segmented; the other facets get none.
  subroutine build_segment_rules(mesh_a, surface_a, set, candidate, mesh_b, surface_b, master, radius, mortar, &
                                 axisymmetric, whole_rule, rule)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of the slave body.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(facet_set_t), intent(in) :: set  !! Facets of the slave surface.
    logical, intent(in) :: candidate(:)  !! Facets to segment, from the broad phase (n_facets).
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of the master body.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    logical, intent(in) :: mortar  !! The rows are dual mortar rows; otherwise the integration points are rows.
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(quadrature_rule_t), intent(in) :: whole_rule(:)  !! Rules on whole facets, by facet kind (n_element_kinds).
    !> Rules of the slave facets; not allocated where there is no segmentation (n_facets).
    type(quadrature_rule_t), allocatable, intent(out) :: rule(:)
    type(rule_table_t) :: table
    integer :: f, highest
    allocate (rule(surface_a%n_facets))
    highest = max_degree
    ! The rules of high degrees take longer than many a pair; linear triangles need no moment fitting.
    if (all(surface_a%kind(:surface_a%n_facets) == element_tri3) .and. &
        all(surface_b%kind(:surface_b%n_facets) == element_tri3)) &
      highest = max(segment_degree(element_tri3, element_tri3, mortar), curved_degree, whole_degree)
    call table%init(highest)
    !$omp parallel do default(none) schedule(dynamic, 16) &
    !$omp shared(surface_a, mesh_a, surface_b, mesh_b, set, candidate, master, table, radius, mortar, axisymmetric) &
    !$omp shared(whole_rule, rule)
    do f = 1, surface_a%n_facets
      if (.not. candidate(f)) cycle
      if (set%dimension == 2) then
        call segment_rule_2d(set, f, surface_a%kind(f), surface_b, master, table, radius, mortar, axisymmetric, &
                             whole_rule(surface_a%kind(f)), rule(f))
      else
        call segment_rule_3d(set, f, surface_a%kind(f), &
                             mesh_a%x(:, surface_a%node(1:kind_nodes(surface_a%kind(f)), f)), mesh_b, surface_b, &
                             master, table, radius, mortar, whole_rule(surface_a%kind(f)), rule(f))
      end if
    end do
    !$omp end parallel do
  end subroutine build_segment_rules

  !> Degree of the rules on segments. Dual mortar rows: shape functions of either side times the dual functions, which
  !> are linear. Integration points as rows: twice the order of the slave element, and at least the shape functions of
  !> the master facet.
  pure integer function segment_degree(kind_a, kind_b, mortar) result(degree)
    integer, intent(in) :: kind_a  !! Element kind of the slave facet.
    integer, intent(in) :: kind_b  !! Element kind of the master facet.
    logical, intent(in) :: mortar  !! The rows are dual mortar rows.
    type(element_kind_t) :: kind
    kind = element_kind(kind_a)
    degree = max(shape_degree(kind_a), shape_degree(kind_b))
    if (mortar) then
      degree = degree + shape_degree(kind%corner_kind)
    else
      degree = max(degree, 2*kind%order)
    end if
  end function segment_degree

  !> Quadrature rule of a slave facet in three dimensions.
  subroutine segment_rule_3d(set, f, kind, x, mesh_b, surface_b, master, table, radius, mortar, whole_rule, rule)
    type(facet_set_t), intent(in) :: set  !! Facets of the slave surface.
    integer, intent(in) :: f  !! Slave facet.
    integer, intent(in) :: kind  !! Element kind of the facet.
    real(dp), intent(in) :: x(:, :)  !! Coordinates of the nodes of the slave facet (3, n_nodes) [length].
    type(body_mesh_t), intent(in) :: mesh_b  !! Body of the master surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    type(rule_table_t), intent(in) :: table  !! Quadrature rules on reference domains, by degree.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    logical, intent(in) :: mortar  !! The rows are dual mortar rows.
    type(quadrature_rule_t), intent(in) :: whole_rule  !! Rule on the whole facet.
    type(quadrature_rule_t), intent(inout) :: rule  !! Rule; not allocated where segmentation fails.
    type(auxiliary_plane_t) :: plane
    type(mortar_segment_t), allocatable :: segment(:)
    real(dp), allocatable :: points(:, :), weights(:)
    real(dp) :: covered
    integer :: n_segments, n, i, m, degree, kind_b
    logical :: ok, covers_facet, needs_fit, fits
    call plane%init(set, f, x)
    if (.not. plane%area > 0) return
    call segments_of_facet(set, f, plane, mesh_b%x, surface_b, master, n_segments, segment, ok)
    if (.not. ok .or. n_segments == 0) return
    covered = sum([(segment(i)%area, i=1, n_segments)])
    if (covered > (1 + same_number)*plane%area) return
    if (covered < (1 - same_number)*plane%area) then
      if (has_uncovered_projection(set, f, plane, segment(1:n_segments), master, radius, whole_rule)) return
    end if
    n = 0
    do i = 1, n_segments
      kind_b = surface_b%kind(segment(i)%facet)
      degree = segment_degree(kind, kind_b, mortar)
      if (mortar .and. .not. plane%is_polygon) degree = max(degree, curved_degree)
      covers_facet = segment(i)%area >= (1 - given_rounding)*plane%area
      if (covers_facet .and. mortar) degree = max(degree, whole_degree)
      ! Moment fitting: flat facets, of which one is a quadrilateral but not a parallelogram.
      needs_fit = plane%is_polygon .and. &
        .not. (plane%affine .and. is_affine(master%set%coefficient(:, :, segment(i)%facet)))
      if (needs_fit) &
        needs_fit = is_plane_polygon(master%set%corners(segment(i)%facet), &
                                     mesh_b%x(:, surface_b%node(1:kind_nodes(kind_b), segment(i)%facet)), &
                                     plane%axes(:, 3))
      do
        if (covers_facet .and. plane%corners == 3) then
          points = table%triangle(degree)%xi
          weights = table%triangle(degree)%weight
        else if (covers_facet) then
          points = table%square(degree)%xi
          weights = table%square(degree)%weight
        else
          call polygon_rule(segment(i)%polygon, table, degree, m, points, weights, ok)
          if (ok) call to_reference(plane, set%coefficient(:, :, f), points, weights, ok)
        end if
        if (.not. ok .or. .not. needs_fit) exit
        ! At least as many points as moments: both sets of shape functions contain the three linear functions.
        if (size(weights) >= kind_nodes(kind) + kind_nodes(kind_b) - 3) then
          call fit_segment_weights(plane, set, f, kind, master%set, segment(i)%facet, kind_b, segment(i)%polygon, &
                                   table, points, weights, fits)
          if (fits .or. degree >= max_fit_degree) exit
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
  end subroutine segment_rule_3d

  !> Transform a rule from clip coordinates to reference coordinates of the slave facet.
  pure subroutine to_reference(plane, coefficient, points, weights, ok)
    type(auxiliary_plane_t), intent(in) :: plane  !! Auxiliary plane of the slave facet.
    real(dp), intent(in) :: coefficient(3, 9)  !! Coefficients of the facet polynomial (3, 9) [length].
    !> Points in clip coordinates; in reference coordinates on return (2, n) [length, then none].
    real(dp), intent(inout) :: points(:, :)
    real(dp), intent(inout) :: weights(:)  !! Weights, transformed on return (n) [length^2, then none].
    logical, intent(out) :: ok  !! All inverse maps were found.
    real(dp) :: xi(2), determinant
    integer :: i
    ok = .true.
    if (.not. plane%is_polygon) return
    xi = reference_centre(plane%corners)
    do i = 1, size(weights)
      call inverse_map(coefficient, [0.0_dp, 0.0_dp], plane%axes, plane%size, points(:, i), xi, determinant, ok)
      if (.not. ok) return
      points(:, i) = xi
      weights(i) = weights(i)/determinant
    end do
  end subroutine to_reference

  !> Whether a point of the rule on the whole facet that lies in no segment has a projection.
  pure logical function has_uncovered_projection(set, f, plane, segment, master, radius, whole_rule) result(found)
    type(facet_set_t), intent(in) :: set  !! Facets of the slave surface.
    integer, intent(in) :: f  !! Slave facet.
    type(auxiliary_plane_t), intent(in) :: plane  !! Auxiliary plane of the slave facet.
    type(mortar_segment_t), intent(in) :: segment(:)  !! Mortar segments of the facet (n_segments).
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    type(quadrature_rule_t), intent(in) :: whole_rule  !! Rule on the whole facet.
    type(projection_t) :: projection
    real(dp), dimension(3) :: x, normal, xu, xv
    real(dp) :: s(2)
    integer :: i, k, hint
    logical :: inside
    found = .false.
    hint = 0
    do i = 1, size(whole_rule%weight)
      call facet_position_and_normal(set, f, whole_rule%xi(:, i), x, normal, xu, xv)
      s = whole_rule%xi(:, i)
      if (plane%is_polygon) s = plane%to_plane(x)
      inside = .false.
      do k = 1, size(segment)
        inside = contains_point(segment(k)%polygon, s, same_place*sqrt(plane%area))
        if (inside) exit
      end do
      if (inside) cycle
      call project_point(master, x, normal, hint, radius, set%depth(f), projection)
      found = projection%status == projection_found
      if (found) return
    end do
  end function has_uncovered_projection

  !> Quadrature rule of a slave facet in two dimensions.
  subroutine segment_rule_2d(set, f, kind, surface_b, master, table, radius, mortar, axisymmetric, whole_rule, rule)
    type(facet_set_t), intent(in) :: set  !! Facets of the slave surface.
    integer, intent(in) :: f  !! Slave facet.
    integer, intent(in) :: kind  !! Element kind of the facet.
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    type(rule_table_t), intent(in) :: table  !! Quadrature rules on reference domains, by degree.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    logical, intent(in) :: mortar  !! The rows are dual mortar rows.
    logical, intent(in) :: axisymmetric  !! Weights include the circumference 2 pi r.
    type(quadrature_rule_t), intent(in) :: whole_rule  !! Rule on the whole facet.
    type(quadrature_rule_t), intent(inout) :: rule  !! Rule; not allocated where segmentation fails.
    integer, allocatable :: facet(:)
    real(dp), allocatable :: first(:), last(:)
    real(dp), dimension(3) :: x, normal, xu, xv
    type(projection_t) :: projection
    real(dp) :: covered
    integer :: n_segments, n, i, degree, hint
    logical :: ok
    call segments_of_line(set, f, master, n_segments, facet, first, last, ok)
    if (.not. ok .or. n_segments == 0) return
    i = minloc(first(1:n_segments), 1)
    call extend_to_end(set, f, master, radius, facet(i), -1.0_dp, first(i))
    i = maxloc(last(1:n_segments), 1)
    call extend_to_end(set, f, master, radius, facet(i), 1.0_dp, last(i))
    covered = sum(last(1:n_segments) - first(1:n_segments))
    if (covered > 2*(1 + same_number)) return
    if (covered < 2*(1 - same_number)) then
      hint = 0
      do i = 1, size(whole_rule%weight)
        associate (xi => whole_rule%xi(1, i))
          if (any(first(1:n_segments) - same_place < xi .and. xi < last(1:n_segments) + same_place)) cycle
          call facet_position_and_normal(set, f, [xi, 0.0_dp], x, normal, xu, xv)
        end associate
        call project_point(master, x, normal, hint, radius, set%depth(f), projection)
        if (projection%status == projection_found) return
      end do
    end if
    n = 0
    do i = 1, n_segments
      degree = segment_degree(kind, surface_b%kind(facet(i)), mortar) + merge(1, 0, axisymmetric)
      if (mortar) &
        degree = max(degree, merge(curved_line_degree, line_degree, &
                                   maxval(abs(set%coefficient(:, 3, f))) > shape_rounding*set%size(f)))
      associate (r => table%line(degree))
        call append_points((first(i) + last(i))/2 + (last(i) - first(i))/2*r%xi, (last(i) - first(i))/2*r%weight, n, &
                           rule%xi, rule%weight)
      end associate
    end do
    rule%xi = rule%xi(:, 1:n)
    rule%weight = rule%weight(1:n)
  end subroutine segment_rule_2d

  !> Extend the last segment to the end of a slave facet if the points beyond it have projections on the same master
  !> facet. Where the master surface ends above a slave facet along the mean normal of the slave facet, it may still be
  !> reached along its own normal: with a gap s and an angle h/(2R) segments end too early by s h/(2R).
  pure subroutine extend_to_end(set, f, master, radius, facet_b, end_of_facet, end_of_segment)
    type(facet_set_t), intent(in) :: set  !! Facets of the slave surface.
    integer, intent(in) :: f  !! Slave facet.
    type(master_surface_t), intent(in) :: master  !! Master surface, prepared for projections.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    integer, intent(in) :: facet_b  !! Master facet of the segment next to the end.
    real(dp), intent(in) :: end_of_facet  !! End of the slave facet, -1 or 1 [].
    real(dp), intent(inout) :: end_of_segment  !! End of the segment, `end_of_facet` on return if it was extended [].
    !> Positions between the ends of the segment and the facet that are projected.
    real(dp), parameter :: fraction(3) = [0.05_dp, 0.5_dp, 0.95_dp]
    type(projection_t) :: projection
    real(dp), dimension(3) :: x, normal, xu, xv
    integer :: i, hint
    if (.not. abs(end_of_facet - end_of_segment) > same_number) return
    hint = facet_b
    do i = 1, size(fraction)
      call facet_position_and_normal(set, f, [end_of_segment + fraction(i)*(end_of_facet - end_of_segment), 0.0_dp], &
                                     x, normal, xu, xv)
      call project_point(master, x, normal, hint, radius, set%depth(f), projection)
      if (projection%status /= projection_found .or. projection%facet /= facet_b) return
    end do
    end_of_segment = end_of_facet
  end subroutine extend_to_end
end module dotyk_contact_mortar_segments
