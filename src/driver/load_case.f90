!> Load cases of a scene: bodies, contact rows, factors and compliances stay as they are, and the next case gets its
!> loads, gaps and penalty parameters.
module dotyk_driver_load_case
  use dotyk_base_error, only: error_slot_t, error_t, problem_list_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: set_stage
  use dotyk_base_text, only: quoted
  use dotyk_control_body_operators, only: find_deviations, find_modes
  use dotyk_control_contact_free, only: contact_free_t, solve_without_contact
  use dotyk_control_contact_problem, only: contact_problem_t, isolated_body_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_engines, only: engine_none
  use dotyk_driver_scene, only: scene_t
  use dotyk_elasticity_load_cases, only: take_case
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_assemble, stage_iterate
  use dotyk_model_contact_cases, only: set_contact_case
  use dotyk_model_ties, only: set_bolts
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: item_t, share, share_errors
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t
  use dotyk_scheme_scheme, only: reason_none
  implicit none
  private

  type, public :: case_solution_t  !! A load case on its way to its results.
    type(contact_solution_t) :: solution  !! Its solution.
    type(scheme_run_t) :: run  !! The scheme that solves it, and its settings.
    integer :: engine = engine_none  !! The engine that this belongs to, one of `engine_*`.
    integer :: reason = reason_none  !! Why this engine has not solved it, one of `reason_*`.
    real(dp), allocatable :: start(:)  !! Pressures to start from; not allocated where none (n_rows) [pressure].
    character(:), allocatable :: told  !! Lines of the log that were held until the cases before it are told.
    real(dp) :: seconds = 0  !! Time of its iterations [s].
    type(error_t), allocatable :: error  !! What went wrong with it.
    !> What the scene has of it while it acts there, and it keeps while others do.
    integer, private :: n_sweeps = 0, n_full_solves = 0
    type(isolated_body_t), allocatable, private :: isolated(:)
  end type case_solution_t

  public :: act, begin_case, leave_case, resume_case, solve_free

contains

  !> Let a load case act on the scene in place of another one. The first one acts on it as it is built.
  subroutine begin_case(case, k, scene, monitor, error)
    type(case_t), intent(in) :: case  !! The case, with one contact for each pair.
    integer, intent(in) :: k  !! The load case.
    !> Factorized, unless this is the first load case; its QP is that of the load case on return.
    type(scene_t), intent(inout) :: scene
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> Allocated where a right-hand side cannot be assembled, or as in `solve_free`, or an interrupt came.
    type(error_t), allocatable, intent(out) :: error
    integer :: c, i
    if (scene%case == k) return
    call act(case, k, scene, monitor, error)
    if (allocated(error)) return
    associate (problem => scene%problem)
      ! Rows of ties come after those of the pairs, and have no penalty.
      scene%operator%theta(:sum(problem%pair%n_rows)) = [(problem%pair(i)%row_theta, i=1, size(problem%pair))]
      scene%operator%gap = [(problem%pair(i)%row_gap, i=1, size(problem%pair)), &
                            ((problem%tie(i)%component(c)%row_gap, c=1, size(problem%tie(i)%component)), &
                             i=1, problem%n_ties())]
    end associate
    call scene%compliance%forget_displacements()
    scene%compliance%n_sweeps = 0
    call solve_free(scene, scene%has_multigrid(), error)
    if (.not. allocated(error)) call stop_if_interrupted(error)
    call monitor%lap(stage_iterate)
  end subroutine begin_case

  !> Another load case is next: keep what the scene has of this one.
  subroutine leave_case(scene, solved)
    type(scene_t), intent(inout) :: scene  !! No load case acts on it on return.
    type(case_solution_t), intent(inout) :: solved  !! The load case.
    solved%n_sweeps = scene%compliance%n_sweeps
    solved%n_full_solves = scene%n_full_solves
    call move_alloc(scene%problem%isolated, solved%isolated)
    scene%case = 0
  end subroutine leave_case

  !> Let a load case act again, unless it does.
  subroutine resume_case(case, k, scene, monitor, solved, error)
    type(case_t), intent(in) :: case  !! The case, with one contact for each pair.
    integer, intent(in) :: k  !! The load case.
    type(scene_t), intent(inout) :: scene  !! Factorized; its QP stays.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(case_solution_t), intent(inout) :: solved  !! What it keeps goes to the scene.
    type(error_t), allocatable, intent(out) :: error  !! As in `begin_case`.
    type(contact_modes_t), allocatable :: modes(:)
    if (scene%case == k) return
    call act(case, k, scene, monitor, error)
    if (allocated(error)) return
    associate (problem => scene%problem)
      call find_modes(problem%body, problem%classes, problem%ranks, scene%qp%block, problem%report, problem%modes, &
                      modes, error)
    end associate
    scene%compliance%n_sweeps = solved%n_sweeps
    scene%n_full_solves = solved%n_full_solves
    call move_alloc(solved%isolated, scene%problem%isolated)
  end subroutine resume_case

  !> Loads, gaps, penalty parameters and bolts of a load case.
  subroutine act(case, k, scene, monitor, error)
    type(case_t), intent(in) :: case  !! As in `begin_case`.
    integer, intent(in) :: k  !! The load case.
    type(scene_t), intent(inout) :: scene  !! As in `begin_case`.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(error_t), allocatable, intent(out) :: error  !! As in `begin_case`.
    call set_stage('assembling')
    scene%case = 0
    scene%problem%modes = scene%modes
    call load_bodies(k, scene, error)
    if (allocated(error)) return
    call set_contact_case(case, k, scene%pair_conditions, scene%problem, error)
    if (allocated(error)) return
    if (scene%problem%n_ties() > 0) call set_bolts(case%tie, k, scene%problem%tie)
    scene%case = k
    call monitor%lap(stage_assemble)
  end subroutine act

  !> Right-hand sides of the bodies, and resultants of the loads on their modes.
  subroutine load_bodies(k, scene, error)
    integer, intent(in) :: k  !! The load case.
    type(scene_t), intent(inout) :: scene  !! Its bodies and modes are set.
    type(error_t), allocatable, intent(out) :: error  !! Where a right-hand side cannot be assembled; names the body.
    type(problem_list_t) :: problems
    type(error_slot_t), allocatable :: failed(:)
    type(item_t), allocatable :: resultant(:)
    integer :: b
    call load_all(k, scene%problem, failed)
    associate (problem => scene%problem)
      allocate (resultant(size(problem%body)))
      if (n_ranks() > 1) then
        do b = 1, size(problem%body)
          associate (modes => problem%modes(b))
            if (problem%ranks%is_own(b)) resultant(b)%value = [modes%resultant, modes%resultant_size]
          end associate
        end do
        call share_errors(problem%ranks%owner, failed)
        call share(problem%ranks%owner, resultant)
        do b = 1, size(problem%body)
          if (problem%ranks%is_own(b)) cycle
          associate (modes => problem%modes(b), value => resultant(b)%value)
            modes%resultant = value(:size(value)/2)
            modes%resultant_size = value(size(value)/2 + 1:)
          end associate
        end do
      end if
      do b = 1, size(problem%body)
        call problems%add_error(failed(b)%error, 'body '//quoted(problem%body(b)%name)//': ')
      end do
    end associate
    call problems%raise(error)
  end subroutine load_bodies

  !> Each body by its rank, side by side.
  subroutine load_all(k, problem, failed)
    integer, intent(in) :: k  !! The load case.
    type(contact_problem_t), intent(inout) :: problem  !! Its bodies and modes are set.
    type(error_slot_t), allocatable, intent(out) :: failed(:)  !! Errors of the bodies (n_bodies).
    integer :: b
    allocate (failed(size(problem%body)))
    !$omp parallel do default(none) schedule(dynamic, 1) shared(problem, k, failed)
    do b = 1, size(problem%body)
      if (.not. allocated(problem%body(b)%of_case)) cycle
      call take_case(problem%body(b), k)
      if (.not. problem%ranks%is_own(b)) cycle
      call problem%body(b)%assemble_loads(failed(b)%error)
      call problem%modes(b)%take_loads(problem%body(b))
    end do
    !$omp end parallel do
  end subroutine load_all

  !> Solve without contact: the QP of the loads that act on the bodies.
  subroutine solve_free(scene, roughly, error)
    type(scene_t), intent(inout) :: scene  !! With factors, rows of the QP and compliance.
    logical, intent(in) :: roughly  !! As in `solve_without_contact`.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a mode at the contact rows is not finite.
    type(contact_modes_t), allocatable :: modes(:)
    type(coarse_space_t) :: coarse
    type(contact_free_t) :: free
    integer :: b
    associate (problem => scene%problem, qp => scene%qp, compliance => scene%compliance)
      call find_modes(problem%body, problem%classes, problem%ranks, qp%block, problem%report, problem%modes, modes, &
                      error)
      if (allocated(error)) return
      call set_stage('solving without contact')
      call solve_without_contact(problem%body, problem%ranks, qp%block, scene%operator%gap, compliance%response, &
                                 problem%classes%first, compliance%side_by_side, problem%n_blas, roughly, free, &
                                 problem%isolated)
      scene%is_rough = free%is_rough
      scene%n_full_solves = free%n_solves
      call coarse%init(qp%block, qp%n_rows, modes, problem%slides())
      coarse%max_unbalanced = qp%coarse%max_unbalanced
      call find_deviations(problem, qp%block, modes, coarse)
      call qp%set_loads(scene%operator%gap, scene%operator%theta, free%initial_penetration, free%load_displacement, &
                        free%energy, free%norm_square, coarse)
      do b = 1, size(compliance%body)
        call move_alloc(free%u_0(b)%value, compliance%body(b)%free)
        call move_alloc(free%load(b)%value, compliance%body(b)%load)
        call move_alloc(free%left(b)%value, compliance%body(b)%left)
      end do
    end associate
  end subroutine solve_free
end module dotyk_driver_load_case
