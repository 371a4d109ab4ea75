!> THE table of the options of the command line, from which `--help`, the manual page and messages follow (and from
!> `--help` the completion of shells); and the exit codes in words.
module dotyk_input_command_line
  use dotyk_base_text, only: text_t
  implicit none
  private
  public :: list_exit_codes, list_options, usage_text

  type, public :: option_t  !! An option.
    character(:), allocatable :: name  !! As in '--threads'.
    character(:), allocatable :: value  !! What its value is, as in 'N'; empty where it has none.
    character(:), allocatable :: meaning  !! What it does.
    logical :: runs = .true.  !! Whether a case is run with it; it prints a text otherwise.
  end type option_t

contains

  !> All options in the order of the help.
  pure subroutine list_options(options)
    type(option_t), allocatable, intent(out) :: options(:)  !! The options (n_options).
    allocate (options(0))
    call add(options, '--check', '', 'check the input and print a summary of the scene, without solving')
    call add(options, '--threads', 'N', 'number of threads; if absent, one per processor')
    call add(options, '--output', 'FILE', 'results file, relative to the working directory; overrides output of &scene')
    call add(options, '--restart', 'RESULTS.vtkhdf', 'start the scheme from the contact pressures of an earlier '// &
             'results file with the same contact rows; materials, loads, theta and scheme may differ')
    call add(options, '--partition', 'N', 'divide the meshes of large bodies for runs on N ranks (mpirun -n N), '// &
             'without solving')
    call add(options, '--no-shell', '', '.geo files start no programs and write no files but their mesh')
    call add(options, '--remesh', '', 'make kept meshes again (they are, too, where a file that they depend on is '// &
             'newer)')
    call add(options, '--quiet', '', 'print errors only')
    call add(options, '--verbose', '', 'print details, too: sizes, iterations, energies, moments, times of processors')
    call add(options, '--version', '', 'print the version', runs=.false.)
    call add(options, '--help', '', 'print this help; --help=markdown: the reference of the input, docs/input.md; '// &
             '--help=man: the manual page', runs=.false.)
  end subroutine list_options

  !> Add an option to the table.
  pure subroutine add(options, name, value, meaning, runs)
    type(option_t), allocatable, intent(inout) :: options(:)  !! The table so far (n_options).
    character(*), intent(in) :: name, value, meaning  !! As in `option_t`.
    logical, intent(in), optional :: runs  !! Likewise.
    type(option_t), allocatable :: longer(:)
    integer :: n
    n = size(options)
    allocate (longer(n + 1))
    longer(:n) = options
    longer(n + 1)%name = name
    longer(n + 1)%value = value
    longer(n + 1)%meaning = meaning
    if (present(runs)) longer(n + 1)%runs = runs
    call move_alloc(longer, options)
  end subroutine add

  !> Meanings of the exit codes.
  pure subroutine list_exit_codes(codes)
    type(text_t), allocatable, intent(out) :: codes(:)  !! The meanings (0:n_codes - 1).
    allocate (codes(0:5))
    codes(0)%s = 'converged'
    codes(1)%s = 'not converged (results are written and marked)'
    codes(2)%s = 'bad input'
    codes(3)%s = 'the problem cannot be solved as posed'
    codes(4)%s = 'a file could not be written'
    codes(5)%s = 'out of memory, or another failure of the machine'
  end subroutine list_exit_codes

  !> The options of a run in brackets, after a name for the case.
  pure function usage_text(case_file) result(text)
    character(*), intent(in) :: case_file  !! Name for the case, as in 'case.nml'.
    character(:), allocatable :: text
    type(option_t), allocatable :: options(:)
    integer :: i
    call list_options(options)
    text = 'dotyk '//case_file
    do i = 1, size(options)
      if (options(i)%runs) text = text//' ['//trim(options(i)%name//' '//options(i)%value)//']'
    end do
  end function usage_text
end module dotyk_input_command_line
