!> Tags of VTK's XML files (.vtu): the points and cells of the piece, and where its data arrays are.
!>
!> Source: VTK User's Guide, "XML file formats".
module dotyk_mesh_vtu_tags
  use dotyk_base_byte_window, only: byte_window_t
  use dotyk_base_error, only: error_t
  use dotyk_base_files, only: nature_of
  use dotyk_base_kinds, only: int64
  use dotyk_base_number_text, only: ends_word, scan_integer
  use dotyk_base_text, only: quoted, shown, text_t, to_text
  implicit none
  private

  integer, parameter :: most_nested = 16  !! Nested tags beyond which a file is none of the format.
  integer, parameter, public :: most_compressed = 1032  !! The greatest ratio of deflate's compression.

  type, public :: vtu_array_t  !! A data array.
    !> Tag around it, as 'CellData'; name, type as 'Int32', and format.
    character(:), allocatable :: parent, name, type, format
    integer :: n_components = 1  !! Values of one point or cell.
    !> Place in the appended data, and of the letters inline; of its tag.
    integer(int64) :: offset = -1, first = 1, last = 0, position = 1
  end type vtu_array_t

  type, public :: vtu_tags_t  !! A file by its tags.
    type(byte_window_t) :: bytes  !! Its bytes.
    integer :: n_points = 0, n_cells = 0  !! Points and cells of the piece.
    type(vtu_array_t), allocatable :: array(:)  !! Arrays of the piece (room), and their number.
    integer :: n_arrays = 0
    !> Message of the first mistake, with file and line; not allocated where there is none.
    character(:), allocatable :: fault
    integer :: header_size = 4  !! Bytes of a number of headers; whether arrays are compressed.
    logical :: compressed = .false.
    !> First letter of the appended data, 0 where there are none; whether they are base64.
    integer(int64) :: appended = 0
    logical :: encoded = .false.
    !> Whether the tags belong to a piece with cells; whether there was one.
    logical, private :: in_piece = .false., has_piece = .false.
    type(text_t), private :: open(most_nested)  !! Tags that are open (most_nested), and their number.
    integer, private :: n_open = 0
  contains
    procedure :: read_tags => tags_read
    procedure :: fail => tags_fail
    procedure :: find => tags_find
  end type vtu_tags_t

contains

  !> Read the tags of a file.
  subroutine tags_read(self, path, error)
    class(vtu_tags_t), intent(inout) :: self
    character(*), intent(in) :: path  !! Path of the file.
    !> Set for a file that cannot be read; mistakes in it are kept in `fault`.
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: p, begin, end
    call self%bytes%read_all(path, error)
    if (allocated(error)) return
    allocate (self%array(16))
    p = 1
    do while (.not. allocated(self%fault))
      begin = next(p, '<')
      call take_content(self, p, begin)
      if (begin == 0) exit
      if (starts(begin, '<!--')) then
        end = next(begin, '-->') + 2
      else
        call find_end(self%bytes%text, begin, end)
      end if
      if (end <= begin) then
        call self%fail('the tag has no end: the file is truncated', begin)
      else if (.not. (starts(begin, '<?') .or. starts(begin, '<!'))) then
        call take_tag(self, self%bytes%text(begin + 1:end - 1), begin, end)
      end if
      p = end + 1
      if (self%appended > 0) exit
    end do
    if (allocated(self%fault)) return
    if (self%n_open > 0 .and. self%appended == 0) then
      call self%fail('the file ends without </'//self%open(self%n_open)%s//'>: it is truncated', self%bytes%size)
    else if (.not. self%has_piece) then
      call self%fail('the file has no cells', 1_int64)
    end if

  contains

    !> Place of a text from a position on; 0 where there is none.
    integer(int64) function next(from, text)
      integer(int64), intent(in) :: from  !! The position.
      character(*), intent(in) :: text  !! The text.
      next = index(self%bytes%text(from:self%bytes%size), text, kind=int64)
      if (next > 0) next = next + from - 1
    end function next

    !> Whether a text is at a position.
    logical function starts(at, text)
      integer(int64), intent(in) :: at  !! The position.
      character(*), intent(in) :: text  !! The text.
      starts = self%bytes%text(at:min(at + len(text) - 1, self%bytes%size)) == text
    end function starts
  end subroutine tags_read

  !> End of a tag: the first > outside of quotes; 0 where there is none.
  pure subroutine find_end(text, begin, end)
    character(*), intent(in) :: text  !! Text.
    integer(int64), intent(in) :: begin  !! Its <.
    integer(int64), intent(out) :: end  !! Its >.
    character :: quote
    quote = ' '
    do end = begin, len(text, int64)
      if (quote /= ' ') then
        if (text(end:end) == quote) quote = ' '
      else if (text(end:end) == '>') then
        return
      else if (text(end:end) == '"' .or. text(end:end) == "'") then
        quote = text(end:end)
      end if
    end do
    end = 0
  end subroutine find_end

  !> Keep letters between two tags where they are data of an array.
  subroutine take_content(self, first, next)
    type(vtu_tags_t), intent(inout) :: self  !! The file.
    integer(int64), intent(in) :: first, next  !! The first of them, and the next tag; 0 where there is none.
    integer(int64) :: p, last
    last = next - 1
    if (next == 0) last = self%bytes%size
    do p = first, last
      if (.not. ends_word(self%bytes%text(p:p))) exit
    end do
    if (p > last) return
    if (self%n_open == 0) then
      call refuse_content(self)
    else if (self%open(self%n_open)%s == 'DataArray' .and. self%in_piece) then
      associate (array => self%array(self%n_arrays))
        if (array%last < array%first) then
          array%first = p
          array%last = last
        end if
      end associate
    end if
  end subroutine take_content

  !> Refuse a file that is not of the format.
  subroutine refuse_content(self)
    type(vtu_tags_t), intent(inout) :: self  !! The file.
    character(:), allocatable :: beginning, nature
    call self%bytes%first_bytes(1024, beginning)
    nature = nature_of(beginning)
    if (index(beginning, '# vtk DataFile') == 1) nature = 'a legacy file of VTK: save it as .vtu'
    if (len(nature) > 0) nature = ': it is '//nature
    call self%fail('this is no XML file of VTK'//nature, 1_int64)
  end subroutine refuse_content

  !> Take a tag.
  subroutine take_tag(self, tag, begin, end)
    type(vtu_tags_t), intent(inout) :: self  !! The file.
    character(*), intent(in) :: tag  !! What is between its brackets.
    integer(int64), intent(in) :: begin, end  !! Places of the brackets.
    character(:), allocatable :: name
    integer :: n
    logical :: known
    name = tag(:scan(tag//' ', ' />'//achar(9)//achar(10)//achar(13), back=.false.) - 1)
    if (len(tag) > 0) then
      if (tag(1:1) == '/') name = trim(tag)
    end if
    if (index(name, '/') == 1) then
      known = self%n_open > 0
      if (known) known = self%open(self%n_open)%s == name(2:)
      if (.not. known) then
        call self%fail('</'//name(2:)//'> closes no open tag', begin)
        return
      end if
      self%n_open = self%n_open - 1
      if (name == '/Piece') self%in_piece = .false.
      return
    end if
    if (self%n_open == 0) then
      if (name == 'VTKFile') then
        call take_root(self, tag, begin)
      else
        call refuse_content(self)
      end if
    else if (name == 'Piece') then
      call take_piece(self, tag, begin)
    else if (name == 'DataArray' .and. self%in_piece) then
      call take_array(self, tag, begin)
    else if (name == 'AppendedData') then
      call take_appended(self, tag, begin, end)
    end if
    n = len(tag)
    if (tag(n:n) == '/' .or. allocated(self%fault)) return
    if (self%n_open == most_nested) then
      call self%fail('too many tags inside of each other', begin)
      return
    end if
    self%n_open = self%n_open + 1
    self%open(self%n_open)%s = name
  end subroutine take_tag

  !> Take the tag of the file.
  subroutine take_root(self, tag, begin)
    type(vtu_tags_t), intent(inout) :: self  !! The file.
    character(*), intent(in) :: tag  !! What is between its brackets.
    integer(int64), intent(in) :: begin  !! Place of the tag.
    character(:), allocatable :: compressor
    if (value_of(tag, 'type') /= 'UnstructuredGrid') then
      call self%fail('the file has type '//quoted(value_of(tag, 'type'))//': only UnstructuredGrid is read', begin)
    else if (value_of(tag, 'byte_order') == 'BigEndian') then
      call self%fail('byte_order BigEndian is not read: save the file with little endian bytes', begin)
    end if
    self%header_size = merge(8, 4, value_of(tag, 'header_type') == 'UInt64')
    compressor = value_of(tag, 'compressor')
    self%compressed = len(compressor) > 0
    if (self%compressed .and. compressor /= 'vtkZLibDataCompressor') &
      call self%fail('the compressor '//shown(compressor)//' is not read: save the file with zlib or without', begin)
  end subroutine take_root

  !> Take the tag of a piece.
  subroutine take_piece(self, tag, begin)
    type(vtu_tags_t), intent(inout) :: self  !! The file.
    character(*), intent(in) :: tag  !! What is between its brackets.
    integer(int64), intent(in) :: begin  !! Place of the tag.
    integer(int64) :: n_points, n_cells
    n_points = count_of('NumberOfPoints')
    n_cells = count_of('NumberOfCells')
    self%in_piece = n_cells > 0 .and. .not. allocated(self%fault)
    if (.not. self%in_piece) return
    if (self%has_piece) then
      call self%fail('a second piece: save the mesh as one piece (ParaView: Merge Blocks, Clean to Grid)', begin)
      return
    end if
    self%has_piece = .true.
    self%n_points = int(n_points)
    self%n_cells = int(n_cells)

  contains

    !> A count that the tag gives.
    integer(int64) function count_of(name) result(n)
      character(*), intent(in) :: name  !! Its name.
      integer(int64) :: p
      logical :: valid
      p = 1
      call scan_integer(value_of(tag, name)//achar(0), p, n, valid)
      if (valid) valid = n >= 0 .and. n <= min(2_int64**26, most_compressed*self%bytes%size)
      if (.not. valid) call self%fail('the piece needs '//name//', a count that the file has room for', begin)
    end function count_of
  end subroutine take_piece

  !> Take the tag of an array.
  subroutine take_array(self, tag, begin)
    type(vtu_tags_t), intent(inout) :: self  !! The file.
    character(*), intent(in) :: tag  !! What is between its brackets.
    integer(int64), intent(in) :: begin  !! Place of the tag.
    type(vtu_array_t), allocatable :: larger(:)
    integer(int64) :: p, n
    logical :: valid
    if (self%n_arrays == size(self%array)) then
      allocate (larger(2*self%n_arrays))
      larger(:self%n_arrays) = self%array
      call move_alloc(larger, self%array)
    end if
    self%n_arrays = self%n_arrays + 1
    associate (array => self%array(self%n_arrays))
      array%parent = self%open(self%n_open)%s
      array%name = value_of(tag, 'Name')
      array%type = value_of(tag, 'type')
      array%format = value_of(tag, 'format')
      array%position = begin
      if (array%format /= 'ascii' .and. array%format /= 'binary' .and. array%format /= 'appended') &
        call self%fail('array '//quoted(array%name)//': format must be ascii, binary or appended', begin)
      p = 1
      call scan_integer(value_of(tag, 'NumberOfComponents')//achar(0), p, n, valid)
      if (valid) array%n_components = int(max(1_int64, min(n, 1000000_int64)))
      if (array%format /= 'appended') return
      p = 1
      call scan_integer(value_of(tag, 'offset')//achar(0), p, array%offset, valid)
      if (.not. valid .or. array%offset < 0) &
        call self%fail('array '//quoted(array%name)//': the offset of its data is missing', begin)
    end associate
  end subroutine take_array

  !> Take the tag of the appended data.
  subroutine take_appended(self, tag, begin, end)
    type(vtu_tags_t), intent(inout) :: self  !! The file.
    character(*), intent(in) :: tag  !! What is between its brackets.
    integer(int64), intent(in) :: begin, end  !! Places of the brackets.
    integer(int64) :: p
    self%encoded = value_of(tag, 'encoding') == 'base64'
    do p = end + 1, self%bytes%size
      if (.not. ends_word(self%bytes%text(p:p))) exit
    end do
    if (self%bytes%text(p:p) == '_') then
      self%appended = p + 1
    else
      call self%fail('the appended data must begin with _', begin)
    end if
  end subroutine take_appended

  !> Value of an attribute of a tag; empty where it is missing.
  pure function value_of(tag, name) result(value)
    character(*), intent(in) :: tag  !! What is between the brackets of the tag.
    character(*), intent(in) :: name  !! Name of the attribute.
    character(:), allocatable :: value
    integer :: p, q, n
    value = ''
    ! Attributes one after another: values may have the names of others.
    p = scan(tag, ' '//achar(9)//achar(10)//achar(13))
    do while (p > 0 .and. p < len(tag))
      q = p + scan(tag(p + 1:), '"'//"'")
      if (q == p) return
      n = index(tag(q + 1:), tag(q:q))
      if (n == 0) return
      if (stripped(tag(p:q - 1)) == name) then
        value = tag(q + 1:q + n - 1)
        return
      end if
      p = q + n + 1
      if (p > len(tag)) return
    end do
  end function value_of

  !> Name before the = of an attribute.
  pure function stripped(text) result(name)
    character(*), intent(in) :: text  !! Text up to the quote.
    character(:), allocatable :: name
    integer :: i
    name = ''
    do i = 1, len(text)
      if (.not. ends_word(text(i:i)) .and. text(i:i) /= '=') name = name//text(i:i)
    end do
  end function stripped

  !> Keep a mistake with its line, if it is the first.
  subroutine tags_fail(self, message, position)
    class(vtu_tags_t), intent(inout) :: self
    character(*), intent(in) :: message  !! Message.
    integer(int64), intent(in) :: position  !! Place in the file.
    if (.not. allocated(self%fault)) &
      self%fault = self%bytes%file//':'//to_text(self%bytes%line_of(position))//': '//message
  end subroutine tags_fail

  !> Index of an array, which the file must have.
  integer function tags_find(self, parent, name) result(index)
    class(vtu_tags_t), intent(inout) :: self
    character(*), intent(in) :: parent  !! Tag around it.
    character(*), intent(in) :: name  !! Its name; any if empty.
    do index = 1, self%n_arrays
      if (self%array(index)%parent == parent .and. (self%array(index)%name == name .or. len(name) == 0)) return
    end do
    call self%fail(trim('<'//parent//'> has no DataArray '//name)//': the file is incomplete', 1_int64)
    index = 0
  end function tags_find

end module dotyk_mesh_vtu_tags
