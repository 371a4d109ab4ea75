!> The linear systems of the primal scheme as it sees them: made for the rows of a QP from the p-multigrids of its
!> compliance, with the quantities of the QP that follow from displacements. The motions of rigid bodies and the
!> shortenings of bolts are unknowns without stiffness among them.
!>
!> They are a body whose stiffness is zero, and whose rigid body modes are its unknowns: contact and ties resist them.
!> Its corner space is the same, so that ties hold it in the factor of their group; the smoother leaves it alone.
module dotyk_scheme_primal_system
  use dotyk_base_kinds, only: dp, int64
  use dotyk_linalg_fixed_sum, only: add_multiple, remove_components
  use dotyk_linalg_sparse, only: sparse_rows_t, sparse_symmetric_t
  use dotyk_response_body_grid, only: body_grid_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_multigrid, only: contact_multigrid_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_corner_contact, only: solve_corner_contact
  use dotyk_scheme_grid_body, only: grid_body_t, grid_pointer_t, scatter_rows
  implicit none
  private

  type, extends(body_grid_t) :: motion_grid_t  !! The unknowns.
    type(sparse_symmetric_t), private :: nothing  !! The stiffness: zeros.
    real(dp), allocatable, private :: unit(:, :)  !! The unknowns as null vectors of it (n_motions, n_motions) [].
  contains
    procedure :: init => motion_init
    procedure :: multiply => motion_multiply
    procedure :: precondition => motion_precondition
    procedure :: solve_coarse => motion_solve_coarse
    procedure :: corner_entries => motion_corner_entries
    procedure :: prepare_rows => motion_prepare_rows
    procedure :: form_row_compliance => motion_form_row_compliance
    procedure :: get_corner_matrix => motion_get_corner_matrix
    procedure :: destroy => motion_destroy
  end type motion_grid_t

  type, extends(contact_multigrid_t), public :: primal_system_t  !! The system.
    class(body_compliance_t), pointer :: compliance => null()  !! With p-multigrids for all bodies.
    real(dp), allocatable, private :: whole_load(:)  !! All loads; `load` is what u_0 leaves of them (n) [force].
    real(dp), private :: strain_energy_0 = 0, work_0 = 0  !! Strain energy of u_0, and work of the loads on it [energy].
  contains
    procedure :: take_rows => system_take_rows
    procedure :: start => system_start
    procedure :: find_penetrations => system_find_penetrations
    procedure :: find_terms => system_find_terms
    procedure :: keep_displacements => system_keep_displacements
    procedure :: destroy => system_destroy
  end type primal_system_t

contains

  !> Make the system for the rows of a QP.
  subroutine system_take_rows(self, qp)
    class(primal_system_t), target, intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    class(body_compliance_t), pointer :: compliance
    type(grid_pointer_t), allocatable :: grid(:)
    type(grid_body_t), allocatable :: body(:)
    integer, allocatable :: number(:)
    integer :: b, j, k
    compliance => self%compliance
    call self%destroy()
    allocate (body(size(compliance%body) + count(qp%coarse%is_slide)), grid(size(body)), number(size(compliance%body)))
    k = 0
    do b = 1, size(compliance%body)
      k = k + 1
      number(b) = k
      associate (first => qp%coarse%first(b), n => count(.not. qp%coarse%is_slide(qp%coarse%first(b): &
                                                                                qp%coarse%first(b + 1) - 1)))
        body(k)%block = b
        if (associated(compliance%body_grid(b))) then
          body(k)%representative = number(compliance%body(b)%representative)
          grid(body(k)%representative)%p => compliance%body_grid(b)
          call grid(body(k)%representative)%p%make_sure_of_least()
          body(k)%map = compliance%body(b)%map
        else
          ! A rigid body.
          call take_motions(qp, b, first, n, k, body(k), grid(k))
        end if
        do j = first + n, qp%coarse%first(b + 1) - 1
          k = k + 1
          call take_motions(qp, b, j, 1, k, body(k), grid(k))
        end do
      end associate
    end do
    call self%init(qp%block, qp%n_rows, grid, body, qp%is_tied)
    self%compliance => compliance
    self%norm_0 = sqrt(max(0.0_dp, qp%norm_square_0))
    self%gap = -qp%initial_penetration
    self%strain_energy_0 = qp%norm_square_0/2
    self%work_0 = self%strain_energy_0 - qp%energy_0
    allocate (self%load(self%n), self%whole_load(self%n))
    call load_by_contact(self, qp, compliance, self%load, self%whole_load)
    self%error_of_isolated = find_error_of_isolated(self, compliance)
  end subroutine system_take_rows

  !> Take modes of the QP as unknowns without stiffness.
  subroutine take_motions(qp, b, first, n, k, body, grid)
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    integer, intent(in) :: b  !! The body that has the modes.
    integer, intent(in) :: first, n  !! First mode, and their number.
    integer, intent(in) :: k  !! Number of these unknowns among the bodies of the system.
    type(grid_body_t), intent(inout) :: body  !! The unknowns and their rows.
    type(grid_pointer_t), intent(out) :: grid  !! Their levels; the system has to give them back.
    type(motion_grid_t), pointer :: levels
    real(dp), allocatable :: motion(:, :)
    integer, allocatable :: moved(:)
    integer :: i, before
    allocate (levels)
    call levels%init(qp%dimension, n)
    grid%p => levels
    body%block = b
    body%first_motion = first
    body%representative = k
    before = first - qp%coarse%first(b)
    associate (row => qp%block(b)%row, value => qp%coarse%block(b)%value)
      moved = pack([(i, i=1, size(row))], [(any(abs(value(i, before + 1:before + n)) > 0), i=1, size(row))])
      body%row = row(moved)
      allocate (motion(size(moved), n))
      do i = 1, n
        motion(:, i) = value(moved, before + i)/qp%coarse%scale(first + i - 1)
      end do
    end associate
    call body%rows%init_motions(qp%dimension, motion)
  end subroutine take_motions

  !> Give back all memory.
  subroutine system_destroy(self)
    class(primal_system_t), intent(inout) :: self
    integer :: k
    call self%contact_multigrid_t%destroy()
    if (.not. allocated(self%body)) return
    do k = 1, size(self%body)
      if (self%body(k)%first_motion == 0) cycle
      call self%grid(k)%p%destroy()
      deallocate (self%grid(k)%p)
    end do
    deallocate (self%body)
  end subroutine system_destroy

  !> The start: contact of the bodies in their corner spaces.
  subroutine system_start(self, qp, pressure, u)
    class(primal_system_t), intent(inout) :: self
    type(contact_qp_t), intent(in) :: qp  !! The rows.
    real(dp), intent(out) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(inout), contiguous :: u(:)  !! Displacements by contact (n) [length].
    call solve_corner_contact(self, qp, self%gap, self%load, pressure, u)
  end subroutine system_start

  !> The loads that u_0 does not balance: their resultants on the rigid body modes as forces, R e, and what the solves
  !> of u_0 have left; and all loads.
  subroutine load_by_contact(self, qp, compliance, load, whole)
    class(primal_system_t), intent(in) :: self
    type(contact_qp_t), intent(in) :: qp  !! With the resultants.
    class(body_compliance_t), intent(in) :: compliance  !! With the forces that u_0 leaves.
    real(dp), intent(out), contiguous :: load(:), whole(:)  !! (n) [force]
    integer :: b, k, j
    load = 0
    j = 0
    do b = 1, size(self%body)
      associate (grid => self%grid(self%body(b)%representative)%p, &
                 first => self%first(b) + 1, last => self%first(b + 1))
        if (self%body(b)%first_motion == 0) then
          associate (own => compliance%body(self%body(b)%block))
            if (allocated(own%left) .and. allocated(own%free)) call grid%to_system(own%left, load(first:last))
          end associate
        end if
        do k = 1, size(grid%mode, 2)
          j = j + 1
          call add_multiple(grid%n, qp%coarse%resultant(j)/qp%coarse%scale(j), grid%mode(:, k), load(first:last))
        end do
        whole(first:last) = load(first:last)
        if (self%body(b)%first_motion > 0) cycle
        associate (own => compliance%body(self%body(b)%block))
          if (allocated(own%load)) call grid%to_system(own%load, whole(first:last))
        end associate
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
      if (self%body(b)%first_motion > 0) cycle
      associate (grid => self%grid(self%body(b)%representative)%p, own => compliance%body(self%body(b)%block))
        if (allocated(own%free) .or. .not. allocated(own%left)) cycle
        allocate (r(grid%n))
        call grid%to_system(own%left, r)
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
    real(dp), allocatable :: x(:), nodal(:), moved(:), alpha(:)
    real(dp) :: moved_by(qp%n_rows)
    integer :: b
    y = qp%initial_penetration
    do b = 1, size(self%body)
      associate (rows => qp%block(self%body(b)%block), map => self%body(b)%map, &
                 grid => self%grid(self%body(b)%representative)%p, mode => self%body(b)%first_motion)
        if (size(rows%row) == 0) cycle
        if (mode > 0) then
          alpha = 0*qp%coarse%resultant
          alpha(mode:mode + size(grid%mode, 2) - 1) = matmul(u(self%first(b) + 1:self%first(b + 1)), grid%mode)
          call qp%mode_displacement(alpha/qp%coarse%scale, moved_by)
          y = y + moved_by
          cycle
        end if
        allocate (x(grid%constraint%n_equations), nodal(map%dimension*map%n_nodes), moved(size(rows%row)))
        call grid%to_equations(u(self%first(b) + 1:self%first(b + 1)), x)
        call map%gather(x, nodal)
        call rows%matrix%multiply(nodal, moved)
        call scatter_rows(rows%row, moved, y)
        deallocate (x, nodal, moved)
      end associate
    end do
  end subroutine system_find_penetrations

  !> Strain energy and work of the loads. K u_0 is the loads without what u_0 leaves of them.
  subroutine system_find_terms(self, u, terms)
    class(primal_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: u(:)  !! Displacements by contact (n) [length].
    real(dp), allocatable, intent(inout) :: terms(:)  !! (2) [energy]
    real(dp), allocatable :: f(:)
    allocate (f(self%n))
    call self%strain_forces(u, f)
    terms = [self%strain_energy_0 + self%product(u, self%whole_load - self%load) + self%product(u, f)/2, &
             self%work_0 + self%product(u, self%whole_load)]
  end subroutine system_find_terms

  !> Leave the displacements to the compliance, without rigid body motions.
  subroutine system_keep_displacements(self, v, compliance)
    class(primal_system_t), intent(in) :: self
    real(dp), intent(in), contiguous :: v(:)  !! Displacements by contact (n) [length].
    class(body_compliance_t), intent(inout) :: compliance  !! Gets u_0 + v.
    real(dp), allocatable :: own(:)
    integer :: b
    do b = 1, size(self%body)
      if (self%body(b)%first_motion > 0) cycle
      associate (grid => self%grid(self%body(b)%representative)%p, of_body => compliance%body(self%body(b)%block))
        if (.not. allocated(of_body%free)) cycle
        own = v(self%first(b) + 1:self%first(b + 1))
        call remove_components(grid%n, grid%mode, own)
        of_body%found = of_body%free
        call grid%to_equations(own, of_body%found)
        of_body%found(:) = of_body%found + of_body%free
      end associate
    end do
  end subroutine system_keep_displacements

  !> Make some unknowns.
  subroutine motion_init(self, dim, n)
    class(motion_grid_t), intent(inout) :: self
    integer, intent(in) :: dim  !! Components of a node of the other bodies: unknowns come by nodes.
    integer, intent(in) :: n  !! Number of unknowns.
    integer :: i, n_nodes
    n_nodes = (n + dim - 1)/dim
    self%n = dim*n_nodes
    call self%constraint%init(dim, n_nodes)
    self%constraint%equation = reshape([(merge(i, 0, i <= n), i=1, self%n)], [dim, n_nodes])
    self%constraint%n_equations = n
    self%interpolation%n = n
    call self%interpolation%space%init_all_nodes([(i, i=1, n_nodes)])
    self%interpolation%corner_constraint = self%constraint
    call self%fine%rows%init(dim, [(1_int64, i=1, n_nodes + 1)], [integer ::], 1.0_dp)
    call self%fine%rows%pack()
    allocate (self%fine%inverse(dim, dim, n_nodes), source=0.0)
    self%fine%greatest = 1
    allocate (self%mode(self%n, n), self%unit(n, n), source=0.0_dp)
    do i = 1, n
      self%mode(i, i) = 1
      self%unit(i, i) = 1
    end do
    self%nothing%n = n
    self%nothing%column_start = [(int(i, int64), i=0, n)]
    self%nothing%row = [(int(i, int64), i=0, n - 1)]
    allocate (self%nothing%value(n), source=0.0_dp)
    self%is_sure = .true.
  end subroutine motion_init

  !> y = 0.
  subroutine motion_multiply(self, x, y)
    class(motion_grid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: x(:)  !! Displacements (n) [length].
    real(dp), intent(out), contiguous :: y(:)  !! Forces (n) [force].
    y = 0
    associate (not_needed => [self%n, size(x)])
    end associate
  end subroutine motion_multiply

  !> z = 0: nothing but motions is left of forces without resultants on them.
  subroutine motion_precondition(self, r, z)
    class(motion_grid_t), intent(in) :: self
    real(dp), intent(in), contiguous :: r(:)  !! Forces (n) [force].
    real(dp), intent(out), contiguous :: z(:)  !! Displacements (n) [length].
    z = 0
    associate (not_needed => [self%n, size(r)])
    end associate
  end subroutine motion_precondition

  !> x := 0.
  subroutine motion_solve_coarse(self, x)
    class(motion_grid_t), intent(in) :: self
    real(dp), intent(inout) :: x(:)  !! Forces in [force], displacements out [length] (interpolation%n).
    x = 0
    associate (not_needed => self%n)
    end associate
  end subroutine motion_solve_coarse

  !> A solve costs nothing.
  pure real(dp) function motion_corner_entries(self) result(entries)
    class(motion_grid_t), intent(in) :: self
    entries = self%interpolation%n
  end function motion_corner_entries

  !> There is nothing to prepare.
  subroutine motion_prepare_rows(self)
    class(motion_grid_t), intent(inout) :: self
    associate (not_needed => self%n)
    end associate
  end subroutine motion_prepare_rows

  !> Rows do not yield but by the motions.
  subroutine motion_form_row_compliance(self, rows, value)
    class(motion_grid_t), intent(in) :: self
    type(sparse_rows_t), intent(in) :: rows  !! The rows over the motions.
    real(dp), allocatable, intent(out) :: value(:, :)  !! Zero (n, n) [length/force].
    allocate (value(rows%n_rows, rows%n_rows), source=0.0_dp)
    associate (not_needed => self%n)
    end associate
  end subroutine motion_form_row_compliance

  !> Zeros, and the motions.
  subroutine motion_get_corner_matrix(self, matrix, mode)
    class(motion_grid_t), target, intent(in) :: self
    type(sparse_symmetric_t), pointer, intent(out) :: matrix  !! (n_motions, n_motions) [force/length]
    real(dp), pointer, intent(out) :: mode(:, :)  !! (n_motions, n_motions) []
    matrix => self%nothing
    mode => self%unit
  end subroutine motion_get_corner_matrix

  !> Give back all memory.
  subroutine motion_destroy(self)
    class(motion_grid_t), intent(inout) :: self
    call self%fine%destroy()
    call self%nothing%destroy()
    self%n = 0
  end subroutine motion_destroy
end module dotyk_scheme_primal_system
