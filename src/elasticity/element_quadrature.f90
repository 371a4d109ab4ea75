!> The quadrature points of one element after another: what stiffness, stresses and forces of the elements are integrated with.
module dotyk_elasticity_element_quadrature
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: to_text
  use dotyk_elasticity_analysis, only: gradient_slots, strain_index
  use dotyk_elasticity_projected_dilatation, only: max_projection_functions, n_projection_functions, projected_dilatations, &
    projection_functions, unprojected_bulk_ratio
  use dotyk_elasticity_shape_table, only: shape_table_t, map_element, shape_table_pair_t
  use dotyk_elasticity_vector_field, only: vector_field_t, point_text
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_modulus_field, only: apply_modulus_field, read_modulus_field
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> For the elements of one block of a body, and one thread (formulas and buffers are its own).
  type, public :: element_quadrature_t
    !> Numbers of nodes, displacement components, gradient slots, and functions that the dilatation is projected on.
    integer :: n = 0, dim = 0, slots = 0, n_functions = 0
    !> Strain of each component and slot, 0 for none (dim, slots).
    integer, allocatable :: strain(:, :)
    !> Stiffness of the material but for what projected dilatations get: from strains to stresses, and Lame's first parameter [pressure].
    real(dp) :: matrix(6, 6) = 0, lambda = 0
    !> Bulk modulus that the projected dilatation gets; 0 where none is projected [pressure].
    real(dp) :: bulk = 0
    !> Number of points of the element.
    integer :: n_points = 0
    !> Its nodes (n), and where they are (dim, n) [length].
    integer, allocatable :: node(:)
    real(dp), allocatable :: x(:, :)
    !> Gradients of the shape functions (n, slots, n_points), in the first places [1/length].
    real(dp), allocatable :: g(:)
    !> Weights, and weights times the factor on the stiffness: the first n_points [volume].
    real(dp), allocatable :: w(:), stiffness(:)
    !> Projected dilatations (n, dim, n_functions) where bulk > 0, for the points' stiffness.
    real(dp), allocatable :: dilatation(:)
    type(shape_table_pair_t), private :: tables
    type(vector_field_t), private :: factor
    real(dp), allocatable, private :: value(:)
  contains
    procedure :: init => element_points_init
    procedure :: move_to
    procedure :: destroy
  end type element_quadrature_t

  public :: inverted_element_error

contains

  !> Prepare for a block; `destroy` is to be called at the end.
  subroutine element_points_init(self, mesh, i_block, analysis, material, error)
    class(element_quadrature_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: i_block
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Allocated where the factor on the stiffness is no formula.
    type(error_t), allocatable, intent(out) :: error
    type(element_kind_t) :: kind
    integer :: i, s, most_points
    call read_modulus_field(material, self%factor, error)
    if (allocated(error)) return
    kind = element_kind(mesh%block(i_block)%kind)
    self%n = kind%n_nodes
    self%dim = mesh%dimension
    self%slots = gradient_slots(analysis)
    call material%split(analysis, unprojected_bulk_ratio(mesh%block(i_block)%kind, material%incompressibility), &
                        self%matrix, self%lambda, self%bulk)
    self%n_functions = n_projection_functions(mesh%block(i_block)%kind, self%dim)
    self%strain = reshape([((strain_index(analysis, i, s), i=1, self%dim), s=1, self%slots)], [self%dim, self%slots])
    call self%tables%init_stiffness(mesh%block(i_block)%kind, analysis, .not. self%factor%constant)
    most_points = max(self%tables%straight%n_points, self%tables%curved%n_points)
    allocate (self%node(self%n), self%x(self%dim, self%n), self%g(self%n*self%slots*most_points), self%w(most_points), &
              self%stiffness(most_points), self%value(most_points*max_projection_functions), &
              self%dilatation(self%n*self%dim*max_projection_functions))
  end subroutine element_points_init

  !> Go to an element of the block.
  subroutine move_to(self, mesh, i_block, e, error)
    class(element_quadrature_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh
    !> The block of `init`, and the element in it.
    integer, intent(in) :: i_block, e
    !> Allocated where the element is inverted, or the factor on the stiffness not positive.
    type(error_t), allocatable, intent(out) :: error
    self%node(:) = mesh%block(i_block)%node(:, e)
    self%x(:, :) = mesh%x(:, self%node)
    if (self%tables%is_curved(self%x)) then
      call evaluate(self%tables%curved)
    else
      call evaluate(self%tables%straight)
    end if

  contains

    subroutine evaluate(table)
      type(shape_table_t), intent(in) :: table
      real(dp) :: worst
      integer :: m
      m = table%n_points
      self%n_points = m
      call map_element(self%n, self%dim, self%slots, m, table%shape, table%gradient, table%weight, self%x, self%g, self%w, worst)
      if (.not. worst > 0) then
        call inverted_element_error(mesh, i_block, e, error)
        return
      end if
      self%stiffness(:m) = self%w(:m)
      if (.not. self%factor%constant) then
        call apply_modulus_field(self%factor, table%shape, self%x, mesh%block(i_block)%tag(e), self%stiffness(:m), error)
        if (allocated(error)) return
      end if
      if (.not. self%bulk > 0) return
      call projection_functions(self%n, self%dim, m, self%n_functions, table%shape, self%x, self%stiffness, self%value)
      call projected_dilatations(self%n, self%dim, self%slots, m, self%n_functions, self%g, self%stiffness, self%value, &
                                 self%dilatation)
    end subroutine evaluate
  end subroutine move_to

  !> Give the formula back.
  subroutine destroy(self)
    class(element_quadrature_t), intent(inout) :: self
    call self%factor%destroy()
  end subroutine destroy

  !> The error of an element that cannot be mapped.
  subroutine inverted_element_error(mesh, i_block, e, error)
    type(body_mesh_t), intent(in) :: mesh
    !> The block, and the element in it.
    integer, intent(in) :: i_block, e
    type(error_t), allocatable, intent(out) :: error
    type(element_kind_t) :: kind
    character(:), allocatable :: what
    kind = element_kind(mesh%block(i_block)%kind)
    what = ' is inverted or has no volume'
    if (mesh%dimension == 2) then
      if (any(mesh%x(1, mesh%block(i_block)%node(:, e)) < 0)) what = ' is inverted, or lies beyond the axis x = 0'
    end if
    !$omp critical (message)
    call set_error(error, 'element '//to_text(mesh%block(i_block)%tag(e))//' ('//trim(kind%name)//')'//what// &
      ' near '//point_text(mesh%x(:, mesh%block(i_block)%node(1, e))), exit_not_solvable)
    !$omp end critical (message)
  end subroutine inverted_element_error
end module dotyk_elasticity_element_quadrature
