!> The system of an active set by conjugate gradients: no column of the compliance is formed, each step is one solve of every body.
!>
!> As in total FETI, forces keep to the equilibrium of the free bodies: they start with it, and steps are projected on `G^T lambda = 0`,
!> the coarse problem. The preconditioner is the diagonal: how much each point yields, its nodes taken for alone, and its layer. (The lumped
!> preconditioner of domain decomposition, the stiffness of the surfaces, needed as many steps or twice as many.)
module dotyk_scheme_iterative_system
  use dotyk_base_error, only: error_t
  use dotyk_base_interrupt, only: interrupted
  use dotyk_base_kinds, only: dp
  use dotyk_scheme_active_system, only: active_system_t
  use dotyk_scheme_explicit, only: explicit_compliance_t
  use dotyk_scheme_problem, only: contact_problem_t
  implicit none
  private

  !> The system.
  type, extends(active_system_t), public :: iterative_system_t
    !> Stiffness of each point by the diagonals of its bodies, layer included: the preconditioner (n) [force/length].
    real(dp), allocatable, private :: stiffness(:)
    !> G on the active points (n, coarse%n), and the pseudo-inverse of G^T G (coarse%n, coarse%n).
    real(dp), allocatable, private :: g(:, :), gram_inverse(:, :)
  contains
    procedure :: init => iterative_system_init
    procedure :: solve => iterative_system_solve
    procedure :: destroy => iterative_system_destroy
  end type iterative_system_t

  !> Steps end when the residual, in the norm of the preconditioner, is this part of the first one.
  real(dp), parameter :: tolerance = 1.0e-13_dp
  !> Steps at most.
  integer, parameter :: most_steps = 2000

contains

  !> Prepare preconditioner and coarse problem.
  subroutine iterative_system_init(self, problem, compliance, theta, active, error)
    class(iterative_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    !> Not looked at.
    type(explicit_compliance_t), intent(in) :: compliance
    real(dp), intent(in) :: theta(:)
    logical, intent(in) :: active(:)
    type(error_t), allocatable, intent(out) :: error
    call self%destroy()
    call self%take_points(problem, theta, active)
    call prepare_preconditioner(self, problem)
    allocate (self%g(size(self%row), problem%coarse%n))
    call problem%coarse%rows(self%row, self%g)
    call problem%coarse%invert(matmul(transpose(self%g), self%g), self%gram_inverse, self%null_mode, error)
    ! The columns are for the other way.
    associate (not_needed => compliance)
    end associate
  end subroutine iterative_system_init

  !> 1 over the diagonal of `B D^{-1} B^T + Theta W^{-1}`, D the diagonals of the stiffnesses.
  subroutine prepare_preconditioner(self, problem)
    type(iterative_system_t), intent(inout) :: self
    type(contact_problem_t), intent(in) :: problem
    real(dp), allocatable :: yields(:)
    integer :: b, i, k
    allocate (yields(problem%operator%n_rows), source=0.0_dp)
    do b = 1, size(problem%operator%block)
      associate (diagonal => problem%response(b)%form%diagonal, row => problem%operator%block(b)%row, &
                 matrix => problem%operator%block(b)%matrix)
        do i = 1, size(row)
          do k = matrix%row_start(i), matrix%row_start(i + 1) - 1
            if (diagonal(matrix%column(k)) > 0) yields(row(i)) = yields(row(i)) + matrix%value(k)**2/diagonal(matrix%column(k))
          end do
        end do
      end associate
    end do
    self%stiffness = 1/max(tiny(1.0_dp), yields(self%row) + self%layer)
    ! Points that nothing moves get no force.
    where (.not. yields(self%row) + self%layer > 0) self%stiffness = 0
  end subroutine prepare_preconditioner

  !> q = M x on active points: one solve of every body.
  subroutine apply_matrix(self, problem, compliance, x, q)
    type(iterative_system_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    real(dp), intent(in) :: x(:)
    real(dp), intent(out) :: q(:)
    real(dp), allocatable :: force(:), z(:)
    allocate (force(problem%operator%n_rows), z(problem%operator%n_rows))
    force = 0
    force(self%row) = x
    call compliance%multiply(problem, force, z)
    q = z(self%row) + self%layer*x
  end subroutine apply_matrix

  !> x without its resultants: x - G (G^T G)^{-1} G^T x.
  subroutine project(self, x)
    type(iterative_system_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)
    if (size(self%g, 2) > 0) x = x - matmul(self%g, matmul(self%gram_inverse, matmul(x, self%g)))
  end subroutine project

  !> Preconditioned conjugate gradients on `G^T x = 0`, from the given lambda with its resultants corrected to c.
  subroutine iterative_system_solve(self, problem, compliance, b, c, lambda, alpha)
    class(iterative_system_t), intent(in) :: self
    type(contact_problem_t), intent(inout) :: problem
    type(explicit_compliance_t), intent(in) :: compliance
    real(dp), intent(in) :: b(:), c(:)
    real(dp), intent(inout) :: lambda(:)
    real(dp), intent(out) :: alpha(:)
    real(dp), allocatable :: r(:), z(:), p(:), q(:), r_old(:)
    real(dp) :: rz, rz_first, rz_old, step
    integer :: k, n
    n = size(self%row)
    allocate (z(n), p(n), q(n), r_old(n))
    lambda = lambda + matmul(self%g, matmul(self%gram_inverse, c - matmul(lambda, self%g)))
    r = b
    if (any(abs(lambda) > 0)) then
      call apply_matrix(self, problem, compliance, lambda, q)
      r = r - q
    end if
    rz_first = 0
    p = 0
    rz_old = 0
    r_old = 0
    do k = 1, most_steps
      ! Who asks for this solution asks for interrupts too.
      if (interrupted()) exit
      call project(self, r)
      z = self%stiffness*r
      call project(self, z)
      rz = dot_product(r, z)
      if (k == 1) rz_first = max(rz, dot_product(self%stiffness, b**2))
      if (.not. rz > tolerance**2*rz_first) exit
      ! Polak and Ribiere's form forgives rounding errors.
      if (k > 1) p = z + max(0.0_dp, (rz - dot_product(r_old, z))/rz_old)*p
      if (k == 1) p = z
      call apply_matrix(self, problem, compliance, p, q)
      step = dot_product(p, q)
      if (.not. step > 0) exit
      step = dot_product(p, r)/step
      lambda = lambda + step*p
      r_old = r
      r = r - step*q
      rz_old = rz
    end do
    call apply_matrix(self, problem, compliance, lambda, q)
    alpha = matmul(self%gram_inverse, matmul(q - b, self%g))
  end subroutine iterative_system_solve

  !> Give all memory back.
  subroutine iterative_system_destroy(self)
    class(iterative_system_t), intent(inout) :: self
    call self%forget()
    if (allocated(self%stiffness)) deallocate (self%stiffness)
    if (allocated(self%g)) deallocate (self%g)
    if (allocated(self%gram_inverse)) deallocate (self%gram_inverse)
  end subroutine iterative_system_destroy
end module dotyk_scheme_iterative_system
