!> The closed boundary of one part of a body before and after deformation: signed distances of points to it, and the
!> depth that its facets cannot resolve.
!>
!> A part is a connected component of a body. Nodes are numbered within the boundary. Two dimensions are three with
!> z = 0. The sign of a distance follows from the normal at the closest point; at edges and vertices from the sum of the
!> normals around, weighted with their angles (Baerentzen and Aanaes, IEEE Trans. Vis. Comput. Graph. 11, 2005).
!>
!> Roughness is the depth that facets cannot resolve. Facets that meet at a smooth edge (smooth_sheets.f90) before
!> deformation are parts of one smooth surface. An arc over a facet of width h that turns by b has the height h b/8;
!> contact conditions that hold in the mean over the facets around a vertex leave penetrations of this order, where the
!> surface is curved and where deformation bends it.
module dotyk_contact_solid_boundary
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: opposite_cosine, no_offset, same_place
  use dotyk_contact_adjacency, only: adjacency_t, corner_of
  use dotyk_contact_bounding_volume_tree, only: bounding_volume_tree_t
  use dotyk_contact_closest_point, only: closest_point_on_facet, edges_at
  use dotyk_contact_facet_set, only: corner_coordinates, corner_normal, facet_position_and_normal, facet_set_t
  use dotyk_contact_smooth_sheets, only: facet_entity, is_smooth_edge
  use dotyk_contact_tree_search, only: box_neighbourhood_t, facets_in_region, nearest_facet
  use dotyk_mesh_element, only: kind_nodes, max_facet_nodes, shape_functions
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  type, public :: solid_t  !! Boundary of one part.
    integer :: body = 0  !! Index of the body.
    integer :: dimension = 0  !! Dimension of space, 2 or 3.
    integer :: n_nodes = 0  !! Number of nodes.
    integer, allocatable :: node(:)  !! Body-local number of each node (n_nodes).
    real(dp), allocatable :: x0(:, :)  !! Positions before deformation (3, n_nodes) [length].
    real(dp), allocatable :: x(:, :)  !! Positions after deformation (3, n_nodes) [length].
    type(surface_t) :: surface  !! Facets, with nodes of the boundary.
    integer, allocatable :: facet(:)  !! Their numbers in the boundary of the body (n_facets).
    type(facet_set_t) :: set  !! Deformed facets.
    type(bounding_volume_tree_t) :: tree  !! Bounding-volume tree of the deformed facets.
    type(adjacency_t) :: adjacency  !! Neighbours of the facets.
    integer, allocatable :: first(:)  !! Facets at node i are around(first(i):first(i+1)-1) (n_nodes + 1).
    integer, allocatable :: around(:)  !! These facets.
    !> Unit outward normals at the centres of the facets before deformation (3, n_facets) [].
    real(dp), allocatable :: normal0(:, :)
    real(dp), allocatable :: normal(:, :)  !! The same after deformation (3, n_facets) [].
    !> Depth that each facet cannot resolve: twice the height of the arc over it, before deformation and after
    !> (n_facets) [length].
    real(dp), allocatable :: roughness0(:), roughness(:)
    !> Greatest curvature around each facet before deformation (n_facets) [1/length].
    real(dp), allocatable :: curvature(:)
  contains
    procedure :: init => solid_init
    procedure :: depth_of => solid_depth_of
    procedure :: depth_beside_flush => solid_depth_beside_flush
    procedure :: displacement_at => solid_displacement_at
    procedure :: facets_around => solid_facets_around
    procedure :: facets_at => solid_facets_at
    procedure :: is_flush => solid_is_flush
    procedure :: is_in_plane => solid_is_in_plane
    procedure :: outward_normal => solid_outward_normal
  end type solid_t

  !> Two faces are flush before deformation where the angle of their normals has at least this cosine.
  real(dp), parameter :: flush_cosine = 0.999_dp
  !> Roughness over curvature times width^2: twice the height of the arc [].
  real(dp), parameter :: roughness_factor = 0.25_dp

contains

  !> Set up from some facets of the boundary of a body.
  subroutine solid_init(self, body, x, displacement, boundary, chosen)
    class(solid_t), intent(out) :: self
    integer, intent(in) :: body  !! Index of the body.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the body (dimension, n) [length].
    real(dp), intent(in) :: displacement(:, :)  !! Their displacements (dimension, n) [length].
    type(surface_t), intent(in) :: boundary  !! Boundary of the body, with nodes of the body.
    integer, intent(in) :: chosen(:)  !! Facets of the part (n_facets).
    integer, allocatable :: number(:)
    integer :: f, i, d, n
    self%body = body
    d = size(x, 1)
    self%dimension = d
    self%facet = chosen
    associate (surface => self%surface)
      n = size(chosen)
      surface%dimension = d
      surface%n_facets = n
      surface%order_elevated = boundary%order_elevated
      surface%kind = boundary%kind(chosen)
      if (allocated(boundary%entity)) surface%entity = boundary%entity(chosen)
      allocate (surface%node(max_facet_nodes, n), number(0:size(x, 2)))
      number = 0
      do f = 1, n
        number(boundary%node(1:kind_nodes(surface%kind(f)), chosen(f))) = 1
      end do
      self%n_nodes = sum(number)
      allocate (self%node(self%n_nodes), self%x0(3, self%n_nodes), self%x(3, self%n_nodes))
      self%x0 = 0
      self%x = 0
      n = 0
      do i = 1, size(x, 2)
        if (number(i) == 0) cycle
        n = n + 1
        number(i) = n
        self%node(n) = i
        self%x0(1:d, n) = x(:, i)
        self%x(1:d, n) = x(:, i) + displacement(:, i)
      end do
      do f = 1, surface%n_facets
        surface%node(:, f) = number(boundary%node(:, chosen(f)))
      end do
    end associate
    call self%set%init(self%x(1:d, :), self%surface)
    call self%tree%init(self%set)
    call renumber(self)
    call self%adjacency%init(self%set)
    call collect_around(self)
    call measure_roughness(self%surface, self%set, self%adjacency, self%x0, self%normal0, self%normal, &
                           self%roughness0, self%roughness, self%curvature)
  end subroutine solid_init

  !> Number the nodes in the order of the tree: the facet near one node is probably near to the next one, too.
  pure subroutine renumber(self)
    type(solid_t), intent(inout) :: self  !! Boundary; its nodes are renumbered.
    integer :: number(0:self%n_nodes), old(self%n_nodes), f, i, k, n
    number = 0
    n = 0
    do k = 1, size(self%tree%order)
      f = self%tree%order(k)
      do i = 1, kind_nodes(self%surface%kind(f))
        associate (node => self%surface%node(i, f))
          if (number(node) > 0) cycle
          n = n + 1
          number(node) = n
          old(n) = node
        end associate
      end do
    end do
    self%node = self%node(old)
    self%x0 = self%x0(:, old)
    self%x = self%x(:, old)
    do f = 1, self%surface%n_facets
      self%surface%node(:, f) = number(self%surface%node(:, f))
      self%set%corner_node(:, f) = number(self%set%corner_node(:, f))
    end do
  end subroutine renumber

  !> Facets at each node, mid-side nodes included.
  pure subroutine collect_around(self)
    type(solid_t), intent(inout) :: self  !! Boundary; its lists are set.
    integer, allocatable :: next(:)
    integer :: f, i, k
    allocate (self%first(self%n_nodes + 1), next(self%n_nodes))
    next = 0
    do f = 1, self%surface%n_facets
      do i = 1, kind_nodes(self%surface%kind(f))
        next(self%surface%node(i, f)) = next(self%surface%node(i, f)) + 1
      end do
    end do
    self%first(1) = 1
    do i = 1, self%n_nodes
      self%first(i + 1) = self%first(i) + next(i)
      next(i) = self%first(i)
    end do
    allocate (self%around(self%first(self%n_nodes + 1) - 1))
    do f = 1, self%surface%n_facets
      do i = 1, kind_nodes(self%surface%kind(f))
        k = self%surface%node(i, f)
        self%around(next(k)) = f
        next(k) = next(k) + 1
      end do
    end do
  end subroutine collect_around

  !> Depth of a point below the deformed boundary: its distance, negative outside.
  pure subroutine solid_depth_of(self, x, hint, depth, facet, xi)
    class(solid_t), intent(in) :: self
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    integer, intent(in) :: hint  !! A facet that is probably near, or 0.
    real(dp), intent(out) :: depth  !! Depth [length].
    integer, intent(out) :: facet  !! Facet of the closest point.
    real(dp), intent(out) :: xi(2)  !! Reference coordinates of the closest point (2) [].
    real(dp) :: square, position(3), normal(3)
    call nearest_facet(self%tree, self%set, x, [0.0_dp, 0.0_dp, 1.0_dp], .true., 0.0_dp, hint, facet, xi, square)
    call self%outward_normal(facet, xi, position, normal)
    depth = sign(sqrt(square), -dot_product(x - position, normal))
  end subroutine solid_depth_of

  !> Depth of a point of another part below the nearest of the facets that were not flush with it.
  pure subroutine solid_depth_beside_flush(self, x, other, nodes, faces_only, most, depth, facet, xi)
    class(solid_t), intent(in) :: self
    real(dp), intent(in) :: x(3)  !! Point (3) [length].
    class(solid_t), intent(in) :: other  !! The other part.
    integer, intent(in) :: nodes(:)  !! Its node, or the nodes that the point lies between (n).
    logical, intent(in) :: faces_only  !! Whether only facets count that face one at these nodes.
    real(dp), intent(in) :: most  !! Distance up to which facets are looked for [length].
    real(dp), intent(out) :: depth  !! Depth, negative outside; `most` where there is no facet [length].
    integer, intent(out) :: facet  !! Facet of the closest point; 0 where there is none.
    real(dp), intent(out) :: xi(2)  !! Its reference coordinates (2) [].
    integer, allocatable :: near(:)
    real(dp), allocatable :: normals(:, :)
    real(dp) :: square, trial, trial_xi(2), position(3), normal(3), xu(3), xv(3)
    integer :: i, k
    normals = other%normal(:, other%facets_around(nodes))
    call facets_in_region(self%tree, box_neighbourhood_t(x, x, most), near)
    square = most**2
    facet = 0
    xi = 0
    do k = 1, size(near)
      if (faces_only .and. minval(matmul(self%normal(:, near(k)), normals)) > opposite_cosine) cycle
      if (any([(other%is_flush(nodes(i), self, near(k)), i=1, size(nodes))])) cycle
      call closest_point_on_facet(self%set, near(k), x, trial_xi, trial)
      if (trial > square) cycle
      square = trial
      facet = near(k)
      xi = trial_xi
    end do
    depth = sqrt(square)
    if (facet == 0) return
    call facet_position_and_normal(self%set, facet, xi, position, normal, xu, xv)
    depth = sign(depth, dot_product(position - x, normal))
  end subroutine solid_depth_beside_flush

  !> Outward direction at a point of a facet; the mean of the facets around at edges and vertices.
  pure subroutine solid_outward_normal(self, facet, xi, position, normal)
    class(solid_t), intent(in) :: self
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) [].
    real(dp), intent(out) :: position(3)  !! Position (3) [length].
    real(dp), intent(out) :: normal(3)  !! Outward direction, not normalized (3) [].
    real(dp) :: other_xi(2), other_position(3), other_normal(3), xu(3), xv(3), square
    integer, allocatable :: shared(:)
    integer :: k, vertex
    call facet_position_and_normal(self%set, facet, xi, position, normal, xu, xv)
    if (is_inside(self%set%corners(facet), xi)) return
    call self%facets_at(facet, xi, shared, vertex)
    if (vertex > 0) normal = 0
    do k = 1, size(shared)
      if (vertex > 0) then
        normal = normal + normal_by_angle(self%set, self%x, shared(k), &
                                          corner_of(self%set, self%adjacency, vertex, shared(k)))
      else if (shared(k) /= facet) then
        call closest_point_on_facet(self%set, shared(k), position, other_xi, square)
        call facet_position_and_normal(self%set, shared(k), other_xi, other_position, other_normal, xu, xv)
        normal = normal + other_normal
      end if
    end do
  end subroutine solid_outward_normal

  !> Whether a point of a facet is on none of its edges.
  pure logical function is_inside(corners, xi)
    integer, intent(in) :: corners  !! Number of corners.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) [].
    integer :: n, edges(2)
    call edges_at(corners, xi, no_offset, n, edges)
    is_inside = n == 0
  end function is_inside

  !> Facets that share a point: that of the point, on an edge both, at a vertex all around.
  pure subroutine solid_facets_at(self, facet, xi, shared, vertex)
    class(solid_t), intent(in) :: self
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) [].
    integer, allocatable, intent(out) :: shared(:)  !! The facets (n).
    integer, intent(out) :: vertex  !! The vertex, 0 where the point is none.
    integer :: n, edges(2)
    call edges_at(self%set%corners(facet), xi, no_offset, n, edges)
    call self%adjacency%facets_at(self%set%corners(facet), facet, n, edges, shared, vertex)
  end subroutine solid_facets_at

  !> Facets around some nodes, not each once (n).
  pure function solid_facets_around(self, nodes) result(list)
    class(solid_t), intent(in) :: self
    integer, intent(in) :: nodes(:)  !! Nodes of the boundary (any number).
    integer, allocatable :: list(:)
    integer :: i
    list = [(self%around(self%first(nodes(i)):self%first(nodes(i) + 1) - 1), i=1, size(nodes))]
  end function solid_facets_around

  !> Unit normal of a facet at one of its corners, times the angle of the facet there [rad].
  pure function normal_by_angle(set, x, facet, corner) result(normal)
    type(facet_set_t), intent(in) :: set  !! Facets.
    real(dp), intent(in) :: x(:, :)  !! Positions of the nodes (3, n_nodes) [length].
    integer, intent(in) :: facet  !! Facet number.
    integer, intent(in) :: corner  !! Corner.
    real(dp) :: normal(3)  !! The product (3) [rad].
    real(dp) :: position(3), xu(3), xv(3), a(3), b(3)
    integer :: n
    n = set%corners(facet)
    call facet_position_and_normal(set, facet, corner_coordinates(n, corner), position, normal, xu, xv)
    if (n == 2) return
    a = x(:, set%corner_node(modulo(corner, n) + 1, facet)) - x(:, set%corner_node(corner, facet))
    b = x(:, set%corner_node(modulo(corner - 2, n) + 1, facet)) - x(:, set%corner_node(corner, facet))
    normal = normal*acos(max(-1.0_dp, min(1.0_dp, dot_product(a, b)/max(norm2(a)*norm2(b), tiny(1.0_dp)))))
  end function normal_by_angle

  !> Displacement of a point of a facet (3) [length].
  pure function solid_displacement_at(self, facet, xi) result(u)
    class(solid_t), intent(in) :: self
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) [].
    real(dp) :: u(3)
    real(dp) :: shape(max_facet_nodes)
    integer :: n, i, k
    n = kind_nodes(self%surface%kind(facet))
    call shape_functions(self%surface%kind(facet), xi(1:self%dimension - 1), shape(1:n))
    u = 0
    do i = 1, n
      k = self%surface%node(i, facet)
      u = u + shape(i)*(self%x(:, k) - self%x0(:, k))
    end do
  end function solid_displacement_at

  !> Whether an edge was inside a plane face before deformation.
  pure logical function solid_is_in_plane(self, f, other) result(is_in_plane)
    class(solid_t), intent(in) :: self
    integer, intent(in) :: f  !! Facet on one side.
    integer, intent(in) :: other  !! Facet on the other side.
    is_in_plane = norm2(self%normal0(:, f) - self%normal0(:, other)) <= same_place .and. &
      all(self%curvature([f, other])*self%set%size([f, other]) <= same_place)
  end function solid_is_in_plane

  !> Whether a facet was flush with a face of a part at one of its nodes before deformation, as the sides of two stacked
  !> blocks are: the node has not come through this facet, however near it is.
  pure logical function solid_is_flush(self, i, b, facet) result(flush)
    class(solid_t), intent(in) :: self
    integer, intent(in) :: i  !! Node.
    class(solid_t), intent(in) :: b  !! The other part.
    integer, intent(in) :: facet  !! Its facet.
    integer :: k
    flush = .false.
    if (abs(dot_product(b%normal0(:, facet), self%x0(:, i) - b%x0(:, b%surface%node(1, facet)))) > &
        same_place*b%set%size(facet)) return
    do k = self%first(i), self%first(i + 1) - 1
      flush = dot_product(self%normal0(:, self%around(k)), b%normal0(:, facet)) > flush_cosine
      if (flush) return
    end do
  end function solid_is_flush

  !> Normals, roughness and curvature of all facets.
  subroutine measure_roughness(surface, set, adjacency, x0, normal0, normal, roughness0, roughness, curvature)
    type(surface_t), intent(in) :: surface  !! Facets.
    type(facet_set_t), intent(in) :: set  !! Deformed facets.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    real(dp), intent(in) :: x0(:, :)  !! Nodes before deformation (3, n_nodes) [length].
    !> Unit normals of the facets before deformation (3, n_facets) [].
    real(dp), allocatable, intent(out) :: normal0(:, :)
    real(dp), allocatable, intent(out) :: normal(:, :)  !! The same after deformation (3, n_facets) [].
    !> Roughness before deformation where the surface is concave: chords lie outside of the body there, and touch before
    !> the surface does. Chords of convex surfaces lie inside, and depths below them are real (n_facets) [length].
    real(dp), allocatable, intent(out) :: roughness0(:)
    real(dp), allocatable, intent(out) :: roughness(:)  !! Roughness after deformation (n_facets) [length].
    real(dp), allocatable, intent(out) :: curvature(:)  !! Curvature before deformation (n_facets) [1/length].
    type(facet_set_t) :: before
    real(dp) :: width(2), bent, centre_normal(3)
    integer :: entity(set%n), smooth(4, set%n), f, e, other, back
    logical :: in_plane(set%n)
    entity = [(facet_entity(surface, f), f=1, set%n)]
    in_plane = .false.
    allocate (normal0(3, set%n), normal(3, set%n), roughness0(set%n), roughness(set%n), curvature(set%n))
    ! Deformation bends flat facets too.
    call before%init_polynomials(x0(1:set%dimension, :), surface)
    do f = 1, set%n
      associate (corner => surface%node(1:set%corners(f), f), is_flat => set%affine(f) .and. set%corners(f) > 2)
        normal0(:, f) = corner_normal(x0(:, corner))
        call bulge(set, f, is_flat, normal(:, f), roughness(f), bent)
        call bulge(before, f, is_flat, centre_normal, bent, curvature(f))
        roughness0(f) = 0
      end associate
    end do
    smooth = 0
    do f = 1, set%n
      do e = 1, set%corners(f)
        other = adjacency%neighbour(e, f)
        if (other < f) cycle
        back = findloc(adjacency%neighbour(1:set%corners(other), other), f, dim=1)
        if (back == 0) cycle
        if (.not. is_smooth_edge(adjacency, normal0, entity, in_plane, f, other)) cycle
        smooth(e, f) = other
        smooth(back, other) = f
      end do
    end do
    do f = 1, set%n
      do e = 1, set%corners(f)
        other = smooth(e, f)
        if (other < f) cycle
        back = findloc(smooth(1:set%corners(other), other), f, dim=1)
        width = [width_at(surface, set, x0, f, e), width_at(surface, set, x0, other, back)]
        if (.not. minval(width) > 0) cycle
        associate (pair => [f, other], curved => norm2(normal(:, f) - normal(:, other))/(sum(width)/2), &
                   curved0 => norm2(normal0(:, f) - normal0(:, other))/(sum(width)/2))
          roughness(pair) = max(roughness(pair), roughness_factor*width**2*curved)
          if (is_concave(f, other)) roughness0(pair) = max(roughness0(pair), roughness_factor*width**2*curved0)
          curvature(pair) = max(curvature(pair), curved0)
        end associate
      end do
    end do
    call spread_to_neighbours(roughness0)
    call spread_to_neighbours(roughness)

  contains

    !> Whether the surface is concave across the edge of two facets: whether the normals on both sides of the two
    !> converge outside. The edge itself may be a diagonal that bends the other way, as of skew facets of a cylinder.
    pure logical function is_concave(f, g)
      integer, intent(in) :: f, g  !! The facets.
      real(dp) :: between(3)
      between = sum(x0(:, surface%node(:set%corners(g), g)), 2)/set%corners(g) - &
                sum(x0(:, surface%node(:set%corners(f), f)), 2)/set%corners(f)
      is_concave = dot_product(normal_beyond(g, f) - normal_beyond(f, g), between) < 0
    end function is_concave

    !> Mean normal of the smooth neighbours of a facet but one; its own where it has no other (3) [].
    pure function normal_beyond(f, g) result(mean)
      integer, intent(in) :: f, g  !! The facet, and the neighbour that does not count.
      real(dp) :: mean(3)
      integer :: e, n
      mean = 0
      n = 0
      do e = 1, set%corners(f)
        if (smooth(e, f) == 0 .or. smooth(e, f) == g) cycle
        mean = mean + normal0(:, smooth(e, f))
        n = n + 1
      end do
      mean = merge(mean/max(1, n), normal0(:, f), n > 0)
    end function normal_beyond

    !> Means over the facets around a vertex depend on all of them.
    subroutine spread_to_neighbours(height)
      real(dp), intent(inout) :: height(:)  !! Heights (n_facets) [length].
      real(dp) :: own(set%n)
      own = height
      do f = 1, set%n
        do e = 1, set%corners(f)
          if (smooth(e, f) > 0) height(f) = max(height(f), own(smooth(e, f)))
        end do
      end do
    end subroutine spread_to_neighbours
  end subroutine measure_roughness

  !> Normal at the centre of a facet, and its roughness and curvature by the normals at its corners.
  pure subroutine bulge(set, f, is_flat, normal, roughness, curvature)
    type(facet_set_t), intent(in) :: set  !! Facets, deformed or not.
    integer, intent(in) :: f  !! Facet number.
    logical, intent(in) :: is_flat  !! Whether it is flat: roughness and curvature are 0.
    real(dp), intent(out) :: normal(3)  !! Unit normal at the centre (3) [].
    real(dp), intent(out) :: roughness  !! Roughness [length].
    real(dp), intent(out) :: curvature  !! Curvature [1/length].
    real(dp) :: centre(3), position(3), other(3), xu(3), xv(3), xi(2), turn, distance
    integer :: i
    xi = merge(1/3.0_dp, 0.0_dp, set%corners(f) == 3)
    call facet_position_and_normal(set, f, xi, centre, normal, xu, xv)
    roughness = 0
    curvature = 0
    if (is_flat) return
    do i = 1, set%corners(f)
      xi = corner_coordinates(set%corners(f), i)
      call facet_position_and_normal(set, f, xi, position, other, xu, xv)
      turn = norm2(other - normal)
      distance = norm2(position - centre)
      if (.not. distance > 0) cycle
      ! The corner is half a width away, and the normal has turned by half the angle.
      roughness = max(roughness, 4*roughness_factor*turn*distance)
      curvature = max(curvature, turn/distance)
    end do
  end subroutine bulge

  !> Width of a facet across one of its edges: the distance of its farthest corner from the edge; in two dimensions its
  !> length [length].
  pure real(dp) function width_at(surface, set, x0, f, e) result(width)
    type(surface_t), intent(in) :: surface  !! Facets.
    type(facet_set_t), intent(in) :: set  !! Facets, for the numbers of corners.
    real(dp), intent(in) :: x0(:, :)  !! Nodes (3, n_nodes) [length].
    integer, intent(in) :: f  !! Facet number.
    integer, intent(in) :: e  !! Edge.
    real(dp) :: along(3), r(3)
    integer :: i, n
    n = set%corners(f)
    associate (corner => surface%node(1:n, f))
      if (n == 2) then
        width = norm2(x0(:, corner(2)) - x0(:, corner(1)))
        return
      end if
      along = x0(:, corner(modulo(e, n) + 1)) - x0(:, corner(e))
      along = along/max(norm2(along), tiny(1.0_dp))
      width = 0
      do i = 1, n
        r = x0(:, corner(i)) - x0(:, corner(e))
        width = max(width, norm2(r - dot_product(r, along)*along))
      end do
    end associate
  end function width_at
end module dotyk_contact_solid_boundary
