!> Reader of gmsh mesh files of the format MSH 4.1, text and binary (little endian).
!>
!> This module reads the format and the frame of the sections. Elements
!> without a physical group are dropped; nodes are kept whether elements use them or not.
module dotyk_mesh_gmsh
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_error, only: error_t, set_error, exit_bad_input
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_gmsh_common, only: allocate_nodes, begin_section, check_block, content_name, conversion_advice, &
    find_nodes, index_nodes, read_counts, read_end, read_format, skip_section, type_kind, type_nodes
  use dotyk_mesh_gmsh_entities, only: entities_t, entity_t, find_entity, read_entities_41, read_partitioned_entities_41
  use dotyk_mesh_gmsh_selected_nodes, only: read_selected_nodes, skip_nodes
  use dotyk_mesh_mesh, only: mesh_selection_t, mesh_t
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: read_gmsh, read_gmsh_text

  integer, parameter :: max_nodes = 125  !! Nodes of the largest known element type.

  type :: sections_t  !! Format of the file, and the sections read so far.
    logical :: format = .false.  !! $MeshFormat was read.
    logical :: names = .false.  !! $PhysicalNames was read.
    logical :: entities = .false.  !! $Entities was read.
    logical :: nodes = .false.  !! $Nodes was read.
    logical :: elements = .false.  !! $Elements was read.
    integer(int64) :: n_elements = 0  !! Elements in the file, kept or not.
    integer(int64) :: node_position = 0  !! Position behind '$Nodes' and, in a binary file, its line.
  end type sections_t

contains

  !> Read a mesh file, or a selection of it.
  subroutine read_gmsh(file, mesh, error, selection)
    character(*), intent(in) :: file  !! Path of the file.
    type(mesh_t), intent(out) :: mesh  !! Mesh.
    !> Set if the file cannot be opened or read, is truncated or corrupt, or has no mesh; the message names the
    !> position.
    type(error_t), allocatable, intent(out) :: error
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read and checked; all if absent.
    type(byte_cursor_t) :: cursor
    call cursor%open(file, error)
    if (allocated(error)) return
    call read_sections(cursor, mesh, error, selection)
    call cursor%close
  end subroutine read_gmsh

  !> Read a mesh, or a selection of it, from bytes in memory.
  subroutine read_gmsh_text(file, bytes, mesh, error, selection)
    character(*), intent(in) :: file  !! File name, for messages.
    character(*), intent(in) :: bytes  !! Content of the file.
    type(mesh_t), intent(out) :: mesh  !! Mesh.
    !> Set if the file cannot be opened or read, is truncated or corrupt, or has no mesh; the message names the
    !> position.
    type(error_t), allocatable, intent(out) :: error
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read and checked; all if absent.
    type(byte_cursor_t) :: cursor
    call cursor%use_text(file, bytes)
    call read_sections(cursor, mesh, error, selection)
  end subroutine read_gmsh_text

  !> Read all sections.
  subroutine read_sections(cursor, mesh, error, selection)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor at the first byte.
    type(mesh_t), intent(inout) :: mesh  !! Mesh.
    !> Set if the file cannot be opened or read, is truncated or corrupt, or has no mesh; the message names the
    !> position.
    type(error_t), allocatable, intent(out) :: error
    type(mesh_selection_t), intent(in), optional :: selection  !! What is read; all if absent.
    type(mesh_builder_t) :: builder
    type(entities_t) :: entities
    type(sections_t) :: sections
    if (present(selection)) builder%selection = selection
    do while (.not. cursor%broken)
      if (cursor%at_end()) exit
      call read_section(cursor, builder, entities, sections)
    end do
    if (builder%selection%counts_only) then
      allocate (builder%x(3, 0), builder%node_tag(0))
    else if (.not. builder%selection%everything .and. sections%nodes) then
      cursor%section = '$Nodes'
      cursor%position = sections%node_position
      call read_selected_nodes(cursor, builder)
    end if
    call check_complete(cursor, builder, sections)
    if (cursor%broken) then
      call set_error(error, cursor%fault, exit_bad_input)
      return
    end if
    mesh%file = cursor%file
    call builder%finish(mesh)
  end subroutine read_sections

  !> Read one section, from '$Name' to '$EndName'.
  subroutine read_section(cursor, builder, entities, sections)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    type(entities_t), intent(inout) :: entities  !! Geometric entities.
    type(sections_t), intent(inout) :: sections  !! Format and sections read so far.
    character(:), allocatable :: word
    integer(int64) :: first
    call begin_section(cursor, sections%format, word, first)
    if (cursor%broken) return
    select case (word)
    case ('$MeshFormat')
      call check_first(cursor, sections%format, first)
      call read_format(cursor)
    case ('$NOD', '$ELM')
      call cursor%fail('gmsh''s format 1 is not read: '//conversion_advice, first)
    case ('$PhysicalNames', '$Entities', '$Nodes', '$Elements', '$PartitionedEntities')
      if (.not. sections%format) then
        call cursor%fail('$MeshFormat must come first', first)
      else
        call read_known_section(cursor, builder, entities, sections, word, first)
      end if
    case default
      call skip_section(cursor, word, first)
      cursor%section = ''
      return
    end select
    call read_end(cursor, word)
    cursor%section = ''
  end subroutine read_section

  !> Read a section that carries parts of the mesh.
  subroutine read_known_section(cursor, builder, entities, sections, name, first)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    type(entities_t), intent(inout) :: entities  !! Geometric entities.
    type(sections_t), intent(inout) :: sections  !! Format and sections read so far.
    character(*), intent(in) :: name  !! Name of the section, as '$Nodes'.
    integer(int64), intent(in) :: first  !! Position of the section in the file.
    select case (name)
    case ('$PhysicalNames')
      call check_first(cursor, sections%names, first)
      call read_names(cursor, builder)
    case ('$Entities')
      call check_first(cursor, sections%entities, first)
      if (cursor%binary) call cursor%end_line
      call read_entities_41(cursor, builder, entities)
    case ('$PartitionedEntities')
      call check_first(cursor, entities%partitioned, first)
      if (cursor%binary) call cursor%end_line
      call read_partitioned_entities_41(cursor, builder, entities)
    case ('$Nodes')
      call check_first(cursor, sections%nodes, first)
      if (cursor%binary) call cursor%end_line
      if (builder%selection%everything) then
        call read_nodes_41(cursor, builder)
      else
        sections%node_position = cursor%position
        call skip_nodes(cursor)
      end if
    case ('$Elements')
      call check_first(cursor, sections%elements, first)
      if (.not. sections%nodes) call cursor%fail('$Nodes must come before $Elements', first)
      if (cursor%broken) return
      if (cursor%binary) call cursor%end_line
      call read_elements_41(cursor, builder, entities, sections%n_elements)
    end select
  end subroutine read_known_section

  !> Read $PhysicalNames: a count, then dimension, tag and "name" of each group, as text in binary files too.
  subroutine read_names(cursor, builder)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
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

  !> Check that a section occurs once.
  subroutine check_first(cursor, met, position)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    logical, intent(inout) :: met  !! Whether the section was read before; true on return.
    integer(int64), intent(in) :: position  !! Position of the section in the file.
    if (met) call cursor%fail('this section occurs a second time', position)
    met = .true.
  end subroutine check_first

  !> Check that the file has all that a mesh needs.
  subroutine check_complete(cursor, builder, sections)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(in) :: builder  !! Mesh under construction.
    type(sections_t), intent(in) :: sections  !! Format and sections read.
    if (cursor%broken) return
    if (cursor%size == 0) then
      call cursor%fail('the file is empty')
    else if (.not. sections%format) then
      call cursor%fail('this is not a gmsh mesh file: it '//content_name(cursor)//'has no $MeshFormat')
    else if (.not. sections%nodes) then
      call cursor%fail('the file ends without $Nodes: it has no mesh or is truncated')
    else if (size(builder%node_tag) == 0 .and. builder%selection%everything) then
      call cursor%fail('the mesh has no nodes')
    else if (.not. sections%elements) then
      call cursor%fail('the file ends without $Elements: it has no mesh or is truncated')
    else if (sections%n_elements == 0) then
      call cursor%fail('the mesh has no elements')
    else if (builder%n_blocks == 0 .and. builder%selection%everything) then
      call cursor%fail('no element belongs to a physical group: add Physical Volume("name") and '// &
                       'Physical Surface("name") (in two dimensions Physical Surface and Physical Curve) to the '// &
                       'geometry and mesh it again')
    end if
  end subroutine check_complete

  !> Read $Nodes: blocks by entity, each with the tags first and the coordinates after them.
  subroutine read_nodes_41(cursor, builder)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind '$Nodes' and, in a binary file, its line.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; its nodes are set.
    integer(int64), allocatable :: position(:)
    integer(int64) :: n_nodes, n_blocks, n_read, n, dimension, entity, parametric, ignored, first, i, j
    real(dp) :: parameter
    call read_counts(cursor, merge(32, 8, cursor%binary), 'nodes', n_blocks, n_nodes)
    call allocate_nodes(cursor, builder, n_nodes, position)
    n_read = 0
    do i = 1, n_blocks
      if (cursor%broken) return
      if (.not. cursor%binary) call cursor%skip_blanks
      first = cursor%position
      call cursor%get_int(dimension)
      call cursor%get_int(entity)
      call cursor%get_int(parametric)
      call cursor%get_size(n)
      if (dimension < 0 .or. dimension > 3) call cursor%fail('an entity has the dimension '//to_text(dimension), first)
      if (parametric < 0 .or. parametric > 1) &
        call cursor%fail('expected 0 or 1 for parametric nodes, found '//to_text(parametric), first)
      call check_block(cursor, 'nodes', n, n_read, n_nodes, first)
      if (cursor%broken) return
      do j = n_read + 1, n_read + n
        if (.not. cursor%binary) call cursor%skip_blanks
        position(j) = cursor%position
        call cursor%get_size(builder%node_tag(j))
        if (cursor%broken) return
      end do
      do j = n_read + 1, n_read + n
        call cursor%get_real(builder%x(1, j))
        call cursor%get_real(builder%x(2, j))
        call cursor%get_real(builder%x(3, j))
        do ignored = 1, parametric*dimension
          call cursor%get_real(parameter)
        end do
        if (cursor%broken) then
          cursor%fault = cursor%fault//' (node '//to_text(builder%node_tag(j))//')'
          return
        end if
      end do
      n_read = n_read + n
    end do
    if (n_read < n_nodes) call cursor%fail(to_text(n_nodes)//' nodes are announced, the blocks have '//to_text(n_read))
    call index_nodes(cursor, builder, position)
  end subroutine read_nodes_41

  !> Read $Elements: blocks by entity and type.
  subroutine read_elements_41(cursor, builder, entities, n_elements)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind '$Elements' and, in a binary file, its line.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; it has the nodes, its blocks are set.
    type(entities_t), intent(in) :: entities  !! Geometric entities.
    integer(int64), intent(out) :: n_elements  !! Number of elements in the file, points included.
    type(entity_t) :: entity
    integer(int64) :: n_blocks, n_read, n, dimension, tag, type, first, i
    integer :: n_nodes, kind, block
    logical :: kept
    call read_counts(cursor, merge(16, 4, cursor%binary), 'elements', n_blocks, n_elements)
    n_read = 0
    do i = 1, n_blocks
      if (cursor%broken) return
      if (.not. cursor%binary) call cursor%skip_blanks
      first = cursor%position
      call cursor%get_int(dimension)
      call cursor%get_int(tag)
      call cursor%get_int(type)
      call cursor%get_size(n)
      if (dimension < 0 .or. dimension > 3) call cursor%fail('an entity has the dimension '//to_text(dimension), first)
      call check_block(cursor, 'elements', n, n_read, n_elements, first)
      if (cursor%broken) return
      if (n == 0) cycle
      call type_nodes(cursor, type, next_tag(cursor), first, n_nodes)
      call find_entity(cursor, entities, int(dimension), tag, first, entity)
      if (cursor%broken) return
      kept = size(entity%group) > 0
      if (kept) kept = builder%wants(int(dimension), entity%group)
      block = 0
      if (kept) then
        call type_kind(cursor, type, next_tag(cursor), first, kind)
        if (cursor%broken) return
        call builder%add_block(kind, n_nodes, entity%group, block)
        call cursor%require(n, merge(8, 2, cursor%binary)*(n_nodes + 1), 'elements', first)
        if (cursor%broken) return
      end if
      if (block == 0 .or. builder%selection%counts_only) then
        if (block > 0) builder%block(block)%n_in_file = builder%block(block)%n_in_file + int(n)
        call skip_elements(cursor, builder, entity%tag, n, n_nodes)
      else
        call builder%reserve(block, int(n))
        call read_block(cursor, builder, block, entity%tag, n, n_nodes)
      end if
      n_read = n_read + n
    end do
    if (n_read < n_elements) &
      call cursor%fail(to_text(n_elements)//' elements are announced, the blocks have '//to_text(n_read))
  end subroutine read_elements_41

  !> Skip the elements of one block of the file.
  subroutine skip_elements(cursor, builder, entity, n, n_nodes)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; it is unchanged.
    integer, intent(in) :: entity  !! Geometric entity.
    integer(int64), intent(in) :: n  !! Number of elements.
    integer, intent(in) :: n_nodes  !! Number of nodes of each element.
    if (cursor%binary .and. .not. builder%selection%everything) then
      call cursor%skip_bytes(8*(n_nodes + 1)*n)
    else
      call read_block(cursor, builder, 0, entity, n, n_nodes)
    end if
  end subroutine skip_elements

  !> Read the elements of one block of the file.
  subroutine read_block(cursor, builder, block, entity, n, n_nodes)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer, intent(in) :: block  !! Block of the builder that receives the elements, 0 for none.
    integer, intent(in) :: entity  !! Tag of the geometric entity.
    integer(int64), intent(in) :: n  !! Number of elements.
    integer, intent(in) :: n_nodes  !! Number of nodes of each element.
    integer(int64) :: tag(max_nodes), element, first, i
    integer :: node(max_nodes), k
    do i = 1, n
      if (.not. cursor%binary) call cursor%skip_blanks
      first = cursor%position
      call cursor%get_size(element)
      do k = 1, n_nodes
        call cursor%get_size(tag(k))
      end do
      if (cursor%broken) return
      if (block == 0) cycle
      call find_nodes(cursor, builder, tag(:n_nodes), element, first, node(:n_nodes))
      if (cursor%broken) return
      call builder%add_element(block, element, entity, node(:n_nodes))
    end do
  end subroutine read_block

  !> The next number, which stays unread: the tag of the first element of a block, for messages.
  integer(int64) function next_tag(cursor) result(tag)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer(int64) :: position
    position = cursor%position
    call cursor%get_size(tag)
    cursor%position = position
  end function next_tag
end module dotyk_mesh_gmsh
