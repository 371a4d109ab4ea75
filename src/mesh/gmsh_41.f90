!> Nodes and elements of the gmsh format MSH 4.1, text and binary.
module dotyk_mesh_gmsh_41
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_gmsh_common, only: allocate_nodes, check_block, find_nodes, index_nodes, read_counts, type_kind, &
    type_nodes
  use dotyk_mesh_gmsh_entities, only: entities_t, entity_t, find_entity
  use dotyk_mesh_gmsh_type, only: gmsh_point
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: read_nodes_41, read_elements_41

  integer, parameter :: max_nodes = 125  !! Nodes of the largest known element type.

contains

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
      kept = size(entity%group) > 0 .and. type /= gmsh_point
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
end module dotyk_mesh_gmsh_41
