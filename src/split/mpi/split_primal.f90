!> The scheme for bodies that all ranks compute together: the engine of `dotyk_scheme_primal` with the linear
!> systems of `dotyk_distributed_system`.
module dotyk_split_split_primal
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_control_response_choice, only: iterations_per_step
  use dotyk_ranks_exchange, only: meet
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_primal, only: solve_by_displacements
  use dotyk_scheme_proximal_active_set, only: proximal_outcome_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_costly, ended_interrupted, ended_solves
  use dotyk_scheme_stopping, only: solver_settings_t
  use dotyk_scheme_winkler_start, only: clear
  use dotyk_split_split_bodies, only: split_bodies_t
  implicit none
  private

  type, extends(scheme_t), public :: split_primal_t  !! The scheme.
    type(split_bodies_t), pointer :: bodies => null()  !! The bodies.
  contains
    procedure :: solve => primal_solve
  end type split_primal_t

contains

  !> Solve.
  subroutine primal_solve(self, qp, compliance, settings, monitor, state, error)
    class(split_primal_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    type(solver_settings_t), intent(in) :: settings
    class(monitor_t), intent(inout) :: monitor
    type(solver_state_t), intent(inout) :: state
    type(error_t), allocatable, intent(out) :: error
    type(dual_t) :: dual
    type(proximal_outcome_t) :: total
    real(dp), allocatable :: u(:), left(:)
    real(dp) :: tolerance
    integer :: steps, b
    select type (compliance)
    class is (body_compliance_t)
      call compliance%forget_displacements()
    end select
    if (qp%n_rows == 0) then
      call dual%solve(qp, compliance, settings, monitor, state, error)
      if (.not. allocated(error)) call add_solve_error(self%bodies%solve_error(), settings%tolerance, state)
      return
    end if
    associate (system => self%bodies%system)
      if (iterations_per_step*self%bodies%steps_of_free > system%most_iterations) then
        call clear(state)
        state%ended = ended_costly
        return
      end if
      steps = system%n_iterations
      ! The error of solves is added to its bound, and may have grown a little by then.
      tolerance = settings%tolerance - 2*min(settings%tolerance/4, self%bodies%solve_error())
      call move_alloc(system%u, u)
      if (.not. allocated(state%pressure) .and. allocated(u)) deallocate (u)
      call solve_by_displacements(system, qp, tolerance, settings, spread(.false., 1, qp%n_rows), monitor, u, total, &
                                  state, error)
      if (allocated(error)) return
      call meet()
      if (.not. allocated(state%pressure)) return
      allocate (left, source=u)
      call move_alloc(u, system%u)
      call system%remove_modes(left)
      call add_solve_error(self%bodies%solve_error(), settings%tolerance, state)
      if (interrupted() .and. state%ended /= ended_converged) state%ended = ended_interrupted
      select type (compliance)
      class is (body_compliance_t)
        do b = 1, size(compliance%body)
          if (.not. allocated(compliance%body(b)%found)) &
            allocate (compliance%body(b)%found(size(compliance%response(b)%form%mode, 1)))
          call self%bodies%to_equations(b, left, compliance%body(b)%found)
        end do
      end select
      steps = system%n_iterations - steps
      compliance%n_sweeps = compliance%n_sweeps + steps
      call monitor%note('displacements    '//to_text(total%steps)//' active sets, '//to_text(steps)// &
                        ' iterations of conjugate gradients with p-multigrid, '//to_text(system%n_setups)// &
                        ' set-ups of smoothed aggregation')
    end associate
  end subroutine primal_solve

  !> Add the error of solves: of the solution without contact, and of bodies that touch no other.
  subroutine add_solve_error(solve_error, tolerance, state)
    real(dp), intent(in) :: solve_error  !! Relative, in the energy norm; huge where a solve has failed [].
    real(dp), intent(in) :: tolerance  !! Bound that was asked for [].
    type(solver_state_t), intent(inout) :: state  !! Where the scheme ended.
    state%bound_is_guaranteed = .false.
    if (.not. allocated(state%pressure) .or. .not. state%error_bound < huge(tolerance)) return
    state%error_bound = min(huge(tolerance)/2, state%error_bound) + min(huge(tolerance)/2, solve_error)
    if (state%ended == ended_converged .and. state%error_bound > tolerance) state%ended = ended_solves
  end subroutine add_solve_error
end module dotyk_split_split_primal
