!> Hash of bytes and files: FNV-1a with 64 bits (Fowler, Noll, Vo; draft-eastlake-fnv).
module dotyk_base_content_hash
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: to_text
  implicit none
  private

  integer(int64), parameter :: low_half = 2_int64**32 - 1  !! Lower half of a 64-bit word.

  !> Hash that accumulates bytes. The two halves are separate, as products of 64-bit words would overflow.
  type, public :: content_hash_t
    integer(int64) :: high = int(z'cbf29ce4', int64)  !! Upper 32 bits (z'cbf29ce4', int64).
    integer(int64) :: low = int(z'84222325', int64)  !! Lower 32 bits (z'84222325', int64).
  contains
    procedure :: add => hash_add
    procedure :: add_file => hash_add_file
    procedure :: digits => hash_digits
  end type content_hash_t

contains

  !> Add bytes.
  pure subroutine hash_add(self, bytes)
    class(content_hash_t), intent(inout) :: self
    character(*), intent(in) :: bytes  !! Bytes.
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

  !> Add the content of a file, and its size: the same bytes in other files give other hashes.
  subroutine hash_add_file(self, file, error)
    class(content_hash_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Set if the file cannot be read.
    type(byte_cursor_t) :: cursor
    call cursor%load(file, error)
    if (allocated(error)) return
    call self%add(to_text(cursor%size)//':')
    call self%add(cursor%text(:cursor%size))
  end subroutine hash_add_file

  !> Hash as 16 hexadecimal digits.
  pure function hash_digits(self) result(digits)
    class(content_hash_t), intent(in) :: self
    character(16) :: digits  !! Digits.
    write (digits, '(2z8.8)') self%high, self%low
  end function hash_digits
end module dotyk_base_content_hash
