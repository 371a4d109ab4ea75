!> Whether two boundary facets of different bodies may come into contact: geometry of single facets.
module dotyk_contact_facing_facets
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: same_number
  use dotyk_contact_body_faces, only: body_faces_t
  use dotyk_contact_facet_distance, only: polygon_distance, polygons_overlap
  implicit none
  private
  public :: compare_facets, search_distance

  !> Search distance where none is given, as a fraction of the diameter of the smaller body [].
  real(dp), parameter :: default_fraction = 0.1_dp
  !> Facets face each other where the cosine of the angle between their normals is below this: 84 degrees between one
  !> normal and the reverse of the other [].
  real(dp), parameter :: facing_limit = -0.1_dp
  !> Greatest initial overlap, as a fraction of the diameter of the smaller body [].
  real(dp), parameter, public :: greatest_overlap = 0.05_dp
contains

  !> Search distance of two bodies [length].
  pure real(dp) function search_distance(a, b, given) result(distance)
    type(body_faces_t), intent(in) :: a  !! First body.
    type(body_faces_t), intent(in) :: b  !! Second body.
    real(dp), intent(in) :: given  !! Distance that the user gives, or 0 [length].
    distance = given
    if (.not. given > 0) distance = default_fraction*min(a%diameter, b%diameter)
  end function search_distance

  !> Whether two facets face each other within the search distance, in front of each other or with a small overlap.
  pure subroutine compare_facets(a, f, b, g, reach, overlap, behind_a, behind_b, meets, distance, opposite)
    type(body_faces_t), intent(in) :: a  !! First body.
    integer, intent(in) :: f  !! Its facet.
    type(body_faces_t), intent(in) :: b  !! Second body.
    integer, intent(in) :: g  !! Its facet.
    real(dp), intent(in) :: reach  !! Search distance [length].
    real(dp), intent(in) :: overlap  !! Greatest initial overlap [length].
    !> Thickness of the first body behind its facets; negative where it is not known yet (a%n) [length].
    real(dp), intent(inout) :: behind_a(:)
    real(dp), intent(inout) :: behind_b(:)  !! The same of the second body (b%n) [length].
    logical, intent(out) :: meets  !! Whether they do.
    real(dp), intent(out) :: distance  !! Their distance; negative where they overlap [length].
    logical, intent(out) :: opposite  !! Whether they lie opposite each other, seen along their normals.
    real(dp) :: toward(3), at_f(3), at_g(3), depth, cosine, angle
    meets = .false.
    opposite = .false.
    distance = 0
    cosine = dot_product(a%normal(:, f), b%normal(:, g))
    if (cosine >= facing_limit) then
      angle = acos(min(1.0_dp, cosine)) + a%half_angle(f) + b%half_angle(g)
      if (angle < acos(facing_limit)) return
    end if
    call polygon_distance(a%n_corners(f), a%corner(:, :a%n_corners(f), f), b%n_corners(g), &
                          b%corner(:, :b%n_corners(g), g), distance, at_f, at_g)
    if (distance > reach + a%bulge(f) + b%bulge(g)) return
    toward = a%normal(:, f) - b%normal(:, g)
    ! Normals of one direction, of facets that bend so far: neither lies in front of the other.
    if (.not. norm2(toward) > sqrt(epsilon(cosine))) return
    toward = toward/norm2(toward)
    meets = .true.
    depth = dot_product(at_f - at_g, toward)
    if (depth > a%bulge(f) + b%bulge(g) + same_number*(a%diameter + b%diameter)) then
      distance = -distance
      meets = depth <= overlap
      if (meets) then
        if (behind_a(f) < 0) behind_a(f) = thickness(a, f)
        if (behind_b(g) < 0) behind_b(g) = thickness(b, g)
        meets = 2*depth <= min(behind_a(f), behind_b(g))
      end if
    end if
    if (meets) opposite = polygons_overlap(a%n_corners(f), a%corner(:, :a%n_corners(f), f), b%n_corners(g), &
                                           b%corner(:, :b%n_corners(g), g), toward)
  end subroutine compare_facets

  !> Thickness of a body behind a facet, from the centre of the facet; huge where it is open [length].
  pure real(dp) function thickness(faces, facet)
    type(body_faces_t), intent(in) :: faces  !! The body.
    integer, intent(in) :: facet  !! Its facet.
    real(dp) :: enters, leaves
    call faces%cross_along(faces%centre(facet), -faces%normal(:, facet), 0.0_dp, 2*faces%diameter, facet, enters, &
                           leaves)
    thickness = leaves
  end function thickness
end module dotyk_contact_facing_facets
