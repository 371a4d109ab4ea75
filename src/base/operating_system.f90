!> Services of the operating system for running another program: directories, files, shell words, environment.
module dotyk_base_operating_system
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  implicit none
  private
  public :: make_directory, is_writable_directory, process_id, rename_file, remove_file, shell_quoted, directory_of, &
    environment_value

  !> Permissions rwxrwxrwx, reduced by the umask of the user, and rwx------.
  integer(c_int), parameter :: all_permissions = int(o'777', c_int), own_permissions = int(o'700', c_int)
  integer(c_int), parameter :: write_and_search = 3_c_int  !! W_OK and X_OK of access(2).

  interface
    !> mkdir(2).
    function c_mkdir(path, mode) result(status) bind(c, name='mkdir')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)  !! Path, NUL-terminated (:).
      integer(c_int), value :: mode  !! Permissions.
      integer(c_int) :: status
    end function c_mkdir

    !> access(2).
    function c_access(path, mode) result(status) bind(c, name='access')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)  !! Path, NUL-terminated (:).
      integer(c_int), value :: mode  !! Requested permissions.
      integer(c_int) :: status
    end function c_access

    !> rename(2).
    function c_rename(old, new) result(status) bind(c, name='rename')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: old(*)  !! Old path, NUL-terminated (:).
      character(kind=c_char), intent(in) :: new(*)  !! New path, NUL-terminated (:).
      integer(c_int) :: status
    end function c_rename

    !> unlink(2).
    function c_unlink(path) result(status) bind(c, name='unlink')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)  !! Path, NUL-terminated (:).
      integer(c_int) :: status
    end function c_unlink

    !> getpid(2).
    function c_getpid() result(id) bind(c, name='getpid')
      import :: c_int
      integer(c_int) :: id
    end function c_getpid
  end interface

contains

  !> Make a directory whose parent exists; nothing happens if it exists already.
  subroutine make_directory(path, private)
    character(*), intent(in) :: path  !! Path.
    logical, intent(in), optional :: private  !! Whether only this user may look into it; as the umask says if absent.
    integer(c_int) :: status, permissions
    permissions = all_permissions
    if (present(private)) permissions = merge(own_permissions, all_permissions, private)
    ! The caller checks afterwards that it can be used: another process may make it at the same time.
    status = c_mkdir(path//c_null_char, permissions)
  end subroutine make_directory

  !> Whether files can be created in a directory.
  logical function is_writable_directory(path) result(writable)
    character(*), intent(in) :: path  !! Path.
    ! The name is invalid for a regular file.
    writable = c_access(path//'/.'//c_null_char, write_and_search) == 0
  end function is_writable_directory

  !> Identifier of this process.
  integer function process_id() result(id)
    id = int(c_getpid())
  end function process_id

  !> Rename a file atomically, replacing an existing one.
  logical function rename_file(old, new) result(success)
    character(*), intent(in) :: old  !! Old path.
    character(*), intent(in) :: new  !! New path.
    success = c_rename(old//c_null_char, new//c_null_char) == 0
  end function rename_file

  !> Remove a file; nothing happens if it does not exist.
  subroutine remove_file(path)
    character(*), intent(in) :: path  !! Path.
    integer(c_int) :: status
    status = c_unlink(path//c_null_char)
  end subroutine remove_file

  !> A text as one word of the shell, whatever characters it has.
  pure function shell_quoted(text) result(word)
    character(*), intent(in) :: text  !! Text.
    character(:), allocatable :: word  !! Word.
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

  !> Directory of a file with its slash; empty for a plain name.
  pure function directory_of(path) result(directory)
    character(*), intent(in) :: path  !! Path of the file.
    character(:), allocatable :: directory  !! Directory.
    directory = path(:index(path, '/', back=.true.))
  end function directory_of

  !> Value of an environment variable, empty if it is not set.
  function environment_value(name) result(value)
    character(*), intent(in) :: name  !! Name of the variable.
    character(:), allocatable :: value  !! Its value.
    integer :: length, status
    call get_environment_variable(name, length=length, status=status)
    if (status /= 0) length = 0
    allocate (character(length) :: value)
    if (length > 0) call get_environment_variable(name, value)
  end function environment_value
end module dotyk_base_operating_system
