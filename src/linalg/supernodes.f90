!> The supernodes of a sparse Cholesky factor, and the tree that they are eliminated along.
module dotyk_linalg_supernodes
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private
  public :: make_tree, diagonal_of, find_weakest_pivot

  !> The supernodes of a factor where CHOLMOD keeps them, as long as the factor is neither analyzed again nor destroyed.
  !> All numbers and places are 0-based. Supernode s has the columns column_start(s)..column_start(s+1)-1 in the order of
  !> elimination, the rows row(row_start(s)..row_start(s+1)-1), ascending, its own columns first, and the values from
  !> value_start(s) on, a dense block by columns.
  type, public :: supernodes_t
    !> Number of supernodes.
    integer(int64) :: n = 0
    !> (0:n)
    integer(int64), pointer, contiguous :: column_start(:) => null(), row_start(:) => null(), value_start(:) => null()
    !> (0:number of rows - 1)
    integer(int64), pointer, contiguous :: row(:) => null()
    !> The equation that comes k-th (0:order - 1).
    integer(int64), pointer, contiguous :: permutation(:) => null()
    !> (0:factor_entries - 1); not associated before the factorization.
    real(dp), pointer, contiguous :: value(:) => null()
  contains
    procedure :: columns => supernodes_columns
    procedure :: rows => supernodes_rows
    procedure :: work => supernodes_work
  end type supernodes_t

  !> A tree of supernodes cut into subtrees and a top. Subtree t has the supernodes order(first(t)..last(t)), children before
  !> parents; those of the top are top(:), likewise.
  type, public :: supernode_tree_t
    !> Supernode that the first row below a supernode belongs to; -1 at a root (0:n-1).
    integer, allocatable :: parent(:)
    !> Children, linked: first_child(s) and next_sibling(s), -1 where there are no more (0:n-1).
    integer, allocatable :: first_child(:), next_sibling(:)
    !> Supernode of each column (0:order-1).
    integer, allocatable :: of_column(:)
    !> Supernodes, subtree after subtree.
    integer, allocatable :: order(:)
    !> Where each subtree is in `order`; the one with the most work first.
    integer, allocatable :: first(:), last(:)
    !> Supernodes that belong to no subtree, ascending.
    integer, allocatable :: top(:)
  end type supernode_tree_t

contains

  !> Columns of a supernode.
  pure integer function supernodes_columns(self, s) result(columns)
    class(supernodes_t), intent(in) :: self
    integer, intent(in) :: s
    columns = int(self%column_start(s + 1) - self%column_start(s))
  end function supernodes_columns

  !> Rows of a supernode, its own columns' among them.
  pure integer function supernodes_rows(self, s) result(rows)
    class(supernodes_t), intent(in) :: self
    integer, intent(in) :: s
    rows = int(self%row_start(s + 1) - self%row_start(s))
  end function supernodes_rows

  !> Operations that eliminate a supernode.
  pure real(dp) function supernodes_work(self, s) result(work)
    class(supernodes_t), intent(in) :: self
    integer, intent(in) :: s
    real(dp) :: own, below
    own = self%columns(s)
    below = self%rows(s) - own
    work = own**3/3 + own**2*below + own*below**2
  end function supernodes_work

  !> Cut the tree where no subtree has more than a share of all the work.
  subroutine make_tree(supernodes, share, least_work, tree)
    type(supernodes_t), intent(in) :: supernodes
    !> Most work of a subtree, as a part of all, and what it may have in any case.
    real(dp), intent(in) :: share, least_work
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
    most = max(least_work, share*sum(pack(work, tree%parent < 0)))
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

  !> Parents and children.
  subroutine link(supernodes, tree)
    type(supernodes_t), intent(in) :: supernodes
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
    integer, intent(in) :: root
    type(supernode_tree_t), intent(inout) :: tree
    !> Entries of the order.
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
    !> First descendant without children, always along first children.
    pure integer function deepest(from)
      integer, intent(in) :: from
      deepest = from
      do while (tree%first_child(deepest) >= 0)
        deepest = tree%first_child(deepest)
      end do
    end function deepest
  end subroutine postorder

  !> Diagonal of a matrix by columns, 0-based.
  pure function diagonal_of(n, start, row, value) result(diagonal)
    integer, intent(in) :: n
    integer(int64), intent(in) :: start(0:n), row(0:*)
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

  !> The pivot that is the least part of its diagonal entry; if one is not positive or not a number, the first such one, with
  !> part 0.
  pure subroutine find_weakest_pivot(supernodes, diagonal, weakest, equation)
    type(supernodes_t), intent(in) :: supernodes
    !> Of the matrix, in the order of elimination (0:order-1).
    real(dp), intent(in) :: diagonal(0:)
    real(dp), intent(out) :: weakest
    !> Its equation.
    integer, intent(out) :: equation
    integer :: s, rows
    integer(int64) :: k, at
    real(dp) :: part
    weakest = 1
    equation = 0
    do s = 0, int(supernodes%n) - 1
      rows = supernodes%rows(s)
      at = supernodes%value_start(s)
      do k = supernodes%column_start(s), supernodes%column_start(s + 1) - 1
        part = supernodes%value(at)**2/diagonal(k)
        if (.not. part > 0) then ! NaN too: LAPACK does not always see it
          weakest = 0
          equation = int(supernodes%permutation(k)) + 1
          return
        end if
        if (part < weakest .or. equation == 0) then
          weakest = part
          equation = int(supernodes%permutation(k)) + 1
        end if
        at = at + rows + 1
      end do
    end do
  end subroutine find_weakest_pivot
end module dotyk_linalg_supernodes
