!> The product with the stiffness element by element, for the benchmark of p-multigrid: straight isotropic tet10.
module element_products
  use, intrinsic :: iso_c_binding, only: c_double, c_float, c_int32_t, c_int64_t, c_int8_t
  use dotyk_base_kinds, only: dp, int64, sp
  use dotyk_base_timer, only: wall_time
  use dotyk_elasticity_body, only: body_t
  use dotyk_elasticity_constraint, only: constraint_t
  use dotyk_elasticity_two_levels, only: order_nodes
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element_ordering, only: morton_order
  implicit none
  private
  public :: measure_elements

  integer, parameter :: lanes = 8  !! Elements of a group.

  interface
    !> Bytes of a group.
    integer(c_int64_t) function dotyk_group_bytes() bind(c)
      import :: c_int64_t
    end function dotyk_group_bytes

    !> Fill the groups.
    subroutine dotyk_fill_groups(n_elements, node, x, lambda, mu, group) bind(c)
      import :: c_double, c_int32_t, c_int8_t
      integer(c_int32_t), value :: n_elements  !! Number of elements.
      integer(c_int32_t), intent(in) :: node(10, *)  !! Nodes of the elements (10, n_elements).
      real(c_double), intent(in) :: x(3, *)  !! Nodes (3, n_nodes) [length].
      real(c_double), value :: lambda, mu  !! Lame's parameters [pressure].
      integer(c_int8_t), intent(inout) :: group(*)  !! Groups of elements.
    end subroutine dotyk_fill_groups

    !> r = b - K x.
    subroutine dotyk_element_residual(n_groups, group, n_nodes, first, place, b, x, force, r) bind(c)
      import :: c_float, c_int32_t, c_int8_t
      integer(c_int32_t), value :: n_groups  !! Number of groups.
      integer(c_int8_t), intent(in) :: group(*)  !! Groups of elements.
      integer(c_int32_t), value :: n_nodes  !! Number of nodes.
      integer(c_int32_t), intent(in) :: first(*)  !! First entry of each node in `place`, from 0 (n_nodes + 1).
      integer(c_int32_t), intent(in) :: place(*)  !! Places of forces, from 0.
      real(c_float), intent(in) :: b(*), x(*)  !! Right-hand side and vector (3, n_nodes).
      real(c_float), intent(inout) :: force(*)  !! Forces of the elements (30*lanes, n_groups).
      real(c_float), intent(inout) :: r(*)  !! Residual (3, n_nodes).
    end subroutine dotyk_element_residual
  end interface

contains

  !> Time and traffic of a residual r = -K x.
  subroutine measure_elements(body, x, seconds, bytes, r)
    type(body_t), intent(in) :: body  !! The body: straight isotropic tet10.
    real(sp), intent(in) :: x(:)  !! Displacements, nodes in the order of `order_nodes` (3*n_nodes) [length].
    real(dp), intent(out) :: seconds  !! Least time of a residual [s].
    real(dp), intent(out) :: bytes  !! Least traffic with the memory [bytes].
    real(sp), allocatable, intent(out) :: r(:)  !! The residual (3*n_nodes) [force].
    type(body_mesh_t) :: mesh
    type(constraint_t) :: constraint
    integer, allocatable :: order(:), node_order(:), node(:, :), first(:), place(:), next(:)
    integer(c_int8_t), allocatable :: group(:)
    real(sp), allocatable :: b(:), force(:)
    real(dp) :: start
    integer :: n, n_groups, e, a, k, i
    call order_nodes(body%mesh, body%constraint, mesh, constraint, node_order)
    n = size(mesh%block(1)%node, 2)
    allocate (order(n))
    call morton_order(3, mesh%x, mesh%block(1)%node, order)
    node = mesh%block(1)%node(:, order)
    n_groups = (n + lanes - 1)/lanes
    allocate (group(n_groups*dotyk_group_bytes()), force(30*lanes*n_groups), b(size(mesh%x)))
    allocate (r(size(mesh%x)))
    call dotyk_fill_groups(n, node, mesh%x, body%material(1)%lambda, body%material(1)%mu, group)
    allocate (first(mesh%n_nodes() + 2), source=0)
    do e = 1, n
      do a = 1, 10
        first(node(a, e) + 2) = first(node(a, e) + 2) + 1
      end do
    end do
    do i = 1, mesh%n_nodes()
      first(i + 2) = first(i + 2) + first(i + 1)
    end do
    next = first(2:)
    allocate (place(10*n))
    do e = 1, n
      do a = 1, 10
        next(node(a, e)) = next(node(a, e)) + 1
        place(next(node(a, e))) = ((e - 1)/lanes)*30*lanes + (a - 1)*3*lanes + mod(e - 1, lanes)
      end do
    end do
    b = 0
    seconds = huge(seconds)
    do k = 1, 8
      start = wall_time()
      call dotyk_element_residual(n_groups, group, mesh%n_nodes(), first(2:), place, b, x, force, r)
      seconds = min(seconds, wall_time() - start)
    end do
    ! Groups, forces written (read before) and read, places, vectors.
    bytes = real(n_groups, dp)*dotyk_group_bytes() + 12.0_dp*size(force) + 4.0_dp*size(place) + 16.0_dp*size(x)
  end subroutine measure_elements
end module element_products
