!> The live line of an iteration.
module dotyk_log_progress
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_scheme_history, only: history_t
  implicit none
  private
  public :: progress_line, duration

contains

  !> Step, bound, points in contact, and an estimate of the time left.
  function progress_line(history, tolerance, measure) result(line)
    type(history_t), intent(in) :: history  !! History up to now.
    !> Tolerance of the stopping criterion; 0 where no rate of convergence leads to it [].
    real(dp), intent(in) :: tolerance
    real(dp), intent(in) :: measure  !! Error measure that the criterion compares with it [].
    character(:), allocatable :: line
    real(dp) :: steps, rate
    character(80) :: buffer
    integer, parameter :: enough = 10  !! Steps from which on their increments tell a rate.
    write (buffer, '(a,i6,a,i8)') '  iteration ', history%n, '   active ', history%active(history%n)
    if (history%error_bound(history%n) < huge(1.0_dp)) &
      write (buffer, '(a,i6,a,es9.2,a,i8)') '  iteration ', history%n, '   error bound ', &
      history%error_bound(history%n), '   active ', history%active(history%n)
    line = trim(buffer)
    if (history%n < enough) return
    rate = history%measured_contraction()
    if (ieee_is_nan(rate)) return
    if (rate > 0 .and. rate < 1 .and. measure > tolerance .and. tolerance > 0) then
      steps = log(tolerance/measure)/log(rate)
      line = line//'   remaining '//duration(steps*history%seconds(history%n)/history%n)
    end if
  end function progress_line

  !> A time with two digits in a convenient unit: ms, s, min or h.
  function duration(seconds) result(text)
    real(dp), intent(in) :: seconds  !! Time [s].
    character(:), allocatable :: text
    if (seconds < 0.095_dp) then
      text = to_text(1000*seconds, 2)//' ms'
    else if (seconds < 100) then
      text = to_text(seconds, 2)//' s'
    else if (seconds < 6000) then
      text = to_text(nint(seconds/60))//' min'
    else
      text = to_text(seconds/3600, 2)//' h'
    end if
  end function duration
end module dotyk_log_progress
