!> The linear system of an active set in the displacements of all bodies, `K + B^T W B`, with its preconditioner.
!>
!> The preconditioner is one cycle of p-multigrid (`dotyk_response_multigrid`) that knows the active rows on each level,
!> so that its quality does not depend on W, however stiff. The smoother is Chebyshev's with `D + B^T W B` in place of
!> the diagonal blocks D: as K <= D, this bounds K + B^T W B, too. The corner space has `K_c + P^T B^T W B P`. Both are
!> inverted by the identity of Woodbury: with C = B D^{-1} B^T or B P K_c^+ P^T B^T,
!>
!>     (K + B^T W B)^{-1} = K^{-1} - K^{-1} B^T (W^{-1} + C)^{-1} B K^{-1}
!>
!> on the active rows. Rigid body modes R of floating bodies are added to the corner space: their amplitudes follow from
!> the equilibrium of the contact forces.
module dotyk_scheme_contact_multigrid
  use dotyk_base_error, only: add_context, error_t
  use dotyk_base_kinds, only: dp, sp
  use dotyk_linalg_block_products, only: smoothing_step
  use dotyk_linalg_blas, only: dtrsv
  use dotyk_linalg_dense, only: cholesky_factor, symmetric_eigen
  use dotyk_linalg_fixed_sum, only: add_multiple, scalar_product
  use dotyk_scheme_body_grids, only: body_grids_t, scatter_rows
  implicit none
  private

  !> A vector of one body.
  type :: vector_t
    !> (any)
    real(dp), allocatable :: value(:)
  end type vector_t

  !> The system.
  type, extends(body_grids_t), public :: contact_multigrid_t
    !> Active rows, ascending (n_active).
    integer, allocatable :: active(:)
    !> W; zero where not active (n_rows) [force/length].
    real(dp), allocatable :: stiffness(:)
    !> Modes that the active rows do not restrain: the system is singular.
    integer :: n_free_modes = 0
    !> Cholesky factors of W^{-1} + C of the smoother and of the corner space (n_active, n_active)
    !> [sqrt(length/force)].
    real(dp), allocatable, private :: smoother(:, :), corner(:, :)
    !> Modes at the active rows, G, and (G^T (W^{-1} + C)^{-1} G)^+ (n_active, n_modes), (n_modes, n_modes).
    real(dp), allocatable, private :: mode(:, :), mode_inverse(:, :)
  contains
    procedure :: set_stiffness => system_set_stiffness
    procedure :: multiply => system_multiply
    procedure :: precondition => system_precondition
    procedure :: smoothed_rows => system_smoothed_rows
    procedure :: smoother_force => system_smoother_force
  end type contact_multigrid_t

  !> Eigenvalues of the stiffness of modes below this fraction of the greatest one are rounding: contact does not
  !> restrain these modes.
  real(dp), parameter :: free_mode = 1.0e-10_dp

contains

  !> Choose the active rows and their stiffness; factorize what the preconditioner needs.
  subroutine system_set_stiffness(self, stiffness, error)
    class(contact_multigrid_t), intent(inout) :: self
    !> W; zero where not active (n_rows) [force/length].
    real(dp), intent(in) :: stiffness(:)
    !> Allocated where a number is not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: smoother(:, :), corner(:, :)
    integer, allocatable :: number(:)
    integer :: b, i, j, k, l, m, n_modes
    self%stiffness = stiffness
    self%active = pack([(i, i=1, self%n_rows)], stiffness > 0)
    m = size(self%active)
    n_modes = self%first_mode(size(self%first_mode))
    allocate (number(self%n_rows), source=0)
    number(self%active) = [(i, i=1, m)]
    allocate (smoother(m, m), corner(m, m), source=0.0_dp)
    do i = 1, m
      smoother(i, i) = 1/stiffness(self%active(i))
      corner(i, i) = smoother(i, i)
    end do
    if (allocated(self%mode)) deallocate (self%mode)
    allocate (self%mode(m, n_modes), source=0.0_dp)
    do b = 1, size(self%body)
      associate (own => self%body(b))
        do j = 1, size(own%row)
          l = number(own%row(j))
          if (l == 0) cycle
          self%mode(l, self%first_mode(b) + 1:self%first_mode(b + 1)) = own%rows%mode(j, :) + &
            self%mode(l, self%first_mode(b) + 1:self%first_mode(b + 1))
          do i = 1, size(own%row)
            k = number(own%row(i))
            if (k == 0) cycle
            smoother(k, l) = smoother(k, l) + own%rows%smoother(i, j)
            corner(k, l) = corner(k, l) + own%rows%compliance(i, j)
          end do
        end do
      end associate
    end do
    call cholesky_factor(smoother, self%smoother, error)
    if (.not. allocated(error)) call cholesky_factor(corner, self%corner, error)
    if (.not. allocated(error)) call invert_modes(self, error)
    if (allocated(error)) call add_context(error, 'multigrid, active rows: ')
  end subroutine system_set_stiffness

  !> (G^T (W^{-1} + C)^{-1} G)^+, without the modes that the active rows do not restrain.
  subroutine invert_modes(self, error)
    !> The system.
    type(contact_multigrid_t), intent(inout) :: self
    !> Allocated where a number is not finite.
    type(error_t), allocatable, intent(out) :: error
    real(dp), allocatable :: solved(:, :), values(:), vectors(:, :)
    integer :: k, n
    n = size(self%mode, 2)
    if (allocated(self%mode_inverse)) deallocate (self%mode_inverse)
    allocate (self%mode_inverse(n, n), source=0.0_dp)
    self%n_free_modes = 0
    if (n == 0) return
    allocate (solved, source=self%mode)
    allocate (values(n), vectors(n, n))
    do k = 1, n
      call solve_factored(self%corner, solved(:, k))
    end do
    call symmetric_eigen(matmul(transpose(self%mode), solved), values, vectors, error)
    if (allocated(error)) return
    do k = 1, n
      if (.not. values(k) > free_mode*values(n)) then
        self%n_free_modes = self%n_free_modes + 1
        cycle
      end if
      self%mode_inverse = self%mode_inverse + &
        matmul(reshape(vectors(:, k)/values(k), [n, 1]), reshape(vectors(:, k), [1, n]))
    end do
  end subroutine invert_modes

  !> x := (L L^T)^{-1} x.
  subroutine solve_factored(l, x)
    !> Cholesky factor (n, n).
    real(dp), intent(in), contiguous :: l(:, :)
    !> Right-hand side in, solution out (n).
    real(dp), intent(inout), contiguous :: x(:)
    if (size(x) == 0) return
    call dtrsv('L', 'N', 'N', size(x), l, size(x), x, 1)
    call dtrsv('L', 'T', 'N', size(x), l, size(x), x, 1)
  end subroutine solve_factored

  !> y = (K + B^T W B) x.
  subroutine system_multiply(self, x, y)
    class(contact_multigrid_t), intent(in) :: self
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: x(:)
    !> Forces (n) [force].
    real(dp), intent(out), contiguous :: y(:)
    real(dp) :: moved(self%n_rows)
    call self%multiply_bodies(x, y)
    if (size(self%active) == 0) return
    call self%row_displacement(x, moved)
    call self%subtract_row_force(-self%stiffness*moved, y)
  end subroutine system_multiply

  !> Subtract B^T (W B x) from a residual in single precision, x of each body times the scale of its stiffness.
  subroutine subtract_contact(self, x, r)
    !> The system.
    type(contact_multigrid_t), intent(in) :: self
    !> Scaled displacements (n) [force].
    real(sp), intent(in), contiguous :: x(:)
    !> Residual (n) [force].
    real(sp), intent(inout), contiguous :: r(:)
    real(dp) :: moved(self%n_rows)
    if (size(self%active) == 0) return
    call self%row_displacement_low(x, moved)
    call self%subtract_row_force_low(self%stiffness*moved, r)
  end subroutine subtract_contact

  !> p := c p + d (D + B^T W B)^{-1} r, x := x + p; r is changed.
  subroutine smoother_step(self, c, d, r, p, x)
    !> The system.
    type(contact_multigrid_t), intent(in) :: self
    !> Factors [].
    real(dp), intent(in) :: c, d
    !> Residual (n) [force].
    real(sp), intent(inout), contiguous :: r(:)
    !> Step and iterate, times the scale of the stiffness of each body (n) [force].
    real(sp), intent(inout), contiguous :: p(:), x(:)
    real(dp) :: lambda(self%n_rows)
    integer :: b
    if (size(self%active) > 0) then
      call self%smoothed_rows(r, lambda)
      lambda = self%smoother_force(lambda)
      call self%subtract_row_force_low(lambda, r)
    end if
    do b = 1, size(self%body)
      associate (first => self%first(b) + 1, last => self%first(b + 1), &
                 fine => self%grid(self%body(b)%representative)%p%fine)
        call smoothing_step(self%dim, fine%rows%n, fine%inverse, real(c, sp), real(d/fine%greatest, sp), &
                            r(first:last), p(first:last), x(first:last))
      end associate
    end do
  end subroutine smoother_step

  !> y = B D^{-1} r, D the diagonal blocks of the smoother.
  subroutine system_smoothed_rows(self, r, y)
    class(contact_multigrid_t), intent(in) :: self
    !> Forces (n) [force].
    real(sp), intent(in), contiguous :: r(:)
    !> At the rows (n_rows) [length].
    real(dp), intent(out) :: y(:)
    real(dp), allocatable :: own(:)
    integer :: b
    y = 0
    do b = 1, size(self%body)
      allocate (own(size(self%body(b)%row)), source=0.0_dp)
      call self%body(b)%rows%add_smoothed(self%grid(self%body(b)%representative)%p, self%dim, &
                                          r(self%first(b) + 1:self%first(b + 1)), own)
      call scatter_rows(self%body(b)%row, own, y)
      deallocate (own)
    end do
  end subroutine system_smoothed_rows

  !> Forces on the active rows that displace them against W and the diagonal blocks: (W^{-1} + B D^{-1} B^T)^{-1} y.
  function system_smoother_force(self, y) result(lambda)
    class(contact_multigrid_t), intent(in) :: self
    !> At the rows (n_rows) [length].
    real(dp), intent(in) :: y(:)
    !> Zero on inactive rows (n_rows) [force].
    real(dp) :: lambda(size(y))
    real(dp), allocatable :: force(:)
    force = y(self%active)
    call solve_factored(self%smoother, force)
    lambda = 0
    lambda(self%active) = force
  end function system_smoother_force

  !> r = b - (K + B^T W B) x, x of each body times the scale of its stiffness.
  subroutine low_residual(self, b, x, r)
    !> The system.
    type(contact_multigrid_t), intent(in) :: self
    !> Right-hand side (n) [force].
    real(sp), intent(in), contiguous :: b(:)
    !> Scaled displacements (n) [force].
    real(sp), intent(in), contiguous :: x(:)
    !> Residual (n) [force].
    real(sp), intent(out), contiguous :: r(:)
    integer :: k
    do k = 1, size(self%body)
      associate (first => self%first(k) + 1, last => self%first(k + 1))
        call self%grid(self%body(k)%representative)%p%fine%rows%residual(b(first:last), x(first:last), r(first:last))
      end associate
    end do
    call subtract_contact(self, x, r)
  end subroutine low_residual

  !> Chebyshev's iteration from x = 0 on the interval from 1/ratio to 1, see `chebyshev_t`.
  subroutine smooth(self, b, x)
    !> The system.
    type(contact_multigrid_t), intent(in) :: self
    !> Right-hand side (n) [force].
    real(sp), intent(in), contiguous :: b(:)
    !> Approximate solution, times the scale of the stiffness of each body (n) [force].
    real(sp), intent(out), contiguous :: x(:)
    real(sp), allocatable :: r(:), p(:)
    real(dp) :: middle, half, rho, last
    integer :: k
    allocate (r, source=b)
    allocate (p(size(b)))
    associate (fine => self%grid(self%body(1)%representative)%p%fine)
      middle = (1 + 1/fine%ratio)/2
      half = (1 - 1/fine%ratio)/2
      x = 0
      rho = half/middle
      call smoother_step(self, 0.0_dp, 1/middle, r, p, x)
      do k = 2, fine%degree
        call low_residual(self, b, x, r)
        last = rho
        rho = 1/(2*middle/half - last)
        call smoother_step(self, rho*last, 2*rho/half, r, p, x)
      end do
    end associate
  end subroutine smooth

  !> x = P (K_c + ...)^{-1} P^T r: the correction of the corner space and the rigid body modes.
  subroutine correct(self, r, x)
    !> The system.
    type(contact_multigrid_t), intent(in) :: self
    !> Residual (n) [force].
    real(sp), intent(in), contiguous :: r(:)
    !> Displacements (n) [length].
    real(dp), intent(out), contiguous :: x(:)
    type(vector_t) :: coarse(size(self%body))
    real(dp), allocatable :: own(:), force(:), e(:), alpha(:), pushed(:)
    real(dp) :: lambda(self%n_rows)
    integer :: b, k
    lambda = 0
    allocate (e(self%first_mode(size(self%first_mode))))
    do b = 1, size(self%body)
      associate (first => self%first(b) + 1, last => self%first(b + 1), &
                 grid => self%grid(self%body(b)%representative)%p)
        allocate (coarse(b)%value(grid%corner_constraint%n_equations), own(size(self%body(b)%row)))
        call grid%space%restrict(grid%constraint, grid%corner_constraint, 1.0_dp, r(first:last), coarse(b)%value)
        do k = 1, size(grid%mode, 2)
          e(self%first_mode(b) + k) = scalar_product(grid%n, grid%mode(:, k), real(r(first:last), dp))
        end do
        call grid%coarse%solve(coarse(b)%value)
        call self%body(b)%rows%corner%multiply(coarse(b)%value, own)
        call scatter_rows(self%body(b)%row, own, lambda)
        deallocate (own)
      end associate
    end do
    ! (W^{-1} + C) lambda - G alpha = B x,  G^T lambda = e.
    force = lambda(self%active)
    call solve_factored(self%corner, force)
    alpha = matmul(self%mode_inverse, e - matmul(force, self%mode))
    if (size(alpha) > 0) then
      pushed = matmul(self%mode, alpha)
      call solve_factored(self%corner, pushed)
      force = force + pushed
    end if
    lambda = 0
    lambda(self%active) = force
    do b = 1, size(self%body)
      associate (first => self%first(b) + 1, last => self%first(b + 1), &
                 grid => self%grid(self%body(b)%representative)%p)
        if (any(abs(lambda(self%body(b)%row)) > 0)) then
          allocate (own(size(coarse(b)%value)))
          call self%body(b)%rows%corner%multiply_transposed(lambda(self%body(b)%row), own)
          call grid%coarse%solve(own)
          coarse(b)%value = coarse(b)%value - own
          deallocate (own)
        end if
        call grid%space%prolong(grid%constraint, grid%corner_constraint, coarse(b)%value, x(first:last))
        do k = 1, size(grid%mode, 2)
          call add_multiple(grid%n, alpha(self%first_mode(b) + k), grid%mode(:, k), x(first:last))
        end do
      end associate
    end do
  end subroutine correct

  !> One cycle.
  subroutine system_precondition(self, r, z)
    class(contact_multigrid_t), intent(in) :: self
    !> Forces r (n) [force].
    real(dp), intent(in), contiguous :: r(:)
    !> Displacements z, about (K + B^T W B)^{-1} r (n) [length].
    real(dp), intent(out), contiguous :: z(:)
    real(sp), allocatable :: b(:), x(:), rest(:)
    real(dp), allocatable :: correction(:)
    real(dp) :: moved(self%n_rows), size_of_r
    integer :: i
    size_of_r = maxval(abs(r))
    ! Zero or NaN.
    if (.not. size_of_r > 0) then
      z = r
      return
    end if
    allocate (x(self%n), rest(self%n), correction(self%n))
    b = real(r/size_of_r, sp)
    call smooth(self, b, x)
    call low_residual(self, b, x, rest)
    call correct(self, rest, correction)
    if (size(self%active) > 0) then
      call self%row_displacement(correction, moved)
      call self%subtract_row_force_low(self%stiffness*moved, rest)
    end if
    do i = 1, size(self%body)
      associate (first => self%first(i) + 1, last => self%first(i + 1), &
                 rows => self%grid(self%body(i)%representative)%p%fine%rows)
        correction(first:last) = rows%scale*correction(first:last)
        call rows%subtract_product(correction(first:last), rest(first:last))
      end associate
    end do
    call smooth(self, rest, b)
    do i = 1, size(self%body)
      associate (first => self%first(i) + 1, last => self%first(i + 1))
        z(first:last) = size_of_r/self%grid(self%body(i)%representative)%p%fine%rows%scale* &
          (correction(first:last) + (real(x(first:last), dp) + b(first:last)))
      end associate
    end do
  end subroutine system_precondition
end module dotyk_scheme_contact_multigrid
