!> The kinds of analysis, and what each makes of displacement gradients.
!>
!> Strains and stresses are six numbers in the order xx yy zz yz xz xy, with engineering shear strains. In plane and
!> axisymmetric analyses the displacement has two components in the plane x, y; axisymmetric ones turn about y, x is the
!> radius and zz the hoop direction. A gradient has one slot for each derivative, and a third one in axisymmetric
!> analyses for N/r: the strain is the sum of `gradient slot k of component i` over all (i, k) that name it.
module dotyk_elasticity_analysis
  use dotyk_base_options, only: analysis_3d, analysis_axisymmetric, analysis_plane_strain, analysis_plane_stress
  implicit none
  private

  public :: analysis_dimension, gradient_slots, strain_index

contains

  !> Number of displacement components, which is that of coordinates.
  pure integer function analysis_dimension(analysis) result(dimension)
    !> One of `analysis_*`.
    integer, intent(in) :: analysis
    dimension = merge(3, 2, analysis == analysis_3d)
  end function analysis_dimension

  !> Number of slots of a gradient.
  pure integer function gradient_slots(analysis) result(slots)
    !> One of `analysis_*`.
    integer, intent(in) :: analysis
    slots = merge(2, 3, analysis == analysis_plane_strain .or. analysis == analysis_plane_stress)
  end function gradient_slots

  !> The strain to which a slot of the gradient of a displacement component belongs, 0 for none.
  pure integer function strain_index(analysis, component, slot) result(strain)
    !> One of `analysis_*`.
    integer, intent(in) :: analysis
    !> Displacement component, 1 to 3.
    integer, intent(in) :: component
    !> Slot of the gradient, 1 to 3.
    integer, intent(in) :: slot
    integer, parameter :: of_derivative(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])
    if (analysis == analysis_axisymmetric .and. slot == 3) then
      strain = merge(3, 0, component == 1)
    else
      strain = of_derivative(component, slot)
    end if
  end function strain_index
end module dotyk_elasticity_analysis
