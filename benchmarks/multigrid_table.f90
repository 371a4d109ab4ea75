!> Iterations of p-multigrid against materials and shapes: where it works.
module multigrid_table
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_mesh_element, only: element_hex20, element_hex27, element_tet10
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use multigrid_blocks, only: hold_side, make_block, move_corners, thin_layer
  implicit none
  private
  public :: write_table

  !> Reduction of the residual.
  real(dp), parameter :: tolerance = 1.0e-8_dp

contains

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
    write (*, '(a)') 'case'//repeat(' ', 37)//'unknowns  iterations  greatest  least Ritz  condition  margin'
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
end module multigrid_table
