!> A growing list of unit vectors at nodes, each with a value and the support of its origin, and its order by nodes.
!>
!> The lists of `dotyk_elasticity_support`: normals of faces, and Dirichlet conditions `direction . u = value`.
module dotyk_elasticity_nodal_vector_list
  use dotyk_base_kinds, only: dp
  implicit none
  private

  type, public :: nodal_vector_list_t  !! The list.
    integer :: n = 0  !! Number of entries; the arrays may be longer.
    integer, allocatable :: node(:)  !! Node of each entry (>= n).
    integer, allocatable :: source(:)  !! Index of the support of each entry (>= n).
    real(dp), allocatable :: direction(:, :)  !! Unit vectors (dim, >= n) [].
    !> Value of each entry: an area [length^(dim-1)] or a displacement [length] (>= n).
    real(dp), allocatable :: value(:)
  contains
    procedure :: init => nodal_vector_list_init
    procedure :: add => nodal_vector_list_add
    procedure :: by_node => nodal_vector_list_by_node
  end type nodal_vector_list_t

contains

  !> Create an empty list.
  subroutine nodal_vector_list_init(self, dim)
    class(nodal_vector_list_t), intent(out) :: self
    integer, intent(in) :: dim  !! Number of components of the vectors.
    integer, parameter :: few = 64  !! Length of the arrays at first; they double when they are full.
    allocate (self%node(few), self%source(few), self%direction(dim, few), self%value(few))
  end subroutine nodal_vector_list_init

  !> Add an entry.
  subroutine nodal_vector_list_add(self, node, source, direction, value)
    class(nodal_vector_list_t), intent(inout) :: self
    integer, intent(in) :: node  !! Node.
    integer, intent(in) :: source  !! Index of the support.
    real(dp), intent(in) :: direction(:)  !! Unit vector (dim) [].
    real(dp), intent(in) :: value  !! Value [length], or [length^(dim-1)] of normals.
    integer :: more
    integer, allocatable :: integers(:)
    real(dp), allocatable :: reals(:), vectors(:, :)
    if (self%n == size(self%node)) then
      more = 2*self%n
      allocate (integers(more))
      integers(:self%n) = self%node
      call move_alloc(integers, self%node)
      allocate (integers(more))
      integers(:self%n) = self%source
      call move_alloc(integers, self%source)
      allocate (reals(more))
      reals(:self%n) = self%value
      call move_alloc(reals, self%value)
      allocate (vectors(size(direction), more))
      vectors(:, :self%n) = self%direction
      call move_alloc(vectors, self%direction)
    end if
    self%n = self%n + 1
    self%node(self%n) = node
    self%source(self%n) = source
    self%direction(:, self%n) = direction
    self%value(self%n) = value
  end subroutine nodal_vector_list_add

  !> List the entries of each node, in the order in which they were added.
  subroutine nodal_vector_list_by_node(self, n_nodes, first, order)
    class(nodal_vector_list_t), intent(in) :: self
    integer, intent(in) :: n_nodes  !! Number of nodes.
    integer, allocatable, intent(out) :: first(:)  !! First entry of each node in `order` (n_nodes + 2).
    integer, allocatable, intent(out) :: order(:)  !! Entries by nodes (n).
    integer :: i, k
    allocate (first(n_nodes + 2), source=0)
    allocate (order(self%n))
    do k = 1, self%n
      first(self%node(k) + 2) = first(self%node(k) + 2) + 1
    end do
    first(1:2) = 1
    do i = 3, n_nodes + 2
      first(i) = first(i) + first(i - 1)
    end do
    do k = 1, self%n
      order(first(self%node(k) + 1)) = k
      first(self%node(k) + 1) = first(self%node(k) + 1) + 1
    end do
  end subroutine nodal_vector_list_by_node
end module dotyk_elasticity_nodal_vector_list
