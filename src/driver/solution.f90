!> The solution of a scene: factorization, and the contact solved as often as intermediate results and neutral modes ask
!> for.
module dotyk_driver_solution
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_control_contact_solution, only: contact_solution_t, solve_contact
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_factorization, only: factorize_scene
  use dotyk_driver_results, only: write_on_the_way
  use dotyk_driver_run_settings, only: goal_of
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: start_from_pressures
  use dotyk_input_case, only: case_t
  use dotyk_log_outcome, only: refuse_unsolvable
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_factorization
  use dotyk_scheme_solver_state, only: ended_time
  implicit none
  private
  public :: solve_scene

contains

  !> Factorize and solve; the compliance is destroyed.
  subroutine solve_scene(case, run, scene, pressure, threads, monitor, solution, error)
    !> The case.
    type(case_t), intent(in) :: case
    !> Scheme and its settings.
    type(scheme_run_t), intent(in) :: run
    !> The scene, built.
    type(scene_t), intent(inout) :: scene
    !> Contact pressures to start from; not allocated where there are none (n_rows) [pressure].
    real(dp), allocatable, intent(in) :: pressure(:)
    !> Number of threads.
    integer, intent(in) :: threads
    !> Log and watch; times are added.
    type(log_monitor_t), intent(inout) :: monitor
    !> The solution.
    type(contact_solution_t), intent(inout) :: solution
    !> Allocated where there is none: a body is not held, no equilibrium, too little memory, an interrupt.
    type(error_t), allocatable, intent(out) :: error
    logical :: has_warned
    call factorize_scene(case, run%scheme, scene, monitor, error)
    if (.not. allocated(error)) then
      call show_factorization(monitor%log, scene%problem%body, scene%size_of, monitor%timing%factorize)
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
  end subroutine solve_scene

  !> A solution that is not begun.
  subroutine begin_again(theta, solution)
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Without a state on return.
    type(contact_solution_t), intent(out) :: solution
    solution%theta = theta
  end subroutine begin_again
end module dotyk_driver_solution
