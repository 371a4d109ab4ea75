!> Limits of the magnitude of input numbers.
!>
!> Energies and their squares must fit in double precision, whose range ends at 1e308. Micrometres and gigapascals are
!> far from the limits; a scene beyond them needs other units.
module dotyk_base_magnitude
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> Input numbers are 0 or of a magnitude between these [any].
  real(dp), parameter, public :: smallest_number = 1.0e-40_dp, largest_number = 1.0e40_dp
  !> The rule, for messages.
  character(*), parameter, public :: size_rule = 'numbers must be 0 or from 1e-40 to 1e40 in size: choose other units'

  public :: has_usual_size, is_too_large

contains

  !> Whether a finite number is 0 or within the limits.
  elemental logical function has_usual_size(number) result(usual)
    real(dp), intent(in) :: number  !! Finite number [any].
    usual = (abs(number) >= smallest_number .and. abs(number) <= largest_number) .or. abs(number) <= 0
  end function has_usual_size

  !> Whether a number is above the limit, infinite or NaN, without a floating-point trap.
  elemental logical function is_too_large(number) result(too_large)
    real(dp), intent(in) :: number  !! Any number [any].
    too_large = .not. ieee_is_finite(number)
    if (.not. too_large) too_large = abs(number) > largest_number
  end function is_too_large
end module dotyk_base_magnitude
