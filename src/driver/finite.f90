!> Refuses solutions with infinities or NaN before they are shown or written.
module dotyk_driver_finite
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_input_case, only: case_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: refuse_overflow

  !> Cause and remedy.
  character(*), parameter :: reason = &
    ' not finite: overflow, input values of incompatible magnitude; check their units'

contains

  !> Refuse a solution whose displacements, stresses, pressures or energy overflowed.
  subroutine refuse_overflow(case, problem, solution, pair_solution, state, error)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies, their ranks, contact pairs.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements and stresses of the bodies (n_bodies).
    !> Contact pressures, gaps and resultants of the pairs (n_pairs).
    type(pair_solution_t), intent(in) :: pair_solution(:)
    type(solver_state_t), intent(in) :: state  !! State of the scheme, with the energy.
    !> Allocated where a value is not finite; names the first body or pair; exit code `exit_not_solvable`.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: what
    ! 1 where a number is not finite.
    real(dp), dimension(size(solution)) :: moved, stressed
    integer :: b, k
    moved = 0
    stressed = 0
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      if (allocated(solution(b)%displacement)) moved(b) = not_finite(solution(b)%displacement)
      if (allocated(solution(b)%stress)) stressed(b) = not_finite(solution(b)%stress)
    end do
    call problem%ranks%share_greatest(moved)
    call problem%ranks%share_greatest(stressed)
    do b = 1, size(solution)
      if (.not. (moved(b) > 0 .or. stressed(b) > 0)) cycle
      what = 'stresses'
      if (moved(b) > 0) what = 'displacements'
      call set_error(error, case%file//':'//to_text(case%body(b)%line)//': body '//quoted(problem%body(b)%name)// &
                     ': the '//what//' are'//reason, exit_not_solvable)
      return
    end do
    do k = 1, size(pair_solution)
      associate (found => pair_solution(k))
        if (all(ieee_is_finite(found%pressure)) .and. all(ieee_is_finite(found%projected)) .and. &
            all(ieee_is_finite(found%gap)) .and. all(ieee_is_finite(found%force))) cycle
      end associate
      call set_error(error, case%file//':'//to_text(case%contact(k)%line)//': &contact '// &
                     quoted(problem%pair(k)%name)//': the pressures are'//reason, exit_not_solvable)
      return
    end do
    if (.not. ieee_is_finite(state%energy)) &
      call set_error(error, case%file//': the energy is'//reason, exit_not_solvable)
  end subroutine refuse_overflow

  !> 1 where a number is not finite, 0 where all are.
  pure real(dp) function not_finite(value)
    real(dp), intent(in) :: value(:, :)  !! Numbers (any, any).
    not_finite = merge(0.0_dp, 1.0_dp, all(ieee_is_finite(value)))
  end function not_finite
end module dotyk_driver_finite
