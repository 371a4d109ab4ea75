!> How bodies hang together and what is refused, found by ranks that have shares of their elements, against the same of
!> the whole body.
module joints_check
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t, extract_body
  use dotyk_mesh_boundary_candidates, only: key_length
  use dotyk_mesh_element, only: kind_dimension
  use dotyk_mesh_face_keys, only: key_answers_t
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_layer_share, only: layer_share_t, pack_layer
  use dotyk_mesh_mesh, only: mesh_t
  use dotyk_mesh_part_assembly, only: extract_share
  use dotyk_mesh_share_checks, only: check_extent, orient_share, pack_extent, pack_orientation
  use dotyk_mesh_share_faults, only: pack_faults, share_faults_t
  use dotyk_mesh_shortest_edges, only: find_layer_edges
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use part_check, only: move_elements, number_all_nodes, rank_t
  use test_directories, only: answers_to
  implicit none
  private
  public :: check_shares, find_of_shares

contains

  !> Compare joints and errors of the whole body with those of shares of it.
  subroutine check_shares(mesh, volume, dimension, owner, n_ranks, split, found, message)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    character(*), intent(in) :: volume  !! Name of the volume.
    integer, intent(in) :: dimension  !! Dimension of space.
    !> Rank that reads each element of this dimension, counted through all blocks of the mesh (n_elements).
    integer, intent(in) :: owner(:)
    integer, intent(in) :: n_ranks  !! Number of ranks.
    logical, intent(in) :: split  !! Whether elements move to balanced parts.
    character(:), allocatable, intent(out) :: found  !! What is found of the whole body, or its error.
    character(:), allocatable, intent(out) :: message  !! The first difference; empty where there is none.
    type(body_mesh_t) :: body
    type(joints_t) :: expected, joints
    type(error_t), allocatable :: expected_error, error
    call extract_body(mesh, volume, dimension, body, expected_error)
    call find_of_shares(mesh, volume, dimension, owner, n_ranks, split, joints, error)
    message = ''
    found = ''
    if (allocated(expected_error)) then
      found = expected_error%message
      if (.not. allocated(error)) then
        message = 'no error in place of: '//expected_error%message
      else if (error%message /= expected_error%message) then
        message = error%message//' in place of: '//expected_error%message
      else if (error%code /= expected_error%code) then
        message = 'exit code'
      end if
      return
    end if
    if (allocated(error)) then
      message = 'refused: '//error%message
      return
    end if
    call expected%find(body)
    if (joints%n_parts /= expected%n_parts) message = 'number of parts'
    if (joints%n_pieces /= expected%n_pieces) message = 'number of pieces'
    call compare(expected%crack, joints%crack)
    call compare(expected%fault, joints%fault)
    call compare(expected%slit, joints%slit)

  contains

    !> Compare two texts.
    subroutine compare(a, b)
      character(:), allocatable, intent(in) :: a  !! Text of the whole body.
      character(:), allocatable, intent(in) :: b  !! Text of the shares.
      character(:), allocatable :: text, other
      text = ''
      other = ''
      if (allocated(a)) text = a
      if (allocated(b)) other = b
      if (text /= other) message = '"'//other//'" in place of "'//text//'"'
      found = found//text
    end subroutine compare
  end subroutine check_shares

  !> Find how a body hangs together as ranks would.
  subroutine find_of_shares(mesh, volume, dimension, owner, n_ranks, split, joints, error)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    character(*), intent(in) :: volume  !! Name of the volume.
    integer, intent(in) :: dimension  !! Dimension of space.
    !> Rank that reads each element of this dimension, counted through all blocks of the mesh (n_elements).
    integer, intent(in) :: owner(:)
    integer, intent(in) :: n_ranks  !! Number of ranks.
    logical, intent(in) :: split  !! Whether elements move to balanced parts.
    type(joints_t), intent(out) :: joints  !! The joints, the same on all ranks.
    type(error_t), allocatable, intent(out) :: error  !! What `extract_body` would refuse.
    type(rank_t) :: rank(0:n_ranks - 1)
    type(share_faults_t) :: faults
    type(surface_layer_t) :: layer
    type(layer_share_t) :: share
    integer(int64), allocatable :: packed(:), all(:), number(:)
    real(dp), allocatable :: x(:), shortest(:), least(:)
    integer, allocatable :: keys(:, :)
    type(key_answers_t) :: answers
    integer :: r
    allocate (all(0))
    do r = 0, n_ranks - 1
      call read_share(mesh, dimension, owner, r, rank(r)%mesh)
      call extract_share(rank(r)%mesh, volume, dimension, r, rank(r)%own, rank(r)%whole, rank(r)%file_node, error)
      if (allocated(error)) return
      call pack_extent(rank(r)%mesh, rank(r)%own, rank(r)%file_node, packed)
      all = [all, packed]
    end do
    call check_extent(rank(0)%own, volume, all, error)
    if (allocated(error)) return
    if (split) call move_elements(rank)
    all = all(:0)
    do r = 0, n_ranks - 1
      call pack_orientation(rank(r)%own, rank(r)%whole, packed)
      all = [all, packed]
    end do
    do r = 0, n_ranks - 1
      call orient_share(rank(r)%own, volume, all, error)
    end do
    call number_all_nodes(rank)
    allocate (keys(key_length, 0))
    do r = n_ranks - 1, 0, -1
      call rank(r)%candidates%find(rank(r)%own, rank(r)%whole%node, rank(r)%n_sharers, r)
      keys = reshape([keys, rank(r)%candidates%key], [key_length, size(keys, 2) + size(rank(r)%candidates%key, 2)])
    end do
    all = all(:0)
    do r = 0, n_ranks - 1
      call answers_to(rank(r)%candidates%key, keys, answers)
      call rank(r)%candidates%keep_boundary(rank(r)%own, rank(r)%whole%node, answers)
      call pack_faults(rank(r)%own, rank(r)%whole, rank(r)%candidates, packed)
      all = [packed, all]
    end do
    call faults%unpack(all)
    call faults%check_repeated(mesh%file, volume, error)
    if (allocated(error)) return
    allocate (number(0), x(0))
    do r = 0, n_ranks - 1
      call pack_layer(rank(r)%own, rank(r)%whole, rank(r)%candidates, [integer(int64) ::], 1.0_dp, share)
      number = [number, share%number]
      x = [x, share%x]
    end do
    call layer%unpack(mesh%file, number, x)
    allocate (least(layer%mesh%n_nodes()), source=huge(0.0_dp))
    do r = 0, n_ranks - 1
      call find_layer_edges(rank(r)%own, rank(r)%whole, layer, shortest)
      least = min(least, shortest)
    end do
    call joints%find_in_layer(layer, least, faults)
  end subroutine find_of_shares

  !> What a rank reads of a mesh: its elements of the dimension of space, and their nodes.
  subroutine read_share(mesh, dimension, owner, rank, share)
    type(mesh_t), intent(in) :: mesh  !! The mesh.
    integer, intent(in) :: dimension  !! Dimension of space.
    integer, intent(in) :: owner(:)  !! Rank that reads each element, counted through all blocks (n_elements).
    integer, intent(in) :: rank  !! The rank.
    type(mesh_t), intent(out) :: share  !! What it reads.
    integer, allocatable :: chosen(:), number(:)
    logical, allocatable :: used(:)
    integer :: b, e, i, n
    share%file = mesh%file
    share%group = mesh%group
    share%block = pack(mesh%block, [(kind_dimension(mesh%block(b)%kind) == dimension, b=1, size(mesh%block))])
    allocate (used(size(mesh%x, 2)), source=.false.)
    n = 0
    do b = 1, size(share%block)
      associate (block => share%block(b))
        block%n_in_file = size(block%tag)
        chosen = pack([(e, e=1, size(block%tag))], owner(n + 1:n + size(block%tag)) == rank)
        n = n + size(block%tag)
        block%place = chosen
        block%node = block%node(:, chosen)
        block%tag = block%tag(chosen)
        do e = 1, size(chosen)
          used(block%node(:, e)) = .true.
        end do
      end associate
    end do
    share%n_file_nodes = size(used)
    share%file_node = pack([(i, i=1, size(used))], used)
    share%x = mesh%x(:, share%file_node)
    share%node_tag = mesh%node_tag(share%file_node)
    allocate (number(size(used)), source=0)
    number(share%file_node) = [(i, i=1, size(share%file_node))]
    do b = 1, size(share%block)
      do e = 1, size(share%block(b)%tag)
        share%block(b)%node(:, e) = number(share%block(b)%node(:, e))
      end do
    end do
  end subroutine read_share
end module joints_check
