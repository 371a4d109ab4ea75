!> HDF5, thinly: reading datasets that `dotyk_output_hdf5` wrote.
module dotyk_output_hdf5_read
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use hdf5, only: h5dclose_f, h5dget_space_f, h5dopen_f, h5dread_f, h5f_acc_rdonly_f, h5f_close_strong_f, &
    h5fclose_f, h5fopen_f, h5gn_members_f, h5lexists_f, h5p_file_access_f, h5pclose_f, h5pcreate_f, &
    h5pset_fclose_degree_f, h5sclose_f, h5sget_simple_extent_npoints_f, h5t_native_double, hid_t, hsize_t
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_output_hdf5_reason, only: hdf5_reason, start_hdf5
  implicit none
  private

  type, public :: hdf5_source_t  !! A file open for reading.
    character(:), allocatable :: path  !! Its name.
    integer(hid_t) :: id = -1  !! HDF5's handle.
    logical :: is_open = .false.  !! Whether the handle is that of an open file.
  contains
    procedure :: open => source_open
    procedure :: close => source_close
    procedure :: has => source_has
    procedure :: n_members => source_n_members
    procedure :: n_values => source_n_values
    procedure :: read_reals => source_read_reals
  end type hdf5_source_t

contains

  !> Make the error of a failed call.
  subroutine fail(self, what, error)
    class(hdf5_source_t), intent(in) :: self
    character(*), intent(in) :: what  !! Object of the file.
    type(error_t), allocatable, intent(out) :: error  !! Always set, with HDF5's own reason.
    call set_error(error, quoted(self%path)//' cannot be read: '//hdf5_reason()//' (at '//what//')')
  end subroutine fail

  !> Open a file.
  subroutine source_open(self, path, error)
    class(hdf5_source_t), intent(inout) :: self
    character(*), intent(in) :: path  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where there is no such file, or it is no HDF5 file.
    integer(hid_t) :: access
    integer :: status
    call start_hdf5()
    self%path = path
    call h5pcreate_f(h5p_file_access_f, access, status)
    call h5pset_fclose_degree_f(access, h5f_close_strong_f, status)
    call h5fopen_f(path, h5f_acc_rdonly_f, self%id, status, access)
    self%is_open = status >= 0
    if (.not. self%is_open) call fail(self, '/', error)
    call h5pclose_f(access, status)
  end subroutine source_open

  !> Close the file.
  subroutine source_close(self)
    class(hdf5_source_t), intent(inout) :: self
    integer :: ignored
    if (self%is_open) call h5fclose_f(self%id, ignored)
    self%is_open = .false.
  end subroutine source_close

  !> Whether a group or dataset exists; its parents do.
  logical function source_has(self, name) result(has)
    class(hdf5_source_t), intent(in) :: self
    character(*), intent(in) :: name  !! Path in the file.
    integer :: status
    call h5lexists_f(self%id, name, has, status)
    has = has .and. status >= 0
  end function source_has

  !> Number of groups and datasets in a group; 0 where it cannot be read.
  integer function source_n_members(self, group) result(n)
    class(hdf5_source_t), intent(in) :: self
    character(*), intent(in) :: group  !! Path in the file.
    integer :: status
    call h5gn_members_f(self%id, group, n, status)
    if (status < 0) n = 0
  end function source_n_members

  !> Number of values of a dataset; -1 where there is none.
  integer(int64) function source_n_values(self, name) result(n)
    class(hdf5_source_t), intent(in) :: self
    character(*), intent(in) :: name  !! Path in the file; its parents exist.
    integer(hid_t) :: dataset, space
    integer(hsize_t) :: n_points
    integer :: status, ignored
    n = -1
    if (.not. self%has(name)) return
    call h5dopen_f(self%id, name, dataset, status)
    if (status < 0) return
    call h5dget_space_f(dataset, space, status)
    if (status >= 0) then
      call h5sget_simple_extent_npoints_f(space, n_points, status)
      if (status >= 0) n = n_points
      call h5sclose_f(space, ignored)
    end if
    call h5dclose_f(dataset, ignored)
  end function source_n_values

  !> Read a dataset, whatever its shape. The array has the size that the caller expects: what a damaged file says of
  !> its size makes none.
  subroutine source_read_reals(self, name, values, error)
    class(hdf5_source_t), intent(in) :: self
    character(*), intent(in) :: name  !! Path in the file; its parents exist.
    !> Numbers of the file, converted to reals, in the order of the file (n) [any].
    real(dp), contiguous, target, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error  !! The dataset is missing, of another size, or unreadable.
    integer(hid_t) :: dataset
    type(c_ptr) :: buffer
    integer :: status, ignored
    values = 0
    if (self%n_values(name) /= size(values, kind=int64)) then
      call set_error(error, quoted(self%path)//' cannot be read: '//name//' does not hold '// &
                     to_text(size(values))//' numbers')
      return
    end if
    if (size(values) == 0) return
    buffer = c_loc(values)
    call h5dopen_f(self%id, name, dataset, status)
    if (status >= 0) call h5dread_f(dataset, h5t_native_double, buffer, status)
    if (status < 0) call fail(self, name, error)
    call h5dclose_f(dataset, ignored)
  end subroutine source_read_reals
end module dotyk_output_hdf5_read
