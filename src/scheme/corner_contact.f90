!> The contact of the bodies in their corner spaces: where the proximal active set begins.
!>
!> The dual scheme solves it on the compliances of the rows in the corner spaces. Rows at nodes that are no corners
!> depend on those of the corners there: a penalty parameter of a fraction of the compliance of each row keeps the
!> pressures smooth.
module dotyk_scheme_corner_contact
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_body_grids, only: body_grids_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private
  public :: solve_corner_contact

  !> Penalty parameter as a fraction of the compliance of a row, at least.
  real(dp), parameter :: softness = 0.03_dp
  !> Relative error: no smaller one is worth its time, as the corner space is stiffer than the bodies by some percent.
  real(dp), parameter :: tolerance = 1.0e-3_dp

contains

  !> Solve; zero pressures where there is no solution.
  subroutine solve_corner_contact(system, qp, gap, theta, load, m)
    !> The bodies and rows.
    class(body_grids_t), intent(in) :: system
    !> The rows and the rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> d, less the displacement of the rows by prescribed displacements (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Loads and forces of prescribed displacements, over the unknowns of the system (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Pressures (n_rows) [pressure].
    real(dp), intent(out) :: m(:)
    type(contact_qp_t) :: corner_qp
    type(dense_compliance_t) :: compliance
    type(dual_t) :: scheme
    type(solver_settings_t) :: settings
    type(monitor_t) :: monitor
    type(solver_state_t) :: state
    type(error_t), allocatable :: error
    real(dp), allocatable :: y(:)
    integer :: b
    m = 0
    if (size(m) == 0) return
    allocate (y(size(m)))
    corner_qp = qp
    ! The compliances are those of these rows, and of no others.
    corner_qp%parent_row = [(b, b=1, qp%n_rows)]
    call system%corner_displacement(load, y)
    call corner_qp%shift_penetration(y - gap - qp%initial_penetration)
    call compliance%init(corner_qp)
    do b = 1, size(system%body)
      call compliance%set(corner_qp, b, system%body(system%body(b)%owner)%rows%compliance)
    end do
    settings%tolerance = tolerance
    call scheme%solve(corner_qp, compliance, max(theta, softness*qp%weight*system%row_compliance()), settings, &
                      monitor, state, error)
    if (allocated(error) .or. .not. allocated(state%m)) return
    m(:) = state%m
  end subroutine solve_corner_contact
end module dotyk_scheme_corner_contact
