!> Overlaps that are none: projections on the wrong side of a body.
module dotyk_contact_false_overlap
  use dotyk_base_kinds, only: dp
  use dotyk_contact_local_depth, only: leaves_body
  use dotyk_contact_projection, only: master_surface_t
  implicit none
  private
  public :: is_false_overlap

  !> A point lies as deep in a body as its boundary is near: a projection this many times farther away is another side.
  real(dp), parameter :: most_ratio = 3

contains

  !> Whether the overlap between a point of one surface and its projection on another is none: the way there leaves one
  !> of the bodies, or another face is much nearer.
  pure logical function is_false_overlap(surface, other, x, foot)
    type(master_surface_t), intent(in) :: surface  !! Surface of the point.
    type(master_surface_t), intent(in) :: other  !! The other surface.
    real(dp), intent(in) :: x(3)  !! The point (3) [length].
    real(dp), intent(in) :: foot(3)  !! Its projection (3) [length].
    real(dp) :: depth
    depth = norm2(foot - x)
    is_false_overlap = depth > most_ratio*other%smallest_distance(x)
    if (.not. is_false_overlap) is_false_overlap = depth > most_ratio*surface%smallest_distance(foot)
    if (.not. is_false_overlap) is_false_overlap = leaves_body(surface%tree, surface%set, x, foot)
    if (.not. is_false_overlap) is_false_overlap = leaves_body(other%tree, other%set, foot, x)
  end function is_false_overlap
end module dotyk_contact_false_overlap
