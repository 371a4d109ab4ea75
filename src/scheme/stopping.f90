!> When an iteration on held bodies ends: what it measures at each step, and when there is no more to gain.
module dotyk_scheme_stopping
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: default_gamma_rule, default_linear_solver, default_max_iterations, default_stop_rule, &
    default_tolerance, stop_increment, stop_paper
  use dotyk_base_thresholds, only: half_digits
  use dotyk_base_timer, only: wall_time
  use dotyk_ranks_exchange, only: on_any_rank
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_diverged, ended_interrupted, ended_limit, ended_stalled, &
    ended_time, history_t, paused_t, solver_state_t
  implicit none
  private

  type, public :: solver_settings_t  !! What the user may choose for a scheme.
    integer :: gamma_rule = default_gamma_rule  !! Rule for gamma, one of `gamma_*` of dotyk_base_options.
    real(dp) :: gamma = 0  !! gamma for the rule `gamma_fixed` [].
    integer :: stop_rule = default_stop_rule  !! Rule that ends the iteration, one of `stop_*` of dotyk_base_options.
    real(dp) :: tolerance = default_tolerance  !! Tolerance of that rule, relative, in the energy norm [].
    integer :: max_iterations = default_max_iterations  !! Steps at most.
    !> Wall time after which an iteration pauses with `ended_time`, after one step at least [s].
    real(dp) :: time_limit = huge(1.0_dp)
    !> How the linear systems of active sets are solved: one of `linear_solver_*`.
    integer :: linear_solver = default_linear_solver
    !> Initial gap up to which a contact row has Robin conditions in the Robin scheme: `-huge` for none, `huge` for all
    !> rows; all rows of all pairs where it is not allocated (n_pairs) [length].
    real(dp), allocatable :: robin_gap(:)
  end type solver_settings_t

  type, public :: stopping_t  !! Watches an iteration.
    type(solver_settings_t), private :: settings  !! Settings of the user; limits are those of the last continuation.
    !> Wall time that counts as the start of the history, and that of the start or of the last continuation [s].
    real(dp), private :: start = 0, resumed = 0
    integer, private :: step = 0  !! Steps of this iteration.
    real(dp), private :: shortest = huge(1.0_dp)  !! Shortest step so far [sqrt(energy)].
    real(dp), private :: best = huge(1.0_dp)  !! Best measure so far [].
    integer, private :: best_step = 0  !! Step of the best measure.
    integer, private :: patience = 200  !! Steps without any gain after which rounding is to blame, at least at first.
  contains
    procedure :: begin => stopping_begin
    procedure :: check => stopping_check
    procedure, private :: resume => stopping_resume
  end type stopping_t

  !> An iteration that can pause. Schemes whose steps depend on more than the last iterate extend it by that.
  type, extends(paused_t), public :: iteration_t
    type(stopping_t) :: stopping  !! When it ends.
  end type iteration_t

  public :: take_up

  !> A step this many times longer than the shortest so far: the iteration diverges.
  real(dp), parameter :: growth_of_divergence = 1.0e3_dp
  real(dp), parameter :: least_gain = 0.99_dp  !! A measure counts as a gain below this fraction of the best one so far.
  !> Patience in multiples of the 1/(1-q) steps that a factor e takes.
  real(dp), parameter :: patience_factor = 10

contains

  !> Begin.
  subroutine stopping_begin(self, settings, q)
    class(stopping_t), intent(out) :: self
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    real(dp), intent(in) :: q  !! Factor per step that the theory promises; 1 or more where it promises none [].
    self%settings = settings
    self%start = wall_time()
    self%resumed = self%start
    if (q < 1) self%patience = max(self%patience, int(min(real(huge(0), dp), patience_factor/(1 - q))))
  end subroutine stopping_begin

  !> Continue a paused iteration. Seconds of the history continue with those of its last entry.
  subroutine stopping_resume(self, settings, history)
    class(stopping_t), intent(inout) :: self
    !> With the limits of the continuation: max_iterations holds for the whole history.
    type(solver_settings_t), intent(in) :: settings
    type(history_t), intent(in) :: history  !! With at least one entry.
    self%settings%max_iterations = settings%max_iterations
    self%settings%time_limit = settings%time_limit
    self%resumed = wall_time()
    self%start = self%resumed - history%seconds(history%n)
  end subroutine stopping_resume

  !> Take up the iteration of a state that the time limit stopped.
  subroutine take_up(settings, state, iteration)
    type(solver_settings_t), intent(in) :: settings  !! As in `stopping_resume`.
    type(solver_state_t), intent(inout) :: state  !! Without a paused iteration on return.
    !> Not allocated where nothing is paused: a new iteration begins.
    class(paused_t), allocatable, intent(out) :: iteration
    call move_alloc(state%paused, iteration)
    if (.not. allocated(iteration)) return
    select type (iteration)
    class is (iteration_t)
      call iteration%stopping%resume(settings, state%history)
    end select
  end subroutine take_up

  !> Record a step, and say whether it was the last.
  logical function stopping_check(self, qp, bound, length, diverges, monitor, state, bound_of_paper) result(finished)
    class(stopping_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    !> A guaranteed bound of ||u - u_theta||_A besides that of the duality gap [sqrt(energy)].
    real(dp), intent(in) :: bound
    real(dp), intent(in) :: length  !! Length of the step in the norm of G [sqrt(energy)].
    logical, intent(in) :: diverges  !! Whether no gain means divergence (gamma is too large) and not rounding.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(solver_state_t), intent(inout) :: state  !! With the new iterate m, y.
    real(dp), intent(in) :: bound_of_paper  !! Bound (41) [sqrt(energy)].
    real(dp) :: norm, gap, measure, waited
    logical :: at_limit
    finished = .true.
    state%stop_rule = self%settings%stop_rule
    associate (m => state%pressure, y => state%penetration)
      norm = qp%energy_norm(m, y)
      gap = duality_gap(qp%weight, qp%theta, m, y)
      state%error_bound = bound
      if (sqrt(gap) < bound) state%error_bound = sqrt(gap)
      state%error_bound = relative(state%error_bound, norm)
      state%error_bound_paper = relative(bound_of_paper, norm)
      state%energy = qp%energy(m, y)
      state%max_penetration = max(0.0_dp, maxval(y))
      call state%history%add(wall_time() - self%start, length, relative(length, norm), state%error_bound, &
                             state%energy, state%max_penetration, count(y > 0), state%error_bound_paper)
    end associate
    self%step = self%step + 1
    select case (self%settings%stop_rule)
    case (stop_paper)
      measure = state%error_bound_paper
    case (stop_increment)
      measure = relative(length, norm)
    case default
      measure = state%error_bound
    end select
    if (measure <= self%settings%tolerance) then
      state%ended = ended_converged
      return
    end if
    self%shortest = min(self%shortest, length)
    ! Steps can vanish by chance.
    if (.not. ieee_is_finite(length) .or. length > growth_of_divergence*max(self%shortest, half_digits*norm)) then
      state%ended = ended_diverged
      return
    end if
    if (measure < least_gain*self%best) then
      self%best = measure
      self%best_step = self%step
    else if (self%step - self%best_step > self%patience) then
      ! Too large a gamma lets rows change between active and inactive for ever: no growth, but no gain either.
      state%ended = merge(ended_diverged, ended_stalled, diverges)
      return
    end if
    state%ended = ended_limit
    at_limit = state%history%n >= self%settings%max_iterations
    waited = wall_time() - self%resumed
    if (self%settings%time_limit < huge(waited)) then
      if (on_any_rank(waited >= self%settings%time_limit) .and. .not. at_limit) state%ended = ended_time
    end if
    if (interrupted()) state%ended = ended_interrupted
    finished = at_limit .or. state%ended /= ended_limit
    if (.not. finished) call monitor%step(state%history, self%settings%tolerance, measure)
  end function stopping_check

  !> A quotient of norms; 0 where both are 0, NaN where the value is.
  elemental real(dp) function relative(value, norm) result(ratio)
    real(dp), intent(in) :: value  !! Value [any].
    real(dp), intent(in) :: norm  !! Norm that it is relative to [as `value`].
    if (norm > 0) then
      ratio = value/norm
    else if (ieee_is_nan(value)) then
      ratio = value
    else if (value > 0) then
      ratio = huge(ratio)
    else
      ratio = value
    end if
  end function relative
end module dotyk_scheme_stopping
