!> Nodes and elements of gmsh's MSH format 2.2, text and binary.
module dotyk_mesh_gmsh_22
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: to_text
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_mesh_gmsh_common, only: allocate_nodes, index_nodes, find_nodes, type_nodes, type_kind
  use dotyk_mesh_gmsh_type, only: gmsh_point, gmsh_type_dimension
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: read_nodes_22, read_elements_22

  !> More tags than gmsh ever writes for an element (partitions follow the first three).
  integer, parameter :: most_tags = 1000
  !> The largest type that can be passed over.
  integer, parameter :: most_nodes = 125

contains

  !> $Nodes: a count, then tag and coordinates of each node.
  subroutine read_nodes_22(cursor, builder)
    !> Behind the word '$Nodes'.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Receives the nodes.
    type(mesh_builder_t), intent(inout) :: builder
    integer(int64), allocatable :: position(:)
    integer(int64) :: n_nodes, first, i
    call read_count(cursor, merge(28, 8, cursor%binary), 'nodes', n_nodes)
    call allocate_nodes(cursor, builder, n_nodes, position)
    do i = 1, n_nodes
      if (cursor%broken) return
      if (.not. cursor%binary) call cursor%skip_blanks
      first = cursor%position
      call cursor%get_int(builder%node_tag(i))
      call cursor%get_real(builder%x(1, i))
      call cursor%get_real(builder%x(2, i))
      call cursor%get_real(builder%x(3, i))
      position(i) = first
    end do
    call index_nodes(cursor, builder, position)
  end subroutine read_nodes_22

  !> $Elements: a count, then tag, type, tags (the first is the physical group) and nodes of each element; in binary files
  !> under headers of type, number of elements and number of tags.
  subroutine read_elements_22(cursor, builder, n_elements)
    !> Behind the word '$Elements'.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Has the nodes, receives blocks and groups.
    type(mesh_builder_t), intent(inout) :: builder
    !> Number of elements in the file, points included.
    integer(int64), intent(out) :: n_elements
    integer(int64) :: tag(most_nodes), element, type, n_tags, physical, last_type, last_physical, n_left, first, i
    integer :: node(most_nodes), n_nodes, block
    call read_count(cursor, merge(12, 6, cursor%binary), 'elements', n_elements)
    last_type = 0
    last_physical = 0
    n_left = 0
    block = 0
    n_nodes = 0
    do i = 1, n_elements
      if (cursor%broken) return
      if (cursor%binary) then
        if (n_left == 0) then
          first = cursor%position
          call cursor%get_int(type)
          call cursor%get_int(n_left)
          call cursor%get_int(n_tags)
          if (n_left < 1 .or. n_left > n_elements - i + 1) call cursor%fail('a header announces '//to_text(n_left)// &
            ' elements, where '//to_text(n_elements - i + 1)//' of '//to_text(n_elements)//' are left', first)
        end if
        n_left = n_left - 1
        first = cursor%position
        call cursor%get_int(element)
      else
        call cursor%skip_blanks
        first = cursor%position
        call cursor%get_int(element)
        call cursor%get_int(type)
        call cursor%get_int(n_tags)
      end if
      if (cursor%broken) return
      if (type /= last_type) then
        call type_nodes(cursor, type, element, first, n_nodes)
        last_type = type
        block = 0
      end if
      call read_physical(cursor, element, first, n_tags, physical)
      call get_tags(cursor, n_nodes, tag)
      if (cursor%broken) return
      if (physical == 0 .or. type == gmsh_point) cycle
      if (block == 0 .or. physical /= last_physical) then
        call find_block(cursor, builder, type, n_nodes, physical, element, first, block)
        last_physical = physical
      end if
      call find_nodes(cursor, builder, tag(:n_nodes), element, first, node(:n_nodes))
      if (cursor%broken) return
      call builder%reserve(block, 1)
      call builder%add_element(block, element, node(:n_nodes))
    end do
  end subroutine read_elements_22

  !> A count on a line of its own, written as text in binary files too, after which binary numbers begin.
  subroutine read_count(cursor, least_bytes, what, count)
    type(byte_cursor_t), intent(inout) :: cursor
    !> Fewest bytes that each of what is counted takes.
    integer, intent(in) :: least_bytes
    !> What is counted.
    character(*), intent(in) :: what
    !> The count; 0 after a fault.
    integer(int64), intent(out) :: count
    integer(int64) :: first
    call cursor%skip_blanks
    first = cursor%position
    call cursor%get_text_integer(count)
    if (cursor%binary) call cursor%end_line
    call cursor%require(count, least_bytes, what, first)
    if (cursor%broken) count = 0
  end subroutine read_count

  !> The tags of an element, of which the first is the physical group.
  subroutine read_physical(cursor, element, position, n_tags, physical)
    type(byte_cursor_t), intent(inout) :: cursor
    !> Tag of the element, and where it stands in the file.
    integer(int64), intent(in) :: element, position
    integer(int64), intent(in) :: n_tags
    !> Tag of the physical group, 0 if there is none. gmsh marks reversed orientation by a minus.
    integer(int64), intent(out) :: physical
    integer(int64) :: ignored, i
    physical = 0
    if (n_tags < 0 .or. n_tags > most_tags) then
      call cursor%fail('element '//to_text(element)//' has '//to_text(n_tags)//' tags, which cannot be right', position)
      return
    end if
    do i = 1, n_tags
      call cursor%get_int(ignored)
      if (i == 1) physical = abs(ignored)
    end do
    if (physical > huge(0)) call cursor%fail('element '//to_text(element)//' has the physical tag '//to_text(physical)// &
                                             ', which cannot be right', position)
  end subroutine read_physical

  !> The node tags of an element.
  subroutine get_tags(cursor, n, tag)
    type(byte_cursor_t), intent(inout) :: cursor
    integer, intent(in) :: n
    integer(int64), intent(inout) :: tag(:)
    integer :: i
    do i = 1, n
      call cursor%get_int(tag(i))
    end do
  end subroutine get_tags

  !> The block of a type and a physical group.
  subroutine find_block(cursor, builder, type, n_nodes, physical, element, position, block)
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_builder_t), intent(inout) :: builder
    !> gmsh's number of the type.
    integer(int64), intent(in) :: type
    !> Number of nodes of the type.
    integer, intent(in) :: n_nodes
    !> Tag of the physical group.
    integer(int64), intent(in) :: physical
    !> Tag of the element, and where it stands in the file.
    integer(int64), intent(in) :: element, position
    !> Index of the block.
    integer, intent(out) :: block
    integer :: kind, group
    block = 0
    call type_kind(cursor, type, element, position, kind)
    if (cursor%broken) return
    call builder%add_group(gmsh_type_dimension(int(type)), int(physical), group)
    call builder%add_block(kind, n_nodes, [group], block)
  end subroutine find_block
end module dotyk_mesh_gmsh_22
