!> Detection of mechanisms in a stiffness that springs (`dotyk_linalg_springs`) regularize.
module dotyk_response_regularization
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t, strain_energy
  implicit none
  private
  public :: is_mechanism

  !> A displacement with less than this part of the energy that its nodes would have one by one, all others at rest,
  !> strains nothing. Elements know it to the square of round-off: mechanisms have 1e-25 and less, a bar 1000 times
  !> longer than thick 1e-13, a ribbon of 10000 by 100 by 1 3e-17.
  real(dp), parameter :: least_energy = 1.0e-20_dp

contains

  !> Whether a displacement is a mechanism: it moves parts of the body against each other without strain.
  logical function is_mechanism(body, diagonal, fixed, spring, x)
    type(body_t), intent(in) :: body  !! Assembled.
    real(dp), intent(in) :: diagonal(:)  !! Diagonal of the stiffness, springs included (n_equations) [force/length].
    integer, intent(in) :: fixed(:)  !! Equations with springs (n).
    real(dp), intent(in) :: spring(:)  !! The springs (n) [force/length].
    real(dp), intent(in) :: x(:)  !! The displacement (n_equations) [any].
    real(dp), allocatable :: u(:, :)
    real(dp) :: most
    is_mechanism = .true.
    most = maxval(abs(x))
    if (.not. ieee_is_finite(most) .or. .not. most > 0) return
    allocate (u(body%dimension, body%mesh%n_nodes()))
    call body%constraint%expand(x/most, u, .false.)
    is_mechanism = .not. 2*strain_energy(body, u) + sum(spring*(x(fixed)/most)**2) > &
                   least_energy*sum(diagonal*(x/most)**2)
  end function is_mechanism
end module dotyk_response_regularization
