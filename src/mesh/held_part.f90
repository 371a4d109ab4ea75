!> The part of a body that a rank goes on with after the body was read and numbered: some elements with their nodes, and
!> all nodes of the boundary, in the order of the whole body. What depends on the rest is kept as numbers
!> (`dotyk_mesh_body_mesh`), so that all that looks at the surface finds the same to the bit as in the whole mesh.
module dotyk_mesh_held_part
  use dotyk_base_kinds, only: dp
  use dotyk_mesh_body_mesh, only: body_mesh_t, connected_components, whole_body_t
  use dotyk_mesh_boundary, only: extract_boundary
  use dotyk_mesh_surface, only: surface_nodes, surface_t
  implicit none
  private
  public :: describe_whole, choose_part, hold_part, surface_part, held_surface, sample_step

  !> Layers of elements that a rank holds around its own ones: recovered strains at the nodes of its elements need
  !> those of all vertices around them.
  integer, parameter :: n_ghost_layers = 2
  integer, parameter :: most_samples = 64  !! Elements of a block that are held as samples of the interior, at most.

contains

  !> What every part knows of a whole body.
  subroutine describe_whole(mesh, extent, whole)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the whole body.
    real(dp), intent(in) :: extent  !! Shortest extent of the body [length].
    !> The body; components, facets and nodes in the numbers of the whole body, owners not known.
    type(whole_body_t), intent(out) :: whole
    type(surface_t) :: boundary
    integer :: b
    whole%n_nodes = mesh%n_nodes()
    whole%n_file_nodes = mesh%n_file_nodes()
    whole%diameter = mesh%diameter()
    whole%shortest_extent = extent
    whole%n_of_block = [(size(mesh%block(b)%tag), b=1, size(mesh%block))]
    allocate (whole%component(mesh%n_nodes()))
    call connected_components(mesh, whole%component, whole%n_components)
    call extract_boundary(mesh, boundary)
    call move_alloc(boundary%kind, whole%facet_kind)
    call move_alloc(boundary%node, whole%facet_node)
  end subroutine describe_whole

  !> What a rank holds that does not compute the body: samples of its elements, and all nodes that every rank holds.
  subroutine surface_part(mesh, holds, node)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the whole body.
    logical, allocatable, intent(out) :: holds(:)  !! Whether each element is held, through all blocks (n_elements).
    integer, allocatable, intent(out) :: node(:)  !! Nodes of the boundary and of the held elements, ascending (n).
    type(surface_t) :: boundary
    logical, allocatable :: held(:)
    integer, allocatable :: of_boundary(:)
    integer :: b, e, n
    allocate (holds(mesh%n_elements()), held(mesh%n_nodes()), source=.false.)
    call hold_samples(mesh, holds)
    call extract_boundary(mesh, boundary)
    call surface_nodes(boundary, of_boundary)
    held(of_boundary) = .true.
    n = 0
    do b = 1, size(mesh%block)
      associate (of_element => mesh%block(b)%node)
        do e = 1, size(of_element, 2)
          if (holds(n + e)) held(of_element(:, e)) = .true.
        end do
        n = n + size(of_element, 2)
      end associate
    end do
    node = pack([(e, e=1, size(held))], held)
  end subroutine surface_part

  !> Hold samples of the elements.
  pure subroutine hold_samples(mesh, holds)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the whole body.
    logical, intent(inout) :: holds(:)  !! Whether each element is held, through all blocks (n_elements).
    integer :: b, n
    n = 0
    do b = 1, size(mesh%block)
      associate (m => size(mesh%block(b)%tag))
        holds(n + 1:n + m:sample_step(m)) = .true.
        n = n + m
      end associate
    end do
  end subroutine hold_samples

  !> What a rank holds and computes of a body that all ranks compute together: its own elements, those around them, and
  !> samples of the others.
  pure subroutine choose_part(mesh, element_rank, rank, holds, own_node)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the whole body.
    integer, intent(in) :: element_rank(:)  !! Rank of each element, from 0, through all blocks (n_elements).
    integer, intent(in) :: rank  !! The rank, from 0.
    logical, allocatable, intent(out) :: holds(:)  !! Whether it holds each element, through all blocks (n_elements).
    !> Whether it computes each node: it is the lowest rank that has an element with it (n_nodes).
    logical, allocatable, intent(out) :: own_node(:)
    integer, allocatable :: lowest(:)
    integer :: b, e, n, layer
    holds = element_rank == rank
    do layer = 1, n_ghost_layers
      call add_neighbours(mesh, holds)
    end do
    call hold_samples(mesh, holds)
    allocate (lowest(mesh%n_nodes()), source=huge(0))
    n = 0
    do b = 1, size(mesh%block)
      associate (node => mesh%block(b)%node)
        do e = 1, size(node, 2)
          lowest(node(:, e)) = min(lowest(node(:, e)), element_rank(n + e))
        end do
        n = n + size(node, 2)
      end associate
    end do
    own_node = lowest == rank
  end subroutine choose_part

  !> Add all elements that have a node of one that is held.
  pure subroutine add_neighbours(mesh, holds)
    type(body_mesh_t), intent(in) :: mesh  !! Mesh of the whole body.
    logical, intent(inout) :: holds(:)  !! Whether each element is held, through all blocks (n_elements).
    logical, allocatable :: at(:)
    integer :: b, e, n, pass
    allocate (at(mesh%n_nodes()), source=.false.)
    do pass = 1, 2
      n = 0
      do b = 1, size(mesh%block)
        associate (node => mesh%block(b)%node)
          do e = 1, size(node, 2)
            if (pass == 2) then
              holds(n + e) = any(at(node(:, e)))
            else if (holds(n + e)) then
              at(node(:, e)) = .true.
            end if
          end do
          n = n + size(node, 2)
        end associate
      end do
    end do
  end subroutine add_neighbours

  !> Every so many elements of a block one is a sample of it, from the first one on.
  pure integer function sample_step(n)
    integer, intent(in) :: n  !! Number of elements of the block.
    sample_step = 1 + n/most_samples
  end function sample_step

  !> Reduce a whole mesh to the part that a rank holds.
  subroutine hold_part(mesh, whole_body, holds, own_element, own_node, number)
    type(body_mesh_t), intent(inout) :: mesh  !! Mesh of the whole body in, held part out.
    type(whole_body_t), intent(in) :: whole_body  !! The whole body, as from `describe_whole`.
    logical, intent(in) :: holds(:)  !! Whether each element is held, through all blocks (n_elements).
    logical, intent(in) :: own_element(:)  !! Whether this rank computes it; it is held then (n_elements).
    logical, intent(in) :: own_node(:)  !! Whether this rank computes each node, of a held element (n_nodes).
    integer, allocatable, intent(out) :: number(:)  !! Number of each node in the held part, or 0 (n_nodes).
    type(whole_body_t) :: whole
    logical, allocatable :: held(:)
    integer, allocatable :: chosen(:)
    integer :: b, e, i, n
    whole = whole_body
    allocate (held(mesh%n_nodes()), source=.false.)
    do i = 1, size(whole%facet_node, 2)
      associate (node => whole%facet_node(:, i))
        held(pack(node, node > 0)) = .true.
      end associate
    end do
    allocate (whole%element(0), whole%own_element(0))
    n = 0
    do b = 1, size(mesh%block)
      associate (block => mesh%block(b))
        chosen = pack([(e, e=1, size(block%tag))], holds(n + 1:n + size(block%tag)))
        whole%element = [whole%element, chosen]
        whole%own_element = [whole%own_element, own_element(n + chosen)]
        n = n + size(block%tag)
        block%node = block%node(:, chosen)
        block%tag = block%tag(chosen)
        do e = 1, size(chosen)
          held(block%node(:, e)) = .true.
        end do
      end associate
    end do
    whole%node = pack([(i, i=1, size(held))], held)
    whole%own_node = own_node(whole%node)
    whole%component = whole%component(whole%node)
    allocate (number(size(held)), source=0)
    number(whole%node) = [(i, i=1, size(whole%node))]
    do b = 1, size(mesh%block)
      associate (node => mesh%block(b)%node)
        do e = 1, size(node, 2)
          node(:, e) = number(node(:, e))
        end do
      end associate
    end do
    mesh%x = mesh%x(:, whole%node)
    mesh%node_tag = mesh%node_tag(whole%node)
    ! Nodes from order elevation are not in the file.
    if (allocated(mesh%mesh_node)) mesh%mesh_node = mesh%mesh_node(pack(whole%node, whole%node <= size(mesh%mesh_node)))
    call renumber(whole%facet_node, number)
    if (allocated(mesh%whole)) deallocate (mesh%whole)
    allocate (mesh%whole)
    mesh%whole = whole
  end subroutine hold_part

  !> A surface of the whole body in the numbers of the held part; parents that are not held become 0.
  subroutine held_surface(mesh, number, surface)
    type(body_mesh_t), intent(in) :: mesh  !! Held part.
    integer, intent(in) :: number(:)  !! Number of each node of the whole body in it, as from `hold_part` (n_nodes).
    type(surface_t), intent(inout) :: surface  !! Surface.
    integer, allocatable :: held(:)
    integer :: b, e, f, before
    call renumber(surface%node, number)
    before = 0
    do b = 1, size(mesh%block)
      allocate (held(mesh%whole%n_of_block(b)), source=0)
      associate (n => size(mesh%block(b)%tag))
        held(mesh%whole%element(before + 1:before + n)) = [(e, e=1, n)]
        before = before + n
      end associate
      do f = 1, surface%n_facets
        if (surface%block(f) == b) surface%element(f) = held(surface%element(f))
      end do
      deallocate (held)
    end do
  end subroutine held_surface

  !> Nodes of facets in other numbers.
  pure subroutine renumber(node, number)
    integer, intent(inout) :: node(:, :)  !! Nodes, padded with 0 (max_facet_nodes, n_facets).
    integer, intent(in) :: number(:)  !! Number of each (n_nodes).
    integer :: f, i
    do f = 1, size(node, 2)
      do i = 1, size(node, 1)
        if (node(i, f) > 0) node(i, f) = number(node(i, f))
      end do
    end do
  end subroutine renumber
end module dotyk_mesh_held_part
