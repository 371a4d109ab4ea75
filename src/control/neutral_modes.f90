!> Neutral modes of the floating bodies: found before the contact is solved, and held where they matter.
!>
!> A mode that contact resists by no more than the normals are uncertain (`dotyk_scheme_neutral_modes`) does no harm as
!> long as it stays small. Where it would move a body by several elements it is taken out of the coarse space: on a
!> Winkler foundation, which is known before, in the solution, or where the scheme finds none; the contact is solved
!> again then. The body does not move along it, and its forces need not be in equilibrium along it. The compliance
!> operator is the Moore-Penrose inverse, so that it distributes the resultant that is left over over the body.
!>
!> Motions of tied bodies are those of several bodies, which nobody looks for: they are at rest in the equilibria on the
!> foundation, and never held. Where one moves far along a neutral mode of its own the solution is none.
module dotyk_control_neutral_modes
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_control_common_motions, only: keep_common_motions
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_control_neutral_candidates, only: candidate_t, find_candidates, find_left_over, &
    floats, moved_beyond_others
  use dotyk_control_slave_normals, only: find_deviations
  use dotyk_linalg_dense, only: complete_basis
  use dotyk_scheme_centrality, only: point_t
  use dotyk_scheme_coarse_space, only: coarse_space_t, contact_modes_t, mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_neutral_modes, only: flat, rest_on_foundation
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_cycling, ended_no_equilibrium, &
    ended_slid, ended_unbalanced
  implicit none
  private

  !> The neutral modes of all bodies.
  type, public :: neutral_modes_t
    !> (n_bodies)
    type(candidate_t), allocatable, private :: candidate(:)
    !> All modes at the contact nodes; not allocated where nothing floats on curved surfaces (n_bodies).
    type(contact_modes_t), allocatable, private :: modes(:)
    !> Bodies that ties hold (n_bodies).
    logical, allocatable, private :: is_tied(:)
    !> Stiffness of the Winkler foundation; 0 for ties (n_rows) [force/length].
    real(dp), allocatable, private :: stiffness(:)
    !> The latest equilibrium on it: amplitudes of all modes of `modes`, body after body (n_modes) [length].
    real(dp), allocatable, private :: motion(:)
    !> An iterate of the interior-point method on the way to it, its amplitudes those of all modes; nothing where the
    !> method was not used.
    type(point_t), private :: kept
    !> Times that the contact has been solved again.
    integer, private :: n_again = 0
  contains
    procedure :: find => neutral_find
    procedure :: has_any => neutral_has_any
    procedure :: hold => neutral_hold
    procedure :: moved_far => neutral_moved_far
    procedure :: asks_again => neutral_asks_again
    procedure :: judge => neutral_judge
    procedure :: start => neutral_start
  end type neutral_modes_t

  !> Motions of more facets than this are not small: the pairs of points that the rows know are others then.
  real(dp), parameter :: several = 2
  !> Resultants along neutral modes are noise up to this fraction of the contact forces of the body: they are the error
  !> of its equilibrium.
  real(dp), parameter :: most_left_over = 0.01_dp
  !> Fraction of the contact forces from which on a solution is none: the Winkler foundation of `most_left_over` knows
  !> forces to a factor.
  real(dp), parameter :: largest_left_over = 0.05_dp
  !> Times that the contact is solved again at most: bodies that are held may send others on their way.
  integer, parameter :: most_again = 4
  !> Schemes begin with the equilibrium of so many modes; of fewer they find the start faster than it takes to use it.
  integer, parameter :: many_modes = 300
  !> Passes that release loaded directions at most, one direction of a body each; the last ones release all.
  integer, parameter :: most_passes = 8
  !> Of many modes the last pass is the one that releases no more than this fraction of the directions that are held:
  !> most of the time would go into equilibria that change a few bodies each. What is out of balance there is told.
  real(dp), parameter :: few = 0.02_dp

contains

  !> Find the neutral modes, and hold those that would move a body by several elements.
  subroutine neutral_find(self, problem, theta, modes, qp, error)
    class(neutral_modes_t), intent(out) :: self
    !> Bodies, modes and contact pairs; gets the modes that are held.
    type(contact_problem_t), intent(inout) :: problem
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The modes at the contact nodes (n_bodies).
    type(contact_modes_t), intent(in) :: modes(:)
    !> The quadratic programme with all modes; without those that are held on return.
    type(contact_qp_t), intent(inout) :: qp
    !> An entry is not finite, or LAPACK's singular value decomposition does not converge.
    type(error_t), allocatable, intent(out) :: error
    type(mode_block_t), allocatable :: deviation(:)
    type(coarse_space_t) :: coarse
    real(dp), allocatable :: angle(:), force(:), alpha(:)
    integer :: b, k
    ! A scene may be factorized twice.
    if (allocated(problem%neutral)) deallocate (problem%neutral)
    allocate (problem%neutral(size(problem%body)), self%candidate(size(problem%body)))
    if (qp%n_rows == 0) return
    allocate (self%is_tied(size(modes)), source=.false.)
    do k = 1, problem%n_ties()
      self%is_tied([problem%tie(k)%component(1)%body_a, problem%tie(k)%component(1)%body_b]) = .true.
    end do
    if (.not. any([(floats(modes(b)), b=1, size(modes))])) return
    call find_deviations(problem, qp, modes, deviation, angle)
    if (.not. any(angle > flat)) return
    self%modes = modes
    self%stiffness = qp%weight/(qp%foundation + theta)
    self%stiffness(sum(problem%pair%n_rows) + 1:) = 0
    coarse = qp%coarse
    if (any(self%is_tied)) call replace_modes(self%modes, self%is_tied, qp)
    call find_candidates(problem, modes, coarse, qp, deviation, angle, self%stiffness, self%candidate, error)
    if (.not. allocated(error)) call keep_common_motions(problem, qp, self%candidate)
    if (.not. allocated(error) .and. any(self%candidate%n > 0)) then
      allocate (force(qp%n_rows), alpha(qp%coarse%n))
      call rest_on_foundation(qp, self%stiffness, force, alpha, kept=self%kept)
      if (allocated(self%kept%alpha)) self%kept%alpha = qp%coarse%scale*self%kept%alpha
      self%motion = qp%coarse%scale*alpha
    end if
    if (any(self%is_tied)) call replace_modes(self%modes, [(.false., b=1, size(modes))], qp)
    if (.not. allocated(self%motion)) return
    call self%hold(self%moved_far(self%motion), problem, qp)
  end subroutine neutral_find

  !> Whether there are neutral modes, held or not: the contact may be solved again because of them.
  pure logical function neutral_has_any(self) result(has_any)
    class(neutral_modes_t), intent(in) :: self
    has_any = .false.
    if (allocated(self%candidate)) has_any = any(self%candidate%n > 0)
  end function neutral_has_any

  !> Bodies that move by several elements along neutral modes that are not held.
  function neutral_moved_far(self, alpha) result(moved)
    class(neutral_modes_t), intent(in) :: self
    !> Amplitudes of the modes of all bodies, body after body (n_modes) [length].
    real(dp), intent(in) :: alpha(:)
    !> (n_bodies)
    logical, allocatable :: moved(:)
    real(dp), allocatable :: amplitude(:)
    integer :: b, first
    allocate (moved(size(self%candidate)), source=.false.)
    if (.not. allocated(self%modes)) return
    first = 1
    do b = 1, size(self%candidate)
      associate (own => self%candidate(b), last => first + size(self%modes(b)%resultant) - 1)
        if (own%n > own%n_held) then
          amplitude = alpha(first:last)
          if (own%n_held == 0) then
            amplitude = matmul(own%whole, matmul(amplitude, own%whole))
          else
            associate (free => own%basis(:, own%n_held + 1:own%n))
              amplitude = matmul(free, amplitude(own%n_held + 1:own%n))
            end associate
          end if
          moved(b) = maxval(abs(matmul(self%modes(b)%displacement, amplitude))) > several*own%element_size
        end if
        first = last + 1
      end associate
    end do
  end function neutral_moved_far

  !> Hold the neutral modes of some bodies that no tie holds, but for loaded directions.
  subroutine neutral_hold(self, chosen, problem, qp)
    class(neutral_modes_t), intent(inout) :: self
    !> The bodies; those that are held already stay as they are (n_bodies).
    logical, intent(in) :: chosen(:)
    !> Bodies, modes and contact pairs; gets the modes that are held.
    type(contact_problem_t), intent(inout) :: problem
    !> The quadratic programme; without the modes that are held on return.
    type(contact_qp_t), intent(inout) :: qp
    logical :: is_new(size(chosen))
    integer :: b
    is_new = chosen .and. .not. self%is_tied .and. self%candidate%n_held == 0 .and. self%candidate%n > 0
    if (.not. any(is_new)) return
    where (is_new) self%candidate%n_held = self%candidate%n
    call release_loaded(self%modes, self%is_tied, self%stiffness, is_new, qp, self%candidate, self%motion, self%kept)
    do b = 1, size(chosen)
      associate (own => self%candidate(b))
        if (.not. is_new(b) .or. own%n_held == 0) cycle
        call problem%modes(b)%rotate(own%basis)
        problem%neutral(b)%n = own%n_held
        problem%neutral(b)%resultant = problem%modes(b)%resultant(:own%n_held)
        problem%neutral(b)%at_rows = matmul(own%g, own%basis(:, :own%n_held))
      end associate
    end do
  end subroutine neutral_hold

  !> Whether the contact is to be solved again with more modes held: bodies have moved by several elements along neutral
  !> modes, or farther than anything else moves, or the scheme found no solution.
  logical function neutral_asks_again(self, state, problem, qp) result(again)
    class(neutral_modes_t), intent(inout) :: self
    !> How the scheme ended.
    type(solver_state_t), intent(in) :: state
    !> Bodies, modes and contact pairs; gets the modes that are held.
    type(contact_problem_t), intent(inout) :: problem
    !> The quadratic programme; without the modes that are held on return.
    type(contact_qp_t), intent(inout) :: qp
    logical, allocatable :: chosen(:)
    integer :: n_held
    again = .false.
    if (.not. allocated(self%modes) .or. self%n_again == most_again) return
    if (any(state%ended == [ended_cycling, ended_unbalanced, ended_no_equilibrium])) then
      chosen = self%candidate%n > 0
    else if (state%ended == ended_converged .and. allocated(state%alpha)) then
      chosen = self%moved_far(state%alpha) .or. &
               moved_beyond_others(self%candidate, problem, qp, state%y, state%alpha)
      ! Most of many have motions that loads drive. They slide whatever becomes of the others: this is no solution, and
      ! the next one would be none either.
      if (qp%coarse%n >= many_modes .and. 2*count(chosen .and. self%candidate%n_held == 0) < count(chosen)) return
    else
      return
    end if
    n_held = sum(self%candidate%n_held)
    call self%hold(chosen, problem, qp)
    self%n_again = self%n_again + 1
    again = sum(self%candidate%n_held) > n_held
  end function neutral_asks_again

  !> Give a scheme the equilibrium on the Winkler foundation to begin with.
  subroutine neutral_start(self, qp, state)
    class(neutral_modes_t), intent(in) :: self
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> Not begun; gets amplitudes of the modes where an equilibrium is known.
    type(solver_state_t), intent(inout) :: state
    if (.not. allocated(self%motion)) return
    if (size(self%motion) >= many_modes) &
      state%alpha = qp%coarse%scale*amplitudes_of(self%motion, self%candidate, qp%coarse)
  end subroutine neutral_start

  !> Judge a solution: bodies that have moved by several elements along neutral modes, loads along those that are held
  !> which contact does not resist, or contact forces far from equilibrium there make it none.
  subroutine neutral_judge(self, problem, qp, state)
    class(neutral_modes_t), intent(in) :: self
    !> Bodies and their modes; gets the residuals of those that are held.
    type(contact_problem_t), intent(inout) :: problem
    !> The quadratic programme.
    type(contact_qp_t), intent(in) :: qp
    !> The solution; how it ended changes where it is none.
    type(solver_state_t), intent(inout) :: state
    integer :: b
    if (.not. allocated(self%modes) .or. .not. allocated(state%m) .or. .not. allocated(state%alpha)) return
    do b = 1, size(self%candidate)
      if (problem%neutral(b)%n == 0) cycle
      associate (row => qp%block(b)%row)
        call find_left_over(problem%neutral(b), problem%modes(b)%shape, qp%weight(row)*state%m(row))
      end associate
    end do
    problem%neutral%moved_far = self%moved_far(state%alpha)
    if (any(self%is_tied)) problem%neutral%moved_far = problem%neutral%moved_far .or. &
      self%is_tied .and. moved_beyond_others(self%candidate, problem, qp, state%y, state%alpha)
    problem%neutral%n_free = self%candidate%n - self%candidate%n_held
    if (state%ended /= ended_converged) return
    if (any(problem%neutral%left_over > largest_left_over .or. problem%neutral%lost_load > 0)) &
      state%ended = ended_unbalanced
    if (any(problem%neutral%moved_far)) state%ended = ended_slid
  end subroutine neutral_judge

  !> Release directions along which loads and contact forces are not in equilibrium by far: they are no noise. The
  !> forces are those of rigid bodies on a Winkler foundation.
  subroutine release_loaded(modes, is_tied, stiffness, may_release, qp, candidate, motion, kept)
    !> The modes at the contact nodes, all of them (n_bodies).
    type(contact_modes_t), intent(in) :: modes(:)
    !> Bodies that ties hold, at rest here (n_bodies).
    logical, intent(in) :: is_tied(:)
    !> Stiffness of the foundation (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)
    !> Bodies whose modes may be released (n_bodies).
    logical, intent(in) :: may_release(:)
    !> The quadratic programme; without the modes that are held on return.
    type(contact_qp_t), intent(inout) :: qp
    !> Neutral modes; fewer are held on return (n_bodies).
    type(candidate_t), intent(inout) :: candidate(:)
    !> The latest equilibrium: amplitudes of `modes`, body after body (n_modes) [length].
    real(dp), intent(inout) :: motion(:)
    !> An iterate on the way to it, its amplitudes those of `modes`; nothing where there is none.
    type(point_t), intent(inout) :: kept
    type(contact_modes_t) :: trial(size(modes))
    real(dp), allocatable :: along(:), turn(:, :), alpha(:)
    real(dp) :: force(qp%n_rows), most, length
    integer :: pass, b, n_released
    logical :: is_last
    allocate (alpha(qp%coarse%n))
    is_last = .false.
    do pass = 1, most_passes
      trial = modes
      do b = 1, size(modes)
        if (candidate(b)%n_held > 0) call hold_modes(candidate(b), trial(b))
      end do
      call replace_modes(trial, is_tied, qp)
      if (pass == most_passes .or. is_last) exit
      if (allocated(kept%alpha)) kept%alpha = amplitudes_of(kept%alpha, candidate, qp%coarse)
      call rest_on_foundation(qp, stiffness, force, alpha, amplitudes_of(motion, candidate, qp%coarse), kept)
      if (allocated(kept%alpha)) kept%alpha = motion_of(kept%alpha, candidate, qp%coarse)
      motion = motion_of(alpha, candidate, qp%coarse)
      n_released = 0
      do b = 1, size(modes)
        associate (own => candidate(b), row => qp%block(b)%row)
          if (own%n_held == 0 .or. .not. may_release(b)) cycle
          along = matmul(modes(b)%resultant - matmul(force(row), own%g), own%basis(:, :own%n_held))
          length = norm2(along)
          if (.not. length > 0) cycle
          along = along/length
          most = maxval(abs(matmul(modes(b)%displacement, matmul(own%basis(:, :own%n_held), along))))
          if (length <= most_left_over*sum(force(row))*most) cycle
          ! The direction of the loads comes behind the others.
          allocate (turn(own%n_held, own%n_held), source=0.0_dp)
          turn(:, 1) = along
          call complete_basis(turn, 1)
          own%basis(:, :own%n_held) = matmul(own%basis(:, :own%n_held), cshift(turn, 1, 2))
          n_released = n_released + 1
          own%n_held = merge(own%n_held - 1, 0, pass < most_passes - 1)
          deallocate (turn)
        end associate
      end do
      if (n_released == 0) exit
      is_last = qp%coarse%n >= many_modes .and. n_released <= few*sum(candidate%n_held)
    end do
    if (any(is_tied)) call replace_modes(trial, [(.false., b=1, size(modes))], qp)
  end subroutine release_loaded

  !> Give the QP other modes, or those of some bodies none.
  subroutine replace_modes(modes, at_rest, qp)
    !> The modes at the contact nodes (n_bodies).
    type(contact_modes_t), intent(in) :: modes(:)
    !> Bodies that do not move (n_bodies).
    logical, intent(in) :: at_rest(:)
    !> The quadratic programme.
    type(contact_qp_t), intent(inout) :: qp
    type(contact_modes_t) :: moving(size(modes))
    type(coarse_space_t) :: coarse
    integer :: b
    moving = modes
    do b = 1, size(modes)
      if (.not. at_rest(b)) cycle
      moving(b)%displacement = 0
      moving(b)%resultant = 0
    end do
    call coarse%init(qp%block, qp%n_rows, moving)
    call qp%replace_modes(coarse)
  end subroutine replace_modes

  !> Amplitudes of the modes of a QP, some of them held, that come next to a motion.
  function amplitudes_of(motion, candidate, coarse) result(alpha)
    !> Amplitudes of all modes, body after body (coarse%n) [length].
    real(dp), intent(in) :: motion(:)
    !> Bases of the bodies some of whose modes are held (n_bodies).
    type(candidate_t), intent(in) :: candidate(:)
    !> Modes of the QP.
    type(coarse_space_t), intent(in) :: coarse
    !> (coarse%n) [length]
    real(dp), allocatable :: alpha(:)
    integer :: b
    alpha = motion
    do b = 1, size(candidate)
      associate (first => coarse%first(b), last => coarse%first(b + 1) - 1, own => candidate(b))
        if (own%n_held == 0) cycle
        alpha(first:last) = matmul(motion(first:last), own%basis)
        alpha(first:first + own%n_held - 1) = 0
      end associate
    end do
    alpha = alpha/coarse%scale
  end function amplitudes_of

  !> The motion of such amplitudes.
  function motion_of(alpha, candidate, coarse) result(motion)
    !> Amplitudes of the modes of the QP (coarse%n) [length].
    real(dp), intent(in) :: alpha(:)
    !> Bases of the bodies some of whose modes are held (n_bodies).
    type(candidate_t), intent(in) :: candidate(:)
    !> Modes of the QP.
    type(coarse_space_t), intent(in) :: coarse
    !> Amplitudes of all modes, body after body (coarse%n) [length].
    real(dp), allocatable :: motion(:)
    integer :: b
    motion = coarse%scale*alpha
    do b = 1, size(candidate)
      associate (first => coarse%first(b), last => coarse%first(b + 1) - 1, own => candidate(b))
        if (own%n_held > 0) motion(first:last) = matmul(own%basis(:, own%n_held + 1:), motion(first + own%n_held:last))
      end associate
    end do
  end function motion_of

  !> Take another basis of the modes, with the neutral ones first, and make those that are held zero.
  subroutine hold_modes(candidate, modes)
    !> Modes of the body, with the neutral ones first.
    type(candidate_t), intent(in) :: candidate
    !> The modes at the contact nodes.
    type(contact_modes_t), intent(inout) :: modes
    real(dp), allocatable :: displacement(:, :), resultant(:)
    allocate (displacement, source=matmul(modes%displacement, candidate%basis))
    allocate (resultant, source=matmul(modes%resultant, candidate%basis))
    call move_alloc(displacement, modes%displacement)
    call move_alloc(resultant, modes%resultant)
    modes%n_held = candidate%n_held
    modes%displacement(:, :candidate%n_held) = 0
    modes%resultant(:candidate%n_held) = 0
  end subroutine hold_modes
end module dotyk_control_neutral_modes
