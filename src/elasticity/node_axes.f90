!> Nodal axes and prescribed displacements of one node from all its Dirichlet conditions, and growing lists of
!> conditions: unit vectors at nodes, each with a value and the support of its origin.
!>
!> Conditions are `direction . u = value` with unit vectors of any direction. Gram-Schmidt with pivoting finds the
!> independent ones, which become axes of the node (rotated unknowns), and checks the others for contradictions.
module dotyk_elasticity_node_axes
  use dotyk_base_kinds, only: dp
  use dotyk_base_thresholds, only: rounding, same_number
  use dotyk_mesh_facet, only: frame_of_normal
  implicit none
  private
  public :: combine_conditions

  type, public :: node_axes_t  !! Axes and prescribed displacements of a node.
    integer :: rank = 0  !! Number of independent conditions.
    logical :: is_global = .true.  !! Whether the axes are the global ones.
    real(dp) :: frame(3, 3) = 0  !! Axes as columns; of two-dimensional bodies in the first (2, 2) entries (3, 3) [].
    logical :: is_given(3) = .false.  !! Whether the displacement along each axis is prescribed (3).
    real(dp) :: value(3) = 0  !! Prescribed displacement along each axis, else 0 (3) [length].
    integer :: contradiction = 0  !! Index of a condition that contradicts the others, 0 for none.
    real(dp) :: conflicting_value = 0  !! Value of the contradicting condition [length].
    real(dp) :: implied_value = 0  !! Value that the other conditions imply for its direction [length].
  end type node_axes_t


  !> Smallest sine between a direction and the span of others for which it is independent of them. Coordinates of mesh
  !> files with few digits stay below it; edges of real bodies stay above.
  real(dp), parameter, public :: least_sine = 1.0e-3_dp

  type, public :: nodal_vector_list_t  !! The list.
    integer :: n = 0  !! Number of entries; the arrays may be longer.
    integer, allocatable :: node(:)  !! Node of each entry (>= n).
    integer, allocatable :: source(:)  !! Index of the support of each entry (>= n).
    real(dp), allocatable :: direction(:, :)  !! Unit vectors (dim, >= n) [].
    real(dp), allocatable :: value(:)  !! Value of each entry: area [length^(dim-1)] or displacement [length] (>= n).
  contains
    procedure :: init => nodal_vector_list_init
    procedure :: add => nodal_vector_list_add
    procedure :: by_node => nodal_vector_list_by_node
  end type nodal_vector_list_t

contains

  !> Combine the Dirichlet conditions `direction . u = value` of one node.
  pure function combine_conditions(dim, n, direction, value, tolerance) result(axes)
    integer, intent(in) :: dim  !! Number of displacement components.
    integer, intent(in) :: n  !! Number of conditions.
    real(dp), intent(in) :: direction(dim, n)  !! Unit vectors (dim, n) [].
    real(dp), intent(in) :: value(n)  !! Prescribed displacements along them (n) [length].
    real(dp), intent(in) :: tolerance  !! Differences of displacements below this are rounding errors [length].
    type(node_axes_t) :: axes
    real(dp) :: q(dim, dim), z(dim), remainder(dim, n), residual(n), length, greatest, u(dim)
    logical :: used(n)
    integer :: i, k, best
    q = 0
    z = 0
    used = .false.
    remainder = direction
    residual = value
    ! Gram-Schmidt with pivoting: always the direction with the largest remainder; the first of equals.
    do k = 1, dim
      best = 0
      greatest = least_sine
      do i = 1, n
        if (used(i)) cycle
        length = norm2(remainder(:, i))
        if (length > greatest*(1 + same_number)) then
          greatest = length
          best = i
        end if
      end do
      if (best == 0) exit
      used(best) = .true.
      axes%rank = k
      q(:, k) = remainder(:, best)/greatest
      z(k) = residual(best)/greatest
      do i = 1, n
        if (used(i)) cycle
        length = dot_product(remainder(:, i), q(:, k))
        remainder(:, i) = remainder(:, i) - length*q(:, k)
        residual(i) = residual(i) - length*z(k)
      end do
    end do
    do i = 1, n
      if (used(i)) cycle
      ! The remainder of a dependent direction has a length of up to `least_sine`: its value is uncertain by as much.
      if (abs(residual(i)) > tolerance + norm2(remainder(:, i))*maxval(abs(value))) then
        axes%contradiction = i
        axes%conflicting_value = value(i)
        axes%implied_value = value(i) - residual(i)
        return
      end if
    end do
    if (axes%rank == 0) return
    call choose_axes(dim, q, axes)
    if (axes%is_global) then
      u = matmul(q(:, :axes%rank), z(:axes%rank))
      do i = 1, dim
        if (axes%is_given(i)) axes%value(i) = u(i)
      end do
    else
      axes%frame(:dim, :dim) = q
      axes%is_given(:axes%rank) = .true.
      axes%value(:axes%rank) = z(:axes%rank)
    end if
  end function combine_conditions

  !> Complete the axes, and find out whether the global axes can be used.
  pure subroutine choose_axes(dim, q, axes)
    integer, intent(in) :: dim  !! Number of displacement components, 2 or 3.
    !> Orthonormal directions in the first `rank` columns; completed on return unless the global axes are used
    !> (dim, dim) [].
    real(dp), intent(inout) :: q(dim, dim)
    type(node_axes_t), intent(inout) :: axes  !! `rank` on entry; `is_global`, `is_given` and `frame` on return.
    real(dp) :: local(dim, dim)
    integer :: i, free
    axes%is_global = .true.
    do i = 1, 3
      axes%frame(i, i) = 1
    end do
    if (axes%rank == dim) then
      axes%is_given(:dim) = .true.
      return
    end if
    if (axes%rank == 1) then
      i = maxloc(abs(q(:, 1)), 1)
      if (all(abs(without(q(:, 1), i)) < rounding)) then
        axes%is_given(i) = .true.
        return
      end if
      call frame_of_normal(dim, q(:, 1), local)
      q(:, 2:) = local(:, :dim - 1)
    else
      q(:, 3) = [q(2, 1)*q(3, 2) - q(3, 1)*q(2, 2), q(3, 1)*q(1, 2) - q(1, 1)*q(3, 2), &
                 q(1, 1)*q(2, 2) - q(2, 1)*q(1, 2)]
      free = maxloc(abs(q(:, 3)), 1)
      if (all(abs(without(q(:, 3), free)) < rounding)) then
        axes%is_given = .true.
        axes%is_given(free) = .false.
        return
      end if
    end if
    axes%is_global = .false.
  end subroutine choose_axes

  !> A vector without one of its components (n-1) [].
  pure function without(vector, i) result(others)
    real(dp), intent(in) :: vector(:)  !! The vector (n) [].
    integer, intent(in) :: i  !! Index of the component that is eliminated.
    real(dp) :: others(size(vector) - 1)
    others = [vector(:i - 1), vector(i + 1:)]
  end function without

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
end module dotyk_elasticity_node_axes
