!> A scheme with its settings, run from the state where it is.
module dotyk_control_scheme_run
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_parallel, only: set_blas_threads
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_history, only: history_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  !> A scheme and its settings.
  type, public :: scheme_run_t
    !> The scheme.
    class(scheme_t), allocatable :: scheme
    !> What the user chose for it.
    type(solver_settings_t) :: settings
  contains
    procedure :: solve => run_solve
  end type scheme_run_t

contains

  !> Solve a QP, or continue a paused iteration; the new steps are added to the history of the state, and
  !> max_iterations holds for all of them.
  subroutine run_solve(self, qp, compliance, theta, n_blas, monitor, state, error)
    class(scheme_run_t), intent(in) :: self
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Its compliance operator; entries that the scheme forms stay there.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> BLAS threads of each solve.
    integer, intent(in) :: n_blas
    !> Watches the iteration.
    class(monitor_t), intent(inout) :: monitor
    !> Where to begin if it has pressures; where the scheme ended.
    type(solver_state_t), intent(inout) :: state
    !> As in `scheme_t`.
    type(error_t), allocatable, intent(out) :: error
    type(solver_settings_t) :: settings
    type(history_t) :: earlier
    logical :: is_new
    ! A paused iteration continues the history itself.
    is_new = .not. allocated(state%paused)
    settings = self%settings
    if (is_new) then
      earlier = state%history
      settings%max_iterations = max(1, settings%max_iterations - earlier%n)
    end if
    call set_blas_threads(n_blas)
    call self%scheme%solve(qp, compliance, theta, settings, monitor, state, error)
    call set_blas_threads(1)
    if (allocated(error)) return
    if (is_new) call state%history%put_after(earlier)
    state%iterations = state%history%n
  end subroutine run_solve
end module dotyk_control_scheme_run
