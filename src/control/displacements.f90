!> From the state of the scheme to displacements of the accuracy that was asked for. Refined displacements of
!> ill-conditioned bodies correct the initial penetration, and the QP is solved again.
module dotyk_control_displacements
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: least_gain
  use dotyk_control_body_solution, only: body_solution_t, displacements_t, recover_bodies
  use dotyk_control_conditioning, only: conditioning_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_refinement, only: energy_of, least_residual, penetrations, refine_bodies, refuse_lost_pressures
  use dotyk_control_rounding, only: expect_rounding, flag_rounded, gap_rounding, measure_rounding, relative_rounding, &
    storage_rounding, worth_measuring, worth_refining
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t, phase_iterate, phase_recover
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_interrupted, ended_time
  implicit none
  private
  public :: correct_contact, find_displacements

  real(dp), parameter :: few_units = 4  !! So many units in the last place are as good as one.
  integer, parameter :: most_corrections = 8  !! Corrections at most.
  !> Corrections below this fraction of the tolerance end the iteration.
  real(dp), parameter :: small_correction = 0.01_dp

contains

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
      if (rounding <= max(least_residual, small_correction*run%settings%tolerance) .or. &
          .not. rounding < least_gain*before) exit
      before = rounding
    end do
  end subroutine correct_contact
end module dotyk_control_displacements
