!> Speed of the machine, measured in a few hundredths of a second: for predictions.
module dotyk_linalg_machine_speed
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: wall_time
  use dotyk_linalg_blas, only: dgemm
  implicit none
  private

  !> What the machine does now; less where other programs run.
  type, public :: machine_speed_t
    !> Dense products of one thread [flop/s].
    real(dp) :: flops = 0
    !> Memory bandwidth of all threads, by a STREAM triad [byte/s].
    real(dp) :: bandwidth = 0
    !> Number of threads.
    integer :: n_threads = 1
  contains
    procedure :: measure => machine_speed_measure
  end type machine_speed_t

  !> Rows and columns of the matrices of the dense product.
  integer, parameter :: order = 384
  !> Length of the arrays of the triad: three of them exceed the caches.
  integer, parameter :: length = 8000000
  !> Repetitions; the fastest counts.
  integer, parameter :: repeat = 4

contains

  !> Measure, outside parallel regions.
  subroutine machine_speed_measure(self)
    class(machine_speed_t), intent(out) :: self
    real(dp), allocatable :: a(:, :), b(:, :), c(:, :), x(:), y(:), z(:)
    real(dp) :: start, product, triad
    integer :: i, k
    self%n_threads = omp_get_max_threads()
    allocate (a(order, order), b(order, order), source=1.0_dp)
    allocate (c(order, order), source=0.0_dp)
    allocate (x(length), y(length), z(length))
    !$omp parallel do default(none) schedule(static) shared(x, y, z)
    do i = 1, length
      x(i) = 0
      y(i) = 1
      z(i) = 2
    end do
    !$omp end parallel do
    product = huge(product)
    triad = huge(triad)
    do k = 1, repeat
      start = wall_time()
      call dgemm('N', 'N', order, order, order, 1.0_dp, a, order, b, order, 1.0_dp, c, order)
      product = min(product, wall_time() - start)
      start = wall_time()
      !$omp parallel do default(none) schedule(static) shared(x, y, z)
      do i = 1, length
        x(i) = y(i) + 3*z(i)
      end do
      !$omp end parallel do
      triad = min(triad, wall_time() - start)
    end do
    ! The results are used: no loop is optimized away.
    if (x(length) > 0 .and. c(order, order) > 0) then
      self%flops = 2*real(order, dp)**3/max(product, tiny(product))
      self%bandwidth = 24*real(length, dp)/max(triad, tiny(triad))
    end if
  end subroutine machine_speed_measure
end module dotyk_linalg_machine_speed
