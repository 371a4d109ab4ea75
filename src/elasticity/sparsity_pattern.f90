!> Sparsity pattern of a stiffness matrix, and positions of its nodal blocks.
!>
!> Equations are numbered node by node: the column of an equation of node b holds the later equations of b, then those
!> of its neighbours a > b, block after block. One offset per pair of nodes locates a block in all columns of b.
module dotyk_elasticity_sparsity_pattern
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private

  !> Positions of the nodal blocks. Node b has the greater neighbours neighbour(first(b) : first(b + 1) - 1),
  !> ascending.
  type, public :: block_positions_t
    integer(int64), allocatable :: first(:)  !! First greater neighbour of each node (n_nodes + 1).
    integer, allocatable :: neighbour(:)  !! Greater neighbours, one node after the other (first(n_nodes + 1) - 1).
    !> Number of rows between the diagonal block of a node and its block with the neighbour (first(n_nodes + 1) - 1).
    integer, allocatable :: offset(:)
    integer, allocatable :: n_free(:)  !! Number of equations of each node (n_nodes).
  end type block_positions_t

  public :: build_pattern, scatter

contains

  !> Pattern of the lower triangle of a matrix over the equations of the nodes of a graph.
  subroutine build_pattern(dim, equation, start, neighbour, positions, matrix)
    integer, intent(in) :: dim  !! Number of components of a node.
    integer, intent(in), contiguous :: equation(:, :)  !! Equations by nodes, ascending, 0 for none (dim, n_nodes).
    integer(int64), intent(in) :: start(:)  !! First neighbour of each node, see `node_graph` (n_nodes + 1).
    integer, intent(in) :: neighbour(:)  !! Neighbours of the nodes, ascending (start(n_nodes + 1) - 1).
    type(block_positions_t), intent(out) :: positions  !! Positions of the nodal blocks.
    type(sparse_symmetric_t), intent(inout) :: matrix  !! The matrix, with zeros as values [force/length].
    integer, allocatable :: rows(:)
    integer(int64) :: k, last
    integer :: n, b
    n = size(equation, 2)
    allocate (positions%first(n + 1), positions%n_free(n))
    k = size(neighbour, kind=int64)/2
    allocate (positions%neighbour(k), positions%offset(k))
    last = 0
    do b = 1, n
      positions%n_free(b) = count(equation(:, b) > 0)
      positions%first(b) = last + 1
      do k = start(b), start(b + 1) - 1
        if (neighbour(k) > b) last = last + 1
      end do
    end do
    positions%first(n + 1) = last + 1
    call matrix%destroy()
    matrix%n = sum(positions%n_free)
    allocate (rows(n), matrix%column_start(matrix%n + 1))
    !$omp parallel do default(none) shared(n, start, neighbour, positions, rows) private(k, last) schedule(static)
    do b = 1, n
      rows(b) = 0
      last = positions%first(b)
      do k = start(b), start(b + 1) - 1
        if (neighbour(k) < b) cycle
        positions%neighbour(last) = neighbour(k)
        positions%offset(last) = rows(b)
        rows(b) = rows(b) + positions%n_free(neighbour(k))
        last = last + 1
      end do
    end do
    !$omp end parallel do
    call start_columns(n, positions%n_free, rows, matrix%column_start)
    allocate (matrix%row(matrix%column_start(matrix%n + 1)), matrix%value(matrix%column_start(matrix%n + 1)))
    !$omp parallel do default(none) shared(n, dim, equation, positions, matrix) schedule(static)
    do b = 1, n
      call fill_rows(b, n, dim, equation, positions%first, positions%neighbour, matrix%column_start, matrix%row, &
                     matrix%value)
    end do
    !$omp end parallel do
  end subroutine build_pattern

  !> Starts of the columns.
  pure subroutine start_columns(n, n_free, rows, column_start)
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: n_free(n)  !! Number of equations of each node (n).
    integer, intent(in) :: rows(n)  !! Number of equations of the greater neighbours of each node (n).
    integer(int64), intent(out) :: column_start(:)  !! First entry of each column, 0-based (n_equations + 1).
    integer :: b, k, column
    column = 0
    column_start(1) = 0
    do b = 1, n
      do k = n_free(b), 1, -1
        column = column + 1
        column_start(column + 1) = column_start(column) + rows(b) + k
      end do
    end do
  end subroutine start_columns

  !> Rows of the columns of a node, and zeros as values.
  pure subroutine fill_rows(b, n, dim, equation, first, neighbour, column_start, row, value)
    integer, intent(in) :: b  !! The node.
    integer, intent(in) :: n  !! Number of nodes.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: equation(dim, n)  !! Equations by nodes, 0 for none (dim, n).
    integer(int64), intent(in) :: first(:)  !! First greater neighbour of each node (n + 1).
    integer, intent(in) :: neighbour(:)  !! Greater neighbours (first(n + 1) - 1).
    integer(int64), intent(in) :: column_start(:)  !! First entry of each column, 0-based (n_equations + 1).
    integer(int64), intent(inout) :: row(:)  !! Row of each entry, 0-based (n_entries).
    real(dp), intent(inout) :: value(:)  !! Value of each entry (n_entries) [force/length].
    integer(int64) :: last, diagonal, next, source, k
    integer :: i, j, column
    diagonal = 0
    next = 0
    do j = 1, dim
      column = equation(j, b)
      if (column == 0) cycle
      last = column_start(column)
      if (diagonal > 0) then
        ! Each further column of a node is the previous one without its first entry.
        do source = diagonal + 1, next
          last = last + 1
          row(last) = row(source)
        end do
      else
        do i = j, dim
          if (equation(i, b) == 0) cycle
          last = last + 1
          row(last) = equation(i, b) - 1
        end do
        do k = first(b), first(b + 1) - 1
          do i = 1, dim
            if (equation(i, neighbour(k)) == 0) cycle
            last = last + 1
            row(last) = equation(i, neighbour(k)) - 1
          end do
        end do
      end if
      diagonal = column_start(column) + 1
      next = column_start(column + 1)
      value(diagonal:next) = 0
    end do
  end subroutine fill_rows

  !> Add an element stiffness to the matrix.
  pure subroutine scatter(n, dim, n_nodes, node, k, part, owner, equation, n_free, first, neighbour, offset, &
                          column_start, value)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: n_nodes  !! Number of nodes of the body.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    real(dp), intent(in) :: k(n, n, dim, dim)  !! Node a, node b, component i, component j [force/length].
    integer, intent(in) :: part  !! Index of the part, see `element_partition_t`.
    integer, intent(in) :: owner(n_nodes)  !! Owning part of each node; columns of others are left to them (n_nodes).
    integer, intent(in) :: equation(dim, n_nodes)  !! Equations by nodes, 0 for none (dim, n_nodes).
    integer, intent(in) :: n_free(n_nodes)  !! Number of equations of each node (n_nodes).
    integer(int64), intent(in) :: first(n_nodes + 1)  !! First greater neighbour of each node (n_nodes + 1).
    integer, intent(in) :: neighbour(*)  !! Greater neighbours, see `block_positions_t` (n_blocks).
    integer, intent(in) :: offset(*)  !! Row offsets of the blocks, see `block_positions_t` (n_blocks).
    integer(int64), intent(in) :: column_start(*)  !! First entry of each column, 0-based (n_equations + 1).
    real(dp), intent(inout) :: value(*)  !! Values of the matrix (n_entries) [force/length].
    integer :: order(n), ia, ib, a, b, i, j, rank
    integer(int64) :: base(dim), position, p
    call sort_nodes(n, node, order)
    do ib = 1, n
      b = order(ib)
      if (n_free(node(b)) == 0 .or. owner(node(b)) /= part) cycle
      rank = 0
      base = 0
      do j = 1, dim
        if (equation(j, node(b)) == 0) cycle
        position = column_start(equation(j, node(b)))
        do i = j, dim
          if (equation(i, node(b)) == 0) cycle
          position = position + 1
          value(position) = value(position) + k(b, b, i, j)
        end do
        rank = rank + 1
        base(j) = position
      end do
      p = first(node(b))
      do ia = ib + 1, n
        a = order(ia)
        do while (neighbour(p) /= node(a))
          p = p + 1
        end do
        if (rank == dim .and. n_free(node(a)) == dim) then
          do j = 1, dim
            position = base(j) + offset(p)
            do i = 1, dim
              value(position + i) = value(position + i) + k(a, b, i, j)
            end do
          end do
        else
          do j = 1, dim
            if (equation(j, node(b)) == 0) cycle
            position = base(j) + offset(p)
            do i = 1, dim
              if (equation(i, node(a)) == 0) cycle
              position = position + 1
              value(position) = value(position) + k(a, b, i, j)
            end do
          end do
        end if
      end do
    end do
  end subroutine scatter

  !> Order of the nodes of an element by their numbers: insertion sort of at most 27 numbers in the innermost kernel.
  pure subroutine sort_nodes(n, node, order)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    integer, intent(out) :: order(n)  !! Local index of the k-th node (n).
    integer :: i, k
    do i = 1, n
      k = i
      do while (k > 1)
        if (node(order(k - 1)) < node(i)) exit
        order(k) = order(k - 1)
        k = k - 1
      end do
      order(k) = i
    end do
  end subroutine sort_nodes
end module dotyk_elasticity_sparsity_pattern
