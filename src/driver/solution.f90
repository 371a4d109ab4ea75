!> The solution of a load case: factorization where it is the first one, and the contact by the engine that takes it.
module dotyk_driver_solution
  use dotyk_base_error, only: about_case, about_solver, add_context, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_options, only: response_auto
  use dotyk_control_contact_solution, only: begin_contact, complete_contact, contact_solution_t, solve_contact
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_engines, only: engine_factors, engine_none, engine_rebuilt, first_engine, take_engine, &
    take_next_engine, why_not_taken
  use dotyk_driver_factorization, only: factorize_scene
  use dotyk_driver_load_case, only: case_solution_t
  use dotyk_driver_results, only: write_on_the_way
  use dotyk_driver_run_settings, only: goal_of, may_use_multigrid
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: start_from_pressures
  use dotyk_input_case, only: case_t
  use dotyk_log_outcome, only: refuse_unsolvable
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_factorization
  use dotyk_scheme_scheme, only: reason_none
  use dotyk_scheme_solver_state, only: ended_time
  implicit none
  private
  public :: begin_solution, complete_solution

contains

  !> Factorize unless that is done, and solve the contact once.
  subroutine begin_solution(case, run, scene, monitor, solved, error)
    type(case_t), intent(in) :: case  !! The case, with the contacts of the load case.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! The scene, built, or factorized with its loads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> The load case, with the engine that is to solve it: the first one where it has none.
    type(case_solution_t), intent(inout) :: solved
    !> Allocated where there is no solution: a body is not held, too little memory, an interrupt.
    type(error_t), allocatable, intent(out) :: error
    type(contact_solution_t) :: nothing
    real(dp) :: before
    if (.not. scene%is_factorized) then
      before = monitor%timing%factorize%wall
      call factorize_scene(case, run%scheme, scene, monitor, error)
      if (allocated(error)) return
      call show_factorization(monitor%log, scene%problem%body, scene%size_of, &
                              case%solver%response == response_auto .and. may_use_multigrid(case), &
                              monitor%timing%factorize%wall - before)
    end if
    if (solved%engine == engine_none) solved%engine = first_engine(scene)
    solved%run = run
    call take_engine(solved%engine, case, scene, solved%run%scheme)
    if ((case%n_cases() > 1 .or. size(scene%quantity) > 0) .and. solved%engine == engine_factors) &
      call scene%kept%allow(scene%problem%body, scene%problem%ranks%factorizes, scene%size_of%bytes)
    solved%solution = nothing
    if (allocated(solved%start)) &
      call start_from_pressures(solved%start, scene%qp, scene%compliance, solved%solution%state)
    call begin_contact(scene%problem, scene%qp, run%settings%tolerance, goal_of(case), solved%solution)
    solved%reason = solved%run%scheme%why_not(scene%qp, scene%compliance)
    if (solved%reason /= reason_none) return
    call solve_contact(scene%problem, scene%compliance, solved%run, monitor, solved%solution, error)
    call monitor%end_phase()
  end subroutine begin_solution

  !> Displacements and errors of a load case, and its contact again where they or its engine ask for it. A scene of
  !> bodies that are split over ranks is to be built anew where it needs their factors.
  subroutine complete_solution(case, run, scene, threads, monitor, solved, error)
    type(case_t), intent(in) :: case  !! As in `begin_solution`.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! The load case acts on it.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> The load case, begun. Its reason on return is `reason_none`, or why bodies that are split need factors.
    type(case_solution_t), intent(inout) :: solved
    !> Allocated where there is no solution: what went wrong before, no equilibrium, too little memory, an interrupt.
    type(error_t), allocatable, intent(out) :: error
    logical :: has_warned
    has_warned = .false.
    call move_alloc(solved%error, error)
    associate (solution => solved%solution)
      do while (.not. allocated(error))
        if (solved%reason == reason_none) then
          do
            call complete_contact(scene%problem, scene%compliance, solved%run, goal_of(case), scene%kept, monitor, &
                                  solution, error)
            call monitor%end_phase()
            if (allocated(error) .or. solution%state%ended /= ended_time) exit
            call write_on_the_way(case, scene, solution, threads, monitor, has_warned)
            call solve_contact(scene%problem, scene%compliance, solved%run, monitor, solution, error)
            if (allocated(error)) exit
          end do
          if (.not. allocated(error)) solved%reason = why_not_taken(solution%state)
        end if
        if (allocated(error) .or. solved%reason == reason_none) exit
        call take_next_engine(solved%reason, case, run, scene, monitor, solved%engine, error)
        if (allocated(error) .or. solved%engine == engine_rebuilt) exit
        if (solved%engine == engine_none) then
          solved%reason = reason_none
          exit
        end if
        call begin_solution(case, run, scene, monitor, solved, error)
      end do
      if (allocated(error)) then
        solved%reason = reason_none
        ! Schemes do not know where their settings are.
        if (error%about == about_solver) call add_context(error, case%file//':'//to_text(case%solver%line)//': ')
        if (error%about == about_case) call add_context(error, case%file//': ')
      else if (solved%reason == reason_none) then
        call refuse_unsolvable(case, scene%problem, solution%qp, solution%state, error)
      end if
    end associate
  end subroutine complete_solution
end module dotyk_driver_solution
