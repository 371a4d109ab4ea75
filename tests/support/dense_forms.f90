!> The forms of the paper (docs/theory.md) on three small bodies, as dense matrices over the free displacements of all
!> bodies: the problem as its sections 1 to 3 write it, without compliances, Lagrange multipliers and schemes.
!>
!> A vector u(n) is an element of V_0. `u_an + u_bn` of contact row i is (rows u)_i, and integrals over S_ab are sums
!> over rows with their weights.
module dense_forms
  use dense_algebra, only: inner
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d, gap_formula, geometry_elements, load_force_density, load_traction
  use dotyk_contact_operator, only: build_operator, contact_operator_t
  use dotyk_contact_pair, only: pair_settings_t
  use dotyk_contact_pair_discretization, only: discretize_pair
  use dotyk_control_body_solution, only: body_solution_t, recover_bodies
  use dotyk_control_contact_problem, only: contact_problem_t
  use dotyk_elasticity_body, only: assemble_stiffness, body_t, stiffness_t
  use dotyk_elasticity_load, only: add_surface_load, add_volume_load, load_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_shape_table, only: map_element, shape_table_t
  use dotyk_elasticity_support, only: support_t
  use dotyk_mesh_element, only: element_hex8, element_tet4
  use dotyk_scheme_body_compliance, only: body_compliance_t
  use dotyk_scheme_contact_qp, only: contact_qp_t
  use dotyk_scheme_monitor, only: monitor_t
  use dotyk_scheme_scheme, only: scheme_t
  use dotyk_scheme_solver_state, only: solver_state_t
  use dotyk_scheme_stopping, only: solver_settings_t
  use test_bodies, only: box_t, make_body, make_support, steel, undistorted
  use test_problem, only: make_problem
  use test_stack, only: add_dense
  implicit none
  private

  !> Three blocks on each other: the lowest held at its bottom, the middle one at a side, the highest at its top. Loads
  !> close a part of both joints.
  type, public :: forms_t
    !> Bodies and pairs of the program, its quadratic programme and compliance operator.
    type(contact_problem_t) :: problem
    type(contact_qp_t) :: qp
    type(body_compliance_t) :: compliance
    integer :: first(4) = 0, n = 0  !! Equations of body b are first(b)+1 .. first(b+1) (4); of all bodies.
    real(dp), allocatable :: a(:, :), gram(:, :)  !! A, and the scalar product of V_0, that of (H^1)^3 (n, n).
    real(dp), allocatable :: rows(:, :)  !! u_an + u_bn of the rows (n_rows, n) [].
    real(dp), allocatable :: load(:), theta(:), weight(:), gap(:)  !! L (n), theta, weights and gaps (n_rows).
  contains
    procedure :: init => forms_init
    procedure :: penetration => forms_penetration
    procedure :: penalty => forms_penalty
    procedure :: penalty_slope => forms_penalty_slope
    procedure :: penalty_curvature => forms_penalty_curvature
    procedure :: closed_curvature => forms_closed_curvature
    procedure :: functional => forms_functional
    procedure :: slope => forms_slope
    procedure :: expand => forms_expand
    procedure :: solve => forms_solve
    procedure :: destroy => forms_destroy
  end type forms_t

contains

  !> Mesh, discretize, assemble.
  subroutine forms_init(self, discretization)
    class(forms_t), intent(inout) :: self
    integer, intent(in) :: discretization  !! One of `discretization_*`.
    type(contact_operator_t) :: operator
    type(error_t), allocatable :: error
    integer :: b
    call self%destroy()
    call make_bodies(self%problem)
    call make_pairs(discretization, self%problem)
    associate (problem => self%problem)
      call build_operator(3, 3, problem%pair, problem%surface_a, problem%surface_b, operator)
      call make_problem(operator, problem, self%qp, self%compliance, error)
      if (allocated(error)) error stop 'forms: problem'
      do b = 1, 3
        self%first(b + 1) = self%first(b) + problem%body(b)%constraint%n_equations
      end do
      self%n = self%first(4)
      self%theta = [problem%pair(1)%row_theta, problem%pair(2)%row_theta]
    end associate
    self%weight = self%qp%weight
    self%gap = self%qp%gap
    call assemble(self)
  end subroutine forms_init

  !> The bodies, with supports at rest and loads.
  subroutine make_bodies(problem)
    type(contact_problem_t), intent(inout) :: problem  !! Gets bodies.
    integer, parameter :: kind(3) = [element_tet4, element_hex8, element_tet4], cells(3) = [2, 3, 2]
    real(dp), parameter :: identity(3, 3) = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1]*1.0_dp, [3, 3])
    type(box_t) :: box
    type(material_t) :: material
    type(support_t), allocatable :: support(:)
    type(load_t) :: load
    type(error_t), allocatable :: error
    integer :: b
    allocate (problem%body(3), problem%pair(2), problem%surface_a(2), problem%surface_b(2))
    do b = 1, 3
      call box%init(kind(b), cells(b), undistorted)
      call box%transform(identity, [0.0_dp, 0.0_dp, b - 1.0_dp])
      select case (b)
      case (1)
        material = steel()
        support = [make_support(box%side(3, .false.), 'xyz')]
        problem%surface_b(1) = box%side(3, .true.)
      case (2)
        call material%init_orthotropic('ply', [4.0_dp, 2.0_dp, 3.0_dp], [0.3_dp, 0.25_dp, 0.2_dp], &
                                       [1.0_dp, 1.5_dp, 0.7_dp], [1.0_dp, 0.5_dp, 0.2_dp], [0.1_dp, 1.0_dp, 0.3_dp], &
                                       error)
        support = [make_support(box%side(1, .false.), 'xyz')]
        problem%surface_a(1) = box%side(3, .false.)
        problem%surface_a(2) = box%side(3, .true.)
      case (3)
        call material%init_isotropic('other', 5.0_dp, 0.2_dp, error)
        support = [make_support(box%side(3, .true.), 'xyz')]
        problem%surface_b(2) = box%side(3, .false.)
      end select
      call make_body(box, analysis_3d, material, support, problem%body(b), error)
      if (allocated(error)) error stop 'forms: body'
      problem%body(b)%name = achar(iachar('a') + b)
      if (b == 2) then
        load%kind = load_force_density
        load%value = [0.05_dp, 0.0_dp, -0.1_dp]
        call add_volume_load(box%mesh, analysis_3d, load, problem%body(b)%load, error)
      else if (b == 3) then
        load%kind = load_traction
        load%value = [0.0_dp, 0.1_dp, -0.3_dp]
        call add_surface_load(box%mesh, analysis_3d, box%side(1, .true.), load, problem%body(b)%load, error)
      end if
      if (allocated(error)) error stop 'forms: load'
    end do
  end subroutine make_bodies

  !> The pairs: the body in the middle is the slave of both.
  subroutine make_pairs(discretization, problem)
    integer, intent(in) :: discretization  !! One of `discretization_*`.
    type(contact_problem_t), intent(inout) :: problem  !! With bodies; gets pairs.
    character(*), parameter :: gap(2) = ['0.01*(1-x) ', '0.004*(1-y)']
    type(pair_settings_t) :: pair
    type(formula_t) :: formula
    type(error_t), allocatable :: error
    integer :: k
    pair%geometry = geometry_elements
    pair%discretization = discretization
    pair%gap_kind = gap_formula
    pair%body_a = 2
    do k = 1, 2
      pair%name = merge('lower', 'upper', k == 1)
      pair%body_b = merge(1, 3, k == 1)
      pair%theta = 0.25_dp*k
      call formula%init(trim(gap(k)), error)
      if (allocated(error)) error stop 'forms: gap'
      call discretize_pair(problem%body(2)%mesh, problem%surface_a(k), problem%body(pair%body_b)%mesh, &
                           problem%surface_b(k), pair, formula, problem%pair(k), error)
      if (allocated(error)) error stop 'forms: pair'
      call formula%destroy()
    end do
  end subroutine make_pairs

  !> The forms as matrices.
  subroutine assemble(self)
    type(forms_t), intent(inout) :: self  !! With bodies, rows and equations; gets matrices and loads.
    type(stiffness_t) :: stiffness
    type(error_t), allocatable :: error
    integer :: b, i, j
    allocate (self%a(self%n, self%n), self%gram(self%n, self%n), self%rows(self%qp%n_rows, self%n), source=0.0_dp)
    allocate (self%load(self%n))
    do b = 1, 3
      associate (body => self%problem%body(b), block => self%qp%block(b), from => self%first(b) + 1, &
                 to => self%first(b + 1))
        call assemble_stiffness(body, stiffness, error)
        if (allocated(error)) error stop 'forms: stiffness'
        call add_dense(stiffness%matrix, self%a(from:to, from:to))
        call add_gram(body, self%gram(from:to, from:to))
        call body%constraint%reduce(body%load, self%load(from:to))
        do i = 1, size(block%row)
          do j = block%matrix%row_start(i), block%matrix%row_start(i + 1) - 1
            associate (k => block%matrix%column(j) - 1)
              associate (equation => body%constraint%equation(mod(k, 3) + 1, block%contact_node(k/3 + 1)))
                if (equation > 0) self%rows(block%row(i), from - 1 + equation) = block%matrix%value(j)
              end associate
            end associate
          end do
        end do
      end associate
    end do
  end subroutine assemble

  !> Add the scalar product of (H^1)^3 over one body.
  subroutine add_gram(body, gram)
    type(body_t), intent(in) :: body  !! The body; its supports are along global axes.
    real(dp), intent(inout) :: gram(:, :)  !! (n_equations, n_equations).
    type(shape_table_t) :: table
    real(dp), allocatable :: g(:, :, :), w(:), local(:, :)
    real(dp) :: worst
    integer :: e, i, k, l, q
    call table%init(body%mesh%block(1)%kind, 4)
    associate (n => table%n_nodes)
      allocate (g(n, 3, table%n_points), w(table%n_points), local(n, n))
      do e = 1, body%mesh%n_elements()
        associate (node => body%mesh%block(1)%node(:, e))
          call map_element(n, 3, 3, table%n_points, table%shape, table%gradient, table%weight, body%mesh%x(:, node), &
                           g, w, worst)
          local = 0
          do q = 1, table%n_points
            associate (shape => table%shape(:, q:q), slope => g(:, :, q))
              local = local + w(q)*(matmul(shape, transpose(shape)) + matmul(slope, transpose(slope)))
            end associate
          end do
          do l = 1, n
            do k = 1, n
              do i = 1, 3
                associate (row => body%constraint%equation(i, node(k)), column => body%constraint%equation(i, node(l)))
                  if (row > 0 .and. column > 0) gram(row, column) = gram(row, column) + local(k, l)
                end associate
              end do
            end do
          end do
        end associate
      end do
    end associate
  end subroutine add_gram

  !> `u_an + u_bn - d` (n_rows) [length].
  pure function forms_penetration(self, u) result(y)
    class(forms_t), intent(in) :: self
    real(dp), intent(in) :: u(:)  !! Element of V_0 (n) [length].
    real(dp) :: y(size(self%gap))
    y = matmul(self%rows, u) - self%gap
  end function forms_penetration

  !> j_theta(u) of (18) [energy].
  pure real(dp) function forms_penalty(self, u) result(j)
    class(forms_t), intent(in) :: self
    real(dp), intent(in) :: u(:)  !! Element of V_0 (n) [length].
    j = sum(self%weight/(2*self%theta)*min(0.0_dp, -self%penetration(u))**2)
  end function forms_penalty

  !> j'_theta(u, .) (n) [force].
  pure function forms_penalty_slope(self, u) result(slope)
    class(forms_t), intent(in) :: self
    real(dp), intent(in) :: u(:)  !! Element of V_0 (n) [length].
    real(dp) :: slope(self%n), force(size(self%gap))
    force = self%weight/self%theta*min(0.0_dp, -self%penetration(u))
    slope = -matmul(force, self%rows)
  end function forms_penalty_slope

  !> j''_theta(u, ., .) (n, n) [force/length].
  pure function forms_penalty_curvature(self, u) result(curvature)
    class(forms_t), intent(in) :: self
    real(dp), intent(in) :: u(:)  !! Element of V_0 (n) [length].
    real(dp) :: curvature(self%n, self%n), factor(size(self%gap))
    ! 1 - sgn(y) with y = d - u_an - u_bn, over 2.
    factor = self%weight/self%theta*(1 - sign(1.0_dp, -self%penetration(u)))/2
    curvature = matmul(transpose(self%rows), spread(factor, 2, self%n)*self%rows)
  end function forms_penalty_curvature

  !> j'' where all rows penetrate: the largest one (n, n) [force/length].
  pure function forms_closed_curvature(self) result(curvature)
    class(forms_t), intent(in) :: self
    real(dp) :: curvature(self%n, self%n), scaled(size(self%rows, 1), self%n)
    scaled = spread(self%weight/self%theta, 2, self%n)*self%rows
    curvature = matmul(transpose(self%rows), scaled)
  end function forms_closed_curvature

  !> F_theta(u) of (19) [energy].
  pure real(dp) function forms_functional(self, u) result(f)
    class(forms_t), intent(in) :: self
    real(dp), intent(in) :: u(:)  !! Element of V_0 (n) [length].
    f = inner(self%a, u, u)/2 - dot_product(self%load, u) + self%penalty(u)
  end function forms_functional

  !> F'_theta(u, .) (n) [force].
  pure function forms_slope(self, u) result(slope)
    class(forms_t), intent(in) :: self
    real(dp), intent(in) :: u(:)  !! Element of V_0 (n) [length].
    real(dp) :: slope(self%n)
    slope = matmul(self%a, u) - self%load + self%penalty_slope(u)
  end function forms_slope

  !> Nodal displacements of the bodies.
  subroutine forms_expand(self, u, solution)
    class(forms_t), intent(in) :: self
    real(dp), intent(in) :: u(:)  !! Element of V_0 (n) [length].
    type(body_solution_t), intent(out) :: solution(3)  !! (3).
    integer :: b
    do b = 1, 3
      associate (body => self%problem%body(b))
        allocate (solution(b)%displacement(3, body%mesh%n_nodes()))
        call body%constraint%expand(u(self%first(b) + 1:self%first(b + 1)), solution(b)%displacement, .true.)
      end associate
    end do
  end subroutine forms_expand

  !> The displacements of the program: of the last iterate of a scheme.
  subroutine forms_solve(self, scheme, theta, settings, u, state)
    class(forms_t), intent(inout) :: self
    class(scheme_t), intent(in) :: scheme  !! The scheme.
    real(dp), intent(in) :: theta(:)  !! Penalty parameters (n_rows) [length/pressure].
    type(solver_settings_t), intent(in) :: settings  !! Settings of the scheme.
    real(dp), intent(out) :: u(:)  !! Element of V_0 (n) [length].
    type(solver_state_t), intent(inout) :: state  !! The start where it has pressures; the last iterate on return.
    type(monitor_t) :: silent
    type(body_solution_t), allocatable :: solution(:)
    type(error_t), allocatable :: error
    integer :: b
    call self%qp%replace_theta(theta)
    call scheme%solve(self%qp, self%compliance, settings, silent, state, error)
    if (allocated(error)) error stop 'forms: scheme'
    call recover_bodies(self%problem, self%qp, self%compliance, state%pressure, state%alpha, .false., solution)
    do b = 1, 3
      call self%problem%body(b)%constraint%reduce(solution(b)%displacement, u(self%first(b) + 1:self%first(b + 1)))
    end do
  end subroutine forms_solve

  !> Give back all memory.
  subroutine forms_destroy(self)
    class(forms_t), intent(inout) :: self
    call self%compliance%destroy()
    self%problem = contact_problem_t()
    if (allocated(self%a)) deallocate (self%a, self%gram, self%rows, self%load)
  end subroutine forms_destroy
end module dense_forms
