!> Blocks of quadratic elements on each other, in contact, for both schemes: with factors of the whole stiffness for the
!> dual scheme, and with p-multigrids for the proximal active set.
module test_multigrid_scene
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d, analysis_axisymmetric, analysis_plane_strain, default_discretization, &
    gap_formula, geometry_elements, load_traction
  use dotyk_contact_operator, only: build_operator, contact_operator_t
  use dotyk_contact_pair, only: pair_settings_t
  use dotyk_contact_pair_discretization, only: discretize_pair
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_load, only: add_surface_load, load_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_support, only: support_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_response_multigrid, only: multigrid_t
  use dotyk_response_stiffness_factor, only: factorization_report_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_multigrid, only: contact_multigrid_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_grid_body, only: grid_body_t, grid_pointer_t
  use test_bodies, only: box_t, make_body, make_support, straight
  use test_problem, only: make_problem
  implicit none
  private

  !> How the blocks above the lowest one are held: the top of the highest one is pressed down; they are free to move up
  !> and down; they are free; both sides of the contact are held.
  integer, parameter, public :: pressed = 1, floating = 2, loose = 3, clamped = 4

  type, public :: scene_settings_t  !! What a scene is made of.
    !> Element kind and cells along each axis, from the highest block to the lowest (n_bodies).
    integer, allocatable :: kinds(:), cells(:)
    integer :: holding = pressed  !! How the blocks are held.
    integer :: distortion = straight  !! Distortion of the meshes, one of `test_bodies`.
    logical :: is_axisymmetric = .false.  !! Axisymmetric about the left side, instead of plane strain.
    real(dp) :: poisson = 0.3_dp  !! Poisson's ratio [].
    real(dp) :: press = 0.2_dp  !! Displacement of the top [length], or pressure on it [pressure].
    character(:), allocatable :: gap  !! Gap as a formula of x and y; curved in the middle if not allocated [length].
    integer :: n_equal = 1  !! Number of equal pairs between two blocks: rows come again.
    logical :: are_congruent = .false.  !! All blocks but the lowest one share the p-multigrid of the first.
    !> Displacements are those by contact and rigid body motions, as in the primal scheme, not all.
    logical :: by_contact = .false.
    logical :: is_aggregated = .false.  !! Whether corner spaces have smoothed aggregation in place of factors.
  end type scene_settings_t

  type, public :: multigrid_scene_t  !! A scene.
    type(contact_problem_t) :: problem  !! The problem, its quadratic programme and the compliance of the bodies.
    type(contact_qp_t) :: qp
    type(body_compliance_t) :: compliance
    !> The linear systems of the proximal active set, and the p-multigrids they refer to (n_bodies).
    type(contact_multigrid_t) :: system
    type(grid_pointer_t), allocatable :: grid(:)
    !> d less the prescribed displacements of the rows (n_rows) [length], and loads over the system (n) [force].
    real(dp), allocatable :: gap(:), load(:)
  contains
    procedure :: init => scene_init
    procedure :: displacements => scene_displacements
    procedure :: destroy => scene_destroy
  end type multigrid_scene_t

contains

  !> Mesh, discretize, assemble and factorize.
  subroutine scene_init(self, settings)
    class(multigrid_scene_t), intent(inout) :: self
    type(scene_settings_t), intent(in) :: settings  !! What it is made of.
    type(box_t), allocatable :: box(:)
    type(contact_operator_t) :: operator
    type(error_t), allocatable :: error
    type(element_kind_t) :: kind
    integer :: analysis, dim
    kind = element_kind(settings%kinds(1))
    dim = kind%dimension
    analysis = merge(analysis_3d, analysis_plane_strain, dim == 3)
    if (settings%is_axisymmetric) analysis = analysis_axisymmetric
    call make_bodies(self%problem, settings, analysis, dim, box)
    call make_pairs(self%problem, settings, dim, box)
    call build_operator(dim, size(box), self%problem%pair, self%problem%surface_a, self%problem%surface_b, operator)
    call make_problem(operator, self%problem, self%qp, self%compliance, error)
    if (allocated(error)) error stop 'multigrid scene: problem'
    call make_system(self, settings)
  end subroutine scene_init

  !> The blocks, from the highest to the lowest.
  subroutine make_bodies(problem, settings, analysis, dim, box)
    type(contact_problem_t), intent(inout) :: problem  !! Gets the bodies.
    type(scene_settings_t), intent(in) :: settings  !! What the scene is made of.
    integer, intent(in) :: analysis  !! One of `analysis_*`.
    integer, intent(in) :: dim  !! Dimension of space.
    type(box_t), allocatable, intent(out) :: box(:)  !! The meshes (n_bodies).
    type(support_t), allocatable :: support(:)
    type(material_t) :: material
    type(load_t) :: load
    type(error_t), allocatable :: error
    real(dp) :: unit(dim, dim), up(dim), press(3)
    character(3) :: all
    integer :: b, n, i
    n = size(settings%kinds)
    call material%init_isotropic('material', 2.0_dp, settings%poisson, error)
    allocate (problem%body(n), box(n))
    unit = reshape([(merge(1.0_dp, 0.0_dp, mod(i, dim + 1) == 0), i=0, dim**2 - 1)], [dim, dim])
    all = merge('xyz', 'xy ', dim == 3)
    do b = 1, n
      call box(b)%init(settings%kinds(b), settings%cells(b), settings%distortion)
      up = 0
      up(dim) = n - b
      call box(b)%transform(unit, up)
      press = 0
      press(dim) = -settings%press
      if (b == n) then
        support = [make_support(box(b)%side(dim, .false.), trim(all))]
        if (settings%holding == clamped) support = [support, make_support(box(b)%side(dim, .true.), trim(all))]
      else if (settings%holding == clamped) then
        support = [make_support(box(b)%side(dim, .false.), trim(all))]
      else if (b == 1 .and. settings%holding == pressed) then
        support = [make_support(box(b)%side(dim, .true.), trim(all), press)]
      else if (settings%holding == loose) then
        support = [support_t ::]
      else
        support = [make_support(box(b)%side(1, .false.), 'x')]
        if (dim == 3) support = [support, make_support(box(b)%side(2, .false.), 'y')]
      end if
      call make_body(box(b), analysis, material, support, problem%body(b), error)
      if (allocated(error)) error stop 'multigrid scene: body'
      problem%body(b)%name = 'block '//achar(iachar('0') + b)
      if (b == 1 .and. any(settings%holding == [floating, loose])) then
        load%kind = load_traction
        load%value = press
        call add_surface_load(box(b)%mesh, analysis, box(b)%side(dim, .true.), load, problem%body(b)%load, error, &
                              problem%body(b)%applied)
        if (allocated(error)) error stop 'multigrid scene: load'
      end if
    end do
  end subroutine make_bodies

  !> The lower side of each block (slave) on the upper one of the next.
  subroutine make_pairs(problem, settings, dim, box)
    type(contact_problem_t), intent(inout) :: problem  !! Gets the pairs.
    type(scene_settings_t), intent(in) :: settings  !! What the scene is made of.
    integer, intent(in) :: dim  !! Dimension of space.
    type(box_t), intent(in) :: box(:)  !! The meshes (n_bodies).
    type(pair_settings_t) :: pair
    type(formula_t) :: formula
    type(error_t), allocatable :: error
    character(:), allocatable :: gap
    integer :: b, k, n
    n = settings%n_equal*(size(box) - 1)
    allocate (problem%pair(n), problem%surface_a(n), problem%surface_b(n))
    gap = trim(merge('0.5*((x-0.4)^2+(y-0.5)^2)', '0.5*(x-0.4)^2            ', dim == 3))
    if (allocated(settings%gap)) gap = settings%gap
    do k = 1, n
      b = (k - 1)/settings%n_equal + 1
      pair%name = 'joint'
      pair%body_a = b
      pair%body_b = b + 1
      pair%theta = 1
      pair%geometry = geometry_elements
      pair%discretization = default_discretization
      pair%gap_kind = gap_formula
      call formula%init(gap, error)
      problem%surface_a(k) = box(b)%side(dim, .false.)
      problem%surface_b(k) = box(b + 1)%side(dim, .true.)
      call discretize_pair(problem%body(b)%mesh, problem%surface_a(k), problem%body(b + 1)%mesh, &
                           problem%surface_b(k), pair, formula, problem%pair(k), error)
      if (allocated(error)) error stop 'multigrid scene: pair'
      call formula%destroy()
    end do
  end subroutine make_pairs

  !> The p-multigrids, with the rows on both levels.
  subroutine make_system(self, settings)
    class(multigrid_scene_t), intent(inout) :: self
    type(scene_settings_t), intent(in) :: settings  !! What it is made of.
    type(grid_body_t), allocatable :: body(:)
    type(multigrid_t), pointer :: grid
    type(factorization_report_t) :: report
    type(error_t), allocatable :: error
    real(dp), allocatable :: u(:, :), moved(:)
    integer :: b
    associate (problem => self%problem, qp => self%qp)
      allocate (self%grid(size(problem%body)), body(size(problem%body)))
      self%gap = qp%gap
      do b = 1, size(body)
        body(b)%representative = b
        if (settings%are_congruent .and. b < size(body)) body(b)%representative = 1
        if (body(b)%representative == b) then
          allocate (grid)
          if (settings%is_aggregated) then
            grid%largest_factor = 0
            grid%largest_aggregates = 0
            grid%aggregated%levels%most_last = 40
          end if
          call grid%init(problem%body(b), problem%modes(b), report, error)
          self%grid(b)%p => grid
          if (allocated(error)) error stop 'multigrid scene: p-multigrid'
        end if
        call body(b)%map%init(problem%body(b)%constraint, qp%block(b)%contact_node)
        allocate (u, mold=problem%body(b)%load)
        call problem%body(b)%constraint%expand(0*problem%body(b)%rhs, u, .true.)
        allocate (moved(size(qp%block(b)%row)))
        call qp%block(b)%matrix%multiply(reshape(u(:, qp%block(b)%contact_node), &
                                                 [size(u, 1)*size(qp%block(b)%contact_node)]), moved)
        self%gap(qp%block(b)%row) = self%gap(qp%block(b)%row) - moved
        deallocate (u, moved)
      end do
      call self%system%init(qp%block, qp%n_rows, self%grid, body)
      allocate (self%load(self%system%n), source=0.0_dp)
      if (settings%by_contact) then
        self%gap = -qp%initial_penetration
        call self%system%add_modes(qp%coarse%resultant/qp%coarse%scale, self%load)
        return
      end if
      do b = 1, size(problem%body)
        call self%grid(self%system%body(b)%representative)%p%to_system(problem%body(b)%rhs, &
          self%load(self%system%first(b) + 1:self%system%first(b + 1)))
      end do
    end associate
  end subroutine make_system

  !> Displacements of a body in Cartesian components.
  subroutine scene_displacements(self, b, u, displacement)
    class(multigrid_scene_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: u(:)  !! Over the system (n) [length].
    real(dp), allocatable, intent(out) :: displacement(:, :)  !! (dimension, n_nodes) [length]
    real(dp), allocatable :: x(:)
    associate (body => self%problem%body(b))
      allocate (x(body%constraint%n_equations), displacement(body%dimension, body%mesh%n_nodes()))
      call self%grid(self%system%body(b)%representative)%p%to_equations( &
        u(self%system%first(b) + 1:self%system%first(b + 1)), x)
      call body%constraint%expand(x, displacement, .true.)
    end associate
  end subroutine scene_displacements

  !> Give back all memory.
  subroutine scene_destroy(self)
    class(multigrid_scene_t), intent(inout) :: self
    integer :: b
    call self%system%destroy()
    do b = 1, size(self%grid)
      if (.not. associated(self%grid(b)%p)) cycle
      call self%grid(b)%p%destroy()
      deallocate (self%grid(b)%p)
    end do
    call self%compliance%destroy()
  end subroutine scene_destroy
end module test_multigrid_scene
