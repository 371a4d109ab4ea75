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
!> its multipliers are indeterminate, and finding them costs far more than the solution. There the reference has a
!> quarter of theta, or of h/E where that is less, and the distance is extrapolated by the first order of Theorem
!> 1, `u_theta - u_0 = O(theta)`: an estimate, not a bound, of two linear systems.
module dotyk_control_penalty_error
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: discretization_quadrature, linear_solver_direct, linear_solver_iterative
  use dotyk_control_contact_problem, only: contact_problem_t, mesh_compliance
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_linear_solver_choice, only: choose_solver
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_restriction, only: restrict_qp
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_limit, ended_stalled
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  !> The model that a solution with penalty is compared with.
  type, public :: penalty_reference_t
    !> Its penalty parameters (n_rows) [length/pressure].
    real(dp), allocatable :: theta(:)
    !> The penalty error over the distance to its solution, to first order in theta; 1 where the distance is the error
    !> itself [].
    real(dp) :: extrapolation = 1
  contains
    procedure :: init => reference_init
    procedure :: is_exact => reference_is_exact
  end type penalty_reference_t

  public :: estimate_penalty_error

  !> theta of the reference where theta = 0 is over-constrained, over that of the solution, and over h/E, at most [].
  real(dp), parameter :: reduced = 0.25_dp, most_of_mesh = 0.25_dp
contains

  !> The reference of the pairs: the theta of layers stays, that of penalties vanishes, or is reduced where one of them
  !> is at quadrature points.
  subroutine reference_init(self, problem, first_row, theta)
    class(penalty_reference_t), intent(out) :: self
    !> Bodies and pairs.
    type(contact_problem_t), intent(in) :: problem
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> Penalty parameters of the solution (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    real(dp) :: least, most
    integer :: k
    logical :: vanishes
    vanishes = .true.
    do k = 1, size(problem%pair)
      if (problem%pair(k)%discretization /= discretization_quadrature .or. problem%pair(k)%is_layer) cycle
      if (any(theta(first_row(k):first_row(k + 1) - 1) > 0)) vanishes = .false.
    end do
    least = 1
    self%theta = 0*theta
    do k = 1, size(problem%pair)
      associate (pair => problem%pair(k), first => first_row(k), last => first_row(k + 1) - 1)
        if (pair%is_layer) self%theta(first:last) = theta(first:last)
        if (pair%is_layer .or. vanishes) cycle
        most = most_of_mesh*mesh_compliance(problem%body(pair%body_a), problem%body(pair%body_b), pair)
        self%theta(first:last) = min(reduced*theta(first:last), most)
        least = min(least, minval(1 - self%theta(first:last)/theta(first:last), mask=theta(first:last) > 0))
      end associate
    end do
    self%extrapolation = 1/least
  end subroutine reference_init

  !> Whether the distance to its solution is the penalty error: a bound with the bounds of both solutions.
  pure logical function reference_is_exact(self) result(is_exact)
    class(penalty_reference_t), intent(in) :: self
    is_exact = .not. self%extrapolation > 1
  end function reference_is_exact

  !> Estimate from the state where a scheme ended.
  subroutine estimate_penalty_error(qp, compliance, theta, reference, linear_solver, is_exact, state, distance, error)
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Its compliance operator; entries that the dual scheme forms stay there.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters of the state (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The model without penalty.
    type(penalty_reference_t), intent(in) :: reference
    !> One of `linear_solver_*` of dotyk_base_options, for the dual scheme.
    integer, intent(in) :: linear_solver
    !> Whether the state is that of the dual scheme; that of another one is solved to the end first.
    logical, intent(in) :: is_exact
    !> Where the scheme ended; used as a start.
    type(solver_state_t), intent(in) :: state
    !> ||u_theta - u_0||_A; NaN where the reference has no solution, or none that was found [sqrt(energy)].
    real(dp), intent(out) :: distance
    !> As in `dual_t`, from the solution with theta or the reference: the compliance of an active set is not positive
    !> definite.
    type(error_t), allocatable, intent(out) :: error
    type(dual_t) :: dual
    type(solver_settings_t) :: settings
    type(solver_state_t) :: penalized, exact
    type(monitor_t) :: silent
    real(dp) :: of_both
    distance = 0
    if (.not. any(theta > reference%theta)) return
    settings%linear_solver = linear_solver
    penalized = state
    if (.not. is_exact) call dual%solve(qp, compliance, theta, settings, silent, penalized, error)
    if (allocated(error)) return
    exact = penalized
    if (reference%is_exact()) then
      call dual%solve(qp, compliance, reference%theta, settings, silent, exact, error)
    else if (is_usable(penalized)) then
      call follow_theta(qp, compliance, reference%theta, exact)
    end if
    if (allocated(error)) return
    if (.not. (is_usable(penalized) .and. is_usable(exact))) then
      distance = ieee_value(distance, ieee_quiet_nan)
      return
    end if
    of_both = uncertainty(qp, penalized)
    if (reference%is_exact()) of_both = uncertainty(qp, exact) + of_both
    distance = compliance%distance(qp, penalized%m - exact%m, penalized%alpha - exact%alpha)
    distance = reference%extrapolation*(distance + of_both)
  end subroutine estimate_penalty_error

  !> Guaranteed bound of the error of a state [sqrt(energy)].
  real(dp) function uncertainty(qp, state)
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Where a scheme ended.
    type(solver_state_t), intent(in) :: state
    uncertainty = state%error_bound*qp%energy_norm(state%m, state%y, state%alpha/qp%coarse%scale)
  end function uncertainty

  !> The solution with a smaller theta, from that of the dual scheme: two linear systems at most, the second without the
  !> forces that are tensile in the first. Contact zones shrink with theta, so that no other rows are looked at.
  subroutine follow_theta(qp, compliance, theta, state)
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Its compliance operator.
    class(compliance_t), intent(inout) :: compliance
    !> The smaller penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Solution of the dual scheme; its pressures and modes are those of the smaller theta on return. Not usable where
    !> there are none.
    type(solver_state_t), intent(inout) :: state
    class(active_system_t), allocatable :: system
    type(contact_qp_t) :: part
    type(error_t), allocatable :: error
    real(dp), allocatable :: lambda(:), alpha(:), forces(:)
    logical, allocatable :: active(:)
    integer :: k
    if (.not. any(state%m > 0)) return
    associate (working => state%m > 0)
      call restrict_qp(qp, working, part)
      ! As the dual scheme did it.
      call choose_solver(part, compliance, merge(linear_solver_direct, linear_solver_iterative, &
                                                 compliance%has_entries()), [(.true., k=1, part%n_rows)], system)
      if (system%needs_entries()) call compliance%form(part, may_stop=.false.)
      lambda = part%weight*pack(state%m, working)
      alpha = state%alpha/qp%coarse%scale
      do k = 1, 2
        active = lambda > 0
        call system%init(part, compliance, pack(theta, working), active, error)
        if (allocated(error)) exit
        forces = lambda(system%row)
        call system%solve(part, compliance, part%initial_penetration(system%row), part%coarse%resultant, forces, alpha)
        lambda = 0
        lambda(system%row) = forces
        if (all(lambda > 0 .or. .not. active) .or. .not. any(lambda > 0)) exit
      end do
      call system%destroy()
      state%m = unpack(max(0.0_dp, lambda)/part%weight, working, 0*state%m)
      state%alpha = qp%coarse%scale*alpha
    end associate
    ! NaN is not below infinity.
    if (allocated(error) .or. .not. all(state%m <= huge(1.0_dp))) state%ended = ended_limit
  end subroutine follow_theta

  !> Whether a scheme found a solution.
  pure logical function is_usable(state)
    !> Where a scheme ended.
    type(solver_state_t), intent(in) :: state
    is_usable = any(state%ended == [ended_converged, ended_stalled]) .and. allocated(state%m) .and. &
                .not. ieee_is_nan(state%error_bound)
  end function is_usable
end module dotyk_control_penalty_error
