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
  use dotyk_scheme_relaxation, only: estimate_lambda_max
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: paused_t, solver_state_t
  use dotyk_scheme_stopping, only: iteration_t, solver_settings_t, take_up
  implicit none
  private

  !> The scheme.
  type, extends(scheme_t), public :: nesterov_t
  contains
    procedure :: solve => nesterov_solve
  end type nesterov_t

  !> The iteration with its momentum.
  type, extends(iteration_t) :: momentum_t
    !> max(0, y)/theta and C W p at the iterate (n_rows) [pressure], [length].
    real(dp), allocatable :: p(:), z(:)
    !> The last point without momentum (n_rows) [pressure], [length].
    real(dp), allocatable :: m_old(:), y_old(:)
    !> Nesterov's sequence t_k [].
    real(dp) :: t = 1
  end type momentum_t

contains

  !> Iterate from u_0 or the state, or continue a paused iteration; gamma is 1/(1+L) whatever the settings say.
  subroutine nesterov_solve(self, qp, compliance, theta, settings, monitor, state, error)
    !> The scheme.
    class(nesterov_t), intent(in) :: self
    !> Contact QP of held bodies.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters, above 0 (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    !> Never allocated.
    type(error_t), allocatable, intent(out) :: error
    class(paused_t), allocatable :: paused
    logical :: finished
    call take_up(settings, state, paused)
    finished = .false.
    if (.not. allocated(paused)) call begin(qp, compliance, theta, settings, monitor, state, paused, finished)
    select type (paused)
    type is (momentum_t)
      do while (.not. finished)
        call step(qp, paused, state)
        call measure(qp, compliance, theta, paused, monitor, state, finished)
      end do
    end select
    call finish_iteration(monitor, state, paused)
    associate (not_needed => same_type_as(self, self), nor_this => allocated(error))
    end associate
  end subroutine nesterov_solve

  !> The first iterate, without momentum.
  subroutine begin(qp, compliance, theta, settings, monitor, state, paused, finished)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> As in `begin_iteration`.
    type(solver_state_t), intent(inout) :: state
    !> A `momentum_t`.
    class(paused_t), allocatable, intent(out) :: paused
    !> Whether the first iterate is the last one.
    logical, intent(out) :: finished
    type(momentum_t), allocatable :: momentum
    call begin_iteration(qp, compliance, state)
    allocate (momentum)
    finished = .true.
    if (qp%n_rows > 0) then
      if (.not. state%lambda_max > 0) call estimate_lambda_max(qp, compliance, theta, state%lambda_max)
      state%gamma = 1/(1 + state%lambda_max)
      ! Typical of momentum, but not proven for restarts.
      state%q_predicted = ieee_value(state%q_predicted, ieee_quiet_nan)
      allocate (momentum%p(qp%n_rows), momentum%z(qp%n_rows))
      momentum%m_old = state%m
      momentum%y_old = state%y
      call momentum%stopping%begin(settings, 1 - 1/sqrt(1 + state%lambda_max))
      call measure(qp, compliance, theta, momentum, monitor, state, finished)
    end if
    call move_alloc(momentum, paused)
  end subroutine begin

  !> Evaluate an iterate, the point with momentum, and record it: its bound is the residual.
  subroutine measure(qp, compliance, theta, momentum, monitor, state, finished)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Gets p and z.
    type(momentum_t), intent(inout) :: momentum
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> With the iterate.
    type(solver_state_t), intent(inout) :: state
    !> Whether it is the last one.
    logical, intent(out) :: finished
    real(dp) :: residual
    call evaluate_step(qp, compliance, theta, state%m, state%y, momentum%p, momentum%z, residual)
    finished = momentum%stopping%check(qp, theta, residual, state%gamma*residual, .false., monitor, state)
  end subroutine measure

  !> A gradient step from the iterate, and the momentum of the next one.
  subroutine step(qp, momentum, state)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Evaluated.
    type(momentum_t), intent(inout) :: momentum
    !> Gets the next iterate.
    type(solver_state_t), intent(inout) :: state
    real(dp), allocatable :: m(:), y(:)
    real(dp) :: t_next, share
    allocate (m(size(state%m)), y(size(state%m)))
    associate (gamma => state%gamma, p => momentum%p, z => momentum%z, t => momentum%t)
      m = state%m + gamma*(p - state%m)
      y = state%y + gamma*(qp%initial_penetration - z - state%y)
      ! Energy product of the step and the last change; C W m = y_0 - y.
      if (sum(qp%weight*(p - state%m)*(momentum%y_old - y)) < 0) t = 1
      t_next = (1 + sqrt(1 + 4*t**2))/2
      share = (t - 1)/t_next
      t = t_next
    end associate
    state%m = m + share*(m - momentum%m_old)
    state%y = y + share*(y - momentum%y_old)
    call move_alloc(m, momentum%m_old)
    call move_alloc(y, momentum%y_old)
  end subroutine step
end module dotyk_scheme_nesterov
