!> Dirichlet lifting: the forces K_fc z of prescribed displacements z on the free unknowns, from the elements next to
!> them.
!>
!> For bodies whose stiffness matrix is not assembled, because a congruent body's factor serves them.
module dotyk_elasticity_dirichlet_lift
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_assembly, only: assemble_stiffness
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_node_graph, only: node_graph
  use dotyk_elasticity_sparsity_pattern, only: block_positions_t, build_pattern
  use dotyk_linalg_sparse, only: sparse_symmetric_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_mesh, only: element_block_t
  implicit none
  private
  public :: extract_elements, subtract_dirichlet_lift

contains

  !> Subtract K_fc z from a right-hand side.
  subroutine subtract_dirichlet_lift(mesh, analysis, material, constraint, rhs, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    type(constraint_t), intent(in) :: constraint  !! Equations, prescribed displacements and nodal axes of the body.
    real(dp), intent(inout) :: rhs(:)  !! Right-hand side over the free equations (n_equations) [force].
    !> Allocated where an element next to a prescribed displacement is inverted, or the modulus field is not positive.
    type(error_t), allocatable, intent(out) :: error
    type(body_mesh_t) :: submesh
    type(constraint_t) :: of_submesh
    type(block_positions_t) :: positions
    type(sparse_symmetric_t) :: stiffness
    integer(int64), allocatable :: start(:)
    integer, allocatable :: neighbour(:)
    real(dp) :: volume, mean_modulus_factor
    if (size(rhs) == 0 .or. .not. any(abs(constraint%prescribed) > 0)) return
    call extract_elements(mesh, any(abs(constraint%prescribed) > 0, dim=1), submesh)
    call node_graph(submesh, start, neighbour)
    call build_pattern(mesh%dimension, constraint%equation, start, neighbour, positions, stiffness)
    of_submesh = constraint
    call of_submesh%foundation%choose(any(abs(constraint%prescribed) > 0, dim=1))
    call assemble_stiffness(submesh, analysis, material, of_submesh, positions, stiffness, rhs, volume, &
                            mean_modulus_factor, error)
    call stiffness%destroy()
  end subroutine subtract_dirichlet_lift

  !> Extract the elements that have at least one of the selected nodes.
  subroutine extract_elements(mesh, selected, submesh)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    logical, intent(in) :: selected(:)  !! Whether a node is selected (n_nodes).
    type(body_mesh_t), intent(out) :: submesh  !! These elements, with all nodes of the body.
    type(element_block_t), allocatable :: block(:)
    integer, allocatable :: chosen(:)
    integer :: b, e, n
    submesh%dimension = mesh%dimension
    submesh%x = mesh%x
    allocate (block(size(mesh%block)))
    n = 0
    do b = 1, size(mesh%block)
      chosen = pack([(e, e=1, size(mesh%block(b)%tag))], &
                    [(any(selected(mesh%block(b)%node(:, e))), e=1, size(mesh%block(b)%tag))])
      if (size(chosen) == 0) cycle
      n = n + 1
      block(n)%kind = mesh%block(b)%kind
      block(n)%material = mesh%block(b)%material
      block(n)%node = mesh%block(b)%node(:, chosen)
      block(n)%tag = mesh%block(b)%tag(chosen)
    end do
    allocate (submesh%block(n))
    do b = 1, n
      submesh%block(b) = block(b)
    end do
  end subroutine extract_elements
end module dotyk_elasticity_dirichlet_lift
