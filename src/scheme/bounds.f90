!> How far an iterate can be from the solution of the penalty problem (19): three bounds in the energy norm
!> (docs/theory.md).
module dotyk_scheme_bounds
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use dotyk_base_kinds, only: dp
  implicit none
  private
  public :: duality_gap, contraction, contraction_of_paper, gamma_limit, gamma_limit_of_paper, bound_of_paper

contains

  !> G >= ||u - u_theta||_A^2 for an iterate with state m >= 0 [energy]; guaranteed, and costs no solve.
  !>
  !> `G = sum w [(y^+)^2/(2 theta) + theta m^2/2 - m y]`, evaluated as the squares that it is made of; `huge` where some
  !> m < 0, because the bound does not hold there, and where y > 0 with theta = 0. Free bodies must be in equilibrium
  !> with m.
  pure real(dp) function duality_gap(weight, theta, m, y) result(gap)
    !> Weights of the contact points (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> State (n_rows) [pressure].
    real(dp), intent(in) :: m(:)
    !> B u - d (n_rows) [length].
    real(dp), intent(in) :: y(:)
    integer :: i
    gap = 0
    do i = 1, size(m)
      if (m(i) < 0) then
        gap = huge(gap)
        return
      else if (y(i) > 0 .and. .not. theta(i) > 0) then
        gap = huge(gap)
        return
      else if (y(i) > 0) then
        gap = gap + weight(i)*(y(i) - theta(i)*m(i))**2/(2*theta(i))
      else
        gap = gap + weight(i)*m(i)*(theta(i)*m(i)/2 + abs(y(i)))
      end if
    end do
  end function duality_gap

  !> The factor by which a step with relaxation gamma shrinks the error at least, sharp: max(|1-gamma|, |1-gamma(1+L)|).
  elemental real(dp) function contraction(gamma, lambda_max) result(q)
    !> Relaxation parameter [].
    real(dp), intent(in) :: gamma
    !> L, the largest eigenvalue of Theta^{-1} C W [].
    real(dp), intent(in) :: lambda_max
    q = max(abs(1 - gamma), abs(1 - gamma*(1 + lambda_max)))
  end function contraction

  !> Relaxation parameters below this converge (sharp).
  elemental real(dp) function gamma_limit(lambda_max) result(limit)
    !> L, or an upper estimate [].
    real(dp), intent(in) :: lambda_max
    limit = 2/(1 + lambda_max)
  end function gamma_limit

  !> gamma_2 of Theorem 3 with the constants of the energy norm, B = M = 1 and D = L.
  elemental real(dp) function gamma_limit_of_paper(lambda_max) result(limit)
    !> L, or an upper estimate [].
    real(dp), intent(in) :: lambda_max
    limit = 2/(1 + lambda_max)**2
  end function gamma_limit_of_paper

  !> q of (40) with the same constants; NaN where gamma is not in (0, gamma_2).
  elemental real(dp) function contraction_of_paper(gamma, lambda_max) result(q)
    !> Relaxation parameter [].
    real(dp), intent(in) :: gamma
    !> L, the largest eigenvalue of Theta^{-1} C W [].
    real(dp), intent(in) :: lambda_max
    if (gamma > 0 .and. gamma < gamma_limit_of_paper(lambda_max)) then
      q = sqrt(1 - gamma*(2 - gamma*(1 + lambda_max)**2))
    else
      q = ieee_value(q, ieee_quiet_nan)
    end if
  end function contraction_of_paper

  !> (41): q/(1-q) ||u^{k+1} - u^k||_A; NaN where (40) gives no q.
  elemental real(dp) function bound_of_paper(gamma, lambda_max, increment) result(bound)
    !> Relaxation parameter [].
    real(dp), intent(in) :: gamma
    !> L, the largest eigenvalue of Theta^{-1} C W [].
    real(dp), intent(in) :: lambda_max
    !> ||u^{k+1} - u^k||_A [sqrt(energy)].
    real(dp), intent(in) :: increment
    real(dp) :: q, one_minus_q
    q = contraction_of_paper(gamma, lambda_max)
    ! 1 - q without cancellation: (1 - q^2)/(1 + q).
    one_minus_q = gamma*(2 - gamma*(1 + lambda_max)**2)/(1 + q)
    bound = q/one_minus_q*increment
  end function bound_of_paper
end module dotyk_scheme_bounds
