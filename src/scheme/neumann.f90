!> The parallel Neumann scheme (43)-(46).
!>
!> On every body at once a linear problem with the last known contact pressure as traction, then a relaxation. With the state of
!> `dotyk_scheme_problem`: `p = max(0, y)/theta`, `z = C W p` (one solve of every body), `m := gamma p + (1-gamma) m`, and
!> `y := gamma (y_free - z) + (1-gamma) y`, which forgets its rounding errors as it goes.
module dotyk_scheme_neumann
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: stop_paper
  use dotyk_base_text, only: to_text
  use dotyk_scheme_bounds, only: contraction, bound_of_paper, gamma_limit, gamma_limit_of_paper
  use dotyk_scheme_history, only: scheme_result_t, ended_converged
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_relaxation, only: estimate_lambda_max, relaxation_parameter
  use dotyk_scheme_stopping, only: iteration_settings_t, stopping_t
  implicit none
  private

  public :: solve_neumann, begin_at_free_scene, answer, finish_iteration

contains

  !> Iterate from u0, the scene without contact, or from where the settings say.
  subroutine solve_neumann(problem, settings, log, result, error)
    type(contact_problem_t), intent(inout) :: problem
    type(iteration_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    type(error_t), allocatable, intent(out) :: error
    call begin_at_free_scene(problem, settings, result)
    if (size(result%m) > 0) then
      if (settings%stop_rule == stop_paper .and. .not. result%gamma < gamma_limit_of_paper(result%lambda_max)) then
        call set_error(error, "&solver: stop_rule='paper' needs gamma below gamma_2 = "// &
          to_text(gamma_limit_of_paper(result%lambda_max))//' of Theorem 3, and gamma is '//to_text(result%gamma)// &
          "; use gamma_rule='theory' or another stop_rule")
        return
      end if
      if (.not. settings%lambda_max > 0) call announce(log, result)
      call iterate(problem, settings, log, result)
    end if
    call finish_iteration(log, result)
  end subroutine solve_neumann

  !> The first iterate of any form of the scheme, u0 unless another one is given, with L and gamma. Where there are no contact points it
  !> is the solution.
  subroutine begin_at_free_scene(problem, settings, result)
    type(contact_problem_t), intent(inout) :: problem
    type(iteration_settings_t), intent(in) :: settings
    type(scheme_result_t), intent(inout) :: result
    result%y = problem%y_free
    allocate (result%alpha(0))
    allocate (result%m(problem%operator%n_rows), source=0.0_dp)
    result%energy = problem%energy_free
    result%ended = ended_converged
    if (size(result%m) == 0) return
    if (allocated(settings%start)) then
      result%m = settings%start
      call problem%compliance(problem%operator%weight*result%m, result%y)
      result%y = problem%y_free - result%y
    end if
    result%lambda_max = settings%lambda_max
    if (.not. result%lambda_max > 0) call estimate_lambda_max(problem, result%lambda_max)
    result%gamma = relaxation_parameter(settings%gamma_rule, result%lambda_max, settings%gamma)
    result%q_predicted = contraction(result%gamma, result%lambda_max)
  end subroutine begin_at_free_scene

  !> What is said of an iteration that ended.
  subroutine finish_iteration(log, result)
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(inout) :: result
    call log%end_progress()
    call result%history%finish()
    result%iterations = result%history%n
    result%q_measured = 0
    if (result%iterations > 0) result%q_measured = result%history%measured_contraction()
  end subroutine finish_iteration

  !> The steps of (43), (44).
  subroutine iterate(problem, settings, log, result)
    type(contact_problem_t), intent(inout) :: problem
    type(iteration_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(inout) :: result
    type(stopping_t) :: stopping
    real(dp), allocatable :: p(:), z(:)
    real(dp) :: residual, gamma

    allocate (p(problem%operator%n_rows), z(problem%operator%n_rows))
    gamma = result%gamma
    call stopping%begin(settings, result%q_predicted)
    do
      call answer(problem, result%m, result%y, p, z, residual)
      result%m = gamma*p + (1 - gamma)*result%m
      result%y = gamma*(problem%y_free - z) + (1 - gamma)*result%y
      ! The new iterate has q times the error of the last at most.
      if (stopping%check(problem, result%q_predicted*residual, gamma*residual, gamma >= gamma_limit(result%lambda_max), log, &
                         result, bound_of_paper(gamma, result%lambda_max, gamma*residual))) exit
    end do
  end subroutine iterate

  !> Pressures that the penetrations of an iterate ask for, what they do to the points, and how far the iterate is from its answer:
  !> `||K^{-1} F'_theta(u)||_A^2 = (p-m)^T W C W (p-m)`, which bounds its error. One solve of every body.
  subroutine answer(problem, m, y, p, z, residual)
    type(contact_problem_t), intent(inout) :: problem
    !> The iterate (n_rows) [pressure], [length].
    real(dp), intent(in) :: m(:), y(:)
    !> max(0, y)/theta (n_rows) [pressure], and C W p (n_rows) [length].
    real(dp), intent(out) :: p(:), z(:)
    !> [sqrt(energy)].
    real(dp), intent(out) :: residual
    p = max(0.0_dp, y)/problem%operator%theta
    call problem%compliance(problem%operator%weight*p, z)
    ! C W m = y_free - y.
    residual = sqrt(max(0.0_dp, sum(problem%operator%weight*(p - m)*(z - (problem%y_free - y)))))
  end subroutine answer

  !> Say how fast the iteration will be, and where it would not converge.
  subroutine announce(log, result)
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(in) :: result
    call log%line('  relaxation       gamma '//to_text(result%gamma, 4)//', largest eigenvalue L <= '// &
                  to_text(result%lambda_max, 4)//', factor per step at most '//to_text(result%q_predicted, 6))
    if (result%gamma >= gamma_limit(result%lambda_max)) call log%line('  warning: gamma = '//to_text(result%gamma)// &
      ' may diverge; gamma below 2/(1+L) = '//to_text(gamma_limit(result%lambda_max))//' converges')
  end subroutine announce
end module dotyk_scheme_neumann
