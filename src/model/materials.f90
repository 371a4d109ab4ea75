!> Builds materials from the input.
module dotyk_model_materials
  use dotyk_base_error, only: error_t
  use dotyk_base_options, only: locking_ignore, material_isotropic, material_orthotropic
  use dotyk_elasticity_material, only: material_t
  use dotyk_input_case, only: material_input_t
  implicit none
  private
  public :: build_material

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
    if (locking /= locking_ignore .and. .not. allocated(error)) call material%project_dilatation()
  end subroutine build_material
end module dotyk_model_materials
