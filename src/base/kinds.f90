!> Number kinds of the program.
module dotyk_base_kinds
  use, intrinsic :: iso_fortran_env, only: int32, int64, real32, real64
  implicit none
  private

  integer, parameter, public :: dp = real64  !! Double precision: every real number of dotyk but those of smoothers.
  integer, parameter, public :: sp = real32  !! Single precision: smoothers have the speed of the memory.
  !> 30 digits or more: displacements of ill-conditioned bodies, which are mostly rigid, where they are taken apart.
  integer, parameter, public :: qp = selected_real_kind(30)
  public :: int32, int64
end module dotyk_base_kinds
