!> The linear systems of the primal engine as its active set iteration (`dotyk_scheme_proximal_active_set`) and its
!> error bound (`dotyk_scheme_primal`) see them: stiffness K of all bodies in the displacements, active contact
!> rows of stiffness W, and springs T on the amplitudes of the rigid body modes R of floating bodies, which are
!> orthonormal,
!>
!>     K + B^T W B + R T R^T.
!>
!> Two extensions: bodies of one process (`dotyk_scheme_contact_multigrid`), and bodies that all ranks compute together
!> (`dotyk_distributed_system`), each of which has the unknowns of its own nodes. Rows, modes and sums are the same on
!> all ranks.
module dotyk_scheme_proximal_system
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_thresholds, only: half_digits, sum_rounding
  use dotyk_linalg_dense_cholesky, only: dense_cholesky_t
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private
  public :: multiply_springs

  type, public :: mode_factor_t  !! The factor.
    type(dense_cholesky_t), private :: factor  !! Of the matrix, scaled to a unit diagonal.
    real(dp), allocatable, private :: scale(:)  !! Scales of the modes (n_modes) [sqrt(length/force)].
  contains
    procedure :: init => factor_init
    procedure :: solve => factor_solve
  end type mode_factor_t

  type, public :: solve_outcome_t  !! How a solve went.
    integer :: steps = 0  !! Iterations.
    !> Last residual in the norm of the preconditioner, about the error in the energy norm [sqrt(energy)].
    real(dp) :: residual = 0
    logical :: has_failed = .false.  !! Whether the preconditioner is no positive one for this right-hand side.
  end type solve_outcome_t

  type, abstract, public :: proximal_system_t  !! The systems.
    integer :: n = 0  !! Number of unknowns, of this rank.
    integer :: n_rows = 0  !! Number of contact rows.
    real(dp), allocatable :: stiffness(:)  !! W; zero where not active (n_rows) [force/length].
    !> T by bodies; of size 0 for bodies without modes (n_bodies) [force/length].
    type(mode_block_t), allocatable :: spring(:)
    !> The proximal term as a fraction of the compliance of the rows (`row_compliance`) [].
    real(dp) :: proximal_fraction = 0
    !> Energy norm of a displacement that the unknown one is added to: the norm of the sum is not less than the
    !> difference of both [sqrt(energy)].
    real(dp) :: norm_0 = 0
    real(dp), allocatable :: gap(:)  !! Gaps of the rows, less their displacement where u is zero (n_rows) [length].
    !> Loads and forces of prescribed displacements, as far as u carries them (n) [force].
    real(dp), allocatable :: load(:)
    real(dp) :: error_of_isolated = 0  !! Error of bodies that touch no other, at most [sqrt(energy)].
    integer :: n_iterations = 0, most_iterations = huge(1)  !! Iterations so far, and at most [].
  contains
    procedure :: take_rows => system_take_rows
    procedure :: start => system_start
    procedure :: find_penetrations => system_find_penetrations
    procedure :: find_terms => system_find_terms
    procedure(set_active), deferred :: set_active  !! Choose active rows and springs, and prepare the solver.
    procedure(solve), deferred :: solve  !! Solve.
    procedure(strain_forces), deferred :: strain_forces  !! f = K u.
    procedure(row_displacement), deferred :: row_displacement  !! y = B u.
    procedure(subtract_row_force), deferred :: subtract_row_force  !! r := r - B^T lambda.
    procedure(resultants), deferred :: resultants  !! R^T f.
    procedure(add_modes), deferred :: add_modes  !! u := u + R alpha.
    procedure(row_compliance), deferred :: row_compliance  !! Compliance of each row in a coarse space or a smoother.
    procedure(is_rigid_row), deferred :: is_rigid_row  !! Whether rows have no free unknown.
    procedure(inner_product), deferred :: product  !! Scalar product.
    procedure(force_norm), deferred :: force_norm  !! sqrt(r^T K^+ r), at most.
    procedure(close_gaps), deferred :: close_gaps  !! Displacements g that close gaps, as in `dotyk_scheme_gap_closing`.
    !> The diagonal of B D^{-1} B^T, D the diagonal blocks of the smoother.
    procedure(row_compliance), deferred :: smoother_compliance
    procedure :: spring_force => system_spring_force
    procedure :: energy_norm => system_energy_norm
    procedure :: is_interrupted => system_is_interrupted
  end type proximal_system_t

  abstract interface
    !> Choose active rows and springs, and prepare the solver unless they are unchanged.
    subroutine set_active(self, stiffness, spring, error)
      import :: proximal_system_t, mode_block_t, error_t, dp
      class(proximal_system_t), target, intent(inout) :: self
      real(dp), intent(in) :: stiffness(:)  !! W; zero where not active (n_rows) [force/length].
      type(mode_block_t), intent(in) :: spring(:)  !! T; of size 0 for bodies without modes (n_bodies) [force/length].
      !> Allocated where a number is not finite, memory runs out, or PETSc fails.
      type(error_t), allocatable, intent(out) :: error
    end subroutine set_active

    !> Solve (K + B^T W B + R T R^T) e = r, exactly as to the resultants on the rigid body modes.
    subroutine solve(self, r, aim, most_steps, e, outcome, error)
      import :: proximal_system_t, solve_outcome_t, error_t, dp
      class(proximal_system_t), target, intent(inout) :: self
      real(dp), intent(inout), contiguous :: r(:)  !! Forces (n) [force].
      real(dp), intent(in) :: aim  !! Residual in the norm of the preconditioner to end at [sqrt(energy)].
      integer, intent(in) :: most_steps  !! Iterations at most.
      real(dp), intent(inout), contiguous :: e(:)  !! Displacements (n) [length].
      type(solve_outcome_t), intent(out) :: outcome  !! How it went.
      type(error_t), allocatable, intent(out) :: error  !! Allocated where PETSc fails.
    end subroutine solve

    !> f = K u.
    subroutine strain_forces(self, u, f)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
      real(dp), intent(out), contiguous :: f(:)  !! (n) [force]
    end subroutine strain_forces

    !> y = B u.
    subroutine row_displacement(self, u, y)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
      real(dp), intent(out) :: y(:)  !! (n_rows) [length]
    end subroutine row_displacement

    !> r := r - B^T lambda.
    subroutine subtract_row_force(self, lambda, r)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
      real(dp), intent(inout), contiguous :: r(:)  !! (n) [force]
    end subroutine subtract_row_force

    !> R^T f.
    function resultants(self, f) result(resultant)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      real(dp), intent(in), contiguous :: f(:)  !! Forces (n) [force].
      real(dp), allocatable :: resultant(:)  !! On the rigid body modes (n_modes) [force].
    end function resultants

    !> u := u + R alpha.
    subroutine add_modes(self, alpha, u)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      real(dp), intent(in) :: alpha(:)  !! Amplitudes (n_modes) [length].
      real(dp), intent(inout), contiguous :: u(:)  !! Displacements (n) [length].
    end subroutine add_modes

    !> Compliance of each row.
    pure function row_compliance(self) result(compliance)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      real(dp) :: compliance(self%n_rows)  !! (n_rows) [length/force]
    end function row_compliance

    !> Whether rows have no free unknown.
    pure function is_rigid_row(self) result(is_rigid)
      import :: proximal_system_t
      class(proximal_system_t), intent(in) :: self
      logical :: is_rigid(self%n_rows)  !! (n_rows)
    end function is_rigid_row

    !> Scalar product, over all ranks.
    real(dp) function inner_product(self, a, b) result(product)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      real(dp), intent(in), contiguous :: a(:), b(:)  !! Vectors (n) [any].
    end function inner_product

    !> sqrt(r^T K^+ r) of forces without their resultants on the rigid body modes, at most [sqrt(energy)].
    real(dp) function force_norm(self, r) result(norm)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(inout) :: self
      real(dp), intent(inout), contiguous :: r(:)  !! Forces; without resultants on return (n) [force].
    end function force_norm

    !> Close the gaps of some rows.
    subroutine close_gaps(self, chosen, gap, softness, shift, closed, norm, error)
      import :: proximal_system_t, error_t, dp
      class(proximal_system_t), intent(in) :: self
      logical, intent(in) :: chosen(:)  !! Rows to close (n_rows).
      real(dp), intent(in) :: gap(:)  !! Gaps to close (n_rows) [length].
      real(dp), intent(in) :: softness(:)  !! theta/w (n_rows) [length/force].
      real(dp), intent(in) :: shift  !! Fraction of the diagonal that is added [].
      real(dp), intent(out) :: closed(:)  !! B g, of all rows (n_rows) [length].
      real(dp), intent(out) :: norm  !! Energy norm of g, at most; `huge` where there is none [sqrt(energy)].
      type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or memory runs out.
    end subroutine close_gaps
  end interface

contains

  !> Take the rows of a QP: systems that are not made for rows have all rows.
  subroutine system_take_rows(self, qp)
    class(proximal_system_t), target, intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    associate (not_needed => [self%n_rows, qp%n_rows])
    end associate
  end subroutine system_take_rows

  !> Pressures and displacements where the iteration begins: at rest.
  subroutine system_start(self, qp, pressure, u)
    class(proximal_system_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(out) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(inout), contiguous :: u(:)  !! Displacements (n) [length].
    pressure = 0
    u(:) = 0
    associate (not_needed => [self%n, qp%n_rows, size(qp%theta)])
    end associate
  end subroutine system_start

  !> Penetrations of all rows of a QP, of which those of the system may be a part.
  subroutine system_find_penetrations(self, qp, u, y)
    class(proximal_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! All rows.
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(out) :: y(:)  !! (n_rows) [length]
    call self%row_displacement(u, y)
    y = y - self%gap
    associate (not_needed => qp%n_rows)
    end associate
  end subroutine system_find_penetrations

  !> Strain energy and work of the loads by the displacements: of systems that know the loads of the bodies.
  subroutine system_find_terms(self, u, terms)
    class(proximal_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), allocatable, intent(inout) :: terms(:)  !! Not changed otherwise (2) [energy].
    associate (not_needed => [self%n, size(u)], nor => allocated(terms))
    end associate
  end subroutine system_find_terms

  !> T alpha.
  pure function system_spring_force(self, alpha) result(force)
    class(proximal_system_t), intent(in) :: self
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (n_modes) [length].
    real(dp) :: force(size(alpha))  !! (n_modes) [force]
    force = multiply_springs(self%spring, alpha)
  end function system_spring_force

  !> Energy norm of the displacements [sqrt(energy)].
  real(dp) function system_energy_norm(self, u, f) result(norm)
    class(proximal_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements (n) [length].
    real(dp), intent(in), contiguous :: f(:)  !! K u (n) [force].
    norm = sqrt(max(0.0_dp, self%product(u, f)))
    norm = max(norm, self%norm_0 - norm)
  end function system_energy_norm

  !> Whether an interrupt asks to stop.
  logical function system_is_interrupted(self) result(is_interrupted)
    class(proximal_system_t), intent(in) :: self
    is_interrupted = interrupted()
    associate (not_needed => same_type_as(self, self))
    end associate
  end function system_is_interrupted

  !> Factorize.
  subroutine factor_init(self, stiffness, spring, error)
    class(mode_factor_t), intent(inout) :: self
    real(dp), intent(in) :: stiffness(:, :)  !! S (n_modes, n_modes) [force/length].
    !> T by bodies; of size 0 for bodies without modes (n_bodies) [force/length].
    type(mode_block_t), intent(in) :: spring(:)
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite.
    real(dp), allocatable :: sum(:, :)
    real(dp) :: shift
    integer :: b, first, k, n, failed
    sum = stiffness
    first = 0
    do b = 1, size(spring)
      n = size(spring(b)%value, 1)
      sum(first + 1:first + n, first + 1:first + n) = sum(first + 1:first + n, first + 1:first + n) + spring(b)%value
      first = first + n
    end do
    n = size(sum, 1)
    self%scale = [(1/sqrt(sum(k, k)), k=1, n)]
    sum = sum*spread(self%scale, 1, n)*spread(self%scale, 2, n)
    shift = 0
    do
      do k = 1, n
        sum(k, k) = 1 + shift
      end do
      call self%factor%resize(n)
      self%factor%value(:int(n, int64)**2) = reshape(sum, [int(n, int64)**2])
      call self%factor%factorize(failed)
      if (failed == 0) return
      shift = max(10*shift, sum_rounding)
      if (shift > half_digits) exit
    end do
    call set_error(error, 'the stiffness of rigid body modes is not positive definite', exit_not_solvable)
  end subroutine factor_init

  !> alpha := (S + T)^{-1} alpha.
  subroutine factor_solve(self, alpha)
    class(mode_factor_t), intent(in) :: self
    real(dp), intent(inout) :: alpha(:)  !! Resultants in [force], amplitudes out [length] (n_modes).
    alpha = self%scale*alpha
    call self%factor%solve(alpha)
    alpha = self%scale*alpha
  end subroutine factor_solve

  !> T alpha.
  pure function multiply_springs(spring, alpha) result(force)
    !> T by bodies; of size 0 for bodies without modes (n_bodies) [force/length].
    type(mode_block_t), intent(in) :: spring(:)
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (n_modes) [length].
    real(dp) :: force(size(alpha))  !! (n_modes) [force]
    integer :: b, first, n
    force = 0
    first = 0
    do b = 1, size(spring)
      n = size(spring(b)%value, 1)
      force(first + 1:first + n) = matmul(spring(b)%value, alpha(first + 1:first + n))
      first = first + n
    end do
  end function multiply_springs
end module dotyk_scheme_proximal_system
