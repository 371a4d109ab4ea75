!> An error bound of the dual scheme that stays sharp as theta goes to 0, where the duality gap does not.
module dotyk_scheme_admissible_bound
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: admissible_bound

contains

  !> A bound of ||u - u_theta||_A: the norm of a displacement g, of self-equilibrated forces and rigid body modes, with
  !> `B g = y - theta m` on the active rows and `B g >= y` elsewhere. `huge` where g misses one of these conditions.
  !>
  !> u solves exactly the problem whose gaps are larger by B g, in which u_theta + g is as admissible as u_theta is
  !> here; both variational inequalities, each tested with the solution of the other, add up to
  !> `||u - u_theta||_A^2 <= A(u - u_theta, g)`, less `sum theta/w (lambda - lambda_theta)^2`. g comes from forces mu
  !> that solve the active system with its theta, so that B g is theta mu/w too large: that adds `theta mu^2/(4 w)`, the
  !> square completed. What rounding leaves of B g, r, adds `lambda.r` and the like with the forces of u_theta, which
  !> are equal to first order: `x^2 <= |g| x + sum theta mu^2/(4 w) + 2 lambda.r`. Ties are equations, for which it is
  !> `(lambda - lambda_theta).r`, to first order mu.r. [sqrt(energy)]
  real(dp) function admissible_bound(qp, with_springs, compliance, system, lambda, penetration) result(bound)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: with_springs  !! The same with springs on the modes: what the system is that of.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(active_system_t), intent(in) :: system  !! Linear system of the active set that the state came from.
    real(dp), intent(in) :: lambda(:)  !! Forces of contact, not negative, and of ties (n_rows) [force].
    real(dp), intent(in) :: penetration(:)  !! Penetrations (n_rows) [length].
    real(dp), allocatable :: residual(:), mu(:), beta(:), all_mu(:), z(:), motion(:), zero(:)
    real(dp) :: remainder
    logical, allocatable :: active(:)
    if (size(penetration) == 0) then
      bound = 0
      return
    end if
    bound = huge(bound)
    associate (row => system%row, weight => qp%weight)
      allocate (mu(size(row)), beta(qp%coarse%n), z(size(penetration)), motion(size(penetration)), zero(qp%coarse%n))
      mu = 0
      zero = 0
      residual = penetration(row) - qp%theta(row)/weight(row)*lambda(row)
      call system%solve(with_springs, compliance, -residual, zero, mu, beta)
      allocate (all_mu(size(penetration)), source=0.0_dp)
      all_mu(row) = -mu
      call compliance%multiply(qp, all_mu, z)
      call qp%mode_displacement(beta, motion)
      allocate (active(size(penetration)), source=.false.)
      active(row) = .true.
      ! B g = z + G beta.
      if (any(.not. active .and. penetration > z + motion .and. &
              penetration > rounding*maxval(abs(qp%initial_penetration)))) return
      remainder = 2*sum(abs(merge(mu, lambda(row), qp%is_tied(row))* &
                            (z(row) + motion(row) - residual - qp%theta(row)/weight(row)*mu))) &
                  + sum(qp%theta(row)/weight(row)*mu**2)/4
      bound = sqrt(max(0.0_dp, sum(all_mu*z) + dot_product(beta, qp%coarse%stiffness_forces(beta)))) + sqrt(remainder)
    end associate
  end function admissible_bound
end module dotyk_scheme_admissible_bound
