!> The deepest point of one part below the boundary of another one.
module dotyk_contact_penetration
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  implicit none
  private

  type, public :: penetration_t  !! The deepest point of one part below the boundary of another that is not allowed.
    real(dp) :: depth = 0  !! Its depth; 0 where there is none [length].
    real(dp) :: position(3) = 0  !! Its position after deformation (3) [length].
    !> Nodes of the part that are too deep, and edges that are without a node so deep.
    integer :: n_nodes = 0, n_edges = 0
    integer :: n_passed = 0  !! Nodes that have passed through the other part and are outside again.
    !> The deepest point that is allowed for the bending of facets between contact rows: depth, 0 where there is
    !> none, and position after deformation (3) [length].
    real(dp) :: between_rows = 0, between_at(3) = 0
  contains
    procedure :: add => penetration_add
    procedure :: outweighs => penetration_outweighs
    procedure :: carry => penetration_carry
  end type penetration_t

  real(dp), parameter, public :: same_depth = 1.0e-9_dp  !! Depths that differ by less, relative to them, are the same.

contains

  !> Put it into a parcel, or take it out.
  subroutine penetration_carry(self, parcel)
    class(penetration_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%depth)
    call parcel%carry_fixed(size(self%position), self%position)
    call parcel%carry(self%n_nodes)
    call parcel%carry(self%n_edges)
    call parcel%carry(self%n_passed)
    call parcel%carry(self%between_rows)
    call parcel%carry_fixed(size(self%between_at), self%between_at)
  end subroutine penetration_carry

  !> Add the points of another one.
  pure subroutine penetration_add(self, other)
    class(penetration_t), intent(inout) :: self
    class(penetration_t), intent(in) :: other  !! The other one.
    self%n_nodes = self%n_nodes + other%n_nodes
    self%n_edges = self%n_edges + other%n_edges
    self%n_passed = self%n_passed + other%n_passed
    if (other%between_rows > (1 + same_depth)*self%between_rows) then
      self%between_rows = other%between_rows
      self%between_at = other%between_at
    end if
    if (.not. other%depth > (1 + same_depth)*self%depth) return
    self%depth = other%depth
    self%position = other%position
  end subroutine penetration_add

  !> Whether a penetration is deeper than another one, or as deep but for rounding, and with more nodes.
  pure logical function penetration_outweighs(self, other) result(outweighs)
    class(penetration_t), intent(in) :: self
    class(penetration_t), intent(in) :: other  !! The other one.
    outweighs = self%depth > (1 + same_depth)*other%depth
    if (outweighs .or. self%depth < (1 - same_depth)*other%depth) return
    outweighs = self%n_nodes + self%n_passed > other%n_nodes + other%n_passed
  end function penetration_outweighs
end module dotyk_contact_penetration
