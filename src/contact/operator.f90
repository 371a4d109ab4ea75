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
  use dotyk_ranks_division, only: division_t
  implicit none
  private

  type, public :: contact_block_t  !! Columns of B that belong to one body.
    integer :: n_nodes = 0  !! Number of contact nodes.
    integer, allocatable :: contact_node(:)  !! Body-local numbers of the contact nodes, ascending (n_nodes).
    !> Their numbers in the whole body, the same for congruent bodies; not allocated where this rank holds all bodies
    !> wholly (n_nodes).
    integer, allocatable :: whole_node(:)
    integer, allocatable :: row(:)  !! Rows of the operator that involve the body, ascending (matrix%n_rows).
    !> These rows; column (i-1)*dimension + component of contact node i (size(row) x dimension*n_nodes) [].
    type(sparse_rows_t) :: matrix
  contains
    procedure :: node_numbers => block_node_numbers
  end type contact_block_t

  type, public :: contact_operator_t  !! The operator.
    integer :: n_rows = 0  !! Number of rows.
    integer :: dimension = 0  !! Dimension of space, 2 or 3.
    !> Rows of pair k are pair_first_row(k) .. pair_first_row(k+1)-1 (n_pairs+1).
    integer, allocatable :: pair_first_row(:)
    real(dp), allocatable :: weight(:)  !! Weights w (n_rows) [length^2; length in two dimensions].
    real(dp), allocatable :: gap(:)  !! Weighted gaps d (n_rows) [length].
    real(dp), allocatable :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    !> Blocks of the bodies; empty for bodies without contact (n_bodies).
    type(contact_block_t), allocatable :: block(:)
  end type contact_operator_t

  type :: body_sides_t  !! Rows of one body.
    type(sparse_rows_t), allocatable :: rows(:)  !! Those of each side of a pair that the body is (n_sides).
  end type body_sides_t

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
  subroutine build_operator(dimension, n_bodies, pairs, surfaces_a, surfaces_b, operator, divided)
    integer, intent(in) :: dimension  !! Dimension of space.
    integer, intent(in) :: n_bodies  !! Number of bodies.
    type(contact_pair_t), intent(in) :: pairs(:)  !! Pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_a(:)  !! Slave surfaces of the pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_b(:)  !! Master surfaces of the pairs (n_pairs).
    type(contact_operator_t), intent(out) :: operator  !! Operator.
    logical, intent(in), optional :: divided  !! Whether ranks divide the rows; not if absent.
    type(division_t) :: by
    type(body_sides_t), allocatable :: side(:)
    integer :: before(n_bodies + 1), k, b, first, last
    if (present(divided)) by%is_divided = divided
    operator%dimension = dimension
    allocate (operator%pair_first_row(size(pairs) + 1), operator%block(n_bodies), side(n_bodies))
    operator%pair_first_row(1) = 1
    do k = 1, size(pairs)
      operator%pair_first_row(k + 1) = operator%pair_first_row(k) + pairs(k)%n_rows
    end do
    operator%n_rows = operator%pair_first_row(size(pairs) + 1) - 1
    allocate (operator%weight(operator%n_rows), operator%gap(operator%n_rows), operator%theta(operator%n_rows))
    do k = 1, size(pairs)
      associate (first => operator%pair_first_row(k), last => operator%pair_first_row(k + 1) - 1)
        operator%weight(first:last) = pairs(k)%row_weight
        operator%gap(first:last) = pairs(k)%row_gap
        operator%theta(first:last) = pairs(k)%row_theta
      end associate
    end do
    ! Rows of the sides of the bodies before each one.
    before = 0
    do k = 1, size(pairs)
      before(pairs(k)%body_a + 1) = before(pairs(k)%body_a + 1) + pairs(k)%n_rows
      if (pairs(k)%body_b /= pairs(k)%body_a) &
        before(pairs(k)%body_b + 1) = before(pairs(k)%body_b + 1) + pairs(k)%n_rows
    end do
    do b = 1, n_bodies
      before(b + 1) = before(b) + before(b + 1)
    end do
    call by%portion(before(n_bodies + 1), first, last)
    !$omp parallel do default(none) schedule(dynamic, 1) &
    !$omp shared(n_bodies, pairs, surfaces_a, surfaces_b, operator, before, first, last, side)
    do b = 1, n_bodies
      call build_sides(b, pairs, surfaces_a, surfaces_b, operator%pair_first_row, first - before(b), &
                       last - before(b), operator%block(b), side(b)%rows)
    end do
    !$omp end parallel do
    if (by%is_divided) call share_rows(by, side)
    !$omp parallel do default(none) schedule(dynamic, 1) shared(n_bodies, dimension, operator, side)
    do b = 1, n_bodies
      call operator%block(b)%matrix%set_stacked(dimension*operator%block(b)%n_nodes, side(b)%rows)
      deallocate (side(b)%rows)
    end do
    !$omp end parallel do
  end subroutine build_operator

  !> Contact nodes and rows of one body, side by side of its pairs.
  subroutine build_sides(body, pairs, surfaces_a, surfaces_b, pair_first_row, first, last, block, side)
    integer, intent(in) :: body  !! Index of the body.
    type(contact_pair_t), intent(in) :: pairs(:)  !! Pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_a(:)  !! Slave surfaces of the pairs (n_pairs).
    type(surface_t), intent(in) :: surfaces_b(:)  !! Master surfaces of the pairs (n_pairs).
    integer, intent(in) :: pair_first_row(:)  !! First row of each pair (n_pairs+1).
    integer, intent(in) :: first  !! First of the rows of all sides, one side after the other, that is wanted.
    integer, intent(in) :: last  !! Last one.
    type(contact_block_t), intent(inout) :: block  !! Block; its matrix is not set.
    !> Rows of each side; empty where they are not wanted (n_sides).
    type(sparse_rows_t), allocatable, intent(out) :: side(:)
    integer, allocatable :: column_of(:)
    integer :: k, i, n, max_node, before
    max_node = 0
    n = 0
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) max_node = max(max_node, maxval(surfaces_a(k)%node))
      if (pairs(k)%body_b == body) max_node = max(max_node, maxval(surfaces_b(k)%node))
      if (any([pairs(k)%body_a, pairs(k)%body_b] == body)) n = n + 1
    end do
    allocate (column_of(max_node), side(n))
    column_of = 0
    do k = 1, size(pairs)
      if (pairs(k)%body_a == body) call mark_nodes(surfaces_a(k), pairs(k)%facet_a, column_of)
      if (pairs(k)%body_b == body) call mark_nodes(surfaces_b(k), pairs(k)%facet_b, column_of)
    end do
    block%n_nodes = count(column_of > 0)
    allocate (block%contact_node(block%n_nodes), block%row(0))
    call number_nodes(column_of, block%contact_node)
    n = 0
    before = 0
    do k = 1, size(pairs)
      if (all([pairs(k)%body_a, pairs(k)%body_b] /= body)) cycle
      n = n + 1
      call side_rows(pairs(k)%body_a == body, pairs(k)%body_b == body, pairs(k), surfaces_a(k), surfaces_b(k), &
                     column_of, block%n_nodes, min(max(1, first - before), pairs(k)%n_rows + 1), &
                     max(0, min(last - before, pairs(k)%n_rows)), side(n))
      before = before + pairs(k)%n_rows
      block%row = [block%row, [(i, i=pair_first_row(k), pair_first_row(k + 1) - 1)]]
    end do
  end subroutine build_sides

  !> Rows of one side of a pair, or of both where these are of one body: means over the points q of each row of
  !> n_q . N_j, with the sign of the side.
  subroutine side_rows(is_slave, is_master, pair, surface_a, surface_b, column_of, n_nodes, first, last, matrix)
    logical, intent(in) :: is_slave  !! Whether the body has the slave side.
    logical, intent(in) :: is_master  !! Whether it has the master side.
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Slave surface.
    type(surface_t), intent(in) :: surface_b  !! Master surface.
    integer, intent(in) :: column_of(:)  !! Contact node number of each node, 0 if none (greatest node number).
    integer, intent(in) :: n_nodes  !! Number of contact nodes.
    integer, intent(in) :: first  !! First row that is wanted.
    integer, intent(in) :: last  !! Last one; the others are empty.
    type(sparse_rows_t), intent(inout) :: matrix  !! The rows (pair%n_rows x dimension*n_nodes) [].
    integer, parameter :: first_room = 1024  !! Entries that there is room for at first.
    real(dp), allocatable :: value(:, :), more_values(:)
    integer, allocatable :: place(:), node(:), order(:), more(:)
    real(dp) :: shape(max_facet_nodes)
    integer :: d, i, j, k, c, n, q, entry
    d = pair%dimension
    matrix%n_rows = pair%n_rows
    matrix%n_columns = d*n_nodes
    allocate (matrix%row_start(pair%n_rows + 1), matrix%column(first_room), matrix%value(first_room))
    allocate (place(n_nodes), source=0)
    allocate (node(n_nodes), value(d, n_nodes))
    matrix%row_start(:first) = 1
    entry = 0
    do i = first, last
      n = 0
      do k = pair%average%row_start(i), pair%average%row_start(i + 1) - 1
        q = pair%average%column(k)
        if (is_slave) call add_point(surface_a, pair%facet_a(q), pair%xi_a(:, q))
        if (is_master) call add_point(surface_b, pair%facet_b(q), pair%xi_b(:, q), -pair%master_normal(q))
      end do
      if (entry + d*n > size(matrix%column)) then
        allocate (more(2*(entry + d*n)), more_values(2*(entry + d*n)))
        more(:entry) = matrix%column(:entry)
        more_values(:entry) = matrix%value(:entry)
        call move_alloc(more, matrix%column)
        call move_alloc(more_values, matrix%value)
      end if
      if (allocated(order)) deallocate (order)
      allocate (order(n))
      call sort_order(node(:n), order)
      do j = 1, n
        do c = 1, d
          entry = entry + 1
          matrix%column(entry) = (node(order(j)) - 1)*d + c
          matrix%value(entry) = value(c, order(j))
        end do
      end do
      place(node(:n)) = 0
      matrix%row_start(i + 1) = entry + 1
    end do
    matrix%row_start(last + 1:) = entry + 1
    matrix%column = matrix%column(:entry)
    matrix%value = matrix%value(:entry)

  contains

    !> Add what the nodes of a facet contribute to a point.
    subroutine add_point(surface, facet, xi, direction)
      type(surface_t), intent(in) :: surface  !! Surface of the facet.
      integer, intent(in) :: facet  !! The facet.
      real(dp), intent(in) :: xi(:)  !! Reference coordinates of the point (dimension-1) [].
      !> Component of the displacement that counts; that of the slave side if absent (dimension) [].
      real(dp), intent(in), optional :: direction(:)
      integer :: m, at, j
      m = kind_nodes(surface%kind(facet))
      call shape_functions(surface%kind(facet), xi, shape(1:m))
      do j = 1, m
        at = column_of(surface%node(j, facet))
        if (place(at) == 0) then
          n = n + 1
          place(at) = n
          node(n) = at
          value(:, n) = 0
        end if
        if (present(direction)) then
          value(:, place(at)) = value(:, place(at)) + pair%average%value(k)*(direction*shape(j))
        else
          value(:, place(at)) = value(:, place(at)) + pair%average%value(k)*pair%slave_part(q, j, shape(j))
        end if
      end do
    end subroutine add_point
  end subroutine side_rows

  !> Make the rows of all ranks known to all.
  subroutine share_rows(division, side)
    type(division_t), intent(in) :: division  !! How ranks divide the rows.
    !> Rows of the sides of all bodies, one side after the other; those of this rank in, all out (n_bodies).
    type(body_sides_t), intent(inout) :: side(:)
    real(dp), allocatable :: length(:), entries(:, :)
    integer :: b, s, i, n, m, first, last
    n = sum([(sum(side(b)%rows%n_rows), b=1, size(side))])
    m = sum([((size(side(b)%rows(s)%column), s=1, size(side(b)%rows)), b=1, size(side))])
    allocate (length(n), entries(2, m))
    call division%portion(n, first, last)
    n = 0
    m = 0
    do b = 1, size(side)
      do s = 1, size(side(b)%rows)
        associate (rows => side(b)%rows(s))
          length(n + 1:n + rows%n_rows) = rows%row_start(2:) - rows%row_start(:rows%n_rows)
          n = n + rows%n_rows
          entries(1, m + 1:m + size(rows%column)) = rows%column
          entries(2, m + 1:m + size(rows%column)) = rows%value
          m = m + size(rows%column)
        end associate
      end do
    end do
    call division%fill(length, first, last)
    call division%append(entries)
    n = 0
    m = 0
    do b = 1, size(side)
      do s = 1, size(side(b)%rows)
        associate (rows => side(b)%rows(s))
          do i = 1, rows%n_rows
            rows%row_start(i + 1) = rows%row_start(i) + nint(length(n + i))
          end do
          n = n + rows%n_rows
          i = rows%row_start(rows%n_rows + 1) - 1
          rows%column = nint(entries(1, m + 1:m + i))
          rows%value = entries(2, m + 1:m + i)
          m = m + i
        end associate
      end do
    end do
  end subroutine share_rows

  !> Mark the nodes of facets that carry contact points.
  pure subroutine mark_nodes(surface, facet, mark)
    type(surface_t), intent(in) :: surface  !! Surface.
    integer, intent(in) :: facet(:)  !! Facets of the points (n_points).
    integer, intent(inout) :: mark(:)  !! 1 at marked nodes (greatest node number).
    integer :: i
    do i = 1, size(facet)
      mark(surface%node(1:kind_nodes(surface%kind(facet(i))), facet(i))) = 1
    end do
  end subroutine mark_nodes

  !> Number the marked nodes in ascending order.
  pure subroutine number_nodes(mark, node)
    integer, intent(inout) :: mark(:)  !! 1 at marked nodes on entry, their numbers on return (greatest node number).
    integer, intent(out) :: node(:)  !! Marked nodes (n_nodes).
    integer :: i, n
    n = 0
    do i = 1, size(mark)
      if (mark(i) == 0) cycle
      n = n + 1
      mark(i) = n
      node(n) = i
    end do
  end subroutine number_nodes
end module dotyk_contact_operator
