!> Geometric entities of the gmsh format MSH 4.1, text and binary, with their physical groups.
module dotyk_mesh_gmsh_entities
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  use dotyk_mesh_tag_map, only: tag_map_t
  implicit none
  private
  public :: read_entities_41, read_partitioned_entities_41, find_entity

  type :: entity_groups_t  !! Physical groups of the entities of one dimension.
    type(tag_map_t) :: index  !! Index of an entity by its tag.
    integer, allocatable :: start(:)  !! Start of the groups of each entity in `group` (n_entities + 1).
    integer, allocatable :: group(:)  !! Group indices, ascending and without repetition for each entity (room).
    integer, allocatable :: partition(:)  !! Partition of each entity, from 1; 0 without partitions (n_entities).
    !> Tag of the entity of which each one is a part, its own where the mesh is not partitioned (n_entities).
    integer, allocatable :: parent(:)
  end type entity_groups_t

  type, public :: entities_t  !! Geometric entities by dimension: points, curves, surfaces, volumes.
    logical :: known = .false.  !! Whether $Entities was read.
    logical :: partitioned = .false.  !! Whether the mesh is partitioned: $PartitionedEntities was read.
    type(entity_groups_t) :: dimension(0:3)  !! Groups by dimension (0:3).
    type(entity_groups_t) :: in_partition(0:3)  !! Groups of the parts of entities in partitions, by dimension (0:3).
  end type entities_t

  type, public :: entity_t  !! What elements have of their entity.
    integer :: tag = 0  !! Tag of the entity in the geometry.
    integer :: partition = 0  !! Partition, from 1; 0 where the mesh is not partitioned.
    integer, allocatable :: group(:)  !! Indices of its physical groups, ascending (n_groups).
  end type entity_t

contains

  !> Read $Entities: counts by dimension, then tag, box, physical tags and boundary of each entity.
  subroutine read_entities_41(cursor, builder, entities)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind '$Entities' and, in a binary file, its line.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; groups without a name are added.
    type(entities_t), intent(inout) :: entities  !! Geometric entities.
    call read_dimensions(cursor, builder, .false., entities%dimension)
    entities%known = .not. cursor%broken
  end subroutine read_entities_41

  !> Read $PartitionedEntities: number of partitions, ghost entities, then as $Entities, with the parent of each entity
  !> and its partitions.
  subroutine read_partitioned_entities_41(cursor, builder, entities)
    !> Cursor behind '$PartitionedEntities' and, in a binary file, its line.
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; groups without a name are added.
    type(entities_t), intent(inout) :: entities  !! Geometric entities.
    integer(int64) :: n_partitions, n_ghosts, ignored, i, first
    if (.not. cursor%binary) call cursor%skip_blanks
    first = cursor%position
    call cursor%get_size(n_partitions)
    call cursor%get_size(n_ghosts)
    call cursor%require(n_ghosts, merge(8, 4, cursor%binary), 'ghost entities', first)
    if (cursor%broken) return
    do i = 1, 2*n_ghosts
      call cursor%get_int(ignored)
    end do
    call read_dimensions(cursor, builder, .true., entities%in_partition)
    entities%partitioned = .not. cursor%broken
  end subroutine read_partitioned_entities_41

  !> Read the entities of all dimensions.
  subroutine read_dimensions(cursor, builder, partitioned, groups)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor at the counts of the entities.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; groups without a name are added.
    logical, intent(in) :: partitioned  !! Whether the entities have parents and partitions.
    type(entity_groups_t), intent(inout) :: groups(0:3)  !! Physical groups by dimension.
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
      call read_entities_of_dimension(cursor, builder, d, int(count(d)), partitioned, groups(d))
    end do
  end subroutine read_dimensions

  !> Read the entities of one dimension.
  subroutine read_entities_of_dimension(cursor, builder, dimension, n, partitioned, groups)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer, intent(in) :: dimension  !! Dimension of the entities, 0 to 3.
    integer, intent(in) :: n  !! Number of entities.
    logical, intent(in) :: partitioned  !! Whether the entities have parents and partitions.
    type(entity_groups_t), intent(inout) :: groups  !! Physical groups of the entities.
    integer(int64), allocatable :: tag(:), position(:)
    integer, allocatable :: larger(:)
    integer(int64) :: count, ignored, j, parent_dimension
    real(dp) :: coordinate
    integer :: i, k, twice, n_groups
    allocate (tag(n), position(n), groups%start(n + 1), groups%group(max(n, 16)))
    allocate (groups%partition(n), groups%parent(n), source=0)
    groups%start(1) = 1
    parent_dimension = dimension
    do i = 1, n
      if (cursor%broken) return
      if (.not. cursor%binary) call cursor%skip_blanks
      position(i) = cursor%position
      call cursor%get_int(tag(i))
      groups%parent(i) = int(tag(i))
      if (partitioned) call read_parent(cursor, position(i), parent_dimension, groups%parent(i), groups%partition(i))
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
      k = 0
      if (parent_dimension == dimension) then
        call read_groups(cursor, builder, dimension, int(count), groups%group(n_groups + 1:), k)
      else
        ! An interface of partitions inside an entity, whose groups it has in the file.
        do j = 1, count
          call cursor%get_int(ignored)
        end do
      end if
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

  !> Read the parent of an entity and its partitions.
  subroutine read_parent(cursor, position, dimension, tag, partition)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind the tag of the entity.
    integer(int64), intent(in) :: position  !! Position of the entity in the file.
    integer(int64), intent(out) :: dimension  !! Dimension of the parent.
    integer, intent(out) :: tag  !! Tag of the parent.
    integer, intent(out) :: partition  !! The first partition, from 1; 0 where there is none.
    integer(int64) :: count, value, j
    call cursor%get_int(dimension)
    call cursor%get_int(value)
    tag = int(value)
    call cursor%get_size(count)
    call cursor%require(count, merge(4, 2, cursor%binary), 'partitions of an entity', position)
    partition = 0
    if (cursor%broken) return
    do j = 1, count
      call cursor%get_int(value)
      if (j == 1) partition = int(max(0_int64, value))
    end do
  end subroutine read_parent

  !> Read the physical groups of one entity, ascending and without repetition. A minus sign in the file marks reversed
  !> orientation.
  subroutine read_groups(cursor, builder, dimension, count, group, n)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer, intent(in) :: dimension  !! Dimension of the entity, 0 to 3.
    integer, intent(in) :: count  !! Number of physical tags.
    integer, intent(inout) :: group(:)  !! Group indices; the first n are set (at least count).
    integer, intent(out) :: n  !! Number of groups.
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

  !> Find the entity of a block of elements; without groups if the file has no entities.
  subroutine find_entity(cursor, entities, dimension, tag, position, entity)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(entities_t), intent(in) :: entities  !! Geometric entities.
    integer, intent(in) :: dimension  !! Dimension of the entity, 0 to 3.
    integer(int64), intent(in) :: tag  !! Tag of the entity.
    integer(int64), intent(in) :: position  !! Position of the block that names it.
    type(entity_t), intent(out) :: entity  !! The entity.
    ! Negative numbers are of elements that mesh2msh grouped, without a geometry.
    entity%tag = int(max(tag, 0_int64))
    allocate (entity%group(0))
    if (entities%partitioned) then
      call take(entities%in_partition(dimension))
      if (entity%partition >= 0) return
    end if
    if (.not. entities%known) return
    call take(entities%dimension(dimension))
    if (entity%partition >= 0) return
    call cursor%fail('elements belong to the entity of dimension '//to_text(dimension)//' and tag '//to_text(tag)// &
                     ', which $Entities does not have', position)

  contains

    !> Take the entity from a list; the partition is -1 where it is not there.
    subroutine take(groups)
      type(entity_groups_t), intent(in) :: groups  !! Entities of the dimension.
      integer :: place
      place = groups%index%find(tag)
      entity%partition = -1
      if (place == 0) return
      entity%partition = groups%partition(place)
      entity%tag = max(groups%parent(place), 0)
      entity%group = groups%group(groups%start(place):groups%start(place + 1) - 1)
    end subroutine take
  end subroutine find_entity
end module dotyk_mesh_gmsh_entities
