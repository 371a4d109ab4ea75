!> Survey of materials whose constants are formulas: all integration points of a body are visited before it is
!> assembled.
!>
!> The survey finds constants that are not those of a stable material, and sets what is asked of a material as a whole:
!> those of an isotropic one with the least Young's modulus and the greatest ratio of bulk to shear modulus.
module dotyk_elasticity_constants_survey
  use dotyk_base_error, only: error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_plane_stress
  use dotyk_base_text, only: quoted, to_text
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_elasticity_part_sums, only: greatest_of_parts
  use dotyk_elasticity_shape_table, only: shape_table_pair_t
  use dotyk_elasticity_vector_field, only: point_text
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_hex8, element_kind, element_kind_t, element_quad4
  implicit none
  private
  public :: survey_constants

contains

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
end module dotyk_elasticity_constants_survey
