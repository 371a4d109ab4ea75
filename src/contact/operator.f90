!> The contact operator: all that a scheme sees of contact (DESIGN.md, section 2).
!>
!> Row i has weight w_i, gap d_i, penalty parameter theta_i, and (B u)_i = n_i . (u_a(x_i) - u_b(x'_i)), a combination
!> of the Cartesian displacements of the nodes of two facets. B is stored body by body: the block of a body has the
!> rows that touch it.
module dotyk_contact_operator
  use dotyk_base_kinds, only: dp
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_mesh_element, only: kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> The columns of B that belong to one body.
  type, public :: contact_block_t
    !> Number of nodes.
    integer :: n_nodes = 0
    !> Body-local numbers of the nodes that B touches (n_nodes), ascending.
    integer, allocatable :: contact_node(:)
    !> Rows of the operator that touch the body (matrix%n_rows), ascending.
    integer, allocatable :: row(:)
    !> Those rows; column (i-1)*dimension + component of contact node i.
    type(sparse_rows_t) :: matrix
  end type contact_block_t

  !> The operator.
  type, public :: contact_operator_t
    !> Number of rows.
    integer :: n_rows = 0
    !> Dimension of space.
    integer :: dimension = 0
    !> Rows of pair k are pair_first_row(k) .. pair_first_row(k+1)-1 (n_pairs+1).
    integer, allocatable :: pair_first_row(:)
    !> Weights w (n_rows) [length^2].
    real(dp), allocatable :: weight(:)
    !> Gaps d (n_rows) [length].
    real(dp), allocatable :: gap(:)
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), allocatable :: theta(:)
    !> One block per body; empty where nothing touches the body.
    type(contact_block_t), allocatable :: block(:)
  contains
    procedure :: apply => operator_apply
    procedure :: apply_transposed => operator_apply_transposed
  end type contact_operator_t

  public :: build_operator

contains

  !> Build the operator of all pairs.
  subroutine build_operator(dimension, n_bodies, pairs, surfaces_a, surfaces_b, operator)
    !> Dimension of space.
    integer, intent(in) :: dimension
    !> Number of bodies.
    integer, intent(in) :: n_bodies
    !> Pairs (n_pairs).
    type(contact_pair_t), intent(in) :: pairs(:)
    !> Surfaces of each pair (n_pairs).
    type(surface_t), intent(in) :: surfaces_a(:), surfaces_b(:)
    !> The operator.
    type(contact_operator_t), intent(out) :: operator
    integer :: k, b
    operator%dimension = dimension
    allocate (operator%pair_first_row(size(pairs) + 1), operator%block(n_bodies))
    operator%pair_first_row(1) = 1
    do k = 1, size(pairs)
      operator%pair_first_row(k + 1) = operator%pair_first_row(k) + pairs(k)%n_points
    end do
    operator%n_rows = operator%pair_first_row(size(pairs) + 1) - 1
    allocate (operator%weight(operator%n_rows), operator%gap(operator%n_rows), operator%theta(operator%n_rows))
    do k = 1, size(pairs)
      associate (first => operator%pair_first_row(k), last => operator%pair_first_row(k + 1) - 1)
        operator%weight(first:last) = pairs(k)%weight
        operator%gap(first:last) = pairs(k)%gap
        operator%theta(first:last) = pairs(k)%theta
      end associate
    end do
    do b = 1, n_bodies
      call build_block(dimension, b, pairs, surfaces_a, surfaces_b, operator%pair_first_row, operator%block(b))
    end do
  end subroutine build_operator

  !> Build the block of one body.
  subroutine build_block(d, body, pairs, surfaces_a, surfaces_b, pair_first_row, block)
    !> Dimension of space and index of the body.
    integer, intent(in) :: d, body
    type(contact_pair_t), intent(in) :: pairs(:)
    type(surface_t), intent(in) :: surfaces_a(:), surfaces_b(:)
    !> First row of each pair (n_pairs+1).
    integer, intent(in) :: pair_first_row(:)
    type(contact_block_t), intent(inout) :: block
    integer, allocatable :: column_of(:)
    integer :: k, n_rows, n_entries, most
    n_rows = 0
    n_entries = 0
    most = 0
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) call count_side(surfaces_a(k), pairs(k)%facet_a)
      if (pairs(k)%body_b == body) call count_side(surfaces_b(k), pairs(k)%facet_b)
    end do
    allocate (column_of(most))
    column_of = 0
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) call mark_nodes(surfaces_a(k), pairs(k)%facet_a, column_of)
      if (pairs(k)%body_b == body) call mark_nodes(surfaces_b(k), pairs(k)%facet_b, column_of)
    end do
    block%n_nodes = count(column_of > 0)
    allocate (block%contact_node(block%n_nodes), block%row(n_rows))
    n_entries = d*n_entries
    block%matrix%n_rows = n_rows
    block%matrix%n_columns = d*block%n_nodes
    allocate (block%matrix%row_start(n_rows + 1), block%matrix%column(n_entries), block%matrix%value(n_entries))
    call number_nodes(column_of, block%contact_node)
    n_rows = 0
    block%matrix%row_start(1) = 1
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) call fill_rows(d, 1.0_dp, pair_first_row(k), surfaces_a(k), pairs(k)%normal, &
                                                  pairs(k)%facet_a, pairs(k)%xi_a, column_of, n_rows, block)
      if (pairs(k)%body_b == body) call fill_rows(d, -1.0_dp, pair_first_row(k), surfaces_b(k), pairs(k)%normal, &
                                                  pairs(k)%facet_b, pairs(k)%xi_b, column_of, n_rows, block)
    end do

  contains

    !> Add up rows, nodes in rows, and the greatest node number of one side of a pair.
    subroutine count_side(surface, facet)
      type(surface_t), intent(in) :: surface
      integer, intent(in) :: facet(:)
      integer :: i
      n_rows = n_rows + size(facet)
      do i = 1, size(facet)
        n_entries = n_entries + kind_nodes(surface%kind(facet(i)))
      end do
      most = max(most, maxval(surface%node))
    end subroutine count_side
  end subroutine build_block

  !> Mark the nodes of facets that carry contact points.
  pure subroutine mark_nodes(surface, facet, mark)
    type(surface_t), intent(in) :: surface
    !> Facets of the points.
    integer, intent(in) :: facet(:)
    !> 1 at marked nodes.
    integer, intent(inout) :: mark(:)
    integer :: i
    do i = 1, size(facet)
      mark(surface%node(1:kind_nodes(surface%kind(facet(i))), facet(i))) = 1
    end do
  end subroutine mark_nodes

  !> Number the marked nodes in ascending order.
  pure subroutine number_nodes(mark, node)
    !> 1 at marked nodes on entry, their numbers on return.
    integer, intent(inout) :: mark(:)
    !> Marked nodes.
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

  !> Append the rows of one side of a pair to a block: factor * n_i . N_j.
  pure subroutine fill_rows(d, factor, first_row, surface, normal, facet, xi, column_of, n_rows, block)
    !> Dimension of space.
    integer, intent(in) :: d
    !> 1 for body a, -1 for body b.
    real(dp), intent(in) :: factor
    !> Row of the operator of the first point.
    integer, intent(in) :: first_row
    type(surface_t), intent(in) :: surface
    !> Normals (d, n), facets (n) and reference coordinates (d-1, n) of the points.
    real(dp), intent(in) :: normal(:, :)
    integer, intent(in) :: facet(:)
    real(dp), intent(in) :: xi(:, :)
    !> Contact node number of each node, 0 if none.
    integer, intent(in) :: column_of(:)
    !> Rows filled so far.
    integer, intent(inout) :: n_rows
    type(contact_block_t), intent(inout) :: block
    real(dp) :: shape(max_facet_nodes)
    integer :: order(max_facet_nodes), i, j, c, n, kind, first
    do i = 1, size(facet)
      kind = surface%kind(facet(i))
      n = kind_nodes(kind)
      call shape_functions(kind, xi(:, i), shape(1:n))
      call sort_positions(column_of(surface%node(1:n, facet(i))), order(1:n))
      n_rows = n_rows + 1
      block%row(n_rows) = first_row + i - 1
      first = block%matrix%row_start(n_rows)
      do j = 1, n
        do c = 1, d
          block%matrix%column(first) = (column_of(surface%node(order(j), facet(i))) - 1)*d + c
          block%matrix%value(first) = factor*normal(c, i)*shape(order(j))
          first = first + 1
        end do
      end do
      block%matrix%row_start(n_rows + 1) = first
    end do
  end subroutine fill_rows

  !> Positions of a few numbers in ascending order.
  pure subroutine sort_positions(number, order)
    integer, intent(in) :: number(:)
    integer, intent(out) :: order(:)
    integer :: i, j, current
    do i = 1, size(number)
      current = i
      do j = i - 1, 1, -1
        if (number(order(j)) < number(current)) exit
        order(j + 1) = order(j)
      end do
      order(j + 1) = current
    end do
  end subroutine sort_positions

  !> Add the part of one body to B u.
  subroutine operator_apply(self, body, u, y)
    class(contact_operator_t), intent(in) :: self
    !> Index of the body.
    integer, intent(in) :: body
    !> Displacements of its contact nodes (dimension, block%n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :)
    !> B u (n_rows) [length].
    real(dp), intent(inout), contiguous :: y(:)
    associate (block => self%block(body))
      call add_product(block%matrix%n_rows, block%matrix%row_start, block%matrix%column, block%matrix%value, &
                       block%row, u, y)
    end associate
  end subroutine operator_apply

  !> The part of one body of B^T z: with z = w p the contact forces are minus this.
  subroutine operator_apply_transposed(self, body, z, force)
    class(contact_operator_t), intent(in) :: self
    !> Index of the body.
    integer, intent(in) :: body
    !> Factor of the rows (n_rows).
    real(dp), intent(in), contiguous :: z(:)
    !> Product at the contact nodes of the body (dimension, block%n_nodes).
    real(dp), intent(out), contiguous :: force(:, :)
    force = 0
    associate (block => self%block(body))
      call add_transposed(block%matrix%n_rows, block%matrix%row_start, block%matrix%column, block%matrix%value, &
                          block%row, z, force)
    end associate
  end subroutine operator_apply_transposed

  !> y(row) = y(row) + A x.
  pure subroutine add_product(n, start, column, value, row, x, y)
    !> Number of rows.
    integer, intent(in) :: n
    !> The matrix.
    integer, intent(in) :: start(n + 1), column(*)
    real(dp), intent(in) :: value(*)
    !> Where each row goes.
    integer, intent(in) :: row(n)
    real(dp), intent(in) :: x(*)
    real(dp), intent(inout) :: y(*)
    real(dp) :: sum
    integer :: i, k
    do i = 1, n
      sum = 0
      do k = start(i), start(i + 1) - 1
        sum = sum + value(k)*x(column(k))
      end do
      y(row(i)) = y(row(i)) + sum
    end do
  end subroutine add_product

  !> x = x + A^T y(row).
  pure subroutine add_transposed(n, start, column, value, row, y, x)
    !> Number of rows.
    integer, intent(in) :: n
    !> The matrix.
    integer, intent(in) :: start(n + 1), column(*)
    real(dp), intent(in) :: value(*)
    !> Where each row comes from.
    integer, intent(in) :: row(n)
    real(dp), intent(in) :: y(*)
    real(dp), intent(inout) :: x(*)
    integer :: i, k
    do i = 1, n
      if (.not. abs(y(row(i))) > 0) cycle   ! most points of a scene are open
      do k = start(i), start(i + 1) - 1
        x(column(k)) = x(column(k)) + value(k)*y(row(i))
      end do
    end do
  end subroutine add_transposed
end module dotyk_contact_operator
