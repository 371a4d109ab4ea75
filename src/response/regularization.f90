!> Regularization of the stiffness of a floating body by springs at fixing degrees of freedom, and detection of
!> mechanisms.
!>
!> Springs at as many unknowns as there are rigid body modes hold the body in a statically determinate way: forces in
!> equilibrium leave the springs without force, so that the displacements are exact up to a rigid body motion (as in
!> FETI: Farhat, Roux 1991).
module dotyk_response_regularization
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: choose_fixing_equations, add_springs, is_mechanism

  !> A displacement with less than this part of the energy that its nodes would have one by one, all others at rest,
  !> strains nothing. Elements know it to the square of round-off: mechanisms have 1e-25 and less, a bar 1000 times
  !> longer than thick 1e-13, a ribbon of 10000 by 100 by 1 3e-17.
  real(dp), parameter :: least_energy = 1.0e-20_dp
  !> A pivot must be larger than the best one so far by this factor, so that the choice does not depend on round-off.
  real(dp), parameter :: pivot_margin = 1.001_dp

contains

  !> The equations to fix: those in which the modes are most independent, by Gram-Schmidt on the rows with pivoting.
  pure subroutine choose_fixing_equations(mode, fixed)
    !> Orthonormal modes over the equations (n_equations, n_modes) [].
    real(dp), intent(in) :: mode(:, :)
    !> Equations, one for each mode (n_modes).
    integer, allocatable, intent(out) :: fixed(:)
    real(dp), allocatable :: remainder(:, :)
    real(dp) :: best, now, row(size(mode, 2))
    integer :: i, k
    allocate (fixed(size(mode, 2)))
    remainder = transpose(mode)
    do k = 1, size(fixed)
      best = 0
      fixed(k) = 1
      do i = 1, size(remainder, 2)
        now = sum(remainder(:, i)**2)
        if (now <= best*pivot_margin) cycle
        best = now
        fixed(k) = i
      end do
      if (.not. best > 0) return
      row = remainder(:, fixed(k))/sqrt(best)
      do i = 1, size(remainder, 2)
        remainder(:, i) = remainder(:, i) - dot_product(row, remainder(:, i))*row
      end do
    end do
  end subroutine choose_fixing_equations

  !> Add springs to some equations: each as stiff as the diagonal entry of its equation.
  pure subroutine add_springs(matrix, fixed, spring)
    !> The stiffness [force/length].
    type(sparse_symmetric_t), intent(inout) :: matrix
    !> Equations (n).
    integer, intent(in) :: fixed(:)
    !> The springs (n) [force/length].
    real(dp), allocatable, intent(out) :: spring(:)
    integer(int64) :: place
    integer :: k
    allocate (spring(size(fixed)))
    do k = 1, size(fixed)
      place = matrix%column_start(fixed(k)) + 1
      spring(k) = matrix%value(place)
      matrix%value(place) = 2*spring(k)
    end do
  end subroutine add_springs

  !> Whether a displacement is a mechanism: it moves parts of the body against each other without strain.
  logical function is_mechanism(body, diagonal, fixed, spring, x)
    !> Assembled.
    type(body_t), intent(in) :: body
    !> Diagonal of the stiffness, springs included (n_equations) [force/length].
    real(dp), intent(in) :: diagonal(:)
    !> Equations with springs (n).
    integer, intent(in) :: fixed(:)
    !> The springs (n) [force/length].
    real(dp), intent(in) :: spring(:)
    !> The displacement (n_equations) [any].
    real(dp), intent(in) :: x(:)
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
