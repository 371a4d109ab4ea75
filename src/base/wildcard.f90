!> Names with wildcards: * stands for any text, also none, and ? for any one character.
module dotyk_base_wildcard
  implicit none
  private
  public :: has_wildcard, matches

contains

  !> Whether a name has a wildcard.
  pure logical function has_wildcard(pattern)
    character(*), intent(in) :: pattern  !! Name, maybe with wildcards.
    has_wildcard = scan(pattern, '*?') > 0
  end function has_wildcard

  !> Whether a text is one of those that a pattern stands for; the whole text counts, letters in their case.
  pure logical function matches(pattern, text)
    character(*), intent(in) :: pattern  !! Name with wildcards.
    character(*), intent(in) :: text  !! Text to compare.
    integer :: p, t, star, retry
    p = 1
    t = 1
    star = 0
    retry = 1
    do while (t <= len(text))
      if (p <= len(pattern)) then
        if (pattern(p:p) == '*') then
          ! At first the star stands for nothing.
          star = p
          retry = t
          p = p + 1
          cycle
        else if (pattern(p:p) == '?' .or. pattern(p:p) == text(t:t)) then
          p = p + 1
          t = t + 1
          cycle
        end if
      end if
      if (star == 0) then
        matches = .false.
        return
      end if
      ! The last star takes one character more.
      retry = retry + 1
      t = retry
      p = star + 1
    end do
    matches = verify(pattern(p:), '*') == 0
  end function matches
end module dotyk_base_wildcard
