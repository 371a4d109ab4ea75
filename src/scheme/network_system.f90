!> The linear system of an active set for many bodies: conjugate gradients whose preconditioner is the system of the
!> same pairs without couplings inside the bodies.
!>
!> With M = C + Theta W^{-1} on the active rows and M_p its diagonal blocks by pairs (`dotyk_scheme_pair_blocks`), the
!> preconditioner of `[M -G; -G^T -S]` is the constraint preconditioner `[M_p -G; -G^T -S]` (Keller, Gould, Wathen, SIAM
!> J. Matrix Anal. Appl. 21, 2000): forces of pairs that do not know of each other, in equilibrium with the loads of all
!> bodies. Eliminating M_p leaves `G^T M_p^{-1} G + S`, the stiffness of a network of rigid bodies, one block of modes
!> for each body and one coupling for each pair. It is factorized (`dotyk_linalg_block_ldlt`), which finds the modes
!> that the active rows do not restrain. All iterates are in equilibrium, as in FETI, where this network is the coarse
!> problem; there conjugate gradients see the positive definite M on self-equilibrated forces (Gould, Hribar, Nocedal,
!> SIAM J. Sci. Comput. 23, 2001), and M_p differs from it by how contacts of one body yield to each other: the number
!> of iterations depends on the shape of the bodies, not on how many there are.
!>
!> M is used in products only. Where it is singular, with theta = 0 and redundant rows, the iterates stay in its range:
!> redundant rows of a pair share the force of least `sum lambda^2/w`, as in `dotyk_scheme_direct_system`, those of
!> several pairs that of least norm in M_p.
module dotyk_scheme_network_system
  use dotyk_base_error, only: error_t, set_error, exit_not_solvable
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_block_ldlt, only: block_ldlt_t
  use dotyk_linalg_block_ldlt_solution, only: expand_null_vector, solve_block_ldlt
  use dotyk_scheme_active_system, only: active_system_t, proximal_term
  use dotyk_scheme_coarse_space, only: coarse_space_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_mode_columns, only: mode_columns_t
  use dotyk_scheme_pair_blocks, only: pair_blocks_t
  implicit none
  private

  !> The system. It owns a factor: never copy it, destroy it in the end.
  type, extends(active_system_t), public :: network_system_t
    !> Iterations of all solutions so far; a pointer, since solutions do not change the system.
    integer, pointer :: n_iterations => null()
    !> M_p.
    type(pair_blocks_t), private :: blocks
    !> Factor of the network of bodies.
    type(block_ldlt_t), private :: network
    !> 1 where it is positive definite, all modes having a stiffness of their own; -1: of the negative network.
    integer, private :: sign = -1
    !> Orthonormal null modes of several bodies together.
    type(mode_columns_t), private :: joint_null
  contains
    procedure :: init => network_system_init
    procedure :: solve => network_system_solve
    procedure :: needs_entries => network_system_needs_entries
    procedure :: destroy => network_system_destroy
  end type network_system_t

  !> A residual in the norm of the preconditioner is rounding at this fraction of the right-hand side.
  real(dp), parameter :: tolerance = 1.0e-14_dp
  !> Conjugate gradients begin anew, from the true residual, when they have reduced it to this fraction.
  real(dp), parameter :: restart = 1.0e-8_dp
  !> Iterations from one true residual to the next at most.
  integer, parameter :: most_iterations = 500
  !> True residuals at most.
  integer, parameter :: most_rounds = 8
  !> Rounds go on while the squared residual falls to this fraction (of contact rows, of equilibrium).
  real(dp), parameter :: worthwhile_gain = 0.1_dp, worthwhile_gain_of_equilibrium = 0.01_dp
  !> Directions whose forces are out of equilibrium by this fraction are rounding errors: as many rows as modes leave no
  !> self-equilibrated forces.
  real(dp), parameter :: most_imbalance = 1.0e-5_dp
  !> See `dotyk_scheme_direct_system`.
  real(dp), parameter :: least_motion = 1.0e-9_dp

contains

  !> True: the blocks of pairs are made of entries.
  pure logical function network_system_needs_entries(self) result(needed)
    !> The system.
    class(network_system_t), intent(in) :: self
    needed = .true.
    associate (not_needed => same_type_as(self, self))
    end associate
  end function network_system_needs_entries

  !> Factorize the blocks of pairs, and the network of bodies.
  subroutine network_system_init(self, qp, compliance, theta, active, error)
    !> The system.
    class(network_system_t), intent(inout) :: self
    !> Contact rows and rigid body modes.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The active set (n_rows).
    logical, intent(in) :: active(:)
    !> The compliance of the active rows of a pair is not positive definite: they are linearly dependent to rounding
    !> with theta = 0, or an entry is not a number.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: added(:)
    integer :: b, failed
    logical :: is_singular
    call self%forget()
    call self%joint_null%destroy()
    if (.not. associated(self%n_iterations)) allocate (self%n_iterations, source=0)
    call self%take_points(qp, theta, active)
    call self%blocks%init(qp, compliance, self%row)
    added = self%layer + proximal_term(self%blocks%diagonal + self%layer, self%layer, qp%weight(self%row))
    call self%blocks%factorize(added, is_singular)
    failed = 0
    if (.not. is_singular) then
      self%sign = merge(1, -1, all([(qp%coarse%has_stiffness(b), b=1, size(qp%coarse%block))]))
      call factorize_network(self, qp%coarse, failed)
      if (failed > 0 .and. self%sign > 0) then
        ! Soft modes are lost in rounding: those are found block by block.
        self%sign = -1
        call factorize_network(self, qp%coarse, failed)
      end if
    end if
    if (is_singular .or. failed > 0) then
      call set_error(error, 'the compliance matrix of the active constraints is not positive definite '// &
                     '(constraints are linearly dependent to rounding): a spring that holds a body may be too '// &
                     'weak beside its elements, a stiffer one or a support helps; else give a greater theta', &
                     exit_not_solvable)
      return
    end if
    ! Steps of Newton's method need no null modes: their amplitudes may be any.
    if (.not. self%step_reduction > 0) call find_null_modes(self, qp)
  end subroutine network_system_init

  !> Make and factorize the network.
  subroutine factorize_network(self, coarse, failed)
    !> Its blocks are factorized, its sign is set.
    type(network_system_t), intent(inout) :: self
    !> The modes.
    type(coarse_space_t), intent(in) :: coarse
    !> A body whose block cannot be factorized; 0 if there is none.
    integer, intent(out) :: failed
    integer :: b
    call self%blocks%add_network(self%sign, self%network)
    if (allocated(coarse%stiffness)) then
      do b = 1, size(coarse%stiffness)
        if (size(coarse%stiffness(b)%value) > 0) call self%network%add(b, b, self%sign*coarse%stiffness(b)%value)
      end do
    end if
    call self%network%factorize(self%blocks%stiffness_of_modes(coarse, self%layer), failed)
  end subroutine factorize_network

  !> Modes that the active rows do not restrain: of single bodies, and of several in contact with each other only.
  subroutine find_null_modes(self, qp)
    !> Factorized; sets the null modes.
    type(network_system_t), intent(inout) :: self
    !> With the coarse space.
    type(contact_qp_t), intent(in) :: qp
    real(dp), allocatable :: g(:), own(:), joint(:)
    logical :: is_active(qp%n_rows)
    real(dp) :: motion
    integer :: i, b
    is_active = .false.
    is_active(self%row) = .true.
    allocate (joint(qp%coarse%n))
    do i = 1, size(self%network%null_block)
      b = self%network%null_block(i)
      associate (first => qp%coarse%first(b), last => qp%coarse%first(b + 1) - 1)
        own = self%network%null_direction(:last - first + 1, i)
        g = matmul(qp%coarse%block(b)%value, own)
        motion = maxval([0.0_dp, pack(abs(g), is_active(qp%block(b)%row))])
        if (motion <= least_motion) call self%null_mode%add(own/maxval(abs(own)), offset=first - 1)
      end associate
      if (motion <= least_motion) cycle
      call expand_null_vector(self%network, i, joint)
      call self%null_mode%add(joint/maxval(abs(joint)))
      call self%joint_null%remove_from(joint)
      call self%joint_null%add(joint/norm2(joint))
    end do
  end subroutine find_null_modes

  !> The solution of `M_p x - G alpha = r`, `G^T x + S alpha = e`.
  subroutine apply_preconditioner(self, r, e, x, alpha)
    !> Factorized.
    class(network_system_t), intent(in) :: self
    !> At the active rows (n) [length].
    real(dp), intent(in) :: r(:)
    !> On the modes; 0 if absent (coarse%n) [force].
    real(dp), intent(in), optional :: e(:)
    !> Forces (n) [force].
    real(dp), intent(out) :: x(:)
    !> Amplitudes (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    x = r
    call self%blocks%reduce(x, alpha)
    if (present(e)) alpha = alpha - e
    call solve_block_ldlt(self%network, alpha)
    alpha = -self%sign*alpha
    call self%blocks%expand(alpha, x)
  end subroutine apply_preconditioner

  !> M x at the active rows.
  subroutine apply_matrix(self, qp, compliance, x, q)
    !> The system.
    class(network_system_t), intent(in) :: self
    !> The problem that it was made for.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    !> Contact forces (n) [force].
    real(dp), intent(in) :: x(:)
    !> Product (n) [length].
    real(dp), intent(out) :: q(:)
    real(dp), allocatable :: force(:), z(:)
    allocate (force(qp%n_rows), z(qp%n_rows))
    force = 0
    force(self%row) = x
    call compliance%multiply(qp, force, z)
    q = z(self%row) + self%layer*x
  end subroutine apply_matrix

  !> Residuals of contact rows and of equilibrium.
  subroutine find_residuals(self, qp, compliance, b, c, lambda, alpha, r_b, r_c)
    !> The system.
    class(network_system_t), intent(in) :: self
    !> The problem that it was made for.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    !> Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: b(:)
    !> Right-hand side of equilibrium (coarse%n) [force].
    real(dp), intent(in) :: c(:)
    !> Forces (n) [force].
    real(dp), intent(in) :: lambda(:)
    !> Amplitudes (coarse%n) [length].
    real(dp), intent(in) :: alpha(:)
    !> `b - M lambda + G alpha` (n) [length].
    real(dp), intent(out) :: r_b(:)
    !> `c - G^T lambda - S alpha` (coarse%n) [force].
    real(dp), intent(out) :: r_c(:)
    real(dp), allocatable :: force(:), motion(:)
    allocate (force(qp%n_rows), source=0.0_dp)
    allocate (motion(qp%n_rows))
    force(self%row) = lambda
    call apply_matrix(self, qp, compliance, lambda, r_b)
    call qp%mode_displacement(alpha, motion)
    r_b = b - r_b + motion(self%row)
    call qp%mode_resultant(force, r_c)
    r_c = c - r_c - qp%coarse%stiffness_forces(alpha)
  end subroutine find_residuals

  !> Solve from the given forces. Rounds of conjugate gradients, each from the true residual, until rounding allows no
  !> more, or one round to `step_reduction`. An interrupt ends them early.
  subroutine network_system_solve(self, qp, compliance, b, c, lambda, alpha)
    !> Factorized.
    class(network_system_t), intent(in) :: self
    !> The problem that it was made for.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    !> Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: b(:)
    !> Right-hand side of the equilibrium of the modes (coarse%n) [force].
    real(dp), intent(in) :: c(:)
    !> Contact forces; the start on entry (n) [force].
    real(dp), intent(inout) :: lambda(:)
    !> Amplitudes of the modes (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    real(dp), allocatable :: r_b(:), r_c(:), x(:), beta(:), next_b(:), next_c(:)
    real(dp) :: residual, previous, imbalance, previous_imbalance, scale
    integer :: k, n
    n = size(self%row)
    allocate (r_b(n), x(n), next_b(n), r_c(qp%coarse%n), beta(qp%coarse%n), next_c(qp%coarse%n))
    alpha = 0
    scale = 0
    if (any(abs(lambda) > 0)) then
      call find_residuals(self, qp, compliance, b, c, lambda, alpha, r_b, r_c)
    else
      r_b = b
      r_c = c
    end if
    previous = huge(previous)
    previous_imbalance = huge(previous_imbalance)
    do k = 1, most_rounds
      if (interrupted()) exit
      call conjugate_gradients(self, qp, compliance, merge(self%step_reduction, restart, self%step_reduction > 0), &
                               r_b, r_c, scale, x, beta)
      if (self%step_reduction > 0) then
        lambda = lambda + x
        alpha = alpha + beta
        exit
      end if
      call find_residuals(self, qp, compliance, b, c, lambda + x, alpha + beta, next_b, next_c)
      residual = sum(next_b**2/(self%blocks%diagonal + self%layer))
      imbalance = sum(next_c**2)
      if (k > 1 .and. .not. (residual < previous .or. &
                             imbalance < worthwhile_gain_of_equilibrium*previous_imbalance)) exit
      lambda = lambda + x
      alpha = alpha + beta
      r_b = next_b
      r_c = next_c
      if (.not. (residual < worthwhile_gain*previous .or. &
                 imbalance < worthwhile_gain_of_equilibrium*previous_imbalance)) exit
      previous = residual
      previous_imbalance = imbalance
    end do
    call self%joint_null%remove_from(alpha)
  end subroutine network_system_solve

  !> Preconditioned conjugate gradients from zero.
  subroutine conjugate_gradients(self, qp, compliance, reduction, r_b, r_c, scale, x, beta)
    !> The system.
    class(network_system_t), intent(in) :: self
    !> The problem that it was made for.
    type(contact_qp_t), intent(in) :: qp
    !> Compliance operator, formed at all active rows.
    class(compliance_t), intent(inout) :: compliance
    !> They end where the residual, in the norm of the preconditioner, is this fraction of the first one, or of the
    !> energy of the first step if that is larger [].
    real(dp), intent(in) :: reduction
    !> Residual of the contact rows (n) [length].
    real(dp), intent(in) :: r_b(:)
    !> Residual of equilibrium (coarse%n) [force].
    real(dp), intent(in) :: r_c(:)
    !> The largest of these energies so far; they end at rounding of it too [energy].
    real(dp), intent(inout) :: scale
    !> Forces (n) [force].
    real(dp), intent(out) :: x(:)
    !> Amplitudes (coarse%n) [length].
    real(dp), intent(out) :: beta(:)
    real(dp), allocatable :: r(:), z(:), p(:), q(:), r_old(:), z_modes(:), p_modes(:), moved(:), imbalance(:)
    real(dp) :: rz, rz_end, rz_old, curvature, step, share, first
    integer :: k
    allocate (z(size(r_b)), p(size(r_b)), q(size(r_b)), r_old(size(r_b)), moved(qp%n_rows))
    allocate (z_modes(size(r_c)), imbalance(size(r_c)))
    ! The first step brings equilibrium; all others keep it.
    call apply_preconditioner(self, r_b, r_c, x, beta)
    ! Rigid bodies on foundations: the preconditioner is the matrix.
    if (.not. any(self%blocks%diagonal > 0)) return
    call apply_matrix(self, qp, compliance, x, q)
    call qp%mode_displacement(beta, moved)
    r = r_b - q + moved(self%row)
    rz_end = 0
    rz_old = 0
    self%n_iterations = self%n_iterations + 1
    first = dot_product(x, q)
    do k = 1, most_iterations
      if (interrupted()) exit
      call apply_preconditioner(self, r, x=z, alpha=z_modes)
      rz = dot_product(r, z)
      if (k == 1) then
        first = max(first, rz)
        scale = max(scale, first)
        rz_end = max(reduction**2*first, tolerance**2*scale)
      end if
      if (.not. rz > rz_end) exit
      call self%blocks%find_resultants(z, imbalance)
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

  !> Free all memory.
  subroutine network_system_destroy(self)
    !> The system.
    class(network_system_t), intent(inout) :: self
    call self%network%destroy()
    call self%blocks%destroy()
    call self%forget()
    call self%joint_null%destroy()
    if (associated(self%n_iterations)) deallocate (self%n_iterations)
  end subroutine network_system_destroy
end module dotyk_scheme_network_system
