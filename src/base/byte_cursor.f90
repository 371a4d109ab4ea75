!> A file and a cursor over its bytes: numbers as text or in binary, words and lines.
!>
!> The file is in memory, or a window of it is, which follows the cursor: the memory does not grow with the file then.
!>
!> The first fault is kept with its position and marks the cursor as `broken`; afterwards all reads return zeros, so
!> that callers test `broken` once a record instead of after each number. No read goes beyond the end of the file.
!>
!> Conversion of text to numbers, fast and correctly rounded.
!>
!> Both procedures start at the first character of a number and stop behind it; the text must have at least one more
!> character after that (the buffers end with a NUL).
module dotyk_base_byte_cursor
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_null_ptr, c_ptr
  use dotyk_base_byte_window, only: byte_window_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int32, int64
  use dotyk_base_text, only: to_text
  implicit none
  private
  public :: scan_integer, scan_real

  integer(int64), parameter :: number_part = 64  !! Part of a window in memory when a number is read from text.
  integer, parameter :: longest_shown = 40  !! Greatest number of letters of the file in a message.

  type, extends(byte_window_t), public :: byte_cursor_t  !! File, or a window of it, and the position of the next read.
    integer(int64) :: position = 1  !! Next byte to be read; size + 1 at the end.
    !> Whether `get_int`, `get_size` and `get_real` read binary numbers; positions in messages are then byte offsets
    !> instead of lines.
    logical :: binary = .false.
    character(:), allocatable :: section  !! Section that is being read, as '$Nodes'; empty between sections.
  contains
    procedure :: load => cursor_load
    procedure :: open => cursor_open
    procedure :: use_text => cursor_use_text
    procedure :: get_int => cursor_get_int
    procedure :: get_size => cursor_get_size
    procedure :: get_real => cursor_get_real
    procedure :: get_text_integer => cursor_get_text_integer
    procedure :: get_word => cursor_get_word
    procedure :: get_line => cursor_get_line
    procedure :: end_line => cursor_end_line
    procedure :: skip_blanks => cursor_skip_blanks
    procedure :: skip_past => cursor_skip_past
    procedure :: skip_bytes => cursor_skip_bytes
    procedure :: at_end => cursor_at_end
    procedure :: require => cursor_require
    procedure :: fail => cursor_fail
    procedure :: place => cursor_place
  end type byte_cursor_t

  integer, parameter :: max_exact_power = 22  !! Powers of ten up to this one are exact doubles.
  !> The exact powers of ten [].
  real(dp), parameter :: power_of_ten(0:max_exact_power) = &
    [1.0e0_dp, 1.0e1_dp, 1.0e2_dp, 1.0e3_dp, 1.0e4_dp, 1.0e5_dp, 1.0e6_dp, 1.0e7_dp, 1.0e8_dp, 1.0e9_dp, 1.0e10_dp, &
     1.0e11_dp, 1.0e12_dp, 1.0e13_dp, 1.0e14_dp, 1.0e15_dp, 1.0e16_dp, 1.0e17_dp, 1.0e18_dp, 1.0e19_dp, 1.0e20_dp, &
     1.0e21_dp, 1.0e22_dp]
  integer(int64), parameter :: max_exact_mantissa = 2_int64**53  !! All integers up to this one are exact doubles.
  integer, parameter :: most_digits = 18  !! Decimal digits that fit in 64 bits.
  integer, parameter :: max_magnitude = 308  !! More digits before the point may exceed the range of doubles.

  interface
    !> Conversion by the C library, correctly rounded; Fortran programs run in the locale "C".
    function strtod(text, end) result(value) bind(c, name='strtod')
      import :: c_char, c_double, c_ptr
      character(kind=c_char), intent(in) :: text(*)  !! Text, which ends behind the number (:).
      type(c_ptr), value :: end  !! Address for the end of the number; null.
      real(c_double) :: value  !! Value [any].
    end function strtod
  end interface

contains

  !> Read a whole file.
  subroutine cursor_load(self, file, error)
    class(byte_cursor_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Where it is missing, no regular file, or cannot be read.
    call self%read_all(file, error)
    call start(self)
  end subroutine cursor_load

  !> Open a file, of which only a window is in memory.
  subroutine cursor_open(self, file, error)
    class(byte_cursor_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Path of the file.
    type(error_t), allocatable, intent(out) :: error  !! Where it is missing, no regular file, or cannot be read.
    call self%open_window(file, error)
    call start(self)
  end subroutine cursor_open

  !> Use bytes in memory as the content of a file.
  subroutine cursor_use_text(self, file, bytes)
    class(byte_cursor_t), intent(inout) :: self
    character(*), intent(in) :: file  !! Name, for messages.
    character(*), intent(in) :: bytes  !! Content.
    character(:), allocatable :: text
    text = bytes//achar(0)
    call self%take_text(file, text)
    call start(self)
  end subroutine cursor_use_text

  !> Start at the first byte.
  subroutine start(self)
    type(byte_cursor_t), intent(inout) :: self  !! The cursor; at the first byte on return.
    self%section = ''
    self%position = 1
    self%binary = .false.
  end subroutine start

  !> Whether the next bytes are in memory: moves the window; a fault where the file ends before.
  logical function has_bytes(self, n) result(has)
    class(byte_cursor_t), intent(inout) :: self
    integer, intent(in) :: n  !! Number of bytes.
    if (self%size - self%position + 1 < n) call report_end(self)
    if (.not. self%broken .and. (self%position <= self%before .or. self%position + n - 1 > self%before + self%n_held)) &
      call self%hold(self%position, int(n, int64))
    has = .not. self%broken
  end function has_bytes

  !> Read an integer: text or 4 bytes.
  subroutine cursor_get_int(self, value)
    class(byte_cursor_t), intent(inout) :: self
    integer(int64), intent(out) :: value  !! Integer; 0 after a fault.
    if (.not. self%binary) then
      call cursor_get_text_integer(self, value)
      return
    end if
    value = 0
    if (.not. has_bytes(self, 4)) return
    value = int(transfer(self%text(self%position - self%before:self%position - self%before + 3), 0_int32), int64)
    self%position = self%position + 4
  end subroutine cursor_get_int

  !> Read an integer: text or 8 bytes (size_t of C; a negative value is corrupt).
  subroutine cursor_get_size(self, value)
    class(byte_cursor_t), intent(inout) :: self
    integer(int64), intent(out) :: value  !! Integer; 0 after a fault.
    if (.not. self%binary) then
      call cursor_get_text_integer(self, value)
      return
    end if
    value = 0
    if (.not. has_bytes(self, 8)) return
    value = transfer(self%text(self%position - self%before:self%position - self%before + 7), 0_int64)
    self%position = self%position + 8
  end subroutine cursor_get_size

  !> Read a real: text or 8 bytes; a value that is not finite is a fault.
  subroutine cursor_get_real(self, value)
    class(byte_cursor_t), intent(inout) :: self
    real(dp), intent(out) :: value  !! Real; 0 after a fault [any].
    !> Exponent bits: all set in infinities and NaN. Compared as bits, as a signalling NaN traps in other comparisons.
    integer(int64), parameter :: exponent_bits = int(z'7FF0000000000000', int64)
    integer(int64) :: bits, place
    logical :: good
    value = 0
    if (self%broken) return
    if (self%binary) then
      if (.not. has_bytes(self, 8)) return
      bits = transfer(self%text(self%position - self%before:self%position - self%before + 7), 0_int64)
      if (iand(bits, exponent_bits) == exponent_bits) then
        call self%fail('a number is not finite')
        return
      end if
      value = transfer(bits, 0.0_dp)
      self%position = self%position + 8
    else
      call cursor_skip_blanks(self)
      call self%hold(self%position, self%window/number_part)
      if (self%broken) return
      place = self%position - self%before
      call scan_real(self%text, place, value, good)
      self%position = place + self%before
      if (.not. good) call report_unexpected(self, 'a finite number')
    end if
  end subroutine cursor_get_real

  !> Read an integer that is text in binary files too.
  subroutine cursor_get_text_integer(self, value)
    class(byte_cursor_t), intent(inout) :: self
    integer(int64), intent(out) :: value  !! Integer; 0 after a fault.
    integer(int64) :: place
    logical :: good
    value = 0
    if (self%broken) return
    call cursor_skip_blanks(self)
    call self%hold(self%position, self%window/number_part)
    if (self%broken) return
    place = self%position - self%before
    call scan_integer(self%text, place, value, good)
    self%position = place + self%before
    if (good) return
    value = 0
    if (is_oversized_integer(self)) then
      call report_unexpected(self, 'an integer of at most '//to_text(most_digits)//' digits')
    else
      call report_unexpected(self, 'an integer')
    end if
  end subroutine cursor_get_text_integer

  !> Whether the next word is an integer with too many digits.
  pure logical function is_oversized_integer(self) result(oversized)
    class(byte_cursor_t), intent(in) :: self
    integer(int64) :: first, last
    first = self%position - self%before
    if (scan('+-', self%text(first:first)) > 0) first = first + 1
    last = first
    do while (scan('0123456789', self%text(last:last)) > 0)
      last = last + 1
    end do
    oversized = last - first > most_digits .and. ends_word(self%text(last:last))
  end function is_oversized_integer

  !> Read a word; empty at the end of the file.
  subroutine cursor_get_word(self, word)
    class(byte_cursor_t), intent(inout) :: self
    character(:), allocatable, intent(out) :: word  !! Word.
    integer(int64) :: n
    call cursor_skip_blanks(self)
    n = 0
    do while (self%position + n <= self%size)
      if (ends_word(self%byte(self%position, n))) exit
      n = n + 1
    end do
    word = self%text(self%position - self%before:self%position - self%before + n - 1)
    self%position = self%position + n
  end subroutine cursor_get_word

  !> Read the rest of the line, without its end.
  subroutine cursor_get_line(self, line)
    class(byte_cursor_t), intent(inout) :: self
    character(:), allocatable, intent(out) :: line  !! Rest of the line.
    integer(int64) :: n
    n = 0
    do while (self%position + n <= self%size)
      if (self%byte(self%position, n) == achar(10)) exit
      n = n + 1
    end do
    line = self%text(self%position - self%before:self%position - self%before + n - 1)
    self%position = min(self%position + n + 1, self%size + 1)
    if (n > 0) then
      if (line(n:n) == achar(13)) line = line(:n - 1)
    end if
  end subroutine cursor_get_line

  !> Skip the end of a line that has only blanks left: binary numbers begin there.
  subroutine cursor_end_line(self)
    class(byte_cursor_t), intent(inout) :: self
    character :: letter
    if (self%broken) return
    do
      if (self%position > self%size) then
        call report_end(self)
        return
      end if
      letter = self%byte(self%position, 0_int64)
      if (self%broken) return
      if (letter == achar(10)) exit
      if (.not. ends_word(letter)) then
        call report_unexpected(self, 'the end of the line')
        return
      end if
      self%position = self%position + 1
    end do
    self%position = self%position + 1
  end subroutine cursor_end_line

  !> Skip blanks and line ends.
  subroutine cursor_skip_blanks(self)
    class(byte_cursor_t), intent(inout) :: self
    integer(int64) :: p
    if (self%position <= self%before) call self%hold(self%position, 1_int64)
    do
      do p = self%position - self%before, self%n_held
        if (.not. ends_word(self%text(p:p))) exit
      end do
      self%position = p + self%before
      if (p <= self%n_held .or. self%position > self%size .or. self%broken) return
      call self%hold(self%position, 1_int64)
    end do
  end subroutine cursor_skip_blanks

  !> Skip what is before a word, and the word.
  subroutine cursor_skip_past(self, word, found)
    class(byte_cursor_t), intent(inout) :: self
    character(*), intent(in) :: word  !! The word.
    logical, intent(out) :: found  !! Whether the rest of the file has it; the position is unchanged otherwise.
    integer(int64) :: distance, p
    p = self%position
    do while (p <= self%size - len(word) + 1)
      call self%hold(p, int(len(word), int64))
      if (self%broken) exit
      distance = index(self%text(p - self%before:self%n_held), word, kind=int64)
      found = distance > 0
      if (found) self%position = p + distance - 1 + len(word)
      if (found) return
      ! The word may begin at the end of the window.
      p = self%before + self%n_held - len(word) + 2
    end do
    found = .false.
  end subroutine cursor_skip_past

  !> Skip bytes.
  subroutine cursor_skip_bytes(self, n)
    class(byte_cursor_t), intent(inout) :: self
    integer(int64), intent(in) :: n  !! Number of bytes.
    if (n > self%size - self%position + 1) call report_end(self)
    if (.not. self%broken) self%position = self%position + n
  end subroutine cursor_skip_bytes

  !> Whether only blanks are left.
  logical function cursor_at_end(self) result(at_end)
    class(byte_cursor_t), intent(inout) :: self
    call cursor_skip_blanks(self)
    at_end = self%position > self%size
  end function cursor_at_end

  !> Check a count: not negative, and the counted items fit in the rest of the file.
  subroutine cursor_require(self, count, least_bytes, what, position)
    class(byte_cursor_t), intent(inout) :: self
    integer(int64), intent(in) :: count  !! Count as read.
    integer, intent(in) :: least_bytes  !! Fewest bytes of one item.
    character(*), intent(in) :: what  !! Name of the items, for messages.
    integer(int64), intent(in) :: position  !! Position of the count.
    integer(int64) :: left
    if (self%broken) return
    left = self%size - self%position + 1
    ! The last text number needs no blank behind it.
    if (count >= 0 .and. count <= (left + 1)/least_bytes .and. count < huge(0)) return
    call self%fail('the number of '//what//', '//to_text(count)//', cannot be right: '//to_text(left)// &
                   ' bytes of the file are left; it is truncated or corrupt', position)
  end subroutine cursor_require

  !> Keep a fault with its position, if it is the first.
  subroutine cursor_fail(self, message, position)
    class(byte_cursor_t), intent(inout) :: self
    character(*), intent(in) :: message  !! Description of the fault.
    integer(int64), intent(in), optional :: position  !! Position of the fault; that of the next byte if absent.
    integer(int64) :: where
    if (self%broken) return
    where = self%position
    if (present(position)) where = position
    self%broken = .true.
    self%fault = self%place(where)//': '
    if (len(self%section) > 0) self%fault = self%fault//self%section//': '
    self%fault = self%fault//message
  end subroutine cursor_fail

  !> Position for messages: 'file:line' of a text, 'file: byte offset' of a binary file, where the first byte has offset
  !> 0.
  function cursor_place(self, position) result(place)
    class(byte_cursor_t), intent(inout) :: self
    integer(int64), intent(in) :: position  !! Byte number.
    character(:), allocatable :: place  !! Text.
    if (self%binary) then
      place = self%file//': byte '//to_text(position - 1)
    else
      place = self%file//':'//to_text(self%line_of(position))
    end if
  end function cursor_place

  !> Fault: the file ends too early.
  subroutine report_end(self)
    class(byte_cursor_t), intent(inout) :: self
    call self%fail('the file ends here, too early: it is truncated')
  end subroutine report_end

  !> Fault: another word than expected.
  subroutine report_unexpected(self, expected)
    class(byte_cursor_t), intent(inout) :: self
    character(*), intent(in) :: expected  !! Description of the expected word.
    character(:), allocatable :: word
    integer(int64) :: first
    integer :: i
    if (self%at_end()) then
      call report_end(self)
      return
    end if
    first = self%position
    call self%get_word(word)
    if (len(word) > longest_shown) word = word(:longest_shown)//'...'
    do i = 1, len(word)
      if (iachar(word(i:i)) > 126) word(i:i) = '?'
    end do
    call self%fail('expected '//expected//", found '"//word//"'", first)
  end subroutine report_unexpected

  !> Whether a character ends a word: blank, tabulator, line end or the end of the text.
  pure logical function ends_word(letter)
    character, intent(in) :: letter  !! Character.
    ends_word = iachar(letter) <= iachar(' ')
  end function ends_word

  !> Read an integer.
  pure subroutine scan_integer(text, position, value, valid)
    character(*), intent(in) :: text  !! Text.
    !> Position of the first character of the number; behind the number on return, unchanged if it is not valid.
    integer(int64), intent(inout) :: position
    integer(int64), intent(out) :: value  !! Integer.
    logical, intent(out) :: valid  !! Whether an integer of at most 18 digits was found, followed by a blank.
    integer(int64) :: first, p
    integer :: digit
    logical :: negative
    p = position
    negative = text(p:p) == '-'
    if (negative .or. text(p:p) == '+') p = p + 1
    first = p
    value = 0
    do
      digit = iachar(text(p:p)) - iachar('0')
      if (digit < 0 .or. digit > 9) exit
      if (p - first >= most_digits) exit
      value = 10*value + digit
      p = p + 1
    end do
    valid = p > first .and. ends_word(text(p:p))
    if (.not. valid) return
    if (negative) value = -value
    position = p
  end subroutine scan_integer

  !> Read a real: exact if mantissa and power of ten are exact doubles, by the C library otherwise.
  subroutine scan_real(text, position, value, valid)
    character(*), intent(in) :: text  !! Text.
    !> Position of the first character of the number; behind the number on return, unchanged if it is not valid.
    integer(int64), intent(inout) :: position
    real(dp), intent(out) :: value  !! Real [any].
    logical, intent(out) :: valid  !! Whether a number below 1e308 was found, followed by a blank.
    integer(int64) :: p, mantissa, exponent
    integer :: digit, n_kept, n_dropped, n_decimals, n_read
    logical :: negative, decimals
    value = 0
    valid = .false.
    p = position
    negative = text(p:p) == '-'
    if (negative .or. text(p:p) == '+') p = p + 1
    mantissa = 0
    n_kept = 0
    n_dropped = 0
    n_decimals = 0
    n_read = 0
    decimals = .false.
    do
      digit = iachar(text(p:p)) - iachar('0')
      if (digit >= 0 .and. digit <= 9) then
        n_read = n_read + 1
        if (n_kept < most_digits) then
          mantissa = 10*mantissa + digit
          if (mantissa > 0) n_kept = n_kept + 1
          if (decimals) n_decimals = n_decimals + 1
        else if (.not. decimals) then
          n_dropped = n_dropped + 1
        else
          ! Digits that do not fit matter only for the conversion by the C library.
          n_kept = n_kept + 1
        end if
      else if (text(p:p) == '.' .and. .not. decimals) then
        decimals = .true.
      else
        exit
      end if
      p = p + 1
    end do
    if (n_read == 0) return
    exponent = 0
    if (scan(text(p:p), 'eE') == 1) then
      p = p + 1
      ! Longer exponents are out of range; the limit keeps sums of exponents far from overflow.
      call scan_integer(text, p, exponent, valid)
      if (.not. valid) return
      exponent = max(-1000000000_int64, min(exponent, 1000000000_int64))
    end if
    valid = ends_word(text(p:p))
    if (.not. valid) return
    exponent = exponent - n_decimals + n_dropped
    if (mantissa == 0) then
      value = 0
    else if (mantissa <= max_exact_mantissa .and. n_kept <= most_digits .and. n_dropped == 0 .and. &
             abs(exponent) <= max_exact_power) then
      value = real(mantissa, dp)
      if (exponent < 0) then
        value = value/power_of_ten(-exponent)
      else
        value = value*power_of_ten(exponent)
      end if
      if (negative) value = -value
    else if (min(n_kept, most_digits) + exponent > max_magnitude) then
      valid = .false.
      return
    else
      value = strtod(text(position:), c_null_ptr)
    end if
    position = p
  end subroutine scan_real
end module dotyk_base_byte_cursor
