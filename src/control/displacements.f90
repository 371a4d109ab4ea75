!> From the answer of the scheme to displacements that have the digits that were asked for.
module dotyk_driver_displacements
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_memory, only: set_stage
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_correction, only: correct_digits
  use dotyk_driver_digits, only: body_digits_t
  use dotyk_driver_error_budget, only: needs_displacements
  use dotyk_driver_free_scene, only: free_body_t
  use dotyk_driver_body_solution, only: body_solution_t, recover_bodies
  use dotyk_driver_refinement, only: energy_of, refine_bodies, refuse_lost_pressures
  use dotyk_driver_rounding, only: expect_rounding, flag_rounded, gap_rounding, measure_rounding, relative_rounding, &
    worth_measuring, worth_of_digits
  use dotyk_driver_timing, only: timing_t, stopwatch_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_converged
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: find_displacements

contains

  !> Displacements from the state of the scheme; where rounding matters, refined, with the contact that belongs to them.
  subroutine find_displacements(case, body, classes, pair, problem, compliance, alone, n_blas, tolerance, log, watch, timing, &
                                digits, solution, result, error)
    type(case_t), intent(in) :: case
    !> (n_bodies), (n_pairs).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(contact_pair_t), intent(in) :: pair(:)
    !> Gaps change where digits are lost.
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(inout) :: compliance
    !> What bodies do that touch nothing (n_bodies).
    type(free_body_t), intent(in) :: alone(:)
    !> BLAS threads of each solve.
    integer, intent(in) :: n_blas
    !> Where the scheme has stopped.
    real(dp), intent(in) :: tolerance
    type(log_t), intent(inout) :: log
    !> Laps of iteration and recovery are taken.
    type(stopwatch_t), intent(inout) :: watch
    type(timing_t), intent(inout) :: timing
    !> What is known of the factors; counts steps of refinement (n_bodies).
    type(body_digits_t), intent(inout) :: digits(:)
    !> Displacements, and stresses where they are wanted; empty where neither is (n_bodies).
    type(body_solution_t), allocatable, intent(inout) :: solution(:)
    !> The answer of the scheme; its bound contains rounding on return.
    type(scheme_result_t), intent(inout) :: result
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: distance(size(body)), digit(size(body)), rounding, gaps, norm, left
    logical :: wanted
    !> So many units of the last digit are as good as one.
    real(dp), parameter :: few_digits = 4
    wanted = needs_displacements(case)
    rounding = 0
    norm = 0
    digit = 0
    if (wanted) then
      call recover_and_measure(.false.)
      if (allocated(error)) return
      if (result%ended == ended_converged) call flag_rounded(distance, norm, tolerance, digits)
      call watch%lap(timing%recover)
    end if
    if (any(digits%needs_refinement())) then
      call set_stage('iterating')
      call correct_digits(case, body, classes, pair, problem, compliance, alone, n_blas, tolerance, log, &
                          digits, solution, result, rounding, error)
      if (allocated(error)) return
      call watch%lap(timing%iterate)
      if (wanted) call recover_and_measure(.true.)
      if (allocated(error)) return
    end if
    if (wanted) then
      call refuse_lost_pressures(body, digits, distance, norm, error)
      if (allocated(error)) return
      rounding = rounding + relative_rounding([distance, gaps], norm, digits)
      if (rounding > tolerance) call worth_of_digits(body, solution, digit)
    else
      if (allocated(solution)) deallocate (solution)
      allocate (solution(size(body)))
    end if
    call result%add_rounding(rounding, few_digits*norm2(digit)/max(tiny(rounding), norm), tolerance)
  contains
    !> Displacements, and how far rounding leaves them from where they should be.
    subroutine recover_and_measure(refined)
      !> Whether those that need it are refined.
      logical, intent(in) :: refined
      call set_stage('recovering displacements')
      call recover_bodies(body, problem, result%m, result%alpha, alone, case%output%stress, n_blas, solution)
      if (refined) then
        call refine_bodies(body, classes, problem, result%m, result%alpha, digits, solution, left, error)
        if (allocated(error)) return
        result%energy = energy_of(body, problem, solution, result%y)
      end if
      norm = problem%norm(result%m, result%y, result%alpha/problem%coarse%scale)
      call expect_rounding(body, classes, problem, solution, norm, distance)
      gaps = 0
      if (.not. (refined .or. norm2(distance) > worth_measuring*tolerance*norm)) return
      call measure_rounding(body, problem, result%m, solution, n_blas, distance, error)
      gaps = gap_rounding(problem, solution, result%m, result%y)
    end subroutine recover_and_measure
  end subroutine find_displacements
end module dotyk_driver_displacements
