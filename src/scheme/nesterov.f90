!> The Neumann iteration with Nesterov's momentum, restarted when it points uphill.
!>
!> With G = A a step of (32) is a gradient step for F_theta, which is 1-strongly convex and (1+L)-smooth in the energy norm. Momentum makes
!> of the factor 1 - 2/(2+L) one of about 1 - 1/sqrt(1+L); the restart (O'Donoghue, Candes 2015) finds it without knowing how convex F_theta
!> is near the solution.
module dotyk_scheme_nesterov
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_scheme_history, only: scheme_result_t
  use dotyk_scheme_neumann, only: begin_at_free_scene, answer, finish_iteration
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_stopping, only: iteration_settings_t, stopping_t
  implicit none
  private
  public :: solve_nesterov

contains

  !> Iterate from u0; gamma is 1/(1+L) whatever the settings say.
  subroutine solve_nesterov(problem, settings, log, result)
    type(contact_problem_t), intent(inout) :: problem
    type(iteration_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    type(stopping_t) :: stopping
    real(dp), allocatable :: p(:), z(:), m(:), y(:), m_old(:), y_old(:)
    real(dp) :: residual, gamma, t, t_next, momentum

    call begin_at_free_scene(problem, settings, result)
    if (size(result%m) > 0) then
      gamma = 1/(1 + result%lambda_max)
      result%gamma = gamma
      ! Typical of momentum, but not proven for restarts.
      result%q_predicted = ieee_value(gamma, ieee_quiet_nan)
      allocate (p(size(result%m)), z(size(result%m)))
      m_old = result%m
      y_old = result%y
      t = 1
      call stopping%begin(settings, 1 - 1/sqrt(1 + result%lambda_max))
      do
        ! The answer at the point with momentum, which is the iterate that is measured: its bound is the residual.
        call answer(problem, result%m, result%y, p, z, residual)
        if (stopping%check(problem, residual, gamma*residual, .false., log, result)) exit
        m = result%m + gamma*(p - result%m)
        y = result%y + gamma*(problem%y_free - z - result%y)
        ! Energy product of the answer and the last move; C W m = y_free - y.
        if (sum(problem%operator%weight*(p - result%m)*(y_old - y)) < 0) t = 1
        t_next = (1 + sqrt(1 + 4*t**2))/2
        momentum = (t - 1)/t_next
        t = t_next
        result%m = m + momentum*(m - m_old)
        result%y = y + momentum*(y - y_old)
        m_old = m
        y_old = y
      end do
    end if
    call finish_iteration(log, result)
  end subroutine solve_nesterov
end module dotyk_scheme_nesterov
