!> Polynomials that fit a displacement around each vertex of a body: polynomial-preserving recovery (Zhang and Naga, SIAM J. Sci.
!> Comput. 26, 2005).
!>
!> On the patch of elements around a vertex, a polynomial of one degree more than the elements' is fitted to the nodal
!> values by least squares, near ones counting more than far ones. Where the displacement is such a polynomial, its gradient is exact, on any mesh and up to the
!> boundary; where it is smooth, it is of a higher order than that of the elements.
module dotyk_elasticity_patch_fit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_graph, only: node_graph
  use dotyk_linalg_dense, only: least_squares
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> The polynomials of a body.
  type, public :: patch_fit_t
    !> Dimension, degree, number of monomials and of vertices.
    integer :: dimension = 0, degree = 0, n_monomials = 0, n_vertices = 0
    !> Exponents of the monomials (dimension, n_monomials).
    integer, allocatable :: exponent(:, :)
    !> The third one, 0 in two dimensions (n_monomials).
    integer, allocatable :: third(:)
    !> Vertex of each node, 0 for nodes that are none (n_nodes).
    integer, allocatable :: vertex(:)
    !> Centres (dimension, n_vertices) and radii (n_vertices) of the patches [length].
    real(dp), allocatable :: centre(:, :), radius(:)
    !> Coefficients in (x - centre)/radius (dimension, n_monomials, n_vertices) [length].
    real(dp), allocatable :: coefficient(:, :, :)
  contains
    procedure :: init => patch_fit_init
    procedure :: gradient => patch_fit_gradient
  end type patch_fit_t

  !> Rings of elements around a vertex at most: bodies of a few elements have few nodes.
  integer, parameter :: most_rings = 4
  !> Inverse condition of the least squares from which on a polynomial counts as determined: by one ring of elements, and by two, where
  !> what they do not determine is left out. (More rings are no help: in a plate of one layer of elements they took the error for three
  !> times what it was.)
  real(dp), parameter :: well_determined = 3.0e-3_dp, determined = 3.0e-4_dp

contains

  !> Fit the polynomials.
  subroutine patch_fit_init(self, mesh, u)
    class(patch_fit_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh
    !> Displacements in global axes (dimension, n_nodes) [length].
    real(dp), intent(in) :: u(:, :)
    type(element_kind_t) :: kind
    integer, allocatable :: start(:), neighbour(:), node_of(:), mark(:)
    logical, allocatable :: corner(:)
    integer :: b, i, v, order
    self%dimension = mesh%dimension
    allocate (corner(mesh%n_nodes()), source=.false.)
    order = 1
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      order = max(order, kind%order)
      do i = 1, kind%n_corners
        corner(mesh%block(b)%node(i, :)) = .true.
      end do
    end do
    self%degree = order + 1
    call list_exponents(self%dimension, self%degree, self%exponent)
    self%n_monomials = size(self%exponent, 2)
    allocate (self%third(self%n_monomials), source=0)
    if (self%dimension == 3) self%third = self%exponent(3, :)
    node_of = pack([(i, i=1, size(corner))], corner)
    self%n_vertices = size(node_of)
    allocate (self%vertex(size(corner)), source=0)
    self%vertex(node_of) = [(v, v=1, self%n_vertices)]
    allocate (self%centre(self%dimension, self%n_vertices), self%radius(self%n_vertices), &
              self%coefficient(self%dimension, self%n_monomials, self%n_vertices))
    call node_graph(mesh, start, neighbour)
    !$omp parallel default(none) shared(self, mesh, u, start, neighbour, node_of) private(v, mark)
    allocate (mark(mesh%n_nodes()), source=0)
    !$omp do schedule(dynamic, 16)
    do v = 1, self%n_vertices
      call fit_vertex(self%n_monomials, self%exponent, mesh%x, u, node_of(v), start, neighbour, mark, self%centre(:, v), &
                      self%radius(v), self%coefficient(:, :, v))
    end do
    !$omp end do
    deallocate (mark)
    !$omp end parallel
  end subroutine patch_fit_init

  !> Exponents of all monomials up to a degree, lower degrees first.
  pure subroutine list_exponents(dimension, degree, exponent)
    integer, intent(in) :: dimension, degree
    !> (dimension, number).
    integer, allocatable, intent(out) :: exponent(:, :)
    integer :: total, i, j, n
    allocate (exponent(dimension, merge((degree + 1)*(degree + 2)/2, (degree + 1)*(degree + 2)*(degree + 3)/6, dimension == 2)))
    n = 0
    do total = 0, degree
      do i = total, 0, -1
        if (dimension == 2) then
          n = n + 1
          exponent(:, n) = [i, total - i]
        else
          do j = total - i, 0, -1
            n = n + 1
            exponent(:, n) = [i, j, total - i - j]
          end do
        end if
      end do
    end do
  end subroutine list_exponents

  !> The polynomial of one vertex. Rings of elements are added until the nodes determine it: one inside the body,
  !> two at most places of the boundary.
  subroutine fit_vertex(n, exponent, x, u, node, start, neighbour, mark, centre, radius, coefficient)
    !> Number of monomials.
    integer, intent(in) :: n
    integer, intent(in) :: exponent(:, :)
    !> Nodes (dimension, n_nodes) and their displacements [length].
    real(dp), intent(in) :: x(:, :), u(:, :)
    !> The vertex.
    integer, intent(in) :: node
    !> Graph of the nodes.
    integer, intent(in) :: start(:), neighbour(:)
    !> Work array (n_nodes): last vertex whose patch a node was in.
    integer, intent(inout) :: mark(:)
    real(dp), intent(out) :: centre(:), radius, coefficient(:, :)
    type(error_t), allocatable :: error
    integer, allocatable :: patch(:)
    real(dp), allocatable :: a(:, :), b(:, :)
    real(dp) :: weight
    integer :: ring, i, m, rank
    allocate (patch(1))
    patch(1) = node
    mark(node) = node
    centre = x(:, node)
    do ring = 1, most_rings
      call add_ring(start, neighbour, node, mark, patch)
      radius = 0
      do i = 2, size(patch)
        radius = max(radius, norm2(x(:, patch(i)) - centre))
      end do
      if (.not. radius > 0) radius = 1
      if (ring < most_rings .and. size(patch) < n + 1) cycle
      allocate (a(size(patch), n), b(max(n, size(patch)), size(u, 1)))
      do i = 1, size(patch)
        do m = 1, n
          a(i, m) = product(((x(:, patch(i)) - centre)/radius)**exponent(:, m))
        end do
        b(i, :) = u(:, patch(i)) - u(:, node)
        ! Far nodes of one-sided patches would bend the polynomial.
        weight = 1/(0.01_dp + (norm2(x(:, patch(i)) - centre)/radius)**2)
        a(i, :) = weight*a(i, :)
        b(i, :) = weight*b(i, :)
      end do
      call least_squares(a, b, merge(well_determined, determined, ring == 1), rank, error)
      coefficient = 0
      if (.not. allocated(error)) coefficient = transpose(b(:n, :))
      deallocate (a, b)
      if (rank == n .or. ring > 1) exit
    end do
  end subroutine fit_vertex

  !> Add the nodes of all elements that nodes of a patch belong to.
  pure subroutine add_ring(start, neighbour, node, mark, patch)
    integer, intent(in) :: start(:), neighbour(:), node
    integer, intent(inout) :: mark(:)
    integer, allocatable, intent(inout) :: patch(:)
    integer, allocatable :: longer(:)
    integer :: i, k, n
    n = size(patch)
    allocate (longer(n + sum(start(patch + 1) - start(patch))))
    longer(:n) = patch
    do i = 1, size(patch)
      do k = start(patch(i)), start(patch(i) + 1) - 1
        if (mark(neighbour(k)) == node) cycle
        mark(neighbour(k)) = node
        n = n + 1
        longer(n) = neighbour(k)
      end do
    end do
    patch = longer(:n)
  end subroutine add_ring

  !> Gradient of the polynomial of a vertex.
  pure subroutine patch_fit_gradient(self, vertex, x, gradient)
    class(patch_fit_t), intent(in) :: self
    integer, intent(in) :: vertex
    !> Place (dimension) [length].
    real(dp), intent(in) :: x(:)
    !> gradient(i, k) = d u_i / d x_k [].
    real(dp), intent(out) :: gradient(:, :)
    real(dp) :: power(0:3, 3), slope(3)
    integer :: k, m
    power = 1
    do k = 1, self%dimension
      power(1, k) = (x(k) - self%centre(k, vertex))/self%radius(vertex)
      power(2, k) = power(1, k)**2
      power(3, k) = power(2, k)*power(1, k)
    end do
    gradient = 0
    do m = 2, self%n_monomials
      associate (i => self%exponent(1, m), j => self%exponent(2, m), l => self%third(m))
        slope(1) = i*power(max(0, i - 1), 1)*power(j, 2)*power(l, 3)
        slope(2) = j*power(i, 1)*power(max(0, j - 1), 2)*power(l, 3)
        slope(3) = l*power(i, 1)*power(j, 2)*power(max(0, l - 1), 3)
      end associate
      do k = 1, self%dimension
        gradient(:, k) = gradient(:, k) + slope(k)*self%coefficient(:, m, vertex)
      end do
    end do
    gradient = gradient/self%radius(vertex)
  end subroutine patch_fit_gradient
end module dotyk_elasticity_patch_fit
