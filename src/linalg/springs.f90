!> Regularization of a singular matrix by springs at a few equations.
!>
!> Springs at as many equations as there are null vectors (rigid body modes) hold them in a statically determinate way:
!> right-hand sides in equilibrium leave the springs without force, so that solutions are exact up to null vectors (as
!> in FETI: Farhat, Roux 1991).
module dotyk_linalg_springs
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: half_digits
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: choose_fixing_equations, add_springs

contains

  !> The equations to fix: those in which the modes are most independent, by Gram-Schmidt on the rows with pivoting.
  pure subroutine choose_fixing_equations(mode, fixed)
    real(dp), intent(in) :: mode(:, :)  !! Orthonormal modes over the equations (n_equations, n_modes) [].
    integer, allocatable, intent(out) :: fixed(:)  !! Equations, one for each mode (n_modes).
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
        ! The choice does not depend on round-off.
        if (now <= best*(1 + half_digits)) cycle
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
    type(sparse_symmetric_t), intent(inout) :: matrix  !! The stiffness [force/length].
    integer, intent(in) :: fixed(:)  !! Equations (n).
    real(dp), allocatable, intent(out) :: spring(:)  !! The springs (n) [force/length].
    integer(int64) :: place
    integer :: k
    allocate (spring(size(fixed)))
    do k = 1, size(fixed)
      place = matrix%column_start(fixed(k)) + 1
      spring(k) = matrix%value(place)
      matrix%value(place) = 2*spring(k)
    end do
  end subroutine add_springs
end module dotyk_linalg_springs
