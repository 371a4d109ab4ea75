!> Builds materials from the input, turns them with their bodies, and decides whether linear elements are elevated to
!> order 2 against volumetric locking.
module dotyk_model_materials
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_stress, locking_auto, locking_ignore, material_isotropic, &
    material_orthotropic
  use dotyk_elasticity_constants_survey, only: survey_constants
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_stiffness_tensor, only: material_axes, rotate_stiffness, rotate_strain
  use dotyk_input_case, only: case_t, material_input_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_ranks_exchange, only: agree_on_error
  implicit none
  private
  public :: build_material, survey_material, turn_material, would_lock

  !> Bulk over shear modulus from which on linear triangles, tetrahedra, prisms and pyramids lock: Poisson's ratio 0.45
  !> [].
  real(dp), parameter, public :: linear_simplices_lock = 29.0_dp/3

contains

  !> Build one material.
  subroutine build_material(given, locking, material, error)
    type(material_input_t), intent(in) :: given  !! `&material`.
    integer, intent(in) :: locking  !! One of `locking_*`.
    type(material_t), intent(out) :: material  !! The material.
    type(error_t), allocatable, intent(out) :: error  !! Where the constants are not those of a stable material.
    real(dp) :: axes(3, 3)
    if (allocated(given%stiffness_formula)) then
      ! Until `survey_material` knows the constants.
      call material%init_isotropic(given%name, 1.0_dp, 0.25_dp, error)
    else
      call set_constants(given, material, error)
    end if
    if (len(given%young_formula) > 0) material%modulus_formula = given%young_formula
    if (allocated(error)) return
    if (locking /= locking_ignore) call material%project_dilatation()
    material%density = given%density
    material%expansion(1:3) = given%expansion
    associate (formulas => material%formulas)
      formulas%kind = given%kind
      formulas%constant = constants_of(given)
      if (allocated(given%stiffness_formula)) formulas%stiffness = given%stiffness_formula
      if (size(given%expansion_formula) > 0) formulas%expansion = given%expansion_formula
      if (len(given%density_formula) > 0) formulas%density = given%density_formula
    end associate
    ! Equal ones are the same in all axes, to the bit.
    if (all(abs(given%expansion - given%expansion(1)) <= 0) .and. .not. material%formulas%vary()) return
    call material_axes(given%axis_1, given%axis_2, axes, error)
    if (allocated(error)) return
    material%formulas%axes = axes
    if (any(abs(given%expansion - given%expansion(1)) > 0)) &
      material%expansion = rotate_strain(material%expansion, axes)
  end subroutine build_material

  !> Set constants that are numbers.
  subroutine set_constants(given, material, error)
    type(material_input_t), intent(in) :: given  !! `&material`.
    type(material_t), intent(out) :: material  !! The material.
    type(error_t), allocatable, intent(out) :: error  !! Where the constants are not those of a stable material.
    select case (given%kind)
    case (material_isotropic)
      call material%init_isotropic(given%name, given%young(1), given%poisson(1), error)
    case (material_orthotropic)
      call material%init_orthotropic(given%name, given%young, given%poisson, given%shear, given%axis_1, given%axis_2, &
                                     error)
    case default
      call material%init_anisotropic(given%name, given%stiffness, given%axis_1, given%axis_2, error)
    end select
  end subroutine set_constants

  !> Constants of the elasticity matrix: isotropic: Young's modulus, Poisson's ratio; orthotropic: three Young's moduli,
  !> Poisson's ratios and shear moduli; else the 21 of the stiffness (21) [pressure] or [].
  pure function constants_of(given) result(constant)
    type(material_input_t), intent(in) :: given  !! `&material`.
    real(dp) :: constant(21)
    constant = 0
    select case (given%kind)
    case (material_isotropic)
      constant(:2) = [given%young(1), given%poisson(1)]
    case (material_orthotropic)
      constant(:9) = [given%young, given%poisson, given%shear]
    case default
      constant = given%stiffness
    end select
  end function constants_of

  !> Visit the points of a material whose constants are formulas.
  subroutine survey_material(mesh, analysis, number, locking, material, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body, in their place.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    integer, intent(in) :: number  !! Number of the material in the body.
    integer, intent(in) :: locking  !! One of `locking_*`.
    type(material_t), intent(inout) :: material  !! The material; its constants are set.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the material is not stable at a point.
    if (.not. material%formulas%vary()) return
    call survey_constants(mesh, analysis, number, locking /= locking_ignore, &
                          merge(linear_simplices_lock, huge(1.0_dp), locking == locking_auto), material, error)
    ! Each rank has other elements of a body in parts.
    if (mesh%is_in_parts()) call agree_on_error(error)
  end subroutine survey_material

  !> Turn a material with its body.
  subroutine turn_material(rotation, material)
    real(dp), intent(in) :: rotation(3, 3)  !! The rotation (3, 3) [].
    type(material_t), intent(inout) :: material  !! The material, in global axes.
    material%formulas%axes = matmul(rotation, material%formulas%axes)
    ! An isotropic material that stands for formulas may have three expansions.
    if (.not. material%isotropic) material%stiffness = rotate_stiffness(material%stiffness, rotation)
    associate (expansion => material%expansion)
      if (any(abs(expansion - [expansion(1), expansion(1), expansion(1), 0.0_dp, 0.0_dp, 0.0_dp]) > 0)) &
        expansion = rotate_strain(expansion, rotation)
    end associate
  end subroutine turn_material

  !> Whether linear triangles, tetrahedra, prisms and pyramids would lock in a body: they are elevated to order 2.
  logical function would_lock(case, b) result(locks)
    type(case_t), intent(in) :: case  !! The case.
    integer, intent(in) :: b  !! Index of the body.
    type(material_t) :: material
    type(error_t), allocatable :: failed
    integer :: k
    locks = .false.
    if (case%solver%locking /= locking_auto .or. case%scene%analysis == analysis_plane_stress) return
    do k = 1, size(case%body(b)%material)
      ! Errors are reported where the body is built.
      call build_material(case%material(case%body(b)%material(k)), case%solver%locking, material, failed)
      if (.not. allocated(failed)) locks = locks .or. material%incompressibility >= linear_simplices_lock
    end do
  end function would_lock
end module dotyk_model_materials
