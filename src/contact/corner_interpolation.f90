!> Interpolation with linear shape functions on one side of a contact pair: values at the corners of the facets that
!> carry contact points. The functions are continuous on each smooth sheet (smooth_sheets.f90): a vertex of a sharp edge
!> is one corner for each sheet, and so it is for each sheet of the other side that its points face: the gap has a kink
!> where the other side has an edge.
module dotyk_contact_corner_interpolation
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, n_element_kinds, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: corner_interpolation_t  !! Linear interpolation on one side of a pair.
    integer :: n = 0  !! Number of corners: one for each vertex, sheet and sheet of the other side.
    !> Body-local numbers of their nodes, ascending; repeated where sheets meet (n).
    integer, allocatable :: corner_node(:)
    !> Corners of the facet of each point as numbers 1..n, padded with 0 (4, n_points).
    integer, allocatable :: corner(:, :)
    !> Linear shape functions of these corners at the points, padded with 0 (4, n_points) [].
    real(dp), allocatable :: shape(:, :)
    integer, allocatable :: node(:)  !! Body-local numbers of all nodes of those facets, ascending (n_nodes).
    integer, allocatable :: position(:)  !! Position of `node` of each interpolated value (n_values).
    !> Value i is the mean of the values at corners from(1:n_from(i), i): the corner itself, the ends of its edge, or
    !> all corners of its face. A node of a sharp edge has one value for each sheet (4, n_values).
    integer, allocatable :: from(:, :)
    integer, allocatable :: n_from(:)  !! Number of corners from which each value is taken (n_values).
  contains
    procedure :: init => corner_interpolation_init
    procedure :: at_points
    procedure :: at_nodes
    procedure :: moments
  end type corner_interpolation_t

contains

  !> Number the corners and evaluate the shape functions.
  subroutine corner_interpolation_init(self, surface, facet, xi, other_sheet)
    class(corner_interpolation_t), intent(out) :: self
    type(surface_t), intent(in) :: surface  !! Surface of this side.
    integer, intent(in) :: facet(:)  !! Facet of each point (n_points).
    real(dp), intent(in) :: xi(:, :)  !! Reference coordinates of the points (dimension-1, n_points) [].
    !> Sheet of the other side that each point faces; of one facet in a row. One if absent (n_points).
    integer, intent(in), optional :: other_sheet(:)
    type(element_kind_t) :: kind(n_element_kinds)
    integer, allocatable :: first_corner(:), corner_number(:), node_number(:), sheet(:, :), value_of(:), next(:)
    integer, allocatable :: offset(:)
    integer :: i, k, n, f, n_sheets, previous(2)
    do k = 1, n_element_kinds
      kind(k) = element_kind(k)
    end do
    n_sheets = 1
    allocate (sheet(4, size(surface%kind)), source=1)
    if (allocated(surface%sheet)) then
      sheet = surface%sheet
      n_sheets = maxval(sheet)
    end if
    ! Corners are numbered by node, then by sheet of the other side, then by sheet.
    if (present(other_sheet)) then
      call count_sheets(other_sheet, n_sheets, offset)
    else
      offset = spread(0, 1, size(facet))
    end if
    allocate (corner_number(n_sheets*maxval(surface%node)), node_number(maxval(surface%node)))
    first_corner = [(n_sheets*(i - 1), i=1, maxval(surface%node))]
    corner_number = 0
    node_number = 0
    do i = 1, size(facet)
      f = facet(i)
      k = surface%kind(f)
      n = kind(k)%n_corners
      corner_number(first_corner(surface%node(1:n, f)) + offset(i) + sheet(1:n, f)) = 1
      node_number(surface%node(1:kind_nodes(k), f)) = 1
    end do
    call number_marked(corner_number, self%n)
    call number_marked(node_number, n)
    self%corner_node = pack([((i - 1)/n_sheets + 1, i=1, size(corner_number))], corner_number > 0)
    self%node = pack([(i, i=1, size(node_number))], node_number > 0)
    allocate (self%corner(4, size(facet)), self%shape(4, size(facet)), self%position(n), self%from(4, n), &
              self%n_from(n), value_of(n), next(n))
    self%corner = 0
    self%shape = 0
    value_of = 0
    n = 0
    previous = 0
    do i = 1, size(facet)
      f = facet(i)
      k = surface%kind(f)
      associate (m => kind(k)%n_corners)
        self%corner(1:m, i) = corner_number(first_corner(surface%node(1:m, f)) + offset(i) + sheet(1:m, f))
        call shape_functions(kind(k)%corner_kind, xi(:, i), self%shape(1:m, i))
        if (all([f, offset(i)] == previous)) cycle
        previous = [f, offset(i)]
        call add_node_values(self, m, self%corner(:, i), node_number(surface%node(1:kind_nodes(k), f)), n, value_of, &
                             next)
      end associate
    end do
    self%position = self%position(1:n)
    self%from = self%from(:, 1:n)
    self%n_from = self%n_from(1:n)
  end subroutine corner_interpolation_init

  !> Number the sheets of the other side that points face.
  pure subroutine count_sheets(other_sheet, n_sheets, offset)
    integer, intent(in) :: other_sheet(:)  !! Sheets of the points (n_points).
    integer, intent(inout) :: n_sheets  !! Sheets of a node on its own side; times those of the other on return.
    integer, allocatable, intent(out) :: offset(:)  !! First sheet of a node for each point, less one (n_points).
    integer, allocatable :: number(:)
    integer :: n
    allocate (number(0:maxval([0, other_sheet])), source=0)
    number(other_sheet) = 1
    call number_marked(number, n)
    offset = n_sheets*(number(other_sheet) - 1)
    n_sheets = n_sheets*max(n, 1)
  end subroutine count_sheets

  !> Replace marks by ascending numbers.
  pure subroutine number_marked(mark, n)
    integer, intent(inout) :: mark(:)  !! Positive where marked; numbers on return (number of marks).
    integer, intent(out) :: n  !! Number of marked entries.
    integer :: i
    n = 0
    do i = 1, size(mark)
      if (mark(i) == 0) cycle
      n = n + 1
      mark(i) = n
    end do
  end subroutine number_marked

  !> Add the values of the nodes of one facet that no facet before gave.
  pure subroutine add_node_values(self, n_corners, corner, node, n, value_of, next)
    class(corner_interpolation_t), intent(inout) :: self
    integer, intent(in) :: n_corners  !! Number of corners of the facet.
    integer, intent(in) :: corner(:)  !! Corner numbers of the facet (at least n_corners).
    integer, intent(in) :: node(:)  !! Positions of the nodes of the facet in the list of nodes (n_nodes of the facet).
    integer, intent(inout) :: n  !! Number of values so far.
    integer, intent(inout) :: value_of(:)  !! Latest value of each node, 0 if none so far (n_nodes).
    !> Value of the same node before each value, 0 if there is none (size of the list of values).
    integer, allocatable, intent(inout) :: next(:)
    integer :: from(4), j, k, edge, n_from
    do j = 1, size(node)
      from = 0
      if (j <= n_corners) then
        n_from = 1
        from(1) = corner(j)
      else if (j <= 2*n_corners) then
        ! Mid-side nodes follow the corners in the order of the edges; the two facets of an edge see its ends in
        ! opposite order.
        edge = j - n_corners
        n_from = 2
        from(1) = min(corner(edge), corner(mod(edge, n_corners) + 1))
        from(2) = max(corner(edge), corner(mod(edge, n_corners) + 1))
      else
        n_from = n_corners
        from(1:n_corners) = corner(1:n_corners)
      end if
      k = value_of(node(j))
      do while (k > 0)
        if (all(self%from(:, k) == from)) exit
        k = next(k)
      end do
      if (k > 0) cycle
      if (n == size(self%position)) then
        self%position = [self%position, self%position]
        self%n_from = [self%n_from, self%n_from]
        self%from = reshape(self%from, [4, 2*n], pad=self%from)
        next = [next, next]
      end if
      n = n + 1
      self%position(n) = node(j)
      self%n_from(n) = n_from
      self%from(:, n) = from
      next(n) = value_of(node(j))
      value_of(node(j)) = n
    end do
  end subroutine add_node_values

  !> Interpolate at the contact points.
  pure subroutine at_points(self, value, interpolated)
    class(corner_interpolation_t), intent(in) :: self
    real(dp), intent(in) :: value(:)  !! Values at the corners (n) [any].
    real(dp), intent(out) :: interpolated(:)  !! Values at the points (n_points) [any].
    integer :: i, j
    do i = 1, size(interpolated)
      interpolated(i) = 0
      do j = 1, 4
        if (self%corner(j, i) > 0) interpolated(i) = interpolated(i) + self%shape(j, i)*value(self%corner(j, i))
      end do
    end do
  end subroutine at_points

  !> Interpolate at all nodes; where sheets meet, the value of greatest magnitude.
  pure subroutine at_nodes(self, value, interpolated)
    class(corner_interpolation_t), intent(in) :: self
    real(dp), intent(in) :: value(:)  !! Values at the corners (n) [any].
    real(dp), intent(out) :: interpolated(:)  !! Values at the nodes (size(node)) [any].
    real(dp) :: mean
    integer :: i
    interpolated = 0
    do i = 1, size(self%position)
      mean = sum(value(self%from(1:self%n_from(i), i)))/self%n_from(i)
      if (abs(mean) > abs(interpolated(self%position(i)))) interpolated(self%position(i)) = mean
    end do
  end subroutine at_nodes

  !> Sums over the points of values times shape functions.
  pure subroutine moments(self, value, moment)
    class(corner_interpolation_t), intent(in) :: self
    real(dp), intent(in) :: value(:)  !! Values at the points, weights included (n_points) [any].
    real(dp), intent(out) :: moment(:)  !! Sums at the corners (n) [any].
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
