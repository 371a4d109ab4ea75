!> Numbers written as text, read fast and rounded correctly.
!>
!> Both scanners start at the first character of a number and stop behind it; the text must have at least one more
!> character there (the buffers of dotyk_base_byte_cursor end with a NUL).
module dotyk_base_number_text
  use dotyk_base_kinds, only: dp, int64
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_null_ptr, c_ptr
  implicit none
  private
  public :: scan_integer, scan_real, ends_word

  !> Powers of ten that doubles hold exactly.
  integer, parameter :: largest_exact_power = 22
  real(dp), parameter :: power_of_ten(0:largest_exact_power) = &
    [1e0_dp, 1e1_dp, 1e2_dp, 1e3_dp, 1e4_dp, 1e5_dp, 1e6_dp, 1e7_dp, 1e8_dp, 1e9_dp, 1e10_dp, 1e11_dp, 1e12_dp, &
     1e13_dp, 1e14_dp, 1e15_dp, 1e16_dp, 1e17_dp, 1e18_dp, 1e19_dp, 1e20_dp, 1e21_dp, 1e22_dp]
  !> Doubles hold all integers up to this exactly.
  integer(int64), parameter :: largest_exact_mantissa = 2_int64**53
  !> Decimal digits that always fit in 64 bits.
  integer, parameter, public :: most_digits = 18
  !> A number of this many digits before the point may be beyond the range of doubles.
  integer, parameter :: largest_magnitude = 308

  interface
    !> The C library's conversion, correctly rounded; Fortran programs run in the locale "C".
    function strtod(text, end) result(value) bind(c, name='strtod')
      import :: c_char, c_double, c_ptr
      !> Text, ended by a null character.
      character(kind=c_char), intent(in) :: text(*)
      !> Where to put the address behind the number; null for nowhere.
      type(c_ptr), value :: end
      real(c_double) :: value
    end function strtod
  end interface

contains

  !> Whether a character ends a word: blank, tabulator, line end or the end of the text.
  pure logical function ends_word(letter)
    !> Letter to look at.
    character, intent(in) :: letter
    ends_word = iachar(letter) <= iachar(' ')
  end function ends_word

  !> Read an integer.
  pure subroutine scan_integer(text, position, value, good)
    !> Text to read.
    character(*), intent(in) :: text
    !> First character of the number, then the one behind it; unchanged where it is not good.
    integer(int64), intent(inout) :: position
    !> The integer; 0 where there is none.
    integer(int64), intent(out) :: value
    !> Whether an integer of at most 18 digits stood there, followed by a blank.
    logical, intent(out) :: good
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
    good = p > first .and. ends_word(text(p:p))
    if (.not. good) return
    if (negative) value = -value
    position = p
  end subroutine scan_integer

  !> Read a real: exact where mantissa and power of ten are doubles, by the C library otherwise.
  subroutine scan_real(text, position, value, good)
    !> Text to read.
    character(*), intent(in) :: text
    !> First character of the number, then the one behind it; unchanged where it is not good.
    integer(int64), intent(inout) :: position
    !> The real; 0 where there is none.
    real(dp), intent(out) :: value
    !> Whether a number below 1e308 stood there, followed by a blank.
    logical, intent(out) :: good
    integer(int64) :: p, mantissa, exponent
    integer :: digit, n_kept, n_dropped, n_decimals, n_read
    logical :: negative, decimals
    value = 0
    good = .false.
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
          ! Digits that do not fit count only for the C library's conversion.
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
      ! Nothing that long is an exponent of ours; it also keeps sums of exponents far from overflow.
      call scan_integer(text, p, exponent, good)
      if (.not. good) return
      exponent = max(-1000000000_int64, min(exponent, 1000000000_int64))
    end if
    good = ends_word(text(p:p))
    if (.not. good) return
    exponent = exponent - n_decimals + n_dropped
    if (mantissa == 0) then
      value = 0
    else if (mantissa <= largest_exact_mantissa .and. n_kept <= most_digits .and. n_dropped == 0 .and. &
             abs(exponent) <= largest_exact_power) then
      value = real(mantissa, dp)
      if (exponent < 0) then
        value = value/power_of_ten(-exponent)
      else
        value = value*power_of_ten(exponent)
      end if
      if (negative) value = -value
    else if (min(n_kept, most_digits) + exponent > largest_magnitude) then
      good = .false.
      return
    else
      value = strtod(text(position:), c_null_ptr)
    end if
    position = p
  end subroutine scan_real
end module dotyk_base_number_text
