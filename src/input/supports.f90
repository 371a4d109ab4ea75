!> Reads `&support` and `&spring`, supports that yield, from checked groups.
module dotyk_input_supports
  use dotyk_base_text, only: shown, to_text
  use dotyk_input_case, only: support_input_t
  use dotyk_input_groups, only: group_t, pick_groups
  use dotyk_input_references, only: append_places, input_t
  use dotyk_input_vectors, only: read_formulas, read_vector
  implicit none
  private
  public :: read_supports

contains

  !> Read all of them, for each body that a group names.
  subroutine read_supports(groups, input, support)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(support_input_t), allocatable, intent(out) :: support(:)  !! Supports, then springs (n_supports).
    type(support_input_t), allocatable :: given(:)
    integer, allocatable :: supports(:), springs(:), picked(:), matched(:), group_of(:), body_of(:)
    integer :: i
    call pick_groups(groups, 'support', supports)
    call pick_groups(groups, 'spring', springs)
    picked = [supports, springs]
    allocate (given(size(picked)), group_of(0), body_of(0))
    do i = 1, size(picked)
      call read_support(groups(picked(i)), input, given(i), matched)
      call append_places(i, matched, group_of, body_of)
    end do
    allocate (support(size(group_of)))
    do i = 1, size(group_of)
      support(i) = given(group_of(i))
      support(i)%body = body_of(i)
    end do
  end subroutine read_supports

  !> Read one of them.
  subroutine read_support(group, input, support, matched)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    !> The support, without a body; incomplete where the group has mistakes.
    type(support_input_t), intent(out) :: support
    integer, allocatable, intent(out) :: matched(:)  !! Bodies that the group names, ascending (n_matched).
    character(:), allocatable :: message
    call input%begin_action(group, support, matched)
    allocate (support%value_formula(0))
    support%is_spring = group%name == 'spring'
    if (support%is_spring) then
      call input%refuse_both(group, 'modulus', 'stiffness')
      if (.not. (group%is_given('modulus') .or. group%is_given('stiffness'))) &
        call input%add(group%line, '&spring: one of modulus (per area) and stiffness (total) is needed')
      support%modulus = group%real_of('modulus')
      support%stiffness = group%real_of('stiffness')
    else
      call input%refuse_both(group, 'value', 'value_formula')
      if (group%is_given('case') .and. .not. (group%is_given('value') .or. group%is_given('value_formula'))) &
        call input%report(group, 'case', 'case is that of value, which is missing: what is held is the same in '// &
                          'all load cases (for value = 0 in this one and another value elsewhere, give value)')
    end if
    if (.not. group%is_usable('fix')) return
    call support%fix%parse(group%text_of('fix'), input%scene%dimension, message)
    if (len(message) > 0) then
      call input%report(group, 'fix', 'fix: '//message)
      return
    end if
    call read_vector(group, input, 'value', support%fix%local, support%value)
    call read_formulas(group, input, 'value_formula', support%fix%local, support%value_formula)
    call refuse_values_not_fixed(group, input, support)
  end subroutine read_support

  !> Report values in directions without prescribed displacement.
  subroutine refuse_values_not_fixed(group, input, support)
    type(group_t), intent(in) :: group  !! Checked group.
    type(input_t), intent(inout) :: input  !! What groups refer to; mistakes are added.
    type(support_input_t), intent(in) :: support  !! The support, with directions and values.
    character(:), allocatable :: name
    integer :: i
    do i = 1, 3
      if (support%fix%fixed(i)) cycle
      name = support%fix%name(i)
      if (abs(support%value(i)) > 0) &
        call input%report(group, 'value', 'value has '//name//' = '//to_text(support%value(i))// &
                          ', but fix does not name '//name)
      if (size(support%value_formula) == 0) cycle
      if (support%value_formula(i)%s /= '0') &
        call input%report(group, 'value_formula', 'value_formula has '//name//' = '// &
                          shown(support%value_formula(i)%s)//', but fix does not name '//name//' (write ''0'')')
    end do
  end subroutine refuse_values_not_fixed
end module dotyk_input_supports
