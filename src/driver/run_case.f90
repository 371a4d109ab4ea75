!> A run from the namelist file to the results file: the sequence of its steps.
module dotyk_driver_run_case
  use dotyk_base_error, only: error_t, add_context, exit_converged, exit_not_converged
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: set_stage
  use dotyk_base_text, only: to_text
  use dotyk_control_contact_solution, only: contact_solution_t, solve_contact
  use dotyk_control_parallel, only: use_threads
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_arguments, only: arguments_t
  use dotyk_driver_results, only: prepare_output, write_on_the_way, write_results
  use dotyk_driver_penetration, only: check_bodies
  use dotyk_driver_run_settings, only: choose_scheme, goal_of, set_pair_conditions
  use dotyk_driver_scene, only: build_scene, factorize_scene, scene_t
  use dotyk_driver_warm_start, only: read_pressures, start_from_pressures
  use dotyk_input_case, only: case_t
  use dotyk_input_parse, only: read_case
  use dotyk_log_outcome, only: note_modes, refuse_unsolvable
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_factorization, show_memory, show_scene, show_title
  use dotyk_log_summary, only: show_solution, show_timing
  use dotyk_scheme_solver_state, only: ended_converged, ended_time
  implicit none
  private
  public :: run_case

contains

  !> From the namelist file to the results file.
  subroutine run_case(arguments, code, error)
    !> The command line.
    type(arguments_t), intent(in) :: arguments
    !> Exit code where there is no error.
    integer, intent(out) :: code
    !> Allocated where the run has no results; with its exit code.
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: case
    type(scheme_run_t) :: run
    type(scene_t) :: scene
    type(contact_solution_t) :: solution
    type(log_monitor_t) :: monitor
    real(dp), allocatable :: pressure(:)
    integer :: threads
    logical :: has_warned
    code = exit_converged
    call monitor%watch%start()
    call monitor%log%init(arguments%quiet)
    call use_threads(arguments%threads, threads)
    call set_stage('reading '//arguments%case_file)
    call read_case(arguments%case_file, case, error)
    if (allocated(error)) return
    case%no_shell = arguments%no_shell
    call choose_scheme(case, run)
    call show_title(monitor%log, case, threads)
    call prepare_output(case, arguments%output, error)
    if (allocated(error)) return
    call build_scene(case, run%scheme, scene, monitor, error)
    if (allocated(error)) return
    call set_pair_conditions(case, run)
    call show_scene(monitor%log, case, scene%problem, scene%size_of)
    if (len(arguments%restart) > 0) then
      call read_pressures(arguments%restart, scene%problem%body, scene%problem%pair, monitor%log, pressure, error)
      if (allocated(error)) return
    end if
    if (arguments%check) then
      call show_memory(monitor%log, scene%size_of)
      call monitor%log%line('  input checked; nothing was solved')
      return
    end if
    call factorize_scene(case, run%scheme, scene, monitor, error)
    if (.not. allocated(error)) then
      call show_factorization(monitor%log, scene%size_of, monitor%timing%factorize)
      solution%theta = scene%theta
      if (allocated(pressure)) call start_from_pressures(pressure, scene%qp, scene%compliance, solution%state)
      has_warned = .false.
      do
        call solve_contact(scene%problem, scene%qp, scene%compliance, run, goal_of(case), monitor, solution, error)
        call monitor%end_phase()
        if (allocated(error)) exit
        if (solution%state%ended /= ended_time) then
          if (.not. scene%neutral%asks_again(solution%state, scene%problem, scene%qp)) exit
          call monitor%note('neutral modes    bodies move far along them; held, and the contact solved again')
          call begin_again(scene%theta, solution)
          cycle
        end if
        call write_on_the_way(case, scene, solution, threads, monitor, has_warned)
      end do
      if (allocated(error)) then
        ! The scheme does not know the line of its settings.
        if (index(error%message, '&solver') == 1) &
          call add_context(error, case%file//':'//to_text(case%solver%line)//': ')
      end if
      if (.not. allocated(error)) call refuse_unsolvable(case, scene%problem, scene%qp, solution%state, error)
    end if
    call scene%compliance%destroy()
    if (allocated(error)) return
    call scene%neutral%judge(scene%problem, solution%qp, solution%state)
    call note_modes(scene%problem, solution%state, monitor%log)
    call check_bodies(scene, solution, monitor)
    call show_solution(monitor%log, case%output, goal_of(case), scene%problem, scene%compliance%n_sweeps, solution, &
                       monitor%timing%iterate)
    call write_results(case, scene, solution, threads, monitor, error)
    if (allocated(error)) return
    call show_timing(monitor%log, monitor%timing)
    call monitor%log%line('  results          '//case%scene%output)
    if (solution%state%ended /= ended_converged) code = exit_not_converged
  end subroutine run_case

  !> A solution that is not begun.
  subroutine begin_again(theta, solution)
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Without a state on return.
    type(contact_solution_t), intent(out) :: solution
    solution%theta = theta
  end subroutine begin_again
end module dotyk_driver_run_case
