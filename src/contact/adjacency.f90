!> Neighbours of the facets of one surface: across each edge, and at each vertex.
module dotyk_contact_adjacency
  use dotyk_contact_facet_set, only: facet_set_t
  implicit none
  private
  public :: corner_of, edges_of_corner

  type, public :: adjacency_t  !! Neighbours of the facets of one surface.
    !> Facet across each edge (in two dimensions: at each end point), 0 at the boundary of the surface (4, n). Edge i
    !> goes from corner i to the next one.
    integer, allocatable :: neighbour(:, :)
    integer, allocatable :: vertex(:, :)  !! Vertex number of each corner (4, n).
    integer, allocatable :: start(:)  !! Facets at vertex v are facet(start(v):start(v+1)-1) (n_vertices + 1).
    !> Facets of all vertices, ascending for each vertex (sum of the numbers of corners).
    integer, allocatable :: facet(:)
  contains
    procedure :: init => adjacency_init
    procedure :: facets_at => adjacency_facets_at
  end type adjacency_t

contains

  !> Find the neighbours of all facets.
  subroutine adjacency_init(self, set)
    class(adjacency_t), intent(out) :: self
    type(facet_set_t), intent(in) :: set  !! Facets.
    integer, allocatable :: number(:), next(:)
    integer :: f, i, k, n_vertices, n_used, next_corner
    allocate (self%neighbour(4, set%n), self%vertex(4, set%n))
    self%neighbour = 0
    self%vertex = 0
    allocate (number(maxval(set%corner_node)))
    number = 0
    n_vertices = 0
    do f = 1, set%n
      do i = 1, set%corners(f)
        associate (node => set%corner_node(i, f))
          if (number(node) == 0) then
            n_vertices = n_vertices + 1
            number(node) = n_vertices
          end if
          self%vertex(i, f) = number(node)
        end associate
      end do
    end do
    n_used = sum(set%corners)
    allocate (self%start(n_vertices + 1), self%facet(n_used), next(n_vertices))
    next = 0
    do f = 1, set%n
      do i = 1, set%corners(f)
        next(self%vertex(i, f)) = next(self%vertex(i, f)) + 1
      end do
    end do
    self%start(1) = 1
    do i = 1, n_vertices
      self%start(i + 1) = self%start(i) + next(i)
      next(i) = self%start(i)
    end do
    do f = 1, set%n
      do i = 1, set%corners(f)
        k = self%vertex(i, f)
        self%facet(next(k)) = f
        next(k) = next(k) + 1
      end do
    end do
    do f = 1, set%n
      do i = 1, set%corners(f)
        next_corner = merge(1, i + 1, i == set%corners(f))
        self%neighbour(i, f) = facet_across(self, f, self%vertex(i, f), self%vertex(next_corner, f), &
                                            set%corners(f) == 2)
      end do
    end do
  end subroutine adjacency_init

  !> Facets that share a point on edges of a facet, ascending, the facet itself included.
  pure subroutine adjacency_facets_at(self, corners, facet, n_edges, edges, shared, vertex)
    class(adjacency_t), intent(in) :: self
    integer, intent(in) :: corners  !! Number of corners of the facet.
    integer, intent(in) :: facet  !! Facet number.
    integer, intent(in) :: n_edges  !! Number of its edges that contain the point, 0 to 2; of a line its end points.
    integer, intent(in) :: edges(2)  !! These edges, ascending (2).
    integer, allocatable, intent(out) :: shared(:)  !! The facets (n).
    integer, intent(out) :: vertex  !! The vertex, 0 where the point is none.
    integer :: corner, other
    vertex = 0
    if (n_edges == 2 .or. (n_edges == 1 .and. corners == 2)) then
      ! Edges i and i+1 meet at corner i+1, the first and the last one at corner 1; a line ends at corner i.
      corner = edges(n_edges)
      if (corners > 2 .and. edges(1) == 1 .and. corner == corners) corner = 1
      vertex = self%vertex(corner, facet)
      shared = self%facet(self%start(vertex):self%start(vertex + 1) - 1)
    else
      other = 0
      if (n_edges == 1) other = self%neighbour(edges(1), facet)
      shared = [facet]
      if (other > 0) shared = [min(facet, other), max(facet, other)]
    end if
  end subroutine adjacency_facets_at

  !> First other facet at vertex a that has vertex b too; for lines, the first other facet at vertex a. 0 if there is
  !> none.
  pure integer function facet_across(self, f, a, b, is_line) result(other)
    type(adjacency_t), intent(in) :: self  !! Adjacency, with the facets around each vertex.
    integer, intent(in) :: f  !! Facet on this side of the edge.
    integer, intent(in) :: a  !! First vertex of the edge.
    integer, intent(in) :: b  !! Second vertex of the edge.
    logical, intent(in) :: is_line  !! Facets are lines, which share end points.
    integer :: k
    do k = self%start(a), self%start(a + 1) - 1
      other = self%facet(k)
      if (other == f) cycle
      if (is_line) return
      if (any(self%vertex(:, other) == b)) return
    end do
    other = 0
  end function facet_across

  !> Corner of a facet at a vertex.
  pure integer function corner_of(set, adjacency, v, f) result(corner)
    type(facet_set_t), intent(in) :: set  !! Facets of the surface.
    type(adjacency_t), intent(in) :: adjacency  !! Neighbours of the facets.
    integer, intent(in) :: v  !! Vertex number.
    integer, intent(in) :: f  !! Facet number.
    corner = findloc(adjacency%vertex(1:set%corners(f), f), v, dim=1)
  end function corner_of

  !> The two edges that meet at a corner; in two dimensions the end point, twice.
  pure function edges_of_corner(corners, corner) result(edge)
    integer, intent(in) :: corners  !! Number of corners of the facet: 2 line, 3 triangle, 4 quadrilateral.
    integer, intent(in) :: corner  !! Corner.
    integer :: edge(2)  !! Edge numbers (2).
    if (corners == 2) then
      edge = corner
    else
      edge = [corner, modulo(corner - 2, corners) + 1]
    end if
  end function edges_of_corner
end module dotyk_contact_adjacency
