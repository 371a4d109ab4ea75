!> The boundary of a volume of which each rank has some elements, and how its parts hang together: what ranks ask the
!> directories of faces and nodes, and what all of them find from what they gather.
module dotyk_model_volume_joints
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_boundary_candidates, only: boundary_candidates_t
  use dotyk_mesh_face_keys, only: answer_keys, directory_of, key_answers_t, key_length, link_nodes, list_nodes, &
    list_tags, max_corners
  use dotyk_mesh_joints, only: joints_t
  use dotyk_mesh_layer_share, only: whole_numbers_t
  use dotyk_mesh_linked_tags, only: linked_tags_t, tag_links_t
  use dotyk_mesh_share_faults, only: pack_faults, share_faults_t
  use dotyk_mesh_shortest_edges, only: find_layer_edges
  use dotyk_mesh_surface_layer, only: surface_layer_t
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: deliver, gather_all
  use dotyk_ranks_item_order, only: by_owner, numbers
  implicit none
  private
  public :: find_boundary, find_joints

contains

  !> Faces of own elements on the boundary of the volume, and what is wrong with faces.
  subroutine find_boundary(own, whole, n_sharers, candidates, faults)
    type(body_mesh_t), intent(in) :: own  !! Elements that this rank owns.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    integer, intent(in) :: n_sharers(:)  !! Number of ranks that have each node (n_nodes).
    type(boundary_candidates_t), intent(out) :: candidates  !! The faces.
    type(share_faults_t), intent(out) :: faults  !! The faults, the same on all ranks.
    type(key_answers_t) :: answers
    integer(int64), allocatable :: packed(:), all(:)
    call candidates%find(own, whole%node, n_sharers, this_rank())
    call ask_directories(candidates%key, answers)
    call candidates%keep_boundary(own, whole%node, answers)
    call pack_faults(own, whole, candidates, packed)
    call gather_all(packed, all)
    call faults%unpack(all)
  end subroutine find_boundary

  !> Ask the directories of the faces and nodes of keys, which are on all ranks.
  subroutine ask_directories(keys, answers)
    integer, intent(in) :: keys(:, :)  !! Keys of this rank (key_length, n).
    type(key_answers_t), intent(out) :: answers  !! What the directories of all ranks tell.
    type(tag_links_t) :: part_links, piece_links
    integer(int64), allocatable :: got(:), back(:), parts(:), pieces(:)
    integer(int64) :: n_from(n_ranks()), n_back(n_ranks())
    integer, allocatable :: order(:), answer(:), node_root(:, :)
    integer :: i
    call deal_columns(keys, [(directory_of(keys(:max_corners, i), n_ranks()), i=1, size(keys, 2))], order, got, n_from)
    call answer_keys(reshape(int(got), [key_length, size(got)/key_length]), answer, piece_links)
    call deliver(int(answer, int64), n_from/key_length, back, n_back)
    allocate (answers%face(size(keys, 2)))
    answers%face(order) = int(back)
    call list_nodes(keys, node_root)
    call deal_columns(node_root, [(directory_of(node_root(:1, i), n_ranks()), i=1, size(node_root, 2))], order, got, &
                      n_from)
    call link_nodes(reshape(int(got), [2, size(got)/2]), part_links)
    call list_tags(keys, parts, pieces)
    call gather_tags(parts, part_links, answers%parts)
    call gather_tags(pieces, piece_links, answers%pieces)
  end subroutine ask_directories

  !> Send columns to ranks.
  subroutine deal_columns(column, to, order, got, n_from)
    integer, intent(in) :: column(:, :)  !! The columns (rows, n).
    integer, intent(in) :: to(:)  !! Rank of each (n).
    integer, allocatable, intent(out) :: order(:)  !! The order in which they are sent (n).
    integer(int64), allocatable, intent(out) :: got(:)  !! What the ranks have sent to this one, rank after rank (any).
    integer(int64), intent(out) :: n_from(:)  !! How many of these numbers are from each rank (n_ranks).
    integer(int64) :: n_to(n_ranks())
    order = by_owner(to)
    n_to = numbers(to, spread(size(column, 1, int64), 1, size(to)))
    call deliver(reshape(int(column(:, order), int64), [size(column)]), n_to, got, n_from)
  end subroutine deal_columns

  !> Tags of all ranks, joined by the links of all directories.
  subroutine gather_tags(tag, links, linked)
    integer(int64), intent(in) :: tag(:)  !! Tags of this rank (any).
    type(tag_links_t), intent(in) :: links  !! Links of its directory.
    type(linked_tags_t), intent(out) :: linked  !! All of them, the same on all ranks.
    integer(int64), allocatable :: own(:), all_tags(:), all_links(:)
    allocate (own(0))
    if (links%n > 0) own = reshape(links%link(:, :links%n), [2*links%n])
    call gather_all(tag, all_tags)
    call gather_all(own, all_links)
    call linked%init(all_tags, reshape(all_links, [2, size(all_links)/2]))
  end subroutine gather_tags

  !> How the parts of the volume hang together.
  subroutine find_joints(own, whole, layer, faults, joints)
    type(body_mesh_t), intent(in) :: own  !! Elements that this rank owns.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    type(surface_layer_t), intent(in) :: layer  !! The surface.
    type(share_faults_t), intent(in) :: faults  !! What is wrong with faces.
    type(joints_t), intent(out) :: joints  !! The joints, the same on all ranks.
    real(dp), allocatable :: shortest(:), length(:)
    integer, allocatable :: node(:)
    integer(int64), allocatable :: all(:)
    integer :: i
    integer(int64) :: n, done
    call find_layer_edges(own, whole, layer, shortest)
    node = pack([(i, i=1, size(shortest))], shortest < huge(shortest))
    call gather_all([size(node, kind=int64), int(node, int64), &
                     transfer(shortest(node), [integer(int64) ::], size(node))], all)
    ! The least of all ranks.
    done = 0
    do while (done < size(all, kind=int64))
      n = all(done + 1)
      node = int(all(done + 2:done + 1 + n))
      length = transfer(all(done + 2 + n:done + 1 + 2*n), [real(dp) ::], int(n))
      shortest(node) = min(shortest(node), length)
      done = done + 1 + 2*n
    end do
    call joints%find_in_layer(layer, shortest, faults)
  end subroutine find_joints
end module dotyk_model_volume_joints
