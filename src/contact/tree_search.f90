!> Searches in the bounding-volume tree of a surface: the facets in a region, and the nearest facet to a point.
!>
!> A region is visited by one depth-first traversal (`tree_walk_t`), which the broad phase stops at the first facet
!> and the narrow phase runs to the end. The nearest facet is found by branch and bound, nearest child first
!> (Roussopoulos, Kelley and Vincent, Nearest neighbor queries, SIGMOD 1995). Its result is the least in the order
!> (distance, facet number), which depends neither on the shape of the tree nor on where the search starts nor on
!> threads.
module dotyk_contact_tree_search
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_base_thresholds, only: rounding
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_t, bounding_volume_tree_t, facing_cosine, stack_size
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  implicit none
  private

  type, abstract, public :: region_t  !! Region of space and of normals, in which facets are searched.
  contains
    procedure(misses_volume), deferred :: misses
  end type region_t

  abstract interface
    !> Whether the bounds of a node or facet lie outside the region.
    pure logical function misses_volume(self, volume)
      import :: bounding_volume_t, region_t
      class(region_t), intent(in) :: self
      type(bounding_volume_t), intent(in) :: volume  !! Bounds.
    end function misses_volume
  end interface

  !> Points within a distance of an axis-aligned box, normals of any direction.
  type, extends(region_t), public :: box_neighbourhood_t
    real(dp) :: low(3) = 0  !! Lower corner of the box (3) [length].
    real(dp) :: high(3) = 0  !! Upper corner of the box (3) [length].
    real(dp) :: distance = 0  !! Distance [length].
  contains
    procedure :: misses => neighbourhood_misses
  end type box_neighbourhood_t

  type, extends(region_t), public :: oriented_box_t  !! Box along given axes, normals of any direction.
    real(dp) :: origin(3) = 0  !! Origin of the box (3) [length].
    real(dp) :: axes(3, 3) = 0  !! Unit vectors along the box (3, 3) [].
    real(dp) :: low(3) = 0  !! Lower corner along the axes, relative to the origin (3) [length].
    real(dp) :: high(3) = 0  !! Upper corner along the axes, relative to the origin (3) [length].
  contains
    procedure :: misses => box_misses
  end type oriented_box_t

  type, extends(oriented_box_t), public :: facing_box_t  !! Box along given axes, and normals that face a direction.
    real(dp) :: toward(3) = 0  !! Direction that the normals have to face: normal . toward > facing_cosine (3) [].
  contains
    procedure :: misses => facing_box_misses
  end type facing_box_t

  type, public :: tree_walk_t  !! Depth-first traversal of a tree, which yields the facets of a region one by one.
    private
    integer :: waiting(stack_size)  !! Nodes still to be visited (stack_size); the first `n_waiting` are set.
    integer :: n_waiting = 0  !! Number of these nodes.
    integer :: position = 1  !! Facets of the current leaf still to be visited are tree%order(position:last).
    integer :: last = 0  !! End of these facets.
  contains
    procedure :: start => walk_start
    procedure :: next => walk_next
  end type tree_walk_t

  public :: facets_in_region, nearest_facet

contains

  !> Begin at the root.
  pure subroutine walk_start(self, tree)
    class(tree_walk_t), intent(inout) :: self
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface, which may have no facets.
    self%waiting(1) = 1
    self%n_waiting = min(1, size(tree%order))
    self%position = 1
    self%last = 0
  end subroutine walk_start

  !> Go to the next facet whose bounding volume meets a region.
  pure subroutine walk_next(self, tree, region, facet)
    class(tree_walk_t), intent(inout) :: self
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    class(region_t), intent(in) :: region  !! Region; the same in all steps of a traversal.
    integer, intent(out) :: facet  !! Facet number; 0 at the end.
    integer :: node
    do
      do while (self%position <= self%last)
        facet = tree%order(self%position)
        self%position = self%position + 1
        if (.not. region%misses(tree%facet_volume(facet))) return
      end do
      facet = 0
      if (self%n_waiting == 0) return
      node = self%waiting(self%n_waiting)
      self%n_waiting = self%n_waiting - 1
      if (region%misses(tree%volume(node))) cycle
      if (tree%child(node) > 0) then
        self%waiting(self%n_waiting + 1:self%n_waiting + 2) = [tree%child(node), tree%child(node) + 1]
        self%n_waiting = self%n_waiting + 2
      else
        self%position = tree%first(node)
        self%last = tree%last(node)
      end if
    end do
  end subroutine walk_next

  !> Whether the box of a volume is farther away than the distance.
  pure logical function neighbourhood_misses(self, volume) result(misses)
    class(box_neighbourhood_t), intent(in) :: self
    type(bounding_volume_t), intent(in) :: volume  !! Bounds of a node or facet.
    misses = .not. sum(max(volume%lo - self%high, self%low - volume%hi, 0.0_dp)**2) <= self%distance**2
  end function neighbourhood_misses

  !> Whether the box of a volume lies beside the box along one of the axes of the latter.
  pure logical function box_misses(self, volume) result(misses)
    class(oriented_box_t), intent(in) :: self
    type(bounding_volume_t), intent(in) :: volume  !! Bounds of a node or facet.
    real(dp) :: centre, half
    integer :: k
    misses = .false.
    do k = 1, 3
      centre = dot_product((volume%lo + volume%hi)/2 - self%origin, self%axes(:, k))
      half = dot_product((volume%hi - volume%lo)/2, abs(self%axes(:, k)))
      misses = misses .or. centre + half < self%low(k) .or. centre - half > self%high(k)
    end do
  end function box_misses

  !> Whether no normal faces the direction, or the box of a volume lies beside the box.
  pure logical function facing_box_misses(self, volume) result(misses)
    class(facing_box_t), intent(in) :: self
    type(bounding_volume_t), intent(in) :: volume  !! Bounds of a node or facet.
    misses = dot_product(volume%axis, self%toward) < volume%limit
    if (.not. misses) misses = self%oriented_box_t%misses(volume)
  end function facing_box_misses

  !> Facets whose bounding volumes meet a region, ascending.
  pure subroutine facets_in_region(tree, region, list)
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    class(region_t), intent(in) :: region  !! Region.
    integer, allocatable, intent(out) :: list(:)  !! Facets (n).
    !> Facets that there is room for at first: more than the region around one facet has, as a rule. So many are sorted
    !> by insertion.
    integer, parameter :: first_room = 16
    type(tree_walk_t) :: walk
    integer, allocatable :: found(:), more(:), order(:)
    integer :: facet, n, j
    allocate (found(first_room))
    n = 0
    call walk%start(tree)
    do
      call walk%next(tree, region, facet)
      if (facet == 0) exit
      if (n == size(found)) then
        allocate (more(2*n))
        more(1:n) = found
        call move_alloc(more, found)
      end if
      n = n + 1
      found(n) = facet
      if (n > first_room) cycle
      do j = n - 1, 1, -1
        if (found(j) < facet) exit
        found(j + 1) = found(j)
        found(j) = facet
      end do
    end do
    if (n > first_room) then
      allocate (order(n))
      call sort_order(found(1:n), order)
      list = found(order)
      return
    end if
    list = found(1:n)
  end subroutine facets_in_region

  !> The facet nearest to a point among those whose normal at the closest point faces a direction, and behind which the
  !> point does not lie deeper than a body is thick; the lowest number of equally near ones.
  pure subroutine nearest_facet(tree, set, x, toward, any_normal, max_depth, hint, facet, xi, square)
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp), intent(in) :: toward(3)  !! Direction that the normal has to face: normal . toward > facing_cosine (3) [].
    logical, intent(in) :: any_normal  !! Normals of all directions are accepted, and all depths.
    !> Greatest depth of the point behind a facet; the thickness behind the facet itself limits the depth too [length].
    real(dp), intent(in) :: max_depth
    !> A facet that is probably near, examined first, or 0; it affects the time, not the result.
    integer, intent(in) :: hint
    integer, intent(out) :: facet  !! The nearest facet; 0 if none faces the direction.
    real(dp), intent(out) :: xi(2)  !! Reference coordinates of the closest point (2) [].
    real(dp), intent(out) :: square  !! Squared distance [length^2].
    integer :: waiting(stack_size), n, node, i, near, far
    !> No farther than this, squared, is the facet [length^2].
    real(dp) :: limit
    real(dp) :: waiting_square(stack_size), near_square, far_square, bound
    limit = huge(limit)
    facet = 0
    xi = 0
    square = huge(square)
    if (set%n == 0) return
    if (hint > 0) call examine(tree, set, x, toward, any_normal, max_depth, limit, hint, facet, xi, square)
    n = 1
    waiting(1) = 1
    waiting_square(1) = square_to_box(tree%volume(1), x)
    do while (n > 0)
      node = waiting(n)
      bound = waiting_square(n)
      n = n - 1
      if (bound > min(square, limit)) cycle
      if (.not. any_normal) then
        if (dot_product(tree%volume(node)%axis, toward) < tree%volume(node)%limit) cycle
      end if
      if (tree%child(node) == 0) then
        if (any_normal) limit = min(limit, minval([(square_to_node(set, tree%order(i), x), &
                                                    i=tree%first(node), tree%last(node))]))
        do i = tree%first(node), tree%last(node)
          if (tree%order(i) == hint) cycle
          call examine(tree, set, x, toward, any_normal, max_depth, limit, tree%order(i), facet, xi, square)
        end do
        cycle
      end if
      near = tree%child(node)
      far = near + 1
      near_square = square_to_box(tree%volume(near), x)
      far_square = square_to_box(tree%volume(far), x)
      if (far_square < near_square) then
        waiting(n + 1:n + 2) = [near, far]
        waiting_square(n + 1:n + 2) = [near_square, far_square]
      else
        waiting(n + 1:n + 2) = [far, near]
        waiting_square(n + 1:n + 2) = [far_square, near_square]
      end if
      n = n + 2
    end do
  end subroutine nearest_facet

  !> Keep a facet if it is nearer than the best one so far and faces the direction.
  pure subroutine examine(tree, set, x, toward, any_normal, max_depth, limit, candidate, facet, xi, square)
    type(bounding_volume_tree_t), intent(in) :: tree  !! Bounding-volume tree of the surface.
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp), intent(in) :: toward(3)  !! Direction that the normal has to face (3) [].
    logical, intent(in) :: any_normal  !! Normals of all directions are accepted, and all depths.
    real(dp), intent(in) :: max_depth  !! Greatest depth of the point behind a facet [length].
    real(dp), intent(in) :: limit  !! Squared distance beyond which no facet counts [length^2].
    integer, intent(in) :: candidate  !! The facet to examine.
    integer, intent(inout) :: facet  !! The nearest facet so far.
    real(dp), intent(inout) :: xi(2)  !! Reference coordinates of its closest point (2) [].
    real(dp), intent(inout) :: square  !! Its squared distance [length^2].
    real(dp) :: point(2), candidate_square, position(3), normal(3), xu(3), xv(3), q(3), bound
    bound = min(square, limit)
    if (.not. any_normal) then
      if (dot_product(tree%facet_volume(candidate)%axis, toward) < tree%facet_volume(candidate)%limit) return
    end if
    if (square_to_box(tree%facet_volume(candidate), x) > bound) return
    q = x - set%origin(:, candidate)
    if (bound < huge(bound)) then
      if (set%hull(candidate)%is_beyond(q, bound)) return
    end if
    call closest_point_on_facet(set, candidate, x, point, candidate_square)
    if (candidate_square > square) return
    if (.not. candidate_square < square .and. candidate > facet) return
    if (.not. any_normal) then
      call facet_position_and_normal(set, candidate, point, position, normal, xu, xv)
      if (.not. dot_product(normal, toward) > facing_cosine) return
      ! The far side of a thin body faces the point too, through the body.
      if (dot_product(normal, position - x) > min(max_depth, set%depth(candidate))) return
    end if
    facet = candidate
    xi = point
    square = candidate_square
  end subroutine examine

  !> Squared distance of a point to the first node of a facet, with a margin for rounding: no facet is farther than its
  !> node [length^2].
  pure real(dp) function square_to_node(set, facet, x) result(square)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: facet  !! Facet.
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    square = (norm2(x - set%origin(:, facet)) + rounding*(set%size(facet) + maxval(abs(x))))**2
  end function square_to_node

  !> Squared distance of a point to the box of a volume, 0 inside [length^2].
  pure real(dp) function square_to_box(volume, x) result(square)
    type(bounding_volume_t), intent(in) :: volume  !! Bounds of a node or facet.
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    real(dp) :: d(3)
    d = max(volume%lo - x, x - volume%hi, 0.0_dp)
    square = d(1)**2 + d(2)**2 + d(3)**2
  end function square_to_box
end module dotyk_contact_tree_search
