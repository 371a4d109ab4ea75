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
      character(kind=c_char), intent(inout) :: target(*)  !! Bytes that are made.
      integer(c_long), intent(inout) :: target_length  !! Room for them; their number on return.
      character(kind=c_char), intent(in) :: source(*)  !! Compressed bytes.
      integer(c_long), value :: source_length  !! Their number.
    end function c_uncompress
  end interface

contains

  !> Decompress bytes; whether they were right, and fill the target.
  logical function decompress(source, target) result(good)
    character(*), intent(in) :: source  !! Compressed bytes.
    character(*), intent(inout) :: target  !! Bytes that are made.
    integer(c_long) :: n
    n = len(target, int64)
    good = c_uncompress(target, n, source, len(source, c_long)) == 0
    good = good .and. n == len(target, int64)
  end function decompress
end module dotyk_mesh_zlib
