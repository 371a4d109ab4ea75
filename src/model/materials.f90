!> Builds materials from the input, and turns them with their bodies.
module dotyk_model_materials
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: locking_ignore, material_isotropic, material_orthotropic
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_stiffness_tensor, only: material_axes, rotate_stiffness, rotate_strain
  use dotyk_input_case, only: material_input_t
  implicit none
  private
  public :: build_material, turn_material

contains

  !> Build one material.
  subroutine build_material(given, locking, material, error)
    !> `&material`.
    type(material_input_t), intent(in) :: given
    !> One of `locking_*`.
    integer, intent(in) :: locking
    !> The material.
    type(material_t), intent(out) :: material
    !> Allocated where the constants are not those of a stable material.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: axes(3, 3)
    select case (given%kind)
    case (material_isotropic)
      call material%init_isotropic(given%name, given%young(1), given%poisson(1), error)
    case (material_orthotropic)
      call material%init_orthotropic(given%name, given%young, given%poisson, given%shear, given%axis_1, given%axis_2, &
                                     error)
    case default
      call material%init_anisotropic(given%name, given%stiffness, given%axis_1, given%axis_2, error)
    end select
    if (len(given%young_formula) > 0) material%modulus_formula = given%young_formula
    if (allocated(error)) return
    if (locking /= locking_ignore) call material%project_dilatation()
    material%density = given%density
    material%expansion(1:3) = given%expansion
    ! Equal ones are the same in all axes, to the bit.
    if (all(abs(given%expansion - given%expansion(1)) <= 0)) return
    call material_axes(given%axis_1, given%axis_2, axes, error)
    if (.not. allocated(error)) material%expansion = rotate_strain(material%expansion, axes)
  end subroutine build_material

  !> Turn a material with its body.
  subroutine turn_material(rotation, material)
    !> The rotation (3, 3) [].
    real(dp), intent(in) :: rotation(3, 3)
    !> The material, in global axes.
    type(material_t), intent(inout) :: material
    if (material%isotropic) return
    material%stiffness = rotate_stiffness(material%stiffness, rotation)
    associate (expansion => material%expansion)
      if (any(abs(expansion - [expansion(1), expansion(1), expansion(1), 0.0_dp, 0.0_dp, 0.0_dp]) > 0)) &
        expansion = rotate_strain(expansion, rotation)
    end associate
  end subroutine turn_material
end module dotyk_model_materials
