!> The manual page, for man: `dotyk --help=man`.
module dotyk_input_manual
  use dotyk_base_text, only: text_t, to_text
  use dotyk_base_version, only: version
  use dotyk_input_command_line, only: list_exit_codes, list_options, option_t, usage_text
  use dotyk_input_help, only: interrupt_text, meaning_of, namelist_text, occurrence, purpose, values_text
  use dotyk_input_keyword_table, only: list_keywords
  use dotyk_input_keywords, only: group_keyword_t
  implicit none
  private
  public :: manual_text

  character, parameter :: lf = new_line('a')

contains

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
end module dotyk_input_manual
