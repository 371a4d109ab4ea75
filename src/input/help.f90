!> The texts about command line, exit codes, and the groups and keys of the table that checks them: `--help`, the
!> reference in Markdown (docs/input.md, `dotyk --help=markdown`), and the manual page (`dotyk --help=man`).
module dotyk_input_help
  use dotyk_base_text, only: join, split_words, text_t, to_text
  use dotyk_base_version, only: version
  use dotyk_input_command_line, only: list_exit_codes, list_options, option_t, usage_text
  use dotyk_input_keyword_table, only: list_keywords
  use dotyk_input_keywords, only: at_least_one, at_most_one, exactly_one, group_keyword_t, keyword_t, kind_formula, &
    kind_integer, kind_logical, kind_name, kind_names, kind_real
  implicit none
  private
  public :: help_text, reference_text, manual_text

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

  !> The whole page; lines are as long as the rows of its tables.
  function reference_text() result(text)
    character(:), allocatable :: text
    type(group_keyword_t), allocatable :: groups(:)
    integer :: i, k
    call list_keywords(groups)
    text = introduction(groups)
    do i = 1, size(groups)
      text = text//lf//'## `&'//groups(i)%name//'`'//lf//lf// &
             capitalized(groups(i)%meaning)//'. '//capitalized(occurrence(groups(i)%occurs))//' in a file.'//lf//lf// &
             '```'//lf//groups(i)%example//lf//'```'//lf//lf// &
             '| key | value | unit | default | meaning |'//lf//'|---|---|---|---|---|'
      do k = 1, size(groups(i)%key)
        text = text//lf//row_of_key(groups(i)%key(k))
      end do
      text = text//lf
    end do
    text = text(:len(text) - 1)
  end function reference_text

  !> What stands before the groups: purpose, syntax, and the list of groups.
  function introduction(groups) result(text)
    type(group_keyword_t), intent(in) :: groups(:)  !! All groups (n_groups).
    character(:), allocatable :: text
    integer :: i
    text = '# Input: groups and keys'//lf//lf// &
      'For users who write an input file. After reading this page you can look up every group and key: its '// &
      'values, unit and default, and what it does.'//lf// &
      'The page is made by `dotyk --help=markdown` from the table that checks the input; `dotyk --help` prints '// &
      'the same in the terminal.'//lf//lf// &
      'The input file is in namelist syntax, a sequence of groups `&name key=value, key=value, ... /`.'//lf//lf// &
      '- Groups and keys are in any order, over any number of lines. Commas or blanks separate values, `3*0` '// &
      'stands for `0, 0, 0`, texts are in quotes, `!` begins a comment. Names of groups, keys and options are in '// &
      'upper or lower case.'//lf// &
      '- Formulas are texts in `x`, `y`, `z` (global coordinates) with `pi`, `e`, `+ - * / ^ ( )`, comparisons, '// &
      '`a ? b : c` and functions such as `sin`, `exp`, `sqrt`, `abs`, `min`, `max`, `log` (natural).'//lf// &
      '- Units are free, but must be consistent, as in N, m, Pa or N, mm, MPa.'//lf// &
      '- Paths are relative to the input file. Physical groups of the mesh are named in gmsh (`Physical '// &
      'Surface("bottom")`).'//lf// &
      '- In two dimensions vectors have two values: x, y or xi, n.'//lf// &
      '- All mistakes are reported together, each with file and line, before anything is computed; `dotyk '// &
      'case.nml --check` stops there.'//lf//lf// &
      '| group | number | describes |'//lf//'|---|---|---|'
    do i = 1, size(groups)
      text = text//lf//'| [`&'//groups(i)%name//'`](#'//groups(i)%name//') | '//occurrence(groups(i)%occurs)//' | '// &
             groups(i)%meaning//' |'
    end do
    text = text//lf
  end function introduction

  !> One row of a group's table.
  function row_of_key(row) result(text)
    type(keyword_t), intent(in) :: row  !! The key.
    character(:), allocatable :: text
    character(:), allocatable :: limits
    type(text_t), allocatable :: names(:)
    limits = ''
    if (row%positive) limits = ', above 0'
    if (row%not_negative) limits = ', not below 0'
    text = '| `'//row%key//'` | '//values_text(row)//limits//' | '//unit_of(row)//' | '// &
           default_of(row)//' | '//code_quoted(row%meaning)
    if (len(row%names) > 0) then
      call split_words(row%names, names)
      text = text//'; '//trim(merge('any of', 'one of', row%kind == kind_names))//': `'''// &
             join(names, '''`, `''')//'''`'
    end if
    text = text//' |'
  end function row_of_key

  !> Unit of a key; 1 for numbers without one, empty for what is no number.
  pure function unit_of(row) result(unit)
    type(keyword_t), intent(in) :: row  !! The key.
    character(:), allocatable :: unit
    unit = row%unit
    if (len(unit) == 0 .and. any(row%kind == [kind_real, kind_integer, kind_formula])) unit = '1'
  end function unit_of

  !> Default of a key in words.
  pure function default_of(row) result(text)
    type(keyword_t), intent(in) :: row  !! The key.
    character(:), allocatable :: text
    text = ''
    if (row%required) then
      text = 'required'
    else if (len(row%default) > 0 .and. len(row%names) > 0) then
      text = '`'''//row%default//'''`'
    else if (len(row%default) > 0) then
      text = '`'//row%default//'`'
    end if
  end function default_of

  !> A text whose parts in single quotes are set as code: 'fixed' becomes `'fixed'`. Apostrophes inside words stay.
  pure function code_quoted(text) result(marked)
    character(*), intent(in) :: text  !! Plain text.
    character(:), allocatable :: marked
    logical :: inside
    integer :: i
    marked = ''
    inside = .false.
    do i = 1, len(text)
      if (text(i:i) == '|') then
        marked = marked//'\|'
      else if (text(i:i) == "'" .and. inside) then
        marked = marked//"'`"
        inside = .false.
      else if (text(i:i) == "'" .and. .not. follows_letter(text, i)) then
        marked = marked//"`'"
        inside = .true.
      else
        marked = marked//text(i:i)
      end if
    end do
  end function code_quoted

  !> Whether a letter stands before a place of a text.
  pure logical function follows_letter(text, i) result(follows)
    character(*), intent(in) :: text  !! The text.
    integer, intent(in) :: i  !! The place, from 1.
    follows = .false.
    if (i > 1) follows = scan(text(i - 1:i - 1), 'abcdefghijklmnopqrstuvwxyz') > 0
  end function follows_letter

  !> A text with a capital first letter.
  pure function capitalized(text) result(sentence)
    character(*), intent(in) :: text  !! Text that begins with a lower case letter.
    character(:), allocatable :: sentence
    sentence = achar(iachar(text(1:1)) - 32)//text(2:)
  end function capitalized

  !> The whole page in troff, with the macros of man.
  function manual_text() result(text)
    character(:), allocatable :: text
    type(group_keyword_t), allocatable :: groups(:)
    type(option_t), allocatable :: options(:)
    type(text_t), allocatable :: codes(:)
    integer :: i, k
    call list_options(options)
    call list_exit_codes(codes)
    call list_keywords(groups)
    text = '.TH DOTYK 1 "" "dotyk '//version//'" "User Commands"'//lf//'.SH NAME'//lf// &
           plain('dotyk, dotyk-render, dotyk-summary, dotyk-convert')//' \- frictionless contact of elastic bodies'// &
           section('SYNOPSIS')//plain(usage_text('case.nml'))//lf//'.br'//lf//plain('dotyk --version | --help')// &
           lf//'.br'//lf//plain('dotyk-render results.vtkhdf')//lf//'.br'//lf//plain('dotyk-summary results.vtkhdf')// &
           lf//'.br'//lf//plain('dotyk-convert deck.inp')// &
           section('DESCRIPTION')//plain(purpose)// &
           entry('dotyk-render', '', 'draws a picture of results, or of the faces of CAD files')// &
           entry('dotyk-summary', '', 'prints what a results file says, or its tables as CSV')// &
           entry('dotyk-convert', '', 'makes a first scene from a deck of CalculiX or Abaqus')//lf//'.PP'//lf// &
           plain('Each of these commands lists its options with --help.')// &
           section('OPTIONS')//'Those of dotyk:'
    do i = 1, size(options)
      text = text//entry(options(i)%name, options(i)%value, options(i)%meaning)
    end do
    text = text//section('EXIT STATUS')//'Of dotyk:'
    do i = lbound(codes, 1), ubound(codes, 1)
      text = text//entry(to_text(i), '', codes(i)%s)
    end do
    text = text//lf//'.PP'//lf//plain(interrupt_text)// &
           section('ENVIRONMENT')//'Programs that dotyk starts to make meshes, where others are wanted:'// &
           entry('DOTYK_GMSH', '', 'in place of gmsh, for geometries and CAD files')// &
           entry('DOTYK_PYTHON', '', 'in place of python3, for decks and other meshes')// &
           section('EXAMPLE')//'.EX'//lf//plain('cp -r /usr/share/doc/dotyk/examples/hertz .')//lf// &
           plain('cd hertz')//lf//plain('dotyk hertz.nml')//lf//plain('dotyk-summary hertz.vtkhdf')//lf//'.EE'// &
           section('INPUT')//plain(namelist_text)
    do i = 1, size(groups)
      text = text//lf//'.SS '//plain('&'//groups(i)%name)//lf//plain(groups(i)%meaning//' ('// &
             occurrence(groups(i)%occurs)//')')//lf//'.PP'//lf//'.EX'//lf//plain(groups(i)%example)//lf//'.EE'
      do k = 1, size(groups(i)%key)
        associate (row => groups(i)%key(k))
          text = text//entry(row%key, values_text(row), meaning_of(row))
        end associate
      end do
    end do
    text = text//section('SEE ALSO')//'.BR gmsh (1)'
  end function manual_text

  !> The beginning of a section.
  pure function section(title) result(text)
    character(*), intent(in) :: title  !! Its title.
    character(:), allocatable :: text
    text = lf//'.SH '//title//lf
  end function section

  !> A paragraph with a tag: a name in bold and a value in italics.
  pure function entry(name, value, meaning) result(text)
    character(*), intent(in) :: name, value, meaning  !! What it says; there may be no value.
    character(:), allocatable :: text
    text = lf//'.TP'//lf//'\fB'//plain(name)//'\fR'
    if (len(value) > 0) text = text//' \fI'//plain(value)//'\fR'
    text = text//lf//plain(meaning)
  end function entry

  !> A text without anything that troff would take for its own. Quotes and hyphens are those that can be copied.
  pure function plain(text) result(escaped)
    character(*), intent(in) :: text  !! The text, of one or more lines.
    character(:), allocatable :: escaped
    integer :: i
    escaped = ''
    do i = 1, len(text)
      ! At the beginning of a line a point would call a macro.
      if (index(text(i:), '.') == 1 .and. (i == 1 .or. text(max(1, i - 1):max(1, i - 1)) == lf)) escaped = escaped//'\&'
      select case (text(i:i))
      case ('\')
        escaped = escaped//'\e'
      case ('-')
        escaped = escaped//'\-'
      case ("'")
        escaped = escaped//'\(aq'
      case ('`')
        escaped = escaped//'\(ga'
      case ('^')
        escaped = escaped//'\(ha'
      case ('~')
        escaped = escaped//'\(ti'
      case default
        escaped = escaped//text(i:i)
      end select
    end do
  end function plain
end module dotyk_input_help
