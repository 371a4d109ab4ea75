!> Rotations of floating bodies, which linear kinematics describe where they are small.
module dotyk_control_rotations
  use dotyk_base_kinds, only: dp
  use dotyk_control_contact_problem, only: contact_problem_t, first_mode
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_scheme_solver_state, only: ended_converged, ended_rotated, solver_state_t
  implicit none
  private
  public :: find_rotations

contains

  !> How far bodies rotate. A solution with a rotation by more than the size of a body is none.
  subroutine find_rotations(problem, state, ratio)
    type(contact_problem_t), intent(in) :: problem  !! Bodies and their modes.
    !> Where the scheme ended; ended by a rotation that is too large on return.
    type(solver_state_t), intent(inout) :: state
    !> Displacement by rotation, relative to the size of the body (n_bodies) [].
    real(dp), allocatable, intent(out) :: ratio(:)
    integer :: b, first(size(problem%body) + 1)
    allocate (ratio(size(problem%body)), source=0.0_dp)
    if (.not. allocated(state%alpha)) return
    if (size(state%alpha) == 0) return
    first = first_mode(problem%modes, problem%tie)
    do b = 1, size(ratio)
      if (problem%modes(b)%n > 0) &
        ratio(b) = rotation_ratio(problem%body(b), problem%modes(b), &
                                  state%alpha(first(b):first(b) + problem%modes(b)%n - 1))
    end do
    ! Linear kinematics describe nothing then.
    if (state%ended == ended_converged .and. maxval(ratio) > 1) state%ended = ended_rotated
  end subroutine find_rotations

  !> How far nodes move against their mean, relative to the size of the body [].
  pure real(dp) function rotation_ratio(body, modes, amplitude) result(ratio)
    type(body_t), intent(in) :: body  !! The body.
    type(body_modes_t), intent(in) :: modes  !! Its modes.
    real(dp), intent(in) :: amplitude(:)  !! Amplitude of each mode (n) [length].
    real(dp) :: u(body%dimension, size(modes%shape, 2)), mean(body%dimension), length
    integer :: i, k
    u = 0
    do k = 1, size(amplitude)
      u = u + amplitude(k)*modes%shape(:, :, k)
    end do
    mean = sum(u, 2)/size(u, 2)
    length = norm2(maxval(body%mesh%x, 2) - minval(body%mesh%x, 2))
    ratio = 0
    do i = 1, size(u, 2)
      ratio = max(ratio, norm2(u(:, i) - mean)/length)
    end do
  end function rotation_ratio
end module dotyk_control_rotations
