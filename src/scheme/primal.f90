!> The primal scheme: the displacements as unknowns, by a proximal active set (`dotyk_scheme_proximal_active_set`), for
!> bodies whose compliance operators are p-multigrids (`dotyk_response_multigrid_response`). Any theta >= 0, held and
!> floating bodies.
!>
!> Unknown is v = u - u_0, the displacement by contact forces and rigid body motions: `K v = R e - B^T lambda` with e
!> the resultants of the loads on the rigid body modes R, and `B v <= -y_0`. As in the dual scheme, rows that stay
!> inactive on a Winkler foundation are screened, and join the working set where the displacement violates them. The
!> start is the contact of the bodies in their corner spaces (`dotyk_scheme_corner_contact`).
!>
!> It ends by the bound of `dotyk_scheme_primal_system`. Other operators, and near-null-space modes, which have a
!> stiffness, are left to the dual scheme, and so are bodies with modes that are held.
module dotyk_scheme_primal
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_timer, only: wall_time
  use dotyk_scheme_active_set, only: iterate_t, is_balanced, reference_norm, rounding
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_equilibrium_check, only: check_equilibrium, clear
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_primal_modes, only: balance, find_indeterminate, rank, take_least
  use dotyk_scheme_primal_rows, only: proximal_outcome_t, solve_rows, start_in_corners
  use dotyk_scheme_primal_system, only: primal_system_t
  use dotyk_scheme_restriction, only: restrict_qp
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_interrupted, ended_limit, &
    ended_no_equilibrium, ended_rigid_constraint, ended_solves, ended_stalled, ended_unbalanced
  use dotyk_scheme_stopping, only: solver_settings_t
  use dotyk_scheme_working_set, only: keep_what_carries, screen_rows
  implicit none
  private

  !> The scheme.
  type, extends(scheme_t), public :: primal_t
  contains
    procedure :: solve => primal_solve
    procedure :: needs_held_bodies => primal_needs_held_bodies
    procedure :: allows_zero_theta => primal_allows_zero_theta
    procedure :: expected_products => primal_expected_products
    procedure :: suits => primal_suits
    procedure :: finds_displacements => primal_finds_displacements
  end type primal_t

  !> How often violated rows enter the working set; then all rows do.
  integer, parameter :: most_rounds = 6
  !> How often a bound above the tolerance is followed by a more accurate solution.
  integer, parameter :: most_attempts = 5
  !> Active sets at most: where it converges, it takes a third of them.
  integer, parameter :: most_sets = 100
  !> Rows enter the working set with the violated ones whose gaps are smaller than this multiple of the largest
  !> violation.
  real(dp), parameter :: near_violation = 4
  !> Accuracy of the displacements that is asked for first, as a fraction of the tolerance; factor of the next one [].
  real(dp), parameter :: first_share = 0.2_dp, next_share = 0.05_dp
  !> Accuracy that is asked for at least: forces of floating bodies balance their loads then [].
  real(dp), parameter :: least_accuracy = 1.0e-4_dp
  !> A more accurate solution whose bound is not below this fraction of the last one ends the attempts [].
  real(dp), parameter :: least_gain = 0.5_dp
  !> Errors of the dual scheme by errors of its solves: those of several solves add up [].
  real(dp), parameter :: safety = 100
  !> Bounds beyond this many times the norm are none: squares of larger numbers overflow.
  real(dp), parameter :: largest_bound = 1.0e150_dp
  !> Working sets of more than this fraction of the rows become all rows.
  real(dp), parameter :: not_worth_screening = 0.8_dp

contains

  !> Floating bodies are allowed.
  pure logical function primal_needs_held_bodies(self) result(needed)
    class(primal_t), intent(in) :: self
    needed = .false.
    associate (not_needed => same_type_as(self, self))
    end associate
  end function primal_needs_held_bodies

  !> Contact without penetration is allowed.
  pure logical function primal_allows_zero_theta(self) result(allowed)
    class(primal_t), intent(in) :: self
    allowed = .true.
    associate (not_needed => same_type_as(self, self))
    end associate
  end function primal_allows_zero_theta

  !> It takes no products.
  pure integer function primal_expected_products(self) result(n)
    class(primal_t), intent(in) :: self
    n = 0
    associate (not_needed => same_type_as(self, self))
    end associate
  end function primal_expected_products

  !> Whether all bodies are p-multigrids, or join them with their factors, and their modes are their rigid body modes,
  !> none held and none with a stiffness. Supports that press rows together are found by the dual scheme.
  logical function primal_suits(self, qp, compliance, theta) result(suits)
    class(primal_t), intent(in) :: self
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(in) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    logical :: is_rigid(qp%n_rows)
    associate (not_needed => same_type_as(self, self))
    end associate
    suits = qp%n_rows == 0
    if (allocated(qp%coarse%stiffness) .or. suits) return
    select type (compliance)
    class is (body_compliance_t)
      if (.not. compliance%has_grids()) return
      call find_rigid_rows(qp, compliance, is_rigid)
      suits = .not. any(is_rigid .and. .not. theta > 0 .and. qp%initial_penetration > 0)
    end select
  end function primal_suits

  !> Where it suits and there are rows.
  logical function primal_finds_displacements(self, qp, compliance, theta) result(finds)
    class(primal_t), intent(in) :: self
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(in) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    finds = self%suits(qp, compliance, theta) .and. qp%n_rows > 0
  end function primal_finds_displacements

  !> Solve.
  subroutine primal_solve(self, qp, compliance, theta, settings, monitor, state, error)
    class(primal_t), intent(in) :: self
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters, at least 0 (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> Where to begin if it has pressures; without pressures on return where the scheme ended before the first step.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where numbers are not finite, or an interrupt came before there was a state.
    type(error_t), allocatable, intent(out) :: error
    type(dual_t) :: dual
    logical :: is_primal
    is_primal = self%finds_displacements(qp, compliance, theta)
    select type (compliance)
    class is (body_compliance_t)
      call compliance%forget_displacements()
      if (is_primal) call solve_by_displacements(qp, compliance, theta, settings, monitor, state, error)
    end select
    if (is_primal) return
    call dual%solve(qp, compliance, theta, settings, monitor, state, error)
    select type (compliance)
    class is (body_compliance_t)
      if (.not. compliance%solve_error() > 0 .or. .not. state%error_bound < huge(1.0_dp)) return
      ! Its bound is that of exact solves.
      state%bound_is_guaranteed = .false.
      state%error_bound = state%error_bound + safety*compliance%solve_error()
      if (state%ended == ended_converged .and. state%error_bound > settings%tolerance) state%ended = ended_solves
    end select
  end subroutine primal_solve

  !> Rows whose nodes are held, all but for rounding.
  subroutine find_rigid_rows(qp, compliance, is_rigid)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(body_compliance_t), intent(in) :: compliance
    !> (n_rows)
    logical, intent(out) :: is_rigid(:)
    real(dp) :: diagonal(qp%n_rows)
    call compliance%nodal_diagonal(qp, diagonal)
    ! Entries of B at free nodes may be rounding.
    is_rigid = .not. diagonal > rank**2*maxval([0.0_dp, diagonal])
  end subroutine find_rigid_rows

  !> Solve by displacements.
  subroutine solve_by_displacements(qp, compliance, theta, settings, monitor, state, error)
    !> As in `primal_solve`.
    type(contact_qp_t), intent(in) :: qp
    !> By p-multigrids.
    class(body_compliance_t), intent(inout) :: compliance
    !> As in `primal_solve` (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> As in `primal_solve`.
    type(solver_settings_t), intent(in) :: settings
    !> As in `primal_solve`.
    class(monitor_t), intent(inout) :: monitor
    !> As in `primal_solve`.
    type(solver_state_t), intent(inout) :: state
    !> As in `primal_solve`.
    type(error_t), allocatable, intent(out) :: error
    type(primal_system_t) :: system
    type(contact_qp_t) :: part
    type(proximal_outcome_t) :: outcome
    type(iterate_t) :: now
    real(dp), allocatable :: v(:), load(:), m(:)
    real(dp), allocatable :: indeterminate(:, :)
    logical, allocatable :: working(:), violated(:)
    real(dp) :: accuracy, start, last, of_isolated
    integer :: round, attempt, steps, cg_steps
    ! Rows that no displacement moves are in no system.
    logical :: warm, is_rigid(qp%n_rows)
    start = wall_time()
    call find_rigid_rows(qp, compliance, is_rigid)
    warm = allocated(state%m)
    if (state%history%n == 0) then
      call check_equilibrium(qp, state)
      if (state%ended == ended_no_equilibrium) return
    end if
    allocate (m(qp%n_rows), source=0.0_dp)
    if (warm) then
      m(:) = state%m
      working = m > 0
      if (allocated(state%y)) working = working .or. state%y > -near_violation*maxval([0.0_dp, state%y])
    else
      call screen_rows(qp, theta, working)
    end if
    call clear(state)
    steps = 0
    cg_steps = 0
    accuracy = min(first_share*settings%tolerance, least_accuracy)
    rounds: do round = 1, most_rounds
      if (.not. all(working .or. is_rigid) .and. qp%coarse%n > 0) call keep_what_carries(qp, working)
      if (round == most_rounds .or. count(working) > not_worth_screening*qp%n_rows) working = .true.
      working = working .and. .not. is_rigid
      call restrict_qp(qp, working, part)
      call system%init_rows(part, compliance)
      if (.not. allocated(v)) then
        allocate (v(system%n), load(system%n), source=0.0_dp)
        call system%load_by_contact(qp, compliance, load)
        of_isolated = system%error_of_isolated(compliance)
        if (.not. warm) call start_in_corners(part, pack(theta, working), load, working, system, m, v)
      end if
      last = huge(last)
      do attempt = 1, most_attempts
        call solve_rows(system, part, pack(theta, working), load, working, accuracy, &
                        min(most_sets, settings%max_iterations) - steps, m, v, outcome, error)
        state%ended = outcome%ended
        if (allocated(error) .or. outcome%ended == ended_rigid_constraint) then
          call system%destroy()
          return
        end if
        steps = steps + outcome%steps
        cg_steps = cg_steps + outcome%cg_steps
        if (outcome%ended == ended_no_equilibrium .and. .not. all(working .or. is_rigid)) then
          ! Rows that stop the bodies may have been screened.
          working = .true.
          cycle rounds
        end if
        call balance(qp, m)
        now%lambda = qp%weight*m
        call system%amplitudes(qp, v, now%alpha)
        call system%all_penetrations(qp, compliance, v, now%y)
        violated = .not. (working .or. is_rigid) .and. now%y > rounding*maxval(abs(qp%initial_penetration)) - &
          system%slack(qp%weight, theta, now%lambda, now%y)
        call judge(qp, system, theta, load, working, any(violated), of_isolated, v, now, state)
        call state%history%add(wall_time() - start, outcome%change, &
                               outcome%change/max(tiny(start), reference_norm(qp, theta, now)), state%error_bound, &
                               state%energy, state%max_penetration, count(m > 0))
        ! Errors that no longer fall at one accuracy may do so at a smaller one.
        if (interrupted() .or. .not. (outcome%converged .or. outcome%ended == ended_stalled)) exit rounds
        if (any(violated)) exit
        if (state%error_bound <= settings%tolerance) exit rounds
        if (last < huge(last) .and. .not. state%error_bound < least_gain*last) exit rounds
        if (steps >= min(most_sets, settings%max_iterations)) exit rounds
        last = state%error_bound
        accuracy = next_share*accuracy
        call monitor%step(state%history, settings%tolerance, state%error_bound)
      end do
      if (.not. any(violated)) exit rounds
      working = working .or. now%y > -near_violation*maxval(now%y, mask=violated)
    end do rounds
    call find_indeterminate(qp, now%lambda > 0, indeterminate, error)
    if (.not. allocated(error)) then
      call take_least(qp, now%lambda > 0, indeterminate, now%alpha, now%y)
      call state%indeterminate%take_dense(indeterminate)
    end if
    call system%keep_displacements(v, compliance)
    call system%destroy()
    compliance%n_sweeps = compliance%n_sweeps + cg_steps
    state%screened = count(.not. working)
    call monitor%note('displacements    '//to_text(steps)//' active sets, '//to_text(cg_steps)// &
                      ' iterations of conjugate gradients with p-multigrid')
    call state%history%finish()
    state%iterations = state%history%n
    state%m = now%lambda/qp%weight
    where (is_rigid .and. theta > 0) state%m = max(0.0_dp, now%y)/theta
    state%y = now%y
    state%alpha = qp%coarse%scale*now%alpha
    state%bound_is_guaranteed = .false.
    state%ended = ended_solves
    if (.not. (outcome%converged .or. outcome%ended == ended_stalled)) state%ended = outcome%ended
    if (any(violated) .or. state%ended == ended_limit) &
      state%ended = merge(ended_limit, ended_solves, steps >= settings%max_iterations)
    if (.not. is_balanced(qp, theta, now%lambda, now%alpha)) state%ended = ended_unbalanced
    if (interrupted()) state%ended = ended_interrupted
    if (state%error_bound <= settings%tolerance) state%ended = ended_converged
  end subroutine solve_by_displacements

  !> Bound, energy and penetration of an iterate.
  subroutine judge(qp, system, theta, load, working, is_violated, of_isolated, v, now, state)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> The bodies and rows of the working set.
    type(primal_system_t), intent(inout) :: system
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Loads that u_0 does not balance (system%n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Working set (n_rows).
    logical, intent(in) :: working(:)
    !> Whether rows outside of it penetrate: there is no bound then.
    logical, intent(in) :: is_violated
    !> Error of bodies that touch no other [sqrt(energy)].
    real(dp), intent(in) :: of_isolated
    !> Displacements by contact (system%n) [length].
    real(dp), intent(in), contiguous :: v(:)
    !> Forces, penetrations and amplitudes.
    type(iterate_t), intent(in) :: now
    !> Gets bound, energy and penetration.
    type(solver_state_t), intent(inout) :: state
    real(dp) :: norm, bound
    norm = reference_norm(qp, theta, now)
    state%error_bound = huge(norm)
    if (.not. is_violated .and. is_balanced(qp, theta, now%lambda, now%alpha)) then
      bound = system%bound(pack(qp%weight, working), pack(theta, working), load, v, &
                           pack(now%lambda, working), pack(now%y, working))
      bound = hypot(bound, of_isolated)
      if (bound <= largest_bound*max(norm, tiny(norm))) state%error_bound = bound/max(norm, tiny(norm))
      if (bound <= 0) state%error_bound = 0
    end if
    state%energy = qp%energy(theta, now%lambda/qp%weight, now%y, now%alpha)
    state%max_penetration = max(0.0_dp, maxval(now%y))
  end subroutine judge
end module dotyk_scheme_primal
