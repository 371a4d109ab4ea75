!> The mesh of one body: its elements, with nodes numbered within the body.
!>
!> What is known of a whole body on a rank that holds a part of its mesh: its size, the numbers of the held nodes and
!> elements in it, its boundary, and what else depends on elements that are not there.
module dotyk_mesh_body_mesh
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: quoted
  use dotyk_mesh_element, only: kind_dimension, kind_nodes, n_element_kinds
  use dotyk_mesh_mesh, only: element_block_t, fault_of_volume, groups_named, material_of_block, mesh_t, n_materials_of
  use dotyk_mesh_mesh_check, only: check_plane, check_repeated_elements, check_size, orient_elements
  use dotyk_mesh_union_find, only: root_of
  implicit none
  private
  public :: extract_body, connected_components, gather_elements, number_nodes

  type, public :: body_mesh_t  !! Elements and nodes of one body.
    character(:), allocatable :: file  !! File of the mesh, for messages.
    integer :: dimension = 0  !! Dimension of space and of the elements.
    real(dp), allocatable :: x(:, :)  !! Nodal coordinates (dimension, n_nodes) [length].
    integer(int64), allocatable :: node_tag(:)  !! Node tags in the file (n_nodes).
    !> Index of each node in the mesh, ascending (nodes of the file). Nodes from order elevation follow these and have
    !> no index.
    integer, allocatable :: mesh_node(:)
    !> Elements, one block for each material and kind (n_blocks); nodes are body-local numbers, volumes are positive;
    !> `group` is not used.
    type(element_block_t), allocatable :: block(:)
    !> Faces of a rigid body without volume, likewise, oriented outward; then it has no elements. Not allocated for
    !> other bodies (`dotyk_mesh_rigid_surface`).
    type(element_block_t), allocatable :: face(:)
    logical :: is_open = .false.  !! Whether these faces enclose no volume: they have a side, but no inside.
    !> The elements are quadratic on the straight edges and faces of the linear elements of the file
    !> (`dotyk_mesh_order_elevation`).
    logical :: order_elevated = .false.
    !> What is known of the whole body; allocated on ranks that hold a part of its mesh only (`dotyk_mesh_held_part`).
    type(whole_body_t), allocatable :: whole
  contains
    procedure :: n_nodes => body_mesh_n_nodes
    procedure :: n_elements => body_mesh_n_elements
    procedure :: n_whole_nodes => body_mesh_n_whole_nodes
    procedure :: n_whole_elements => body_mesh_n_whole_elements
    procedure :: whole_block_size => body_mesh_whole_block_size
    procedure :: n_file_nodes => body_mesh_n_file_nodes
    procedure :: is_whole => body_mesh_is_whole
    procedure :: is_in_parts => body_mesh_is_in_parts
    procedure :: is_own_node => body_mesh_is_own_node
    procedure :: is_own_element => body_mesh_is_own_element
    procedure :: whole_nodes => body_mesh_whole_nodes
    procedure :: box => body_mesh_box
    procedure :: diameter => body_mesh_diameter
    procedure :: carry => body_mesh_carry
  end type body_mesh_t

  type, public :: whole_body_t  !! The whole body.
    !> Whether all ranks compute the body together, each its part; else others compute it, and this rank nothing of it.
    logical :: in_parts = .false.
    integer :: n_nodes = 0  !! Number of nodes.
    integer :: n_file_nodes = 0  !! Those of them that are in the mesh file, not from order elevation.
    integer, allocatable :: n_of_block(:)  !! Number of elements of each block (n_blocks).
    integer, allocatable :: node(:)  !! Number in the whole body of each held node, ascending (n_held_nodes).
    !> Number in its block of the whole body of each held element, one block after the other, ascending in each
    !> (n_held_elements).
    integer, allocatable :: element(:)
    logical, allocatable :: own_node(:)  !! Whether this rank computes a held node, or others (n_held_nodes).
    logical, allocatable :: own_element(:)  !! Whether this rank computes a held element (n_held_elements).
    integer, allocatable :: component(:)  !! Connected component of each held node (n_held_nodes).
    integer :: n_components = 0  !! Number of connected components.
    real(dp) :: diameter = 0  !! Greatest extent, `body_mesh_t%diameter` [length].
    real(dp) :: shortest_extent = 0  !! Shortest edge of the brick with the same moments, `shortest_extent` [length].
    integer, allocatable :: facet_kind(:)  !! The boundary, as in `surface_t`: kinds of the facets (n_facets).
    integer, allocatable :: facet_node(:, :)  !! Their nodes, in held numbers (max_facet_nodes, n_facets).
  contains
    procedure :: carry => whole_body_carry
  end type whole_body_t

contains

  !> Number of held nodes: of all, unless the rank holds a part of the body.
  pure integer function body_mesh_n_nodes(self) result(n)
    class(body_mesh_t), intent(in) :: self
    n = size(self%x, 2)
  end function body_mesh_n_nodes

  !> Number of held elements.
  pure integer function body_mesh_n_elements(self) result(n)
    class(body_mesh_t), intent(in) :: self
    integer :: b
    n = sum([(size(self%block(b)%tag), b=1, size(self%block))])
  end function body_mesh_n_elements

  !> Number of nodes of the whole body.
  pure integer function body_mesh_n_whole_nodes(self) result(n)
    class(body_mesh_t), intent(in) :: self
    n = self%n_nodes()
    if (allocated(self%whole)) n = self%whole%n_nodes
  end function body_mesh_n_whole_nodes

  !> Number of elements of the whole body.
  pure integer function body_mesh_n_whole_elements(self) result(n)
    class(body_mesh_t), intent(in) :: self
    if (allocated(self%whole)) then
      n = sum(self%whole%n_of_block)
    else
      n = self%n_elements()
    end if
  end function body_mesh_n_whole_elements

  !> Number of elements of a block of the whole body.
  pure integer function body_mesh_whole_block_size(self, b) result(n)
    class(body_mesh_t), intent(in) :: self
    integer, intent(in) :: b  !! Index of the block.
    n = size(self%block(b)%tag)
    if (allocated(self%whole)) n = self%whole%n_of_block(b)
  end function body_mesh_whole_block_size

  !> Number of nodes of the whole body that are in the mesh file, not from order elevation.
  pure integer function body_mesh_n_file_nodes(self) result(n)
    class(body_mesh_t), intent(in) :: self
    n = self%n_nodes()
    if (allocated(self%mesh_node)) n = size(self%mesh_node)
    if (allocated(self%whole)) n = self%whole%n_file_nodes
  end function body_mesh_n_file_nodes

  !> Whether this rank holds all of the body.
  elemental logical function body_mesh_is_whole(self) result(is_whole)
    class(body_mesh_t), intent(in) :: self
    is_whole = .not. allocated(self%whole)
  end function body_mesh_is_whole

  !> Whether all ranks compute the body together, each a part of it: sums over nodes and elements are those of the own
  !> ones, added up over the ranks.
  elemental logical function body_mesh_is_in_parts(self) result(is_in_parts)
    class(body_mesh_t), intent(in) :: self
    is_in_parts = .false.
    if (allocated(self%whole)) is_in_parts = self%whole%in_parts
  end function body_mesh_is_in_parts

  !> Whether this rank computes a node.
  pure logical function body_mesh_is_own_node(self, node) result(is_own)
    class(body_mesh_t), intent(in) :: self
    integer, intent(in) :: node  !! Held node.
    is_own = .true.
    if (allocated(self%whole)) is_own = self%whole%own_node(node)
  end function body_mesh_is_own_node

  !> Whether this rank computes an element.
  pure logical function body_mesh_is_own_element(self, element) result(is_own)
    class(body_mesh_t), intent(in) :: self
    integer, intent(in) :: element  !! Held element, counted through all blocks.
    is_own = .true.
    if (allocated(self%whole)) is_own = self%whole%own_element(element)
  end function body_mesh_is_own_element

  !> Numbers in the whole body of some held nodes (n).
  pure function body_mesh_whole_nodes(self, node) result(number)
    class(body_mesh_t), intent(in) :: self
    integer, intent(in) :: node(:)  !! Held nodes (n).
    integer :: number(size(node))
    number = node
    if (allocated(self%whole)) number = self%whole%node(node)
  end function body_mesh_whole_nodes

  !> Bounding box of the nodes.
  pure subroutine body_mesh_box(self, lo, hi)
    class(body_mesh_t), intent(in) :: self
    real(dp), intent(out) :: lo(self%dimension)  !! Lower corner (dimension) [length].
    real(dp), intent(out) :: hi(self%dimension)  !! Upper corner (dimension) [length].
    lo = minval(self%x, dim=2)
    hi = maxval(self%x, dim=2)
  end subroutine body_mesh_box

  !> Greatest extent, whatever the orientation: twice the greatest distance of a node from the mean of all [length].
  pure real(dp) function body_mesh_diameter(self) result(diameter)
    class(body_mesh_t), intent(in) :: self
    real(dp) :: mean(self%dimension)
    integer :: i
    if (allocated(self%whole)) then
      diameter = self%whole%diameter
      return
    end if
    mean = sum(self%x, dim=2)/self%n_nodes()
    diameter = 2*maxval([(norm2(self%x(:, i) - mean), i=1, self%n_nodes())])
  end function body_mesh_diameter

  !> Put it into a parcel, or take it out.
  subroutine body_mesh_carry(self, parcel)
    class(body_mesh_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    logical :: has_whole
    call parcel%carry(self%file)
    call parcel%carry(self%dimension)
    call parcel%carry(self%x)
    call parcel%carry(self%node_tag)
    call parcel%carry(self%mesh_node)
    call parcel%carry(self%order_elevated)
    call carry_blocks(parcel, self%block)
    call carry_blocks(parcel, self%face)
    call parcel%carry(self%is_open)
    has_whole = allocated(self%whole)
    call parcel%carry(has_whole)
    if (has_whole .and. parcel%is_read) allocate (self%whole)
    if (has_whole) call self%whole%carry(parcel)
  end subroutine body_mesh_carry

  !> Put blocks of elements into a parcel, or take them out.
  subroutine carry_blocks(parcel, block)
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    type(element_block_t), allocatable, intent(inout) :: block(:)  !! The blocks, if there are any (n_blocks).
    logical :: has_blocks
    integer :: n(1), b
    has_blocks = allocated(block)
    if (has_blocks) n = shape(block)
    call parcel%carry_shape(has_blocks, n)
    if (.not. has_blocks) return
    if (parcel%is_read) allocate (block(n(1)))
    do b = 1, n(1)
      call parcel%carry(block(b)%kind)
      call parcel%carry(block(b)%material)
      call parcel%carry(block(b)%node)
      call parcel%carry(block(b)%tag)
    end do
  end subroutine carry_blocks

  !> Extract the elements of the physical groups of one name from a mesh, and check them.
  !>
  !> Elements of other dimensions are ignored. A body whose elements are all inverted is reoriented.
  subroutine extract_body(mesh, volume_name, dimension, body_mesh, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    character(*), intent(in) :: volume_name  !! Name of the physical groups.
    integer, intent(in) :: dimension  !! Dimension of space: 3, or 2 for plane and axisymmetric analyses.
    type(body_mesh_t), intent(out) :: body_mesh  !! Mesh of the body.
    !> Set for an unknown name, an empty group, volumes of a body that have elements in common, coordinates out of
    !> range, nodes off the plane, and repeated elements (exit code 2); for inverted or degenerate elements (exit
    !> code 3).
    type(error_t), allocatable, intent(out) :: error
    logical :: wanted(size(mesh%group))
    wanted = groups_named(mesh, trim(volume_name), dimension)
    call fault_of_volume(mesh, trim(volume_name), dimension, error)
    if (allocated(error)) return
    body_mesh%file = mesh%file
    body_mesh%dimension = dimension
    call gather_elements(mesh, wanted, dimension, body_mesh%block)
    if (size(body_mesh%block) == 0) then
      call set_error(error, 'mesh '//quoted(mesh%file)//': physical group '//quoted(volume_name)//' has no elements')
      return
    end if
    call number_nodes(mesh, body_mesh)
    call check_size(body_mesh%x, body_mesh%node_tag, error)
    if (dimension == 2 .and. .not. allocated(error)) then
      call check_plane(mesh%x(:, body_mesh%mesh_node), body_mesh%node_tag, error)
    end if
    if (.not. allocated(error)) call check_repeated_elements(body_mesh%block, error)
    if (.not. allocated(error)) call orient_elements(body_mesh%x, body_mesh%block, error)
    if (allocated(error)) error%message = 'mesh '//quoted(mesh%file)//', '//quoted(volume_name)//': '//error%message
  end subroutine extract_body

  !> Copy the elements of some groups, one block for each material and kind.
  subroutine gather_elements(mesh, wanted, dimension, block)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    logical, intent(in) :: wanted(:)  !! Groups to copy (n_groups).
    integer, intent(in) :: dimension  !! Dimension of the elements.
    type(element_block_t), allocatable, intent(out) :: block(:)  !! Elements, with node numbers of the mesh (n_blocks).
    integer :: n_of_kind(n_element_kinds, n_materials_of(mesh, wanted)), b, i, kind, m, n
    integer :: block_of_kind(n_element_kinds, size(n_of_kind, 2))
    n_of_kind = 0
    do b = 1, size(mesh%block)
      if (.not. is_wanted(mesh%block(b))) cycle
      kind = mesh%block(b)%kind
      m = material_of_block(mesh, wanted, b)
      n_of_kind(kind, m) = n_of_kind(kind, m) + size(mesh%block(b)%tag)
    end do
    allocate (block(count(n_of_kind > 0)))
    i = 0
    block_of_kind = 0
    do m = 1, size(n_of_kind, 2)
      do kind = 1, n_element_kinds
        if (n_of_kind(kind, m) == 0) cycle
        i = i + 1
        block_of_kind(kind, m) = i
        block(i)%kind = kind
        block(i)%material = m
        allocate (block(i)%node(kind_nodes(kind), n_of_kind(kind, m)), block(i)%tag(n_of_kind(kind, m)))
        allocate (block(i)%entity(n_of_kind(kind, m)), source=0)
      end do
    end do
    n_of_kind = 0
    do b = 1, size(mesh%block)
      if (.not. is_wanted(mesh%block(b))) cycle
      kind = mesh%block(b)%kind
      m = material_of_block(mesh, wanted, b)
      i = n_of_kind(kind, m)
      n = size(mesh%block(b)%tag)
      block(block_of_kind(kind, m))%node(:, i + 1:i + n) = mesh%block(b)%node
      block(block_of_kind(kind, m))%tag(i + 1:i + n) = mesh%block(b)%tag
      if (allocated(mesh%block(b)%entity)) block(block_of_kind(kind, m))%entity(i + 1:i + n) = mesh%block(b)%entity
      n_of_kind(kind, m) = i + n
    end do

  contains

    !> Whether a block of the mesh has the dimension and belongs to one of the groups.
    pure logical function is_wanted(candidate)
      type(element_block_t), intent(in) :: candidate  !! Block of the mesh.
      is_wanted = .false.
      if (kind_dimension(candidate%kind) == dimension) is_wanted = any(wanted(candidate%group))
    end function is_wanted
  end subroutine gather_elements

  !> Number the nodes of the body in the order of the mesh.
  subroutine number_nodes(mesh, body_mesh)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    type(body_mesh_t), intent(inout) :: body_mesh  !! Mesh of the body; its blocks have node numbers of the mesh first.
    integer, allocatable :: number(:)
    integer :: b, e, i, n
    allocate (number(size(mesh%x, 2)))
    number = 0
    do b = 1, size(body_mesh%block)
      associate (node => body_mesh%block(b)%node)
        do e = 1, size(node, 2)
          number(node(:, e)) = 1
        end do
      end associate
    end do
    n = sum(number)
    allocate (body_mesh%mesh_node(n))
    n = 0
    do i = 1, size(number)
      if (number(i) == 0) cycle
      n = n + 1
      number(i) = n
      body_mesh%mesh_node(n) = i
    end do
    do b = 1, size(body_mesh%block)
      associate (node => body_mesh%block(b)%node)
        do e = 1, size(node, 2)
          node(:, e) = number(node(:, e))
        end do
      end associate
    end do
    body_mesh%x = mesh%x(:body_mesh%dimension, body_mesh%mesh_node)
    body_mesh%node_tag = mesh%node_tag(body_mesh%mesh_node)
  end subroutine number_nodes

  !> Connected components of a body: nodes of one element belong to one component.
  subroutine connected_components(body_mesh, component, n_components)
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    integer, intent(out) :: component(:)  !! Component of each node (n_nodes), in the order of their first nodes.
    integer, intent(out) :: n_components  !! Number of components.
    integer :: i
    if (allocated(body_mesh%whole)) then
      component = body_mesh%whole%component
      n_components = body_mesh%whole%n_components
      return
    end if
    ! Union-find: each node points to a node of lower number in its component, or to itself.
    component = [(i, i=1, size(component))]
    call join_nodes(body_mesh%block, component)
    if (allocated(body_mesh%face)) call join_nodes(body_mesh%face, component)
    n_components = 0
    do i = 1, size(component)
      if (component(i) == i) then
        n_components = n_components + 1
        component(i) = n_components
      else
        component(i) = component(component(i))
      end if
    end do
  end subroutine connected_components

  !> Join the nodes of each element.
  subroutine join_nodes(block, parent)
    type(element_block_t), intent(in) :: block(:)  !! Elements (n_blocks).
    integer, intent(inout) :: parent(:)  !! A node of lower number in the component of each node, or itself (n_nodes).
    integer :: b, e, i, first, other
    do b = 1, size(block)
      do e = 1, size(block(b)%tag)
        first = root_of(parent, block(b)%node(1, e))
        do i = 2, size(block(b)%node, 1)
          other = root_of(parent, block(b)%node(i, e))
          parent(max(first, other)) = min(first, other)
          first = min(first, other)
        end do
      end do
    end do
  end subroutine join_nodes

  !> Put it into a parcel, or take it out.
  subroutine whole_body_carry(self, parcel)
    class(whole_body_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%in_parts)
    call parcel%carry(self%n_nodes)
    call parcel%carry(self%n_file_nodes)
    call parcel%carry(self%n_of_block)
    call parcel%carry(self%node)
    call parcel%carry(self%element)
    call parcel%carry(self%own_node)
    call parcel%carry(self%own_element)
    call parcel%carry(self%component)
    call parcel%carry(self%n_components)
    call parcel%carry(self%diameter)
    call parcel%carry(self%shortest_extent)
    call parcel%carry(self%facet_kind)
    call parcel%carry(self%facet_node)
  end subroutine whole_body_carry
end module dotyk_mesh_body_mesh
