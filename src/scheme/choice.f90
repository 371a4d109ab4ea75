!> How the systems of the active sets are solved: with the compliance as a matrix and factorizations, or by conjugate
!> gradients.
!>
!> Cost and memory of both are known beforehand, from the number of closed points and the factors of the bodies.
module dotyk_scheme_choice
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: linear_solver_direct, linear_solver_iterative
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_contact_graph, only: elimination_cost
  use dotyk_scheme_direct_system, only: direct_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_iterative_system, only: iterative_system_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
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

  !> Choose for the rows of a QP; where entries are formed already, they are used.
  subroutine choose_solver(qp, compliance, wish, rows, system)
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> Of its bodies.
    class(compliance_t), intent(inout) :: compliance
    !> One of `linear_solver_*` of dotyk_base_options.
    integer, intent(in) :: wish
    !> The rows whose entries will be needed (n_rows).
    logical, intent(in) :: rows(:)
    !> To be made for each active set.
    class(active_system_t), allocatable, intent(out) :: system
    type(direct_system_t), allocatable :: direct
    type(iterative_system_t), allocatable :: iterative
    logical :: matrix_free
    matrix_free = wish == linear_solver_iterative
    if (wish /= linear_solver_direct .and. .not. matrix_free .and. .not. compliance%has_entries()) &
      matrix_free = is_matrix_free_cheaper(qp, compliance, rows)
    ! Conjugate gradients project on the equilibrium of floating bodies; near-null-space modes are softer than contact
    ! by many orders of magnitude, and take a factorization.
    if (allocated(qp%coarse%stiffness)) matrix_free = .false.
    if (matrix_free) then
      allocate (iterative)
      call move_alloc(iterative, system)
    else
      allocate (direct)
      call move_alloc(direct, system)
    end if
  end subroutine choose_solver

  !> Whether products cost less than entries and factorizations, or these take too much memory.
  logical function is_matrix_free_cheaper(qp, compliance, rows) result(cheaper)
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> Of its bodies.
    class(compliance_t), intent(inout) :: compliance
    !> As in `choose_solver` (n_rows).
    logical, intent(in) :: rows(:)
    type(memory_t) :: memory
    real(dp) :: direct_cost, iterative_cost, bytes, n, path, solve
    integer :: b
    ! In floating-point operations at the speed of single solves: 4 for each entry of a factor.
    call elimination_cost(qp, rows, direct_cost, bytes)
    direct_cost = typical_systems*direct_cost/gain_of_blocks
    iterative_cost = 0
    bytes = 24*bytes
    do b = 1, size(qp%block)
      n = count(rows(qp%block(b)%row))
      if (.not. n > 0) cycle
      call compliance%get_costs(b, path, solve)
      ! The unknowns of a path are about the root of its entries.
      direct_cost = direct_cost + (2*path*n + sqrt(2*path)*n**2)/gain_of_blocks
      iterative_cost = iterative_cost + 4*solve*typical_solves
      bytes = bytes + 8*n**2 + 8*n*sqrt(2*path)
    end do
    memory = memory_now()
    cheaper = direct_cost > iterative_cost .or. bytes > room_for_matrices(memory)
  end function is_matrix_free_cheaper

  !> Bytes that matrices may take here.
  pure real(dp) function room_for_matrices(memory) result(bytes)
    !> What there is.
    type(memory_t), intent(in) :: memory
    bytes = most_bytes
    if (memory%is_known) bytes = min(bytes, most_of_memory*memory%left)
  end function room_for_matrices
end module dotyk_scheme_choice
