!> Reactions of supports: K u - f at the nodes where displacements are prescribed, in their directions.
!>
!> K u comes from the elements next to these nodes alone (`dotyk_elasticity_internal_force`); f has the loads and the
!> contact forces. At nodes in parts of bodies each rank finds the reactions of its own nodes.
module dotyk_elasticity_support_reaction
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, qp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_elasticity_dirichlet_lift, only: extract_elements
  use dotyk_elasticity_internal_force, only: internal_force
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: find_reactions

contains

  !> Forces of the supports on the body at its nodes; 0 at nodes without, and at those of other ranks.
  subroutine find_reactions(body, u, contact_node, contact_force, reaction, error)
    type(body_t), intent(in) :: body  !! The body.
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    integer, intent(in) :: contact_node(:)  !! Contact nodes (n_contact_nodes).
    real(dp), intent(in) :: contact_force(:, :)  !! Contact forces on them (dim, n_contact_nodes) [force].
    real(dp), allocatable, intent(out) :: reaction(:, :)  !! In global axes (dim, n_nodes) [force].
    !> Allocated where an element is inverted or the modulus field is not positive; assembly finds this first.
    type(error_t), allocatable, intent(out) :: error
    type(body_mesh_t) :: next_to
    logical, allocatable :: selected(:)
    real(dp) :: energy
    integer :: i
    allocate (reaction(size(u, 1), size(u, 2)), source=0.0_dp)
    selected = any(body%constraint%equation == held, dim=1)
    do i = 1, size(selected)
      if (selected(i)) selected(i) = body%mesh%is_own_node(i)
    end do
    if (.not. any(selected)) return
    call extract_elements(body%mesh, selected, next_to)
    call internal_force(next_to, body%analysis, body%material, real(u, qp), reaction, energy, error)
    if (allocated(error)) return
    call body%constraint%foundation%add_forces(body%mesh%x, body%analysis, u, reaction, energy)
    reaction = reaction - body%load
    reaction(:, contact_node) = reaction(:, contact_node) - contact_force
    do i = 1, size(selected)
      if (selected(i)) then
        call keep_prescribed(body%constraint, i, reaction(:, i))
      else
        reaction(:, i) = 0
      end if
    end do
  end subroutine find_reactions

  !> Keep the components of a force along prescribed displacements: along free ones it is the residual of the solution.
  pure subroutine keep_prescribed(constraint, node, force)
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes.
    integer, intent(in) :: node  !! The node.
    real(dp), intent(inout) :: force(:)  !! Force in global axes (dim) [force].
    associate (equation => constraint%equation(:, node), k => constraint%frame_of(node))
      if (k > 0) force = matmul(force, constraint%frame(:, :, k))
      where (equation /= held) force = 0
      if (k > 0) force = matmul(constraint%frame(:, :, k), force)
    end associate
  end subroutine keep_prescribed
end module dotyk_elasticity_support_reaction
