!> The part of a body that a rank holds, made without the whole body: from the elements that the rank owns.
!>
!> The way, in which all ranks do the same: `extract_share` of what the rank has read; `check_extent`; maybe
!> `dotyk_mesh_share_split`; `orient_share`; `node_directory_t` for the numbers of the nodes, and `take_numbers`;
!> `boundary_candidates_t`, `dotyk_mesh_share_faults` and the surface layer, from which `joints_t` follows;
!> `pack_ghosts` for each other rank; `finish_part`. Between these steps ranks exchange plain arrays.
module dotyk_mesh_part_assembly
  use dotyk_base_error, only: error_t, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_text, only: quoted
  use dotyk_mesh_body_mesh, only: body_mesh_t, number_nodes
  use dotyk_mesh_body_part, only: body_part_t
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_element, only: kind_dimension, kind_nodes, n_element_kinds
  use dotyk_mesh_held_part, only: sample_step
  use dotyk_mesh_layer_share, only: layer_share_t, no_elements, pack_items, whole_numbers_t
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_physical_group, only: fault_of_volume, groups_named, material_of_block, n_materials_of
  use dotyk_mesh_surface_layer, only: surface_layer_t
  implicit none
  private
  public :: extract_share, take_numbers, pack_ghosts, pack_samples, finish_part

contains

  !> Elements of a body in what a rank has read, maybe none.
  subroutine extract_share(mesh, volume_name, dimension, rank, own, whole, file_node, error)
    type(mesh_t), intent(in) :: mesh  !! Mesh, of which the rank has read a share.
    character(*), intent(in) :: volume_name  !! Name of the physical groups.
    integer, intent(in) :: dimension  !! Dimension of space.
    integer, intent(in) :: rank  !! This rank, from 0.
    type(body_mesh_t), intent(out) :: own  !! The elements, and their nodes in the order of the file.
    type(whole_numbers_t), intent(out) :: whole  !! Their numbers in the whole body; those of nodes are not known yet.
    integer, allocatable, intent(out) :: file_node(:)  !! Number of each node in the file, ascending (n_nodes).
    !> Set for an unknown name and an empty group, on all ranks alike; elements and nodes are not checked
    !> (`dotyk_mesh_share_checks`).
    type(error_t), allocatable, intent(out) :: error
    logical :: wanted(size(mesh%group))
    logical, allocatable :: has_kind(:, :)
    integer :: b, kind, m, n
    wanted = groups_named(mesh, trim(volume_name), dimension)
    call fault_of_volume(mesh, trim(volume_name), dimension, error)
    if (allocated(error)) return
    own%file = mesh%file
    own%dimension = dimension
    whole%rank = rank
    allocate (has_kind(n_element_kinds, n_materials_of(mesh, wanted)), source=.false.)
    do b = 1, size(mesh%block)
      if (is_wanted(b)) has_kind(mesh%block(b)%kind, material_of_block(mesh, wanted, b)) = .true.
    end do
    allocate (own%block(count(has_kind)), whole%block(count(has_kind)))
    if (size(own%block) == 0) then
      call set_error(error, 'mesh '//quoted(mesh%file)//': physical group '//quoted(volume_name)//' has no elements')
      return
    end if
    n = 0
    do m = 1, size(has_kind, 2)
      do kind = 1, n_element_kinds
        if (.not. has_kind(kind, m)) cycle
        n = n + 1
        own%block(n)%kind = kind
        own%block(n)%material = m
        call gather_kind(n)
      end do
    end do
    call number_nodes(mesh, own)
    file_node = own%mesh_node
    if (allocated(mesh%file_node)) file_node = mesh%file_node(own%mesh_node)

  contains

    !> Whether a block of the mesh has the dimension and belongs to one of the groups, and elements in the file.
    pure logical function is_wanted(b)
      integer, intent(in) :: b  !! Block of the mesh.
      is_wanted = .false.
      if (kind_dimension(mesh%block(b)%kind) /= dimension .or. number_of(b) == 0) return
      is_wanted = any(wanted(mesh%block(b)%group))
    end function is_wanted

    !> Number of elements of a block in the file.
    pure integer function number_of(b)
      integer, intent(in) :: b  !! Block of the mesh.
      number_of = size(mesh%block(b)%tag)
      if (allocated(mesh%block(b)%place)) number_of = mesh%block(b)%n_in_file
    end function number_of

    !> Gather the elements of one kind and material.
    subroutine gather_kind(n)
      integer, intent(in) :: n  !! Block of the share.
      integer :: b, e, before, i
      before = 0
      associate (block => own%block(n))
        allocate (block%node(kind_nodes(block%kind), 0), block%tag(0), whole%block(n)%element(0))
        do b = 1, size(mesh%block)
          if (mesh%block(b)%kind /= block%kind) cycle
          if (.not. is_wanted(b)) cycle
          if (material_of_block(mesh, wanted, b) /= block%material) cycle
          i = size(block%tag)
          block%node = reshape([block%node, mesh%block(b)%node], &
                               [size(block%node, 1), i + size(mesh%block(b)%tag)])
          block%tag = [block%tag, mesh%block(b)%tag]
          if (allocated(mesh%block(b)%place)) then
            whole%block(n)%element = [whole%block(n)%element, before + mesh%block(b)%place]
          else
            whole%block(n)%element = [whole%block(n)%element, [(before + e, e=1, size(mesh%block(b)%tag))]]
          end if
          before = before + number_of(b)
        end do
      end associate
      whole%block(n)%n_elements = before
    end subroutine gather_kind
  end subroutine extract_share

  !> Take the answers of the directories.
  subroutine take_numbers(reply, n_whole_nodes, whole)
    integer, intent(in) :: reply(:, :)  !! Number in the whole body, owner and global number of each node (3, n_nodes).
    integer, intent(in) :: n_whole_nodes  !! Number of nodes of the whole body.
    type(whole_numbers_t), intent(inout) :: whole  !! Numbers of the rank; those of nodes are set.
    whole%n_nodes = n_whole_nodes
    whole%node = reply(1, :)
    whole%node_rank = reply(2, :)
    whole%global_node = reply(3, :)
  end subroutine take_numbers

  !> Pack the elements that are ghosts of another rank, those at its nodes; or all, for this rank itself.
  subroutine pack_ghosts(own, whole, candidates, n_sharers, sharer, rank, share)
    type(body_mesh_t), intent(in) :: own  !! Elements that this rank owns.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    !> Faces of the elements, of which the parts of the body are taken.
    type(boundary_candidates_t), intent(in) :: candidates
    integer, intent(in) :: n_sharers(:)  !! Number of ranks that have each node (n_nodes).
    integer, intent(in) :: sharer(:)  !! The ranks, node after node (any).
    integer, intent(in) :: rank  !! The rank that gets them.
    type(layer_share_t), intent(out) :: share  !! What is sent.
    logical, allocatable :: has(:, :), at(:)
    integer :: b, e, i, k
    allocate (at(own%n_nodes()))
    k = 0
    do i = 1, size(at)
      at(i) = any(sharer(k + 1:k + n_sharers(i)) == rank)
      k = k + n_sharers(i)
    end do
    call no_elements(own, has)
    do b = 1, size(own%block)
      do e = 1, size(own%block(b)%tag)
        has(e, b) = any(at(own%block(b)%node(:, e)))
      end do
    end do
    call pack_items(own, whole, has, spread(.false., 1, size(at)), candidates, 0, [integer(int64) ::], 0.0_dp, share)
  end subroutine pack_ghosts

  !> Pack the elements that all ranks hold, samples of the interior.
  subroutine pack_samples(own, whole, candidates, share)
    type(body_mesh_t), intent(in) :: own  !! Elements that this rank owns.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    !> Faces of the elements, of which the parts of the body are taken.
    type(boundary_candidates_t), intent(in) :: candidates
    type(layer_share_t), intent(out) :: share  !! What is sent.
    logical, allocatable :: has(:, :)
    integer :: b
    call no_elements(own, has)
    do b = 1, size(own%block)
      associate (element => whole%block(b)%element)
        has(:size(element), b) = mod(element - 1, sample_step(whole%block(b)%n_elements)) == 0
      end associate
    end do
    call pack_items(own, whole, has, spread(.false., 1, own%n_nodes()), candidates, 0, [integer(int64) ::], 0.0_dp, &
                    share)
  end subroutine pack_samples

  !> Put own elements, ghosts and the nodes on the boundary together.
  subroutine finish_part(number, x, layer, first_node, rank, n_ranks, part, component)
    !> Whole numbers of the shares from `pack_ghosts` of all ranks for this one, one after the other (any).
    integer(int64), intent(in) :: number(:)
    real(dp), intent(in) :: x(:)  !! Their coordinates (any) [length].
    type(surface_layer_t), intent(in) :: layer  !! Surface layer of the body.
    !> The nodes of rank r have the global numbers first_node(r) .. first_node(r + 1) - 1 (0:n_ranks).
    integer, intent(in) :: first_node(0:)
    integer, intent(in) :: rank  !! This rank, from 0.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    type(body_part_t), intent(out) :: part  !! The part; `mesh_node` is not allocated.
    !> Connected part of the body to which each node belongs (n_nodes).
    integer, allocatable, intent(out) :: component(:)
    type(surface_layer_t) :: all
    type(layer_share_t) :: boundary
    type(boundary_candidates_t) :: nothing
    logical, allocatable :: has(:, :), on_boundary(:)
    integer :: b, f
    allocate (on_boundary(0:layer%mesh%n_nodes()), source=.false.)
    do f = 1, layer%boundary%n_facets
      on_boundary(layer%boundary%node(:, f)) = .true.
    end do
    call no_elements(layer%mesh, has)
    nothing%root = layer%root
    call pack_items(layer%mesh, layer%whole, has, on_boundary(1:), nothing, 0, [integer(int64) ::], 0.0_dp, boundary)
    call all%unpack(layer%mesh%file, [number, boundary%number], [x, boundary%x])
    part%rank = rank
    part%n_ranks = n_ranks
    call move_alloc(all%component, component)
    part%mesh = all%mesh
    part%n_whole_nodes = all%whole%n_nodes
    part%whole_node = all%whole%node
    part%node_rank = all%whole%node_rank
    part%global_node = all%whole%global_node
    allocate (part%first_node(0:n_ranks))
    part%first_node = first_node
    part%n_own_nodes = first_node(rank + 1) - first_node(rank)
    allocate (part%elements(size(part%mesh%block)))
    do b = 1, size(part%elements)
      part%elements(b)%own = all%element_rank(b)%of == rank
      part%elements(b)%whole = all%whole%block(b)%element
      part%elements(b)%n_whole = all%whole%block(b)%n_elements
    end do
  end subroutine finish_part
end module dotyk_mesh_part_assembly
