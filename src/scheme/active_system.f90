!> The linear system of an active set: contact points that are taken for closed, bordered by the free motions.
!>
!> With M = C + Theta W^{-1} on the active points, G their rows of the coarse space:
!>
!>     M lambda - G alpha = b,    G^T lambda = c.
!>
!> Springs S of the coarse space add to the second line: `G^T lambda + S alpha = c`. There are three ways to solve it: by factorization
!> (`dotyk_scheme_direct_system`, with many free bodies `dotyk_scheme_saddle_system`), and by conjugate gradients
!> (`dotyk_scheme_iterative_system`).
module dotyk_scheme_active_system
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> Part of the diagonal that factorized systems add before the factorization.
  real(dp), parameter, public :: proximal_part = 1.0e-9_dp

  !> The system.
  type, abstract, public :: active_system_t
    !> Active points: rows of the contact operator, ascending (n).
    integer, allocatable :: row(:)
    !> theta/w there (n) [length/force].
    real(dp), allocatable :: layer(:)
    !> Motions that the active points do not hold, as columns (coarse%n, number of them).
    real(dp), allocatable :: null_mode(:, :)
  contains
    !> Take the active points.
    procedure :: take_points => system_take_points
    !> Give back what `take_points` and the motions took.
    procedure :: forget => system_forget
    !> Make it, for another active set than before.
    procedure(init_interface), deferred :: init
    !> Solve it as exactly as rounding allows. Motions that nothing holds stay at rest; the part of c that excites them is left over.
    procedure(solve_interface), deferred :: solve
    !> Give back all memory.
    procedure(destroy_interface), deferred :: destroy
  end type active_system_t

  abstract interface
    !> Prepare the system.
    subroutine init_interface(self, problem, compliance, theta, active, error)
      import :: active_system_t, contact_problem_t, explicit_compliance_t, error_t, dp
      class(active_system_t), intent(inout) :: self
      type(contact_problem_t), intent(in) :: problem
      !> Of all rows, or by sweeps.
      type(explicit_compliance_t), intent(in) :: compliance
      !> Penalty parameters (n_rows) [length/pressure].
      real(dp), intent(in) :: theta(:)
      !> (n_rows).
      logical, intent(in) :: active(:)
      !> Out of memory.
      type(error_t), allocatable, intent(out) :: error
    end subroutine init_interface

    !> Solve the system.
    subroutine solve_interface(self, problem, compliance, b, c, lambda, alpha)
      import :: active_system_t, contact_problem_t, explicit_compliance_t, dp
      class(active_system_t), intent(in) :: self
      type(contact_problem_t), intent(inout) :: problem
      type(explicit_compliance_t), intent(in) :: compliance
      !> Right-hand sides: (n) [length], (coarse%n) [force].
      real(dp), intent(in) :: b(:), c(:)
      !> Forces at the active points; a guess on entry (n) [force].
      real(dp), intent(inout) :: lambda(:)
      !> Amplitudes of the free motions (coarse%n) [length].
      real(dp), intent(out) :: alpha(:)
    end subroutine solve_interface

    !> Give back all memory.
    subroutine destroy_interface(self)
      import :: active_system_t
      class(active_system_t), intent(inout) :: self
    end subroutine destroy_interface
  end interface

contains

  !> Take the active points of a problem.
  subroutine system_take_points(self, problem, theta, active)
    class(active_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> (n_rows).
    logical, intent(in) :: active(:)
    integer :: i
    self%row = pack([(i, i=1, size(active))], active)
    self%layer = theta(self%row)/problem%operator%weight(self%row)
  end subroutine system_take_points

  !> Give back what all systems have.
  subroutine system_forget(self)
    class(active_system_t), intent(inout) :: self
    if (allocated(self%row)) deallocate (self%row, self%layer)
    if (allocated(self%null_mode)) deallocate (self%null_mode)
  end subroutine system_forget
end module dotyk_scheme_active_system
