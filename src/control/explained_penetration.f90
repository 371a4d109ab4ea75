!> What contact pairs leave between two bodies: penetration by penalty, where a given gap is larger than the distance of
!> the surfaces, and where the gap is uncertain; and facets over which the gap is 0 in the mean.
module dotyk_control_explained_penetration
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gap_constant, gap_formula, gap_geometry
  use dotyk_base_thresholds, only: largest_square
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_contact_penetration_tolerance, only: left_by_pairs_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_pairs_of_bodies, only: pairs_of_bodies_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: find_left

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
    type(left_by_pairs_t), intent(out) :: left  !! Penetration and widths at the nodes of the body.
    real(dp), allocatable :: at_points(:), width(:)
    logical, allocatable :: is_known(:)
    integer, allocatable :: list(:)
    real(dp) :: beside
    logical :: is_between
    integer :: i, k
    allocate (left%depth(problem%body(body)%mesh%n_nodes()), source=0.0_dp)
    allocate (left%width, source=left%depth)
    allocate (is_known(size(left%depth)), source=.false.)
    list = pairs%between(problem%pair, body, other)
    is_between = size(list) > 0
    if (.not. is_between) list = pairs%of(body)
    ! Where a formula gives the gap, the mesh does not show the shape: beside the surfaces of the pair nothing is known.
    beside = 0
    do i = 1, size(list)
      k = list(i)
      associate (pair => problem%pair(k))
        call penetration_at_points(pair, penetration(first_row(k):first_row(k + 1) - 1), problem%body(pair%body_a), &
                                   problem%surface_a(k), problem%body(pair%body_b), problem%surface_b(k), &
                                   at_points, width, is_between)
        if (pair%body_a == body) &
          call spread_points(at_points, width, problem%surface_a(k), pair%facet_a, left, is_known)
        if (pair%body_b == body) &
          call spread_points(at_points, width, problem%surface_b(k), pair%facet_b, left, is_known)
        if (.not. is_between) cycle
        if (pair%gap_kind == gap_formula) beside = largest_square
        if (pair%gap_kind == gap_constant) beside = max(beside, maxval(at_points))
      end associate
    end do
    where (.not. is_known) left%depth = beside
    left%given = beside
  end subroutine find_left

  !> Penetration at the points of a pair: the largest of the rows that they belong to, the uncertainty of their gaps,
  !> and the part of a given gap that the surfaces do not have; and the widths of the slave facets of the points.
  subroutine penetration_at_points(pair, penetration, body_a, surface_a, body_b, surface_b, at_points, width, with_gaps)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    real(dp), intent(in) :: penetration(:)  !! Penetration of its rows, negative where they are open (n_rows) [length].
    type(body_t), intent(in) :: body_a  !! Body of the slave side.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(body_t), intent(in) :: body_b  !! Body of the master side.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    real(dp), allocatable, intent(out) :: at_points(:)  !! Penetration (n_points) [length].
    real(dp), allocatable, intent(out) :: width(:)  !! Longest edge of the slave facet (n_points) [length].
    logical, intent(in) :: with_gaps  !! Whether given gaps count.
    real(dp) :: shape(max_facet_nodes), x_b(pair%dimension), longest
    integer, allocatable :: corner(:)
    type(element_kind_t) :: kind
    integer :: f, i, k, n
    allocate (at_points(pair%n_points), width(pair%n_points))
    at_points = 0
    f = 0
    do k = 1, pair%n_points
      if (pair%facet_a(k) /= f) then
        f = pair%facet_a(k)
        kind = element_kind(surface_a%kind(f))
        corner = surface_a%node(1:kind%n_corners, f)
        longest = maxval(norm2(body_a%mesh%x(:, cshift(corner, 1)) - body_a%mesh%x(:, corner), 1))
      end if
      ! Point contacts are no means.
      width(k) = merge(longest, 0.0_dp, k <= pair%n_points - pair%n_point_contacts)
    end do
    ! Before the solution there are none.
    do i = 1, size(penetration)
      if (.not. penetration(i) > 0) cycle
      do k = pair%average%row_start(i), pair%average%row_start(i + 1) - 1
        at_points(pair%average%column(k)) = max(at_points(pair%average%column(k)), penetration(i))
      end do
    end do
    if (allocated(pair%uncertainty)) at_points = at_points + pair%uncertainty
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

  !> The largest penetration at the points of the facets around each node.
  pure subroutine spread_points(at_points, width, surface, facet, left, is_known)
    real(dp), intent(in) :: at_points(:)  !! Penetration (n_points) [length].
    real(dp), intent(in) :: width(:)  !! Width of the slave facet (n_points) [length].
    type(surface_t), intent(in) :: surface  !! Surface of this side.
    integer, intent(in) :: facet(:)  !! Facets of the points on this side (n_points).
    type(left_by_pairs_t), intent(inout) :: left  !! Penetration and widths at the nodes of the body.
    logical, intent(inout) :: is_known(:)  !! Nodes of facets that carry points; they are added (n_nodes).
    integer :: k, j, node
    do k = 1, size(at_points)
      do j = 1, kind_nodes(surface%kind(facet(k)))
        node = surface%node(j, facet(k))
        left%depth(node) = max(left%depth(node), at_points(k))
        left%width(node) = max(left%width(node), width(k))
        is_known(node) = .true.
      end do
    end do
  end subroutine spread_points
end module dotyk_control_explained_penetration
