!> Parts of bodies as one process cuts them from the whole: what ranks make of their shares is held against them.
module test_cut_body
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_body_part, only: body_part_t, element_centres, node_owners
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_element_ordering, only: morton_order
  use dotyk_mesh_layer_share, only: whole_numbers_t
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  implicit none
  private
  public :: cut_part, own_elements, split_elements

contains

  !> Divide the elements of a body along a Morton curve through their centres, so that each part has about as many
  !> nodes of elements.
  subroutine split_elements(mesh, n_parts, part_of_element)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the body.
    integer, intent(in) :: n_parts  !! Number of parts.
    !> Part of each element, from 0, counted through all blocks (n_elements).
    integer, allocatable, intent(out) :: part_of_element(:)
    real(dp), allocatable :: centre(:, :)
    integer, allocatable :: weight(:), order(:)
    integer(int64) :: before, total
    integer :: i
    call element_centres(mesh, centre, weight)
    allocate (order(size(weight)), part_of_element(size(weight)))
    call morton_order(mesh%dimension, centre, reshape([(i, i=1, size(order))], [1, size(order)]), order)
    total = sum(int(weight, int64))
    before = 0
    do i = 1, size(order)
      ! The part in whose share of the weight the middle of the element lies.
      part_of_element(order(i)) = int(((2*before + weight(order(i)))*n_parts)/(2*total))
      before = before + weight(order(i))
    end do
  end subroutine split_elements

  !> Cut the part of one rank from a whole body.
  subroutine cut_part(whole, part_of_element, rank, n_ranks, part)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the whole body; every node has an element.
    !> Owner of each element, from 0, counted through all blocks (n_elements).
    integer, intent(in) :: part_of_element(:)
    integer, intent(in) :: rank  !! The rank, from 0.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    type(body_part_t), intent(out) :: part  !! The part.
    type(surface_t) :: boundary
    integer, allocatable :: owner(:), boundary_node(:), chosen(:)
    logical, allocatable :: at_own(:), kept(:)
    integer :: b, e, n
    part%rank = rank
    part%n_ranks = n_ranks
    call node_owners(whole, part_of_element, n_ranks, owner)
    allocate (at_own(whole%n_nodes()), kept(whole%n_nodes()), source=.false.)
    n = 0
    do b = 1, size(whole%block)
      do e = 1, size(whole%block(b)%tag)
        if (part_of_element(n + e) == rank) at_own(whole%block(b)%node(:, e)) = .true.
      end do
      n = n + size(whole%block(b)%tag)
    end do
    allocate (part%elements(size(whole%block)), part%mesh%block(size(whole%block)))
    n = 0
    do b = 1, size(whole%block)
      associate (node => whole%block(b)%node)
        chosen = pack([(e, e=1, size(node, 2))], [(any(at_own(node(:, e))), e=1, size(node, 2))])
        part%elements(b)%whole = chosen
        part%elements(b)%n_whole = size(node, 2)
        part%elements(b)%own = part_of_element(n + chosen) == rank
        part%mesh%block(b)%kind = whole%block(b)%kind
        part%mesh%block(b)%tag = whole%block(b)%tag(chosen)
        part%mesh%block(b)%node = node(:, chosen)
        do e = 1, size(chosen)
          kept(node(:, chosen(e))) = .true.
        end do
        n = n + size(node, 2)
      end associate
    end do
    call extract_boundary(whole, boundary)
    call surface_nodes(boundary, boundary_node)
    kept(boundary_node) = .true.
    part%whole_node = pack([(n, n=1, size(kept))], kept)
    call take_nodes(whole, part)
    call number_by_rank(owner, part)
  end subroutine cut_part

  !> The elements that a rank owns of a body in parts, without its ghosts.
  subroutine own_elements(part, mesh, whole)
    type(body_part_t), intent(in) :: part  !! Part of the rank.
    type(body_mesh_t), intent(out) :: mesh  !! Its own elements, with all nodes of the part.
    type(whole_numbers_t), intent(out) :: whole  !! Their numbers in the whole body.
    integer, allocatable :: own(:)
    integer :: b, e
    mesh = part%mesh
    whole%n_nodes = part%n_whole_nodes
    whole%node = part%whole_node
    whole%rank = part%rank
    whole%node_rank = part%node_rank
    whole%global_node = part%global_node
    allocate (whole%block(size(mesh%block)))
    do b = 1, size(mesh%block)
      own = pack([(e, e=1, size(part%elements(b)%own))], part%elements(b)%own)
      mesh%block(b)%node = part%mesh%block(b)%node(:, own)
      mesh%block(b)%tag = part%mesh%block(b)%tag(own)
      whole%block(b)%n_elements = part%elements(b)%n_whole
      whole%block(b)%element = part%elements(b)%whole(own)
    end do
  end subroutine own_elements

  !> Copy the nodes of a part, and number them in its elements.
  subroutine take_nodes(whole, part)
    type(body_mesh_t), intent(in) :: whole  !! Mesh of the whole body.
    type(body_part_t), intent(inout) :: part  !! The part; on entry its elements have node numbers of the whole body.
    integer, allocatable :: number(:)
    integer :: b, e, i
    if (allocated(whole%file)) part%mesh%file = whole%file
    part%mesh%dimension = whole%dimension
    part%mesh%order_elevated = whole%order_elevated
    part%mesh%x = whole%x(:, part%whole_node)
    part%mesh%node_tag = whole%node_tag(part%whole_node)
    ! Nodes from order elevation are not in the file.
    if (allocated(whole%mesh_node)) &
      part%mesh%mesh_node = whole%mesh_node(pack(part%whole_node, part%whole_node <= size(whole%mesh_node)))
    allocate (number(whole%n_nodes()), source=0)
    number(part%whole_node) = [(i, i=1, size(part%whole_node))]
    do b = 1, size(part%mesh%block)
      associate (node => part%mesh%block(b)%node)
        do e = 1, size(node, 2)
          node(:, e) = number(node(:, e))
        end do
      end associate
    end do
  end subroutine take_nodes

  !> Number the nodes of the whole body by rank.
  subroutine number_by_rank(owner, part)
    integer, intent(in) :: owner(:)  !! Owner of each node of the whole body (n_whole_nodes).
    type(body_part_t), intent(inout) :: part  !! The part; its numbering is set.
    integer :: next(0:part%n_ranks - 1), r, v, k
    part%n_whole_nodes = size(owner)
    allocate (part%first_node(0:part%n_ranks))
    next = 0
    do v = 1, size(owner)
      next(owner(v)) = next(owner(v)) + 1
    end do
    part%first_node(0) = 0
    do r = 0, part%n_ranks - 1
      part%first_node(r + 1) = part%first_node(r) + next(r)
    end do
    part%n_own_nodes = next(part%rank)
    part%node_rank = owner(part%whole_node)
    allocate (part%global_node(size(part%whole_node)))
    next = part%first_node(0:part%n_ranks - 1)
    k = 1
    do v = 1, size(owner)
      if (k <= size(part%whole_node)) then
        if (part%whole_node(k) == v) then
          part%global_node(k) = next(owner(v))
          k = k + 1
        end if
      end if
      next(owner(v)) = next(owner(v)) + 1
    end do
  end subroutine number_by_rank
end module test_cut_body
