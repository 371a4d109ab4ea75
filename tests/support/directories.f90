!> What the directories of faces and nodes tell ranks, as in `dotyk_model_volume_joints`, without ranks.
module test_directories
  use dotyk_base_kinds, only: int64
  use dotyk_mesh_corner_table, only: corner_table_t
  use dotyk_mesh_face_keys, only: answer_keys, directory_of, key_answers_t, link_nodes, list_nodes, &
    list_tags, max_corners
  use dotyk_mesh_linked_tags, only: tag_links_t
  implicit none
  private
  public :: answers_to

  integer, parameter :: n_directories = 3  !! Number of directories: not that of the ranks.

contains

  !> Answers to the keys of one rank.
  subroutine answers_to(own, keys, answers)
    integer, intent(in) :: own(:, :)  !! Its keys (key_length, n).
    integer, intent(in) :: keys(:, :)  !! Keys of all ranks, in any order (key_length, any).
    type(key_answers_t), intent(out) :: answers  !! What the directories tell.
    type(tag_links_t) :: links
    type(corner_table_t) :: table
    integer, allocatable :: chosen(:), answer(:), node_root(:, :), of_key(:), of_entry(:)
    integer(int64), allocatable :: parts(:), pieces(:), part_links(:, :), piece_links(:, :)
    integer :: d, i, k
    allocate (of_key(size(keys, 2)))
    allocate (part_links(2, 0), piece_links(2, 0), node_root(2, max_corners*size(keys, 2)))
    do d = 0, n_directories - 1
      chosen = pack([(i, i=1, size(keys, 2))], &
                    [(directory_of(keys(:max_corners, i), n_directories) == d, i=1, size(keys, 2))])
      call answer_keys(keys(:, chosen), answer, links)
      piece_links = with(piece_links, links)
      of_key(chosen) = answer
    end do
    ! All ranks get the same answer to a face.
    call table%init(max_corners, size(keys, 2))
    allocate (of_entry(size(keys, 2)))
    do i = 1, size(keys, 2)
      call table%add(pack(keys(:max_corners, i), keys(:max_corners, i) > 0), k)
      of_entry(k) = of_key(i)
    end do
    answers%face = of_entry([(table%find(pack(own(:max_corners, i), own(:max_corners, i) > 0)), i=1, size(own, 2))])
    ! The nodes of each key, for all ranks may have other roots at them.
    do d = 0, n_directories - 1
      k = 0
      do i = 1, size(keys, 2)
        call add_nodes(keys(:, i:i), d, k, node_root)
      end do
      call link_nodes(node_root(:, :k), links)
      part_links = with(part_links, links)
    end do
    call list_tags(keys, parts, pieces)
    call answers%parts%init(parts, part_links)
    call answers%pieces%init(pieces, piece_links)
  end subroutine answers_to

  !> Add the nodes of a key that belong to a directory.
  subroutine add_nodes(key, directory, n, node_root)
    integer, intent(in) :: key(:, :)  !! The key (key_length, 1).
    integer, intent(in) :: directory  !! The directory.
    integer, intent(inout) :: n  !! Number of nodes so far; updated.
    integer, intent(inout) :: node_root(:, :)  !! Nodes and roots (2, any).
    integer, allocatable :: more(:, :)
    integer :: i
    call list_nodes(key, more)
    do i = 1, size(more, 2)
      if (directory_of(more(:1, i), n_directories) /= directory) cycle
      n = n + 1
      node_root(:, n) = more(:, i)
    end do
  end subroutine add_nodes

  !> Some links and others.
  pure function with(some, links) result(all)
    integer(int64), intent(in) :: some(:, :)  !! Links (2, any).
    type(tag_links_t), intent(in) :: links  !! The others.
    integer(int64) :: all(2, size(some, 2) + links%n)
    all(:, :size(some, 2)) = some
    if (links%n > 0) all(:, size(some, 2) + 1:) = links%link(:, :links%n)
  end function with
end module test_directories
