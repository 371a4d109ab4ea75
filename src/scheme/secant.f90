!> The Neumann iteration with the crossed secant method (Ramiere, Helfer 2015).
!>
!> From the last two iterates and their images under the iteration it estimates along one line where the fixed point is:
!> `m := g(m) - s (g(m) - m)`, `s = <dg, df>/<df, df>` with df the change of `f = g(m) - m`, dg that of g(m), in the energy product.
module dotyk_scheme_secant
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_scheme_bounds, only: contraction
  use dotyk_scheme_history, only: scheme_result_t
  use dotyk_scheme_neumann, only: begin_at_free_scene, answer, finish_iteration
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_stopping, only: iteration_settings_t, stopping_t
  implicit none
  private
  public :: solve_secant

  !> A residual this many times the least one calls for a plain step from where the least one was.
  real(dp), parameter :: most_growth = 100

contains

  !> Iterate from u0.
  subroutine solve_secant(problem, settings, log, result)
    type(contact_problem_t), intent(inout) :: problem
    type(iteration_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    type(stopping_t) :: stopping
    real(dp), allocatable :: p(:), z(:), f_m(:), f_y(:), g_y(:), f_m_old(:), f_y_old(:), g_y_old(:), best_m(:), best_y(:)
    real(dp) :: residual, least, s, below
    logical :: plain

    call begin_at_free_scene(problem, settings, result)
    if (size(result%m) > 0) then
      allocate (p(size(result%m)), z(size(result%m)))
      plain = .true.
      least = huge(least)
      ! Nothing is proven of its factor.
      result%q_predicted = ieee_value(residual, ieee_quiet_nan)
      ! Should gamma be too large, the safeguard finds a better one: that is what the patience is for.
      call stopping%begin(settings, contraction(2/(2 + result%lambda_max), result%lambda_max), safeguarded=.true.)
      do
        call answer(problem, result%m, result%y, p, z, residual)
        if (stopping%check(problem, residual, result%gamma*residual, .false., log, result)) exit
        if (residual/most_growth > least) then
          result%m = best_m
          result%y = best_y
          least = huge(least)
          ! Perhaps gamma is to blame.
          result%gamma = min(result%gamma, 2/(2 + result%lambda_max))
          plain = .true.
          cycle
        end if
        if (residual < least) then
          least = residual
          best_m = result%m
          best_y = result%y
        end if
        f_m = result%gamma*(p - result%m)
        f_y = result%gamma*(problem%y_free - z - result%y)
        g_y = result%y + f_y
        s = 0
        if (.not. plain) then
          ! <a, b> = a W C W b, and C W times a change of m is minus the change of y.
          below = -sum(problem%operator%weight*(f_m - f_m_old)*(f_y - f_y_old))
          if (below > 0) s = -sum(problem%operator%weight*(f_m - f_m_old)*(g_y - g_y_old))/below
        end if
        result%m = result%m + (1 - s)*f_m
        result%y = result%y + (1 - s)*f_y
        f_m_old = f_m
        f_y_old = f_y
        g_y_old = g_y
        plain = .false.
      end do
    end if
    call finish_iteration(log, result)
  end subroutine solve_secant
end module dotyk_scheme_secant
