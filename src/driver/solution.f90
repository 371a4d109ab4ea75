!> The solution of a load case: factorization where it is the first one, and the contact solved, continued where
!> intermediate results were written.
module dotyk_driver_solution
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_options, only: response_auto
  use dotyk_control_contact_solution, only: contact_solution_t, solve_contact
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_control_split_costs, only: factors_fit, iterations_worth_factors
  use dotyk_driver_factorization, only: factorize_scene
  use dotyk_driver_load_case, only: solved_case_t
  use dotyk_driver_return_to_factors, only: may_return_to_factors, return_to_factors
  use dotyk_driver_results, only: write_on_the_way
  use dotyk_driver_run_settings, only: goal_of, may_use_multigrid
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: start_from_pressures
  use dotyk_input_case, only: case_t
  use dotyk_log_outcome, only: refuse_unsolvable
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_factorization
  use dotyk_scheme_primal, only: primal_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_costly, ended_interrupted, &
    ended_limit, ended_time
  implicit none
  private
  public :: solve_scene

contains

  !> Factorize unless that is done, and solve. A scene of bodies that are split over ranks is to be built anew where it
  !> needs their factors.
  subroutine solve_scene(case, run, scene, pressure, threads, monitor, solution, solved, needs_factors, error)
    !> The case.
    type(case_t), intent(in) :: case
    !> Scheme and its settings.
    type(scheme_run_t), intent(in) :: run
    !> The scene, built, or factorized with its loads.
    type(scene_t), intent(inout) :: scene
    !> Contact pressures to start from; not allocated where there are none (n_rows) [pressure].
    real(dp), allocatable, intent(in) :: pressure(:)
    !> Number of threads.
    integer, intent(in) :: threads
    !> Log and watch; times are added.
    type(log_monitor_t), intent(inout) :: monitor
    !> The solution.
    type(contact_solution_t), intent(inout) :: solution
    !> The load case where its contact is solved; not allocated on return.
    type(solved_case_t), allocatable, intent(inout) :: solved
    !> Whether split bodies do not suit the contact, and the user leaves the choice to the program: no solution yet.
    logical, intent(out) :: needs_factors
    !> Allocated where there is none: a body is not held, no equilibrium, too little memory, an interrupt.
    type(error_t), allocatable, intent(out) :: error
    type(scheme_run_t) :: now
    character(:), allocatable :: reason
    real(dp) :: before
    integer :: most_iterations
    logical :: has_warned, may_return, may_rebuild
    has_warned = .false.
    needs_factors = .false.
    factors: do
      if (.not. scene%is_factorized) then
        before = monitor%timing%factorize%wall
        call factorize_scene(case, run%scheme, scene, monitor, error)
        if (allocated(error)) exit factors
        call show_factorization(monitor%log, scene%problem%body, scene%size_of, &
                                case%solver%response == response_auto .and. may_use_multigrid(case), &
                                monitor%timing%factorize%wall - before)
      end if
      now = run
      if (scene%has_multigrid()) then
        deallocate (now%scheme)
        allocate (primal_t :: now%scheme)
      end if
      may_return = may_return_to_factors(case, scene)
      may_rebuild = scene%is_split() .and. case%solver%response == response_auto
      if (may_rebuild) may_rebuild = factors_fit(scene%problem%body)
      most_iterations = huge(1)
      if (may_rebuild) most_iterations = iterations_worth_factors(scene%problem%body)
      if (scene%is_split()) call scene%split%take_scheme(most_iterations, now%scheme)
      call solution%begin(scene%theta)
      if (case%n_cases() > 1 .and. .not. (scene%has_multigrid() .or. scene%is_split())) &
        call scene%kept%allow(scene%problem%body, scene%problem%ranks%factorizes, scene%size_of%bytes)
      if (allocated(solved)) then
        solution%state = solved%state
        solution%displacements = solved%displacements
        deallocate (solved)
      else if (allocated(pressure)) then
        call start_from_pressures(pressure, scene%qp, scene%compliance, solution%state)
      end if
      do
        if ((may_return .or. may_rebuild) .and. .not. now%scheme%suits(scene%qp, scene%compliance, scene%theta)) then
          needs_factors = may_rebuild
          reason = 'the contact needs factors'
          if (needs_factors) exit factors
          call return_to_factors(case, run%scheme, scene, monitor, may_return, error)
          if (allocated(error)) exit factors
          call say_why('the contact needs factors', may_return, monitor)
          if (may_return) cycle factors
        end if
        call solve_contact(scene%problem, scene%qp, scene%compliance, now, goal_of(case), scene%kept, monitor, &
                           solution, error)
        call monitor%end_phase()
        if (allocated(error)) exit factors
        if (solution%state%ended == ended_time) then
          call write_on_the_way(case, scene, solution, threads, monitor, has_warned)
          cycle
        end if
        if (any(solution%state%ended == [ended_converged, ended_interrupted])) exit factors
        needs_factors = may_rebuild .and. solution%state%ended == ended_costly
        reason = 'p-multigrid would take longer than factors'
        if (needs_factors) exit factors
        ! Not where the user has limited the iterations, nor for loads without equilibrium: rigid body modes tell that.
        if (solution%state%ended == ended_limit .or. solution%state%history%n == 0) exit factors
        needs_factors = may_rebuild
        reason = 'the accuracy of p-multigrid does not suffice'
        if (.not. may_return) exit factors
        call return_to_factors(case, run%scheme, scene, monitor, may_return, error)
        if (allocated(error)) exit factors
        call say_why(reason, may_return, monitor)
        if (.not. may_return) exit factors
        exit
      end do
    end do factors
    if (allocated(error)) then
      ! The scheme does not know the line of its settings.
      if (index(error%message, '&solver') == 1) &
        call add_context(error, case%file//':'//to_text(case%solver%line)//': ')
    else if (needs_factors) then
      call monitor%note('factors          '//reason//': the bodies are not split over ranks, each has its factor '// &
                        'on one of them')
    else
      call refuse_unsolvable(case, scene%problem, scene%qp, solution%state, error)
    end if
  end subroutine solve_scene

  !> Say why p-multigrid is given up.
  subroutine say_why(reason, fits, monitor)
    !> The reason.
    character(*), intent(in) :: reason
    !> Whether the memory suffices for factors.
    logical, intent(in) :: fits
    !> Gets the line.
    type(log_monitor_t), intent(inout) :: monitor
    if (fits) then
      call monitor%note('factors          '//reason//': the bodies are factorized, and the contact solved again')
    else
      call monitor%note('warning          '//reason//', and the memory does not suffice for factors')
    end if
  end subroutine say_why
end module dotyk_driver_solution
