!> Measures p-multigrid on one block of quadratic elements against the Cholesky factor of its whole stiffness, and tells
!> where p-multigrid works:
!>
!>     benchmark_multigrid size CELLS [KIND [direct]]
!>     benchmark_multigrid aggregation CELLS [KIND]
!>     benchmark_multigrid linear CELLS [KIND]
!>     benchmark_multigrid table [CELLS [FIRST LAST]]
!>
!> `size`: a cube of CELLS cells along each edge, of KIND tet10 (six in a cell), hex20, hex27, prism15
!> or prism18 (two), with irregular inner
!> corners, held at the bottom, loaded on top. A STREAM triad, bandwidth of the products, memory, time and iterations;
!> with `direct` also the factor of the whole, and the difference of the two solutions. `aggregation`: the same block with
!> smoothed aggregation on the corner space in place of its factor. `linear`: a block of tet4 or hex8 by smoothed
!> aggregation alone. `table`: iterations against
!> Poisson's ratio, shapes of elements and bodies, and materials, of the cases FIRST to LAST; upper end of the smoother's
!> interval, least Ritz value of the preconditioned stiffness, in the end and in the trial, residual of the trial, margin
!> of the upper end, processor time of an iteration [us per unknown], Gflop of a factor, and the choice of
!> `response='auto'` for 200,000 unknowns: a factor, m, by its material, t, because the trial is slow, c, because the
!> factor is cheaper, o, by what always speaks against p-multigrid. The reduction of the residual is 1e-8 in the norm of
!> the preconditioner. Threads: OMP_NUM_THREADS.
program multigrid
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_base_timer, only: wall_time
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_constraint, only: held
  use dotyk_elasticity_two_levels, only: two_levels_t
  use dotyk_linalg_blas, only: set_blas_threads
  use dotyk_linalg_block_products, only: smooth_rows
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t
  use dotyk_mesh_element, only: element_hex20, element_hex27, element_hex8, element_prism15, element_prism18, &
    element_tet10, element_tet4
  use dotyk_response_direct, only: direct_response_t
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use element_products, only: measure_elements
  use multigrid_aggregation, only: measure_aggregation, measure_linear
  use multigrid_blocks, only: make_block, move_corners
  use multigrid_clock, only: memory_of, read_clock, reset_peak, start_clock
  use multigrid_table, only: write_table
  implicit none

  real(dp), parameter :: tolerance = 1.0e-8_dp  !! Reduction of the residual.

  call set_blas_threads(omp_get_max_threads())
  select case (argument(1))
  case ('size')
    call measure_size(integer_argument(2, 10), kind_of(argument(3)), argument(4) == 'direct')
  case ('aggregation')
    call measure_aggregation(integer_argument(2, 10), kind_of(argument(3)), tolerance)
  case ('linear')
    call measure_linear(integer_argument(2, 10), merge(element_hex8, element_tet4, argument(3) == 'hex8'), tolerance)
  case ('table')
    call write_table(integer_argument(2, 12), integer_argument(3, 0), integer_argument(4, 0))
  case default
    write (*, '(a)') 'usage: benchmark_multigrid size CELLS [KIND [direct]] | aggregation CELLS [KIND] | '// &
      'linear CELLS [KIND] | table [CELLS [FIRST LAST]]'
    stop 2, quiet=.true.
  end select

contains

  !> An argument of the command line.
  function argument(i) result(text)
    integer, intent(in) :: i  !! Which one.
    character(:), allocatable :: text
    character(64) :: buffer
    buffer = ''
    call get_command_argument(i, buffer)
    text = trim(buffer)
  end function argument

  !> An argument that is a number.
  integer function integer_argument(i, default) result(number)
    integer, intent(in) :: i  !! Which one.
    integer, intent(in) :: default  !! The number where the argument is missing.
    integer :: status
    character(64) :: text
    text = argument(i)
    read (text, *, iostat=status) number
    if (status /= 0) number = default
  end function integer_argument

  !> Element kind of a name; tet10 for none.
  integer function kind_of(name) result(kind)
    character(*), intent(in) :: name  !! The name.
    kind = element_tet10
    if (name == 'hex20') kind = element_hex20
    if (name == 'hex27') kind = element_hex27
    if (name == 'prism15') kind = element_prism15
    if (name == 'prism18') kind = element_prism18
  end function kind_of

  !> One size.
  subroutine measure_size(cells, kind, with_direct)
    integer, intent(in) :: cells  !! Cells along each edge.
    integer, intent(in) :: kind  !! Element kind.
    logical, intent(in) :: with_direct  !! Whether the whole stiffness is factorized, too.
    type(body_t) :: body
    type(multigrid_t) :: levels
    type(body_modes_t) :: modes
    type(factorization_report_t) :: report
    type(cg_outcome_t) :: outcome
    type(error_t), allocatable :: error
    real(dp), allocatable :: x(:)
    real(dp) :: start, begun, used, triad, least, greatest
    integer(int64) :: memory
    integer :: degree
    call make_block(kind, cells, cells, body)
    call move_corners(body, cells, cells, 1, spread(0.15_dp, 1, 3), .true.)
    call modes%find(body)
    triad = stream_triad()
    write (*, '(a, i0, a, i0)') 'unknowns ', body%constraint%n_equations, ', threads ', omp_get_max_threads()
    write (*, '(a, f0.2, a)') 'STREAM triad             ', triad, ' GB/s'
    call start_clock(start, begun)
    call assemble_only(body)
    call read_clock('assembly of both levels', start, begun)
    call reset_peak()
    memory = memory_of('VmRSS:')
    call start_clock(start, begun)
    call levels%init(body, modes, report, error)
    if (allocated(error)) error stop 'multigrid'
    call read_clock('set-up', start, begun)
    write (*, '(a, i0, a, f0.2, a, es8.1)') 'coarse unknowns          ', levels%coarse%factor%n, ', Gflop ', &
      levels%coarse%factor%flops/1e9_dp, ', condition at least ', report%condition
    write (*, '(a, i0, a, i0)') 'bytes per unknown: rows  ', levels%fine%bytes()/levels%n, ', factor ', &
      levels%coarse%factor%factor_bytes/levels%n
    write (*, '(a, f0.3)') 'greatest eigenvalue, with margin ', levels%fine%greatest
    call measure_products(levels, triad)
    if (kind == element_tet10) call compare_elements(levels, body, triad)
    allocate (x(body%constraint%n_equations))
    do degree = 2, 4
      levels%fine%degree = degree
      call body%constraint%reduce(body%load, x)
      call start_clock(start, begun)
      call levels%solve(x, tolerance, 200, outcome)
      used = wall_time() - start
      call read_clock('solve', start, begun)
      call outcome%ritz_values(least, greatest)
      write (*, '(a, i0, a, i0, a, f0.3, a, f0.3, a, f0.3)') 'degree ', degree, ', iterations   ', outcome%steps, &
        ', each ', used/max(1, outcome%steps), ' s, Ritz values ', least, ' to ', greatest
    end do
    write (*, '(a, f0.3, a)') 'peak memory above body   ', real(memory_of('VmHWM:') - memory, dp)*1e-9_dp, ' GB'
    call levels%destroy()
    if (with_direct) call measure_direct(body, modes, x)
  end subroutine measure_size

  !> Assemble both levels, the first part of the set-up.
  subroutine assemble_only(body)
    type(body_t), intent(in) :: body  !! The block.
    type(two_levels_t) :: stiffness
    type(error_t), allocatable :: error
    call stiffness%assemble(body, error)
    if (allocated(error)) error stop 'assembly'
  end subroutine assemble_only

  !> The factor of the whole.
  subroutine measure_direct(body, modes, x)
    type(body_t), intent(inout) :: body  !! The block.
    type(body_modes_t), intent(in) :: modes  !! Its rigid body modes.
    real(dp), intent(in) :: x(:)  !! Solution by multigrid (n_equations) [length].
    type(direct_response_t) :: direct
    type(stiffness_t) :: stiffness
    type(factorization_report_t) :: report
    type(error_t), allocatable :: error
    real(dp), allocatable :: y(:), difference(:)
    real(dp) :: start, begun
    integer(int64) :: memory
    call reset_peak()
    memory = memory_of('VmRSS:')
    call start_clock(start, begun)
    call body%assemble(stiffness, error)
    if (.not. allocated(error)) call direct%analyze(body, modes, stiffness, error)
    if (.not. allocated(error)) call direct%factorize(body, stiffness, .false., report, error)
    if (allocated(error)) error stop 'factorization'
    call read_clock('direct: set-up', start, begun)
    call start_clock(start, begun)
    y = body%rhs
    call direct%solve(y)
    call read_clock('direct: solve', start, begun)
    write (*, '(a, f0.3, a, f0.1)') 'direct: peak above body  ', real(memory_of('VmHWM:') - memory, dp)*1e-9_dp, &
      ' GB, Gflop ', direct%factor%flops/1e9_dp
    difference = x - y
    write (*, '(a, es8.1)') 'relative difference      ', norm2(difference)/norm2(y)
    call direct%destroy()
  end subroutine measure_direct

  !> Bandwidth of the products.
  subroutine measure_products(levels, triad)
    type(multigrid_t), intent(in) :: levels  !! The levels.
    real(dp), intent(in) :: triad  !! Bandwidth of the triad [GB/s].
    integer, parameter :: rounds = 8
    real(dp), allocatable :: x(:), y(:)
    real(sp), allocatable :: b(:), r(:), s(:), p(:)
    real(dp) :: start, best(5), bytes(5)
    integer(int64) :: blocks
    character(24), parameter :: name(5) = [character(24) :: 'product, double', 'residual, single', 'residual, mixed', &
      'smoothing step', 'cycle']
    integer :: i, k
    blocks = size(levels%fine%rows%column, kind=int64)
    allocate (x(levels%n), y(levels%n), b(levels%n), r(levels%n), s(levels%n), p(levels%n))
    p = 0
    x = 1
    b = 1
    s = 1
    r = 0
    best = huge(best)
    do k = 1, rounds
      do i = 1, 5
        start = wall_time()
        select case (i)
        case (1)
          call levels%multiply(x, y)
        case (2)
          call levels%fine%rows%residual(b, s, r)
        case (3)
          call levels%fine%rows%subtract_product(x, r)
        case (4)
          call smooth_rows(levels%fine%rows%dim, levels%fine%rows%n, levels%fine%rows%start, levels%fine%rows%column, &
                           levels%fine%rows%leading, levels%fine%inverse, 0.3_sp, 0.2_sp, b, s, p, r)
        case (5)
          call levels%precondition(x, y)
        end select
        best(i) = min(best(i), wall_time() - start)
      end do
    end do
    ! Matrix and columns once, vectors once.
    bytes(1) = blocks*76.0_dp + levels%n*16.0_dp
    bytes(2) = blocks*40.0_dp + levels%n*12.0_dp
    bytes(3) = blocks*40.0_dp + levels%n*16.0_dp
    bytes(4) = blocks*22.0_dp + levels%n*32.0_dp
    ! A smoother of degree 3: a step without the matrix and two with it; two smoothers.
    bytes(5) = 4*bytes(4) + bytes(2) + bytes(3) + levels%n*(2*28.0_dp + 48) + 16.0_dp*levels%coarse%factor%factor_entries
    do i = 1, 5
      write (*, '(a, f0.4, a, f0.1, a, f0.2, a, f0.2, a)') name(i)//' ', best(i), ' s, ', bytes(i)/levels%n, &
        ' bytes per unknown, ', bytes(i)/best(i)*1e-9_dp, ' GB/s, ', bytes(i)/best(i)*1e-9_dp/triad, ' of the triad'
    end do
  end subroutine measure_products

  !> The residual element by element, without a matrix.
  subroutine compare_elements(levels, body, triad)
    type(multigrid_t), intent(in) :: levels  !! The levels.
    type(body_t), intent(in) :: body  !! The block.
    real(dp), intent(in) :: triad  !! Bandwidth of the triad [GB/s].
    real(sp), allocatable :: r(:), assembled(:), x(:), zero(:)
    real(dp) :: seconds, bytes, difference
    logical, allocatable :: free(:)
    integer :: i
    allocate (assembled(levels%n), zero(levels%n), source=0.0_sp)
    free = reshape(levels%constraint%equation /= held, [levels%n])
    x = [(merge(real(sin(real(i, dp)), sp), 0.0_sp, free(i)), i=1, levels%n)]
    call measure_elements(body, x, seconds, bytes, r)
    call levels%fine%rows%residual(zero, x, assembled)
    difference = maxval(abs(assembled*levels%fine%rows%scale - r), mask=free)/maxval(abs(r), mask=free)
    write (*, '(a, f0.4, a, f0.1, a, f0.2, a, f0.2, a, es8.1)') 'residual, by elements    ', seconds, ' s, ', &
      bytes/levels%n, ' bytes per unknown, ', bytes/seconds*1e-9_dp, ' GB/s, ', bytes/seconds*1e-9_dp/triad, &
      ' of the triad; difference ', difference
  end subroutine compare_elements

  !> STREAM triad a = b + s c (J. D. McCalpin), on arrays beyond the caches [GB/s].
  real(dp) function stream_triad() result(bandwidth)
    integer, parameter :: n = 20000000
    real(dp), allocatable :: a(:), b(:), c(:)
    real(dp) :: start, best
    integer :: i, k
    allocate (a(n), b(n), c(n))
    !$omp parallel do default(none) shared(a, b, c) schedule(static)
    do i = 1, n
      a(i) = 0
      b(i) = 1
      c(i) = 2
    end do
    !$omp end parallel do
    best = huge(best)
    do k = 1, 8
      start = wall_time()
      !$omp parallel do default(none) shared(a, b, c) schedule(static)
      do i = 1, n
        a(i) = b(i) + 3*c(i)
      end do
      !$omp end parallel do
      best = min(best, wall_time() - start)
    end do
    bandwidth = 24.0e-9_dp*n/best
    if (a(n) < 0) bandwidth = 0
  end function stream_triad
end program multigrid
