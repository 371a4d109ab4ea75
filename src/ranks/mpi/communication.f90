!> Messages between the ranks of an MPI run.
!>
!> Every exchange begins with the same short message of all ranks (`greet`): what each rank is about to do. A rank that
!> ends, for whatever reason, says so there, and all others end with it: no rank waits for one that is gone.
module dotyk_ranks_communication
  use mpi_f08, only: mpi_abort, mpi_allgather, mpi_allgatherv, mpi_comm_free, mpi_comm_rank, mpi_comm_size, &
    mpi_comm_split_type, mpi_comm_world, mpi_comm_type_shared, mpi_double_precision, mpi_finalize, mpi_info_null, &
    mpi_init_thread, mpi_integer8, mpi_thread_funneled, mpi_comm, mpi_bcast, mpi_recv, mpi_send, &
    mpi_status_ignore, mpi_allreduce, mpi_in_place, mpi_sum
  use dotyk_base_error, only: exit_machine
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: print_error
  use dotyk_base_memory, only: end_expected
  implicit none
  private
  public :: abort_ranks, start_ranks, end_ranks, this_rank, n_ranks, n_local_ranks, greet, gather_integers, &
    gather_reals, collect_reals, add_integers

  character(*), parameter, public :: built_with = ', MPI and PETSc'  !! What the program is built with, for its version.
  integer, parameter, public :: greeting_length = 4  !! Numbers in a greeting.
  !> First number of the greeting of a rank that ends; the second one is its exit code.
  integer(int64), parameter, public :: is_ending = -1
  integer(int64), parameter :: most_numbers = huge(1)  !! Most numbers in a message: MPI counts in default integers.

  !> Rank of this process, number of ranks, and that on its node; set once, at the start.
  integer, protected :: own_rank = 0, number_of_ranks = 1, ranks_on_node = 1

contains

  !> Begin: before anything else is done.
  subroutine start_ranks()
    type(mpi_comm) :: node
    integer :: provided
    call mpi_init_thread(mpi_thread_funneled, provided)
    if (provided < mpi_thread_funneled) then
      call print_error('this MPI library does not allow threads (MPI_THREAD_FUNNELED): take one that does')
      call abort_ranks(exit_machine)
    end if
    call mpi_comm_rank(mpi_comm_world, own_rank)
    call mpi_comm_size(mpi_comm_world, number_of_ranks)
    call mpi_comm_split_type(mpi_comm_world, mpi_comm_type_shared, 0, mpi_info_null, node)
    call mpi_comm_size(node, ranks_on_node)
    call mpi_comm_free(node)
  end subroutine start_ranks

  !> End this rank. The others, whatever they are about to exchange, end with it. Its exit code is that of the lowest
  !> rank that ended by itself, which is the one to print a message.
  subroutine end_ranks(code, message)
    integer, intent(inout) :: code  !! Exit code of this rank in, that of all ranks out.
    !> Error that the lowest rank of those that end by themselves prints. Before MPI ends: what starts the ranks kills
    !> all of them as soon as one exits with a code.
    character(*), intent(in), optional :: message
    integer(int64) :: all(greeting_length, number_of_ranks)
    integer :: first
    call exchange_greetings([is_ending, int(code, int64), 0_int64, 0_int64], all)
    first = findloc(all(1, :), is_ending, dim=1)
    code = int(all(2, first))
    if (present(message) .and. first == own_rank + 1) call print_error(message)
    call mpi_finalize()
    call end_expected()
  end subroutine end_ranks

  !> End all ranks at once: where the others are in the midst of a library and hear no greeting.
  subroutine abort_ranks(code)
    integer, intent(in) :: code  !! Exit code.
    call end_expected()
    call mpi_abort(mpi_comm_world, code)
  end subroutine abort_ranks

  !> Rank of this process, from 0.
  pure integer function this_rank()
    this_rank = own_rank
  end function this_rank

  !> Number of ranks.
  pure integer function n_ranks()
    n_ranks = number_of_ranks
  end function n_ranks

  !> Number of ranks on the node of this one.
  pure integer function n_local_ranks()
    n_local_ranks = ranks_on_node
  end function n_local_ranks

  !> Say what this rank is about to do, and hear it of all. Where a rank ends, the program ends here.
  subroutine greet(greeting, all)
    integer(int64), intent(in) :: greeting(greeting_length)  !! What this rank does.
    integer(int64), intent(out) :: all(:, :)  !! What all ranks do (greeting_length, n_ranks).
    integer :: first, code
    call exchange_greetings(greeting, all)
    first = findloc(all(1, :), is_ending, dim=1)
    if (first == 0) return
    code = int(all(2, first))
    call mpi_finalize()
    call end_expected()
    stop code, quiet=.true.
  end subroutine greet

  !> The short message of all ranks.
  subroutine exchange_greetings(greeting, all)
    integer(int64), intent(in) :: greeting(greeting_length)  !! What this rank does.
    integer(int64), intent(out) :: all(:, :)  !! What all ranks do (greeting_length, n_ranks).
    call mpi_allgather(greeting, greeting_length, mpi_integer8, all, greeting_length, mpi_integer8, mpi_comm_world)
  end subroutine exchange_greetings

  !> Integers of all ranks, one rank after the other: sizes of items, of which there are not too many for one message.
  subroutine gather_integers(own, n, all)
    integer(int64), intent(in) :: own(:)  !! Those of this rank.
    integer(int64), intent(in) :: n(:)  !! Number of each rank (n_ranks).
    integer(int64), intent(out) :: all(:)  !! Those of all ranks (sum(n)).
    integer :: code
    if (sum(n) >= most_numbers) then
      ! All ranks are here, with the same numbers.
      if (own_rank == 0) call print_error('an exchange of more items than MPI counts: take fewer bodies in one run')
      code = exit_machine
      call end_ranks(code)
      stop exit_machine, quiet=.true.
    end if
    call mpi_allgatherv(own, size(own), mpi_integer8, all, counts(n), places(n), mpi_integer8, mpi_comm_world)
  end subroutine gather_integers

  !> Reals of all ranks, one rank after the other. Many numbers go rank by rank.
  subroutine gather_reals(own, n, all, most)
    real(dp), intent(in) :: own(:)  !! Those of this rank.
    integer(int64), intent(in) :: n(:)  !! Number of each rank (n_ranks).
    real(dp), intent(out) :: all(:)  !! Those of all ranks (sum(n)).
    integer(int64), intent(in), optional :: most  !! Most numbers in a message, for tests; those of MPI if absent.
    integer(int64) :: first, last, done, limit
    integer :: r
    limit = most_numbers
    if (present(most)) limit = most
    if (sum(n) < limit) then
      call mpi_allgatherv(own, size(own), mpi_double_precision, all, counts(n), places(n), mpi_double_precision, &
                          mpi_comm_world)
      return
    end if
    done = 0
    do r = 0, number_of_ranks - 1
      if (r == own_rank) all(done + 1:done + n(r + 1)) = own
      do first = done + 1, done + n(r + 1), limit
        last = min(first + limit - 1, done + n(r + 1))
        call mpi_bcast(all(first:last), int(last - first + 1), mpi_double_precision, r, mpi_comm_world)
      end do
      done = done + n(r + 1)
    end do
  end subroutine gather_reals

  !> Reals of all ranks on the first one, one rank after the other, in messages of a length that any rank can hold.
  subroutine collect_reals(own, n, all)
    real(dp), intent(in) :: own(:)  !! Those of this rank.
    integer(int64), intent(in) :: n(:)  !! Number of each rank (n_ranks).
    real(dp), intent(inout) :: all(:)  !! Those of all ranks on the first one (sum(n)); not used elsewhere.
    integer(int64), parameter :: length = 2_int64**24
    integer(int64) :: first, last, done
    integer :: r
    if (own_rank > 0) then
      do first = 1, size(own, kind=int64), length
        last = min(first + length - 1, size(own, kind=int64))
        call mpi_send(own(first:last), int(last - first + 1), mpi_double_precision, 0, 0, mpi_comm_world)
      end do
      return
    end if
    all(:n(1)) = own
    done = n(1)
    do r = 1, number_of_ranks - 1
      do first = done + 1, done + n(r + 1), length
        last = min(first + length - 1, done + n(r + 1))
        call mpi_recv(all(first:last), int(last - first + 1), mpi_double_precision, r, 0, mpi_comm_world, &
                      mpi_status_ignore)
      end do
      done = done + n(r + 1)
    end do
  end subroutine collect_reals

  !> Sums of the integers of all ranks.
  subroutine add_integers(value)
    integer(int64), intent(inout) :: value(:)  !! Those of this rank in, their sums on all ranks out (n).
    call mpi_allreduce(mpi_in_place, value, size(value), mpi_integer8, mpi_sum, mpi_comm_world)
  end subroutine add_integers

  !> Numbers as MPI counts them.
  pure function counts(n)
    integer(int64), intent(in) :: n(:)  !! Numbers of the ranks, less in all than one message may have (n_ranks).
    integer :: counts(size(n))
    counts = int(n)
  end function counts

  !> Where the numbers of each rank begin, from 0.
  pure function places(n)
    integer(int64), intent(in) :: n(:)  !! Numbers of the ranks (n_ranks).
    integer :: places(size(n)), r
    places(1) = 0
    do r = 2, size(n)
      places(r) = places(r - 1) + int(n(r - 1))
    end do
  end function places
end module dotyk_ranks_communication
