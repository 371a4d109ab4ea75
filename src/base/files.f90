!> Files that are written under another name first, so that one that is there is whole.
module dotyk_base_files
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_int, c_null_char, c_ptr, c_size_t
  implicit none
  private
  public :: own_mark, remove_leftovers, sync_file

  !> Longest mark.
  integer, parameter :: mark_length = 100

  interface
    subroutine c_own_mark(mark, length) bind(c, name='dotyk_own_mark')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: mark(*)
      integer(c_int), value :: length
    end subroutine c_own_mark

    subroutine c_remove_leftovers(path) bind(c, name='dotyk_remove_leftovers')
      import :: c_char
      character(kind=c_char), intent(in) :: path(*)
    end subroutine c_remove_leftovers

    type(c_ptr) function c_sync_file(path) bind(c, name='dotyk_sync_file')
      import :: c_char, c_ptr
      character(kind=c_char), intent(in) :: path(*)
    end function c_sync_file

    pure integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
      import :: c_ptr, c_size_t
      type(c_ptr), value, intent(in) :: text
    end function c_strlen
  end interface

contains

  !> What this process puts behind names of files that are for itself alone: '.machine-process'.
  function own_mark() result(mark)
    character(:), allocatable :: mark
    character(kind=c_char) :: letters(mark_length)
    integer :: i
    call c_own_mark(letters, int(mark_length, c_int))
    mark = ''
    do i = 1, mark_length
      if (letters(i) == c_null_char) exit
      mark = mark//letters(i)
    end do
  end function own_mark

  !> Delete files of the names path.machine-process.* that processes of this machine left which are no more.
  subroutine remove_leftovers(path)
    character(*), intent(in) :: path
    call c_remove_leftovers(path//c_null_char)
  end subroutine remove_leftovers

  !> Have a file on the disk.
  subroutine sync_file(path, reason)
    character(*), intent(in) :: path
    !> Why it is not there, in the system's words; empty if all is well.
    character(:), allocatable, intent(out) :: reason
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
end module dotyk_base_files
