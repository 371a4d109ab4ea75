!> Nodes of a selection of a gmsh file: those that the selected elements use. $Nodes comes before $Elements, so that the
!> section is skipped first and read when the elements are known.
module dotyk_mesh_gmsh_selected_nodes
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_gmsh_common, only: check_block, read_counts
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: skip_nodes, read_selected_nodes

  type :: head_t  !! Head of a block of nodes of format 4.1.
    integer(int64) :: position = 0  !! Position in the file.
    integer(int64) :: n = 0  !! Number of nodes.
    integer(int64) :: n_reals = 3  !! Numbers of each node: three coordinates and parameters on the geometry.
  end type head_t

contains

  !> Skip the nodes.
  subroutine skip_nodes(cursor)
    !> Cursor behind '$Nodes' and, in a binary file, its line; before '$EndNodes' on return.
    type(byte_cursor_t), intent(inout) :: cursor
    character(*), parameter :: end_word = '$EndNodes'
    type(head_t) :: head
    integer(int64) :: n_blocks, n_nodes, n_read, i, first
    logical :: found
    first = cursor%position
    if (.not. cursor%binary) then
      call cursor%skip_past(end_word, found)
      if (found) then
        cursor%position = cursor%position - len(end_word)
      else
        call cursor%fail('the file ends without '//end_word//': it is truncated', first)
      end if
    else
      call read_counts(cursor, 32, 'nodes', n_blocks, n_nodes)
      n_read = 0
      do i = 1, n_blocks
        if (cursor%broken) return
        call read_head(cursor, n_read, n_nodes, head)
        call cursor%skip_bytes(8*(1 + head%n_reals)*head%n)
      end do
    end if
  end subroutine skip_nodes

  !> Read the nodes that the elements use, and give them to the elements.
  subroutine read_selected_nodes(cursor, builder)
    !> Cursor behind '$Nodes' and, in a binary file of format 4.1, its line.
    type(byte_cursor_t), intent(inout) :: cursor
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction; it has the elements, its nodes are set.
    integer, allocatable :: number(:)
    integer :: n, k
    if (cursor%broken) return
    allocate (builder%x(3, builder%used%n), builder%node_tag(builder%used%n), builder%file_node(builder%used%n))
    allocate (number(builder%used%n), source=0)
    n = 0
    call read_nodes_41(cursor, builder, number, n)
    if (cursor%broken) return
    k = findloc(number, 0, dim=1)
    if (k > 0) then
      call report_missing(cursor, builder, k)
      return
    end if
    call builder%use_nodes(number)
  end subroutine read_selected_nodes

  !> Number the next node in the order of the file, if an element uses it.
  subroutine number_node(cursor, builder, tag, file_node, position, number, n)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer(int64), intent(in) :: tag  !! Tag of the node.
    integer(int64), intent(in) :: file_node  !! Number of the node in the file.
    integer(int64), intent(in) :: position  !! Position of the node in the file.
    integer, intent(inout) :: number(:)  !! Index of each node of `used`, 0 before the file has it (used%n).
    integer, intent(inout) :: n  !! Number of nodes so far.
    integer :: k
    k = builder%used%find(tag)
    if (k == 0) return
    if (tag <= 0) call cursor%fail('node tag '//to_text(tag)//' is not positive', position)
    if (number(k) > 0) call cursor%fail('node tag '//to_text(tag)//' occurs a second time', position)
    if (cursor%broken) return
    n = n + 1
    number(k) = n
    builder%node_tag(n) = tag
    builder%file_node(n) = int(file_node)
  end subroutine number_node

  !> Read the nodes of format 4.1: blocks by entity, each with the tags first and the coordinates after them.
  subroutine read_nodes_41(cursor, builder, number, n)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor behind '$Nodes' and, in a binary file, its line.
    type(mesh_builder_t), intent(inout) :: builder  !! Mesh under construction.
    integer, intent(inout) :: number(:)  !! Index of each node of `used` (used%n).
    integer, intent(inout) :: n  !! Number of nodes.
    type(head_t) :: head
    integer(int64) :: n_nodes, n_blocks, n_read, tag, first, i, j, next
    real(dp) :: ignored
    integer :: k, before
    call read_counts(cursor, merge(32, 8, cursor%binary), 'nodes', n_blocks, n_nodes)
    n_read = 0
    do i = 1, n_blocks
      if (cursor%broken) return
      call read_head(cursor, n_read, n_nodes, head)
      before = n
      do j = 1, head%n
        if (.not. cursor%binary) call cursor%skip_blanks
        first = cursor%position
        call cursor%get_size(tag)
        if (cursor%broken) return
        call number_node(cursor, builder, tag, n_read - head%n + j, first, number, n)
      end do
      if (cursor%broken) return
      ! The coordinates of the nodes before + 1 .. n.
      first = cursor%position
      next = 1
      do k = before + 1, n
        j = builder%file_node(k) - (n_read - head%n)
        call skip_reals((j - next)*head%n_reals)
        call cursor%get_real(builder%x(1, k))
        call cursor%get_real(builder%x(2, k))
        call cursor%get_real(builder%x(3, k))
        call skip_reals(head%n_reals - 3)
        next = j + 1
        if (cursor%broken) then
          cursor%fault = cursor%fault//' (node '//to_text(builder%node_tag(k))//')'
          return
        end if
      end do
      call skip_reals((head%n - next + 1)*head%n_reals)
    end do
    if (n_read < n_nodes) call cursor%fail(to_text(n_nodes)//' nodes are announced, the blocks have '//to_text(n_read))

  contains

    !> Skip reals.
    subroutine skip_reals(m)
      integer(int64), intent(in) :: m  !! Their number.
      integer(int64) :: r
      if (cursor%binary) then
        call cursor%skip_bytes(8*m)
        return
      end if
      do r = 1, m
        call cursor%get_real(ignored)
      end do
    end subroutine skip_reals
  end subroutine read_nodes_41

  !> Read the head of a block of nodes of format 4.1.
  subroutine read_head(cursor, n_read, n_nodes, head)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    integer(int64), intent(inout) :: n_read  !! Nodes of the blocks before; with those of this one on return.
    integer(int64), intent(in) :: n_nodes  !! Nodes that are announced.
    type(head_t), intent(out) :: head  !! The head; no nodes after a fault.
    integer(int64) :: dimension, entity, parametric
    if (.not. cursor%binary) call cursor%skip_blanks
    head%position = cursor%position
    call cursor%get_int(dimension)
    call cursor%get_int(entity)
    call cursor%get_int(parametric)
    call cursor%get_size(head%n)
    if (dimension < 0 .or. dimension > 3) &
      call cursor%fail('an entity has the dimension '//to_text(dimension), head%position)
    if (parametric < 0 .or. parametric > 1) &
      call cursor%fail('expected 0 or 1 for parametric nodes, found '//to_text(parametric), head%position)
    call check_block(cursor, 'nodes', head%n, n_read, n_nodes, head%position)
    head%n_reals = 3 + parametric*dimension
    if (cursor%broken) head%n = 0
    n_read = n_read + head%n
  end subroutine read_head

  !> Fault: a node of an element that the file does not have.
  subroutine report_missing(cursor, builder, missing)
    type(byte_cursor_t), intent(inout) :: cursor  !! Cursor over the bytes of the file.
    type(mesh_builder_t), intent(in) :: builder  !! Mesh under construction.
    integer, intent(in) :: missing  !! Number of the node in `used`.
    integer :: b, e
    do b = 1, builder%n_blocks
      do e = 1, builder%block(b)%n
        if (all(builder%block(b)%node(:, e) /= missing)) cycle
        call cursor%fail('element '//to_text(builder%block(b)%tag(e))//' refers to node '// &
                         to_text(builder%used%tag(missing))//', which $Nodes does not have')
        return
      end do
    end do
  end subroutine report_missing
end module dotyk_mesh_gmsh_selected_nodes
