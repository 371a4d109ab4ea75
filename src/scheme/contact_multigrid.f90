!> The linear system of an active set in the displacements of all bodies, `K + B^T W B + R T R^T`, solved by conjugate
!> gradients with its preconditioner.
!>
!> The preconditioner is one cycle of p-multigrid (`dotyk_response_multigrid`) that knows the active rows on each level,
!> so that its quality does not depend on W, however stiff: `D + B^T W B` in place of the diagonal blocks D in the
!> smoother (`dotyk_scheme_contact_smoother`), `K_c + P^T B^T W B P` in place of K_c in the corner space. Both are
!> inverted by the identity of Woodbury, but for ties in the corner space, which are in its factor: with C = B D^{-1}
!> B^T or B P K_c^+ P^T B^T,
!>
!>     (K + B^T W B)^{-1} = K^{-1} - K^{-1} B^T (W^{-1} + C)^{-1} B K^{-1}
!>
!> on the active rows. Rigid body modes R of floating bodies are added to the corner space: their amplitudes follow from
!> the equilibrium of contact forces and springs T. The smoother knows no springs: they are weaker by orders than any
!> diagonal block.
module dotyk_scheme_contact_multigrid
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, sp
  use dotyk_base_thresholds, only: largest_square
  use dotyk_linalg_conjugate_gradient, only: cg_outcome_t, conjugate_gradient, preconditioned_system_t
  use dotyk_scheme_coarse_space, only: mode_block_t
  use dotyk_scheme_contact_smoother, only: contact_smoother_t
  use dotyk_scheme_gap_closing, only: close_gaps
  use dotyk_scheme_grid_body, only: body_vector_t
  use dotyk_scheme_proximal_system, only: solve_outcome_t
  implicit none
  private

  !> The system. It owns factors: never copy it, destroy it in the end.
  type, extends(contact_smoother_t), public :: contact_multigrid_t
    real(dp), private :: least = 1  !! Least Ritz value of the preconditioned matrix in all solves so far [].
  contains
    procedure :: set_active => system_set_active
    procedure :: solve => system_solve
    procedure :: force_norm => system_force_norm
    procedure :: close_gaps => system_close_gaps
    procedure :: smoother_compliance => system_smoother_compliance
    procedure :: multiply => system_multiply
    procedure :: precondition => system_precondition
    procedure :: destroy => system_destroy
  end type contact_multigrid_t

  type, extends(preconditioned_system_t) :: seen_t  !! As conjugate gradients see it.
    class(contact_multigrid_t), pointer :: system => null()  !! The system.
  contains
    procedure :: multiply => seen_multiply
    procedure :: precondition => seen_precondition
  end type seen_t

contains

  !> y = A x.
  subroutine seen_multiply(self, x, y)
    class(seen_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! (n) [length]
    real(dp), intent(out), contiguous :: y(:)  !! (n) [force]
    call self%system%multiply(x, y)
  end subroutine seen_multiply

  !> z = M r.
  subroutine seen_precondition(self, r, z)
    class(seen_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! (n) [force]
    real(dp), intent(out), contiguous :: z(:)  !! (n) [length]
    call self%system%precondition(r, z)
  end subroutine seen_precondition

  !> Choose active rows and springs; factorize what the preconditioner needs, unless it has that.
  subroutine system_set_active(self, stiffness, spring, error)
    class(contact_multigrid_t), target, intent(inout) :: self
    real(dp), intent(in) :: stiffness(:)  !! W; zero where not active (n_rows) [force/length].
    type(mode_block_t), intent(in) :: spring(:)  !! T; of size 0 for bodies without modes (n_bodies) [force/length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or memory runs out.
    logical :: has_rows
    if (allocated(self%obstacle)) then
      error = self%obstacle
      return
    end if
    has_rows = .false.
    if (allocated(self%stiffness)) has_rows = .not. any(abs(stiffness - self%stiffness) > 0)
    self%spring = spring
    if (.not. has_rows) then
      if (allocated(self%stiffness)) deallocate (self%stiffness)
      call self%active%set(self, stiffness, error)
      if (allocated(error)) return
      self%stiffness = stiffness
    end if
    call self%active%set_springs(self, spring, error)
  end subroutine system_set_active

  !> Solve (K + B^T W B + R T R^T) e = r. What is left has no resultants on the rigid body modes: K does not resist
  !> these, so that one of them that nothing resists would go where the residual drives it.
  subroutine system_solve(self, r, aim, most_steps, e, outcome, error)
    class(contact_multigrid_t), target, intent(inout) :: self
    real(dp), intent(inout), contiguous :: r(:)  !! Forces (n) [force].
    real(dp), intent(in) :: aim  !! Residual in the norm of the preconditioner to end at [sqrt(energy)].
    integer, intent(in) :: most_steps  !! Iterations at most.
    real(dp), intent(inout), contiguous :: e(:)  !! Displacements (n) [length].
    type(solve_outcome_t), intent(out) :: outcome  !! How it went.
    type(error_t), allocatable, intent(out) :: error  !! Never allocated.
    type(cg_outcome_t) :: cg
    type(seen_t) :: seen
    real(dp), allocatable :: alpha(:)
    real(dp) :: moved(self%n_rows), least, greatest
    seen%system => self
    call conjugate_gradient(seen, r, e, 0.0_dp, most_steps, cg, aim)
    if (cg%steps > 0) then
      call cg%ritz_values(least, greatest)
      if (least > 0) self%least = min(self%least, least)
    end if
    if (self%first_mode(size(self%first_mode)) > 0) then
      call self%row_displacement(e, moved)
      alpha = self%resultants(r) - self%row_resultants(self%stiffness*moved) - self%spring_force(self%resultants(e))
      call self%active%solve_modes(alpha)
      call self%add_modes(alpha, e)
    end if
    self%n_iterations = self%n_iterations + cg%steps
    outcome%steps = cg%steps
    outcome%residual = cg%reduction*cg%first_norm
    outcome%has_failed = .not. cg%first_norm > 0
    associate (not_needed => error)
    end associate
  end subroutine system_solve

  !> Energy norm of the displacements that the ties admit by some forces, at most.
  !>
  !> Without ties, sqrt(r^T K^+ r). Ties admit v with E v = 0, for which `v^T K v = v^T (K + E^T W E) v`: the norm is
  !> sqrt(r^T (K + E^T W E)^+ r) at most. Forces of ties in r, and their rounding, which soft bodies make large where
  !> each is taken by itself, do not count.
  real(dp) function system_force_norm(self, r) result(norm)
    class(contact_multigrid_t), intent(inout) :: self
    real(dp), intent(inout), contiguous :: r(:)  !! Forces; without resultants on return (n) [force].
    type(error_t), allocatable :: error
    type(mode_block_t), allocatable :: spring(:)
    real(dp), allocatable :: of_ties(:), z(:), resultant(:)
    real(dp) :: square, least
    integer :: b, g, i
    norm = 0
    allocate (of_ties(self%n), source=0.0_dp)
    least = self%least
    resultant = self%resultants(r)
    do g = 1, size(self%group)
      if (self%group(g)%is_tied) call self%group(g)%keep_motions(resultant)
    end do
    call self%add_modes(-resultant, r)
    do g = 1, size(self%group)
      do i = 1, size(self%group(g)%body)
        b = self%group(g)%body(i)
        associate (own => r(self%first(b) + 1:self%first(b + 1)), grid => self%grid(self%body(b)%representative)%p)
          if (self%group(g)%is_tied) then
            of_ties(self%first(b) + 1:self%first(b + 1)) = own
            least = min(least, grid%least_eigenvalue())
          else
            norm = hypot(norm, grid%force_norm(own))
          end if
        end associate
      end do
    end do
    if (.not. any(abs(of_ties) > 0)) return
    spring = self%spring
    call self%set_active(merge(self%stiffness, 0.0_dp, self%is_tied), spring, error)
    allocate (z(self%n))
    if (.not. allocated(error)) call self%precondition(of_ties, z)
    square = largest_square
    if (.not. allocated(error)) square = self%product(of_ties, z)/least
    ! Rounding, or a number that is not finite.
    if (.not. square <= largest_square) square = largest_square
    norm = hypot(norm, sqrt(max(0.0_dp, square)))
  end function system_force_norm

  !> Close the gaps of some rows.
  subroutine system_close_gaps(self, chosen, gap, softness, shift, closed, norm, error)
    class(contact_multigrid_t), intent(in) :: self
    logical, intent(in) :: chosen(:)  !! Rows to close (n_rows).
    real(dp), intent(in) :: gap(:)  !! Gaps to close (n_rows) [length].
    real(dp), intent(in) :: softness(:)  !! theta/w (n_rows) [length/force].
    real(dp), intent(in) :: shift  !! Fraction of the diagonal that is added [].
    real(dp), intent(out) :: closed(:)  !! B g, of all rows (n_rows) [length].
    real(dp), intent(out) :: norm  !! Energy norm of g, at most; `huge` where there is none [sqrt(energy)].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is not finite, or memory runs out.
    call close_gaps(self%active%sum, chosen, gap, softness, shift, closed, norm, error)
  end subroutine system_close_gaps

  !> The diagonal of B D^{-1} B^T.
  pure function system_smoother_compliance(self) result(compliance)
    class(contact_multigrid_t), intent(in) :: self
    real(dp) :: compliance(self%n_rows)  !! (n_rows) [length/force].
    compliance = self%active%sum%value(self%active%sum%column_start(:self%n_rows) + 1)
  end function system_smoother_compliance

  !> y = (K + B^T W B + R T R^T) x.
  subroutine system_multiply(self, x, y)
    class(contact_multigrid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Displacements (n) [length].
    real(dp), intent(out), contiguous :: y(:)  !! Forces (n) [force].
    real(dp) :: moved(self%n_rows)
    call self%multiply_bodies(x, y)
    if (self%first_mode(size(self%first_mode)) > 0) call self%add_modes(self%spring_force(self%resultants(x)), y)
    if (size(self%active%row) == 0) return
    call self%row_displacement(x, moved)
    call self%subtract_row_force(-self%stiffness*moved, y)
  end subroutine system_multiply

  !> x = P (K_c + ...)^{-1} P^T r: the correction of the corner space and the rigid body modes.
  subroutine correct(self, r, e, x)
    type(contact_multigrid_t), intent(in) :: self  !! The system.
    real(sp), intent(in), contiguous :: r(:)  !! Residual (n) [force].
    !> Its resultants on the rigid body modes, which single precision does not tell: contact can restrain a mode hardly
    !> (n_modes) [force].
    real(dp), intent(in) :: e(:)
    real(dp), intent(out), contiguous :: x(:)  !! Displacements (n) [length].
    type(body_vector_t), allocatable :: coarse(:), own(:)
    real(dp), allocatable :: lambda(:), alpha(:)
    integer :: k
    allocate (coarse(size(self%body)), own(size(self%body)), lambda(self%n_rows))
    do k = 1, self%solves%n_alone
      call solve_group(self%solves%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%solves%n_alone < self%solves%n)
    do k = self%solves%n_alone + 1, self%solves%n
      call solve_group(self%solves%body(k))
    end do
    !$omp end parallel do
    call self%add_rows(own, lambda)
    ! (W^{-1} + C) lambda - G alpha = B x,  G^T lambda + T alpha = e.
    allocate (alpha(size(e)))
    call self%active%solve_corner(self, lambda, e, alpha)
    do k = 1, self%solves%n_alone
      call push_group(self%solves%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%solves%n_alone < self%solves%n)
    do k = self%solves%n_alone + 1, self%solves%n
      call push_group(self%solves%body(k))
    end do
    !$omp end parallel do
    call self%add_modes(alpha, x)

  contains

    !> The correction of the bodies of one group without contact, and their rows.
    subroutine solve_group(g)
      integer, intent(in) :: g  !! The group.
      integer :: i
      do i = 1, size(self%group(g)%body)
        associate (b => self%group(g)%body(i))
          associate (first => self%first(b) + 1, last => self%first(b + 1), &
                     grid => self%grid(self%body(b)%representative)%p)
            allocate (coarse(b)%value(grid%interpolation%n), own(b)%value(size(self%body(b)%row)))
            call grid%interpolation%restrict(grid%constraint, 1.0_dp, r(first:last), coarse(b)%value)
          end associate
        end associate
      end do
      call self%solve_group(g, coarse)
      do i = 1, size(self%group(g)%body)
        associate (b => self%group(g)%body(i))
          call self%body(b)%rows%corner%multiply(coarse(b)%value, own(b)%value)
        end associate
      end do
    end subroutine solve_group

    !> The correction of the bodies of one group with their contact forces.
    subroutine push_group(g)
      integer, intent(in) :: g  !! The group.
      integer :: i
      if (any(abs(lambda(self%group(g)%row)) > 0)) call subtract_pushed(self, g, lambda, coarse)
      do i = 1, size(self%group(g)%body)
        associate (b => self%group(g)%body(i))
          associate (grid => self%grid(self%body(b)%representative)%p)
            call grid%interpolation%prolong(grid%constraint, coarse(b)%value, x(self%first(b) + 1:self%first(b + 1)))
          end associate
        end associate
      end do
    end subroutine push_group
  end subroutine correct

  !> Subtract K_c^+ P^T B^T lambda of the bodies of one group.
  subroutine subtract_pushed(self, g, lambda, x)
    type(contact_multigrid_t), intent(in) :: self  !! The system.
    integer, intent(in) :: g  !! The group.
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    !> Displacements of the corner spaces, of all bodies (n_bodies) [length].
    type(body_vector_t), intent(inout) :: x(:)
    type(body_vector_t) :: pushed(size(x))
    integer :: i
    do i = 1, size(self%group(g)%body)
      associate (b => self%group(g)%body(i))
        allocate (pushed(b)%value(size(x(b)%value)))
        call self%body(b)%rows%corner%multiply_transposed(lambda(self%body(b)%row), pushed(b)%value)
      end associate
    end do
    call self%solve_group(g, pushed)
    do i = 1, size(self%group(g)%body)
      associate (b => self%group(g)%body(i))
        x(b)%value = x(b)%value - pushed(b)%value
      end associate
    end do
  end subroutine subtract_pushed

  !> One cycle.
  subroutine system_precondition(self, r, z)
    class(contact_multigrid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! Forces r (n) [force].
    real(dp), intent(out), contiguous :: z(:)  !! Displacements z, about (K + B^T W B)^{-1} r (n) [length].
    real(sp), allocatable :: b(:), x(:), rest(:)
    real(dp), allocatable :: correction(:), moved(:), e(:)
    real(dp) :: size_of_r
    integer :: i, k
    size_of_r = maxval(abs(r))
    ! Zero or NaN.
    if (.not. size_of_r > 0) then
      z = r
      return
    end if
    allocate (b(self%n), x(self%n), rest(self%n), correction(self%n))
    !$omp parallel do default(none) shared(self, b, r, size_of_r) schedule(static)
    do i = 1, self%n
      b(i) = real(r(i)/size_of_r, sp)
    end do
    !$omp end parallel do
    call self%smooth(b, x)
    call self%low_residual(b, x, .false., rest)
    e = self%resultants(r)/size_of_r
    if (size(self%active%row) > 0) then
      allocate (moved(self%n_rows))
      call self%row_displacement_low(x, moved)
      e = e - self%row_resultants(self%stiffness*moved)
    end if
    call correct(self, rest, e, correction)
    if (size(self%active%row) > 0) then
      call self%row_displacement(correction, moved)
      call self%subtract_row_force_low(self%stiffness*moved, rest)
    end if
    do k = 1, self%groups%n_alone
      call subtract_correction(self%groups%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%groups%n_alone < self%groups%n)
    do k = self%groups%n_alone + 1, self%groups%n
      call subtract_correction(self%groups%body(k))
    end do
    !$omp end parallel do
    call self%smooth(rest, b)
    do i = 1, size(self%body)
      call add_parts(self%first(i) + 1, self%first(i + 1), &
                     size_of_r/self%grid(self%body(i)%representative)%p%fine%rows%scale, correction, x, b, z)
    end do

  contains

    !> What the correction of the corner space leaves of the residual of one body; the correction is scaled.
    subroutine subtract_correction(body)
      integer, intent(in) :: body  !! The body.
      associate (first => self%first(body) + 1, last => self%first(body + 1), &
                 rows => self%grid(self%body(body)%representative)%p%fine%rows)
        call multiply_by(last - first + 1, rows%scale, correction(first:last))
        call rows%subtract_product(correction(first:last), rest(first:last))
      end associate
    end subroutine subtract_correction
  end subroutine system_precondition

  !> x := factor x.
  subroutine multiply_by(n, factor, x)
    integer, intent(in) :: n  !! Length of the vector.
    real(dp), intent(in) :: factor  !! Factor [any].
    real(dp), intent(inout) :: x(n)  !! The vector (n) [any].
    integer :: i
    !$omp parallel do default(none) shared(n, factor, x) schedule(static)
    do i = 1, n
      x(i) = factor*x(i)
    end do
    !$omp end parallel do
  end subroutine multiply_by

  !> z = factor (a + b + c) for some unknowns.
  subroutine add_parts(first, last, factor, a, b, c, z)
    integer, intent(in) :: first, last  !! First and last unknown.
    real(dp), intent(in) :: factor  !! Factor [length/force].
    real(dp), intent(in), contiguous :: a(:)  !! Correction of the corner space (n) [force].
    real(sp), intent(in), contiguous :: b(:), c(:)  !! Smoothed before and after (n) [force].
    real(dp), intent(inout), contiguous :: z(:)  !! Displacements (n) [length].
    integer :: i
    !$omp parallel do default(none) shared(first, last, factor, a, b, c, z) schedule(static)
    do i = first, last
      z(i) = factor*(a(i) + (real(b(i), dp) + c(i)))
    end do
    !$omp end parallel do
  end subroutine add_parts

  !> Give back the factors.
  subroutine system_destroy(self)
    class(contact_multigrid_t), intent(inout) :: self
    integer :: k
    call self%active%destroy()
    if (allocated(self%group)) then
      do k = 1, size(self%group)
        call self%group(k)%destroy()
      end do
      deallocate (self%group)
    end if
    if (allocated(self%stiffness)) deallocate (self%stiffness)
  end subroutine system_destroy
end module dotyk_scheme_contact_multigrid
