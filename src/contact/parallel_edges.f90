!> Contacts of convex edges that lie on each other, such as the ridges of two roofs: no facet faces them, no mortar
!> integral and no crossing sees them.
!>
!> Node to edge: each vertex (and mid-side node) of a sharp slave edge that lies over a sharp master edge gets a row,
!> and so do the ends of a master ridge that lie over a slave edge. The normal is the direction between the edges; where
!> they touch it has none, and is that of the means of the faces beside them. The admissible positions of one edge
!> beside the other are no convex set: the row keeps the edges on the sides of the plane through the contact on which
!> they lie at the beginning. The weight of a row is its share of the length times half the size of the facet.
module dotyk_contact_parallel_edges
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: of_mesh, same_place
  use dotyk_contact_adjacency, only: corner_of, edges_of_corner
  use dotyk_contact_edge_contacts, only: behind_edge, edge_reach, is_first_convex, is_inclined, min_crossing, on_edge
  use dotyk_contact_local_depth, only: is_false_overlap
  use dotyk_contact_point_contacts, only: min_exposure, point_contact_t
  use dotyk_contact_projection, only: master_surface_t
  use dotyk_contact_tree_search, only: box_neighbourhood_t, facets_in_region
  use dotyk_mesh_facet, only: cross
  implicit none
  private
  public :: find_parallel_edges

  !> Least cosine of the angle between the direction from edge to edge and the mean of the faces: 25 degrees.
  real(dp), parameter :: least_agreement = 0.906_dp
  integer, parameter :: max_steps = 10  !! Steps to the nearest point of a curved edge.

contains

  !> Contacts of parallel edges of two surfaces in three dimensions.
  subroutine find_parallel_edges(slave, master, sharp_a, sharp_b, has_mid_nodes, radius, contact)
    type(master_surface_t), intent(in) :: slave  !! Slave surface.
    type(master_surface_t), intent(in) :: master  !! Master surface.
    logical, intent(in) :: sharp_a(:, :)  !! Sharp edges of the slave surface (4, n_facets).
    logical, intent(in) :: sharp_b(:, :)  !! Sharp edges of the master surface (4, n_facets).
    logical, intent(in) :: has_mid_nodes(:)  !! Slave facets with mid-side nodes (n_facets).
    real(dp), intent(in) :: radius  !! Search radius: greatest distance of a contact [length].
    type(point_contact_t), allocatable, intent(inout) :: contact(:)  !! Contacts; new ones are appended (n).
    type(point_contact_t) :: new
    integer :: row_a(size(slave%adjacency%start)), row_b(size(master%adjacency%start))
    integer :: f, e, i, k, n_before
    real(dp) :: place
    logical :: found
    row_a = 0
    row_b = 0
    n_before = size(contact)
    do i = 1, n_before
      if (contact(i)%corner_a > 0) row_a(slave%adjacency%vertex(contact(i)%corner_a, contact(i)%facet_a)) = i
      if (contact(i)%corner_b > 0) row_b(master%adjacency%vertex(contact(i)%corner_b, contact(i)%facet_b)) = i
    end do
    do f = 1, slave%set%n
      do e = 1, slave%set%corners(f)
        if (.not. is_ridge(slave, sharp_a, f, e)) cycle
        do i = 0, 2
          ! 0 and 2 are the ends, 1 the mid-side node.
          if (i == 1 .and. .not. has_mid_nodes(f)) cycle
          k = 0
          if (i /= 1) k = modulo(e - 1 + i/2, slave%set%corners(f)) + 1
          call nearest_contact(slave, f, e, 0.5_dp*i, master, sharp_b, radius, new, place, found)
          if (.not. found) cycle
          if (i == 1) then
            if (has_contact(new%position, same_place*slave%set%size(f), contact(:n_before))) cycle
            new%edge_a = e
          else
            associate (row => row_a(slave%adjacency%vertex(k, f)))
              if (row > n_before) contact(row)%weight = contact(row)%weight + new%weight
              if (row > 0) cycle
              row = size(contact) + 1
            end associate
            new%corner_a = k
          end if
          contact = [contact, new]
        end do
      end do
    end do
    do f = 1, master%set%n
      do e = 1, master%set%corners(f)
        if (.not. is_ridge(master, sharp_b, f, e)) cycle
        do i = 0, 1
          k = modulo(e - 1 + i, master%set%corners(f)) + 1
          if (row_b(master%adjacency%vertex(k, f)) > 0 .or. goes_on(master, sharp_b, f, e, k)) cycle
          call nearest_contact(master, f, e, real(i, dp), slave, sharp_a, radius, new, place, found)
          ! Vertices of the slave edge have their own rows.
          if (.not. found .or. place < same_place .or. place > 1 - same_place) cycle
          contact = [contact, swapped(new)]
          contact(size(contact))%corner_b = k
        end do
      end do
    end do
  end subroutine find_parallel_edges

  !> Whether a point has a contact already.
  pure logical function has_contact(x, reach, contact)
    real(dp), intent(in) :: x(3)  !! The point (3) [length].
    real(dp), intent(in) :: reach  !! Distance within which two points are the same [length].
    type(point_contact_t), intent(in) :: contact(:)  !! Contacts (n).
    integer :: i
    has_contact = any([(norm2(contact(i)%position - x) <= reach, i=1, size(contact))])
  end function has_contact

  !> Whether an edge is sharp and convex, the first of its two copies.
  pure logical function is_ridge(surface, sharp, f, e)
    type(master_surface_t), intent(in) :: surface  !! Surface.
    logical, intent(in) :: sharp(:, :)  !! Its sharp edges (4, n_facets).
    integer, intent(in) :: f  !! Facet.
    integer, intent(in) :: e  !! Edge of the facet.
    is_ridge = sharp(e, f)
    if (is_ridge) is_ridge = is_first_convex(surface, f, e)
  end function is_ridge

  !> Whether a ridge goes on beyond one of its ends.
  pure logical function goes_on(surface, sharp, f, e, corner)
    type(master_surface_t), intent(in) :: surface  !! Surface.
    logical, intent(in) :: sharp(:, :)  !! Its sharp edges (4, n_facets).
    integer, intent(in) :: f  !! Facet.
    integer, intent(in) :: e  !! Edge of the facet.
    integer, intent(in) :: corner  !! Corner at the end.
    real(dp) :: xi(2), x(3), along(3), other(3)
    integer :: v, i, k, g, edges(2)
    call on_edge(surface%set, f, e, 0.5_dp, xi, x, along)
    v = surface%adjacency%vertex(corner, f)
    goes_on = .false.
    do i = surface%adjacency%start(v), surface%adjacency%start(v + 1) - 1
      g = surface%adjacency%facet(i)
      edges = edges_of_corner(surface%set%corners(g), corner_of(surface%set, surface%adjacency, v, g))
      do k = 1, 2
        if (.not. is_ridge(surface, sharp, g, edges(k)) .or. (g == f .and. edges(k) == e)) cycle
        call on_edge(surface%set, g, edges(k), 0.5_dp, xi, x, other)
        goes_on = goes_on .or. norm2(cross(along, other)) <= min_crossing*norm2(along)*norm2(other)
      end do
    end do
  end function goes_on

  !> The nearest contact of a point of an edge with the edges of another surface, the first one as slave.
  subroutine nearest_contact(surface, f, e, s, other, sharp, radius, contact, place, found)
    type(master_surface_t), intent(in) :: surface  !! Surface of the point.
    integer, intent(in) :: f  !! Facet of its edge.
    integer, intent(in) :: e  !! Edge.
    real(dp), intent(in) :: s  !! Fraction of the edge (0 to 1) [].
    type(master_surface_t), intent(in) :: other  !! The other surface.
    logical, intent(in) :: sharp(:, :)  !! Its sharp edges (4, n_facets).
    real(dp), intent(in) :: radius  !! Search radius [length].
    type(point_contact_t), intent(out) :: contact  !! Contact.
    real(dp), intent(out) :: place  !! Fraction of the other edge (0 to 1) [].
    logical, intent(out) :: found  !! There is one.
    type(box_neighbourhood_t) :: region
    type(point_contact_t) :: new
    real(dp) :: x(3), along(3), t
    integer, allocatable :: list(:)
    integer :: i, k
    logical :: touches
    found = .false.
    place = 0
    call on_edge(surface%set, f, e, s, new%xi_a, x, along)
    region%low = x
    region%high = x
    region%distance = min(radius, edge_reach*surface%set%size(f))
    call facets_in_region(other%tree, region, list)
    new%facet_a = f
    new%position = x
    new%weight = norm2(along)*surface%set%size(f)/4
    do i = 1, size(list)
      do k = 1, other%set%corners(list(i))
        if (.not. is_ridge(other, sharp, list(i), k)) cycle
        call lay_on_edge(surface, f, e, x, along, other, list(i), k, region%distance, new, t, touches)
        if (.not. touches) cycle
        if (found) then
          if (abs(new%gap) >= abs(contact%gap)) cycle
        end if
        found = .true.
        contact = new
        place = t
      end do
    end do
  end subroutine nearest_contact

  !> Contact of a point of one edge with another edge, if that is parallel and both bodies lie behind the plane between.
  subroutine lay_on_edge(surface, f, e, x, along, other, g, k, reach, contact, t, touches)
    type(master_surface_t), intent(in) :: surface  !! Surface of the point.
    integer, intent(in) :: f  !! Facet of its edge.
    integer, intent(in) :: e  !! Edge.
    real(dp), intent(in) :: x(3)  !! The point (3) [length].
    real(dp), intent(in) :: along(3)  !! Direction of its edge (3) [length].
    type(master_surface_t), intent(in) :: other  !! The other surface.
    integer, intent(in) :: g  !! Facet of its edge.
    integer, intent(in) :: k  !! Edge.
    real(dp), intent(in) :: reach  !! Greatest distance [length].
    type(point_contact_t), intent(inout) :: contact  !! Contact; its partner is set.
    real(dp), intent(out) :: t  !! Fraction of the other edge [].
    logical, intent(out) :: touches  !! There is a contact.
    real(dp), dimension(3) :: foot, b, mean, d, n
    integer :: i
    touches = .false.
    t = 0.5_dp
    do i = 1, max_steps
      call on_edge(other%set, g, k, t, contact%xi_b, foot, b)
      t = t + dot_product(x - foot, b)/dot_product(b, b)
      if (abs(t) > 2) return
    end do
    if (t < -same_place .or. t > 1 + same_place) return
    t = max(0.0_dp, min(1.0_dp, t))
    call on_edge(other%set, g, k, t, contact%xi_b, foot, b)
    d = foot - x
    if (norm2(cross(along, b)) > min_crossing*norm2(along)*norm2(b) .or. norm2(d) > reach) return
    mean = mean_normal(surface, f, e) - mean_normal(other, g, k)
    mean = mean - dot_product(mean, b)/dot_product(b, b)*b
    if (.not. norm2(mean) > of_mesh) return
    n = mean/norm2(mean)
    if (norm2(d) > same_place*surface%set%size(f)) then
      if (abs(dot_product(d, n)) < least_agreement*norm2(d)) return
      n = sign(1.0_dp, dot_product(d, n))*d/norm2(d)
    end if
    if (.not. behind_edge(surface%set, surface%adjacency, f, e, n, min_exposure)) return
    if (.not. behind_edge(other%set, other%adjacency, g, k, -n, min_exposure)) return
    if (.not. (is_inclined(surface, f, e, n) .and. is_inclined(other, g, k, n))) return
    contact%gap = dot_product(n, d)
    ! An overlap is shallower than the bodies are thick.
    if (-contact%gap > min(surface%set%depth(f), other%set%depth(g))) return
    if (contact%gap < -of_mesh*surface%set%size(f)) then
      if (is_false_overlap(surface, other, x, foot)) return
    end if
    contact%facet_b = g
    contact%edge_b = k
    contact%normal = n
    touches = .true.
  end subroutine lay_on_edge

  !> Mean of the normals of the two facets at an edge, not of unit length [].
  pure function mean_normal(surface, f, e) result(mean)
    type(master_surface_t), intent(in) :: surface  !! Surface.
    integer, intent(in) :: f  !! Facet.
    integer, intent(in) :: e  !! Edge of the facet, inside the surface.
    real(dp) :: mean(3)  !! Mean (3) [].
    mean = (surface%set%axis(:, f) + surface%set%axis(:, surface%adjacency%neighbour(e, f)))/2
  end function mean_normal

  !> A contact with slave and master exchanged.
  pure function swapped(contact) result(other)
    type(point_contact_t), intent(in) :: contact  !! Contact.
    type(point_contact_t) :: other
    other = contact
    other%facet_a = contact%facet_b
    other%xi_a = contact%xi_b
    other%corner_a = contact%corner_b
    other%edge_a = contact%edge_b
    other%facet_b = contact%facet_a
    other%xi_b = contact%xi_a
    other%corner_b = contact%corner_a
    other%edge_b = contact%edge_a
    other%normal = -contact%normal
    other%position = contact%position + contact%gap*contact%normal
  end function swapped
end module dotyk_contact_parallel_edges
