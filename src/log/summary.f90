!> The end of the log: how the scheme ended, the error budget, conditioning, times.
module dotyk_log_summary
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: stop_increment, stop_paper
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_base_thresholds, only: notable, rounding
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: contact_solution_t, energies_t, solution_goal_t
  use dotyk_control_error_budget, only: error_budget_t
  use dotyk_control_gap_doubt, only: gap_doubt_t, is_narrow
  use dotyk_control_refinement, only: conditioning_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: output_input_t
  use dotyk_log_found_pairs, only: show_idle_bodies
  use dotyk_log_timing, only: duration
  use dotyk_scheme_relaxation, only: factor_text
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_limit, ended_diverged, ended_cycling, &
    ended_gaps, ended_interrupted, ended_penetration, ended_rotated, ended_solves, ended_unbalanced, ended_unverified
  implicit none
  private
  public :: show_errors, show_outcome

  integer, parameter :: most_digits = 10, least_digits = 3  !! Digits of the potential energy.

contains

  !> The errors, what was not computed, and the conditioning of the bodies.
  subroutine show_errors(log, output, goal, problem, solution)
    type(log_t), intent(inout) :: log  !! The log.
    type(output_input_t), intent(in) :: output  !! `&output`.
    type(solution_goal_t), intent(in) :: goal  !! What was asked for.
    type(contact_problem_t), intent(in) :: problem  !! The problem.
    type(contact_solution_t), intent(in) :: solution  !! Solution with errors and conditioning.
    call show_budget(log, output, problem%body, solution%state, solution%budget)
    if (size(solution%state%pressure) > 0) &
      call show_energies(log, solution%state, solution%energies(), any(problem%pair%is_layer))
    call show_gap_doubt(log, problem%pair, solution%gap_doubt)
    call show_idle_bodies(log, problem, solution%state%pressure, solution%qp%pair_first_row)
    call show_not_computed(log, goal, solution%state)
    call show_conditioning(log, problem%body, problem%classes, solution%conditioning)
  end subroutine show_errors

  !> How the scheme ended.
  subroutine show_outcome(log, state, tolerance, n_sweeps, seconds)
    type(log_t), intent(inout) :: log  !! The log.
    type(solver_state_t), intent(in) :: state  !! State of the scheme.
    real(dp), intent(in) :: tolerance  !! Tolerance of the error bound [].
    integer, intent(in) :: n_sweeps  !! Right-hand sides of the body that had most.
    real(dp), intent(in) :: seconds  !! Time of the scheme [s].
    character(:), allocatable :: predicted, bound
    call log%line('')
    if (size(state%pressure) == 0) then
      call log%line('  solved           no contact, '//duration(seconds))
      call log%detail('  potential energy '//to_text(state%energy, 10))
      return
    end if
    call log%line('  '//outcome(state)//' after '//counted(state%iterations, 'iteration')//' (at most '// &
                  counted(n_sweeps, 'right-hand side')//' per body), '//duration(seconds))
    if (state%error_bound < huge(tolerance)) then
      bound = to_text(state%error_bound, 3)//' of the energy norm of the solution, '
      if (state%bound_is_guaranteed) then
        bound = bound//'guaranteed'
      else
        bound = bound//'by the least Ritz value of p-multigrid'
      end if
    else
      bound = 'unknown'
    end if
    select case (state%stop_rule)
    case (stop_increment, stop_paper)
      ! The tolerance is not one of the bound.
      call log%line('  stop_rule        '//rule_in_force(state, tolerance))
      call log%line('  error bound      '//bound)
      if (state%ended == ended_unverified) &
        call log%line("  unverified       the error bound does not confirm this iterate; use stop_rule='residual' "// &
                      'or a smaller tolerance')
    case default
      call log%line('  error bound      '//bound//' (tolerance '//to_text(tolerance)//')')
      if (state%ended == ended_converged .and. state%error_bound > tolerance) &
        call log%line('  rounding         the error bound exceeds the tolerance by rounding of the displacements: '// &
                      'double precision has no better solution')
    end select
    if (.not. ieee_is_nan(state%error_bound_paper)) &
      call log%line('  bound (41)       '//to_text(state%error_bound_paper, 3)//' (Theorem 4, from the last increment)')
    predicted = ''
    if (.not. ieee_is_nan(state%q_predicted)) predicted = ', at most '//factor_text(state%q_predicted)//' predicted'
    if (.not. ieee_is_nan(state%q_measured)) &
      call log%line('  convergence      factor '//factor_text(state%q_measured)//' per iteration measured'//predicted)
    if (state%ended == ended_diverged .and. allocated(state%constants)) &
      call log%line('  diverged         gamma = '//to_text(state%gamma)//' exceeds the stability limit '// &
                    to_text(state%constants%gamma_limit())//"; use gamma_rule='spectral' or a smaller gamma")
    call log%detail('  max penetration  '//to_text(state%max_penetration, 4))
  end subroutine show_outcome

  !> Digits of the potential energy that hold, and one. It is a minimum, so that its error is half the square of that of
  !> the displacements; not where these, pressures and gaps belong together but for the error of solves by p-multigrid.
  pure integer function digits_of_energy(state, strain) result(digits)
    type(solver_state_t), intent(in) :: state  !! How the scheme ended.
    real(dp), intent(in) :: strain  !! Strain energy [energy].
    real(dp) :: error
    digits = most_digits
    if (.not. state%error_bound < 1) return
    error = state%error_bound*2*strain
    if (state%bound_is_guaranteed .or. allocated(state%terms)) error = error*state%error_bound/2
    if (error > 0 .and. abs(state%energy) > 0) &
      digits = min(most_digits, max(least_digits, 1 + ceiling(log10(abs(state%energy)/error))))
  end function digits_of_energy

  !> The potential energy and its terms, (19).
  subroutine show_energies(log, state, energies, has_layer)
    type(log_t), intent(inout) :: log  !! The log.
    type(solver_state_t), intent(in) :: state  !! How the scheme ended.
    type(energies_t), intent(in) :: energies  !! The terms.
    logical, intent(in) :: has_layer  !! Whether the penalty term has the energy of layers, which is no error.
    real(dp) :: work
    ! What rounding leaves where no load does work.
    ! Penalty term relative to the strain energy that is told [].
    real(dp), parameter :: much_penalty = 0.02_dp
    work = energies%load_work
    if (abs(work) < rounding*energies%strain) work = 0
    call log%detail('  potential energy '//to_text(state%energy, digits_of_energy(state, energies%strain)))
    call log%detail('                   = strain energy '//to_text(energies%strain, 6)//' - work of loads '// &
                  to_text(work, 6)//' + penalty term (18) '//to_text(energies%penalty, 6))
    if (energies%penalty > much_penalty*energies%strain .and. energies%strain > 0 .and. .not. has_layer) &
      call log%line('  warning          the penalty term is '//to_text(100*energies%penalty/energies%strain, 2)// &
                    ' % of the strain energy: bodies under forces yield, and contact forces of given displacements '// &
                    'or gaps fall short, by about as much; give theta = 0, or a smaller one')
  end subroutine show_energies

  !> The contributions to the error, as far as they were asked for.
  subroutine show_budget(log, output, body, state, budget)
    type(log_t), intent(inout) :: log  !! The log.
    type(output_input_t), intent(in) :: output  !! `&output`.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(solver_state_t), intent(in) :: state  !! State of the scheme.
    type(error_budget_t), intent(in) :: budget  !! The errors.
    character(:), allocatable :: line
    logical :: in_energy
    integer :: b
    !> Errors relative to a displacement that is rounding, beside the strains of heat [].
    real(dp), parameter :: meaningless = 0.5_dp
    in_energy = any([(body(b)%initial%is_set(), b=1, size(body))]) .and. &
                any([exceeds(state%error_bound, meaningless), exceeds(budget%penalty, meaningless), &
                     exceeds(budget%discretization, meaningless)])
    line = '  relative error   iteration '
    if (in_energy) line = '  error in energy  iteration '
    line = line//part('<=', state%error_bound)
    ! Without penalty there is none.
    if (output%error_penalty .and. .not. budget%penalty <= 0) &
      line = line//', penalty '//part(trim(merge('<=', '~ ', budget%penalty_is_bound)), budget%penalty)
    if (allocated(budget%of_body)) then
      line = line//', discretization '//part('~', budget%discretization)
      if (size(body) > 1 .and. .not. ieee_is_nan(budget%discretization)) &
        line = line//', largest in '//quoted(body(maxloc(budget%of_body, 1))%name)
    end if
    if (in_energy) line = line//' (temperatures or initial stresses leave hardly a displacement that errors could '// &
                          'be relative to)'
    call log%line(line)
  contains
    !> Whether an error is known and above a limit.
    pure logical function exceeds(value, limit)
      real(dp), intent(in) :: value  !! Relative error; NaN where it is unknown [].
      real(dp), intent(in) :: limit  !! The limit [].
      exceeds = .false.
      if (.not. ieee_is_nan(value)) exceeds = value > limit
    end function exceeds

    !> A bound or an estimate in per cent, or as the energy of the error.
    function part(relation, value) result(text)
      character(*), intent(in) :: relation  !! '<=' of a bound, '~' of an estimate.
      real(dp), intent(in) :: value  !! Error relative to the energy norm [].
      character(:), allocatable :: text
      real(dp), parameter :: largest = 1.0e100_dp  !! Errors from here on say nothing.
      text = 'unknown'
      if (ieee_is_nan(value)) return
      if (.not. value < largest) return
      if (in_energy) then
        text = relation//' '//to_text((value*budget%norm)**2/2, 2)
      else
        text = relation//' '//to_text(100*value, 2)//' %'
      end if
    end function part
  end subroutine show_budget

  !> What was not computed.
  subroutine show_not_computed(log, goal, state)
    type(log_t), intent(inout) :: log  !! The log.
    type(solution_goal_t), intent(in) :: goal  !! What was asked for.
    type(solver_state_t), intent(in) :: state  !! State of the scheme.
    character(:), allocatable :: line
    line = ''
    if (state%screened > 0) call add(counted(state%screened, 'inactive constraint')//' (screened out)')
    if (.not. goal%needs_displacements()) call add('displacements')
    if (.not. goal%needs_displacements()) call add('check for penetration')
    if (.not. goal%stress) call add('stresses')
    if (.not. goal%mesh_error) call add('discretization error')
    if (.not. goal%penalty_error) call add('penalty error')
    if (len(line) > 0) call log%detail('  not computed     '//line)
  contains
    !> Add an item.
    subroutine add(text)
      character(*), intent(in) :: text  !! The item.
      if (len(line) > 0) line = line//', '
      line = line//text
    end subroutine add
  end subroutine show_not_computed

  !> One line for each congruence class that loses digits.
  subroutine show_conditioning(log, body, classes, conditioning)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes of the bodies.
    type(conditioning_t), intent(in) :: conditioning(:)  !! Conditioning of their stiffness matrices (n_bodies).
    character(:), allocatable :: line
    integer :: b
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) cycle
      line = '  conditioning     '//quoted(body(b)%name)//': '
      associate (of_body => conditioning(b))
        if (of_body%is_measured) then
          line = line//'condition number '//to_text(of_body%condition, 2)
          if (of_body%n_near_null > 0) &
            line = line//', '//to_text(of_body%condition_left, 2)//' with '// &
                   counted(of_body%n_near_null, 'near-null-space mode')//' deflated'
          line = line//', loss of significance '//to_text(of_body%lost_digits())//' of 16 digits'
          if (of_body%n_steps > 0) line = line//'; '
        end if
        if (of_body%n_steps > 0) line = line//counted(of_body%n_steps, 'step')//' of iterative refinement'
        if (of_body%is_measured .or. of_body%n_steps > 0) call log%line(line)
      end associate
    end do
  end subroutine show_conditioning

  !> Which rule without guarantee was to end the iteration, and whether it is met.
  function rule_in_force(state, tolerance) result(text)
    type(solver_state_t), intent(in) :: state  !! State of the scheme, with the rule `increment` or `paper`.
    real(dp), intent(in) :: tolerance  !! Tolerance of the rule [].
    character(:), allocatable :: text
    logical :: is_met
    is_met = any(state%ended == [ended_converged, ended_unverified])
    text = trim(merge(' is met:    ', ' is not met:', is_met))
    if (state%stop_rule == stop_increment) then
      text = "'increment'"//text//' the last increment, '//to_text(state%history%increment(state%history%n), 3)
    else
      text = "'paper'"//text//' the bound (41), '//to_text(state%error_bound_paper, 3)
    end if
    text = text//trim(merge(', does not exceed', ', exceeds        ', is_met))//' the tolerance '//to_text(tolerance)
  end function rule_in_force

  !> How a scheme ended.
  function outcome(state) result(text)
    type(solver_state_t), intent(in) :: state  !! State of the scheme.
    character(:), allocatable :: text
    select case (state%ended)
    case (ended_converged)
      text = 'converged'
    case (ended_limit)
      text = 'not converged: stopped at max_iterations'
    case (ended_diverged)
      text = 'not converged: diverged'
    case (ended_interrupted)
      text = 'not converged: interrupted'
    case (ended_cycling)
      text = 'not converged: active sets cycle despite the interior-point method; ended'
    case (ended_unbalanced)
      text = 'not converged: contact forces do not balance the loads of floating bodies; ended'
    case (ended_rotated)
      text = 'not valid: rotation of a body beyond small displacements; ended'
    case (ended_gaps)
      text = 'not valid: results depend on gaps that the meshes do not tell; ended'
    case (ended_penetration)
      text = 'not valid: bodies penetrate each other; ended'
    case (ended_unverified)
      text = 'not converged: stop_rule met by an iterate without a useful error bound; ended'
    case (ended_solves)
      text = "not converged: solves by p-multigrid are no more accurate (response='full' has factors); ended"
    case default
      text = 'not converged: stalled at double-precision rounding'
    end select
  end function outcome

  !> Pairs whose forces, or displacements, hang on what is not known of their gaps, the most uncertain first.
  subroutine show_gap_doubt(log, pair, doubt)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_pair_t), intent(in) :: pair(:)  !! The pairs (n_pairs).
    type(gap_doubt_t), intent(in) :: doubt(:)  !! Of each (n_pairs).
    integer, parameter :: most_lines = 5  !! Lines at most.
    real(dp) :: part(size(doubt))
    logical :: is_shown(size(doubt)), is_low(size(doubt))
    character(:), allocatable :: line
    integer :: i, k
    if (size(doubt) == 0) return
    if (any(ieee_is_nan(doubt%force_change)) .and. any(doubt%uncertainty > 0)) &
      call log%line('  uncertain        gaps are known to '//to_text(maxval(doubt%uncertainty), 2)// &
                    ' only; what hangs on them could not be found')
    is_low = is_narrow(doubt)
    part = max(doubt%force_part, doubt%moved_part)
    is_shown = .false.
    do i = 1, min(most_lines, count(part > notable))
      k = maxloc(part, dim=1, mask=.not. is_shown)
      is_shown(k) = .true.
      line = ''
      if (doubt(k)%force_part > notable) &
        line = ' normal forces of '//to_text(doubt(k)%force, 4)//' together, uncertain by '// &
               to_text(doubt(k)%force_change, 2)
      if (doubt(k)%moved_part > notable) line = &
        line//trim(merge(',', ' ', len(line) > 0))//' normal displacements uncertain by '// &
        to_text(doubt(k)%moved_change, 2)
      if (doubt(k)%uncertainty > 0) then
        call log%line('  uncertain        gaps of '//quoted(pair(k)%name)//' are known to '// &
                      to_text(doubt(k)%uncertainty, 2)//' only:'//line)
      else
        call log%line('  uncertain        gaps of other pairs than '//quoted(pair(k)%name)//' are known to '// &
                      to_text(maxval(doubt%uncertainty), 2)//' only: its'//line)
      end if
    end do
    i = count(part > notable) - most_lines
    if (i > 0) call log%line('                   and '//counted(i, 'other pair'))
    if (any(is_shown)) call log%line('                   refine the surfaces there, or use quadratic elements on '// &
                                     'curved geometry')
    is_shown = .false.
    do i = 1, min(most_lines, count(is_low))
      k = maxloc(doubt%hertz_peak, dim=1, mask=is_low .and. .not. is_shown)
      is_shown(k) = .true.
      call log%line('  narrow contact   '//quoted(pair(k)%name)//' is narrower than a facet: peak pressure about '// &
                    to_text(doubt(k)%hertz_peak, 2)//' by Hertz; peak and area above are those of the facets')
    end do
    i = count(is_low) - most_lines
    if (i > 0) call log%line('                   and '//counted(i, 'other pair'))
  end subroutine show_gap_doubt
end module dotyk_log_summary
