!> The linear systems of the proximal active set over distributed bodies: vectors of own unknowns in, vectors of own
!> unknowns and sums over ranks out.
!>
!> The system without active rows is kept: it gives the residual's energy norm of the error bound.
module dotyk_distributed_system
  use petscksp, only: KSPComputeExtremeSingularValues, KSPGetPC, MatGetTrace, MatMult, PCApply, tPC, tVec, VecDestroy
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_contact_operator, only: contact_block_t
  use dotyk_distributed_contact_rows, only: contact_rows_t
  use dotyk_distributed_indeterminate_modes, only: all_modes, find_indeterminate, set_null_space
  use dotyk_distributed_linear_solver, only: drop_solver, run_solver, solve_outcome_t, solver_t
  use dotyk_distributed_operator, only: system_operator_t
  use dotyk_distributed_petsc, only: has_failed, sum_of_ranks
  use dotyk_distributed_preconditioner, only: make_coarse_matrix, make_solver
  use dotyk_distributed_stiffness, only: distributed_stiffness_t
  implicit none
  private

  !> The systems. PETSc has addresses of components: never copy or move it, destroy it in the end.
  type, public :: distributed_system_t
    !> Own unknowns, and contact rows.
    integer :: n = 0, n_rows = 0
    !> The stiffness.
    type(distributed_stiffness_t), pointer :: stiffness => null()
    !> The operator with the active rows, and the one without.
    type(system_operator_t), private :: contact, alone
    !> Displacements of the rows by the rigid body modes (n_rows, n_modes) [].
    real(dp), allocatable :: row_mode(:, :)
    !> Amplitudes of the motions that the active rows do not restrain, orthonormal (n_modes, n_free) [].
    real(dp), allocatable :: free_mode(:, :)
    !> Set-ups of the aggregation, and iterations, so far.
    integer :: n_setups = 0, n_iterations = 0
    !> Least Ritz value of the preconditioned K; 1 before `solve_alone` [].
    real(dp) :: least = 1
    !> Whether incomplete factors were not positive: the aggregation smooths with diagonals from then on.
    logical, private :: is_plain = .false.
    !> Linear solvers: with active rows, and without.
    type(solver_t), private :: of_contact, of_bodies
  contains
    procedure :: init => system_init
    procedure :: set_active => system_set_active
    procedure :: solve => system_solve
    procedure :: solve_alone => system_solve_alone
    procedure :: force_norm => system_force_norm
    procedure :: strain_forces => system_strain_forces
    procedure :: row_displacement => system_row_displacement
    procedure :: subtract_row_force => system_subtract_row_force
    procedure :: remove_motions => system_remove_motions
    procedure :: remove_modes => system_remove_modes
    procedure :: row_compliance => system_row_compliance
    procedure :: rows => system_rows
    procedure :: prescribed => system_prescribed
    procedure :: product => system_product
    procedure :: destroy => system_destroy
  end type distributed_system_t

  !> Fractions of its multiples have no order.
  real(dp), parameter :: golden = 0.6180339887498949_dp
  !> Reduction of the residual, and iterations, that measure Ritz values.
  real(dp), parameter :: reduction_of_sample = 1.0e-8_dp
  integer, parameter :: most_of_sample = 45
  !> Iterations of one system after which incomplete factors are given up.
  integer, parameter :: most_with_factors = 60
  !> Fraction of the mean diagonal that is added to coarse matrices where modes are indeterminate: they are taken out of
  !> residuals, and must only not be divided by zero [].
  real(dp), parameter :: shift_of_free = 1.0e-7_dp

contains

  !> Make the systems.
  subroutine system_init(self, stiffness, n_rows, block, error)
    class(distributed_system_t), target, intent(inout) :: self
    !> The stiffness.
    type(distributed_stiffness_t), target, intent(in) :: stiffness
    !> Number of rows.
    integer, intent(in) :: n_rows
    !> Rows of B, body by body (n_bodies).
    type(contact_block_t), intent(in) :: block(:)
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    integer :: k
    self%stiffness => stiffness
    self%n = stiffness%dim*stiffness%n_own
    self%n_rows = n_rows
    call self%contact%init(stiffness, n_rows, block, error)
    if (allocated(error)) return
    allocate (self%row_mode(n_rows, size(stiffness%mode, 2)))
    do k = 1, size(stiffness%mode, 2)
      call self%contact%rows%displacement(stiffness%mode(:, k), self%row_mode(:, k))
    end do
    call self%alone%init_like(self%contact, error)
    if (allocated(error)) return
    ! Incomplete factors are hardly ever positive where the matrix is nearly singular, and gain nothing on linear
    ! elements, whose finest level has a smoother of its own.
    self%is_plain = stiffness%is_linear .or. size(stiffness%mode, 2) > 0
    call set_up_alone(self, error)
    if (.not. allocated(error)) call sample_spectrum(self, error)
  end subroutine system_init

  !> Make the solver of the bodies without contact.
  subroutine set_up_alone(self, error)
    !> The systems.
    class(distributed_system_t), intent(inout) :: self
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: of_contact(:, :)
    call move_alloc(self%free_mode, of_contact)
    call all_modes(size(self%stiffness%mode, 2), self%free_mode)
    call set_up(self, self%alone, self%of_bodies, error)
    if (allocated(of_contact)) call move_alloc(of_contact, self%free_mode)
  end subroutine set_up_alone

  !> Take a preconditioner that is positive for certain, and measure its least Ritz value.
  recursive subroutine take_plain(self, error)
    !> The systems.
    class(distributed_system_t), intent(inout) :: self
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    self%is_plain = .true.
    self%least = 1
    call set_up_alone(self, error)
    if (.not. allocated(error)) call sample_spectrum(self, error)
  end subroutine take_plain

  !> Measure the least Ritz value under forces without order: loads may leave bodies unloaded.
  recursive subroutine sample_spectrum(self, error)
    !> The systems.
    class(distributed_system_t), intent(inout) :: self
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: r(self%n), e(self%n)
    real(dp), allocatable :: component(:)
    type(solve_outcome_t) :: outcome
    integer :: i
    do i = 1, self%n
      r(i) = modulo(golden*(real(self%stiffness%dim, dp)*self%stiffness%first + i), 1.0_dp) - 0.5_dp
    end do
    call self%remove_modes(r, component)
    call self%solve_alone(r, reduction_of_sample, most_of_sample, e, outcome, error)
  end subroutine sample_spectrum

  !> Choose the active rows and their stiffness, and set up their solver.
  subroutine system_set_active(self, row_stiffness, error)
    class(distributed_system_t), target, intent(inout) :: self
    !> W; zero where not active (n_rows) [force/length].
    real(dp), intent(in) :: row_stiffness(:)
    !> Allocated where a number is not finite, or PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    if (self%of_contact%is_set .and. .not. any(abs(row_stiffness - self%contact%row_stiffness) > 0)) return
    call self%contact%set_active(row_stiffness, error)
    if (.not. allocated(error)) call find_indeterminate(self%row_mode, row_stiffness, self%free_mode, error)
    if (.not. allocated(error)) call set_up(self, self%contact, self%of_contact, error)
  end subroutine system_set_active

  !> Make the solver of an operator.
  subroutine set_up(self, operator, solver, error)
    !> The systems, with the indeterminate modes.
    class(distributed_system_t), intent(inout) :: self
    !> The operator.
    type(system_operator_t), intent(in) :: operator
    !> Gets its solver.
    type(solver_t), intent(inout) :: solver
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: shift
    integer :: code
    call drop_solver(solver)
    shift = 0
    if (size(self%free_mode, 2) > 0) then
      call MatGetTrace(self%stiffness%coarse, shift, code)
      shift = shift_of_free*shift/(self%stiffness%dim*self%stiffness%n_corners)
    end if
    call make_coarse_matrix(self%stiffness, operator%rows, operator%row_stiffness, operator%active, shift, &
                            solver%coarse, error)
    if (allocated(error)) return
    call set_null_space(self%stiffness, self%free_mode, operator%singular, error)
    if (allocated(error)) return
    call make_solver(operator, solver%coarse, self%is_plain, solver%ksp, error)
    solver%is_set = .true.
    self%n_setups = self%n_setups + 1
  end subroutine set_up

  !> Solve (K + B^T W B) e = r.
  subroutine system_solve(self, r, aim, most_steps, e, outcome, error)
    class(distributed_system_t), intent(inout) :: self
    !> Forces, without resultants on indeterminate modes (n) [force].
    real(dp), intent(inout), contiguous :: r(:)
    !> Residual in the norm of the preconditioner to end at [sqrt(energy)].
    real(dp), intent(in) :: aim
    !> Iterations at most.
    integer, intent(in) :: most_steps
    !> Displacements, without indeterminate modes (n) [length].
    real(dp), intent(inout), contiguous :: e(:)
    !> How it went.
    type(solve_outcome_t), intent(out) :: outcome
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    if (.not. self%is_plain) then
      call run_solver(self%stiffness, self%of_contact, r, aim, min(most_steps, most_with_factors), e, outcome, error)
      self%n_iterations = self%n_iterations + outcome%steps
      if (allocated(error) .or. .not. (outcome%has_failed .or. outcome%steps == most_with_factors)) return
      self%is_plain = .true.
      call set_up(self, self%contact, self%of_contact, error)
      if (allocated(error)) return
    end if
    call run_solver(self%stiffness, self%of_contact, r, aim, most_steps, e, outcome, error)
    self%n_iterations = self%n_iterations + outcome%steps
  end subroutine system_solve

  !> Solve K e = r without contact, and note the least Ritz value.
  recursive subroutine system_solve_alone(self, r, reduction, most_steps, e, outcome, error)
    class(distributed_system_t), intent(inout) :: self
    !> Forces, without resultants on rigid body modes (n) [force].
    real(dp), intent(inout), contiguous :: r(:)
    !> Relative residual to end at [].
    real(dp), intent(in) :: reduction
    !> Iterations at most.
    integer, intent(in) :: most_steps
    !> Displacements, without rigid body motions (n) [length].
    real(dp), intent(inout), contiguous :: e(:)
    !> How it went.
    type(solve_outcome_t), intent(out) :: outcome
    !> Allocated where PETSc fails.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: greatest, least, aim
    integer :: code
    e = 0
    aim = reduction*self%force_norm(r)
    if (.not. self%is_plain) then
      if (aim < huge(aim)) &
        call run_solver(self%stiffness, self%of_bodies, r, aim, min(most_steps, most_with_factors), e, outcome, error)
      self%n_iterations = self%n_iterations + outcome%steps
      outcome%has_failed = outcome%has_failed .or. .not. aim < huge(aim)
      if (.not. allocated(error) .and. (outcome%has_failed .or. outcome%steps == most_with_factors)) then
        call take_plain(self, error)
        if (.not. allocated(error)) aim = reduction*self%force_norm(r)
        if (.not. allocated(error) .and. aim < huge(aim)) &
          call run_solver(self%stiffness, self%of_bodies, r, aim, most_steps, e, outcome, error)
        self%n_iterations = self%n_iterations + outcome%steps
      end if
    else
      call run_solver(self%stiffness, self%of_bodies, r, aim, most_steps, e, outcome, error)
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
    !> Forces, without resultants on rigid body modes (n) [force].
    real(dp), intent(inout), contiguous :: r(:)
    real(dp) :: z(size(r)), square
    type(tVec) :: b, x
    type(tPC) :: pc
    type(error_t), allocatable :: error
    integer :: code
    call self%stiffness%wrap(r, b)
    call self%stiffness%wrap(z, x)
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

  !> f = K x.
  subroutine system_strain_forces(self, x, f)
    class(distributed_system_t), intent(inout) :: self
    !> Displacements (n) [length].
    real(dp), intent(inout), contiguous :: x(:)
    !> (n) [force]
    real(dp), intent(inout), contiguous :: f(:)
    type(tVec) :: from, to
    integer :: code
    call self%stiffness%wrap(x, from)
    call self%stiffness%wrap(f, to)
    call MatMult(self%stiffness%matrix(), from, to, code)
    call VecDestroy(from, code)
    call VecDestroy(to, code)
  end subroutine system_strain_forces

  !> y = B x, without prescribed displacements.
  subroutine system_row_displacement(self, x, y)
    class(distributed_system_t), intent(in) :: self
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: x(:)
    !> The same on all ranks (n_rows) [length].
    real(dp), intent(out), contiguous :: y(:)
    call self%contact%rows%displacement(x, y)
  end subroutine system_row_displacement

  !> r := r - B^T lambda.
  subroutine system_subtract_row_force(self, lambda, r)
    class(distributed_system_t), intent(in) :: self
    !> Forces, the same on all ranks (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> (n) [force]
    real(dp), intent(inout), contiguous :: r(:)
    call self%contact%rows%subtract_force(lambda, r)
  end subroutine system_subtract_row_force

  !> Take motions out of forces or displacements: their components on the modes.
  subroutine system_remove_motions(self, motion, x, component)
    class(distributed_system_t), intent(in) :: self
    !> Amplitudes of the motions, orthonormal (n_modes, n_motions) [].
    real(dp), intent(in) :: motion(:, :)
    !> Forces or displacements (n) [any].
    real(dp), intent(inout) :: x(:)
    !> Components that were taken out (n_motions) [as x].
    real(dp), allocatable, intent(out) :: component(:)
    real(dp) :: on_modes(size(motion, 1))
    allocate (component(size(motion, 2)), source=0.0_dp)
    if (size(motion, 2) == 0) return
    on_modes = matmul(x, self%stiffness%mode)
    call sum_of_ranks(on_modes)
    component = matmul(on_modes, motion)
    x = x - matmul(self%stiffness%mode, matmul(motion, component))
  end subroutine system_remove_motions

  !> Take all rigid body modes out of forces or displacements.
  subroutine system_remove_modes(self, x, component)
    class(distributed_system_t), intent(in) :: self
    !> Forces or displacements (n) [any].
    real(dp), intent(inout) :: x(:)
    !> Components that were taken out (n_modes) [as x].
    real(dp), allocatable, intent(out) :: component(:)
    real(dp), allocatable :: all(:, :)
    call all_modes(size(self%row_mode, 2), all)
    call self%remove_motions(all, x, component)
  end subroutine system_remove_modes

  !> Diagonal of B D^{-1} B^T, D the diagonal blocks of the smoother.
  pure function system_row_compliance(self) result(compliance)
    class(distributed_system_t), intent(in) :: self
    !> (n_rows) [length/force]
    real(dp) :: compliance(self%n_rows)
    compliance = self%contact%rows%self_compliance
  end function system_row_compliance

  !> The rows, for `close_gaps`.
  function system_rows(self) result(rows)
    class(distributed_system_t), intent(in), target :: self
    type(contact_rows_t), pointer :: rows
    rows => self%contact%rows
  end function system_rows

  !> Displacement of the rows by prescribed displacements.
  pure function system_prescribed(self) result(y)
    class(distributed_system_t), intent(in) :: self
    !> (n_rows) [length]
    real(dp) :: y(self%n_rows)
    y = self%contact%rows%prescribed
  end function system_prescribed

  !> Scalar product over all ranks.
  real(dp) function system_product(self, a, b) result(product)
    class(distributed_system_t), intent(in) :: self
    !> Vectors (n) [any].
    real(dp), intent(in) :: a(:), b(:)
    real(dp) :: sum(1)
    sum = dot_product(a(:self%n), b(:self%n))
    call sum_of_ranks(sum)
    product = sum(1)
  end function system_product

  !> Give back the memory; the stiffness remains.
  subroutine system_destroy(self)
    class(distributed_system_t), intent(inout) :: self
    call drop_solver(self%of_contact)
    call drop_solver(self%of_bodies)
    call self%contact%destroy()
    call self%alone%destroy()
  end subroutine system_destroy
end module dotyk_distributed_system
