!> From the input's choice of a scheme to its solution.
module dotyk_driver_scheme
  use dotyk_base_error, only: error_t, add_context, set_error, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_base_log, only: log_t
  use dotyk_base_options, only: option_name, scheme_anderson, scheme_auto, scheme_dual, scheme_names, scheme_nesterov, &
    scheme_neumann, scheme_robin, scheme_secant, stop_budget, stop_residual
  use dotyk_base_text, only: quoted, to_text
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_driver_pairs, only: foundation_compliance
  use dotyk_elasticity_body, only: body_t
  use dotyk_input_case, only: case_t
  use dotyk_scheme_accelerated, only: solve_anderson, solve_secant
  use dotyk_scheme_dual, only: dual_settings_t, solve_dual
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_history, only: scheme_result_t, ended_no_equilibrium, ended_rigid_constraint
  use dotyk_scheme_neumann, only: solve_neumann
  use dotyk_scheme_nesterov, only: solve_nesterov
  use dotyk_scheme_robin, only: solve_robin
  use dotyk_scheme_stopping, only: iteration_settings_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private
  public :: scheme_of, scheme_name, needs_held_bodies, prepare_coarse_space, solve_scheme

contains

  !> The scheme that solves a case: `auto` is the best one.
  pure integer function scheme_of(case) result(scheme)
    type(case_t), intent(in) :: case
    scheme = case%solver%scheme
    if (scheme == scheme_auto) scheme = scheme_dual
  end function scheme_of

  !> Its name.
  pure function scheme_name(case) result(name)
    type(case_t), intent(in) :: case
    character(:), allocatable :: name
    name = option_name(scheme_names, scheme_of(case))
  end function scheme_name

  !> Whether it is for bodies that their supports hold.
  pure logical function needs_held_bodies(case) result(needed)
    type(case_t), intent(in) :: case
    needed = scheme_of(case) /= scheme_dual
  end function needs_held_bodies

  !> The rigid motions that supports leave to the bodies, for the scheme.
  subroutine prepare_coarse_space(body, problem)
    !> Assembled (n_bodies).
    type(body_t), intent(in) :: body(:)
    !> With operator and responses.
    type(contact_problem_t), intent(inout) :: problem
    real(dp), allocatable :: resultant(:), lift(:)
    integer :: b
    allocate (resultant(0), lift(0))
    do b = 1, size(body)
      resultant = [resultant, body(b)%resultant]
      if (body(b)%has_near_null_modes) then
        lift = [lift, body(b)%lift_resultant]
      else
        lift = [lift, 0*body(b)%resultant]
      end if
    end do
    call problem%coarse%init(problem%operator, problem%response, resultant, lift)
    do b = 1, size(body)
      associate (first => problem%coarse%first(b), last => problem%coarse%first(b + 1) - 1)
        if (body(b)%has_near_null_modes) &
          problem%coarse%resultant_size(first:last) = problem%coarse%scale(first:last)*body(b)%resultant_size
      end associate
    end do
  end subroutine prepare_coarse_space

  !> Solve.
  subroutine solve_scheme(case, body, pair, problem, tolerance, log, compliance, result, error, start, &
                          time_limit)
    type(case_t), intent(in) :: case
    !> (n_bodies), (n_pairs).
    type(body_t), intent(in) :: body(:)
    type(contact_pair_t), intent(in) :: pair(:)
    type(contact_problem_t), intent(inout) :: problem
    !> Where to stop [].
    real(dp), intent(in) :: tolerance
    type(log_t), intent(inout) :: log
    !> Columns that the dual scheme forms.
    type(explicit_compliance_t), intent(inout) :: compliance
    type(scheme_result_t), intent(out) :: result
    type(error_t), allocatable, intent(out) :: error
    !> State to go on from; L is taken from it too, if it has one.
    type(scheme_result_t), intent(in), optional :: start
    !> Wall time after which an iterative scheme ends with `ended_time`; none if absent [s].
    real(dp), intent(in), optional :: time_limit
    type(iteration_settings_t) :: iteration
    type(dual_settings_t) :: dual
    iteration%gamma_rule = case%solver%gamma_rule
    iteration%gamma = case%solver%gamma
    iteration%stop_rule = case%solver%stop_rule
    if (iteration%stop_rule == stop_budget) iteration%stop_rule = stop_residual
    iteration%tolerance = tolerance
    iteration%max_iterations = case%solver%max_iterations
    if (present(time_limit)) iteration%time_limit = time_limit
    if (present(start)) then
      iteration%start = start%m
      ! max_iterations is for all steps together.
      iteration%max_iterations = max(1, iteration%max_iterations - start%history%n)
      if (scheme_of(case) /= scheme_dual) iteration%lambda_max = start%lambda_max
    end if
    ! For the dual scheme, and what estimates errors with it.
    call foundation_compliance(body, pair, problem%foundation)
    select case (scheme_of(case))
    case (scheme_neumann)
      call solve_neumann(problem, iteration, log, result, error)
    case (scheme_nesterov)
      call solve_nesterov(problem, iteration, log, result)
    case (scheme_anderson)
      call solve_anderson(problem, iteration, log, result)
    case (scheme_secant)
      call solve_secant(problem, iteration, log, result)
    case (scheme_robin)
      call solve_robin(problem, iteration, log, result, error)
    case default
      dual%linear_solver = case%solver%linear_solver
      dual%tolerance = tolerance
      dual%max_iterations = min(case%solver%max_iterations, dual%max_iterations)
      call solve_dual(problem, dual, log, compliance, result, error, start)
    end select
    call add_context(error, case%file//':'//to_text(case%solver%line)//': ')
    if (allocated(error)) return
    if (result%ended == ended_no_equilibrium) call refuse_motion(case, body, problem, result%unbounded_direction, error)
    if (result%ended == ended_rigid_constraint) call refuse_rigid_constraint(case, problem, error)
    if (allocated(error)) return
    if (allocated(result%undetermined)) call note_undetermined(body, result%undetermined, log)
    if (allocated(result%alpha)) call note_rotations(body, result%alpha, log)
  end subroutine solve_scheme

  !> A motion that the loads excite and no contact can stop: of one body or more.
  subroutine refuse_motion(case, body, problem, amplitude, error)
    type(case_t), intent(in) :: case
    type(body_t), intent(in) :: body(:)
    type(contact_problem_t), intent(in) :: problem
    !> The motion, of all bodies.
    real(dp), intent(in) :: amplitude(:)
    type(error_t), allocatable, intent(out) :: error
    character(:), allocatable :: others
    real(dp) :: work(size(body)), free_work(size(body))
    logical :: moved(size(body))
    integer :: b, worst, n_named
    integer, parameter :: most_named = 3
    ! A body moves if its loads do at least this part of the work of the body moved most, or of their own where nothing is in the way.
    real(dp), parameter :: much = 1.0e-3_dp, something = 1.0e-6_dp
    work = 0
    free_work = 0
    do b = 1, size(body)
      if (body(b)%has_near_null_modes) cycle
      associate (first => problem%coarse%first(b), last => problem%coarse%first(b + 1) - 1)
        work(b) = dot_product(amplitude(first:last), body(b)%resultant)
        free_work(b) = sum(problem%coarse%resultant(first:last)**2)/maxval(abs(problem%coarse%resultant))
      end associate
    end do
    ! The first of several that are moved as much.
    worst = findloc(work > (1 - something)*maxval(work), .true., 1)
    moved = work > 0 .and. (work > much*work(worst) .or. work > something*free_work)
    others = ''
    n_named = 0
    do b = 1, size(body)
      if (.not. moved(b) .or. b == worst) cycle
      n_named = n_named + 1
      if (n_named <= most_named) others = others//'; nor body '//quoted(body(b)%name)//' (line '// &
        to_text(case%body(b)%line)//'): '//motion_of(b)
    end do
    if (n_named > most_named) others = others//'; nor '//to_text(n_named - most_named)//' more'
    call set_error(error, case%file//':'//to_text(case%body(worst)%line)//': body '//quoted(body(worst)%name)// &
      ': its loads move it and no contact can stop it: '//motion_of(worst)//others// &
      '; add a &support, a &contact in the way, or another &load', exit_not_solvable)
  contains
    !> How a body moves, and the force or moment that moves it.
    function motion_of(which) result(text)
      integer, intent(in) :: which
      character(:), allocatable :: text
      associate (own => amplitude(problem%coarse%first(which):problem%coarse%first(which + 1) - 1))
        text = body(which)%mode_text(own)//', resultant '// &
          to_text(dot_product(own, body(which)%resultant)/largest_displacement(body(which), own), 4)
      end associate
    end function motion_of
  end subroutine refuse_motion

  !> Largest displacement of a node in a motion.
  real(dp) function largest_displacement(body, amplitude) result(largest)
    type(body_t), intent(in) :: body
    !> Amplitudes of the free motions.
    real(dp), intent(in) :: amplitude(:)
    real(dp) :: u(body%dimension)
    integer :: i, k
    largest = tiny(largest)
    do i = 1, size(body%rigid_mode, 2)
      u = 0
      do k = 1, size(amplitude)
        u = u + amplitude(k)*body%rigid_mode(:, i, k)
      end do
      largest = max(largest, norm2(u))
    end do
  end function largest_displacement

  !> Supports press contact points together that cannot give way.
  subroutine refuse_rigid_constraint(case, problem, error)
    type(case_t), intent(in) :: case
    type(contact_problem_t), intent(in) :: problem
    type(error_t), allocatable, intent(out) :: error
    integer :: k, n
    n = maxloc(problem%y_free, 1)
    k = count(problem%operator%pair_first_row <= n)
    call set_error(error, case%file//':'//to_text(case%contact(k)%line)//': &contact '//quoted(case%contact(k)%name)// &
      ': supports on both sides press its points together by '//to_text(problem%y_free(n))//', and theta = 0 allows no '// &
      'penetration; take the supports off the contact surfaces or give theta a value above 0', exit_not_solvable)
  end subroutine refuse_rigid_constraint

  !> Say which bodies turn so far that small displacements are no good approximation.
  subroutine note_rotations(body, amplitude, log)
    type(body_t), intent(in) :: body(:)
    !> Of the free motions of all bodies.
    real(dp), intent(in) :: amplitude(:)
    type(log_t), intent(inout) :: log
    integer :: b, n, n_far, first
    real(dp) :: part, most
    ! Displacements by rotation, relative to the body's size.
    real(dp), parameter :: far = 0.05_dp
    n = 0
    n_far = 0
    first = 0
    most = 0
    do b = 1, size(body)
      associate (own => amplitude(n + 1:n + body(b)%modes%n))
        n = n + size(own)
        if (size(own) == 0) cycle
        part = rotation_part(body(b), own)
        if (.not. part > far) cycle
        n_far = n_far + 1
        if (part > most) first = b
        most = max(most, part)
      end associate
    end do
    if (n_far == 0) return
    call log%line('  turns far        '//quoted(body(first)%name)//': points move by '//to_text(100*most, 2)// &
                  ' % of its size as it turns; small displacements are assumed')
    if (n_far > 1) call log%line('  turns far        '//to_text(n_far - 1)//' more bodies, by less')
  end subroutine note_rotations

  !> How far nodes move against their mean, relative to the size of the body.
  real(dp) function rotation_part(body, amplitude) result(part)
    type(body_t), intent(in) :: body
    !> Amplitudes of the free motions.
    real(dp), intent(in) :: amplitude(:)
    real(dp) :: u(body%dimension, size(body%rigid_mode, 2)), mean(body%dimension), length
    integer :: i, k
    u = 0
    do k = 1, size(amplitude)
      u = u + amplitude(k)*body%rigid_mode(:, :, k)
    end do
    mean = sum(u, 2)/size(u, 2)
    length = norm2(maxval(body%mesh%x, 2) - minval(body%mesh%x, 2))
    part = 0
    do i = 1, size(u, 2)
      part = max(part, norm2(u(:, i) - mean)/length)
    end do
  end function rotation_part

  !> Say which motions neither loads nor contact determine.
  subroutine note_undetermined(body, motion, log)
    type(body_t), intent(in) :: body(:)
    !> As columns of amplitudes of all bodies.
    real(dp), intent(in) :: motion(:, :)
    type(log_t), intent(inout) :: log
    character(:), allocatable :: text
    integer :: b, n, n_named
    integer, parameter :: most_named = 20
    n = 0
    n_named = 0
    do b = 1, size(body)
      associate (own => motion(n + 1:n + body(b)%modes%n, :))
        text = ''
        if (size(own) > 0 .and. .not. body(b)%has_near_null_modes) text = body(b)%modes%span_text(own)
        if (len(text) > 0) n_named = n_named + 1
        if (len(text) > 0 .and. n_named <= most_named) &
          call log%line('  not determined   '//quoted(body(b)%name)//': '//text//'; the least motion is taken')
      end associate
      n = n + body(b)%modes%n
    end do
    if (n_named > most_named) call log%line('  not determined   motions of '//to_text(n_named - most_named)//' more bodies')
  end subroutine note_undetermined
end module dotyk_driver_scheme
