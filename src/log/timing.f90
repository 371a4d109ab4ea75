!> Wall time and processor time of the stages of a run, their lines in the log, and the live line of an iteration.
module dotyk_log_timing
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_memory, only: memory_text, peak_memory
  use dotyk_base_text, only: to_text
  use dotyk_base_timer, only: processor_time, wall_time
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: exchange_cost, exchange_cost_t, greatest, share
  use dotyk_scheme_solver_state, only: history_t
  implicit none
  private
  public :: show_timing, progress_line, duration

  type, public :: stage_time_t  !! Time of a stage.
    real(dp) :: wall = 0  !! Wall time [s].
    !> Processor time of this rank, of all its threads, without that of waiting for other ranks in exchanges [s].
    real(dp) :: processor = 0
  end type stage_time_t

  !> Stages of a run.
  integer, parameter, public :: stage_read = 1       !< input and meshes
  integer, parameter, public :: stage_assemble = 2   !< stiffness and loads
  integer, parameter, public :: stage_order = 3      !< fill-reducing ordering and symbolic analysis
  integer, parameter, public :: stage_factorize = 4  !< factorization
  integer, parameter, public :: stage_search = 5     !< contact search
  integer, parameter, public :: stage_iterate = 6    !< the scheme, its estimate of L, and the solution without contact
  integer, parameter, public :: stage_recover = 7    !< displacements and stresses
  integer, parameter, public :: stage_estimate = 8   !< penalty error and discretization error
  integer, parameter, public :: stage_check = 9      !< check of the deformed bodies against each other
  integer, parameter, public :: stage_write = 10     !< results file
  integer, parameter, public :: n_stages = 10
  !> Their names in the results file (`/dotyk/timing`), and in the log.
  character(9), parameter, public :: stage_names(n_stages) = [character(9) :: 'read', 'assemble', 'order', &
    'factorize', 'search', 'iterate', 'recover', 'estimate', 'check', 'write']
  character(17), parameter :: names_in_log(n_stages) = [character(17) :: 'read', 'assemble', 'order', 'factorize', &
    'search', 'iterate', 'recover', 'estimate errors', 'check penetration', 'write']

  type, public :: timing_t  !! Times of a run.
    type(stage_time_t) :: stage(n_stages)  !! Times of the stages (n_stages).
    type(stage_time_t) :: total  !! The whole run.
    real(dp) :: memory_of_bodies = 0  !! Peak memory of this rank until bodies were read and shared out [bytes].
  end type timing_t

  type, public :: stopwatch_t  !! A watch that is read at the end of each stage.
    character(24) :: date = ''  !! Date and time of the start, as 2026-01-31T12:00:00+0100.
    type(stage_time_t), private :: started  !! Times at the start of the run.
    type(stage_time_t), private :: lap_started  !! Times at the start of the stage.
  contains
    procedure :: start => stopwatch_start
    procedure :: lap => stopwatch_lap
    procedure :: since_start => stopwatch_since_start
  end type stopwatch_t

contains

  !> Begin.
  subroutine stopwatch_start(self)
    class(stopwatch_t), intent(inout) :: self
    self%started = now()
    self%lap_started = self%started
    self%date = date_and_time_text()
  end subroutine stopwatch_start

  !> End a stage: the time since the last lap is added to it.
  subroutine stopwatch_lap(self, stage)
    class(stopwatch_t), intent(inout) :: self
    type(stage_time_t), intent(inout) :: stage  !! Time of the stage.
    type(stage_time_t) :: ended
    ended = now()
    stage%wall = stage%wall + (ended%wall - self%lap_started%wall)
    stage%processor = stage%processor + (ended%processor - self%lap_started%processor)
    self%lap_started = ended
  end subroutine stopwatch_lap

  !> Time since the start of the run.
  type(stage_time_t) function stopwatch_since_start(self) result(run)
    class(stopwatch_t), intent(in) :: self
    run = now()
    run%wall = run%wall - self%started%wall
    run%processor = run%processor - self%started%processor
  end function stopwatch_since_start

  !> Times since fixed moments.
  type(stage_time_t) function now()
    type(exchange_cost_t) :: cost
    cost = exchange_cost()
    now%wall = wall_time()
    now%processor = processor_time() - cost%processor
  end function now

  !> Now, as 2026-01-31T12:00:00+0100.
  function date_and_time_text() result(text)
    character(24) :: text
    character(10) :: date, time, zone
    call date_and_time(date, time, zone)
    text = date(1:4)//'-'//date(5:6)//'-'//date(7:8)//'T'//time(1:2)//':'//time(3:4)//':'//time(5:6)//trim(zone)
  end function date_and_time_text

  !> Times of the stages, and how the ranks shared the work. All ranks call it.
  subroutine show_timing(log, timing)
    type(log_t), intent(inout) :: log  !! The log.
    type(timing_t), intent(in) :: timing  !! The times.
    real(dp) :: processor(n_stages + 1)
    processor = [timing%stage%processor, timing%total%processor]
    call greatest(processor)
    call log%line('  time             '//times_text([timing%stage%wall, timing%total%wall]))
    call log%detail('  processor time   '//times_text(processor))
    call show_ranks(log, timing%total, timing%memory_of_bodies)
  end subroutine show_timing

  !> Names and times of the stages.
  function times_text(seconds) result(text)
    real(dp), intent(in) :: seconds(n_stages + 1)  !! The times, the last one of the whole run (n_stages + 1) [s].
    character(:), allocatable :: text
    integer :: k
    text = ''
    do k = 1, n_stages
      text = text//trim(names_in_log(k))//' '//duration(seconds(k))//trim(merge(', ', '; ', k < n_stages))//' '
    end do
    text = text//'total '//duration(seconds(n_stages + 1))
  end function times_text

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

  !> Step, bound, points in contact, and an estimate of the time left.
  function progress_line(history, tolerance, measure) result(line)
    type(history_t), intent(in) :: history  !! History up to now.
    real(dp), intent(in) :: tolerance  !! Tolerance of the stopping criterion; 0: no rate of convergence leads there [].
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
end module dotyk_log_timing
