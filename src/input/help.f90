!> The text of `--help`: command line, exit codes, and the groups and keys of the table that checks them.
module dotyk_input_help
  use dotyk_base_text, only: join, split_words, text_t, to_text
  use dotyk_input_command_line, only: list_exit_codes, list_options, option_t, usage_text
  use dotyk_input_keyword_table, only: list_keywords
  use dotyk_input_keywords, only: at_least_one, at_most_one, exactly_one, group_keyword_t, keyword_t, kind_formula, &
    kind_integer, kind_logical, kind_name, kind_names, kind_real
  implicit none
  private
  public :: help_text, meaning_of, occurrence, values_text

  integer, parameter :: width = 110  !! Longest line.
  integer, parameter :: indent = 2, values_column = 27, meaning_column = 50  !! Columns of keys, values and meanings.
  integer, parameter :: option_column = 17  !! Blanks before the meanings of options.
  character, parameter :: lf = new_line('a')

  !> Parts of the text that the manual page has, too: the purpose, interrupts, and how input is written.
  character(*), parameter, public :: purpose = &
    'dotyk computes the frictionless unilateral contact of linear elastic bodies.', interrupt_text = &
    'An interrupt (Ctrl-C, SIGTERM) ends the run after the current iteration with exit code 1; a second interrupt '// &
    'ends the run at once.', namelist_text = &
    'The input file is a sequence of groups, such as &body name=''block'', volume=''block'', material=''steel'' /. '// &
    'Commas or blanks separate values, 3*0 stands for 0, 0, 0, texts are in quotes, and ! begins a comment. '// &
    'Formulas are texts in x, y, z with pi, e, + - * / ^ ( ), comparisons, a ? b : c and functions such as sin, '// &
    'exp, sqrt, abs, min, max, log (natural). Units are free, but must be consistent.'

contains

  !> The whole text, in lines of at most 110 letters.
  function help_text() result(text)
    character(:), allocatable :: text
    type(group_keyword_t), allocatable :: groups(:)
    type(option_t), allocatable :: options(:)
    type(text_t), allocatable :: codes(:)
    character(:), allocatable :: meanings
    integer :: i, k
    call list_keywords(groups)
    call list_options(options)
    call list_exit_codes(codes)
    text = purpose//lf//lf//'usage: '//wrapped(usage_text('case.nml'), 7, 13)//lf//'       dotyk --version | --help'//lf
    do i = 1, size(options)
      text = text//option_text(options(i))
    end do
    meanings = ''
    do i = lbound(codes, 1), ubound(codes, 1)
      meanings = meanings//' '//to_text(i)//' '//codes(i)%s//trim(merge(';', ' ', i < ubound(codes, 1)))
    end do
    text = text//lf//'exit codes: '//wrapped(meanings, 12, indent)//lf//wrapped(interrupt_text, 0, 0)//lf//lf// &
           wrapped(namelist_text, 0, indent)//lf
    do i = 1, size(groups)
      text = text//lf//'&'//groups(i)%name//'  ('//occurrence(groups(i)%occurs)//') '// &
             wrapped(groups(i)%meaning, len(groups(i)%name) + len(occurrence(groups(i)%occurs)) + 6, 6)//lf
      do k = 1, size(groups(i)%key)
        text = text//key_text(groups(i)%key(k))
      end do
    end do
  end function help_text

  !> How often a group may occur in a file, in words.
  pure function occurrence(occurs) result(text)
    integer, intent(in) :: occurs  !! One of `exactly_one`, `at_most_one`, `at_least_one`, `any_number`.
    character(:), allocatable :: text
    select case (occurs)
    case (exactly_one)
      text = 'exactly one'
    case (at_most_one)
      text = 'at most one'
    case (at_least_one)
      text = 'one or more'
    case default
      text = 'any number'
    end select
  end function occurrence

  !> The lines of one option; its meaning begins on a line of its own where there is no room before it.
  function option_text(option) result(text)
    type(option_t), intent(in) :: option  !! The option.
    character(:), allocatable :: text
    text = repeat(' ', indent)//trim(option%name//' '//option%value)
    if (len(text) + 1 < option_column) then
      text = padded(text, option_column)
    else
      text = text//lf//repeat(' ', option_column)
    end if
    text = text//wrapped(option%meaning, option_column, option_column)//lf
  end function option_text

  !> The meaning of a key with its unit, limits, names and default.
  pure function meaning_of(row) result(meaning)
    type(keyword_t), intent(in) :: row  !! The key.
    character(:), allocatable :: meaning
    type(text_t), allocatable :: names(:)
    meaning = row%meaning
    if (len(row%unit) > 0) meaning = meaning//' ['//row%unit//']'
    if (row%positive) meaning = meaning//'; above 0'
    if (row%not_negative) meaning = meaning//'; not below 0'
    if (len(row%names) > 0) then
      call split_words(row%names, names)
      meaning = meaning//'; '//trim(merge('any of', 'one of', row%kind == kind_names))//': '//join(names, ', ')
    end if
    if (row%required) meaning = meaning//' (required)'
    if (len(row%default) > 0) meaning = meaning//' (default: '//row%default//')'
  end function meaning_of

  !> The lines of one key.
  function key_text(row) result(text)
    type(keyword_t), intent(in) :: row  !! The key.
    character(:), allocatable :: text
    text = padded(repeat(' ', indent)//row%key, values_column - 1)
    text = text//padded(values_text(row), meaning_column - values_column)
    text = text//wrapped(meaning_of(row), meaning_column - 1, meaning_column - 1)//lf
  end function key_text

  !> Number and type of the values of a key: "2 or 3 reals", "text".
  pure function values_text(row) result(text)
    type(keyword_t), intent(in) :: row  !! The key.
    character(:), allocatable :: text
    select case (row%kind)
    case (kind_real)
      text = 'real'
    case (kind_integer)
      text = 'integer'
    case (kind_logical)
      text = 'logical'
    case (kind_name)
      text = 'name'
    case (kind_names)
      text = 'names in one text'
    case (kind_formula)
      text = 'formula'
    case default
      text = 'text'
    end select
    if (row%most == 1) return
    text = text//'s'
    if (row%most == row%least) then
      text = to_text(row%most)//' '//text
    else
      text = to_text(row%least)//trim(merge(' to', ' or', row%most > 9))//' '//to_text(row%most)//' '//text
    end if
  end function values_text

  !> A text filled up with blanks, at least one.
  pure function padded(text, length) result(longer)
    character(*), intent(in) :: text  !! Text to fill up.
    integer, intent(in) :: length  !! Length with blanks.
    character(:), allocatable :: longer
    longer = text//repeat(' ', max(1, length - len(text)))
  end function padded

  !> A text broken between words into lines of `width` letters.
  pure function wrapped(text, first, next) result(lines)
    character(*), intent(in) :: text  !! Words to break into lines.
    integer, intent(in) :: first  !! Letters in front of the text in the first line.
    integer, intent(in) :: next  !! Blanks in front of the next lines.
    character(:), allocatable :: lines
    type(text_t), allocatable :: words(:)
    integer :: i, used
    call split_words(text, words)
    lines = ''
    used = first
    do i = 1, size(words)
      if (i > 1 .and. used + 1 + len(words(i)%s) > width) then
        lines = lines//lf//repeat(' ', next)
        used = next
      else if (i > 1) then
        lines = lines//' '
        used = used + 1
      end if
      lines = lines//words(i)%s
      used = used + len(words(i)%s)
    end do
  end function wrapped
end module dotyk_input_help
