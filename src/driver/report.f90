!> The end of a run: what it shows and writes of a solution.
module dotyk_driver_report
  use dotyk_base_error, only: error_t
  use dotyk_base_memory, only: set_stage
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t, solution_goal_t
  use dotyk_driver_finite, only: refuse_overflow
  use dotyk_driver_log_monitor, only: log_monitor_t
  use dotyk_driver_pressures, only: nodal_field_t, pair_solution_t, project_pressures
  use dotyk_driver_results, only: write_fields, write_pairs, write_provenance, write_summary, write_timing
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_screen, only: show_budget, show_conditioning, show_not_computed, show_pair_results, show_state
  use dotyk_input_case, only: case_t
  use dotyk_output_results_file, only: results_file_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: ended_time
  implicit none
  private
  public :: show_solution, write_results

contains

  !> How the scheme ended, the error budget, the conditioning of the bodies.
  subroutine show_solution(case, goal, problem, n_sweeps, solution, monitor)
    type(case_t), intent(in) :: case
    !> What was asked for.
    type(solution_goal_t), intent(in) :: goal
    type(contact_problem_t), intent(in) :: problem
    !> Solves of every body.
    integer, intent(in) :: n_sweeps
    type(contact_solution_t), intent(in) :: solution
    !> With the time of the iteration.
    type(log_monitor_t), intent(inout) :: monitor
    call show_state(monitor%log, solution%state, solution%tolerance, n_sweeps, monitor%timing%iterate)
    call show_budget(monitor%log, case%output, problem%body, solution%state, solution%budget)
    call show_not_computed(monitor%log, goal, solution%state)
    call show_conditioning(monitor%log, problem%body, problem%classes, solution%conditioning)
  end subroutine show_solution

  !> Contact pressures by pairs, and the results file.
  subroutine write_results(case, scene, qp, n_sweeps, solution, threads, started, monitor, error)
    type(case_t), intent(in) :: case
    type(scene_t), intent(in) :: scene
    type(contact_qp_t), intent(in) :: qp
    !> Solves of every body.
    integer, intent(in) :: n_sweeps
    type(contact_solution_t), intent(in) :: solution
    !> Threads in use; date and time of the start.
    integer, intent(in) :: threads
    character(*), intent(in) :: started
    type(log_monitor_t), intent(inout) :: monitor
    !> Allocated where results are not finite, or the file cannot be written.
    type(error_t), allocatable, intent(out) :: error
    type(pair_solution_t), allocatable :: pair_solution(:)
    type(nodal_field_t), allocatable :: contact_pressure(:)
    type(results_file_t) :: file
    associate (problem => scene%problem, displacements => solution%displacements%body)
      call set_stage('projecting contact pressures')
      call project_pressures(problem, qp%pair_first_row, solution%state%m, solution%state%y, pair_solution, &
        contact_pressure, error)
      if (.not. allocated(error)) call refuse_overflow(case, problem%body, problem%pair, displacements, pair_solution, &
                                                       solution%state, error)
      if (allocated(error)) return
      if (solution%state%ended /= ended_time) call show_pair_results(monitor%log, problem%pair, pair_solution)
      call monitor%watch%lap(monitor%timing%recover)
      call set_stage('writing results')
      call write_fields(file, case, problem%body, displacements, contact_pressure, solution%budget, error)
      if (allocated(error)) return
      call write_pairs(file, problem%pair, qp%pair_first_row, solution, pair_solution)
      call write_summary(file, case, problem, scene%size_of, qp, n_sweeps, full_solves(scene, solution), solution)
      call write_provenance(file, case, threads, started)
      call monitor%watch%lap(monitor%timing%write)
      monitor%timing%total = monitor%watch%since_start()
      call write_timing(file, monitor%timing)
      call file%commit(error)
    end associate
  end subroutine write_results

  !> Solves with whole factors: without contact, and one for each body in each recovery of displacements.
  pure integer function full_solves(scene, solution) result(n)
    type(scene_t), intent(in) :: scene
    type(contact_solution_t), intent(in) :: solution
    integer :: b
    n = count([(.not. allocated(scene%problem%isolated(b)%displacement), b=1, size(scene%problem%isolated))])
    n = scene%n_full_solves + n*solution%displacements%n_recoveries
  end function full_solves
end module dotyk_driver_report
