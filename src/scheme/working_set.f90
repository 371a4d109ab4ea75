!> The first working set of the dual scheme: the rows that may be active, and enough of them to carry floating bodies.
module dotyk_scheme_working_set
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_set, only: iterate_t, rest_on_winkler_foundation
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_restriction, only: restrict_qp
  use dotyk_scheme_winkler_start, only: find_unbounded_direction
  implicit none
  private
  public :: screen_rows, keep_what_carries

  !> Gaps that count as zero, as a fraction of the largest penetration or gap: faces that just touch.
  real(dp), parameter :: touching = 1.0e-9_dp
  !> How often rows enter a working set that stop an otherwise unbounded direction; then all rows do.
  integer, parameter :: most_widenings = 10
  !> Rows enter it that this direction closes by more than this fraction of the most.
  real(dp), parameter :: closing = 1.0e-3_dp

contains

  !> The first working set: rows that are active where the bodies are rigid on a Winkler foundation, or nearly so.
  subroutine screen_rows(qp, working)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    logical, allocatable, intent(out) :: working(:)  !! Working set (n_rows).
    type(iterate_t) :: now
    allocate (working(qp%n_rows), source=.true.)
    if (qp%n_rows == 0 .or. qp%is_heap()) return
    call rest_on_winkler_foundation(qp, now, working)
    ! Floating bodies sink in more than the foundation tells, or tilt.
    if (qp%coarse%n > 0) working = now%y > -maxval(now%y, mask=.not. qp%is_tied)
    working = working .or. abs(now%y) < touching*maxval(abs(now%y)) .or. qp%is_tied
  end subroutine screen_rows

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
