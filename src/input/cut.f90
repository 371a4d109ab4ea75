!> The cut of a bolt through a body of the mesh, as plain data, a part of `dotyk_input_case`.
!>
!> Elements are not cut: those whose centre lies ahead of a plane make up one half of the body, the others the other
!> one; or those on both sides of a surface inside the body. The halves are two bodies; what the input says of the whole
!> holds for each of them.
module dotyk_input_cut
  use dotyk_base_kinds, only: dp
  use dotyk_base_rotation, only: rotation_matrix
  use dotyk_base_thresholds, only: rounding
  implicit none
  private

  type, public :: cut_input_t  !! Which half a body is of which whole.
    integer :: line = 0  !! Line of the `&bolt`; 0 for a body that is not cut.
    integer :: half = 0  !! Half: 1 behind the plane, 2 ahead of it, where its normal points to.
    character(:), allocatable :: whole  !! Name of the body that is cut.
    !> A point of the plane (3) [length], and its normal, of length 1 (3) []; of bodies in place.
    real(dp) :: point(3) = 0, normal(3) = 0
    character(:), allocatable :: surface  !! Surface inside the body; empty where a plane is given.
  contains
    procedure :: is_cut => cut_is_cut
    procedure :: same_as => cut_same_as
    procedure :: place_back => cut_place_back
  end type cut_input_t

  character(*), parameter, public :: cut_surface = '(cut)'  !! Name of the surface of a half at the cut.


contains

  !> Whether the body is a half.
  elemental logical function cut_is_cut(self) result(is_cut)
    class(cut_input_t), intent(in) :: self
    is_cut = self%line > 0
  end function cut_is_cut

  !> The plane in coordinates of the mesh, before the body is rotated and shifted to its place.
  pure function cut_place_back(self, at, axis, angle) result(back)
    class(cut_input_t), intent(in) :: self
    real(dp), intent(in) :: at(3)  !! Position of the origin of the mesh (3) [length].
    real(dp), intent(in) :: axis(3), angle  !! Axis of rotation (3) [], and angle [degrees].
    type(cut_input_t) :: back
    real(dp) :: rotation(3, 3)
    back = self
    back%point = self%point - at
    if (.not. abs(angle) > 0) return
    rotation = rotation_matrix(axis, angle)
    back%point = matmul(back%point, rotation)
    back%normal = matmul(self%normal, rotation)
  end function cut_place_back

  !> Whether two bodies of one volume are the same half of it; planes in coordinates of the mesh.
  pure logical function cut_same_as(self, other) result(same)
    class(cut_input_t), intent(in) :: self
    type(cut_input_t), intent(in) :: other  !! Of the other body.
    same = self%half == other%half
    if (.not. (same .and. self%is_cut())) return
    same = self%surface == other%surface .and. &
           norm2(self%normal - other%normal) <= rounding .and. &
           abs(dot_product(self%normal, self%point - other%point)) <= rounding*(norm2(self%point) + norm2(other%point))
  end function cut_same_as
end module dotyk_input_cut
