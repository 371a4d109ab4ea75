!> How far an iterate can be from the solution of the penalty problem (19), and how fast the general iteration (32)
!> comes nearer: the duality gap, and the numbers of Theorem 3 and Theorem 4 (docs/theory.md). Without contact rows, D =
!> 0, they are those of Theorem 2 for equation (27) and the iteration (28).
module dotyk_scheme_bounds
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  implicit none
  private

  !> Constants of the forms of the general iteration (32), in one norm of the displacements, and the numbers that follow
  !> from them. For G = A in the energy norm: B = M = B~ = M~ = 1, D = L.
  type, public :: iteration_constants_t
    real(dp) :: coercivity = 1  !! B of (15): A(u,u) >= B ||u||^2 [].
    real(dp) :: continuity = 1  !! M of (14): abs(A(u,v)) <= M ||u|| ||v|| [].
    real(dp) :: coercivity_g = 1  !! B~ of (31): G(u,u) >= B~ ||u||^2 [].
    real(dp) :: continuity_g = 1  !! M~ of (30): abs(G(u,v)) <= M~ ||u|| ||v|| [].
    real(dp) :: penalty = 0  !! D of (22): abs(j''(u,v,w)) <= D ||v|| ||w|| [].
    !> Lambda, in no theorem of the paper: A(v,v) + j''(u,v,v) <= Lambda G(v,v) []. Where A and G are symmetric, the
    !> sharp numbers follow from it.
    real(dp) :: smoothness = 1
    !> Factor of the best gamma; below 1 where Lambda has no margin: errors at both ends of the spectrum would decay
    !> equally slowly, and those at the upper end need not [].
    real(dp) :: damping = 1
  contains
    procedure :: contraction => constants_contraction
    procedure :: gamma_limit => constants_gamma_limit
    procedure :: best_gamma => constants_best_gamma
    procedure :: contraction_of_paper => constants_contraction_of_paper
    procedure :: gain_of_paper => constants_gain_of_paper
    procedure :: gamma_limit_of_paper => constants_gamma_limit_of_paper
    procedure :: gamma_of_paper => constants_gamma_of_paper
    procedure :: bound_of_paper => constants_bound_of_paper
  end type iteration_constants_t

  public :: duality_gap, neumann_constants

contains

  !> Constants of G = A in the energy norm.
  elemental type(iteration_constants_t) function neumann_constants(lambda_max) result(constants)
    real(dp), intent(in) :: lambda_max  !! L, the largest eigenvalue of Theta^{-1} C W, or an upper estimate [].
    constants%penalty = lambda_max
    constants%smoothness = 1 + lambda_max
  end function neumann_constants

  !> G >= ||u - u_theta||_A^2 for an iterate with state m >= 0 [energy]; guaranteed, and costs no solve.
  !>
  !> `G = sum w [(y^+)^2/(2 theta) + theta m^2/2 - m y]`, evaluated as the squares that it is made of; `huge` where some
  !> m < 0, because the bound does not hold there, and where y > 0 with theta = 0. Free bodies must be in equilibrium
  !> with m.
  pure real(dp) function duality_gap(weight, theta, pressure, penetration) result(gap)
    real(dp), intent(in) :: weight(:)  !! Weights of the contact points (n_rows) [area].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: pressure(:)  !! State (n_rows) [pressure].
    real(dp), intent(in) :: penetration(:)  !! B u - d (n_rows) [length].
    integer :: i
    gap = 0
    do i = 1, size(pressure)
      if (pressure(i) < 0) then
        gap = huge(gap)
        return
      else if (penetration(i) > 0 .and. .not. theta(i) > 0) then
        gap = huge(gap)
        return
      else if (penetration(i) > 0) then
        gap = gap + weight(i)*(penetration(i) - theta(i)*pressure(i))**2/(2*theta(i))
      else
        gap = gap + weight(i)*pressure(i)*(theta(i)*pressure(i)/2 + abs(penetration(i)))
      end if
    end do
  end function duality_gap

  !> The factor by which a step shrinks the error in the norm of G at least, sharp: max(|1 - gamma mu|, |1 - gamma
  !> Lambda|), mu = B/M~; the eigenvalues of the step, equation (35), are between these, because every mean of j'' is
  !> symmetric.
  elemental real(dp) function constants_contraction(self, gamma) result(q)
    class(iteration_constants_t), intent(in) :: self
    real(dp), intent(in) :: gamma  !! Relaxation parameter [].
    q = max(abs(1 - gamma*self%coercivity/self%continuity_g), abs(1 - gamma*self%smoothness))
  end function constants_contraction

  !> Relaxation parameters below 2/Lambda converge (sharp).
  elemental real(dp) function constants_gamma_limit(self) result(limit)
    class(iteration_constants_t), intent(in) :: self
    limit = 2/self%smoothness
  end function constants_gamma_limit

  !> 2/(mu + Lambda), for which the sharp factor is least, times the damping.
  elemental real(dp) function constants_best_gamma(self) result(gamma)
    class(iteration_constants_t), intent(in) :: self
    gamma = self%damping*2/(self%coercivity/self%continuity_g + self%smoothness)
  end function constants_best_gamma

  !> gamma_2 = 2 B B~/(M+D)^2 of Theorem 3, and with D = 0 of Theorem 2: positive values below it converge, equation
  !> (39).
  elemental real(dp) function constants_gamma_limit_of_paper(self) result(limit)
    class(iteration_constants_t), intent(in) :: self
    limit = 2*self%coercivity*self%coercivity_g/(self%continuity + self%penalty)**2
  end function constants_gamma_limit_of_paper

  !> The best value of Theorem 4, gamma_2/2, for which q of (40) is least.
  elemental real(dp) function constants_gamma_of_paper(self) result(gamma)
    class(iteration_constants_t), intent(in) :: self
    gamma = self%gamma_limit_of_paper()/2
  end function constants_gamma_of_paper

  !> q of equation (40), which follows from equations (36), (37), (38); NaN where gamma is not in (0, gamma_2).
  elemental real(dp) function constants_contraction_of_paper(self, gamma) result(q)
    class(iteration_constants_t), intent(in) :: self
    real(dp), intent(in) :: gamma  !! Relaxation parameter [].
    real(dp) :: limit
    q = ieee_value(q, ieee_quiet_nan)
    limit = self%gamma_limit_of_paper()
    if (ieee_is_nan(gamma) .or. ieee_is_nan(limit)) return
    if (gamma > 0 .and. gamma < limit) q = sqrt(1 - self%gain_of_paper(gamma))
  end function constants_contraction_of_paper

  !> 1 - q^2 of equation (40).
  elemental real(dp) function constants_gain_of_paper(self, gamma) result(gain)
    class(iteration_constants_t), intent(in) :: self
    real(dp), intent(in) :: gamma  !! Relaxation parameter [].
    gain = gamma*(2*self%coercivity - gamma*(self%continuity + self%penalty)**2/self%coercivity_g)/self%continuity_g
  end function constants_gain_of_paper

  !> The bound (41): q/(1-q) ||u^{k+1} - u^k||_G; NaN where (40) gives no q.
  elemental real(dp) function constants_bound_of_paper(self, gamma, increment) result(bound)
    class(iteration_constants_t), intent(in) :: self
    real(dp), intent(in) :: gamma  !! Relaxation parameter [].
    real(dp), intent(in) :: increment  !! ||u^{k+1} - u^k||_G [sqrt(energy)].
    real(dp) :: q
    q = self%contraction_of_paper(gamma)
    ! 1 - q without cancellation: (1 - q^2)/(1 + q).
    bound = q*(1 + q)/self%gain_of_paper(gamma)*increment
  end function constants_bound_of_paper
end module dotyk_scheme_bounds
