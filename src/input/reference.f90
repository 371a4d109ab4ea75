!> The reference of all groups and keys in Markdown, docs/input.md: `dotyk --help=markdown`.
module dotyk_input_reference
  use dotyk_base_text, only: join, split_words, text_t
  use dotyk_input_help, only: occurrence, values_text
  use dotyk_input_keyword_table, only: list_keywords
  use dotyk_input_keywords, only: group_keyword_t, keyword_t, kind_formula, kind_integer, kind_names, kind_real
  implicit none
  private
  public :: reference_text

  character, parameter :: lf = new_line('a')

contains

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
end module dotyk_input_reference
