!> Solves of one right-hand side with a supernodal Cholesky factor, by all threads and with the same digits on any
!> number of them: the coarse level of p-multigrid, solved once in each cycle.
!>
!> The elimination tree is cut into subtrees and a top, as for the factorization (`dotyk_linalg_supernodes`). Threads
!> share the subtrees; what a subtree subtracts from the top waits in an array of its own, and is added in the order of
!> the subtrees. Threads share the rows of each supernode of the top.
module dotyk_linalg_ordered_solve
  use, intrinsic :: iso_c_binding, only: c_double, c_int64_t
  use omp_lib, only: omp_get_num_threads, omp_get_thread_num
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_supernodes, only: make_tree, supernode_tree_t, supernodes_t
  implicit none
  private

  !> What a subtree subtracts from the top.
  type :: update_t
    !> Rows of L below its root (n).
    integer, allocatable :: row(:)
    !> (n) [right-hand side].
    real(dp), allocatable :: value(:)
  end type update_t

  !> A factor, ready for solves. It refers to the factor that it was made of.
  type, public :: ordered_solve_t
    !> Order of the matrix; 0 where there is no factor.
    integer :: n = 0
    !> The supernodes, in the memory of the factor.
    type(supernodes_t), private :: list
    !> Their tree.
    type(supernode_tree_t), private :: tree
    !> For each row of each supernode of a subtree: the row of L, or -i for row i below the root of the subtree
    !> (0:sum of the rows of all supernodes - 1).
    integer, allocatable, private :: place(:)
    !> Most rows of a supernode.
    integer, private :: most_rows = 0
  contains
    procedure :: init => ordered_solve_init
    procedure :: solve => ordered_solve_solve
    procedure :: destroy => ordered_solve_destroy
  end type ordered_solve_t

  !> Greatest work of a subtree as a fraction of all work, and work that is not cut [operations].
  real(dp), parameter :: subtree_fraction = 1/64.0_dp, least_subtree_work = 1.0e8_dp
  !> Columns of a panel.
  integer, parameter :: panel_columns = 128
  !> Rows in one sum of products; sums are added in their order.
  integer, parameter :: chunk_rows = 1024

  interface
    !> x := L^{-1} x with the lower triangle of m columns.
    subroutine dotyk_panel_solve(m, lead, l, x) bind(c)
      import :: c_double, c_int64_t
      !> Columns.
      integer(c_int64_t), value :: m
      !> Distance of columns.
      integer(c_int64_t), value :: lead
      !> The panel, from its diagonal on (lead, m) [any].
      real(c_double), intent(in) :: l(*)
      !> (m) [any].
      real(c_double), intent(inout) :: x(*)
    end subroutine dotyk_panel_solve

    !> x := L^{-T} x with the lower triangle of m columns.
    subroutine dotyk_panel_solve_back(m, lead, l, x) bind(c)
      import :: c_double, c_int64_t
      !> Columns.
      integer(c_int64_t), value :: m
      !> Distance of columns.
      integer(c_int64_t), value :: lead
      !> The panel, from its diagonal on (lead, m) [any].
      real(c_double), intent(in) :: l(*)
      !> (m) [any].
      real(c_double), intent(inout) :: x(*)
    end subroutine dotyk_panel_solve_back

    !> y := y - L x for the rows first to last - 1 of m columns.
    subroutine dotyk_panel_subtract(m, lead, l, x, first, last, y) bind(c)
      import :: c_double, c_int64_t
      !> Columns.
      integer(c_int64_t), value :: m
      !> Distance of columns.
      integer(c_int64_t), value :: lead
      !> The panel, from its diagonal on (lead, m) [any].
      real(c_double), intent(in) :: l(*)
      !> (m) [any].
      real(c_double), intent(in) :: x(*)
      !> First row, from 0.
      integer(c_int64_t), value :: first
      !> One beyond the last row, from 0.
      integer(c_int64_t), value :: last
      !> From row 0 on [L x].
      real(c_double), intent(inout) :: y(*)
    end subroutine dotyk_panel_subtract

    !> s = L^T y over the rows first to last - 1 of m columns.
    subroutine dotyk_panel_products(m, lead, l, first, last, y, s) bind(c)
      import :: c_double, c_int64_t
      !> Columns.
      integer(c_int64_t), value :: m
      !> Distance of columns.
      integer(c_int64_t), value :: lead
      !> The panel, from its diagonal on (lead, m) [any].
      real(c_double), intent(in) :: l(*)
      !> First row, from 0.
      integer(c_int64_t), value :: first
      !> One beyond the last row, from 0.
      integer(c_int64_t), value :: last
      !> From row 0 on [any].
      real(c_double), intent(in) :: y(*)
      !> (m) [L y].
      real(c_double), intent(inout) :: s(*)
    end subroutine dotyk_panel_products
  end interface

contains

  !> Make ready for solves.
  subroutine ordered_solve_init(self, factor)
    class(ordered_solve_t), intent(inout) :: self
    !> The factor, factorized; it stays where it is as long as this is used.
    type(cholesky_t), intent(in) :: factor
    integer :: s, t
    call self%destroy()
    if (.not. factor%is_factorized() .or. factor%n == 0) return
    self%n = factor%n
    call factor%supernodes(self%list)
    call make_tree(self%list, subtree_fraction, least_subtree_work, self%tree)
    do s = 0, int(self%list%n) - 1
      self%most_rows = max(self%most_rows, self%list%rows(s))
    end do
    allocate (self%place(0:size(self%list%row, kind=int64) - 1))
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1)
    do t = 1, size(self%tree%first)
      call find_places(self, t)
    end do
    !$omp end parallel do
  end subroutine ordered_solve_init

  !> Places of the rows of a subtree.
  subroutine find_places(self, t)
    !> The solve.
    type(ordered_solve_t), intent(inout) :: self
    !> The subtree.
    integer, intent(in) :: t
    integer(int64) :: k, below, end_of_root
    integer :: i, s, root
    root = self%tree%order(self%tree%last(t))
    end_of_root = self%list%column_start(root + 1)
    do i = self%tree%first(t), self%tree%last(t)
      s = self%tree%order(i)
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
    !> Right-hand side [any], then solution (n) [that over K].
    real(dp), intent(inout) :: x(:)
    type(update_t), allocatable :: update(:)
    real(dp), allocatable :: y(:), shared_front(:), front(:), part(:, :)
    integer :: i, t, n_parts
    if (self%n == 0) return
    n_parts = (self%most_rows + chunk_rows - 1)/chunk_rows
    allocate (y(0:self%n - 1), update(size(self%tree%first)), shared_front(0:self%most_rows - 1), &
              part(panel_columns, n_parts))
    !$omp parallel default(none) shared(self, x, y, update, shared_front, part) private(front, i, t)
    allocate (front(0:self%most_rows - 1))
    !$omp do schedule(static)
    do i = 0, self%n - 1
      y(i) = x(self%list%permutation(i) + 1)
    end do
    !$omp end do
    !$omp do schedule(dynamic, 1)
    do t = 1, size(self%tree%first)
      call forward_subtree(self, t, front, y, update(t))
    end do
    !$omp end do
    !$omp single
    do t = 1, size(update)
      y(update(t)%row) = y(update(t)%row) + update(t)%value
    end do
    !$omp end single
    do i = 1, size(self%tree%top)
      call forward_top(self, self%tree%top(i), shared_front, y)
    end do
    do i = size(self%tree%top), 1, -1
      call backward_top(self, self%tree%top(i), shared_front, part, y)
    end do
    !$omp do schedule(dynamic, 1)
    do t = 1, size(self%tree%first)
      call backward_subtree(self, t, front, y)
    end do
    !$omp end do
    !$omp do schedule(static)
    do i = 0, self%n - 1
      x(self%list%permutation(i) + 1) = y(i)
    end do
    !$omp end do
    !$omp end parallel
  end subroutine ordered_solve_solve

  !> Forward substitution in a subtree.
  subroutine forward_subtree(self, t, front, y, update)
    !> The solve.
    type(ordered_solve_t), intent(in) :: self
    !> The subtree.
    integer, intent(in) :: t
    !> Space for a front (0:most_rows - 1).
    real(dp), intent(inout) :: front(0:)
    !> Right-hand side in the order of L, solved for the columns of the subtree on return (0:n - 1) [any].
    real(dp), intent(inout) :: y(0:)
    !> What the top gets.
    type(update_t), intent(inout) :: update
    integer :: i, j, s, columns, rows, first
    integer(int64) :: k, at
    s = self%tree%order(self%tree%last(t))
    update%row = int(self%list%row(self%list%row_start(s) + self%list%columns(s):self%list%row_start(s + 1) - 1))
    allocate (update%value(size(update%row)), source=0.0_dp)
    do i = self%tree%first(t), self%tree%last(t)
      s = self%tree%order(i)
      columns = self%list%columns(s)
      rows = self%list%rows(s)
      first = int(self%list%column_start(s))
      front(0:columns - 1) = y(first:first + columns - 1)
      front(columns:rows - 1) = 0
      do j = 0, columns - 1, panel_columns
        associate (m => int(min(panel_columns, columns - j), int64), lead => int(rows, int64))
          at = self%list%value_start(s) + j*(lead + 1)
          call dotyk_panel_solve(m, lead, self%list%value(at:), front(j:))
          call dotyk_panel_subtract(m, lead, self%list%value(at:), front(j:), m, lead - j, front(j:))
        end associate
      end do
      y(first:first + columns - 1) = front(0:columns - 1)
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
    !> The solve.
    type(ordered_solve_t), intent(in) :: self
    !> The subtree.
    integer, intent(in) :: t
    !> Space for a front (0:most_rows - 1).
    real(dp), intent(inout) :: front(0:)
    !> Solution in the order of L (0:n - 1) [any].
    real(dp), intent(inout) :: y(0:)
    integer :: i, j, s, columns, rows, first
    integer(int64) :: at
    real(dp) :: part(panel_columns)
    do i = self%tree%last(t), self%tree%first(t), -1
      s = self%tree%order(i)
      columns = self%list%columns(s)
      rows = self%list%rows(s)
      first = int(self%list%column_start(s))
      front(0:rows - 1) = y(self%list%row(self%list%row_start(s):self%list%row_start(s + 1) - 1))
      do j = panel_columns*((columns - 1)/panel_columns), 0, -panel_columns
        associate (m => int(min(panel_columns, columns - j), int64), lead => int(rows, int64))
          at = self%list%value_start(s) + j*(lead + 1)
          if (lead - j > m) then
            call dotyk_panel_products(m, lead, self%list%value(at:), m, lead - j, front(j:), part)
            front(j:j + m - 1) = front(j:j + m - 1) - part(:m)
          end if
          call dotyk_panel_solve_back(m, lead, self%list%value(at:), front(j:))
        end associate
      end do
      y(first:first + columns - 1) = front(0:columns - 1)
    end do
  end subroutine backward_subtree

  !> Forward substitution in a supernode of the top, by all threads of the team.
  subroutine forward_top(self, s, front, y)
    !> The solve.
    type(ordered_solve_t), intent(in) :: self
    !> The supernode.
    integer, intent(in) :: s
    !> The front, shared (0:most_rows - 1).
    real(dp), intent(inout) :: front(0:)
    !> Right-hand side in the order of L, shared (0:n - 1) [any].
    real(dp), intent(inout) :: y(0:)
    integer :: j, columns, rows, first, thread, threads
    integer(int64) :: at, m, lead, below
    columns = self%list%columns(s)
    rows = self%list%rows(s)
    first = int(self%list%column_start(s))
    lead = rows
    thread = omp_get_thread_num()
    threads = omp_get_num_threads()
    do j = 0, columns - 1, panel_columns
      m = min(panel_columns, columns - j)
      at = self%list%value_start(s) + j*(lead + 1)
      !$omp single
      if (j == 0) then
        front(0:columns - 1) = y(first:first + columns - 1)
        front(columns:rows - 1) = 0
      end if
      call dotyk_panel_solve(m, lead, self%list%value(at:), front(j:))
      !$omp end single
      below = lead - j - m
      call dotyk_panel_subtract(m, lead, self%list%value(at:), front(j:), m + below*thread/threads, &
                                m + below*(thread + 1)/threads, front(j:))
      !$omp barrier
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
    !> The solve.
    type(ordered_solve_t), intent(in) :: self
    !> The supernode.
    integer, intent(in) :: s
    !> The front, shared (0:most_rows - 1).
    real(dp), intent(inout) :: front(0:)
    !> Products of chunks of rows, shared (panel_columns, chunks).
    real(dp), intent(inout) :: part(:, :)
    !> Solution in the order of L, shared (0:n - 1) [any].
    real(dp), intent(inout) :: y(0:)
    integer :: j, k, columns, rows, first
    integer(int64) :: at, m, lead
    columns = self%list%columns(s)
    rows = self%list%rows(s)
    first = int(self%list%column_start(s))
    lead = rows
    !$omp single
    front(0:rows - 1) = y(self%list%row(self%list%row_start(s):self%list%row_start(s + 1) - 1))
    !$omp end single
    do j = panel_columns*((columns - 1)/panel_columns), 0, -panel_columns
      m = min(panel_columns, columns - j)
      at = self%list%value_start(s) + j*(lead + 1)
      !$omp do schedule(static)
      do k = 1, int((lead - j - m + chunk_rows - 1)/chunk_rows)
        call dotyk_panel_products(m, lead, self%list%value(at:), m + int(k - 1, int64)*chunk_rows, &
                                  min(lead - j, m + int(k, int64)*chunk_rows), front(j:), part(:, k))
      end do
      !$omp end do
      !$omp single
      do k = 1, int((lead - j - m + chunk_rows - 1)/chunk_rows)
        front(j:j + m - 1) = front(j:j + m - 1) - part(:m, k)
      end do
      call dotyk_panel_solve_back(m, lead, self%list%value(at:), front(j:))
      if (j == 0) y(first:first + columns - 1) = front(0:columns - 1)
      !$omp end single
    end do
  end subroutine backward_top

  !> Free the memory.
  subroutine ordered_solve_destroy(self)
    class(ordered_solve_t), intent(inout) :: self
    self%n = 0
    self%most_rows = 0
    if (allocated(self%place)) deallocate (self%place)
  end subroutine ordered_solve_destroy
end module dotyk_linalg_ordered_solve
