!> Who watches an iteration: schemes tell it each step, and what is worth a line. How that is shown is up to its
!> extensions.
module dotyk_scheme_monitor
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_solver_state, only: history_t
  implicit none
  private

  !> Phases of a solution, as the timing of a run tells them apart.
  integer, parameter, public :: phase_iterate = 1, phase_recover = 2, phase_estimate = 3

  type, public :: monitor_t  !! Watches nothing: the base of all monitors.
  contains
    procedure :: step => monitor_step
    procedure :: note => monitor_note
    procedure :: warn => monitor_warn
    procedure :: finish => monitor_finish
    procedure :: begin_phase => monitor_begin_phase
  end type monitor_t

contains

  !> A step was done.
  subroutine monitor_step(self, history, tolerance, measure)
    class(monitor_t), intent(inout) :: self
    type(history_t), intent(in) :: history  !! Up to now.
    real(dp), intent(in) :: tolerance  !! Tolerance to be reached [].
    real(dp), intent(in) :: measure  !! Measure that has been reached [].
    associate (not_needed => same_type_as(self, self), nor_this => history%n, nor_that => tolerance + measure)
    end associate
  end subroutine monitor_step

  !> A detail of the solution.
  subroutine monitor_note(self, text)
    class(monitor_t), intent(inout) :: self
    character(*), intent(in) :: text  !! A label of at most 16 letters, and the text.
    associate (not_needed => same_type_as(self, self), nor_this => text)
    end associate
  end subroutine monitor_note

  !> Something that the user should know.
  subroutine monitor_warn(self, text)
    class(monitor_t), intent(inout) :: self
    character(*), intent(in) :: text  !! What it warns of.
    associate (not_needed => same_type_as(self, self), nor_this => text)
    end associate
  end subroutine monitor_warn

  !> Another phase begins.
  subroutine monitor_begin_phase(self, phase)
    class(monitor_t), intent(inout) :: self
    integer, intent(in) :: phase  !! One of `phase_*`.
    associate (not_needed => same_type_as(self, self), nor_this => phase)
    end associate
  end subroutine monitor_begin_phase

  !> The iteration ended.
  subroutine monitor_finish(self)
    class(monitor_t), intent(inout) :: self
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine monitor_finish
end module dotyk_scheme_monitor
