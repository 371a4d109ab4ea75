!> Sparse matrices: a symmetric one as CHOLMOD reads it, and a general one by rows (compressed sparse rows); comparison
!> of matrices that may differ by rounding, which can be an entry.
module dotyk_linalg_sparse
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_parcel, only: parcel_t
  implicit none
  private
  public :: same_rows

  !> Symmetric matrix: lower triangle with the diagonal by columns, rows ascending in each column. Indices are 64-bit
  !> and 0-based, because CHOLMOD reads these arrays. Every diagonal entry is stored, as the first entry of its column.
  type, public :: sparse_symmetric_t
    integer :: n = 0  !! Order of the matrix.
    integer(int64), allocatable :: column_start(:)  !! First entry of each column, 0-based, and their number (n+1).
    integer(int64), allocatable :: row(:)  !! Row of each entry, 0-based (number of entries).
    real(dp), allocatable :: value(:)  !! Values; not allocated while the pattern alone is known (n_entries).
  contains
    procedure :: multiply => symmetric_multiply
    procedure :: n_entries => symmetric_entries
    procedure :: bytes => symmetric_bytes
    procedure :: destroy => symmetric_destroy
  end type sparse_symmetric_t

  type, public :: sparse_rows_t  !! General matrix by rows, 1-based, columns ascending in each row.
    integer :: n_rows = 0  !! Number of rows.
    integer :: n_columns = 0  !! Number of columns.
    integer, allocatable :: row_start(:)  !! First entry of each row, and the number of entries + 1 (n_rows+1).
    integer, allocatable :: column(:)  !! Column of each entry (number of entries).
    real(dp), allocatable :: value(:)  !! Value of each entry (number of entries).
  contains
    procedure :: init_from_triplets => rows_init_from_triplets
    procedure :: multiply => rows_multiply
    procedure :: multiply_transposed => rows_multiply_transposed
    procedure :: set_identity => rows_set_identity
    procedure :: set_product => rows_set_product
    procedure :: set_stacked => rows_set_stacked
    procedure :: carry => rows_carry
    procedure :: destroy => rows_destroy
  end type sparse_rows_t

contains

  !> y = A x.
  subroutine symmetric_multiply(self, x, y)
    class(sparse_symmetric_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Vector x (n) [any].
    real(dp), intent(out) :: y(:)  !! Product y (n) [matrix times x].
    call multiply_lower(self%n, self%column_start, self%row, self%value, x, y)
  end subroutine symmetric_multiply

  !> y = A x from the lower triangle of A.
  pure subroutine multiply_lower(n, start, row, value, x, y)
    integer, intent(in) :: n  !! Order.
    integer(int64), intent(in) :: start(:)  !! Position of the first entry of each column, 0-based (n+1).
    integer(int64), intent(in) :: row(:)  !! Row of each entry, 0-based (number of entries).
    real(dp), intent(in) :: value(:)  !! Value of each entry (number of entries) [any].
    real(dp), intent(in) :: x(:)  !! Vector x (n) [any].
    real(dp), intent(out) :: y(:)  !! Product y (n) [matrix times x].
    integer :: i, j
    integer(int64) :: k
    real(dp) :: sum, xj
    y(1:n) = 0
    do j = 1, n
      if (start(j + 1) == start(j)) cycle
      xj = x(j)
      sum = value(start(j) + 1)*xj
      do k = start(j) + 2, start(j + 1)
        i = int(row(k)) + 1
        y(i) = y(i) + value(k)*xj
        sum = sum + value(k)*x(i)
      end do
      y(j) = y(j) + sum
    end do
  end subroutine multiply_lower

  !> Number of stored entries.
  pure integer(int64) function symmetric_entries(self) result(n_entries)
    class(sparse_symmetric_t), intent(in) :: self
    n_entries = 0
    if (allocated(self%column_start)) n_entries = self%column_start(self%n + 1)
  end function symmetric_entries

  !> Memory of the arrays [bytes].
  pure integer(int64) function symmetric_bytes(self) result(bytes)
    class(sparse_symmetric_t), intent(in) :: self
    bytes = 0
    if (allocated(self%column_start)) bytes = bytes + 8_int64*size(self%column_start, kind=int64)
    if (allocated(self%row)) bytes = bytes + 8_int64*size(self%row, kind=int64)
    if (allocated(self%value)) bytes = bytes + 8_int64*size(self%value, kind=int64)
  end function symmetric_bytes

  !> Free the memory.
  subroutine symmetric_destroy(self)
    class(sparse_symmetric_t), intent(inout) :: self
    self%n = 0
    if (allocated(self%column_start)) deallocate (self%column_start)
    if (allocated(self%row)) deallocate (self%row)
    if (allocated(self%value)) deallocate (self%value)
  end subroutine symmetric_destroy

  !> Build the matrix from triplets in any order; triplets with the same row and column are added in the order of the
  !> list.
  subroutine rows_init_from_triplets(self, n_rows, n_columns, rows, columns, values)
    class(sparse_rows_t), intent(inout) :: self
    integer, intent(in) :: n_rows  !! Number of rows.
    integer, intent(in) :: n_columns  !! Number of columns.
    integer, intent(in) :: rows(:)  !! Row of each entry (number of triplets).
    integer, intent(in) :: columns(:)  !! Column of each entry (number of triplets).
    real(dp), intent(in) :: values(:)  !! Value of each entry (number of triplets) [any].
    integer, allocatable :: by_column(:), by_row(:), first(:)
    integer :: n, k, entry, row, last
    call self%destroy()
    n = size(rows)
    self%n_rows = n_rows
    self%n_columns = n_columns
    allocate (by_column(n), by_row(n), self%row_start(n_rows + 1))
    ! Two stable counting sorts, by column and then by row, leave the columns ascending in each row.
    allocate (first(n_columns + 1))
    call counting_sort(n_columns, columns, [(k, k=1, n)], by_column, first)
    deallocate (first)
    allocate (first(n_rows + 1))
    call counting_sort(n_rows, rows, by_column, by_row, first)
    allocate (self%column(n), self%value(n))
    last = 0
    do row = 1, n_rows
      self%row_start(row) = last + 1
      do k = first(row), first(row + 1) - 1
        entry = by_row(k)
        if (last >= self%row_start(row)) then
          if (self%column(last) == columns(entry)) then
            self%value(last) = self%value(last) + values(entry)
            cycle
          end if
        end if
        last = last + 1
        self%column(last) = columns(entry)
        self%value(last) = values(entry)
      end do
    end do
    self%row_start(n_rows + 1) = last + 1
    if (last < n) then
      self%column = self%column(:last)
      self%value = self%value(:last)
    end if
  end subroutine rows_init_from_triplets

  !> Stable counting sort of entries by a key.
  pure subroutine counting_sort(n_keys, key, order, sorted, first)
    integer, intent(in) :: n_keys  !! Greatest key; keys are 1..n_keys.
    integer, intent(in) :: key(:)  !! Key of each entry (n).
    integer, intent(in) :: order(:)  !! Entries in the order that equal keys keep (n).
    integer, intent(out) :: sorted(:)  !! Entries sorted by key (n).
    integer, intent(out) :: first(:)  !! Position of the first entry of each key in `sorted` (n_keys+1).
    integer, allocatable :: next(:)
    integer :: i, k
    first = 0
    do i = 1, size(key)
      first(key(i) + 1) = first(key(i) + 1) + 1
    end do
    first(1) = 1
    do k = 1, n_keys
      first(k + 1) = first(k + 1) + first(k)
    end do
    allocate (next(n_keys + 1))
    next(:) = first
    do i = 1, size(order)
      k = key(order(i))
      sorted(next(k)) = order(i)
      next(k) = next(k) + 1
    end do
  end subroutine counting_sort

  !> y = A x.
  pure subroutine rows_multiply(self, x, y)
    class(sparse_rows_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Vector x (n_columns) [any].
    real(dp), intent(out) :: y(:)  !! Product y (n_rows) [matrix times x].
    integer :: i, k
    real(dp) :: sum
    do i = 1, self%n_rows
      sum = 0
      do k = self%row_start(i), self%row_start(i + 1) - 1
        sum = sum + self%value(k)*x(self%column(k))
      end do
      y(i) = sum
    end do
  end subroutine rows_multiply

  !> y = A^T x.
  pure subroutine rows_multiply_transposed(self, x, y)
    class(sparse_rows_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Vector x (n_rows) [any].
    real(dp), intent(out) :: y(:)  !! Product y (n_columns) [matrix times x].
    integer :: i, j, k
    y(1:self%n_columns) = 0
    do i = 1, self%n_rows
      do k = self%row_start(i), self%row_start(i + 1) - 1
        j = self%column(k)
        y(j) = y(j) + self%value(k)*x(i)
      end do
    end do
  end subroutine rows_multiply_transposed

  !> Make this the identity.
  subroutine rows_set_identity(self, n)
    class(sparse_rows_t), intent(inout) :: self
    integer, intent(in) :: n  !! Order.
    integer :: i
    self%n_rows = n
    self%n_columns = n
    self%row_start = [(i, i=1, n + 1)]
    self%column = self%row_start(1:n)
    self%value = spread(1.0_dp, 1, n)
  end subroutine rows_set_identity

  !> Make this the product A B.
  subroutine rows_set_product(self, a, b)
    class(sparse_rows_t), intent(inout) :: self
    type(sparse_rows_t), intent(in) :: a  !! A.
    type(sparse_rows_t), intent(in) :: b  !! B, with as many rows as A has columns.
    integer, allocatable :: position(:), row(:), column(:)
    real(dp), allocatable :: value(:)
    integer :: i, j, k, l, n, before
    allocate (position(b%n_columns))
    position = 0
    n = 0
    do i = 1, a%n_rows
      do k = a%row_start(i), a%row_start(i + 1) - 1
        do l = b%row_start(a%column(k)), b%row_start(a%column(k) + 1) - 1
          j = b%column(l)
          if (position(j) == i) cycle
          position(j) = i
          n = n + 1
        end do
      end do
    end do
    allocate (row(n), column(n), value(n))
    position = 0
    n = 0
    do i = 1, a%n_rows
      before = n
      do k = a%row_start(i), a%row_start(i + 1) - 1
        do l = b%row_start(a%column(k)), b%row_start(a%column(k) + 1) - 1
          j = b%column(l)
          if (position(j) <= before) then
            n = n + 1
            position(j) = n
            row(n) = i
            column(n) = j
            value(n) = 0
          end if
          value(position(j)) = value(position(j)) + a%value(k)*b%value(l)
        end do
      end do
    end do
    ! The columns of each row are sorted there.
    call self%init_from_triplets(a%n_rows, b%n_columns, row, column, value)
  end subroutine rows_set_product

  !> Make this several matrices with the same columns, one below the other.
  subroutine rows_set_stacked(self, n_columns, block)
    class(sparse_rows_t), intent(inout) :: self
    integer, intent(in) :: n_columns  !! Number of columns.
    type(sparse_rows_t), intent(in) :: block(:)  !! The matrices, from top to bottom (any number).
    integer :: k, n, n_entries
    call self%destroy()
    self%n_columns = n_columns
    self%n_rows = sum(block%n_rows)
    n_entries = 0
    do k = 1, size(block)
      n_entries = n_entries + size(block(k)%column)
    end do
    allocate (self%row_start(self%n_rows + 1), self%column(n_entries), self%value(n_entries))
    n = 0
    n_entries = 0
    do k = 1, size(block)
      self%row_start(n + 1:n + block(k)%n_rows) = block(k)%row_start(1:block(k)%n_rows) + n_entries
      self%column(n_entries + 1:n_entries + size(block(k)%column)) = block(k)%column
      self%value(n_entries + 1:n_entries + size(block(k)%column)) = block(k)%value
      n = n + block(k)%n_rows
      n_entries = n_entries + size(block(k)%column)
    end do
    self%row_start(n + 1) = n_entries + 1
  end subroutine rows_set_stacked

  !> To other ranks.
  pure subroutine rows_carry(self, parcel)
    class(sparse_rows_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! Gets the rows, or has them.
    call parcel%carry(self%n_rows)
    call parcel%carry(self%n_columns)
    call parcel%carry(self%row_start)
    call parcel%carry(self%column)
    call parcel%carry(self%value)
  end subroutine rows_carry

  !> Free the memory.
  subroutine rows_destroy(self)
    class(sparse_rows_t), intent(inout) :: self
    self%n_rows = 0
    self%n_columns = 0
    if (allocated(self%row_start)) deallocate (self%row_start)
    if (allocated(self%column)) deallocate (self%column)
    if (allocated(self%value)) deallocate (self%value)
  end subroutine rows_destroy

  !> Whether two matrices are the same up to rounding.
  pure logical function same_rows(a, b, tolerance) result(same)
    type(sparse_rows_t), intent(in) :: a  !! The one matrix.
    type(sparse_rows_t), intent(in) :: b  !! The other one.
    real(dp), intent(in) :: tolerance  !! Difference relative to the largest entry of a row that counts as none [].
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
end module dotyk_linalg_sparse
