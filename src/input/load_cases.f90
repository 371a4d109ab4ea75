!> Reads load cases: `&case`, the key `case` of other groups, and `&contact_case`, from checked groups.
module dotyk_input_load_cases
  use dotyk_base_options, only: gap_constant, gap_formula, option_name, scheme_auto, scheme_dual, scheme_names, &
    theta_formula, theta_names
  use dotyk_base_text, only: shown, text_t
  use dotyk_base_wildcard, only: has_wildcard, matches
  use dotyk_input_case, only: contact_case_input_t, contact_input_t, load_case_input_t, solver_input_t
  use dotyk_input_problems, only: problems_t
  use dotyk_input_reader, only: group_t
  use dotyk_input_settings, only: read_theta
  use dotyk_input_values, only: find_name, first_names, is_given, logical_of, names_t, pick_groups, real_of, refer, &
    report, text_of, texts_of
  implicit none
  private
  public :: cases_of, read_contact_cases, read_load_cases

contains

  !> Read all `&case`.
  subroutine read_load_cases(groups, problems, load_case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> The cases; none where the file has no such group (n_cases).
    type(load_case_input_t), allocatable, intent(out) :: load_case(:)
    integer, allocatable :: picked(:)
    integer :: i
    call pick_groups(groups, 'case', picked)
    allocate (load_case(size(picked)))
    do i = 1, size(picked)
      associate (group => groups(picked(i)), own => load_case(i))
        own%line = group%line
        own%name = text_of(group, 'name')
        own%continues = logical_of(group, 'history')
        ! The name becomes that of a folder in the results file.
        if (index(own%name, '/') > 0 .or. own%name == '.' .or. own%name == '..') &
          call report(problems, group, 'name', 'name: '//shown(own%name)//' cannot name a folder of the results file')
        if (i == 1 .and. own%continues) &
          call report(problems, group, 'history', 'history: the first case has no case before it')
      end associate
    end do
  end subroutine read_load_cases

  !> The cases that the key `case` names.
  subroutine cases_of(group, names, problems, in_case)
    type(group_t), intent(in) :: group  !! Checked group.
    type(names_t), intent(in) :: names  !! Names of the cases.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> Whether the group belongs to each case; not allocated where it belongs to all (n_cases).
    logical, allocatable, intent(out) :: in_case(:)
    type(text_t), allocatable :: texts(:)
    logical, allocatable :: matched(:)
    integer :: i, k, place
    if (.not. is_given(group, 'case')) return
    allocate (in_case(max(1, size(names%name))), source=.false.)
    if (size(names%name) == 0) then
      if (.not. names%incomplete) &
        call report(problems, group, 'case', 'case names load cases, and the file has no &case: add '// &
                    '&case name=''...'' / for each of them')
      return
    end if
    call texts_of(group, 'case', texts)
    do i = 1, size(texts)
      place = find_name(names, texts(i)%s)
      if (place > 0) then
        in_case(place) = .true.
      else if (has_wildcard(texts(i)%s)) then
        matched = [(matches(texts(i)%s, names%name(k)%s), k=1, size(names%name))]
        in_case = in_case .or. matched
        if (.not. (any(matched) .or. names%incomplete)) &
          call report(problems, group, 'case', 'case: no case has a name like '//shown(texts(i)%s)//' (known: '// &
                      first_names(names%name)//')')
      else
        call refer(group, 'case', texts(i)%s, names, problems, place)
      end if
    end do
  end subroutine cases_of

  !> Read all `&contact_case`.
  subroutine read_contact_cases(groups, names, contact, solver, problems, contact_case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(names_t), intent(in) :: names  !! Names of the cases.
    type(contact_input_t), intent(in) :: contact(:)  !! Contact pairs as the file has them (n_contacts).
    type(solver_input_t), intent(in) :: solver  !! Settings of the solver.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    !> Gaps and penalty parameters by cases (n_contact_cases).
    type(contact_case_input_t), allocatable, intent(out) :: contact_case(:)
    integer, allocatable :: picked(:)
    integer :: i
    call pick_groups(groups, 'contact_case', picked)
    allocate (contact_case(size(picked)))
    do i = 1, size(picked)
      call cases_of(groups(picked(i)), names, problems, contact_case(i)%in_case)
      call read_contact_case(groups(picked(i)), contact, solver, problems, contact_case(i))
    end do
  end subroutine read_contact_cases

  !> Read one `&contact_case`.
  subroutine read_contact_case(group, contact, solver, problems, own)
    type(group_t), intent(in) :: group  !! Checked group.
    type(contact_input_t), intent(in) :: contact(:)  !! Contact pairs as the file has them (n_contacts).
    type(solver_input_t), intent(in) :: solver  !! Settings of the solver.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(contact_case_input_t), intent(inout) :: own  !! Gets gap and penalty parameter.
    integer :: k
    own%line = group%line
    own%contact = text_of(group, 'contact')
    own%gap = real_of(group, 'gap')
    own%gap_formula = text_of(group, 'gap_formula')
    own%has_gap = is_given(group, 'gap') .or. is_given(group, 'gap_formula')
    own%gap_kind = merge(gap_formula, gap_constant, is_given(group, 'gap_formula'))
    if (is_given(group, 'gap') .and. is_given(group, 'gap_formula')) &
      call report(problems, group, 'gap', 'gap and gap_formula are both given: only one can be meant')
    call read_theta(group, problems, own%has_theta, own%theta_kind, own%theta)
    own%theta_formula = text_of(group, 'theta_formula')
    if (.not. (own%has_gap .or. own%has_theta)) &
      call problems%add(group%line, '&contact_case: a gap or a theta is missing')
    if (own%has_theta .and. own%theta_kind /= theta_formula .and. .not. abs(own%theta) > 0 .and. &
        all(solver%scheme /= [scheme_auto, scheme_dual])) &
      call report(problems, group, option_name(theta_names, own%theta_kind), 'theta = 0 needs scheme=''dual'', '// &
                  'got '''//option_name(scheme_names, solver%scheme)//'''')
    ! Pairs that are found have their names after the search.
    if (len(own%contact) == 0 .or. any(contact%searched)) return
    if (any([(matches(own%contact, contact(k)%name), k=1, size(contact))])) return
    call report(problems, group, 'contact', 'contact: no &contact has a name like '//shown(own%contact))
  end subroutine read_contact_case
end module dotyk_input_load_cases
