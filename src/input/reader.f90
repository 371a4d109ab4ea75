!> Reads groups, keys and values from the tokens of a text: the syntax of the namelist, not the meaning of names.
!> Comments, blanks, tabs, line ends and a byte order mark are skipped.
module dotyk_input_reader
  use dotyk_base_text, only: lower, shown, to_text, visible
  use dotyk_input_groups, only: group_t
  use dotyk_input_problems, only: problems_t
  implicit none
  private
  public :: read_groups

  !> Greatest numbers of groups and of keys of a group, far above any real input: the rest is dropped.
  integer, parameter :: most_groups = 200000, most_keys = 200

  !> Kinds of tokens.
  integer, parameter :: token_end = 0      !< end of the text
  integer, parameter :: token_group = 1    !< `&name`: a group begins (`&end`: ends); the text is the name
  integer, parameter :: token_close = 2    !< `/`: a group ends
  integer, parameter :: token_equals = 3   !< `=`
  integer, parameter :: token_comma = 4    !< `,`
  integer, parameter :: token_word = 5     !< a key, a number, a logical
  integer, parameter :: token_quoted = 6   !< a text in quotes; the text is what is between them

  type :: token_t  !! One token.
    integer :: kind = token_end  !! One of `token_*`.
    integer :: line = 0  !! Line of the file.
    integer :: repeat = 1  !! Repeat count of a text in quotes, as in 3*'0'.
    logical :: cut = .false.  !! Whether the closing quote is missing in the line.
    character(:), allocatable :: text  !! Its text: name of a group, word, or contents of the quotes.
  end type token_t

  type :: lexer_t  !! Position in a text that is read token by token.
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
  integer, parameter :: most_repeats = 1000  !! Greatest repeat count.

contains

  !> Read all groups of a text.
  subroutine read_groups(text, problems, groups)
    character(*), intent(in) :: text  !! The text of the file.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes of syntax are added.
    type(group_t), allocatable, intent(out) :: groups(:)  !! Groups in the order of the file (n_groups).
    type(group_t), allocatable :: longer(:)
    type(lexer_t) :: lexer
    type(token_t) :: token
    integer :: n, i
    allocate (groups(16))
    n = 0
    call lexer%read_token(text, problems, token)
    do while (token%kind /= token_end)
      if (lower(token%text) == 'end') then
        call problems%add(token%line, 'text outside the groups: '//shown('&'//token%text))
        call lexer%read_token(text, problems, token)
        cycle
      end if
      if (n == most_groups) then
        call problems%add(token%line, 'more than '//to_text(most_groups)// &
                          ' groups; those from here on are not looked at')
        exit
      end if
      if (n == size(groups)) then
        allocate (longer(2*n))
        do i = 1, n
          call move_group(groups(i), longer(i))
        end do
        call move_alloc(longer, groups)
      end if
      n = n + 1
      ! Outside a group the lexer gives only the beginning of one.
      call read_group(lexer, text, problems, token, groups(n))
    end do
    allocate (longer(n))
    do i = 1, n
      call move_group(groups(i), longer(i))
    end do
    call move_alloc(longer, groups)
  end subroutine read_groups

  !> Move a group without copying its keys.
  subroutine move_group(from, to)
    type(group_t), intent(inout) :: from  !! Group to move; empty on return.
    type(group_t), intent(inout) :: to  !! The moved group.
    to%line = from%line
    to%n_entries = from%n_entries
    call move_alloc(from%name, to%name)
    call move_alloc(from%entry, to%entry)
  end subroutine move_group

  !> Read one group.
  subroutine read_group(lexer, text, problems, token, group)
    type(lexer_t), intent(inout) :: lexer  !! Position in the text.
    character(*), intent(in) :: text  !! The text of the file.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(token_t), intent(inout) :: token  !! Its first token; on return the first token behind the group.
    type(group_t), intent(inout) :: group  !! The group; keys and values as written are added.
    type(token_t) :: word
    logical :: cut, after_comma
    group%name = lower(token%text)
    group%line = token%line
    allocate (group%entry(0))
    if (len(group%name) == 0) call problems%add(token%line, 'the name of a group is missing after ''&''')
    cut = .false.
    ! A value is missing before a comma at the beginning and between two commas.
    after_comma = .true.
    call lexer%read_token(text, problems, token)
    do
      select case (token%kind)
      case (token_end)
        if (.not. cut) call problems%add(group%line, '&'//group%name//': the group is not ended with ''/''')
        return
      case (token_group)
        if (lower(token%text) == 'end') then
          call problems%add(token%line, '&'//group%name//': end a group with ''/'', not with ''&end''')
          call lexer%read_token(text, problems, token)
        else if (.not. cut) then
          call problems%add(group%line, '&'//group%name//': the group is not ended with ''/'' before '// &
                            shown('&'//token%text)//' in line '//to_text(token%line))
        end if
        return
      case (token_close)
        call lexer%read_token(text, problems, token)
        return
      case (token_equals)
        call problems%add(token%line, '&'//group%name//': ''='' without a key before it')
        call lexer%read_token(text, problems, token)
      case (token_comma)
        if (after_comma) call report_missing_value(group, token%line, problems)
        after_comma = .true.
        call lexer%read_token(text, problems, token)
      case (token_quoted)
        cut = cut .or. token%cut
        call add_values(group, token, token%repeat, token%text, problems)
        after_comma = .false.
        call lexer%read_token(text, problems, token)
      case (token_word)
        word = token
        call lexer%read_token(text, problems, token)
        if (token%kind == token_equals) then
          call begin_key(group, word, problems)
          after_comma = .true.
          call lexer%read_token(text, problems, token)
        else
          call add_word(group, word, problems)
          after_comma = .false.
        end if
      end select
    end do
  end subroutine read_group

  !> Begin a key.
  subroutine begin_key(group, word, problems)
    type(group_t), intent(inout) :: group  !! Group of the key.
    type(token_t), intent(in) :: word  !! Token with the name of the key.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    integer :: mark
    if (group%n_entries == most_keys .and. .not. group%full) then
      call problems%add(word%line, '&'//group%name//': more than '//to_text(most_keys)//' keys; those from '// &
                        shown(word%text)//' on are not looked at')
      group%full = .true.
    end if
    if (group%full) return
    mark = scan(word%text, '(%')
    if (mark > 1) then
      call group%add(lower(word%text(:mark - 1)), word%line)
      group%entry(group%n_entries)%usable = .false.
      call problems%add(word%line, '&'//group%name//': '//shown(word%text)// &
                        ': write all values of a key at once, without parentheses')
    else
      call group%add(lower(word%text), word%line)
    end if
  end subroutine begin_key

  !> Add a word as value, maybe with a repeat count.
  subroutine add_word(group, word, problems)
    type(group_t), intent(inout) :: group  !! Group; the value is added to its last key.
    type(token_t), intent(in) :: word  !! Token with the value.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    character(:), allocatable :: rest
    integer :: count
    call split_repeat(word%text, count, rest)
    if (count == 0) then
      call problems%add(word%line, '&'//group%name//': a repeat count must be from 1 to '//to_text(most_repeats)// &
                        ', got '//shown(word%text))
      call spoil_last(group)
    else if (len(rest) == 0) then
      call report_missing_value(group, word%line, problems)
    else
      call add_values(group, word, max(count, 1), rest, problems)
    end if
  end subroutine add_word

  !> Add a value to the last key, once or more often.
  subroutine add_values(group, token, count, text, problems)
    type(group_t), intent(inout) :: group  !! Group; the value is added to its last key.
    type(token_t), intent(in) :: token  !! Token with the value, for its line.
    integer, intent(in) :: count  !! Repeat count.
    character(*), intent(in) :: text  !! Value as written.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    integer :: i
    if (group%full) return
    if (group%n_entries == 0) then
      call problems%add(token%line, '&'//group%name//': a value without a key before it: '//shown(text))
      return
    end if
    do i = 1, count
      call group%entry(group%n_entries)%add(text, token%line, token%kind == token_quoted)
    end do
    ! The lexer has reported a text without closing quote.
    if (token%cut) call spoil_last(group)
  end subroutine add_values

  !> Report a missing value.
  subroutine report_missing_value(group, line, problems)
    type(group_t), intent(inout) :: group  !! Group; its last key becomes unusable.
    integer, intent(in) :: line  !! Line of the missing value.
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    if (group%n_entries == 0) then
      call problems%add(line, '&'//group%name//': a value without a key before it: '',''')
    else if (group%entry(group%n_entries)%usable) then
      call problems%add(line, '&'//group%name//': a value of '//shown(group%entry(group%n_entries)%key)//' is missing')
      call spoil_last(group)
    end if
  end subroutine report_missing_value

  !> Mark the last key as unusable, because of a mistake that is reported already.
  subroutine spoil_last(group)
    type(group_t), intent(inout) :: group  !! Group; its last key becomes unusable.
    if (group%n_entries > 0) group%entry(group%n_entries)%usable = .false.
  end subroutine spoil_last

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
end module dotyk_input_reader
