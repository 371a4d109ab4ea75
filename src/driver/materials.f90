!> From the input to materials.
module dotyk_driver_materials
  use dotyk_base_error, only: error_t
  use dotyk_base_formula, only: formula_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_input_case, only: material_input_t
  use dotyk_input_names, only: material_isotropic, material_orthotropic
  implicit none
  private
  public :: build_material, mean_young

contains

  !> One material.
  subroutine build_material(given, material, error)
    type(material_input_t), intent(in) :: given
    type(material_t), intent(out) :: material
    type(error_t), allocatable, intent(out) :: error
    select case (given%kind)
    case (material_isotropic)
      call material%init_isotropic(given%name, given%young(1), given%poisson(1), error)
    case (material_orthotropic)
      call material%init_orthotropic(given%name, given%young, given%poisson, given%shear, given%axis_1, given%axis_2, error)
    case default
      call material%init_anisotropic(given%name, given%stiffness, error)
    end select
    material%factor_text = given%young_formula
  end subroutine build_material

  !> Young's modulus of a body for `theta_relative`: the least 1/S_ii, times the mean of `young_formula` over the nodes [pressure].
  subroutine mean_young(body, young, error)
    type(body_t), intent(in) :: body
    real(dp), intent(out) :: young
    type(error_t), allocatable, intent(out) :: error
    type(formula_t) :: factor
    real(dp) :: x(3), total
    integer :: i
    young = body%material%compliance_young()
    if (.not. body%material%has_factor()) return
    call factor%init(body%material%factor_text, error)
    if (allocated(error)) return
    x = 0
    total = 0
    do i = 1, size(body%mesh%x, 2)
      x(:body%dimension) = body%mesh%x(:, i)
      total = total + factor%evaluate(x)
    end do
    young = young*total/size(body%mesh%x, 2)
    call factor%destroy()
  end subroutine mean_young
end module dotyk_driver_materials
