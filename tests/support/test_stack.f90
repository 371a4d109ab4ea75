!> Two elastic boxes on each other, in contact: a whole problem with its quadratic programme, and its solution by one
!> dense system.
module test_stack
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_strain, default_discretization, gap_formula, geometry_elements, &
    load_traction
  use dotyk_contact_operator, only: build_operator, contact_operator_t
  use dotyk_contact_pair, only: pair_settings_t
  use dotyk_contact_pair_discretization, only: discretize_pair
  use dotyk_control_body_solution, only: body_solution_t
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: assemble_stiffness, stiffness_t
  use dotyk_elasticity_load, only: add_surface_load, load_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_support, only: support_t
  use dotyk_linalg_dense, only: solve_dense
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_element, only: element_quad4
  use dotyk_mesh_surface, only: surface_t
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use test_bodies, only: box_t, make_body, make_support, steel, undistorted
  use test_problem, only: make_problem
  implicit none
  private

  !> What a stack is made of; the default is a well-conditioned one with contact on a part of the rows.
  type, public :: stack_settings_t
    !> Element kind of both boxes, in two dimensions, and cells along each axis of the upper and the lower box.
    integer :: kind = element_quad4, cells(2) = [4, 3]
    !> Whether the upper box can move up and down (one rigid body mode); otherwise its top is held and moved down by
    !> `press`.
    logical :: is_floating = .true.
    !> Pressure on the top of the floating upper box [pressure], or displacement of the top of the held one [length].
    real(dp) :: press = 0.2_dp
    character(60) :: gap = '(x-0.4)^2'  !! Gap as a formula of x [length].
    integer :: discretization = default_discretization  !! One of `discretization_*`.
    real(dp) :: theta = 0.01_dp  !! Penalty parameter of all rows [length/pressure].
    !> Number of pairs: the slave surface is cut into so many pieces of one size, from left to right.
    integer :: n_pairs = 1
    type(material_t), allocatable :: material  !! Material of both boxes; `steel` of test_bodies if not allocated.
  end type stack_settings_t

  type, public :: stack_t  !! A stack. Body 1 is the upper box and has the slave surface.
    type(contact_problem_t) :: problem  !! The problem; pairs and their surfaces included.
    type(contact_qp_t) :: qp  !! Its quadratic programme.
    type(body_compliance_t) :: compliance  !! Its compliance operator.
  contains
    procedure :: init => stack_init
    procedure :: direct_solution => stack_direct_solution
    procedure :: exact_solution => stack_exact_solution
    procedure :: contact_forces => stack_contact_forces
    procedure :: destroy => stack_destroy
  end type stack_t

  public :: add_dense

contains

  !> Mesh, discretize, assemble and factorize.
  subroutine stack_init(self, settings)
    class(stack_t), intent(inout) :: self
    type(stack_settings_t), intent(in) :: settings  !! What it is made of.
    real(dp), parameter :: identity(2, 2) = reshape([1.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [2, 2])
    type(box_t) :: box(2)
    type(contact_operator_t) :: operator
    type(pair_settings_t) :: pair
    type(formula_t) :: formula
    type(material_t) :: material
    type(support_t) :: support(1)
    type(load_t) :: load
    type(error_t), allocatable :: error
    integer :: b, k, n
    call self%destroy()
    material = steel()
    if (allocated(settings%material)) material = settings%material
    associate (problem => self%problem)
      n = settings%n_pairs
      allocate (problem%body(2), problem%pair(n), problem%surface_a(n), problem%surface_b(n))
      do b = 1, 2
        call box(b)%init(settings%kind, settings%cells(b), undistorted)
        if (b == 1) call box(b)%transform(identity, [0.0_dp, 1.0_dp])
        if (b == 2) then
          support(1) = make_support(box(b)%side(2, .false.), 'xy')
        else if (settings%is_floating) then
          support(1) = make_support(box(b)%side(1, .false.), 'x')
        else
          support(1) = make_support(box(b)%side(2, .true.), 'xy', [0.0_dp, -settings%press, 0.0_dp])
        end if
        call make_body(box(b), analysis_plane_strain, material, support, problem%body(b), error)
        if (.not. allocated(error) .and. b == 1 .and. settings%is_floating) then
          load%kind = load_traction
          load%value = [0.0_dp, -settings%press, 0.0_dp]
          call add_surface_load(box(b)%mesh, analysis_plane_strain, box(b)%side(2, .true.), load, &
                                problem%body(b)%load, error, problem%body(b)%applied)
        end if
        if (allocated(error)) error stop 'stack: body'
        problem%body(b)%name = trim(merge('upper', 'lower', b == 1))
      end do
      pair%name = 'joint'
      pair%body_a = 1
      pair%body_b = 2
      pair%theta = settings%theta
      pair%geometry = geometry_elements
      pair%discretization = settings%discretization
      pair%gap_kind = gap_formula
      call formula%init(trim(settings%gap), error)
      do k = 1, n
        if (allocated(error)) error stop 'stack: pair'
        problem%surface_a(k) = piece(box(1)%side(2, .false.), problem%body(1)%mesh%x(1, :), (k - 1.0_dp)/n, &
                                     real(k, dp)/n)
        problem%surface_b(k) = box(2)%side(2, .true.)
        call discretize_pair(problem%body(1)%mesh, problem%surface_a(k), problem%body(2)%mesh, problem%surface_b(k), &
                             pair, formula, problem%pair(k), error)
      end do
      call formula%destroy()
      if (allocated(error)) error stop 'stack: pair'
      call build_operator(2, 2, problem%pair, problem%surface_a, problem%surface_b, operator)
      call make_problem(operator, problem, self%qp, self%compliance, error)
      if (allocated(error)) error stop 'stack: problem'
    end associate
  end subroutine stack_init

  !> The facets of a surface between two places along x.
  function piece(surface, x, from, to) result(part)
    type(surface_t), intent(in) :: surface  !! The surface.
    real(dp), intent(in) :: x(:)  !! Of the nodes of the body (n_nodes) [length].
    real(dp), intent(in) :: from, to  !! Left and right end [length].
    type(surface_t) :: part
    real(dp), parameter :: rounding = 1.0e-9_dp
    integer, allocatable :: f(:)
    integer :: i
    f = pack([(i, i=1, surface%n_facets)], [(all(x(surface%node(:2, i)) > from - rounding .and. &
                                                 x(surface%node(:2, i)) < to + rounding), i=1, surface%n_facets)])
    part = surface
    part%n_facets = size(f)
    part%kind = surface%kind(f)
    part%node = surface%node(:, f)
    part%block = surface%block(f)
    part%element = surface%element(f)
    part%tag = surface%tag(f)
  end function piece

  !> The displacements by one dense system of both bodies: no compliance, no Lagrange multipliers, no modes. Rows that
  !> are active are springs: `(K + B^T W Theta^{-1} B) u = f + B^T W Theta^{-1} d` over these rows.
  subroutine stack_direct_solution(self, theta, active, solution, penetration)
    class(stack_t), intent(in) :: self
    real(dp), intent(in) :: theta(:)  !! Penalty parameters, positive where active (n_rows) [length/pressure].
    logical, intent(in) :: active(:)  !! Active rows (n_rows).
    type(body_solution_t), intent(out) :: solution(2)  !! Displacements (2).
    real(dp), intent(out) :: penetration(:)  !! B u - d (n_rows) [length].
    type(stiffness_t) :: stiffness
    type(error_t), allocatable :: error
    real(dp), allocatable :: matrix(:, :), rows(:, :), x(:, :), u(:)
    integer :: b, i, j, n, first(3)
    associate (body => self%problem%body, qp => self%qp)
      first = [0, body(1)%constraint%n_equations, sum(body%constraint%n_equations)]
      n = first(3)
      allocate (matrix(n, n), rows(qp%n_rows, n), x(n, 1), source=0.0_dp)
      penetration = -qp%gap
      do b = 1, 2
        call assemble_stiffness(body(b), stiffness, error)
        if (allocated(error)) error stop 'stack: stiffness'
        call add_dense(stiffness%matrix, matrix(first(b) + 1:first(b + 1), first(b) + 1:first(b + 1)))
        x(first(b) + 1:first(b + 1), 1) = body(b)%rhs
        associate (block => qp%block(b))
          ! Prescribed displacements are known displacements of the rows.
          u = reshape(body(b)%constraint%prescribed(:, block%contact_node), [2*block%n_nodes])
          do i = 1, size(block%row)
            do j = block%matrix%row_start(i), block%matrix%row_start(i + 1) - 1
              associate (k => block%matrix%column(j), value => block%matrix%value(j))
                penetration(block%row(i)) = penetration(block%row(i)) + value*u(k)
                associate (equation => body(b)%constraint%equation(2 - mod(k, 2), block%contact_node((k + 1)/2)))
                  if (equation > 0) rows(block%row(i), first(b) + equation) = value
                end associate
              end associate
            end do
          end do
        end associate
      end do
      do i = 1, qp%n_rows
        if (.not. active(i)) cycle
        matrix = matrix + matmul(reshape(rows(i, :), [n, 1]), rows(i:i, :))*qp%weight(i)/theta(i)
        x(:, 1) = x(:, 1) - rows(i, :)*penetration(i)*qp%weight(i)/theta(i)
      end do
      call solve_dense(matrix, x, error)
      if (allocated(error)) error stop 'stack: the dense system is singular'
      penetration = penetration + matmul(rows, x(:, 1))
      do b = 1, 2
        allocate (solution(b)%displacement(2, body(b)%mesh%n_nodes()))
        call body(b)%constraint%expand(x(first(b) + 1:first(b + 1), 1), solution(b)%displacement, .true.)
      end do
    end associate
  end subroutine stack_direct_solution

  !> As `direct_solution`, with the active set that belongs to it: rows are active where they penetrate.
  subroutine stack_exact_solution(self, theta, active, solution, penetration)
    class(stack_t), intent(in) :: self
    real(dp), intent(in) :: theta(:)  !! Penalty parameters, all positive (n_rows) [length/pressure].
    logical, intent(out) :: active(:)  !! Active rows (n_rows).
    type(body_solution_t), intent(out) :: solution(2)  !! Displacements (2).
    real(dp), intent(out) :: penetration(:)  !! B u - d (n_rows) [length].
    integer :: k
    active = .true.
    do k = 1, 20
      call self%direct_solution(theta, active, solution, penetration)
      if (all(active .eqv. penetration > 0)) return
      active = penetration > 0
    end do
    error stop 'stack: no active set'
  end subroutine stack_exact_solution

  !> Nodal contact forces of all nodes of a body, - B_b^T W m, from the columns of B.
  subroutine stack_contact_forces(self, b, pressure, force)
    class(stack_t), intent(in) :: self
    integer, intent(in) :: b  !! The body.
    real(dp), intent(in) :: pressure(:)  !! Pressures (n_rows) [pressure].
    real(dp), intent(out) :: force(:, :)  !! (2, n_nodes) [force].
    integer :: i, j
    force = 0
    associate (block => self%qp%block(b))
      do i = 1, size(block%row)
        do j = block%matrix%row_start(i), block%matrix%row_start(i + 1) - 1
          associate (k => block%matrix%column(j), row => block%row(i))
            associate (own => force(2 - mod(k, 2), block%contact_node((k + 1)/2)))
              own = own - block%matrix%value(j)*self%qp%weight(row)*pressure(row)
            end associate
          end associate
        end do
      end do
    end associate
  end subroutine stack_contact_forces

  !> Add a sparse symmetric matrix to a dense one.
  subroutine add_dense(sparse, dense)
    type(sparse_symmetric_t), intent(in) :: sparse  !! Lower triangle by columns.
    real(dp), intent(inout) :: dense(:, :)  !! (n, n).
    integer :: i, j, k
    do j = 1, sparse%n
      do k = int(sparse%column_start(j)) + 1, int(sparse%column_start(j + 1))
        i = int(sparse%row(k)) + 1
        dense(i, j) = dense(i, j) + sparse%value(k)
        if (i /= j) dense(j, i) = dense(j, i) + sparse%value(k)
      end do
    end do
  end subroutine add_dense

  !> Give back all memory.
  subroutine stack_destroy(self)
    class(stack_t), intent(inout) :: self
    call self%compliance%destroy()
    self%problem = contact_problem_t()
  end subroutine stack_destroy
end module test_stack
