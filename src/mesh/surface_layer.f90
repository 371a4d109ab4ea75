!> The surface layer of a body: the elements that have a face on its boundary, with their nodes. It has the size of the
!> surface, is the same on all ranks, and stands in for the mesh of the body wherever contact looks at one: search for
!> pairs, projections, gaps, sizes of facets, penetration.
!>
!> Facets, elements and nodes are in the order of the whole body, so that all that follows from the surface is the same
!> to the bit as from the whole mesh. Interior nodes are missing: what depends on them is kept as a number (`diameter`,
!> `low`, `high`), and named surfaces are found by `dotyk_mesh_layer_surface`.
!>
!> The way: each rank packs its share of the boundary into two plain arrays (`dotyk_mesh_layer_share`); those of all
!> ranks, one after the other in any order, give the layer (`unpack`).
module dotyk_mesh_surface_layer
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_sort, only: sort_order
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes, max_facet_nodes
  use dotyk_mesh_layer_share, only: count_items, element_length, head_length, node_length, share_length, &
    whole_numbers_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: element_rank_t  !! Owners of the elements of one block.
    integer, allocatable :: of(:)  !! Rank of each element (n_elements).
  end type element_rank_t

  type, public :: surface_layer_t  !! The surface layer of a body.
    !> Elements with a face on the boundary, and their nodes. The blocks are those of the whole body. `mesh_node` is not
    !> allocated: nodes are found by their tags.
    type(body_mesh_t) :: mesh
    type(whole_numbers_t) :: whole  !! Numbers in the whole body.
    type(surface_t) :: boundary  !! The boundary, in the numbers of `mesh`.
    type(element_rank_t), allocatable :: element_rank(:)  !! Owner of each element (n_blocks).
    logical, allocatable :: in_file(:)  !! Whether each node is in the mesh file, not from order elevation (n_nodes).
    !> Connected part of the body to which each node belongs, in the order of their first nodes (n_nodes).
    integer, allocatable :: component(:)
    integer, allocatable :: root(:)  !! The lowest node of that part, by its number in the whole body (n_nodes).
    integer :: n_components = 0  !! Number of connected parts.
    !> Tags of the elements of surfaces that lie inside the body, ascending (any).
    integer(int64), allocatable :: inner_tag(:)
    real(dp) :: diameter = 0  !! Greatest extent of the whole body (`body_mesh_t%diameter`) [length].
  contains
    procedure :: unpack => layer_unpack
  end type surface_layer_t

contains

  !> Make the layer from the shares of all ranks.
  subroutine layer_unpack(self, file, number, x)
    class(surface_layer_t), intent(out) :: self
    character(*), intent(in) :: file  !! File of the mesh, for messages.
    integer(int64), intent(in) :: number(:)  !! Whole numbers of the shares, one share after the other (any).
    real(dp), intent(in) :: x(:)  !! Their coordinates, in the same order (any) [length].
    integer :: n(4), n_blocks
    self%mesh%file = file
    self%mesh%dimension = int(number(6))
    self%whole%n_nodes = int(number(7))
    self%mesh%order_elevated = number(8) == 1
    n_blocks = int(number(5))
    allocate (self%mesh%block(n_blocks), self%whole%block(n_blocks), self%element_rank(n_blocks))
    self%mesh%block%kind = int(number(head_length + 1:head_length + 3*n_blocks:3))
    self%whole%block%n_elements = int(number(head_length + 2:head_length + 3*n_blocks:3))
    self%mesh%block%material = int(number(head_length + 3:head_length + 3*n_blocks:3))
    call count_items(number, n)
    call collect(self, number, x, n)
  end subroutine layer_unpack

  !> Collect facets, elements and nodes of all shares, and put them in the order of the whole body.
  subroutine collect(self, number, x, n)
    type(surface_layer_t), intent(inout) :: self  !! The layer; its kinds and counts of the whole body are known.
    integer(int64), intent(in) :: number(:)  !! Whole numbers of the shares (any).
    real(dp), intent(in) :: x(:)  !! Their coordinates (any) [length].
    integer, intent(in) :: n(4)  !! Number of facets, elements, nodes and inner facets in all shares.
    integer, allocatable :: facet(:, :), element(:, :), start(:), node(:, :), order(:), kept(:)
    integer(int64), allocatable :: tag(:), node_tag(:)
    real(dp), allocatable :: position(:, :)
    integer :: f, e, v, t, b, i, j, at, at_x, last, n_nodes
    allocate (facet(3, n(1)), element(3, n(2)), start(n(2)), node(node_length - 1, n(3)), node_tag(n(3)), tag(n(4)))
    allocate (position(self%mesh%dimension, n(3)))
    f = 0
    e = 0
    v = 0
    t = 0
    at = 0
    at_x = 0
    do while (at < size(number))
      last = at + share_length(number, at)
      associate (head => int(number(at + 1:at + head_length)))
        self%diameter = max(self%diameter, x(at_x + 1))
        at = at + head_length + 3*head(5)
        do i = 1, head(1)
          f = f + 1
          facet(:, f) = int(number(at + 1:at + 3))
          at = at + 3
        end do
        do i = 1, head(2)
          e = e + 1
          element(:, e) = int(number(at + 1:at + 3))
          start(e) = at + element_length
          at = at + element_length + kind_nodes(self%mesh%block(element(1, e))%kind)
        end do
        do i = 1, head(3)
          v = v + 1
          node(:, v) = int(number(at + 1:at + node_length - 1))
          node_tag(v) = number(at + node_length)
          position(:, v) = x(at_x + 2 + (i - 1)*size(position, 1):at_x + 1 + i*size(position, 1))
          at = at + node_length
        end do
        do i = 1, head(4)
          t = t + 1
          tag(t) = number(at + 1)
          at = at + 1
        end do
        at_x = at_x + 1 + head(3)*size(position, 1)
      end associate
      if (at /= last) error stop 'a share of a surface layer is damaged'
    end do
    ! Ranks may have the same node: it is kept once.
    allocate (order(n(3)))
    call sort_order(node(1, :), order)
    kept = pack(order, [(j == 1 .or. node(1, order(j)) /= node(1, order(max(1, j - 1))), j=1, n(3))])
    n_nodes = size(kept)
    self%whole%node = node(1, kept)
    self%in_file = node(2, kept) == 1
    self%whole%node_rank = node(4, kept)
    self%whole%global_node = node(5, kept)
    self%mesh%x = position(:, kept)
    self%mesh%node_tag = node_tag(kept)
    self%root = node(3, kept)
    call number_components(self%root, self%component, self%n_components)
    do b = 1, size(self%mesh%block)
      call set_block(self, b, number, element, start)
    end do
    call set_boundary(self, facet)
    deallocate (order)
    allocate (order(n(4)))
    call sort_order(real(tag, dp), order)
    self%inner_tag = pack(tag(order), [(j == 1 .or. tag(order(j)) /= tag(order(max(1, j - 1))), j=1, n(4))])
  end subroutine collect

  !> Number the connected parts in the order of their lowest nodes.
  subroutine number_components(root, component, n)
    integer, intent(in) :: root(:)  !! Lowest node of the part of each node (n_nodes).
    integer, allocatable, intent(out) :: component(:)  !! Part of each node (n_nodes).
    integer, intent(out) :: n  !! Number of parts.
    integer :: order(size(root)), i, last
    call sort_order(root, order)
    allocate (component(size(root)))
    n = 0
    last = 0
    do i = 1, size(root)
      if (n == 0 .or. root(order(i)) /= last) n = n + 1
      last = root(order(i))
      component(order(i)) = n
    end do
  end subroutine number_components

  !> Put the elements of one block in order.
  subroutine set_block(self, b, number, element, start)
    type(surface_layer_t), intent(inout) :: self  !! The layer; it has the nodes.
    integer, intent(in) :: b  !! The block.
    integer(int64), intent(in) :: number(:)  !! Whole numbers of the shares (any).
    integer, intent(in) :: element(:, :)  !! Block, number and owner of each element of the shares (3, n_elements).
    integer, intent(in) :: start(:)  !! Place of its tag in `number`; its nodes are behind it (n_elements).
    integer, allocatable :: own(:), order(:)
    integer :: e, i, n
    own = pack([(e, e=1, size(start))], element(1, :) == b)
    allocate (order(size(own)))
    call sort_order(element(2, own), order)
    own = own(order)
    ! Ranks may have sent the same element.
    own = pack(own, [(e == 1 .or. element(2, own(e)) /= element(2, own(max(1, e - 1))), e=1, size(own))])
    n = kind_nodes(self%mesh%block(b)%kind)
    self%whole%block(b)%element = element(2, own)
    self%element_rank(b)%of = element(3, own)
    self%mesh%block(b)%tag = number(start(own))
    allocate (self%mesh%block(b)%node(n, size(own)))
    do e = 1, size(own)
      do i = 1, n
        self%mesh%block(b)%node(i, e) = place_in(self%whole%node, int(number(start(own(e)) + i)))
      end do
    end do
  end subroutine set_block

  !> Put the facets in order: by their lowest corners, then by their elements.
  subroutine set_boundary(self, facet)
    type(surface_layer_t), intent(inout) :: self  !! The layer; it has elements and nodes.
    integer, intent(in) :: facet(:, :)  !! Block, element in the whole body and face of each facet (3, n_facets).
    type(element_kind_t) :: kind(size(self%mesh%block)), of_facet
    integer :: order(size(facet, 2)), by_element(size(facet, 2)), low(size(facet, 2)), i, f, n, b
    integer, allocatable :: node(:, :), element(:)
    n = size(facet, 2)
    do b = 1, size(kind)
      kind(b) = element_kind(self%mesh%block(b)%kind)
    end do
    allocate (node(max_facet_nodes, n), source=0)
    allocate (element(n))
    do f = 1, n
      b = facet(1, f)
      element(f) = place_in(self%whole%block(b)%element, facet(2, f))
      associate (local => kind(b)%face_node(:, facet(3, f)))
        of_facet = element_kind(kind(b)%face_kind(facet(3, f)))
        node(:of_facet%n_nodes, f) = self%mesh%block(b)%node(local(:of_facet%n_nodes), element(f))
        low(f) = minval(node(:of_facet%n_corners, f))
      end associate
    end do
    call sort_order(real(facet(1, :), dp)*2.0_dp**40 + real(facet(2, :), dp)*8 + facet(3, :), by_element)
    call sort_order(low(by_element), order)
    order = by_element(order)
    associate (surface => self%boundary)
      surface%name = ''
      surface%dimension = self%mesh%dimension
      surface%order_elevated = self%mesh%order_elevated
      surface%n_facets = n
      surface%kind = [(kind(facet(1, order(i)))%face_kind(facet(3, order(i))), i=1, n)]
      surface%node = node(:, order)
      surface%block = facet(1, order)
      surface%element = element(order)
    end associate
  end subroutine set_boundary

  !> Place of a number in an ascending list that has it.
  pure integer function place_in(list, value) result(place)
    integer, intent(in) :: list(:)  !! Ascending numbers (n).
    integer, intent(in) :: value  !! One of them.
    integer :: last, middle
    place = 1
    last = size(list)
    do while (place < last)
      middle = (place + last)/2
      if (list(middle) < value) then
        place = middle + 1
      else
        last = middle
      end if
    end do
  end function place_in
end module dotyk_mesh_surface_layer
