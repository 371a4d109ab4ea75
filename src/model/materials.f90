!> Builds materials from the input, turns them with their bodies, and decides whether linear elements are elevated to
!> order 2 against volumetric locking.
!>
!> Survey of materials whose constants are formulas: all integration points of a body are visited before it is
!> assembled.
!>
!> The survey finds constants that are not those of a stable material, and sets what is asked of a material as a whole:
!> those of an isotropic one with the least Young's modulus and the greatest ratio of bulk to shear modulus.
module dotyk_model_materials
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_stress, locking_auto, locking_ignore, material_isotropic, &
    material_orthotropic
  use dotyk_base_text, only: point_text, quoted, to_text
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_elasticity_part_sums, only: greatest_of_parts
  use dotyk_elasticity_shape_table, only: shape_table_pair_t
  use dotyk_elasticity_stiffness_tensor, only: material_axes, rotate_stiffness, rotate_strain
  use dotyk_input_case, only: case_t, material_input_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_hex8, element_kind, element_kind_t, element_quad4
  use dotyk_ranks_exchange, only: agree_on_error
  implicit none
  private
  public :: build_material, survey_material, turn_material, would_lock

  !> Bulk over shear modulus from which on linear triangles, tetrahedra, prisms and pyramids lock: Poisson's ratio 0.45
  !> [].
  real(dp), parameter :: linear_simplices_lock = 29.0_dp/3

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
    if (any(abs(given%expansion - given%expansion(1)) > 0)) material%expansion = rotate_strain(material%expansion, axes)
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

  !> Visit the elements of one material.
  subroutine survey_constants(mesh, analysis, number, projects, most_of_simplices, material, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    integer, intent(in) :: number  !! Number of the material in the body.
    logical, intent(in) :: projects  !! Whether dilatations may be projected.
    !> Ratio of bulk to shear modulus from which on linear triangles, tetrahedra, prisms and pyramids are refused [].
    real(dp), intent(in) :: most_of_simplices
    type(material_t), intent(inout) :: material  !! The material; its constants are set.
    type(error_t), allocatable, intent(out) :: error  !! Where a formula has no value, or the material is not stable.
    type(material_field_t) :: field
    type(shape_table_pair_t) :: tables
    type(element_kind_t) :: kind
    real(dp) :: found(2)
    logical :: is_simplex
    integer :: b, e
    call field%init(material, error)
    if (allocated(error)) return
    ! Greatest ratio of bulk to shear modulus, and greatest reciprocal of Young's modulus.
    found = 0
    do b = 1, size(mesh%block)
      if (mesh%block(b)%material /= number) cycle
      kind = element_kind(mesh%block(b)%kind)
      is_simplex = kind%order == 1 .and. .not. any(mesh%block(b)%kind == [element_hex8, element_quad4]) .and. &
                   analysis /= analysis_plane_stress
      call tables%init_stiffness(mesh%block(b)%kind, analysis, .true.)
      do e = 1, size(mesh%block(b)%node, 2)
        associate (x => mesh%x(:, mesh%block(b)%node(:, e)))
          if (tables%is_curved(x)) then
            call visit(tables%curved%shape, x)
          else
            call visit(tables%straight%shape, x)
          end if
        end associate
        if (allocated(error)) exit
      end do
      if (allocated(error)) then
        error%message = error%message//' (element '//to_text(mesh%block(b)%tag(e))//')'
        exit
      end if
    end do
    call field%destroy()
    if (.not. allocated(material%formulas%stiffness)) return
    call greatest_of_parts(mesh, found)
    if (allocated(error) .or. .not. all(found > 0)) return
    call set_reference(1/found(2), found(1), material)
    if (projects) call material%project_dilatation()

  contains

    !> Visit the integration points of an element.
    subroutine visit(shape, x)
      real(dp), intent(in) :: shape(:, :)  !! Shape functions at the points (n_nodes, n_points) [].
      real(dp), intent(in) :: x(:, :)  !! Nodes of the element (dim, n_nodes) [length].
      type(material_t) :: here
      real(dp) :: ratio
      integer :: q
      here%name = material%name
      do q = 1, size(shape, 2)
        associate (point => matmul(x, shape(:, q)))
          call field%whole_at(point, here, error)
          if (.not. allocated(error)) call here%check_plane(analysis, error)
          if (allocated(error)) return
          ratio = here%bulk_over_shear()
          if (is_simplex .and. ratio >= most_of_simplices) then
            call set_error(error, 'material '//quoted(material%name)//': it is nearly incompressible, K/G is '// &
                           to_text(ratio, 3)//' at '//point_text(point)//', where linear triangles, tetrahedra, '// &
                           'prisms and pyramids lock: use elements of order 2, quadrilaterals or hexahedra', &
                           exit_bad_input)
            return
          end if
          found = max(found, [ratio, 1/here%least_young])
        end associate
      end do
    end subroutine visit
  end subroutine survey_constants

  !> Make the constants of a material those of an isotropic one.
  pure subroutine set_reference(young, ratio, material)
    real(dp), intent(in) :: young  !! Young's modulus [pressure].
    real(dp), intent(in) :: ratio  !! Ratio of bulk to shear modulus [].
    type(material_t), intent(inout) :: material  !! The material.
    integer :: i
    material%isotropic = .true.
    material%least_young = young
    material%mu = young*(3*ratio + 1)/(9*ratio)
    material%lambda = (ratio - 2.0_dp/3)*material%mu
    material%stiffness = 0
    material%stiffness(1:3, 1:3) = material%lambda
    do i = 1, 3
      material%stiffness(i, i) = material%lambda + 2*material%mu
      material%stiffness(i + 3, i + 3) = material%mu
    end do
  end subroutine set_reference
end module dotyk_model_materials
