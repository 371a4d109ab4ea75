!> Newton's steps of the interior-point method, and their corrections towards the central path.
module dotyk_scheme_centrality
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: newton_step, correct_centrality, correct_and_shorten

  !> Fraction of the distance to the boundary that a step goes.
  real(dp), parameter, public :: fraction_to_boundary = 0.995_dp
  !> Centring parameter at least (Mehrotra's cubic rule gives 0 where the predictor reaches the solution).
  real(dp), parameter, public :: least_centring = 1.0e-6_dp
  !> Centrality corrections of a step at most, and where they reduce the centring parameter too: of elastic bodies, and
  !> of rigid ones, whose solutions take no products with compliances.
  integer, parameter :: most_corrections = 8, most_reductions = 12, most_reductions_of_rigid = 24
  real(dp), parameter :: longer_by = 0.5_dp  !! A correction aims at a step longer by this, and is taken
  real(dp), parameter :: worthwhile_gain = 0.1_dp  !! where it gains this fraction of it.
  real(dp), parameter :: long_enough = 0.95_dp  !! Steps longer than this are not corrected.
  real(dp), parameter :: long_enough_to_reduce = 0.9_dp  !! Steps longer than this aim at smaller products, by
  !> this factor, which is taken where the products that are left are fewer by these, of elastic and of rigid bodies.
  real(dp), parameter :: reduction = 0.3_dp, worthwhile_reduction = 0.95_dp, worthwhile_of_rigid = 0.99_dp
  !> Complementarity products between these multiples of their targets are not corrected.
  real(dp), parameter :: smallest_product = 0.5_dp, largest_product = 2.0_dp
  !> Parts of a correction that are tried, and a step is longer if it is by this factor.
  integer, parameter :: n_parts = 10
  real(dp), parameter :: is_longer = 1.01_dp

  type, public :: point_t  !! An iterate, or a step.
    real(dp), allocatable :: lambda(:)  !! Contact forces (n) [force].
    real(dp), allocatable :: s(:)  !! Gaps (n) [length].
    real(dp), allocatable :: alpha(:)  !! Amplitudes of the rigid body modes (coarse%n) [length].
    !> Of an iterate: rows of ties, whose forces may have any sign, without gaps (n).
    logical, allocatable :: is_tied(:)
  contains
    procedure :: over_force => point_over_force
    procedure :: longest_step => point_longest_step
  end type point_t

contains

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

  !> Gondzio's centrality corrections: products that a longer step would make far too small or too large are brought
  !> back to their targets, while the step gets longer.
  subroutine correct_centrality(qp, compliance, system, now, wanted, step)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    type(active_system_t), intent(in) :: system  !! Layers softened by s/lambda.
    type(point_t), intent(in) :: now  !! The iterate.
    real(dp), intent(in) :: wanted(:)  !! Targets of the products (n) [force*length].
    type(point_t), intent(inout) :: step  !! Corrected on return.
    type(point_t) :: other
    real(dp), allocatable :: product(:), none(:)
    real(dp) :: length, longer, new
    integer :: k
    allocate (none(size(wanted)), source=0.0_dp)
    other = step
    length = min(1.0_dp, now%longest_step(step))
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
      new = min(1.0_dp, now%longest_step(other))
      if (new < length + worthwhile_gain*longer_by) exit
      length = new
      step = other
    end do
  end subroutine correct_centrality

  !> The same for systems whose factors cost far more than solutions: corrections that lengthen the step, and where it
  !> is long enough smaller targets, as long as they leave less of the products. The part of each correction is taken
  !> that makes the step longest (Colombo, Gondzio, Comput. Optim. Appl. 41, 2008).
  subroutine correct_and_shorten(qp, compliance, system, now, target, sigma, step)
    type(contact_qp_t), intent(in) :: qp  !! The contact problem.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator, formed at all usable rows.
    type(active_system_t), intent(in) :: system  !! Layers softened by s/lambda.
    type(point_t), intent(in) :: now  !! The iterate.
    !> Products on the central path that have the sum of those of the iterate (n) [force*length].
    real(dp), intent(in) :: target(:)
    real(dp), intent(in) :: sigma  !! Centring parameter: targets of the step relative to these [].
    type(point_t), intent(inout) :: step  !! The predictor; corrected on return.
    type(point_t) :: correction, other
    real(dp), allocatable :: product(:), none(:)
    real(dp) :: length, aim, new, left, sigma_now, sigma_next, worthwhile
    logical :: failed, is_rigid
    integer :: k
    is_rigid = .not. compliance%has_entries()
    worthwhile = merge(worthwhile_of_rigid, worthwhile_reduction, is_rigid)
    allocate (none(size(target)), source=0.0_dp)
    correction = step
    product = sigma*target - step%lambda*step%s
    call newton_step(qp, compliance, system, now, none, 0*now%alpha, product, correction)
    call add_best_part(now, correction, step, length)
    sigma_now = sigma
    left = 1 - length*(1 - sigma_now)
    failed = .false.
    do k = 1, merge(most_reductions_of_rigid, most_reductions, is_rigid)
      sigma_next = sigma_now
      if (length > long_enough_to_reduce .or. failed) sigma_next = reduction*sigma_now
      if (sigma_next < least_centring) exit
      aim = min(1.0_dp, length + longer_by)
      product = (now%lambda + aim*step%lambda)*(now%s + aim*step%s)
      product = max(-largest_product*sigma_now*target, min(largest_product*sigma_next*target, &
                    max(smallest_product*sigma_next*target, product)) - product)
      call newton_step(qp, compliance, system, now, none, 0*now%alpha, product, correction)
      other = step
      call add_best_part(now, correction, other, new)
      if (1 - new*(1 - sigma_next) > worthwhile*left) then
        if (failed .or. sigma_next < sigma_now) exit
        ! A step that gets no longer may have smaller products.
        failed = .true.
        cycle
      end if
      failed = .false.
      length = new
      left = 1 - new*(1 - sigma_next)
      sigma_now = sigma_next
      step = other
    end do
  end subroutine correct_and_shorten

  !> Add the part of a correction that makes the step longest.
  pure subroutine add_best_part(now, correction, step, length)
    type(point_t), intent(in) :: now  !! The iterate.
    type(point_t), intent(in) :: correction  !! The correction.
    type(point_t), intent(inout) :: step  !! The step; corrected on return.
    real(dp), intent(out) :: length  !! Its length, at most 1 [].
    real(dp) :: best, longest(n_parts)
    integer :: k
    longest = 1/fraction_to_boundary
    call shorten(merge(huge(best)/2, now%lambda, now%is_tied), step%lambda, correction%lambda, longest)
    call shorten(now%s, step%s, correction%s, longest)
    length = 0
    best = 1
    do k = n_parts, 1, -1
      if (min(1.0_dp, longest(k)) > is_longer*length) then
        length = min(1.0_dp, longest(k))
        best = real(k, dp)/n_parts
      end if
      if (length > 1/is_longer) exit
    end do
    step%lambda = step%lambda + best*correction%lambda
    step%s = step%s + best*correction%s
    step%alpha = step%alpha + best*correction%alpha
  end subroutine add_best_part

  !> Shorten steps with parts of a correction to the boundary. All parts at once, and without a quotient where a step
  !> stays inside: this is done after each solution.
  pure subroutine shorten(x, step, correction, longest)
    real(dp), intent(in) :: x(:)  !! Positive (n) [any].
    real(dp), intent(in) :: step(:), correction(:)  !! Direction, and its correction (n) [as `x`].
    real(dp), intent(inout) :: longest(:)  !! Length of the steps with each part of the correction (n_parts) [].
    real(dp) :: direction
    integer :: i, k
    do i = 1, size(x)
      do k = 1, n_parts
        direction = step(i) + (real(k, dp)/n_parts)*correction(i)
        ! The smallest quotient must not be missed by rounding.
        if (x(i) < -(1 + 4*epsilon(direction))*longest(k)*direction) longest(k) = min(longest(k), -x(i)/direction)
      end do
    end do
  end subroutine shorten

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
end module dotyk_scheme_centrality
