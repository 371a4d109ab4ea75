!> The load cases of a scene one after the other: solved, told in the log, and written to one results file. Without load
!> cases in the input there is one.
module dotyk_driver_load_cases
  use dotyk_base_error, only: error_t, exit_not_converged
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_control_rotations, only: find_rotations
  use dotyk_control_gap_doubt, only: is_doubtful
  use dotyk_control_mesh_quantities, only: find_mesh_quantities
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_control_quantity_error, only: find_quantity_errors
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_control_tie_forces, only: keep_shortenings
  use dotyk_driver_accuracy, only: accuracy_t
  use dotyk_driver_case_block, only: case_block_t
  use dotyk_driver_penetration, only: check_bodies
  use dotyk_driver_results, only: finish_results, write_results
  use dotyk_driver_run_settings, only: goal_of
  use dotyk_driver_scene, only: scene_t
  use dotyk_input_case, only: case_t
  use dotyk_log_case_tables, only: add_case_row, case_row_t, show_case_table
  use dotyk_log_outcome, only: note_modes
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_summary, only: show_errors, show_outcome
  use dotyk_output_results_file, only: results_file_t
  use dotyk_scheme_monitor, only: phase_estimate
  use dotyk_scheme_scheme, only: reason_none
  use dotyk_scheme_solver_state, only: ended_gaps
  implicit none
  private
  public :: solve_cases

contains

  !> Solve one load case after the other, and write the results file.
  subroutine solve_cases(restart, input, run, scene, may_add, threads, monitor, met, accuracy, reason, code, error)
    character(*), intent(in) :: restart  !! Results file of an earlier run to start from; empty where there is none.
    type(case_t), intent(in) :: input  !! The case, with one contact for each pair.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! The scene, built.
    logical, intent(in) :: may_add  !! Whether `met` may grow.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(met_point_t), allocatable, intent(inout) :: met(:)  !! Points where bodies met beside their rows (n).
    type(accuracy_t), intent(inout) :: accuracy  !! Takes the errors.
    !> Why the contact needs the factors of bodies that were split, one of `reason_*`: nothing is written; `reason_none`
    !> otherwise.
    integer, intent(out) :: reason
    integer, intent(inout) :: code  !! Exit code where there is no error: that of the worst load case.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the run has no results; with its exit code.
    type(results_file_t) :: file
    type(case_block_t) :: block
    type(pair_solution_t), allocatable :: pair_solution(:)
    type(case_row_t), allocatable :: row(:)
    real(dp), allocatable :: ratio(:)
    character(:), allocatable :: doubts
    integer :: k, n, n_written
    logical :: is_kept, has_met
    n_written = 0
    n = input%n_cases()
    allocate (row(0))
    reason = reason_none
    do k = 1, n
      if (k > block%last) call block%begin(restart, input, run, scene, monitor)
      call block%complete(k, input, run, scene, threads, monitor, error)
      associate (solved => block%solved(k - block%first + 1), solution => block%solved(k - block%first + 1)%solution, &
                 case => block%now)
        reason = solved%reason
        if (allocated(error) .or. reason /= reason_none) exit
        if (allocated(solution%state%pressure) .and. size(scene%quantity) > 0) then
          call monitor%begin_phase(phase_estimate)
          call find_quantity_errors(scene%problem, solution%qp, scene%compliance, run%settings%linear_solver, &
                                    scene%quantity, solution%state, solution%budget, scene%kept, &
                                    solution%displacements, solution%quantities, error)
          if (.not. allocated(error)) &
            call find_mesh_quantities(scene%problem, solution%qp, scene%quantity, solution%state, scene%kept, &
                                      solution%displacements, solution%quantities, error)
          call monitor%end_phase()
          if (allocated(error)) exit
        end if
        if (k == n) call scene%compliance%destroy()
        if (allocated(solution%state%pressure)) call keep_shortenings(solution%state, scene%problem)
        call find_rotations(scene%problem, solution%state, ratio)
        ! Results come first.
        call monitor%log%hold()
        call note_modes(scene%problem, solution%state, ratio, case%solver%max_unbalanced, monitor%log)
        call check_bodies(scene, solution, may_add, monitor, met, has_met)
        call monitor%log%take(doubts)
        if (has_met) then
          call monitor%log%line(doubts)
          if (n_written > 0) call file%discard()
          return
        end if
        if (solution%state%has_converged() .and. is_doubtful(solution%gap_doubt)) solution%state%ended = ended_gaps
        call accuracy%observe(case, k, scene%problem, solution, error)
        if (allocated(error)) exit
        call show_outcome(monitor%log, solution%state, case%solver%tolerance, scene%compliance%n_sweeps, solved%seconds)
        call write_results(case, k, scene, solution, monitor, file, pair_solution, error)
        if (allocated(error)) exit
        call show_errors(monitor%log, case%output, goal_of(case), scene%problem, solution)
        if (len(doubts) > 0) call monitor%log%line(doubts)
        n_written = k
        if (.not. solution%state%has_converged()) code = exit_not_converged
        if (case%has_cases()) call add_case_row(case%load_case(k)%name, solution, pair_solution, row)
        ! Cases that are solved are told all the same.
        if (solution%state%was_interrupted() .and. k >= block%last) exit
      end associate
    end do
    if (reason /= reason_none) return
    is_kept = .false.
    if (allocated(error) .and. n_written > 0) is_kept = interrupted()
    if (is_kept) then
      ! The cases that are solved are not lost.
      deallocate (error)
      code = exit_not_converged
      call monitor%log%line('  interrupted'//input%in_case_text(k)//': the results are those of the cases before')
    end if
    if (allocated(error)) then
      if (k > 1) call file%discard()
      error%message = error%message//input%in_case_text(k)
      return
    end if
    if (input%has_cases()) call show_case_table(monitor%log, row, n)
    call finish_results(input, n_written, threads, monitor, file, error)
    if (allocated(error)) return
    call monitor%show_timing()
    call monitor%log%line('  results          '//input%scene%output)
  end subroutine solve_cases
end module dotyk_driver_load_cases
