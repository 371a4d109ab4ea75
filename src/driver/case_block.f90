!> Blocks of load cases: the contact of each is solved, then their displacements take one solve of each body with as
!> many right-hand sides, and their error estimates one pass over each mesh. Each is told and written afterwards.
module dotyk_driver_case_block
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_base_timer, only: wall_time
  use dotyk_control_body_solution, only: displacements_t, recover_block
  use dotyk_control_contact_solution, only: first_tolerance, solution_goal_t
  use dotyk_control_kept_estimates, only: most_of_memory
  use dotyk_control_mesh_error, only: estimate_mesh_errors
  use dotyk_control_scheme_run, only: scheme_run_t
  use dotyk_driver_load_case, only: next_case, solved_case_t
  use dotyk_driver_run_settings, only: goal_of
  use dotyk_driver_scene, only: scene_t
  use dotyk_driver_warm_start, only: initial_pressures, start_from_pressures
  use dotyk_input_case, only: case_t
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_ranks_communication, only: n_local_ranks
  use dotyk_ranks_exchange, only: agree_on_error, greatest
  use dotyk_scheme_monitor, only: phase_estimate, phase_iterate, phase_recover
  use dotyk_scheme_solver_state, only: ended_converged, ended_interrupted, ended_stalled, solver_state_t
  implicit none
  private

  type, public :: case_block_t  !! Load cases that are solved and not told yet.
    integer :: first = 1, last = 0  !! The first and the last one; none where the last is before the first.
    integer, private :: last_alone = 1  !! Cases up to this one are solved alone.
    type(solved_case_t), allocatable, private :: case(:)  !! first .. last.
    type(displacements_t), allocatable, private :: displacements(:)  !! Of the same cases.
  contains
    procedure :: solve => block_solve
    procedure :: take => block_take
  end type case_block_t

  !> Cases together at most: of more, the entries of factors and the meshes are read hardly less often.
  integer, parameter :: most_cases = 10
  !> Memory of a case, its part in the passes of the estimates included [bytes/node, bytes/element].
  real(dp), parameter :: bytes_of_node = 600, bytes_of_element = 350
  !> Fraction of the memory of the factors that cases take together at most, and what they may take in any case [bytes].
  real(dp), parameter :: of_factors = 0.25_dp, always = 64.0e6_dp

contains

  !> Solve the cases from one on, as many as may be together; none where that is one case.
  subroutine block_solve(self, input, k, run, scene, monitor, last)
    class(case_block_t), intent(inout) :: self
    type(case_t), intent(in) :: input  !! The case, with one contact for each pair.
    integer, intent(in) :: k  !! The load case that is next.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! Factorized; the load case is to begin anew on return.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(solver_state_t), intent(in) :: last  !! State of the case before the first one.
    type(solution_goal_t) :: goal
    type(solver_state_t) :: before
    type(error_t), allocatable :: error
    integer :: j, n
    logical :: is_interrupted
    self%first = k
    self%last = k - 1
    if (k <= self%last_alone) return
    n = n_together(input, k, scene)
    if (n < 2) return
    goal = goal_of(input)
    if (allocated(self%case)) deallocate (self%case, self%displacements)
    allocate (self%case(n), self%displacements(n))
    is_interrupted = .false.
    before = last
    do j = 1, n
      call solve_one(input, k + j - 1, goal, run, scene, monitor, before, self%case(j), self%displacements(j))
      if (.not. allocated(self%displacements(j)%body)) exit
      before = self%case(j)%state
      is_interrupted = before%was_interrupted()
      if (is_interrupted) exit
    end do
    ! The one after them is solved alone, and tells what is wrong with it.
    if (j <= n .and. .not. is_interrupted) self%last_alone = k + j - 1
    n = min(n, merge(j, j - 1, is_interrupted))
    if (n < 2 .and. .not. is_interrupted) return
    call monitor%begin_phase(phase_recover)
    call recover_block(scene%problem, scene%compliance, goal%stress, self%displacements(:n))
    if (goal%needs_mesh_error()) then
      call monitor%begin_phase(phase_estimate)
      call estimate_mesh_errors(scene%problem, scene%qp%pair_first_row, scene%kept, self%displacements(:n), error)
    end if
    call monitor%end_phase()
    call agree_on_error(error)
    if (.not. allocated(error)) self%last = k + n - 1
  end subroutine block_solve

  !> Take a load case out of the block; not allocated where it is none of them.
  subroutine block_take(self, k, solved)
    class(case_block_t), intent(inout) :: self
    integer, intent(in) :: k  !! The load case.
    type(solved_case_t), allocatable, intent(out) :: solved  !! The same.
    type(solved_case_t) :: nothing
    if (k < self%first .or. k > self%last) return
    associate (j => k - self%first + 1)
      solved = self%case(j)
      solved%displacements = self%displacements(j)
      self%case(j) = nothing
      self%displacements(j) = nothing%displacements
    end associate
  end subroutine block_take

  !> How many cases from one on may be solved together.
  integer function n_together(input, k, scene) result(n)
    type(case_t), intent(in) :: input  !! The case.
    integer, intent(in) :: k  !! The load case that is next.
    type(scene_t), intent(in) :: scene  !! Factorized, unless this is the first case.
    type(solution_goal_t) :: goal
    type(memory_t) :: memory
    real(dp) :: bytes, rest, allowed, less(1)
    integer :: b
    n = 1
    if (k == 1 .or. .not. scene%is_factorized) return
    if (scene%has_multigrid() .or. scene%is_split()) return
    goal = goal_of(input)
    if (.not. goal%needs_displacements()) return
    ! The same on all ranks.
    bytes = 0
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
    rest = input%n_cases() - k + 1
    n = int(min(rest, real(most_cases, dp), allowed/bytes))
  end function n_together

  !> The contact of one case; without displacements on return where it is to be solved alone.
  subroutine solve_one(input, k, goal, run, scene, monitor, before, solved, displacements)
    type(case_t), intent(in) :: input  !! The case.
    integer, intent(in) :: k  !! The load case.
    type(solution_goal_t), intent(in) :: goal  !! What is asked of the solution.
    type(scheme_run_t), intent(in) :: run  !! Scheme and its settings.
    type(scene_t), intent(inout) :: scene  !! Factorized; the load case acts on it on return.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch; times are added.
    type(solver_state_t), intent(in) :: before  !! State of the case before.
    type(solved_case_t), intent(out) :: solved  !! Gets state, time and what is to be told.
    type(displacements_t), intent(inout) :: displacements  !! Begun.
    type(scheme_run_t) :: now
    type(error_t), allocatable :: error
    real(dp), allocatable :: pressure(:)
    real(dp) :: began
    began = wall_time()
    call next_case(input, k, scene, monitor, error, solved)
    if (allocated(error)) return
    if (scene%problem%n_ties() > 0) then
      ! Bolts that are tightened leave their shortening to the next case.
      if (any(scene%problem%tie%slides)) return
    end if
    call initial_pressures('', input, k, scene%problem, monitor%log, before, pressure, error)
    if (allocated(error)) return
    now = run
    now%settings%tolerance = first_tolerance(goal, run%settings%tolerance)
    if (allocated(pressure)) call start_from_pressures(pressure, scene%qp, scene%compliance, solved%state)
    call monitor%hold_notes()
    call monitor%begin_phase(phase_iterate)
    call now%solve(scene%qp, scene%compliance, scene%problem%n_blas, monitor, solved%state, error)
    call monitor%end_phase()
    call monitor%take_notes(solved%note)
    solved%n_sweeps = scene%compliance%n_sweeps
    solved%seconds = wall_time() - began
    if (allocated(error) .or. .not. allocated(solved%state%m)) return
    if (all(solved%state%ended /= [ended_converged, ended_stalled, ended_interrupted])) return
    call displacements%begin(scene%problem, scene%qp, solved%state%m, solved%state%alpha)
    displacements%case = k
  end subroutine solve_one
end module dotyk_driver_case_block
