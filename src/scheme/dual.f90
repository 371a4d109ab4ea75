!> The dual scheme: contact forces lambda = W p >= 0 as unknowns, any theta >= 0, held and free bodies.
!>
!> It minimises `lambda (C + Theta W^{-1}) lambda/2 - lambda.y_free` over `lambda >= 0` with `G^T lambda = e`, the equilibrium of the free
!> bodies, by active sets (`dotyk_scheme_active_set`). Where to begin follows from the same problem on groups of points
!> (`dotyk_scheme_nested`).
!>
!> Points that would stay open if the bodies were rigid on elastic foundations are left out at first. At the end the displacement
!> says whether one of them closed: it comes back then, and the problem is solved again.
module dotyk_scheme_dual
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted, stop_if_interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: default_linear_solver, default_tolerance
  use dotyk_base_text, only: to_text
  use dotyk_scheme_active_set, only: iterate_t, find_active_set, is_balanced, reference_norm, &
    rest_on_winkler_foundation, rounding, update_penetrations
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_choice, only: choose_solver
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: history_t, scheme_result_t, ended_converged, ended_interrupted, ended_limit, &
    ended_no_equilibrium, ended_rigid_constraint, ended_stalled
  use dotyk_scheme_nested, only: few_points, find_start
  use dotyk_scheme_part, only: give_back, keep_rows
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_winkler_start, only: find_unbounded_direction
  implicit none
  private

  !> What the user may choose.
  type, public :: dual_settings_t
    !> Relative error in the energy norm.
    real(dp) :: tolerance = default_tolerance
    !> Active sets at most.
    integer :: max_iterations = 100
    !> One of `linear_solver_*`.
    integer :: linear_solver = default_linear_solver
  end type dual_settings_t

  public :: solve_dual

  !> Gaps that are none, as a part of the largest penetration or gap.
  real(dp), parameter :: touching = 1.0e-9_dp
  !> How often points that were left out come back; then all of them do.
  integer, parameter :: most_rounds = 4
  !> How often rows are kept that motions run into which the others do not stop; then all of them are.
  integer, parameter :: most_widenings = 10
  !> Rows join the working set that an unbounded direction moves into contact by more than this fraction of the largest such
  !> motion: others hardly resist it.
  real(dp), parameter :: resisting = 1.0e-3_dp
  !> Relative error bounds from here on are reported as none: squares of larger ones overflow.
  real(dp), parameter :: no_bound = 1.0e150_dp
  !> Scenes of more free motions than this, and fewer points for each, are solved with all points, from inside.
  integer, parameter :: many_motions = 60, points_per_motion = 30
  !> A part of all points that is not worth leaving out: to look at them in the end takes a solve.
  real(dp), parameter :: not_worth_leaving_out = 0.2_dp

contains

  !> Solve.
  subroutine solve_dual(problem, settings, log, compliance, result, error, start)
    type(contact_problem_t), intent(inout) :: problem
    type(dual_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    !> What is known of the compliance.
    type(explicit_compliance_t), intent(inout) :: compliance
    type(scheme_result_t), intent(out) :: result
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    !> Where to begin: a state of the same bodies and contact points, perhaps with another theta.
    type(scheme_result_t), intent(in), optional :: start
    class(active_system_t), allocatable :: system
    type(contact_problem_t) :: part
    type(scheme_result_t), allocatable :: state
    type(history_t) :: earlier
    logical, allocatable :: keep(:), late(:)
    logical :: is_checked
    integer :: round

    ! A state with a history is one of this problem; loads may have changed since another.
    is_checked = .false.
    if (present(start)) is_checked = start%history%n > 0
    if (.not. is_checked) call check_equilibrium(problem, result)
    if (result%ended == ended_no_equilibrium) return
    if (present(start)) then
      keep = start%m > 0
      state = start
    else
      call rows_to_begin_with(problem, keep)
    end if
    call choose_solver(problem, settings%linear_solver, keep, compliance, system)
    if (compliance%by_sweeps) call log%line('  active sets      by conjugate gradients, '//to_text(count(keep))// &
                                            ' points to begin with')
    do round = 1, most_rounds
      if (.not. all(keep) .and. problem%coarse%n > 0) call keep_what_carries(problem, keep)
      if (compliance%by_sweeps .or. round == most_rounds .or. size(keep) < few_points .or. &
          count(.not. keep) < not_worth_leaving_out*size(keep)) keep = .true.
      call compliance%mark(keep)
      if (all(keep)) then
        call solve_rows(problem, settings, log, compliance, system, result, error, state)
      else
        call keep_rows(problem, keep, part)
        if (allocated(state)) call restrict(keep, state)
        call solve_rows(part, settings, log, compliance, system, result, error, state)
        call give_back(part, problem)
        if (.not. allocated(error) .and. allocated(result%m)) call complete(problem, keep, result)
      end if
      call result%history%finish()
      call result%history%put_behind(earlier)
      if (allocated(error) .or. all(keep) .or. .not. allocated(result%m)) exit
      late = .not. keep .and. result%y > rounding*maxval(abs(problem%y_free))
      if (.not. any(late)) exit
      if (interrupted()) then
        ! The bound is that of the points that were kept.
        result%ended = ended_interrupted
        result%error_bound = huge(result%error_bound)
        exit
      end if
      ! How far they went says how far others may.
      keep = keep .or. result%y > -2*maxval(result%y, mask=late)
      earlier = result%history
      ! From a state that was near, and where active sets are hard to find, the next one is; one that groups of points gave is found anew.
      if (allocated(state) .or. problem%coarse%n > 0 .and. result%ended == ended_converged) state = result
    end do
    call system%destroy()
    result%iterations = result%history%n
    result%left_out = count(.not. keep)
  end subroutine solve_dual

  !> Whether contact can balance the loads of the floating bodies.
  subroutine check_equilibrium(problem, result)
    type(contact_problem_t), intent(in) :: problem
    !> Ended where loads excite a motion that no contact stops.
    type(scheme_result_t), intent(inout) :: result
    real(dp), allocatable :: motion(:)
    logical :: found
    allocate (motion(problem%coarse%n))
    call find_unbounded_direction(problem%operator, problem%coarse, motion, found)
    if (.not. found) return
    call leave_out(result)
    result%ended = ended_no_equilibrium
    result%unbounded_direction = problem%coarse%scale*motion
  end subroutine check_equilibrium

  !> Points that close where the bodies are rigid on elastic foundations.
  subroutine rows_to_begin_with(problem, keep)
    type(contact_problem_t), intent(in) :: problem
    !> (n_rows).
    logical, allocatable, intent(out) :: keep(:)
    type(iterate_t) :: now
    allocate (keep(problem%operator%n_rows))
    keep = .true.
    if (size(keep) == 0 .or. has_many_motions(problem)) return
    call rest_on_winkler_foundation(problem, now, keep)
    ! Free bodies sink in more than the foundations say, or tilt.
    if (problem%coarse%n > 0) keep = now%y > -maxval(now%y)
    ! Faces that just touch.
    keep = keep .or. abs(now%y) < touching*maxval(abs(now%y))
  end subroutine rows_to_begin_with

  !> Many bodies with few points each: they roll and tilt farther than groups of points or rigid bodies say, active sets come back, and more
  !> points cost little.
  pure logical function has_many_motions(problem)
    type(contact_problem_t), intent(in) :: problem
    has_many_motions = problem%coarse%n > many_motions .and. problem%operator%n_rows < points_per_motion*problem%coarse%n
  end function has_many_motions

  !> Bodies where they are without contact.
  subroutine begin_without_contact(problem, now)
    type(contact_problem_t), intent(in) :: problem
    type(iterate_t), intent(out) :: now
    allocate (now%lambda(problem%operator%n_rows), now%alpha(problem%coarse%n), source=0.0_dp)
    now%y = problem%y_free
  end subroutine begin_without_contact

  !> Keep more rows where those that are kept cannot carry the free bodies.
  subroutine keep_what_carries(problem, keep)
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(inout) :: keep(:)
    type(contact_problem_t) :: part
    real(dp), allocatable :: motion(:), way(:)
    logical :: found
    integer :: k
    allocate (motion(problem%coarse%n), way(size(keep)))
    do k = 1, most_widenings
      call keep_rows(problem, keep, part)
      call find_unbounded_direction(part%operator, part%coarse, motion, found)
      call give_back(part, problem)
      if (.not. found) return
      ! Rows that the motion runs into.
      call problem%coarse%displacement(problem%operator, motion, way)
      if (.not. any(way > 0 .and. .not. keep)) exit
      keep = keep .or. way > resisting*maxval(way)
      if (all(keep)) return
    end do
    keep = .true.
  end subroutine keep_what_carries

  !> A state on some of the rows.
  subroutine restrict(keep, state)
    logical, intent(in) :: keep(:)
    type(scheme_result_t), intent(inout) :: state
    state%m = pack(state%m, keep)
    state%y = pack(state%y, keep)
  end subroutine restrict

  !> The state on all rows, from that on some of them.
  subroutine complete(problem, keep, result)
    type(contact_problem_t), intent(inout) :: problem
    logical, intent(in) :: keep(:)
    type(scheme_result_t), intent(inout) :: result
    real(dp), allocatable :: z(:), motion(:)
    allocate (z(size(keep)), motion(size(keep)), source=0.0_dp)
    result%m = unpack(result%m, keep, z)
    call problem%compliance(problem%operator%weight*result%m, z)
    call problem%coarse%displacement(problem%operator, result%alpha/problem%coarse%scale, motion)
    result%y = unpack(result%y, keep, problem%y_free - z + motion)
  end subroutine complete

  !> Solve on all rows of a problem.
  subroutine solve_rows(problem, settings, log, compliance, system, result, error, start)
    type(contact_problem_t), intent(inout) :: problem
    type(dual_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(explicit_compliance_t), intent(inout) :: compliance
    class(active_system_t), intent(inout) :: system
    type(scheme_result_t), intent(out) :: result
    type(error_t), allocatable, intent(out) :: error
    !> As in `solve_dual`.
    type(scheme_result_t), intent(in), optional :: start
    type(iterate_t) :: now
    logical, allocatable :: active(:)
    call leave_out(result)
    ! A state that there is already is not given up for an interrupt.
    call compliance%form(problem, may_stop=.not. present(start))
    if (.not. (present(start) .or. compliance%by_sweeps)) call stop_if_interrupted(error)
    if (allocated(error)) return
    if (present(start)) then
      now%lambda = problem%operator%weight*start%m
      now%y = start%y
      now%alpha = start%alpha/problem%coarse%scale
      active = start%m > 0
    else
      allocate (active(problem%operator%n_rows), source=.false.)
      if (has_many_motions(problem)) then
        call begin_without_contact(problem, now)
      else
        call find_start(problem, compliance, now, active, error)
      end if
      if (allocated(error)) return
    end if
    if (problem%operator%n_rows == 0) then
      call system%init(problem, compliance, problem%operator%theta, active, error)
      if (.not. allocated(error)) &
        call system%solve(problem, compliance, 0*now%lambda, problem%coarse%resultant, now%lambda, now%alpha)
      result%ended = ended_converged
    else
      call find_active_set(problem, settings%max_iterations, settings%tolerance, log, compliance, system, now, active, result, &
                           error, from_inside=.not. present(start) .and. has_many_motions(problem))
    end if
    if (.not. allocated(error) .and. result%ended /= ended_rigid_constraint) &
      call finish(problem, settings, compliance, system, now, result)
  end subroutine solve_rows

  !> What other schemes have to say and this one has not.
  subroutine leave_out(result)
    type(scheme_result_t), intent(inout) :: result
    real(dp) :: nan
    nan = ieee_value(nan, ieee_quiet_nan)
    result%gamma = nan
    result%lambda_max = nan
    result%q_predicted = nan
    result%q_measured = nan
    result%error_bound_paper = nan
  end subroutine leave_out

  !> The state that is returned: no force pulls, and the bound is that of `admissible_bound` where it is less than the duality gap's.
  subroutine finish(problem, settings, compliance, system, now, result)
    type(contact_problem_t), intent(inout) :: problem
    type(dual_settings_t), intent(in) :: settings
    type(explicit_compliance_t), intent(in) :: compliance
    class(active_system_t), intent(in) :: system
    type(iterate_t), intent(inout) :: now
    type(scheme_result_t), intent(inout) :: result
    real(dp) :: norm, admissible, rounded
    integer :: i
    now%lambda = max(0.0_dp, now%lambda)
    call update_penetrations(problem, compliance, now)
    result%m = now%lambda/problem%operator%weight
    result%y = now%y
    result%alpha = problem%coarse%scale*now%alpha
    if (result%ended == ended_interrupted) then
      allocate (result%undetermined(size(now%alpha), 0))
    else
      result%undetermined = system%null_mode
    end if
    do i = 1, size(result%undetermined, 2)
      result%undetermined(:, i) = problem%coarse%scale*result%undetermined(:, i)
    end do
    norm = reference_norm(problem, now)
    result%error_bound = huge(norm)
    if (is_balanced(problem, now%lambda, now%alpha)) then
      result%error_bound = sqrt(duality_gap(problem%operator%weight, problem%operator%theta, result%m, result%y))
      admissible = huge(norm)
      if (result%ended /= ended_interrupted) admissible = admissible_bound(problem, compliance, system, now)
      ! A bound from half a solution is none.
      if (interrupted()) admissible = huge(norm)
      result%error_bound = min(result%error_bound, admissible)
      call problem%coarse%rounding(problem%operator, now%lambda, rounded)
      result%error_bound = result%error_bound + rounded
      ! Beyond 1e150 a bound is none.
      if (norm > 0) result%error_bound = min(result%error_bound, no_bound*norm)/norm
      if (result%error_bound >= 0.99_dp*no_bound) result%error_bound = huge(norm)
    end if
    ! Loads whose squares overflow leave none either.
    if (.not. result%error_bound <= huge(norm)) result%error_bound = huge(norm)
    result%energy = problem%energy(result%m, result%y, now%alpha)
    result%max_penetration = 0
    if (size(result%y) > 0) result%max_penetration = max(0.0_dp, maxval(result%y))
    if (result%history%n > 0) then
      result%history%error_bound(result%history%n) = result%error_bound
      result%history%energy(result%history%n) = result%energy
      result%history%max_penetration(result%history%n) = result%max_penetration
    end if
    if (result%ended == ended_converged .and. result%error_bound > settings%tolerance) &
      result%ended = merge(ended_interrupted, ended_stalled, interrupted())
    if (any(result%ended == [ended_limit, ended_interrupted]) .and. result%error_bound <= settings%tolerance) &
      result%ended = ended_converged
  end subroutine finish

  !> A bound of ||u - u_theta||_A that needs no theta: the norm of a displacement g, self-equilibrated forces and rigid motions, with
  !> `B g = y - theta m` on the active points and `B g >= y` elsewhere. Then u solves exactly the problem whose gaps are larger by B g, in
  !> which u_theta + g is as admissible as u_theta is here; both variational inequalities, each tried with the other's
  !> solution, add up to `||u - u_theta||_A^2 <= A(u - u_theta, g)`, less `sum theta/w (lambda - lambda_theta)^2`. g comes from forces mu
  !> that solve the active system with its theta, so B g is theta mu/w too large: that adds `theta mu^2/(4 w)`, the square completed. What
  !> B g misses by rounding, r, adds `lambda.r` and its like with the forces of u_theta, which are as large to first order:
  !> x^2 <= |g| x + sum theta mu^2/(4 w) + 2 lambda.r. [sqrt(energy)]
  real(dp) function admissible_bound(problem, compliance, system, now) result(bound)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    class(active_system_t), intent(in) :: system
    type(iterate_t), intent(in) :: now
    real(dp), allocatable :: residual(:), mu(:), beta(:), all_mu(:), z(:), motion(:), missing(:)
    real(dp) :: left_over
    logical, allocatable :: active(:)
    bound = huge(bound)
    associate (row => system%row, weight => problem%operator%weight, theta => problem%operator%theta)
      if (size(now%y) == 0) then
        bound = 0
        return
      end if
      allocate (mu(size(row)), beta(problem%coarse%n), z(size(now%y)), motion(size(now%y)), missing(problem%coarse%n))
      mu = 0
      residual = now%y(row) - theta(row)/weight(row)*now%lambda(row)
      call problem%coarse%resultant_of(problem%operator, now%lambda, missing)
      missing = problem%coarse%resultant - missing
      call system%solve(problem, compliance, -residual, 0*missing, mu, beta)
      allocate (all_mu(size(now%y)), source=0.0_dp)
      all_mu(row) = -mu
      call compliance%multiply(problem, all_mu, z)
      call problem%coarse%displacement(problem%operator, beta, motion)
      allocate (active(size(now%y)), source=.false.)
      active(row) = .true.
      ! B g = z + G beta.
      if (any(.not. active .and. now%y > z + motion .and. now%y > rounding*maxval(abs(problem%y_free)))) return
      left_over = 2*sum(abs(now%lambda(row)*(z(row) + motion(row) - residual - theta(row)/weight(row)*mu))) &
                  + sum(theta(row)/weight(row)*mu**2)/4
      bound = sqrt(max(0.0_dp, sum(all_mu*z) + dot_product(beta, problem%coarse%stiffness_forces(beta))))
      bound = bound + sqrt(left_over)
    end associate
  end function admissible_bound
end module dotyk_scheme_dual
