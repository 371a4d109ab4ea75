!> Smooth sheets of a contact surface: sharp edges, and at each vertex the facets that belong together.
!>
!> A contact surface may wrap around the edges of a body. At a vertex of such an edge there is no common normal and no
!> common gap: each sheet has contact conditions of its own, as node normals of supports have one per face. An edge is
!> sharp where the normals on its two sides differ by more than 50 degrees; or by more than 25 degrees, where the
!> surface beside the edge is less curved than that and the geometry does not say that both sides are one face. A coarse
!> mesh of a cylinder, whose facets all meet at the same angle, has no sharp edges.
module dotyk_contact_smooth_sheets
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: pi, same_place, sharp_cosine
  use dotyk_contact_adjacency, only: adjacency_t, corner_of, edges_of_corner
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, kind_nodes
  use dotyk_mesh_facet, only: facet_geometry
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private
  public :: split_sheets, sheet_numbers, sharp_edges, is_smooth_edge, facets_on_chords, facet_entity

  !> Edges between facets that differ by more than this are sharp [rad].
  real(dp), parameter :: always_sharp = 50*pi/180
  !> Edges between facets that differ by less than this are never sharp for rows: two rows at a vertex with nearly equal
  !> normals would be almost dependent [rad].
  real(dp), parameter :: never_sharp = 25*pi/180
  !> An edge is sharp where it turns by more than this multiple of the turns beside it, and by this angle [rad] more.
  real(dp), parameter :: turn_ratio = 2, turn_margin = 2*pi/180
  real(dp), parameter :: kink = pi/180  !! A smooth edge has a kink where it turns by more than this [rad].

contains

  !> Find the sheets of a surface.
  subroutine split_sheets(x, surface)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(inout) :: surface  !! Surface; its `sheet` is set.
    type(adjacency_t) :: adjacency
    type(facet_set_t) :: set
    logical, allocatable :: sharp(:, :)
    integer :: v, k, f
    call find_adjacency(surface, adjacency, set)
    call sharp_edges(x, surface, adjacency, sharp)
    if (allocated(surface%sheet)) deallocate (surface%sheet)
    allocate (surface%sheet(4, surface%n_facets), source=0)
    where (adjacency%vertex > 0) surface%sheet = 1
    do v = 1, size(adjacency%start) - 1
      do k = adjacency%start(v), adjacency%start(v + 1) - 1
        f = adjacency%facet(k)
        if (.not. any(sharp(edges_of_corner(set%corners(f), corner_of(set, adjacency, v, f)), f))) cycle
        call sheets_at_vertex(set, adjacency, sharp, v, surface%sheet)
        exit
      end do
    end do
  end subroutine split_sheets

  !> Number the sheets of a surface: facets that edges join which are not sharp.
  subroutine sheet_numbers(x, surface, adjacency, number)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    integer, intent(out) :: number(:)  !! Sheet of each facet (n_facets).
    logical, allocatable :: sharp(:, :)
    integer :: stack(surface%n_facets), e, f, g, n, n_stack
    call sharp_edges(x, surface, adjacency, sharp)
    number = 0
    n = 0
    do f = 1, surface%n_facets
      if (number(f) > 0) cycle
      n = n + 1
      number(f) = n
      stack(1) = f
      n_stack = 1
      do while (n_stack > 0)
        g = stack(n_stack)
        n_stack = n_stack - 1
        do e = 1, 4
          associate (other => adjacency%neighbour(e, g))
            if (other == 0 .or. sharp(e, g)) cycle
            if (number(other) > 0) cycle
            number(other) = n
            n_stack = n_stack + 1
            stack(n_stack) = other
          end associate
        end do
      end do
    end do
  end subroutine sheet_numbers

  !> Sharp edges of a surface.
  subroutine sharp_edges(x, surface, adjacency, sharp)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    !> Edges that are sharp; the boundary of the surface is not (4, n_facets).
    logical, allocatable, intent(out) :: sharp(:, :)
    real(dp), allocatable :: turn(:, :)
    call edge_turns(x, surface, adjacency, turn)
    call classify_edges(surface, adjacency, turn, never_sharp, sharp)
  end subroutine sharp_edges

  !> Neighbours of the facets of a surface.
  subroutine find_adjacency(surface, adjacency, corners)
    type(surface_t), intent(in) :: surface  !! Surface.
    type(adjacency_t), intent(out) :: adjacency  !! Neighbours.
    type(facet_set_t), intent(out), optional :: corners  !! Corners of the facets; nothing else of the facets is set.
    type(facet_set_t) :: set
    type(element_kind_t) :: kind
    integer :: f
    set%n = surface%n_facets
    set%dimension = surface%dimension
    allocate (set%corners(set%n), set%corner_node(4, set%n))
    set%corner_node = 0
    do f = 1, set%n
      kind = element_kind(surface%kind(f))
      set%corners(f) = kind%n_corners
      set%corner_node(1:kind%n_corners, f) = surface%node(1:kind%n_corners, f)
    end do
    call adjacency%init(set)
    if (present(corners)) corners = set
  end subroutine find_adjacency

  !> Tell sharp from smooth edges by their angles and entities.
  subroutine classify_edges(surface, adjacency, turn, least_turn, sharp)
    type(surface_t), intent(in) :: surface  !! Surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: turn(:, :)  !! Angles at the edges (4, n_facets) [rad].
    real(dp), intent(in) :: least_turn  !! Edges that turn by less are smooth [rad].
    logical, allocatable, intent(out) :: sharp(:, :)  !! Edges that are sharp (4, n_facets).
    real(dp) :: other_turn
    integer :: f, g, e, entity_f, entity_g
    allocate (sharp(4, surface%n_facets), source=.false.)
    do f = 1, surface%n_facets
      do e = 1, 4
        g = adjacency%neighbour(e, f)
        if (g == 0 .or. .not. turn(e, f) > least_turn) cycle
        entity_f = facet_entity(surface, f)
        entity_g = facet_entity(surface, g)
        if (entity_f > 0 .and. entity_f == entity_g) then
          sharp(e, f) = turn(e, f) > always_sharp
        else
          other_turn = max(turn_beside(surface, adjacency, turn, f, g), turn_beside(surface, adjacency, turn, g, f))
          sharp(e, f) = is_sharp_turn(turn(e, f), other_turn)
        end if
      end do
    end do
  end subroutine classify_edges

  !> Whether an edge is sharp, by the angles at it and beside it.
  elemental logical function is_sharp_turn(turn, beside)
    real(dp), intent(in) :: turn  !! Angle between the normals on the two sides of the edge [rad].
    real(dp), intent(in) :: beside  !! Greatest angle at the smooth edges beside it [rad].
    is_sharp_turn = turn > always_sharp .or. turn > turn_ratio*beside + turn_margin
  end function is_sharp_turn

  !> Geometric entity of a facet, 0 if unknown.
  pure integer function facet_entity(surface, f)
    type(surface_t), intent(in) :: surface  !! Surface.
    integer, intent(in) :: f  !! Facet number.
    facet_entity = 0
    if (allocated(surface%entity)) facet_entity = surface%entity(f)
  end function facet_entity

  !> Quadratic facets whose mid-side nodes lie on the chords of a curved surface, which therefore has kinks at its
  !> smooth edges: their mid-side nodes carry no information about the shape. Plane facets next to them count too, up to
  !> sharp edges.
  subroutine facets_on_chords(x, surface, on_chords)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    logical, intent(out) :: on_chords(:)  !! Such facets (n_facets).
    type(adjacency_t) :: adjacency
    logical :: straight(surface%n_facets)
    logical, allocatable :: sharp(:, :)
    real(dp), allocatable :: turn(:, :)
    integer, allocatable :: list(:)
    integer :: f, g, e, k
    on_chords = surface%order_elevated
    if (surface%order_elevated) return
    straight = [(is_straight(surface%kind(f), x(:, surface%node(1:kind_nodes(surface%kind(f)), f))), &
                 f=1, surface%n_facets)]
    if (.not. any(straight)) return
    call find_adjacency(surface, adjacency)
    call edge_turns(x, surface, adjacency, turn)
    call classify_edges(surface, adjacency, turn, 0.0_dp, sharp)
    list = pack([(f, f=1, surface%n_facets)], straight .and. any(turn > kink .and. .not. sharp, dim=1))
    on_chords(list) = .true.
    k = 0
    do while (k < size(list))
      k = k + 1
      do e = 1, 4
        g = adjacency%neighbour(e, list(k))
        if (g == 0 .or. sharp(e, list(k))) cycle
        if (on_chords(g) .or. .not. straight(g)) cycle
        on_chords(g) = .true.
        list = [list, g]
      end do
    end do
  end subroutine facets_on_chords

  !> Whether a facet has mid-side nodes, all in the middle of their chords.
  pure logical function is_straight(kind, x)
    integer, intent(in) :: kind  !! Element kind of the facet.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the facet (dimension, n_nodes) [length].
    type(element_kind_t) :: properties
    integer :: i, n
    properties = element_kind(kind)
    n = properties%n_corners
    is_straight = size(x, 2) > n
    if (.not. is_straight) return
    do i = 1, merge(1, n, n == 2)
      associate (first => x(:, i), last => x(:, modulo(i, n) + 1))
        is_straight = is_straight .and. norm2(x(:, n + i) - (first + last)/2) <= same_place*norm2(last - first)
      end associate
    end do
  end function is_straight

  !> Angle between the facets on the two sides of each edge, at its middle.
  subroutine edge_turns(x, surface, adjacency, turn)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), allocatable, intent(out) :: turn(:, :)  !! Angles, 0 at the boundary of the surface (4, n_facets) [rad].
    real(dp), allocatable :: normal(:, :, :)
    integer :: f, g, e, back, d, n
    d = surface%dimension
    n = surface%n_facets
    allocate (normal(d, 4, n), source=0.0_dp)
    allocate (turn(4, n), source=0.0_dp)
    do f = 1, n
      do e = 1, count(adjacency%vertex(:, f) > 0)
        call edge_normal(d, surface%kind(f), count(adjacency%vertex(:, f) > 0), e, &
                         x(:, surface%node(1:kind_nodes(surface%kind(f)), f)), normal(:, e, f))
      end do
    end do
    do f = 1, n
      do e = 1, 4
        g = adjacency%neighbour(e, f)
        if (g == 0) cycle
        back = findloc(adjacency%neighbour(:, g), f, dim=1)
        if (back == 0) cycle
        turn(e, f) = 2*asin(min(1.0_dp, norm2(normal(:, e, f) - normal(:, back, g))/2))
      end do
    end do
  end subroutine edge_turns

  !> Normal of a facet at the middle of an edge; in two dimensions at an end.
  pure subroutine edge_normal(d, kind, corners, edge, x, normal)
    integer, intent(in) :: d  !! Dimension of space.
    integer, intent(in) :: kind  !! Element kind of the facet.
    integer, intent(in) :: corners  !! Number of its corners.
    integer, intent(in) :: edge  !! Edge number.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the facet (d, n_nodes) [length].
    real(dp), intent(out) :: normal(:)  !! Unit normal (d) [].
    real(dp), parameter :: on_triangle(2, 3) = reshape([0.5_dp, 0.0_dp, 0.5_dp, 0.5_dp, 0.0_dp, 0.5_dp], [2, 3])
    real(dp), parameter :: on_square(2, 4) = &
      reshape([0.0_dp, -1.0_dp, 1.0_dp, 0.0_dp, 0.0_dp, 1.0_dp, -1.0_dp, 0.0_dp], [2, 4])
    real(dp) :: xi(2), position(d), jacobian
    select case (corners)
    case (2)
      xi = merge(-1.0_dp, 1.0_dp, edge == 1)
    case (3)
      xi = on_triangle(:, edge)
    case default
      xi = on_square(:, edge)
    end select
    call facet_geometry(kind, d, x, xi(1:d - 1), position, normal, jacobian)
  end subroutine edge_normal

  !> Greatest angle, below the one that is always sharp, at the edges of a facet towards facets of its own entity,
  !> another facet excepted [rad].
  pure real(dp) function turn_beside(surface, adjacency, turn, f, except) result(greatest)
    type(surface_t), intent(in) :: surface  !! Surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: turn(:, :)  !! Angles at the edges (4, n_facets) [rad].
    integer, intent(in) :: f  !! Facet number.
    integer, intent(in) :: except  !! Facet whose edge does not count.
    integer :: e, g
    greatest = 0
    do e = 1, 4
      g = adjacency%neighbour(e, f)
      if (g == 0 .or. g == except .or. turn(e, f) > always_sharp) cycle
      if (facet_entity(surface, g) == facet_entity(surface, f)) greatest = max(greatest, turn(e, f))
    end do
  end function turn_beside

  !> Number the sheets at one vertex in the order of their first facets: facets with a common smooth edge there belong
  !> to one sheet.
  pure subroutine sheets_at_vertex(set, adjacency, sharp, v, sheet)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface; only their corners are needed.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    logical, intent(in) :: sharp(:, :)  !! Sharp edges (4, n_facets).
    integer, intent(in) :: v  !! Vertex number.
    !> Sheets at the corners of the facets; those at the vertex are set (4, n_facets).
    integer, intent(inout) :: sheet(:, :)
    integer, allocatable :: group(:), number(:)
    integer :: i, j, k, n, f, e, edge(2), corner
    associate (around => adjacency%facet(adjacency%start(v):adjacency%start(v + 1) - 1))
      n = size(around)
      allocate (group, source=[(i, i=1, n)])
      ! The least number propagates along smooth edges.
      do k = 1, n
        do i = 1, n
          f = around(i)
          edge = edges_of_corner(set%corners(f), corner_of(set, adjacency, v, f))
          do e = 1, 2
            if (sharp(edge(e), f) .or. adjacency%neighbour(edge(e), f) == 0) cycle
            j = findloc(around, adjacency%neighbour(edge(e), f), dim=1)
            if (j == 0) cycle
            group([i, j]) = minval(group([i, j]))
          end do
        end do
      end do
      allocate (number(n), source=0)
      k = 0
      do i = 1, n
        if (number(group(i)) == 0) then
          k = k + 1
          number(group(i)) = k
        end if
        corner = corner_of(set, adjacency, v, around(i))
        sheet(corner, around(i)) = number(group(i))
      end do
    end associate
  end subroutine sheets_at_vertex

  !> Whether the edge between two facets belongs to one smooth sheet: they belong to one known entity, or the surface
  !> beside the edge turns on in the same sense by about as much. Two facets alone do not tell a curve from an edge.
  pure logical function is_smooth_edge(adjacency, normal, entity, in_plane, f, g) result(is_smooth)
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: normal(:, :)  !! Mean normals of the facets (3, n) [].
    integer, intent(in) :: entity(:)  !! Geometric entity of each facet, 0 if unknown (n).
    logical, intent(in) :: in_plane(:)  !! Facets of planes, as far as they are known (n).
    integer, intent(in) :: f  !! Facet on one side.
    integer, intent(in) :: g  !! Facet on the other side.
    real(dp) :: turn
    turn = angle(normal(:, f), normal(:, g))
    if (entity(f) > 0 .and. entity(f) == entity(g)) then
      is_smooth = turn <= always_sharp
      return
    end if
    is_smooth = dot_product(normal(:, f), normal(:, g)) > sharp_cosine .or. (entity(f) > 0 .and. entity(g) > 0)
    ! What is beside the edge matters where the turn alone would be sharp.
    if (.not. is_smooth .or. .not. is_sharp_turn(turn, 0.0_dp)) return
    is_smooth = .not. is_sharp_turn(turn, max(turn_on(f, g), turn_on(g, f)))

  contains

    !> Greatest angle between a facet and those of its entity around its vertices that are turned away from another
    !> facet; from a plane to a plane does not count [rad].
    pure real(dp) function turn_on(facet, from)
      integer, intent(in) :: facet  !! Facet number.
      integer, intent(in) :: from  !! The other facet.
      real(dp) :: further
      integer :: c, k, v, other
      turn_on = 0
      do c = 1, 4
        v = adjacency%vertex(c, facet)
        if (v == 0) exit
        do k = adjacency%start(v), adjacency%start(v + 1) - 1
          other = adjacency%facet(k)
          if (entity(other) /= entity(facet)) cycle
          if (in_plane(other) .and. (in_plane(facet) .or. in_plane(from))) cycle
          further = angle(normal(:, facet), normal(:, other))
          if (angle(normal(:, from), normal(:, other)) > max(turn, further)) turn_on = max(turn_on, further)
        end do
      end do
    end function turn_on
  end function is_smooth_edge

  !> Angle between unit vectors [rad].
  pure real(dp) function angle(a, b)
    real(dp), intent(in) :: a(3)  !! First vector (3) [].
    real(dp), intent(in) :: b(3)  !! Second vector (3) [].
    angle = 2*asin(min(1.0_dp, norm2(a - b)/2))
  end function angle
end module dotyk_contact_smooth_sheets
