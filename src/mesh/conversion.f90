!> Meshes made of other files: gmsh meshes geometries, and a program of this one, mesh2msh of its Python package,
!> converts meshes of other formats to MSH 4.1.
!>
!> A mesh is kept (`dotyk_mesh_mesh_cache`) and made again by the rule of make: where the file, a file that was read for
!> it, options of the user, or the programs are newer. It has the time at which its making began. It is written under a
!> temporary name and renamed, so that concurrent runs never read an incomplete mesh. The environment variables
!> DOTYK_GMSH and DOTYK_PYTHON name other executables than `gmsh` and `python3`.
module dotyk_mesh_conversion
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_error, only: error_t, set_error, exit_bad_input, exit_machine, exit_not_written
  use dotyk_base_files, only: behind_links, is_cad_file, is_geo_file, is_msh_file, is_stl_file, own_mark, &
    remove_leftovers, why_no_file, write_new
  use dotyk_base_interrupt, only: run_shell => run_command, interrupted, status_not_confined, stop_if_interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_memory, only: set_stage, stage_text
  use dotyk_base_operating_system, only: rename_file, remove_file, shell_quoted, directory_of, environment_value
  use dotyk_base_text, only: text_t, to_text
  use dotyk_base_version, only: module_directory, source_directory
  use dotyk_mesh_cad_script, only: cad_script, script_of_solid
  use dotyk_mesh_conversion_log, only: advice, conversion_log_t, is_complete
  use dotyk_mesh_mesh_cache, only: find_cache
  implicit none
  private
  public :: forget_mesh, is_kept, make_mesh, needs_conversion

  type, public :: meshing_t  !! How meshes are made, and what is to be said about one.
    logical :: no_shell = .false.  !! Whether geometries may start no program and write no file but the mesh.
    logical :: is_made = .false.  !! Whether another rank has just made the mesh.
    real(dp) :: size = 0  !! Size of the elements of CAD files, not positive: by each solid [length]; and their order.
    integer :: order = 2
    integer :: number = 0  !! Number of the mesh where one follows the other by its errors; 0 where there is one.
    !> Geometries whose elements get sizes, and what gmsh reads after each; not allocated without (n).
    type(text_t), allocatable :: sized_file(:), size_script(:)
    !> What the names of their meshes end with where the user gives the sizes; not allocated without.
    character(:), allocatable :: size_mark
    character(:), allocatable :: remark  !! Remark for the log; empty where there is none.
  end type meshing_t

  !> Exit status of the shell for a program that it does not find or cannot run.
  integer, parameter :: status_not_executable = 126, status_not_found = 127
  !> Exit status of the shell for a program that crashed, and the greatest number of solids that are tried for it.
  integer, parameter :: status_crashed = 128, most_tried = 40

contains

  !> Whether a file is not of the format that is read: all but MSH 4.1.
  logical function needs_conversion(path) result(needs)
    character(*), intent(in) :: path  !! Path of the file.
    type(byte_cursor_t) :: cursor
    type(error_t), allocatable :: not_read
    character(:), allocatable :: beginning
    integer :: format
    needs = .not. is_msh_file(path)
    if (needs) return
    call cursor%open(path, not_read)
    if (allocated(not_read)) return
    call cursor%first_bytes(1024, beginning)
    call cursor%close
    format = index(beginning, '$MeshFormat')
    if (format > 0) needs = verify(beginning(format + 11:), ' '//achar(9)//achar(10)//achar(13)) == &
                            index(beginning(format + 11:), '2.')
  end function needs_conversion

  !> Make the mesh of a file, unless it is kept and nothing is newer.
  subroutine make_mesh(path, dimension, msh_file, error, meshing)
    character(*), intent(in) :: path  !! Path of the file.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    character(:), allocatable, intent(out) :: msh_file  !! Path of the mesh.
    !> Set if the file cannot be read, meshed or converted, or starts programs that are forbidden, a program is not
    !> found, or no directory for the mesh can be written.
    type(error_t), allocatable, intent(out) :: error
    !> What geometries may do; on return, what was found in this one. Nothing is forbidden if absent.
    type(meshing_t), intent(inout), optional :: meshing
    type(meshing_t) :: local
    character(:), allocatable :: stage
    if (present(meshing)) local = meshing
    ! Threads of one process would use the same temporary names.
    !$omp critical (dotyk_mesh_making)
    stage = stage_text()
    if (uses_gmsh(path)) then
      call set_stage('meshing '//path//' with gmsh')
    else
      call set_stage('converting '//path)
    end if
    call find_mesh(path, dimension, local, msh_file, error)
    call set_stage(stage)
    !$omp end critical (dotyk_mesh_making)
    if (present(meshing)) meshing = local
  end subroutine make_mesh

  !> Give up the mesh that is kept for a file.
  subroutine forget_mesh(path, dimension, meshing)
    character(*), intent(in) :: path  !! Path of the file.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    type(meshing_t), intent(in) :: meshing  !! How it is made.
    type(error_t), allocatable :: ignored
    character(:), allocatable :: base
    call name_mesh(path, dimension, meshing, base, ignored)
    if (.not. allocated(ignored)) call remove_file(base//'.msh')
  end subroutine forget_mesh

  !> Whether the mesh of a file is kept, and nothing is newer.
  logical function is_kept(path, dimension, meshing)
    character(*), intent(in) :: path  !! Path of the file.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    type(meshing_t), intent(in) :: meshing  !! How it is made.
    type(conversion_log_t) :: log
    type(error_t), allocatable :: ignored
    character(:), allocatable :: base
    is_kept = .false.
    call name_mesh(path, dimension, meshing, base, ignored)
    if (allocated(ignored)) return
    inquire (file=base//'.msh', exist=is_kept)
    if (is_kept) call log%read(base//'.log', is_kept)
    ! A mesh that programs have a part in is no mesh without them.
    if (is_kept) is_kept = is_current(path, base, log) .and. .not. (meshing%no_shell .and. len(log%command) > 0)
  end function is_kept

  !> Find the mesh, or make it.
  subroutine find_mesh(path, dimension, meshing, msh_file, error)
    character(*), intent(in) :: path  !! Path of the file.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    type(meshing_t), intent(inout) :: meshing  !! What geometries may do; what was found is set.
    character(:), allocatable, intent(out) :: msh_file  !! Path of the mesh.
    !> Set if the file cannot be read, meshed or converted, or starts programs that are forbidden, a program is not
    !> found, or no directory for the mesh can be written.
    type(error_t), allocatable, intent(out) :: error
    type(conversion_log_t) :: log
    character(:), allocatable :: base
    logical :: found
    meshing%remark = ''
    msh_file = ''
    if (len(why_no_file(path)) > 0) then
      call set_error(error, path//': there is no such file', exit_bad_input)
      return
    end if
    call name_mesh(path, dimension, meshing, base, error)
    if (allocated(error)) return
    msh_file = base//'.msh'
    if (meshing%is_made) then
      inquire (file=msh_file, exist=found)
    else
      found = is_kept(path, dimension, meshing)
    end if
    if (found) then
      call log%read(base//'.log', found)
    else
      call remove_file(msh_file)
      call convert(path, dimension, base, meshing, log, error)
    end if
    if (allocated(error)) return
    meshing%remark = log%remark
    if (len(log%command) > 0) &
      meshing%remark = 'warning: '//path//' starts a program: '//log%command//'; its mesh is made again where '// &
                       'a file is newer, or by --remesh. --no-shell forbids programs to geometries'
  end subroutine find_mesh

  !> Path of a mesh without its extension: by the name of the file, the dimension and the options of its elements.
  subroutine name_mesh(path, dimension, meshing, base, error)
    character(*), intent(in) :: path  !! Path of the file.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    type(meshing_t), intent(in) :: meshing  !! Size and order of the elements of CAD files.
    character(:), allocatable, intent(out) :: base  !! Path of the mesh without its extension.
    type(error_t), allocatable, intent(out) :: error  !! Set if no directory for the mesh can be written.
    character(:), allocatable :: directory
    call find_cache(path, directory, error)
    if (allocated(error)) return
    base = directory//path(len(directory_of(path)) + 1:)//'-'//to_text(dimension)//'d'
    if (allocated(meshing%size_mark) .and. is_sized(path, meshing)) then
      base = base//'-sizes'//meshing%size_mark
      if (meshing%number > 1) base = base//'-mesh'//to_text(meshing%number)
    else if (meshing%number > 1 .or. (meshing%number == 1 .and. is_cad_file(path))) then
      base = base//'-mesh'//to_text(meshing%number)
    end if
    if (.not. is_cad_file(path)) return
    base = base//'-order'//to_text(meshing%order)
    if (meshing%size > 0) base = base//'-size'//to_text(meshing%size, 17)
  end subroutine name_mesh

  !> Whether the elements of a geometry get sizes.
  pure logical function is_sized(path, meshing)
    character(*), intent(in) :: path  !! Its path.
    type(meshing_t), intent(in) :: meshing  !! How meshes are made.
    integer :: f
    is_sized = .false.
    if (allocated(meshing%sized_file)) &
      is_sized = any([(meshing%sized_file(f)%s == path, f=1, size(meshing%sized_file))])
  end function is_sized

  !> Whether a mesh is newer than all that it depends on. Times of names and owners count with those of contents, so
  !> that a file that is moved to the place of another is noticed.
  logical function is_current(path, base, log)
    character(*), intent(in) :: path  !! Path of the file.
    character(*), intent(in) :: base  !! Path of the mesh without its extension.
    type(conversion_log_t), intent(in) :: log  !! What was said when it was made.
    character(:), allocatable :: files, home, mesh
    logical :: found
    integer :: i
    files = shell_quoted(plain(path))//' '//shell_quoted(behind_links('/proc/self/exe'))
    do i = 1, log%n_files
      files = files//' '//shell_quoted(plain(log%place_of(i, path)))
      if (is_geo_file(log%place_of(i, path))) call add_names(log%place_of(i, path))
    end do
    if (uses_gmsh(path)) then
      home = environment_value('GMSH_HOME')
      if (len(home) == 0) home = environment_value('HOME')
      call add_option(home//'/.gmshrc')
      call add_option(home//'/.gmsh-options')
      call add_option(path//'.opt')
      files = files//' $(command -v '//shell_quoted(executable(path))//')'
    else
      files = files//' '//shell_quoted(converter())//'/*.py'
    end if
    mesh = shell_quoted(plain(base//'.msh'))
    ! A file that is not there any more is told by find, too.
    is_current = run_shell('test -z "$(find -L '//files//' -prune "(" -newer '//mesh//' -o -cnewer '//mesh// &
                           ' ")" 2>&1)"') == 0

  contains

    !> Add a file that need not exist.
    subroutine add_option(name)
      character(*), intent(in) :: name  !! Its path.
      inquire (file=name, exist=found)
      if (found) files = files//' '//shell_quoted(plain(name))
    end subroutine add_option

    !> Add the files beside a geometry that it names in quotes: gmsh does not say which files functions and fields read.
    subroutine add_names(geometry)
      character(*), intent(in) :: geometry  !! Its path.
      type(byte_cursor_t) :: cursor
      type(error_t), allocatable :: not_read
      character(:), allocatable :: line, name
      integer :: first, length
      call cursor%load(geometry, not_read)
      if (allocated(not_read)) return
      do while (cursor%position <= cursor%size)
        call cursor%get_line(line)
        do
          first = scan(line, '"''')
          if (first == 0) exit
          length = index(line(first + 1:), line(first:first)) - 1
          if (length < 0) exit
          name = directory_of(geometry)//line(first + 1:first + length)
          if (length > 0 .and. len(why_no_file(name)) == 0) files = files//' '//shell_quoted(plain(name))
          line = line(first + length + 2:)
        end do
      end do
    end subroutine add_names
  end function is_current

  !> Path that no program takes for an option.
  pure function plain(path)
    character(*), intent(in) :: path  !! Path.
    character(:), allocatable :: plain
    plain = path
    if (len(path) == 0) return
    if (path(1:1) == '-') plain = './'//path
  end function plain

  !> Whether gmsh makes the mesh of a file; mesh2msh does otherwise.
  pure logical function uses_gmsh(path)
    character(*), intent(in) :: path  !! Path of the file.
    uses_gmsh = is_cad_file(path) .or. is_geo_file(path)
  end function uses_gmsh

  !> The program that makes the mesh of a file.
  function executable(path) result(program)
    character(*), intent(in) :: path  !! Path of the file.
    character(:), allocatable :: program  !! Its path, or name on the PATH.
    if (uses_gmsh(path)) then
      program = environment_value('DOTYK_GMSH')
      if (len(program) == 0) program = 'gmsh'
    else
      program = environment_value('DOTYK_PYTHON')
      if (len(program) == 0) program = 'python3'
    end if
  end function executable

  !> Folder of mesh2msh: in the package that is installed with the program, or else in its sources.
  function converter() result(folder)
    character(:), allocatable :: folder
    logical :: found
    folder = directory_of(behind_links('/proc/self/exe'))//module_directory//'/dotyk/mesh2msh'
    inquire (file=folder//'/__main__.py', exist=found)
    if (.not. found) folder = source_directory//'/tools/python/dotyk/mesh2msh'
  end function converter

  !> Whether gmsh loses the end of a geometry: of several statements on a last line that has no end it reads the first.
  logical function loses_statements(path) result(loses)
    character(*), intent(in) :: path  !! The file.
    character(4096) :: tail
    integer(int64) :: n
    integer :: unit, status, first
    loses = .false.
    inquire (file=path, size=n)
    if (n <= 0) return
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read', iostat=status)
    if (status /= 0) return
    associate (m => int(min(n, int(len(tail), int64))))
      read (unit, pos=n - m + 1, iostat=status) tail(:m)
      close (unit)
      if (status /= 0) return
      first = index(tail(:m), new_line('a'), back=.true.) + 1
      loses = n_statements(tail(first:m)) > 1
    end associate
  end function loses_statements

  !> Number of statements that end on a line: semicolons outside of comments and quoted names.
  pure integer function n_statements(line) result(n)
    character(*), intent(in) :: line  !! The line.
    integer :: i, skipped
    n = 0
    i = 1
    do while (i <= len(line))
      if (index(line(i:), '//') == 1) return
      skipped = 1
      if (index(line(i:), '/*') == 1) then
        skipped = 2 + up_to('*/', line(i + 2:))
      else if (scan(line(i:i), '"''') == 1) then
        skipped = 1 + up_to(line(i:i), line(i + 1:))
      else if (line(i:i) == ';') then
        n = n + 1
      end if
      i = i + skipped
    end do
  end function n_statements

  !> Length of a text up to the end of a mark in it; of the whole text where it has none.
  pure integer function up_to(mark, text) result(length)
    character(*), intent(in) :: mark  !! The mark.
    character(*), intent(in) :: text  !! The text.
    length = len(text)
    if (index(text, mark) > 0) length = index(text, mark) + len(mark) - 1
  end function up_to

  !> Run a shell command without input, its output in a file.
  subroutine run_command(command, log_file, status, confined)
    character(*), intent(in) :: command  !! Command.
    character(*), intent(in) :: log_file  !! Path of the output.
    integer, intent(out) :: status  !! Exit status; that of a program not found where there is no shell.
    !> Whether it is confined to the directory of the output, without other programs; not if absent.
    logical, intent(in), optional :: confined
    character(:), allocatable :: line
    line = 'exec '//command//' < /dev/null > '//shell_quoted(log_file)//' 2>&1'
    if (present(confined)) then
      if (confined) then
        status = run_shell(line, directory_of(log_file))
        return
      end if
    end if
    status = run_shell(line)
  end subroutine run_command

  !> Make a mesh; the output of the program is kept in `base`.log.
  subroutine convert(file, dimension, base, meshing, log, error)
    character(*), intent(in) :: file  !! Path of the file.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    character(*), intent(in) :: base  !! Path of the mesh without its extension.
    type(meshing_t), intent(in) :: meshing  !! What geometries may do, and their elements.
    type(conversion_log_t), intent(out) :: log  !! What the program said.
    !> Set if the program fails or makes no complete mesh, if the mesh cannot be renamed, or on an interrupt.
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: temporary, command, script
    integer :: status, f
    logical :: found
    if (is_geo_file(file)) then
      if (loses_statements(file)) then
        call set_error(error, file//': its last line has no end of line and several statements, of which gmsh '// &
                       'would read the first: end the file with a newline')
        return
      end if
    end if
    call remove_leftovers(base)
    temporary = plain(base//own_mark())
    script = ''
    if (is_cad_file(file)) script = cad_script(meshing%size, meshing%order, is_stl_file(file), meshing%number > 0)
    if (allocated(meshing%sized_file)) then
      do f = 1, size(meshing%sized_file)
        if (meshing%sized_file(f)%s == file) script = script//meshing%size_script(f)%s
      end do
    end if
    call write_new(temporary//'.start', '')
    if (len(script) > 0) call write_new(temporary//'.geo', script)
    if (uses_gmsh(file)) then
      command = gmsh_command(file, dimension, temporary, len(script) > 0)
    else
      command = shell_quoted(executable(file))//' -B '//shell_quoted(converter())//' '//shell_quoted(plain(file))// &
                ' '//to_text(dimension)//' '//shell_quoted(temporary//'.msh')
    end if
    call run_command(command, temporary//'.log', status, confined=meshing%no_shell .and. uses_gmsh(file))
    call stop_if_interrupted(error)
    if (.not. allocated(error)) then
      call log%read(temporary//'.log', found)
      if (.not. rename_file(temporary//'.log', base//'.log')) call remove_file(temporary//'.log')
      if (status /= 0 .or. len(log%errors) > 0) then
        call explain_failure(file, dimension, base, temporary, script, meshing%no_shell, status, log, error)
      else if (index(log%counts, ' 0 elements') > 0) then
        call set_error(error, file//': gmsh made no elements: the geometry is empty')
      else if (.not. is_complete(temporary//'.msh')) then
        call set_error(error, file//': '//trim(merge('gmsh    ', 'mesh2msh', uses_gmsh(file)))// &
                       ' did not write a complete mesh to '//directory_of(base)//': is the disk full?')
        if (uses_gmsh(file)) error%message = error%message//' Or does the geometry set Mesh.Format, or call Exit?'
      else
        status = run_shell('touch -r '//shell_quoted(temporary//'.start')//' '//shell_quoted(temporary//'.msh'))
        if (.not. rename_file(temporary//'.msh', base//'.msh')) &
          call set_error(error, base//'.msh: cannot be written', exit_not_written)
      end if
    end if
    call remove_file(temporary//'.start')
    call remove_file(temporary//'.geo')
    call remove_file(temporary//'.log')
    call remove_file(temporary//'.msh')
  end subroutine convert

  !> The command that lets gmsh mesh a geometry.
  function gmsh_command(file, dimension, temporary, with_script) result(command)
    character(*), intent(in) :: file  !! Path of the geometry.
    integer, intent(in) :: dimension  !! Largest dimension of the elements.
    character(*), intent(in) :: temporary  !! Path of temporary files without extension.
    logical, intent(in) :: with_script  !! Whether gmsh reads a script after the file.
    character(:), allocatable :: command
    command = shell_quoted(executable(file))//' -'//to_text(dimension)//' -format msh41 -bin -o '// &
              shell_quoted(temporary//'.msh')
    ! Solids get the names of the file.
    if (is_cad_file(file)) command = command//' -setnumber Geometry.OCCImportLabels 1'
    command = command//' '//shell_quoted(plain(file))
    if (with_script) command = command//' '//shell_quoted(temporary//'.geo')
  end function gmsh_command

  !> Why there is no mesh.
  subroutine explain_failure(file, dimension, base, temporary, script, no_shell, status, log, error)
    character(*), intent(in) :: file  !! Path of the file.
    integer, intent(in) :: dimension  !! Largest dimension of the elements.
    character(*), intent(in) :: base  !! Path of the mesh without its extension.
    character(*), intent(in) :: temporary  !! Path of temporary files without extension.
    character(*), intent(in) :: script  !! What gmsh reads after the file; may be empty.
    logical, intent(in) :: no_shell  !! Whether no program may be started.
    integer, intent(in) :: status  !! Exit status.
    type(conversion_log_t), intent(in) :: log  !! What the program said.
    type(error_t), allocatable, intent(out) :: error  !! The reason.
    character(:), allocatable :: errors
    if (status == status_not_confined .and. no_shell .and. uses_gmsh(file)) then
      call set_error(error, file//': --no-shell needs Linux with seccomp: without it gmsh cannot be kept from '// &
                     'starting programs', exit_machine)
    else if (status == status_not_found .or. status == status_not_executable) then
      if (uses_gmsh(file)) then
        call set_error(error, executable(file)//', which meshes geometries, was not found: install it (Debian: apt '// &
                       'install gmsh), set DOTYK_GMSH to its path, or give a .msh file', exit_bad_input)
      else
        call set_error(error, file//': '//executable(file)//', which converts meshes, was not found: install it '// &
                       '(Debian: apt install python3 python3-numpy python3-meshio), set DOTYK_PYTHON to its path, '// &
                       'or give a .msh file of the format 4.1', exit_bad_input)
      end if
    else if (len(log%errors) > 0 .and. .not. uses_gmsh(file)) then
      ! The converter names the file and the line.
      call set_error(error, log%errors(4:))
    else
      errors = log%errors
      if (len(errors) == 0) errors = new_line('a')//'  exit status '//to_text(status)
      if (status >= status_crashed .and. len(script) > 0) &
        errors = errors//crash_text(gmsh_command(file, dimension, temporary, .true.), script, temporary, no_shell)
      call set_error(error, file//': '//trim(merge('gmsh could not mesh it', 'it was not converted  ', &
                                                   uses_gmsh(file)))// &
                     trim(merge(' under --no-shell', '                 ', no_shell .and. uses_gmsh(file)))//':'// &
                     errors//advice(file, errors)//new_line('a')//'  (full log: '//base//'.log)')
    end if
  end subroutine explain_failure

  !> What is to be said where gmsh crashed on a CAD file: the solid at which it does so, found by one after another.
  function crash_text(command, script, temporary, no_shell) result(text)
    character(*), intent(in) :: command  !! The command for gmsh.
    character(*), intent(in) :: script  !! What gmsh reads after it.
    character(*), intent(in) :: temporary  !! Path of temporary files without extension.
    logical, intent(in) :: no_shell  !! Whether gmsh may start no program and write no other file.
    character(:), allocatable :: text
    integer :: i, status
    text = new_line('a')//'  gmsh crashed'
    call remove_file(temporary//'.geo')
    do i = 1, most_tried
      call write_new(temporary//'.geo', script_of_solid(i)//script)
      call run_command(command, temporary//'.log', status, confined=no_shell)
      call remove_file(temporary//'.geo')
      if (interrupted()) return
      if (status >= status_crashed) text = text//' at solid '//to_text(i)
      if (status /= 0) exit
    end do
    text = text//', as it does where a curved face ends in a point, such as the apex of a cone: blunt or cut the '// &
           'solid there, try another mesh_size or mesh_order=1, or mesh it by a .geo file'
  end function crash_text
end module dotyk_mesh_conversion
