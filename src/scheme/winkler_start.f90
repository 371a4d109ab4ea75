!> Rigid-body equilibrium on a Winkler foundation: the start of the dual scheme, and whether equilibrium exists at all.
!>
!> Both are minima over the amplitudes alpha of the rigid body modes of
!> `mu |alpha|^2/2 + alpha.S alpha/2 - e.alpha + sum_i k_i max(0, y_i + (G alpha)_i)^2/2`,
!> ties without the maximum; convex and piecewise quadratic: Newton's method with an exact line search. No body is
!> solved.
!>
!> The same motions tell whether contact can balance the loads of floating bodies: before the contact is solved, or for
!> many bodies, where this takes as long as a solution, where there is none.
module dotyk_scheme_winkler_start
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use dotyk_base_error, only: error_t, exit_not_solvable
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_scheme_coarse_space, only: coarse_space_t, mode_block_t, multiply_blocks
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_line_search, only: line_minimum
  use dotyk_scheme_mode_stiffness, only: mode_stiffness_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_interrupted, ended_no_equilibrium
  use dotyk_scheme_tied_groups, only: find_groups
  implicit none
  private
  public :: winkler_equilibrium, find_unbounded_direction, check_equilibrium, clear, explain_failure

  integer, parameter :: most_steps = 100  !! Newton steps at most: a start need not be exact.
  integer, parameter :: many_modes = 300  !! So many bodies on each other yield where they rest.
  !> Stiffness mu of the start, as a fraction of the mean of the foundations: far softer than contact, it keeps modes
  !> bounded that no contact restrains yet; and of what is 1 beside penalties of motions into contact: far below
  !> `imbalance`.
  real(dp), parameter :: weak = 1.0e-10_dp
  !> Loads that contact cannot balance by less than this fraction of the largest are rounding errors, of the loads or of
  !> the mesh.
  real(dp), parameter :: imbalance = 1.0e-7_dp

contains

  !> Equilibrium of the floating bodies, rigid, on Winkler foundations at the contact points.
  subroutine winkler_equilibrium(qp, resultant, stiffness, penetration, alpha)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes, with the resultants of the loads.
    real(dp), intent(in) :: resultant(:)  !! Resultants that the contact forces have to balance (qp%coarse%n) [force].
    real(dp), intent(in) :: stiffness(:)  !! Stiffness of the foundation at the contact points (n_rows) [force/length].
    real(dp), intent(in) :: penetration(:)  !! Penetrations at alpha = 0 (n_rows) [length].
    real(dp), intent(out) :: alpha(:)  !! Amplitudes (qp%coarse%n) [length].
    alpha = 0
    if (qp%coarse%n == 0 .or. qp%n_rows == 0) return
    call minimize(qp, resultant, weak*sum(stiffness)/qp%n_rows, stiffness, penetration, alpha, qp%coarse%stiffness)
  end subroutine winkler_equilibrium

  !> Find an unbounded direction: a motion that the loads excite and no contact resists. It is the part of e that no
  !> contact pressures balance, the projection of e on the motions with G alpha <= 0: `min |alpha - e|^2/2`, these
  !> conditions by a penalty.
  subroutine find_unbounded_direction(qp, motion, found)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes, with the resultants of the loads.
    real(dp), intent(out) :: motion(:)  !! Amplitudes of the direction (qp%coarse%n) [].
    logical, intent(out) :: found  !! Whether there is one: no equilibrium exists then.
    type(mode_block_t), allocatable :: springs(:)
    real(dp), allocatable :: e(:), none(:), penalty(:)
    real(dp) :: length
    integer :: b, i
    motion = 0
    found = .false.
    if (qp%coarse%n == 0) return
    length = maxval(abs(qp%coarse%resultant))
    if (.not. length > 0) return
    e = qp%coarse%resultant/length
    allocate (none(qp%n_rows), source=0.0_dp)
    allocate (penalty(qp%n_rows), source=1/weak)
    if (allocated(qp%coarse%stiffness)) then
      ! A stiffness resists a motion too, however small it is.
      allocate (springs(size(qp%coarse%stiffness)))
      do b = 1, size(springs)
        associate (value => qp%coarse%stiffness(b)%value)
          allocate (springs(b)%value(size(value, 1), size(value, 1)), source=0.0_dp)
          do i = 1, size(value, 1)
            if (value(i, i) > 0) springs(b)%value(i, i) = 1/weak
          end do
        end associate
      end do
    end if
    call minimize(qp, e, 1.0_dp, penalty, none, motion, springs)
    found = is_unbounded()
    if (.not. found .or. (qp%coarse%n < many_modes .and. .not. any(qp%is_tied))) return
    ! Many bodies on each other, or tied to each other: the penalty yields to the loads of all of them. The forces that
    ! it took are given now (method of multipliers), and a motion that contact or ties stop is 0.
    call qp%mode_displacement(motion, none)
    none = merge(none, max(0.0_dp, none), qp%is_tied)
    motion = 0
    call minimize(qp, e, 1.0_dp, penalty, none, motion, springs)
    found = is_unbounded()
  contains
    !> Whether the loads of a body, or of bodies that ties join, do work on the direction, by more than weak springs may
    !> carry of their loads and of the forces of press fits.
    logical function is_unbounded()
      real(dp), allocatable, dimension(:) :: on_body, work, moved, largest
      integer, allocatable :: group(:)
      integer :: body, n_groups
      call find_groups(qp, group, n_groups)
      allocate (on_body(n_groups), work(n_groups), moved(n_groups), largest(n_groups), source=0.0_dp)
      do body = 1, size(qp%block)
        associate (one => qp%coarse%first(body), last => qp%coarse%first(body + 1) - 1, row => qp%block(body)%row, &
                   g => group(body))
          if (last < one) cycle
          on_body(g) = max(on_body(g), maxval(abs(e(one:last))))
          if (allocated(qp%foundation)) on_body(g) = max(on_body(g), &
            sum(qp%weight(row)/qp%foundation(row)*max(0.0_dp, -qp%gap(row)), mask=.not. qp%is_tied(row))/length)
          largest(g) = max(largest(g), maxval(abs(motion(one:last))))
          work(g) = work(g) + dot_product(e(one:last), motion(one:last))
          moved(g) = moved(g) + sum(motion(one:last)**2)
        end associate
      end do
      is_unbounded = any(largest > imbalance .and. work > max(imbalance, qp%coarse%max_unbalanced)*on_body*sqrt(moved))
    end function is_unbounded
  end subroutine find_unbounded_direction

  !> The minimum of the function in the header of this module. Where the factorization fails alpha is the last iterate.
  !> `find_unbounded_direction` scales the loads: all units are [] there.
  subroutine minimize(qp, e, mu, k, penetration, alpha, springs)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows and rigid body modes, with the resultants of the loads.
    real(dp), intent(in) :: e(:)  !! Resultants of the loads (qp%coarse%n) [force].
    real(dp), intent(in) :: mu  !! Stiffness against all modes [force/length].
    real(dp), intent(in) :: k(:)  !! Stiffness of the foundations (n_rows) [force/length].
    real(dp), intent(in) :: penetration(:)  !! Penetrations at alpha = 0 (n_rows) [length].
    real(dp), intent(inout) :: alpha(:)  !! Amplitudes; the start on entry (qp%coarse%n) [length].
    type(mode_block_t), intent(in), allocatable :: springs(:)  !! S by bodies; none if not allocated (n_bodies).
    real(dp), allocatable :: gradient(:), step(:), position(:), change(:)
    type(mode_stiffness_t) :: hessian
    type(error_t), allocatable :: error
    real(dp) :: largest, t
    logical :: is_singular
    integer :: i
    allocate (gradient(qp%coarse%n), position(size(penetration)), change(size(penetration)))
    call couple_bodies(qp%coarse, hessian, error)
    if (allocated(error)) return
    call qp%mode_displacement(alpha, position)
    position = penetration + position
    largest = maxval(abs(e))
    do i = 1, most_steps
      call qp%mode_resultant(k*merge(position, max(0.0_dp, position), qp%is_tied), gradient)
      gradient = gradient + resisted(alpha) - e
      if (maxval(abs(gradient)) <= rounding*largest) exit
      call form_hessian(qp%coarse, mu, k, position > 0 .or. qp%is_tied, hessian, springs)
      call hessian%factorize(is_singular, error)
      if (is_singular .or. allocated(error)) exit
      step = -gradient
      call hessian%solve(step)
      call qp%mode_displacement(step, change)
      t = line_minimum(dot_product(resisted(alpha) - e, step) + sum(k*position*change, mask=qp%is_tied), &
                       dot_product(step, resisted(step)) + sum(k*change**2, mask=qp%is_tied), &
                       merge(0.0_dp, k, qp%is_tied), position, change)
      ! A stiffness so small is rounding.
      if (.not. t < huge(t)) exit
      alpha = alpha + t*step
      position = position + t*change
    end do
    call hessian%destroy()
  contains
    !> Forces of mu and S against a motion.
    function resisted(motion) result(force)
      real(dp), intent(in) :: motion(:)  !! Amplitudes (qp%coarse%n) [length].
      real(dp) :: force(size(motion))  !! (qp%coarse%n).
      force = mu*motion
      if (allocated(springs)) force = force + multiply_blocks(qp%coarse%first, springs, motion)
    end function resisted
  end subroutine minimize

  !> The matrix of bodies that share contact rows.
  subroutine couple_bodies(coarse, hessian, error)
    type(coarse_space_t), intent(in) :: coarse  !! Rigid body modes.
    type(mode_stiffness_t), intent(inout) :: hessian  !! Its structure is made.
    type(error_t), allocatable, intent(out) :: error  !! METIS or CHOLMOD has no memory.
    integer, allocatable :: first(:), member(:)
    integer :: i, k, n
    ! The rows of a pair have the same bodies and stand together: one list for them.
    allocate (first(size(coarse%body, 2) + 1), member(size(coarse%body)))
    k = 0
    first(1) = 1
    do i = 1, size(coarse%body, 2)
      n = count(coarse%body(:, i) > 0)
      if (n < 2) cycle
      if (i > 1) then
        if (all(coarse%body(:, i) == coarse%body(:, i - 1))) cycle
      end if
      k = k + 1
      first(k + 1) = first(k) + n
      member(first(k):first(k + 1) - 1) = coarse%body(:n, i)
    end do
    call hessian%init(coarse%first, first(:k + 1), member(:first(k + 1) - 1), error)
  end subroutine couple_bodies

  !> mu I + S + the sum of k_i G_i G_i^T over the points under pressure.
  subroutine form_hessian(coarse, mu, k, presses, hessian, springs)
    type(coarse_space_t), intent(in) :: coarse  !! Rigid body modes.
    real(dp), intent(in) :: mu  !! Stiffness against all modes [force/length].
    real(dp), intent(in) :: k(:)  !! Stiffness of the foundations (n_rows) [force/length].
    logical, intent(in) :: presses(:)  !! Points under pressure, and ties (n_rows).
    type(mode_stiffness_t), intent(inout) :: hessian  !! Gets its entries.
    type(mode_block_t), intent(in), allocatable :: springs(:)  !! S by bodies; none if not allocated (n_bodies).
    real(dp), allocatable :: own(:, :), g_p(:, :), g_q(:, :)
    integer :: b, i, j, p, q, n
    call hessian%clear()
    do b = 1, size(coarse%first) - 1
      n = coarse%first(b + 1) - coarse%first(b)
      allocate (own(n, n), source=0.0_dp)
      if (allocated(springs)) own = springs(b)%value
      do j = 1, n
        own(j, j) = own(j, j) + mu
      end do
      call hessian%add(b, b, own)
      deallocate (own)
    end do
    do i = 1, size(presses)
      if (.not. presses(i)) cycle
      do p = 1, size(coarse%body, 1)
        if (coarse%body(p, i) == 0) cycle
        g_p = mode_rows(p)
        do q = 1, p
          if (coarse%body(q, i) == 0) cycle
          g_q = mode_rows(q)
          call hessian%add(coarse%body(p, i), coarse%body(q, i), k(i)*matmul(transpose(g_p), g_q))
        end do
      end do
    end do
  contains
    !> The row of the modes of one of its bodies (1, modes).
    pure function mode_rows(which) result(g)
      integer, intent(in) :: which  !! Its number among them.
      real(dp), allocatable :: g(:, :)
      g = coarse%block(coarse%body(which, i))%value(coarse%place(which, i):coarse%place(which, i), :)
    end function mode_rows
  end subroutine form_hessian

  !> Whether contact can balance the loads of the floating bodies.
  subroutine check_equilibrium(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(solver_state_t), intent(inout) :: state  !! Ended where the loads excite a motion that no contact stops.
    real(dp), allocatable :: motion(:)
    logical :: found
    allocate (motion(qp%coarse%n))
    call find_unbounded_direction(qp, motion, found)
    if (.not. found) return
    call clear(state)
    state%ended = ended_no_equilibrium
    state%unbounded = qp%coarse%scale*motion
  end subroutine check_equilibrium

  !> Where the contact of many bodies was not solved: whether the reason is that there is no equilibrium.
  subroutine explain_failure(qp, state, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    !> How the scheme ended; ended where the loads excite a motion that no contact stops on return.
    type(solver_state_t), intent(inout) :: state
    !> Why the system of an active set could not be prepared; deallocated where this is the reason.
    type(error_t), allocatable, intent(inout) :: error
    if (allocated(error)) then
      if (error%code /= exit_not_solvable) return
    else
      if (any(state%ended == [ended_interrupted, ended_no_equilibrium])) return
      if (state%ended == ended_converged .and. is_in_equilibrium(qp, state)) return
    end if
    call check_equilibrium(qp, state)
    if (state%ended == ended_no_equilibrium .and. allocated(error)) deallocate (error)
  end subroutine explain_failure

  !> Whether contact forces balance the loads, by the measure that an unbounded direction is found by.
  logical function is_in_equilibrium(qp, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, rigid body modes with the resultants of the loads.
    type(solver_state_t), intent(in) :: state  !! With pressures and amplitudes.
    real(dp), allocatable :: missing(:)
    allocate (missing(qp%coarse%n))
    call qp%mode_resultant(qp%weight*state%pressure, missing)
    missing = qp%coarse%resultant - missing - qp%coarse%stiffness_forces(state%alpha/qp%coarse%scale)
    is_in_equilibrium = .not. maxval(abs(missing)) > imbalance*maxval(abs(qp%coarse%resultant))
  end function is_in_equilibrium

  !> A new state, in which the quantities of other schemes are no numbers.
  subroutine clear(state)
    type(solver_state_t), intent(out) :: state  !! The new state.
    real(dp) :: nan
    nan = ieee_value(nan, ieee_quiet_nan)
    state%gamma = nan
    state%lambda_max = nan
    state%q_predicted = nan
    state%q_measured = nan
    state%error_bound_paper = nan
  end subroutine clear
end module dotyk_scheme_winkler_start
