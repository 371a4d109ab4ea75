!> What strains and stresses a body before any displacement: a temperature, which expands it, and an initial stress.
module dotyk_elasticity_initial_state
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  implicit none
  private

  type, public :: initial_state_t  !! Fields at the nodes of a body; between them the shape functions interpolate.
    !> Temperature above that of the stress-free body; none where not allocated (n_nodes) [temperature].
    real(dp), allocatable :: temperature(:)
    real(dp) :: range(2) = 0  !! Its extremes over the whole body, for the log (2) [temperature].
    !> Initial stress in global axes, order xx yy zz yz xz xy; none where not allocated (6, n_nodes) [pressure].
    real(dp), allocatable :: stress(:, :)
  contains
    procedure :: is_set => initial_state_is_set
    procedure :: thermal_dilatation => initial_state_thermal_dilatation
    procedure :: hold_nodes => initial_state_hold_nodes
    procedure :: carry => initial_state_carry
  end type initial_state_t

contains

  !> Whether there is any of it.
  pure logical function initial_state_is_set(self) result(is_set)
    class(initial_state_t), intent(in) :: self
    is_set = allocated(self%temperature) .or. allocated(self%stress)
  end function initial_state_is_set

  !> Dilatation of the thermal expansion at the nodes, where there is a temperature (n_nodes) [].
  pure function initial_state_thermal_dilatation(self, expansion) result(dilatation)
    class(initial_state_t), intent(in) :: self
    !> Thermal expansion of the material, as a strain: xx yy zz first (6) [1/temperature].
    real(dp), intent(in) :: expansion(6)
    real(dp) :: dilatation(size(self%temperature))
    dilatation = sum(expansion(1:3))*self%temperature
  end function initial_state_thermal_dilatation

  !> Keep that of some nodes.
  pure subroutine initial_state_hold_nodes(self, node)
    class(initial_state_t), intent(inout) :: self
    integer, intent(in) :: node(:)  !! Numbers of the nodes, ascending (n_held_nodes).
    if (allocated(self%temperature)) self%temperature = self%temperature(node)
    if (allocated(self%stress)) self%stress = self%stress(:, node)
  end subroutine initial_state_hold_nodes

  !> Put the state into a parcel, or take it out.
  subroutine initial_state_carry(self, parcel)
    class(initial_state_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%temperature)
    call parcel%carry_fixed(2, self%range)
    call parcel%carry(self%stress)
  end subroutine initial_state_carry
end module dotyk_elasticity_initial_state
