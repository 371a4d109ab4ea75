!> Writing of HDF5 files. HDF5 is known to this module and its neighbours `hdf5_*.f90` only.
!>
!> Arrays (3, n) of Fortran are (n, 3) for C, Python and VTK. The last Fortran dimension of a dataset counts its rows; a
!> dataset is made at its full size and filled by parts, so that bodies are written one at a time. Empty arrays are
!> allowed. HDF5 is not thread-safe: one thread at a time. Names are those of `path_of`; `close` reports failures.
module dotyk_output_hdf5
  use, intrinsic :: iso_c_binding, only: c_char, c_loc
  use, intrinsic :: iso_fortran_env, only: int8
  use hdf5, only: h5t_c_s1, h5t_cset_utf8_f, h5t_ieee_f64le, h5t_std_i32le, h5t_std_i64le, h5t_str_nullpad_f, &
    h5tclose_f, h5tcopy_f, h5tset_cset_f, h5tset_size_f, h5tset_strpad_f, hid_t, hsize_t, size_t
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_output_hdf5_handle, only: hdf5_handle_t, hdf5_int32, hdf5_int64, hdf5_real, hdf5_uint8, path_of, &
    write_attribute, write_dataset, write_rows
  implicit none
  private
  public :: hdf5_real, hdf5_int32, hdf5_int64, hdf5_uint8

  type, extends(hdf5_handle_t), public :: hdf5_file_t  !! A file open for writing.
  contains
    procedure, private :: put_text, put_integer, put_long, put_real, put_logical, put_integers, put_longs, put_reals
    !> put_attribute(object, name, value): a text, a number, a logical (0 or 1) or a 1-d vector at a group or dataset.
    generic :: put_attribute => put_text, put_integer, put_long, put_real, put_logical, put_integers, put_longs, &
      put_reals
    procedure, private :: part_real_1d, part_real_2d, part_int8, part_int32, part_int64
    !> put_part(name, first, values): rows first+1.. of a dataset made by `new_dataset`.
    generic :: put_part => part_real_1d, part_real_2d, part_int8, part_int32, part_int64
    procedure, private :: array_reals, array_vectors, array_integers, array_longs
    !> put_array(group, name, values): a whole dataset; vectors (2 or 3, n) get three components.
    generic :: put_array => array_reals, array_vectors, array_integers, array_longs
  end type hdf5_file_t

  public :: with_three_components

contains

  !> Write rows of a dataset of reals.
  subroutine part_real_1d(self, name, first, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Path of the dataset.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    real(dp), intent(in), contiguous, target :: values(:)  !! Values (n) [any].
    call write_rows(self, name, hdf5_real, first, shape(values, int64), c_loc(values))
  end subroutine part_real_1d

  !> Write rows of a dataset of vectors.
  subroutine part_real_2d(self, name, first, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Path of the dataset.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    real(dp), intent(in), contiguous, target :: values(:, :)  !! Rows of values (width, n) [any].
    call write_rows(self, name, hdf5_real, first, shape(values, int64), c_loc(values))
  end subroutine part_real_2d

  !> Write rows of a dataset of 8-bit integers.
  subroutine part_int8(self, name, first, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Path of the dataset.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    integer(int8), intent(in), contiguous, target :: values(:)  !! Values (n).
    call write_rows(self, name, hdf5_uint8, first, shape(values, int64), c_loc(values))
  end subroutine part_int8

  !> Write rows of a dataset of 32-bit integers.
  subroutine part_int32(self, name, first, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Path of the dataset.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    integer(int32), intent(in), contiguous, target :: values(:)  !! Values (n).
    call write_rows(self, name, hdf5_int32, first, shape(values, int64), c_loc(values))
  end subroutine part_int32

  !> Write rows of a dataset of 64-bit integers.
  subroutine part_int64(self, name, first, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Path of the dataset.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    integer(int64), intent(in), contiguous, target :: values(:)  !! Values (n).
    call write_rows(self, name, hdf5_int64, first, shape(values, int64), c_loc(values))
  end subroutine part_int64

  !> Write a dataset of reals.
  subroutine array_reals(self, group, name, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name  !! Its group, as in `path_of`, and its name there.
    real(dp), intent(in), contiguous, target :: values(:)  !! Values (n) [any].
    call write_dataset(self, path_of(self, group)//'/'//name, hdf5_real, shape(values, int64), c_loc(values))
  end subroutine array_reals

  !> Write a dataset of 32-bit integers.
  subroutine array_integers(self, group, name, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name  !! Its group, as in `path_of`, and its name there.
    integer(int32), intent(in), contiguous, target :: values(:)  !! Values (n).
    call write_dataset(self, path_of(self, group)//'/'//name, hdf5_int32, shape(values, int64), c_loc(values))
  end subroutine array_integers

  !> Write a dataset of 64-bit integers.
  subroutine array_longs(self, group, name, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name  !! Its group, as in `path_of`, and its name there.
    integer(int64), intent(in), contiguous, target :: values(:)  !! Values (n).
    call write_dataset(self, path_of(self, group)//'/'//name, hdf5_int64, shape(values, int64), c_loc(values))
  end subroutine array_longs

  !> Write a dataset of vectors.
  subroutine array_vectors(self, group, name, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: group, name  !! Its group, as in `path_of`, and its name there.
    real(dp), intent(in) :: values(:, :)  !! Vectors (2 or 3, n) [any].
    real(dp), allocatable, target :: all(:, :)
    all = with_three_components(values)
    call write_dataset(self, path_of(self, group)//'/'//name, hdf5_real, shape(all, int64), c_loc(all))
  end subroutine array_vectors

  !> Vectors with three components; plane vectors get z = 0 (3, n) [any].
  pure function with_three_components(x) result(y)
    real(dp), intent(in) :: x(:, :)  !! Vectors (2 or 3, n) [any].
    real(dp), allocatable :: y(:, :)
    integer :: i, dimension
    dimension = min(3, size(x, 1))
    allocate (y(3, size(x, 2)))
    do i = 1, size(x, 2)
      y(:dimension, i) = x(:dimension, i)
      y(dimension + 1:, i) = 0
    end do
  end function with_three_components

  !> A text of any length, stored without padding.
  subroutine put_text(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! The group or dataset, as in `path_of`, and the name of the attribute.
    character(*), intent(in) :: value  !! Its text.
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
    call write_attribute(self, path_of(self, object), name, type_id, [integer(hsize_t) ::], c_loc(letters))
    call h5tclose_f(type_id, status)
  end subroutine put_text

  !> Write an integer as attribute.
  subroutine put_integer(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    integer(int32), intent(in), target :: value  !! Its value.
    call write_attribute(self, path_of(self, object), name, h5t_std_i32le, [integer(hsize_t) ::], c_loc(value))
  end subroutine put_integer

  !> Write a 64-bit integer as attribute.
  subroutine put_long(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    integer(int64), intent(in), target :: value  !! Its value.
    call write_attribute(self, path_of(self, object), name, h5t_std_i64le, [integer(hsize_t) ::], c_loc(value))
  end subroutine put_long

  !> Write a real as attribute.
  subroutine put_real(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    real(dp), intent(in), target :: value  !! Its value [any].
    call write_attribute(self, path_of(self, object), name, h5t_ieee_f64le, [integer(hsize_t) ::], c_loc(value))
  end subroutine put_real

  !> Write a logical as attribute.
  subroutine put_logical(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    logical, intent(in) :: value  !! Its value; 1 for true in the file.
    call self%put_integer(object, name, merge(1, 0, value))
  end subroutine put_logical

  !> Write integers as attribute.
  subroutine put_integers(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    integer(int32), intent(in), contiguous, target :: value(:)  !! Its values (n).
    call write_attribute(self, path_of(self, object), name, h5t_std_i32le, shape(value, hsize_t), c_loc(value))
  end subroutine put_integers

  !> Write 64-bit integers as attribute.
  subroutine put_longs(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    integer(int64), intent(in), contiguous, target :: value(:)  !! Its values (n).
    call write_attribute(self, path_of(self, object), name, h5t_std_i64le, shape(value, hsize_t), c_loc(value))
  end subroutine put_longs

  !> Write reals as attribute.
  subroutine put_reals(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    real(dp), intent(in), contiguous, target :: value(:)  !! Its values (n) [any].
    call write_attribute(self, path_of(self, object), name, h5t_ieee_f64le, shape(value, hsize_t), c_loc(value))
  end subroutine put_reals
end module dotyk_output_hdf5
