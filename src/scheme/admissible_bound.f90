!> An error bound of the dual scheme that stays sharp as theta goes to 0, where the duality gap does not.
module dotyk_scheme_admissible_bound
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: admissible_bound

  !> The constant c above in the norm of the diagonal of C: the inverse of the least singular value of the rows, but for
  !> those that vanish. Eigenvalues of C are above 1/50 of its diagonal: rows have at least 1/50 of the weight of their
  !> neighbours (`dotyk_contact_dual_mortar`), and the least eigenvalue goes with the root of that.
  real(dp), parameter :: inverse_singular_value = 7

contains

  !> A bound of ||u - u_theta||_A: the norm of a displacement g, of self-equilibrated forces and rigid body modes, with
  !> `B g = y - theta m` on the active rows and `B g >= y` elsewhere. `huge` where g misses one of these conditions.
  !>
  !> u solves exactly the problem whose gaps are larger by B g, in which u_theta + g is as admissible as u_theta is
  !> here; both variational inequalities, each tested with the solution of the other, add up to
  !> `||u - u_theta||_A^2 <= A(u - u_theta, g)`, less `sum theta/w (lambda - lambda_theta)^2`. g comes from forces mu
  !> that solve the active system with its theta, so that B g is theta mu/w too large: that adds `theta mu^2/(4 w)`, the
  !> square completed. What rounding leaves of B g, r, adds `lambda.r` and the like with the forces of u_theta, which
  !> are equal to first order: `x^2 <= |g| x + sum theta mu^2/(4 w) + 2 lambda.r`. Where rows are linearly dependent, r
  !> has the rounding of y that no displacement reproduces. Then the term is (lambda_theta - lambda).r, and among the forces
  !> that belong to u_theta there are some within c x of lambda (Hoffman, J. Res. Nat. Bur. Standards 49, 1952), so that
  !> it adds c |r| to the bound: the smaller of both counts. [sqrt(energy)]
  real(dp) function admissible_bound(qp, compliance, theta, system, lambda, y, rounding) result(bound)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance of the bodies at these rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Linear system of the active set that the state came from.
    class(active_system_t), intent(in) :: system
    !> Contact forces, not negative (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> Penetrations (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Penetrations below this fraction of the largest initial one are rounding errors [].
    real(dp), intent(in) :: rounding
    real(dp), allocatable :: diagonal(:), residual(:), mu(:), beta(:), all_mu(:), z(:), motion(:), zero(:)
    real(dp) :: remainder, rounded
    logical, allocatable :: active(:)
    if (size(y) == 0) then
      bound = 0
      return
    end if
    bound = huge(bound)
    associate (row => system%row, weight => qp%weight)
      allocate (mu(size(row)), beta(qp%coarse%n), z(size(y)), motion(size(y)), zero(qp%coarse%n))
      mu = 0
      zero = 0
      residual = y(row) - theta(row)/weight(row)*lambda(row)
      call system%solve(qp, compliance, -residual, zero, mu, beta)
      allocate (all_mu(size(y)), source=0.0_dp)
      all_mu(row) = -mu
      call compliance%multiply(qp, all_mu, z)
      call qp%mode_displacement(beta, motion)
      allocate (active(size(y)), source=.false.)
      active(row) = .true.
      ! B g = z + G beta.
      if (any(.not. active .and. y > z + motion .and. y > rounding*maxval(abs(qp%initial_penetration)))) return
      remainder = sum(theta(row)/weight(row)*mu**2)/4
      bound = sqrt(max(0.0_dp, sum(all_mu*z) + dot_product(beta, qp%coarse%stiffness_forces(beta))))
      residual = z(row) + motion(row) - residual - theta(row)/weight(row)*mu
      rounded = huge(rounded)
      if (compliance%is_formed(qp)) then
        allocate (diagonal(size(row)))
        call compliance%get_diagonal(qp, row, diagonal)
        if (all(diagonal > 0)) rounded = inverse_singular_value*sqrt(sum(residual**2/diagonal))
      end if
      bound = bound + min(sqrt(remainder + 2*sum(abs(lambda(row)*residual))), sqrt(remainder) + rounded)
    end associate
  end function admissible_bound
end module dotyk_scheme_admissible_bound
