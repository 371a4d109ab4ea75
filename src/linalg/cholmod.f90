!> The C interface of `cholmod_shim.c`: CHOLMOD behind an opaque handle. The only Fortran module that names CHOLMOD.
module dotyk_linalg_cholmod
  use, intrinsic :: iso_c_binding, only: c_ptr, c_int, c_int64_t, c_double
  implicit none
  private
  public :: dotyk_cholmod_new, dotyk_cholmod_free, dotyk_cholmod_analyze, dotyk_cholmod_permute, dotyk_cholmod_begin, &
    dotyk_cholmod_factorize, dotyk_cholmod_end, dotyk_cholmod_solve, dotyk_cholmod_supernodes, dotyk_cholmod_trailing, &
    dotyk_cholmod_solve_trailing, dotyk_cholmod_rcond

  ! What the shim returns.
  integer(c_int), parameter, public :: code_ok = 0, code_out_of_memory = 1, code_too_large = 3

  !> The shim's struct of the same name.
  type, bind(c), public :: statistics_t
    integer(c_int64_t) :: entries
    integer(c_int64_t) :: supernodes
    integer(c_int64_t) :: factor_bytes
    integer(c_int64_t) :: workspace_bytes
    real(c_double) :: flops
  end type statistics_t

  interface
    type(c_ptr) function dotyk_cholmod_new() bind(c)
      import :: c_ptr
    end function dotyk_cholmod_new

    subroutine dotyk_cholmod_free(handle) bind(c)
      import :: c_ptr
      type(c_ptr), value :: handle
    end subroutine dotyk_cholmod_free

    integer(c_int) function dotyk_cholmod_analyze(handle, n, start, row, permutation, trailing, statistics) bind(c)
      import :: c_ptr, c_int, c_int64_t, statistics_t
      type(c_ptr), value :: handle
      integer(c_int64_t), value :: n
      integer(c_int64_t), intent(in) :: start(*), row(*), permutation(*)
      integer(c_int64_t), value :: trailing
      type(statistics_t), intent(out) :: statistics
    end function dotyk_cholmod_analyze

    integer(c_int) function dotyk_cholmod_permute(handle, start, row, value) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: handle
      integer(c_int64_t), intent(in) :: start(*), row(*)
      real(c_double), intent(in) :: value(*)
    end function dotyk_cholmod_permute

    integer(c_int) function dotyk_cholmod_begin(handle, start, row, value) bind(c)
      import :: c_ptr, c_int
      type(c_ptr), value :: handle
      type(c_ptr), intent(out) :: start, row, value
    end function dotyk_cholmod_begin

    integer(c_int) function dotyk_cholmod_factorize(handle, start, row, value, failed) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: handle
      integer(c_int64_t), intent(in) :: start(*), row(*)
      real(c_double), intent(in) :: value(*)
      integer(c_int64_t), intent(out) :: failed
    end function dotyk_cholmod_factorize

    subroutine dotyk_cholmod_end(handle) bind(c)
      import :: c_ptr
      type(c_ptr), value :: handle
    end subroutine dotyk_cholmod_end

    integer(c_int) function dotyk_cholmod_solve(handle, n, m, x) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: handle
      integer(c_int64_t), value :: n, m
      real(c_double), intent(inout) :: x(*)
    end function dotyk_cholmod_solve

    subroutine dotyk_cholmod_supernodes(handle, counts, pointers) bind(c)
      import :: c_ptr, c_int64_t
      type(c_ptr), value :: handle
      integer(c_int64_t), intent(out) :: counts(2)
      type(c_ptr), intent(out) :: pointers(6)
    end subroutine dotyk_cholmod_supernodes

    subroutine dotyk_cholmod_trailing(handle, m, equation) bind(c)
      import :: c_ptr, c_int64_t
      type(c_ptr), value :: handle
      integer(c_int64_t), value :: m
      integer(c_int64_t), intent(out) :: equation(*)
    end subroutine dotyk_cholmod_trailing

    integer(c_int) function dotyk_cholmod_solve_trailing(handle, m, columns, x) bind(c)
      import :: c_ptr, c_int, c_int64_t, c_double
      type(c_ptr), value :: handle
      integer(c_int64_t), value :: m, columns
      real(c_double), intent(inout) :: x(*)
    end function dotyk_cholmod_solve_trailing

    real(c_double) function dotyk_cholmod_rcond(handle) bind(c)
      import :: c_ptr, c_double
      type(c_ptr), value :: handle
    end function dotyk_cholmod_rcond
  end interface
end module dotyk_linalg_cholmod
