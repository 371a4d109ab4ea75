!> HDF5, thinly: files written by this program. HDF5 is named in this module and its neighbours `hdf5_*.f90` only.
!>
!> Arrays (3, n) of Fortran are seen as (n, 3) by C, Python and VTK. A dataset's last Fortran dimension is called its
!> rows; it can be made at its full size and filled by parts, so that bodies are written one at a time. Empty arrays are
!> allowed. HDF5 is not safe for threads: one thread at a time.
module dotyk_output_hdf5
  use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int8
  use dotyk_base_error, only: error_t, exit_not_written, set_error
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_base_text, only: quoted
  use dotyk_output_hdf5_reason, only: hdf5_reason, start_hdf5
  use hdf5, only: h5acreate_by_name_f, h5awrite_f, h5aclose_f, h5dclose_f, h5dcreate_f, h5dget_space_f, h5dopen_f, &
    h5dwrite_f, h5f_acc_trunc_f, h5f_close_strong_f, h5f_libver_v18_f, h5fclose_f, h5fcreate_f, h5gclose_f, &
    h5gcreate_f, h5p_dataset_create_f, h5p_file_access_f, h5pclose_f, h5pcreate_f, h5pset_fclose_degree_f, &
    h5pset_fill_value_f, h5pset_libver_bounds_f, h5s_scalar_f, h5s_select_set_f, h5sclose_f, h5screate_f, &
    h5screate_simple_f, h5sselect_hyperslab_f, h5t_c_s1, h5t_cset_utf8_f, h5t_ieee_f64le, h5t_native_integer, &
    h5t_std_i32le, h5t_std_i64le, h5t_std_u8le, h5t_str_nullpad_f, h5tclose_f, h5tcopy_f, h5tset_cset_f, &
    h5tset_size_f, h5tset_strpad_f, hid_t, hsize_t, size_t
  implicit none
  private

  !> Kinds of numbers that a dataset may hold.
  integer, parameter, public :: hdf5_real = 1   !< 64-bit real
  integer, parameter, public :: hdf5_int32 = 2  !< 32-bit integer
  integer, parameter, public :: hdf5_int64 = 3  !< 64-bit integer
  integer, parameter, public :: hdf5_uint8 = 4  !< unsigned 8-bit integer; in memory `int8` values 0..127

  !> A file open for writing.
  type, public :: hdf5_file_t
    !> Its name in messages.
    character(:), allocatable :: label
    !> HDF5's handle.
    integer(hid_t) :: id = -1
    logical :: is_open = .false.
  contains
    procedure :: create => file_create
    procedure :: close => file_close
    procedure :: add_group => file_add_group
    procedure :: new_dataset => file_new_dataset
    procedure, private :: put_text, put_integer, put_long, put_real, put_integers, put_longs, put_reals
    !> put_attribute(object, name, value, error): a text, a number or a 1-d vector at a group or dataset.
    generic :: put_attribute => put_text, put_integer, put_long, put_real, put_integers, put_longs, put_reals
    procedure, private :: part_real_1d, part_real_2d, part_int8, part_int32, part_int64
    !> put_part(name, first, values, error): rows first+1.. of a dataset made by `new_dataset`.
    generic :: put_part => part_real_1d, part_real_2d, part_int8, part_int32, part_int64
    procedure, private :: dataset_real_1d, dataset_real_2d, dataset_int32, dataset_int64
    !> put_dataset(name, values, error): a whole dataset.
    generic :: put_dataset => dataset_real_1d, dataset_real_2d, dataset_int32, dataset_int64
  end type hdf5_file_t

contains

  !> Make the error of a failed call.
  subroutine fail(self, what, error)
    class(hdf5_file_t), intent(in) :: self
    !> What was being written, or empty.
    character(*), intent(in) :: what
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: reason
    reason = hdf5_reason()
    if (len(what) > 0) reason = reason//' (at '//what//')'
    call set_error(error, quoted(self%label)//' cannot be written: '//reason, exit_not_written)
  end subroutine fail

  !> Create a file; one of the same name is lost.
  subroutine file_create(self, path, error, label)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    !> Name of the file in messages; `path` if absent.
    character(*), intent(in), optional :: label
    integer(hid_t) :: access
    integer :: status
    call start_hdf5()
    self%label = path
    if (present(label)) self%label = label
    call h5pcreate_f(h5p_file_access_f, access, status)
    ! Closing the file closes whatever a failed call left open in it.
    call h5pset_fclose_degree_f(access, h5f_close_strong_f, status)
    ! The format of HDF5 1.8 and later has no limit of 64 kB on attributes, which the input text may exceed.
    call h5pset_libver_bounds_f(access, h5f_libver_v18_f, h5f_libver_v18_f, status)
    call h5fcreate_f(path, h5f_acc_trunc_f, self%id, status, access_prp=access)
    self%is_open = status >= 0
    if (.not. self%is_open) call fail(self, '', error)
    call h5pclose_f(access, status)
  end subroutine file_create

  !> Write what is pending and close the file.
  subroutine file_close(self, error)
    class(hdf5_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    if (.not. self%is_open) return
    call h5fclose_f(self%id, status)
    self%is_open = .false.
    if (status < 0) call fail(self, '', error)
  end subroutine file_close

  !> Add a group; its parent exists.
  subroutine file_add_group(self, name, error)
    class(hdf5_file_t), intent(in) :: self
    !> Path in the file.
    character(*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: group
    integer :: status
    call h5gcreate_f(self%id, name, group, status)
    if (status < 0) then
      call fail(self, name, error)
      return
    end if
    call h5gclose_f(group, status)
  end subroutine file_add_group

  !> Make a dataset of full size, to be filled by parts.
  subroutine file_new_dataset(self, name, number_kind, extent, error, zero)
    class(hdf5_file_t), intent(in) :: self
    !> Path in the file.
    character(*), intent(in) :: name
    !> One of hdf5_real, hdf5_int32, hdf5_int64, hdf5_uint8.
    integer, intent(in) :: number_kind
    !> Fortran shape, of one or two dimensions; the last one is filled by parts.
    integer(int64), intent(in) :: extent(:)
    type(error_t), allocatable, intent(out) :: error
    !> Whether what is not filled is zero; undefined if absent.
    logical, intent(in), optional :: zero
    integer(hid_t) :: space, dataset, creation
    integer :: status
    call h5screate_simple_f(size(extent), int(extent, hsize_t), space, status)
    call h5pcreate_f(h5p_dataset_create_f, creation, status)
    if (present(zero)) then
      if (zero) call h5pset_fill_value_f(creation, h5t_native_integer, 0, status)
    end if
    call h5dcreate_f(self%id, name, file_type(number_kind), space, dataset, status, creation)
    if (status < 0) then
      call fail(self, name, error)
    else
      call h5dclose_f(dataset, status)
      if (status < 0) call fail(self, name, error)
    end if
    call h5pclose_f(creation, status)
    call h5sclose_f(space, status)
  end subroutine file_new_dataset

  !> Type of numbers in the file.
  integer(hid_t) function file_type(number_kind) result(type_id)
    integer, intent(in) :: number_kind
    select case (number_kind)
    case (hdf5_int32)
      type_id = h5t_std_i32le
    case (hdf5_int64)
      type_id = h5t_std_i64le
    case (hdf5_uint8)
      type_id = h5t_std_u8le
    case default
      type_id = h5t_ieee_f64le
    end select
  end function file_type

  !> Write rows of a dataset. Memory holds the same types as the file: every machine this runs on is little-endian.
  subroutine write_rows(self, name, number_kind, first, extent, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer, intent(in) :: number_kind
    !> Rows before the first one written.
    integer(int64), intent(in) :: first
    !> Shape of the values.
    integer(int64), intent(in) :: extent(:)
    type(c_ptr), intent(in) :: values
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, space, memory
    integer(hsize_t) :: offset(size(extent))
    integer :: status, ignored
    if (product(extent) == 0) return
    call h5dopen_f(self%id, name, dataset, status)
    if (status < 0) then
      call fail(self, name, error)
      return
    end if
    offset = 0
    offset(size(extent)) = first
    call h5dget_space_f(dataset, space, status)
    call h5screate_simple_f(size(extent), int(extent, hsize_t), memory, status)
    call h5sselect_hyperslab_f(space, h5s_select_set_f, offset, int(extent, hsize_t), status)
    if (status >= 0) call h5dwrite_f(dataset, file_type(number_kind), values, status, memory, space)
    if (status < 0) call fail(self, name, error)
    call h5sclose_f(memory, ignored)
    call h5sclose_f(space, ignored)
    call h5dclose_f(dataset, ignored)
    if (ignored < 0 .and. status >= 0) call fail(self, name, error)
  end subroutine write_rows

  !> Write a whole dataset.
  subroutine write_dataset(self, name, number_kind, extent, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer, intent(in) :: number_kind
    integer(int64), intent(in) :: extent(:)
    type(c_ptr), intent(in) :: values
    type(error_t), allocatable, intent(out) :: error
    call self%new_dataset(name, number_kind, extent, error)
    if (allocated(error)) return
    call write_rows(self, name, number_kind, 0_int64, extent, values, error)
  end subroutine write_dataset

  subroutine part_real_1d(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int64), intent(in) :: first
    real(dp), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    call write_rows(self, name, hdf5_real, first, shape(values, int64), c_loc(values), error)
  end subroutine part_real_1d

  subroutine part_real_2d(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int64), intent(in) :: first
    real(dp), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    call write_rows(self, name, hdf5_real, first, shape(values, int64), c_loc(values), error)
  end subroutine part_real_2d

  subroutine part_int8(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int64), intent(in) :: first
    integer(int8), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    call write_rows(self, name, hdf5_uint8, first, shape(values, int64), c_loc(values), error)
  end subroutine part_int8

  subroutine part_int32(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int64), intent(in) :: first
    integer(int32), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    call write_rows(self, name, hdf5_int32, first, shape(values, int64), c_loc(values), error)
  end subroutine part_int32

  subroutine part_int64(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int64), intent(in) :: first
    integer(int64), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    call write_rows(self, name, hdf5_int64, first, shape(values, int64), c_loc(values), error)
  end subroutine part_int64

  subroutine dataset_real_1d(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    real(dp), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    call write_dataset(self, name, hdf5_real, shape(values, int64), c_loc(values), error)
  end subroutine dataset_real_1d

  subroutine dataset_real_2d(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    real(dp), intent(in), contiguous, target :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    call write_dataset(self, name, hdf5_real, shape(values, int64), c_loc(values), error)
  end subroutine dataset_real_2d

  subroutine dataset_int32(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int32), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    call write_dataset(self, name, hdf5_int32, shape(values, int64), c_loc(values), error)
  end subroutine dataset_int32

  subroutine dataset_int64(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int64), intent(in), contiguous, target :: values(:)
    type(error_t), allocatable, intent(out) :: error
    call write_dataset(self, name, hdf5_int64, shape(values, int64), c_loc(values), error)
  end subroutine dataset_int64

  !> Write an attribute.
  subroutine write_attribute(self, object, name, type_id, extent, values, error)
    class(hdf5_file_t), intent(in) :: self
    !> Path of the group or dataset.
    character(*), intent(in) :: object
    character(*), intent(in) :: name
    !> Type in memory and in the file.
    integer(hid_t), intent(in) :: type_id
    !> Shape: of size 0 for a scalar.
    integer(hsize_t), intent(in) :: extent(:)
    type(c_ptr), intent(in) :: values
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: space, attribute
    integer :: status, ignored
    if (size(extent) == 0) then
      call h5screate_f(h5s_scalar_f, space, status)
    else
      call h5screate_simple_f(size(extent), extent, space, status)
    end if
    call h5acreate_by_name_f(self%id, object, name, type_id, space, attribute, status)
    if (status >= 0) then
      if (product(extent) > 0) call h5awrite_f(attribute, type_id, values, status)
      if (status < 0) call fail(self, object//'@'//name, error)
      call h5aclose_f(attribute, ignored)
    else
      call fail(self, object//'@'//name, error)
    end if
    call h5sclose_f(space, ignored)
  end subroutine write_attribute

  !> A text of any length, stored without padding.
  subroutine put_text(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object, name, value
    type(error_t), allocatable, intent(out) :: error
    character(kind=c_char), allocatable, target :: letters(:)
    integer(hid_t) :: type_id
    integer :: status, i
    ! HDF5 knows no text of length 0: an empty one is a single null, which is padding.
    allocate (letters(max(1, len(value))))
    letters(1) = achar(0)
    do i = 1, len(value)
      letters(i) = value(i:i)
    end do
    call h5tcopy_f(h5t_c_s1, type_id, status)
    call h5tset_size_f(type_id, int(size(letters), size_t), status)
    call h5tset_strpad_f(type_id, h5t_str_nullpad_f, status)
    if (any(iachar(letters) > 127)) call h5tset_cset_f(type_id, h5t_cset_utf8_f, status)
    call write_attribute(self, object, name, type_id, [integer(hsize_t) ::], c_loc(letters), error)
    call h5tclose_f(type_id, status)
  end subroutine put_text

  subroutine put_integer(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object, name
    integer(int32), intent(in), target :: value
    type(error_t), allocatable, intent(out) :: error
    call write_attribute(self, object, name, h5t_std_i32le, [integer(hsize_t) ::], c_loc(value), error)
  end subroutine put_integer

  subroutine put_long(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object, name
    integer(int64), intent(in), target :: value
    type(error_t), allocatable, intent(out) :: error
    call write_attribute(self, object, name, h5t_std_i64le, [integer(hsize_t) ::], c_loc(value), error)
  end subroutine put_long

  subroutine put_real(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object, name
    real(dp), intent(in), target :: value
    type(error_t), allocatable, intent(out) :: error
    call write_attribute(self, object, name, h5t_ieee_f64le, [integer(hsize_t) ::], c_loc(value), error)
  end subroutine put_real

  subroutine put_integers(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object, name
    integer(int32), intent(in), contiguous, target :: value(:)
    type(error_t), allocatable, intent(out) :: error
    call write_attribute(self, object, name, h5t_std_i32le, shape(value, hsize_t), c_loc(value), error)
  end subroutine put_integers

  subroutine put_longs(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object, name
    integer(int64), intent(in), contiguous, target :: value(:)
    type(error_t), allocatable, intent(out) :: error
    call write_attribute(self, object, name, h5t_std_i64le, shape(value, hsize_t), c_loc(value), error)
  end subroutine put_longs

  subroutine put_reals(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object, name
    real(dp), intent(in), contiguous, target :: value(:)
    type(error_t), allocatable, intent(out) :: error
    call write_attribute(self, object, name, h5t_ieee_f64le, shape(value, hsize_t), c_loc(value), error)
  end subroutine put_reals
end module dotyk_output_hdf5
