!> Load cases of a scene: bodies, contact rows, factors and compliances stay as they are, and the next case gets its
!> loads, gaps and penalty parameters.
module dotyk_driver_load_case
  use dotyk_base_error, only: error_slot_t, error_t, problem_list_t
  use dotyk_base_interrupt, only: stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: set_stage
  use dotyk_base_text, only: quoted, text_t
  use dotyk_control_body_operators, only: find_modes
  use dotyk_control_body_solution, only: displacements_t
  use dotyk_control_contact_free, only: contact_free_t, solve_without_contact
  use dotyk_control_contact_problem, only: contact_problem_t, isolated_body_t
  use dotyk_control_slave_normals, only: find_deviations
  use dotyk_driver_scene, only: scene_t
  use dotyk_elasticity_load_cases, only: take_case
  use dotyk_input_case, only: case_t
  use dotyk_log_case_tables, only: show_case
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_model_contact_cases, only: contacts_of_case, set_contact_case
  use dotyk_model_ties, only: set_bolts
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: item_t, share, share_errors
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t
  use dotyk_scheme_solver_state, only: solver_state_t
  implicit none
  private

  type, public :: solved_case_t  !! A load case of a block whose contact is solved, and that is told later.
    type(solver_state_t) :: state  !! Where the scheme ended.
    type(displacements_t) :: displacements  !! Displacements, and errors of the mesh.
    type(contact_free_t) :: free  !! The solution without contact.
    type(isolated_body_t), allocatable :: isolated(:)  !! Displacements of bodies that touch no other (n_bodies).
    type(text_t), allocatable :: note(:)  !! What the scheme had to tell.
    real(dp) :: seconds = 0  !! Time that the contact took [s].
    integer :: n_sweeps = 0  !! Right-hand sides per body that it took.
  end type solved_case_t

  public :: begin_case, next_case, solve_free

contains

  !> Begin a load case: the first one acts on the scene as it is built. Nothing is done in a scene without load cases.
  subroutine begin_case(input, k, case, scene, monitor, error, solved)
    type(case_t), intent(in) :: input  !! The case, with one contact for each pair.
    integer, intent(in) :: k  !! The load case.
    type(case_t), intent(inout) :: case  !! The same; its contacts are those of the load case on return.
    !> Factorized, unless this is the first load case; its QP is that of the load case on return.
    type(scene_t), intent(inout) :: scene
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(error_t), allocatable, intent(out) :: error  !! As in `next_case`.
    type(solved_case_t), intent(inout), optional :: solved  !! The load case where its contact is solved.
    logical, allocatable :: is_changed(:)
    if (.not. case%has_cases()) return
    if (k > 1) call next_case(input, k, scene, monitor, error, solved)
    if (allocated(error)) return
    call contacts_of_case(input, k, case%contact, is_changed)
    call show_case(monitor%log, case, k, scene%problem, is_changed)
  end subroutine begin_case

  !> Let another load case act on a scene that is factorized.
  subroutine next_case(case, k, scene, monitor, error, solved)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: k  !! The load case.
    type(scene_t), intent(inout) :: scene  !! Factorized; its QP is that of the load case on return.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> Allocated where a right-hand side cannot be assembled, or as in `solve_free`, or an interrupt came.
    type(error_t), allocatable, intent(out) :: error
    !> The load case in a block: gets the solution without contact, or has it already.
    type(solved_case_t), intent(inout), optional :: solved
    integer :: c, i
    logical :: is_solved
    associate (problem => scene%problem)
      call set_stage('assembling')
      problem%modes = scene%modes
      call load_bodies(k, scene, error)
      if (allocated(error)) return
      call set_contact_case(case, k, scene%pair_conditions, problem, error)
      if (allocated(error)) return
      if (problem%n_ties() > 0) call set_bolts(case%tie, k, problem%tie)
      ! Rows of ties come after those of the pairs, and have no penalty.
      scene%operator%theta(:sum(problem%pair%n_rows)) = [(problem%pair(i)%row_theta, i=1, size(problem%pair))]
      scene%operator%gap = [(problem%pair(i)%row_gap, i=1, size(problem%pair)), &
                            ((problem%tie(i)%component(c)%row_gap, c=1, size(problem%tie(i)%component)), &
                             i=1, problem%n_ties())]
      call monitor%watch%lap(monitor%timing%assemble)
    end associate
    call scene%compliance%forget_displacements()
    scene%compliance%n_sweeps = 0
    call solve_free(scene, error, solved)
    is_solved = .false.
    if (present(solved)) is_solved = allocated(solved%displacements%body)
    ! A case that is solved is told.
    if (.not. (is_solved .or. allocated(error))) call stop_if_interrupted(error)
    call monitor%watch%lap(monitor%timing%iterate)
  end subroutine next_case

  !> Right-hand sides of the bodies, and resultants of the loads on their modes.
  subroutine load_bodies(k, scene, error)
    integer, intent(in) :: k  !! The load case.
    type(scene_t), intent(inout) :: scene  !! Its bodies and modes are set.
    !> Allocated where a right-hand side cannot be assembled; names the body.
    type(error_t), allocatable, intent(out) :: error
    type(problem_list_t) :: problems
    type(error_slot_t), allocatable :: failed(:)
    type(item_t), allocatable :: resultant(:)
    integer :: b
    call load_all(k, scene%problem, failed)
    associate (problem => scene%problem)
      allocate (resultant(size(problem%body)))
      if (n_ranks() > 1) then
        do b = 1, size(problem%body)
          if (problem%ranks%is_own(b)) resultant(b)%value = problem%modes(b)%resultant
        end do
        call share_errors(problem%ranks%owner, failed)
        call share(problem%ranks%owner, resultant)
        do b = 1, size(problem%body)
          if (.not. problem%ranks%is_own(b)) problem%modes(b)%resultant = resultant(b)%value
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
  subroutine solve_free(scene, error, solved)
    type(scene_t), intent(inout) :: scene  !! With factors, rows of the QP and compliance.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a mode at the contact rows is not finite.
    type(solved_case_t), intent(inout), optional :: solved  !! As in `next_case`.
    type(contact_modes_t), allocatable :: modes(:)
    type(coarse_space_t) :: coarse
    type(contact_free_t) :: free
    integer :: b
    logical :: is_known
    associate (problem => scene%problem, qp => scene%qp, compliance => scene%compliance)
      call find_modes(problem%body, problem%classes, problem%ranks, qp%block, problem%report, problem%modes, modes, &
                      error)
      if (allocated(error)) return
      call set_stage('solving without contact')
      is_known = .false.
      if (present(solved)) is_known = allocated(solved%isolated)
      if (is_known) then
        free = solved%free
        problem%isolated = solved%isolated
      else
        call solve_without_contact(problem%body, problem%ranks, qp%block, scene%operator%gap, compliance%response, &
                                   problem%classes%first, compliance%side_by_side, problem%n_blas, free, &
                                   problem%isolated)
      end if
      if (present(solved) .and. .not. is_known) then
        solved%free = free
        solved%isolated = problem%isolated
      end if
      scene%n_full_solves = free%n_solves
      call coarse%init(qp%block, qp%n_rows, modes, problem%slides())
      coarse%max_unbalanced = qp%coarse%max_unbalanced
      if (.not. scene%is_split()) call find_deviations(problem, qp%block, modes, coarse)
      call qp%set_loads(scene%operator%gap, scene%operator%theta, free%initial_penetration, free%load_displacement, &
                        free%energy, free%norm_square, coarse)
      do b = 1, size(compliance%body)
        call move_alloc(free%u_0(b)%value, compliance%body(b)%free)
        call move_alloc(free%left(b)%value, compliance%body(b)%left)
      end do
    end associate
  end subroutine solve_free
end module dotyk_driver_load_case
