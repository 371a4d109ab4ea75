!> The Neumann iteration with Nesterov's momentum, restarted when it points uphill.
!>
!> With G = A a step of (32) is a gradient step for F_theta, which is 1-strongly convex and (1+L)-smooth in the energy
!> norm. Momentum makes of the factor 1 - 2/(2+L) one of about 1 - 1/sqrt(1+L); the restart (O'Donoghue, Candes 2015)
!> finds it without knowing how convex F_theta is near the solution.
module dotyk_scheme_nesterov
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_neumann, only: begin_iteration, evaluate_step, finish_iteration
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t, stopping_t
  implicit none
  private

  !> The scheme.
  type, extends(scheme_t), public :: nesterov_t
  contains
    procedure :: solve => nesterov_solve
  end type nesterov_t

contains

  !> Iterate from u_0 or the state; gamma is 1/(1+L) whatever the settings say.
  subroutine nesterov_solve(self, qp, compliance, theta, settings, monitor, state, error)
    class(nesterov_t), intent(in) :: self
    !> Of held bodies.
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> Above 0 (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    type(solver_settings_t), intent(in) :: settings
    class(monitor_t), intent(inout) :: monitor
    type(solver_state_t), intent(inout) :: state
    !> Never allocated.
    type(error_t), allocatable, intent(out) :: error
    type(stopping_t) :: stopping
    real(dp), allocatable :: p(:), z(:), m(:), y(:), m_old(:), y_old(:)
    real(dp) :: residual, gamma, t, t_next, momentum

    call begin_iteration(qp, compliance, theta, settings, state)
    if (qp%n_rows > 0) then
      gamma = 1/(1 + state%lambda_max)
      state%gamma = gamma
      ! Typical of momentum, but not proven for restarts.
      state%q_predicted = ieee_value(gamma, ieee_quiet_nan)
      allocate (p(size(state%m)), z(size(state%m)))
      m_old = state%m
      y_old = state%y
      t = 1
      call stopping%begin(settings, 1 - 1/sqrt(1 + state%lambda_max))
      do
        ! Evaluated at the point with momentum, which is the iterate that is measured: its bound is the residual.
        call evaluate_step(qp, compliance, theta, state%m, state%y, p, z, residual)
        if (stopping%check(qp, theta, residual, gamma*residual, .false., monitor, state)) exit
        m = state%m + gamma*(p - state%m)
        y = state%y + gamma*(qp%initial_penetration - z - state%y)
        ! Energy product of the step and the last change; C W m = y_0 - y.
        if (sum(qp%weight*(p - state%m)*(y_old - y)) < 0) t = 1
        t_next = (1 + sqrt(1 + 4*t**2))/2
        momentum = (t - 1)/t_next
        t = t_next
        state%m = m + momentum*(m - m_old)
        state%y = y + momentum*(y - y_old)
        m_old = m
        y_old = y
      end do
    end if
    call finish_iteration(monitor, state)
    associate (not_needed => same_type_as(self, self), nor_this => allocated(error))
    end associate
  end subroutine nesterov_solve
end module dotyk_scheme_nesterov
