!> The few calls into the operating system that safe writing needs.
module dotyk_output_file_system
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use dotyk_base_error, only: error_t, exit_not_written, set_error
  use dotyk_base_files, only: is_protected, own_mark, remove_leftovers, sync_file, why_no_file
  use dotyk_base_text, only: quoted
  implicit none
  private

  interface
    integer(c_int) function c_rename(old, new) bind(c, name='rename')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: old(*), new(*)
    end function c_rename
    integer(c_int) function c_unlink(path) bind(c, name='unlink')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_unlink
  end interface

  public :: check_writable, check_replaceable, temporary_name, replace_file, delete_file

contains

  !> Whether a file can be created at a path, found out by creating one of a temporary name beside it; what is there
  !> already stays untouched. What killed runs left beside it is deleted.
  subroutine check_writable(path, error)
    character(*), intent(in) :: path
    !> Exit code `exit_not_written`.
    type(error_t), allocatable, intent(out) :: error
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

  !> Refuse to put results in the place of a file that is something else: the input, a mesh, somebody's notes.
  subroutine check_replaceable(path, error)
    character(*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    !> What files of HDF5 begin with, after one byte.
    character(*), parameter :: signature = 'HDF'
    character(4) :: head
    integer :: unit, status, length
    open (newunit=unit, file=path, access='stream', form='unformatted', action='read', status='old', iostat=status)
    if (status /= 0) return
    inquire (unit=unit, size=length)
    head = ''
    read (unit, iostat=status) head
    close (unit, iostat=status)
    if (length > 0 .and. head(2:) /= signature) call set_error(error, quoted(path)// &
      ' is there already and is no results file: give another name, or delete it', exit_not_written)
  end subroutine check_replaceable

  !> A name beside a path that no other running program uses.
  function temporary_name(path) result(name)
    character(*), intent(in) :: path
    character(:), allocatable :: name
    name = path//own_mark()//'.tmp'
  end function temporary_name

  !> Give a file another name in the same folder, in place of what may be there, in one step, once it is on the disk.
  subroutine replace_file(temporary, path, error)
    character(*), intent(in) :: temporary, path
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: reason
    call sync_file(temporary, reason)
    if (len(reason) > 0) then
      call set_error(error, quoted(path)//' cannot be written: '//reason, exit_not_written)
    else if (c_rename(temporary//c_null_char, path//c_null_char) /= 0) then
      call set_error(error, quoted(temporary)//' cannot be renamed to '//quoted(path), exit_not_written)
    end if
  end subroutine replace_file

  !> Delete a file, if it is there.
  subroutine delete_file(path)
    character(*), intent(in) :: path
    integer(c_int) :: ignored
    ignored = c_unlink(path//c_null_char)
  end subroutine delete_file
end module dotyk_output_file_system
