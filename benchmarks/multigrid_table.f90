!> Iterations of p-multigrid against materials and shapes: where it works, and what `response='auto'` makes of it.
module multigrid_table
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_response_choice, only: suits_multigrid
  use dotyk_control_slow_multigrid, only: factor_is_better
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_elasticity_two_levels, only: multigrid_obstacle, obstacle_none
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_mesh_element, only: element_hex20, element_hex27, element_prism15, element_prism18, element_tet10
  use dotyk_response_direct, only: direct_response_t
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_multigrid_response, only: multigrid_response_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use multigrid_cases, only: make_case, n_cases
  implicit none
  private
  public :: write_table

  real(dp), parameter :: tolerance = 1.0e-8_dp  !! Reduction of the residual.
  integer, parameter :: most_steps = 300  !! Iterations at most.
  real(dp), parameter :: usual_size = 200000  !! Size of the body that the choice is made for.
  !> Element kinds.
  integer, parameter :: kind(5) = [element_tet10, element_hex20, element_hex27, element_prism15, element_prism18]
  character(7), parameter :: kind_name(5) = ['tet10  ', 'hex20  ', 'hex27  ', 'prism15', 'prism18']  !! Their names.

contains

  !> Write a line for each case and element kind, then the table of the iterations.
  subroutine write_table(cells, first, last)
    integer, intent(in) :: cells  !! Cells along each edge of a cube.
    integer, intent(in) :: first, last  !! First and last case; 0 for all.
    character(:), allocatable :: name
    character(200) :: row(n_cases)
    character(16) :: entry
    type(body_t) :: body
    real(dp) :: flops(20)
    integer :: i, k, shape
    row = ''
    write (*, '(a)') 'elements, case'//repeat(' ', 48)//'unknowns   its  greatest     least  in trial  residual'// &
      '  margin expect    cycle    factor  ratio  choice'
    do k = 1, size(kind)
      flops = 0
      do i = merge(first, 1, first > 0), merge(last, n_cases, first > 0)
        call make_case(i, kind(k), cells, body, name, shape)
        if (k == 1) row(i) = '| '//name
        if (allocated(body%mesh%block)) then
          call measure(kind_name(k)//' '//name, body, merge(2, 1, shape == 1), flops(shape), entry)
        else
          entry = ''
        end if
        row(i) = trim(row(i))//' | '//entry
      end do
    end do
    write (*, '(/, a)') '| body | tet10 | hex20 | hex27 | prism15 | prism18 |', '|---|---:|---:|---:|---:|---:|'
    do i = 1, n_cases
      if (row(i) /= '') write (*, '(a)') trim(row(i))//' |'
    end do
  end subroutine write_table

  !> Solve, and write a line.
  subroutine measure(name, body, power, flops, entry)
    character(*), intent(in) :: name  !! Element kind and name of the case.
    type(body_t), intent(inout) :: body  !! The body.
    integer, intent(in) :: power  !! Its factor takes the unknowns to this power operations.
    real(dp), intent(inout) :: flops  !! Operations of a factor of the body; found if 0.
    character(*), intent(out) :: entry  !! Entry of the table: iterations, and what has a factor in their place.
    type(multigrid_response_t) :: operator
    type(body_modes_t) :: modes
    type(factorization_report_t) :: report
    type(cg_outcome_t) :: outcome
    type(error_t), allocatable :: error
    real(dp), allocatable :: x(:)
    real(dp) :: least, greatest, trial_least, corner_flops, scale, work, begun, ended
    character(62) :: label
    character(12) :: choice
    label = name
    call modes%find(body)
    call operator%assemble(body, error)
    if (.not. allocated(error)) call body%assemble_loads(error)
    if (.not. allocated(error)) call operator%analyze(body, modes, error)
    if (.not. allocated(error)) call operator%factorize(body, report, error)
    if (.not. allocated(error)) call operator%prepare(error)
    if (allocated(error)) then
      write (*, '(a)') label//' '//error%message
      entry = 'error'
      return
    end if
    if (.not. flops > 0) flops = factor_flops(body, modes)
    trial_least = operator%grid%least
    corner_flops = operator%grid%coarse%factor%flops
    choice = 'multigrid'
    ! Blocks grow in three directions, plates and beams along one or two.
    scale = usual_size/operator%grid%n
    work = corner_flops*(real(operator%grid%n, dp)/operator%grid%interpolation%n)**2*scale**power
    if (factor_is_better(operator%expected_steps(), 1, usual_size, work)) choice = 'cheaper'
    if (factor_is_better(operator%expected_steps(), 1, usual_size, 0.0_dp)) choice = 'trial'
    if (.not. suits_multigrid(body)) choice = 'material'
    if (multigrid_obstacle(body) /= obstacle_none) choice = 'obstacle'
    x = body%rhs
    call cpu_time(begun)
    call operator%grid%solve(x, tolerance, most_steps, outcome)
    call cpu_time(ended)
    call outcome%ritz_values(least, greatest)
    write (entry, '(i0)') outcome%steps
    if (.not. outcome%converged) write (entry, '(a, i0)') '> ', most_steps
    if (choice /= 'multigrid') entry = trim(entry)//' '//choice(:1)
    write (*, '(a, i9, i6, a, f8.3, f10.5, f10.5, es10.1, f8.3, f7.1, f9.3, f10.1, f7.1, a)') &
      label, size(x), outcome%steps, &
      merge('  ', ' !', outcome%converged), operator%grid%fine%greatest, least, trial_least, operator%trial, &
      margin_of(operator%grid), operator%expected_steps(), 1.0e6_dp*(ended - begun)/outcome%steps/size(x), &
      flops*1.0e-9_dp, flops/corner_flops, '  '//choice
    call operator%destroy()
  end subroutine measure

  !> Operations of the factor of a body.
  real(dp) function factor_flops(body, modes) result(flops)
    type(body_t), intent(inout) :: body  !! The body.
    type(body_modes_t), intent(in) :: modes  !! Its rigid body modes.
    type(direct_response_t) :: direct
    type(stiffness_t) :: stiffness
    type(error_t), allocatable :: error
    call body%assemble(stiffness, error)
    if (.not. allocated(error)) call direct%analyze(body, modes, stiffness, error)
    if (allocated(error)) error stop 'analysis'
    flops = direct%factor%flops
    call direct%destroy()
    call stiffness%destroy()
  end function factor_flops

  !> Upper end of the smoother's interval over the greatest eigenvalue, by 40 Lanczos steps [].
  real(dp) function margin_of(levels) result(margin)
    type(multigrid_t), intent(in) :: levels  !! The levels.
    type(cg_outcome_t) :: outcome
    real(dp), allocatable :: start(:), x(:)
    real(dp) :: least, greatest
    integer :: i
    allocate (start(levels%n), x(levels%n))
    start(:) = [(sin(12.9898_dp*i + 0.37_dp*i*i), i=1, levels%n)]
    call conjugate_gradient(levels%fine, start, x, 0.0_dp, 40, outcome)
    call outcome%ritz_values(least, greatest)
    margin = levels%fine%greatest/greatest
  end function margin_of
end module multigrid_table
