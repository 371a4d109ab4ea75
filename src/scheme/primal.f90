!> The primal scheme: the engine of `dotyk_scheme_primal_solution` for bodies whose compliance operators are
!> p-multigrids (`dotyk_response_multigrid_response`).
!>
!> Unknown is v = u - u_0, the displacement by contact forces and rigid body motions: `K v = r_0 + R e - B^T lambda`
!> with r_0 what the rough solution u_0 without contact leaves of the loads, e the resultants of these on the rigid body
!> modes R, and `B v <= -y_0`. The start is the contact of the bodies in their corner spaces
!> (`dotyk_scheme_corner_contact`). Near-null-space modes, which have a stiffness, are left to the dual scheme, and so
!> are supports that press rows together (`why_not`).
module dotyk_scheme_primal
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_base_thresholds, only: rounding
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_primal_solution, only: presses_rigid_rows, solve_by_displacements
  use dotyk_scheme_primal_system, only: primal_system_t
  use dotyk_scheme_proximal_active_set, only: proximal_outcome_t
  use dotyk_scheme_restriction, only: transformed_qp_t
  use dotyk_scheme_scheme, only: reason_aggregates, reason_near_null_modes, reason_no_rows, &
    reason_none, reason_rigid_rows, scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t, ended_converged, ended_solves
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private

  type, extends(scheme_t), public :: primal_t  !! The scheme.
  contains
    procedure :: solve => primal_solve
    procedure, nopass :: why_not => primal_why_not
  end type primal_t

  !> The dual scheme with solves by p-multigrid: for what the primal scheme does not solve, where there are no factors.
  type, extends(dual_t), public :: grid_dual_t
  contains
    procedure :: solve => grid_dual_solve
  end type grid_dual_t

  !> Errors of the dual scheme by errors of its solves: those of several solves add up [].
  real(dp), parameter :: safety = 100

contains

  !> Modes with a stiffness, and supports that press rows together, are for the dual scheme.
  integer function primal_why_not(qp, compliance) result(reason)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    !> Compliance of the bodies at these rows: p-multigrids, or factors that join them.
    class(compliance_t), intent(in) :: compliance
    logical :: is_rigid(qp%n_rows)
    reason = reason_no_rows
    if (qp%n_rows == 0) return
    reason = reason_near_null_modes
    if (allocated(qp%coarse%stiffness)) return
    reason = reason_aggregates
    select type (compliance)
    class is (body_compliance_t)
      if (.not. compliance%has_grids()) return
      if (.not. has_corner_matrices(qp, compliance)) return
      call find_rigid_rows(qp, compliance, is_rigid)
      reason = merge(reason_rigid_rows, reason_none, any(presses_rigid_rows(qp, is_rigid)))
    end select
  end function primal_why_not

  !> Whether the stiffnesses of the corner spaces of tied bodies are there.
  logical function has_corner_matrices(qp, compliance) result(has)
    type(contact_qp_t), intent(in) :: qp  !! Rows of contact and ties.
    class(body_compliance_t), intent(in) :: compliance  !! By p-multigrids.
    class(body_grid_t), pointer :: grid
    type(sparse_symmetric_t), pointer :: matrix
    real(dp), pointer :: mode(:, :)
    integer :: b
    has = .true.
    do b = 1, size(qp%block)
      if (.not. any(qp%is_tied(qp%block(b)%row))) cycle
      grid => compliance%body_grid(b)
      if (.not. associated(grid)) cycle
      call grid%get_corner_matrix(matrix, mode)
      has = has .and. associated(matrix)
    end do
  end function has_corner_matrices

  !> Solve.
  subroutine primal_solve(self, qp, compliance, settings, monitor, state, error)
    class(primal_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(compliance_t), intent(inout) :: compliance  !! Compliance of the bodies at these rows.
    type(solver_settings_t), intent(in) :: settings  !! Settings of the user.
    class(monitor_t), intent(inout) :: monitor  !! Gets each step, and lines for the log.
    !> Where to begin if it has pressures; without pressures on return where the scheme ended before the first step.
    type(solver_state_t), intent(inout) :: state
    !> Allocated where numbers are not finite, or an interrupt came before there was a state.
    type(error_t), allocatable, intent(out) :: error
    select type (compliance)
    class is (body_compliance_t)
      call compliance%forget_displacements()
      call solve_by_grids(qp, compliance, settings, monitor, state, error)
    end select
    associate (not_needed => same_type_as(self, self))
    end associate
  end subroutine primal_solve

  !> Solve by the dual scheme, and add the error of the solves to its bound, which is that of exact ones.
  subroutine grid_dual_solve(self, qp, compliance, settings, monitor, state, error)
    class(grid_dual_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! As in `primal_solve`.
    class(compliance_t), intent(inout) :: compliance  !! As in `primal_solve`.
    type(solver_settings_t), intent(in) :: settings  !! As in `primal_solve`.
    class(monitor_t), intent(inout) :: monitor  !! As in `primal_solve`.
    type(solver_state_t), intent(inout) :: state  !! As in `primal_solve`.
    type(error_t), allocatable, intent(out) :: error  !! As in `dual_solve`.
    call self%dual_t%solve(qp, compliance, settings, monitor, state, error)
    select type (compliance)
    class is (body_compliance_t)
      call compliance%forget_displacements()
      if (.not. compliance%solve_error() > 0 .or. .not. state%error_bound < huge(1.0_dp)) return
      state%bound_is_guaranteed = .false.
      state%error_bound = state%error_bound + safety*compliance%solve_error()
      if (state%ended == ended_converged .and. state%error_bound > settings%tolerance) state%ended = ended_solves
    end select
  end subroutine grid_dual_solve

  !> Rows whose nodes are held, all but for rounding.
  subroutine find_rigid_rows(qp, compliance, is_rigid)
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, initial penetrations, rigid body modes.
    class(body_compliance_t), intent(in) :: compliance  !! Compliance of the bodies at these rows.
    logical, intent(out) :: is_rigid(:)  !! (n_rows)
    real(dp) :: diagonal(qp%n_rows)
    integer :: b, i
    call compliance%nodal_diagonal(qp, diagonal)
    ! Entries of B at free nodes may be rounding.
    is_rigid = .not. diagonal > rounding**2*maxval([0.0_dp, diagonal])
    ! Rigid bodies move without a stiffness.
    do b = 1, size(qp%block)
      do i = 1, size(qp%block(b)%row)
        if (any(abs(qp%coarse%block(b)%value(i, :)) > 0)) is_rigid(qp%block(b)%row(i)) = .false.
      end do
    end do
  end subroutine find_rigid_rows

  !> Solve by displacements.
  subroutine solve_by_grids(qp, compliance, settings, monitor, state, error)
    type(contact_qp_t), intent(in) :: qp  !! As in `primal_solve`.
    class(body_compliance_t), target, intent(inout) :: compliance  !! By p-multigrids.
    type(solver_settings_t), intent(in) :: settings  !! As in `primal_solve`.
    class(monitor_t), intent(inout) :: monitor  !! As in `primal_solve`.
    type(solver_state_t), intent(inout) :: state  !! As in `primal_solve`.
    type(error_t), allocatable, intent(out) :: error  !! As in `primal_solve`.
    type(primal_system_t), target :: system
    type(proximal_outcome_t) :: total
    type(transformed_qp_t) :: joined
    real(dp), allocatable :: v(:)
    logical, allocatable :: is_rigid(:)
    system%compliance => compliance
    if (allocated(qp%seam)) then
      call joined%join(qp)
      allocate (is_rigid(joined%qp%n_rows))
      call find_rigid_rows(joined%qp, compliance, is_rigid)
      call joined%take(state)
      call solve_by_displacements(system, joined%qp, settings%tolerance, settings, is_rigid, monitor, v, total, state, &
                                  error)
      if (allocated(error) .or. .not. allocated(state%pressure)) return
      state%pressure = joined%pressures(state%pressure)
      deallocate (state%penetration)
      allocate (state%penetration(qp%n_rows))
      call system%find_penetrations(qp, v, state%penetration)
    else
      allocate (is_rigid(qp%n_rows))
      call find_rigid_rows(qp, compliance, is_rigid)
      call solve_by_displacements(system, qp, settings%tolerance, settings, is_rigid, monitor, v, total, state, error)
    end if
    if (.not. allocated(error) .and. allocated(state%pressure)) then
      call system%keep_displacements(v, compliance)
      compliance%n_sweeps = compliance%n_sweeps + total%cg_steps
      call monitor%note('displacements    '//to_text(total%steps)//' active sets, '//to_text(total%cg_steps)// &
                        ' iterations of conjugate gradients with p-multigrid')
    end if
    call system%destroy()
  end subroutine solve_by_grids
end module dotyk_scheme_primal
