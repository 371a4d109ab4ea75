!> How far the solution with penalty is from that without: ||u_theta - u_0||_A, by solving for u_0.
!>
!> From the active set of u_theta, the dual scheme needs a step or two to that of theta = 0, and the entries of the
!> compliance that it works with are formed already, or cost less than the iteration of another scheme. So the estimate
!> is no asymptotic one: it is the distance itself, up to the guaranteed bounds of both solutions, which are added to
!> it. Rows that are inactive with the penalty may be active without it: those that were screened are looked at too. A
!> duality gap between u_theta and an admissible displacement would cost as much (to make it admissible is the same
!> problem), and be too large by the energy of the correction.
module dotyk_control_penalty_error
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_stalled
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private
  public :: estimate_penalty_error

contains

  !> Estimate from the state where a scheme ended.
  subroutine estimate_penalty_error(qp, compliance, theta, linear_solver, is_exact, state, distance, error)
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Its compliance operator; entries that the dual scheme forms stay there.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters of the state (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> One of `linear_solver_*` of dotyk_base_options, for the dual scheme.
    integer, intent(in) :: linear_solver
    !> Whether the state is that of the dual scheme; that of another one is solved to the end first.
    logical, intent(in) :: is_exact
    !> Where the scheme ended; used as a start.
    type(solver_state_t), intent(in) :: state
    !> ||u_theta - u_0||_A; NaN where theta = 0 has no solution, or none that was found [sqrt(energy)].
    real(dp), intent(out) :: distance
    !> As in `dual_t`, from the solution with theta or that with theta = 0: the compliance of an active set is not
    !> positive definite.
    type(error_t), allocatable, intent(out) :: error
    type(dual_t) :: dual
    type(solver_settings_t) :: settings
    type(solver_state_t) :: penalized, exact
    type(monitor_t) :: silent
    real(dp) :: uncertainty
    distance = 0
    if (.not. any(theta > 0)) return
    settings%linear_solver = linear_solver
    penalized = state
    if (.not. is_exact) call dual%solve(qp, compliance, theta, settings, silent, penalized, error)
    if (allocated(error)) return
    exact = penalized
    call dual%solve(qp, compliance, 0*theta, settings, silent, exact, error)
    if (allocated(error)) return
    if (.not. (is_usable(penalized) .and. is_usable(exact))) then
      distance = ieee_value(distance, ieee_quiet_nan)
      return
    end if
    distance = compliance%distance(qp, penalized%m - exact%m, penalized%alpha - exact%alpha)
    uncertainty = exact%error_bound*qp%energy_norm(exact%m, exact%y, exact%alpha/qp%coarse%scale) + &
                  penalized%error_bound*qp%energy_norm(penalized%m, penalized%y, penalized%alpha/qp%coarse%scale)
    distance = distance + uncertainty
  end subroutine estimate_penalty_error

  !> Whether a scheme found a solution.
  pure logical function is_usable(state)
    !> Where a scheme ended.
    type(solver_state_t), intent(in) :: state
    is_usable = any(state%ended == [ended_converged, ended_stalled]) .and. allocated(state%m) .and. &
                .not. ieee_is_nan(state%error_bound)
  end function is_usable
end module dotyk_control_penalty_error
