!> The couplings of rows that the preconditioner of active sets knows (`dotyk_scheme_active_system`): all of them, those
!> within pairs, or none, without entries of the compliance.
!>
!> Cost and memory follow from the number of contact rows and the factors of the bodies, before anything is solved.
module dotyk_scheme_linear_solver_choice
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: linear_solver_auto, linear_solver_iterative
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_ranks_communication, only: n_local_ranks
  use dotyk_ranks_exchange, only: on_any_rank
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_constraint_preconditioner, only: coupling_all, coupling_none, coupling_pairs
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  public :: add_costs, choose_coupling, is_heap, entries_fit, room_for_matrices, takes_products, work_of_ties

  !> Solves of each body that conjugate gradients take for all active sets together: 50 to 150 for each active set, 470
  !> to 575 for ties between blocks.
  real(dp), parameter :: typical_solves = 600
  !> Factorizations for all active sets together; ties alone take one.
  real(dp), parameter :: typical_systems = 6
  !> Speed of level 3 BLAS (forward substitution with blocks of right-hand sides, factorization) relative to solves with
  !> a single right-hand side; and with ties, thousands of rows at once.
  real(dp), parameter :: gain_of_blocks = 8, gain_of_ties = 25
  !> Numbers for an entry of C: itself, and half of them in the matrix, its permuted copy and the factor.
  integer, parameter :: numbers_of_entry = 3
  !> Fraction of the available memory that compliances, forward substitutions and the factor may take.
  real(dp), parameter :: most_of_memory = 0.5_dp
  !> A heap has more rigid body modes than this, and fewer rows for each.
  integer, parameter :: many_modes = 60, rows_per_mode = 30

contains

  !> Choose for the rows of a QP; where entries are formed already, they are used.
  subroutine choose_coupling(qp, compliance, wish, rows, system)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator of its bodies.
    integer, intent(in) :: wish  !! One of `linear_solver_*` of dotyk_base_options.
    logical, intent(in) :: rows(:)  !! The rows whose entries will be needed (n_rows).
    type(active_system_t), intent(inout) :: system  !! Not prepared; gets its coupling.
    logical :: matrix_free
    system%preconditioner%coupling = merge(coupling_pairs, coupling_all, is_heap(qp))
    system%may_couple_all = modes_fit(qp, rows)
    matrix_free = wish == linear_solver_iterative
    if (wish == linear_solver_auto .and. .not. compliance%has_entries()) &
      matrix_free = is_matrix_free_cheaper(qp, compliance, rows)
    ! Near-null-space modes are softer than contact by many orders of magnitude, and take entries.
    if (matrix_free .and. .not. allocated(qp%coarse%lift)) system%preconditioner%coupling = coupling_none
  end subroutine choose_coupling

  !> Whether bodies are many with few rows each: they roll and tilt farther than rigid bodies tell,
  !> active sets cycle, and all rows cost little. Ties couple their components, and bodies with each other.
  logical function is_heap(qp)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    is_heap = qp%coarse%n > many_modes .and. count(.not. qp%is_tied) < rows_per_mode*qp%coarse%n
    if (is_heap .and. any(qp%is_tied)) is_heap = .not. modes_fit(qp, spread(.true., 1, qp%n_rows))
  end function is_heap

  !> Whether dense columns of all modes at some rows fit into the memory.
  logical function modes_fit(qp, rows)
    type(contact_qp_t), intent(in) :: qp  !! With the modes.
    logical, intent(in) :: rows(:)  !! As in `choose_coupling` (n_rows).
    type(memory_t) :: memory
    memory = memory_now()
    associate (n_modes => real(qp%coarse%n, dp))
      modes_fit = 8*(n_modes + count(rows))*n_modes < room_for_matrices(memory)
    end associate
  end function modes_fit

  !> Whether products cost less than entries and factorizations, or these take too much memory.
  logical function is_matrix_free_cheaper(qp, compliance, rows) result(cheaper)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator of its bodies.
    logical, intent(in) :: rows(:)  !! As in `choose_coupling` (n_rows).
    type(memory_t) :: memory
    real(dp) :: cost(2), bytes
    call find_costs(qp, compliance, rows, cost, bytes)
    memory = memory_now()
    cheaper = on_any_rank(takes_products(cost, [bytes, 0.0_dp], room_for_matrices(memory)))
  end function is_matrix_free_cheaper

  !> Whether entries and factors fit into the memory.
  logical function entries_fit(qp, compliance, rows)
    type(contact_qp_t), intent(in) :: qp  !! As in `choose_coupling`.
    class(compliance_t), intent(inout) :: compliance  !! As in `choose_coupling`.
    logical, intent(in) :: rows(:)  !! As in `choose_coupling` (n_rows).
    type(memory_t) :: memory
    real(dp) :: cost(2), bytes
    call find_costs(qp, compliance, rows, cost, bytes)
    memory = memory_now()
    entries_fit = .not. on_any_rank(bytes > room_for_matrices(memory))
  end function entries_fit

  !> Costs of all bodies.
  subroutine find_costs(qp, compliance, rows, cost, bytes)
    type(contact_qp_t), intent(in) :: qp  !! As in `choose_coupling`.
    class(compliance_t), intent(inout) :: compliance  !! As in `choose_coupling`.
    logical, intent(in) :: rows(:)  !! As in `choose_coupling` (n_rows).
    real(dp), intent(out) :: cost(:)  !! As in `add_costs` (2).
    real(dp), intent(out) :: bytes  !! As in `add_costs` [B].
    real(dp) :: path, solve
    integer :: b, n
    cost = 0
    bytes = 0
    do b = 1, size(qp%block)
      n = count(rows(qp%block(b)%row))
      if (n == 0) cycle
      call compliance%get_costs(b, path, solve)
      call add_costs(n, path, solve, any(qp%is_tied), all(qp%is_tied), cost, bytes)
    end do
  end subroutine find_costs

  !> Add what a body costs.
  pure subroutine add_costs(n_rows, path, solve, has_ties, has_no_contact, cost, bytes)
    integer, intent(in) :: n_rows  !! Its rows.
    real(dp), intent(in) :: path, solve  !! As in `compliance_t`.
    logical, intent(in) :: has_ties, has_no_contact  !! Whether some rows of the scene are ties, and whether all are.
    !> Of entries, and of products: floating-point operations at the speed of single solves, 4 for each entry of the
    !> factor of the body (2).
    real(dp), intent(inout) :: cost(:)
    real(dp), intent(inout) :: bytes  !! Memory of entries, forward substitution and factors [B].
    real(dp) :: n
    n = n_rows
    ! A path of the elimination tree is about a dense triangle: its unknowns are the root of twice its entries. The
    ! factor of a system has about twice the entries of its matrix.
    cost(1) = cost(1) + (2*path*n + sqrt(2*path)*n**2 + merge(1.0_dp, typical_systems, has_no_contact)*n**3)/ &
                        merge(gain_of_ties, gain_of_blocks, has_ties)
    cost(2) = cost(2) + 4*solve*typical_solves
    bytes = bytes + 8*numbers_of_entry*n**2 + 8*n*sqrt(2*path)
  end subroutine add_costs

  !> Operations that the tied rows of a body take of its factor, at the speed of a factorization.
  elemental real(dp) function work_of_ties(n_rows, path, solve) result(work)
    integer, intent(in) :: n_rows  !! Tied rows of the body.
    real(dp), intent(in) :: path, solve  !! As in `compliance_t`.
    real(dp) :: cost(2), bytes
    cost = 0
    bytes = 0
    if (n_rows > 0) call add_costs(n_rows, path, solve, .true., .true., cost, bytes)
    work = gain_of_ties*minval(cost)
  end function work_of_ties

  !> Whether products are taken: by the cost where both ways fit into the memory, else by the memory.
  pure logical function takes_products(cost, bytes, room) result(takes)
    real(dp), intent(in) :: cost(:)  !! Of entries, and of products (2) [any].
    real(dp), intent(in) :: bytes(:)  !! Memory, likewise (2) [B].
    real(dp), intent(in) :: room  !! Memory that there is [B].
    takes = cost(1) > cost(2)
    if (maxval(bytes) > room) takes = bytes(1) > bytes(2)
  end function takes_products

  !> Bytes for compliances and factors on this machine.
  pure real(dp) function room_for_matrices(memory) result(bytes)
    type(memory_t), intent(in) :: memory  !! Available memory.
    bytes = huge(bytes)
    if (memory%is_known) bytes = most_of_memory*memory%left
    ! Each rank of a node has all of them.
    bytes = bytes/n_local_ranks()
  end function room_for_matrices
end module dotyk_scheme_linear_solver_choice
