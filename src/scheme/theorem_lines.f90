!> Lines of the log on the general iteration (32): what Theorems 3 and 4 and the sharp numbers say of it.
module dotyk_scheme_theorem_lines
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: announce_relaxation, factor_text

contains

  !> How fast the iteration will be, where it would not converge, and what Theorems 3 and 4 say of it.
  subroutine announce_relaxation(monitor, state, spectrum)
    class(monitor_t), intent(inout) :: monitor  !! Gets lines for the log.
    type(solver_state_t), intent(in) :: state  !! With constants, gamma and the factor.
    character(*), intent(in) :: spectrum  !! The eigenvalues that rule the iteration.
    character(:), allocatable :: best
    associate (constants => state%constants)
      call monitor%note('relaxation       gamma '//to_text(state%gamma, 4)//' (stability limit '// &
                        to_text(constants%gamma_limit(), 4)//'), '//spectrum//', convergence factor at most '// &
                        factor_text(state%q_predicted))
      best = factor_of_paper(constants, constants%gamma_of_paper())
      ! The constants are estimates on the safe side.
      if (state%gamma < constants%gamma_limit_of_paper()) then
        call monitor%note('Theorem 3        gamma_2 >= '//to_text(constants%gamma_limit_of_paper(), 4)// &
                          ': convergence')
        call monitor%note('Theorem 4        q = '//factor_of_paper(constants, state%gamma)// &
                          ' of (40); the least is '//best//', with gamma '//to_text(constants%gamma_of_paper(), 4))
      else
        call monitor%note('Theorem 3        gamma_2 >= '//to_text(constants%gamma_limit_of_paper(), 4)// &
                          ': does not apply, gamma is larger')
        call monitor%note('Theorem 4        best gamma '//to_text(constants%gamma_of_paper(), 4)//', with q = '// &
                          best//' of (40)')
      end if
      if (state%gamma > constants%gamma_limit()) call monitor%warn('gamma = '//to_text(state%gamma)// &
        ' may diverge: the stability limit is '//to_text(constants%gamma_limit()))
    end associate
  end subroutine announce_relaxation

  !> q of (40), without loss of digits near 1.
  function factor_of_paper(constants, gamma) result(text)
    type(iteration_constants_t), intent(in) :: constants  !! Constants of the iteration.
    real(dp), intent(in) :: gamma  !! Relaxation parameter below gamma_2 [].
    character(:), allocatable :: text
    real(dp) :: q
    q = constants%contraction_of_paper(gamma)
    text = factor_text(q)
    if (index(text, '1 - ') == 1) text = '1 - '//to_text(constants%gain_of_paper(gamma)/(1 + q), 3)
    if (.not. q < 1) text = '1 - '//to_text(constants%gain_of_paper(gamma)/2, 3)
  end function factor_of_paper

  !> A contraction factor; near 1 as 1 less a small number.
  function factor_text(q) result(text)
    real(dp), intent(in) :: q  !! The factor [].
    character(:), allocatable :: text
    real(dp), parameter :: near_one = 1.0e-3_dp
    text = to_text(q, 6)
    if (q < 1 .and. 1 - q < near_one) text = '1 - '//to_text(1 - q, 3)
  end function factor_text
end module dotyk_scheme_theorem_lines
