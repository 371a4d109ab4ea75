!> Reads groups, keys and values from a text: the syntax of the namelist, not the meaning of names.
module dotyk_input_reader
  use dotyk_base_text, only: lower, shown, to_text
  use dotyk_input_groups, only: group_t
  use dotyk_input_lexer, only: lexer_t, most_repeats, split_repeat, token_close, token_comma, token_end, token_equals, &
    token_group, token_quoted, token_t, token_word
  use dotyk_input_problems, only: problems_t
  implicit none
  private

  public :: read_groups

  !> Greatest numbers of groups and of keys of a group, far above any real input: the rest is dropped.
  integer, parameter :: most_groups = 200000, most_keys = 200

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
end module dotyk_input_reader
