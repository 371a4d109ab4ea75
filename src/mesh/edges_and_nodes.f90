!> Edges and nodes of a body on which loads and supports act, as surfaces whose facets are lines in space, or single
!> nodes, without parent elements.
module dotyk_mesh_edges_and_nodes
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_place, only: place_t
  use dotyk_base_text, only: point_text, quoted, to_text
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_line2, element_line3, element_point, &
    kind_dimension, max_facet_nodes
  use dotyk_mesh_mesh, only: element_block_t, groups_like, mesh_t, unknown_group
  use dotyk_mesh_surface, only: node_numbers, surface_t
  implicit none
  private
  public :: extract_edges_or_nodes, find_nodes_at, known_to_all

  !> A position names the node that is this many times nearer to it than any other node: coordinates of an input file
  !> have few digits, and the next node is an element away.
  real(dp), parameter :: nearer = 1.0e3_dp

contains

  !> Edges or nodes of a body that the name of a place stands for.
  subroutine extract_edges_or_nodes(mesh, body_mesh, place, surface, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh from which the body was extracted.
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    type(place_t), intent(in) :: place  !! The place, of lower dimension than a surface, and named.
    type(surface_t), intent(out) :: surface  !! Lines in the order of the file, or nodes in that of the body.
    type(error_t), allocatable, intent(out) :: error  !! Set for an unknown name, or one that the body does not have.
    integer, allocatable :: number(:)
    logical :: wanted(size(mesh%group))
    integer :: d
    wanted = groups_like(mesh, trim(place%name), place%dimension)
    if (place%dimension == 0) then
      ! Sets of nodes of a deck have faces as far as they make some, and points for the other nodes.
      do d = 1, body_mesh%dimension - 1
        wanted = wanted .or. groups_like(mesh, trim(place%name), d)
      end do
    end if
    if (.not. any(wanted)) then
      call set_error(error, unknown_group(mesh, trim(place%name), place%dimension), exit_bad_input)
      return
    end if
    call node_numbers(mesh, body_mesh, number)
    if (place%dimension == 0) then
      call take_nodes(body_mesh, place, nodes_of(mesh, wanted, number), surface)
    else
      call take_edges(mesh, body_mesh, place, wanted, number, surface)
    end if
    if (surface%n_facets == 0) &
      call set_error(error, 'mesh '//quoted(mesh%file)//': '//quoted(place%name)//' has no '// &
                     trim(merge('node', 'edge', place%dimension == 0))//' on this body', exit_bad_input)
  end subroutine extract_edges_or_nodes

  !> Nodes of the body that the elements of some groups have, ascending (n).
  pure function nodes_of(mesh, wanted, number) result(node)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    logical, intent(in) :: wanted(:)  !! The groups (n_groups).
    integer, intent(in) :: number(:)  !! Number of each node in the body, 0 where none (n_nodes of the mesh).
    integer, allocatable :: node(:)
    logical, allocatable :: has(:)
    integer :: b, e, i
    allocate (has(0:maxval(number)), source=.false.)
    do b = 1, size(mesh%block)
      if (.not. any(wanted(mesh%block(b)%group))) cycle
      do e = 1, size(mesh%block(b)%tag)
        has(number(mesh%block(b)%node(:, e))) = .true.
      end do
    end do
    node = pack([(i, i=1, size(has) - 1)], has(1:))
  end function nodes_of

  !> Nodes as a surface.
  subroutine take_nodes(body_mesh, place, node, surface)
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    type(place_t), intent(in) :: place  !! What names them.
    integer, intent(in) :: node(:)  !! The nodes (n).
    type(surface_t), intent(out) :: surface  !! The surface.
    integer :: i
    call begin_surface(body_mesh, place, size(node), surface)
    surface%kind = [(element_point, i=1, size(node))]
    surface%node(1, :) = node
  end subroutine take_nodes

  !> A surface without parent elements.
  subroutine begin_surface(body_mesh, place, n, surface)
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    type(place_t), intent(in) :: place  !! What names it.
    integer, intent(in) :: n  !! Number of facets.
    type(surface_t), intent(inout) :: surface  !! Gets all but kinds and nodes of the facets.
    surface%name = place%text(body_mesh%dimension)
    surface%dimension = body_mesh%dimension
    surface%order_elevated = body_mesh%order_elevated
    surface%n_facets = n
    allocate (surface%node(max_facet_nodes, n), surface%block(n), surface%element(n), source=0)
  end subroutine begin_surface

  !> The lines of some groups that are edges of elements, with the nodes of these: the file may have fewer.
  subroutine take_edges(mesh, body_mesh, place, wanted, number, surface)
    type(mesh_t), intent(in) :: mesh  !! Mesh.
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    type(place_t), intent(in) :: place  !! What names them.
    logical, intent(in) :: wanted(:)  !! The groups (n_groups).
    integer, intent(in) :: number(:)  !! Number of each node in the body, 0 where none (n_nodes of the mesh).
    type(surface_t), intent(out) :: surface  !! The edges as a surface.
    type(corner_table_t) :: table
    integer, allocatable :: node(:, :), chosen(:)
    logical, allocatable :: touched(:)
    integer :: b, e, i, entry, corner(2)
    call table%init(2, sum([(size(mesh%block(b)%tag), b=1, size(mesh%block))], &
                           mask=[(any(wanted(mesh%block(b)%group)), b=1, size(mesh%block))]))
    allocate (touched(0:body_mesh%n_nodes()), source=.false.)
    do b = 1, size(mesh%block)
      if (kind_dimension(mesh%block(b)%kind) /= 1 .or. .not. any(wanted(mesh%block(b)%group))) cycle
      do e = 1, size(mesh%block(b)%tag)
        corner = number(mesh%block(b)%node(:2, e))
        if (any(corner == 0)) cycle
        call table%add(corner, entry)
        touched(corner) = .true.
      end do
    end do
    allocate (node(3, table%n), source=0)
    do b = 1, size(body_mesh%block)
      call look_at(body_mesh%block(b))
    end do
    if (allocated(body_mesh%face)) then
      do b = 1, size(body_mesh%face)
        call look_at(body_mesh%face(b))
      end do
    end if
    chosen = pack([(i, i=1, table%n)], node(1, :) > 0)
    call begin_surface(body_mesh, place, size(chosen), surface)
    surface%node(:3, :) = node(:, chosen)
    surface%kind = merge(element_line3, element_line2, node(3, chosen) > 0)

  contains

    !> Find the edges of the elements or faces of a block.
    subroutine look_at(block)
      type(element_block_t), intent(in) :: block  !! The block.
      type(element_kind_t) :: kind, face
      integer :: f
      kind = element_kind(block%kind)
      do e = 1, size(block%tag)
        if (count(touched(block%node(:kind%n_corners, e))) < 2) cycle
        if (kind%dimension == 2) call look_around(kind, block%node(:, e))
        do f = 1, merge(kind%n_faces, 0, kind%dimension == 3)
          face = element_kind(kind%face_kind(f))
          call look_around(face, block%node(kind%face_node(:face%n_nodes, f), e))
        end do
      end do
    end subroutine look_at

    !> Find the edges of a triangle or quadrilateral: its mid-side nodes follow the corners in the order of the edges.
    subroutine look_around(face, around)
      type(element_kind_t), intent(in) :: face  !! Its kind.
      integer, intent(in) :: around(:)  !! Its nodes (n_nodes).
      integer :: k
      do k = 1, face%n_corners
        entry = table%find([around(k), around(mod(k, face%n_corners) + 1)])
        if (entry == 0) cycle
        node(:2, entry) = [around(k), around(mod(k, face%n_corners) + 1)]
        if (face%order > 1) node(3, entry) = around(face%n_corners + k)
      end do
    end subroutine look_around
  end subroutine take_edges

  !> The nodes at some positions, as a surface.
  subroutine find_nodes_at(body_mesh, x, place, surface, error)
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body, anywhere.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body in place (dim, n_nodes) [length].
    type(place_t), intent(in) :: place  !! The positions.
    type(surface_t), intent(out) :: surface  !! The nodes.
    type(error_t), allocatable, intent(out) :: error  !! Where none is there, or two are; names the nearest.
    logical, allocatable :: eligible(:)
    real(dp) :: distance(2), r
    integer :: found(size(place%at, 2)), i, k, next
    eligible = known_to_all(body_mesh)
    do k = 1, size(found)
      distance = huge(r)
      found(k) = 1
      next = 1
      do i = 1, size(x, 2)
        if (.not. eligible(i)) cycle
        r = norm2(x(:, i) - place%at(:size(x, 1), k))
        if (r < distance(1)) then
          distance = [r, distance(1)]
          next = found(k)
          found(k) = i
        else if (r < distance(2)) then
          distance(2) = r
          next = i
        end if
      end do
      if (nearer*distance(1) < distance(2)) cycle
      if (distance(2) > 0) then
        call set_error(error, 'no node is at '//point_text(place%at(:size(x, 1), k))//'; the nearest one is node '// &
                       to_text(body_mesh%node_tag(found(k)))//' at '//point_text(x(:, found(k)))//', '// &
                       to_text(distance(1), 3)//' away: give its position, or make a point of the geometry there', &
                       exit_bad_input)
      else
        call set_error(error, 'two nodes are at '//point_text(place%at(:size(x, 1), k))//', '// &
                       to_text(body_mesh%node_tag(found(k)))//' and '//to_text(body_mesh%node_tag(next))// &
                       ': name one of them by a physical point or a set of nodes', exit_bad_input)
      end if
      return
    end do
    call take_nodes(body_mesh, place, found, surface)
  end subroutine find_nodes_at

  !> Nodes that all ranks hold: those of the boundary of a body in parts, all of others (n_nodes).
  pure function known_to_all(body_mesh) result(known)
    type(body_mesh_t), intent(in) :: body_mesh  !! Mesh of the body.
    logical, allocatable :: known(:)
    integer :: f
    allocate (known(body_mesh%n_nodes()), source=.not. body_mesh%is_in_parts())
    if (.not. body_mesh%is_in_parts()) return
    associate (node => body_mesh%whole%facet_node)
      do f = 1, size(node, 2)
        known(pack(node(:, f), node(:, f) > 0)) = .true.
      end do
    end associate
  end function known_to_all
end module dotyk_mesh_edges_and_nodes
