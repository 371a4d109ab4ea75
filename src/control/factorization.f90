!> From assembled bodies to factors: order, analyse, factorize.
!>
!> Costs of products with a compliance are compared before anything is factorized, so they are floating-point operations
!> at the speed of a factorization, and the speeds of everything else are fixed fractions of it: the choice must be the
!> same from run to run.
!>
!> Memory of a run is predicted when all is assembled and analysed. Rows of ties are all active, and their matrices
!> count where the run will have them; how many contact rows will be is not known.
module dotyk_control_factorization
  use dotyk_base_error, only: error_slot_t, error_t, problem_list_t, exit_machine, set_error
  use dotyk_base_interrupt, only: interrupted, stop_if_interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_memory, only: memory_t, memory_text, set_item
  use dotyk_base_options, only: linear_solver_auto, linear_solver_iterative, response_auto, response_compliance
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_progress, only: add_progress, expect_progress
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_control_body_ranks, only: body_ranks_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_parallel, only: largest_first, n_dominating, set_blas_threads
  use dotyk_control_response_choice, only: form_direct, form_multigrid, form_whole, operator_slot_t
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_ranks_communication, only: n_local_ranks, n_ranks
  use dotyk_ranks_exchange, only: by_owner, is_own, share, share_errors, share_parcel
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_linear_solver_choice, only: add_costs, takes_products
  implicit none
  private
  public :: analyze_bodies, check_memory, factorize_bodies, predicted_memory

  type :: workload_t  !! Products to come.
    !> Contact rows of all bodies of the congruence class, and number of these bodies.
    integer :: n_rows = 0, n_bodies = 1
    !> Products one by one, one in each step of an iterative scheme; 0: the scheme forms the matrix.
    integer :: n_steps = 0
  end type workload_t

  !> Speed of a factorization over that of single triangular solves, and of forward substitutions of blocks of rows.
  real(dp), parameter :: slowness_of_solves = 10, slowness_of_substitution = 1.3_dp
  real(dp), parameter :: most_bytes = 1.0e9_dp  !! Bytes that a matrix may take which the user did not ask for.

  !> What is known of a factor before it is made. It is that of the representative of a class; other bodies have
  !> `forms_matrix`, the entries of products and of the class, `is_slow` and `steps` only.
  type, public :: factor_size_t
    integer(int64) :: entries = 0  !! Entries that are stored.
    integer(int64) :: bytes = 0  !! Their memory [bytes].
    integer(int64) :: stiffness_bytes = 0  !! Memory of the stiffness [bytes].
    real(dp) :: flops = 0  !! Floating-point operations of the factorization.
    logical :: forms_matrix = .false.  !! Whether the entries of the compliance are formed before the iteration.
    integer(int64) :: product_entries = 0  !! Entries that a product goes through.
    integer(int64) :: class_entries = 0  !! Entries of the factor of the class, or of the levels in its place.
    real(dp) :: path_entries = 0  !! Entries of the factor on the elimination-tree path of a contact row, on average.
    integer :: form = form_direct  !! How the body is solved: one of `form_*` of dotyk_control_response_choice.
    !> Whether p-multigrid takes too many iterations for this body, or a factor costs less: it is replaced, or the
    !> memory does not suffice for that.
    logical :: is_slow = .false.
    real(dp) :: steps = 0  !! Iterations of a solve that p-multigrid would take, about.
    !> Operations of the factor of the body in place of p-multigrid, once its analysis has told them; 0 before.
    real(dp) :: whole_flops = 0
  contains
    procedure :: take => size_take
    procedure :: carry => size_carry
  end type factor_size_t

  !> Memory beside a factor while it is made, as a fraction of it [].
  real(dp), parameter :: beside_factor = 0.15_dp
  !> Memory that a solve by smoothed aggregation reads, as a multiple of the matrix of the corner space; factors are
  !> read twice. The levels below the matrix, their factor and the interpolation take as much memory as it does.
  integer, parameter :: aggregated_products = 5
  !> Vectors, low-precision copies and estimates of a body with p-multigrid beside its block rows, and of a body that is
  !> solved by its factor [byte/unknown].
  real(dp), parameter :: beside_rows = 200, beside_direct = 100

contains

  !> The size of a factor.
  subroutine size_take(self, factor)
    class(factor_size_t), intent(inout) :: self
    type(cholesky_t), intent(in) :: factor  !! Analysed.
    self%entries = factor%factor_entries
    self%bytes = factor%factor_bytes
    self%flops = factor%flops
  end subroutine size_take

  !> Order and analyse the representatives, side by side.
  subroutine analyze_bodies(body, modes, stiffness, classes, ranks, block, response, n_products, slot, size_of, error)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(body_modes_t), intent(in) :: modes(:)  !! Rigid body modes that supports leave (n_bodies).
    !> Stiffnesses of the representatives; without the graphs of their nodes on return (n_bodies).
    type(stiffness_t), intent(inout) :: stiffness(:)
    type(congruence_classes_t), intent(in) :: classes  !! Classes of congruent bodies.
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(contact_block_t), intent(in) :: block(:)  !! Rows of B (n_bodies).
    integer, intent(in) :: response  !! One of `response_*` of dotyk_base_options.
    !> Products with the compliance that the scheme takes one by one, about; 0: it forms entries.
    integer, intent(in) :: n_products
    type(operator_slot_t), intent(inout) :: slot(:)  !! Assembled; analysed on return (n_bodies).
    type(factor_size_t), allocatable, intent(out) :: size_of(:)  !! Sizes of the factors to come (n_bodies).
    !> Allocated where an analysis fails (`analyze` of `direct_response_t`) or an interrupt came; names the bodies.
    type(error_t), allocatable, intent(out) :: error
    type(error_slot_t), allocatable :: failed(:)
    integer, allocatable :: node(:)
    type(workload_t) :: work
    integer :: i, b, order(size(body))
    allocate (size_of(size(body)), failed(size(body)))
    order = largest_first(real(body%n_unknowns(), dp))
    call expect_progress(sum(real(body%n_unknowns(), dp), mask=ranks%factorizes))
    !$omp parallel do default(none) schedule(dynamic, 1) private(b, node, work) &
    !$omp& shared(body, modes, stiffness, classes, ranks, block, response, n_products, slot, size_of, failed, order)
    do i = 1, size(body)
      b = order(i)
      if (interrupted()) cycle
      if (.not. ranks%factorizes(b)) cycle
      call classes%contact_nodes(b, block, node, work%n_rows)
      work%n_bodies = count(classes%first == b)
      work%n_steps = n_products
      call analyze_body(body(b), modes(b), stiffness(b), node, work, response, slot(b), size_of(b), failed(b)%error)
      call add_progress(real(body(b)%n_unknowns(), dp))
    end do
    !$omp end parallel do
    call stop_if_interrupted(error)
    if (.not. allocated(error)) call collect(body, ranks, failed, error)
    if (allocated(error)) return
    call share_sizes(ranks, size_of)
    do b = 1, size(body)
      if (classes%is_representative(b)) cycle
      associate (first => size_of(classes%first(b)))
        size_of(b)%forms_matrix = first%forms_matrix
        size_of(b)%product_entries = first%product_entries
        size_of(b)%class_entries = first%class_entries
        size_of(b)%path_entries = first%path_entries
      end associate
    end do
  end subroutine analyze_bodies

  !> Make the sizes of all factors known to all ranks.
  subroutine share_sizes(ranks, size_of)
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(factor_size_t), intent(inout) :: size_of(:)  !! Those of this rank in, of all out (n_bodies).
    type(parcel_t) :: parcel
    integer, allocatable :: order(:)
    integer :: b, k
    if (n_ranks() == 1) return
    do b = 1, size(size_of)
      if (is_own(ranks%owner(b))) call size_of(b)%carry(parcel)
    end do
    call share_parcel(ranks%owner, parcel)
    if (parcel%at_end()) return
    order = by_owner(ranks%owner)
    do k = 1, size(order)
      call size_of(order(k))%carry(parcel)
    end do
  end subroutine share_sizes

  !> Put it into a parcel, or take it out.
  subroutine size_carry(self, parcel)
    class(factor_size_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%entries)
    call parcel%carry(self%bytes)
    call parcel%carry(self%stiffness_bytes)
    call parcel%carry(self%flops)
    call parcel%carry(self%forms_matrix)
    call parcel%carry(self%product_entries)
    call parcel%carry(self%class_entries)
    call parcel%carry(self%path_entries)
    call parcel%carry(self%form)
    call parcel%carry(self%is_slow)
    call parcel%carry(self%steps)
    call parcel%carry(self%whole_flops)
  end subroutine size_carry

  !> Order and analyse a representative, and choose how products with its compliance are made.
  subroutine analyze_body(body, modes, stiffness, contact_node, work, response, slot, size_of, error)
    type(body_t), intent(in) :: body  !! The representative, assembled.
    type(body_modes_t), intent(in) :: modes  !! Its rigid body modes.
    type(stiffness_t), intent(inout) :: stiffness  !! Its stiffness; without the graph of the nodes on return.
    integer, intent(in) :: contact_node(:)  !! Nodes where any body of the class may touch another (n).
    type(workload_t), intent(in) :: work  !! Products to come.
    integer, intent(in) :: response  !! One of `response_*` of dotyk_base_options.
    type(operator_slot_t), intent(inout) :: slot  !! Its operator; analysed on return.
    type(factor_size_t), intent(out) :: size_of  !! Size of the factor to come.
    type(error_t), allocatable, intent(out) :: error  !! As in `analyze_bodies`.
    call set_item("body '"//body%name//"'")
    if (.not. allocated(slot%multigrid)) then
      if (.not. allocated(slot%direct)) allocate (slot%direct)
      call slot%direct%analyze(body, modes, stiffness, error)
      if (allocated(error)) return
      call size_of%take(slot%direct%factor)
      associate (equation => body%constraint%equation(:, contact_node))
        if (any(equation > 0)) size_of%path_entries = slot%direct%path_entries(pack(equation, equation > 0))
        if (work%n_steps > 0 .and. any(equation > 0)) then
          size_of%forms_matrix = response == response_compliance
          if (response == response_auto) size_of%forms_matrix = matrix_is_cheaper(work, real(size_of%entries, dp), &
                                                                                  size_of%path_entries)
        end if
      end associate
    else if (.not. associated(slot%multigrid%grid)) then
      size_of%form = form_whole
      call slot%multigrid%analyze_whole(body, modes, stiffness, error)
      if (allocated(error)) return
      call size_of%take(slot%multigrid%grid%coarse%factor)
      size_of%bytes = size_of%bytes + slot%multigrid%expected_bytes(body)
    else
      size_of%form = form_multigrid
      call slot%multigrid%analyze(body, modes, error)
      if (allocated(error)) return
      call size_of%take(slot%multigrid%grid%coarse%factor)
    end if
    size_of%class_entries = size_of%entries
    size_of%product_entries = size_of%entries
    if (size_of%form == form_multigrid) size_of%product_entries = slot%multigrid%solve_entries()
    if (size_of%forms_matrix) size_of%product_entries = (int(work%n_rows, int64)/work%n_bodies)**2/2
    if (size_of%form == form_multigrid) then
      size_of%stiffness_bytes = slot%multigrid%grid%levels%corner_bytes() + &
                                slot%multigrid%grid%interpolation%aggregates%matrix_bytes()
      if (slot%multigrid%grid%is_aggregated) then
        size_of%bytes = size_of%stiffness_bytes
        size_of%class_entries = aggregated_products*size_of%stiffness_bytes/16
      end if
    else
      size_of%stiffness_bytes = 16*size(stiffness%matrix%row, kind=int64)
    end if
    call stiffness%forget_graph()
    call set_item('')
  end subroutine analyze_body

  !> Refuse factors that are larger than the available memory; warn where it will be nearly exhausted.
  subroutine check_memory(memory, size_of, warning, error)
    type(memory_t), intent(in) :: memory  !! What is in use and what is left.
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors of this rank (n).
    character(:), allocatable, intent(out) :: warning  !! Text of the warning; empty where there is none.
    !> Allocated where the memory does not suffice; says how much is available.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: factors, stiffnesses
    warning = ''
    if (.not. memory%is_known) return
    factors = real(sum(size_of%bytes), dp)
    ! They are given back on the way.
    stiffnesses = real(sum(size_of%stiffness_bytes), dp)
    ! The ranks of a node share its memory.
    factors = factors*n_local_ranks()
    stiffnesses = stiffnesses*n_local_ranks()
    if (factors - stiffnesses > memory%left) then
      call set_error(error, 'not enough memory: the factors need '//memory_text(factors)//', and '// &
                     memory_text(memory%left)//' are available '//memory%limit//' (in use: '// &
                     memory_text(memory%used)//'); nothing was solved; use a machine with more memory, '// &
                     'a coarser mesh, or linear elements', exit_machine)
    else if ((1 + beside_factor)*factors - stiffnesses > memory%left) then
      warning = 'memory is nearly exhausted: the factors need '//memory_text(factors)//', and '// &
                memory_text(memory%left)//' are available '//memory%limit
    end if
  end subroutine check_memory

  !> Factorize the representatives, the largest first: those that dominate one after the other, outside parallel
  !> regions (`set_factor_threads`), the others side by side. Stiffnesses are given back one by one.
  subroutine factorize_bodies(body, ranks, modes, split_near_null, size_of, stiffness, slot, report, error)
    type(body_t), intent(in) :: body(:)  !! Assembled (n_bodies).
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(body_modes_t), intent(in) :: modes(:)  !! Rigid body modes that supports leave (n_bodies).
    logical, intent(in) :: split_near_null  !! Whether the scheme can solve for near-null-space modes.
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    type(stiffness_t), intent(inout) :: stiffness(:)  !! Stiffnesses of the representatives; empty on return (n_bodies).
    type(operator_slot_t), intent(inout) :: slot(:)  !! Analysed (n_bodies).
    type(factorization_report_t), allocatable, intent(out) :: report(:)  !! Reports of the representatives (n_bodies).
    !> As in `factorize_stiffness`: a stiffness is not positive definite, memory runs out, and rarer ones; or an
    !> interrupt came. Names the bodies.
    type(error_t), allocatable, intent(out) :: error
    type(error_slot_t), allocatable :: failed(:)
    real(dp), allocatable :: flops(:)
    integer :: i, b, order(size(body)), alone
    allocate (failed(size(body)), report(size(body)))
    flops = merge(size_of%flops, 0.0_dp, ranks%factorizes)
    order = largest_first(flops)
    call expect_progress(sum(flops))
    alone = n_dominating(flops(order))
    call set_blas_threads(1)
    do i = 1, alone
      call factorize(order(i))
    end do
    !$omp parallel do default(none) schedule(dynamic, 1) shared(alone, order)
    do i = alone + 1, size(order)
      call factorize(order(i))
    end do
    !$omp end parallel do
    ! Smoothers use all threads for one body.
    do b = 1, size(body)
      if (.not. allocated(slot(b)%multigrid) .or. allocated(failed(b)%error)) cycle
      if (interrupted()) exit
      call slot(b)%multigrid%prepare(failed(b)%error)
    end do
    call stop_if_interrupted(error)
    if (.not. allocated(error)) call collect(body, ranks, failed, error)
    if (.not. allocated(error)) call share_reports(ranks, report)
  contains
    !> Factorize a body, unless it is another rank's or an interrupt came.
    subroutine factorize(b)
      integer, intent(in) :: b  !! Number of the body.
      if (interrupted() .or. .not. ranks%factorizes(b)) return
      call set_item("body '"//body(b)%name//"'")
      select case (size_of(b)%form)
      case (form_direct)
        call slot(b)%direct%factorize(body(b), stiffness(b), split_near_null, report(b), failed(b)%error)
      case (form_whole)
        call slot(b)%multigrid%factorize_whole(body(b), modes(b), stiffness(b), report(b), failed(b)%error)
      case default
        call slot(b)%multigrid%factorize(body(b), report(b), failed(b)%error)
      end select
      call add_progress(flops(b))
      call set_item('')
    end subroutine factorize
  end subroutine factorize_bodies

  !> Make what factorizations found out about the condition known to all ranks.
  subroutine share_reports(ranks, report)
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    !> Those of this rank in, of all out; diagonals, near-null-space modes and springs stay where they are (n_bodies).
    type(factorization_report_t), intent(inout) :: report(:)
    real(dp) :: n_near_null(size(report))
    n_near_null = report%n_near_null
    call share(ranks%owner, n_near_null)
    report%n_near_null = nint(n_near_null)
    call share(ranks%owner, report%condition)
    call share(ranks%owner, report%condition_left)
    call share(ranks%owner, report%is_measured)
  end subroutine share_reports

  !> All bodies' errors as one.
  subroutine collect(body, ranks, failed, error)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_ranks_t), intent(in) :: ranks  !! Which rank computes which bodies.
    type(error_slot_t), intent(inout) :: failed(:)  !! Errors of the bodies, not allocated on return (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where one of them is.
    type(problem_list_t) :: problems
    integer :: b
    call share_errors(ranks%owner, failed)
    do b = 1, size(body)
      call problems%add_error(failed(b)%error, "body '"//body(b)%name//"': ")
    end do
    call problems%raise(error)
  end subroutine collect

  !> Whether forming the matrix pays, and it does not take too much memory.
  pure logical function matrix_is_cheaper(work, factor_entries, path_entries) result(cheaper)
    type(workload_t), intent(in) :: work  !! Products to come.
    real(dp), intent(in) :: factor_entries  !! Entries of the factor [].
    !> Entries of the factor from a contact unknown to the root of the elimination tree [].
    real(dp), intent(in) :: path_entries
    real(dp) :: of_solves, of_matrix, n
    cheaper = .false.
    if (work%n_steps == 0 .or. 8*real(work%n_rows, dp)**2/work%n_bodies > most_bytes) return
    ! Triangular solves: each entry of the factor twice, an addition and a multiplication.
    of_solves = slowness_of_solves*4*factor_entries*work%n_steps*work%n_bodies
    ! Forming the matrix, and multiplying with it; the unknowns on the path are about the root of twice its entries.
    n = real(work%n_rows, dp)/work%n_bodies
    of_matrix = work%n_bodies*(slowness_of_substitution*(2*path_entries*n + sqrt(2*path_entries)*n**2) + &
                               slowness_of_solves*2*n**2*work%n_steps)
    cheaper = of_matrix < of_solves
  end function matrix_is_cheaper

  !> Peak memory [bytes].
  real(dp) function predicted_memory(n_unknowns, n_rows, size_of, used, n_tied, linear_solver, room) result(memory)
    integer, intent(in) :: n_unknowns(:)  !! Unknowns of the bodies (n_bodies).
    integer, intent(in) :: n_rows(:)  !! Contact rows of the bodies (n_bodies).
    !> Sizes of the factors; without bytes for all but one of congruent bodies (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)
    real(dp), intent(in) :: used  !! Memory in use, all assembled and analysed [bytes].
    integer, intent(in), optional :: n_tied(:)  !! Rows of ties among those of the bodies; none if absent (n_bodies).
    integer, intent(in), optional :: linear_solver  !! One of `linear_solver_*`; present with `n_tied`.
    real(dp), intent(in), optional :: room  !! Memory for matrices of the rows; present with `n_tied` [bytes].
    real(dp) :: cost(2), of_ties
    integer :: b
    logical :: by_products
    memory = used + (1 + beside_factor)*sum(real(size_of%bytes, dp)) + &
             sum(n_unknowns*merge(beside_rows, beside_direct, size_of%form == form_multigrid))
    ! The compliance of the rows in the corner spaces.
    if (any(size_of%form /= form_direct)) memory = memory + 8*sum(real(n_rows, dp)**2)
    if (.not. present(n_tied)) return
    cost = 0
    of_ties = 0
    do b = 1, size(size_of)
      if (n_tied(b) > 0) call add_costs(n_tied(b), size_of(b)%path_entries, real(size_of(b)%class_entries, dp), &
                                        .true., all(n_rows == n_tied), cost, of_ties)
    end do
    by_products = linear_solver == linear_solver_iterative
    if (linear_solver == linear_solver_auto) by_products = takes_products(cost, [of_ties, 0.0_dp], room)
    if (.not. by_products) memory = memory + of_ties
  end function predicted_memory
end module dotyk_control_factorization
