!> Shares of a mesh (`dotyk_mesh_layer_share`) that ranks exchange.
module dotyk_model_share_exchange
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_layer_share, only: layer_share_t
  use dotyk_ranks_exchange, only: deliver, gather_all
  implicit none
  private
  public :: deliver_shares, gather_shares

contains

  !> Shares for other ranks, to them.
  subroutine deliver_shares(share, number, x)
    type(layer_share_t), intent(in) :: share(0:)  !! That for each rank; none where not allocated (0:n_ranks-1).
    integer(int64), allocatable, intent(out) :: number(:)  !! Whole numbers of those that came (any).
    real(dp), allocatable, intent(out) :: x(:)  !! Their coordinates (any) [length].
    integer(int64), allocatable :: sent(:), got(:)
    integer(int64) :: n(size(share)), n_from(size(share)), done
    integer :: r
    n = 0
    do r = 0, size(share) - 1
      if (allocated(share(r)%number)) n(r + 1) = size(packed(share(r)), kind=int64)
    end do
    allocate (sent(sum(n)))
    done = 0
    do r = 0, size(share) - 1
      if (n(r + 1) > 0) sent(done + 1:done + n(r + 1)) = packed(share(r))
      done = done + n(r + 1)
    end do
    call deliver(sent, n, got, n_from)
    call unpack_shares(got, number, x)
  end subroutine deliver_shares

  !> One share of each rank, to all ranks.
  subroutine gather_shares(share, number, x)
    type(layer_share_t), intent(in) :: share  !! That of this rank.
    integer(int64), allocatable, intent(out) :: number(:)  !! Whole numbers of those of all ranks (any).
    real(dp), allocatable, intent(out) :: x(:)  !! Their coordinates (any) [length].
    integer(int64), allocatable :: all(:)
    call gather_all(packed(share), all)
    call unpack_shares(all, number, x)
  end subroutine gather_shares

  !> A share as one list: the lengths, whole numbers, bits of the coordinates (any).
  pure function packed(share) result(list)
    type(layer_share_t), intent(in) :: share  !! The share.
    integer(int64), allocatable :: list(:)
    list = [size(share%number, kind=int64), size(share%x, kind=int64), share%number, &
            transfer(share%x, [integer(int64) ::], size(share%x))]
  end function packed

  !> Shares, one after the other.
  pure subroutine unpack_shares(list, number, x)
    integer(int64), intent(in) :: list(:)  !! As from `packed` (any).
    integer(int64), allocatable, intent(out) :: number(:)  !! Whole numbers of all of them (any).
    real(dp), allocatable, intent(out) :: x(:)  !! Their coordinates (any) [length].
    integer(int64) :: at, n, m, n_numbers, n_x
    integer :: pass
    do pass = 1, 2
      at = 0
      n_numbers = 0
      n_x = 0
      do while (at < size(list, kind=int64))
        n = list(at + 1)
        m = list(at + 2)
        if (pass == 2) then
          number(n_numbers + 1:n_numbers + n) = list(at + 3:at + 2 + n)
          x(n_x + 1:n_x + m) = transfer(list(at + 3 + n:at + 2 + n + m), [real(dp) ::], int(m))
        end if
        n_numbers = n_numbers + n
        n_x = n_x + m
        at = at + 2 + n + m
      end do
      if (pass == 1) allocate (number(n_numbers), x(n_x))
    end do
  end subroutine unpack_shares
end module dotyk_model_share_exchange
