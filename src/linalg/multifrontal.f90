!> Numeric Cholesky factorization P K P^T = L L^T in the supernodal structure of CHOLMOD's symbolic analysis.
!>
!> Method. The elimination tree of the supernodes is cut into independent subtrees and a top. A subtree is factorized by
!> the multifrontal method (I. S. Duff and J. K. Reid, ACM Trans. Math. Softw. 9, 1983): front by front, children first,
!> with the update matrices of the children on a working stack that fits the caches. The update matrix of its root is
!> added to the top. The supernodes of the top are large: a right-looking factorization subtracts the products of each
!> from its ancestors, tile by tile. Subtrees and tiles are OpenMP tasks. The cut, the tiles and the order of all sums
!> depend on the structure alone, so the factor is the same to the bit on any number of threads. BLAS must be set to one
!> thread.
!>
!> Why not `cholmod_factorize`. With the same symbolic analysis (docs/speed.md has the figures,
!> benchmarks/factorization.py measures them) it takes 0.9 of this code's time for large solid bodies on one
!> thread, and up to twice its time for small and plane ones, whose fronts are small. Its digits depend on the number
!> of BLAS threads where one large body uses several. An interrupt ends this factorization within a second; CHOLMOD
!> has no way out. This code may go when a library does all of it: subtrees in parallel, the same digits on any number
!> of threads, a way out for interrupts, small fronts no slower. A unit test compares it with `cholmod_factorize`.
module dotyk_linalg_multifrontal
  use omp_lib, only: omp_in_parallel, omp_get_max_threads, omp_get_num_threads, omp_get_thread_num, omp_lock_kind, &
                     omp_init_lock, omp_destroy_lock, omp_set_lock, omp_unset_lock
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_progress, only: add_progress
  use dotyk_linalg_extend_add, only: add_to_ancestors, add_update, clear_lower
  use dotyk_linalg_fronts, only: factor_panel, must_stop, subtract_square, product_tile, tile_rows, tile_columns
  use dotyk_linalg_stack_plan, only: plan_stack
  use dotyk_linalg_supernodes, only: supernodes_t, supernode_tree_t, make_tree
  implicit none
  private
  public :: factor_supernodes

  !> Greatest work of a subtree, as a fraction of all work: small enough to keep some tens of threads equally busy.
  real(dp), parameter, public :: subtree_fraction = 1/256.0_dp
  !> A subtree of less work is not cut: about 10 ms of a core, a thousand times the cost of a task [operations].
  real(dp), parameter, public :: least_subtree_work = 3.0e8_dp

  !> A working stack.
  type :: stack_t
    !> Update matrices, at the positions of the plan.
    real(dp), allocatable :: x(:)
    !> Whether no subtree uses it.
    logical :: is_free = .true.
  end type stack_t

  !> State of a subtree.
  type :: subtree_t
    !> Number of the working stack.
    integer :: stack = 0
    !> Update matrix of the root, lower triangle packed by columns.
    real(dp), allocatable :: update(:)
    !> Whether the subtree is factorized.
    logical :: is_ready = .false.
    !> First column (from 1) whose pivot is not positive, 0 if there is none.
    integer :: failed = 0
  end type subtree_t

  !> State of a factorization.
  type :: factorization_t
    !> Structure and values of the factor.
    type(supernodes_t) :: supernodes
    !> Elimination tree, cut into subtrees and a top.
    type(supernode_tree_t) :: tree
    !> Position of the first entry of each column of the lower triangle of P K P^T, 0-based (0:order).
    integer(int64), pointer, contiguous :: start(:) => null()
    !> Row of each entry, 0-based (0:entries-1).
    integer(int64), pointer, contiguous :: row(:) => null()
    !> Value of each entry (0:entries-1).
    real(dp), pointer, contiguous :: value(:) => null()
    !> Row in the front at hand of each row of the matrix, for each thread (0:order-1, 0:threads-1).
    integer, allocatable :: map(:, :)
    !> Space for a product, for each thread (tile_rows*tile_columns, 0:threads-1).
    real(dp), allocatable :: tile(:, :)
    !> First entry of the update matrix of each supernode on the working stack of its subtree, from 0 (0:n-1).
    integer(int64), allocatable :: position(:)
    !> End of the stack that each update matrix lies at, see `plan_stack` (0:n-1).
    integer, allocatable :: side(:)
    !> Whether an interrupt ends the factorization.
    logical :: may_stop = .false.
    !> The subtrees (number of subtrees).
    type(subtree_t), allocatable :: subtree(:)
    !> Working stacks, of which hardly more than one a thread are allocated (number of subtrees).
    type(stack_t), allocatable :: stack(:)
    !> Subtree whose update matrix is added to the top next.
    integer :: next = 1
    !> Guards `next`, `is_ready` and `is_free`.
    integer(omp_lock_kind) :: lock
  end type factorization_t

contains

  !> Factorize.
  subroutine factor_supernodes(supernodes, start, row, value, failed, may_stop)
    !> Structure of the factor, with memory for its values.
    type(supernodes_t), intent(in) :: supernodes
    !> Position of the first entry of each column of the lower triangle of P K P^T, 0-based (order+1).
    integer(int64), pointer, contiguous, intent(in) :: start(:)
    !> Row of each entry, 0-based, in any order within a column (entries).
    integer(int64), pointer, contiguous, intent(in) :: row(:)
    !> Value of each entry (entries) [any].
    real(dp), pointer, contiguous, intent(in) :: value(:)
    !> First column (from 1) whose pivot is not positive, 0 if there is none.
    integer, intent(out) :: failed
    !> Whether an interrupt ends the factorization, with values that mean nothing; not if absent.
    logical, intent(in), optional :: may_stop
    type(factorization_t) :: self
    integer :: threads
    failed = 0
    if (present(may_stop)) self%may_stop = may_stop
    self%supernodes = supernodes
    self%start(0:) => start
    self%row(0:) => row
    self%value(0:) => value
    call make_tree(supernodes, subtree_fraction, least_subtree_work, self%tree)
    threads = omp_get_max_threads()
    if (omp_in_parallel()) threads = omp_get_num_threads()
    allocate (self%map(0:size(start) - 2, 0:threads - 1), self%tile(tile_rows*tile_columns, 0:threads - 1), &
              self%position(0:supernodes%n - 1), self%side(0:supernodes%n - 1), &
              self%subtree(size(self%tree%first)), self%stack(size(self%tree%first)))
    call omp_init_lock(self%lock)
    if (omp_in_parallel() .or. threads == 1 .or. size(self%tree%top) == 0) then
      call factor_all(self, failed)
    else
      !$omp parallel default(none) shared(self, failed)
      !$omp single
      call factor_all(self, failed)
      !$omp end single
      !$omp end parallel
    end if
    call omp_destroy_lock(self%lock)
  end subroutine factor_supernodes

  !> Factorize the subtrees, then the top. One thread calls this and makes tasks for the others.
  subroutine factor_all(self, failed)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> As in `factor_supernodes`.
    integer, intent(out) :: failed
    integer :: i, t
    do i = 1, size(self%tree%top)
      !$omp task default(none) shared(self) firstprivate(i)
      if (.not. must_stop(self%may_stop)) call assemble_panel(self, self%tree%top(i), self%supernodes%value)
      !$omp end task
    end do
    !$omp taskwait
    do t = 1, size(self%tree%first)
      !$omp task default(none) shared(self) firstprivate(t)
      call factor_subtree(self, t)
      call add_ready_subtrees(self, t)
      !$omp end task
    end do
    !$omp taskwait
    failed = 0
    if (any(self%subtree%failed > 0)) failed = minval(self%subtree%failed, mask=self%subtree%failed > 0)
    if (failed > 0) return
    do i = 1, size(self%tree%top)
      if (must_stop(self%may_stop)) return
      call factor_top(self, self%tree%top(i), self%supernodes%value, failed)
      if (failed > 0) return
      call add_progress(flops_of(self%supernodes%columns(self%tree%top(i)), self%supernodes%rows(self%tree%top(i))))
    end do
  end subroutine factor_all

  !> Operations of a supernode as CHOLMOD counts them: the sum of the squares of the entries of its columns.
  pure real(dp) function flops_of(columns, rows) result(flops)
    !> Columns of the supernode.
    integer, intent(in) :: columns
    !> Rows, those of the columns included.
    integer, intent(in) :: rows
    associate (c => real(columns, dp), r => real(rows, dp))
      flops = c*(r**2 - r*(c - 1) + (c - 1)*(2*c - 1)/6)
    end associate
  end function flops_of

  !> Fill the panel of a supernode with the entries of P K P^T.
  subroutine assemble_panel(self, s, x)
    !> The factorization; the map of this thread is that of the supernode's front on return.
    type(factorization_t), intent(inout) :: self
    !> The supernode.
    integer, intent(in) :: s
    !> Values of the factor (0:factor_entries-1) [as K, then its root].
    real(dp), intent(inout) :: x(0:*)
    integer :: rows, i, thread
    integer(int64) :: column, at, k
    rows = self%supernodes%rows(s)
    thread = omp_get_thread_num()
    do i = 0, rows - 1
      self%map(self%supernodes%row(self%supernodes%row_start(s) + i), thread) = i
    end do
    at = self%supernodes%value_start(s)
    x(at:at + int(rows, int64)*self%supernodes%columns(s) - 1) = 0
    do column = self%supernodes%column_start(s), self%supernodes%column_start(s + 1) - 1
      do k = self%start(column), self%start(column + 1) - 1
        x(at + self%map(self%row(k), thread)) = self%value(k)
      end do
      at = at + rows
    end do
  end subroutine assemble_panel

  !> Factorize a subtree, and keep the update matrix of its root.
  subroutine factor_subtree(self, t)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> Number of the subtree.
    integer, intent(in) :: t
    integer(int64) :: needed
    integer :: i, s
    call plan_stack(self%supernodes, self%tree, t, self%position, self%side, needed)
    call take_stack(self, needed, self%subtree(t)%stack)
    do i = self%tree%first(t), self%tree%last(t)
      s = self%tree%order(i)
      if (must_stop(self%may_stop)) exit
      call assemble_panel(self, s, self%supernodes%value)
      call factor_front(self, s, self%stack(self%subtree(t)%stack)%x, self%supernodes%value, self%subtree(t)%failed)
      if (self%subtree(t)%failed > 0) exit
      call add_progress(flops_of(self%supernodes%columns(s), self%supernodes%rows(s)))
    end do
    call keep_update(self, s, self%subtree(t))
  end subroutine factor_subtree

  !> Find a working stack that is free and long enough, or make one. The largest subtrees come first, and their stacks
  !> serve the others.
  subroutine take_stack(self, needed, stack)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> Length [entries].
    integer(int64), intent(in) :: needed
    !> Number of the stack.
    integer, intent(out) :: stack
    integer :: i
    call omp_set_lock(self%lock)
    do i = 1, size(self%stack)
      if (.not. self%stack(i)%is_free) cycle
      if (allocated(self%stack(i)%x)) then
        if (size(self%stack(i)%x, kind=int64) < needed) deallocate (self%stack(i)%x)
      end if
      exit
    end do
    self%stack(i)%is_free = .false.
    call omp_unset_lock(self%lock)
    stack = i
    if (.not. allocated(self%stack(i)%x)) allocate (self%stack(i)%x(needed + 1))
  end subroutine take_stack

  !> Copy the update matrix of the root of a subtree, and free the working stack. Nothing is copied where a pivot failed
  !> or an interrupt came.
  subroutine keep_update(self, s, subtree)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> Root of the subtree.
    integer, intent(in) :: s
    !> The subtree.
    type(subtree_t), intent(inout) :: subtree
    integer :: n, j
    integer(int64) :: from, to
    n = self%supernodes%rows(s) - self%supernodes%columns(s)
    if (subtree%failed > 0) n = 0
    if (must_stop(self%may_stop)) n = 0
    allocate (subtree%update(int(n, int64)*(n + 1)/2))
    from = self%position(s)
    to = 0
    do j = 1, n
      subtree%update(to + 1:to + n - j + 1) = self%stack(subtree%stack)%x(from + j:from + n)
      from = from + n
      to = to + n - j + 1
    end do
    call omp_set_lock(self%lock)
    self%stack(subtree%stack)%is_free = .true.
    call omp_unset_lock(self%lock)
  end subroutine keep_update

  !> Assemble a front from the update matrices of its children, eliminate its columns, and leave its update matrix on
  !> the stack.
  subroutine factor_front(self, s, stack, x, failed)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> The supernode; its panel holds the entries of P K P^T.
    integer, intent(in) :: s
    !> Working stack of the subtree (0:needed-1) [as K].
    real(dp), intent(inout) :: stack(0:*)
    !> Values of the factor (0:factor_entries-1) [as K, then its root].
    real(dp), intent(inout) :: x(0:*)
    !> First column (from 1) whose pivot is not positive, 0 if there is none.
    integer, intent(out) :: failed
    integer :: columns, rows, below, child, n, thread
    integer(int64) :: at, rows_at
    columns = self%supernodes%columns(s)
    rows = self%supernodes%rows(s)
    below = rows - columns
    at = self%supernodes%value_start(s)
    thread = omp_get_thread_num()
    call clear_lower(below, stack(self%position(s)))
    child = self%tree%first_child(s)
    do while (child >= 0)
      rows_at = self%supernodes%row_start(child) + self%supernodes%columns(child)
      n = int(self%supernodes%row_start(child + 1) - rows_at)
      associate (row => self%supernodes%row(rows_at:rows_at + n - 1))
        call add_update(n, self%map(row, thread), stack(self%position(child)), columns, rows, x(at), &
                        stack(self%position(s)))
      end associate
      child = self%tree%next_sibling(child)
    end do
    call factor_panel(rows, columns, x(at), .false., self%may_stop, failed)
    if (failed > 0) then
      failed = failed + int(self%supernodes%column_start(s))
    else if (below > 0) then
      call subtract_square(below, columns, x(at + columns), rows, stack(self%position(s)))
    end if
  end subroutine factor_front

  !> Mark a subtree as factorized, and add the update matrices of all subtrees whose turn has come to the top, always in
  !> the same order.
  subroutine add_ready_subtrees(self, t)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> Number of the subtree.
    integer, intent(in) :: t
    integer :: s, n
    integer(int64) :: rows_at
    call omp_set_lock(self%lock)
    self%subtree(t)%is_ready = .true.
    do while (self%next <= size(self%subtree))
      if (.not. self%subtree(self%next)%is_ready) exit
      associate (subtree => self%subtree(self%next))
        s = self%tree%order(self%tree%last(self%next))
        rows_at = self%supernodes%row_start(s) + self%supernodes%columns(s)
        n = int(self%supernodes%row_start(s + 1) - rows_at)
        if (must_stop(self%may_stop)) n = 0
        if (n > 0 .and. subtree%failed == 0) then
          associate (row => self%supernodes%row(rows_at:rows_at + n - 1))
            call add_to_ancestors(self%supernodes, self%tree%of_column, n, n, row, row, .true., .true., &
                                  subtree%update, self%supernodes%value)
          end associate
        end if
        if (allocated(subtree%update)) deallocate (subtree%update)
      end associate
      self%next = self%next + 1
    end do
    call omp_unset_lock(self%lock)
  end subroutine add_ready_subtrees

  !> Eliminate the columns of a supernode of the top, and subtract its products from its ancestors.
  subroutine factor_top(self, s, x, failed)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> The supernode.
    integer, intent(in) :: s
    !> Values of the factor (0:factor_entries-1) [as K, then its root].
    real(dp), intent(inout) :: x(0:*)
    !> First column (from 1) whose pivot is not positive, 0 if there is none.
    integer, intent(out) :: failed
    integer :: columns, rows, i, j
    integer(int64) :: at
    columns = self%supernodes%columns(s)
    rows = self%supernodes%rows(s)
    at = self%supernodes%value_start(s)
    call factor_panel(rows, columns, x(at), .true., self%may_stop, failed)
    if (failed > 0) then
      failed = failed + int(self%supernodes%column_start(s))
      return
    end if
    do j = columns, rows - 1, tile_columns
      !$omp task default(none) shared(self, x) firstprivate(s, j)
      call subtract_tile(self, s, j, j, tile_columns, x)
      !$omp end task
      do i = j + tile_columns, rows - 1, tile_rows
        !$omp task default(none) shared(self, x) firstprivate(s, i, j)
        call subtract_tile(self, s, i, j, tile_rows, x)
        !$omp end task
      end do
    end do
    !$omp taskwait
  end subroutine factor_top

  !> Subtract the product of two groups of rows of a supernode from its ancestors.
  subroutine subtract_tile(self, s, i, j, most_rows, x)
    !> The factorization.
    type(factorization_t), intent(inout) :: self
    !> The supernode.
    integer, intent(in) :: s
    !> First row of the first group, from 0.
    integer, intent(in) :: i
    !> First row of the second group, from 0; the groups are the same where i = j.
    integer, intent(in) :: j
    !> Most rows of the first group.
    integer, intent(in) :: most_rows
    !> Values of the factor (0:factor_entries-1) [as K, then its root].
    real(dp), intent(inout) :: x(0:*)
    integer :: rows, m, n
    integer(int64) :: at, rows_at
    rows = self%supernodes%rows(s)
    m = min(most_rows, rows - i)
    n = min(tile_columns, rows - j)
    if (must_stop(self%may_stop)) return
    at = self%supernodes%value_start(s)
    rows_at = self%supernodes%row_start(s)
    associate (tile => self%tile(:, omp_get_thread_num()), row => self%supernodes%row(rows_at:rows_at + rows - 1))
      call product_tile(m, n, self%supernodes%columns(s), x(at + i), x(at + j), rows, i == j, tile)
      call add_to_ancestors(self%supernodes, self%tree%of_column, m, n, row(i + 1:i + m), row(j + 1:j + n), i == j, &
                            .false., tile, x)
    end associate
  end subroutine subtract_tile
end module dotyk_linalg_multifrontal
