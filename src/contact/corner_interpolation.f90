!> Interpolation with continuous linear shape functions on one side of a contact pair: values at the corners of the
!> facets that carry contact points.
module dotyk_contact_corner_interpolation
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> Linear interpolation on one side of a pair.
  type, public :: corner_interpolation_t
    !> Number of corner nodes.
    integer :: n = 0
    !> Body-local numbers of the corner nodes, ascending (n).
    integer, allocatable :: corner_node(:)
    !> Corners of the facet of each point as numbers 1..n, padded with 0 (4, n_points).
    integer, allocatable :: corner(:, :)
    !> Linear shape functions of these corners at the points, padded with 0 (4, n_points) [].
    real(dp), allocatable :: shape(:, :)
    !> Body-local numbers of all nodes of those facets, ascending (n_nodes).
    integer, allocatable :: node(:)
    !> The value of node i is the mean of the values at corners from(1:n_from(i), i): the corner itself, the ends of its
    !> edge, or all corners of its face (4, n_nodes).
    integer, allocatable :: from(:, :)
    !> Number of corners that each node takes its value from (n_nodes).
    integer, allocatable :: n_from(:)
  contains
    procedure :: init => corner_interpolation_init
    procedure :: at_points
    procedure :: at_nodes
    procedure :: moments
  end type corner_interpolation_t

contains

  !> Number the corners and evaluate the shape functions.
  subroutine corner_interpolation_init(self, surface, facet, xi)
    class(corner_interpolation_t), intent(out) :: self
    !> Surface of this side.
    type(surface_t), intent(in) :: surface
    !> Facet of each point (n_points).
    integer, intent(in) :: facet(:)
    !> Reference coordinates of the points (dimension-1, n_points) [].
    real(dp), intent(in) :: xi(:, :)
    type(element_kind_t) :: kind(n_element_kinds)
    integer, allocatable :: corner_number(:), node_number(:)
    integer :: i, k, n, previous
    do k = 1, n_element_kinds
      kind(k) = element_kind(k)
    end do
    allocate (corner_number(maxval(surface%node)), node_number(maxval(surface%node)))
    corner_number = 0
    node_number = 0
    do i = 1, size(facet)
      k = surface%kind(facet(i))
      corner_number(surface%node(1:kind(k)%n_corners, facet(i))) = 1
      node_number(surface%node(1:kind_nodes(k), facet(i))) = 1
    end do
    call number_marked(corner_number, self%n)
    call number_marked(node_number, n)
    self%corner_node = pack([(i, i=1, size(corner_number))], corner_number > 0)
    self%node = pack([(i, i=1, size(node_number))], node_number > 0)
    allocate (self%corner(4, size(facet)), self%shape(4, size(facet)), self%from(4, n), self%n_from(n))
    self%corner = 0
    self%shape = 0
    self%from = 0
    self%n_from = 0
    previous = 0
    do i = 1, size(facet)
      k = surface%kind(facet(i))
      n = kind(k)%n_corners
      self%corner(1:n, i) = corner_number(surface%node(1:n, facet(i)))
      call shape_functions(kind(k)%corner_kind, xi(:, i), self%shape(1:n, i))
      if (facet(i) == previous) cycle
      previous = facet(i)
      call set_node_interpolation(n, kind_nodes(k), self%corner(:, i), &
                                  node_number(surface%node(1:kind_nodes(k), facet(i))), self%from, self%n_from)
    end do
  end subroutine corner_interpolation_init

  !> Replace marks by ascending numbers.
  pure subroutine number_marked(mark, n)
    !> Positive where marked; numbers on return (n_nodes).
    integer, intent(inout) :: mark(:)
    !> Number of marked entries.
    integer, intent(out) :: n
    integer :: i
    n = 0
    do i = 1, size(mark)
      if (mark(i) == 0) cycle
      n = n + 1
      mark(i) = n
    end do
  end subroutine number_marked

  !> Corners from which the nodes of one facet take their values.
  pure subroutine set_node_interpolation(n_corners, n_nodes, corner, node, from, n_from)
    !> Number of corners of the facet.
    integer, intent(in) :: n_corners
    !> Number of nodes of the facet.
    integer, intent(in) :: n_nodes
    !> Corner numbers of the facet (at least n_corners).
    integer, intent(in) :: corner(:)
    !> Positions of the nodes of the facet in the tables (n_nodes).
    integer, intent(in) :: node(:)
    !> Corners of each node (4, number of nodes).
    integer, intent(inout) :: from(:, :)
    !> Number of corners of each node (number of nodes).
    integer, intent(inout) :: n_from(:)
    integer :: j, edge
    do j = 1, n_nodes
      if (j <= n_corners) then
        n_from(node(j)) = 1
        from(1, node(j)) = corner(j)
      else if (j <= 2*n_corners) then
        ! Mid-side nodes follow the corners in the order of the edges.
        edge = j - n_corners
        n_from(node(j)) = 2
        from(1:2, node(j)) = [corner(edge), corner(mod(edge, n_corners) + 1)]
      else
        n_from(node(j)) = n_corners
        from(1:n_corners, node(j)) = corner(1:n_corners)
      end if
    end do
  end subroutine set_node_interpolation

  !> Interpolate at the contact points.
  pure subroutine at_points(self, value, interpolated)
    class(corner_interpolation_t), intent(in) :: self
    !> Values at the corners (n) [any].
    real(dp), intent(in) :: value(:)
    !> Values at the points (n_points) [any].
    real(dp), intent(out) :: interpolated(:)
    integer :: i, j
    do i = 1, size(interpolated)
      interpolated(i) = 0
      do j = 1, 4
        if (self%corner(j, i) > 0) interpolated(i) = interpolated(i) + self%shape(j, i)*value(self%corner(j, i))
      end do
    end do
  end subroutine at_points

  !> Interpolate at all nodes.
  pure subroutine at_nodes(self, value, interpolated)
    class(corner_interpolation_t), intent(in) :: self
    !> Values at the corners (n) [any].
    real(dp), intent(in) :: value(:)
    !> Values at the nodes (size(node)) [any].
    real(dp), intent(out) :: interpolated(:)
    integer :: i
    do i = 1, size(interpolated)
      interpolated(i) = sum(value(self%from(1:self%n_from(i), i)))/self%n_from(i)
    end do
  end subroutine at_nodes

  !> Sums over the points of values times shape functions.
  pure subroutine moments(self, value, moment)
    class(corner_interpolation_t), intent(in) :: self
    !> Values at the points, weights included (n_points) [any].
    real(dp), intent(in) :: value(:)
    !> Sums at the corners (n) [any].
    real(dp), intent(out) :: moment(:)
    integer :: i, j, k
    moment = 0
    do i = 1, size(value)
      do j = 1, 4
        k = self%corner(j, i)
        if (k > 0) moment(k) = moment(k) + value(i)*self%shape(j, i)
      end do
    end do
  end subroutine moments
end module dotyk_contact_corner_interpolation
