!> Sorting: a stable merge sort of order N log N, with insertion sort on short runs.
module dotyk_base_sort
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> The permutation that sorts numbers; equal numbers keep their order.
  interface sort_order
    module procedure sort_order_of_reals, sort_order_of_integers
  end interface sort_order

  public :: sort_order

  integer, parameter :: short = 16  !! Length of the runs that are sorted by insertion: short lists need no workspace.

contains

  !> The permutation that sorts reals: values(order) ascends.
  pure subroutine sort_order_of_reals(values, order)
    real(dp), intent(in) :: values(:)  !! Numbers to sort (n) [any].
    integer, intent(out) :: order(size(values))  !! The permutation (n).
    integer, allocatable :: from(:)
    integer :: n, width, start
    n = size(values)
    do start = 1, n, short
      call insert_run(values, start, min(start + short - 1, n), order)
    end do
    width = short
    do while (width < n)
      from = order
      do start = 1, n, 2*width
        call merge_runs(values, from, start, min(start + width, n + 1), min(start + 2*width, n + 1), order)
      end do
      width = 2*width
    end do
  end subroutine sort_order_of_reals

  !> The permutation that sorts integers: values(order) ascends.
  pure subroutine sort_order_of_integers(values, order)
    integer, intent(in) :: values(:)  !! Numbers to sort (n).
    integer, intent(out) :: order(size(values))  !! The permutation (n).
    ! Doubles hold all 32-bit integers exactly.
    call sort_order_of_reals(real(values, dp), order)
  end subroutine sort_order_of_integers

  !> Sort the run first .. last by insertion.
  pure subroutine insert_run(values, first, last, order)
    real(dp), intent(in) :: values(:)  !! Numbers to sort (n) [any].
    integer, intent(in) :: first  !! First place of the run.
    integer, intent(in) :: last  !! Last place of the run.
    integer, intent(inout) :: order(:)  !! The permutation (n); entries outside of the run are kept.
    integer :: i, k
    do i = first, last
      k = i
      do while (k > first)
        if (values(order(k - 1)) <= values(i)) exit
        order(k) = order(k - 1)
        k = k - 1
      end do
      order(k) = i
    end do
  end subroutine insert_run

  !> Merge the sorted runs start .. middle-1 and middle .. last-1.
  pure subroutine merge_runs(values, from, start, middle, last, order)
    real(dp), intent(in) :: values(:)  !! Numbers to sort (n) [any].
    integer, intent(in) :: from(:)  !! The order before (n).
    integer, intent(in) :: start  !! First place of the first run.
    integer, intent(in) :: middle  !! First place of the second run.
    integer, intent(in) :: last  !! Place behind the second run.
    integer, intent(inout) :: order(:)  !! The order after (n); entries outside of the runs are kept.
    logical :: first
    integer :: i, j, k
    i = start
    j = middle
    do k = start, last - 1
      first = i < middle
      if (first .and. j < last) first = values(from(i)) <= values(from(j))
      if (first) then
        order(k) = from(i)
        i = i + 1
      else
        order(k) = from(j)
        j = j + 1
      end if
    end do
  end subroutine merge_runs
end module dotyk_base_sort
