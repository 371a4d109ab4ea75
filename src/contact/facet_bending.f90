!> Gaps of facets: whether they have the part r of the gap that quadratic facets resemble only where they bend, and
!> linear ones never (gap_interpolation.f90).
!>
!> Quadratic facets with pressure at all of their vertices are bent by the contact: the gap has r. Facets with pressure
!> at vertices none of which a bent facet has are touched between bodies that hardly bend: it has not. Facets at the rim
!> of the contact, and those without pressure, keep what they have.
module dotyk_contact_facet_bending
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, n_element_kinds
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: bending_of_points, find_contact

  type, public :: bending_t  !! What the solutions of a pair have added to its gaps.
    real(dp), allocatable, private :: at_points(:)  !! Nothing yet where not allocated (n_points) [length].
  contains
    procedure :: update => bending_update
  end type bending_t

contains

  !> Decide anew, from a guess of the pressure the first time.
  subroutine bending_update(self, pair, surface_a, pressure, change)
    class(bending_t), intent(inout) :: self
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface (surface_a).
    real(dp), intent(in) :: pressure(:)  !! Pressures of its rows; only their signs count (n_rows) [pressure].
    real(dp), intent(out) :: change(:)  !! What is added to the gaps of the rows (n_rows) [length].
    real(dp), allocatable :: now(:), more(:)
    now = bending_of_points(pair, surface_a, pressure, self%at_points)
    more = now
    if (allocated(self%at_points)) more = now - self%at_points
    change = 0
    if (any(abs(more) > 0)) call pair%average%multiply(more, change)
    call move_alloc(now, self%at_points)
  end subroutine bending_update

  !> What is added to the gaps of the points of a pair [length].
  function bending_of_points(pair, surface_a, pressure, before) result(change)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface (surface_a).
    real(dp), intent(in) :: pressure(:)  !! Pressures of its rows; only their signs count (n_rows) [pressure].
    !> What the gaps have got; absent for a guess of the pressure: it shows what is bent, and no more (n_points)
    !> [length].
    real(dp), intent(in), optional :: before(:)
    real(dp) :: change(pair%n_points)  !! Changes of the gaps (n_points) [length].
    logical, allocatable :: is_bent(:), is_narrow(:), is_quadratic(:)
    type(corner_interpolation_t) :: corners
    type(element_kind_t) :: kind
    integer :: k
    change = 0
    if (present(before)) change = before
    allocate (is_quadratic(n_element_kinds))
    do k = 1, n_element_kinds
      kind = element_kind(k)
      is_quadratic(k) = kind%order > 1
    end do
    if (.not. any(is_quadratic(surface_a%kind))) return
    call find_contact(pair, surface_a, pressure, is_bent, is_narrow, corners)
    associate (n => pair%n_mortar_points)
      associate (quadratic => is_quadratic(surface_a%kind(pair%facet_a(:n))))
        where (is_bent .and. quadratic) change(:n) = pair%bend(:n)
        if (present(before)) then
          where (is_narrow .and. quadratic) change(:n) = -pair%curved(:n)
        end if
      end associate
    end associate
  end function bending_of_points

  !> Which points are on facets with pressure at all of their vertices, and which on facets with pressure at vertices
  !> none of which such a facet has; where the gaps are straight neither.
  subroutine find_contact(pair, surface_a, pressure, is_bent, is_narrow, corners)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface (surface_a).
    real(dp), intent(in) :: pressure(:)  !! As in `bending_of_points` (n_rows) [pressure].
    logical, allocatable, intent(out) :: is_bent(:)  !! Those on the former (n_mortar_points).
    logical, allocatable, intent(out) :: is_narrow(:)  !! Those on the latter (n_mortar_points).
    type(corner_interpolation_t), intent(out) :: corners  !! Of the points, unless the gaps are straight.
    logical, allocatable :: is_active(:), is_beside(:), at_node(:)
    integer :: i
    associate (n => pair%n_mortar_points, m => pair%n_mortar_rows)
      allocate (is_bent(n), is_narrow(n), source=.false.)
      if (.not. any(abs(pair%bend) > 0 .or. abs(pair%curved) > 0)) return
      call corners%init(surface_a, pair%facet_a(:n), pair%xi_a(:, :n), pair%sheet_b(:n))
      ! Vertices without a row have almost no area.
      allocate (is_active(0:corners%n), source=.true.)
      is_active(pair%row_corner) = pressure(:m) > 0
      is_bent = [(all(is_active(corners%corner(:, i))), i=1, n)]
      allocate (is_beside(0:corners%n), source=.false.)
      do i = 1, n
        if (is_bent(i)) is_beside(corners%corner(:, i)) = .true.
      end do
      ! At a sharp edge, such as the rim of a chamfer, the contact may be that of the other face.
      allocate (at_node(maxval(corners%corner_node)), source=.false.)
      at_node(pack(corners%corner_node, is_beside(1:))) = .true.
      is_beside(1:) = at_node(corners%corner_node)
      is_active = .false.
      is_active(pair%row_corner) = pressure(:m) > 0
      is_beside(0) = .false.
      do i = 1, n
        associate (corner => corners%corner(:, i))
          is_narrow(i) = any(is_active(corner)) .and. .not. any(is_active(corner) .and. is_beside(corner))
        end associate
      end do
    end associate
  end subroutine find_contact
end module dotyk_contact_facet_bending
