!> Contact of all bodies by a proximal active set on the displacements: conjugate gradients with a p-multigrid that
!> knows the active rows (`dotyk_scheme_contact_multigrid`), no compliance of the bodies.
!>
!> The proximal point method for the pressures (R. T. Rockafellar, SIAM J. Control Optim. 14, 1976) asks for the
!> minimizer u, given pressures m_0, of the energy with
!>
!>     m = max(0, (B u - d + prox m_0)/(theta + prox)),
!>
!> then sets m_0 := m. Its limit is the solution for theta, also for theta = 0, and its linear systems
!> `K + B^T W B` on the active rows, W = w/(theta + prox), are regular in each step. Neither the active set nor the
!> pressures m_0 wait for exact solutions of the linear systems.
module dotyk_scheme_proximal_active_set
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_linalg_fixed_sum, only: add_multiple, scalar_product
  use dotyk_scheme_contact_multigrid, only: contact_multigrid_t
  implicit none
  private
  public :: solve_proximal

  !> How the iteration went.
  type, public :: proximal_outcome_t
    !> Linear systems, and iterations of conjugate gradients in all.
    integer :: steps = 0, cg_steps = 0
    !> Whether the active set, the pressures m_0 and the displacements are converged.
    logical :: converged = .false.
    !> Last residual in the norm of the preconditioner, about the error in the energy norm [sqrt(energy)].
    real(dp) :: residual = 0
    !> Last change of the pressures, sqrt(sum w prox change^2) [sqrt(energy)].
    real(dp) :: change = 0
    !> Rigid body modes that the active rows do not restrain: loads on them are not in equilibrium.
    integer :: n_free_modes = 0
  end type proximal_outcome_t

  !> prox as a fraction of the compliance that rows have in the corner space. Smaller ones converge in fewer proximal
  !> steps, and lose more digits of B u in the pressures.
  real(dp), parameter :: proximal_fraction = 1.0e-4_dp
  !> Residual, relative, at which the active set is judged the first time; factor of the next one where that has not
  !> changed the set.
  real(dp), parameter :: first_aim = 0.01_dp, next_aim = 0.01_dp
  !> Iterations of one linear system at most.
  integer, parameter :: most_iterations = 200

contains

  !> Solve, from pressures m and displacements u.
  subroutine solve_proximal(system, weight, gap, theta, load, tolerance, most_steps, m, u, outcome, error)
    !> The bodies and rows; its active set is changed.
    class(contact_multigrid_t), intent(inout) :: system
    !> Weights w (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> d, less the displacement of the rows by prescribed displacements (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Penalty parameters, zero or positive (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Loads and forces of prescribed displacements, over the unknowns of the system (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Relative error of the displacements in the energy norm to end at, estimated [].
    real(dp), intent(in) :: tolerance
    !> Greatest number of linear systems.
    integer, intent(in) :: most_steps
    !> Pressures: those that start the active set, then the solution (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> Displacements of the free unknowns: start, then solution (n) [length].
    real(dp), intent(inout), contiguous :: u(:)
    !> Steps and convergence.
    type(proximal_outcome_t), intent(out) :: outcome
    !> Allocated where numbers are not finite.
    type(error_t), allocatable, intent(out) :: error
    type(cg_outcome_t) :: cg
    real(dp), allocatable :: r(:), e(:), y(:), shifted(:), prox(:), next(:)
    logical, allocatable :: active(:), new(:)
    real(dp) :: norm, aim
    allocate (r(system%n), e(system%n), y(size(m)), next(size(m)))
    prox = max(0.0_dp, proximal_term(system, weight) - theta)
    active = m > 0
    aim = first_aim
    norm = 0
    do while (outcome%steps < most_steps)
      outcome%steps = outcome%steps + 1
      call set_active(system, weight, theta + prox, active, error)
      if (allocated(error)) return
      shifted = gap - prox*m
      call find_residual(system, load, shifted, u, r, norm)
      ! Without displacements no norm is known yet: one cycle.
      call conjugate_gradient(system, r, e, 0.0_dp, merge(most_iterations, 1, norm > 0), cg, aim*norm)
      outcome%cg_steps = outcome%cg_steps + cg%steps
      call add_multiple(system%n, 1.0_dp, e, u)
      call system%row_displacement(u, y)
      new = y - shifted > 0
      next(:) = merge((y - shifted)/(theta + prox), 0.0_dp, new)
      outcome%residual = cg%reduction*cg%first_norm
      outcome%change = sqrt(sum(weight*prox*(next - m)**2))
      ! Not after the first cycle, unless nothing moves.
      if (all(new .eqv. active) .and. (norm > 0 .or. .not. cg%first_norm > 0)) then
        m(:) = next
        outcome%converged = max(outcome%residual, outcome%change) <= tolerance*norm
        if (outcome%converged) exit
        aim = max(tolerance/2, next_aim*aim)
      end if
      active = new
      if (interrupted()) exit
    end do
    outcome%n_free_modes = system%n_free_modes()
  end subroutine solve_proximal

  !> The residual f - K u - B^T W (B u - d + prox m_0), and the norm of u.
  subroutine find_residual(system, load, shifted, u, r, norm)
    !> The bodies and the active rows.
    class(contact_multigrid_t), intent(in) :: system
    !> f (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> d - prox m_0 (n_rows) [length].
    real(dp), intent(in) :: shifted(:)
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: u(:)
    !> Residual (n) [force].
    real(dp), intent(out), contiguous :: r(:)
    !> Energy norm of u [sqrt(energy)].
    real(dp), intent(out) :: norm
    real(dp) :: y(size(shifted))
    call system%multiply_bodies(u, r)
    norm = sqrt(max(0.0_dp, scalar_product(system%n, u, r)))
    r(:) = load - r
    call system%row_displacement(u, y)
    call system%subtract_row_force(system%stiffness*(y - shifted), r)
  end subroutine find_residual

  !> prox of each row [length/pressure].
  function proximal_term(system, weight) result(prox)
    !> The bodies and rows.
    class(contact_multigrid_t), intent(in) :: system
    !> Weights w (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> (n_rows)
    real(dp) :: prox(size(weight)), most
    prox = weight*system%row_compliance()
    most = maxval([0.0_dp, prox])
    if (.not. most > 0) most = 1
    ! Rows between held nodes have none of their own.
    prox = proximal_fraction*max(prox, proximal_fraction*most)
  end function proximal_term

  !> Give the system its active rows.
  subroutine set_active(system, weight, softness, active, error)
    !> The system.
    class(contact_multigrid_t), intent(inout) :: system
    !> Weights w (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> theta + prox (n_rows) [length/pressure].
    real(dp), intent(in) :: softness(:)
    !> Whether a row is active (n_rows).
    logical, intent(in) :: active(:)
    !> Allocated where numbers are not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: stiffness(size(weight))
    stiffness = 0
    where (active) stiffness = weight/softness
    call system%set_stiffness(stiffness, error)
  end subroutine set_active
end module dotyk_scheme_proximal_active_set
