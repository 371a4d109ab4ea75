!> Smoothed aggregation on the corner space of quadratic elements, and on meshes of linear elements.
module multigrid_aggregation
  use omp_lib, only: omp_get_max_threads
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_rigid_body_modes, only: near_null_vectors
  use dotyk_elasticity_two_levels, only: two_levels_t
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_linalg_smoothed_aggregation, only: smoothed_aggregation_t
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use multigrid_blocks, only: make_block, move_corners
  use multigrid_clock, only: memory_of, read_clock, reset_peak, start_clock
  implicit none
  private
  public :: measure_aggregation, measure_linear

contains

  !> Quadratic elements, with smoothed aggregation on the corner space.
  subroutine measure_aggregation(cells, kind, tolerance)
    integer, intent(in) :: cells  !! Cells along each edge.
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: tolerance  !! Reduction of the residual.
    type(body_t) :: body
    type(multigrid_t) :: levels
    type(body_modes_t) :: modes
    type(factorization_report_t) :: report
    type(cg_outcome_t) :: outcome
    type(error_t), allocatable :: error
    real(dp), allocatable :: x(:)
    real(dp) :: start, begun, least, greatest
    integer(int64) :: memory
    call make_block(kind, cells, cells, body)
    call move_corners(body, cells, cells, 1, spread(0.15_dp, 1, 3), .true.)
    call modes%find(body)
    write (*, '(a, i0, a, i0)') 'unknowns ', body%constraint%n_equations, ', threads ', omp_get_max_threads()
    call reset_peak()
    memory = memory_of('VmRSS:')
    levels%largest_factor = 0
    call start_clock(start, begun)
    call levels%assemble(body, error)
    if (.not. allocated(error)) call levels%analyze(body, modes, error)
    if (allocated(error)) error stop 'assembly'
    call read_clock('assembly', start, begun)
    call start_clock(start, begun)
    call levels%factorize(report, error)
    if (allocated(error)) error stop 'smoothed aggregation'
    call read_clock('smoothed aggregation', start, begun)
    call describe(levels%aggregated%levels)
    call start_clock(start, begun)
    call levels%make_smoother(error)
    call read_clock('smoother', start, begun)
    write (*, '(a, i0, a, i0)') 'bytes per unknown: rows  ', levels%fine%bytes()/levels%n, ', corner space ', &
      levels%aggregated%bytes()/levels%n
    allocate (x(body%constraint%n_equations))
    call body%constraint%reduce(body%load, x)
    call start_clock(start, begun)
    call levels%solve(x, tolerance, 200, outcome)
    call read_clock('solve', start, begun)
    call outcome%ritz_values(least, greatest)
    write (*, '(a, i0, a, f0.3, a, f0.3)') 'iterations ', outcome%steps, ', Ritz values ', least, ' to ', greatest
    write (*, '(a, f0.3, a)') 'peak memory above body   ', real(memory_of('VmHWM:') - memory, dp)*1e-9_dp, ' GB'
    call levels%destroy()
  end subroutine measure_aggregation

  !> Linear elements.
  subroutine measure_linear(cells, kind, tolerance)
    integer, intent(in) :: cells  !! Cells along each edge.
    integer, intent(in) :: kind  !! Element kind.
    real(dp), intent(in) :: tolerance  !! Reduction of the residual.
    type(body_t) :: body
    type(two_levels_t) :: rows
    type(smoothed_aggregation_t) :: levels
    type(cg_outcome_t) :: outcome
    type(error_t), allocatable :: error
    real(dp), allocatable :: b(:), x(:), vector(:, :), mode(:, :)
    real(dp) :: start, begun, least, greatest
    integer(int64) :: memory
    integer :: i, k, n
    call make_block(kind, cells, cells, body)
    call move_corners(body, cells, cells, 1, spread(0.15_dp, 1, 3), .true.)
    write (*, '(a, i0, a, i0)') 'unknowns ', body%constraint%n_equations, ', threads ', omp_get_max_threads()
    call reset_peak()
    memory = memory_of('VmRSS:')
    call start_clock(start, begun)
    call rows%assemble_rows(body, error)
    if (allocated(error)) error stop 'assembly'
    call read_clock('assembly', start, begun)
    n = size(rows%constraint%equation)
    allocate (b(n), x(n), mode(n, 0))
    call body%constraint%reduce(body%load, x)
    n = 0
    do i = 1, size(rows%constraint%equation, 2)
      do k = 1, 3
        n = n + 1
        b(n) = 0
        if (rows%constraint%equation(k, i) > 0) b(n) = x(rows%constraint%equation(k, i))
      end do
    end do
    call start_clock(start, begun)
    call near_null_vectors(body%mesh%x(:, rows%space%corner), rows%constraint, vector)
    call levels%init(rows%rows, vector, mode, error)
    if (allocated(error)) error stop 'smoothed aggregation'
    call read_clock('smoothed aggregation', start, begun)
    call describe(levels)
    call start_clock(start, begun)
    call conjugate_gradient(levels, b, x, tolerance, 200, outcome)
    call read_clock('solve', start, begun)
    call outcome%ritz_values(least, greatest)
    write (*, '(a, i0, a, f0.3, a, f0.3)') 'iterations ', outcome%steps, ', Ritz values ', least, ' to ', greatest
    write (*, '(a, f0.3, a)') 'peak memory above body   ', real(memory_of('VmHWM:') - memory, dp)*1e-9_dp, ' GB'
    call levels%destroy()
  end subroutine measure_linear

  !> Unknowns of the levels.
  subroutine describe(levels)
    type(smoothed_aggregation_t), intent(in) :: levels  !! The levels.
    integer :: l
    do l = 1, size(levels%level)
      associate (smoother => levels%level(l)%smoother)
        write (*, '(a, i0, a, i0, a, f0.1, a, f0.3)') 'level ', l, ': unknowns ', smoother%rows%dim*smoother%rows%n, &
          ', blocks in a row ', real(size(smoother%rows%column, kind=int64), dp)/smoother%rows%n, &
          ', greatest eigenvalue, with margin ', smoother%greatest
      end associate
    end do
    write (*, '(a, i0, a, f0.2, a, f0.1, a, f0.2)') 'last level: unknowns ', levels%n_last, ', Gflop ', &
      levels%last%factor%flops/1e9_dp, ', factor MB ', levels%last%factor%factor_bytes*1.0e-6_dp, &
      '; operator complexity ', levels%complexity()
  end subroutine describe
end module multigrid_aggregation
