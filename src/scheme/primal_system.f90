!> The linear systems of the primal scheme as it sees them: made for the rows of a QP from the p-multigrids of its
!> compliance, with the quantities of the QP that follow from displacements, and a bound of the error.
module dotyk_scheme_primal_system
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_fixed_sum, only: add_multiple, remove_components, scalar_product
  use dotyk_scheme_bounds, only: duality_gap
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_multigrid, only: contact_multigrid_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_gap_closing, only: close_gaps, left_open
  use dotyk_scheme_grid_body, only: grid_body_t, grid_pointer_t, scatter_rows
  implicit none
  private

  !> The system.
  type, extends(contact_multigrid_t), public :: primal_system_t
  contains
    procedure :: init_rows => system_init_rows
    procedure :: load_by_contact => system_load_by_contact
    procedure :: error_of_isolated => system_error_of_isolated
    procedure :: amplitudes => system_amplitudes
    procedure :: all_penetrations => system_all_penetrations
    procedure :: keep_displacements => system_keep_displacements
    procedure :: bound => system_bound
    procedure, nopass :: slack => system_slack
    procedure, private :: residual_norm => system_residual_norm
  end type primal_system_t

  !> Inactive rows whose gaps are smaller than this multiple of what active rows miss are closed with them.
  real(dp), parameter :: nearly_closed = 4
  !> Fractions of the diagonal that are added where gaps are closed [].
  real(dp), parameter :: shift(2) = [1.0e-10_dp, 1.0e-4_dp]
  !> Bounds beyond this are none: squares of larger numbers overflow.
  real(dp), parameter :: largest = 1.0e150_dp

contains

  !> Make the system for the rows of a QP.
  subroutine system_init_rows(self, qp, compliance)
    class(primal_system_t), intent(inout) :: self
    !> The rows.
    type(contact_qp_t), intent(in) :: qp
    !> With p-multigrids for all bodies.
    class(body_compliance_t), intent(in) :: compliance
    type(grid_pointer_t) :: grid(size(compliance%body))
    type(grid_body_t), allocatable :: body(:)
    integer :: b
    call self%destroy()
    allocate (body(size(compliance%body)))
    do b = 1, size(body)
      grid(compliance%body(b)%representative)%p => compliance%body_grid(b)
      call grid(compliance%body(b)%representative)%p%make_sure_of_least()
      body(b)%representative = compliance%body(b)%representative
      body(b)%map = compliance%body(b)%map
    end do
    call self%init(qp%block, qp%n_rows, grid, body)
  end subroutine system_init_rows

  !> The loads that u_0 does not balance: their resultants on the rigid body modes as forces, R e, and what the solves
  !> of u_0 have left.
  subroutine system_load_by_contact(self, qp, compliance, load)
    class(primal_system_t), intent(in) :: self
    !> With the resultants.
    type(contact_qp_t), intent(in) :: qp
    !> With the forces that u_0 leaves.
    class(body_compliance_t), intent(in) :: compliance
    !> (n) [force]
    real(dp), intent(out), contiguous :: load(:)
    integer :: b, k, j
    load = 0
    do b = 1, size(self%body)
      associate (grid => self%grid(self%body(b)%representative)%p)
        if (allocated(compliance%body(b)%left) .and. allocated(compliance%body(b)%free)) &
          call grid%to_system(compliance%body(b)%left, load(self%first(b) + 1:self%first(b + 1)))
      end associate
      associate (mode => self%grid(self%body(b)%representative)%p%mode)
        do k = 1, size(mode, 2)
          j = qp%coarse%first(b) + k - 1
          call add_multiple(size(mode, 1), qp%coarse%resultant(j)/qp%coarse%scale(j), mode(:, k), &
                            load(self%first(b) + 1:self%first(b + 1)))
        end do
      end associate
    end do
  end subroutine system_load_by_contact

  !> Error of the displacements of bodies that touch no other, at most [sqrt(energy)].
  real(dp) function system_error_of_isolated(self, compliance) result(norm)
    class(primal_system_t), intent(in) :: self
    !> With the forces that the solves of these bodies leave.
    class(body_compliance_t), intent(in) :: compliance
    real(dp), allocatable :: r(:)
    integer :: b
    norm = 0
    do b = 1, size(self%body)
      if (allocated(compliance%body(b)%free) .or. .not. allocated(compliance%body(b)%left)) cycle
      associate (grid => self%grid(self%body(b)%representative)%p)
        allocate (r(grid%n))
        call grid%to_system(compliance%body(b)%left, r)
        call remove_components(grid%n, grid%mode, r)
        norm = hypot(norm, grid%force_norm(r))
        deallocate (r)
      end associate
    end do
  end function system_error_of_isolated

  !> Amplitudes of the rigid body modes.
  subroutine system_amplitudes(self, qp, v, alpha)
    class(primal_system_t), intent(in) :: self
    !> With the scales of the modes.
    type(contact_qp_t), intent(in) :: qp
    !> Displacements (n) [length].
    real(dp), intent(in), contiguous :: v(:)
    !> In the scales of the QP (coarse%n) [length].
    real(dp), allocatable, intent(out) :: alpha(:)
    integer :: b, k, j
    allocate (alpha(qp%coarse%n), source=0.0_dp)
    do b = 1, size(self%body)
      associate (mode => self%grid(self%body(b)%representative)%p%mode)
        do k = 1, size(mode, 2)
          j = qp%coarse%first(b) + k - 1
          alpha(j) = scalar_product(size(mode, 1), mode(:, k), v(self%first(b) + 1:self%first(b + 1)))/ &
            qp%coarse%scale(j)
        end do
      end associate
    end do
  end subroutine system_amplitudes

  !> Penetrations of all rows of the QP, of which those of the system may be a part.
  subroutine system_all_penetrations(self, qp, compliance, v, y)
    class(primal_system_t), intent(in) :: self
    !> All rows.
    type(contact_qp_t), intent(in) :: qp
    !> For the contact nodes of the bodies.
    class(body_compliance_t), intent(in) :: compliance
    !> Displacements by contact (n) [length].
    real(dp), intent(in), contiguous :: v(:)
    !> y_0 + B v (n_rows) [length].
    real(dp), allocatable, intent(out) :: y(:)
    real(dp), allocatable :: x(:), nodal(:), moved(:)
    integer :: b
    y = qp%initial_penetration
    do b = 1, size(self%body)
      associate (rows => qp%block(b), map => compliance%body(b)%map, grid => self%grid(self%body(b)%representative)%p)
        if (size(rows%row) == 0) cycle
        allocate (x(grid%constraint%n_equations), nodal(map%dimension*map%n_nodes), moved(size(rows%row)))
        call grid%to_equations(v(self%first(b) + 1:self%first(b + 1)), x)
        call map%gather(x, nodal)
        call rows%matrix%multiply(nodal, moved)
        call scatter_rows(rows%row, moved, y)
        deallocate (x, nodal, moved)
      end associate
    end do
  end subroutine system_all_penetrations

  !> Leave the displacements to the compliance, without rigid body motions.
  subroutine system_keep_displacements(self, v, compliance)
    class(primal_system_t), intent(in) :: self
    !> Displacements by contact (n) [length].
    real(dp), intent(in), contiguous :: v(:)
    !> Gets u_0 + v.
    class(body_compliance_t), intent(inout) :: compliance
    real(dp), allocatable :: own(:)
    integer :: b
    do b = 1, size(self%body)
      if (.not. allocated(compliance%body(b)%free)) cycle
      associate (grid => self%grid(self%body(b)%representative)%p)
        own = v(self%first(b) + 1:self%first(b + 1))
        call remove_components(grid%n, grid%mode, own)
        compliance%body(b)%found = compliance%body(b)%free
        call grid%to_equations(own, compliance%body(b)%found)
        compliance%body(b)%found(:) = compliance%body(b)%found + compliance%body(b)%free
      end associate
    end do
  end subroutine system_keep_displacements

  !> A bound of ||u - u_theta||_A [sqrt(energy)].
  !>
  !> With the residual r of the equilibrium of u and lambda, and a displacement g that closes gaps (`close_gaps`), u - g
  !> is admissible, and its duality gap with lambda has nothing but |r + K g|^2/2 and what g leaves of the
  !> complementarity, s. The energy is strongly convex, so that `||u - u_theta|| <= |g| + sqrt((|r| + |g|)^2 + 2 s)`.
  !> |r| comes from the preconditioner and its least eigenvalue. `huge` where other rows penetrate. The least of several
  !> g: none, and such that close gaps of dependent rows with more or less force.
  real(dp) function system_bound(self, weight, theta, load, v, lambda, y) result(bound)
    class(primal_system_t), intent(in) :: self
    !> Weights (n_rows) [area].
    real(dp), intent(in) :: weight(:)
    !> Penalty parameters (n_rows) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Loads (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Displacements by contact (n) [length].
    real(dp), intent(in), contiguous :: v(:)
    !> Contact forces, not negative, in equilibrium with the loads of floating bodies (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> Penetrations (n_rows) [length].
    real(dp), intent(in) :: y(:)
    type(error_t), allocatable :: error
    real(dp) :: closed(size(y)), of_r, of_g, left
    logical :: is_stiff(size(y))
    integer :: k
    is_stiff = .not. theta/weight > self%active%sum%value(self%active%sum%column_start(:size(y)) + 1)
    call self%residual_norm(load, v, lambda, of_r)
    bound = duality_gap(weight, theta, lambda/weight, y)
    if (bound < huge(bound)) bound = sqrt(of_r**2 + 2*bound)
    associate (chosen => lambda > 0 .or. y > -self%slack(weight, theta, lambda, y), softness => theta/weight)
      do k = 1, size(shift)
        call close_gaps(self%active%sum, chosen, merge(y - softness*lambda, 0.0_dp, chosen), softness, shift(k), &
                        closed, of_g, error)
        if (allocated(error)) return
        left = left_open(weight, theta, lambda, y, closed, is_stiff)
        if (max(of_g, left) < largest) bound = min(bound, of_g + sqrt((of_r + of_g)**2 + 2*left))
      end do
    end associate
  end function system_bound

  !> Gaps of inactive rows that are so small that a displacement that closes those of active rows may close them.
  pure real(dp) function system_slack(weight, theta, lambda, y) result(slack)
    !> Weights (n) [area].
    real(dp), intent(in) :: weight(:)
    !> Penalty parameters (n) [length/pressure].
    real(dp), intent(in) :: theta(:)
    !> Contact forces (n) [force].
    real(dp), intent(in) :: lambda(:)
    !> Penetrations (n) [length].
    real(dp), intent(in) :: y(:)
    slack = nearly_closed*maxval([0.0_dp, abs(pack(y - theta/weight*lambda, lambda > 0))])
  end function system_slack

  !> sqrt(r^T K^+ r) of the residual r = load - K v - B^T lambda, at most.
  subroutine system_residual_norm(self, load, v, lambda, norm)
    class(primal_system_t), intent(in) :: self
    !> Loads (n) [force].
    real(dp), intent(in), contiguous :: load(:)
    !> Displacements by contact (n) [length].
    real(dp), intent(in), contiguous :: v(:)
    !> Contact forces (n_rows) [force].
    real(dp), intent(in) :: lambda(:)
    !> [sqrt(energy)]
    real(dp), intent(out) :: norm
    real(dp), allocatable :: r(:)
    integer :: b
    allocate (r(self%n))
    call self%strain_forces(v, r)
    r(:) = load - r
    call self%subtract_row_force(lambda, r)
    norm = 0
    do b = 1, size(self%body)
      associate (own => r(self%first(b) + 1:self%first(b + 1)), grid => self%grid(self%body(b)%representative)%p)
        call remove_components(grid%n, grid%mode, own)
        norm = hypot(norm, grid%force_norm(own))
      end associate
    end do
  end subroutine system_residual_norm
end module dotyk_scheme_primal_system
