!> Comparison of sparse matrices that may differ by rounding, which can be an entry.
module dotyk_linalg_row_comparison
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_sparse, only: sparse_rows_t
  implicit none
  private
  public :: same_rows

contains

  !> Whether two matrices are the same up to rounding.
  pure logical function same_rows(a, b, tolerance) result(same)
    type(sparse_rows_t), intent(in) :: a  !! The one matrix.
    type(sparse_rows_t), intent(in) :: b  !! The other one.
    !> Difference of entries, relative to the largest of their row, that counts as none [].
    real(dp), intent(in) :: tolerance
    integer :: i
    same = a%n_rows == b%n_rows .and. a%n_columns == b%n_columns
    if (.not. same) return
    do i = 1, a%n_rows
      associate (of_a => [a%row_start(i), a%row_start(i + 1) - 1], of_b => [b%row_start(i), b%row_start(i + 1) - 1])
        same = same_row(a%column(of_a(1):of_a(2)), a%value(of_a(1):of_a(2)), &
                        b%column(of_b(1):of_b(2)), b%value(of_b(1):of_b(2)), tolerance)
      end associate
      if (.not. same) return
    end do
  end function same_rows

  !> Whether two rows are the same up to rounding.
  pure logical function same_row(column_a, a, column_b, b, tolerance) result(same)
    integer, intent(in) :: column_a(:)  !! Columns of the one row, ascending.
    real(dp), intent(in) :: a(:)  !! Its entries [any].
    integer, intent(in) :: column_b(:)  !! Columns of the other row, ascending.
    real(dp), intent(in) :: b(:)  !! Its entries [as a].
    real(dp), intent(in) :: tolerance  !! As in `same_rows` [].
    real(dp) :: difference
    integer :: i, k, next_a, next_b
    i = 1
    k = 1
    same = .true.
    do while (same .and. (i <= size(a) .or. k <= size(b)))
      next_a = huge(i)
      next_b = huge(k)
      if (i <= size(a)) next_a = column_a(i)
      if (k <= size(b)) next_b = column_b(k)
      difference = 0
      if (next_a <= next_b) then
        difference = a(i)
        i = i + 1
      end if
      if (next_b <= next_a) then
        difference = difference - b(k)
        k = k + 1
      end if
      same = abs(difference) <= tolerance*maxval([0.0_dp, abs(a), abs(b)])
    end do
  end function same_row
end module dotyk_linalg_row_comparison
