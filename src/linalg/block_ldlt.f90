!> Factorization of symmetric saddle point matrices of dense blocks, `A = [M -G; -G^T -H]` in any order of its blocks.
!>
!> M is positive definite, H is not negative; columns of G may depend on each other. Nothing is pivoted: a block of H that comes after all
!> blocks of M that it touches has become `-H - G^T M^{-1} G`, not positive, and what is left of it where it vanishes touches nothing any more.
!> These directions are told apart by its eigenvalues, and stay out: a generalized inverse. The factor is `L D L^T`, D = 1 for the
!> columns of M and -1 for those of H; in place of a triangle blocks of H have the root of their inverse. Systems are solved by
!> `dotyk_linalg_block_ldlt_solution`.
module dotyk_linalg_block_ldlt
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm
  use dotyk_linalg_block_tree, only: block_tree_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_linalg_lapack, only: dpotrf
  implicit none
  private

  !> A dense matrix.
  type, public :: dense_t
    real(dp), allocatable :: x(:, :)
  end type dense_t

  !> The matrix, then its factor.
  type, public :: block_ldlt_t
    type(block_tree_t) :: tree
    !> 1 for blocks of M, -1 for those of H (n_blocks).
    integer, allocatable :: sign(:)
    !> Row of its group's panel before each block, from 0, by times (n_blocks).
    integer, allocatable :: offset(:)
    !> First time of each run, blocks of M that are eliminated at once or a block of H; first run of each group (n_runs + 1),
    !> (n_groups + 1).
    integer, allocatable :: run(:), first_run(:)
    !> Panels, and roots of the inverses of blocks of H by times (n_groups), (n_blocks).
    type(dense_t), allocatable :: panel(:), root(:)
    !> Directions that stay out: block of each, and their components as columns (largest block, number).
    integer, allocatable :: null_block(:)
    real(dp), allocatable :: null_direction(:, :)
  contains
    procedure :: init => saddle_init
    procedure :: add => saddle_add
    procedure :: factorize => saddle_factorize
    procedure :: columns => saddle_columns
    procedure :: destroy => saddle_destroy
  end type block_ldlt_t

  !> Directions of a block of H whose eigenvalue is below this part of what it would be with the diagonal of M alone have none.
  real(dp), parameter :: least_eigenvalue = 1.0e-12_dp
  !> Columns that are eliminated run by run at a time, and those of runs of several blocks.
  integer, parameter :: columns_of_lot = 64

contains

  !> A matrix of zeros.
  subroutine saddle_init(self, sizes, sign, start, neighbour, order)
    class(block_ldlt_t), intent(inout) :: self
    !> As in `block_tree_t`; no block of H may come before a block of M that it touches.
    integer, intent(in) :: sizes(:), sign(:), start(:), neighbour(:), order(:)
    integer :: g, k, at
    call self%destroy()
    call self%tree%init(sizes, start, neighbour, order)
    self%sign = sign
    allocate (self%panel(self%tree%n_groups), self%root(self%tree%n_blocks), self%offset(self%tree%n_blocks))
    do g = 1, self%tree%n_groups
      at = 0
      do k = self%tree%begin(g), self%tree%begin(g + 1) - 1
        self%offset(k) = at
        at = at + sizes(self%tree%order(k))
      end do
      allocate (self%panel(g)%x(self%tree%height(g), self%tree%width(g)), source=0.0_dp)
    end do
    call find_runs(self)
  end subroutine saddle_init

  !> Put blocks of M that come one after the other together.
  subroutine find_runs(self)
    class(block_ldlt_t), intent(inout) :: self
    integer :: g, k, n, columns
    allocate (self%run(self%tree%n_blocks + 1), self%first_run(self%tree%n_groups + 1))
    n = 0
    do g = 1, self%tree%n_groups
      self%first_run(g) = n + 1
      columns = columns_of_lot
      do k = self%tree%begin(g), self%tree%begin(g + 1) - 1
        associate (block => self%tree%order(k))
          columns = columns + self%tree%size(block)
          if (columns > columns_of_lot .or. self%sign(block) < 0) then
            n = n + 1
            self%run(n) = k
            columns = self%tree%size(block)
          end if
          if (self%sign(block) < 0) columns = columns_of_lot
        end associate
      end do
    end do
    self%first_run(self%tree%n_groups + 1) = n + 1
    self%run(n + 1) = self%tree%n_blocks + 1
    self%run = self%run(:n + 1)
  end subroutine find_runs

  !> Columns of the blocks eliminated from one time to another, of the same group.
  pure integer function saddle_columns(self, first, last) result(columns)
    class(block_ldlt_t), intent(in) :: self
    integer, intent(in) :: first, last
    columns = self%offset(last) + self%tree%size(self%tree%order(last)) - self%offset(first)
  end function saddle_columns

  !> Add to a block; its mirror image is added to by itself.
  subroutine saddle_add(self, p, q, part)
    class(block_ldlt_t), intent(inout) :: self
    !> The block: row and column.
    integer, intent(in) :: p, q
    !> (rows of block p, rows of block q)
    real(dp), intent(in) :: part(:, :)
    integer :: k, l, g, row, column
    k = min(self%tree%time(p), self%tree%time(q))
    l = max(self%tree%time(p), self%tree%time(q))
    g = self%tree%group(k)
    column = self%offset(k)
    if (self%tree%group(l) == g) then
      row = self%offset(l)
    else
      row = self%tree%row_under(g, l)
    end if
    associate (x => self%panel(g)%x)
      if (self%tree%time(p) >= self%tree%time(q)) then
        x(row + 1:row + size(part, 1), column + 1:column + size(part, 2)) = &
          x(row + 1:row + size(part, 1), column + 1:column + size(part, 2)) + part
      else
        x(row + 1:row + size(part, 2), column + 1:column + size(part, 1)) = &
          x(row + 1:row + size(part, 2), column + 1:column + size(part, 1)) + transpose(part)
      end if
    end associate
  end subroutine saddle_add

  !> Factorize in place.
  subroutine saddle_factorize(self, reference, failed)
    class(block_ldlt_t), intent(inout) :: self
    !> What eigenvalues of blocks of H are compared with, 0 where they are positive; not looked at for blocks of M (n_blocks).
    real(dp), intent(in) :: reference(:)
    !> A block whose pivots are not positive; 0 if all is well.
    integer, intent(out) :: failed
    type(dense_t), allocatable :: update(:)
    integer, allocatable :: place(:), child(:), next(:)
    integer :: g, c, below
    allocate (update(self%tree%n_groups), place(self%tree%n_blocks), child(self%tree%n_groups), next(self%tree%n_groups))
    allocate (self%null_block(0), self%null_direction(maxval([0, self%tree%size]), 0))
    child = 0
    do g = self%tree%n_groups, 1, -1
      if (self%tree%parent(g) == 0) cycle
      next(g) = child(self%tree%parent(g))
      child(self%tree%parent(g)) = g
    end do
    do g = 1, self%tree%n_groups
      below = self%tree%height(g) - self%tree%width(g)
      allocate (update(g)%x(below, below), source=0.0_dp)
      call find_places(self, g, place)
      c = child(g)
      do while (c > 0)
        call add_update(self%tree, c, place, update(c)%x, self%panel(g)%x, update(g)%x)
        deallocate (update(c)%x)
        c = next(c)
      end do
      call factor_group(self, g, reference, failed)
      if (failed > 0) return
      if (below > 0) call subtract_products(self, g, update(g)%x)
    end do
  end subroutine saddle_factorize

  !> Row of a group's panel before each of its blocks, from 0, by times.
  subroutine find_places(self, g, place)
    type(block_ldlt_t), intent(in) :: self
    integer, intent(in) :: g
    integer, intent(inout) :: place(:)
    integer :: i
    do i = self%tree%begin(g), self%tree%begin(g + 1) - 1
      place(i) = self%offset(i)
    end do
    do i = self%tree%under_start(g), self%tree%under_start(g + 1) - 1
      place(self%tree%under(i)) = self%tree%under_row(i)
    end do
  end subroutine find_places

  !> Add what a child leaves to its parent's panel and update.
  subroutine add_update(tree, c, place, left, panel, update)
    type(block_tree_t), intent(in) :: tree
    !> The child.
    integer, intent(in) :: c
    !> In the parent's panel, by times.
    integer, intent(in) :: place(:)
    real(dp), intent(in) :: left(:, :)
    real(dp), intent(inout) :: panel(:, :), update(:, :)
    integer :: to(size(left, 1)), i, j, n, width
    n = 0
    do i = tree%under_start(c), tree%under_start(c + 1) - 1
      associate (rows => tree%size(tree%order(tree%under(i))))
        to(n + 1:n + rows) = [(place(tree%under(i)) + j, j=1, rows)]
        n = n + rows
      end associate
    end do
    width = size(panel, 2)
    do j = 1, n
      if (to(j) <= width) then
        do i = j, n
          panel(to(i), to(j)) = panel(to(i), to(j)) + left(i, j)
        end do
      else
        do i = j, n
          update(to(i) - width, to(j) - width) = update(to(i) - width, to(j) - width) + left(i, j)
        end do
      end if
    end do
  end subroutine add_update

  !> Eliminate the columns of a panel: runs in lots, so that most products are of many columns.
  subroutine factor_group(self, g, reference, failed)
    type(block_ldlt_t), intent(inout) :: self
    integer, intent(in) :: g
    real(dp), intent(in) :: reference(:)
    integer, intent(out) :: failed
    integer :: first, last, k
    failed = 0
    first = self%first_run(g)
    do while (first < self%first_run(g + 1))
      last = first
      do while (last + 1 < self%first_run(g + 1))
        if (self%columns(self%run(first), self%run(last + 2) - 1) > columns_of_lot) exit
        last = last + 1
      end do
      call subtract_columns(self, g, self%tree%begin(g), self%run(first), self%run(last + 1) - 1)
      do k = first, last
        call subtract_columns(self, g, self%run(first), self%run(k), self%run(k + 1) - 1)
        call factor_run(self, g, self%run(k), self%run(k + 1) - 1, reference, failed)
        if (failed > 0) return
      end do
      first = last + 1
    end do
  end subroutine factor_group

  !> Subtract the products of the columns of the blocks from `from` to `first` - 1 from those of the blocks first .. last.
  subroutine subtract_columns(self, g, from, first, last)
    type(block_ldlt_t), intent(inout) :: self
    !> Group, and times.
    integer, intent(in) :: g, from, first, last
    real(dp), allocatable :: signed(:, :)
    integer :: at, begin, k, n, i, j
    begin = self%offset(from)
    k = self%offset(first) - begin
    at = self%offset(first)
    n = self%columns(first, last)
    if (k == 0 .or. n == 0) return
    allocate (signed(k, n))
    associate (x => self%panel(g)%x, m => self%tree%height(g))
      ! D L^T.
      do i = from, first - 1
        do j = self%offset(i) + 1, self%offset(i) + self%tree%size(self%tree%order(i))
          signed(j - begin, :) = self%sign(self%tree%order(i))*x(at + 1:at + n, j)
        end do
      end do
      call dgemm('N', 'N', m - at, n, k, -1.0_dp, x(at + 1, begin + 1), m, signed, k, 1.0_dp, x(at + 1, at + 1), m)
    end associate
  end subroutine subtract_columns

  !> Eliminate the columns of one run.
  subroutine factor_run(self, g, first, last, reference, failed)
    type(block_ldlt_t), intent(inout) :: self
    !> Group and times.
    integer, intent(in) :: g, first, last
    real(dp), intent(in) :: reference(:)
    integer, intent(out) :: failed
    integer :: at, n, rows, info, k
    failed = 0
    at = self%offset(first)
    n = self%columns(first, last)
    if (n == 0) return
    associate (x => self%panel(g)%x, m => self%tree%height(g))
      rows = m - at - n
      if (self%sign(self%tree%order(first)) > 0) then
        call dpotrf('L', n, x(at + 1, at + 1), m, info)
        if (info == 0 .and. rows > 0) &
          call dtrsm('R', 'L', 'T', 'N', rows, n, 1.0_dp, x(at + 1, at + 1), m, x(at + n + 1, at + 1), m)
        if (info == 0 .and. .not. ieee_is_finite(x(at + n, at + n))) info = n
      else
        call take_root(self, first, reference(self%tree%order(first)), x(at + 1:at + n, at + 1:at + n), info)
        if (info == 0) x(at + n + 1:, at + 1:at + n) = -matmul(x(at + n + 1:, at + 1:at + n), self%root(first)%x)
      end if
      if (info == 0) return
      do k = first, last
        failed = self%tree%order(k)
        if (info <= self%columns(first, k)) exit
      end do
    end associate
  end subroutine factor_run

  !> The root R of the generalized inverse of a block of H, `(-A)^+ = R R^T`, and the directions that stay out. None does where the
  !> reference is zero, and elimination keeps directions apart that have nothing to do with each other.
  subroutine take_root(self, k, reference, a, failed)
    type(block_ldlt_t), intent(inout) :: self
    !> Time of the block.
    integer, intent(in) :: k
    real(dp), intent(in) :: reference
    !> Lower triangle.
    real(dp), intent(in) :: a(:, :)
    integer, intent(out) :: failed
    type(error_t), allocatable :: error
    real(dp) :: full(size(a, 1), size(a, 1)), values(size(a, 1)), vectors(size(a, 1), size(a, 1))
    real(dp), allocatable :: direction(:, :)
    integer :: i, n
    n = size(a, 1)
    do i = 1, n
      full(i:, i) = -a(i:, i)
      full(i, i:) = -a(i:, i)
    end do
    failed = 1
    if (.not. all(ieee_is_finite(full))) return
    if (.not. reference > 0) then
      call invert_root(full, vectors, failed)
      if (failed == 0) self%root(k)%x = vectors
      if (failed == 0) return
    end if
    call symmetric_eigen(full, values, vectors, error)
    if (allocated(error)) return
    failed = 0
    do i = 1, n
      if (values(i) > least_eigenvalue*reference .and. values(i) > tiny(1.0_dp)) then
        vectors(:, i) = vectors(:, i)/sqrt(values(i))
      else
        allocate (direction(size(self%null_direction, 1), size(self%null_block) + 1), source=0.0_dp)
        direction(:, :size(self%null_block)) = self%null_direction
        direction(:n, size(self%null_block) + 1) = vectors(:, i)
        call move_alloc(direction, self%null_direction)
        self%null_block = [self%null_block, self%tree%order(k)]
        vectors(:, i) = 0
      end if
    end do
    self%root(k)%x = vectors
  end subroutine take_root

  !> The root of the inverse of a positive definite matrix, `L^{-T}`.
  subroutine invert_root(a, root, failed)
    real(dp), intent(in) :: a(:, :)
    real(dp), intent(out) :: root(:, :)
    !> 0 if all is well.
    integer, intent(out) :: failed
    real(dp) :: factor(size(a, 1), size(a, 1))
    integer :: i, n
    n = size(a, 1)
    factor = a
    call dpotrf('L', n, factor, n, failed)
    if (failed /= 0) return
    root = 0
    do i = 1, n
      root(i, i) = 1
    end do
    call dtrsm('L', 'L', 'T', 'N', n, n, 1.0_dp, factor, n, root, n)
  end subroutine invert_root

  !> Subtract L D L^T of a panel's lower part: columns of M and of H for themselves.
  subroutine subtract_products(self, g, update)
    type(block_ldlt_t), intent(in) :: self
    integer, intent(in) :: g
    real(dp), intent(inout) :: update(:, :)
    real(dp), allocatable :: columns(:, :)
    integer :: k, n, s, below, width
    below = size(update, 1)
    width = self%tree%width(g)
    allocate (columns(below, width))
    do s = 1, -1, -2
      n = 0
      do k = self%tree%begin(g), self%tree%begin(g + 1) - 1
        if (self%sign(self%tree%order(k)) /= s) cycle
        associate (own => self%tree%size(self%tree%order(k)))
          columns(:, n + 1:n + own) = self%panel(g)%x(width + 1:, self%offset(k) + 1:self%offset(k) + own)
          n = n + own
        end associate
      end do
      if (n > 0) call dsyrk('L', 'N', below, n, real(-s, dp), columns, below, 1.0_dp, update, below)
    end do
  end subroutine subtract_products

  !> Give back all memory.
  subroutine saddle_destroy(self)
    class(block_ldlt_t), intent(inout) :: self
    if (allocated(self%panel)) deallocate (self%panel, self%root, self%offset)
    if (allocated(self%run)) deallocate (self%run, self%first_run)
    if (allocated(self%null_block)) deallocate (self%null_block, self%null_direction)
    self%tree%n_blocks = 0
  end subroutine saddle_destroy
end module dotyk_linalg_block_ldlt
