!> Orthonormal bases of near-null-space vectors on aggregates: the tentative prolongator of smoothed aggregation (P.
!> Vanek, J. Mandel and M. Brezina, Computing 56, 1996, algorithm 2.1).
!>
!> On each aggregate the vectors are V = Q R: the columns of Q span them there, and R has them on the coarse level.
!> Columns that depend on those before them (aggregates of one or two nodes, or with held components) are zero in Q and
!> name coarse unknowns that do not exist.
module dotyk_linalg_aggregate_basis
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: half_digits
  implicit none
  private
  public :: make_bases, list_members, carry_to_coarse

contains

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
    !> Near-null-space vectors: unknown of the node, node, vector (length, n_nodes, m) [any].
    real(dp), intent(in), contiguous :: vector(:, :, :)
    !> Q: column, unknown of the node, node; zero outside of aggregates (m, length, n_nodes) [].
    real(dp), intent(out), contiguous :: basis(:, :, :)
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
    !> Q of all aggregates; that of the members is set (m, length, n_nodes) [].
    real(dp), intent(inout) :: basis(:, :, :)
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
end module dotyk_linalg_aggregate_basis
