!> Conversion of text to numbers, fast and correctly rounded.
!>
!> Both procedures start at the first character of a number and stop behind it; the text must have at least one more
!> character after that (the buffers of `dotyk_base_byte_cursor` end with a NUL).
module dotyk_base_number_text
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_null_ptr, c_ptr
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private
  public :: scan_integer, scan_real, ends_word

  integer, parameter :: max_exact_power = 22  !! Powers of ten up to this one are exact doubles.
  !> The exact powers of ten [].
  real(dp), parameter :: power_of_ten(0:max_exact_power) = &
    [1.0e0_dp, 1.0e1_dp, 1.0e2_dp, 1.0e3_dp, 1.0e4_dp, 1.0e5_dp, 1.0e6_dp, 1.0e7_dp, 1.0e8_dp, 1.0e9_dp, 1.0e10_dp, &
     1.0e11_dp, 1.0e12_dp, 1.0e13_dp, 1.0e14_dp, 1.0e15_dp, 1.0e16_dp, 1.0e17_dp, 1.0e18_dp, 1.0e19_dp, 1.0e20_dp, &
     1.0e21_dp, 1.0e22_dp]
  integer(int64), parameter :: max_exact_mantissa = 2_int64**53  !! All integers up to this one are exact doubles.
  integer, parameter, public :: most_digits = 18  !! Decimal digits that fit in 64 bits.
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
end module dotyk_base_number_text
