!> Contact of ill-conditioned bodies: refined displacements correct the initial penetration, and the QP is solved again.
module dotyk_control_correction
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: least_gain
  use dotyk_control_body_solution, only: body_solution_t, recover_bodies
  use dotyk_control_conditioning, only: conditioning_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_refinement, only: least_residual, penetrations, refine_bodies
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_interrupted, ended_time
  implicit none
  private
  public :: correct_contact

  integer, parameter :: most_corrections = 8  !! Corrections at most.
  !> Corrections below this fraction of the tolerance end the iteration.
  real(dp), parameter :: small_correction = 0.01_dp

contains

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
                 max(tiny(left), qp%energy_norm(state%pressure, state%penetration, state%alpha/qp%coarse%scale))
      if (rounding <= max(least_residual, small_correction*run%settings%tolerance) .or. &
          .not. rounding < least_gain*before) exit
      before = rounding
    end do
  end subroutine correct_contact
end module dotyk_control_correction
