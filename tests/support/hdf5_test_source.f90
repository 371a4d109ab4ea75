!> Reading back all that a results file may hold, for the tests of what writes it. Numbers are converted to the kind
!> that is asked for.
module hdf5_test_source
  use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_ptr
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted
  use dotyk_output_hdf5, only: hdf5_file_t
  use hdf5, only: h5_integer_kind, h5aclose_f, h5aget_space_f, h5aget_type_f, h5aopen_by_name_f, h5aread_f, &
    h5dclose_f, &
    h5dget_space_f, h5dopen_f, h5dread_f, h5kind_to_type, h5sclose_f, h5sget_simple_extent_dims_f, &
    h5sget_simple_extent_ndims_f, h5sget_simple_extent_npoints_f, h5t_native_double, h5tclose_f, h5tget_size_f, hid_t, &
    hsize_t, size_t
  implicit none
  private

  type, extends(hdf5_file_t), public :: test_source_t  !! A file open for reading.
  contains
    procedure :: get_text  !! get_text(object, name, text, error): an attribute, without the nulls that may pad it.
    procedure, private :: attribute_reals, attribute_longs
    !> get_attribute(object, name, values, error): a number (as an array of one) or a vector.
    generic :: get_attribute => attribute_reals, attribute_longs
    procedure, private :: dataset_reals, dataset_vectors, dataset_longs
    !> get_dataset(name, values, error): all of it.
    generic :: get_dataset => dataset_reals, dataset_vectors, dataset_longs
  end type test_source_t

contains

  subroutine get_text(self, object, name, text, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: object, name
    character(:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    character(kind=c_char), allocatable, target :: letters(:)
    integer(hid_t) :: attribute, type_id
    integer(size_t) :: length, i
    type(c_ptr) :: values
    integer :: status, ignored
    text = ''
    call h5aopen_by_name_f(self%id, object, name, attribute, status)
    if (status < 0) then
      call set_error(error, object//'@'//name//' cannot be read')
      return
    end if
    call h5aget_type_f(attribute, type_id, status)
    call h5tget_size_f(type_id, length, status)
    allocate (letters(length))
    values = c_loc(letters)
    call h5aread_f(attribute, type_id, values, status)
    if (status < 0) call set_error(error, object//'@'//name//' cannot be read')
    do while (length > 0)
      if (letters(length) /= achar(0)) exit
      length = length - 1
    end do
    text = repeat(' ', length)
    do i = 1, length
      text(i:i) = letters(i)
    end do
    call h5tclose_f(type_id, ignored)
    call h5aclose_f(attribute, ignored)
  end subroutine get_text

  !> Open an attribute and find its size.
  subroutine open_attribute(self, object, name, attribute, length, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: object, name
    integer(hid_t), intent(out) :: attribute
    integer(hsize_t), intent(out) :: length
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: space
    integer :: status
    length = 0
    call h5aopen_by_name_f(self%id, object, name, attribute, status)
    if (status < 0) then
      call set_error(error, object//'@'//name//' cannot be read')
      return
    end if
    call h5aget_space_f(attribute, space, status)
    call h5sget_simple_extent_npoints_f(space, length, status)
    call h5sclose_f(space, status)
  end subroutine open_attribute

  subroutine attribute_reals(self, object, name, values, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: object, name
    real(dp), allocatable, target, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: attribute
    integer(hsize_t) :: length
    type(c_ptr) :: buffer
    integer :: status
    call open_attribute(self, object, name, attribute, length, error)
    allocate (values(length))
    if (allocated(error) .or. length == 0) return
    buffer = c_loc(values)
    call h5aread_f(attribute, h5t_native_double, buffer, status)
    if (status < 0) call set_error(error, object//'@'//name//' cannot be read')
    call h5aclose_f(attribute, status)
  end subroutine attribute_reals

  subroutine attribute_longs(self, object, name, values, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: object, name
    integer(int64), allocatable, target, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: attribute
    integer(hsize_t) :: length
    type(c_ptr) :: buffer
    integer :: status
    call open_attribute(self, object, name, attribute, length, error)
    allocate (values(length))
    if (allocated(error) .or. length == 0) return
    buffer = c_loc(values)
    call h5aread_f(attribute, h5kind_to_type(int64, h5_integer_kind), buffer, status)
    if (status < 0) call set_error(error, object//'@'//name//' cannot be read')
    call h5aclose_f(attribute, status)
  end subroutine attribute_longs

  subroutine dataset_longs(self, name, values, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: name
    integer(int64), allocatable, target, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, type_id
    integer(hsize_t) :: extent(1)
    call open_dataset(self, name, 1, dataset, extent, error)
    allocate (values(extent(1)))
    type_id = h5kind_to_type(int64, h5_integer_kind)
    if (.not. allocated(error)) call read_values(name, dataset, type_id, extent(1), c_loc(values), error)
  end subroutine dataset_longs

  !> Open a dataset and find its Fortran shape.
  subroutine open_dataset(self, name, rank, dataset, extent, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: name
    integer, intent(in) :: rank  !! Rank that it must have.
    integer(hid_t), intent(out) :: dataset
    integer(hsize_t), intent(out) :: extent(rank)
    type(error_t), allocatable, intent(out) :: error
    integer(hsize_t) :: most(rank)
    integer(hid_t) :: space
    integer :: status, found
    extent = 0
    call h5dopen_f(self%id, name, dataset, status)
    if (status < 0) then
      call set_error(error, name//' cannot be read')
      return
    end if
    call h5dget_space_f(dataset, space, status)
    call h5sget_simple_extent_ndims_f(space, found, status)
    if (found == rank) then
      call h5sget_simple_extent_dims_f(space, extent, most, status)
    else
      call set_error(error, quoted(self%label)//': '//name//' has another number of dimensions')
    end if
    call h5sclose_f(space, status)
  end subroutine open_dataset

  !> Read a dataset and close it.
  subroutine read_values(name, dataset, type_id, length, values, error)
    character(*), intent(in) :: name
    integer(hid_t), intent(in) :: dataset, type_id
    integer(hsize_t), intent(in) :: length  !! Number of values.
    type(c_ptr), intent(in) :: values
    type(error_t), allocatable, intent(out) :: error
    type(c_ptr) :: buffer
    integer :: status
    buffer = values
    status = 0
    if (length > 0) call h5dread_f(dataset, type_id, buffer, status)
    if (status < 0) call set_error(error, name//' cannot be read')
    call h5dclose_f(dataset, status)
  end subroutine read_values

  subroutine dataset_reals(self, name, values, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: name
    real(dp), allocatable, target, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: dataset
    integer(hsize_t) :: extent(1)
    call open_dataset(self, name, 1, dataset, extent, error)
    allocate (values(extent(1)))
    if (.not. allocated(error)) then
      call read_values(name, dataset, h5t_native_double, extent(1), c_loc(values), error)
    end if
  end subroutine dataset_reals

  subroutine dataset_vectors(self, name, values, error)
    class(test_source_t), intent(in) :: self
    character(*), intent(in) :: name
    real(dp), allocatable, target, intent(out) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: dataset
    integer(hsize_t) :: extent(2)
    call open_dataset(self, name, 2, dataset, extent, error)
    allocate (values(extent(1), extent(2)))
    if (.not. allocated(error)) then
      call read_values(name, dataset, h5t_native_double, product(extent), c_loc(values), error)
    end if
  end subroutine dataset_vectors
end module hdf5_test_source
