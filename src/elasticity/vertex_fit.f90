!> The polynomial that is fitted to values at the nodes around a vertex.
!>
!> Patch, monomials and factor depend on the mesh alone: a fit that is kept serves other values.
module dotyk_elasticity_vertex_fit
  use dotyk_base_error, only: error_t
  use dotyk_base_kinds, only: dp, int64
  use dotyk_elasticity_monomials, only: evaluate_monomials, lanes, monomials_t
  use dotyk_elasticity_node_graph, only: incidence_t
  use dotyk_elasticity_recovery_patch, only: add_ring, recovery_patch_t
  use dotyk_linalg_blas, only: dgemm
  use dotyk_linalg_dense, only: least_squares
  use dotyk_linalg_normal_equations, only: factorize_gram, solve_gram
  implicit none
  private

  type, public :: vertex_fit_t  !! The fit of one vertex.
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
    !> Values of the monomials times the square roots of the weights (rows, n) [].
    real(dp), intent(in) :: power(rows, n)
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
    !> Coefficients of the fitted values in the axes of the patch (n_values, monomials%n) [length].
    real(dp), intent(out) :: coefficient(n_values, monomials%n)
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
    !> Values of the monomials times the square roots of the weights (rows, n) [].
    real(dp), intent(in) :: power(rows, n)
    real(dp), intent(in) :: r(n, n)  !! Factor of the normal equations (n, n) [].
    integer, intent(in) :: pivot(n)  !! Its pivots (n).
    !> Fitted values times the square roots; residuals on return (m, n_nodes) [length].
    real(dp), intent(inout) :: value(m, n_nodes)
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
    !> Values of the monomials times the square roots of the weights (rows, monomials%n) [].
    real(dp), intent(in) :: power(rows, monomials%n)
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
end module dotyk_elasticity_vertex_fit
