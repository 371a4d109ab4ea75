!> Bounding-volume tree over the facets of a surface, and the nearest facet to a point by branch and bound.
!>
!> Every node has a box that contains its facets and a cone that contains their normals, so that parts of the surface
!> that are too far or face the wrong way are passed over. Building costs N log N; the answer is the least in the
!> order (distance, facet number), which does not depend on the shape of the tree, on where the search starts, or on
!> threads.
module dotyk_contact_bounding_volume_tree
  use dotyk_base_kinds, only: dp
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  implicit none
  private

  !> The tree. Node 1 is the root; a node that is not a leaf has the children child and child+1.
  type, public :: bounding_volume_tree_t
    !> Number of nodes.
    integer :: n_nodes = 0
    !> Boxes (3, n_nodes) [length].
    real(dp), allocatable :: lo(:, :), hi(:, :)
    !> Axes of the normals' cones (3, n_nodes).
    real(dp), allocatable :: axis(:, :)
    !> No normal of the node faces a direction m (m.n > facing_cosine) where m.axis is below this (n_nodes).
    real(dp), allocatable :: limit(:)
    !> First child; 0 for a leaf (n_nodes).
    integer, allocatable :: child(:)
    !> Facets of a node: order(first:last) (n_nodes).
    integer, allocatable :: first(:), last(:)
    !> Facets in the order of the tree (number of facets).
    integer, allocatable :: order(:)
    !> The same limit for each facet (number of facets).
    real(dp), allocatable :: facet_limit(:)
  contains
    procedure :: init => tree_init
  end type bounding_volume_tree_t

  public :: facets_in_box, nearest_facet

  !> Normals face each other where n_a . n_b < -facing_cosine (DESIGN.md, section 4).
  real(dp), parameter, public :: facing_cosine = 0.5_dp
  !> Facets in a leaf, at most.
  integer, parameter :: leaf_size = 4
  !> Greatest number of nodes that wait: the depth of a tree that halves is below 32.
  integer, parameter :: stack_size = 128
  real(dp), parameter :: pi = acos(-1.0_dp)

contains

  !> Build the tree.
  subroutine tree_init(self, set)
    class(bounding_volume_tree_t), intent(out) :: self
    !> Facets of the surface.
    type(facet_set_t), intent(in) :: set
    real(dp), allocatable :: centre(:, :)
    real(dp) :: low(3), high(3), half_angle
    integer :: i, n, node, most, middle
    n = set%n
    most = max(1, 2*n)
    allocate (self%lo(3, most), self%hi(3, most), self%axis(3, most), self%limit(most), self%child(most), &
              self%first(most), self%last(most), self%facet_limit(n), centre(3, n))
    self%order = [(i, i=1, n)]
    do i = 1, n
      centre(:, i) = (set%lo(:, i) + set%hi(:, i))/2
      self%facet_limit(i) = cone_limit(set%half_angle(i))
    end do
    self%n_nodes = 1
    self%first(1) = 1
    self%last(1) = n
    node = 0
    do while (node < self%n_nodes)
      node = node + 1
      associate (first => self%first(node), last => self%last(node))
        call bound_facets(self%order(first:last), set%lo, set%hi, set%axis, set%half_angle, &
                          self%lo(:, node), self%hi(:, node), self%axis(:, node), half_angle)
        self%limit(node) = cone_limit(half_angle)
        self%child(node) = 0
        if (last - first < leaf_size) cycle
        low = huge(low)
        high = -huge(high)
        do i = first, last
          low = min(low, centre(:, self%order(i)))
          high = max(high, centre(:, self%order(i)))
        end do
        middle = (first + last)/2
        call split(self%order, first, last, middle, centre, maxloc(high - low, dim=1))
        self%child(node) = self%n_nodes + 1
        self%first(self%n_nodes + 1) = first
        self%last(self%n_nodes + 1) = middle
        self%first(self%n_nodes + 2) = middle + 1
        self%last(self%n_nodes + 2) = last
        self%n_nodes = self%n_nodes + 2
      end associate
    end do
  end subroutine tree_init

  !> Box and cone of normals of a list of facets.
  pure subroutine bound_facets(list, lo, hi, axis, half_angle, low, high, mean, widest)
    !> Facets.
    integer, intent(in) :: list(:)
    !> Boxes and cones of all facets (3, n), (n).
    real(dp), intent(in) :: lo(:, :), hi(:, :), axis(:, :), half_angle(:)
    !> Box of the list (3).
    real(dp), intent(out) :: low(3), high(3)
    !> Axis of the cone (3).
    real(dp), intent(out) :: mean(3)
    !> Its half angle [rad].
    real(dp), intent(out) :: widest
    real(dp) :: length
    integer :: i
    low = huge(low)
    high = -huge(high)
    mean = 0
    do i = 1, size(list)
      low = min(low, lo(:, list(i)))
      high = max(high, hi(:, list(i)))
      mean = mean + axis(:, list(i))
    end do
    widest = pi
    length = norm2(mean)
    if (length < 0.01_dp*size(list)) then
      mean = 0   ! normals in all directions: nothing is passed over
      return
    end if
    mean = mean/length
    widest = 0
    do i = 1, size(list)
      widest = max(widest, half_angle(list(i)) + acos(max(-1.0_dp, min(1.0_dp, dot_product(mean, axis(:, list(i)))))))
    end do
    widest = min(pi, widest)
  end subroutine bound_facets

  !> Cosine of the greatest angle between a direction and the axis at which a normal of the cone may face that
  !> direction.
  pure real(dp) function cone_limit(half_angle) result(limit)
    !> Half angle of the cone [rad].
    real(dp), intent(in) :: half_angle
    real(dp) :: angle
    angle = acos(facing_cosine) + half_angle + 1e-6_dp   ! rather too wide than too narrow by round-off of acos
    limit = -2
    if (angle < pi) limit = cos(angle)
  end function cone_limit

  !> Reorder order(first:last) so that the facets up to middle come before the others in the order (coordinate, number).
  pure subroutine split(order, first, last, middle, centre, axis)
    !> Facet numbers.
    integer, intent(inout) :: order(:)
    integer, intent(in) :: first, last, middle
    !> Centres of the facets (3, n).
    real(dp), intent(in) :: centre(:, :)
    !> Coordinate to compare.
    integer, intent(in) :: axis
    integer :: low, high, i, j, pivot, swap
    low = first
    high = last
    do while (low < high)
      pivot = order((low + high)/2)
      i = low
      j = high
      do
        do while (before(order(i), pivot))
          i = i + 1
        end do
        do while (before(pivot, order(j)))
          j = j - 1
        end do
        if (i > j) exit
        swap = order(i)
        order(i) = order(j)
        order(j) = swap
        i = i + 1
        j = j - 1
        if (i > j) exit
      end do
      if (middle <= j) then
        high = j
      else if (middle >= i) then
        low = i
      else
        return
      end if
    end do

  contains

    !> The order of the facets.
    pure logical function before(a, b)
      integer, intent(in) :: a, b
      before = centre(axis, a) < centre(axis, b)
      if (.not. before .and. .not. centre(axis, a) > centre(axis, b)) before = a < b
    end function before
  end subroutine split

  !> The facet that is nearest to a point, among those whose normal there faces a direction; the lowest number of
  !> equally near ones.
  pure subroutine nearest_facet(tree, set, x, toward, any_normal, hint, facet, xi, square)
    type(bounding_volume_tree_t), intent(in) :: tree
    type(facet_set_t), intent(in) :: set
    !> The point (3) [length].
    real(dp), intent(in) :: x(3)
    !> Unit vector that the normal has to face (3): normal . toward > facing_cosine.
    real(dp), intent(in) :: toward(3)
    !> Do not look at normals.
    logical, intent(in) :: any_normal
    !> A facet that is probably near, looked at first (it changes the time, never the answer); 0 if none.
    integer, intent(in) :: hint
    !> The nearest facet; 0 if none faces the direction.
    integer, intent(out) :: facet
    !> Reference coordinates of the closest point (2).
    real(dp), intent(out) :: xi(2)
    !> Squared distance [length^2].
    real(dp), intent(out) :: square
    integer :: waiting(stack_size), n, node, i, near, far
    real(dp) :: waiting_square(stack_size), near_square, far_square, bound
    facet = 0
    xi = 0
    square = huge(square)
    if (set%n == 0) return
    if (hint > 0) call look_at(tree, set, x, toward, any_normal, hint, facet, xi, square)
    n = 1
    waiting(1) = 1
    waiting_square(1) = square_to_box(tree%lo(:, 1), tree%hi(:, 1), x)
    do while (n > 0)
      node = waiting(n)
      bound = waiting_square(n)
      n = n - 1
      if (bound > square) cycle
      if (.not. any_normal) then
        if (dot_product(tree%axis(:, node), toward) < tree%limit(node)) cycle
      end if
      if (tree%child(node) == 0) then
        do i = tree%first(node), tree%last(node)
          if (tree%order(i) == hint) cycle
          call look_at(tree, set, x, toward, any_normal, tree%order(i), facet, xi, square)
        end do
        cycle
      end if
      near = tree%child(node)
      far = near + 1
      near_square = square_to_box(tree%lo(:, near), tree%hi(:, near), x)
      far_square = square_to_box(tree%lo(:, far), tree%hi(:, far), x)
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

  !> The facets of which a part may face a direction and lie in a box along given axes, ascending.
  pure subroutine facets_in_box(tree, set, toward, origin, axes, low, high, list)
    type(bounding_volume_tree_t), intent(in) :: tree
    type(facet_set_t), intent(in) :: set
    !> Unit vector that the normals have to face (3).
    real(dp), intent(in) :: toward(3)
    !> Origin (3) [length] and axes (3, 3) of the box.
    real(dp), intent(in) :: origin(3), axes(3, 3)
    !> The box along the axes, relative to the origin (3) [length].
    real(dp), intent(in) :: low(3), high(3)
    !> Facets.
    integer, allocatable, intent(out) :: list(:)
    integer :: waiting(stack_size), n, node, i, j, n_found
    integer, allocatable :: found(:), more(:)
    allocate (found(16))
    n_found = 0
    n = 0
    if (set%n > 0) then
      n = 1
      waiting(1) = 1
    end if
    do while (n > 0)
      node = waiting(n)
      n = n - 1
      if (dot_product(tree%axis(:, node), toward) < tree%limit(node)) cycle
      if (beside(tree%lo(:, node), tree%hi(:, node))) cycle
      if (tree%child(node) > 0) then
        waiting(n + 1:n + 2) = [tree%child(node), tree%child(node) + 1]
        n = n + 2
        cycle
      end if
      do i = tree%first(node), tree%last(node)
        associate (k => tree%order(i))
          if (dot_product(set%axis(:, k), toward) < tree%facet_limit(k)) cycle
          if (beside(set%lo(:, k), set%hi(:, k))) cycle
          if (n_found == size(found)) then
            allocate (more(2*n_found))
            more(1:n_found) = found
            call move_alloc(more, found)
          end if
          do j = n_found, 1, -1
            if (found(j) < k) exit
            found(j + 1) = found(j)
          end do
          found(j + 1) = k
          n_found = n_found + 1
        end associate
      end do
    end do
    list = found(1:n_found)

  contains

    !> A box lies beside the slab along one of the slab's axes.
    pure logical function beside(lo, hi)
      real(dp), intent(in) :: lo(3), hi(3)
      real(dp) :: centre, half
      integer :: k
      beside = .false.
      do k = 1, 3
        centre = dot_product((lo + hi)/2 - origin, axes(:, k))
        half = dot_product((hi - lo)/2, abs(axes(:, k)))
        beside = beside .or. centre + half < low(k) .or. centre - half > high(k)
      end do
    end function beside
  end subroutine facets_in_box

  !> Take a facet where it is nearer and faces the direction; the dummies are those of nearest_facet.
  pure subroutine look_at(tree, set, x, toward, any_normal, candidate, facet, xi, square)
    type(bounding_volume_tree_t), intent(in) :: tree
    type(facet_set_t), intent(in) :: set
    real(dp), intent(in) :: x(3), toward(3)
    logical, intent(in) :: any_normal
    !> The facet to look at.
    integer, intent(in) :: candidate
    !> The best so far.
    integer, intent(inout) :: facet
    real(dp), intent(inout) :: xi(2), square
    real(dp) :: point(2), its_square, position(3), normal(3), xu(3), xv(3)
    if (.not. any_normal) then
      if (dot_product(set%axis(:, candidate), toward) < tree%facet_limit(candidate)) return
    end if
    if (square_to_box(set%lo(:, candidate), set%hi(:, candidate), x) > square) return
    call closest_point_on_facet(set, candidate, x, point, its_square)
    if (its_square > square) return
    if (.not. its_square < square .and. candidate > facet) return
    if (.not. any_normal) then
      call facet_position_and_normal(set, candidate, point, position, normal, xu, xv)
      if (.not. dot_product(normal, toward) > facing_cosine) return
    end if
    facet = candidate
    xi = point
    square = its_square
  end subroutine look_at

  !> Squared distance of a point to a box, 0 inside.
  pure real(dp) function square_to_box(lo, hi, x) result(square)
    real(dp), intent(in) :: lo(3), hi(3), x(3)
    real(dp) :: d(3)
    d = max(lo - x, x - hi, 0.0_dp)
    square = d(1)**2 + d(2)**2 + d(3)**2
  end function square_to_box
end module dotyk_contact_bounding_volume_tree
