!> The parallel Neumann scheme: equation (42), the general iteration (32) with G = A, in the form of equations (43),
!> (44).
!>
!> On every body at once a linear problem with the last known contact pressure as traction, equation (45), then a
!> relaxation, equation (46). With the state of `dotyk_scheme_contact_qp`: `p = max(0, y)/theta`, `z = C W p` (one solve
!> of every body), `m := gamma p + (1-gamma) m`, and `y := gamma (y_0 - z) + (1-gamma) y`, which forgets its rounding
!> errors in the course of the iteration.
module dotyk_scheme_neumann
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_scheme_bounds, only: neumann_constants
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_relaxation, only: announce_relaxation, choose_relaxation, estimate_lambda_max
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: paused_t, solver_state_t, ended_converged, ended_time
  use dotyk_scheme_stopping, only: iteration_t, solver_settings_t, stopping_t, take_up
  implicit none
  private

  type, extends(scheme_t), public :: neumann_t  !! The scheme.
  contains
    procedure :: solve => neumann_solve
    procedure, nopass :: is_iteration => is_general_iteration
    procedure, nopass :: expected_products => typical_products
  end type neumann_t

  public :: begin_iteration, finish_iteration, is_general_iteration

contains

  !> It is the general iteration (32).
  pure logical function is_general_iteration() result(is_iteration)
    is_iteration = .true.
  end function is_general_iteration

  !> One product a step.
  pure integer function typical_products() result(n)
    n = 300
  end function typical_products

  !> Iterate from u_0, the solution without contact, or from the state; continue a paused iteration.
  subroutine neumann_solve(self, qp, compliance, settings, monitor, state, error)
    class(neumann_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact QP of held bodies.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where the rule of the paper is to end the iteration, and gamma is beyond Theorem 3.
    type(error_t), allocatable, intent(out) :: error
    class(paused_t), allocatable :: paused
    call take_up(settings, state, paused)
    if (.not. allocated(paused)) then
      call begin(qp, compliance, settings, monitor, state, paused, error)
      if (allocated(error)) return
    end if
    select type (paused)
    type is (iteration_t)
      if (qp%n_rows > 0) call iterate(qp, compliance, paused%stopping, monitor, state)
    end select
    call finish_iteration(monitor, state, paused)
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine neumann_solve

  !> The first iterate, with gamma and the stopping criterion.
  subroutine begin(qp, compliance, settings, monitor, state, paused, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(solver_state_t), intent(inout) :: state  !! As in `begin_iteration`.
    class(paused_t), allocatable, intent(out) :: paused  !! An `iteration_t`: a step depends on the last iterate alone.
    type(error_t), allocatable, intent(out) :: error  !! As in `neumann_solve`.
    type(iteration_t), allocatable :: iteration
    logical :: is_first
    is_first = .not. state%lambda_max > 0
    call begin_iteration(qp, compliance, state)
    allocate (iteration)
    if (qp%n_rows > 0) then
      if (is_first) call estimate_lambda_max(qp, compliance, state%lambda_max)
      state%constants = neumann_constants(state%lambda_max)
      call choose_relaxation(settings, state, error)
      if (allocated(error)) return
      if (is_first) call announce_relaxation(monitor, state, 'L <= '//to_text(state%lambda_max, 4))
      call iteration%stopping%begin(settings, state%q_predicted)
    end if
    call move_alloc(iteration, paused)
  end subroutine begin

  !> The first iterate, of the Robin scheme as well: u_0 unless the state has pressures. Without contact rows it is the
  !> solution.
  subroutine begin_iteration(qp, compliance, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_state_t), intent(inout) :: state  !! Its L stays, with the pressures if it has any.
    type(solver_state_t) :: start, empty
    call move_alloc(state%pressure, start%pressure)
    start%lambda_max = state%lambda_max
    state = empty
    state%penetration = qp%initial_penetration
    allocate (state%alpha(0))
    allocate (state%pressure(qp%n_rows), source=0.0_dp)
    state%energy = qp%energy_0
    state%ended = ended_converged
    if (qp%n_rows == 0) return
    if (allocated(start%pressure)) then
      state%pressure = start%pressure
      call compliance%multiply(qp, qp%weight*state%pressure, state%penetration)
      state%penetration = qp%initial_penetration - state%penetration
    end if
    state%lambda_max = start%lambda_max
  end subroutine begin_iteration

  !> The end of an iteration, or its pause at the time limit: its history is cut, and its contraction measured.
  subroutine finish_iteration(monitor, state, paused)
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(solver_state_t), intent(inout) :: state  !! Gets the iteration where it pauses.
    class(paused_t), allocatable, intent(inout) :: paused  !! The iteration.
    call monitor%finish()
    call state%history%finish()
    state%iterations = state%history%n
    state%q_measured = 0
    if (state%iterations > 0) state%q_measured = state%history%measured_contraction()
    if (state%ended == ended_time) call move_alloc(paused, state%paused)
  end subroutine finish_iteration

  !> The steps of equations (43), (44).
  subroutine iterate(qp, compliance, stopping, monitor, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(stopping_t), intent(inout) :: stopping  !! Begun.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(solver_state_t), intent(inout) :: state  !! With L, gamma and an iterate.
    real(dp), allocatable :: p(:), z(:)
    real(dp) :: residual, gamma

    allocate (p(qp%n_rows), z(qp%n_rows))
    gamma = state%gamma
    do
      call evaluate_step(qp, compliance, state%pressure, state%penetration, p, z, residual)
      state%pressure = gamma*p + (1 - gamma)*state%pressure
      state%penetration = gamma*(qp%initial_penetration - z) + (1 - gamma)*state%penetration
      ! The new iterate has q times the error of the last at most.
      if (stopping%check(qp, state%q_predicted*residual, gamma*residual, gamma > state%constants%gamma_limit(), &
          monitor, state, state%constants%bound_of_paper(gamma, gamma*residual))) exit
    end do
  end subroutine iterate

  !> Pressures by the penetrations of an iterate, which are j'_theta of equation (21) and Phi of equation (26), the
  !> displacements of the rows under them, and the residual of equation (23), `||K^{-1} F'_theta(u)||_A^2 = (p-m)^T W C
  !> W (p-m)`, which bounds the error of the iterate. One product.
  subroutine evaluate_step(qp, compliance, pressure, penetration, p, z, residual)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    real(dp), intent(in) :: pressure(:)  !! Contact pressures of the iterate (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d of the iterate (n_rows) [length].
    real(dp), intent(out) :: p(:)  !! max(0, y)/theta (n_rows) [pressure].
    real(dp), intent(out) :: z(:)  !! C W p (n_rows) [length].
    real(dp), intent(out) :: residual  !! Energy norm of the residual [sqrt(energy)].
    p = max(0.0_dp, penetration)/qp%theta
    call compliance%multiply(qp, qp%weight*p, z)
    ! C W m = y_0 - y.
    residual = sqrt(max(0.0_dp, sum(qp%weight*(p - pressure)*(z - (qp%initial_penetration - penetration)))))
  end subroutine evaluate_step
end module dotyk_scheme_neumann
