!> Contact pairs and the bodies that they share, as the blocks of a sparse system: pairs first, then the motions of the free bodies.
module dotyk_scheme_body_graph
  use dotyk_base_error, only: error_t
  use dotyk_linalg_ordering, only: nested_dissection
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
    allocate (pair_order(graph%n_pairs), graph%order(n_blocks))
    call nested_dissection(start(:graph%n_pairs + 1), neighbour, pair_order, error)
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
    integer, allocatable, intent(out) :: start(:), neighbour(:)
    integer :: degree(size(graph%size)), b, i, pass
    do pass = 1, 2
      degree = 0
      do b = 1, size(graph%body)
        associate (run => graph%body(b))
          do i = 1, size(run%block)
            call link(run%block(i), run%block(:i - 1))
            call link(run%block(i), run%block(i + 1:))
            if (with_motions .and. run%motions > 0) call link(run%block(i), [run%motions])
          end do
          if (with_motions .and. run%motions > 0) call link(run%motions, run%block)
        end associate
      end do
      if (pass == 2) exit
      allocate (start(size(degree) + 1))
      start(1) = 1
      do i = 1, size(degree)
        start(i + 1) = start(i) + degree(i)
      end do
      allocate (neighbour(start(size(start)) - 1))
    end do
    call drop_repeated(start, neighbour)
  contains
    !> Count or set neighbours of a block.
    subroutine link(block, others)
      integer, intent(in) :: block, others(:)
      if (pass == 2) neighbour(start(block) + degree(block):start(block) + degree(block) + size(others) - 1) = others
      degree(block) = degree(block) + size(others)
    end subroutine link
  end subroutine link_blocks

  !> Pairs that share both bodies have got each other twice.
  pure subroutine drop_repeated(start, neighbour)
    integer, intent(inout) :: start(:)
    integer, allocatable, intent(inout) :: neighbour(:)
    integer :: mark(size(start) - 1), k, i, n, from
    mark = 0
    n = 0
    from = 1
    do k = 1, size(mark)
      do i = from, start(k + 1) - 1
        if (mark(neighbour(i)) == k) cycle
        mark(neighbour(i)) = k
        n = n + 1
        neighbour(n) = neighbour(i)
      end do
      from = start(k + 1)
      start(k + 1) = n + 1
    end do
    neighbour = neighbour(:n)
  end subroutine drop_repeated

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
