!> Working sets: the rows that may be active, enough of them to carry floating bodies, and those that turn out to be
!> violated.
module dotyk_scheme_working_set
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_scheme_active_set, only: iterate_t, rest_on_winkler_foundation
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_linear_solver_choice, only: is_heap
  use dotyk_scheme_restriction, only: restrict_qp
  use dotyk_scheme_winkler_start, only: find_unbounded_direction
  implicit none
  private
  public :: add_violated, is_worth_screening, keep_what_carries, screen_rows

  !> How often rows enter a working set that stop an otherwise unbounded direction; then all rows do.
  integer, parameter :: most_widenings = 10
  !> Rows enter it that this direction closes by more than this fraction of the most.
  real(dp), parameter :: closing = 1.0e-3_dp
  !> A fraction of all rows that is not worth screening: to look at them in the end takes a solve. Few rows are not
  !> worth it at all.
  real(dp), parameter :: not_worth_screening = 0.2_dp
  integer, parameter :: few_rows = 60
  !> Rows enter with the violated ones whose gaps are smaller than this multiple of the largest violation: the next
  !> solution closes gaps by about as much.
  real(dp), parameter, public :: near_violation = 4

contains

  !> The first working set: rows that are active where the bodies are rigid on a Winkler foundation, or nearly so.
  subroutine screen_rows(qp, working)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, allocatable, intent(out) :: working(:)  !! Working set (n_rows).
    type(iterate_t) :: now
    allocate (working(qp%n_rows), source=.true.)
    if (all(qp%is_tied) .or. is_heap(qp)) return
    call rest_on_winkler_foundation(qp, now, working)
    ! Floating bodies sink in more than the foundation tells, or tilt. Faces that just touch are near, too.
    if (qp%coarse%n > 0) working = now%penetration > -maxval(now%penetration, mask=.not. qp%is_tied)
    working = working .or. abs(now%penetration) <= rounding*maxval(abs(now%penetration)) .or. qp%is_tied
  end subroutine screen_rows

  !> Whether so many rows are outside of a working set that a solution without them is worth looking at these again.
  pure logical function is_worth_screening(working)
    logical, intent(in) :: working(:)  !! Working set (n_rows).
    is_worth_screening = size(working) >= few_rows .and. count(.not. working) >= not_worth_screening*size(working)
  end function is_worth_screening

  !> Add rows that are violated to a working set, and those that the next solution may close.
  pure subroutine add_violated(penetration, violated, working)
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    logical, intent(in) :: violated(:)  !! Rows of which the greatest penetration counts (n_rows).
    logical, intent(inout) :: working(:)  !! Working set (n_rows).
    working = working .or. penetration > -near_violation*maxval([0.0_dp, pack(penetration, violated)])
  end subroutine add_violated

  !> Add rows to a working set that cannot carry the floating bodies.
  subroutine keep_what_carries(qp, working)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, intent(inout) :: working(:)  !! Working set (n_rows).
    type(contact_qp_t) :: part
    real(dp), allocatable :: motion(:), penetration(:)
    logical :: found
    integer :: k
    allocate (motion(qp%coarse%n), penetration(size(working)))
    do k = 1, most_widenings
      call restrict_qp(qp, working, part)
      call find_unbounded_direction(part, motion, found)
      if (.not. found) return
      ! Rows that the motion closes.
      call qp%mode_displacement(motion, penetration)
      if (.not. any(penetration > 0 .and. .not. working)) exit
      working = working .or. penetration > closing*maxval(penetration, mask=.not. qp%is_tied)
      if (all(working)) return
    end do
    working = .true.
  end subroutine keep_what_carries
end module dotyk_scheme_working_set
