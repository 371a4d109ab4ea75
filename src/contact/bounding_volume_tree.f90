!> Bounding-volume tree over the facets of a surface, for the broad phase and the projection (cf. Yang and Laursen, A
!> contact searching algorithm including bounding volume trees, Comput. Mech. 41, 2008).
!>
!> The volume of a node bounds positions by a box and normals by a cone, so that parts of the surface that are too far
!> away or face another way are skipped together. Building the tree costs O(N log N).
module dotyk_contact_bounding_volume_tree
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: pi
  use dotyk_contact_facet_set, only: facet_set_t
  implicit none
  private

  type, public :: bounding_volume_t  !! Bounds of the positions and normals of some facets.
    real(dp) :: lo(3) = 0  !! Lower corner of the box (3) [length].
    real(dp) :: hi(3) = 0  !! Upper corner of the box (3) [length].
    real(dp) :: axis(3) = 0  !! Axis of the cone of normals (3) [].
    real(dp) :: limit = 0  !! No normal n faces a direction m (m . n > facing_cosine) where m . axis is below this [].
  end type bounding_volume_t

  !> The tree. Node 1 is the root; an inner node has the children child and child + 1.
  type, public :: bounding_volume_tree_t
    integer :: n_nodes = 0  !! Number of nodes.
    type(bounding_volume_t), allocatable :: volume(:)  !! Bounds of the facets of each node (n_nodes).
    integer, allocatable :: child(:)  !! First child of each node; 0 for a leaf (n_nodes).
    integer, allocatable :: first(:)  !! Facets of node i are order(first(i):last(i)) (n_nodes).
    integer, allocatable :: last(:)  !! End of these facets (n_nodes).
    integer, allocatable :: order(:)  !! Facets in the order of the tree (number of facets).
    type(bounding_volume_t), allocatable :: facet_volume(:)  !! Bounds of each facet (number of facets).
  contains
    procedure :: init => tree_init
  end type bounding_volume_tree_t

  !> Normals face each other where n_a . n_b < -facing_cosine: surfaces in contact, and facets of one smooth surface
  !> and their mean, are inclined by less than 60 degrees.
  real(dp), parameter, public :: facing_cosine = 0.5_dp
  !> Nodes that may wait in a depth-first traversal: the tree halves the facets, so that its depth is below 32.
  integer, parameter, public :: stack_size = 128

  integer, parameter :: leaf_size = 4  !! Greatest number of facets in a leaf.
  !> The mean of the axes of a node is no axis of a cone where it is shorter than this: normals in all directions.
  real(dp), parameter :: min_mean_axis = 0.01_dp
  real(dp), parameter :: angle_margin = 1.0e-6_dp  !! Margin of the limits for round-off of the arc cosine [rad].
  !> Limit of a cone that contains a facing normal for every direction: below any cosine.
  real(dp), parameter :: no_limit = -2

contains

  !> Build the tree.
  subroutine tree_init(self, set)
    class(bounding_volume_tree_t), intent(out) :: self
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    real(dp), allocatable :: centre(:, :)
    real(dp) :: low(3), high(3)
    integer :: i, n, node, max_nodes, middle
    n = set%n
    max_nodes = max(1, 2*n)
    allocate (self%volume(max_nodes), self%child(max_nodes), self%first(max_nodes), self%last(max_nodes), &
              self%facet_volume(n), centre(3, n))
    self%order = [(i, i=1, n)]
    do i = 1, n
      centre(:, i) = (set%lo(:, i) + set%hi(:, i))/2
      self%facet_volume(i) = bounding_volume_t(set%lo(:, i), set%hi(:, i), set%axis(:, i), &
                                               cone_limit(set%half_angle(i)))
    end do
    self%n_nodes = 1
    self%first(1) = 1
    self%last(1) = n
    node = 0
    do while (node < self%n_nodes)
      node = node + 1
      associate (first => self%first(node), last => self%last(node))
        call bound_facets(set, self%order(first:last), self%volume(node))
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

  !> Bounds of a list of facets.
  pure subroutine bound_facets(set, list, volume)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: list(:)  !! Facets to bound (n).
    type(bounding_volume_t), intent(out) :: volume  !! Their box and their cone of normals.
    real(dp) :: length, half_angle, angle, cosine, widest(2)
    integer :: i
    volume%lo = huge(1.0_dp)
    volume%hi = -huge(1.0_dp)
    volume%axis = 0
    do i = 1, size(list)
      volume%lo = min(volume%lo, set%lo(:, list(i)))
      volume%hi = max(volume%hi, set%hi(:, list(i)))
      volume%axis = volume%axis + set%axis(:, list(i))
    end do
    length = norm2(volume%axis)
    if (length < min_mean_axis*size(list)) then
      volume%axis = 0
      volume%limit = cone_limit(pi)
      return
    end if
    volume%axis = volume%axis/length
    half_angle = 0
    ! Cosine and half angle of the facet that has set the angle: arc cosines cost most of the tree.
    widest = [2, -1]
    do i = 1, size(list)
      cosine = max(-1.0_dp, min(1.0_dp, dot_product(volume%axis, set%axis(:, list(i)))))
      if (cosine >= widest(1) .and. set%half_angle(list(i)) <= widest(2)) cycle
      angle = set%half_angle(list(i)) + acos(cosine)
      if (angle <= half_angle) cycle
      half_angle = angle
      widest = [cosine, set%half_angle(list(i))]
    end do
    volume%limit = cone_limit(min(pi, half_angle))
  end subroutine bound_facets

  !> Cosine of the greatest angle between a direction and the axis of a cone at which a normal of the cone may face that
  !> direction [].
  pure real(dp) function cone_limit(half_angle) result(limit)
    real(dp), intent(in) :: half_angle  !! Half angle of the cone [rad].
    real(dp) :: angle
    angle = acos(facing_cosine) + half_angle + angle_margin
    limit = no_limit
    if (angle < pi) limit = cos(angle)
  end function cone_limit

  !> Partition order(first:last) so that the facets up to `middle` precede the others in the order (coordinate, facet
  !> number): quickselect.
  pure subroutine split(order, first, last, middle, centre, axis)
    integer, intent(inout) :: order(:)  !! Facet numbers (number of facets).
    integer, intent(in) :: first  !! First position.
    integer, intent(in) :: last  !! Last position.
    integer, intent(in) :: middle  !! Last position of the first part.
    real(dp), intent(in) :: centre(:, :)  !! Centres of the facets (3, n) [length].
    integer, intent(in) :: axis  !! Coordinate to compare, 1 to 3.
    integer :: low, high, i, j, pivot, swap
    low = first
    high = last
    do while (low < high)
      pivot = order((low + high)/2)
      i = low
      j = high
      do
        do while (precedes(order(i), pivot))
          i = i + 1
        end do
        do while (precedes(pivot, order(j)))
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

    !> Whether facet a precedes facet b.
    pure logical function precedes(a, b)
      integer, intent(in) :: a  !! First facet.
      integer, intent(in) :: b  !! Second facet.
      precedes = centre(axis, a) < centre(axis, b)
      if (.not. precedes .and. .not. centre(axis, a) > centre(axis, b)) precedes = a < b
    end function precedes
  end subroutine split
end module dotyk_contact_bounding_volume_tree
