!> Where on a body a load or a support acts: on a surface, an edge or nodes, which physical groups or positions name.
module dotyk_base_place
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: point_text
  implicit none
  private

  type, public :: place_t  !! A place on a body.
    integer :: dimension = 2  !! Dimension of its elements: 0 nodes, 1 edges in space; of surfaces one less than space.
    !> Physical groups; with wildcards the union of those that the body has; empty for positions, or the whole body.
    character(:), allocatable :: name
    real(dp), allocatable :: at(:, :)  !! Positions of nodes, in place of groups (3, n) [length].
  contains
    procedure :: text => place_text
  end type place_t

contains

  !> Name for the log, the same for places that are the same.
  pure function place_text(self, space) result(text)
    class(place_t), intent(in) :: self
    integer, intent(in) :: space  !! Dimension of space.
    character(:), allocatable :: text
    integer :: i
    text = self%name
    if (allocated(self%at)) then
      text = 'node'
      do i = 1, size(self%at, 2)
        if (i > 1) text = text//','
        text = text//' '//point_text(self%at(:space, i))
      end do
    else if (self%dimension == 0) then
      text = 'nodes '//text
    else if (self%dimension < space - 1) then
      text = 'edge '//text
    end if
  end function place_text
end module dotyk_base_place
