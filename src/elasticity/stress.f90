!> Element stresses for output.
module dotyk_elasticity_stress
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_dilatation_fit, only: smooth_pressures
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_part, only: elements_of_material, mesh_of_material
  use dotyk_elasticity_node_constants, only: thermal_dilatation
  use dotyk_elasticity_stress_energy, only: stresses_and_energy
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: element_stress, von_mises

contains

  !> Mean stress of each element; nearly incompressible linear elements get a smoothed pressure, which does not
  !> alternate.
  subroutine element_stress(body, u, stress, energy)
    !> The body; assembled before, so that its elements and formulas are known to be valid.
    type(body_t), intent(in) :: body
    real(dp), intent(in) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    !> Stresses, order xx yy zz xy yz xz, elements in the order of the blocks (6, n_elements) [pressure].
    real(dp), intent(out) :: stress(:, :)
    !> Strain energy; of the own elements where the rank holds a part of the body [energy].
    real(dp), intent(out), optional :: energy
    type(error_t), allocatable :: error
    real(dp), allocatable :: factor(:), thermal(:)
    integer, allocatable :: own(:)
    real(dp) :: of_body, shear(3)
    integer :: e, m
    allocate (factor(size(stress, 2)))
    call stresses_and_energy(body%mesh, body%analysis, body%material, u, stress, of_body, error, factor, &
                             initial=body%initial)
    if (present(energy)) energy = of_body
    do m = 1, size(body%material)
      if (allocated(error)) exit
      if (allocated(body%initial%temperature)) &
        call thermal_dilatation(body%mesh, body%analysis, body%material(m), body%initial, thermal)
      if (size(body%material) == 1) then
        call smooth_pressures(body%mesh, body%analysis, body%material(m), u, factor, stress, thermal)
      else
        ! Pressures jump where materials meet.
        own = elements_of_material(body%mesh, m)
        if (size(own) > 0) call smooth_some(body%material(m), mesh_of_material(body%mesh, m))
      end if
    end do
    do e = 1, size(stress, 2)
      shear = stress(4:6, e)
      stress(4:6, e) = [shear(3), shear(1), shear(2)]
    end do

  contains

    !> Smooth the pressures in one of several materials.
    subroutine smooth_some(material, part)
      type(material_t), intent(in) :: material  !! The material.
      type(body_mesh_t), intent(in) :: part  !! Its elements.
      real(dp) :: of_part(6, size(own))
      of_part = stress(:, own)
      call smooth_pressures(part, body%analysis, material, u, factor(own), of_part, thermal)
      stress(:, own) = of_part
    end subroutine smooth_some
  end subroutine element_stress

  !> Equivalent stress of von Mises [pressure].
  pure real(dp) function von_mises(stress)
    real(dp), intent(in) :: stress(6)  !! Stresses xx yy zz and the three shear stresses in any order (6) [pressure].
    von_mises = sqrt(0.5_dp*((stress(1) - stress(2))**2 + (stress(2) - stress(3))**2 + (stress(3) - stress(1))**2) + &
                     3*(stress(4)**2 + stress(5)**2 + stress(6)**2))
  end function von_mises
end module dotyk_elasticity_stress
