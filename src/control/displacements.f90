!> From the state of the scheme to displacements of the accuracy that was asked for.
module dotyk_control_displacements
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_body_solution, only: displacements_t, recover_bodies
  use dotyk_control_conditioning, only: conditioning_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_correction, only: correct_contact
  use dotyk_control_refinement, only: energy_of, refine_bodies, refuse_lost_pressures
  use dotyk_control_rounding, only: expect_rounding, flag_rounded, gap_rounding, measure_rounding, relative_rounding, &
    storage_rounding, worth_measuring, worth_refining
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t, phase_iterate, phase_recover
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged
  implicit none
  private
  public :: find_displacements

  real(dp), parameter :: few_units = 4  !! So many units in the last place are as good as one.

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
      norm = qp%energy_norm(state%pressure, state%penetration, state%alpha/qp%coarse%scale)
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
      norm = qp%energy_norm(state%pressure, state%penetration, state%alpha/qp%coarse%scale)
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
end module dotyk_control_displacements
