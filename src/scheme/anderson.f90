!> The Neumann iteration with Anderson's acceleration.
!>
!> The next iterate is that combination of the last few images under the iteration whose residuals cancel best, in the energy norm. Where
!> the residual grows all the same, the history is dropped and the best iterate so far goes on alone.
module dotyk_scheme_anderson
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_scheme_bounds, only: contraction
  use dotyk_scheme_history, only: scheme_result_t
  use dotyk_scheme_neumann, only: begin_at_free_scene, answer, finish_iteration
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_stopping, only: iteration_settings_t, stopping_t
  implicit none
  private
  public :: solve_anderson

  !> Steps that are remembered.
  integer, parameter :: window = 10
  !> A residual this many times the least one drops the history.
  real(dp), parameter :: most_growth = 2
  !> What is added to the diagonal of the least squares, relative.
  real(dp), parameter :: regularization = 1.0e-12_dp

contains

  !> Iterate from u0.
  subroutine solve_anderson(problem, settings, log, result)
    type(contact_problem_t), intent(inout) :: problem
    type(iteration_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    type(stopping_t) :: stopping
    ! Changes of f = g(m) - m and of g(m) over the last steps, in m and in y (n_rows, window).
    real(dp), allocatable :: df_m(:, :), df_y(:, :), dg_m(:, :), dg_y(:, :)
    real(dp), allocatable :: p(:), z(:), f_m(:), f_y(:), f_m_old(:), f_y_old(:), g_m_old(:), g_y_old(:), best_m(:), best_y(:), &
                             share(:)
    real(dp) :: residual, least
    integer :: n, k, place

    call begin_at_free_scene(problem, settings, result)
    n = size(result%m)
    if (n > 0) then
      allocate (p(n), z(n), df_m(n, window), df_y(n, window), dg_m(n, window), dg_y(n, window), share(window))
      k = -1
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
          k = -1
          cycle
        end if
        if (residual < least) then
          least = residual
          best_m = result%m
          best_y = result%y
        end if
        f_m = result%gamma*(p - result%m)
        f_y = result%gamma*(problem%y_free - z - result%y)
        k = k + 1
        if (k > 0) then
          place = mod(k - 1, window) + 1
          df_m(:, place) = f_m - f_m_old
          df_y(:, place) = f_y - f_y_old
          dg_m(:, place) = result%m + f_m - g_m_old
          dg_y(:, place) = result%y + f_y - g_y_old
        end if
        g_m_old = result%m + f_m
        g_y_old = result%y + f_y
        f_m_old = f_m
        f_y_old = f_y
        result%m = g_m_old
        result%y = g_y_old
        if (k > 0) then
          associate (used => min(k, window))
            call least_squares(problem%operator%weight, used, df_m, df_y, f_m, share)
            result%m = result%m - matmul(dg_m(:, :used), share(:used))
            result%y = result%y - matmul(dg_y(:, :used), share(:used))
          end associate
        end if
      end do
    end if
    call finish_iteration(log, result)
  end subroutine solve_anderson

  !> Shares that make `f - sum share df` least in the energy norm: `<a, b> = a W C W b`, and C W df_m = - df_y.
  subroutine least_squares(weight, used, df_m, df_y, f_m, share)
    real(dp), intent(in) :: weight(:)
    !> Columns in use.
    integer, intent(in) :: used
    real(dp), intent(in) :: df_m(:, :), df_y(:, :), f_m(:)
    real(dp), intent(out) :: share(:)
    type(error_t), allocatable :: error
    real(dp) :: gram(used, used), right(used, 1)
    integer :: i, j
    do j = 1, used
      do i = 1, used
        gram(i, j) = -sum(weight*df_m(:, i)*df_y(:, j))
      end do
      right(j, 1) = -sum(weight*f_m*df_y(:, j))
    end do
    gram = (gram + transpose(gram))/2
    do j = 1, used
      gram(j, j) = gram(j, j)*(1 + regularization)
    end do
    call solve_dense(gram, right, error)
    share = 0
    if (.not. allocated(error)) share(:used) = right(:, 1)
  end subroutine least_squares
end module dotyk_scheme_anderson
