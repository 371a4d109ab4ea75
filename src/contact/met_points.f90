!> Points at which deformed bodies are in each other and have no contact row: corners and edges that meet by their
!> motion.
!>
!> The check for penetration finds them. Each becomes a row, node to facet (Hallquist, Goudreau and Benson, Comput.
!> Methods Appl. Mech. Engrg. 51, 1985), with the gap and the normal before deformation, and the problem is solved
!> again. Where edges cross, it is a row of their closest points along their common normal: the normal of a facet beside
!> the edge would let the point slide off to the other facet.
module dotyk_contact_met_points
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: opposite_cosine, same_place, sharp_cosine
  use dotyk_contact_closest_point, only: closest_point_on_facet
  use dotyk_contact_edge_contacts, only: behind_edge, closest_on_edges, min_crossing
  use dotyk_contact_facet_set, only: facet_position_and_normal, facet_set_t
  use dotyk_contact_pair, only: contact_pair_t, pair_settings_t
  use dotyk_contact_pair_rows, only: replace_points, set_rows
  use dotyk_contact_penetration_tolerance, only: penetration_tolerance_t
  use dotyk_contact_point_contacts, only: point_contact_t, turn_about_axis
  use dotyk_contact_solid_boundary, only: solid_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private

  type, public :: inside_point_t  !! A point of one part that is too deep in another one.
    integer :: facet = 0  !! A facet of its part that has it.
    integer :: node(2) = 0  !! The nodes that it lies between, twice the same for a node (2).
    integer :: entered = 0  !! The facet that it came through where it has passed through the other part, or 0.
    real(dp) :: x(3) = 0  !! Its place after deformation (3) [length].
    integer :: edge = 0  !! The edge of the facet that it lies on, or 0.
  end type inside_point_t

  type, public :: met_point_t  !! A point of body a that is in body b.
    integer :: body_a = 0, body_b = 0  !! The bodies.
    !> Facets of their boundaries; that of b is the one that the point came through, 0 where a row is of no use.
    integer :: facet_a = 0, facet_b = 0
    logical :: is_behind = .false.  !! Whether the point started behind that facet: interference.
    real(dp) :: xi_a(2) = 0, xi_b(2) = 0  !! Reference coordinates of the two points on them (2) [].
    integer :: edge_a = 0, edge_b = 0  !! Edges of the facets where these cross, a being the lower body; 0 elsewhere.
    real(dp) :: x(3) = 0  !! The point after deformation (3) [length].
    real(dp) :: normal(3) = 0  !! Common normal of the edges after deformation, from a into b (3) [].
  end type met_point_t

  public :: add_met_points, discretize_points, is_same

  !> An edge leaves a body sideways: not through facets whose normals have less than this sine to it.
  real(dp), parameter :: sideways = sqrt(0.5_dp)
  !> A point that starts in a body may be behind the plane of a facet by more than its depth: along a right-angled wedge
  !> by this ratio.
  real(dp), parameter :: most_ratio = sqrt(2.0_dp)
  integer, parameter :: n_steps = 5  !! Newton steps to the closest point of a curved facet.

contains

  !> Add points of a that are in b.
  subroutine add_met_points(a, b, inside, tolerance, only_corners, met)
    type(solid_t), intent(in) :: a  !! The part of the points.
    type(solid_t), intent(in) :: b  !! The other part.
    type(inside_point_t), intent(in) :: inside(:)  !! The points (n).
    type(penetration_tolerance_t), intent(in) :: tolerance  !! What is known of the two.
    logical, intent(in) :: only_corners  !! Whether the two bodies have no contact pair.
    type(met_point_t), allocatable, intent(inout) :: met(:)  !! Points so far (n).
    type(solid_t) :: at_rest
    integer :: i
    if (size(inside) == 0) return
    associate (x => b%x0(:b%dimension, :))
      call at_rest%init(b%body, x, 0*x, b%surface, [(i, i=1, b%surface%n_facets)])
    end associate
    do i = 1, size(inside)
      met = [met, met_point(a, b, at_rest, inside(i), tolerance, only_corners)]
    end do
  end subroutine add_met_points

  !> A point of a that is in b, with the facet that it came through: the nearest of those in front of which it started.
  !> One that started behind all of them, by interference, leaves through the one it was least behind. It does not leave
  !> through facets that do not face it, and points of an edge not along it, as the next ones would take their place.
  !> Between bodies without a contact pair only corners count; other points have no facet of b.
  type(met_point_t) function met_point(a, b, at_rest, inside, tolerance, only_corners) result(new)
    type(solid_t), intent(in) :: a  !! The part of the point.
    type(solid_t), intent(in) :: b  !! The other part.
    type(solid_t), intent(in) :: at_rest  !! The same before deformation.
    type(inside_point_t), intent(in) :: inside  !! The point.
    type(penetration_tolerance_t), intent(in) :: tolerance  !! What is known of the two.
    logical, intent(in) :: only_corners  !! Whether the two bodies have no contact pair.
    real(dp), dimension(3) :: x0, at, normal, xu, xv, along
    real(dp) :: xi(2), least, square, depth, overlap, of_end, gap, behind
    real(dp), allocatable :: normals(:, :)
    integer :: near, hint, i, j, k, g, attempt
    logical :: counts
    associate (x => inside%x, nodes => inside%node)
      call closest_point_on_facet(a%set, inside%facet, x, new%xi_a, square)
      x0 = x - a%displacement_at(inside%facet, new%xi_a)
      ! That of an edge is the deeper one of its ends, too: where it leaves b at a side, the point is next to it.
      call at_rest%depth_of(x0, 0, overlap, near, xi)
      do j = 1, 2
        hint = near
        call at_rest%depth_of(a%x0(:, nodes(j)), hint, of_end, near, xi)
        overlap = max(overlap, of_end)
      end do
      call b%depth_of(x, 0, depth, near, xi)
      behind = huge(behind)
      if (inside%edge > 0) call cross_edges(a, b, inside, depth, near, behind, new)
      counts = .not. only_corners
      ! Each of the two may move by as much, against the other.
      if (only_corners) counts = are_corners(a, a%facets_around(nodes), b, near, x, 2*tolerance%moved)
      along = a%x(:, nodes(2)) - a%x(:, nodes(1))
      normals = transpose(a%normal(:, a%facets_around(nodes)))
      least = huge(least)
      ! Where it leaves sideways through none that faces it, as where the end of an edge comes in, through any.
      do attempt = 1, 2
        if (new%facet_b > 0 .or. inside%entered > 0) exit
        do i = 1, b%set%corners(near)
          associate (v => b%adjacency%vertex(i, near))
            do k = b%adjacency%start(v), b%adjacency%start(v + 1) - 1
              g = b%adjacency%facet(k)
              if (any([(a%is_flush(nodes(j), b, g), j=1, 2)])) cycle
              call closest_point_on_facet(b%set, g, x, xi, square)
              call facet_position_and_normal(b%set, g, xi, at, normal, xu, xv)
              ! Beside a face, as in a concave corner, the point is not below it.
              if (2*dot_product(normal, at - x) < sqrt(square)) cycle
              if (attempt == 1 .and. (norm2(cross(along, normal)) < sideways*norm2(along) .or. &
                                      minval(matmul(normals, b%normal(:, g))) > opposite_cosine)) cycle
              gap = dot_product(b%normal0(:, g), x0 - at + b%displacement_at(g, xi))
              gap = max(0.0_dp, -gap - b%roughness0(g) - same_place*b%set%size(g))
              ! Deeper than they overlap: the point started beside this facet. Near the side of b the overlap at rest is
              ! less than that along the normal.
              if (gap > most_ratio*merge(max(overlap, depth), 0.0_dp, overlap > 0)) cycle
              if (gap > behind .or. (gap >= behind .and. square >= least)) cycle
              behind = gap
              least = square
              new%facet_b = g
              new%xi_b = xi
            end do
          end associate
        end do
      end do
      if (inside%entered > 0) then
        new%facet_b = inside%entered
        call closest_point_on_facet(b%set, inside%entered, x, new%xi_b, square)
        behind = 0
      end if
    end associate
    new%x = inside%x
    new%body_a = a%body
    new%body_b = b%body
    new%is_behind = behind > 0
    new%facet_a = a%facet(inside%facet)
    if (counts .and. new%facet_b > 0) then
      new%facet_b = b%facet(new%facet_b)
    else
      new%facet_b = 0
    end if
    if (new%edge_a > 0 .and. new%facet_b > 0 .and. new%body_a > new%body_b) &
      new = met_point_t(new%body_b, new%body_a, new%facet_b, new%facet_a, new%is_behind, new%xi_b, new%xi_a, &
                        new%edge_b, new%edge_a, new%x, -new%normal)
  end function met_point

  !> The sharp edge of b that an edge of a has crossed, if there is one: near the point, such that each body is behind
  !> the plane of the two, and the one that is crossed least. The point is no deeper than that: a deeper one is on an
  !> edge that bends into a face.
  subroutine cross_edges(a, b, inside, depth, near, behind, new)
    type(solid_t), intent(in) :: a  !! The part of the point.
    type(solid_t), intent(in) :: b  !! The other part.
    type(inside_point_t), intent(in) :: inside  !! The point, on an edge.
    real(dp), intent(in) :: depth  !! Its depth in b [length].
    integer, intent(in) :: near  !! Facet of b that is nearest.
    real(dp), intent(inout) :: behind  !! How far the edges were behind each other at first, if there is one [length].
    type(met_point_t), intent(inout) :: new  !! Gets the edges, if there is one, and their closest points.
    real(dp), dimension(3) :: of_a, of_b, along, other, n
    real(dp) :: crossed, least, s, t, xi_a(2), xi_b(2)
    integer, allocatable :: list(:)
    integer :: other_g, g, i, k
    if (b%dimension < 3) return
    list = b%facets_around(b%surface%node(:b%set%corners(near), near))
    least = huge(least)
    associate (f => inside%facet, e => inside%edge)
      do i = 1, size(list)
        g = list(i)
        do k = 1, b%set%corners(g)
          other_g = b%adjacency%neighbour(k, g)
          if (other_g < g) cycle
          if (dot_product(b%normal0(:, g), b%normal0(:, other_g)) > sharp_cosine) cycle
          s = 0.5_dp
          t = 0.5_dp
          call closest_on_edges(a%set, f, e, b%set, g, k, s, t, xi_a, xi_b, of_a, of_b, along, other)
          if (min(s, t) < 0 .or. max(s, t) > 1) cycle
          n = cross(along, other)
          if (norm2(n) < min_crossing*norm2(along)*norm2(other)) cycle
          ! Into b: the edge of a is behind that of b.
          n = -sign(1/norm2(n), dot_product(n, b%normal(:, g) + b%normal(:, other_g)))*n
          crossed = dot_product(n, of_a - of_b)
          if (crossed < depth .or. crossed >= least) cycle
          if (.not. behind_edge(a%set, a%adjacency, f, e, n, -1.0_dp)) cycle
          if (.not. behind_edge(b%set, b%adjacency, g, k, -n, -1.0_dp)) cycle
          least = crossed
          new%edge_a = e
          new%xi_a = xi_a
          new%facet_b = g
          new%edge_b = k
          new%xi_b = xi_b
          new%normal = n
          behind = crossed - dot_product(n, a%displacement_at(f, xi_a) - b%displacement_at(g, xi_b)) - &
                   same_place*b%set%size(g)
        end do
      end do
    end associate
  end subroutine cross_edges

  !> Whether a point of a sharp edge of a is near a sharp edge of b.
  pure logical function are_corners(a, around, b, facet, x, most) result(are)
    type(solid_t), intent(in) :: a  !! The part of the point.
    integer, intent(in) :: around(:)  !! Its facets that share the point (n).
    type(solid_t), intent(in) :: b  !! The other part.
    integer, intent(in) :: facet  !! Its facet that is nearest.
    real(dp), intent(in) :: x(3)  !! The point after deformation (3) [length].
    real(dp), intent(in) :: most  !! Greatest distance of the two [length].
    real(dp) :: r(3), edge(3)
    integer, allocatable :: near(:)
    integer :: e, i, n, other
    are = .false.
    if (minval(matmul(transpose(a%normal0(:, around)), a%normal0(:, around))) > sharp_cosine) return
    near = b%facets_around(b%surface%node(:b%set%corners(facet), facet))
    do i = 1, size(near)
      n = b%set%corners(near(i))
      do e = 1, n
        other = b%adjacency%neighbour(e, near(i))
        if (other == 0) cycle
        if (dot_product(b%normal0(:, near(i)), b%normal0(:, other)) > sharp_cosine) cycle
        associate (first => b%x(:, b%surface%node(e, near(i))), &
                   second => b%x(:, b%surface%node(modulo(e, n) + 1, near(i))))
          r = x - first
          edge = (second - first)/max(norm2(second - first), tiny(1.0_dp))
          ! Edges of facets in the plane are their ends.
          if (n > 2) r = r - dot_product(r, edge)*edge
        end associate
        are = are .or. norm2(r) <= most
      end do
    end do
  end function are_corners

  !> Whether two points are the same.
  pure logical function is_same(p, q)
    type(met_point_t), intent(in) :: p, q  !! The points.
    is_same = p%body_a == q%body_a .and. p%body_b == q%body_b .and. p%facet_a == q%facet_a .and. &
      p%facet_b == q%facet_b .and. p%edge_a == q%edge_a .and. p%edge_b == q%edge_b
    if (is_same .and. p%edge_a == 0) is_same = .not. any(abs([p%xi_a - q%xi_a, p%xi_b - q%xi_b]) > 0)
  end function is_same

  !> A pair whose rows are such points, each by itself.
  subroutine discretize_points(mesh_a, surface_a, mesh_b, surface_b, settings, met, pair)
    type(body_mesh_t), intent(in) :: mesh_a  !! Mesh of body a.
    type(surface_t), intent(in) :: surface_a  !! Its boundary.
    type(body_mesh_t), intent(in) :: mesh_b  !! Mesh of body b.
    type(surface_t), intent(in) :: surface_b  !! Its boundary.
    type(pair_settings_t), intent(in) :: settings  !! Settings of the pair.
    type(met_point_t), intent(in) :: met(:)  !! Points of the two bodies (n).
    type(contact_pair_t), intent(out) :: pair  !! The pair.
    type(point_contact_t) :: contact(size(met))
    type(facet_set_t) :: set_a, set_b
    integer :: i
    call set_a%init_polynomials(mesh_a%x, surface_a)
    call set_b%init_polynomials(mesh_b%x, surface_b)
    do i = 1, size(met)
      contact(i) = contact_before(set_a, set_b, met(i))
    end do
    if (settings%axisymmetric) call turn_about_axis(contact)
    pair%dimension = mesh_a%dimension
    associate (d => pair%dimension)
      allocate (pair%position(d, 0), pair%normal(d, 0), pair%xi_a(d - 1, 0), pair%xi_b(d - 1, 0), pair%weight(0), &
                pair%gap(0), pair%facet_a(0), pair%facet_b(0))
    end associate
    call replace_points([logical ::], contact, pair)
    pair%name = settings%name
    pair%body_a = settings%body_a
    pair%body_b = settings%body_b
    pair%theta = settings%theta
    call set_rows(division_t(), settings%axisymmetric, mesh_a, surface_a, spread(0.0_dp, 1, 3), size(met), pair)
    allocate (pair%row_theta(pair%n_rows), source=pair%theta)
  end subroutine discretize_points

  !> The contact of a point before deformation: gap and normal at the closest point of the facet, or of its
  !> continuation, so that the forces of both sides have one line of action.
  function contact_before(set_a, set_b, met) result(contact)
    type(facet_set_t), intent(in) :: set_a  !! Facets of body a.
    type(facet_set_t), intent(in) :: set_b  !! Facets of body b.
    type(met_point_t), intent(in) :: met  !! The point.
    type(point_contact_t) :: contact
    real(dp), dimension(3) :: x, y, n, xu, xv
    real(dp) :: r(2), determinant
    integer :: step
    contact%facet_a = met%facet_a
    contact%facet_b = met%facet_b
    contact%xi_a = met%xi_a
    contact%xi_b = met%xi_b
    if (met%edge_a > 0) then
      call between_edges(set_a, set_b, met, contact)
      return
    end if
    call facet_position_and_normal(set_a, met%facet_a, met%xi_a, x, n, xu, xv)
    select case (set_a%corners(met%facet_a))
    case (2)
      contact%weight = norm2(xu)
    case (3)
      contact%weight = norm2(cross(xu, xv))/6
    case default
      contact%weight = norm2(cross(xu, xv))
    end select
    do step = 0, n_steps
      call facet_position_and_normal(set_b, met%facet_b, contact%xi_b, y, n, xu, xv)
      if (step == n_steps) exit
      r = [dot_product(x - y, xu), dot_product(x - y, xv)]
      if (set_b%corners(met%facet_b) == 2) then
        contact%xi_b(1) = contact%xi_b(1) + r(1)/dot_product(xu, xu)
      else
        determinant = dot_product(xu, xu)*dot_product(xv, xv) - dot_product(xu, xv)**2
        contact%xi_b = contact%xi_b + [dot_product(xv, xv)*r(1) - dot_product(xu, xv)*r(2), &
                                       dot_product(xu, xu)*r(2) - dot_product(xu, xv)*r(1)]/determinant
      end if
    end do
    contact%position = x
    contact%normal = -n
    contact%gap = dot_product(n, x - y)
    ! Bodies without interference are apart, whatever the plane of a facet beside the point says.
    if (.not. met%is_behind) contact%gap = max(0.0_dp, contact%gap)
  end function contact_before

  !> The contact of two edges before deformation: their closest points and common normal.
  subroutine between_edges(set_a, set_b, met, contact)
    type(facet_set_t), intent(in) :: set_a  !! Facets of body a.
    type(facet_set_t), intent(in) :: set_b  !! Facets of body b.
    type(met_point_t), intent(in) :: met  !! The point.
    type(point_contact_t), intent(inout) :: contact  !! Contact, with its facets.
    real(dp), dimension(3) :: y, along_a, along_b, n
    real(dp) :: s, t
    s = 0.5_dp
    t = 0.5_dp
    call closest_on_edges(set_a, met%facet_a, met%edge_a, set_b, met%facet_b, met%edge_b, s, t, contact%xi_a, &
                          contact%xi_b, contact%position, y, along_a, along_b)
    n = cross(along_a, along_b)
    contact%weight = norm2(n)/4
    contact%normal = sign(1/norm2(n), dot_product(n, met%normal))*n
    contact%gap = dot_product(contact%normal, y - contact%position)
    if (.not. met%is_behind) contact%gap = max(0.0_dp, contact%gap)
  end subroutine between_edges
end module dotyk_contact_met_points
