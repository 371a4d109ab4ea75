!> A body whose nodes are numbered along a Morton curve: matrices by rows find the vectors that they multiply in the
!> caches then.
module dotyk_elasticity_spatial_order
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element_ordering, only: morton_order
  implicit none
  private
  public :: order_nodes

contains

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
end module dotyk_elasticity_spatial_order
