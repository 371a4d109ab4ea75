!> Which nodes of a body share elements.
module dotyk_elasticity_node_graph
  use omp_lib, only: omp_get_max_threads, omp_in_parallel
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private

  !> Elements of all kinds one after the other, and the elements of each node.
  type, public :: incidence_t
    !> Nodes of element e: node(start(e) : start(e + 1) - 1).
    integer, allocatable :: start(:), node(:)
    !> Elements of node i: element(first(i) : first(i + 1) - 1), ascending.
    integer, allocatable :: first(:), element(:)
  contains
    procedure :: init => incidence_init
  end type incidence_t

  public :: node_graph

contains

  !> List the elements of all nodes.
  subroutine incidence_init(self, mesh)
    class(incidence_t), intent(out) :: self
    !> The body's elements.
    type(body_mesh_t), intent(in) :: mesh
    integer :: i, n_elements, n_entries
    n_elements = 0
    n_entries = 0
    do i = 1, size(mesh%block)
      n_elements = n_elements + size(mesh%block(i)%node, 2)
      n_entries = n_entries + size(mesh%block(i)%node)
    end do
    allocate (self%start(n_elements + 1), self%node(n_entries))
    self%start(1) = 1
    n_elements = 0
    n_entries = 0
    do i = 1, size(mesh%block)
      call append(size(mesh%block(i)%node, 1), size(mesh%block(i)%node, 2), mesh%block(i)%node, n_elements, n_entries, &
        self%start, self%node)
    end do
    call elements_of_nodes(mesh%n_nodes(), n_elements, self%start, self%node, self%first, self%element)
  end subroutine incidence_init

  !> Nodal adjacency: the nodes that share an element with each node, ascending, without the node itself.
  subroutine node_graph(mesh, start, neighbour)
    !> The body's elements.
    type(body_mesh_t), intent(in) :: mesh
    !> First neighbour of each node (n_nodes + 1).
    integer, allocatable, intent(out) :: start(:)
    !> Neighbours.
    integer, allocatable, intent(out) :: neighbour(:)
    type(incidence_t) :: of
    integer, allocatable :: mark(:)
    integer :: n, i
    logical :: serial
    n = mesh%n_nodes()
    call of%init(mesh)
    allocate (start(n + 1))
    start(1) = 1
    !$omp parallel default(none) shared(n, of, start) private(mark, i)
    allocate (mark(n), source=0)
    !$omp do schedule(dynamic, 512)
    do i = 1, n
      call count_neighbours(i, of%start, of%node, of%first, of%element, mark, start(i + 1))
    end do
    !$omp end do
    deallocate (mark)
    !$omp end parallel
    do i = 1, n
      start(i + 1) = start(i) + start(i + 1)
    end do
    allocate (neighbour(start(n + 1) - 1))
    serial = omp_in_parallel()
    if (.not. serial) serial = omp_get_max_threads() == 1
    !$omp parallel default(none) shared(n, of, start, neighbour, serial) private(mark, i)
    allocate (mark(n), source=0)
    !$omp do schedule(dynamic, 512)
    do i = 1, n
      call list_neighbours(i, of%start, of%node, of%first, of%element, mark, neighbour(start(i):start(i + 1) - 1))
      if (.not. serial) call sort_ascending(neighbour(start(i):start(i + 1) - 1))
    end do
    !$omp end do
    deallocate (mark)
    !$omp end parallel
    if (serial) call sort_by_transposing(n, start, neighbour)
  end subroutine node_graph

  !> Append the elements of a block to the list of all.
  pure subroutine append(n, m, node, n_elements, n_entries, flat_start, flat)
    integer, intent(in) :: n, m
    integer, intent(in) :: node(n, m)
    integer, intent(inout) :: n_elements, n_entries
    integer, intent(inout) :: flat_start(:), flat(:)
    integer :: e
    do e = 1, m
      flat(n_entries + 1:n_entries + n) = node(:, e)
      n_entries = n_entries + n
      n_elements = n_elements + 1
      flat_start(n_elements + 1) = n_entries + 1
    end do
  end subroutine append

  !> The elements of each node.
  pure subroutine elements_of_nodes(n, n_elements, flat_start, flat, first, of_node)
    integer, intent(in) :: n, n_elements
    integer, intent(in) :: flat_start(:), flat(:)
    !> First element of each node (n + 1).
    integer, allocatable, intent(out) :: first(:)
    !> Elements.
    integer, allocatable, intent(out) :: of_node(:)
    integer :: e, k
    allocate (first(n + 2), source=0)
    allocate (of_node(size(flat)))
    do k = 1, size(flat)
      first(flat(k) + 2) = first(flat(k) + 2) + 1
    end do
    first(1) = 1
    first(2) = 1
    do k = 1, n
      first(k + 2) = first(k + 2) + first(k + 1)
    end do
    do e = 1, n_elements
      do k = flat_start(e), flat_start(e + 1) - 1
        of_node(first(flat(k) + 1)) = e
        first(flat(k) + 1) = first(flat(k) + 1) + 1
      end do
    end do
  end subroutine elements_of_nodes

  !> Count the neighbours of a node.
  pure subroutine count_neighbours(i, flat_start, flat, first, of_node, mark, degree)
    integer, intent(in) :: i
    integer, intent(in), contiguous :: flat_start(:), flat(:), first(:), of_node(:)
    !> Work array, nowhere i (n).
    integer, intent(inout), contiguous :: mark(:)
    integer, intent(out) :: degree
    integer :: k, p
    degree = 0
    mark(i) = i
    do k = first(i), first(i + 1) - 1
      do p = flat_start(of_node(k)), flat_start(of_node(k) + 1) - 1
        if (mark(flat(p)) == i) cycle
        mark(flat(p)) = i
        degree = degree + 1
      end do
    end do
  end subroutine count_neighbours

  !> List the neighbours of a node, in any order.
  pure subroutine list_neighbours(i, flat_start, flat, first, of_node, mark, neighbour)
    integer, intent(in) :: i
    integer, intent(in), contiguous :: flat_start(:), flat(:), first(:), of_node(:)
    !> Work array, nowhere i (n).
    integer, intent(inout), contiguous :: mark(:)
    integer, intent(out), contiguous :: neighbour(:)
    integer :: k, p, last
    last = 0
    mark(i) = i
    do k = first(i), first(i + 1) - 1
      do p = flat_start(of_node(k)), flat_start(of_node(k) + 1) - 1
        if (mark(flat(p)) == i) cycle
        mark(flat(p)) = i
        last = last + 1
        neighbour(last) = flat(p)
      end do
    end do
  end subroutine list_neighbours

  !> Sort the neighbours of all nodes: a graph is symmetric, so that its transpose is itself with sorted rows. Faster than sorting each
  !> row, but for one thread.
  pure subroutine sort_by_transposing(n, start, neighbour)
    integer, intent(in) :: n
    integer, intent(in) :: start(n + 1)
    integer, allocatable, intent(inout) :: neighbour(:)
    integer, allocatable :: next(:), sorted(:)
    integer :: i, k
    allocate (sorted(size(neighbour)), next(n))
    next(:) = start(:n)
    do i = 1, n
      do k = start(i), start(i + 1) - 1
        sorted(next(neighbour(k))) = i
        next(neighbour(k)) = next(neighbour(k)) + 1
      end do
    end do
    call move_alloc(sorted, neighbour)
  end subroutine sort_by_transposing

  !> Sort some tens of numbers (Shell's method, gaps of M. Ciura, FCT 2001).
  pure subroutine sort_ascending(list)
    integer, intent(inout), contiguous :: list(:)
    integer, parameter :: gap(8) = [701, 301, 132, 57, 23, 10, 4, 1]
    integer :: g, i, k, value
    do g = 1, size(gap)
      if (gap(g) >= size(list)) cycle
      do i = 1 + gap(g), size(list)
        value = list(i)
        do k = i - gap(g), 1, -gap(g)
          if (list(k) <= value) exit
          list(k + gap(g)) = list(k)
        end do
        list(k + gap(g)) = value
      end do
    end do
  end subroutine sort_ascending
end module dotyk_elasticity_node_graph
