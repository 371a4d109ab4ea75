!> Forces K u of a displacement of a body: those of its elements (`dotyk_elasticity_internal_force`) and of its springs.
module dotyk_elasticity_body_force
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, qp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_internal_force, only: internal_force
  implicit none
  private
  public :: body_force

contains

  !> Forces on all nodes, those at supports included.
  subroutine body_force(body, u, force, energy, error)
    type(body_t), intent(in) :: body  !! The body.
    real(qp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    real(dp), intent(out) :: force(:, :)  !! Forces in global axes (dim, n_nodes) [force].
    real(dp), intent(out) :: energy  !! Twice the energy, u.K u [energy].
    !> Allocated where an element is inverted or the modulus field is not positive; assembly finds this first.
    type(error_t), allocatable, intent(out) :: error
    call internal_force(body%mesh, body%analysis, body%material, u, force, energy, error)
    if (allocated(error) .or. body%constraint%foundation%n == 0) return
    call body%constraint%foundation%add_forces(body%mesh%x, body%analysis, real(u, dp), force, energy)
  end subroutine body_force
end module dotyk_elasticity_body_force
