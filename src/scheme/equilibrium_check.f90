!> Whether contact can balance the loads of the floating bodies: before the contact is solved, or for many bodies, where
!> this takes as long as a solution, where there is none.
module dotyk_scheme_equilibrium_check
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use dotyk_base_error, only: error_t, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_interrupted, ended_no_equilibrium
  use dotyk_scheme_winkler_start, only: find_unbounded_direction, imbalance
  implicit none
  private
  public :: check_equilibrium, clear, explain_failure

contains

  !> Whether contact can balance the loads of the floating bodies.
  subroutine check_equilibrium(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(solver_state_t), intent(inout) :: state  !! Ended where the loads excite a motion that no contact stops.
    real(dp), allocatable :: motion(:)
    logical :: found
    allocate (motion(qp%coarse%n))
    call find_unbounded_direction(qp, motion, found)
    if (.not. found) return
    call clear(state)
    state%ended = ended_no_equilibrium
    state%unbounded = qp%coarse%scale*motion
  end subroutine check_equilibrium

  !> Where the contact of many bodies was not solved: whether the reason is that there is no equilibrium.
  subroutine explain_failure(qp, state, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    !> How the scheme ended; ended where the loads excite a motion that no contact stops on return.
    type(solver_state_t), intent(inout) :: state
    !> Why the system of an active set could not be prepared; deallocated where this is the reason.
    type(error_t), allocatable, intent(inout) :: error
    if (allocated(error)) then
      if (error%code /= exit_not_solvable) return
    else
      if (any(state%ended == [ended_interrupted, ended_no_equilibrium])) return
      if (state%ended == ended_converged .and. is_in_equilibrium(qp, state)) return
    end if
    call check_equilibrium(qp, state)
    if (state%ended == ended_no_equilibrium .and. allocated(error)) deallocate (error)
  end subroutine explain_failure

  !> Whether contact forces balance the loads, by the measure that an unbounded direction is found by.
  logical function is_in_equilibrium(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, rigid body modes with the resultants of the loads.
    type(solver_state_t), intent(in) :: state  !! With pressures and amplitudes.
    real(dp), allocatable :: missing(:)
    allocate (missing(qp%coarse%n))
    call qp%mode_resultant(qp%weight*state%pressure, missing)
    missing = qp%coarse%resultant - missing - qp%coarse%stiffness_forces(state%alpha/qp%coarse%scale)
    is_in_equilibrium = .not. maxval(abs(missing)) > imbalance*maxval(abs(qp%coarse%resultant))
  end function is_in_equilibrium

  !> A new state, in which the quantities of other schemes are no numbers.
  subroutine clear(state)
    type(solver_state_t), intent(out) :: state  !! The new state.
    real(dp) :: nan
    nan = ieee_value(nan, ieee_quiet_nan)
    state%gamma = nan
    state%lambda_max = nan
    state%q_predicted = nan
    state%q_measured = nan
    state%error_bound_paper = nan
  end subroutine clear
end module dotyk_scheme_equilibrium_check
