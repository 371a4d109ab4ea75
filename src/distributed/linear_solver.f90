!> A linear solver of PETSc with its coarse matrix, and its runs on arrays.
module dotyk_distributed_linear_solver
  use petscksp, only: KSPComputeExtremeSingularValues, KSPGetConvergedReason, KSPDestroy, KSPGetIterationNumber, &
    KSPGetResidualNorm, KSPGetTolerances, KSPSetTolerances, KSPSolve, KSP_CONVERGED_ATOL, KSP_CONVERGED_ITERATING, &
    KSP_DIVERGED_INDEFINITE_PC, KSP_DIVERGED_ITS, KSP_DIVERGED_NANORINF, MatDestroy, PETSC_NULL_FUNCTION, tKSP, &
    tMat, tVec, VecDestroy
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_distributed_petsc, only: has_failed
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_scheme_proximal_system, only: solve_outcome_t
  implicit none
  private
  public :: drop_solver, run_solver, watch_ritz_values

  type, public :: solver_t  !! A linear solver with its coarse matrix.
    logical :: is_set = .false.  !! Whether there is one.
    type(tKSP) :: ksp  !! The solver.
    type(tMat) :: coarse  !! Its coarse matrix.
  end type solver_t

  !> Residuals may grow on the way, where motions are restrained by few rows: no reason to stop [].
  real(dp), parameter :: largest_growth = 1.0e30_dp
  !> Ritz values of a symmetric cycle are between 0 and little more than 1: a greater one tells that it is not positive,
  !> or far from any inverse. PETSc itself notes changes of sign, not a first product r.z that is negative [].
  real(dp), parameter :: greatest_ritz_value = 10

contains

  !> Make a solver end where its Ritz values tell that the preconditioner is not positive: long before its residuals do.
  subroutine watch_ritz_values(ksp)
    type(tKSP), intent(inout) :: ksp  !! Conjugate gradients that compute them.
    integer :: code
    external :: KSPSetConvergenceTest
    call KSPSetConvergenceTest(ksp, is_converged, 0, PETSC_NULL_FUNCTION, code)
  end subroutine watch_ritz_values

  !> PETSc's test of convergence: as its own for an absolute tolerance, and with the Ritz values.
  subroutine is_converged(ksp, n, residual, reason, context, code)
    type(tKSP), intent(in) :: ksp  !! The solver.
    integer, intent(in) :: n  !! Iterations so far.
    real(dp), intent(in) :: residual  !! Residual in the norm of the preconditioner [sqrt(energy)].
    integer, intent(out) :: reason  !! Why it ends, if it does.
    integer, intent(in) :: context  !! Not used.
    integer, intent(out) :: code  !! PETSc's error code.
    real(dp) :: relative, absolute, growth, greatest, least
    integer :: most
    call KSPGetTolerances(ksp, relative, absolute, growth, most, code)
    reason = KSP_CONVERGED_ITERATING
    if (.not. residual <= huge(residual)) then
      reason = KSP_DIVERGED_NANORINF
    else if (residual <= absolute) then
      reason = KSP_CONVERGED_ATOL
    else if (n > 0) then
      call KSPComputeExtremeSingularValues(ksp, greatest, least, code)
      if (.not. (least > 0 .and. greatest < greatest_ritz_value)) reason = KSP_DIVERGED_INDEFINITE_PC
    end if
    associate (not_needed => context)
    end associate
  end subroutine is_converged

  !> Give back a solver.
  subroutine drop_solver(solver)
    type(solver_t), intent(inout) :: solver  !! The solver.
    integer :: code
    if (.not. solver%is_set) return
    call KSPDestroy(solver%ksp, code)
    call MatDestroy(solver%coarse, code)
    solver%is_set = .false.
  end subroutine drop_solver

  !> Solve a system.
  subroutine run_solver(stiffness, solver, r, aim, most_steps, e, outcome, error)
    type(distributed_stiffness_t), intent(in) :: stiffness  !! The stiffness.
    type(solver_t), intent(in) :: solver  !! The solver.
    real(dp), intent(inout), contiguous :: r(:)  !! Forces (n) [force].
    real(dp), intent(in) :: aim  !! Residual in the norm of the preconditioner to end at [sqrt(energy)].
    integer, intent(in) :: most_steps  !! Iterations at most.
    real(dp), intent(inout), contiguous :: e(:)  !! Displacements (n) [length].
    type(solve_outcome_t), intent(out) :: outcome  !! How it went.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tVec) :: b, x
    integer :: code, reason
    call stiffness%wrap(r, b)
    call stiffness%wrap(e, x)
    call KSPSetTolerances(solver%ksp, 0.0_dp, max(aim, tiny(aim)), largest_growth, most_steps, code)
    call KSPSolve(solver%ksp, b, x, code)
    if (has_failed(code, 'conjugate gradients', error)) return
    call KSPGetIterationNumber(solver%ksp, outcome%steps, code)
    call KSPGetResidualNorm(solver%ksp, outcome%residual, code)
    call KSPGetConvergedReason(solver%ksp, reason, code)
    outcome%has_failed = reason < 0 .and. reason /= KSP_DIVERGED_ITS
    call VecDestroy(b, code)
    call VecDestroy(x, code)
  end subroutine run_solver
end module dotyk_distributed_linear_solver
