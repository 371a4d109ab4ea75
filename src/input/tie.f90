!> Ties and bolts as plain data, a part of `dotyk_input_case`.
module dotyk_input_tie
  use dotyk_base_kinds, only: dp
  implicit none
  private

  type, public :: tie_input_t  !! `&tie` or `&bolt`.
    integer :: line = 0  !! Line of the group.
    !> Whether it is a bolt, pulled together along the normal of its surfaces: until it transmits `force`, or by
    !> `shortening`.
    logical :: is_bolt = .false., has_force = .false.
    !> Whether it is the cut of a body that a `&bolt` divides: the meshes of both sides are one, and `axis` is its
    !> normal where a plane is given.
    logical :: is_cut = .false.
    real(dp) :: force = 0  !! Tension [force].
    !> Load cases in which `force` acts; in those after them the bolt is locked; all cases where not allocated
    !> (n_cases).
    logical, allocatable :: in_case(:)
    real(dp) :: shortening = 0  !! Length that is taken out of the bolt [length].
    !> Rotation of the master side to the slave side, for cyclic symmetry: axis as written (3) [], and angle [degrees].
    real(dp) :: axis(3) = [0.0_dp, 0.0_dp, 1.0_dp], angle = 0
    real(dp) :: centre(3) = 0  !! A point on the axis (3) [length].
    character(:), allocatable :: name  !! Name of the tie.
    integer :: body_a = 0, body_b = 0  !! Indices of the bodies of the slave and of the master side.
    !> Physical groups of the surfaces; with wildcards, the union of those that the body has.
    character(:), allocatable :: surface_a, surface_b
    real(dp) :: search_radius = 0  !! Greatest distance that is tied; 0: half a facet [length].
  contains
    procedure :: exchange => tie_exchange
  end type tie_input_t

contains

  !> Exchange slave and master side; of ties without rotation.
  subroutine tie_exchange(self)
    class(tie_input_t), intent(inout) :: self
    character(:), allocatable :: surface
    integer :: body
    body = self%body_a
    self%body_a = self%body_b
    self%body_b = body
    call move_alloc(self%surface_a, surface)
    call move_alloc(self%surface_b, self%surface_a)
    call move_alloc(surface, self%surface_b)
  end subroutine tie_exchange
end module dotyk_input_tie
