!> The share of one rank in the surface layer of a body, as plain arrays that ranks exchange.
!>
!> Whole numbers: a head; kind and number of elements in the whole body of each block; block, element and face of each
!> facet; block, number, owner, tag and nodes of each element; number, origin, part, owner, global number and tag of
!> each node; tags of inner facets.
!> Reals: the diameter of the body, then the coordinates of the nodes.
module dotyk_mesh_layer_share
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_element, only: kind_nodes
  implicit none
  private

  type, public :: layer_share_t  !! The share of one rank in a layer, as plain arrays.
    integer(int64), allocatable :: number(:)  !! Whole numbers (any).
    real(dp), allocatable :: x(:)  !! Coordinates (any) [length].
  end type layer_share_t

  type, public :: whole_numbers_t  !! Numbers of the elements and nodes of one rank in the whole body.
    integer :: n_nodes = 0  !! Number of nodes of the whole body.
    integer, allocatable :: node(:)  !! Number of each node in the whole body, ascending (n_nodes of the rank).
    type(element_numbers_t), allocatable :: block(:)  !! Elements (n_blocks).
    integer :: rank = 0  !! The rank that owns the elements.
    integer, allocatable :: node_rank(:)  !! Owner of each node (n_nodes of the rank).
    integer, allocatable :: global_node(:)  !! Global number of each node, by owner, from 0 (n_nodes of the rank).
  end type whole_numbers_t

  type, public :: element_numbers_t  !! Elements of one block.
    integer :: n_elements = 0  !! Number of elements of the whole body.
    !> Number of each element in its block of the whole body, ascending (n_elements of the rank).
    integer, allocatable :: element(:)
  end type element_numbers_t

  public :: pack_layer, pack_items, no_elements, count_items, share_length

  !> Numbers at the head of a share: facets, elements, nodes, inner facets, blocks, dimension, nodes of the whole body,
  !> order elevation.
  integer, parameter, public :: head_length = 8
  !> Numbers of an element before its nodes, and of a node.
  integer, parameter, public :: element_length = 4, node_length = 6

contains

  !> Pack the share of a rank.
  subroutine pack_layer(mesh, whole, boundary, inner_tag, diameter, share)
    type(body_mesh_t), intent(in) :: mesh  !! Elements that the rank owns, and their nodes, maybe among others.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    type(boundary_candidates_t), intent(in) :: boundary  !! Faces of these elements on the boundary of the body.
    !> Tags of surface elements of the file that are faces of these elements, and not on the boundary (any).
    integer(int64), intent(in) :: inner_tag(:)
    real(dp), intent(in) :: diameter  !! Greatest extent of the whole body [length].
    type(layer_share_t), intent(out) :: share  !! The share.
    logical, allocatable :: has(:, :), at(:)
    integer :: i
    call no_elements(mesh, has)
    do i = 1, boundary%n
      has(boundary%element(i), boundary%block(i)) = .true.
    end do
    allocate (at(mesh%n_nodes()), source=.false.)
    call pack_items(mesh, whole, has, at, boundary, boundary%n, inner_tag, diameter, share)
  end subroutine pack_layer

  !> A mark for each element, none of them set.
  subroutine no_elements(mesh, has)
    type(body_mesh_t), intent(in) :: mesh  !! Elements.
    logical, allocatable, intent(out) :: has(:, :)  !! The marks (the greatest number of elements of a block, n_blocks).
    integer :: b
    allocate (has(max(0, maxval([(size(mesh%block(b)%tag), b=1, size(mesh%block))])), size(mesh%block)), source=.false.)
  end subroutine no_elements

  !> Pack elements with their nodes, other nodes, and facets.
  subroutine pack_items(mesh, whole, has, other, boundary, n_facets, inner_tag, diameter, share)
    type(body_mesh_t), intent(in) :: mesh  !! Elements that the rank owns, and their nodes, maybe among others.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    logical, intent(in) :: has(:, :)  !! Elements to pack (the greatest number of elements of a block, n_blocks).
    logical, intent(in) :: other(:)  !! Nodes to pack beside those of the elements (n_nodes).
    type(boundary_candidates_t), intent(in) :: boundary  !! Faces of elements.
    integer, intent(in) :: n_facets  !! Number of facets to pack: all or none.
    integer(int64), intent(in) :: inner_tag(:)  !! Tags of inner facets (any).
    real(dp), intent(in) :: diameter  !! Greatest extent of the whole body [length].
    type(layer_share_t), intent(out) :: share  !! The share.
    logical, allocatable :: at(:)
    integer, allocatable :: chosen(:)
    integer :: b, e, i, n, n_elements, n_numbers, n_file
    at = other
    do b = 1, size(mesh%block)
      do e = 1, size(mesh%block(b)%tag)
        if (has(e, b)) at(mesh%block(b)%node(:, e)) = .true.
      end do
    end do
    chosen = pack([(i, i=1, size(at))], at)
    n_elements = count(has)
    n_numbers = head_length + 3*size(mesh%block) + 3*n_facets + size(inner_tag) + node_length*size(chosen)
    do b = 1, size(mesh%block)
      n_numbers = n_numbers + count(has(:, b))*(element_length + size(mesh%block(b)%node, 1))
    end do
    allocate (share%number(n_numbers))
    n = 0
    call add([n_facets, n_elements, size(chosen), size(inner_tag), size(mesh%block), mesh%dimension, whole%n_nodes, &
              merge(1, 0, mesh%order_elevated)])
    do b = 1, size(mesh%block)
      call add([mesh%block(b)%kind, whole%block(b)%n_elements, mesh%block(b)%material])
    end do
    do i = 1, n_facets
      b = boundary%block(i)
      call add([b, whole%block(b)%element(boundary%element(i)), boundary%face(i)])
    end do
    do b = 1, size(mesh%block)
      do e = 1, size(mesh%block(b)%tag)
        if (.not. has(e, b)) cycle
        call add([b, whole%block(b)%element(e), whole%rank])
        call add_long(mesh%block(b)%tag(e))
        call add(whole%node(mesh%block(b)%node(:, e)))
      end do
    end do
    ! Nodes from order elevation come behind those of the file.
    n_file = mesh%n_nodes()
    if (mesh%order_elevated .and. allocated(mesh%mesh_node)) n_file = size(mesh%mesh_node)
    do i = 1, size(chosen)
      call add([whole%node(chosen(i)), merge(1, 0, chosen(i) <= n_file), boundary%root(chosen(i)), &
                whole%node_rank(chosen(i)), whole%global_node(chosen(i))])
      call add_long(mesh%node_tag(chosen(i)))
    end do
    do i = 1, size(inner_tag)
      call add_long(inner_tag(i))
    end do
    share%x = [diameter, reshape(mesh%x(:, chosen), [mesh%dimension*size(chosen)])]

  contains

    !> Add whole numbers.
    subroutine add(values)
      integer, intent(in) :: values(:)  !! The numbers (any).
      share%number(n + 1:n + size(values)) = values
      n = n + size(values)
    end subroutine add

    !> Add a tag.
    subroutine add_long(value)
      integer(int64), intent(in) :: value  !! The tag.
      n = n + 1
      share%number(n) = value
    end subroutine add_long
  end subroutine pack_items

  !> Number of facets, elements, nodes and inner facets in all shares.
  subroutine count_items(number, n)
    integer(int64), intent(in) :: number(:)  !! Whole numbers of the shares (any).
    integer, intent(out) :: n(4)  !! The counts.
    integer :: first
    n = 0
    first = 0
    do while (first < size(number))
      n = n + int(number(first + 1:first + 4))
      first = first + share_length(number, first)
    end do
  end subroutine count_items

  !> Whole numbers of a share.
  integer function share_length(number, first) result(length)
    integer(int64), intent(in) :: number(:)  !! Whole numbers of the shares (any).
    integer, intent(in) :: first  !! Numbers before the share.
    integer :: b, i, n_blocks
    n_blocks = int(number(first + 5))
    length = head_length + 3*n_blocks + 3*int(number(first + 1))
    do i = 1, int(number(first + 2))
      b = int(number(first + length + 1))
      length = length + element_length + kind_nodes(int(number(first + head_length + 3*b - 2)))
    end do
    length = length + node_length*int(number(first + 3)) + int(number(first + 4))
  end function share_length
end module dotyk_mesh_layer_share
