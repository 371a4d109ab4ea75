!> Safe writing of files: checks before the run, temporary names, replacement in one step.
module dotyk_output_file_system
  use dotyk_base_error, only: error_t, exit_not_written, set_error
  use dotyk_base_files, only: is_protected, own_mark, remove_leftovers, sync_file, why_no_file
  use dotyk_base_operating_system, only: rename_file
  use dotyk_base_text, only: quoted
  implicit none
  private

  public :: check_writable, check_replaceable, temporary_name, replace_file

contains

  !> Check that a file can be created at a path, by creating one of a temporary name beside it; an existing file stays
  !> untouched. Leftovers of killed runs are deleted.
  subroutine check_writable(path, error)
    character(*), intent(in) :: path  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where it cannot, with exit code `exit_not_written`.
    character(:), allocatable :: reason
    character(300) :: message
    integer :: unit, status, mark
    logical :: is_folder, exists
    inquire (file=path//'/.', exist=is_folder)
    if (len_trim(path) == 0) then
      call set_error(error, 'the results file has no name', exit_not_written)
      return
    else if (is_folder) then
      call set_error(error, quoted(path)//' cannot be written: it is a folder', exit_not_written)
      return
    end if
    inquire (file=path, exist=exists)
    if (exists) then
      reason = why_no_file(path)
      if (len(reason) == 0) then
        if (is_protected(path)) reason = 'is protected from being written'
      end if
      if (len(reason) > 0) then
        call set_error(error, quoted(path)//' cannot be written: it '//reason, exit_not_written)
        return
      end if
    end if
    call remove_leftovers(path)
    open (newunit=unit, file=temporary_name(path), status='replace', action='write', iostat=status, iomsg=message)
    if (status == 0) then
      close (unit, status='delete')
    else
      ! gfortran says "Cannot open file '...': reason".
      mark = index(message, ': ', back=.true.)
      reason = trim(message(merge(mark + 2, 1, mark > 0):))
      call set_error(error, quoted(path)//' cannot be written: '//reason, exit_not_written)
    end if
  end subroutine check_writable

  !> Refuse to replace a file that is no HDF5 file: the input, a mesh, notes.
  subroutine check_replaceable(path, error)
    character(*), intent(in) :: path  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file is there and no results file.
    character(*), parameter :: signature = 'HDF'  !! Second to fourth byte of HDF5 files.
    character(4) :: head
    integer :: unit, status, length
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read', status='old', iostat=status)
    if (status /= 0) return
    inquire (unit=unit, size=length)
    head = ''
    read (unit, iostat=status) head
    close (unit, iostat=status)
    if (length > 0 .and. head(2:) /= signature) &
      call set_error(error, quoted(path)//' exists and is not a results file: give another name, or delete it', &
                     exit_not_written)
  end subroutine check_replaceable

  !> Name beside a path that no other process uses.
  function temporary_name(path) result(name)
    character(*), intent(in) :: path  !! Path of the file.
    character(:), allocatable :: name
    name = path//own_mark()//'.tmp'
  end function temporary_name

  !> Write a file through to the disk and rename it in one step, in place of an existing file.
  subroutine replace_file(temporary, path, error)
    character(*), intent(in) :: temporary  !! Path of the finished file.
    character(*), intent(in) :: path  !! Its final path.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    character(:), allocatable :: reason
    call sync_file(temporary, reason)
    if (len(reason) > 0) then
      call set_error(error, quoted(path)//' cannot be written: '//reason, exit_not_written)
    else if (.not. rename_file(temporary, path)) then
      call set_error(error, quoted(temporary)//' cannot be renamed to '//quoted(path), exit_not_written)
    end if
  end subroutine replace_file
end module dotyk_output_file_system
