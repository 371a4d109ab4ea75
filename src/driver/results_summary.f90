!> Summary and history of the results file (docs/results.md).
module dotyk_driver_results_summary
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: option_name, scheme_names
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t, energies_t
  use dotyk_control_factorization, only: factor_size_t
  use dotyk_control_response_choice, only: form_multigrid, form_split
  use dotyk_input_case, only: case_t
  use dotyk_output_results_file, only: results_file_t
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_solver_state, only: ending_name
  implicit none
  private
  public :: write_summary

  !> Split bodies: nobody measures the condition of their stiffness or looks for congruent ones.
  integer, parameter :: not_measured = -1, not_sought = 0

contains

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
end module dotyk_driver_results_summary
