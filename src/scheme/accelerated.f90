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
  use dotyk_scheme_bounds, only: contraction
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_neumann, only: begin_iteration, evaluate_step, finish_iteration
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t, stopping_t
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

  abstract interface
    !> Move an iterate to the next one.
    subroutine extrapolation(weight, changes, f_m, f_y, m, y)
      import :: changes_t, dp
      !> Weights of the contact rows (n_rows) [area].
      real(dp), intent(in) :: weight(:)
      !> Of the last steps, at least one.
      type(changes_t), intent(in) :: changes
      !> f at the iterate (n_rows) [pressure], [length].
      real(dp), intent(in) :: f_m(:), f_y(:)
      !> The iterate (n_rows) [pressure], [length].
      real(dp), intent(inout) :: m(:), y(:)
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
    class(anderson_t), intent(in) :: self
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
    call iterate(qp, compliance, theta, settings, window, most_growth_anderson, mix, monitor, state)
    associate (not_needed => same_type_as(self, self), nor_this => allocated(error))
    end associate
  end subroutine anderson_solve

  !> Iterate with crossed secants.
  subroutine secant_solve(self, qp, compliance, theta, settings, monitor, state, error)
    class(secant_t), intent(in) :: self
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
    call iterate(qp, compliance, theta, settings, 1, most_growth_secant, cross, monitor, state)
    associate (not_needed => same_type_as(self, self), nor_this => allocated(error))
    end associate
  end subroutine secant_solve

  !> The safeguarded iteration.
  subroutine iterate(qp, compliance, theta, settings, n_remembered, most_growth, extrapolate, monitor, state)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    type(solver_settings_t), intent(in) :: settings
    !> Changes that the extrapolation uses at most.
    integer, intent(in) :: n_remembered
    !> A residual this many times the least one drops the history [].
    real(dp), intent(in) :: most_growth
    procedure(extrapolation) :: extrapolate
    class(monitor_t), intent(inout) :: monitor
    type(solver_state_t), intent(inout) :: state
    type(stopping_t) :: stopping
    type(changes_t) :: changes
    real(dp), allocatable :: p(:), z(:), f_m(:), f_y(:), best_m(:), best_y(:)
    real(dp) :: residual, least
    integer :: n

    call begin_iteration(qp, compliance, theta, settings, state)
    n = size(state%m)
    if (n > 0) then
      allocate (p(n), z(n))
      allocate (changes%f_m(n, n_remembered), changes%f_y(n, n_remembered))
      allocate (changes%g_m(n, n_remembered), changes%g_y(n, n_remembered))
      least = huge(least)
      ! No contraction factor is proven.
      state%q_predicted = ieee_value(residual, ieee_quiet_nan)
      ! A gamma that is too large is reduced by the safeguard, which takes steps: hence the patience of a contracting
      ! iteration.
      call stopping%begin(settings, contraction(2/(2 + state%lambda_max), state%lambda_max), safeguarded=.true.)
      do
        call evaluate_step(qp, compliance, theta, state%m, state%y, p, z, residual)
        if (stopping%check(qp, theta, residual, state%gamma*residual, .false., monitor, state)) exit
        if (residual/most_growth > least) then
          state%m = best_m
          state%y = best_y
          least = huge(least)
          ! The cause may be gamma.
          state%gamma = min(state%gamma, 2/(2 + state%lambda_max))
          changes%steps = -1
          cycle
        end if
        if (residual < least) then
          least = residual
          best_m = state%m
          best_y = state%y
        end if
        f_m = state%gamma*(p - state%m)
        f_y = state%gamma*(qp%initial_penetration - z - state%y)
        call changes%add(state%m, state%y, f_m, f_y)
        if (changes%n > 0) then
          call extrapolate(qp%weight, changes, f_m, f_y, state%m, state%y)
        else
          state%m = state%m + f_m
          state%y = state%y + f_y
        end if
      end do
    end if
    call finish_iteration(monitor, state)
  end subroutine iterate

  !> Record a step; the oldest change makes room.
  subroutine changes_add(self, m, y, f_m, f_y)
    class(changes_t), intent(inout) :: self
    !> The iterate, and f there (n_rows) [pressure], [length].
    real(dp), intent(in) :: m(:), y(:), f_m(:), f_y(:)
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
    real(dp), intent(in) :: weight(:)
    type(changes_t), intent(in) :: changes
    real(dp), intent(in) :: f_m(:), f_y(:)
    real(dp), intent(inout) :: m(:), y(:)
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
    real(dp), intent(in) :: weight(:)
    type(changes_t), intent(in) :: changes
    real(dp), intent(in) :: f_m(:), f_y(:)
    real(dp), intent(inout) :: m(:), y(:)
    real(dp) :: s, square
    s = 0
    square = -sum(weight*changes%f_m(:, 1)*changes%f_y(:, 1))
    if (square > 0) s = -sum(weight*changes%f_m(:, 1)*changes%g_y(:, 1))/square
    m = m + (1 - s)*f_m
    y = y + (1 - s)*f_y
  end subroutine cross
end module dotyk_scheme_accelerated
