!> Solves scenes by the engine of distributed bodies (`dotyk_distributed_contact`):
!>
!>     mpirun -n RANKS benchmark_distributed CASE.nml...
!>
!> Every rank reads the whole scene and takes its part. For each scene: contact forces and peak pressure of the pairs,
!> energy, error bound, iterations, set-ups of the aggregation, sums over ranks, and the memory of the ranks. Other
!> counts are PETSc's: `PETSC_OPTIONS=-log_view`.
program distributed
  use, intrinsic :: iso_fortran_env, only: output_unit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: text_t
  use dotyk_base_timer, only: wall_time
  use dotyk_contact_operator, only: build_operator, contact_operator_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_distributed_contact, only: distributed_contact_t
  use dotyk_distributed_part, only: part_t
  use dotyk_distributed_petsc, only: memory_of_rank, n_summed, n_sums, start_petsc, stop_petsc, sum_of_ranks
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t
  use dotyk_input_parse, only: read_case
  use dotyk_mesh_surface, only: surface_t
  use dotyk_model_body_setup, only: body_surfaces_t, build_bodies
  use dotyk_contact_pair_report, only: pair_report_t
  use dotyk_model_pairs, only: find_pairs
  use dotyk_ranks_communication, only: end_ranks, n_ranks, start_ranks, this_rank
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: ending_name, solver_state_t
  use test_partition, only: cut_bodies
  implicit none

  integer :: k, code
  type(error_t), allocatable :: error
  character(1000) :: file
  call start_ranks()
  call start_petsc(error)
  if (command_argument_count() == 0 .and. this_rank() == 0) &
    write (output_unit, '(a)') 'usage: mpirun -n RANKS benchmark_distributed CASE.nml...'
  do k = 1, command_argument_count()
    if (allocated(error)) exit
    call get_command_argument(k, file)
    call run(trim(file), error)
  end do
  if (allocated(error)) write (output_unit, '(a)') error%message
  call stop_petsc()
  code = 0
  if (allocated(error)) code = error%code
  call end_ranks(code)
  stop code, quiet=.true.

contains

  !> Solve one scene.
  subroutine run(name, error)
    character(*), intent(in) :: name  !! Its namelist.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where it cannot be solved.
    type(case_t) :: case
    type(body_t), allocatable :: body(:)
    type(body_surfaces_t), allocatable :: surfaces(:)
    type(surface_t), allocatable :: surface_a(:), surface_b(:)
    type(contact_pair_t), allocatable :: pair(:)
    type(pair_report_t) :: found
    type(contact_operator_t) :: operator
    type(part_t), allocatable :: part(:)
    type(distributed_stiffness_t), allocatable, target :: stiffness
    type(distributed_contact_t), allocatable, target :: contact
    type(solver_state_t) :: state
    type(monitor_t) :: monitor
    type(text_t), allocatable :: remarks(:)
    real(dp), allocatable :: theta(:), u(:, :)
    real(dp) :: time(4), work(4), memory(2), before(2)
    integer, allocatable :: n_nodes(:)
    integer :: b, j, sums(2), unknowns
    call read_case(name, case, error)
    if (allocated(error)) return
    call build_bodies(case, body, surfaces, remarks, error)
    if (allocated(error)) return
    call find_pairs(case, body, surfaces, surface_a, surface_b, pair, theta, found, error)
    if (allocated(error)) return
    call build_operator(case%scene%dimension, size(body), pair, surface_a, surface_b, operator)
    n_nodes = [(body(b)%mesh%n_nodes(), b=1, size(body))]
    unknowns = sum(body%constraint%n_equations)
    call cut_bodies(body, this_rank(), n_ranks(), part)
    ! What remains is a rank's own.
    deallocate (body, surfaces, surface_a, surface_b)
    allocate (stiffness, contact)
    call memory_of_rank(before(1), before(2))
    call clock(time(1), work(1))
    call stiffness%init(part, n_nodes, error)
    if (allocated(error)) return
    call clock(time(2), work(2))
    call contact%init(stiffness, operator, error)
    if (allocated(error)) return
    call clock(time(3), work(3))
    sums = [n_sums, n_summed]
    call contact%solve(theta, case%solver%tolerance, 100, monitor, state, error)
    if (allocated(error)) return
    call clock(time(4), work(4))
    call memory_of_rank(memory(1), memory(2))
    memory = [memory(1) - before(1), memory(2)]
    call sum_of_ranks(memory)
    call sum_of_ranks(work)
    do b = 1, size(stiffness%part)
      call stiffness%nodal_displacement(b, contact%u, u, error)
      if (allocated(error)) return
    end do
    if (this_rank() == 0) then
      associate (system => contact%system)
        write (output_unit, '(a,3(i0,a))') name//': ', n_ranks(), ' ranks, ', unknowns, ' unknowns, ', &
          operator%n_rows, ' rows'
        write (output_unit, '(a,es9.2,a,es21.13,a,es9.2)') '  '//ending_name(state%ended)//', error bound', &
          state%error_bound, ', energy ', state%energy, ', penetration', state%max_penetration
        do j = 1, size(pair)
          associate (first => operator%pair_first_row(j), last => operator%pair_first_row(j + 1) - 1)
            write (output_unit, '(a,i0,a,i0,a,es21.13,a,es21.13)') '  pair ', j, ': active ', &
              count(state%m(first:last) > 0), ', sum of forces', sum(state%m(first:last)*operator%weight(first:last)), &
              ', peak', maxval([0.0_dp, state%m(first:last)])
          end associate
        end do
        write (output_unit, '(5(a,i0),a,f6.3)') '  active sets ', contact%n_sets, ', iterations ', &
          system%n_iterations, ', set-ups ', system%n_setups, ', sums over ranks ', n_sums - sums(1), ' of numbers ', &
          n_summed - sums(2), ', least Ritz value', system%least
        write (output_unit, '(a,3f8.2,a,3f8.2)') '  assembly, contact, solution: wall [s]', time(2:4) - time(1:3), &
          ', processor time of all ranks [s]', work(2:4) - work(1:3)
        write (output_unit, '(a,2f8.3)') '  sum of ranks [GiB]: solution now, process at most', memory/2.0_dp**30
      end associate
    end if
    call contact%destroy()
    call stiffness%destroy()
  end subroutine run

  !> Times.
  subroutine clock(wall, processor)
    real(dp), intent(out) :: wall, processor  !! [s]
    wall = wall_time()
    call cpu_time(processor)
  end subroutine clock
end program distributed
