!> The geometry that gaps and normals of contact are taken from, beside that of the elements.
!>
!> Linear elements approximate a curved surface by flat or bilinear facets: their normals are off by O(h), their points by
!> O(h^2). The smooth geometry puts a quadratic patch over each such facet. It has the normals of vertex_normals.f90 at the
!> corners; the middle of each edge with ends x0, x1, D = x1 - x0, and unit tangents t0, t1 (D without its component along the
!> normal there) is x = (x0+x1)/2 + abs(D) (t0-t1)/(4 + 2 abs(t0+t1)), which lies on the circle where the ends and the tangents are
!> those of a circle. Between the corners the normal is interpolated: so it is continuous. Facets of quadratic elements, and
!> flat ones, stay what they are. The straight geometry, to compare, is that of the corners alone.
!>
!> Patches give gaps and directions only. The points x and x' where forces act lie on the elements, because displacements do.
module dotyk_contact_geometry
  use dotyk_base_kinds, only: dp
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_facet_set, only: evaluate_facet, facet_set_t
  use dotyk_contact_vertex_normals, only: find_sheets, flat_angle, own_corner_normals, smooth_corner_normals
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_line2, element_line3, element_quad4, element_quad8, &
    element_tri3, element_tri6, kind_nodes, max_facet_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> Which geometry.
  integer, parameter, public :: geometry_smooth = 1    !< patches over the facets of linear elements
  integer, parameter, public :: geometry_elements = 2  !< that of the elements
  integer, parameter, public :: geometry_straight = 3  !< that of the corners

  !> Another geometry of the facets of a surface.
  type, public :: contact_geometry_t
    !> Some facet has another geometry than its element.
    logical :: active = .false.
    !> These have (n).
    logical, allocatable :: changed(:)
    !> Normals are interpolated between the corners (n).
    logical, allocatable :: interpolated(:)
    !> Their geometry; reference coordinates are those of the elements.
    type(facet_set_t) :: patch
    !> Normals at the corners, outward, of about length 1, zero where the element's own are meant (3, 4, n).
    real(dp), allocatable :: corner_normal(:, :, :)
    !> The facet beyond each edge, 0 where the normal is not continuous (4, n).
    integer, allocatable :: joined(:, :)
  contains
    procedure :: init => geometry_init
    procedure :: shift
  end type contact_geometry_t

contains

  !> Set up for a surface.
  subroutine geometry_init(self, geometry, x, surface, set, adjacency)
    class(contact_geometry_t), intent(out) :: self
    !> One of `geometry_*`.
    integer, intent(in) :: geometry
    !> Nodal coordinates of the body (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    type(surface_t), intent(in) :: surface
    !> The surface's facets and their neighbours.
    type(facet_set_t), intent(in) :: set
    type(adjacency_t), intent(in) :: adjacency
    real(dp) :: vertex(3, size(adjacency%start) - 1)
    logical :: linear(set%n), flat(set%n)
    type(element_kind_t) :: kind
    integer :: f, k
    if (geometry == geometry_elements) return
    vertex = 0
    do f = 1, set%n
      kind = element_kind(surface%kind(f))
      linear(f) = kind%order == 1
      do k = 1, set%corners(f)
        vertex(1:set%dimension, adjacency%vertex(k, f)) = x(:, set%corner_node(k, f))
      end do
    end do
    allocate (self%changed(set%n), self%interpolated(set%n), self%corner_normal(3, 4, set%n), self%joined(4, set%n))
    if (geometry == geometry_straight) then
      self%changed = .not. linear
      self%interpolated = .true.
      self%joined = adjacency%neighbour
      call own_corner_normals(set, adjacency, vertex, self%corner_normal)
    else
      call find_sheets(set, adjacency, vertex, linear, self%joined, flat)
      call smooth_corner_normals(set, adjacency, vertex, linear, self%joined, flat, self%corner_normal)
      self%interpolated = linear
      do f = 1, set%n
        self%changed(f) = linear(f) .and. .not. flat(f) .and. is_curved(set%corners(f), &
          vertex(:, adjacency%vertex(1:set%corners(f), f)), self%corner_normal(:, :, f))
      end do
    end if
    self%active = any(self%changed)
    if (self%active) call make_patches(self, geometry, x, surface)
  end subroutine geometry_init

  !> Do the normals at the corners differ from those of the facet? Their components along the edges tell.
  pure logical function is_curved(corners, x, normal)
    integer, intent(in) :: corners
    !> (3, corners), (3, >= corners).
    real(dp), intent(in) :: x(:, :), normal(:, :)
    integer :: k, l
    is_curved = .false.
    do k = 1, corners
      do l = 1, corners
        if (abs(dot_product(normal(:, k), x(:, l) - x(:, k))) > flat_angle*norm2(x(:, l) - x(:, k))) is_curved = .true.
      end do
    end do
  end function is_curved

  !> The patches as facets of quadratic (straight: linear) elements of their own.
  subroutine make_patches(self, geometry, x, surface)
    class(contact_geometry_t), intent(inout) :: self
    integer, intent(in) :: geometry
    real(dp), intent(in) :: x(:, :)
    type(surface_t), intent(in) :: surface
    type(surface_t) :: patches
    type(element_kind_t) :: kind
    real(dp) :: nodes(size(x, 1), max_facet_nodes*surface%n_facets)
    integer :: f, n, i, j
    patches%dimension = surface%dimension
    patches%n_facets = surface%n_facets
    allocate (patches%kind(surface%n_facets), patches%node(max_facet_nodes, surface%n_facets))
    patches%node = 0
    nodes = 0
    do f = 1, surface%n_facets
      kind = element_kind(surface%kind(f))
      patches%kind(f) = surface%kind(f)
      if (self%changed(f)) patches%kind(f) = merge(quadratic(kind%n_corners), kind%corner_kind, geometry == geometry_smooth)
      j = max_facet_nodes*(f - 1)
      n = kind_nodes(patches%kind(f))
      patches%node(1:n, f) = [(j + i, i=1, n)]
      n = min(n, kind%n_nodes)
      nodes(:, j + 1:j + n) = x(:, surface%node(1:n, f))
      if (self%changed(f) .and. geometry == geometry_smooth) then
        do i = 1, merge(1, n, n == 2)
          nodes(:, j + n + i) = middle(nodes(:, j + i), nodes(:, j + modulo(i, n) + 1), self%corner_normal(:size(x, 1), i, f), &
                                       self%corner_normal(:size(x, 1), modulo(i, n) + 1, f))
        end do
      end if
    end do
    call self%patch%init(nodes, patches)
  end subroutine make_patches

  !> The quadratic kind of facets with so many corners.
  pure integer function quadratic(corners)
    integer, intent(in) :: corners
    integer, parameter :: kinds(2:4) = [element_line3, element_tri6, element_quad8]
    quadratic = kinds(corners)
  end function quadratic

  !> The middle of an edge, from its ends and the normals there.
  pure function middle(x0, x1, n0, n1) result(x)
    real(dp), intent(in) :: x0(:), x1(:), n0(:), n1(:)
    real(dp) :: x(size(x0))
    real(dp) :: d(size(x0)), t0(size(x0)), t1(size(x0))
    d = x1 - x0
    t0 = d - dot_product(d, n0)*n0
    t1 = d - dot_product(d, n1)*n1
    t0 = t0/max(norm2(t0), tiny(1.0_dp))
    t1 = t1/max(norm2(t1), tiny(1.0_dp))
    x = (x0 + x1)/2 + norm2(d)*(t0 - t1)/(4 + 2*norm2(t0 + t1))
  end function middle

  !> From a point of the element to that of the geometry [length].
  pure function shift(self, set, facet, xi)
    class(contact_geometry_t), intent(in) :: self
    !> The facets of the elements.
    type(facet_set_t), intent(in) :: set
    integer, intent(in) :: facet
    !> Reference coordinates (2).
    real(dp), intent(in) :: xi(2)
    real(dp) :: shift(3)
    real(dp) :: x(3), y(3), d(3, 5)
    shift = 0
    if (.not. self%active) return
    if (.not. self%changed(facet)) return
    call evaluate_facet(set%coefficient(:, :, facet), xi(1), xi(2), x, d(:, 1), d(:, 2), d(:, 3), d(:, 4), d(:, 5))
    call evaluate_facet(self%patch%coefficient(:, :, facet), xi(1), xi(2), y, d(:, 1), d(:, 2), d(:, 3), d(:, 4), d(:, 5))
    shift = y - x
  end function shift
end module dotyk_contact_geometry
