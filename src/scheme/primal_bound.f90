!> A bound of the error of displacements and contact forces of the primal engine, and the equilibrium of floating bodies
!> that it asks for.
module dotyk_scheme_primal_bound
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: largest_square, rounding
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_gap_closing, only: left_open
  use dotyk_scheme_proximal_system, only: proximal_system_t
  use dotyk_scheme_working_set, only: near_violation
  implicit none
  private
  public :: balance, error_bound, slack

  !> Fractions of the diagonal that are added where gaps are closed [].
  real(dp), parameter :: shift(2) = [1.0e-10_dp, 1.0e-4_dp]
  !> Pressures that would have to change by more than this fraction for equilibrium are not near it [].
  real(dp), parameter :: small_change = 0.1_dp

contains

  !> A bound of ||u - u_theta||_A [sqrt(energy)].
  !>
  !> With the residual r of the equilibrium of u and lambda, and a displacement g that closes gaps (`close_gaps`), u - g
  !> is admissible, and its duality gap with lambda has nothing but |r + K g|^2/2 and what g leaves of the
  !> complementarity, s. The energy is strongly convex, so that `||u - u_theta|| <= |g| + sqrt((|r| + |g|)^2 + 2 s)`.
  !> |r| comes from the preconditioner and its least eigenvalue. `huge` where other rows penetrate. The least of several
  !> g: none, and such that close gaps of dependent rows with more or less force.
  real(dp) function error_bound(system, weight, theta, is_tied, load, u, lambda, penetration) result(bound)
    class(proximal_system_t), intent(inout) :: system  !! The bodies and rows.
    real(dp), intent(in) :: weight(:)  !! Weights (n_rows) [area].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    logical, intent(in) :: is_tied(:)  !! Rows of ties (n_rows).
    real(dp), intent(in), contiguous :: load(:)  !! Loads (n) [force].
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    !> Forces, not negative on contact rows, in equilibrium with the loads of floating bodies (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    real(dp), intent(in) :: penetration(:)  !! Penetrations (n_rows) [length].
    type(error_t), allocatable :: error
    real(dp), allocatable :: r(:)
    real(dp) :: closed(size(penetration)), softness(size(penetration)), of_r, of_g, left
    logical :: chosen(size(penetration))
    integer :: k
    allocate (r(system%n))
    call system%strain_forces(u, r)
    r(:) = load - r
    call system%subtract_row_force(lambda, r)
    of_r = system%force_norm(r)
    bound = huge(bound)
    ! Ties that are not closed to the bit leave none.
    if (.not. any(is_tied)) bound = duality_gap(weight, theta, lambda/weight, penetration)
    if (bound < huge(bound)) bound = sqrt(of_r**2 + 2*bound)
    softness = theta/weight
    chosen = lambda > 0 .or. penetration > -slack(weight, theta, is_tied, lambda, penetration) .or. is_tied
    do k = 1, size(shift)
      call system%close_gaps(chosen, merge(penetration - softness*lambda, 0.0_dp, chosen), softness, shift(k), &
                             closed, of_g, &
                             error)
      if (allocated(error)) return
      left = left_open(weight, theta, is_tied, lambda, penetration, closed, &
                       .not. softness > system%smoother_compliance())
      if (max(of_g, left) < largest_square) bound = min(bound, of_g + sqrt((of_r + of_g)**2 + 2*left))
    end do
  end function error_bound

  !> Gaps of inactive rows that are so small that a displacement that closes those of active rows may close them.
  pure real(dp) function slack(weight, theta, is_tied, lambda, penetration)
    real(dp), intent(in) :: weight(:)  !! Weights (n) [area].
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n) [length/pressure].
    logical, intent(in) :: is_tied(:)  !! Rows of ties (n).
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n) [force].
    real(dp), intent(in) :: penetration(:)  !! Penetrations (n) [length].
    slack = near_violation*maxval([0.0_dp, abs(pack(penetration - theta/weight*lambda, lambda > 0 .or. is_tied))])
  end function slack

  !> Change the pressures of active rows and ties as little as the equilibrium of the floating bodies asks for.
  subroutine balance(qp, pressure)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    real(dp), intent(inout) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), allocatable :: g(:, :), weighted(:, :), values(:), vectors(:, :), missing(:), change(:), share(:)
    integer, allocatable :: row(:)
    type(error_t), allocatable :: error
    integer :: i, pass
    if (qp%coarse%n == 0) return
    row = pack([(i, i=1, size(pressure))], pressure > 0 .or. qp%is_tied)
    allocate (g(size(row), qp%coarse%n), values(qp%coarse%n), vectors(qp%coarse%n, qp%coarse%n), missing(qp%coarse%n))
    call qp%coarse%rows(row, g)
    ! Pressures change in proportion to themselves: none becomes tensile before the others do. Those of ties have any
    ! sign, and change in proportion to their mean.
    share = pressure(row)
    associate (tied => qp%is_tied(row))
      if (any(tied)) where (tied) share = sum(qp%weight(row)*abs(pressure(row)), mask=tied)/sum(qp%weight(row), &
                                                                                                mask=tied)
    end associate
    weighted = g*spread(qp%weight(row)*share, 2, size(g, 2))
    call symmetric_eigen(matmul(transpose(g), weighted), values, vectors, error)
    if (allocated(error)) return
    do pass = 1, 2
      call qp%mode_resultant(qp%weight*pressure, missing)
      missing = matmul(qp%coarse%resultant - missing, vectors)
      where (values > rounding*maxval(values))
        missing = missing/values
      else where
        missing = 0
      end where
      change = matmul(g, matmul(vectors, missing))
      if (.not. maxval([0.0_dp, abs(change)]) < small_change) return
      pressure(row) = merge(pressure(row) + share*change, max(0.0_dp, pressure(row)*(1 + change)), qp%is_tied(row))
    end do
  end subroutine balance
end module dotyk_scheme_primal_bound
