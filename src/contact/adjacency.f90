!> Which facets of a surface share an edge and which share a corner.
module dotyk_contact_adjacency
  use dotyk_contact_facet_set, only: facet_set_t
  implicit none
  private

  !> Neighbours of the facets of one surface.
  type, public :: adjacency_t
    !> The facet beyond each edge (end point in two dimensions), 0 where the surface ends (4, n). Edge i goes from
    !> corner i to the next.
    integer, allocatable :: neighbour(:, :)
    !> Vertex number of each corner (4, n).
    integer, allocatable :: vertex(:, :)
    !> Facets at vertex v: facet(start(v):start(v+1)-1), ascending.
    integer, allocatable :: start(:), facet(:)
  contains
    procedure :: init => adjacency_init
  end type adjacency_t

contains

  !> Find the neighbours.
  subroutine adjacency_init(self, set)
    class(adjacency_t), intent(out) :: self
    !> Facets.
    type(facet_set_t), intent(in) :: set
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
        self%neighbour(i, f) = beyond(self, f, self%vertex(i, f), self%vertex(next_corner, f), set%corners(f) == 2)
      end do
    end do
  end subroutine adjacency_init

  !> The first other facet at vertex a that has vertex b too; at an end point of a line, the first other one.
  pure integer function beyond(self, f, a, b, is_line) result(other)
    type(adjacency_t), intent(in) :: self
    !> The facet itself.
    integer, intent(in) :: f
    !> Vertices of the edge.
    integer, intent(in) :: a, b
    !> Lines share end points.
    logical, intent(in) :: is_line
    integer :: k
    do k = self%start(a), self%start(a + 1) - 1
      other = self%facet(k)
      if (other == f) cycle
      if (is_line) return
      if (any(self%vertex(:, other) == b)) return
    end do
    other = 0
  end function beyond
end module dotyk_contact_adjacency
