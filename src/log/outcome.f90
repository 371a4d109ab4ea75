!> What is said of a solution, or of a scene that has none, in words of the scene; and of the engine that solves it.
module dotyk_log_outcome
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_input_case, only: case_t
  use dotyk_log_indeterminate, only: note_rest, note_undetermined
  use dotyk_log_case_tables, only: vector_text
  use dotyk_log_run_monitor, only: log_monitor_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_scheme, only: reason_accuracy, reason_aggregates, reason_near_null_modes, reason_rigid_rows, &
    reason_slow
  use dotyk_scheme_solver_state, only: ended_no_equilibrium, ended_open_tie, ended_rigid_constraint, solver_state_t
  implicit none
  private
  public :: refuse_unsolvable, note_modes, note_factors, note_no_memory, note_rebuilt

contains

  !> Refuse a scene without a solution: loads that no contact balances, supports on both sides of contact rows, or ties
  !> that cannot be closed.
  subroutine refuse_unsolvable(case, problem, qp, state, error)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(solver_state_t), intent(in) :: state  !! State of the scheme at its end.
    type(error_t), allocatable, intent(out) :: error  !! Where there is no solution; names body or pair, with its line.
    if (state%ended == ended_no_equilibrium) &
      call refuse_motion(case, problem%body, problem%modes, first_mode(problem%modes, problem%tie), qp, &
                         state%unbounded, error)
    if (state%ended == ended_rigid_constraint) call refuse_rigid_constraint(case, problem%pair, qp, state, error)
    if (state%ended == ended_open_tie) call refuse_open_tie(case, problem, state, error)
  end subroutine refuse_unsolvable

  !> Say which modes are indeterminate, and which bodies rotate too far.
  subroutine note_modes(problem, state, ratio, max_unbalanced, log)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and contact pairs.
    type(solver_state_t), intent(in) :: state  !! State of the scheme at its end.
    real(dp), intent(in) :: ratio(:)  !! Displacement by rotation, relative to the size of the body (n_bodies) [].
    real(dp), intent(in) :: max_unbalanced  !! Greatest part of the forces on a body that may rest on weak springs [].
    type(log_t), intent(inout) :: log  !! The log.
    real(dp) :: rest
    rest = 0
    if (allocated(state%rest)) rest = maxval([rest, state%rest])
    call note_undetermined(problem, state%indeterminate, rest, log)
    call note_rest(problem, state, max_unbalanced, log)
    call note_rotations(problem%body, ratio, log)
  end subroutine note_modes

  !> An unbounded direction: a motion of one body or more that the loads excite and no contact can stop.
  subroutine refuse_motion(case, body, modes, first, qp, amplitude, error)
    type(case_t), intent(in) :: case  !! The case.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(body_modes_t), intent(in) :: modes(:)  !! Modes of the bodies (n_bodies).
    integer, intent(in) :: first(:)  !! First mode of each body (n_bodies + 1).
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    real(dp), intent(in) :: amplitude(:)  !! Amplitudes of the unbounded direction, by bodies (n_modes) [length].
    type(error_t), allocatable, intent(out) :: error  !! Names the bodies that move, and the resultants that move them.
    character(:), allocatable :: others, carried
    real(dp) :: work(size(body)), own_work(size(body))
    logical :: moved(size(body))
    integer :: b, worst, n_named
    integer, parameter :: most_named = 3
    ! A body moves if its loads do at least this fraction of the work of the body moved most, or of their own where
    ! nothing is in the way.
    real(dp), parameter :: much = 1.0e-3_dp, something = 1.0e-6_dp
    integer :: n_carried
    work = 0
    own_work = 0
    do b = 1, size(body)
      if (modes(b)%is_near_null()) cycle
      associate (one => first(b), last => first(b) + modes(b)%n - 1)
        work(b) = dot_product(amplitude(one:last), modes(b)%resultant)
        own_work(b) = sum(qp%coarse%resultant(one:last)**2)/maxval(abs(qp%coarse%resultant))
      end associate
    end do
    ! The first of several that are moved as much.
    worst = findloc(work > (1 - something)*maxval(work), .true., 1)
    moved = work > 0 .and. (work > much*work(worst) .or. work > something*own_work)
    if (.not. any(moved)) then
      ! No load does work: the tensions of bolts do.
      do b = 1, size(body)
        work(b) = largest_displacement(modes(b), amplitude(first(b):first(b) + modes(b)%n - 1))
      end do
      worst = maxloc(work, 1)
      call set_error(error, case%file//':'//to_text(case%body(worst)%line)//': body '//quoted(body(worst)%name)// &
                     ': no equilibrium: the tension of '//bolts_of(worst)//' moves it, and neither supports nor '// &
                     'contact resist: '// &
                     modes(worst)%combination_text(amplitude(first(worst):first(worst) + modes(worst)%n - 1))// &
                     '; add a &support, or a &contact that the bolt presses together', exit_not_solvable)
      return
    end if
    others = ''
    n_named = 0
    do b = 1, size(body)
      if (.not. moved(b) .or. b == worst) cycle
      n_named = n_named + 1
      if (n_named > most_named) cycle
      others = others//'; likewise body '//quoted(body(b)%name)//' (line '//to_text(case%body(b)%line)//'): '// &
               motion_of(b)
    end do
    if (n_named > most_named) others = others//'; likewise '//to_text(n_named - most_named)//' more'
    ! A support that is missing may be that of a body without loads.
    carried = ''
    n_carried = 0
    do b = 1, size(body)
      if (moved(b) .or. modes(b)%is_near_null()) cycle
      if (all(abs(amplitude(first(b):first(b) + modes(b)%n - 1)) <= much*maxval(abs(amplitude)))) cycle
      n_carried = n_carried + 1
      if (n_carried > 1 .and. n_carried <= most_named) carried = carried//', '
      if (n_carried <= most_named) carried = carried//quoted(body(b)%name)//' (line '//to_text(case%body(b)%line)//')'
    end do
    if (n_carried > most_named) carried = carried//' and '//to_text(n_carried - most_named)//' more'
    if (n_carried > 0) others = others//'; without loads of their own, '//carried//' would move with it'
    call set_error(error, case%file//':'//to_text(case%body(worst)%line)//': body '//quoted(body(worst)%name)// &
                   ': no equilibrium: the loads do work on a rigid body mode that neither supports nor contact '// &
                   'resist: '//motion_of(worst)//others// &
                   '; add a &support, a &contact that resists the motion, or another &load (more than '// &
                   to_text(qp%coarse%max_unbalanced)//' of the forces on the body, max_unbalanced of &solver)'// &
                   trim(merge(' (no body of the scene has a &support)', repeat(' ', 38), size(case%support) == 0)), &
                   exit_not_solvable)
  contains
    !> The bolts of a body, or those of others.
    function bolts_of(which) result(text)
      integer, intent(in) :: which  !! Index of the body.
      character(:), allocatable :: text
      integer :: k
      text = ''
      do k = 1, size(case%tie)
        associate (bolt => case%tie(k))
          if (.not. bolt%is_bolt .or. all([bolt%body_a, bolt%body_b] /= which)) cycle
          if (len(text) > 0) text = text//', '
          text = text//'&bolt '//quoted(bolt%name)//' (line '//to_text(bolt%line)//')'
        end associate
      end do
      if (len(text) == 0) text = 'a &bolt'
    end function bolts_of

    !> How a body moves, and the force or moment that moves it.
    function motion_of(which) result(text)
      integer, intent(in) :: which  !! Index of the body.
      character(:), allocatable :: text
      associate (own => amplitude(first(which):first(which) + modes(which)%n - 1))
        text = modes(which)%combination_text(own)//', resultant '// &
               to_text(dot_product(own, modes(which)%resultant)/largest_displacement(modes(which), own), 4)
      end associate
    end function motion_of
  end subroutine refuse_motion

  !> Largest displacement of a node in a combination of modes [length].
  real(dp) function largest_displacement(modes, amplitude) result(largest)
    type(body_modes_t), intent(in) :: modes  !! Modes of a body.
    real(dp), intent(in) :: amplitude(:)  !! Amplitude of each mode (n) [length].
    real(dp) :: u(size(modes%shape, 1))
    integer :: i, k
    largest = tiny(largest)
    do i = 1, size(modes%shape, 2)
      u = 0
      do k = 1, size(amplitude)
        u = u + amplitude(k)*modes%shape(:, i, k)
      end do
      largest = max(largest, norm2(u))
    end do
  end function largest_displacement

  !> Supports or ties on both sides press contact rows together.
  subroutine refuse_rigid_constraint(case, pair, qp, state, error)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    type(solver_state_t), intent(in) :: state  !! State of the scheme at its end.
    type(error_t), allocatable, intent(out) :: error  !! Names the contact pair, the overlap, and its place.
    character(:), allocatable :: place
    real(dp) :: overlap, point(3)
    integer :: k, n
    n = state%rigid_row
    overlap = state%overlap
    if (n == 0) then
      n = maxloc(qp%initial_penetration(:qp%pair_first_row(size(case%contact) + 1) - 1), 1)
      overlap = qp%initial_penetration(n)
    end if
    k = count(qp%pair_first_row <= n)
    point = 0
    point(:size(pair(k)%row_position, 1)) = pair(k)%row_position(:, n - qp%pair_first_row(k) + 1)
    place = to_text(overlap, 4)//' at '//vector_text(point)
    if (size(case%tie) > 0) then
      place = ': the surfaces overlap by '//place//', where supports or ties hold both of them, and theta = 0 '// &
              'allows no penetration; give the contact pair surfaces that end where ties begin, or set theta > 0'
    else
      place = ': prescribed displacements of both bodies make the surfaces overlap by '//place//', and theta = 0 '// &
              'allows no penetration; remove the supports from the contact surfaces or set theta > 0'
    end if
    call set_error(error, case%file//':'//to_text(case%contact(k)%line)//': &contact '//quoted(case%contact(k)%name)// &
                   place, exit_not_solvable)
  end subroutine refuse_rigid_constraint

  !> Ties contradict each other or supports.
  subroutine refuse_open_tie(case, problem, state, error)
    type(case_t), intent(in) :: case  !! The case.
    type(contact_problem_t), intent(in) :: problem  !! Contact pairs and ties.
    type(solver_state_t), intent(in) :: state  !! State of the scheme at its end.
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return: names the tie, and what stays open.
    integer :: k, n
    n = sum(problem%pair%n_rows)
    do k = 1, size(problem%tie) - 1
      n = n + sum(problem%tie(k)%component%n_rows)
      if (state%rigid_row <= n) exit
    end do
    call set_error(error, case%file//': tie '//quoted(problem%tie(k)%name)//' cannot be closed: '// &
                   to_text(state%overlap, 2)//' of '//to_text(state%overlap_of, 2)//' remain open; supports '// &
                   'with different displacements hold both sides, or ties contradict each other', exit_not_solvable)
  end subroutine refuse_open_tie

  !> Say which bodies rotate so far that small displacements are no good approximation.
  subroutine note_rotations(body, ratio, log)
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    real(dp), intent(in) :: ratio(:)  !! Displacement by rotation, relative to the size of the body (n_bodies) [].
    type(log_t), intent(inout) :: log  !! The log.
    integer :: n_far
    ! Displacements by rotation, relative to the size of the body.
    real(dp), parameter :: far = 0.05_dp
    n_far = count(ratio > far)
    if (n_far == 0) return
    call log%line('  large rotation   '//quoted(body(maxloc(ratio, 1))%name)//': rotation moves nodes by up to '// &
                  to_text(100*maxval(ratio), 2)//' % of its size; the theory assumes small displacements, '// &
                  'the results are qualitative')
    if (n_far > 1) call log%line('  large rotation   '//counted(n_far - 1, 'more body', 'more bodies')//', smaller')
  end subroutine note_rotations

  !> Bodies get factors in place of p-multigrids.
  subroutine note_factors(reason, monitor)
    integer, intent(in) :: reason  !! One of `reason_*`.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%note('factors          '//sentence(reason)// &
                      ': the bodies are factorized, and the contact solved again')
  end subroutine note_factors

  !> They do not get them.
  subroutine note_no_memory(reason, monitor)
    integer, intent(in) :: reason  !! One of `reason_*`.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%warn(sentence(reason)//', and the memory does not suffice for factors')
  end subroutine note_no_memory

  !> Bodies that were split get factors.
  subroutine note_rebuilt(reason, monitor)
    integer, intent(in) :: reason  !! One of `reason_*`.
    type(log_monitor_t), intent(inout) :: monitor  !! Gets the line.
    call monitor%note('factors          '//sentence(reason)//': the bodies are not split over ranks, each has its '// &
                      'factor on one of them')
  end subroutine note_rebuilt

  !> A reason as a sentence.
  pure function sentence(reason) result(text)
    integer, intent(in) :: reason  !! One of `reason_*`.
    character(:), allocatable :: text
    select case (reason)
    case (reason_near_null_modes)
      text = 'the contact needs factors, as supports hardly resist some motions'
    case (reason_rigid_rows)
      text = 'the contact needs factors, as supports press rows together'
    case (reason_aggregates)
      text = 'the ties need factors, as bodies of theirs are too large for p-multigrid with ties'
    case (reason_slow)
      text = 'p-multigrid would take longer than factors'
    case (reason_accuracy)
      text = 'the accuracy of p-multigrid does not suffice'
    case default
      text = 'the contact needs factors'
    end select
  end function sentence
end module dotyk_log_outcome
