!> The solution of a contact problem: contact pressures, displacements, and the estimated errors of both.
!>
!> Refined displacements of ill-conditioned bodies correct the initial penetration, and the QP is solved again.
module dotyk_control_contact_solution
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: least_gain, notable
  use dotyk_contact_facet_bending, only: bending_t
  use dotyk_control_body_solution, only: body_solution_t, displacements_t, recover_bodies
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_error_budget, only: error_budget_t, estimate_errors
  use dotyk_control_gap_doubt, only: find_gap_doubt, gap_doubt_t
  use dotyk_control_kept_estimates, only: kept_estimates_t
  use dotyk_control_penetration_check, only: penetration_check_t
  use dotyk_control_quantity_error, only: quantity_errors_t
  use dotyk_control_refinement, only: collect_conditioning, conditioning_t, energy_of, least_residual, penetrations, &
    refine_bodies, refuse_lost_pressures
  use dotyk_control_rounding, only: expect_rounding, flag_rounded, gap_rounding, measure_rounding, relative_rounding, &
    storage_rounding, worth_measuring, worth_refining
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t, phase_estimate, phase_iterate, phase_recover
  use dotyk_scheme_solver_state, only: ended_converged, ended_interrupted, ended_stalled, ended_time, solver_state_t
  implicit none
  private
  public :: begin_contact, complete_contact, solve_contact, correct_contact, find_displacements

  type, public :: solution_goal_t  !! What is asked of a solution.
    logical :: displacement = .true.  !! Whether displacements were asked for.
    logical :: stress = .true.  !! Whether stresses were asked for.
    logical :: mesh_error = .true.  !! Whether the error of the mesh was asked for.
    logical :: penalty_error = .true.  !! Whether the error of the penalty was asked for.
  contains
    procedure :: needs_displacements => goal_needs_displacements
  end type solution_goal_t

  type, public :: energies_t  !! The terms of the functional (19), F_theta(u) = A(u,u)/2 - L(u) + j_theta(u) [energy].
    !> A(u,u)/2, of the elastic bodies; prescribed displacements do work on them that is in no other term.
    real(dp) :: strain = 0
    real(dp) :: load_work = 0  !! L(u), work of the loads.
    real(dp) :: penalty = 0  !! j_theta(u) of (18), energy of the Winkler layers; 0 without penalty.
  end type energies_t

  type, public :: contact_solution_t  !! The solution.
    !> The quadratic programme that was solved: the given one, its initial penetration corrected where bodies are
    !> ill-conditioned.
    type(contact_qp_t) :: qp
    !> Pressures, amplitudes of the modes, and how the scheme ended; without pressures where there is no solution.
    type(solver_state_t) :: state
    type(bending_t), allocatable :: bending(:)  !! What solutions have added to the gaps of `qp` (n_pairs).
    integer :: n_bendings = 0  !! How often solutions have changed it.
    type(displacements_t) :: displacements  !! Displacements and stresses.
    type(conditioning_t), allocatable :: conditioning(:)  !! Of the stiffness of each body (n_bodies).
    type(error_budget_t) :: budget  !! Errors.
    type(gap_doubt_t), allocatable :: gap_doubt(:)  !! What hangs on uncertain gaps (n_pairs).
    type(quantity_errors_t) :: quantities  !! Quantities with error bars.
    type(penetration_check_t) :: penetration  !! Whether the deformed bodies penetrate each other.
  contains
    procedure :: energies => solution_energies
  end type contact_solution_t

  !> Which facets the contact spans is found once, and checked once.
  integer, parameter :: most_bendings = 2
  real(dp), parameter :: few_units = 4  !! So many units in the last place are as good as one.
  integer, parameter :: most_corrections = 8  !! Corrections at most.

contains

  !> The terms of (19) for the solution.
  pure type(energies_t) function solution_energies(self) result(energies)
    class(contact_solution_t), intent(in) :: self
    associate (state => self%state, qp => self%qp)
      energies%strain = state%norm(qp)**2/2
      energies%penalty = sum(qp%penalty_of_rows(state%pressure, state%penetration))
      if (allocated(state%terms)) then
        energies%load_work = state%terms(2)
      else
        energies%load_work = qp%load_work(state%pressure, state%alpha/qp%coarse%scale)
      end if
    end associate
  end function solution_energies

  !> Whether the displacements of all nodes are needed.
  pure logical function goal_needs_displacements(self) result(needs)
    class(solution_goal_t), intent(in) :: self
    needs = self%displacement .or. self%stress .or. self%mesh_error
  end function goal_needs_displacements

  !> Begin the solution of a QP, from the pressures of the state if it has any.
  subroutine begin_contact(problem, qp, solution)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(contact_solution_t), intent(inout) :: solution  !! Nothing, or a state to begin with.
    logical :: is_bent
    solution%qp = qp
    allocate (solution%gap_doubt(size(problem%pair)))
    call collect_conditioning(problem%classes, problem%report, solution%conditioning)
    allocate (solution%bending(size(problem%pair)))
    ! A guess: the contact spans what it did before, or else what overlaps without contact.
    if (allocated(solution%state%pressure)) then
      is_bent = has_bent(problem, solution%state%pressure, solution)
    else
      is_bent = has_bent(problem, qp%initial_penetration, solution)
    end if
  end subroutine begin_contact

  !> Solve the contact of a solution that was begun, or continue where the time limit stopped it.
  subroutine solve_contact(problem, compliance, run, monitor, solution, error)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, factorization reports, pairs.
    !> The compliance operator; entries that schemes form stay there.
    type(body_compliance_t), intent(inout) :: compliance
    type(scheme_run_t), intent(in) :: run  !! The scheme and its settings.
    class(monitor_t), intent(inout) :: monitor  !! Watches the iteration.
    type(contact_solution_t), intent(inout) :: solution  !! Begun; without displacements on return.
    type(error_t), allocatable, intent(out) :: error  !! The scheme fails.
    do
      call monitor%begin_phase(phase_iterate)
      call run%solve(solution%qp, compliance, problem%n_blas, monitor, solution%state, error)
      if (allocated(error)) return
      if (.not. allocated(solution%state%pressure)) return
      call solution%displacements%forget()
      if (solution%n_bendings == most_bendings) return
      if (all(solution%state%ended /= [ended_converged, ended_stalled])) return
      if (.not. has_bent(problem, solution%state%pressure, solution)) return
      ! Schemes that continue from the solution of other gaps bound their errors less well.
      solution%n_bendings = solution%n_bendings + 1
      solution%state = solver_state_t()
    end do
  end subroutine solve_contact

  !> Displacements and errors of a contact that is solved.
  subroutine complete_contact(problem, compliance, run, goal, kept, monitor, solution, error)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(body_compliance_t), intent(inout) :: compliance  !! As in `solve_contact`.
    type(scheme_run_t), intent(in) :: run  !! The scheme and its settings.
    type(solution_goal_t), intent(in) :: goal  !! What is asked of the solution.
    type(kept_estimates_t), intent(inout) :: kept  !! What estimates keep between load cases.
    class(monitor_t), intent(inout) :: monitor  !! Watches the iteration.
    !> Solved. Where it ends with `ended_time`, `solve_contact` and this continue it.
    type(contact_solution_t), intent(inout) :: solution
    !> As in `find_displacements` and `estimate_errors`, or the scheme fails.
    type(error_t), allocatable, intent(out) :: error
    if (.not. allocated(solution%state%pressure)) return
    call find_displacements(problem, solution%qp, compliance, run, monitor, goal%needs_displacements(), goal%stress, &
                            solution%conditioning, solution%displacements, solution%state, error)
    if (allocated(error) .or. .not. allocated(solution%state%pressure)) return
    call monitor%begin_phase(phase_estimate)
    call estimate_errors(problem, solution%qp, compliance, run%settings%linear_solver, run%scheme, goal%mesh_error, &
                         goal%penalty_error, solution%displacements, kept, solution%state, solution%budget, error)
    if (allocated(error)) return
    call find_gap_doubt(problem, solution%qp, compliance, run%settings%linear_solver, run%scheme, &
                        solution%displacements, solution%state, solution%gap_doubt)
    call monitor%begin_phase(phase_recover)
  end subroutine complete_contact

  !> Whether the gaps of the QP change, on facets that the contact bends.
  logical function has_bent(problem, pressure, solution)
    type(contact_problem_t), intent(in) :: problem  !! Bodies, modes, factorization reports, pairs.
    real(dp), intent(in) :: pressure(:)  !! Pressures of the rows; only their sign counts (n_rows) [any].
    type(contact_solution_t), intent(inout) :: solution  !! The solution; its QP gets the gaps.
    real(dp) :: change(size(solution%qp%gap))
    integer :: k
    change = 0
    do k = 1, size(problem%pair)
      associate (first => solution%qp%pair_first_row(k), last => solution%qp%pair_first_row(k + 1) - 1)
        call solution%bending(k)%update(problem%pair(k), problem%surface_a(k), pressure(first:last), change(first:last))
      end associate
    end do
    has_bent = any(abs(change) > 0)
    if (.not. has_bent) return
    call solution%qp%shift_gap(change)
    if (allocated(solution%state%penetration)) solution%state%penetration = solution%state%penetration - change
  end function has_bent

  !> Displacements from the state; where rounding matters, refined, and the contact corrected by them.
  subroutine find_displacements(problem, qp, compliance, run, monitor, are_needed, want_stress, conditioning, &
                                displacements, state, error)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(inout) :: qp  !! Its initial penetration is corrected where bodies are ill-conditioned.
    !> Its compliance operator; entries that the scheme forms stay there.
    type(body_compliance_t), intent(inout) :: compliance
    type(scheme_run_t), intent(in) :: run  !! The scheme and its settings.
    class(monitor_t), intent(inout) :: monitor  !! Watches the iteration.
    logical, intent(in) :: are_needed  !! Whether displacements of all nodes are needed.
    logical, intent(in) :: want_stress  !! Whether stresses are wanted with them.
    type(conditioning_t), intent(inout) :: conditioning(:)  !! Counts steps of refinement (n_bodies).
    !> Those of the state on return, as they were given where they are known; those that are not needed are not
    !> allocated. Counts recoveries.
    type(displacements_t), intent(inout) :: displacements
    !> That of the scheme; its bound includes rounding on return. Without pressures where the scheme found no solution
    !> after a correction.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where no significant digit of the displacements or pressures of a body is left, a formula of a material
    !> cannot be evaluated, or the scheme fails.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: distance(size(problem%body)), stored(size(problem%body)), found_rounding, rounding, gaps, norm, left
    associate (tolerance => run%settings%tolerance)
      rounding = 0
      norm = state%norm(qp)
      stored = 0
      found_rounding = 0
      if (are_needed) then
        call monitor%begin_phase(phase_recover)
        call recover_and_measure(.false.)
        if (allocated(error)) return
        ! Parts of bodies are not refined.
        if (state%ended == ended_converged .and. .not. problem%ranks%are_split()) &
          call flag_rounded(distance, norm, tolerance, conditioning)
      end if
      ! Motions without strain have no digits to lose.
      if (any(conditioning%needs_refinement()) .and. norm > 0) then
        call monitor%begin_phase(phase_iterate)
        call correct_contact(problem, qp, compliance, run, monitor, conditioning, displacements%body, &
                             displacements%n_recoveries, state, rounding, error)
        if (allocated(error)) return
        if (.not. allocated(state%pressure)) return
        call monitor%begin_phase(phase_recover)
        call displacements%forget()
        if (are_needed) call recover_and_measure(.true.)
        if (allocated(error)) return
      end if
      if (are_needed .and. norm > 0) then
        call refuse_lost_pressures(problem%body, conditioning, distance, norm, error)
        if (allocated(error)) return
        rounding = rounding + relative_rounding([distance, found_rounding, gaps], norm, conditioning)
        if (rounding > tolerance) call storage_rounding(problem, displacements%body, stored)
      else if (.not. are_needed) then
        call displacements%forget()
        allocate (displacements%body(size(problem%body)))
      end if
      call state%add_rounding(rounding, few_units*norm2(stored)/max(tiny(rounding), norm), tolerance)
    end associate
  contains
    !> Displacements, and their distance to the exact ones for the same contact forces.
    subroutine recover_and_measure(refined)
      logical, intent(in) :: refined  !! Whether those that need it are refined.
      logical :: is_found(size(distance))
      integer :: b
      if (.not. allocated(displacements%body)) then
        call recover_bodies(problem, qp, compliance, state%pressure, state%alpha, want_stress, displacements%body)
        displacements%n_recoveries = displacements%n_recoveries + 1
      end if
      if (refined) then
        call refine_bodies(problem, qp, compliance, state%pressure, state%alpha, conditioning, displacements%body, &
                           left, error)
        if (allocated(error)) return
        state%energy = energy_of(problem, qp, displacements%body, state%pressure, state%penetration)
        ! The work of the tensions of bolts is none of loads on displacements.
        state%energy = state%energy - sum(qp%coarse%resultant*state%alpha, mask=qp%coarse%is_slide)
      end if
      norm = state%norm(qp)
      call expect_rounding(problem, displacements%body, norm, distance)
      is_found = [(allocated(compliance%body(b)%found), b=1, size(distance))]
      gaps = 0
      ! To measure the rounding of displacements that a scheme found takes solves by p-multigrid.
      if (refined .or. norm2(distance) > &
          merge(worth_refining, worth_measuring, any(is_found))*run%settings%tolerance*norm) then
        call measure_rounding(problem, qp, compliance, state%pressure, displacements%body, distance, error)
        ! The bound of a scheme that finds displacements has what they leave of the gaps.
        if (.not. any(is_found)) gaps = &
          gap_rounding(qp, compliance, displacements%body, state%pressure, state%penetration - &
                       qp%opened_by_slides(state%alpha))
      end if
      ! What such a scheme leaves of the forces is no reason to refine.
      found_rounding = norm2(pack(distance, is_found))
      where (is_found) distance = 0
    end subroutine recover_and_measure
  end subroutine find_displacements

  !> The difference of the penetrations by refined displacements and by the scheme is added to the initial penetration,
  !> and the scheme begins again from its state, until that changes nothing any more. The time limit of the settings
  !> does not hold: a correction takes few steps, and a pause would lose it.
  subroutine correct_contact(problem, qp, compliance, run, monitor, conditioning, solution, n_recoveries, state, &
                             rounding, error)
    type(contact_problem_t), intent(inout) :: problem  !! Bodies, modes, factorization reports, pairs.
    type(contact_qp_t), intent(inout) :: qp  !! Its initial penetration is corrected.
    !> Its compliance operator; entries that the scheme forms stay there.
    type(body_compliance_t), intent(inout) :: compliance
    type(scheme_run_t), intent(in) :: run  !! The scheme and its settings.
    class(monitor_t), intent(inout) :: monitor  !! Watches the iteration.
    type(conditioning_t), intent(inout) :: conditioning(:)  !! Counts steps of refinement (n_bodies).
    type(body_solution_t), allocatable, intent(inout) :: solution(:)  !! Room for displacements (n_bodies).
    integer, intent(inout) :: n_recoveries  !! Counts recoveries of all bodies.
    type(solver_state_t), intent(inout) :: state  !! That of the scheme, then the corrected one.
    !> The last change, and what is left of the residuals: relative, in the energy norm [].
    real(dp), intent(out) :: rounding
    !> Allocated where no significant digit of the displacements of a body is left, a formula of a material cannot be
    !> evaluated, or the scheme fails.
    type(error_t), allocatable, intent(out) :: error
    type(scheme_run_t) :: now
    type(solver_state_t) :: last
    real(dp), allocatable :: y(:)
    real(dp) :: left, before
    integer :: k
    rounding = 0
    if (size(state%pressure) == 0 .or. .not. any(conditioning%needs_refinement())) return
    if (any(state%ended == [ended_interrupted, ended_time])) then
      ! Rounding is not known.
      state%error_bound = huge(before)
      return
    end if
    now = run
    now%settings%time_limit = huge(now%settings%time_limit)
    allocate (y(size(state%pressure)))
    before = huge(before)
    do k = 1, most_corrections
      call recover_bodies(problem, qp, compliance, state%pressure, state%alpha, .false., solution)
      n_recoveries = n_recoveries + 1
      call refine_bodies(problem, qp, compliance, state%pressure, state%alpha, conditioning, solution, left, error)
      if (allocated(error)) return
      call penetrations(qp, solution, y)
      call qp%shift_penetration(y + qp%opened_by_slides(state%alpha) - state%penetration)
      last = state
      call now%solve(qp, compliance, problem%n_blas, monitor, state, error)
      if (allocated(error)) return
      if (.not. allocated(state%pressure)) return
      if (interrupted()) then
        ! Rounding is not known.
        state%error_bound = huge(rounding)
        return
      end if
      rounding = (compliance%distance(qp, state%pressure - last%pressure, state%alpha - last%alpha) + left)/ &
                 max(tiny(left), state%norm(qp))
      if (rounding <= max(least_residual, notable*run%settings%tolerance) .or. &
          .not. rounding < least_gain*before) exit
      before = rounding
    end do
  end subroutine correct_contact
end module dotyk_control_contact_solution
