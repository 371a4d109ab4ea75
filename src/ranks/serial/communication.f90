!> The one rank of a program without MPI.
module dotyk_ranks_communication
  use, intrinsic :: iso_fortran_env, only: int8
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: print_error
  use dotyk_base_memory, only: end_expected
  implicit none
  private
  public :: abort_ranks, start_ranks, end_ranks, this_rank, n_ranks, n_local_ranks, greet, gather_integers, &
    gather_reals, gather_bytes, collect_reals, deliver_integers, add_integers

  !> What the program is built with, for its version.
  character(*), parameter, public :: built_with = ''
  !> Numbers in a greeting.
  integer, parameter, public :: greeting_length = 4
  !> First number of the greeting of a rank that ends.
  integer(int64), parameter, public :: is_ending = -1

contains

  !> Begin.
  subroutine start_ranks()
  end subroutine start_ranks

  !> End.
  subroutine end_ranks(code, message)
    !> Exit code.
    integer, intent(inout) :: code
    !> Error that is printed.
    character(*), intent(in), optional :: message
    if (present(message)) call print_error(message)
    call end_expected()
    associate (not_needed => code)
    end associate
  end subroutine end_ranks

  !> End the program at once.
  subroutine abort_ranks(code)
    !> Exit code.
    integer, intent(in) :: code
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
    !> What it does.
    integer(int64), intent(in) :: greeting(greeting_length)
    !> The same (greeting_length, 1).
    integer(int64), intent(out) :: all(:, :)
    all(:, 1) = greeting
  end subroutine greet

  !> Integers of the one rank.
  pure subroutine gather_integers(own, n, all)
    !> Its integers.
    integer(int64), intent(in) :: own(:)
    !> Their number (1).
    integer(int64), intent(in) :: n(:)
    !> The same.
    integer(int64), intent(out) :: all(:)
    all = own(:n(1))
  end subroutine gather_integers

  !> Reals of the one rank.
  pure subroutine gather_reals(own, n, all)
    !> Its reals.
    real(dp), intent(in) :: own(:)
    !> Their number (1).
    integer(int64), intent(in) :: n(:)
    !> The same.
    real(dp), intent(out) :: all(:)
    all = own(:n(1))
  end subroutine gather_reals

  !> Reals of the one rank.
  pure subroutine collect_reals(own, n, all)
    !> Its reals.
    real(dp), intent(in) :: own(:)
    !> Their number (1).
    integer(int64), intent(in) :: n(:)
    !> The same.
    real(dp), intent(inout) :: all(:)
    all = own(:n(1))
  end subroutine collect_reals

  !> Bytes of the one rank.
  pure subroutine gather_bytes(own, n, all)
    !> Its bytes.
    integer(int8), intent(in) :: own(:)
    !> Their number (1).
    integer(int64), intent(in) :: n(:)
    !> The same.
    integer(int8), intent(out) :: all(:)
    all = own(:n(1))
  end subroutine gather_bytes

  !> Integers of the one rank for itself.
  pure subroutine deliver_integers(own, n, all, n_from)
    !> Its integers.
    integer(int64), intent(in) :: own(:)
    !> Their number (1).
    integer(int64), intent(in) :: n(:)
    !> The same integers.
    integer(int64), allocatable, intent(out) :: all(:)
    !> Their number (1).
    integer(int64), intent(out) :: n_from(:)
    all = own(:n(1))
    n_from = n
  end subroutine deliver_integers

  !> Sums of the integers of the one rank.
  pure subroutine add_integers(value)
    !> Its integers.
    integer(int64), intent(inout) :: value(:)
    associate (not_needed => value)
    end associate
  end subroutine add_integers
end module dotyk_ranks_communication
