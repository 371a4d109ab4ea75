!> Forces of given displacements on the free unknowns, from the elements that touch them alone.
module dotyk_elasticity_dirichlet_lift
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_assembly, only: assemble_stiffness
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, build_pattern
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: subtract_dirichlet_lift

contains

  !> Subtract K_fc z from a right-hand side, of a body whose stiffness K is not assembled here.
  subroutine subtract_dirichlet_lift(mesh, analysis, material, constraint, rhs, error)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    type(constraint_t), intent(in) :: constraint
    !> (n_equations) [force].
    real(dp), intent(inout) :: rhs(:)
    !> As of `assemble_stiffness`.
    type(error_t), allocatable, intent(out) :: error
    type(body_mesh_t) :: part
    type(block_positions_t) :: places
    type(sparse_symmetric_t) :: stiffness
    integer, allocatable :: start(:), neighbour(:)
    real(dp) :: volume, mean_modulus_factor
    if (.not. any(abs(constraint%prescribed) > 0)) return
    call take_elements(mesh, any(abs(constraint%prescribed) > 0, dim=1), part)
    call node_graph(part, start, neighbour)
    call build_pattern(mesh%dimension, constraint%equation, start, neighbour, places, stiffness)
    call assemble_stiffness(part, analysis, material, constraint, places, stiffness, rhs, volume, mean_modulus_factor, error)
    call stiffness%destroy()
  end subroutine subtract_dirichlet_lift

  !> The elements that have some of the nodes.
  subroutine take_elements(mesh, wanted, part)
    type(body_mesh_t), intent(in) :: mesh
    !> Which nodes (n_nodes).
    logical, intent(in) :: wanted(:)
    !> With all nodes.
    type(body_mesh_t), intent(out) :: part
    type(element_block_t), allocatable :: block(:)
    integer, allocatable :: chosen(:)
    integer :: b, e, n
    part%dimension = mesh%dimension
    part%x = mesh%x
    allocate (block(size(mesh%block)))
    n = 0
    do b = 1, size(mesh%block)
      chosen = pack([(e, e=1, size(mesh%block(b)%tag))], &
                    [(any(wanted(mesh%block(b)%node(:, e))), e=1, size(mesh%block(b)%tag))])
      if (size(chosen) == 0) cycle
      n = n + 1
      block(n)%kind = mesh%block(b)%kind
      block(n)%node = mesh%block(b)%node(:, chosen)
      block(n)%tag = mesh%block(b)%tag(chosen)
    end do
    allocate (part%block(n))
    do b = 1, n
      part%block(b) = block(b)
    end do
  end subroutine take_elements
end module dotyk_elasticity_dirichlet_lift
