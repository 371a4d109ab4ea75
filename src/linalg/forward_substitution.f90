!> Forward substitution with sparse right-hand sides: y = L^{-1} P b, so that b^T K^{-1} b' = y^T y'.
!>
!> The nonzeros of y lie on the elimination-tree paths from the nonzeros of b to the root (the reach of b: J. R. Gilbert
!> and T. Peierls, SIAM J. Sci. Stat. Comput. 9, 1988). Each supernode holds a dense block with the right-hand sides
!> whose reach contains the supernode, and no others. The cost is that of eliminating as many further rows of the
!> matrix, a small part of a full solve, at the rate of dense products.
module dotyk_linalg_forward_substitution
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm, transposed_product
  use dotyk_linalg_cholesky, only: cholesky_t, supernodes_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  implicit none
  private
  public :: forward_product

  type, public :: elimination_tree_t  !! The elimination tree of the supernodes; they count from 1 here.
    type(supernodes_t) :: list  !! Supernodes of the factor, in its memory.
    integer, allocatable :: parent(:)  !! Parent of each supernode, 0 at a root (n).
    integer, allocatable :: row_of(:)  !! Row of L for each equation, from 0 (order).
    integer, allocatable :: supernode_of(:)  !! Supernode of each row of L (0:order-1).
    integer(int64), allocatable :: path_entries_of(:)  !! Entries of L on the path from each supernode to its root (n).
  contains
    procedure :: init => tree_init
    procedure :: path_entries => tree_path_entries
  end type elimination_tree_t

  type, public :: forward_solution_t  !! Solutions of L y = P b for some right-hand sides, supernode by supernode.
    integer :: n = 0  !! Number of right-hand sides.
    integer, allocatable :: supernode(:)  !! Supernodes in the reach of a right-hand side, ascending (n_supernodes).
    integer, allocatable :: first_column(:)  !! First right-hand side of each in `column` (n_supernodes + 1).
    integer, allocatable :: column(:)  !! Right-hand sides that reach each of them, ascending.
    integer(int64), allocatable :: first_value(:)  !! First value of each of them in `value` (n_supernodes + 1).
    !> Values of each of them: a block (own columns of the supernode, right-hand sides that reach it).
    real(dp), allocatable :: value(:)
  contains
    procedure :: init => forward_init
  end type forward_solution_t

contains

  !> Find the elimination tree of a factor.
  subroutine tree_init(self, factor)
    class(elimination_tree_t), intent(out) :: self
    type(cholesky_t), intent(in) :: factor  !! Analyzed. The tree is valid as long as the factor is.
    integer(int64) :: k, s, own
    integer :: n
    call factor%supernodes(self%list)
    n = int(self%list%n)
    allocate (self%parent(n), self%row_of(factor%n), self%supernode_of(0:factor%n - 1), self%path_entries_of(n))
    associate (list => self%list)
      do k = 0, factor%n - 1
        self%row_of(list%permutation(k) + 1) = int(k)
      end do
      do s = 0, n - 1
        self%supernode_of(list%column_start(s):list%column_start(s + 1) - 1) = int(s) + 1
      end do
      do s = n - 1, 0, -1
        own = list%column_start(s + 1) - list%column_start(s)
        self%parent(s + 1) = 0
        self%path_entries_of(s + 1) = own*(list%row_start(s + 1) - list%row_start(s))
        if (list%row_start(s) + own == list%row_start(s + 1)) cycle
        self%parent(s + 1) = self%supernode_of(list%row(list%row_start(s) + own))
        self%path_entries_of(s + 1) = self%path_entries_of(s + 1) + self%path_entries_of(self%parent(s + 1))
      end do
    end associate
  end subroutine tree_init

  !> Mean number of entries of L on the elimination-tree path of one equation.
  real(dp) function tree_path_entries(self, equation) result(entries)
    class(elimination_tree_t), intent(in) :: self
    integer, intent(in) :: equation(:)  !! Equations (any number).
    integer :: i
    entries = 0
    do i = 1, size(equation)
      entries = entries + real(self%path_entries_of(self%supernode_of(self%row_of(equation(i)))), dp)
    end do
    if (size(equation) > 0) entries = entries/size(equation)
  end function tree_path_entries

  !> Solve L y = P b.
  subroutine forward_init(self, tree, rhs)
    class(forward_solution_t), intent(out) :: self
    type(elimination_tree_t), intent(in) :: tree  !! Elimination tree of a factorized matrix.
    type(sparse_rows_t), intent(in) :: rhs  !! Right-hand sides b as rows; columns are equations.
    integer, allocatable :: number(:)
    integer :: k
    self%n = rhs%n_rows
    allocate (number(size(tree%parent)))
    call find_columns(self, tree, rhs, number)
    call place_values(self, tree, rhs, number)
    do k = 1, size(self%supernode)
      call eliminate(self, tree, number, k)
    end do
  end subroutine forward_init

  !> Find the reach of every right-hand side, and allocate the values.
  subroutine find_columns(self, tree, rhs, number)
    type(forward_solution_t), intent(inout) :: self  !! The solutions on the way.
    type(elimination_tree_t), intent(in) :: tree  !! Elimination tree.
    type(sparse_rows_t), intent(in) :: rhs  !! Right-hand sides as rows.
    integer, intent(out) :: number(:)  !! Position in self%supernode, 0: in no reach (n of supernodes).
    integer, allocatable :: next(:), last(:)
    integer :: pass, j, k, s, n
    integer(int64) :: own
    allocate (last(size(number)))
    number = 0
    do pass = 1, 2
      last = 0
      do j = 1, rhs%n_rows
        do k = rhs%row_start(j), rhs%row_start(j + 1) - 1
          s = tree%supernode_of(tree%row_of(rhs%column(k)))
          do while (s > 0)
            if (last(s) == j) exit
            last(s) = j
            if (pass == 1) then
              number(s) = number(s) + 1
            else
              self%column(next(number(s))) = j
              next(number(s)) = next(number(s)) + 1
            end if
            s = tree%parent(s)
          end do
        end do
      end do
      if (pass == 2) exit
      self%supernode = pack([(s, s=1, size(number))], number > 0)
      n = size(self%supernode)
      allocate (self%first_column(n + 1), self%first_value(n + 1))
      self%first_column(1) = 1
      self%first_value(1) = 1
      do k = 1, n
        s = self%supernode(k)
        own = tree%list%column_start(s) - tree%list%column_start(s - 1)
        self%first_column(k + 1) = self%first_column(k) + number(s)
        self%first_value(k + 1) = self%first_value(k) + own*number(s)
        number(s) = k
      end do
      next = self%first_column(:n)
      allocate (self%column(self%first_column(n + 1) - 1), self%value(self%first_value(n + 1) - 1))
    end do
  end subroutine find_columns

  !> Put the right-hand sides into the values.
  subroutine place_values(self, tree, rhs, number)
    type(forward_solution_t), intent(inout) :: self  !! The solutions on the way.
    type(elimination_tree_t), intent(in) :: tree  !! Elimination tree.
    type(sparse_rows_t), intent(in) :: rhs  !! Right-hand sides as rows.
    integer, intent(in) :: number(:)  !! Position of each supernode, as from `find_columns` (number of supernodes).
    integer :: j, k, m, s, column
    integer(int64) :: own, at
    self%value = 0
    do j = 1, rhs%n_rows
      do k = rhs%row_start(j), rhs%row_start(j + 1) - 1
        s = tree%supernode_of(tree%row_of(rhs%column(k)))
        m = number(s)
        own = tree%list%column_start(s) - tree%list%column_start(s - 1)
        column = position(j, self%column(self%first_column(m):self%first_column(m + 1) - 1))
        at = self%first_value(m) + (column - 1)*own + tree%row_of(rhs%column(k)) - tree%list%column_start(s - 1)
        self%value(at) = self%value(at) + rhs%value(k)
      end do
    end do
  end subroutine place_values

  !> Position of a number in an ascending list that contains it.
  pure integer function position(number, list)
    integer, intent(in) :: number  !! The number.
    integer, intent(in) :: list(:)  !! The list (any length).
    integer :: low, high, middle
    low = 1
    high = size(list)
    do while (low < high)
      middle = (low + high)/2
      if (list(middle) < number) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    position = low
  end function position

  !> Solve with the diagonal block of a supernode, and subtract its contribution from its ancestors.
  subroutine eliminate(self, tree, number, k)
    type(forward_solution_t), intent(inout) :: self  !! The solutions on the way.
    type(elimination_tree_t), intent(in) :: tree  !! Elimination tree.
    integer, intent(in) :: number(:)  !! Position of each supernode, as from `find_columns` (number of supernodes).
    integer, intent(in) :: k  !! Position of the supernode in self%supernode.
    real(dp), allocatable :: product(:, :)
    integer :: s, own, rows, n
    integer(int64) :: first
    s = self%supernode(k)
    associate (list => tree%list)
      own = int(list%column_start(s) - list%column_start(s - 1))
      rows = int(list%row_start(s) - list%row_start(s - 1))
      first = list%value_start(s - 1)
      n = self%first_column(k + 1) - self%first_column(k)
      call dtrsm('L', 'L', 'N', 'N', own, n, 1.0_dp, list%value(first:), rows, self%value(self%first_value(k):), own)
      if (rows == own) return
      allocate (product(rows - own, n))
      call dgemm('N', 'N', rows - own, n, own, 1.0_dp, list%value(first + own:), rows, &
                 self%value(self%first_value(k):), own, 0.0_dp, product, rows - own)
      call subtract_product(self, tree, number, list%row(list%row_start(s - 1) + own:list%row_start(s) - 1), &
                            self%column(self%first_column(k):self%first_column(k + 1) - 1), product)
    end associate
  end subroutine eliminate

  !> Subtract the contribution of a supernode from its ancestors.
  subroutine subtract_product(self, tree, number, row, column, product)
    type(forward_solution_t), intent(inout) :: self  !! The solutions on the way.
    type(elimination_tree_t), intent(in) :: tree  !! Elimination tree.
    integer, intent(in) :: number(:)  !! Position of each supernode, as from `find_columns` (number of supernodes).
    integer(int64), intent(in) :: row(0:)  !! Rows of L that the contribution belongs to, ascending from 0 (m).
    integer, intent(in) :: column(:)  !! Right-hand sides that it belongs to, ascending (n).
    real(dp), intent(in) :: product(0:, :)  !! The contribution (m, n) [as the right-hand sides].
    integer :: first, last, s, m, i, j, own
    integer(int64) :: at, begin
    first = 0
    do while (first < size(row))
      s = tree%supernode_of(row(first))
      begin = tree%list%column_start(s - 1)
      own = int(tree%list%column_start(s) - begin)
      last = first
      do while (last + 1 < size(row))
        if (row(last + 1) >= begin + own) exit
        last = last + 1
      end do
      m = self%first_column(number(s)) - 1
      at = self%first_value(number(s)) - own
      do j = 1, size(column)
        ! Right-hand sides that reach a supernode reach all its ancestors.
        do
          m = m + 1
          at = at + own
          if (self%column(m) == column(j)) exit
        end do
        do i = first, last
          self%value(at + row(i) - begin) = self%value(at + row(i) - begin) - product(i, j)
        end do
      end do
      first = last + 1
    end do
  end subroutine subtract_product

  !> C = Y_a^T Y_b = B_a^T K^{-1} B_b for two blocks of right-hand sides.
  subroutine forward_product(tree, a, b, same, c)
    type(elimination_tree_t), intent(in) :: tree  !! Elimination tree.
    type(forward_solution_t), intent(in) :: a  !! Solutions Y_a.
    type(forward_solution_t), intent(in) :: b  !! Solutions Y_b.
    logical, intent(in) :: same  !! Whether b is a.
    real(dp), intent(out) :: c(:, :)  !! C (a%n, b%n) [B_a B_b/K].
    integer :: k, l, s, own, i, j
    c = 0
    l = 1
    do k = 1, size(a%supernode)
      s = a%supernode(k)
      do while (l <= size(b%supernode))
        if (b%supernode(l) >= s) exit
        l = l + 1
      end do
      if (l > size(b%supernode)) exit
      if (b%supernode(l) /= s) cycle
      own = int(tree%list%column_start(s) - tree%list%column_start(s - 1))
      call add_products(own, a%value(a%first_value(k):), b%value(b%first_value(l):), &
                        a%column(a%first_column(k):a%first_column(k + 1) - 1), &
                        b%column(b%first_column(l):b%first_column(l + 1) - 1), same, c)
    end do
    if (.not. same) return
    do j = 1, size(c, 2)
      do i = 1, j - 1
        c(i, j) = c(j, i)
      end do
    end do
  end subroutine forward_product

  !> Add the products of one supernode; of the lower triangle alone where b is a.
  subroutine add_products(own, a, b, column_a, column_b, same, c)
    integer, intent(in) :: own  !! Columns of the supernode.
    integer, intent(in) :: column_a(:)  !! Right-hand sides of a that reach it, ascending (m).
    integer, intent(in) :: column_b(:)  !! Right-hand sides of b that reach it, ascending (n).
    real(dp), intent(in) :: a(own, size(column_a))  !! Values of a (own, m) [B_a/sqrt(K)].
    real(dp), intent(in) :: b(own, size(column_b))  !! Values of b (own, n) [B_b/sqrt(K)].
    logical, intent(in) :: same  !! Whether b is a.
    real(dp), intent(inout) :: c(:, :)  !! C (right-hand sides of a, right-hand sides of b) [B_a B_b/K].
    real(dp), allocatable :: product(:, :)
    integer :: i, j
    allocate (product(size(column_a), size(column_b)))
    if (same) then
      call dsyrk('L', 'T', size(column_a), own, 1.0_dp, a, own, 0.0_dp, product, size(column_a))
    else
      call transposed_product(a, b, product)
    end if
    do j = 1, size(column_b)
      do i = merge(j, 1, same), size(column_a)
        c(column_a(i), column_b(j)) = c(column_a(i), column_b(j)) + product(i, j)
      end do
    end do
  end subroutine add_products
end module dotyk_linalg_forward_substitution
