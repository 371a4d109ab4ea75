!> The graph of contact pairs and bodies: the blocks of the linear system of an active set, and their elimination order.
!>
!> A block is a pair with its chosen contact rows, or the rigid body modes of a body. Two pairs couple where they share
!> a body (through its compliance), a pair and a body where the pair touches it. Pairs are ordered by nested dissection;
!> each body follows the last of its pairs, as `dotyk_linalg_block_ldlt` demands.
module dotyk_scheme_contact_graph
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_tree, only: block_tree_t
  use dotyk_linalg_clique_graph, only: make_clique_graph
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: make_contact_graph, elimination_cost

  !> The chosen rows of one body.
  type, public :: body_rows_t
    !> Rows of the contact operator, ascending, hence pair by pair (n).
    integer, allocatable :: row(:)
    !> Positions of these among all rows of the body (n).
    integer, allocatable :: place(:)
    !> Blocks of the body's pairs (n_pairs).
    integer, allocatable :: block(:)
    !> Rows of the k-th of them: row(first(k):first(k+1)-1) (n_pairs + 1).
    integer, allocatable :: first(:)
    !> Block of the rigid body modes, 0 for a held body.
    integer :: modes = 0
  end type body_rows_t

  !> The blocks.
  type, public :: contact_graph_t
    !> Pairs with chosen rows: blocks 1 .. n_pairs; the blocks of modes follow.
    integer :: n_pairs = 0
    !> Rows of each block: contact rows or modes (n_blocks).
    integer, allocatable :: size(:)
    !> 1 for pairs, -1 for modes (n_blocks).
    integer, allocatable :: sign(:)
    !> First row of each pair among the chosen rows (n_pairs + 1).
    integer, allocatable :: first(:)
    !> Coupled blocks of block p without p itself: neighbour(start(p):start(p+1)-1) (n_blocks + 1).
    integer, allocatable :: start(:)
    !> See `start`.
    integer, allocatable :: neighbour(:)
    !> The block that is eliminated k-th (n_blocks).
    integer, allocatable :: order(:)
    !> Chosen rows of the bodies (n_bodies).
    type(body_rows_t), allocatable :: body(:)
    !> Body of each block of modes, 0 for pairs (n_blocks).
    integer, allocatable :: body_of(:)
    !> Number of each row among the chosen ones, 0 for others (n_rows).
    integer, allocatable :: number(:)
  end type contact_graph_t

contains

  !> Blocks, couplings and elimination order for some of the contact rows.
  subroutine make_contact_graph(qp, chosen, graph, error)
    !> Contact rows and rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> The rows (n_rows).
    logical, intent(in) :: chosen(:)
    !> The graph.
    type(contact_graph_t), intent(out) :: graph
    !> METIS has no memory to order the pairs, or refuses their graph.
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: block_of_pair(:), pair_order(:), start(:), neighbour(:)
    integer :: b, k, n_bodies, n_blocks
    n_bodies = size(qp%block)
    call number_rows(qp%pair_first_row, chosen, graph, block_of_pair)
    allocate (graph%body(n_bodies))
    n_blocks = graph%n_pairs
    do b = 1, n_bodies
      call find_rows(qp%block(b)%row, qp%pair_first_row, chosen, block_of_pair, graph%body(b))
      if (qp%coarse%first(b + 1) == qp%coarse%first(b)) cycle
      n_blocks = n_blocks + 1
      graph%body(b)%modes = n_blocks
    end do
    graph%size = [graph%size, (0, k=1, n_blocks - graph%n_pairs)]
    allocate (graph%sign(n_blocks), source=1)
    allocate (graph%body_of(n_blocks), source=0)
    do b = 1, n_bodies
      k = graph%body(b)%modes
      if (k == 0) cycle
      graph%size(k) = qp%coarse%first(b + 1) - qp%coarse%first(b)
      graph%sign(k) = -1
      graph%body_of(k) = b
    end do
    call couple_blocks(graph, .false., start, neighbour)
    allocate (pair_order(graph%n_pairs))
    call nested_dissection(start, neighbour, pair_order, error, weight=graph%size(:graph%n_pairs))
    if (allocated(error)) return
    call couple_blocks(graph, .true., graph%start, graph%neighbour)
    call insert_bodies(graph, pair_order)
  end subroutine make_contact_graph

  !> Number the chosen rows, and the pairs that have any.
  subroutine number_rows(pair_first, chosen, graph, block_of_pair)
    !> First row of each pair (all pairs + 1).
    integer, intent(in) :: pair_first(:)
    !> See `make_contact_graph` (n_rows).
    logical, intent(in) :: chosen(:)
    !> Sets `n_pairs`, `size`, `first` and `number`.
    type(contact_graph_t), intent(inout) :: graph
    !> 0 for a pair without chosen rows (all pairs).
    integer, allocatable, intent(out) :: block_of_pair(:)
    integer :: k, n, i
    allocate (block_of_pair(size(pair_first) - 1), source=0)
    allocate (graph%size(size(pair_first) - 1), graph%first(size(pair_first)))
    allocate (graph%number(size(chosen)), source=0)
    graph%n_pairs = 0
    graph%first(1) = 1
    n = 0
    do k = 1, size(pair_first) - 1
      do i = pair_first(k), pair_first(k + 1) - 1
        if (.not. chosen(i)) cycle
        n = n + 1
        graph%number(i) = n
      end do
      associate (m => graph%n_pairs)
        if (n < graph%first(m + 1)) cycle
        m = m + 1
        block_of_pair(k) = m
        graph%first(m + 1) = n + 1
        graph%size(m) = graph%first(m + 1) - graph%first(m)
      end associate
    end do
    graph%size = graph%size(:graph%n_pairs)
    graph%first = graph%first(:graph%n_pairs + 1)
  end subroutine number_rows

  !> The chosen rows of a body, pair by pair.
  pure subroutine find_rows(row, pair_first, chosen, block_of_pair, body)
    !> All rows of the body, ascending (rows of the body).
    integer, intent(in) :: row(:)
    !> First row of each pair (all pairs + 1).
    integer, intent(in) :: pair_first(:)
    !> See `make_contact_graph` (n_rows).
    logical, intent(in) :: chosen(:)
    !> See `number_rows` (all pairs).
    integer, intent(in) :: block_of_pair(:)
    !> The rows.
    type(body_rows_t), intent(inout) :: body
    integer :: i, k, n
    body%row = pack(row, chosen(row))
    body%place = pack([(i, i=1, size(row))], chosen(row))
    allocate (body%block(size(body%row)), body%first(size(body%row) + 1))
    n = 0
    i = 1
    do while (i <= size(body%row))
      k = pair_of(body%row(i), pair_first)
      n = n + 1
      body%block(n) = block_of_pair(k)
      body%first(n) = i
      do while (i <= size(body%row))
        if (body%row(i) >= pair_first(k + 1)) exit
        i = i + 1
      end do
    end do
    body%first(n + 1) = size(body%row) + 1
    body%block = body%block(:n)
    body%first = body%first(:n + 1)
  end subroutine find_rows

  !> The pair that a row belongs to.
  pure integer function pair_of(row, first) result(pair)
    !> Row of the contact operator.
    integer, intent(in) :: row
    !> First row of each pair (all pairs + 1).
    integer, intent(in) :: first(:)
    integer :: low, high, middle
    low = 1
    high = size(first)
    ! The last pair that begins at the row or before it.
    do while (high - low > 1)
      middle = (low + high)/2
      if (first(middle) <= row) then
        low = middle
      else
        high = middle
      end if
    end do
    pair = low
  end function pair_of

  !> Couplings of the blocks: those of one body are a clique.
  subroutine couple_blocks(graph, with_modes, start, neighbour)
    !> With rows and blocks.
    type(contact_graph_t), intent(in) :: graph
    !> False: pairs only.
    logical, intent(in) :: with_modes
    !> See `contact_graph_t` (n_blocks + 1).
    integer, allocatable, intent(out) :: start(:)
    !> See `contact_graph_t` (number of couplings).
    integer, allocatable, intent(out) :: neighbour(:)
    integer, allocatable :: first(:), member(:)
    integer :: b, n
    allocate (first(size(graph%body) + 1))
    allocate (member(sum([(size(graph%body(b)%block) + 1, b=1, size(graph%body))])))
    first(1) = 1
    do b = 1, size(graph%body)
      associate (body => graph%body(b))
        n = size(body%block)
        member(first(b):first(b) + n - 1) = body%block
        first(b + 1) = first(b) + n
        if (.not. with_modes .or. body%modes == 0) cycle
        member(first(b + 1)) = body%modes
        first(b + 1) = first(b + 1) + 1
      end associate
    end do
    n = merge(size(graph%size), graph%n_pairs, with_modes)
    call make_clique_graph(first, member(:first(size(first)) - 1), n, start, neighbour)
  end subroutine couple_blocks

  !> The order of all blocks: each body after the last of its pairs.
  subroutine insert_bodies(graph, pair_order)
    !> Sets `order`.
    type(contact_graph_t), intent(inout) :: graph
    !> The pair that comes k-th (n_pairs).
    integer, intent(in) :: pair_order(:)
    integer, allocatable :: time(:), due(:), next(:)
    integer :: b, k, n, last
    allocate (time(graph%n_pairs), due(0:graph%n_pairs), next(size(graph%size)), graph%order(size(graph%size)))
    time(pair_order) = [(k, k=1, graph%n_pairs)]
    ! Lists of the bodies whose last pair comes at a time.
    due = 0
    do b = size(graph%body), 1, -1
      if (graph%body(b)%modes == 0) cycle
      last = maxval([0, time(graph%body(b)%block)])
      next(graph%body(b)%modes) = due(last)
      due(last) = graph%body(b)%modes
    end do
    n = 0
    call append_bodies(0)
    do k = 1, graph%n_pairs
      n = n + 1
      graph%order(n) = pair_order(k)
      call append_bodies(k)
    end do
  contains
    !> The bodies whose last pair comes at a time.
    subroutine append_bodies(time_of_pair)
      !> Position of the pair in `pair_order`, 0 for bodies without pairs.
      integer, intent(in) :: time_of_pair
      integer :: block
      block = due(time_of_pair)
      do while (block > 0)
        n = n + 1
        graph%order(n) = block
        block = next(block)
      end do
    end subroutine append_bodies
  end subroutine insert_bodies

  !> Cost of one factorization with the given rows active.
  subroutine elimination_cost(qp, active, flops, entries)
    !> Contact rows and rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> The rows (n_rows).
    logical, intent(in) :: active(:)
    !> Floating-point operations [].
    real(dp), intent(out) :: flops
    !> Entries of the factor [].
    real(dp), intent(out) :: entries
    type(error_t), allocatable :: error
    type(contact_graph_t) :: graph
    type(block_tree_t) :: tree
    flops = 0
    entries = 0
    call make_contact_graph(qp, active, graph, error)
    ! A graph that cannot be ordered is reported when the system is factorized.
    if (allocated(error)) return
    call tree%init(graph%size, graph%start, graph%neighbour, graph%order)
    flops = tree%operations()
    entries = real(tree%entries(), dp)
  end subroutine elimination_cost
end module dotyk_scheme_contact_graph
