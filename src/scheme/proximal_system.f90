!> The linear systems of the primal engine as its active set iteration (`dotyk_scheme_proximal_active_set`) and its
!> error bound (`dotyk_scheme_primal_bound`) see them: stiffness K of all bodies in the displacements, active contact
!> rows of stiffness W, and springs T on the amplitudes of the rigid body modes R of floating bodies, which are
!> orthonormal,
!>
!>     K + B^T W B + R T R^T.
!>
!> Two extensions: bodies of one process (`dotyk_scheme_contact_multigrid`), and bodies that all ranks compute together
!> (`dotyk_distributed_system`), each of which has the unknowns of its own nodes. Rows, modes and sums are the same on
!> all ranks.
module dotyk_scheme_proximal_system
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_factor, only: multiply_springs
  implicit none
  private

  !> How a solve went.
  type, public :: solve_outcome_t
    !> Iterations.
    integer :: steps = 0
    !> Last residual in the norm of the preconditioner, about the error in the energy norm [sqrt(energy)].
    real(dp) :: residual = 0
    !> Whether the preconditioner is no positive one for this right-hand side.
    logical :: has_failed = .false.
  end type solve_outcome_t

  !> The systems.
  type, abstract, public :: proximal_system_t
    !> Number of unknowns, of this rank.
    integer :: n = 0
    !> Number of contact rows.
    integer :: n_rows = 0
    !> W; zero where not active (n_rows) [force/length].
    real(dp), allocatable :: stiffness(:)
    !> T by bodies; of size 0 for bodies without modes (n_bodies) [force/length].
    type(mode_block_t), allocatable :: spring(:)
    !> The proximal term as a fraction of the compliance of the rows (`row_compliance`) [].
    real(dp) :: proximal_fraction = 0
    !> Energy norm of a displacement that the unknown one is added to: the norm of the sum is not less than the
    !> difference of both [sqrt(energy)].
    real(dp) :: norm_0 = 0
    !> Gaps of the rows, less their displacement where u is zero (n_rows) [length].
    real(dp), allocatable :: gap(:)
    !> Loads and forces of prescribed displacements, as far as u carries them (n) [force].
    real(dp), allocatable :: load(:)
    !> Error of bodies that touch no other, at most [sqrt(energy)].
    real(dp) :: error_of_isolated = 0
    !> Whether the systems are made for the rows of a working set, so that it is worth screening others.
    logical :: is_for_rows = .false.
    !> Iterations so far, and at most [].
    integer :: n_iterations = 0, most_iterations = huge(1)
  contains
    procedure :: take_rows => system_take_rows
    procedure :: start => system_start
    procedure :: find_penetrations => system_find_penetrations
    procedure :: find_terms => system_find_terms
    !> Choose active rows and springs, and prepare the solver.
    procedure(set_active), deferred :: set_active
    !> Solve.
    procedure(solve), deferred :: solve
    !> f = K u.
    procedure(strain_forces), deferred :: strain_forces
    !> y = B u.
    procedure(row_displacement), deferred :: row_displacement
    !> r := r - B^T lambda.
    procedure(subtract_row_force), deferred :: subtract_row_force
    !> R^T f.
    procedure(resultants), deferred :: resultants
    !> u := u + R alpha.
    procedure(add_modes), deferred :: add_modes
    !> Compliance of each row in a coarse space or a smoother.
    procedure(row_compliance), deferred :: row_compliance
    !> Whether rows have no free unknown.
    procedure(is_rigid_row), deferred :: is_rigid_row
    !> Scalar product.
    procedure(inner_product), deferred :: product
    !> sqrt(r^T K^+ r), at most.
    procedure(force_norm), deferred :: force_norm
    !> Displacements g that close gaps, as in `dotyk_scheme_gap_closing`.
    procedure(close_gaps), deferred :: close_gaps
    !> The diagonal of B D^{-1} B^T, D the diagonal blocks of the smoother.
    procedure(row_compliance), deferred :: smoother_compliance
    procedure :: spring_force => system_spring_force
    procedure :: energy_norm => system_energy_norm
    procedure :: is_interrupted => system_is_interrupted
  end type proximal_system_t

  abstract interface
    !> Choose active rows and springs, and prepare the solver, unless it is the one of before.
    subroutine set_active(self, stiffness, spring, error)
      import :: proximal_system_t, mode_block_t, error_t, dp
      class(proximal_system_t), target, intent(inout) :: self
      !> W; zero where not active (n_rows) [force/length].
      real(dp), intent(in) :: stiffness(:)
      !> T; of size 0 for bodies without modes (n_bodies) [force/length].
      type(mode_block_t), intent(in) :: spring(:)
      !> Allocated where a number is not finite, memory runs out, or PETSc fails.
      type(error_t), allocatable, intent(out) :: error
    end subroutine set_active

    !> Solve (K + B^T W B + R T R^T) e = r, exactly as to the resultants on the rigid body modes.
    subroutine solve(self, r, aim, most_steps, e, outcome, error)
      import :: proximal_system_t, solve_outcome_t, error_t, dp
      class(proximal_system_t), target, intent(inout) :: self
      !> Forces (n) [force].
      real(dp), intent(inout), contiguous :: r(:)
      !> Residual in the norm of the preconditioner to end at [sqrt(energy)].
      real(dp), intent(in) :: aim
      !> Iterations at most.
      integer, intent(in) :: most_steps
      !> Displacements (n) [length].
      real(dp), intent(inout), contiguous :: e(:)
      !> How it went.
      type(solve_outcome_t), intent(out) :: outcome
      !> Allocated where PETSc fails.
      type(error_t), allocatable, intent(out) :: error
    end subroutine solve

    !> f = K u.
    subroutine strain_forces(self, u, f)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      !> Displacements (n) [length].
      real(dp), intent(in), contiguous :: u(:)
      !> (n) [force]
      real(dp), intent(out), contiguous :: f(:)
    end subroutine strain_forces

    !> y = B u.
    subroutine row_displacement(self, u, y)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      !> Displacements (n) [length].
      real(dp), intent(in), contiguous :: u(:)
      !> (n_rows) [length]
      real(dp), intent(out) :: y(:)
    end subroutine row_displacement

    !> r := r - B^T lambda.
    subroutine subtract_row_force(self, lambda, r)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      !> Contact forces (n_rows) [force].
      real(dp), intent(in) :: lambda(:)
      !> (n) [force]
      real(dp), intent(inout), contiguous :: r(:)
    end subroutine subtract_row_force

    !> R^T f.
    function resultants(self, f) result(resultant)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      !> Forces (n) [force].
      real(dp), intent(in), contiguous :: f(:)
      !> On the rigid body modes (n_modes) [force].
      real(dp), allocatable :: resultant(:)
    end function resultants

    !> u := u + R alpha.
    subroutine add_modes(self, alpha, u)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      !> Amplitudes (n_modes) [length].
      real(dp), intent(in) :: alpha(:)
      !> Displacements (n) [length].
      real(dp), intent(inout), contiguous :: u(:)
    end subroutine add_modes

    !> Compliance of each row.
    pure function row_compliance(self) result(compliance)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      !> (n_rows) [length/force]
      real(dp) :: compliance(self%n_rows)
    end function row_compliance

    !> Whether rows have no free unknown.
    pure function is_rigid_row(self) result(is_rigid)
      import :: proximal_system_t
      class(proximal_system_t), intent(in) :: self
      !> (n_rows)
      logical :: is_rigid(self%n_rows)
    end function is_rigid_row

    !> Scalar product, over all ranks.
    real(dp) function inner_product(self, a, b) result(product)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(in) :: self
      !> Vectors (n) [any].
      real(dp), intent(in), contiguous :: a(:), b(:)
    end function inner_product

    !> sqrt(r^T K^+ r) of forces without their resultants on the rigid body modes, at most [sqrt(energy)].
    real(dp) function force_norm(self, r) result(norm)
      import :: proximal_system_t, dp
      class(proximal_system_t), intent(inout) :: self
      !> Forces; without resultants on return (n) [force].
      real(dp), intent(inout), contiguous :: r(:)
    end function force_norm

    !> Close the gaps of some rows.
    subroutine close_gaps(self, chosen, gap, softness, shift, closed, norm, error)
      import :: proximal_system_t, error_t, dp
      class(proximal_system_t), intent(in) :: self
      !> Rows to close (n_rows).
      logical, intent(in) :: chosen(:)
      !> Gaps to close (n_rows) [length].
      real(dp), intent(in) :: gap(:)
      !> theta/w (n_rows) [length/force].
      real(dp), intent(in) :: softness(:)
      !> Fraction of the diagonal that is added [].
      real(dp), intent(in) :: shift
      !> B g, of all rows (n_rows) [length].
      real(dp), intent(out) :: closed(:)
      !> Energy norm of g, at most; `huge` where there is none [sqrt(energy)].
      real(dp), intent(out) :: norm
      !> Allocated where a number is not finite, or memory runs out.
      type(error_t), allocatable, intent(out) :: error
    end subroutine close_gaps
  end interface

contains

  !> Take the rows of a QP: systems that are not made for rows have all rows.
  subroutine system_take_rows(self, qp)
    class(proximal_system_t), target, intent(inout) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    associate (not_needed => [self%n_rows, qp%n_rows])
    end associate
  end subroutine system_take_rows

  !> Pressures and displacements where the iteration begins: at rest.
  subroutine system_start(self, qp, theta, warm, m, u)
    class(proximal_system_t), intent(inout) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Whether there are pressures.
    logical, intent(in) :: warm
    !> Pressures, changed unless there are some (n_rows) [pressure].
    real(dp), intent(inout) :: m(:)
    !> Displacements (n) [length].
    real(dp), intent(inout), contiguous :: u(:)
    if (.not. warm) m = 0
    u(:) = 0
    associate (not_needed => [self%n, qp%n_rows, size(theta)])
    end associate
  end subroutine system_start

  !> Penetrations of all rows of a QP, of which those of the system may be a part.
  subroutine system_find_penetrations(self, qp, u, y)
    class(proximal_system_t), intent(in) :: self
    !> All rows.
    type(contact_qp_t), intent(in) :: qp
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: u(:)
    !> (n_rows) [length]
    real(dp), intent(out) :: y(:)
    call self%row_displacement(u, y)
    y = y - self%gap
    associate (not_needed => qp%n_rows)
    end associate
  end subroutine system_find_penetrations

  !> Strain energy and work of the loads, where the displacements tell them more accurately than the QP does.
  subroutine system_find_terms(self, u, terms)
    class(proximal_system_t), intent(in) :: self
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: u(:)
    !> Not changed otherwise (2) [energy].
    real(dp), allocatable, intent(inout) :: terms(:)
    associate (not_needed => [self%n, size(u)], nor => allocated(terms))
    end associate
  end subroutine system_find_terms

  !> T alpha.
  pure function system_spring_force(self, alpha) result(force)
    class(proximal_system_t), intent(in) :: self
    !> Amplitudes (n_modes) [length].
    real(dp), intent(in) :: alpha(:)
    !> (n_modes) [force]
    real(dp) :: force(size(alpha))
    force = multiply_springs(self%spring, alpha)
  end function system_spring_force

  !> Energy norm of the displacements [sqrt(energy)].
  real(dp) function system_energy_norm(self, u, f) result(norm)
    class(proximal_system_t), intent(in) :: self
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: u(:)
    !> K u (n) [force].
    real(dp), intent(in), contiguous :: f(:)
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
end module dotyk_scheme_proximal_system
