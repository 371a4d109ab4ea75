!> Bytes of a data array of VTK's XML files: raw or in base64, behind a header, with zlib's blocks or without.
!>
!> Source: VTK User's Guide, "XML file formats", and vtkXMLDataParser. A header is the number of bytes; with compression
!> it is the number of blocks, their size, that of the last one if it is another (else 0), and their compressed sizes.
!> Writers encode header and data apart or together: groups of four letters stand for themselves, padded or not.
module dotyk_mesh_vtu_bytes
  use dotyk_base_kinds, only: int32, int64
  use dotyk_base_number_text, only: ends_word
  use dotyk_base_text, only: to_text
  use dotyk_mesh_zlib, only: decompress
  implicit none
  private
  public :: read_block

  !> Letters of base64, in the order of their values.
  character(*), parameter :: alphabet = 'ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/'

  type :: stream_t  !! Bytes that are read one after another.
    integer(int64) :: position = 1, last = 0  !! Next and last letter of the text.
    logical :: encoded = .false.  !! Whether they are base64; value of each letter, -1 for others (0:255).
    integer :: value(0:255) = -1
    integer :: left(3) = 0, n_left = 0  !! Bytes of the last group that are not taken yet, and their number.
  end type stream_t

contains

  !> Read an array.
  subroutine read_block(text, first, last, encoded, header_size, compressed, bytes, fault)
    character(*), intent(in) :: text  !! Text that has it.
    integer(int64), intent(in) :: first, last  !! Its first letter, and the last that may belong to it.
    logical, intent(in) :: encoded  !! Whether it is base64.
    integer, intent(in) :: header_size  !! Bytes of a number of the header, 4 or 8.
    logical, intent(in) :: compressed  !! Whether zlib's blocks follow.
    character(*), intent(inout) :: bytes  !! The bytes; as many as there must be.
    character(:), allocatable, intent(out) :: fault  !! What is wrong; empty where nothing is.
    type(stream_t) :: stream
    integer(int64) :: n, size, rest, k, a
    integer(int64), allocatable :: length(:)
    character(:), allocatable :: block
    integer :: i
    fault = ''
    stream%position = first
    stream%last = last
    stream%encoded = encoded
    do i = 1, len(alphabet)
      stream%value(iachar(alphabet(i:i))) = i - 1
    end do
    n = number()
    if (.not. compressed) then
      if (n /= len(bytes, int64)) &
        call refuse('it has '//to_text(n)//' bytes, '//to_text(len(bytes, int64))//' are needed')
      if (len(fault) == 0) call take(stream, text, bytes, fault)
      return
    end if
    size = number()
    rest = number()
    if (n < 0 .or. n > last - first .or. size < 0 .or. rest < 0 .or. rest > size) then
      call refuse('its header cannot be right')
    else if (n > len(bytes, int64)/max(1_int64, size) + 1) then
      call refuse('it has '//to_text(n)//' blocks, which cannot be right')
    else if (merge(0_int64, (n - merge(1, 0, rest > 0))*size + rest, n == 0) /= len(bytes, int64)) then
      call refuse('its blocks do not have the '//to_text(len(bytes, int64))//' bytes that are needed')
    end if
    if (len(fault) > 0) return
    allocate (length(n))
    do k = 1, n
      length(k) = number()
    end do
    if (any(length < 0 .or. length > last - first + 1)) call refuse('its header cannot be right')
    a = 0
    do k = 1, n
      if (len(fault) > 0) return
      if (allocated(block)) deallocate (block)
      allocate (character(length(k)) :: block)
      call take(stream, text, block, fault)
      if (len(fault) > 0) return
      rest = min(a + size, len(bytes, int64))
      if (.not. decompress(block, bytes(a + 1:rest))) call refuse('zlib cannot decompress it')
      a = rest
    end do

  contains

    !> A number of the header; -1 after a fault.
    integer(int64) function number()
      character(8) :: word
      number = -1
      call take(stream, text, word(:header_size), fault)
      if (len(fault) > 0) return
      if (header_size == 8) then
        number = transfer(word, 0_int64)
      else
        number = iand(int(transfer(word(:4), 0_int32), int64), int(z'FFFFFFFF', int64))
      end if
    end function number

    !> Keep a fault, if it is the first.
    subroutine refuse(words)
      character(*), intent(in) :: words  !! What is wrong.
      if (len(fault) == 0) fault = words
    end subroutine refuse
  end subroutine read_block

  !> Take the next bytes of a stream.
  subroutine take(stream, text, bytes, fault)
    type(stream_t), intent(inout) :: stream  !! The stream.
    character(*), intent(in) :: text  !! Its text.
    character(*), intent(inout) :: bytes  !! The bytes.
    !> What is wrong; unchanged where nothing is, or where it is not empty.
    character(:), allocatable, intent(inout) :: fault
    integer(int64) :: n, k
    if (len(fault) > 0) return
    n = len(bytes, int64)
    if (.not. stream%encoded) then
      if (n > stream%last - stream%position + 1) then
        fault = 'the file ends inside of it: it is truncated'
        return
      end if
      bytes = text(stream%position:stream%position + n - 1)
      stream%position = stream%position + n
      return
    end if
    do k = 1, n
      if (stream%n_left == 0) then
        call next_group(stream, text, fault)
        if (len(fault) > 0) return
      end if
      bytes(k:k) = achar(stream%left(1))
      stream%left(:2) = stream%left(2:)
      stream%n_left = stream%n_left - 1
    end do
  end subroutine take

  !> Decode the next four letters.
  subroutine next_group(stream, text, fault)
    type(stream_t), intent(inout) :: stream  !! The stream.
    character(*), intent(in) :: text  !! Its text.
    character(:), allocatable, intent(inout) :: fault  !! What is wrong; unchanged where nothing is.
    integer :: group, n, n_padding, value
    group = 0
    n = 0
    n_padding = 0
    do while (n < 4)
      if (stream%position > stream%last) then
        fault = 'it ends too early'
        return
      end if
      associate (letter => text(stream%position:stream%position))
        stream%position = stream%position + 1
        if (ends_word(letter)) cycle
        value = stream%value(iand(iachar(letter), 255))
        if (letter == '=' .and. n > 1) then
          n_padding = n_padding + 1
          value = 0
        end if
        if (value < 0 .or. letter /= '=' .and. n_padding > 0) then
          fault = 'it is not base64'
          return
        end if
      end associate
      group = 64*group + value
      n = n + 1
    end do
    stream%left = [group/65536, mod(group/256, 256), mod(group, 256)]
    stream%n_left = 3 - n_padding
  end subroutine next_group
end module dotyk_mesh_vtu_bytes
