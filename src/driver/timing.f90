!> Wall time of the stages of a run.
module dotyk_driver_timing
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: wall_time
  implicit none
  private

  !> Seconds; the names are those of `/dotyk/timing` in the results file.
  type, public :: timing_t
    !> Input and meshes; stiffness and loads; fill-reducing order and symbolic analysis; factorization.
    real(dp) :: read = 0, assemble = 0, order = 0, factorize = 0
    !> Contact search; the scheme, its estimate of L and the scene without contact; displacements and stresses; results file.
    real(dp) :: search = 0, iterate = 0, recover = 0, write = 0
    !> All of it.
    real(dp) :: total = 0
    !> When the run, and the stage, began.
    real(dp), private :: started = 0, lap_started = 0
  contains
    procedure :: start => timing_start
    procedure :: lap => timing_lap
    procedure :: finish => timing_finish
  end type timing_t

contains

  !> Begin.
  subroutine timing_start(self)
    class(timing_t), intent(inout) :: self
    self%started = wall_time()
    self%lap_started = self%started
  end subroutine timing_start

  !> End a stage: the time since the last lap is added to its seconds.
  subroutine timing_lap(self, seconds)
    class(timing_t), intent(inout) :: self
    !> One of the components [s].
    real(dp), intent(inout) :: seconds
    real(dp) :: now
    now = wall_time()
    seconds = seconds + (now - self%lap_started)
    self%lap_started = now
  end subroutine timing_lap

  !> The total.
  subroutine timing_finish(self)
    class(timing_t), intent(inout) :: self
    self%total = wall_time() - self%started
  end subroutine timing_finish
end module dotyk_driver_timing
