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
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_limit, ended_stalled
  use dotyk_scheme_stopping, only: solver_settings_t, stopping_t, relative
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

  !> Relaxation: F'' <= A + 2 X on points that are glued on both sides, so that gamma < 1 converges; more is faster.
  real(dp), parameter :: relaxation = 0.9_dp
  !> The factor per step is not known beforehand; no gain for ten times 1/(1-q) steps is no hope.
  real(dp), parameter :: slowest = 0.999_dp
  !> Bounds below this are not to be had with rounding errors.
  real(dp), parameter :: least_tolerance = 1.0e-12_dp

contains

  !> The scheme forms the entries of the compliance.
  pure integer function robin_expected_products(self) result(n)
    class(robin_t), intent(in) :: self
    n = 0
    associate (not_needed => same_type_as(self, self))
    end associate
  end function robin_expected_products

  !> Iterate from u_0 or the state; rows count as likely to be active once they penetrated.
  subroutine robin_solve(self, qp, compliance, theta, settings, monitor, state, error)
    class(robin_t), intent(in) :: self
    !> Of held bodies.
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> Above 0 (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    type(solver_settings_t), intent(in) :: settings
    class(monitor_t), intent(inout) :: monitor
    type(solver_state_t), intent(inout) :: state
    !> Allocated where the matrix of a body is singular.
    type(error_t), allocatable, intent(out) :: error
    type(stopping_t) :: stopping
    type(solver_state_t) :: mean
    type(side_t), allocatable :: side(:)
    real(dp), allocatable :: p(:), z(:)
    logical, allocatable :: likely(:), last(:)
    real(dp) :: residual, gamma, tolerance
    integer :: b

    call begin_iteration(qp, compliance, theta, settings, state)
    if (qp%n_rows > 0) then
      gamma = relaxation
      state%gamma = gamma
      state%q_predicted = ieee_value(gamma, ieee_quiet_nan)
      allocate (p(qp%n_rows), z(qp%n_rows), last(qp%n_rows))
      call prepare_sides(qp, compliance, side)
      do b = 1, size(side)
        side(b)%lambda = qp%weight(qp%block(b)%row)*state%m(qp%block(b)%row)
      end do
      last = state%m > 0 .or. state%y > 0
      call invert_sides(qp, theta, last, side, error)
      if (allocated(error)) return
      tolerance = settings%tolerance
      call stopping%begin(settings, slowest, split=.true.)
      do
        likely = last .or. state%y > 0
        if (any(likely .neqv. last)) then
          call invert_sides(qp, theta, likely, side, error)
          if (allocated(error)) return
          last = likely
        end if
        p = max(0.0_dp, state%y)/theta
        residual = 0
        do b = 1, size(side)
          associate (row => qp%block(b)%row, own => side(b))
            if (size(row) == 0) cycle
            own%change = qp%weight(row)*p(row) - own%lambda
            residual = residual + dot_product(own%change, matmul(own%compliance, own%change))
            own%change = gamma*matmul(own%inverse, own%change)
            own%lambda = own%lambda + own%change
            own%z = matmul(own%compliance, own%lambda)
          end associate
        end do
        residual = sqrt(max(0.0_dp, residual))
        z = 0
        do b = 1, size(side)
          z(qp%block(b)%row) = z(qp%block(b)%row) + side(b)%z
        end do
        ! What both sides would agree on, for the history: the pressures of the new penetrations.
        state%y = qp%initial_penetration - z
        state%m = max(0.0_dp, state%y)/theta
        ! Twice, so that it is a bound of the mean of both sides too.
        if (.not. stopping%check(qp, theta, 2*residual, residual, .true., monitor, state)) cycle
        mean = state
        call find_mean(qp, compliance, theta, side, mean)
        if (state%ended /= ended_converged .or. settings%stop_rule /= stop_residual .or. &
            mean%error_bound <= settings%tolerance) exit
        ! The sides are near enough to the solution, and their mean is not: on to where it is.
        mean%ended = merge(ended_limit, ended_stalled, state%history%n >= settings%max_iterations)
        if (tolerance < least_tolerance .or. state%history%n >= settings%max_iterations) exit
        tolerance = 0.5_dp*tolerance*settings%tolerance/mean%error_bound
        call stopping%tighten(tolerance)
      end do
      state = mean
      state%history%error_bound(state%history%n) = state%error_bound
      state%energy = qp%energy(theta, state%m, state%y)
      state%max_penetration = max(0.0_dp, maxval(state%y))
    end if
    call finish_iteration(monitor, state)
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine robin_solve

  !> One state for both sides, the mean of their forces, with a bound of its own.
  subroutine find_mean(qp, compliance, theta, side, mean)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> (n_bodies).
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
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> (n_bodies).
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
    type(contact_qp_t), intent(in) :: qp
    !> (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> (n_rows).
    logical, intent(in) :: likely(:)
    !> (n_bodies).
    type(side_t), intent(inout) :: side(:)
    !> Allocated where a matrix is singular.
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
