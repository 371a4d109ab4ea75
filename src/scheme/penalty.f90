!> How far the solution with penalty is from that without: ||u_theta - u_0||_A, by solving for u_0.
!>
!> From the active set of u_theta, the dual scheme needs a step or two to that of theta = 0, and the compliance that it works
!> with is there already, or costs less than the iteration of another scheme. So the estimate is no asymptotic one: it is
!> the distance itself, up to the guaranteed bounds of both solutions, which are added to it. Points that are open with the penalty may
!> close without it: those that were left out are looked at too. A duality gap between u_theta and an
!> admissible displacement would be no cheaper (making it admissible is that same problem) and too large by the energy of the correction.
module dotyk_scheme_penalty
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_scheme_dual, only: dual_settings_t, solve_dual
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_stalled
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: estimate_penalty_error

contains

  !> Estimate from the state where a scheme ended.
  subroutine estimate_penalty_error(problem, linear_solver, is_solved, compliance, result, distance, error)
    !> The same on return, but for the count of solves.
    type(contact_problem_t), intent(inout) :: problem
    !> As for the dual scheme.
    integer, intent(in) :: linear_solver
    !> Whether `result` is that of the dual scheme; another one's is solved to the end first.
    logical, intent(in) :: is_solved
    !> What is known of the compliance.
    type(explicit_compliance_t), intent(inout) :: compliance
    type(scheme_result_t), intent(in) :: result
    !> ||u_theta - u_0||_A; NaN where theta = 0 has no solution, or none that was found [sqrt(energy)].
    real(dp), intent(out) :: distance
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    type(dual_settings_t) :: settings
    type(scheme_result_t) :: penalized, exact
    type(log_t) :: silent
    real(dp), allocatable :: theta(:), change(:), z(:), alpha(:)
    real(dp) :: uncertainty
    distance = 0
    if (.not. any(problem%operator%theta > 0)) return
    call silent%init(.true.)
    settings%linear_solver = linear_solver
    penalized = result
    if (.not. is_solved) call solve_dual(problem, settings, silent, compliance, penalized, error, start=result)
    if (allocated(error)) return
    theta = problem%operator%theta
    problem%operator%theta = 0
    call solve_dual(problem, settings, silent, compliance, exact, error, start=penalized)
    problem%operator%theta = theta
    if (allocated(error)) return
    if (.not. (is_usable(penalized) .and. is_usable(exact))) then
      distance = ieee_value(distance, ieee_quiet_nan)
      return
    end if
    allocate (z(size(theta)))
    call compliance%adopt(problem)
    change = problem%operator%weight*(penalized%m - exact%m)
    call compliance%multiply(problem, change, z)
    alpha = (penalized%alpha - exact%alpha)/problem%coarse%scale
    distance = sqrt(max(0.0_dp, dot_product(change, z) + dot_product(alpha, problem%coarse%stiffness_forces(alpha))))
    uncertainty = exact%error_bound*problem%norm(exact%m, exact%y, exact%alpha/problem%coarse%scale) + &
                  penalized%error_bound*problem%norm(penalized%m, penalized%y, penalized%alpha/problem%coarse%scale)
    distance = distance + uncertainty
  end subroutine estimate_penalty_error

  !> Whether a solution is one.
  pure logical function is_usable(result)
    type(scheme_result_t), intent(in) :: result
    is_usable = any(result%ended == [ended_converged, ended_stalled]) .and. allocated(result%m) .and. &
                .not. ieee_is_nan(result%error_bound)
  end function is_usable
end module dotyk_scheme_penalty
