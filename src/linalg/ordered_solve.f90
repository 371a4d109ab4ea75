!> Solves of one right-hand side with a supernodal Cholesky factor, by all threads and with the same digits on any
!> number of them: the coarse level of p-multigrid, solved once in each cycle.
!>
!> The elimination tree is cut into subtrees and a top. Threads share the subtrees; what a subtree subtracts from the
!> top waits in an array of its own, and is added in the order of the subtrees. Threads share the rows of each supernode
!> of the top in chunks. Subtrees and chunks depend on the factor alone, and each product is one call of BLAS on one
!> thread.
module dotyk_linalg_ordered_solve
  use omp_lib, only: omp_in_parallel
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_sort, only: sort_order
  use dotyk_linalg_blas, only: blas_threads, dgemv, dtrsv, set_blas_threads
  use dotyk_linalg_cholesky, only: cholesky_t, supernodes_t
  use dotyk_linalg_forward_substitution, only: elimination_tree_t
  implicit none
  private

  type :: update_t  !! What a subtree subtracts from the top.
    integer, allocatable :: row(:)  !! Rows of L below its root (n).
    real(dp), allocatable :: value(:)  !! (n) [right-hand side].
  end type update_t

  type, public :: ordered_solve_t  !! A factor, ready for solves. It refers to the factor that it was made of.
    integer :: n = 0  !! Order of the matrix; 0 where there is no factor.
    type(supernodes_t), private :: list  !! The supernodes, in the memory of the factor.
    !> Supernodes of the subtrees, children before parents, one subtree after the other; they count from 0.
    integer, allocatable, private :: order(:)
    !> Position of the first supernode of each subtree in `order`; the last one is its root (number of subtrees + 1).
    integer, allocatable, private :: first(:)
    integer, allocatable, private :: top(:)  !! Supernodes of the top, children before parents.
    !> For each row of each supernode of a subtree: the row of L, or -i for row i below the root of the subtree
    !> (0:sum of the rows of all supernodes - 1).
    integer, allocatable, private :: place(:)
    integer, private :: most_rows = 0  !! Most rows of a supernode.
  contains
    procedure :: init => ordered_solve_init
    procedure :: solve => ordered_solve_solve
    procedure :: destroy => ordered_solve_destroy
  end type ordered_solve_t

  !> Greatest work of a subtree as a fraction of all work, and work that is not cut [operations].
  real(dp), parameter :: subtree_fraction = 1/64.0_dp, least_subtree_work = 1.0e8_dp
  integer, parameter :: panel_columns = 128  !! Columns of a panel.
  integer, parameter :: chunk_rows = 256  !! Rows of a chunk; backward substitution adds chunks in order.

contains

  !> Make ready for solves.
  subroutine ordered_solve_init(self, factor)
    class(ordered_solve_t), intent(inout) :: self
    type(cholesky_t), intent(in) :: factor  !! The factor, factorized; it stays where it is as long as this is used.
    integer :: s, t
    call self%destroy()
    if (.not. factor%is_factorized() .or. factor%n == 0) return
    self%n = factor%n
    call factor%supernodes(self%list)
    call cut_tree(self, factor)
    do s = 0, int(self%list%n) - 1
      self%most_rows = max(self%most_rows, self%list%rows(s))
    end do
    allocate (self%place(0:size(self%list%row, kind=int64) - 1))
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1)
    do t = 1, size(self%first) - 1
      call find_places(self, t)
    end do
    !$omp end parallel do
  end subroutine ordered_solve_init

  !> Cut the elimination tree into subtrees that are as large as allowed, and a top.
  subroutine cut_tree(self, factor)
    type(ordered_solve_t), intent(inout) :: self  !! The solve; gets subtrees and top.
    type(cholesky_t), intent(in) :: factor  !! As in `init`.
    type(elimination_tree_t) :: tree
    real(dp), allocatable :: work(:)  !! Of the subtree of each supernode [operations].
    integer, allocatable :: subtree(:), order(:)
    real(dp) :: own, below, most
    integer :: n, s, t
    call tree%init(factor)
    n = int(self%list%n)
    allocate (work(n), source=0.0_dp)
    do s = 1, n
      own = self%list%columns(s - 1)
      below = self%list%rows(s - 1) - own
      work(s) = work(s) + own**3/3 + own**2*below + own*below**2
      if (tree%parent(s) > 0) work(tree%parent(s)) = work(tree%parent(s)) + work(s)
    end do
    most = max(least_subtree_work, subtree_fraction*sum(work, mask=tree%parent == 0))
    self%top = pack([(s, s=0, n - 1)], work > most)
    ! Subtree of each supernode, 0 in the top: parents come after their children.
    allocate (subtree(0:n), source=0)
    t = 0
    do s = n, 1, -1
      if (work(s) > most) cycle
      subtree(s) = subtree(tree%parent(s))
      if (subtree(s) > 0) cycle
      t = t + 1
      subtree(s) = t
    end do
    allocate (self%first(t + 1), source=0)
    do s = 1, n
      self%first(subtree(s) + 1) = self%first(subtree(s) + 1) + 1
    end do
    self%first(1) = 1
    do t = 1, size(self%first) - 1
      self%first(t + 1) = self%first(t) + self%first(t + 1)
    end do
    allocate (order(n))
    call sort_order(subtree(1:), order)
    self%order = order(size(self%top) + 1:) - 1
  end subroutine cut_tree

  !> Places of the rows of a subtree.
  subroutine find_places(self, t)
    type(ordered_solve_t), intent(inout) :: self  !! The solve.
    integer, intent(in) :: t  !! The subtree.
    integer(int64) :: k, below, end_of_root
    integer :: i, s, root
    root = self%order(self%first(t + 1) - 1)
    end_of_root = self%list%column_start(root + 1)
    do i = self%first(t), self%first(t + 1) - 1
      s = self%order(i)
      ! Rows beyond the columns of the subtree are some of those below its root, ascending as these.
      below = self%list%row_start(root) + self%list%columns(root)
      do k = self%list%row_start(s), self%list%row_start(s + 1) - 1
        if (self%list%row(k) < end_of_root) then
          self%place(k) = int(self%list%row(k))
        else
          do while (self%list%row(below) < self%list%row(k))
            below = below + 1
          end do
          self%place(k) = -int(below - self%list%row_start(root)) - 1 + self%list%columns(root)
        end if
      end do
    end do
  end subroutine find_places

  !> x := K^{-1} x.
  subroutine ordered_solve_solve(self, x)
    class(ordered_solve_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Right-hand side [any], then solution (n) [that over K].
    type(update_t), allocatable :: update(:)
    real(dp), allocatable :: y(:), shared_front(:), front(:), part(:, :)
    integer :: i, t, n_parts, n_blas
    if (self%n == 0) return
    n_blas = 1
    if (.not. omp_in_parallel()) n_blas = blas_threads()
    if (n_blas > 1) call set_blas_threads(1)
    n_parts = (self%most_rows + chunk_rows - 1)/chunk_rows
    allocate (y(0:self%n - 1), update(size(self%first) - 1), shared_front(0:self%most_rows - 1), &
              part(panel_columns, n_parts))
    !$omp parallel default(none) shared(self, x, y, update, shared_front, part) private(front, i, t)
    allocate (front(0:self%most_rows - 1))
    !$omp do schedule(static)
    do i = 0, self%n - 1
      y(i) = x(self%list%permutation(i) + 1)
    end do
    !$omp end do
    !$omp do schedule(dynamic, 1)
    do t = 1, size(self%first) - 1
      call forward_subtree(self, t, front, y, update(t))
    end do
    !$omp end do
    !$omp single
    do t = 1, size(update)
      y(update(t)%row) = y(update(t)%row) + update(t)%value
    end do
    !$omp end single
    do i = 1, size(self%top)
      call forward_top(self, self%top(i), shared_front, y)
    end do
    do i = size(self%top), 1, -1
      call backward_top(self, self%top(i), shared_front, part, y)
    end do
    !$omp do schedule(dynamic, 1)
    do t = 1, size(self%first) - 1
      call backward_subtree(self, t, front, y)
    end do
    !$omp end do
    !$omp do schedule(static)
    do i = 0, self%n - 1
      x(self%list%permutation(i) + 1) = y(i)
    end do
    !$omp end do
    !$omp end parallel
    if (n_blas > 1) call set_blas_threads(n_blas)
  end subroutine ordered_solve_solve

  !> Forward substitution in a subtree.
  subroutine forward_subtree(self, t, front, y, update)
    type(ordered_solve_t), intent(in) :: self  !! The solve.
    integer, intent(in) :: t  !! The subtree.
    real(dp), intent(inout), contiguous :: front(0:)  !! Space for a front (0:most_rows - 1).
    real(dp), intent(inout), contiguous :: y(0:)  !! Right-hand side in the order of L, solved for (0:n - 1) [any].
    type(update_t), intent(inout) :: update  !! What the top gets.
    integer :: i, j, s, columns, rows, first
    integer(int64) :: k, at
    s = self%order(self%first(t + 1) - 1)
    update%row = int(self%list%row(self%list%row_start(s) + self%list%columns(s):self%list%row_start(s + 1) - 1))
    allocate (update%value(size(update%row)), source=0.0_dp)
    do i = self%first(t), self%first(t + 1) - 1
      s = self%order(i)
      columns = self%list%columns(s)
      rows = self%list%rows(s)
      first = int(self%list%column_start(s))
      at = self%list%value_start(s)
      call dtrsv('L', 'N', 'N', columns, self%list%value(at:), rows, y(first:), 1)
      if (rows == columns) cycle
      call dgemv('N', rows - columns, columns, -1.0_dp, self%list%value(at + columns:), rows, y(first:), 1, 0.0_dp, &
                 front(columns:), 1)
      k = self%list%row_start(s)
      do j = columns, rows - 1
        associate (place => self%place(k + j))
          if (place >= 0) then
            y(place) = y(place) + front(j)
          else
            update%value(-place) = update%value(-place) + front(j)
          end if
        end associate
      end do
    end do
  end subroutine forward_subtree

  !> Back substitution in a subtree; the top is solved.
  subroutine backward_subtree(self, t, front, y)
    type(ordered_solve_t), intent(in) :: self  !! The solve.
    integer, intent(in) :: t  !! The subtree.
    real(dp), intent(inout), contiguous :: front(0:)  !! Space for a front (0:most_rows - 1).
    real(dp), intent(inout), contiguous :: y(0:)  !! Solution in the order of L (0:n - 1) [any].
    integer :: i, s, columns, rows, first
    integer(int64) :: at
    do i = self%first(t + 1) - 1, self%first(t), -1
      s = self%order(i)
      columns = self%list%columns(s)
      rows = self%list%rows(s)
      first = int(self%list%column_start(s))
      at = self%list%value_start(s)
      if (rows > columns) then
        front(columns:rows - 1) = y(self%list%row(self%list%row_start(s) + columns:self%list%row_start(s + 1) - 1))
        call dgemv('T', rows - columns, columns, -1.0_dp, self%list%value(at + columns:), rows, front(columns:), 1, &
                   1.0_dp, y(first:), 1)
      end if
      call dtrsv('L', 'T', 'N', columns, self%list%value(at:), rows, y(first:), 1)
    end do
  end subroutine backward_subtree

  !> Forward substitution in a supernode of the top, by all threads of the team.
  subroutine forward_top(self, s, front, y)
    type(ordered_solve_t), intent(in) :: self  !! The solve.
    integer, intent(in) :: s  !! The supernode.
    real(dp), intent(inout), contiguous :: front(0:)  !! The front, shared (0:most_rows - 1).
    real(dp), intent(inout), contiguous :: y(0:)  !! Right-hand side in the order of L, shared (0:n - 1) [any].
    integer :: j, k, m, columns, rows, first
    integer(int64) :: at
    columns = self%list%columns(s)
    rows = self%list%rows(s)
    first = int(self%list%column_start(s))
    do j = 0, columns - 1, panel_columns
      m = min(panel_columns, columns - j)
      at = self%list%value_start(s) + j*(rows + 1_int64)
      !$omp single
      if (j == 0) then
        front(0:columns - 1) = y(first:first + columns - 1)
        front(columns:rows - 1) = 0
      end if
      call dtrsv('L', 'N', 'N', m, self%list%value(at:), rows, front(j:), 1)
      !$omp end single
      !$omp do schedule(static)
      do k = m, rows - j - 1, chunk_rows
        call dgemv('N', min(chunk_rows, rows - j - k), m, -1.0_dp, self%list%value(at + k:), rows, front(j:), 1, &
                   1.0_dp, front(j + k:), 1)
      end do
      !$omp end do
    end do
    !$omp single
    y(first:first + columns - 1) = front(0:columns - 1)
    associate (row => self%list%row(self%list%row_start(s) + columns:self%list%row_start(s + 1) - 1))
      y(row) = y(row) + front(columns:rows - 1)
    end associate
    !$omp end single
  end subroutine forward_top

  !> Back substitution in a supernode of the top, by all threads of the team.
  subroutine backward_top(self, s, front, part, y)
    type(ordered_solve_t), intent(in) :: self  !! The solve.
    integer, intent(in) :: s  !! The supernode.
    real(dp), intent(inout), contiguous :: front(0:)  !! The front, shared (0:most_rows - 1).
    real(dp), intent(inout), contiguous :: part(:, :)  !! Products of chunks of rows, shared (panel_columns, chunks).
    real(dp), intent(inout), contiguous :: y(0:)  !! Solution in the order of L, shared (0:n - 1) [any].
    integer :: j, k, m, columns, rows, first
    integer(int64) :: at
    columns = self%list%columns(s)
    rows = self%list%rows(s)
    first = int(self%list%column_start(s))
    !$omp single
    front(0:rows - 1) = y(self%list%row(self%list%row_start(s):self%list%row_start(s + 1) - 1))
    !$omp end single
    do j = panel_columns*((columns - 1)/panel_columns), 0, -panel_columns
      m = min(panel_columns, columns - j)
      at = self%list%value_start(s) + j*(rows + 1_int64)
      !$omp do schedule(static)
      do k = m, rows - j - 1, chunk_rows
        call dgemv('T', min(chunk_rows, rows - j - k), m, 1.0_dp, self%list%value(at + k:), rows, front(j + k:), 1, &
                   0.0_dp, part(:, 1 + k/chunk_rows), 1)
      end do
      !$omp end do
      !$omp single
      do k = m, rows - j - 1, chunk_rows
        front(j:j + m - 1) = front(j:j + m - 1) - part(:m, 1 + k/chunk_rows)
      end do
      call dtrsv('L', 'T', 'N', m, self%list%value(at:), rows, front(j:), 1)
      if (j == 0) y(first:first + columns - 1) = front(0:columns - 1)
      !$omp end single
    end do
  end subroutine backward_top

  !> Free the memory.
  subroutine ordered_solve_destroy(self)
    class(ordered_solve_t), intent(inout) :: self
    self%n = 0
    self%most_rows = 0
    if (allocated(self%place)) deallocate (self%place, self%first)
  end subroutine ordered_solve_destroy
end module dotyk_linalg_ordered_solve
