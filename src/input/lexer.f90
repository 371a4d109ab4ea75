!> Splits a namelist into tokens; comments, blanks, tabs, line ends and a byte order mark are skipped.
module dotyk_input_lexer
  use dotyk_base_text, only: lower, shown, to_text, visible
  use dotyk_input_problems, only: problems_t
  implicit none
  private

  !> Kinds of tokens.
  integer, parameter, public :: token_end = 0      !< end of the text
  integer, parameter, public :: token_group = 1    !< `&name`: a group begins (`&end`: ends); the text is the name
  integer, parameter, public :: token_close = 2    !< `/`: a group ends
  integer, parameter, public :: token_equals = 3   !< `=`
  integer, parameter, public :: token_comma = 4    !< `,`
  integer, parameter, public :: token_word = 5     !< a key, a number, a logical
  integer, parameter, public :: token_quoted = 6   !< a text in quotes; the text is what is between them

  type, public :: token_t  !! One token.
    integer :: kind = token_end  !! One of `token_*`.
    integer :: line = 0  !! Line of the file.
    integer :: repeat = 1  !! Repeat count of a text in quotes, as in 3*'0'.
    logical :: cut = .false.  !! Whether the closing quote is missing in the line.
    character(:), allocatable :: text  !! Its text: name of a group, word, or contents of the quotes.
  end type token_t

  type, public :: lexer_t  !! Position in a text that is read token by token.
    private
    integer :: next = 1  !! Next byte.
    integer :: line = 1  !! Its line.
    logical :: inside = .false.  !! Whether the position is inside a group.
  contains
    procedure :: read_token
  end type lexer_t

  character(*), parameter :: tab = achar(9), line_feed = achar(10), carriage_return = achar(13)
  !> What ends a word.
  character(*), parameter :: ends_word = ' '//tab//line_feed//carriage_return//',=/!&''"'
  !> What may follow a text in quotes.
  character(*), parameter :: ends_quoted = ' '//tab//line_feed//carriage_return//',=/!&'
  integer, parameter, public :: most_repeats = 1000  !! Greatest repeat count.

  public :: split_repeat

contains

  !> The next token of a text.
  subroutine read_token(self, text, problems, token)
    class(lexer_t), intent(inout) :: self
    character(*), intent(in) :: text  !! The whole text, the same at each call.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(token_t), intent(out) :: token  !! The token; `token_end` behind the end of the text.
    token%text = ''
    do
      call skip_blanks(self, text)
      token%line = self%line
      if (self%next > len(text)) then
        token%kind = token_end
        return
      end if
      if (self%inside .or. text(self%next:self%next) == '&') exit
      call skip_outside(self, text, problems)
    end do
    select case (text(self%next:self%next))
    case ('&')
      self%next = self%next + 1
      token%kind = token_group
      token%text = word_at(self, text)
      self%inside = lower(token%text) /= 'end'
    case ('/')
      self%next = self%next + 1
      token%kind = token_close
      self%inside = .false.
    case ('=')
      self%next = self%next + 1
      token%kind = token_equals
    case (',')
      self%next = self%next + 1
      token%kind = token_comma
    case ('''', '"')
      call read_quoted(self, text, problems, token)
    case default
      call read_word(self, text, problems, token)
    end select
  end subroutine read_token

  !> Skip blanks, line ends and comments.
  subroutine skip_blanks(self, text)
    type(lexer_t), intent(inout) :: self  !! Position in the text; moved.
    character(*), intent(in) :: text  !! The whole text.
    if (self%next == 1 .and. len(text) >= 3) then
      ! The byte order mark of UTF-8.
      if (text(1:3) == char(239)//char(187)//char(191)) self%next = 4
    end if
    do while (self%next <= len(text))
      select case (text(self%next:self%next))
      case (' ', tab, carriage_return)
        self%next = self%next + 1
      case (line_feed)
        self%next = self%next + 1
        self%line = self%line + 1
      case ('!')
        do while (self%next <= len(text))
          if (text(self%next:self%next) == line_feed) exit
          self%next = self%next + 1
        end do
      case default
        exit
      end select
    end do
  end subroutine skip_blanks

  !> Report text between groups, up to the next group, comment or line end.
  subroutine skip_outside(self, text, problems)
    type(lexer_t), intent(inout) :: self  !! Position in the text; moved.
    character(*), intent(in) :: text  !! The whole text.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    integer :: first
    first = self%next
    do while (self%next <= len(text))
      if (index('&!'//line_feed//carriage_return, text(self%next:self%next)) > 0) exit
      self%next = self%next + 1
    end do
    call problems%add(self%line, 'text outside the groups: '//shown(trim(text(first:self%next - 1))))
  end subroutine skip_outside

  !> The word at the position, maybe empty; the position moves behind it.
  function word_at(self, text) result(word)
    type(lexer_t), intent(inout) :: self  !! Position in the text; moved.
    character(*), intent(in) :: text  !! The whole text.
    character(:), allocatable :: word
    integer :: first
    first = self%next
    do while (self%next <= len(text))
      if (index(ends_word, text(self%next:self%next)) > 0) exit
      self%next = self%next + 1
    end do
    word = text(first:self%next - 1)
  end function word_at

  !> Read a word, or a text in quotes with a repeat count in front.
  subroutine read_word(self, text, problems, token)
    type(lexer_t), intent(inout) :: self  !! Position in the text; moved.
    character(*), intent(in) :: text  !! The whole text.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(token_t), intent(inout) :: token  !! The token; kind and text are set.
    character(:), allocatable :: rest
    integer :: count
    token%kind = token_word
    token%text = word_at(self, text)
    if (self%next > len(text)) return
    if (index('''"', text(self%next:self%next)) == 0) return
    call split_repeat(token%text, count, rest)
    if (count >= 0 .and. len(rest) == 0) then
      if (count == 0) call problems%add(self%line, repeat_message(token%text))
      call read_quoted(self, text, problems, token)
      token%repeat = max(count, 1)
    else
      call problems%add(self%line, 'a comma or a blank is missing after '//shown(token%text))
    end if
  end subroutine read_word

  !> Read a text in quotes; a doubled quote stands for one.
  subroutine read_quoted(self, text, problems, token)
    type(lexer_t), intent(inout) :: self  !! Position in the text; moved.
    character(*), intent(in) :: text  !! The whole text.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(token_t), intent(inout) :: token  !! The token; kind and text are set.
    character :: quote
    integer :: first, place, n
    logical :: closed
    token%kind = token_quoted
    deallocate (token%text)
    quote = text(self%next:self%next)
    first = self%next + 1
    ! The end first, then one copy: a text that grows by each doubled quote takes quadratic time.
    closed = .false.
    self%next = first
    do while (self%next <= len(text))
      if (text(self%next:self%next) == line_feed) exit
      if (text(self%next:self%next) == quote) then
        closed = .not. is_at(text, self%next + 1, quote)
        if (closed) exit
        self%next = self%next + 1
      end if
      self%next = self%next + 1
    end do
    allocate (character(self%next - first) :: token%text)
    n = 0
    place = first
    do while (place < self%next)
      n = n + 1
      token%text(n:n) = text(place:place)
      place = place + merge(2, 1, text(place:place) == quote)
    end do
    token%text = token%text(:n)
    if (closed) self%next = self%next + 1
    if (.not. closed) then
      token%cut = .true.
      call problems%add(token%line, 'a quote is not closed: '//quote//visible(token%text))
    else if (self%next <= len(text)) then
      if (index(ends_quoted, text(self%next:self%next)) == 0) &
        call problems%add(self%line, 'a comma or a blank is missing after '//shown(token%text))
    end if
  end subroutine read_quoted

  !> Whether a letter is at a place of a text.
  pure logical function is_at(text, place, letter)
    character(*), intent(in) :: text  !! The text.
    integer, intent(in) :: place  !! The place, maybe behind the end.
    character, intent(in) :: letter  !! The letter.
    is_at = .false.
    if (place <= len(text)) is_at = text(place:place) == letter
  end function is_at

  !> Split "3*0" into 3 and "0".
  pure subroutine split_repeat(word, count, rest)
    character(*), intent(in) :: word  !! Word, maybe with a repeat count.
    integer, intent(out) :: count  !! The count; -1 where there is none, 0 where it is not from 1 to `most_repeats`.
    character(:), allocatable, intent(out) :: rest  !! Part behind the star; the whole word where there is no count.
    integer :: star
    count = -1
    rest = word
    star = index(word, '*')
    if (star < 2) return
    if (verify(word(:star - 1), '0123456789') > 0) return
    rest = word(star + 1:)
    count = 0
    if (star - 1 > 4) return
    read (word(:star - 1), *) count
    if (count > most_repeats) count = 0
  end subroutine split_repeat

  !> The message for a bad repeat count.
  pure function repeat_message(word) result(message)
    character(*), intent(in) :: word  !! Word with the count.
    character(:), allocatable :: message
    message = 'a repeat count must be from 1 to '//to_text(most_repeats)//', got '//shown(word)
  end function repeat_message
end module dotyk_input_lexer
