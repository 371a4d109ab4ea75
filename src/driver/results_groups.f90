!> Groups of the results file: contact pairs, provenance and timing (docs/results.md). Fields are in
!> `dotyk_driver_results_fields`, summary and history in `dotyk_driver_results_summary`.
module dotyk_driver_results_groups
  use dotyk_base_version, only: version, compiler, build_type
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_solution, only: contact_solution_t
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_driver_arguments, only: command_line_text
  use dotyk_input_case, only: case_t
  use dotyk_linalg_blas, only: blas_name
  use dotyk_log_timing, only: timing_t
  use dotyk_output_results_file, only: results_file_t, contact_group
  use dotyk_ranks_communication, only: n_ranks
  implicit none
  private
  public :: write_pairs, write_provenance, write_timing

contains

  !> Contact rows of all pairs.
  subroutine write_pairs(file, pair, first_row, solution, pair_solution)
    !> Results file, open.
    type(results_file_t), intent(inout) :: file
    !> Contact pairs (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    !> Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    integer, intent(in) :: first_row(:)
    !> The solution, with the penalty parameters.
    type(contact_solution_t), intent(in) :: solution
    !> Contact pressures, gaps and resultants of the pairs (n_pairs).
    type(pair_solution_t), intent(in) :: pair_solution(:)
    character(:), allocatable :: group
    integer :: k
    do k = 1, size(pair)
      group = contact_group(pair(k)%name)
      call file%add_contact(pair(k)%name)
      call file%put_array(group, 'position', pair(k)%row_position)
      call file%put_array(group, 'normal', pair(k)%row_normal)
      call file%put_array(group, 'weight', pair(k)%row_weight)
      call file%put_array(group, 'theta', solution%theta(first_row(k):first_row(k + 1) - 1))
      call file%put_array(group, 'gap_initial', pair(k)%row_gap)
      call file%put_array(group, 'gap', pair_solution(k)%gap)
      call file%put_array(group, 'pressure', pair_solution(k)%pressure)
      call file%put_array(group, 'pressure_projected', pair_solution(k)%projected)
      call file%put_attribute(group, 'force', pair_solution(k)%force)
      call file%put_attribute(group, 'radial_force', pair_solution(k)%radial_force)
      call file%put_attribute(group, 'theta', solution%theta_factor(k)*pair(k)%theta)
      call file%put_attribute(group, 'layer', pair(k)%is_layer)
      call file%put_attribute(group, 'points_not_projected', pair(k)%n_unprojected)
    end do
  end subroutine write_pairs

  !> Version, command line, compiler, BLAS, threads and input.
  subroutine write_provenance(file, case, threads, started)
    !> Results file, open.
    type(results_file_t), intent(inout) :: file
    !> The case, with the text of its namelist file.
    type(case_t), intent(in) :: case
    !> Number of threads.
    integer, intent(in) :: threads
    !> Date and time of the start.
    character(*), intent(in) :: started
    call file%put_attribute('', 'version', version)
    call file%put_attribute('', 'command_line', command_line_text())
    call file%put_attribute('', 'compiler', compiler//' ('//build_type//')')
    call file%put_attribute('', 'blas', blas_name())
    call file%put_attribute('', 'ranks', n_ranks())
    call file%put_attribute('', 'threads', threads)
    call file%put_attribute('', 'started', started)
    call file%put_attribute('', 'input', case%text)
  end subroutine write_provenance

  !> Wall times of the phases.
  subroutine write_timing(file, timing)
    !> Results file, open.
    type(results_file_t), intent(inout) :: file
    !> Wall times of the phases.
    type(timing_t), intent(in) :: timing
    call file%put_attribute('timing', 'read', timing%read%wall)
    call file%put_attribute('timing', 'assemble', timing%assemble%wall)
    call file%put_attribute('timing', 'order', timing%order%wall)
    call file%put_attribute('timing', 'factorize', timing%factorize%wall)
    call file%put_attribute('timing', 'search', timing%search%wall)
    call file%put_attribute('timing', 'iterate', timing%iterate%wall)
    call file%put_attribute('timing', 'recover', timing%recover%wall)
    call file%put_attribute('timing', 'estimate', timing%estimate%wall)
    call file%put_attribute('timing', 'check', timing%check%wall)
    call file%put_attribute('timing', 'write', timing%write%wall)
    call file%put_attribute('timing', 'total', timing%total%wall)
  end subroutine write_timing
end module dotyk_driver_results_groups
