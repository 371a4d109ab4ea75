!> Wall time of the stages of a run.
module dotyk_log_timing
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: wall_time
  implicit none
  private

  !> Seconds; the names are those of `/dotyk/timing` in the results file.
  type, public :: timing_t
    !> Input and meshes [s].
    real(dp) :: read = 0
    !> Stiffness and loads [s].
    real(dp) :: assemble = 0
    !> Fill-reducing ordering and symbolic analysis [s].
    real(dp) :: order = 0
    !> Factorization [s].
    real(dp) :: factorize = 0
    !> Contact search [s].
    real(dp) :: search = 0
    !> The scheme, its estimate of L, and the solution without contact [s].
    real(dp) :: iterate = 0
    !> Displacements and stresses [s].
    real(dp) :: recover = 0
    !> Check of the deformed bodies against each other [s].
    real(dp) :: check = 0
    !> Results file [s].
    real(dp) :: write = 0
    !> Penalty error and discretization error [s].
    real(dp) :: estimate = 0
    !> The whole run [s].
    real(dp) :: total = 0
  end type timing_t

  !> A watch that is read at the end of each stage.
  type, public :: stopwatch_t
    !> Date and time of the start, as 2026-01-31T12:00:00+0100.
    character(24) :: date = ''
    !> Wall time at the start of the run [s].
    real(dp), private :: started = 0
    !> Wall time at the start of the stage [s].
    real(dp), private :: lap_started = 0
  contains
    procedure :: start => stopwatch_start
    procedure :: lap => stopwatch_lap
    procedure :: since_start => stopwatch_since_start
  end type stopwatch_t

contains

  !> Begin.
  subroutine stopwatch_start(self)
    class(stopwatch_t), intent(inout) :: self
    self%started = wall_time()
    self%lap_started = self%started
    self%date = date_and_time_text()
  end subroutine stopwatch_start

  !> End a stage: the time since the last lap is added to its seconds.
  subroutine stopwatch_lap(self, seconds)
    class(stopwatch_t), intent(inout) :: self
    !> Seconds of the stage [s].
    real(dp), intent(inout) :: seconds
    real(dp) :: now
    now = wall_time()
    seconds = seconds + (now - self%lap_started)
    self%lap_started = now
  end subroutine stopwatch_lap

  !> Seconds since the start of the run [s].
  real(dp) function stopwatch_since_start(self) result(seconds)
    class(stopwatch_t), intent(in) :: self
    seconds = wall_time() - self%started
  end function stopwatch_since_start

  !> Now, as 2026-01-31T12:00:00+0100.
  function date_and_time_text() result(text)
    character(24) :: text
    character(10) :: date, time, zone
    call date_and_time(date, time, zone)
    text = date(1:4)//'-'//date(5:6)//'-'//date(7:8)//'T'//time(1:2)//':'//time(3:4)//':'//time(5:6)//trim(zone)
  end function date_and_time_text
end module dotyk_log_timing
