!> What the error of an answer is made of: iteration, penalty, mesh; all in the energy norm, relative to that of the answer.
!>
!> The part of the iteration is the guaranteed bound of the scheme. That of the penalty is the distance to the solution without it
!> (`dotyk_scheme_penalty`), that of the mesh an asymptotically exact estimate (`dotyk_elasticity_discretization_error`). Beside them
!> stands what the contact conditions, met in the mean, are missed by in single places (`dotyk_contact_complementarity`).
module dotyk_driver_error_budget
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: discretization_quadrature, scheme_dual, stop_budget
  use dotyk_base_text, only: to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_contact_complementarity, only: complementarity_error
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_mesh_error, only: estimate_mesh_errors
  use dotyk_driver_pressures, only: nodal_field_t
  use dotyk_driver_body_solution, only: body_solution_t
  use dotyk_driver_scheme, only: scheme_of
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t, solver_input_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_interrupted, ended_rounds, ended_stalled, ended_time
  use dotyk_scheme_penalty, only: estimate_penalty_error
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> Parts of the error, relative; NaN where a part is not known.
  type, public :: error_budget_t
    real(dp) :: penalty = 0, discretization = 0
    !> Work of the pressures on the gaps that are left under them, as the root of twice an energy: no part of the others.
    real(dp) :: contact = 0
    !> Energy norm ||u||_A of the answer [sqrt(energy)].
    real(dp) :: norm = 0
    !> Discretization, of each body, and of each element of each body; not allocated where nobody asked (n_bodies). Squares add up.
    real(dp), allocatable :: of_body(:)
    type(nodal_field_t), allocatable :: of_element(:)
  contains
    procedure :: init => budget_init
    procedure :: others => budget_others
  end type error_budget_t

  public :: estimate_errors, ask_for_more, errors_decide, first_tolerance, needs_displacements, estimates_mesh_error, &
    estimates_penalty_error

  !> Answers to one scene at most: a rough one, one with a smaller theta, one with the tolerance that its errors ask for, and that again.
  integer, parameter, public :: most_rounds = 5
  !> Tolerance of the first answer where the budget decides: good enough to estimate the other errors from.
  real(dp), parameter :: rough = 0.02_dp
  !> A theta that was not given becomes smaller where its error is more than this part of the mesh's, and is meant to have half of that.
  real(dp), parameter :: most_penalty = 0.3_dp
  !> At most by this factor.
  real(dp), parameter :: least_factor = 1.0e-3_dp
  !> An error of the mesh below this is none to a theta of schemes whose steps grow like 1/theta: on meshes that are exact, a theta after
  !> their error would let them step for ever.
  real(dp), parameter :: no_mesh_error = 1.0e-3_dp
  !> Errors below this are none.
  real(dp), parameter :: no_error = 1.0e-8_dp

contains

  !> Nothing is known.
  subroutine budget_init(self)
    class(error_budget_t), intent(out) :: self
    self%penalty = ieee_value(self%penalty, ieee_quiet_nan)
    self%discretization = self%penalty
    self%contact = self%penalty
    self%norm = self%penalty
  end subroutine budget_init

  !> Penalty and discretization together, as far as they are known.
  pure real(dp) function budget_others(self) result(others)
    class(error_budget_t), intent(in) :: self
    others = 0
    if (.not. ieee_is_nan(self%penalty)) others = others + self%penalty
    if (.not. ieee_is_nan(self%discretization)) others = others + self%discretization
  end function budget_others

  !> Tolerance of the first answer.
  pure real(dp) function first_tolerance(solver) result(tolerance)
    type(solver_input_t), intent(in) :: solver
    tolerance = solver%tolerance
    if (solver%stop_rule == stop_budget) tolerance = rough
  end function first_tolerance

  !> Whether the answer depends on its errors: the iteration stops by them, or a theta that was not given becomes smaller.
  pure logical function errors_decide(case)
    type(case_t), intent(in) :: case
    errors_decide = case%solver%stop_rule == stop_budget .or. .not. all(case%contact%theta_given)
  end function errors_decide

  !> Whether the displacements of all nodes are needed.
  pure logical function needs_displacements(case)
    type(case_t), intent(in) :: case
    needs_displacements = case%output%displacement .or. case%output%stress .or. estimates_mesh_error(case)
  end function needs_displacements

  !> Whether the error of the mesh is estimated: asked for, or needed by a rule.
  pure logical function estimates_mesh_error(case)
    type(case_t), intent(in) :: case
    estimates_mesh_error = case%output%error_discretization .or. errors_decide(case)
  end function estimates_mesh_error

  !> Whether the error of the penalty is: the same.
  pure logical function estimates_penalty_error(case)
    type(case_t), intent(in) :: case
    estimates_penalty_error = case%output%error_penalty .or. errors_decide(case)
  end function estimates_penalty_error

  !> Estimate the errors of an answer, those that the input asks for or that a rule needs.
  subroutine estimate_errors(case, body, classes, pair, surface_a, surface_b, solution, problem, compliance, result, budget, error)
    type(case_t), intent(in) :: case
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    !> (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(surface_t), intent(in) :: surface_a(:), surface_b(:)
    !> With displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    type(contact_problem_t), intent(inout) :: problem
    !> Columns that the dual scheme formed, if any.
    type(explicit_compliance_t), intent(inout) :: compliance
    !> The end of its history gets the errors.
    type(scheme_result_t), intent(inout) :: result
    type(error_budget_t), intent(out) :: budget
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: distance
    call budget%init()
    budget%norm = problem%norm(result%m, result%y, result%alpha/problem%coarse%scale)
    if (estimates_mesh_error(case)) then
      call estimate_mesh_error(body, classes, pair, surface_a, surface_b, solution, problem%operator%pair_first_row, result%m, &
                               budget, error)
      if (allocated(error)) return
      if (.not. is_near(result)) call forget_mesh_error(budget)
    end if
    ! It takes another solution.
    if (estimates_penalty_error(case) .and. is_near(result) .and. all(result%ended /= [ended_interrupted, ended_time])) then
      call estimate_penalty_error(problem, case%solver%linear_solver, scheme_of(case) == scheme_dual, compliance, result, &
                                  distance, error)
      if (allocated(error)) return
      budget%penalty = 0
      if (budget%norm > 0) budget%penalty = distance/budget%norm
      if (interrupted()) budget%penalty = ieee_value(budget%penalty, ieee_quiet_nan)
    end if
    associate (history => result%history)
      if (history%n == 0) return
      history%error_penalty(history%n) = budget%penalty
      history%error_discretization(history%n) = budget%discretization
    end associate
  end subroutine estimate_errors

  !> Whether the iteration came near enough to its end for the other errors to mean something.
  pure logical function is_near(result)
    type(scheme_result_t), intent(in) :: result
    is_near = size(result%m) == 0
    if (.not. (is_near .or. ieee_is_nan(result%error_bound))) is_near = result%error_bound < 0.5_dp
  end function is_near

  !> Nothing is known of the mesh's error.
  subroutine forget_mesh_error(budget)
    type(error_budget_t), intent(inout) :: budget
    real(dp) :: nan
    integer :: b
    nan = ieee_value(nan, ieee_quiet_nan)
    budget%discretization = nan
    budget%contact = nan
    budget%of_body = nan
    do b = 1, size(budget%of_element)
      budget%of_element(b)%value = nan
    end do
  end subroutine forget_mesh_error

  !> Whether the scene is to be solved again from where it is, with a smaller theta or to another tolerance; and the outcome of the rule
  !> 'budget' where not.
  logical function ask_for_more(case, last, pair, budget, problem, result, tolerance, log) result(more)
    type(case_t), intent(in) :: case
    !> There is no more: the answer stays as it is.
    logical, intent(in) :: last
    !> Their theta may change (n_pairs).
    type(contact_pair_t), intent(inout) :: pair(:)
    type(error_budget_t), intent(in) :: budget
    type(contact_problem_t), intent(inout) :: problem
    !> Knows no L where theta changed.
    type(scheme_result_t), intent(inout) :: result
    !> What was asked for, and what will be [].
    real(dp), intent(inout) :: tolerance
    type(log_t), intent(inout) :: log
    real(dp) :: factor, target, mesh_error
    integer :: k
    more = .false.
    if (all(result%ended /= [ended_converged, ended_stalled]) .or. size(result%m) == 0) return
    if (.not. errors_decide(case)) return
    factor = 1
    ! An error that is not known changes nothing.
    if (.not. (last .or. ieee_is_nan(budget%penalty) .or. ieee_is_nan(budget%discretization))) then
      mesh_error = max(budget%discretization, merge(no_error, no_mesh_error, scheme_of(case) == scheme_dual))
      if (budget%penalty > most_penalty*mesh_error) &
        factor = max(least_factor, 0.5_dp*most_penalty*mesh_error/budget%penalty)
      ! A theta that was given may be what the penalty's error comes from: no more than one attempt beside it.
      if (any(case%contact%theta_given) .and. any(pair%theta_factor < 1)) factor = 1
    end if
    if (factor < 1) then
      do k = 1, size(pair)
        if (case%contact(k)%theta_given) cycle
        ! Single pressures at quadrature points would become noise.
        if (pair(k)%discretization == discretization_quadrature .and. pair(k)%theta_factor*factor < least_factor) cycle
        more = .true.
        pair(k)%theta_factor = factor*pair(k)%theta_factor
        pair(k)%theta = factor*pair(k)%theta
        pair(k)%row_theta = factor*pair(k)%row_theta
        problem%operator%theta(problem%operator%pair_first_row(k):problem%operator%pair_first_row(k + 1) - 1) = pair(k)%row_theta
      end do
      if (more) then
        result%lambda_max = 0
        call log%line('  theta            times '//to_text(factor, 2)//': the error of the penalty, '// &
                      to_text(100*budget%penalty, 2)//' %, would dominate')
        return
      end if
    end if
    if (case%solver%stop_rule /= stop_budget) return
    target = max(case%solver%budget_fraction*budget%others(), no_error)
    if (result%error_bound <= target) then
      result%ended = ended_converged
      tolerance = target
    else
      more = result%ended == ended_converged .and. .not. last
      ! The next answer has other errors, if not very different ones.
      tolerance = merge(0.7_dp, 1.0_dp, more)*target
      if (last .and. result%ended == ended_converged) result%ended = ended_rounds
    end if
  end function ask_for_more

  !> The part of the mesh.
  subroutine estimate_mesh_error(body, classes, pair, surface_a, surface_b, solution, first_row, m, budget, error)
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    !> (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(surface_t), intent(in) :: surface_a(:), surface_b(:)
    !> With displacements (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1.
    integer, intent(in) :: first_row(:)
    !> Pressures (n_rows).
    real(dp), intent(in) :: m(:)
    type(error_budget_t), intent(inout) :: budget
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: norm_square, work
    integer :: b, k
    if (allocated(budget%of_body)) deallocate (budget%of_body, budget%of_element)
    allocate (budget%of_body(size(body)))
    call estimate_mesh_errors(body, classes, solution, budget%of_element, norm_square, error)
    if (allocated(error)) return
    work = 0
    do k = 1, size(pair)
      work = work + complementarity_error(pair(k), surface_a(k), surface_b(k), solution(pair(k)%body_a)%displacement, &
                                      solution(pair(k)%body_b)%displacement, m(first_row(k):first_row(k + 1) - 1))
    end do
    budget%contact = 0
    if (norm_square > 0) budget%contact = sqrt(2*work/norm_square)
    budget%norm = sqrt(norm_square)
    do b = 1, size(body)
      if (norm_square > 0) budget%of_element(b)%value = sqrt(budget%of_element(b)%value/norm_square)
      budget%of_body(b) = norm2(budget%of_element(b)%value)
    end do
    budget%discretization = norm2(budget%of_body)
  end subroutine estimate_mesh_error
end module dotyk_driver_error_budget
