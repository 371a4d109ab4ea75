!> Sparse symmetric matrices of 2x2 or 3x3 blocks, one block row for each node of a body.
!>
!> All blocks are stored, not only those of one triangle: rows are then independent, which threads and a fixed order of
!> sums need. An entry is scale*(high + low), two numbers in single precision: the product in double precision reads
!> both (2^-50 of the entry is lost), residuals read high. Smoothers, whose polynomials are as good for a matrix nearby,
!> read the upper 16 bits of high, the entry to 2^-7 of it, which stand apart. Together these parts take the memory of
!> one number in double precision. The scale, a power of two, keeps any unit within the range of single precision.
!>
!> A matrix is assembled (`init`, `add_blocks`, `hold`), then packed (`pack`), then used.
module dotyk_linalg_block_rows
  use, intrinsic :: iso_fortran_env, only: int16, int32
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_linalg_block_products, only: product_rows, residual_rows, subtract_product_rows
  implicit none
  private

  type, public :: block_rows_t  !! The matrix.
    integer :: dim = 0  !! Order of the blocks, 2 or 3.
    integer :: n = 0  !! Number of block rows.
    integer(int64), allocatable :: start(:)  !! First block of each row, the diagonal one; then by columns (n + 1).
    integer, allocatable :: column(:)  !! Block column of each block (n_blocks).
    real(dp) :: scale = 1  !! Scale of the entries, a power of two [matrix].
    !> Leading parts of the entries until they are packed: (i, j) at i + dim*(j - 1); the last block is not used, here
    !> and in the next three (dim*dim, n_blocks + 1) [].
    real(sp), allocatable :: high(:, :)
    integer(int16), allocatable :: leading(:, :)  !! Upper halves of the leading parts (dim*dim, n_blocks + 1).
    integer(int16), allocatable :: trailing(:, :)  !! Their lower halves (dim*dim, n_blocks + 1).
    real(sp), allocatable :: low(:, :)  !! Remainders of the entries (dim*dim, n_blocks + 1) [].
  contains
    procedure :: init => block_rows_init
    procedure :: hold => block_rows_hold
    procedure :: pack => block_rows_pack
    procedure :: multiply => block_rows_multiply
    procedure :: residual => block_rows_residual
    procedure :: subtract_product => block_rows_subtract_product
    procedure :: invert_diagonal => block_rows_invert_diagonal
    procedure :: get_diagonal => block_rows_get_diagonal
    procedure :: get_block => block_rows_get_block
    procedure :: move_to => block_rows_move_to
    procedure :: bytes => block_rows_bytes
    procedure :: destroy => block_rows_destroy
  end type block_rows_t

  public :: add_blocks, power_of_two

contains

  !> Make a matrix of zeros with the pattern of a graph.
  subroutine block_rows_init(self, dim, start, neighbour, scale)
    class(block_rows_t), intent(out) :: self
    integer, intent(in) :: dim  !! Order of the blocks, 2 or 3.
    integer(int64), intent(in) :: start(:)  !! First neighbour of each node (n + 1).
    integer, intent(in) :: neighbour(:)  !! Neighbours of the nodes, ascending, without itself (start(n + 1) - 1).
    real(dp), intent(in) :: scale  !! Magnitude of the entries that will be added [matrix].
    integer(int64) :: first, length
    integer :: i
    self%dim = dim
    self%n = size(start) - 1
    self%scale = power_of_two(scale)
    allocate (self%start(self%n + 1), self%column(start(self%n + 1) - 1 + self%n))
    allocate (self%high(dim**2, size(self%column, kind=int64) + 1), self%low(dim**2, size(self%column, kind=int64) + 1))
    self%high(:, size(self%high, 2)) = 0
    self%low(:, size(self%low, 2)) = 0
    self%start(:) = [(start(i) + i - 1, i=1, self%n + 1)]
    ! Each thread touches the rows first that it multiplies later.
    !$omp parallel do default(none) shared(self, start, neighbour) private(first, length) schedule(static)
    do i = 1, self%n
      first = self%start(i)
      length = start(i + 1) - start(i)
      self%column(first) = i
      self%column(first + 1:first + length) = neighbour(start(i):start(i + 1) - 1)
      self%high(:, first:first + length) = 0
      self%low(:, first:first + length) = 0
    end do
    !$omp end parallel do
  end subroutine block_rows_init

  !> The power of two next below a positive number; 1 for others.
  pure real(dp) function power_of_two(x) result(power)
    real(dp), intent(in) :: x  !! The number [any].
    power = 1
    if (x > 0 .and. x <= huge(x)) power = 2.0_dp**(exponent(x) - 1)
  end function power_of_two

  !> Add an element matrix to the rows that a part owns, see `element_partition_t`.
  pure subroutine add_blocks(n, dim, n_nodes, node, k, part, owner, start, column, scale, high, low)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Order of the blocks.
    integer, intent(in) :: n_nodes  !! Number of block rows.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    real(dp), intent(in) :: k(n, n, dim, dim)  !! Element matrix: node a, node b, component i, component j [matrix].
    integer, intent(in) :: part  !! Index of the part.
    integer, intent(in) :: owner(n_nodes)  !! Part that owns each row (n_nodes); other rows are left to their owners.
    integer(int64), intent(in) :: start(n_nodes + 1)  !! First block of each row (n_nodes + 1).
    integer, intent(in) :: column(*)  !! Block column of each block (n_blocks).
    real(dp), intent(in) :: scale  !! Scale of the entries, a power of two [matrix].
    real(sp), intent(inout) :: high(dim, dim, *)  !! Leading parts of the entries (dim, dim, n_blocks) [].
    real(sp), intent(inout) :: low(dim, dim, *)  !! Remainders of the entries (dim, dim, n_blocks) [].
    integer :: order(n), a, ib, b, i, j
    integer(int64) :: p, place
    real(dp) :: sum, factor
    factor = 1/scale
    call sort_nodes(n, node, order)
    do a = 1, n
      if (owner(node(a)) /= part) cycle
      p = start(node(a))
      do ib = 1, n
        b = order(ib)
        if (node(b) == node(a)) then
          place = start(node(a))
        else
          ! From the column before: collapsed elements have a node twice.
          do while (column(p) /= node(b))
            p = p + 1
          end do
          place = p
        end if
        do j = 1, dim
          do i = 1, dim
            sum = (real(high(i, j, place), dp) + low(i, j, place)) + factor*k(a, b, i, j)
            high(i, j, place) = real(sum, sp)
            low(i, j, place) = real(sum - high(i, j, place), sp)
          end do
        end do
      end do
    end do
  end subroutine add_blocks

  !> Order of the nodes of an element by their numbers: insertion sort of at most 27 numbers.
  pure subroutine sort_nodes(n, node, order)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: node(n)  !! Nodes of the element (n).
    integer, intent(out) :: order(n)  !! Local index of the k-th node (n).
    integer :: i, k
    do i = 1, n
      k = i
      do while (k > 1)
        if (node(order(k - 1)) < node(i)) exit
        order(k) = order(k - 1)
        k = k - 1
      end do
      order(k) = i
    end do
  end subroutine sort_nodes

  !> Set the diagonal entries of components that are held, whose rows and columns are zero: D is regular then, and
  !> vectors that are zero there remain so.
  subroutine block_rows_hold(self, held)
    class(block_rows_t), intent(inout) :: self
    logical, intent(in) :: held(:, :)  !! Whether a component is held (dim, n).
    integer :: i, j
    do i = 1, self%n
      do j = 1, self%dim
        if (held(j, i)) self%high(j + self%dim*(j - 1), self%start(i)) = 1
      end do
    end do
  end subroutine block_rows_hold

  !> Separate the halves of the leading parts; no entries are added afterwards.
  subroutine block_rows_pack(self)
    class(block_rows_t), intent(inout) :: self
    allocate (self%leading(self%dim**2, size(self%low, 2, kind=int64)), &
              self%trailing(self%dim**2, size(self%low, 2, kind=int64)))
    call separate(self%n, self%dim**2, self%start, self%high, self%leading, self%trailing)
    deallocate (self%high)
  end subroutine block_rows_pack

  !> Upper and lower halves of numbers in single precision.
  subroutine separate(n, m, start, high, leading, trailing)
    integer, intent(in) :: n  !! Number of block rows.
    integer, intent(in) :: m  !! Entries of a block.
    integer(int64), intent(in) :: start(n + 1)  !! First block of each row (n + 1).
    real(sp), intent(in) :: high(m, *)  !! The numbers (m, n_blocks + 1) [any].
    integer(int16), intent(inout) :: leading(m, *)  !! Their upper halves (m, n_blocks + 1).
    integer(int16), intent(inout) :: trailing(m, *)  !! Their lower halves (m, n_blocks + 1).
    integer(int16) :: halves(2)
    integer(int64) :: k
    integer :: e, i, upper
    ! Where the upper half stands in memory.
    upper = 1
    if (transfer(1_int32, 0_int16) == 1_int16) upper = 2
    ! Each thread touches the rows first that it multiplies later.
    !$omp parallel do default(none) shared(n, m, start, high, leading, trailing, upper) private(halves, k, e) &
    !$omp& schedule(static)
    do i = 1, n
      do k = start(i), merge(start(i + 1), start(i + 1) - 1, i == n)
        do e = 1, m
          halves = transfer(high(e, k), halves)
          leading(e, k) = halves(upper)
          trailing(e, k) = halves(3 - upper)
        end do
      end do
    end do
    !$omp end parallel do
  end subroutine separate

  !> Entries of the leading part of a block.
  pure function joined(leading, trailing) result(high)
    integer(int16), intent(in) :: leading(:)  !! Upper halves (dim*dim).
    integer(int16), intent(in) :: trailing(:)  !! Lower halves (dim*dim).
    real(sp) :: high(size(leading))  !! (dim*dim) [].
    integer :: e
    do e = 1, size(leading)
      high(e) = transfer(ior(ishft(int(leading(e), int32), 16), iand(int(trailing(e), int32), 65535_int32)), 0.0_sp)
    end do
  end function joined

  !> y = A x.
  subroutine block_rows_multiply(self, x, y)
    class(block_rows_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Vector x (dim*n) [any].
    real(dp), intent(out), contiguous :: y(:)  !! Product y (dim*n) [matrix times x].
    integer :: i
    call product_rows(self%dim, self%n, self%start, self%column, self%leading, self%trailing, self%low, x, y)
    !$omp parallel do default(none) shared(self, y) schedule(static)
    do i = 1, self%dim*self%n
      y(i) = self%scale*y(i)
    end do
    !$omp end parallel do
  end subroutine block_rows_multiply

  !> r = b - A x/scale in single precision.
  subroutine block_rows_residual(self, b, x, r, rough)
    class(block_rows_t), intent(in) :: self
    real(sp), intent(in), contiguous :: b(:)  !! Right-hand side b (dim*n) [any].
    real(sp), intent(in), contiguous :: x(:)  !! Vector x (dim*n) [as b].
    real(sp), intent(out), contiguous :: r(:)  !! Residual r (dim*n) [as b].
    logical, intent(in), optional :: rough  !! Whether with the matrix of smoothers, see above; not if absent.
    integer :: whole
    whole = 1
    if (present(rough)) whole = merge(0, 1, rough)
    call residual_rows(self%dim, self%n, self%start, self%column, self%leading, self%trailing, whole, b, x, r)
  end subroutine block_rows_residual

  !> r := r - A x/scale with the leading parts of A and a vector x in double precision.
  subroutine block_rows_subtract_product(self, x, r)
    class(block_rows_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Vector x (dim*n) [any].
    real(sp), intent(inout), contiguous :: r(:)  !! Residual r (dim*n) [as x].
    call subtract_product_rows(self%dim, self%n, self%start, self%column, self%leading, self%trailing, x, r)
  end subroutine block_rows_subtract_product

  !> Inverses of the diagonal blocks of A/scale, in single precision.
  subroutine block_rows_invert_diagonal(self, inverse, regular)
    class(block_rows_t), intent(in) :: self
    real(sp), intent(out), contiguous :: inverse(:, :, :)  !! Inverse blocks (dim, dim, n) [].
    logical, intent(out) :: regular  !! Whether all blocks are positive definite.
    integer :: i
    logical :: positive
    regular = .true.
    !$omp parallel do default(none) shared(self, inverse) private(positive) reduction(.and.: regular) schedule(static)
    do i = 1, self%n
      call invert_block(self%dim, joined(self%leading(:, self%start(i)), self%trailing(:, self%start(i))), &
                        self%low(:, self%start(i)), inverse(:, :, i), positive)
      regular = regular .and. positive
    end do
    !$omp end parallel do
  end subroutine block_rows_invert_diagonal

  !> The diagonal entries.
  pure subroutine block_rows_get_diagonal(self, diagonal)
    class(block_rows_t), intent(in) :: self
    real(dp), intent(out) :: diagonal(:)  !! (dim*n) [matrix].
    real(dp) :: block(self%dim**2)
    integer :: i, k
    do i = 1, self%n
      block = real(joined(self%leading(:, self%start(i)), self%trailing(:, self%start(i))), dp) + &
        self%low(:, self%start(i))
      do k = 1, self%dim
        diagonal(self%dim*(i - 1) + k) = self%scale*block(1 + (self%dim + 1)*(k - 1))
      end do
    end do
  end subroutine block_rows_get_diagonal

  !> A block of A/scale.
  pure subroutine block_rows_get_block(self, k, block)
    class(block_rows_t), intent(in) :: self
    integer(int64), intent(in) :: k  !! Its number.
    real(dp), intent(out) :: block(self%dim, self%dim)  !! (dim, dim) [].
    block = reshape(joined(self%leading(:, k), self%trailing(:, k)) + real(self%low(:, k), dp), [self%dim, self%dim])
  end subroutine block_rows_get_block

  !> Inverse of one positive definite block, by Gauss-Jordan elimination.
  pure subroutine invert_block(dim, high, low, inverse, positive)
    integer, intent(in) :: dim  !! Order of the block.
    real(sp), intent(in) :: high(dim, dim)  !! Leading parts of its entries (dim, dim) [].
    real(sp), intent(in) :: low(dim, dim)  !! Remainders (dim, dim) [].
    real(sp), intent(out) :: inverse(dim, dim)  !! The inverse (dim, dim) [].
    logical, intent(out) :: positive  !! Whether all pivots are positive.
    real(dp) :: a(dim, dim), pivot, column(dim)
    integer :: j, k
    a = real(high, dp) + low
    positive = .true.
    do k = 1, dim
      pivot = a(k, k)
      positive = positive .and. pivot > 0
      if (.not. positive) exit
      column = a(:, k)
      a(:, k) = 0
      a(k, k) = 1
      a(k, :) = a(k, :)/pivot
      do j = 1, dim
        if (j /= k) a(j, :) = a(j, :) - column(j)*a(k, :)
      end do
    end do
    inverse = real(a, sp)
  end subroutine invert_block

  !> Hand the arrays over to another matrix.
  subroutine block_rows_move_to(self, other)
    class(block_rows_t), intent(inout) :: self
    class(block_rows_t), intent(inout) :: other  !! Becomes this matrix; what it had is freed.
    other%dim = self%dim
    other%n = self%n
    other%scale = self%scale
    call move_alloc(self%start, other%start)
    call move_alloc(self%column, other%column)
    call move_alloc(self%high, other%high)
    call move_alloc(self%leading, other%leading)
    call move_alloc(self%trailing, other%trailing)
    call move_alloc(self%low, other%low)
    self%n = 0
  end subroutine block_rows_move_to

  !> Memory of the arrays [bytes].
  pure integer(int64) function block_rows_bytes(self) result(bytes)
    class(block_rows_t), intent(in) :: self
    bytes = 0
    if (.not. allocated(self%column)) return
    bytes = 8_int64*size(self%start, kind=int64) + (4 + 8_int64*self%dim**2)*size(self%column, kind=int64)
  end function block_rows_bytes

  !> Free the memory.
  subroutine block_rows_destroy(self)
    class(block_rows_t), intent(inout) :: self
    self%n = 0
    if (allocated(self%start)) deallocate (self%start, self%column, self%low)
    if (allocated(self%high)) deallocate (self%high)
    if (allocated(self%leading)) deallocate (self%leading, self%trailing)
  end subroutine block_rows_destroy
end module dotyk_linalg_block_rows
