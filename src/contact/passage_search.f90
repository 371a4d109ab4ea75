!> Nodes that have passed wholly through another part: outside before and after deformation, and through two of its
!> faces in between. Thin parts tunnel so.
!>
!> Nodes and facets move along straight lines from their positions before deformation to those after it. A node enters
!> through a face in front of which it starts and behind which it ends, and leaves through another one the other way
!> round.
module dotyk_contact_passage_search
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: pi, same_place
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_contact_tree_search, only: box_neighbourhood_t, tree_walk_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: find_passage, facet_parts, part_corners, place_at_part

  type, public :: swept_facets_t  !! Facets of a part in motion.
    real(dp) :: shift(3) = 0  !! Displacement that is common to the part: motions are relative to it (3) [length].
    real(dp) :: farthest = 0  !! Largest displacement of its nodes relative to it [length].
    type(bounding_volume_tree_t) :: tree  !! Bounding-volume tree of the facets on their way.
  contains
    procedure :: init => swept_init
  end type swept_facets_t

  type, public :: passage_t  !! Way of a node through a part.
    !> Thickness of the part on the way: twice the lesser distance from the faces where it entered and left, in the
    !> middle between them [length].
    real(dp) :: through = 0
    real(dp) :: depth = 0  !! Depth below that face in the end [length].
    integer :: facet = 0  !! Facet that it entered through; 0 if it did not.
  end type passage_t

  integer, parameter :: n_steps = 4  !! Steps of the search for the time of a crossing.
  integer, parameter, public :: max_parts = 6  !! Greatest number of parts of a facet.

  integer, parameter :: lines(2, 2) = reshape([1, 3, 3, 2], [2, 2])  !! Parts by local nodes, of facets of second order.
  integer, parameter :: triangles(3, 4) = reshape([1, 4, 6, 4, 2, 5, 6, 5, 3, 4, 5, 6], [3, 4])
  integer, parameter :: sixths(3, 6) = reshape([1, 5, 8, 5, 2, 6, 6, 3, 7, 7, 4, 8, 5, 6, 7, 5, 7, 8], [3, 6])
  integer, parameter :: halves(3, 2) = reshape([1, 2, 3, 1, 3, 4], [3, 2])  !! Parts of a bilinear quadrilateral.

contains

  !> Bound the facets of a part on their way.
  subroutine swept_init(self, b)
    class(swept_facets_t), intent(out) :: self
    type(solid_t), intent(in) :: b  !! The part.
    type(facet_set_t) :: bounds
    integer :: f, k, n
    self%shift = sum(b%x - b%x0, dim=2)/b%n_nodes
    self%farthest = maxval(norm2(b%x - b%x0 - spread(self%shift, 2, b%n_nodes), 1))
    n = b%set%n
    bounds%n = n
    bounds%dimension = b%dimension
    allocate (bounds%lo(3, n), bounds%hi(3, n), bounds%axis(3, n), bounds%half_angle(n))
    bounds%axis = 0
    bounds%axis(3, :) = 1
    bounds%half_angle = pi
    do f = 1, n
      ! Boxes of deformed facets, and the nodes before deformation with the bulge of their facets.
      bounds%lo(:, f) = b%set%lo(:, f) - self%shift
      bounds%hi(:, f) = b%set%hi(:, f) - self%shift
      do k = 1, b%set%corners(f)
        associate (node => b%surface%node(k, f))
          bounds%lo(:, f) = min(bounds%lo(:, f), b%x0(:, node) - b%roughness(f))
          bounds%hi(:, f) = max(bounds%hi(:, f), b%x0(:, node) + b%roughness(f))
        end associate
      end do
    end do
    call self%tree%init(bounds)
  end subroutine swept_init

  !> Way of a node through a part.
  subroutine find_passage(a, i, b, swept, least, passage)
    type(solid_t), intent(in) :: a  !! The part of the node.
    integer, intent(in) :: i  !! Its node.
    type(solid_t), intent(in) :: b  !! The other part.
    type(swept_facets_t), intent(in) :: swept  !! Its facets in motion.
    real(dp), intent(in) :: least  !! Depth that counts as none, beside the roughness of facets [length].
    type(passage_t), intent(out) :: passage  !! The way; facet 0 where it leads through nothing.
    type(box_neighbourhood_t) :: region
    type(tree_walk_t) :: walk
    real(dp) :: x0(3), x(3), entered, left, at, v(3, 3), w(3, 3), v_exit(3, 3), w_exit(3, 3)
    integer :: part(3, max_parts), entry(3), way_out(3), f, k, n
    x0 = a%x0(:, i)
    x = a%x(:, i)
    region%low = min(x0, x - swept%shift)
    region%high = max(x0, x - swept%shift)
    region%distance = least
    entered = 2
    left = -1
    entry = 0
    way_out = 0
    call walk%start(swept%tree)
    do
      call walk%next(swept%tree, region, f)
      if (f == 0) exit
      ! A node that starts on a face which is flush with it comes through others only.
      if (a%is_flush(i, b, f)) cycle
      call facet_parts(b%surface%node(:, f), b%set%corners(f), n, part)
      do k = 1, n
        call corners_of(part(:, k), v, w)
        call cross_moving(v, w, 1, at)
        if (at < entered) then
          ! Too shallow to count: the roughness of the facet.
          if (-distance_at(v, w, 1.0_dp) <= least + b%roughness(f)) cycle
          entered = at
          entry = part(:, k)
          passage%facet = f
        end if
        call cross_moving(v, w, -1, at)
        if (at <= 1 .and. at > left) then
          left = at
          way_out = part(:, k)
        end if
      end do
    end do
    if (passage%facet == 0 .or. left <= entered) then
      passage%facet = 0
      return
    end if
    call corners_of(entry, v, w)
    call corners_of(way_out, v_exit, w_exit)
    at = (entered + left)/2
    passage%through = 2*min(-distance_at(v, w, at), -distance_at(v_exit, w_exit, at))
    passage%depth = -distance_at(v, w, 1.0_dp)

  contains

    !> Corners of a part of a facet before and after deformation, without the common displacement.
    subroutine corners_of(node, before, after)
      integer, intent(in) :: node(3)  !! Nodes; the third is 0 for lines.
      real(dp), intent(out) :: before(3, 3)  !! Corners before deformation (3, 3) [length].
      real(dp), intent(out) :: after(3, 3)  !! Corners after deformation (3, 3) [length].
      before = part_corners(b%x0, node)
      after = part_corners(b%x, node) - spread(swept%shift, 2, 3)
    end subroutine corners_of

    !> Distance of the node from the plane of a triangle at some time, negative behind it [length].
    real(dp) function distance_at(before, after, time, inside) result(distance)
      real(dp), intent(in) :: before(3, 3)  !! Corners before deformation (3, 3) [length].
      real(dp), intent(in) :: after(3, 3)  !! Corners after deformation (3, 3) [length].
      real(dp), intent(in) :: time  !! Time, from 0 to 1 [].
      real(dp), intent(out), optional :: inside  !! Least barycentric coordinate [].
      real(dp) :: least
      call place_at_part((1 - time)*before + time*after, (1 - time)*x0 + time*(x - swept%shift), distance, least)
      if (present(inside)) inside = least
    end function distance_at

    !> Time at which the node crosses a triangle: from the front (direction 1) or from behind (-1); 2 where it does not.
    subroutine cross_moving(before, after, direction, time)
      real(dp), intent(in) :: before(3, 3)  !! Corners before deformation (3, 3) [length].
      real(dp), intent(in) :: after(3, 3)  !! Corners after deformation (3, 3) [length].
      integer, intent(in) :: direction  !! 1 or -1.
      real(dp), intent(out) :: time  !! Time, from 0 to 1 [].
      real(dp) :: low, high, first, second, value, trial, inside
      integer :: step
      time = 2
      first = direction*distance_at(before, after, 0.0_dp)
      second = direction*distance_at(before, after, 1.0_dp)
      ! Nodes that touch a face start at it.
      if (first < 0 .and. direction > 0 .and. first >= -(least + b%roughness(f))) first = 0
      if (first < 0 .or. second >= 0) return
      low = 0
      high = 1
      trial = 0
      do step = 1, n_steps
        trial = low + (high - low)*first/(first - second)
        value = direction*distance_at(before, after, trial)
        if (value >= 0) then
          low = trial
          first = value
        else
          high = trial
          second = value
        end if
        if (.not. first > 0) exit
      end do
      value = distance_at(before, after, trial, inside)
      if (inside >= -same_place) time = trial
    end subroutine cross_moving
  end subroutine find_passage

  !> Nodes of the parts of a facet, oriented as the facet.
  pure subroutine facet_parts(node, corners, n, part)
    integer, intent(in) :: node(:)  !! Nodes of the facet; those after its own are 0 (max_facet_nodes).
    integer, intent(in) :: corners  !! Number of its corners.
    integer, intent(out) :: n  !! Number of parts.
    integer, intent(out) :: part(3, max_parts)  !! Nodes of each part; the third is 0 for lines (3, max_parts).
    part = 0
    select case (corners)
    case (2)
      n = merge(1, 2, node(3) == 0)
      if (n == 1) part(1:2, 1) = node(1:2)
      if (n == 2) part(1:2, 1:2) = reshape(node([lines]), [2, 2])
    case (3)
      n = merge(1, 4, node(4) == 0)
      if (n == 1) part(:, 1) = node(1:3)
      if (n == 4) part(:, 1:4) = reshape(node([triangles]), [3, 4])
    case default
      n = merge(2, 6, node(5) == 0)
      if (n == 2) part(:, 1:2) = reshape(node([halves]), [3, 2])
      if (n == 6) part(:, 1:6) = reshape(node([sixths]), [3, 6])
    end select
  end subroutine facet_parts

  !> Corners of a part; those of a line are followed by a point above the first one (3, 3) [length].
  pure function part_corners(x, node) result(corner)
    real(dp), intent(in) :: x(:, :)  !! Positions of the nodes (3, n_nodes) [length].
    integer, intent(in) :: node(3)  !! Nodes of the part; the third is 0 for lines.
    real(dp) :: corner(3, 3)
    corner(:, 1:2) = x(:, node(1:2))
    if (node(3) > 0) then
      corner(:, 3) = x(:, node(3))
    else
      ! The normal of a line (dx, dy) is (dy, -dx).
      corner(:, 3) = corner(:, 1) + [0.0_dp, 0.0_dp, norm2(corner(:, 2) - corner(:, 1))]
    end if
  end function part_corners

  !> Place of a point beside a part.
  pure subroutine place_at_part(corner, x, distance, inside)
    real(dp), intent(in) :: corner(3, 3)  !! Corners of the part (3, 3) [length].
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    !> Distance from its plane, negative behind it; 0 for parts without extent [length].
    real(dp), intent(out) :: distance
    !> Least of the barycentric coordinates of its projection, negative beside the part [].
    real(dp), intent(out) :: inside
    real(dp) :: e1(3), e2(3), r(3), normal(3), area, u, v
    e1 = corner(:, 2) - corner(:, 1)
    e2 = corner(:, 3) - corner(:, 1)
    r = x - corner(:, 1)
    normal = cross(e1, e2)
    area = norm2(normal)
    distance = 0
    inside = -1
    if (.not. area > 0) return
    distance = dot_product(normal, r)/area
    u = dot_product(cross(r, e2), normal)/area**2
    v = dot_product(cross(e1, r), normal)/area**2
    inside = min(u, v, 1 - u - v)
  end subroutine place_at_part
end module dotyk_contact_passage_search
