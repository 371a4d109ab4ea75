!> Converts values as written to numbers and logicals, strictly: nothing is guessed, nothing is left over.
module dotyk_input_conversion
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: lower
  implicit none
  private
  public :: read_real, read_integer, read_logical

  !> Status of a conversion.
  integer, parameter, public :: number_good = 0, number_malformed = 1, number_out_of_range = 2

  character(*), parameter :: digits = '0123456789'

contains

  !> A real number: digits with at most one point, maybe an exponent after e or d.
  pure subroutine read_real(text, value, status)
    character(*), intent(in) :: text  !! Text of the value, without blanks.
    real(dp), intent(out) :: value  !! The number; 0 where there is none [any].
    integer, intent(out) :: status  !! One of `number_*`.
    character(:), allocatable :: mantissa, exponent
    integer :: mark, power, magnitude, first, point
    value = 0
    status = number_malformed
    mantissa = lower(text)
    exponent = '0'
    mark = scan(mantissa, 'ed')
    if (mark > 0) then
      exponent = mantissa(mark + 1:)
      mantissa = mantissa(:mark - 1)
    end if
    call drop_sign(mantissa)
    if (len(mantissa) == 0 .or. verify(mantissa, digits//'.') > 0) return
    point = index(mantissa, '.')
    if (point /= index(mantissa, '.', back=.true.) .or. mantissa == '.') return
    call read_integer(exponent, power, status)
    if (status == number_malformed) return
    ! The power of ten of the leading digit shows overflow and underflow before the conversion.
    first = scan(mantissa, digits(2:))
    if (first == 0) then
      status = number_good
      return
    end if
    if (status /= number_good) return
    if (point == 0) point = len(mantissa) + 1
    magnitude = power + point - first
    if (first < point) magnitude = magnitude - 1
    status = number_out_of_range
    if (magnitude > range(value) .or. magnitude < -range(value)) return
    read (text, *) value
    status = number_good
  end subroutine read_real

  !> An integer: digits, maybe with a sign.
  pure subroutine read_integer(text, value, status)
    character(*), intent(in) :: text  !! Text of the value, without blanks.
    integer, intent(out) :: value  !! The number; 0 where there is none.
    integer, intent(out) :: status  !! One of `number_*`.
    character(:), allocatable :: number
    value = 0
    status = number_malformed
    number = text
    call drop_sign(number)
    if (len(number) == 0 .or. verify(number, digits) > 0) return
    do while (len(number) > 1 .and. number(1:1) == '0')
      number = number(2:)
    end do
    status = number_out_of_range
    if (len(number) > range(value)) return
    read (number, *) value
    if (text(1:1) == '-') value = -value
    status = number_good
  end subroutine read_integer

  !> A logical: .true., t, true and their opposites, in any case.
  pure subroutine read_logical(text, value, status)
    character(*), intent(in) :: text  !! Text of the value, without blanks.
    logical, intent(out) :: value  !! The logical; false where there is none.
    integer, intent(out) :: status  !! `number_good` or `number_malformed`.
    value = .false.
    status = number_good
    select case (lower(text))
    case ('.true.', 'true', 't', '.t.')
      value = .true.
    case ('.false.', 'false', 'f', '.f.')
      value = .false.
    case default
      status = number_malformed
    end select
  end subroutine read_logical

  !> Remove the sign in front of a number.
  pure subroutine drop_sign(number)
    character(:), allocatable, intent(inout) :: number  !! Digits of a number, maybe with a sign; without it on return.
    if (len(number) == 0) return
    if (scan(number(1:1), '+-') > 0) number = number(2:)
  end subroutine drop_sign
end module dotyk_input_conversion
