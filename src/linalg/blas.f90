!> Products of dense matrices by BLAS, and OpenBLAS's own threads: how many, and which library it is. Interfaces of BLAS and OpenBLAS are declared here and nowhere else.
module dotyk_linalg_blas
  use, intrinsic :: iso_c_binding, only: c_int, c_char, c_ptr, c_null_char, c_f_pointer, c_associated
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: reserve_blas, set_blas_threads, blas_threads, blas_name, add_product, transposed_product, &
    dgemm, dgemv, dsyrk, dtrsm, dtrsv

  interface
    subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: dp
      character(1), intent(in) :: transa, transb
      integer, intent(in) :: m, n, k, lda, ldb, ldc
      real(dp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
      real(dp), intent(inout) :: c(ldc, *)
    end subroutine dgemm

    subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
      import :: dp
      character(1), intent(in) :: trans
      integer, intent(in) :: m, n, lda, incx, incy
      real(dp), intent(in) :: alpha, beta, a(lda, *), x(*)
      real(dp), intent(inout) :: y(*)
    end subroutine dgemv

    subroutine dtrsv(uplo, trans, diag, n, a, lda, x, incx)
      import :: dp
      character(1), intent(in) :: uplo, trans, diag
      integer, intent(in) :: n, lda, incx
      real(dp), intent(in) :: a(lda, *)
      real(dp), intent(inout) :: x(*)
    end subroutine dtrsv

    subroutine dsyrk(uplo, trans, n, k, alpha, a, lda, beta, c, ldc)
      import :: dp
      character(1), intent(in) :: uplo, trans
      integer, intent(in) :: n, k, lda, ldc
      real(dp), intent(in) :: alpha, beta, a(lda, *)
      real(dp), intent(inout) :: c(ldc, *)
    end subroutine dsyrk

    subroutine dtrsm(side, uplo, transa, diag, m, n, alpha, a, lda, b, ldb)
      import :: dp
      character(1), intent(in) :: side, uplo, transa, diag
      integer, intent(in) :: m, n, lda, ldb
      real(dp), intent(in) :: alpha, a(lda, *)
      real(dp), intent(inout) :: b(ldb, *)
    end subroutine dtrsm

    subroutine c_reserve_blas(n) bind(c, name='dotyk_reserve_blas')
      import :: c_int
      integer(c_int), value :: n
    end subroutine c_reserve_blas

    subroutine openblas_set_num_threads(n) bind(c, name='openblas_set_num_threads')
      import :: c_int
      integer(c_int), value :: n
    end subroutine openblas_set_num_threads

    integer(c_int) function openblas_get_num_threads() bind(c, name='openblas_get_num_threads')
      import :: c_int
    end function openblas_get_num_threads

    type(c_ptr) function openblas_get_config() bind(c, name='openblas_get_config')
      import :: c_ptr
    end function openblas_get_config

    type(c_ptr) function openblas_get_corename() bind(c, name='openblas_get_corename')
      import :: c_ptr
    end function openblas_get_corename
  end interface

contains

  !> Take the room that so many calls at the same time work in: where there is none later, OpenBLAS tries for ever.
  subroutine reserve_blas(n)
    !> Number of concurrent calls.
    integer, intent(in) :: n
    call c_reserve_blas(int(n, c_int))
  end subroutine reserve_blas

  !> C <- C + factor A B.
  subroutine add_product(factor, a, b, c)
    real(dp), intent(in) :: factor
    !> (n,r) and (r,m).
    real(dp), intent(in), contiguous :: a(:, :), b(:, :)
    !> (n,m)
    real(dp), intent(inout), contiguous :: c(:, :)
    if (size(a) == 0 .or. size(b) == 0) return
    call dgemm('N', 'N', size(a, 1), size(b, 2), size(a, 2), factor, a, size(a, 1), b, size(b, 1), 1.0_dp, c, size(c, 1))
  end subroutine add_product

  !> C = A^T B.
  subroutine transposed_product(a, b, c)
    !> (n,r) and (n,m).
    real(dp), intent(in), contiguous :: a(:, :), b(:, :)
    !> (r,m)
    real(dp), intent(out), contiguous :: c(:, :)
    c = 0
    if (size(a) == 0 .or. size(b) == 0) return
    call dgemm('T', 'N', size(a, 2), size(b, 2), size(a, 1), 1.0_dp, a, size(a, 1), b, size(b, 1), 0.0_dp, c, size(c, 1))
  end subroutine transposed_product

  !> Let every BLAS call of the process use n threads. To be called outside parallel regions.
  subroutine set_blas_threads(n)
    !> Number of threads, at least 1.
    integer, intent(in) :: n
    call openblas_set_num_threads(int(max(1, n), c_int))
  end subroutine set_blas_threads

  !> Threads that a BLAS call uses.
  integer function blas_threads()
    blas_threads = int(openblas_get_num_threads())
  end function blas_threads

  !> Name, version and options of the BLAS library, and the processor that it chose its kernels for.
  function blas_name() result(name)
    character(:), allocatable :: name
    name = text_of_c(openblas_get_config())//' ['//text_of_c(openblas_get_corename())//']'
  end function blas_name

  !> A C string as text.
  function text_of_c(string) result(text)
    type(c_ptr), intent(in) :: string
    character(:), allocatable :: text
    integer, parameter :: most = 256
    character(kind=c_char), pointer :: letter(:)
    integer :: i
    text = ''
    if (.not. c_associated(string)) return
    call c_f_pointer(string, letter, [most])
    do i = 1, most
      if (letter(i) == c_null_char) exit
      text = text//letter(i)
    end do
    text = trim(text)
  end function text_of_c
end module dotyk_linalg_blas
