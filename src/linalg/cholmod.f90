!> Interface of `cholmod_shim.c`: CHOLMOD behind an opaque handle, named by no other module. Functions return one of
!> `code_*`, or a code that CHOLMOD does not explain.
module dotyk_linalg_cholmod
  use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_int64_t, c_double
  implicit none
  private
  public :: dotyk_cholmod_new, dotyk_cholmod_free, dotyk_cholmod_analyze, dotyk_cholmod_permute, &
    dotyk_cholmod_factorize, dotyk_cholmod_solve, dotyk_cholmod_supernodes, dotyk_cholmod_trailing

  integer(c_int), parameter, public :: code_ok = 0  !! No error.
  integer(c_int), parameter, public :: code_out_of_memory = 1  !! CHOLMOD has no memory.
  integer(c_int), parameter, public :: code_too_large = 3  !! The factor exceeds 64-bit integers.

  type, bind(c), public :: statistics_t  !! Result of the symbolic analysis; the struct of the same name in the shim.
    integer(c_int64_t) :: entries  !! Stored entries of the factor, zeros inside supernodes included.
    integer(c_int64_t) :: factor_bytes  !! Memory of the factor [bytes].
    !> Memory of a factorization beside the factor and the matrix, an estimate [bytes].
    integer(c_int64_t) :: workspace_bytes
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
      !> Position of the first entry of each column of the lower triangle, 0-based (n+1).
      integer(c_int64_t), intent(in) :: start(*)
      integer(c_int64_t), intent(in) :: row(*)  !! Row of each entry, ascending in each column, 0-based (entries).
      integer(c_int64_t), intent(in) :: permutation(*)  !! The equation that is eliminated k-th, 0-based (n).
      integer(c_int64_t), value :: trailing  !! Equations at the end of the permutation that stay there.
      type(statistics_t), intent(out) :: statistics  !! Size and cost of the factor.
    end function dotyk_cholmod_analyze

    !> Make the lower triangle of P K P^T.
    integer(c_int) function dotyk_cholmod_permute(handle, start, row, value) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: handle  !! Handle of the factor.
      !> Position of the first entry of each column of the lower triangle of K, 0-based (n+1).
      integer(c_int64_t), intent(in) :: start(*)
      integer(c_int64_t), intent(in) :: row(*)  !! Row of each entry, 0-based (entries).
      real(c_double), intent(in) :: value(*)  !! Value of each entry (entries) [any].
    end function dotyk_cholmod_permute

    !> Numeric factorization of P K P^T, which is freed.
    integer(c_int) function dotyk_cholmod_factorize(handle, failed) bind(c)
      import :: c_ptr, c_int, c_int64_t
      type(c_ptr), value :: handle  !! Handle of the factor.
      !> First column of L (from 1) whose pivot is not positive, 0 if there is none.
      integer(c_int64_t), intent(out) :: failed
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
end module dotyk_linalg_cholmod
