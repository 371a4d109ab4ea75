!> Gradient recovery: polynomial-preserving recovery of the strains of a displacement (Zhang and Naga, SIAM J. Sci.
!> Comput. 26, 2005).
!>
!> On the patch of elements around a vertex, a polynomial of one degree more than that of the elements is fitted to the
!> nodal displacements by weighted least squares. Where the displacement is such a polynomial and the patch determines
!> it, the gradient of the fit is exact, on any mesh and up to the boundary; where it is smooth, the gradient is
!> superconvergent. Bodies of one or two layers of elements do not determine the whole polynomial: polynomials of lower
!> degrees are then fitted first, so that at least these are reproduced. The fit uses axes in which the patch is about
!> as long as wide: flat elements do not deteriorate it.
!>
!> Patches, monomials and factors depend on the mesh alone: several displacements of one mesh are fitted together, and
!> load cases keep them.
module dotyk_elasticity_gradient_recovery
  use dotyk_base_memory, only: allowance_t
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_isoparametric_map, only: points_in_row
  use dotyk_elasticity_node_graph, only: incidence_t
  use dotyk_elasticity_recovery_patch, only: add_ring, evaluate_monomials, lanes, monomials_t, recovery_patch_t
  use dotyk_linalg_blas, only: dgemm
  use dotyk_linalg_dense, only: factorize_gram, least_squares, solve_gram
  use dotyk_mesh_body_mesh, only: body_mesh_t
  use dotyk_mesh_element, only: element_kind, element_kind_t
  implicit none
  private
  public :: vertex_functions

  !> Recovered strains of several bodies of one mesh: polynomials around the vertices.
  type, public :: gradient_recovery_t
    type(monomials_t) :: monomials  !! Monomials of the fitted displacements.
    integer :: n_bodies = 0  !! Number of bodies.
    integer :: n_vertices = 0  !! Number of vertices.
    !> Number of strains: xx yy zz yz xz xy in three dimensions, xx yy xy in two, with engineering shear strains.
    integer :: n_strains = 0
    integer, allocatable :: vertex(:)  !! Vertex of each node, 0 for nodes that are no vertices (n_nodes).
    real(dp), allocatable :: centre(:, :)  !! Positions of the vertices (dim, n_vertices) [length].
    !> Axes of the patches, as rows, in which no node is farther from the vertex than 1 (dim, dim, n_vertices)
    !> [1/length].
    real(dp), allocatable :: axes(:, :, :)
    !> Coefficients of the strains in axes (x - centre) (n_bodies, n_strains, n_lower, n_vertices) [].
    real(dp), allocatable :: strain(:, :, :, :)
    integer, allocatable :: node(:)  !! Nodes of the vertices (n_vertices).
    type(allowance_t) :: room  !! Memory for patches that are kept; none at first.
    !> Patches that are kept; without nodes where not. Empty where there is no memory for any (n_vertices).
    type(vertex_fit_t), allocatable :: fit(:)
    real(dp), allocatable :: u(:, :, :)  !! The displacements (n_bodies, dim, n_nodes) [length].
  contains
    procedure :: init => gradient_recovery_init
    procedure :: take => gradient_recovery_take
    procedure :: give => gradient_recovery_give
  end type gradient_recovery_t

  type, public :: recovered_strains_t  !! Displacements of some bodies, and the strains recovered from them.
    real(dp), allocatable :: u(:, :, :)  !! As in `gradient_recovery_t` (n_bodies, dim, n_nodes) [length].
    real(dp), allocatable :: strain(:, :, :, :)  !! Likewise (n_bodies, n_strains, n_lower, n_vertices) [].
  end type recovered_strains_t


  !> Strain of a derivative in three dimensions (component, variable).
  integer, parameter :: strain_3d(3, 3) = reshape([1, 6, 5, 6, 2, 4, 5, 4, 3], [3, 3])
  !> Strain of a derivative in two dimensions (component, variable).
  integer, parameter :: strain_2d(2, 2) = reshape([1, 3, 3, 2], [2, 2])

  type :: vertex_fit_t  !! The fit of one vertex.
    integer :: n_nodes = 0  !! Number of nodes of the patch.
    integer :: rows = 0  !! Number of rows of the values of the monomials.
    logical :: is_full = .false.  !! Whether the nodes determine the polynomial of the full degree.
    integer, allocatable :: node(:)  !! The nodes; the first one is the vertex (n_nodes).
    real(dp), allocatable :: root_weight(:)  !! Square roots of their weights (n_nodes) [].
    real(dp), allocatable :: power(:)  !! Values of the monomials times these roots (rows*n) [].
    real(dp), allocatable :: r(:, :)  !! Factor of the normal equations (n, n) [].
    integer, allocatable :: pivot(:)  !! Its pivots (n).
  contains
    procedure :: init => vertex_fit_init
    procedure :: solve => vertex_fit_solve
    procedure :: bytes => vertex_fit_bytes
  end type vertex_fit_t

  !> Largest number of rings of elements around a vertex: bodies of a few elements have few nodes.
  integer, parameter :: most_rings = 4
  !> Smallest inverse condition number of the least squares for which one ring of elements determines the polynomial.
  real(dp), parameter :: well_determined = 3.0e-3_dp
  !> The same for two rings, beyond which undetermined terms are dropped. More rings do not help: in a plate of one
  !> layer of elements they overestimated the error by a factor of three.
  real(dp), parameter :: determined = 3.0e-4_dp

contains

  !> Recover the strains of displacements. Those of the same displacements, and patches that were kept, are reused.
  subroutine gradient_recovery_init(self, mesh, u)
    class(gradient_recovery_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body; always the same.
    real(dp), intent(in), contiguous :: u(:, :, :)  !! In the axes of the mesh (n_bodies, dim, n_nodes) [length].
    type(vertex_fit_t) :: fit
    type(incidence_t) :: elements
    type(recovery_patch_t) :: patch
    real(dp), allocatable :: coefficient(:)
    integer :: v, dim
    logical :: keeps, is_kept
    if (allocated(self%u)) then
      if (size(self%u) == size(u)) then
        ! NaN differs from itself: nothing is reused then.
        if (all(abs(self%u - u) <= 0)) return
      end if
      deallocate (self%strain)
    else
      call find_vertices(self, mesh)
    end if
    dim = mesh%dimension
    self%n_bodies = size(u, 1)
    allocate (self%strain(self%n_bodies, self%n_strains, self%monomials%n_lower, self%n_vertices))
    self%u = u
    keeps = size(self%fit) > 0
    is_kept = keeps
    if (keeps) is_kept = all(self%fit%n_nodes > 0)
    if (.not. is_kept) call elements%init(mesh)
    !$omp parallel default(none) shared(self, mesh, u, elements, dim, keeps) &
    !$omp& private(v, patch, coefficient, fit, is_kept)
    allocate (coefficient(self%n_bodies*dim*self%monomials%n))
    !$omp do schedule(dynamic, 16)
    do v = 1, self%n_vertices
      is_kept = keeps
      if (keeps) is_kept = self%fit(v)%n_nodes > 0
      if (is_kept) then
        call self%fit(v)%solve(self%monomials, self%n_bodies*dim, u, coefficient)
      else
        call fit%init(self%monomials, elements, self%vertex, mesh%x, self%node(v), patch, self%axes(:, :, v))
        call fit%solve(self%monomials, self%n_bodies*dim, u, coefficient)
        if (keeps) then
          if (self%room%take(fit%bytes())) self%fit(v) = fit
        end if
      end if
      call differentiate(self%monomials, self%n_bodies, coefficient, self%axes(:, :, v), self%strain(:, :, :, v))
    end do
    !$omp end do
    deallocate (coefficient)
    !$omp end parallel
  end subroutine gradient_recovery_init

  !> Copy what was recovered for some of the bodies.
  pure subroutine gradient_recovery_give(self, first, last, recovered)
    class(gradient_recovery_t), intent(in) :: self
    integer, intent(in) :: first, last  !! The bodies.
    type(recovered_strains_t), intent(out) :: recovered  !! Their displacements and strains.
    recovered%u = self%u(first:last, :, :)
    recovered%strain = self%strain(first:last, :, :, :)
  end subroutine gradient_recovery_give

  !> Take what was recovered for some bodies in place of what is there.
  pure subroutine gradient_recovery_take(self, recovered)
    class(gradient_recovery_t), intent(inout) :: self
    type(recovered_strains_t), intent(inout) :: recovered  !! Their displacements and strains; nothing on return.
    call move_alloc(recovered%u, self%u)
    call move_alloc(recovered%strain, self%strain)
    self%n_bodies = size(self%u, 1)
  end subroutine gradient_recovery_take

  !> Find the vertices, and choose the monomials.
  subroutine find_vertices(self, mesh)
    class(gradient_recovery_t), intent(inout) :: self
    type(body_mesh_t), intent(in) :: mesh  !! Elements and nodes of the body.
    type(element_kind_t) :: kind
    logical, allocatable :: corner(:)
    integer :: b, i, v, order
    allocate (corner(mesh%n_nodes()), source=.false.)
    order = 1
    do b = 1, size(mesh%block)
      kind = element_kind(mesh%block(b)%kind)
      order = max(order, kind%order)
      do i = 1, kind%n_corners
        corner(mesh%block(b)%node(i, :)) = .true.
      end do
    end do
    call self%monomials%init(mesh%dimension, order + 1)
    self%node = pack([(i, i=1, size(corner))], corner)
    self%n_vertices = size(self%node)
    self%n_strains = mesh%dimension*(mesh%dimension + 1)/2
    allocate (self%vertex(size(corner)), source=0)
    self%vertex(self%node) = [(v, v=1, self%n_vertices)]
    self%centre = mesh%x(:, self%node)
    allocate (self%axes(mesh%dimension, mesh%dimension, self%n_vertices))
    allocate (self%fit(merge(self%n_vertices, 0, self%room%left > 0)))
  end subroutine find_vertices

  !> Strains of the fitted polynomials.
  pure subroutine differentiate(monomials, n_bodies, coefficient, axes, strain)
    type(monomials_t), intent(in) :: monomials  !! Monomials of the fit.
    integer, intent(in) :: n_bodies  !! Number of bodies.
    !> Coefficients of the displacements (n_bodies, dim, monomials%n) [length].
    real(dp), intent(in) :: coefficient(n_bodies, monomials%dimension, monomials%n)
    real(dp), intent(in) :: axes(:, :)  !! Axes of the patch, as rows (dim, dim) [1/length].
    real(dp), intent(out) :: strain(:, :, :)  !! Strains in the axes of the mesh (n_bodies, n_strains, n_lower) [].
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
    integer, intent(in) :: dim  !! Number of coordinates.
    integer, intent(in) :: n_lower  !! Number of monomials of the strains.
    integer, intent(in) :: n_vertices  !! Number of vertices.
    integer, intent(in) :: n_points  !! Number of points, a multiple of `points_in_row`.
    integer, intent(in) :: vertex(n_vertices)  !! The vertices (n_vertices).
    integer, intent(in) :: parent(n_lower)  !! Earlier monomial of each product, see `monomials_t` (n_lower).
    integer, intent(in) :: axis(n_lower)  !! Variable of each product, see `monomials_t` (n_lower).
    real(dp), intent(in) :: centre(dim, *)  !! Positions of all vertices of the body (dim, *) [length].
    real(dp), intent(in) :: axes(dim, dim, *)  !! Axes of all patches of the body (dim, dim, *) [1/length].
    real(dp), intent(in) :: x(n_points, dim)  !! Points (n_points, dim) [length].
    real(dp), intent(in) :: weight(n_points, n_vertices)  !! Weights of the vertices at the points [].
    real(dp), intent(out) :: values(n_points, n_lower, n_vertices)  !! Values of the basis [].
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

  !> Choose the patch and factorize. Rings of elements are added until the nodes determine the polynomial: one ring in
  !> the interior, two at most places of the boundary.
  subroutine vertex_fit_init(self, monomials, elements, vertex, x, node, patch, axes)
    class(vertex_fit_t), intent(inout) :: self
    type(monomials_t), intent(in) :: monomials  !! Monomials of the fit.
    type(incidence_t), intent(in) :: elements  !! Incidence of nodes and elements.
    integer, intent(in) :: vertex(:)  !! Vertex of each node, 0 for none (n_nodes).
    real(dp), intent(in), contiguous :: x(:, :)  !! Nodes of the body (dim, n_nodes) [length].
    integer, intent(in) :: node  !! Node of the vertex.
    type(recovery_patch_t), intent(inout) :: patch  !! Work space.
    real(dp), intent(out) :: axes(:, :)  !! Axes of the patch, as rows (dim, dim) [1/length].
    integer :: i, ring, inner, rank
    call patch%nodes%clear()
    call patch%nodes%add(node)
    inner = 0
    self%is_full = .false.
    if (.not. allocated(self%r)) allocate (self%r(monomials%n, monomials%n), self%pivot(monomials%n))
    do ring = 1, most_rings
      call add_ring(elements%start, elements%node, elements%first, elements%element, vertex, inner, patch%nodes)
      if (ring < most_rings .and. patch%nodes%n < monomials%n + 1) cycle
      call patch%fill(monomials%dimension, x, axes)
      self%rows = lanes*patch%n_blocks
      if (allocated(self%power)) deallocate (self%power)
      allocate (self%power(self%rows*monomials%n))
      call evaluate_monomials(monomials%dimension, monomials%n, patch%n_blocks, monomials%parent, monomials%axis, &
                              patch%t, patch%root_weight, self%power)
      call factorize(monomials%n, self%rows, patch%nodes%n, self%power, merge(well_determined, determined, ring == 1), &
                     self%r, self%pivot, rank)
      self%is_full = rank == monomials%n
      if (self%is_full .or. ring > 1) exit
    end do
    self%n_nodes = patch%nodes%n
    self%node = patch%nodes%member(:patch%nodes%n)
    self%root_weight = [(patch%root_weight(mod(i - 1, lanes) + 1, (i - 1)/lanes + 1), i=1, patch%nodes%n)]
  end subroutine vertex_fit_init

  !> Memory of a fit [bytes].
  pure integer(int64) function vertex_fit_bytes(self) result(bytes)
    class(vertex_fit_t), intent(in) :: self
    bytes = 8_int64*(size(self%power) + size(self%r) + 2*self%n_nodes + size(self%pivot))
  end function vertex_fit_bytes

  !> Factorize the normal equations of the full degree.
  subroutine factorize(n, rows, n_nodes, power, tolerance, r, pivot, rank)
    integer, intent(in) :: n  !! Number of monomials.
    integer, intent(in) :: rows  !! Number of rows of their values.
    integer, intent(in) :: n_nodes  !! Number of nodes of the patch.
    real(dp), intent(in) :: power(rows, n)  !! Values of the monomials times the square roots of the weights [].
    real(dp), intent(in) :: tolerance  !! Smallest inverse condition number of the least squares [].
    real(dp), intent(out) :: r(n, n)  !! Factor (n, n) [].
    integer, intent(out) :: pivot(n)  !! Its pivots (n).
    integer, intent(out) :: rank  !! Number of monomials that the nodes determine.
    real(dp) :: gram(n, n)
    call dgemm('T', 'N', n, n, n_nodes, 1.0_dp, power, rows, power, rows, 0.0_dp, gram, n)
    call factorize_gram(n, gram, tolerance, r, pivot, rank)
  end subroutine factorize

  !> Fit values.
  subroutine vertex_fit_solve(self, monomials, n_values, values, coefficient)
    class(vertex_fit_t), intent(in) :: self
    type(monomials_t), intent(in) :: monomials  !! Monomials of the fit.
    integer, intent(in) :: n_values  !! Number of fitted values per node: displacement components of all bodies.
    real(dp), intent(in) :: values(n_values, *)  !! Fitted values (n_values, n_nodes of the body) [length].
    real(dp), intent(out) :: coefficient(n_values, monomials%n)  !! Of the fitted values [length].
    real(dp), allocatable :: relative(:, :)
    integer :: i
    allocate (relative(n_values, self%n_nodes))
    do i = 1, self%n_nodes
      relative(:, i) = self%root_weight(i)*(values(:, self%node(i)) - values(:, self%node(1)))
    end do
    if (self%is_full) then
      call fit_full_degree(monomials%n, self%rows, self%n_nodes, n_values, self%power, self%r, self%pivot, relative, &
                           coefficient)
    else
      call fit_by_degrees(monomials, self%rows, self%power, self%n_nodes, relative, coefficient)
    end if
  end subroutine vertex_fit_solve

  !> Fit polynomials of the full degree by normal equations.
  subroutine fit_full_degree(n, rows, n_nodes, m, power, r, pivot, value, coefficient)
    integer, intent(in) :: n  !! Number of monomials.
    integer, intent(in) :: rows  !! Number of rows of their values.
    integer, intent(in) :: n_nodes  !! Number of nodes of the patch.
    integer, intent(in) :: m  !! Number of fitted values per node.
    real(dp), intent(in) :: power(rows, n)  !! Values of the monomials times the square roots of the weights [].
    real(dp), intent(in) :: r(n, n)  !! Factor of the normal equations (n, n) [].
    integer, intent(in) :: pivot(n)  !! Its pivots (n).
    real(dp), intent(inout) :: value(m, n_nodes)  !! Fitted values times the square roots; residuals on return [length].
    real(dp), intent(out) :: coefficient(m, n)  !! Coefficients (m, n) [length].
    real(dp) :: correction(m, n)
    call dgemm('N', 'N', m, n, n_nodes, 1.0_dp, value, m, power, rows, 0.0_dp, coefficient, m)
    call solve_gram(n, m, r, pivot, coefficient)
    ! The normal equations square the condition number; one step of iterative refinement makes up for it.
    call dgemm('N', 'T', m, n_nodes, n, -1.0_dp, coefficient, m, power, rows, 1.0_dp, value, m)
    call dgemm('N', 'N', m, n, n_nodes, 1.0_dp, value, m, power, rows, 0.0_dp, correction, m)
    call solve_gram(n, m, r, pivot, correction)
    coefficient = coefficient + correction
  end subroutine fit_full_degree

  !> Fit polynomials of rising degree to the residuals of the degrees before, so that low degrees are reproduced, and
  !> drop undetermined terms.
  subroutine fit_by_degrees(monomials, rows, power, n_nodes, value, coefficient)
    type(monomials_t), intent(in) :: monomials  !! Monomials of the fit.
    integer, intent(in) :: rows  !! Number of rows of the values of the monomials.
    integer, intent(in) :: n_nodes  !! Number of nodes of the patch.
    real(dp), intent(in) :: power(rows, monomials%n)  !! Monomials times square roots of the weights [].
    real(dp), intent(in) :: value(:, :)  !! Fitted values times the same square roots (n_values, >= n_nodes) [length].
    real(dp), intent(out) :: coefficient(:, :)  !! Coefficients (n_values, monomials%n) [length].
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
    real(dp), intent(in) :: a(:, :)  !! Monomials at the nodes, weighted (n_nodes, n) [].
    real(dp), intent(inout) :: b(:, :)  !! Residuals (n_nodes, n_values) [length].
    real(dp), intent(in) :: tolerance  !! Smallest inverse condition number, see `least_squares` [].
    real(dp), intent(inout) :: coefficient(:, :)  !! Coefficients (n_values, n) [length].
    integer, intent(out) :: rank  !! Number of monomials that the nodes determine.
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
end module dotyk_elasticity_gradient_recovery
