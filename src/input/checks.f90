!> Groups against the table of keywords: unknown and missing names, numbers of values, types, ranges.
module dotyk_input_checks
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: has_usual_size, size_rule
  use dotyk_base_options, only: find_option
  use dotyk_base_text, only: join, nearest_name, shown, split_words, suggestion, text_t, to_text, visible
  use dotyk_input_conversion, only: number_good, number_malformed, number_out_of_range, read_integer, &
    read_logical, read_real
  use dotyk_input_keywords, only: at_least_one, at_most_one, exactly_one, group_keyword_t, &
    keys_of_group, keyword_t, kind_formula, kind_integer, kind_logical, kind_name, kind_names, kind_real, &
    kind_text, place_of_keyword
  use dotyk_input_problems, only: no_line, problems_t
  use dotyk_input_reader, only: add_entry, add_value, entry_t, group_t, value_t
  implicit none
  private
  public :: check_group_names, check_occurrences, check_group

contains

  !> Report unknown groups.
  subroutine check_group_names(groups, known, problems, meant)
    !> The groups of the file.
    type(group_t), intent(in) :: groups(:)
    !> The groups that there are.
    type(group_keyword_t), intent(in) :: known(:)
    type(problems_t), intent(inout) :: problems
    !> For each known group: may one of the unknown ones be a misspelling of it?
    logical, intent(out) :: meant(:)
    type(text_t) :: names(size(known))
    character(:), allocatable :: nearest, hint
    integer :: i, k
    do k = 1, size(known)
      names(k)%s = known(k)%name
    end do
    meant = .false.
    do i = 1, size(groups)
      if (len(groups(i)%name) == 0) cycle
      if (any([(known(k)%name == groups(i)%name, k=1, size(known))])) cycle
      nearest = nearest_name(groups(i)%name, names)
      hint = ' (did you mean ''&'//nearest//'''?)'
      if (len(nearest) == 0) hint = ' (groups are '//join(names, ', ')//')'
      call problems%add(groups(i)%line, 'unknown group '//shown('&'//groups(i)%name)//hint)
      do k = 1, size(known)
        if (known(k)%name == nearest) meant(k) = .true.
      end do
    end do
  end subroutine check_group_names

  !> Report groups that are missing or stand there too often.
  subroutine check_occurrences(groups, known, meant, problems)
    type(group_t), intent(in) :: groups(:)
    type(group_keyword_t), intent(in) :: known(:)
    !> Known groups that may be there, but misspelled.
    logical, intent(in) :: meant(:)
    type(problems_t), intent(inout) :: problems
    integer :: i, k, n, first
    do k = 1, size(known)
      n = 0
      first = 0
      do i = 1, size(groups)
        if (groups(i)%name /= known(k)%name) cycle
        n = n + 1
        if (n == 1) first = groups(i)%line
        if (n > 1 .and. (known(k)%occurs == exactly_one .or. known(k)%occurs == at_most_one)) &
          call problems%add(groups(i)%line, '&'//known(k)%name//': a second group (the first is in line '// &
                            to_text(first)//')')
      end do
      if (n == 0 .and. .not. meant(k) .and. (known(k)%occurs == exactly_one .or. known(k)%occurs == at_least_one)) &
        call problems%add(no_line, 'no &'//known(k)%name//' group')
    end do
  end subroutine check_occurrences

  !> Check the keys and values of one group, convert its values, and complete it with the defaults of the table.
  subroutine check_group(group, table, problems)
    type(group_t), intent(inout) :: group
    type(keyword_t), intent(in) :: table(:)
    type(problems_t), intent(inout) :: problems
    type(text_t), allocatable :: words(:)
    integer :: i, j, k, n
    do i = 1, group%n_entries
      k = place_of_keyword(table, group%name, group%entry(i)%key)
      if (k == 0) then
        call report_unknown_key(group, group%entry(i), table, problems)
        cycle
      end if
      do j = 1, i - 1
        if (group%entry(j)%key /= group%entry(i)%key) cycle
        call problems%add(group%entry(i)%line, '&'//group%name//': '''//group%entry(i)%key// &
                          ''' is given twice (first in line '//to_text(group%entry(j)%line)//')')
        exit
      end do
      if (group%entry(i)%usable) call check_entry(group%name, group%entry(i), table(k), problems)
    end do
    n = group%n_entries
    do k = 1, size(table)
      if (table(k)%group /= group%name) cycle
      if (any([(group%entry(i)%key == table(k)%key, i=1, n)])) cycle
      if (table(k)%required) then
        call problems%add(group%line, '&'//group%name//': '''//table(k)%key//''' is missing')
      else if (len(table(k)%default) > 0) then
        call add_entry(group, table(k)%key, group%line)
        call split_words(table(k)%default, words)
        if (table(k)%kind == kind_names) then
          deallocate (words)
          allocate (words(1))
          words(1)%s = table(k)%default
        end if
        associate (entry => group%entry(group%n_entries))
          entry%from_default = .true.
          do i = 1, size(words)
            call add_value(entry, words(i)%s, group%line, table(k)%kind >= kind_text)
          end do
        end associate
        call check_entry(group%name, group%entry(group%n_entries), table(k), problems)
      end if
    end do
  end subroutine check_group

  !> An unknown key: was another one meant, or another group?
  subroutine report_unknown_key(group, entry, table, problems)
    type(group_t), intent(in) :: group
    type(entry_t), intent(in) :: entry
    type(keyword_t), intent(in) :: table(:)
    type(problems_t), intent(inout) :: problems
    type(text_t), allocatable :: keys(:)
    character(:), allocatable :: hint
    integer :: k
    call keys_of_group(table, group%name, keys)
    hint = suggestion(entry%key, keys)
    if (len(hint) == 0) then
      do k = 1, size(table)
        if (table(k)%key == entry%key) hint = ' (it belongs to &'//table(k)%group//')'
      end do
    end if
    if (len(hint) == 0) hint = ' (keys are '//join(keys, ', ')//')'
    call problems%add(entry%line, '&'//group%name//': unknown key '//shown(entry%key)//hint)
  end subroutine report_unknown_key

  !> Check the values of one key and convert them.
  subroutine check_entry(group_name, entry, row, problems)
    character(*), intent(in) :: group_name
    type(entry_t), intent(inout) :: entry
    type(keyword_t), intent(in) :: row
    type(problems_t), intent(inout) :: problems
    character(:), allocatable :: message, place
    type(text_t), allocatable :: words(:)
    integer :: i
    if (entry%n_values < row%least .or. entry%n_values > row%most) then
      call problems%add(entry%line, '&'//group_name//': '//row%key//' needs '//needed_count(row)//', got '// &
                        to_text(entry%n_values))
      entry%usable = .false.
    end if
    if (row%kind == kind_names .and. entry%n_values == 1) then
      call split_words(entry%value(1)%text, words)
      allocate (entry%number(size(words)))
    else
      allocate (entry%number(entry%n_values))
    end if
    entry%number = 0
    do i = 1, entry%n_values
      place = ''
      if (row%most > 1 .and. row%kind == kind_formula) place = '('//to_text(i)//')'
      select case (row%kind)
      case (kind_real, kind_integer, kind_logical)
        message = number_message(entry%value(i), row, entry%number(i))
      case default
        message = text_message(entry%value(i), row, entry%number)
      end select
      if (len(message) == 0) cycle
      call problems%add(entry%value(i)%line, '&'//group_name//': '//row%key//place//message)
      entry%usable = .false.
    end do
  end subroutine check_entry

  !> "1 or 3 values".
  pure function needed_count(row) result(text)
    type(keyword_t), intent(in) :: row
    character(:), allocatable :: text
    text = to_text(row%least)
    if (row%most > row%least) text = text//' or '//to_text(row%most)
    text = text//' value'
    if (row%most > 1) text = text//'s'
  end function needed_count

  !> Convert a number and say what is wrong with it; an empty message where nothing is.
  function number_message(value, row, number) result(message)
    type(value_t), intent(in) :: value
    type(keyword_t), intent(in) :: row
    !> The number; 0 where there is none.
    real(dp), intent(out) :: number
    character(:), allocatable :: message
    character(:), allocatable :: needed
    integer :: status, whole
    number = 0
    message = ''
    needed = 'a real number'
    select case (row%kind)
    case (kind_real)
      call read_real(value%text, number, status)
    case (kind_integer)
      needed = 'an integer'
      call read_integer(value%text, whole, status)
      number = whole
    case default
      needed = '.true. or .false.'
      call read_logical(value%text, whole, status)
      number = whole
    end select
    if (value%quoted) status = number_malformed
    if (status == number_malformed) message = ' needs '//needed//', got '//shown(value%text)
    if (status == number_out_of_range) message = ': '//shown(value%text)//' is beyond the range of numbers'
    if (status == number_good .and. row%positive .and. .not. number > 0) &
      message = ' must be above 0, got '//shown(value%text)
    if (status == number_good .and. row%not_negative .and. .not. number >= 0) &
      message = ' must not be below 0, got '//shown(value%text)
    if (status == number_good .and. len(message) == 0 .and. row%kind == kind_real .and. row%measured) then
      if (.not. has_usual_size(number)) message = ': '//shown(value%text)//' is too large or too small: '//size_rule
    end if
  end function number_message

  !> Say what is wrong with a text; an empty message where nothing is.
  function text_message(value, row, places) result(message)
    type(value_t), intent(in) :: value
    type(keyword_t), intent(in) :: row
    !> The places of its names, where it consists of names.
    real(dp), intent(inout) :: places(:)
    character(:), allocatable :: message
    type(text_t), allocatable :: words(:)
    character(:), allocatable :: reason
    type(formula_t) :: formula
    type(error_t), allocatable :: error
    integer :: i, option
    message = ''
    if (.not. value%quoted) then
      message = ' needs a text in quotes, got '//visible(value%text)
      return
    end if
    if (len_trim(value%text) == 0) then
      if (.not. row%may_be_empty) message = ' is empty'
      return
    end if
    select case (row%kind)
    case (kind_formula)
      call formula%init(value%text, error)
      if (allocated(error)) message = ': '//error%message
      call formula%destroy()
    case (kind_name, kind_names)
      call split_words(value%text, words)
      if (row%kind == kind_name) then
        deallocate (words)
        allocate (words(1))
        words(1)%s = trim(adjustl(value%text))
      end if
      do i = 1, size(words)
        call find_option(row%names, words(i)%s, option, reason)
        if (option == 0) then
          message = ': '//shown(words(i)%s)//' '//reason
        else if (any(nint(places(:min(i - 1, size(places)))) == option)) then
          message = ': '//shown(words(i)%s)//' is named twice'
        end if
        if (len(message) > 0) return
        if (i <= size(places)) places(i) = option
      end do
    end select
  end function text_message
end module dotyk_input_checks
