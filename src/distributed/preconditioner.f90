!> The linear solver of an active set: PETSc's conjugate gradients with a cycle of two levels. On the fine one Chebyshev
!> smoothing with D + B^T W B (`dotyk_distributed_operator`), on the corner space one cycle of smoothed aggregation
!> (GAMG) of the assembled `P^T (K + B^T W B) P` with rigid motions as near null space. Linear elements have the latter
!> alone.
!>
!> Options of the aggregation have the prefix `-corner_`, or `-plain_corner_` where incomplete factors of its smoothers
!> are not positive.
module dotyk_distributed_preconditioner
  use petscksp, only: ADD_VALUES, DIFFERENT_NONZERO_PATTERN, INSERT_VALUES, KSP_CONVERGED_ATOL, &
    KSP_CONVERGED_ITERATING, KSP_DIVERGED_INDEFINITE_PC, KSP_DIVERGED_ITS, KSP_DIVERGED_NANORINF, KSP_NORM_NATURAL, &
    KSP_NORM_NONE, KSPChebyshevEstEigSet, KSPChebyshevSetEigenvalues, KSPComputeExtremeSingularValues, KSPCreate, &
    KSPDestroy, KSPGetConvergedReason, KSPGetIterationNumber, KSPGetOperators, KSPGetPC, KSPGetResidualNorm, &
    KSPGetTolerances, KSPSetComputeSingularValues, KSPSetNormType, KSPSetOperators, KSPSetTolerances, KSPSetType, &
    KSPSetUp, KSPSolve, MAT_COPY_VALUES, MAT_FINAL_ASSEMBLY, MAT_INITIAL_MATRIX, MAT_SPD, MatAssemblyBegin, &
    MatAssemblyEnd, MatAXPY, MatCreate, MatCreateAIJ, MatDestroy, MatDiagonalSet, MatDuplicate, MatGetDiagonal, &
    MatGetNearNullSpace, MatMatMult, MatNorm, MatSetNearNullSpace, MatSetOption, MatSetSizes, MatSetType, &
    MatSetValues, MatShift, MatTransposeMatMult, NORM_FROBENIUS, PCMGGetCoarseSolve, PCMGGetInterpolation, &
    PCMGGetLevels, PCMGGetSmoother, PCMGSetInterpolation, PCSetFromOptions, PCSetType, PCSetUp, PCSetUseAmat, &
    PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DEFAULT_REAL, PETSC_FALSE, PETSC_NULL_FUNCTION, PETSC_NULL_INTEGER, &
    PETSC_NULL_MPI_COMM, PETSC_NULL_VEC, PETSC_TRUE, tKSP, tMat, tMatNullSpace, tPC, tVec, VecDestroy, VecGetArrayF90, &
    VecRestoreArrayF90
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: given_rounding
  use dotyk_distributed_contact_rows, only: contact_rows_t
  use dotyk_distributed_operator, only: system_operator_t
  use dotyk_distributed_petsc, only: has_failed, largest_of_ranks, petsc_option, sum_of_ranks
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_scheme_proximal_system, only: solve_outcome_t
  implicit none
  private
  public :: make_coarse_matrix, make_solver, drop_solver, run_solver

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

  !> Steps of the smoother before and after the correction, and the ratio of the ends of its interval, as in
  !> `dotyk_linalg_chebyshev`.
  integer, parameter :: degree = 3
  real(dp), parameter :: ratio = 8
  character(*), parameter :: aggregation_degree = '3'  !! Steps of the smoothers of the aggregation.
  !> Ends of their intervals as multiples of an estimate of the greatest eigenvalue.
  real(dp), parameter :: least_of_interval = 0.1_dp, greatest_of_interval = 1.1_dp

contains

  !> P^T (K + B^T W B) P.
  subroutine make_coarse_matrix(stiffness, rows, row_stiffness, active, shift, matrix, error)
    type(distributed_stiffness_t), intent(in) :: stiffness  !! The stiffness.
    type(contact_rows_t), intent(in) :: rows  !! The rows.
    real(dp), intent(in) :: row_stiffness(:)  !! W (n_rows) [force/length].
    integer, intent(in) :: active(:)  !! Active rows (n).
    real(dp), intent(in) :: shift  !! Added to the diagonal: positive where modes are indeterminate [force/length].
    type(tMat), intent(inout) :: matrix  !! The matrix.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tMat) :: fine_rows, corner_rows, product
    real(dp) :: norm
    type(tMatNullSpace) :: space
    integer :: code
    call MatDuplicate(stiffness%coarse, MAT_COPY_VALUES, matrix, code)
    if (has_failed(code, 'coarse matrix', error)) return
    if (size(active) > 0) then
      call make_rows(stiffness, rows, row_stiffness, active, fine_rows, error)
      if (allocated(error)) return
      corner_rows = fine_rows
      if (.not. stiffness%is_linear) then
        call MatMatMult(fine_rows, stiffness%interpolation, MAT_INITIAL_MATRIX, PETSC_DEFAULT_REAL, corner_rows, code)
        call MatDestroy(fine_rows, code)
      end if
      call MatTransposeMatMult(corner_rows, corner_rows, MAT_INITIAL_MATRIX, PETSC_DEFAULT_REAL, product, code)
      if (has_failed(code, 'contact of the coarse matrix', error)) return
      call MatDestroy(corner_rows, code)
      call MatAXPY(matrix, 1.0_dp, product, DIFFERENT_NONZERO_PATTERN, code)
      if (has_failed(code, 'contact of the coarse matrix', error)) return
      call MatDestroy(product, code)
    end if
    if (shift > 0) call MatShift(matrix, shift, code)
    call MatGetNearNullSpace(stiffness%coarse, space, code)
    call MatSetNearNullSpace(matrix, space, code)
    call MatSetOption(matrix, MAT_SPD, PETSC_TRUE, code)
    call MatNorm(matrix, NORM_FROBENIUS, norm, code)
    if (has_failed(code, 'coarse matrix', error)) return
    ! PETSc would look for the eigenvalues of such a matrix for ever.
    if (.not. norm <= huge(norm)) call set_error(error, 'the stiffness with the active contact rows has numbers '// &
                                                 'that are not finite', exit_not_solvable)
  end subroutine make_coarse_matrix

  !> sqrt(W) B on the active rows, distributed.
  subroutine make_rows(stiffness, rows, row_stiffness, active, matrix, error)
    type(distributed_stiffness_t), intent(in) :: stiffness  !! The stiffness.
    type(contact_rows_t), intent(in) :: rows  !! The rows.
    real(dp), intent(in) :: row_stiffness(:)  !! W (n_rows) [force/length].
    integer, intent(in) :: active(:)  !! Active rows (n).
    type(tMat), intent(inout) :: matrix  !! (n x dim*n_nodes) [sqrt(force/length)]
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    integer, allocatable :: length(:), column(:)
    integer :: i, n_own_rows, first, code
    integer :: dim
    external :: MatMPIAIJSetPreallocation, MatSeqAIJSetPreallocation, PetscSplitOwnership
    dim = stiffness%dim
    ! All rows are as long as they are on all ranks together.
    allocate (length, source=rows%own%row_start(active + 1) - rows%own%row_start(active))
    call sum_of_ranks(length)
    call MatCreate(PETSC_COMM_WORLD, matrix, code)
    n_own_rows = PETSC_DECIDE
    i = size(active)
    call PetscSplitOwnership(PETSC_COMM_WORLD, n_own_rows, i, code)
    call MatSetSizes(matrix, n_own_rows, dim*stiffness%n_own, i, PETSC_DECIDE, code)
    call MatSetType(matrix, 'aij', code)
    first = maxval([1, length])
    call MatSeqAIJSetPreallocation(matrix, first, PETSC_NULL_INTEGER, code)
    call MatMPIAIJSetPreallocation(matrix, min(first, dim*stiffness%n_own), PETSC_NULL_INTEGER, first, &
                                   PETSC_NULL_INTEGER, code)
    do i = 1, size(active)
      associate (k => rows%own%row_start(active(i)), last => rows%own%row_start(active(i) + 1) - 1)
        if (last < k) cycle
        column = rows%own%column(k:last) - 1
        column = dim*(stiffness%first + rows%node(column/dim + 1) - 1) + modulo(column, dim)
        call MatSetValues(matrix, 1, [i - 1], size(column), column, &
                          sqrt(row_stiffness(active(i)))*rows%own%value(k:last), ADD_VALUES, code)
      end associate
    end do
    call MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY, code)
    call MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY, code)
    if (has_failed(code, 'contact rows', error)) return
  end subroutine make_rows

  !> Make the solver, and set it up.
  subroutine make_solver(operator, coarse, is_plain, solver, error)
    type(system_operator_t), target, intent(in) :: operator  !! The operator with its active rows.
    type(tMat), intent(in) :: coarse  !! Its matrix on the corner space.
    !> Whether the aggregation smooths with the diagonal alone: slower, but always positive.
    logical, intent(in) :: is_plain
    type(tKSP), intent(inout) :: solver  !! The solver; its preconditioner keeps a reference to the coarse matrix.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tKSP) :: smoother, coarse_solver
    type(tPC) :: pc, smoother_pc
    integer :: n_levels, code
    ! Rows couple the nodes of their facets stiffly, on whatever rank these are: factors of overlapping blocks smooth
    ! that. Diagonals are positive whatever the matrix, with an interval from their own spectrum and a margin.
    call petsc_option('-corner_mg_levels_ksp_max_it', aggregation_degree)
    call petsc_option('-corner_mg_levels_pc_type', 'asm')
    call petsc_option('-corner_mg_levels_pc_asm_type', 'basic')
    call petsc_option('-corner_mg_levels_pc_asm_overlap', '1')
    call petsc_option('-corner_mg_levels_sub_pc_type', 'icc')
    ! Other shifts let negative pivots pass, and the cycle with them.
    call petsc_option('-corner_mg_levels_sub_pc_factor_shift_type', 'positive_definite')
    call petsc_option('-plain_corner_mg_levels_ksp_max_it', aggregation_degree)
    call petsc_option('-plain_corner_mg_levels_pc_type', 'jacobi')
    call petsc_option('-plain_corner_pc_gamg_use_sa_esteig', '0')
    call petsc_option('-plain_corner_mg_levels_esteig_ksp_type', 'gmres')
    ! By conjugate gradients it looks for the eigenvalues of matrices that are not finite for ever.
    call petsc_option('-plain_corner_pc_gamg_esteig_ksp_type', 'gmres')
    call petsc_option('-corner_pc_gamg_esteig_ksp_type', 'gmres')
    call KSPCreate(PETSC_COMM_WORLD, solver, code)
    call KSPSetType(solver, 'cg', code)
    call KSPSetNormType(solver, KSP_NORM_NATURAL, code)
    call KSPSetComputeSingularValues(solver, PETSC_TRUE, code)
    if (.not. is_plain) call watch_ritz_values(solver)
    call KSPGetPC(solver, pc, code)
    if (operator%stiffness%is_linear) then
      call KSPSetOperators(solver, operator%singular, coarse, code)
      call aggregate(pc)
      ! All of it works on the assembled matrix, which is regular: estimates of eigenvalues fail on the other one.
      call PCSetUseAmat(pc, PETSC_FALSE, code)
      call PCSetUp(pc, code)
      if (has_failed(code, 'set-up of the preconditioner', error)) return
      call make_positive(pc, error)
      if (allocated(error)) return
      call PCMGGetLevels(pc, n_levels, code)
      call PCMGGetSmoother(pc, n_levels - 1, smoother, code)
      if (n_levels > 1) call smooth_contact(coarse)
    else
      call KSPSetOperators(solver, operator%singular, operator%singular, code)
      call PCSetType(pc, 'mg', code)
      call PCMGSetLevels(pc, 2, PETSC_NULL_MPI_COMM, code)
      call PCMGSetInterpolation(pc, 1, operator%stiffness%interpolation, code)
      call PCMGGetSmoother(pc, 1, smoother, code)
      call KSPSetType(smoother, 'chebyshev', code)
      call smooth_contact(operator%matrix)
      call KSPGetPC(solver, pc, code)
      call PCMGGetCoarseSolve(pc, coarse_solver, code)
      call KSPSetType(coarse_solver, 'preonly', code)
      call KSPSetOperators(coarse_solver, coarse, coarse, code)
      call KSPGetPC(coarse_solver, pc, code)
      call aggregate(pc)
      if (is_plain) then
        call KSPSetUp(coarse_solver, code)
        if (has_failed(code, 'set-up of the aggregation', error)) return
        call make_positive(pc, error)
        if (allocated(error)) return
      end if
    end if
    call KSPSetUp(solver, code)
    if (has_failed(code, 'set-up of the preconditioner', error)) return
    call forget_products(pc)

  contains

    !> Smoothing on the level of all displacements.
    subroutine smooth_contact(matrix)
      type(tMat), intent(in) :: matrix  !! The matrix whose residuals it smooths.
      call KSPChebyshevSetEigenvalues(smoother, 1.0_dp, 1/ratio, code)
      call KSPSetTolerances(smoother, PETSC_DEFAULT_REAL, PETSC_DEFAULT_REAL, PETSC_DEFAULT_REAL, degree, code)
      call KSPSetNormType(smoother, KSP_NORM_NONE, code)
      call KSPSetOperators(smoother, matrix, matrix, code)
      call KSPGetPC(smoother, smoother_pc, code)
      call operator%make_smoother(smoother_pc)
    end subroutine smooth_contact

    !> Give back what the products of the aggregation keep for other values in the same pattern.
    subroutine forget_products(pc)
      type(tPC), intent(inout) :: pc  !! The aggregation.
      type(tKSP) :: of_level
      type(tMat) :: matrix, same, interpolation
      integer :: level, n, code
      external :: MatProductClear
      call PCMGGetLevels(pc, n, code)
      do level = 0, n - 1
        call PCMGGetSmoother(pc, level, of_level, code)
        call KSPGetOperators(of_level, matrix, same, code)
        call MatProductClear(matrix, code)
        if (level == 0) cycle
        call PCMGGetInterpolation(pc, level, interpolation, code)
        call MatProductClear(interpolation, code)
      end do
    end subroutine forget_products

    !> One cycle of smoothed aggregation.
    subroutine aggregate(pc)
      type(tPC), intent(inout) :: pc  !! The preconditioner.
      call PCSetType(pc, 'gamg', code)
      if (is_plain) then
        call PCSetOptionsPrefix(pc, 'plain_corner_', code)
      else
        call PCSetOptionsPrefix(pc, 'corner_', code)
      end if
      call PCSetFromOptions(pc, code)
    end subroutine aggregate
  end subroutine make_solver

  !> Make the smoothers of the aggregation by diagonals positive: an aggregate of few nodes has motions that nothing
  !> resists, and their diagonal entries are rounding errors. Their intervals are found anew.
  subroutine make_positive(pc, error)
    type(tPC), intent(in) :: pc  !! The aggregation, set up.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tKSP) :: smoother
    type(tMat) :: matrix, other, diagonal
    type(tVec) :: vector
    real(dp), pointer :: x(:)
    real(dp) :: largest(1)
    integer :: n_levels, level, n, code
    call PCMGGetLevels(pc, n_levels, code)
    do level = 1, n_levels - 1
      call PCMGGetSmoother(pc, level, smoother, code)
      call KSPGetOperators(smoother, matrix, other, code)
      call MatCreateVecs(matrix, vector, PETSC_NULL_VEC, code)
      call MatGetDiagonal(matrix, vector, code)
      if (has_failed(code, 'diagonals of the aggregation', error)) return
      call VecGetArrayF90(vector, x, code)
      n = size(x)
      largest = maxval([0.0_dp, x])
      call largest_of_ranks(largest)
      where (.not. x > given_rounding*largest(1)) x = largest(1)
      call VecRestoreArrayF90(vector, x, code)
      call MatCreateAIJ(PETSC_COMM_WORLD, n, n, PETSC_DECIDE, PETSC_DECIDE, 1, PETSC_NULL_INTEGER, 0, &
                        PETSC_NULL_INTEGER, diagonal, code)
      call MatDiagonalSet(diagonal, vector, INSERT_VALUES, code)
      if (has_failed(code, 'diagonals of the aggregation', error)) return
      call KSPSetOperators(smoother, matrix, diagonal, code)
      call KSPChebyshevEstEigSet(smoother, 0.0_dp, least_of_interval, 0.0_dp, greatest_of_interval, code)
      call MatDestroy(diagonal, code)
      call VecDestroy(vector, code)
    end do
  end subroutine make_positive

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
end module dotyk_distributed_preconditioner
