!> The compliance operator of a body through its p-multigrid: conjugate gradients in place of triangular solves.
!>
!> For bodies that are too large for a factor of their own, and for the smaller ones beside them in the same contact
!> problem, whose p-multigrid has the factor of the body itself as its coarse level.
module dotyk_response_multigrid_response
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: rough
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_body_modes, only: body_modes_t
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient
  use dotyk_linalg_fixed_sum, only: remove_components, scalar_product
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_response, only: response_t, substituted_rows_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  implicit none
  private

  !> Compliance operator by p-multigrid. It owns factors: never copy it, destroy it in the end.
  type, extends(response_t), public :: multigrid_response_t
    !> The two levels; a pointer, because systems over many bodies refer to them.
    type(multigrid_t), pointer :: grid => null()
    logical :: is_whole = .false.  !! Whether the coarse level is the body itself: solves are those of its factor.
    real(dp) :: trial = 0  !! Residual of the trial, relative []: large where p-multigrid converges slowly.
    integer :: steps_of_trial = 0  !! Iterations of the trial.
  contains
    procedure :: assemble => response_assemble
    procedure :: analyze => response_analyze
    procedure :: factorize => response_factorize
    procedure :: analyze_whole => response_analyze_whole
    procedure :: factorize_whole => response_factorize_whole
    procedure :: prepare => response_prepare
    procedure :: expected_steps => response_expected_steps
    procedure :: solve => response_solve
    procedure :: solve_roughly => response_solve_roughly
    procedure :: solve_from => response_solve_from
    procedure :: subtract_forces => response_subtract_forces
    procedure :: solve_error => response_solve_error
    procedure :: body_grid => response_body_grid
    procedure :: solve_entries => response_solve_entries
    procedure :: expected_bytes => response_expected_bytes
    procedure :: prepare_substitution => response_prepare_substitution
    procedure :: path_entries => response_path_entries
    procedure :: substitute => response_substitute
    procedure :: product => response_product
    procedure :: destroy => response_destroy
  end type multigrid_response_t

  !> Reduction of the residual of a solve: a few digits below the tolerances that users ask for [].
  real(dp), parameter, public :: accuracy = 1.0e-10_dp
  !> Iterations of a solve at most. Where the p-multigrid works, a tenth of them suffices.
  integer, parameter :: most_steps = 200
  !> Iterations that measure Ritz values at most before a body is solved: those of a solve that takes up to 100.
  integer, parameter :: trial_steps = 45
  real(dp), parameter :: usual_reduction = 1.0e-8_dp  !! Reduction of the residual of a solve of `expected_steps`.
  !> Residual of a start that is kept, as a fraction of the right-hand side [].
  real(dp), parameter, public :: near = 0.05_dp
  !> Operations of a solve, as a multiple of the entries of the block rows.
  integer, parameter :: products_of_solve = 80
  integer, parameter :: bytes_of_rows = 730  !! Block rows of tet10 [bytes/unknown].

contains

  !> Assemble both levels.
  subroutine response_assemble(self, body, error)
    class(multigrid_response_t), intent(inout) :: self
    type(body_t), intent(inout) :: body  !! The body; it need not be assembled. Gets its volume and its mean modulus.
    type(error_t), allocatable, intent(out) :: error  !! As in `assemble` of `multigrid_t`.
    allocate (self%grid)
    call self%grid%assemble(body, error)
    if (allocated(error)) return
    body%volume = self%grid%levels%volume
    body%mean_modulus_factor = self%grid%levels%mean_modulus_factor
  end subroutine response_assemble

  !> Analyse the factorization of the coarse level.
  subroutine response_analyze(self, body, modes, error)
    class(multigrid_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The same body as in `assemble`.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that its supports leave.
    type(error_t), allocatable, intent(out) :: error  !! As in `analyze` of `direct_response_t`.
    call self%grid%analyze(body, modes, error)
  end subroutine response_analyze

  !> Factorize the coarse level.
  subroutine response_factorize(self, body, report, error)
    class(multigrid_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The same body as in `assemble`.
    !> Condition of the corner space; the diagonal is that of the body.
    type(factorization_report_t), intent(out) :: report
    !> Allocated where the stiffness is not positive definite, or memory runs out.
    type(error_t), allocatable, intent(out) :: error
    type(factorization_report_t) :: of_corners
    real(dp), allocatable :: diagonal(:)
    integer :: k
    call self%grid%factorize(of_corners, error)
    if (allocated(error)) return
    ! Springs and modes of the corner space are over other equations.
    report%condition = of_corners%condition
    report%condition_left = of_corners%condition_left
    allocate (report%fixing_equation(0), report%spring(0), report%diagonal(body%constraint%n_equations))
    allocate (diagonal(self%grid%n))
    call self%grid%fine%rows%get_diagonal(diagonal)
    call self%grid%to_equations(diagonal, report%diagonal)
    allocate (self%mode(body%constraint%n_equations, size(self%grid%mode, 2)))
    do k = 1, size(self%mode, 2)
      call self%grid%to_equations(self%grid%mode(:, k), self%mode(:, k))
    end do
  end subroutine response_factorize

  !> The same for a body that is solved directly beside others.
  subroutine response_factorize_whole(self, body, modes, stiffness, report, error)
    class(multigrid_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body, assembled; analysed by `analyze_whole`.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that its supports leave.
    type(stiffness_t), intent(inout) :: stiffness  !! Its stiffness; empty on return.
    type(factorization_report_t), intent(out) :: report  !! Condition of its stiffness.
    type(error_t), allocatable, intent(out) :: error  !! As in `factorize` of `direct_response_t`.
    call self%grid%keep_matrix(stiffness%matrix)
    call self%grid%coarse%factorize(body, stiffness, .false., report, error)
    if (.not. allocated(error)) call self%grid%take_whole(body, modes, error)
  end subroutine response_factorize_whole

  !> Analyse the factorization of a body that is solved directly beside others.
  subroutine response_analyze_whole(self, body, modes, stiffness, error)
    class(multigrid_response_t), intent(inout) :: self
    type(body_t), intent(in) :: body  !! The body, assembled.
    type(body_modes_t), intent(in) :: modes  !! Rigid body modes that its supports leave.
    type(stiffness_t), intent(in) :: stiffness  !! Its stiffness, with the graph of its nodes.
    type(error_t), allocatable, intent(out) :: error  !! As in `analyze` of `direct_response_t`.
    self%is_whole = .true.
    allocate (self%grid)
    self%grid%is_sure = .true.
    call self%grid%coarse%analyze(body, modes, stiffness, error)
    self%mode = self%grid%coarse%mode
  end subroutine response_analyze_whole

  !> Make the smoother, and measure how good the preconditioner is.
  subroutine response_prepare(self, error)
    class(multigrid_response_t), intent(inout) :: self
    !> Allocated where a diagonal block of the stiffness is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    type(cg_outcome_t) :: outcome
    call self%grid%make_smoother(error)
    if (allocated(error) .or. self%is_whole) return
    self%grid%greatest = 0
    call self%grid%measure_spectrum(trial_steps, outcome)
    self%trial = outcome%reduction
    self%steps_of_trial = outcome%steps
  end subroutine response_prepare

  !> Iterations that a solve to 1e-8 takes, by what the trial has left and by its Ritz values, the larger of both.
  pure real(dp) function response_expected_steps(self) result(steps)
    class(multigrid_response_t), intent(in) :: self
    real(dp) :: condition
    steps = 0
    if (self%steps_of_trial == 0 .or. .not. self%trial > 0) return
    steps = huge(steps)
    if (.not. (self%trial < 1 .and. self%grid%least > 0)) return
    condition = self%grid%greatest/self%grid%least
    ! Y. Saad, Iterative Methods for Sparse Linear Systems, 2003, (6.128).
    steps = max(self%steps_of_trial*log(usual_reduction)/log(self%trial), sqrt(condition)/2*log(2/usual_reduction))
  end function response_expected_steps

  !> x := K^+ x.
  subroutine response_solve(self, x)
    class(multigrid_response_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    type(cg_outcome_t) :: outcome
    real(dp), allocatable :: b(:), s(:), r(:)
    real(dp) :: least, greatest, left
    if (self%is_whole) then
      call self%grid%coarse%solve(x)
      return
    end if
    allocate (b(self%grid%n), s(self%grid%n), r(self%grid%n))
    call self%grid%to_system(x, b)
    call remove_components(self%grid%n, self%grid%mode, b)
    call conjugate_gradient(self%grid, b, s, accuracy, most_steps, outcome)
    call remove_components(self%grid%n, self%grid%mode, s)
    call self%grid%to_equations(s, x)
    if (.not. outcome%first_norm > 0) return
    ! The residual of the recurrence need not be that of the solution.
    call self%grid%multiply(s, r)
    r(:) = b - r
    call remove_components(self%grid%n, self%grid%mode, r)
    call self%grid%precondition(r, s)
    left = sqrt(max(0.0_dp, scalar_product(size(r), r, s)))/outcome%first_norm
    call outcome%ritz_values(least, greatest)
    !$omp critical (multigrid_response)
    self%grid%worst = max(self%grid%worst, left, outcome%reduction)
    if (least > 0) self%grid%least = min(self%grid%least, least)
    !$omp end critical (multigrid_response)
  end subroutine response_solve

  !> x := K^+ x to some percent: what it leaves is for `subtract_forces` to tell.
  subroutine response_solve_roughly(self, x)
    class(multigrid_response_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    type(cg_outcome_t) :: outcome
    real(dp), allocatable :: b(:), s(:)
    if (self%is_whole) then
      call self%solve(x)
      return
    end if
    allocate (b(self%grid%n), s(self%grid%n))
    call self%grid%to_system(x, b)
    call remove_components(self%grid%n, self%grid%mode, b)
    call conjugate_gradient(self%grid, b, s, rough, most_steps, outcome)
    call remove_components(self%grid%n, self%grid%mode, s)
    call self%grid%to_equations(s, x)
  end subroutine response_solve_roughly

  !> x := K^+ x from an approximate solution, which is kept as it is where it leaves a small part of the forces only:
  !> that of the primal scheme, whose bound knows what it leaves.
  subroutine response_solve_from(self, start, x)
    class(multigrid_response_t), intent(in) :: self
    real(dp), intent(in) :: start(:)  !! Approximate solution (n_equations) [length].
    real(dp), intent(inout) :: x(:)  !! Right-hand side [force] in, solution [length] out (n_equations).
    real(dp), allocatable :: b(:), s(:), r(:)
    if (self%is_whole) then
      call self%solve(x)
      return
    end if
    allocate (b(self%grid%n), s(self%grid%n), r(self%grid%n))
    call self%grid%to_system(x, b)
    call remove_components(self%grid%n, self%grid%mode, b)
    call self%grid%to_system(start, s)
    call self%grid%multiply(s, r)
    r(:) = b - r
    if (scalar_product(size(r), r, r) <= near**2*scalar_product(size(b), b, b)) then
      x(:) = start
    else
      call self%solve(x)
    end if
  end subroutine response_solve_from

  !> What a solve leaves, without its resultants on the rigid body modes. That of a factor is rounding.
  subroutine response_subtract_forces(self, x, f)
    class(multigrid_response_t), intent(in) :: self
    real(dp), intent(in) :: x(:)  !! Solution (n_equations) [length].
    real(dp), intent(inout) :: f(:)  !! Right-hand side in, what is left of it out (n_equations) [force].
    real(dp), allocatable :: b(:), s(:), r(:)
    if (self%is_whole) then
      f = 0
      return
    end if
    allocate (b(self%grid%n), s(self%grid%n), r(self%grid%n))
    call self%grid%to_system(f, b)
    call self%grid%to_system(x, s)
    call self%grid%multiply(s, r)
    b(:) = b - r
    call remove_components(self%grid%n, self%grid%mode, b)
    call self%grid%to_equations(b, f)
  end subroutine response_subtract_forces

  !> Relative error of a solve in the energy norm.
  pure real(dp) function response_solve_error(self) result(error)
    class(multigrid_response_t), intent(in) :: self
    error = 0
    if (.not. self%is_whole) error = max(accuracy, self%grid%worst)/sqrt(self%grid%least_eigenvalue())
  end function response_solve_error

  !> The p-multigrid, for systems over several bodies.
  function response_body_grid(self) result(grid)
    class(multigrid_response_t), intent(in) :: self
    class(body_grid_t), pointer :: grid
    grid => self%grid
  end function response_body_grid

  !> Make ready for forward substitutions.
  subroutine response_prepare_substitution(self)
    class(multigrid_response_t), intent(inout) :: self
    if (self%is_whole) call self%grid%coarse%prepare_substitution()
  end subroutine response_prepare_substitution

  !> Cost of one row: a part of a triangular solve, or conjugate gradients.
  real(dp) function response_path_entries(self, equation) result(entries)
    class(multigrid_response_t), intent(inout) :: self
    integer, intent(in) :: equation(:)  !! Equations where the paths begin (n).
    if (self%is_whole) then
      entries = self%grid%coarse%path_entries(equation)
    else
      entries = real(self%solve_entries(), dp)
    end if
  end function response_path_entries

  !> Entries that a solve goes through.
  integer(int64) function response_solve_entries(self) result(entries)
    class(multigrid_response_t), intent(in) :: self
    entries = products_of_solve*size(self%grid%fine%rows%low, kind=int64)
  end function response_solve_entries

  !> Memory of the fine level of a body whose coarse level is the body itself, about [bytes].
  integer(int64) function response_expected_bytes(self, body) result(bytes)
    class(multigrid_response_t), intent(in) :: self
    type(body_t), intent(in) :: body  !! The body.
    bytes = 0
    if (self%is_whole) bytes = bytes_of_rows*int(body%constraint%n_equations, int64)
  end function response_expected_bytes

  !> Rows of B, and K^+ of them where there is no factor: one solve for each. Their values stand in `forward`, row after
  !> row, the solutions in `regularized`.
  subroutine response_substitute(self, rows, substituted)
    class(multigrid_response_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows  !! Rows over the equations.
    type(substituted_rows_t), intent(inout) :: substituted  !! The rows and the solutions.
    real(dp), allocatable :: e(:)
    integer :: j
    if (self%is_whole) then
      call self%grid%coarse%substitute(rows, substituted)
      return
    end if
    substituted%forward%n = rows%n_rows
    substituted%forward%first_column = rows%row_start
    substituted%forward%column = rows%column
    substituted%forward%value = rows%value
    allocate (e(rows%n_rows), substituted%regularized(size(self%mode, 1), rows%n_rows))
    do j = 1, rows%n_rows
      e = 0
      e(j) = 1
      call rows%multiply_transposed(e, substituted%regularized(:rows%n_columns, j))
      substituted%regularized(rows%n_columns + 1:, j) = 0
      call self%solve(substituted%regularized(:, j))
    end do
  end subroutine response_substitute

  !> c_ij = a_i K^+ b_j.
  subroutine response_product(self, a, b, same, c)
    class(multigrid_response_t), intent(in) :: self
    type(substituted_rows_t), intent(in) :: a, b  !! Rows of the two sides.
    logical, intent(in) :: same  !! Whether a and b are the same rows.
    real(dp), intent(out) :: c(:, :)  !! Entries between the rows (a%forward%n, b%forward%n) [length/force].
    integer :: i, j
    if (self%is_whole) then
      call self%grid%coarse%product(a, b, same, c)
      return
    end if
    do j = 1, b%forward%n
      do i = 1, a%forward%n
        associate (first => a%forward%first_column(i), last => a%forward%first_column(i + 1) - 1)
          c(i, j) = dot_product(a%forward%value(first:last), b%regularized(a%forward%column(first:last), j))
        end associate
      end do
    end do
    if (same) c = (c + transpose(c))/2
  end subroutine response_product

  !> Give back all memory.
  subroutine response_destroy(self)
    class(multigrid_response_t), intent(inout) :: self
    if (allocated(self%mode)) deallocate (self%mode)
    if (.not. associated(self%grid)) return
    call self%grid%destroy()
    deallocate (self%grid)
  end subroutine response_destroy
end module dotyk_response_multigrid_response
