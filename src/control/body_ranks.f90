!> Which rank of an MPI run computes which bodies.
!>
!> A body belongs to one rank, which solves it. A rank that has bodies of a congruence class assembles and factorizes
!> their representative, even if another rank does the same: solves with one factor have the same digits on all ranks.
module dotyk_control_body_ranks
  use dotyk_base_kinds, only: dp
  use dotyk_base_sort, only: sort_order
  use dotyk_control_congruence_classes, only: congruence_classes_t
  use dotyk_elasticity_body, only: body_t
  use dotyk_ranks_communication, only: n_ranks
  use dotyk_ranks_exchange, only: add_up, all_ranks, belongs_here => is_own, greatest, share
  implicit none
  private

  type, public :: body_ranks_t  !! The bodies of all ranks.
    integer, allocatable :: owner(:)  !! Rank of each body (n_bodies).
    !> Whether this rank assembles and factorizes the body: it represents a class of which the rank has bodies
    !> (n_bodies).
    logical, allocatable :: factorizes(:)
  contains
    procedure :: init => body_ranks_init
    procedure :: take_owners => body_ranks_take_owners
    procedure :: is_own => body_ranks_is_own
    procedure :: are_split => body_ranks_are_split
    procedure :: share_sum => body_ranks_share_sum
    procedure :: share_norm => body_ranks_share_norm
    procedure :: share_greatest => body_ranks_share_greatest
  end type body_ranks_t

  public :: deal_bodies, share_out

  !> Congruent bodies that stay together, if there are as many: their solves are made side by side in batches.
  integer, parameter :: stay_together = 8

contains

  !> Share the bodies out.
  subroutine body_ranks_init(self, body, classes, together)
    class(body_ranks_t), intent(out) :: self
    type(body_t), intent(in) :: body(:)  !! Bodies with supports, not assembled (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes.
    logical, intent(in), optional :: together  !! Whether all ranks compute each body together; not if absent.
    if (present(together)) then
      if (together) then
        allocate (self%owner(size(body)), source=all_ranks)
        allocate (self%factorizes(size(body)), source=.false.)
        return
      end if
    end if
    call self%take_owners(deal_bodies(real(body%constraint%n_equations, dp), classes%first), classes)
  end subroutine body_ranks_init

  !> A rank for each body, from 0 (n_bodies).
  function deal_bodies(n_equations, first) result(owner)
    real(dp), intent(in) :: n_equations(:)  !! Number of equations of each body (n_bodies).
    integer, intent(in) :: first(:)  !! Representative of the class of each body (n_bodies).
    integer :: owner(size(n_equations))
    owner = share_out(work_of(n_equations), first, n_ranks())
  end function deal_bodies

  !> Owners that were chosen before.
  subroutine body_ranks_take_owners(self, owner, classes)
    class(body_ranks_t), intent(out) :: self
    integer, intent(in) :: owner(:)  !! Rank of each body (n_bodies).
    type(congruence_classes_t), intent(in) :: classes  !! Congruence classes.
    integer :: b
    self%owner = owner
    allocate (self%factorizes(size(owner)), source=.false.)
    do b = 1, size(owner)
      if (self%is_own(b)) self%factorizes(classes%first(b)) = .true.
    end do
  end subroutine body_ranks_take_owners

  !> Whether a body belongs to this rank.
  elemental logical function body_ranks_is_own(self, b) result(is_own)
    class(body_ranks_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    is_own = belongs_here(self%owner(b))
  end function body_ranks_is_own

  !> Whether all ranks compute each body together, each a part of it.
  pure logical function body_ranks_are_split(self) result(are_split)
    class(body_ranks_t), intent(in) :: self
    are_split = all(self%owner == all_ranks)
  end function body_ranks_are_split

  !> A number of each body, to which the ranks that compute it add, known to all ranks.
  subroutine body_ranks_share_sum(self, value)
    class(body_ranks_t), intent(in) :: self
    !> What this rank has found in; 0 for bodies of other ranks; the sum out (n_bodies) [any].
    real(dp), intent(inout) :: value(:)
    if (self%are_split()) then
      call add_up(value)
    else
      call share(self%owner, value)
    end if
  end subroutine body_ranks_share_sum

  !> A Euclidean norm for each body, of which the ranks that compute it have parts, known to all ranks.
  subroutine body_ranks_share_norm(self, value)
    class(body_ranks_t), intent(in) :: self
    real(dp), intent(inout) :: value(:)  !! Of the part of this rank in, of all out (n_bodies) [any].
    real(dp) :: largest(size(value))
    if (self%are_split()) then
      ! Squares of numbers in unusual units may be out of range.
      largest = value
      call greatest(largest)
      largest = max(largest, tiny(largest))
      value(:) = (value/largest)**2
      call add_up(value)
      value(:) = largest*sqrt(value)
    else
      call share(self%owner, value)
    end if
  end subroutine body_ranks_share_norm

  !> The greatest number of each body, known to all ranks.
  subroutine body_ranks_share_greatest(self, value)
    class(body_ranks_t), intent(in) :: self
    real(dp), intent(inout) :: value(:)  !! Of the part of this rank in, of all out (n_bodies) [any].
    if (self%are_split()) then
      call greatest(value)
    else
      call share(self%owner, value)
    end if
  end subroutine body_ranks_share_greatest

  !> Work of a body: between that of a solve, n^(4/3), and that of a factorization, n^2 [].
  elemental real(dp) function work_of(n_equations) result(work)
    real(dp), intent(in) :: n_equations  !! Number of equations.
    work = max(1.0_dp, n_equations)**1.5_dp
  end function work_of

  !> A rank for each body: classes of congruent bodies in portions, the largest first, each to the rank with least work
  !> so far.
  pure function share_out(work, first, n) result(owner)
    real(dp), intent(in) :: work(:)  !! Work of each body (n_bodies) [].
    integer, intent(in) :: first(:)  !! Representative of the class of each body (n_bodies).
    integer, intent(in) :: n  !! Number of ranks.
    integer :: owner(size(work))
    integer :: portion(size(work)), order(size(work)), n_portions, b, r, k, members, per_portion, taken
    real(dp) :: load(0:n - 1), cost(size(work)), share
    owner = 0
    if (n == 1) return
    share = sum(work)/n
    n_portions = 0
    cost = 0
    do b = 1, size(work)
      if (first(b) /= b) cycle
      members = count(first == b)
      ! As many portions as its share of the work asks for.
      per_portion = members
      if (members*work(b) > share) per_portion = max(1, ceiling(members/real(ceiling(members*work(b)/share), dp)))
      if (per_portion > stay_together) per_portion = stay_together*((per_portion + stay_together - 1)/stay_together)
      taken = per_portion
      do k = b, size(work)
        if (first(k) /= b) cycle
        if (taken == per_portion) then
          n_portions = n_portions + 1
          taken = 0
        end if
        taken = taken + 1
        portion(k) = n_portions
        cost(n_portions) = cost(n_portions) + work(b)
      end do
    end do
    call sort_order(-cost(:n_portions), order(:n_portions))
    load = 0
    do k = 1, n_portions
      r = minloc(load, dim=1) - 1
      load(r) = load(r) + cost(order(k))
      where (portion == order(k)) owner = r
    end do
  end function share_out
end module dotyk_control_body_ranks
