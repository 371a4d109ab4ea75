!> The parallel Robin scheme: G = A + X in (32), X the penalty form of each body by itself on the rows that are likely
!> to be active.
!>
!> On every body at once `(K_a + B_a^T D B_a)(u_a^{k+1} - u_a^k) = -gamma (K_a u_a^k - f_a + B_a^T W p^k)`,
!> `D = Theta^{-1} W` on those rows: each side of a row lies on a spring whose other end is held where the other side
!> was. With the body's own compliance `C_a = B_a K_a^{-1} B_a^T` and its own forces,
!> `u_a = u0_a - K_a^{-1} B_a^T lambda_a`, this is `lambda_a += gamma (I + D C_a)^{-1} (W p - lambda_a)`: no solve of a
!> body once the entries of C_a are there. Both sides agree on the force at the solution only.
module dotyk_scheme_robin
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: stop_residual
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_compliance, only: compliance_t, entries_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_neumann, only: begin_iteration, evaluate_step, finish_iteration
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: paused_t, solver_state_t, ended_converged, ended_limit, ended_stalled
  use dotyk_scheme_stopping, only: iteration_t, relative, solver_settings_t, take_up
  implicit none
  private

  !> The scheme.
  type, extends(scheme_t), public :: robin_t
  contains
    procedure :: solve => robin_solve
    procedure :: expected_products => robin_expected_products
  end type robin_t

  !> One body: everything is on its rows.
  type :: side_t
    !> Forces [force], their change in a step [force], and displacements C_a lambda_a [length] (n_rows of the block).
    real(dp), allocatable :: lambda(:), change(:), z(:)
    !> C_a [length/force], and (I + D C_a)^{-1} [] (n_rows, n_rows).
    real(dp), allocatable :: compliance(:, :), inverse(:, :)
  end type side_t

  !> The iteration on both sides of the rows. It keeps the matrices in a pause: to make them again would cost more than
  !> many steps.
  type, extends(iteration_t) :: two_sides_t
    !> (n_bodies).
    type(side_t), allocatable :: side(:)
    !> Rows that the inverses have springs on (n_rows).
    logical, allocatable :: likely(:)
    !> Penetrations by the displacements of both sides (n_rows) [length].
    real(dp), allocatable :: y(:)
    !> Tolerance of the sides, which becomes smaller until their mean has the one that was asked for [].
    real(dp) :: tolerance = 0
  end type two_sides_t

  !> Relaxation: F'' <= A + 2 X on points that are glued on both sides, so that gamma < 1 converges; more is faster.
  real(dp), parameter :: relaxation = 0.9_dp
  !> The factor per step is not known beforehand; no gain for ten times 1/(1-q) steps is no hope.
  real(dp), parameter :: slowest = 0.999_dp
  !> Where the mean of both sides is farther from the solution than the sides, their next tolerance is this fraction of
  !> the one that the ratio of the bounds asks for.
  real(dp), parameter :: tightening = 0.5_dp
  !> Bounds below this are not to be had with rounding errors.
  real(dp), parameter :: least_tolerance = 1.0e-12_dp

contains

  !> The scheme forms the entries of the compliance.
  pure integer function robin_expected_products(self) result(n)
    !> The scheme.
    class(robin_t), intent(in) :: self
    n = 0
    associate (not_needed => same_type_as(self, self))
    end associate
  end function robin_expected_products

  !> Iterate from u_0 or the state, or continue a paused iteration; rows count as likely to be active once they
  !> penetrated.
  subroutine robin_solve(self, qp, compliance, theta, settings, monitor, state, error)
    !> The scheme.
    class(robin_t), intent(in) :: self
    !> Contact QP of held bodies.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters, above 0 (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where I + D C_a of a body is singular.
    type(error_t), allocatable, intent(out) :: error
    class(paused_t), allocatable :: paused
    call take_up(settings, state, paused)
    if (.not. allocated(paused)) then
      call begin(qp, compliance, theta, settings, state, paused, error)
      if (allocated(error)) return
    end if
    select type (paused)
    type is (two_sides_t)
      if (qp%n_rows > 0) call iterate(qp, compliance, theta, settings, paused, monitor, state, error)
      if (allocated(error)) return
    end select
    call finish_iteration(monitor, state, paused)
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine robin_solve

  !> The first iterate: both sides have the forces of the state.
  subroutine begin(qp, compliance, theta, settings, state, paused, error)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> As in `begin_iteration`.
    type(solver_state_t), intent(inout) :: state
    !> A `two_sides_t`.
    class(paused_t), allocatable, intent(out) :: paused
    !> Allocated where I + D C_a of a body is singular.
    type(error_t), allocatable, intent(out) :: error
    type(two_sides_t), allocatable :: now
    integer :: b
    call begin_iteration(qp, compliance, theta, settings, state)
    allocate (now)
    if (qp%n_rows > 0) then
      state%gamma = relaxation
      state%q_predicted = ieee_value(state%q_predicted, ieee_quiet_nan)
      call prepare_sides(qp, compliance, now%side)
      do b = 1, size(now%side)
        now%side(b)%lambda = qp%weight(qp%block(b)%row)*state%m(qp%block(b)%row)
      end do
      now%likely = state%m > 0 .or. state%y > 0
      now%y = state%y
      now%tolerance = settings%tolerance
      call invert_sides(qp, theta, now%likely, now%side, error)
      if (allocated(error)) return
      call now%stopping%begin(settings, slowest, split=.true.)
    end if
    call move_alloc(now, paused)
  end subroutine begin

  !> The steps, until the mean of both sides is accurate enough.
  subroutine iterate(qp, compliance, theta, settings, now, monitor, state, error)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Settings of the user.
    type(solver_settings_t), intent(in) :: settings
    !> The sides.
    type(two_sides_t), intent(inout) :: now
    !> Gets each step, and lines for the log.
    class(monitor_t), intent(inout) :: monitor
    !> Gets the history; the mean of both sides on return.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where I + D C_a of a body is singular.
    type(error_t), allocatable, intent(out) :: error
    type(solver_state_t) :: mean
    real(dp) :: residual
    do
      call step(qp, theta, now, residual, error)
      if (allocated(error)) return
      ! What both sides would agree on, for the history: the pressures of the new penetrations.
      state%y = now%y
      state%m = max(0.0_dp, state%y)/theta
      ! Twice, so that it is a bound of the mean of both sides too.
      if (.not. now%stopping%check(qp, theta, 2*residual, residual, .true., monitor, state)) cycle
      mean = state
      call find_mean(qp, compliance, theta, now%side, mean)
      if (state%ended /= ended_converged .or. settings%stop_rule /= stop_residual .or. &
          mean%error_bound <= settings%tolerance) exit
      ! The sides are near enough to the solution, and their mean is not: on to where it is.
      mean%ended = merge(ended_limit, ended_stalled, state%history%n >= settings%max_iterations)
      if (now%tolerance < least_tolerance .or. state%history%n >= settings%max_iterations) exit
      now%tolerance = tightening*now%tolerance*settings%tolerance/mean%error_bound
      call now%stopping%tighten(now%tolerance)
    end do
    state = mean
    state%history%error_bound(state%history%n) = state%error_bound
    state%energy = qp%energy(theta, state%m, state%y)
    state%max_penetration = max(0.0_dp, maxval(state%y))
  end subroutine iterate

  !> One step of all bodies.
  subroutine step(qp, theta, now, residual, error)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The sides.
    type(two_sides_t), intent(inout) :: now
    !> Distance of the forces to those of the last penetrations, which bounds the error of both sides [sqrt(energy)].
    real(dp), intent(out) :: residual
    !> Allocated where I + D C_a of a body is singular.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: p(:), z(:)
    logical, allocatable :: likely(:)
    integer :: b
    allocate (likely(qp%n_rows))
    likely = now%likely .or. now%y > 0
    if (any(likely .neqv. now%likely)) then
      call invert_sides(qp, theta, likely, now%side, error)
      if (allocated(error)) return
      now%likely = likely
    end if
    p = max(0.0_dp, now%y)/theta
    residual = 0
    allocate (z(qp%n_rows), source=0.0_dp)
    do b = 1, size(now%side)
      associate (row => qp%block(b)%row, own => now%side(b))
        if (size(row) == 0) cycle
        own%change = qp%weight(row)*p(row) - own%lambda
        residual = residual + dot_product(own%change, matmul(own%compliance, own%change))
        own%change = relaxation*matmul(own%inverse, own%change)
        own%lambda = own%lambda + own%change
        own%z = matmul(own%compliance, own%lambda)
        z(row) = z(row) + own%z
      end associate
    end do
    residual = sqrt(max(0.0_dp, residual))
    now%y = qp%initial_penetration - z
  end subroutine step

  !> One state for both sides, the mean of their forces, with a bound of its own.
  subroutine find_mean(qp, compliance, theta, side, mean)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Bodies with their forces (n_bodies).
    type(side_t), intent(in) :: side(:)
    !> Gets m, y and error bound.
    type(solver_state_t), intent(inout) :: mean
    real(dp), dimension(size(mean%m)) :: p, z
    real(dp) :: bound
    integer :: b
    mean%m = 0
    do b = 1, size(side)
      associate (row => qp%block(b)%row)
        mean%m(row) = mean%m(row) + side(b)%lambda/(2*qp%weight(row))
      end associate
    end do
    mean%m = max(0.0_dp, mean%m)
    call compliance%multiply(qp, qp%weight*mean%m, z)
    mean%y = qp%initial_penetration - z
    call evaluate_step(qp, compliance, theta, mean%m, mean%y, p, z, bound)
    bound = min(bound, sqrt(duality_gap(qp%weight, theta, mean%m, mean%y)))
    mean%error_bound = relative(bound, qp%energy_norm(mean%m, mean%y))
  end subroutine find_mean

  !> The bodies' own compliances.
  subroutine prepare_sides(qp, compliance, side)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Bodies with their compliances, without forces (n_bodies).
    type(side_t), allocatable, intent(out) :: side(:)
    type(entries_t), allocatable :: entries(:)
    integer :: b, n
    allocate (side(size(qp%block)))
    call compliance%form_all(qp, entries)
    do b = 1, size(side)
      n = size(qp%block(b)%row)
      allocate (side(b)%lambda(n), side(b)%change(n), side(b)%z(n), source=0.0_dp)
      call move_alloc(entries(b)%value, side(b)%compliance)
    end do
  end subroutine prepare_sides

  !> (I + D C_a)^{-1} of all bodies, with springs on the rows that are likely to be active.
  subroutine invert_sides(qp, theta, likely, side, error)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Rows that are likely to be active (n_rows).
    logical, intent(in) :: likely(:)
    !> Bodies; get the inverse matrices (n_bodies).
    type(side_t), intent(inout) :: side(:)
    !> Allocated where I + D C_a of a body is singular: C_a is not positive semidefinite then.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: matrix(:, :)
    integer :: b, i, n
    do b = 1, size(side)
      associate (row => qp%block(b)%row, own => side(b))
        n = size(row)
        if (n == 0) cycle
        matrix = own%compliance
        if (allocated(own%inverse)) deallocate (own%inverse)
        allocate (own%inverse(n, n), source=0.0_dp)
        do i = 1, n
          matrix(i, :) = merge(qp%weight(row(i))/theta(row(i)), 0.0_dp, likely(row(i)))*matrix(i, :)
          matrix(i, i) = matrix(i, i) + 1
          own%inverse(i, i) = 1
        end do
        call solve_dense(matrix, own%inverse, error)
        if (allocated(error)) return
      end associate
    end do
  end subroutine invert_sides
end module dotyk_scheme_robin
