!> Reads groups, keys and values from a text: the syntax of the namelist, not the meaning of names.
module dotyk_input_reader
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: lower, shown, to_text
  use dotyk_input_lexer, only: lexer_t, most_repeats, split_repeat, token_close, token_comma, token_end, token_equals, &
    token_group, token_quoted, token_t, token_word
  use dotyk_input_problems, only: problems_t
  implicit none
  private

  !> One value as written.
  type, public :: value_t
    !> Its text, without quotes.
    character(:), allocatable :: text
    !> Line of the file.
    integer :: line = 0
    !> Whether it is in quotes.
    logical :: quoted = .false.
  end type value_t

  !> One key with its values.
  type, public :: entry_t
    !> Its name in lower case.
    character(:), allocatable :: key
    !> Line of the key.
    integer :: line = 0
    !> Number of values.
    integer :: n_values = 0
    !> Values as written; the first `n_values` are in use (n_allocated).
    type(value_t), allocatable :: value(:)
    !> Whether it has no mistake so far. Checks skip what depends on unusable keys.
    logical :: usable = .true.
    !> Whether it is a default of the table of keywords, not given in the file.
    logical :: from_default = .false.
    !> Checked values of a real key (n_values) [unit of the key].
    real(dp), allocatable :: reals(:)
    !> Checked values of an integer key (n_values), or the options that its names stand for (n_names).
    integer, allocatable :: integers(:)
    !> Checked values of a logical key (n_values).
    logical, allocatable :: logicals(:)
  end type entry_t

  !> One group.
  type, public :: group_t
    !> Its name in lower case.
    character(:), allocatable :: name
    !> Line of its beginning.
    integer :: line = 0
    !> Number of keys.
    integer :: n_entries = 0
    !> Keys; the first `n_entries` are in use (n_allocated).
    type(entry_t), allocatable :: entry(:)
    !> Whether further keys were dropped.
    logical, private :: full = .false.
  end type group_t

  public :: read_groups, add_entry, add_value

  !> Greatest numbers of groups, keys of a group and values of a key, far above any real input: the rest is dropped.
  integer, parameter :: most_groups = 200000, most_keys = 200, most_values = 1000

contains

  !> Read all groups of a text.
  subroutine read_groups(text, problems, groups)
    !> The text of the file.
    character(*), intent(in) :: text
    !> Problems of the file; mistakes of syntax are added.
    type(problems_t), intent(inout) :: problems
    !> Groups in the order of the file (n_groups).
    type(group_t), allocatable, intent(out) :: groups(:)
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
    !> Group to move; empty on return.
    type(group_t), intent(inout) :: from
    !> The moved group.
    type(group_t), intent(inout) :: to
    to%line = from%line
    to%n_entries = from%n_entries
    call move_alloc(from%name, to%name)
    call move_alloc(from%entry, to%entry)
  end subroutine move_group

  !> Read one group.
  subroutine read_group(lexer, text, problems, token, group)
    !> Position in the text.
    type(lexer_t), intent(inout) :: lexer
    !> The text of the file.
    character(*), intent(in) :: text
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    !> Its first token; on return the first token behind the group.
    type(token_t), intent(inout) :: token
    !> The group; keys and values as written are added.
    type(group_t), intent(inout) :: group
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
    !> Group of the key.
    type(group_t), intent(inout) :: group
    !> Token with the name of the key.
    type(token_t), intent(in) :: word
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    integer :: mark
    if (group%n_entries == most_keys .and. .not. group%full) then
      call problems%add(word%line, '&'//group%name//': more than '//to_text(most_keys)//' keys; those from '// &
                        shown(word%text)//' on are not looked at')
      group%full = .true.
    end if
    if (group%full) return
    mark = scan(word%text, '(%')
    if (mark > 1) then
      call add_entry(group, lower(word%text(:mark - 1)), word%line)
      group%entry(group%n_entries)%usable = .false.
      call problems%add(word%line, '&'//group%name//': '//shown(word%text)// &
                        ': write all values of a key at once, without parentheses')
    else
      call add_entry(group, lower(word%text), word%line)
    end if
  end subroutine begin_key

  !> Add a word as value, maybe with a repeat count.
  subroutine add_word(group, word, problems)
    !> Group; the value is added to its last key.
    type(group_t), intent(inout) :: group
    !> Token with the value.
    type(token_t), intent(in) :: word
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
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
    !> Group; the value is added to its last key.
    type(group_t), intent(inout) :: group
    !> Token with the value, for its line.
    type(token_t), intent(in) :: token
    !> Repeat count.
    integer, intent(in) :: count
    !> Value as written.
    character(*), intent(in) :: text
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    integer :: i
    if (group%full) return
    if (group%n_entries == 0) then
      call problems%add(token%line, '&'//group%name//': a value without a key before it: '//shown(text))
      return
    end if
    do i = 1, count
      call add_value(group%entry(group%n_entries), text, token%line, token%kind == token_quoted)
    end do
    ! The lexer has reported a text without closing quote.
    if (token%cut) call spoil_last(group)
  end subroutine add_values

  !> Report a missing value.
  subroutine report_missing_value(group, line, problems)
    !> Group; its last key becomes unusable.
    type(group_t), intent(inout) :: group
    !> Line of the missing value.
    integer, intent(in) :: line
    !> Problems of the file; mistakes are added.
    type(problems_t), intent(inout) :: problems
    if (group%n_entries == 0) then
      call problems%add(line, '&'//group%name//': a value without a key before it: '',''')
    else if (group%entry(group%n_entries)%usable) then
      call problems%add(line, '&'//group%name//': a value of '//shown(group%entry(group%n_entries)%key)//' is missing')
      call spoil_last(group)
    end if
  end subroutine report_missing_value

  !> Mark the last key as unusable, because of a mistake that is reported already.
  subroutine spoil_last(group)
    !> Group; its last key becomes unusable.
    type(group_t), intent(inout) :: group
    if (group%n_entries > 0) group%entry(group%n_entries)%usable = .false.
  end subroutine spoil_last

  !> Add a key without values to a group.
  subroutine add_entry(group, key, line)
    !> Group; the key is added.
    type(group_t), intent(inout) :: group
    !> Name of the key.
    character(*), intent(in) :: key
    !> Line of the key.
    integer, intent(in) :: line
    type(entry_t), allocatable :: longer(:)
    integer :: i
    if (group%n_entries == size(group%entry)) then
      allocate (longer(max(8, 2*group%n_entries)))
      do i = 1, group%n_entries
        longer(i) = group%entry(i)
      end do
      call move_alloc(longer, group%entry)
    end if
    group%n_entries = group%n_entries + 1
    associate (entry => group%entry(group%n_entries))
      entry%key = key
      entry%line = line
      allocate (entry%value(4))
    end associate
  end subroutine add_entry

  !> Add a value to a key, up to the greatest number.
  subroutine add_value(entry, text, line, quoted)
    !> Key; the value is added.
    type(entry_t), intent(inout) :: entry
    !> Value as written.
    character(*), intent(in) :: text
    !> Line of the value.
    integer, intent(in) :: line
    !> Whether it is in quotes.
    logical, intent(in) :: quoted
    type(value_t), allocatable :: longer(:)
    integer :: i
    if (entry%n_values == most_values) return
    if (entry%n_values == size(entry%value)) then
      allocate (longer(2*entry%n_values))
      do i = 1, entry%n_values
        longer(i) = entry%value(i)
      end do
      call move_alloc(longer, entry%value)
    end if
    entry%n_values = entry%n_values + 1
    entry%value(entry%n_values)%text = text
    entry%value(entry%n_values)%line = line
    entry%value(entry%n_values)%quoted = quoted
  end subroutine add_value
end module dotyk_input_reader
