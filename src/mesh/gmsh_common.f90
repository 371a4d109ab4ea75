!> Checks of nodes, element types, counts and node tags that the readers of the gmsh formats share.
module dotyk_mesh_gmsh_common
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_element, only: kind_of_gmsh_type
  use dotyk_mesh_gmsh_type, only: gmsh_type_nodes, gmsh_type_name
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: allocate_nodes, index_nodes, find_nodes, type_nodes, type_kind, read_counts, check_block

contains

  !> Allocate the nodes, whose number was checked against the size of the file.
  subroutine allocate_nodes(cursor, builder, n_nodes, position)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer(int64), intent(in) :: n_nodes  !! Number of nodes.
    !> Position of each node in the file, to be filled in (n_nodes).
    integer(int64), allocatable, intent(out) :: position(:)
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
    if (kind == 0) &
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
end module dotyk_mesh_gmsh_common
