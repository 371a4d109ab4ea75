!> The primal-dual active set (semismooth Newton) iteration of the dual scheme, with its safeguards.
!>
!> A solution fulfils the KKT conditions, equations (6), (8), (9): forces lambda >= 0, gaps >= 0 (of the surfaces with
!> their penalty), no force where there is a gap. The active rows give a linear system for their forces and the rigid
!> body modes; rows in tension leave the active set, and penetrating rows enter it (Hueber, Wohlmuth 2005). Springs
!> (`dotyk_scheme_proximal_motion`) carry a floating body that the active rows cannot carry.
!> Should active sets cycle, the interior-point method (`dotyk_scheme_interior_point`) finds one next to the solution.
!> From there sets that come no nearer to a solution for a few steps change by their last row alone: such steps do not
!> cycle (J. J. Judice and F. M. Pires, Comput. Oper. Res. 21, 1994). Rows of ties are always active.
!> Should there be too many of them, by rows whose gaps and forces nearly vanish, the interior point is the solution,
!> and its bound says how accurate it is.
!>
!> Working sets are the rows that may be active, enough of them to carry floating bodies, and those that turn out to be
!> violated.
module dotyk_scheme_active_set
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: half_digits, least_gain, rounding
  use dotyk_base_timer, only: wall_time
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_compliance, only: compliance_t, drop_rigid_constraints
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_interior_point, only: interior_point_method
  use dotyk_scheme_linear_solver_choice, only: is_heap
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_restriction, only: restrict_qp
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_cycling, ended_interrupted, ended_limit, &
    ended_rigid_constraint
  use dotyk_scheme_winkler_start, only: find_unbounded_direction, winkler_equilibrium
  implicit none
  private
  public :: find_active_set, foundation_stiffness, rest_on_winkler_foundation, update_penetrations, reference_norm, &
    is_balanced, add_violated, is_worth_screening, keep_what_carries, screen_rows

  type, public :: iterate_t  !! An iterate of the dual scheme.
    !> Forces (n_rows) [force], penetrations (n_rows) [length], amplitudes (coarse%n) [length].
    real(dp), allocatable :: lambda(:), penetration(:), alpha(:)
  end type iterate_t


  !> Active sets after which the interior-point method finds a better one: Newton's method needs less than ten, or
  !> cycles.
  integer, parameter :: most_first_steps = 9
  integer, parameter :: most_last_steps = 60  !! Active sets after that at most.
  integer, parameter :: most_stalled = 3  !! Active sets that come no nearer, before they change by one row.
  !> Active sets at most that rows without force, added to a solution, take until it is one again.
  integer, parameter :: most_join_steps = 4
  !> How often rows enter a working set that stop an otherwise unbounded direction; then all rows do.
  integer, parameter :: most_widenings = 10
  !> Rows enter it that this direction closes by more than this fraction of the most.
  real(dp), parameter :: closing = 1.0e-3_dp
  !> A fraction of all rows that is not worth screening: to look at them in the end takes a solve. Few rows are not
  !> worth it at all.
  real(dp), parameter :: not_worth_screening = 0.2_dp
  integer, parameter :: few_rows = 60
  !> Rows enter with the violated ones whose gaps are smaller than this multiple of the largest violation: the next
  !> solution closes gaps by about as much.
  real(dp), parameter, public :: near_violation = 4

contains

  !> Iterate until the active set does not change.
  subroutine find_active_set(qp, with_springs, compliance, max_iterations, monitor, system, now, active, state, error, &
                             start_inside, is_held)
    !> Contact rows, initial penetrations, rigid body modes: what bounds and energies are those of.
    type(contact_qp_t), intent(in) :: qp
    !> The same with springs on the modes: what is solved (`dotyk_scheme_proximal_motion`).
    type(contact_qp_t), intent(in) :: with_springs
    class(compliance_t), intent(inout) :: compliance  !! Formed at all rows, unless the linear system needs no entries.
    integer, intent(in) :: max_iterations  !! Active sets at most.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(active_system_t), intent(inout) :: system  !! That of the last active set on return.
    type(iterate_t), intent(inout) :: now  !! Where to begin, and the last iterate.
    logical, intent(inout) :: active(:)  !! Where to begin, and the last active set (n_rows).
    type(solver_state_t), intent(inout) :: state  !! Gets the history, and how the iteration ended.
    !> Allocated where the linear system of an active set cannot be prepared (`init` of its type): factorized, its
    !> compliance is not positive definite or METIS fails; matrix-free, the modes at the rows are not finite.
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in) :: start_inside  !! Whether the interior-point method begins, without any active set.
    logical, intent(in) :: is_held(:)  !! Contact rows that ties hold: they stay inactive (n_rows).
    logical :: next(size(active)), is_rigid(size(active)), presses(size(active))
    logical :: cycles, tried, joined, is_shared, is_new
    integer :: changes(most_first_steps + most_last_steps)
    type(iterate_t) :: last, inside, unjoined
    logical, allocatable :: inside_active(:), unjoined_active(:)
    real(dp), allocatable :: change(:), yields(:)
    real(dp) :: begin, length, largest_force, largest_gap
    integer :: k, last_k, steps, place, fewest, n_stalled

    begin = wall_time()
    allocate (change(size(active)))
    is_rigid = is_held
    active = (active .or. qp%is_tied) .and. .not. is_rigid
    state%ended = ended_limit
    tried = .false.
    joined = .false.
    is_shared = .false.
    last_k = max_iterations
    fewest = huge(fewest)
    n_stalled = 0
    do k = 1, max_iterations
      if (interrupted() .or. k > last_k) exit
      cycles = .not. (tried .or. joined) .and. (k == most_first_steps .or. is_not_decreasing(changes(:k - 1)))
      if (k == 1) cycles = start_inside
      if (cycles) then
        call monitor%finish()
        tried = .true.
        fewest = huge(fewest)
        last_k = min(max_iterations, k + most_last_steps)
        call interior_point_method(with_springs, compliance, system, 1/foundation_stiffness(with_springs), &
                                   .not. is_rigid, now%lambda, now%alpha, active, steps, error)
        if (allocated(error)) return
        call update_penetrations(with_springs, compliance, now)
        if (k > 1) then
          call monitor%note('active-set iteration cycled; interior-point method used ('//to_text(steps)//' systems)')
        else
          call monitor%note('interior-point method used ('//to_text(steps)//' systems)')
        end if
      end if
      call drop_rigid_constraints(qp, compliance, yields, active, is_rigid)
      ! Rigid rows that have joined a solution penetrate by rounding only.
      presses = is_rigid .and. .not. (qp%theta > 0 .or. qp%is_tied .or. is_held)
      if (.not. joined .and. any(presses .and. qp%initial_penetration > 0)) then
        state%ended = ended_rigid_constraint
        place = maxloc(qp%initial_penetration, 1, presses)
        state%rigid_row = qp%parent_row(place)
        state%overlap = qp%initial_penetration(place)
        return
      end if
      is_new = .not. system%is_for(qp, active)
      if (is_new) call system%init(with_springs, compliance, active, error)
      ! The set before rows joined is a solution.
      if (allocated(error) .and. joined) then
        deallocate (error)
        exit
      end if
      if (allocated(error)) return
      last = now
      call solve_active(with_springs, compliance, system, now)
      if (cycles) then
        inside = now
        inside_active = active
      end if
      ! Half a solution says nothing about active sets.
      if (interrupted()) exit
      call compliance%multiply(qp, now%lambda - last%lambda, change)
      length = sqrt(max(0.0_dp, sum((now%lambda - last%lambda)*change)))
      ! Springs that are moved up solve the system of the same set again: no step of the iteration.
      if (is_new) then
        call add_to_history(qp, now, wall_time() - begin, length, count(active .and. .not. qp%is_tied), state)
        ! Active sets are found or not: no rate of convergence leads to a tolerance.
        call monitor%step(state%history, 0.0_dp, state%error_bound)
      end if

      ! Rows may be active without any force, such as those that push a floating body away.
      largest_force = max(maxval(abs(now%lambda)), &
                          maxval(foundation_stiffness(qp)*max(0.0_dp, qp%initial_penetration), mask=.not. qp%is_tied))
      largest_gap = max(maxval(abs(now%penetration)), maxval(abs(qp%initial_penetration)))
      next = merge(now%lambda >= -rounding*largest_force, now%penetration > rounding*largest_gap, active)
      next = (next .or. qp%is_tied) .and. .not. is_rigid
      changes(k) = count(next .neqv. active)
      if (all(next .eqv. active)) then
        state%ended = ended_converged
        is_shared = joined
        if (joined) exit
        call join_touching(qp%theta, now%penetration, rounding*largest_gap, is_rigid, active, next)
        if (all(next .eqv. active)) exit
        joined = .true.
        unjoined = now
        unjoined_active = active
        last_k = min(last_k, k + most_join_steps)
      end if
      n_stalled = merge(0, n_stalled + 1, changes(k) < fewest)
      fewest = min(fewest, changes(k))
      if (tried .and. .not. joined .and. n_stalled > most_stalled) then
        place = findloc(next .neqv. active, .true., 1, back=.true.)
        active(place) = next(place)
      else
        active = next
      end if
    end do
    if (joined .and. .not. is_shared) then
      now = unjoined
      active = unjoined_active
      call system%init(with_springs, compliance, active, error)
    end if
    if (interrupted() .and. state%ended == ended_limit) state%ended = ended_interrupted
    call monitor%finish()
    if (state%ended == ended_limit .and. tried .and. last_k < max_iterations) state%ended = ended_cycling
    if (any(state%ended == [ended_limit, ended_cycling]) .and. allocated(inside%lambda)) then
      now = inside
      active = inside_active
      call system%init(with_springs, compliance, active, error)
    end if
  end subroutine find_active_set

  !> Rows that touch without force join the active set: where rows are redundant, as over the joint of two masters,
  !> those that left it have no way back, and forces would not be shared with them.
  pure subroutine join_touching(theta, penetration, nearly_zero, is_rigid, active, next)
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: penetration(:)  !! Penetrations (n_rows) [length].
    real(dp), intent(in) :: nearly_zero  !! Penetrations below this are rounding errors [length].
    logical, intent(in) :: is_rigid(:)  !! Rows that no force moves (n_rows).
    logical, intent(in) :: active(:)  !! The active set (n_rows).
    logical, intent(out) :: next(:)  !! The same with rows that touch (n_rows).
    next = active
    if (any(active)) next = active .or. (abs(penetration) <= nearly_zero .and. .not. theta > 0 .and. .not. is_rigid)
  end subroutine join_touching

  !> Whether the numbers of rows that change from one active set to the next do not get fewer.
  pure logical function is_not_decreasing(changes)
    integer, intent(in) :: changes(:)  !! Rows that changed, in each step so far (n_steps).
    !> The first active sets may change by any number of rows. Later the numbers halve at least, over two steps since
    !> rows can enter and leave by turns.
    integer, parameter :: first = 4, back = 2
    is_not_decreasing = .false.
    if (size(changes) >= first) is_not_decreasing = changes(size(changes)) > least_gain*changes(size(changes) - back)
  end function is_not_decreasing

  !> Floating bodies at rest on a Winkler foundation that stands for all bodies, and the rows that penetrate there.
  subroutine rest_on_winkler_foundation(qp, now, active)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(iterate_t), intent(out) :: now  !! Without forces.
    logical, intent(out) :: active(:)  !! Active set (n_rows).
    real(dp), allocatable :: motion(:)
    allocate (now%lambda(qp%n_rows), now%alpha(qp%coarse%n), motion(qp%n_rows))
    now%lambda = 0
    call winkler_equilibrium(qp, qp%coarse%resultant, foundation_stiffness(qp), qp%initial_penetration, now%alpha)
    call qp%mode_displacement(now%alpha, motion)
    now%penetration = qp%initial_penetration + motion
    active = now%penetration > 0 .or. qp%is_tied
  end subroutine rest_on_winkler_foundation

  !> Whether the contact forces balance the loads of the floating bodies, up to rounding: there is no bound of the error
  !> otherwise.
  logical function is_balanced(qp, lambda, alpha)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(in) :: alpha(:)  !! Amplitudes of the modes (coarse%n) [length].
    real(dp) :: missing(qp%coarse%n), scale
    call qp%mode_resultant(lambda, missing)
    missing = qp%coarse%resultant - missing - qp%coarse%stiffness_forces(alpha)
    ! Where nothing is loaded all forces are rounding errors of those that the initial penetrations would cause.
    scale = maxval([0.0_dp, abs(lambda)])
    if (size(lambda) > 0) &
      scale = max(scale, maxval(foundation_stiffness(qp)*max(0.0_dp, qp%initial_penetration), &
                                mask=.not. qp%is_tied))
    if (qp%coarse%n > 0) scale = max(scale, maxval(abs(qp%coarse%resultant)))
    ! NaN and infinity, as of a foundation without compliance, balance nothing.
    is_balanced = qp%coarse%n == 0 .or. (scale <= huge(scale) .and. all(abs(missing) <= half_digits*scale))
  end function is_balanced

  !> Stiffness of the Winkler foundation that stands for the bodies (n_rows) [force/length].
  pure function foundation_stiffness(qp) result(stiffness)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), allocatable :: stiffness(:)
    ! Infinite where both sides are rigid.
    stiffness = qp%weight/max(tiny(1.0_dp), qp%foundation + qp%theta)
  end function foundation_stiffness

  !> Solve the system of the active set for the new iterate.
  subroutine solve_active(qp, compliance, system, now)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(active_system_t), intent(in) :: system  !! Linear system of the active set, prepared.
    type(iterate_t), intent(inout) :: now  !! The iterate.
    real(dp), allocatable :: lambda(:)
    allocate (lambda(size(system%row)))
    lambda = now%lambda(system%row)
    call system%solve(qp, compliance, qp%initial_penetration(system%row), qp%coarse%resultant, lambda, now%alpha)
    now%lambda = 0
    now%lambda(system%row) = lambda
    call update_penetrations(qp, compliance, now)
  end subroutine solve_active

  !> y = y_0 - C lambda + G alpha.
  subroutine update_penetrations(qp, compliance, now)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(iterate_t), intent(inout) :: now  !! Its forces and amplitudes are given.
    real(dp), allocatable :: z(:), motion(:)
    allocate (z(size(now%lambda)), motion(size(now%lambda)))
    call compliance%multiply(qp, now%lambda, z)
    call qp%mode_displacement(now%alpha, motion)
    now%penetration = qp%initial_penetration - z + motion
  end subroutine update_penetrations

  !> ||u||_A for relative errors; more than rounding of what the initial penetrations would store in the foundation, so
  !> that rounding errors of a scene at rest are not compared with each other [sqrt(energy)].
  real(dp) function reference_norm(qp, now, terms) result(norm)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(iterate_t), intent(in) :: now  !! The iterate.
    !> Strain energy and work of the loads where displacements tell them (2) [energy].
    real(dp), intent(in), optional :: terms(:)
    if (present(terms)) then
      norm = sqrt(2*max(0.0_dp, terms(1)))
    else
      norm = qp%energy_norm(now%lambda/qp%weight, now%penetration, now%alpha)
    end if
    norm = max(norm, half_digits*sqrt(sum(foundation_stiffness(qp)*qp%initial_penetration**2)))
  end function reference_norm

  !> An entry of the history. There is no bound where forces are tensile.
  subroutine add_to_history(qp, now, seconds, length, n_active, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(iterate_t), intent(in) :: now  !! The iterate.
    real(dp), intent(in) :: seconds  !! Since the start [s].
    real(dp), intent(in) :: length  !! Length of the step, in the energy norm [sqrt(energy)].
    integer, intent(in) :: n_active  !! Active rows.
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    real(dp) :: norm, gap, m(size(now%lambda))
    norm = reference_norm(qp, now)
    m = now%lambda/qp%weight
    ! That of closed ties.
    gap = duality_gap(qp%weight, qp%theta, merge(0.0_dp, m, qp%is_tied), merge(0.0_dp, now%penetration, qp%is_tied))
    state%error_bound = huge(1.0_dp)
    if (gap < huge(1.0_dp) .and. is_balanced(qp, now%lambda, now%alpha)) &
      state%error_bound = sqrt(gap)/max(norm, tiny(norm))
    call state%history%add(seconds, length, length/max(norm, tiny(norm)), state%error_bound, &
                           qp%energy(m, now%penetration, now%alpha), &
                             max(0.0_dp, maxval(now%penetration, mask=.not. qp%is_tied)), &
                           n_active)
  end subroutine add_to_history

  !> The first working set: rows that are active where the bodies are rigid on a Winkler foundation, or nearly so.
  subroutine screen_rows(qp, working)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, allocatable, intent(out) :: working(:)  !! Working set (n_rows).
    type(iterate_t) :: now
    allocate (working(qp%n_rows), source=.true.)
    if (all(qp%is_tied) .or. is_heap(qp)) return
    call rest_on_winkler_foundation(qp, now, working)
    ! Floating bodies sink in more than the foundation tells, or tilt. Faces that just touch are near, too.
    if (qp%coarse%n > 0) working = now%penetration > -maxval(now%penetration, mask=.not. qp%is_tied)
    working = working .or. abs(now%penetration) <= rounding*maxval(abs(now%penetration)) .or. qp%is_tied
  end subroutine screen_rows

  !> Whether so many rows are outside of a working set that a solution without them is worth looking at these again.
  pure logical function is_worth_screening(working)
    logical, intent(in) :: working(:)  !! Working set (n_rows).
    is_worth_screening = size(working) >= few_rows .and. count(.not. working) >= not_worth_screening*size(working)
  end function is_worth_screening

  !> Add rows that are violated to a working set, and those that the next solution may close.
  pure subroutine add_violated(penetration, violated, working)
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    logical, intent(in) :: violated(:)  !! Rows of which the greatest penetration counts (n_rows).
    logical, intent(inout) :: working(:)  !! Working set (n_rows).
    working = working .or. penetration > -near_violation*maxval([0.0_dp, pack(penetration, violated)])
  end subroutine add_violated

  !> Add rows to a working set that cannot carry the floating bodies.
  subroutine keep_what_carries(qp, working)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, intent(inout) :: working(:)  !! Working set (n_rows).
    type(contact_qp_t) :: part
    real(dp), allocatable :: motion(:), penetration(:)
    logical :: found
    integer :: k
    allocate (motion(qp%coarse%n), penetration(size(working)))
    do k = 1, most_widenings
      call restrict_qp(qp, working, part)
      call find_unbounded_direction(part, motion, found)
      if (.not. found) return
      ! Rows that the motion closes.
      call qp%mode_displacement(motion, penetration)
      if (.not. any(penetration > 0 .and. .not. working)) exit
      working = working .or. penetration > closing*maxval(penetration, mask=.not. qp%is_tied)
      if (all(working)) return
    end do
    working = .true.
  end subroutine keep_what_carries
end module dotyk_scheme_active_set
