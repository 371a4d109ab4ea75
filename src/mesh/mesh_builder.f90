!> Incremental construction of a mesh while a file is read: nodes, physical groups, growing blocks of elements.
module dotyk_mesh_mesh_builder
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_mesh, only: mesh_selection_t, mesh_t, physical_group_t
  use dotyk_mesh_tag_map, only: growing_tag_map_t, tag_map_t
  implicit none
  private

  type :: growing_block_t  !! Block of elements with room for more.
    integer :: kind = 0  !! Element kind of `dotyk_mesh_element`.
    integer :: n = 0  !! Number of elements so far.
    integer, allocatable :: node(:, :)  !! Node indices (n_nodes of the kind, room).
    integer(int64), allocatable :: tag(:)  !! Element tags (room).
    integer, allocatable :: entity(:)  !! Geometric entities (room).
    integer, allocatable :: group(:)  !! Indices of physical groups, ascending (n_groups).
    integer :: n_in_file = 0  !! Number of elements in the file so far, where they are counted only.
  end type growing_block_t

  type, public :: mesh_builder_t  !! Mesh under construction.
    type(mesh_selection_t) :: selection  !! What is read of the file.
    !> Nodes that the elements use, where not all is read; elements have the numbers of this map until `use_nodes`.
    type(growing_tag_map_t) :: used
    integer, allocatable :: file_node(:)  !! Number of each node in the file, where not all is read (n_nodes).
    integer :: n_groups = 0  !! Number of physical groups so far.
    integer :: n_blocks = 0  !! Number of blocks so far.
    real(dp), allocatable :: x(:, :)  !! Nodal coordinates (3, n_nodes) [length].
    integer(int64), allocatable :: node_tag(:)  !! Node tags (n_nodes).
    type(tag_map_t) :: node_of_tag  !! Node index by tag.
    type(physical_group_t), allocatable :: group(:)  !! Physical groups (room).
    type(growing_block_t), allocatable :: block(:)  !! Blocks (room).
  contains
    procedure :: add_group => builder_add_group
    procedure :: add_block => builder_add_block
    procedure :: reserve => builder_reserve
    procedure :: add_element => builder_add_element
    procedure :: wants => builder_wants
    procedure :: use_nodes => builder_use_nodes
    procedure :: finish => builder_finish
  end type mesh_builder_t

contains

  !> Index of the physical group of a dimension and tag; it is added if it does not exist.
  subroutine builder_add_group(self, dimension, tag, index, name)
    class(mesh_builder_t), intent(inout) :: self
    integer, intent(in) :: dimension  !! Dimension of its elements, 0 to 3.
    integer, intent(in) :: tag  !! Tag in the file.
    integer, intent(out) :: index  !! Index of the group.
    character(*), intent(in), optional :: name  !! Name of an added group; the digits of the tag if absent or blank.
    type(physical_group_t), allocatable :: larger(:)
    integer :: i
    do index = 1, self%n_groups
      if (self%group(index)%dimension == dimension .and. self%group(index)%tag == tag) return
    end do
    if (.not. allocated(self%group)) allocate (self%group(16))
    if (self%n_groups == size(self%group)) then
      allocate (larger(2*self%n_groups))
      do i = 1, self%n_groups
        larger(i)%dimension = self%group(i)%dimension
        larger(i)%tag = self%group(i)%tag
        call move_alloc(self%group(i)%name, larger(i)%name)
      end do
      call move_alloc(larger, self%group)
    end if
    self%n_groups = self%n_groups + 1
    index = self%n_groups
    self%group(index)%dimension = dimension
    self%group(index)%tag = tag
    self%group(index)%name = to_text(tag)
    if (present(name)) then
      if (len_trim(name) > 0) self%group(index)%name = trim(name)
    end if
  end subroutine builder_add_group

  !> Index of the block of a kind whose elements belong to given groups; it is added if it does not exist.
  subroutine builder_add_block(self, kind, n_nodes, group, index)
    class(mesh_builder_t), intent(inout) :: self
    integer, intent(in) :: kind  !! Element kind.
    integer, intent(in) :: n_nodes  !! Number of nodes of the kind.
    integer, intent(in) :: group(:)  !! Indices of physical groups, ascending (n_groups).
    integer, intent(out) :: index  !! Index of the block.
    type(growing_block_t), allocatable :: larger(:)
    integer :: i
    do index = 1, self%n_blocks
      if (self%block(index)%kind /= kind .or. size(self%block(index)%group) /= size(group)) cycle
      if (all(self%block(index)%group == group)) return
    end do
    if (.not. allocated(self%block)) allocate (self%block(16))
    if (self%n_blocks == size(self%block)) then
      allocate (larger(2*self%n_blocks))
      do i = 1, self%n_blocks
        larger(i)%kind = self%block(i)%kind
        larger(i)%n = self%block(i)%n
        call move_alloc(self%block(i)%node, larger(i)%node)
        call move_alloc(self%block(i)%tag, larger(i)%tag)
        call move_alloc(self%block(i)%entity, larger(i)%entity)
        call move_alloc(self%block(i)%group, larger(i)%group)
        larger(i)%n_in_file = self%block(i)%n_in_file
      end do
      call move_alloc(larger, self%block)
    end if
    self%n_blocks = self%n_blocks + 1
    index = self%n_blocks
    self%block(index)%kind = kind
    self%block(index)%group = group
    allocate (self%block(index)%node(n_nodes, 0), self%block(index)%tag(0), self%block(index)%entity(0))
  end subroutine builder_add_block

  !> Whether elements are read.
  pure logical function builder_wants(self, dimension, group) result(wants)
    class(mesh_builder_t), intent(in) :: self
    integer, intent(in) :: dimension  !! Dimension of the elements.
    integer, intent(in) :: group(:)  !! Indices of their physical groups (n_groups).
    integer :: i
    wants = self%selection%everything .or. dimension < self%selection%dimension .and. .not. self%selection%counts_only
    if (wants .or. dimension /= self%selection%dimension) return
    do i = 1, size(group)
      wants = wants .or. self%selection%has_volume(self%group(group(i))%name)
    end do
  end function builder_wants

  !> Reserve room in a block.
  subroutine builder_reserve(self, index, n_more)
    class(mesh_builder_t), intent(inout) :: self
    integer, intent(in) :: index  !! Index of the block.
    integer, intent(in) :: n_more  !! Number of further elements; the room at least doubles when it grows.
    integer(int64) :: room
    associate (block => self%block(index))
      if (block%n + n_more <= size(block%tag)) return
      room = max(int(block%n, int64) + n_more, 2*int(block%n, int64), 64_int64)
      call resize(block, int(min(room, int(huge(0), int64))))
    end associate
  end subroutine builder_reserve

  !> Add an element, for which room is reserved.
  subroutine builder_add_element(self, index, tag, entity, node)
    class(mesh_builder_t), intent(inout) :: self
    integer, intent(in) :: index  !! Index of the block.
    integer(int64), intent(in) :: tag  !! Tag of the element.
    integer, intent(in) :: entity  !! Geometric entity of the element, 0 if unknown.
    integer, intent(in) :: node(:)  !! Node indices of the element (n_nodes of the kind).
    integer :: n
    n = self%block(index)%n + 1
    self%block(index)%n = n
    self%block(index)%tag(n) = tag
    self%block(index)%entity(n) = entity
    self%block(index)%node(:, n) = node
  end subroutine builder_add_element

  !> Give the nodes that were read to the elements, where not all is read.
  subroutine builder_use_nodes(self, number)
    class(mesh_builder_t), intent(inout) :: self
    integer, intent(in) :: number(:)  !! Index of each node of `used` (used%n).
    integer :: b, e
    do b = 1, self%n_blocks
      do e = 1, self%block(b)%n
        self%block(b)%node(:, e) = number(self%block(b)%node(:, e))
      end do
    end do
  end subroutine builder_use_nodes

  !> Move the contents to a mesh; the builder is empty afterwards.
  subroutine builder_finish(self, mesh)
    class(mesh_builder_t), intent(inout) :: self
    type(mesh_t), intent(inout) :: mesh  !! Mesh; `file` is unchanged.
    integer :: i
    call move_alloc(self%x, mesh%x)
    call move_alloc(self%node_tag, mesh%node_tag)
    if (allocated(self%file_node)) deallocate (self%file_node)
    allocate (mesh%group(self%n_groups), mesh%block(self%n_blocks))
    do i = 1, self%n_groups
      mesh%group(i)%dimension = self%group(i)%dimension
      mesh%group(i)%tag = self%group(i)%tag
      call move_alloc(self%group(i)%name, mesh%group(i)%name)
    end do
    do i = 1, self%n_blocks
      call resize(self%block(i), self%block(i)%n)
      mesh%block(i)%kind = self%block(i)%kind
      call move_alloc(self%block(i)%node, mesh%block(i)%node)
      call move_alloc(self%block(i)%tag, mesh%block(i)%tag)
      call move_alloc(self%block(i)%entity, mesh%block(i)%entity)
      call move_alloc(self%block(i)%group, mesh%block(i)%group)
      mesh%block(i)%n_in_file = self%block(i)%n_in_file
    end do
    if (allocated(self%group)) deallocate (self%group)
    if (allocated(self%block)) deallocate (self%block)
    self%n_groups = 0
    self%n_blocks = 0
  end subroutine builder_finish

  !> Change the room of a block.
  subroutine resize(block, room)
    type(growing_block_t), intent(inout) :: block  !! Block.
    integer, intent(in) :: room  !! New room, at least the number of elements.
    integer, allocatable :: node(:, :), entity(:)
    integer(int64), allocatable :: tag(:)
    if (size(block%tag) == room) return
    allocate (node(size(block%node, 1), room), tag(room), entity(room))
    node(:, :block%n) = block%node(:, :block%n)
    tag(:block%n) = block%tag(:block%n)
    entity(:block%n) = block%entity(:block%n)
    call move_alloc(node, block%node)
    call move_alloc(tag, block%tag)
    call move_alloc(entity, block%entity)
  end subroutine resize
end module dotyk_mesh_mesh_builder
