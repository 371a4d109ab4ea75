!> The relaxation parameter gamma of (32) and (44), and the eigenvalue L that rules it for G = A.
module dotyk_scheme_relaxation
  use dotyk_base_error, only: about_solver, error_t, set_error
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gamma_fixed, gamma_theory, stop_paper
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: largest_square, rough
  use dotyk_linalg_spectrum, only: largest_eigenvalue, linear_operator_t
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private
  public :: estimate_lambda_max, upper_estimate, choose_relaxation, announce_relaxation, factor_text

  !> `Theta^{-1/2} W^{1/2} C W^{1/2} Theta^{-1/2}`: symmetric, with the spectrum of `Theta^{-1} C W`. The pointers are
  !> to dummy arguments of the procedure that has it as a local variable.
  type, extends(linear_operator_t) :: penalty_compliance_t
    class(compliance_t), pointer :: compliance => null()  !! C.
    type(contact_qp_t), pointer :: qp => null()  !! The rows.
    real(dp), allocatable :: scale(:)  !! W^{1/2} Theta^{-1/2} (n_rows).
  contains
    procedure :: apply => penalty_compliance_apply
  end type penalty_compliance_t

  !> Factor of Ritz value plus residual: a Ritz value can have converged to the second eigenvalue.
  real(dp), parameter, public :: margin = 1.02_dp
  integer, parameter :: most_steps = 100  !! Lanczos steps at most.

contains

  !> Upper estimate of L = lambda_max(Theta^{-1} C W), the constant D of (22) in the energy norm; j'' is not negative,
  !> equation (20). gamma = 2/(2+L) diverges already when L is short by 1.
  subroutine estimate_lambda_max(qp, compliance, lambda_max)
    type(contact_qp_t), intent(in), target :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout), target :: compliance  !! Compliance of the bodies at these rows.
    real(dp), intent(out) :: lambda_max  !! L [].
    type(penalty_compliance_t) :: operator
    operator%qp => qp
    operator%compliance => compliance
    operator%scale = sqrt(qp%weight/qp%theta)
    lambda_max = upper_estimate(operator, qp%n_rows)
  end subroutine estimate_lambda_max

  !> Upper estimate of the largest eigenvalue of an operator, `1.02 (Ritz value + residual)`; after an interrupt one
  !> that no L is larger than, so that all bounds made with it hold, and no step is too long.
  real(dp) function upper_estimate(operator, n) result(value)
    class(linear_operator_t), intent(inout) :: operator  !! The operator, symmetric and positive semidefinite.
    integer, intent(in) :: n  !! Order of the operator.
    real(dp) :: ritz, residual
    integer :: steps
    call largest_eigenvalue(operator, n, rough, most_steps, ritz, residual, steps)
    value = margin*(ritz + residual)
    if (interrupted()) value = largest_square
  end function upper_estimate

  !> y = Theta^{-1/2} W^{1/2} C W^{1/2} Theta^{-1/2} x.
  subroutine penalty_compliance_apply(self, x, y)
    class(penalty_compliance_t), intent(inout) :: self
    real(dp), intent(in) :: x(:)  !! Vector x (n_rows) [any].
    real(dp), intent(out) :: y(:)  !! Product y (n_rows) [as `x`].
    call self%compliance%multiply(self%qp, self%scale*x, y)
    y = self%scale*y
  end subroutine penalty_compliance_apply

  !> gamma by one of the rules.
  pure real(dp) function relaxation_parameter(rule, constants, given) result(gamma)
    integer, intent(in) :: rule  !! One of `gamma_*` of dotyk_base_options.
    type(iteration_constants_t), intent(in) :: constants  !! Constants of the iteration.
    real(dp), intent(in) :: given  !! Value for the rule `gamma_fixed` [].
    select case (rule)
    case (gamma_theory)
      gamma = constants%gamma_of_paper()
    case (gamma_fixed)
      gamma = given
    case default
      gamma = constants%best_gamma()
    end select
  end function relaxation_parameter

  !> gamma and the contraction factor of the general iteration (32).
  subroutine choose_relaxation(settings, state, error)
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    type(solver_state_t), intent(inout) :: state  !! With the constants of the iteration; gets gamma and the factor.
    !> Allocated where the rule of the paper is to end the iteration, and gamma is beyond Theorem 3.
    type(error_t), allocatable, intent(out) :: error
    associate (constants => state%constants)
      state%gamma = relaxation_parameter(settings%gamma_rule, constants, settings%gamma)
      state%q_predicted = constants%contraction(state%gamma)
      if (settings%stop_rule == stop_paper .and. .not. state%gamma < constants%gamma_limit_of_paper()) &
        call set_error(error, "&solver: stop_rule='paper' needs gamma < gamma_2 of Theorem 3, of which "// &
                       to_text(constants%gamma_limit_of_paper())//' is a computed lower bound, and gamma is '// &
                       to_text(state%gamma)//"; use gamma_rule='theory' or another stop_rule", about=about_solver)
    end associate
  end subroutine choose_relaxation

  !> How fast the iteration will be, where it would not converge, and what Theorems 3 and 4 say of it.
  subroutine announce_relaxation(monitor, state, spectrum)
    class(monitor_t), intent(inout) :: monitor  !! Gets lines for the log.
    type(solver_state_t), intent(in) :: state  !! With constants, gamma and the factor.
    character(*), intent(in) :: spectrum  !! The eigenvalues that rule the iteration.
    character(:), allocatable :: best
    associate (constants => state%constants)
      call monitor%note('relaxation       gamma '//to_text(state%gamma, 4)//' (stability limit '// &
                        to_text(constants%gamma_limit(), 4)//'), '//spectrum//', convergence factor at most '// &
                        factor_text(state%q_predicted))
      best = factor_of_paper(constants, constants%gamma_of_paper())
      ! The constants are estimates on the safe side.
      if (state%gamma < constants%gamma_limit_of_paper()) then
        call monitor%note('Theorem 3        gamma_2 >= '//to_text(constants%gamma_limit_of_paper(), 4)// &
                          ': convergence')
        call monitor%note('Theorem 4        q = '//factor_of_paper(constants, state%gamma)// &
                          ' of (40); the least is '//best//', with gamma '//to_text(constants%gamma_of_paper(), 4))
      else
        call monitor%note('Theorem 3        gamma_2 >= '//to_text(constants%gamma_limit_of_paper(), 4)// &
                          ': does not apply, gamma is larger')
        call monitor%note('Theorem 4        best gamma '//to_text(constants%gamma_of_paper(), 4)//', with q = '// &
                          best//' of (40)')
      end if
      if (state%gamma > constants%gamma_limit()) call monitor%warn('gamma = '//to_text(state%gamma)// &
        ' may diverge: the stability limit is '//to_text(constants%gamma_limit()))
    end associate
  end subroutine announce_relaxation

  !> q of (40), without loss of digits near 1.
  function factor_of_paper(constants, gamma) result(text)
    type(iteration_constants_t), intent(in) :: constants  !! Constants of the iteration.
    real(dp), intent(in) :: gamma  !! Relaxation parameter below gamma_2 [].
    character(:), allocatable :: text
    real(dp) :: q
    q = constants%contraction_of_paper(gamma)
    text = factor_text(q)
    if (index(text, '1 - ') == 1) text = '1 - '//to_text(constants%gain_of_paper(gamma)/(1 + q), 3)
    if (.not. q < 1) text = '1 - '//to_text(constants%gain_of_paper(gamma)/2, 3)
  end function factor_of_paper

  !> A contraction factor; near 1 as 1 less a small number.
  function factor_text(q) result(text)
    real(dp), intent(in) :: q  !! The factor [].
    character(:), allocatable :: text
    real(dp), parameter :: near_one = 1.0e-3_dp
    text = to_text(q, 6)
    if (q < 1 .and. 1 - q < near_one) text = '1 - '//to_text(1 - q, 3)
  end function factor_text
end module dotyk_scheme_relaxation
