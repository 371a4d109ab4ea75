!> Input files and their paths: whole texts, paths relative to the namelist file, why a file cannot be read.
module dotyk_input_paths
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_files, only: is_cad_file, nature_of, why_no_file
  use dotyk_base_text, only: lower, quoted
  implicit none
  private
  public :: read_text, refuse_other_content, resolve_path, extension_of, without_extension, &
    why_not_readable, is_directory

contains

  !> The whole text of a file.
  subroutine read_text(file, text, error)
    character(*), intent(in) :: file  !! Path.
    character(:), allocatable, intent(out) :: text  !! Its bytes.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be read.
    character(:), allocatable :: reason
    integer :: unit, status, size
    text = ''
    reason = why_not_readable(file)
    if (len(reason) > 0) then
      call set_error(error, 'cannot read '//quoted(file)//': it '//reason)
      return
    end if
    open (newunit=unit, file=file, access='stream', form='unformatted', action='read', status='old', iostat=status)
    if (status == 0) inquire (unit=unit, size=size)
    if (status == 0 .and. size > 0) then
      deallocate (text)
      allocate (character(size) :: text)
      read (unit, iostat=status) text
    end if
    if (status /= 0) call set_error(error, 'cannot read '//quoted(file))
    close (unit, iostat=status)
  end subroutine read_text

  !> Refuse a file that is plainly no namelist.
  subroutine refuse_other_content(file, text, error)
    character(*), intent(in) :: file  !! Path, for the message.
    character(*), intent(in) :: text  !! Its bytes.
    type(error_t), allocatable, intent(inout) :: error  !! Where the file is something else; unchanged otherwise.
    character(:), allocatable :: nature, advice, kind, first
    ! Bytes in which the first word is looked for.
    integer, parameter :: most_before = 200
    nature = nature_of(text)
    advice = ": a scene names it by mesh='...' of &scene or &body"
    first = text(:min(len(text), most_before))
    kind = extension_of(file)
    ! No namelist begins like this.
    if (index(adjustl(first), '*') == 1) kind = '.inp'
    if (index(adjustl(first), 'ISO-10303-21') == 1) kind = '.step'
    if (is_cad_file(file) .and. nature == 'a binary file') nature = ''
    if (kind == '.med' .and. nature == 'an HDF5 file') nature = ''
    if (len(nature) == 0 .and. len(text) > 0) then
      if (kind == '.geo') nature = 'a geometry of gmsh'
      if (is_cad_file('a'//kind)) nature = 'a CAD file'
      if (any(kind == ['.msh', '.vtu', '.med'])) nature = 'a mesh'
      if (kind == '.inp') then
        nature = 'a deck of Abaqus or CalculiX'
        advice = ': dotyk-convert makes a first scene from it; as a mesh, '//advice(3:)
      end if
    end if
    if (len(nature) == 0) return
    if (nature == 'UTF-16 text') advice = ': save it as UTF-8'
    if (nature == 'an HDF5 file' .or. nature == 'a binary file') advice = ''
    call set_error(error, quoted(file)//' is '//nature//', no namelist file'//advice)
  end subroutine refuse_other_content

  !> A path relative to a directory, unless it is absolute.
  pure function resolve_path(directory, path) result(resolved)
    character(*), intent(in) :: directory  !! Directory with a slash at the end, or empty.
    character(*), intent(in) :: path  !! Path, absolute or relative.
    character(:), allocatable :: resolved
    resolved = directory//path
    if (len(path) == 0) resolved = ''
    if (index(path, '/') == 1) resolved = path
  end function resolve_path

  !> Place of the last point of a file name, where its extension begins; behind the end where it has none.
  pure integer function extension_start(file) result(start)
    character(*), intent(in) :: file  !! Path of the file.
    start = index(file, '.', back=.true.)
    if (start <= index(file, '/', back=.true.) + 1) start = len(file) + 1
  end function extension_start

  !> Extension of a file in lower case, with its point; empty where it has none.
  pure function extension_of(file) result(extension)
    character(*), intent(in) :: file  !! Path of the file.
    character(:), allocatable :: extension
    extension = lower(file(extension_start(file):))
  end function extension_of

  !> A path without its extension.
  pure function without_extension(file) result(stem)
    character(*), intent(in) :: file  !! Path of the file.
    character(:), allocatable :: stem
    stem = file(:extension_start(file) - 1)
  end function without_extension

  !> Why a file cannot be read, as in "does not exist" or "cannot be opened"; empty where it can.
  function why_not_readable(file) result(reason)
    character(*), intent(in) :: file  !! Path of the file.
    character(:), allocatable :: reason
    integer :: unit, status
    reason = why_no_file(file)
    if (len(reason) > 0) return
    open (newunit=unit, file=file, access='stream', form='unformatted', action='read', status='old', iostat=status)
    if (status /= 0) then
      reason = 'cannot be opened'
    else
      close (unit)
    end if
  end function why_not_readable

  !> Whether a path is a directory.
  logical function is_directory(path)
    character(*), intent(in) :: path  !! Path to look at.
    inquire (file=path//'/.', exist=is_directory)
  end function is_directory
end module dotyk_input_paths
