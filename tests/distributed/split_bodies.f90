!> Bodies that are split over ranks against exact answers, under mpirun: uniform pressures of stacks of blocks, held and
!> floating, and the pressures of the dual scheme with factors where surfaces are curved.
program split_bodies
  use, intrinsic :: iso_fortran_env, only: output_unit
  use test_multigrid_scene, only: floating, loose, multigrid_scene_t, pressed, scene_settings_t
  use test_partition, only: cut_bodies
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_distributed_assembly, only: check_entries, check_unknowns
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_petsc, only: largest_of_ranks, start_petsc, stop_petsc
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_distributed_system, only: distributed_system_t
  use dotyk_mesh_element, only: element_hex20, element_hex8, element_quad8, element_tet10
  use dotyk_ranks_communication, only: end_ranks, gather_reals, n_ranks, start_ranks, this_rank
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_primal, only: solve_by_displacements
  use dotyk_scheme_proximal_active_set, only: proximal_outcome_t
  use dotyk_scheme_solver_state, only: ended_converged, solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none

  !> Tolerance of the schemes, and of pressures relative to the largest one [].
  real(dp), parameter :: tolerance = 1.0e-8_dp, accuracy = 1.0e-6_dp
  real(dp), parameter :: press = 0.2_dp, modulus = 2  !! Pressure on the top, and E of the blocks [pressure].
  integer :: n_failed, code
  type(error_t), allocatable :: error
  n_failed = 0
  call start_ranks()
  call start_petsc(error)
  if (allocated(error)) error stop 'PETSc does not start'
  call test_uniform('uniform pressure, tet10', [element_tet10, element_tet10], [3, 2], floating, 0.0_dp)
  call test_uniform('uniform pressure, three hex20, free', [element_hex20, element_hex20, element_hex20], [2, 2, 2], &
                    loose, 0.0_dp)
  call test_uniform('uniform pressure, hex8, with theta', [element_hex8, element_hex8], [3, 4], floating, 1.0e-3_dp)
  call test_curved('curved, tet10', [element_tet10, element_tet10], [4, 3], pressed, 0.0_dp)
  call test_curved('curved, tet10, floating, with theta', [element_tet10, element_tet10], [4, 3], floating, 1.0e-4_dp)
  call test_curved('curved, hex20 on tet10, floating', [element_hex20, element_tet10], [2, 3], floating, 0.0_dp)
  call test_curved('curved, quad8', [element_quad8, element_quad8], [6, 5], pressed, 0.0_dp)
  call test_limits()
  call stop_petsc()
  code = min(1, n_failed)
  call end_ranks(code)
  stop code, quiet=.true.

contains

  !> Blocks without lateral strain under uniform pressure.
  subroutine test_uniform(name, kinds, cells, holding, theta)
    character(*), intent(in) :: name  !! Of the test.
    !> Element kinds and cells, from the highest block to the lowest (n_bodies).
    integer, intent(in) :: kinds(:), cells(:)
    integer, intent(in) :: holding  !! How the blocks are held.
    real(dp), intent(in) :: theta  !! Penalty parameter [length/pressure].
    type(scene_settings_t) :: settings
    type(solver_state_t) :: state
    real(dp) :: in_displacement
    settings%kinds = kinds
    settings%cells = cells
    settings%holding = holding
    settings%poisson = 0
    settings%press = press
    settings%gap = '0'
    settings%by_contact = .true.
    call solve(settings, theta, .false., state, in_displacement)
    call check(name, state, maxval(abs(state%pressure - press))/press, in_displacement)
  end subroutine test_uniform

  !> A curved gap: the pressures of the dual scheme.
  subroutine test_curved(name, kinds, cells, holding, theta)
    character(*), intent(in) :: name  !! Of the test.
    integer, intent(in) :: kinds(:), cells(:), holding  !! As in `test_uniform`.
    real(dp), intent(in) :: theta  !! As in `test_uniform`.
    type(scene_settings_t) :: settings
    type(solver_state_t) :: state
    real(dp) :: difference
    settings%kinds = kinds
    settings%cells = cells
    settings%holding = holding
    settings%press = press
    settings%by_contact = .true.
    call solve(settings, theta, .true., state, difference)
    call check(name, state, difference, 0.0_dp)
  end subroutine test_curved

  !> Solve a scene.
  subroutine solve(settings, theta, is_curved, state, difference)
    type(scene_settings_t), intent(in) :: settings  !! What it is made of.
    real(dp), intent(in) :: theta  !! Penalty parameter [length/pressure].
    logical, intent(in) :: is_curved  !! Whether the dual scheme has the solution, not the uniform state.
    type(solver_state_t), intent(out) :: state  !! Pressures, energy and bound.
    !> Relative difference from the dual scheme's pressures and energy; else of the vertical displacements from the
    !> exact ones of the lowest block [].
    real(dp), intent(out) :: difference
    type(multigrid_scene_t) :: scene
    type(contact_operator_t) :: operator
    type(part_t), allocatable :: part(:)
    type(distributed_stiffness_t), target, allocatable :: stiffness
    type(distributed_system_t), target, allocatable :: system
    type(contact_qp_t) :: qp
    type(proximal_outcome_t) :: total
    type(solver_state_t) :: exact
    type(solver_settings_t) :: of_solver
    type(dual_t) :: dual
    type(monitor_t) :: monitor
    type(error_t), allocatable :: error
    real(dp), allocatable :: found(:), u(:, :)
    real(dp) :: most(1)
    integer :: b, last
    call scene%init(settings)
    operator%n_rows = scene%qp%n_rows
    operator%dimension = scene%qp%dimension
    operator%weight = scene%qp%weight
    operator%gap = scene%qp%gap
    operator%block = scene%qp%block
    qp = scene%qp
    call qp%replace_theta(spread(theta, 1, qp%n_rows))
    of_solver%tolerance = tolerance
    allocate (stiffness, system)
    associate (body => scene%problem%body)
      last = size(body)
      call cut_bodies(body, this_rank(), n_ranks(), part)
      call stiffness%init(part, [(body(b)%mesh%n_nodes(), b=1, last)], error)
      if (.not. allocated(error)) call system%init(stiffness, operator, error)
      if (.not. allocated(error)) call solve_by_displacements(system, qp, tolerance, of_solver, &
        spread(.false., 1, qp%n_rows), monitor, found, total, state, error)
      if (.not. allocated(error)) call stiffness%nodal_displacement(last, found, u, error)
      if (allocated(error)) error stop 'distributed bodies'
      if (is_curved) then
        call dual%solve(qp, scene%compliance, of_solver, monitor, exact, error)
        if (allocated(error)) error stop 'dual scheme'
        difference = max(maxval(abs(state%pressure - exact%pressure))/maxval(exact%pressure), &
                         abs(state%energy/exact%energy - 1))
      else
        most = 0
        associate (x => stiffness%part(last)%mesh%x, d => operator%dimension)
          if (size(x) > 0) most = maxval(abs(u(d, :) + press/modulus*x(d, :)))/(press/modulus)
        end associate
        call largest_of_ranks(most)
        difference = most(1)
      end if
    end associate
    call system%destroy()
    call stiffness%destroy()
    call scene%destroy()
  end subroutine solve

  !> Sizes beyond 32-bit indices are errors on all ranks, and long messages go in pieces.
  subroutine test_limits()
    integer(int64), parameter :: below = huge(1), beyond = below + 1
    integer(int64) :: n(n_ranks())
    real(dp), allocatable :: own(:), whole(:), pieces(:)
    type(error_t), allocatable :: of_unknowns, of_entries, none, nor_here
    logical :: is_good
    integer :: r, i
    call check_unknowns(below, none)
    call check_unknowns(beyond, of_unknowns)
    call check_entries(below, nor_here)
    ! On the last rank alone.
    call check_entries(merge(beyond, 1_int64, this_rank() == n_ranks() - 1), of_entries)
    is_good = allocated(of_unknowns) .and. allocated(of_entries) .and. .not. (allocated(none) .or. allocated(nor_here))
    if (is_good) is_good = index(of_unknowns%message, '32-bit') > 0 .and. index(of_entries%message, '2147483648') > 0
    n = [(3*int(r, int64) + 2, r=1, n_ranks())]
    own = [(real(10*this_rank() + i, dp), i=1, int(n(this_rank() + 1)))]
    allocate (whole(sum(n)), pieces(sum(n)))
    call gather_reals(own, n, whole)
    call gather_reals(own, n, pieces, 3_int64)
    is_good = is_good .and. all(abs(whole - pieces) <= 0) .and. nint(whole(1)) == 1
    if (.not. is_good) n_failed = n_failed + 1
    if (this_rank() == 0) write (output_unit, '(a)') &
      merge('passed', 'FAILED', is_good)//'  limits of indices and messages'
  end subroutine test_limits

  !> Note a result.
  subroutine check(name, state, of_pressure, of_displacement)
    character(*), intent(in) :: name  !! Of the test.
    type(solver_state_t), intent(in) :: state  !! With the bound.
    real(dp), intent(in) :: of_pressure, of_displacement  !! Relative differences [].
    logical :: is_good
    is_good = of_pressure <= accuracy .and. of_displacement <= accuracy .and. state%ended == ended_converged
    if (.not. is_good) n_failed = n_failed + 1
    if (this_rank() == 0) write (output_unit, '(a,i3,3es9.1,2x,a)') merge('passed', 'FAILED', is_good), &
      state%ended, state%error_bound, of_pressure, of_displacement, name
  end subroutine check
end program split_bodies
