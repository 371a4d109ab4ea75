!> Prolongators from aggregates of nodes to a matrix of 2x2 or 3x3 blocks, P = (I - omega D^{-1} A) Q: the tentative
!> prolongator Q of `dotyk_linalg_aggregation` after one step of the block Jacobi method (P. Vanek, J. Mandel and M.
!> Brezina, Computing 56, 1996).
!>
!> Near-null-space vectors of A remain in the range of P where A maps them to zero, and basis functions lose the jumps
!> at the borders of aggregates, which cost energy. Entries are in single precision, as smoothers are; the Galerkin
!> matrix (`dotyk_linalg_galerkin_product`) is that of the rounded P. All loops run over rows of the result, which have
!> the same digits on any number of threads.
module dotyk_linalg_block_prolongator
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_linalg_block_rows, only: block_rows_t
  implicit none
  private

  type, public :: block_prolongator_t  !! The prolongator. An aggregate has m coarse unknowns.
    integer :: m = 0  !! Coarse unknowns of an aggregate.
    integer :: dim = 0  !! Order of the blocks of A.
    integer :: n_coarse = 0  !! Number of aggregates.
    integer, allocatable :: start(:)  !! First entry of each block row of A (n + 1).
    integer, allocatable :: column(:)  !! Aggregate of each entry, ascending in each row (n_entries).
    real(sp), allocatable :: value(:, :, :)  !! Entries: coarse unknown, component (m, dim, n_entries) [].
    integer, allocatable :: first(:)  !! First entry of each aggregate in `row` and `entry` (n_coarse + 1).
    integer, allocatable :: row(:)  !! Block rows of A with an entry for the aggregate, ascending (n_entries).
    integer, allocatable :: entry(:)  !! Their entries (n_entries).
  contains
    procedure :: init => prolongator_init
    procedure :: restrict => prolongator_restrict
    procedure :: prolong => prolongator_prolong
    procedure :: move_to => prolongator_move_to
    procedure :: bytes => prolongator_bytes
    procedure :: destroy => prolongator_destroy
  end type block_prolongator_t

  public :: sort_ascending

contains

  !> Smooth the tentative prolongator.
  subroutine prolongator_init(self, rows, part, aggregate, n_coarse, basis, inverse, omega)
    class(block_prolongator_t), intent(out) :: self
    type(block_rows_t), intent(in) :: rows  !! The matrix A; a node has `part` block rows, one after the other.
    integer, intent(in) :: part  !! Block rows of a node.
    integer, intent(in) :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    integer, intent(in) :: n_coarse  !! Number of aggregates.
    real(dp), intent(in), contiguous :: basis(:, :, :)  !! Q: coarse unknown, nodal unknown, node [].
    real(sp), intent(in), contiguous :: inverse(:, :, :)  !! Inverse diagonal blocks of A/scale (dim, dim, n) [].
    real(dp), intent(in) :: omega  !! Factor of the step [].
    integer, allocatable :: mark(:), list(:)
    integer :: i, k, n
    self%m = size(basis, 1)
    self%dim = rows%dim
    self%n_coarse = n_coarse
    allocate (self%start(rows%n + 1))
    self%start(1) = 1
    ! The first pass counts, the second one fills.
    !$omp parallel default(none) shared(self, rows, part, aggregate) private(mark, list, n)
    allocate (mark(self%n_coarse), list(longest_row(rows)))
    mark = 0
    !$omp do schedule(static)
    do i = 1, rows%n
      call aggregates_of_row(rows, part, aggregate, i, mark, list, n)
      self%start(i + 1) = n
    end do
    !$omp end do
    !$omp end parallel
    do i = 1, rows%n
      self%start(i + 1) = self%start(i) + self%start(i + 1)
    end do
    n = self%start(rows%n + 1) - 1
    allocate (self%column(n), self%value(self%m, self%dim, n))
    !$omp parallel default(none) shared(self, rows, part, aggregate, basis, inverse, omega) private(mark, list, n)
    allocate (mark(self%n_coarse), list(longest_row(rows)))
    mark = 0
    !$omp do schedule(static)
    do i = 1, rows%n
      call aggregates_of_row(rows, part, aggregate, i, mark, list, n)
      self%column(self%start(i):self%start(i + 1) - 1) = list(:n)
      call smooth_row(self%m, self%dim, rows, part, aggregate, basis, inverse(:, :, i), omega, i, list(:n), &
                      self%value(:, :, self%start(i):self%start(i + 1) - 1))
    end do
    !$omp end do
    !$omp end parallel
    n = size(self%column)
    allocate (self%first(n_coarse + 1), source=0)
    allocate (self%row(n), self%entry(n), list(n_coarse))
    do k = 1, n
      self%first(self%column(k) + 1) = self%first(self%column(k) + 1) + 1
    end do
    self%first(1) = 1
    do k = 1, n_coarse
      self%first(k + 1) = self%first(k + 1) + self%first(k)
    end do
    list(:) = self%first(:n_coarse)
    do i = 1, rows%n
      do k = self%start(i), self%start(i + 1) - 1
        associate (next => list(self%column(k)))
          self%row(next) = i
          self%entry(next) = k
          next = next + 1
        end associate
      end do
    end do
  end subroutine prolongator_init

  !> Most blocks in a row.
  pure integer function longest_row(rows)
    type(block_rows_t), intent(in) :: rows  !! The matrix.
    integer :: i
    longest_row = 0
    do i = 1, rows%n
      longest_row = max(longest_row, int(rows%start(i + 1) - rows%start(i)))
    end do
  end function longest_row

  !> Aggregates of the columns of a row.
  pure subroutine aggregates_of_row(rows, part, aggregate, i, mark, list, n)
    type(block_rows_t), intent(in) :: rows  !! The matrix.
    integer, intent(in) :: part  !! Block rows of a node.
    integer, intent(in) :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    integer, intent(in) :: i  !! The block row.
    integer, intent(inout) :: mark(:)  !! Last row that an aggregate was found in (n_coarse).
    integer, intent(inout) :: list(:)  !! The aggregates, ascending (at least n).
    integer, intent(out) :: n  !! Their number.
    integer(int64) :: k
    integer :: j
    n = 0
    do k = rows%start(i), rows%start(i + 1) - 1
      j = aggregate((rows%column(k) - 1)/part + 1)
      if (j == 0) cycle
      if (mark(j) == i) cycle
      mark(j) = i
      n = n + 1
      list(n) = j
    end do
    call sort_ascending(list(:n))
  end subroutine aggregates_of_row

  !> Sort a short list.
  pure subroutine sort_ascending(list)
    integer, intent(inout) :: list(:)  !! The numbers (n).
    integer :: i, k, number
    do i = 2, size(list)
      number = list(i)
      k = i
      do while (k > 1)
        if (list(k - 1) <= number) exit
        list(k) = list(k - 1)
        k = k - 1
      end do
      list(k) = number
    end do
  end subroutine sort_ascending

  !> One row of (I - omega D^{-1} A) Q.
  pure subroutine smooth_row(m, dim, rows, part, aggregate, basis, inverse, omega, i, list, value)
    integer, intent(in) :: m  !! Coarse unknowns of an aggregate.
    integer, intent(in) :: dim  !! Order of the blocks.
    type(block_rows_t), intent(in) :: rows  !! The matrix.
    integer, intent(in) :: part  !! Block rows of a node.
    integer, intent(in) :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    real(dp), intent(in) :: basis(m, dim, *)  !! Q by block rows (m, dim, n) [].
    real(sp), intent(in) :: inverse(dim, dim)  !! Inverse diagonal block (dim, dim) [].
    real(dp), intent(in) :: omega  !! Factor of the step [].
    integer, intent(in) :: i  !! The block row.
    integer, intent(in) :: list(:)  !! Aggregates of the row, ascending (n).
    real(sp), intent(out) :: value(m, dim, size(list))  !! The row (m, dim, n) [].
    real(dp) :: product(m, dim, size(list)), row(m, dim), a(dim, dim)
    integer(int64) :: k
    integer :: j, l, r, c
    product = 0
    do k = rows%start(i), rows%start(i + 1) - 1
      j = aggregate((rows%column(k) - 1)/part + 1)
      if (j == 0) cycle
      l = findloc(list, j, 1)
      call rows%get_block(k, a)
      do c = 1, dim
        do r = 1, dim
          product(:, r, l) = product(:, r, l) + a(r, c)*basis(:, c, rows%column(k))
        end do
      end do
    end do
    j = aggregate((i - 1)/part + 1)
    do l = 1, size(list)
      row = 0
      if (list(l) == j) row = basis(:, :, i)
      do c = 1, dim
        do r = 1, dim
          row(:, r) = row(:, r) - omega*inverse(r, c)*product(:, c, l)
        end do
      end do
      value(:, :, l) = real(row, sp)
    end do
  end subroutine smooth_row

  !> P^T r.
  subroutine prolongator_restrict(self, r, coarse)
    class(block_prolongator_t), intent(in) :: self
    real(sp), intent(in), contiguous :: r(:)  !! Residual (dim*n) [any].
    real(sp), intent(out), contiguous :: coarse(:)  !! On the coarse level (m*n_coarse) [as r].
    if (self%m == 6) then
      call restrict_rows(6, 3, self%n_coarse, self%first, self%row, self%entry, self%value, r, coarse)
    else
      call restrict_rows(self%m, self%dim, self%n_coarse, self%first, self%row, self%entry, self%value, r, coarse)
    end if
  end subroutine prolongator_restrict

  !> P^T r by aggregates.
  subroutine restrict_rows(m, dim, n, first, row, entry, value, r, coarse)
    integer, intent(in) :: m  !! Coarse unknowns of an aggregate.
    integer, intent(in) :: dim  !! Order of the blocks.
    integer, intent(in) :: n  !! Number of aggregates.
    integer, intent(in) :: first(n + 1)  !! First entry of each aggregate (n + 1).
    integer, intent(in) :: row(*)  !! Block row of each entry.
    integer, intent(in) :: entry(*)  !! Place of each entry in `value`.
    real(sp), intent(in) :: value(m, dim, *)  !! Entries of P (m, dim, n_entries) [].
    real(sp), intent(in) :: r(dim, *)  !! Residual (dim, n_rows) [any].
    real(sp), intent(out) :: coarse(m, n)  !! P^T r (m, n) [as r].
    real(dp) :: sum(m)
    integer :: i, j, k
    !$omp parallel do default(none) shared(m, dim, n, first, row, entry, value, r, coarse) private(sum, j, k) &
    !$omp& schedule(static)
    do i = 1, n
      sum = 0
      do k = first(i), first(i + 1) - 1
        do j = 1, dim
          sum = sum + value(:, j, entry(k))*real(r(j, row(k)), dp)
        end do
      end do
      coarse(:, i) = real(sum, sp)
    end do
    !$omp end parallel do
  end subroutine restrict_rows

  !> P x.
  subroutine prolongator_prolong(self, coarse, x)
    class(block_prolongator_t), intent(in) :: self
    real(dp), intent(in), contiguous :: coarse(:)  !! Vector of the coarse level (m*n_coarse) [any].
    real(dp), intent(out), contiguous :: x(:)  !! P times it (dim*n) [as `coarse`].
    if (self%m == 6) then
      call prolong_rows(6, 3, size(self%start) - 1, self%start, self%column, self%value, coarse, x)
    else
      call prolong_rows(self%m, self%dim, size(self%start) - 1, self%start, self%column, self%value, coarse, x)
    end if
  end subroutine prolongator_prolong

  !> P x by rows.
  subroutine prolong_rows(m, dim, n, start, column, value, coarse, x)
    integer, intent(in) :: m  !! Coarse unknowns of an aggregate.
    integer, intent(in) :: dim  !! Order of the blocks.
    integer, intent(in) :: n  !! Number of block rows.
    integer, intent(in) :: start(n + 1)  !! First entry of each row (n + 1).
    integer, intent(in) :: column(*)  !! Aggregate of each entry.
    real(sp), intent(in) :: value(m, dim, *)  !! Entries of P (m, dim, n_entries) [].
    real(dp), intent(in) :: coarse(m, *)  !! Vector of the coarse level (m, n_coarse) [any].
    real(dp), intent(out) :: x(dim, n)  !! P times it (dim, n) [as `coarse`].
    real(dp) :: s
    integer :: i, j, k, l
    !$omp parallel do default(none) shared(m, dim, n, start, column, value, coarse, x) private(s, j, k, l) &
    !$omp& schedule(static)
    do i = 1, n
      x(:, i) = 0
      do k = start(i), start(i + 1) - 1
        do j = 1, dim
          s = 0
          do l = 1, m
            s = s + value(l, j, k)*coarse(l, column(k))
          end do
          x(j, i) = x(j, i) + s
        end do
      end do
    end do
    !$omp end parallel do
  end subroutine prolong_rows

  !> Hand the arrays over to another prolongator.
  subroutine prolongator_move_to(self, other)
    class(block_prolongator_t), intent(inout) :: self
    class(block_prolongator_t), intent(inout) :: other  !! Becomes this prolongator; what it had is freed.
    other%m = self%m
    other%dim = self%dim
    other%n_coarse = self%n_coarse
    call move_alloc(self%start, other%start)
    call move_alloc(self%column, other%column)
    call move_alloc(self%value, other%value)
    call move_alloc(self%first, other%first)
    call move_alloc(self%row, other%row)
    call move_alloc(self%entry, other%entry)
    self%n_coarse = 0
  end subroutine prolongator_move_to

  !> Memory of the arrays [bytes].
  pure integer(int64) function prolongator_bytes(self) result(bytes)
    class(block_prolongator_t), intent(in) :: self
    bytes = 0
    if (.not. allocated(self%column)) return
    bytes = 4_int64*(size(self%start) + size(self%first) + 3*size(self%column, kind=int64)) + &
            4*size(self%value, kind=int64)
  end function prolongator_bytes

  !> Free the memory.
  subroutine prolongator_destroy(self)
    class(block_prolongator_t), intent(inout) :: self
    self%n_coarse = 0
    if (allocated(self%start)) deallocate (self%start)
    if (allocated(self%column)) deallocate (self%column, self%value, self%first, self%row, self%entry)
  end subroutine prolongator_destroy
end module dotyk_linalg_block_prolongator
