!> Diagnosis of an ill-conditioned stiffness matrix: causes in the mesh and in the material.
!>
!> The condition number of a stiffness matrix grows like the square of the aspect ratio of its elements, and
!> proportionally to the ratio of the largest to the smallest stiffness: large Young's moduli beside small ones,
!> anisotropy, near incompressibility.
module dotyk_elasticity_conditioning_diagnosis
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_material_field, only: material_field_t
  use dotyk_elasticity_shape_table, only: map_element, shape_table_pair_t
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: diagnose_conditioning

  !> Aspect ratio from which on elements alone bring the condition number to 1e6 and more.
  real(dp), parameter :: max_aspect_ratio = 1.0e3_dp
  !> Ratio of stiffnesses from which on a material alone brings the condition number to 1e5 and more.
  real(dp), parameter :: max_stiffness_ratio = 1.0e5_dp

contains

  !> Describe the likely causes of ill-conditioning.
  subroutine diagnose_conditioning(mesh, analysis, material, text)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    character(:), allocatable, intent(out) :: text  !! The causes, separated by semicolons; empty where none is found.
    real(dp) :: aspect_ratio, ratio
    real(dp), dimension(size(material)) :: smallest_factor, largest_factor, young
    integer :: block, element, m
    text = ''
    call examine_elements(mesh, analysis, material, aspect_ratio, block, element, smallest_factor, largest_factor)
    !$omp critical (message)
    if (aspect_ratio > max_aspect_ratio) then
      call add('elements of aspect ratio '//to_text(aspect_ratio, 2)//', such as element '// &
               to_text(mesh%block(block)%tag(element)))
    end if
    do m = 1, size(material)
      if (largest_factor(m) > max_stiffness_ratio*smallest_factor(m)) then
        call add(trim(merge('constants of material    ', 'young_formula of material', &
                            material(m)%formulas%vary()))//' '//quoted(material(m)%name)//', with values from '// &
                 to_text(smallest_factor(m), 2)//' to '//to_text(largest_factor(m), 2))
      end if
      ratio = stiffness_ratio(material(m))
      if (ratio > max_stiffness_ratio .and. material(m)%isotropic) then
        call add('material '//quoted(material(m)%name)//', which is nearly incompressible')
      else if (ratio > max_stiffness_ratio) then
        call add('material '//quoted(material(m)%name)//', with a ratio of largest to smallest stiffness of '// &
                 to_text(ratio, 2))
      end if
    end do
    ! Where the modulus varies, its geometric middle stands for it.
    young = material%least_young*sqrt(smallest_factor*largest_factor)
    if (maxval(young) > max_stiffness_ratio*minval(young)) &
      call add('materials '//quoted(material(minloc(young, 1))%name)//' and '// &
               quoted(material(maxloc(young, 1))%name)//", with a ratio of Young's moduli of "// &
               to_text(maxval(young)/minval(young), 2))
    !$omp end critical (message)
  contains
    !> Append a cause to the text.
    subroutine add(cause)
      character(*), intent(in) :: cause  !! Description of the cause.
      if (len(text) > 0) text = text//'; '
      text = text//cause
    end subroutine add
  end subroutine diagnose_conditioning

  !> Ratio of the largest to the smallest eigenvalue of the stiffness of a material [].
  real(dp) function stiffness_ratio(material) result(ratio)
    type(material_t), intent(in) :: material  !! The material.
    type(error_t), allocatable :: error
    real(dp) :: values(6), vectors(6, 6)
    if (material%isotropic) then
      ratio = (3*material%lambda + 2*material%mu)/(2*material%mu)
      return
    end if
    call symmetric_eigen(material%stiffness, values, vectors, error)
    ratio = huge(ratio)
    if (.not. allocated(error)) ratio = values(6)/max(tiny(ratio), values(1))
  end function stiffness_ratio

  !> Find the largest aspect ratio of the elements and the range of the modulus field.
  subroutine examine_elements(mesh, analysis, material, aspect_ratio, block, element, smallest_factor, largest_factor)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    real(dp), intent(out) :: aspect_ratio  !! Largest ratio of diameter to height of the elements [].
    integer, intent(out) :: block  !! Index of the block of the element with this ratio.
    integer, intent(out) :: element  !! Index of this element in its block.
    !> Smallest value of the modulus field of each material at the quadrature points (n_materials) [].
    real(dp), intent(out) :: smallest_factor(:)
    !> Largest value of the modulus field of each material at the quadrature points (n_materials) [].
    real(dp), intent(out) :: largest_factor(:)
    type(material_field_t) :: field
    type(shape_table_pair_t) :: tables
    type(error_t), allocatable :: error
    type(element_kind_t) :: kind
    real(dp), allocatable :: x(:, :), g(:), w(:), factors(:)
    real(dp) :: worst, now
    integer :: i, e, m, n, dim, slots
    aspect_ratio = 1
    block = 1
    element = 1
    smallest_factor = huge(smallest_factor)
    largest_factor = 0
    dim = mesh%dimension
    slots = gradient_slots(analysis)
    do i = 1, size(mesh%block)
      m = mesh%block(i)%material
      call field%init(material(m), error)
      if (allocated(error)) return
      kind = element_kind(mesh%block(i)%kind)
      n = kind%n_nodes
      call tables%init_stiffness(mesh%block(i)%kind, analysis, .not. field%constant)
      associate (table => tables%straight)
        allocate (x(dim, n), g(n*slots*table%n_points), w(table%n_points))
        do e = 1, size(mesh%block(i)%node, 2)
          x(:, :) = mesh%x(:, mesh%block(i)%node(:, e))
          call map_element(n, dim, slots, table%n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
          if (.not. worst > 0) cycle
          now = aspect_ratio_of(n, dim, slots, x, g)
          if (now > aspect_ratio) then
            aspect_ratio = now
            block = i
            element = e
          end if
          factors = 0*w + 1
          if (.not. field%constant) then
            call field%apply(analysis, mesh%block(i)%kind, table%shape, x, mesh%block(i)%tag(e), factors, error)
          end if
          smallest_factor(m) = min(smallest_factor(m), minval(factors))
          largest_factor(m) = max(largest_factor(m), maxval(factors))
        end do
        deallocate (x, g, w)
      end associate
      call field%destroy()
    end do
  end subroutine examine_elements

  !> Aspect ratio of an element: diameter of its bounding box times the largest gradient of its shape functions, which
  !> is the reciprocal of its smallest height [].
  pure real(dp) function aspect_ratio_of(n, dim, slots, x, g) result(aspect_ratio)
    integer, intent(in) :: n  !! Number of nodes of the element.
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    integer, intent(in) :: slots  !! Number of gradient slots: `dim`, or 3 in axisymmetric analyses.
    real(dp), intent(in) :: x(dim, n)  !! Nodes (dim, n) [length].
    real(dp), intent(in) :: g(n, slots)  !! Gradients of the shape functions at the first quadrature point [1/length].
    integer :: a
    aspect_ratio = 0
    do a = 1, n
      aspect_ratio = max(aspect_ratio, norm2(g(a, :dim)))
    end do
    aspect_ratio = aspect_ratio*norm2(maxval(x, dim=2) - minval(x, dim=2))
  end function aspect_ratio_of
end module dotyk_elasticity_conditioning_diagnosis
