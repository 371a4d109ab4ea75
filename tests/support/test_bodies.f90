!> Bodies for tests: the unit square or cube, or its image under a map, from elements of any kind, without a mesh
!> file.
module test_bodies
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_analysis, only: analysis_dimension
  use dotyk_elasticity_body, only: body_t, hold_body, stiffness_t
  use dotyk_elasticity_discretization_error, only: estimate_discretization_errors
  use dotyk_elasticity_gradient_recovery, only: gradient_recovery_t
  use dotyk_elasticity_material, only: material_t
  use dotyk_elasticity_support, only: collect_supports, support_t
  use dotyk_linalg_cholesky, only: cholesky_t
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t, element_tet4, element_tri3, element_hex8, element_quad4, &
    element_pyramid5, max_facet_nodes, reference_nodes, shape_functions
  use dotyk_mesh_held_part, only: choose_part
  use dotyk_mesh_surface, only: surface_t
  implicit none
  private

  integer, parameter, public :: undistorted = 0  !! Regular mesh.
  integer, parameter, public :: straight = 1  !! Interior corners are displaced irregularly, edges stay straight.
  integer, parameter, public :: curved = 2  !! A smooth map of the box onto itself: edges are curved.

  type, public :: box_t  !! A meshed unit square or cube.
    type(body_mesh_t) :: mesh  !! Elements and nodes.
    integer :: cells = 0  !! Number of cells along each axis.
    integer, allocatable :: lattice(:, :)  !! Position of each node in a lattice of half cells (dim, n_nodes).
  contains
    procedure :: init => box_init
    procedure :: side => box_side
    procedure :: sides => box_sides
    procedure :: transform => box_transform
    procedure :: repeat => box_repeat
  end type box_t

  public :: estimate_discretization_error, hold_own_part, make_support, make_body, solve, rotation, nodal_forces, steel

contains

  !> Of one body: squared error of each element in the energy norm, A(e,e), and the squared norm A(u,u) of its
  !> displacement.
  subroutine estimate_discretization_error(mesh, analysis, material, u, square, norm_square, error)
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material(:)  !! Materials of the body (n_materials).
    real(dp), intent(in), contiguous :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    !> Squared errors of the elements, in the order of the blocks (n_elements) [energy].
    real(dp), intent(out) :: square(:)
    real(dp), intent(out) :: norm_square  !! Squared energy norm of the displacement [energy].
    !> Allocated where the modulus field is no formula or not positive; assembly finds this first.
    type(error_t), allocatable, intent(out) :: error
    type(gradient_recovery_t) :: recovery(size(material))
    real(dp), allocatable :: all_u(:, :, :), all_square(:, :)
    real(dp) :: all_norms(1)
    all_u = reshape(u, [1, size(u, 1), size(u, 2)])
    allocate (all_square(1, size(square)))
    call estimate_discretization_errors(mesh, analysis, material, all_u, recovery, all_square, all_norms, error)
    square = all_square(1, :)
    norm_square = all_norms(1)
  end subroutine estimate_discretization_error

  !> Reduce a body to the part of a rank.
  subroutine hold_own_part(body, element_rank, rank, number)
    type(body_t), intent(inout) :: body  !! The body, with supports and loads, not assembled.
    integer, intent(in) :: element_rank(:)  !! Rank of each element, from 0, through all blocks (n_elements).
    integer, intent(in) :: rank  !! The rank, from 0.
    !> Number of each node of the whole body in the part, 0 where it is not held (n_nodes).
    integer, allocatable, intent(out) :: number(:)
    logical, allocatable :: holds(:), own_node(:)
    call choose_part(body%mesh, element_rank, rank, holds, own_node)
    call hold_body(body, holds, element_rank == rank, own_node, number)
    body%mesh%whole%in_parts = .true.
    call body%number_part(body%mesh%whole%own_node)
  end subroutine hold_own_part

  !> Mesh the unit square or cube.
  subroutine box_init(self, kind, cells, distortion)
    class(box_t), intent(out) :: self
    integer, intent(in) :: kind  !! Element kind.
    !> Number of cells along each axis; a cell is divided into two triangles, six tetrahedra, two prisms or
    !> three pyramids.
    integer, intent(in) :: cells
    integer, intent(in) :: distortion  !! Distortion: one of the constants above.
    type(element_kind_t) :: properties
    real(dp), allocatable :: xi(:, :), corner(:, :, :), x(:), linear(:)
    integer, allocatable :: number(:), place(:, :), node(:, :)
    integer :: dim, n, n_pieces, cell, piece, a, e, key, n_nodes, origin(3), d
    properties = element_kind(kind)
    dim = properties%dimension
    n = properties%n_nodes
    self%cells = cells
    allocate (xi(dim, n))
    call reference_nodes(kind, xi)
    call split_cell(properties, corner)
    n_pieces = size(corner, 3)
    allocate (number(0:(2*cells + 1)**dim - 1), source=0)
    allocate (place(dim, (2*cells + 1)**dim), node(n, n_pieces*cells**dim), x(dim))
    allocate (linear(properties%n_corners))
    n_nodes = 0
    e = 0
    do cell = 0, cells**dim - 1
      origin = [mod(cell, cells), mod(cell/cells, cells), cell/cells**2]
      do piece = 1, n_pieces
        e = e + 1
        do a = 1, n
          call shape_functions(properties%corner_kind, xi(:, a), linear)
          x = 2*(origin(:dim) + matmul(in_cell(properties, origin(:dim), corner(:, :, piece)), linear))
          key = 0
          do d = dim, 1, -1
            key = key*(2*cells + 1) + nint(x(d))
          end do
          if (number(key) == 0) then
            n_nodes = n_nodes + 1
            number(key) = n_nodes
            place(:, n_nodes) = nint(x)
          end if
          node(a, e) = number(key)
        end do
      end do
    end do
    self%lattice = place(:, :n_nodes)
    self%mesh%file = 'box'
    self%mesh%dimension = dim
    allocate (self%mesh%x(dim, n_nodes), self%mesh%node_tag(n_nodes), self%mesh%block(1))
    self%mesh%node_tag = [(int(a, int64) + 100, a=1, n_nodes)]
    self%mesh%block(1)%kind = kind
    self%mesh%block(1)%node = node
    self%mesh%block(1)%tag = [(int(e, int64) + 1000, e=1, size(node, 2))]
    self%mesh%x = real(self%lattice, dp)/(2*cells)
    if (distortion == straight) call move_corners(self, properties)
    if (distortion == curved) call bend(self)
  end subroutine box_init

  !> Divide a unit cell into elements.
  subroutine split_cell(properties, corner)
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    real(dp), allocatable, intent(out) :: corner(:, :, :)  !! Corners of the elements (dim, n_corners, n_pieces) [].
    integer, parameter :: order(3, 6) = reshape([1, 2, 3, 2, 3, 1, 3, 1, 2, 1, 3, 2, 3, 2, 1, 2, 1, 3], [3, 6])
    real(dp), allocatable :: xi(:, :)
    integer :: i, k
    select case (properties%corner_kind)
    case (element_quad4, element_hex8)
      allocate (corner(properties%dimension, properties%n_corners, 1), xi(properties%dimension, properties%n_corners))
      call reference_nodes(properties%corner_kind, xi)
      corner(:, :, 1) = 0.5_dp*(xi + 1)
    case (element_tri3)
      corner = reshape(real([0, 0, 1, 0, 0, 1, 1, 1, 0, 1, 1, 0], dp), [2, 3, 2])
    case (element_tet4)
      allocate (corner(3, 4, 6), source=0.0_dp)
      do i = 1, 6
        do k = 1, 3
          corner(:, k + 1, i) = corner(:, k, i)
          corner(order(k, i), k + 1, i) = 1
        end do
        if (i > 3) corner(:, 2:3, i) = corner(:, [3, 2], i)
      end do
    case (element_pyramid5)
      ! All apexes are at the origin.
      corner = reshape(real([1, 0, 0, 1, 0, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 1, 0, 1, 1, 0, 1, 1, 1, 0, 1, 1, 0, 0, 0, &
        0, 0, 1, 0, 1, 1, 1, 1, 1, 1, 0, 1, 0, 0, 0], dp), [3, 5, 3])
    case default
      corner = reshape(real([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1, &
        1, 1, 0, 0, 1, 0, 1, 0, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1], dp), [3, 6, 2])
    end select
  end subroutine split_cell

  !> Corners of an element in its cell. Neighbouring cells of pyramids are mirror images: whole faces meet whole ones.
  function in_cell(properties, cell, corner) result(place)
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    integer, intent(in) :: cell(:)  !! Cell (dim).
    real(dp), intent(in) :: corner(:, :)  !! Corners in a cell that is not mirrored (dim, n_corners) [].
    real(dp) :: place(size(corner, 1), size(corner, 2))
    integer :: d
    place = corner
    if (properties%corner_kind /= element_pyramid5) return
    do d = 1, size(cell)
      if (mod(cell(d), 2) == 1) place(d, :) = 1 - place(d, :)
    end do
    if (mod(sum(mod(cell, 2)), 2) == 1) place(:, [2, 4]) = place(:, [4, 2])
  end function in_cell

  !> Displace the interior corners, and put the other nodes at their positions on straight elements.
  subroutine move_corners(self, properties)
    type(box_t), intent(inout) :: self  !! The box.
    type(element_kind_t), intent(in) :: properties  !! Properties of the element kind.
    real(dp), allocatable :: xi(:, :), linear(:)
    integer :: i, e, a, d
    do i = 1, size(self%lattice, 2)
      if (any(mod(self%lattice(:, i), 2) /= 0)) cycle
      if (any(self%lattice(:, i) == 0 .or. self%lattice(:, i) == 2*self%cells)) cycle
      do d = 1, self%mesh%dimension
        self%mesh%x(d, i) = self%mesh%x(d, i) + 0.15_dp/self%cells*sin(12.9898_dp*i + 78.233_dp*d)
      end do
    end do
    if (properties%order == 1) return
    allocate (xi(properties%dimension, properties%n_nodes), linear(properties%n_corners))
    call reference_nodes(self%mesh%block(1)%kind, xi)
    do e = 1, self%mesh%n_elements()
      associate (node => self%mesh%block(1)%node(:, e))
        do a = properties%n_corners + 1, properties%n_nodes
          call shape_functions(properties%corner_kind, xi(:, a), linear)
          self%mesh%x(:, node(a)) = matmul(self%mesh%x(:, node(:properties%n_corners)), linear)
        end do
      end associate
    end do
  end subroutine move_corners

  !> Map the box smoothly onto itself.
  subroutine bend(self)
    type(box_t), intent(inout) :: self  !! The box.
    real(dp), parameter :: pi = acos(-1.0_dp), direction(3) = [1.0_dp, -0.7_dp, 0.4_dp]
    real(dp) :: bump
    integer :: i
    do i = 1, size(self%lattice, 2)
      bump = 0.05_dp*product(sin(pi*self%mesh%x(:, i)))
      self%mesh%x(:, i) = self%mesh%x(:, i) + bump*direction(:self%mesh%dimension)
    end do
  end subroutine bend

  !> One side of the box.
  function box_side(self, axis, far) result(surface)
    class(box_t), intent(in) :: self
    integer, intent(in) :: axis  !! Axis to which the side is normal.
    logical, intent(in) :: far  !! Whether the side is that at 1, else that at 0.
    type(surface_t) :: surface
    surface = self%sides([merge(axis, -axis, far)])
  end function box_side

  !> Several sides of the box as one surface.
  function box_sides(self, chosen) result(surface)
    class(box_t), intent(in) :: self
    integer, intent(in) :: chosen(:)  !! Axes normal to the sides, negative for the sides at 0 (n_sides).
    type(surface_t) :: surface
    type(element_kind_t) :: properties, face
    integer :: e, f, s, level, pass
    integer, allocatable :: node(:)
    properties = element_kind(self%mesh%block(1)%kind)
    surface%name = merge('several', merge('right  ', 'left   ', chosen(1) > 0), size(chosen) > 1)
    surface%dimension = self%mesh%dimension
    do pass = 1, 2
      surface%n_facets = 0
      do e = 1, self%mesh%n_elements()
        do f = 1, properties%n_faces
          face = element_kind(properties%face_kind(f))
          node = self%mesh%block(1)%node(properties%face_node(:face%n_nodes, f), e)
          do s = 1, size(chosen)
            level = merge(2*self%cells, 0, chosen(s) > 0)
            if (any(self%lattice(abs(chosen(s)), node) /= level)) cycle
            surface%n_facets = surface%n_facets + 1
            if (pass == 1) cycle
            surface%kind(surface%n_facets) = properties%face_kind(f)
            surface%node(:face%n_nodes, surface%n_facets) = node
            surface%block(surface%n_facets) = 1
            surface%element(surface%n_facets) = e
            surface%tag(surface%n_facets) = surface%n_facets
          end do
        end do
      end do
      if (pass == 2) cycle
      allocate (surface%kind(surface%n_facets), surface%block(surface%n_facets), surface%element(surface%n_facets))
      allocate (surface%tag(surface%n_facets), surface%node(max_facet_nodes, surface%n_facets))
      surface%node = 0
    end do
  end function box_sides

  !> Map all nodes linearly: x <- matrix x + shift.
  subroutine box_transform(self, matrix, shift)
    class(box_t), intent(inout) :: self
    real(dp), intent(in) :: matrix(:, :)  !! Linear map (dim, dim) [].
    real(dp), intent(in) :: shift(:)  !! Translation (dim) [length].
    integer :: i
    do i = 1, size(self%mesh%x, 2)
      self%mesh%x(:, i) = matmul(matrix, self%mesh%x(:, i)) + shift
    end do
  end subroutine box_transform

  !> Add a translated copy of all elements; coinciding nodes are merged. Sides remain those of the first box.
  subroutine box_repeat(self, shift)
    class(box_t), intent(inout) :: self
    real(dp), intent(in) :: shift(:)  !! Translation (dim) [length].
    real(dp), allocatable :: x(:, :)
    integer, allocatable :: number(:), flat(:)
    integer :: i, k, n, dim
    dim = self%mesh%dimension
    n = size(self%mesh%x, 2)
    allocate (x(dim, 2*n), number(n))
    x(:, :n) = self%mesh%x
    k = n
    do i = 1, n
      number(i) = minloc(norm2(self%mesh%x - spread(self%mesh%x(:, i) + shift, 2, n), 1), 1)
      if (norm2(self%mesh%x(:, number(i)) - self%mesh%x(:, i) - shift) < 1.0e-9_dp) cycle
      k = k + 1
      number(i) = k
      x(:, k) = self%mesh%x(:, i) + shift
    end do
    self%mesh%x = x(:, :k)
    self%mesh%node_tag = [(int(i, int64) + 100, i=1, k)]
    self%lattice = reshape([self%lattice, spread(-1, 1, dim*(k - n))], [dim, k])
    associate (block => self%mesh%block(1))
      block%tag = [block%tag, block%tag + size(block%tag)]
      flat = reshape(block%node, [size(block%node)])
      block%node = reshape([flat, number(flat)], [size(block%node, 1), 2*size(block%node, 2)])
    end associate
  end subroutine box_repeat

  !> A support.
  function make_support(surface, fix, value) result(support)
    type(surface_t), intent(in) :: surface  !! Surface.
    character(*), intent(in) :: fix  !! Directions of prescribed displacements, as in the input.
    real(dp), intent(in), optional :: value(3)  !! Prescribed displacement; zero if absent (3) [length].
    type(support_t) :: support
    character(:), allocatable :: message
    support%surface = surface
    call support%fix%parse(fix, surface%dimension, message)
    if (len(message) > 0) error stop 'make_support: fix'
    if (present(value)) support%value = value
  end function make_support

  !> Create a body from a box, with its supports.
  subroutine make_body(box, analysis, material, supports, body, error)
    type(box_t), intent(in) :: box  !! The box.
    integer, intent(in) :: analysis  !! Type of analysis: one of the `analysis_*` constants.
    type(material_t), intent(in) :: material  !! Material.
    type(support_t), intent(in) :: supports(:)  !! Supports (n_supports).
    type(body_t), intent(out) :: body  !! The body, not assembled, with loads of zero.
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the supports cannot be used.
    body%name = 'box'
    body%analysis = analysis
    body%dimension = analysis_dimension(analysis)
    body%mesh = box%mesh
    allocate (body%material(1))
    body%material(1) = material
    allocate (body%load(body%dimension, box%mesh%n_nodes()), source=0.0_dp)
    call collect_supports(body%mesh, analysis, supports, body%constraint, error, body%directions)
  end subroutine make_body

  !> Assemble, factorize and solve.
  subroutine solve(body, u, error)
    type(body_t), intent(inout) :: body  !! The body; assembled on return.
    real(dp), allocatable, intent(out) :: u(:, :)  !! Displacements in global axes (dim, n_nodes) [length].
    type(error_t), allocatable, intent(out) :: error  !! Allocated where the body cannot be assembled or factorized.
    type(stiffness_t) :: stiffness
    type(cholesky_t) :: factor
    real(dp), allocatable :: x(:)
    integer :: i, failed
    allocate (u(body%dimension, body%mesh%n_nodes()))
    call body%assemble(stiffness, error)
    if (allocated(error)) return
    call factor%analyze(stiffness%matrix, [(i, i=1, stiffness%matrix%n)], error)
    if (allocated(error)) return
    call factor%factorize(stiffness%matrix, failed, error)
    if (.not. allocated(error)) then
      x = body%rhs
      call factor%solve(x)
      call body%constraint%expand(x, u, .true.)
    end if
    call factor%destroy()
  end subroutine solve

  !> Forces K u of all nodes in global axes, for a body without supports.
  subroutine nodal_forces(stiffness, u, force)
    type(stiffness_t), intent(in) :: stiffness  !! Of the body.
    real(dp), intent(in) :: u(:, :)  !! Displacements (dim, n_nodes) [length].
    real(dp), allocatable, intent(out) :: force(:, :)  !! (dim, n_nodes) [force].
    real(dp), allocatable :: x(:), y(:)
    x = reshape(u, [size(u)])
    allocate (y(size(u)))
    call stiffness%matrix%multiply(x, y)
    force = reshape(y, shape(u))
  end subroutine nodal_forces

  !> Rotation about an oblique axis in three dimensions, in the plane in two (dim, dim) [].
  function rotation(dim, angle) result(matrix)
    integer, intent(in) :: dim  !! Number of coordinates, 2 or 3.
    real(dp), intent(in) :: angle  !! Angle [radian].
    real(dp) :: matrix(dim, dim)
    real(dp) :: axis(3), k(3, 3)
    integer :: i
    if (dim == 2) then
      matrix = reshape([cos(angle), sin(angle), -sin(angle), cos(angle)], [2, 2])
      return
    end if
    axis = [1.0_dp, -2.0_dp, 2.0_dp]/3
    k = reshape([0.0_dp, axis(3), -axis(2), -axis(3), 0.0_dp, axis(1), axis(2), -axis(1), 0.0_dp], [3, 3])
    matrix = sin(angle)*k + (1 - cos(angle))*matmul(k, k)
    do i = 1, 3
      matrix(i, i) = matrix(i, i) + 1
    end do
  end function rotation

  !> An isotropic material with Young's modulus 2 and Poisson's ratio 0.3.
  function steel() result(material)
    type(material_t) :: material
    type(error_t), allocatable :: error
    call material%init_isotropic('steel', 2.0_dp, 0.3_dp, error)
  end function steel
end module test_bodies
