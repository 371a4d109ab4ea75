!> The relaxation parameter gamma of (44), and the eigenvalue L that rules it.
module dotyk_scheme_relaxation
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gamma_fixed, gamma_theory
  use dotyk_linalg_spectrum, only: largest_eigenvalue
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  public :: estimate_lambda_max, relaxation_parameter

  !> What stands for an L that an interrupt left unknown: no L is larger, so that all bounds made with it hold, and no step goes wrong.
  real(dp), parameter, public :: lambda_max_unknown = 1.0e100_dp

  !> Relative residual at which the Ritz value is taken for converged.
  real(dp), parameter :: tolerance = 1.0e-2_dp
  !> What is added to Ritz value plus residual: a Ritz value can have converged to the second eigenvalue.
  real(dp), parameter :: margin = 1.02_dp
  !> Lanczos steps at most.
  integer, parameter :: most_steps = 100

contains

  !> Upper estimate of L = lambda_max(Theta^{-1} C W), `1.02 (Ritz value + residual)`: gamma = 2/(2+L) diverges already when L is short by 1.
  subroutine estimate_lambda_max(problem, lambda_max)
    type(contact_problem_t), intent(inout) :: problem
    !> L [].
    real(dp), intent(out) :: lambda_max
    real(dp) :: ritz, residual
    integer :: steps
    call largest_eigenvalue(problem, problem%operator%n_rows, tolerance, most_steps, ritz, residual, steps)
    lambda_max = margin*(ritz + residual)
    if (interrupted()) lambda_max = lambda_max_unknown
  end subroutine estimate_lambda_max

  !> gamma by one of the rules.
  pure real(dp) function relaxation_parameter(rule, lambda_max, given) result(gamma)
    !> One of `gamma_*`.
    integer, intent(in) :: rule
    !> L [].
    real(dp), intent(in) :: lambda_max
    !> Value for the rule `gamma_fixed`.
    real(dp), intent(in) :: given
    select case (rule)
    case (gamma_theory)
      gamma = 1/(1 + lambda_max)**2
    case (gamma_fixed)
      gamma = given
    case default
      gamma = 2/(2 + lambda_max)
    end select
  end function relaxation_parameter
end module dotyk_scheme_relaxation
