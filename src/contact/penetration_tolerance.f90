!> The depth of a point of one part in another that a right solution may have: how well the gap there is known.
!>
!> A point of a is below the closest point of b in direction d. With s the displacement of the two relative to each
!> other, the depth is allowed up to the sum of
!>
!> - the bound of the iteration times what the two move beside their common rigid motion, and rounding (`slack`);
!> - penalty and given gaps: the penetration of the rows around both points; and what uncertain gaps leave uncertain of
!>   the displacements of the two (`left`);
!> - facets: the height of arcs over them, twice, along d; the largest of all that share a point, on both sides. Where
!>   rows keep the gap closed in the mean, and between nodes, these are the arcs of the deformed facets. Over slave
!>   facets the gap is as uncertain as their rows are. A vertex of plane facets lies on its surface, and its row has
!>   the gap there: none of its own facets counts;
!> - mean conditions: over a slave facet of width h that turns by b against the other surface, a gap whose mean is 0
!>   goes from -h b/2 to h b/2;
!> - small displacements: s r + k s^2/2 of faces with curvature k that turn by r.
module dotyk_contact_penetration_tolerance
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_thresholds, only: opposite_cosine, same_number, same_place
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_facet_set, only: facet_position_and_normal
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_mesh_element, only: kind_nodes
  implicit none
  private

  type, public :: penetration_t  !! The deepest point of one part below the boundary of another that is not allowed.
    real(dp) :: depth = 0  !! Its depth; 0 where there is none [length].
    real(dp) :: position(3) = 0  !! Its position after deformation (3) [length].
    !> Nodes of the part that are too deep, and edges that are without a node so deep.
    integer :: n_nodes = 0, n_edges = 0
    integer :: n_passed = 0  !! Nodes that have passed through the other part and are outside again.
    !> The deepest point that is allowed for the bending of facets between contact rows: depth, 0 where there is
    !> none, and position after deformation (3) [length].
    real(dp) :: between_rows = 0, between_at(3) = 0
  contains
    procedure :: add => penetration_add
    procedure :: outweighs => penetration_outweighs
    procedure :: carry => penetration_carry
  end type penetration_t

  type, public :: left_by_pairs_t  !! What contact pairs leave at the nodes of a part.
    real(dp), allocatable :: depth(:)  !! By penalty, given gaps and uncertain displacements (n_nodes) [length].
    !> Width of the slave facets around over which the gap is closed in the mean (n_nodes) [length].
    real(dp), allocatable :: width(:)
    real(dp), allocatable :: uncertainty(:)  !! That of the gaps over the slave facets around (n_nodes) [length].
    logical, allocatable :: is_averaged(:)  !! Nodes of facets with rows at all of their vertices (n_nodes).
    real(dp) :: given = 0  !! What given gaps leave at most, which the meshes do not show [length].
  contains
    procedure :: at => left_at
  end type left_by_pairs_t

  type, public :: penetration_tolerance_t  !! What is known of two parts, a and b.
    real(dp) :: slack = 0  !! Error of the displacements and of rounding [length].
    real(dp) :: moved = 0  !! Largest displacement of the two beside their common rigid motion [length].
    type(left_by_pairs_t) :: left_a, left_b  !! What contact pairs leave on both sides.
  contains
    procedure :: swapped => tolerance_swapped
    procedure :: judge => tolerance_judge
    procedure :: find_allowed => tolerance_find_allowed
  end type penetration_tolerance_t

contains

  !> The same for some of the nodes, as those of a part of a body.
  pure type(left_by_pairs_t) function left_at(self, node)
    class(left_by_pairs_t), intent(in) :: self
    integer, intent(in) :: node(:)  !! The nodes (n).
    left_at = left_by_pairs_t(self%depth(node), self%width(node), self%uncertainty(node), self%is_averaged(node), &
                              self%given)
  end function left_at

  !> The same for b and a.
  pure type(penetration_tolerance_t) function tolerance_swapped(self) result(swapped)
    class(penetration_tolerance_t), intent(in) :: self
    swapped = penetration_tolerance_t(self%slack, self%moved, self%left_b, self%left_a)
  end function tolerance_swapped

  !> Judge a depth: 0 on return if it is allowed.
  pure subroutine tolerance_judge(self, a, nodes, b, facet, xi, x, displacement, depth, between)
    class(penetration_tolerance_t), intent(in) :: self
    type(solid_t), intent(in) :: a  !! The part of the point.
    integer, intent(in) :: nodes(:)  !! The node, or the nodes that the point lies between (n).
    type(solid_t), intent(in) :: b  !! The other part.
    integer, intent(in) :: facet  !! Its facet that is nearest.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates of the closest point (2) [].
    real(dp), intent(in) :: x(3)  !! The point after deformation (3) [length].
    real(dp), intent(in) :: displacement(3)  !! Its displacement (3) [length].
    real(dp), intent(inout) :: depth  !! Depth; 0 on return if it is allowed [length].
    real(dp), intent(out) :: between  !! The depth where only bending between rows allows it, or 0 [length].
    real(dp) :: allowed, left, certain, below, there(2)
    integer :: side
    between = 0
    if (depth > self%slack) then
      call self%find_allowed(a, nodes, b, facet, xi, x, displacement, allowed, left, certain)
      if (depth <= allowed) then
        if (depth > certain) between = depth
      else
        ! Near the side of b, that is not what the point came through.
        call b%depth_beside_flush(x, a, nodes, .true., 2*max(allowed, b%set%size(facet)), below, side, there)
        if (side == 0) below = -1
        if (.not. below < 0) call self%find_allowed(a, nodes, b, side, there, x, displacement, allowed, left, certain)
        if (below < 0 .or. below > allowed) then
          if (.not. is_allowed_beside()) return
        else if (below > certain) then
          between = below
        end if
      end if
    end if
    depth = 0

  contains

    !> Whether the depth below a facet that shares a corner with the nearest one is allowed, as that of a bore below its
    !> rim. The point has not come through facets that do not face it.
    pure logical function is_allowed_beside()
      real(dp) :: at(2), square, of_facet, of_pairs, at_rest
      real(dp), allocatable :: normals(:, :)
      integer :: i, k, g
      is_allowed_beside = .false.
      normals = transpose(a%normal(:, a%facets_around(nodes)))
      do i = 1, b%set%corners(facet)
        associate (v => b%adjacency%vertex(i, facet))
          do k = b%adjacency%start(v), b%adjacency%start(v + 1) - 1
            g = b%adjacency%facet(k)
            if (g == facet) cycle
            if (minval(matmul(normals, b%normal(:, g))) > opposite_cosine) cycle
            call closest_point_on_facet(b%set, g, x, at, square)
            ! A nearer one is flush with the first part, such as that on a plane of symmetry.
            if (sqrt(square) < (1 - same_place)*depth) cycle
            call self%find_allowed(a, nodes, b, g, at, x, displacement, of_facet, of_pairs, at_rest)
            is_allowed_beside = is_allowed_beside .or. sqrt(square) <= of_facet
          end do
        end associate
      end do
    end function is_allowed_beside
  end subroutine tolerance_judge

  !> Depth of a point of a below b that is allowed [length].
  pure subroutine tolerance_find_allowed(self, a, nodes, b, facet, xi, x, displacement, allowed, left, certain)
    class(penetration_tolerance_t), intent(in) :: self
    type(solid_t), intent(in) :: a  !! The part of the point.
    integer, intent(in) :: nodes(:)  !! The node, or the nodes that the point lies between (n).
    type(solid_t), intent(in) :: b  !! The other part.
    integer, intent(in) :: facet  !! Its facet that is nearest.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates of the closest point (2) [].
    real(dp), intent(in) :: x(3)  !! The point after deformation (3) [length].
    real(dp), intent(in) :: displacement(3)  !! Its displacement (3) [length].
    real(dp), intent(out) :: allowed  !! Depth [length].
    real(dp), intent(out) :: left  !! The part of it by penalty and given gaps [length].
    real(dp), intent(out) :: certain  !! The part that is not the bending of facets between rows [length].
    real(dp) :: position(3), d(3), xu(3), xv(3), slip, turn, curvature, uncertainty, width, cosine, tilt
    integer, allocatable :: around(:), shared(:)
    integer :: i, k, vertex
    logical :: is_averaged, is_linear
    around = a%facets_around(nodes)
    call b%facets_at(facet, xi, shared, vertex)
    call facet_position_and_normal(b%set, facet, xi, position, d, xu, xv)
    if (norm2(position - x) > self%slack) d = (position - x)/norm2(position - x)
    slip = norm2(displacement - b%displacement_at(facet, xi))
    turn = maxval(norm2(a%normal(:, around) - a%normal0(:, around), 1)) + &
           maxval(norm2(b%normal(:, shared) - b%normal0(:, shared), 1))
    curvature = maxval(a%curvature(around)) + maxval(b%curvature(shared))
    associate (of_b => b%surface%node(1:kind_nodes(b%surface%kind(facet)), facet))
      left = maxval(self%left_a%depth(nodes)) + maxval(self%left_b%depth(of_b))
      uncertainty = maxval(self%left_b%uncertainty(of_b))
      width = maxval(self%left_b%width(of_b))
      ! Rows at some points of an edge leave it bent between them.
      is_averaged = size(nodes) > 1 .or. all(self%left_a%is_averaged(nodes)) .or. all(self%left_b%is_averaged(of_b))
    end associate
    certain = self%slack + left + slip*turn + slip**2*curvature/2 + uncertainty
    allowed = certain + along(b, shared, merge(b%roughness(shared), b%roughness0(shared), is_averaged), d)
    certain = certain + along(b, shared, b%roughness0(shared), d)
    is_linear = all(kind_nodes(a%surface%kind(around)) == a%set%corners(around))
    if (size(nodes) > 1 .or. .not. (is_linear .and. all(a%set%affine(around)))) then
      allowed = allowed + maxval(self%left_a%uncertainty(nodes)) + &
                along(a, around, merge(a%roughness(around), a%roughness0(around), is_averaged .or. is_linear), d)
      certain = certain + maxval(self%left_a%uncertainty(nodes)) + along(a, around, a%roughness0(around), d)
      width = max(width, maxval(self%left_a%width(nodes)))
    end if
    if (.not. width > 0) return
    ! Facets of the two that face each other best, and how they turn against each other.
    cosine = 0
    tilt = 0
    do k = 1, size(shared)
      do i = 1, size(around)
        associate (p => around(i), q => shared(k))
          if (dot_product(a%normal(:, p), b%normal(:, q)) > cosine) cycle
          cosine = dot_product(a%normal(:, p), b%normal(:, q))
          tilt = norm2(a%normal(:, p) - a%normal0(:, p) + b%normal(:, q) - b%normal0(:, q))
        end associate
      end do
    end do
    allowed = allowed + width*tilt/2
  end subroutine tolerance_find_allowed

  !> Largest height over some facets, measured in a direction [length].
  pure real(dp) function along(part, facets, height, d)
    type(solid_t), intent(in) :: part  !! The part.
    integer, intent(in) :: facets(:)  !! The facets (n).
    real(dp), intent(in) :: height(:)  !! Height over each along its normal (n) [length].
    real(dp), intent(in) :: d(3)  !! Unit vector (3) [].
    along = maxval(height*abs(matmul(d, part%normal(:, facets))))
  end function along

  !> Put it into a parcel, or take it out.
  subroutine penetration_carry(self, parcel)
    class(penetration_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%depth)
    call parcel%carry_fixed(size(self%position), self%position)
    call parcel%carry(self%n_nodes)
    call parcel%carry(self%n_edges)
    call parcel%carry(self%n_passed)
    call parcel%carry(self%between_rows)
    call parcel%carry_fixed(size(self%between_at), self%between_at)
  end subroutine penetration_carry

  !> Add the points of another one.
  pure subroutine penetration_add(self, other)
    class(penetration_t), intent(inout) :: self
    class(penetration_t), intent(in) :: other  !! The other one.
    self%n_nodes = self%n_nodes + other%n_nodes
    self%n_edges = self%n_edges + other%n_edges
    self%n_passed = self%n_passed + other%n_passed
    if (other%between_rows > (1 + same_number)*self%between_rows) then
      self%between_rows = other%between_rows
      self%between_at = other%between_at
    end if
    if (.not. other%depth > (1 + same_number)*self%depth) return
    self%depth = other%depth
    self%position = other%position
  end subroutine penetration_add

  !> Whether a penetration is deeper than another one, or as deep but for rounding, and with more nodes.
  pure logical function penetration_outweighs(self, other) result(outweighs)
    class(penetration_t), intent(in) :: self
    class(penetration_t), intent(in) :: other  !! The other one.
    outweighs = self%depth > (1 + same_number)*other%depth
    if (outweighs .or. self%depth < (1 - same_number)*other%depth) return
    outweighs = self%n_nodes + self%n_passed > other%n_nodes + other%n_passed
  end function penetration_outweighs
end module dotyk_contact_penetration_tolerance
