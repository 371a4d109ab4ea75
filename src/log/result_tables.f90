!> Results in the log: contact pairs, reactions of supports, strain energies, what is left of the equilibrium, the
!> greatest displacements and stresses, and quantities with error bars of the mesh.
module dotyk_log_result_tables
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t, most_shown
  use dotyk_base_options, only: analysis_axisymmetric
  use dotyk_base_text, only: counted, quoted, to_text
  use dotyk_base_thresholds, only: half_digits, notable
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_control_balance, only: balance_t
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_nodal_stresses, only: nodal_stress_t
  use dotyk_control_pressures, only: nodal_field_t, pair_solution_t, well_covered
  use dotyk_control_quantity_error, only: bar_is_known, bar_narrow, bar_no_contact, bar_no_estimate, bar_no_factors, &
    bar_no_limit, bar_one_mesh, bar_singular, bar_soft, bar_zero, quantity_errors_t, quantity_value_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_nodal_stress, only: von_mises
  use dotyk_log_case_tables, only: concentrated, resultant_line, vector_text
  use dotyk_log_tie_tables, only: show_tie_forces
  implicit none
  private
  public :: show_balance, show_pair_results, show_greatest_values, show_quantities

  integer, parameter :: most_digits = 10, digits_of_error = 2  !! Digits of a value at most, and of its error bar.

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
                    ' on the slave body'//around//', peak pressure '//to_text(solution(k)%peak, 5)// &
                    area_of(solution(k)))
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
    integer :: n
    if (solution%n_active == 0) then
      text = ', open: least gap '//to_text(solution%least_gap, 4)
      return
    end if
    text = ', contact area '//to_text(solution%area, 5)
    associate (patch => solution%patch, i => maxloc(solution%patch%area, 1))
      n = count(patch%area > notable*patch(i)%area)
      if (n > 1) text = text//' in '//to_text(n)//' patches (the largest '//to_text(patch(i)%area, 5)//' around '// &
                        vector_text(patch(i)%centre)//')'
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
    !> A reaction below this fraction of the forces on a body is that of errors of loads and solution [].
    real(dp), parameter :: negligible = 1.0e-4_dp
    character(:), allocatable :: moments
    character(20) :: label
    real(dp) :: total(3), size_of, largest
    integer :: b, s, n, at(2), at_concentrated
    at_concentrated = 0
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
        if (balance%body(b)%support(s)%is_concentrated .and. &
            size_of + abs(balance%body(b)%support(s)%radial) > negligible*balance%body(b)%force_scale) &
          at_concentrated = b
        if (size_of <= largest) cycle
        largest = size_of
        at = [b, s]
      end do
    end do
    if (n > 1 .and. n <= most_shown) call log%line('  all together         force '//vector_text(total, largest))
    if (at_concentrated > 0) &
      call log%line('    warning: '//quoted(body(at_concentrated)%name)//': a reaction on '//concentrated)
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
    if (balance%couple_error > half_digits) &
      call log%line('  warning          contact forces on the two sides of pairs are not on one line: their '// &
                    'moments differ by '//to_text(100*balance%couple_error, 2)//' % of all; do not use the results')
    if (.not. maxval(balance%body%force_scale) > 0) return
    moments = ''
    if (balance%moment_error > 0) moments = ', moments '//to_text(balance%moment_error, 2)
    call log%detail('  equilibrium          sum of loads, contact forces and reactions of a body, relative to '// &
                    'their size: forces '//to_text(balance%force_error, 2)//moments//' at most')

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

  !> The greatest displacement of all nodes, and the greatest von Mises stress, if stresses at nodes are known.
  subroutine show_greatest_values(log, problem, solution, nodal_stress)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    type(body_solution_t), intent(in) :: solution(:)  !! Displacements of the bodies (n_bodies).
    type(nodal_stress_t), intent(in) :: nodal_stress(:)  !! Stresses at their nodes (n_bodies).
    type(nodal_field_t) :: moved(size(solution)), stressed(size(solution))
    integer :: b, i
    do b = 1, size(solution)
      if (.not. problem%ranks%is_own(b)) cycle
      if (allocated(solution(b)%displacement)) moved(b)%value = norm2(solution(b)%displacement, 1)
      if (allocated(nodal_stress(b)%value)) &
        stressed(b)%value = [(von_mises(nodal_stress(b)%value(:, i)), i=1, size(nodal_stress(b)%value, 2))]
    end do
    call show_greatest(log, problem, 'displacement     ', moved)
    call show_greatest(log, problem, 'von Mises        ', stressed)
  end subroutine show_greatest_values

  !> The greatest value at a node, its body and its place; nothing where all are 0.
  subroutine show_greatest(log, problem, word, field)
    type(log_t), intent(inout) :: log  !! The log.
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their ranks.
    character(*), intent(in) :: word  !! What the values are.
    type(nodal_field_t), intent(in) :: field(:)  !! Values at the nodes that this rank holds (n_bodies) [any].
    real(dp) :: greatest(size(field)), along(size(field)), place(3)
    logical, allocatable :: is_there(:)
    integer :: b, i
    greatest = 0
    do b = 1, size(field)
      if (allocated(field(b)%value)) greatest(b) = maxval(field(b)%value)
    end do
    call problem%ranks%share_greatest(greatest)
    b = maxloc(greatest, 1)
    if (.not. greatest(b) > 0) return
    place = 0
    associate (body => problem%body(b))
      allocate (is_there(body%mesh%n_nodes()), source=.false.)
      if (allocated(field(b)%value)) is_there = .not. field(b)%value < greatest(b)
      ! Ranks that share a body must name one node.
      do i = 1, body%dimension
        along = -huge(along)
        if (any(is_there)) along(b) = maxval(body%mesh%x(i, :), mask=is_there)
        call problem%ranks%share_greatest(along)
        place(i) = along(b)
        is_there = is_there .and. .not. body%mesh%x(i, :) < place(i)
      end do
      call log%line('  '//word//'greatest '//to_text(greatest(b), 5)//' in '//quoted(body%name)//' at '// &
                    vector_text(place, body%mesh%diameter()))
    end associate
  end subroutine show_greatest

  !> A line for each quantity.
  subroutine show_quantities(log, quantities)
    type(log_t), intent(inout) :: log  !! The log.
    type(quantity_errors_t), intent(in) :: quantities  !! The quantities; nothing is shown where there are none.
    character(:), allocatable :: name
    integer :: i, n
    if (.not. allocated(quantities%of)) return
    n = size(quantities%of)
    if (n > 0) call log%line('  quantity             value, error bar of the mesh')
    do i = 1, min(n, most_shown)
      name = quantities%of(i)%name
      call log%line('  '//name//repeat(' ', max(1, 21 - len(name)))//quantity_text(quantities%of(i)))
    end do
    if (n > most_shown) call log%line('  ... '//counted(n - most_shown, 'more quantity', 'more quantities')// &
                                      ' in the results file')
  end subroutine show_quantities

  !> Value and error bar, or why there is none.
  function quantity_text(of) result(text)
    type(quantity_value_t), intent(in) :: of  !! The quantity.
    character(:), allocatable :: text
    integer :: digits
    if (of%why_unknown /= bar_is_known) then
      text = to_text(of%value, 6)//', no error bar: '//reason(of%why_unknown)
      return
    end if
    digits = most_digits
    if (of%error > 0) digits = digits_of_error + ceiling(log10(max(1.0_dp, abs(of%value)/of%error)))
    text = to_text(of%value, min(most_digits, digits))//' +- '//to_text(of%error, digits_of_error)
  end function quantity_text

  !> Why there is no error bar.
  function reason(why) result(text)
    integer, intent(in) :: why  !! One of `bar_*`.
    character(:), allocatable :: text
    select case (why)
    case (bar_no_contact)
      text = 'no constraint is active'
    case (bar_zero)
      text = 'zero, but for rounding'
    case (bar_no_estimate)
      text = 'the discretization error is not known'
    case (bar_no_factors)
      text = "bodies have no factors; response='full' has them"
    case (bar_soft)
      text = 'supports hardly resist motions of bodies'
    case (bar_singular)
      text = 'contact forces are not unique'
    case (bar_one_mesh)
      text = 'it takes two meshes that resolve the contact, as of &accuracy'
    case (bar_narrow)
      text = 'a contact is narrower than a facet; refine there'
    case (bar_no_limit)
      text = 'it grows from mesh to mesh and has no limit'
    case default
      text = 'unknown'
    end select
  end function reason
end module dotyk_log_result_tables
