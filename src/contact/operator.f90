!> The contact operator B, the contact rows of the quadratic programme (docs/theory.md, sections 2 and 3).
!>
!> Row i has the weight w_i, the weighted gap d_i, and (B u)_i, the weighted mean of n_q . (u_a(x_q) - u_b(x'_q)) over
!> the integration points q of the row: a combination of the displacements of the nodes of their facets. B is stored
!> body by body: the block of a body holds the rows that involve it. Contact forces - B^T lambda have no tangential
!> part, equation (7).
module dotyk_contact_operator
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_mesh_element, only: kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> Columns of B that belong to one body.
  type, public :: contact_block_t
    !> Number of contact nodes.
    integer :: n_nodes = 0
    !> Body-local numbers of the contact nodes, ascending (n_nodes).
    integer, allocatable :: contact_node(:)
    !> Their numbers in the whole body, the same for congruent bodies; not allocated where this rank holds all bodies
    !> wholly (n_nodes).
    integer, allocatable :: whole_node(:)
    !> Rows of the operator that involve the body, ascending (matrix%n_rows).
    integer, allocatable :: row(:)
    !> These rows; column (i-1)*dimension + component of contact node i (size(row) x dimension*n_nodes) [].
    type(sparse_rows_t) :: matrix
  contains
    procedure :: node_numbers => block_node_numbers
  end type contact_block_t

  !> The operator.
  type, public :: contact_operator_t
    !> Number of rows.
    integer :: n_rows = 0
    !> Dimension of space, 2 or 3.
    integer :: dimension = 0
    !> Rows of pair k are pair_first_row(k) .. pair_first_row(k+1)-1 (n_pairs+1).
    integer, allocatable :: pair_first_row(:)
    !> Weights w (n_rows) [length^2; length in two dimensions].
    real(dp), allocatable :: weight(:)
    !> Weighted gaps d (n_rows) [length].
    real(dp), allocatable :: gap(:)
    !> Blocks of the bodies; empty for bodies without contact (n_bodies).
    type(contact_block_t), allocatable :: block(:)
  end type contact_operator_t

  public :: build_operator

contains

  !> Numbers of the contact nodes in the whole body (n_nodes).
  pure function block_node_numbers(self) result(number)
    class(contact_block_t), intent(in) :: self
    integer :: number(size(self%contact_node))
    number = self%contact_node
    if (allocated(self%whole_node)) number = self%whole_node
  end function block_node_numbers

  !> Build the operator of all pairs.
  subroutine build_operator(dimension, n_bodies, pairs, surfaces_a, surfaces_b, operator)
    !> Dimension of space.
    integer, intent(in) :: dimension
    !> Number of bodies.
    integer, intent(in) :: n_bodies
    !> Pairs (n_pairs).
    type(contact_pair_t), intent(in) :: pairs(:)
    !> Slave surfaces of the pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_a(:)
    !> Master surfaces of the pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_b(:)
    !> Operator.
    type(contact_operator_t), intent(out) :: operator
    integer :: k, b
    operator%dimension = dimension
    allocate (operator%pair_first_row(size(pairs) + 1), operator%block(n_bodies))
    operator%pair_first_row(1) = 1
    do k = 1, size(pairs)
      operator%pair_first_row(k + 1) = operator%pair_first_row(k) + pairs(k)%n_rows
    end do
    operator%n_rows = operator%pair_first_row(size(pairs) + 1) - 1
    allocate (operator%weight(operator%n_rows), operator%gap(operator%n_rows))
    do k = 1, size(pairs)
      associate (first => operator%pair_first_row(k), last => operator%pair_first_row(k + 1) - 1)
        operator%weight(first:last) = pairs(k)%row_weight
        operator%gap(first:last) = pairs(k)%row_gap
      end associate
    end do
    !$omp parallel do default(none) schedule(dynamic, 1) &
    !$omp shared(n_bodies, dimension, pairs, surfaces_a, surfaces_b, operator)
    do b = 1, n_bodies
      call build_block(dimension, b, pairs, surfaces_a, surfaces_b, operator%pair_first_row, operator%block(b))
    end do
    !$omp end parallel do
  end subroutine build_operator

  !> Build the block of one body.
  subroutine build_block(d, body, pairs, surfaces_a, surfaces_b, pair_first_row, block)
    !> Dimension of space, 2 or 3.
    integer, intent(in) :: d
    !> Index of the body.
    integer, intent(in) :: body
    !> Pairs (n_pairs).
    type(contact_pair_t), intent(in) :: pairs(:)
    !> Slave surfaces of the pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_a(:)
    !> Master surfaces of the pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_b(:)
    !> First row of each pair (n_pairs+1).
    integer, intent(in) :: pair_first_row(:)
    !> Block.
    type(contact_block_t), intent(inout) :: block
    type(sparse_rows_t), allocatable :: side_rows(:)
    integer, allocatable :: column_of(:)
    integer :: k, i, n, max_node
    max_node = 0
    n = 0
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) max_node = max(max_node, maxval(surfaces_a(k)%node))
      if (pairs(k)%body_b == body) max_node = max(max_node, maxval(surfaces_b(k)%node))
      if (any([pairs(k)%body_a, pairs(k)%body_b] == body)) n = n + 1
    end do
    allocate (column_of(max_node), side_rows(n))
    column_of = 0
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) call mark_nodes(surfaces_a(k), pairs(k)%facet_a, column_of)
      if (pairs(k)%body_b == body) call mark_nodes(surfaces_b(k), pairs(k)%facet_b, column_of)
    end do
    block%n_nodes = count(column_of > 0)
    allocate (block%contact_node(block%n_nodes), block%row(0))
    call number_nodes(column_of, block%contact_node)
    n = 0
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) call add_side(1.0_dp, pairs(k), surfaces_a(k), pairs(k)%facet_a, pairs(k)%xi_a)
      if (pairs(k)%body_b == body) call add_side(-1.0_dp, pairs(k), surfaces_b(k), pairs(k)%facet_b, pairs(k)%xi_b)
    end do
    call block%matrix%set_stacked(d*block%n_nodes, side_rows)

  contains

    !> Append the rows of one side of a pair.
    subroutine add_side(factor, pair, surface, facet, xi)
      !> 1 for body a, -1 for body b [].
      real(dp), intent(in) :: factor
      !> Contact pair.
      type(contact_pair_t), intent(in) :: pair
      !> Surface of this side.
      type(surface_t), intent(in) :: surface
      !> Facets of the points on this side (n_points).
      integer, intent(in) :: facet(:)
      !> Reference coordinates of the points (dimension-1, n_points) [].
      real(dp), intent(in) :: xi(:, :)
      type(sparse_rows_t) :: points
      call point_rows(d, factor, surface, pair%normal, facet, xi, column_of, points)
      n = n + 1
      call side_rows(n)%set_product(pair%average, points)
      block%row = [block%row, [(i, i=pair_first_row(k), pair_first_row(k + 1) - 1)]]
    end subroutine add_side
  end subroutine build_block

  !> Mark the nodes of facets that carry contact points.
  pure subroutine mark_nodes(surface, facet, mark)
    !> Surface.
    type(surface_t), intent(in) :: surface
    !> Facets of the points (n_points).
    integer, intent(in) :: facet(:)
    !> 1 at marked nodes (greatest node number).
    integer, intent(inout) :: mark(:)
    integer :: i
    do i = 1, size(facet)
      mark(surface%node(1:kind_nodes(surface%kind(facet(i))), facet(i))) = 1
    end do
  end subroutine mark_nodes

  !> Number the marked nodes in ascending order.
  pure subroutine number_nodes(mark, node)
    !> 1 at marked nodes on entry, their numbers on return (greatest node number).
    integer, intent(inout) :: mark(:)
    !> Marked nodes (n_nodes).
    integer, intent(out) :: node(:)
    integer :: i, n
    n = 0
    do i = 1, size(mark)
      if (mark(i) == 0) cycle
      n = n + 1
      mark(i) = n
      node(n) = i
    end do
  end subroutine number_nodes

  !> One row for each point of one side of a pair: factor * n_q . N_j.
  pure subroutine point_rows(d, factor, surface, normal, facet, xi, column_of, matrix)
    !> Dimension of space.
    integer, intent(in) :: d
    !> 1 for body a, -1 for body b [].
    real(dp), intent(in) :: factor
    !> Surface of this side.
    type(surface_t), intent(in) :: surface
    !> Normals at the points (d, n) [].
    real(dp), intent(in) :: normal(:, :)
    !> Facets of the points (n).
    integer, intent(in) :: facet(:)
    !> Reference coordinates of the points (d-1, n) [].
    real(dp), intent(in) :: xi(:, :)
    !> Contact node number of each node, 0 if none (greatest node number).
    integer, intent(in) :: column_of(:)
    !> The rows (n x d*n_nodes) [].
    type(sparse_rows_t), intent(inout) :: matrix
    real(dp) :: shape(max_facet_nodes)
    integer :: order(max_facet_nodes), i, j, c, n, kind, entry
    matrix%n_rows = size(facet)
    matrix%n_columns = d*count(column_of > 0)
    allocate (matrix%row_start(size(facet) + 1))
    matrix%row_start(1) = 1
    do i = 1, size(facet)
      matrix%row_start(i + 1) = matrix%row_start(i) + d*kind_nodes(surface%kind(facet(i)))
    end do
    allocate (matrix%column(matrix%row_start(size(facet) + 1) - 1))
    allocate (matrix%value(matrix%row_start(size(facet) + 1) - 1))
    do i = 1, size(facet)
      kind = surface%kind(facet(i))
      n = kind_nodes(kind)
      call shape_functions(kind, xi(:, i), shape(1:n))
      call sort_order(column_of(surface%node(1:n, facet(i))), order(1:n))
      entry = matrix%row_start(i)
      do j = 1, n
        do c = 1, d
          matrix%column(entry) = (column_of(surface%node(order(j), facet(i))) - 1)*d + c
          matrix%value(entry) = factor*normal(c, i)*shape(order(j))
          entry = entry + 1
        end do
      end do
    end do
  end subroutine point_rows
end module dotyk_contact_operator
