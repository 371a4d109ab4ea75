!> What --check says of the run that it does not make: its memory.
module dotyk_driver_prediction
  use dotyk_base_error, only: error_t
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_control_run_prediction, only: predicted_memory
  use dotyk_driver_factorization, only: use_factors
  use dotyk_driver_scene, only: scene_t
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_memory
  use dotyk_scheme_linear_solver_choice, only: room_for_matrices
  use dotyk_scheme_scheme, only: scheme_t
  implicit none
  private
  public :: predict_run

contains

  !> Predict the memory of a run, and show it.
  subroutine predict_run(case, scheme, scene, monitor, error)
    type(case_t), intent(in) :: case  !! The case.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the run.
    !> The scene, built; with factors in place of p-multigrid on return where the run would have them.
    type(scene_t), intent(inout) :: scene
    type(log_monitor_t), intent(inout) :: monitor  !! Log.
    !> Allocated where the analysis of a factor fails, or an interrupt came.
    type(error_t), allocatable, intent(out) :: error
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
end module dotyk_driver_prediction
