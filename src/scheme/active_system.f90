!> The linear system of an active set: contact forces on the active rows, and amplitudes of the rigid body modes.
!>
!> With M = C + Theta W^{-1} on the active rows, G their rows of the coarse space, and S the stiffness of the modes,
!> that of near-null-space modes and of the springs that keep floating bodies (`dotyk_scheme_proximal_motion`):
!>
!>     M lambda - G alpha = b,    G^T lambda + S alpha = c.
!>
!> It is symmetric quasi-definite, and solved by conjugate gradients with a constraint preconditioner
!> (`dotyk_scheme_constraint_preconditioner`): all iterates are in equilibrium with c, where conjugate gradients see the
!> positive definite M (Gould, Hribar, Nocedal, SIAM J. Sci. Comput. 23, 2001). Where the preconditioner has all
!> couplings, it is a direct solution with iterative refinement.
module dotyk_scheme_active_system
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: half_digits, least_gain, sum_rounding
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_constraint_preconditioner, only: constraint_preconditioner_t, coupling_all, coupling_none, &
    coupling_pairs
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  type, public :: active_system_t  !! The system. It owns factors: never copy it, destroy it in the end.
    type(constraint_preconditioner_t) :: preconditioner  !! The preconditioner, with the couplings that it knows.
    !> Whether all couplings may be taken where those within pairs turn out not to suffice.
    logical :: may_couple_all = .false.
    integer, allocatable :: row(:)  !! Active rows of the contact operator, ascending (n).
    real(dp), allocatable :: layer(:)  !! Compliance theta/w of the Winkler layer there (n) [length/force].
    !> Steps of Newton's method need no more accuracy: fraction of the energy of the step that may be left in the
    !> residual; 0: rounding [].
    real(dp) :: step_reduction = 0
    !> Iterations of all solutions so far, and number of solutions; pointers, since solutions do not change the system.
    integer, pointer :: n_iterations => null(), n_solutions => null()
  contains
    procedure :: init => system_init
    procedure :: solve => system_solve
    procedure :: is_for => system_is_for
    procedure :: needs_entries => system_needs_entries
    procedure :: forget => system_forget
    procedure :: destroy => system_destroy
  end type active_system_t

  !> Iterations from one true residual to the next at most, and true residuals.
  integer, parameter :: most_iterations = 2000, most_rounds = 40
  !> Iterations of a solution with the couplings within pairs: balls in a box take 1 to 20, bodies whose contacts lie
  !> close together a hundred.
  integer, parameter :: most_of_pairs = 30
  !> Directions whose forces are out of equilibrium by this fraction are rounding errors: as many rows as modes leave no
  !> self-equilibrated forces.
  real(dp), parameter :: most_imbalance = 1.0e-5_dp

contains

  !> Whether it needs the entries of the compliance at the active rows.
  pure logical function system_needs_entries(self) result(needed)
    class(active_system_t), intent(in) :: self
    needed = self%preconditioner%coupling /= coupling_none
  end function system_needs_entries

  !> Whether the system is prepared for an active set.
  pure logical function system_is_for(self, qp, active) result(is_for)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it may have been made for.
    logical, intent(in) :: active(:)  !! The active set (n_rows).
    is_for = .false.
    if (.not. allocated(self%row)) return
    if (size(self%row) /= count(active)) return
    is_for = all(active(self%row)) .and. .not. any(abs(self%layer - qp%theta(self%row)/qp%weight(self%row)) > 0)
  end function system_is_for

  !> Prepare the system of an active set; another one may stand there before.
  subroutine system_init(self, qp, compliance, active, error, theta)
    class(active_system_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! Contact rows, and rigid body modes with their stiffness.
    !> Compliance operator, formed at all active rows unless the coupling is none.
    class(compliance_t), intent(inout) :: compliance
    logical, intent(in) :: active(:)  !! The active set (n_rows).
    !> The preconditioner is not positive definite: rows are linearly dependent to rounding with theta = 0, or an entry
    !> is not a number. Or METIS or CHOLMOD has no memory.
    type(error_t), allocatable, intent(out) :: error
    real(dp), intent(in), optional :: theta(:)  !! In place of that of the QP (n_rows) [length/pressure].
    integer :: i
    logical :: is_singular
    if (.not. associated(self%n_iterations)) allocate (self%n_iterations, self%n_solutions, source=0)
    if (self%preconditioner%coupling == coupling_pairs .and. self%may_couple_all .and. &
        self%n_iterations > most_of_pairs*self%n_solutions) then
      self%preconditioner%coupling = coupling_all
      call self%preconditioner%forget()
    end if
    self%row = pack([(i, i=1, size(active))], active)
    self%layer = qp%theta(self%row)/qp%weight(self%row)
    if (present(theta)) self%layer = theta(self%row)/qp%weight(self%row)
    call self%preconditioner%init(qp, compliance, self%row, self%layer, is_singular, error)
    if (allocated(error) .or. .not. is_singular) return
    deallocate (self%row)
    call set_error(error, 'the compliance matrix of the active constraints is not positive definite '// &
                   '(constraints are linearly dependent to rounding): a spring that holds a body may be too weak '// &
                   'beside its elements, a stiffer one or a support helps; else give a greater theta', &
                   exit_not_solvable)
  end subroutine system_init

  !> G^T x.
  subroutine resultants_of(self, qp, x, resultant)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! With the coarse space.
    real(dp), intent(in) :: x(:)  !! Contact forces (n) [force].
    real(dp), intent(out) :: resultant(:)  !! (coarse%n) [force]
    real(dp), allocatable :: force(:)
    allocate (force(qp%n_rows), source=0.0_dp)
    force(self%row) = x
    call qp%mode_resultant(force, resultant)
  end subroutine resultants_of

  !> M x at the active rows.
  subroutine apply_matrix(self, qp, compliance, x, q)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    real(dp), intent(in) :: x(:)  !! Contact forces (n) [force].
    real(dp), intent(out) :: q(:)  !! Product (n) [length].
    real(dp), allocatable :: force(:), z(:)
    allocate (force(qp%n_rows), z(qp%n_rows))
    force = 0
    force(self%row) = x
    call compliance%multiply(qp, force, z)
    q = z(self%row) + self%layer*x
  end subroutine apply_matrix

  !> Residuals of contact rows and of equilibrium.
  subroutine find_residuals(self, qp, compliance, b, c, lambda, alpha, r_b, r_c)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    real(dp), intent(in) :: b(:)  !! Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: c(:)  !! Right-hand side of equilibrium (coarse%n) [force].
    real(dp), intent(in) :: lambda(:)  !! Forces (n) [force].
    real(dp), intent(in) :: alpha(:)  !! Amplitudes (coarse%n) [length].
    real(dp), intent(out) :: r_b(:)  !! `b - M lambda + G alpha` (n) [length].
    real(dp), intent(out) :: r_c(:)  !! `c - G^T lambda - S alpha` (coarse%n) [force].
    real(dp), allocatable :: motion(:)
    allocate (motion(qp%n_rows))
    call apply_matrix(self, qp, compliance, lambda, r_b)
    call qp%mode_displacement(alpha, motion)
    r_b = b - r_b + motion(self%row)
    call resultants_of(self, qp, lambda, r_c)
    r_c = c - r_c - qp%coarse%stiffness_forces(alpha)
  end subroutine find_residuals

  !> Solve from the given forces. Rounds of conjugate gradients, each from the true residual, until rounding allows no
  !> more, or one round to `step_reduction`. An interrupt ends them early.
  subroutine system_solve(self, qp, compliance, b, c, lambda, alpha)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for; resultants may be others.
    class(compliance_t), intent(inout) :: compliance  !! The compliance that it was made for.
    real(dp), intent(in) :: b(:)  !! Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: c(:)  !! Right-hand side of the equilibrium of the modes (coarse%n) [force].
    !> Contact forces; an initial guess on entry, which is not used where all rows couple (n) [force].
    real(dp), intent(inout) :: lambda(:)
    real(dp), intent(out) :: alpha(:)  !! Amplitudes of the modes (coarse%n) [length].
    real(dp), allocatable :: r_b(:), r_c(:), x(:), beta(:), next_b(:), next_c(:)
    real(dp) :: residual, previous, imbalance, previous_imbalance, scale, once
    integer :: k, n
    n = size(self%row)
    allocate (r_b(n), x(n), next_b(n), r_c(qp%coarse%n), beta(qp%coarse%n), next_c(qp%coarse%n))
    alpha = 0
    scale = 0
    ! Redundant rows share the force of least norm where the start is none.
    if (self%preconditioner%coupling == coupling_all) lambda = 0
    if (any(abs(lambda) > 0)) then
      call find_residuals(self, qp, compliance, b, c, lambda, alpha, r_b, r_c)
    else
      r_b = b
      r_c = c
    end if
    previous = huge(previous)
    previous_imbalance = huge(previous_imbalance)
    once = self%step_reduction
    self%n_solutions = self%n_solutions + 1
    ! Rounds go on while a squared residual, of contact rows or of equilibrium, falls. Conjugate gradients know their
    ! residual to half of its digits.
    do k = 1, most_rounds
      if (interrupted()) exit
      call conjugate_gradients(self, qp, compliance, merge(once, half_digits, once > 0), r_b, r_c, scale, x, beta)
      if (once > 0) then
        lambda = lambda + x
        alpha = alpha + beta
        exit
      end if
      call find_residuals(self, qp, compliance, b, c, lambda + x, alpha + beta, next_b, next_c)
      residual = sum(next_b**2/(self%preconditioner%diagonal + self%layer))
      imbalance = sum(next_c**2)
      if (k > 1 .and. .not. (residual < previous .or. imbalance < least_gain*previous_imbalance)) exit
      lambda = lambda + x
      alpha = alpha + beta
      r_b = next_b
      r_c = next_c
      if (.not. (residual < least_gain*previous .or. imbalance < least_gain*previous_imbalance)) exit
      previous = residual
      previous_imbalance = imbalance
    end do
  end subroutine system_solve

  !> Preconditioned conjugate gradients from zero.
  subroutine conjugate_gradients(self, qp, compliance, reduction, r_b, r_c, scale, x, beta)
    class(active_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! The problem that it was made for.
    class(compliance_t), intent(inout) :: compliance  !! Compliance operator.
    !> They end where the residual, in the norm of the preconditioner, is this fraction of the first one, or of the
    !> energy of the first step if that is larger [].
    real(dp), intent(in) :: reduction
    real(dp), intent(in) :: r_b(:)  !! Residual of the contact rows (n) [length].
    real(dp), intent(in) :: r_c(:)  !! Residual of equilibrium (coarse%n) [force].
    real(dp), intent(inout) :: scale  !! The largest of these energies so far; they end at rounding of it too [energy].
    real(dp), intent(out), contiguous :: x(:)  !! Forces (n) [force].
    real(dp), intent(out), contiguous :: beta(:)  !! Amplitudes (coarse%n) [length].
    real(dp), allocatable :: r(:), z(:), p(:), q(:), r_old(:), z_modes(:), p_modes(:), moved(:), imbalance(:)
    real(dp) :: rz, rz_end, rz_old, curvature, step, share, first
    integer :: k
    allocate (z(size(r_b)), p(size(r_b)), q(size(r_b)), r_old(size(r_b)), moved(qp%n_rows))
    allocate (z_modes(size(r_c)), imbalance(size(r_c)))
    ! The first step brings equilibrium; all others keep it.
    call self%preconditioner%apply(r_b, r_c, x, beta)
    ! The preconditioner is the matrix, but for the proximal term: rounds refine its solution. Conjugate gradients would
    ! divide by the curvature along redundant rows. Rigid bodies on foundations have no compliance.
    if (self%preconditioner%coupling == coupling_all .or. .not. any(self%preconditioner%diagonal > 0)) return
    call apply_matrix(self, qp, compliance, x, q)
    call qp%mode_displacement(beta, moved)
    r = r_b - q + moved(self%row)
    rz_end = 0
    rz_old = 0
    self%n_iterations = self%n_iterations + 1
    first = dot_product(x, q)
    do k = 1, most_iterations
      if (interrupted()) exit
      call self%preconditioner%apply(r, x=z, alpha=z_modes)
      rz = dot_product(r, z)
      if (k == 1) then
        first = max(first, rz)
        scale = max(scale, first)
        rz_end = max(reduction**2*first, sum_rounding**2*scale)
      end if
      if (.not. rz > rz_end) exit
      call resultants_of(self, qp, z, imbalance)
      imbalance = imbalance + qp%coarse%stiffness_forces(z_modes)
      if (norm2(imbalance) > most_imbalance*norm2(z)) exit
      if (k == 1) then
        p = z
        p_modes = z_modes
      else
        ! The formula of Polak and Ribiere is less sensitive to rounding than that of Fletcher and Reeves.
        share = max(0.0_dp, (rz - dot_product(r_old, z))/rz_old)
        p = z + share*p
        p_modes = z_modes + share*p_modes
      end if
      call apply_matrix(self, qp, compliance, p, q)
      curvature = dot_product(p, q) + dot_product(p_modes, qp%coarse%stiffness_forces(p_modes))
      if (.not. curvature > 0) exit
      call qp%mode_displacement(p_modes, moved)
      step = rz/curvature
      x = x + step*p
      beta = beta + step*p_modes
      r_old = r
      r = r - step*(q - moved(self%row))
      rz_old = rz
      self%n_iterations = self%n_iterations + 1
    end do
  end subroutine conjugate_gradients

  !> Forget which active set the system is that of.
  subroutine system_forget(self)
    class(active_system_t), intent(inout) :: self
    if (allocated(self%row)) deallocate (self%row)
  end subroutine system_forget

  !> Free all memory.
  subroutine system_destroy(self)
    class(active_system_t), intent(inout) :: self
    call self%forget()
    call self%preconditioner%destroy()
    if (allocated(self%layer)) deallocate (self%layer)
    if (associated(self%n_iterations)) deallocate (self%n_iterations, self%n_solutions)
  end subroutine system_destroy
end module dotyk_scheme_active_system
