!> Why the stiffness of a body is ill-conditioned, as far as mesh and material tell.
module dotyk_elasticity_conditioning_diagnosis
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: quoted, to_text
  use dotyk_elasticity_analysis, only: gradient_slots
  use dotyk_elasticity_shape_table, only: map_element, shape_table_pair_t
  use dotyk_elasticity_vector_field, only: vector_field_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_modulus_field, only: apply_modulus_field, read_modulus_field
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: diagnose_conditioning

  !> Flatness of elements, and contrasts of stiffnesses, that cost digits by themselves: the condition grows like the square of the first.
  real(dp), parameter :: flat = 1.0e3_dp, contrast = 1.0e5_dp

contains

  !> The causes in words.
  subroutine diagnose_conditioning(mesh, analysis, material, text)
    type(body_mesh_t), intent(in) :: mesh
    !> One of dotyk_elasticity_analysis' constants.
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Empty where none is found.
    character(:), allocatable, intent(out) :: text
    real(dp) :: flatness, least, most, ratio
    integer :: block, element
    text = ''
    call look_at_elements(mesh, analysis, material, flatness, block, element, least, most)
    ratio = stiffness_ratio(material)
    !$omp critical (message)
    if (flatness > flat) call add('elements as flat as 1 : '//to_text(flatness, 2)//', such as '// &
                                  to_text(mesh%block(block)%tag(element)))
    if (most > contrast*least) call add('young_formula of material '//quoted(material%name)//', from '// &
                                        to_text(least, 2)//' to '//to_text(most, 2))
    if (ratio > contrast .and. material%isotropic) then
      call add('material '//quoted(material%name)//', which is nearly incompressible')
    else if (ratio > contrast) then
      call add('material '//quoted(material%name)//', whose stiffest and softest direction are as 1 : '//to_text(ratio, 2))
    end if
    !$omp end critical (message)
  contains
    subroutine add(cause)
      character(*), intent(in) :: cause
      if (len(text) > 0) text = text//'; '
      text = text//cause
    end subroutine add
  end subroutine diagnose_conditioning

  !> Largest over least eigenvalue of a material's stiffness.
  real(dp) function stiffness_ratio(material) result(ratio)
    type(material_t), intent(in) :: material
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

  !> The flattest element, and the range of the factor on the stiffness.
  subroutine look_at_elements(mesh, analysis, material, flatness, block, element, least, most)
    type(body_mesh_t), intent(in) :: mesh
    integer, intent(in) :: analysis
    type(material_t), intent(in) :: material
    !> Longest over shortest way across the element, and where: block, and element of the block.
    real(dp), intent(out) :: flatness
    integer, intent(out) :: block, element
    real(dp), intent(out) :: least, most
    type(vector_field_t) :: factor
    type(shape_table_pair_t) :: tables
    type(error_t), allocatable :: error
    type(element_kind_t) :: kind
    real(dp), allocatable :: x(:, :), g(:), w(:), factors(:)
    real(dp) :: worst, now
    integer :: i, e, n, dim, slots
    flatness = 1
    block = 1
    element = 1
    least = huge(least)
    most = 0
    call read_modulus_field(material, factor, error)
    if (allocated(error)) return
    dim = mesh%dimension
    slots = gradient_slots(analysis)
    do i = 1, size(mesh%block)
      kind = element_kind(mesh%block(i)%kind)
      n = kind%n_nodes
      call tables%init_stiffness(mesh%block(i)%kind, analysis, .not. factor%constant)
      associate (table => tables%straight)
        allocate (x(dim, n), g(n*slots*table%n_points), w(table%n_points))
        do e = 1, size(mesh%block(i)%node, 2)
          x(:, :) = mesh%x(:, mesh%block(i)%node(:, e))
          call map_element(n, dim, slots, table%n_points, table%shape, table%gradient, table%weight, x, g, w, worst)
          if (.not. worst > 0) cycle
          now = flatness_of(n, dim, slots, x, g)
          if (now > flatness) then
            flatness = now
            block = i
            element = e
          end if
          factors = 0*w + 1
          if (.not. factor%constant) call apply_modulus_field(factor, table%shape, x, mesh%block(i)%tag(e), factors, error)
          least = min(least, minval(factors))
          most = max(most, maxval(factors))
        end do
        deallocate (x, g, w)
      end associate
    end do
    call factor%destroy()
  end subroutine look_at_elements

  !> Longest extent of an element times its steepest gradient.
  pure real(dp) function flatness_of(n, dim, slots, x, g) result(flatness)
    integer, intent(in) :: n, dim, slots
    real(dp), intent(in) :: x(dim, n)
    !> At the first point [1/length].
    real(dp), intent(in) :: g(n, slots)
    integer :: a
    flatness = 0
    do a = 1, n
      flatness = max(flatness, norm2(g(a, :dim)))
    end do
    flatness = flatness*norm2(maxval(x, dim=2) - minval(x, dim=2))
  end function flatness_of
end module dotyk_elasticity_conditioning_diagnosis
