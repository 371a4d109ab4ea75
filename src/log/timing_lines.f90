!> Times of the stages of a run, in the log.
module dotyk_log_timing_lines
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_log_progress, only: duration
  use dotyk_log_rank_lines, only: show_ranks
  use dotyk_log_timing, only: timing_t
  use dotyk_ranks_exchange, only: greatest
  implicit none
  private
  public :: show_timing

contains

  !> Times of the stages, and how the ranks shared the work. All ranks call it.
  subroutine show_timing(log, timing)
    type(log_t), intent(inout) :: log  !! The log.
    type(timing_t), intent(in) :: timing  !! The times.
    real(dp) :: processor(11)
    processor = [timing%read%processor, timing%assemble%processor, timing%order%processor, timing%factorize%processor, &
                 timing%search%processor, timing%iterate%processor, timing%recover%processor, &
                 timing%estimate%processor, timing%check%processor, timing%write%processor, timing%total%processor]
    call greatest(processor)
    call log%line('  time             '//stages([timing%read%wall, timing%assemble%wall, timing%order%wall, &
                                                timing%factorize%wall, timing%search%wall, timing%iterate%wall, &
                                                timing%recover%wall, timing%estimate%wall, timing%check%wall, &
                                                timing%write%wall, timing%total%wall]))
    call log%line('  processor time   '//stages(processor))
    call show_ranks(log, timing%total, timing%memory_of_bodies)
  end subroutine show_timing

  !> Names and times of the stages.
  function stages(seconds) result(text)
    real(dp), intent(in) :: seconds(:)  !! The times, the last one of the whole run (11) [s].
    character(:), allocatable :: text
    text = 'read '//duration(seconds(1))//', assemble '//duration(seconds(2))//', order '//duration(seconds(3))// &
           ', factorize '//duration(seconds(4))//', search '//duration(seconds(5))//', iterate '// &
           duration(seconds(6))//', recover '//duration(seconds(7))//', estimate errors '//duration(seconds(8))// &
           ', check penetration '//duration(seconds(9))//', write '//duration(seconds(10))//'; total '// &
           duration(seconds(11))
  end function stages
end module dotyk_log_timing_lines
