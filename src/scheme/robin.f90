!> The parallel Robin scheme: the general iteration (32) with G = A + X, X the penalty form of each body by itself on a
!> fixed set of rows.
!>
!> On every body at once `(K_a + B_a^T P_F B_a)(u_a^{k+1} - u_a^k) = -gamma (K_a u_a^k - f_a + B_a^T W p^k)`, with
!> `p^k = Theta^{-1} max(0, y^k)`: each side of a row of the set F lies on a spring (Robin conditions), the others have
!> the last pressure (Neumann conditions). With the body's own forces, `u_a = u0_a - K_a^{-1} B_a^T lambda_a`,
!> `r_a = W p - lambda_a` and `g_a = C_a^G r_a` this is `lambda_a += gamma (r_a - P_F g_a)`, `B_a u_a -= gamma g_a`.
!> Both sides agree on the force at the solution only: the state that a user gets has the mean of both.
!>
!> X is the penalty form of each body by itself on a fixed set F of contact rows, `X(u,v) = sum_a u_a^T B_a^T P_F B_a
!> v_a`, `P_F = Theta^{-1} W` there and 0 elsewhere: each side of such a row lies on a spring. With the body's own
!> compliance `C_a = B_a K_a^{-1} B_a^T` the compliance of G is `C_a^G = B_a (K_a + B_a^T P_F B_a)^{-1} B_a^T = (I + C_a
!> P_F)^{-1} C_a`. No solve of a body is needed once the entries of C_a are there. G is symmetric, continuous and
!> coercive, equations (29), (30), (31), so that every step, equations (33), (34), has one solution.
module dotyk_scheme_robin
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_error, only: add_context, error_slot_t, error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_linalg_blas, only: transposed_product
  use dotyk_linalg_dense, only: cholesky_factor, solve_triangular
  use dotyk_linalg_spectrum, only: linear_operator_t
  use dotyk_scheme_bounds, only: iteration_constants_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_neumann, only: begin_iteration, finish_iteration, is_general_iteration
  use dotyk_scheme_relaxation, only: announce_relaxation, choose_relaxation, margin, upper_estimate
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: paused_t, solver_state_t, ended_interrupted
  use dotyk_scheme_stopping, only: iteration_t, solver_settings_t, take_up
  implicit none
  private

  type :: side_t  !! One body: everything is on its rows (n).
    !> Contact forces [force], and displacements C_a lambda by them [length] (n).
    real(dp), allocatable :: lambda(:), z(:)
    real(dp), allocatable :: compliance(:, :), compliance_g(:, :)  !! C_a, and C_a^G (n, n), symmetric [length/force].
    !> A factor of C_a^G = L L^T, transposed: L^T (n, n) [sqrt(length/force)]; until the constants are known.
    real(dp), allocatable :: factor(:, :)
    real(dp), allocatable :: last_lambda(:), last_z(:)  !! Forces and displacements before the last step (n).
    integer :: n_steps = 0  !! Steps so far.
    !> Squares of norms: K^{-1} F'_theta(u^k) in that of A, the step in that of G, and how far the mean of both sides is
    !> from u^k and from u^{k+1} in that of A [energy].
    real(dp) :: residual = 0, length = 0, to_last = 0, to_next = 0
  contains
    procedure :: start => side_start
    procedure :: advance => side_advance
    procedure :: compare => side_compare
  end type side_t

  type, extends(linear_operator_t) :: matrix_operator_t  !! A symmetric matrix as an operator.
    real(dp), allocatable :: value(:, :)  !! (n, n).
  contains
    procedure :: apply => matrix_operator_apply
  end type matrix_operator_t

  !> `L^T (E^T P E - k P_F) L + k I`, with the factors `C_a^G = L_a L_a^T`, E the sum of both sides of a row and P =
  !> Theta^{-1} W: the spectrum is that of G^{-1} j'' for k = 0, that of G^{-1} (A + j'') for k = 1, j'' with all rows
  !> active. The pointers are to variables of the procedure that has it as a local variable.
  type, extends(linear_operator_t) :: form_operator_t
    type(contact_qp_t), pointer :: qp => null()  !! The rows.
    real(dp), allocatable :: penalty(:), spring(:)  !! P, and P_F (n_rows) [force/length].
    type(side_t), pointer :: side(:) => null()  !! Bodies with their factors (n_bodies).
    real(dp) :: k = 0  !! k [].
  contains
    procedure :: apply => form_operator_apply
  end type form_operator_t

  !> Steps after which displacements are computed anew from the forces: increments keep their rounding errors.
  integer, parameter :: refresh = 64

  type, extends(scheme_t), public :: robin_t  !! The scheme.
  contains
    procedure :: solve => robin_solve
    procedure, nopass :: is_iteration => is_general_iteration
  end type robin_t

  type :: vector_t  !! A vector on the rows of a body.
    real(dp), allocatable :: value(:)  !! (n) [length].
  end type vector_t

  !> The iteration on both sides of the rows. It keeps the matrices in a pause: to make them again would cost more than
  !> many steps.
  type, extends(iteration_t) :: two_sides_t
    type(side_t), allocatable :: side(:)  !! (n_bodies).
    real(dp), allocatable :: spring(:)  !! P_F (n_rows) [force/length].
    !> Penetrations by the displacements of both sides (n_rows) [length]; not allocated where there is nothing to do.
    real(dp), allocatable :: penetration(:)
  end type two_sides_t

contains

  !> Iterate from u_0 or the state, or continue a paused iteration.
  subroutine robin_solve(self, qp, compliance, settings, monitor, state, error)
    class(robin_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact QP of held bodies.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    !> The start where it has pressures; the last iterate on return, with its history.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where a body's C_a is not positive semidefinite, or the rule of the paper is to end the iteration and
    !> gamma is beyond Theorem 3.
    type(error_t), allocatable, intent(out) :: error
    class(paused_t), allocatable :: paused
    call take_up(settings, state, paused)
    if (.not. allocated(paused)) then
      call begin(qp, compliance, settings, monitor, state, paused, error)
      if (allocated(error)) return
    end if
    select type (paused)
    type is (two_sides_t)
      if (allocated(paused%penetration)) call iterate(qp, paused, monitor, state)
    end select
    call finish_iteration(monitor, state, paused)
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine robin_solve

  !> The first iterate: both sides have the forces of the state.
  subroutine begin(qp, compliance, settings, monitor, state, paused, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets lines for the log.
    type(solver_state_t), intent(inout) :: state  !! As in `begin_iteration`.
    class(paused_t), allocatable, intent(out) :: paused  !! A `two_sides_t`.
    type(error_t), allocatable, intent(out) :: error  !! As in `robin_solve`.
    type(two_sides_t), allocatable :: now
    logical :: is_first
    integer :: b
    is_first = .not. allocated(state%constants)
    call begin_iteration(qp, compliance, state)
    allocate (now)
    if (qp%n_rows > 0) then
      state%lambda_max = ieee_value(state%lambda_max, ieee_quiet_nan)
      now%spring = merge(qp%weight/qp%theta, 0.0_dp, has_robin_conditions(qp, settings))
      call form_sides(qp, compliance, now%spring, now%side, error)
      if (allocated(error)) return
      if (interrupted()) then
        state%ended = ended_interrupted
        state%error_bound = huge(state%error_bound)
        call move_alloc(now, paused)
        return
      end if
      do b = 1, size(now%side)
        call now%side(b)%start(qp%weight(qp%block(b)%row)*state%pressure(qp%block(b)%row))
      end do
      allocate (state%constants)
      call find_constants(qp, qp%weight/qp%theta, now%spring, now%side, state%constants)
      call choose_relaxation(settings, state, error)
      if (allocated(error)) return
      if (is_first) call announce_relaxation(monitor, state, 'Robin conditions on '// &
        to_text(count(now%spring > 0))//' of '//to_text(qp%n_rows)//' constraints, spectrum '// &
        to_text(state%constants%coercivity, 4)//' to '//to_text(state%constants%smoothness, 4))
      call now%stopping%begin(settings, state%q_predicted)
      now%penetration = state%penetration
    end if
    call move_alloc(now, paused)
  end subroutine begin

  !> Which rows have Robin conditions.
  pure function has_robin_conditions(qp, settings) result(has)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows with their initial gaps.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    logical :: has(qp%n_rows)
    integer :: k
    has = .true.
    if (.not. allocated(settings%robin_gap)) return
    do k = 1, size(settings%robin_gap)
      associate (first => qp%pair_first_row(k), last => qp%pair_first_row(k + 1) - 1)
        has(first:last) = qp%gap(first:last) <= settings%robin_gap(k)
      end associate
    end do
  end function has_robin_conditions

  !> The steps of (32).
  subroutine iterate(qp, now, monitor, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(two_sides_t), intent(inout) :: now  !! The sides.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    type(solver_state_t), intent(inout) :: state  !! With constants and gamma; the mean of both sides, with its history.
    real(dp) :: to_last, to_next, residual, length
    do
      call step(qp, state%gamma, now, state)
      residual = norm_of(now%side%residual)
      length = norm_of(now%side%length)
      to_last = norm_of(now%side%to_last)
      to_next = norm_of(now%side%to_next)
      if (now%stopping%check(qp, to_last + residual, length, state%gamma > state%constants%gamma_limit(), monitor, &
          state, to_next + state%constants%bound_of_paper(state%gamma, length))) exit
    end do
  end subroutine iterate

  !> Norm of displacements of all bodies from the squares of each.
  pure real(dp) function norm_of(squares)
    real(dp), intent(in) :: squares(:)  !! Squares, up to rounding (n_bodies) [energy].
    norm_of = sqrt(max(0.0_dp, sum(squares)))
  end function norm_of

  !> One step of all bodies, side by side; sums in the order of the bodies, whatever thread is first.
  subroutine step(qp, gamma, now, state)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), intent(in) :: gamma  !! Relaxation parameter [].
    type(two_sides_t), intent(inout) :: now  !! The sides; know the norms of the step on return.
    type(solver_state_t), intent(inout) :: state  !! Gets the mean of both sides, without tension.
    real(dp), allocatable :: force(:), mean(:)
    type(vector_t) :: z(size(now%side))
    integer :: b
    force = qp%weight*max(0.0_dp, now%penetration)/qp%theta
    !$omp parallel do default(none) shared(qp, now, force, gamma) schedule(dynamic, 1)
    do b = 1, size(now%side)
      associate (row => qp%block(b)%row)
        call now%side(b)%advance(force(row), now%spring(row), gamma)
      end associate
    end do
    !$omp end parallel do
    mean = 0*force
    now%penetration = qp%initial_penetration
    do b = 1, size(now%side)
      associate (row => qp%block(b)%row, own => now%side(b))
        now%penetration(row) = now%penetration(row) - own%z
        mean(row) = mean(row) + own%lambda/2
      end associate
    end do
    mean = max(0.0_dp, mean)
    !$omp parallel do default(none) shared(qp, now, mean, z) schedule(dynamic, 1)
    do b = 1, size(now%side)
      call now%side(b)%compare(mean(qp%block(b)%row), z(b)%value)
    end do
    !$omp end parallel do
    state%pressure = mean/qp%weight
    state%penetration = qp%initial_penetration
    do b = 1, size(now%side)
      associate (row => qp%block(b)%row)
        state%penetration(row) = state%penetration(row) - z(b)%value
      end associate
    end do
  end subroutine step

  !> The compliances of all bodies, side by side; an interrupt ends it early, without matrices.
  subroutine form_sides(qp, compliance, spring, side, error)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows; all entries are formed.
    real(dp), intent(in) :: spring(:)  !! P_F (n_rows) [force/length].
    type(side_t), allocatable, intent(out) :: side(:)  !! Bodies with their compliances, without forces (n_bodies).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where C_a of a body is not positive semidefinite.
    type(error_slot_t) :: failed(size(qp%block))
    integer :: b
    allocate (side(size(qp%block)))
    call compliance%form(qp, may_stop=.true.)
    if (interrupted()) return
    !$omp parallel do default(none) shared(qp, compliance, spring, side, failed) schedule(dynamic, 1)
    do b = 1, size(side)
      associate (row => qp%block(b)%row)
        call compliance%get_entries(qp, b, row, side(b)%compliance)
        call form_side(spring(row), side(b), failed(b)%error)
      end associate
    end do
    !$omp end parallel do
    do b = 1, size(side)
      if (.not. allocated(failed(b)%error)) cycle
      call move_alloc(failed(b)%error, error)
      call add_context(error, 'compliance of body '//to_text(b)//': ')
      return
    end do
  end subroutine form_sides

  !> C_a^G = F (I + F^T P_F F)^{-1} F^T with C_a = F F^T: positive semidefinite whatever rounding does.
  subroutine form_side(spring, side, error)
    real(dp), intent(in) :: spring(:)  !! P_F on the rows of the body (n) [force/length].
    type(side_t), intent(inout) :: side  !! With C_a; gets the rest.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where C_a is not positive semidefinite.
    real(dp), allocatable :: f(:, :), scaled(:, :), matrix(:, :), root(:, :)
    integer :: i, n
    n = size(spring)
    allocate (side%compliance_g(n, n), side%lambda(n), side%z(n))
    call cholesky_factor(side%compliance, f, error)
    if (allocated(error)) return
    scaled = f
    do i = 1, n
      scaled(i, :) = sqrt(spring(i))*f(i, :)
    end do
    allocate (matrix(n, n))
    call transposed_product(scaled, scaled, matrix)
    do i = 1, n
      matrix(i, i) = matrix(i, i) + 1
    end do
    call cholesky_factor(matrix, root, error)
    if (allocated(error)) return
    side%factor = transpose(f)
    call solve_triangular(root, side%factor)
    call transposed_product(side%factor, side%factor, side%compliance_g)
  end subroutine form_side

  !> Constants in the norm of G: M = B~ = M~ = 1, since A <= G; B = 1/(1+l) with the largest eigenvalue l of P_F C_a
  !> over all bodies; D the largest eigenvalue of G^{-1} j'', and Lambda that of G^{-1} (A + j''). All on the
  !> safe side, as far as the estimates of the eigenvalues are.
  subroutine find_constants(qp, penalty, spring, side, constants)
    type(contact_qp_t), intent(in), target :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), intent(in) :: penalty(:)  !! P (n_rows) [force/length].
    real(dp), intent(in) :: spring(:)  !! P_F (n_rows) [force/length].
    !> Bodies with their compliances (n_bodies); without their factors on return.
    type(side_t), intent(inout), target :: side(:)
    type(iteration_constants_t), intent(out) :: constants  !! The constants.
    type(matrix_operator_t) :: of_body
    type(form_operator_t) :: form
    real(dp) :: largest
    integer :: b, i, n
    n = 0
    largest = 0
    do b = 1, size(side)
      associate (row => qp%block(b)%row, own => side(b))
        n = n + size(row)
        of_body%value = own%compliance
        do i = 1, size(row)
          of_body%value(i, :) = sqrt(spring(row(i)))*of_body%value(i, :)
          of_body%value(:, i) = sqrt(spring(row(i)))*of_body%value(:, i)
        end do
        largest = max(largest, upper_estimate(of_body, size(row)))
      end associate
    end do
    constants%coercivity = 1/(1 + largest)
    ! As far below the best gamma as estimated eigenvalues may be below the true ones.
    constants%damping = 2 - margin
    form%qp => qp
    form%penalty = penalty
    form%spring = spring
    form%side => side
    constants%penalty = upper_estimate(form, n)
    form%k = 1
    constants%smoothness = upper_estimate(form, n)
    ! On rows with springs (v_a + v_b)^2 <= 2 (v_a^2 + v_b^2), so that j'' <= 2 X there, and X <= l/(1+l) G; likewise
    ! A + j'' <= G + X. Estimates may be above that.
    if (all(spring > 0)) then
      constants%penalty = min(constants%penalty, 2*largest/(1 + largest))
      constants%smoothness = min(constants%smoothness, 1 + largest/(1 + largest))
    end if
    ! A <= G and j'' <= D G.
    constants%smoothness = min(constants%smoothness, 1 + constants%penalty)
    do b = 1, size(side)
      deallocate (side(b)%factor)
    end do
  end subroutine find_constants

  !> Begin with contact forces.
  subroutine side_start(self, lambda)
    class(side_t), intent(inout) :: self
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n) [force].
    self%lambda = lambda
    self%z = matmul(self%compliance, lambda)
  end subroutine side_start

  !> One step (32) of the body.
  subroutine side_advance(self, force, spring, gamma)
    class(side_t), intent(inout) :: self
    real(dp), intent(in) :: force(:)  !! W p by the last penetrations (n) [force].
    real(dp), intent(in) :: spring(:)  !! P_F on its rows (n) [force/length].
    real(dp), intent(in) :: gamma  !! Relaxation parameter [].
    real(dp) :: r(size(force)), g(size(force))
    self%last_lambda = self%lambda
    self%last_z = self%z
    r = force - self%lambda
    g = matmul(self%compliance_g, r)
    self%residual = dot_product(r, matmul(self%compliance, r))
    self%length = gamma**2*dot_product(r, g)
    self%lambda = self%lambda + gamma*(r - spring*g)
    self%z = self%z + gamma*g
    self%n_steps = self%n_steps + 1
    if (modulo(self%n_steps, refresh) == 0) self%z = matmul(self%compliance, self%lambda)
  end subroutine side_advance

  !> Displacements by the mean of the forces of both sides, and how far it is from the iterates of the body.
  subroutine side_compare(self, mean, z)
    class(side_t), intent(inout) :: self
    real(dp), intent(in) :: mean(:)  !! Mean forces (n) [force].
    real(dp), allocatable, intent(out) :: z(:)  !! C_a mean (n) [length].
    z = matmul(self%compliance, mean)
    self%to_last = dot_product(mean - self%last_lambda, z - self%last_z)
    self%to_next = dot_product(mean - self%lambda, z - self%z)
  end subroutine side_compare

  !> y = A x.
  subroutine matrix_operator_apply(self, x, y)
    class(matrix_operator_t), intent(inout) :: self
    real(dp), intent(in) :: x(:)  !! Vector x (n) [any].
    real(dp), intent(out) :: y(:)  !! Product y (n) [operator times x].
    y = matmul(self%value, x)
  end subroutine matrix_operator_apply

  !> y = (L^T (E^T P E - k P_F) L + k I) x.
  subroutine form_operator_apply(self, x, y)
    class(form_operator_t), intent(inout) :: self
    real(dp), intent(in) :: x(:)  !! Vector x, body after body (number of rows of all bodies) [sqrt(energy)].
    real(dp), intent(out) :: y(:)  !! Product y (the same) [sqrt(energy)].
    real(dp), allocatable :: s(:), force(:)
    integer :: b, before, n
    allocate (s(size(x)), force(self%qp%n_rows))
    force = 0
    before = 0
    do b = 1, size(self%side)
      associate (row => self%qp%block(b)%row)
        n = size(row)
        s(before + 1:before + n) = matmul(x(before + 1:before + n), self%side(b)%factor)
        force(row) = force(row) + self%penalty(row)*s(before + 1:before + n)
        before = before + n
      end associate
    end do
    before = 0
    do b = 1, size(self%side)
      associate (row => self%qp%block(b)%row)
        n = size(row)
        y(before + 1:before + n) = self%k*x(before + 1:before + n) + &
          matmul(self%side(b)%factor, force(row) - self%k*self%spring(row)*s(before + 1:before + n))
        before = before + n
      end associate
    end do
  end subroutine form_operator_apply
end module dotyk_scheme_robin
