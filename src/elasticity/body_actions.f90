!> What acts on a body in one load case: loads, temperature and initial stress, and the values of prescribed
!> displacements. All else of a body is the same in all load cases.
module dotyk_elasticity_body_actions
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_elasticity_initial_state, only: initial_state_t
  use dotyk_elasticity_load_report, only: load_resultant_t
  use dotyk_elasticity_point_forces, only: point_forces_t
  implicit none
  private

  type, public :: body_actions_t  !! Components of `body_t` with the same names.
    !> Prescribed displacements along the nodal axes; zero where not allocated (dim, n_nodes) [length].
    real(dp), allocatable :: prescribed(:, :)
    real(dp) :: rigid_motion(6) = 0  !! Held motions of a rigid body, see `rigid_hold_t` (6) [length, radian].
    type(initial_state_t) :: initial  !! Temperature and initial stress.
    real(dp), allocatable :: load(:, :)  !! Nodal forces; zero where not allocated (dim, n_nodes) [force].
    type(point_forces_t) :: applied  !! Loads at quadrature points.
    !> Sums of the constant force densities of the materials; none where not allocated (3, n_materials) [force/volume].
    real(dp), allocatable :: density(:, :)
    type(load_resultant_t), allocatable :: resultant(:)  !! Resultants of the loads (n_loads).
    type(text_t), allocatable :: unresolved(:)  !! Warnings of formulas.
    !> Whether there are loads or given displacements at nodes that this rank does not hold.
    logical :: is_loaded_inside = .false.
  contains
    procedure :: is_idle => actions_is_idle
    procedure :: hold_nodes => actions_hold_nodes
    procedure :: carry => actions_carry
  end type body_actions_t

  public :: carry_resultants

contains

  !> Whether there are neither loads nor prescribed displacements.
  pure logical function actions_is_idle(self) result(is_idle)
    class(body_actions_t), intent(in) :: self
    is_idle = .not. (self%is_loaded_inside .or. allocated(self%prescribed) .or. allocated(self%load))
  end function actions_is_idle

  !> Keep what belongs to some nodes.
  pure subroutine actions_hold_nodes(self, node)
    class(body_actions_t), intent(inout) :: self
    integer, intent(in) :: node(:)  !! Numbers of the nodes in the whole body, ascending (n_held_nodes).
    self%is_loaded_inside = .not. self%is_idle()
    if (allocated(self%prescribed)) self%prescribed = self%prescribed(:, node)
    if (allocated(self%load)) self%load = self%load(:, node)
    call self%initial%hold_nodes(node)
  end subroutine actions_hold_nodes

  !> Put the actions into a parcel, or take them out.
  subroutine actions_carry(self, parcel)
    class(body_actions_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%prescribed)
    call parcel%carry_fixed(6, self%rigid_motion)
    call self%initial%carry(parcel)
    call parcel%carry(self%load)
    call self%applied%carry(parcel)
    call parcel%carry(self%density)
    call carry_resultants(parcel, self%resultant)
    call parcel%carry(self%unresolved)
    call parcel%carry(self%is_loaded_inside)
  end subroutine actions_carry

  !> Put resultants of loads into a parcel, or take them out.
  subroutine carry_resultants(parcel, resultant)
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    type(load_resultant_t), allocatable, intent(inout) :: resultant(:)  !! The resultants, if there are any (n_loads).
    logical :: has_loads
    integer :: n(1), i
    has_loads = allocated(resultant)
    if (has_loads) n = shape(resultant)
    call parcel%carry_shape(has_loads, n)
    if (has_loads .and. parcel%is_read) allocate (resultant(n(1)))
    if (.not. has_loads) return
    do i = 1, n(1)
      call resultant(i)%carry(parcel)
    end do
  end subroutine carry_resultants
end module dotyk_elasticity_body_actions
