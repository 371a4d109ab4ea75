!> What --check says of the load cases, and of the memory of the run that it does not make.
module dotyk_driver_case_check
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_base_text, only: to_text
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_control_body_operators, only: find_modes
  use dotyk_control_run_prediction, only: predicted_memory
  use dotyk_driver_factorization, only: use_factors
  use dotyk_driver_load_case, only: act
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: initial_pressures
  use dotyk_input_case, only: case_t
  use dotyk_log_case_tables, only: show_case
  use dotyk_log_outcome, only: refuse_unsolvable
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_memory
  use dotyk_model_contact_cases, only: contacts_of_case
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_equilibrium_check, only: check_equilibrium
  use dotyk_scheme_linear_solver_choice, only: is_heap, room_for_matrices
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: check_cases, predict_run

contains

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
end module dotyk_driver_case_check
