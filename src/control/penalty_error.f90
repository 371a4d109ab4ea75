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
!> its multipliers are indeterminate, and finding them costs far more than the solution. There the distance is
!> extrapolated: an estimate, not a bound. Theorem 1 names no order. The first order in theta holds for smooth pressures
!> on a contact zone that stays; the order is about 0.8 at a sharp punch, and only 1/2 is guaranteed (docs/theory.md,
!> section 1). So it is measured, by two references: theta_1 has a quarter of theta, or of h/E where that is less, and
!> theta_2 has a quarter of theta_1. With further quarters, the distances are a geometric series,
!>
!>     ||u_theta - u_0||_A ~ d_1 + d_2/(1 - rho),  d_1 = ||u_theta - u_theta_1||_A,  d_2 = ||u_theta_1 - u_theta_2||_A,
!>
!> where d_2/d_1 has the order from theta to theta_2, within 1/2 and 1, and rho the mean of that and 1: on a mesh, the
!> order rises to 1 as theta falls, and the norm of a sum is less than the sum of the norms. Where theta_1 is far below
!> theta, d_1 is nearly all of it, and the mean of 1/2 and 1 is assumed.
module dotyk_control_penalty_error
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_quadrature, linear_solver_direct, linear_solver_iterative
  use dotyk_control_contact_problem, only: contact_problem_t, mesh_compliance
  use dotyk_scheme_active_set, only: foundation_stiffness
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_linear_solver_choice, only: choose_coupling
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_proximal_motion, only: proximal_motion_t
  use dotyk_scheme_restriction, only: restrict_qp
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_limit, ended_solves, ended_stalled
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
  real(dp), parameter :: accuracy = 1.0e-3_dp  !! Residual of the gaps of a reference over that at its start [].
  !> Bounds from which a solution is too far from its end for more accurate ones to follow it [].
  real(dp), parameter, public :: near_enough = 0.5_dp
  integer, parameter :: most_systems = 4  !! Linear systems of a reference at most.

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
    else if (reference%is_exact()) then
      exact = penalized
      without = qp
      call without%replace_theta(reference%theta)
      call solver%solve(without, compliance, settings, silent, exact, error)
      if (allocated(error)) return
      distance = distance_of(qp, compliance, penalized, exact)
      ! A scheme without a solution leaves no state to measure.
      if (.not. ieee_is_nan(distance)) distance = distance + uncertainty(qp, penalized) + uncertainty(qp, exact)
    else
      call extrapolate(qp, compliance, reference, solver, settings, penalized, distance, error)
    end if
  end subroutine estimate_penalty_error

  !> The distance to theta = 0 from those of two references.
  subroutine extrapolate(qp, compliance, reference, solver, settings, penalized, distance, error)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    class(compliance_t), intent(inout) :: compliance  !! Its compliance operator.
    type(penalty_reference_t), intent(in) :: reference  !! The first reference.
    class(scheme_t), intent(in) :: solver  !! Scheme that found the solution.
    type(solver_settings_t), intent(in) :: settings  !! For it.
    type(solver_state_t), intent(in) :: penalized  !! The solution.
    real(dp), intent(out) :: distance  !! The estimate; NaN where a reference has no solution [sqrt(energy)].
    type(error_t), allocatable, intent(out) :: error  !! As in `estimate_penalty_error`.
    type(contact_qp_t) :: smaller
    type(solver_state_t) :: first, second
    real(dp) :: d_1, d_2, rounding
    rounding = uncertainty(qp, penalized)
    first = penalized
    smaller = qp
    call smaller%replace_theta(reference%theta)
    call follow_theta(smaller, compliance, accuracy, solver, settings, first, error)
    if (allocated(error)) return
    rounding = max(rounding, uncertainty(qp, first))
    d_1 = distance_of(qp, compliance, penalized, first)
    if (reference%reduction <= reduced**2) then
      ! d_1 is nearly all of the distance: the order, between 1/2 and 1, is not measured. The solution with such a large
      ! theta takes few steps.
      distance = (d_1 + rounding)/(1 - sqrt(reference%reduction*sqrt(reference%reduction)))
      return
    end if
    second = first
    ! Its share of the distance falls with theta_1.
    if (is_usable(first)) then
      call smaller%replace_theta(merge(reduced, 1.0_dp, reference%theta < qp%theta)*reference%theta)
      call follow_theta(smaller, compliance, accuracy*reduced/reference%reduction, solver, settings, second, error)
    end if
    if (allocated(error)) return
    d_2 = distance_of(qp, compliance, first, second)
    distance = d_1 + rounding + d_2/(1 - ratio_of(d_1, d_2, rounding, reference%reduction))
  end subroutine extrapolate

  !> Distance of the next two references over d_2: that of distances like `theta^p`, p from 1/2 to 1, is found from d_2
  !> and d_1, and p goes half the way to 1 then.
  pure real(dp) function ratio_of(d_1, d_2, rounding, reduction) result(ratio)
    !> Distance of the solution to the first reference, and of both references [sqrt(energy)].
    real(dp), intent(in) :: d_1, d_2
    real(dp), intent(in) :: rounding  !! Uncertainty of the distances [sqrt(energy)].
    real(dp), intent(in) :: reduction  !! theta of the first reference over that of the solution [].
    integer, parameter :: halvings = 20  !! Halvings of the interval of ratios: to 1e-6 of it.
    real(dp) :: low, high, quarters
    integer :: k
    ! Of order 1 in theta, and of order 1/2, which is guaranteed.
    low = reduced
    high = sqrt(reduced)
    ratio = high
    if (.not. d_2 > rounding) return
    ! Steps of `reduced` from the solution to the first reference.
    quarters = log(reduction)/log(reduced)
    do k = 1, halvings
      ratio = (low + high)/2
      ! The left side is d_2 for the ratio and d_1, and increases with the ratio.
      if (d_1*ratio**quarters*(1 - ratio) < d_2*(1 - ratio**quarters)) then
        low = ratio
      else
        high = ratio
      end if
    end do
    ratio = sqrt(high*reduced)
  end function ratio_of

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
    uncertainty = state%error_bound*qp%energy_norm(state%pressure, state%penetration, state%alpha/qp%coarse%scale)
  end function uncertainty

  !> The solution with a smaller theta, from that with a larger one: by the scheme where it finds displacements, else a
  !> few linear systems, each without the forces that are tensile in the one before. Contact zones shrink with theta, so
  !> that no other rows are looked at.
  subroutine follow_theta(qp, compliance, reduction, solver, settings, state, error)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme, with the smaller penalty parameters.
    class(compliance_t), intent(inout) :: compliance  !! Its compliance operator.
    real(dp), intent(in) :: reduction  !! As in `active_system_t` [].
    class(scheme_t), intent(in) :: solver  !! Scheme that found the solution with the larger theta.
    type(solver_settings_t), intent(in) :: settings  !! For it.
    !> Solution with the larger theta; its pressures and modes are those of the smaller theta on return. Not usable
    !> where there are none.
    type(solver_state_t), intent(inout) :: state
    type(error_t), allocatable, intent(out) :: error  !! As in `estimate_penalty_error`.
    type(monitor_t) :: silent
    if (.not. any(state%pressure > 0)) return
    if (solver%finds_displacements(qp, compliance)) then
      call solver%solve(qp, compliance, settings, silent, state, error)
    else
      call drop_tensile_forces(qp, compliance, reduction, state)
    end if
  end subroutine follow_theta

  !> The same by a few linear systems.
  subroutine drop_tensile_forces(qp, compliance, reduction, state)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme, with the smaller penalty parameters.
    class(compliance_t), intent(inout) :: compliance  !! Its compliance operator.
    real(dp), intent(in) :: reduction  !! As in `active_system_t` [].
    type(solver_state_t), intent(inout) :: state  !! As in `follow_theta`.
    type(active_system_t) :: system
    type(contact_qp_t) :: part, with_springs
    type(proximal_motion_t) :: motion
    type(error_t), allocatable :: error
    real(dp), allocatable :: lambda(:), alpha(:), forces(:)
    logical, allocatable :: active(:)
    integer :: k
    associate (working => state%pressure > 0)
      call restrict_qp(qp, working, part)
      ! As the dual scheme did it.
      call choose_coupling(part, compliance, merge(linear_solver_direct, linear_solver_iterative, &
                                                   compliance%has_entries()), [(.true., k=1, part%n_rows)], system)
      system%reduction = reduction
      if (system%needs_entries()) call compliance%form(part, may_stop=.false.)
      lambda = part%weight*pack(state%pressure, working)
      alpha = state%alpha/qp%coarse%scale
      ! Along motions that contact does not determine the bodies stay where they are.
      call motion%init(part, foundation_stiffness(part), lambda > 0, alpha)
      with_springs = part
      call motion%apply(part, with_springs)
      do k = 1, most_systems
        active = lambda > 0
        call system%init(with_springs, compliance, active, error)
        if (allocated(error)) exit
        forces = lambda(system%row)
        call system%solve(with_springs, compliance, part%initial_penetration(system%row), &
                          with_springs%coarse%resultant, forces, alpha)
        lambda = 0
        lambda(system%row) = forces
        if (all(lambda > 0 .or. .not. active) .or. .not. any(lambda > 0)) exit
      end do
      call system%destroy()
      state%pressure = unpack(max(0.0_dp, lambda)/part%weight, working, 0*state%pressure)
      state%alpha = qp%coarse%scale*alpha
    end associate
    ! NaN is not below infinity.
    if (allocated(error) .or. .not. all(state%pressure <= huge(1.0_dp))) state%ended = ended_limit
  end subroutine drop_tensile_forces

  !> Whether a scheme found a solution.
  pure logical function is_usable(state)
    type(solver_state_t), intent(in) :: state  !! Where a scheme ended.
    is_usable = any(state%ended == [ended_converged, ended_stalled, ended_solves]) .and. &
      allocated(state%pressure) .and. &
                .not. ieee_is_nan(state%error_bound)
  end function is_usable
end module dotyk_control_penalty_error
