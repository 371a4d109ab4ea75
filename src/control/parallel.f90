!> How the machine is shared out over the bodies.
!>
!> Bodies are worked on side by side, one thread and one BLAS thread each, the largest first. A body whose work would
!> leave the other threads idle has BLAS on all threads.
module dotyk_control_parallel
  use omp_lib, only: omp_get_num_procs, omp_set_num_threads, omp_get_max_threads
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_linalg_blas, only: blas_threads, reserve_blas, set_blas_threads
  use dotyk_linalg_cholesky, only: factor_threads, set_factor_threads, worth_threads
  use dotyk_ranks_communication, only: n_local_ranks
  implicit none
  private
  public :: use_threads, largest_first, n_dominating, share_solves, set_blas_threads, set_factor_threads

  !> Entries of the other bodies' factors from which on solving them meanwhile pays, 0.05 to 0.1 ms
  !> (benchmarks/neumann_threads.py): below, starting the threads and waiting for them costs as much. On a busy machine,
  !> where a thread waits for a time slice, it costs more at any size.
  real(dp), parameter :: worth_a_region = 5.0e4_dp
  !> Entries of a body's factor from which on BLAS threads help its solves.
  real(dp), parameter :: worth_blas_threads = 5.0e6_dp

  !> Part of a factorization that BLAS threads do not share: two threads gain 1.3 at 40,000 unknowns, more above.
  real(dp), parameter :: serial_part = 0.4_dp

contains

  !> Use this many threads.
  subroutine use_threads(n, used)
    !> Number of threads; 0: as OMP_NUM_THREADS says, or as many as there are processors for each rank.
    integer, intent(in) :: n
    integer, intent(out) :: used  !! What will be used.
    integer :: workers, length
    used = n
    if (n == 0) then
      used = min(omp_get_num_procs(), omp_get_max_threads())
      ! Ranks of a node share its processors.
      call get_environment_variable('OMP_NUM_THREADS', length=length)
      if (length == 0) used = max(1, used/n_local_ranks())
    end if
    call omp_set_num_threads(used)
    ! Threads of OpenBLAS, which started with the program, take a buffer each.
    workers = blas_threads() - 1
    call set_blas_threads(1)
    ! Where there is no room the program ends with a message.
    call reserve_blas(used + workers)
  end subroutine use_threads

  !> How the solves of one sweep over all bodies are shared out.
  subroutine share_solves(entries, reproducible, side_by_side, n_blas)
    !> Entries that the solve of each body, or batch of congruent bodies, goes through twice; it takes about 1 ns for
    !> each (n) [].
    real(dp), intent(in) :: entries(:)
    logical, intent(in) :: reproducible  !! The same digits on any number of threads: one BLAS thread.
    !> Whether bodies are solved at the same time, one thread each; otherwise one after the other.
    logical, intent(out) :: side_by_side
    integer, intent(out) :: n_blas  !! BLAS threads of each solve.
    n_blas = 1
    side_by_side = sum(entries) - maxval(entries) > worth_a_region
    if (.not. side_by_side .and. maxval(entries) > worth_blas_threads .and. &
      .not. reproducible) n_blas = omp_get_max_threads()
  end subroutine share_solves

  !> Number of bodies that dominate: with BLAS threads for such a body, and the others side by side after it, all are
  !> done before one thread would be done with it.
  integer function n_dominating(flops) result(n)
    real(dp), intent(in) :: flops(:)  !! Operations of each factorization, falling (n_bodies).
    real(dp) :: alone, others
    alone = serial_part + (1 - serial_part)/factor_threads()
    do n = 0, size(flops) - 1
      others = max(maxval(flops(n + 2:)), sum(flops(n + 2:))/factor_threads())
      if (flops(n + 1) < worth_threads .or. alone*flops(n + 1) + others >= flops(n + 1)) exit
    end do
  end function n_dominating

  !> Indices by falling cost; equal costs keep their order.
  pure function largest_first(cost) result(order)
    real(dp), intent(in) :: cost(:)  !! Costs (n) [any].
    integer :: order(size(cost))
    call sort_order(-cost, order)
  end function largest_first
end module dotyk_control_parallel
