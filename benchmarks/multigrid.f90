!> Measures p-multigrid on one block of quadratic elements against the Cholesky factor of its whole stiffness, and tells
!> where p-multigrid works:
!>
!>     benchmark_multigrid size CELLS [KIND [direct]]
!>     benchmark_multigrid table [CELLS]
!>
!> `size`: a cube of CELLS cells along each edge, of KIND tet10 (six in a cell), hex20 or hex27, with irregular inner
!> corners, held at the bottom, loaded on top. A STREAM triad, bandwidth of the products, memory, time and iterations;
!> with `direct` also the factor of the whole, and the difference of the two solutions. `table`: iterations against
!> Poisson's ratio, shapes of elements and bodies, and materials; upper end of the smoother's interval, least Ritz value
!> of the preconditioned stiffness, condition of the corner space, and the margin of the upper end. The reduction of the residual is 1e-8 in the norm of
!> the preconditioner. Threads: OMP_NUM_THREADS.
program multigrid
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_base_options, only: analysis_3d
  use dotyk_base_timer, only: wall_time
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_constraint, only: held
  use dotyk_elasticity_two_levels, only: two_levels_t
  use dotyk_linalg_blas, only: set_blas_threads
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_mesh_element, only: element_hex20, element_hex27, element_kind, element_kind_t, element_tet10, &
    reference_nodes, shape_functions
  use dotyk_response_direct, only: direct_response_t
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use element_products, only: measure_elements
  implicit none

  !> Reduction of the residual.
  real(dp), parameter :: tolerance = 1.0e-8_dp

  call set_blas_threads(omp_get_max_threads())
  select case (argument(1))
  case ('size')
    call measure_size(integer_argument(2, 10), kind_of(argument(3)), argument(4) == 'direct')
  case ('table')
    call write_table(integer_argument(2, 10))
  case default
    write (*, '(a)') 'usage: benchmark_multigrid size CELLS [KIND [direct]] | table [CELLS]'
    stop 2, quiet=.true.
  end select

contains

  !> An argument of the command line.
  function argument(i) result(text)
    !> Which one.
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(64) :: buffer
    buffer = ''
    call get_command_argument(i, buffer)
    text = trim(buffer)
  end function argument

  !> An argument that is a number.
  integer function integer_argument(i, default) result(number)
    !> Which one.
    integer, intent(in) :: i
    !> The number where the argument is missing.
    integer, intent(in) :: default
    integer :: status
    character(64) :: text
    text = argument(i)
    read (text, *, iostat=status) number
    if (status /= 0) number = default
  end function integer_argument

  !> Element kind of a name; tet10 for none.
  integer function kind_of(name) result(kind)
    !> The name.
    character(*), intent(in) :: name
    kind = element_tet10
    if (name == 'hex20') kind = element_hex20
    if (name == 'hex27') kind = element_hex27
  end function kind_of

  !> A block [0, 1] x [0, 1] x [0, n3/n1] of equal cells, held at z = 0, loaded on top; material of Poisson's ratio 0.3.
  subroutine make_block(kind, n1, n3, body)
    !> Element kind: tet10, hex20 or hex27.
    integer, intent(in) :: kind
    !> Cells along x and y.
    integer, intent(in) :: n1
    !> Cells along z.
    integer, intent(in) :: n3
    !> The block.
    type(body_t), intent(out) :: body
    type(element_kind_t) :: properties
    type(error_t), allocatable :: error
    real(dp), allocatable :: xi(:, :), corner(:, :, :), linear(:)
    integer, allocatable :: number(:, :, :), local(:, :, :)
    integer :: i, j, k, a, p, e, n, place(3)
    properties = element_kind(kind)
    call split_cell(properties, corner)
    allocate (xi(3, properties%n_nodes), linear(properties%n_corners), local(3, properties%n_nodes, size(corner, 3)))
    call reference_nodes(kind, xi)
    do p = 1, size(corner, 3)
      do a = 1, properties%n_nodes
        call shape_functions(properties%corner_kind, xi(:, a), linear)
        local(:, a, p) = nint(2*matmul(corner(:, :, p), linear))
      end do
    end do
    body%name = 'block'
    body%mesh%file = 'block'
    body%mesh%dimension = 3
    allocate (body%mesh%block(1))
    allocate (number(0:2*n1, 0:2*n1, 0:2*n3), source=0)
    body%mesh%block(1)%kind = kind
    allocate (body%mesh%block(1)%node(properties%n_nodes, n1*n1*n3*size(corner, 3)))
    n = 0
    e = 0
    do k = 0, n3 - 1
      do j = 0, n1 - 1
        do i = 0, n1 - 1
          do p = 1, size(corner, 3)
            e = e + 1
            do a = 1, properties%n_nodes
              place = 2*[i, j, k] + local(:, a, p)
              associate (node => number(place(1), place(2), place(3)))
                if (node == 0) then
                  n = n + 1
                  node = n
                end if
                body%mesh%block(1)%node(a, e) = node
              end associate
            end do
          end do
        end do
      end do
    end do
    body%mesh%block(1)%tag = [(int(a, int64), a=1, e)]
    body%mesh%node_tag = [(int(a, int64), a=1, n)]
    allocate (body%mesh%x(3, n), body%load(3, n), source=0.0_dp)
    call body%constraint%init(3, n)
    do k = 0, 2*n3
      do j = 0, 2*n1
        do i = 0, 2*n1
          a = number(i, j, k)
          if (a == 0) cycle
          body%mesh%x(:, a) = real([i, j, k], dp)/(2*n1)
          if (k == 0) body%constraint%equation(:, a) = held
          if (k == 2*n3) body%load(:, a) = [0.3_dp, 0.0_dp, -1.0_dp]
        end do
      end do
    end do
    call body%constraint%number_equations()
    body%dimension = 3
    body%analysis = analysis_3d
    call body%material%init_isotropic('steel', 2.0e11_dp, 0.3_dp, error)
  end subroutine make_block

  !> Divide a unit cell into elements.
  subroutine split_cell(properties, corner)
    !> Properties of the element kind.
    type(element_kind_t), intent(in) :: properties
    !> Corners of the elements (3, n_corners, n_pieces) [].
    real(dp), allocatable, intent(out) :: corner(:, :, :)
    integer, parameter :: order(3, 6) = reshape([1, 2, 3, 2, 3, 1, 3, 1, 2, 1, 3, 2, 3, 2, 1, 2, 1, 3], [3, 6])
    real(dp), allocatable :: xi(:, :)
    integer :: i, k
    if (properties%n_corners == 8) then
      allocate (corner(3, 8, 1), xi(3, 8))
      call reference_nodes(properties%corner_kind, xi)
      corner(:, :, 1) = 0.5_dp*(xi + 1)
      return
    end if
    allocate (corner(3, 4, 6), source=0.0_dp)
    do i = 1, 6
      do k = 1, 3
        corner(:, k + 1, i) = corner(:, k, i)
        corner(order(k, i), k + 1, i) = 1
      end do
      if (i > 3) corner(:, 2:3, i) = corner(:, [3, 2], i)
    end do
  end subroutine split_cell

  !> Displace the inner corners, and put the other nodes where straight elements have them.
  subroutine move_corners(body, n1, n3, every, shift, irregular)
    !> The block.
    type(body_t), intent(inout) :: body
    !> Cells along x and y.
    integer, intent(in) :: n1
    !> Cells along z.
    integer, intent(in) :: n3
    !> One inner corner out of so many is displaced.
    integer, intent(in) :: every
    !> Displacement, in cells (3) [].
    real(dp), intent(in) :: shift(3)
    !> Whether the displacements change from corner to corner.
    logical, intent(in) :: irregular
    type(element_kind_t) :: properties
    real(dp), allocatable :: xi(:, :), shape(:, :)
    integer :: i, e, a, place(3), count
    count = 0
    do i = 1, body%mesh%n_nodes()
      place = nint(2*n1*body%mesh%x(:, i))
      if (any(mod(place, 2) /= 0) .or. any(place == 0) .or. any(place == 2*[n1, n1, n3])) cycle
      count = count + 1
      if (mod(count, every) /= 0) cycle
      if (irregular) then
        body%mesh%x(:, i) = body%mesh%x(:, i) + shift/n1*sin(12.9898_dp*i + 78.233_dp*[1, 2, 3])
      else
        body%mesh%x(:, i) = body%mesh%x(:, i) + shift/n1
      end if
    end do
    properties = element_kind(body%mesh%block(1)%kind)
    allocate (xi(3, properties%n_nodes), shape(properties%n_corners, properties%n_nodes))
    call reference_nodes(body%mesh%block(1)%kind, xi)
    do a = 1, properties%n_nodes
      call shape_functions(properties%corner_kind, xi(:, a), shape(:, a))
    end do
    do e = 1, body%mesh%n_elements()
      associate (node => body%mesh%block(1)%node(:, e))
        do a = properties%n_corners + 1, properties%n_nodes
          body%mesh%x(:, node(a)) = matmul(body%mesh%x(:, node(:properties%n_corners)), shape(:, a))
        end do
      end associate
    end do
  end subroutine move_corners

  !> One size.
  subroutine measure_size(cells, kind, with_direct)
    !> Cells along each edge.
    integer, intent(in) :: cells
    !> Element kind.
    integer, intent(in) :: kind
    !> Whether the whole stiffness is factorized, too.
    logical, intent(in) :: with_direct
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
    !> The block.
    type(body_t), intent(in) :: body
    type(two_levels_t) :: stiffness
    type(error_t), allocatable :: error
    call stiffness%assemble(body, error)
    if (allocated(error)) error stop 'assembly'
  end subroutine assemble_only

  !> The factor of the whole.
  subroutine measure_direct(body, modes, x)
    !> The block.
    type(body_t), intent(inout) :: body
    !> Its rigid body modes.
    type(body_modes_t), intent(in) :: modes
    !> Solution by multigrid (n_equations) [length].
    real(dp), intent(in) :: x(:)
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
    !> The levels.
    type(multigrid_t), intent(in) :: levels
    !> Bandwidth of the triad [GB/s].
    real(dp), intent(in) :: triad
    integer, parameter :: rounds = 8
    real(dp), allocatable :: x(:), y(:)
    real(sp), allocatable :: b(:), r(:), s(:)
    real(dp) :: start, best(4), bytes(4)
    integer(int64) :: blocks
    character(24), parameter :: name(4) = [character(24) :: 'product, double', 'residual, single', 'residual, mixed', &
      'cycle']
    integer :: i, k
    blocks = size(levels%fine%rows%column, kind=int64)
    allocate (x(levels%n), y(levels%n), b(levels%n), r(levels%n), s(levels%n))
    x = 1
    b = 1
    s = 1
    r = 0
    best = huge(best)
    do k = 1, rounds
      do i = 1, 4
        start = wall_time()
        select case (i)
        case (1)
          call levels%multiply(x, y)
        case (2)
          call levels%fine%rows%residual(b, s, r)
        case (3)
          call levels%fine%rows%subtract_product(x, r)
        case (4)
          call levels%precondition(x, y)
        end select
        best(i) = min(best(i), wall_time() - start)
      end do
    end do
    ! Matrix and columns once, vectors once.
    bytes(1) = blocks*76.0_dp + levels%n*16.0_dp
    bytes(2) = blocks*40.0_dp + levels%n*12.0_dp
    bytes(3) = blocks*40.0_dp + levels%n*16.0_dp
    ! A smoother of degree 3: two residuals, three steps of 20 bytes and an inverse diagonal of 12; two smoothers.
    bytes(4) = 5*bytes(2) + bytes(3) + levels%n*(6*32.0_dp + 48) + 16.0_dp*levels%coarse%factor%factor_entries
    do i = 1, 4
      write (*, '(a, f0.4, a, f0.1, a, f0.2, a, f0.2, a)') name(i)//' ', best(i), ' s, ', bytes(i)/levels%n, &
        ' bytes per unknown, ', bytes(i)/best(i)*1e-9_dp, ' GB/s, ', bytes(i)/best(i)*1e-9_dp/triad, ' of the triad'
    end do
  end subroutine measure_products

  !> The residual element by element, without a matrix.
  subroutine compare_elements(levels, body, triad)
    !> The levels.
    type(multigrid_t), intent(in) :: levels
    !> The block.
    type(body_t), intent(in) :: body
    !> Bandwidth of the triad [GB/s].
    real(dp), intent(in) :: triad
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

  !> Iterations against materials and shapes.
  subroutine write_table(cells)
    !> Cells along each edge of the block.
    integer, intent(in) :: cells
    real(dp), parameter :: poisson(6) = [0.0_dp, 0.3_dp, 0.4_dp, 0.45_dp, 0.49_dp, 0.499_dp]
    integer, parameter :: kind(3) = [element_tet10, element_hex20, element_hex27]
    integer, parameter :: flatness(4) = [3, 10, 30, 100]
    character(5), parameter :: kind_name(3) = ['tet10', 'hex20', 'hex27']
    character(16) :: text
    type(body_t) :: body
    type(error_t), allocatable :: error
    integer :: i, k, n
    write (*, '(a)') 'case                                     unknowns  iterations  greatest  least Ritz  condition  margin'
    do k = 1, 3
      n = merge(cells, (2*cells)/3, k == 1)
      do i = 1, size(poisson)
        call make_block(kind(k), n, n, body)
        call move_corners(body, n, n, 1, spread(0.15_dp, 1, 3), .true.)
        call body%material%init_isotropic('m', 2.0_dp, poisson(i), error)
        write (text, '(f6.3)') poisson(i)
        call write_line(kind_name(k)//', Poisson'//trim(text), body)
        if (poisson(i) < 0.45_dp) cycle
        call body%material%project_dilatation()
        call write_line(kind_name(k)//', Poisson'//trim(text)//', projected', body)
      end do
    end do
    do k = 1, 3
      n = merge(cells, (2*cells)/3, k == 1)
      do i = 1, 4
        call make_block(kind(k), n, n, body)
        body%mesh%x(3, :) = body%mesh%x(3, :)/flatness(i)
        write (text, '(i0)') flatness(i)
        call write_line(kind_name(k)//', all flat 1:'//trim(text), body)
      end do
    end do
    do i = 1, 2
      n = merge(cells, (2*cells)/3, i == 1)
      ! Plates of one layer of cells, held at x = 0.
      call make_block(kind(i), 4*n, 1, body)
      call hold_side(body)
      call write_line(kind_name(i)//', plate of one layer', body)
      body%mesh%x(3, :) = body%mesh%x(3, :)/10
      call write_line(kind_name(i)//', plate of one layer 1:10', body)
      call make_block(kind(i), n, n, body)
      body%mesh%x(3, :) = body%mesh%x(3, :)/100
      call hold_side(body)
      call write_line(kind_name(i)//', cantilever, all flat 1:100', body)
      call make_block(kind(i), n, n, body)
      call thin_layer(body, n, 100)
      call write_line(kind_name(i)//', one thin layer 1:100', body)
      call make_block(kind(i), n, n, body)
      body%material%modulus_formula = 'x > 0.5 ? 1e6 : 1'
      call write_line(kind_name(i)//', contrast 1e6, halves', body)
      body%material%modulus_formula = 'z > 0.5 ? 1e6 : 1'
      call write_line(kind_name(i)//', contrast 1e6, stiff on soft', body)
      body%material%modulus_formula = 'z > 0.5 ? 1 : 1e6'
      call write_line(kind_name(i)//', contrast 1e6, soft on stiff', body)
      body%material%modulus_formula = 'sin(12*x)*sin(14*y)*sin(13*z) > 0.2 ? 1e6 : 1'
      call write_line(kind_name(i)//', contrast 1e6 within elements', body)
      body%material%modulus_formula = '10^(6*x)'
      call write_line(kind_name(i)//', contrast 1e6, smooth', body)
      call make_block(kind(i), n, n, body)
      call body%material%init_orthotropic('m', [100.0_dp, 1.0_dp, 1.0_dp], [0.3_dp, 0.3_dp, 0.3_dp], &
        [0.4_dp, 0.4_dp, 0.4_dp], [1.0_dp, 0.0_dp, 0.0_dp], [0.0_dp, 1.0_dp, 0.0_dp], error)
      call write_line(kind_name(i)//', orthotropic 100:1:1', body)
      call body%material%init_orthotropic('m', [100.0_dp, 1.0_dp, 1.0_dp], [0.3_dp, 0.3_dp, 0.3_dp], &
        [0.4_dp, 0.4_dp, 0.4_dp], [1.0_dp, 0.5_dp, 0.3_dp], [0.0_dp, 1.0_dp, 0.0_dp], error)
      call write_line(kind_name(i)//', orthotropic 100:1:1, tilted', body)
    end do
    call make_block(element_tet10, cells, cells, body)
    call move_corners(body, cells, cells, 20, [0.9_dp, 0.0_dp, 0.0_dp], .false.)
    call write_line('tet10, some needles 1:10', body)
    call make_block(element_tet10, cells, cells, body)
    call move_corners(body, cells, cells, 20, [0.99_dp, 0.0_dp, 0.0_dp], .false.)
    call write_line('tet10, some needles 1:100', body)
  end subroutine write_table

  !> Hold the side x = 0 in place of z = 0.
  subroutine hold_side(body)
    !> The block.
    type(body_t), intent(inout) :: body
    integer :: i
    do i = 1, body%mesh%n_nodes()
      body%constraint%equation(:, i) = merge(1, held, body%mesh%x(1, i) > 0)
    end do
    call body%constraint%number_equations()
  end subroutine hold_side

  !> Make the layer of cells in the middle thinner.
  subroutine thin_layer(body, n, ratio)
    !> The block.
    type(body_t), intent(inout) :: body
    !> Cells along its edges.
    integer, intent(in) :: n
    !> Ratio of the thicknesses.
    integer, intent(in) :: ratio
    real(dp) :: bottom, height
    integer :: i
    bottom = real(n/2, dp)/n
    do i = 1, body%mesh%n_nodes()
      height = body%mesh%x(3, i) - bottom
      if (height > 0) body%mesh%x(3, i) = bottom + min(height, 1.0_dp/n)/ratio + max(0.0_dp, height - 1.0_dp/n)
    end do
  end subroutine thin_layer

  !> Solve, and write a line.
  subroutine write_line(name, body)
    !> Name of the case.
    character(*), intent(in) :: name
    !> The body.
    type(body_t), intent(in) :: body
    type(multigrid_t) :: levels
    type(body_modes_t) :: modes
    type(factorization_report_t) :: report
    type(cg_outcome_t) :: outcome
    type(error_t), allocatable :: error
    real(dp), allocatable :: x(:)
    real(dp) :: least, greatest
    character(40) :: label
    label = name
    call modes%find(body)
    call levels%init(body, modes, report, error)
    if (allocated(error)) then
      write (*, '(a)') label//' '//error%message
      return
    end if
    allocate (x(body%constraint%n_equations))
    call body%constraint%reduce(body%load, x)
    call levels%solve(x, tolerance, 500, outcome)
    call outcome%ritz_values(least, greatest)
    write (*, '(a, i9, i10, a, f12.3, f12.4, es11.1, f8.3)') label, size(x), outcome%steps, &
      merge('  ', ' !', outcome%converged), levels%fine%greatest, least, report%condition, margin_of(levels)
    call levels%destroy()
  end subroutine write_line

  !> Upper end of the smoother's interval over the greatest eigenvalue, by 80 Lanczos steps [].
  real(dp) function margin_of(levels) result(margin)
    !> The levels.
    type(multigrid_t), intent(in) :: levels
    type(cg_outcome_t) :: outcome
    real(dp), allocatable :: start(:), x(:)
    real(dp) :: least, greatest
    integer :: i
    allocate (start(levels%n), x(levels%n))
    start(:) = [(sin(12.9898_dp*i + 0.37_dp*i*i), i=1, levels%n)]
    call conjugate_gradient(levels%fine, start, x, 0.0_dp, 80, outcome)
    call outcome%ritz_values(least, greatest)
    margin = levels%fine%greatest/greatest
  end function margin_of

  !> Start the clocks.
  subroutine start_clock(start, begun)
    !> Wall-clock time [s].
    real(dp), intent(out) :: start
    !> Processor time [s].
    real(dp), intent(out) :: begun
    call cpu_time(begun)
    start = wall_time()
  end subroutine start_clock

  !> Write the time since the start.
  subroutine read_clock(name, start, begun)
    !> What was measured.
    character(*), intent(in) :: name
    !> Wall-clock time at the start [s].
    real(dp), intent(in) :: start
    !> Processor time at the start [s].
    real(dp), intent(in) :: begun
    real(dp) :: now
    character(24) :: label
    label = name
    call cpu_time(now)
    write (*, '(a, f0.2, a, f0.2, a)') label//' ', wall_time() - start, ' s wall, ', now - begun, ' s processor'
  end subroutine read_clock

  !> Reset the peak of the resident memory.
  subroutine reset_peak()
    integer :: unit, status
    open (newunit=unit, file='/proc/self/clear_refs', action='write', status='old', iostat=status)
    if (status /= 0) return
    write (unit, '(i0)') 5
    close (unit)
  end subroutine reset_peak

  !> A figure of /proc/self/status [bytes].
  integer(int64) function memory_of(name) result(bytes)
    !> With its colon.
    character(*), intent(in) :: name
    character(200) :: line
    integer :: unit, status
    bytes = 0
    open (newunit=unit, file='/proc/self/status', action='read', status='old', iostat=status)
    do while (status == 0)
      read (unit, '(a)', iostat=status) line
      if (status == 0 .and. index(line, name) == 1) read (line(len(name) + 1:index(line, 'kB') - 1), *) bytes
    end do
    close (unit)
    bytes = 1024*bytes
  end function memory_of
end program multigrid
