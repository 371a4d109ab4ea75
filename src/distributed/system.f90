!> The linear systems of the proximal active set over distributed bodies: vectors of own unknowns in, vectors of own
!> unknowns and sums over ranks out.
!>
!> The unknown is the displacement of the free components. The start is the solution without contact, and floating
!> bodies at rest on a Winkler foundation. All rows are in the system: no compliance of rows is formed, so that inactive
!> ones cost nothing and none are screened. The system without active rows is kept: it gives the residual's energy norm
!> of the error bound.
module dotyk_distributed_system
  use petscksp, only: KSPComputeExtremeSingularValues, KSPGetPC, MatGetTrace, MatMult, PCApply, tPC, tVec, VecDestroy
  use petscmat, only: MatNullSpaceCreate, MatNullSpaceDestroy, MatSetNullSpace, PETSC_COMM_WORLD, PETSC_FALSE, tMat, &
    tMatNullSpace
  use petscvec, only: tVec, VecDestroy, VecGetArrayF90, VecRestoreArrayF90
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: golden, rough
  use dotyk_contact_operator, only: contact_operator_t
  use dotyk_distributed_contact_rows, only: without_rounding
  use dotyk_distributed_operator, only: system_operator_t
  use dotyk_distributed_petsc, only: has_failed, sum_of_ranks
  use dotyk_distributed_preconditioner, only: drop_solver, make_coarse_matrix, make_solver, run_solver, solver_t
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  use dotyk_ranks_exchange, only: meet
  use dotyk_scheme_active_set, only: iterate_t, rest_on_winkler_foundation
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_proximal_system, only: proximal_system_t, solve_outcome_t
  implicit none
  private

  !> The systems. PETSc has addresses of components: never copy or move it, destroy it in the end.
  type, extends(proximal_system_t), public :: distributed_system_t
    type(distributed_stiffness_t), pointer :: bodies => null()  !! The stiffness.
    real(dp), allocatable :: u(:)  !! Displacements of the last solution; not allocated before one (n) [length].
    type(system_operator_t), private :: contact, alone  !! The operator with the active rows, and the one without.
    integer :: n_setups = 0  !! Set-ups of the aggregation so far.
    real(dp) :: least = 1  !! Least Ritz value of the preconditioned K; 1 before `solve_alone` [].
    !> Whether incomplete factors were not positive: the aggregation smooths with diagonals from then on.
    logical, private :: is_plain = .false.
    type(solver_t), private :: of_contact, of_bodies  !! Linear solvers: with active rows, and without.
  contains
    procedure :: init => system_init
    procedure :: take_rows => system_take_rows
    procedure :: start => system_start
    procedure :: set_active => system_set_active
    procedure :: solve => system_solve
    procedure :: solve_alone => system_solve_alone
    procedure :: force_norm => system_force_norm
    procedure :: strain_forces => system_strain_forces
    procedure :: energy_norm => system_energy_norm
    procedure :: find_terms => system_find_terms
    procedure :: row_displacement => system_row_displacement
    procedure :: subtract_row_force => system_subtract_row_force
    procedure :: resultants => system_resultants
    procedure :: add_modes => system_add_modes
    procedure :: remove_modes => system_remove_modes
    procedure :: row_compliance => system_row_compliance
    procedure :: smoother_compliance => system_row_compliance
    procedure :: is_rigid_row => system_is_rigid_row
    procedure :: close_gaps => system_close_gaps
    procedure :: product => system_product
    procedure :: is_interrupted => system_is_interrupted
    procedure :: destroy => system_destroy
  end type distributed_system_t

  !> prox as a fraction of the compliance of the rows in the smoother: with 1/1000 coarse levels, whose smoothers do not
  !> know the rows, take up to twice the iterations, with 1/20 proximal steps are more.
  real(dp), parameter :: proximal_fraction = 1.0e-2_dp
  integer, parameter :: most_of_start = 500  !! Iterations at most of the solution that the iteration begins with.
  !> Reduction of the residual, and iterations, that measure Ritz values.
  real(dp), parameter :: reduction_of_sample = 1.0e-8_dp
  integer, parameter :: most_of_sample = 45
  integer, parameter :: most_with_factors = 60  !! Iterations of one system after which incomplete factors are given up.
  !> Fraction of the mean diagonal that is added to coarse matrices of floating bodies: their motions are taken out of
  !> residuals, and must only not be divided by zero [].
  real(dp), parameter :: shift_of_free = 1.0e-7_dp

contains

  !> Make the systems.
  subroutine system_init(self, bodies, operator, error)
    class(distributed_system_t), target, intent(inout) :: self
    type(distributed_stiffness_t), target, intent(in) :: bodies  !! The stiffness; lives longer.
    !> Rows of B of all bodies, the same on all ranks.
    type(contact_operator_t), intent(in) :: operator
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    self%bodies => bodies
    self%n = bodies%dim*bodies%n_own
    self%n_rows = operator%n_rows
    self%proximal_fraction = proximal_fraction
    self%load = bodies%load
    call self%contact%init(bodies, operator%n_rows, without_rounding(operator%block), error)
    if (allocated(error)) return
    call self%alone%init_like(self%contact, error)
    if (allocated(error)) return
    ! Incomplete factors are hardly ever positive where the matrix is nearly singular, and gain nothing on linear
    ! elements, whose finest level has a smoother of its own.
    self%is_plain = bodies%is_linear .or. size(bodies%mode, 2) > 0
    call set_up(self, self%alone, self%of_bodies, error)
    if (.not. allocated(error)) call sample_spectrum(self, error)
  end subroutine system_init

  !> Take the gaps of the rows, which the bending of facets may have changed.
  subroutine system_take_rows(self, qp)
    class(distributed_system_t), target, intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! All rows.
    self%gap = qp%gap - self%contact%rows%prescribed
  end subroutine system_take_rows

  !> The start: displacements without contact, and floating bodies at rest on a Winkler foundation; pressures of the
  !> rows that they close.
  subroutine system_start(self, qp, pressure, u)
    class(distributed_system_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(out) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(inout), contiguous :: u(:)  !! Displacements (n) [length].
    type(iterate_t) :: rest
    type(solve_outcome_t) :: outcome
    type(error_t), allocatable :: error
    real(dp) :: r(self%n), y(self%n_rows)
    logical :: active(self%n_rows)
    r = self%load
    call self%remove_modes(r)
    call self%solve_alone(r, rough, most_of_start, u, outcome, error)
    if (allocated(error)) u(:) = 0
    ! Without motions of floating bodies the rows that they close are far from the solution, and active sets many.
    if (qp%coarse%n > 0) then
      call rest_on_winkler_foundation(qp, rest, active)
      call self%add_modes(qp%coarse%scale*rest%alpha, u)
    end if
    call self%row_displacement(u, y)
    pressure(:) = max(0.0_dp, y - self%gap)/(qp%foundation + qp%theta)
  end subroutine system_start

  !> Take a preconditioner that is positive for certain, and measure its least Ritz value.
  recursive subroutine take_plain(self, error)
    class(distributed_system_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    self%is_plain = .true.
    self%least = 1
    call set_up(self, self%alone, self%of_bodies, error)
    if (.not. allocated(error)) call sample_spectrum(self, error)
  end subroutine take_plain

  !> Measure the least Ritz value under forces without order: loads may leave bodies unloaded.
  recursive subroutine sample_spectrum(self, error)
    class(distributed_system_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    real(dp) :: r(self%n), e(self%n)
    type(solve_outcome_t) :: outcome
    integer :: i
    do i = 1, self%n
      r(i) = modulo(golden*(real(self%bodies%dim, dp)*self%bodies%first + i), 1.0_dp) - 0.5_dp
    end do
    call self%remove_modes(r)
    call self%solve_alone(r, reduction_of_sample, most_of_sample, e, outcome, error)
  end subroutine sample_spectrum

  !> Choose active rows and springs, and set up the solver where the rows change.
  subroutine system_set_active(self, stiffness, spring, error)
    class(distributed_system_t), target, intent(inout) :: self
    real(dp), intent(in) :: stiffness(:)  !! W; zero where not active (n_rows) [force/length].
    type(mode_block_t), intent(in) :: spring(:)  !! T; of size 0 for bodies without modes (n_bodies) [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or PETSc fails.
    logical :: has_rows
    has_rows = self%of_contact%is_set .and. .not. any(abs(stiffness - self%contact%row_stiffness) > 0)
    self%stiffness = stiffness
    self%spring = spring
    if (.not. has_rows) call self%contact%set_active(stiffness, error)
    if (.not. allocated(error)) call self%contact%set_springs(spring, error)
    if (.not. (allocated(error) .or. has_rows)) call set_up(self, self%contact, self%of_contact, error)
  end subroutine system_set_active

  !> Make the solver of an operator.
  subroutine set_up(self, operator, solver, error)
    class(distributed_system_t), intent(inout) :: self
    type(system_operator_t), intent(in) :: operator  !! The operator.
    type(solver_t), intent(inout) :: solver  !! Gets its solver.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    real(dp) :: shift
    integer :: code
    call drop_solver(solver)
    shift = 0
    if (size(self%bodies%mode, 2) > 0) then
      call MatGetTrace(self%bodies%coarse, shift, code)
      shift = shift_of_free*shift/(self%bodies%dim*self%bodies%n_corners)
    end if
    call make_coarse_matrix(self%bodies, operator%rows, operator%row_stiffness, operator%active, shift, &
                            solver%coarse, error)
    if (allocated(error)) return
    call set_null_space(self%bodies, operator%singular, error)
    if (allocated(error)) return
    call make_solver(operator, solver%coarse, self%is_plain, solver%ksp, error)
    solver%is_set = .true.
    self%n_setups = self%n_setups + 1
  end subroutine set_up

  !> Solve (K + B^T W B + R T R^T) e = r: the deflated system, and the amplitudes of the modes.
  subroutine system_solve(self, r, aim, most_steps, e, outcome, error)
    class(distributed_system_t), target, intent(inout) :: self
    real(dp), intent(inout), contiguous :: r(:)  !! Forces (n) [force].
    real(dp), intent(in) :: aim  !! Residual in the norm of the preconditioner to end at [sqrt(energy)].
    integer, intent(in) :: most_steps  !! Iterations at most.
    real(dp), intent(inout), contiguous :: e(:)  !! Displacements (n) [length].
    type(solve_outcome_t), intent(out) :: outcome  !! How it went.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    real(dp) :: deflated(self%n), moved(self%n_rows)
    real(dp), allocatable :: alpha(:)
    deflated = r
    alpha = self%resultants(r)
    call self%contact%modes%solve(alpha)
    call self%contact%subtract_modes(alpha, deflated)
    call run_solver(self%bodies, self%of_contact, deflated, aim, &
                    merge(most_steps, min(most_steps, most_with_factors), self%is_plain), e, outcome, error)
    self%n_iterations = self%n_iterations + outcome%steps
    if (allocated(error)) return
    if (.not. self%is_plain .and. (outcome%has_failed .or. outcome%steps == most_with_factors)) then
      self%is_plain = .true.
      call set_up(self, self%contact, self%of_contact, error)
      if (allocated(error)) return
      call run_solver(self%bodies, self%of_contact, deflated, aim, most_steps, e, outcome, error)
      self%n_iterations = self%n_iterations + outcome%steps
    end if
    if (size(alpha) == 0) return
    call self%row_displacement(e, moved)
    alpha = self%resultants(r) - matmul(self%stiffness*moved, self%contact%row_mode) - &
      self%spring_force(self%resultants(e))
    call self%contact%modes%solve(alpha)
    call self%add_modes(alpha, e)
  end subroutine system_solve

  !> Solve K e = r without contact, and note the least Ritz value.
  recursive subroutine system_solve_alone(self, r, reduction, most_steps, e, outcome, error)
    class(distributed_system_t), intent(inout) :: self
    real(dp), intent(inout), contiguous :: r(:)  !! Forces, without resultants on rigid body modes (n) [force].
    real(dp), intent(in) :: reduction  !! Relative residual to end at [].
    integer, intent(in) :: most_steps  !! Iterations at most.
    real(dp), intent(inout), contiguous :: e(:)  !! Displacements, without rigid body motions (n) [length].
    type(solve_outcome_t), intent(out) :: outcome  !! How it went.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    real(dp) :: greatest, least, aim
    integer :: code
    e = 0
    aim = reduction*self%force_norm(r)
    if (.not. self%is_plain) then
      if (aim < huge(aim)) &
        call run_solver(self%bodies, self%of_bodies, r, aim, min(most_steps, most_with_factors), e, outcome, error)
      self%n_iterations = self%n_iterations + outcome%steps
      outcome%has_failed = outcome%has_failed .or. .not. aim < huge(aim)
      if (.not. allocated(error) .and. (outcome%has_failed .or. outcome%steps == most_with_factors)) then
        call take_plain(self, error)
        if (.not. allocated(error)) aim = reduction*self%force_norm(r)
        if (.not. allocated(error) .and. aim < huge(aim)) &
          call run_solver(self%bodies, self%of_bodies, r, aim, most_steps, e, outcome, error)
        self%n_iterations = self%n_iterations + outcome%steps
      end if
    else
      call run_solver(self%bodies, self%of_bodies, r, aim, most_steps, e, outcome, error)
      self%n_iterations = self%n_iterations + outcome%steps
    end if
    outcome%has_failed = outcome%has_failed .or. .not. aim < huge(aim)
    if (allocated(error) .or. outcome%steps == 0 .or. outcome%has_failed) return
    call KSPComputeExtremeSingularValues(self%of_bodies%ksp, greatest, least, code)
    if (least > 0) self%least = min(self%least, least)
  end subroutine system_solve_alone

  !> sqrt(r^T K^+ r) at most, as far as the least Ritz value tells [sqrt(energy)].
  recursive real(dp) function system_force_norm(self, r) result(norm)
    class(distributed_system_t), intent(inout) :: self
    real(dp), intent(inout), contiguous :: r(:)  !! Forces; without resultants on return (n) [force].
    real(dp) :: z(size(r)), square
    type(tVec) :: b, x
    type(tPC) :: pc
    type(error_t), allocatable :: error
    integer :: code
    call self%remove_modes(r)
    call self%bodies%wrap(r, b)
    call self%bodies%wrap(z, x)
    call KSPGetPC(self%of_bodies%ksp, pc, code)
    call PCApply(pc, b, x, code)
    call VecDestroy(b, code)
    call VecDestroy(x, code)
    square = self%product(r, z)
    norm = 0
    if (square > 0) norm = sqrt(square/self%least)
    if (square > 0 .and. square <= huge(square)) return
    if (abs(self%product(r, r)) <= 0) return
    ! A preconditioner that is not positive tells nothing.
    norm = huge(norm)
    if (self%is_plain) return
    call take_plain(self, error)
    if (.not. allocated(error)) norm = self%force_norm(r)
  end function system_force_norm

  !> f = K u without the rigid motions of u, of which rounding would leave forces.
  subroutine system_strain_forces(self, u, f)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(out), contiguous :: f(:)  !! (n) [force]
    real(dp) :: strained(self%n), found(self%n)
    type(tVec) :: from, to
    integer :: code
    strained = u
    call self%remove_modes(strained)
    call self%bodies%wrap(strained, from)
    call self%bodies%wrap(found, to)
    call MatMult(self%bodies%matrix(), from, to, code)
    call VecDestroy(from, code)
    call VecDestroy(to, code)
    f(:) = found
  end subroutine system_strain_forces

  !> Energy norm of the displacements, prescribed ones included [sqrt(energy)].
  real(dp) function system_energy_norm(self, u, f) result(norm)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(in), contiguous :: f(:)  !! K u (n) [force].
    norm = sqrt(max(0.0_dp, self%product(u, f) + 2*self%product(u, self%bodies%lift) + 2*self%bodies%lift_energy))
  end function system_energy_norm

  !> Strain energy and work of the loads.
  subroutine system_find_terms(self, u, terms)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), allocatable, intent(inout) :: terms(:)  !! (2) [energy]
    real(dp) :: f(self%n)
    call self%strain_forces(u, f)
    terms = self%product(u, self%bodies%lift) + [self%bodies%lift_energy, self%bodies%lift_work] + &
      [self%product(u, f)/2, self%product(u, self%load)]
  end subroutine system_find_terms

  !> y = B u, without prescribed displacements.
  subroutine system_row_displacement(self, u, y)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(out) :: y(:)  !! The same on all ranks (n_rows) [length].
    real(dp) :: found(size(y))
    call self%contact%rows%displacement(u, found)
    y = found
  end subroutine system_row_displacement

  !> r := r - B^T lambda.
  subroutine system_subtract_row_force(self, lambda, r)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in) :: lambda(:)  !! Forces, the same on all ranks (n_rows) [force].
    real(dp), intent(inout), contiguous :: r(:)  !! (n) [force]
    call self%contact%rows%subtract_force(lambda, r)
  end subroutine system_subtract_row_force

  !> R^T f.
  function system_resultants(self, f) result(resultant)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Forces (n) [force].
    real(dp), allocatable :: resultant(:)  !! The same on all ranks (n_modes) [force].
    resultant = matmul(f, self%bodies%mode)
    if (size(resultant) > 0) call sum_of_ranks(resultant)
  end function system_resultants

  !> u := u + R alpha.
  subroutine system_add_modes(self, alpha, u)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (n_modes) [length].
    real(dp), intent(inout), contiguous :: u(:)  !! Displacements (n) [length].
    if (size(alpha) > 0) u(:) = u + matmul(self%bodies%mode, alpha)
  end subroutine system_add_modes

  !> Take all rigid body modes out of forces or displacements.
  subroutine system_remove_modes(self, x)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(inout), contiguous :: x(:)  !! Forces or displacements (n) [any].
    call self%add_modes(-self%resultants(x), x)
  end subroutine system_remove_modes

  !> Diagonal of B D^{-1} B^T, D the diagonal blocks of the smoother.
  pure function system_row_compliance(self) result(compliance)
    class(distributed_system_t), intent(in) :: self
    real(dp) :: compliance(self%n_rows)  !! (n_rows) [length/force]
    compliance = self%contact%rows%self_compliance
  end function system_row_compliance

  !> Whether rows have no free unknown.
  pure function system_is_rigid_row(self) result(is_rigid)
    class(distributed_system_t), intent(in) :: self
    logical :: is_rigid(self%n_rows)  !! (n_rows)
    is_rigid = .not. self%contact%rows%self_compliance > 0
  end function system_is_rigid_row

  !> Close the gaps of some rows.
  subroutine system_close_gaps(self, chosen, gap, softness, shift, closed, norm, error)
    class(distributed_system_t), intent(in) :: self
    logical, intent(in) :: chosen(:)  !! Rows to close (n_rows).
    real(dp), intent(in) :: gap(:)  !! Gaps to close (n_rows) [length].
    real(dp), intent(in) :: softness(:)  !! theta/w (n_rows) [length/force].
    real(dp), intent(in) :: shift  !! Fraction of the diagonal that is added [].
    real(dp), intent(out) :: closed(:)  !! B g, of all rows (n_rows) [length].
    real(dp), intent(out) :: norm  !! Energy norm of g, at most; `huge` where there is none [sqrt(energy)].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or memory runs out.
    call self%contact%rows%close_gaps(chosen, gap, softness, shift, closed, norm, error)
  end subroutine system_close_gaps

  !> Scalar product over all ranks.
  real(dp) function system_product(self, a, b) result(product)
    class(distributed_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: a(:), b(:)  !! Vectors (n) [any].
    real(dp) :: sum(1)
    sum = dot_product(a(:self%n), b(:self%n))
    call sum_of_ranks(sum)
    product = sum(1)
  end function system_product

  !> Whether a rank was asked to stop.
  logical function system_is_interrupted(self) result(is_interrupted)
    class(distributed_system_t), intent(in) :: self
    call meet()
    is_interrupted = interrupted()
    associate (not_needed => self%n)
    end associate
  end function system_is_interrupted

  !> Give back the memory; the stiffness remains.
  subroutine system_destroy(self)
    class(distributed_system_t), intent(inout) :: self
    call drop_solver(self%of_contact)
    call drop_solver(self%of_bodies)
    call self%contact%destroy()
    call self%alone%destroy()
  end subroutine system_destroy

  !> Make the rigid body modes the null space of an operator: solvers take them out of residuals and iterates.
  subroutine set_null_space(stiffness, matrix, error)
    type(distributed_stiffness_t), intent(in) :: stiffness  !! With the modes.
    type(tMat), intent(in) :: matrix  !! The operator.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    type(tMatNullSpace) :: space
    type(tVec) :: vector(size(stiffness%mode, 2))
    real(dp), pointer :: x(:)
    integer :: k, code
    do k = 1, size(vector)
      call stiffness%make_vector(vector(k))
      call VecGetArrayF90(vector(k), x, code)
      x = stiffness%mode(:, k)
      call VecRestoreArrayF90(vector(k), x, code)
    end do
    call MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, size(vector), vector, space, code)
    call MatSetNullSpace(matrix, space, code)
    call MatNullSpaceDestroy(space, code)
    do k = 1, size(vector)
      call VecDestroy(vector(k), code)
    end do
    if (has_failed(code, 'null space', error)) return
  end subroutine set_null_space
end module dotyk_distributed_system
