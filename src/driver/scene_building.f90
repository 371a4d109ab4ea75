!> From the input to a contact problem: bodies and contact rows.
module dotyk_driver_scene_building
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_memory, only: set_stage
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_contact_operator, only: build_operator
  use dotyk_control_factorization, only: analyze_bodies
  use dotyk_control_response_choice, only: choose_forms, form_direct, form_multigrid, form_split, &
    suits_multigrid
  use dotyk_driver_run_settings, only: may_use_multigrid
  use dotyk_driver_scene, only: scene_t
  use dotyk_elasticity_body, only: body_t, free_rigid_modes
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_model_assembly, only: assemble_bodies, check_held
  use dotyk_model_body_parts, only: hold_parts
  use dotyk_model_body_setup, only: body_surfaces_t, build_bodies
  use dotyk_model_pairs, only: find_pairs
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: meet
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_split_split_scene, only: can_split
  implicit none
  private
  public :: build_scene, scene_t

  !> Floating bodies at most that are split: the coarse level does not know the motions of each, and needs hundreds of
  !> iterations for networks of more.
  integer, parameter :: most_floating = 15

contains

  !> Meshes to bodies, contact rows, and the sizes of the factors: all that can be checked before anything is solved.
  subroutine build_scene(case, scheme, may_split, scene, monitor, error)
    !> The case; its contacts become the pairs that they stand for.
    type(case_t), intent(inout) :: case
    !> Scheme of the run.
    class(scheme_t), intent(in) :: scheme
    !> Whether several ranks may compute a body together.
    logical, intent(in) :: may_split
    !> The scene: bodies, contact pairs, sizes of the factors.
    type(scene_t), intent(out) :: scene
    !> Log and watch; times are added.
    type(log_monitor_t), intent(inout) :: monitor
    !> Allocated where a mesh, a material, a support, a load or a pair is wrong; names file and line.
    type(error_t), allocatable, intent(out) :: error
    type(text_t), allocatable :: remarks(:)
    integer, allocatable :: form(:)
    type(body_surfaces_t), allocatable :: surfaces(:)
    logical :: splits
    integer :: i
    associate (problem => scene%problem)
      call set_stage('reading meshes')
      call build_bodies(case, problem%body, surfaces, remarks, error)
      do i = 1, size(remarks)
        call monitor%log%line('  '//remarks(i)%s)
      end do
      call meet()
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%watch%lap(monitor%timing%read)
      call problem%classes%init(size(problem%body))
      call problem%classes%find(problem%body)
      if (scheme%needs_held_bodies()) call check_held(case, problem%body, problem%classes, error)
      if (allocated(error)) return
      call set_stage('assembling')
      form = choose_forms(problem%body, problem%classes, case%solver%response, may_use_multigrid(case))
      splits = can_split() .and. any(form == form_multigrid)
      if (splits .and. .not. may_split) form(:) = form_direct
      splits = splits .and. may_split
      if (splits) call choose_split(problem%body, monitor, form, splits)
      if (splits) call problem%classes%init(size(problem%body))
      call problem%ranks%init(problem%body, problem%classes, splits)
      call hold_parts(problem%classes, problem%ranks, problem%body, surfaces, problem%modes)
      call assemble_bodies(case, problem%classes, problem%ranks, form, problem%body, problem%modes, scene%stiffness, &
                           scene%slot, error)
      if (splits .and. .not. allocated(error)) call scene%split%assemble(problem%body, problem%modes, error)
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%watch%lap(monitor%timing%assemble)
      call set_stage('searching for contact')
      call find_pairs(case, problem%body, surfaces, problem%surface_a, problem%surface_b, problem%pair, scene%theta, &
                      problem%found, error)
      call meet()
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call build_operator(case%scene%dimension, size(problem%body), problem%pair, problem%surface_a, &
                          problem%surface_b, scene%operator)
      do i = 1, size(problem%body)
        associate (block => scene%operator%block(i))
          if (n_ranks() > 1) block%whole_node = problem%body(i)%mesh%whole_nodes(block%contact_node)
        end associate
      end do
      call monitor%watch%lap(monitor%timing%search)
      call set_stage('ordering the equations')
      call analyze_bodies(problem%body, problem%modes, scene%stiffness, problem%classes, problem%ranks, &
                          scene%operator%block, case%solver%response, scheme%expected_products(), scene%slot, &
                          scene%size_of, error)
      if (splits .and. allocated(scene%size_of)) scene%size_of%form = form_split
      call stop_if_interrupted(error)
      if (allocated(error)) return
      call monitor%watch%lap(monitor%timing%order)
    end associate
  end subroutine build_scene

  !> Split the bodies over all ranks, or leave each to one rank with its factor: not where the iterations would be too
  !> many, for nearly incompressible bodies and networks of many floating ones.
  subroutine choose_split(body, monitor, form, splits)
    !> Bodies with supports (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> Gets a line where they are not split.
    type(log_monitor_t), intent(inout) :: monitor
    !> How the bodies are solved (n_bodies).
    integer, intent(inout) :: form(:)
    !> Whether they are split.
    logical, intent(out) :: splits
    character(:), allocatable :: reason, motions
    integer :: b, n_free, n_floating
    reason = ''
    n_floating = 0
    do b = 1, size(body)
      call free_rigid_modes(body(b), n_free, motions)
      if (n_free > 0) n_floating = n_floating + 1
      if (.not. suits_multigrid(body(b))) reason = quoted(body(b)%name)//' is nearly incompressible'
      if (len(reason) > 0) exit
    end do
    if (n_floating > most_floating) reason = to_text(n_floating)//' bodies float'
    splits = len(reason) == 0
    form(:) = merge(form_split, form_direct, splits)
    if (.not. splits) call monitor%note('factors          '//reason//': bodies are not split over ranks, each has '// &
                                        'its factor on one of them')
  end subroutine choose_split
end module dotyk_driver_scene_building
