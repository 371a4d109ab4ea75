!> Forward substitution with sparse right-hand sides: y = L^{-1} P b, so that b^T K^{-1} b' = y^T y'.
!>
!> The nonzeros of y lie on the elimination-tree paths from the nonzeros of b to the root (the reach of b: J. R. Gilbert and T. Peierls,
!> SIAM J. Sci. Stat. Comput. 9, 1988). Each supernode holds a dense block with the right-hand sides whose reach contains the supernode,
!> and no others. The cost is that of eliminating as many further rows of the matrix, a small part of a full solve, at the rate of
!> dense products.
module dotyk_linalg_forward_substitution
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm, transposed_product
  use dotyk_linalg_cholesky, only: cholesky_t, supernodes_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  implicit none
  private
  public :: forward_product

  !> The elimination tree of the supernodes, and the way from each equation into the tree.
  type, public :: elimination_tree_t
    !> The factor's supernodes, where they are.
    type(supernodes_t) :: list
    !> The supernode that comes after each, 0 at a root (n); supernodes count from 1 here.
    integer, allocatable :: parent(:)
    !> Place of each equation in the order of elimination, from 0, and the supernode of each place (order), (0:order-1).
    integer, allocatable :: place(:), supernode_of(:)
    !> Entries of L from each supernode to the root (n).
    integer(int64), allocatable :: entries_above(:)
  contains
    procedure :: init => tree_init
    procedure :: path_entries => tree_path_entries
  end type elimination_tree_t

  !> Solutions of L y = P b for some right-hand sides.
  type, public :: forward_solution_t
    !> Number of right-hand sides.
    integer :: n = 0
    !> Supernodes that they come through, ascending (n_supernodes).
    integer, allocatable :: supernode(:)
    !> Of the k-th of them: right-hand sides column(first_column(k):first_column(k+1)-1), ascending; values from first_value(k) on, a
    !> block (own columns of the supernode, its right-hand sides) (n_supernodes + 1).
    integer, allocatable :: first_column(:), column(:)
    integer(int64), allocatable :: first_value(:)
    real(dp), allocatable :: value(:)
  contains
    procedure :: init => forward_init
  end type forward_solution_t

contains

  !> Look at a factor.
  subroutine tree_init(self, factor)
    class(elimination_tree_t), intent(out) :: self
    !> Analyzed. The tree is of no use once the factor is gone.
    type(cholesky_t), intent(in) :: factor
    integer(int64) :: k, s, own
    integer :: n
    call factor%supernodes(self%list)
    n = int(self%list%n)
    allocate (self%parent(n), self%place(factor%n), self%supernode_of(0:factor%n - 1), self%entries_above(n))
    associate (list => self%list)
      do k = 0, factor%n - 1
        self%place(list%permutation(k) + 1) = int(k)
      end do
      do s = 0, n - 1
        self%supernode_of(list%column_start(s):list%column_start(s + 1) - 1) = int(s) + 1
      end do
      do s = n - 1, 0, -1
        own = list%column_start(s + 1) - list%column_start(s)
        self%parent(s + 1) = 0
        self%entries_above(s + 1) = own*(list%row_start(s + 1) - list%row_start(s))
        if (list%row_start(s) + own == list%row_start(s + 1)) cycle
        self%parent(s + 1) = self%supernode_of(list%row(list%row_start(s) + own))
        self%entries_above(s + 1) = self%entries_above(s + 1) + self%entries_above(self%parent(s + 1))
      end do
    end associate
  end subroutine tree_init

  !> Entries of L that forward substitutions for single equations go through, in the mean.
  real(dp) function tree_path_entries(self, equation) result(entries)
    class(elimination_tree_t), intent(in) :: self
    integer, intent(in) :: equation(:)
    integer :: i
    entries = 0
    do i = 1, size(equation)
      entries = entries + real(self%entries_above(self%supernode_of(self%place(equation(i)))), dp)
    end do
    if (size(equation) > 0) entries = entries/size(equation)
  end function tree_path_entries

  !> Solve.
  subroutine forward_init(self, tree, rhs)
    class(forward_solution_t), intent(out) :: self
    !> Of a factorized matrix.
    type(elimination_tree_t), intent(in) :: tree
    !> Right-hand sides as rows; their columns are the equations.
    type(sparse_rows_t), intent(in) :: rhs
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

  !> Which right-hand sides come through which supernodes, and room for the values.
  subroutine find_columns(self, tree, rhs, number)
    type(forward_solution_t), intent(inout) :: self
    type(elimination_tree_t), intent(in) :: tree
    type(sparse_rows_t), intent(in) :: rhs
    !> Number of each supernode among those that are come through, 0 if it is not one of them (size of tree%parent).
    integer, intent(out) :: number(:)
    integer, allocatable :: next(:), last(:)
    integer :: pass, j, k, s, n
    integer(int64) :: own
    allocate (last(size(number)))
    number = 0
    do pass = 1, 2
      last = 0
      do j = 1, rhs%n_rows
        do k = rhs%row_start(j), rhs%row_start(j + 1) - 1
          s = tree%supernode_of(tree%place(rhs%column(k)))
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

  !> The right-hand sides themselves.
  subroutine place_values(self, tree, rhs, number)
    type(forward_solution_t), intent(inout) :: self
    type(elimination_tree_t), intent(in) :: tree
    type(sparse_rows_t), intent(in) :: rhs
    integer, intent(in) :: number(:)
    integer :: j, k, m, s, column
    integer(int64) :: own, at
    self%value = 0
    do j = 1, rhs%n_rows
      do k = rhs%row_start(j), rhs%row_start(j + 1) - 1
        s = tree%supernode_of(tree%place(rhs%column(k)))
        m = number(s)
        own = tree%list%column_start(s) - tree%list%column_start(s - 1)
        column = position(j, self%column(self%first_column(m):self%first_column(m + 1) - 1))
        at = self%first_value(m) + (column - 1)*own + tree%place(rhs%column(k)) - tree%list%column_start(s - 1)
        self%value(at) = self%value(at) + rhs%value(k)
      end do
    end do
  end subroutine place_values

  !> Position of a number in an ascending list that has it.
  pure integer function position(number, list)
    integer, intent(in) :: number, list(:)
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

  !> One supernode: solve with its own block, and take its part from the supernodes after it.
  subroutine eliminate(self, tree, number, k)
    type(forward_solution_t), intent(inout) :: self
    type(elimination_tree_t), intent(in) :: tree
    integer, intent(in) :: number(:)
    !> Number of the supernode among those that are come through.
    integer, intent(in) :: k
    real(dp), allocatable :: part(:, :)
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
      allocate (part(rows - own, n))
      call dgemm('N', 'N', rows - own, n, own, 1.0_dp, list%value(first + own:), rows, self%value(self%first_value(k):), own, &
                 0.0_dp, part, rows - own)
      call subtract_part(self, tree, number, list%row(list%row_start(s - 1) + own:list%row_start(s) - 1), &
                         self%column(self%first_column(k):self%first_column(k + 1) - 1), part)
    end associate
  end subroutine eliminate

  !> Subtract what a supernode contributes to others.
  subroutine subtract_part(self, tree, number, row, column, part)
    type(forward_solution_t), intent(inout) :: self
    type(elimination_tree_t), intent(in) :: tree
    integer, intent(in) :: number(:)
    !> Places in the order of elimination (from 0, ascending) and right-hand sides of the part.
    integer(int64), intent(in) :: row(0:)
    integer, intent(in) :: column(:)
    real(dp), intent(in) :: part(0:, :)
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
        ! The right-hand sides of a supernode are among those of all that come after it.
        do
          m = m + 1
          at = at + own
          if (self%column(m) == column(j)) exit
        end do
        do i = first, last
          self%value(at + row(i) - begin) = self%value(at + row(i) - begin) - part(i, j)
        end do
      end do
      first = last + 1
    end do
  end subroutine subtract_part

  !> c = Y_a^T Y_b, products of all right-hand sides of two lots with K^{-1} between them.
  subroutine forward_product(tree, a, b, same, c)
    type(elimination_tree_t), intent(in) :: tree
    type(forward_solution_t), intent(in) :: a, b
    !> Whether a and b are one and the same.
    logical, intent(in) :: same
    !> (a%n, b%n)
    real(dp), intent(out) :: c(:, :)
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

  !> What one supernode adds to the products; where a and b are the same, to the lower triangle alone.
  subroutine add_products(own, a, b, column_a, column_b, same, c)
    integer, intent(in) :: own
    integer, intent(in) :: column_a(:), column_b(:)
    real(dp), intent(in) :: a(own, size(column_a)), b(own, size(column_b))
    logical, intent(in) :: same
    real(dp), intent(inout) :: c(:, :)
    real(dp), allocatable :: part(:, :)
    integer :: i, j
    allocate (part(size(column_a), size(column_b)))
    if (same) then
      call dsyrk('L', 'T', size(column_a), own, 1.0_dp, a, own, 0.0_dp, part, size(column_a))
    else
      call transposed_product(a, b, part)
    end if
    do j = 1, size(column_b)
      do i = merge(j, 1, same), size(column_a)
        c(column_a(i), column_b(j)) = c(column_a(i), column_b(j)) + part(i, j)
      end do
    end do
  end subroutine add_products
end module dotyk_linalg_forward_substitution
