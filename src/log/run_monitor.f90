!> The monitor of a run: steps as a live line, notes as details of the log, warnings as lines, phases as its timing.
module dotyk_log_run_monitor
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_memory, only: set_stage
  use dotyk_base_progress, only: start_progress
  use dotyk_log_timing, only: progress_line, show_timing, stage_estimate, stage_iterate, stage_recover, stopwatch_t, &
    timing_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_scheme_monitor, only: monitor_t, phase_estimate, phase_iterate, phase_recover
  use dotyk_scheme_solver_state, only: history_t
  implicit none
  private

  type, extends(monitor_t), public :: log_monitor_t  !! Owns log and watch of the run while it solves.
    type(log_t) :: log  !! The log.
    type(stopwatch_t) :: watch  !! Watch of the run.
    type(timing_t) :: timing  !! Times of the phases so far.
    integer, private :: phase = 0  !! The phase under way, one of `phase_*`; 0: none.
  contains
    procedure :: begin => log_monitor_begin
    procedure :: step => log_monitor_step
    procedure :: note => log_monitor_note
    procedure :: warn => log_monitor_warn
    procedure :: finish => log_monitor_finish
    procedure :: lap => log_monitor_lap
    procedure :: begin_phase => log_monitor_begin_phase
    procedure :: end_phase => log_monitor_end_phase
    procedure :: show_timing => log_monitor_show_timing
  end type log_monitor_t

  real(dp), parameter :: long_stage = 10  !! Longer stages get lines of progress where no terminal [s].

contains

  !> Begin the run.
  subroutine log_monitor_begin(self, quiet, verbose)
    class(log_monitor_t), intent(inout) :: self
    logical, intent(in) :: quiet  !! Print errors only.
    logical, intent(in) :: verbose  !! Print details, too.
    call self%watch%start()
    call self%log%init(quiet, verbose)
    ! mpirun shows its ranks a terminal, whatever its own output is.
    if (n_ranks() > 1) self%log%terminal = .false.
    if (.not. quiet) call start_progress(self%log%terminal, long_stage)
  end subroutine log_monitor_begin

  !> Show a step, if it is time for another line.
  subroutine log_monitor_step(self, history, tolerance, measure)
    class(log_monitor_t), intent(inout) :: self
    type(history_t), intent(in) :: history  !! History up to now.
    real(dp), intent(in) :: tolerance  !! Tolerance of the stopping criterion [].
    real(dp), intent(in) :: measure  !! Error measure that the criterion compares with it [].
    if (self%log%due()) call self%log%progress(progress_line(history, tolerance, measure))
  end subroutine log_monitor_step

  !> A detail of the log.
  subroutine log_monitor_note(self, text)
    class(log_monitor_t), intent(inout) :: self
    character(*), intent(in) :: text  !! Label and text.
    call self%log%detail('  '//text)
  end subroutine log_monitor_note

  !> A warning in the log.
  subroutine log_monitor_warn(self, text)
    class(log_monitor_t), intent(inout) :: self
    character(*), intent(in) :: text  !! What it warns of.
    call self%log%line('  warning          '//text)
  end subroutine log_monitor_warn

  !> End the live line.
  subroutine log_monitor_finish(self)
    class(log_monitor_t), intent(inout) :: self
    call self%log%end_progress()
  end subroutine log_monitor_finish

  !> A stage ends: the time since the end of the last one is added to it.
  subroutine log_monitor_lap(self, stage)
    class(log_monitor_t), intent(inout) :: self
    integer, intent(in) :: stage  !! One of `stage_*`.
    call self%watch%lap(self%timing%stage(stage))
  end subroutine log_monitor_lap

  !> Another phase begins: the time since the last one is added to that.
  subroutine log_monitor_begin_phase(self, phase)
    class(log_monitor_t), intent(inout) :: self
    integer, intent(in) :: phase  !! One of `phase_*`.
    call self%end_phase()
    self%phase = phase
    select case (phase)
    case (phase_iterate)
      call set_stage('solving the contact problem')
    case (phase_recover)
      call set_stage('recovering displacements')
    case (phase_estimate)
      call set_stage('estimating errors')
    end select
  end subroutine log_monitor_begin_phase

  !> The phase under way ends.
  subroutine log_monitor_end_phase(self)
    class(log_monitor_t), intent(inout) :: self
    select case (self%phase)
    case (phase_iterate)
      call self%lap(stage_iterate)
    case (phase_recover)
      call self%lap(stage_recover)
    case (phase_estimate)
      call self%lap(stage_estimate)
    end select
    self%phase = 0
  end subroutine log_monitor_end_phase

  !> Times of the stages in the log, and how the ranks shared the work. All ranks call it.
  subroutine log_monitor_show_timing(self)
    class(log_monitor_t), intent(inout) :: self
    call show_timing(self%log, self%timing)
  end subroutine log_monitor_show_timing
end module dotyk_log_run_monitor
