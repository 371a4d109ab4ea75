!> The parallel Robin scheme: the general iteration (32) with G = A + X, X the penalty form of each body by itself on a
!> fixed set of rows (`dotyk_scheme_robin_form`).
!>
!> On every body at once `(K_a + B_a^T P_F B_a)(u_a^{k+1} - u_a^k) = -gamma (K_a u_a^k - f_a + B_a^T W p^k)`, with
!> `p^k = Theta^{-1} max(0, y^k)`: each side of a row of the set F lies on a spring (Robin conditions), the others have
!> the last pressure (Neumann conditions). With the body's own forces, `u_a = u0_a - K_a^{-1} B_a^T lambda_a`,
!> `r_a = W p - lambda_a` and `g_a = C_a^G r_a` this is `lambda_a += gamma (r_a - P_F g_a)`, `B_a u_a -= gamma g_a`.
!> Both sides agree on the force at the solution only: the state that a user gets has the mean of both.
module dotyk_scheme_robin
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_neumann, only: begin_iteration, finish_iteration, is_general_iteration
  use dotyk_scheme_relaxation, only: choose_relaxation
  use dotyk_scheme_robin_form, only: find_constants, form_sides, side_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: paused_t, solver_state_t, ended_interrupted
  use dotyk_scheme_stopping, only: iteration_t, solver_settings_t, take_up
  use dotyk_scheme_theorem_lines, only: announce_relaxation
  implicit none
  private

  type, extends(scheme_t), public :: robin_t  !! The scheme.
  contains
    procedure :: solve => robin_solve
    procedure, nopass :: is_iteration => is_general_iteration
  end type robin_t

  type :: vector_t  !! A vector on the rows of a body.
    real(dp), allocatable :: value(:)  !! (n) [length].
  end type vector_t

  !> The iteration on both sides of the rows. It keeps the matrices in a pause: to make them again would cost more than
  !> many steps.
  type, extends(iteration_t) :: two_sides_t
    type(side_t), allocatable :: side(:)  !! (n_bodies).
    real(dp), allocatable :: spring(:)  !! P_F (n_rows) [force/length].
    !> Penetrations by the displacements of both sides (n_rows) [length]; not allocated where there is nothing to do.
    real(dp), allocatable :: penetration(:)
  end type two_sides_t

contains

  !> Iterate from u_0 or the state, or continue a paused iteration.
  subroutine robin_solve(self, qp, compliance, settings, monitor, state, error)
    class(robin_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact QP of held bodies.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where a body's C_a is not positive semidefinite, or the rule of the paper is to end the iteration and
    !> gamma is beyond Theorem 3.
    type(error_t), allocatable, intent(out) :: error
    class(paused_t), allocatable :: paused
    call take_up(settings, state, paused)
    if (.not. allocated(paused)) then
      call begin(qp, compliance, settings, monitor, state, paused, error)
      if (allocated(error)) return
    end if
    select type (paused)
    type is (two_sides_t)
      if (allocated(paused%penetration)) call iterate(qp, paused, monitor, state)
    end select
    call finish_iteration(monitor, state, paused)
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine robin_solve

  !> The first iterate: both sides have the forces of the state.
  subroutine begin(qp, compliance, settings, monitor, state, paused, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets lines for the log.
    type(solver_state_t), intent(inout) :: state  !! As in `begin_iteration`.
    class(paused_t), allocatable, intent(out) :: paused  !! A `two_sides_t`.
    type(error_t), allocatable, intent(out) :: error  !! As in `robin_solve`.
    type(two_sides_t), allocatable :: now
    logical :: is_first
    integer :: b
    is_first = .not. allocated(state%constants)
    call begin_iteration(qp, compliance, state)
    allocate (now)
    if (qp%n_rows > 0) then
      state%lambda_max = ieee_value(state%lambda_max, ieee_quiet_nan)
      now%spring = merge(qp%weight/qp%theta, 0.0_dp, has_robin_conditions(qp, settings))
      call form_sides(qp, compliance, now%spring, now%side, error)
      if (allocated(error)) return
      if (interrupted()) then
        state%ended = ended_interrupted
        state%error_bound = huge(state%error_bound)
        call move_alloc(now, paused)
        return
      end if
      do b = 1, size(now%side)
        call now%side(b)%start(qp%weight(qp%block(b)%row)*state%pressure(qp%block(b)%row))
      end do
      allocate (state%constants)
      call find_constants(qp, qp%weight/qp%theta, now%spring, now%side, state%constants)
      call choose_relaxation(settings, state, error)
      if (allocated(error)) return
      if (is_first) call announce_relaxation(monitor, state, 'Robin conditions on '// &
        to_text(count(now%spring > 0))//' of '//to_text(qp%n_rows)//' constraints, spectrum '// &
        to_text(state%constants%coercivity, 4)//' to '//to_text(state%constants%smoothness, 4))
      call now%stopping%begin(settings, state%q_predicted)
      now%penetration = state%penetration
    end if
    call move_alloc(now, paused)
  end subroutine begin

  !> Which rows have Robin conditions.
  pure function has_robin_conditions(qp, settings) result(has)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows with their initial gaps.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    logical :: has(qp%n_rows)
    integer :: k
    has = .true.
    if (.not. allocated(settings%robin_gap)) return
    do k = 1, size(settings%robin_gap)
      associate (first => qp%pair_first_row(k), last => qp%pair_first_row(k + 1) - 1)
        has(first:last) = qp%gap(first:last) <= settings%robin_gap(k)
      end associate
    end do
  end function has_robin_conditions

  !> The steps of (32).
  subroutine iterate(qp, now, monitor, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(two_sides_t), intent(inout) :: now  !! The sides.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(solver_state_t), intent(inout) :: state  !! With constants and gamma; the mean of both sides, with its history.
    real(dp) :: to_last, to_next, residual, length
    do
      call step(qp, state%gamma, now, state)
      residual = norm_of(now%side%residual)
      length = norm_of(now%side%length)
      to_last = norm_of(now%side%to_last)
      to_next = norm_of(now%side%to_next)
      if (now%stopping%check(qp, to_last + residual, length, state%gamma > state%constants%gamma_limit(), monitor, &
          state, to_next + state%constants%bound_of_paper(state%gamma, length))) exit
    end do
  end subroutine iterate

  !> Norm of displacements of all bodies from the squares of each.
  pure real(dp) function norm_of(squares)
    real(dp), intent(in) :: squares(:)  !! Squares, up to rounding (n_bodies) [energy].
    norm_of = sqrt(max(0.0_dp, sum(squares)))
  end function norm_of

  !> One step of all bodies, side by side; sums in the order of the bodies, whatever thread is first.
  subroutine step(qp, gamma, now, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), intent(in) :: gamma  !! Relaxation parameter [].
    type(two_sides_t), intent(inout) :: now  !! The sides; know the norms of the step on return.
    type(solver_state_t), intent(inout) :: state  !! Gets the mean of both sides, without tension.
    real(dp), allocatable :: force(:), mean(:)
    type(vector_t) :: z(size(now%side))
    integer :: b
    force = qp%weight*max(0.0_dp, now%penetration)/qp%theta
    !$omp parallel do default(none) shared(qp, now, force, gamma) schedule(dynamic, 1)
    do b = 1, size(now%side)
      associate (row => qp%block(b)%row)
        call now%side(b)%advance(force(row), now%spring(row), gamma)
      end associate
    end do
    !$omp end parallel do
    mean = 0*force
    now%penetration = qp%initial_penetration
    do b = 1, size(now%side)
      associate (row => qp%block(b)%row, own => now%side(b))
        now%penetration(row) = now%penetration(row) - own%z
        mean(row) = mean(row) + own%lambda/2
      end associate
    end do
    mean = max(0.0_dp, mean)
    !$omp parallel do default(none) shared(qp, now, mean, z) schedule(dynamic, 1)
    do b = 1, size(now%side)
      call now%side(b)%compare(mean(qp%block(b)%row), z(b)%value)
    end do
    !$omp end parallel do
    state%pressure = mean/qp%weight
    state%penetration = qp%initial_penetration
    do b = 1, size(now%side)
      associate (row => qp%block(b)%row)
        state%penetration(row) = state%penetration(row) - z(b)%value
      end associate
    end do
  end subroutine step
end module dotyk_scheme_robin
