!> The solution of a load case: factorization where it is the first one, and the contact solved, continued where
!> intermediate results were written.
module dotyk_driver_solution
  use dotyk_base_error, only: about_case, about_solver, add_context, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_options, only: response_auto
  use dotyk_control_contact_solution, only: contact_solution_t, solve_contact
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_engines, only: engine_factors, engine_none, engine_rebuilt, first_engine, take_engine, &
    take_next_engine, why_not_taken
  use dotyk_driver_factorization, only: factorize_scene
  use dotyk_driver_load_case, only: solved_case_t
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
  public :: solve_scene

contains

  !> Factorize unless that is done, and solve. A scene of bodies that are split over ranks is to be built anew where it
  !> needs their factors.
  subroutine solve_scene(case, run, scene, pressure, threads, monitor, solution, solved, reason, error)
    type(case_t), intent(in) :: case  !! The case.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! The scene, built, or factorized with its loads.
    !> Contact pressures to start from; not allocated where there are none (n_rows) [pressure].
    real(dp), allocatable, intent(in) :: pressure(:)
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(contact_solution_t), intent(inout) :: solution  !! The solution.
    !> The load case where its contact is solved; not allocated on return.
    type(solved_case_t), allocatable, intent(inout) :: solved
    !> Why bodies that are split need factors, one of `reason_*`: no solution yet; `reason_none` otherwise.
    integer, intent(out) :: reason
    !> Allocated where there is none: a body is not held, no equilibrium, too little memory, an interrupt.
    type(error_t), allocatable, intent(out) :: error
    type(scheme_run_t) :: now
    type(contact_solution_t) :: nothing
    real(dp) :: before
    integer :: engine
    logical :: has_warned
    has_warned = .false.
    engine = engine_none
    do
      if (.not. scene%is_factorized) then
        before = monitor%timing%factorize%wall
        call factorize_scene(case, run%scheme, scene, monitor, error)
        if (allocated(error)) exit
        call show_factorization(monitor%log, scene%problem%body, scene%size_of, &
                                case%solver%response == response_auto .and. may_use_multigrid(case), &
                                monitor%timing%factorize%wall - before)
      end if
      if (engine == engine_none) engine = first_engine(scene)
      now = run
      call take_engine(engine, case, scene, now%scheme)
      solution = nothing
      if (case%n_cases() > 1 .and. engine == engine_factors) &
        call scene%kept%allow(scene%problem%body, scene%problem%ranks%factorizes, scene%size_of%bytes)
      if (allocated(solved)) then
        solution%state = solved%state
        solution%displacements = solved%displacements
        deallocate (solved)
      else if (allocated(pressure)) then
        call start_from_pressures(pressure, scene%qp, scene%compliance, solution%state)
      end if
      reason = now%scheme%why_not(scene%qp, scene%compliance)
      if (reason == reason_none) then
        do
          call solve_contact(scene%problem, scene%qp, scene%compliance, now, goal_of(case), scene%kept, monitor, &
                             solution, error)
          call monitor%end_phase()
          if (allocated(error)) exit
          if (solution%state%ended /= ended_time) exit
          call write_on_the_way(case, scene, solution, threads, monitor, has_warned)
        end do
        if (.not. allocated(error)) reason = why_not_taken(solution%state)
      end if
      if (allocated(error) .or. reason == reason_none) exit
      call take_next_engine(reason, case, run, scene, monitor, engine, error)
      if (allocated(error) .or. engine == engine_rebuilt) exit
      if (engine == engine_none) then
        reason = reason_none
        exit
      end if
    end do
    if (allocated(error)) then
      reason = reason_none
      ! Schemes do not know where their settings are.
      if (error%about == about_solver) call add_context(error, case%file//':'//to_text(case%solver%line)//': ')
      if (error%about == about_case) call add_context(error, case%file//': ')
    else if (reason == reason_none) then
      call refuse_unsolvable(case, scene%problem, scene%qp, solution%state, error)
    end if
  end subroutine solve_scene
end module dotyk_driver_solution
