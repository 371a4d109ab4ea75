!> Adding small dense matrices where their rows and columns are in larger ones.
module dotyk_linalg_extend_add
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private
  public :: add_update, clear_lower, locate

contains

  !> The lower triangle of a square, zero.
  pure subroutine clear_lower(n, square)
    integer, intent(in) :: n
    real(dp), intent(inout) :: square(n, n)
    integer :: j
    do j = 1, n
      square(j:, j) = 0
    end do
  end subroutine clear_lower

  !> Add a child's update to its parent's panel and update.
  pure subroutine add_update(n, place, child, columns, rows, panel, update)
    !> Order of the child's update, columns and rows of the parent.
    integer, intent(in) :: n, columns, rows
    !> Where its rows are in the parent, ascending from 0 (n).
    integer, intent(in) :: place(n)
    real(dp), intent(in) :: child(n, n)
    real(dp), intent(inout) :: panel(0:rows - 1, 0:columns - 1), update(columns:rows - 1, columns:rows - 1)
    integer :: i, j
    do j = 1, n
      if (place(j) < columns) then
        do i = j, n
          panel(place(i), place(j)) = panel(place(i), place(j)) + child(i, j)
        end do
      else
        do i = j, n
          update(place(i), place(j)) = update(place(i), place(j)) + child(i, j)
        end do
      end if
    end do
  end subroutine add_update

  !> Places (from 0) of some numbers in a longer list, both ascending.
  pure subroutine locate(m, number, n, list, place)
    integer, intent(in) :: m, n
    integer(int64), intent(in) :: number(m), list(n)
    integer, intent(out) :: place(m)
    integer :: i, low, high, middle
    low = 1
    high = n
    do while (low < high)
      middle = (low + high)/2
      if (list(middle) < number(1)) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    do i = 1, m
      do while (list(low) < number(i))
        low = low + 1
      end do
      place(i) = low - 1
    end do
  end subroutine locate
end module dotyk_linalg_extend_add
