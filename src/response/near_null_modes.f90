!> Near-null-space modes: motions that the supports of a body hardly resist, split off its compliance operator.
!>
!> The stiffness of a body on a weak support holds the stiffness of its near-null-space modes, nearly rigid as a rule,
!> as the difference of large numbers. Springs at as many equations E as there are such modes make it
!> `K_s = K + E s E^T`, as for floating bodies. With the solutions Z of `K_s Z = E s`, which are the modes, and their
!> own stiffness S,
!>
!>     K^{-1} = K_s^{-1} + Z S^{-1} Z^T,    S = (E^T Z)^{-T} Z^T K Z,
!>
!> exactly. K_s is well conditioned, and S is stationary in Z, so that it is as accurate as the energy `Z^T K Z`, which
!> is computed from the elements (`body_force`). For the schemes Z are rigid body modes with
!> springs S.
module dotyk_response_near_null_modes
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, qp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_internal_force, only: body_force
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_linalg_dense, only: right_singular_vectors, solve_dense
  implicit none
  private
  public :: count_near_null, find_near_null, separate_by_contact

  !> Eigenvalues of the scaled stiffness above this do not cost noticeable accuracy.
  real(dp), parameter :: largest_eigenvalue = 1.0e-4_dp
  !> A near-null space has eigenvalues below all others by this factor; the spectrum of a thin body has no such gap.
  real(dp), parameter :: least_gap = 100
  integer, parameter :: refinement_steps = 2  !! Steps of iterative refinement of the modes.

contains

  !> Dimension of the near-null space.
  pure integer function count_near_null(values) result(n)
    !> The least eigenvalues of the scaled stiffness, ascending, more than the near-null space has (number of them) [].
    real(dp), intent(in) :: values(:)
    integer :: k
    real(dp) :: widest
    n = 0
    widest = least_gap
    do k = 1, size(values) - 1
      if (.not. (values(k) < largest_eigenvalue .and. values(k) > 0)) cycle
      if (.not. values(k + 1) > widest*values(k)) cycle
      widest = values(k + 1)/values(k)
      n = k
    end do
  end function count_near_null

  !> The modes and their stiffness.
  subroutine find_near_null(body, factor, fixed, spring, mode, stiffness, error)
    type(body_t), intent(in) :: body  !! Assembled.
    type(cholesky_t), intent(in) :: factor  !! Factor of K_s.
    integer, intent(in) :: fixed(:)  !! Equations with springs E (n).
    real(dp), intent(in) :: spring(:)  !! The springs s (n) [force/length].
    real(dp), allocatable, intent(out) :: mode(:, :)  !! Z (n_equations, n) [].
    real(dp), allocatable, intent(out) :: stiffness(:, :)  !! S (n, n) [force/length].
    !> Allocated where a formula of the material cannot be evaluated, or the modes are linearly dependent at the
    !> springs.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: u(:, :, :), force(:, :), at_springs(:, :), residual(:)
    real(dp) :: energy
    integer :: j, k, n, step
    n = size(fixed)
    allocate (mode(body%constraint%n_equations, n), stiffness(n, n), source=0.0_dp)
    do k = 1, n
      mode(fixed(k), k) = spring(k)
    end do
    call factor%solve_block(mode)
    allocate (u(body%dimension, body%mesh%n_nodes(), n), force(body%dimension, body%mesh%n_nodes()))
    allocate (residual(size(mode, 1)))
    do k = 1, n
      call body%constraint%expand(mode(:, k), u(:, :, k), .false.)
      ! Self-equilibrated loads must not excite the modes through the rounding errors of Z.
      do step = 1, refinement_steps
        call body_force(body, real(u(:, :, k), qp), force, energy, error)
        if (allocated(error)) return
        call body%constraint%reduce(-force, residual)
        residual(fixed(k)) = residual(fixed(k)) + spring(k)
        residual(fixed) = residual(fixed) - spring*mode(fixed, k)
        call factor%solve(residual)
        mode(:, k) = mode(:, k) + residual
        call body%constraint%expand(mode(:, k), u(:, :, k), .false.)
      end do
    end do
    do k = 1, n
      call body_force(body, real(u(:, :, k), qp), force, energy, error)
      if (allocated(error)) return
      do j = 1, n
        stiffness(j, k) = sum(u(:, :, j)*force)
      end do
    end do
    at_springs = transpose(mode(fixed, :))
    call solve_dense(at_springs, stiffness, error)
    stiffness = (stiffness + transpose(stiffness))/2
  end subroutine find_near_null

  !> Recombine the modes so that those which move contact rows and those which do not are separate: rounding errors of
  !> large contact forces must not excite the latter.
  subroutine separate_by_contact(at_rows, mode, stiffness, error)
    real(dp), intent(in) :: at_rows(:, :)  !! The modes at the contact rows, B Z (n_rows, n) [].
    real(dp), intent(inout) :: mode(:, :)  !! Z (n_equations, n) [].
    real(dp), intent(inout) :: stiffness(:, :)  !! S (n, n) [force/length].
    !> Allocated where an entry at the rows is not finite, or LAPACK's singular value decomposition does not converge.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: values(size(mode, 2)), vectors(size(mode, 2), size(mode, 2)), scaled(size(at_rows, 1), size(mode, 2))
    integer :: k
    do k = 1, size(mode, 2)
      values(k) = maxval(abs(mode(:, k)))
      mode(:, k) = mode(:, k)/values(k)
      scaled(:, k) = at_rows(:, k)/values(k)
    end do
    do k = 1, size(mode, 2)
      stiffness(:, k) = stiffness(:, k)/values/values(k)
    end do
    call right_singular_vectors(scaled, values, vectors, error)
    if (allocated(error)) return
    mode = matmul(mode, vectors)
    stiffness = matmul(transpose(vectors), matmul(stiffness, vectors))
  end subroutine separate_by_contact
end module dotyk_response_near_null_modes
