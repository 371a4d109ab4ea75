!> The text of `--help`: command line, exit codes, and the groups and keys of the table that checks them.
module dotyk_input_help
  use dotyk_base_text, only: join, split_words, text_t, to_text
  use dotyk_input_keyword_table, only: list_keywords
  use dotyk_input_keywords, only: at_least_one, at_most_one, exactly_one, group_keyword_t, keyword_t, kind_formula, &
    kind_integer, kind_logical, kind_name, kind_names, kind_real
  implicit none
  private
  public :: help_text, occurrence, values_text

  integer, parameter :: width = 110  !! Longest line.
  integer, parameter :: indent = 2, values_column = 27, meaning_column = 50  !! Columns of keys, values and meanings.
  character, parameter :: lf = new_line('a')

contains

  !> The whole text, in lines of at most 110 letters.
  function help_text() result(text)
    character(:), allocatable :: text
    type(group_keyword_t), allocatable :: groups(:)
    integer :: i, k
    call list_keywords(groups)
    text = &
      'dotyk computes the frictionless unilateral contact of linear elastic bodies.'//lf//lf// &
      'usage: dotyk case.nml [--check] [--threads N] [--output FILE] [--restart RESULTS.vtkhdf]'//lf// &
      '             [--partition N] [--no-shell] [--remesh] [--quiet]'//lf// &
      '       dotyk --version | --help'//lf// &
      '  --check        check the input and print a summary of the scene, without solving'//lf// &
      '  --threads N    number of threads; if absent, one per processor'//lf// &
      '  --output FILE  results file, relative to the working directory; overrides output of &scene'//lf// &
      '  --restart RESULTS.vtkhdf'//lf// &
      '                 start the scheme from the contact pressures of an earlier results file with the same'//lf// &
      '                 contact rows; materials, loads, theta and scheme may differ'//lf// &
      '  --partition N  divide the meshes of large bodies for runs on N ranks (mpirun -n N), without solving'//lf// &
      '  --no-shell     .geo files start no programs and write no files but their mesh'//lf// &
      '  --remesh       make kept meshes again (they are, too, where a file that they depend on is newer)'//lf// &
      '  --quiet        print errors only'//lf// &
      '  --version      print the version'//lf// &
      '  --help         print this text (--help=markdown: the input reference, docs/input.md)'//lf//lf// &
      'exit codes: 0 converged; 1 not converged (results are written and marked); 2 bad input;'//lf// &
      '  3 the problem cannot be solved as posed; 4 a file could not be written;'//lf// &
      '  5 out of memory, or another failure of the machine'//lf// &
      'An interrupt (Ctrl-C, SIGTERM) ends the run after the current iteration with exit code 1;'//lf// &
      'a second interrupt ends the run at once.'//lf//lf// &
      'The input file is a sequence of groups, such as'//lf// &
      '  &body name=''block'', volume=''block'', material=''steel'' /'//lf// &
      '  Commas or blanks separate values, 3*0 stands for 0, 0, 0, texts are in quotes, and ! begins a comment.'//lf// &
      '  Formulas are texts in x, y, z with pi, e, + - * / ^ ( ), comparisons, a ? b : c and functions such as '// &
      'sin,'//lf//'  exp, sqrt, abs, min, max, log (natural). Units are free, but must be consistent.'//lf
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

  !> The lines of one key.
  function key_text(row) result(text)
    type(keyword_t), intent(in) :: row  !! The key.
    character(:), allocatable :: text
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
    text = padded(repeat(' ', indent)//row%key, values_column - 1)
    text = text//padded(values_text(row), meaning_column - values_column)
    text = text//wrapped(meaning, meaning_column - 1, meaning_column - 1)//lf
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
