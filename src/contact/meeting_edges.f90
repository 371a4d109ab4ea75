!> Bodies that meet along parallel edges only, such as the ridges of two roofs: none of their faces lie opposite each
!> other.
module dotyk_contact_meeting_edges
  use dotyk_base_kinds, only: dp
  use dotyk_contact_body_faces, only: body_faces_t
  implicit none
  private
  public :: meet_along_edges

  !> Edges meet within this fraction of the diameter of the smaller body [].
  real(dp), parameter :: edge_distance = 1.0e-3_dp
  !> Cosine of the greatest angle between parallel edges: 5 degrees [].
  real(dp), parameter :: parallel_cosine = 0.9962_dp

contains

  !> Whether two facets in three dimensions meet along edges that are parallel, side by side at least in part.
  pure logical function meet_along_edges(a, f, b, g) result(meet)
    type(body_faces_t), intent(in) :: a  !! First body.
    integer, intent(in) :: f  !! Its facet.
    type(body_faces_t), intent(in) :: b  !! Second body.
    integer, intent(in) :: g  !! Its facet.
    real(dp), dimension(3) :: p, along, q, other
    real(dp) :: first, last, length, reach
    integer :: i, j
    meet = .false.
    reach = edge_distance*min(a%diameter, b%diameter)
    if (a%n_corners(f) < 3) return
    do i = 1, a%n_corners(f)
      p = a%corner(:, i, f)
      along = a%corner(:, modulo(i, a%n_corners(f)) + 1, f) - p
      length = norm2(along)
      do j = 1, b%n_corners(g)
        q = b%corner(:, j, g)
        other = b%corner(:, modulo(j, b%n_corners(g)) + 1, g) - q
        ! False for edges of no length, those of collapsed facets, too.
        if (.not. abs(dot_product(along, other)) > parallel_cosine*length*norm2(other)) cycle
        first = dot_product(q - p, along)/length
        last = dot_product(q + other - p, along)/length
        if (norm2(q - p - first/length*along) > reach .or. norm2(q + other - p - last/length*along) > reach) cycle
        meet = meet .or. min(max(first, last), length) - max(min(first, last), 0.0_dp) > reach
      end do
    end do
  end function meet_along_edges
end module dotyk_contact_meeting_edges
