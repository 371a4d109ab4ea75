!> Operations on long vectors over all threads, with the same digits on any number of them: sums run over chunks of
!> fixed length, and the sums of the chunks are added in their order.
module dotyk_linalg_fixed_sum
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: scalar_product, add_multiple, multiply_and_add, remove_components

  !> Length of a chunk: its two vectors stay in the first cache, and a body of 100,000 unknowns has 24 of them.
  integer, parameter :: chunk = 4096

contains

  !> Scalar product of two vectors.
  real(dp) function scalar_product(n, x, y) result(product)
    integer, intent(in) :: n  !! Length of the vectors.
    real(dp), intent(in) :: x(n)  !! The one vector (n) [any].
    real(dp), intent(in) :: y(n)  !! The other vector (n) [any].
    real(dp), allocatable :: part(:)
    integer :: k
    allocate (part((n + chunk - 1)/chunk))
    !$omp parallel do default(none) shared(n, x, y, part) schedule(static)
    do k = 1, size(part)
      part(k) = product_of_chunk(min(chunk, n - (k - 1)*chunk), x((k - 1)*chunk + 1), y((k - 1)*chunk + 1))
    end do
    !$omp end parallel do
    product = 0
    do k = 1, size(part)
      product = product + part(k)
    end do
  end function scalar_product

  !> Scalar product of a chunk, in eight strands that the compiler vectorizes.
  pure real(dp) function product_of_chunk(n, x, y) result(product)
    integer, intent(in) :: n  !! Length of the chunk.
    real(dp), intent(in) :: x(*)  !! Entries of the one vector (n) [any].
    real(dp), intent(in) :: y(*)  !! Entries of the other vector (n) [any].
    real(dp) :: strand(8)
    integer :: i
    strand = 0
    do i = 1, n - 7, 8
      strand = strand + x(i:i + 7)*y(i:i + 7)
    end do
    do i = n - modulo(n, 8) + 1, n
      strand(1) = strand(1) + x(i)*y(i)
    end do
    product = ((strand(1) + strand(2)) + (strand(3) + strand(4))) + ((strand(5) + strand(6)) + (strand(7) + strand(8)))
  end function product_of_chunk

  !> y := y + a x.
  subroutine add_multiple(n, a, x, y)
    integer, intent(in) :: n  !! Length of the vectors.
    real(dp), intent(in) :: a  !! Factor a [any].
    real(dp), intent(in) :: x(n)  !! Vector x (n) [any].
    real(dp), intent(inout) :: y(n)  !! Vector y (n) [as a x].
    integer :: i
    !$omp parallel do default(none) shared(n, a, x, y) schedule(static)
    do i = 1, n
      y(i) = y(i) + a*x(i)
    end do
    !$omp end parallel do
  end subroutine add_multiple

  !> y := x + a y.
  subroutine multiply_and_add(n, a, x, y)
    integer, intent(in) :: n  !! Length of the vectors.
    real(dp), intent(in) :: a  !! Factor a [].
    real(dp), intent(in) :: x(n)  !! Vector x (n) [any].
    real(dp), intent(inout) :: y(n)  !! Vector y (n) [as x].
    integer :: i
    !$omp parallel do default(none) shared(n, a, x, y) schedule(static)
    do i = 1, n
      y(i) = x(i) + a*y(i)
    end do
    !$omp end parallel do
  end subroutine multiply_and_add

  !> x := (I - V V^T) x for orthonormal columns V.
  subroutine remove_components(n, v, x)
    integer, intent(in) :: n  !! Length of the vectors.
    real(dp), intent(in) :: v(:, :)  !! Orthonormal vectors V (n, m) [].
    real(dp), intent(inout) :: x(n)  !! The vector (n) [any].
    real(dp) :: amplitude(size(v, 2))
    integer :: j
    do j = 1, size(v, 2)
      amplitude(j) = scalar_product(n, v(:, j), x)
    end do
    do j = 1, size(v, 2)
      call add_multiple(n, -amplitude(j), v(:, j), x)
    end do
  end subroutine remove_components
end module dotyk_linalg_fixed_sum
