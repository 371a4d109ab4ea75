!> Algebraic multigrid by smoothed aggregation (P. Vanek, J. Mandel and M. Brezina, Computing 56, 1996; P. Vanek, M.
!> Brezina and J. Mandel, Numer. Math. 88, 2001) for sparse positive semidefinite matrices of 2x2 or 3x3 blocks: a
!> preconditioner whose memory and time are linear in the unknowns.
!>
!> Each level has aggregates of the nodes of the one above (`dotyk_linalg_aggregation`); an aggregate has one coarse
!> unknown for each near-null-space vector: the rigid body modes of an elastic body. The prolongator
!> (`dotyk_linalg_block_prolongator`) reproduces them, and the coarse matrix is the Galerkin matrix
!> (`dotyk_linalg_galerkin_product`), in 3x3 blocks. The last level is factorized.
!>
!> A cycle smooths by Chebyshev's iteration (`dotyk_linalg_chebyshev`), corrects by the next level, and smooths again:
!> linear up to the rounding of single precision, symmetric, and positive definite but for null vectors. Smoothing is in
!> single precision; corrections are large where the solution is nearly rigid, and stay in double precision. The digits
!> are the same on any number of threads.
!>
!> Its null vectors Z are known: with springs S on as many equations, A^+ = (I - Z Z^T) (A + S)^{-1} (I - Z Z^T).
module dotyk_linalg_smoothed_aggregation
  use dotyk_base_error, only: add_context, error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_linalg_aggregation, only: carry_to_coarse, find_aggregates, list_members, make_bases
  use dotyk_linalg_block_prolongator, only: block_prolongator_t
  use dotyk_linalg_block_rows, only: block_rows_t
  use dotyk_linalg_chebyshev, only: chebyshev_t
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_conjugate_gradient, only: preconditioned_system_t
  use dotyk_linalg_fixed_sum, only: remove_components
  use dotyk_linalg_galerkin_product, only: galerkin_product
  use dotyk_linalg_ordering, only: expand_permutation, nested_dissection
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_linalg_springs, only: add_springs, choose_fixing_equations
  implicit none
  private
  public :: make_level, lower_triangle, order_blocks

  !> The factor. It owns memory of CHOLMOD: never assign one to another, and call `destroy` at the end.
  type, public :: block_factor_t
    type(cholesky_t) :: factor  !! Factor of A/scale, with springs.
    real(dp), allocatable :: mode(:, :)  !! Orthonormal null vectors (n, n_modes) [].
  contains
    procedure :: init => factor_init
    procedure :: solve => factor_solve
    procedure :: destroy => factor_destroy
  end type block_factor_t

  type, public :: aggregation_level_t  !! A level above the last one.
    type(chebyshev_t) :: smoother  !! Its matrix with the smoother.
    integer, allocatable :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    type(block_prolongator_t) :: prolongator  !! Interpolation from the next level.
  end type aggregation_level_t

  !> The levels. As a system for conjugate gradients, the matrix of the first level with one cycle as preconditioner.
  !> It owns a factor: never assign one to another, and call `destroy` at the end.
  type, extends(preconditioned_system_t), public :: smoothed_aggregation_t
    integer :: n = 0  !! Number of unknowns.
    type(aggregation_level_t), allocatable :: level(:)  !! Levels from the finest one on, without the last one.
    type(block_factor_t) :: last  !! The last level.
    integer :: n_last = 0  !! Unknowns of the last level.
    real(dp) :: scale = 1  !! Scale of the matrices of all levels [matrix].
    real(dp), allocatable :: mode(:, :)  !! Orthonormal null vectors of the first level (n, n_modes) [].
    real(dp) :: threshold = 0  !! Couplings below this are weak on the first level [].
    !> Couplings below this are weak on other levels, whose nodes are coupled to forty others, most of them hardly: 12
    !> iterations in place of 16 with all (`benchmark_multigrid linear 48`) [].
    real(dp) :: coarse_threshold = 0.05_dp
    integer :: most_last = 6000  !! Greatest number of unknowns of the last level.
    integer :: degree = 3  !! Degree of the smoother.
    real(dp) :: ratio = 10  !! Ratio of the ends of its interval.
  contains
    procedure :: init => aggregation_init
    procedure :: cycle => aggregation_cycle
    procedure :: multiply => aggregation_multiply
    procedure :: precondition => aggregation_precondition
    procedure :: bytes => aggregation_bytes
    procedure :: complexity => aggregation_complexity
    procedure :: destroy => aggregation_destroy
  end type smoothed_aggregation_t

  !> Greatest number of levels; a level has a tenth of the unknowns of the one above, or less.
  integer, parameter :: most_levels = 20
  !> A level that is not smaller than the one above by this factor is the last one.
  real(dp), parameter :: least_coarsening = 0.7_dp
  !> Factor of the prolongator's step over the greatest eigenvalue of D^{-1} A: least energy in the upper part
  !> of the spectrum (Vanek, Mandel, Brezina 1996).
  real(dp), parameter :: prolongator_step = 4.0_dp/3

contains

  !> Make the levels. The components for settings are read, the others are set.
  subroutine aggregation_init(self, rows, near_null, mode, error, part)
    class(smoothed_aggregation_t), intent(inout) :: self
    type(block_rows_t), intent(inout) :: rows  !! The matrix; its arrays are taken over.
    !> Vectors that the matrix maps to little, 3 or 6, zero along held unknowns (n, n_vectors) [any].
    real(dp), intent(in), contiguous :: near_null(:, :)
    !> Orthonormal null vectors of the matrix, all in the span of `near_null` on each of its connected parts
    !> (n, n_modes) [].
    real(dp), intent(in) :: mode(:, :)
    !> Allocated where the matrix is not positive definite beside its null vectors, or memory runs out.
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in), optional :: part  !! Block rows of a node, one after the other; 1 if absent.
    type(aggregation_level_t), allocatable :: found(:)
    type(block_rows_t) :: current, coarse
    real(dp), allocatable :: vector(:, :), vanishing(:, :)
    real(dp) :: threshold
    integer :: n, rows_of_node
    call self%destroy()
    self%n = rows%dim*rows%n
    self%scale = rows%scale
    self%mode = mode
    allocate (found(most_levels))
    vector = near_null
    vanishing = mode
    call rows%move_to(current)
    n = 0
    rows_of_node = 1
    if (present(part)) rows_of_node = part
    threshold = self%threshold
    do while ((n == 0 .or. current%dim*current%n > self%most_last) .and. n < most_levels)
      n = n + 1
      call current%move_to(found(n)%smoother%rows)
      found(n)%smoother%degree = self%degree
      found(n)%smoother%ratio = self%ratio
      call make_level(rows_of_node, threshold, vector, vanishing, found(n), coarse, error)
      if (allocated(error)) return
      call coarse%move_to(current)
      rows_of_node = size(near_null, 2)/3
      threshold = self%coarse_threshold
      if (current%dim*current%n > least_coarsening*size(found(n)%smoother%inverse, 3)*found(n)%smoother%rows%dim) exit
    end do
    allocate (self%level(n))
    call move_levels(found(:n), self%level)
    self%n_last = current%dim*current%n
    call self%last%init(current, vanishing, error)
    if (allocated(error)) call add_context(error, 'smoothed aggregation: ')
  end subroutine aggregation_init

  !> Hand levels over, without a copy in memory.
  subroutine move_levels(from, to)
    type(aggregation_level_t), intent(inout) :: from(:)  !! The levels; without arrays on return.
    type(aggregation_level_t), intent(inout) :: to(:)  !! Get their arrays (size(from)).
    integer :: l
    do l = 1, size(from)
      to(l)%smoother%degree = from(l)%smoother%degree
      to(l)%smoother%ratio = from(l)%smoother%ratio
      to(l)%smoother%greatest = from(l)%smoother%greatest
      call from(l)%smoother%rows%move_to(to(l)%smoother%rows)
      call move_alloc(from(l)%smoother%inverse, to(l)%smoother%inverse)
      call move_alloc(from(l)%aggregate, to(l)%aggregate)
      call from(l)%prolongator%move_to(to(l)%prolongator)
    end do
  end subroutine move_levels

  !> One level, and the matrix of the next one.
  subroutine make_level(part, threshold, vector, mode, level, coarse, error)
    integer, intent(in) :: part  !! Block rows of a node.
    real(dp), intent(in) :: threshold  !! Couplings below this are weak [].
    real(dp), allocatable, intent(inout) :: vector(:, :)  !! Of the next level on return (n, n_vectors) [any].
    real(dp), allocatable, intent(inout) :: mode(:, :)  !! Null vectors; of the next level on return (n, n_modes) [].
    type(aggregation_level_t), intent(inout) :: level  !! Has its matrix and smoother settings; gets the rest.
    type(block_rows_t), intent(inout) :: coarse  !! Matrix of the next level.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a diagonal block is not positive definite.
    real(dp), allocatable :: basis(:, :, :), next_vector(:, :, :), next_mode(:, :)
    logical, allocatable :: missing(:, :)
    integer, allocatable :: first(:), member(:)
    integer :: k, m, n_coarse, length
    logical :: regular
    call level%smoother%prepare(regular)
    if (.not. regular) then
      !$omp critical (message)
      call set_error(error, 'smoothed aggregation: a diagonal block is not positive definite', exit_not_solvable)
      !$omp end critical (message)
      return
    end if
    associate (rows => level%smoother%rows)
      m = size(vector, 2)
      length = part*rows%dim
      call find_aggregates(rows, part, threshold, level%aggregate, n_coarse)
      call list_members(level%aggregate, n_coarse, first, member)
      allocate (basis(m, length, rows%n/part), next_vector(m, n_coarse, m), missing(m, n_coarse), &
                next_mode(m*n_coarse, size(mode, 2)))
      call make_bases(m, length, first, member, reshape(vector, [length, rows%n/part, m]), basis, next_vector, missing)
      do k = 1, size(mode, 2)
        call carry_to_coarse(m, length, first, member, basis, mode(:, k), next_mode(:, k))
      end do
      call level%prolongator%init(rows, part, level%aggregate, n_coarse, basis, level%smoother%inverse, &
                                  prolongator_step/level%smoother%greatest)
      deallocate (basis)
      call galerkin_product(rows, level%prolongator, missing, coarse)
    end associate
    vector = reshape(next_vector, [m*n_coarse, m])
    call move_alloc(next_mode, mode)
  end subroutine make_level

  !> One cycle: x about A^+ b.
  subroutine aggregation_cycle(self, b, x)
    class(smoothed_aggregation_t), intent(in) :: self
    real(dp), intent(in), contiguous :: b(:)  !! Right-hand side (n) [matrix times x].
    real(dp), intent(out), contiguous :: x(:)  !! The solution, approximately (n) [any].
    real(sp), allocatable :: low(:)
    real(dp) :: size_of_b
    integer :: i
    ! The same projection on both sides, so that the cycle is symmetric for any b.
    x = b
    call remove_components(self%n, self%mode, x)
    size_of_b = maxval(abs(x))
    ! Zero or NaN.
    if (.not. size_of_b > 0) return
    allocate (low(self%n))
    !$omp parallel do default(none) shared(self, x, low, size_of_b) schedule(static)
    do i = 1, self%n
      low(i) = real(x(i)/size_of_b, sp)
    end do
    !$omp end parallel do
    call descend(self, 1, low, x)
    !$omp parallel do default(none) shared(self, x, size_of_b) schedule(static)
    do i = 1, self%n
      x(i) = size_of_b/self%scale*x(i)
    end do
    !$omp end parallel do
    call remove_components(self%n, self%mode, x)
  end subroutine aggregation_cycle

  !> The cycle from one level down, for A/scale.
  recursive subroutine descend(self, l, b, x)
    type(smoothed_aggregation_t), intent(in) :: self  !! The levels.
    integer, intent(in) :: l  !! The level.
    real(sp), intent(inout), contiguous :: b(:)  !! Right-hand side; changed (n) [any].
    real(dp), intent(out), contiguous :: x(:)  !! The solution, approximately (n) [as b].
    real(sp), allocatable :: before(:), rest(:), coarse_b(:)
    real(dp), allocatable :: coarse_x(:)
    integer :: i, n
    if (l > size(self%level)) then
      x = b
      call self%last%solve(x)
      return
    end if
    n = size(b)
    associate (level => self%level(l))
      allocate (before(n), rest(n))
      allocate (coarse_b(level%prolongator%m*level%prolongator%n_coarse))
      allocate (coarse_x(size(coarse_b)))
      call level%smoother%smooth(b, before)
      call level%smoother%rows%residual(b, before, rest)
      call level%prolongator%restrict(rest, coarse_b)
      call descend(self, l + 1, coarse_b, coarse_x)
      call level%prolongator%prolong(coarse_x, x)
      call level%smoother%rows%subtract_product(x, rest)
      call level%smoother%smooth(rest, b)
    end associate
    !$omp parallel do default(none) shared(n, x, before, b) schedule(static)
    do i = 1, n
      x(i) = x(i) + (real(before(i), dp) + b(i))
    end do
    !$omp end parallel do
  end subroutine descend

  !> y = A x.
  subroutine aggregation_multiply(self, x, y)
    class(smoothed_aggregation_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Vector x (n) [any].
    real(dp), intent(out), contiguous :: y(:)  !! Product y (n) [A times x].
    call self%level(1)%smoother%multiply(x, y)
  end subroutine aggregation_multiply

  !> One cycle.
  subroutine aggregation_precondition(self, r, z)
    class(smoothed_aggregation_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! Residual r (n) [A times x].
    real(dp), intent(out), contiguous :: z(:)  !! About A^+ r (n) [as x].
    call self%cycle(r, z)
  end subroutine aggregation_precondition

  !> Memory of the levels and the factor [bytes].
  pure integer(int64) function aggregation_bytes(self) result(bytes)
    class(smoothed_aggregation_t), intent(in) :: self
    integer :: l
    bytes = self%last%factor%factor_bytes
    if (allocated(self%mode)) bytes = bytes + 8*size(self%mode, kind=int64)
    if (.not. allocated(self%level)) return
    do l = 1, size(self%level)
      bytes = bytes + self%level(l)%smoother%bytes() + self%level(l)%prolongator%bytes() + &
              4*size(self%level(l)%aggregate, kind=int64)
    end do
  end function aggregation_bytes

  !> Operator complexity: blocks of all levels but the last one over those of the first one [].
  pure real(dp) function aggregation_complexity(self) result(complexity)
    class(smoothed_aggregation_t), intent(in) :: self
    integer :: l
    complexity = 1
    if (.not. allocated(self%level)) return
    do l = 2, size(self%level)
      complexity = complexity + real(size(self%level(l)%smoother%rows%column, kind=int64), dp)/ &
                   size(self%level(1)%smoother%rows%column, kind=int64)
    end do
  end function aggregation_complexity

  !> Free the memory.
  subroutine aggregation_destroy(self)
    class(smoothed_aggregation_t), intent(inout) :: self
    call self%last%destroy()
    if (allocated(self%level)) deallocate (self%level)
    if (allocated(self%mode)) deallocate (self%mode)
    self%n = 0
  end subroutine aggregation_destroy

  !> Factorize.
  subroutine factor_init(self, rows, mode, error)
    class(block_factor_t), intent(inout) :: self
    type(block_rows_t), intent(in) :: rows  !! The matrix A.
    real(dp), intent(in) :: mode(:, :)  !! Its orthonormal null vectors (n, n_modes) [].
    !> Allocated where the matrix is not positive definite beside its null vectors, or memory runs out.
    type(error_t), allocatable, intent(out) :: error
    type(sparse_symmetric_t) :: matrix
    integer, allocatable :: order(:), permutation(:), equation(:, :), fixed(:)
    real(dp), allocatable :: spring(:)
    integer :: failed_column, i
    call self%destroy()
    self%mode = mode
    call lower_triangle(rows, matrix)
    call order_blocks(rows, order, error)
    if (allocated(error)) return
    equation = reshape([(i, i=1, matrix%n)], [rows%dim, rows%n])
    allocate (permutation(matrix%n))
    call expand_permutation(order, equation, permutation)
    call self%factor%analyze(matrix, permutation, error)
    if (allocated(error)) return
    call choose_fixing_equations(self%mode, fixed)
    call add_springs(matrix, fixed, spring)
    call self%factor%factorize_and_discard(matrix, failed_column, error)
    if (allocated(error) .or. failed_column == 0) return
    !$omp critical (message)
    call set_error(error, 'the matrix of the last level is not positive definite', exit_not_solvable)
    !$omp end critical (message)
  end subroutine factor_init

  !> The lower triangle of A/scale.
  pure subroutine lower_triangle(rows, matrix)
    !> The matrix, its blocks ascending in each row but for the diagonal one, which is the first.
    type(block_rows_t), intent(in) :: rows
    type(sparse_symmetric_t), intent(out) :: matrix  !! A/scale.
    real(dp) :: block(rows%dim, rows%dim)
    integer(int64) :: n, k
    integer :: i, j, c, r, above
    matrix%n = rows%dim*rows%n
    allocate (matrix%column_start(matrix%n + 1))
    n = 0
    do i = 1, rows%n
      above = count(rows%column(rows%start(i):rows%start(i + 1) - 1) > i)
      do c = 1, rows%dim
        matrix%column_start(rows%dim*(i - 1) + c) = n
        n = n + rows%dim - c + 1 + rows%dim*above
      end do
    end do
    matrix%column_start(matrix%n + 1) = n
    allocate (matrix%row(n), matrix%value(n))
    n = 0
    do i = 1, rows%n
      do c = 1, rows%dim
        do k = rows%start(i), rows%start(i + 1) - 1
          j = rows%column(k)
          if (j < i) cycle
          call rows%get_block(k, block)
          do r = merge(c, 1, j == i), rows%dim
            n = n + 1
            ! Column c of the rows below is row c of the blocks to the right.
            matrix%row(n) = rows%dim*(j - 1) + r - 1
            matrix%value(n) = block(c, r)
          end do
        end do
      end do
    end do
  end subroutine lower_triangle

  !> Fill-reducing order of the block rows.
  subroutine order_blocks(rows, order, error)
    type(block_rows_t), intent(in) :: rows  !! The matrix.
    integer, allocatable, intent(out) :: order(:)  !! Block row that is eliminated k-th (n).
    type(error_t), allocatable, intent(out) :: error  !! As in `nested_dissection`.
    integer, allocatable :: start(:), neighbour(:)
    integer :: i
    allocate (order(rows%n), start(rows%n + 1))
    allocate (neighbour(size(rows%column) - rows%n))
    start(1) = 1
    do i = 1, rows%n
      start(i + 1) = start(i) + int(rows%start(i + 1) - rows%start(i)) - 1
      neighbour(start(i):start(i + 1) - 1) = rows%column(rows%start(i) + 1:rows%start(i + 1) - 1)
    end do
    call nested_dissection(start, neighbour, order, error)
  end subroutine order_blocks

  !> x := (A/scale)^+ x.
  subroutine factor_solve(self, x)
    class(block_factor_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:)  !! Right-hand side [any], then solution (n) [as the right-hand side].
    call remove_components(size(x), self%mode, x)
    call self%factor%solve(x)
    call remove_components(size(x), self%mode, x)
  end subroutine factor_solve

  !> Free the memory.
  subroutine factor_destroy(self)
    class(block_factor_t), intent(inout) :: self
    call self%factor%destroy()
    if (allocated(self%mode)) deallocate (self%mode)
  end subroutine factor_destroy
end module dotyk_linalg_smoothed_aggregation
