!> How far the solution with penalty is from that without: ||u_theta - u_0||_A, by solving for u_0. Theorem 1 says that
!> it tends to 0 with theta.
!>
!> From the active set of u_theta, the dual scheme needs a step or two to that of theta = 0, and the entries of the
!> compliance that it works with are formed already, or cost less than the iteration of another scheme. So the estimate
!> is no asymptotic one: it is the distance itself, up to the guaranteed bounds of both solutions, which are added to
!> it. Rows that are inactive with the penalty may be active without it: those that were screened are looked at too. A
!> duality gap between u_theta and an admissible displacement would cost as much (to make it admissible is the same
!> problem), and be too large by the energy of the correction.
!>
!> Two kinds of pairs have another reference than theta = 0. The theta of a real elastic layer is no penalty: it stays.
!> Quadrature points outnumber the unknowns of their surface, so that theta = 0 is over-constrained: its solution locks,
!> and its multipliers are indeterminate. There the reference has a quarter of theta, or of h/E where that is less, and
!> the distance to it is extrapolated: an estimate, not a bound. Theorem 1 names no order. Smooth pressures on a contact
!> zone that stays have the first order in theta, a sharp punch about 0.8, and only 1/2 is guaranteed (docs/theory.md,
!> section 1). With 3/4, the mean of both, the estimate is 16 % too large for order 1 and 23 % too small for order 1/2.
module dotyk_control_penalty_error
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_quadrature
  use dotyk_control_contact_problem, only: contact_problem_t, mesh_compliance
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_solves, ended_stalled
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  type, public :: penalty_reference_t  !! The model that a solution with penalty is compared with.
    real(dp), allocatable :: theta(:)  !! Its penalty parameters (n_rows) [length/pressure].
    !> Its theta over that of the solution, the smallest of all rows where both differ; 0 where the distance is the
    !> error itself [].
    real(dp) :: reduction = 0
  contains
    procedure :: init => reference_init
    procedure :: is_exact => reference_is_exact
  end type penalty_reference_t

  public :: estimate_penalty_error

  !> theta of the reference where theta = 0 is over-constrained, over that of the solution, and over h/E, at most [].
  real(dp), parameter :: reduced = 0.25_dp
  !> Bounds from which a solution is too far from its end for more accurate ones to follow it [].
  real(dp), parameter, public :: near_enough = 0.5_dp
  real(dp), parameter :: order = 0.75_dp  !! Assumed order of the distance in theta [].

contains

  !> The reference of the pairs: the theta of layers stays, that of penalties vanishes, or is reduced where one of them
  !> is at quadrature points.
  subroutine reference_init(self, problem, first_row, theta)
    class(penalty_reference_t), intent(out) :: self
    type(contact_problem_t), intent(in) :: problem  !! Bodies and pairs.
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: theta(:)  !! Penalty parameters of the solution (n_rows) [length/pressure].
    real(dp) :: most
    integer :: k
    logical :: vanishes
    vanishes = .true.
    do k = 1, size(problem%pair)
      if (problem%pair(k)%discretization /= discretization_quadrature .or. problem%pair(k)%is_layer) cycle
      if (any(theta(first_row(k):first_row(k + 1) - 1) > 0)) vanishes = .false.
    end do
    self%theta = 0*theta
    self%reduction = merge(0.0_dp, reduced, vanishes)
    do k = 1, size(problem%pair)
      associate (pair => problem%pair(k), first => first_row(k), last => first_row(k + 1) - 1)
        if (pair%is_layer) self%theta(first:last) = theta(first:last)
        if (pair%is_layer .or. vanishes) cycle
        most = reduced*mesh_compliance(problem%body(pair%body_a), problem%body(pair%body_b), pair)
        self%theta(first:last) = min(reduced*theta(first:last), most)
        self%reduction = min(self%reduction, &
                             minval(self%theta(first:last)/theta(first:last), mask=theta(first:last) > 0))
      end associate
    end do
  end subroutine reference_init

  !> Whether the distance to its solution is the penalty error: a bound with the bounds of both solutions.
  pure logical function reference_is_exact(self) result(is_exact)
    class(penalty_reference_t), intent(in) :: self
    is_exact = .not. self%reduction > 0
  end function reference_is_exact

  !> Estimate from the state where a scheme ended.
  subroutine estimate_penalty_error(qp, compliance, reference, linear_solver, scheme, state, distance, error)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    !> Its compliance operator; entries that the dual scheme forms stay there.
    class(compliance_t), intent(inout) :: compliance
    type(penalty_reference_t), intent(in) :: reference  !! The model without penalty.
    integer, intent(in) :: linear_solver  !! One of `linear_solver_*` of dotyk_base_options, for the dual scheme.
    !> Scheme of the state. Where it knows no theta = 0, the state is solved to the end first, by the dual scheme.
    class(scheme_t), intent(in) :: scheme
    type(solver_state_t), intent(in) :: state  !! Where the scheme ended; used as a start.
    !> ||u_theta - u_0||_A; NaN where the reference has no solution, or none that was found [sqrt(energy)].
    real(dp), intent(out) :: distance
    !> As in `dual_t`, from the solution with theta or the reference: the compliance of an active set is not positive
    !> definite.
    type(error_t), allocatable, intent(out) :: error
    class(scheme_t), allocatable :: solver
    type(solver_settings_t) :: settings
    type(contact_qp_t) :: without
    type(solver_state_t) :: penalized, exact
    type(monitor_t) :: silent
    distance = 0
    if (.not. any(qp%theta > reference%theta)) return
    settings%linear_solver = linear_solver
    penalized = state
    if (.not. scheme%is_iteration()) then
      allocate (solver, source=scheme)
    else
      allocate (dual_t :: solver)
      call solver%solve(qp, compliance, settings, silent, penalized, error)
    end if
    if (allocated(error)) return
    ! The distance is known no better than that.
    if (penalized%error_bound < near_enough) settings%tolerance = max(settings%tolerance, penalized%error_bound)
    if (.not. is_usable(penalized)) then
      distance = ieee_value(distance, ieee_quiet_nan)
    else
      exact = penalized
      without = qp
      call without%replace_theta(reference%theta)
      call solver%solve(without, compliance, settings, silent, exact, error)
      if (allocated(error)) return
      distance = distance_of(qp, compliance, penalized, exact)
      ! A scheme without a solution leaves no state to measure.
      if (.not. ieee_is_nan(distance)) distance = (distance + uncertainty(qp, penalized) + uncertainty(qp, exact))/ &
                                                  (1 - reference%reduction**order)
    end if
  end subroutine estimate_penalty_error

  !> Distance of two states in the energy norm; NaN where one of them is no solution [sqrt(energy)].
  real(dp) function distance_of(qp, compliance, one, other) result(distance)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    class(compliance_t), intent(inout) :: compliance  !! Its compliance operator.
    type(solver_state_t), intent(in) :: one, other  !! Where schemes ended.
    if (is_usable(one) .and. is_usable(other)) then
      distance = compliance%distance(qp, one%pressure - other%pressure, one%alpha - other%alpha)
    else
      distance = ieee_value(distance, ieee_quiet_nan)
    end if
  end function distance_of

  !> Guaranteed bound of the error of a state [sqrt(energy)].
  real(dp) function uncertainty(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(solver_state_t), intent(in) :: state  !! Where a scheme ended.
    uncertainty = state%error_bound*state%norm(qp)
  end function uncertainty

  !> Whether a scheme found a solution.
  pure logical function is_usable(state)
    type(solver_state_t), intent(in) :: state  !! Where a scheme ended.
    is_usable = any(state%ended == [ended_converged, ended_stalled, ended_solves]) .and. &
      allocated(state%pressure) .and. &
                .not. ieee_is_nan(state%error_bound)
  end function is_usable
end module dotyk_control_penalty_error
