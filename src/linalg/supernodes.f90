!> The supernodes of a sparse Cholesky factor, and their elimination tree.
module dotyk_linalg_supernodes
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private
  public :: make_tree, diagonal_of, find_weakest_pivot

  !> The supernodes of a factor, in the memory of CHOLMOD: valid until the factor is analyzed again or destroyed. All
  !> numbers and positions are 0-based. Supernode s has the columns column_start(s)..column_start(s+1)-1 of L, and the
  !> rows row(row_start(s)..row_start(s+1)-1), ascending, its own columns first. Its values are a dense block by columns
  !> from value_start(s) on.
  type, public :: supernodes_t
    !> Number of supernodes.
    integer(int64) :: n = 0
    !> First column of each supernode (0:n).
    integer(int64), pointer, contiguous :: column_start(:) => null()
    !> Position of the first row of each supernode in `row` (0:n).
    integer(int64), pointer, contiguous :: row_start(:) => null()
    !> Position of the first value of each supernode in `value` (0:n).
    integer(int64), pointer, contiguous :: value_start(:) => null()
    !> Rows of the supernodes (0:sum of their rows - 1).
    integer(int64), pointer, contiguous :: row(:) => null()
    !> Equation of each row of L (0:order-1).
    integer(int64), pointer, contiguous :: permutation(:) => null()
    !> Values of L (0:factor_entries-1); not associated before the factorization.
    real(dp), pointer, contiguous :: value(:) => null()
  contains
    procedure :: columns => supernodes_columns
    procedure :: rows => supernodes_rows
    procedure :: work => supernodes_work
  end type supernodes_t

  !> An elimination tree of supernodes, cut into subtrees and a top. Subtree t has the supernodes
  !> order(first(t)..last(t)), children before parents. The supernodes of the top are top(:), children before parents
  !> too.
  type, public :: supernode_tree_t
    !> Supernode of the first row below the own columns; -1 at a root (0:n-1).
    integer, allocatable :: parent(:)
    !> First child of each supernode; -1 if there is none (0:n-1).
    integer, allocatable :: first_child(:)
    !> Next child of the same parent; -1 if there is none (0:n-1).
    integer, allocatable :: next_sibling(:)
    !> Supernode of each column (0:order-1).
    integer, allocatable :: of_column(:)
    !> Supernodes of the subtrees, one subtree after the other (number of supernodes in subtrees).
    integer, allocatable :: order(:)
    !> Position of the first supernode of each subtree in `order`; subtrees by falling work (number of subtrees).
    integer, allocatable :: first(:)
    !> Position of the last supernode of each subtree in `order`, its root (number of subtrees).
    integer, allocatable :: last(:)
    !> Supernodes of the top, ascending.
    integer, allocatable :: top(:)
  end type supernode_tree_t

contains

  !> Number of columns of a supernode.
  pure integer function supernodes_columns(self, s) result(columns)
    !> The supernodes.
    class(supernodes_t), intent(in) :: self
    !> Number of a supernode, from 0.
    integer, intent(in) :: s
    columns = int(self%column_start(s + 1) - self%column_start(s))
  end function supernodes_columns

  !> Number of rows of a supernode, those of its own columns included.
  pure integer function supernodes_rows(self, s) result(rows)
    !> The supernodes.
    class(supernodes_t), intent(in) :: self
    !> Number of a supernode, from 0.
    integer, intent(in) :: s
    rows = int(self%row_start(s + 1) - self%row_start(s))
  end function supernodes_rows

  !> Work of eliminating a supernode [floating-point operations].
  pure real(dp) function supernodes_work(self, s) result(work)
    !> The supernodes.
    class(supernodes_t), intent(in) :: self
    !> Number of a supernode, from 0.
    integer, intent(in) :: s
    real(dp) :: own, below
    own = self%columns(s)
    below = self%rows(s) - own
    work = own**3/3 + own**2*below + own*below**2
  end function supernodes_work

  !> Find the elimination tree, and cut it into subtrees that are as large as allowed, and a top.
  subroutine make_tree(supernodes, fraction, least_work, tree)
    !> The supernodes.
    type(supernodes_t), intent(in) :: supernodes
    !> Greatest work of a subtree, as a fraction of all work [].
    real(dp), intent(in) :: fraction
    !> Work that a subtree may have in any case [floating-point operations].
    real(dp), intent(in) :: least_work
    !> The tree.
    type(supernode_tree_t), intent(out) :: tree
    real(dp), allocatable :: work(:)
    real(dp) :: most
    integer :: n, s, p, n_roots, i
    integer, allocatable :: root(:)
    n = int(supernodes%n)
    call link(supernodes, tree)
    allocate (work(0:n - 1))
    work = 0
    do s = 0, n - 1
      work(s) = work(s) + supernodes%work(s)
      p = tree%parent(s)
      if (p >= 0) work(p) = work(p) + work(s)
    end do
    most = max(least_work, fraction*sum(pack(work, tree%parent < 0)))
    allocate (root(n), tree%top(count(work > most)), tree%order(n - count(work > most)))
    tree%top = pack([(s, s=0, n - 1)], work > most)
    n_roots = 0
    do s = n - 1, 0, -1
      if (work(s) > most) cycle
      p = tree%parent(s)
      if (p >= 0) then
        if (work(p) <= most) cycle
      end if
      i = n_roots
      do while (i > 0)
        if (work(root(i)) >= work(s)) exit
        root(i + 1) = root(i)
        i = i - 1
      end do
      root(i + 1) = s
      n_roots = n_roots + 1
    end do
    allocate (tree%first(n_roots), tree%last(n_roots))
    p = 0
    do i = 1, n_roots
      tree%first(i) = p + 1
      call postorder(root(i), tree, p)
      tree%last(i) = p
    end do
  end subroutine make_tree

  !> Find parents and children.
  subroutine link(supernodes, tree)
    !> The supernodes.
    type(supernodes_t), intent(in) :: supernodes
    !> The tree; `parent`, `first_child`, `next_sibling` and `of_column` are set.
    type(supernode_tree_t), intent(inout) :: tree
    integer :: n, s, p, columns
    n = int(supernodes%n)
    allocate (tree%of_column(0:int(supernodes%column_start(n)) - 1))
    allocate (tree%parent(0:n - 1), tree%first_child(0:n - 1), tree%next_sibling(0:n - 1), source=-1)
    do s = 0, n - 1
      tree%of_column(supernodes%column_start(s):supernodes%column_start(s + 1) - 1) = s
    end do
    do s = n - 1, 0, -1
      columns = supernodes%columns(s)
      if (supernodes%rows(s) == columns) cycle
      p = tree%of_column(supernodes%row(supernodes%row_start(s) + columns))
      tree%parent(s) = p
      tree%next_sibling(s) = tree%first_child(p)
      tree%first_child(p) = s
    end do
  end subroutine link

  !> Append a subtree to the order, children before parents.
  pure subroutine postorder(root, tree, n)
    !> Root of the subtree.
    integer, intent(in) :: root
    !> The tree; `order` grows.
    type(supernode_tree_t), intent(inout) :: tree
    !> Number of supernodes in the order.
    integer, intent(inout) :: n
    integer :: s
    s = deepest(root)
    do
      n = n + 1
      tree%order(n) = s
      if (s == root) exit
      if (tree%next_sibling(s) >= 0) then
        s = deepest(tree%next_sibling(s))
      else
        s = tree%parent(s)
      end if
    end do
  contains
    !> Leaf of a subtree that comes first in postorder.
    pure integer function deepest(from)
      !> Root of the subtree.
      integer, intent(in) :: from
      deepest = from
      do while (tree%first_child(deepest) >= 0)
        deepest = tree%first_child(deepest)
      end do
    end function deepest
  end subroutine postorder

  !> Diagonal of a sparse symmetric matrix.
  pure function diagonal_of(n, start, row, value) result(diagonal)
    !> Order.
    integer, intent(in) :: n
    !> Position of the first entry of each column of the lower triangle, 0-based (0:n).
    integer(int64), intent(in) :: start(0:n)
    !> Row of each entry, 0-based (0:entries-1).
    integer(int64), intent(in) :: row(0:*)
    !> Value of each entry (0:entries-1) [any].
    real(dp), intent(in) :: value(0:*)
    real(dp) :: diagonal(0:n - 1)
    integer :: j
    integer(int64) :: k
    diagonal = 0
    do j = 0, n - 1
      do k = start(j), start(j + 1) - 1
        if (row(k) == j) diagonal(j) = value(k)
      end do
    end do
  end function diagonal_of

  !> Find the pivot that is the smallest fraction of its diagonal entry. If a pivot is not positive or not a number, the
  !> first such one is reported with fraction 0.
  pure subroutine find_weakest_pivot(supernodes, diagonal, weakest, equation)
    !> The factor, with values.
    type(supernodes_t), intent(in) :: supernodes
    !> Diagonal of P K P^T (0:order-1) [as K].
    real(dp), intent(in) :: diagonal(0:)
    !> Pivot over diagonal entry, 0 to 1 [].
    real(dp), intent(out) :: weakest
    !> Equation of that pivot, from 1.
    integer, intent(out) :: equation
    integer :: s, rows
    integer(int64) :: k, at
    real(dp) :: fraction
    weakest = 1
    equation = 0
    do s = 0, int(supernodes%n) - 1
      rows = supernodes%rows(s)
      at = supernodes%value_start(s)
      do k = supernodes%column_start(s), supernodes%column_start(s + 1) - 1
        fraction = supernodes%value(at)**2/diagonal(k)
        if (.not. fraction > 0) then ! NaN too: LAPACK does not always see it
          weakest = 0
          equation = int(supernodes%permutation(k)) + 1
          return
        end if
        if (fraction < weakest .or. equation == 0) then
          weakest = fraction
          equation = int(supernodes%permutation(k)) + 1
        end if
        at = at + rows + 1
      end do
    end do
  end subroutine find_weakest_pivot
end module dotyk_linalg_supernodes
