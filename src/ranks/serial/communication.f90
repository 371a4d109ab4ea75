!> The one rank of a program without MPI.
module dotyk_ranks_communication
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: print_error
  use dotyk_base_memory, only: end_expected
  implicit none
  private
  public :: abort_ranks, start_ranks, end_ranks, this_rank, n_ranks, n_local_ranks, greet, gather_integers, &
    gather_reals, collect_reals, add_integers

  character(*), parameter, public :: built_with = ''  !! What the program is built with, for its version.
  integer, parameter, public :: greeting_length = 4  !! Numbers in a greeting.
  integer(int64), parameter, public :: is_ending = -1  !! First number of the greeting of a rank that ends.

contains

  !> Begin.
  subroutine start_ranks()
  end subroutine start_ranks

  !> End.
  subroutine end_ranks(code, message)
    integer, intent(inout) :: code  !! Exit code.
    character(*), intent(in), optional :: message  !! Error that is printed.
    if (present(message)) call print_error(message)
    call end_expected()
    associate (not_needed => code)
    end associate
  end subroutine end_ranks

  !> End the program at once.
  subroutine abort_ranks(code)
    integer, intent(in) :: code  !! Exit code.
    call end_expected()
    stop code, quiet=.true.
  end subroutine abort_ranks

  !> Rank of this process, from 0.
  pure integer function this_rank()
    this_rank = 0
  end function this_rank

  !> Number of ranks.
  pure integer function n_ranks()
    n_ranks = 1
  end function n_ranks

  !> Number of ranks on the node of this one.
  pure integer function n_local_ranks()
    n_local_ranks = 1
  end function n_local_ranks

  !> Say what this rank is about to do.
  pure subroutine greet(greeting, all)
    integer(int64), intent(in) :: greeting(greeting_length)  !! What it does.
    integer(int64), intent(out) :: all(:, :)  !! The same (greeting_length, 1).
    all(:, 1) = greeting
  end subroutine greet

  !> Integers of the one rank.
  pure subroutine gather_integers(own, n, all)
    integer(int64), intent(in) :: own(:)  !! Its integers.
    integer(int64), intent(in) :: n(:)  !! Their number (1).
    integer(int64), intent(out) :: all(:)  !! The same.
    all = own(:n(1))
  end subroutine gather_integers

  !> Reals of the one rank.
  pure subroutine gather_reals(own, n, all)
    real(dp), intent(in) :: own(:)  !! Its reals.
    integer(int64), intent(in) :: n(:)  !! Their number (1).
    real(dp), intent(out) :: all(:)  !! The same.
    all = own(:n(1))
  end subroutine gather_reals

  !> Reals of the one rank.
  pure subroutine collect_reals(own, n, all)
    real(dp), intent(in) :: own(:)  !! Its reals.
    integer(int64), intent(in) :: n(:)  !! Their number (1).
    real(dp), intent(inout) :: all(:)  !! The same.
    all = own(:n(1))
  end subroutine collect_reals

  !> Sums of the integers of the one rank.
  pure subroutine add_integers(value)
    integer(int64), intent(inout) :: value(:)  !! Its integers.
    associate (not_needed => value)
    end associate
  end subroutine add_integers
end module dotyk_ranks_communication
