!> Parts of the mesh of one body, for bodies that are distributed over ranks.
!>
!> Each element has one owner. A rank holds its own elements and one layer of ghost elements around them, so that it has
!> all elements of its own nodes. It has all nodes on the boundary of the body, whoever owns them, as contact surfaces
!> are the same on all ranks.
module dotyk_mesh_body_part
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_element_ordering, only: morton_order
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  implicit none
  private

  !> Elements of one block of a part.
  type, public :: part_elements_t
    !> Whether the rank owns each element; the others are ghosts (n_elements).
    logical, allocatable :: own(:)
    !> Number of each element in its block of the whole body, ascending (n_elements).
    integer, allocatable :: whole(:)
    !> Number of elements in the block of the whole body.
    integer :: n_whole = 0
  end type part_elements_t

  !> The part of one body's mesh that one rank holds.
  type, public :: body_part_t
    !> This rank, from 0.
    integer :: rank = 0
    !> Number of ranks.
    integer :: n_ranks = 1
    !> Own elements, ghost elements, their nodes and all nodes on the boundary of the body. The blocks are those of the
    !> whole body, maybe empty; elements and nodes are in the order of the whole body.
    type(body_mesh_t) :: mesh
    !> Elements of the part (n_blocks).
    type(part_elements_t), allocatable :: elements(:)
    !> Number of nodes of the whole body.
    integer :: n_whole_nodes = 0
    !> Number of each node in the whole body, ascending (n_nodes).
    integer, allocatable :: whole_node(:)
    !> Owner of each node: the lowest rank that has an own element with it (n_nodes).
    integer, allocatable :: node_rank(:)
    !> Number of nodes that this rank owns.
    integer :: n_own_nodes = 0
    !> The nodes of rank r have the global numbers first_node(r) .. first_node(r + 1) - 1, from 0 (0:n_ranks).
    integer, allocatable :: first_node(:)
    !> Global number of each node, from 0: by owner, and then by the number in the whole body (n_nodes).
    integer, allocatable :: global_node(:)
  contains
    procedure :: n_own_elements => part_n_own_elements
  end type body_part_t

  public :: split_elements, element_centres, cut_part, node_owners, whole_body_part

contains

  !> Number of elements that the rank owns.
  pure integer function part_n_own_elements(self) result(n)
    class(body_part_t), intent(in) :: self
    integer :: b
    n = sum([(count(self%elements(b)%own), b=1, size(self%elements))])
  end function part_n_own_elements

  !> Divide the elements of a body along a Morton curve through their centres, so that each part has about as many
  !> nodes of elements.
  subroutine split_elements(mesh, n_parts, part_of_element)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Number of parts.
    integer, intent(in) :: n_parts
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

  !> Mean of the corners of all elements, and their weights.
  subroutine element_centres(mesh, centre, weight)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Mean of the corners of each element, counted through all blocks (dimension, n_elements) [length].
    real(dp), allocatable, intent(out) :: centre(:, :)
    !> Number of nodes of each element (n_elements).
    integer, allocatable, intent(out) :: weight(:)
    type(element_kind_t) :: kind
    integer :: b, d, e, n
    allocate (centre(mesh%dimension, mesh%n_elements()), weight(mesh%n_elements()))
    n = 0
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      associate (node => mesh%block(b)%node)
        do e = 1, size(node, 2)
          do d = 1, mesh%dimension
            centre(d, n + e) = sum(mesh%x(d, node(:kind%n_corners, e)))/kind%n_corners
          end do
        end do
        weight(n + 1:n + size(node, 2)) = kind%n_nodes
        n = n + size(node, 2)
      end associate
    end do
  end subroutine element_centres

  !> Owner of each node: the lowest rank that owns an element with it.
  pure subroutine node_owners(mesh, part_of_element, n_ranks, node_rank)
    !> Mesh of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Owner of each element, from 0, counted through all blocks (n_elements).
    integer, intent(in) :: part_of_element(:)
    !> Number of ranks.
    integer, intent(in) :: n_ranks
    !> Owner of each node; n_ranks where it has no element (n_nodes).
    integer, allocatable, intent(out) :: node_rank(:)
    integer :: b, e, n
    allocate (node_rank(mesh%n_nodes()), source=n_ranks)
    n = 0
    do b = 1, size(mesh%block)
      associate (node => mesh%block(b)%node)
        do e = 1, size(node, 2)
          node_rank(node(:, e)) = min(node_rank(node(:, e)), part_of_element(n + e))
        end do
        n = n + size(node, 2)
      end associate
    end do
  end subroutine node_owners

  !> Cut the part of one rank from a whole body.
  subroutine cut_part(whole, part_of_element, rank, n_ranks, part)
    !> Mesh of the whole body; every node has an element.
    type(body_mesh_t), intent(in) :: whole
    !> Owner of each element, from 0, counted through all blocks (n_elements).
    integer, intent(in) :: part_of_element(:)
    !> The rank, from 0.
    integer, intent(in) :: rank
    !> Number of ranks.
    integer, intent(in) :: n_ranks
    !> The part.
    type(body_part_t), intent(out) :: part
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

  !> The whole body as the part of the only rank.
  subroutine whole_body_part(whole, part)
    !> Mesh of the whole body.
    type(body_mesh_t), intent(in) :: whole
    !> The part.
    type(body_part_t), intent(out) :: part
    integer :: b, i
    part%mesh = whole
    part%n_whole_nodes = whole%n_nodes()
    part%n_own_nodes = part%n_whole_nodes
    part%whole_node = [(i, i=1, part%n_whole_nodes)]
    part%global_node = part%whole_node - 1
    allocate (part%node_rank(part%n_whole_nodes), source=0)
    allocate (part%first_node(0:1))
    part%first_node = [0, part%n_whole_nodes]
    allocate (part%elements(size(whole%block)))
    do b = 1, size(whole%block)
      part%elements(b)%whole = [(i, i=1, size(whole%block(b)%tag))]
      part%elements(b)%n_whole = size(whole%block(b)%tag)
      allocate (part%elements(b)%own(size(whole%block(b)%tag)), source=.true.)
    end do
  end subroutine whole_body_part

  !> Copy the nodes of a part, and number them in its elements.
  subroutine take_nodes(whole, part)
    !> Mesh of the whole body.
    type(body_mesh_t), intent(in) :: whole
    !> The part; on entry its elements have node numbers of the whole body.
    type(body_part_t), intent(inout) :: part
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
    !> Owner of each node of the whole body (n_whole_nodes).
    integer, intent(in) :: owner(:)
    !> The part; its numbering is set.
    type(body_part_t), intent(inout) :: part
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
end module dotyk_mesh_body_part
