!> Linear elastic materials: isotropic, orthotropic with material axes, fully anisotropic.
!>
!> A stiffness matrix maps the strains xx yy zz yz xz xy (engineering shear) to the stresses in the same order: Hooke's
!> law, equation (2). A material owns no resource: copies are independent. Formulas of constants, thermal expansion,
!> density and of the modulus field are kept as texts, because a formula serves one thread at a time:
!> `dotyk_elasticity_material_field` parses them.
module dotyk_elasticity_material
  use dotyk_base_error, only: add_context, error_t, exit_bad_input, set_error
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_axisymmetric, analysis_names, analysis_plane_strain, analysis_plane_stress, &
    material_isotropic, material_orthotropic, option_name
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: quoted, text_t, to_text
  use dotyk_base_thresholds, only: given_rounding, same_number
  use dotyk_elasticity_stiffness_tensor, only: invert_stiffness, kelvin, material_axes, rotate_stiffness, &
    scale_components
  use dotyk_linalg_dense, only: symmetric_eigen
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private
  public :: least_compressible, weight_moduli, elements_of_material, mesh_of_material, nodes_of_material

  type, public :: material_formulas_t  !! The formulas of a material.
    integer :: kind = material_isotropic  !! One of `material_*`: which constants there are.
    !> Constants without formulas: isotropic: Young's modulus, Poisson's ratio; orthotropic: three Young's moduli,
    !> Poisson's ratios and shear moduli; else the 21 of the stiffness (21) [pressure] or [].
    real(dp) :: constant(21) = 0
    !> Formulas of these constants, empty where the number holds; not allocated where none has a formula
    !> (n_constants).
    type(text_t), allocatable :: stiffness(:)
    !> Formulas of the thermal expansion along the material axes, one or three; none where not allocated.
    type(text_t), allocatable :: expansion(:)
    character(:), allocatable :: density  !! Formula of the density; none where not allocated.
    !> Material axes as columns, in global axes (3, 3) [].
    real(dp) :: axes(3, 3) = reshape([1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 0.0_dp, 1.0_dp], [3, 3])
  contains
    procedure :: vary => material_formulas_vary
    procedure :: constant_name => material_formulas_constant_name
    procedure :: carry => material_formulas_carry
  end type material_formulas_t

  type, public :: material_t  !! A material.
    character(:), allocatable :: name  !! Name in the input.
    logical :: isotropic = .false.  !! Whether the material is isotropic: `lambda` and `mu` define it.
    real(dp) :: lambda = 0  !! Lame's first parameter of an isotropic material [pressure].
    real(dp) :: mu = 0  !! Lame's second parameter, the shear modulus, of an isotropic material [pressure].
    real(dp) :: stiffness(6, 6) = 0  !! Stiffness in global axes (6, 6) [pressure].
    real(dp) :: density = 0  !! Density; 0 where it is not given [mass/volume].
    real(dp) :: expansion(6) = 0  !! In global axes, as a strain xx yy zz yz xz xy, engineering shear [1/temperature].
    !> Formula in x, y, z of the modulus field, a factor on the stiffness; 1 everywhere where not allocated.
    character(:), allocatable :: modulus_formula
    !> Constants that are formulas, each by its own. Those above then are of an isotropic material as soft and as nearly
    !> incompressible as this one is anywhere (`dotyk_model_materials`).
    type(material_formulas_t) :: formulas
    !> Young's modulus of the softest material axis: the smallest modulus of an orthotropic material; the smallest
    !> 1/S_ii, i = 1..3, of the compliance S of an anisotropic one [pressure].
    real(dp) :: least_young = 0
    !> Ratio of bulk to shear modulus where the dilatation may be projected; 0 where it may not, see
    !> `project_dilatation` [].
    real(dp) :: incompressibility = 0
    real(dp) :: bulk = 0  !! Bulk modulus where the dilatation may be projected, else 0 [pressure].
  contains
    procedure :: init_isotropic => material_init_isotropic
    procedure :: init_orthotropic => material_init_orthotropic
    procedure :: init_anisotropic => material_init_anisotropic
    procedure :: plane_matrix => material_plane_matrix
    procedure :: check_plane => material_check_plane
    procedure :: has_modulus_field => material_has_modulus_field
    procedure :: bulk_modulus => material_bulk_modulus
    procedure :: bulk_over_shear => material_bulk_over_shear
    procedure :: project_dilatation => material_project_dilatation
    procedure :: split => material_split
    procedure :: carry => material_carry
  end type material_t

contains

  !> The material of a body with the greatest ratio of bulk to shear modulus.
  integer function least_compressible(material) result(worst)
    type(material_t), intent(in) :: material(:)  !! Its materials (n_materials).
    integer :: m
    worst = 1
    do m = 2, size(material)
      if (material(m)%bulk_over_shear() > material(worst)%bulk_over_shear()) worst = m
    end do
  end function least_compressible

  !> Integrals of the modulus field of one of several materials, made comparable with those of the first: times the
  !> ratio of the least Young's moduli.
  pure subroutine weight_moduli(material, own, integral)
    type(material_t), intent(in) :: material(:)  !! Materials of a body (n_materials).
    integer, intent(in) :: own  !! The one of these elements.
    real(dp), intent(inout) :: integral(:)  !! Integrals of its modulus field over the elements (n_elements) [volume].
    if (own > 1) integral = integral*(material(own)%least_young/material(1)%least_young)
  end subroutine weight_moduli

  !> Create an isotropic material.
  subroutine material_init_isotropic(self, name, young, poisson, error)
    class(material_t), intent(out) :: self
    character(*), intent(in) :: name  !! Name in the input.
    real(dp), intent(in) :: young  !! Young's modulus, > 0 [pressure].
    real(dp), intent(in) :: poisson  !! Poisson's ratio, between -1 and 0.5 [].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where a number is out of its range.
    integer :: i
    self%name = name
    self%isotropic = .true.
    if (.not. (young > 0 .and. young <= huge(young))) then
      call set_error(error, 'material '//quoted(name)//': young must be positive, not '//to_text(young), exit_bad_input)
      return
    end if
    if (.not. (poisson > -1 .and. poisson < 0.5_dp)) then
      call set_error(error, 'material '//quoted(name)//': poisson must lie between -1 and 0.5, not '// &
                     to_text(poisson), exit_bad_input)
      return
    end if
    self%least_young = young
    self%lambda = young*poisson/((1 + poisson)*(1 - 2*poisson))
    self%mu = young/(2*(1 + poisson))
    self%stiffness(1:3, 1:3) = self%lambda
    do i = 1, 3
      self%stiffness(i, i) = self%lambda + 2*self%mu
      self%stiffness(i + 3, i + 3) = self%mu
    end do
  end subroutine material_init_isotropic

  !> Create an orthotropic material.
  subroutine material_init_orthotropic(self, name, young, poisson, shear, axis_1, axis_2, error)
    class(material_t), intent(out) :: self
    character(*), intent(in) :: name  !! Name in the input.
    real(dp), intent(in) :: young(3)  !! Young's moduli along material axes 1, 2, 3 (3) [pressure].
    !> Poisson's ratios 12, 13, 23: ij is minus the strain along j per strain along i under tension along i (3) [].
    real(dp), intent(in) :: poisson(3)
    real(dp), intent(in) :: shear(3)  !! Shear moduli 12, 13, 23 (3) [pressure].
    real(dp), intent(in) :: axis_1(3)  !! Direction of axis 1, of any length (3) [].
    real(dp), intent(in) :: axis_2(3)  !! In the plane of axes 1 and 2; its component along axis 1 is removed (3) [].
    !> Allocated where a number is out of its range, the axes are parallel, or the stiffness is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: compliance(6, 6), axes(3, 3), stiffness(6, 6)
    integer :: i
    self%name = name
    if (.not. (all(young > 0) .and. all(shear > 0) .and. &
               all(young <= huge(1.0_dp)) .and. all(shear <= huge(1.0_dp)))) then
      call set_error(error, 'material '//quoted(name)//': all values of young and shear must be positive', &
                     exit_bad_input)
      return
    end if
    call material_axes(axis_1, axis_2, axes, error)
    if (allocated(error)) then
      call add_context(error, 'material '//quoted(name)//': ')
      return
    end if
    compliance = 0
    do i = 1, 3
      compliance(i, i) = 1/young(i)
    end do
    compliance(1, 2) = -poisson(1)/young(1)
    compliance(1, 3) = -poisson(2)/young(1)
    compliance(2, 3) = -poisson(3)/young(2)
    compliance(2, 1) = compliance(1, 2)
    compliance(3, 1) = compliance(1, 3)
    compliance(3, 2) = compliance(2, 3)
    compliance(4, 4) = 1/shear(3)
    compliance(5, 5) = 1/shear(2)
    compliance(6, 6) = 1/shear(1)
    call invert_stiffness(compliance, 1/kelvin, stiffness, error)
    if (allocated(error)) then
      call add_context(error, 'material '//quoted(name)//': ')
      return
    end if
    self%stiffness = rotate_stiffness(stiffness, axes)
    self%least_young = minval(young)
  end subroutine material_init_orthotropic

  !> Create a fully anisotropic material.
  subroutine material_init_anisotropic(self, name, upper, axis_1, axis_2, error)
    class(material_t), intent(out) :: self
    character(*), intent(in) :: name  !! Name in the input.
    !> Upper triangle of the stiffness by rows, order 11 22 33 23 13 12 of the material axes (21) [pressure].
    real(dp), intent(in) :: upper(21)
    real(dp), intent(in) :: axis_1(3)  !! Direction of axis 1, of any length (3) [].
    real(dp), intent(in) :: axis_2(3)  !! In the plane of axes 1 and 2; its component along axis 1 is removed (3) [].
    !> Allocated where a value is not finite, the axes are parallel, or the stiffness is not positive definite.
    type(error_t), allocatable, intent(out) :: error
    real(dp) :: values(6), vectors(6, 6), compliance(6, 6), axes(3, 3)
    integer :: i, j, k
    self%name = name
    k = 0
    do i = 1, 6
      do j = i, 6
        k = k + 1
        self%stiffness(i, j) = upper(k)
        self%stiffness(j, i) = upper(k)
      end do
    end do
    if (.not. all(abs(upper) <= huge(1.0_dp))) then
      call set_error(error, 'material '//quoted(name)//': all values of stiffness must be finite numbers', &
                     exit_bad_input)
      return
    end if
    call symmetric_eigen(scale_components(self%stiffness, kelvin), values, vectors, error)
    if (allocated(error)) return
    if (.not. minval(values) > given_rounding*maxval(abs(values))) then
      call refuse(name, minval(values), error)
      return
    end if
    call invert_stiffness(self%stiffness, kelvin, compliance, error)
    if (allocated(error)) return
    self%least_young = min(1/compliance(1, 1), 1/compliance(2, 2), 1/compliance(3, 3))
    call material_axes(axis_1, axis_2, axes, error)
    call add_context(error, 'material '//quoted(name)//': ')
    if (.not. allocated(error)) self%stiffness = rotate_stiffness(self%stiffness, axes)
  end subroutine material_init_anisotropic

  !> Create the error of a stiffness that is not positive definite.
  subroutine refuse(name, eigenvalue, error)
    character(*), intent(in) :: name  !! Name of the material.
    real(dp), intent(in) :: eigenvalue  !! Least eigenvalue of the stiffness [pressure].
    type(error_t), allocatable, intent(out) :: error  !! Allocated on return; names the material and the eigenvalue.
    call set_error(error, 'material '//quoted(name)//': the stiffness is not positive definite, '// &
                   'its least eigenvalue is '//to_text(eigenvalue), exit_bad_input)
  end subroutine refuse

  !> Matrix that maps the strains of an analysis to its stresses (6, 6) [pressure].
  !>
  !> The stiffness itself, except in plane stress, where the strains zz, yz, xz are eliminated by the condition that
  !> the stresses zz, yz, xz vanish (static condensation).
  pure function material_plane_matrix(self, analysis) result(matrix)
    class(material_t), intent(in) :: self
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp) :: matrix(6, 6)
    integer, parameter :: out_of_plane(3) = [3, 4, 5]
    integer :: k, s, i, j
    matrix = self%stiffness
    if (analysis /= analysis_plane_stress) return
    ! Eliminates one strain after the other: a Schur complement of a positive definite matrix.
    do k = 1, 3
      s = out_of_plane(k)
      do j = 1, 6
        if (j == s) cycle
        do i = 1, 6
          if (i /= s) matrix(i, j) = matrix(i, j) - matrix(i, s)*matrix(s, j)/matrix(s, s)
        end do
      end do
      matrix(s, :) = 0
      matrix(:, s) = 0
    end do
  end function material_plane_matrix

  !> Refuse a material whose strains in the plane make shear stresses out of it.
  !>
  !> Plane strain and axisymmetry assume that the displacement out of the plane is zero. It is where the stresses yz and
  !> xz do not depend on the strains xx, yy, xy (and zz, the hoop strain, in axisymmetry): where the plane is a plane of
  !> symmetry of the material. Elsewhere the equilibrium across the plane is violated, and the body is too stiff.
  subroutine material_check_plane(self, analysis, error)
    class(material_t), intent(in) :: self
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    !> Allocated where the assumption does not hold; names the material and the largest of the components.
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: in_plane(4) = [1, 2, 6, 3]  !! Strains in the plane; the last one in axisymmetry alone.
    character(2), parameter :: name(6) = ['xx', 'yy', 'zz', 'yz', 'xz', 'xy']
    integer :: n, place(2)
    if (self%isotropic .or. .not. any(analysis == [analysis_plane_strain, analysis_axisymmetric])) return
    n = merge(4, 3, analysis == analysis_axisymmetric)
    place = maxloc(abs(self%stiffness(4:5, in_plane(:n))))
    associate (coupling => self%stiffness(3 + place(1), in_plane(place(2))), largest => maxval(abs(self%stiffness)))
      if (.not. abs(coupling) > same_number*largest) return
      call set_error(error, 'material '//quoted(self%name)//': strains in the plane make shear stresses out of it '// &
                     '(stiffness '//name(3 + place(1))//' '//name(in_plane(place(2)))//' = '//to_text(coupling, 3)// &
                     '), but analysis='''//option_name(analysis_names, analysis)//''' assumes that nothing moves '// &
                     'across the plane: the plane must be one of symmetry of the material, such as that of two of '// &
                     'its axes; use analysis=''3d''', exit_bad_input)
    end associate
  end subroutine material_check_plane

  !> Bulk modulus: pressure over dilatation under hydrostatic pressure; 0 where the compliance does not exist
  !> [pressure].
  real(dp) function material_bulk_modulus(self) result(bulk)
    class(material_t), intent(in) :: self
    type(error_t), allocatable :: error
    real(dp) :: compliance(6, 6)
    if (self%isotropic) then
      bulk = self%lambda + 2*self%mu/3
    else
      call invert_stiffness(self%stiffness, kelvin, compliance, error)
      bulk = 0
      if (.not. allocated(error)) bulk = 1/sum(compliance(1:3, 1:3))
    end if
  end function material_bulk_modulus

  !> Ratio of bulk to shear modulus, the measure of near incompressibility [].
  !>
  !> The shear modulus of an anisotropic material is half the third of its five deviatoric stiffnesses: soft
  !> interlayers do not make it incompressible, nor stiff fibres compressible.
  real(dp) function material_bulk_over_shear(self) result(ratio)
    class(material_t), intent(in) :: self
    type(error_t), allocatable :: error
    real(dp) :: deviator(6, 6), values(6), vectors(6, 6)
    integer :: i
    if (self%isotropic) then
      ratio = self%bulk_modulus()/self%mu
      return
    end if
    deviator = 0
    do i = 1, 6
      deviator(i, i) = 1
    end do
    deviator(1:3, 1:3) = deviator(1:3, 1:3) - 1.0_dp/3
    ! Dilatation is no change of shape: its eigenvalue is 0, below all others.
    call symmetric_eigen(matmul(deviator, matmul(scale_components(self%stiffness, kelvin), deviator)), values, &
                         vectors, error)
    ratio = 0
    if (.not. allocated(error)) ratio = 2*self%bulk_modulus()/values(4)
  end function material_bulk_over_shear

  !> Allow the dilatation to be projected where the material is nearly incompressible.
  subroutine material_project_dilatation(self)
    class(material_t), intent(inout) :: self
    self%incompressibility = self%bulk_over_shear()
    self%bulk = self%bulk_modulus()
  end subroutine material_project_dilatation

  !> Split the material for projected dilatations: the first part acts on the strains, the second on the projected
  !> dilatation.
  subroutine material_split(self, analysis, kept, matrix, lambda, bulk)
    class(material_t), intent(in) :: self
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    real(dp), intent(in) :: kept  !! Ratio of bulk to shear modulus of the first part; the second has the rest [].
    real(dp), intent(out) :: matrix(6, 6)  !! First part: from strains to stresses (6, 6) [pressure].
    real(dp), intent(out) :: lambda  !! Lame's first parameter of the first part of an isotropic material [pressure].
    !> Bulk modulus of the second part; 0 for none, and in plane stress, where the thickness is free to change
    !> [pressure].
    real(dp), intent(out) :: bulk
    integer :: i
    matrix = self%plane_matrix(analysis)
    lambda = self%lambda
    bulk = 0
    if (.not. self%incompressibility > kept .or. analysis == analysis_plane_stress) return
    bulk = (1 - kept/self%incompressibility)*self%bulk
    if (self%isotropic) then
      lambda = (kept - 2.0_dp/3)*self%mu
      matrix(1:3, 1:3) = lambda
      do i = 1, 3
        matrix(i, i) = lambda + 2*self%mu
      end do
    else
      matrix(1:3, 1:3) = matrix(1:3, 1:3) - bulk
    end if
  end subroutine material_split

  !> Whether the stiffness, or the expansion, varies in space.
  pure logical function material_has_modulus_field(self) result(has)
    class(material_t), intent(in) :: self
    has = allocated(self%modulus_formula)
    if (has) has = len_trim(self%modulus_formula) > 0
    has = has .or. self%formulas%vary()
  end function material_has_modulus_field

  !> Put a material into a parcel, or take it out.
  subroutine material_carry(self, parcel)
    class(material_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%name)
    call parcel%carry(self%isotropic)
    call parcel%carry(self%lambda)
    call parcel%carry(self%mu)
    call parcel%carry_fixed(size(self%stiffness), self%stiffness)
    call parcel%carry(self%density)
    call parcel%carry_fixed(size(self%expansion), self%expansion)
    call parcel%carry(self%modulus_formula)
    call self%formulas%carry(parcel)
    call parcel%carry(self%least_young)
    call parcel%carry(self%incompressibility)
    call parcel%carry(self%bulk)
  end subroutine material_carry

  !> The elements of a material, counted through all blocks of the body (n).
  pure function elements_of_material(mesh, material) result(element)
    type(body_mesh_t), intent(in) :: mesh  !! Elements of the body.
    integer, intent(in) :: material  !! Number of the material.
    integer, allocatable :: element(:)
    integer :: b, e, before
    allocate (element(0))
    before = 0
    do b = 1, size(mesh%block)
      associate (n => size(mesh%block(b)%tag))
        if (mesh%block(b)%material == material) element = [element, [(before + e, e=1, n)]]
        before = before + n
      end associate
    end do
  end function elements_of_material

  !> Whether each node belongs to an element of a material (n_nodes).
  pure function nodes_of_material(mesh, material) result(has)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: material  !! Number of the material.
    logical, allocatable :: has(:)
    integer :: b, e
    allocate (has(mesh%n_nodes()), source=.false.)
    do b = 1, size(mesh%block)
      if (mesh%block(b)%material /= material) cycle
      do e = 1, size(mesh%block(b)%node, 2)
        has(mesh%block(b)%node(:, e)) = .true.
      end do
    end do
  end function nodes_of_material

  !> The elements of a material with all nodes of the body.
  function mesh_of_material(mesh, material) result(part)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: material  !! Number of the material.
    type(body_mesh_t) :: part
    integer :: b, n
    if (allocated(mesh%file)) part%file = mesh%file
    part%dimension = mesh%dimension
    part%order_elevated = mesh%order_elevated
    part%x = mesh%x
    part%node_tag = mesh%node_tag
    allocate (part%block(count(mesh%block%material == material)))
    n = 0
    do b = 1, size(mesh%block)
      if (mesh%block(b)%material /= material) cycle
      n = n + 1
      part%block(n) = mesh%block(b)
    end do
    if (.not. allocated(mesh%whole)) return
    part%whole = mesh%whole
    part%whole%own_element = mesh%whole%own_element(elements_of_material(mesh, material))
    part%whole%element = mesh%whole%element(elements_of_material(mesh, material))
    part%whole%n_of_block = pack(mesh%whole%n_of_block, mesh%block%material == material)
  end function mesh_of_material

  !> Whether elasticity matrix or expansion have constants by formulas, each by its own.
  pure logical function material_formulas_vary(self) result(vary)
    class(material_formulas_t), intent(in) :: self
    vary = allocated(self%stiffness) .or. allocated(self%expansion)
  end function material_formulas_vary

  !> Key of a constant in the input, as in "poisson_formula(2)".
  pure function material_formulas_constant_name(self, i) result(name)
    class(material_formulas_t), intent(in) :: self
    integer, intent(in) :: i  !! Index of the constant.
    character(:), allocatable :: name
    integer :: place
    place = i
    select case (self%kind)
    case (material_isotropic)
      place = 0
      name = trim(merge('young  ', 'poisson', i == 1))
    case (material_orthotropic)
      place = 1 + mod(i - 1, 3)
      if (i <= 3) then
        name = 'young'
      else if (i <= 6) then
        name = 'poisson'
      else
        name = 'shear'
      end if
    case default
      name = 'stiffness'
    end select
    if (len(self%stiffness(i)%s) > 0) name = name//'_formula'
    if (place > 0) name = name//'('//to_text(place)//')'
  end function material_formulas_constant_name

  !> Put the formulas into a parcel, or take them out.
  subroutine material_formulas_carry(self, parcel)
    class(material_formulas_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%kind)
    call parcel%carry_fixed(size(self%constant), self%constant)
    call parcel%carry(self%stiffness)
    call parcel%carry(self%expansion)
    call parcel%carry(self%density)
    call parcel%carry_fixed(size(self%axes), self%axes)
  end subroutine material_formulas_carry
end module dotyk_elasticity_material
