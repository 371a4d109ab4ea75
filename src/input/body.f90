!> `&body` as plain data, a part of `dotyk_input_case`.
module dotyk_input_body
  use dotyk_base_kinds, only: dp
  use dotyk_base_text, only: text_t
  use dotyk_input_cut, only: cut_input_t
  implicit none
  private

  type, public :: body_input_t  !! `&body`.
    integer :: line = 0  !! Line of the group.
    character(:), allocatable :: name  !! Name that other groups refer to.
    !> Physical group of its elements in the mesh; of several ones the name of their union: those of one material
    !> joined by `, `, materials by `; `.
    character(:), allocatable :: volume
    type(text_t), allocatable :: volumes(:)  !! The physical groups (n_volumes).
    integer, allocatable :: material_of(:)  !! Number of the material of each of them in `material` (n_volumes).
    integer, allocatable :: material(:)  !! Indices of its materials, each once; 0 for an unknown one (n_materials).
    character(:), allocatable :: mesh  !! Its mesh: its own, or that of the scene.
    real(dp) :: at(3) = 0  !! Position of the origin of its mesh (3) [length].
    !> Axis through the origin of the mesh about which the body is rotated first, as written (3) []; angle [degrees].
    real(dp) :: axis(3) = [0.0_dp, 0.0_dp, 1.0_dp], angle = 0
    logical :: crack = .false.  !! Whether faces of the body that touch without common nodes are a crack that is meant.
    !> Whether it has no volume: its groups are those of a surface, and it is rigid; whether a point is given that sees
    !> the side of contact of this surface.
    logical :: is_surface = .false., has_facing = .false.
    real(dp) :: facing(3) = 0  !! This point, in coordinates of the mesh (3) [length].
    type(cut_input_t) :: cut  !! Which half it is of a body that a bolt cuts.
  contains
    procedure :: has_shape_of => body_input_has_shape_of
  end type body_input_t

contains

  !> Whether two bodies of one mesh file are the same part of it.
  pure logical function body_input_has_shape_of(self, other) result(same)
    class(body_input_t), intent(in) :: self
    type(body_input_t), intent(in) :: other  !! The other body.
    type(cut_input_t) :: own_cut, other_cut
    same = self%volume == other%volume .and. (self%is_surface .eqv. other%is_surface) .and. &
           (self%has_facing .eqv. other%has_facing) .and. .not. any(abs(self%facing - other%facing) > 0)
    if (.not. same) return
    own_cut = self%cut%place_back(self%at, self%axis, self%angle)
    other_cut = other%cut%place_back(other%at, other%axis, other%angle)
    same = own_cut%same_as(other_cut)
  end function body_input_has_shape_of
end module dotyk_input_body
