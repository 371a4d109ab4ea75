!> Forces in the log: contact pairs, reactions of supports, strain energies, and what is left of the equilibrium.
module dotyk_log_force_tables
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_balance, only: balance_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_pressures, only: pair_solution_t, well_covered
  use dotyk_elasticity_body, only: body_t
  use dotyk_log_load_tables, only: resultant_line, vector_text
  use dotyk_log_tie_tables, only: show_tie_forces
  implicit none
  private
  public :: show_balance, show_pair_results

  !> Greatest number of contact pairs, supports or bodies with a line each; more are summed up.
  integer, parameter :: most_shown = 20

contains

  !> A line for the result of each contact pair, and one for details; many pairs are summed up.
  subroutine show_pair_results(log, pair, solution)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_pair_t), intent(in) :: pair(:)  !! Contact pairs (n_pairs).
    type(pair_solution_t), intent(in) :: solution(:)  !! Their pressures and forces (n_pairs).
    character(:), allocatable :: around
    integer :: k, active, worst, nearest
    active = 0
    worst = 1
    nearest = 1
    do k = 1, size(pair)
      active = active + solution(k)%n_active
      if (solution(k)%peak > solution(worst)%peak) worst = k
      if (solution(k)%least_gap < solution(nearest)%least_gap) nearest = k
      if (size(pair) > most_shown) cycle
      around = ''
      if (abs(solution(k)%radial_force) > 0) &
        around = ', radial '//to_text(solution(k)%radial_force, 5)//' around the circumference'
      call log%line('  '//pair(k)%name//': '//to_text(solution(k)%n_active)//' of '// &
                    counted(pair(k)%n_rows, 'constraint')//' active, contact force '// &
                    vector_text(solution(k)%force, sum(pair(k)%row_weight*abs(solution(k)%pressure)))// &
                    ' on the slave body'//around//', peak pressure '//to_text(solution(k)%peak, 5)//area_of(solution(k)))
      call log%detail('    '//details(solution(k)))
    end do
    if (size(pair) <= most_shown) return
    call log%line('  '//to_text(size(pair))//' contact pairs: '//to_text(active)//' of '//to_text(sum(pair%n_rows))// &
                  ' constraints active, contact area '//to_text(sum(solution%area), 5)//', peak pressure '// &
                  to_text(solution(worst)%peak, 5)//' in '//quoted(pair(worst)%name)//', least gap '// &
                  to_text(solution(nearest)%least_gap, 4)//' in '//quoted(pair(nearest)%name))
  end subroutine show_pair_results

  !> Contact area of a pair, or that it is open.
  function area_of(solution) result(text)
    type(pair_solution_t), intent(in) :: solution  !! Pressures and forces of the pair.
    character(:), allocatable :: text
    if (solution%n_active == 0) then
      text = ', open: least gap '//to_text(solution%least_gap, 4)
      return
    end if
    text = ', contact area '//to_text(solution%area, 5)
    associate (patch => solution%patch, i => maxloc(solution%patch%area, 1))
      if (size(patch) > 1) text = text//' in '//to_text(size(patch))//' patches (the largest '// &
                                  to_text(patch(i)%area, 5)//' around '//vector_text(patch(i)%centre)//')'
    end associate
  end function area_of

  !> Moment, centre of pressure and places of extremes of a pair.
  function details(solution) result(line)
    type(pair_solution_t), intent(in) :: solution  !! Pressures and forces of the pair.
    character(:), allocatable :: line
    line = ''
    if (any(abs(solution%moment) > 0)) line = 'moment '//vector_text(solution%moment)//' about the origin, '
    if (solution%n_active > 0) then
      if (.not. any(ieee_is_nan(solution%centre))) &
        line = line//'centre of pressure '//vector_text(solution%centre)//', '
      line = line//'peak pressure at '//vector_text(solution%peak_position)//', '
      if (solution%peak_covered < well_covered) &
        line = line//'where the master covers '//to_text(100*solution%peak_covered, 2)//' % of the vertex (no '// &
               'measure of the pressure beside it), '
    end if
    line = line//'least gap '//to_text(solution%least_gap, 4)//' at '//vector_text(solution%gap_position)
  end function details

  !> Ties, reactions of the supports, strain energies of the bodies, and the error of the equilibrium.
  subroutine show_balance(log, problem, balance)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and ties.
    type(balance_t), intent(in) :: balance  !! Forces on them; nothing is shown where they are not known.
    if (.not. allocated(balance%body)) return
    if (problem%n_ties() > 0) call show_tie_forces(log, problem%tie, balance%tie)
    call show_body_forces(log, problem%body, balance)
  end subroutine show_balance

  !> Reactions of the supports, strain energies of the bodies, and the error of the equilibrium.
  subroutine show_body_forces(log, body, balance)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(balance_t), intent(in) :: balance  !! Forces on them.
    character(:), allocatable :: moments
    character(20) :: label
    real(dp) :: total(3), size_of, largest
    integer :: b, s, n, at(2)
    n = sum([(size(balance%body(b)%support), b=1, size(body))])
    if (n > 0) call log%line('  support              reaction')
    total = 0
    largest = -1
    at = 0
    do b = 1, size(body)
      do s = 1, size(balance%body(b)%support)
        if (n <= most_shown) call log%line(support_line(b, s))
        total = total + balance%body(b)%support(s)%force
        size_of = norm2(balance%body(b)%support(s)%force)
        if (size_of <= largest) cycle
        largest = size_of
        at = [b, s]
      end do
    end do
    if (n > 1 .and. n <= most_shown) call log%line('  all together         force '//vector_text(total, largest))
    if (n > most_shown) then
      call log%line('  '//counted(n, 'support')//': force '//vector_text(total)//' together; the largest:')
      call log%line(support_line(at(1), at(2)))
    end if
    call show_motions(log, body, balance)
    if (size(body) > 1 .and. size(body) <= most_shown) then
      call log%detail('  body                 strain energy')
      do b = 1, size(body)
        label = body(b)%name
        if (.not. balance%body(b)%spring_energy > 0) then
          call log%detail('  '//label//' '//to_text(balance%body(b)%energy, 6))
        else
          call log%detail('  '//label//' '//to_text(balance%body(b)%energy, 6)//', of its springs '// &
                        to_text(balance%body(b)%spring_energy, 6))
        end if
      end do
    else if (size(body) > 1) then
      b = maxloc(balance%body%energy, 1)
      call log%detail('  '//counted(size(body), 'body', 'bodies')//': strain energy '// &
                    to_text(sum(balance%body%energy), 6)//' together, the largest '// &
                    to_text(balance%body(b)%energy, 6)//' in '//quoted(body(b)%name))
    end if
    if (.not. maxval(balance%body%force_scale) > 0) return
    moments = ''
    if (balance%moment_error > 0) moments = ', moments '//to_text(balance%moment_error, 2)
    call log%detail('  equilibrium          sum of loads, contact forces and reactions of a body, relative to their '// &
                  'size: forces '//to_text(balance%force_error, 2)//moments//' at most')

  contains

    !> Line of one support.
    function support_line(b, s) result(line)
      integer, intent(in) :: b  !! Its body.
      integer, intent(in) :: s  !! Its index there.
      character(:), allocatable :: line
      line = resultant_line(body(b), balance%body(b)%support(s), [balance%body(b)%force_scale, &
                                                                  balance%body(b)%moment_scale])
    end function support_line
  end subroutine show_body_forces

  !> Motions of rigid bodies.
  subroutine show_motions(log, body, balance)
    type(log_t), intent(inout) :: log  !! The log.
    type(body_t), intent(in) :: body(:)  !! Bodies (n_bodies).
    type(balance_t), intent(in) :: balance  !! Forces on them, and motions.
    character(:), allocatable :: rotation
    character(20) :: label
    integer :: b, n
    n = 0
    do b = 1, size(body)
      if (.not. body(b)%constraint%rigid%is_set) cycle
      n = n + 1
      if (n > most_shown) cycle
      if (n == 1) call log%line('  rigid body           displacement of its point')
      label = body(b)%name
      associate (motion => balance%body(b)%motion)
        rotation = ''
        if (body(b)%dimension == 3) then
          rotation = ', rotation '//vector_text(motion(4:6))//' rad'
        else if (body(b)%analysis /= analysis_axisymmetric) then
          rotation = ', rotation '//to_text(motion(6), 5)//' rad'
        end if
        call log%line('  '//label//' '//vector_text(motion(1:3))//rotation)
      end associate
    end do
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more rigid body', 'more rigid bodies'))
  end subroutine show_motions
end module dotyk_log_force_tables
