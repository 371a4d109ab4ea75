!> A value at some nodes of a file, by their tags.
module dotyk_mesh_node_values
  use dotyk_base_kinds, only: dp, int64
  use dotyk_mesh_tag_map, only: growing_tag_map_t
  implicit none
  private

  type, public :: node_values_t  !! The values.
    type(growing_tag_map_t) :: node  !! Nodes that have one.
    !> Values by the indices of the nodes; the first `node%n` are in use (room) [any].
    real(dp), allocatable, private :: value(:)
  contains
    procedure :: set => node_values_set
    procedure :: find => node_values_find
  end type node_values_t

contains

  !> Set the value of a node.
  subroutine node_values_set(self, tag, value)
    class(node_values_t), intent(inout) :: self
    integer(int64), intent(in) :: tag  !! Tag of the node.
    real(dp), intent(in) :: value  !! The value [any].
    real(dp), allocatable :: larger(:)
    integer :: i
    call self%node%add(tag, i)
    if (.not. allocated(self%value)) allocate (self%value(32))
    if (i > size(self%value)) then
      allocate (larger(2*size(self%value)))
      larger(:size(self%value)) = self%value
      call move_alloc(larger, self%value)
    end if
    self%value(i) = value
  end subroutine node_values_set

  !> The value of a node.
  pure subroutine node_values_find(self, tag, value, found)
    class(node_values_t), intent(in) :: self
    integer(int64), intent(in) :: tag  !! Tag of the node.
    real(dp), intent(out) :: value  !! The value; 0 where it has none [any].
    logical, intent(out) :: found  !! Whether it has one.
    integer :: i
    value = 0
    i = 0
    if (self%node%n > 0) i = self%node%find(tag)
    found = i > 0
    if (found) value = self%value(i)
  end subroutine node_values_find
end module dotyk_mesh_node_values
