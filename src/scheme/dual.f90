!> The dual scheme: contact forces lambda = W p >= 0 as unknowns, any theta >= 0, held and free bodies.
!>
!> It minimises `lambda (C + Theta W^{-1}) lambda/2 - lambda.y_free` over `lambda >= 0` with `G^T lambda = e`, the equilibrium of the free
!> bodies, by a primal-dual active set method (semismooth Newton): the points that are taken for closed give a linear system for
!> their forces and the free motions, forces and penetrations say which points were taken wrongly, and so on until none were. Columns of
!> C are formed for the points that ever were closed. Free bodies first come to rest on an elastic foundation, which says where to
!> begin. Should active sets come back, the proximal method of multipliers (`dotyk_scheme_proximal`) takes over, which cannot cycle.
module dotyk_scheme_dual
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: to_text
  use dotyk_base_timer, only: wall_time
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_limit, ended_stalled, ended_unstoppable, ended_immovable
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_progress, only: progress_line
  use dotyk_scheme_proximal, only: proximal_step
  use dotyk_scheme_settle, only: settle, find_unstoppable
  implicit none
  private

  !> What the user may choose.
  type, public :: dual_settings_t
    !> Relative error in the energy norm.
    real(dp) :: tolerance = 1.0e-6_dp
    !> Active sets at most.
    integer :: max_iterations = 100
  end type dual_settings_t

  public :: solve_dual

  !> Forces and penetrations below this part of the largest are rounding errors, not a reason to change the active set.
  real(dp), parameter :: rounding = 1.0e-12_dp
  !> Active sets after which the proximal method takes over: Newton's method needs less than ten, or cycles.
  integer, parameter :: most_newton_steps = 25

  !> An iterate.
  type :: iterate_t
    !> Forces (n_rows) [force], penetrations (n_rows) [length], amplitudes (coarse%n) [length].
    real(dp), allocatable :: lambda(:), y(:), alpha(:)
  end type iterate_t

contains

  !> Solve.
  subroutine solve_dual(problem, settings, log, result, error)
    type(contact_problem_t), intent(inout) :: problem
    type(dual_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(scheme_result_t), intent(out) :: result
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    type(explicit_compliance_t) :: compliance
    type(active_system_t) :: system
    type(iterate_t) :: now
    real(dp), allocatable :: motion(:)
    logical, allocatable :: active(:), immovable(:)
    logical :: found
    integer :: n

    n = problem%operator%n_rows
    allocate (motion(problem%coarse%n), immovable(n))
    immovable = .false.
    call find_unstoppable(problem%operator, problem%coarse, motion, found)
    if (found) then
      result%ended = ended_unstoppable
      result%unstoppable = problem%coarse%scale*motion
      return
    end if
    call compliance%init(problem)
    call start(problem, now, active)
    call iterate(problem, settings, log, compliance, system, now, active, immovable, result, error)
    if (.not. allocated(error) .and. result%ended /= ended_immovable) &
      call finish(problem, settings, compliance, system, now, result)
    call system%destroy()
    call result%history%finish()
    result%iterations = result%history%n
  end subroutine solve_dual

  !> Where to begin: free bodies at rest on elastic foundations, the points that penetrate there closed.
  subroutine start(problem, now, active)
    type(contact_problem_t), intent(in) :: problem
    type(iterate_t), intent(out) :: now
    !> (n_rows).
    logical, allocatable, intent(out) :: active(:)
    real(dp), allocatable :: motion(:)
    allocate (now%lambda(problem%operator%n_rows), now%alpha(problem%coarse%n))
    allocate (motion(problem%operator%n_rows))
    now%lambda = 0
    call settle(problem%operator, problem%coarse, problem%coarse%resultant, foundation_stiffness(problem), problem%y_free, &
                now%alpha)
    call problem%coarse%displacement(problem%operator, now%alpha, motion)
    now%y = problem%y_free + motion
    active = now%y > 0
  end subroutine start

  !> From active set to active set.
  subroutine iterate(problem, settings, log, compliance, system, now, active, immovable, result, error)
    type(contact_problem_t), intent(inout) :: problem
    type(dual_settings_t), intent(in) :: settings
    type(log_t), intent(inout) :: log
    type(explicit_compliance_t), intent(inout) :: compliance
    !> The last one that was solved.
    type(active_system_t), intent(inout) :: system
    type(iterate_t), intent(inout) :: now
    logical, intent(inout) :: active(:)
    !> Points that no force moves (n_rows).
    logical, intent(inout) :: immovable(:)
    type(scheme_result_t), intent(inout) :: result
    type(error_t), allocatable, intent(out) :: error
    type(iterate_t) :: last
    logical, allocatable :: next(:)
    real(dp), allocatable :: change(:), missing(:)
    real(dp) :: begin, length, norm, largest_force, largest_gap
    integer :: k, systems, steps

    begin = wall_time()
    allocate (change(size(active)), missing(problem%coarse%n))
    result%ended = ended_limit
    systems = 0
    do k = 1, settings%max_iterations
      if (k == most_newton_steps) call log%line('  active sets come back; the proximal method of multipliers goes on')
      if (k >= most_newton_steps) then
        call soften(problem, compliance, now, steps, error)
        if (allocated(error)) return
        systems = systems + steps
        active = now%lambda > 0 .and. .not. immovable
      end if
      call compliance%form(problem, active)
      call drop_immovable(problem, compliance, active, immovable)
      if (any(immovable .and. problem%y_free > 0 .and. .not. problem%operator%theta > 0)) then
        result%ended = ended_immovable
        return
      end if
      call system%init(problem, compliance, problem%operator%theta, active, error)
      if (allocated(error)) return
      last = now
      call solve_active(problem, compliance, system, now)
      call compliance%multiply(problem, now%lambda - last%lambda, change)
      length = sqrt(max(0.0_dp, sum((now%lambda - last%lambda)*change)))
      norm = problem%norm(now%lambda/problem%operator%weight, now%y, now%alpha)
      call note(problem, now, wall_time() - begin, length, norm, active, result)
      if (log%due()) call log%progress(progress_line(result%history, settings%tolerance, result%error_bound))

      largest_force = maxval(abs(now%lambda))
      largest_gap = max(maxval(abs(now%y)), maxval(abs(problem%y_free)))
      next = merge(now%lambda > -rounding*largest_force, now%y > rounding*largest_gap, active)
      next = next .and. .not. immovable
      call add_support(problem, now, missing, next)
      if (all(next .eqv. active)) then
        result%ended = ended_converged
        exit
      end if
      active = next
    end do
    call log%end_progress()
    if (systems > 0) call log%line('  the proximal method solved '//to_text(systems)//' systems')
  end subroutine iterate

  !> Where the active points cannot carry a free body, let it come to rest on the points that it falls on.
  subroutine add_support(problem, now, missing, active)
    type(contact_problem_t), intent(in) :: problem
    type(iterate_t), intent(in) :: now
    !> Room for what the forces leave unbalanced (coarse%n) [force].
    real(dp), intent(inout) :: missing(:)
    logical, intent(inout) :: active(:)
    real(dp), allocatable :: alpha(:), motion(:)
    call problem%coarse%resultant_of(problem%operator, now%lambda, missing)
    missing = problem%coarse%resultant - missing
    if (.not. any(abs(missing) > 1.0e-7_dp*max(maxval(abs(problem%coarse%resultant)), maxval(abs(now%lambda))))) return
    allocate (alpha(problem%coarse%n), motion(size(active)))
    call settle(problem%operator, problem%coarse, missing, foundation_stiffness(problem), now%y, alpha)
    call problem%coarse%displacement(problem%operator, alpha, motion)
    active = active .or. now%y + motion > 0
  end subroutine add_support

  !> Stiffness of the elastic foundation that stands for the bodies (n_rows) [force/length].
  pure function foundation_stiffness(problem) result(stiffness)
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable :: stiffness(:)
    stiffness = problem%operator%weight/(problem%foundation + problem%operator%theta)
  end function foundation_stiffness

  !> One step of the proximal method, from the last iterate without the forces that pull.
  subroutine soften(problem, compliance, now, steps, error)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(inout) :: compliance
    type(iterate_t), intent(inout) :: now
    !> Linear systems that it took.
    integer, intent(out) :: steps
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: hold(:), z(:), motion(:), one(:)
    integer :: j
    ! A soft spring on every motion, relative to what all contact points together would resist it with.
    real(dp), parameter :: soft = 1.0e-3_dp
    allocate (hold(problem%coarse%n), one(problem%coarse%n), z(size(now%y)), motion(size(now%y)))
    do j = 1, problem%coarse%n
      one = 0
      one(j) = 1
      call problem%coarse%displacement(problem%operator, one, motion)
      hold(j) = soft*sum(foundation_stiffness(problem)*motion**2)
    end do
    where (.not. hold > 0) hold = max(tiny(1.0_dp), soft*maxval(hold))
    now%lambda = max(0.0_dp, now%lambda)
    call compliance%multiply(problem, now%lambda, z)
    call problem%coarse%displacement(problem%operator, now%alpha, motion)
    now%y = problem%y_free - z + motion
    call proximal_step(problem, compliance, problem%foundation + problem%operator%theta, hold, now%lambda, now%alpha, now%y, &
                       steps, error)
  end subroutine soften

  !> Solve the system of the active set for the new iterate.
  subroutine solve_active(problem, compliance, system, now)
    type(contact_problem_t), intent(in) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    type(active_system_t), intent(in) :: system
    type(iterate_t), intent(inout) :: now
    real(dp), allocatable :: lambda(:), z(:), motion(:)
    allocate (lambda(size(system%row)), z(size(now%lambda)), motion(size(now%lambda)))
    call system%solve(problem, compliance, problem%y_free(system%row), problem%coarse%resultant, lambda, now%alpha)
    now%lambda = 0
    now%lambda(system%row) = lambda
    call compliance%multiply(problem, now%lambda, z)
    call problem%coarse%displacement(problem%operator, now%alpha, motion)
    now%y = problem%y_free - z + motion
  end subroutine solve_active

  !> Take points out that no force moves: all that they touch is held by supports.
  subroutine drop_immovable(problem, compliance, active, immovable)
    type(contact_problem_t), intent(in) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    logical, intent(inout) :: active(:), immovable(:)
    real(dp), allocatable :: diagonal(:), g(:, :)
    real(dp) :: largest
    integer :: i
    allocate (diagonal(size(active)), source=0.0_dp)
    allocate (g(1, problem%coarse%n))
    do i = 1, size(active)
      if (active(i)) diagonal(i) = compliance%diagonal(problem, i)
    end do
    largest = maxval(diagonal)
    do i = 1, size(active)
      if (.not. active(i) .or. diagonal(i) > 1.0e-13_dp*largest .or. problem%operator%theta(i) > 0) cycle
      call problem%coarse%rows([i], g)
      if (any(abs(g) > 1.0e-10_dp)) cycle
      active(i) = .false.
      immovable(i) = .true.
    end do
  end subroutine drop_immovable

  !> An entry of the history, and what the result says of the iterate. Forces that pull are left out of the state that the bound is of,
  !> and without them free bodies are not in equilibrium: there is no bound then.
  subroutine note(problem, now, seconds, length, norm, active, result)
    type(contact_problem_t), intent(in) :: problem
    type(iterate_t), intent(in) :: now
    real(dp), intent(in) :: seconds, length, norm
    logical, intent(in) :: active(:)
    type(scheme_result_t), intent(inout) :: result
    result%m = now%lambda/problem%operator%weight
    result%y = now%y
    result%error_bound = huge(1.0_dp)
    if (all(now%lambda >= 0)) result%error_bound = sqrt(duality_gap(problem%operator%weight, problem%operator%theta, &
                                                                    result%m, result%y))
    if (norm > 0) result%error_bound = result%error_bound/norm
    result%energy = problem%energy(result%m, result%y, now%alpha)
    result%max_penetration = 0
    if (size(result%y) > 0) result%max_penetration = max(0.0_dp, maxval(result%y))
    call result%history%add(seconds, length, length/max(norm, tiny(norm)), result%error_bound, result%energy, &
                            result%max_penetration, count(active))
  end subroutine note

  !> The state that is returned: no force pulls, and the bound is that of `admissible_bound` where it is less than the duality gap's.
  subroutine finish(problem, settings, compliance, system, now, result)
    type(contact_problem_t), intent(in) :: problem
    type(dual_settings_t), intent(in) :: settings
    type(explicit_compliance_t), intent(in) :: compliance
    type(active_system_t), intent(in) :: system
    type(iterate_t), intent(inout) :: now
    type(scheme_result_t), intent(inout) :: result
    real(dp), allocatable :: z(:), motion(:)
    real(dp) :: norm
    integer :: i
    allocate (z(size(now%lambda)), motion(size(now%lambda)))
    now%lambda = max(0.0_dp, now%lambda)
    call compliance%multiply(problem, now%lambda, z)
    call problem%coarse%displacement(problem%operator, now%alpha, motion)
    now%y = problem%y_free - z + motion
    result%m = now%lambda/problem%operator%weight
    result%y = now%y
    result%alpha = problem%coarse%scale*now%alpha
    result%undetermined = system%null_motion
    do i = 1, size(result%undetermined, 2)
      result%undetermined(:, i) = problem%coarse%scale*result%undetermined(:, i)
    end do
    norm = problem%norm(result%m, result%y, now%alpha)
    result%error_bound = min(sqrt(duality_gap(problem%operator%weight, problem%operator%theta, result%m, result%y)), &
                             admissible_bound(problem, compliance, system, now))
    if (norm > 0) result%error_bound = result%error_bound/norm
    result%energy = problem%energy(result%m, result%y, now%alpha)
    result%max_penetration = 0
    if (size(result%y) > 0) result%max_penetration = max(0.0_dp, maxval(result%y))
    if (result%history%n > 0) result%history%error_bound(result%history%n) = result%error_bound
    if (result%ended == ended_converged .and. result%error_bound > settings%tolerance) result%ended = ended_stalled
    if (result%ended == ended_limit .and. result%error_bound <= settings%tolerance) result%ended = ended_converged
  end subroutine finish

  !> A bound of ||u - u_theta||_A that needs no theta: the norm of a displacement g, self-equilibrated forces and rigid motions, with
  !> `B g = y - theta m` on the active points and `B g >= y` elsewhere. Then u solves exactly the problem whose gaps are larger by B g, in
  !> which u_theta + g is as admissible as u_theta is here; both variational inequalities, each tried with the other's
  !> solution, add up to `||u - u_theta||_A^2 <= A(u - u_theta, g)`. What B g misses by rounding, r, adds `lambda.r` and its like with the
  !> forces of u_theta, which are as large to first order: x^2 <= |g| x + 2 lambda.r. [sqrt(energy)]
  real(dp) function admissible_bound(problem, compliance, system, now) result(bound)
    type(contact_problem_t), intent(in) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    type(active_system_t), intent(in) :: system
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
      left_over = sum(abs(now%lambda(row)*(z(row) + motion(row) - residual)))
      bound = sqrt(max(0.0_dp, sum(all_mu*z))) + sqrt(2*left_over)
    end associate
  end function admissible_bound
end module dotyk_scheme_dual
