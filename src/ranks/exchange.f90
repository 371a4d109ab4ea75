!> What ranks exchange: the parts of a whole that each of them has computed, so that all of them go on with the same
!> numbers.
!>
!> Every rank runs the same program. What has the size of the contact surfaces is on every rank, and the same to the
!> bit; what has the size of a volume belongs to one rank. Items, mostly bodies, have an owner, and after an exchange
!> every rank has the values of all items; sums over items are then made in the order of the items, whatever the number
!> of ranks. With each exchange the ranks agree on interrupts (`dotyk_base_interrupt`). In a program on one rank
!> nothing happens here.
module dotyk_ranks_exchange
  use dotyk_base_error, only: error_slot_t, error_t, set_error, exit_machine
  use dotyk_base_interrupt, only: agree_on_interrupt, is_asked
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: print_error
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_timer, only: processor_time, wall_time
  use dotyk_ranks_communication, only: add_integers, collect_reals, end_ranks, gather_integers, gather_reals, greet, &
    greeting_length, n_ranks, this_rank
  implicit none
  private
  public :: by_owner, is_own, share, share_errors, share_parcel, agree_on_error, on_any_rank, meet, exchange_cost, &
    collect, add_counts, add_up, gather_all, greatest, join

  type, public :: exchange_cost_t  !! What exchanges have cost this rank so far.
    real(dp) :: waited = 0  !! Time in which it waited for other ranks [s].
    real(dp) :: processor = 0  !! Processor time spent on that: waiting ranks ask for messages all the time [s].
    integer(int64) :: n = 0  !! Number of exchanges.
    real(dp) :: bytes = 0  !! Numbers that it got from other ranks [bytes].
  end type exchange_cost_t

  type(exchange_cost_t) :: cost  !! That of this rank.

  type, public :: item_t  !! Values of one item.
    real(dp), allocatable :: value(:)  !! (any) [any]; not allocated where there are none.
  end type item_t

  !> Make the values of all items known to all ranks.
  interface share
    module procedure :: share_items, share_values, share_logicals
  end interface share

  !> Kinds of exchanges, the first number of a greeting.
  integer(int64), parameter :: of_items = 1, of_values = 2, of_flag = 3, of_meeting = 4, of_parts = 5, &
    of_sums = 6, of_lists = 7, of_counts = 8, of_joined = 9
  integer, parameter, public :: all_ranks = -1  !! Owner of items that all ranks compute together and have.
  integer(int64), parameter :: not_there = -1  !! Size of an item that is not allocated.

contains

  !> What exchanges have cost this rank so far.
  type(exchange_cost_t) function exchange_cost()
    exchange_cost = cost
  end function exchange_cost

  !> Wait for the other ranks, and agree on interrupts.
  subroutine meet()
    if (n_ranks() == 1) return
    call agree_on(of_meeting, 0_int64)
  end subroutine meet

  !> Whether this rank computes an item, alone or with all others.
  elemental logical function is_own(owner)
    integer, intent(in) :: owner  !! Rank of the item, or `all_ranks`.
    is_own = owner == this_rank() .or. owner == all_ranks
  end function is_own

  !> Whether there is something to exchange. Items of all ranks are agreed on, no more: they have no other owner beside
  !> them.
  logical function is_shared(owner)
    integer, intent(in) :: owner(:)  !! Rank of each item (n_items).
    is_shared = n_ranks() > 1
    if (.not. is_shared .or. size(owner) == 0) return
    is_shared = owner(1) /= all_ranks
    if (.not. is_shared) call meet()
  end function is_shared

  !> Whether something holds on any rank.
  logical function on_any_rank(holds) result(any_holds)
    logical, intent(in) :: holds  !! Whether it holds on this rank.
    integer(int64) :: all(greeting_length, n_ranks())
    any_holds = holds
    if (n_ranks() == 1) return
    call greet([of_flag, 0_int64, merge(1_int64, 0_int64, is_asked()), merge(1_int64, 0_int64, holds)], all)
    call check(all, 2)
    any_holds = any(all(4, :) /= 0)
  end function on_any_rank

  !> Values of the items of all ranks.
  subroutine share_items(owner, item, same)
    integer, intent(in) :: owner(:)  !! Rank that has each item (n_items).
    type(item_t), intent(inout) :: item(:)  !! Items of this rank in, all of them out (n_items).
    real(dp), intent(in), optional :: same(:)  !! Numbers that must be the same on all ranks, for a check.
    integer(int64) :: length(size(item)), n(n_ranks()), first
    integer(int64), allocatable :: own_length(:), all_length(:)
    real(dp), allocatable :: own(:), all(:)
    integer :: i, k, order(size(item))
    if (.not. is_shared(owner)) return
    length = not_there
    do i = 1, size(item)
      if (owner(i) == this_rank() .and. allocated(item(i)%value)) length(i) = size(item(i)%value, kind=int64)
    end do
    call agree_on(of_items, size(item, kind=int64), same)
    own_length = pack(length, owner == this_rank())
    allocate (all_length(size(item)))
    order = by_owner(owner)
    call gather_integers(own_length, numbers(owner, [(1_int64, i=1, size(item))]), all_length)
    length(order) = all_length
    n = numbers(owner, max(0_int64, length))
    allocate (own(n(this_rank() + 1)), all(sum(n)))
    first = 0
    do i = 1, size(item)
      if (owner(i) /= this_rank() .or. length(i) < 0) cycle
      own(first + 1:first + length(i)) = item(i)%value
      first = first + length(i)
    end do
    call gather_reals(own, n, all)
    cost%bytes = cost%bytes + 8*(size(all, kind=int64) - size(own, kind=int64))
    first = 0
    do k = 1, size(item)
      i = order(k)
      if (owner(i) /= this_rank()) then
        if (allocated(item(i)%value)) deallocate (item(i)%value)
        if (length(i) >= 0) item(i)%value = all(first + 1:first + length(i))
      end if
      first = first + max(0_int64, length(i))
    end do
  end subroutine share_items

  !> One number of each item.
  subroutine share_values(owner, value)
    integer, intent(in) :: owner(:)  !! Rank that has each item (n_items).
    real(dp), intent(inout) :: value(:)  !! Values of the items of this rank in, of all out (n_items) [any].
    real(dp) :: all(size(value))
    integer :: i
    if (.not. is_shared(owner)) return
    call agree_on(of_values, size(value, kind=int64))
    call gather_reals(pack(value, owner == this_rank()), numbers(owner, [(1_int64, i=1, size(value))]), all)
    value(by_owner(owner)) = all
  end subroutine share_values

  !> One logical of each item.
  subroutine share_logicals(owner, value)
    integer, intent(in) :: owner(:)  !! Rank that has each item (n_items).
    logical, intent(inout) :: value(:)  !! Values of the items of this rank in, of all out (n_items).
    real(dp) :: number(size(value))
    if (.not. is_shared(owner)) return
    number = merge(1.0_dp, 0.0_dp, value)
    call share_values(owner, number)
    value = number > 0
  end subroutine share_logicals

  !> Items that the ranks have put into parcels with their procedures `carry`, each its own in ascending order: all of
  !> them, to be taken out in the order of `by_owner`. Nothing is exchanged of items of all ranks, nor on one rank.
  subroutine share_parcel(owner, parcel)
    integer, intent(in) :: owner(:)  !! Rank that has each item (n_items).
    type(parcel_t), intent(inout) :: parcel  !! Written in, read out; empty where nothing is exchanged.
    integer(int64), allocatable :: word(:)
    if (is_shared(owner)) then
      call gather_all(parcel%words(), word)
    else
      allocate (word(0))
    end if
    call parcel%open(word)
  end subroutine share_parcel

  !> Sums of the numbers of all ranks, in the order of the ranks.
  subroutine add_up(value)
    real(dp), intent(inout) :: value(:)  !! Those of this rank in, their sums on all ranks out (n) [any].
    real(dp) :: all(size(value), n_ranks())
    if (n_ranks() == 1) return
    call gather_alike(value, all)
    value = sum(all, dim=2)
  end subroutine add_up

  !> Sums of the integers of all ranks.
  subroutine add_counts(value)
    integer(int64), intent(inout) :: value(:)  !! Those of this rank in, their sums on all ranks out (n).
    if (n_ranks() == 1) return
    call agree_on(of_counts, size(value, kind=int64))
    call add_integers(value)
  end subroutine add_counts

  !> The greatest of the numbers of all ranks.
  subroutine greatest(value)
    real(dp), intent(inout) :: value(:)  !! Those of this rank in, the greatest ones on all ranks out (n) [any].
    real(dp) :: all(size(value), n_ranks())
    if (n_ranks() == 1) return
    call gather_alike(value, all)
    value = maxval(all, dim=2)
  end subroutine greatest

  !> As many numbers of each rank.
  subroutine gather_alike(value, all)
    real(dp), intent(in) :: value(:)  !! Those of this rank (n) [any].
    real(dp), intent(out) :: all(:, :)  !! Those of all ranks (n, n_ranks) [as value].
    real(dp) :: flat(size(all))
    call agree_on(of_sums, size(value, kind=int64))
    call gather_reals(value, spread(size(value, kind=int64), 1, n_ranks()), flat)
    all = reshape(flat, shape(all))
  end subroutine gather_alike

  !> Parts of all ranks on the first one, one rank after the other.
  subroutine collect(own, all)
    real(dp), intent(in) :: own(:)  !! Those of this rank (any) [any].
    real(dp), allocatable, intent(out) :: all(:)  !! Those of all ranks on the first, size 0 on others (any) [as own].
    integer(int64) :: n(n_ranks())
    if (n_ranks() == 1) then
      all = own
      return
    end if
    call find_lengths(of_parts, size(own, kind=int64), n)
    allocate (all(merge(sum(n), 0_int64, this_rank() == 0)))
    call collect_reals(own, n, all)
    cost%bytes = cost%bytes + 8*max(0_int64, size(all, kind=int64) - size(own, kind=int64))
  end subroutine collect

  !> Integers of all ranks on all ranks, one rank after the other.
  subroutine gather_all(own, all)
    integer(int64), intent(in) :: own(:)  !! Those of this rank (any).
    integer(int64), allocatable, intent(out) :: all(:)  !! Those of all ranks (any).
    integer(int64) :: n(n_ranks())
    call find_lengths(of_lists, size(own, kind=int64), n)
    allocate (all(sum(n)))
    call gather_integers(own, n, all)
    cost%bytes = cost%bytes + 8*(size(all, kind=int64) - size(own, kind=int64))
  end subroutine gather_all

  !> Parts of all ranks on all of them, one rank after the other.
  subroutine join(own, all)
    real(dp), intent(in) :: own(:)  !! Those of this rank (any) [any].
    real(dp), allocatable, intent(out) :: all(:)  !! Those of all ranks (any) [as own].
    integer(int64) :: n(n_ranks())
    if (n_ranks() == 1) then
      all = own
      return
    end if
    call find_lengths(of_joined, size(own, kind=int64), n)
    allocate (all(sum(n)))
    call gather_reals(own, n, all)
    cost%bytes = cost%bytes + 8*(size(all, kind=int64) - size(own, kind=int64))
  end subroutine join

  !> Lengths of the parts of all ranks, where their exchange begins.
  subroutine find_lengths(what, own, n)
    integer(int64), intent(in) :: what  !! Kind of the exchange.
    integer(int64), intent(in) :: own  !! Length of the part of this rank.
    integer(int64), intent(out) :: n(:)  !! Lengths of those of all ranks (n_ranks).
    call agree_on(what, 1_int64)
    call gather_integers([own], spread(1_int64, 1, n_ranks()), n)
  end subroutine find_lengths

  !> Errors of the items of all ranks, so that all ranks report all of them.
  subroutine share_errors(owner, failed)
    integer, intent(in) :: owner(:)  !! Rank that has each item (n_items).
    type(error_slot_t), intent(inout) :: failed(:)  !! Errors of the items of this rank in, of all out (n_items).
    type(item_t), allocatable :: text(:)
    character(:), allocatable :: message
    integer :: i, k
    if (.not. is_shared(owner)) return
    if (.not. on_any_rank(any([(owner(i) == this_rank() .and. allocated(failed(i)%error), i=1, size(failed))]))) return
    allocate (text(size(failed)))
    do i = 1, size(failed)
      if (owner(i) /= this_rank() .or. .not. allocated(failed(i)%error)) cycle
      associate (error => failed(i)%error)
        text(i)%value = [real(error%code, dp), (real(iachar(error%message(k:k)), dp), k=1, len(error%message))]
      end associate
    end do
    call share_items(owner, text)
    do i = 1, size(failed)
      if (owner(i) == this_rank() .or. .not. allocated(text(i)%value)) cycle
      message = repeat(' ', size(text(i)%value) - 1)
      do k = 1, len(message)
        message(k:k) = achar(nint(text(i)%value(k + 1)))
      end do
      call set_error(failed(i)%error, message, nint(text(i)%value(1)))
    end do
  end subroutine share_errors

  !> An error of one rank becomes that of all: where several have one, that of the lowest.
  subroutine agree_on_error(error)
    type(error_t), allocatable, intent(inout) :: error  !! That of this rank in, the same on all ranks out.
    type(error_slot_t) :: failed(n_ranks())
    integer :: r
    call move_alloc(error, failed(this_rank() + 1)%error)
    call share_errors([(r, r=0, n_ranks() - 1)], failed)
    do r = 1, n_ranks()
      if (.not. allocated(failed(r)%error)) cycle
      call move_alloc(failed(r)%error, error)
      return
    end do
  end subroutine agree_on_error

  !> Begin an exchange: all ranks do the same, with the same numbers, and agree on interrupts.
  subroutine agree_on(what, n, same)
    integer(int64), intent(in) :: what  !! Kind of the exchange.
    integer(int64), intent(in) :: n  !! Number of items.
    real(dp), intent(in), optional :: same(:)  !! Numbers that must be the same on all ranks.
    integer(int64) :: all(greeting_length, n_ranks()), sum
    real(dp) :: began, began_processor
    sum = 0
    if (present(same)) sum = checksum(same)
    began = wall_time()
    began_processor = processor_time()
    call greet([what, n, merge(1_int64, 0_int64, is_asked()), sum], all)
    cost%waited = cost%waited + (wall_time() - began)
    cost%processor = cost%processor + (processor_time() - began_processor)
    cost%n = cost%n + 1
    call check(all, 4)
  end subroutine agree_on

  !> End all ranks where they are not about to do the same: an error of the program, or processors that round
  !> differently. Agree on interrupts.
  subroutine check(all, n_alike)
    integer(int64), intent(in) :: all(:, :)  !! Greetings of all ranks (greeting_length, n_ranks).
    integer, intent(in) :: n_alike  !! How many of their numbers must be alike, but for the third one.
    integer :: i, code
    do i = 1, n_alike
      if (i == 3 .or. .not. any(all(i, :) /= all(i, 1))) cycle
      code = exit_machine
      if (this_rank() == 0) call print_error('the ranks do not agree on their results, so that none are written: '// &
                                             'run all of them on processors of one kind, or fewer of them')
      call end_ranks(code)
      stop exit_machine, quiet=.true.
    end do
    call agree_on_interrupt(any(all(3, :) /= 0))
  end subroutine check

  !> A number that tells arrays apart that differ in any bit.
  pure integer(int64) function checksum(value) result(sum)
    real(dp), intent(in) :: value(:)  !! Numbers (n).
    integer :: i
    sum = size(value)
    do i = 1, size(value)
      sum = ieor(ishftc(sum, 5), transfer(value(i), sum))
    end do
  end function checksum

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
end module dotyk_ranks_exchange
