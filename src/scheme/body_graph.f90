!> Contact pairs and the bodies that they share, as the blocks of a sparse system: pairs first, then the motions of the free bodies.
module dotyk_scheme_body_graph
  use dotyk_base_error, only: error_t
  use dotyk_scheme_pair_graph, only: link_members, order_pairs
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: make_body_graph

  !> The chosen rows of one body.
  type, public :: body_run_t
    !> Rows of the operator, ascending, and their places among the body's rows (n).
    integer, allocatable :: row(:), place(:)
    !> Blocks of its pairs, and the number of the first row of each (n_pairs), (n_pairs + 1).
    integer, allocatable :: block(:), first(:)
    !> Block of its motions; 0: it has none.
    integer :: motions = 0
  end type body_run_t

  !> Blocks of a system.
  type, public :: body_graph_t
    !> Pairs that have chosen rows: blocks 1 .. n_pairs.
    integer :: n_pairs = 0
    !> Rows of each block; 1 for pairs, -1 for motions (n_blocks).
    integer, allocatable :: size(:), sign(:)
    !> First row of each pair among the chosen ones (n_pairs + 1).
    integer, allocatable :: first(:)
    !> Blocks that touch each other, without the block itself, and an order of elimination (n_blocks + 1), (n_blocks).
    integer, allocatable :: start(:), neighbour(:), order(:)
    !> (n_bodies).
    type(body_run_t), allocatable :: body(:)
    !> Body of each block of motions, 0 for pairs (n_blocks).
    integer, allocatable :: body_of(:)
    !> Number of each row among the chosen ones, 0 for others (n_rows).
    integer, allocatable :: number(:)
    !> Motion of each row of the blocks of motions, in their order (coarse%n).
    integer, allocatable :: motion(:)
  end type body_graph_t

contains

  !> Find the blocks of some rows, and an order: pairs by nested dissection, each body after the last of its pairs.
  subroutine make_body_graph(problem, chosen, graph, error)
    type(contact_problem_t), intent(in) :: problem
    !> (n_rows).
    logical, intent(in) :: chosen(:)
    type(body_graph_t), intent(out) :: graph
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: block_of_pair(:), pair_order(:), start(:), neighbour(:)
    integer :: b, i, k, n_bodies, n_blocks
    n_bodies = size(problem%operator%block)
    call number_pairs(problem, chosen, graph, block_of_pair)
    allocate (graph%body(n_bodies))
    n_blocks = graph%n_pairs
    do b = 1, n_bodies
      call find_run(problem, b, chosen, block_of_pair, graph)
      if (problem%coarse%first(b + 1) == problem%coarse%first(b)) cycle
      n_blocks = n_blocks + 1
      graph%body(b)%motions = n_blocks
    end do
    graph%size = [graph%size, (0, k=1, n_blocks - graph%n_pairs)]
    allocate (graph%sign(n_blocks), source=1)
    allocate (graph%body_of(n_blocks), source=0)
    do b = 1, n_bodies
      k = graph%body(b)%motions
      if (k == 0) cycle
      graph%size(k) = problem%coarse%first(b + 1) - problem%coarse%first(b)
      graph%sign(k) = -1
      graph%body_of(k) = b
    end do
    graph%motion = [(i, i=1, problem%coarse%n)]
    call link_blocks(graph, .false., start, neighbour)
    allocate (graph%order(n_blocks))
    call order_pairs(start, neighbour, graph%size(:graph%n_pairs), pair_order, error)
    if (allocated(error)) return
    call link_blocks(graph, .true., graph%start, graph%neighbour)
    call put_bodies(graph, pair_order)
  end subroutine make_body_graph

  !> Which pairs have chosen rows.
  subroutine number_pairs(problem, chosen, graph, block_of_pair)
    type(contact_problem_t), intent(in) :: problem
    logical, intent(in) :: chosen(:)
    type(body_graph_t), intent(inout) :: graph
    !> 0 for a pair without them (all pairs).
    integer, allocatable, intent(out) :: block_of_pair(:)
    integer :: k, n, i
    associate (first => problem%operator%pair_first_row)
      allocate (block_of_pair(size(first) - 1), graph%size(size(first) - 1), graph%first(size(first)), graph%number(size(chosen)))
      graph%n_pairs = 0
      graph%first(1) = 1
      do k = 1, size(first) - 1
        n = count(chosen(first(k):first(k + 1) - 1))
        block_of_pair(k) = 0
        if (n == 0) cycle
        graph%n_pairs = graph%n_pairs + 1
        block_of_pair(k) = graph%n_pairs
        graph%size(graph%n_pairs) = n
        graph%first(graph%n_pairs + 1) = graph%first(graph%n_pairs) + n
      end do
    end associate
    graph%size = graph%size(:graph%n_pairs)
    n = 0
    do i = 1, size(chosen)
      if (chosen(i)) n = n + 1
      graph%number(i) = merge(n, 0, chosen(i))
    end do
  end subroutine number_pairs

  !> The chosen rows of a body, pair by pair.
  subroutine find_run(problem, b, chosen, block_of_pair, graph)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: b
    logical, intent(in) :: chosen(:)
    integer, intent(in) :: block_of_pair(:)
    type(body_graph_t), intent(inout) :: graph
    integer :: i, k, last
    associate (run => graph%body(b), row => problem%operator%block(b)%row, pair_first => problem%operator%pair_first_row)
      run%row = pack(row, chosen(row))
      run%place = pack([(i, i=1, size(row))], chosen(row))
      allocate (run%block(0), run%first(0))
      last = 0
      do i = 1, size(run%row)
        k = pair_of(run%row(i), pair_first)
        if (k == last) cycle
        run%block = [run%block, block_of_pair(k)]
        run%first = [run%first, i]
        last = k
      end do
      run%first = [run%first, size(run%row) + 1]
    end associate
  end subroutine find_run

  !> The pair that a row belongs to.
  pure integer function pair_of(row, first) result(pair)
    integer, intent(in) :: row
    !> First row of each pair (n_pairs + 1).
    integer, intent(in) :: first(:)
    integer :: low, high, middle
    low = 1
    high = size(first)
    ! The last pair that begins at the row or before.
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

  !> Pairs that share a body; with motions also pairs and their bodies.
  subroutine link_blocks(graph, with_motions, start, neighbour)
    type(body_graph_t), intent(in) :: graph
    logical, intent(in) :: with_motions
    !> As in `body_graph_t`; without motions those of the pairs alone.
    integer, allocatable, intent(out) :: start(:), neighbour(:)
    integer, allocatable :: first(:), member(:)
    integer :: b, n
    allocate (first(size(graph%body) + 1))
    allocate (member(sum([(size(graph%body(b)%block) + 1, b=1, size(graph%body))])))
    first(1) = 1
    do b = 1, size(graph%body)
      associate (run => graph%body(b))
        n = size(run%block)
        member(first(b):first(b) + n - 1) = run%block
        first(b + 1) = first(b) + n
        if (.not. with_motions .or. run%motions == 0) cycle
        member(first(b + 1)) = run%motions
        first(b + 1) = first(b + 1) + 1
      end associate
    end do
    n = merge(size(graph%size), graph%n_pairs, with_motions)
    call link_members(first, member(:first(size(first)) - 1), n, start, neighbour)
  end subroutine link_blocks

  !> Each body after the last of its pairs.
  subroutine put_bodies(graph, pair_order)
    type(body_graph_t), intent(inout) :: graph
    !> The pair that comes k-th (n_pairs).
    integer, intent(in) :: pair_order(:)
    integer :: time(graph%n_pairs), due(0:graph%n_pairs), next(size(graph%size)), b, k, n, last
    time(pair_order) = [(k, k=1, graph%n_pairs)]
    due = 0
    do b = size(graph%body), 1, -1
      if (graph%body(b)%motions == 0) cycle
      last = maxval([0, time(graph%body(b)%block)])
      next(graph%body(b)%motions) = due(last)
      due(last) = graph%body(b)%motions
    end do
    n = 0
    call put_due(0)
    do k = 1, graph%n_pairs
      n = n + 1
      graph%order(n) = pair_order(k)
      call put_due(k)
    end do
  contains
    !> The bodies whose last pair came at a time.
    subroutine put_due(time_of_pair)
      integer, intent(in) :: time_of_pair
      integer :: block
      block = due(time_of_pair)
      do while (block > 0)
        n = n + 1
        graph%order(n) = block
        block = next(block)
      end do
    end subroutine put_due
  end subroutine put_bodies
end module dotyk_scheme_body_graph
