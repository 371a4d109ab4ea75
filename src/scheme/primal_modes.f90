!> Rigid body modes in the primal scheme: equilibrium of floating bodies, and modes that nothing determines.
module dotyk_scheme_primal_modes
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: solve_dense, symmetric_eigen
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: balance, find_indeterminate, take_least

  !> Eigenvalues below this fraction of the greatest are rounding [].
  real(dp), parameter, public :: rank = 1.0e-10_dp
  !> Pressures that would have to change by more than this fraction for equilibrium are not near it [].
  real(dp), parameter :: small_change = 0.1_dp

contains

  !> Change the pressures of the active rows as little as the equilibrium of the floating bodies asks for.
  subroutine balance(qp, m)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Pressures (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    real(dp), allocatable :: g(:, :), weighted(:, :), values(:), vectors(:, :), missing(:), change(:)
    integer, allocatable :: row(:)
    type(error_t), allocatable :: error
    integer :: i, pass
    if (qp%coarse%n == 0) return
    row = pack([(i, i=1, size(m))], m > 0)
    allocate (g(size(row), qp%coarse%n), values(qp%coarse%n), vectors(qp%coarse%n, qp%coarse%n), missing(qp%coarse%n))
    call qp%coarse%rows(row, g)
    ! Pressures change in proportion to themselves: none becomes tensile before the others do.
    weighted = g*spread(qp%weight(row)*m(row), 2, size(g, 2))
    call symmetric_eigen(matmul(transpose(g), weighted), values, vectors, error)
    if (allocated(error)) return
    do pass = 1, 2
      call qp%mode_resultant(qp%weight*m, missing)
      missing = matmul(qp%coarse%resultant - missing, vectors)
      where (values > rank*maxval(values))
        missing = missing/values
      else where
        missing = 0
      end where
      change = matmul(g, matmul(vectors, missing))
      if (.not. maxval([0.0_dp, abs(change)]) < small_change) return
      m(row) = max(0.0_dp, m(row)*(1 + change))
    end do
  end subroutine balance

  !> Of all places that bodies may move to by indeterminate modes, take that of the least displacement; where rows close
  !> on the way, go on by modes that leave them closed.
  subroutine take_least(qp, active, mode, alpha, y)
    !> Contact rows, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Active rows, which no indeterminate mode moves (n_rows).
    logical, intent(in) :: active(:)
    !> The indeterminate modes, as columns of amplitudes of the modes of the bodies; without those that closed rows
    !> restrain on return (n, n_indeterminate).
    real(dp), allocatable, intent(inout) :: mode(:, :)
    !> Amplitudes of the modes of the QP (n) [length].
    real(dp), intent(inout) :: alpha(:)
    !> Penetrations (n_rows) [length].
    real(dp), intent(inout) :: y(:)
    real(dp) :: step(size(alpha)), moved(size(y)), g(1, size(alpha)), t
    real(dp), allocatable :: along(:, :)
    type(error_t), allocatable :: error
    integer :: i, closing
    do while (size(mode, 2) > 0)
      along = reshape(matmul(qp%coarse%scale*alpha, mode), [size(mode, 2), 1])
      call solve_dense(matmul(transpose(mode), mode), along, error)
      if (allocated(error)) return
      step = -matmul(mode, along(:, 1))/qp%coarse%scale
      call qp%mode_displacement(step, moved)
      t = 1
      closing = 0
      do i = 1, size(y)
        if (active(i) .or. .not. moved(i) > sqrt(rank)*maxval(abs(step))) cycle
        if (max(0.0_dp, -y(i)) >= t*moved(i)) cycle
        t = max(0.0_dp, -y(i))/moved(i)
        closing = i
      end do
      alpha(:) = alpha + t*step
      y(:) = y + t*moved
      if (closing == 0) return
      call qp%coarse%rows([closing], g)
      call keep_closed(g(1, :)/qp%coarse%scale, mode)
    end do
  end subroutine take_least

  !> The combinations of modes that do not move a row.
  subroutine keep_closed(g, mode)
    !> Motion of the row by the modes of the bodies (n) [].
    real(dp), intent(in) :: g(:)
    !> Modes as columns of amplitudes of the modes of the bodies; one less on return (n, n_modes).
    real(dp), allocatable, intent(inout) :: mode(:, :)
    real(dp) :: v(size(mode, 2))
    ! The Householder reflection that takes the motion to the first column.
    v = matmul(g, mode)
    v(1) = v(1) + sign(norm2(v), v(1))
    mode = mode - 2/dot_product(v, v)*matmul(reshape(matmul(mode, v), [size(mode, 1), 1]), reshape(v, [1, size(v)]))
    mode = mode(:, 2:)
  end subroutine keep_closed

  !> Rigid body modes that the active rows do not restrain.
  subroutine find_indeterminate(qp, active, mode, error)
    !> Contact rows, initial penetrations, rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Active rows (n_rows).
    logical, intent(in) :: active(:)
    !> As columns of amplitudes (coarse%n, n).
    real(dp), allocatable, intent(out) :: mode(:, :)
    !> Allocated where a number is not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: g(:, :), values(:), vectors(:, :)
    integer, allocatable :: row(:)
    integer :: i, k
    row = pack([(i, i=1, size(active))], active)
    allocate (g(size(row), qp%coarse%n), values(qp%coarse%n), vectors(qp%coarse%n, qp%coarse%n))
    call qp%coarse%rows(row, g)
    call symmetric_eigen(matmul(transpose(g), g), values, vectors, error)
    if (allocated(error)) return
    mode = vectors(:, pack([(k, k=1, size(values))], .not. values > rank*max(1.0_dp, maxval([0.0_dp, values]))))
    do k = 1, size(mode, 2)
      mode(:, k) = qp%coarse%scale*mode(:, k)
    end do
  end subroutine find_indeterminate
end module dotyk_scheme_primal_modes
