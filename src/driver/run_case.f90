!> A run from the namelist file to the results file: the sequence of its steps.
module dotyk_driver_run_case
  use dotyk_base_error, only: error_t, add_context, set_error, exit_converged, exit_not_converged, exit_not_written
  use dotyk_base_files, only: behind_links, print_text
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: print_error
  use dotyk_base_memory, only: set_stage
  use dotyk_base_options, only: scheme_auto, scheme_dual, stop_budget, stop_residual
  use dotyk_base_text, only: to_text
  use dotyk_control_contact_solution, only: contact_solution_t, solution_goal_t, solve_contact
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_arguments, only: arguments_t
  use dotyk_driver_log_monitor, only: log_monitor_t
  use dotyk_driver_outcome, only: note_modes, refuse_unsolvable
  use dotyk_driver_report, only: show_solution, write_results
  use dotyk_driver_scene, only: build_scene, factorize_scene, scene_t
  use dotyk_driver_screen, only: show_memory, show_scene, show_structure, show_timing
  use dotyk_control_parallel, only: use_threads
  use dotyk_driver_version, only: version, compiler, build_type
  use dotyk_driver_warm_start, only: read_pressures, start_from_pressures
  use dotyk_input_case, only: case_t
  use dotyk_input_help, only: help_text
  use dotyk_input_parse, only: read_case
  use dotyk_input_reference, only: reference_text
  use dotyk_output_file_system, only: check_replaceable, check_writable
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_registry, only: make_scheme
  use dotyk_scheme_solver_state, only: ended_converged, ended_time
  implicit none
  private
  public :: run_case

contains

  !> Run what the command line asks for.
  subroutine run_case(arguments, code, error)
    type(arguments_t), intent(in) :: arguments
    !> Exit code where there is no error.
    integer, intent(out) :: code
    !> Allocated where the run cannot give results; with its exit code.
    type(error_t), allocatable, intent(out) :: error
    code = exit_converged
    if (arguments%help) then
      call print_output(help_text(), error)
    else if (arguments%reference) then
      call print_output(reference_text(), error)
    else if (arguments%version) then
      call print_output('dotyk '//version//' ('//compiler//', '//build_type//')', error)
    else
      call solve_case(arguments, code, error)
    end if
  end subroutine run_case

  !> From the namelist file to the results file.
  subroutine solve_case(arguments, code, error)
    type(arguments_t), intent(in) :: arguments
    !> As in `run_case`.
    integer, intent(inout) :: code
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: case
    type(scheme_run_t) :: run
    type(scene_t) :: scene
    type(contact_qp_t) :: qp
    type(body_compliance_t) :: compliance
    type(contact_solution_t) :: solution
    type(log_monitor_t) :: monitor
    character(:), allocatable :: started
    real(dp), allocatable :: pressure(:)
    integer :: threads
    logical :: has_warned
    call monitor%watch%start()
    started = date_and_time_text()
    call monitor%log%init(arguments%quiet)
    call use_threads(arguments%threads, threads)
    call set_stage('reading '//arguments%case_file)
    call read_case(arguments%case_file, case, error)
    if (allocated(error)) return
    if (len(arguments%output) > 0) case%scene%output = arguments%output
    ! A new file takes the place of an old one, not that of a link to it.
    case%scene%output = behind_links(case%scene%output)
    if (case%solver%scheme == scheme_auto) case%solver%scheme = scheme_dual
    call show_scene(monitor%log, case, threads)
    call check_writable(case%scene%output, error)
    if (.not. allocated(error)) call check_replaceable(case%scene%output, error)
    if (allocated(error)) return
    call choose_scheme(case, run)
    call build_scene(case, run%scheme, scene, monitor, error)
    if (allocated(error)) return
    call show_structure(monitor%log, case, scene%problem, scene%size_of)
    if (len(arguments%restart) > 0) then
      call read_pressures(arguments%restart, scene%problem%body, scene%problem%pair, monitor%log, pressure, error)
      if (allocated(error)) return
    end if
    if (arguments%check) then
      call show_memory(monitor%log, scene%size_of)
      call monitor%log%line('  checked; nothing was solved')
      return
    end if
    call factorize_scene(case, run%scheme, scene, qp, compliance, monitor, error)
    if (.not. allocated(error)) then
      solution%theta = scene%theta
      if (allocated(pressure)) call start_from_pressures(pressure, qp, compliance, solution%state)
      has_warned = .false.
      do
        call solve_contact(scene%problem, qp, compliance, run, goal_of(case), monitor, solution, error)
        call monitor%end_phase()
        if (allocated(error)) exit
        if (solution%state%ended /= ended_time) exit
        call write_on_the_way(case, scene, qp, compliance%n_sweeps, solution, threads, started, monitor, has_warned)
      end do
      if (allocated(error)) then
        ! The scheme does not know the line of its settings.
        if (index(error%message, '&solver') == 1) &
          call add_context(error, case%file//':'//to_text(case%solver%line)//': ')
      end if
      if (.not. allocated(error)) call refuse_unsolvable(case, scene%problem, qp, solution%state, error)
    end if
    call compliance%destroy()
    if (allocated(error)) return
    call note_modes(scene%problem, solution%state, monitor%log)
    call show_solution(case, goal_of(case), scene%problem, compliance%n_sweeps, solution, monitor)
    call write_results(case, scene, qp, compliance%n_sweeps, solution, threads, started, monitor, error)
    if (allocated(error)) return
    call show_timing(monitor%log, monitor%timing)
    call monitor%log%line('  results          '//case%scene%output)
    if (solution%state%ended /= ended_converged) code = exit_not_converged
  end subroutine solve_case

  !> Write the results of a run that continues. A failure is no reason to end it.
  subroutine write_on_the_way(case, scene, qp, n_sweeps, solution, threads, started, monitor, has_warned)
    type(case_t), intent(in) :: case
    type(scene_t), intent(in) :: scene
    type(contact_qp_t), intent(in) :: qp
    !> As in `write_results`.
    integer, intent(in) :: n_sweeps
    type(contact_solution_t), intent(in) :: solution
    !> As in `write_results`.
    integer, intent(in) :: threads
    character(*), intent(in) :: started
    type(log_monitor_t), intent(inout) :: monitor
    !> Whether a failure has been reported, which happens once.
    logical, intent(inout) :: has_warned
    type(error_t), allocatable :: error
    call write_results(case, scene, qp, n_sweeps, solution, threads, started, monitor, error)
    if (.not. allocated(error)) then
      call monitor%log%line('  written          '//case%scene%output//' after '//to_text(solution%state%iterations)// &
                            ' iterations')
    else if (.not. has_warned) then
      call print_error('warning: '//error%message//'; the run continues')
      has_warned = .true.
    end if
  end subroutine write_on_the_way

  !> The scheme and its settings.
  subroutine choose_scheme(case, run)
    type(case_t), intent(in) :: case
    type(scheme_run_t), intent(out) :: run
    call make_scheme(case%solver%scheme, run%scheme)
    run%settings%gamma_rule = case%solver%gamma_rule
    run%settings%gamma = case%solver%gamma
    run%settings%stop_rule = case%solver%stop_rule
    ! The budget sets the tolerance of the residual.
    if (case%solver%stop_rule == stop_budget) run%settings%stop_rule = stop_residual
    run%settings%tolerance = case%solver%tolerance
    run%settings%max_iterations = case%solver%max_iterations
    run%settings%linear_solver = case%solver%linear_solver
    if (case%output%interval > 0) run%settings%time_limit = case%output%interval
  end subroutine choose_scheme

  !> What is asked of the solution.
  pure function goal_of(case) result(goal)
    type(case_t), intent(in) :: case
    type(solution_goal_t) :: goal
    goal%by_budget = case%solver%stop_rule == stop_budget
    goal%budget_fraction = case%solver%budget_fraction
    goal%theta_given = case%contact%theta_given
    goal%displacement = case%output%displacement
    goal%stress = case%output%stress
    goal%mesh_error = case%output%error_discretization
    goal%penalty_error = case%output%error_penalty
  end function goal_of

  !> A text that the command line asked for.
  subroutine print_output(text, error)
    character(*), intent(in) :: text
    !> Allocated where the standard output cannot be written.
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    call print_text(text//new_line('a'), status)
    if (status /= 0) call set_error(error, 'the standard output cannot be written', exit_not_written)
  end subroutine print_output

  !> Now, as 2026-01-31T12:00:00+0100.
  function date_and_time_text() result(text)
    character(:), allocatable :: text
    character(10) :: date, time, zone
    call date_and_time(date, time, zone)
    text = date(1:4)//'-'//date(5:6)//'-'//date(7:8)//'T'//time(1:2)//':'//time(3:4)//':'//time(5:6)//trim(zone)
  end function date_and_time_text
end module dotyk_driver_run_case
