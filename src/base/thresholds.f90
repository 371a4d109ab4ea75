!> Numbers that several modules mean the same by.
module dotyk_base_thresholds
  use dotyk_base_kinds, only: dp
  implicit none
  private

  real(dp), parameter, public :: pi = acos(-1.0_dp)  !! The number pi.
  !> What rounding leaves of a few operations with numbers that are exact, relative to them [].
  real(dp), parameter, public :: few_roundings = 1.0e-14_dp
  !> What rounding leaves of zero in sums, products and rotations of given numbers, relative to the largest one:
  !> coordinates, areas, moduli, resultants [].
  real(dp), parameter, public :: given_rounding = 1.0e-13_dp
  !> A number below this fraction of the largest one of its kind is what rounding leaves of zero, after solves and sums
  !> in double precision that lose up to four digits [].
  real(dp), parameter, public :: rounding = 1.0e-12_dp
  !> What rounding leaves of a single sum or product of many terms, relative to the largest []. Errors have all signs.
  real(dp), parameter, public :: sum_rounding = 64*epsilon(1.0_dp)
  !> What the rounding of coordinates in mesh files leaves of a shape, relative to its size: offsets from a plane, the
  !> extent of a line across it, cosines of right angles [].
  real(dp), parameter, public :: shape_rounding = 1.0e-10_dp
  !> Numbers that differ by less, relative to the largest of their kind, are the same: files have ten digits or more,
  !> and what follows from them loses a few [].
  real(dp), parameter, public :: same_number = 1.0e-9_dp
  !> An offset below this fraction of the size of a facet or an element is none, and a function of which so little is
  !> orthogonal to others depends on them: the square is rounding [].
  real(dp), parameter, public :: no_offset = 1.0e-8_dp
  !> Places, distances and directions that differ by less, relative to the size of what they are on, are the same: more
  !> than any rounding of files, less than a mesh resolves [].
  real(dp), parameter, public :: same_place = 1.0e-6_dp
  !> What meshes leave of lengths, relative to the size of a facet or a body: gaps of faces that touch,
  !> overlaps of those that do not, extents of what has none; and of the mean of directions that cancel [].
  real(dp), parameter, public :: of_mesh = 1.0e-3_dp
  !> A part of the whole from which on it makes a difference to results [].
  real(dp), parameter, public :: notable = 0.01_dp
  !> Relative residual of a solution that others correct or improve on [].
  real(dp), parameter, public :: rough = 0.01_dp
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
  !> Normals of surfaces that touch, or go on smoothly, differ by less than 25 degrees on any mesh: the cosine of that
  !> [].
  real(dp), parameter, public :: smooth_cosine = cos(25*pi/180)
  !> Faces face each other where the cosine of the angle between their normals is below this: 120 degrees [].
  real(dp), parameter, public :: opposite_cosine = -0.5_dp
  !> A generic direction: not normal to the planes of a regular mesh, whose nodes would all be close along it (3) [].
  real(dp), parameter, public :: generic_direction(3) = [0.5453920137_dp, golden, 0.5663117921_dp]
end module dotyk_base_thresholds
