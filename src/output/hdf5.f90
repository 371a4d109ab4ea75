!> Writing of HDF5 files. HDF5 is known to this module and its neighbours `hdf5_*.f90` only.
!>
!> Arrays (3, n) of Fortran are (n, 3) for C, Python and VTK. The last Fortran dimension of a dataset counts its rows; a
!> dataset is made at its full size and filled by parts, so that bodies are written one at a time. Empty arrays are
!> allowed. HDF5 is not thread-safe: one thread at a time.
module dotyk_output_hdf5
  use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int8
  use hdf5, only: h5t_c_s1, h5t_cset_utf8_f, h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le, h5t_str_nullpad_f, &
    h5tclose_f, h5tcopy_f, h5tset_cset_f, h5tset_size_f, h5tset_strpad_f, hid_t, hsize_t, size_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_output_hdf5_handle, only: hdf5_handle_t, hdf5_int32, hdf5_int64, hdf5_real, hdf5_uint8, write_attribute, &
    write_dataset, write_rows
  implicit none
  private
  public :: hdf5_real, hdf5_int32, hdf5_int64, hdf5_uint8

  type, extends(hdf5_handle_t), public :: hdf5_file_t  !! A file open for writing.
  contains
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

  !> Write rows of a dataset of reals.
  subroutine part_real_1d(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    real(dp), intent(in), contiguous, target :: values(:)  !! Values (n) [any].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_rows(self, name, hdf5_real, first, shape(values, int64), c_loc(values), error)
  end subroutine part_real_1d

  !> Write rows of a dataset of vectors.
  subroutine part_real_2d(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    real(dp), intent(in), contiguous, target :: values(:, :)  !! Rows of values (width, n) [any].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_rows(self, name, hdf5_real, first, shape(values, int64), c_loc(values), error)
  end subroutine part_real_2d

  !> Write rows of a dataset of 8-bit integers.
  subroutine part_int8(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    integer(int8), intent(in), contiguous, target :: values(:)  !! Values (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_rows(self, name, hdf5_uint8, first, shape(values, int64), c_loc(values), error)
  end subroutine part_int8

  !> Write rows of a dataset of 32-bit integers.
  subroutine part_int32(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    integer(int32), intent(in), contiguous, target :: values(:)  !! Values (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_rows(self, name, hdf5_int32, first, shape(values, int64), c_loc(values), error)
  end subroutine part_int32

  !> Write rows of a dataset of 64-bit integers.
  subroutine part_int64(self, name, first, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    integer(int64), intent(in), contiguous, target :: values(:)  !! Values (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_rows(self, name, hdf5_int64, first, shape(values, int64), c_loc(values), error)
  end subroutine part_int64

  !> Write a dataset of reals.
  subroutine dataset_real_1d(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    real(dp), intent(in), contiguous, target :: values(:)  !! Values (n) [any].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_dataset(self, name, hdf5_real, shape(values, int64), c_loc(values), error)
  end subroutine dataset_real_1d

  !> Write a dataset of vectors.
  subroutine dataset_real_2d(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    real(dp), intent(in), contiguous, target :: values(:, :)  !! Rows of values (width, n) [any].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_dataset(self, name, hdf5_real, shape(values, int64), c_loc(values), error)
  end subroutine dataset_real_2d

  !> Write a dataset of 32-bit integers.
  subroutine dataset_int32(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer(int32), intent(in), contiguous, target :: values(:)  !! Values (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_dataset(self, name, hdf5_int32, shape(values, int64), c_loc(values), error)
  end subroutine dataset_int32

  !> Write a dataset of 64-bit integers.
  subroutine dataset_int64(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer(int64), intent(in), contiguous, target :: values(:)  !! Values (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_dataset(self, name, hdf5_int64, shape(values, int64), c_loc(values), error)
  end subroutine dataset_int64

  !> A text of any length, stored without padding.
  subroutine put_text(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    character(*), intent(in) :: value  !! Its text.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
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

  !> Write an integer as attribute.
  subroutine put_integer(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    integer(int32), intent(in), target :: value  !! Value of the attribute.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_attribute(self, object, name, h5t_std_i32le, [integer(hsize_t) ::], c_loc(value), error)
  end subroutine put_integer

  !> Write a 64-bit integer as attribute.
  subroutine put_long(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    integer(int64), intent(in), target :: value  !! Value of the attribute.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_attribute(self, object, name, h5t_std_i64le, [integer(hsize_t) ::], c_loc(value), error)
  end subroutine put_long

  !> Write a real as attribute.
  subroutine put_real(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    real(dp), intent(in), target :: value  !! Value of the attribute [any].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_attribute(self, object, name, h5t_ieee_f64le, [integer(hsize_t) ::], c_loc(value), error)
  end subroutine put_real

  !> Write integers as attribute.
  subroutine put_integers(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    integer(int32), intent(in), contiguous, target :: value(:)  !! Its values (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_attribute(self, object, name, h5t_std_i32le, shape(value, hsize_t), c_loc(value), error)
  end subroutine put_integers

  !> Write 64-bit integers as attribute.
  subroutine put_longs(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    integer(int64), intent(in), contiguous, target :: value(:)  !! Its values (n).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_attribute(self, object, name, h5t_std_i64le, shape(value, hsize_t), c_loc(value), error)
  end subroutine put_longs

  !> Write reals as attribute.
  subroutine put_reals(self, object, name, value, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    real(dp), intent(in), contiguous, target :: value(:)  !! Values of the attribute (n) [any].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the file cannot be written.
    call write_attribute(self, object, name, h5t_ieee_f64le, shape(value, hsize_t), c_loc(value), error)
  end subroutine put_reals
end module dotyk_output_hdf5
