!> Sparse Cholesky factorization P K P^T = L L^T by CHOLMOD's supernodal way with 64-bit indices (Y. Chen, T. A. Davis,
!> W. W. Hager and S. Rajamanickam, ACM Trans. Math. Softw. 35, 2008). The digits of a factor depend on the number of
!> BLAS threads. CHOLMOD is behind an opaque handle of `cholmod_shim.c`, named by no other module; its functions return
!> one of `code_*`, or a code that CHOLMOD does not explain.
module dotyk_linalg_cholesky
  use, intrinsic :: iso_c_binding, only: c_associated, c_double, c_f_pointer, c_int, c_int64_t, c_null_ptr, c_ptr
  use omp_lib, only: omp_in_parallel
  use dotyk_base_error, only: error_t, exit_machine, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_linalg_blas, only: blas_threads, set_blas_threads
  use dotyk_linalg_ordering, only: is_permutation
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: factor_threads, set_factor_threads

  !> The supernodes of a factor, in the memory of CHOLMOD: valid until the factor is analyzed again or destroyed. All
  !> numbers and positions are 0-based. Supernode s has the columns column_start(s)..column_start(s+1)-1 of L, and the
  !> rows row(row_start(s)..row_start(s+1)-1), ascending, its own columns first. Its values are a dense block by columns
  !> from value_start(s) on.
  type, public :: supernodes_t
    integer(int64) :: n = 0  !! Number of supernodes.
    integer(int64), pointer, contiguous :: column_start(:) => null()  !! First column of each supernode (0:n).
    integer(int64), pointer, contiguous :: row_start(:) => null()  !! First row of each supernode in `row` (0:n).
    integer(int64), pointer, contiguous :: value_start(:) => null()  !! First value of each in `value` (0:n).
    integer(int64), pointer, contiguous :: row(:) => null()  !! Rows of the supernodes (0:sum of their rows - 1).
    integer(int64), pointer, contiguous :: permutation(:) => null()  !! Equation of each row of L (0:order-1).
    !> Values of L (0:factor_entries-1); not associated before the factorization.
    real(dp), pointer, contiguous :: value(:) => null()
  contains
    procedure :: columns => supernodes_columns
    procedure :: rows => supernodes_rows
  end type supernodes_t

  !> Cholesky factor of a symmetric positive definite matrix K. It owns memory of CHOLMOD: never assign one to another,
  !> and call `destroy` at the end. One thread analyzes and factorizes; after that any number of threads may solve with
  !> the factor at the same time.
  type, public :: cholesky_t
    integer :: n = 0  !! Order of K.
    !> Stored entries of L, zeros inside supernodes included. Known from `analyze` on, as are the next three.
    integer(int64) :: factor_entries = 0
    integer(int64) :: factor_bytes = 0  !! Memory of the factor [bytes].
    !> Estimated memory of a factorization beside the factor and K: a permuted copy of K, an update matrix [bytes].
    integer(int64) :: workspace_bytes = 0
    real(dp) :: flops = 0  !! Floating-point operations of a factorization.
    !> Smallest pivot as a fraction of its diagonal entry of K []: 1e-2 for compact bodies, (thickness/length)^3
    !> for thin ones, 1e-16 to 1e-13 for bodies that are not held and pass the factorization by rounding.
    real(dp) :: weakest_pivot = 0
    integer :: weakest_equation = 0  !! Equation of that pivot, from 1; 0 before the factorization.
    type(c_ptr), private :: handle = c_null_ptr  !! The shim's handle of the factor.
    logical, private :: factorized = .false.  !! Whether there is a factor to solve with.
  contains
    procedure :: analyze => cholesky_analyze
    procedure :: factorize => cholesky_factorize
    procedure :: factorize_and_discard => cholesky_factorize_and_discard
    procedure :: is_factorized => cholesky_is_factorized
    procedure :: solve => cholesky_solve
    procedure :: solve_block => cholesky_solve_block
    procedure :: solve_forward => cholesky_solve_forward
    procedure :: solve_back => cholesky_solve_back
    procedure :: trailing => cholesky_trailing
    procedure :: supernodes => cholesky_supernodes
    procedure :: destroy => cholesky_destroy
  end type cholesky_t

  !> Right-hand sides of a solve by CHOLMOD: dense products have reached their full rate, and the copies stay small.
  integer, parameter :: block_size = 64
  !> Operations of a factorization from which on BLAS threads help it: 17 % at 2e9 on two threads, nothing at 4e8.
  real(dp), parameter, public :: worth_threads = 1.0e9_dp

  integer :: n_factor_threads = 1  !! BLAS threads of a large factorization outside parallel regions.

  integer(c_int), parameter :: code_ok = 0  !! No error.
  integer(c_int), parameter :: code_out_of_memory = 1  !! CHOLMOD has no memory.
  integer(c_int), parameter :: code_too_large = 3  !! The factor exceeds 64-bit integers.

  type, bind(c) :: statistics_t  !! Result of the symbolic analysis; the struct of the same name in the shim.
    integer(c_int64_t) :: entries  !! Stored entries of the factor, zeros inside supernodes included.
    integer(c_int64_t) :: factor_bytes  !! Memory of the factor [bytes].
    integer(c_int64_t) :: workspace_bytes  !! Estimated memory beside the factor and the matrix [bytes].
    real(c_double) :: flops  !! Floating-point operations of a factorization.
  end type statistics_t

  interface
    !> Make an empty handle.
    type(c_ptr) function dotyk_cholmod_new() bind(c)
      import :: c_ptr
    end function dotyk_cholmod_new

    !> Free a handle and all that belongs to it.
    subroutine dotyk_cholmod_free(handle) bind(c)
      import :: c_ptr
      type(c_ptr), value :: handle  !! Handle of the factor.
    end subroutine dotyk_cholmod_free

    !> Symbolic analysis.
    integer(c_int) function dotyk_cholmod_analyze(handle, n, start, row, permutation, trailing, statistics) bind(c)
      import :: c_ptr, c_int, c_int64_t, statistics_t
      type(c_ptr), value :: handle  !! Handle of the factor.
      integer(c_int64_t), value :: n  !! Order of K.
      integer(c_int64_t), intent(in) :: start(*)  !! First entry of each column of the lower triangle, 0-based (n+1).
      integer(c_int64_t), intent(in) :: row(*)  !! Row of each entry, ascending in each column, 0-based (entries).
      integer(c_int64_t), intent(in) :: permutation(*)  !! The equation that is eliminated k-th, 0-based (n).
      integer(c_int64_t), value :: trailing  !! Equations at the end of the permutation that stay there.
      type(statistics_t), intent(out) :: statistics  !! Size and cost of the factor.
    end function dotyk_cholmod_analyze

    !> Make the lower triangle of P K P^T.
    integer(c_int) function dotyk_cholmod_permute(handle, start, row, value) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: handle  !! Handle of the factor.
      integer(c_int64_t), intent(in) :: start(*)  !! First entry of each column of the lower triangle, 0-based (n+1).
      integer(c_int64_t), intent(in) :: row(*)  !! Row of each entry, 0-based (entries).
      real(c_double), intent(in) :: value(*)  !! Value of each entry (entries) [any].
    end function dotyk_cholmod_permute

    !> Numeric factorization of P K P^T, which is freed.
    integer(c_int) function dotyk_cholmod_factorize(handle, failed) bind(c)
      import :: c_ptr, c_int, c_int64_t
      type(c_ptr), value :: handle  !! Handle of the factor.
      integer(c_int64_t), intent(out) :: failed  !! First column of L whose pivot is not positive, 0 if none.
    end function dotyk_cholmod_factorize

    !> Solve K X = B, or with one of the factors P^T L P and P^T L^T P in place of K.
    integer(c_int) function dotyk_cholmod_solve(handle, n, m, forward, back, x) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: handle  !! Handle of the factor.
      integer(c_int64_t), value :: n  !! Order of K.
      integer(c_int64_t), value :: m  !! Number of right-hand sides.
      integer(c_int), value :: forward, back  !! Whether to solve with L, and with L^T; both: with K.
      real(c_double), intent(inout) :: x(*)  !! Right-hand sides [any], then solutions (n, m) [those over K].
    end function dotyk_cholmod_solve

    !> The arrays of the supernodes.
    subroutine dotyk_cholmod_supernodes(handle, counts, pointers) bind(c)
      import :: c_ptr, c_int64_t
      type(c_ptr), value :: handle  !! Handle of the factor.
      integer(c_int64_t), intent(out) :: counts(2)  !! Number of supernodes, length of the list of rows.
      !> Addresses of: first column of each supernode, position of its first row, position of its first value, list of
      !> rows, permutation, values (null before the factorization); all 0-based.
      type(c_ptr), intent(out) :: pointers(6)
    end subroutine dotyk_cholmod_supernodes

    !> The equations of the last columns of L.
    subroutine dotyk_cholmod_trailing(handle, m, equation) bind(c)
      import :: c_ptr, c_int64_t
      type(c_ptr), value :: handle  !! Handle of the factor.
      integer(c_int64_t), value :: m  !! Number of columns.
      integer(c_int64_t), intent(out) :: equation(*)  !! Equations of the last m columns (m).
    end subroutine dotyk_cholmod_trailing
  end interface

contains

  !> Set the number of BLAS threads of large factorizations outside parallel regions; 1 gives the same digits on any
  !> number of threads.
  subroutine set_factor_threads(n)
    integer, intent(in) :: n  !! Number of threads.
    n_factor_threads = n
  end subroutine set_factor_threads

  !> Number of BLAS threads of large factorizations outside parallel regions.
  integer function factor_threads()
    factor_threads = n_factor_threads
  end function factor_threads

  !> Number of columns of a supernode.
  pure integer function supernodes_columns(self, s) result(columns)
    class(supernodes_t), intent(in) :: self
    integer, intent(in) :: s  !! Number of a supernode, from 0.
    columns = int(self%column_start(s + 1) - self%column_start(s))
  end function supernodes_columns

  !> Number of rows of a supernode, those of its own columns included.
  pure integer function supernodes_rows(self, s) result(rows)
    class(supernodes_t), intent(in) :: self
    integer, intent(in) :: s  !! Number of a supernode, from 0.
    rows = int(self%row_start(s + 1) - self%row_start(s))
  end function supernodes_rows

  !> Symbolic analysis: structure, size and cost of the factor. The values of the matrix are not read and may be
  !> missing.
  subroutine cholesky_analyze(self, matrix, permutation, error, n_trailing)
    class(cholesky_t), intent(inout) :: self
    type(sparse_symmetric_t), intent(in) :: matrix  !! Pattern of the matrix.
    !> Fill-reducing order: the equation that is eliminated k-th (n). CHOLMOD may postorder it, which changes no fill.
    integer, intent(in) :: permutation(:)
    !> The order is not a permutation, CHOLMOD has no memory, or the factor exceeds 64-bit integers.
    type(error_t), allocatable, intent(out) :: error
    !> Equations at the end of the permutation that stay there, see `trailing`; none if absent.
    integer, intent(in), optional :: n_trailing
    type(statistics_t) :: statistics
    integer(c_int64_t) :: last
    call self%destroy()
    self%n = matrix%n
    if (.not. is_permutation(matrix%n, permutation)) then
      call set_error(error, 'the ordering of '//to_text(matrix%n)//' equations is not a permutation', exit_not_solvable)
      return
    end if
    if (self%n == 0) return
    last = 0
    if (present(n_trailing)) last = n_trailing
    self%handle = dotyk_cholmod_new()
    call raise(dotyk_cholmod_analyze(self%handle, int(self%n, c_int64_t), matrix%column_start, matrix%row, &
      int(permutation, c_int64_t) - 1_c_int64_t, last, statistics), 'analysis', self, error)
    if (allocated(error)) return
    self%factor_entries = statistics%entries
    self%factor_bytes = statistics%factor_bytes
    self%workspace_bytes = statistics%workspace_bytes
    self%flops = statistics%flops
  end subroutine cholesky_analyze

  !> Numeric factorization of the matrix that was analyzed, or of one with the same pattern.
  subroutine cholesky_factorize(self, matrix, failed_column, error)
    class(cholesky_t), intent(inout) :: self
    type(sparse_symmetric_t), intent(in) :: matrix  !! The matrix K.
    !> First equation whose pivot is not positive: there is no factor then, which is no error here; 0 if there is none.
    integer, intent(out) :: failed_column
    type(error_t), allocatable, intent(out) :: error  !! No memory, or the matrix is not the one that was analyzed.
    real(dp), allocatable :: diagonal(:)
    failed_column = 0
    call take_matrix(self, matrix, diagonal, error)
    if (.not. allocated(error)) call factorize_taken(self, diagonal, failed_column, error)
  end subroutine cholesky_factorize

  !> Numeric factorization of a matrix that is not needed any more: its memory is freed before that of the factor is
  !> allocated.
  subroutine cholesky_factorize_and_discard(self, matrix, failed_column, error)
    class(cholesky_t), intent(inout) :: self
    type(sparse_symmetric_t), intent(inout) :: matrix  !! The matrix K, destroyed on return.
    integer, intent(out) :: failed_column  !! As in `factorize`.
    type(error_t), allocatable, intent(out) :: error  !! No memory, or the matrix is not the one that was analyzed.
    real(dp), allocatable :: diagonal(:)
    failed_column = 0
    call take_matrix(self, matrix, diagonal, error)
    call matrix%destroy()
    if (.not. allocated(error)) call factorize_taken(self, diagonal, failed_column, error)
  end subroutine cholesky_factorize_and_discard

  !> Discard the last factor, and make the permuted copy P K P^T.
  subroutine take_matrix(self, matrix, diagonal, error)
    class(cholesky_t), intent(inout) :: self
    type(sparse_symmetric_t), intent(in) :: matrix  !! The matrix K.
    real(dp), allocatable, intent(out) :: diagonal(:)  !! Its diagonal (n) [as K].
    type(error_t), allocatable, intent(out) :: error  !! No memory, or the matrix is not the one that was analyzed.
    self%factorized = .false.
    self%weakest_pivot = 1
    self%weakest_equation = 0
    if (self%n == 0 .and. matrix%n == 0) then
      self%factorized = .true.
      allocate (diagonal(0))
    else if (.not. c_associated(self%handle) .or. self%n /= matrix%n .or. .not. allocated(matrix%value)) then
      call set_error(error, 'the matrix differs from the one analyzed symbolically', exit_not_solvable)
    else
      diagonal = matrix%value(matrix%column_start(:self%n) + 1)
      call raise(dotyk_cholmod_permute(self%handle, matrix%column_start, matrix%row, matrix%value), 'factorization', &
                 self, error)
    end if
  end subroutine take_matrix

  !> Factorize the permuted copy, free it, and find the weakest pivot.
  subroutine factorize_taken(self, diagonal, failed_column, error)
    class(cholesky_t), intent(inout) :: self
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of K (n) [as K].
    integer, intent(out) :: failed_column  !! As in `cholesky_factorize`.
    type(error_t), allocatable, intent(out) :: error  !! CHOLMOD has no memory.
    type(supernodes_t) :: supernodes
    integer(c_int64_t) :: column
    integer(c_int) :: code
    integer :: before
    failed_column = 0
    if (self%n == 0) return
    before = blas_threads()
    if (self%flops > worth_threads .and. n_factor_threads > before) then
      if (.not. omp_in_parallel()) call set_blas_threads(n_factor_threads)
    end if
    code = dotyk_cholmod_factorize(self%handle, column)
    if (blas_threads() > before) call set_blas_threads(before)
    call raise(code, 'factorization', self, error)
    if (allocated(error)) return
    call self%supernodes(supernodes)
    if (column > 0) then
      self%weakest_pivot = 0
      self%weakest_equation = int(supernodes%permutation(column - 1)) + 1
    else
      call find_weakest_pivot(supernodes, diagonal, self%weakest_pivot, self%weakest_equation)
    end if
    self%factorized = self%weakest_pivot > 0
    failed_column = merge(0, self%weakest_equation, self%factorized)
  end subroutine factorize_taken

  !> Find the pivot that is the smallest fraction of its diagonal entry. If a pivot is not positive or not a number, the
  !> first such one is reported with fraction 0.
  pure subroutine find_weakest_pivot(supernodes, diagonal, weakest, equation)
    type(supernodes_t), intent(in) :: supernodes  !! The factor, with values.
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of K (n) [as K].
    real(dp), intent(out) :: weakest  !! Pivot over diagonal entry, 0 to 1 [].
    integer, intent(out) :: equation  !! Equation of that pivot, from 1.
    integer :: s, rows, number
    integer(int64) :: k, at
    real(dp) :: fraction
    weakest = 1
    equation = 0
    do s = 0, int(supernodes%n) - 1
      rows = supernodes%rows(s)
      at = supernodes%value_start(s)
      do k = supernodes%column_start(s), supernodes%column_start(s + 1) - 1
        number = int(supernodes%permutation(k)) + 1
        fraction = supernodes%value(at)**2/diagonal(number)
        if (.not. fraction > 0) then ! NaN too: LAPACK does not always see it
          weakest = 0
          equation = number
          return
        end if
        if (fraction < weakest .or. equation == 0) then
          weakest = fraction
          equation = number
        end if
        at = at + rows + 1
      end do
    end do
  end subroutine find_weakest_pivot

  !> Whether there is a factor to solve with.
  pure logical function cholesky_is_factorized(self) result(is_factorized)
    class(cholesky_t), intent(in) :: self
    is_factorized = self%factorized
  end function cholesky_is_factorized

  !> Solve K x = b. The solution is NaN where there is no factor.
  subroutine cholesky_solve(self, x)
    class(cholesky_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:)  !! Right-hand side b [any], then solution x (n) [b/K].
    call solve_columns(self, 1, .true., .true., x)
  end subroutine cholesky_solve

  !> Solve K X = B, four to six times cheaper per column than one by one. NaN as in `solve`.
  subroutine cholesky_solve_block(self, x)
    class(cholesky_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:, :)  !! Right-hand sides B [any], then solutions X (n, m) [B/K].
    call solve_columns(self, size(x, 2), .true., .true., x)
  end subroutine cholesky_solve_block

  !> The first half of a solve, L^{-1} by the equations of K: X := P^T L^{-1} P B. X^T X is B^T K^{-1} B. NaN as in
  !> `solve`.
  subroutine cholesky_solve_forward(self, x)
    class(cholesky_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:, :)  !! B, then X (n, m) [any].
    call solve_columns(self, size(x, 2), .true., .false., x)
  end subroutine cholesky_solve_forward

  !> The second half of a solve, X := P^T L^{-T} P B. NaN as in `solve`.
  subroutine cholesky_solve_back(self, x)
    class(cholesky_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:, :)  !! B, then X (n, m) [any].
    call solve_columns(self, size(x, 2), .false., .true., x)
  end subroutine cholesky_solve_back

  !> Solve for blocks of columns.
  subroutine solve_columns(self, m, forward, back, x)
    class(cholesky_t), intent(in) :: self
    integer, intent(in) :: m  !! Number of columns.
    logical, intent(in) :: forward, back  !! Whether to solve with L, and with L^T.
    real(dp), intent(inout) :: x(self%n, m)  !! Right-hand sides [any], then solutions (n, m) [those over K].
    integer :: first, last
    integer(c_int) :: code
    if (self%n == 0) return
    do first = 1, m, block_size
      last = min(m, first + block_size - 1)
      code = code_out_of_memory
      if (self%factorized) code = dotyk_cholmod_solve(self%handle, int(self%n, c_int64_t), &
        int(last - first + 1, c_int64_t), merge(1_c_int, 0_c_int, forward), merge(1_c_int, 0_c_int, back), &
        x(:, first:last))
      if (code /= code_ok) x(:, first:last) = not_a_number()
    end do
  end subroutine solve_columns

  !> A quiet NaN.
  pure real(dp) function not_a_number()
    not_a_number = transfer(int(z'7FF8000000000000', int64), 1.0_dp)
  end function not_a_number

  !> The equations of the last rows and columns of L, in the order of elimination.
  subroutine cholesky_trailing(self, equation)
    class(cholesky_t), intent(in) :: self
    integer, intent(out) :: equation(:)  !! Equations at the end of the permutation (m).
    integer(c_int64_t), allocatable :: number(:)
    allocate (number(size(equation)))
    if (size(equation) == 0) return
    call dotyk_cholmod_trailing(self%handle, size(equation, kind=c_int64_t), number)
    equation = int(number)
  end subroutine cholesky_trailing

  !> The supernodes, in the memory of the factor; none for a matrix of order 0.
  subroutine cholesky_supernodes(self, supernodes)
    class(cholesky_t), intent(in) :: self
    type(supernodes_t), intent(out) :: supernodes  !! Structure of the factor, and its values if it is factorized.
    integer(c_int64_t) :: counts(2)
    type(c_ptr) :: address(6)
    real(dp), pointer, contiguous :: values(:)
    if (.not. c_associated(self%handle)) return
    call dotyk_cholmod_supernodes(self%handle, counts, address)
    supernodes%n = counts(1)
    call take(address(1), counts(1) + 1, supernodes%column_start)
    call take(address(2), counts(1) + 1, supernodes%row_start)
    call take(address(3), counts(1) + 1, supernodes%value_start)
    call take(address(4), counts(2), supernodes%row)
    call take(address(5), int(self%n, int64), supernodes%permutation)
    if (.not. c_associated(address(6))) return
    call c_f_pointer(address(6), values, [self%factor_entries])
    supernodes%value(0:self%factor_entries - 1) => values
  contains
    !> A list of integers at an address, with lower bound 0.
    subroutine take(address, n, list)
      type(c_ptr), intent(in) :: address  !! The address.
      integer(int64), intent(in) :: n  !! Length of the list.
      integer(int64), pointer, contiguous, intent(out) :: list(:)  !! The list (0:n-1).
      integer(int64), pointer, contiguous :: numbers(:)
      call c_f_pointer(address, numbers, [n])
      list(0:n - 1) => numbers
    end subroutine take
  end subroutine cholesky_supernodes

  !> Free all memory.
  subroutine cholesky_destroy(self)
    class(cholesky_t), intent(inout) :: self
    if (c_associated(self%handle)) call dotyk_cholmod_free(self%handle)
    self%handle = c_null_ptr
    self%n = 0
    self%factor_entries = 0
    self%factor_bytes = 0
    self%workspace_bytes = 0
    self%flops = 0
    self%weakest_pivot = 0
    self%weakest_equation = 0
    self%factorized = .false.
  end subroutine cholesky_destroy

  !> Turn a code of the shim into an error.
  subroutine raise(code, what, factor, error)
    integer(c_int), intent(in) :: code  !! One of `code_*`.
    character(*), intent(in) :: what  !! Step that failed, as in "out of memory in the factorization".
    class(cholesky_t), intent(in) :: factor  !! Factor whose size the message gives.
    type(error_t), allocatable, intent(out) :: error  !! Set unless the code is `code_ok`.
    character(:), allocatable :: size_text
    if (code == code_ok) return
    !$omp critical (message)
    size_text = to_text(factor%n)//' unknowns'
    if (factor%factor_bytes > 0) size_text = size_text//': the factor takes '// &
      to_text(real(factor%factor_bytes, dp)*1.0e-9_dp)//' GB, its factorization '// &
      to_text(real(factor%workspace_bytes, dp)*1.0e-9_dp)//' GB more'
    !$omp end critical (message)
    select case (code)
    case (code_out_of_memory)
      call set_error(error, 'out of memory in the '//what//' of '//size_text, exit_machine)
    case (code_too_large)
      call set_error(error, 'the matrix is too large for the '//what//' of '//size_text, exit_not_solvable)
    case default
      call set_error(error, 'CHOLMOD refuses the '//what//' of '//size_text, exit_not_solvable)
    end select
  end subroutine raise

end module dotyk_linalg_cholesky
