!> Types of analysis, and the map from displacement gradients to strains.
!>
!> Strains and stresses are six numbers in the order xx yy zz yz xz xy, with engineering shear strains. Plane and
!> axisymmetric analyses have two displacement components in the plane x, y. The axis of axisymmetric analyses is y, x
!> is the radius, and zz is the hoop direction. A gradient has one slot per spatial derivative; in axisymmetric
!> analyses a third slot holds N/r. A strain is the sum of the gradient slots k of the displacement components i whose
!> `strain_index(i, k)` names it: equation (1) of the paper (docs/theory.md).
!>
!> Volumes are areas times a unit thickness in plane analyses, and those of the full circumference, 2 pi r times the
!> area, in axisymmetric ones; forces and energies likewise.
module dotyk_elasticity_analysis
  use dotyk_base_kinds, only: dp
  use dotyk_base_options, only: analysis_3d, analysis_axisymmetric, analysis_plane_strain, analysis_plane_stress
  implicit none
  private

  !> Circumference over radius: the factor of volumes and areas in axisymmetric analyses.
  real(dp), parameter, public :: two_pi = 6.283185307179586477_dp

  public :: analysis_dimension, gradient_slots, strain_index

contains

  !> Number of displacement components and of coordinates, 2 or 3.
  pure integer function analysis_dimension(analysis) result(dimension)
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    dimension = merge(3, 2, analysis == analysis_3d)
  end function analysis_dimension

  !> Number of slots of a gradient.
  pure integer function gradient_slots(analysis) result(slots)
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    slots = merge(2, 3, analysis == analysis_plane_strain .or. analysis == analysis_plane_stress)
  end function gradient_slots

  !> Index of the strain to which a gradient slot of a displacement component contributes; 0 for none.
  pure integer function strain_index(analysis, component, slot) result(strain)
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    integer, intent(in) :: component  !! Displacement component, 1 to 3.
    integer, intent(in) :: slot  !! Gradient slot, 1 to 3.
    integer, parameter :: of_derivative(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])
    if (analysis == analysis_axisymmetric .and. slot == 3) then
      strain = merge(3, 0, component == 1)
    else
      strain = of_derivative(component, slot)
    end if
  end function strain_index
end module dotyk_elasticity_analysis
