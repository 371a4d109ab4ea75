!> A body on the two levels of p-multigrid: its stiffness by block rows, and the body of linear elements on its corners
!> with the Galerkin matrix of the corner space.
!>
!> A body whose nodes are numbered along a Morton curve: matrices by rows find the vectors that they multiply in the
!> caches then.
module dotyk_elasticity_two_levels
  use dotyk_base_error, only: error_t, exit_not_solvable, set_error
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_elasticity_assembly, only: assemble_block_rows, corner_matrix_t, typical_stiffness
  use dotyk_elasticity_body, only: body_t, stiffness_t
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_corner_space, only: corner_space_t
  use dotyk_elasticity_material, only: least_compressible
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_sparsity_pattern, only: build_pattern
  use dotyk_linalg_block_rows, only: block_rows_t
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  use dotyk_mesh_element_ordering, only: morton_order
  implicit none
  private
  public :: is_linear, multigrid_obstacle, order_nodes

  type, public :: two_levels_t  !! Stiffness on two levels.
    type(constraint_t) :: constraint  !! Equations of the body and nodal axes, nodes in the order of the rows.
    type(block_rows_t) :: rows  !! Stiffness by block rows; held components have unit diagonal [force/length].
    type(corner_space_t) :: space  !! Interpolation from the corners.
    type(body_t) :: corner_body  !! The body of linear elements on the corners: mesh, supports at rest, no loads.
    !> Galerkin matrix P^T K P over its equations, with the graph of the corners; a large one is in `corner_rows`
    !> [force/length].
    type(stiffness_t) :: corner_stiffness
    !> Galerkin matrix of a large corner space by block rows; held components have the unit diagonal [force/length].
    type(block_rows_t) :: corner_rows
    real(dp) :: volume = 0  !! Volume [volume].
    real(dp) :: mean_modulus_factor = 1  !! Mean of the modulus field over the volume [].
  contains
    procedure :: assemble => two_levels_assemble
    procedure :: assemble_rows => two_levels_assemble_rows
    procedure :: corner_bytes => two_levels_corner_bytes
  end type two_levels_t

  !> Why a body cannot, or should not, be solved by p-multigrid.
  integer, parameter, public :: obstacle_none = 0            !< there is no obstacle
  integer, parameter, public :: obstacle_few_unknowns = 1    !< linear elements, and too few nodes for aggregates
  integer, parameter, public :: obstacle_incompressible = 2  !< nearly incompressible: iterations grow without bound
  integer, parameter, public :: obstacle_hinged = 3          !< pieces may turn freely, which factors find out alone


  !> Bulk over shear modulus above which the iterations are too many: Poisson's ratio 0.4989 [].
  real(dp), parameter :: most_bulk_over_shear = 450
  integer, parameter :: fewest_of_linear = 300  !! Equations of linear elements below which a factor costs nothing.

contains

  !> Whether something speaks against p-multigrid: one of the `obstacle_*` constants.
  integer function multigrid_obstacle(body) result(obstacle)
    type(body_t), intent(in) :: body  !! The body; it need not be assembled.
    obstacle = obstacle_none
    if (body%is_hinged) obstacle = obstacle_hinged
    if (is_linear(body%mesh) .and. body%n_unknowns() < fewest_of_linear) obstacle = obstacle_few_unknowns
    if (obstacle /= obstacle_none .or. body%analysis == analysis_plane_stress) return
    if (body%material(least_compressible(body%material))%bulk_over_shear() > most_bulk_over_shear) &
      obstacle = obstacle_incompressible
  end function multigrid_obstacle

  !> Whether all elements are linear: they have no lower degree.
  pure logical function is_linear(mesh)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the body.
    type(element_kind_t) :: kind
    integer :: b
    is_linear = .true.
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      if (kind%order > 1) is_linear = .false.
    end do
  end function is_linear

  !> Assemble both levels.
  subroutine two_levels_assemble(self, body, error, large)
    class(two_levels_t), intent(out) :: self
    type(body_t), intent(in) :: body  !! The body; it need not be assembled.
    !> Allocated where an element is inverted, the modulus field is not positive, or the elements do not conform.
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in), optional :: large  !! More equations are assembled by block rows; none if absent.
    type(body_mesh_t) :: mesh
    type(corner_matrix_t) :: corner_matrix
    integer, allocatable :: order(:)
    logical :: conforming, by_rows
    call order_nodes(body%mesh, body%constraint, mesh, self%constraint, order)
    call self%space%init(mesh, conforming)
    if (.not. conforming) then
      !$omp critical (message)
      call set_error(error, 'multigrid: the elements do not conform: a node has different corners in two elements', &
                     exit_not_solvable)
      !$omp end critical (message)
      return
    end if
    call make_corner_body(body, self%space, mesh, self%constraint, self%corner_body)
    corner_matrix%constraint = self%corner_body%constraint
    call make_pattern(body, mesh, self%rows, error)
    if (allocated(error)) return
    by_rows = .false.
    if (present(large)) by_rows = self%corner_body%constraint%n_equations > large
    call node_graph(self%corner_body%mesh, self%corner_stiffness%graph_start, self%corner_stiffness%graph_neighbour)
    if (by_rows) then
      call corner_matrix%rows%init(body%dimension, self%corner_stiffness%graph_start, &
                                   self%corner_stiffness%graph_neighbour, self%rows%scale)
      call self%corner_stiffness%forget_graph()
    else
      call build_pattern(body%dimension, corner_matrix%constraint%equation, self%corner_stiffness%graph_start, &
                         self%corner_stiffness%graph_neighbour, corner_matrix%positions, corner_matrix%matrix)
    end if
    call assemble_block_rows(mesh, body%analysis, body%material, self%constraint, self%space, self%rows, &
                             self%volume, self%mean_modulus_factor, error, corner_matrix)
    if (allocated(error)) return
    call move_matrix(corner_matrix%matrix, self%corner_stiffness%matrix)
    call corner_matrix%rows%move_to(self%corner_rows)
    self%corner_body%volume = self%volume
    self%corner_body%mean_modulus_factor = self%mean_modulus_factor
  end subroutine two_levels_assemble

  !> Assemble the block rows alone: the other level is the body itself, all of its displacements.
  subroutine two_levels_assemble_rows(self, body, error)
    class(two_levels_t), intent(out) :: self
    type(body_t), intent(in) :: body  !! The body; it need not be assembled.
    type(error_t), allocatable, intent(out) :: error  !! Where an element is inverted or the modulus not positive.
    type(body_mesh_t) :: mesh
    integer, allocatable :: order(:)
    call order_nodes(body%mesh, body%constraint, mesh, self%constraint, order)
    call self%space%init_all_nodes(order)
    call make_pattern(body, mesh, self%rows, error)
    if (allocated(error)) return
    call assemble_block_rows(mesh, body%analysis, body%material, self%constraint, self%space, self%rows, &
                             self%volume, self%mean_modulus_factor, error)
  end subroutine two_levels_assemble_rows

  !> Memory of the matrix of the corner space [bytes].
  pure integer(int64) function two_levels_corner_bytes(self) result(bytes)
    class(two_levels_t), intent(in) :: self
    bytes = self%corner_stiffness%matrix%bytes() + self%corner_rows%bytes()
  end function two_levels_corner_bytes

  !> Block rows of zeros.
  subroutine make_pattern(body, mesh, rows, error)
    type(body_t), intent(in) :: body  !! The body.
    type(body_mesh_t), intent(in) :: mesh  !! Its mesh, nodes in the order of the rows.
    type(block_rows_t), intent(inout) :: rows  !! The rows.
    !> Allocated where the first element is inverted, or the modulus field is no formula or not positive there.
    type(error_t), allocatable, intent(out) :: error
    integer(int64), allocatable :: start(:)
    integer, allocatable :: neighbour(:)
    real(dp) :: scale
    call typical_stiffness(mesh, body%analysis, body%material, scale, error)
    if (allocated(error)) return
    call node_graph(mesh, start, neighbour)
    call rows%init(body%dimension, start, neighbour, scale)
  end subroutine make_pattern

  !> The body of linear elements on the corners, without loads.
  subroutine make_corner_body(body, space, mesh, constraint, corner_body)
    type(body_t), intent(in) :: body  !! The body.
    type(corner_space_t), intent(in) :: space  !! Its corner space.
    type(body_mesh_t), intent(in) :: mesh  !! Its mesh, nodes in the order of the rows.
    type(constraint_t), intent(in) :: constraint  !! Its equations, nodes in the order of the rows.
    type(body_t), intent(out) :: corner_body  !! The body of the corners.
    corner_body%name = ''
    if (allocated(body%name)) corner_body%name = body%name
    corner_body%analysis = body%analysis
    corner_body%dimension = body%dimension
    corner_body%material = body%material
    call space%make_mesh(mesh, corner_body%mesh)
    call space%make_constraint(constraint, corner_body%constraint)
    allocate (corner_body%load(body%dimension, space%n), source=0.0_dp)
  end subroutine make_corner_body

  !> Move a matrix.
  subroutine move_matrix(from, to)
    type(sparse_symmetric_t), intent(inout) :: from  !! The matrix; without arrays on return.
    type(sparse_symmetric_t), intent(inout) :: to  !! Gets its arrays.
    to%n = from%n
    call move_alloc(from%column_start, to%column_start)
    call move_alloc(from%row, to%row)
    call move_alloc(from%value, to%value)
  end subroutine move_matrix

  !> Number the nodes along the curve. Equations keep their numbers.
  subroutine order_nodes(mesh, constraint, ordered_mesh, ordered_constraint, order)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    type(body_mesh_t), intent(out) :: ordered_mesh  !! The mesh with its nodes in the new order.
    type(constraint_t), intent(out) :: ordered_constraint  !! The constraint with its nodes in the new order.
    integer, allocatable, intent(out) :: order(:)  !! Node of the body that each of them is (n_nodes).
    integer, allocatable :: number(:)
    integer :: i, e, b
    allocate (order(mesh%n_nodes()), number(mesh%n_nodes()))
    call morton_order(mesh%dimension, mesh%x, reshape([(i, i=1, size(order))], [1, size(order)]), order)
    number(order) = [(i, i=1, size(order))]
    if (allocated(mesh%file)) ordered_mesh%file = mesh%file
    ordered_mesh%dimension = mesh%dimension
    ordered_mesh%order_elevated = mesh%order_elevated
    ordered_mesh%x = mesh%x(:, order)
    ordered_mesh%node_tag = mesh%node_tag(order)
    allocate (ordered_mesh%block(size(mesh%block)))
    do b = 1, size(mesh%block)
      ordered_mesh%block(b)%kind = mesh%block(b)%kind
      ordered_mesh%block(b)%material = mesh%block(b)%material
      ordered_mesh%block(b)%tag = mesh%block(b)%tag
      allocate (ordered_mesh%block(b)%node, mold=mesh%block(b)%node)
      do e = 1, size(mesh%block(b)%node, 2)
        ordered_mesh%block(b)%node(:, e) = number(mesh%block(b)%node(:, e))
      end do
    end do
    ordered_constraint%n_equations = constraint%n_equations
    ordered_constraint%equation = constraint%equation(:, order)
    ordered_constraint%prescribed = constraint%prescribed(:, order)
    ordered_constraint%frame_of = constraint%frame_of(order)
    ordered_constraint%frame = constraint%frame
    ordered_constraint%foundation = constraint%foundation
    call ordered_constraint%foundation%renumber(number)
  end subroutine order_nodes
end module dotyk_elasticity_two_levels
