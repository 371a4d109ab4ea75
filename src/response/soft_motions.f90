!> Motions that a body's supports hardly resist, treated apart.
!>
!> A body on a weak support is nearly free: its stiffness knows its soft motions, rigid ones as a rule, as what rounding leaves of large
!> numbers. Springs at as many unknowns E as there are soft motions make it `K_s = K + E s E^T`, as for free bodies. With the
!> answers Z to pulling at the springs, `K_s Z = E s`, which are the soft motions, and their own stiffness S,
!>
!>     K^{-1} = K_s^{-1} + Z S^{-1} Z^T,    S = (E^T Z)^{-T} Z^T K Z,
!>
!> exactly. K_s loses no digits, and S is stationary in Z, so that it is as good as the energy `Z^T K Z`, which the elements know
!> (`dotyk_elasticity_internal_force`). The schemes take Z for motions with springs S on them.
module dotyk_response_soft_motions
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, qp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_internal_force, only: internal_force
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_dense, only: right_singular_vectors, solve_dense
  implicit none
  private
  public :: count_soft, find_near_null_modes, tell_apart

  !> Eigenvalues of the scaled stiffness above this cost no digits that anybody misses.
  real(dp), parameter :: soft = 1.0e-4_dp
  !> Soft motions are softer than all else by this factor; a thin body, which is soft in many ways, has no such gap.
  real(dp), parameter :: least_gap = 100

contains

  !> How many of the softest shapes are soft motions.
  pure integer function count_soft(values) result(n)
    !> The least eigenvalues of the scaled stiffness, ascending; the last ones are not soft if the others are.
    real(dp), intent(in) :: values(:)
    integer :: k
    real(dp) :: widest
    n = 0
    widest = least_gap
    do k = 1, size(values) - 1
      if (.not. (values(k) < soft .and. values(k) > 0)) cycle
      if (.not. values(k + 1) > widest*values(k)) cycle
      widest = values(k + 1)/values(k)
      n = k
    end do
  end function count_soft

  !> The motions and their stiffness.
  subroutine find_near_null_modes(body, factor, hold, spring, motion, stiffness, error)
    !> Assembled; the stiffness is not looked at.
    type(body_t), intent(in) :: body
    !> Factor of K_s.
    type(cholesky_t), intent(in) :: factor
    !> Equations with springs (n), and the springs [force/length].
    integer, intent(in) :: hold(:)
    real(dp), intent(in) :: spring(:)
    !> Z (n_equations, n) [1].
    real(dp), allocatable, intent(out) :: motion(:, :)
    !> S (n, n) [force/length].
    real(dp), allocatable, intent(out) :: stiffness(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :, :), force(:, :), at_hold(:, :), residual(:)
    real(dp) :: energy
    integer :: j, k, n, step
    integer, parameter :: most_steps = 2
    n = size(hold)
    allocate (motion(body%constraint%n_equations, n), stiffness(n, n), source=0.0_dp)
    do k = 1, n
      motion(hold(k), k) = spring(k)
    end do
    call factor%solve_block(motion)
    allocate (u(body%dimension, body%mesh%n_nodes(), n), force(body%dimension, body%mesh%n_nodes()))
    allocate (residual(size(motion, 1)))
    do k = 1, n
      call body%constraint%expand(motion(:, k), u(:, :, k), .false.)
      ! Loads that balance each other must not move the body by what rounding makes of Z.
      do step = 1, most_steps
        call internal_force(body%mesh, body%analysis, body%material, real(u(:, :, k), qp), force, energy, error)
        if (allocated(error)) return
        call body%constraint%reduce(-force, residual)
        residual(hold(k)) = residual(hold(k)) + spring(k)
        residual(hold) = residual(hold) - spring*motion(hold, k)
        call factor%solve(residual)
        motion(:, k) = motion(:, k) + residual
        call body%constraint%expand(motion(:, k), u(:, :, k), .false.)
      end do
    end do
    do k = 1, n
      call internal_force(body%mesh, body%analysis, body%material, real(u(:, :, k), qp), force, energy, error)
      if (allocated(error)) return
      do j = 1, n
        stiffness(j, k) = sum(u(:, :, j)*force)
      end do
    end do
    at_hold = transpose(motion(hold, :))
    call solve_dense(at_hold, stiffness, error)
    stiffness = (stiffness + transpose(stiffness))/2
  end subroutine find_near_null_modes

  !> Combine the motions so that those which contact can feel and those which it cannot are apart: rounding errors of large contact
  !> forces must not move a body along the others.
  subroutine tell_apart(at_rows, motion, stiffness, error)
    !> The motions at the contact points, B Z (n_rows, n).
    real(dp), intent(in) :: at_rows(:, :)
    !> Z (n_equations, n), S (n, n).
    real(dp), intent(inout) :: motion(:, :), stiffness(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: values(size(motion, 2)), vectors(size(motion, 2), size(motion, 2)), scaled(size(at_rows, 1), size(motion, 2))
    integer :: k
    do k = 1, size(motion, 2)
      values(k) = maxval(abs(motion(:, k)))
      motion(:, k) = motion(:, k)/values(k)
      scaled(:, k) = at_rows(:, k)/values(k)
    end do
    do k = 1, size(motion, 2)
      stiffness(:, k) = stiffness(:, k)/values/values(k)
    end do
    call right_singular_vectors(scaled, values, vectors, error)
    if (allocated(error)) return
    motion = matmul(motion, vectors)
    stiffness = matmul(transpose(vectors), matmul(stiffness, vectors))
  end subroutine tell_apart
end module dotyk_response_soft_motions
