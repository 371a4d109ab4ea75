!> Contact of all bodies by a proximal active set on the displacements (`dotyk_scheme_proximal_system`): no
!> compliance of the bodies.
!>
!> The proximal point method for the pressures (R. T. Rockafellar, SIAM J. Control Optim. 14, 1976) asks for the
!> minimizer u, given pressures m_0, of the energy with
!>
!>     m = max(0, (B u - d + prox m_0)/(theta + prox)),
!>
!> then sets m_0 := m. Its limit is the solution for theta, also for theta = 0, and its linear systems
!> `K + B^T W B` on the active rows, W = w/(theta + prox), are regular in each step. The same steps move the feet of the
!> springs on motions of floating bodies (`dotyk_scheme_proximal_motion`), which are one more proximal term. Neither the
!> active set nor pressures m_0 and feet wait for exact solutions of the linear systems.
!>
!> Tied rows are active in each set, with forces of any sign: they are rows of the same proximal point method.
!>
!> Active sets that come again are no progress: from then on the linear systems are solved more accurately, and the step
!> is the minimum of the energy along its direction, until the set stays. The energy is convex and piecewise quadratic:
!> such steps end (M. Hintermueller, K. Ito and K. Kunisch, SIAM J. Optim. 13, 2002, without them).
module dotyk_scheme_proximal_active_set
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: golden, half_digits, least_gain, rough, rounding
  use dotyk_scheme_active_set, only: foundation_stiffness
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_line_search, only: line_minimum
  use dotyk_scheme_proximal_motion, only: proximal_motion_t
  use dotyk_scheme_proximal_system, only: proximal_system_t, solve_outcome_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_costly, ended_diverged, ended_interrupted, ended_limit, &
    ended_rigid_constraint, ended_stalled
  implicit none
  private
  public :: best_step, solve_proximal

  type, public :: proximal_outcome_t  !! How the iteration went.
    integer :: steps = 0, cg_steps = 0  !! Linear systems, and their iterations in all.
    logical :: converged = .false.  !! Whether the active set, the pressures m_0 and the displacements are converged.
    !> Why it ended: one of `ended_*` of `dotyk_scheme_solver_state`. Not converged, the last iterate is returned.
    integer :: ended = ended_limit
    !> Last residual in the norm of the preconditioner, about the error in the energy norm [sqrt(energy)].
    real(dp) :: residual = 0
    real(dp) :: change = 0  !! Last change of the pressures, sqrt(sum w prox change^2) [sqrt(energy)].
    real(dp) :: norm = 0  !! Energy norm of the displacements before the last step [sqrt(energy)].
    integer :: n_cycles = 0  !! How often an active set came again.
  end type proximal_outcome_t

  type :: iterate_t  !! An iterate.
    real(dp), allocatable :: prox(:), softness(:)  !! prox of each row, and theta + prox (n_rows) [length/pressure].
    real(dp), allocatable :: y(:), shifted(:)  !! B u, and d - prox m_0 (n_rows) [length].
    logical, allocatable :: active(:)  !! The active set of the linear system (n_rows).
    real(dp) :: aim = 0  !! Relative residual of the next linear system [].
    logical :: guarded = .false.  !! Whether steps are minima along their directions.
    real(dp), allocatable :: seen(:)  !! Marks of the active sets since the pressures m_0 changed.
  end type iterate_t

  !> Factor of the relative residual at which the active set is judged, where a set comes again. prox grows by the
  !> inverse where it does although steps are minima, up to the compliance of the row.
  real(dp), parameter :: closer_aim = 0.1_dp
  !> Active sets without a repetition after which the linear systems are solved more accurately, too.
  integer, parameter :: many_sets = 5
  !> Residual of the next linear system as fractions of the last residual and of the last change of the pressures, where
  !> the set has stayed.
  real(dp), parameter :: of_residual = 1.0e-4_dp, of_change = 1.0e-3_dp
  integer, parameter :: least_steps = 5  !! Linear systems before which errors that do not fall are no reason to end.
  integer, parameter :: most_iterations = 500  !! Iterations of one linear system at most.

contains

  !> Solve, from pressures m and displacements u.
  subroutine solve_proximal(system, qp, gap, load, tolerance, most_steps, motion, pressure, u, outcome, error)
    class(proximal_system_t), target, intent(inout) :: system  !! The bodies and rows; its active set is changed.
    type(contact_qp_t), intent(in) :: qp  !! The same rows, with weights and the rigid body modes of the bodies.
    !> d, less the displacement of the rows by prescribed displacements (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Loads and forces of prescribed displacements, over the unknowns of the system (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Relative error of the displacements in the energy norm to end at, estimated [].
    real(dp), intent(in) :: tolerance
    integer, intent(in) :: most_steps  !! Greatest number of linear systems.
    !> Springs on motions of floating bodies.
    type(proximal_motion_t), intent(inout) :: motion
    !> Pressures: those that start the active set, then the solution (n_rows) [pressure].
    real(dp), intent(inout) :: pressure(:)
    !> Displacements of the free unknowns: start, then solution (n) [length].
    real(dp), intent(inout), contiguous :: u(:)
    type(proximal_outcome_t), intent(out) :: outcome  !! Steps and convergence.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where numbers are not finite, or PETSc fails.
    type(solve_outcome_t) :: solve
    type(iterate_t) :: now
    type(proximal_motion_t) :: moved
    real(dp), allocatable :: r(:), e(:), next(:), along(:), foundation(:), compliance(:), alpha(:)
    logical, allocatable :: new(:)
    real(dp) :: t, last, left
    logical :: at_rest, diverged
    integer :: n_before
    compliance = qp%weight*system%row_compliance()
    if (any(system%is_rigid_row() .and. .not. qp%theta > 0 .and. merge(-abs(gap), gap, qp%is_tied) < &
            -rounding*maxval(abs(gap)))) then
      outcome%ended = ended_rigid_constraint
      return
    end if
    ! Rows between held nodes have no compliance of their own.
    left = maxval([0.0_dp, compliance])
    if (.not. left > 0) left = 1
    compliance = max(compliance, system%proximal_fraction*left)
    allocate (r(system%n), next(size(pressure)), along(size(pressure)), now%y(size(pressure)), now%seen(0))
    allocate (e(system%n), source=0.0_dp)
    now%prox = max(0.0_dp, system%proximal_fraction*compliance - qp%theta)
    now%active = pressure > 0 .or. qp%is_tied
    now%aim = rough
    last = huge(last)
    foundation = foundation_stiffness(qp)
    do while (outcome%steps < most_steps)
      outcome%steps = outcome%steps + 1
      now%softness = qp%theta + now%prox
      call system%set_active(merge(qp%weight/now%softness, 0.0_dp, now%active), springs_of(motion, qp), error)
      if (allocated(error)) return
      now%shifted = gap - now%prox*pressure
      call find_residual(system, load, now%shifted, motion%centre*qp%coarse%scale, u, r, now%y, outcome%norm)
      n_before = system%n_iterations
      ! Without displacements no norm is known yet: one iteration.
      call system%solve(r, now%aim*outcome%norm, merge(most_iterations, 1, outcome%norm > 0), e, solve, error)
      if (allocated(error)) return
      outcome%cg_steps = outcome%cg_steps + system%n_iterations - n_before
      if (system%n_iterations > system%most_iterations) then
        outcome%ended = ended_costly
        exit
      end if
      outcome%residual = solve%residual
      diverged = has_failed(system, solve, r, load)
      if (diverged) then
        outcome%ended = ended_diverged
        exit
      end if
      call system%row_displacement(e, along)
      t = 1
      if (now%guarded) t = best_step(system%stiffness, qp%weight/now%softness, qp%is_tied, now%y - now%shifted, &
                                     along, system%product(r, e))
      u(:) = u + t*e
      now%y = now%y + t*along
      new = now%y - now%shifted > 0 .or. qp%is_tied
      next(:) = merge((now%y - now%shifted)/now%softness, 0.0_dp, new)
      outcome%change = sqrt(sum(qp%weight*now%prox*(next - pressure)**2))
      ! Not after the first iteration, unless nothing moves.
      if (all(new .eqv. now%active) .and. (outcome%norm > 0 .or. .not. outcome%residual > 0)) then
        pressure(:) = next
        alpha = system%resultants(u)/qp%coarse%scale
        ! Feet that are to stay wait for the pressures.
        moved = motion
        call moved%advance(qp, foundation, qp%weight*pressure, alpha, new, at_rest)
        left = max(outcome%residual, outcome%change)
        outcome%converged = at_rest .and. left <= tolerance*outcome%norm
        if (outcome%converged) outcome%ended = ended_converged
        if (at_rest .and. .not. (outcome%converged .or. left < least_gain*last) .and. now%aim <= tolerance .and. &
            outcome%steps > least_steps) outcome%ended = ended_stalled
        if (.not. at_rest .or. outcome%ended /= ended_limit) motion = moved
        if (outcome%ended /= ended_limit) exit
        last = left
        now%aim = max(tolerance/2, max(of_residual*outcome%residual, of_change*outcome%change)/ &
                      max(outcome%norm, tiny(t)))
        now%guarded = .false.
        now%seen = [real(dp) ::]
      else
        call look_for_cycles(compliance, gap, pressure, tolerance, qp%is_tied, new, now, outcome%n_cycles)
      end if
      now%active = new
      if (system%is_interrupted()) then
        outcome%ended = ended_interrupted
        exit
      end if
    end do
  end subroutine solve_proximal

  !> T on the amplitudes of the orthonormal modes.
  pure function springs_of(motion, qp) result(spring)
    type(proximal_motion_t), intent(in) :: motion  !! T on those of the QP.
    type(contact_qp_t), intent(in) :: qp  !! With the scales of the modes.
    type(mode_block_t) :: spring(size(motion%stiffness))  !! (n_bodies) [force/length]
    integer :: b, n
    do b = 1, size(spring)
      associate (scale => qp%coarse%scale(qp%coarse%first(b):qp%coarse%first(b + 1) - 1))
        n = size(scale)
        ! Bodies that ties hold have no springs.
        allocate (spring(b)%value(n, n), source=0.0_dp)
        if (size(motion%stiffness(b)%value) > 0) &
          spring(b)%value = motion%stiffness(b)%value/(spread(scale, 1, n)*spread(scale, 2, n))
      end associate
    end do
  end function springs_of

  !> Whether a solve has failed: numbers are not finite, or the preconditioner is not positive, and the right-hand side
  !> more than rounding.
  logical function has_failed(system, solve, r, load)
    class(proximal_system_t), intent(in) :: system  !! The bodies.
    type(solve_outcome_t), intent(in) :: solve  !! How the solve went.
    real(dp), intent(in), contiguous :: r(:)  !! Right-hand side, the residual of the iterate (n) [force].
    real(dp), intent(in), contiguous :: load(:)  !! Loads (n) [force].
    has_failed = .not. solve%residual <= huge(solve%residual)
    if (solve%has_failed) has_failed = .not. system%product(r, r) <= half_digits**2* &
      max(system%product(load, load), system%product(load - r, load - r))
  end function has_failed

  !> Whether an active set has come again, and what to do about it.
  subroutine look_for_cycles(compliance, gap, pressure, tolerance, is_tied, new, now, n_cycles)
    real(dp), intent(in) :: compliance(:)  !! Of the rows, positive (n_rows) [length/pressure].
    real(dp), intent(in) :: gap(:), pressure(:), tolerance  !! As in `solve_proximal`.
    logical, intent(in) :: is_tied(:)  !! Rows that are always active (n_rows).
    logical, intent(inout) :: new(:)  !! The next active set; changed where prox is (n_rows).
    type(iterate_t), intent(inout) :: now  !! The iterate.
    integer, intent(inout) :: n_cycles  !! How often sets came again.
    real(dp) :: mark
    mark = mark_of_set(new)
    if (.not. any(abs(now%seen - mark) <= 0)) then
      now%seen = [now%seen, mark]
      ! Among many rows, sets that errors of the solutions change need not come again.
      if (modulo(size(now%seen), many_sets) == 0) now%aim = max(tolerance/2, closer_aim*now%aim)
      return
    end if
    n_cycles = n_cycles + 1
    now%aim = max(tolerance/2, closer_aim*now%aim)
    now%seen = [real(dp) ::]
    if (now%guarded) then
      where (.not. is_tied) now%prox = max(now%prox, min(now%prox/closer_aim, compliance))
      now%shifted = gap - now%prox*pressure
      new = now%y - now%shifted > 0 .or. is_tied
    end if
    now%guarded = .true.
  end subroutine look_for_cycles

  !> A number that tells active sets apart.
  pure real(dp) function mark_of_set(active) result(mark)
    logical, intent(in) :: active(:)  !! (n_rows)
    integer :: i
    mark = sum([(modulo(i*golden, 1.0_dp), i=1, size(active))], mask=active)
  end function mark_of_set

  !> The minimum of the energy along a step e.
  pure real(dp) function best_step(active_stiffness, stiffness, is_tied, over, along, work) result(t)
    real(dp), intent(in) :: active_stiffness(:)  !! W of the active rows (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)  !! w/(theta + prox) of all rows (n_rows) [force/length].
    logical, intent(in) :: is_tied(:)  !! Rows of ties, which pull, too (n_rows).
    real(dp), intent(in) :: over(:)  !! B u - d + prox m_0 (n_rows) [length].
    real(dp), intent(in) :: along(:)  !! B e (n_rows) [length].
    !> r . e with the residual r of the linear system, which is e . (K + B^T W B) e, too [energy].
    real(dp), intent(in) :: work
    real(dp) :: of_ties, curvature
    t = 1
    if (.not. work > 0) return
    of_ties = sum(stiffness*over*along, mask=is_tied)
    curvature = max(0.0_dp, work - sum(active_stiffness*along**2)) + sum(stiffness*along**2, mask=is_tied)
    t = line_minimum(of_ties - work - sum(active_stiffness*over*along), curvature, &
                     merge(0.0_dp, stiffness, is_tied), over, along)
    ! Rounding may leave no curvature.
    if (.not. t < huge(t)) t = 1
  end function best_step

  !> The residual f - K u - B^T W (B u - d + prox m_0) - R T (R^T u - alpha_k), and the norm of u.
  subroutine find_residual(system, load, shifted, centre, u, r, y, norm)
    class(proximal_system_t), intent(in) :: system  !! The bodies, the active rows and the springs.
    real(dp), intent(in), contiguous :: load(:)  !! f (n) [force].
    real(dp), intent(in) :: shifted(:)  !! d - prox m_0 (n_rows) [length].
    real(dp), intent(in) :: centre(:)  !! alpha_k, of orthonormal modes (n_modes) [length].
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(out), contiguous :: r(:)  !! Residual (n) [force].
    real(dp), intent(out) :: y(:)  !! B u (n_rows) [length].
    real(dp), intent(out) :: norm  !! Energy norm of u [sqrt(energy)].
    call system%strain_forces(u, r)
    norm = system%energy_norm(u, r)
    r(:) = load - r
    call system%row_displacement(u, y)
    call system%subtract_row_force(system%stiffness*(y - shifted), r)
    if (size(centre) > 0) call system%add_modes(system%spring_force(centre - system%resultants(u)), r)
  end subroutine find_residual
end module dotyk_scheme_proximal_active_set
