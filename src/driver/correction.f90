!> The contact of bodies that lose digits: what their refined displacements say, the gaps are corrected by.
module dotyk_driver_correction
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_digits, only: body_digits_t
  use dotyk_driver_free_scene, only: free_body_t
  use dotyk_driver_parallel, only: set_blas_threads
  use dotyk_driver_body_solution, only: body_solution_t, recover_bodies
  use dotyk_driver_refinement, only: penetrations, refine_bodies
  use dotyk_driver_scheme, only: solve_scheme
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_interrupted, ended_time
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: correct_digits

contains

  !> What factors have lost, bodies refined say: the scheme goes on from where it is with gaps that are corrected by the difference, until
  !> that changes nothing any more.
  subroutine correct_digits(case, body, classes, pair, problem, compliance, alone, n_blas, tolerance, log, digits, solution, &
                            result, rounding, error)
    type(case_t), intent(in) :: case
    !> (n_bodies), (n_pairs).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(contact_pair_t), intent(in) :: pair(:)
    !> Its gaps change.
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(inout) :: compliance
    !> What bodies do that touch nothing (n_bodies).
    type(free_body_t), intent(in) :: alone(:)
    !> BLAS threads of each solve.
    integer, intent(in) :: n_blas
    !> Where to stop [].
    real(dp), intent(in) :: tolerance
    type(log_t), intent(inout) :: log
    !> Counts steps of refinement (n_bodies).
    type(body_digits_t), intent(inout) :: digits(:)
    !> Room for displacements (n_bodies).
    type(body_solution_t), allocatable, intent(inout) :: solution(:)
    !> The answer of the scheme, then the corrected one.
    type(scheme_result_t), intent(inout) :: result
    !> The last change, and what is left of the residuals: relative, in the energy norm [].
    real(dp), intent(out) :: rounding
    type(error_t), allocatable, intent(out) :: error
    type(scheme_result_t) :: last
    real(dp), allocatable :: y(:)
    real(dp) :: left, before
    integer :: k
    integer, parameter :: most_corrections = 8
    rounding = 0
    if (size(result%m) == 0 .or. .not. any(digits%needs_refinement())) return
    if (any(result%ended == [ended_interrupted, ended_time])) then
      ! What rounding has left is not known.
      result%error_bound = huge(before)
      return
    end if
    allocate (y(size(result%m)))
    before = huge(before)
    do k = 1, most_corrections
      call recover_bodies(body, problem, result%m, result%alpha, alone, .false., n_blas, solution)
      call refine_bodies(body, classes, problem, result%m, result%alpha, digits, solution, left, error)
      if (allocated(error)) return
      call penetrations(problem, solution, y)
      problem%y_free = problem%y_free + (y - result%y)
      last = result
      call set_blas_threads(n_blas)
      call solve_scheme(case, body, pair, problem, tolerance, log, compliance, result, error, last)
      call set_blas_threads(1)
      if (allocated(error)) return
      call result%history%put_behind(last%history)
      if (interrupted()) then
        ! What rounding leaves is not known.
        result%error_bound = huge(rounding)
        return
      end if
      rounding = (problem%distance(result%m - last%m, result%alpha - last%alpha) + left)/ &
                 max(tiny(left), problem%norm(result%m, result%y, result%alpha/problem%coarse%scale))
      if (rounding <= max(1.0e-15_dp, 0.01_dp*tolerance) .or. .not. rounding < 0.3_dp*before) exit
      before = rounding
    end do
  end subroutine correct_digits
end module dotyk_driver_correction
