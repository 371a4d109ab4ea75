!> Gaps of facets that the contact bends: what gap_interpolation.f90 took off the gaps of quadratic facets, as bodies
!> that merely touch do not bend them, goes back where the contact turns out to span them.
module dotyk_contact_facet_bending
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: bending_of_points, bending_of_rows

contains

  !> What the gaps of the rows of a pair get back: weighted means of that of their points [length].
  function bending_of_rows(pair, surface_a, pressure) result(change)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface (surface_a).
    real(dp), intent(in) :: pressure(:)  !! Pressures of its rows (n_rows) [pressure].
    real(dp), allocatable :: change(:)  !! Changes of the gaps (n_rows) [length].
    allocate (change(pair%n_rows), source=0.0_dp)
    if (any(abs(pair%bend) > 0)) call pair%average%multiply(bending_of_points(pair, surface_a, pressure), change)
  end function bending_of_rows

  !> What the gaps of the points get back: on facets with pressure at all of their vertices [length].
  function bending_of_points(pair, surface_a, pressure) result(change)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface (surface_a).
    real(dp), intent(in) :: pressure(:)  !! Pressures of its rows (n_rows) [pressure].
    real(dp) :: change(pair%n_points)  !! Changes of the gaps (n_points) [length].
    type(corner_interpolation_t) :: corners
    logical, allocatable :: is_active(:)
    integer :: i
    change = 0
    if (.not. any(abs(pair%bend) > 0)) return
    associate (n => pair%n_mortar_points, m => pair%n_mortar_rows)
      call corners%init(surface_a, pair%facet_a(:n), pair%xi_a(:, :n), pair%sheet_b(:n))
      ! Vertices without a row have almost no area.
      allocate (is_active(0:corners%n), source=.true.)
      is_active(pair%row_corner) = pressure(:m) > 0
      do i = 1, n
        if (all(is_active(corners%corner(:, i)))) change(i) = pair%bend(i)
      end do
    end associate
  end function bending_of_points
end module dotyk_contact_facet_bending
