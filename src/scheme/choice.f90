!> How the systems of the active sets are solved: with the compliance as a matrix and factorizations, or by conjugate
!> gradients.
!>
!> Cost and memory of both are known beforehand, from the number of closed points and the factors of the bodies.
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

  !> Solves of each body that conjugate gradients take for all active sets together, about: 50 to 150 for each.
  real(dp), parameter :: typical_solves = 600
  !> Factorizations of active systems, about.
  real(dp), parameter :: typical_systems = 6
  !> How much faster the operations of forward substitutions, their products and dense factorizations are than those of
  !> single solves.
  real(dp), parameter :: gain_of_blocks = 8
  !> Bytes that matrices, solutions of L y = P b and active systems may take, and that as a part of the memory that is
  !> left.
  real(dp), parameter :: most_bytes = 8.0e9_dp, most_of_memory = 0.5_dp

contains

  !> Choose for the rows of a problem, all of which get into the matrices; where there are some already, the choice is
  !> that of before.
  subroutine choose_solver(problem, wish, rows, compliance, system)
    type(contact_problem_t), intent(inout) :: problem
    !> One of `solver_*`.
    integer, intent(in) :: wish
    !> The rows that will be needed (n_rows).
    logical, intent(in) :: rows(:)
    type(explicit_compliance_t), intent(inout) :: compliance
    class(active_system_t), allocatable, intent(out) :: system
    type(direct_system_t), allocatable :: direct
    type(iterative_system_t), allocatable :: iterative
    type(memory_t) :: memory
    real(dp) :: direct_cost, iterative_cost, bytes, n, path
    logical :: by_sweeps
    integer :: b
    ! In floating-point operations at the speed of single solves: 4 for each entry of a factor.
    call elimination_cost(problem, rows, direct_cost, bytes)
    direct_cost = typical_systems*direct_cost/gain_of_blocks
    iterative_cost = 0
    bytes = 24*bytes
    do b = 1, size(problem%operator%block)
      n = count(rows(problem%operator%block(b)%row))
      if (.not. n > 0) cycle
      path = problem%response(b)%form%path_entries()
      ! The unknowns of a path are about the root of its entries.
      direct_cost = direct_cost + (2*path*n + sqrt(2*path)*n**2)/gain_of_blocks
      iterative_cost = iterative_cost + 4*problem%cost(b)*typical_solves
      bytes = bytes + 8*n**2 + 8*n*sqrt(2*path)
    end do
    memory = memory_now()
    by_sweeps = direct_cost > iterative_cost .or. bytes > room_for_matrices(memory)
    if (wish == linear_solver_direct) by_sweeps = .false.
    if (wish == linear_solver_iterative) by_sweeps = .true.
    ! Conjugate gradients keep to the equilibrium of free bodies, not to springs that are softer than contact by many
    ! powers of ten.
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

  !> Bytes that matrices may take here.
  pure real(dp) function room_for_matrices(memory) result(bytes)
    !> What there is.
    type(memory_t), intent(in) :: memory
    bytes = most_bytes
    if (memory%is_known) bytes = min(bytes, most_of_memory*memory%left)
  end function room_for_matrices
end module dotyk_scheme_choice
