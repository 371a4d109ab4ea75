!> Services of the operating system: directories, renaming, environment, quoting for the shell.
module dotyk_base_operating_system
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  implicit none
  private
  public :: make_directory, is_writable_directory, process_id, rename_file, remove_file, shell_quoted, directory_of, &
            environment_value

  !> Rights rwxrwxrwx, before the umask of the user.
  integer(c_int), parameter :: all_rights = int(o'777', c_int)
  !> W_OK and X_OK of access(2).
  integer(c_int), parameter :: may_write_and_enter = 3_c_int

  interface
    function c_mkdir(path, mode) result(status) bind(c, name='mkdir')
      import :: c_char, c_int
      !> Path, ended by a null character.
      character(kind=c_char), intent(in) :: path(*)
      !> Rights of the directory.
      integer(c_int), value :: mode
      integer(c_int) :: status
    end function c_mkdir

    function c_access(path, mode) result(status) bind(c, name='access')
      import :: c_char, c_int
      !> Path, ended by a null character.
      character(kind=c_char), intent(in) :: path(*)
      !> Rights to check.
      integer(c_int), value :: mode
      integer(c_int) :: status
    end function c_access

    function c_rename(old, new) result(status) bind(c, name='rename')
      import :: c_char, c_int
      !> Path, ended by a null character.
      character(kind=c_char), intent(in) :: old(*)
      !> New path, ended by a null character.
      character(kind=c_char), intent(in) :: new(*)
      integer(c_int) :: status
    end function c_rename

    function c_unlink(path) result(status) bind(c, name='unlink')
      import :: c_char, c_int
      !> Path, ended by a null character.
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int) :: status
    end function c_unlink

    function c_getpid() result(id) bind(c, name='getpid')
      import :: c_int
      integer(c_int) :: id
    end function c_getpid
  end interface

contains

  !> Make a directory in an existing one; nothing happens where it exists already.
  subroutine make_directory(path)
    !> Path of the directory.
    character(*), intent(in) :: path
    integer(c_int) :: status
    ! Callers check afterwards: another process may make it at the same time.
    status = c_mkdir(path//c_null_char, all_rights)
  end subroutine make_directory

  !> Whether files can be made in a directory.
  logical function is_writable_directory(path) result(writable)
    !> Path of the directory.
    character(*), intent(in) :: path
    ! A plain file cannot be entered by this name.
    writable = c_access(path//'/.'//c_null_char, may_write_and_enter) == 0
  end function is_writable_directory

  !> Number of this process.
  integer function process_id() result(id)
    id = int(c_getpid())
  end function process_id

  !> Rename a file in one step, in place of a file of the new name; false where that fails.
  logical function rename_file(old, new) result(good)
    !> Path of the file.
    character(*), intent(in) :: old
    !> Its new path.
    character(*), intent(in) :: new
    good = c_rename(old//c_null_char, new//c_null_char) == 0
  end function rename_file

  !> Delete a file; nothing happens where it does not exist.
  subroutine remove_file(path)
    !> Path of the file.
    character(*), intent(in) :: path
    integer(c_int) :: status
    status = c_unlink(path//c_null_char)
  end subroutine remove_file

  !> Any text as one word of the shell.
  pure function shell_quoted(text) result(word)
    !> Any text.
    character(*), intent(in) :: text
    character(:), allocatable :: word
    integer :: i
    word = "'"
    do i = 1, len(text)
      if (text(i:i) == "'") then
        word = word//"'\''"
      else
        word = word//text(i:i)
      end if
    end do
    word = word//"'"
  end function shell_quoted

  !> Directory of a file, with a slash at its end; empty for a plain name.
  pure function directory_of(path) result(directory)
    !> Path of the file.
    character(*), intent(in) :: path
    character(:), allocatable :: directory
    directory = path(:index(path, '/', back=.true.))
  end function directory_of

  !> Value of an environment variable; empty where it is not set.
  function environment_value(name) result(value)
    !> Name of the variable.
    character(*), intent(in) :: name
    character(:), allocatable :: value
    integer :: length, status
    call get_environment_variable(name, length=length, status=status)
    if (status /= 0) length = 0
    allocate (character(length) :: value)
    if (length > 0) call get_environment_variable(name, value)
  end function environment_value
end module dotyk_base_operating_system
