!> The primal engine: the displacements as unknowns, by a proximal active set (`dotyk_scheme_proximal_active_set`) over
!> any linear systems (`dotyk_scheme_proximal_system`). Any theta >= 0, held and floating bodies, whose motions that
!> contact does not restrain are held by springs (`dotyk_scheme_proximal_motion`). All rows are in the systems, for
!> inactive ones cost little. It ends by its bound (`error_bound`), which is asked for by more and more accurate
!> solutions. The primal scheme is the engine for bodies whose compliance operators are p-multigrids
!> (`dotyk_response_multigrid_response`).
!>
!> Unknown is v = u - u_0, the displacement by contact forces and rigid body motions: `K v = r_0 + R e - B^T lambda`
!> with r_0 what the rough solution u_0 without contact leaves of the loads, e the resultants of these on the rigid body
!> modes R, and `B v <= -y_0`. The start is the contact of the bodies in their corner spaces
!> (`dotyk_scheme_corner_contact`). Near-null-space modes, which have a stiffness, are left to the dual scheme, and so
!> are supports that press rows together (`why_not`).
module dotyk_scheme_primal
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: largest_square, least_gain, one_digit, rounding
  use dotyk_base_timer, only: wall_time
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_scheme_active_set, only: foundation_stiffness, is_balanced, iterate_t, near_violation, reference_norm, &
    screen_rows
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_coarse_space, only: coarse_space_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_gap_closing, only: left_open
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_primal_system, only: primal_system_t
  use dotyk_scheme_proximal_active_set, only: proximal_outcome_t, solve_proximal
  use dotyk_scheme_proximal_motion, only: proximal_motion_t
  use dotyk_scheme_proximal_system, only: proximal_system_t
  use dotyk_scheme_restriction, only: restrict_qp, transformed_qp_t
  use dotyk_scheme_scheme, only: reason_aggregates, reason_near_null_modes, reason_no_rows, reason_none, &
    reason_rigid_rows, scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_costly, ended_interrupted, ended_limit, &
    ended_no_equilibrium, ended_rigid_constraint, ended_solves, ended_stalled, ended_unbalanced, solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  use dotyk_scheme_undetermined_motion, only: find_undetermined
  use dotyk_scheme_winkler_start, only: check_equilibrium, clear
  implicit none
  private
  public :: solve_by_displacements

  type, extends(scheme_t), public :: primal_t  !! The scheme.
  contains
    procedure :: solve => primal_solve
    procedure, nopass :: why_not => primal_why_not
  end type primal_t

  !> The dual scheme with solves by p-multigrid: for what the primal scheme does not solve, where there are no factors.
  type, extends(dual_t), public :: grid_dual_t
  contains
    procedure :: solve => grid_dual_solve
  end type grid_dual_t

  !> Errors of the dual scheme by errors of its solves: those of several solves add up [].
  real(dp), parameter :: safety = 100
  !> How often a bound above the tolerance is followed by a more accurate solution.
  integer, parameter :: most_attempts = 5
  integer, parameter :: most_sets = 100  !! Active sets at most: where it converges, it takes a third of them.
  !> Accuracy of the displacements that is asked for, as a fraction of the tolerance, and the next one of the last one:
  !> bounds are a few times the accuracy [].
  real(dp), parameter :: share = 0.1_dp
  !> Accuracy that is asked for at least: forces of floating bodies balance their loads then [].
  real(dp), parameter :: least_accuracy = 1.0e-4_dp
  !> Fractions of the diagonal that are added where gaps are closed [].
  real(dp), parameter :: shift(2) = [1.0e-10_dp, 1.0e-4_dp]

contains

  !> Modes with a stiffness, and supports that press rows together, are for the dual scheme.
  integer function primal_why_not(qp, compliance) result(reason)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    !> Compliance of the bodies at these rows: p-multigrids, or factors that join them.
    class(compliance_t), intent(in) :: compliance
    logical :: is_rigid(qp%n_rows)
    reason = reason_no_rows
    if (qp%n_rows == 0) return
    reason = reason_near_null_modes
    if (allocated(qp%coarse%stiffness)) return
    reason = reason_aggregates
    select type (compliance)
    class is (body_compliance_t)
      if (.not. compliance%has_grids()) return
      if (.not. has_corner_matrices(qp, compliance)) return
      call find_rigid_rows(qp, compliance, is_rigid)
      reason = merge(reason_rigid_rows, reason_none, any(presses_rigid_rows(qp, is_rigid)))
    end select
  end function primal_why_not

  !> Whether the stiffnesses of the corner spaces of tied bodies are there.
  logical function has_corner_matrices(qp, compliance) result(has)
    type(contact_qp_t), intent(in) :: qp  !! Rows of contact and ties.
    class(body_compliance_t), intent(in) :: compliance  !! By p-multigrids.
    class(body_grid_t), pointer :: grid
    type(sparse_symmetric_t), pointer :: matrix
    real(dp), pointer :: mode(:, :)
    integer :: b
    has = .true.
    do b = 1, size(qp%block)
      if (.not. any(qp%is_tied(qp%block(b)%row))) cycle
      grid => compliance%body_grid(b)
      if (.not. associated(grid)) cycle
      call grid%get_corner_matrix(matrix, mode)
      has = has .and. associated(matrix)
    end do
  end function has_corner_matrices

  !> Solve.
  subroutine primal_solve(self, qp, compliance, settings, monitor, state, error)
    class(primal_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    !> Where to begin if it has pressures; without pressures on return where the scheme ended before the first step.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where numbers are not finite, or an interrupt came before there was a state.
    type(error_t), allocatable, intent(out) :: error
    select type (compliance)
    class is (body_compliance_t)
      call compliance%forget_displacements()
      call solve_by_grids(qp, compliance, settings, monitor, state, error)
    end select
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine primal_solve

  !> Solve by the dual scheme, and add the error of the solves to its bound, which is that of exact ones.
  subroutine grid_dual_solve(self, qp, compliance, settings, monitor, state, error)
    class(grid_dual_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! As in `primal_solve`.
    class(compliance_t), intent(inout) :: compliance  !! As in `primal_solve`.
    type(solver_settings_t), intent(in) :: settings  !! As in `primal_solve`.
    class(monitor_t), intent(inout) :: monitor  !! As in `primal_solve`.
    type(solver_state_t), intent(inout) :: state  !! As in `primal_solve`.
    type(error_t), allocatable, intent(out) :: error  !! As in `dual_solve`.
    call self%dual_t%solve(qp, compliance, settings, monitor, state, error)
    select type (compliance)
    class is (body_compliance_t)
      call compliance%forget_displacements()
      if (.not. compliance%solve_error() > 0 .or. .not. state%error_bound < huge(1.0_dp)) return
      state%bound_is_guaranteed = .false.
      state%error_bound = state%error_bound + safety*compliance%solve_error()
      if (state%ended == ended_converged .and. state%error_bound > settings%tolerance) state%ended = ended_solves
    end select
  end subroutine grid_dual_solve

  !> Rows whose nodes are held, all but for rounding.
  subroutine find_rigid_rows(qp, compliance, is_rigid)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(body_compliance_t), intent(in) :: compliance  !! Compliance of the bodies at these rows.
    logical, intent(out) :: is_rigid(:)  !! (n_rows)
    real(dp) :: diagonal(qp%n_rows)
    integer :: b, i
    call compliance%nodal_diagonal(qp, diagonal)
    ! Entries of B at free nodes may be rounding.
    is_rigid = .not. diagonal > rounding**2*maxval([0.0_dp, diagonal])
    ! Rigid bodies move without a stiffness.
    do b = 1, size(qp%block)
      do i = 1, size(qp%block(b)%row)
        if (any(abs(qp%coarse%block(b)%value(i, :)) > 0)) is_rigid(qp%block(b)%row(i)) = .false.
      end do
    end do
  end subroutine find_rigid_rows

  !> Solve by displacements.
  subroutine solve_by_grids(qp, compliance, settings, monitor, state, error)
    type(contact_qp_t), intent(in) :: qp  !! As in `primal_solve`.
    class(body_compliance_t), target, intent(inout) :: compliance  !! By p-multigrids.
    type(solver_settings_t), intent(in) :: settings  !! As in `primal_solve`.
    class(monitor_t), intent(inout) :: monitor  !! As in `primal_solve`.
    type(solver_state_t), intent(inout) :: state  !! As in `primal_solve`.
    type(error_t), allocatable, intent(out) :: error  !! As in `primal_solve`.
    type(primal_system_t), target :: system
    type(proximal_outcome_t) :: total
    type(transformed_qp_t) :: joined
    real(dp), allocatable :: v(:)
    logical, allocatable :: is_rigid(:)
    system%compliance => compliance
    if (allocated(qp%seam)) then
      call joined%join(qp)
      allocate (is_rigid(joined%qp%n_rows))
      call find_rigid_rows(joined%qp, compliance, is_rigid)
      call joined%take(state)
      call solve_by_displacements(system, joined%qp, settings%tolerance, settings, is_rigid, monitor, v, total, state, &
                                  error)
      if (allocated(error) .or. .not. allocated(state%pressure)) return
      state%pressure = joined%pressures(state%pressure)
      deallocate (state%penetration)
      allocate (state%penetration(qp%n_rows))
      call system%find_penetrations(qp, v, state%penetration)
    else
      allocate (is_rigid(qp%n_rows))
      call find_rigid_rows(qp, compliance, is_rigid)
      call solve_by_displacements(system, qp, settings%tolerance, settings, is_rigid, monitor, v, total, state, error)
    end if
    if (.not. allocated(error) .and. allocated(state%pressure)) then
      call system%keep_displacements(v, compliance)
      compliance%n_sweeps = compliance%n_sweeps + total%cg_steps
      call monitor%note('displacements    '//to_text(total%steps)//' active sets, '//to_text(total%cg_steps)// &
                        ' iterations of conjugate gradients with p-multigrid')
    end if
    call system%destroy()
  end subroutine solve_by_grids

  !> Solve by displacements.
  subroutine solve_by_displacements(system, qp, tolerance, settings, is_rigid, monitor, u, total, state, error)
    class(proximal_system_t), target, intent(inout) :: system  !! The bodies.
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), intent(in) :: tolerance  !! Bound to end at, relative in the energy norm [].
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    logical, intent(in) :: is_rigid(:)  !! Rows that no displacement moves: they are in no system (n_rows).
    class(monitor_t), intent(inout) :: monitor  !! Gets each solution that is followed by a more accurate one.
    !> Displacements: start where allocated, and solution (system%n) [length].
    real(dp), allocatable, intent(inout) :: u(:)
    type(proximal_outcome_t), intent(out) :: total  !! Active sets and iterations in all.
    !> Where to begin if it has pressures; without pressures on return where there is no solution.
    type(solver_state_t), intent(inout) :: state
    type(error_t), allocatable, intent(out) :: error  !! Allocated where numbers are not finite, or PETSc fails.
    ! With the rows that displacements move alone, and with the loads less what the springs carry.
    type(contact_qp_t) :: part, held
    type(coarse_space_t) :: coarse
    type(proximal_outcome_t) :: outcome
    type(proximal_motion_t) :: motion
    type(iterate_t) :: now
    real(dp), allocatable :: m(:), of_rows(:)
    logical, allocatable :: near(:)
    real(dp) :: accuracy, start, last
    integer :: attempt, limit
    logical :: has_equilibrium
    start = wall_time()
    if (any(presses_rigid_rows(qp, is_rigid))) then
      call clear(state)
      state%ended = ended_rigid_constraint
      return
    end if
    if (state%history%n == 0) then
      call check_equilibrium(qp, state)
      if (state%ended == ended_no_equilibrium) return
    end if
    allocate (m(qp%n_rows), source=0.0_dp)
    if (allocated(state%pressure)) m(:) = state%pressure
    call clear(state)
    held = qp
    limit = min(most_sets, settings%max_iterations)
    accuracy = min(share*tolerance, least_accuracy)
    call restrict_qp(qp, .not. is_rigid, part)
    call system%take_rows(part)
    of_rows = pack(m, .not. is_rigid)
    if (.not. allocated(u)) then
      allocate (u(system%n), source=0.0_dp)
      call system%start(part, of_rows, u)
    end if
    call screen_rows(part, near)
    call motion%init(part, foundation_stiffness(part), of_rows > 0 .or. part%is_tied, near, 0*part%coarse%resultant)
    last = huge(last)
    do attempt = 1, most_attempts
      call solve_proximal(system, part, system%gap, system%load, accuracy, max(1, limit - total%steps), motion, &
                          of_rows, u, outcome, error)
      state%ended = outcome%ended
      if (allocated(error) .or. any(outcome%ended == [ended_rigid_constraint, ended_costly])) return
      total%steps = total%steps + outcome%steps
      total%cg_steps = total%cg_steps + outcome%cg_steps
      m(:) = unpack(of_rows, .not. is_rigid, 0*m)
      coarse = qp%coarse
      coarse%resultant = coarse%resultant - motion%imbalance
      call held%replace_modes(coarse)
      call balance(held, m)
      of_rows = pack(m, .not. is_rigid)
      now%lambda = qp%weight*m
      now%alpha = system%resultants(u)/qp%coarse%scale
      now%penetration = qp%initial_penetration
      call system%find_penetrations(qp, u, now%penetration)
      has_equilibrium = is_balanced(held, now%lambda, now%alpha) .and. &
                        .not. any(motion%excess > qp%coarse%max_unbalanced)
      call judge()
      ! Errors that no longer fall at one accuracy may do so at a smaller one.
      if (system%is_interrupted() .or. .not. (outcome%converged .or. outcome%ended == ended_stalled)) exit
      if (state%error_bound <= tolerance .or. total%steps >= limit) exit
      if (last < huge(last) .and. .not. state%error_bound < least_gain*last) exit
      last = state%error_bound
      ! The residual that left this bound may be far below what was asked for: forces on active rows count for little
      ! in the norm of the preconditioner.
      accuracy = share*min(accuracy, max(rounding, max(outcome%residual, outcome%change)/max(outcome%norm, tiny(last))))
      call monitor%step(state%history, tolerance, state%error_bound)
    end do
    call find_undetermined(motion, qp, foundation_stiffness(qp), now%lambda > 0 .or. qp%is_tied, state%indeterminate)
    call state%indeterminate%scale(qp%coarse%scale)
    state%imbalance = motion%imbalance/qp%coarse%scale
    state%rest = motion%rest
    state%excess = motion%excess
    call state%history%finish()
    state%iterations = state%history%n
    state%pressure = m
    where (is_rigid .and. qp%theta > 0) state%pressure = max(0.0_dp, now%penetration)/qp%theta
    state%penetration = now%penetration
    state%alpha = qp%coarse%scale*now%alpha
    state%bound_is_guaranteed = .false.
    state%ended = ended_solves
    if (.not. (outcome%converged .or. outcome%ended == ended_stalled)) state%ended = outcome%ended
    if (state%ended == ended_limit) &
      state%ended = merge(ended_limit, ended_solves, total%steps >= settings%max_iterations)
    if (.not. has_equilibrium) state%ended = ended_unbalanced
    if (system%is_interrupted()) state%ended = ended_interrupted
    if (state%error_bound <= tolerance) state%ended = ended_converged

  contains

    !> Bound, energy and penetration of the iterate, for the state and its history.
    subroutine judge()
      real(dp) :: norm, bound
      call system%find_terms(u, state%terms)
      norm = max(reference_norm(qp, now, state%terms), tiny(norm))
      state%error_bound = huge(norm)
      if (has_equilibrium) then
        bound = hypot(system%error_of_isolated, &
                      error_bound(system, part%weight, part%theta, part%is_tied, system%load, u, &
                                  pack(now%lambda, .not. is_rigid), pack(now%penetration, .not. is_rigid)))
        if (bound <= largest_square*norm) state%error_bound = bound/norm
        if (bound <= 0) state%error_bound = 0
      end if
      state%energy = state%terms(1) - state%terms(2) + sum(qp%penalty_of_rows(m, now%penetration))
      state%max_penetration = max(0.0_dp, maxval(now%penetration, mask=.not. qp%is_tied))
      call state%history%add(wall_time() - start, outcome%change, outcome%change/norm, state%error_bound, &
                             state%energy, state%max_penetration, count(m > 0 .and. .not. qp%is_tied))
    end subroutine judge
  end subroutine solve_by_displacements

  !> Rows that no displacement moves, and that supports press together, or pull where they are tied.
  pure function presses_rigid_rows(qp, is_rigid) result(presses)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, intent(in) :: is_rigid(:)  !! Rows that no displacement moves (n_rows).
    logical :: presses(qp%n_rows)  !! (n_rows)
    associate (y => qp%initial_penetration)
      presses = is_rigid .and. .not. qp%theta > 0 .and. &
                merge(abs(y) > rounding*maxval([0.0_dp, abs(y)]), y > 0, qp%is_tied)
    end associate
  end function presses_rigid_rows

  !> A bound of ||u - u_theta||_A [sqrt(energy)].
  !>
  !> With the residual r of the equilibrium of u and lambda, and a displacement g that closes gaps (`close_gaps`), u - g
  !> is admissible, and its duality gap with lambda has nothing but |r + K g|^2/2 and what g leaves of the
  !> complementarity, s. The energy is strongly convex, so that `||u - u_theta|| <= |g| + sqrt((|r| + |g|)^2 + 2 s)`.
  !> |r| comes from the preconditioner and its least eigenvalue. `huge` where other rows penetrate. The least of several
  !> g: none, and such that close gaps of dependent rows with more or less force.
  real(dp) function error_bound(system, weight, theta, is_tied, load, u, lambda, penetration) result(bound)
    class(proximal_system_t), intent(inout) :: system  !! The bodies and rows.
    real(dp), intent(in) :: weight(:)  !! Weights (n_rows) [area].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    logical, intent(in) :: is_tied(:)  !! Rows of ties (n_rows).
    real(dp), intent(in), contiguous :: load(:)  !! Loads (n) [force].
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    !> Forces, not negative on contact rows, in equilibrium with the loads of floating bodies (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    real(dp), intent(in) :: penetration(:)  !! Penetrations (n_rows) [length].
    type(error_t), allocatable :: error
    real(dp), allocatable :: r(:)
    real(dp) :: closed(size(penetration)), softness(size(penetration)), of_r, of_g, left
    logical :: chosen(size(penetration))
    integer :: k
    allocate (r(system%n))
    call system%strain_forces(u, r)
    r(:) = load - r
    call system%subtract_row_force(lambda, r)
    of_r = system%force_norm(r)
    bound = huge(bound)
    ! Ties that are not closed to the bit leave none.
    if (.not. any(is_tied)) bound = duality_gap(weight, theta, lambda/weight, penetration)
    if (bound < huge(bound)) bound = sqrt(of_r**2 + 2*bound)
    softness = theta/weight
    chosen = lambda > 0 .or. penetration > -slack(weight, theta, is_tied, lambda, penetration) .or. is_tied
    do k = 1, size(shift)
      call system%close_gaps(chosen, merge(penetration - softness*lambda, 0.0_dp, chosen), softness, shift(k), &
                             closed, of_g, &
                             error)
      if (allocated(error)) return
      left = left_open(weight, theta, is_tied, lambda, penetration, closed, &
                       .not. softness > system%smoother_compliance())
      if (max(of_g, left) < largest_square) bound = min(bound, of_g + sqrt((of_r + of_g)**2 + 2*left))
    end do
  end function error_bound

  !> Gaps of inactive rows that are so small that a displacement that closes those of active rows may close them.
  pure real(dp) function slack(weight, theta, is_tied, lambda, penetration)
    real(dp), intent(in) :: weight(:)  !! Weights (n) [area].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n) [length/pressure].
    logical, intent(in) :: is_tied(:)  !! Rows of ties (n).
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n) [force].
    real(dp), intent(in) :: penetration(:)  !! Penetrations (n) [length].
    slack = near_violation*maxval([0.0_dp, abs(pack(penetration - theta/weight*lambda, lambda > 0 .or. is_tied))])
  end function slack

  !> Change the pressures of active rows and ties as little as the equilibrium of the floating bodies asks for.
  subroutine balance(qp, pressure)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), intent(inout) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), allocatable :: g(:, :), weighted(:, :), values(:), vectors(:, :), missing(:), change(:), share(:)
    integer, allocatable :: row(:)
    type(error_t), allocatable :: error
    integer :: i, pass
    if (qp%coarse%n == 0) return
    row = pack([(i, i=1, size(pressure))], pressure > 0 .or. qp%is_tied)
    allocate (g(size(row), qp%coarse%n), values(qp%coarse%n), vectors(qp%coarse%n, qp%coarse%n), missing(qp%coarse%n))
    call qp%coarse%rows(row, g)
    ! Pressures change in proportion to themselves: none becomes tensile before the others do. Those of ties have any
    ! sign, and change in proportion to their mean.
    share = pressure(row)
    associate (tied => qp%is_tied(row))
      if (any(tied)) where (tied) share = sum(qp%weight(row)*abs(pressure(row)), mask=tied)/sum(qp%weight(row), &
                                                                                                mask=tied)
    end associate
    weighted = g*spread(qp%weight(row)*share, 2, size(g, 2))
    call symmetric_eigen(matmul(transpose(g), weighted), values, vectors, error)
    if (allocated(error)) return
    do pass = 1, 2
      call qp%mode_resultant(qp%weight*pressure, missing)
      missing = matmul(qp%coarse%resultant - missing, vectors)
      where (values > rounding*maxval(values))
        missing = missing/values
      else where
        missing = 0
      end where
      change = matmul(g, matmul(vectors, missing))
      ! Pressures without a digit left are not near equilibrium.
      if (.not. maxval([0.0_dp, abs(change)]) < one_digit) return
      pressure(row) = merge(pressure(row) + share*change, max(0.0_dp, pressure(row)*(1 + change)), qp%is_tied(row))
    end do
  end subroutine balance
end module dotyk_scheme_primal
