!> Cholesky factorization of a symmetric positive definite matrix of dense blocks, many of them zero.
!>
!> Block columns are panels, dense by columns: their own block first, then those under it in the order of elimination, fill included.
!> So every operation is one of dense matrices, and nothing is looked up by entries.
module dotyk_linalg_block_cholesky
  use dotyk_base_error, only: error_t, set_error, exit_machine
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm
  use dotyk_linalg_lapack, only: dpotrf
  implicit none
  private

  !> The matrix, then its factor.
  type, public :: block_cholesky_t
    !> Number of block rows, and order of the matrix.
    integer :: n_blocks = 0, n = 0
    !> First row of each block (n_blocks + 1).
    integer, allocatable :: first(:)
    !> The block that is eliminated k-th, and when each is (n_blocks).
    integer, allocatable, private :: order(:), time(:)
    !> Panel k: under its own block those eliminated at times row(row_start(k):row_start(k+1)-1), ascending, each after `offset` rows
    !> of the panel; number of its rows; and where its values begin (n_blocks + 1).
    integer, allocatable, private :: row_start(:), row(:), offset(:), height(:)
    integer(int64), allocatable, private :: value_start(:)
    real(dp), allocatable, private :: value(:)
  contains
    procedure :: init => block_init
    procedure :: add => block_add
    procedure :: add_diagonal => block_add_diagonal
    procedure :: get_diagonal => block_get_diagonal
    procedure :: factorize => block_factorize
    procedure :: solve => block_solve
    procedure :: destroy => block_destroy
  end type block_cholesky_t

contains

  !> A matrix of zeros.
  subroutine block_init(self, sizes, coupled, order, error)
    class(block_cholesky_t), intent(out) :: self
    !> Rows of each block (n_blocks).
    integer, intent(in) :: sizes(:)
    !> Which blocks are not zero, symmetric (n_blocks, n_blocks).
    logical, intent(in) :: coupled(:, :)
    !> The block that is eliminated k-th (n_blocks).
    integer, intent(in) :: order(:)
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    logical, allocatable :: filled(:, :)
    integer, allocatable :: later(:)
    integer :: k, i, status
    self%n_blocks = size(sizes)
    self%n = sum(sizes)
    self%order = order
    allocate (self%first(self%n_blocks + 1), self%time(self%n_blocks), self%row(0), self%offset(0))
    allocate (self%row_start(self%n_blocks + 1), self%height(self%n_blocks), self%value_start(self%n_blocks + 1))
    self%first(1) = 1
    do k = 1, self%n_blocks
      self%first(k + 1) = self%first(k) + sizes(k)
      self%time(order(k)) = k
    end do
    filled = coupled(order, order)
    self%row_start(1) = 1
    self%value_start(1) = 1
    do k = 1, self%n_blocks
      later = pack([(i, i=k + 1, self%n_blocks)], filled(k + 1:, k) .and. sizes(order(k + 1:)) > 0)
      if (sizes(order(k)) == 0) later = [integer ::]
      do i = 1, size(later)
        filled(later, later(i)) = .true.
      end do
      self%height(k) = sizes(order(k))
      do i = 1, size(later)
        self%offset = [self%offset, self%height(k)]
        self%height(k) = self%height(k) + sizes(order(later(i)))
      end do
      self%row = [self%row, later]
      self%row_start(k + 1) = size(self%row) + 1
      self%value_start(k + 1) = self%value_start(k) + int(sizes(order(k)), int64)*self%height(k)
    end do
    allocate (self%value(self%value_start(self%n_blocks + 1) - 1), source=0.0_dp, stat=status)
    if (status /= 0) call set_error(error, 'out of memory for a matrix of dense blocks of '//to_text(self%n)//' rows', &
                                    exit_machine)
  end subroutine block_init

  !> Where a block is: row of the panel before it, from 0.
  pure integer function place_in_panel(self, k, i) result(place)
    class(block_cholesky_t), intent(in) :: self
    !> Times of the panel's own block and of the block.
    integer, intent(in) :: k, i
    integer :: j
    place = 0
    if (i == k) return
    do j = self%row_start(k), self%row_start(k + 1) - 1
      if (self%row(j) == i) place = self%offset(j)
    end do
  end function place_in_panel

  !> Rows of the block that is eliminated k-th.
  pure integer function width(self, k)
    class(block_cholesky_t), intent(in) :: self
    integer, intent(in) :: k
    width = self%first(self%order(k) + 1) - self%first(self%order(k))
  end function width

  !> Add to a block; its mirror image is added to by itself.
  subroutine block_add(self, p, q, part)
    class(block_cholesky_t), intent(inout) :: self
    !> The block: row and column.
    integer, intent(in) :: p, q
    !> (rows of block p, rows of block q)
    real(dp), intent(in) :: part(:, :)
    integer(int64) :: at
    integer :: k, place, j
    k = min(self%time(p), self%time(q))
    place = place_in_panel(self, k, max(self%time(p), self%time(q)))
    do j = 1, width(self, k)
      at = self%value_start(k) + place + int(j - 1, int64)*self%height(k)
      if (self%time(p) >= self%time(q)) then
        self%value(at:at + size(part, 1) - 1) = self%value(at:at + size(part, 1) - 1) + part(:, j)
      else
        self%value(at:at + size(part, 2) - 1) = self%value(at:at + size(part, 2) - 1) + part(j, :)
      end if
    end do
  end subroutine block_add

  !> Place of a diagonal entry.
  pure integer(int64) function diagonal_place(self, k, i) result(place)
    class(block_cholesky_t), intent(in) :: self
    !> Time of the block, and the row in it.
    integer, intent(in) :: k, i
    place = self%value_start(k) + int(i - 1, int64)*(self%height(k) + 1)
  end function diagonal_place

  !> Add to the diagonal.
  subroutine block_add_diagonal(self, change)
    class(block_cholesky_t), intent(inout) :: self
    !> (n)
    real(dp), intent(in) :: change(:)
    integer :: k, i
    do k = 1, self%n_blocks
      do i = 1, width(self, k)
        associate (entry => self%value(diagonal_place(self, k, i)))
          entry = entry + change(self%first(self%order(k)) + i - 1)
        end associate
      end do
    end do
  end subroutine block_add_diagonal

  !> The diagonal.
  subroutine block_get_diagonal(self, diagonal)
    class(block_cholesky_t), intent(in) :: self
    !> (n)
    real(dp), intent(out) :: diagonal(:)
    integer :: k, i
    do k = 1, self%n_blocks
      do i = 1, width(self, k)
        diagonal(self%first(self%order(k)) + i - 1) = self%value(diagonal_place(self, k, i))
      end do
    end do
  end subroutine block_get_diagonal

  !> Factorize in place.
  subroutine block_factorize(self, failed)
    class(block_cholesky_t), intent(inout) :: self
    !> A row whose pivot was not positive; 0 if all is well.
    integer, intent(out) :: failed
    integer(int64) :: target
    integer :: k, i, j, n
    failed = 0
    do k = 1, self%n_blocks
      n = width(self, k)
      if (n == 0) cycle
      associate (panel => self%value(self%value_start(k):self%value_start(k + 1) - 1), height => self%height(k))
        call dpotrf('L', n, panel, height, failed)
        if (failed > 0) then
          failed = self%first(self%order(k)) + failed - 1
          return
        end if
        if (height > n) call dtrsm('R', 'L', 'T', 'N', height - n, n, 1.0_dp, panel, height, panel(n + 1), height)
        do i = self%row_start(k), self%row_start(k + 1) - 1
          associate (column => self%row(i))
            target = self%value_start(column)
            call dsyrk('L', 'N', width(self, column), n, -1.0_dp, panel(self%offset(i) + 1), height, 1.0_dp, self%value(target), &
                       self%height(column))
            do j = i + 1, self%row_start(k + 1) - 1
              call dgemm('N', 'T', width(self, self%row(j)), width(self, column), n, -1.0_dp, panel(self%offset(j) + 1), height, &
                         panel(self%offset(i) + 1), height, 1.0_dp, &
                         self%value(target + place_in_panel(self, column, self%row(j))), self%height(column))
            end do
          end associate
        end do
      end associate
    end do
  end subroutine block_factorize

  !> X <- A^{-1} X.
  subroutine block_solve(self, x)
    !> Factorized.
    class(block_cholesky_t), intent(in) :: self
    !> (n, number of right-hand sides)
    real(dp), intent(inout), contiguous :: x(:, :)
    if (size(x) > 0) call solve_columns(self, size(x, 1), size(x, 2), x)
  end subroutine block_solve

  !> Forwards and backwards.
  subroutine solve_columns(self, lead, m, x)
    class(block_cholesky_t), intent(in) :: self
    integer, intent(in) :: lead, m
    real(dp), intent(inout) :: x(lead, m)
    integer :: k, j, n
    do k = 1, self%n_blocks
      n = width(self, k)
      if (n == 0) cycle
      associate (panel => self%value(self%value_start(k):self%value_start(k + 1) - 1), own => self%first(self%order(k)))
        call dtrsm('L', 'L', 'N', 'N', n, m, 1.0_dp, panel, self%height(k), x(own, 1), lead)
        do j = self%row_start(k), self%row_start(k + 1) - 1
          call dgemm('N', 'N', width(self, self%row(j)), m, n, -1.0_dp, panel(self%offset(j) + 1), self%height(k), x(own, 1), &
                     lead, 1.0_dp, x(self%first(self%order(self%row(j))), 1), lead)
        end do
      end associate
    end do
    do k = self%n_blocks, 1, -1
      n = width(self, k)
      if (n == 0) cycle
      associate (panel => self%value(self%value_start(k):self%value_start(k + 1) - 1), own => self%first(self%order(k)))
        do j = self%row_start(k), self%row_start(k + 1) - 1
          call dgemm('T', 'N', n, m, width(self, self%row(j)), -1.0_dp, panel(self%offset(j) + 1), self%height(k), &
                     x(self%first(self%order(self%row(j))), 1), lead, 1.0_dp, x(own, 1), lead)
        end do
        call dtrsm('L', 'L', 'T', 'N', n, m, 1.0_dp, panel, self%height(k), x(own, 1), lead)
      end associate
    end do
  end subroutine solve_columns

  !> Give back all memory.
  subroutine block_destroy(self)
    class(block_cholesky_t), intent(inout) :: self
    if (allocated(self%value)) deallocate (self%value)
    self%n_blocks = 0
    self%n = 0
  end subroutine block_destroy
end module dotyk_linalg_block_cholesky
