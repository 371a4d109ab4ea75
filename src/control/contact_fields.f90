!> Contact as fields of the nodes: tractions on both surfaces, gaps and contact status on the slave surface.
module dotyk_control_contact_fields
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp
  use dotyk_contact_corner_interpolation, only: corner_interpolation_t
  use dotyk_contact_pair, only: contact_pair_t
  use dotyk_contact_pressure_projection, only: pressure_projection_t
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: contact_fields_t  !! Fields of one body.
    !> Traction of the contact pressure on the body; 0 off the contact surfaces (dim, n_nodes) [pressure].
    real(dp), allocatable :: traction(:, :)
    !> Gap after deformation at nodes of slave surfaces, the least one where a node has several; NaN elsewhere (n_nodes)
    !> [length].
    real(dp), allocatable :: gap(:)
    integer, allocatable :: status(:)  !! One of `status_*` (n_nodes).
  contains
    procedure :: init => fields_init
  end type contact_fields_t

  integer, parameter, public :: status_none = 0    !< no constraint: not on a slave surface, or without projection
  integer, parameter, public :: status_open = 1    !< inactive constraints
  integer, parameter, public :: status_active = 2  !< an active constraint at the node, or next to it on its facet edge

  public :: add_contact_fields

contains

  !> Fields of a body without contact.
  subroutine fields_init(self, dimension, n_nodes)
    class(contact_fields_t), intent(out) :: self
    integer, intent(in) :: dimension  !! Dimension of space.
    integer, intent(in) :: n_nodes  !! Number of nodes.
    allocate (self%traction(dimension, n_nodes), source=0.0_dp)
    allocate (self%gap(n_nodes), source=ieee_value(0.0_dp, ieee_quiet_nan))
    allocate (self%status(n_nodes), source=status_none)
  end subroutine fields_init

  !> Add gaps and contact status of one pair.
  subroutine add_contact_fields(pair, surface_a, projection, gap, active, of_a)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    type(surface_t), intent(in) :: surface_a  !! Its slave surface.
    type(pressure_projection_t), intent(in) :: projection  !! Its projection.
    real(dp), intent(in) :: gap(:)  !! Gaps of the rows after deformation (n_rows) [length].
    logical, intent(in) :: active(:)  !! Whether the rows are active (n_rows).
    type(contact_fields_t), intent(inout) :: of_a  !! Fields of body a, added to.
    type(corner_interpolation_t) :: mortar
    real(dp), allocatable :: total(:), sums(:)
    logical, allocatable :: is_active(:)
    integer :: i, j, q
    if (pair%n_mortar_rows > 0) then
      ! Corners of mortar rows have the numbers of the mortar points alone.
      call mortar%init(surface_a, pair%facet_a(:pair%n_mortar_points), pair%xi_a(:, :pair%n_mortar_points), &
                       pair%sheet_b(:pair%n_mortar_points))
      allocate (total(mortar%n), sums(mortar%n), source=0.0_dp)
      allocate (is_active(mortar%n), source=.false.)
      total(pair%row_corner) = 1
      sums(pair%row_corner) = gap(:pair%n_mortar_rows)
      is_active(pair%row_corner) = active(:pair%n_mortar_rows)
      call add_gaps(mortar, total, sums, is_active, of_a)
      deallocate (total, sums, is_active)
    end if
    if (pair%n_rows == pair%n_mortar_rows) return
    ! Points that are rows: means around the corners of their facets.
    associate (side => projection%side_a)
      allocate (total(side%n), sums(side%n), source=0.0_dp)
      allocate (is_active(side%n), source=.false.)
      do i = pair%n_mortar_rows + 1, pair%n_rows
        q = pair%n_mortar_points + i - pair%n_mortar_rows
        do j = 1, 4
          if (side%corner(j, q) == 0) cycle
          associate (corner => side%corner(j, q), weight => pair%row_weight(i)*side%shape(j, q))
            total(corner) = total(corner) + weight
            sums(corner) = sums(corner) + weight*gap(i)
            is_active(corner) = is_active(corner) .or. active(i)
          end associate
        end do
      end do
      call add_gaps(side, total, sums, is_active, of_a)
    end associate
  end subroutine add_contact_fields

  !> Add gaps and status of corners at the nodes of their facets.
  subroutine add_gaps(side, total, sums, is_active, field)
    type(corner_interpolation_t), intent(in) :: side  !! Interpolation on the slave side.
    !> Sums of the weights of the constraints of each corner; 0 where it has none (side%n) [any].
    real(dp), intent(in) :: total(:)
    real(dp), intent(in) :: sums(:)  !! Sums of weights times gaps (side%n) [length].
    logical, intent(in) :: is_active(:)  !! Whether a constraint of the corner is active (side%n).
    type(contact_fields_t), intent(inout) :: field  !! Added to.
    real(dp) :: gap
    integer :: i
    do i = 1, size(side%position)
      associate (from => side%from(1:side%n_from(i), i), node => side%node(side%position(i)))
        if (.not. all(total(from) > 0)) cycle
        gap = sum(sums(from)/total(from))/size(from)
        if (ieee_is_nan(field%gap(node))) field%gap(node) = gap
        field%gap(node) = min(field%gap(node), gap)
        field%status(node) = max(field%status(node), merge(status_active, status_open, any(is_active(from))))
      end associate
    end do
  end subroutine add_gaps
end module dotyk_control_contact_fields
