!> Numbers of the nodes of a body that no rank holds as a whole, and the ranks that have them: what ranks ask the
!> directories (`dotyk_mesh_node_directory`), each of which is on one rank.
module dotyk_model_node_sharers
  use dotyk_base_kinds, only: int64
  use dotyk_base_sort, only: sort_order
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_layer_share, only: whole_numbers_t
  use dotyk_mesh_node_directory, only: directory_starts, node_directory_t
  use dotyk_mesh_part_assembly, only: take_numbers
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_exchange, only: deliver, gather_all
  implicit none
  private
  public :: number_nodes, hold_more

contains

  !> Numbers of the nodes in the whole body, their owners, and the ranks that have them.
  subroutine number_nodes(file_node, n_file_nodes, whole, first_node, n_sharers, sharer)
    integer, intent(in) :: file_node(:)  !! Number of each node of this rank in the file, ascending (n_nodes).
    integer, intent(in) :: n_file_nodes  !! Number of nodes of the file.
    type(whole_numbers_t), intent(inout) :: whole  !! Gets the numbers.
    !> The nodes of rank r have the global numbers first_node(r) .. first_node(r + 1) - 1 (0:n_ranks).
    integer, allocatable, intent(out) :: first_node(:)
    integer, allocatable, intent(out) :: n_sharers(:)  !! Number of ranks that have each node (n_nodes).
    integer, allocatable, intent(out) :: sharer(:)  !! The ranks (any).
    type(node_directory_t) :: directory
    integer(int64), allocatable :: asked(:), answers(:)
    integer(int64) :: n_from(n_ranks()), n_back(n_ranks())
    integer, allocatable :: reply(:, :)
    call register(file_node, n_file_nodes, directory, asked, n_from)
    call exchange_counts(directory)
    call directory%answer(int(asked), reply)
    call deliver(reshape(int(reply, int64), [size(reply)]), 3*n_from, answers, n_back)
    call take_numbers(reshape(int(answers), [3, size(answers)/3]), directory%first_node(n_ranks()), whole)
    call ask_sharers(directory, asked, n_from, n_sharers, sharer)
    call move_alloc(directory%first_node, first_node)
  end subroutine number_nodes

  !> Number the nodes of a directory by the counts of all of them: each rank adds up its own nodes, so that no rank has
  !> the counts of all owners in all directories.
  subroutine exchange_counts(directory)
    type(node_directory_t), intent(inout) :: directory  !! The nodes of this rank's range; gets their numbers.
    integer(int64), allocatable :: own(:), before(:), totals(:)
    integer(int64) :: n(n_ranks()), one(n_ranks()), so_far(n_ranks())
    integer :: r
    one = 1
    call deliver(int(directory%counts, int64), one, own, n)
    so_far(1) = 0
    do r = 2, n_ranks()
      so_far(r) = so_far(r - 1) + own(r - 1)
    end do
    call deliver(so_far, one, before, n)
    ! Nodes that this rank owns, and those of its directory.
    call gather_all([sum(own), sum(int(directory%counts, int64))], totals)
    call directory%set_offsets(int(before), int(totals(1::2)), int(sum(totals(2:2*this_rank():2))))
  end subroutine exchange_counts

  !> Tell the directories which nodes this rank has.
  subroutine register(node, n_nodes, directory, asked, n_from)
    integer, intent(in) :: node(:)  !! The nodes, ascending (n).
    integer, intent(in) :: n_nodes  !! Number of nodes of all directories.
    type(node_directory_t), intent(out) :: directory  !! The nodes of this rank's range.
    integer(int64), allocatable, intent(out) :: asked(:)  !! Nodes of this range that ranks have, rank after rank (any).
    integer(int64), intent(out) :: n_from(:)  !! How many of them are from each rank (n_ranks).
    integer, allocatable :: first(:)
    call directory_starts(node, n_ranks(), n_nodes, first)
    call deliver(int(node, int64), int(first(1:) - first(:n_ranks() - 1), int64), asked, n_from)
    call directory%register(this_rank(), n_ranks(), n_nodes, int(asked), int(n_from))
  end subroutine register

  !> Ask the directories which ranks have the nodes that this rank has told them.
  subroutine ask_sharers(directory, asked, n_from, n_sharers, sharer)
    type(node_directory_t), intent(in) :: directory  !! The nodes of this rank's range.
    integer(int64), intent(in) :: asked(:)  !! Nodes that ranks ask for, rank after rank (any).
    integer(int64), intent(in) :: n_from(:)  !! How many of them are from each rank (n_ranks).
    integer, allocatable, intent(out) :: n_sharers(:)  !! Number of ranks that have each node of this rank (n_nodes).
    integer, allocatable, intent(out) :: sharer(:)  !! The ranks (any).
    integer(int64), allocatable :: answers(:), list(:)
    integer(int64) :: n_list(n_ranks()), n_back(n_ranks()), done
    integer, allocatable :: n_of(:), of(:)
    integer :: r
    call directory%answer_sharers(int(asked), n_of, of)
    call deliver(int(n_of, int64), n_from, answers, n_back)
    n_sharers = int(answers)
    done = 0
    do r = 1, n_ranks()
      n_list(r) = sum(n_of(done + 1:done + n_from(r)))
      done = done + n_from(r)
    end do
    call deliver(int(of, int64), n_list, list, n_back)
    sharer = int(list)
  end subroutine ask_sharers

  !> Each rank has one layer of elements more: at each node that this rank owns elements of, the ranks that have it now.
  subroutine hold_more(own, whole, n_sharers, sharer)
    type(body_mesh_t), intent(in) :: own  !! Elements that this rank owns.
    type(whole_numbers_t), intent(in) :: whole  !! Their numbers in the whole body.
    integer, allocatable, intent(inout) :: n_sharers(:)  !! Number of ranks that have each node (n_nodes).
    integer, allocatable, intent(inout) :: sharer(:)  !! The ranks (any).
    type(node_directory_t) :: directory
    logical, allocatable :: at(:), found(:), of_own(:), in_list(:)
    integer(int64), allocatable :: sent(:), got(:), asked(:)
    integer(int64) :: n_to(n_ranks()), n_from(n_ranks())
    integer, allocatable :: held(:), order(:)
    integer :: r, b, e, i, k, v
    allocate (sent(0))
    n_to = 0
    do r = 0, n_ranks() - 1
      if (r == this_rank() .or. .not. any(sharer == r)) cycle
      call nodes_of(n_sharers, sharer, r, at)
      allocate (found(size(at)), source=.false.)
      do b = 1, size(own%block)
        associate (node => own%block(b)%node)
          do e = 1, size(node, 2)
            if (any(at(node(:, e)))) found(node(:, e)) = .true.
          end do
        end associate
      end do
      n_to(r + 1) = count(found)
      sent = [sent, int(pack(whole%node, found), int64)]
      deallocate (found)
    end do
    call deliver(sent, n_to, got, n_from)
    held = [whole%node, int(got)]
    allocate (order(size(held)))
    call sort_order(held, order)
    held = held(order)
    held = pack(held, [(i == 1 .or. held(i) /= held(max(1, i - 1)), i=1, size(held))])
    call register(held, whole%n_nodes, directory, asked, n_from)
    call ask_sharers(directory, asked, n_from, n_sharers, sharer)
    ! Of those nodes that elements of this rank have.
    allocate (of_own(size(held)), in_list(size(sharer)))
    i = 1
    k = 0
    do v = 1, size(held)
      of_own(v) = .false.
      if (i <= size(whole%node)) of_own(v) = held(v) == whole%node(i)
      if (of_own(v)) i = i + 1
      in_list(k + 1:k + n_sharers(v)) = of_own(v)
      k = k + n_sharers(v)
    end do
    sharer = pack(sharer, in_list)
    n_sharers = pack(n_sharers, of_own)
  end subroutine hold_more

  !> The nodes that a rank has.
  pure subroutine nodes_of(n_sharers, sharer, rank, at)
    integer, intent(in) :: n_sharers(:)  !! Number of ranks that have each node (n_nodes).
    integer, intent(in) :: sharer(:)  !! The ranks (any).
    integer, intent(in) :: rank  !! The rank.
    logical, allocatable, intent(out) :: at(:)  !! Whether it has each node (n_nodes).
    integer :: i, k
    allocate (at(size(n_sharers)))
    k = 0
    do i = 1, size(at)
      at(i) = any(sharer(k + 1:k + n_sharers(i)) == rank)
      k = k + n_sharers(i)
    end do
  end subroutine nodes_of
end module dotyk_model_node_sharers
