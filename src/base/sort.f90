!> Sorting: a stable merge sort, N log N.
module dotyk_base_sort
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: sort_order

contains

  !> The permutation that sorts: order(1) is the place of the least. Equal values stay in their order.
  pure subroutine sort_order(values, order)
    !> What to sort (n).
    real(dp), intent(in) :: values(:)
    !> The permutation (n).
    integer, intent(out) :: order(size(values))
    integer, allocatable :: from(:)
    integer :: n, width, start, i
    n = size(values)
    order = [(i, i=1, n)]
    width = 1
    do while (width < n)
      from = order
      do start = 1, n, 2*width
        call merge_runs(values, from, start, min(start + width, n + 1), min(start + 2*width, n + 1), order)
      end do
      width = 2*width
    end do
  end subroutine sort_order

  !> Merge the sorted runs start .. middle-1 and middle .. last-1.
  pure subroutine merge_runs(values, from, start, middle, last, order)
    real(dp), intent(in) :: values(:)
    !> The order before.
    integer, intent(in) :: from(:)
    integer, intent(in) :: start, middle, last
    !> The order after; entries outside of the runs are kept.
    integer, intent(inout) :: order(:)
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
