!> Contact forces where the surfaces do not touch: the contact is narrower than a facet, and its gap is uncertain.
!>
!> Quadratic facets keep the whole gap (gap_interpolation.f90), and the dual functions of a row are negative in places.
!> Where round bodies are the gap x^2/2R + c apart, the row of the vertex at x = 0 has the mean c - h^2/12R: for
!> 0 < c < h^2/12R it has a force although no point of its facets is in contact. Which of the two is right cannot be
!> told on this mesh: c is the uncertainty of the gap.
module dotyk_contact_doubtful_force
  use dotyk_base_kinds, only: dp
  use dotyk_contact_complementarity, only: gaps_under_pressure
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: find_doubtful_force

  type, public :: doubtful_force_t  !! Forces of a pair where its surfaces do not touch.
    character(:), allocatable :: pair  !! Name of the pair.
    real(dp) :: total = 0  !! Sum of the contact forces of all its rows [force].
    real(dp) :: share = 0  !! Fraction of them where the surfaces do not touch [].
    real(dp) :: force = 0  !! The greatest of these forces, on one row [force].
    real(dp), allocatable :: position(:)  !! Position of this row (dimension) [length].
    real(dp) :: width = 0  !! Length of the facets there [length].
    real(dp) :: gap = 0  !! Smallest gap of the deformed bodies there [length].
  end type doubtful_force_t

  !> Surfaces touch where their smallest gap is below this fraction of the greatest one under the same row: rounding of
  !> the integrals, and facets on which the contact ends.
  real(dp), parameter :: touching = 0.01_dp
  !> They touch, too, where it is below this fraction of the displacements of both: in a closed press fit all gaps are
  !> errors of the facets.
  real(dp), parameter :: closed = 1.0e-4_dp

contains

  !> Find the forces of mortar rows on quadratic facets that no point touches.
  subroutine find_doubtful_force(pair, surface_a, surface_b, u_a, u_b, pressure, row_theta, doubtful)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Slave surface (surface_a).
    type(surface_t), intent(in) :: surface_b  !! Master surface (surface_b).
    real(dp), intent(in) :: u_a(:, :)  !! Displacements of body a (dimension, n_nodes) [length].
    real(dp), intent(in) :: u_b(:, :)  !! Displacements of body b (dimension, n_nodes) [length].
    real(dp), intent(in) :: pressure(:)  !! Row pressures (n_rows) [pressure].
    real(dp), intent(in) :: row_theta(:)  !! Penalty parameters of the solution (n_rows) [length/pressure].
    type(doubtful_force_t), intent(out) :: doubtful  !! Forces; the share is 0 where there are none.
    real(dp), allocatable :: p(:), gap(:)
    real(dp) :: force, moved
    integer :: i, k
    doubtful%pair = pair%name
    allocate (doubtful%position(pair%dimension), source=0.0_dp)
    doubtful%total = sum(pair%row_weight*pressure)
    if (.not. any(pressure(:pair%n_mortar_rows) > 0) .or. .not. doubtful%total > 0) return
    call gaps_under_pressure(pair, surface_a, surface_b, u_a, u_b, pressure, row_theta, p, gap)
    moved = max(maxval(abs(u_a)), maxval(abs(u_b)))
    do i = 1, pair%n_mortar_rows
      force = pair%row_weight(i)*pressure(i)
      if (.not. force > 0) cycle
      associate (points => pair%average%column(pair%average%row_start(i):pair%average%row_start(i + 1) - 1))
        if (.not. minval(gap(points)) > max(touching*maxval(gap(points)), closed*moved)) cycle
        if (.not. any([(is_quadratic(surface_a%kind(pair%facet_a(points(k)))), k=1, size(points))])) cycle
        doubtful%share = doubtful%share + force/doubtful%total
        if (force <= doubtful%force) cycle
        doubtful%force = force
        doubtful%position = pair%row_position(:, i)
        doubtful%width = maxval([(norm2(pair%position(:, points(k)) - pair%row_position(:, i)), k=1, size(points))])
        doubtful%gap = minval(gap(points))
      end associate
    end do
  end subroutine find_doubtful_force

  !> Whether a facet has mid-side nodes.
  pure logical function is_quadratic(kind)
    integer, intent(in) :: kind  !! Element kind of the facet.
    type(element_kind_t) :: properties
    properties = element_kind(kind)
    is_quadratic = kind_nodes(kind) > properties%n_corners
  end function is_quadratic
end module dotyk_contact_doubtful_force
