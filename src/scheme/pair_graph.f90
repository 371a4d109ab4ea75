!> Contact pairs that share bodies: what is zero in the systems of active sets, in which order to eliminate, and what that costs.
module dotyk_scheme_pair_graph
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_ordering, only: nested_dissection
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: couple_pairs, order_pairs, elimination_cost

contains

  !> Pairs that share a body.
  subroutine couple_pairs(problem, n_pairs, coupled)
    type(contact_problem_t), intent(in) :: problem
    integer, intent(in) :: n_pairs
    !> (n_pairs, n_pairs).
    logical, allocatable, intent(out) :: coupled(:, :)
    integer :: body(2, n_pairs), k, l
    allocate (coupled(n_pairs, n_pairs))
    body = 0
    associate (first => problem%operator%pair_first_row)
      do k = 1, n_pairs
        if (first(k + 1) > first(k)) body(:, k) = problem%coarse%body(:, first(k))
      end do
    end associate
    do k = 1, n_pairs
      do l = 1, n_pairs
        coupled(l, k) = l == k .or. any(body(1, k) == body(:, l)) .or. any(body(2, k) == body(:, l))
      end do
    end do
  end subroutine couple_pairs

  !> In which order the pairs are eliminated.
  subroutine order_pairs(coupled, order, error)
    logical, intent(in) :: coupled(:, :)
    !> The pair that comes k-th (n_pairs).
    integer, allocatable, intent(out) :: order(:)
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: start(:), neighbour(:)
    integer :: k, l, n
    n = size(coupled, 1)
    allocate (order(n), start(n + 1), neighbour(count(coupled)))
    start(1) = 1
    do k = 1, n
      start(k + 1) = start(k)
      do l = 1, n
        if (l == k .or. .not. coupled(l, k)) cycle
        neighbour(start(k + 1)) = l
        start(k + 1) = start(k + 1) + 1
      end do
    end do
    call nested_dissection(start, neighbour(:start(n + 1) - 1), order, error)
  end subroutine order_pairs

  !> Operations and entries of a Cholesky factorization by dense blocks, one for each couple of pairs.
  subroutine elimination_cost(coupled, n_points, flops, entries)
    logical, intent(in) :: coupled(:, :)
    !> Points of each pair (n_pairs).
    integer, intent(in) :: n_points(:)
    real(dp), intent(out) :: flops, entries
    type(error_t), allocatable :: error
    logical, allocatable :: filled(:, :), left(:)
    integer, allocatable :: order(:), later(:)
    real(dp) :: n, m
    integer :: i, k, l
    flops = 0
    entries = 0
    call order_pairs(coupled, order, error)
    if (allocated(error)) order = [(k, k=1, size(n_points))]
    filled = coupled
    allocate (left(size(n_points)), source=.true.)
    do i = 1, size(order)
      k = order(i)
      left(k) = .false.
      later = pack([(l, l=1, size(left))], filled(:, k) .and. left)
      n = n_points(k)
      m = sum(real(n_points(later), dp))
      flops = flops + n**3/3 + n**2*m + n*m**2
      entries = entries + n**2/2 + n*m
      do l = 1, size(later)
        filled(later, later(l)) = .true.
      end do
    end do
  end subroutine elimination_cost
end module dotyk_scheme_pair_graph
