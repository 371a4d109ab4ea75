!> The load cases of a scene one after the other: solved, told in the log, and written to one results file. Without load
!> cases in the input there is one. With --check they are not solved: what acts in each, and the memory of the run.
module dotyk_driver_load_cases
  use dotyk_base_error, only: error_t, exit_not_converged
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_base_text, only: to_text
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_control_balance, only: keep_shortenings
  use dotyk_control_body_operators, only: find_modes
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_control_factorization, only: predicted_memory
  use dotyk_control_gap_doubt, only: is_doubtful
  use dotyk_control_mesh_quantities, only: find_mesh_quantities
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_control_quantity_error, only: find_quantity_errors
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_accuracy, only: accuracy_t
  use dotyk_driver_case_block, only: case_block_t
  use dotyk_driver_factorization, only: use_factors
  use dotyk_driver_load_case, only: act
  use dotyk_driver_penetration, only: check_bodies
  use dotyk_driver_results, only: finish_results, write_results
  use dotyk_driver_run_settings, only: goal_of
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: initial_pressures
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_input_case, only: case_t
  use dotyk_log_case_tables, only: add_case_row, case_row_t, show_case, show_case_table
  use dotyk_log_outcome, only: note_modes, refuse_unsolvable
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_memory
  use dotyk_log_summary, only: show_errors, show_outcome
  use dotyk_model_contact_cases, only: contacts_of_case
  use dotyk_output_results_file, only: results_file_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_linear_solver_choice, only: is_heap, room_for_matrices
  use dotyk_scheme_monitor, only: phase_estimate
  use dotyk_scheme_scheme, only: reason_none, scheme_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_gaps, ended_rotated, solver_state_t
  use dotyk_scheme_winkler_start, only: check_equilibrium
  implicit none
  private
  public :: solve_cases, check_cases, predict_run

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
                                    scene%quantity, solution%state, solution%gap_doubt, solution%budget, scene%kept, &
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

  !> How far bodies rotate. A solution with a rotation by more than the size of a body is none.
  subroutine find_rotations(problem, state, ratio)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their modes.
    !> Where the scheme ended; ended by a rotation that is too large on return.
    type(solver_state_t), intent(inout) :: state
    !> Displacement by rotation, relative to the size of the body (n_bodies) [].
    real(dp), allocatable, intent(out) :: ratio(:)
    integer :: b, first(size(problem%body) + 1)
    allocate (ratio(size(problem%body)), source=0.0_dp)
    if (.not. allocated(state%alpha)) return
    if (size(state%alpha) == 0) return
    first = first_mode(problem%modes, problem%tie)
    do b = 1, size(ratio)
      if (problem%modes(b)%n > 0) &
        ratio(b) = rotation_ratio(problem%body(b), problem%modes(b), &
                                  state%alpha(first(b):first(b) + problem%modes(b)%n - 1))
    end do
    ! Linear kinematics describe nothing then.
    if (state%ended == ended_converged .and. maxval(ratio) > 1) state%ended = ended_rotated
  end subroutine find_rotations

  !> How far nodes move against their mean, relative to the size of the body [].
  pure real(dp) function rotation_ratio(body, modes, amplitude) result(ratio)
    type(body_t), intent(in) :: body  !! The body.
    type(body_modes_t), intent(in) :: modes  !! Its modes.
    real(dp), intent(in) :: amplitude(:)  !! Amplitude of each mode (n) [length].
    real(dp) :: u(body%dimension, size(modes%shape, 2)), mean(body%dimension), length
    integer :: i, k
    u = 0
    do k = 1, size(amplitude)
      u = u + amplitude(k)*modes%shape(:, :, k)
    end do
    mean = sum(u, 2)/size(u, 2)
    length = norm2(maxval(body%mesh%x, 2) - minval(body%mesh%x, 2))
    ratio = 0
    do i = 1, size(u, 2)
      ratio = max(ratio, norm2(u(:, i) - mean)/length)
    end do
  end function rotation_ratio

  !> What acts in each load case of a scene that is not solved, whether contact can balance it, and whether an earlier
  !> run fits.
  subroutine check_cases(restart, case, scene, monitor, error)
    character(*), intent(in) :: restart  !! Results file of an earlier run to start from; empty where there is none.
    type(case_t), intent(in) :: case  !! The case.
    type(scene_t), intent(inout) :: scene  !! The scene, built; the load case of its bodies changes.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    !> Allocated where the file cannot be read, or has other contact rows or load cases; or as in `act`.
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: now
    type(solver_state_t) :: none
    real(dp), allocatable :: pressure(:)
    logical, allocatable :: is_changed(:)
    integer :: k
    now = case
    if (case%n_cases() > 1) scene%modes = scene%problem%modes
    do k = 1, case%n_cases()
      call initial_pressures(restart, case, k, scene%problem, monitor%log, none, pressure, error)
      if (.not. allocated(error) .and. k > 1) call act(case, k, scene, monitor, error)
      if (allocated(error)) return
      if (case%has_cases()) then
        call contacts_of_case(case, k, now%contact, is_changed)
        call show_case(monitor%log, now, k, scene%problem, is_changed)
      end if
      call warn_of_motion(now, scene, monitor)
    end do
    if (case%has_cases()) call monitor%log%line('')
  end subroutine check_cases

  !> Warn of a load case that moves floating bodies along a motion that no contact stops. Many bodies take as long for
  !> this as for a solution.
  subroutine warn_of_motion(case, scene, monitor)
    type(case_t), intent(in) :: case  !! The case.
    type(scene_t), intent(inout) :: scene  !! The scene, built, with the load case.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(factorization_report_t) :: report(size(scene%problem%body))
    type(contact_modes_t), allocatable :: modes(:)
    type(coarse_space_t) :: coarse
    type(contact_operator_t) :: operator
    type(contact_qp_t) :: qp
    type(solver_state_t) :: state
    type(error_t), allocatable :: error
    real(dp) :: nothing(scene%operator%n_rows), unit(scene%operator%n_rows)
    integer :: i
    nothing = 0
    unit = 1
    operator = scene%operator
    associate (problem => scene%problem)
      call find_modes(problem%body, problem%classes, problem%ranks, operator%block, report, problem%modes, modes, error)
      if (allocated(error)) return
      call coarse%init(operator%block, operator%n_rows, modes, problem%slides())
      coarse%max_unbalanced = case%solver%max_unbalanced
      call qp%init(operator, nothing, nothing, 0.0_dp, 0.0_dp, unit, coarse, &
                   [(i > sum(problem%pair%n_rows), i=1, size(unit))])
      if (is_heap(qp)) return
      call check_equilibrium(qp, state)
      call refuse_unsolvable(case, problem, qp, state, error)
    end associate
    if (allocated(error)) call monitor%log%line('  warning: the run will end with exit code '// &
                                                to_text(error%code)//': '//error%message)
  end subroutine warn_of_motion

  !> Predict the memory of a run, and show it.
  subroutine predict_run(case, scheme, scene, monitor, error)
    type(case_t), intent(in) :: case  !! The case.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the run.
    !> The scene, built; with factors in place of p-multigrid on return where the run would have them.
    type(scene_t), intent(inout) :: scene
    type(log_monitor_t), intent(inout) :: monitor  !! Log.
    type(error_t), allocatable, intent(out) :: error  !! Where the analysis of a factor fails, or an interrupt came.
    type(memory_t) :: memory
    integer :: b, n_contact
    logical :: has_factors
    if (scene%is_split()) then
      call monitor%log%line('  estimated memory: not for bodies split over ranks (docs/scaling.md)')
      return
    end if
    call use_factors(case, scheme, scene, monitor, has_factors, error)
    if (allocated(error)) return
    memory = memory_now()
    n_contact = sum(scene%problem%pair%n_rows)
    call show_memory(monitor%log, scene%size_of, predicted_memory(scene%problem%body%n_unknowns(), &
      [(size(scene%operator%block(b)%row), b=1, size(scene%size_of))], scene%size_of, memory%used, &
      [(count(scene%operator%block(b)%row > n_contact), b=1, size(scene%size_of))], case%solver%linear_solver, &
      room_for_matrices(memory)))
  end subroutine predict_run
end module dotyk_driver_load_cases
