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
  use dotyk_elasticity_graph, only: incidence_t
  use dotyk_elasticity_monomials, only: lanes, monomials_t, sum_products, sum_residuals
  use dotyk_elasticity_patch, only: add_ring, patch_t
  use dotyk_elasticity_point_map, only: points
  use dotyk_linalg_dense, only: least_squares
  use dotyk_linalg_normal_equations, only: factorize_gram, solve_gram
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private

  !> Strains of the polynomials of a body.
  type, public :: patch_fit_t
    !> Of the polynomials.
    type(monomials_t) :: monomials
    !> Number of vertices; of strains: xx yy zz yz xz xy in three dimensions, xx yy xy in two; shear strains are engineering ones.
    integer :: n_vertices = 0, n_strains = 0
    !> Vertex of each node, 0 for nodes that are none (n_nodes).
    integer, allocatable :: vertex(:)
    !> Centres of the patches (dimension, n_vertices) [length].
    real(dp), allocatable :: centre(:, :)
    !> To their own axes, in which no node is farther from the centre than 1 (dimension, dimension, n_vertices) [1/length].
    real(dp), allocatable :: axes(:, :, :)
    !> Strains in global axes: coefficients in axes (x - centre) (n_strains, n_lower, n_vertices) [].
    real(dp), allocatable :: strain(:, :, :)
  contains
    procedure :: init => patch_fit_init
  end type patch_fit_t

  public :: mean_strains

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
  subroutine patch_fit_init(self, mesh, u)
    class(patch_fit_t), intent(out) :: self
    type(body_mesh_t), intent(in) :: mesh
    !> Displacements in global axes (dimension, n_nodes) [length].
    real(dp), intent(in), contiguous :: u(:, :)
    type(element_kind_t) :: kind
    type(incidence_t) :: elements
    type(patch_t) :: patch
    integer, allocatable :: node_of(:), mark(:)
    real(dp), allocatable :: coefficient(:, :)
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
    allocate (self%vertex(size(corner)), source=0)
    self%vertex(node_of) = [(v, v=1, self%n_vertices)]
    allocate (self%centre(dim, self%n_vertices), self%axes(dim, dim, self%n_vertices), &
              self%strain(self%n_strains, self%monomials%n_lower, self%n_vertices))
    call elements%init(mesh)
    !$omp parallel default(none) shared(self, mesh, u, elements, node_of, dim) private(v, mark, patch, coefficient)
    allocate (mark(mesh%n_nodes()), source=0)
    allocate (patch%node(mesh%n_nodes()), coefficient(dim, self%monomials%n))
    !$omp do schedule(dynamic, 16)
    do v = 1, self%n_vertices
      self%centre(:, v) = mesh%x(:, node_of(v))
      call fit_vertex(self%monomials, elements, self%vertex, mesh%x, u, node_of(v), mark, patch, self%axes(:, :, v), coefficient)
      call differentiate(self%monomials, coefficient, self%axes(:, :, v), self%strain(:, :, v))
    end do
    !$omp end do
    deallocate (mark, coefficient)
    !$omp end parallel
  end subroutine patch_fit_init

  !> The polynomial of one vertex. Rings of elements are added until the nodes determine it: one inside the body,
  !> two at most places of the boundary.
  subroutine fit_vertex(monomials, elements, vertex, x, u, node, mark, patch, axes, coefficient)
    type(monomials_t), intent(in) :: monomials
    type(incidence_t), intent(in) :: elements
    !> Vertices of the nodes, 0 for none (n_nodes).
    integer, intent(in) :: vertex(:)
    !> Nodes (dimension, n_nodes) and their displacements [length].
    real(dp), intent(in), contiguous :: x(:, :), u(:, :)
    !> The vertex.
    integer, intent(in) :: node
    !> Work array (n_nodes): last vertex whose patch a node was in.
    integer, intent(inout) :: mark(:)
    !> Work space.
    type(patch_t), intent(inout) :: patch
    !> As in patch_fit_t.
    real(dp), intent(out) :: axes(:, :)
    !> Of the displacements in these axes (dimension, n) [length].
    real(dp), intent(out) :: coefficient(:, :)
    integer :: ring, inner, rank
    patch%n = 1
    patch%node(1) = node
    mark(node) = node
    inner = 0
    do ring = 1, most_rings
      call add_ring(elements%start, elements%node, elements%first, elements%element, vertex, node, mark, patch%node, inner, &
                    patch%n)
      if (ring < most_rings .and. patch%n < monomials%n + 1) cycle
      call patch%fill(monomials%dimension, x, u, axes)
      call fit_all(monomials, patch, merge(well_determined, determined, ring == 1), coefficient, rank)
      if (rank == monomials%n) exit
      if (ring == 1) cycle
      call fit_by_degrees(monomials, patch, coefficient)
      exit
    end do
  end subroutine fit_vertex

  !> Fit polynomials of the full degree.
  subroutine fit_all(monomials, patch, tolerance, coefficient, rank)
    type(monomials_t), intent(in) :: monomials
    type(patch_t), intent(in) :: patch
    !> Inverse condition of the least squares at least.
    real(dp), intent(in) :: tolerance
    !> (dimension, n); set where the rank is n.
    real(dp), intent(out) :: coefficient(:, :)
    !> What of the monomials the nodes determine.
    integer, intent(out) :: rank
    real(dp), dimension(monomials%n, monomials%n) :: gram, r
    real(dp) :: moment(monomials%n_products), rest(monomials%dimension, monomials%n)
    integer :: pivot(monomials%n), k
    associate (dim => monomials%dimension, n => monomials%n)
      call sum_products(dim, n, monomials%n_products, patch%n_blocks, monomials%parent, monomials%axis, patch%t, patch%weight, &
                        patch%u, moment, coefficient)
      do k = 1, n
        gram(:, k) = moment(monomials%product(:, k))
      end do
      call factorize_gram(n, gram, tolerance, r, pivot, rank)
      if (rank < n) return
      call solve_gram(n, dim, r, pivot, coefficient)
      ! The normal equations square the condition; one correction makes up for it.
      call sum_residuals(dim, n, patch%n_blocks, monomials%parent, monomials%axis, patch%t, patch%weight, patch%u, coefficient, &
                         rest)
      call solve_gram(n, dim, r, pivot, rest)
      coefficient = coefficient + rest
    end associate
  end subroutine fit_all

  !> Fit polynomials of lower degrees first, so that these are exact, and leave out what the nodes do not determine.
  subroutine fit_by_degrees(monomials, patch, coefficient)
    type(monomials_t), intent(in) :: monomials
    type(patch_t), intent(in) :: patch
    !> (dimension, n).
    real(dp), intent(out) :: coefficient(:, :)
    real(dp), allocatable :: a(:, :), b(:, :)
    integer :: i, k, c, l, block, degree, rank
    allocate (a(patch%n, monomials%n), b(patch%n, monomials%dimension))
    do i = 1, patch%n
      block = (i - 1)/lanes + 1
      l = i - lanes*(block - 1)
      a(i, 1) = sqrt(patch%weight(l, block))
      do k = 2, monomials%n
        a(i, k) = a(i, monomials%parent(k))*patch%t(l, monomials%axis(k), block)
      end do
      do c = 1, monomials%dimension
        b(i, c) = a(i, 1)*patch%u(l, c, block)
      end do
    end do
    coefficient = 0
    do degree = 1, monomials%degree
      k = monomials%up_to(degree)
      call add_fit(a(:, :k), b, determined, coefficient(:, :k), rank)
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
  pure subroutine differentiate(monomials, coefficient, axes, strain)
    type(monomials_t), intent(in) :: monomials
    !> Of the displacements in axes of the patch (dimension, n) [length].
    real(dp), intent(in) :: coefficient(:, :)
    !> (dimension, dimension) [1/length].
    real(dp), intent(in) :: axes(:, :)
    !> In global axes, coefficients in those of the patch (n_strains, n_lower) [].
    real(dp), intent(out) :: strain(:, :)
    real(dp) :: slope(size(coefficient, 1))
    integer :: i, j, k, lower, s
    strain = 0
    do k = 2, monomials%n
      do j = 1, monomials%dimension
        lower = monomials%derivative(j, k)
        if (lower == 0) cycle
        slope = monomials%exponent(j, k)*coefficient(:, k)
        do i = 1, monomials%dimension
          do s = 1, monomials%dimension
            associate (e => merge(strain_3d(s, i), strain_2d(min(s, 2), min(i, 2)), monomials%dimension == 3))
              strain(e, lower) = strain(e, lower) + slope(s)*axes(j, i)
            end associate
          end do
        end do
      end do
    end do
  end subroutine differentiate

  !> Strains at some points: the mean of those of the polynomials of some vertices, each weighted by a function.
  pure subroutine mean_strains(dim, n_lower, n_strains, n_vertices, n_points, vertex, parent, axis, centre, axes, coefficient, &
      weight, x, strain)
    integer, intent(in) :: dim, n_lower, n_strains, n_vertices
    !> A multiple of `points`.
    integer, intent(in) :: n_points
    integer, intent(in) :: vertex(n_vertices)
    !> As in monomials_t.
    integer, intent(in) :: parent(n_lower), axis(n_lower)
    !> As in patch_fit_t, of all vertices.
    real(dp), intent(in) :: centre(dim, *), axes(dim, dim, *), coefficient(n_strains, n_lower, *)
    !> Places [length], and weights there.
    real(dp), intent(in) :: x(n_points, dim), weight(n_points, n_vertices)
    real(dp), intent(out) :: strain(n_points, n_strains)
    real(dp) :: t(points, dim), power(points, n_lower), total(points, n_strains), line(points)
    integer :: i, k, q, s, v
    do q = 0, n_points - points, points
      total = 0
      do v = 1, n_vertices
        associate (origin => centre(:, vertex(v)), a => axes(:, :, vertex(v)), c => coefficient(:, :, vertex(v)))
          do i = 1, dim
            line = 0
            do k = 1, dim
              line = line + a(i, k)*(x(q + 1:q + points, k) - origin(k))
            end do
            t(:, i) = line
          end do
          power(:, 1) = weight(q + 1:q + points, v)
          do k = 2, n_lower
            line = power(:, parent(k))*t(:, axis(k))
            power(:, k) = line
          end do
          if (n_strains == 6) then
            call add_polynomials_6(n_lower, c, power, total)
          else
            call add_polynomials_3(n_lower, c, power, total)
          end if
        end associate
      end do
      do s = 1, n_strains
        strain(q + 1:q + points, s) = total(:, s)
      end do
    end do
  end subroutine mean_strains

  !> Add polynomials of six strains at four points.
  pure subroutine add_polynomials_6(n, coefficient, power, total)
    integer, intent(in) :: n
    real(dp), intent(in) :: coefficient(6, n), power(points, n)
    real(dp), intent(inout) :: total(points, 6)
    real(dp), dimension(points) :: s1, s2, s3, s4, s5, s6
    integer :: k
    s1 = total(:, 1)
    s2 = total(:, 2)
    s3 = total(:, 3)
    s4 = total(:, 4)
    s5 = total(:, 5)
    s6 = total(:, 6)
    do k = 1, n
      s1 = s1 + coefficient(1, k)*power(:, k)
      s2 = s2 + coefficient(2, k)*power(:, k)
      s3 = s3 + coefficient(3, k)*power(:, k)
      s4 = s4 + coefficient(4, k)*power(:, k)
      s5 = s5 + coefficient(5, k)*power(:, k)
      s6 = s6 + coefficient(6, k)*power(:, k)
    end do
    total(:, 1) = s1
    total(:, 2) = s2
    total(:, 3) = s3
    total(:, 4) = s4
    total(:, 5) = s5
    total(:, 6) = s6
  end subroutine add_polynomials_6

  !> Add polynomials of three strains at four points.
  pure subroutine add_polynomials_3(n, coefficient, power, total)
    integer, intent(in) :: n
    real(dp), intent(in) :: coefficient(3, n), power(points, n)
    real(dp), intent(inout) :: total(points, 3)
    integer :: k, s
    do k = 1, n
      do s = 1, 3
        total(:, s) = total(:, s) + coefficient(s, k)*power(:, k)
      end do
    end do
  end subroutine add_polynomials_3
end module dotyk_elasticity_patch_fit
