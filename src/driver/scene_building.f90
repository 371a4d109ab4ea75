!> From the input to a contact problem: bodies and contact rows.
module dotyk_driver_scene_building
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_memory, only: peak_memory, set_stage
  use dotyk_base_text, only: text_t
  use dotyk_contact_met_points, only: met_point_t
  use dotyk_control_factorization, only: analyze_bodies
  use dotyk_control_response_choice, only: form_split
  use dotyk_driver_body_building, only: read_bodies
  use dotyk_driver_contact_building, only: build_contact
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_split_choice, only: choose_solution
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_assemble, stage_order, stage_read, stage_search
  use dotyk_model_assembly, only: assemble_bodies, check_held
  use dotyk_model_body_parts, only: hold_parts
  use dotyk_model_body_surfaces, only: body_surfaces_t
  use dotyk_model_double_bodies, only: refuse_doubles
  use dotyk_model_quantities, only: find_quantities
  use dotyk_ranks_exchange, only: meet
  use dotyk_scheme_scheme, only: reason_none, reason_parts, scheme_t
  implicit none
  private
  public :: build_scene, scene_t

contains

  !> Meshes to bodies, contact rows, and the sizes of the factors: all that can be checked before anything is solved.
  subroutine build_scene(case, scheme, may_split, met, scene, monitor, reason, error)
    type(case_t), intent(inout) :: case  !! The case; its contacts become the pairs that they stand for.
    class(scheme_t), intent(in) :: scheme  !! Scheme of the run.
    logical, intent(in) :: may_split  !! Whether several ranks may compute a body together.
    type(met_point_t), intent(in) :: met(:)  !! Points at which bodies met beside their contact rows before (n).
    type(scene_t), intent(out) :: scene  !! The scene: bodies, contact pairs, sizes of the factors.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> `reason_parts` where the ranks have parts of bodies that are not to be split: the scene is to be built anew,
    !> without; `reason_none` otherwise.
    integer, intent(out) :: reason
    !> Allocated where a mesh, a material, a support, a load or a pair is wrong; names file and line.
    type(error_t), allocatable, intent(out) :: error
    type(text_t), allocatable :: remarks(:)
    integer, allocatable :: form(:)
    type(body_surfaces_t), allocatable :: surfaces(:)
    logical :: splits, in_parts, are_dealt
    integer :: i
    reason = reason_none
    associate (problem => scene%problem)
      call refuse_doubles(case, error)
      if (allocated(error)) return
      call set_stage('reading meshes')
      call read_bodies(case, may_split, problem, surfaces, remarks, in_parts, are_dealt, error)
      if (.not. allocated(problem%body)) return
      ! A scene that is built anew has told them already: only then its bodies may not be split.
      if (may_split) then
        do i = 1, size(remarks)
          call monitor%log%line('  '//remarks(i)%s)
        end do
      end if
      call meet()
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%lap(stage_read)
      if (in_parts) call problem%classes%init(size(problem%body))
      if (.not. (in_parts .or. are_dealt)) call problem%classes%find(problem%body)
      if (scheme%is_iteration()) call check_held(case, problem%body, problem%classes, problem%ranks, error)
      if (allocated(error)) return
      call set_stage('assembling')
      call choose_solution(case, problem%body, problem%classes, in_parts, monitor, form, splits)
      if (in_parts .and. .not. splits) reason = reason_parts
      if (reason /= reason_none) return
      if (splits) call problem%classes%init(size(problem%body))
      if (.not. are_dealt) then
        call problem%ranks%init(problem%body, problem%classes, splits)
        call hold_parts(problem%classes, problem%ranks, problem%body, surfaces, problem%modes)
      end if
      monitor%timing%memory_of_bodies = peak_memory()
      call assemble_bodies(case, problem%classes, problem%ranks, form, problem%body, problem%modes, scene%stiffness, &
                           scene%slot, error)
      if (splits .and. .not. allocated(error)) call scene%split%assemble(problem%body, problem%modes, error)
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%lap(stage_assemble)
      call set_stage('searching for contact')
      call build_contact(case, surfaces, met, scene, error)
      if (allocated(error)) return
      call find_quantities(case, surfaces, problem, scene%quantity, error)
      if (allocated(error)) return
      call monitor%lap(stage_search)
      call set_stage('ordering the equations')
      call analyze_bodies(problem%body, problem%modes, scene%stiffness, problem%classes, problem%ranks, &
                          scene%operator%block, case%solver%response, scheme%expected_products(), scene%slot, &
                          scene%size_of, error)
      if (splits .and. allocated(scene%size_of)) scene%size_of%form = form_split
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%lap(stage_order)
    end associate
  end subroutine build_scene
end module dotyk_driver_scene_building
