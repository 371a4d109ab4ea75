!> Numerical integration over elements: quadrature points, gradients and weights of one element after another, for
!> stiffness, stresses and internal forces.
module dotyk_elasticity_element_quadrature
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d
  use dotyk_base_text, only: point_text, to_text
  use dotyk_elasticity_analysis, only: gradient_slots, strain_index
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_elasticity_projected_dilatation, only: limit_projected_part, max_projection_functions, &
    n_projection_functions, &
    projected_dilatations, projection_functions, unprojected_bulk_ratio
  use dotyk_elasticity_shape_table, only: shape_table_t, map_element, shape_table_pair_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> Quadrature data of the elements of one block, for one thread: formulas and buffers are its own.
  type, public :: element_quadrature_t
    integer :: n = 0  !! Number of nodes of an element.
    integer :: dim = 0  !! Number of displacement components.
    integer :: slots = 0  !! Number of gradient slots.
    integer :: n_functions = 0  !! Number of projection functions of the dilatation.
    integer, allocatable :: strain(:, :)  !! Strain index of each component and slot, 0 for none (dim, slots).
    !> Unprojected part of the stiffness of the material: from strains to stresses; one matrix for all points, or one
    !> for each (6, 6, n_matrices) [pressure].
    real(dp), allocatable :: matrix(:, :, :)
    integer :: n_matrices = 1  !! Number of matrices: 1, or that of points where more than a factor varies.
    logical :: varies = .false.  !! Whether more than a factor varies in the material.
    !> Whether the body is isotropic and three-dimensional: `lambda` and `mu` are the stiffness then.
    logical :: is_isotropic = .false.
    real(dp) :: lambda = 0  !! Lame's first parameter of this part [pressure].
    real(dp) :: mu = 0  !! Shear modulus of an isotropic material [pressure].
    real(dp), allocatable :: expansion(:, :)  !! Thermal expansion xx yy zz yz xz xy (6, n_matrices) [1/temperature].
    !> Projected part of the bulk modulus by that in `bulk_weight`; 0 where no dilatation is projected [pressure].
    real(dp) :: bulk = 0
    integer :: n_points = 0  !! Number of quadrature points of the current element.
    integer, allocatable :: node(:)  !! Nodes of the current element (n).
    real(dp), allocatable :: x(:, :)  !! Positions of these nodes (dim, n) [length].
    !> Gradients of the shape functions, of shape (n, slots, n_points) in the first entries [1/length].
    real(dp), allocatable :: g(:)
    real(dp), allocatable :: w(:)  !! Quadrature weights, in the first n_points entries (n_allocated) [volume].
    real(dp), allocatable :: stiffness(:)  !! Weights times modulus field; n_points are used (n_allocated) [volume].
    !> Weights in which the projection functions are orthonormal: those of the stiffness, by the projected part of the
    !> bulk modulus where it varies beyond a factor; in the first n_points entries (n_allocated) [volume].
    real(dp), allocatable :: bulk_weight(:)
    !> Linear forms of the projected dilatation, of shape (n, dim, n_functions), where bulk > 0 [sqrt(volume)/length].
    real(dp), allocatable :: dilatation(:)
    type(shape_table_pair_t), private :: tables  !! Shape functions at the points of the rules.
    logical, private :: is_curved = .false.  !! Whether the current element takes the rule of curved ones.
    type(material_field_t), private :: field  !! The material in space.
    integer, private :: analysis = analysis_3d  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), allocatable, private :: value(:)  !! Of shape (n_points, n_functions) [1/sqrt(volume)].
  contains
    procedure :: init => element_quadrature_init
    procedure :: move_to => element_quadrature_move_to
    procedure :: at_points => element_quadrature_at_points
    procedure :: project => element_quadrature_project
    procedure :: pressure_integral => element_quadrature_pressure_integral
    procedure :: destroy => element_quadrature_destroy
  end type element_quadrature_t

  public :: inverted_element_error

contains

  !> Prepare for the elements of a block. `destroy` frees the formula.
  subroutine element_quadrature_init(self, mesh, i_block, analysis, material, error)
    class(element_quadrature_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a formula does not parse.
    type(element_kind_t) :: kind
    real(dp) :: matrix(6, 6), expansion(6)
    integer :: i, s, most_points
    associate (own => material(mesh%block(i_block)%material))
      call self%field%init(own, error)
      if (allocated(error)) return
      call own%split(analysis, unprojected_bulk_ratio(mesh%block(i_block)%kind, own%incompressibility), matrix, &
                     self%lambda, self%bulk)
      self%varies = self%field%varies
      self%analysis = analysis
      self%is_isotropic = own%isotropic .and. analysis == analysis_3d .and. .not. self%varies
      self%mu = own%mu
      expansion = own%expansion
    end associate
    kind = element_kind(mesh%block(i_block)%kind)
    self%n = kind%n_nodes
    self%dim = mesh%dimension
    self%slots = gradient_slots(analysis)
    self%n_functions = n_projection_functions(mesh%block(i_block)%kind, self%dim)
    self%strain = reshape([((strain_index(analysis, i, s), i=1, self%dim), s=1, self%slots)], [self%dim, self%slots])
    call self%tables%init_stiffness(mesh%block(i_block)%kind, analysis, .not. self%field%constant)
    most_points = max(self%tables%straight%n_points, self%tables%curved%n_points)
    allocate (self%node(self%n), self%x(self%dim, self%n), self%g(self%n*self%slots*most_points), self%w(most_points), &
              self%stiffness(most_points), self%bulk_weight(most_points), &
              self%value(most_points*max_projection_functions), &
              self%dilatation(self%n*self%dim*max_projection_functions))
    self%n_matrices = merge(most_points, 1, self%varies)
    allocate (self%matrix(6, 6, self%n_matrices), self%expansion(6, self%n_matrices))
    self%matrix = spread(matrix, 3, self%n_matrices)
    self%expansion = spread(expansion, 2, self%n_matrices)
  end subroutine element_quadrature_init

  !> Evaluate an element of the block.
  subroutine element_quadrature_move_to(self, mesh, i_block, e, error)
    class(element_quadrature_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the block given to `init`.
    integer, intent(in) :: e  !! Index of the element in its block.
    !> Allocated where the element is inverted, or the material is not stable at a quadrature point.
    type(error_t), allocatable, intent(out) :: error
    self%node(:) = mesh%block(i_block)%node(:, e)
    self%x(:, :) = mesh%x(:, self%node)
    self%is_curved = self%tables%is_curved(self%x)
    if (self%is_curved) then
      call evaluate(self%tables%curved)
    else
      call evaluate(self%tables%straight)
    end if

  contains

    !> Evaluate the element at the points of a rule.
    subroutine evaluate(table)
      type(shape_table_t), intent(in) :: table  !! Shape functions at the points of the rule.
      real(dp) :: worst
      integer :: m
      m = table%n_points
      self%n_points = m
      call map_element(self%n, self%dim, self%slots, m, table%shape, table%gradient, table%weight, self%x, self%g, &
                       self%w, worst)
      if (.not. worst > 0) then
        call inverted_element_error(mesh, i_block, e, error)
        return
      end if
      self%stiffness(:m) = self%w(:m)
      if (.not. self%field%constant) then
        ! Where it varies, the weights get the projected part of the bulk modulus first.
        call self%field%apply(self%analysis, mesh%block(i_block)%kind, table%shape, self%x, &
                              mesh%block(i_block)%tag(e), self%stiffness(:m), error, self%matrix, self%bulk_weight, &
                              self%expansion)
        if (allocated(error)) return
      end if
      if (self%varies) then
        self%n_matrices = m
        call limit_projected_part(m, self%bulk_weight, self%matrix)
        self%bulk = merge(1.0_dp, 0.0_dp, self%bulk_weight(1) > 0)
        if (self%bulk > 0) self%bulk_weight(:m) = self%stiffness(:m)/self%bulk_weight(:m)
      else
        self%bulk_weight(:m) = self%stiffness(:m)
      end if
      if (.not. self%bulk > 0) return
      call projection_functions(self%n, self%dim, m, self%n_functions, table%shape, self%x, self%bulk_weight, &
                                self%value)
      call projected_dilatations(self%n, self%dim, self%slots, m, self%n_functions, self%g, self%stiffness, &
                                 self%value, self%dilatation)
    end subroutine evaluate
  end subroutine element_quadrature_move_to

  !> Values at the quadrature points of the current element of a function that the shape functions interpolate
  !> (n_points) [unit of f].
  pure function element_quadrature_at_points(self, f) result(values)
    class(element_quadrature_t), intent(in) :: self
    real(dp), intent(in) :: f(:)  !! Values at the nodes of the body (n_nodes) [any].
    real(dp) :: values(self%n_points)
    if (self%is_curved) then
      values = matmul(f(self%node), self%tables%curved%shape)
    else
      values = matmul(f(self%node), self%tables%straight%shape)
    end if
  end function element_quadrature_at_points

  !> Coefficients of the projection of a dilatation on the projection functions of the current element, where bulk > 0
  !> (n_functions) [sqrt(volume)].
  pure function element_quadrature_project(self, f) result(amplitude)
    class(element_quadrature_t), intent(in) :: self
    real(dp), intent(in) :: f(:)  !! Dilatation at the quadrature points (n_points) [].
    real(dp) :: amplitude(self%n_functions)
    associate (m => self%n_points)
      amplitude = matmul(self%stiffness(:m)*f, reshape(self%value(:m*self%n_functions), [m, self%n_functions]))
    end associate
  end function element_quadrature_project

  !> Integral over the current element of the pressure with given coefficients of the projection functions, where
  !> bulk > 0 [pressure volume].
  pure real(dp) function element_quadrature_pressure_integral(self, amplitude) result(integral)
    class(element_quadrature_t), intent(in) :: self
    real(dp), intent(in) :: amplitude(:)  !! The coefficients (n_functions) [pressure sqrt(volume)].
    integer :: j
    associate (m => self%n_points)
      if (self%varies) then
        integral = 0
        do j = 1, self%n_functions
          integral = integral + amplitude(j)*sum(self%stiffness(:m)*self%value((j - 1)*m + 1:j*m))
        end do
      else
        ! Only the first function, a constant, has a mean.
        integral = amplitude(1)*sqrt(sum(self%stiffness(:m)))
      end if
    end associate
  end function element_quadrature_pressure_integral

  !> Free the formulas.
  subroutine element_quadrature_destroy(self)
    class(element_quadrature_t), intent(inout) :: self
    call self%field%destroy()
  end subroutine element_quadrature_destroy

  !> Create the error of an inverted element.
  subroutine inverted_element_error(mesh, i_block, e, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: i_block  !! Index of the element block.
    integer, intent(in) :: e  !! Index of the element in its block.
    type(error_t), allocatable, intent(out) :: error  !! Names the element, its kind and its position.
    type(element_kind_t) :: kind
    character(:), allocatable :: reason
    kind = element_kind(mesh%block(i_block)%kind)
    reason = ' is inverted or has no volume'
    if (mesh%dimension == 2) then
      if (any(mesh%x(1, mesh%block(i_block)%node(:, e)) < 0)) reason = ' is inverted, or lies beyond the axis x = 0'
    end if
    !$omp critical (message)
    call set_error(error, 'element '//to_text(mesh%block(i_block)%tag(e))//' ('//trim(kind%name)//')'//reason// &
                   ' near '//point_text(mesh%x(:, mesh%block(i_block)%node(1, e))), exit_not_solvable)
    !$omp end critical (message)
  end subroutine inverted_element_error
end module dotyk_elasticity_element_quadrature
