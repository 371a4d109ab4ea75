!> Accelerated Neumann schemes: Anderson's mixing and the crossed secant method.
!>
!> Both extrapolate the fixed-point iteration `m := g(m)` of `dotyk_scheme_neumann` from the changes of `f = g(m) - m`
!> and of `g(m)` over the last steps, with the energy product `<a, b> = a W C W b`. They differ in the extrapolation
!> alone, which is an argument of the iteration. No convergence theorem covers either: where the residual grows, the
!> history is dropped and the iteration continues from the best iterate.
module dotyk_scheme_accelerated
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_scheme_bounds, only: iteration_constants_t, neumann_constants
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_neumann, only: begin_iteration, evaluate_step, finish_iteration
  use dotyk_scheme_relaxation, only: estimate_lambda_max, relaxation_parameter
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: paused_t, solver_state_t
  use dotyk_scheme_stopping, only: iteration_t, solver_settings_t, take_up
  implicit none
  private

  !> Anderson's mixing (Anderson 1965; Walker, Ni 2011): the combination of the last images whose residuals cancel best.
  type, extends(scheme_t), public :: anderson_t
  contains
    procedure :: solve => anderson_solve
  end type anderson_t

  !> The crossed secant method (Ramiere, Helfer 2015): the fixed point along the line through the last two iterates.
  type, extends(scheme_t), public :: secant_t
  contains
    procedure :: solve => secant_solve
  end type secant_t

  !> Changes from step to step. C W times a change of m is minus the change of y.
  type :: changes_t
    !> Number of columns in use.
    integer :: n = 0
    !> Steps since the history was dropped; -1: none.
    integer :: steps = -1
    !> Changes of f and of g, in m [pressure] and in y [length] (n_rows, window).
    real(dp), allocatable :: f_m(:, :), f_y(:, :), g_m(:, :), g_y(:, :)
    !> f and g of the last step (n_rows).
    real(dp), allocatable :: last_f_m(:), last_f_y(:), last_g_m(:), last_g_y(:)
  contains
    procedure :: add => changes_add
  end type changes_t

  !> The iteration with its memory.
  type, extends(iteration_t) :: accelerated_t
    !> Changes over the last steps.
    type(changes_t) :: changes
    !> max(0, y)/theta and C W p at the iterate (n_rows) [pressure], [length].
    real(dp), allocatable :: p(:), z(:)
    !> The iterate of the least residual since the history was dropped (n_rows) [pressure], [length].
    real(dp), allocatable :: best_m(:), best_y(:)
    !> Residual of the iterate, and the least one since the history was dropped [sqrt(energy)].
    real(dp) :: residual = 0, least = huge(1.0_dp)
  end type accelerated_t

  abstract interface
    !> Move an iterate to the next one.
    subroutine extrapolation(weight, changes, f_m, f_y, m, y)
      import :: changes_t, dp
      !> Weights of the contact rows (n_rows) [area].
      real(dp), intent(in) :: weight(:)
      !> Changes over the last steps, at least one.
      type(changes_t), intent(in) :: changes
      !> f at the iterate, in m (n_rows) [pressure].
      real(dp), intent(in) :: f_m(:)
      !> f at the iterate, in y (n_rows) [length].
      real(dp), intent(in) :: f_y(:)
      !> Contact pressures of the iterate (n_rows) [pressure].
      real(dp), intent(inout) :: m(:)
      !> B u - d of the iterate (n_rows) [length].
      real(dp), intent(inout) :: y(:)
    end subroutine extrapolation
  end interface

  !> Steps that Anderson's mixing remembers.
  integer, parameter :: window = 10
  !> Relative regularization of the diagonal of its least-squares problem.
  real(dp), parameter :: regularization = 1.0e-12_dp
  !> Growth of the residual over the least one at which the history is dropped: mixing many steps goes wrong at once,
  !> one secant recovers from a residual many times larger.
  real(dp), parameter :: most_growth_anderson = 2, most_growth_secant = 100

contains

  !> Iterate with Anderson's mixing.
  subroutine anderson_solve(self, qp, compliance, theta, settings, monitor, state, error)
    !> The scheme.
    class(anderson_t), intent(in) :: self
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
    call iterate(qp, compliance, theta, settings, window, most_growth_anderson, mix, monitor, state)
    associate (not_needed => same_type_as(self, self), nor_this => allocated(error))
    end associate
  end subroutine anderson_solve

  !> Iterate with crossed secants.
  subroutine secant_solve(self, qp, compliance, theta, settings, monitor, state, error)
    !> The scheme.
    class(secant_t), intent(in) :: self
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
    call iterate(qp, compliance, theta, settings, 1, most_growth_secant, cross, monitor, state)
    associate (not_needed => same_type_as(self, self), nor_this => allocated(error))
    end associate
  end subroutine secant_solve

  !> The safeguarded iteration: from u_0 or the state, or a paused one.
  subroutine iterate(qp, compliance, theta, settings, n_remembered, most_growth, extrapolate, monitor, state)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> Changes that the extrapolation uses at most.
    integer, intent(in) :: n_remembered
    !> A residual this many times the least one drops the history [].
    real(dp), intent(in) :: most_growth
    !> Moves an iterate to the next one.
    procedure(extrapolation) :: extrapolate
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    class(paused_t), allocatable :: paused
    logical :: finished
    call take_up(settings, state, paused)
    finished = .false.
    if (.not. allocated(paused)) &
      call begin(qp, compliance, theta, settings, n_remembered, monitor, state, paused, finished)
    select type (paused)
    type is (accelerated_t)
      do while (.not. finished)
        call step(qp, most_growth, extrapolate, paused, state)
        call measure(qp, compliance, theta, paused, monitor, state, finished)
      end do
    end select
    call finish_iteration(monitor, state, paused)
  end subroutine iterate

  !> The first iterate, without any change to remember.
  subroutine begin(qp, compliance, theta, settings, n_remembered, monitor, state, paused, finished)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> Changes that the extrapolation uses at most.
    integer, intent(in) :: n_remembered
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> As in `begin_iteration`.
    type(solver_state_t), intent(inout) :: state
    !> An `accelerated_t`.
    class(paused_t), allocatable, intent(out) :: paused
    !> Whether the first iterate is the last one.
    logical, intent(out) :: finished
    type(accelerated_t), allocatable :: now
    type(iteration_constants_t) :: constants
    integer :: n
    call begin_iteration(qp, compliance, state)
    allocate (now)
    finished = .true.
    n = size(state%m)
    if (n > 0) then
      allocate (now%p(n), now%z(n))
      allocate (now%changes%f_m(n, n_remembered), now%changes%f_y(n, n_remembered))
      allocate (now%changes%g_m(n, n_remembered), now%changes%g_y(n, n_remembered))
      if (.not. state%lambda_max > 0) call estimate_lambda_max(qp, compliance, theta, state%lambda_max)
      constants = neumann_constants(state%lambda_max)
      state%gamma = relaxation_parameter(settings%gamma_rule, constants, settings%gamma)
      ! No contraction factor is proven.
      state%q_predicted = ieee_value(state%q_predicted, ieee_quiet_nan)
      ! A gamma that is too large is reduced by the safeguard, which takes steps: hence the patience of a contracting
      ! iteration.
      call now%stopping%begin(settings, constants%contraction(constants%best_gamma()), safeguarded=.true.)
      call measure(qp, compliance, theta, now, monitor, state, finished)
    end if
    call move_alloc(now, paused)
  end subroutine begin

  !> Evaluate an iterate, and record it.
  subroutine measure(qp, compliance, theta, now, monitor, state, finished)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Gets p, z and the residual.
    type(accelerated_t), intent(inout) :: now
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> With the iterate.
    type(solver_state_t), intent(inout) :: state
    !> Whether it is the last one.
    logical, intent(out) :: finished
    call evaluate_step(qp, compliance, theta, state%m, state%y, now%p, now%z, now%residual)
    finished = now%stopping%check(qp, theta, now%residual, state%gamma*now%residual, .false., monitor, state)
  end subroutine measure

  !> Extrapolate to the next iterate; where the residual has grown, go back to the best one.
  subroutine step(qp, most_growth, extrapolate, now, state)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> As in `iterate` [].
    real(dp), intent(in) :: most_growth
    !> Moves an iterate to the next one.
    procedure(extrapolation) :: extrapolate
    !> Evaluated.
    type(accelerated_t), intent(inout) :: now
    !> Gets the next iterate.
    type(solver_state_t), intent(inout) :: state
    real(dp), allocatable :: f_m(:), f_y(:)
    if (now%residual/most_growth > now%least) then
      state%m = now%best_m
      state%y = now%best_y
      now%least = huge(now%least)
      ! The cause may be gamma.
      state%gamma = min(state%gamma, 2/(2 + state%lambda_max))
      now%changes%steps = -1
      return
    end if
    if (now%residual < now%least) then
      now%least = now%residual
      now%best_m = state%m
      now%best_y = state%y
    end if
    f_m = state%gamma*(now%p - state%m)
    f_y = state%gamma*(qp%initial_penetration - now%z - state%y)
    call now%changes%add(state%m, state%y, f_m, f_y)
    if (now%changes%n > 0) then
      call extrapolate(qp%weight, now%changes, f_m, f_y, state%m, state%y)
    else
      state%m = state%m + f_m
      state%y = state%y + f_y
    end if
  end subroutine step

  !> Record a step; the oldest change makes room.
  subroutine changes_add(self, m, y, f_m, f_y)
    !> The changes.
    class(changes_t), intent(inout) :: self
    !> Contact pressures of the iterate (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> B u - d of the iterate (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> f at the iterate, in m (n_rows) [pressure].
    real(dp), intent(in) :: f_m(:)
    !> f at the iterate, in y (n_rows) [length].
    real(dp), intent(in) :: f_y(:)
    integer :: place
    self%steps = self%steps + 1
    self%n = min(self%steps, size(self%f_m, 2))
    if (self%n > 0) then
      place = mod(self%steps - 1, size(self%f_m, 2)) + 1
      self%f_m(:, place) = f_m - self%last_f_m
      self%f_y(:, place) = f_y - self%last_f_y
      self%g_m(:, place) = m + f_m - self%last_g_m
      self%g_y(:, place) = y + f_y - self%last_g_y
    end if
    self%last_f_m = f_m
    self%last_f_y = f_y
    self%last_g_m = m + f_m
    self%last_g_y = y + f_y
  end subroutine changes_add

  !> `m := g - dg share`, with the shares that make `f - df share` least in the energy norm.
  subroutine mix(weight, changes, f_m, f_y, m, y)
    !> Weights of the contact rows (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> Changes over the last steps, at least one.
    type(changes_t), intent(in) :: changes
    !> f at the iterate, in m (n_rows) [pressure].
    real(dp), intent(in) :: f_m(:)
    !> f at the iterate, in y (n_rows) [length].
    real(dp), intent(in) :: f_y(:)
    !> Contact pressures of the iterate (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> B u - d of the iterate (n_rows) [length].
    real(dp), intent(inout) :: y(:)
    type(error_t), allocatable :: error
    real(dp) :: gram(changes%n, changes%n), share(changes%n, 1)
    integer :: i, j
    do j = 1, changes%n
      do i = 1, changes%n
        gram(i, j) = -sum(weight*changes%f_m(:, i)*changes%f_y(:, j))
      end do
      share(j, 1) = -sum(weight*f_m*changes%f_y(:, j))
    end do
    gram = (gram + transpose(gram))/2
    do j = 1, changes%n
      gram(j, j) = gram(j, j)*(1 + regularization)
    end do
    call solve_dense(gram, share, error)
    if (allocated(error)) share = 0
    m = m + f_m - matmul(changes%g_m(:, :changes%n), share(:, 1))
    y = y + f_y - matmul(changes%g_y(:, :changes%n), share(:, 1))
  end subroutine mix

  !> `m := g - s f`, `s = <dg, df>/<df, df>`.
  subroutine cross(weight, changes, f_m, f_y, m, y)
    !> Weights of the contact rows (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> Change over the last step.
    type(changes_t), intent(in) :: changes
    !> f at the iterate, in m (n_rows) [pressure].
    real(dp), intent(in) :: f_m(:)
    !> f at the iterate, in y (n_rows) [length].
    real(dp), intent(in) :: f_y(:)
    !> Contact pressures of the iterate (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> B u - d of the iterate (n_rows) [length].
    real(dp), intent(inout) :: y(:)
    real(dp) :: s, square
    s = 0
    square = -sum(weight*changes%f_m(:, 1)*changes%f_y(:, 1))
    if (square > 0) s = -sum(weight*changes%f_m(:, 1)*changes%g_y(:, 1))/square
    m = m + (1 - s)*f_m
    y = y + (1 - s)*f_y
  end subroutine cross
end module dotyk_scheme_accelerated
