!> Exact solutions of small quadratic programmes of held bodies, by the active set method of Lawson and Hanson (Solving
!> Least Squares Problems, 1974, chapter 23) on dense matrices: independent of the schemes, and finite.
module dense_exact
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: dense_matrix, exact_forces

contains

  !> C as a dense matrix, by products with unit forces.
  function dense_matrix(qp, compliance) result(c)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    type(body_compliance_t), intent(inout) :: compliance
    real(dp), allocatable :: c(:, :)  !! (n_rows, n_rows) [length/force].
    real(dp) :: unit(qp%n_rows)
    integer :: i
    allocate (c(qp%n_rows, qp%n_rows))
    do i = 1, qp%n_rows
      unit = 0
      unit(i) = 1
      call compliance%multiply(qp, unit, c(:, i))
    end do
  end function dense_matrix

  !> The lambda >= 0 that minimizes `lambda^T A lambda/2 - lambda^T y`, A symmetric and positive definite.
  function exact_forces(a, y) result(lambda)
    real(dp), intent(in) :: a(:, :)  !! C + Theta W^{-1} (n, n) [length/force].
    real(dp), intent(in) :: y(:)  !! y_0 (n) [length].
    real(dp) :: lambda(size(y))  !! Contact forces (n) [force].
    real(dp) :: trial(size(y)), slope(size(y)), step
    logical :: active(size(y))
    integer :: enters
    lambda = 0
    active = .false.
    do
      slope = y - matmul(a, lambda)
      if (all(active .or. slope <= 1.0e-14_dp*maxval(abs(y)))) return
      enters = maxloc(slope, 1, mask=.not. active)
      active(enters) = .true.
      do
        call solve_active(a, y, active, trial)
        if (all(trial > 0 .or. .not. active)) exit
        ! As far towards the trial as no force becomes tensile.
        step = minval(lambda/(lambda - trial), mask=active .and. trial <= 0)
        lambda = lambda + step*(trial - lambda)
        active = active .and. lambda > 1.0e-15_dp*maxval(lambda)
        where (.not. active) lambda = 0
      end do
      lambda = trial
    end do
  end function exact_forces

  !> The forces with all active rows closed.
  subroutine solve_active(a, penetration, active, lambda)
    real(dp), intent(in) :: a(:, :), penetration(:)  !! As in `exact_forces`.
    logical, intent(in) :: active(:)  !! (n).
    real(dp), intent(out) :: lambda(:)  !! Zero where not active (n) [force].
    type(error_t), allocatable :: error
    integer, allocatable :: k(:)
    real(dp), allocatable :: x(:, :)
    integer :: i
    k = pack([(i, i=1, size(penetration))], active)
    x = reshape(penetration(k), [size(k), 1])
    call solve_dense(a(k, k), x, error)
    if (allocated(error)) error stop 'dense_exact: a singular matrix'
    lambda = 0
    lambda(k) = x(:, 1)
  end subroutine solve_active
end module dense_exact
