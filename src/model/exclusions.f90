!> Pairs of bodies that `exclude` leaves out.
module dotyk_model_exclusions
  use dotyk_base_text, only: text_t
  use dotyk_base_wildcard, only: matches
  use dotyk_input_case, only: body_input_t, case_t, exclusion_t
  implicit none
  private
  public :: are_tied, exclusion_of, exclusion_texts

contains

  !> Whether two bodies are tied to each other: no pair is searched between them.
  pure logical function are_tied(case, a, b)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: a  !! Index of a body.
    integer, intent(in) :: b  !! Index of the other body.
    are_tied = .false.
    if (.not. allocated(case%tie)) return
    associate (tie => case%tie)
      are_tied = any((tie%body_a == a .and. tie%body_b == b) .or. (tie%body_a == b .and. tie%body_b == a))
    end associate
  end function are_tied

  !> The first exclusion that means two bodies; 0 where none does.
  pure integer function exclusion_of(exclude, a, b) result(i)
    type(exclusion_t), intent(in) :: exclude(:)  !! Exclusions of a group (n_exclusions).
    type(body_input_t), intent(in) :: a  !! A body.
    type(body_input_t), intent(in) :: b  !! The other body.
    do i = 1, size(exclude)
      if (is_meant(exclude(i)%a, a) .and. is_meant(exclude(i)%b, b)) return
      if (is_meant(exclude(i)%a, b) .and. is_meant(exclude(i)%b, a)) return
    end do
    i = 0
  end function exclusion_of

  !> Whether a name with wildcards means a body, or the one of which it is a half.
  pure logical function is_meant(pattern, body)
    character(*), intent(in) :: pattern  !! Name, maybe with wildcards.
    type(body_input_t), intent(in) :: body  !! The body.
    is_meant = pattern == body%name .or. matches(pattern, body%name)
    if (is_meant .or. .not. body%cut%is_cut()) return
    is_meant = pattern == body%cut%whole .or. matches(pattern, body%cut%whole)
  end function is_meant

  !> Some exclusions as the user writes them.
  pure function exclusion_texts(exclude, chosen) result(texts)
    type(exclusion_t), intent(in) :: exclude(:)  !! Exclusions of a group (n_exclusions).
    logical, intent(in) :: chosen(:)  !! Which ones (n_exclusions).
    type(text_t), allocatable :: texts(:)
    integer :: i, n
    allocate (texts(count(chosen)))
    n = 0
    do i = 1, size(exclude)
      if (.not. chosen(i)) cycle
      n = n + 1
      texts(n)%s = exclude(i)%a
      if (exclude(i)%b /= '*') texts(n)%s = exclude(i)%a//' - '//exclude(i)%b
    end do
  end function exclusion_texts
end module dotyk_model_exclusions
