!> Times of the stages of a run, in the log.
module dotyk_log_timing_lines
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_memory, only: memory_text, peak_memory
  use dotyk_base_text, only: to_text
  use dotyk_log_progress, only: duration
  use dotyk_log_timing, only: stage_time_t, timing_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: exchange_cost, exchange_cost_t, greatest, share
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

  !> How well the ranks shared the work; nothing on one rank. All ranks call it.
  subroutine show_ranks(log, total, memory_of_bodies)
    type(log_t), intent(inout) :: log  !! The log.
    type(stage_time_t), intent(in) :: total  !! Time of the run, of this rank.
    real(dp), intent(in) :: memory_of_bodies  !! Peak memory of this rank until bodies were read and shared out [bytes].
    type(exchange_cost_t) :: cost
    real(dp), dimension(n_ranks()) :: work, waited, memory, of_bodies, seconds
    integer :: r, own
    if (n_ranks() == 1) return
    cost = exchange_cost()
    own = this_rank() + 1
    work(own) = total%processor
    seconds(own) = total%wall
    waited(own) = cost%waited
    memory(own) = peak_memory()
    of_bodies(own) = memory_of_bodies
    call share([(r, r=0, n_ranks() - 1)], work)
    call share([(r, r=0, n_ranks() - 1)], seconds)
    call share([(r, r=0, n_ranks() - 1)], waited)
    call share([(r, r=0, n_ranks() - 1)], memory)
    call share([(r, r=0, n_ranks() - 1)], of_bodies)
    call log%line('  ranks            largest over mean work '//to_text(maxval(work)*n_ranks()/sum(work), 3)// &
                  ', waiting '//to_text(100*sum(waited)/sum(seconds), 2)//' % of the time, '// &
                  to_text(int(cost%n))//' exchanges of '//memory_text(cost%bytes)//' in all, peak memory '// &
                  memory_text(minval(memory))//' to '//memory_text(maxval(memory))//', sum '// &
                  memory_text(sum(memory))//'; until bodies were read '//memory_text(maxval(of_bodies)))
  end subroutine show_ranks
end module dotyk_log_timing_lines
