!> Groups of the results file: fields, contact pairs, summary, provenance and timing (docs/results.md).
module dotyk_driver_results_groups
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: option_name, scheme_names
  use dotyk_base_version, only: version, compiler, build_type
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t, energies_t
  use dotyk_control_error_budget, only: error_budget_t
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_pressures, only: pair_solution_t, nodal_field_t
  use dotyk_driver_arguments, only: command_line_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_stress, only: von_mises
  use dotyk_input_case, only: case_t
  use dotyk_linalg_blas, only: blas_name
  use dotyk_log_timing, only: timing_t
  use dotyk_output_results_file, only: results_file_t, connectivity_length, contact_group
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: ending_name, ended_converged
  implicit none
  private
  public :: write_fields, write_pairs, write_summary, write_provenance, write_timing

contains

  !> Create the file; meshes, displacements, contact pressures and stresses of all bodies.
  subroutine write_fields(file, case, body, solution, contact_pressure, budget, error)
    !> Results file; open on return.
    type(results_file_t), intent(inout) :: file
    !> The case, with the fields to write.
    type(case_t), intent(in) :: case
    !> Bodies (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> Displacements and stresses of the bodies (n_bodies).
    type(body_solution_t), intent(in) :: solution(:)
    !> Contact pressures at the nodes of the bodies (n_bodies).
    type(nodal_field_t), intent(in) :: contact_pressure(:)
    !> Error budget, with the discretization errors of the elements.
    type(error_budget_t), intent(in) :: budget
    !> Allocated where the file cannot be written; it is discarded.
    type(error_t), allocatable, intent(out) :: error
    integer(int64), dimension(size(body)) :: n_points, n_cells, n_connectivity
    real(dp), allocatable :: mises(:)
    integer :: b, e
    do b = 1, size(body)
      n_points(b) = body(b)%mesh%n_nodes()
      n_cells(b) = body(b)%mesh%n_elements()
      n_connectivity(b) = connectivity_length(body(b)%mesh)
    end do
    call file%create(case%scene%output, n_points, n_cells, n_connectivity, case%output%displacement, &
                     case%output%stress, case%output%contact, case%output%error, error)
    if (allocated(error)) return
    do b = 1, size(body)
      call file%write_part(b, body(b)%mesh, error)
      if (.not. allocated(error) .and. case%output%displacement) &
        call file%write_displacement(b, solution(b)%displacement, error)
      if (.not. allocated(error) .and. case%output%contact) &
        call file%write_contact_pressure(b, contact_pressure(b)%value, error)
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
      call file%put_attribute(group, 'theta', solution%theta_factor(k)*pair(k)%theta)
      call file%put_attribute(group, 'layer', pair(k)%is_layer)
      call file%put_attribute(group, 'points_not_projected', pair(k)%n_unprojected)
    end do
  end subroutine write_pairs

  !> How the scheme ended, and its history.
  subroutine write_summary(file, case, problem, size_of, qp, n_sweeps, n_full_solves, solution)
    !> Results file, open.
    type(results_file_t), intent(inout) :: file
    !> The case, with the scheme.
    type(case_t), intent(in) :: case
    !> Bodies and contact pairs.
    type(contact_problem_t), intent(in) :: problem
    !> Sizes of the factors (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Number of solves of every body.
    integer, intent(in) :: n_sweeps
    !> Number of solves with whole factors, for displacements.
    integer, intent(in) :: n_full_solves
    !> The solution.
    type(contact_solution_t), intent(in) :: solution
    integer :: indeterminate
    associate (state => solution%state, budget => solution%budget, conditioning => solution%conditioning)
      call file%put_attribute('summary', 'converged', state%ended == ended_converged)
      call file%put_attribute('summary', 'status', ending_name(state%ended))
      call file%put_attribute('summary', 'scheme', option_name(scheme_names, case%solver%scheme))
      call file%put_attribute('summary', 'iterations', state%iterations)
      call file%put_attribute('summary', 'body_solves', n_sweeps)
      call file%put_attribute('summary', 'full_solves', n_full_solves)
      call file%put_attribute('summary', 'gamma', state%gamma)
      call file%put_attribute('summary', 'lambda_max', state%lambda_max)
      call file%put_attribute('summary', 'q_predicted', state%q_predicted)
      call file%put_attribute('summary', 'q_measured', state%q_measured)
      call file%put_attribute('summary', 'error_bound', state%error_bound)
      call file%put_attribute('summary', 'error_bound_paper', state%error_bound_paper)
      call file%put_attribute('summary', 'error_penalty', budget%penalty)
      call file%put_attribute('summary', 'error_penalty_is_bound', budget%penalty_is_bound)
      call file%put_attribute('summary', 'error_discretization', budget%discretization)
      call file%put_attribute('summary', 'error_contact', budget%contact)
      if (allocated(budget%of_body)) call file%put_attribute('summary', 'error_discretization_bodies', budget%of_body)
      call file%put_attribute('summary', 'energy_norm', budget%norm)
      call file%put_attribute('summary', 'energy', state%energy)
      call write_energies(file, solution%energies())
      call write_constants(file, state%constants, state%gamma)
      call file%put_attribute('summary', 'max_penetration', state%max_penetration)
      call file%put_attribute('summary', 'unknowns', sum(problem%body%constraint%n_equations))
      call file%put_attribute('summary', 'constraints', qp%n_rows)
      call file%put_attribute('summary', 'constraints_screened', state%screened)
      call file%put_attribute('summary', 'rigid_body_modes', qp%coarse%n - sum(conditioning%n_near_null))
      call file%put_attribute('summary', 'near_null_modes', sum(conditioning%n_near_null))
      call file%put_array('summary', 'condition_number', conditioning%condition)
      call file%put_array('summary', 'digits_lost', conditioning%lost_digits())
      call file%put_array('summary', 'refinement_steps', conditioning%n_steps)
      indeterminate = 0
      if (allocated(state%indeterminate)) indeterminate = size(state%indeterminate, 2)
      call file%put_attribute('summary', 'indeterminate_modes', indeterminate)
    end associate
    call file%put_attribute('summary', 'factorizations', problem%classes%n())
    call file%put_array('summary', 'congruence_class', problem%classes%first)
    call file%put_attribute('summary', 'factor_nonzeros', sum(size_of%entries))
    call file%put_attribute('summary', 'factor_bytes', sum(size_of%bytes))
    call file%put_attribute('summary', 'stiffness_bytes', sum(size_of%stiffness_bytes))
    call file%put_attribute('summary', 'flops', sum(size_of%flops))
    associate (history => solution%state%history)
      call file%put_array('history', 'iteration', numbers_to(history%n))
      call file%put_array('history', 'seconds', history%seconds)
      call file%put_array('history', 'increment', history%increment)
      call file%put_array('history', 'error_bound', history%error_bound)
      call file%put_array('history', 'error_bound_paper', history%error_bound_paper)
      call file%put_array('history', 'error_penalty', history%error_penalty)
      call file%put_array('history', 'error_discretization', history%error_discretization)
      call file%put_array('history', 'energy', history%energy)
      call file%put_array('history', 'max_penetration', history%max_penetration)
      call file%put_array('history', 'active', history%active)
    end associate
  end subroutine write_summary

  !> The terms of the potential energy.
  subroutine write_energies(file, energies)
    !> Results file, open.
    type(results_file_t), intent(inout) :: file
    !> The terms.
    type(energies_t), intent(in) :: energies
    call file%put_attribute('summary', 'strain_energy', energies%strain)
    call file%put_attribute('summary', 'load_work', energies%load_work)
    call file%put_attribute('summary', 'penalty_energy', energies%penalty)
  end subroutine write_energies

  !> The numbers of Theorems 3 and 4; NaN where the scheme is not the general iteration (32).
  subroutine write_constants(file, given, gamma)
    !> Results file, open.
    type(results_file_t), intent(inout) :: file
    !> Constants of the iteration, if it is (32).
    type(iteration_constants_t), intent(in), allocatable :: given
    !> Its relaxation parameter [].
    real(dp), intent(in) :: gamma
    type(iteration_constants_t) :: constants
    real(dp) :: nan
    nan = ieee_value(nan, ieee_quiet_nan)
    constants = iteration_constants_t(nan, nan, nan, nan, nan, nan)
    if (allocated(given)) constants = given
    call file%put_attribute('summary', 'coercivity', constants%coercivity)
    call file%put_attribute('summary', 'penalty_constant', constants%penalty)
    call file%put_attribute('summary', 'smoothness', constants%smoothness)
    call file%put_attribute('summary', 'gamma_limit', constants%gamma_limit())
    call file%put_attribute('summary', 'gamma_2', constants%gamma_limit_of_paper())
    call file%put_attribute('summary', 'gamma_theory', constants%gamma_of_paper())
    call file%put_attribute('summary', 'q_theory', constants%contraction_of_paper(constants%gamma_of_paper()))
    call file%put_attribute('summary', 'q_paper', constants%contraction_of_paper(gamma))
  end subroutine write_constants

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
  pure function numbers_to(n) result(numbers)
    !> Largest number.
    integer, intent(in) :: n
    integer :: numbers(n)
    integer :: i
    do i = 1, n
      numbers(i) = i
    end do
  end function numbers_to
end module dotyk_driver_results_groups
