!> Reads a gmsh mesh file: MSH 2.2 and 4.1, text and binary (little endian).
!>
!> Format and sections; the numbered formats have modules of their own. Elements without a physical group are dropped, and so
!> are point elements; nodes are kept whether elements use them or not.
module dotyk_mesh_gmsh
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_error, only: error_t, set_error, exit_bad_input
  use dotyk_base_files, only: nature_of
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_mesh_gmsh_22, only: read_nodes_22, read_elements_22
  use dotyk_mesh_gmsh_41, only: entities_t, read_entities_41, read_nodes_41, read_elements_41
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: read_gmsh, read_gmsh_text

  !> What the format line says, and which sections were met.
  type :: sections_t
    !> 22 or 41; 0 before $MeshFormat.
    integer :: version = 0
    !> Sections met so far.
    logical :: names = .false., entities = .false., nodes = .false., elements = .false.
    !> Elements in the file, kept or not.
    integer(int64) :: n_elements = 0
  end type sections_t

  !> How to get a file that can be read.
  character(*), parameter :: convert_help = 'convert it with: gmsh -save -format msh41 -o new.msh old.msh'

contains

  !> Read a mesh file.
  subroutine read_gmsh(file, mesh, error)
    !> Path of the file.
    character(*), intent(in) :: file
    type(mesh_t), intent(out) :: mesh
    type(error_t), allocatable, intent(out) :: error
    type(byte_cursor_t) :: cursor
    call cursor%load(file, error)
    if (allocated(error)) return
    call read_cursor(cursor, mesh, error)
  end subroutine read_gmsh

  !> Read a mesh from bytes in memory.
  subroutine read_gmsh_text(file, bytes, mesh, error)
    !> Name for messages.
    character(*), intent(in) :: file
    !> What the file would hold.
    character(*), intent(in) :: bytes
    type(mesh_t), intent(out) :: mesh
    type(error_t), allocatable, intent(out) :: error
    type(byte_cursor_t) :: cursor
    call cursor%use_text(file, bytes)
    call read_cursor(cursor, mesh, error)
  end subroutine read_gmsh_text

  !> Read all sections.
  subroutine read_cursor(cursor, mesh, error)
    !> At the first byte.
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_t), intent(inout) :: mesh
    type(error_t), allocatable, intent(out) :: error
    type(mesh_builder_t) :: builder
    type(entities_t) :: entities
    type(sections_t) :: sections
    do while (.not. cursor%broken)
      if (cursor%at_end()) exit
      call read_section(cursor, builder, entities, sections)
    end do
    call check_whole(cursor, builder, sections)
    if (cursor%broken) then
      call set_error(error, cursor%fault, exit_bad_input)
      return
    end if
    mesh%file = cursor%file
    call builder%finish(mesh)
  end subroutine read_cursor

  !> What a file is that is no mesh, for messages; empty where that is not known.
  pure function what_it_is(bytes) result(text)
    character(*), intent(in) :: bytes
    character(:), allocatable :: text
    text = nature_of(bytes)
    if (len(text) > 0) text = 'is '//text//' and '
  end function what_it_is

  !> Read one section, from '$Name' to '$EndName'.
  subroutine read_section(cursor, builder, entities, sections)
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_builder_t), intent(inout) :: builder
    type(entities_t), intent(inout) :: entities
    type(sections_t), intent(inout) :: sections
    character(:), allocatable :: word
    integer(int64) :: first
    first = cursor%position
    call cursor%get_word(word)
    if (word(1:1) /= '$') then
      if (sections%version == 0) then
        call cursor%fail('this is not a gmsh mesh file: it '//what_it_is(cursor%text)//'does not begin with $MeshFormat', first)
      else
        call cursor%fail('expected a section, as $Nodes, found other text', first)
      end if
      return
    end if
    cursor%section = word
    select case (word)
    case ('$MeshFormat')
      if (sections%version > 0) call cursor%fail('this section occurs a second time', first)
      call read_format(cursor, sections%version)
    case ('$NOD', '$ELM')
      call cursor%fail('gmsh''s format 1 is not read: '//convert_help, first)
    case ('$ParametricNodes')
      call cursor%fail('parametric nodes of format 2.2 are not read: save without Mesh.SaveParametric', first)
    case ('$PhysicalNames', '$Entities', '$Nodes', '$Elements', '$PartitionedEntities')
      if (sections%version == 0) then
        call cursor%fail('$MeshFormat must come first', first)
      else
        call read_known_section(cursor, builder, entities, sections, word, first)
      end if
    case default
      call pass_over(cursor, word, first)
      cursor%section = ''
      return
    end select
    call close_section(cursor, word)
    cursor%section = ''
  end subroutine read_section

  !> Read a section that has parts of the mesh.
  subroutine read_known_section(cursor, builder, entities, sections, name, first)
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_builder_t), intent(inout) :: builder
    type(entities_t), intent(inout) :: entities
    type(sections_t), intent(inout) :: sections
    !> Name of the section, and where it stands.
    character(*), intent(in) :: name
    integer(int64), intent(in) :: first
    select case (name)
    case ('$PhysicalNames')
      call once(cursor, sections%names, first)
      call read_names(cursor, builder)
    case ('$Entities')
      call once(cursor, sections%entities, first)
      if (sections%version == 22) then
        call cursor%fail('a file of format 2.2 cannot have this section', first)
      end if
      if (cursor%binary) call cursor%end_line
      call read_entities_41(cursor, builder, entities)
    case ('$PartitionedEntities')
      entities%partitioned = .true.
      call pass_over(cursor, name, first)
      ! The end is read again by the caller.
      cursor%position = cursor%position - len('$End'//name(2:))
    case ('$Nodes')
      call once(cursor, sections%nodes, first)
      if (sections%version == 22) then
        call read_nodes_22(cursor, builder)
      else
        if (cursor%binary) call cursor%end_line
        call read_nodes_41(cursor, builder)
      end if
    case ('$Elements')
      call once(cursor, sections%elements, first)
      if (.not. sections%nodes) call cursor%fail('$Nodes must come before $Elements', first)
      if (cursor%broken) return
      if (sections%version == 22) then
        call read_elements_22(cursor, builder, sections%n_elements)
      else
        if (cursor%binary) call cursor%end_line
        call read_elements_41(cursor, builder, entities, sections%n_elements)
      end if
    end select
  end subroutine read_known_section

  !> $MeshFormat: version, 0 for text or 1 for binary, size of reals; then the binary integer 1 in a binary file.
  subroutine read_format(cursor, version)
    type(byte_cursor_t), intent(inout) :: cursor
    !> 22 or 41.
    integer, intent(inout) :: version
    character(:), allocatable :: word
    real(dp) :: number
    integer(int64) :: kind, n_bytes, one, first
    call cursor%skip_blanks
    first = cursor%position
    call cursor%get_word(word)
    cursor%position = first
    call cursor%get_real(number)
    if (cursor%broken) return
    if (abs(number - 2.2_dp) < 1e-6_dp) then
      version = 22
    else if (abs(number - 4.1_dp) < 1e-6_dp) then
      version = 41
    else
      call cursor%fail('format '//word//' is not read, only 2.2 and 4.1: '//convert_help, first)
      return
    end if
    call cursor%get_text_integer(kind)
    call cursor%get_text_integer(n_bytes)
    if (cursor%broken) return
    if (kind /= 0 .and. kind /= 1) call cursor%fail('the file type must be 0 (text) or 1 (binary)', first)
    if (n_bytes /= 8) call cursor%fail('only files with numbers of 8 bytes are read: '//convert_help, first)
    if (kind /= 1) return
    call cursor%end_line
    if (cursor%broken) return
    cursor%binary = .true.
    first = cursor%position
    call cursor%get_int(one)
    if (cursor%broken .or. one == 1) return
    if (one == 2_int64**24) then
      call cursor%fail('the file has the byte order of another kind of machine: save it there as text (gmsh without -bin)', first)
    else
      call cursor%fail('the binary number 1 is missing: the file is corrupt', first)
    end if
  end subroutine read_format

  !> $PhysicalNames: a count, then dimension, tag and "name" of each group, as text in binary files too.
  subroutine read_names(cursor, builder)
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_builder_t), intent(inout) :: builder
    character(:), allocatable :: line
    integer(int64) :: n, dimension, tag, first, i
    integer :: opening, closing, group
    call cursor%skip_blanks
    first = cursor%position
    call cursor%get_text_integer(n)
    call cursor%require(n, 6, 'physical names', first)
    do i = 1, n
      if (cursor%broken) return
      call cursor%skip_blanks
      first = cursor%position
      call cursor%get_text_integer(dimension)
      call cursor%get_text_integer(tag)
      if (cursor%broken) return
      call cursor%get_line(line)
      opening = index(line, '"')
      closing = index(line, '"', back=.true.)
      if (closing <= opening) call cursor%fail('expected dimension, tag and "name" of a physical group', first)
      if (dimension < 0 .or. dimension > 3) call cursor%fail('a physical group has dimension 0, 1, 2 or 3', first)
      if (abs(tag) > huge(0)) call cursor%fail('this physical tag cannot be right', first)
      if (cursor%broken) return
      call builder%add_group(int(dimension), abs(int(tag)), group, line(opening + 1:closing - 1))
    end do
  end subroutine read_names

  !> A section must not come twice.
  subroutine once(cursor, met, position)
    type(byte_cursor_t), intent(inout) :: cursor
    !> Whether it was met; true on return.
    logical, intent(inout) :: met
    !> Where it stands.
    integer(int64), intent(in) :: position
    if (met) call cursor%fail('this section occurs a second time', position)
    met = .true.
  end subroutine once

  !> The end of a section that was read.
  subroutine close_section(cursor, name)
    type(byte_cursor_t), intent(inout) :: cursor
    !> Name of the section, as '$Nodes'.
    character(*), intent(in) :: name
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
  end subroutine close_section

  !> Pass over a section that is not needed, its end included.
  subroutine pass_over(cursor, name, position)
    type(byte_cursor_t), intent(inout) :: cursor
    !> Name of the section, as '$Periodic', and where it stands.
    character(*), intent(in) :: name
    integer(int64), intent(in) :: position
    character(:), allocatable :: end_word
    integer(int64) :: distance
    end_word = '$End'//name(2:)
    distance = index(cursor%text(cursor%position:cursor%size), end_word, kind=int64)
    if (distance == 0) then
      call cursor%fail('the file ends without '//end_word//': it is truncated', position)
      return
    end if
    cursor%position = cursor%position + distance - 1 + len(end_word)
  end subroutine pass_over

  !> What the file must have had.
  subroutine check_whole(cursor, builder, sections)
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_builder_t), intent(in) :: builder
    type(sections_t), intent(in) :: sections
    if (cursor%broken) return
    if (cursor%size == 0) then
      call cursor%fail('the file is empty')
    else if (sections%version == 0) then
      call cursor%fail('this is not a gmsh mesh file: it '//what_it_is(cursor%text)//'has no $MeshFormat')
    else if (.not. sections%nodes) then
      call cursor%fail('the file ends without $Nodes: it has no mesh or is truncated')
    else if (size(builder%node_tag) == 0) then
      call cursor%fail('the mesh has no nodes')
    else if (.not. sections%elements) then
      call cursor%fail('the file ends without $Elements: it has no mesh or is truncated')
    else if (sections%n_elements == 0) then
      call cursor%fail('the mesh has no elements')
    else if (builder%n_blocks == 0) then
      call cursor%fail('no element belongs to a physical group: add Physical Volume("name") and Physical Surface("name") '// &
                       '(in two dimensions Physical Surface and Physical Curve) to the geometry and mesh it again')
    end if
  end subroutine check_whole
end module dotyk_mesh_gmsh
