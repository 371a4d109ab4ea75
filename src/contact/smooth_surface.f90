!> The geometry that gaps and normals of contact are taken from, beside that of the elements.
!>
!> Linear elements approximate a curved surface by flat or bilinear facets: their normals are off by O(h), their points by
!> O(h^2). The smooth geometry puts a quadratic patch over each facet. It has the normals of vertex_normals.f90 at the
!> corners; the middle of each edge with ends x0, x1, D = x1 - x0, and unit tangents t0, t1 (D without its component along
!> the normal there) is x = (x0+x1)/2 + abs(D) (t0-t1)/(4 + 2 abs(t0+t1)), which lies on the circle where the ends and the
!> tangents are those of a circle. Between the corners the normal is interpolated: so it is continuous. Facets of quadratic
!> elements are cut through their mid nodes into two or four pieces (sub_facets.f90), whose corners are nodes of the surface
!> too. Flat pieces stay what they are.
!>
!> Patches give gaps and directions only. The points x and x' where forces act lie on the elements, because displacements do.
module dotyk_contact_smooth_surface
  use dotyk_base_kinds, only: dp
  use dotyk_contact_adjacency, only: adjacency_t
  use dotyk_contact_facet_set, only: evaluate_facet, facet_set_t
  use dotyk_contact_sub_facets, only: split_facets, sub_facets_t
  use dotyk_contact_vertex_normals, only: find_smooth_sheets, flat_angle, smooth_corner_normals
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_line3, element_quad8, element_tri6, kind_nodes, &
    max_facet_nodes
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  !> Another geometry of the facets of a surface.
  type, public :: smooth_surface_t
    !> Some piece has another geometry than its element. Else nothing below is set.
    logical :: active = .false.
    !> The pieces of the facets.
    type(sub_facets_t) :: pieces
    !> The elements' geometry on the pieces.
    type(facet_set_t) :: element
    !> The other geometry on the pieces.
    type(facet_set_t) :: patch
    !> Pieces where they differ (n).
    logical, allocatable :: changed(:)
    !> Outward normals at the corners of the pieces, of about length 1 (3, 4, n).
    real(dp), allocatable :: corner_normal(:, :, :)
    !> The piece beyond each edge, 0 where the normal is not continuous (4, n).
    integer, allocatable :: joined(:, :)
    !> Nothing is beyond the edge: the surface ends (4, n).
    logical, allocatable :: rim(:, :)
  contains
    procedure :: init => geometry_init
    procedure :: shift
  end type smooth_surface_t

contains

  !> Set up for a surface.
  subroutine geometry_init(self, x, surface, near)
    class(smooth_surface_t), intent(out) :: self
    !> Nodal coordinates of the body (dimension, n_nodes) [length].
    real(dp), intent(in) :: x(:, :)
    type(surface_t), intent(in) :: surface
    !> The facets that may have partners (n_facets). Those far from them may keep the geometry of their elements.
    logical, intent(in) :: near(:)
    type(facet_set_t) :: set
    type(adjacency_t) :: adjacency
    real(dp), allocatable :: vertex(:, :)
    logical, allocatable :: flat(:), wanted(:)
    integer :: f, k
    call split_facets(x, surface, self%pieces)
    associate (pieces => self%pieces)
      call set%init(pieces%x, pieces%surface)
      call adjacency%init(set)
      allocate (vertex(3, size(adjacency%start) - 1), flat(set%n))
      vertex = 0
      do f = 1, set%n
        do k = 1, set%corners(f)
          vertex(1:set%dimension, adjacency%vertex(k, f)) = pieces%x(:, set%corner_node(k, f))
        end do
      end do
      allocate (self%changed(set%n), self%corner_normal(3, 4, set%n), self%joined(4, set%n))
      self%rim = adjacency%neighbour == 0
      flat = pieces%flat
      call find_smooth_sheets(set, adjacency, vertex, self%joined, flat)
      allocate (wanted(size(vertex, 2)), source=.false.)
      do f = 1, set%n
        if (near(pieces%parent(f))) wanted(adjacency%vertex(1:set%corners(f), f)) = .true.
      end do
      call smooth_corner_normals(set, adjacency, vertex, self%joined, flat, wanted, self%corner_normal)
      do f = 1, set%n
        self%changed(f) = .not. flat(f) .and. all(wanted(adjacency%vertex(1:set%corners(f), f)))
        if (.not. self%changed(f)) cycle
        if (kind_nodes(surface%kind(pieces%parent(f))) == set%corners(f) .or. surface%order_elevated) self%changed(f) = &
          is_curved(set%corners(f), vertex(:, adjacency%vertex(1:set%corners(f), f)), self%corner_normal(:, :, f))
      end do
    end associate
    self%active = any(self%changed)
    if (self%active) call make_patches(self, surface%dimension)
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

  !> The elements' geometry and the patches as facets of elements of their own.
  subroutine make_patches(self, dimension)
    class(smooth_surface_t), intent(inout) :: self
    !> Dimension of space.
    integer, intent(in) :: dimension
    type(surface_t) :: patches
    type(element_kind_t) :: kind
    real(dp) :: nodes(dimension, max_facet_nodes*size(self%changed))
    integer :: f, n, i, j
    call self%element%init(self%pieces%element_x, self%pieces%element)
    patches = self%pieces%element
    nodes = self%pieces%element_x
    do f = 1, size(self%changed)
      if (.not. self%changed(f)) cycle
      kind = element_kind(patches%kind(f))
      n = kind%n_corners
      j = max_facet_nodes*(f - 1)
      patches%kind(f) = quadratic(n)
      patches%node(:, f) = 0
      patches%node(1:kind_nodes(patches%kind(f)), f) = [(j + i, i=1, kind_nodes(patches%kind(f)))]
      do i = 1, merge(1, n, n == 2)
        nodes(:, j + n + i) = middle(nodes(:, j + i), nodes(:, j + modulo(i, n) + 1), self%corner_normal(:dimension, i, f), &
                                     self%corner_normal(:dimension, modulo(i, n) + 1, f))
      end do
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

  !> From a point of the element to that of the other geometry [length].
  pure function shift(self, piece, xi)
    class(smooth_surface_t), intent(in) :: self
    integer, intent(in) :: piece
    !> Reference coordinates on the piece (2).
    real(dp), intent(in) :: xi(2)
    real(dp) :: shift(3)
    real(dp) :: x(3), y(3), d(3, 5)
    shift = 0
    if (.not. self%changed(piece)) return
    associate (c => self%element%coefficient(:, :, piece), p => self%patch%coefficient(:, :, piece))
      call evaluate_facet(c, xi(1), xi(2), x, d(:, 1), d(:, 2), d(:, 3), d(:, 4), d(:, 5))
      call evaluate_facet(p, xi(1), xi(2), y, d(:, 1), d(:, 2), d(:, 3), d(:, 4), d(:, 5))
    end associate
    shift = y - x
  end function shift
end module dotyk_contact_smooth_surface
