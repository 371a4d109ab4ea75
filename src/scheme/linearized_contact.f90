!> The contact problem linearized at a solution: its active rows are equations, the inactive ones are gone. What small
!> changes of loads, supports and gaps do, and so the dual solutions of forces and displacements
!> (`dotyk_control_quantity_error`), comes from its system, which is that of the last active set
!> (`dotyk_scheme_active_system`).
module dotyk_scheme_linearized_contact
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_set, only: foundation_stiffness
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t, drop_rigid_constraints
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_linear_solver_choice, only: choose_coupling
  use dotyk_scheme_proximal_motion, only: proximal_motion_t
  use dotyk_scheme_restriction, only: form_entries, restrict_qp, transformed_qp_t
  implicit none
  private
  public :: solve_linearized

contains

  !> Solve for several right-hand sides: `y = theta m` at the active rows, and equilibrium along the rigid body modes.
  !> Motions that the active rows do not resist have the springs of the dual scheme.
  recursive subroutine solve_linearized(qp, compliance, linear_solver, active, penetration, resultant, force, alpha, &
                                        error)
    type(contact_qp_t), intent(in) :: qp  !! The quadratic programme.
    class(compliance_t), intent(inout) :: compliance  !! Its compliance operator; entries that are formed stay there.
    integer, intent(in) :: linear_solver  !! One of `linear_solver_*` of dotyk_base_options.
    logical, intent(in) :: active(:)  !! Active rows, those of ties included (n_rows).
    real(dp), intent(in) :: penetration(:, :)  !! Penetrations without contact forces (n_rows, n) [length].
    real(dp), intent(in) :: resultant(:, :)  !! Resultants of loads on the modes (coarse%n, n) [force].
    real(dp), intent(out) :: force(:, :)  !! Contact forces, 0 at inactive rows (n_rows, n) [force].
    real(dp), intent(out) :: alpha(:, :)  !! Amplitudes of the modes, without their scale (coarse%n, n) [length].
    !> Allocated where the system is singular: forces that rows of one place share are not determined.
    type(error_t), allocatable, intent(out) :: error
    type(active_system_t) :: system
    type(contact_qp_t) :: part, with_springs
    type(proximal_motion_t) :: motion
    real(dp), allocatable :: yields(:), x(:)
    logical, allocatable :: kept(:), is_rigid(:)
    integer, allocatable :: row(:)
    integer :: i, j
    force = 0
    alpha = 0
    if (allocated(qp%seam)) then
      call solve_joined(qp, compliance, linear_solver, active, penetration, resultant, force, alpha, error)
      return
    end if
    call restrict_qp(qp, active, part)
    allocate (kept(part%n_rows), source=.true.)
    allocate (is_rigid(part%n_rows), source=.false.)
    call choose_coupling(part, compliance, linear_solver, kept, system)
    if (system%needs_entries()) call compliance%form(part)
    with_springs = part
    call motion%init(part, foundation_stiffness(part), kept, kept, alpha(:, 1))
    call motion%apply(part, with_springs)
    call drop_rigid_constraints(part, compliance, yields, kept, is_rigid)
    call system%init(with_springs, compliance, kept, error)
    if (.not. allocated(error)) then
      row = pack(pack([(i, i=1, size(active))], active), kept)
      allocate (x(size(row)))
      do j = 1, size(force, 2)
        x = 0
        call system%solve(with_springs, compliance, penetration(row, j), resultant(:, j), x, alpha(:, j))
        force(row, j) = x
      end do
    end if
    call system%destroy()
  end subroutine solve_linearized

  !> Solve for the pressures that are left at seams.
  recursive subroutine solve_joined(qp, compliance, linear_solver, active, penetration, resultant, force, alpha, error)
    type(contact_qp_t), intent(in) :: qp  !! With seams.
    class(compliance_t), intent(inout) :: compliance  !! As in `solve_linearized`.
    integer, intent(in) :: linear_solver  !! As in `solve_linearized`.
    logical, intent(in) :: active(:)  !! As in `solve_linearized`.
    real(dp), intent(in) :: penetration(:, :), resultant(:, :)  !! As in `solve_linearized`.
    real(dp), intent(out) :: force(:, :), alpha(:, :)  !! As in `solve_linearized`.
    type(error_t), allocatable, intent(out) :: error  !! As in `solve_linearized`.
    type(transformed_qp_t) :: joined
    type(dense_compliance_t) :: of_joined
    real(dp), allocatable :: y(:, :), of_rows(:, :)
    integer :: j
    call joined%join(qp)
    call form_entries(joined%qp, compliance, of_joined)
    allocate (y(joined%qp%n_rows, size(force, 2)), of_rows(joined%qp%n_rows, size(force, 2)))
    do j = 1, size(force, 2)
      y(:, j) = joined%means(penetration(:, j))
    end do
    call solve_linearized(joined%qp, of_joined, linear_solver, joined%active(active), y, resultant, of_rows, alpha, &
                          error)
    do j = 1, size(force, 2)
      force(:, j) = qp%weight*joined%pressures(of_rows(:, j)/joined%qp%weight)
    end do
  end subroutine solve_joined
end module dotyk_scheme_linearized_contact
