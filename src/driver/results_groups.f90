!> Groups of the results file: contact pairs, provenance, timing, summary and history (docs/results.md). Fields are in
!> `dotyk_driver_results_fields`.
module dotyk_driver_results_groups
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: option_name, scheme_names
  use dotyk_base_version, only: build_type, compiler, version
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_balance, only: balance_t, tie_force_t
  use dotyk_control_contact_problem, only: contact_problem_t, tied_surfaces_t
  use dotyk_control_contact_solution, only: contact_solution_t, energies_t
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_pressures, only: pair_solution_t
  use dotyk_control_quantity_error, only: quantity_errors_t
  use dotyk_control_response_choice, only: form_multigrid, form_split
  use dotyk_driver_arguments, only: command_line_text
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_load_report, only: load_resultant_t
  use dotyk_input_case, only: case_t
  use dotyk_linalg_blas, only: blas_name
  use dotyk_log_timing, only: n_stages, stage_names, timing_t
  use dotyk_output_results_file, only: contact_group, results_file_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: ending_name
  implicit none
  private
  public :: write_forces, write_pairs, write_provenance, write_quantities, write_timing, write_summary

  !> Split bodies: nobody measures the condition of their stiffness or looks for congruent ones.
  integer, parameter :: not_measured = -1, not_sought = 0

contains

  !> Contact rows of all pairs.
  subroutine write_pairs(file, pair, first_row, solution, pair_solution)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    integer, intent(in) :: first_row(:)  !! Rows of pair k are first_row(k) .. first_row(k+1)-1 (n_pairs+1).
    type(contact_solution_t), intent(in) :: solution  !! The solution, with the penalty parameters.
    type(pair_solution_t), intent(in) :: pair_solution(:)  !! Results of the pairs (n_pairs).
    character(21), parameter :: half_axis(2) = ['patch_half_axis_long ', 'patch_half_axis_short']
    character(:), allocatable :: group
    integer :: i, k
    do k = 1, size(pair)
      group = contact_group(pair(k)%name)
      call file%add_group(group)
      call file%put_array(group, 'position', pair(k)%row_position)
      call file%put_array(group, 'normal', pair(k)%row_normal)
      call file%put_array(group, 'weight', pair(k)%row_weight)
      call file%put_array(group, 'theta', solution%qp%theta(first_row(k):first_row(k + 1) - 1))
      call file%put_array(group, 'gap_initial', pair(k)%row_gap)
      call file%put_array(group, 'gap_uncertainty', pair(k)%row_uncertainty())
      call file%put_array(group, 'gap', pair_solution(k)%gap)
      call file%put_array(group, 'pressure', pair_solution(k)%pressure)
      call file%put_array(group, 'pressure_projected', pair_solution(k)%projected)
      call file%put_attribute(group, 'force', pair_solution(k)%force)
      call file%put_attribute(group, 'radial_force', pair_solution(k)%radial_force)
      call file%put_attribute(group, 'moment', pair_solution(k)%moment)
      call file%put_attribute(group, 'centre_of_pressure', pair_solution(k)%centre)
      call file%put_attribute(group, 'active', pair_solution(k)%n_active)
      call file%put_attribute(group, 'contact_area', pair_solution(k)%area)
      call file%put_array(group, 'patch_area', pair_solution(k)%patch%area)
      call file%put_array(group, 'patch_force', pair_solution(k)%patch%force)
      call file%put_array(group, 'patch_centre', reshape([(pair_solution(k)%patch(i)%centre, &
                                                           i=1, size(pair_solution(k)%patch))], &
                                                         [3, size(pair_solution(k)%patch)]))
      do i = 1, 2
        call file%put_array(group, trim(half_axis(i)), pair_solution(k)%patch%half_axes(i))
      end do
      call file%put_attribute(group, 'peak_pressure', pair_solution(k)%peak)
      call file%put_attribute(group, 'peak_position', pair_solution(k)%peak_position)
      call file%put_attribute(group, 'peak_covered', pair_solution(k)%peak_covered)
      call file%put_attribute(group, 'least_gap', pair_solution(k)%least_gap)
      call file%put_attribute(group, 'gap_position', pair_solution(k)%gap_position)
      call file%put_attribute(group, 'theta', pair(k)%theta)
      call file%put_attribute(group, 'force_uncertainty', solution%gap_doubt(k)%force_change)
      call file%put_attribute(group, 'contact_area_uncertainty', solution%gap_doubt(k)%area_change)
      call file%put_attribute(group, 'displacement_uncertainty', solution%gap_doubt(k)%moved_change)
      call file%put_attribute(group, 'hertz_peak_pressure', solution%gap_doubt(k)%hertz_peak)
      call file%put_attribute(group, 'layer', pair(k)%is_layer)
      call file%put_attribute(group, 'points_not_projected', pair(k)%n_unprojected)
    end do
  end subroutine write_pairs

  !> Quantities with error bars.
  subroutine write_quantities(file, quantities)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(quantity_errors_t), intent(in) :: quantities  !! The quantities; nothing is written where there are none.
    character(:), allocatable :: names
    integer :: i
    if (.not. allocated(quantities%of)) return
    if (size(quantities%of) == 0) return
    call file%add_group('quantities')
    names = quantities%of(1)%name
    do i = 2, size(quantities%of)
      names = names//new_line('a')//quantities%of(i)%name
    end do
    call file%put_attribute('quantities', 'names', names)
    call file%put_array('quantities', 'value', quantities%of%value)
    call file%put_array('quantities', 'error', quantities%of%error)
    call file%put_array('quantities', 'estimate', quantities%of%estimate)
  end subroutine write_quantities

  !> Forces on the bodies: loads and supports one by one, and sums by bodies with strain energies; and those of ties.
  subroutine write_forces(file, problem, balance)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(contact_problem_t), intent(in) :: problem  !! Bodies, with the resultants of their loads, and ties.
    type(balance_t), intent(in) :: balance  !! Forces on them, if they are known.
    call write_body_forces(file, problem%body, balance)
    if (allocated(balance%body)) call write_motions(file, problem%body, balance)
    if (problem%n_ties() > 0 .and. allocated(balance%tie)) call write_ties(file, problem%tie, balance%tie)
  end subroutine write_forces

  !> Forces on the bodies.
  subroutine write_body_forces(file, body, balance)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(body_t), intent(in) :: body(:)  !! Bodies, with the resultants of their loads (n_bodies).
    type(balance_t), intent(in) :: balance  !! Forces on them, if they are known.
    type(load_resultant_t), allocatable :: all(:)
    integer, allocatable :: of(:)
    character(:), allocatable :: names
    integer :: b
    names = ''
    do b = 1, size(body)
      if (b > 1) names = names//new_line('a')
      names = names//body(b)%name
    end do
    call file%put_attribute('bodies', 'names', names)
    call begin(sum([(n_loads(body(b)), b=1, size(body))]))
    do b = 1, size(body)
      if (n_loads(body(b)) > 0) call take(b, body(b)%resultant)
    end do
    call write_resultants('loads')
    if (.not. allocated(balance%body)) return
    call begin(sum([(size(balance%body(b)%support), b=1, size(body))]))
    do b = 1, size(body)
      call take(b, balance%body(b)%support)
    end do
    call write_resultants('supports')
    call file%put_array('bodies', 'strain_energy', balance%body%energy)
    call file%put_array('bodies', 'spring_energy', balance%body%spring_energy)
    call write_sums('load', balance%body%load)
    call write_sums('contact', balance%body%contact)
    call write_sums('reaction', balance%body%reaction)
    call file%put_attribute('bodies', 'force_error', balance%force_error)
    call file%put_attribute('bodies', 'moment_error', balance%moment_error)

  contains

    !> Make room.
    subroutine begin(n)
      integer, intent(in) :: n  !! Number of resultants.
      if (allocated(all)) deallocate (all, of)
      allocate (all(n))
      allocate (of(n), source=0)
    end subroutine begin

    !> Take the resultants of a body.
    subroutine take(b, resultant)
      integer, intent(in) :: b  !! Index of the body.
      type(load_resultant_t), intent(in) :: resultant(:)  !! Its resultants (n).
      integer :: i, first
      first = count(of > 0)
      do i = 1, size(resultant)
        all(first + i) = resultant(i)
        of(first + i) = b
      end do
    end subroutine take

    !> Write the resultants `all` of the bodies `of`.
    subroutine write_resultants(group)
      character(*), intent(in) :: group  !! Name of their group.
      integer :: i
      names = ''
      do i = 1, size(all)
        if (i > 1) names = names//new_line('a')
        names = names//body(of(i))%name//':'//all(i)%place
      end do
      call file%put_attribute(group, 'names', names)
      call file%put_array(group, 'body', of)
      call file%put_array(group, 'force', columns([(all(i)%force, i=1, size(all))]))
      call file%put_array(group, 'moment', columns([(all(i)%moment, i=1, size(all))]))
      call file%put_array(group, 'radial_force', [(all(i)%radial, i=1, size(all))])
    end subroutine write_resultants

    !> Write one resultant of each body.
    subroutine write_sums(kind, resultant)
      character(*), intent(in) :: kind  !! What it sums up.
      type(load_resultant_t), intent(in) :: resultant(:)  !! The resultants (n_bodies).
      integer :: i
      call file%put_array('bodies', kind//'_force', columns([(resultant(i)%force, i=1, size(resultant))]))
      call file%put_array('bodies', kind//'_moment', columns([(resultant(i)%moment, i=1, size(resultant))]))
    end subroutine write_sums

    !> Vectors one after the other as columns (3, n).
    pure function columns(value)
      real(dp), intent(in) :: value(:)  !! Their components (3*n) [any].
      real(dp) :: columns(3, size(value)/3)
      columns = reshape(value, shape(columns))
    end function columns
  end subroutine write_body_forces

  !> Motions of rigid bodies; nothing where there is none.
  subroutine write_motions(file, body, balance)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(balance_t), intent(in) :: balance  !! Forces on them, and motions.
    integer, allocatable :: rigid(:)
    character(:), allocatable :: names
    real(dp), allocatable :: point(:, :), motion(:, :)
    integer :: b, i
    rigid = pack([(b, b=1, size(body))], body%constraint%rigid%is_set)
    if (size(rigid) == 0) return
    allocate (point(3, size(rigid)), motion(6, size(rigid)))
    names = ''
    do i = 1, size(rigid)
      if (i > 1) names = names//new_line('a')
      names = names//body(rigid(i))%name
      point(:, i) = body(rigid(i))%constraint%rigid%point
      motion(:, i) = balance%body(rigid(i))%motion
    end do
    call file%add_group('rigid_bodies')
    call file%put_attribute('rigid_bodies', 'names', names)
    call file%put_array('rigid_bodies', 'body', rigid)
    call file%put_array('rigid_bodies', 'point', point)
    call file%put_array('rigid_bodies', 'displacement', motion(:3, :))
    call file%put_array('rigid_bodies', 'rotation', motion(4:, :))
  end subroutine write_motions

  !> Ties and what they transmit.
  subroutine write_ties(file, tie, force)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(tied_surfaces_t), intent(in) :: tie(:)  !! Ties (n_ties).
    type(tie_force_t), intent(in) :: force(:)  !! What they transmit (n_ties).
    character(:), allocatable :: names
    integer :: k
    names = ''
    do k = 1, size(tie)
      if (k > 1) names = names//new_line('a')
      names = names//tie(k)%name
    end do
    call file%add_group('ties')
    call file%put_attribute('ties', 'names', names)
    call file%put_array('ties', 'force', reshape([(force(k)%resultant%force, k=1, size(tie))], [3, size(tie)]))
    call file%put_array('ties', 'moment', reshape([(force(k)%resultant%moment, k=1, size(tie))], [3, size(tie)]))
    call file%put_array('ties', 'radial_force', [(force(k)%resultant%radial, k=1, size(tie))])
    call file%put_array('ties', 'bolt', [(merge(1, 0, tie(k)%is_bolt), k=1, size(tie))])
    call file%put_array('ties', 'tension', [(force(k)%tension, k=1, size(tie))])
    call file%put_array('ties', 'shortening', [(force(k)%shortening, k=1, size(tie))])
    call file%put_array('ties', 'area_tied', [(tie(k)%tied, k=1, size(tie))])
    call file%put_array('ties', 'distance', [(tie(k)%distance, k=1, size(tie))])
  end subroutine write_ties

  !> Number of loads of a body.
  pure integer function n_loads(body) result(n)
    type(body_t), intent(in) :: body  !! The body.
    n = 0
    if (allocated(body%resultant)) n = size(body%resultant)
  end function n_loads

  !> Version, command line, compiler, BLAS, threads and input.
  subroutine write_provenance(file, case, threads, started)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(case_t), intent(in) :: case  !! The case, with the text of its namelist file.
    integer, intent(in) :: threads  !! Number of threads.
    character(*), intent(in) :: started  !! Date and time of the start.
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
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(timing_t), intent(in) :: timing  !! Wall times of the phases.
    integer :: k
    do k = 1, n_stages
      call file%put_attribute('timing', trim(stage_names(k)), timing%stage(k)%wall)
    end do
    call file%put_attribute('timing', 'total', timing%total%wall)
  end subroutine write_timing

  !> How the scheme ended, and its history.
  subroutine write_summary(file, case, problem, size_of, qp, n_sweeps, n_full_solves, solution)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(case_t), intent(in) :: case  !! The case, with the scheme.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(factor_size_t), intent(in) :: size_of(:)  !! Sizes of the factors (n_bodies).
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    integer, intent(in) :: n_sweeps  !! Number of solves of every body.
    integer, intent(in) :: n_full_solves  !! Number of solves with whole factors, for displacements.
    type(contact_solution_t), intent(in) :: solution  !! The solution.
    associate (state => solution%state, budget => solution%budget, conditioning => solution%conditioning)
      call file%put_attribute('summary', 'converged', state%has_converged())
      call file%put_attribute('summary', 'status', ending_name(state%ended))
      call file%put_attribute('summary', 'scheme', option_name(scheme_names, case%solver%scheme))
      call file%put_attribute('summary', 'iterations', state%iterations)
      call file%put_attribute('summary', 'body_solves', n_sweeps)
      call file%put_attribute('summary', 'full_solves', n_full_solves)
      call file%put_attribute('summary', 'gamma', state%gamma)
      call file%put_attribute('summary', 'lambda_max', state%lambda_max)
      call file%put_attribute('summary', 'q_predicted', state%q_predicted)
      call file%put_attribute('summary', 'q_measured', state%q_measured)
      call file%put_attribute('summary', 'error_bound', or_unknown(state%error_bound))
      call file%put_attribute('summary', 'error_bound_guaranteed', merge(1, 0, state%bound_is_guaranteed))
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
      call file%put_attribute('summary', 'penetration_depth', solution%penetration%deepest())
      call file%put_attribute('summary', 'unknowns', sum(problem%body%n_unknowns()))
      call file%put_attribute('summary', 'constraints', qp%n_rows)
      call file%put_attribute('summary', 'constraints_screened', state%screened)
      call file%put_attribute('summary', 'rigid_body_modes', qp%coarse%n - sum(conditioning%n_near_null))
      call file%put_attribute('summary', 'near_null_modes', sum(conditioning%n_near_null))
      ! Nobody measures the condition of a stiffness without a factor.
      call file%put_array('summary', 'condition_number', merge(ieee_value(0.0_dp, ieee_quiet_nan), &
                                                               conditioning%condition, size_of%form == form_split))
      call file%put_array('summary', 'digits_lost', merge(not_measured, conditioning%lost_digits(), &
                                                          size_of%form == form_split))
      call file%put_array('summary', 'refinement_steps', conditioning%n_steps)
      call file%put_attribute('summary', 'indeterminate_modes', state%indeterminate%n)
    end associate
    call file%put_attribute('summary', 'bodies_by_multigrid', &
                            count(size_of%form == form_multigrid .or. size_of%form == form_split))
    call file%put_attribute('summary', 'factorizations', merge(0, problem%classes%n(), any(size_of%form == form_split)))
    call file%put_array('summary', 'congruence_class', merge(not_sought, problem%classes%first, &
                                                             size_of%form == form_split))
    call file%put_attribute('summary', 'factor_nonzeros', sum(size_of%entries))
    call file%put_attribute('summary', 'factor_bytes', sum(size_of%bytes))
    ! PETSc has those of split bodies.
    if (all(size_of%form /= form_split)) &
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
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(energies_t), intent(in) :: energies  !! The terms.
    call file%put_attribute('summary', 'strain_energy', energies%strain)
    call file%put_attribute('summary', 'load_work', energies%load_work)
    call file%put_attribute('summary', 'penalty_energy', energies%penalty)
  end subroutine write_energies

  !> The numbers of Theorems 3 and 4; NaN where the scheme is not the general iteration (32).
  subroutine write_constants(file, given, gamma)
    type(results_file_t), intent(inout) :: file  !! Results file, open.
    type(iteration_constants_t), intent(in), allocatable :: given  !! Constants of the iteration, if it is (32).
    real(dp), intent(in) :: gamma  !! Its relaxation parameter [].
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

  !> 1, 2, ..., n.
  pure function numbers_to(n) result(numbers)
    integer, intent(in) :: n  !! Largest number.
    integer :: numbers(n)
    integer :: i
    do i = 1, n
      numbers(i) = i
    end do
  end function numbers_to

  !> A bound, NaN where there is none.
  real(dp) function or_unknown(bound)
    real(dp), intent(in) :: bound  !! The bound; huge where there is none [].
    or_unknown = bound
    if (.not. bound < huge(bound)/4) or_unknown = ieee_value(bound, ieee_quiet_nan)
  end function or_unknown
end module dotyk_driver_results_groups
