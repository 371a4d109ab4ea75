!> Rigid body modes that the supports of a body leave free.
module dotyk_elasticity_free_modes
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_rigid_motion, only: find_free_rigid_modes
  implicit none
  private
  public :: free_rigid_modes

contains

  !> Number and description of the rigid body modes that the supports of a body leave free.
  subroutine free_rigid_modes(body, n_free, text)
    type(body_t), intent(in) :: body  !! The body; it need not be assembled.
    integer, intent(out) :: n_free  !! Number of independent modes, summed over the connected components of the body.
    character(:), allocatable, intent(out) :: text  !! Description of the modes; empty for none.
    call find_free_rigid_modes(body%mesh, body%analysis, body%constraint, n_free, text)
  end subroutine free_rigid_modes
end module dotyk_elasticity_free_modes
