!> Meshing of a geometry with the gmsh executable, once for each content of the geometry.
!>
!> The mesh is cached (`dotyk_mesh_mesh_cache`) under a name with a hash of the files that gmsh reads
!> (`dotyk_mesh_geometry_sources`), of the dimension and of the version of gmsh. It is written under a temporary name
!> and renamed, so that concurrent runs never read an incomplete mesh. Where the files do not determine the mesh, it is
!> made at each run. The environment variable DOTYK_GMSH names another executable than `gmsh`.
module dotyk_mesh_gmsh_run
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_content_hash, only: content_hash_t
  use dotyk_base_error, only: error_t, set_error, exit_bad_input, exit_machine, exit_not_written
  use dotyk_base_files, only: is_cad_file, is_med_file, is_stl_file, own_mark, remove_leftovers, write_new
  use dotyk_base_interrupt, only: run_shell => run_command, interrupted, status_not_confined, stop_if_interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_memory, only: set_stage, stage_text
  use dotyk_base_operating_system, only: rename_file, remove_file, shell_quoted, directory_of, environment_value
  use dotyk_base_text, only: to_text
  use dotyk_mesh_cad_script, only: cad_script, script_of_solid
  use dotyk_mesh_geometry_sources, only: geometry_sources_t
  use dotyk_mesh_gmsh_log, only: advice, is_complete, read_log
  use dotyk_mesh_mesh_cache, only: find_cache
  implicit none
  private
  public :: mesh_geometry

  type, public :: meshing_t  !! How geometries are meshed, and what is to be said about one.
    logical :: no_shell = .false.  !! Whether geometries may start no program and write no file but the mesh.
    logical :: for_once = .false.  !! Whether the mesh is for this run only: the caller deletes it.
    real(dp) :: size = 0  !! Size of the elements of CAD files, not positive: by each solid [length]; and their order.
    integer :: order = 2
    character(:), allocatable :: remark  !! Remark for the log; empty where there is none.
  end type meshing_t

  !> Exit status of the shell for a program that it does not find or cannot run.
  integer, parameter :: status_not_executable = 126, status_not_found = 127
  !> Exit status of the shell for a program that crashed, and the greatest number of solids that are tried for it.
  integer, parameter :: status_crashed = 128, most_tried = 40

contains

  !> Mesh a geometry, unless its mesh is cached.
  subroutine mesh_geometry(geo_file, dimension, msh_file, error, meshing)
    character(*), intent(in) :: geo_file  !! Path of the geometry.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    character(:), allocatable, intent(out) :: msh_file  !! Path of the mesh.
    !> Set if the geometry cannot be read or meshed, or starts programs that are forbidden, gmsh is not found, or no
    !> directory for the mesh can be written.
    type(error_t), allocatable, intent(out) :: error
    !> What geometries may do; on return, what was found in this one. Nothing is forbidden if absent.
    type(meshing_t), intent(inout), optional :: meshing
    type(meshing_t) :: local
    character(:), allocatable :: stage
    if (present(meshing)) local = meshing
    ! Threads of one process would use the same temporary names.
    !$omp critical (dotyk_mesh_geometry)
    stage = stage_text()
    call set_stage('meshing '//geo_file//' with gmsh')
    call find_mesh(geo_file, dimension, local, msh_file, error)
    call set_stage(stage)
    !$omp end critical (dotyk_mesh_geometry)
    if (present(meshing)) meshing = local
  end subroutine mesh_geometry

  !> Find the mesh for the present content of a geometry, or make it.
  subroutine find_mesh(geo_file, dimension, meshing, msh_file, error)
    character(*), intent(in) :: geo_file  !! Path of the geometry.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    type(meshing_t), intent(inout) :: meshing  !! What geometries may do; what was found is set.
    character(:), allocatable, intent(out) :: msh_file  !! Path of the mesh.
    !> Set if the geometry cannot be read or meshed, or starts programs that are forbidden, gmsh is not found, or no
    !> directory for the mesh can be written.
    type(error_t), allocatable, intent(out) :: error
    type(geometry_sources_t) :: sources
    character(:), allocatable :: base, script
    logical :: found, is_lost
    meshing%remark = ''
    call sources%find(geo_file, error)
    if (allocated(error)) return
    if (allocated(sources%command) .and. meshing%no_shell) then
      call set_error(error, geo_file//': --no-shell forbids programs: '//sources%command//' starts one')
      return
    end if
    is_lost = .false.
    if (.not. (is_cad_file(geo_file) .or. is_med_file(geo_file))) is_lost = loses_statements(geo_file)
    if (is_lost) then
      call set_error(error, geo_file//': its last line has no end of line and several statements, of which gmsh '// &
                     'would read the first: end the file with a newline')
      return
    end if
    script = ''
    if (is_cad_file(geo_file)) script = cad_script(meshing%size, meshing%order, is_stl_file(geo_file))
    call name_mesh(geo_file, dimension, sources, script, base, error)
    if (allocated(error)) return
    meshing%for_once = allocated(sources%doubt)
    if (meshing%for_once) then
      meshing%remark = geo_file//' is meshed at each run, its mesh may depend on more than its files: '//sources%doubt
      if (allocated(sources%command)) &
        meshing%remark = 'warning: '//geo_file//' starts a program: '//sources%command// &
                         '; it is meshed at each run. --no-shell forbids programs to geometries'
      msh_file = base//own_mark()//'.once.msh'
      call run_gmsh(geo_file, dimension, script, base, meshing%no_shell, msh_file, error)
      return
    end if
    msh_file = base//'.msh'
    inquire (file=msh_file, exist=found)
    if (.not. found) call run_gmsh(geo_file, dimension, script, base, meshing%no_shell, msh_file, error)
  end subroutine find_mesh

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

  !> Path, without extension, of the mesh for the present content of a geometry.
  subroutine name_mesh(geo_file, dimension, sources, script, base, error)
    character(*), intent(in) :: geo_file  !! Path of the geometry.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    type(geometry_sources_t), intent(in) :: sources  !! Files of the geometry.
    character(*), intent(in) :: script  !! What gmsh reads after it; may be empty.
    character(:), allocatable, intent(out) :: base  !! Path of the mesh without its extension.
    !> Set if a file cannot be read, gmsh is not found, or no directory for the mesh can be written.
    type(error_t), allocatable, intent(out) :: error
    type(content_hash_t) :: hash
    character(:), allocatable :: directory, name, version
    call sources%add_to(hash, error)
    if (allocated(error)) return
    call find_cache(geo_file, directory, error)
    if (allocated(error)) return
    name = geo_file(len(directory_of(geo_file)) + 1:)
    if (index(name, '.', back=.true.) > 1) name = name(:index(name, '.', back=.true.) - 1)
    call find_version(directory, directory//name//own_mark()//'.version', version, error)
    if (allocated(error)) return
    call hash%add(version//to_text(dimension)//script)
    base = directory//name//'-'//to_text(dimension)//'d-'//hash%digits()
  end subroutine name_mesh

  !> Version of gmsh. The result of the last query is cached in the directory for meshes and used while the executable
  !> is the same file: starting gmsh takes a tenth of a second.
  subroutine find_version(directory, log_file, version, error)
    character(*), intent(in) :: directory  !! Directory for meshes, with its slash.
    character(*), intent(in) :: log_file  !! Path for output, removed afterwards.
    character(:), allocatable, intent(out) :: version  !! Version.
    type(error_t), allocatable, intent(out) :: error  !! Set if gmsh is not found or fails.
    type(error_t), allocatable :: ignored
    type(byte_cursor_t) :: note
    character(:), allocatable :: identity, line
    integer :: unit, status
    logical :: found
    identity = ''
    call run_command('stat -L -c "%n %s %y" "$(command -v '//shell_quoted(executable())//')"', log_file, status)
    if (status == 0) call note%load(log_file, ignored)
    if (status == 0 .and. .not. allocated(ignored)) call note%get_line(identity)
    inquire (file=directory//'gmsh.version', exist=found)
    if (found .and. len(identity) > 0) then
      call note%load(directory//'gmsh.version', ignored)
      if (.not. allocated(ignored)) then
        call note%get_line(line)
        call note%get_word(version)
        if (line == identity .and. len(version) > 0) then
          call remove_file(log_file)
          return
        end if
      end if
    end if
    call query_version(log_file, version, error)
    if (allocated(error) .or. len(identity) == 0) return
    open (newunit=unit, file=log_file, action='write', status='replace', iostat=status)
    if (status /= 0) return
    write (unit, '(a)', iostat=status) identity, version
    close (unit)
    if (status == 0) found = rename_file(log_file, directory//'gmsh.version')
    if (status /= 0) call remove_file(log_file)
  end subroutine find_version

  !> Version of gmsh, from the executable.
  subroutine query_version(log_file, version, error)
    character(*), intent(in) :: log_file  !! Path for its output, removed afterwards.
    character(:), allocatable, intent(out) :: version  !! Version.
    type(error_t), allocatable, intent(out) :: error  !! Set if gmsh is not found or fails, or on an interrupt.
    type(byte_cursor_t) :: log
    integer :: status
    call run_command(shell_quoted(executable())//' --version', log_file, status)
    call stop_if_interrupted(error)
    if (allocated(error)) then
      continue
    else if (status == status_not_found .or. status == status_not_executable) then
      call set_error(error, executable()//', which meshes geometries, was not found: install it '// &
                     '(Debian: apt install gmsh), set DOTYK_GMSH to its path, or give a .msh file', exit_bad_input)
    else if (status /= 0) then
      call set_error(error, executable()//' --version failed with exit status '//to_text(status), exit_bad_input)
    else
      call log%load(log_file, error)
    end if
    call remove_file(log_file)
    if (allocated(error)) return
    call log%get_word(version)
  end subroutine query_version

  !> Path of the gmsh executable.
  function executable() result(path)
    character(:), allocatable :: path  !! Path.
    path = environment_value('DOTYK_GMSH')
    if (len(path) == 0) path = 'gmsh'
  end function executable

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

  !> Make a mesh; the output of gmsh is kept in `base`.log.
  subroutine run_gmsh(geo_file, dimension, script, base, no_shell, msh_file, error)
    character(*), intent(in) :: geo_file  !! Path of the geometry.
    integer, intent(in) :: dimension  !! Largest dimension of the elements, 2 or 3.
    character(*), intent(in) :: script  !! What gmsh reads after it; may be empty.
    character(*), intent(in) :: base  !! Path of the cached mesh without its extension.
    logical, intent(in) :: no_shell  !! Whether gmsh may start no program and write no other file.
    character(*), intent(in) :: msh_file  !! Path of the mesh.
    !> Set if gmsh fails or makes no complete mesh, if the mesh cannot be renamed, or on an interrupt.
    type(error_t), allocatable, intent(out) :: error
    type(byte_cursor_t) :: log
    character(:), allocatable :: path, temporary, errors, counts, more, task
    integer :: status
    path = geo_file
    ! gmsh would read a name with a leading minus as an option.
    if (path(1:1) == '-') path = './'//path
    call remove_leftovers(base)
    temporary = base//own_mark()
    if (temporary(1:1) == '-') temporary = './'//temporary
    more = ''
    if (len(script) > 0) then
      call write_new(temporary//'.geo', script)
      more = ' '//shell_quoted(temporary//'.geo')
      ! Solids get the names of the file.
      path = ' -setnumber Geometry.OCCImportLabels 1 '//shell_quoted(path)
    else
      path = ' '//shell_quoted(path)
    end if
    ! Meshes are converted only.
    task = ' -'//to_text(dimension)
    if (is_med_file(geo_file)) task = ' -save'
    call run_command(shell_quoted(executable())//task//' -format msh41 -bin -o '// &
                     shell_quoted(temporary//'.msh')//path//more, temporary//'.log', status, confined=no_shell)
    if (len(script) > 0) call remove_file(temporary//'.geo')
    if (interrupted()) then
      call remove_file(temporary//'.log')
      call remove_file(temporary//'.msh')
      call stop_if_interrupted(error)
      return
    end if
    if (status == status_not_confined .and. no_shell) then
      call set_error(error, geo_file//': --no-shell needs Linux with seccomp: without it gmsh cannot be kept from '// &
                     'starting programs', exit_machine)
      return
    end if
    call log%load(temporary//'.log', error)
    if (allocated(error)) return
    if (.not. rename_file(temporary//'.log', base//'.log')) call remove_file(temporary//'.log')
    call read_log(log, errors, counts)
    if (status /= 0 .or. len(errors) > 0) then
      if (len(errors) == 0) errors = new_line('a')//'  exit status '//to_text(status)
      if (status >= status_crashed .and. len(script) > 0) &
        errors = errors//crash_text(path, dimension, script, temporary, no_shell)
      errors = errors//advice(geo_file, errors)
      call set_error(error, geo_file//': gmsh could not mesh it'//trim(merge(' under --no-shell', '                 ', &
                     no_shell))//':'//errors//new_line('a')//'  (full log: '//base//'.log)')
    else if (index(counts, ' 0 elements') > 0) then
      call set_error(error, geo_file//': gmsh made no elements: the geometry is empty')
    else if (.not. is_complete(temporary//'.msh')) then
      call set_error(error, geo_file//': gmsh did not write a complete mesh to '//directory_of(base)// &
                     ': does the geometry set Mesh.Format or call Exit, or is the disk full?')
    else if (.not. rename_file(temporary//'.msh', msh_file)) then
      call set_error(error, msh_file//': cannot be written', exit_not_written)
    end if
    if (allocated(error)) call remove_file(temporary//'.msh')
  end subroutine run_gmsh

  !> What is to be said where gmsh crashed on a CAD file: the solid at which it does so, found by one after another.
  function crash_text(path, dimension, script, temporary, no_shell) result(text)
    character(*), intent(in) :: path  !! Path of the file with the options before it, for the shell.
    integer, intent(in) :: dimension  !! Largest dimension of the elements.
    character(*), intent(in) :: script  !! What gmsh reads after it.
    character(*), intent(in) :: temporary  !! Path of temporary files without extension.
    logical, intent(in) :: no_shell  !! Whether gmsh may start no program and write no other file.
    character(:), allocatable :: text
    integer :: i, status
    text = new_line('a')//'  gmsh crashed'
    do i = 1, most_tried
      call write_new(temporary//'.geo', script_of_solid(i)//script)
      call run_command(shell_quoted(executable())//' -'//to_text(dimension)//' -o '//shell_quoted(temporary//'.msh')// &
                       path//' '//shell_quoted(temporary//'.geo'), temporary//'.log', status, confined=no_shell)
      call remove_file(temporary//'.geo')
      call remove_file(temporary//'.msh')
      call remove_file(temporary//'.log')
      if (interrupted()) return
      if (status >= status_crashed) text = text//' at solid '//to_text(i)
      if (status /= 0) exit
    end do
    text = text//', as it does where a curved face ends in a point, such as the apex of a cone: blunt or cut the '// &
           'solid there, try another mesh_size or mesh_order=1, or mesh it by a .geo file'
  end function crash_text
end module dotyk_mesh_gmsh_run
