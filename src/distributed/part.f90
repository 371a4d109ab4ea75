!> The part of a body that one rank holds (`hold_body`), with what belongs to its nodes: all elements
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

  type, public :: part_t  !! The part.
    integer :: body = 0  !! Index of the body.
    !> Own elements and those around them, samples of others, and all nodes on the boundary of the body.
    type(body_mesh_t) :: mesh
    type(constraint_t) :: constraint  !! Equations of the part, prescribed displacements and nodal axes.
    integer :: analysis = 0  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), allocatable :: material(:)  !! Materials (n_materials).
    !> Loads on the nodes in global axes; those of other ranks' nodes have no meaning (dim, n_nodes) [force].
    real(dp), allocatable :: load(:, :)
    !> Rigid body modes that the supports leave, in global axes, orthonormal over the body (dim, n_nodes, n_modes) [].
    real(dp), allocatable :: mode(:, :, :)
    integer, allocatable :: whole_node(:)  !! Node of the body of each node, ascending (n_nodes).
    logical, allocatable :: is_own(:)  !! Whether a node belongs to this rank (n_nodes).
    type(corner_space_t) :: space  !! Interpolation from the corners.
    integer, allocatable :: row(:)  !! Block row of each node in the matrix of all bodies, from 0 (n_nodes).
    integer, allocatable :: corner_row(:)  !! Block row of each corner in the coarse matrix, from 0 (space%n).
  contains
    procedure :: init => part_init
    procedure :: axes => part_axes
    procedure :: local_node => part_local_node
  end type part_t

contains

  !> Take the part of a body.
  subroutine part_init(self, b, body, mode)
    class(part_t), intent(out) :: self
    integer, intent(in) :: b  !! Index of the body.
    !> What this rank holds of it (`hold_body`); it need not be assembled.
    type(body_t), intent(in) :: body
    real(dp), intent(in) :: mode(:, :, :)  !! Its rigid body modes (dim, n_nodes, n_modes) [].
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
    integer, intent(in) :: node  !! The node.
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
    integer, intent(in) :: whole  !! Node of the body.
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
