!> Checks of nodes, element types and node tags that the readers of the gmsh formats 2.2 and 4.1 share.
module dotyk_mesh_gmsh_common
  use dotyk_base_byte_cursor, only: byte_cursor_t
  use dotyk_base_kinds, only: int64
  use dotyk_base_text, only: to_text
  use dotyk_mesh_element, only: kind_of_gmsh_type
  use dotyk_mesh_gmsh_type, only: gmsh_type_nodes, gmsh_type_name, gmsh_type_help
  use dotyk_mesh_mesh_builder, only: mesh_builder_t
  implicit none
  private
  public :: allocate_nodes, index_nodes, find_nodes, type_nodes, type_kind

contains

  !> Allocate the nodes, whose number was checked against the size of the file.
  subroutine allocate_nodes(cursor, builder, n_nodes, position)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction.
    type(mesh_builder_t), intent(inout) :: builder
    !> Number of nodes.
    integer(int64), intent(in) :: n_nodes
    !> Position of each node in the file, to be filled in (n_nodes).
    integer(int64), allocatable, intent(out) :: position(:)
    if (cursor%broken) return
    allocate (builder%x(3, n_nodes), builder%node_tag(n_nodes), position(n_nodes))
  end subroutine allocate_nodes

  !> Index the nodes by their tags, which must be positive and unique.
  subroutine index_nodes(cursor, builder, position)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction.
    type(mesh_builder_t), intent(inout) :: builder
    !> Position of each node in the file (n_nodes).
    integer(int64), intent(in) :: position(:)
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

  !> Indices of the nodes of an element.
  subroutine find_nodes(cursor, builder, tag, element, position, node)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Mesh under construction.
    type(mesh_builder_t), intent(in) :: builder
    !> Node tags (n).
    integer(int64), intent(in) :: tag(:)
    !> Tag of the element, for messages.
    integer(int64), intent(in) :: element
    !> Position of the element in the file, for messages.
    integer(int64), intent(in) :: position
    !> Node indices (n).
    integer, intent(out) :: node(:)
    integer :: i
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
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Type number of gmsh.
    integer(int64), intent(in) :: type
    !> Tag of the (first) element of this type.
    integer(int64), intent(in) :: element
    !> Position of the element in the file, for messages.
    integer(int64), intent(in) :: position
    !> Number of nodes; 0 after a fault.
    integer, intent(out) :: n_nodes
    n_nodes = 0
    if (cursor%broken) return
    if (abs(type) < huge(0)) n_nodes = gmsh_type_nodes(int(type))
    if (n_nodes == 0) &
      call cursor%fail('element '//to_text(element)//' is of type '//to_text(type)// &
                       ', which is not known: only elements of order 1 and 2 are supported', position)
  end subroutine type_nodes

  !> Element kind of an element that is kept, which must be supported.
  subroutine type_kind(cursor, type, element, position, kind)
    !> Cursor over the bytes of the file.
    type(byte_cursor_t), intent(inout) :: cursor
    !> Type number of gmsh, a known one.
    integer(int64), intent(in) :: type
    !> Tag of the (first) element of this type.
    integer(int64), intent(in) :: element
    !> Position of the element in the file, for messages.
    integer(int64), intent(in) :: position
    !> Element kind of `dotyk_mesh_element`; 0 after a fault.
    integer, intent(out) :: kind
    kind = 0
    if (cursor%broken) return
    kind = kind_of_gmsh_type(int(type))
    if (kind == 0) &
      call cursor%fail('element '//to_text(element)//' is a '//gmsh_type_name(int(type))//' (gmsh type '// &
                       to_text(type)//'): '//gmsh_type_help(int(type)), position)
  end subroutine type_kind
end module dotyk_mesh_gmsh_common
