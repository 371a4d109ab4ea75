!> Contact pairs that share bodies: what is zero in the systems of active sets, in which order to eliminate, and what that costs.
module dotyk_scheme_pair_graph
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_tree, only: block_tree_t
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: couple_pairs, elimination_cost, link_members, order_pairs

contains

  !> Pairs that share a body.
  subroutine couple_pairs(problem, start, neighbour)
    type(contact_problem_t), intent(in) :: problem
    !> Neighbours of pair k, without itself: neighbour(start(k):start(k+1)-1) (n_pairs + 1).
    integer, allocatable, intent(out) :: start(:), neighbour(:)
    integer, allocatable :: first(:), member(:), next(:)
    integer :: n_pairs, pass, k, i, b
    associate (pair_first => problem%operator%pair_first_row, body => problem%coarse%body)
      n_pairs = size(pair_first) - 1
      allocate (first(size(problem%operator%block) + 1), next(size(problem%operator%block)))
      first = 0
      first(1) = 1
      do pass = 1, 2
        do k = 1, n_pairs
          if (pair_first(k + 1) == pair_first(k)) cycle
          do i = 1, 2
            b = body(i, pair_first(k))
            if (b == 0) cycle
            if (pass == 1) first(b + 1) = first(b + 1) + 1
            if (pass == 1) cycle
            member(next(b)) = k
            next(b) = next(b) + 1
          end do
        end do
        if (pass == 2) exit
        do b = 1, size(next)
          first(b + 1) = first(b) + first(b + 1)
        end do
        next = first(:size(next))
        allocate (member(first(size(first)) - 1))
      end do
    end associate
    call link_members(first, member, n_pairs, start, neighbour)
  end subroutine couple_pairs

  !> Items that stand in the same list.
  subroutine link_members(first, member, n, start, neighbour)
    !> List l: member(first(l):first(l+1)-1), each item once (n_lists + 1).
    integer, intent(in) :: first(:), member(:)
    !> Number of items.
    integer, intent(in) :: n
    !> Neighbours of item k, without itself: neighbour(start(k):start(k+1)-1) (n + 1).
    integer, allocatable, intent(out) :: start(:), neighbour(:)
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
  end subroutine link_members

  !> In which order the pairs are eliminated.
  subroutine order_pairs(start, neighbour, n_points, order, error)
    !> As in `couple_pairs`.
    integer, intent(in) :: start(:), neighbour(:)
    !> Points of each pair (n_pairs).
    integer, intent(in) :: n_points(:)
    !> The pair that comes k-th (n_pairs).
    integer, allocatable, intent(out) :: order(:)
    type(error_t), allocatable, intent(out) :: error
    allocate (order(size(n_points)))
    call nested_dissection(start, neighbour, order, error, weight=max(1, n_points))
  end subroutine order_pairs

  !> Operations and entries of a Cholesky factorization by dense blocks, one for each couple of pairs.
  subroutine elimination_cost(problem, n_points, flops, entries)
    type(contact_problem_t), intent(in) :: problem
    !> Points of each pair (n_pairs).
    integer, intent(in) :: n_points(:)
    real(dp), intent(out) :: flops, entries
    type(error_t), allocatable :: error
    type(block_tree_t) :: tree
    integer, allocatable :: start(:), neighbour(:), order(:)
    integer :: k
    call couple_pairs(problem, start, neighbour)
    call order_pairs(start, neighbour, n_points, order, error)
    if (allocated(error)) order = [(k, k=1, size(n_points))]
    call tree%init(n_points, start, neighbour, order)
    flops = tree%operations()
    entries = real(tree%entries(), dp) - sum(real(tree%width, dp)**2)/2
  end subroutine elimination_cost
end module dotyk_scheme_pair_graph
