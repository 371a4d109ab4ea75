!> Gradient recovery: polynomial-preserving recovery of the strains of a displacement (Zhang and Naga, SIAM J. Sci.
!> Comput. 26, 2005).
!>
!> On the patch of elements around a vertex, a polynomial of one degree more than that of the elements is fitted to
!> the nodal displacements by weighted least squares. Where the displacement is such a polynomial and the patch
!> determines it, the gradient of the fit is exact, on any mesh and up to the boundary; where it is smooth, the
!> gradient is superconvergent. Bodies of one or two layers of elements do not determine the whole polynomial:
!> polynomials of lower degrees are then fitted first, so that at least these are reproduced. The fit uses axes in
!> which the patch is about as long as wide: flat elements do not deteriorate it.
!>
!> Patches, monomials and factors depend on the mesh alone: several displacements of one mesh are fitted together.
module dotyk_elasticity_gradient_recovery
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_isoparametric_map, only: points_in_row
  use dotyk_elasticity_monomials, only: evaluate_monomials, lanes, monomials_t
  use dotyk_elasticity_node_graph, only: incidence_t
  use dotyk_elasticity_recovery_patch, only: add_ring, recovery_patch_t
  use dotyk_linalg_blas, only: dgemm
  use dotyk_linalg_dense, only: least_squares
  use dotyk_linalg_normal_equations, only: factorize_gram, solve_gram
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> Recovered strains of several bodies of one mesh: polynomials around the vertices.
  type, public :: gradient_recovery_t
    !> Monomials of the fitted displacements.
    type(monomials_t) :: monomials
    !> Number of bodies.
    integer :: n_bodies = 0
    !> Number of vertices.
    integer :: n_vertices = 0
    !> Number of strains: xx yy zz yz xz xy in three dimensions, xx yy xy in two, with engineering shear strains.
    integer :: n_strains = 0
    !> Vertex of each node, 0 for nodes that are no vertices (n_nodes).
    integer, allocatable :: vertex(:)
    !> Positions of the vertices (dim, n_vertices) [length].
    real(dp), allocatable :: centre(:, :)
    !> Axes of the patches, as rows, in which no node is farther from the vertex than 1 (dim, dim, n_vertices)
    !> [1/length].
    real(dp), allocatable :: axes(:, :, :)
    !> Coefficients of the strains in axes (x - centre) (n_bodies, n_strains, n_lower, n_vertices) [].
    real(dp), allocatable :: strain(:, :, :, :)
  contains
    procedure :: init => gradient_recovery_init
  end type gradient_recovery_t

  public :: vertex_functions

  !> Largest number of rings of elements around a vertex: bodies of a few elements have few nodes.
  integer, parameter :: most_rings = 4
  !> Smallest inverse condition number of the least squares for which one ring of elements determines the polynomial.
  real(dp), parameter :: well_determined = 3.0e-3_dp
  !> The same for two rings, beyond which undetermined terms are dropped. More rings do not help: in a plate of one
  !> layer of elements they overestimated the error by a factor of three.
  real(dp), parameter :: determined = 3.0e-4_dp
  !> Strain of a derivative in three dimensions (component, variable).
  integer, parameter :: strain_3d(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])
  !> Strain of a derivative in two dimensions (component, variable).
  integer, parameter :: strain_2d(2, 2) = reshape([1, 3, 3, 2], [2, 2])

contains

  !> Recover the strains of displacements.
  subroutine gradient_recovery_init(self, mesh, u)
    class(gradient_recovery_t), intent(out) :: self
    !> Elements and nodes of the body.
    type(body_mesh_t), intent(in) :: mesh
    !> Displacements in the axes of the mesh (n_bodies, dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :, :)
    type(element_kind_t) :: kind
    type(incidence_t) :: elements
    type(recovery_patch_t) :: patch
    integer, allocatable :: node_of(:), mark(:)
    real(dp), allocatable :: coefficient(:)
    logical, allocatable :: corner(:)
    integer :: b, i, v, order, dim
    dim = mesh%dimension
    allocate (corner(mesh%n_nodes()), source=.false.)
    order = 1
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      order = max(order, kind%order)
      do i = 1, kind%n_corners
        corner(mesh%block(b)%node(i, :)) = .true.
      end do
    end do
    call self%monomials%init(dim, order + 1)
    node_of = pack([(i, i=1, size(corner))], corner)
    self%n_vertices = size(node_of)
    self%n_strains = dim*(dim + 1)/2
    self%n_bodies = size(u, 1)
    allocate (self%vertex(size(corner)), source=0)
    self%vertex(node_of) = [(v, v=1, self%n_vertices)]
    allocate (self%centre(dim, self%n_vertices), self%axes(dim, dim, self%n_vertices), &
              self%strain(self%n_bodies, self%n_strains, self%monomials%n_lower, self%n_vertices))
    call elements%init(mesh)
    !$omp parallel default(none) shared(self, mesh, u, elements, node_of, dim) private(v, mark, patch, coefficient)
    allocate (mark(mesh%n_nodes()), source=0)
    allocate (patch%node(mesh%n_nodes()), coefficient(self%n_bodies*dim*self%monomials%n))
    !$omp do schedule(dynamic, 16)
    do v = 1, self%n_vertices
      self%centre(:, v) = mesh%x(:, node_of(v))
      call fit_vertex(self%monomials, elements, self%vertex, mesh%x, self%n_bodies*dim, u, node_of(v), mark, patch, &
                      self%axes(:, :, v), coefficient)
      call differentiate(self%monomials, self%n_bodies, coefficient, self%axes(:, :, v), self%strain(:, :, :, v))
    end do
    !$omp end do
    deallocate (mark, coefficient)
    !$omp end parallel
  end subroutine gradient_recovery_init

  !> Fit the polynomial of one vertex. Rings of elements are added until the nodes determine it: one ring in the
  !> interior, two at most places of the boundary.
  subroutine fit_vertex(monomials, elements, vertex, x, n_values, values, node, mark, patch, axes, coefficient)
    !> Monomials of the fit.
    type(monomials_t), intent(in) :: monomials
    !> Incidence of nodes and elements.
    type(incidence_t), intent(in) :: elements
    !> Vertex of each node, 0 for none (n_nodes).
    integer, intent(in) :: vertex(:)
    !> Nodes of the body (dim, n_nodes) [length].
    real(dp), intent(in), contiguous :: x(:, :)
    !> Number of fitted values per node: displacement components of all bodies.
    integer, intent(in) :: n_values
    !> Fitted values (n_values, n_nodes) [length].
    real(dp), intent(in) :: values(n_values, size(vertex))
    !> Node of the vertex.
    integer, intent(in) :: node
    !> Work array: last vertex whose patch contained a node (n_nodes).
    integer, intent(inout) :: mark(:)
    !> Work space.
    type(recovery_patch_t), intent(inout) :: patch
    !> Axes of the patch, as rows (dim, dim) [1/length].
    real(dp), intent(out) :: axes(:, :)
    !> Coefficients of the fitted values in these axes (n_values, monomials%n) [length].
    real(dp), intent(out) :: coefficient(n_values, monomials%n)
    real(dp), allocatable :: power(:)
    integer :: ring, inner, rank
    patch%n = 1
    patch%node(1) = node
    mark(node) = node
    inner = 0
    do ring = 1, most_rings
      call add_ring(elements%start, elements%node, elements%first, elements%element, vertex, node, mark, patch%node, &
                    inner, patch%n)
      if (ring < most_rings .and. patch%n < monomials%n + 1) cycle
      call patch%fill(monomials%dimension, x, axes)
      associate (n => monomials%n, rows => lanes*patch%n_blocks)
        if (allocated(power)) deallocate (power)
        allocate (power(rows*n))
        call evaluate_monomials(monomials%dimension, n, patch%n_blocks, monomials%parent, monomials%axis, patch%t, &
                                patch%root_weight, power)
        call fit_full_degree(n, rows, power, patch, values, merge(well_determined, determined, ring == 1), &
                             coefficient, rank)
        if (rank == n) exit
        if (ring == 1) cycle
        call patch%take(values)
        call fit_by_degrees(monomials, rows, power, patch%n, patch%value, coefficient)
        exit
      end associate
    end do
  end subroutine fit_vertex

  !> Fit polynomials of the full degree by normal equations.
  subroutine fit_full_degree(n, rows, power, patch, values, tolerance, coefficient, rank)
    !> Number of monomials.
    integer, intent(in) :: n
    !> Number of rows of their values.
    integer, intent(in) :: rows
    !> Values of the monomials times the square roots of the weights (rows, n) [].
    real(dp), intent(in) :: power(rows, n)
    !> The patch; its values are replaced by residuals.
    type(recovery_patch_t), intent(inout) :: patch
    !> Fitted values (n_values, n_nodes) [length].
    real(dp), intent(in), contiguous :: values(:, :)
    !> Smallest inverse condition number of the least squares [].
    real(dp), intent(in) :: tolerance
    !> Coefficients; set where the rank is n (n_values, n) [length].
    real(dp), intent(out) :: coefficient(size(values, 1), n)
    !> Number of monomials that the nodes determine.
    integer, intent(out) :: rank
    real(dp) :: gram(n, n), r(n, n), correction(size(values, 1), n)
    integer :: pivot(n), m
    m = size(values, 1)
    call dgemm('T', 'N', n, n, patch%n, 1.0_dp, power, rows, power, rows, 0.0_dp, gram, n)
    call factorize_gram(n, gram, tolerance, r, pivot, rank)
    if (rank < n) return
    call patch%take(values)
    call dgemm('N', 'N', m, n, patch%n, 1.0_dp, patch%value, m, power, rows, 0.0_dp, coefficient, m)
    call solve_gram(n, m, r, pivot, coefficient)
    ! The normal equations square the condition number; one step of iterative refinement makes up for it.
    call dgemm('N', 'T', m, patch%n, n, -1.0_dp, coefficient, m, power, rows, 1.0_dp, patch%value, m)
    call dgemm('N', 'N', m, n, patch%n, 1.0_dp, patch%value, m, power, rows, 0.0_dp, correction, m)
    call solve_gram(n, m, r, pivot, correction)
    coefficient = coefficient + correction
  end subroutine fit_full_degree

  !> Fit polynomials of rising degree to the residuals of the degrees before, so that low degrees are reproduced, and
  !> drop undetermined terms.
  subroutine fit_by_degrees(monomials, rows, power, n_nodes, value, coefficient)
    !> Monomials of the fit.
    type(monomials_t), intent(in) :: monomials
    !> Number of rows of the values of the monomials.
    integer, intent(in) :: rows
    !> Number of nodes of the patch.
    integer, intent(in) :: n_nodes
    !> Values of the monomials times the square roots of the weights (rows, monomials%n) [].
    real(dp), intent(in) :: power(rows, monomials%n)
    !> Fitted values times the same square roots (n_values, >= n_nodes) [length].
    real(dp), intent(in) :: value(:, :)
    !> Coefficients (n_values, monomials%n) [length].
    real(dp), intent(out) :: coefficient(:, :)
    real(dp), allocatable :: b(:, :)
    integer :: k, degree, rank
    allocate (b(n_nodes, size(value, 1)))
    b(:, :) = transpose(value(:, :n_nodes))
    coefficient = 0
    do degree = 1, monomials%degree
      k = monomials%up_to(degree)
      call add_fit(power(:n_nodes, :k), b, determined, coefficient(:, :k), rank)
    end do
  end subroutine fit_by_degrees

  !> Add the polynomial that fits the residuals, and subtract it from them.
  subroutine add_fit(a, b, tolerance, coefficient, rank)
    !> Monomials at the nodes, weighted (n_nodes, n) [].
    real(dp), intent(in) :: a(:, :)
    !> Residuals (n_nodes, n_values) [length].
    real(dp), intent(inout) :: b(:, :)
    !> Smallest inverse condition number, see `least_squares` [].
    real(dp), intent(in) :: tolerance
    !> Coefficients (n_values, n) [length].
    real(dp), intent(inout) :: coefficient(:, :)
    !> Number of monomials that the nodes determine.
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

  !> Strains of the fitted polynomials.
  pure subroutine differentiate(monomials, n_bodies, coefficient, axes, strain)
    !> Monomials of the fit.
    type(monomials_t), intent(in) :: monomials
    !> Number of bodies.
    integer, intent(in) :: n_bodies
    !> Coefficients of the displacements (n_bodies, dim, monomials%n) [length].
    real(dp), intent(in) :: coefficient(n_bodies, monomials%dimension, monomials%n)
    !> Axes of the patch, as rows (dim, dim) [1/length].
    real(dp), intent(in) :: axes(:, :)
    !> Coefficients of the strains in the axes of the mesh (n_bodies, n_strains, n_lower) [].
    real(dp), intent(out) :: strain(:, :, :)
    integer :: i, j, k, lower, s
    strain = 0
    do k = 2, monomials%n
      do j = 1, monomials%dimension
        lower = monomials%derivative(j, k)
        if (lower == 0) cycle
        do i = 1, monomials%dimension
          do s = 1, monomials%dimension
            associate (e => merge(strain_3d(s, i), strain_2d(min(s, 2), min(i, 2)), monomials%dimension == 3))
              strain(:, e, lower) = strain(:, e, lower) + (monomials%exponent(j, k)*axes(j, i))*coefficient(:, s, k)
            end associate
          end do
        end do
      end do
    end do
  end subroutine differentiate

  !> Monomials around vertices at points, each times the weight of its vertex: the basis of the recovered strains of
  !> an element.
  pure subroutine vertex_functions(dim, n_lower, n_vertices, n_points, vertex, parent, axis, centre, axes, weight, x, &
                                   values)
    !> Number of coordinates.
    integer, intent(in) :: dim
    !> Number of monomials of the strains.
    integer, intent(in) :: n_lower
    !> Number of vertices.
    integer, intent(in) :: n_vertices
    !> Number of points, a multiple of `points_in_row`.
    integer, intent(in) :: n_points
    !> The vertices (n_vertices).
    integer, intent(in) :: vertex(n_vertices)
    !> Earlier monomial of each product, see `monomials_t` (n_lower).
    integer, intent(in) :: parent(n_lower)
    !> Variable of each product, see `monomials_t` (n_lower).
    integer, intent(in) :: axis(n_lower)
    !> Positions of all vertices of the body (dim, *) [length].
    real(dp), intent(in) :: centre(dim, *)
    !> Axes of all patches of the body (dim, dim, *) [1/length].
    real(dp), intent(in) :: axes(dim, dim, *)
    !> Points (n_points, dim) [length].
    real(dp), intent(in) :: x(n_points, dim)
    !> Weights of the vertices at the points (n_points, n_vertices) [].
    real(dp), intent(in) :: weight(n_points, n_vertices)
    !> Values of the basis (n_points, n_lower, n_vertices) [].
    real(dp), intent(out) :: values(n_points, n_lower, n_vertices)
    real(dp) :: t(points_in_row, dim), line(points_in_row)
    integer :: i, k, q, v
    do v = 1, n_vertices
      associate (origin => centre(:, vertex(v)), a => axes(:, :, vertex(v)))
        do q = 0, n_points - points_in_row, points_in_row
          do i = 1, dim
            line = 0
            do k = 1, dim
              line = line + a(i, k)*(x(q + 1:q + points_in_row, k) - origin(k))
            end do
            t(:, i) = line
          end do
          values(q + 1:q + points_in_row, 1, v) = weight(q + 1:q + points_in_row, v)
          do k = 2, n_lower
            values(q + 1:q + points_in_row, k, v) = values(q + 1:q + points_in_row, parent(k), v)*t(:, axis(k))
          end do
        end do
      end associate
    end do
  end subroutine vertex_functions
end module dotyk_elasticity_gradient_recovery
