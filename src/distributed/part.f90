!> The part of a body that one rank holds (`dotyk_elasticity_held_body`), with what belongs to its nodes: all elements
!> of own nodes are there, so that rows of matrices of own nodes need no other rank.
module dotyk_distributed_part
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_corner_space, only: corner_space_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private

  !> The part.
  type, public :: part_t
    !> Index of the body.
    integer :: body = 0
    !> Own elements and those around them, samples of others, and all nodes on the boundary of the body.
    type(body_mesh_t) :: mesh
    !> Equations of the part, prescribed displacements and nodal axes.
    type(constraint_t) :: constraint
    !> Type of analysis: one of the `analysis_*` constants.
    integer :: analysis = 0
    !> Materials (n_materials).
    type(material_t), allocatable :: material(:)
    !> Loads on the nodes in global axes; those of other ranks' nodes have no meaning (dim, n_nodes) [force].
    real(dp), allocatable :: load(:, :)
    !> Rigid body modes that the supports leave, in global axes, orthonormal over the body (dim, n_nodes, n_modes) [].
    real(dp), allocatable :: mode(:, :, :)
    !> Node of the body of each node, ascending (n_nodes).
    integer, allocatable :: whole_node(:)
    !> Whether a node belongs to this rank (n_nodes).
    logical, allocatable :: is_own(:)
    !> Interpolation from the corners.
    type(corner_space_t) :: space
    !> Block row of each node in the matrix of all bodies, from 0 (n_nodes).
    integer, allocatable :: row(:)
    !> Block row of each corner in the coarse matrix, from 0 (space%n).
    integer, allocatable :: corner_row(:)
  contains
    procedure :: init => part_init
    procedure :: axes => part_axes
    procedure :: local_node => part_local_node
  end type part_t

contains

  !> Take the part of a body.
  subroutine part_init(self, b, body, mode)
    class(part_t), intent(out) :: self
    !> Index of the body.
    integer, intent(in) :: b
    !> What this rank holds of it (`dotyk_elasticity_held_body`); it need not be assembled.
    type(body_t), intent(in) :: body
    !> Its rigid body modes (dim, n_nodes, n_modes) [].
    real(dp), intent(in) :: mode(:, :, :)
    self%body = b
    self%analysis = body%analysis
    self%material = body%material
    self%mesh = body%mesh
    self%whole_node = body%mesh%whole%node
    self%is_own = body%mesh%whole%own_node
    deallocate (self%mesh%whole)
    self%constraint = body%constraint
    allocate (self%load(body%dimension, size(self%whole_node)), source=0.0_dp)
    if (allocated(body%load)) self%load(:, :) = body%load
    allocate (self%mode, source=mode)
  end subroutine part_init

  !> From displacements along the axes of a node to those along the global axes; held ones count as zero.
  pure function part_axes(self, node) result(axes)
    class(part_t), intent(in) :: self
    !> The node.
    integer, intent(in) :: node
    !> Global component, component of the node (dim, dim) [].
    real(dp) :: axes(self%mesh%dimension, self%mesh%dimension)
    integer :: i
    axes = 0
    do i = 1, size(axes, 1)
      axes(i, i) = 1
    end do
    if (self%constraint%frame_of(node) > 0) axes = self%constraint%frame(:, :, self%constraint%frame_of(node))
    do i = 1, size(axes, 1)
      if (self%constraint%equation(i, node) == held) axes(:, i) = 0
    end do
  end function part_axes

  !> The node of the part that is a node of the body; 0 if none is.
  pure integer function part_local_node(self, whole) result(node)
    class(part_t), intent(in) :: self
    !> Node of the body.
    integer, intent(in) :: whole
    integer :: low, high
    low = 1
    high = size(self%whole_node)
    do while (low < high)
      node = (low + high)/2
      if (self%whole_node(node) < whole) then
        low = node + 1
      else
        high = node
      end if
    end do
    node = 0
    if (low > size(self%whole_node)) return
    if (self%whole_node(low) == whole) node = low
  end function part_local_node
end module dotyk_distributed_part
