!> Owners and numbers of the nodes of a body that no rank holds as a whole.
!>
!> The nodes of the file are divided into ranges, one for each rank, its directory. Ranks tell the directories which
!> nodes their own elements have (`register`); the directories count, exchange their counts (`set_offsets`), and answer
!> with the number of each node in the whole body, its owner, its global number and the ranks that have it. What is sent
!> and received are plain arrays, sorted by the other rank.
module dotyk_mesh_node_directory
  use dotyk_base_kinds, only: int64
  implicit none
  private

  type, public :: node_directory_t  !! The nodes of one range.
    integer :: before = 0  !! Number of nodes of the file before the range.
    !> Owner of each node: the lowest rank that has it; n_ranks where no rank has it (n_range).
    integer, allocatable :: owner(:)
    integer, allocatable :: whole(:)  !! Number of each node in the whole body (n_range).
    integer, allocatable :: global(:)  !! Global number of each node, by owner, from 0 (n_range).
    !> Ranks that have node i are sharer(start(i)) .. sharer(start(i + 1) - 1), ascending (n_range + 1).
    integer, allocatable :: start(:)
    integer, allocatable :: sharer(:)  !! The ranks (any).
    integer, allocatable :: counts(:)  !! Number of nodes of each owner in the range, to be exchanged (0:n_ranks-1).
    !> The nodes of rank r have the global numbers first_node(r) .. first_node(r + 1) - 1 (0:n_ranks).
    integer, allocatable :: first_node(:)
  contains
    procedure :: register => directory_register
    procedure :: set_offsets => directory_set_offsets
    procedure :: answer => directory_answer
    procedure :: answer_sharers => directory_answer_sharers
  end type node_directory_t

  public :: directory_starts

contains

  !> Number of nodes of the file before the range of a rank.
  pure integer function range_start(rank, n_ranks, n_file_nodes) result(before)
    integer, intent(in) :: rank  !! The rank, from 0; n_ranks for the end.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    integer, intent(in) :: n_file_nodes  !! Number of nodes of the file.
    before = int(int(n_file_nodes, int64)*rank/n_ranks)
  end function range_start

  !> Where the nodes of each directory begin in an ascending list.
  pure subroutine directory_starts(file_node, n_ranks, n_file_nodes, first)
    integer, intent(in) :: file_node(:)  !! Nodes by their numbers in the file, ascending (n).
    integer, intent(in) :: n_ranks  !! Number of ranks.
    integer, intent(in) :: n_file_nodes  !! Number of nodes of the file.
    !> Nodes first(r) .. first(r + 1) - 1 belong to the directory of rank r (0:n_ranks).
    integer, allocatable, intent(out) :: first(:)
    integer :: r, i
    allocate (first(0:n_ranks))
    i = 1
    do r = 0, n_ranks
      do while (i <= size(file_node))
        if (file_node(i) > range_start(r, n_ranks, n_file_nodes)) exit
        i = i + 1
      end do
      first(r) = i
    end do
  end subroutine directory_starts

  !> Take the nodes that ranks have.
  subroutine directory_register(self, rank, n_ranks, n_file_nodes, file_node, n_from)
    class(node_directory_t), intent(out) :: self
    integer, intent(in) :: rank  !! This rank, from 0.
    integer, intent(in) :: n_ranks  !! Number of ranks.
    integer, intent(in) :: n_file_nodes  !! Number of nodes of the file.
    integer, intent(in) :: file_node(:)  !! Nodes of this range that the ranks have, rank after rank (any).
    integer, intent(in) :: n_from(0:)  !! How many of them are from each rank (0:n_ranks-1).
    integer :: i, k, r, n
    self%before = range_start(rank, n_ranks, n_file_nodes)
    n = range_start(rank + 1, n_ranks, n_file_nodes) - self%before
    allocate (self%owner(n), source=n_ranks)
    allocate (self%start(n + 2), source=0)
    allocate (self%sharer(size(file_node)), self%counts(0:n_ranks - 1))
    do k = 1, size(file_node)
      i = file_node(k) - self%before
      self%start(i + 2) = self%start(i + 2) + 1
    end do
    self%start(1:2) = 1
    do i = 3, n + 2
      self%start(i) = self%start(i) + self%start(i - 1)
    end do
    k = 0
    self%counts = 0
    do r = 0, n_ranks - 1
      do k = k + 1, k + n_from(r)
        i = file_node(k) - self%before
        self%sharer(self%start(i + 1)) = r
        self%start(i + 1) = self%start(i + 1) + 1
        if (self%owner(i) < n_ranks) cycle
        self%owner(i) = r
        self%counts(r) = self%counts(r) + 1
      end do
      k = k - 1
    end do
    self%start = self%start(:n + 1)
  end subroutine directory_register

  !> Number the nodes, with what the other directories have counted.
  subroutine directory_set_offsets(self, n_before, n_of_owner, n_in_lower)
    class(node_directory_t), intent(inout) :: self
    integer, intent(in) :: n_before(0:)  !! Nodes of each owner in lower directories (0:n_ranks-1).
    integer, intent(in) :: n_of_owner(0:)  !! Nodes of each owner in all directories (0:n_ranks-1).
    integer, intent(in) :: n_in_lower  !! Nodes of all owners in lower directories.
    integer :: next(0:size(n_before) - 1), r, i, whole
    allocate (self%first_node(0:size(next)), self%whole(size(self%owner)), self%global(size(self%owner)), source=0)
    do r = 0, size(next) - 1
      self%first_node(r + 1) = self%first_node(r) + n_of_owner(r)
      next(r) = self%first_node(r) + n_before(r)
    end do
    whole = n_in_lower
    do i = 1, size(self%owner)
      if (self%owner(i) == size(next)) cycle
      whole = whole + 1
      self%whole(i) = whole
      self%global(i) = next(self%owner(i))
      next(self%owner(i)) = next(self%owner(i)) + 1
    end do
  end subroutine directory_set_offsets

  !> Numbers and owners of nodes.
  pure subroutine directory_answer(self, file_node, reply)
    class(node_directory_t), intent(in) :: self
    integer, intent(in) :: file_node(:)  !! Nodes of this range (n).
    !> Number in the whole body, owner and global number of each (3, n).
    integer, allocatable, intent(out) :: reply(:, :)
    integer :: k
    allocate (reply(3, size(file_node)))
    do k = 1, size(file_node)
      associate (i => file_node(k) - self%before)
        reply(:, k) = [self%whole(i), self%owner(i), self%global(i)]
      end associate
    end do
  end subroutine directory_answer

  !> Ranks that have nodes.
  pure subroutine directory_answer_sharers(self, file_node, n_sharers, sharer)
    class(node_directory_t), intent(in) :: self
    integer, intent(in) :: file_node(:)  !! Nodes of this range (n).
    integer, allocatable, intent(out) :: n_sharers(:)  !! Number of ranks that have each (n).
    integer, allocatable, intent(out) :: sharer(:)  !! The ranks, ascending, node after node (any).
    integer :: k, n
    n_sharers = self%start(file_node - self%before + 1) - self%start(file_node - self%before)
    allocate (sharer(sum(n_sharers)))
    n = 0
    do k = 1, size(file_node)
      associate (first => self%start(file_node(k) - self%before))
        sharer(n + 1:n + n_sharers(k)) = self%sharer(first:first + n_sharers(k) - 1)
        n = n + n_sharers(k)
      end associate
    end do
  end subroutine directory_answer_sharers
end module dotyk_mesh_node_directory
