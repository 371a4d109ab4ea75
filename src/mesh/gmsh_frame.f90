!> Frame of gmsh mesh files: the format, and the ends of the sections.
module dotyk_mesh_gmsh_frame
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_files, only: nature_of
  use dotyk_base_kinds, only: dp, int64
  implicit none
  private
  public :: begin_section, content_name, read_end, read_format, skip_section

  !> Advice for files of other formats.
  character(*), parameter, public :: conversion_advice = 'convert it with: gmsh -save -format msh41 -o new.msh old.msh'

  real(dp), parameter :: version_tolerance = 1.0e-6_dp  !! Version numbers are equal up to this: they have one decimal.

contains

  !> Begin a section: its name.
  subroutine begin_section(cursor, has_format, name, position)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file, between sections.
    logical, intent(in) :: has_format  !! Whether $MeshFormat was read.
    character(:), allocatable, intent(out) :: name  !! Name, as '$Nodes'.
    integer(int64), intent(out) :: position  !! Position of the section in the file.
    position = cursor%position
    call cursor%get_word(name)
    if (name(1:1) == '$') then
      cursor%section = name
    else if (.not. has_format) then
      call cursor%fail('this is not a gmsh mesh file: it '//content_name(cursor)// &
                       'does not begin with $MeshFormat', position)
    else
      call cursor%fail('expected a section, as $Nodes, found other text', position)
    end if
  end subroutine begin_section

  !> Kind of a file that is not a mesh, for messages; empty if unknown.
  function content_name(cursor) result(text)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    character(:), allocatable :: text  !! Text, as "is an HDF5 file and ".
    character(:), allocatable :: bytes
    call cursor%first_bytes(1024, bytes)
    text = nature_of(bytes)
    if (len(text) > 0) text = 'is '//text//' and '
  end function content_name

  !> Read $MeshFormat: version, 0 for text or 1 for binary, size of reals; then the binary integer 1 in a binary file.
  subroutine read_format(cursor)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    character(:), allocatable :: word
    real(dp) :: number
    integer(int64) :: kind, n_bytes, one, first
    call cursor%skip_blanks
    first = cursor%position
    call cursor%get_word(word)
    cursor%position = first
    call cursor%get_real(number)
    if (cursor%broken) return
    if (abs(number - 4.1_dp) > version_tolerance) then
      call cursor%fail('format '//word//' is not read, only 2.2 and 4.1: '//conversion_advice, first)
      return
    end if
    call cursor%get_text_integer(kind)
    call cursor%get_text_integer(n_bytes)
    if (cursor%broken) return
    if (kind /= 0 .and. kind /= 1) call cursor%fail('the file type must be 0 (text) or 1 (binary)', first)
    if (n_bytes /= 8) call cursor%fail('only files with numbers of 8 bytes are read: '//conversion_advice, first)
    if (kind /= 1) return
    call cursor%end_line
    if (cursor%broken) return
    cursor%binary = .true.
    first = cursor%position
    call cursor%get_int(one)
    if (cursor%broken .or. one == 1) return
    if (one == 2_int64**24) then
      call cursor%fail('the file has the byte order of another kind of machine: save it there as text '// &
                       '(gmsh without -bin)', first)
    else
      call cursor%fail('the binary number 1 is missing: the file is corrupt', first)
    end if
  end subroutine read_format

  !> Read the end of a section.
  subroutine read_end(cursor, name)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    character(*), intent(in) :: name  !! Name of the section, as '$Nodes'.
    character(:), allocatable :: word, end_word
    integer(int64) :: first
    if (cursor%broken) return
    end_word = '$End'//name(2:)
    if (cursor%at_end()) then
      call cursor%fail('the file ends without '//end_word//': it is truncated')
      return
    end if
    first = cursor%position
    call cursor%get_word(word)
    if (word == end_word) return
    if (cursor%at_end() .and. index(end_word, word) == 1) then
      call cursor%fail('the file ends without '//end_word//': it is truncated', first)
    else
      call cursor%fail('expected '//end_word//', found other text: a count is wrong or the file is corrupt', first)
    end if
  end subroutine read_end

  !> Skip a section that is not needed, including its end.
  subroutine skip_section(cursor, name, position)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    character(*), intent(in) :: name  !! Name of the section, as '$Periodic'.
    integer(int64), intent(in) :: position  !! Position of the section in the file.
    character(:), allocatable :: end_word
    logical :: found
    end_word = '$End'//name(2:)
    call cursor%skip_past(end_word, found)
    if (.not. found) call cursor%fail('the file ends without '//end_word//': it is truncated', position)
  end subroutine skip_section
end module dotyk_mesh_gmsh_frame
