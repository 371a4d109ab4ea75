!> The work of a loop, divided over ranks: each has a portion of successive items, and then all have the results of all
!> items, in their order.
!>
!> The result of an item must depend on nothing but what all ranks know: then the numbers are those of one rank, to the
!> bit. All ranks come to the same exchanges in the same order, none of them inside an OpenMP region.
module dotyk_ranks_division
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_sort, only: sort_order
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: all_ranks, join, on_any_rank
  implicit none
  private

  type, public :: division_t  !! Whether and how ranks divide the work of a loop.
    logical :: is_divided = .false.  !! Whether they do; otherwise this rank does all of it, and exchanges nothing.
  contains
    procedure, private :: portion_of_costs, portion_of_items
    !> The items of a rank.
    generic :: portion => portion_of_costs, portion_of_items
    procedure :: any_holds => division_any_holds
    procedure, private :: fill_values, fill_columns, fill_integers, fill_logicals
    !> Make the results of all portions known to all ranks.
    generic :: fill => fill_values, fill_columns, fill_integers, fill_logicals
    procedure :: append => division_append
  end type division_t

  !> From this number of facets or nodes of two bodies on, ranks divide a search between them: below, the exchanges take
  !> as long.
  real(dp), parameter, public :: least_divided = 1000
  !> Work for a facet or node far from the other surface, relative to that for a near one [].
  real(dp), parameter, public :: distant_cost = 0.02_dp
  integer, parameter :: portions = 4  !! Items with less than this part of the work of a rank are dealt out whole.

  public :: deal_out

contains

  !> A rank for each item of a list: large ones are divided among all, the others are dealt out, the largest first, each
  !> to the rank with least work so far.
  pure function deal_out(cost, least) result(owner)
    real(dp), intent(in) :: cost(:)  !! Work of the items, not negative (n) [any].
    real(dp), intent(in) :: least  !! Work from which on it pays to divide an item [as cost].
    integer :: owner(size(cost))  !! Ranks, or `all_ranks` (n).
    real(dp) :: load(n_ranks()), total
    integer :: order(size(cost)), i, r
    owner = this_rank()
    if (n_ranks() == 1) return
    load = 0
    total = sum(cost)
    call sort_order(-cost, order)
    do i = 1, size(cost)
      if (cost(order(i)) >= max(least, total/(real(portions, dp)*n_ranks()))) then
        owner(order(i)) = all_ranks
        cycle
      end if
      r = minloc(load, dim=1)
      owner(order(i)) = r - 1
      load(r) = load(r) + cost(order(i))
    end do
  end function deal_out

  !> The items of a rank, of which each takes as much work.
  pure subroutine portion_of_items(self, n, first, last, rank)
    class(division_t), intent(in) :: self
    integer, intent(in) :: n  !! Number of items.
    integer, intent(out) :: first  !! First item of the rank.
    integer, intent(out) :: last  !! Its last item; first-1 where it has none.
    integer, intent(in), optional :: rank  !! The rank; this one if absent.
    integer :: r
    first = 1
    last = n
    if (.not. self%is_divided) return
    r = this_rank()
    if (present(rank)) r = rank
    first = int(int(r, int64)*n/n_ranks()) + 1
    last = int((r + 1_int64)*n/n_ranks())
  end subroutine portion_of_items

  !> The items of a rank: about as much work for each.
  pure subroutine portion_of_costs(self, cost, first, last)
    class(division_t), intent(in) :: self
    real(dp), intent(in) :: cost(:)  !! Work of the items, not negative (n) [any].
    integer, intent(out) :: first  !! First item of this rank.
    integer, intent(out) :: last  !! Its last item; first-1 where it has none.
    real(dp) :: total, before
    integer :: i, owner
    first = 1
    last = size(cost)
    if (.not. self%is_divided) return
    total = max(sum(cost), tiny(total))
    last = 0
    before = 0
    do i = 1, size(cost)
      ! Where the middle of its work falls.
      owner = min(n_ranks() - 1, int((before + cost(i)/2)/total*n_ranks()))
      before = before + cost(i)
      if (owner > this_rank()) exit
      if (owner < this_rank()) first = i + 1
      last = i
    end do
  end subroutine portion_of_costs

  !> Whether something holds on any rank that has a portion.
  logical function division_any_holds(self, holds) result(any_holds)
    class(division_t), intent(in) :: self
    logical, intent(in) :: holds  !! Whether it holds for this rank.
    any_holds = holds
    if (self%is_divided) any_holds = on_any_rank(holds)
  end function division_any_holds

  !> As many numbers of each item.
  subroutine fill_columns(self, value, first, last)
    class(division_t), intent(in) :: self
    real(dp), intent(inout) :: value(:, :)  !! Those of the portion of this rank in, of all out (any, n) [any].
    integer, intent(in) :: first  !! First item of this rank.
    integer, intent(in) :: last  !! Its last item.
    real(dp), allocatable :: all(:)
    if (.not. self%is_divided) return
    call join_numbers(size(value, 1, int64)*(last - first + 1), value(:, first:last), all)
    value = reshape(all, shape(value))
  end subroutine fill_columns

  !> One number of each item.
  subroutine fill_values(self, value, first, last)
    class(division_t), intent(in) :: self
    real(dp), intent(inout), contiguous, target :: value(:)  !! Those of this rank in, of all out (n) [any].
    integer, intent(in) :: first  !! First item of this rank.
    integer, intent(in) :: last  !! Its last item.
    real(dp), pointer :: columns(:, :)
    columns(1:1, 1:size(value)) => value
    call fill_columns(self, columns, first, last)
  end subroutine fill_values

  !> One integer of each item.
  subroutine fill_integers(self, value, first, last)
    class(division_t), intent(in) :: self
    integer, intent(inout) :: value(:)  !! Those of the portion of this rank in, of all out (n).
    integer, intent(in) :: first  !! First item of this rank.
    integer, intent(in) :: last  !! Its last item.
    real(dp), allocatable :: numbers(:)
    if (.not. self%is_divided) return
    numbers = value
    call fill_values(self, numbers, first, last)
    value = nint(numbers)
  end subroutine fill_integers

  !> One logical of each item.
  subroutine fill_logicals(self, value, first, last)
    class(division_t), intent(in) :: self
    logical, intent(inout) :: value(:)  !! Those of the portion of this rank in, of all out (n).
    integer, intent(in) :: first  !! First item of this rank.
    integer, intent(in) :: last  !! Its last item.
    real(dp), allocatable :: numbers(:)
    if (.not. self%is_divided) return
    numbers = merge(1.0_dp, 0.0_dp, value)
    call fill_values(self, numbers, first, last)
    value = numbers > 0
  end subroutine fill_logicals

  !> Lists of any length of the portions, one after the other.
  subroutine division_append(self, list)
    class(division_t), intent(in) :: self
    real(dp), allocatable, intent(inout) :: list(:, :)  !! That of this rank in, those of all ranks out (rows, n) [any].
    real(dp), allocatable :: all(:)
    integer :: rows
    if (.not. self%is_divided) return
    rows = size(list, 1)
    call join_numbers(size(list, kind=int64), list, all)
    deallocate (list)
    list = reshape(all, [int(rows, int64), size(all, kind=int64)/rows])
  end subroutine division_append

  !> Numbers of all ranks, whatever the shape of those of this one.
  subroutine join_numbers(n, own, all)
    integer(int64), intent(in) :: n  !! How many this rank has.
    real(dp), intent(in) :: own(n)  !! Those of this rank (n) [any].
    real(dp), allocatable, intent(out) :: all(:)  !! Those of all ranks (any) [as own].
    call join(own, all)
  end subroutine join_numbers
end module dotyk_ranks_division
