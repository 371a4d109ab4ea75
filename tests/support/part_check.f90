!> Parts of a body that are made from shares of a mesh file, as ranks would make them, against parts cut from the whole.
module part_check
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_body_part, only: body_part_t
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t, key_length
  use dotyk_mesh_face_keys, only: key_answers_t
  use dotyk_mesh_gmsh, only: read_gmsh
  use dotyk_mesh_layer_share, only: layer_share_t, pack_layer, whole_numbers_t
  use dotyk_mesh_layer_surface, only: find_inner_facets
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_mesh_selection, only: mesh_selection_t
  use dotyk_mesh_node_directory, only: directory_starts, node_directory_t
  use dotyk_mesh_part_assembly, only: extract_share, finish_part, pack_ghosts, take_numbers
  use dotyk_mesh_share_split, only: pack_for_rank, part_bounds_t, share_box, share_curve_t
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use layer_check, only: compare_layer
  use test_cut_body, only: cut_part
  use test_directories, only: answers_to
  implicit none
  private
  public :: check_assembly, move_elements, number_all_nodes

  type, public :: rank_t  !! What one rank has.
    type(mesh_t) :: mesh  !! What it has read of the file.
    type(body_mesh_t) :: own  !! Its own elements.
    type(whole_numbers_t) :: whole  !! Their numbers.
    integer, allocatable :: file_node(:)  !! Nodes by their numbers in the file (n_nodes).
    integer, allocatable :: first(:)  !! Where the nodes of each directory begin (0:n_ranks).
    type(node_directory_t) :: directory  !! Its directory.
    integer, allocatable :: n_sharers(:)  !! Number of ranks that have each node (n_nodes).
    integer, allocatable :: sharer(:)  !! The ranks (any).
    type(boundary_candidates_t) :: candidates  !! Faces on the boundary.
  end type rank_t

contains

  !> Make the parts of a volume, and compare them.
  subroutine check_assembly(file, volume, n_ranks, split, most, message)
    character(*), intent(in) :: file  !! Mesh file.
    character(*), intent(in) :: volume  !! Name of the volume.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    !> Whether elements move to balanced parts; otherwise each rank keeps what it has read.
    logical, intent(in) :: split
    integer, intent(out) :: most  !! Most elements of a part.
    character(:), allocatable, intent(out) :: message  !! The first difference; empty where there is none.
    type(rank_t) :: rank(0:n_ranks - 1)
    type(mesh_selection_t) :: selection
    type(surface_layer_t) :: layer
    type(layer_share_t) :: share
    type(body_part_t) :: part, expected
    type(body_mesh_t) :: body
    type(mesh_t) :: mesh
    type(error_t), allocatable :: error
    integer(int64), allocatable :: number(:), inner(:)
    real(dp), allocatable :: x(:)
    integer, allocatable :: keys(:, :), counts(:, :), owner(:), component(:)
    type(key_answers_t) :: answers
    integer :: r, s, b, n
    message = ''
    most = 0
    selection%everything = .false.
    allocate (selection%volume(1))
    selection%volume(1)%s = volume
    selection%n_shares = n_ranks
    do r = 0, n_ranks - 1
      selection%share = r
      call read_gmsh(file, rank(r)%mesh, error, selection)
      if (.not. allocated(error)) &
        call extract_share(rank(r)%mesh, volume, 3, r, rank(r)%own, rank(r)%whole, rank(r)%file_node, error)
      if (allocated(error)) message = error%message
      if (allocated(error)) return
    end do
    if (split) call move_elements(rank)
    call number_all_nodes(rank)
    ! The whole body.
    call read_gmsh(file, mesh, error)
    call extract_body(mesh, volume, 3, body, error)
    ! Boundary.
    allocate (keys(key_length, 0), number(0), x(0))
    do r = 0, n_ranks - 1
      call rank(r)%candidates%find(rank(r)%own, rank(r)%whole%node, rank(r)%n_sharers, r)
      keys = reshape([keys, rank(r)%candidates%key], [key_length, size(keys, 2) + size(rank(r)%candidates%key, 2)])
    end do
    do r = 0, n_ranks - 1
      call answers_to(rank(r)%candidates%key, keys, answers)
      call rank(r)%candidates%keep_boundary(rank(r)%own, rank(r)%whole%node, answers)
      call find_inner_facets(rank(r)%mesh, rank(r)%own, rank(r)%candidates, inner)
      call pack_layer(rank(r)%own, rank(r)%whole, rank(r)%candidates, inner, body%diameter(), share)
      number = [number, share%number]
      x = [x, share%x]
    end do
    call layer%unpack(file, number, x)
    n = 0
    ! Each rank finds the named surfaces in what it has read.
    call compare_layer(mesh, body, layer, n, message)
    if (message /= '') return
    ! Owners of the elements, to cut the same parts.
    allocate (owner(body%n_elements()), source=-1)
    allocate (counts(0:n_ranks - 1, size(body%block)), source=0)
    do r = 0, n_ranks - 1
      n = 0
      do b = 1, size(body%block)
        if (any(owner(n + rank(r)%whole%block(b)%element) >= 0)) message = 'an element has two owners'
        owner(n + rank(r)%whole%block(b)%element) = r
        n = n + size(body%block(b)%tag)
      end do
      most = max(most, rank(r)%own%n_elements())
    end do
    if (any(owner < 0)) message = 'an element has no owner'
    do r = 0, n_ranks - 1
      number = [integer(int64) ::]
      x = [real(dp) ::]
      do s = n_ranks - 1, 0, -1
        call pack_ghosts(rank(s)%own, rank(s)%whole, rank(s)%candidates, rank(s)%n_sharers, rank(s)%sharer, r, share)
        number = [number, share%number]
        x = [x, share%x]
      end do
      call finish_part(number, x, layer, rank(r)%directory%first_node, r, n_ranks, part, component)
      call cut_part(body, owner, r, n_ranks, expected)
      call compare_parts(expected, part, message)
      if (message /= '') return
    end do
  end subroutine check_assembly

  !> Move elements to balanced parts.
  subroutine move_elements(rank)
    type(rank_t), intent(inout) :: rank(0:)  !! All ranks (0:n_ranks-1).
    type(surface_layer_t) :: got(0:size(rank) - 1)
    type(layer_share_t) :: share
    type(share_curve_t) :: curve(0:size(rank) - 1)
    type(part_bounds_t) :: bounds
    integer(int64), allocatable :: number(:), n_nodes(:)
    real(dp), allocatable :: x(:)
    real(dp) :: low(3), high(3), lo(3), hi(3)
    integer(int64) :: weight
    integer, allocatable :: part(:)
    integer :: r, s, b
    low = huge(low)
    high = -huge(high)
    do r = 0, size(rank) - 1
      call share_box(rank(r)%own, lo, hi)
      low = min(low, lo)
      high = max(high, hi)
    end do
    weight = 0
    do r = 0, size(rank) - 1
      call curve(r)%init(rank(r)%own, low, high)
      weight = weight + sum([(size(rank(r)%own%block(b)%node), b=1, size(rank(r)%own%block))])
    end do
    call bounds%init(size(rank), weight, 1, 0_int64, weight)
    do while (size(bounds%probe) > 0)
      n_nodes = curve(0)%nodes_before(bounds%probe)
      do r = 1, size(rank) - 1
        n_nodes = n_nodes + curve(r)%nodes_before(bounds%probe)
      end do
      call bounds%narrow(n_nodes)
    end do
    do r = 0, size(rank) - 1
      number = [integer(int64) ::]
      x = [real(dp) ::]
      do s = 0, size(rank) - 1
        call bounds%parts_of(curve(s), part)
        call pack_for_rank(rank(s)%own, rank(s)%whole, rank(s)%file_node, rank(s)%mesh%n_file_nodes, part, r, share)
        number = [number, share%number]
        x = [x, share%x]
      end do
      call got(r)%unpack(rank(r)%own%file, number, x)
    end do
    do r = 0, size(rank) - 1
      rank(r)%own = got(r)%mesh
      rank(r)%whole = got(r)%whole
      rank(r)%whole%rank = r
      rank(r)%file_node = got(r)%whole%node
    end do
  end subroutine move_elements

  !> Number the nodes by the directories.
  subroutine number_all_nodes(rank)
    type(rank_t), intent(inout) :: rank(0:)  !! All ranks (0:n_ranks-1).
    integer :: n_from(0:size(rank) - 1), counts(0:size(rank) - 1, 0:size(rank) - 1), r, d, n
    integer, allocatable :: nodes(:), reply(:, :), all_replies(:, :), n_sharers(:), sharer(:)
    n = size(rank)
    do r = 0, n - 1
      call directory_starts(rank(r)%file_node, n, rank(r)%mesh%n_file_nodes, rank(r)%first)
    end do
    do d = 0, n - 1
      nodes = [integer ::]
      do r = 0, n - 1
        nodes = [nodes, rank(r)%file_node(rank(r)%first(d):rank(r)%first(d + 1) - 1)]
        n_from(r) = rank(r)%first(d + 1) - rank(r)%first(d)
      end do
      call rank(d)%directory%register(d, n, rank(d)%mesh%n_file_nodes, nodes, n_from)
      counts(:, d) = rank(d)%directory%counts
    end do
    do d = 0, n - 1
      call rank(d)%directory%set_offsets(sum(counts(:, :d - 1), dim=2), sum(counts, dim=2), sum(counts(:, :d - 1)))
    end do
    do r = 0, n - 1
      allocate (rank(r)%n_sharers(0), rank(r)%sharer(0))
      all_replies = reshape([integer ::], [3, 0])
      do d = 0, n - 1
        nodes = rank(r)%file_node(rank(r)%first(d):rank(r)%first(d + 1) - 1)
        call rank(d)%directory%answer(nodes, reply)
        all_replies = reshape([all_replies, reply], [3, size(all_replies, 2) + size(nodes)])
        call rank(d)%directory%answer_sharers(nodes, n_sharers, sharer)
        rank(r)%n_sharers = [rank(r)%n_sharers, n_sharers]
        rank(r)%sharer = [rank(r)%sharer, sharer]
      end do
      call take_numbers(all_replies, rank(r)%directory%first_node(n), rank(r)%whole)
    end do
  end subroutine number_all_nodes

  !> Compare two parts.
  subroutine compare_parts(a, b, message)
    type(body_part_t), intent(in) :: a  !! Cut from the whole body.
    type(body_part_t), intent(in) :: b  !! Made from shares.
    character(:), allocatable, intent(out) :: message  !! The first difference; empty where there is none.
    integer :: k
    message = ''
    if (a%rank /= b%rank .or. a%n_ranks /= b%n_ranks .or. a%n_whole_nodes /= b%n_whole_nodes .or. &
        a%n_own_nodes /= b%n_own_nodes .or. any(a%first_node /= b%first_node)) message = 'numbers of the part'
    if (size(a%whole_node) /= size(b%whole_node)) then
      message = 'number of nodes'
      return
    end if
    if (any(a%whole_node /= b%whole_node)) message = 'nodes'
    if (any(a%node_rank /= b%node_rank)) message = 'owners of nodes'
    if (any(a%global_node /= b%global_node)) message = 'global numbers'
    if (any(abs(a%mesh%x - b%mesh%x) > 0)) message = 'coordinates'
    if (any(a%mesh%node_tag /= b%mesh%node_tag)) message = 'node tags'
    do k = 1, size(a%elements)
      if (size(a%elements(k)%whole) /= size(b%elements(k)%whole)) then
        message = 'number of elements'
        return
      end if
      if (a%mesh%block(k)%kind /= b%mesh%block(k)%kind) message = 'kinds'
      if (a%elements(k)%n_whole /= b%elements(k)%n_whole) message = 'elements of the whole body'
      if (any(a%elements(k)%whole /= b%elements(k)%whole)) message = 'elements'
      if (any(a%elements(k)%own .neqv. b%elements(k)%own)) message = 'owners of elements'
      if (any(a%mesh%block(k)%tag /= b%mesh%block(k)%tag)) message = 'element tags'
      if (any(a%mesh%block(k)%node /= b%mesh%block(k)%node)) message = 'nodes of elements'
    end do
  end subroutine compare_parts
end module part_check
