!> Checks groups against the table of keywords: unknown and missing names, numbers of values, types, ranges. Values as
!> written are converted to numbers and logicals strictly: nothing is guessed, nothing is left over.
module dotyk_input_checks
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_magnitude, only: has_usual_size, size_rule
  use dotyk_base_options, only: find_option
  use dotyk_base_text, only: join, lower, nearest_name, shown, split_words, suggestion, text_t, to_text, visible
  use dotyk_input_groups, only: entry_t, group_t, pick_groups, value_t
  use dotyk_input_keywords, only: at_least_one, at_most_one, exactly_one, find_group, find_key, group_keyword_t, &
    keyword_t, kind_formula, kind_integer, kind_logical, kind_name, kind_names, kind_real, kind_text
  use dotyk_input_problems, only: no_line, problems_t
  implicit none
  private
  public :: check_group_names, check_occurrences, check_group, read_real, read_integer, read_logical

  integer, parameter, public :: number_good = 0, number_malformed = 1, number_out_of_range = 2  !! Of a conversion.

  character(*), parameter :: digits = '0123456789'

contains

  !> Report unknown groups.
  subroutine check_group_names(groups, table, problems, meant)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(group_keyword_t), intent(in) :: table(:)  !! Groups that the program knows (n_known).
    class(problems_t), intent(inout) :: problems  !! Problems of the file; unknown groups are added.
    logical, intent(out) :: meant(:)  !! Whether an unknown group may be a misspelling of a known one (n_known).
    type(text_t) :: names(size(table))
    character(:), allocatable :: nearest, hint
    integer :: i, k
    do k = 1, size(table)
      names(k)%s = table(k)%name
    end do
    meant = .false.
    do i = 1, size(groups)
      if (len(groups(i)%name) == 0 .or. find_group(table, groups(i)%name) > 0) cycle
      nearest = nearest_name(groups(i)%name, names)
      hint = ' (did you mean ''&'//nearest//'''?)'
      if (len(nearest) == 0) hint = ' (groups are '//join(names, ', ')//')'
      call problems%add(groups(i)%line, 'unknown group '//shown('&'//groups(i)%name)//hint)
      k = find_group(table, nearest)
      if (k > 0) meant(k) = .true.
    end do
  end subroutine check_group_names

  !> Report missing groups and groups that occur too often.
  subroutine check_occurrences(groups, table, meant, problems)
    type(group_t), intent(in) :: groups(:)  !! Groups of the file (n_groups).
    type(group_keyword_t), intent(in) :: table(:)  !! Groups that the program knows (n_known).
    logical, intent(in) :: meant(:)  !! Whether a known group may be in the file, misspelled (n_known).
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    integer, allocatable :: picked(:)
    integer :: i, k
    do k = 1, size(table)
      associate (occurs => table(k)%occurs, name => table(k)%name)
        call pick_groups(groups, name, picked)
        if (size(picked) == 0) then
          if (.not. meant(k) .and. any(occurs == [exactly_one, at_least_one])) &
            call problems%add(no_line, 'no &'//name//' group')
        else if (any(occurs == [exactly_one, at_most_one])) then
          do i = 2, size(picked)
            call problems%add(groups(picked(i))%line, '&'//name//': a second group (the first is in line '// &
                              to_text(groups(picked(1))%line)//')')
          end do
        end if
      end associate
    end do
  end subroutine check_occurrences

  !> Check keys and values of a group, convert its values, and add the defaults of the table.
  subroutine check_group(group, table, problems)
    type(group_t), intent(inout) :: group  !! Group as read; its values are converted, its defaults added.
    type(group_keyword_t), intent(in) :: table(:)  !! Groups that the program knows, this one among them (n_known).
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(text_t), allocatable :: words(:)
    integer :: i, j, k, n
    associate (known => table(find_group(table, group%name)))
      do i = 1, group%n_entries
        associate (entry => group%entry(i))
          k = find_key(known, entry%key)
          if (k == 0) then
            entry%usable = .false.
            call report_unknown_key(known, entry, table, problems)
            cycle
          end if
          do j = 1, i - 1
            if (group%entry(j)%key /= entry%key) cycle
            call problems%add(entry%line, '&'//group%name//': '''//entry%key//''' is given twice (first in line '// &
                              to_text(group%entry(j)%line)//')')
            exit
          end do
          if (entry%usable) call check_entry(group%name, entry, known%key(k), problems)
        end associate
      end do
      n = group%n_entries
      do k = 1, size(known%key)
        associate (row => known%key(k))
          if (any([(group%entry(i)%key == row%key, i=1, n)])) cycle
          if (row%required) call problems%add(group%line, '&'//group%name//': '''//row%key//''' is missing')
          if (len(row%default) == 0) cycle
          call group%add(row%key, group%line)
          associate (entry => group%entry(group%n_entries))
            entry%from_default = .true.
            call split_words(row%default, words)
            if (row%kind == kind_names) then
              call entry%add(row%default, group%line, .true.)
            else
              do i = 1, size(words)
                call entry%add(words(i)%s, group%line, row%kind >= kind_text)
              end do
            end if
            call check_entry(group%name, entry, row, problems)
          end associate
        end associate
      end do
    end associate
  end subroutine check_group

  !> Report an unknown key, with the nearest key or the group that has it.
  subroutine report_unknown_key(known, entry, table, problems)
    type(group_keyword_t), intent(in) :: known  !! Group of the key.
    type(entry_t), intent(in) :: entry  !! The unknown key.
    type(group_keyword_t), intent(in) :: table(:)  !! Groups that the program knows (n_known).
    class(problems_t), intent(inout) :: problems  !! Problems of the file; mistakes are added.
    type(text_t) :: keys(size(known%key))
    character(:), allocatable :: hint
    integer :: k
    do k = 1, size(keys)
      keys(k)%s = known%key(k)%key
    end do
    hint = suggestion(entry%key, keys)
    if (len(hint) == 0) then
      do k = 1, size(table)
        if (find_key(table(k), entry%key) > 0) hint = ' (it belongs to &'//table(k)%name//')'
      end do
    end if
    if (known%name == 'contact' .and. (index(entry%key, 'friction') > 0 .or. entry%key == 'mu')) &
      hint = ' (contact is without friction: there is no such coefficient)'
    if (len(hint) == 0) hint = ' (keys are '//join(keys, ', ')//')'
    call problems%add(entry%line, '&'//known%name//': unknown key '//shown(entry%key)//hint)
  end subroutine report_unknown_key

  !> Check the values of one key and convert them.
  subroutine check_entry(group_name, entry, row, problems)
    character(*), intent(in) :: group_name  !! Name of the group, for messages.
    type(entry_t), intent(inout) :: entry  !! Key with values as written; converted on return, or not usable.
    type(keyword_t), intent(in) :: row  !! Row of the key in the table of keywords.
    class(problems_t), intent(inout) :: problems  !! Mistakes are added.
    character(:), allocatable :: message, place
    integer :: i
    if (entry%n_values < row%least .or. entry%n_values > row%most) then
      call problems%add(entry%line, '&'//group_name//': '//row%key//' needs '//needed_count(row)//', got '// &
                        to_text(entry%n_values)//comma_hint(entry, row))
      entry%usable = .false.
    end if
    allocate (entry%reals(entry%n_values), source=0.0_dp)
    allocate (entry%logicals(entry%n_values), source=.false.)
    allocate (entry%integers(merge(0, entry%n_values, takes_options(row))), source=0)
    do i = 1, entry%n_values
      select case (row%kind)
      case (kind_real)
        message = real_message(entry%value(i), row, entry%reals(i))
        if (len(message) == 0 .and. i > 1) message = comma_message(entry%value(i - 1)%text, entry%value(i)%text)
      case (kind_integer)
        message = integer_message(entry%value(i), row, entry%integers(i))
      case (kind_logical)
        message = logical_message(entry%value(i), entry%logicals(i))
      case default
        message = text_message(entry%value(i), row)
        if (len(message) == 0 .and. takes_options(row)) message = options_message(entry%value(i), row, entry%integers)
      end select
      if (len(message) == 0) cycle
      place = ''
      if (entry%n_values > 1 .and. row%kind == kind_formula) place = '('//to_text(i)//')'
      call problems%add(entry%value(i)%line, '&'//group_name//': '//row%key//place//message)
      entry%usable = .false.
    end do
  end subroutine check_entry

  !> Whether the values of a key are names of options.
  pure logical function takes_options(row)
    type(keyword_t), intent(in) :: row  !! Row of the key.
    takes_options = row%kind == kind_name .or. row%kind == kind_names
  end function takes_options

  !> Number of values that a key needs: "1 or 3 values".
  pure function needed_count(row) result(text)
    type(keyword_t), intent(in) :: row  !! Row of the key.
    character(:), allocatable :: text
    text = to_text(row%least)
    if (row%most > row%least) text = text//trim(merge(' to', ' or', row%most > 3))//' '//to_text(row%most)
    text = text//' value'
    if (row%most > 1) text = text//'s'
  end function needed_count

  !> Convert a real; the message says what is wrong, and is empty where nothing is.
  function real_message(value, row, number) result(message)
    type(value_t), intent(in) :: value  !! The value as written.
    type(keyword_t), intent(in) :: row  !! Row of the key.
    real(dp), intent(out) :: number  !! The number; 0 where there is none [unit of the key].
    character(:), allocatable :: message
    integer :: status
    call read_real(value%text, number, status)
    message = status_message(value, status, 'a real number')
    if (len(message) == 0) message = sign_message(value, row, number)
    if (len(message) > 0 .or. .not. row%measured) return
    if (.not. has_usual_size(number)) message = ': '//shown(value%text)//' is too large or too small: '//size_rule
  end function real_message

  !> Of two integers with a comma between them, what is wrong where the second one is the decimals of the first: it
  !> begins with a zero as no number does; empty where nothing is.
  function comma_message(before, text) result(message)
    character(*), intent(in) :: before  !! A value as written.
    character(*), intent(in) :: text  !! The value after it.
    character(:), allocatable :: message
    message = ''
    if (.not. are_decimals(before, text) .or. len(text) < 2 .or. text(1:1) /= '0') return
    message = ': '//shown(before//','//text)//' are two values: decimals have a point, write '//before//'.'//text
  end function comma_message

  !> A hint where two integers stand for one value, as in 2,5.
  function comma_hint(entry, row) result(hint)
    type(entry_t), intent(in) :: entry  !! Key with values as written.
    type(keyword_t), intent(in) :: row  !! Row of the key.
    character(:), allocatable :: hint
    hint = ''
    if (row%kind /= kind_real .or. row%least > 1 .or. entry%n_values /= 2) return
    associate (first => entry%value(1)%text, second => entry%value(2)%text)
      if (are_decimals(first, second)) hint = ' (decimals have a point: '//first//'.'//second//')'
    end associate
  end function comma_hint

  !> Whether two values may be a number with a decimal comma: digits, and digits with an exponent at most.
  pure logical function are_decimals(first, second)
    character(*), intent(in) :: first, second  !! The values as written.
    character(*), parameter :: digits = '0123456789'
    are_decimals = .false.
    if (len(first) == 0 .or. len(second) == 0) return
    are_decimals = verify(first, '+-'//digits) == 0 .and. scan(first, digits) > 0 .and. &
      scan(second(1:1), digits) > 0 .and. verify(second, digits//'eEdD+-') == 0
  end function are_decimals

  !> Convert an integer; the message says what is wrong, and is empty where nothing is.
  function integer_message(value, row, number) result(message)
    type(value_t), intent(in) :: value  !! The value as written.
    type(keyword_t), intent(in) :: row  !! Row of the key.
    integer, intent(out) :: number  !! The number; 0 where there is none.
    character(:), allocatable :: message
    integer :: status
    call read_integer(value%text, number, status)
    message = status_message(value, status, 'an integer')
    if (len(message) == 0) message = sign_message(value, row, real(number, dp))
  end function integer_message

  !> Convert a logical; the message says what is wrong, and is empty where nothing is.
  function logical_message(value, truth) result(message)
    type(value_t), intent(in) :: value  !! The value as written.
    logical, intent(out) :: truth  !! The logical; false where there is none.
    character(:), allocatable :: message
    integer :: status
    call read_logical(value%text, truth, status)
    message = status_message(value, status, '.true. or .false.')
  end function logical_message

  !> The message for a value that cannot be converted; empty where it can.
  function status_message(value, status, needed) result(message)
    type(value_t), intent(in) :: value  !! The value as written.
    integer, intent(in) :: status  !! One of `number_*`.
    character(*), intent(in) :: needed  !! What is needed, as in "an integer".
    character(:), allocatable :: message
    message = ''
    if (value%quoted .or. status == number_malformed) then
      message = ' needs '//needed//', got '//shown(value%text)
    else if (status == number_out_of_range) then
      message = ': '//shown(value%text)//' is beyond the range of numbers'
    end if
  end function status_message

  !> The message for a number of the wrong sign; empty where it is right.
  function sign_message(value, row, number) result(message)
    type(value_t), intent(in) :: value  !! The value as written.
    type(keyword_t), intent(in) :: row  !! Row of the key.
    real(dp), intent(in) :: number  !! Its number [unit of the key].
    character(:), allocatable :: message
    message = ''
    if (row%positive .and. .not. number > 0) message = ' must be above 0, got '//shown(value%text)
    if (row%not_negative .and. .not. number >= 0) message = ' must not be below 0, got '//shown(value%text)
  end function sign_message

  !> What is wrong with a text or formula; empty where nothing is.
  function text_message(value, row) result(message)
    type(value_t), intent(in) :: value  !! The value as written.
    type(keyword_t), intent(in) :: row  !! Row of the key.
    character(:), allocatable :: message
    type(formula_t) :: formula
    type(error_t), allocatable :: error
    message = ''
    if (.not. value%quoted) then
      message = ' needs a text in quotes, got '//visible(value%text)
    else if (len_trim(value%text) == 0) then
      if (.not. row%may_be_empty) message = ' is empty'
    else if (row%kind == kind_formula) then
      call formula%init(value%text, error)
      if (allocated(error)) message = ': '//error%message
      call formula%destroy()
    end if
  end function text_message

  !> Convert names to options; the message says what is wrong, and is empty where nothing is.
  function options_message(value, row, options) result(message)
    type(value_t), intent(in) :: value  !! The value as written: one name, or names separated by blanks.
    type(keyword_t), intent(in) :: row  !! Row of the key, with the names that are allowed.
    integer, allocatable, intent(inout) :: options(:)  !! The options are added (n_names).
    character(:), allocatable :: message
    type(text_t), allocatable :: words(:)
    character(:), allocatable :: reason
    integer :: i, option
    message = ''
    call split_words(value%text, words)
    if (row%kind == kind_name) then
      ! One name: blanks inside it are a mistake of the name.
      if (size(words) > 1) then
        deallocate (words)
        allocate (words(1))
      end if
      if (size(words) == 1) words(1)%s = trim(adjustl(value%text))
    end if
    do i = 1, size(words)
      call find_option(row%names, words(i)%s, option, reason)
      if (option == 0) then
        message = ': '//shown(words(i)%s)//' '//reason
      else if (any(options == option)) then
        message = ': '//shown(words(i)%s)//' is named twice'
      end if
      if (len(message) > 0) return
      options = [options, option]
    end do
  end function options_message

  !> A real number: digits with at most one point, maybe an exponent after e or d.
  pure subroutine read_real(text, value, status)
    character(*), intent(in) :: text  !! Text of the value, without blanks.
    real(dp), intent(out) :: value  !! The number; 0 where there is none [any].
    integer, intent(out) :: status  !! One of `number_*`.
    character(:), allocatable :: mantissa, exponent
    integer :: mark, power, magnitude, first, point
    value = 0
    status = number_malformed
    mantissa = lower(text)
    exponent = '0'
    mark = scan(mantissa, 'ed')
    if (mark > 0) then
      exponent = mantissa(mark + 1:)
      mantissa = mantissa(:mark - 1)
    end if
    call drop_sign(mantissa)
    if (len(mantissa) == 0 .or. verify(mantissa, digits//'.') > 0) return
    point = index(mantissa, '.')
    if (point /= index(mantissa, '.', back=.true.) .or. mantissa == '.') return
    call read_integer(exponent, power, status)
    if (status == number_malformed) return
    ! The power of ten of the leading digit shows overflow and underflow before the conversion.
    first = scan(mantissa, digits(2:))
    if (first == 0) then
      status = number_good
      return
    end if
    if (status /= number_good) return
    if (point == 0) point = len(mantissa) + 1
    magnitude = power + point - first
    if (first < point) magnitude = magnitude - 1
    status = number_out_of_range
    if (magnitude > range(value) .or. magnitude < -range(value)) return
    read (text, *) value
    status = number_good
  end subroutine read_real

  !> An integer: digits, maybe with a sign.
  pure subroutine read_integer(text, value, status)
    character(*), intent(in) :: text  !! Text of the value, without blanks.
    integer, intent(out) :: value  !! The number; 0 where there is none.
    integer, intent(out) :: status  !! One of `number_*`.
    character(:), allocatable :: number
    value = 0
    status = number_malformed
    number = text
    call drop_sign(number)
    if (len(number) == 0 .or. verify(number, digits) > 0) return
    do while (len(number) > 1 .and. number(1:1) == '0')
      number = number(2:)
    end do
    status = number_out_of_range
    if (len(number) > range(value)) return
    read (number, *) value
    if (text(1:1) == '-') value = -value
    status = number_good
  end subroutine read_integer

  !> A logical: .true., t, true and their opposites, in any case.
  pure subroutine read_logical(text, value, status)
    character(*), intent(in) :: text  !! Text of the value, without blanks.
    logical, intent(out) :: value  !! The logical; false where there is none.
    integer, intent(out) :: status  !! `number_good` or `number_malformed`.
    value = .false.
    status = number_good
    select case (lower(text))
    case ('.true.', 'true', 't', '.t.')
      value = .true.
    case ('.false.', 'false', 'f', '.f.')
      value = .false.
    case default
      status = number_malformed
    end select
  end subroutine read_logical

  !> Remove the sign in front of a number.
  pure subroutine drop_sign(number)
    character(:), allocatable, intent(inout) :: number  !! Digits of a number, maybe with a sign; without it on return.
    if (len(number) == 0) return
    if (scan(number(1:1), '+-') > 0) number = number(2:)
  end subroutine drop_sign
end module dotyk_input_checks
