!> Files: temporary names for files that are being written, reasons why a path or its contents cannot be used, and the
!> standard output. The only module that knows files.c.
module dotyk_base_files
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_int, c_long, c_null_char, c_ptr, c_size_t
  use dotyk_base_text, only: lower
  implicit none
  private
  public :: own_mark, remove_leftovers, sync_file, why_no_file, is_protected, behind_links, nature_of, &
    print_text, hold_standard_files, is_trusted_folder, user_number, write_new, is_cad_file, &
    is_foreign_mesh, is_geo_file, is_msh_file, is_stl_file

  integer, parameter :: mark_length = 100, path_length = 8192  !! Longest mark, and longest path behind links.

  interface
    subroutine c_own_mark(mark, length) bind(c, name='dotyk_own_mark')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: mark(*)  !! The mark, ended by a null character.
      integer(c_int), value :: length  !! Length of `mark`.
    end subroutine c_own_mark

    subroutine c_remove_leftovers(path) bind(c, name='dotyk_remove_leftovers')
      import :: c_char
      character(kind=c_char), intent(in) :: path(*)  !! Path, ended by a null character.
    end subroutine c_remove_leftovers

    type(c_ptr) function c_sync_file(path) bind(c, name='dotyk_sync_file')
      import :: c_char, c_ptr
      character(kind=c_char), intent(in) :: path(*)  !! Path, ended by a null character.
    end function c_sync_file

    integer(c_int) function c_path_kind(path) bind(c, name='dotyk_path_kind')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)  !! Path, ended by a null character.
    end function c_path_kind

    integer(c_int) function c_is_protected(path) bind(c, name='dotyk_is_protected')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)  !! Path, ended by a null character.
    end function c_is_protected

    integer(c_int) function c_is_trusted_folder(folder, beside) bind(c, name='dotyk_is_trusted_folder')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: folder(*)  !! Path of the folder, ended by a null character.
      character(kind=c_char), intent(in), optional :: beside(*)  !! Path whose owner is trusted, null-terminated.
    end function c_is_trusted_folder

    integer(c_int) function c_user() bind(c, name='dotyk_user')
      import :: c_int
    end function c_user

    subroutine c_write_new(path, text) bind(c, name='dotyk_write_new')
      import :: c_char
      character(kind=c_char), intent(in) :: path(*)  !! Path, ended by a null character.
      character(kind=c_char), intent(in) :: text(*)  !! Text, ended by a null character.
    end subroutine c_write_new

    subroutine c_behind_links(path, target, length) bind(c, name='dotyk_behind_links')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)  !! Path, ended by a null character.
      character(kind=c_char), intent(out) :: target(*)  !! Path behind links, ended by a null character.
      integer(c_int), value :: length  !! Length of `target`.
    end subroutine c_behind_links

    integer(c_int) function c_print(descriptor, text, length, live) bind(c, name='dotyk_print')
      import :: c_char, c_int, c_long
      integer(c_int), value :: descriptor  !! File descriptor: 1, standard output; 2, standard error.
      character(kind=c_char), intent(in) :: text(*)  !! Text to print.
      integer(c_long), value :: length  !! Length of the text.
      integer(c_int), value :: live  !! Whether it is a line of progress.
    end function c_print

    !> Open standard input, output and error where they are closed.
    subroutine hold_standard_files() bind(c, name='dotyk_hold_standard_files')
    end subroutine hold_standard_files

    pure integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      type(c_ptr), value, intent(in) :: text  !! Text, ended by a null character.
    end function c_strlen
  end interface

contains

  !> Mark behind the names of temporary files of this process: '.machine-process'.
  function own_mark() result(mark)
    character(:), allocatable :: mark
    character(kind=c_char) :: letters(mark_length)
    call c_own_mark(letters, int(mark_length, c_int))
    call take_text(letters, mark)
  end function own_mark

  !> Delete files path.machine-process.* of processes of this machine that have ended.
  subroutine remove_leftovers(path)
    character(*), intent(in) :: path  !! Path of the file.
    call c_remove_leftovers(path//c_null_char)
  end subroutine remove_leftovers

  !> Write a file through to the disk.
  subroutine sync_file(path, reason)
    character(*), intent(in) :: path  !! Path of the file.
    character(:), allocatable, intent(out) :: reason  !! Why, in the words of the system; empty where it did not.
    character(kind=c_char), pointer :: letters(:)
    type(c_ptr) :: text
    integer :: i
    reason = ''
    text = c_sync_file(path//c_null_char)
    if (.not. c_associated(text)) return
    call c_f_pointer(text, letters, [c_strlen(text)])
    do i = 1, size(letters)
      reason = reason//letters(i)
    end do
  end subroutine sync_file

  !> Why a path is no regular file: "does not exist", "is a directory", "is a pipe, not a file"; empty where it is one.
  function why_no_file(path) result(reason)
    character(*), intent(in) :: path  !! Path of the file.
    character(:), allocatable :: reason
    select case (c_path_kind(path//c_null_char))
    case (0)
      reason = ''
    case (1)
      reason = 'does not exist'
    case (2)
      reason = 'is a directory'
    case (3)
      reason = 'is a pipe, not a file'
    case (5)
      reason = 'is in a directory that may not be entered'
    case default
      reason = 'is a device, not a file'
    end select
  end function why_no_file

  !> Whether a file exists and is write-protected.
  logical function is_protected(path)
    character(*), intent(in) :: path  !! Path of the file.
    is_protected = c_is_protected(path//c_null_char) /= 0
  end function is_protected

  !> Whether files of this user may be kept in a folder: it can be written, it and a link that leads there belong to
  !> this user or to the owner of `beside`, and not everybody can write it.
  logical function is_trusted_folder(folder, beside)
    character(*), intent(in) :: folder  !! Path of the folder.
    character(*), intent(in), optional :: beside  !! Path whose owner is trusted too; this user alone if absent.
    if (present(beside)) then
      is_trusted_folder = c_is_trusted_folder(folder//c_null_char, beside//c_null_char) /= 0
    else
      is_trusted_folder = c_is_trusted_folder(folder//c_null_char) /= 0
    end if
  end function is_trusted_folder

  !> Number of this user.
  integer function user_number()
    user_number = int(c_user())
  end function user_number

  !> Whether a file is a CAD file with solids, by its name: gmsh tells it by that, too.
  pure logical function is_cad_file(path)
    character(*), intent(in) :: path  !! Path.
    character(5), parameter :: endings(*) = [character(5) :: '.step', '.stp', '.iges', '.igs', '.brep', '.brp', '.stl']
    is_cad_file = any(endings == lower(path(max(1, index(path, '.', back=.true.)):)))
  end function is_cad_file

  !> Whether a CAD file has triangles, by its name.
  pure logical function is_stl_file(path)
    character(*), intent(in) :: path  !! Path.
    is_stl_file = lower(path(max(1, len(path) - 3):)) == '.stl'
  end function is_stl_file

  !> Whether a file is a geometry of gmsh, by its name.
  pure logical function is_geo_file(path)
    character(*), intent(in) :: path  !! Path.
    is_geo_file = path(max(1, len(path) - 3):) == '.geo'
  end function is_geo_file

  !> Whether a file is a mesh of gmsh, by its name.
  pure logical function is_msh_file(path)
    character(*), intent(in) :: path  !! Path.
    is_msh_file = path(max(1, len(path) - 3):) == '.msh'
  end function is_msh_file

  !> Whether a file is a mesh of another format, by its name: a deck of Abaqus or CalculiX, an unstructured grid of VTK,
  !> or one that meshio reads.
  pure logical function is_foreign_mesh(path)
    character(*), intent(in) :: path  !! Path.
    character(5), parameter :: endings(*) = [character(5) :: '.inp', '.vtu', '.med', '.vtk', '.xdmf', '.exo', '.bdf', &
                                             '.nas', '.mesh', '.su2']
    is_foreign_mesh = any(endings == lower(path(max(1, index(path, '.', back=.true.)):)))
  end function is_foreign_mesh

  !> Write a text to a new file; nothing happens where the name is taken.
  subroutine write_new(path, text)
    character(*), intent(in) :: path  !! Path of the file.
    character(*), intent(in) :: text  !! Its content.
    call c_write_new(path//c_null_char, text//c_null_char)
  end subroutine write_new

  !> Path behind symbolic links; the path itself where it is no link.
  function behind_links(path) result(target)
    character(*), intent(in) :: path  !! Path, maybe of a link.
    character(:), allocatable :: target
    character(kind=c_char) :: letters(path_length)
    call c_behind_links(path//c_null_char, letters, int(path_length, c_int))
    call take_text(letters, target)
  end function behind_links

  !> Text of C up to its null character.
  pure subroutine take_text(letters, text)
    character(kind=c_char), intent(in) :: letters(:)  !! Letters, ended by a null character (n).
    character(:), allocatable, intent(out) :: text  !! The text.
    integer :: i
    text = ''
    do i = 1, size(letters)
      if (letters(i) == c_null_char) exit
      text = text//letters(i)
    end do
  end subroutine take_text

  !> Print a text on standard output or standard error.
  subroutine print_text(text, status, to_error, live)
    character(*), intent(in) :: text  !! Text to print.
    integer, intent(out) :: status  !! 0 if all of it is written.
    logical, intent(in), optional :: to_error  !! Whether it goes to standard error; not if absent.
    !> Whether it is a line of progress, on a terminal replaced by the next text; not if absent.
    logical, intent(in), optional :: live
    integer(c_int) :: descriptor, is_live
    descriptor = 1
    if (present(to_error)) descriptor = merge(2_c_int, 1_c_int, to_error)
    is_live = 0
    if (present(live)) is_live = merge(1_c_int, 0_c_int, live)
    status = int(c_print(descriptor, text, len(text, c_long), is_live))
  end subroutine print_text

  !> Kind of contents that are no plain text: "UTF-16 text", "an HDF5 file"; empty where they may be text.
  pure function nature_of(bytes) result(nature)
    character(*), intent(in) :: bytes  !! Contents of the file.
    character(:), allocatable :: nature
    !> Bytes to look at, and zeros among them that no text has.
    integer, parameter :: most_looked_at = 1024, few_zeros = 8
    integer :: i, n
    nature = ''
    n = min(len(bytes), most_looked_at)
    if (n < 2) return
    if (any(bytes(:2) == [char(255)//char(254), char(254)//char(255)])) then
      nature = 'UTF-16 text'
    else if (index(bytes(:n), 'HDF') == 2 .and. iachar(bytes(1:1)) == 137) then
      nature = 'an HDF5 file'
    else if (index(bytes(:n), '$MeshFormat') == 1) then
      nature = 'a mesh of gmsh'
    else if (count([(iachar(bytes(i:i)) == 0, i=1, n)]) > few_zeros) then
      nature = 'a binary file'
    end if
  end function nature_of
end module dotyk_base_files
