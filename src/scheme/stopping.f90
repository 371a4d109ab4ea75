!> When the iterations on held bodies end: what they measure at each step, and when there is no more to gain.
module dotyk_scheme_stopping
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: default_gamma_rule, default_max_iterations, default_stop_rule, default_tolerance, &
    stop_increment, stop_paper
  use dotyk_base_timer, only: wall_time
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_limit, ended_diverged, ended_interrupted, &
    ended_stalled, ended_time
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_progress, only: progress_line
  implicit none
  private

  !> What the user may choose for an iteration.
  type, public :: iteration_settings_t
    !> One of `gamma_*`, and gamma where it is `gamma_fixed` [].
    integer :: gamma_rule = default_gamma_rule
    real(dp) :: gamma = 0
    !> Rule that ends the iteration, and its tolerance (relative, energy norm).
    integer :: stop_rule = default_stop_rule
    real(dp) :: tolerance = default_tolerance
    !> Steps at most.
    integer :: max_iterations = default_max_iterations
    !> Wall time after which it ends with `ended_time` [s].
    real(dp) :: time_limit = huge(1.0_dp)
    !> Pressures to begin with; u0 where not allocated (n_rows) [pressure].
    real(dp), allocatable :: start(:)
    !> L where it is known already, else 0.
    real(dp) :: lambda_max = 0
  end type iteration_settings_t

  !> Keeps watch over an iteration.
  type, public :: stopping_t
    type(iteration_settings_t), private :: settings
    !> Wall time of the start [s].
    real(dp), private :: start = 0
    !> Shortest step and best measure so far, and the step of the latter.
    real(dp), private :: shortest = huge(1.0_dp), best = huge(1.0_dp)
    integer, private :: best_step = 0
    !> Steps without any gain after which rounding is to blame.
    integer, private :: patience = 200
    !> The scheme takes back steps that lead away: growth is no divergence.
    logical, private :: safeguarded = .false.
    !> m and y do not belong to one displacement yet: no duality gap.
    logical, private :: split = .false.
  contains
    procedure :: begin => stopping_begin
    procedure :: check => stopping_check
    procedure :: go_on => stopping_go_on
  end type stopping_t

  public :: relative

  !> A step this many times longer than the shortest so far: the iteration diverges.
  real(dp), parameter :: growth_of_divergence = 1.0e3_dp
  !> Relative to ||u||_A.
  real(dp), parameter :: shortest_step = 1.0e-10_dp

contains

  !> Begin.
  subroutine stopping_begin(self, settings, q, safeguarded, split)
    class(stopping_t), intent(out) :: self
    type(iteration_settings_t), intent(in) :: settings
    !> Factor per step that the theory promises; 1 or more where it promises none.
    real(dp), intent(in) :: q
    !> Whether the scheme takes back steps that lead away, and whether the two sides of its points have states of their own.
    logical, intent(in), optional :: safeguarded, split
    self%settings = settings
    if (present(safeguarded)) self%safeguarded = safeguarded
    if (present(split)) self%split = split
    self%start = wall_time()
    ! Several times the 1/(1-q) that a factor e takes.
    if (q < 1) self%patience = int(min(1.0e9_dp, max(200.0_dp, 10/(1 - q))))
  end subroutine stopping_begin

  !> After all, a smaller tolerance.
  subroutine stopping_go_on(self, tolerance)
    class(stopping_t), intent(inout) :: self
    real(dp), intent(in) :: tolerance
    self%settings%tolerance = tolerance
  end subroutine stopping_go_on

  !> Record a step, and say whether it was the last.
  logical function stopping_check(self, problem, bound, length, diverges, log, result, bound_of_paper) result(finished)
    class(stopping_t), intent(inout) :: self
    type(contact_problem_t), intent(inout) :: problem
    !> A guaranteed bound of ||u - u_theta||_A besides that of the duality gap, and the length of the step [sqrt(energy)].
    real(dp), intent(in) :: bound, length
    !> Whether no gain means divergence (gamma is too large) and not rounding.
    logical, intent(in) :: diverges
    type(log_t), intent(inout) :: log
    !> With the new iterate m, y.
    type(scheme_result_t), intent(inout) :: result
    !> (41); not given where it means nothing [sqrt(energy)].
    real(dp), intent(in), optional :: bound_of_paper
    real(dp) :: norm, gap, measure, seconds
    integer :: k
    finished = .true.
    associate (m => result%m, y => result%y)
      norm = problem%norm(m, y)
      gap = duality_gap(problem%operator%weight, problem%operator%theta, m, y)
      result%error_bound = bound
      if (sqrt(gap) < bound .and. .not. self%split) result%error_bound = sqrt(gap)
      result%error_bound = relative(result%error_bound, norm)
      result%error_bound_paper = ieee_value(norm, ieee_quiet_nan)
      if (present(bound_of_paper)) result%error_bound_paper = relative(bound_of_paper, norm)
      result%energy = problem%energy(m, y)
      result%max_penetration = max(0.0_dp, maxval(y))
      call result%history%add(wall_time() - self%start, length, relative(length, norm), result%error_bound, result%energy, &
                              result%max_penetration, count(y > 0))
    end associate
    k = result%history%n
    select case (self%settings%stop_rule)
    case (stop_paper)
      measure = result%error_bound_paper
    case (stop_increment)
      measure = relative(length, norm)
    case default
      measure = result%error_bound
    end select
    if (measure <= self%settings%tolerance) then
      result%ended = ended_converged
      return
    end if
    self%shortest = min(self%shortest, length)
    ! Steps as short as rounding errors do not count: they can vanish by chance.
    if (.not. ieee_is_finite(length) .or. &
        (length > growth_of_divergence*max(self%shortest, shortest_step*norm) .and. .not. self%safeguarded)) then
      result%ended = ended_diverged
      return
    end if
    if (measure < 0.99_dp*self%best) then
      self%best = measure
      self%best_step = k
    else if (k - self%best_step > self%patience) then
      ! Too large a gamma makes points flip open and shut for ever: no growth, but no gain either.
      result%ended = merge(ended_diverged, ended_stalled, diverges)
      return
    end if
    result%ended = ended_limit
    seconds = wall_time() - self%start
    if (k < self%settings%max_iterations .and. seconds >= self%settings%time_limit) result%ended = ended_time
    if (interrupted()) result%ended = ended_interrupted
    finished = k >= self%settings%max_iterations .or. result%ended /= ended_limit
    if (finished) return
    if (log%due()) call log%progress(progress_line(result%history, self%settings%tolerance, measure))
  end function stopping_check

  !> A quotient of norms; 0 where both are 0, NaN where the value is.
  elemental real(dp) function relative(value, norm) result(ratio)
    real(dp), intent(in) :: value, norm
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
