!> How the stiffness of a body with free rigid motions is made definite, and whether a body is one that can be solved for.
!>
!> A spring at as many unknowns as there are free motions holds the body in a statically determinate way: forces in equilibrium
!> pass without any of the springs feeling them, so the displacements are exact but for a rigid motion.
module dotyk_response_hold
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_body, only: body_t, strain_energy
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  implicit none
  private
  public :: choose_holds, add_springs, is_mechanism

  !> A displacement with less than this part of the energy that its nodes would have one by one, all others at rest, strains
  !> nothing. Elements know it to the square of round-off: mechanisms have 1e-25 and less, a bar 1000 times longer than thick
  !> 1e-13, a ribbon of 10000 by 100 by 1 3e-17.
  real(dp), parameter :: least_energy = 1.0e-20_dp

contains

  !> The unknowns to hold: those that tell the motions apart best, by Gram-Schmidt on the rows, the largest rest first.
  pure subroutine choose_holds(motion, hold)
    !> Orthonormal motions over the equations (n_equations, n_motions).
    real(dp), intent(in) :: motion(:, :)
    !> Equations, one for each motion (n_motions).
    integer, allocatable, intent(out) :: hold(:)
    real(dp), allocatable :: rest(:, :)
    real(dp) :: best, now, row(size(motion, 2))
    integer :: i, k
    allocate (hold(size(motion, 2)))
    rest = transpose(motion)
    do k = 1, size(hold)
      best = 0
      hold(k) = 1
      do i = 1, size(rest, 2)
        now = sum(rest(:, i)**2)
        ! The margin keeps the choice from hanging on round-off.
        if (now <= best*1.001_dp) cycle
        best = now
        hold(k) = i
      end do
      if (.not. best > 0) return
      row = rest(:, hold(k))/sqrt(best)
      do i = 1, size(rest, 2)
        rest(:, i) = rest(:, i) - dot_product(row, rest(:, i))*row
      end do
    end do
  end subroutine choose_holds

  !> Add to the diagonal, at some equations, as much as there is.
  pure subroutine add_springs(matrix, hold, spring)
    type(sparse_symmetric_t), intent(inout) :: matrix
    !> Equations (n).
    integer, intent(in) :: hold(:)
    !> What was added (n).
    real(dp), allocatable, intent(out) :: spring(:)
    integer(int64) :: place
    integer :: k
    allocate (spring(size(hold)))
    do k = 1, size(hold)
      place = matrix%column_start(hold(k)) + 1
      spring(k) = matrix%value(place)
      matrix%value(place) = 2*spring(k)
    end do
  end subroutine add_springs

  !> Whether a displacement moves parts of the body against each other without straining any.
  logical function is_mechanism(body, diagonal, hold, spring, x)
    !> Assembled; the stiffness is not looked at.
    type(body_t), intent(in) :: body
    !> Diagonal of the stiffness (n_equations).
    real(dp), intent(in) :: diagonal(:)
    !> Equations with springs, and the springs.
    integer, intent(in) :: hold(:)
    real(dp), intent(in) :: spring(:)
    !> The displacement, any size (n_equations).
    real(dp), intent(in) :: x(:)
    real(dp), allocatable :: u(:, :)
    real(dp) :: most
    is_mechanism = .true.
    most = maxval(abs(x))
    if (.not. ieee_is_finite(most) .or. .not. most > 0) return
    allocate (u(body%dimension, body%mesh%n_nodes()))
    call body%constraint%expand(x/most, u, .false.)
    is_mechanism = .not. 2*strain_energy(body, u) + sum(spring*(x(hold)/most)**2) > &
                   least_energy*sum(diagonal*(x/most)**2)
  end function is_mechanism
end module dotyk_response_hold
