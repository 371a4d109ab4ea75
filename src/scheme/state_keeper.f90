!> Who saves the state of an iteration from time to time, so that it can go on from there another day.
module dotyk_scheme_state_keeper
  use dotyk_base_kinds, only: dp
  use dotyk_base_timer, only: wall_time
  use dotyk_scheme_history, only: history_t
  implicit none
  private

  !> Keeps states; how is up to its extensions.
  type, abstract, public :: state_keeper_t
    !> Seconds between two states; 0: every step is kept.
    real(dp) :: interval = 60
    !> When the last one was kept, or the iteration began [s].
    real(dp) :: kept_at = 0
    !> What was done before this iteration, and before this part of it.
    type(history_t) :: earlier, before
  contains
    procedure :: due => keeper_due
    procedure(keep_one), deferred :: keep
  end type state_keeper_t

  abstract interface
    !> Keep a state. What cannot be kept does not stop the iteration.
    subroutine keep_one(self, row, m, alpha, lambda_max, history, closed)
      import :: state_keeper_t, dp, history_t
      class(state_keeper_t), intent(inout) :: self
      !> Contact points of the whole scene that the state is of (n); the others are open.
      integer, intent(in) :: row(:)
      !> (n) [pressure], amplitudes of the free motions [length], upper estimate of L or 0 [].
      real(dp), intent(in) :: m(:), alpha(:), lambda_max
      !> Of this iteration.
      type(history_t), intent(in) :: history
      !> Points to take for closed (n).
      logical, intent(in) :: closed(:)
    end subroutine keep_one
  end interface

contains

  !> Whether it is time to keep another state.
  logical function keeper_due(self) result(due)
    class(state_keeper_t), intent(in) :: self
    due = wall_time() - self%kept_at >= self%interval
  end function keeper_due
end module dotyk_scheme_state_keeper
