!> Point contacts of crossed edges in three dimensions, where the mortar integral sees nothing and no vertex is near:
!> rows with the closest points of the edges and their common normal (cf. Puso and Laursen, Comput. Methods Appl. Mech.
!> Engrg. 191, 2002). Both bodies lie behind the plane through the edges. The weight of a row is the area of the
!> parallelogram of the half edges.
module dotyk_contact_edge_contacts
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: of_mesh, pi, rounding
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_facet_set, only: corner_position, edge_coordinates, facet_position_and_normal, facet_set_t
  use dotyk_contact_local_depth, only: is_false_overlap
  use dotyk_contact_point_contacts, only: flank_cosine, min_exposure, point_contact_t
  use dotyk_contact_projection, only: master_surface_t
  use dotyk_contact_tree_search, only: box_neighbourhood_t, facets_in_region
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: behind_edge, closest_on_edges, find_edge_contacts, is_first_convex, is_inclined, on_edge

  real(dp), parameter, public :: min_crossing = 0.1_dp  !! Edges cross where the sine of their angle exceeds this.
  integer, parameter :: max_steps = 20  !! Steps to the closest points of curved edges.
  !> Crossing edges are searched within this multiple of the size of their facets.
  real(dp), parameter, public :: edge_reach = 2
  real(dp), parameter :: max_slope = 0.02_dp  !! Facets at an edge may rise above the tangent plane by this sine.
  !> Edges between facets that are inclined by less than this are flat: half a degree.
  real(dp), parameter :: flat_cosine = cos(0.5_dp*pi/180)

contains

  !> Contacts of crossed edges of two surfaces in three dimensions, at least one of them sharp.
  subroutine find_edge_contacts(slave, master, sharp_a, sharp_b, radius, contact)
    type(master_surface_t), intent(in) :: slave  !! Slave surface.
    type(master_surface_t), intent(in) :: master  !! Master surface.
    logical, intent(in) :: sharp_a(:, :)  !! Sharp edges of the slave surface (4, n_facets).
    logical, intent(in) :: sharp_b(:, :)  !! Sharp edges of the master surface (4, n_facets).
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    type(point_contact_t), allocatable, intent(inout) :: contact(:)  !! Contacts; new ones are appended (n).
    integer :: f, e
    do f = 1, slave%set%n
      do e = 1, slave%set%corners(f)
        if (.not. is_first_convex(slave, f, e)) cycle
        call contacts_of_edge(slave, f, e, sharp_a(e, f), master, sharp_b, radius, contact)
      end do
    end do
  end subroutine find_edge_contacts

  !> Contacts of one slave edge.
  subroutine contacts_of_edge(slave, f, e, is_sharp, master, sharp_b, radius, contact)
    type(master_surface_t), intent(in) :: slave  !! Slave surface.
    integer, intent(in) :: f  !! Facet of the edge.
    integer, intent(in) :: e  !! Edge number.
    logical, intent(in) :: is_sharp  !! The edge is sharp.
    type(master_surface_t), intent(in) :: master  !! Master surface.
    logical, intent(in) :: sharp_b(:, :)  !! Sharp edges of the master surface (4, n_facets).
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a projection [length].
    type(point_contact_t), allocatable, intent(inout) :: contact(:)  !! Contacts; new ones are appended (n).
    type(box_neighbourhood_t) :: region
    type(point_contact_t) :: new
    real(dp) :: ends(3, 2)
    integer, allocatable :: list(:)
    integer :: i, g, k
    logical :: found
    ends(:, 1) = corner_position(slave%set, f, e)
    ends(:, 2) = corner_position(slave%set, f, modulo(e, slave%set%corners(f)) + 1)
    region%low = minval(ends, dim=2)
    region%high = maxval(ends, dim=2)
    region%distance = min(radius, edge_reach*slave%set%size(f))
    call facets_in_region(master%tree, region, list)
    do i = 1, size(list)
      g = list(i)
      do k = 1, master%set%corners(g)
        ! Two smooth edges: facets and vertices see their contact.
        if (.not. (is_sharp .or. sharp_b(k, g))) cycle
        if (.not. is_first_convex(master, g, k)) cycle
        call cross_edges(slave, f, e, is_sharp, ends, master, g, k, sharp_b(k, g), region%distance, new, found)
        if (found) contact = [contact, new]
      end do
    end do
  end subroutine contacts_of_edge

  !> Whether an edge is the first of its two copies, and convex.
  pure logical function is_first_convex(surface, f, e)
    type(master_surface_t), intent(in) :: surface  !! Surface.
    integer, intent(in) :: f  !! Facet.
    integer, intent(in) :: e  !! Edge of the facet.
    real(dp) :: r(3)
    integer :: g, k
    g = surface%adjacency%neighbour(e, f)
    is_first_convex = .false.
    if (g < f) return
    if (dot_product(surface%set%axis(:, f), surface%set%axis(:, g)) > flat_cosine) return
    ! Convex where the neighbour turns away.
    k = findloc(surface%adjacency%neighbour(:, g), f, dim=1)
    if (k == 0) return
    r = corner_position(surface%set, g, modulo(k + 1, surface%set%corners(g)) + 1) - corner_position(surface%set, g, k)
    is_first_convex = dot_product(r, surface%set%axis(:, f)) < 0
  end function is_first_convex

  !> Closest points of two edges that cross, if both bodies lie behind them.
  subroutine cross_edges(slave, f, e, is_sharp_a, ends, master, g, k, is_sharp_b, reach, contact, found)
    type(master_surface_t), intent(in) :: slave  !! Slave surface.
    integer, intent(in) :: f  !! Facet of the slave edge.
    integer, intent(in) :: e  !! Slave edge.
    logical, intent(in) :: is_sharp_a  !! The slave edge is sharp.
    real(dp), intent(in) :: ends(3, 2)  !! Ends of the slave edge (3, 2) [length].
    type(master_surface_t), intent(in) :: master  !! Master surface.
    integer, intent(in) :: g  !! Facet of the master edge.
    integer, intent(in) :: k  !! Master edge.
    logical, intent(in) :: is_sharp_b  !! The master edge is sharp.
    real(dp), intent(in) :: reach  !! Greatest distance [length].
    type(point_contact_t), intent(out) :: contact  !! Contact.
    logical, intent(out) :: found  !! The edges cross, and bodies lie behind them.
    real(dp), dimension(3) :: a, b, r, n, on_a, on_b, common
    real(dp) :: s, t, length, sine
    found = .false.
    a = ends(:, 2) - ends(:, 1)
    b = corner_position(master%set, g, modulo(k, master%set%corners(g)) + 1) - corner_position(master%set, g, k)
    n = cross(a, b)
    length = norm2(a)*norm2(b)
    if (.not. norm2(n) > min_crossing*length) return
    sine = norm2(n)/length
    n = n/norm2(n)
    r = corner_position(master%set, g, k) - ends(:, 1)
    ! r + t b - s a is parallel to n.
    s = dot_product(n, cross(r, b))/dot_product(n, cross(a, b))
    t = dot_product(n, cross(r, a))/dot_product(n, cross(a, b))
    if (s < 0 .or. s >= 1 .or. t < 0 .or. t >= 1) return
    if (abs(dot_product(r, n)) > reach) return
    if (.not. are_behind()) then
      n = -n
      if (.not. are_behind()) return
    end if
    ! An edge on a face crosses the rim of the face; between two faces there are mortar rows.
    if (.not. ((is_sharp_a .and. is_inclined(slave, f, e, n)) .or. (is_sharp_b .and. is_inclined(master, g, k, n)))) &
      return
    contact%facet_a = f
    contact%edge_a = e
    contact%facet_b = g
    contact%edge_b = k
    call closest_on_edges(slave%set, f, e, master%set, g, k, s, t, contact%xi_a, contact%xi_b, on_a, on_b, a, b)
    if (s < 0 .or. s > 1 .or. t < 0 .or. t > 1) return
    common = cross(a, b)
    if (norm2(common) > 0) n = sign(1.0_dp, dot_product(common, n))*common/norm2(common)
    contact%position = on_a
    contact%normal = n
    contact%gap = dot_product(n, on_b - on_a)
    contact%weight = sine*length/4
    ! An overlap is shallower than the bodies are thick.
    found = -contact%gap <= min(slave%set%depth(f), master%set%depth(g))
    if (found .and. contact%gap < -of_mesh*slave%set%size(f)) found = .not. is_false_overlap(slave, master, on_a, on_b)

  contains

    !> Whether both bodies lie behind their edges.
    pure logical function are_behind()
      are_behind = behind_edge(slave%set, slave%adjacency, f, e, n, min_exposure)
      if (are_behind) are_behind = behind_edge(master%set, master%adjacency, g, k, -n, min_exposure)
    end function are_behind
  end subroutine cross_edges

  !> Closest points of two edges that may be curved, by the method of Gauss and Newton.
  pure subroutine closest_on_edges(set_a, f, e, set_b, g, k, s, t, xi_a, xi_b, on_a, on_b, a, b)
    type(facet_set_t), intent(in) :: set_a  !! Facets of the one surface.
    integer, intent(in) :: f  !! Facet of its edge.
    integer, intent(in) :: e  !! The edge.
    type(facet_set_t), intent(in) :: set_b  !! Facets of the other surface.
    integer, intent(in) :: g  !! Facet of its edge.
    integer, intent(in) :: k  !! The edge.
    real(dp), intent(inout) :: s  !! Fraction of the first edge (0 to 1, or beyond its ends) [].
    real(dp), intent(inout) :: t  !! Fraction of the second edge [].
    real(dp), intent(out) :: xi_a(2), xi_b(2)  !! Reference coordinates of the points (2) [].
    real(dp), intent(out) :: on_a(3), on_b(3)  !! The points (3) [length].
    real(dp), intent(out) :: a(3), b(3)  !! Derivatives with respect to s and t there (3) [length].
    real(dp) :: aa, ab, bb, ra, rb, step(2)
    integer :: i
    step = 1
    do i = 1, max_steps + 1
      call on_edge(set_a, f, e, s, xi_a, on_a, a)
      call on_edge(set_b, g, k, t, xi_b, on_b, b)
      if (i > max_steps .or. maxval(abs([s, t])) > 2 .or. maxval(abs(step)) < rounding) exit
      aa = dot_product(a, a)
      ab = dot_product(a, b)
      bb = dot_product(b, b)
      ra = dot_product(on_b - on_a, a)
      rb = dot_product(on_b - on_a, b)
      if (.not. aa*bb - ab**2 > (min_crossing/2)**2*aa*bb) exit
      step = [bb*ra - ab*rb, ab*ra - aa*rb]/(aa*bb - ab**2)
      s = s + step(1)
      t = t + step(2)
    end do
  end subroutine closest_on_edges

  !> Point of an edge and its derivative along the edge.
  pure subroutine on_edge(set, f, e, s, xi, x, along)
    type(facet_set_t), intent(in) :: set  !! Facets.
    integer, intent(in) :: f  !! Facet number.
    integer, intent(in) :: e  !! Edge number.
    real(dp), intent(in) :: s  !! Fraction of the edge from its first corner [].
    real(dp), intent(out) :: xi(2)  !! Reference coordinates of the point (2) [].
    real(dp), intent(out) :: x(3)  !! Position (3) [length].
    real(dp), intent(out) :: along(3)  !! Derivative with respect to s (3) [length].
    real(dp) :: normal(3), xu(3), xv(3), whole(2)
    xi = edge_coordinates(set%corners(f), e, s)
    whole = edge_coordinates(set%corners(f), e, 1.0_dp) - edge_coordinates(set%corners(f), e, 0.0_dp)
    call facet_position_and_normal(set, f, xi, x, normal, xu, xv)
    along = whole(1)*xu + whole(2)*xv
  end subroutine on_edge

  !> Whether both facets at an edge are inclined to the tangent plane, so that they could not touch as a whole.
  pure logical function is_inclined(surface, f, e, normal)
    type(master_surface_t), intent(in) :: surface  !! Surface.
    integer, intent(in) :: f  !! Facet of the edge.
    integer, intent(in) :: e  !! Edge of the facet.
    real(dp), intent(in) :: normal(3)  !! Normal of the plane (3) [].
    is_inclined = abs(dot_product(surface%set%axis(:, f), normal)) <= flank_cosine
    if (surface%adjacency%neighbour(e, f) > 0) is_inclined = is_inclined .and. &
      abs(dot_product(surface%set%axis(:, surface%adjacency%neighbour(e, f)), normal)) <= flank_cosine
  end function is_inclined

  !> Whether the facets at an edge lie behind the tangent plane with an outward normal, and do not lean over by more.
  pure logical function behind_edge(set, adjacency, f, e, normal, least)
    type(facet_set_t), intent(in) :: set  !! Facets of a surface.
    type(adjacency_t), intent(in) :: adjacency  !! Their neighbours.
    integer, intent(in) :: f  !! Facet of the edge.
    integer, intent(in) :: e  !! Edge of the facet.
    real(dp), intent(in) :: normal(3)  !! Direction out of the body (3) [].
    real(dp), intent(in) :: least  !! Cosine of the angle of their normals to it, at least [].
    behind_edge = is_behind(f, e)
    if (behind_edge .and. adjacency%neighbour(e, f) > 0) then
      associate (g => adjacency%neighbour(e, f))
        behind_edge = is_behind(g, findloc(adjacency%neighbour(1:set%corners(g), g), f, dim=1))
      end associate
    end if

  contains

    !> Whether one facet lies behind the plane.
    pure logical function is_behind(facet, edge)
      integer, intent(in) :: facet  !! Facet number.
      integer, intent(in) :: edge  !! Its edge; 0 if the facets do not see each other.
      real(dp) :: r(3)
      integer :: i, n
      is_behind = edge > 0
      if (.not. is_behind) return
      n = set%corners(facet)
      is_behind = dot_product(set%axis(:, facet), normal) >= least
      do i = 1, n
        if (i == edge .or. i == modulo(edge, n) + 1) cycle
        r = corner_position(set, facet, i) - corner_position(set, facet, edge)
        is_behind = is_behind .and. dot_product(r, normal) <= max_slope*norm2(r)
      end do
    end function is_behind
  end function behind_edge
end module dotyk_contact_edge_contacts
