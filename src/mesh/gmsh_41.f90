!> Entities, nodes and elements of the gmsh format MSH 4.1, text and binary.
module dotyk_mesh_gmsh_41
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_gmsh_common, only: allocate_nodes, index_nodes, find_nodes, type_nodes, type_kind
  use dotyk_mesh_gmsh_type, only: gmsh_point
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  use dotyk_mesh_tag_map, only: tag_map_t
  implicit none
  private
  public :: read_entities_41, read_nodes_41, read_elements_41

  !> Nodes of the largest known element type.
  integer, parameter :: max_nodes = 125

  !> Physical groups of the entities of one dimension.
  type :: entity_groups_t
    !> Index of an entity by its tag.
    type(tag_map_t) :: index
    !> Start of the groups of each entity in `group` (n_entities + 1).
    integer, allocatable :: start(:)
    !> Group indices, ascending and without repetition for each entity (room).
    integer, allocatable :: group(:)
  end type entity_groups_t

  !> Geometric entities by dimension: points, curves, surfaces, volumes.
  type, public :: entities_t
    !> Whether $Entities was read.
    logical :: known = .false.
    !> Whether the mesh is partitioned, with entities of another section.
    logical :: partitioned = .false.
    !> Groups by dimension (0:3).
    type(entity_groups_t) :: dimension(0:3)
  end type entities_t

contains

  !> Read $Entities: counts by dimension, then tag, box, physical tags and boundary of each entity.
  subroutine read_entities_41(cursor, builder, entities)
    !> Cursor behind '$Entities' and, in a binary file, its line.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction; groups without a name are added.
    type(mesh_builder_t), intent(inout) :: builder
    !> Geometric entities.
    type(entities_t), intent(inout) :: entities
    integer(int64) :: count(0:3), first
    integer :: d
    if (.not. cursor%binary) call cursor%skip_blanks
    first = cursor%position
    do d = 0, 3
      call cursor%get_size(count(d))
    end do
    do d = 0, 3
      call cursor%require(count(d), merge(merge(36, 68, d == 0), merge(10, 18, d == 0), cursor%binary), &
                          'entities of dimension '//to_text(d), first)
      if (cursor%broken) return
      call read_entities_of_dimension(cursor, builder, d, int(count(d)), entities%dimension(d))
    end do
    entities%known = .not. cursor%broken
  end subroutine read_entities_41

  !> Read the entities of one dimension.
  subroutine read_entities_of_dimension(cursor, builder, dimension, n, groups)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction.
    type(mesh_builder_t), intent(inout) :: builder
    !> Dimension of the entities, 0 to 3.
    integer, intent(in) :: dimension
    !> Number of entities.
    integer, intent(in) :: n
    !> Physical groups of the entities.
    type(entity_groups_t), intent(inout) :: groups
    integer(int64), allocatable :: tag(:), position(:)
    integer, allocatable :: larger(:)
    integer(int64) :: count, ignored, j
    real(dp) :: coordinate
    integer :: i, k, twice, n_groups
    allocate (tag(n), position(n), groups%start(n + 1), groups%group(max(n, 16)))
    groups%start(1) = 1
    do i = 1, n
      if (cursor%broken) return
      if (.not. cursor%binary) call cursor%skip_blanks
      position(i) = cursor%position
      call cursor%get_int(tag(i))
      do k = 1, merge(3, 6, dimension == 0)
        call cursor%get_real(coordinate)
      end do
      call cursor%get_size(count)
      call cursor%require(count, merge(4, 2, cursor%binary), 'physical tags of an entity', position(i))
      if (cursor%broken) return
      n_groups = groups%start(i) - 1
      if (n_groups + count > size(groups%group)) then
        allocate (larger(2*(n_groups + int(count))))
        larger(:n_groups) = groups%group(:n_groups)
        call move_alloc(larger, groups%group)
      end if
      call read_groups(cursor, builder, dimension, int(count), groups%group(n_groups + 1:), k)
      groups%start(i + 1) = groups%start(i) + k
      if (dimension == 0) cycle
      call cursor%get_size(count)
      call cursor%require(count, merge(4, 2, cursor%binary), 'bounding entities', position(i))
      if (cursor%broken) return
      do j = 1, count
        call cursor%get_int(ignored)
      end do
    end do
    if (cursor%broken) return
    call groups%index%init(tag, twice)
    if (twice > 0) &
      call cursor%fail('the entity of dimension '//to_text(dimension)//' and tag '//to_text(tag(twice))// &
                       ' occurs a second time', position(twice))
  end subroutine read_entities_of_dimension

  !> Read the physical groups of one entity, ascending and without repetition. A minus sign in the file marks reversed
  !> orientation.
  subroutine read_groups(cursor, builder, dimension, count, group, n)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction.
    type(mesh_builder_t), intent(inout) :: builder
    !> Dimension of the entity, 0 to 3.
    integer, intent(in) :: dimension
    !> Number of physical tags.
    integer, intent(in) :: count
    !> Group indices; the first n are set (at least count).
    integer, intent(inout) :: group(:)
    !> Number of groups.
    integer, intent(out) :: n
    integer(int64) :: physical
    integer :: i, j, new
    n = 0
    do i = 1, count
      call cursor%get_int(physical)
      if (abs(physical) > huge(0)) call cursor%fail('the physical tag '//to_text(physical)//' cannot be right')
      if (cursor%broken) return
      call builder%add_group(dimension, abs(int(physical)), new)
      if (any(group(:n) == new)) cycle
      j = n
      do while (j > 0)
        if (group(j) < new) exit
        group(j + 1) = group(j)
        j = j - 1
      end do
      group(j + 1) = new
      n = n + 1
    end do
  end subroutine read_groups

  !> Read $Nodes: blocks by entity, each with the tags first and the coordinates after them.
  subroutine read_nodes_41(cursor, builder)
    !> Cursor behind '$Nodes' and, in a binary file, its line.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction; its nodes are set.
    type(mesh_builder_t), intent(inout) :: builder
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
    !> Cursor behind '$Elements' and, in a binary file, its line.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction; it has the nodes, its blocks are set.
    type(mesh_builder_t), intent(inout) :: builder
    !> Geometric entities.
    type(entities_t), intent(in) :: entities
    !> Number of elements in the file, points included.
    integer(int64), intent(out) :: n_elements
    integer(int64) :: n_blocks, n_read, n, dimension, entity, type, first, i
    integer :: n_nodes, kind, place, block
    logical :: kept
    call read_counts(cursor, merge(16, 4, cursor%binary), 'elements', n_blocks, n_elements)
    n_read = 0
    do i = 1, n_blocks
      if (cursor%broken) return
      if (.not. cursor%binary) call cursor%skip_blanks
      first = cursor%position
      call cursor%get_int(dimension)
      call cursor%get_int(entity)
      call cursor%get_int(type)
      call cursor%get_size(n)
      if (dimension < 0 .or. dimension > 3) call cursor%fail('an entity has the dimension '//to_text(dimension), first)
      call check_block(cursor, 'elements', n, n_read, n_elements, first)
      if (cursor%broken) return
      if (n == 0) cycle
      call type_nodes(cursor, type, next_tag(cursor), first, n_nodes)
      call find_entity(cursor, entities, int(dimension), entity, first, place)
      if (cursor%broken) return
      kept = place > 0 .and. type /= gmsh_point
      if (kept) kept = entities%dimension(dimension)%start(place + 1) > entities%dimension(dimension)%start(place)
      block = 0
      if (kept) then
        call type_kind(cursor, type, next_tag(cursor), first, kind)
        if (cursor%broken) return
        associate (groups => entities%dimension(dimension))
          call builder%add_block(kind, n_nodes, groups%group(groups%start(place):groups%start(place + 1) - 1), block)
        end associate
        call cursor%require(n, merge(8, 2, cursor%binary)*(n_nodes + 1), 'elements', first)
        if (cursor%broken) return
        call builder%reserve(block, int(n))
      end if
      call read_block(cursor, builder, block, int(entity), n, n_nodes)
      n_read = n_read + n
    end do
    if (n_read < n_elements) &
      call cursor%fail(to_text(n_elements)//' elements are announced, the blocks have '//to_text(n_read))
  end subroutine read_elements_41

  !> Read the elements of one block of the file.
  subroutine read_block(cursor, builder, block, entity, n, n_nodes)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction.
    type(mesh_builder_t), intent(inout) :: builder
    !> Block of the builder that receives the elements, 0 for none.
    integer, intent(in) :: block
    !> Tag of the geometric entity.
    integer, intent(in) :: entity
    !> Number of elements.
    integer(int64), intent(in) :: n
    !> Number of nodes of each element.
    integer, intent(in) :: n_nodes
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

  !> Read the four numbers at the head of $Nodes and $Elements: blocks, items, least and largest tag.
  subroutine read_counts(cursor, least_bytes, what, n_blocks, count)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Fewest bytes of one item.
    integer, intent(in) :: least_bytes
    !> Name of the items, for messages.
    character(*), intent(in) :: what
    !> Number of blocks; 0 after a fault.
    integer(int64), intent(out) :: n_blocks
    !> Number of items; 0 after a fault.
    integer(int64), intent(out) :: count
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
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Name of the items, for messages.
    character(*), intent(in) :: what
    !> Items of the block.
    integer(int64), intent(in) :: n
    !> Items of the previous blocks.
    integer(int64), intent(in) :: n_read
    !> Items that are announced.
    integer(int64), intent(in) :: n_all
    !> Position of the block in the file.
    integer(int64), intent(in) :: position
    if (n >= 0 .and. n <= n_all - n_read) return
    call cursor%fail('a block announces '//to_text(n)//' '//what//', where '//to_text(n_all - n_read)//' of '// &
                     to_text(n_all)//' are left', position)
  end subroutine check_block

  !> Index of an entity among those of its dimension, 0 if the file has no entities.
  subroutine find_entity(cursor, entities, dimension, tag, position, place)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Geometric entities.
    type(entities_t), intent(in) :: entities
    !> Dimension of the entity, 0 to 3.
    integer, intent(in) :: dimension
    !> Tag of the entity.
    integer(int64), intent(in) :: tag
    !> Position of the block that names it.
    integer(int64), intent(in) :: position
    !> Index of the entity.
    integer, intent(out) :: place
    place = 0
    if (.not. entities%known) return
    place = entities%dimension(dimension)%index%find(tag)
    if (place > 0) return
    if (entities%partitioned) then
      call cursor%fail('the mesh is partitioned: save it without partitions (gmsh without -part)', position)
    else
      call cursor%fail('elements belong to the entity of dimension '//to_text(dimension)//' and tag '//to_text(tag)// &
                       ', which $Entities does not have', position)
    end if
  end subroutine find_entity

  !> The next number, which stays unread: the tag of the first element of a block, for messages.
  integer(int64) function next_tag(cursor) result(tag)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    integer(int64) :: position
    position = cursor%position
    call cursor%get_size(tag)
    cursor%position = position
  end function next_tag
end module dotyk_mesh_gmsh_41
