!> Values of the data arrays of VTK's XML files (.vtu): text, base64 or raw bytes, inline or appended, also those that
!> zlib compressed.
module dotyk_mesh_vtu_file
  use, intrinsic :: iso_fortran_env, only: int16
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_base_number_text, only: ends_word, scan_integer, scan_real
  use dotyk_base_text, only: quoted, shown, to_text
  use dotyk_mesh_vtu_bytes, only: read_block
  use dotyk_mesh_vtu_tags, only: most_compressed, vtu_array_t, vtu_tags_t
  implicit none
  private

  type, extends(vtu_tags_t), public :: vtu_file_t  !! A file, whose tags `read_tags` reads.
  contains
    procedure :: integers => file_integers
    procedure :: reals => file_reals
  end type vtu_file_t

contains

  !> Bytes of a value of a type; 0 for a type that is not known.
  pure integer function size_of(type)
    character(*), intent(in) :: type  !! Name of the type.
    select case (type)
    case ('Int8', 'UInt8')
      size_of = 1
    case ('Int16', 'UInt16')
      size_of = 2
    case ('Int32', 'UInt32', 'Float32')
      size_of = 4
    case ('Int64', 'UInt64', 'Float64')
      size_of = 8
    case default
      size_of = 0
    end select
  end function size_of

  !> Bytes of an array that is no text.
  subroutine get_bytes(self, array, n, bytes)
    type(vtu_file_t), intent(inout) :: self  !! The file; mistakes are kept there.
    type(vtu_array_t), intent(in) :: array  !! The array.
    integer(int64), intent(in) :: n  !! Number of values.
    character(:), allocatable, intent(out) :: bytes  !! The bytes.
    character(:), allocatable :: fault
    integer(int64) :: length
    length = n*size_of(array%type)
    if (length > most_compressed*self%bytes%size) then
      call self%fail('array '//quoted(array%name)//': the file has no room for it: it is truncated', array%position)
      return
    end if
    allocate (character(length) :: bytes)
    if (array%format == 'appended') then
      call read_block(self%bytes%text, self%appended + array%offset, self%bytes%size, self%encoded, self%header_size, &
                      self%compressed, bytes, fault)
      if (self%appended == 0) fault = 'there is no <AppendedData>: the file is truncated'
    else
      call read_block(self%bytes%text, array%first, array%last, .true., self%header_size, self%compressed, bytes, fault)
    end if
    if (len(fault) > 0) call self%fail('array '//quoted(array%name)//': '//fault, array%position)
  end subroutine get_bytes

  !> Values of an array of integers.
  subroutine file_integers(self, index, n, value)
    class(vtu_file_t), intent(inout) :: self
    integer, intent(in) :: index  !! Index of the array.
    integer(int64), intent(in) :: n  !! Number of values.
    integer(int64), allocatable, intent(out) :: value(:)  !! The values; mistakes are kept as a fault (n).
    character(:), allocatable :: bytes
    integer(int64) :: p, i
    integer :: width
    logical :: valid
    allocate (value(0))
    if (allocated(self%fault)) return
    associate (array => self%array(index))
      width = size_of(array%type)
      if (width == 0 .or. array%type(1:1) == 'F') then
        call self%fail('array '//quoted(array%name)//' must be of integers, not '//array%type, array%position)
        return
      end if
      if (array%format == 'ascii') then
        call begin_text(self, array, n, p)
        if (allocated(self%fault)) return
        deallocate (value)
        allocate (value(n), source=0_int64)
        do i = 1, n
          call skip_blanks(self%bytes%text, p)
          call scan_integer(self%bytes%text, p, value(i), valid)
          if (valid .and. p <= array%last + 1) cycle
          call refuse_text(self, array, i, n, p, 'an integer')
          return
        end do
        call end_text(self, array, p)
        return
      end if
      call get_bytes(self, array, n, bytes)
      if (allocated(self%fault)) return
      deallocate (value)
      allocate (value(n), source=0_int64)
      do i = 1, n
        p = (i - 1)*width
        select case (array%type)
        case ('Int8')
          value(i) = iachar(bytes(p + 1:p + 1))
          if (value(i) > 127) value(i) = value(i) - 256
        case ('UInt8')
          value(i) = iachar(bytes(p + 1:p + 1))
        case ('Int16')
          value(i) = transfer(bytes(p + 1:p + 2), 0_int16)
        case ('UInt16')
          value(i) = iand(int(transfer(bytes(p + 1:p + 2), 0_int16), int64), 65535_int64)
        case ('Int32')
          value(i) = transfer(bytes(p + 1:p + 4), 0_int32)
        case ('UInt32')
          value(i) = iand(int(transfer(bytes(p + 1:p + 4), 0_int32), int64), int(z'FFFFFFFF', int64))
        case default
          value(i) = transfer(bytes(p + 1:p + 8), 0_int64)
        end select
      end do
    end associate
  end subroutine file_integers

  !> Values of an array of reals.
  subroutine file_reals(self, index, n, value)
    class(vtu_file_t), intent(inout) :: self
    integer, intent(in) :: index  !! Index of the array.
    integer(int64), intent(in) :: n  !! Number of values.
    real(dp), allocatable, intent(out) :: value(:)  !! The values, finite; mistakes are kept as a fault (n) [any].
    !> Exponent bits: all set in infinities and NaN. Compared as bits, as a signalling NaN traps in other comparisons.
    integer(int64), parameter :: exponent_bits = int(z'7FF0000000000000', int64)
    integer(int32), parameter :: short_exponent_bits = int(z'7F800000', int32)
    character(:), allocatable :: bytes
    integer(int64) :: p, i
    logical :: valid
    allocate (value(0))
    if (allocated(self%fault)) return
    associate (array => self%array(index))
      if (size_of(array%type) == 0 .or. array%type(1:1) /= 'F') then
        call self%fail('array '//quoted(array%name)//' must be Float32 or Float64, not '//array%type, array%position)
        return
      end if
      if (array%format == 'ascii') then
        call begin_text(self, array, n, p)
        if (allocated(self%fault)) return
        deallocate (value)
        allocate (value(n), source=0.0_dp)
        do i = 1, n
          call skip_blanks(self%bytes%text, p)
          call scan_real(self%bytes%text, p, value(i), valid)
          if (valid .and. p <= array%last + 1) cycle
          call refuse_text(self, array, i, n, p, 'a finite number')
          return
        end do
        call end_text(self, array, p)
        return
      end if
      call get_bytes(self, array, n, bytes)
      if (allocated(self%fault)) return
      deallocate (value)
      allocate (value(n), source=0.0_dp)
      do i = 1, n
        if (array%type == 'Float64') then
          valid = iand(transfer(bytes(8*i - 7:8*i), 0_int64), exponent_bits) /= exponent_bits
          if (valid) value(i) = transfer(bytes(8*i - 7:8*i), 0.0_dp)
        else
          valid = iand(transfer(bytes(4*i - 3:4*i), 0_int32), short_exponent_bits) /= short_exponent_bits
          if (valid) value(i) = transfer(bytes(4*i - 3:4*i), 0.0)
        end if
        if (valid) cycle
        call self%fail('array '//quoted(array%name)//': value '//to_text(i)//' is not finite', array%position)
        return
      end do
    end associate
  end subroutine file_reals

  !> Begin to read numbers that are text.
  subroutine begin_text(self, array, n, p)
    type(vtu_file_t), intent(inout) :: self  !! The file; the tag behind the numbers is blanked.
    type(vtu_array_t), intent(in) :: array  !! The array.
    integer(int64), intent(in) :: n  !! Number of values.
    integer(int64), intent(out) :: p  !! The first letter.
    p = array%first
    if (n > (array%last - array%first)/2 + 1) then
      call self%fail('array '//quoted(array%name)//' has fewer than '//to_text(n)//' values', array%position)
    else if (array%last < self%bytes%size) then
      ! Numbers end with a blank.
      self%bytes%text(array%last + 1:array%last + 1) = ' '
    end if
  end subroutine begin_text

  !> Skip blanks; the text ends with a NUL.
  pure subroutine skip_blanks(text, p)
    character(*), intent(in) :: text  !! Text.
    integer(int64), intent(inout) :: p  !! Place in it.
    do while (p < len(text, int64))
      if (.not. ends_word(text(p:p))) exit
      p = p + 1
    end do
  end subroutine skip_blanks

  !> Refuse what is no number, or numbers that are missing.
  subroutine refuse_text(self, array, i, n, p, expected)
    type(vtu_file_t), intent(inout) :: self  !! The file.
    type(vtu_array_t), intent(in) :: array  !! The array.
    integer(int64), intent(in) :: i, n  !! The value, and how many there must be.
    integer(int64), intent(in) :: p  !! Its place.
    character(*), intent(in) :: expected  !! What it must be.
    integer(int64) :: last
    if (p > array%last) then
      call self%fail('array '//quoted(array%name)//' has fewer than '//to_text(n)//' values', array%position)
      return
    end if
    last = p
    do while (last < min(array%last, p + 40))
      if (ends_word(self%bytes%text(last + 1:last + 1))) exit
      last = last + 1
    end do
    call self%fail('array '//quoted(array%name)//', value '//to_text(i)//': expected '//expected//', found '// &
                   shown(self%bytes%text(p:last)), p)
  end subroutine refuse_text

  !> Refuse numbers that are too many.
  subroutine end_text(self, array, p)
    type(vtu_file_t), intent(inout) :: self  !! The file.
    type(vtu_array_t), intent(in) :: array  !! The array.
    integer(int64), intent(inout) :: p  !! Letter behind the last value.
    call skip_blanks(self%bytes%text, p)
    if (p <= array%last) &
      call self%fail('array '//quoted(array%name)//' has more values than its points or cells need', p)
  end subroutine end_text
end module dotyk_mesh_vtu_file
