!> The choice of a linear solver for active sets: explicit compliances and factorization, or matrix-free conjugate
!> gradients.
!>
!> Cost and memory of both follow from the number of contact rows and the factors of the bodies, before anything is
!> solved.
module dotyk_scheme_choice
  use dotyk_base_kinds, only: dp
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_base_options, only: linear_solver_direct, linear_solver_iterative
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_contact_graph, only: elimination_cost
  use dotyk_scheme_direct_system, only: direct_system_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_iterative_system, only: iterative_system_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  public :: choose_solver, room_for_matrices

  !> Solves of each body that conjugate gradients take for all active sets together: 50 to 150 for each active set.
  real(dp), parameter :: typical_solves = 600
  !> Factorizations for all active sets together.
  real(dp), parameter :: typical_systems = 6
  !> Speed of level 3 BLAS (forward substitution with blocks of right-hand sides, factorization) relative to solves with
  !> a single right-hand side.
  real(dp), parameter :: gain_of_blocks = 8
  !> Bytes for an entry of the factor: 8 in the panel, as many in the update matrices and in copies of compliance
  !> blocks.
  real(dp), parameter :: bytes_of_entry = 24
  !> Bytes that compliances, forward substitutions and the factor may take,
  real(dp), parameter :: most_bytes = 8.0e9_dp
  !> also as a fraction of the available memory.
  real(dp), parameter :: most_of_memory = 0.5_dp

contains

  !> Choose. Explicit compliances that exist already, or their absence, decide.
  subroutine choose_solver(problem, wish, rows, compliance, system)
    !> The contact problem.
    type(contact_problem_t), intent(inout) :: problem
    !> One of `linear_solver_*` of `dotyk_base_options`.
    integer, intent(in) :: wish
    !> The working set: rows whose explicit compliance would be needed (n_rows).
    logical, intent(in) :: rows(:)
    !> Initialized where it is empty.
    type(explicit_compliance_t), intent(inout) :: compliance
    !> The solver, not initialized.
    class(active_system_t), allocatable, intent(out) :: system
    type(direct_system_t), allocatable :: direct
    type(iterative_system_t), allocatable :: iterative
    type(memory_t) :: memory
    real(dp) :: direct_cost, iterative_cost, bytes, n, path
    logical :: by_sweeps
    integer :: b
    ! In floating-point operations at the speed of single solves: 4 for each entry of the factor of a body.
    call elimination_cost(problem%operator, problem%coarse, rows, direct_cost, bytes)
    direct_cost = typical_systems*direct_cost/gain_of_blocks
    iterative_cost = 0
    bytes = bytes_of_entry*bytes
    do b = 1, size(problem%operator%block)
      n = count(rows(problem%operator%block(b)%row))
      if (.not. n > 0) cycle
      path = problem%response(b)%form%path_entries()
      ! A path of the elimination tree is about a dense triangle: its unknowns are the root of twice its entries.
      direct_cost = direct_cost + (2*path*n + sqrt(2*path)*n**2)/gain_of_blocks
      iterative_cost = iterative_cost + 4*problem%cost(b)*typical_solves
      bytes = bytes + 8*n**2 + 8*n*sqrt(2*path)
    end do
    memory = memory_now()
    by_sweeps = direct_cost > iterative_cost .or. bytes > room_for_matrices(memory)
    if (wish == linear_solver_direct) by_sweeps = .false.
    if (wish == linear_solver_iterative) by_sweeps = .true.
    ! The projection of conjugate gradients treats exact rigid body modes, not near-null-space modes, whose stiffness is
    ! softer than contact by many powers of ten.
    if (allocated(problem%coarse%stiffness)) by_sweeps = .false.
    if (allocated(compliance%body)) then
      by_sweeps = compliance%by_sweeps
    else
      call compliance%init(size(problem%operator%block), by_sweeps)
    end if
    if (by_sweeps) then
      allocate (iterative)
      call move_alloc(iterative, system)
    else
      allocate (direct)
      call move_alloc(direct, system)
    end if
  end subroutine choose_solver

  !> Bytes for explicit compliances and factors on this machine.
  pure real(dp) function room_for_matrices(memory) result(bytes)
    !> Available memory.
    type(memory_t), intent(in) :: memory
    bytes = most_bytes
    if (memory%is_known) bytes = min(bytes, most_of_memory*memory%left)
  end function room_for_matrices
end module dotyk_scheme_choice
