!> How large and how small the numbers of a scene may be.
!>
!> What is computed from them, energies and their squares, must fit in real numbers, whose range ends at 1e308: a scene of micrometres
!> and gigapascals is far from these limits, and one beyond them wants other units.
module dotyk_base_magnitude
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> Lengths, pressures and what is made of them: 0, or of a size between these.
  real(dp), parameter, public :: smallest_number = 1.0e-40_dp, largest_number = 1.0e40_dp
  !> The same for messages.
  character(*), parameter, public :: size_rule = 'numbers must be 0 or from 1e-40 to 1e40 in size: choose other units'

  public :: has_usual_size, is_too_large

contains

  !> Is a finite number 0 or between the limits?
  elemental logical function has_usual_size(number) result(usual)
    real(dp), intent(in) :: number
    usual = (abs(number) >= smallest_number .and. abs(number) <= largest_number) .or. abs(number) <= 0
  end function has_usual_size

  !> Is a number above the limit, infinite or NaN? Without a trap for any of them.
  elemental logical function is_too_large(number) result(too_large)
    real(dp), intent(in) :: number
    too_large = .not. ieee_is_finite(number)
    if (.not. too_large) too_large = abs(number) > largest_number
  end function is_too_large
end module dotyk_base_magnitude
