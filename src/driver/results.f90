!> Everything that a run leaves behind, into the results file (DESIGN.md, section 5).
module dotyk_driver_results
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_driver_arguments, only: command_line_text
  use dotyk_driver_congruence_classes, only: congruence_classes_t
  use dotyk_driver_digits, only: body_digits_t
  use dotyk_driver_error_budget, only: error_budget_t
  use dotyk_driver_factorization, only: factor_size_t
  use dotyk_driver_pressures, only: pair_solution_t, nodal_field_t
  use dotyk_driver_body_solution, only: body_solution_t
  use dotyk_driver_timing, only: timing_t
  use dotyk_driver_version, only: version, compiler, build_type
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_stress, only: von_mises
  use dotyk_input_case, only: case_t
  use dotyk_linalg_blas, only: blas_name
  use dotyk_output_results_file, only: results_file_t, connectivity_length, contact_group
  use dotyk_scheme_history, only: scheme_result_t, ending_name, ended_converged
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: write_fields, write_pairs, write_summary, write_provenance, write_timing

contains

  !> Create the file; meshes, displacements, contact pressures and stresses of all bodies.
  subroutine write_fields(file, path, case, body, solution, contact_pressure, budget, error)
    type(results_file_t), intent(inout) :: file
    character(*), intent(in) :: path
    type(case_t), intent(in) :: case
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(body_solution_t), intent(in) :: solution(:)
    type(nodal_field_t), intent(in) :: contact_pressure(:)
    type(error_budget_t), intent(in) :: budget
    type(error_t), allocatable, intent(out) :: error
    integer(int64), dimension(size(body)) :: n_points, n_cells, n_connectivity
    real(dp), allocatable :: mises(:)
    integer :: b, e
    do b = 1, size(body)
      n_points(b) = body(b)%mesh%n_nodes()
      n_cells(b) = body(b)%mesh%n_elements()
      n_connectivity(b) = connectivity_length(body(b)%mesh)
    end do
    call file%create(path, n_points, n_cells, n_connectivity, case%output%displacement, case%output%stress, &
                     case%output%contact, case%output%error, error)
    if (allocated(error)) return
    do b = 1, size(body)
      call file%write_part(b, body(b)%mesh, error)
      if (.not. allocated(error) .and. case%output%displacement) &
        call file%write_displacement(b, solution(b)%displacement, error)
      if (.not. allocated(error) .and. case%output%contact) call file%write_contact_pressure(b, contact_pressure(b)%value, error)
      if (.not. allocated(error) .and. case%output%stress) then
        mises = [(von_mises(solution(b)%stress(:, e)), e=1, size(solution(b)%stress, 2))]
        call file%write_stress(b, solution(b)%stress, mises, error)
      end if
      if (.not. allocated(error) .and. case%output%error) &
        call file%write_discretization_error(b, budget%of_element(b)%value, error)
      if (allocated(error)) then
        call file%discard()
        return
      end if
    end do
  end subroutine write_fields

  !> Contact points of all pairs.
  subroutine write_pairs(file, pair, solution)
    type(results_file_t), intent(inout) :: file
    !> (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(pair_solution_t), intent(in) :: solution(:)
    character(:), allocatable :: group
    integer :: k
    do k = 1, size(pair)
      group = contact_group(pair(k)%name)
      call file%add_contact(pair(k)%name)
      call file%put_array(group, 'position', pair(k)%row_position)
      call file%put_array(group, 'normal', pair(k)%row_normal)
      call file%put_array(group, 'weight', pair(k)%row_weight)
      call file%put_array(group, 'theta', pair(k)%row_theta)
      call file%put_array(group, 'gap_initial', pair(k)%row_gap)
      call file%put_array(group, 'gap', solution(k)%gap)
      call file%put_array(group, 'pressure', solution(k)%pressure)
      call file%put_array(group, 'pressure_projected', solution(k)%projected)
      call file%put_attribute(group, 'force', solution(k)%force)
      call file%put_attribute(group, 'theta', pair(k)%theta)
      call file%put_attribute(group, 'points_without_partner', pair(k)%n_unprojected)
    end do
  end subroutine write_pairs

  !> How the scheme ended, and its history.
  subroutine write_summary(file, body, classes, size_of, problem, result, budget, digits, scheme)
    type(results_file_t), intent(inout) :: file
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(factor_size_t), intent(in) :: size_of(:)
    type(contact_problem_t), intent(in) :: problem
    type(scheme_result_t), intent(in) :: result
    type(error_budget_t), intent(in) :: budget
    !> (n_bodies).
    type(body_digits_t), intent(in) :: digits(:)
    !> Name of the scheme.
    character(*), intent(in) :: scheme
    integer :: undetermined
    call file%put_attribute('summary', 'converged', result%ended == ended_converged)
    call file%put_attribute('summary', 'status', ending_name(result%ended))
    call file%put_attribute('summary', 'scheme', scheme)
    call file%put_attribute('summary', 'iterations', result%iterations)
    call file%put_attribute('summary', 'body_solves', problem%body_solves)
    call file%put_attribute('summary', 'full_solves', problem%full_solves)
    call file%put_attribute('summary', 'gamma', result%gamma)
    call file%put_attribute('summary', 'lambda_max', result%lambda_max)
    call file%put_attribute('summary', 'q_predicted', result%q_predicted)
    call file%put_attribute('summary', 'q_measured', result%q_measured)
    call file%put_attribute('summary', 'error_bound', result%error_bound)
    call file%put_attribute('summary', 'error_bound_paper', result%error_bound_paper)
    call file%put_attribute('summary', 'error_penalty', budget%penalty)
    call file%put_attribute('summary', 'error_discretization', budget%discretization)
    call file%put_attribute('summary', 'error_contact', budget%contact)
    if (allocated(budget%of_body)) call file%put_attribute('summary', 'error_discretization_bodies', budget%of_body)
    call file%put_attribute('summary', 'energy_norm', budget%norm)
    call file%put_attribute('summary', 'energy', result%energy)
    call file%put_attribute('summary', 'max_penetration', result%max_penetration)
    call file%put_attribute('summary', 'unknowns', sum(body%constraint%n_equations))
    call file%put_attribute('summary', 'contact_points', problem%operator%n_rows)
    call file%put_attribute('summary', 'contact_points_left_out', result%left_out)
    call file%put_attribute('summary', 'free_motions', problem%coarse%n - sum(digits%n_soft))
    call file%put_attribute('summary', 'soft_motions', sum(digits%n_soft))
    call file%put_array('summary', 'condition', digits%condition)
    call file%put_array('summary', 'digits_lost', digits%lost())
    call file%put_array('summary', 'refinement_steps', digits%steps)
    undetermined = 0
    if (allocated(result%undetermined)) undetermined = size(result%undetermined, 2)
    call file%put_attribute('summary', 'undetermined_motions', undetermined)
    call file%put_attribute('summary', 'factorizations', classes%n())
    call file%put_array('summary', 'kind', classes%first)
    call file%put_attribute('summary', 'factor_entries', sum(size_of%entries))
    call file%put_attribute('summary', 'factor_bytes', sum(size_of%bytes))
    call file%put_attribute('summary', 'stiffness_bytes', sum(size_of%stiffness_bytes))
    call file%put_attribute('summary', 'flops', sum(size_of%flops))
    associate (history => result%history)
      call file%put_array('history', 'iteration', counted(history%n))
      call file%put_array('history', 'seconds', history%seconds)
      call file%put_array('history', 'increment', history%increment)
      call file%put_array('history', 'error_bound', history%error_bound)
      call file%put_array('history', 'error_penalty', history%error_penalty)
      call file%put_array('history', 'error_discretization', history%error_discretization)
      call file%put_array('history', 'energy', history%energy)
      call file%put_array('history', 'max_penetration', history%max_penetration)
      call file%put_array('history', 'active', history%active)
    end associate
  end subroutine write_summary

  !> What made the file.
  subroutine write_provenance(file, case, threads, started)
    type(results_file_t), intent(inout) :: file
    type(case_t), intent(in) :: case
    integer, intent(in) :: threads
    !> Date and time.
    character(*), intent(in) :: started
    call file%put_attribute('', 'version', version)
    call file%put_attribute('', 'command_line', command_line_text())
    call file%put_attribute('', 'compiler', compiler//' ('//build_type//')')
    call file%put_attribute('', 'blas', blas_name())
    call file%put_attribute('', 'threads', threads)
    call file%put_attribute('', 'started', started)
    call file%put_attribute('', 'input', case%text)
  end subroutine write_provenance

  !> Where the time went.
  subroutine write_timing(file, timing)
    type(results_file_t), intent(inout) :: file
    type(timing_t), intent(in) :: timing
    call file%put_attribute('timing', 'read', timing%read)
    call file%put_attribute('timing', 'assemble', timing%assemble)
    call file%put_attribute('timing', 'order', timing%order)
    call file%put_attribute('timing', 'factorize', timing%factorize)
    call file%put_attribute('timing', 'search', timing%search)
    call file%put_attribute('timing', 'iterate', timing%iterate)
    call file%put_attribute('timing', 'recover', timing%recover)
    call file%put_attribute('timing', 'estimate', timing%estimate)
    call file%put_attribute('timing', 'write', timing%write)
    call file%put_attribute('timing', 'total', timing%total)
  end subroutine write_timing

  !> 1, 2, ..., n.
  pure function counted(n) result(numbers)
    integer, intent(in) :: n
    integer :: numbers(n)
    integer :: i
    do i = 1, n
      numbers(i) = i
    end do
  end function counted
end module dotyk_driver_results
