!> Constants of a material as formulas of the position: those of the elasticity matrix, the thermal expansion, the
!> density.
!>
!> Formulas are kept as texts, because a formula serves one thread at a time: `dotyk_elasticity_material_field` parses
!> them.
module dotyk_elasticity_material_formulas
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: material_isotropic, material_orthotropic
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t, to_text
  implicit none
  private

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

contains

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
end module dotyk_elasticity_material_formulas
