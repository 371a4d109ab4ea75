!> The interior-point method, for scenes in which active sets would come back: nearly rigid bodies on many contact
!> points, most of which have forces that others could have as well.
!>
!> With gaps `s = M lambda - G alpha - y >= 0` at the contact points, forces `lambda >= 0` and equilibrium
!> `G^T lambda = e`, Newton's method goes along the points with `lambda_i s_i = mu w_i` towards mu = 0 (Mehrotra's
!> predictor and corrector, SIAM J. Optim. 2, 1992; Gondzio's correctors of centrality, Comput. Optim. Appl. 6, 1996, as
!> solutions cost little against factorizations). It takes ten to forty linear systems, whatever the number of points:
!> each is that of an active set of all points with softer layers, `s_i/lambda_i` in addition to theirs. In the end
!> forces or gaps are next to nothing at each point, which says what is closed.
module dotyk_scheme_interior
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: interior_points

  !> Linear systems at most.
  integer, parameter :: most_steps = 60
  !> Where it ends: gaps times forces, as a part of what they were at first; resultants, as a part of the loads.
  real(dp), parameter :: least_product = 1.0e-14_dp, balanced = 1.0e-9_dp
  !> Part of the way to the boundary that a step goes.
  real(dp), parameter :: most_of_the_way = 0.995_dp
  !> Steps are centred so often at most, as long as each goes farther by this part of what it tries; longer ones are
  !> not.
  integer, parameter :: most_corrections = 8
  real(dp), parameter :: worth_it = 0.1_dp, farther_by = 0.5_dp, far_enough = 0.95_dp
  !> Products between these parts of those that are wanted are left alone.
  real(dp), parameter :: smallest_product = 0.5_dp, largest_product = 2.0_dp

  !> A point inside.
  type :: point_t
    !> Forces (n), gaps (n), amplitudes (coarse%n).
    real(dp), allocatable :: lambda(:), s(:), alpha(:)
  end type point_t

contains

  !> Forces and amplitudes next to the solution, and what is closed there.
  subroutine interior_points(qp, compliance, theta, system, soft, usable, lambda, alpha, closed, steps, error)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Another one on return.
    class(active_system_t), intent(inout) :: system
    !> How much points yield to forces on them, about (n_rows) [length/force].
    real(dp), intent(in) :: soft(:)
    !> Points that may have a force (n_rows).
    logical, intent(in) :: usable(:)
    !> (n_rows) [force], (coarse%n) [length].
    real(dp), intent(out) :: lambda(:), alpha(:)
    !> (n_rows).
    logical, intent(out) :: closed(:)
    !> Linear systems that were solved.
    integer, intent(out) :: steps
    !> Out of memory.
    type(error_t), allocatable, intent(out) :: error
    type(point_t) :: now, step
    real(dp), allocatable :: part(:), r_dual(:), r_balance(:), product(:)
    integer, allocatable :: row(:)
    real(dp) :: mu, mu_ahead, sigma, along, energy
    integer :: i, n
    row = pack([(i, i=1, size(usable))], usable)
    n = size(row)
    lambda = 0
    alpha = 0
    closed = .false.
    steps = 0
    if (n == 0) return
    ! Products of forces and gaps go with the areas.
    part = qp%weight(row)/sum(qp%weight(row))
    call begin(qp, compliance, theta, system, usable, row, soft, part, now, error)
    if (allocated(error)) return
    allocate (step%lambda(n), step%s(n), step%alpha(qp%coarse%n))
    do steps = 1, most_steps
      if (interrupted()) exit
      call residuals(qp, compliance, theta, row, now, r_dual, r_balance)
      mu = sum(now%lambda*now%s)
      energy = abs(sum(now%lambda*(now%s + qp%initial_penetration(row)))) + abs(sum(now%alpha*qp%coarse%resultant))
      if (mu <= least_product*energy .and. is_small(qp, now, r_balance)) exit
      call make_system(qp, compliance, theta, system, usable, row, now%s/now%lambda, error)
      if (allocated(error)) return
      product = -now%lambda*now%s
      call newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
      along = min(way(now%lambda, step%lambda), way(now%s, step%s))
      mu_ahead = sum((now%lambda + along*step%lambda)*(now%s + along*step%s))
      sigma = min(1.0_dp, max(1.0e-6_dp, (mu_ahead/mu)**3))
      product = sigma*mu*part - now%lambda*now%s - step%lambda*step%s
      call newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
      call centre(qp, compliance, system, now, sigma*mu*part, step)
      along = min(1.0_dp, most_of_the_way*min(way(now%lambda, step%lambda), way(now%s, step%s)))
      now%lambda = now%lambda + along*step%lambda
      now%s = now%s + along*step%s
      now%alpha = now%alpha + along*step%alpha
      ! Rounding errors end it too.
      if (along < 1.0e-8_dp) exit
    end do
    steps = min(steps, most_steps)
    lambda(row) = now%lambda
    alpha = now%alpha
    closed(row) = soft(row)*now%lambda > now%s
  end subroutine interior_points

  !> The first point: as if all contact points stuck to foundations, forces and gaps then shifted to be positive.
  subroutine begin(qp, compliance, theta, system, usable, row, soft, part, now, error)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    class(active_system_t), intent(inout) :: system
    logical, intent(in) :: usable(:)
    integer, intent(in) :: row(:)
    !> (n_rows).
    real(dp), intent(in) :: soft(:)
    !> Share of each point in all areas (size of row).
    real(dp), intent(in) :: part(:)
    type(point_t), intent(out) :: now
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: force, gap, product
    allocate (now%lambda(size(row)), now%alpha(qp%coarse%n))
    call make_system(qp, compliance, theta, system, usable, row, soft(row), error)
    if (allocated(error)) return
    now%lambda = 0
    call system%solve(qp, compliance, qp%initial_penetration(row), qp%coarse%resultant, now%lambda, now%alpha)
    now%s = -soft(row)*now%lambda
    ! Forces go with the areas, gaps are the same everywhere.
    force = max(0.0_dp, -1.5_dp*minval(now%lambda/part))
    gap = max(0.0_dp, -1.5_dp*minval(now%s))
    now%lambda = now%lambda + force*part
    now%s = now%s + gap
    product = sum(now%lambda*now%s)
    force = max(product/(2*max(tiny(1.0_dp), sum(part*now%s))), tiny(1.0_dp))
    gap = max(product/(2*max(tiny(1.0_dp), sum(now%lambda))), tiny(1.0_dp))
    now%lambda = now%lambda + force*part
    now%s = now%s + gap
  end subroutine begin

  !> The system with layers that yield more than the true ones.
  subroutine make_system(qp, compliance, theta, system, usable, row, yields, error)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    class(active_system_t), intent(inout) :: system
    logical, intent(in) :: usable(:)
    integer, intent(in) :: row(:)
    !> By that much (size of row) [length/force].
    real(dp), intent(in) :: yields(:)
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: softer(qp%n_rows)
    softer = theta
    softer(row) = theta(row) + qp%weight(row)*yields
    call system%init(qp, compliance, softer, usable, error)
  end subroutine make_system

  !> What is missing: M lambda - G alpha - y - s, and G^T lambda - e.
  subroutine residuals(qp, compliance, theta, row, now, r_dual, r_balance)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    integer, intent(in) :: row(:)
    type(point_t), intent(in) :: now
    real(dp), allocatable, intent(out) :: r_dual(:), r_balance(:)
    real(dp), allocatable :: lambda(:), z(:), motion(:)
    allocate (lambda(qp%n_rows), z(qp%n_rows), motion(qp%n_rows), source=0.0_dp)
    allocate (r_balance(qp%coarse%n))
    lambda(row) = now%lambda
    call compliance%multiply(qp, lambda, z)
    call qp%mode_displacement(now%alpha, motion)
    r_dual = z(row) + theta(row)/qp%weight(row)*now%lambda - motion(row) - qp%initial_penetration(row) - now%s
    call qp%mode_resultant(lambda, r_balance)
    r_balance = r_balance + qp%coarse%stiffness_forces(now%alpha) - qp%coarse%resultant
  end subroutine residuals

  !> Whether forces balance the loads.
  logical function is_small(qp, now, r_balance)
    type(contact_qp_t), intent(in) :: qp
    type(point_t), intent(in) :: now
    real(dp), intent(in) :: r_balance(:)
    is_small = .not. any(abs(r_balance) > balanced*max(maxval(now%lambda), maxval([0.0_dp, abs(qp%coarse%resultant)])))
  end function is_small

  !> Newton's step for given changes of the products of forces and gaps.
  subroutine newton_step(qp, compliance, system, now, r_dual, r_balance, product, step)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    class(active_system_t), intent(in) :: system
    type(point_t), intent(in) :: now
    real(dp), intent(in) :: r_dual(:), r_balance(:)
    !> Changes, to first order (size of now%lambda) [force*length].
    real(dp), intent(in) :: product(:)
    type(point_t), intent(inout) :: step
    step%lambda = 0
    call system%solve(qp, compliance, product/now%lambda - r_dual, -r_balance, step%lambda, step%alpha)
    step%s = (product - now%s*step%lambda)/now%lambda
  end subroutine newton_step

  !> Change a step while it can go farther: products that would become far too small or too large there are brought
  !> back.
  subroutine centre(qp, compliance, system, now, wanted, step)
    type(contact_qp_t), intent(in) :: qp
    class(compliance_t), intent(inout) :: compliance
    class(active_system_t), intent(in) :: system
    type(point_t), intent(in) :: now
    !> What the products should become (size of now%lambda) [force*length].
    real(dp), intent(in) :: wanted(:)
    type(point_t), intent(inout) :: step
    type(point_t) :: other
    real(dp), allocatable :: product(:), none(:)
    real(dp) :: along, farther, new
    integer :: k
    allocate (none(size(wanted)), source=0.0_dp)
    other = step
    along = min(1.0_dp, min(way(now%lambda, step%lambda), way(now%s, step%s)))
    do k = 1, most_corrections
      if (along > far_enough) exit
      farther = min(1.0_dp, along + farther_by)
      product = (now%lambda + farther*step%lambda)*(now%s + farther*step%s)
      product = max(-largest_product*wanted, min(largest_product*wanted, max(smallest_product*wanted, product)) - &
        product)
      call newton_step(qp, compliance, system, now, none, 0*now%alpha, product, other)
      other%lambda = other%lambda + step%lambda
      other%s = other%s + step%s
      other%alpha = other%alpha + step%alpha
      new = min(1.0_dp, min(way(now%lambda, other%lambda), way(now%s, other%s)))
      if (new < along + worth_it*farther_by) exit
      along = new
      step = other
    end do
  end subroutine centre

  !> How far a step may go, at most 1/most_of_the_way.
  pure real(dp) function way(x, step)
    !> Positive.
    real(dp), intent(in) :: x(:), step(:)
    way = 1/most_of_the_way
    if (any(step < 0)) way = min(way, minval(-x/step, mask=step < 0))
  end function way
end module dotyk_scheme_interior
