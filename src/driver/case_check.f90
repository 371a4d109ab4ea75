!> What --check says of the load cases.
module dotyk_driver_case_check
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: initial_pressures
  use dotyk_elasticity_load_cases, only: take_case
  use dotyk_input_case, only: case_t
  use dotyk_log_case_tables, only: show_case
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_model_contact_cases, only: contacts_of_case, set_contact_case
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private
  public :: check_cases

contains

  !> What acts in each load case of a scene that is not solved, and whether an earlier run fits.
  subroutine check_cases(restart, case, scene, monitor, error)
    character(*), intent(in) :: restart  !! Results file of an earlier run to start from; empty where there is none.
    type(case_t), intent(in) :: case  !! The case.
    type(scene_t), intent(inout) :: scene  !! The scene, built; the load case of its bodies changes.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    !> Allocated where the file cannot be read, or has other contact rows or load cases.
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: now
    type(solver_state_t) :: none
    type(error_t), allocatable :: ignored
    real(dp), allocatable :: pressure(:)
    logical, allocatable :: is_changed(:)
    integer :: b, k
    do k = 1, case%n_cases()
      call initial_pressures(restart, case, k, scene%problem, monitor%log, none, pressure, error)
      if (allocated(error)) return
    end do
    if (.not. case%has_cases()) return
    now = case
    do k = 1, case%n_cases()
      do b = 1, size(scene%problem%body)
        call take_case(scene%problem%body(b), k)
      end do
      ! That they are right is checked.
      call set_contact_case(case, k, scene%pair_conditions, scene%problem, ignored)
      call contacts_of_case(case, k, now%contact, is_changed)
      call show_case(monitor%log, now, k, scene%problem, is_changed)
    end do
    call monitor%log%line('')
  end subroutine check_cases
end module dotyk_driver_case_check
