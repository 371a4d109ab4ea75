!> Numeric factorization P K P^T = L L^T over the supernodes of a symbolic one.
!>
!> The tree of supernodes is cut into subtrees and a top. Subtrees are independent, tasks for threads: each is factorized
!> front by front, with the updates that supernodes leave for their ancestors on a stack, so that they stay in the caches.
!> What a subtree leaves in the end is added to the values of the top. There the supernodes are large, and each subtracts
!> its products from the values of its ancestors at once, without a stack, shared out in tiles. Cuts and the order of sums
!> depend on the structure only: the digits are the same on any number of threads. BLAS must be set to one thread.
module dotyk_linalg_multifrontal
  use omp_lib, only: omp_in_parallel, omp_get_max_threads, omp_get_num_threads, omp_get_thread_num, omp_lock_kind, &
                     omp_init_lock, omp_destroy_lock, omp_set_lock, omp_unset_lock
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_extend_add, only: add_update, clear_lower, locate
  use dotyk_linalg_fronts, only: factor_panel, subtract_square, product_tile, tile_rows, tile_columns
  use dotyk_linalg_stack_plan, only: plan_stack
  use dotyk_linalg_supernodes, only: supernodes_t, supernode_tree_t, make_tree
  implicit none
  private
  public :: factor_supernodes

  !> Most work of a subtree as a part of the whole; work that is not worth being cut [operations].
  real(dp), parameter, public :: share_of_subtree = 1/256.0_dp, least_work = 3.0e8_dp

  !> Room for updates.
  type :: stack_t
    real(dp), allocatable :: x(:)
    logical :: is_free = .true.
  end type stack_t

  !> What a subtree leaves.
  type :: remainder_t
    !> Stack in use.
    integer :: stack = 0
    !> Last update, lower triangle by columns.
    real(dp), allocatable :: update(:)
    !> Finished, added or not.
    logical :: is_ready = .false.
    !> Column that failed; 0 if none.
    integer :: failed = 0
  end type remainder_t

  !> A factorization at work.
  type :: work_t
    type(supernodes_t) :: supernodes
    type(supernode_tree_t) :: tree
    !> Lower triangle of P K P^T by columns, 0-based.
    integer(int64), pointer, contiguous :: start(:) => null(), row(:) => null()
    real(dp), pointer, contiguous :: value(:) => null()
    !> Place of each row in the front at hand, for each thread (0:order-1, 0:threads-1).
    integer, allocatable :: map(:, :)
    !> Room for a product, for each thread (tile_rows*tile_columns, 0:threads-1).
    real(dp), allocatable :: tile(:, :)
    !> Where on its subtree's stack the update of a supernode starts, 0-based (0:n-1).
    integer(int64), allocatable :: place(:)
    !> Which of the two stacks it is on (0:n-1).
    integer, allocatable :: side(:)
    !> Whether an interrupt ends it.
    logical :: may_stop = .false.
    type(remainder_t), allocatable :: remainder(:)
    !> Stacks that are in use or have been: hardly more than threads.
    type(stack_t), allocatable :: stack(:)
    !> Subtree whose remainder is to be added next, and who may do it and take and return stacks.
    integer :: next = 1
    integer(omp_lock_kind) :: lock
  end type work_t

contains

  !> Factorize.
  subroutine factor_supernodes(supernodes, start, row, value, failed, may_stop)
    !> With memory for the values.
    type(supernodes_t), intent(in) :: supernodes
    !> Lower triangle of P K P^T by columns, all 0-based; rows in any order.
    integer(int64), pointer, contiguous, intent(in) :: start(:), row(:)
    real(dp), pointer, contiguous, intent(in) :: value(:)
    !> First column (from 1) whose pivot is not positive, 0 if there is none.
    integer, intent(out) :: failed
    !> Whether it ends, with values that mean nothing, as soon as somebody asks the program to stop; not if absent.
    logical, intent(in), optional :: may_stop
    type(work_t) :: work
    integer :: threads
    failed = 0
    if (present(may_stop)) work%may_stop = may_stop
    work%supernodes = supernodes
    work%start(0:) => start
    work%row(0:) => row
    work%value(0:) => value
    call make_tree(supernodes, share_of_subtree, least_work, work%tree)
    threads = omp_get_max_threads()
    if (omp_in_parallel()) threads = omp_get_num_threads()
    allocate (work%map(0:size(start) - 2, 0:threads - 1), work%tile(tile_rows*tile_columns, 0:threads - 1), &
              work%place(0:supernodes%n - 1), work%side(0:supernodes%n - 1), &
              work%remainder(size(work%tree%first)), work%stack(size(work%tree%first)))
    call omp_init_lock(work%lock)
    if (omp_in_parallel() .or. threads == 1 .or. size(work%tree%top) == 0) then
      call factor_all(work, failed)
    else
      !$omp parallel default(none) shared(work, failed)
      !$omp single
      call factor_all(work, failed)
      !$omp end single
      !$omp end parallel
    end if
    call omp_destroy_lock(work%lock)
  end subroutine factor_supernodes

  !> Subtrees, then the top. One thread comes here and makes tasks for the others.
  subroutine factor_all(work, failed)
    type(work_t), intent(inout) :: work
    integer, intent(out) :: failed
    integer :: i, t
    do i = 1, size(work%tree%top)
      !$omp task default(none) shared(work) firstprivate(i)
      call begin_front(work, work%tree%top(i), work%supernodes%value)
      !$omp end task
    end do
    !$omp taskwait
    do t = 1, size(work%tree%first)
      !$omp task default(none) shared(work) firstprivate(t)
      call factor_subtree(work, t)
      call add_remainders(work, t)
      !$omp end task
    end do
    !$omp taskwait
    failed = 0
    if (any(work%remainder%failed > 0)) failed = minval(work%remainder%failed, mask=work%remainder%failed > 0)
    if (failed > 0) return
    do i = 1, size(work%tree%top)
      if (has_to_stop(work)) return
      call factor_top(work, work%tree%top(i), work%supernodes%value, failed)
      if (failed > 0) return
    end do
  end subroutine factor_all

  !> Whether the program was asked to stop, and this is to end then.
  logical function has_to_stop(work)
    type(work_t), intent(in) :: work
    has_to_stop = work%may_stop
    if (has_to_stop) has_to_stop = interrupted()
  end function has_to_stop

  !> Entries of K in the panel of a supernode.
  subroutine begin_front(work, s, x)
    type(work_t), intent(inout) :: work
    integer, intent(in) :: s
    !> Values of the factor.
    real(dp), intent(inout) :: x(0:*)
    integer :: rows, i, thread
    integer(int64) :: column, at, k
    rows = work%supernodes%rows(s)
    thread = omp_get_thread_num()
    do i = 0, rows - 1
      work%map(work%supernodes%row(work%supernodes%row_start(s) + i), thread) = i
    end do
    at = work%supernodes%value_start(s)
    x(at:at + int(rows, int64)*work%supernodes%columns(s) - 1) = 0
    do column = work%supernodes%column_start(s), work%supernodes%column_start(s + 1) - 1
      do k = work%start(column), work%start(column + 1) - 1
        x(at + work%map(work%row(k), thread)) = work%value(k)
      end do
      at = at + rows
    end do
  end subroutine begin_front

  !> Factorize a subtree; the update of its root stays on its stack.
  subroutine factor_subtree(work, t)
    type(work_t), intent(inout) :: work
    integer, intent(in) :: t
    integer(int64) :: needed
    integer :: i, s
    call plan_stack(work%supernodes, work%tree, t, work%place, work%side, needed)
    call take_stack(work, needed, work%remainder(t))
    do i = work%tree%first(t), work%tree%last(t)
      s = work%tree%order(i)
      if (has_to_stop(work)) exit
      call begin_front(work, s, work%supernodes%value)
      call factor_front(work, s, work%stack(work%remainder(t)%stack)%x, work%supernodes%value, work%remainder(t)%failed)
      if (work%remainder(t)%failed > 0) exit
    end do
    call keep_update(work, s, work%remainder(t))
  end subroutine factor_subtree

  !> Keep the last update of a subtree while others have their turn, and make its stack free.
  subroutine keep_update(work, s, remainder)
    type(work_t), intent(inout) :: work
    !> Root of the subtree.
    integer, intent(in) :: s
    type(remainder_t), intent(inout) :: remainder
    integer :: n, j
    integer(int64) :: from, to
    n = work%supernodes%rows(s) - work%supernodes%columns(s)
    if (remainder%failed > 0) n = 0
    if (has_to_stop(work)) n = 0
    allocate (remainder%update(int(n, int64)*(n + 1)/2))
    from = work%place(s)
    to = 0
    do j = 1, n
      remainder%update(to + 1:to + n - j + 1) = work%stack(remainder%stack)%x(from + j:from + n)
      from = from + n
      to = to + n - j + 1
    end do
    call omp_set_lock(work%lock)
    work%stack(remainder%stack)%is_free = .true.
    call omp_unset_lock(work%lock)
  end subroutine keep_update

  !> Find a stack that is free and long enough, or make one. The largest subtrees come first, and theirs serve the others.
  subroutine take_stack(work, needed, remainder)
    type(work_t), intent(inout) :: work
    !> Entries.
    integer(int64), intent(in) :: needed
    type(remainder_t), intent(inout) :: remainder
    integer :: i
    call omp_set_lock(work%lock)
    do i = 1, size(work%stack)
      if (.not. work%stack(i)%is_free) cycle
      if (allocated(work%stack(i)%x)) then
        if (size(work%stack(i)%x, kind=int64) < needed) deallocate (work%stack(i)%x)
      end if
      exit
    end do
    work%stack(i)%is_free = .false.
    call omp_unset_lock(work%lock)
    remainder%stack = i
    if (.not. allocated(work%stack(i)%x)) allocate (work%stack(i)%x(needed + 1))
  end subroutine take_stack

  !> Assemble a front from what its children have left, eliminate its columns, and leave its update.
  subroutine factor_front(work, s, stack, x, failed)
    type(work_t), intent(inout) :: work
    integer, intent(in) :: s
    !> Updates of the subtree.
    real(dp), intent(inout) :: stack(0:*)
    !> Values of the factor, with K's in the panel.
    real(dp), intent(inout) :: x(0:*)
    !> Column that failed (from 1); 0 if none.
    integer, intent(out) :: failed
    integer :: columns, rows, below, child, n, thread
    integer(int64) :: at, rows_at
    columns = work%supernodes%columns(s)
    rows = work%supernodes%rows(s)
    below = rows - columns
    at = work%supernodes%value_start(s)
    thread = omp_get_thread_num()
    call clear_lower(below, stack(work%place(s)))
    child = work%tree%first_child(s)
    do while (child >= 0)
      rows_at = work%supernodes%row_start(child) + work%supernodes%columns(child)
      n = int(work%supernodes%row_start(child + 1) - rows_at)
      associate (row => work%supernodes%row(rows_at:rows_at + n - 1))
        call add_update(n, work%map(row, thread), stack(work%place(child)), columns, rows, x(at), stack(work%place(s)))
      end associate
      child = work%tree%next_sibling(child)
    end do
    call factor_panel(rows, columns, x(at), .false., failed)
    if (failed > 0) then
      failed = failed + int(work%supernodes%column_start(s))
    else if (below > 0) then
      call subtract_square(below, columns, x(at + columns), rows, stack(work%place(s)))
    end if
  end subroutine factor_front

  !> Say that a subtree is finished, and add all remainders whose turn it is: always in the same order.
  subroutine add_remainders(work, t)
    type(work_t), intent(inout) :: work
    integer, intent(in) :: t
    integer :: s, n
    integer(int64) :: rows_at
    call omp_set_lock(work%lock)
    work%remainder(t)%is_ready = .true.
    do while (work%next <= size(work%remainder))
      if (.not. work%remainder(work%next)%is_ready) exit
      associate (left => work%remainder(work%next))
        s = work%tree%order(work%tree%last(work%next))
        rows_at = work%supernodes%row_start(s) + work%supernodes%columns(s)
        n = int(work%supernodes%row_start(s + 1) - rows_at)
        if (has_to_stop(work)) n = 0
        if (n > 0 .and. left%failed == 0) then
          associate (row => work%supernodes%row(rows_at:rows_at + n - 1))
            call add_to_ancestors(work, n, n, row, row, .true., .true., left%update, work%supernodes%value)
          end associate
        end if
        if (allocated(left%update)) deallocate (left%update)
      end associate
      work%next = work%next + 1
    end do
    call omp_unset_lock(work%lock)
  end subroutine add_remainders

  !> Eliminate the columns of a supernode of the top, and subtract its products from its ancestors.
  subroutine factor_top(work, s, x, failed)
    type(work_t), intent(inout) :: work
    integer, intent(in) :: s
    !> Values of the factor.
    real(dp), intent(inout) :: x(0:*)
    integer, intent(out) :: failed
    integer :: columns, rows, i, j
    integer(int64) :: at
    columns = work%supernodes%columns(s)
    rows = work%supernodes%rows(s)
    at = work%supernodes%value_start(s)
    call factor_panel(rows, columns, x(at), .true., failed)
    if (failed > 0) then
      failed = failed + int(work%supernodes%column_start(s))
      return
    end if
    do j = columns, rows - 1, tile_columns
      !$omp task default(none) shared(work, x) firstprivate(s, j)
      call subtract_tile(work, s, j, j, tile_columns, x)
      !$omp end task
      do i = j + tile_columns, rows - 1, tile_rows
        !$omp task default(none) shared(work, x) firstprivate(s, i, j)
        call subtract_tile(work, s, i, j, tile_rows, x)
        !$omp end task
      end do
    end do
    !$omp taskwait
  end subroutine factor_top

  !> Subtract the product of two groups of rows of a supernode from its ancestors.
  subroutine subtract_tile(work, s, i, j, most_rows, x)
    type(work_t), intent(inout) :: work
    !> Supernode, first row of each group, from 0.
    integer, intent(in) :: s, i, j
    !> Most rows of the first group.
    integer, intent(in) :: most_rows
    !> Values of the factor.
    real(dp), intent(inout) :: x(0:*)
    integer :: rows, m, n
    integer(int64) :: at, rows_at
    rows = work%supernodes%rows(s)
    m = min(most_rows, rows - i)
    n = min(tile_columns, rows - j)
    if (has_to_stop(work)) return
    at = work%supernodes%value_start(s)
    rows_at = work%supernodes%row_start(s)
    associate (tile => work%tile(:, omp_get_thread_num()), row => work%supernodes%row(rows_at:rows_at + rows - 1))
      call product_tile(m, n, work%supernodes%columns(s), x(at + i), x(at + j), rows, i == j, tile)
      call add_to_ancestors(work, m, n, row(i + 1:i + m), row(j + 1:j + n), i == j, .false., tile, x)
    end associate
  end subroutine subtract_tile

  !> Add a block to the values of the supernodes that its columns belong to.
  subroutine add_to_ancestors(work, m, n, row, column, is_lower, is_packed, block, x)
    type(work_t), intent(in) :: work
    integer, intent(in) :: m, n
    !> Its rows and columns in the order of elimination (m) and (n); the same ones if it is a lower triangle.
    integer(int64), intent(in) :: row(m), column(n)
    logical, intent(in) :: is_lower
    !> The triangle lies there without gaps.
    logical, intent(in) :: is_packed
    !> By columns.
    real(dp), intent(in) :: block(*)
    !> Values of the factor.
    real(dp), intent(inout) :: x(0:*)
    integer :: place(m), j, s, i, i_first
    integer(int64) :: at, from
    s = -1
    from = 0
    do j = 1, n
      i_first = 1
      if (is_lower) i_first = j
      if (work%tree%of_column(column(j)) /= s) then
        s = work%tree%of_column(column(j))
        associate (list => work%supernodes%row(work%supernodes%row_start(s):work%supernodes%row_start(s + 1) - 1))
          call locate(m - i_first + 1, row(i_first:), size(list), list, place(i_first:))
        end associate
      end if
      at = work%supernodes%value_start(s) + (column(j) - work%supernodes%column_start(s))*work%supernodes%rows(s)
      do i = i_first, m
        x(at + place(i)) = x(at + place(i)) + block(from + i)
      end do
      from = from + merge(n - j, m, is_packed)
    end do
  end subroutine add_to_ancestors
end module dotyk_linalg_multifrontal
