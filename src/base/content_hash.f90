!> Hash of the content of a geometry file and of the files that it includes: FNV-1a with 64 bits (Fowler, Noll, Vo;
!> draft-eastlake-fnv).
module dotyk_base_content_hash
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_operating_system, only: directory_of
  use dotyk_base_text, only: text_t
  implicit none
  private

  !> Lower half of a 64-bit word.
  integer(int64), parameter :: low_half = 2_int64**32 - 1

  !> Hash that accumulates bytes. The two halves are separate, as products of 64-bit words would overflow.
  type, public :: content_hash_t
    !> Upper 32 bits (z'cbf29ce4', int64).
    integer(int64) :: high = int(z'cbf29ce4', int64)
    !> Lower 32 bits (z'84222325', int64).
    integer(int64) :: low = int(z'84222325', int64)
  contains
    procedure :: add => hash_add
    procedure :: add_file => hash_add_file
    procedure :: digits => hash_digits
  end type content_hash_t

contains

  !> Add bytes.
  pure subroutine hash_add(self, bytes)
    class(content_hash_t), intent(inout) :: self
    !> Bytes.
    character(*), intent(in) :: bytes
    integer(int64) :: high, low, product, i
    high = self%high
    low = self%low
    do i = 1, len(bytes, int64)
      ! Times the prime 2^40 + 435.
      product = ieor(low, int(iachar(bytes(i:i)), int64))
      high = iand(435*high + ishft(product, 8) + ishft(435*product, -32), low_half)
      low = iand(435*product, low_half)
    end do
    self%high = high
    self%low = low
  end subroutine hash_add

  !> Add a file and, recursively, every existing file that it names between double quotes, as in `Include "part.geo"`,
  !> `Merge "part.step"` or `Field[1].FileName = "sizes.dat"`. Names are relative to the file that contains them.
  subroutine hash_add_file(self, file, error)
    class(content_hash_t), intent(inout) :: self
    !> Path of the file.
    character(*), intent(in) :: file
    !> Set if the file cannot be read.
    type(error_t), allocatable, intent(out) :: error
    type(text_t), allocatable :: files(:)
    type(byte_cursor_t) :: cursor
    type(error_t), allocatable :: not_read
    integer :: n, i
    allocate (files(16))
    n = 1
    files(1)%s = file
    i = 0
    do while (i < n)
      i = i + 1
      call cursor%load(files(i)%s, not_read)
      if (allocated(not_read)) then
        ! Only the first file must exist: not every quoted text is a file name.
        if (i > 1) cycle
        call move_alloc(not_read, error)
        return
      end if
      call self%add(cursor%text)
      if (index(cursor%text(:cursor%size), achar(0)) == 0) &
        call add_named_files(cursor%text(:cursor%size), directory_of(files(i)%s), files, n)
    end do
  end subroutine hash_add_file

  !> Add the existing files that a text names between double quotes.
  subroutine add_named_files(text, directory, files, n)
    !> Text.
    character(*), intent(in) :: text
    !> Directory of relative names, with its slash.
    character(*), intent(in) :: directory
    !> Paths so far, each once (room).
    type(text_t), allocatable, intent(inout) :: files(:)
    !> Number of paths.
    integer, intent(inout) :: n
    character(:), allocatable :: path
    integer(int64) :: first, last, line_end
    logical :: found
    first = 0
    do
      last = index(text(first + 1:), '"', kind=int64)
      if (last == 0) exit
      first = first + last
      last = first + scan(text(first + 1:), '"'//achar(10), kind=int64)
      if (last == first) exit
      line_end = merge(last, 0_int64, text(last:last) == achar(10))
      path = text(first + 1:last - 1)
      first = last
      if (line_end > 0 .or. len_trim(path) == 0) cycle
      if (path(1:1) /= '/') path = directory//path
      inquire (file=path, exist=found)
      if (found) call add_path(path, files, n)
    end do
  end subroutine add_named_files

  !> Add a path if it is new.
  subroutine add_path(path, files, n)
    !> Path.
    character(*), intent(in) :: path
    !> Paths so far, each once (room).
    type(text_t), allocatable, intent(inout) :: files(:)
    !> Number of paths.
    integer, intent(inout) :: n
    type(text_t), allocatable :: larger(:)
    integer :: i
    do i = 1, n
      if (files(i)%s == path) return
    end do
    if (n == size(files)) then
      allocate (larger(2*n))
      do i = 1, n
        call move_alloc(files(i)%s, larger(i)%s)
      end do
      call move_alloc(larger, files)
    end if
    n = n + 1
    files(n)%s = path
  end subroutine add_path

  !> Hash as 16 hexadecimal digits.
  pure function hash_digits(self) result(digits)
    class(content_hash_t), intent(in) :: self
    !> Digits.
    character(16) :: digits
    write (digits, '(2z8.8)') self%high, self%low
  end function hash_digits
end module dotyk_base_content_hash
