!> Error of displacements and contact forces of distributed bodies, as in `dotyk_scheme_primal_system`: the energy norm
!> of the residual, by the preconditioner without contact and its least Ritz value, and what closes the gaps that are
!> left. It rests on the Ritz value: no guarantee, as there.
module dotyk_distributed_error_bound
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_distributed_contact_rows, only: contact_rows_t
  use dotyk_distributed_system, only: distributed_system_t
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_gap_closing, only: left_open
  implicit none
  private
  public :: error_of

  !> Inactive rows whose gaps are smaller than this multiple of what active rows miss are closed with them.
  real(dp), parameter :: nearly_closed = 4
  !> Fractions of the diagonal that are added where gaps are closed [].
  real(dp), parameter :: shift(2) = [1.0e-10_dp, 1.0e-4_dp]
  !> Bounds beyond this are none: squares of larger numbers overflow.
  real(dp), parameter :: largest = 1.0e150_dp

contains

  !> Bound and energy.
  subroutine error_of(system, weight, theta, lambda, y, u, r, bound, energy, terms)
    !> The systems.
    type(distributed_system_t), intent(inout), target :: system
    !> Weights (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Contact forces (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> Penetrations (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Displacements (n) [length].
    real(dp), intent(inout), contiguous :: u(:)
    !> Work array (n) [force].
    real(dp), intent(inout), contiguous :: r(:)
    !> ||u - u_theta||_A at most; `huge` where there is none [sqrt(energy)].
    real(dp), intent(out) :: bound
    !> F_theta(u) [energy].
    real(dp), intent(out) :: energy
    !> Its strain energy and the work of the loads (2) [energy].
    real(dp), allocatable, intent(out) :: terms(:)
    type(error_t), allocatable :: error
    type(contact_rows_t), pointer :: rows
    real(dp), allocatable :: resultant(:)
    real(dp) :: closed(size(y)), of_r, of_g, left, slack
    logical :: is_stiff(size(y)), chosen(size(y))
    integer :: k
    call system%strain_forces(u, r)
    associate (k => system%stiffness)
      terms = system%product(u, k%lift) + [k%lift_energy, k%lift_work] + &
        [system%product(u, r)/2, system%product(u, k%load)]
    end associate
    energy = terms(1) - terms(2) + sum(weight*max(0.0_dp, y)**2/theta, mask=theta > 0)/2
    r(:) = system%stiffness%load - r
    call system%subtract_row_force(lambda, r)
    call system%remove_modes(r, resultant)
    of_r = system%force_norm(r)
    bound = duality_gap(weight, theta, lambda/weight, y)
    if (bound < huge(bound)) bound = sqrt(of_r**2 + 2*bound)
    is_stiff = .not. theta/weight > system%row_compliance()
    slack = nearly_closed*maxval([0.0_dp, abs(pack(y - theta/weight*lambda, lambda > 0))])
    chosen = lambda > 0 .or. y > -slack
    rows => system%rows()
    associate (softness => theta/weight)
      do k = 1, size(shift)
        call rows%close_gaps(chosen, merge(y - softness*lambda, 0.0_dp, chosen), softness, shift(k), closed, of_g, &
                               error)
        if (allocated(error)) return
        left = left_open(weight, theta, lambda, y, closed, is_stiff)
        if (max(of_g, left) < largest) bound = min(bound, of_g + sqrt((of_r + of_g)**2 + 2*left))
      end do
    end associate
  end subroutine error_of
end module dotyk_distributed_error_bound
