!> The results of a run: contact pressures by pairs, and the results file.
module dotyk_driver_results
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: print_error
  use dotyk_base_memory, only: set_stage
  use dotyk_base_options, only: field_nodal_stress, field_reaction
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_control_balance, only: balance_t, find_balance
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_nodal_stresses, only: nodal_stress_t, recover_nodal_stresses
  use dotyk_control_pressures, only: contact_fields_t, nodal_field_t, pair_solution_t, project_pressures
  use dotyk_driver_results_fields, only: write_fields
  use dotyk_driver_results_groups, only: write_forces, write_pairs, write_provenance, write_quantities, write_summary, &
    write_timing
  use dotyk_driver_scene, only: scene_t
  use dotyk_input_case, only: case_t
  use dotyk_log_result_tables, only: show_balance, show_greatest_values, show_pair_results, show_quantities
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_log_timing, only: stage_recover, stage_write
  use dotyk_output_results_file, only: results_file_t
  use dotyk_ranks_communication, only: this_rank
  use dotyk_scheme_solver_state, only: ended_time, solver_state_t
  implicit none
  private
  public :: finish_results, write_results, write_on_the_way

  !> Cause and remedy.
  character(*), parameter :: reason = ' not finite: overflow, input values of incompatible magnitude; check their units'

contains

  !> Contact pressures by pairs, and the results of a load case; with the last one the file is complete.
  subroutine write_results(case, step, scene, solution, monitor, file, pair_solution, error)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: step  !! The load case.
    type(scene_t), intent(inout) :: scene  !! The scene, factorized; what it keeps for nodal stresses changes.
    type(contact_solution_t), intent(inout) :: solution  !! The solution; nodal stresses take its recovered strains.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(results_file_t), intent(inout) :: file  !! The results file: created with the first load case.
    type(pair_solution_t), allocatable, intent(out) :: pair_solution(:)  !! Results of the pairs (n_pairs).
    !> Allocated where results are not finite, or the file cannot be written; it is discarded.
    type(error_t), allocatable, intent(out) :: error
    type(nodal_field_t), allocatable :: contact_pressure(:)
    type(contact_fields_t), allocatable :: contact(:)
    type(balance_t) :: balance
    type(nodal_stress_t), allocatable :: nodal_stress(:)
    integer :: b
    logical, allocatable :: forgotten(:)
    logical :: is_known
    associate (problem => scene%problem, qp => solution%qp, displacements => solution%displacements%body)
      call set_stage('projecting contact pressures')
      call project_pressures(problem, qp%pair_first_row, solution%state%pressure, &
                             qp%of_vertices(solution%state%penetration), &
                             pair_solution, contact_pressure, error, contact)
      if (allocated(error)) return
      call refuse_overflow(case, problem, displacements, pair_solution, solution%state, error)
      if (allocated(error)) return
      is_known = all([(allocated(displacements(b)%displacement), b=1, size(displacements))])
      if (is_known) &
        call find_balance(problem, qp, solution%state%pressure, solution%state%penetration, displacements, &
                          case%output%field(field_reaction), balance, error)
      if (allocated(error)) return
      if (allocated(balance%body)) then
        allocate (forgotten(size(problem%pair)))
        do b = 1, size(problem%pair)
          associate (pair => problem%pair(b))
            forgotten(b) = pair_solution(b)%is_rounding(pair, max(balance%body(pair%body_a)%force_scale, &
                                                                  balance%body(pair%body_b)%force_scale))
          end associate
        end do
        if (any(forgotten)) &
          call project_pressures(problem, qp%pair_first_row, solution%state%pressure, &
                                 qp%of_vertices(solution%state%penetration), &
                                 pair_solution, contact_pressure, error, contact, forgotten)
        if (allocated(error)) return
      end if
      allocate (nodal_stress(size(problem%body)))
      if (case%output%field(field_nodal_stress) .and. is_known) then
        call set_stage('recovering stresses at nodes')
        call recover_nodal_stresses(problem, solution%displacements, scene%kept, nodal_stress, error)
        if (allocated(error)) return
      end if
      if (solution%state%ended /= ended_time) then
        call show_greatest_values(monitor%log, problem, displacements, nodal_stress)
        call show_pair_results(monitor%log, problem%pair, pair_solution)
        call show_quantities(monitor%log, solution%quantities)
        call show_balance(monitor%log, problem, balance)
      end if
      call monitor%lap(stage_recover)
      monitor%timing%total = monitor%watch%since_start()
      call set_stage('writing results')
      call write_fields(file, case, step, problem%body, problem%ranks, displacements, nodal_stress, contact_pressure, &
                        contact, balance, solution%budget, solution%penetration, error)
      if (allocated(error) .or. this_rank() > 0) return
      call write_pairs(file, problem%pair, qp%pair_first_row, solution, pair_solution)
      call write_quantities(file, solution%quantities)
      call write_forces(file, problem, balance)
      call write_summary(file, case, problem, scene%size_of, qp, scene%compliance%n_sweeps, &
                         full_solves(scene, solution), solution)
      call monitor%lap(stage_write)
    end associate
  end subroutine write_results

  !> Finish the results file.
  subroutine finish_results(case, n_written, threads, monitor, file, error)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: n_written  !! Load cases that were written.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    type(results_file_t), intent(inout) :: file  !! The results file, with all results; complete on return.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    character(:), allocatable :: names
    integer :: k
    if (this_rank() > 0) return
    if (case%has_cases()) then
      names = case%load_case(1)%name
      do k = 2, n_written
        names = names//new_line('a')//case%load_case(k)%name
      end do
      call file%end_cases(names, n_written, case%n_cases())
    end if
    call write_provenance(file, case, threads, monitor%watch%date)
    call monitor%lap(stage_write)
    monitor%timing%total = monitor%watch%since_start()
    call write_timing(file, monitor%timing)
    call file%commit(error)
  end subroutine finish_results

  !> Write the results of a run that continues. A failure is no reason to end it.
  subroutine write_on_the_way(case, scene, solution, threads, monitor, has_warned)
    type(case_t), intent(in) :: case  !! The case.
    type(scene_t), intent(inout) :: scene  !! As in `write_results`.
    type(contact_solution_t), intent(inout) :: solution  !! Solution so far.
    integer, intent(in) :: threads  !! Number of threads.
    type(log_monitor_t), intent(inout) :: monitor  !! Log and watch.
    logical, intent(inout) :: has_warned  !! Whether a failure has been reported, which happens once.
    type(error_t), allocatable :: error
    type(results_file_t) :: file
    type(pair_solution_t), allocatable :: pair_solution(:)
    call write_results(case, 1, scene, solution, monitor, file, pair_solution, error)
    if (.not. allocated(error)) call finish_results(case, 1, threads, monitor, file, error)
    if (this_rank() > 0) return
    if (.not. allocated(error)) then
      call monitor%log%line('  written          '//case%scene%output//' after '// &
                            counted(solution%state%iterations, 'iteration'))
    else if (.not. has_warned) then
      call print_error('warning: '//error%message//'; the run continues')
      has_warned = .true.
    end if
  end subroutine write_on_the_way

  !> Solves with whole factors: without contact, and one for each body in each recovery of displacements.
  pure integer function full_solves(scene, solution) result(n)
    type(scene_t), intent(in) :: scene  !! The scene, factorized.
    type(contact_solution_t), intent(in) :: solution  !! The solution.
    integer :: b
    n = count([(.not. allocated(scene%problem%isolated(b)%displacement), b=1, size(scene%problem%isolated))])
    n = scene%n_full_solves + n*solution%displacements%n_recoveries
  end function full_solves

  !> Refuse a solution whose displacements, stresses, pressures or energy overflowed.
  subroutine refuse_overflow(case, problem, solution, pair_solution, state, error)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies, their ranks, contact pairs.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements and stresses of the bodies (n_bodies).
    type(pair_solution_t), intent(in) :: pair_solution(:)  !! Results of the pairs (n_pairs).
    type(solver_state_t), intent(in) :: state  !! State of the scheme, with the energy.
    !> Allocated where a value is not finite; names the first body or pair; exit code `exit_not_solvable`.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: what
    ! 1 where a number is not finite.
    real(dp), dimension(size(solution)) :: moved, stressed
    integer :: b, k
    moved = 0
    stressed = 0
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      if (allocated(solution(b)%displacement)) moved(b) = not_finite(solution(b)%displacement)
      if (allocated(solution(b)%stress)) stressed(b) = not_finite(solution(b)%stress)
    end do
    call problem%ranks%share_greatest(moved)
    call problem%ranks%share_greatest(stressed)
    do b = 1, size(solution)
      if (.not. (moved(b) > 0 .or. stressed(b) > 0)) cycle
      what = 'stresses'
      if (moved(b) > 0) what = 'displacements'
      call set_error(error, case%file//':'//to_text(case%body(b)%line)//': body '//quoted(problem%body(b)%name)// &
                     ': the '//what//' are'//reason, exit_not_solvable)
      return
    end do
    do k = 1, size(pair_solution)
      associate (found => pair_solution(k))
        if (all(ieee_is_finite(found%pressure)) .and. all(ieee_is_finite(found%projected)) .and. &
            all(ieee_is_finite(found%gap)) .and. all(ieee_is_finite(found%force))) cycle
      end associate
      call set_error(error, case%file//':'//to_text(case%contact(k)%line)//': &contact '// &
                     quoted(problem%pair(k)%name)//': the pressures are'//reason, exit_not_solvable)
      return
    end do
    if (.not. ieee_is_finite(state%energy)) &
      call set_error(error, case%file//': the energy is'//reason, exit_not_solvable)
  end subroutine refuse_overflow

  !> 1 where a number is not finite, 0 where all are.
  pure real(dp) function not_finite(value)
    real(dp), intent(in) :: value(:, :)  !! Numbers (any, any).
    not_finite = merge(0.0_dp, 1.0_dp, all(ieee_is_finite(value)))
  end function not_finite
end module dotyk_driver_results
