!> The interior-point method for contact: where the active-set iteration cycles, as for nearly rigid bodies with many
!> contact points, whose contact forces are almost indeterminate.
!>
!> With gaps `s = M lambda - G alpha - y >= 0` at the contact points, forces `lambda >= 0` and equilibrium `G^T lambda =
!> e`, Newton's method follows the central path `lambda_i s_i = mu w_i` towards mu = 0: Mehrotra's predictor and
!> corrector (SIAM J. Optim. 2, 1992), and Gondzio's centrality correctors (Comput. Optim. Appl. 6, 1996), since
!> solutions are cheap against factorizations. It takes ten to forty linear systems, whatever the number of points: each
!> is that of the active set of all points, their Winkler layers softened by `s_i/lambda_i`. In the end either the force
!> or the gap of each point is next to nothing, which gives the active set.
module dotyk_scheme_interior_point
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: interior_point_method

  !> Linear systems at most.
  integer, parameter :: most_steps = 60
  !> The method ends where the complementarity products are this fraction of the energy, unless asked otherwise, and
  real(dp), parameter :: least_product = 1.0e-14_dp
  !> the imbalance is this fraction of the loads.
  real(dp), parameter :: balanced = 1.0e-9_dp
  !> Fraction of the distance to the boundary that a step goes.
  real(dp), parameter :: fraction_to_boundary = 0.995_dp
  !> Centring parameter at least (Mehrotra's cubic rule gives 0 where the predictor reaches the solution).
  real(dp), parameter :: least_centring = 1.0e-6_dp
  !> The first iterate is shifted inside by this multiple of the largest violation (Mehrotra).
  real(dp), parameter :: shift = 1.5_dp
  !> A shorter step than this is stopped by rounding errors.
  real(dp), parameter :: shortest_step = 1.0e-8_dp
  !> Centrality corrections of a step at most.
  integer, parameter :: most_corrections = 8
  !> A correction aims at a step longer by this, and is taken
  real(dp), parameter :: longer_by = 0.5_dp
  !> where it gains this fraction of it.
  real(dp), parameter :: worthwhile_gain = 0.1_dp
  !> Steps longer than this are not corrected.
  real(dp), parameter :: long_enough = 0.95_dp
  !> What solutions by iteration may leave of a step, in the energy norm: the step after that corrects it.
  real(dp), parameter :: step_reduction = 0.01_dp
  !> Complementarity products between these multiples of their targets are not corrected.
  real(dp), parameter :: smallest_product = 0.5_dp, largest_product = 2.0_dp

  !> An iterate, or a step.
  type :: point_t
    !> Contact forces (n) [force].
    real(dp), allocatable :: lambda(:)
    !> Gaps (n) [length].
    real(dp), allocatable :: s(:)
    !> Amplitudes of the rigid body modes (coarse%n) [length].
    real(dp), allocatable :: alpha(:)
  end type point_t

contains

  !> Forces, amplitudes and active set near the solution.
  subroutine interior_point_method(qp, compliance, theta, system, foundation, usable, lambda, alpha, active, &
                                   steps, error, accuracy)
    !> The contact problem.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all usable rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Work space: the system of the last step on return.
    class(active_system_t), intent(inout) :: system
    !> Compliance of a Winkler foundation in place of the bodies, for the start and the active set (n_rows)
    !> [length/force].
    real(dp), intent(in) :: foundation(:)
    !> Points that may have a force (n_rows).
    logical, intent(in) :: usable(:)
    !> Contact forces, positive at all usable points (n_rows) [force].
    real(dp), intent(out) :: lambda(:)
    !> Amplitudes of the rigid body modes (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    !> Points whose force, on the foundation, exceeds their gap (n_rows).
    logical, intent(out) :: active(:)
    !> Linear systems that were solved.
    integer, intent(out) :: steps
    !> The linear system cannot be prepared (`init` of its type).
    type(error_t), allocatable, intent(out) :: error
    !> The method ends where the complementarity products are this fraction of the energy; rounding if absent [].
    real(dp), intent(in), optional :: accuracy
    type(point_t) :: now, step
    real(dp), allocatable :: fraction(:), r_dual(:), r_balance(:), product(:)
    integer, allocatable :: row(:)
    real(dp) :: mu, mu_ahead, sigma, length, energy, least
    integer :: i, n
    least = least_product
    if (present(accuracy)) least = accuracy
    row = pack([(i, i=1, size(usable))], usable)
    n = size(row)
    lambda = 0
    alpha = 0
    active = .false.
    steps = 0
    if (n == 0) return
    ! Complementarity products are proportional to the weights.
    fraction = qp%weight(row)/sum(qp%weight(row))
    system%step_reduction = step_reduction
    call find_start(qp, compliance, theta, system, usable, row, foundation(row), fraction, now, error)
    if (allocated(error)) system%step_reduction = 0
    if (allocated(error)) return
    allocate (step%lambda(n), step%s(n), step%alpha(qp%coarse%n))
    do steps = 1, most_steps
      if (interrupted()) exit
      call find_residuals(qp, compliance, theta, row, now, r_dual, r_balance)
      mu = sum(now%lambda*now%s)
      energy = abs(sum(now%lambda*(now%s + qp%initial_penetration(row)))) + abs(sum(now%alpha*qp%coarse%resultant))
      if (mu <= least*energy .and. is_balanced(qp, now, r_balance)) exit
      call make_system(qp, compliance, theta, system, usable, row, now%s/now%lambda, error)
      if (allocated(error)) exit
      ! Predictor, then corrector.
      product = -now%lambda*now%s
      call newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
      length = min(longest_step(now%lambda, step%lambda), longest_step(now%s, step%s))
      mu_ahead = sum((now%lambda + length*step%lambda)*(now%s + length*step%s))
      sigma = min(1.0_dp, max(least_centring, (mu_ahead/mu)**3))
      product = sigma*mu*fraction - now%lambda*now%s - step%lambda*step%s
      call newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
      call correct_centrality(qp, compliance, system, now, sigma*mu*fraction, step)
      length = min(longest_step(now%lambda, step%lambda), longest_step(now%s, step%s))
      length = min(1.0_dp, fraction_to_boundary*length)
      now%lambda = now%lambda + length*step%lambda
      now%s = now%s + length*step%s
      now%alpha = now%alpha + length*step%alpha
      if (length < shortest_step) exit
    end do
    system%step_reduction = 0
    steps = min(steps, most_steps)
    lambda(row) = now%lambda
    alpha = now%alpha
    active(row) = foundation(row)*now%lambda > now%s
  end subroutine interior_point_method

  !> The first iterate: all contact points tied to foundations, then forces and gaps shifted to be positive.
  subroutine find_start(qp, compliance, theta, system, usable, row, foundation, fraction, now, error)
    !> The contact problem.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all usable rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Work space.
    class(active_system_t), intent(inout) :: system
    !> Points that may have a force (n_rows).
    logical, intent(in) :: usable(:)
    !> These (n).
    integer, intent(in) :: row(:)
    !> Compliance of the foundation there (n) [length/force].
    real(dp), intent(in) :: foundation(:)
    !> Fraction of each point in the sum of the weights (n) [].
    real(dp), intent(in) :: fraction(:)
    !> The iterate.
    type(point_t), intent(out) :: now
    !> The linear system cannot be prepared (`init` of its type).
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: force, gap, product
    allocate (now%lambda(size(row)), now%alpha(qp%coarse%n))
    call make_system(qp, compliance, theta, system, usable, row, foundation, error)
    if (allocated(error)) return
    now%lambda = 0
    call system%solve(qp, compliance, qp%initial_penetration(row), qp%coarse%resultant, now%lambda, now%alpha)
    now%s = -foundation*now%lambda
    ! Forces are shifted in proportion to the weights, gaps by the same length everywhere.
    force = max(0.0_dp, -shift*minval(now%lambda/fraction))
    gap = max(0.0_dp, -shift*minval(now%s))
    now%lambda = now%lambda + force*fraction
    now%s = now%s + gap
    product = sum(now%lambda*now%s)
    force = max(product/(2*max(tiny(1.0_dp), sum(fraction*now%s))), tiny(1.0_dp))
    gap = max(product/(2*max(tiny(1.0_dp), sum(now%lambda))), tiny(1.0_dp))
    now%lambda = now%lambda + force*fraction
    now%s = now%s + gap
  end subroutine find_start

  !> The system of all usable points with softer Winkler layers.
  subroutine make_system(qp, compliance, theta, system, usable, row, softer, error)
    !> The contact problem.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all usable rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Factorized on return.
    class(active_system_t), intent(inout) :: system
    !> Points that may have a force (n_rows).
    logical, intent(in) :: usable(:)
    !> These (n).
    integer, intent(in) :: row(:)
    !> Compliance added to the layers (n) [length/force].
    real(dp), intent(in) :: softer(:)
    !> The linear system cannot be prepared (`init` of its type).
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: soft_theta(:)
    allocate (soft_theta(qp%n_rows))
    soft_theta = theta
    soft_theta(row) = theta(row) + qp%weight(row)*softer
    call system%init(qp, compliance, soft_theta, usable, error)
  end subroutine make_system

  !> Residuals `M lambda - G alpha - y - s` and `G^T lambda + S alpha - e`.
  subroutine find_residuals(qp, compliance, theta, row, now, r_dual, r_balance)
    !> The contact problem.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all usable rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Usable rows (n).
    integer, intent(in) :: row(:)
    !> The iterate.
    type(point_t), intent(in) :: now
    !> Residual of the contact rows (n) [length].
    real(dp), allocatable, intent(out) :: r_dual(:)
    !> Residual of equilibrium (coarse%n) [force].
    real(dp), allocatable, intent(out) :: r_balance(:)
    real(dp), allocatable :: lambda(:), z(:), motion(:)
    allocate (lambda(qp%n_rows), z(qp%n_rows), motion(qp%n_rows), source=0.0_dp)
    allocate (r_balance(qp%coarse%n))
    lambda(row) = now%lambda
    call compliance%multiply(qp, lambda, z)
    call qp%mode_displacement(now%alpha, motion)
    r_dual = z(row) + theta(row)/qp%weight(row)*now%lambda - motion(row) - qp%initial_penetration(row) - now%s
    call qp%mode_resultant(lambda, r_balance)
    r_balance = r_balance + qp%coarse%stiffness_forces(now%alpha) - qp%coarse%resultant
  end subroutine find_residuals

  !> Whether contact forces balance the loads.
  pure logical function is_balanced(qp, now, r_balance)
    !> With the resultants of the loads.
    type(contact_qp_t), intent(in) :: qp
    !> The iterate.
    type(point_t), intent(in) :: now
    !> Residual of equilibrium (coarse%n) [force].
    real(dp), intent(in) :: r_balance(:)
    real(dp) :: largest
    largest = max(maxval(now%lambda), maxval([0.0_dp, abs(qp%coarse%resultant)]))
    is_balanced = .not. any(abs(r_balance) > balanced*largest)
  end function is_balanced

  !> Newton's step for given changes of the complementarity products.
  subroutine newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
    !> The contact problem.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all usable rows.
    class(compliance_t), intent(inout) :: compliance
    !> Layers softened by s/lambda.
    class(active_system_t), intent(in) :: system
    !> The iterate.
    type(point_t), intent(in) :: now
    !> Residual of the contact rows (n) [length].
    real(dp), intent(in) :: r_dual(:)
    !> Residual of equilibrium (coarse%n) [force].
    real(dp), intent(in) :: r_balance(:)
    !> Changes of `lambda_i s_i`, to first order (n) [force*length].
    real(dp), intent(in) :: product(:)
    !> The step.
    type(point_t), intent(inout) :: step
    step%lambda = 0
    call system%solve(qp, compliance, product/now%lambda - r_dual, -r_balance, step%lambda, step%alpha)
    step%s = (product - now%s*step%lambda)/now%lambda
  end subroutine newton_step

  !> Gondzio's centrality corrections: products that a longer step would make far too small or too large are brought
  !> back to their targets, while the step gets longer.
  subroutine correct_centrality(qp, compliance, system, now, wanted, step)
    !> The contact problem.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all usable rows.
    class(compliance_t), intent(inout) :: compliance
    !> Layers softened by s/lambda.
    class(active_system_t), intent(in) :: system
    !> The iterate.
    type(point_t), intent(in) :: now
    !> Targets of the products (n) [force*length].
    real(dp), intent(in) :: wanted(:)
    !> Corrected on return.
    type(point_t), intent(inout) :: step
    type(point_t) :: other
    real(dp), allocatable :: product(:), none(:)
    real(dp) :: length, longer, new
    integer :: k
    allocate (none(size(wanted)), source=0.0_dp)
    other = step
    length = min(1.0_dp, longest_step(now%lambda, step%lambda), longest_step(now%s, step%s))
    do k = 1, most_corrections
      if (length > long_enough) exit
      longer = min(1.0_dp, length + longer_by)
      product = (now%lambda + longer*step%lambda)*(now%s + longer*step%s)
      product = max(-largest_product*wanted, &
                    min(largest_product*wanted, max(smallest_product*wanted, product)) - product)
      call newton_step(qp, compliance, system, now, none, 0*now%alpha, product, other)
      other%lambda = other%lambda + step%lambda
      other%s = other%s + step%s
      other%alpha = other%alpha + step%alpha
      new = min(1.0_dp, longest_step(now%lambda, other%lambda), longest_step(now%s, other%s))
      if (new < length + worthwhile_gain*longer_by) exit
      length = new
      step = other
    end do
  end subroutine correct_centrality

  !> Length of a step to the boundary, at most 1/fraction_to_boundary.
  pure real(dp) function longest_step(x, step)
    !> Positive (n) [any].
    real(dp), intent(in) :: x(:)
    !> Direction (n) [as `x`].
    real(dp), intent(in) :: step(:)
    longest_step = 1/fraction_to_boundary
    if (any(step < 0)) longest_step = min(longest_step, minval(-x/step, mask=step < 0))
  end function longest_step
end module dotyk_scheme_interior_point
