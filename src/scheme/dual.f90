!> The dual scheme: Lagrange multipliers lambda = W p >= 0 as unknowns, any theta >= 0, held and floating bodies.
!>
!> It minimises `lambda^T (C + Theta W^{-1}) lambda/2 - lambda^T y_0` over `lambda >= 0` with `G^T lambda = e`, the
!> equilibrium of the floating bodies, by a primal-dual active set iteration (`dotyk_scheme_active_set`) that begins
!> with rigid bodies at rest on a Winkler foundation (`dotyk_scheme_winkler_start`). With theta = 0 the solution is that
!> of the variational inequality, equations (17), (24).
!>
!> Rows that would stay inactive if the bodies were rigid on a Winkler foundation are screened: they are not in the
!> working set. At the end the displacement tells which of them are violated; these are added to the working set, and
!> the problem is solved again. Rows of ties are in every set, with forces of any sign.
module dotyk_scheme_dual
  use dotyk_base_error, only: error_t, exit_not_solvable
  use dotyk_base_interrupt, only: interrupted, stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: linear_solver_direct
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: largest_square, rounding
  use dotyk_scheme_active_set, only: add_violated, find_active_set, foundation_stiffness, is_balanced, &
    is_worth_screening, iterate_t, keep_what_carries, reference_norm, rest_on_winkler_foundation, screen_rows, &
    update_penetrations
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_closed_ties, only: check_ties, find_held_rows
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_linear_solver_choice, only: choose_coupling, entries_fit, is_heap
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_proximal_motion, only: proximal_motion_t
  use dotyk_scheme_restriction, only: form_entries, transformed_qp_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_cycling, ended_interrupted, ended_limit, &
    ended_no_equilibrium, ended_open_tie, ended_rigid_constraint, ended_stalled, ended_unbalanced, history_t, &
    solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  use dotyk_scheme_undetermined_motion, only: find_undetermined
  use dotyk_scheme_winkler_start, only: check_equilibrium, clear, explain_failure
  implicit none
  private

  type, extends(scheme_t), public :: dual_t  !! The scheme.
  contains
    procedure :: solve => dual_solve
  end type dual_t

  integer, parameter :: most_rounds = 4  !! How often violated rows enter the working set; then all rows do.

contains

  !> Solve.
  recursive subroutine dual_solve(self, qp, compliance, settings, monitor, state, error)
    class(dual_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    !> Where to begin if it has pressures; without pressures on return where the scheme ended before the first step.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where the linear system of an active set cannot be prepared (see `find_active_set`), or an interrupt
    !> came before there was a state.
    type(error_t), allocatable, intent(out) :: error
    type(active_system_t) :: system
    type(transformed_qp_t) :: part
    type(history_t) :: earlier
    logical, allocatable :: working(:), violated(:)
    type(solver_settings_t) :: left
    logical :: warm, explains
    integer :: round

    if (allocated(qp%seam)) then
      call solve_joined(self, qp, compliance, settings, monitor, state, error)
      return
    end if
    warm = allocated(state%pressure)
    ! A state with a history is one of this problem; the loads may have changed since any other.
    explains = state%history%n == 0 .and. is_heap(qp)
    if (state%history%n == 0 .and. .not. explains) then
      call check_equilibrium(qp, state)
      if (state%ended == ended_no_equilibrium) return
    end if
    if (warm) call complete_start(qp, state)
    if (warm .and. .not. is_heap(qp)) then
      working = state%pressure > 0 .or. qp%is_tied
    else
      call screen_rows(qp, working)
    end if
    call choose_coupling(qp, compliance, settings%linear_solver, working, system)
    if (.not. system%needs_entries()) &
      call monitor%note('active sets      matrix-free, projected conjugate gradients; '//to_text(count(working))// &
                        ' constraints in the first working set')
    left = settings
    do round = 1, most_rounds
      left%max_iterations = settings%max_iterations - earlier%n
      if (left%max_iterations < 1) then
        state%ended = ended_limit
        exit
      end if
      if (.not. all(working) .and. qp%coarse%n > 0) call keep_what_carries(qp, working)
      if (.not. system%needs_entries() .or. round == most_rounds .or. .not. is_worth_screening(working)) &
        working = .true.
      call compliance%mark_formed(working)
      if (all(working)) then
        call solve_working_set(qp, compliance, left, monitor, system, warm, state, error)
      else
        call part%restrict(qp, working)
        if (warm) call part%take(state)
        call solve_working_set(part%qp, compliance, left, monitor, system, warm, state, error)
        if (.not. allocated(error) .and. allocated(state%pressure)) call part%give_back(qp, compliance, state)
      end if
      call state%history%finish()
      call state%history%put_after(earlier)
      if (needs_entries_of_ties()) then
        ! Rows that depend on each other, or slender bodies.
        call monitor%note('active sets      ties need entries of the compliance')
        call system%destroy()
        call choose_coupling(qp, compliance, linear_solver_direct, working, system)
        if (allocated(error)) deallocate (error)
        if (allocated(state%pressure)) deallocate (state%pressure, state%penetration, state%alpha)
        earlier = state%history
        warm = .false.
        cycle
      end if
      if (allocated(error) .or. all(working) .or. .not. allocated(state%pressure)) exit
      violated = .not. working .and. state%penetration > rounding*maxval(abs(qp%initial_penetration))
      if (.not. any(violated)) exit
      if (interrupted()) then
        ! The bound is that of the working set.
        state%ended = ended_interrupted
        state%error_bound = huge(state%error_bound)
        exit
      end if
      call add_violated(state%penetration, violated, working)
      earlier = state%history
      ! A start from a near state is kept; one from rigid bodies is made anew, unless active sets are hard to find.
      warm = warm .or. qp%coarse%n > 0 .and. state%ended == ended_converged
    end do
    call system%destroy()
    if (explains) call explain_failure(qp, state, error)
    state%iterations = state%history%n
    state%screened = count(.not. working)
    associate (not_needed => same_type_as(self, self))
    end associate

  contains

    !> Whether conjugate gradients without entries of the compliance have not solved a problem with ties.
    logical function needs_entries_of_ties() result(needed)
      needed = .false.
      if (system%needs_entries() .or. .not. any(qp%is_tied)) return
      if (allocated(error)) then
        needed = error%code == exit_not_solvable
      else
        needed = all(state%ended /= [ended_converged, ended_interrupted])
      end if
      if (needed) needed = entries_fit(qp, compliance, working)
    end function needs_entries_of_ties
  end subroutine dual_solve

  !> Solve for the pressures that are left at seams.
  recursive subroutine solve_joined(self, qp, compliance, settings, monitor, state, error)
    class(dual_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! With seams.
    class(compliance_t), intent(inout) :: compliance  !! As in `dual_solve`.
    type(solver_settings_t), intent(in) :: settings  !! As in `dual_solve`.
    class(monitor_t), intent(inout) :: monitor  !! As in `dual_solve`.
    type(solver_state_t), intent(inout) :: state  !! As in `dual_solve`.
    type(error_t), allocatable, intent(out) :: error  !! As in `dual_solve`.
    type(transformed_qp_t) :: joined
    type(dense_compliance_t) :: of_joined
    call joined%join(qp)
    call form_entries(joined%qp, compliance, of_joined)
    call joined%take(state)
    call self%solve(joined%qp, of_joined, settings, monitor, state, error)
    if (allocated(error)) return
    if (state%rigid_row > 0) state%rigid_row = findloc(qp%seam%column, state%rigid_row, 1)
    if (allocated(state%pressure)) call joined%give_back(qp, compliance, state)
  end subroutine solve_joined

  !> A warm start may have pressures alone.
  subroutine complete_start(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    if (.not. allocated(state%penetration)) state%penetration = qp%initial_penetration
    if (allocated(state%alpha)) then
      if (size(state%alpha) == qp%coarse%n) return
      deallocate (state%alpha)
    end if
    allocate (state%alpha(qp%coarse%n), source=0.0_dp)
  end subroutine complete_start

  !> Solve with all rows of a QP in the working set.
  subroutine solve_working_set(qp, compliance, settings, monitor, system, warm, state, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(active_system_t), intent(inout) :: system  !! Linear system of an active set: work space.
    logical, intent(in) :: warm  !! Whether to begin with the state.
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    type(error_t), allocatable, intent(out) :: error  !! As in `dual_solve`.
    type(iterate_t) :: now
    type(contact_qp_t) :: with_springs
    type(proximal_motion_t) :: motion
    real(dp), allocatable :: foundation(:)
    logical, allocatable :: active(:), all_rows(:), is_held(:)
    logical :: starts_inside, done
    integer :: k
    if (warm) then
      now%lambda = qp%weight*state%pressure
      now%penetration = state%penetration
      now%alpha = state%alpha/qp%coarse%scale
      active = state%pressure > 0 .or. qp%is_tied
    end if
    call clear(state)
    if (system%needs_entries()) then
      ! A state that exists already is not given up for an interrupt.
      call compliance%form(qp, may_stop=.not. warm)
      if (.not. warm) call stop_if_interrupted(error)
      if (allocated(error)) return
    end if
    foundation = foundation_stiffness(qp)
    all_rows = [(.true., k=1, qp%n_rows)]
    with_springs = qp
    starts_inside = .not. warm .and. is_heap(qp)
    call motion%init(qp, foundation, qp%is_tied, all_rows, [(0.0_dp, k=1, qp%coarse%n)])
    call motion%apply(qp, with_springs)
    call find_held_rows(qp, with_springs, compliance, system, state, is_held, error)
    if (allocated(error) .or. state%ended == ended_rigid_constraint) return
    if (.not. warm) then
      allocate (active(qp%n_rows), source=.false.)
      if (starts_inside) then
        allocate (now%lambda(qp%n_rows), now%alpha(qp%coarse%n), source=0.0_dp)
        now%penetration = qp%initial_penetration
      else
        call rest_on_winkler_foundation(with_springs, now, active)
      end if
    end if
    call motion%init(qp, foundation, active, all_rows, 0*now%alpha)
    do
      call motion%apply(qp, with_springs)
      if (motion%has_changed) call system%forget()
      if (qp%n_rows == 0) then
        call system%init(with_springs, compliance, active, error)
        if (allocated(error)) return
        call system%solve(with_springs, compliance, 0*now%lambda, with_springs%coarse%resultant, now%lambda, now%alpha)
        state%ended = ended_converged
      else
        call find_active_set(qp, with_springs, compliance, max(1, settings%max_iterations - state%history%n), monitor, &
                             system, now, active, state, error, starts_inside, is_held)
        if (allocated(error) .or. state%ended == ended_rigid_constraint) return
        if (system%needs_entries()) call check_ties(qp, compliance, now%lambda, now%alpha, now%penetration, state)
        if (state%ended == ended_open_tie) return
      end if
      starts_inside = .false.
      call motion%advance(qp, foundation, now%lambda, now%alpha, active, done)
      if (done .or. state%ended /= ended_converged) exit
    end do
    state%imbalance = motion%imbalance/qp%coarse%scale
    state%rest = motion%rest
    state%excess = motion%excess
    call find_undetermined(motion, qp, foundation, active, state%indeterminate)
    call finish(qp, with_springs, compliance, settings%tolerance, system, now, state, is_held)
  end subroutine solve_working_set

  !> The state that is returned: no force is tensile, and the bound is the least one that is available.
  subroutine finish(qp, with_springs, compliance, tolerance, system, now, state, is_held)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: with_springs  !! The same with the springs of the last step.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    real(dp), intent(in) :: tolerance  !! Relative, in the energy norm [].
    type(active_system_t), intent(in) :: system  !! Linear system of the last active set.
    type(iterate_t), intent(inout) :: now  !! The iterate.
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    logical, intent(in) :: is_held(:)  !! Contact rows that ties hold, closed but for rounding (n_rows).
    real(dp) :: norm, admissible, rounded
    logical :: has_equilibrium
    now%lambda = merge(now%lambda, max(0.0_dp, now%lambda), qp%is_tied)
    call update_penetrations(qp, compliance, now)
    now%penetration = merge(0.0_dp, now%penetration, is_held)
    state%pressure = now%lambda/qp%weight
    state%penetration = now%penetration
    state%alpha = qp%coarse%scale*now%alpha
    call state%indeterminate%scale(qp%coarse%scale)
    norm = reference_norm(qp, now)
    state%error_bound = huge(norm)
    has_equilibrium = is_balanced(with_springs, now%lambda, now%alpha) .and. &
                      .not. any(state%excess > qp%coarse%max_unbalanced)
    if (has_equilibrium) then
      ! Ties that are not closed to the bit leave none.
      if (.not. any(qp%is_tied)) state%error_bound = sqrt(duality_gap(qp%weight, qp%theta, state%pressure, &
                                                                      state%penetration))
      admissible = huge(norm)
      if (state%ended /= ended_interrupted) &
        admissible = admissible_bound(qp, with_springs, compliance, system, now%lambda, now%penetration)
      ! A bound from half a solution is none.
      if (interrupted()) admissible = huge(norm)
      state%error_bound = min(state%error_bound, admissible)
      call qp%coarse%rounding(qp%block, now%lambda, rounded)
      state%error_bound = state%error_bound + rounded
      if (norm > 0) then
        if (state%error_bound <= largest_square*norm) then
          state%error_bound = state%error_bound/norm
        else
          state%error_bound = huge(norm)
        end if
      end if
    end if
    ! There is none for loads whose squares overflow either.
    if (.not. state%error_bound <= huge(norm)) state%error_bound = huge(norm)
    state%energy = qp%energy(state%pressure, state%penetration, now%alpha)
    state%max_penetration = 0
    if (size(state%penetration) > 0) state%max_penetration = max(0.0_dp, &
                                                                 maxval(state%penetration, mask=.not. qp%is_tied))
    if (state%history%n > 0) then
      state%history%error_bound(state%history%n) = state%error_bound
      state%history%energy(state%history%n) = state%energy
      state%history%max_penetration(state%history%n) = state%max_penetration
    end if
    if (state%ended == ended_converged .and. state%error_bound > tolerance) then
      state%ended = merge(ended_stalled, ended_unbalanced, has_equilibrium)
      if (interrupted()) state%ended = ended_interrupted
    end if
    if (any(state%ended == [ended_limit, ended_cycling, ended_interrupted]) .and. state%error_bound <= tolerance) &
      state%ended = ended_converged
  end subroutine finish

  !> A bound of ||u - u_theta||_A: the norm of a displacement g, of self-equilibrated forces and rigid body modes, with
  !> `B g = y - theta m` on the active rows and `B g >= y` elsewhere. `huge` where g misses one of these conditions.
  !>
  !> u solves exactly the problem whose gaps are larger by B g, in which u_theta + g is as admissible as u_theta is
  !> here; both variational inequalities, each tested with the solution of the other, add up to
  !> `||u - u_theta||_A^2 <= A(u - u_theta, g)`, less `sum theta/w (lambda - lambda_theta)^2`. g comes from forces mu
  !> that solve the active system with its theta, so that B g is theta mu/w too large: that adds `theta mu^2/(4 w)`, the
  !> square completed. What rounding leaves of B g, r, adds `lambda.r` and the like with the forces of u_theta, which
  !> are equal to first order: `x^2 <= |g| x + sum theta mu^2/(4 w) + 2 lambda.r`. Ties are equations, for which it is
  !> `(lambda - lambda_theta).r`, to first order mu.r. [sqrt(energy)]
  real(dp) function admissible_bound(qp, with_springs, compliance, system, lambda, penetration) result(bound)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: with_springs  !! The same with springs on the modes: what the system is that of.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(active_system_t), intent(in) :: system  !! Linear system of the active set that the state came from.
    real(dp), intent(in) :: lambda(:)  !! Forces of contact, not negative, and of ties (n_rows) [force].
    real(dp), intent(in) :: penetration(:)  !! Penetrations (n_rows) [length].
    real(dp), allocatable :: residual(:), mu(:), beta(:), all_mu(:), z(:), motion(:), zero(:)
    real(dp) :: remainder
    logical, allocatable :: active(:)
    if (size(penetration) == 0) then
      bound = 0
      return
    end if
    bound = huge(bound)
    associate (row => system%row, weight => qp%weight)
      allocate (mu(size(row)), beta(qp%coarse%n), z(size(penetration)), motion(size(penetration)), zero(qp%coarse%n))
      mu = 0
      zero = 0
      residual = penetration(row) - qp%theta(row)/weight(row)*lambda(row)
      call system%solve(with_springs, compliance, -residual, zero, mu, beta)
      allocate (all_mu(size(penetration)), source=0.0_dp)
      all_mu(row) = -mu
      call compliance%multiply(qp, all_mu, z)
      call qp%mode_displacement(beta, motion)
      allocate (active(size(penetration)), source=.false.)
      active(row) = .true.
      ! B g = z + G beta.
      if (any(.not. active .and. penetration > z + motion .and. &
              penetration > rounding*maxval(abs(qp%initial_penetration)))) return
      remainder = 2*sum(abs(merge(mu, lambda(row), qp%is_tied(row))* &
                            (z(row) + motion(row) - residual - qp%theta(row)/weight(row)*mu))) &
                  + sum(qp%theta(row)/weight(row)*mu**2)/4
      bound = sqrt(max(0.0_dp, sum(all_mu*z) + dot_product(beta, qp%coarse%stiffness_forces(beta)))) + sqrt(remainder)
    end associate
  end function admissible_bound
end module dotyk_scheme_dual
