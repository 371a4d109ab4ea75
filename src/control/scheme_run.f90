!> A scheme with its settings, run from the state where it is.
module dotyk_control_scheme_run
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_control_parallel, only: set_blas_threads
  use dotyk_scheme_active_set, only: foundation_stiffness
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_interrupted, history_t, solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  type, public :: scheme_run_t  !! A scheme and its settings.
    class(scheme_t), allocatable :: scheme  !! The scheme.
    type(solver_settings_t) :: settings  !! What the user chose for it.
  contains
    procedure :: solve => run_solve
  end type scheme_run_t

contains

  !> Solve a QP, or continue a paused iteration; the new steps are added to the history of the state, and
  !> max_iterations holds for all of them.
  subroutine run_solve(self, qp, compliance, n_blas, monitor, state, error)
    class(scheme_run_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    !> Its compliance operator; entries that the scheme forms stay there.
    class(compliance_t), intent(inout) :: compliance
    integer, intent(in) :: n_blas  !! BLAS threads of each solve.
    class(monitor_t), intent(inout) :: monitor  !! Watches the iteration.
    type(solver_state_t), intent(inout) :: state  !! Where to begin if it has pressures; where the scheme ended.
    type(error_t), allocatable, intent(out) :: error  !! As in `scheme_t`.
    type(solver_settings_t) :: settings
    type(history_t) :: earlier
    type(solver_state_t) :: from_nothing
    logical :: is_new
    ! A paused iteration continues the history itself.
    is_new = .not. allocated(state%paused)
    settings = self%settings
    if (is_new) then
      earlier = state%history
      settings%max_iterations = max(1, settings%max_iterations - earlier%n)
      ! Pressures of other loads are no start where nothing acts.
      if (is_unloaded(qp) .and. earlier%n == 0 .and. allocated(state%pressure)) state = from_nothing
    end if
    call set_blas_threads(n_blas)
    call self%scheme%solve(qp, compliance, settings, monitor, state, error)
    call set_blas_threads(1)
    if (allocated(error)) return
    if (is_unloaded(qp) .and. allocated(state%pressure)) call leave_at_rest(qp, state)
    if (allocated(state%penetration)) state%max_penetration = maxval([0.0_dp, &
                                                                     pack(qp%of_vertices(state%penetration), &
                                                                          .not. qp%is_tied)])
    if (is_new) call state%history%put_after(earlier)
    state%iterations = state%history%n
  end subroutine run_solve

  !> Whether nothing acts on the bodies but initial penetrations: no loads, and no displacements, temperatures or
  !> stresses that strain a body by more than rounding of a motion without strain.
  logical function is_unloaded(qp)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    real(dp) :: of_penetrations
    is_unloaded = .false.
    ! Ties may be tightened.
    if (any(qp%is_tied .and. abs(qp%gap) > 0)) return
    of_penetrations = sum(foundation_stiffness(qp)*max(0.0_dp, qp%initial_penetration)**2)
    is_unloaded = .not. (qp%norm_square_0 > rounding**2*of_penetrations .or. any(abs(qp%coarse%resultant) > 0))
    if (allocated(qp%coarse%lift)) is_unloaded = is_unloaded .and. .not. any(abs(qp%coarse%lift) > 0)
  end function is_unloaded

  !> Where nothing acts, and rigid motions alone open all gaps, there are no forces: those of the scheme are rounding,
  !> which no norm of the solution tells from a solution.
  subroutine leave_at_rest(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! Without loads.
    !> Where the scheme ended; without forces, and converged, on return where that is the solution.
    type(solver_state_t), intent(inout) :: state
    real(dp) :: y(qp%n_rows), alpha(qp%coarse%n)
    if (state%ended == ended_interrupted) return
    alpha = state%alpha/qp%coarse%scale
    call qp%mode_displacement(alpha, y)
    y = qp%initial_penetration + y
    if (any(merge(abs(y), y, qp%is_tied) > rounding*maxval(abs(qp%initial_penetration))) .or. &
        maxval([0.0_dp, abs(qp%coarse%stiffness_forces(alpha))]) > 0) return
    state%pressure = 0*state%pressure
    state%penetration = y
    state%max_penetration = maxval([0.0_dp, pack(y, .not. qp%is_tied)])
    state%energy = qp%energy(state%pressure, y, alpha)
    state%error_bound = 0
    state%ended = ended_converged
    associate (history => state%history)
      if (history%n == 0) return
      history%error_bound(history%n) = state%error_bound
      history%energy(history%n) = state%energy
      history%max_penetration(history%n) = state%max_penetration
      history%active(history%n) = 0
    end associate
  end subroutine leave_at_rest
end module dotyk_control_scheme_run
