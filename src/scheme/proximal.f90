!> The proximal method of multipliers, for scenes in which active sets would come back.
!>
!> One step replaces the problem by one with softer contact, `theta p + (rho - theta)(p - p_k) = y` on closed points, and with springs on
!> the free motions that are at rest at the last ones: the minimum of
!>
!>     A(u,u)/2 - L(u) + sum w max(0, y + (rho - theta) p_k)^2/(2 rho) + hold |alpha - alpha_k|^2/2,
!>
!> which is smooth and strictly convex. Newton's method with an exact line search ends there after finitely many active sets. The
!> steps converge to a solution of the true problem if there is one (Rockafellar 1976), and its active set is met after
!> finitely many of them.
module dotyk_scheme_proximal
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_line_search, only: line_minimum
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: proximal_step

  !> Newton steps at most; each of them lowers the function, so that no active set comes back.
  integer, parameter :: most_steps = 100

contains

  !> One step.
  subroutine proximal_step(problem, compliance, system, rho, hold, lambda, alpha, y, steps, error)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> Another one on return.
    class(active_system_t), intent(inout) :: system
    !> Softness of the contact (n_rows), at least theta [length/pressure]; springs on the motions (coarse%n) [force/length].
    real(dp), intent(in) :: rho(:), hold(:)
    !> From the last iterate to the next: forces (n_rows), amplitudes (coarse%n), penetrations (n_rows).
    real(dp), intent(inout) :: lambda(:), alpha(:), y(:)
    !> Linear systems that were solved.
    integer, intent(out) :: steps
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: shift(:), centre(:), active_lambda(:), new_lambda(:), new_alpha(:), new_y(:), z(:), c_lambda(:), &
                             c_change(:), motion(:)
    logical, allocatable :: active(:), last(:)
    real(dp) :: t, slope
    integer :: n

    n = size(lambda)
    allocate (z(n), c_lambda(n), c_change(n), motion(n), new_alpha(size(alpha)), last(n), new_lambda(n))
    shift = (rho - problem%operator%theta)*lambda/problem%operator%weight
    centre = alpha
    last = .false.
    do steps = 1, most_steps
      if (interrupted()) exit
      active = y + shift > 0
      if (steps > 1 .and. t >= 1 .and. all(active .eqv. last)) exit
      last = active
      call system%init(problem, compliance, rho, active, error, hold)
      if (allocated(error)) exit
      active_lambda = lambda(system%row)
      call system%solve(problem, compliance, problem%y_free(system%row) + shift(system%row), &
                        problem%coarse%resultant + hold*centre, active_lambda, new_alpha)
      new_lambda = 0
      new_lambda(system%row) = active_lambda
      deallocate (active_lambda)
      call compliance%multiply(problem, new_lambda, z)
      call problem%coarse%displacement(problem%operator, new_alpha, motion)
      new_y = problem%y_free - z + motion
      call compliance%multiply(problem, lambda, c_lambda)
      c_change = z - c_lambda
      ! Derivative of the smooth part along the step, and its second derivative.
      slope = dot_product(new_lambda - lambda, c_lambda) + &
        dot_product(new_alpha - alpha, hold*(alpha - centre) + problem%coarse%springs(alpha) - problem%coarse%resultant)
      t = line_minimum(slope, max(0.0_dp, dot_product(new_lambda - lambda, c_change)) + sum(hold*(new_alpha - alpha)**2) + &
                       dot_product(new_alpha - alpha, problem%coarse%springs(new_alpha - alpha)), &
                       problem%operator%weight/rho, y + shift, new_y - y)
      t = min(1.0_dp, t)
      if (t > 0.999999_dp) t = 1
      lambda = lambda + t*(new_lambda - lambda)
      alpha = alpha + t*(new_alpha - alpha)
      y = y + t*(new_y - y)
    end do
    steps = min(steps, most_steps)
  end subroutine proximal_step
end module dotyk_scheme_proximal
