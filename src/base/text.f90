!> Text tools: numbers to text, comparison of names, splitting and joining, quoting for messages.
!>
!> gfortran 12 keeps the length of a text that a function returns in one place for all threads. Procedures that several
!> threads call make texts only for errors, and in `!$omp critical (message)`, always of this name.
!>
!> Names with wildcards: * stands for any text, also none, and ? for any one character.
module dotyk_base_text
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private
  public :: to_text, point_text, lower, nearest_name, edit_distance, suggestion, append_text, join, split_words, &
    counted, quoted, shown, visible, has_wildcard, matches

  type, public :: text_t  !! A text of its own length, for arrays of texts.
    character(:), allocatable :: s  !! The text.
  end type text_t

  !> A number as text without blanks around it.
  interface to_text
    module procedure text_of_integer, text_of_long, text_of_real
  end interface to_text

contains

  !> An integer as text.
  pure function text_of_integer(value) result(text)
    integer, intent(in) :: value  !! The integer.
    character(:), allocatable :: text
    character(24) :: buffer
    write (buffer, '(i0)') value
    text = trim(buffer)
  end function text_of_integer

  !> A 64-bit integer as text.
  pure function text_of_long(value) result(text)
    integer(int64), intent(in) :: value  !! The integer.
    character(:), allocatable :: text
    character(24) :: buffer
    write (buffer, '(i0)') value
    text = trim(buffer)
  end function text_of_long

  !> A real as text: plain for moderate sizes, with an exponent otherwise; no trailing zeros.
  pure function text_of_real(value, digits) result(text)
    real(dp), intent(in) :: value  !! The real; NaN and infinity are named [any].
    integer, intent(in), optional :: digits  !! Significant digits, 1 to 17; 6 if absent.
    character(:), allocatable :: text
    character(40) :: buffer
    character(16) :: form
    integer :: n, magnitude, mark
    n = 6
    if (present(digits)) n = max(1, min(17, digits))
    if (ieee_is_nan(value)) then
      text = 'NaN'
      return
    else if (abs(value) > huge(value)) then
      text = merge('-infinity', 'infinity ', value < 0)
      text = trim(text)
      return
    else if (.not. abs(value) > 0) then
      text = '0'
      return
    end if
    write (form, '(a,i0,a)') '(es40.', n - 1, 'e3)'
    write (buffer, form) value
    buffer = adjustl(buffer)
    mark = index(buffer, 'E')
    read (buffer(mark + 1:), *) magnitude
    if (magnitude >= -4 .and. magnitude < max(n, 6)) then
      write (form, '(a,i0,a)') '(f40.', max(0, n - 1 - magnitude), ')'
      write (buffer, form) value
      text = without_trailing_zeros(trim(adjustl(buffer)))
      if (text(1:1) == '.') text = '0'//text
      if (len(text) > 1) then
        if (text(1:2) == '-.') text = '-0'//text(2:)
      end if
    else
      text = without_trailing_zeros(buffer(:mark - 1))//'e'//text_of_long(int(magnitude, int64))
    end if
  end function text_of_real

  !> "1.500" to "1.5", "2." to "2".
  pure function without_trailing_zeros(digits) result(text)
    character(*), intent(in) :: digits  !! Decimal digits, maybe with a point.
    character(:), allocatable :: text
    integer :: last
    last = len(digits)
    if (index(digits, '.') > 0) then
      do while (digits(last:last) == '0')
        last = last - 1
      end do
      if (digits(last:last) == '.') last = last - 1
    end if
    text = digits(:last)
  end function without_trailing_zeros

  !> ASCII lower case.
  pure function lower(text) result(lowered)
    character(*), intent(in) :: text  !! Any text.
    character(len(text)) :: lowered
    integer :: i, code
    do i = 1, len(text)
      code = iachar(text(i:i))
      if (code >= iachar('A') .and. code <= iachar('Z')) code = code + 32
      lowered(i:i) = achar(code)
    end do
  end function lower

  !> A text in lower case without blanks, hyphens and underscores.
  pure function squeezed(text)
    character(*), intent(in) :: text  !! Any text.
    character(len(text)) :: squeezed
    integer :: i, n
    squeezed = ''
    n = 0
    do i = 1, len(text)
      if (index(' -_', text(i:i)) > 0) cycle
      n = n + 1
      squeezed(n:n) = text(i:i)
    end do
    squeezed = lower(squeezed)
  end function squeezed

  !> Name of a list that is nearest to a misspelled one; empty where none is near.
  pure function nearest_name(name, names) result(nearest)
    character(*), intent(in) :: name  !! Name as written.
    type(text_t), intent(in) :: names(:)  !! Names that may be meant (n).
    character(:), allocatable :: nearest
    integer :: i, distance, least
    nearest = ''
    ! One change in three letters is still likely to be a misspelling.
    least = max(1, (len_trim(name) + 1)/3) + 1
    do i = 1, size(names)
      ! 'Face14' is 'face 14', not 'face 4'.
      if (squeezed(name) == squeezed(names(i)%s)) then
        nearest = names(i)%s
        return
      end if
      if (abs(len_trim(name) - len(names(i)%s)) >= least) cycle
      distance = edit_distance(lower(trim(name)), lower(names(i)%s))
      if (distance < least) then
        least = distance
        nearest = names(i)%s
      end if
    end do
  end function nearest_name

  !> Optimal string alignment distance: insertions, deletions, changes and swaps of neighbours, each counted as 1.
  pure integer function edit_distance(a, b) result(distance)
    character(*), intent(in) :: a  !! First word.
    character(*), intent(in) :: b  !! Second word.
    integer :: d(0:len(a), 0:len(b))
    integer :: i, j, p, q, cost
    d(:, 0) = [(i, i=0, len(a))]
    d(0, :) = [(j, j=0, len(b))]
    do j = 1, len(b)
      do i = 1, len(a)
        cost = merge(0, 1, a(i:i) == b(j:j))
        d(i, j) = min(d(i - 1, j) + 1, d(i, j - 1) + 1, d(i - 1, j - 1) + cost)
        if (min(i, j) == 1) cycle
        p = i - 1
        q = j - 1
        if (a(i:i) == b(q:q) .and. a(p:p) == b(j:j)) d(i, j) = min(d(i, j), d(p - 1, q - 1) + 1)
      end do
    end do
    distance = d(len(a), len(b))
  end function edit_distance

  !> Texts joined with a separator.
  pure function join(texts, separator) result(joined)
    type(text_t), intent(in) :: texts(:)  !! Texts to join (n).
    character(*), intent(in) :: separator  !! Text between two of them.
    character(:), allocatable :: joined
    integer :: i
    joined = ''
    do i = 1, size(texts)
      if (i > 1) joined = joined//separator
      joined = joined//texts(i)%s
    end do
  end function join

  !> A number with its noun: "1 body", "2 bodies".
  pure function counted(n, one, many) result(text)
    integer, intent(in) :: n  !! The number.
    character(*), intent(in) :: one  !! Singular.
    character(*), intent(in), optional :: many  !! Plural; the singular with an s if absent.
    character(:), allocatable :: text
    if (n == 1) then
      text = '1 '//one
    else if (present(many)) then
      text = text_of_integer(n)//' '//many
    else
      text = text_of_integer(n)//' '//one//'s'
    end if
  end function counted

  !> A name between single quotes, for messages.
  pure function quoted(name) result(text)
    character(*), intent(in) :: name  !! Name; trailing blanks are dropped.
    character(:), allocatable :: text
    text = "'"//trim(name)//"'"
  end function quoted

  !> Text of the user for a message: in quotes, not too long, without control characters.
  pure function shown(text) result(quoted_text)
    character(*), intent(in) :: text  !! Text of the user.
    character(:), allocatable :: quoted_text
    integer, parameter :: most = 48
    integer :: i, n
    n = len(text)
    if (n > most) then
      n = most
      ! Do not cut a letter of several bytes in two: its later bytes are 128 to 191.
      do while (n > 1 .and. iachar(text(n + 1:n + 1)) >= 128 .and. iachar(text(n + 1:n + 1)) < 192)
        n = n - 1
      end do
    end if
    quoted_text = "'"//text(:n)
    do i = 2, len(quoted_text)
      if (iachar(quoted_text(i:i)) < 32 .or. iachar(quoted_text(i:i)) == 127) quoted_text(i:i) = '?'
    end do
    if (n < len(text)) quoted_text = quoted_text//'...'
    quoted_text = quoted_text//"'"
  end function shown

  !> Like `shown`, without the quotes around.
  pure function visible(text) result(rest)
    character(*), intent(in) :: text  !! Text of the user.
    character(:), allocatable :: rest
    rest = shown(text)
    rest = rest(2:len(rest) - 1)
  end function visible

  !> " (did you mean 'young'?)", or nothing where no name is near.
  pure function suggestion(name, names) result(hint)
    character(*), intent(in) :: name  !! Name as written.
    type(text_t), intent(in) :: names(:)  !! Names that are known (n).
    character(:), allocatable :: hint
    hint = nearest_name(name, names)
    if (len(hint) > 0) hint = ' (did you mean '//shown(hint)//'?)'
  end function suggestion

  !> Append a text to a list. (gfortran 12 leaks the components of constructors within array constructors.)
  pure subroutine append_text(list, text)
    type(text_t), allocatable, intent(inout) :: list(:)  !! Texts so far; none where it is not allocated (n).
    character(*), intent(in) :: text  !! The last one.
    type(text_t), allocatable :: longer(:)
    integer :: n
    n = 0
    if (allocated(list)) n = size(list)
    allocate (longer(n + 1))
    if (n > 0) longer(:n) = list
    longer(n + 1)%s = text
    call move_alloc(longer, list)
  end subroutine append_text

  !> Split a text at blanks.
  pure subroutine split_words(text, words)
    character(*), intent(in) :: text  !! Words separated by blanks.
    type(text_t), allocatable, intent(out) :: words(:)  !! Its words (n); none where the text is blank.
    integer :: i, n, first
    n = 0
    do i = 1, len(text)
      if (starts_word(text, i)) n = n + 1
    end do
    allocate (words(n))
    n = 0
    first = 1
    do i = 1, len(text)
      if (starts_word(text, i)) first = i
      if (text(i:i) == ' ') cycle
      if (i < len(text)) then
        if (text(i + 1:i + 1) /= ' ') cycle
      end if
      n = n + 1
      words(n)%s = text(first:i)
    end do
  end subroutine split_words

  !> Whether a word starts at a place.
  pure logical function starts_word(text, i) result(starts)
    character(*), intent(in) :: text  !! Words separated by blanks.
    integer, intent(in) :: i  !! Place in the text.
    starts = text(i:i) /= ' '
    if (starts .and. i > 1) starts = text(i - 1:i - 1) == ' '
  end function starts_word

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

  !> A point for messages, as in "(1.5, 0, 2)".
  pure function point_text(x) result(text)
    real(dp), intent(in) :: x(:)  !! Coordinates of the point (dim) [length].
    character(:), allocatable :: text
    integer :: i
    text = '('
    do i = 1, size(x)
      if (i > 1) text = text//', '
      text = text//to_text(x(i))
    end do
    text = text//')'
  end function point_text
end module dotyk_base_text
