!> What the mesh of a .geo file depends on: the files that it reads, and what no file tells (the environment, the time,
!> names that gmsh computes, the output of programs). Found by a scan of the text with the lexical rules of gmsh 4;
!> macros, loops and conditions are not followed, so that more may be found than gmsh comes to.
module dotyk_mesh_geometry_sources
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_content_hash, only: content_hash_t
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: why_no_file
  use dotyk_base_kinds, only: int64
  use dotyk_base_operating_system, only: directory_of, environment_value
  use dotyk_base_text, only: lower, text_t, to_text
  use dotyk_mesh_geometry_tokens, only: geometry_token_t, next_token, token_end, token_mark, token_text, token_word
  implicit none
  private

  type, public :: geometry_sources_t  !! Files that gmsh reads for a geometry.
    integer :: n = 0  !! Number of files.
    type(text_t), allocatable :: file(:)  !! Their paths; the geometry is the first (room).
    !> Why the content of the files does not determine the mesh, with file and line, as in "GetEnv in part.geo:3";
    !> not allocated where it does.
    character(:), allocatable :: doubt
    !> First statement that lets gmsh start a program, with file and line; not allocated where there is none.
    character(:), allocatable :: command
    !> First statement that reads a file by the name in a variable; a doubt where texts are computed.
    character(:), allocatable, private :: variable
    logical, private :: computes = .false.  !! Whether texts are computed somewhere.
    integer, private :: n_names = 0  !! Number of texts in quotes.
    type(text_t), allocatable, private :: name(:)  !! Texts in quotes, each of which may name a file (room).
    integer, private :: n_directories = 0  !! Number of directories.
    type(text_t), allocatable, private :: directory(:)  !! Directories that names may be relative to (room).
  contains
    procedure :: find => sources_find
    procedure :: add_to => sources_add_to
  end type geometry_sources_t

  !> Words behind which the name of a file follows that gmsh reads.
  character(*), parameter :: readers(*) = [character(20) :: 'Include', 'Merge', 'MergeWithBoundingBox', &
                                           'ShapeFromFile', 'ListFromFile', 'FileExists', 'FileName']
  !> Words that start a program, in a statement or as a mesh size field.
  character(*), parameter :: starters(*) = [character(22) :: 'SystemCall', 'System', 'NonBlockingSystemCall', &
                                            'OnelabRun', 'ExternalProcess']
  !> Words whose value no file tells.
  character(*), parameter :: outside(*) = [character(20) :: 'GetEnv', 'Today', 'Cpu', 'Memory', 'TotalMemory', &
                                           'OnelabAction', 'AutoLoadDatabase']
  !> Functions that compute texts.
  character(*), parameter :: builders(*) = [character(20) :: 'StrCat', 'Str', 'StrChoice', 'StrPrefix', &
                                            'StrRelative', 'StrReplace', 'StrSub', 'Sprintf', 'UpperCase', &
                                            'LowerCase', 'LowerCaseIn', 'AbsolutePath', 'DirName', &
                                            'CurrentDirectory', 'CurrentDir', 'CurrentFileName', 'FixRelativePath', &
                                            'NameToString', 'N2S', 'GetString', 'GetStringValue', 'GetForcedStr']
  !> Extensions of files that are no text in gmsh's language.
  character(*), parameter :: data_files(*) = &
    [character(8) :: 'step', 'stp', 'iges', 'igs', 'brep', 'brp', 'rle', 'xao', 'sat', 'x_t', 'x_b', 'stl', 'msh', &
    'unv', 'med', 'mmed', 'rmed', 'cgns', 'vtk', 'bdf', 'nas', 'dat', 'p3d', 'mesh', 'off', 'obj', 'ply', 'ply2', &
    'wrl', 'nii', 'neu', 'diff', 'png', 'jpg', 'jpeg', 'bmp', 'pch']
  !> Extensions of files for which gmsh starts a program where it merges them.
  character(*), parameter :: programs(*) = [character(8) :: 'gz', 'py', 'm', 'exe']

contains

  !> Find the sources of a geometry.
  subroutine sources_find(self, geometry, error)
    class(geometry_sources_t), intent(out) :: self
    character(*), intent(in) :: geometry  !! Path of the .geo file.
    type(error_t), allocatable, intent(out) :: error  !! Set if the geometry cannot be read.
    type(byte_cursor_t) :: cursor
    type(error_t), allocatable :: not_read
    integer :: i
    allocate (self%file(16), self%name(16), self%directory(4))
    ! gmsh takes names relative to the file that contains them, to the geometry, or to the working directory.
    call add_directory(self, '')
    call add_path(self, geometry)
    i = 0
    do while (i < self%n)
      i = i + 1
      call cursor%load(self%file(i)%s, not_read)
      if (i == 1) call move_alloc(not_read, error)
      if (allocated(error)) return
      if (allocated(not_read)) cycle
      if (.not. is_one_of(extension(self%file(i)%s), data_files)) &
        call scan(self, self%file(i)%s, cursor%text(:cursor%size))
    end do
    if (allocated(self%variable) .and. self%computes) call note(self%doubt, self%variable)
    if (allocated(self%command)) call note(self%doubt, self%command)
  end subroutine sources_find

  !> Add the contents of all sources to a hash.
  subroutine sources_add_to(self, hash, error)
    class(geometry_sources_t), intent(in) :: self
    type(content_hash_t), intent(inout) :: hash  !! The hash.
    type(error_t), allocatable, intent(out) :: error  !! Set if a file cannot be read.
    character(:), allocatable :: home
    integer :: i
    do i = 1, self%n
      call hash%add_file(self%file(i)%s, error)
      if (allocated(error)) return
    end do
    home = environment_value('GMSH_HOME')
    if (len(home) == 0) home = environment_value('HOME')
    call add_options(home//'/.gmshrc', hash)
    call add_options(home//'/.gmsh-options', hash)
  end subroutine sources_add_to

  !> Add the options of the user, which gmsh reads at its start, but for windows and recent files ("General.").
  subroutine add_options(path, hash)
    character(*), intent(in) :: path  !! Path of the file; it need not exist.
    type(content_hash_t), intent(inout) :: hash  !! The hash.
    type(byte_cursor_t) :: cursor
    type(error_t), allocatable :: not_read
    character(:), allocatable :: line
    call cursor%load(path, not_read)
    if (allocated(not_read)) return
    do while (cursor%position <= cursor%size)
      call cursor%get_line(line)
      if (index(line, 'General.') /= 1 .and. index(line, '//') /= 1 .and. len_trim(line) > 0) &
        call hash%add(line//new_line('a'))
    end do
  end subroutine add_options

  !> Look for names, doubts and commands in a file.
  subroutine scan(self, file, text)
    type(geometry_sources_t), intent(inout) :: self  !! The sources; completed.
    character(*), intent(in) :: file  !! Path of the file.
    character(*), intent(in) :: text  !! Its content.
    type(geometry_token_t) :: token, argument
    integer(int64) :: position
    integer :: line
    position = 1
    line = 1
    call next_token(text, position, line, token)
    do while (token%kind /= token_end)
      argument%kind = token_end
      select case (token%kind)
      case (token_text)
        call add_name(self, token%text)
      case (token_word)
        if (is_one_of(token%text, starters)) then
          if (.not. is_assigned()) call note(self%command, place(token))
        end if
        if (is_one_of(token%text, outside)) call note(self%doubt, place(token))
        if (is_one_of(token%text, builders)) self%computes = .true.
        if (is_one_of(token%text, readers)) call read_argument()
      end select
      if (argument%kind == token_end) call next_token(text, position, line, argument)
      token = argument
    end do

  contains

    !> Whether the token is a variable that gets a value.
    logical function is_assigned()
      type(geometry_token_t) :: behind
      integer(int64) :: ahead
      integer :: its_line
      ahead = position
      its_line = line
      call next_token(text, ahead, its_line, behind)
      is_assigned = behind%text == '='
    end function is_assigned

    !> Look at the name behind a word that reads a file: `argument` is the first token that is not a bracket.
    subroutine read_argument()
      type(geometry_token_t) :: behind
      integer(int64) :: ahead
      integer :: its_line
      do
        call next_token(text, position, line, argument)
        if (argument%kind /= token_mark .or. scan_set(argument%text, '([=') == 0) exit
      end do
      ahead = position
      its_line = line
      call next_token(text, ahead, its_line, behind)
      if (argument%kind == token_text .and. is_one_of(extension(argument%text), programs)) then
        call note(self%command, place(token)//" of '"//argument%text//"'")
      else if (argument%kind == token_text .and. token%text == 'Include' .and. &
               is_one_of(extension(argument%text), data_files)) then
        call note(self%doubt, place(token)//" of '"//argument%text//"'")
      else if (behind%kind /= token_mark .or. scan_set(behind%text, ';)],') == 0) then
        call note(self%doubt, place(token)//' with a computed name')
      else if (argument%kind == token_word) then
        call note(self%variable, place(token)//' with a computed name')
      end if
    end subroutine read_argument

    !> Word and place of a token, as in "GetEnv in part.geo:3".
    function place(token) result(words)
      type(geometry_token_t), intent(in) :: token  !! The token.
      character(:), allocatable :: words
      words = token%text//' in '//file//':'//to_text(token%line)
    end function place
  end subroutine scan

  !> Position of the first letter of a set in a text; 0 where there is none.
  pure integer function scan_set(text, set)
    character(*), intent(in) :: text  !! The text.
    character(*), intent(in) :: set  !! Letters.
    scan_set = 0
    if (len(text) > 0) scan_set = index(set, text(1:1))
  end function scan_set

  !> Keep the first of several remarks.
  subroutine note(remark, text)
    character(:), allocatable, intent(inout) :: remark  !! The remark; unchanged where it is allocated.
    character(*), intent(in) :: text  !! Its text.
    if (.not. allocated(remark)) remark = text
  end subroutine note

  !> Whether a word is in a list.
  pure logical function is_one_of(word, list)
    character(*), intent(in) :: word  !! The word.
    character(*), intent(in) :: list(:)  !! The list (n).
    is_one_of = len(word) > 0 .and. any(list == word)
  end function is_one_of

  !> Extension of a path without its point, in lower case; empty where it has none.
  pure function extension(path) result(ending)
    character(*), intent(in) :: path  !! The path.
    character(:), allocatable :: ending
    integer :: point
    point = index(path, '.', back=.true.)
    ending = ''
    if (point > index(path, '/', back=.true.)) ending = lower(path(point + 1:))
  end function extension

  !> Add a text in quotes, and the files that it names.
  subroutine add_name(self, name)
    type(geometry_sources_t), intent(inout) :: self  !! The sources; completed.
    character(*), intent(in) :: name  !! Text in quotes.
    integer :: i
    if (len_trim(name) == 0 .or. index(name, achar(0)) > 0) return
    if (.not. is_new(self%name, self%n_names, name)) return
    call append(self%name, self%n_names, name)
    if (name(1:1) == '/') then
      call add_path(self, name)
      return
    end if
    do i = 1, self%n_directories
      call add_path(self, self%directory(i)%s//name)
    end do
  end subroutine add_name

  !> Add a directory, and the files in it that the texts in quotes name.
  subroutine add_directory(self, directory)
    type(geometry_sources_t), intent(inout) :: self  !! The sources; completed.
    character(*), intent(in) :: directory  !! Directory with its slash; empty: the working directory.
    integer :: i, n
    if (.not. is_new(self%directory, self%n_directories, directory)) return
    call append(self%directory, self%n_directories, directory)
    n = self%n_names
    do i = 1, n
      if (self%name(i)%s(1:1) /= '/') call add_path(self, directory//self%name(i)%s)
    end do
  end subroutine add_directory

  !> Add a file if it exists, the options beside it, and its directory.
  recursive subroutine add_path(self, path)
    type(geometry_sources_t), intent(inout) :: self  !! The sources; completed.
    character(*), intent(in) :: path  !! Path.
    ! The geometry itself is added in any case: its absence is reported.
    if (self%n > 0) then
      if (len(why_no_file(path)) > 0) return
    end if
    if (.not. is_new(self%file, self%n, path)) return
    call append(self%file, self%n, path)
    call add_directory(self, directory_of(path))
    ! gmsh reads this file of options by itself.
    call add_path(self, path//'.opt')
  end subroutine add_path

  !> Whether a text is in no list.
  pure logical function is_new(list, n, text)
    type(text_t), intent(in) :: list(:)  !! Texts (room).
    integer, intent(in) :: n  !! Number of texts in use.
    character(*), intent(in) :: text  !! The text.
    integer :: i
    is_new = .false.
    do i = 1, n
      if (len(list(i)%s) == len(text) .and. list(i)%s == text) return
    end do
    is_new = .true.
  end function is_new

  !> Append a text to a list.
  subroutine append(list, n, text)
    type(text_t), allocatable, intent(inout) :: list(:)  !! Texts (room).
    integer, intent(inout) :: n  !! Number of texts in use.
    character(*), intent(in) :: text  !! The text.
    type(text_t), allocatable :: larger(:)
    integer :: i
    if (n == size(list)) then
      allocate (larger(2*n))
      do i = 1, n
        call move_alloc(list(i)%s, larger(i)%s)
      end do
      call move_alloc(larger, list)
    end if
    n = n + 1
    list(n)%s = text
  end subroutine append
end module dotyk_mesh_geometry_sources
