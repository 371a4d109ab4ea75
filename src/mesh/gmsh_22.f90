!> Nodes and elements of the gmsh format MSH 2.2, text and binary.
module dotyk_mesh_gmsh_22
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_gmsh_common, only: allocate_nodes, index_nodes, find_nodes, type_nodes, type_kind
  use dotyk_mesh_gmsh_type, only: gmsh_point, gmsh_type_dimension
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: read_nodes_22, read_elements_22, read_count_22

  !> Upper limit of the number of tags of an element (partitions follow the first three).
  integer, parameter :: max_tags = 1000
  integer, parameter :: max_nodes = 125  !! Nodes of the largest known element type.

contains

  !> Read $Nodes: a count, then tag and coordinates of each node.
  subroutine read_nodes_22(cursor, builder)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind the word '$Nodes'.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; its nodes are set.
    integer(int64), allocatable :: position(:)
    integer(int64) :: n_nodes, first, i
    call read_count_22(cursor, merge(28, 8, cursor%binary), 'nodes', n_nodes)
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

  !> Read $Elements: a count, then tag, type, tags (the first is the physical group) and nodes of each element; in
  !> binary files under headers of type, number of elements and number of tags.
  subroutine read_elements_22(cursor, builder, n_elements)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind the word '$Elements'.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; it has the nodes, its blocks are set.
    integer(int64), intent(out) :: n_elements  !! Number of elements in the file, points included.
    integer(int64) :: tag(max_nodes), element, type, n_tags, physical, entity, last_type, last_physical, n_left
    integer(int64) :: first, i
    integer :: node(max_nodes), n_nodes, block, place, partition
    place = 0
    call read_count_22(cursor, merge(12, 6, cursor%binary), 'elements', n_elements)
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
          if (n_left < 1 .or. n_left > n_elements - i + 1) &
            call cursor%fail('a header announces '//to_text(n_left)//' elements, where '// &
                             to_text(n_elements - i + 1)//' of '//to_text(n_elements)//' are left', first)
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
      call read_group(cursor, element, first, n_tags, physical, entity, partition)
      call read_tags(cursor, n_nodes, tag)
      if (cursor%broken) return
      if (physical == 0 .or. type == gmsh_point) cycle
      if (block == 0 .or. physical /= last_physical) then
        call find_block(cursor, builder, type, n_nodes, physical, element, first, block)
        last_physical = physical
      end if
      if (.not. builder%selection%everything) then
        call count_element(builder, block, int(type), i, n_elements, partition, place)
        if (place == 0) cycle
      end if
      call find_nodes(cursor, builder, tag(:n_nodes), element, first, node(:n_nodes))
      if (cursor%broken) return
      call builder%reserve(block, 1)
      call builder%add_element(block, element, int(min(entity, int(huge(0), int64))), node(:n_nodes), place)
    end do
  end subroutine read_elements_22

  !> Count an element of a selection.
  subroutine count_element(builder, block, type, i, n_elements, partition, place)
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer, intent(in) :: block  !! Block of the builder to which the element belongs.
    integer, intent(in) :: type  !! Type number of gmsh.
    integer(int64), intent(in) :: i  !! Number of the element in the file.
    integer(int64), intent(in) :: n_elements  !! Number of elements in the file.
    integer, intent(in) :: partition  !! Partition of the element, from 1; 0 where the file is not partitioned.
    integer, intent(out) :: place  !! Its number among those of the block; 0 where it is not read.
    integer(int64) :: first, last
    place = 0
    if (.not. builder%wants(gmsh_type_dimension(type), builder%block(block)%group)) return
    builder%block(block)%n_in_file = builder%block(block)%n_in_file + 1
    if (gmsh_type_dimension(type) == builder%selection%dimension) then
      call builder%selection%limits(n_elements, partition, first, last)
      if (i <= first .or. i > last) return
    end if
    place = builder%block(block)%n_in_file
  end subroutine count_element

  !> Read a count on a line of its own, as text in binary files too, after which binary numbers begin.
  subroutine read_count_22(cursor, least_bytes, what, count)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer, intent(in) :: least_bytes  !! Fewest bytes of one counted item.
    character(*), intent(in) :: what  !! Name of the items, for messages.
    integer(int64), intent(out) :: count  !! Count; 0 after a fault.
    integer(int64) :: first
    call cursor%skip_blanks
    first = cursor%position
    call cursor%get_text_integer(count)
    if (cursor%binary) call cursor%end_line
    call cursor%require(count, least_bytes, what, first)
    if (cursor%broken) count = 0
  end subroutine read_count_22

  !> Read the tags of an element: the physical group, the geometric entity, and others.
  subroutine read_group(cursor, element, position, n_tags, physical, entity, partition)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer(int64), intent(in) :: element  !! Tag of the element, for messages.
    integer(int64), intent(in) :: position  !! Position of the element in the file, for messages.
    integer(int64), intent(in) :: n_tags  !! Number of tags.
    !> Tag of the physical group, 0 if there is none. A minus sign in the file marks reversed orientation.
    integer(int64), intent(out) :: physical
    integer(int64), intent(out) :: entity  !! Tag of the geometric entity, 0 if there is none.
    integer, intent(out) :: partition  !! Partition, from 1; 0 where the mesh is not partitioned.
    integer(int64) :: value, i
    partition = 0
    physical = 0
    entity = 0
    if (n_tags < 0 .or. n_tags > max_tags) then
      call cursor%fail('element '//to_text(element)//' has '//to_text(n_tags)//' tags, which cannot be right', position)
      return
    end if
    do i = 1, n_tags
      call cursor%get_int(value)
      if (i == 1) physical = abs(value)
      if (i == 2) entity = abs(value)
      ! The third tag counts the partitions; those after the first have the element as a ghost.
      if (i == 4) partition = int(min(abs(value), int(huge(0), int64)))
    end do
    if (physical > huge(0)) &
      call cursor%fail('element '//to_text(element)//' has the physical tag '//to_text(physical)// &
                       ', which cannot be right', position)
  end subroutine read_group

  !> Read the node tags of an element.
  subroutine read_tags(cursor, n, tag)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer, intent(in) :: n  !! Number of nodes.
    integer(int64), intent(inout) :: tag(:)  !! Node tags (at least n).
    integer :: i
    do i = 1, n
      call cursor%get_int(tag(i))
    end do
  end subroutine read_tags

  !> Find or add the block of an element type and a physical group.
  subroutine find_block(cursor, builder, type, n_nodes, physical, element, position, block)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer(int64), intent(in) :: type  !! Type number of gmsh.
    integer, intent(in) :: n_nodes  !! Number of nodes of the type.
    integer(int64), intent(in) :: physical  !! Tag of the physical group.
    integer(int64), intent(in) :: element  !! Tag of the element, for messages.
    integer(int64), intent(in) :: position  !! Position of the element in the file, for messages.
    integer, intent(out) :: block  !! Index of the block.
    integer :: kind, group
    block = 0
    call type_kind(cursor, type, element, position, kind)
    if (cursor%broken) return
    call builder%add_group(gmsh_type_dimension(int(type)), int(physical), group)
    call builder%add_block(kind, n_nodes, [group], block)
  end subroutine find_block
end module dotyk_mesh_gmsh_22
