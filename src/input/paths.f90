!> Files and paths: whole texts, places next to the namelist file, what stands in the way of reading.
module dotyk_input_paths
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_files, only: nature_of, why_no_file
  use dotyk_base_text, only: lower, quoted
  implicit none
  private
  public :: read_text, refuse_other_content, directory_of, resolve_path, extension_of, without_extension, &
            why_not_readable, is_directory

contains

  !> The whole text of a file.
  subroutine read_text(file, text, error)
    !> Path.
    character(*), intent(in) :: file
    !> Its bytes.
    character(:), allocatable, intent(out) :: text
    !> Where it cannot be read.
    type(error_t), allocatable, intent(out) :: error
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

  !> Refuse a file that is plainly something else, in a few words.
  subroutine refuse_other_content(file, text, error)
    character(*), intent(in) :: file
    !> Its bytes.
    character(*), intent(in) :: text
    !> Left as it is where all is well.
    type(error_t), allocatable, intent(inout) :: error
    character(:), allocatable :: nature, advice
    nature = nature_of(text)
    if (len(nature) == 0 .and. extension_of(file) == '.geo') nature = 'a geometry of gmsh'
    if (len(nature) == 0) return
    advice = ''
    if (nature == 'UTF-16 text') advice = ': save it as UTF-8'
    if (index(nature, 'gmsh') > 0) advice = ": one names it in &scene mesh='...'"
    call set_error(error, quoted(file)//' is '//nature//', no namelist file'//advice)
  end subroutine refuse_other_content

  !> Directory of a file, with a slash at the end; empty where the path has none.
  pure function directory_of(file) result(directory)
    character(*), intent(in) :: file
    character(:), allocatable :: directory
    directory = file(:index(file, '/', back=.true.))
  end function directory_of

  !> A path relative to a directory, unless it is absolute.
  pure function resolve_path(directory, path) result(resolved)
    !> With a slash at the end, or empty.
    character(*), intent(in) :: directory
    character(*), intent(in) :: path
    character(:), allocatable :: resolved
    resolved = directory//path
    if (len(path) == 0) resolved = ''
    if (index(path, '/') == 1) resolved = path
  end function resolve_path

  !> Where the extension of a file begins: its last point, or one behind the end.
  pure integer function extension_start(file) result(start)
    character(*), intent(in) :: file
    start = index(file, '.', back=.true.)
    if (start <= index(file, '/', back=.true.) + 1) start = len(file) + 1
  end function extension_start

  !> The extension of a file in lower case, with its point; empty where it has none.
  pure function extension_of(file) result(extension)
    character(*), intent(in) :: file
    character(:), allocatable :: extension
    extension = lower(file(extension_start(file):))
  end function extension_of

  !> A path without its extension.
  pure function without_extension(file) result(stem)
    character(*), intent(in) :: file
    character(:), allocatable :: stem
    stem = file(:extension_start(file) - 1)
  end function without_extension

  !> Why a file cannot be read: "cannot be opened", or what `why_no_file` says; empty where it can.
  function why_not_readable(file) result(reason)
    character(*), intent(in) :: file
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

  !> Is there a directory of this path?
  logical function is_directory(path)
    character(*), intent(in) :: path
    inquire (file=path//'/.', exist=is_directory)
  end function is_directory
end module dotyk_input_paths
