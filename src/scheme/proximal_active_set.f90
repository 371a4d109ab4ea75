!> Contact of all bodies by a proximal active set on the displacements: conjugate gradients with a p-multigrid that
!> knows the active rows (`dotyk_scheme_contact_multigrid`), no compliance of the bodies.
!>
!> The proximal point method for the pressures (R. T. Rockafellar, SIAM J. Control Optim. 14, 1976) asks for the
!> minimizer u, given pressures m_0, of the energy with
!>
!>     m = max(0, (B u - d + prox m_0)/(theta + prox)),
!>
!> then sets m_0 := m. Its limit is the solution for theta, also for theta = 0, and its linear systems
!> `K + B^T W B` on the active rows, W = w/(theta + prox), are regular in each step. Neither the active set nor the
!> pressures m_0 wait for exact solutions of the linear systems.
!>
!> Active sets that come again are no progress: from then on the linear systems are solved more accurately, and the step
!> is the minimum of the energy along its direction, until the set stays. The energy is convex and piecewise quadratic:
!> such steps end (M. Hintermueller, K. Ito and K. Kunisch, SIAM J. Optim. 13, 2002, without them). Motions that no
!> active row restrains, and the loads excite, go on until rows meet.
module dotyk_scheme_proximal_active_set
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_linalg_fixed_sum, only: add_multiple, scalar_product
  use dotyk_scheme_contact_multigrid, only: contact_multigrid_t
  use dotyk_scheme_free_motion, only: follow_free_motion
  use dotyk_scheme_solver_state, only: ended_converged, ended_diverged, ended_interrupted, ended_limit, &
    ended_no_equilibrium, ended_rigid_constraint, ended_stalled
  implicit none
  private
  public :: best_step, solve_proximal, mark_of_set

  !> How the iteration went.
  type, public :: proximal_outcome_t
    !> Linear systems, and iterations of conjugate gradients in all.
    integer :: steps = 0, cg_steps = 0
    !> Cycles of p-multigrid.
    integer :: cycles = 0
    !> Whether the active set, the pressures m_0 and the displacements are converged.
    logical :: converged = .false.
    !> Why it ended: one of `ended_*` of `dotyk_scheme_solver_state`. Not converged, the last iterate is returned.
    integer :: ended = ended_limit
    !> Last residual in the norm of the preconditioner, about the error in the energy norm [sqrt(energy)].
    real(dp) :: residual = 0
    !> Last change of the pressures, sqrt(sum w prox change^2) [sqrt(energy)].
    real(dp) :: change = 0
    !> Motions of bodies that the active rows do not restrain.
    integer :: n_free_modes = 0
    !> How often an active set came again.
    integer :: n_cycles = 0
  end type proximal_outcome_t

  !> An iterate.
  type :: iterate_t
    !> prox (n_rows) [length/pressure].
    real(dp), allocatable :: prox(:)
    !> B u, and d - prox m_0 (n_rows) [length].
    real(dp), allocatable :: y(:), shifted(:)
    !> The active set of the linear system (n_rows).
    logical, allocatable :: active(:)
    !> Relative residual of the next linear system [].
    real(dp) :: aim = 0
    !> Whether steps are minima along their directions.
    logical :: guarded = .false.
    !> Marks of the active sets since the pressures m_0 changed.
    real(dp), allocatable :: seen(:)
  end type iterate_t

  !> prox as a fraction of the compliance that rows have in the corner space. Smaller ones converge in fewer proximal
  !> steps, and lose more digits of B u in the pressures.
  real(dp), parameter :: proximal_fraction = 1.0e-4_dp
  !> prox grows by this factor where active sets come again although steps are minima, up to `greatest_fraction` of the
  !> compliance.
  real(dp), parameter :: growth = 10, greatest_fraction = 0.1_dp
  !> Residual, relative, at which the active set is judged the first time, and its factor where a set comes again.
  real(dp), parameter :: first_aim = 0.01_dp, closer_aim = 0.1_dp
  !> Active sets without a repetition after which the linear systems are solved more accurately, too.
  integer, parameter :: many_sets = 5
  !> Residual of the next linear system as fractions of the last residual and of the last change of the pressures, where
  !> the set has stayed.
  real(dp), parameter :: of_residual = 1.0e-4_dp, of_change = 1.0e-3_dp
  !> Errors that fall by less than this factor, with the same active set, have reached rounding.
  real(dp), parameter :: least_gain = 0.7_dp
  !> Linear systems before which errors that do not fall are no reason to end.
  integer, parameter :: least_steps = 5
  !> Rows without free unknowns that penetrate by less, relative to the largest gap, touch.
  real(dp), parameter :: rounding = 1.0e-12_dp
  !> Residuals that are smaller, relative to the forces that balance, are rounding.
  real(dp), parameter :: no_residual = 1.0e-9_dp
  !> Iterations of one linear system at most.
  integer, parameter :: most_iterations = 200
  !> Fractions of its multiples tell sets of rows apart.
  real(dp), parameter :: golden = 0.6180339887498949_dp

contains

  !> Solve, from pressures m and displacements u.
  subroutine solve_proximal(system, weight, gap, theta, load, tolerance, most_steps, m, u, outcome, error, norm_0)
    !> The bodies and rows; its active set is changed.
    class(contact_multigrid_t), intent(inout) :: system
    !> Weights w (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> d, less the displacement of the rows by prescribed displacements (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Penalty parameters, zero or positive (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Loads and forces of prescribed displacements, over the unknowns of the system (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Relative error of the displacements in the energy norm to end at, estimated [].
    real(dp), intent(in) :: tolerance
    !> Greatest number of linear systems.
    integer, intent(in) :: most_steps
    !> Pressures: those that start the active set, then the solution (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> Displacements of the free unknowns: start, then solution (n) [length].
    real(dp), intent(inout), contiguous :: u(:)
    !> Steps and convergence.
    type(proximal_outcome_t), intent(out) :: outcome
    !> Allocated where numbers are not finite.
    type(error_t), allocatable, intent(out) :: error
    !> Energy norm of a displacement that u is added to: the sum is not less than the difference of the norms; 0 if
    !> absent [sqrt(energy)].
    real(dp), intent(in), optional :: norm_0
    type(cg_outcome_t) :: cg
    type(iterate_t) :: now
    real(dp), allocatable :: r(:), e(:), next(:), along(:)
    logical, allocatable :: new(:)
    real(dp) :: norm, t, last
    logical :: moved
    allocate (r(system%n), e(system%n), next(size(m)), along(size(m)), now%y(size(m)), now%seen(0))
    now%prox = max(0.0_dp, proximal_term(system, weight) - theta)
    now%active = m > 0
    now%aim = first_aim
    last = huge(last)
    if (any(system%is_rigid_row() .and. .not. theta > 0 .and. gap < -rounding*maxval(abs(gap)))) then
      outcome%ended = ended_rigid_constraint
      return
    end if
    do while (outcome%steps < most_steps)
      outcome%steps = outcome%steps + 1
      call set_active(system, weight, theta + now%prox, now%active, error)
      if (allocated(error)) return
      now%shifted = gap - now%prox*m
      call find_residual(system, load, now%shifted, u, r, now%y, norm)
      if (present(norm_0)) norm = max(norm, norm_0 - norm)
      outcome%n_free_modes = system%n_free_modes()
      if (outcome%n_free_modes > 0) then
        call follow_free_motion(system, load, r, now%shifted - now%y, now%active, u, moved, outcome%ended)
        if (outcome%ended == ended_no_equilibrium) exit
        if (moved) cycle
        call system%remove_free_motions(r)
      end if
      ! Without displacements no norm is known yet: one cycle.
      call conjugate_gradient(system, r, e, 0.0_dp, merge(most_iterations, 1, norm > 0), cg, now%aim*norm)
      outcome%cg_steps = outcome%cg_steps + cg%steps
      outcome%cycles = outcome%cycles + cg%steps + 1
      outcome%residual = cg%reduction*cg%first_norm
      if (.not. outcome%residual <= huge(norm) .or. is_indefinite(cg%first_norm, r, load)) then
        outcome%ended = ended_diverged
        exit
      end if
      call system%row_displacement(e, along)
      t = 1
      if (now%guarded) t = best_step(system%stiffness, weight/(theta + now%prox), now%y - now%shifted, along, &
                                     scalar_product(system%n, r, e))
      call add_multiple(system%n, t, e, u)
      now%y = now%y + t*along
      new = now%y - now%shifted > 0
      next(:) = merge((now%y - now%shifted)/(theta + now%prox), 0.0_dp, new)
      outcome%change = sqrt(sum(weight*now%prox*(next - m)**2))
      ! Not after the first cycle, unless nothing moves.
      if (all(new .eqv. now%active) .and. (norm > 0 .or. .not. cg%first_norm > 0)) then
        m(:) = next
        associate (left => max(outcome%residual, outcome%change))
          outcome%converged = left <= tolerance*norm
          if (outcome%converged) outcome%ended = ended_converged
          if (.not. left < least_gain*last .and. now%aim <= tolerance .and. outcome%steps > least_steps) &
            outcome%ended = ended_stalled
          if (outcome%ended /= ended_limit) exit
          last = left
          now%aim = max(tolerance/2, max(of_residual*outcome%residual, of_change*outcome%change)/max(norm, tiny(norm)))
        end associate
        now%guarded = .false.
        now%seen = [real(dp) ::]
      else
        call look_for_cycles(system, weight, theta, gap, m, tolerance, new, now, outcome%n_cycles)
      end if
      now%active = new
      if (interrupted()) then
        outcome%ended = ended_interrupted
        exit
      end if
    end do
  end subroutine solve_proximal

  !> Whether a residual has no norm: the preconditioner is not positive, by rounding, and no zero is a small one.
  pure logical function is_indefinite(first_norm, r, load)
    !> Its norm [sqrt(energy)].
    real(dp), intent(in) :: first_norm
    !> The residual (n) [force].
    real(dp), intent(in) :: r(:)
    !> Loads (n) [force].
    real(dp), intent(in) :: load(:)
    is_indefinite = .not. first_norm > 0
    if (is_indefinite) is_indefinite = maxval(abs(r)) > no_residual*max(maxval(abs(load)), maxval(abs(load - r)))
  end function is_indefinite

  !> Whether an active set has come again, and what to do about it.
  subroutine look_for_cycles(system, weight, theta, gap, m, tolerance, new, now, n_cycles)
    !> The bodies and rows.
    class(contact_multigrid_t), intent(in) :: system
    !> As in `solve_proximal`.
    real(dp), intent(in) :: weight(:), theta(:), gap(:), m(:), tolerance
    !> The next active set; changed where prox is (n_rows).
    logical, intent(inout) :: new(:)
    !> The iterate.
    type(iterate_t), intent(inout) :: now
    !> How often sets came again.
    integer, intent(inout) :: n_cycles
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
      now%prox = max(now%prox, min(growth*now%prox, greatest_fraction/proximal_fraction*proximal_term(system, weight)))
      now%shifted = gap - now%prox*m
      new = now%y - now%shifted > 0
    end if
    now%guarded = .true.
    associate (not_needed => theta)
    end associate
  end subroutine look_for_cycles

  !> A number that tells active sets apart.
  pure real(dp) function mark_of_set(active) result(mark)
    !> (n_rows)
    logical, intent(in) :: active(:)
    integer :: i
    mark = sum([(modulo(i*golden, 1.0_dp), i=1, size(active))], mask=active)
  end function mark_of_set

  !> The minimum of the energy along a step e.
  pure real(dp) function best_step(active_stiffness, stiffness, over, along, work) result(t)
    !> W of the active rows (n_rows) [force/length].
    real(dp), intent(in) :: active_stiffness(:)
    !> w/(theta + prox) of all rows (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)
    !> B u - d + prox m_0 (n_rows) [length].
    real(dp), intent(in) :: over(:)
    !> B e (n_rows) [length].
    real(dp), intent(in) :: along(:)
    !> r . e with the residual r of the linear system, which is e . (K + B^T W B) e, too [energy].
    real(dp), intent(in) :: work
    real(dp) :: low, high, curvature, slope
    integer :: k
    t = 1
    if (.not. work > 0) return
    curvature = max(0.0_dp, work - sum(active_stiffness*along**2))
    slope = -work - sum(active_stiffness*over*along)
    low = 0
    high = 1
    do k = 1, 60
      if (derivative(high) > 0) exit
      low = high
      high = 2*high
    end do
    do k = 1, 60
      t = (low + high)/2
      if (derivative(t) > 0) then
        high = t
      else
        low = t
      end if
    end do

  contains

    !> Derivative of the energy.
    pure real(dp) function derivative(step)
      !> Length of the step [].
      real(dp), intent(in) :: step
      derivative = slope + step*curvature + sum(stiffness*max(0.0_dp, over + step*along)*along)
    end function derivative
  end function best_step

  !> The residual f - K u - B^T W (B u - d + prox m_0), and the norm of u.
  subroutine find_residual(system, load, shifted, u, r, y, norm)
    !> The bodies and the active rows.
    class(contact_multigrid_t), intent(in) :: system
    !> f (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> d - prox m_0 (n_rows) [length].
    real(dp), intent(in) :: shifted(:)
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: u(:)
    !> Residual (n) [force].
    real(dp), intent(out), contiguous :: r(:)
    !> B u (n_rows) [length].
    real(dp), intent(out) :: y(:)
    !> Energy norm of u [sqrt(energy)].
    real(dp), intent(out) :: norm
    call system%strain_forces(u, r)
    norm = sqrt(max(0.0_dp, scalar_product(system%n, u, r)))
    r(:) = load - r
    call system%row_displacement(u, y)
    call system%subtract_row_force(system%stiffness*(y - shifted), r)
  end subroutine find_residual

  !> prox of each row [length/pressure].
  function proximal_term(system, weight) result(prox)
    !> The bodies and rows.
    class(contact_multigrid_t), intent(in) :: system
    !> Weights w (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> (n_rows)
    real(dp) :: prox(size(weight)), most
    prox = weight*system%row_compliance()
    most = maxval([0.0_dp, prox])
    if (.not. most > 0) most = 1
    ! Rows between held nodes have none of their own.
    prox = proximal_fraction*max(prox, proximal_fraction*most)
  end function proximal_term

  !> Give the system its active rows.
  subroutine set_active(system, weight, softness, active, error)
    !> The system.
    class(contact_multigrid_t), intent(inout) :: system
    !> Weights w (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> theta + prox (n_rows) [length/pressure].
    real(dp), intent(in) :: softness(:)
    !> Whether a row is active (n_rows).
    logical, intent(in) :: active(:)
    !> Allocated where numbers are not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: stiffness(size(weight))
    stiffness = 0
    where (active) stiffness = weight/softness
    call system%set_stiffness(stiffness, error)
  end subroutine set_active
end module dotyk_scheme_proximal_active_set
