!> Reasons of failed calls of HDF5, as text for the user.
module dotyk_output_hdf5_reason
  use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_funloc, c_funptr, c_int, c_int64_t, c_loc, &
    c_null_char, c_ptr, c_size_t
  use hdf5, only: h5dont_atexit_f, h5eset_auto_f, h5open_f
  implicit none
  private
  public :: start_hdf5, hdf5_reason

  type, bind(c) :: error_record_t  !! H5E_error2_t of HDF5's C interface.
    integer(c_int64_t) :: class_id, major, minor
    integer(c_int) :: line
    type(c_ptr) :: function_name, file_name, description
  end type error_record_t

  integer, parameter :: reason_length = 200  !! Longest text that is kept.

  type, bind(c) :: reason_t  !! Text that the walk along the error stack of HDF5 has found.
    character(kind=c_char) :: text(reason_length)  !! The text, padded with blanks (reason_length).
    integer(c_int) :: from_system  !! 1 where the text is a message of the operating system, 0 otherwise.
  end type reason_t

  interface
    integer(c_int) function h5ewalk2(stack, direction, visit, client) bind(c, name='H5Ewalk2')
      import :: c_int, c_int64_t, c_funptr, c_ptr
      integer(c_int64_t), value :: stack  !! Error stack.
      integer(c_int), value :: direction  !! Upward or downward.
      type(c_funptr), value :: visit  !! Callback for each record.
      type(c_ptr), value :: client  !! Argument of the callback.
    end function h5ewalk2
    integer(c_int) function c_setenv(name, value, overwrite) bind(c, name='setenv')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: name(*)  !! Name, ended by a null character.
      character(kind=c_char), intent(in) :: value(*)  !! Value, ended by a null character.
      integer(c_int), value :: overwrite  !! Whether an existing value is replaced.
    end function c_setenv
    pure integer(c_size_t) function c_strlen(text) bind(c, name='strlen')
      import :: c_size_t, c_ptr
      type(c_ptr), value, intent(in) :: text  !! Text, ended by a null character.
    end function c_strlen
  end interface

contains

  !> Prepare the library: its own messages are off, as every status is checked, and it does nothing at the end of the
  !> program, as a failed write is not repeated.
  subroutine start_hdf5()
    integer :: status
    ! No other process opens the temporary files. File systems without locks (Lustre, some NFS) would refuse.
    status = int(c_setenv('HDF5_USE_FILE_LOCKING'//c_null_char, 'FALSE'//c_null_char, 0_c_int))
    call h5dont_atexit_f(status)
    call h5open_f(status)
    call h5eset_auto_f(0, status)
  end subroutine start_hdf5

  !> Why the last call has failed, in the words of the operating system where there are any, else of HDF5. The next call
  !> of HDF5 clears it.
  function hdf5_reason() result(text)
    character(:), allocatable :: text
    type(reason_t), target :: reason
    integer :: i
    reason%text = ' '
    reason%from_system = 0
    i = h5ewalk2(0_c_int64_t, 0_c_int, c_funloc(visit_error), c_loc(reason))
    text = repeat(' ', reason_length)
    do i = 1, reason_length
      text(i:i) = reason%text(i)
    end do
    text = trim(text)
    if (len(text) == 0) text = 'unknown reason'
  end function hdf5_reason

  !> Visit one record of the error stack of HDF5, the innermost first.
  integer(c_int) function visit_error(number, record, client) result(status) bind(c)
    integer(c_int), value :: number  !! Place in the stack, from 0.
    type(error_record_t), intent(in) :: record  !! Record of the stack.
    type(c_ptr), value :: client  !! Not used.
    character(*), parameter :: mark = "error message = '"
    character(kind=c_char), pointer :: letters(:)
    type(reason_t), pointer :: reason
    character(:), allocatable :: text
    integer :: i, first, length
    status = 0
    call c_f_pointer(client, reason)
    if (reason%from_system == 1) return
    call c_f_pointer(record%description, letters, [c_strlen(record%description)])
    text = repeat(' ', size(letters))
    do i = 1, len(text)
      text(i:i) = letters(i)
    end do
    first = index(text, mark)
    if (first > 0) then
      reason%from_system = 1
      text = text(first + len(mark):)
      length = index(text, "'") - 1
      if (length > 0) text = text(:length)
    else if (number > 0) then
      return
    end if
    reason%text = ' '
    do i = 1, min(len(text), reason_length)
      reason%text(i) = text(i:i)
    end do
  end function visit_error
end module dotyk_output_hdf5_reason
