!> The parallel Robin scheme: G = A + X in (32), X the penalty form of each body by itself on the points that are likely to touch.
!>
!> On every body at once `(K_a + B_a^T D B_a)(u_a^{k+1} - u_a^k) = -gamma (K_a u_a^k - f_a + B_a^T W p^k)`, `D = Theta^{-1} W` on those points:
!> each side of a point lies on a spring that is held where the other side was. With the body's own compliance `C_a = B_a K_a^{-1} B_a^T` and
!> its own forces, `u_a = u0_a - K_a^{-1} B_a^T lambda_a`, this is `lambda_a += gamma (I + D C_a)^{-1} (W p - lambda_a)`: no solve of a body once the columns
!> of C_a are there. Both sides agree on the force at the solution only.
module dotyk_scheme_robin
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: stop_residual
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_limit, ended_stalled
  use dotyk_scheme_neumann, only: begin_at_free_scene, answer, finish_iteration
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_stopping, only: iteration_settings_t, stopping_t, relative
  implicit none
  private
  public :: solve_robin

  !> One body: everything is on its rows.
  type :: side_t
    !> Forces, the same as the next iterate will have them, and displacements C_a lambda_a (n_rows of the block).
    real(dp), allocatable :: lambda(:), change(:), z(:)
    !> C_a, and (I + D C_a)^{-1} (n_rows, n_rows).
    real(dp), allocatable :: compliance(:, :), inverse(:, :)
  end type side_t

  !> Relaxation: F'' <= A + 2 X on points that are glued on both sides, so that gamma < 1 converges; more is faster.
  real(dp), parameter :: relaxation = 0.9_dp
  !> The factor per step is not known beforehand; no gain for ten times 1/(1-q) steps is no hope.
  real(dp), parameter :: slowest = 0.999_dp
  !> Bounds below this are not to be had with rounding errors.
  real(dp), parameter :: least_tolerance = 1.0e-12_dp

contains

  !> Iterate from u0; points count as likely to touch once they penetrated.
  subroutine solve_robin(problem, settings, log, result, error)
    type(contact_problem_t), intent(inout) :: problem
    type(iteration_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    type(error_t), allocatable, intent(out) :: error
    type(stopping_t) :: stopping
    type(scheme_result_t) :: mean
    type(side_t), allocatable :: side(:)
    real(dp), allocatable :: p(:), z(:), change(:)
    logical, allocatable :: likely(:), last(:)
    real(dp) :: residual, gamma, tolerance
    integer :: b

    call begin_at_free_scene(problem, settings, result)
    if (size(result%m) > 0) then
      gamma = relaxation
      result%gamma = gamma
      result%q_predicted = ieee_value(gamma, ieee_quiet_nan)
      allocate (p(size(result%m)), z(size(result%m)), change(size(result%m)), last(size(result%m)))
      call prepare_sides(problem, side)
      do b = 1, size(side)
        side(b)%lambda = problem%operator%weight(problem%operator%block(b)%row)*result%m(problem%operator%block(b)%row)
      end do
      last = result%m > 0 .or. result%y > 0
      call glue(problem, last, side, error)
      if (allocated(error)) return
      tolerance = settings%tolerance
      call stopping%begin(settings, slowest, split=.true.)
      do
        likely = last .or. result%y > 0
        if (any(likely .neqv. last)) then
          call glue(problem, likely, side, error)
          if (allocated(error)) return
          last = likely
        end if
        p = max(0.0_dp, result%y)/problem%operator%theta
        residual = 0
        change = 0
        do b = 1, size(side)
          associate (row => problem%operator%block(b)%row, own => side(b))
            if (size(row) == 0) cycle
            own%change = problem%operator%weight(row)*p(row) - own%lambda
            residual = residual + dot_product(own%change, matmul(own%compliance, own%change))
            own%change = gamma*matmul(own%inverse, own%change)
            own%lambda = own%lambda + own%change
            own%z = matmul(own%compliance, own%lambda)
          end associate
        end do
        residual = sqrt(max(0.0_dp, residual))
        z = 0
        do b = 1, size(side)
          z(problem%operator%block(b)%row) = z(problem%operator%block(b)%row) + side(b)%z
        end do
        ! What both sides would agree on, for the record: the pressures of the new penetrations.
        result%y = problem%y_free - z
        result%m = max(0.0_dp, result%y)/problem%operator%theta
        ! Twice, so that the mean of both sides keeps to it too.
        if (.not. stopping%check(problem, 2*residual, residual, .true., log, result)) cycle
        mean = result
        call find_mean(problem, side, mean)
        if (result%ended /= ended_converged .or. settings%stop_rule /= stop_residual .or. &
            mean%error_bound <= settings%tolerance) exit
        ! The sides are near enough to the solution, and their mean is not: on to where it is.
        mean%ended = merge(ended_limit, ended_stalled, result%history%n >= settings%max_iterations)
        if (tolerance < least_tolerance .or. result%history%n >= settings%max_iterations) exit
        tolerance = 0.5_dp*tolerance*settings%tolerance/mean%error_bound
        call stopping%go_on(tolerance)
      end do
      result = mean
      result%history%error_bound(result%history%n) = result%error_bound
      result%energy = problem%energy(result%m, result%y)
      result%max_penetration = max(0.0_dp, maxval(result%y))
    end if
    call finish_iteration(log, result)
  end subroutine solve_robin

  !> One state for both sides, the mean of their forces, with a bound of its own.
  subroutine find_mean(problem, side, mean)
    type(contact_problem_t), intent(inout) :: problem
    !> (n_bodies).
    type(side_t), intent(in) :: side(:)
    !> Its m, y and error bound are set.
    type(scheme_result_t), intent(inout) :: mean
    real(dp), dimension(size(mean%m)) :: p, z
    real(dp) :: agreed
    integer :: b
    mean%m = 0
    do b = 1, size(side)
      associate (row => problem%operator%block(b)%row)
        mean%m(row) = mean%m(row) + side(b)%lambda/(2*problem%operator%weight(row))
      end associate
    end do
    mean%m = max(0.0_dp, mean%m)
    call problem%compliance(problem%operator%weight*mean%m, z)
    mean%y = problem%y_free - z
    call answer(problem, mean%m, mean%y, p, z, agreed)
    agreed = min(agreed, sqrt(duality_gap(problem%operator%weight, problem%operator%theta, mean%m, mean%y)))
    mean%error_bound = relative(agreed, problem%norm(mean%m, mean%y))
  end subroutine find_mean

  !> The bodies' own compliances.
  subroutine prepare_sides(problem, side)
    type(contact_problem_t), intent(inout) :: problem
    type(side_t), allocatable, intent(out) :: side(:)
    type(explicit_compliance_t) :: compliance
    integer :: b, n
    allocate (side(size(problem%operator%block)))
    call compliance%init(size(side), .false.)
    call compliance%form(problem)
    do b = 1, size(side)
      n = size(problem%operator%block(b)%row)
      allocate (side(b)%lambda(n), side(b)%change(n), side(b)%z(n), source=0.0_dp)
      side(b)%compliance = compliance%body(b)%value
    end do
  end subroutine prepare_sides

  !> (I + D C_a)^{-1} of all bodies for the points that are likely to touch.
  subroutine glue(problem, likely, side, error)
    type(contact_problem_t), intent(in) :: problem
    logical, intent(in) :: likely(:)
    type(side_t), intent(inout) :: side(:)
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: matrix(:, :)
    integer :: b, i, n
    do b = 1, size(side)
      associate (row => problem%operator%block(b)%row, own => side(b))
        n = size(row)
        if (n == 0) cycle
        matrix = own%compliance
        if (allocated(own%inverse)) deallocate (own%inverse)
        allocate (own%inverse(n, n), source=0.0_dp)
        do i = 1, n
          matrix(i, :) = merge(problem%operator%weight(row(i))/problem%operator%theta(row(i)), 0.0_dp, likely(row(i)))*matrix(i, :)
          matrix(i, i) = matrix(i, i) + 1
          own%inverse(i, i) = 1
        end do
        call solve_dense(matrix, own%inverse, error)
        if (allocated(error)) return
      end associate
    end do
  end subroutine glue
end module dotyk_scheme_robin
