!> The corner space of a body of quadratic elements: displacements that are linear along edges, the coarse space of
!> p-multigrid (E. M. Ronquist and A. T. Patera, J. Sci. Comput. 2, 1987).
!>
!> A node that is no corner has the mean of the corners of its edge, face or element: of two, four or eight. The
!> interpolation P respects supports on both levels: with u in nodal axes, `u_i = H_i R_i^T (mean of R_c u_c)`, where R
!> has the local axes as columns and H sets held components to zero.
module dotyk_elasticity_corner_space
  use dotyk_base_kinds, only: dp, sp
  use dotyk_elasticity_constraint, only: constraint_t, held
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, reference_nodes, shape_functions
  use dotyk_mesh_order_elevation, only: shape_tolerance
  implicit none
  private

  type, public :: corner_space_t  !! The corner space.
    integer :: n = 0  !! Number of corners.
    integer, allocatable :: number(:)  !! Corner number of each node, ascending, 0 for other nodes (n_nodes).
    integer, allocatable :: node(:)  !! Node of each corner (n).
    integer, allocatable :: start(:)  !! First entry of each node in `corner` (n_nodes + 1).
    integer, allocatable :: corner(:)  !! Corners whose mean a node has (start(n_nodes + 1) - 1).
    integer, allocatable :: first(:)  !! First entry of each corner in `dependent` (n + 1).
    !> Nodes that depend on a corner, ascending, the corner's own node included (start(n_nodes + 1) - 1).
    integer, allocatable :: dependent(:)
  contains
    procedure :: init => corner_space_init
    procedure :: init_all_nodes => corner_space_init_all_nodes
    procedure :: make_mesh => corner_space_make_mesh
    procedure :: make_constraint => corner_space_make_constraint
    procedure :: restrict => corner_space_restrict
    procedure :: prolong => corner_space_prolong
  end type corner_space_t

  public :: corner_weights, corners_of_node, number_corners

contains

  !> Find the corners and the interpolation.
  subroutine corner_space_init(self, mesh, conforming)
    class(corner_space_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    !> Whether each node has the same corners in all its elements; there is no corner space otherwise.
    logical, intent(out) :: conforming
    integer, allocatable :: count_of(:), corner(:), found(:), node(:), next(:)
    type(element_kind_t) :: kind
    integer :: b, e, a, i, k, pass
    call number_corners(mesh, self%number, self%node)
    self%n = size(self%node)
    allocate (self%start(mesh%n_nodes() + 1), count_of(mesh%n_nodes()))
    conforming = .true.
    ! The first pass counts the corners of each node, the second one lists them.
    do pass = 1, 2
      count_of = 0
      do i = 1, size(self%number)
        if (self%number(i) == 0) cycle
        count_of(i) = 1
        if (pass == 2) self%corner(self%start(i)) = self%number(i)
      end do
      do b = 1, size(mesh%block)
        kind = element_kind(mesh%block(b)%kind)
        do a = kind%n_corners + 1, kind%n_nodes
          corner = corners_of_node(kind, mesh%block(b)%kind, a)
          do e = 1, size(mesh%block(b)%node, 2)
            i = mesh%block(b)%node(a, e)
            if (count_of(i) == 0) then
              count_of(i) = size(corner)
              if (pass == 2) self%corner(self%start(i):self%start(i + 1) - 1) = &
                ascending(self%number(mesh%block(b)%node(corner, e)))
            else if (pass == 2) then
              found = ascending(self%number(mesh%block(b)%node(corner, e)))
              if (any(self%corner(self%start(i):self%start(i + 1) - 1) /= found)) conforming = .false.
            else if (count_of(i) /= size(corner)) then
              conforming = .false.
            end if
          end do
        end do
      end do
      if (.not. conforming .or. pass == 2) exit
      self%start(1) = 1
      do i = 1, size(count_of)
        self%start(i + 1) = self%start(i) + count_of(i)
      end do
      allocate (self%corner(self%start(size(count_of) + 1) - 1))
    end do
    if (.not. conforming) return
    allocate (self%first(self%n + 2), source=0)
    allocate (self%dependent(size(self%corner)))
    do k = 1, size(self%corner)
      self%first(self%corner(k) + 2) = self%first(self%corner(k) + 2) + 1
    end do
    self%first(1:2) = 1
    do k = 1, self%n
      self%first(k + 2) = self%first(k + 2) + self%first(k + 1)
    end do
    next = self%first(2:)
    do i = 1, size(count_of)
      do k = self%start(i), self%start(i + 1) - 1
        self%dependent(next(self%corner(k))) = i
        next(self%corner(k)) = next(self%corner(k)) + 1
      end do
    end do
    node = self%first(2:)
    call move_alloc(node, self%first)
  end subroutine corner_space_init

  !> The space of all displacements, which makes two levels of one: every node is a corner, in an order of its own.
  subroutine corner_space_init_all_nodes(self, number)
    class(corner_space_t), intent(out) :: self
    integer, intent(in) :: number(:)  !! Corner number of each node: a permutation (n_nodes).
    integer :: i
    self%n = size(number)
    self%number = number
    allocate (self%node(self%n))
    self%node(number) = [(i, i=1, self%n)]
    self%start = [(i, i=1, self%n + 1)]
    self%corner = number
    self%first = self%start
    self%dependent = self%node
  end subroutine corner_space_init_all_nodes

  !> Number the corners of all elements in the order of the nodes.
  subroutine number_corners(mesh, number, node)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, allocatable, intent(out) :: number(:)  !! Corner number of each node, 0 for none (n_nodes).
    integer, allocatable, intent(out) :: node(:)  !! Node of each corner (n_corners).
    type(element_kind_t) :: kind
    integer :: b, e, i
    allocate (number(mesh%n_nodes()), source=0)
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      do e = 1, size(mesh%block(b)%node, 2)
        number(mesh%block(b)%node(:kind%n_corners, e)) = 1
      end do
    end do
    node = pack([(i, i=1, size(number))], number > 0)
    number(node) = [(i, i=1, size(node))]
  end subroutine number_corners

  !> Corners of the edge, face or element of a node.
  function corners_of_node(kind, id, a) result(corner)
    type(element_kind_t), intent(in) :: kind  !! Properties of the element kind.
    integer, intent(in) :: id  !! The element kind: one of the `element_*` constants.
    integer, intent(in) :: a  !! Local number of the node.
    integer, allocatable :: corner(:)  !! Local numbers of its corners.
    real(dp) :: xi(kind%dimension, kind%n_nodes), shape(kind%n_corners)
    integer :: c
    call reference_nodes(id, xi)
    call shape_functions(kind%corner_kind, xi(:, a), shape)
    corner = pack([(c, c=1, kind%n_corners)], shape > shape_tolerance)
  end function corners_of_node

  !> A few numbers in ascending order.
  pure function ascending(list) result(sorted)
    integer, intent(in) :: list(:)  !! The numbers (at most 8).
    integer :: sorted(size(list))  !! The same, sorted (size(list)).
    integer :: i, k
    do i = 1, size(list)
      k = i
      do while (k > 1)
        if (sorted(k - 1) < list(i)) exit
        sorted(k) = sorted(k - 1)
        k = k - 1
      end do
      sorted(k) = list(i)
    end do
  end function ascending

  !> Nonzero weights of the interpolation within an element of a kind: node, corner, weight.
  subroutine corner_weights(id, node, corner, weight)
    integer, intent(in) :: id  !! Element kind: one of the `element_*` constants.
    integer, allocatable, intent(out) :: node(:)  !! Local number of the node (n_weights).
    integer, allocatable, intent(out) :: corner(:)  !! Local number of the corner (n_weights).
    real(dp), allocatable, intent(out) :: weight(:)  !! Weight (n_weights) [].
    type(element_kind_t) :: kind
    integer, allocatable :: of(:)
    integer :: a, i
    kind = element_kind(id)
    allocate (node(0), corner(0), weight(0))
    do a = 1, kind%n_nodes
      of = [a]
      if (a > kind%n_corners) of = corners_of_node(kind, id, a)
      node = [node, (a, i=1, size(of))]
      corner = [corner, of]
      weight = [weight, (1.0_dp/size(of), i=1, size(of))]
    end do
  end subroutine corner_weights

  !> The mesh of linear elements on the corners.
  subroutine corner_space_make_mesh(self, mesh, corner_mesh)
    class(corner_space_t), intent(in) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(body_mesh_t), intent(out) :: corner_mesh  !! Linear elements, one for each element of the body, on the corners.
    type(element_kind_t) :: kind
    integer :: b, e
    if (allocated(mesh%file)) corner_mesh%file = mesh%file
    corner_mesh%dimension = mesh%dimension
    corner_mesh%x = mesh%x(:, self%node)
    corner_mesh%node_tag = mesh%node_tag(self%node)
    allocate (corner_mesh%block(size(mesh%block)))
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      corner_mesh%block(b)%kind = kind%corner_kind
      corner_mesh%block(b)%material = mesh%block(b)%material
      corner_mesh%block(b)%tag = mesh%block(b)%tag
      allocate (corner_mesh%block(b)%node(kind%n_corners, size(mesh%block(b)%node, 2)))
      do e = 1, size(mesh%block(b)%node, 2)
        corner_mesh%block(b)%node(:, e) = self%number(mesh%block(b)%node(:kind%n_corners, e))
      end do
    end do
  end subroutine corner_space_make_mesh

  !> Supports of the corners: axes and held directions of their nodes, at rest.
  subroutine corner_space_make_constraint(self, constraint, corner_constraint)
    class(corner_space_t), intent(in) :: self
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    type(constraint_t), intent(out) :: corner_constraint  !! Equations and nodal axes of the corners.
    call corner_constraint%init(size(constraint%equation, 1), self%n)
    where (constraint%equation(:, self%node) == held) corner_constraint%equation = held
    corner_constraint%frame_of(:) = constraint%frame_of(self%node)
    corner_constraint%frame = constraint%frame
    call corner_constraint%number_equations()
  end subroutine corner_space_make_constraint

  !> P^T r: nodal forces to forces on the corners, along their free unknowns.
  subroutine corner_space_restrict(self, constraint, corner_constraint, factor, r, coarse)
    class(corner_space_t), intent(in) :: self
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    type(constraint_t), intent(in) :: corner_constraint  !! Equations and nodal axes of the corners.
    real(dp), intent(in) :: factor  !! Factor of the result [].
    !> Nodal forces in nodal axes, zero along held components (dim, n_nodes) [force].
    real(sp), intent(in) :: r(size(constraint%equation, 1), size(constraint%equation, 2))
    real(dp), intent(out) :: coarse(:)  !! Forces on the corners (corner_constraint%n_equations) [force].
    real(dp) :: sum(size(r, 1)), force(size(r, 1))
    integer :: c, i, j, k
    !$omp parallel do default(none) shared(self, constraint, corner_constraint, factor, r, coarse) &
    !$omp& private(sum, force, i, j, k) schedule(static)
    do c = 1, self%n
      sum = 0
      do k = self%first(c), self%first(c + 1) - 1
        i = self%dependent(k)
        force = real(r(:, i), dp)/(self%start(i + 1) - self%start(i))
        if (constraint%frame_of(i) > 0) force = matmul(constraint%frame(:, :, constraint%frame_of(i)), force)
        sum = sum + force
      end do
      sum = factor*sum
      if (corner_constraint%frame_of(c) > 0) sum = matmul(sum, &
        corner_constraint%frame(:, :, corner_constraint%frame_of(c)))
      do j = 1, size(sum)
        if (corner_constraint%equation(j, c) > 0) coarse(corner_constraint%equation(j, c)) = sum(j)
      end do
    end do
    !$omp end parallel do
  end subroutine corner_space_restrict

  !> P x: displacements of the corners to those of all nodes.
  subroutine corner_space_prolong(self, constraint, corner_constraint, coarse, x)
    class(corner_space_t), intent(in) :: self
    type(constraint_t), intent(in) :: constraint  !! Equations and nodal axes of the body.
    type(constraint_t), intent(in) :: corner_constraint  !! Equations and nodal axes of the corners.
    real(dp), intent(in) :: coarse(:)  !! Displacements of the corners (corner_constraint%n_equations) [length].
    !> Displacements in nodal axes, zero along held components (dim, n_nodes) [length].
    real(dp), intent(out) :: x(size(constraint%equation, 1), size(constraint%equation, 2))
    real(dp), allocatable :: u(:, :)
    integer :: i
    allocate (u(size(x, 1), self%n))
    call corner_constraint%expand(coarse, u, .false.)
    !$omp parallel do default(none) shared(self, constraint, x, u) schedule(static)
    do i = 1, size(x, 2)
      call mean_of_corners(size(x, 1), self%start(i + 1) - self%start(i), &
                           self%corner(self%start(i):self%start(i + 1) - 1), u, x(:, i))
      if (constraint%frame_of(i) > 0) x(:, i) = matmul(x(:, i), constraint%frame(:, :, constraint%frame_of(i)))
      where (constraint%equation(:, i) == held) x(:, i) = 0
    end do
    !$omp end parallel do
  end subroutine corner_space_prolong

  !> Mean of the displacements of some corners.
  pure subroutine mean_of_corners(dim, n, corner, u, mean)
    integer, intent(in) :: dim  !! Number of components.
    integer, intent(in) :: n  !! Number of corners.
    integer, intent(in) :: corner(n)  !! The corners (n).
    real(dp), intent(in) :: u(dim, *)  !! Displacements of all corners in global axes (dim, n_corners) [length].
    real(dp), intent(out) :: mean(dim)  !! Their mean (dim) [length].
    integer :: k
    mean = u(:, corner(1))
    do k = 2, n
      mean = mean + u(:, corner(k))
    end do
    mean = mean/n
  end subroutine mean_of_corners
end module dotyk_elasticity_corner_space
