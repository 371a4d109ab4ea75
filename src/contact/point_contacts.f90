!> Point contacts of vertices: node-to-surface contact where the mortar integral sees nothing.
!>
!> A mortar row is a mean over facets. The flanks of a narrow wedge face nothing, and those of a wide one touch in a
!> point that a mean does not see: what touches is a vertex and a facet, or two edges. A vertex whose facets are all
!> inclined to the other surface gets a row with its projection there (Hallquist, Goudreau and Benson, Comput. Methods
!> Appl. Mech. Engrg. 51, 1985); crossed edges get rows in edge_contacts.f90. A row needs that the body lies behind its
!> contact point: the normal lies in the normal cone of the vertex. Small strains close no angle of 15 degrees, so that
!> the flanks, which touch nothing but there, take no part in mortar rows (`touches_in_points`).
!>
!> The weight of a row, an area, only scales its pressure and its penalty: here that of the facets around the vertex,
!> projected along the normal.
module dotyk_contact_point_contacts
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: of_mesh, pi, same_place, shape_rounding, smooth_cosine
  use dotyk_contact_adjacency, only: adjacency_t, corner_of, edges_of_corner
  use dotyk_contact_facet_set, only: corner_coordinates, corner_position, edge_coordinates, facet_position_and_normal, &
    facet_set_t
  use dotyk_contact_local_depth, only: is_false_overlap
  use dotyk_contact_projection, only: master_surface_t, project_point, projection_found, projection_t
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: find_vertex_contacts, touches_in_points, turn_about_axis

  type, public :: point_contact_t  !! Contact of two points.
    integer :: facet_a = 0  !! Slave facet.
    real(dp) :: xi_a(2) = 0  !! Reference coordinates on it (2) [].
    integer :: facet_b = 0  !! Master facet.
    real(dp) :: xi_b(2) = 0  !! Reference coordinates on it (2) [].
    real(dp) :: position(3) = 0  !! Point of the slave surface (3) [length].
    real(dp) :: normal(3) = 0  !! Unit normal from body a into body b (3) [].
    real(dp) :: gap = 0  !! Gap [length].
    !> Weight [length^2; length in two dimensions, with the circumference in axisymmetry length^2].
    real(dp) :: weight = 0
    integer :: corner_a = 0  !! Corner of the slave facet at the contact, 0 if none.
    integer :: edge_a = 0  !! Edge of the slave facet at the contact, 0 if none.
    integer :: corner_b = 0  !! Corner of the master facet, likewise.
    integer :: edge_b = 0  !! Edge of the master facet, likewise.
  end type point_contact_t

  !> Neighbours of a contact vertex may lie before the tangent plane by this sine: inclined edges of wedges; at the
  !> boundary of a surface that has no point there.
  real(dp), parameter :: max_slope = 0.5_dp, max_boundary_slope = 0.05_dp
  !> Facets that are inclined to the tangent plane by less than 15 degrees may touch as a whole.
  real(dp), parameter, public :: flank_cosine = cos(15*pi/180)
  !> Flanks are excluded from mortar rows with a normal within 65 degrees of that of its point contact.
  real(dp), parameter :: same_direction = cos(65*pi/180)
  !> Facets at a contact vertex or edge may lean over by this cosine.
  real(dp), parameter, public :: min_exposure = -0.7_dp
  !> Facets count with at least this fraction of their area in weights.
  real(dp), parameter :: min_projected_area = 0.05_dp
  !> A vertex inside the surface is pointed where the mean of the unit normals around it is shorter than this.
  !> A smooth ridge is not, as of a cylinder of few facets: its normals lie in a plane, up to the sine `in_plane`.
  real(dp), parameter :: pointed = 0.95_dp, in_plane = 0.1_dp

contains

  !> In axisymmetry a contact is a circle, on the axis a disc: its weight becomes an area.
  elemental subroutine turn_about_axis(contact)
    type(point_contact_t), intent(inout) :: contact  !! The contact, with a length as weight.
    contact%weight = 2*pi*max(contact%position(1), contact%weight/2)*contact%weight
  end subroutine turn_about_axis

  !> Contacts of pointed vertices of one surface, and of the mid-side nodes of its sharp edges, with facets of the
  !> other.
  subroutine find_vertex_contacts(surface, sharp, has_mid_nodes, other, radius, is_slave, contact)
    type(master_surface_t), intent(in) :: surface  !! Surface of the vertices.
    logical, intent(in) :: sharp(:, :)  !! Its sharp edges (4, n_facets).
    logical, intent(in) :: has_mid_nodes(:)  !! Facets with mid-side nodes (n_facets).
    type(master_surface_t), intent(in) :: other  !! Surface of the facets.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    logical, intent(in) :: is_slave  !! The first surface is the slave surface.
    type(point_contact_t), allocatable, intent(inout) :: contact(:)  !! Contacts; new ones are appended (n).
    integer :: v, k, f, e, g, hint
    hint = 0
    associate (adjacency => surface%adjacency, set => surface%set)
      do v = 1, size(adjacency%start) - 1
        associate (around => adjacency%facet(adjacency%start(v):adjacency%start(v + 1) - 1))
          f = around(1)
          k = corner_of(set, adjacency, v, f)
          call add_contact(surface, other, around, mean_normal(set, adjacency, v), &
                           is_smooth_ridge(set, adjacency, sharp, v), corner_coordinates(set%corners(f), k), k, 0, &
                           radius, is_slave, hint, contact)
        end associate
      end do
      if (set%dimension == 2) return
      do f = 1, set%n
        if (.not. has_mid_nodes(f)) cycle
        do e = 1, set%corners(f)
          g = adjacency%neighbour(e, f)
          if (g > 0 .and. g < f) cycle
          if (g == 0) then
            call add_contact(surface, other, [f], set%axis(:, f), .false., &
                             edge_coordinates(set%corners(f), e, 0.5_dp), 0, e, radius, is_slave, hint, contact)
          else
            call add_contact(surface, other, [f, g], (set%axis(:, f) + set%axis(:, g))/2, .not. sharp(e, f), &
                             edge_coordinates(set%corners(f), e, 0.5_dp), 0, e, radius, is_slave, hint, contact)
          end if
        end do
      end do
    end associate
  end subroutine find_vertex_contacts

  !> Add the contact of one node if it is pointed and has a projection.
  subroutine add_contact(surface, other, around, mean, is_smooth, xi, corner, edge, radius, is_slave, hint, contact)
    type(master_surface_t), intent(in) :: surface  !! Surface of the node.
    type(master_surface_t), intent(in) :: other  !! Surface of the facets.
    integer, intent(in) :: around(:)  !! Facets at the node (number of facets there).
    real(dp), intent(in) :: mean(3)  !! Mean of their unit normals (3) [].
    logical, intent(in) :: is_smooth  !! Whether they are a smooth ridge.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates of the node on the first of them (2) [].
    integer, intent(in) :: corner  !! Its corner of this facet, 0 for a mid-side node.
    integer, intent(in) :: edge  !! The edge of the mid-side node, 0 for a corner.
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    logical, intent(in) :: is_slave  !! The surface of the node is the slave surface.
    !> A facet of the other surface that is probably near, 0 if none; the nearest facet on return.
    integer, intent(inout) :: hint
    type(point_contact_t), allocatable, intent(inout) :: contact(:)  !! Contacts; a new one is appended (n).
    type(point_contact_t) :: new
    type(projection_t) :: projection
    real(dp) :: slope
    real(dp), dimension(3) :: x, normal, foot, xu, xv
    if (.not. norm2(mean) > of_mesh) return
    slope = max_slope
    if (norm2(mean) > pointed .or. is_smooth) then
      if (.not. is_at_boundary(surface%set, surface%adjacency, around, corner, edge)) return
      slope = max_boundary_slope
    end if
    call facet_position_and_normal(surface%set, around(1), xi, x, normal, xu, xv)
    call project_point(other, x, mean/norm2(mean), hint, radius, minval(surface%set%depth(around)), projection)
    if (projection%status /= projection_found) return
    if (.not. is_apex(surface%set, around, x, projection%normal, slope)) return
    foot = x + projection%distance*projection%normal
    ! Forces of the two sides have one line of action.
    if (norm2(foot - projection%position) > same_place*other%set%size(projection%facet)) return
    if (projection%distance < -of_mesh*other%set%size(projection%facet)) then
      if (is_false_overlap(surface, other, x, foot)) return
    end if
    new%weight = projected_area(surface%set, around, projection%normal)
    new%gap = projection%distance
    if (is_slave) then
      new%facet_a = around(1)
      new%xi_a = xi
      new%facet_b = projection%facet
      new%xi_b = projection%xi
      new%normal = projection%normal
      new%position = x
      new%corner_a = corner
      new%edge_a = edge
    else
      new%facet_a = projection%facet
      new%xi_a = projection%xi
      new%facet_b = around(1)
      new%xi_b = xi
      new%normal = -projection%normal
      new%position = projection%position
      new%corner_b = corner
      new%edge_b = edge
    end if
    contact = [contact, new]
  end subroutine add_contact

  !> Whether integration points of a mortar row belong to flanks that touch in a point contact only.
  subroutine touches_in_points(contact, slave, master, facet_a, facet_b, normal, in_points)
    type(point_contact_t), intent(in) :: contact(:)  !! Point contacts (n).
    type(master_surface_t), intent(in) :: slave  !! Slave surface.
    type(master_surface_t), intent(in) :: master  !! Master surface.
    integer, intent(in) :: facet_a(:)  !! Slave facets of the points (n_points).
    integer, intent(in) :: facet_b(:)  !! Master facets of the points (n_points).
    real(dp), intent(in) :: normal(:, :)  !! Normals at the points (dimension, n_points) [].
    logical, intent(out) :: in_points(:)  !! Points on such flanks (n_points).
    real(dp) :: direction_a(3, slave%set%n), direction_b(3, master%set%n), n(3)
    real(dp) :: gap_a(slave%set%n), gap_b(master%set%n)
    integer :: i
    direction_a = 0
    direction_b = 0
    gap_a = huge(gap_a)
    gap_b = huge(gap_b)
    do i = 1, size(contact)
      call mark(slave, contact(i)%facet_a, contact(i)%corner_a, contact(i)%edge_a, contact(i), direction_a, gap_a)
      call mark(master, contact(i)%facet_b, contact(i)%corner_b, contact(i)%edge_b, contact(i), direction_b, gap_b)
    end do
    n = 0
    do i = 1, size(facet_a)
      n(1:size(normal, 1)) = normal(:, i)
      in_points(i) = dot_product(slave%set%axis(:, facet_a(i)), -master%set%axis(:, facet_b(i))) < flank_cosine .and. &
        max(dot_product(direction_a(:, facet_a(i)), n), dot_product(direction_b(:, facet_b(i)), n)) > same_direction
    end do

  contains

    !> Give the facets at a vertex or edge, and the smooth flanks beyond, the direction of the nearest contact.
    subroutine mark(surface, f, corner, edge, at, direction, gap)
      type(master_surface_t), intent(in) :: surface  !! Surface of the vertex or edge.
      integer, intent(in) :: f  !! Facet.
      integer, intent(in) :: corner  !! Its corner at the contact, 0 if none.
      integer, intent(in) :: edge  !! Its edge at the contact, 0 if none.
      type(point_contact_t), intent(in) :: at  !! The contact.
      real(dp), intent(inout) :: direction(:, :)  !! Directions of the facets (3, n_facets) [].
      real(dp), intent(inout) :: gap(:)  !! Gaps of their contacts (n_facets) [length].
      integer, allocatable :: list(:)
      integer :: k, v, e, g
      if (corner > 0) then
        v = surface%adjacency%vertex(corner, f)
        list = surface%adjacency%facet(surface%adjacency%start(v):surface%adjacency%start(v + 1) - 1)
      else if (edge > 0) then
        list = pack([f, surface%adjacency%neighbour(edge, f)], [f, surface%adjacency%neighbour(edge, f)] > 0)
      else
        return
      end if
      k = 0
      do while (k < size(list))
        k = k + 1
        if (.not. at%gap < gap(list(k))) cycle
        gap(list(k)) = at%gap
        direction(:, list(k)) = at%normal
        do e = 1, surface%set%corners(list(k))
          g = surface%adjacency%neighbour(e, list(k))
          if (g == 0) cycle
          if (.not. at%gap < gap(g)) cycle
          if (dot_product(surface%set%axis(:, list(k)), surface%set%axis(:, g)) > smooth_cosine) list = [list, g]
        end do
      end do
    end subroutine mark
  end subroutine touches_in_points

  !> Whether the surface ends at a node.
  pure logical function is_at_boundary(set, adjacency, around, corner, edge)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    integer, intent(in) :: around(:)  !! Facets at the node (number of facets there).
    integer, intent(in) :: corner  !! Corner of the first facet at the node, 0 for the middle of an edge.
    integer, intent(in) :: edge  !! The edge, 0 for a corner.
    integer :: i, v
    if (edge > 0) then
      is_at_boundary = adjacency%neighbour(edge, around(1)) == 0
      return
    end if
    v = adjacency%vertex(corner, around(1))
    is_at_boundary = any([(any(adjacency%neighbour(edges_of_corner(set%corners(around(i)), &
                                                                   corner_of(set, adjacency, v, around(i))), &
                                                   around(i)) == 0), i=1, size(around))])
  end function is_at_boundary

  !> Whether a vertex is locally the outermost point of its body in a direction, up to inclined edges, and no facet
  !> there could touch as a whole.
  pure logical function is_apex(set, around, x, normal, slope)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: around(:)  !! Facets at the node (number of facets there).
    real(dp), intent(in) :: x(3)  !! Position of the node (3) [length].
    real(dp), intent(in) :: normal(3)  !! Direction out of the body (3) [].
    real(dp), intent(in) :: slope  !! Sine of the greatest inclination of edges towards the other surface [].
    real(dp) :: r(3), cosine
    integer :: i, k
    is_apex = .true.
    do i = 1, size(around)
      cosine = dot_product(set%axis(:, around(i)), normal)
      is_apex = is_apex .and. cosine >= min_exposure .and. cosine <= flank_cosine
      do k = 1, set%corners(around(i))
        r = corner_position(set, around(i), k) - x
        is_apex = is_apex .and. dot_product(r, normal) <= slope*norm2(r) + shape_rounding*set%size(around(i))
      end do
    end do
  end function is_apex

  !> Whether a vertex lies on a ridge without sharp edges.
  pure logical function is_smooth_ridge(set, adjacency, sharp, v) result(is_smooth)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    logical, intent(in) :: sharp(:, :)  !! Sharp edges (4, n_facets).
    integer, intent(in) :: v  !! Vertex number.
    real(dp) :: axis(3), greatest(3)
    integer :: i
    greatest = 0
    associate (around => adjacency%facet(adjacency%start(v):adjacency%start(v + 1) - 1))
      is_smooth = .not. any([(any(sharp(edges_of_corner(set%corners(around(i)), &
                                                        corner_of(set, adjacency, v, around(i))), around(i))), &
                              i=1, size(around))])
      if (.not. is_smooth) return
      do i = 2, size(around)
        axis = cross(set%axis(:, around(1)), set%axis(:, around(i)))
        if (norm2(axis) > norm2(greatest)) greatest = axis
      end do
      is_smooth = maxval(abs(matmul(greatest, set%axis(:, around)))) <= in_plane*norm2(greatest)
    end associate
  end function is_smooth_ridge

  !> Mean of the facet normals at a vertex, weighted with the angles of the facets there; not of unit length [].
  pure function mean_normal(set, adjacency, v) result(mean)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    integer, intent(in) :: v  !! Vertex number.
    real(dp) :: mean(3)  !! Mean (3) [].
    real(dp) :: a(3), b(3), angle, total
    integer :: i, k, f, n
    mean = 0
    total = 0
    do i = adjacency%start(v), adjacency%start(v + 1) - 1
      f = adjacency%facet(i)
      n = set%corners(f)
      angle = 1
      if (n > 2) then
        k = corner_of(set, adjacency, v, f)
        a = corner_position(set, f, modulo(k, n) + 1) - corner_position(set, f, k)
        b = corner_position(set, f, modulo(k - 2, n) + 1) - corner_position(set, f, k)
        angle = atan2(norm2(cross(a, b)), dot_product(a, b))
      end if
      mean = mean + angle*set%axis(:, f)
      total = total + angle
    end do
    mean = mean/max(total, tiny(1.0_dp))
  end function mean_normal

  !> Share of a node in the areas of its facets, projected along a direction [length^2; length in two dimensions].
  pure real(dp) function projected_area(set, around, normal) result(area)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    integer, intent(in) :: around(:)  !! Facets at the node (number of facets there).
    real(dp), intent(in) :: normal(3)  !! Direction (3) [].
    real(dp), dimension(3) :: position, n, xu, xv
    real(dp) :: xi(2), whole
    integer :: i, f
    area = 0
    do i = 1, size(around)
      f = around(i)
      xi = merge(1/3.0_dp, 0.0_dp, set%corners(f) == 3)
      call facet_position_and_normal(set, f, xi, position, n, xu, xv)
      select case (set%corners(f))
      case (2)
        whole = 2*norm2(xu)
      case (3)
        whole = norm2(cross(xu, xv))/2
      case default
        whole = 4*norm2(cross(xu, xv))
      end select
      area = area + whole/set%corners(f)*max(min_projected_area, abs(dot_product(n, normal)))
    end do
  end function projected_area
end module dotyk_contact_point_contacts
