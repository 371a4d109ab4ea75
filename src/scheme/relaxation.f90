!> The relaxation parameter gamma of (44), and the eigenvalue L that rules it.
module dotyk_scheme_relaxation
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: gamma_fixed, gamma_theory
  use dotyk_linalg_spectrum, only: largest_eigenvalue, linear_operator_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  !> `Theta^{-1/2} W^{1/2} C W^{1/2} Theta^{-1/2}`: symmetric, with the spectrum of `Theta^{-1} C W`. The pointers are
  !> to dummy arguments of the procedure that has it as a local variable.
  type, extends(linear_operator_t), public :: penalty_compliance_t
    !> C.
    class(compliance_t), pointer :: compliance => null()
    !> The rows.
    type(contact_qp_t), pointer :: qp => null()
    !> W^{1/2} Theta^{-1/2} (n_rows).
    real(dp), allocatable :: scale(:)
  contains
    procedure :: apply => penalty_compliance_apply
  end type penalty_compliance_t

  public :: estimate_lambda_max, relaxation_parameter

  !> Stands for an L that an interrupt left unknown: no L is larger, so that all bounds made with it hold, and no step
  !> is too long.
  real(dp), parameter, public :: lambda_max_unknown = 1.0e100_dp

  !> Relative residual at which the Ritz value is taken for converged.
  real(dp), parameter :: tolerance = 1.0e-2_dp
  !> Factor of Ritz value plus residual: a Ritz value can have converged to the second eigenvalue.
  real(dp), parameter :: margin = 1.02_dp
  !> Lanczos steps at most.
  integer, parameter :: most_steps = 100

contains

  !> Upper estimate of L = lambda_max(Theta^{-1} C W), `1.02 (Ritz value + residual)`: gamma = 2/(2+L) diverges already
  !> when L is short by 1.
  subroutine estimate_lambda_max(qp, compliance, theta, lambda_max)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in), target :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout), target :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> L [].
    real(dp), intent(out) :: lambda_max
    type(penalty_compliance_t) :: operator
    real(dp) :: ritz, residual
    integer :: steps
    operator%qp => qp
    operator%compliance => compliance
    operator%scale = sqrt(qp%weight/theta)
    call largest_eigenvalue(operator, qp%n_rows, tolerance, most_steps, ritz, residual, steps)
    lambda_max = margin*(ritz + residual)
    if (interrupted()) lambda_max = lambda_max_unknown
  end subroutine estimate_lambda_max

  !> y = Theta^{-1/2} W^{1/2} C W^{1/2} Theta^{-1/2} x.
  subroutine penalty_compliance_apply(self, x, y)
    !> The operator.
    class(penalty_compliance_t), intent(inout) :: self
    !> Vector x (n_rows) [any].
    real(dp), intent(in) :: x(:)
    !> Product y (n_rows) [as `x`].
    real(dp), intent(out) :: y(:)
    call self%compliance%multiply(self%qp, self%scale*x, y)
    y = self%scale*y
  end subroutine penalty_compliance_apply

  !> gamma by one of the rules.
  pure real(dp) function relaxation_parameter(rule, lambda_max, given) result(gamma)
    !> One of `gamma_*` of dotyk_base_options.
    integer, intent(in) :: rule
    !> L [].
    real(dp), intent(in) :: lambda_max
    !> Value for the rule `gamma_fixed` [].
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
