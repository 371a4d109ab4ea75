!> Wall time and processor time of the stages of a run.
module dotyk_log_timing
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: processor_time, wall_time
  use dotyk_ranks_exchange, only: exchange_cost, exchange_cost_t
  implicit none
  private

  type, public :: stage_time_t  !! Time of a stage.
    real(dp) :: wall = 0  !! Wall time [s].
    !> Processor time of this rank, of all its threads, without that of waiting for other ranks in exchanges [s].
    real(dp) :: processor = 0
  end type stage_time_t

  type, public :: timing_t  !! Times; the names are those of `/dotyk/timing` in the results file.
    type(stage_time_t) :: read  !! Input and meshes.
    type(stage_time_t) :: assemble  !! Stiffness and loads.
    type(stage_time_t) :: order  !! Fill-reducing ordering and symbolic analysis.
    type(stage_time_t) :: factorize  !! Factorization.
    type(stage_time_t) :: search  !! Contact search.
    type(stage_time_t) :: iterate  !! The scheme, its estimate of L, and the solution without contact.
    type(stage_time_t) :: recover  !! Displacements and stresses.
    type(stage_time_t) :: check  !! Check of the deformed bodies against each other.
    type(stage_time_t) :: write  !! Results file.
    type(stage_time_t) :: estimate  !! Penalty error and discretization error.
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
end module dotyk_log_timing
