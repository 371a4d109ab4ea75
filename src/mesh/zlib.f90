!> Decompression by zlib, which HDF5 needs too.
module dotyk_mesh_zlib
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_long
  use dotyk_base_kinds, only: int64
  implicit none
  private
  public :: decompress

  interface
    integer(c_int) function c_uncompress(target, target_length, source, source_length) bind(c, name='uncompress')
      import :: c_char, c_int, c_long
      !> Bytes that are made.
      character(kind=c_char), intent(inout) :: target(*)
      !> Room for them; their number on return.
      integer(c_long), intent(inout) :: target_length
      !> Compressed bytes.
      character(kind=c_char), intent(in) :: source(*)
      !> Their number.
      integer(c_long), value :: source_length
    end function c_uncompress
  end interface

contains

  !> Decompress bytes; whether they were right, and fill the target.
  logical function decompress(source, target) result(good)
    !> Compressed bytes.
    character(*), intent(in) :: source
    !> Bytes that are made.
    character(*), intent(inout) :: target
    integer(c_long) :: n
    n = len(target, int64)
    good = c_uncompress(target, n, source, len(source, c_long)) == 0
    good = good .and. n == len(target, int64)
  end function decompress
end module dotyk_mesh_zlib
