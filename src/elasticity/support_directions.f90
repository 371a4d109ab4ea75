!> Directions in which supports prescribe displacements, node by node: how the reaction at a node is divided among the
!> supports that share it.
!>
!> The reaction r at a node is a sum of forces c_i d_i along the directions d_i of its conditions, with the least sum of
!> c_i^2. Where directions are independent, as those of a floor and a wall, each support gets what it alone can bear;
!> supports that prescribe the same displacement get equal shares. The shares add up to r: nothing counts twice.
module dotyk_elasticity_support_directions
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_base_parcel, only: parcel_t
  use dotyk_base_text, only: text_t
  use dotyk_elasticity_node_axes, only: least_sine, nodal_vector_list_t
  use dotyk_linalg_dense, only: right_singular_vectors
  use dotyk_mesh_body_mesh, only: body_mesh_t
  implicit none
  private

  type, public :: support_directions_t  !! Conditions of all supports of a body, by nodes.
    type(text_t), allocatable :: place(:)  !! Surfaces with supports; size 0 or not allocated without (n_supports).
    logical, allocatable :: is_concentrated(:)  !! Whether these are edges or nodes (n_supports).
    integer, allocatable :: node(:)  !! Node of each condition, ascending (n).
    integer, allocatable :: source(:)  !! Support of each condition, 0 for the axis of symmetry (n).
    real(dp), allocatable :: direction(:, :)  !! Directions of the prescribed displacements (dim, n) [].
  contains
    procedure :: init => directions_init
    procedure :: n_supports => directions_n_supports
    procedure :: hold_nodes => directions_hold_nodes
    procedure :: add_up_reactions => directions_add_up_reactions
    procedure :: weights => directions_weights
    procedure :: carry => directions_carry
  end type support_directions_t

  public :: divide_force, wrench

contains

  !> Take the conditions of all supports; those of one surface are one support.
  subroutine directions_init(self, place, is_concentrated, conditions, n_nodes)
    class(support_directions_t), intent(out) :: self
    type(text_t), intent(in) :: place(:)  !! Surface of each `&support` (n).
    logical, intent(in) :: is_concentrated(:)  !! Whether it is an edge or nodes (n).
    type(nodal_vector_list_t), intent(in) :: conditions  !! Dirichlet conditions; source 0 is the axis of symmetry.
    integer, intent(in) :: n_nodes  !! Number of nodes.
    integer, allocatable :: first(:), order(:)
    integer :: number(0:size(place)), s, k, n
    call conditions%by_node(n_nodes, first, order)
    number(0) = 0
    n = 0
    do s = 1, size(place)
      do k = 1, s
        if (place(k)%s == place(s)%s) exit
      end do
      number(s) = n + 1
      if (k < s) number(s) = number(k)
      n = max(n, number(s))
    end do
    allocate (self%place(n), self%is_concentrated(n))
    do s = 1, size(place)
      self%place(number(s))%s = place(s)%s
      self%is_concentrated(number(s)) = is_concentrated(s)
    end do
    self%node = conditions%node(order)
    self%source = number(conditions%source(order))
    self%direction = conditions%direction(:, order)
  end subroutine directions_init

  !> Number of supports.
  pure integer function directions_n_supports(self) result(n)
    class(support_directions_t), intent(in) :: self
    n = 0
    if (allocated(self%place)) n = size(self%place)
  end function directions_n_supports

  !> Keep the conditions at some nodes.
  pure subroutine directions_hold_nodes(self, node)
    class(support_directions_t), intent(inout) :: self
    integer, intent(in) :: node(:)  !! Nodes in the whole body, ascending, by their new numbers (n_held_nodes).
    integer, allocatable :: number(:), kept(:)
    integer :: i
    if (.not. allocated(self%node)) return
    if (size(self%node) == 0) return
    allocate (number(max(maxval(node), maxval(self%node))), source=0)
    number(node) = [(i, i=1, size(node))]
    kept = pack([(i, i=1, size(self%node))], number(self%node) > 0)
    self%node = number(self%node(kept))
    self%source = self%source(kept)
    self%direction = self%direction(:, kept)
  end subroutine directions_hold_nodes

  !> Forces and moments of the supports on the body, over the nodes that this rank computes.
  subroutine directions_add_up_reactions(self, mesh, reaction, sums)
    class(support_directions_t), intent(in) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    real(dp), intent(in) :: reaction(:, :)  !! Reactions at the nodes (dim, n_nodes) [force].
    real(dp), intent(out) :: sums(:, :)  !! Force and moment about the origin (6, n_supports) [force, force length].
    real(dp), allocatable :: part(:)
    integer :: first, last, i
    sums = 0
    if (.not. allocated(self%node)) return
    last = 0
    do while (last < size(self%node))
      first = last + 1
      last = last_of_node(self%node, first)
      associate (node => self%node(first), source => self%source(first:last))
        if (.not. mesh%is_own_node(node)) cycle
        if (all(source == source(1))) then
          if (source(1) > 0) sums(:, source(1)) = sums(:, source(1)) + wrench(mesh%x(:, node), reaction(:, node))
          cycle
        end if
        part = divide_force(self%direction(:, first:last), reaction(:, node))
        do i = 1, size(source)
          if (source(i) == 0) cycle
          sums(:, source(i)) = sums(:, source(i)) + wrench(mesh%x(:, node), part(i)*self%direction(:, first + i - 1))
        end do
        ! Of directions that are dependent but for rounding.
        i = findloc(source > 0, .true., dim=1)
        sums(:, source(i)) = sums(:, source(i)) + &
                             wrench(mesh%x(:, node), reaction(:, node) - matmul(self%direction(:, first:last), part))
      end associate
    end do
  end subroutine directions_add_up_reactions

  !> Weights of the reactions at the nodes in a component of the force of a support (dim, n_nodes) [].
  function directions_weights(self, support, axis, n_nodes) result(weight)
    class(support_directions_t), intent(in) :: self
    integer, intent(in) :: support  !! The support.
    integer, intent(in) :: axis  !! The component.
    integer, intent(in) :: n_nodes  !! Number of nodes.
    real(dp), allocatable :: weight(:, :), unit(:)
    integer :: first, last, k
    allocate (weight(size(self%direction, 1), n_nodes), unit(size(self%direction, 1)), source=0.0_dp)
    last = 0
    do while (last < size(self%node))
      first = last + 1
      last = last_of_node(self%node, first)
      associate (of_support => self%source(first:last) == support, direction => self%direction(:, first:last))
        do k = 1, merge(size(unit), 0, any(of_support))
          unit = 0
          unit(k) = 1
          weight(k, self%node(first)) = sum(divide_force(direction, unit)*direction(axis, :), mask=of_support)
        end do
      end associate
    end do
  end function directions_weights

  !> Last condition of the node of a condition.
  pure integer function last_of_node(node, first) result(last)
    integer, intent(in) :: node(:)  !! Nodes of the conditions, ascending (n).
    integer, intent(in) :: first  !! The first condition of the node.
    last = first
    do while (last < size(node))
      if (node(last + 1) /= node(first)) exit
      last = last + 1
    end do
  end function last_of_node

  !> Forces along directions with the sum r and the least sum of squares (n) [force].
  function divide_force(direction, r) result(part)
    real(dp), intent(in) :: direction(:, :)  !! Unit vectors (dim, n) [].
    real(dp), intent(in) :: r(:)  !! Force in their span (dim) [force].
    real(dp), allocatable :: part(:)
    type(error_t), allocatable :: failed
    real(dp) :: values(size(r)), vectors(size(r), size(r)), inverse(size(r))
    ! Unit vectors have singular values: there is no error.
    call right_singular_vectors(transpose(direction), values, vectors, failed)
    inverse = 0
    where (values > least_sine*values(1)) inverse = 1/values**2
    part = matmul(matmul(vectors, inverse*matmul(r, vectors)), direction)
  end function divide_force

  !> A force and its moment about the origin (6) [force, force length].
  pure function wrench(x, force)
    real(dp), intent(in) :: x(:)  !! Where it acts (dim) [length].
    real(dp), intent(in) :: force(:)  !! The force (dim) [force].
    real(dp) :: wrench(6)
    real(dp) :: p(3), f(3)
    p = 0
    f = 0
    p(:size(x)) = x
    f(:size(force)) = force
    wrench = [f, p(2)*f(3) - p(3)*f(2), p(3)*f(1) - p(1)*f(3), p(1)*f(2) - p(2)*f(1)]
  end function wrench

  !> Put the conditions into a parcel, or take them out.
  subroutine directions_carry(self, parcel)
    class(support_directions_t), intent(inout) :: self
    type(parcel_t), intent(inout) :: parcel  !! The parcel.
    call parcel%carry(self%place)
    call parcel%carry(self%is_concentrated)
    call parcel%carry(self%node)
    call parcel%carry(self%source)
    call parcel%carry(self%direction)
  end subroutine directions_carry
end module dotyk_elasticity_support_directions
