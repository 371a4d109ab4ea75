!> Moore-Penrose inverse of a small positive semidefinite matrix of blocks with known null vectors, by its Cholesky
!> factor: the last level of `dotyk_linalg_smoothed_aggregation`.
!>
!> With orthonormal null vectors Z and springs S on as many equations: A^+ = (I - Z Z^T) (A + S)^{-1} (I - Z Z^T).
module dotyk_linalg_block_factor
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_block_rows, only: block_rows_t
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_fixed_sum, only: remove_components
  use dotyk_linalg_ordering, only: expand_permutation, nested_dissection
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_linalg_springs, only: add_springs, choose_fixing_equations
  implicit none
  private

  !> The factor. It owns memory of CHOLMOD: never assign one to another, and call `destroy` at the end.
  type, public :: block_factor_t
    type(cholesky_t) :: factor  !! Factor of A/scale, with springs.
    real(dp), allocatable :: mode(:, :)  !! Orthonormal null vectors (n, n_modes) [].
  contains
    procedure :: init => factor_init
    procedure :: solve => factor_solve
    procedure :: destroy => factor_destroy
  end type block_factor_t

  public :: lower_triangle, order_blocks

contains

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
end module dotyk_linalg_block_factor
