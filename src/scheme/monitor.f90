!> Who watches an iteration: schemes tell it each step, and what is worth a line. How that is shown is up to its
!> extensions.
module dotyk_scheme_monitor
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_history, only: history_t
  implicit none
  private

  !> Phases of a solution, as the timing of a run tells them apart.
  integer, parameter, public :: phase_iterate = 1, phase_recover = 2, phase_estimate = 3

  !> Watches nothing: the base of all monitors.
  type, public :: monitor_t
  contains
    procedure :: step => monitor_step
    procedure :: note => monitor_note
    procedure :: finish => monitor_finish
    procedure :: begin_phase => monitor_begin_phase
  end type monitor_t

contains

  !> A step was done.
  subroutine monitor_step(self, history, tolerance, measure)
    !> The monitor.
    class(monitor_t), intent(inout) :: self
    !> Up to now.
    type(history_t), intent(in) :: history
    !> Tolerance to be reached [].
    real(dp), intent(in) :: tolerance
    !> Measure that has been reached [].
    real(dp), intent(in) :: measure
    associate (not_needed => same_type_as(self, self), nor_this => history%n, nor_that => tolerance + measure)
    end associate
  end subroutine monitor_step

  !> Something is worth a line of the log.
  subroutine monitor_note(self, text)
    !> The monitor.
    class(monitor_t), intent(inout) :: self
    !> A label of at most 16 letters, and the text.
    character(*), intent(in) :: text
    associate (not_needed => same_type_as(self, self), nor_this => text)
    end associate
  end subroutine monitor_note

  !> Another phase begins.
  subroutine monitor_begin_phase(self, phase)
    !> The monitor.
    class(monitor_t), intent(inout) :: self
    !> One of `phase_*`.
    integer, intent(in) :: phase
    associate (not_needed => same_type_as(self, self), nor_this => phase)
    end associate
  end subroutine monitor_begin_phase

  !> The iteration ended.
  subroutine monitor_finish(self)
    !> The monitor.
    class(monitor_t), intent(inout) :: self
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine monitor_finish
end module dotyk_scheme_monitor
