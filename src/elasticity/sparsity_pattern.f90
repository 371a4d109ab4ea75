!> The pattern of a stiffness matrix, and the place of nodal blocks in it.
!>
!> Equations are numbered by nodes, so that the column of an equation of node b holds the later equations of b, then
!> those of its neighbours a > b, block after block. One offset per pair of nodes finds a block in all columns of b.
module dotyk_elasticity_sparsity_pattern
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private

  !> Where the blocks are. Neighbours of node b beyond it: `neighbour(first(b) : first(b + 1) - 1)`, ascending.
  type, public :: block_positions_t
    !> First greater neighbour of each node (n_nodes + 1).
    integer, allocatable :: first(:)
    !> Greater neighbours.
    integer, allocatable :: neighbour(:)
    !> Number of rows between the block of a node with itself and that with the neighbour.
    integer, allocatable :: offset(:)
    !> Number of equations of each node (n_nodes).
    integer, allocatable :: n_free(:)
  end type block_positions_t

  public :: build_pattern, scatter

contains

  !> Pattern of the lower triangle of a matrix over the equations of the nodes of a graph.
  subroutine build_pattern(dim, equation, start, neighbour, places, matrix)
    !> Number of components of a node.
    integer, intent(in) :: dim
    !> Equations by nodes, ascending, 0 for none (dim, n_nodes).
    integer, intent(in), contiguous :: equation(:, :)
    !> Adjacency as of `node_graph`.
    integer, intent(in) :: start(:), neighbour(:)
    !> Where the blocks are.
    type(block_positions_t), intent(out) :: places
    !> The matrix with zeros as values.
    type(sparse_symmetric_t), intent(inout) :: matrix
    integer, allocatable :: rows(:)
    integer :: n, b, k, last
    n = size(equation, 2)
    allocate (places%first(n + 1), places%n_free(n))
    allocate (places%neighbour(size(neighbour)/2), places%offset(size(neighbour)/2))
    last = 0
    do b = 1, n
      places%n_free(b) = count(equation(:, b) > 0)
      places%first(b) = last + 1
      do k = start(b), start(b + 1) - 1
        if (neighbour(k) > b) last = last + 1
      end do
    end do
    places%first(n + 1) = last + 1
    call matrix%destroy()
    matrix%n = sum(places%n_free)
    allocate (rows(n), matrix%column_start(matrix%n + 1))
    !$omp parallel do default(none) shared(n, start, neighbour, places, rows) private(k, last) schedule(static)
    do b = 1, n
      rows(b) = 0
      last = places%first(b)
      do k = start(b), start(b + 1) - 1
        if (neighbour(k) < b) cycle
        places%neighbour(last) = neighbour(k)
        places%offset(last) = rows(b)
        rows(b) = rows(b) + places%n_free(neighbour(k))
        last = last + 1
      end do
    end do
    !$omp end parallel do
    call start_columns(n, places%n_free, rows, matrix%column_start)
    allocate (matrix%row(matrix%column_start(matrix%n + 1)), matrix%value(matrix%column_start(matrix%n + 1)))
    !$omp parallel do default(none) shared(n, dim, equation, places, matrix) schedule(static)
    do b = 1, n
      call fill_rows(b, n, dim, equation, places%first, places%neighbour, matrix%column_start, matrix%row, matrix%value)
    end do
    !$omp end parallel do
  end subroutine build_pattern

  !> Lengths of the columns.
  pure subroutine start_columns(n, n_free, rows, column_start)
    integer, intent(in) :: n
    !> Equations of each node, and those of its greater neighbours (n).
    integer, intent(in) :: n_free(n), rows(n)
    !> 0-based.
    integer(int64), intent(out) :: column_start(:)
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

  !> The rows of the columns of a node, and zeros as values.
  pure subroutine fill_rows(b, n, dim, equation, first, neighbour, column_start, row, value)
    integer, intent(in) :: b, n, dim
    integer, intent(in) :: equation(dim, n)
    integer, intent(in) :: first(:), neighbour(:)
    !> 0-based.
    integer(int64), intent(in) :: column_start(:)
    !> 0-based.
    integer(int64), intent(inout) :: row(:)
    real(dp), intent(inout) :: value(:)
    integer(int64) :: last, diagonal, next, source
    integer :: i, j, k, column
    diagonal = 0
    next = 0
    do j = 1, dim
      column = equation(j, b)
      if (column == 0) cycle
      last = column_start(column)
      if (diagonal > 0) then
        ! Each further column of a node is the one before without its first entry.
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

  !> Add an element's stiffness to the matrix.
  pure subroutine scatter(n, dim, n_nodes, node, k, share, owner, equation, n_free, first, neighbour, offset, &
      column_start, value)
    !> Number of nodes of the element, components of a node, nodes of the body.
    integer, intent(in) :: n, dim, n_nodes
    !> Nodes of the element.
    integer, intent(in) :: node(n)
    !> Stiffness: node a, node b, component i, component j.
    real(dp), intent(in) :: k(n, n, dim, dim)
    !> A share, and the one that each node belongs to: columns of nodes of others are left to these.
    integer, intent(in) :: share, owner(n_nodes)
    !> Equations by nodes, 0 for none.
    integer, intent(in) :: equation(dim, n_nodes)
    !> Places of the blocks; see `block_positions_t`.
    integer, intent(in) :: n_free(n_nodes), first(n_nodes + 1), neighbour(*), offset(*)
    !> Column starts, 0-based.
    integer(int64), intent(in) :: column_start(*)
    !> Values of the matrix.
    real(dp), intent(inout) :: value(*)
    integer :: order(n), ia, ib, a, b, i, j, p, rank
    integer(int64) :: base(dim), place
    call sort_nodes(n, node, order)
    do ib = 1, n
      b = order(ib)
      if (n_free(node(b)) == 0 .or. owner(node(b)) /= share) cycle
      rank = 0
      base = 0
      do j = 1, dim
        if (equation(j, node(b)) == 0) cycle
        place = column_start(equation(j, node(b)))
        do i = j, dim
          if (equation(i, node(b)) == 0) cycle
          place = place + 1
          value(place) = value(place) + k(b, b, i, j)
        end do
        rank = rank + 1
        base(j) = place
      end do
      p = first(node(b))
      do ia = ib + 1, n
        a = order(ia)
        do while (neighbour(p) /= node(a))
          p = p + 1
        end do
        if (rank == dim .and. n_free(node(a)) == dim) then
          do j = 1, dim
            place = base(j) + offset(p)
            do i = 1, dim
              value(place + i) = value(place + i) + k(a, b, i, j)
            end do
          end do
        else
          do j = 1, dim
            if (equation(j, node(b)) == 0) cycle
            place = base(j) + offset(p)
            do i = 1, dim
              if (equation(i, node(a)) == 0) cycle
              place = place + 1
              value(place) = value(place) + k(a, b, i, j)
            end do
          end do
        end if
      end do
    end do
  end subroutine scatter

  !> The order of an element's nodes by their numbers.
  pure subroutine sort_nodes(n, node, order)
    integer, intent(in) :: n
    integer, intent(in) :: node(n)
    integer, intent(out) :: order(n)
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
