!> Thickness of a body behind the facets of a contact surface that has both of its sides.
!>
!> Where one contact surface holds both sides of a thin body, each side faces the other bodies on the far side as well,
!> through the body. A point can lie behind a facet by no more than the body is thick there: what lies deeper is no
!> overlap but the wrong side. Nor is there an overlap where the way from a point to its projection leaves one of the
!> bodies.
!>
!> Overlaps that are none are projections on the wrong side of a body.
module dotyk_contact_local_depth
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: of_mesh, same_place
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_projection, only: master_surface_t
  use dotyk_contact_tree_search, only: facets_in_region, oriented_box_t
  use dotyk_mesh_facet, only: frame_of_normal
  use dotyk_ranks_division, only: division_t
  implicit none
  private
  public :: find_depths, leaves_body, is_false_overlap

  !> A ray meets a facet where it comes closer to it than this, relative to the size of that facet.
  real(dp), parameter :: hit_tolerance = 0.05_dp
  !> A ray leaves the body where the cosine of its angle with the normal exceeds this.
  real(dp), parameter :: min_exit_cosine = 0.1_dp
  !> Ends of the way from a surface point into the body that do not count, relative to its length. Beside an edge the
  !> way may leave the body soon after it began.
  real(dp), parameter :: last_margin = 0.05_dp
  integer, parameter :: n_steps = 4  !! Steps to the intersection of a ray with a curved facet.
  !> A point lies as deep in a body as its boundary is near: a projection this many times farther away is another side.
  real(dp), parameter :: most_ratio = 3

contains

  !> Set the depths of the facets of a surface.
  subroutine find_depths(division, tree, neighbour, limit, set)
    type(division_t), intent(in) :: division  !! How ranks divide the facets.
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    integer, intent(in) :: neighbour(:, :)  !! Facet across each edge, 0 at the boundary of the surface (4, n_facets).
    real(dp), intent(in) :: limit  !! Greatest depth of interest [length].
    !> Facets of the surface; `depth` is set, to a huge number where no facet of the surface lies behind.
    type(facet_set_t), intent(inout) :: set
    real(dp), allocatable :: depth(:)
    integer :: f, k, first, last
    allocate (depth(set%n))
    call division%portion(set%n, first, last)
    !$omp parallel do default(none) schedule(dynamic, 64) shared(tree, limit, set, depth, first, last)
    do f = first, last
      depth(f) = depth_behind(tree, set, f, limit)
    end do
    !$omp end parallel do
    call division%fill(depth, first, last)
    set%depth = depth
    ! The ray may miss the other side at the end of a body: neighbours know the thickness there.
    do f = 1, set%n
      if (depth(f) < huge(depth)) cycle
      do k = 1, set%corners(f)
        if (neighbour(k, f) > 0) set%depth(f) = min(set%depth(f), depth(neighbour(k, f)))
      end do
    end do
  end subroutine find_depths

  !> Distance from the middle of a facet against its normal to the nearest facet seen from inside; huge if there is none
  !> [length].
  pure real(dp) function depth_behind(tree, set, f, limit) result(depth)
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: f  !! Facet number.
    real(dp), intent(in) :: limit  !! Greatest depth of interest [length].
    real(dp), dimension(3) :: centre, normal, xu, xv
    real(dp) :: xi(2)
    xi = merge(1/3.0_dp, 0.0_dp, set%corners(f) == 3)
    call facet_position_and_normal(set, f, xi, centre, normal, xu, xv)
    depth = huge(depth)
    if (norm2(normal) > 0) depth = first_exit(tree, set, centre, -normal, same_place*set%size(f), limit)
  end function depth_behind

  !> Whether the straight way from one point to another leaves the body of a surface in between.
  pure logical function leaves_body(tree, set, from, to)
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    real(dp), intent(in) :: from(3)  !! First point (3) [length].
    real(dp), intent(in) :: to(3)  !! Second point (3) [length].
    real(dp) :: length
    length = norm2(to - from)
    leaves_body = .false.
    if (.not. length > 0) return
    leaves_body = first_exit(tree, set, from, (to - from)/length, same_place*length, (1 - last_margin)*length) < &
      (1 - last_margin)*length
  end function leaves_body

  !> Distance along a ray to the first facet that it leaves the body through; huge if there is none [length].
  pure real(dp) function first_exit(tree, set, origin, direction, low, high) result(distance)
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    real(dp), intent(in) :: origin(3)  !! Origin of the ray (3) [length].
    real(dp), intent(in) :: direction(3)  !! Its direction, a unit vector (3) [].
    real(dp), intent(in) :: low  !! Beginning of the part of the ray that counts [length].
    real(dp), intent(in) :: high  !! Its end [length].
    type(oriented_box_t) :: beam
    integer, allocatable :: list(:)
    real(dp), dimension(3) :: position, normal, xu, xv
    real(dp) :: xi(2), square, t, cosine
    integer :: i, step
    distance = huge(distance)
    call frame_of_normal(3, direction, beam%axes)
    beam%origin = origin
    beam%low = [0.0_dp, 0.0_dp, low]
    beam%high = [0.0_dp, 0.0_dp, high]
    call facets_in_region(tree, beam, list)
    do i = 1, size(list)
      t = (low + high)/2
      if (high > huge(high)/2) t = low
      do step = 1, n_steps
        call closest_point_on_facet(set, list(i), origin + t*direction, xi, square)
        call facet_position_and_normal(set, list(i), xi, position, normal, xu, xv)
        cosine = dot_product(normal, direction)
        if (.not. cosine > min_exit_cosine) exit
        ! The ray meets the tangent plane there.
        t = dot_product(position - origin, normal)/cosine
        if (set%affine(list(i))) exit
      end do
      if (.not. cosine > min_exit_cosine .or. .not. (t > low .and. t < high)) cycle
      call closest_point_on_facet(set, list(i), origin + t*direction, xi, square)
      if (square <= (hit_tolerance*set%size(list(i)))**2) distance = min(distance, t)
    end do
  end function first_exit

  !> Whether the overlap between a point of one surface and its projection on another is none: the way there leaves one
  !> of the bodies, or another face is much nearer.
  pure logical function is_false_overlap(surface, other, x, foot)
    type(master_surface_t), intent(in) :: surface  !! Surface of the point.
    type(master_surface_t), intent(in) :: other  !! The other surface.
    real(dp), intent(in) :: x(3)  !! The point (3) [length].
    real(dp), intent(in) :: foot(3)  !! Its projection (3) [length].
    real(dp) :: depth
    depth = norm2(foot - x)
    is_false_overlap = depth > most_ratio*other%smallest_distance(x)
    if (.not. is_false_overlap) is_false_overlap = depth > most_ratio*surface%smallest_distance(foot)
    if (.not. is_false_overlap) is_false_overlap = leaves_body(surface%tree, surface%set, x, foot)
    if (.not. is_false_overlap) is_false_overlap = leaves_body(other%tree, other%set, foot, x)
  end function is_false_overlap
end module dotyk_contact_local_depth
