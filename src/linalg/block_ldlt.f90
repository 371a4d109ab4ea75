!> Block-sparse LDL^T factorization, without pivoting, of a symmetric quasi-definite or saddle point matrix
!> `A = [M -G; -G^T -H]` whose blocks stand in any order.
!>
!> M is positive definite, H positive semidefinite; columns of G may be linearly dependent. A matrix without blocks of H
!> is positive definite, and the factorization is Cholesky's. Pivoting is not needed (Vanderbei, SIAM J. Optim. 5, 1995,
!> for definite H): a block of H that is eliminated after all blocks of M that it couples to is then the negative Schur
!> complement `-(H + G^T M^{-1} G)`. Where this is singular, its null directions couple to nothing that remains; they
!> are detected by eigenvalues and deflated, so that the factor gives a generalized inverse and, by
!> `dotyk_linalg_block_ldlt_solution`, the null space of A.
!>
!> The factor is `L D L^T` with D = 1 for columns of M and -1 for columns of H. The numeric phase is multifrontal: dense
!> panels along the elimination tree of the blocks (`dotyk_linalg_block_tree`). A diagonal block of M holds its Cholesky
!> factor, a block of H the root of its generalized inverse. No library is used: sparse LDL^T codes pivot by entries and
!> compare null pivots with one threshold for the whole matrix (MUMPS); here the eigenvalues of a whole block are
!> compared with a magnitude of its own, so that bodies of very different stiffness are told apart.
module dotyk_linalg_block_ldlt
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_blas, only: dgemm, dsyrk, dtrsm
  use dotyk_linalg_block_extend_add, only: add_update, find_places
  use dotyk_linalg_block_tree, only: block_tree_t
  use dotyk_linalg_inverse_root, only: find_inverse_root
  use dotyk_linalg_lapack, only: dpotrf
  implicit none
  private

  !> A dense matrix.
  type, public :: dense_t
    !> Entries (rows, columns).
    real(dp), allocatable :: x(:, :)
  end type dense_t

  !> The matrix, and after `factorize` its factor.
  type, public :: block_ldlt_t
    !> Order of elimination and structure of the factor.
    type(block_tree_t) :: tree
    !> 1 for blocks of M, -1 for blocks of H (n_blocks).
    integer, allocatable :: sign(:)
    !> Rows of the group's panel before the block, by elimination times (n_blocks).
    integer, allocatable :: offset(:)
    !> First time of each run: blocks of M that are eliminated by one call of LAPACK, or one block of H (n_runs + 1).
    integer, allocatable :: run(:)
    !> First run of each group (n_groups + 1).
    integer, allocatable :: first_run(:)
    !> Panels: the columns of a group, lower trapezoid (n_groups).
    type(dense_t), allocatable :: panel(:)
    !> Roots R of the generalized inverses of the blocks of H, `(-A_kk)^+ = R R^T`, by elimination times (n_blocks).
    type(dense_t), allocatable :: root(:)
    !> Block of each null direction (n_null).
    integer, allocatable :: null_block(:)
    !> Components of the null directions in their blocks, as columns (largest block, n_null).
    real(dp), allocatable :: null_direction(:, :)
  contains
    procedure :: init => block_ldlt_init
    procedure :: add => block_ldlt_add
    procedure :: add_diagonal => block_ldlt_add_diagonal
    procedure :: factorize => block_ldlt_factorize
    procedure :: columns => block_ldlt_columns
    procedure :: destroy => block_ldlt_destroy
  end type block_ldlt_t

  !> Columns of a panel that are updated together by level 3 BLAS, and columns of a run of several blocks at most.
  integer, parameter :: chunk_columns = 64

contains

  !> A zero matrix of the given structure. One structure is analysed once, however often it comes in succession.
  subroutine block_ldlt_init(self, sizes, sign, start, neighbour, order)
    !> The matrix.
    class(block_ldlt_t), intent(inout) :: self
    !> Rows of each block (n_blocks).
    integer, intent(in) :: sizes(:)
    !> 1 for blocks of M, -1 for blocks of H (n_blocks).
    integer, intent(in) :: sign(:)
    !> Coupled blocks of block p without p itself: neighbour(start(p):start(p+1)-1); symmetric (n_blocks + 1).
    integer, intent(in) :: start(:)
    !> See `start` (number of couplings).
    integer, intent(in) :: neighbour(:)
    !> The block that is eliminated k-th, but for the order of independent ones. No block of H comes before a block of M
    !> that it couples to (n_blocks).
    integer, intent(in) :: order(:)
    integer :: g, k, at
    if (self%tree%is_made_of(sizes, start, neighbour, order)) then
      do g = 1, self%tree%n_groups
        self%panel(g)%x = 0
      end do
      deallocate (self%root, self%run, self%first_run)
      allocate (self%root(self%tree%n_blocks))
      if (allocated(self%null_block)) deallocate (self%null_block, self%null_direction)
      self%sign = sign
      call find_runs(self)
      return
    end if
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
  end subroutine block_ldlt_init

  !> Divide the groups into runs: successive blocks of M together, blocks of H alone.
  subroutine find_runs(self)
    !> Sets `run` and `first_run`.
    class(block_ldlt_t), intent(inout) :: self
    logical :: is_last
    integer :: g, k, n, columns
    allocate (self%run(self%tree%n_blocks + 1), self%first_run(self%tree%n_groups + 1))
    n = 0
    columns = 0
    is_last = .false.
    do g = 1, self%tree%n_groups
      self%first_run(g) = n + 1
      do k = self%tree%begin(g), self%tree%begin(g + 1) - 1
        associate (block => self%tree%order(k))
          ! Blocks may be empty: the first one of a group begins a run all the same.
          if (k == self%tree%begin(g) .or. self%sign(block) < 0 .or. is_last .or. &
              columns + self%tree%size(block) > chunk_columns) then
            n = n + 1
            self%run(n) = k
            columns = 0
          end if
          columns = columns + self%tree%size(block)
          is_last = self%sign(block) < 0
        end associate
      end do
    end do
    self%first_run(self%tree%n_groups + 1) = n + 1
    self%run(n + 1) = self%tree%n_blocks + 1
    self%run = self%run(:n + 1)
  end subroutine find_runs

  !> Columns of the blocks eliminated from one time to another, both in one group.
  pure integer function block_ldlt_columns(self, first, last) result(columns)
    !> The matrix.
    class(block_ldlt_t), intent(in) :: self
    !> First elimination time.
    integer, intent(in) :: first
    !> Last elimination time.
    integer, intent(in) :: last
    columns = self%offset(last) + self%tree%size(self%tree%order(last)) - self%offset(first)
  end function block_ldlt_columns

  !> Add to the blocks (p, q) and (q, p).
  subroutine block_ldlt_add(self, p, q, part)
    !> The matrix, not factorized.
    class(block_ldlt_t), intent(inout) :: self
    !> Block row.
    integer, intent(in) :: p
    !> Block column.
    integer, intent(in) :: q
    !> Added to block (p, q), its transpose to block (q, p) (rows of block p, rows of block q) [any].
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
  end subroutine block_ldlt_add

  !> Add to the diagonal of a block.
  subroutine block_ldlt_add_diagonal(self, p, part)
    !> The matrix, not factorized.
    class(block_ldlt_t), intent(inout) :: self
    !> The block.
    integer, intent(in) :: p
    !> Added to the diagonal of block (p, p) (rows of block p) [any].
    real(dp), intent(in) :: part(:)
    integer :: i
    associate (at => self%offset(self%tree%time(p)), x => self%panel(self%tree%group(self%tree%time(p)))%x)
      do i = 1, size(part)
        x(at + i, at + i) = x(at + i, at + i) + part(i)
      end do
    end associate
  end subroutine block_ldlt_add_diagonal

  !> Factorize in place.
  subroutine block_ldlt_factorize(self, reference, failed)
    !> The matrix; its factor on return.
    class(block_ldlt_t), intent(inout) :: self
    !> Magnitude that eigenvalues of each block of H are compared with to find null directions (n_blocks) [as H]; where
    !> it is 0 the block is regular. Not used for blocks of M.
    real(dp), intent(in) :: reference(:)
    !> A block whose pivots do not have its sign; 0 if there is none.
    integer, intent(out) :: failed
    type(dense_t), allocatable :: update(:)
    integer, allocatable :: place(:), child(:), next(:)
    integer :: g, c, below
    associate (n_groups => self%tree%n_groups)
      allocate (update(n_groups), place(self%tree%n_blocks), child(n_groups), next(n_groups))
    end associate
    allocate (self%null_block(0), self%null_direction(maxval([0, self%tree%size]), 0))
    failed = 0
    child = 0
    do g = self%tree%n_groups, 1, -1
      if (self%tree%parent(g) == 0) cycle
      next(g) = child(self%tree%parent(g))
      child(self%tree%parent(g)) = g
    end do
    do g = 1, self%tree%n_groups
      below = self%tree%height(g) - self%tree%width(g)
      allocate (update(g)%x(below, below), source=0.0_dp)
      call find_places(self%tree, self%offset, g, place)
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
  end subroutine block_ldlt_factorize

  !> Eliminate the columns of a panel, in chunks of runs so that most products have many columns.
  subroutine factor_group(self, g, reference, failed)
    !> The matrix; the factor of the group on return.
    type(block_ldlt_t), intent(inout) :: self
    !> The group.
    integer, intent(in) :: g
    !> See `block_ldlt_factorize` (n_blocks) [as H].
    real(dp), intent(in) :: reference(:)
    !> See `block_ldlt_factorize`.
    integer, intent(out) :: failed
    integer :: first, last, k
    failed = 0
    first = self%first_run(g)
    do while (first < self%first_run(g + 1))
      last = first
      do while (last + 1 < self%first_run(g + 1))
        if (self%columns(self%run(first), self%run(last + 2) - 1) > chunk_columns) exit
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

  !> Subtract the contribution of earlier columns of a panel, `L D L^T`, from later ones.
  subroutine subtract_columns(self, g, from, first, last)
    !> The matrix.
    type(block_ldlt_t), intent(inout) :: self
    !> The group.
    integer, intent(in) :: g
    !> First time of the eliminated blocks from .. first - 1.
    integer, intent(in) :: from
    !> First time of the blocks first .. last that are updated.
    integer, intent(in) :: first
    !> See `first`.
    integer, intent(in) :: last
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
    !> The matrix.
    type(block_ldlt_t), intent(inout) :: self
    !> The group.
    integer, intent(in) :: g
    !> First elimination time of the run.
    integer, intent(in) :: first
    !> Last elimination time of the run.
    integer, intent(in) :: last
    !> See `block_ldlt_factorize` (n_blocks) [as H].
    real(dp), intent(in) :: reference(:)
    !> See `block_ldlt_factorize`.
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
        call factor_schur_block(self, first, reference(self%tree%order(first)), x(at + 1:at + n, at + 1:at + n), info)
        if (info == 0) x(at + n + 1:, at + 1:at + n) = -matmul(x(at + n + 1:, at + 1:at + n), self%root(first)%x)
      end if
      if (info == 0) return
      do k = first, last
        failed = self%tree%order(k)
        if (info <= self%columns(first, k)) exit
      end do
    end associate
  end subroutine factor_run

  !> The root of the generalized inverse of a block of H, and its null directions.
  subroutine factor_schur_block(self, k, reference, a, failed)
    !> Sets `root`, adds to the null directions.
    type(block_ldlt_t), intent(inout) :: self
    !> Elimination time of the block.
    integer, intent(in) :: k
    !> Magnitude for the null directions of this block, see `block_ldlt_factorize` [as H].
    real(dp), intent(in) :: reference
    !> The negative Schur complement, lower triangle (rows of the block, the same) [as H].
    real(dp), intent(in) :: a(:, :)
    !> Not 0 where the block cannot be factorized.
    integer, intent(out) :: failed
    real(dp), allocatable :: null(:, :), all_null(:, :)
    integer :: n_old
    call find_inverse_root(-a, reference, self%root(k)%x, null, failed)
    if (failed /= 0 .or. size(null, 2) == 0) return
    n_old = size(self%null_block)
    allocate (all_null(size(self%null_direction, 1), n_old + size(null, 2)), source=0.0_dp)
    all_null(:, :n_old) = self%null_direction
    all_null(:size(a, 1), n_old + 1:) = null
    call move_alloc(all_null, self%null_direction)
    self%null_block = [self%null_block, spread(self%tree%order(k), 1, size(null, 2))]
  end subroutine factor_schur_block

  !> Subtract `L D L^T` of a panel's rows below the group from its update matrix.
  subroutine subtract_products(self, g, update)
    !> The matrix, the group eliminated.
    type(block_ldlt_t), intent(in) :: self
    !> The group.
    integer, intent(in) :: g
    !> Update matrix of the group, lower triangle (height - width, height - width) [as the matrix].
    real(dp), intent(inout) :: update(:, :)
    real(dp), allocatable :: columns(:, :)
    integer :: k, n, s, below, width
    below = size(update, 1)
    width = self%tree%width(g)
    allocate (columns(below, width))
    ! Columns of M, then columns of H: dsyrk knows one sign only.
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

  !> Free all memory.
  subroutine block_ldlt_destroy(self)
    !> The matrix or its factor.
    class(block_ldlt_t), intent(inout) :: self
    if (allocated(self%panel)) deallocate (self%panel, self%root, self%offset)
    if (allocated(self%run)) deallocate (self%run, self%first_run)
    if (allocated(self%null_block)) deallocate (self%null_block, self%null_direction)
    self%tree%n_blocks = 0
  end subroutine block_ldlt_destroy
end module dotyk_linalg_block_ldlt
