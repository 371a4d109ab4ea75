!> What a run shows: a terse table of the scene, and a summary.
module dotyk_driver_screen
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_log, only: log_t
  use dotyk_base_memory, only: memory_text
  use dotyk_base_options, only: analysis_axisymmetric, analysis_names, discretization_quadrature, option_name
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_conditioning, only: conditioning_t
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_contact_solution, only: solution_goal_t
  use dotyk_control_error_budget, only: error_budget_t
  use dotyk_driver_factorization, only: factor_size_t
  use dotyk_driver_pressures, only: pair_solution_t
  use dotyk_driver_locking, only: show_locking
  use dotyk_driver_progress, only: duration
  use dotyk_driver_timing, only: timing_t
  use dotyk_driver_version, only: version
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t, output_input_t
  use dotyk_mesh_surface, only: surface_t
  use dotyk_scheme_bounds, only: gamma_limit
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_limit, ended_diverged, &
    ended_interrupted, &
    ended_rounds
  implicit none
  private
  public :: show_scene, show_structure, show_factorization, show_memory, show_budget, show_not_computed, show_state, &
    show_pair_results, show_conditioning, show_timing

  !> More kinds of bodies, or contact pairs, than this are only summed up.
  integer, parameter :: most_shown = 20

contains

  !> The first lines.
  subroutine show_scene(log, case, threads)
    type(log_t), intent(inout) :: log
    type(case_t), intent(in) :: case
    integer, intent(in) :: threads
    character(:), allocatable :: title
    title = case%scene%title
    if (len(title) == 0) title = case%file
    call log%line('dotyk '//version//' - '//title)
    call log%line('  '//case%file//', '//option_name(analysis_names, case%scene%analysis)//', '// &
                  plural(size(case%body), 'body', 'bodies')//', '//plural(size(case%contact), 'contact pair', &
                  'contact pairs')// &
                  ', '//plural(threads, 'thread', 'threads'))
  end subroutine show_scene

  !> Bodies, treatment of locking, and contact pairs.
  subroutine show_structure(log, case, problem, size_of)
    type(log_t), intent(inout) :: log
    type(case_t), intent(in) :: case
    type(contact_problem_t), intent(in) :: problem
    !> (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)
    call show_bodies(log, case, problem%body, problem%classes, size_of)
    call show_locking(log, case, problem%body, problem%classes)
    call show_pairs(log, problem%body, problem%pair, problem%surface_a, problem%surface_b)
    call log%line('')
  end subroutine show_structure

  !> One line per class of congruent bodies; many classes are summed up.
  subroutine show_bodies(log, case, body, classes, size_of)
    type(log_t), intent(inout) :: log
    type(case_t), intent(in) :: case
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(factor_size_t), intent(in) :: size_of(:)
    character(:), allocatable :: name
    integer :: b, elements, nodes, unknowns
    call log%line('')
    call log%line('  body                 material         elements      nodes   unknowns   factor entries     Gflop')
    elements = 0
    nodes = 0
    unknowns = 0
    do b = 1, size(body)
      elements = elements + body(b)%mesh%n_elements()
      nodes = nodes + body(b)%mesh%n_nodes()
      unknowns = unknowns + body(b)%constraint%n_equations
      if (classes%n() > most_shown .or. .not. classes%is_representative(b)) cycle
      name = body(b)%name
      if (count(classes%first == b) > 1) name = to_text(count(classes%first == b))//' like '//name
      call log%line(body_line(name, body(b)%material%name, body(b)%mesh%n_elements(), body(b)%mesh%n_nodes(), &
                              body(b)%constraint%n_equations, size_of(b)%entries, size_of(b)%flops))
    end do
    if (size(body) > 1) call log%line(body_line(plural(size(body), 'body', 'bodies'), '', elements, nodes, unknowns, &
                                                sum(size_of%entries), sum(size_of%flops)))
    if (classes%n() < size(body)) call log%line('  '//plural(classes%n(), 'kind', 'kinds')//' of bodies: '// &
      to_text(size(body))// &
                                              ' bodies, '//plural(classes%n(), 'factorization', 'factorizations'))
    if (size(case%contact) == 0) call log%line('  no contact pairs: no search, one solve per body')
  end subroutine show_bodies

  !> A line of the table of bodies.
  function body_line(name, material, elements, nodes, unknowns, entries, flops) result(line)
    character(*), intent(in) :: name, material
    integer, intent(in) :: elements, nodes, unknowns
    integer(int64), intent(in) :: entries
    real(dp), intent(in) :: flops
    character(120) :: line
    write (line, '(2x,a20,1x,a14,i11,i11,i11,es17.2,f10.2)') name, material, elements, nodes, unknowns, real(entries, &
      dp), &
      flops/1.0e9_dp
  end function body_line

  !> One line per contact pair, and what was left out; many pairs are summed up.
  subroutine show_pairs(log, body, pair, surface_a, surface_b)
    type(log_t), intent(inout) :: log
    type(body_t), intent(in) :: body(:)
    !> (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(surface_t), intent(in) :: surface_a(:), surface_b(:)
    real(dp) :: least, most
    integer :: k, n
    if (size(pair) == 0) return
    call log%line('')
    call log%line('  contact pair              points   without partner   smallest gap    largest gap          theta')
    least = huge(least)
    most = -huge(most)
    do k = 1, size(pair)
      least = min(least, minval(pair(k)%row_gap))
      most = max(most, maxval(pair(k)%row_gap))
      if (size(pair) <= most_shown) call show_pair(log, body, pair(k), surface_a(k), surface_b(k))
      call warn_of_noise(log, body, pair(k), surface_a(k)%n_facets)
    end do
    if (size(pair) > most_shown) call log%line(pair_line(to_text(size(pair))//' pairs', sum(pair%n_rows), &
      sum(pair%n_unprojected), least, most, maxval(pair%theta)))
    n = 0
    do k = 1, size(body)
      if (.not. any(pair%body_a == k .or. pair%body_b == k)) n = n + 1
    end do
    if (n > 0) call log%line('  '//plural(n, 'body touches', 'bodies touch')//' nothing: solved once, not iterated')
  end subroutine show_pairs

  !> The lines of one pair.
  subroutine show_pair(log, body, pair, surface_a, surface_b)
    type(log_t), intent(inout) :: log
    type(body_t), intent(in) :: body(:)
    type(contact_pair_t), intent(in) :: pair
    type(surface_t), intent(in) :: surface_a, surface_b
    call log%line(pair_line(pair%name, pair%n_rows, pair%n_unprojected, minval(pair%row_gap), maxval(pair%row_gap), &
      pair%theta))
    call log%line('    '//body(pair%body_a)%name//':'//surface_a%name//' ('//plural(surface_a%n_facets, 'facet', &
      'facets')// &
                  ') on '//body(pair%body_b)%name//':'//surface_b%name//' ('//plural(surface_b%n_facets, 'facet', &
                  'facets')//')')
    if (pair%n_unprojected > 0) call log%line('    left out: '//plural(pair%n_outside, 'integration point', &
      'integration points')//' beside the other surface, '//to_text(pair%n_not_facing)//' that it does not face, '// &
      to_text(pair%n_too_far)//' too far')
  end subroutine show_pair

  !> A line of the table of pairs.
  function pair_line(name, points, without, least, most, theta) result(line)
    character(*), intent(in) :: name
    integer, intent(in) :: points, without
    real(dp), intent(in) :: least, most, theta
    character(120) :: line
    write (line, '(2x,a20,i12,i18,es15.3,es15.3,es15.3)') name, points, without, least, most, theta
  end function pair_line

  !> Quadrature points are more than the unknowns of their surface: with theta far below h/E single pressures are noise.
  subroutine warn_of_noise(log, body, pair, n_facets)
    type(log_t), intent(inout) :: log
    type(body_t), intent(in) :: body(:)
    type(contact_pair_t), intent(in) :: pair
    !> Facets of surface_a.
    integer, intent(in) :: n_facets
    real(dp) :: size, compliance
    real(dp), parameter :: far_below = 1.0e-3_dp
    if (pair%discretization /= discretization_quadrature) return
    ! The mean size of a facet; circles about the axis do not make it larger.
    size = sum(pair%row_weight)
    if (body(pair%body_a)%analysis == analysis_axisymmetric) size = &
      sum(pair%row_weight/(2*acos(-1.0_dp)*pair%row_position(1, :)))
    size = (size/n_facets)**(1.0_dp/(pair%dimension - 1))
    compliance = size/body(pair%body_a)%young() + size/body(pair%body_b)%young()
    if (pair%theta < far_below*compliance) call log%line('    warning: theta is far below h/E = '//to_text(compliance, &
      2)// &
      ": single pressures at quadrature points are not determined, only their means are; use discretization='mortar'")
  end subroutine warn_of_noise

  !> How fast the factorization was.
  subroutine show_factorization(log, size_of, seconds)
    type(log_t), intent(inout) :: log
    type(factor_size_t), intent(in) :: size_of(:)
    !> [s].
    real(dp), intent(in) :: seconds
    call log%line('  factorized       in '//duration(seconds)//', '//memory_text(real(sum(size_of%bytes), dp))//', '// &
                  to_text(sum(size_of%flops)/max(seconds, tiny(seconds))/1.0e9_dp, 3)//' Gflop/s')
    call show_matrices(log, size_of)
  end subroutine show_factorization

  !> Bodies whose compliance is formed before the iteration.
  subroutine show_matrices(log, size_of)
    type(log_t), intent(inout) :: log
    !> (n_bodies).
    type(factor_size_t), intent(in) :: size_of(:)
    real(dp) :: fraction
    associate (chosen => size_of%forms_matrix)
      if (.not. any(chosen)) return
      fraction = sum(size_of%product_entries, mask=chosen)/max(1.0_dp, real(sum(size_of%class_entries, mask=chosen), &
        dp))
      call log%line('  compliance       '//plural(count(chosen), 'body', 'bodies')// &
        ': a matrix of the contact points, a response '// &
                    to_text(100*fraction, 2)//' % of one with the whole factor')
    end associate
  end subroutine show_matrices

  !> Memory that a run would take.
  subroutine show_memory(log, size_of)
    type(log_t), intent(inout) :: log
    type(factor_size_t), intent(in) :: size_of(:)
    real(dp) :: matrices
    matrices = sum(size_of%stiffness_bytes)
    call log%line('')
    call log%line('  estimated memory: factors '//memory_text(real(sum(size_of%bytes), dp))//', stiffnesses '// &
      memory_text(matrices)// &
                  ', in all about '//memory_text(1.15_dp*(sum(size_of%bytes) + matrices)))
  end subroutine show_memory

  !> How the scheme ended.
  subroutine show_state(log, state, tolerance, body_solves, seconds)
    type(log_t), intent(inout) :: log
    type(solver_state_t), intent(in) :: state
    !> What was to be reached.
    real(dp), intent(in) :: tolerance
    !> Sweeps over all bodies.
    integer, intent(in) :: body_solves
    !> Time of the scheme [s].
    real(dp), intent(in) :: seconds
    character(:), allocatable :: predicted
    call log%line('')
    if (size(state%m) == 0) then
      call log%line('  solved without contact, '//duration(seconds))
      call log%line('  energy           '//to_text(state%energy, 10))
      return
    end if
    call log%line('  '//outcome(state)//' after '//plural(state%iterations, 'step', 'steps')//' ('// &
                  plural(body_solves, 'solve', 'solves')//' of each body at most), '//duration(seconds))
    call log%line('  error bound      '//to_text(state%error_bound, 3)// &
      ' of the energy norm, guaranteed (tolerance '// &
                  to_text(tolerance)//')')
    if (state%ended == ended_converged .and. &
      state%error_bound > tolerance) call log%line('  rounding         puts the bound '// &
      'above the tolerance: the last digits of the displacements are worth as much, and no answer is nearer')
    if (.not. ieee_is_nan(state%error_bound_paper)) call log%line('  bound (41)       '// &
      to_text(state%error_bound_paper, 3))
    predicted = ''
    if (.not. ieee_is_nan(state%q_predicted)) predicted = ', at most '//to_text(state%q_predicted, 6)//' predicted'
    if (.not. ieee_is_nan(state%q_measured)) call log%line('  factor per step  '//to_text(state%q_measured, 6)// &
      ' measured'// &
                                                            predicted)
    call log%line('  penetration      '//to_text(state%max_penetration, 4)//' at most')
    call log%line('  energy           '//to_text(state%energy, 10))
    if (state%ended == ended_diverged) call log%line('  gamma = '//to_text(state%gamma)// &
      ' is too large: the iteration '// &
      'converges for 0 < gamma < 2/(1+L) = '//to_text(gamma_limit(state%lambda_max)))
  end subroutine show_state

  !> What the error is made of, as far as it was asked for.
  subroutine show_budget(log, output, body, state, budget)
    type(log_t), intent(inout) :: log
    type(output_input_t), intent(in) :: output
    type(body_t), intent(in) :: body(:)
    type(solver_state_t), intent(in) :: state
    type(error_budget_t), intent(in) :: budget
    character(:), allocatable :: line
    line = '  error            iteration '//part(state%error_bound)
    if (output%error_penalty .or. .not. ieee_is_nan(budget%penalty)) line = line//', penalty '//part(budget%penalty)
    if (allocated(budget%of_body)) then
      line = line//', mesh '//part(budget%discretization)
      if (size(body) > 1 .and. .not. ieee_is_nan(budget%discretization)) &
        line = line//', most of it in '//body(maxloc(budget%of_body, 1))%name
    end if
    call log%line(line)
  contains
    function part(value) result(text)
      real(dp), intent(in) :: value
      character(:), allocatable :: text
      text = 'unknown'
      if (ieee_is_nan(value)) return
      if (value < 1.0e100_dp) text = to_text(100*value, 2)//' %'
    end function part
  end subroutine show_budget

  !> What was not computed.
  subroutine show_not_computed(log, goal, state)
    type(log_t), intent(inout) :: log
    !> What was asked for.
    type(solution_goal_t), intent(in) :: goal
    type(solver_state_t), intent(in) :: state
    character(:), allocatable :: line
    line = ''
    if (state%screened > 0) call add(plural(state%screened, 'contact point that stays', 'contact points that stay')// &
      ' open')
    if (.not. goal%needs_displacements()) call add('displacements')
    if (.not. goal%stress) call add('stresses')
    if (.not. goal%needs_mesh_error()) call add('error of the mesh')
    if (.not. goal%needs_penalty_error()) call add('error of the penalty')
    if (len(line) > 0) call log%line('  left out         '//line)
  contains
    subroutine add(text)
      character(*), intent(in) :: text
      if (len(line) > 0) line = line//', '
      line = line//text
    end subroutine add
  end subroutine show_not_computed

  !> One line for each pair's result; many pairs are summed up.
  subroutine show_pair_results(log, pair, solution)
    type(log_t), intent(inout) :: log
    !> (n_pairs).
    type(contact_pair_t), intent(in) :: pair(:)
    type(pair_solution_t), intent(in) :: solution(:)
    character(:), allocatable :: what
    real(dp) :: peak
    integer :: k, active, worst
    active = 0
    worst = 1
    do k = 1, size(pair)
      active = active + count(solution(k)%pressure > 0)
      if (maxval(solution(k)%projected) > maxval(solution(worst)%projected)) worst = k
      if (size(pair) > most_shown) cycle
      what = pair(k)%name//': '//to_text(count(solution(k)%pressure > 0))//' of '//plural(pair(k)%n_rows, 'point', &
        'points')
      associate (force => solution(k)%force)
        call log%line('  '//what//' in contact, force ('//to_text(force(1), 5)//', '//to_text(force(2), 5)//', '// &
                      to_text(force(3), 5)//') on body a, peak pressure '//to_text(maxval(solution(k)%projected), 5))
      end associate
    end do
    if (size(pair) <= most_shown) return
    peak = maxval(solution(worst)%projected)
    call log%line('  '//to_text(size(pair))//' pairs: '//to_text(active)//' of '//to_text(sum(pair%n_rows))// &
                  ' points in contact, peak pressure '//to_text(peak, 5)//' in '//pair(worst)%name)
  end subroutine show_pair_results

  !> Where the time went.
  subroutine show_timing(log, timing)
    type(log_t), intent(inout) :: log
    type(timing_t), intent(in) :: timing
    call log%line('  time             read '//duration(timing%read)//', assemble '//duration(timing%assemble)// &
      ', order '// &
                  duration(timing%order)//', factorize '//duration(timing%factorize)//', search '// &
                  duration(timing%search)// &
                  ', iterate '//duration(timing%iterate)//', recover '//duration(timing%recover)// &
                  ', estimate errors '// &
                  duration(timing%estimate)//', write '// &
                  duration(timing%write)//'; total '//duration(timing%total))
  end subroutine show_timing

  !> One line for each kind of bodies that loses digits.
  subroutine show_conditioning(log, body, classes, conditioning)
    type(log_t), intent(inout) :: log
    !> (n_bodies).
    type(body_t), intent(in) :: body(:)
    type(congruence_classes_t), intent(in) :: classes
    type(conditioning_t), intent(in) :: conditioning(:)
    character(:), allocatable :: line
    integer :: b
    do b = 1, size(body)
      if (.not. classes%is_representative(b)) cycle
      line = '  digits           '//quoted(body(b)%name)//': '
      if (.not. conditioning(b)%is_measured) then
        if (conditioning(b)%n_steps > 0) call log%line(line//steps_of_refinement(conditioning(b)%n_steps))
        cycle
      end if
      line = line//'condition '//to_text(conditioning(b)%condition, 2)
      if (conditioning(b)%n_near_null > 0) line = line//', '//to_text(conditioning(b)%condition_left, 2)// &
        ' without '// &
                                       to_text(conditioning(b)%n_near_null)//' soft '// &
                                       trim(merge('motion ', 'motions', conditioning(b)%n_near_null == 1))// &
                                       ' treated apart'
      line = line//': '//to_text(conditioning(b)%lost_digits())//' of 16 digits lost'
      if (conditioning(b)%n_steps > 0) line = line//', '//steps_of_refinement(conditioning(b)%n_steps)
      call log%line(line)
    end do
  end subroutine show_conditioning

  !> How many, in words.
  pure function steps_of_refinement(n) result(text)
    integer, intent(in) :: n
    character(:), allocatable :: text
    text = to_text(n)//' '//trim(merge('step ', 'steps', n == 1))//' of refinement'
  end function steps_of_refinement

  !> How a scheme ended, in words.
  function outcome(state) result(text)
    type(solver_state_t), intent(in) :: state
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
    case (ended_rounds)
      text = 'not converged: the error bound keeps above its part of the other errors; stopped'
    case default
      text = 'not converged: rounding allows no smaller error; stopped'
    end select
  end function outcome

  !> "1 body", "2 bodies".
  function plural(n, one, many) result(text)
    integer, intent(in) :: n
    character(*), intent(in) :: one, many
    character(:), allocatable :: text
    if (n == 1) then
      text = '1 '//one
    else
      text = to_text(n)//' '//many
    end if
  end function plural
end module dotyk_driver_screen
