!> A sparse symmetric matrix as a sum of dense blocks on sets of rows (cliques), and an order of elimination. In the
!> graph of items that stand in the same list, such as contact pairs of one body, each list is a clique.
module dotyk_linalg_clique_matrix
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: assemble_cliques, make_clique_graph

  type, public :: clique_t  !! A dense symmetric block.
    integer, allocatable :: row(:)  !! Rows, ascending (m).
    real(dp), allocatable :: value(:, :)  !! (m, m) [any]
  end type clique_t

contains

  !> The sum of the blocks; the diagonal is always stored.
  subroutine assemble_cliques(clique, first, matrix, order, error)
    type(clique_t), intent(in) :: clique(:)  !! The blocks.
    !> Groups of successive rows that have the same cliques: first(g) .. first(g+1)-1 (n_groups + 1).
    integer, intent(in) :: first(:)
    type(sparse_symmetric_t), intent(inout) :: matrix  !! The sum.
    integer, allocatable, intent(out) :: order(:)  !! Row that is eliminated k-th: nested dissection of the groups (n).
    type(error_t), allocatable, intent(out) :: error  !! METIS has no memory.
    integer, allocatable :: group_of(:), list_start(:), member(:), start(:), neighbour(:), group_order(:)
    integer, allocatable :: clique_start(:), clique_of(:), place(:)
    real(dp), allocatable :: column(:)
    logical, allocatable :: is_set(:)
    integer :: c, i, j, k, g, n, n_groups
    integer(int64) :: at
    n_groups = size(first) - 1
    n = first(n_groups + 1) - 1
    allocate (group_of(n), list_start(size(clique) + 1), order(n), group_order(n_groups))
    do g = 1, n_groups
      group_of(first(g):first(g + 1) - 1) = g
    end do
    list_start(1) = 1
    allocate (member(sum([(size(clique(c)%row), c=1, size(clique))])))
    k = 0
    do c = 1, size(clique)
      do i = 1, size(clique(c)%row)
        g = group_of(clique(c)%row(i))
        if (i > 1) then
          if (g == member(k)) cycle
        end if
        k = k + 1
        member(k) = g
      end do
      list_start(c + 1) = k + 1
    end do
    call make_clique_graph(list_start, member(:k), n_groups, start, neighbour)
    call nested_dissection(start, neighbour, group_order, error, weight=first(2:) - first(:n_groups))
    if (allocated(error)) return
    k = 0
    do g = 1, n_groups
      do i = first(group_order(g)), first(group_order(g) + 1) - 1
        k = k + 1
        order(k) = i
      end do
    end do
    ! The cliques of each row, and its place in them.
    allocate (clique_start(n + 1), source=0)
    do c = 1, size(clique)
      clique_start(clique(c)%row + 1) = clique_start(clique(c)%row + 1) + 1
    end do
    clique_start(1) = 1
    do i = 1, n
      clique_start(i + 1) = clique_start(i) + clique_start(i + 1)
    end do
    allocate (clique_of(clique_start(n + 1) - 1), place(clique_start(n + 1) - 1))
    do c = 1, size(clique)
      do i = 1, size(clique(c)%row)
        associate (next => clique_start(clique(c)%row(i)))
          clique_of(next) = c
          place(next) = i
          next = next + 1
        end associate
      end do
    end do
    clique_start(2:) = clique_start(:n)
    clique_start(1) = 1
    call matrix%destroy()
    matrix%n = n
    allocate (matrix%column_start(n + 1))
    matrix%column_start(1) = 0
    do g = 1, n_groups
      ! Rows of a group have the columns of its first one, but for those of the group before them.
      at = 1
      if (clique_start(first(g) + 1) > clique_start(first(g))) at = entries_after(first(g))
      do j = first(g), first(g + 1) - 1
        matrix%column_start(j + 1) = matrix%column_start(j) + at
        at = max(1_int64, at - 1)
      end do
    end do
    allocate (matrix%row(matrix%column_start(n + 1)), matrix%value(matrix%column_start(n + 1)))
    allocate (column(n), is_set(n))
    column = 0
    is_set = .false.
    do j = 1, n
      at = matrix%column_start(j)
      is_set(j) = .true.
      do k = clique_start(j), clique_start(j + 1) - 1
        associate (own => clique(clique_of(k)), p => place(k))
          is_set(own%row(p:)) = .true.
          column(own%row(p:)) = column(own%row(p:)) + own%value(p:, p)
        end associate
      end do
      do i = j, n
        if (.not. is_set(i)) cycle
        at = at + 1
        matrix%row(at) = i - 1
        matrix%value(at) = column(i)
        column(i) = 0
        is_set(i) = .false.
        if (at == matrix%column_start(j + 1)) exit
      end do
    end do
  contains
    !> Rows from a row on that share a clique with it.
    integer(int64) function entries_after(row) result(entries)
      integer, intent(in) :: row  !! The row.
      integer :: l
      logical, allocatable :: seen(:)
      allocate (seen(n), source=.false.)
      do l = clique_start(row), clique_start(row + 1) - 1
        seen(clique(clique_of(l))%row(place(l):)) = .true.
      end do
      entries = count(seen)
    end function entries_after
  end subroutine assemble_cliques

  !> Neighbours of all items. Cost and storage are those of the graph: quadratic in the lengths of the lists, not in the
  !> number of items.
  pure subroutine make_clique_graph(first, member, n, start, neighbour)
    integer, intent(in) :: first(:)  !! List l is member(first(l):first(l+1)-1) (n_lists + 1).
    integer, intent(in) :: member(:)  !! Items of the lists, each once in a list (length of all lists).
    integer, intent(in) :: n  !! Number of items.
    integer, allocatable, intent(out) :: start(:)  !! Of item k without k: neighbour(start(k):start(k+1)-1) (n + 1).
    integer, allocatable, intent(out) :: neighbour(:)  !! See `start` (number of couplings).
    integer :: list_start(n + 1), next(n), list(size(member)), mark(n), pass, k, l, i, degree
    list_start = 0
    list_start(1) = 1
    do i = 1, size(member)
      list_start(member(i) + 1) = list_start(member(i) + 1) + 1
    end do
    do k = 1, n
      list_start(k + 1) = list_start(k) + list_start(k + 1)
    end do
    next = list_start(:n)
    do l = 1, size(first) - 1
      do i = first(l), first(l + 1) - 1
        list(next(member(i))) = l
        next(member(i)) = next(member(i)) + 1
      end do
    end do
    allocate (start(n + 1))
    start(1) = 1
    ! Count, then store.
    do pass = 1, 2
      mark = 0
      do k = 1, n
        mark(k) = k
        degree = 0
        do l = list_start(k), list_start(k + 1) - 1
          do i = first(list(l)), first(list(l) + 1) - 1
            if (mark(member(i)) == k) cycle
            mark(member(i)) = k
            if (pass == 2) neighbour(start(k) + degree) = member(i)
            degree = degree + 1
          end do
        end do
        start(k + 1) = start(k) + degree
      end do
      if (pass == 1) allocate (neighbour(start(n + 1) - 1))
    end do
  end subroutine make_clique_graph
end module dotyk_linalg_clique_matrix
