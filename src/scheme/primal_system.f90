!> The linear systems of the primal scheme as it sees them: made for the rows of a QP from the p-multigrids of its
!> compliance, with the quantities of the QP that follow from displacements.
module dotyk_scheme_primal_system
  use dotyk_base_kinds, only: dp
  use dotyk_linalg_fixed_sum, only: add_multiple, remove_components
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_multigrid, only: contact_multigrid_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_corner_contact, only: solve_corner_contact
  use dotyk_scheme_grid_body, only: grid_body_t, grid_pointer_t, scatter_rows
  implicit none
  private

  type, extends(contact_multigrid_t), public :: primal_system_t  !! The system.
    class(body_compliance_t), pointer :: compliance => null()  !! With p-multigrids for all bodies.
  contains
    procedure :: take_rows => system_take_rows
    procedure :: start => system_start
    procedure :: find_penetrations => system_find_penetrations
    procedure :: keep_displacements => system_keep_displacements
  end type primal_system_t

contains

  !> Make the system for the rows of a QP.
  subroutine system_take_rows(self, qp)
    class(primal_system_t), target, intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    class(body_compliance_t), pointer :: compliance
    type(grid_pointer_t), allocatable :: grid(:)
    type(grid_body_t), allocatable :: body(:)
    integer :: b
    compliance => self%compliance
    call self%destroy()
    allocate (body(size(compliance%body)), grid(size(compliance%body)))
    do b = 1, size(body)
      grid(compliance%body(b)%representative)%p => compliance%body_grid(b)
      call grid(compliance%body(b)%representative)%p%make_sure_of_least()
      body(b)%representative = compliance%body(b)%representative
      body(b)%map = compliance%body(b)%map
    end do
    call self%init(qp%block, qp%n_rows, grid, body, qp%is_tied)
    self%compliance => compliance
    self%is_for_rows = .true.
    self%norm_0 = sqrt(max(0.0_dp, qp%norm_square_0))
    self%gap = -qp%initial_penetration
    allocate (self%load(self%n))
    call load_by_contact(self, qp, compliance, self%load)
    self%error_of_isolated = find_error_of_isolated(self, compliance)
  end subroutine system_take_rows

  !> The start: contact of the bodies in their corner spaces.
  subroutine system_start(self, qp, theta, warm, m, u)
    class(primal_system_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    logical, intent(in) :: warm  !! Whether there are pressures.
    real(dp), intent(inout) :: m(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(inout), contiguous :: u(:)  !! Displacements by contact (n) [length].
    if (.not. warm) call solve_corner_contact(self, qp, self%gap, theta, self%load, m, u)
  end subroutine system_start

  !> The loads that u_0 does not balance: their resultants on the rigid body modes as forces, R e, and what the solves
  !> of u_0 have left.
  subroutine load_by_contact(self, qp, compliance, load)
    class(primal_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! With the resultants.
    class(body_compliance_t), intent(in) :: compliance  !! With the forces that u_0 leaves.
    real(dp), intent(out), contiguous :: load(:)  !! (n) [force]
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
  end subroutine load_by_contact

  !> Error of the displacements of bodies that touch no other, at most [sqrt(energy)].
  real(dp) function find_error_of_isolated(self, compliance) result(norm)
    class(primal_system_t), intent(in) :: self
    class(body_compliance_t), intent(in) :: compliance  !! With the forces that the solves of these bodies leave.
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
  end function find_error_of_isolated

  !> Penetrations of all rows of the QP, of which those of the system may be a part.
  subroutine system_find_penetrations(self, qp, u, y)
    class(primal_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! All rows.
    real(dp), intent(in), contiguous :: u(:)  !! Displacements by contact (n) [length].
    real(dp), intent(out) :: y(:)  !! y_0 + B u (n_rows) [length].
    real(dp), allocatable :: x(:), nodal(:), moved(:)
    integer :: b
    y = qp%initial_penetration
    do b = 1, size(self%body)
      associate (rows => qp%block(b), map => self%compliance%body(b)%map, &
                 grid => self%grid(self%body(b)%representative)%p)
        if (size(rows%row) == 0) cycle
        allocate (x(grid%constraint%n_equations), nodal(map%dimension*map%n_nodes), moved(size(rows%row)))
        call grid%to_equations(u(self%first(b) + 1:self%first(b + 1)), x)
        call map%gather(x, nodal)
        call rows%matrix%multiply(nodal, moved)
        call scatter_rows(rows%row, moved, y)
        deallocate (x, nodal, moved)
      end associate
    end do
  end subroutine system_find_penetrations

  !> Leave the displacements to the compliance, without rigid body motions.
  subroutine system_keep_displacements(self, v, compliance)
    class(primal_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: v(:)  !! Displacements by contact (n) [length].
    class(body_compliance_t), intent(inout) :: compliance  !! Gets u_0 + v.
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
end module dotyk_scheme_primal_system
