!> Smooth contact surfaces: quadratic patches with continuous normals over the facets, from which gaps and contact
!> normals are taken (an interpolation from vertex normals, as that of Nagata, Comput. Aided Geom. Design 22, 2005).
!>
!> Linear elements approximate a curved surface by flat or bilinear facets: their normals are of first, their points of
!> second order. A smooth patch has the fitted normals of vertex_normals.f90 at its corners. The middle of an edge with
!> ends x0, x1, D = x1 - x0, and unit tangents t0, t1 (D without its component along the normal there) is x = (x0+x1)/2
!> + abs(D) (t0-t1)/(4 + 2 abs(t0+t1)): a point of the circle where ends and tangents are those of a circle. Between the
!> corners the normal is interpolated: it is continuous. Facets of quadratic elements are divided into sub-facets at
!> their mid-side nodes first. Planar sub-facets keep the element geometry.
!>
!> Patches define gaps and directions only. The points x and x' where forces act lie on the elements, whose shape
!> functions interpolate the displacements.
!>
!> The corners of sub-facets are nodes of the surface (in quad8 also its centre). Facets of linear elements are one
!> sub-facet, also after order elevation (`dotyk_mesh_order_elevation`) and where a mesh generator put the mid-side
!> nodes on the chords: such nodes carry no information about the shape.
module dotyk_contact_smooth_surface
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: no_offset
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_facet_polynomial, only: evaluate_facet
  use dotyk_contact_facet_set, only: facet_set_t
  use dotyk_contact_smooth_sheets, only: facet_entity, facets_on_chords
  use dotyk_contact_vertex_normals, only: find_smooth_sheets, smooth_corner_normals
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_line3, element_quad8, element_quad9, &
    element_tri6, kind_nodes, max_facet_nodes, reference_nodes, shape_functions
  use dotyk_mesh_facet, only: cross
  use dotyk_mesh_surface, only: surface_t
  use dotyk_ranks_division, only: division_t
  implicit none
  private

  type :: sub_facets_t  !! Sub-facets of a surface.
    integer, allocatable :: first(:)  !! Sub-facets of facet f are first(f) .. first(f+1)-1 (n_facets+1).
    integer, allocatable :: parent(:)  !! Facet of each sub-facet (n).
    !> Offset of the reference coordinates: xi of the facet = base + factor * xi of the sub-facet (2, n) [].
    real(dp), allocatable :: base(:, :)
    real(dp), allocatable :: factor(:)  !! Factor of the reference coordinates (n) [].
    type(surface_t) :: surface  !! The sub-facets as linear facets.
    real(dp), allocatable :: x(:, :)  !! Coordinates of their corners (dimension, n_nodes) [length].
    !> The element geometry restricted to the sub-facets, exactly: facets of the same order, each with nodes of its own.
    type(surface_t) :: element
    !> Nodes of `element`: node j of sub-facet f is element_x(:, max_facet_nodes*(f-1)+j) (dimension, max_facet_nodes*n)
    !> [length].
    real(dp), allocatable :: element_x(:, :)
    logical, allocatable :: flat(:)  !! Sub-facets of quadratic facets all of whose nodes are coplanar (n).
  contains
    procedure :: locate
  end type sub_facets_t

  !> Nodes of the facet that are the corners of its sub-facets; node 9 is the centre of a quadrilateral.
  integer, parameter :: line_corner(2, 2) = reshape([1, 3, 3, 2], [2, 2])
  integer, parameter :: triangle_corner(3, 4) = reshape([1, 4, 6, 4, 2, 5, 6, 5, 3, 5, 6, 4], [3, 4])
  integer, parameter :: quadrilateral_corner(4, 4) = reshape([1, 5, 9, 8, 5, 2, 6, 9, 9, 6, 3, 7, 8, 9, 7, 4], [4, 4])
  !> Offsets of the reference coordinates of the sub-facets.
  real(dp), parameter :: triangle_base(2, 4) = &
    reshape([0.0_dp, 0.0_dp, 0.5_dp, 0.0_dp, 0.0_dp, 0.5_dp, 0.5_dp, 0.5_dp], [2, 4])
  real(dp), parameter :: quadrilateral_base(2, 4) = &
    reshape([-0.5_dp, -0.5_dp, 0.5_dp, -0.5_dp, 0.5_dp, 0.5_dp, -0.5_dp, 0.5_dp], [2, 4])

  type, public :: smooth_surface_t  !! Smooth geometry of a surface.
    !> The geometry differs from that of the elements on some sub-facet. Otherwise nothing below is set.
    logical :: active = .false.
    type(sub_facets_t) :: sub_facets  !! Sub-facets.
    type(facet_set_t) :: element  !! Element geometry on the sub-facets.
    type(facet_set_t) :: patch  !! Smooth geometry on the sub-facets.
    logical, allocatable :: changed(:)  !! Sub-facets on which the two differ (n).
    !> Outward normals at the corners of the sub-facets, of about unit length (3, 4, n) [].
    real(dp), allocatable :: corner_normal(:, :, :)
    !> Sub-facet across each edge, 0 where the normal is discontinuous (4, n).
    integer, allocatable :: smooth_neighbour(:, :)
    logical, allocatable :: boundary(:, :)  !! Edges at which the surface ends (4, n).
  contains
    procedure :: init => geometry_init
    procedure :: shift
    procedure :: height
    procedure :: uncertainty
  end type smooth_surface_t

  real(dp), parameter :: least_cosine = 0.1_dp  !! Of the normal of a patch and a direction across it [].

contains

  !> Set up for a surface.
  subroutine geometry_init(self, division, x, surface, candidate)
    class(smooth_surface_t), intent(out) :: self
    type(division_t), intent(in) :: division  !! How ranks divide the work.
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    !> Facets near the other surface (n_facets); other facets may keep the geometry of their elements.
    logical, intent(in) :: candidate(:)
    type(facet_set_t) :: set
    type(adjacency_t) :: adjacency
    real(dp), allocatable :: vertex(:, :)
    logical, allocatable :: flat(:), wanted(:)
    logical :: on_chords(surface%n_facets)
    integer :: f, k
    call facets_on_chords(x, surface, on_chords)
    call split_facets(x, surface, on_chords, self%sub_facets)
    associate (sub_facets => self%sub_facets)
      call set%init_polynomials(sub_facets%x, sub_facets%surface)
      call adjacency%init(set)
      allocate (vertex(3, size(adjacency%start) - 1), flat(set%n))
      vertex = 0
      do f = 1, set%n
        do k = 1, set%corners(f)
          vertex(1:set%dimension, adjacency%vertex(k, f)) = sub_facets%x(:, set%corner_node(k, f))
        end do
      end do
      allocate (self%changed(set%n), self%corner_normal(3, 4, set%n), self%smooth_neighbour(4, set%n))
      self%boundary = adjacency%neighbour == 0
      flat = sub_facets%flat
      call find_smooth_sheets(set, adjacency, vertex, &
                              [(facet_entity(surface, sub_facets%parent(f)), f=1, set%n)], self%smooth_neighbour, flat)
      allocate (wanted(size(vertex, 2)), source=.false.)
      do f = 1, set%n
        if (candidate(sub_facets%parent(f))) wanted(adjacency%vertex(1:set%corners(f), f)) = .true.
      end do
      call smooth_corner_normals(division, set, adjacency, vertex, self%smooth_neighbour, flat, wanted, &
                                 self%corner_normal)
      do f = 1, set%n
        self%changed(f) = .not. flat(f) .and. all(wanted(adjacency%vertex(1:set%corners(f), f)))
        if (.not. self%changed(f)) cycle
        if (kind_nodes(surface%kind(sub_facets%parent(f))) == set%corners(f) .or. &
            on_chords(sub_facets%parent(f))) &
          self%changed(f) = is_curved(set%corners(f), vertex(:, adjacency%vertex(1:set%corners(f), f)), &
                                      self%corner_normal(:, :, f))
      end do
    end associate
    self%active = any(self%changed)
    if (self%active) call make_patches(self, surface%dimension)
  end subroutine geometry_init

  !> Whether the normals at the corners of a facet differ from the facet normal: whether they have components along its
  !> edges.
  pure logical function is_curved(corners, x, normal)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    real(dp), intent(in) :: x(:, :)  !! Corners (3, corners) [length].
    real(dp), intent(in) :: normal(:, :)  !! Normals at the corners (3, at least corners) [].
    integer :: k, l
    is_curved = .false.
    do k = 1, corners
      do l = 1, corners
        if (abs(dot_product(normal(:, k), x(:, l) - x(:, k))) > no_offset*norm2(x(:, l) - x(:, k))) is_curved = .true.
      end do
    end do
  end function is_curved

  !> Element geometry and patches as facet polynomials.
  subroutine make_patches(self, dimension)
    class(smooth_surface_t), intent(inout) :: self
    integer, intent(in) :: dimension  !! Dimension of space.
    type(surface_t) :: patches
    type(element_kind_t) :: kind
    real(dp) :: nodes(dimension, max_facet_nodes*size(self%changed))
    integer :: f, n, i, j
    call self%element%init_polynomials(self%sub_facets%element_x, self%sub_facets%element)
    patches = self%sub_facets%element
    nodes = self%sub_facets%element_x
    do f = 1, size(self%changed)
      if (.not. self%changed(f)) cycle
      kind = element_kind(patches%kind(f))
      n = kind%n_corners
      j = max_facet_nodes*(f - 1)
      patches%kind(f) = quadratic_kind(n)
      patches%node(:, f) = 0
      patches%node(1:kind_nodes(patches%kind(f)), f) = [(j + i, i=1, kind_nodes(patches%kind(f)))]
      do i = 1, merge(1, n, n == 2)
        nodes(:, j + n + i) = edge_middle(nodes(:, j + i), nodes(:, j + modulo(i, n) + 1), &
                                          self%corner_normal(:dimension, i, f), &
                                          self%corner_normal(:dimension, modulo(i, n) + 1, f))
      end do
    end do
    call self%patch%init_polynomials(nodes, patches)
  end subroutine make_patches

  !> Quadratic element kind of a facet.
  pure integer function quadratic_kind(corners)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    integer, parameter :: kinds(2:4) = [element_line3, element_tri6, element_quad8]
    quadratic_kind = kinds(corners)
  end function quadratic_kind

  !> Middle of a smooth edge.
  pure function edge_middle(x0, x1, n0, n1) result(x)
    real(dp), intent(in) :: x0(:)  !! First end (dimension) [length].
    real(dp), intent(in) :: x1(:)  !! Second end (dimension) [length].
    real(dp), intent(in) :: n0(:)  !! Normal at the first end (dimension) [].
    real(dp), intent(in) :: n1(:)  !! Normal at the second end (dimension) [].
    real(dp) :: x(size(x0))  !! Middle (dimension) [length].
    real(dp) :: d(size(x0)), t0(size(x0)), t1(size(x0))
    d = x1 - x0
    t0 = d - dot_product(d, n0)*n0
    t1 = d - dot_product(d, n1)*n1
    t0 = t0/max(norm2(t0), tiny(1.0_dp))
    t1 = t1/max(norm2(t1), tiny(1.0_dp))
    x = (x0 + x1)/2 + norm2(d)*(t0 - t1)/(4 + 2*norm2(t0 + t1))
  end function edge_middle

  !> Vector from a point of the element to the point of the patch with the same reference coordinates [length].
  pure function shift(self, sub_facet, xi)
    class(smooth_surface_t), intent(in) :: self
    integer, intent(in) :: sub_facet  !! Sub-facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates on the sub-facet (2) [].
    real(dp) :: shift(3)  !! Vector (3) [length].
    real(dp) :: x(3), y(3), d(3, 5)
    shift = 0
    if (.not. self%changed(sub_facet)) return
    associate (c => self%element%coefficient(:, :, sub_facet), p => self%patch%coefficient(:, :, sub_facet))
      call evaluate_facet(c, xi(1), xi(2), x, d(:, 1), d(:, 2), d(:, 3), d(:, 4), d(:, 5))
      call evaluate_facet(p, xi(1), xi(2), y, d(:, 1), d(:, 2), d(:, 3), d(:, 4), d(:, 5))
    end associate
    shift = y - x
  end function shift

  !> How far from a point of the element a line of direction n meets the patch, to first order [length]. Beside sharp
  !> edges patches begin beyond the edge: `shift` has a part along the surface, which is no distance of it.
  pure real(dp) function height(self, sub_facet, xi, n)
    class(smooth_surface_t), intent(in) :: self
    integer, intent(in) :: sub_facet  !! Sub-facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates on the sub-facet (2) [].
    real(dp), intent(in) :: n(3)  !! Unit vector (3) [].
    real(dp) :: m(3), y(3), d(3, 5), move(3)
    move = self%shift(sub_facet, xi)
    height = dot_product(n, move)
    if (.not. self%changed(sub_facet)) return
    associate (p => self%patch%coefficient(:, :, sub_facet))
      call evaluate_facet(p, xi(1), xi(2), y, d(:, 1), d(:, 2), d(:, 3), d(:, 4), d(:, 5))
    end associate
    if (self%patch%dimension == 2) d(:, 2) = [0, 0, 1]
    m = cross(d(:, 1), d(:, 2))
    ! Surfaces along n have no height.
    if (abs(dot_product(m, n)) > least_cosine*norm2(m)) height = dot_product(m, move)/dot_product(m, n)
  end function height

  !> How far a patch may be from the surface at a point, for a vector `shift` there: a parabola through the ends and the
  !> middle of a circular arc of the angle w and the height s is off by s w^2/64 at most [length].
  pure real(dp) function uncertainty(self, sub_facet, shift)
    class(smooth_surface_t), intent(in) :: self
    integer, intent(in) :: sub_facet  !! Sub-facet number.
    real(dp), intent(in) :: shift(3)  !! Vector from the facet to the patch (3) [length].
    real(dp) :: turn
    integer :: i, j
    turn = 0
    associate (kind => element_kind(self%sub_facets%element%kind(sub_facet)), &
               normal => self%corner_normal(:, :, sub_facet))
      do i = 2, kind%n_corners
        do j = 1, i - 1
          turn = max(turn, sum((normal(:, i) - normal(:, j))**2))
        end do
      end do
    end associate
    uncertainty = norm2(shift)*turn/64
  end function uncertainty

  !> Divide the facets of a surface into sub-facets.
  subroutine split_facets(x, surface, on_chords, sub_facets)
    real(dp), intent(in) :: x(:, :)  !! Nodal coordinates of the body (dimension, n_nodes) [length].
    type(surface_t), intent(in) :: surface  !! Surface.
    logical, intent(in) :: on_chords(:)  !! Facets whose mid-side nodes carry no information about the shape (n_facets).
    type(sub_facets_t), intent(out) :: sub_facets  !! Sub-facets.
    type(element_kind_t) :: kind
    real(dp) :: shape(max_facet_nodes)
    integer :: f, k, n, n_extra, node(max_facet_nodes), count_of(surface%n_facets), corners
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      count_of(f) = merge(merge(2, 4, kind%n_corners == 2), 1, kind%order == 2 .and. .not. on_chords(f))
    end do
    n = sum(count_of)
    allocate (sub_facets%first(surface%n_facets + 1), sub_facets%parent(n), sub_facets%base(2, n), &
              sub_facets%factor(n), sub_facets%flat(n))
    allocate (sub_facets%x(size(x, 1), size(x, 2) + count(surface%kind == element_quad8)))
    allocate (sub_facets%element_x(size(x, 1), max_facet_nodes*n))
    call allocate_surface(surface%dimension, n, sub_facets%surface)
    call allocate_surface(surface%dimension, n, sub_facets%element)
    sub_facets%x(:, :size(x, 2)) = x
    sub_facets%x(:, size(x, 2) + 1:) = 0
    sub_facets%base = 0
    sub_facets%factor = 1
    sub_facets%flat = .false.
    sub_facets%element_x = 0
    n_extra = size(x, 2)
    sub_facets%first(1) = 1
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      corners = kind%n_corners
      sub_facets%first(f + 1) = sub_facets%first(f) + count_of(f)
      associate (first => sub_facets%first(f), last => sub_facets%first(f + 1) - 1)
        sub_facets%parent(first:last) = f
        sub_facets%surface%kind(first:last) = kind%corner_kind
        node = surface%node(:, f)
        if (count_of(f) == 1) then
          sub_facets%surface%node(1:corners, first) = node(1:corners)
        else
          if (surface%kind(f) == element_quad8) then
            n_extra = n_extra + 1
            call shape_functions(element_quad8, [0.0_dp, 0.0_dp], shape(1:8))
            sub_facets%x(:, n_extra) = matmul(x(:, node(1:8)), shape(1:8))
            node(9) = n_extra
          end if
          sub_facets%factor(first:last) = 0.5_dp
          select case (corners)
          case (2)
            sub_facets%base(1, first:last) = [-0.5_dp, 0.5_dp]
            sub_facets%surface%node(1:2, first:last) = reshape(node(reshape(line_corner, [4])), [2, 2])
          case (3)
            sub_facets%base(:, first:last) = triangle_base
            sub_facets%factor(last) = -0.5_dp
            sub_facets%surface%node(1:3, first:last) = reshape(node(reshape(triangle_corner, [12])), [3, 4])
          case default
            sub_facets%base(:, first:last) = quadrilateral_base
            sub_facets%surface%node(1:4, first:last) = reshape(node(reshape(quadrilateral_corner, [16])), [4, 4])
          end select
          sub_facets%flat(first:last) = is_planar(x(:, node(1:kind%n_nodes)))
        end if
        do k = first, last
          call restrict_element(surface%kind(f), count_of(f), x(:, node(1:kind%n_nodes)), k, sub_facets)
        end do
      end associate
    end do
  end subroutine split_facets

  !> Surface without facets yet.
  subroutine allocate_surface(dimension, n, surface)
    integer, intent(in) :: dimension  !! Dimension of space, 2 or 3.
    integer, intent(in) :: n  !! Number of facets.
    type(surface_t), intent(out) :: surface  !! Surface.
    surface%dimension = dimension
    surface%n_facets = n
    allocate (surface%kind(n), surface%node(max_facet_nodes, n))
    surface%node = 0
  end subroutine allocate_surface

  !> Restrict the element geometry to one sub-facet.
  subroutine restrict_element(kind, n_sub_facets, x, sub_facet, sub_facets)
    integer, intent(in) :: kind  !! Element kind of the facet.
    integer, intent(in) :: n_sub_facets  !! Number of sub-facets of the facet.
    real(dp), intent(in) :: x(:, :)  !! Nodes of the facet (dimension, n_nodes) [length].
    integer, intent(in) :: sub_facet  !! Sub-facet number.
    type(sub_facets_t), intent(inout) :: sub_facets  !! Sub-facets; `element` is set for this one.
    real(dp) :: xi(2, max_facet_nodes), shape(max_facet_nodes)
    integer :: n, d, i, j
    j = max_facet_nodes*(sub_facet - 1)
    n = size(x, 2)
    sub_facets%element%kind(sub_facet) = kind
    if (n_sub_facets == 1) then
      sub_facets%element_x(:, j + 1:j + n) = x
    else
      d = size(x, 1) - 1
      ! A quad8 restricted to a quarter needs all nine functions.
      if (kind == element_quad8) sub_facets%element%kind(sub_facet) = element_quad9
      n = kind_nodes(sub_facets%element%kind(sub_facet))
      call reference_nodes(sub_facets%element%kind(sub_facet), xi(1:d, 1:n))
      do i = 1, n
        call shape_functions(kind, sub_facets%base(1:d, sub_facet) + sub_facets%factor(sub_facet)*xi(1:d, i), &
                             shape(1:size(x, 2)))
        sub_facets%element_x(:, j + i) = matmul(x, shape(1:size(x, 2)))
      end do
    end if
    sub_facets%element%node(1:n, sub_facet) = [(j + i, i=1, n)]
  end subroutine restrict_element

  !> Whether points are coplanar (in two dimensions: collinear).
  pure logical function is_planar(x)
    real(dp), intent(in) :: x(:, :)  !! Points, corners of the facet first (dimension, n) [length].
    real(dp) :: normal(3), a(3), b(3), r(3)
    integer :: i
    if (size(x, 1) == 2) then
      normal = [x(2, 2) - x(2, 1), x(1, 1) - x(1, 2), 0.0_dp]
    else
      a = x(:, 2) - x(:, 1)
      b = x(:, 3) - x(:, 1)
      normal = [a(2)*b(3) - a(3)*b(2), a(3)*b(1) - a(1)*b(3), a(1)*b(2) - a(2)*b(1)]
    end if
    normal = normal/max(norm2(normal), tiny(1.0_dp))
    is_planar = .true.
    do i = 2, size(x, 2)
      r = 0
      r(1:size(x, 1)) = x(:, i) - x(:, 1)
      is_planar = is_planar .and. abs(dot_product(normal, r)) <= no_offset*norm2(r)
    end do
  end function is_planar

  !> Sub-facet of a point of a facet.
  pure subroutine locate(self, facet, xi, sub_facet, xi_sub_facet)
    class(sub_facets_t), intent(in) :: self
    integer, intent(in) :: facet  !! Facet number.
    real(dp), intent(in) :: xi(2)  !! Reference coordinates (2) []; the second is 0 for lines.
    integer, intent(out) :: sub_facet  !! Sub-facet number.
    real(dp), intent(out) :: xi_sub_facet(2)  !! Reference coordinates on the sub-facet (2) [].
    integer :: k
    k = 1
    select case (self%element%kind(self%first(facet)))
    case (element_line3)
      if (xi(1) > 0) k = 2
    case (element_tri6)
      k = 4
      if (sum(xi) <= 0.5_dp) k = 1
      if (xi(1) >= 0.5_dp) k = 2
      if (xi(2) >= 0.5_dp) k = 3
    case (element_quad9)
      if (xi(2) > 0) then
        k = merge(3, 4, xi(1) > 0)
      else
        k = merge(2, 1, xi(1) > 0)
      end if
    end select
    sub_facet = self%first(facet)
    if (self%first(facet + 1) - self%first(facet) > 1) sub_facet = sub_facet + k - 1
    xi_sub_facet = (xi - self%base(:, sub_facet))/self%factor(sub_facet)
  end subroutine locate
end module dotyk_contact_smooth_surface
