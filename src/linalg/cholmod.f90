!> Interface of `cholmod_shim.c`: CHOLMOD behind an opaque handle, named by no other module. Functions return one of
!> `code_*`, or a code that CHOLMOD does not explain.
module dotyk_linalg_cholmod
  use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_int64_t, c_double
  implicit none
  private
  public :: dotyk_cholmod_new, dotyk_cholmod_free, dotyk_cholmod_analyze, dotyk_cholmod_permute, &
    dotyk_cholmod_factorize, dotyk_cholmod_solve, dotyk_cholmod_supernodes, dotyk_cholmod_trailing, &
    dotyk_cholmod_solve_trailing

  !> No error.
  integer(c_int), parameter, public :: code_ok = 0
  !> CHOLMOD has no memory.
  integer(c_int), parameter, public :: code_out_of_memory = 1
  !> The factor exceeds 64-bit integers.
  integer(c_int), parameter, public :: code_too_large = 3

  !> Result of the symbolic analysis; the struct of the same name in the shim.
  type, bind(c), public :: statistics_t
    !> Stored entries of the factor, zeros inside supernodes included.
    integer(c_int64_t) :: entries
    !> Memory of the factor [bytes].
    integer(c_int64_t) :: factor_bytes
    !> Memory of a factorization beside the factor and the matrix, an estimate [bytes].
    integer(c_int64_t) :: workspace_bytes
    !> Floating-point operations of a factorization.
    real(c_double) :: flops
  end type statistics_t

  interface
    !> Make an empty handle.
    type(c_ptr) function dotyk_cholmod_new() bind(c)
      import :: c_ptr
    end function dotyk_cholmod_new

    !> Free a handle and all that belongs to it.
    subroutine dotyk_cholmod_free(handle) bind(c)
      import :: c_ptr
      !> Handle of the factor.
      type(c_ptr), value :: handle
    end subroutine dotyk_cholmod_free

    !> Symbolic analysis.
    integer(c_int) function dotyk_cholmod_analyze(handle, n, start, row, permutation, trailing, statistics) bind(c)
      import :: c_ptr, c_int, c_int64_t, statistics_t
      !> Handle of the factor.
      type(c_ptr), value :: handle
      !> Order of K.
      integer(c_int64_t), value :: n
      !> Position of the first entry of each column of the lower triangle, 0-based (n+1).
      integer(c_int64_t), intent(in) :: start(*)
      !> Row of each entry, ascending in each column, 0-based (entries).
      integer(c_int64_t), intent(in) :: row(*)
      !> The equation that is eliminated k-th, 0-based (n).
      integer(c_int64_t), intent(in) :: permutation(*)
      !> Equations at the end of the permutation that stay there.
      integer(c_int64_t), value :: trailing
      !> Size and cost of the factor.
      type(statistics_t), intent(out) :: statistics
    end function dotyk_cholmod_analyze

    !> Make the lower triangle of P K P^T.
    integer(c_int) function dotyk_cholmod_permute(handle, start, row, value) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      !> Handle of the factor.
      type(c_ptr), value :: handle
      !> Position of the first entry of each column of the lower triangle of K, 0-based (n+1).
      integer(c_int64_t), intent(in) :: start(*)
      !> Row of each entry, 0-based (entries).
      integer(c_int64_t), intent(in) :: row(*)
      !> Value of each entry (entries) [any].
      real(c_double), intent(in) :: value(*)
    end function dotyk_cholmod_permute

    !> Numeric factorization of P K P^T, which is freed.
    integer(c_int) function dotyk_cholmod_factorize(handle, failed) bind(c)
      import :: c_ptr, c_int, c_int64_t
      !> Handle of the factor.
      type(c_ptr), value :: handle
      !> First column of L (from 1) whose pivot is not positive, 0 if there is none.
      integer(c_int64_t), intent(out) :: failed
    end function dotyk_cholmod_factorize

    !> Solve K X = B.
    integer(c_int) function dotyk_cholmod_solve(handle, n, m, x) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      !> Handle of the factor.
      type(c_ptr), value :: handle
      !> Order of K.
      integer(c_int64_t), value :: n
      !> Number of right-hand sides.
      integer(c_int64_t), value :: m
      !> Right-hand sides [any], then solutions (n, m) [those over K].
      real(c_double), intent(inout) :: x(*)
    end function dotyk_cholmod_solve

    !> The arrays of the supernodes.
    subroutine dotyk_cholmod_supernodes(handle, counts, pointers) bind(c)
      import :: c_ptr, c_int64_t
      !> Handle of the factor.
      type(c_ptr), value :: handle
      !> Number of supernodes, length of the list of rows.
      integer(c_int64_t), intent(out) :: counts(2)
      !> Addresses of: first column of each supernode, position of its first row, position of its first value, list of
      !> rows, permutation, values (null before the factorization); all 0-based.
      type(c_ptr), intent(out) :: pointers(6)
    end subroutine dotyk_cholmod_supernodes

    !> The equations of the last columns of L.
    subroutine dotyk_cholmod_trailing(handle, m, equation) bind(c)
      import :: c_ptr, c_int64_t
      !> Handle of the factor.
      type(c_ptr), value :: handle
      !> Number of columns.
      integer(c_int64_t), value :: m
      !> Equations of the last m columns (m).
      integer(c_int64_t), intent(out) :: equation(*)
    end subroutine dotyk_cholmod_trailing

    !> Solve with the last rows and columns of L.
    integer(c_int) function dotyk_cholmod_solve_trailing(handle, m, columns, x) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      !> Handle of the factor.
      type(c_ptr), value :: handle
      !> Number of rows and columns of L.
      integer(c_int64_t), value :: m
      !> Number of right-hand sides.
      integer(c_int64_t), value :: columns
      !> Right-hand sides [any], then solutions (m, columns) [those over K].
      real(c_double), intent(inout) :: x(*)
    end function dotyk_cholmod_solve_trailing
  end interface
end module dotyk_linalg_cholmod
