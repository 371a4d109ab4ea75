!> The parallel Neumann scheme (43)-(46).
!>
!> On every body at once a linear problem with the last known contact pressure as traction, then a relaxation. With the state of
!> `dotyk_scheme_problem`: `p = max(0, y)/theta`, `z = C W p` (one solve of every body), `m := gamma p + (1-gamma) m`, and
!> `y := gamma (y_free - z) + (1-gamma) y`, which forgets its rounding errors as it goes.
module dotyk_scheme_neumann
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: to_text
  use dotyk_base_timer, only: wall_time
  use dotyk_scheme_bounds, only: duality_gap, contraction, bound_of_paper, gamma_limit, gamma_limit_of_paper
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_limit, ended_diverged, ended_stalled
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_progress, only: progress_line
  use dotyk_scheme_relaxation, only: estimate_lambda_max, relaxation_parameter
  implicit none
  private

  !> What ends the iteration (`stop_rule` of the input).
  integer, parameter, public :: stop_residual = 1   !< the guaranteed bound is below the tolerance
  integer, parameter, public :: stop_paper = 2      !< (41) is below the tolerance
  integer, parameter, public :: stop_increment = 3  !< the last step is below the tolerance

  !> What the user may choose.
  type, public :: neumann_settings_t
    !> Rule for gamma, of `dotyk_scheme_relaxation`, and its value where it is given.
    integer :: gamma_rule = 1
    real(dp) :: gamma = 0
    !> Rule that ends the iteration, and its tolerance (relative, energy norm).
    integer :: stop_rule = stop_residual
    real(dp) :: tolerance = 1.0e-6_dp
    !> Steps at most.
    integer :: max_iterations = 100000
  end type neumann_settings_t

  public :: solve_neumann

  !> A step this many times longer than the shortest so far: the iteration diverges.
  real(dp), parameter :: growth_of_divergence = 1.0e3_dp
  !> Relative to ||u||_A.
  real(dp), parameter :: shortest_step = 1.0e-10_dp

contains

  !> Iterate from u0, the scene without contact.
  subroutine solve_neumann(problem, settings, log, result, error)
    type(contact_problem_t), intent(inout) :: problem
    type(neumann_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    type(error_t), allocatable, intent(out) :: error
    integer :: n

    n = problem%operator%n_rows
    result%y = problem%y_free
    allocate (result%alpha(0))
    allocate (result%m(n), source=0.0_dp)
    if (n == 0) then
      result%ended = ended_converged
      result%energy = problem%energy_free
      call result%history%finish()
      return
    end if
    call estimate_lambda_max(problem, result%lambda_max)
    result%gamma = relaxation_parameter(settings%gamma_rule, result%lambda_max, settings%gamma)
    result%q_predicted = contraction(result%gamma, result%lambda_max)
    if (settings%stop_rule == stop_paper .and. .not. result%gamma < gamma_limit_of_paper(result%lambda_max)) then
      call set_error(error, "&solver: stop_rule='paper' needs gamma below gamma_2 = "// &
        to_text(gamma_limit_of_paper(result%lambda_max))//' of Theorem 3, and gamma is '//to_text(result%gamma)// &
        "; use gamma_rule='theory' or another stop_rule")
      return
    end if
    call announce(log, result)
    call iterate(problem, settings, log, result)
    call result%history%finish()
    result%iterations = result%history%n
    result%q_measured = result%history%measured_contraction()
  end subroutine solve_neumann

  !> The steps of (43), (44).
  subroutine iterate(problem, settings, log, result)
    type(contact_problem_t), intent(inout) :: problem
    type(neumann_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(inout) :: result
    real(dp), allocatable :: p(:), z(:)
    real(dp) :: start, residual, increment, norm, shortest, best, measure, gamma, q
    integer :: k, best_step, patience

    allocate (p(problem%operator%n_rows), z(problem%operator%n_rows))
    gamma = result%gamma
    q = result%q_predicted
    start = wall_time()
    shortest = huge(shortest)
    best = huge(best)
    best_step = 0
    ! Steps without any gain after which rounding is to blame: several times the 1/(1-q) that a factor e takes.
    patience = 200
    if (q < 1) patience = int(min(1.0e9_dp, max(200.0_dp, 10/(1 - q))))
    associate (weight => problem%operator%weight, theta => problem%operator%theta, m => result%m, y => result%y)
      do k = 1, settings%max_iterations
        p = max(0.0_dp, y)/theta
        call problem%compliance(weight*p, z)
        ! ||K^{-1} F'_theta(u^k)||_A^2 = (p-m)^T W C W (p-m), with C W m = y_free - y.
        residual = sqrt(max(0.0_dp, sum(weight*(p - m)*(z - (problem%y_free - y)))))
        increment = gamma*residual
        m = gamma*p + (1 - gamma)*m
        y = gamma*(problem%y_free - z) + (1 - gamma)*y

        norm = problem%norm(m, y)
        result%error_bound = relative(min(q*residual, sqrt(duality_gap(weight, theta, m, y))), norm)
        result%error_bound_paper = relative(bound_of_paper(gamma, result%lambda_max, increment), norm)
        result%energy = problem%energy(m, y)
        result%max_penetration = max(0.0_dp, maxval(y))
        call result%history%add(wall_time() - start, increment, relative(increment, norm), result%error_bound, result%energy, &
                                result%max_penetration, count(y > 0))

        select case (settings%stop_rule)
        case (stop_paper)
          measure = result%error_bound_paper
        case (stop_increment)
          measure = relative(increment, norm)
        case default
          measure = result%error_bound
        end select
        if (measure <= settings%tolerance) then
          result%ended = ended_converged
          exit
        end if
        shortest = min(shortest, residual)
        ! Steps as short as rounding errors do not count: they can vanish by chance.
        if (.not. ieee_is_finite(residual) .or. residual > growth_of_divergence*max(shortest, shortest_step*norm)) then
          result%ended = ended_diverged
          exit
        end if
        if (measure < 0.99_dp*best) then
          best = measure
          best_step = k
        else if (k - best_step > patience) then
          ! Too large a gamma makes points flip open and shut for ever: no growth, but no gain either.
          result%ended = merge(ended_diverged, ended_stalled, gamma >= gamma_limit(result%lambda_max))
          exit
        end if
        if (log%due()) call log%progress(progress_line(result%history, settings%tolerance, measure))
      end do
    end associate
    call log%end_progress()
  end subroutine iterate

  !> Say how fast the iteration will be, and where it would not converge.
  subroutine announce(log, result)
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(in) :: result
    call log%line('  relaxation       gamma '//to_text(result%gamma, 4)//', largest eigenvalue L <= '// &
                  to_text(result%lambda_max, 4)//', factor per step at most '//to_text(result%q_predicted, 6))
    if (result%gamma >= gamma_limit(result%lambda_max)) call log%line('  warning: gamma = '//to_text(result%gamma)// &
      ' may diverge; gamma below 2/(1+L) = '//to_text(gamma_limit(result%lambda_max))//' converges')
  end subroutine announce

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
end module dotyk_scheme_neumann
