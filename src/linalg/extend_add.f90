!> Adding update matrices to the fronts of their parents (the extend-add of the multifrontal method: I. S. Duff and J.
!> K. Reid, ACM Trans. Math. Softw. 9, 1983).
module dotyk_linalg_extend_add
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_supernodes, only: supernodes_t
  implicit none
  private
  public :: add_to_ancestors, add_update, clear_lower

contains

  !> Set the lower triangle of a square matrix to zero.
  pure subroutine clear_lower(n, square)
    !> Order.
    integer, intent(in) :: n
    !> The matrix (n, n) [any]; entries above the diagonal are not touched.
    real(dp), intent(inout) :: square(n, n)
    integer :: j
    do j = 1, n
      square(j:, j) = 0
    end do
  end subroutine clear_lower

  !> Add the update matrix of a child to the front of its parent, which consists of a panel (own columns) and an update
  !> matrix.
  pure subroutine add_update(n, position, child, columns, rows, panel, update)
    !> Order of the child's update matrix.
    integer, intent(in) :: n
    !> Row of the parent's front for each row of the child's update matrix, ascending from 0 (n).
    integer, intent(in) :: position(n)
    !> Update matrix of the child (n, n) [as the matrix]; the lower triangle is read.
    real(dp), intent(in) :: child(n, n)
    !> Columns of the parent's panel.
    integer, intent(in) :: columns
    !> Rows of the parent's front.
    integer, intent(in) :: rows
    !> Panel of the parent (0:rows-1, 0:columns-1) [as the matrix].
    real(dp), intent(inout) :: panel(0:rows - 1, 0:columns - 1)
    !> Update matrix of the parent, lower triangle (columns:rows-1, columns:rows-1) [as the matrix].
    real(dp), intent(inout) :: update(columns:rows - 1, columns:rows - 1)
    integer :: i, j
    do j = 1, n
      if (position(j) < columns) then
        do i = j, n
          panel(position(i), position(j)) = panel(position(i), position(j)) + child(i, j)
        end do
      else
        do i = j, n
          update(position(i), position(j)) = update(position(i), position(j)) + child(i, j)
        end do
      end if
    end do
  end subroutine add_update

  !> Add a block to the panels of the supernodes that its columns belong to.
  subroutine add_to_ancestors(supernodes, of_column, m, n, row, column, is_lower, is_packed, block, x)
    !> Structure of the factor.
    type(supernodes_t), intent(in) :: supernodes
    !> Supernode of each column (0:order-1).
    integer, intent(in) :: of_column(0:)
    !> Rows of the block.
    integer, intent(in) :: m
    !> Columns of the block.
    integer, intent(in) :: n
    !> Row of P K P^T for each row of the block, ascending from 0 (m).
    integer(int64), intent(in) :: row(m)
    !> Column of P K P^T for each column of the block, ascending from 0; the rows again if the block is a lower triangle
    !> (n).
    integer(int64), intent(in) :: column(n)
    !> Whether the block is a lower triangle.
    logical, intent(in) :: is_lower
    !> Whether the triangle is packed.
    logical, intent(in) :: is_packed
    !> The block by columns (m*n; n*(n+1)/2 if packed) [as the matrix].
    real(dp), intent(in) :: block(*)
    !> Values of the factor (0:factor_entries-1) [as the matrix].
    real(dp), intent(inout) :: x(0:*)
    integer :: position(m), j, s, i, i_first
    integer(int64) :: at, from
    s = -1
    from = 0
    do j = 1, n
      i_first = 1
      if (is_lower) i_first = j
      if (of_column(column(j)) /= s) then
        s = of_column(column(j))
        associate (list => supernodes%row(supernodes%row_start(s):supernodes%row_start(s + 1) - 1))
          call locate(m - i_first + 1, row(i_first:), size(list), list, position(i_first:))
        end associate
      end if
      at = supernodes%value_start(s) + (column(j) - supernodes%column_start(s))*supernodes%rows(s)
      do i = i_first, m
        x(at + position(i)) = x(at + position(i)) + block(from + i)
      end do
      from = from + merge(n - j, m, is_packed)
    end do
  end subroutine add_to_ancestors

  !> Positions (from 0) of some numbers in a longer list that contains them, both ascending.
  pure subroutine locate(m, number, n, list, position)
    !> How many numbers.
    integer, intent(in) :: m
    !> The numbers, ascending (m).
    integer(int64), intent(in) :: number(m)
    !> Length of the list.
    integer, intent(in) :: n
    !> The list, ascending (n).
    integer(int64), intent(in) :: list(n)
    !> Position of each number in the list, from 0 (m).
    integer, intent(out) :: position(m)
    integer :: i, low, high, middle
    low = 1
    high = n
    do while (low < high)
      middle = (low + high)/2
      if (list(middle) < number(1)) then
        low = middle + 1
      else
        high = middle
      end if
    end do
    do i = 1, m
      do while (list(low) < number(i))
        low = low + 1
      end do
      position(i) = low - 1
    end do
  end subroutine locate
end module dotyk_linalg_extend_add
