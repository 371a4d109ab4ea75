!> The command line.
module dotyk_driver_arguments
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_text, only: nearest_name, text_t, to_text
  use dotyk_input_command_line, only: list_options, option_t, usage_text
  implicit none
  private

  type, public :: arguments_t  !! What the user asked for.
    character(:), allocatable :: case_file  !! Namelist file; empty where none is needed.
    character(:), allocatable :: output  !! Path of the results file in place of the scene's; empty where not given.
    !> Results file whose contact pressures the scheme starts from; empty: from the scene without contact.
    character(:), allocatable :: restart
    integer :: threads = 0  !! Number of threads; 0: all processors.
    integer :: parts = 0  !! Number of ranks for which parts of the meshes are made, and nothing solved; 0: none.
    logical :: check = .false.  !! Check everything and solve nothing.
    logical :: no_shell = .false.  !! Geometries may start no program and write no file but their mesh.
    logical :: remesh = .false.  !! Meshes that are kept are made again.
    logical :: quiet = .false.  !! Print errors only.
    logical :: verbose = .false.  !! Print details, too.
    logical :: version = .false.  !! Print the version and stop.
    logical :: help = .false.  !! Print the help and stop.
    logical :: reference = .false.  !! Print the input reference in Markdown and stop.
    logical :: manual = .false.  !! Print the manual page and stop.
  end type arguments_t

  public :: read_arguments, command_line_text

  !> Threads at most: more than any machine for one body has; a larger number is a mistake. Ranks at most likewise.
  integer, parameter :: most_threads = 1024, most_ranks = 1000000

contains

  !> The arguments of this run.
  subroutine read_arguments(arguments, error)
    type(arguments_t), intent(out) :: arguments  !! Arguments of the command line.
    !> Allocated where they are wrong: an unknown option, a missing value, no case or several.
    type(error_t), allocatable, intent(out) :: error
    type(text_t), allocatable :: words(:)
    integer :: i, length
    allocate (words(command_argument_count()))
    do i = 1, size(words)
      call get_command_argument(i, length=length)
      allocate (character(length) :: words(i)%s)
      call get_command_argument(i, words(i)%s)
    end do
    call parse_arguments(words, arguments, error)
  end subroutine read_arguments

  !> Words to arguments.
  subroutine parse_arguments(words, arguments, error)
    type(text_t), intent(in) :: words(:)  !! Words of the command line without the program's name (n_words).
    type(arguments_t), intent(out) :: arguments  !! Arguments that the words spell.
    !> Allocated where they are wrong: an unknown option, a missing value, no case or several.
    type(error_t), allocatable, intent(out) :: error
    type(option_t), allocatable :: options(:)
    type(text_t), allocatable :: names(:)
    character(:), allocatable :: meant
    integer :: i, k
    call list_options(options)
    allocate (names(size(options)))
    do k = 1, size(options)
      names(k)%s = options(k)%name
    end do
    arguments%case_file = ''
    arguments%output = ''
    arguments%restart = ''
    i = 0
    do while (i < size(words))
      i = i + 1
      select case (words(i)%s)
      case ('--check')
        arguments%check = .true.
      case ('--no-shell')
        arguments%no_shell = .true.
      case ('--remesh')
        arguments%remesh = .true.
      case ('--quiet')
        arguments%quiet = .true.
      case ('--verbose')
        arguments%verbose = .true.
      case ('--version')
        arguments%version = .true.
      case ('--help', '-h')
        arguments%help = .true.
      case ('--help=markdown')
        arguments%reference = .true.
      case ('--help=man')
        arguments%manual = .true.
      case ('--threads', '--output', '--restart', '--partition')
        if (i == size(words)) then
          call set_error(error, 'option '//words(i)%s//' needs a value')
          return
        end if
        select case (words(i)%s)
        case ('--output')
          arguments%output = words(i + 1)%s
        case ('--restart')
          arguments%restart = words(i + 1)%s
        case ('--partition')
          call read_number(words(i)%s, words(i + 1)%s, 2, most_ranks, arguments%parts, error)
        case default
          call read_number(words(i)%s, words(i + 1)%s, 1, most_threads, arguments%threads, error)
        end select
        if (len(words(i + 1)%s) == 0 .and. .not. allocated(error)) &
          call set_error(error, 'option '//words(i)%s//' needs a file name')
        if (allocated(error)) return
        i = i + 1
      case default
        if (index(words(i)%s, '-') == 1 .and. len(words(i)%s) > 1) then
          call set_error(error, "unknown option '"//words(i)%s//"'")
          meant = nearest_name(words(i)%s, names)
          if (len(meant) > 0) error%message = error%message//' (did you mean '//meant//'?)'
          error%message = error%message//'; dotyk --help lists the options'
          return
        else if (len(arguments%case_file) > 0) then
          call set_error(error, "one case at a time: '"//arguments%case_file//"' or '"//words(i)%s// &
                         "'? (tools/batch.sh runs several)")
          return
        end if
        arguments%case_file = words(i)%s
      end select
    end do
    if (len(arguments%case_file) == 0 .and. .not. (arguments%help .or. arguments%version .or. &
                                                   arguments%reference .or. arguments%manual)) &
      call set_error(error, 'no case given: '//usage_text('CASE.nml')//', or dotyk --help')
  end subroutine parse_arguments

  !> The number of an option.
  subroutine read_number(option, word, least, most, number, error)
    character(*), intent(in) :: option, word  !! The option, and the word behind it.
    integer, intent(in) :: least, most  !! The range of the number.
    integer, intent(out) :: number  !! The number.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the word is no such number.
    integer :: status
    number = 0
    read (word, *, iostat=status) number
    if (verify(word, '0123456789') > 0) status = 1
    if (status /= 0 .or. number < least .or. number > most) &
      call set_error(error, 'option '//option//' needs a number from '//to_text(least)//' to '//to_text(most)// &
                     ", not '"//word//"'")
  end subroutine read_number

  !> The whole command line, for the results file.
  function command_line_text() result(text)
    character(:), allocatable :: text
    integer :: length
    call get_command(length=length)
    allocate (character(length) :: text)
    call get_command(text)
  end function command_line_text
end module dotyk_driver_arguments
