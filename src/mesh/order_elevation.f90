!> Order elevation: quadratic elements in place of linear ones, on the same straight edges, for materials in which
!> linear triangles, tetrahedra, prisms and pyramids lock.
!>
!> New nodes lie at the centres of edges, of quadrilateral faces, of quadrilaterals and of hexahedra. Elements share the
!> nodes of common edges and faces, so that a mesh of several kinds stays conforming. Elements keep their order and
!> tags, nodes their numbers; new nodes follow the old ones.
module dotyk_mesh_order_elevation
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_hex8, element_hex27, element_kind, element_kind_t, element_prism18, &
    element_prism6, element_pyramid14, element_pyramid5, element_quad4, element_quad9, element_tet10, element_tet4, &
    element_tri3, element_tri6, reference_nodes, shape_functions
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: has_linear_simplices, elevate_order

  !> Linear kinds, and the quadratic kinds that replace them.
  integer, parameter :: linear(6) = [element_tri3, element_quad4, element_tet4, element_hex8, element_prism6, &
                                     element_pyramid5]
  integer, parameter :: quadratic(6) = [element_tri6, element_quad9, element_tet10, element_hex27, element_prism18, &
                                        element_pyramid14]

  !> A linear shape function is positive at a node between corners where it exceeds this; its values are 1/2, 1/4 or
  !> 1/8.
  real(dp), parameter, public :: shape_tolerance = 0.01_dp

contains

  !> Whether a body has linear triangles, tetrahedra, prisms or pyramids.
  pure logical function has_linear_simplices(mesh) result(has)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    integer :: b
    has = .false.
    do b = 1, size(mesh%block)
      has = has .or. any(mesh%block(b)%kind == [element_tri3, element_tet4, element_prism6, element_pyramid5])
    end do
  end function has_linear_simplices

  !> Replace all linear elements of a body by quadratic ones; quadratic elements are unchanged.
  subroutine elevate_order(mesh)
    type(body_mesh_t), intent(inout) :: mesh  !! Mesh of the body.
    type(corner_table_t) :: table
    type(element_block_t), allocatable :: block(:)
    integer :: b, position, n_old, n_centres, max_new
    n_old = mesh%n_nodes()
    max_new = 0
    do b = 1, size(mesh%block)
      position = findloc(linear, mesh%block(b)%kind, dim=1)
      ! An upper limit: most new nodes are shared.
      if (position > 0) max_new = max_new + new_nodes(quadratic(position))*size(mesh%block(b)%tag)
    end do
    call table%init(4, max_new)
    allocate (block(size(mesh%block)))
    n_centres = 0
    do b = 1, size(mesh%block)
      block(b) = mesh%block(b)
      position = findloc(linear, mesh%block(b)%kind, dim=1)
      if (position == 0) cycle
      block(b)%kind = quadratic(position)
      call number_new_nodes(mesh%block(b)%node, quadratic(position), n_old, table, n_centres, block(b)%node)
    end do
    call number_centres(n_old + table%n, block)
    call place_nodes(mesh, n_old, table%n + n_centres, block)
    mesh%block = block
    mesh%order_elevated = .true.
  end subroutine elevate_order

  !> Number of nodes of a kind that are not corners.
  pure integer function new_nodes(kind)
    integer, intent(in) :: kind  !! Element kind.
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    new_nodes = properties%n_nodes - properties%n_corners
  end function new_nodes

  !> Number the new nodes of a block on edges and faces; the centres of hexahedra get negative numbers.
  subroutine number_new_nodes(corner, kind, n_old, table, n_centres, node)
    integer, intent(in) :: corner(:, :)  !! Nodes of the linear elements (n_corners, n_elements).
    integer, intent(in) :: kind  !! The quadratic kind.
    integer, intent(in) :: n_old  !! Number of nodes of the linear mesh.
    type(corner_table_t), intent(inout) :: table  !! New nodes by the corners between which they lie.
    integer, intent(inout) :: n_centres  !! Number of centres of hexahedra so far.
    integer, allocatable, intent(out) :: node(:, :)  !! Nodes of the quadratic elements (n_nodes, n_elements).
    integer, allocatable :: between(:, :), count_of(:)
    integer :: e, a, n, entry
    call list_corners(kind, between, count_of)
    n = size(corner, 1)
    allocate (node(size(count_of), size(corner, 2)))
    node(:n, :) = corner
    do e = 1, size(corner, 2)
      do a = n + 1, size(count_of)
        if (count_of(a) > 4) then
          n_centres = n_centres + 1
          node(a, e) = -n_centres
        else
          call table%add(corner(between(:count_of(a), a), e), entry)
          node(a, e) = n_old + entry
        end if
      end do
    end do
  end subroutine number_new_nodes

  !> Corners between which each node of a kind lies.
  subroutine list_corners(kind, between, count_of)
    integer, intent(in) :: kind  !! Element kind.
    !> Local corner numbers; the first count_of(a) of node a are set (n_corners, n_nodes).
    integer, allocatable, intent(out) :: between(:, :)
    integer, allocatable, intent(out) :: count_of(:)  !! Number of these corners (n_nodes).
    type(element_kind_t) :: properties
    real(dp), allocatable :: xi(:, :), shape(:)
    integer :: a, c
    properties = element_kind(kind)
    allocate (xi(properties%dimension, properties%n_nodes), shape(properties%n_corners))
    allocate (between(properties%n_corners, properties%n_nodes), count_of(properties%n_nodes), source=0)
    call reference_nodes(kind, xi)
    do a = 1, properties%n_nodes
      call shape_functions(properties%corner_kind, xi(:, a), shape)
      do c = 1, properties%n_corners
        if (.not. shape(c) > shape_tolerance) cycle
        count_of(a) = count_of(a) + 1
        between(count_of(a), a) = c
      end do
    end do
  end subroutine list_corners

  !> Number the centres of hexahedra after all other nodes.
  pure subroutine number_centres(n_before, block)
    integer, intent(in) :: n_before  !! Number of other nodes.
    type(element_block_t), intent(inout) :: block(:)  !! Elements (n_blocks); negative node numbers are replaced.
    integer :: b
    do b = 1, size(block)
      where (block(b)%node < 0) block(b)%node = n_before - block(b)%node
    end do
  end subroutine number_centres

  !> Coordinates and tags of the new nodes.
  subroutine place_nodes(mesh, n_old, n_new, block)
    type(body_mesh_t), intent(inout) :: mesh  !! Mesh of the body; the new nodes are appended.
    integer, intent(in) :: n_old  !! Number of old nodes.
    integer, intent(in) :: n_new  !! Number of new nodes.
    type(element_block_t), intent(in) :: block(:)  !! Quadratic elements (n_blocks).
    integer(int64), allocatable :: tag(:)
    integer, allocatable :: between(:, :), count_of(:)
    real(dp), allocatable :: x(:, :)
    integer :: b, e, a, i, n
    allocate (x(mesh%dimension, n_old + n_new), tag(n_old + n_new))
    x(:, :n_old) = mesh%x
    tag(:n_old) = mesh%node_tag
    ! Tags above those of all nodes of the body.
    tag(n_old + 1:) = [(maxval(mesh%node_tag) + i, i=1, n_new)]
    do b = 1, size(block)
      call list_corners(block(b)%kind, between, count_of)
      do e = 1, size(block(b)%tag)
        associate (node => block(b)%node(:, e))
          do a = 1, size(node)
            n = count_of(a)
            if (node(a) <= n_old) cycle
            do i = 1, mesh%dimension
              x(i, node(a)) = sum(mesh%x(i, node(between(:n, a))))/n
            end do
          end do
        end associate
      end do
    end do
    call move_alloc(x, mesh%x)
    call move_alloc(tag, mesh%node_tag)
  end subroutine place_nodes
end module dotyk_mesh_order_elevation
