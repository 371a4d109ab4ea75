!> What the readers of the gmsh formats share: the frame of the file and of its sections; checks of nodes, counts and
!> node tags; element types, supported or not, because a reader must know the size of elements that it skips.
module dotyk_mesh_gmsh_common
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_files, only: nature_of
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_element, only: kind_of_gmsh_type
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: allocate_nodes, index_nodes, find_nodes, type_nodes, type_kind, read_counts, check_block, begin_section, &
    content_name, read_end, read_format, skip_section

  integer, parameter :: gmsh_point = 15  !! Type number of a point.

  type :: gmsh_type_t  !! Element type of gmsh.
    integer :: number  !! Type number.
    integer :: n_nodes  !! Number of nodes.
    integer :: dimension  !! Dimension.
    character(34) :: name  !! Name, for messages.
  end type gmsh_type_t

  !> The types of the gmsh reference manual (section "MSH file format"), except those of order 5 and more.
  type(gmsh_type_t), parameter :: types(*) = [ &
                                  gmsh_type_t(1, 2, 1, 'line with 2 nodes'), &
                                  gmsh_type_t(2, 3, 2, 'triangle with 3 nodes'), &
                                  gmsh_type_t(3, 4, 2, 'quadrangle with 4 nodes'), &
                                  gmsh_type_t(4, 4, 3, 'tetrahedron with 4 nodes'), &
                                  gmsh_type_t(5, 8, 3, 'hexahedron with 8 nodes'), &
                                  gmsh_type_t(6, 6, 3, 'prism with 6 nodes'), &
                                  gmsh_type_t(7, 5, 3, 'pyramid with 5 nodes'), &
                                  gmsh_type_t(8, 3, 1, 'line with 3 nodes'), &
                                  gmsh_type_t(9, 6, 2, 'triangle with 6 nodes'), &
                                  gmsh_type_t(10, 9, 2, 'quadrangle with 9 nodes'), &
                                  gmsh_type_t(11, 10, 3, 'tetrahedron with 10 nodes'), &
                                  gmsh_type_t(12, 27, 3, 'hexahedron with 27 nodes'), &
                                  gmsh_type_t(13, 18, 3, 'prism with 18 nodes'), &
                                  gmsh_type_t(14, 14, 3, 'pyramid with 14 nodes'), &
                                  gmsh_type_t(15, 1, 0, 'point'), &
                                  gmsh_type_t(16, 8, 2, 'quadrangle with 8 nodes'), &
                                  gmsh_type_t(17, 20, 3, 'hexahedron with 20 nodes'), &
                                  gmsh_type_t(18, 15, 3, 'prism with 15 nodes'), &
                                  gmsh_type_t(19, 13, 3, 'pyramid with 13 nodes'), &
                                  gmsh_type_t(20, 9, 2, 'incomplete triangle with 9 nodes'), &
                                  gmsh_type_t(21, 10, 2, 'triangle with 10 nodes'), &
                                  gmsh_type_t(22, 12, 2, 'incomplete triangle with 12 nodes'), &
                                  gmsh_type_t(23, 15, 2, 'triangle with 15 nodes'), &
                                  gmsh_type_t(26, 4, 1, 'line with 4 nodes'), &
                                  gmsh_type_t(27, 5, 1, 'line with 5 nodes'), &
                                  gmsh_type_t(29, 20, 3, 'tetrahedron with 20 nodes'), &
                                  gmsh_type_t(30, 35, 3, 'tetrahedron with 35 nodes'), &
                                  gmsh_type_t(36, 16, 2, 'quadrangle with 16 nodes'), &
                                  gmsh_type_t(37, 25, 2, 'quadrangle with 25 nodes'), &
                                  gmsh_type_t(90, 40, 3, 'prism with 40 nodes'), &
                                  gmsh_type_t(92, 64, 3, 'hexahedron with 64 nodes'), &
                                  gmsh_type_t(93, 125, 3, 'hexahedron with 125 nodes'), &
                                  gmsh_type_t(118, 30, 3, 'pyramid with 30 nodes')]

  !> Advice for files of other formats.
  character(*), parameter, public :: conversion_advice = 'convert it with: gmsh -save -format msh41 -o new.msh old.msh'

  real(dp), parameter :: version_tolerance = 1.0e-6_dp  !! Version numbers are equal up to this: they have one decimal.

contains

  !> Allocate the nodes, whose number was checked against the size of the file.
  subroutine allocate_nodes(cursor, builder, n_nodes, position)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer(int64), intent(in) :: n_nodes  !! Number of nodes.
    integer(int64), allocatable, intent(out) :: position(:)  !! Position of each node in the file, filled in (n_nodes).
    if (cursor%broken) return
    allocate (builder%x(3, n_nodes), builder%node_tag(n_nodes), position(n_nodes))
  end subroutine allocate_nodes

  !> Index the nodes by their tags, which must be positive and unique.
  subroutine index_nodes(cursor, builder, position)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer(int64), intent(in) :: position(:)  !! Position of each node in the file (n_nodes).
    integer :: repeated, i
    if (cursor%broken) return
    do i = 1, size(position)
      if (builder%node_tag(i) > 0) cycle
      call cursor%fail('node tag '//to_text(builder%node_tag(i))//' is not positive', position(i))
      return
    end do
    call builder%node_of_tag%init(builder%node_tag, repeated)
    if (repeated > 0) &
      call cursor%fail('node tag '//to_text(builder%node_tag(repeated))//' occurs a second time', position(repeated))
  end subroutine index_nodes

  !> Indices of the nodes of an element; in the map of used nodes where not all is read.
  subroutine find_nodes(cursor, builder, tag, element, position, node)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer(int64), intent(in) :: tag(:)  !! Node tags (n).
    integer(int64), intent(in) :: element  !! Tag of the element, for messages.
    integer(int64), intent(in) :: position  !! Position of the element in the file, for messages.
    integer, intent(out) :: node(:)  !! Node indices (n).
    integer :: i
    if (.not. builder%selection%everything) then
      do i = 1, size(tag)
        call builder%used%add(tag(i), node(i))
      end do
      return
    end if
    do i = 1, size(tag)
      node(i) = builder%node_of_tag%find(tag(i))
      if (node(i) > 0) cycle
      call cursor%fail('element '//to_text(element)//' refers to node '//to_text(tag(i))// &
                       ', which $Nodes does not have', position)
      return
    end do
  end subroutine find_nodes

  !> Number of nodes of an element type of gmsh, which must be known even to skip an element.
  subroutine type_nodes(cursor, type, element, position, n_nodes)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer(int64), intent(in) :: type  !! Type number of gmsh.
    integer(int64), intent(in) :: element  !! Tag of the (first) element of this type.
    integer(int64), intent(in) :: position  !! Position of the element in the file, for messages.
    integer, intent(out) :: n_nodes  !! Number of nodes; 0 after a fault.
    n_nodes = 0
    if (cursor%broken) return
    if (abs(type) < huge(0)) n_nodes = gmsh_type_nodes(int(type))
    if (n_nodes == 0) &
      call cursor%fail('element '//to_text(element)//' is of type '//to_text(type)// &
                       ', which is not known: only elements of order 1 and 2 are supported', position)
  end subroutine type_nodes

  !> Element kind of an element that is kept, which must be supported.
  subroutine type_kind(cursor, type, element, position, kind)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer(int64), intent(in) :: type  !! Type number of gmsh, a known one.
    integer(int64), intent(in) :: element  !! Tag of the (first) element of this type.
    integer(int64), intent(in) :: position  !! Position of the element in the file, for messages.
    integer, intent(out) :: kind  !! Element kind of `dotyk_mesh_element`; 0 after a fault.
    kind = 0
    if (cursor%broken) return
    kind = kind_of_gmsh_type(int(type))
    if (kind == 0 .and. type /= gmsh_point) &
      call cursor%fail('element '//to_text(element)//' is a '//gmsh_type_name(int(type))//' (gmsh type '// &
                       to_text(type)//'): only elements of order 1 and 2 are supported: mesh with '// &
                       'Mesh.ElementOrder = 1 or 2', position)
  end subroutine type_kind

  !> Read the four numbers at the head of $Nodes and $Elements: blocks, items, least and largest tag.
  subroutine read_counts(cursor, least_bytes, what, n_blocks, count)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer, intent(in) :: least_bytes  !! Fewest bytes of one item.
    character(*), intent(in) :: what  !! Name of the items, for messages.
    integer(int64), intent(out) :: n_blocks  !! Number of blocks; 0 after a fault.
    integer(int64), intent(out) :: count  !! Number of items; 0 after a fault.
    integer(int64) :: ignored, first
    if (.not. cursor%binary) call cursor%skip_blanks
    first = cursor%position
    call cursor%get_size(n_blocks)
    call cursor%get_size(count)
    call cursor%get_size(ignored)
    call cursor%get_size(ignored)
    call cursor%require(n_blocks, merge(20, 8, cursor%binary), 'blocks of '//what, first)
    call cursor%require(count, least_bytes, what, first)
    if (.not. cursor%broken) return
    n_blocks = 0
    count = 0
  end subroutine read_counts

  !> Check that a block has no more items than are left of those announced.
  subroutine check_block(cursor, what, n, n_read, n_all, position)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    character(*), intent(in) :: what  !! Name of the items, for messages.
    integer(int64), intent(in) :: n  !! Items of the block.
    integer(int64), intent(in) :: n_read  !! Items of the previous blocks.
    integer(int64), intent(in) :: n_all  !! Items that are announced.
    integer(int64), intent(in) :: position  !! Position of the block in the file.
    if (n >= 0 .and. n <= n_all - n_read) return
    call cursor%fail('a block announces '//to_text(n)//' '//what//', where '//to_text(n_all - n_read)//' of '// &
                     to_text(n_all)//' are left', position)
  end subroutine check_block

  !> Index of a type in the table, 0 if it is unknown.
  pure integer function index_of(number) result(index)
    integer, intent(in) :: number  !! Type number of gmsh.
    do index = 1, size(types)
      if (types(index)%number == number) return
    end do
    index = 0
  end function index_of

  !> Number of nodes of a type, 0 if it is unknown.
  pure integer function gmsh_type_nodes(number) result(n_nodes)
    integer, intent(in) :: number  !! Type number of gmsh.
    integer :: index
    index = index_of(number)
    n_nodes = 0
    if (index > 0) n_nodes = types(index)%n_nodes
  end function gmsh_type_nodes

  !> Name of a type.
  pure function gmsh_type_name(number) result(name)
    integer, intent(in) :: number  !! Type number of gmsh.
    character(:), allocatable :: name  !! Name.
    integer :: index
    index = index_of(number)
    name = 'unknown type'
    if (index > 0) name = trim(types(index)%name)
  end function gmsh_type_name

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
end module dotyk_mesh_gmsh_common
