!> The linear system of an active set by conjugate gradients, matrix-free: each step applies the compliance of every
!> body once.
!>
!> As in total FETI (Dostal, Horak, Kucera, Commun. Numer. Meth. Engng 22, 2006) contact forces stay in equilibrium with
!> the loads of the floating bodies: the start satisfies `G^T lambda = c`, steps are projected on `G^T lambda = 0`, the
!> coarse problem. The preconditioner is diagonal: the compliance of each contact point from the diagonals of the
!> stiffnesses of its bodies, and its Winkler layer. (The lumped preconditioner, the stiffness of the surfaces, took as
!> many steps or twice as many.)
module dotyk_scheme_iterative_system
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_compliance, only: compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  implicit none
  private

  !> The system.
  type, extends(active_system_t), public :: iterative_system_t
    !> Preconditioner: inverse diagonal compliance of each point, Winkler layer included (n) [force/length].
    real(dp), allocatable, private :: stiffness(:)
    !> G on the active rows (n, coarse%n).
    real(dp), allocatable, private :: g(:, :)
    !> Pseudo-inverse of G^T G (coarse%n, coarse%n).
    real(dp), allocatable, private :: gram_inverse(:, :)
  contains
    procedure :: init => iterative_system_init
    procedure :: solve => iterative_system_solve
    procedure :: needs_entries => iterative_system_needs_entries
    procedure :: destroy => iterative_system_destroy
  end type iterative_system_t

  !> Steps end when the residual, in the norm of the preconditioner, is this fraction of the first one, or of b if that
  !> is larger: rounding.
  real(dp), parameter :: tolerance = 1.0e-13_dp
  !> Steps at most.
  integer, parameter :: most_steps = 2000
  !> Eigenvalues of the scaled Gram matrix G^T G below this belong to null modes: a factor of 500 above rounding.
  real(dp), parameter :: least_eigenvalue = 1.0e-13_dp

contains

  !> False: products with the compliance are enough.
  pure logical function iterative_system_needs_entries(self) result(needed)
    !> The system.
    class(iterative_system_t), intent(in) :: self
    needed = .false.
    associate (not_needed => same_type_as(self, self))
    end associate
  end function iterative_system_needs_entries

  !> Prepare preconditioner and coarse problem.
  subroutine iterative_system_init(self, qp, compliance, theta, active, error)
    !> The system.
    class(iterative_system_t), intent(inout) :: self
    !> Contact rows, rigid body modes and compliances of the bodies.
    type(contact_qp_t), intent(in) :: qp
    !> Not used.
    class(compliance_t), intent(inout) :: compliance
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> The active set (n_rows).
    logical, intent(in) :: active(:)
    !> The eigenvalues of the Gram matrix G^T G cannot be found: an entry is not finite, or LAPACK does not converge.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: null_mode(:, :)
    call self%destroy()
    call self%take_points(qp, theta, active)
    call prepare_preconditioner(self, qp, compliance)
    allocate (self%g(size(self%row), qp%coarse%n))
    call qp%coarse%rows(self%row, self%g)
    call invert_gram(qp%coarse%first, matmul(transpose(self%g), self%g), self%gram_inverse, null_mode, error)
    if (.not. allocated(error)) call self%null_mode%take_dense(null_mode)
  end subroutine iterative_system_init

  !> The inverse diagonal of `B D^{-1} B^T + Theta W^{-1}`, D the diagonals of the stiffnesses.
  subroutine prepare_preconditioner(self, qp, compliance)
    !> Sets `stiffness`.
    type(iterative_system_t), intent(inout) :: self
    !> Contact rows.
    type(contact_qp_t), intent(in) :: qp
    !> With the nodal stiffness of the bodies.
    class(compliance_t), intent(inout) :: compliance
    real(dp), allocatable :: yields(:)
    allocate (yields(qp%n_rows))
    call compliance%nodal_diagonal(qp, yields)
    self%stiffness = 1/max(tiny(1.0_dp), yields(self%row) + self%layer)
    ! Points between prescribed displacements get no force.
    where (.not. yields(self%row) + self%layer > 0) self%stiffness = 0
  end subroutine prepare_preconditioner

  !> Pseudo-inverse and null space of the Gram matrix G^T G.
  subroutine invert_gram(first, gram, inverse, null_mode, error)
    !> Modes of body b are first(b) .. first(b+1)-1 (n_bodies + 1).
    integer, intent(in) :: first(:)
    !> G^T G (n, n) [].
    real(dp), intent(in) :: gram(:, :)
    !> Pseudoinverse of G^T G (n, n) [].
    real(dp), allocatable, intent(out) :: inverse(:, :)
    !> As columns, the largest amplitude of each is 1 (n, number of them) [].
    real(dp), allocatable, intent(out) :: null_mode(:, :)
    !> An entry is not finite, or LAPACK's eigenvalue iteration does not converge.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: scaled(:, :), scale(:), values(:), vectors(:, :)
    real(dp) :: most
    integer :: i, b, n
    n = size(gram, 1)
    allocate (scale(n), values(n), vectors(n, n), scaled(n, n))
    ! One scale for all modes of a body, by the best restrained one: all modes have the same lengths.
    scale = 1
    do b = 1, size(first) - 1
      most = maxval([0.0_dp, (gram(i, i), i=first(b), first(b + 1) - 1)])
      if (most > 0) scale(first(b):first(b + 1) - 1) = 1/sqrt(most)
    end do
    do i = 1, n
      scaled(:, i) = scale*gram(:, i)*scale(i)
    end do
    call symmetric_eigen(scaled, values, vectors, error)
    if (allocated(error)) return
    do i = 1, n
      vectors(:, i) = scale*vectors(:, i)
    end do
    null_mode = vectors(:, pack([(i, i=1, n)], .not. values > least_eigenvalue))
    do i = 1, size(null_mode, 2)
      null_mode(:, i) = null_mode(:, i)/maxval(abs(null_mode(:, i)))
    end do
    do i = 1, n
      vectors(:, i) = merge(vectors(:, i)/sqrt(max(values(i), least_eigenvalue)), 0.0_dp, values(i) > least_eigenvalue)
    end do
    inverse = matmul(vectors, transpose(vectors))
  end subroutine invert_gram

  !> q = M x on the active rows: the compliance of every body once.
  subroutine apply_matrix(self, qp, compliance, x, q)
    !> The system.
    type(iterative_system_t), intent(in) :: self
    !> The problem that it was made for.
    type(contact_qp_t), intent(in) :: qp
    !> Matrix-free.
    class(compliance_t), intent(inout) :: compliance
    !> Contact forces (n) [force].
    real(dp), intent(in) :: x(:)
    !> Product M x (n) [length].
    real(dp), intent(out) :: q(:)
    real(dp), allocatable :: force(:), z(:)
    allocate (force(qp%n_rows), z(qp%n_rows))
    force = 0
    force(self%row) = x
    call compliance%multiply(qp, force, z)
    q = z(self%row) + self%layer*x
  end subroutine apply_matrix

  !> Projection on self-equilibrated forces: x - G (G^T G)^{-1} G^T x.
  subroutine project(self, x)
    !> The system.
    type(iterative_system_t), intent(in) :: self
    !> Forces [force], or displacements of the rows [length] (n).
    real(dp), intent(inout) :: x(:)
    if (size(self%g, 2) > 0) x = x - matmul(self%g, matmul(self%gram_inverse, matmul(x, self%g)))
  end subroutine project

  !> Projected preconditioned conjugate gradients from lambda, its resultants corrected to c. An interrupt ends them
  !> early.
  subroutine iterative_system_solve(self, qp, compliance, b, c, lambda, alpha)
    !> The system.
    class(iterative_system_t), intent(in) :: self
    !> The problem that it was made for.
    type(contact_qp_t), intent(in) :: qp
    !> Matrix-free.
    class(compliance_t), intent(inout) :: compliance
    !> Right-hand side of the contact rows (n) [length].
    real(dp), intent(in) :: b(:)
    !> Right-hand side of the equilibrium of the modes (coarse%n) [force].
    real(dp), intent(in) :: c(:)
    !> Contact forces; the start on entry (n) [force].
    real(dp), intent(inout) :: lambda(:)
    !> Amplitudes of the modes (coarse%n) [length].
    real(dp), intent(out) :: alpha(:)
    real(dp), allocatable :: r(:), z(:), p(:), q(:), r_old(:)
    real(dp) :: rz, rz_end, rz_old, step
    integer :: k, n
    n = size(self%row)
    allocate (z(n), p(n), q(n), r_old(n))
    lambda = lambda + matmul(self%g, matmul(self%gram_inverse, c - matmul(lambda, self%g)))
    r = b
    if (any(abs(lambda) > 0)) then
      call apply_matrix(self, qp, compliance, lambda, q)
      r = r - q
    end if
    rz_end = 0
    p = 0
    rz_old = 0
    r_old = 0
    do k = 1, most_steps
      ! The caller checks for interrupts too.
      if (interrupted()) exit
      call project(self, r)
      z = self%stiffness*r
      call project(self, z)
      rz = dot_product(r, z)
      if (k == 1) rz_end = max(self%reduction**2*rz, tolerance**2*max(rz, dot_product(self%stiffness, b**2)))
      if (.not. rz > rz_end) exit
      ! The formula of Polak and Ribiere is less sensitive to rounding than that of Fletcher and Reeves.
      if (k > 1) p = z + max(0.0_dp, (rz - dot_product(r_old, z))/rz_old)*p
      if (k == 1) p = z
      call apply_matrix(self, qp, compliance, p, q)
      step = dot_product(p, q)
      if (.not. step > 0) exit
      step = dot_product(p, r)/step
      lambda = lambda + step*p
      r_old = r
      r = r - step*q
      rz_old = rz
    end do
    call apply_matrix(self, qp, compliance, lambda, q)
    alpha = matmul(self%gram_inverse, matmul(q - b, self%g))
  end subroutine iterative_system_solve

  !> Free all memory.
  subroutine iterative_system_destroy(self)
    !> The system.
    class(iterative_system_t), intent(inout) :: self
    call self%forget()
    if (allocated(self%stiffness)) deallocate (self%stiffness)
    if (allocated(self%g)) deallocate (self%g)
    if (allocated(self%gram_inverse)) deallocate (self%gram_inverse)
  end subroutine iterative_system_destroy
end module dotyk_scheme_iterative_system
