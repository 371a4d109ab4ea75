!> The interior-point method for contact: where the active-set iteration cycles, as for nearly rigid bodies with many
!> contact points, whose contact forces are almost indeterminate.
!>
!> With gaps `s = M lambda - G alpha - y >= 0` at the contact points, forces `lambda >= 0` and equilibrium `G^T lambda =
!> e`, Newton's method follows the central path `lambda_i s_i = mu w_i` towards mu = 0: Mehrotra's predictor and
!> corrector (SIAM J. Optim. 2, 1992). It takes ten to forty linear systems, whatever the number of points: each is that
!> of the active set of all points, their Winkler layers softened by `s_i/lambda_i`. In the end either the force or the
!> gap of each point is next to nothing, which gives the active set. Rows of ties have forces of any sign, and neither
!> gaps nor softer layers.
module dotyk_scheme_interior_point
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: half_digits, rough, sum_rounding
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: interior_point_method

  type :: point_t  !! An iterate, or a step.
    real(dp), allocatable :: lambda(:)  !! Contact forces (n) [force].
    real(dp), allocatable :: s(:)  !! Gaps (n) [length].
    real(dp), allocatable :: alpha(:)  !! Amplitudes of the rigid body modes (coarse%n) [length].
    !> Of an iterate: rows of ties, whose forces may have any sign, without gaps (n).
    logical, allocatable :: is_tied(:)
  contains
    procedure :: over_force => point_over_force
    procedure :: longest_step => point_longest_step
  end type point_t

  integer, parameter :: most_steps = 200  !! Linear systems at most.
  !> The first iterate is shifted inside by this multiple of the largest violation (Mehrotra).
  real(dp), parameter :: shift = 1.5_dp
  !> Fraction of the distance to the boundary that a step goes.
  real(dp), parameter :: fraction_to_boundary = 0.995_dp
  !> Centring parameter at least (Mehrotra's cubic rule gives 0 where the predictor reaches the solution).
  real(dp), parameter :: least_centring = 1.0e-6_dp

contains

  !> Forces, amplitudes and active set near the solution.
  subroutine interior_point_method(qp, compliance, system, foundation, usable, lambda, alpha, active, steps, error)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    type(active_system_t), intent(inout) :: system  !! Work space: the system of the last step on return.
    !> Compliance of a Winkler foundation in place of the bodies, for the start and the active set (n_rows)
    !> [length/force].
    real(dp), intent(in) :: foundation(:)
    logical, intent(in) :: usable(:)  !! Points that may have a force (n_rows).
    real(dp), intent(out) :: lambda(:)  !! Contact forces, positive at all usable points (n_rows) [force].
    real(dp), intent(out) :: alpha(:)  !! Amplitudes of the rigid body modes (coarse%n) [length].
    logical, intent(out) :: active(:)  !! Points whose force, on the foundation, exceeds their gap (n_rows).
    integer, intent(out) :: steps  !! Linear systems that were solved.
    type(error_t), allocatable, intent(out) :: error  !! The linear system cannot be prepared (`init` of its type).
    type(point_t) :: now
    real(dp), allocatable :: fraction(:)
    integer, allocatable :: row(:)
    integer :: i, n
    row = pack([(i, i=1, size(usable))], usable)
    n = size(row)
    lambda = 0
    alpha = 0
    active = .false.
    steps = 0
    if (n == 0) return
    ! Complementarity products are proportional to the weights.
    fraction = merge(0.0_dp, qp%weight(row), qp%is_tied(row))
    fraction = fraction/max(tiny(1.0_dp), sum(fraction))
    system%step_reduction = rough
    call find_start(qp, compliance, system, usable, row, foundation(row), fraction, now, error)
    if (.not. allocated(error)) call follow_path(qp, compliance, system, usable, row, fraction, now, steps, error)
    system%step_reduction = 0
    if (.not. allocated(now%s)) return
    lambda(row) = now%lambda
    alpha = now%alpha
    active(row) = foundation(row)*now%lambda > now%s .or. qp%is_tied(row)
  end subroutine interior_point_method

  !> Follow the central path from an iterate.
  subroutine follow_path(qp, compliance, system, usable, row, fraction, now, steps, error)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    type(active_system_t), intent(inout) :: system  !! Work space: the system of the last step on return.
    logical, intent(in) :: usable(:)  !! Points that may have a force (n_rows).
    integer, intent(in) :: row(:)  !! These (n).
    real(dp), intent(in) :: fraction(:)  !! Fraction of each point in the sum of the weights (n) [].
    type(point_t), intent(inout) :: now  !! The iterate.
    integer, intent(out) :: steps  !! Linear systems that were solved.
    type(error_t), allocatable, intent(out) :: error  !! The linear system cannot be prepared (`init` of its type).
    type(point_t) :: step
    real(dp), allocatable :: r_dual(:), r_balance(:), product(:)
    real(dp) :: mu, mu_ahead, sigma, length
    integer :: n
    n = size(row)
    allocate (step%lambda(n), step%s(n), step%alpha(qp%coarse%n))
    do steps = 1, most_steps
      if (interrupted()) exit
      call find_residuals(qp, compliance, row, now, r_dual, r_balance)
      mu = sum(now%lambda*now%s)
      if (mu <= sum_rounding*energy_of(qp, row, now) .and. is_balanced(qp, now, r_balance)) exit
      call make_system(qp, compliance, system, usable, row, now%over_force(now%s), error)
      if (allocated(error)) exit
      ! Predictor, then corrector.
      product = -now%lambda*now%s
      call newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
      length = now%longest_step(step)
      mu_ahead = sum((now%lambda + length*step%lambda)*(now%s + length*step%s))
      sigma = min(1.0_dp, max(least_centring, (mu_ahead/mu)**3))
      product = sigma*mu*fraction - now%lambda*now%s - step%lambda*step%s
      call newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
      length = now%longest_step(step)
      length = min(1.0_dp, fraction_to_boundary*length)
      now%lambda = now%lambda + length*step%lambda
      now%s = now%s + length*step%s
      now%alpha = now%alpha + length*step%alpha
      ! Rounding errors stop it.
      if (length < half_digits) exit
    end do
    steps = min(steps, most_steps)
  end subroutine follow_path

  !> The energy that complementarity products are compared with.
  pure real(dp) function energy_of(qp, row, now) result(energy)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    integer, intent(in) :: row(:)  !! Usable rows (n).
    type(point_t), intent(in) :: now  !! The iterate.
    energy = abs(sum(now%lambda*(now%s + qp%initial_penetration(row)))) + abs(sum(now%alpha*qp%coarse%resultant))
  end function energy_of

  !> The first iterate: all contact points tied to foundations, then forces and gaps shifted to be positive.
  subroutine find_start(qp, compliance, system, usable, row, foundation, fraction, now, error)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    type(active_system_t), intent(inout) :: system  !! Work space.
    logical, intent(in) :: usable(:)  !! Points that may have a force (n_rows).
    integer, intent(in) :: row(:)  !! These (n).
    real(dp), intent(in) :: foundation(:)  !! Compliance of the foundation there (n) [length/force].
    real(dp), intent(in) :: fraction(:)  !! Fraction of each point in the sum of the weights (n) [].
    type(point_t), intent(out) :: now  !! The iterate.
    type(error_t), allocatable, intent(out) :: error  !! The linear system cannot be prepared (`init` of its type).
    real(dp) :: force, gap, product
    allocate (now%lambda(size(row)), now%alpha(qp%coarse%n))
    now%is_tied = qp%is_tied(row)
    call make_system(qp, compliance, system, usable, row, merge(0.0_dp, foundation, now%is_tied), error)
    if (allocated(error)) return
    now%lambda = 0
    call system%solve(qp, compliance, qp%initial_penetration(row), qp%coarse%resultant, now%lambda, now%alpha)
    now%s = merge(0.0_dp, -foundation*now%lambda, now%is_tied)
    ! Forces are shifted in proportion to the weights, gaps by the same length everywhere.
    force = max(0.0_dp, -shift*minval(now%lambda/merge(1.0_dp, fraction, now%is_tied), mask=.not. now%is_tied))
    gap = max(0.0_dp, -shift*minval(now%s))
    now%lambda = now%lambda + force*fraction
    where (.not. now%is_tied) now%s = now%s + gap
    product = sum(now%lambda*now%s)
    force = max(product/(2*max(tiny(1.0_dp), sum(fraction*now%s))), tiny(1.0_dp))
    gap = max(product/(2*max(tiny(1.0_dp), sum(now%lambda, mask=.not. now%is_tied))), tiny(1.0_dp))
    now%lambda = now%lambda + force*fraction
    where (.not. now%is_tied) now%s = now%s + gap
  end subroutine find_start

  !> The system of all usable points with softer Winkler layers.
  subroutine make_system(qp, compliance, system, usable, row, softer, error)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    type(active_system_t), intent(inout) :: system  !! Factorized on return.
    logical, intent(in) :: usable(:)  !! Points that may have a force (n_rows).
    integer, intent(in) :: row(:)  !! These (n).
    real(dp), intent(in) :: softer(:)  !! Compliance added to the layers (n) [length/force].
    type(error_t), allocatable, intent(out) :: error  !! The linear system cannot be prepared (`init` of its type).
    real(dp), allocatable :: soft_theta(:)
    allocate (soft_theta(qp%n_rows))
    soft_theta = qp%theta
    soft_theta(row) = qp%theta(row) + qp%weight(row)*softer
    call system%init(qp, compliance, usable, error, soft_theta)
  end subroutine make_system

  !> Residuals `M lambda - G alpha - y - s` and `G^T lambda + S alpha - e`.
  subroutine find_residuals(qp, compliance, row, now, r_dual, r_balance)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    integer, intent(in) :: row(:)  !! Usable rows (n).
    type(point_t), intent(in) :: now  !! The iterate.
    real(dp), allocatable, intent(out) :: r_dual(:)  !! Residual of the contact rows (n) [length].
    real(dp), allocatable, intent(out) :: r_balance(:)  !! Residual of equilibrium (coarse%n) [force].
    real(dp), allocatable :: lambda(:), z(:), motion(:)
    allocate (lambda(qp%n_rows), z(qp%n_rows), motion(qp%n_rows), source=0.0_dp)
    allocate (r_balance(qp%coarse%n))
    lambda(row) = now%lambda
    call compliance%multiply(qp, lambda, z)
    call qp%mode_displacement(now%alpha, motion)
    r_dual = z(row) + qp%theta(row)/qp%weight(row)*now%lambda - motion(row) - qp%initial_penetration(row) - now%s
    call qp%mode_resultant(lambda, r_balance)
    r_balance = r_balance + qp%coarse%stiffness_forces(now%alpha) - qp%coarse%resultant
  end subroutine find_residuals

  !> Whether contact forces balance the loads.
  pure logical function is_balanced(qp, now, r_balance)
    type(contact_qp_t), intent(in) :: qp  !! With the resultants of the loads.
    type(point_t), intent(in) :: now  !! The iterate.
    real(dp), intent(in) :: r_balance(:)  !! Residual of equilibrium (coarse%n) [force].
    real(dp) :: largest
    largest = max(maxval(abs(now%lambda)), maxval([0.0_dp, abs(qp%coarse%resultant)]))
    is_balanced = .not. any(abs(r_balance) > half_digits*largest)
  end function is_balanced

  !> Newton's step for given changes of the complementarity products.
  subroutine newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    type(active_system_t), intent(in) :: system  !! Layers softened by s/lambda.
    type(point_t), intent(in) :: now  !! The iterate.
    real(dp), intent(in) :: r_dual(:)  !! Residual of the contact rows (n) [length].
    real(dp), intent(in) :: r_balance(:)  !! Residual of equilibrium (coarse%n) [force].
    real(dp), intent(in) :: product(:)  !! Changes of `lambda_i s_i`, to first order (n) [force*length].
    type(point_t), intent(inout) :: step  !! The step.
    step%lambda = 0
    call system%solve(qp, compliance, now%over_force(product) - r_dual, -r_balance, step%lambda, step%alpha)
    step%s = now%over_force(product - now%s*step%lambda)
  end subroutine newton_step

  !> A product divided by the force; 0 for ties.
  pure function point_over_force(self, product) result(quotient)
    class(point_t), intent(in) :: self
    real(dp), intent(in) :: product(:)  !! (n) [force*length].
    real(dp) :: quotient(size(product))  !! (n) [length].
    quotient = 0
    where (.not. self%is_tied) quotient = product/self%lambda
  end function point_over_force

  !> Length of a step to the boundary, at most 1/fraction_to_boundary.
  pure real(dp) function point_longest_step(self, step) result(length)
    class(point_t), intent(in) :: self
    type(point_t), intent(in) :: step  !! The step.
    length = 1/fraction_to_boundary
    associate (closes => step%lambda < 0 .and. .not. self%is_tied)
      if (any(closes)) length = min(length, minval(-self%lambda/step%lambda, mask=closes))
    end associate
    if (any(step%s < 0)) length = min(length, minval(-self%s/step%s, mask=step%s < 0))
  end function point_longest_step
end module dotyk_scheme_interior_point
