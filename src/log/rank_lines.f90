!> How the ranks of an MPI run shared the work, in the log.
module dotyk_log_rank_lines
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_memory, only: memory_text, peak_memory
  use dotyk_base_text, only: to_text
  use dotyk_log_timing, only: stage_time_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: exchange_cost, exchange_cost_t, share
  implicit none
  private
  public :: show_ranks

contains

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
end module dotyk_log_rank_lines
