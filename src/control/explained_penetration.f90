!> What contact pairs leave between two bodies: penetration by penalty, and where a given gap is larger than the
!> distance of the surfaces.
module dotyk_control_explained_penetration
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gap_constant, gap_formula, gap_geometry
  use dotyk_base_thresholds, only: largest_square
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_contact_penetration_tolerance, only: left_by_pairs_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_element, only: kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: find_left

  type, public :: pairs_of_bodies_t  !! Lists of pairs.
    integer, allocatable :: start(:)  !! Pairs of body b, ascending: pair(start(b):start(b+1)-1) (n_bodies + 1).
    integer, allocatable :: pair(:)  !! See `start`.
  contains
    procedure :: init => pairs_of_bodies_init
    procedure :: of => pairs_of_bodies_of
    procedure :: between => pairs_of_bodies_between
    procedure :: linking => pairs_of_bodies_linking
  end type pairs_of_bodies_t

contains

  !> What contact pairs leave at the nodes of a body against another one: their own pairs, or, where they have none
  !> and only meet at edges, those with other bodies.
  subroutine find_left(problem, pairs, first_row, penetration, body, other, left)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(pairs_of_bodies_t), intent(in) :: pairs  !! The pairs of each body.
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    integer, intent(in) :: body  !! The body.
    integer, intent(in) :: other  !! The other body.
    type(left_by_pairs_t), intent(out) :: left  !! Penetration at the nodes of the body.
    real(dp), allocatable :: at_points(:), uncertain(:)
    logical, allocatable :: is_known(:)
    integer, allocatable :: list(:)
    real(dp) :: beside
    logical :: is_between
    integer :: i, k
    allocate (left%depth(problem%body(body)%mesh%n_nodes()), source=0.0_dp)
    allocate (left%uncertainty, left%width, source=left%depth)
    allocate (is_known(size(left%depth)), left%is_averaged(size(left%depth)), source=.false.)
    list = pairs%between(problem%pair, body, other)
    is_between = size(list) > 0
    if (.not. is_between) list = pairs%of(body)
    ! Where a formula gives the gap, the mesh does not show the shape: beside the surfaces of the pair nothing is known.
    beside = 0
    do i = 1, size(list)
      k = list(i)
      associate (pair => problem%pair(k))
        call penetration_at_points(pair, penetration(first_row(k):first_row(k + 1) - 1), problem%body(pair%body_b), &
                                   problem%surface_b(k), is_between, at_points, uncertain)
        if (pair%body_a == body) call spread_points(at_points, problem%surface_a(k), pair%facet_a, left%depth, is_known)
        if (pair%body_b == body) call spread_points(at_points, problem%surface_b(k), pair%facet_b, left%depth, is_known)
        if (pair%body_a == body) &
          call spread_points(uncertain, problem%surface_a(k), pair%facet_a, left%uncertainty, is_known)
        call mark_averaged(pair, problem%surface_a(k), problem%surface_b(k), problem%body(pair%body_a)%mesh%x, body, &
                           left)
        if (.not. is_between) cycle
        if (pair%gap_kind == gap_formula) beside = largest_square
        if (pair%gap_kind == gap_constant) beside = max(beside, maxval(at_points))
      end associate
    end do
    where (.not. is_known) left%depth = beside
    left%given = beside
  end subroutine find_left

  !> Penetration at the points of a pair: the largest of the rows that they belong to, and the part of a given gap that
  !> the surfaces do not have; and the uncertainty of the gaps, where it is that of rows that may be closed.
  subroutine penetration_at_points(pair, penetration, body_b, surface_b, with_gaps, at_points, uncertain)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    real(dp), intent(in) :: penetration(:)  !! Penetration of its rows, negative where they are open (n_rows) [length].
    type(body_t), intent(in) :: body_b  !! Body of the master side.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    logical, intent(in) :: with_gaps  !! Whether given gaps count.
    real(dp), allocatable, intent(out) :: at_points(:)  !! Penetration (n_points) [length].
    real(dp), allocatable, intent(out) :: uncertain(:)  !! By the uncertainty of the gaps (n_points) [length].
    real(dp) :: shape(max_facet_nodes), x_b(pair%dimension)
    real(dp), allocatable :: row(:)
    integer :: i, k, n
    allocate (at_points(pair%n_points), uncertain(pair%n_points), source=0.0_dp)
    if (size(penetration) == 0 .and. allocated(pair%uncertainty)) uncertain = pair%uncertainty
    row = pair%row_uncertainty()
    ! Before the solution there are none.
    do i = 1, size(penetration)
      if (.not. penetration(i) + row(i) > 0) cycle
      do k = pair%average%row_start(i), pair%average%row_start(i + 1) - 1
        associate (point => pair%average%column(k))
          at_points(point) = max(at_points(point), penetration(i))
          uncertain(point) = max(uncertain(point), row(i))
        end associate
      end do
    end do
    if (pair%gap_kind == gap_geometry .or. .not. with_gaps) return
    do k = 1, pair%n_points
      associate (f => pair%facet_b(k))
        n = kind_nodes(surface_b%kind(f))
        call shape_functions(surface_b%kind(f), pair%xi_b(:, k), shape(1:n))
        x_b = matmul(body_b%mesh%x(:, surface_b%node(1:n, f)), shape(1:n))
        at_points(k) = at_points(k) + &
                       max(0.0_dp, pair%gap(k) - dot_product(pair%normal(:, k), x_b - pair%position(:, k)))
      end associate
    end do
  end subroutine penetration_at_points

  !> Mark the nodes of facets over which rows keep the gap closed in the mean, and of those that they face.
  subroutine mark_averaged(pair, surface_a, surface_b, x, body, left)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the slave body (dimension, n_nodes) [length].
    integer, intent(in) :: body  !! The body.
    type(left_by_pairs_t), intent(inout) :: left  !! Its nodes are marked; those of slave facets get the width.
    type(corner_interpolation_t) :: corners
    logical, allocatable :: has_row(:)
    integer :: i
    associate (n => pair%n_mortar_points)
      if (n == 0) return
      call corners%init(surface_a, pair%facet_a(:n), pair%xi_a(:, :n), pair%sheet_b(:n))
      allocate (has_row(0:corners%n), source=.false.)
      has_row(0) = .true.
      has_row(pair%row_corner) = .true.
      do i = 1, n
        if (.not. all(has_row(corners%corner(:, i)))) cycle
        associate (f => pair%facet_a(i), g => pair%facet_b(i))
          if (pair%body_b == body) left%is_averaged(surface_b%node(:kind_nodes(surface_b%kind(g)), g)) = .true.
          if (pair%body_a /= body) cycle
          associate (node => surface_a%node(:kind_nodes(surface_a%kind(f)), f), &
                     corner => corners%corner_node(pack(corners%corner(:, i), corners%corner(:, i) > 0)))
            left%is_averaged(node) = .true.
            left%width(node) = max(left%width(node), maxval(norm2(x(:, cshift(corner, 1)) - x(:, corner), 1)))
          end associate
        end associate
      end do
    end associate
  end subroutine mark_averaged

  !> The largest value at the points of the facets around each node.
  pure subroutine spread_points(at_points, surface, facet, at_nodes, is_known)
    real(dp), intent(in) :: at_points(:)  !! Values (n_points) [any].
    type(surface_t), intent(in) :: surface  !! Surface of this side.
    integer, intent(in) :: facet(:)  !! Facets of the points on this side (n_points).
    real(dp), intent(inout) :: at_nodes(:)  !! Values at the nodes of the body, where greater (n_nodes) [as there].
    logical, intent(inout) :: is_known(:)  !! Nodes of facets that carry points; they are added (n_nodes).
    integer :: k, j, node
    do k = 1, size(at_points)
      do j = 1, kind_nodes(surface%kind(facet(k)))
        node = surface%node(j, facet(k))
        at_nodes(node) = max(at_nodes(node), at_points(k))
        is_known(node) = .true.
      end do
    end do
  end subroutine spread_points

  !> Find the pairs of all bodies.
  subroutine pairs_of_bodies_init(self, pair, n_bodies)
    class(pairs_of_bodies_t), intent(out) :: self
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: n_bodies  !! Number of bodies.
    integer :: next(n_bodies), b, k
    next = 0
    do k = 1, size(pair)
      next(pair(k)%body_a) = next(pair(k)%body_a) + 1
      if (pair(k)%body_b /= pair(k)%body_a) next(pair(k)%body_b) = next(pair(k)%body_b) + 1
    end do
    allocate (self%start(n_bodies + 1))
    self%start(1) = 1
    do b = 1, n_bodies
      self%start(b + 1) = self%start(b) + next(b)
    end do
    next = self%start(:n_bodies)
    allocate (self%pair(self%start(n_bodies + 1) - 1))
    do k = 1, size(pair)
      call put(pair(k)%body_a)
      if (pair(k)%body_b /= pair(k)%body_a) call put(pair(k)%body_b)
    end do
  contains
    !> Add pair k to the list of a body.
    subroutine put(body)
      integer, intent(in) :: body  !! The body.
      self%pair(next(body)) = k
      next(body) = next(body) + 1
    end subroutine put
  end subroutine pairs_of_bodies_init

  !> Pairs of a body, ascending.
  pure function pairs_of_bodies_of(self, body) result(list)
    class(pairs_of_bodies_t), intent(in) :: self
    integer, intent(in) :: body  !! The body.
    integer, allocatable :: list(:)
    list = self%pair(self%start(body):self%start(body + 1) - 1)
  end function pairs_of_bodies_of

  !> Pairs that two bodies have with each other, ascending.
  pure function pairs_of_bodies_between(self, pair, a, b) result(list)
    class(pairs_of_bodies_t), intent(in) :: self
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: a  !! One body.
    integer, intent(in) :: b  !! The other body; may be the same.
    integer, allocatable :: list(:)
    list = self%of(a)
    list = pack(list, (pair(list)%body_a == a .and. pair(list)%body_b == b) .or. &
                (pair(list)%body_b == a .and. pair(list)%body_a == b))
  end function pairs_of_bodies_between

  !> Pairs that push two bodies against each other: their own, or else those with the bodies that touch both.
  pure function pairs_of_bodies_linking(self, pair, a, b) result(list)
    class(pairs_of_bodies_t), intent(in) :: self
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: a  !! One body.
    integer, intent(in) :: b  !! The other body; may be the same.
    integer, allocatable :: list(:), of_a(:), of_b(:)
    integer :: k
    list = self%between(pair, a, b)
    if (size(list) > 0) return
    of_a = self%of(a)
    do k = 1, size(of_a)
      of_b = self%between(pair, pair(of_a(k))%body_a + pair(of_a(k))%body_b - a, b)
      if (size(of_b) > 0) list = [list, of_a(k), of_b]
    end do
  end function pairs_of_bodies_linking
end module dotyk_control_explained_penetration
