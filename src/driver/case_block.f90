!> Blocks of load cases: the contact of each is solved, then their displacements take one solve of each body with as
!> many right-hand sides, and their error estimates one pass over each mesh. Each is completed and told afterwards. A
!> case alone is a block of one.
module dotyk_driver_case_block
  use dotyk_base_error, only: about_case, about_solver, add_context, error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_base_options, only: response_auto
  use dotyk_base_text, only: to_text
  use dotyk_control_body_solution, only: displacements_t, recover_block
  use dotyk_control_contact_solution, only: begin_contact, complete_contact, contact_solution_t, solution_goal_t, &
    solve_contact
  use dotyk_control_kept_estimates, only: most_of_memory
  use dotyk_control_mesh_error, only: estimate_mesh_errors
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_engines, only: engine_factors, engine_grid_solves, engine_none, engine_rebuilt, first_engine, &
    take_engine, take_next_engine, why_not_taken
  use dotyk_driver_factorization, only: factorize_scene
  use dotyk_driver_load_case, only: begin_case, case_solution_t, leave_case, resume_case, solve_free
  use dotyk_driver_results, only: write_on_the_way
  use dotyk_driver_run_settings, only: goal_of, may_use_multigrid
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: initial_pressures, start_from_pressures
  use dotyk_input_case, only: case_t
  use dotyk_log_case_tables, only: show_case
  use dotyk_log_outcome, only: refuse_unsolvable
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_scene_tables, only: show_factorization
  use dotyk_log_timing, only: stage_factorize, stage_iterate
  use dotyk_model_contact_cases, only: contacts_of_case
  use dotyk_model_ties, only: tightens
  use dotyk_ranks_communication, only: n_local_ranks
  use dotyk_ranks_exchange, only: agree_on_error, greatest
  use dotyk_scheme_monitor, only: phase_estimate, phase_recover
  use dotyk_scheme_scheme, only: reason_none
  use dotyk_scheme_solver_state, only: ended_time, solver_state_t
  implicit none
  private

  type, public :: case_block_t  !! Load cases whose contact is solved.
    integer :: first = 1, last = 0  !! The first and the last one; none where the last is before the first.
    type(case_solution_t), allocatable :: solved(:)  !! first .. last, and places of others that were not begun.
    type(case_t) :: now  !! The case, with the contacts of the load case that acts.
    !> Displacements of cases that are not completed, where the block has several.
    type(displacements_t), allocatable, private :: displacements(:)
    type(solver_state_t), private :: before  !! Where the case before the block ended.
  contains
    procedure :: begin => block_begin
    procedure :: complete => block_complete
  end type case_block_t

  !> Cases together at most: of more, the entries of factors and the meshes are read hardly less often.
  integer, parameter :: most_cases = 10
  !> Memory of a case, its part in the passes of the estimates included [bytes/node, bytes/element, bytes/row].
  real(dp), parameter :: bytes_of_node = 600, bytes_of_element = 350, bytes_of_row = 1000
  !> Fraction of the memory of the factors that cases take together at most, and what they may take in any case [bytes].
  real(dp), parameter :: of_factors = 0.25_dp, always = 64.0e6_dp

contains

  !> Solve the contact of the next cases, as many as may be together. What goes wrong with one is told when that is
  !> completed; those after it are not begun.
  subroutine block_begin(self, restart, input, run, scene, monitor)
    class(case_block_t), intent(inout) :: self
    character(*), intent(in) :: restart  !! Results file of an earlier run to start from; empty where there is none.
    type(case_t), intent(in) :: input  !! The case, with one contact for each pair.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! Built, or factorized.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(solution_goal_t) :: goal
    type(error_t), allocatable :: error
    integer :: j, n, n_displaced
    logical :: is_last
    self%first = self%last + 1
    n = n_together(input, self%first, scene)
    if (allocated(self%solved)) deallocate (self%solved, self%displacements)
    allocate (self%solved(n), self%displacements(n))
    n_displaced = 0
    do j = 1, n
      self%last = self%first + j - 1
      if (j > 1) call monitor%log%hold()
      call solve_one(self, restart, input, run, scene, monitor)
      self%solved(j)%told = ''
      if (j > 1) call monitor%log%take(self%solved(j)%told)
      if (n == 1) return
      associate (solved => self%solved(j), state => self%solved(j)%solution%state)
        is_last = allocated(solved%error) .or. .not. allocated(state%pressure)
        if (.not. is_last) then
          n_displaced = j
          call self%displacements(j)%begin(scene%problem, solved%solution%qp, state%pressure, state%alpha)
          self%displacements(j)%case = self%last
        end if
        call leave_case(scene, solved)
        if (is_last .or. state%was_interrupted()) exit
      end associate
    end do
    if (n_displaced == 0) return
    goal = goal_of(input)
    associate (block => self%displacements(:n_displaced))
      call monitor%begin_phase(phase_recover)
      call recover_block(scene%problem, scene%compliance, goal%stress, block)
      if (goal%mesh_error) then
        call monitor%begin_phase(phase_estimate)
        call estimate_mesh_errors(scene%problem, scene%qp%pair_first_row, scene%kept, block, error)
      end if
      call monitor%end_phase()
    end associate
    call agree_on_error(error)
    if (.not. allocated(error)) return
    ! Estimated again, the case that it belongs to tells it.
    do j = 1, n_displaced
      if (allocated(self%displacements(j)%square)) deallocate (self%displacements(j)%square)
    end do
  end subroutine block_begin

  !> The contact of the last case of the block.
  subroutine solve_one(self, restart, input, run, scene, monitor)
    type(case_block_t), intent(inout) :: self  !! The block; the case gets its solution, or an error.
    character(*), intent(in) :: restart  !! As in `block_begin`.
    type(case_t), intent(in) :: input  !! As in `block_begin`.
    type(scheme_run_t), intent(in) :: run  !! As in `block_begin`.
    type(scene_t), intent(inout) :: scene  !! As in `block_begin`; the load case acts on it on return.
    type(log_monitor_t), intent(inout) :: monitor  !! As in `block_begin`.
    type(error_t), allocatable :: error
    logical, allocatable :: is_changed(:)
    real(dp) :: began
    began = monitor%timing%stage(stage_iterate)%wall
    associate (solved => self%solved(self%last - self%first + 1), k => self%last)
      if (k == 1) self%now = input
      call begin_case(input, k, scene, monitor, error)
      if (.not. allocated(error)) then
        call contacts_of_case(input, k, self%now%contact, is_changed)
        if (input%has_cases()) call show_case(monitor%log, self%now, k, scene%problem, is_changed)
        call initial_pressures(restart, input, k, scene%problem, monitor%log, self%before, solved%start, error)
      end if
      if (.not. allocated(error)) call begin_solution(self%now, run, scene, monitor, solved, error)
      call move_alloc(error, solved%error)
      solved%seconds = monitor%timing%stage(stage_iterate)%wall - began
      self%before = solved%solution%state
    end associate
  end subroutine solve_one

  !> Complete a load case of the block, and tell what the log has of it.
  subroutine block_complete(self, k, input, run, scene, threads, monitor, error)
    class(case_block_t), intent(inout) :: self
    integer, intent(in) :: k  !! The load case.
    type(case_t), intent(in) :: input  !! As in `block_begin`.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! The load case acts on it on return.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(error_t), allocatable, intent(out) :: error  !! As in `complete_solution`, or a case does not act again.
    type(displacements_t) :: nothing
    logical, allocatable :: is_changed(:)
    real(dp) :: began
    associate (solved => self%solved(k - self%first + 1), displacements => self%displacements(k - self%first + 1))
      if (len(solved%told) > 0) call monitor%log%line(solved%told)
      began = monitor%timing%stage(stage_iterate)%wall
      if (.not. allocated(solved%error)) then
        call resume_case(input, k, scene, monitor, solved, error)
        call move_alloc(error, solved%error)
      end if
      call contacts_of_case(input, k, self%now%contact, is_changed)
      if (allocated(displacements%body)) solved%solution%displacements = displacements
      displacements = nothing
      call complete_solution(self%now, run, scene, threads, monitor, solved, error)
      solved%seconds = solved%seconds + monitor%timing%stage(stage_iterate)%wall - began
      self%before = solved%solution%state
    end associate
  end subroutine block_complete

  !> How many cases from one on may be solved together.
  integer function n_together(input, k, scene) result(n)
    type(case_t), intent(in) :: input  !! The case.
    integer, intent(in) :: k  !! The load case that is next.
    type(scene_t), intent(in) :: scene  !! Factorized, unless this is the first case.
    type(solution_goal_t) :: goal
    type(memory_t) :: memory
    real(dp) :: bytes, allowed, less(1)
    integer :: b, i, j
    n = 1
    if (k == 1 .or. .not. scene%is_factorized) return
    if (scene%has_multigrid() .or. scene%is_split()) return
    goal = goal_of(input)
    if (.not. goal%needs_displacements()) return
    ! The same on all ranks.
    bytes = bytes_of_row*scene%qp%n_rows
    do b = 1, size(scene%problem%body)
      associate (mesh => scene%problem%body(b)%mesh)
        bytes = bytes + bytes_of_node*mesh%n_whole_nodes() + bytes_of_element*mesh%n_whole_elements()
      end associate
    end do
    memory = memory_now()
    less = -huge(less)
    if (memory%is_known) less = -most_of_memory*memory%left/n_local_ranks()
    call greatest(less)
    allowed = min(max(always, of_factors*sum(real(scene%size_of%bytes, dp))), -less(1))
    n = max(1, min(input%n_cases() - k + 1, most_cases, int(min(real(most_cases, dp), allowed/bytes))))
    ! Bolts that are tightened leave their shortening to the next case.
    do j = 0, n - 1
      if (.not. any([(tightens(input%tie(i), k + j), i=1, size(input%tie))])) cycle
      n = max(1, j)
      exit
    end do
  end function n_together

  !> Factorize unless that is done, and solve the contact once.
  subroutine begin_solution(case, run, scene, monitor, solved, error)
    type(case_t), intent(in) :: case  !! The case, with the contacts of the load case.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! The scene, built, or factorized with its loads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> The load case, with the engine that is to solve it: the first one where it has none.
    type(case_solution_t), intent(inout) :: solved
    !> Allocated where there is no solution: a body is not held, too little memory, an interrupt.
    type(error_t), allocatable, intent(out) :: error
    type(contact_solution_t) :: nothing
    real(dp) :: before
    if (.not. scene%is_factorized) then
      before = monitor%timing%stage(stage_factorize)%wall
      call factorize_scene(case, run%scheme, scene, monitor, error)
      if (allocated(error)) return
      call show_factorization(monitor%log, scene%problem%body, scene%size_of, &
                              case%solver%response == response_auto .and. may_use_multigrid(case), &
                              monitor%timing%stage(stage_factorize)%wall - before)
    end if
    if (solved%engine == engine_none) solved%engine = first_engine(scene)
    ! The dual scheme takes the solution without contact for exact.
    if (solved%engine == engine_grid_solves .and. scene%is_rough) call solve_free(scene, .false., error)
    if (allocated(error)) return
    solved%run = run
    call take_engine(solved%engine, case, scene, solved%run%scheme)
    if ((case%n_cases() > 1 .or. size(scene%quantity) > 0) .and. solved%engine == engine_factors) &
      call scene%kept%allow(scene%problem%body, scene%problem%ranks%factorizes, scene%size_of%bytes)
    solved%solution = nothing
    if (allocated(solved%start)) &
      call start_from_pressures(solved%start, scene%qp, scene%compliance, solved%solution%state)
    call begin_contact(scene%problem, scene%qp, solved%solution)
    solved%reason = solved%run%scheme%why_not(scene%qp, scene%compliance)
    if (solved%reason /= reason_none) return
    call solve_contact(scene%problem, scene%compliance, solved%run, monitor, solved%solution, error)
    call monitor%end_phase()
  end subroutine begin_solution

  !> Displacements and errors of a load case, and its contact again where its engine asks for it. A scene of
  !> bodies that are split over ranks is to be built anew where it needs their factors.
  subroutine complete_solution(case, run, scene, threads, monitor, solved, error)
    type(case_t), intent(in) :: case  !! As in `begin_solution`.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! The load case acts on it.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    !> The load case, begun. Its reason on return is `reason_none`, or why bodies that are split need factors.
    type(case_solution_t), intent(inout) :: solved
    !> Allocated where there is no solution: what went wrong before, no equilibrium, too little memory, an interrupt.
    type(error_t), allocatable, intent(out) :: error
    logical :: has_warned
    has_warned = .false.
    call move_alloc(solved%error, error)
    associate (solution => solved%solution)
      do while (.not. allocated(error))
        if (solved%reason == reason_none) then
          do
            call complete_contact(scene%problem, scene%compliance, solved%run, goal_of(case), scene%kept, monitor, &
                                  solution, error)
            call monitor%end_phase()
            if (allocated(error) .or. solution%state%ended /= ended_time) exit
            call write_on_the_way(case, scene, solution, threads, monitor, has_warned)
            call solve_contact(scene%problem, scene%compliance, solved%run, monitor, solution, error)
            if (allocated(error)) exit
          end do
          if (.not. allocated(error)) solved%reason = why_not_taken(solution%state)
        end if
        if (allocated(error) .or. solved%reason == reason_none) exit
        call take_next_engine(solved%reason, case, run, scene, monitor, solved%engine, error)
        if (allocated(error) .or. solved%engine == engine_rebuilt) exit
        if (solved%engine == engine_none) then
          solved%reason = reason_none
          exit
        end if
        call begin_solution(case, run, scene, monitor, solved, error)
      end do
      if (allocated(error)) then
        solved%reason = reason_none
        ! Schemes do not know where their settings are.
        if (error%about == about_solver) call add_context(error, case%file//':'//to_text(case%solver%line)//': ')
        if (error%about == about_case) call add_context(error, case%file//': ')
      else if (solved%reason == reason_none) then
        call refuse_unsolvable(case, scene%problem, solution%qp, solution%state, error)
      end if
    end associate
  end subroutine complete_solution
end module dotyk_driver_case_block
