!> Numbers that several modules mean the same by.
module dotyk_base_thresholds
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> A number below this fraction of the largest one of its kind is what rounding leaves of zero, after solves and sums
  !> in double precision that lose up to four digits [].
  real(dp), parameter, public :: rounding = 1.0e-12_dp
  !> What rounding leaves of a single sum or product of many terms, relative to the largest []. Errors have all signs.
  real(dp), parameter, public :: sum_rounding = 64*epsilon(1.0_dp)
  !> What rounding leaves of roots of differences of squares, of angles from their cosines, of balances that solves
  !> leave: half of the digits [].
  real(dp), parameter, public :: half_digits = sqrt(epsilon(1.0_dp))
  !> A number that is uncertain by more than this fraction has no significant digit [].
  real(dp), parameter, public :: one_digit = 0.1_dp
  !> Stands for infinity: the square of a sum of a few of them does not overflow.
  real(dp), parameter, public :: largest_square = sqrt(huge(1.0_dp))/16
  !> An iteration near rounding goes on while what it leaves falls to this fraction in a step, or in a few [].
  real(dp), parameter, public :: least_gain = 0.5_dp
  !> Fractions of its multiples have no order: they serve as numbers that look random and are the same in each run [].
  real(dp), parameter, public :: golden = 0.6180339887498949_dp
  !> Normals of one smooth surface differ by less than 40 degrees where nothing else is known: the cosine of that [].
  real(dp), parameter, public :: sharp_cosine = 0.766_dp
  !> A generic direction: not normal to the planes of a regular mesh, whose nodes would all be close along it (3) [].
  real(dp), parameter, public :: generic_direction(3) = [0.5453920137_dp, golden, 0.5663117921_dp]
end module dotyk_base_thresholds
