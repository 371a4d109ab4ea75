!> The choice of a linear solver for active sets: entries of the compliance and factorization, entries and conjugate
!> gradients on the network of many bodies, or matrix-free conjugate gradients.
!>
!> Cost and memory of both follow from the number of contact rows and the factors of the bodies, before anything is
!> solved.
module dotyk_scheme_linear_solver_choice
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: linear_solver_auto, linear_solver_iterative
  use dotyk_base_memory, only: memory_now, memory_t
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_contact_graph, only: elimination_cost
  use dotyk_scheme_direct_system, only: direct_system_t
  use dotyk_ranks_communication, only: n_local_ranks
  use dotyk_ranks_exchange, only: on_any_rank
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_iterative_system, only: iterative_system_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_network_system, only: network_system_t
  use dotyk_scheme_pair_blocks, only: network_cost
  implicit none
  private

  public :: choose_solver, room_for_matrices, takes_products, is_network, take_factors

  !> Solves of each body that conjugate gradients take for all active sets together: 50 to 150 for each active set.
  real(dp), parameter :: typical_solves = 600
  !> Factorizations for all active sets together.
  real(dp), parameter :: typical_systems = 6
  !> Speed of level 3 BLAS (forward substitution with blocks of right-hand sides, factorization) relative to solves with
  !> a single right-hand side.
  real(dp), parameter :: gain_of_blocks = 8
  !> Solutions of one system of the interior-point method, which many bodies take, and conjugate gradients in each of
  !> them on the network of bodies.
  real(dp), parameter :: typical_solutions = 5, typical_iterations = 3
  !> Fewer rigid body modes than these are never a network; and it must be cheaper by this factor: small scenes keep
  !> their factors.
  integer, parameter :: least_modes = 300
  real(dp), parameter :: worthwhile = 0.5_dp
  !> Operations of the eigenvectors of a dense matrix of order n, over n^3.
  real(dp), parameter :: flops_of_eigenvectors = 10
  !> Bytes for an entry of the factor: 8 in the panel, as many in the update matrices and in copies of compliance
  !> blocks.
  real(dp), parameter :: bytes_of_entry = 24
  !> Bytes that compliances, forward substitutions and the factor may take,
  real(dp), parameter :: most_bytes = 8.0e9_dp
  !> also as a fraction of the available memory.
  real(dp), parameter :: most_of_memory = 0.5_dp

contains

  !> Choose for the rows of a QP; where entries are formed already, they are used.
  subroutine choose_solver(qp, compliance, wish, rows, system)
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator of its bodies.
    class(compliance_t), intent(inout) :: compliance
    !> One of `linear_solver_*` of dotyk_base_options.
    integer, intent(in) :: wish
    !> The rows whose entries will be needed (n_rows).
    logical, intent(in) :: rows(:)
    !> To be made for each active set.
    class(active_system_t), allocatable, intent(out) :: system
    type(direct_system_t), allocatable :: direct
    type(network_system_t), allocatable :: network
    type(iterative_system_t), allocatable :: iterative
    real(dp) :: flops, entries
    logical :: matrix_free, many_bodies
    many_bodies = .false.
    if (wish == linear_solver_auto) call compare_factors(qp, rows, many_bodies, flops, entries)
    matrix_free = wish == linear_solver_iterative
    if (wish == linear_solver_auto .and. .not. compliance%has_entries()) &
      matrix_free = is_matrix_free_cheaper(qp, compliance, rows, flops, entries)
    ! Conjugate gradients project on the equilibrium of floating bodies; near-null-space modes are softer than contact
    ! by many orders of magnitude, and take a factorization.
    if (allocated(qp%coarse%stiffness)) matrix_free = .false.
    if (matrix_free) then
      allocate (iterative)
      call move_alloc(iterative, system)
    else if (many_bodies) then
      allocate (network)
      call move_alloc(network, system)
    else
      allocate (direct)
      call move_alloc(direct, system)
    end if
  end subroutine choose_solver

  !> Whether products cost less than entries and factorizations, or these take too much memory, and more than what the
  !> projections of many modes do.
  logical function is_matrix_free_cheaper(qp, compliance, rows, flops, entries) result(cheaper)
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator of its bodies.
    class(compliance_t), intent(inout) :: compliance
    !> As in `choose_solver` (n_rows).
    logical, intent(in) :: rows(:)
    !> Floating-point operations of a system by entries [].
    real(dp), intent(in) :: flops
    !> Entries of its factor [].
    real(dp), intent(in) :: entries
    type(memory_t) :: memory
    real(dp) :: direct_cost, iterative_cost, bytes, iterative_bytes, room, n, path, solve
    integer :: b
    ! In floating-point operations at the speed of single solves: 4 for each entry of the factor of a body.
    direct_cost = typical_systems*flops/gain_of_blocks
    ! G of all active rows, its Gram matrix with eigenvectors and pseudo-inverse.
    associate (n_rows => real(count(rows), dp), n_modes => real(qp%coarse%n, dp))
      iterative_cost = typical_systems*(2*n_rows*n_modes**2 + flops_of_eigenvectors*n_modes**3)/gain_of_blocks
      iterative_bytes = 8*(2*n_rows*n_modes + 5*n_modes**2)
    end associate
    bytes = bytes_of_entry*entries
    do b = 1, size(qp%block)
      n = count(rows(qp%block(b)%row))
      if (.not. n > 0) cycle
      call compliance%get_costs(b, path, solve)
      ! A path of the elimination tree is about a dense triangle: its unknowns are the root of twice its entries.
      direct_cost = direct_cost + (2*path*n + sqrt(2*path)*n**2)/gain_of_blocks
      iterative_cost = iterative_cost + 4*solve*typical_solves
      bytes = bytes + 8*n**2 + 8*n*sqrt(2*path)
    end do
    memory = memory_now()
    room = room_for_matrices(memory)
    cheaper = on_any_rank(takes_products([direct_cost, iterative_cost], [bytes, iterative_bytes], room))
  end function is_matrix_free_cheaper

  !> Whether products are taken: by the cost where both ways fit into the memory, else by the memory.
  pure logical function takes_products(cost, bytes, room) result(takes)
    !> Of entries, and of products (2) [any].
    real(dp), intent(in) :: cost(:)
    !> Memory, likewise (2) [B].
    real(dp), intent(in) :: bytes(:)
    !> Memory that there is [B].
    real(dp), intent(in) :: room
    takes = cost(1) > cost(2)
    if (maxval(bytes) > room) takes = bytes(1) > bytes(2)
  end function takes_products

  !> Whether many bodies make conjugate gradients with a factor of their network cheaper than a factor of everything,
  !> and what the cheaper one costs.
  subroutine compare_factors(qp, rows, is_network, flops, entries)
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> As in `choose_solver` (n_rows).
    logical, intent(in) :: rows(:)
    !> The network is cheaper.
    logical, intent(out) :: is_network
    !> Floating-point operations of one system [].
    real(dp), intent(out) :: flops
    !> Entries of the factor [].
    real(dp), intent(out) :: entries
    real(dp) :: direct_cost, network_flops, network_entries, products, cost
    integer :: b
    is_network = .false.
    call elimination_cost(qp, rows, flops, entries)
    if (allocated(qp%coarse%stiffness) .or. qp%coarse%n < least_modes) return
    direct_cost = flops/gain_of_blocks + typical_solutions*4*entries
    call network_cost(qp, rows, network_flops, network_entries)
    products = 0
    do b = 1, size(qp%block)
      products = products + 2*real(count(rows(qp%block(b)%row)), dp)**2
    end do
    cost = network_flops/gain_of_blocks + typical_solutions*typical_iterations*(4*network_entries + products)
    is_network = cost < worthwhile*direct_cost
    if (.not. is_network) return
    flops = gain_of_blocks*cost
    entries = network_entries
  end subroutine compare_factors

  !> Bytes for compliances and factors on this machine.
  pure real(dp) function room_for_matrices(memory) result(bytes)
    !> Available memory.
    type(memory_t), intent(in) :: memory
    bytes = most_bytes
    if (memory%is_known) bytes = min(bytes, most_of_memory*memory%left)
    ! Each rank of a node has all of them.
    bytes = bytes/n_local_ranks()
  end function room_for_matrices

  !> Whether the systems are those of the network of many bodies.
  logical function is_network(system)
    !> What was chosen.
    class(active_system_t), intent(in) :: system
    is_network = .false.
    select type (system)
    type is (network_system_t)
      is_network = .true.
    end select
  end function is_network

  !> Take the factor of the whole system instead.
  subroutine take_factors(system)
    !> What was chosen; the other one on return.
    class(active_system_t), allocatable, intent(inout) :: system
    type(direct_system_t), allocatable :: direct
    call system%destroy()
    deallocate (system)
    allocate (direct)
    call move_alloc(direct, system)
  end subroutine take_factors
end module dotyk_scheme_linear_solver_choice
