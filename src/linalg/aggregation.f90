!> Aggregates of the nodes of a block matrix, the coarse nodes of smoothed aggregation, and orthonormal bases of
!> near-null-space vectors on them, its tentative prolongator (P. Vanek, J. Mandel and M. Brezina, Computing 56, 1996,
!> section 4 and algorithm 2.1).
!>
!> Nodes i and j are strongly coupled where |A_ij|^2 > threshold^2 |A_ii| |A_jj|, in Frobenius norms of the blocks of
!> nodes. A node whose strong neighbours belong to no aggregate yet makes one with them; the nodes left over join the
!> aggregate that they are coupled to most strongly. Nodes are visited in their order, so that aggregates do not depend
!> on the number of threads, and along a space-filling curve they are compact.
!>
!> On each aggregate the vectors are V = Q R: the columns of Q span them there, and R has them on the coarse level.
!> Columns that depend on those before them (aggregates of one or two nodes, or with held components) are zero in Q and
!> name coarse unknowns that do not exist.
module dotyk_linalg_aggregation
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_base_thresholds, only: half_digits
  use dotyk_linalg_block_rows, only: block_rows_t
  implicit none
  private
  public :: find_aggregates, make_bases, list_members, carry_to_coarse

contains

  !> Find the aggregates.
  subroutine find_aggregates(rows, part, threshold, aggregate, n)
    type(block_rows_t), intent(in) :: rows  !! The matrix; a node has `part` block rows, one after the other.
    integer, intent(in) :: part  !! Block rows of a node.
    real(dp), intent(in) :: threshold  !! Least relative coupling of strong neighbours; 0: all coupled at all [].
    integer, allocatable, intent(out) :: aggregate(:)  !! Aggregate of each node; 0: coupled to none (n_nodes).
    integer, intent(out) :: n  !! Number of aggregates.
    integer, allocatable :: start(:), neighbour(:)
    real(sp), allocatable :: coupling(:)
    allocate (aggregate(rows%n/part), source=0)
    call node_couplings(rows, part, start, neighbour, coupling)
    n = 0
    call make_whole(start, neighbour, coupling, real(threshold**2, sp), aggregate, n)
    call join_strongest(start, neighbour, coupling, aggregate)
    call make_of_rest(start, neighbour, coupling, aggregate, n)
  end subroutine find_aggregates

  !> The graph of the nodes, with relative couplings |A_ij|^2/(|A_ii| |A_jj|).
  subroutine node_couplings(rows, part, start, neighbour, coupling)
    type(block_rows_t), intent(in) :: rows  !! The matrix.
    integer, intent(in) :: part  !! Block rows of a node.
    integer, allocatable, intent(out) :: start(:)  !! First neighbour of each node (n_nodes + 1).
    integer, allocatable, intent(out) :: neighbour(:)  !! Neighbours of the nodes, ascending (start(n_nodes + 1) - 1).
    real(sp), allocatable, intent(out) :: coupling(:)  !! Relative coupling to neighbours (start(n_nodes + 1) - 1) [].
    real(sp), allocatable :: own(:)
    integer :: i, n
    n = rows%n/part
    allocate (start(n + 1), own(n))
    start(1) = 1
    do i = 1, n
      ! A node's block rows all have its `part` diagonal blocks and those of its neighbours.
      start(i + 1) = start(i) + int(rows%start(part*(i - 1) + 2) - rows%start(part*(i - 1) + 1))/part - 1
    end do
    allocate (neighbour(start(n + 1) - 1), coupling(start(n + 1) - 1))
    !$omp parallel do default(none) shared(rows, part, start, neighbour, coupling, own, n) schedule(static)
    do i = 1, n
      call couplings_of_node(rows, part, i, neighbour(start(i):start(i + 1) - 1), &
                             coupling(start(i):start(i + 1) - 1), own(i))
    end do
    !$omp end parallel do
    !$omp parallel do default(none) shared(start, neighbour, coupling, own, n) schedule(static)
    do i = 1, n
      call divide(own, own(i), neighbour(start(i):start(i + 1) - 1), coupling(start(i):start(i + 1) - 1))
    end do
    !$omp end parallel do
  end subroutine node_couplings

  !> Squared norms of the blocks of a node.
  pure subroutine couplings_of_node(rows, part, i, neighbour, square, own)
    type(block_rows_t), intent(in) :: rows  !! The matrix.
    integer, intent(in) :: part  !! Block rows of a node.
    integer, intent(in) :: i  !! The node.
    integer, intent(out) :: neighbour(:)  !! Its neighbours, ascending (n).
    real(sp), intent(out) :: square(:)  !! |A_ij|^2 (n) [].
    real(sp), intent(out) :: own  !! |A_ii| [].
    real(dp) :: block(rows%dim, rows%dim)
    integer(int64) :: k
    integer :: r, j, last, n
    own = 0
    square = 0
    do r = part*(i - 1) + 1, part*i
      n = 0
      last = 0
      do k = rows%start(r), rows%start(r + 1) - 1
        j = (rows%column(k) - 1)/part + 1
        call rows%get_block(k, block)
        if (j == i) then
          own = own + real(sum(block**2), sp)
          cycle
        end if
        if (j /= last) n = n + 1
        last = j
        neighbour(n) = j
        square(n) = square(n) + real(sum(block**2), sp)
      end do
    end do
    own = sqrt(own)
  end subroutine couplings_of_node

  !> Divide the couplings by the norms of the diagonal blocks.
  pure subroutine divide(norm, own, neighbour, coupling)
    real(sp), intent(in) :: norm(:)  !! |A_ii| of all nodes (n_nodes) [].
    real(sp), intent(in) :: own  !! That of the node [].
    integer, intent(in) :: neighbour(:)  !! Its neighbours (n).
    real(sp), intent(inout) :: coupling(:)  !! |A_ij|^2 in, the same over |A_ii| |A_jj| out (n) [].
    integer :: k
    do k = 1, size(neighbour)
      if (coupling(k) > 0) coupling(k) = coupling(k)/(own*norm(neighbour(k)))
    end do
  end subroutine divide

  !> Aggregates of a node with all its strong neighbours, where these are free.
  pure subroutine make_whole(start, neighbour, coupling, least, aggregate, n)
    integer, intent(in) :: start(:)  !! First neighbour of each node (n_nodes + 1).
    integer, intent(in) :: neighbour(:)  !! Neighbours of the nodes.
    real(sp), intent(in) :: coupling(:)  !! Relative couplings [].
    real(sp), intent(in) :: least  !! Strong couplings are above it [].
    integer, intent(inout) :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    integer, intent(inout) :: n  !! Number of aggregates.
    integer :: i, k
    logical :: is_free
    do i = 1, size(aggregate)
      is_free = aggregate(i) == 0
      do k = start(i), start(i + 1) - 1
        if (.not. is_free) exit
        if (coupling(k) > least) is_free = aggregate(neighbour(k)) == 0
      end do
      if (.not. is_free) cycle
      ! A node without any strong neighbour joins others later.
      if (.not. any(coupling(start(i):start(i + 1) - 1) > least)) cycle
      n = n + 1
      aggregate(i) = n
      do k = start(i), start(i + 1) - 1
        if (coupling(k) > least) aggregate(neighbour(k)) = n
      end do
    end do
  end subroutine make_whole

  !> Each node left over joins the aggregate of the neighbour that it is coupled to most strongly.
  pure subroutine join_strongest(start, neighbour, coupling, aggregate)
    integer, intent(in) :: start(:)  !! First neighbour of each node (n_nodes + 1).
    integer, intent(in) :: neighbour(:)  !! Neighbours of the nodes.
    real(sp), intent(in) :: coupling(:)  !! Relative couplings [].
    integer, intent(inout) :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    integer, allocatable :: chosen(:)
    integer :: i, k
    real(sp) :: most
    allocate (chosen, source=aggregate)
    do i = 1, size(aggregate)
      if (aggregate(i) > 0) cycle
      most = 0
      do k = start(i), start(i + 1) - 1
        if (aggregate(neighbour(k)) == 0 .or. .not. coupling(k) > most) cycle
        most = coupling(k)
        chosen(i) = aggregate(neighbour(k))
      end do
    end do
    aggregate = chosen
  end subroutine join_strongest

  !> Aggregates of nodes that are coupled to each other only, and weakly.
  pure subroutine make_of_rest(start, neighbour, coupling, aggregate, n)
    integer, intent(in) :: start(:)  !! First neighbour of each node (n_nodes + 1).
    integer, intent(in) :: neighbour(:)  !! Neighbours of the nodes.
    real(sp), intent(in) :: coupling(:)  !! Relative couplings [].
    integer, intent(inout) :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    integer, intent(inout) :: n  !! Number of aggregates.
    integer :: i, k
    do i = 1, size(aggregate)
      if (aggregate(i) > 0 .or. .not. any(coupling(start(i):start(i + 1) - 1) > 0)) cycle
      n = n + 1
      aggregate(i) = n
      do k = start(i), start(i + 1) - 1
        if (coupling(k) > 0 .and. aggregate(neighbour(k)) == 0) aggregate(neighbour(k)) = n
      end do
    end do
  end subroutine make_of_rest

  !> Nodes of each aggregate, ascending.
  pure subroutine list_members(aggregate, n, first, member)
    integer, intent(in) :: aggregate(:)  !! Aggregate of each node, 0 for none (n_nodes).
    integer, intent(in) :: n  !! Number of aggregates.
    integer, allocatable, intent(out) :: first(:)  !! First member of each aggregate (n + 1).
    integer, allocatable, intent(out) :: member(:)  !! Nodes (first(n + 1) - 1).
    integer, allocatable :: next(:)
    integer :: i, k
    allocate (first(n + 1), source=0)
    do i = 1, size(aggregate)
      if (aggregate(i) > 0) first(aggregate(i) + 1) = first(aggregate(i) + 1) + 1
    end do
    first(1) = 1
    do k = 1, n
      first(k + 1) = first(k + 1) + first(k)
    end do
    allocate (member(first(n + 1) - 1), next(n))
    next(:) = first(:n)
    do i = 1, size(aggregate)
      if (aggregate(i) == 0) cycle
      member(next(aggregate(i))) = i
      next(aggregate(i)) = next(aggregate(i)) + 1
    end do
  end subroutine list_members

  !> The bases of all aggregates.
  subroutine make_bases(m, length, first, member, vector, basis, coarse, missing)
    integer, intent(in) :: m  !! Number of near-null-space vectors.
    integer, intent(in) :: length  !! Unknowns of a node.
    integer, intent(in) :: first(:)  !! First member of each aggregate (n + 1).
    integer, intent(in) :: member(:)  !! Members of the aggregates.
    real(dp), intent(in), contiguous :: vector(:, :, :)  !! Near-null-space vectors (length, n_nodes, m) [any].
    real(dp), intent(out), contiguous :: basis(:, :, :)  !! Q; zero outside of aggregates (m, length, n_nodes) [].
    !> R, the vectors on the coarse level: coarse unknown of the aggregate, aggregate, vector (m, n, m) [as `vector`].
    real(dp), intent(out), contiguous :: coarse(:, :, :)
    logical, intent(out), contiguous :: missing(:, :)  !! Whether a coarse unknown does not exist (m, n).
    integer :: i
    !$omp parallel do default(none) shared(basis) schedule(static)
    do i = 1, size(basis, 3)
      basis(:, :, i) = 0
    end do
    !$omp end parallel do
    !$omp parallel do default(none) shared(m, length, first, member, vector, basis, coarse, missing) schedule(static)
    do i = 1, size(first) - 1
      call make_basis(m, length, member(first(i):first(i + 1) - 1), vector, basis, coarse(:, i, :), missing(:, i))
    end do
    !$omp end parallel do
  end subroutine make_bases

  !> The basis of one aggregate, by modified Gram-Schmidt, twice.
  pure subroutine make_basis(m, length, member, vector, basis, r, missing)
    integer, intent(in) :: m  !! Number of near-null-space vectors.
    integer, intent(in) :: length  !! Unknowns of a node.
    integer, intent(in) :: member(:)  !! Members of the aggregate (n).
    real(dp), intent(in) :: vector(:, :, :)  !! Near-null-space vectors (length, n_nodes, m) [any].
    real(dp), intent(inout) :: basis(:, :, :)  !! Q of all aggregates; members' is set (m, length, n_nodes) [].
    real(dp), intent(out) :: r(:, :)  !! R (m, m) [as `vector`].
    logical, intent(out) :: missing(:)  !! Whether a column is zero (m).
    real(dp) :: q(length*size(member), m), whole, left, part
    integer :: i, k, l, pass
    r = 0
    do k = 1, m
      do i = 1, size(member)
        q(length*(i - 1) + 1:length*i, k) = vector(:, member(i), k)
      end do
      whole = norm2(q(:, k))
      do pass = 1, 2
        do l = 1, k - 1
          part = dot_product(q(:, l), q(:, k))
          r(l, k) = r(l, k) + part
          q(:, k) = q(:, k) - part*q(:, l)
        end do
      end do
      left = norm2(q(:, k))
      ! Rotations about a distant center leave the aggregate's size over the distance. True for NaN, too.
      missing(k) = .not. left > half_digits*whole
      if (missing(k)) then
        q(:, k) = 0
      else
        r(k, k) = left
        q(:, k) = q(:, k)/left
      end if
      do i = 1, size(member)
        basis(k, :, member(i)) = q(length*(i - 1) + 1:length*i, k)
      end do
    end do
  end subroutine make_basis

  !> Q^T z: a vector in the span of the bases, as it is on the coarse level.
  subroutine carry_to_coarse(m, length, first, member, basis, z, coarse)
    integer, intent(in) :: m  !! Number of near-null-space vectors.
    integer, intent(in) :: length  !! Unknowns of a node.
    integer, intent(in) :: first(:)  !! First member of each aggregate (n + 1).
    integer, intent(in) :: member(:)  !! Members of the aggregates.
    real(dp), intent(in) :: basis(m, length, *)  !! Q (m, length, n_nodes) [].
    real(dp), intent(in) :: z(length, *)  !! The vector (length, n_nodes) [any].
    real(dp), intent(out) :: coarse(m, size(first) - 1)  !! On the coarse level (m, n) [as `z`].
    integer :: i, j, k
    !$omp parallel do default(none) shared(m, length, first, member, basis, z, coarse) private(j, k) schedule(static)
    do i = 1, size(first) - 1
      coarse(:, i) = 0
      do k = first(i), first(i + 1) - 1
        do j = 1, length
          coarse(:, i) = coarse(:, i) + basis(:, j, member(k))*z(j, member(k))
        end do
      end do
    end do
    !$omp end parallel do
  end subroutine carry_to_coarse
end module dotyk_linalg_aggregation
