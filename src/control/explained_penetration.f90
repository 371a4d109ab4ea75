!> Penetration of two bodies that their contact pairs leave by intention: by penalty, and where a given gap is larger
!> than the distance of the surfaces.
module dotyk_control_explained_penetration
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gap_constant, gap_formula, gap_geometry
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_mesh_element, only: kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: explained_penetration, largest_penetration

  !> What explains any penetration; sums of several must not overflow [length].
  real(dp), parameter :: any_depth = huge(1.0_dp)/16

contains

  !> Penetration of a body into another one that their contact pairs leave at its nodes.
  subroutine explained_penetration(problem, own_pair, first_row, y, body, explained)
    !> Bodies and contact pairs.
    type(contact_problem_t), intent(in) :: problem
    !> The pairs that the two have with each other, ascending (n).
    integer, intent(in) :: own_pair(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> The body.
    integer, intent(in) :: body
    !> Penetration (n_nodes of the body) [length].
    real(dp), allocatable, intent(out) :: explained(:)
    real(dp), allocatable :: at_points(:)
    real(dp) :: beside
    logical, allocatable :: is_known(:)
    integer :: i, k
    allocate (explained(problem%body(body)%mesh%n_nodes()), source=0.0_dp)
    allocate (is_known(size(explained)), source=.false.)
    ! Where a formula gives the gap, the mesh does not show the shape: beside the surfaces of the pair nothing is known.
    beside = 0
    do i = 1, size(own_pair)
      k = own_pair(i)
      associate (pair => problem%pair(k))
        call penetration_at_points(pair, y(first_row(k):first_row(k + 1) - 1), problem%body(pair%body_b), &
                                   problem%surface_b(k), at_points)
        if (pair%body_a == body) call spread_points(at_points, problem%surface_a(k), pair%facet_a, explained, is_known)
        if (pair%body_b == body) call spread_points(at_points, problem%surface_b(k), pair%facet_b, explained, is_known)
        if (pair%gap_kind == gap_formula) beside = any_depth
        if (pair%gap_kind == gap_constant) beside = max(beside, maxval(at_points))
      end associate
    end do
    where (.not. is_known) explained = beside
  end subroutine explained_penetration

  !> Greatest penetration in the rows of all pairs of a body [length].
  pure real(dp) function largest_penetration(own_pair, first_row, y) result(largest)
    !> The pairs of the body (n).
    integer, intent(in) :: own_pair(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    integer :: i, k
    largest = 0
    do i = 1, size(own_pair)
      k = own_pair(i)
      if (first_row(k + 1) > first_row(k)) largest = max(largest, maxval(y(first_row(k):first_row(k + 1) - 1)))
    end do
  end function largest_penetration

  !> Penetration at the points of a pair: the largest of the rows that they belong to, and the part of a given gap that
  !> the surfaces do not have.
  subroutine penetration_at_points(pair, y, body_b, surface_b, at_points)
    !> Contact pair.
    type(contact_pair_t), intent(in) :: pair
    !> Penetration of its rows, negative where they are open (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Body of the master side.
    type(body_t), intent(in) :: body_b
    !> Master surface.
    type(surface_t), intent(in) :: surface_b
    !> Penetration (n_points) [length].
    real(dp), allocatable, intent(out) :: at_points(:)
    real(dp) :: shape(max_facet_nodes), x_b(pair%dimension)
    integer :: i, k, n
    allocate (at_points(pair%n_points), source=0.0_dp)
    do i = 1, pair%n_rows
      if (.not. y(i) > 0) cycle
      do k = pair%average%row_start(i), pair%average%row_start(i + 1) - 1
        at_points(pair%average%column(k)) = max(at_points(pair%average%column(k)), y(i))
      end do
    end do
    if (pair%gap_kind == gap_geometry) return
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
  pure subroutine spread_points(at_points, surface, facet, explained, is_known)
    !> Penetration (n_points) [length].
    real(dp), intent(in) :: at_points(:)
    !> Surface of this side.
    type(surface_t), intent(in) :: surface
    !> Facets of the points on this side (n_points).
    integer, intent(in) :: facet(:)
    !> Penetration at the nodes of the body (n_nodes) [length].
    real(dp), intent(inout) :: explained(:)
    !> Nodes of facets that carry points; they are added (n_nodes).
    logical, intent(inout) :: is_known(:)
    integer :: k, j, node
    do k = 1, size(at_points)
      do j = 1, kind_nodes(surface%kind(facet(k)))
        node = surface%node(j, facet(k))
        explained(node) = max(explained(node), at_points(k))
        is_known(node) = .true.
      end do
    end do
  end subroutine spread_points
end module dotyk_control_explained_penetration
