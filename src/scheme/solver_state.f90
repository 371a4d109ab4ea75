!> The state of a scheme: Lagrange multipliers, amplitudes of the rigid body modes, history, and how the scheme ended.
!>
!> A state with pressures is where a scheme begins (a warm start), one without them begins at the solution without
!> contact.
module dotyk_scheme_solver_state
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: stop_residual
  use dotyk_base_thresholds, only: one_digit
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  implicit none
  private
  public :: ending_name

  integer, parameter :: n_measured = 11  !! Steps over which the contraction is measured, and the one before them.
  integer, parameter :: first_size = 128  !! Entries of new arrays; they double where they are full.

  type, public :: history_t  !! One entry per iteration; arrays are longer than `n` while the iteration goes on.
    integer :: n = 0  !! Number of entries.
    real(dp), allocatable :: seconds(:)  !! Wall time since the start of the scheme [s].
    real(dp), allocatable :: increment(:)  !! ||u^{k+1} - u^k||_G / ||u^{k+1}||_A, G = A but for the Robin scheme [].
    real(dp), allocatable :: error_bound(:)  !! Guaranteed bound of the relative error in the energy norm [].
    real(dp), allocatable :: error_bound_paper(:)  !! Bound (41) of the same error; NaN where there is none [].
    !> Relative errors of penalty and discretization, NaN where they were not estimated [].
    real(dp), allocatable :: error_penalty(:), error_discretization(:)
    real(dp), allocatable :: energy(:)  !! F_theta [energy].
    real(dp), allocatable :: max_penetration(:)  !! Largest penetration [length].
    integer, allocatable :: active(:)  !! Number of active contact rows.
    !> Lengths of the last steps in the norm of G, newest first [sqrt(energy)].
    real(dp), private :: length(n_measured) = 0
    !> Steps that `length` has seen: those of this iteration, without earlier ones that were put before it.
    integer, private :: n_lengths = 0
  contains
    procedure :: add => history_add
    procedure :: finish => history_finish
    procedure :: put_after => history_put_after
    procedure :: measured_contraction => history_measured_contraction
  end type history_t

  !> How an iteration ended.
  integer, parameter, public :: ended_converged = 1  !< the stopping criterion is met
  integer, parameter, public :: ended_limit = 2  !< max_iterations reached
  integer, parameter, public :: ended_diverged = 3  !< the steps grow
  integer, parameter, public :: ended_stalled = 4  !< rounding allows no smaller error
  integer, parameter, public :: ended_no_equilibrium = 5  !< loads move a floating body, and no contact can stop it
  integer, parameter, public :: ended_rigid_constraint = 6  !< supports on both sides press contact rows together
  integer, parameter, public :: ended_interrupted = 8  !< the program was asked to stop
  integer, parameter, public :: ended_time = 9  !< the time limit: the next call continues
  integer, parameter, public :: ended_cycling = 10  !< active sets come again, after the interior-point method too
  integer, parameter, public :: ended_unbalanced = 11  !< contact forces do not balance the loads of floating bodies
  integer, parameter, public :: ended_rotated = 12  !< a body rotates by more than linear kinematics can describe
  integer, parameter, public :: ended_unverified = 13  !< a rule without guarantee is met, and no bound confirms it
  integer, parameter, public :: ended_penetration = 14  !< deformed bodies penetrate each other
  integer, parameter, public :: ended_open_tie = 15  !< ties contradict each other or supports
  integer, parameter, public :: ended_solves = 16  !< p-multigrid allows no smaller error
  integer, parameter, public :: ended_gaps = 18  !< the results hang on what is not known of the gaps
  integer, parameter, public :: ended_costly = 17  !< p-multigrid takes longer than factors: there is no solution

  !> What a scheme needs beside the state to continue an iteration that the time limit stopped. Each scheme that can
  !> continue has an extension.
  type, abstract, public :: paused_t
  end type paused_t

  type, public :: solver_state_t  !! The state.
    !> Contact pressures of the last iterate, u = u_0 - K^+ B^T W m + R alpha (n_rows) [pressure].
    real(dp), allocatable :: pressure(:)
    real(dp), allocatable :: penetration(:)  !! B u - d of the last iterate (n_rows) [length].
    !> Amplitudes of the rigid body modes, body after body; of size 0 where all bodies are held [length].
    real(dp), allocatable :: alpha(:)
    !> Indeterminate rigid body modes, which neither contact nor loads determine, as columns of amplitudes.
    type(mode_columns_t) :: indeterminate
    !> What springs carry for want of contact that would (`dotyk_scheme_proximal_motion`): forces on the rigid body
    !> modes (as `alpha`) [force], as a fraction of the forces on each body, 0 where it is rounding (n_bodies) [], and
    !> without what the uncertainty of the normals explains (n_bodies) [].
    real(dp), allocatable :: imbalance(:), rest(:), excess(:)
    !> Where ended_no_equilibrium: amplitudes of an unbounded direction, a motion that the loads excite and no contact
    !> can stop.
    real(dp), allocatable :: unbounded(:)
    !> Where ended_rigid_constraint: the row that overlaps most of those that nothing moves, 0 where the scheme does not
    !> tell it, and by how much, with ties closed. Where ended_open_tie: the row that stays open most, by how much, and
    !> of what [length].
    integer :: rigid_row = 0
    real(dp) :: overlap = 0, overlap_of = 0
    integer :: ended = ended_limit  !! How it ended: one of the parameters above.
    !> Rule that the iteration ends by where it converges: one of `stop_*` of dotyk_base_options.
    integer :: stop_rule = stop_residual
    integer :: iterations = 0  !! Steps done.
    integer :: screened = 0  !! Inactive rows that were screened, and never entered the working set.
    real(dp) :: gamma = 0  !! Relaxation parameter [].
    real(dp) :: lambda_max = 0  !! Upper estimate of L; 0 where not known [].
    !> Constants of the general iteration (32); allocated by its schemes only.
    type(iteration_constants_t), allocatable :: constants
    !> Contraction factor per step that the theory promises at worst (sharp), and the one that was measured at the end
    !> [].
    real(dp) :: q_predicted = 0, q_measured = 0
    !> Guaranteed bound of the relative error in the energy norm, and the one of (41) [].
    real(dp) :: error_bound = 0, error_bound_paper = 0
    !> Whether it is guaranteed but for rounding; not where it rests on a constant that was measured.
    logical :: bound_is_guaranteed = .true.
    real(dp) :: energy = 0  !! F_theta [energy].
    !> Strain energy and work of the loads of the displacements, where the scheme has these: the terms of F_theta with
    !> which its error is one of second order (2) [energy].
    real(dp), allocatable :: terms(:)
    real(dp) :: max_penetration = 0  !! Largest penetration [length].
    type(history_t) :: history  !! Step by step.
    !> Allocated where the scheme ended with `ended_time` in the middle of an iteration: its next call continues with
    !> the same iterates as without the interruption.
    class(paused_t), allocatable :: paused
  contains
    procedure :: norm => state_norm
    procedure :: has_converged => state_has_converged
    procedure :: was_interrupted => state_was_interrupted
    procedure :: add_rounding => state_add_rounding
  end type solver_state_t

contains

  !> Energy norm of the displacements [sqrt(energy)].
  pure real(dp) function state_norm(self, qp) result(norm)
    class(solver_state_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    if (allocated(self%terms)) then
      norm = sqrt(2*max(0.0_dp, self%terms(1)))
    else
      norm = qp%energy_norm(self%pressure, self%penetration, self%alpha/qp%coarse%scale)
    end if
  end function state_norm

  !> Whether the solution is one to the tolerance.
  pure logical function state_has_converged(self) result(has_converged)
    class(solver_state_t), intent(in) :: self
    has_converged = self%ended == ended_converged
  end function state_has_converged

  !> Whether an interrupt ended the iteration.
  pure logical function state_was_interrupted(self) result(was_interrupted)
    class(solver_state_t), intent(in) :: self
    was_interrupted = self%ended == ended_interrupted
  end function state_was_interrupted

  !> Add rounding to the error bound. Where rounding alone exceeds the tolerance, the tolerance has not been reached,
  !> unless no result in double precision could be more accurate; p-multigrid is not refined as factors are. Where a
  !> rule other than the bound ended the iteration, the bound decides whether the iterate is a solution: an increment is
  !> small where gamma is, at any distance.
  subroutine state_add_rounding(self, rounding, unavoidable, tolerance)
    class(solver_state_t), intent(inout) :: self
    !> Relative, in the energy norm: of this solution, and of any displacements that are stored in double precision [].
    real(dp), intent(in) :: rounding, unavoidable
    real(dp), intent(in) :: tolerance  !! Tolerance of the scheme [].
    if (self%error_bound < huge(rounding)) self%error_bound = self%error_bound + rounding
    if (self%ended == ended_converged .and. rounding > max(tolerance, unavoidable)) &
      self%ended = merge(ended_stalled, ended_solves, self%bound_is_guaranteed)
    ! A bound that leaves no digit confirms nothing.
    if (self%ended == ended_converged .and. self%stop_rule /= stop_residual .and. &
        .not. self%error_bound <= one_digit) self%ended = ended_unverified
    if (self%history%n > 0) self%history%error_bound(self%history%n) = self%error_bound
  end subroutine state_add_rounding

  !> How an iteration ended, in one word for the results file.
  pure function ending_name(ended) result(name)
    integer, intent(in) :: ended  !! One of the parameters above.
    character(:), allocatable :: name
    select case (ended)
    case (ended_converged)
      name = 'converged'
    case (ended_limit)
      name = 'max_iterations'
    case (ended_diverged)
      name = 'diverged'
    case (ended_stalled)
      name = 'stalled'
    case (ended_interrupted)
      name = 'interrupted'
    case (ended_time)
      name = 'running'
    case (ended_cycling)
      name = 'cycling'
    case (ended_unbalanced)
      name = 'unbalanced'
    case (ended_rotated)
      name = 'large_rotation'
    case (ended_unverified)
      name = 'unverified'
    case (ended_gaps)
      name = 'uncertain_gaps'
    case (ended_penetration)
      name = 'penetration'
    case (ended_solves)
      name = 'solves'
    case default
      name = 'not solvable'
    end select
  end function ending_name

  !> Add an entry; `length` is the increment before it was divided by the norm of the iterate.
  subroutine history_add(self, seconds, length, increment, error_bound, energy, max_penetration, active, &
                         error_bound_paper)
    class(history_t), intent(inout) :: self
    !> As the components of `history_t`, of one step; the length [sqrt(energy)].
    real(dp), intent(in) :: seconds, length, increment, error_bound, energy, max_penetration
    integer, intent(in) :: active  !! Number of active contact rows.
    real(dp), intent(in), optional :: error_bound_paper  !! Bound (41); there is none if absent [].
    if (.not. allocated(self%seconds)) call resize(self, first_size)
    if (self%n == size(self%seconds)) call resize(self, 2*self%n)
    self%n = self%n + 1
    self%length = [length, self%length(:size(self%length) - 1)]
    self%n_lengths = self%n_lengths + 1
    self%seconds(self%n) = seconds
    self%increment(self%n) = increment
    self%error_bound(self%n) = error_bound
    self%error_bound_paper(self%n) = ieee_value(length, ieee_quiet_nan)
    if (present(error_bound_paper)) self%error_bound_paper(self%n) = error_bound_paper
    self%error_penalty(self%n) = ieee_value(length, ieee_quiet_nan)
    self%error_discretization(self%n) = ieee_value(length, ieee_quiet_nan)
    self%energy(self%n) = energy
    self%max_penetration(self%n) = max_penetration
    self%active(self%n) = active
  end subroutine history_add

  !> Cut the arrays to the entries that there are.
  subroutine history_finish(self)
    class(history_t), intent(inout) :: self
    call resize(self, self%n)
  end subroutine history_finish

  !> Put this history after an earlier one, both finished.
  subroutine history_put_after(self, earlier)
    class(history_t), intent(inout) :: self
    type(history_t), intent(in) :: earlier  !! History of the same scheme, ended before this one began.
    if (earlier%n == 0) return
    self%seconds = [earlier%seconds, earlier%seconds(earlier%n) + self%seconds]
    self%increment = [earlier%increment, self%increment]
    self%error_bound = [earlier%error_bound, self%error_bound]
    self%error_bound_paper = [earlier%error_bound_paper, self%error_bound_paper]
    self%error_penalty = [earlier%error_penalty, self%error_penalty]
    self%error_discretization = [earlier%error_discretization, self%error_discretization]
    self%energy = [earlier%energy, self%energy]
    self%max_penetration = [earlier%max_penetration, self%max_penetration]
    self%active = [earlier%active, self%active]
    self%n = earlier%n + self%n
  end subroutine history_put_after

  !> Arrays of another length.
  subroutine resize(self, length)
    class(history_t), intent(inout) :: self
    integer, intent(in) :: length  !! Entries of the new arrays, at least those in use.
    integer, allocatable :: active(:)
    call resize_real(self%seconds)
    call resize_real(self%increment)
    call resize_real(self%error_bound)
    call resize_real(self%error_bound_paper)
    call resize_real(self%error_penalty)
    call resize_real(self%error_discretization)
    call resize_real(self%energy)
    call resize_real(self%max_penetration)
    allocate (active(length), source=0)
    if (self%n > 0) active(:self%n) = self%active(:self%n)
    call move_alloc(active, self%active)
  contains
    !> One array.
    subroutine resize_real(values)
      !> One array of the history; the first `n` values stay (length) [any].
      real(dp), allocatable, intent(inout) :: values(:)
      real(dp), allocatable :: longer(:)
      allocate (longer(length), source=0.0_dp)
      if (self%n > 0) longer(:self%n) = values(:self%n)
      call move_alloc(longer, values)
    end subroutine resize_real
  end subroutine resize

  !> Mean factor between the last increments (up to ten of them); NaN where there are fewer than two.
  pure real(dp) function history_measured_contraction(self) result(q)
    class(history_t), intent(in) :: self
    integer :: span
    q = ieee_value(q, ieee_quiet_nan)
    span = min(size(self%length), self%n_lengths) - 1
    if (span < 1) return
    if (.not. self%length(span + 1) > 0) return
    q = (self%length(1)/self%length(span + 1))**(1.0_dp/span)
  end function history_measured_contraction
end module dotyk_scheme_solver_state
