!> The contact of the bodies in their corner spaces: where the proximal active set begins.
!>
!> The dual scheme solves it on the compliances of the rows in the corner spaces. Rows at nodes that are no corners
!> depend on those of the corners there: a penalty parameter of a fraction of the compliance of each row keeps the
!> pressures smooth.
module dotyk_scheme_corner_contact
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, sp
  use dotyk_scheme_body_grids, only: body_grids_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_dense_compliance, only: dense_compliance_t
  use dotyk_scheme_dual, only: dual_t
  use dotyk_scheme_grid_body, only: body_vector_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  implicit none
  private
  public :: solve_corner_contact

  real(dp), parameter :: softness = 0.03_dp  !! Penalty parameter as a fraction of the compliance of a row, at least.
  !> Relative error: no smaller one is worth its time, as the corner space is stiffer than the bodies by some percent.
  real(dp), parameter :: tolerance = 1.0e-3_dp

contains

  !> Solve; zero pressures where there is no solution.
  subroutine solve_corner_contact(system, qp, gap, theta, load, m, u)
    !> The bodies and rows. Its compliances are lent to the dual scheme meanwhile.
    class(body_grids_t), intent(inout) :: system
    type(contact_qp_t), intent(in) :: qp  !! The rows and the rigid body modes.
    !> d, less the displacement of the rows by prescribed displacements (n_rows) [length].
    real(dp), intent(in) :: gap(:)
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    !> Loads and forces of prescribed displacements, over the unknowns of the system (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    real(dp), intent(out) :: m(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(out), contiguous, optional :: u(:)  !! Displacements (n) [length].
    type(contact_qp_t) :: corner_qp
    type(dense_compliance_t) :: compliance
    type(dual_t) :: scheme
    type(solver_settings_t) :: settings
    type(monitor_t) :: monitor
    type(solver_state_t) :: state
    type(error_t), allocatable :: error
    real(dp), allocatable :: y(:), alpha(:)
    integer :: i
    m = 0
    allocate (alpha(system%first_mode(size(system%first_mode))), source=0.0_dp)
    if (size(m) > 0) then
      allocate (y(size(m)))
      corner_qp = qp
      ! The compliances are those of these rows, and of no others.
      corner_qp%parent_row = [(i, i=1, qp%n_rows)]
      call corner_displacement(system, load, y)
      call corner_qp%shift_penetration(y - gap - qp%initial_penetration)
      settings%tolerance = tolerance
      y = max(theta, softness*qp%weight*system%row_compliance())
      call lend(system, corner_qp, compliance)
      call scheme%solve(corner_qp, compliance, y, settings, monitor, state, error)
      call take_back(system, compliance)
      if (.not. allocated(error) .and. allocated(state%m)) then
        m(:) = state%m
        if (size(state%alpha) == size(alpha)) alpha(:) = state%alpha
      end if
    end if
    if (present(u)) call corner_solution(system, load, qp%weight*m, alpha, u)
  end subroutine solve_corner_contact

  !> Give the compliances of the rows in the corner space away, without a copy.
  subroutine lend(system, qp, compliance)
    class(body_grids_t), intent(inout) :: system  !! The bodies; without compliances on return.
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    type(dense_compliance_t), intent(out) :: compliance  !! Gets the compliances.
    integer :: b, i
    call compliance%init(qp)
    do b = 1, size(system%body)
      associate (own => compliance%body(b), owner => system%body(b)%owner)
        own%n = size(qp%block(b)%row)
        own%row = qp%block(b)%row
        own%place = [(i, i=1, own%n)]
        own%number = own%place
        if (owner == b) then
          call move_alloc(system%body(b)%rows%compliance, own%value)
        else
          own%same_as = owner
          deallocate (own%value)
        end if
      end associate
    end do
  end subroutine lend

  !> Take the compliances back.
  subroutine take_back(system, compliance)
    class(body_grids_t), intent(inout) :: system  !! The bodies.
    type(dense_compliance_t), intent(inout) :: compliance  !! With the compliances; without them on return.
    integer :: b
    do b = 1, size(system%body)
      if (system%body(b)%owner == b) call move_alloc(compliance%body(b)%value, system%body(b)%rows%compliance)
    end do
  end subroutine take_back

  !> B P K_c^+ P^T f: the rows by loads, in the corner space, without contact.
  subroutine corner_displacement(self, f, y)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Loads (n) [force].
    real(dp), intent(out) :: y(:)  !! At the rows (n_rows) [length].
    type(body_vector_t), allocatable :: coarse(:), own(:)
    integer :: b
    call solve_corners(self, f, spread(0.0_dp, 1, size(y)), coarse)
    allocate (own(size(self%body)))
    do b = 1, size(self%body)
      allocate (own(b)%value(size(self%body(b)%row)))
      call self%body(b)%rows%corner%multiply(coarse(b)%value, own(b)%value)
    end do
    call self%add_rows(own, y)
  end subroutine corner_displacement

  !> Displacements by loads and contact forces in the corner space, P K_c^+ P^T (f - B^T lambda) + R alpha.
  subroutine corner_solution(self, f, lambda, alpha, u)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Loads (n) [force].
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    real(dp), intent(in) :: alpha(:)  !! Amplitudes of the rigid body modes (n_modes) [length].
    real(dp), intent(out), contiguous :: u(:)  !! Displacements (n) [length].
    type(body_vector_t), allocatable :: coarse(:)
    integer :: b
    call solve_corners(self, f, lambda, coarse)
    do b = 1, size(self%body)
      associate (grid => self%grid(self%body(b)%representative)%p)
        call grid%interpolation%prolong(grid%constraint, coarse(b)%value, &
                                u(self%first(b) + 1:self%first(b + 1)))
      end associate
    end do
    call self%add_modes(alpha, u)
  end subroutine corner_solution

  !> K_c^+ P^T (f - B^T lambda).
  subroutine solve_corners(self, f, lambda, coarse)
    class(body_grids_t), intent(in) :: self
    real(dp), intent(in), contiguous :: f(:)  !! Loads (n) [force].
    real(dp), intent(in) :: lambda(:)  !! Contact forces (n_rows) [force].
    type(body_vector_t), allocatable, intent(out) :: coarse(:)  !! Displacements of the corners (n_bodies) [length].
    integer :: k
    allocate (coarse(size(self%body)))
    do k = 1, self%solves%n_alone
      call solve_body(self%solves%body(k))
    end do
    !$omp parallel do default(none) shared(self) schedule(dynamic, 1) if (self%solves%n_alone < self%solves%n)
    do k = self%solves%n_alone + 1, self%solves%n
      call solve_body(self%solves%body(k))
    end do
    !$omp end parallel do

  contains

    !> One body.
    subroutine solve_body(b)
      integer, intent(in) :: b  !! The body.
      real(dp), allocatable :: pushed(:)
      real(dp) :: size_of_f
      associate (first => self%first(b) + 1, last => self%first(b + 1), &
                 grid => self%grid(self%body(b)%representative)%p, own => self%body(b))
        size_of_f = max(maxval(abs(f(first:last))), tiny(size_of_f))
        allocate (coarse(b)%value(grid%interpolation%n), pushed(grid%interpolation%n))
        call grid%interpolation%restrict(grid%constraint, size_of_f, &
                                 real(f(first:last)/size_of_f, sp), coarse(b)%value)
        call own%rows%corner%multiply_transposed(lambda(own%row), pushed)
        coarse(b)%value = coarse(b)%value - pushed
        call grid%solve_coarse(coarse(b)%value)
      end associate
    end subroutine solve_body
  end subroutine solve_corners
end module dotyk_scheme_corner_contact
