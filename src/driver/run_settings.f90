!> From the input to the settings of a run: the scheme with its parameters, and what is asked of the solution.
module dotyk_driver_run_settings
  use dotyk_base_options, only: field_displacement, field_nodal_stress, field_reaction, field_stress, &
    last_linear_quantity, linear_solver_auto, scheme_auto, scheme_dual
  use dotyk_control_contact_solution, only: solution_goal_t
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_input_case, only: case_t
  use dotyk_scheme_registry, only: make_scheme
  implicit none
  private
  public :: choose_scheme, goal_of, may_use_multigrid, set_pair_conditions

contains

  !> The scheme and its settings.
  subroutine choose_scheme(case, run)
    type(case_t), intent(inout) :: case  !! The case; its automatic choice of the scheme is replaced.
    type(scheme_run_t), intent(out) :: run  !! Scheme and settings.
    if (case%solver%scheme == scheme_auto) case%solver%scheme = scheme_dual
    call make_scheme(case%solver%scheme, run%scheme)
    run%settings%gamma_rule = case%solver%gamma_rule
    run%settings%gamma = case%solver%gamma
    run%settings%stop_rule = case%solver%stop_rule
    run%settings%tolerance = case%solver%tolerance
    run%settings%max_iterations = case%solver%max_iterations
    run%settings%linear_solver = case%solver%linear_solver
    if (case%output%interval > 0) run%settings%time_limit = case%output%interval
  end subroutine choose_scheme

  !> Whether bodies may be solved by p-multigrid: the dual scheme has another one in its place that does so.
  pure logical function may_use_multigrid(case)
    type(case_t), intent(in) :: case  !! The case, its automatic choice of the scheme replaced.
    may_use_multigrid = case%solver%scheme == scheme_dual .and. case%solver%linear_solver == linear_solver_auto
    ! Their error bars take factors.
    if (may_use_multigrid) &
      may_use_multigrid = .not. any(case%quantity%is_goal .and. case%quantity%kind <= last_linear_quantity)
  end function may_use_multigrid

  !> The settings that pairs have of their own, once the pairs are found.
  subroutine set_pair_conditions(case, run)
    type(case_t), intent(in) :: case  !! The case, with one contact for each pair.
    type(scheme_run_t), intent(inout) :: run  !! Scheme and settings.
    run%settings%robin_gap = [case%contact%robin_gap]
  end subroutine set_pair_conditions

  !> What is asked of the solution.
  pure function goal_of(case) result(goal)
    type(case_t), intent(in) :: case  !! The case.
    type(solution_goal_t) :: goal
    goal%displacement = any(case%output%field([field_displacement, field_reaction, field_nodal_stress]))
    goal%stress = case%output%field(field_stress)
    goal%mesh_error = case%output%error_discretization
    goal%penalty_error = case%output%error_penalty
  end function goal_of
end module dotyk_driver_run_settings
