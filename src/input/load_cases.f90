!> Reads load cases: `&case`, the key `case` of other groups, and `&contact_case`, from checked groups.
module dotyk_input_load_cases
  use dotyk_base_options, only: gap_constant, gap_formula, option_name, scheme_auto, scheme_dual, scheme_names, &
    theta_formula, theta_names
  use dotyk_base_text, only: shown
  use dotyk_base_wildcard, only: matches
  use dotyk_input_case, only: contact_case_input_t, contact_input_t, load_case_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: input_t
  use dotyk_input_settings, only: read_theta
  implicit none
  private
  public :: read_contact_cases, read_load_cases

contains

  !> Read all `&case`.
  subroutine read_load_cases(groups, input, load_case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    !> The cases; none where the file has no such group (n_cases).
    type(load_case_input_t), allocatable, intent(out) :: load_case(:)
    integer, allocatable :: picked(:)
    integer :: i
    call pick_groups(groups, 'case', picked)
    allocate (load_case(size(picked)))
    do i = 1, size(picked)
      associate (group => groups(picked(i)), own => load_case(i))
        own%line = group%line
        own%name = group%text_of('name')
        own%continues = group%logical_of('history')
        ! The name becomes that of a folder in the results file.
        if (index(own%name, '/') > 0 .or. own%name == '.' .or. own%name == '..') &
          call input%report(group, 'name', 'name: '//shown(own%name)//' cannot name a folder of the results file')
        if (i == 1 .and. own%continues) &
          call input%report(group, 'history', 'history: the first case has no case before it')
      end associate
    end do
  end subroutine read_load_cases

  !> Read all `&contact_case`.
  subroutine read_contact_cases(groups, input, contact, contact_case)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(contact_input_t), intent(in) :: contact(:)  !! Contact pairs as the file has them (n_contacts).
    !> Gaps and penalty parameters by cases (n_contact_cases).
    type(contact_case_input_t), allocatable, intent(out) :: contact_case(:)
    integer, allocatable :: picked(:)
    integer :: i
    call pick_groups(groups, 'contact_case', picked)
    allocate (contact_case(size(picked)))
    do i = 1, size(picked)
      call input%cases_of(groups(picked(i)), contact_case(i)%in_case)
      call read_contact_case(groups(picked(i)), input, contact, contact_case(i))
    end do
  end subroutine read_contact_cases

  !> Read one `&contact_case`.
  subroutine read_contact_case(group, input, contact, own)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(contact_input_t), intent(in) :: contact(:)  !! Contact pairs as the file has them (n_contacts).
    type(contact_case_input_t), intent(inout) :: own  !! Gets gap and penalty parameter.
    integer :: k
    own%line = group%line
    own%contact = group%text_of('contact')
    own%gap = group%real_of('gap')
    own%gap_formula = group%text_of('gap_formula')
    own%has_gap = group%is_given('gap') .or. group%is_given('gap_formula')
    own%gap_kind = merge(gap_formula, gap_constant, group%is_given('gap_formula'))
    if (group%is_given('gap') .and. group%is_given('gap_formula')) &
      call input%report(group, 'gap', 'gap and gap_formula are both given: only one can be meant')
    call read_theta(group, input, own%has_theta, own%theta_kind, own%theta)
    own%theta_formula = group%text_of('theta_formula')
    if (.not. (own%has_gap .or. own%has_theta)) call input%add(group%line, '&contact_case: a gap or a theta is missing')
    if (own%has_theta .and. own%theta_kind /= theta_formula .and. .not. abs(own%theta) > 0 .and. &
        all(input%solver%scheme /= [scheme_auto, scheme_dual])) call input%report(group, option_name(theta_names, &
        own%theta_kind), 'theta = 0 needs scheme=''dual'', got '''//option_name(scheme_names, input%solver%scheme)// &
        '''')
    ! Pairs that are found have their names after the search.
    if (len(own%contact) == 0 .or. any(contact%searched)) return
    if (any([(matches(own%contact, contact(k)%name), k=1, size(contact))])) return
    call input%report(group, 'contact', 'contact: no &contact has a name like '//shown(own%contact))
  end subroutine read_contact_case
end module dotyk_input_load_cases
