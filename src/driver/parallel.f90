!> How the machine is shared out over the bodies.
!>
!> Bodies are worked on side by side, one thread and one BLAS thread each, the largest first. A body that is so large that the
!> others would wait for it is taken alone, with all BLAS threads.
module dotyk_driver_parallel
  use omp_lib, only: omp_get_num_procs, omp_set_num_threads, omp_get_max_threads
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: set_blas_threads
  implicit none
  private
  public :: use_threads, largest_first, taken_alone, blas_serial, blas_parallel

  !> A body is taken alone when one thread on it would take this many times longer than the other threads on the rest: all BLAS
  !> threads on one factorization reach about 1/1.2 of what they reach on separate ones.
  real(dp), parameter :: worth_waiting = 1.2_dp

contains

  !> Use this many threads.
  subroutine use_threads(n, used)
    !> Number of threads; 0: as many as there are processors, or as OMP_NUM_THREADS says.
    integer, intent(in) :: n
    !> What will be used.
    integer, intent(out) :: used
    used = n
    if (n == 0) used = min(omp_get_num_procs(), omp_get_max_threads())
    call omp_set_num_threads(used)
    call set_blas_threads(1)
  end subroutine use_threads

  !> One BLAS thread: for bodies side by side.
  subroutine blas_serial()
    call set_blas_threads(1)
  end subroutine blas_serial

  !> All BLAS threads: for one body alone, unless the digits must not depend on the number of threads.
  subroutine blas_parallel(reproducible)
    logical, intent(in) :: reproducible
    call set_blas_threads(merge(1, omp_get_max_threads(), reproducible))
  end subroutine blas_parallel

  !> Indices by falling cost; equal costs keep their order.
  pure function largest_first(cost) result(order)
    !> Any unit.
    real(dp), intent(in) :: cost(:)
    integer :: order(size(cost))
    integer :: i, k
    do i = 1, size(cost)
      k = i
      do while (k > 1)
        if (cost(order(k - 1)) >= cost(i)) exit
        order(k) = order(k - 1)
        k = k - 1
      end do
      order(k) = i
    end do
  end function largest_first

  !> Which bodies are taken alone.
  pure function taken_alone(cost, n_threads) result(alone)
    !> Work of each body.
    real(dp), intent(in) :: cost(:)
    integer, intent(in) :: n_threads
    logical :: alone(size(cost))
    integer :: order(size(cost)), i
    real(dp) :: rest
    alone = .false.
    if (n_threads < 2) return
    order = largest_first(cost)
    rest = sum(cost)
    do i = 1, size(cost)
      rest = rest - cost(order(i))
      if (cost(order(i)) <= worth_waiting*rest/(n_threads - 1)) exit
      alone(order(i)) = .true.
    end do
  end function taken_alone
end module dotyk_driver_parallel
