!> Contact of distributed bodies: a proximal active set on the displacements (`dotyk_scheme_proximal_active_set` has the
!> method and its references), whose linear systems PETSc solves (`dotyk_distributed_system`). Any theta >= 0, held and
!> floating bodies.
!>
!> Unknown is the displacement of the free components; pressures, gaps and active sets are the same on all ranks. The
!> start is the solution without contact, and floating bodies at rest on a Winkler foundation. All rows are in the
!> system: no compliance of rows is formed, so that inactive ones cost nothing and none are screened.
!>
!> Where active rows do not restrain all motions of floating bodies, K + B^T W B is singular: these motions are taken
!> out of the residual and the iterates (`MatSetNullSpace`) where the loads do no work on them, and followed until rows
!> meet where they do. It ends by the bound of `dotyk_distributed_error_bound`.
module dotyk_distributed_contact
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: wall_time
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_distributed_contact_rows, only: without_rounding
  use dotyk_distributed_error_bound, only: error_of
  use dotyk_distributed_iterate, only: iterate_t
  use dotyk_distributed_linear_solver, only: solve_outcome_t
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_distributed_system, only: distributed_system_t
  use dotyk_ranks_exchange, only: meet
  use dotyk_scheme_active_set, only: is_balanced, rest_t => iterate_t, rest_on_winkler_foundation
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_free_motion, only: imbalance, meet_rows
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_primal_modes, only: balance
  use dotyk_scheme_proximal_active_set, only: best_step
  use dotyk_scheme_solver_state, only: ended_converged, ended_costly, ended_diverged, ended_interrupted, ended_limit, &
    ended_no_equilibrium, ended_rigid_constraint, ended_solves, ended_stalled, ended_unbalanced, solver_state_t
  implicit none
  private

  !> Contact of distributed bodies. Never copy or move it; destroy it in the end.
  type, public :: distributed_contact_t
    !> Stiffness of all bodies, numbered.
    type(distributed_stiffness_t), pointer :: stiffness => null()
    !> The linear systems.
    type(distributed_system_t) :: system
    !> Displacements of the own nodes along their axes, without prescribed ones (dim*n_own) [length].
    real(dp), allocatable :: u(:)
    !> Active sets so far.
    integer :: n_sets = 0
    !> Iterations of conjugate gradients at most, in all.
    integer :: most_iterations = huge(1)
    !> Weights (n_rows) [area].
    real(dp), allocatable, private :: weight(:)
    !> Gaps without the displacement by prescribed displacements (n_rows) [length].
    real(dp), allocatable, private :: gap(:)
  contains
    procedure :: init => contact_init
    procedure :: solve => contact_solve
    procedure :: destroy => contact_destroy
  end type distributed_contact_t

  !> Accuracy of the first linear system, without contact [].
  real(dp), parameter :: start_reduction = 1.0e-2_dp
  !> Residual of the next linear system as fractions of the last residual and of the last change of the pressures.
  real(dp), parameter :: of_residual = 1.0e-4_dp, of_change = 1.0e-3_dp
  !> Accuracy asked for first, as a fraction of the tolerance, and the factor of the next one [].
  real(dp), parameter :: first_share = 0.2_dp, next_share = 0.05_dp
  !> Accuracy that is asked for at least; and with floating bodies, so that forces balance their loads [].
  real(dp), parameter :: least_accuracy = 1.0e-4_dp, accuracy_of_floating = 1.0e-8_dp
  !> Bounds, or errors, that fall by less than this factor end the attempts.
  real(dp), parameter :: least_gain = 0.7_dp
  !> How often a bound above the tolerance is followed by a more accurate solution.
  integer, parameter :: most_attempts = 5
  !> Linear systems before which errors that do not fall are no reason to end; iterations of one at most.
  integer, parameter :: least_sets = 5, most_iterations = 500
  !> Rows between held nodes that penetrate by less, relative to the largest gap, touch.
  real(dp), parameter :: rounding = 1.0e-12_dp

contains

  !> Make the systems.
  subroutine contact_init(self, stiffness, operator, error)
    class(distributed_contact_t), target, intent(inout) :: self
    !> Stiffness of all bodies; lives longer.
    type(distributed_stiffness_t), target, intent(inout) :: stiffness
    !> Rows of B, weights and gaps of all bodies, the same on all ranks.
    type(contact_operator_t), intent(in) :: operator
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    self%stiffness => stiffness
    call self%system%init(stiffness, operator%n_rows, without_rounding(operator%block), error)
    if (allocated(error)) return
    self%weight = operator%weight
    self%gap = operator%gap - self%system%prescribed()
    allocate (self%u(self%system%n), source=0.0_dp)
  end subroutine contact_init

  !> Solve.
  subroutine contact_solve(self, theta, tolerance, most_sets, monitor, state, error, qp)
    class(distributed_contact_t), target, intent(inout) :: self
    !> Penalty parameters, at least 0 (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Bound of the relative error in the energy norm to end at [].
    real(dp), intent(in) :: tolerance
    !> Active sets at most.
    integer, intent(in) :: most_sets
    !> Gets each solution with its bound.
    class(monitor_t), intent(inout) :: monitor
    !> Where to begin if it has pressures; pressures, penetrations, energy and bound on return, none of them where the
    !> iterations are too many.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where numbers are not finite, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    !> Its rigid body modes: pressures are balanced with the loads on them, and there is no bound for those that are
    !> not.
    type(contact_qp_t), intent(in), optional :: qp
    type(iterate_t) :: now
    real(dp), allocatable :: r(:), e(:), lambda(:), at_rest(:)
    logical :: balanced
    real(dp) :: accuracy, last, start, bound
    integer :: attempt, mode
    start = wall_time()
    allocate (r(self%system%n), e(self%system%n), lambda(size(theta)), now%y(size(theta)), now%shifted(size(theta)))
    call begin(self, theta, state, now, r, e, error, qp)
    if (allocated(error) .or. state%ended == ended_rigid_constraint) return
    accuracy = min(first_share*tolerance, least_accuracy)
    if (size(self%stiffness%mode, 2) > 0) accuracy = min(accuracy, accuracy_of_floating)
    balanced = .true.
    last = huge(last)
    do attempt = 1, most_attempts
      call iterate(self, theta, accuracy, most_sets, state%m, now, r, e, state%ended, error)
      if (allocated(error) .or. state%ended == ended_costly) return
      if (present(qp)) call balance(qp, state%m)
      lambda = self%weight*state%m
      state%y = now%y - self%gap
      if (present(qp)) then
        at_rest = [(0.0_dp, mode=1, qp%coarse%n)]
        balanced = is_balanced(qp, theta, lambda, at_rest)
      end if
      call error_of(self%system, self%weight, theta, lambda, state%y, self%u, r, bound, state%energy, &
                    state%terms)
      state%error_bound = huge(bound)
      if (bound < huge(bound) .and. balanced) state%error_bound = bound/max(now%norm, tiny(bound))
      state%max_penetration = maxval([0.0_dp, state%y])
      call state%history%add(wall_time() - start, now%change, now%change/max(now%norm, tiny(bound)), &
                             state%error_bound, state%energy, state%max_penetration, count(lambda > 0))
      call monitor%step(state%history, tolerance, state%error_bound)
      if (state%error_bound <= tolerance .and. any(state%ended == [ended_stalled, ended_limit, ended_interrupted])) &
        state%ended = ended_converged
      if (state%error_bound <= tolerance .or. all(state%ended /= [ended_converged, ended_stalled])) exit
      if (last < huge(last) .and. .not. state%error_bound < least_gain*last) exit
      last = state%error_bound
      accuracy = next_share*accuracy
    end do
    if (state%ended == ended_converged .and. state%error_bound > tolerance) state%ended = ended_solves
    ! Whether contact can balance the loads at all was asked before.
    if (state%ended == ended_no_equilibrium) state%ended = ended_solves
    if (any(state%ended == [ended_solves, ended_stalled]) .and. .not. balanced) state%ended = ended_unbalanced
    call state%history%finish()
    state%iterations = state%history%n
    state%bound_is_guaranteed = .false.
  end subroutine contact_solve

  !> The start: displacements without contact, and the rows that they close; floating bodies at rest on a Winkler
  !> foundation.
  subroutine begin(self, theta, state, now, r, e, error, qp)
    !> The problem; gets displacements.
    class(distributed_contact_t), intent(inout) :: self
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Gets pressures unless it has some.
    type(solver_state_t), intent(inout) :: state
    !> The iterate.
    type(iterate_t), intent(inout) :: now
    !> Work arrays (n).
    real(dp), intent(inout), contiguous :: r(:), e(:)
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    !> Initial penetrations and rigid body modes.
    type(contact_qp_t), intent(in), optional :: qp
    type(rest_t) :: rest
    type(solve_outcome_t) :: outcome
    real(dp), allocatable :: resultant(:)
    real(dp) :: compliance(size(theta))
    logical :: follows
    compliance = self%system%row_compliance()
    call now%init(theta, self%weight*compliance)
    if (any(.not. (compliance > 0 .or. theta > 0) .and. self%gap < -rounding*maxval(abs(self%gap)))) then
      state%ended = ended_rigid_constraint
      return
    end if
    ! With pressures of an earlier solve its displacements are the start.
    follows = allocated(state%m) .and. self%n_sets > 0
    if (.not. follows) then
      r = self%stiffness%load
      call self%system%remove_modes(r, resultant)
      call self%system%solve_alone(r, start_reduction, most_iterations, e, outcome, error)
      if (allocated(error)) return
      self%u(:) = e
    end if
    call self%system%row_displacement(self%u, now%y)
    now%active = now%y > self%gap
    if (present(qp) .and. .not. follows) then
      ! Without motions of floating bodies the rows that they close are far from the solution, and active sets many.
      if (qp%coarse%n > 0) then
        call rest_on_winkler_foundation(qp, theta, rest, now%active)
        self%u(:) = self%u + matmul(self%stiffness%mode, qp%coarse%scale*rest%alpha)
      end if
    end if
    if (allocated(state%m)) then
      now%active = state%m > 0
    else
      allocate (state%m(size(theta)), source=0.0_dp)
    end if
  end subroutine begin

  !> Iterate to an accuracy, from pressures m.
  subroutine iterate(self, theta, accuracy, most_sets, m, now, r, e, ended, error)
    !> The problem with its displacements.
    class(distributed_contact_t), intent(inout) :: self
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Relative error of the displacements in the energy norm to end at, estimated [].
    real(dp), intent(in) :: accuracy
    !> Active sets at most.
    integer, intent(in) :: most_sets
    !> Pressures (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> The iterate.
    type(iterate_t), intent(inout) :: now
    !> Work arrays (n).
    real(dp), intent(inout), contiguous :: r(:), e(:)
    !> Why it ended: one of `ended_*`.
    integer, intent(out) :: ended
    !> Allocated where numbers are not finite, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    type(solve_outcome_t) :: outcome
    real(dp), allocatable :: next(:), along(:)
    logical, allocatable :: new(:)
    real(dp) :: t, last, left
    logical :: moved
    integer :: n_before
    allocate (along(size(m)))
    last = huge(last)
    ended = ended_limit
    n_before = self%n_sets
    do while (self%n_sets < most_sets)
      self%n_sets = self%n_sets + 1
      call self%system%set_active(merge(self%weight/now%softness, 0.0_dp, now%active), error)
      if (allocated(error)) return
      now%shifted = self%gap - now%prox*m
      call find_residual(self, now, r)
      if (size(self%system%free_mode, 2) > 0) then
        call follow_free_motion(self, r, now, moved, ended)
        if (ended == ended_no_equilibrium) exit
        if (moved) cycle
      end if
      call self%system%solve(r, now%aim*now%norm, merge(most_iterations, 1, now%norm > 0), e, outcome, error)
      if (allocated(error)) return
      if (self%system%n_iterations > self%most_iterations) then
        ended = ended_costly
        exit
      end if
      now%residual = outcome%residual
      if (.not. now%residual <= huge(t) .or. outcome%has_failed) then
        ended = ended_diverged
        exit
      end if
      call self%system%row_displacement(e, along)
      t = 1
      if (now%guarded) t = best_step(merge(self%weight/now%softness, 0.0_dp, now%active), self%weight/now%softness, &
                                     now%y - now%shifted, along, self%system%product(r, e))
      self%u(:) = self%u + t*e
      now%y = now%y + t*along
      new = now%y - now%shifted > 0
      next = merge((now%y - now%shifted)/now%softness, 0.0_dp, new)
      now%change = sqrt(sum(self%weight*now%prox*(next - m)**2))
      if (all(new .eqv. now%active) .and. (now%norm > 0 .or. .not. outcome%residual > 0)) then
        m(:) = next
        left = max(now%residual, now%change)
        if (left <= accuracy*now%norm) ended = ended_converged
        if (ended == ended_limit .and. .not. left < least_gain*last .and. now%aim <= accuracy .and. &
            self%n_sets - n_before > least_sets) ended = ended_stalled
        last = left
        now%aim = max(accuracy/2, max(of_residual*now%residual, of_change*now%change)/max(now%norm, tiny(t)))
        now%guarded = .false.
        now%seen = [real(dp) ::]
        if (ended /= ended_limit) exit
      else
        call now%look_for_cycles(theta, self%weight*self%system%row_compliance(), self%gap, m, accuracy, new)
      end if
      now%active = new
      if (any_interrupted()) then
        ended = ended_interrupted
        exit
      end if
    end do
  end subroutine iterate

  !> The residual f - K u - B^T W (B u - d + prox m_0), the norm of u and B u.
  subroutine find_residual(self, now, r)
    !> The problem with its displacements.
    class(distributed_contact_t), intent(inout) :: self
    !> The iterate; gets norm and y.
    type(iterate_t), intent(inout) :: now
    !> (n) [force]
    real(dp), intent(inout), contiguous :: r(:)
    call self%system%strain_forces(self%u, r)
    now%norm = sqrt(max(0.0_dp, self%system%product(self%u, r) + 2*self%system%product(self%u, self%stiffness%lift) + &
                        2*self%stiffness%lift_energy))
    r(:) = self%stiffness%load - r
    call self%system%row_displacement(self%u, now%y)
    call self%system%subtract_row_force(merge(self%weight/now%softness, 0.0_dp, now%active)*(now%y - now%shifted), r)
  end subroutine find_residual

  !> Follow motions that the active rows do not restrain and the loads excite until rows meet; take out the others.
  subroutine follow_free_motion(self, r, now, moved, ended)
    !> The problem; its displacements move.
    class(distributed_contact_t), intent(inout) :: self
    !> Residual; without resultants on indeterminate modes on return (n) [force].
    real(dp), intent(inout), contiguous :: r(:)
    !> The iterate; rows that meet become active.
    type(iterate_t), intent(inout) :: now
    !> Whether bodies have moved.
    logical, intent(out) :: moved
    !> Set to `ended_no_equilibrium` where no row stops the motion.
    integer, intent(inout) :: ended
    real(dp), allocatable :: resultant(:), amplitude(:)
    real(dp) :: scale, first
    scale = sqrt(max(self%system%product(self%stiffness%load, self%stiffness%load), self%system%product(r, r)))
    call self%system%remove_motions(self%system%free_mode, r, resultant)
    where (abs(resultant) <= imbalance*scale) resultant = 0
    moved = any(abs(resultant) > 0)
    if (.not. moved) return
    amplitude = matmul(self%system%free_mode, resultant)
    call meet_rows(matmul(self%system%row_mode, amplitude), now%shifted - now%y, now%active, first, ended)
    self%u(:) = self%u + first*matmul(self%stiffness%mode, amplitude)
  end subroutine follow_free_motion

  !> Whether a rank was asked to stop.
  logical function any_interrupted() result(is_interrupted)
    call meet()
    is_interrupted = interrupted()
  end function any_interrupted

  !> Give back the memory; the stiffness remains.
  subroutine contact_destroy(self)
    class(distributed_contact_t), intent(inout) :: self
    call self%system%destroy()
    if (allocated(self%u)) deallocate (self%u)
  end subroutine contact_destroy
end module dotyk_distributed_contact
