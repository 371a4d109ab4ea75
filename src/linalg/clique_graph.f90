!> The graph of items that stand in the same list, such as contact pairs of one body: each list is a clique.
module dotyk_linalg_clique_graph
  implicit none
  private
  public :: make_clique_graph

contains

  !> Neighbours of all items. Cost and storage are those of the graph: quadratic in the lengths of the lists, not in the
  !> number of items.
  pure subroutine make_clique_graph(first, member, n, start, neighbour)
    integer, intent(in) :: first(:)  !! List l is member(first(l):first(l+1)-1) (n_lists + 1).
    integer, intent(in) :: member(:)  !! Items of the lists, each once in a list (length of all lists).
    integer, intent(in) :: n  !! Number of items.
    !> Neighbours of item k, without k itself: neighbour(start(k):start(k+1)-1) (n + 1).
    integer, allocatable, intent(out) :: start(:)
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
end module dotyk_linalg_clique_graph
