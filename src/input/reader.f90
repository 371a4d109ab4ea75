!> Reads groups, keys and values from a text: the syntax of the namelist, not the meaning of names.
module dotyk_input_reader
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: lower, shown, to_text
  use dotyk_input_lexer, only: lexer_t, most_repeats, split_repeat, token_close, token_comma, token_end, token_equals, &
    token_group, token_quoted, token_t, token_word
  use dotyk_input_problems, only: problems_t
  implicit none
  private

  type, public :: value_t  !! One value as written.
    character(:), allocatable :: text  !! Its text, without quotes.
    integer :: line = 0  !! Line of the file.
    logical :: quoted = .false.  !! Whether it is in quotes.
  end type value_t

  type, public :: entry_t  !! One key with its values.
    character(:), allocatable :: key  !! Its name in lower case.
    integer :: line = 0  !! Line of the key.
    integer :: n_values = 0  !! Number of values.
    type(value_t), allocatable :: value(:)  !! Values as written; the first `n_values` are in use (n_allocated).
    logical :: usable = .true.  !! Whether it has no mistake so far. Checks skip what depends on unusable keys.
    logical :: from_default = .false.  !! Whether it is a default of the table of keywords, not given in the file.
    real(dp), allocatable :: reals(:)  !! Checked values of a real key (n_values) [unit of the key].
    !> Checked values of an integer key (n_values), or the options that its names stand for (n_names).
    integer, allocatable :: integers(:)
    logical, allocatable :: logicals(:)  !! Checked values of a logical key (n_values).
  end type entry_t

  type, public :: group_t  !! One group.
    character(:), allocatable :: name  !! Its name in lower case.
    integer :: line = 0  !! Line of its beginning.
    integer :: n_entries = 0  !! Number of keys.
    type(entry_t), allocatable :: entry(:)  !! Keys; the first `n_entries` are in use (n_allocated).
    logical, private :: full = .false.  !! Whether further keys were dropped.
  end type group_t

  public :: read_groups, add_entry, add_value

  !> Greatest numbers of groups, keys of a group and values of a key, far above any real input: the rest is dropped.
  integer, parameter :: most_groups = 200000, most_keys = 200, most_values = 1000

contains

  !> Read all groups of a text.
  subroutine read_groups(text, problems, groups)
    character(*), intent(in) :: text  !! The text of the file.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes of syntax are added.
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
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
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
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
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
    type(group_t), intent(inout) :: group  !! Group; the value is added to its last key.
    type(token_t), intent(in) :: word  !! Token with the value.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
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
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
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
    type(group_t), intent(inout) :: group  !! Group; its last key becomes unusable.
    integer, intent(in) :: line  !! Line of the missing value.
    type(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
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

  !> Add a key without values to a group.
  subroutine add_entry(group, key, line)
    type(group_t), intent(inout) :: group  !! Group; the key is added.
    character(*), intent(in) :: key  !! Name of the key.
    integer, intent(in) :: line  !! Line of the key.
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
    type(entry_t), intent(inout) :: entry  !! Key; the value is added.
    character(*), intent(in) :: text  !! Value as written.
    integer, intent(in) :: line  !! Line of the value.
    logical, intent(in) :: quoted  !! Whether it is in quotes.
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
