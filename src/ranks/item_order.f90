!> The order in which ranks exchange items that each have an owner.
module dotyk_ranks_item_order
  use dotyk_base_kinds, only: int64
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: by_owner, numbers

contains

  !> Items in the order in which they are gathered: by ranks, then by their own order.
  pure function by_owner(owner) result(order)
    integer, intent(in) :: owner(:)  !! Rank of each item (n_items).
    integer :: order(size(owner)), first(0:maxval([owner, 0]) + 1), i
    first = 0
    do i = 1, size(owner)
      first(owner(i) + 1) = first(owner(i) + 1) + 1
    end do
    do i = 1, ubound(first, 1)
      first(i) = first(i) + first(i - 1)
    end do
    do i = 1, size(owner)
      first(owner(i)) = first(owner(i)) + 1
      order(first(owner(i))) = i
    end do
  end function by_owner

  !> Numbers that each rank has.
  pure function numbers(owner, length) result(n)
    integer, intent(in) :: owner(:)  !! Rank of each item (n_items).
    integer(int64), intent(in) :: length(:)  !! Numbers of each item (n_items).
    integer(int64) :: n(n_ranks())
    integer :: i
    n = 0
    do i = 1, size(owner)
      n(owner(i) + 1) = n(owner(i) + 1) + length(i)
    end do
  end function numbers
end module dotyk_ranks_item_order
