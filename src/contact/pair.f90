!> One contact pair, discretized: integration points with their projections, and the rows of the contact operator.
!>
!> surface_a is the slave (non-mortar) side, which carries the integration points and the Lagrange multipliers;
!> surface_b is the master (mortar) side.
!>
!> Sign conventions: n points from body a into body b; d = n.(x' - x) is negative where the bodies overlap; a contact
!> pressure p >= 0 acts on body a as the traction -p n and on body b as p n.
!>
!> Resultants of pressures are those on body a. The forces of the rows are distributed to their integration points,
!> along the normals there. On body b they act at the projections x' of these points. As x' - x is parallel to the
!> normal (`dotyk_contact_projection`), force and moment on body b are the opposite ones.
module dotyk_contact_pair
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use dotyk_base_kinds, only: dp, int64
  use dotyk_base_options, only: default_discretization, default_gap, default_geometry, default_quadrature
  use dotyk_base_parcel, only: parcel_t
  use dotyk_linalg_sparse, only: sparse_rows_t
  use dotyk_mesh_facet, only: cross
  use dotyk_ranks_communication, only: n_ranks, this_rank
  use dotyk_ranks_division, only: division_t
  use dotyk_ranks_exchange, only: all_ranks, gather_all
  implicit none
  private
  public :: pair_force, share_pairs, pair_resultant

  type, public :: pair_resultant_t  !! Resultant on body a.
    real(dp) :: force(3) = 0  !! Force; along the axis in axisymmetric analyses (3) [force].
    real(dp) :: moment(3) = 0  !! Moment about the origin; 0 in axisymmetric analyses (3) [force length].
    !> Radial components in axisymmetric analyses, summed around the circumference: no resultant; 0 in others [force].
    real(dp) :: radial = 0
    !> Where the resultant acts: the point of its line of action that is nearest to the mean of the positions, weighted
    !> with the pressure; NaN where the pressures have no resultant force (3) [length].
    real(dp) :: centre(3) = 0
  end type pair_resultant_t

  !> Resultants below this fraction of the sum of the forces are what rounding and the tolerance of the solution leave.
  real(dp), parameter :: no_force = 1.0e-6_dp

  type, public :: pair_settings_t  !! Settings of a pair, from the input and for the search.
    character(:), allocatable :: name  !! Name of the pair.
    integer :: body_a = 0  !! Index of body a, the slave body.
    integer :: body_b = 0  !! Index of body b, the master body.
    logical :: axisymmetric = .false.  !! Weights include the circumference 2 pi r.
    integer :: gap_kind = default_gap  !! One of `gap_*`.
    real(dp) :: gap = 0  !! Given gap [length].
    !> Greatest distance of a projection; not positive: the size of the smaller body [length].
    real(dp) :: search_radius = 0
    real(dp) :: theta = 0  !! Penalty parameter [length/pressure].
    integer :: discretization = default_discretization  !! One of `discretization_*`.
    integer :: geometry = default_geometry  !! Surface from which gaps and normals are taken, one of `geometry_*`.
    integer :: quadrature = default_quadrature  !! One of `quadrature_*`.
    type(division_t) :: division  !! Whether ranks divide the search.
    character(13) :: group = '&contact'  !! Group of the input, for messages.
    logical :: is_tie = .false.  !! Of a tie: no vertex touches in a point, and kinks of the gap do not matter.
  end type pair_settings_t

  type, public :: contact_pair_t  !! Discretized contact pair.
    character(:), allocatable :: name  !! Name of the pair.
    integer :: body_a = 0  !! Index of body a, the slave body.
    integer :: body_b = 0  !! Index of body b, the master body.
    !> The tie across which contact goes on, where the sides were exchanged for that; not allocated elsewhere.
    character(:), allocatable :: other_roles
    integer :: dimension = 0  !! Dimension of space, 2 or 3.
    integer :: discretization = default_discretization  !! Form of the rows, one of `discretization_*`.
    integer :: n_points = 0  !! Number of integration points that have a projection.
    integer :: n_unprojected = 0  !! Number of integration points without projection.
    integer :: n_not_facing = 0  !! Number of these that no master facet faces.
    integer :: n_outside = 0  !! Number of these that project beside the master surface.
    integer :: n_too_far = 0  !! Number of these that are farther away than the search radius.
    !> Fractions of the area of the slave surface without projection: not facing, beside the master surface, too far [].
    real(dp) :: lost_not_facing = 0, lost_outside = 0, lost_too_far = 0
    real(dp) :: theta = 0  !! Penalty parameter, weighted mean of the rows [length/pressure].
    integer :: gap_kind = default_gap  !! Origin of the gaps, one of `gap_*`.
    logical :: is_layer = .false.  !! Whether theta is the compliance of a real elastic layer, not a penalty.
    !> Integration points x on the slave surface (dimension, n_points) [length].
    real(dp), allocatable :: position(:, :)
    real(dp), allocatable :: normal(:, :)  !! Unit normals from body a into body b (dimension, n_points) [].
    !> Weights: areas of the points (n_points) [length^2; length in two dimensions, with 2 pi r in axisymmetry
    !> length^2].
    real(dp), allocatable :: weight(:)
    real(dp), allocatable :: gap(:)  !! Gaps d (n_points) [length].
    !> What was taken off the gaps of the points, as nothing bends their facets (n_points) [length].
    real(dp), allocatable :: bend(:)
    real(dp), allocatable :: curved(:)  !! What of that part they still have (n_points) [length].
    real(dp), allocatable :: uncertainty(:)  !! How uncertain the gaps are (n_points) [length].
    !> Slave facets of the points, ascending among the mortar points and among those after them (n_points).
    integer, allocatable :: facet_a(:)
    real(dp), allocatable :: xi_a(:, :)  !! Reference coordinates on them (dimension-1, n_points) [].
    integer, allocatable :: facet_b(:)  !! Master facets of the projections (n_points).
    !> Reference coordinates of the projections x' on them (dimension-1, n_points) [].
    real(dp), allocatable :: xi_b(:, :)
    !> Sheets of the master surface that the points face; of one slave facet in a row (n_points).
    integer, allocatable :: sheet_b(:)
    integer :: n_rows = 0  !! Number of rows: mortar rows first, then points that are rows by themselves.
    !> Number of point contacts, of vertices and edges: the last integration points, each a row by itself.
    integer :: n_point_contacts = 0
    integer :: n_mortar_rows = 0  !! Number of mortar rows.
    !> Number of integration points of the mortar rows; the points after them are rows by themselves, in the same order.
    integer :: n_mortar_points = 0
    !> Mortar matrix: the rows as weighted means of the points; the sum of each row is 1 (n_rows x n_points) [].
    type(sparse_rows_t) :: average
    !> Corner of each mortar row, numbered as by `corner_interpolation_t` from the mortar points (n_mortar_rows).
    integer, allocatable :: row_corner(:)
    !> Fraction of the slave surface around the vertex of each mortar row that the master covers (n_mortar_rows) [].
    real(dp), allocatable :: row_covered(:)
    !> Position of each row, a vertex or an integration point (dimension, n_rows) [length].
    real(dp), allocatable :: row_position(:, :)
    real(dp), allocatable :: row_normal(:, :)  !! Weighted mean of the normals, normalized (dimension, n_rows) [].
    !> Weights of the rows, with the same sum as those of the points (n_rows) [as `weight`].
    real(dp), allocatable :: row_weight(:)
    real(dp), allocatable :: row_gap(:)  !! Weighted gaps (n_rows) [length].
    !> Penalty parameters of the rows, initially `theta` (n_rows) [length/pressure].
    real(dp), allocatable :: row_theta(:)
    !> Of ties only (`dotyk_contact_tie`), for each node of the slave facet of a point: derivative of its shape function
    !> along the arm, and its gradient along the facet; and the part of the arm across the facet (max_facet_nodes,
    !> n_points) [], (dimension, max_facet_nodes, n_points) [1/length], (dimension, n_points) [length].
    real(dp), allocatable :: arm_shape(:, :), arm_gradient(:, :, :), arm_normal(:, :)
    !> Of ties with a turn only: rotation of the master side to where it is tied (dimension, dimension) [].
    real(dp), allocatable :: turn(:, :)
  contains
    procedure :: slave_part => pair_slave_part
    procedure :: master_normal => pair_master_normal
    procedure :: row_uncertainty => pair_row_uncertainty
    procedure :: carry => pair_carry
  end type contact_pair_t

contains

  !> What a unit displacement of one node of its slave facet contributes to a point: the normal times the shape
  !> function, for ties the component of the displacement at the end of the arm.
  pure function pair_slave_part(self, q, j, shape) result(part)
    class(contact_pair_t), intent(in) :: self
    integer, intent(in) :: q  !! The point.
    integer, intent(in) :: j  !! Number of the node in the facet.
    real(dp), intent(in) :: shape  !! Shape function of the node at the point [].
    real(dp) :: part(self%dimension)  !! By components of the displacement (dimension) [].
    part = self%normal(:, q)*shape
    if (.not. allocated(self%arm_shape)) return
    part = part + self%normal(:, q)*self%arm_shape(j, q) - &
      dot_product(self%normal(:, q), self%arm_gradient(:, j, q))*self%arm_normal(:, q)
  end function pair_slave_part

  !> The normal of a point as the master side has it, which a tie may turn.
  pure function pair_master_normal(self, q) result(normal)
    class(contact_pair_t), intent(in) :: self
    integer, intent(in) :: q  !! The point.
    real(dp) :: normal(self%dimension)
    normal = self%normal(:, q)
    if (allocated(self%turn)) normal = matmul(normal, self%turn)
  end function pair_master_normal

  !> How uncertain the gaps of the rows are: as the most uncertain of their points (n_rows) [length].
  pure function pair_row_uncertainty(self) result(uncertainty)
    class(contact_pair_t), intent(in) :: self
    real(dp) :: uncertainty(self%n_rows)
    integer :: i
    uncertainty = 0
    ! Corners that meet by their motion have exact gaps.
    if (.not. allocated(self%uncertainty)) return
    do i = 1, self%n_rows
      associate (points => self%average%column(self%average%row_start(i):self%average%row_start(i + 1) - 1))
        uncertainty(i) = maxval([0.0_dp, self%uncertainty(points)])
      end associate
    end do
  end function pair_row_uncertainty

  !> To other ranks.
  subroutine pair_carry(self, parcel)
    class(contact_pair_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! Gets the pair, or has it.
    call parcel%carry(self%name)
    call parcel%carry(self%body_a)
    call parcel%carry(self%body_b)
    call parcel%carry(self%dimension)
    call parcel%carry(self%discretization)
    call parcel%carry(self%n_points)
    call parcel%carry(self%n_unprojected)
    call parcel%carry(self%n_not_facing)
    call parcel%carry(self%n_outside)
    call parcel%carry(self%n_too_far)
    call parcel%carry(self%lost_not_facing)
    call parcel%carry(self%lost_outside)
    call parcel%carry(self%lost_too_far)
    call parcel%carry(self%theta)
    call parcel%carry(self%gap_kind)
    call parcel%carry(self%is_layer)
    call parcel%carry(self%position)
    call parcel%carry(self%normal)
    call parcel%carry(self%weight)
    call parcel%carry(self%gap)
    call parcel%carry(self%bend)
    call parcel%carry(self%curved)
    call parcel%carry(self%uncertainty)
    call parcel%carry(self%facet_a)
    call parcel%carry(self%xi_a)
    call parcel%carry(self%facet_b)
    call parcel%carry(self%xi_b)
    call parcel%carry(self%sheet_b)
    call parcel%carry(self%n_rows)
    call parcel%carry(self%n_point_contacts)
    call parcel%carry(self%n_mortar_rows)
    call parcel%carry(self%n_mortar_points)
    call self%average%carry(parcel)
    call parcel%carry(self%row_corner)
    call parcel%carry(self%row_covered)
    call parcel%carry(self%row_position)
    call parcel%carry(self%row_normal)
    call parcel%carry(self%row_weight)
    call parcel%carry(self%row_gap)
    call parcel%carry(self%row_theta)
    call parcel%carry(self%arm_shape)
    call parcel%carry(self%arm_gradient)
    call parcel%carry(self%arm_normal)
    call parcel%carry(self%turn)
  end subroutine pair_carry

  !> Resultant of the contact pressure on body a: the forces of the rows, distributed to their points, along the normals
  !> there.
  pure function pair_force(pair, pressure) result(force)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    real(dp), intent(in) :: pressure(:)  !! Row pressures (n_rows) [pressure].
    real(dp) :: force(3)  !! Resultant, z = 0 in two dimensions (3) [force].
    real(dp), allocatable :: at_points(:)
    allocate (at_points(pair%n_points))
    call pair%average%multiply_transposed(pair%row_weight*pressure, at_points)
    force = 0
    force(1:pair%dimension) = -matmul(pair%normal, at_points)
  end function pair_force

  !> Make pairs known to all ranks.
  subroutine share_pairs(owner, pair)
    !> Rank of each pair, or `all_ranks` where all have it; the same on all ranks (n_pairs).
    integer, intent(in) :: owner(:)
    type(contact_pair_t), intent(inout) :: pair(:)  !! Those of this rank in, all out (n_pairs).
    type(parcel_t) :: parcel
    integer(int64), allocatable :: word(:)
    integer :: k, rank
    if (n_ranks() == 1 .or. all(owner == all_ranks)) return
    call carry_pairs(this_rank())
    call gather_all(parcel%words(), word)
    call parcel%open(word)
    do rank = 0, n_ranks() - 1
      call carry_pairs(rank)
    end do

  contains

    !> The pairs of a rank, into the parcel or out of it.
    subroutine carry_pairs(of_rank)
      integer, intent(in) :: of_rank  !! The rank.
      do k = 1, size(pair)
        if (owner(k) == of_rank) call pair(k)%carry(parcel)
      end do
    end subroutine carry_pairs
  end subroutine share_pairs

  !> Resultant of pressures.
  pure type(pair_resultant_t) function pair_resultant(pair, axisymmetric, pressure) result(resultant)
    type(contact_pair_t), intent(in) :: pair  !! Contact pair.
    logical, intent(in) :: axisymmetric  !! Whether forces are those on the full circumference.
    real(dp), intent(in) :: pressure(:)  !! Row pressures (n_rows) [pressure].
    real(dp), allocatable :: at_points(:)
    real(dp) :: x(3), f(3), mean(3), total
    integer :: q
    allocate (at_points(pair%n_points))
    call pair%average%multiply_transposed(pair%row_weight*pressure, at_points)
    mean = 0
    total = sum(abs(at_points))
    x = 0
    f = 0
    resultant%force = pair_force(pair, pressure)
    do q = 1, pair%n_points
      x(:pair%dimension) = pair%position(:, q)
      f(:pair%dimension) = -pair%normal(:, q)*at_points(q)
      mean = mean + at_points(q)*x
      resultant%moment = resultant%moment + cross(x, f)
    end do
    if (axisymmetric) then
      resultant%radial = resultant%force(1)
      resultant%force(1) = 0
      resultant%moment = 0
      mean(1) = 0
    end if
    associate (force => resultant%force)
      if (norm2(force) > no_force*total .and. total > 0) then
        resultant%centre = mean/sum(at_points)
        if (.not. axisymmetric) &
          resultant%centre = resultant%centre + cross(force/norm2(force), &
                                                      (resultant%moment - cross(resultant%centre, force))/norm2(force))
      else
        resultant%centre = ieee_value(total, ieee_quiet_nan)
      end if
    end associate
  end function pair_resultant
end module dotyk_contact_pair
