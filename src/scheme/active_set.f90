!> From active set to active set: the semismooth Newton method of the dual scheme, and what keeps it going.
!>
!> Points that are taken for closed give a linear system for their forces and the free motions; forces that pull and points that
!> penetrate say which were taken wrongly. Where the closed points cannot carry a free body, it comes to rest on the points that it
!> falls on. Should active sets come back, the interior point method (`dotyk_scheme_interior`) finds one next to the solution. Should they
!> come back even from there, by points whose gaps and forces are next to nothing, that one is the answer, and its bound says how good it is.
module dotyk_scheme_active_set
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_text, only: to_text
  use dotyk_base_timer, only: wall_time
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_converged, ended_interrupted, ended_limit, &
    ended_rigid_constraint
  use dotyk_scheme_interior, only: interior_points
  use dotyk_scheme_problem, only: contact_problem_t
  use dotyk_scheme_progress, only: progress_line
  use dotyk_scheme_winkler_start, only: winkler_equilibrium
  implicit none
  private

  !> An iterate of the dual scheme.
  type, public :: iterate_t
    !> Forces (n_rows) [force], penetrations (n_rows) [length], amplitudes (coarse%n) [length].
    real(dp), allocatable :: lambda(:), y(:), alpha(:)
  end type iterate_t

  public :: find_active_set, rest_on_winkler_foundation, update_penetrations, reference_norm, is_balanced

  !> Forces and penetrations below this part of the largest are rounding errors, not a reason to change the active set.
  real(dp), parameter, public :: rounding = 1.0e-12_dp
  !> Forces balance the loads where resultants differ by less than this fraction of the largest load or force: rounding of
  !> sums over thousands of points, magnified by the condition of the compliances.
  real(dp), parameter :: balanced = 1.0e-8_dp
  !> Without loads, imbalance is compared with this fraction of the forces that the initial penetrations would cause in the
  !> foundations.
  real(dp), parameter :: fraction_of_initial_forces = 1.0e-4_dp
  !> A contact row is rigid where its compliance is below this fraction of the largest, and rigid body modes move it by less
  !> than `no_motion` (of 1, the scale of modes): both are rounding errors.
  real(dp), parameter :: no_compliance = 1.0e-13_dp, no_motion = 1.0e-10_dp
  !> The norm that errors are relative to is at least this fraction of what the initial penetrations would store in the
  !> foundations: rounding errors of bodies at rest are not compared with each other.
  real(dp), parameter :: least_norm = 1.0e-8_dp
  !> Active sets after which the interior point method finds a better one to go on from: Newton's method needs less than ten, or cycles.
  integer, parameter :: most_first_steps = 9
  !> Active sets after that at most.
  integer, parameter :: most_last_steps = 16

contains

  !> Iterate until the active set does not change.
  subroutine find_active_set(problem, max_iterations, tolerance, log, compliance, system, now, active, result, error, &
                             from_inside)
    type(contact_problem_t), intent(inout) :: problem
    !> Active sets at most.
    integer, intent(in) :: max_iterations
    !> For the live line only.
    real(dp), intent(in) :: tolerance
    type(log_t), intent(inout) :: log
    !> Of all rows, or by sweeps.
    type(explicit_compliance_t), intent(in) :: compliance
    !> That of the last active set.
    class(active_system_t), intent(inout) :: system
    type(iterate_t), intent(inout) :: now
    !> Where to begin, and where it ended (n_rows).
    logical, intent(inout) :: active(:)
    !> With history, and how it ended.
    type(scheme_result_t), intent(inout) :: result
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    !> True: the interior point method begins, without any active set; false if absent.
    logical, intent(in), optional :: from_inside
    logical :: next(size(active)), is_rigid(size(active)), comes_back, tried
    integer :: changes(max_iterations)
    type(iterate_t) :: last, inside
    logical, allocatable :: inside_active(:)
    real(dp), allocatable :: change(:), yields(:)
    real(dp) :: begin, length, largest_force, largest_gap
    integer :: k, last_k, steps

    begin = wall_time()
    allocate (change(size(active)))
    is_rigid = .false.
    result%ended = ended_limit
    tried = .false.
    last_k = max_iterations
    do k = 1, max_iterations
      if (interrupted() .or. k > last_k) exit
      comes_back = .not. tried .and. (k == most_first_steps .or. go_up_and_down(changes(:k - 1)))
      if (present(from_inside) .and. k == 1) comes_back = from_inside
      if (comes_back) then
        call log%end_progress()
        tried = .true.
        last_k = min(max_iterations, k + most_last_steps)
        call approach(problem, compliance, system, is_rigid, now, active, steps, error)
        if (allocated(error)) return
        call log%line('  '//trim(merge('active sets come back; the', 'the                       ', k > 1))// &
                      ' interior point method solved '//to_text(steps)//' systems')
      end if
      call drop_rigid_constraints(problem, compliance, yields, active, is_rigid)
      if (any(is_rigid .and. problem%y_free > 0 .and. .not. problem%operator%theta > 0)) then
        result%ended = ended_rigid_constraint
        return
      end if
      call system%init(problem, compliance, problem%operator%theta, active, error)
      if (allocated(error)) return
      last = now
      call solve_active(problem, compliance, system, now)
      if (comes_back) then
        inside = now
        inside_active = active
      end if
      ! Half a solution says nothing about active sets.
      if (interrupted()) exit
      call compliance%multiply(problem, now%lambda - last%lambda, change)
      length = sqrt(max(0.0_dp, sum((now%lambda - last%lambda)*change)))
      call note(problem, now, wall_time() - begin, length, count(active), result)
      if (log%due()) call log%progress(progress_line(result%history, tolerance, result%error_bound))

      ! Points may be closed without any force, such as those that push a free body away.
      largest_force = max(maxval(abs(now%lambda)), maxval(foundation_stiffness(problem)*max(0.0_dp, problem%y_free)))
      largest_gap = max(maxval(abs(now%y)), maxval(abs(problem%y_free)))
      next = merge(now%lambda >= -rounding*largest_force, now%y > rounding*largest_gap, active)
      next = next .and. .not. is_rigid
      call add_support(problem, now, next)
      changes(k) = count(next .neqv. active)
      if (all(next .eqv. active)) then
        result%ended = ended_converged
        exit
      end if
      active = next
    end do
    if (interrupted() .and. result%ended == ended_limit) result%ended = ended_interrupted
    call log%end_progress()
    if (result%ended == ended_limit .and. allocated(inside%lambda)) then
      now = inside
      active = inside_active
      call system%init(problem, compliance, problem%operator%theta, active, error)
    end if
  end subroutine find_active_set

  !> Whether the numbers of points that change from one active set to the next do not get fewer.
  pure logical function go_up_and_down(changes)
    integer, intent(in) :: changes(:)
    integer, parameter :: back = 2, first = 4
    go_up_and_down = .false.
    if (size(changes) >= first) go_up_and_down = 2*changes(size(changes)) > changes(size(changes) - back)
  end function go_up_and_down

  !> Free bodies at rest on elastic foundations that stand for all bodies, and the points that penetrate there.
  subroutine rest_on_winkler_foundation(problem, now, active)
    type(contact_problem_t), intent(in) :: problem
    !> Without forces.
    type(iterate_t), intent(out) :: now
    !> (n_rows).
    logical, intent(out) :: active(:)
    real(dp), allocatable :: motion(:)
    allocate (now%lambda(problem%operator%n_rows), now%alpha(problem%coarse%n), motion(problem%operator%n_rows))
    now%lambda = 0
    call winkler_equilibrium(problem%operator, problem%coarse, problem%coarse%resultant, foundation_stiffness(problem), &
                             problem%y_free, now%alpha)
    call problem%coarse%displacement(problem%operator, now%alpha, motion)
    now%y = problem%y_free + motion
    active = now%y > 0
  end subroutine rest_on_winkler_foundation

  !> Where the active points cannot carry a free body, let it come to rest on the points that it falls on.
  subroutine add_support(problem, now, active)
    type(contact_problem_t), intent(in) :: problem
    type(iterate_t), intent(in) :: now
    logical, intent(inout) :: active(:)
    real(dp), allocatable :: missing(:), alpha(:), motion(:)
    if (is_balanced(problem, now%lambda, now%alpha)) return
    allocate (missing(problem%coarse%n))
    call problem%coarse%resultant_of(problem%operator, now%lambda, missing)
    missing = problem%coarse%resultant - missing - problem%coarse%stiffness_forces(now%alpha)
    allocate (alpha(problem%coarse%n), motion(size(active)))
    call winkler_equilibrium(problem%operator, problem%coarse, missing, foundation_stiffness(problem), now%y, alpha)
    call problem%coarse%displacement(problem%operator, alpha, motion)
    active = active .or. now%y + motion > 0
  end subroutine add_support

  !> Whether forces balance the loads of the free bodies, up to rounding: there is no bound of the error otherwise.
  logical function is_balanced(problem, lambda, alpha)
    type(contact_problem_t), intent(in) :: problem
    real(dp), intent(in) :: lambda(:), alpha(:)
    real(dp) :: missing(problem%coarse%n), scale
    call problem%coarse%resultant_of(problem%operator, lambda, missing)
    missing = problem%coarse%resultant - missing - problem%coarse%stiffness_forces(alpha)
    ! Where nothing is loaded all forces are rounding errors of those that the free scene's penetrations would cause.
    scale = maxval([0.0_dp, abs(lambda)])
    if (size(lambda) > 0) scale = max(scale, fraction_of_initial_forces* &
                                         maxval(foundation_stiffness(problem)*max(0.0_dp, problem%y_free)))
    if (problem%coarse%n > 0) scale = max(scale, maxval(abs(problem%coarse%resultant)))
    is_balanced = .not. any(abs(missing) > balanced*scale)
  end function is_balanced

  !> Stiffness of the elastic foundation that stands for the bodies (n_rows) [force/length].
  pure function foundation_stiffness(problem) result(stiffness)
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable :: stiffness(:)
    stiffness = problem%operator%weight/(problem%foundation + problem%operator%theta)
  end function foundation_stiffness

  !> The interior point method's answer, near the solution wherever it is.
  subroutine approach(problem, compliance, system, is_rigid, now, active, steps, error)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> Another one on return.
    class(active_system_t), intent(inout) :: system
    !> Points without force (n_rows).
    logical, intent(in) :: is_rigid(:)
    type(iterate_t), intent(inout) :: now
    !> (n_rows).
    logical, intent(out) :: active(:)
    !> Linear systems that it took.
    integer, intent(out) :: steps
    type(error_t), allocatable, intent(out) :: error
    call interior_points(problem, compliance, system, 1/foundation_stiffness(problem), .not. is_rigid, now%lambda, &
                         now%alpha, active, steps, error)
    if (.not. allocated(error)) call update_penetrations(problem, compliance, now)
  end subroutine approach

  !> Solve the system of the active set for the new iterate.
  subroutine solve_active(problem, compliance, system, now)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    class(active_system_t), intent(in) :: system
    type(iterate_t), intent(inout) :: now
    real(dp), allocatable :: lambda(:)
    allocate (lambda(size(system%row)))
    lambda = now%lambda(system%row)
    call system%solve(problem, compliance, problem%y_free(system%row), problem%coarse%resultant, lambda, now%alpha)
    now%lambda = 0
    now%lambda(system%row) = lambda
    call update_penetrations(problem, compliance, now)
  end subroutine solve_active

  !> y = y_free - C lambda + G alpha.
  subroutine update_penetrations(problem, compliance, now)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    type(iterate_t), intent(inout) :: now
    real(dp), allocatable :: z(:), motion(:)
    allocate (z(size(now%lambda)), motion(size(now%lambda)))
    call compliance%multiply(problem, now%lambda, z)
    call problem%coarse%displacement(problem%operator, now%alpha, motion)
    now%y = problem%y_free - z + motion
  end subroutine update_penetrations

  !> Take points out that no force moves: all that they touch is held by supports.
  subroutine drop_rigid_constraints(problem, compliance, yields, active, is_rigid)
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    !> Work space: how much each point yields, where there are no matrices (n_rows).
    real(dp), allocatable, intent(inout) :: yields(:)
    logical, intent(inout) :: active(:)
    !> Grows.
    logical, intent(inout) :: is_rigid(:)
    real(dp), allocatable :: diagonal(:), g(:, :)
    real(dp) :: largest
    integer :: i
    if (.not. any(active .and. .not. problem%operator%theta > 0)) return
    if (compliance%by_sweeps .and. .not. allocated(yields)) call press_all(problem, yields)
    allocate (diagonal(size(active)), source=0.0_dp)
    allocate (g(1, problem%coarse%n))
    do i = 1, size(active)
      if (.not. active(i)) cycle
      if (compliance%by_sweeps) then
        diagonal(i) = yields(i)
      else
        diagonal(i) = compliance%diagonal(problem, i)
      end if
    end do
    largest = maxval(diagonal)
    do i = 1, size(active)
      if (.not. active(i) .or. diagonal(i) > no_compliance*largest .or. problem%operator%theta(i) > 0) cycle
      call problem%coarse%rows([i], g)
      if (any(abs(g) > no_motion)) cycle
      active(i) = .false.
      is_rigid(i) = .true.
    end do
  end subroutine drop_rigid_constraints

  !> How much all points yield to forces without any order, in one sweep: only those that nothing moves stay where they are.
  subroutine press_all(problem, yields)
    type(contact_problem_t), intent(inout) :: problem
    !> (n_rows) [length].
    real(dp), allocatable, intent(out) :: yields(:)
    integer :: i
    allocate (yields(problem%operator%n_rows))
    call problem%compliance([(1 + 0.5_dp*sin(real(i, dp)**2), i=1, problem%operator%n_rows)], yields)
    yields = abs(yields)
  end subroutine press_all

  !> ||u||_A for relative errors; at least a small part of what the penetrations of the free scene would store in the foundations, so
  !> that rounding errors of a scene at rest are not compared with each other [sqrt(energy)].
  real(dp) function reference_norm(problem, now) result(norm)
    type(contact_problem_t), intent(in) :: problem
    type(iterate_t), intent(in) :: now
    norm = problem%norm(now%lambda/problem%operator%weight, now%y, now%alpha)
    norm = max(norm, least_norm*sqrt(sum(foundation_stiffness(problem)*problem%y_free**2)))
  end function reference_norm

  !> An entry of the history. Forces that pull cannot be the state of a bound: there is none then.
  subroutine note(problem, now, seconds, length, n_active, result)
    type(contact_problem_t), intent(in) :: problem
    type(iterate_t), intent(in) :: now
    real(dp), intent(in) :: seconds
    !> Length of the step in the energy norm.
    real(dp), intent(in) :: length
    integer, intent(in) :: n_active
    type(scheme_result_t), intent(inout) :: result
    real(dp) :: norm, gap, m(size(now%lambda))
    norm = reference_norm(problem, now)
    m = now%lambda/problem%operator%weight
    gap = duality_gap(problem%operator%weight, problem%operator%theta, m, now%y)
    result%error_bound = huge(1.0_dp)
    if (gap < huge(1.0_dp) .and. is_balanced(problem, now%lambda, now%alpha)) result%error_bound = sqrt(gap)/max(norm, tiny(norm))
    call result%history%add(seconds, length, length/max(norm, tiny(norm)), result%error_bound, &
                            problem%energy(m, now%y, now%alpha), max(0.0_dp, maxval(now%y)), n_active)
  end subroutine note
end module dotyk_scheme_active_set
