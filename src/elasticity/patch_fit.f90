!> Polynomials that fit a displacement around each vertex of a body: polynomial-preserving recovery (Zhang and Naga, SIAM J. Sci.
!> Comput. 26, 2005).
!>
!> On the patch of elements around a vertex, a polynomial of one degree more than the elements' is fitted to the nodal
!> values by least squares, near ones counting more than far ones. Where the displacement is such a polynomial and the patch
!> determines it, its gradient is exact, on any mesh and up to the boundary; where it is smooth, it is of a higher order than that of
!> the elements. Bodies of a layer or two of elements do not determine all of it: there polynomials of lower degree are fitted first,
!> so that these at least are exact. The fit is in axes in which the patch is about as long as wide: flat elements are no worse than
!> others.
module dotyk_elasticity_patch_fit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_graph, only: node_graph
  use dotyk_linalg_dense, only: least_squares, symmetric_eigen
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
    !> Centres of the patches (dimension, n_vertices) [length].
    real(dp), allocatable :: centre(:, :)
    !> To their own axes, in which no node is farther from the centre than 1 (dimension, dimension, n_vertices) [1/length].
    real(dp), allocatable :: axes(:, :, :)
    !> Coefficients in axes (x - centre) (dimension, n_monomials, n_vertices) [length].
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
    allocate (self%centre(self%dimension, self%n_vertices), self%axes(self%dimension, self%dimension, self%n_vertices), &
              self%coefficient(self%dimension, self%n_monomials, self%n_vertices))
    call node_graph(mesh, start, neighbour)
    !$omp parallel default(none) shared(self, mesh, u, start, neighbour, node_of) private(v, mark)
    allocate (mark(mesh%n_nodes()), source=0)
    !$omp do schedule(dynamic, 16)
    do v = 1, self%n_vertices
      call fit_vertex(self%degree, self%exponent, mesh%x, u, node_of(v), start, neighbour, mark, self%centre(:, v), &
                      self%axes(:, :, v), self%coefficient(:, :, v))
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
  subroutine fit_vertex(degree, exponent, x, u, node, start, neighbour, mark, centre, axes, coefficient)
    integer, intent(in) :: degree
    !> Of the monomials (dimension, n_monomials).
    integer, intent(in) :: exponent(:, :)
    !> Nodes (dimension, n_nodes) and their displacements [length].
    real(dp), intent(in) :: x(:, :), u(:, :)
    !> The vertex.
    integer, intent(in) :: node
    !> Graph of the nodes.
    integer, intent(in) :: start(:), neighbour(:)
    !> Work array (n_nodes): last vertex whose patch a node was in.
    integer, intent(inout) :: mark(:)
    !> As in patch_fit_t.
    real(dp), intent(out) :: centre(:), axes(:, :), coefficient(:, :)
    integer, allocatable :: patch(:)
    real(dp), allocatable :: a(:, :), b(:, :), rest(:, :), local(:, :)
    real(dp) :: weight
    integer :: ring, i, k, m, n, rank
    n = size(exponent, 2)
    allocate (patch(1))
    patch(1) = node
    mark(node) = node
    centre = x(:, node)
    do ring = 1, most_rings
      call add_ring(start, neighbour, node, mark, patch)
      if (ring < most_rings .and. size(patch) < n + 1) cycle
      local = x(:, patch) - spread(centre, 2, size(patch))
      call own_axes(local, axes)
      local = matmul(axes, local)
      allocate (a(size(patch), n), b(size(patch), size(u, 1)))
      do i = 1, size(patch)
        do m = 1, n
          a(i, m) = product(local(:, i)**exponent(:, m))
        end do
        b(i, :) = u(:, patch(i)) - u(:, node)
        ! Far nodes of one-sided patches would bend the polynomial.
        weight = 1/(0.01_dp + sum(local(:, i)**2))
        a(i, :) = weight*a(i, :)
        b(i, :) = weight*b(i, :)
      end do
      coefficient = 0
      rest = b
      call add_fit(a, rest, merge(well_determined, determined, ring == 1), coefficient, rank)
      if (rank < n .and. ring > 1) then
        coefficient = 0
        do k = 1, degree
          m = count(sum(exponent, dim=1) <= k)
          call add_fit(a(:, :m), b, determined, coefficient(:, :m), rank)
        end do
        exit
      end if
      if (rank == n) exit
      deallocate (a, b)
    end do
  end subroutine fit_vertex

  !> Axes of a patch, along which the mean squares of its nodes' coordinates are the same.
  subroutine own_axes(x, axes)
    !> Nodes, from the centre (dimension, n) [length].
    real(dp), intent(in) :: x(:, :)
    !> To coordinates of 1 at most [1/length].
    real(dp), intent(out) :: axes(:, :)
    type(error_t), allocatable :: error
    real(dp), dimension(size(x, 1), size(x, 1)) :: moment, vectors
    real(dp) :: values(size(x, 1)), length
    integer :: k
    length = max(maxval(norm2(x, dim=1)), tiny(length))
    moment = matmul(x/length, transpose(x/length))
    call symmetric_eigen(moment, values, vectors, error)
    axes = 0
    do k = 1, size(x, 1)
      axes(k, k) = 1/length
      ! Elements have volume: only rounding makes a patch flatter than this.
      if (.not. allocated(error)) axes(k, :) = vectors(:, k)/sqrt(max(values(k), epsilon(length)**2))/length
    end do
    axes = axes/max(maxval(norm2(matmul(axes, x), dim=1)), tiny(length))
  end subroutine own_axes

  !> Add the polynomial that fits what is left, and take it off.
  subroutine add_fit(a, b, tolerance, coefficient, rank)
    !> Monomials at the nodes (n_nodes, n).
    real(dp), intent(in) :: a(:, :)
    !> What is left (n_nodes, n_components).
    real(dp), intent(inout) :: b(:, :)
    !> As in least_squares.
    real(dp), intent(in) :: tolerance
    !> (n_components, n).
    real(dp), intent(inout) :: coefficient(:, :)
    !> What of the monomials the nodes determine.
    integer, intent(out) :: rank
    type(error_t), allocatable :: error
    real(dp), allocatable :: c(:, :)
    integer :: n
    n = size(a, 2)
    allocate (c(max(n, size(b, 1)), size(b, 2)), source=0.0_dp)
    c(:size(b, 1), :) = b
    call least_squares(a, c, tolerance, rank, error)
    if (allocated(error)) return
    coefficient = coefficient + transpose(c(:n, :))
    b = b - matmul(a, c(:n, :))
  end subroutine add_fit

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
    real(dp) :: power(0:3, 3), slope(3), own(3)
    integer :: k, m
    power = 1
    do k = 1, self%dimension
      power(1, k) = dot_product(self%axes(k, :, vertex), x - self%centre(:, vertex))
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
    do m = 1, self%dimension
      own(:self%dimension) = gradient(m, :)
      do k = 1, self%dimension
        gradient(m, k) = dot_product(own(:self%dimension), self%axes(:, k, vertex))
      end do
    end do
  end subroutine patch_fit_gradient
end module dotyk_elasticity_patch_fit
