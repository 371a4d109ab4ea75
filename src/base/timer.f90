!> Wall-clock time, and processor time.
module dotyk_base_timer
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private
  public :: processor_time, wall_time

contains

  !> Seconds since some fixed moment; only differences mean anything [s].
  real(dp) function wall_time() result(seconds)
    integer(int64) :: count, rate
    call system_clock(count, rate)
    seconds = real(count, dp)/real(rate, dp)
  end function wall_time

  !> Processor time of this process, of all its threads, so far [s].
  real(dp) function processor_time() result(seconds)
    call cpu_time(seconds)
  end function processor_time
end module dotyk_base_timer
