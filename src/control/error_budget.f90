!> The error budget of a solution: iteration, penalty, discretization; all in the energy norm, relative to that of the
!> solution.
!>
!> The part of the iteration is the guaranteed bound of the scheme. That of the penalty is the distance to the solution
!> without it, that of the mesh an asymptotically exact estimate
!> (`dotyk_elasticity_discretization_error`). Beside them stands the violation of the contact conditions, which hold in
!> the mean, at single points (`dotyk_contact_complementarity`).
!>
!> Penalty error: ||u_theta - u_0||_A, by solving for u_0, to which u_theta tends with theta (Theorem 1). From the
!> active set of u_theta, the dual scheme needs a step or two to that of theta = 0, and the entries of the compliance
!> that it works with are formed already, or cost less than the iteration of another scheme. So the estimate is no
!> asymptotic one: it is the distance itself, up to the guaranteed bounds of both solutions, which are added to it. Rows
!> that are inactive with the penalty may be active without it: those that were screened are looked at too. A duality
!> gap between u_theta and an admissible displacement would cost as much (to make it admissible is the same problem),
!> and be too large by the energy of the correction.
!>
!> Two kinds of pairs have another reference than theta = 0. The theta of a real elastic layer is no penalty: it stays.
!> Quadrature points outnumber the unknowns of their surface, so that theta = 0 is over-constrained: its solution locks,
!> and its multipliers are indeterminate. There the reference has a quarter of theta, or of h/E where that is less, and
!> the distance to it is extrapolated: an estimate, not a bound. Theorem 1 names no order. Smooth pressures on a contact
!> zone that stays have the first order in theta, a sharp punch about 0.8, and only 1/2 is guaranteed (docs/theory.md,
!> section 1). With 3/4, the mean of both, the estimate is 16 % too large for order 1 and 23 % too small for order 1/2.
module dotyk_control_error_budget
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_quadrature
  use dotyk_contact_complementarity, only: complementarity_error
  use dotyk_control_body_solution, only: displacements_t, element_field_t
  use dotyk_control_contact_problem, only: contact_problem_t, mesh_compliance
  use dotyk_control_kept_estimates, only: kept_estimates_t
  use dotyk_control_mesh_error, only: estimate_mesh_errors
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_interrupted, ended_solves, ended_stalled, ended_time, &
    solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private
  public :: estimate_errors, estimate_penalty_error

  type, public :: penalty_reference_t  !! The model that a solution with penalty is compared with.
    real(dp), allocatable :: theta(:)  !! Its penalty parameters (n_rows) [length/pressure].
    !> Its theta over that of the solution, the smallest of all rows where both differ; 0 where the distance is the
    !> error itself [].
    real(dp) :: reduction = 0
  contains
    procedure :: init => reference_init
    procedure :: is_exact => reference_is_exact
  end type penalty_reference_t

  !> theta of the reference where theta = 0 is over-constrained, over that of the solution, and over h/E, at most [].
  real(dp), parameter :: reduced = 0.25_dp
  !> Bounds from which a solution is too far from its end for more accurate ones to follow it [].
  real(dp), parameter :: near_enough = 0.5_dp
  real(dp), parameter :: order = 0.75_dp  !! Assumed order of the distance in theta [].

  type, public :: error_budget_t  !! Parts of the error, relative; NaN where a part is not known [].
    real(dp) :: penalty = 0  !! Distance to the solution without penalty [].
    !> Whether that is a bound, not an extrapolated distance (`estimate_penalty_error`).
    logical :: penalty_is_bound = .true.
    real(dp) :: discretization = 0  !! Error of the mesh [].
    !> Work of the pressures on the remaining gaps under them, as the root of twice an energy: no part of the others [].
    real(dp) :: contact = 0
    real(dp) :: norm = 0  !! Energy norm ||u||_A of the solution [sqrt(energy)].
    !> Error of the mesh of each body; not allocated where nobody asked (n_bodies) []. Squares add up.
    real(dp), allocatable :: of_body(:)
    type(element_field_t), allocatable :: of_element(:)  !! That of each element of each body, likewise (n_bodies) [].
  contains
    procedure :: init => budget_init
  end type error_budget_t

contains

  !> Nothing is known.
  subroutine budget_init(self)
    class(error_budget_t), intent(out) :: self
    self%penalty = ieee_value(self%penalty, ieee_quiet_nan)
    self%discretization = self%penalty
    self%contact = self%penalty
    self%norm = self%penalty
  end subroutine budget_init

  !> Estimate the errors of a solution.
  subroutine estimate_errors(problem, qp, compliance, linear_solver, scheme, want_mesh, want_penalty, displacements, &
                             kept, state, budget, error)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    !> Its compliance operator; entries that the dual scheme forms stay there.
    class(compliance_t), intent(inout) :: compliance
    integer, intent(in) :: linear_solver  !! One of `linear_solver_*` of dotyk_base_options, for the dual scheme.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the state.
    logical, intent(in) :: want_mesh  !! Whether the error of the mesh is estimated.
    logical, intent(in) :: want_penalty  !! Whether the error of the penalty is estimated.
    !> Known where the error of the mesh is wanted; its squared errors are not, on return.
    type(displacements_t), intent(inout) :: displacements
    type(kept_estimates_t), intent(inout) :: kept  !! What the estimates keep.
    type(solver_state_t), intent(inout) :: state  !! The end of its history gets the errors.
    type(error_budget_t), intent(out) :: budget  !! Parts that were not asked for, or are not known, are NaN.
    !> Allocated where a formula of a material cannot be evaluated, or the compliance of an active set is not positive
    !> definite.
    type(error_t), allocatable, intent(out) :: error
    type(penalty_reference_t) :: reference
    real(dp) :: distance
    call budget%init()
    budget%norm = state%norm(qp)
    if (want_mesh) then
      call estimate_mesh_error(problem, displacements, qp%pair_first_row, state%pressure, qp%theta, kept, budget, error)
      if (allocated(error)) return
      if (.not. is_near(state)) call forget_mesh_error(budget)
    end if
    ! The error of the penalty takes another solution.
    if (want_penalty .and. .not. budget%norm > 0) then
      budget%penalty = 0
    else if (want_penalty .and. is_near(state) .and. all(state%ended /= [ended_interrupted, ended_time])) then
      call reference%init(problem, qp%pair_first_row, qp%theta)
      call estimate_penalty_error(qp, compliance, reference, linear_solver, scheme, state, distance, error)
      if (allocated(error)) return
      budget%penalty_is_bound = reference%is_exact()
      budget%penalty = distance/budget%norm
      if (interrupted()) budget%penalty = ieee_value(budget%penalty, ieee_quiet_nan)
    end if
    associate (history => state%history)
      if (history%n == 0) return
      history%error_penalty(history%n) = budget%penalty
      history%error_discretization(history%n) = budget%discretization
    end associate
  end subroutine estimate_errors

  !> Whether the iteration came near enough to its end for the other errors to be meaningful.
  pure logical function is_near(state)
    type(solver_state_t), intent(in) :: state  !! Where the scheme ended.
    is_near = size(state%pressure) == 0
    if (.not. (is_near .or. ieee_is_nan(state%error_bound))) is_near = state%error_bound < near_enough
  end function is_near

  !> The error of the mesh is not known.
  subroutine forget_mesh_error(budget)
    type(error_budget_t), intent(inout) :: budget  !! With parts of the mesh; NaN on return.
    real(dp) :: nan
    integer :: b
    nan = ieee_value(nan, ieee_quiet_nan)
    budget%discretization = nan
    budget%contact = nan
    budget%of_body = nan
    do b = 1, size(budget%of_element)
      if (allocated(budget%of_element(b)%value)) budget%of_element(b)%value = nan
    end do
  end subroutine forget_mesh_error

  !> The error of the mesh.
  subroutine estimate_mesh_error(problem, displacements, first_row, pressure, theta, kept, budget, error)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(displacements_t), intent(inout) :: displacements  !! As in `estimate_errors`.
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    type(kept_estimates_t), intent(inout) :: kept  !! What the estimates keep.
    type(error_budget_t), intent(inout) :: budget  !! Gets discretization, contact and norm.
    type(error_t), allocatable, intent(out) :: error  !! As in `estimate_errors`.
    type(displacements_t) :: block(1)
    real(dp) :: norm_square, work
    integer :: b, i, k
    if (allocated(budget%of_body)) deallocate (budget%of_body, budget%of_element)
    allocate (budget%of_body(size(problem%body)))
    if (.not. allocated(displacements%square)) then
      block(1)%pressure = pressure
      call move_alloc(displacements%body, block(1)%body)
      call estimate_mesh_errors(problem, first_row, kept, block, error)
      call move_alloc(block(1)%body, displacements%body)
      if (allocated(error)) return
      call move_alloc(block(1)%square, displacements%square)
      displacements%norm_square = block(1)%norm_square
    end if
    call move_alloc(displacements%square, budget%of_element)
    ! Without strain, what the mesh leaves of motions is rounding.
    norm_square = 0
    if (budget%norm > 0) norm_square = displacements%norm_square
    work = 0
    do k = 1, size(problem%pair)
      associate (pair => problem%pair(k), surface_a => problem%surface_a(k), surface_b => problem%surface_b(k), &
                 rows => [(i, i=first_row(k), first_row(k + 1) - 1)])
        associate (u_a => displacements%body(pair%body_a)%displacement, &
                   u_b => displacements%body(pair%body_b)%displacement)
          work = work + complementarity_error(pair, surface_a, surface_b, u_a, u_b, pressure(rows), theta(rows))
        end associate
      end associate
    end do
    budget%contact = 0
    if (norm_square > 0) budget%contact = sqrt(2*work/norm_square)
    budget%norm = sqrt(norm_square)
    budget%of_body = 0
    do b = 1, size(problem%body)
      if (.not. problem%ranks%is_own(b)) cycle
      if (norm_square > 0) then
        budget%of_element(b)%value = sqrt(budget%of_element(b)%value/norm_square)
      else
        budget%of_element(b)%value = 0
      end if
      budget%of_body(b) = norm2(budget%of_element(b)%value)
    end do
    call problem%ranks%share_norm(budget%of_body)
    budget%discretization = norm2(budget%of_body)
  end subroutine estimate_mesh_error

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
end module dotyk_control_error_budget
