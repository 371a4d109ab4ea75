!> What a scheme did, step by step, and how it ended.
module dotyk_scheme_history
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> How an iteration ended.
  integer, parameter, public :: ended_converged = 1  !< the stop rule is met
  integer, parameter, public :: ended_limit = 2      !< max_iterations reached
  integer, parameter, public :: ended_diverged = 3   !< the steps grow
  integer, parameter, public :: ended_stalled = 4    !< rounding allows no smaller error
  integer, parameter, public :: ended_no_equilibrium = 5  !< loads move a free body, and no contact can stop it
  integer, parameter, public :: ended_rounds = 7     !< no answer met the budget, of as many as a scene gets
  integer, parameter, public :: ended_rigid_constraint = 6  !< supports press contact points together that cannot give way
  integer, parameter, public :: ended_interrupted = 8  !< somebody asked the program to stop
  integer, parameter, public :: ended_time = 9       !< time to write results: the iteration continues from there

  !> One entry per iteration; arrays are longer than `n` while the iteration goes on.
  type, public :: history_t
    !> Number of entries.
    integer :: n = 0
    !> Wall time since the start of the scheme [s].
    real(dp), allocatable :: seconds(:)
    !> ||u^{k+1} - u^k||_A / ||u^{k+1}||_A [].
    real(dp), allocatable :: increment(:)
    !> Guaranteed bound of the relative error in the energy norm [].
    real(dp), allocatable :: error_bound(:)
    !> Relative errors of penalty and discretization, NaN where they were not estimated [].
    real(dp), allocatable :: error_penalty(:), error_discretization(:)
    !> F_theta [energy].
    real(dp), allocatable :: energy(:)
    !> Largest penetration [length].
    real(dp), allocatable :: max_penetration(:)
    !> Number of contact points under pressure.
    integer, allocatable :: active(:)
    !> Lengths of the last steps in the energy norm, newest first [sqrt(energy)].
    real(dp), private :: length(11) = 0
  contains
    procedure :: add => history_add
    procedure :: finish => history_finish
    procedure :: put_behind => history_put_behind
    procedure :: measured_contraction => history_measured_contraction
  end type history_t

  !> Where a scheme got to.
  type, public :: scheme_result_t
    !> State: pressure of the last iterate's contact forces, u = u0 - K^{-1} B^T W m (n_rows) [pressure].
    real(dp), allocatable :: m(:)
    !> B u - d of the last iterate (n_rows) [length].
    real(dp), allocatable :: y(:)
    !> Amplitudes of the free motions of the responses, body after body; of size 0 where all bodies are held.
    real(dp), allocatable :: alpha(:)
    !> Motions that neither contact nor loads determine, as columns of amplitudes (size of alpha, number of them).
    real(dp), allocatable :: undetermined(:, :)
    !> Where ended_no_equilibrium: amplitudes of a motion that the loads excite and no contact can stop.
    real(dp), allocatable :: unbounded_direction(:)
    !> How it ended: one of the parameters above.
    integer :: ended = ended_limit
    !> Steps done.
    integer :: iterations = 0
    !> Contact points that were left out, as they stay open.
    integer :: left_out = 0
    !> Relaxation parameter [].
    real(dp) :: gamma = 0
    !> Upper estimate of L [].
    real(dp) :: lambda_max = 0
    !> Factor that the theory promises at worst (sharp), and the one that was seen at the end [].
    real(dp) :: q_predicted = 0, q_measured = 0
    !> Guaranteed bound of the relative error, and the one of (41) [].
    real(dp) :: error_bound = 0, error_bound_paper = 0
    !> F_theta [energy].
    real(dp) :: energy = 0
    !> Largest penetration [length].
    real(dp) :: max_penetration = 0
    type(history_t) :: history
  contains
    procedure :: add_rounding => result_add_rounding
  end type scheme_result_t

  public :: ending_name

contains

  !> Let the error bound contain what rounding has left. Where that is beyond the tolerance by itself it has not been reached, unless no
  !> number could be better.
  subroutine result_add_rounding(self, rounding, unavoidable, tolerance)
    class(scheme_result_t), intent(inout) :: self
    !> Relative, in the energy norm; what the last digits of the displacements are worth [].
    real(dp), intent(in) :: rounding, unavoidable, tolerance
    if (self%error_bound < huge(rounding)) self%error_bound = self%error_bound + rounding
    if (self%ended == ended_converged .and. rounding > max(tolerance, unavoidable)) self%ended = ended_stalled
    if (self%history%n > 0) self%history%error_bound(self%history%n) = self%error_bound
  end subroutine result_add_rounding

  !> How an iteration ended, in one word for the results file.
  pure function ending_name(ended) result(name)
    !> One of the parameters above.
    integer, intent(in) :: ended
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
    case (ended_rounds)
      name = 'budget'
    case (ended_interrupted)
      name = 'interrupted'
    case (ended_time)
      name = 'running'
    case default
      name = 'not solvable'
    end select
  end function ending_name

  !> Add an entry; `length` is the increment before it was divided by the norm of the iterate.
  subroutine history_add(self, seconds, length, increment, error_bound, energy, max_penetration, active)
    class(history_t), intent(inout) :: self
    real(dp), intent(in) :: seconds, length, increment, error_bound, energy, max_penetration
    integer, intent(in) :: active
    if (.not. allocated(self%seconds)) call resize(self, 128)
    if (self%n == size(self%seconds)) call resize(self, 2*self%n)
    self%n = self%n + 1
    self%length = [length, self%length(:size(self%length) - 1)]
    self%seconds(self%n) = seconds
    self%increment(self%n) = increment
    self%error_bound(self%n) = error_bound
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

  !> Put this history behind an earlier one, both finished.
  subroutine history_put_behind(self, earlier)
    class(history_t), intent(inout) :: self
    type(history_t), intent(in) :: earlier
    if (earlier%n == 0) return
    self%seconds = [earlier%seconds, earlier%seconds(earlier%n) + self%seconds]
    self%increment = [earlier%increment, self%increment]
    self%error_bound = [earlier%error_bound, self%error_bound]
    self%error_penalty = [earlier%error_penalty, self%error_penalty]
    self%error_discretization = [earlier%error_discretization, self%error_discretization]
    self%energy = [earlier%energy, self%energy]
    self%max_penetration = [earlier%max_penetration, self%max_penetration]
    self%active = [earlier%active, self%active]
    self%n = earlier%n + self%n
  end subroutine history_put_behind

  !> Arrays of another length.
  subroutine resize(self, length)
    class(history_t), intent(inout) :: self
    integer, intent(in) :: length
    integer, allocatable :: active(:)
    call resize_real(self%seconds)
    call resize_real(self%increment)
    call resize_real(self%error_bound)
    call resize_real(self%error_penalty)
    call resize_real(self%error_discretization)
    call resize_real(self%energy)
    call resize_real(self%max_penetration)
    allocate (active(length), source=0)
    if (self%n > 0) active(:self%n) = self%active(:self%n)
    call move_alloc(active, self%active)
  contains
    subroutine resize_real(values)
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
    span = min(size(self%length), self%n) - 1
    if (span < 1) return
    if (.not. self%length(span + 1) > 0) return
    q = (self%length(1)/self%length(span + 1))**(1.0_dp/span)
  end function history_measured_contraction
end module dotyk_scheme_history
