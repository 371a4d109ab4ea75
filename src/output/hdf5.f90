!> Writing and reading of HDF5 files. HDF5 is known to this module and its neighbour `hdf5_reason.f90` only.
!>
!> Arrays (3, n) of Fortran are (n, 3) for C, Python and VTK. The last Fortran dimension of a dataset counts its rows; a
!> dataset is made at its full size and filled by parts, so that bodies are written one at a time. Empty arrays are
!> allowed. HDF5 is not thread-safe: one thread at a time. Names are those of `path_of`. The first write that fails is
!> kept, and those after it do nothing: `close` reports it.
module dotyk_output_hdf5
  use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_ptr
  use, intrinsic :: iso_fortran_env, only: int8
  use hdf5, only: h5aclose_f, h5acreate_by_name_f, h5awrite_f, h5dclose_f, h5dcreate_f, h5dget_space_f, h5dopen_f, &
    h5dread_f, h5dwrite_f, h5f_acc_rdonly_f, h5f_acc_trunc_f, h5f_close_strong_f, h5f_libver_v18_f, h5fclose_f, &
    h5fcreate_f, h5fopen_f, h5gclose_f, h5gcreate_f, h5gget_obj_info_idx_f, h5gn_members_f, h5lexists_f, &
    h5p_dataset_create_f, h5p_file_access_f, h5pclose_f, h5pcreate_f, h5pset_fclose_degree_f, h5pset_fill_value_f, &
    h5pset_libver_bounds_f, h5s_scalar_f, h5s_select_set_f, h5sclose_f, h5screate_f, h5screate_simple_f, &
    h5sget_simple_extent_npoints_f, h5sselect_hyperslab_f, h5t_c_s1, h5t_cset_utf8_f, h5t_ieee_f64le, &
    h5t_native_double, h5t_native_integer, h5t_std_i32le, h5t_std_i64le, h5t_std_u8le, h5t_str_nullpad_f, h5tclose_f, &
    h5tcopy_f, h5tset_cset_f, h5tset_size_f, h5tset_strpad_f, hid_t, hsize_t, size_t
  use dotyk_base_error, only: error_t, exit_not_written, set_error
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_base_text, only: quoted, to_text
  use dotyk_output_hdf5_reason, only: hdf5_reason, start_hdf5
  implicit none
  private
  public :: with_three_components

  type, public :: hdf5_file_t  !! A file open for writing, or for reading.
    character(:), allocatable :: label  !! Name of the file in messages.
    integer(hid_t) :: id = -1  !! Handle of HDF5.
    logical :: is_open = .false.  !! Whether the file is open.
    !> Group that names without a slash at their beginning are in; not allocated for that of the whole file.
    character(:), allocatable :: root
    type(error_t), allocatable :: failure  !! The first write that failed.
  contains
    procedure :: create => file_create
    procedure :: close => file_close
    procedure :: add_group => file_add_group
    procedure :: has => file_has
    procedure :: n_members => file_n_members
    procedure :: member => file_member
    procedure :: new_dataset => file_new_dataset
    procedure :: open => file_open
    procedure :: n_values => file_n_values
    procedure :: read_reals => file_read_reals
    procedure, private :: put_text, put_integers, put_longs, put_reals, put_logical
    !> put_attribute(object, name, value): a text, a number, a logical (0 or 1) or a 1-d vector at a group or dataset.
    generic :: put_attribute => put_text, put_integers, put_longs, put_reals, put_logical
    procedure, private :: part_reals, part_int8, part_int32, part_int64
    !> put_part(name, first, values): rows first+1.. of a dataset made by `new_dataset`.
    generic :: put_part => part_reals, part_int8, part_int32, part_int64
    procedure, private :: array_reals, array_vectors, array_integers, array_longs
    !> put_array(group, name, values): a whole dataset; vectors (2 or 3, n) get three components.
    generic :: put_array => array_reals, array_vectors, array_integers, array_longs
  end type hdf5_file_t

  !> Kinds of numbers that a dataset may hold.
  integer, parameter, public :: hdf5_real = 1   !< 64-bit real
  integer, parameter, public :: hdf5_int32 = 2  !< 32-bit integer
  integer, parameter, public :: hdf5_int64 = 3  !< 64-bit integer
  integer, parameter, public :: hdf5_uint8 = 4  !< unsigned 8-bit integer; in memory `int8` values 0..127

contains

  !> Write rows of a dataset of reals or vectors.
  subroutine part_reals(self, name, first, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Path of the dataset.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    real(dp), intent(in), contiguous, target :: values(..)  !! Values (n) or (width, n) [any].
    call write_rows(self, name, hdf5_real, first, shape(values, int64), c_loc(values))
  end subroutine part_reals

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

  !> Write a logical as attribute.
  subroutine put_logical(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    logical, intent(in) :: value  !! Its value; 1 for true in the file.
    call self%put_integers(object, name, merge(1, 0, value))
  end subroutine put_logical

  !> Write integers as attribute: one, or a vector.
  subroutine put_integers(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    integer(int32), intent(in), contiguous, target :: value(..)  !! A scalar, or values (n).
    call write_attribute(self, path_of(self, object), name, h5t_std_i32le, shape(value, hsize_t), c_loc(value))
  end subroutine put_integers

  !> Write 64-bit integers as attribute: one, or a vector.
  subroutine put_longs(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    integer(int64), intent(in), contiguous, target :: value(..)  !! A scalar, or values (n).
    call write_attribute(self, path_of(self, object), name, h5t_std_i64le, shape(value, hsize_t), c_loc(value))
  end subroutine put_longs

  !> Write reals as attribute: one, or a vector.
  subroutine put_reals(self, object, name, value)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object, name  !! As in `put_text`.
    real(dp), intent(in), contiguous, target :: value(..)  !! A scalar, or values (n) [any].
    call write_attribute(self, path_of(self, object), name, h5t_ieee_f64le, shape(value, hsize_t), c_loc(value))
  end subroutine put_reals

  !> Keep the error of a failed call, where it is the first one.
  subroutine fail(self, what)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: what  !! Name of what is written, or empty.
    character(:), allocatable :: reason
    if (allocated(self%failure)) return
    reason = hdf5_reason()
    if (len(what) > 0) reason = reason//' (at '//what//')'
    call set_error(self%failure, quoted(self%label)//' cannot be written: '//reason, exit_not_written)
  end subroutine fail

  !> Path of a group or dataset in the file.
  pure function path_of(self, name) result(path)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Its name, relative to `root` where it does not begin with a slash.
    character(:), allocatable :: path
    path = name
    if (.not. allocated(self%root) .or. index(name, '/') == 1) return
    path = self%root
    if (len(name) > 0) path = path//'/'//name
  end function path_of

  !> Create a file, in place of one of the same name.
  subroutine file_create(self, path, label)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: path  !! Path of the file.
    character(*), intent(in), optional :: label  !! Name of the file in messages; `path` if absent.
    integer(hid_t) :: access
    integer :: status
    call start_hdf5()
    if (allocated(self%failure)) deallocate (self%failure)
    self%label = path
    if (present(label)) self%label = label
    call h5pcreate_f(h5p_file_access_f, access, status)
    ! Closing the file closes whatever a failed call left open in it.
    call h5pset_fclose_degree_f(access, h5f_close_strong_f, status)
    ! The format of HDF5 1.8 and later has no limit of 64 kB on attributes, which the input text may exceed.
    call h5pset_libver_bounds_f(access, h5f_libver_v18_f, h5f_libver_v18_f, status)
    call h5fcreate_f(path, h5f_acc_trunc_f, self%id, status, access_prp=access)
    self%is_open = status >= 0
    if (.not. self%is_open) call fail(self, '')
    call h5pclose_f(access, status)
  end subroutine file_create

  !> Flush and close the file.
  subroutine file_close(self, error)
    class(hdf5_file_t), intent(inout) :: self
    !> Allocated where this, or a write before it, failed; absent of files that are read.
    type(error_t), allocatable, intent(out), optional :: error
    integer :: status
    if (self%is_open) then
      call h5fclose_f(self%id, status)
      self%is_open = .false.
      if (status < 0) call fail(self, '')
    end if
    if (present(error) .and. allocated(self%failure)) error = self%failure
  end subroutine file_close

  !> Whether the file has an object.
  logical function file_has(self, name) result(has)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Path in the file; its parents exist.
    integer :: status
    call h5lexists_f(self%id, name, has, status)
    has = has .and. status >= 0
  end function file_has

  !> Number of groups and datasets in a group; 0 where it cannot be read.
  integer function file_n_members(self, group) result(n)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: group  !! Path in the file.
    integer :: status
    call h5gn_members_f(self%id, group, n, status)
    if (status < 0) n = 0
  end function file_n_members

  !> Name of one of them.
  function file_member(self, group, i) result(name)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: group  !! Path in the file.
    integer, intent(in) :: i  !! Its index, from 1.
    character(:), allocatable :: name
    character(80) :: text
    integer :: kind, status
    text = ''
    call h5gget_obj_info_idx_f(self%id, group, i - 1, text, kind, status)
    name = trim(text)
  end function file_member

  !> Add a group to an existing one.
  subroutine file_add_group(self, name)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! As in `path_of`.
    integer(hid_t) :: group
    integer :: status
    if (allocated(self%failure)) return
    call h5gcreate_f(self%id, path_of(self, name), group, status)
    if (status < 0) then
      call fail(self, path_of(self, name))
    else
      call h5gclose_f(group, status)
    end if
  end subroutine file_add_group

  !> Make a dataset of full size, which is filled by parts.
  subroutine file_new_dataset(self, name, number_kind, extent, zero)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Path in the file.
    integer, intent(in) :: number_kind  !! One of `hdf5_real`, `hdf5_int32`, `hdf5_int64`, `hdf5_uint8`.
    integer(int64), intent(in) :: extent(:)  !! Fortran shape of the dataset; the last is filled by parts (1 or 2).
    logical, intent(in), optional :: zero  !! Whether rows that are not written are zero; undefined if absent.
    integer(hid_t) :: space, dataset, creation
    integer :: status
    if (allocated(self%failure)) return
    call h5screate_simple_f(size(extent), int(extent, hsize_t), space, status)
    call h5pcreate_f(h5p_dataset_create_f, creation, status)
    if (present(zero)) then
      if (zero) call h5pset_fill_value_f(creation, h5t_native_integer, 0, status)
    end if
    call h5dcreate_f(self%id, name, file_type(number_kind), space, dataset, status, creation)
    if (status < 0) then
      call fail(self, name)
    else
      call h5dclose_f(dataset, status)
      if (status < 0) call fail(self, name)
    end if
    call h5pclose_f(creation, status)
    call h5sclose_f(space, status)
  end subroutine file_new_dataset

  !> Type of numbers in the file.
  integer(hid_t) function file_type(number_kind) result(type_id)
    integer, intent(in) :: number_kind  !! One of `hdf5_real`, `hdf5_int32`, `hdf5_int64`, `hdf5_uint8`.
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

  !> Write rows of a dataset. Memory has the types of the file: all machines are little-endian.
  subroutine write_rows(self, name, number_kind, first, extent, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer, intent(in) :: number_kind  !! One of `hdf5_real`, `hdf5_int32`, `hdf5_int64`, `hdf5_uint8`.
    integer(int64), intent(in) :: first  !! Number of rows before the first one.
    integer(int64), intent(in) :: extent(:)  !! Shape of the values (1 or 2).
    type(c_ptr), intent(in) :: values  !! Address of the first value.
    integer(hid_t) :: dataset, space, memory
    integer(hsize_t) :: offset(size(extent))
    integer :: status, ignored
    if (product(extent) == 0 .or. allocated(self%failure)) return
    call h5dopen_f(self%id, name, dataset, status)
    if (status < 0) then
      call fail(self, name)
      return
    end if
    offset = 0
    offset(size(extent)) = first
    call h5dget_space_f(dataset, space, status)
    call h5screate_simple_f(size(extent), int(extent, hsize_t), memory, status)
    call h5sselect_hyperslab_f(space, h5s_select_set_f, offset, int(extent, hsize_t), status)
    if (status >= 0) call h5dwrite_f(dataset, file_type(number_kind), values, status, memory, space)
    if (status < 0) call fail(self, name)
    call h5sclose_f(memory, ignored)
    call h5sclose_f(space, ignored)
    call h5dclose_f(dataset, ignored)
    if (ignored < 0 .and. status >= 0) call fail(self, name)
  end subroutine write_rows

  !> Write a whole dataset.
  subroutine write_dataset(self, name, number_kind, extent, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: name  !! Name of the dataset or attribute, with its path.
    integer, intent(in) :: number_kind  !! One of `hdf5_real`, `hdf5_int32`, `hdf5_int64`, `hdf5_uint8`.
    integer(int64), intent(in) :: extent(:)  !! Shape of the values (1 or 2).
    type(c_ptr), intent(in) :: values  !! Address of the first value.
    call self%new_dataset(name, number_kind, extent)
    call write_rows(self, name, number_kind, 0_int64, extent, values)
  end subroutine write_dataset

  !> Write an attribute.
  subroutine write_attribute(self, object, name, type_id, extent, values)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: object  !! Path of the group or dataset.
    character(*), intent(in) :: name  !! Name of the attribute.
    integer(hid_t), intent(in) :: type_id  !! Type in memory and in the file.
    integer(hsize_t), intent(in) :: extent(:)  !! Shape of the values (0 for a scalar, 1 for a vector).
    type(c_ptr), intent(in) :: values  !! Address of the first value.
    integer(hid_t) :: space, attribute
    integer :: status, ignored
    if (allocated(self%failure)) return
    if (size(extent) == 0) then
      call h5screate_f(h5s_scalar_f, space, status)
    else
      call h5screate_simple_f(size(extent), extent, space, status)
    end if
    call h5acreate_by_name_f(self%id, object, name, type_id, space, attribute, status)
    if (status >= 0) then
      if (product(extent) > 0) call h5awrite_f(attribute, type_id, values, status)
      if (status < 0) call fail(self, object//'@'//name)
      call h5aclose_f(attribute, ignored)
    else
      call fail(self, object//'@'//name)
    end if
    call h5sclose_f(space, ignored)
  end subroutine write_attribute

  !> Open a file for reading.
  subroutine file_open(self, path, error)
    class(hdf5_file_t), intent(inout) :: self
    character(*), intent(in) :: path  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where there is no such file, or it is no HDF5 file.
    integer(hid_t) :: access
    integer :: status
    call start_hdf5()
    self%label = path
    call h5pcreate_f(h5p_file_access_f, access, status)
    call h5pset_fclose_degree_f(access, h5f_close_strong_f, status)
    call h5fopen_f(path, h5f_acc_rdonly_f, self%id, status, access)
    self%is_open = status >= 0
    if (.not. self%is_open) call fail_to_read(self, '/', error)
    call h5pclose_f(access, status)
  end subroutine file_open

  !> Number of values of a dataset; -1 where there is none.
  integer(int64) function file_n_values(self, name) result(n)
    class(hdf5_file_t), intent(in) :: self
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
  end function file_n_values

  !> Read a dataset, whatever its shape. The array has the size that the caller expects: what a damaged file says of
  !> its size makes none.
  subroutine file_read_reals(self, name, values, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: name  !! Path in the file; its parents exist.
    real(dp), contiguous, target, intent(out) :: values(:)  !! As reals, in the order of the file (n) [any].
    type(error_t), allocatable, intent(out) :: error  !! The dataset is missing, of another size, or unreadable.
    integer(hid_t) :: dataset
    type(c_ptr) :: buffer
    integer :: status, ignored
    values = 0
    if (self%n_values(name) /= size(values, kind=int64)) then
      call set_error(error, quoted(self%label)//' cannot be read: '//name//' does not hold '// &
                     to_text(size(values))//' numbers')
      return
    end if
    if (size(values) == 0) return
    buffer = c_loc(values)
    call h5dopen_f(self%id, name, dataset, status)
    if (status >= 0) call h5dread_f(dataset, h5t_native_double, buffer, status)
    if (status < 0) call fail_to_read(self, name, error)
    call h5dclose_f(dataset, ignored)
  end subroutine file_read_reals

  !> Make the error of a failed call of reading.
  subroutine fail_to_read(self, what, error)
    class(hdf5_file_t), intent(in) :: self
    character(*), intent(in) :: what  !! Object of the file.
    type(error_t), allocatable, intent(out) :: error  !! Always set, with HDF5's own reason.
    call set_error(error, quoted(self%label)//' cannot be read: '//hdf5_reason()//' (at '//what//')')
  end subroutine fail_to_read
end module dotyk_output_hdf5
