!> Speed of the machine, measured in some tenths of a second: for predictions.
module dotyk_linalg_machine_speed
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_timer, only: wall_time
  use dotyk_linalg_blas, only: dgemm
  use dotyk_linalg_block_rows, only: block_rows_t
  implicit none
  private

  type, public :: machine_speed_t  !! What the machine does now; less where other programs run.
    real(dp) :: flops = 0  !! Dense products of one thread [flop/s].
    !> Entries of sparse matrices that all threads read and multiply: one thread alone is slower than the memory
    !> [byte/s].
    real(dp) :: bandwidth = 0
    integer :: n_threads = 1  !! Number of threads.
  contains
    procedure :: measure => machine_speed_measure
  end type machine_speed_t

  integer, parameter :: order = 384  !! Rows and columns of the matrices of the dense product.
  !> Block rows of the sparse matrix, and blocks beside the diagonal on one side: it exceeds the caches.
  integer, parameter :: n_rows = 60000, half_width = 13
  real(dp), parameter :: block_bytes = 76  !! Memory of a block and its column [byte].
  integer, parameter :: repeat = 4  !! Repetitions; the fastest counts.

contains

  !> Measure, outside parallel regions.
  subroutine machine_speed_measure(self)
    class(machine_speed_t), intent(out) :: self
    type(block_rows_t) :: rows
    real(dp), allocatable :: a(:, :), b(:, :), c(:, :), x(:), y(:)
    real(dp) :: start, dense, sparse
    integer :: k
    self%n_threads = omp_get_max_threads()
    allocate (a(order, order), b(order, order), source=1.0_dp)
    allocate (c(order, order), source=0.0_dp)
    call make_band(rows)
    allocate (x(rows%dim*rows%n), y(rows%dim*rows%n), source=1.0_dp)
    dense = huge(dense)
    sparse = huge(sparse)
    do k = 1, repeat
      start = wall_time()
      call dgemm('N', 'N', order, order, order, 1.0_dp, a, order, b, order, 1.0_dp, c, order)
      dense = min(dense, wall_time() - start)
      start = wall_time()
      call rows%multiply(x, y)
      sparse = min(sparse, wall_time() - start)
    end do
    ! The results are used: no loop is optimized away.
    if (.not. y(size(y)) > 0 .and. c(order, order) > 0) then
      self%flops = 2*real(order, dp)**3/max(dense, tiny(dense))
      self%bandwidth = block_bytes*real(size(rows%column), dp)/max(sparse, tiny(sparse))
    end if
    call rows%destroy()
  end subroutine machine_speed_measure

  !> A band matrix of zeros with as many blocks in a row as tet10.
  subroutine make_band(rows)
    type(block_rows_t), intent(inout) :: rows  !! The matrix.
    integer(int64), allocatable :: start(:)
    integer, allocatable :: neighbour(:)
    integer :: i, k, n
    allocate (start(n_rows + 1), neighbour(2*half_width*n_rows))
    n = 0
    do i = 1, n_rows
      start(i) = n + 1
      do k = max(1, i - half_width), min(n_rows, i + half_width)
        if (k == i) cycle
        n = n + 1
        neighbour(n) = k
      end do
    end do
    start(n_rows + 1) = n + 1
    call rows%init(3, start, neighbour(:n), 1.0_dp)
    call rows%pack()
  end subroutine make_band
end module dotyk_linalg_machine_speed
