!> Polynomials that fit a displacement around each vertex of a body: polynomial-preserving recovery (Zhang and Naga, SIAM J. Sci.
!> Comput. 26, 2005).
!>
!> On the patch of elements around a vertex, a polynomial of one degree more than the elements' is fitted to the nodal
!> values by least squares, near ones counting more than far ones. Where the displacement is such a polynomial and the patch
!> determines it, its gradient is exact, on any mesh and up to the boundary; where it is smooth, it is of a higher order than that of
!> the elements. Bodies of a layer or two of elements do not determine all of it: there polynomials of lower degree are fitted first,
!> so that these at least are exact. The fit is in axes in which the patch is about as long as wide: flat elements are no worse than
!> others.
!>
!> Patches, monomials and factors depend on the mesh alone: several displacements of one mesh are fitted together.
module dotyk_elasticity_gradient_recovery
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp
  use dotyk_elasticity_node_graph, only: incidence_t
  use dotyk_elasticity_monomials, only: evaluate_monomials, lanes, monomials_t
  use dotyk_elasticity_recovery_patch, only: add_ring, recovery_patch_t
  use dotyk_elasticity_isoparametric_map, only: points_in_row
  use dotyk_linalg_blas, only: dgemm
  use dotyk_linalg_dense, only: least_squares
  use dotyk_linalg_normal_equations, only: factorize_gram, solve_gram
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> Strains of the polynomials of some bodies that have one mesh.
  type, public :: gradient_recovery_t
    !> Of the polynomials.
    type(monomials_t) :: monomials
    !> Number of bodies.
    integer :: n_bodies = 0
    !> Number of vertices; of strains: xx yy zz yz xz xy in three dimensions, xx yy xy in two; shear strains are engineering ones.
    integer :: n_vertices = 0, n_strains = 0
    !> Vertex of each node, 0 for nodes that are none (n_nodes).
    integer, allocatable :: vertex(:)
    !> Centres of the patches (dimension, n_vertices) [length].
    real(dp), allocatable :: centre(:, :)
    !> To their own axes, in which no node is farther from the centre than 1 (dimension, dimension, n_vertices) [1/length].
    real(dp), allocatable :: axes(:, :, :)
    !> Strains in the mesh's axes: coefficients in axes (x - centre) (n_bodies, n_strains, n_lower, n_vertices) [].
    real(dp), allocatable :: strain(:, :, :, :)
  contains
    procedure :: init => gradient_recovery_init
  end type gradient_recovery_t

  public :: vertex_functions

  !> Rings of elements around a vertex at most: bodies of a few elements have few nodes.
  integer, parameter :: most_rings = 4
  !> Inverse condition of the least squares from which on a polynomial counts as determined: by one ring of elements, and by two, where
  !> what they do not determine is left out. (More rings are no help: in a plate of one layer of elements they took the error for three
  !> times what it was.)
  real(dp), parameter :: well_determined = 3.0e-3_dp, determined = 3.0e-4_dp
  !> Which strain a derivative belongs to (component, variable).
  integer, parameter :: strain_3d(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])
  integer, parameter :: strain_2d(2, 2) = reshape([1, 3, 3, 2], [2, 2])

contains

  !> Fit the polynomials.
  subroutine gradient_recovery_init(self, mesh, u)
    class(gradient_recovery_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh
    !> Displacements in the mesh's axes (n_bodies, dimension, n_nodes) [length].
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

  !> The polynomial of one vertex. Rings of elements are added until the nodes determine it: one inside the body,
  !> two at most places of the boundary.
  subroutine fit_vertex(monomials, elements, vertex, x, n_values, values, node, mark, patch, axes, coefficient)
    type(monomials_t), intent(in) :: monomials
    type(incidence_t), intent(in) :: elements
    !> Vertices of the nodes, 0 for none (n_nodes).
    integer, intent(in) :: vertex(:)
    !> Nodes (dimension, n_nodes) [length].
    real(dp), intent(in), contiguous :: x(:, :)
    !> What is fitted: displacements of all bodies.
    integer, intent(in) :: n_values
    real(dp), intent(in) :: values(n_values, size(vertex))
    !> The vertex.
    integer, intent(in) :: node
    !> Work array (n_nodes): last vertex whose patch a node was in.
    integer, intent(inout) :: mark(:)
    !> Work space.
    type(recovery_patch_t), intent(inout) :: patch
    !> As in gradient_recovery_t.
    real(dp), intent(out) :: axes(:, :)
    !> Of the values in these axes.
    real(dp), intent(out) :: coefficient(n_values, monomials%n)
    real(dp), allocatable :: power(:)
    integer :: ring, inner, rank
    patch%n = 1
    patch%node(1) = node
    mark(node) = node
    inner = 0
    do ring = 1, most_rings
      call add_ring(elements%start, elements%node, elements%first, elements%element, vertex, node, mark, patch%node, inner, &
                    patch%n)
      if (ring < most_rings .and. patch%n < monomials%n + 1) cycle
      call patch%fill(monomials%dimension, x, axes)
      associate (n => monomials%n, rows => lanes*patch%n_blocks)
        if (allocated(power)) deallocate (power)
        allocate (power(rows*n))
        call evaluate_monomials(monomials%dimension, n, patch%n_blocks, monomials%parent, monomials%axis, patch%t, &
                                patch%root_weight, power)
        call fit_all(n, rows, power, patch, values, merge(well_determined, determined, ring == 1), coefficient, rank)
        if (rank == n) exit
        if (ring == 1) cycle
        call patch%take(values)
        call fit_by_degrees(monomials, rows, power, patch%n, patch%value, coefficient)
        exit
      end associate
    end do
  end subroutine fit_vertex

  !> Fit polynomials of the full degree.
  subroutine fit_all(n, rows, power, patch, values, tolerance, coefficient, rank)
    !> Number of monomials, and of rows of their values.
    integer, intent(in) :: n, rows
    !> Values of the monomials times the roots of the weights.
    real(dp), intent(in) :: power(rows, n)
    type(recovery_patch_t), intent(inout) :: patch
    !> As in fit_vertex.
    real(dp), intent(in), contiguous :: values(:, :)
    !> Inverse condition of the least squares at least.
    real(dp), intent(in) :: tolerance
    !> (n_values, n); set where the rank is n.
    real(dp), intent(out) :: coefficient(size(values, 1), n)
    !> What of the monomials the nodes determine.
    integer, intent(out) :: rank
    real(dp) :: gram(n, n), r(n, n), rest(size(values, 1), n)
    integer :: pivot(n), m
    m = size(values, 1)
    call dgemm('T', 'N', n, n, patch%n, 1.0_dp, power, rows, power, rows, 0.0_dp, gram, n)
    call factorize_gram(n, gram, tolerance, r, pivot, rank)
    if (rank < n) return
    call patch%take(values)
    call dgemm('N', 'N', m, n, patch%n, 1.0_dp, patch%value, m, power, rows, 0.0_dp, coefficient, m)
    call solve_gram(n, m, r, pivot, coefficient)
    ! The normal equations square the condition; one correction makes up for it.
    call dgemm('N', 'T', m, patch%n, n, -1.0_dp, coefficient, m, power, rows, 1.0_dp, patch%value, m)
    call dgemm('N', 'N', m, n, patch%n, 1.0_dp, patch%value, m, power, rows, 0.0_dp, rest, m)
    call solve_gram(n, m, r, pivot, rest)
    coefficient = coefficient + rest
  end subroutine fit_all

  !> Fit polynomials of lower degrees first, so that these are exact, and leave out what the nodes do not determine.
  subroutine fit_by_degrees(monomials, rows, power, n_nodes, value, coefficient)
    type(monomials_t), intent(in) :: monomials
    !> Rows of the values of the monomials, and those that are nodes.
    integer, intent(in) :: rows, n_nodes
    !> Values of the monomials times the roots of the weights.
    real(dp), intent(in) :: power(rows, monomials%n)
    !> What is fitted, times the same roots (n_values, >= n_nodes).
    real(dp), intent(in) :: value(:, :)
    !> (n_values, n).
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

  !> Strains of polynomials.
  pure subroutine differentiate(monomials, n_bodies, coefficient, axes, strain)
    type(monomials_t), intent(in) :: monomials
    integer, intent(in) :: n_bodies
    !> Of the displacements in axes of the patch [length].
    real(dp), intent(in) :: coefficient(n_bodies, monomials%dimension, monomials%n)
    !> (dimension, dimension) [1/length].
    real(dp), intent(in) :: axes(:, :)
    !> In the mesh's axes, coefficients in those of the patch (n_bodies, n_strains, n_lower) [].
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

  !> The functions whose sum, each times its coefficient, is the mean of the polynomials of some vertices, each weighted by a function.
  pure subroutine vertex_functions(dim, n_lower, n_vertices, n_points, vertex, parent, axis, centre, axes, weight, x, values)
    integer, intent(in) :: dim, n_lower, n_vertices
    !> A multiple of `points`.
    integer, intent(in) :: n_points
    integer, intent(in) :: vertex(n_vertices)
    !> As in monomials_t.
    integer, intent(in) :: parent(n_lower), axis(n_lower)
    !> As in gradient_recovery_t, of all vertices.
    real(dp), intent(in) :: centre(dim, *), axes(dim, dim, *)
    !> Places [length], and weights there.
    real(dp), intent(in) :: x(n_points, dim), weight(n_points, n_vertices)
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
