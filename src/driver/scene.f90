!> From the input to a contact problem: bodies and contact rows.
module dotyk_driver_scene
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: set_stage
  use dotyk_base_text, only: text_t
  use dotyk_contact_operator, only: build_operator, contact_operator_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_factorization, only: analyze_bodies, factor_size_t
  use dotyk_control_response_choice, only: choose_forms, form_multigrid, form_split, operator_slot_t
  use dotyk_driver_run_settings, only: may_use_multigrid
  use dotyk_control_neutral_modes, only: neutral_modes_t
  use dotyk_elasticity_body, only: stiffness_t
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_model_assembly, only: assemble_bodies, check_held
  use dotyk_model_body_setup, only: body_surfaces_t, build_bodies
  use dotyk_model_pairs, only: find_pairs
  use dotyk_ranks_exchange, only: meet
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_split_split_scene, only: can_split, split_scene_t
  implicit none
  private

  !> The parts of a contact problem, in the order in which they are made.
  type, public :: scene_t
    !> Bodies, modes, contact pairs.
    type(contact_problem_t) :: problem
    !> Stiffnesses of the representatives, until they are factorized (n_bodies).
    type(stiffness_t), allocatable :: stiffness(:)
    !> Rows of B, weights and gaps, until the QP has them.
    type(contact_operator_t) :: operator
    !> Penalty parameters that the input asks for (n_rows) [length/pressure].
    real(dp), allocatable :: theta(:)
    !> Compliance operators of the representatives, until the compliance has them (n_bodies).
    type(operator_slot_t), allocatable :: slot(:)
    !> Sizes of the factors (n_bodies).
    type(factor_size_t), allocatable :: size_of(:)
    !> Solves with whole factors so far.
    integer :: n_full_solves = 0
    !> The quadratic programme.
    type(contact_qp_t) :: qp
    !> Its compliance.
    type(body_compliance_t) :: compliance
    !> Modes that contact hardly resists.
    type(neutral_modes_t) :: neutral
    !> Bodies that all ranks compute together.
    type(split_scene_t) :: split
  contains
    procedure :: has_multigrid => scene_has_multigrid
    procedure :: is_split => scene_is_split
  end type scene_t

  public :: build_scene

contains

  !> Whether bodies are solved by p-multigrid.
  pure logical function scene_has_multigrid(self) result(has)
    class(scene_t), intent(in) :: self
    has = any(self%size_of%form == form_multigrid)
  end function scene_has_multigrid

  !> Whether all ranks compute each body together.
  pure logical function scene_is_split(self) result(is_split)
    class(scene_t), intent(in) :: self
    is_split = any(self%size_of%form == form_split)
  end function scene_is_split

  !> Meshes to bodies, contact rows, and the sizes of the factors: all that can be checked before anything is solved.
  subroutine build_scene(case, scheme, scene, monitor, error)
    !> The case; its contacts become the pairs that they stand for.
    type(case_t), intent(inout) :: case
    !> Scheme of the run.
    class(scheme_t), intent(in) :: scheme
    !> The scene: bodies, contact pairs, sizes of the factors.
    type(scene_t), intent(inout) :: scene
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
      if (splits) then
        form(:) = form_split
        call problem%classes%init(size(problem%body))
      end if
      call problem%ranks%init(problem%body, problem%classes, splits)
      call assemble_bodies(case, problem%classes, problem%ranks, form, problem%body, problem%modes, scene%stiffness, &
                           scene%slot, error)
      if (splits .and. .not. allocated(error)) call scene%split%assemble(problem%body, error)
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
end module dotyk_driver_scene
