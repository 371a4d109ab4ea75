!> Contact pairs that one rank each has discretized, made known to all ranks.
module dotyk_contact_pair_exchange
  use dotyk_base_kinds, only: int64
  use dotyk_base_parcel, only: parcel_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: all_ranks, gather_all
  implicit none
  private
  public :: share_pairs

contains

  !> Make pairs known to all ranks.
  subroutine share_pairs(owner, pair)
    !> Rank of each pair, or `all_ranks` where all have it; the same on all ranks (n_pairs).
    integer, intent(in) :: owner(:)
    type(contact_pair_t), intent(inout) :: pair(:)  !! Those of this rank in, all out (n_pairs).
    type(parcel_t) :: parcel
    integer(int64), allocatable :: word(:)
    integer :: k, rank
    if (n_ranks() == 1 .or. all(owner == all_ranks)) return
    call carry_pairs(this_rank())
    call gather_all(parcel%words(), word)
    call parcel%open(word)
    do rank = 0, n_ranks() - 1
      call carry_pairs(rank)
    end do

  contains

    !> The pairs of a rank, into the parcel or out of it.
    subroutine carry_pairs(of_rank)
      integer, intent(in) :: of_rank  !! The rank.
      do k = 1, size(pair)
        if (owner(k) == of_rank) call pair(k)%carry(parcel)
      end do
    end subroutine carry_pairs
  end subroutine share_pairs
end module dotyk_contact_pair_exchange
