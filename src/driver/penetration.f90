!> The check of the deformed bodies against each other, in a run.
module dotyk_driver_penetration
  use dotyk_base_memory, only: set_stage
  use dotyk_contact_met_points, only: is_same, met_point_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_penetration_check, only: body_penetration_t, check_penetration, find_initial_overlap
  use dotyk_driver_scene, only: scene_t
  use dotyk_log_penetration_lines, only: note_formulas, show_initial_overlap, show_large_motion, show_met_points, &
    show_penetration
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_check
  use dotyk_scheme_solver_state, only: ended_penetration
  implicit none
  private
  public :: check_bodies, check_placement

contains

  !> Warn of bodies that overlap before they are loaded.
  subroutine check_placement(scene, monitor)
    type(scene_t), intent(in) :: scene  !! The scene, built.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(body_penetration_t), allocatable :: found(:)
    call set_stage('checking for overlaps')
    call find_initial_overlap(scene%problem, found)
    call show_initial_overlap(monitor%log, scene%problem%body, found)
    call monitor%lap(stage_check)
  end subroutine check_placement

  !> Check the solution. Where bodies penetrate each other it is none.
  subroutine check_bodies(scene, solution, may_add, monitor, met, has_met)
    type(scene_t), intent(in) :: scene  !! The scene, solved.
    type(contact_solution_t), intent(inout) :: solution  !! The solution, with the outcome of the check on return.
    logical, intent(in) :: may_add  !! Whether `met` may grow.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(met_point_t), allocatable, intent(inout) :: met(:)  !! Points where bodies met beside their rows (n).
    logical, intent(out) :: has_met  !! Whether it has grown: the scene is to be solved again.
    integer :: i, k
    has_met = .false.
    call set_stage('checking for penetration')
    if (.not. all_displaced()) return
    call check_penetration(scene%problem, solution%displacements%body, scene%qp%pair_first_row, &
                           solution%state%penetration, solution%gap_doubt%moved_change, &
                           solution%state%error_bound, solution%penetration)
    call monitor%lap(stage_check)
    ! A point that has been added before has its row, or is excluded.
    associate (check => solution%penetration)
      check%met = pack(check%met, [(.not. any([(is_same(check%met(i), met(k)), k=1, size(met))]), &
                                    i=1, size(check%met))])
      has_met = may_add .and. size(check%met) > 0 .and. solution%state%has_converged()
      if (has_met) then
        call show_met_points(monitor%log, scene%problem%body, check)
        met = [met, check%met]
        return
      end if
    end associate
    call show_large_motion(monitor%log, scene%problem, solution%displacements%body)
    call show_penetration(monitor%log, scene%problem%body, solution%penetration)
    call note_formulas(monitor%log, scene%problem%pair)
    if (size(solution%penetration%found) > 0 .and. solution%state%has_converged()) &
      solution%state%ended = ended_penetration

  contains

    !> Whether the displacements of all bodies are known.
    logical function all_displaced()
      integer :: b
      all_displaced = .false.
      if (.not. allocated(solution%displacements%body)) return
      all_displaced = all([(allocated(solution%displacements%body(b)%displacement), &
                            b=1, size(solution%displacements%body))])
    end function all_displaced
  end subroutine check_bodies
end module dotyk_driver_penetration
